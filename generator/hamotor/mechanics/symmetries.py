"""Which quantities the exact motion under a Hamiltonian keeps constant.

* The energy, if H does not know the time and nothing is applied. Otherwise a run reports the
  balance H − ∫ P dt, P = `Hamiltonian.power`, which no motion changes either.
* Total spatial momenta: with ζ constant in the world, Σ (M μ M~)(ζ) changes by −Σ F_s(ζ), what is
  applied included and the sum over the bodies (Noether's theorem). All ζ are found for which this
  vanishes in every state.
* A body's own momenta: all ζ constant in its frame with μ̇(ζ) = (ad*_B μ − F_b)(ζ) = 0 in every
  state, such as that of a symmetric top about its axis. One that every motion of the group leaves
  as it is would, with a single body, be its spatial momentum again, and is left out.
* Casimirs C of a body: dC/dt = −Σ ∂C/∂μ_i F_b,i, since ad* does not change them.

Candidates come from numbers: the program that steppers run is evaluated with 100 digits at random
states, one more than there could be independent conditions, and the null space is read off by
elimination. Coefficients are the rationals with the smallest denominators that agree to 50 digits,
where there are such. What is reported holds at three more random states to 1e-35 of the forques
(*tested*: what is false there by less would pass; in exchange a symmetry survives constants that
were rounded to 60 digits). It is *proved* where its rate of change expands to zero in SymPy, as a
function of independent x, y, R, s, μ and t; then it holds without any tolerance. Absolute values
count with either sign in every state, so that what only one of their branches conserves is not
found.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from typing import Any, Literal

import mpmath
import sympy

from hamotor.codegen.algebra import Algebra, Blade, add_scaled, reverse_sign
from hamotor.codegen.polynomial import Polynomial
from hamotor.codegen.program import Program
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.echelon import null_space
from hamotor.mechanics.hamiltonian import Hamiltonian
from hamotor.mechanics.naming import Generators
from hamotor.mechanics.straightline import FUNCTIONS, straight_line
from hamotor.mechanics.system import System

DIGITS = 100
NEGLIGIBLE = mpmath.mpf(10) ** -45
"""Of the size of the forques: less is no condition on a symmetry."""
AGREEMENT = mpmath.mpf(10) ** -35
RECOGNISED = Fraction(1, 10**50)
MOST_DENOMINATOR = 10**20
CHECKS = 3
MOST_ATTEMPTS = 20
MOST_OPERATIONS_PROVED = 2_000
"""A rate of change with more operations is not expanded: that could take longer than the run."""

Number = Any
"""One of mpmath's numbers: complex where a root is continued beyond its domain."""


@dataclass(frozen=True)
class Conserved:
    """A quantity that the exact motion keeps constant."""

    name: str
    """Of its column: `energy`, `spatial_momentum.e12`, `BODY.momentum.e12`, `BODY.casimir.NAME`."""
    unit: str
    description: str
    kind: Literal["energy", "energy_balance", "spatial_momentum", "own"]
    proved: bool
    """Symbolically; otherwise tested in random states."""
    coefficients: tuple[tuple[str, Fraction], ...] = ()
    """A spatial momentum: Σ coefficient · component along the generator; leading coefficient 1."""
    body: str = ""
    """Whose own quantity it is."""
    expression: Expr = sympy.S.Zero
    """An own quantity in the body's momentum symbols."""


def conserved(hamiltonian: Hamiltonian, system: System | None = None) -> tuple[Conserved, ...]:
    """The energy or its balance, spatial momenta, own momenta and Casimirs that are constant.

    system: the programs of the Hamiltonian, if they are there already.
    """
    states = _States(system or System(hamiltonian))
    found = [_energy(hamiltonian)]
    with mpmath.workdps(DIGITS):
        found += _spatial_momenta(states)
        for k in range(len(hamiltonian.bodies)):
            found += _own_momenta(states, k)
            found += _casimirs(states, k)
    return tuple(found)


def _energy(hamiltonian: Hamiltonian) -> Conserved:
    if hamiltonian.conservative:
        words = "kinetic and potential energy of all bodies"
        return Conserved("energy", "J", words, "energy", proved=True)
    words = "energy minus the work done by applied forques and explicit time dependence"
    return Conserved("energy_balance", "J", words, "energy_balance", proved=True)


