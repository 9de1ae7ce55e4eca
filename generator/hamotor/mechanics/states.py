"""Random states of a system and what its programs make of them, in mpmath's numbers."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import mpmath

from hamotor.codegen.algebra import Algebra, Blade, add_scaled
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.straightline import FUNCTIONS
from hamotor.mechanics.system import System

DIGITS = 100
"""Of states and of all that is computed from them; set by `mpmath.workdps`."""
SAME = mpmath.mpf(10) ** -50
"""Two arguments of an absolute value that differ by less, relatively, are one."""
MOST_ATTEMPTS = 20
GROWING = ("exp", "sin", "cos", "tan", "sinh", "cosh", "tanh")
MOST_ARGUMENT = 10**9
"""Of these functions: beyond, their exact evaluation takes as many digits as the argument has."""

Number = Any
"""One of mpmath's numbers: complex where a root is continued beyond its domain."""
Functions = dict[str, Callable[..., Any]]
"""What a program may call, by name."""


class Undefined(ValueError):
    """H has no value in the states that were tried."""


@dataclass(frozen=True)
class State:
    """Where the bodies are and what the gradient program says there; one entry a body."""

    values: Mapping[str, Number]
    """Of all names that a program may use."""
    functions: Functions
    motors: tuple[Mapping[Blade, Number], ...]
    momenta: tuple[list[Number], ...]
    rates: tuple[list[Number], ...]
    """B."""
    forques: tuple[list[Number], ...]
    """F_b, with what is applied."""

    def size(self, k: int) -> Number:
        """How large the terms of body k's μ̇ are."""
        return max(largest(self.forques[k]), largest(self.rates[k]) * largest(self.momenta[k]))


def random_states(system: System) -> Iterator[State]:
    """The same states in every process, without end; `Undefined` where H has no value.

    Momenta are scaled so that ad*_B μ and F are alike in size: neither is to be lost below the
    other. Motors are products of the generators' exponentials.
    """
    drawn = random.Random(1)
    factors = [mpmath.mpf(1)] * len(system.hamiltonian.bodies)
    first = _defined(system, drawn, factors)
    for k in range(len(factors)):
        forque = largest(first.forques[k])
        turning = largest(first.rates[k]) * largest(first.momenta[k])
        if forque and turning:
            factors[k] = mpmath.sqrt(forque / turning)
    while True:
        yield _defined(system, drawn, factors)


def _defined(system: System, drawn: random.Random, factors: list[Number]) -> State:
    for _ in range(MOST_ATTEMPTS):
        with suppress(ZeroDivisionError, TypeError, ValueError):
            return _state(system, drawn, factors)
    raise Undefined(f"H has no value in any of {MOST_ATTEMPTS} random states")


def _state(system: System, drawn: random.Random, factors: list[Number]) -> State:
    values: dict[str, Number] = {"t": _number(drawn)}
    motors, momenta = [], []
    bodies = system.hamiltonian.bodies
    for k, body in enumerate(bodies):
        motor: Any = {0: mpmath.mpf(1)}
        for generator in body.group.generators:
            step = exponential(body.algebra, generator.bivector, _number(drawn))
            motor = body.algebra.multiply(motor, step)
        motors.append(motor)
        momenta.append([factors[k] * _number(drawn) for _ in body.momenta])
        values |= motor_values(body, k, motor)
        values |= momentum_values(body, k, momenta[k])
    for symbol in system.drawn:
        x = real(Fraction(*system.hamiltonian.parameters[symbol].as_numer_denom()))
        values[system.names[symbol]] = x * (1 + _number(drawn) / 2) if x else _number(drawn)
    chosen = functions(drawn)
    found = system.gradient.evaluate(values, chosen)
    generators = system.hamiltonian.group.generators
    return State(
        values,
        chosen,
        tuple(motors),
        tuple(momenta),
        tuple([found[f"rate{k}.{g.rate}"] for g in generators] for k in range(len(bodies))),
        tuple([found[f"forque{k}.{g.momentum}"] for g in generators] for k in range(len(bodies))),
    )


