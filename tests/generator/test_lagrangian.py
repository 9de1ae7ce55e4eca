"""The Legendre transform: Euler–Lagrange is Hamilton, there and back is nothing, and where not."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import mpmath
import pytest
import sympy

from hamotor.codegen import read_algebra
from hamotor.codegen.spec import bundled_path
from hamotor.errors import UsageError
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.evaluation import evaluated, momentum_of_rates, place, random_motor
from hamotor.mechanics.hamiltonian import Hamiltonian, coadjoint
from hamotor.mechanics.lagrangian import Lagrangian, NotHyperregular

Multivector = dict[int, Any]
M, C, K = sympy.symbols("m c k", real=True)
VALUES = {M: sympy.Rational(3, 2), C: sympy.Integer(4), K: sympy.Rational(1, 3)}


def body_on(algebra: str, group: str, name: str = "body", prefix: str = "") -> Coordinates:
    spec = read_algebra(bundled_path(algebra))
    found = next(g for g in spec.groups if g.name == group)
    return Coordinates(name, spec.algebra, found, prefix)


# ---------------------------------------------------------------- Euler and Lagrange by themselves


def product(body: Coordinates, a: Multivector, b: Multivector) -> Multivector:
    total: Multivector = {}
    for left, x in a.items():
        for right, y in b.items():
            for blade, z in body.algebra.blade_product(left, right).items():
                total[blade] = total.get(blade, 0) + x * y * int(z)
    return total


def bivector(body: Coordinates, coefficients: list[Any]) -> Multivector:
    total: Multivector = {}
    for x, generator in zip(coefficients, body.group.generators, strict=True):
        for blade, y in generator.bivector.items():
            total[blade] = total.get(blade, 0) + x * y.numerator / y.denominator
    return total


def small_exponential(body: Coordinates, exponent: Multivector) -> Multivector:
    """By its series: exponents of 1e-20 need few terms."""
    term = total = {0: mpmath.mpf(1)}
    for k in range(1, 10):
        term = {blade: x / k for blade, x in product(body, term, exponent).items()}
        total = {b: total.get(b, 0) + term.get(b, 0) for b in {**total, **term}}
    return total


def read_components(readings: Any, value: Multivector) -> list[Any]:
    return [
        sum((value.get(b, 0) * x.numerator / x.denominator for b, x in row.items()), mpmath.mpf(0))
        for row in readings
    ]


def embedded(body: Coordinates, motor: list[Any]) -> Multivector:
    total: Multivector = {}
    for x, component in zip(motor, body.group.element.components, strict=True):
        for blade, y in component.embedding.items():
            total[blade] = total.get(blade, 0) + x * y.numerator / y.denominator
    return total


def moved(body: Coordinates, motor: list[Any], theta: list[Any]) -> list[Any]:
    """M exp θ."""
    step = small_exponential(body, bivector(body, theta))
    result = product(body, embedded(body, motor), step)
    return read_components(body.group.element.reading, result)


def rates_in_coordinates(body: Coordinates, theta: list[Any], speed: list[Any]) -> list[Any]:
    """M~ Ṁ of M exp θ(t): Σ (−1)^k/(k+1)! [θ, …[θ, θ̇]]."""
    exponent, term = bivector(body, theta), bivector(body, speed)
    total = dict(term)
    for k in range(1, 10):
        forth, back = product(body, exponent, term), product(body, term, exponent)
        term = {b: -(forth.get(b, 0) - back.get(b, 0)) / (k + 1) for b in {**forth, **back}}
        total = {b: total.get(b, 0) + term.get(b, 0) for b in {**total, **term}}
    return read_components(body.group.rate.reading, total)


def euler_lagrange_residual(
    body: Coordinates, function: Any, motor: list[Any], speed: list[Any], acceleration: list[Any]
) -> Any:
    """|d/dt ∂L/∂θ̇ − ∂L/∂θ| at θ = 0 of M exp θ, by differences."""
    h = mpmath.mpf(10) ** -20
    values = {s: mpmath.mpf(int(x.p)) / int(x.q) for s, x in VALUES.items()}

    def lagrangian(theta: list[Any], theta_dot: list[Any]) -> Any:
        known = place(body, moved(body, motor, theta), values)
        rates = rates_in_coordinates(body, theta, theta_dot)
        return evaluated([function], known | dict(zip(body.rates, rates, strict=True)))[0]

    def slope(f: Callable[[Any], Any]) -> Any:
        return (f(h) - f(-h)) / (2 * h)

    def shifted(x: list[Any], i: int, by: Any) -> list[Any]:
        return [a + (by if k == i else 0) for k, a in enumerate(x)]

    def conjugate(time: Any, i: int) -> Any:
        theta = [v * time + a * time**2 / 2 for v, a in zip(speed, acceleration, strict=True)]
        theta_dot = [v + a * time for v, a in zip(speed, acceleration, strict=True)]
        return slope(lambda e: lagrangian(theta, shifted(theta_dot, i, e)))

    zero = [mpmath.mpf(0)] * len(speed)

    def along(i: int) -> Any:
        return slope(lambda e: lagrangian(shifted(zero, i, e), speed))

    def changing(i: int) -> Any:
        return slope(lambda time: conjugate(time, i))

    return max(abs(changing(i) - along(i)) for i in range(len(speed)))


def example(body: Coordinates, *, closing: bool) -> Any:
    """Not quadratic in rates, with a mass that depends on where the body is."""
    y = body.at(tuple(sympy.Rational(k + 1, 5) for k in range(body.dimension)))
    here = 1 + sum(x**2 for x in y) / 9
    linear = [b for b, g in zip(body.rates, body.group.generators, strict=True) if g.rate[0] == "v"]
    others = [b for b in body.rates if b not in linear]
    kinetic = sum((k + 2) * b**2 / 2 for k, b in enumerate(others)) * here
    speed = sum(v**2 for v in linear)
    if closing:
        kinetic -= M * C**2 * here * sympy.sqrt(1 - speed / C**2)
        kinetic += K * y[0] * linear[1]
    else:
        kinetic += M * speed / 2 + K * here * speed**2 + K * speed * others[0] ** 2 / 7
        kinetic += others[-1] * linear[0] / 5 + sympy.cosh(linear[0]) * here
    return kinetic - sympy.sin(y[0]) * y[1] ** 2 + body.motor[0] / 3


GROUPS = [("pga3", "SE3"), ("cga3", "Sim3"), ("cga3", "SO41"), ("pga2", "SE2"), ("cl3", "SO3")]


@pytest.mark.parametrize("closing", [True, False], ids=["in formulas", "by Newton"])
@pytest.mark.parametrize(("algebra", "group"), GROUPS[:4])
def test_hamilton_solves_the_euler_lagrange_equations(
    algebra: str, group: str, closing: bool
) -> None:
    body = body_on(algebra, group)
    function = example(body, closing=closing)
    lagrangian = Lagrangian((body,), function, VALUES)
    hamiltonian = lagrangian.hamiltonian
    assert (hamiltonian is not None) == closing
    drawn = random.Random(3)
    with mpmath.workdps(100):
        motor = random_motor(body, drawn)
        speed = [mpmath.mpf(drawn.uniform(-1, 1)) for _ in body.rates]
        values = {s: mpmath.mpf(int(x.p)) / int(x.q) for s, x in VALUES.items()}

        def state(motor: list[Any], rates: list[Any]) -> dict[Any, Any]:
            return place(body, motor, values) | dict(zip(body.rates, rates, strict=True))

        momenta = evaluated(lagrangian.momenta, state(motor, speed))
        at = state(motor, speed) | dict(zip(body.momenta, momenta, strict=True))
        if hamiltonian is not None:
            forces = evaluated(hamiltonian.momentum_rates[0], at)
            assert (
                max(
                    abs(a - b)
                    for a, b in zip(evaluated(hamiltonian.rates[0], at), speed, strict=True)
                )
                < mpmath.mpf(10) ** -90
            )
        else:
            forque = lagrangian.at_fixed_rates.forques[0]
            inertial = coadjoint(body, body.rates)
            forces = evaluated([c - f for c, f in zip(inertial, forque, strict=True)], at)

        h = mpmath.mpf(10) ** -20

        def rates_after(time: Any) -> list[Any]:
            there = moved(body, motor, [v * time for v in speed])
            mu = [p + f * time for p, f in zip(momenta, forces, strict=True)]
            if hamiltonian is None:
                found = lagrangian.rates_of_momentum([there], [mu])
                assert found is not None
                return found
            known = state(there, speed) | dict(zip(body.momenta, mu, strict=True))
            return evaluated(hamiltonian.rates[0], known)

        acceleration = [
            (b - a) / (2 * h) for a, b in zip(rates_after(-h), rates_after(h), strict=True)
        ]
        residual = euler_lagrange_residual(body, function, motor, speed, acceleration)
        wrong = euler_lagrange_residual(body, function, motor, speed, [2 * a for a in acceleration])
    assert residual < mpmath.mpf(10) ** -30
    assert wrong > 1e-3


# ---------------------------------------------------------------- there and back


def same(a: Any, b: Any) -> bool:
    return bool(sympy.simplify(sympy.expand(a - b)) == 0)


@pytest.mark.parametrize(("algebra", "group"), GROUPS)
def test_transform_of_the_transform_is_the_lagrangian(algebra: str, group: str) -> None:
    body = body_on(algebra, group)
    n = len(body.rates)
    matrix = sympy.Matrix(n, n, lambda i, j: i + 2 if i == j else sympy.Rational(1, 3 + i + j))
    rates = sympy.Matrix(body.rates)
    function = (rates.T * matrix * rates)[0] / 2 + K * body.motor[0] * body.rates[1]
    function -= M * body.motor[0] ** 2
    hamiltonian = Lagrangian((body,), function, VALUES).hamiltonian
    assert hamiltonian is not None
    back = Lagrangian.of(hamiltonian)
    assert back is not None
    assert same(back.function, function)


def test_relativistic_particle_closes_both_ways() -> None:
    body = body_on("pga3", "T3")
    speed = sum(v**2 for v in body.rates)
    function = -M * C**2 * sympy.sqrt(1 - speed / C**2) - K * body.position[2]
    hamiltonian = Lagrangian((body,), function, VALUES).hamiltonian
    assert hamiltonian is not None
    momentum = sum(p**2 for p in body.momenta)
    energy = C * sympy.sqrt(momentum + M**2 * C**2) + K * body.position[2]
    assert same(hamiltonian.energy, energy)
    back = Lagrangian.of(hamiltonian)
    assert back is not None
    assert _agree(back.function, function, dict.fromkeys(body.rates, sympy.Rational(3, 7)))


def _agree(a: Any, b: Any, point: dict[Any, Any]) -> bool:
    return bool(abs(sympy.N((a - b).subs(point).subs(VALUES), 40)) < 1e-30)


def test_translations_give_hamiltons_classical_equations() -> None:
    body = body_on("pga3", "T3")
    x, p = body.position, body.momenta
    potential = sympy.sin(x[0]) * x[1] + K * x[2] ** 4
    kinetic = M * sum(v**2 for v in body.turned(body.rates)) / 2
    hamiltonian = Lagrangian((body,), kinetic - potential, VALUES).hamiltonian
    assert hamiltonian is not None
    assert same(hamiltonian.energy, sum(y**2 for y in p) / (2 * M) + potential)
    upright = {r: int(j == k) for j, row in enumerate(body.rotation) for k, r in enumerate(row)}
    for k in range(3):
        assert same(hamiltonian.rates[0][k], p[k] / M)
        force = hamiltonian.momentum_rates[0][k].subs(upright)
        assert same(force, -sympy.diff(potential, x[k]))


def test_velocities_in_the_world_need_no_rotation() -> None:
    body = body_on("pga3", "SE3")
    world = body.turned(body.rates[3:])
    function = M * sum(v**2 for v in world) / 2 + sum(w**2 for w in body.rates[:3])
    hamiltonian = Lagrangian((body,), function, VALUES).hamiltonian
    assert hamiltonian is not None
    expected = sum(p**2 for p in body.momenta[3:]) / (2 * M)
    expected += sum(p**2 for p in body.momenta[:3]) / 4
    assert same(hamiltonian.energy, expected)


def test_two_bodies_may_be_coupled_by_their_rates() -> None:
    one, two = (body_on("pga2", "SE2", name, f"{name}.") for name in ("one", "two"))
    function = sum(b**2 for b in (*one.rates, *two.rates)) / 2
    function += one.rates[0] * two.rates[0] / 2 + K * two.rates[1]
    lagrangian = Lagrangian((one, two), function, VALUES)
    lagrangian.require_hyperregular()
    hamiltonian = lagrangian.hamiltonian
    assert hamiltonian is not None
    a, b = one.momenta[0], two.momenta[0]
    assert same(hamiltonian.rates[0][0], (4 * a - 2 * b) / 3)
    assert same(hamiltonian.rates[1][1], two.momenta[1] - K)


def test_applied_forques_are_told_in_momenta() -> None:
    body = body_on("pga2", "SE2")
    function = sum((k + 1) * b**2 / 2 for k, b in enumerate(body.rates))
    damped = Lagrangian((body,), function, VALUES, (tuple(K * b for b in body.rates),))
    hamiltonian = damped.hamiltonian
    assert hamiltonian is not None
    expected = [K * p / (k + 1) for k, p in enumerate(body.momenta)]
    assert all(map(same, hamiltonian.applied[0], expected))
    assert same(
        hamiltonian.power, -K * sum(p**2 / (k + 1) ** 2 for k, p in enumerate(body.momenta))
    )


# ---------------------------------------------------------------- what is not hyperregular


def kinetic(body: Coordinates) -> Any:
    return sum((k + 1) * b**2 for k, b in enumerate(body.rates))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda b: -6 * b[5] ** 2, "L does not depend on the rate v3"),
        (lambda b: -6 * b[5] ** 2 + b[5], "singular wherever it was tried.*rates v3,"),
        (
            lambda b: -4 * b[3] ** 2 - 3 * b[2] ** 2 + (b[2] - 2 * b[3]) ** 2,
            r"singular wherever it was tried.*rates w12 \+ 0.5 v1,",
        ),
        (lambda b: -4 * b[3] ** 2 + b[3] ** 4, "singular at rest.*along v1"),
        (lambda b: -(b[3] ** 4), "between these states it is singular"),
    ],
)
def test_error_says_where_momenta_do_not_determine_rates(
    change: Callable[[Any], Any], message: str
) -> None:
    body = body_on("pga3", "SE3")
    lagrangian = Lagrangian((body,), kinetic(body) + change(body.rates))
    with pytest.raises(NotHyperregular, match=message):
        lagrangian.require_hyperregular()


def test_initial_state_is_looked_at() -> None:
    body = body_on("pga3", "SE3")
    x = body.position[0]
    lagrangian = Lagrangian((body,), kinetic(body) + (x - 1) * body.rates[0] ** 2)
    lagrangian_at_rest = kinetic(body) - body.rates[0] ** 2 + x**2 * body.rates[0] ** 2
    identity = [1, 0, 0, 0, 0, 0, 0, 0]
    rates = [1, 2, 3, 4, 5, 6]
    with pytest.raises(NotHyperregular, match=r"at the initial state \(w23 = 1, .*along w23"):
        Lagrangian((body,), lagrangian_at_rest).require_hyperregular([identity], [rates])
    with pytest.raises(NotHyperregular):
        lagrangian.require_hyperregular([identity], [rates])


def test_indefinite_kinetic_energies_are_hyperregular() -> None:
    body = body_on("cga3", "SO41")
    signed = sum((-1) ** k * (k + 1) * b**2 for k, b in enumerate(body.rates))
    lagrangian = Lagrangian((body,), signed)
    lagrangian.require_hyperregular()
    assert lagrangian.hamiltonian is not None


# ---------------------------------------------------------------- momenta for rates


@pytest.mark.parametrize(("algebra", "group"), GROUPS)
def test_momentum_of_rates_inverts_the_rates(algebra: str, group: str) -> None:
    body = body_on(algebra, group)
    energy = sum((k + 1) * p**2 / 2 + p**4 / 5 for k, p in enumerate(body.momenta))
    energy += sympy.sqrt(1 + sum(p**2 for p in body.momenta) * body.motor[0] ** 2)
    hamiltonian = Hamiltonian((body,), energy + K, VALUES)
    drawn = random.Random(2)
    motor = [float(x) for x in random_motor(body, drawn)]
    wanted = [drawn.uniform(-3, 3) for _ in body.rates]
    (momentum,) = momentum_of_rates(hamiltonian, [motor], [wanted])
    known = place(body, motor, {}) | dict(zip(body.momenta, map(mpmath.mpf, momentum), strict=True))
    found = evaluated(hamiltonian.rates[0], known)
    assert max(abs(a - b) for a, b in zip(found, wanted, strict=True)) < 1e-13


def test_rates_that_no_momentum_has_are_refused() -> None:
    body = body_on("pga3", "T3")
    energy = C * sympy.sqrt(sum(p**2 for p in body.momenta) + M**2 * C**2)
    hamiltonian = Hamiltonian((body,), energy, VALUES)
    identity = [1, 0, 0, 0]
    (momentum,) = momentum_of_rates(hamiltonian, [identity], [[3.9, 0, 0]])
    assert momentum[0] == pytest.approx(1.5 * 3.9 / (1 - (3.9 / 4) ** 2) ** 0.5, rel=1e-14)
    with pytest.raises(UsageError, match="no momentum has the rates v1 = 5, v2 = 0, v3 = 0"):
        momentum_of_rates(hamiltonian, [identity], [[5, 0, 0]])