def _spatial_momenta(states: _States) -> list[Conserved]:
    hamiltonian = states.hamiltonian
    called = Generators.of(hamiltonian.bodies[0])
    units = dict(zip(called.names, hamiltonian.group.momentum_units, strict=True))
    quantities = []
    for element in _constants([s.spatial_change for s in states.all]):
        terms = [(g, x) for g, x in zip(called.names, element, strict=True) if x != 0]
        suffix, description = called.reading(element)
        quantities.append(
            Conserved(
                name=f"spatial_momentum.{terms[0][0]}{suffix}",
                unit=units[terms[0][0]],
                description=description,
                kind="spatial_momentum",
                proved=not any(map(any, hamiltonian.applied))
                and _vanishes(
                    hamiltonian,
                    [
                        (x, forque[i])
                        for forque in hamiltonian.spatial_forques
                        for i, x in enumerate(element)
                    ],
                ),
                coefficients=tuple(terms),
            )
        )
    return quantities


def _own_momenta(states: _States, k: int) -> list[Conserved]:
    hamiltonian = states.hamiltonian
    body = hamiltonian.bodies[k]
    called = Generators.of(body)
    units = dict(zip(called.names, body.group.momentum_units, strict=True))
    alone = len(hamiltonian.bodies) == 1
    quantities = []
    for element in _constants([s.own_change(k) for s in states.all]):
        if alone and all(s.leaves(k, element) for s in states.all):
            continue
        terms = [(g, x) for g, x in zip(called.names, element, strict=True) if x != 0]
        suffix, description = called.reading(element, body.body)
        rates = hamiltonian.momentum_rates[k]
        quantities.append(
            Conserved(
                name=f"{body.body}.momentum.{terms[0][0]}{suffix}",
                unit=units[terms[0][0]],
                description=description,
                kind="own",
                proved=_vanishes(hamiltonian, list(zip(element, rates, strict=True))),
                body=body.body,
                expression=sympy.Add(
                    *(_exact(x) * p for x, p in zip(element, body.momenta, strict=True))
                ),
            )
        )
    return quantities


def _casimirs(states: _States, k: int) -> list[Conserved]:
    hamiltonian = states.hamiltonian
    body = hamiltonian.bodies[k]
    momenta = {g.momentum: p for g, p in zip(body.group.generators, body.momenta, strict=True)}
    forques = hamiltonian.all_forques[k]
    quantities = []
    for casimir in body.group.casimirs:
        if all(len(monomial) == 1 for monomial in casimir.numerator):
            continue  # one of the body's own momenta
        expression = _polynomial(casimir.numerator, momenta) / _polynomial(
            casimir.denominator, momenta
        )
        slopes = [sympy.diff(expression, p) for p in body.momenta]
        change = straight_line({str(i): x for i, x in enumerate(slopes)}, states.system.names)
        if not any(forques) or all(s.casimir_is_constant(k, change) for s in states.all):
            quantities.append(
                Conserved(
                    name=f"{body.body}.casimir.{casimir.name}",
                    unit=casimir.unit,
                    description=f"{casimir.formula} of {body.body}",
                    kind="own",
                    proved=_vanishes(hamiltonian, list(zip(slopes, forques, strict=True))),
                    body=body.body,
                    expression=expression,
                )
            )
    return quantities


def _polynomial(polynomial: Polynomial, symbols: Mapping[str, Expr]) -> Expr:
    return sympy.Add(
        *(
            sympy.Rational(x.numerator, x.denominator) * sympy.Mul(*(symbols[n] for n in names))
            for names, x in polynomial.items()
        )
    )


def _vanishes(hamiltonian: Hamiltonian, terms: Sequence[tuple[Any, Expr]]) -> bool:
    """Whether Σ coefficient · expression expands to zero, variables taken as independent."""
    total = sympy.Add(*(_exact(x) * expression for x, expression in terms if x and expression))
    if total == 0:
        return True
    if sympy.count_ops(total) > MOST_OPERATIONS_PROVED:
        return False
    return bool(sympy.expand(total.subs(dict(hamiltonian.parameters))) == 0)


def _exact(x: Any) -> Expr:
    return sympy.Rational(x.numerator, x.denominator) if isinstance(x, Fraction) else x