def _number(drawn: random.Random) -> Number:
    return mpmath.mpf(drawn.choice((-1, 1)) * drawn.randint(100, 1000)) / 1009


def motor_values(body: Coordinates, k: int, motor: Mapping[Blade, Any]) -> dict[str, Number]:
    """The components of body k's motor under the names that programs have for them."""
    element = body.group.element
    return {
        f"m{k}.{component.name}": paired(reading, motor)
        for component, reading in zip(element.components, element.reading, strict=True)
    }


def momentum_values(body: Coordinates, k: int, momentum: Iterable[Any]) -> dict[str, Number]:
    """The components of body k's momentum under the names that programs have for them."""
    generators = body.group.generators
    return {f"mu{k}.{g.momentum}": p for g, p in zip(generators, momentum, strict=True)}


def paired(functional: Mapping[Blade, Any], multivector: Mapping[Blade, Any]) -> Number:
    """A linear functional with exact coefficients, of a multivector."""
    terms = (
        real(x) * multivector[blade] for blade, x in functional.items() if blade in multivector
    )
    return sum(terms, mpmath.mpf(0))


def coadjoint(body: Coordinates, rate: list[Number], momentum: list[Number]) -> list[Number]:
    """ad*_B μ: component i is μ([B, E_i])."""
    structure = body.group.structure
    total = [mpmath.mpf(0)] * len(rate)
    for j, x in enumerate(rate):
        for i, bracket in enumerate(structure[j]):
            for y, p in zip(bracket, momentum, strict=True):
                if y:
                    total[i] += real(y) * x * p
    return total


def real(x: Any) -> Number:
    """An exact number in the working precision."""
    return mpmath.mpf(x.numerator) / x.denominator


def largest(numbers: Iterable[Number]) -> Number:
    """The largest magnitude."""
    return max(map(abs, numbers))


def exponential(algebra: Algebra, bivector: Mapping[Blade, Any], a: Number) -> Any:
    """exp of a multiple of a generator: (1 + aE)/√(1 − a²E²) where E² is a number."""
    step: Any = {blade: a * real(x) for blade, x in bivector.items()}
    square: Any = algebra.multiply(step, step)
    if set(square) <= {0}:
        norm = mpmath.sqrt(1 - square.get(0, 0))
        return {0: 1 / norm} | {blade: x / norm for blade, x in step.items()}
    total: Any = {0: mpmath.mpf(1)}
    term, n = dict(total), 0
    while max(map(abs, term.values()), default=0) > mpmath.eps:
        n += 1
        term = {blade: x / n for blade, x in algebra.multiply(term, step).items()}
        add_scaled(total, term, 1)
    return total


def functions(drawn: random.Random) -> Functions:
    """What a program may call; each argument of an absolute value gets a sign by lot."""
    signs: list[tuple[Number, int]] = []

    def sign(x: Number) -> int:
        for known, chosen in signs:
            for same in (1, -1):
                if abs(x - same * known) <= SAME * abs(known):
                    return same * chosen
        signs.append((x, drawn.choice((-1, 1))))
        return signs[-1][1]

    known = {name: getattr(mpmath, name) for name in FUNCTIONS.values() if hasattr(mpmath, name)}
    return known | {
        **{name: _bounded(known[name]) for name in GROWING},
        "sqrt": mpmath.sqrt,
        "atan2": _angle,
        "abs": lambda x: sign(x) * x,
        "sign": sign,
        "number": real,
    }


def _bounded(function: Callable[[Number], Number]) -> Callable[[Number], Number]:
    def on_moderate(x: Number) -> Number:
        if abs(x) > MOST_ARGUMENT:
            raise ValueError("beyond what double holds")
        return function(x)

    return on_moderate


def _angle(y: Number, x: Number) -> Number:
    """atan2, continued to complex numbers."""
    if isinstance(x, mpmath.mpf) and isinstance(y, mpmath.mpf):
        return mpmath.atan2(y, x)
    return -1j * mpmath.log((x + 1j * y) / mpmath.sqrt(x * x + y * y))
