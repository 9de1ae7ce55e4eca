"""Kinetic energies are cut into parts whose motion is known, on every group."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import mpmath
import pytest
import sympy
from tests.generator.hamiltonians import body_on

import hamotor
from hamotor.codegen.program import Program
from hamotor.mechanics.hamiltonian import Hamiltonian, coadjoint
from hamotor.mechanics.parts import Part, kinetic_parts, motion
from hamotor.mechanics.system import System
from hamotor.run.result import Run
from hamotor.scene import Scene, bundled_scenes

GROUPS = (("pga2", "SE2"), ("pga4", "SE4"), ("cga2", "SO31"), ("cga3", "Sim3"), ("cga3", "SO41"))
MOMENTA = (0.7, -0.4, 0.9, 0.3, -0.6, 0.5, 0.8, -0.2, 0.35, -0.75)
FUNCTIONS = {
    "number": lambda x: mpmath.mpf(x.numerator) / x.denominator,
    "sine_ratio": lambda z: mpmath.sinc(mpmath.sqrt(z)),
    "cosine_less_one": lambda z: mpmath.cos(mpmath.sqrt(z)) - 1,
    "sinh_ratio": lambda z: mpmath.sinh(mpmath.sqrt(z)) / mpmath.sqrt(z),
    "cosh_less_one": lambda z: mpmath.cosh(mpmath.sqrt(z)) - 1,
}
State = tuple[tuple[Any, ...], tuple[Any, ...]]


def system_on(algebra: str, name: str, *, mixed: bool) -> System:
    """H = ½ Σ μ_i²/I_i, with mixed momenta of the last two as well."""
    body = body_on(algebra, name)
    energy = sum(p**2 * sympy.Rational(1, 2 + k) for k, p in enumerate(body.momenta)) / 2
    if mixed:
        energy += body.momenta[-1] * body.momenta[-2] / 5
    return System(Hamiltonian((body,), energy))


def scene_of(name: str) -> Any:
    simulation = hamotor.load(name)
    assert simulation.read is not None
    return simulation.read()


def values(system: System, state: State, step: Any) -> dict[str, Any]:
    (body,) = system.hamiltonian.bodies
    symbols = (*body.motor, *body.momenta)
    numbers = (*state[0], *state[1])
    return {system.names[s]: x for s, x in zip(symbols, numbers, strict=True)} | {"h": step}


def moved(system: System, program: Program, state: State, step: Any) -> State:
    found = program.evaluate(values(system, state, step), FUNCTIONS)
    changes = [x for name, x in found.items() if name.startswith("motor.")]
    turned = [x for name, x in found.items() if name.startswith("momentum.")]
    return (
        tuple(a + b for a, b in zip(state[0], changes, strict=True)),
        tuple(a + b for a, b in zip(state[1], turned, strict=True)),
    )


def slope(system: System, part: Part, state: State) -> State:
    """M B and ad*_B μ for B = Qμ."""
    (body,) = system.hamiltonian.bodies
    rates = tuple(
        sum(sympy.Rational(str(q)) * p for q, p in zip(row, body.momenta, strict=True))
        for row in part.matrix
    )
    motors = [
        sum(b * x for b, x in zip(rates, v.variation, strict=True)) for v in body.motor_variables
    ]
    symbols = (*body.motor, *body.momenta)
    function = sympy.lambdify(symbols, [*motors, *coadjoint(body, rates)], "mpmath")
    found = function(*state[0], *state[1])
    return tuple(found[: len(motors)]), tuple(found[len(motors) :])


def distance(one: State, other: State) -> Any:
    return max(
        abs(a - b) for x, y in zip(one, other, strict=True) for a, b in zip(x, y, strict=True)
    )


@pytest.mark.parametrize(("algebra", "name"), GROUPS)
def test_each_part_is_the_flow_of_its_energy(algebra: str, name: str) -> None:
    system = system_on(algebra, name, mixed=False)
    (body,) = system.hamiltonian.bodies
    parts = kinetic_parts(system.hamiltonian)
    assert parts is not None
    with mpmath.workdps(40):
        start: State = (
            tuple(mpmath.mpf(int(c.name == "s")) for c in body.group.element.components),
            tuple(map(mpmath.mpf, MOMENTA[: len(body.momenta)])),
        )
        state = start
        for part in (part for together in parts[0] for part in together):
            program = motion(system, 0, part)
            assert program is not None
            step = mpmath.mpf("0.3")
            whole = moved(system, program, state, step)
            halves = moved(system, program, moved(system, program, state, step / 2), step / 2)
            assert distance(whole, halves) < 1e-36, "flows add up"
            little = mpmath.mpf("1e-18")
            change = moved(system, program, state, little)
            begun = tuple(
                tuple((a - b) / little for a, b in zip(x, y, strict=True))
                for x, y in zip(change, state, strict=True)
            )
            assert distance((begun[0], begun[1]), slope(system, part, state)) < 1e-16
            state = whole
        assert distance(state, start) > 0.01


def test_parts_that_commute_are_in_sets_of_their_own() -> None:
    (sets,) = kinetic_parts(scene_of("conformal_body").hamiltonian) or ((),)
    assert [len(together) for together in sets] == [1, 2, 2]
    (sets,) = kinetic_parts(scene_of("kepler").hamiltonian) or ((),)
    assert [len(together) for together in sets] == [1]


def test_a_direction_of_rotation_and_translation_is_a_part_with_the_groups_own_exp() -> None:
    system = system_on("pga3", "SE3", mixed=False)
    (body,) = system.hamiltonian.bodies
    screw = body.momenta[0] + body.momenta[3]
    h = Hamiltonian((body,), screw**2 / 2)
    (((part,),),) = kinetic_parts(h) or (((),),)
    assert part.is_known()
    assert part.sign is None
    assert motion(System(h), 0, part) is None


def test_indefinite_energies_have_parts() -> None:
    system = system_on("cga3", "SO41", mixed=True)
    (body,) = system.hamiltonian.bodies
    h = Hamiltonian((body,), body.momenta[0] * body.momenta[1])
    (sets,) = kinetic_parts(h) or ((),)
    assert sum(len(together) for together in sets) == 2


def test_what_does_not_commute_with_itself_is_no_part() -> None:
    system = system_on("pga3", "SE3", mixed=False)
    (body,) = system.hamiltonian.bodies
    size = range(6)
    both = tuple(tuple(Fraction(int(i == j) * (i + 1)) for j in size) for i in size)
    assert not Part(body.algebra, body.group, both).is_known()


@pytest.mark.parametrize("name", ["breathing_body", "charged_body", "rocket"])
def test_other_energies_are_not_cut(name: str) -> None:
    assert kinetic_parts(scene_of(name).hamiltonian) is None
    assert "splitting2" not in hamotor.load(name).methods


def expect_kept(run: Run) -> None:
    """Momenta and Casimirs but for rounding, the energy nearly."""
    worst = {k: x["max_relative_error"] for k, x in run.report["conserved"].items()}
    assert worst.pop("energy") < 1e-6
    assert max(worst.values(), default=0.0) < 1e-13, worst


def test_a_conformal_top_is_split() -> None:
    simulation = hamotor.load("conformal_top")
    run = simulation.run(end=0.5, every=10, method="splitting6", pictures=False)
    expect_kept(run)


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name, _ in bundled_scenes()])
def test_every_scene_with_parts_is_split(name: str) -> None:
    simulation = hamotor.load(name)
    if isinstance(scene_of(name), Scene) or "splitting6" not in simulation.methods:
        pytest.skip("it has no parts, or others")
    end = 100 * (simulation.step or 0.01)
    run = simulation.run(end=end, every=10, method="splitting6", pictures=False)
    expect_kept(run)
    reference = simulation.run(end=end, every=100, method="taylor", pictures=False)
    assert _largest(run.report["final"], reference.report["final"]) < 1e-8


def _largest(one: Mapping[str, Any], other: Mapping[str, Any]) -> float:
    def numbers(final: Mapping[str, Any]) -> Sequence[float]:
        return [
            float(x)
            for body in final.values()
            for part in ("motor", "momentum")
            for x in body[part].values()
        ]

    return max(abs(a - b) for a, b in zip(numbers(one), numbers(other), strict=True))