def _constants(changes: Sequence[tuple[Sequence[Number], Number]]) -> list[list[Fraction]]:
    """All ζ for which change·ζ vanishes in every state; the last `CHECKS` states are tests.

    changes: how fast each component changes, and the size of the terms that make it up.
    """
    rows = [[x / size for x in change] if size else list(change) for change, size in changes]
    basis = null_space(rows[:-CHECKS], len(rows[0]), mpmath.mpf(1), NEGLIGIBLE)
    return [
        element
        for element in ([_recognised(x) for x in vector] for vector in basis)
        if all(abs(_paired(row, element)) <= AGREEMENT for row in rows[-CHECKS:])
    ]


def _paired(row: Sequence[Number], element: Sequence[Fraction]) -> Number:
    """row·element, the element taken to have size 1."""
    return sum(x * y for x, y in zip(row, element, strict=True)) / _mpf(_largest(element))


def _recognised(x: Number) -> Fraction:
    real = mpmath.re(x)
    mantissa, exponent = real.man_exp
    exact = Fraction(int(mpmath.sign(real)) * int(mantissa)) * Fraction(2) ** int(exponent)
    simple = exact.limit_denominator(MOST_DENOMINATOR)
    return simple if abs(simple - exact) <= RECOGNISED * max(Fraction(1), abs(exact)) else exact


def _mpf(x: Any) -> Number:
    return mpmath.mpf(x.numerator) / x.denominator


@dataclass(frozen=True)
class _State:
    """What happens in one state of the system."""

    bodies: tuple[Coordinates, ...]
    momenta: tuple[list[Number], ...]
    rates: tuple[list[Number], ...]
    forques: tuple[list[Number], ...]
    """F_b, with what is applied."""
    adjoints: tuple[list[list[Number]], ...]
    """Row j: M~ E_j M in the generators."""

    def size(self, k: int) -> Number:
        """How large the terms of body k's μ̇ are."""
        return max(_largest(self.forques[k]), _largest(self.rates[k]) * _largest(self.momenta[k]))

    @cached_property
    def spatial_change(self) -> tuple[list[Number], Number]:
        """Σ F_s: for each generator of the world, F_b of what M~ makes of it."""
        change = [
            sum(
                x * f
                for adjoint, forque in zip(self.adjoints, self.forques, strict=True)
                for x, f in zip(adjoint[j], forque, strict=True)
            )
            for j in range(len(self.forques[0]))
        ]
        size = max(
            self.size(k) * max(map(_largest, adjoint)) for k, adjoint in enumerate(self.adjoints)
        )
        return change, size

    def own_change(self, k: int) -> tuple[list[Number], Number]:
        """μ̇ of body k."""
        change = [c - f for c, f in zip(self.coadjoint(k), self.forques[k], strict=True)]
        return change, self.size(k)

    def coadjoint(self, k: int) -> list[Number]:
        """ad*_B μ of body k."""
        structure, rate, momentum = self.bodies[k].group.structure, self.rates[k], self.momenta[k]
        n = range(len(rate))
        return [
            sum(
                (
                    _mpf(structure[j][i][m]) * rate[j] * momentum[m]
                    for j in n
                    for m in n
                    if structure[j][i][m]
                ),
                mpmath.mpf(0),
            )
            for i in n
        ]

    def leaves(self, k: int, element: Sequence[Fraction]) -> bool:
        """Whether M~ ζ M = ζ for body k."""
        moved = [
            sum(x * y for x, y in zip(element, column, strict=True))
            for column in zip(*self.adjoints[k], strict=True)
        ]
        return bool(_largest(x - _mpf(y) for x, y in zip(moved, element, strict=True)) <= AGREEMENT)

    def casimir_is_constant(self, k: int, slopes: Program) -> bool:
        """Whether ∂C/∂μ · F_b vanishes for body k."""
        values = {
            f"mu{k}.{g.momentum}": p
            for g, p in zip(self.bodies[k].group.generators, self.momenta[k], strict=True)
        }
        found = list(slopes.evaluate(values, _functions(random.Random(0))).values())
        change = sum(x * f for x, f in zip(found, self.forques[k], strict=True))
        return bool(abs(change) <= AGREEMENT * _largest(found) * self.size(k))


