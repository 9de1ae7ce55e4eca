"""Coordinates of bodies and the forques that follow, on every bundled group."""

from __future__ import annotations

import random
from functools import cache
from typing import Any

import mpmath
import pytest
import sympy
from tests.generator.hamiltonians import GROUPS, body_on

from hamotor.codegen.algebra import Algebra
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.hamiltonian import Hamiltonian
from hamotor.mechanics.system import System

Multivector = dict[int, Any]


def product(algebra: Algebra, a: Multivector, b: Multivector) -> Multivector:
    result: Multivector = {}
    for blade_a, x in a.items():
        for blade_b, y in b.items():
            for blade, z in algebra.blade_product(blade_a, blade_b).items():
                result[blade] = result.get(blade, 0) + x * y * int(z)
    return result


def exponential(algebra: Algebra, bivector: Any, factor: Any) -> Multivector:
    """By its series."""
    scaled = {
        blade: factor * mpmath.mpf(x.numerator) / x.denominator for blade, x in bivector.items()
    }
    total: Multivector = {0: mpmath.mpf(1)}
    term = dict(total)
    for k in range(1, 40):
        term = {blade: x / k for blade, x in product(algebra, term, scaled).items()}
        for blade, x in term.items():
            total[blade] = total.get(blade, 0) + x
    return total


def values_at(body: Coordinates, motor: Multivector) -> dict[Any, Any]:
    """Every variable and every point at a motor, from the definitions."""
    components = [
        sum(mpmath.mpf(x.numerator) / x.denominator * motor.get(blade, 0) for blade, x in r.items())
        for r in body.group.element.reading
    ]
    known = dict(zip(body.motor, components, strict=True))
    stages = [(v.symbol, v.definition) for v in body.frame_variables]
    for point in body._points.values():
        stages += zip(point.symbols, body.definition(point), strict=True)
    for symbol, definition in stages:
        known[symbol] = evaluated(definition, known)
    return known


def evaluated(expression: Any, known: dict[Any, Any]) -> Any:
    return _function(expression, tuple(known))(*known.values())


@cache
def _function(expression: Any, symbols: tuple[Any, ...]) -> Any:
    return sympy.lambdify(symbols, expression, "mpmath")


def some_motor(body: Coordinates) -> Multivector:
    drawn = random.Random(1)
    motor: Multivector = {0: mpmath.mpf(1)}
    for generator in body.group.generators:
        step = exponential(body.algebra, generator.bivector, mpmath.mpf(drawn.uniform(-1, 1)))
        motor = product(body.algebra, motor, step)
    return motor


@pytest.mark.parametrize(("algebra", "group"), GROUPS)
def test_forque_is_the_derivative_of_the_hamiltonian_along_the_group(
    algebra: str, group: str
) -> None:
    body = body_on(algebra, group)
    place = tuple(sympy.Rational(k + 2, 7) for k in range(body.dimension))
    y = body.at(place)
    energy = sum(x**3 * (k + 2) for k, x in enumerate(y)) + sympy.exp(body.motor[0] / 3)
    if body.space.affine:
        energy += (
            sympy.sin(body.rotation[0][1]) * body.scale + body.position[0] * body.rotation[1][1]
        )
    hamiltonian = Hamiltonian((body,), energy)
    h = mpmath.mpf(10) ** -16
    with mpmath.workdps(50):
        motor = some_motor(body)
        here = values_at(body, motor)
        for i, generator in enumerate(body.group.generators):
            ahead, behind = (exponential(body.algebra, generator.bivector, e) for e in (h, -h))
            for spatial, forques in (
                (False, hamiltonian.forques),
                (True, hamiltonian.spatial_forques),
            ):
                high, low = (
                    evaluated(
                        energy,
                        values_at(
                            body,
                            product(body.algebra, e, motor)
                            if spatial
                            else product(body.algebra, motor, e),
                        ),
                    )
                    for e in (ahead, behind)
                )
                assert abs(evaluated(forques[0][i], here) - (high - low) / (2 * h)) < 1e-29


@pytest.mark.parametrize(("algebra", "group"), GROUPS)
def test_program_computes_the_gradient(algebra: str, group: str) -> None:
    body = body_on(algebra, group)
    y = body.at(tuple(sympy.Rational(k + 1, 5) for k in range(body.dimension)))
    stiffness = sympy.Symbol("k", real=True)
    squared = sum(x**2 for x in y)
    energy = stiffness * (sympy.sqrt(squared) - sympy.Rational(1, 3)) ** 2 + sum(
        (k + 1) * p**2 / 3 for k, p in enumerate(body.momenta)
    )
    hamiltonian = Hamiltonian((body,), energy, {stiffness: sympy.Rational(7, 3)})
    system = System(hamiltonian)
    with mpmath.workdps(40):
        known = values_at(body, some_motor(body))
        known |= {p: mpmath.mpf(k + 1) / 7 for k, p in enumerate(body.momenta)}
        known[stiffness] = mpmath.mpf(7) / 3
        names = {name: known[symbol] for symbol, name in system.names.items() if symbol in known}
        functions = {
            "sqrt": mpmath.sqrt,
            "number": lambda x: mpmath.mpf(x.numerator) / x.denominator,
        }
        found = system.gradient.evaluate(names, functions)
        for g, rate, forque in zip(
            body.group.generators, hamiltonian.rates[0], hamiltonian.forques[0], strict=True
        ):
            assert abs(found[f"rate0.{g.rate}"] - evaluated(rate, known)) < 1e-35
            assert abs(found[f"forque0.{g.momentum}"] - evaluated(forque, known)) < 1e-35


@pytest.mark.parametrize(("algebra", "group"), GROUPS)
def test_energy_balance_holds_on_every_group(algebra: str, group: str) -> None:
    body = body_on(algebra, group)
    Hamiltonian((body,), sum(p**2 for p in body.momenta)).prove_energy_balance()
