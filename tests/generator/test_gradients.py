"""Three derivatives of every Hamiltonian: symbolic, by dual numbers, and by differences."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import mpmath
import pytest
import sympy
from tests.generator.hamiltonians import HAMILTONIANS, body_on, free

from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.hamiltonian import TIME, Hamiltonian
from hamotor.mechanics.proof import applied, prove_energy_balance, slopes
from hamotor.mechanics.states import State, exponential, largest, random_states
from hamotor.mechanics.system import System
from hamotor.scene import parse_scene
from hamotor.scene.general import GeneralScene
from hamotor.scene.general_source import general_source
from hamotor.scene.source import DOUBLE

OPEN = {"damped and driven", "not quadratic"}
"""Those that time or something applied does work on."""
STEP = mpmath.mpf(10) ** -20


def some_state(system: System) -> State:
    """A random state, absolute values as they are."""
    drawn = next(random_states(system))
    functions = drawn.functions | {"abs": abs, "sign": mpmath.sign}
    found = system.gradient.evaluate(drawn.values, functions)
    generators = system.hamiltonian.group.generators
    rates = tuple([found[f"rate{k}.{g.rate}"] for g in generators] for k in bodies(system))
    forques = tuple([found[f"forque{k}.{g.momentum}"] for g in generators] for k in bodies(system))
    return dataclasses.replace(drawn, functions=functions, rates=rates, forques=forques)


def bodies(system: System) -> range:
    return range(len(system.hamiltonian.bodies))


def motor_symbols(body: Coordinates, motor: Mapping[int, Any]) -> dict[Any, Any]:
    return {
        symbol: sum(
            (
                mpmath.mpf(x.numerator) / x.denominator * motor.get(blade, 0)
                for blade, x in reading.items()
            ),
            mpmath.mpf(0),
        )
        for symbol, reading in zip(body.motor, body.group.element.reading, strict=True)
    }


def energy_function(system: System) -> Callable[[Mapping[Any, Any]], Any]:
    """H as SymPy evaluates it, from motors, momenta and the time; no program runs."""
    h = system.hamiltonian
    stages = [*((symbol, x) for symbol, _, x in system.places), (None, h.energy)]
    known = list(system.names)
    compiled = []
    for symbol, expression in stages:
        folded = expression.subs(dict(h.parameters))
        compiled.append((symbol, sympy.lambdify(known, folded, "mpmath")))
        known.append(symbol)

    def energy(values: Mapping[Any, Any]) -> Any:
        found = [values[symbol] for symbol in system.names]
        for _, function in compiled:
            found.append(function(*found))
        return found[-1]

    return energy


def differences(system: System, state: State, k: int) -> tuple[list[Any], list[Any]]:
    """Central differences of H along μ_i and along M exp(εE_i), good to 40 digits."""
    energy = energy_function(system)
    here: dict[Any, Any] = {TIME: state.values["t"]}
    for body, motor, momentum in zip(
        system.hamiltonian.bodies, state.motors, state.momenta, strict=True
    ):
        here |= motor_symbols(body, motor) | dict(zip(body.momenta, momentum, strict=True))
    body = system.hamiltonian.bodies[k]

    def between(ahead: dict[Any, Any], behind: dict[Any, Any]) -> Any:
        return (energy(here | ahead) - energy(here | behind)) / (2 * STEP)

    def turned(bivector: Any, h: Any) -> dict[Any, Any]:
        step = exponential(body.algebra, bivector, h)
        return motor_symbols(body, body.algebra.multiply(state.motors[k], step))

    rates = [between({p: here[p] + STEP}, {p: here[p] - STEP}) for p in body.momenta]
    bivectors = [g.bivector for g in body.group.generators]
    return rates, [between(turned(b, STEP), turned(b, -STEP)) for b in bivectors]


def far(found: list[Any], expected: list[Any], size: Any) -> Any:
    return largest(x - y for x, y in zip(found, expected, strict=True)) / size


@pytest.mark.parametrize("name", HAMILTONIANS)
def test_symbolic_gradient_is_that_of_dual_numbers_and_of_differences(name: str) -> None:
    system = System(HAMILTONIANS[name]())
    with mpmath.workdps(100):
        state = some_state(system)
        for k in bodies(system):
            size = state.size(k)
            potential = [
                f - a for f, a in zip(state.forques[k], applied(system, state, k), strict=True)
            ]
            for (rates, forques), most in (
                (slopes(system, state, k), mpmath.mpf(10) ** -90),
                (differences(system, state, k), mpmath.mpf(10) ** -32),
            ):
                assert far(state.rates[k], rates, largest(rates)) < most
                assert far(potential, forques, size) < most


@pytest.mark.parametrize("name", HAMILTONIANS)
def test_energy_changes_by_the_power_alone(name: str) -> None:
    prove_energy_balance(System(HAMILTONIANS[name]()))


DRIVEN = ("damped and driven", "not quadratic", "scene rocket")


@pytest.mark.parametrize("name", [n for n in HAMILTONIANS if n not in DRIVEN])
def test_autonomous_hamiltonians_conserve_the_energy(name: str) -> None:
    hamiltonian = HAMILTONIANS[name]()
    assert hamiltonian.conservative
    assert hamiltonian.power == 0


def test_exponential_of_a_sum_of_commuting_planes_is_the_product_of_theirs() -> None:
    algebra = body_on("pga4", "SO4").algebra
    (e12, _), (e34, _) = (algebra.parse_blade(name) for name in ("e12", "e34"))
    with mpmath.workdps(100):
        a = mpmath.mpf(7) / 11
        whole = exponential(algebra, {e12: 1, e34: 1}, a)
        expected: Any = {0: mpmath.cos(a), e12: mpmath.sin(a)}
        expected = algebra.multiply(expected, {0: mpmath.cos(a), e34: mpmath.sin(a)})
        assert set(whole) == set(expected)
        assert largest(whole[blade] - x for blade, x in expected.items()) < mpmath.mpf(10) ** -95


class Fast(Hamiltonian):
    """One rate too large by a billionth."""

    @property
    def rates(self) -> Any:
        ((first, *rest),) = super().rates
        return ((first * sympy.Rational(10**9 + 1, 10**9), *rest),)


class Tilted(Hamiltonian):
    """Forques of a potential that is turned against that of H: no work is done wrongly at rest."""

    def gradients(self, body: Coordinates) -> Any:
        return [(point, tuple(reversed(g))) for point, g in super().gradients(body)]


class Powerful(Hamiltonian):
    """A power that does not know the time."""

    @property
    def power(self) -> Any:
        return super().power - sympy.diff(self.energy, TIME)


@pytest.mark.parametrize(
    ("defect", "message"),
    [(Fast, "rate of body, component 0"), (Tilted, "forque of body"), (Powerful, "the power is 0")],
)
def test_programs_of_another_hamiltonian_are_refused(
    defect: type[Hamiltonian], message: str
) -> None:
    body = body_on("pga3", "SE3")
    x, y, z = body.position
    energy = free(body, 1, 2, 3, 4, 5, 6) + x**2 + 2 * y**2 + 3 * z**2 + sympy.sin(TIME) * x
    prove_energy_balance(System(Hamiltonian((body,), energy)))
    with pytest.raises(ValueError, match=message):
        prove_energy_balance(System(defect((body,), energy)))


def test_a_scene_whose_programs_are_wrong_is_not_compiled() -> None:
    text = (
        b'algebra = "pga3"\n[[body]]\nname = "a"\nmass = 2\ninertia = [1, 2, 2.5]\n'
        b'[hamiltonian]\nexpression = "kinetic + k * position.x^2"\nparameters = { k = 3 }\n'
        b"[time]\nend = 1\nstep = 0.1\n"
    )
    scene = parse_scene(text, name="test", file="test.toml")
    assert isinstance(scene, GeneralScene)
    assert "rate" in general_source(scene, "generated", DOUBLE)
    h = scene.hamiltonian
    wrong = dataclasses.replace(scene, hamiltonian=Fast(h.bodies, h.energy, h.parameters))
    with pytest.raises(ValueError, match="rate of a, component 0"):
        general_source(wrong, "generated", DOUBLE)