class _States:
    """Random states of a system, the same ones in every process."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.hamiltonian = system.hamiltonian
        self.random = random.Random(1)
        self.factors = [mpmath.mpf(1)] * len(self.hamiltonian.bodies)

    @cached_property
    def all(self) -> list[_State]:
        """One more than conditions can be independent, then those for verification.

        Momenta are scaled so that ad*_B μ and F are alike in size: neither is to be lost below
        the other.
        """
        first = self._one()
        for k in range(len(self.factors)):
            forque = _largest(first.forques[k])
            turning = _largest(first.rates[k]) * _largest(first.momenta[k])
            if forque and turning:
                self.factors[k] = mpmath.sqrt(forque / turning)
        count = len(self.hamiltonian.bodies[0].momenta) + 1 + CHECKS
        return [self._one() for _ in range(count)]

    def _one(self) -> _State:
        for _ in range(MOST_ATTEMPTS):
            with suppress(ZeroDivisionError, TypeError, ValueError):
                return self._drawn()
        raise ValueError("the Hamiltonian has no value in any of the states that were tried")

    def _drawn(self) -> _State:
        values: dict[str, Number] = {"t": self._number()}
        momenta, adjoints = [], []
        for k, body in enumerate(self.hamiltonian.bodies):
            motor = self._motor(body)
            momentum = [self.factors[k] * self._number() for _ in body.momenta]
            components = body.group.element
            for component, reading in zip(components.components, components.reading, strict=True):
                values[f"m{k}.{component.name}"] = sum(
                    (_mpf(x) * motor.get(blade, 0) for blade, x in reading.items()), mpmath.mpf(0)
                )
            for generator, p in zip(body.group.generators, momentum, strict=True):
                values[f"mu{k}.{generator.momentum}"] = p
            momenta.append(momentum)
            adjoints.append(_adjoint(body, motor))
        found = self.system.gradient.evaluate(values, _functions(self.random))
        generators = self.hamiltonian.group.generators
        bodies = range(len(self.hamiltonian.bodies))
        return _State(
            self.hamiltonian.bodies,
            tuple(momenta),
            tuple([found[f"rate{k}.{g.rate}"] for g in generators] for k in bodies),
            tuple([found[f"forque{k}.{g.momentum}"] for g in generators] for k in bodies),
            tuple(adjoints),
        )

    def _number(self) -> Number:
        return mpmath.mpf(self.random.choice((-1, 1)) * self.random.randint(100, 1000)) / 1009

    def _motor(self, body: Coordinates) -> Any:
        motor: Any = {0: mpmath.mpf(1)}
        for generator in body.group.generators:
            step = _exponential(body.algebra, generator.bivector, self._number())
            motor = body.algebra.multiply(motor, step)
        return motor


def _exponential(algebra: Algebra, bivector: Mapping[Blade, Any], a: Number) -> Any:
    """exp of a multiple of a generator: (1 + aE)/√(1 − a²E²) where E² is a number."""
    step: Any = {blade: a * _mpf(x) for blade, x in bivector.items()}
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


def _adjoint(body: Coordinates, motor: Mapping[Blade, Number]) -> list[list[Number]]:
    """M~ E_j M for each generator, in generators."""
    multiply = body.algebra.multiply
    reverse = {blade: reverse_sign(blade) * x for blade, x in motor.items()}
    rows = []
    for generator in body.group.generators:
        moved = multiply(multiply(reverse, generator.bivector), motor)
        rows.append(
            [
                sum((_mpf(x) * moved.get(blade, 0) for blade, x in reading.items()), mpmath.mpf(0))
                for reading in body.group.rate.reading
            ]
        )
    return rows


def _largest(numbers: Iterable[Number]) -> Number:
    return max(map(abs, numbers))


def _functions(drawn: random.Random) -> dict[str, Callable[..., Number]]:
    """What a program may call; each argument of an absolute value gets a sign by lot."""
    signs: list[tuple[Number, int]] = []

    def sign(x: Number) -> int:
        for known, chosen in signs:
            for same in (1, -1):
                if abs(x - same * known) <= RECOGNISED * abs(known):
                    return same * chosen
        signs.append((x, drawn.choice((-1, 1))))
        return signs[-1][1]

    return {
        name: getattr(mpmath, name)
        for name in ("sqrt", *FUNCTIONS.values())
        if name not in ("abs", "sign")
    } | {
        "abs": lambda x: sign(x) * x,
        "sign": sign,
        "number": _number,
    }


@cache
def _number(x: Fraction) -> Number:
    return _mpf(x)
