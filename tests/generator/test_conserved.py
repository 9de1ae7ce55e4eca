"""Noether's theorem: the momenta listed are those whose motions leave every potential as it is."""

from __future__ import annotations

import random
from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.rigid import parse_scene, read_scene

from hamotor.mechanics.echelon import null_space
from hamotor.scene import ConservedQuantity, Gravity, Scene, Spring

Array = NDArray[np.float64]

BODY = '[[body]]\nname = "{name}"\nmass = 2.0\ninertia = [1, 2, 2.5]\n{more}\n'
PLATE = '[[body]]\nname = "{name}"\nmass = 2.0\ninertia = 1.5\n{more}\n'
GRAVITY = '[[interaction]]\ntype = "gravity"\nacceleration = {g}\n'
ANCHORED = (
    '[[interaction]]\ntype = "spring"\nbody = "{body}"\nat = {at}\nanchor = {anchor}\n'
    "stiffness = 3.0\nrest_length = 0.2\n"
)
JOINED = (
    '[[interaction]]\ntype = "spring"\nbody = "{body}"\nat = {at}\nother = "{other}"\n'
    "other_at = {other_at}\nstiffness = 3.0\nrest_length = 0.2\n"
)


def scene(*parts: str, algebra: str = "pga3", group: str = "") -> Scene:
    head = f'algebra = "{algebra}"\n' + (f'group = "{group}"\n' if group else "")
    text = head + "".join(parts) + "[time]\nend = 1\nstep = 0.1\n"
    return parse_scene(text.encode(), name="test", file="test.toml")


def body(name: str, more: str = "velocity = [0.3, 0.1, -0.2]\nangular_velocity = [1, 2, 3]") -> str:
    return BODY.format(name=name, more=more)


def anchored(body: str, at: list[float], anchor: list[float]) -> str:
    return ANCHORED.format(body=body, at=at, anchor=anchor)


def joined(body: str, at: list[float], other: str, other_at: list[float]) -> str:
    return JOINED.format(body=body, at=at, other=other, other_at=other_at)


def gravity(*g: float) -> str:
    return GRAVITY.format(g=list(g))


def momenta(of: Scene) -> list[ConservedQuantity]:
    return [q for q in of.conserved if q.name.startswith("spatial_momentum.")]


def names(of: Scene) -> list[str]:
    return [q.name.removeprefix("spatial_momentum.") for q in of.conserved]


FREE = scene(body("a"))
CASES = {
    "free": FREE,
    "gravity": scene(body("a"), gravity(0, 0, -9.81)),
    "tilted gravity": scene(body("a"), gravity(0.3, -0.1, -9.7)),
    "anchor at the origin": scene(body("a"), anchored("a", [0.1, 0.2, 0.3], [0, 0, 0])),
    "anchor elsewhere": scene(body("a"), anchored("a", [0.1, 0.2, 0.3], [1.5, -0.7, 0.3])),
    "gravity and anchor": scene(
        body("a"), gravity(0, 0, -9.81), anchored("a", [0.1, 0, 0], [1.5, -0.7, 2])
    ),
    "tilted gravity and anchor": scene(
        body("a"), gravity(0.1, 0.2, -9.81), anchored("a", [0.1, 0, 0], [1.5, -0.7, 2])
    ),
    "two anchors": scene(
        body("a"), anchored("a", [0.1, 0, 0], [1, 2, 3]), anchored("a", [0, 0.1, 0], [0.5, 0, -1])
    ),
    "three anchors": scene(
        body("a"),
        anchored("a", [0.1, 0, 0], [1, 0, 0]),
        anchored("a", [0, 0.1, 0], [0, 1, 0]),
        anchored("a", [0, 0.1, 0.3], [0, 0, 1]),
    ),
    "joined": scene(
        body("a"), body("b", "position = [2, 0, 0]"), joined("a", [0.1, 0, 0], "b", [0, 0.2, 0])
    ),
    "joined under gravity": scene(
        body("a"),
        body("b", "position = [2, 0, 0]"),
        joined("a", [0.1, 0, 0], "b", [0, 0.2, 0]),
        gravity(0, -9.81, 0),
    ),
}
PLANAR = {
    "free": scene(PLATE.format(name="a", more=""), algebra="pga2"),
    "gravity": scene(PLATE.format(name="a", more=""), gravity(0.5, -9.81), algebra="pga2"),
    "anchor": scene(
        PLATE.format(name="a", more=""), anchored("a", [0.1, 0.2], [1.5, 0.5]), algebra="pga2"
    ),
    "both": scene(
        PLATE.format(name="a", more=""),
        gravity(0, -9.81),
        anchored("a", [0.1, 0.2], [1.5, 0.5]),
        algebra="pga2",
    ),
}


def potentials_along(of: Scene, motion: Array, rng: random.Random) -> Array:
    """dU/dε of each interaction when the world's points move by x ↦ x + ε (v + ω×x).

    In an arbitrary configuration, written in points alone: it shares nothing with the module.
    """
    d = of.group.dimension

    def velocity(x: Array) -> Array:
        turned = np.cross(motion[:3], x) if d == 3 else motion[0] * np.array([-x[1], x[0]])
        return np.asarray(motion[-d:] + turned)

    places = {b.name: np.array([rng.uniform(-3, 3) for _ in range(d)]) for b in of.bodies}
    changes = []
    for interaction in of.interactions:
        if isinstance(interaction, Gravity):
            g = np.array(interaction.acceleration)
            changes += [-b.mass * g @ velocity(places[b.name]) for b in of.bodies]
        elif isinstance(interaction, Spring):
            x, v = places[interaction.body], velocity(places[interaction.body])
            y, w = np.array(interaction.anchor or [0.0] * d), np.zeros(d)
            if interaction.other is not None:
                y, w = places[interaction.other], velocity(places[interaction.other])
            length = np.linalg.norm(x - y)
            force = interaction.stiffness * (length - interaction.rest_length) / length
            changes.append(force * (x - y) @ (v - w))
    return np.array(changes)


@pytest.mark.parametrize("case", [*CASES.values(), *PLANAR.values()], ids=[*CASES, *PLANAR])
def test_exactly_the_motions_that_leave_every_potential_invariant_are_listed(case: Scene) -> None:
    dimension = len(case.group.generators)
    rng = random.Random(1)
    seeds = [rng.random() for _ in range(20)]
    rows = []
    for seed in seeds:
        columns = [
            potentials_along(case, np.eye(dimension)[k], random.Random(seed))
            for k in range(dimension)
        ]
        rows.append(np.array(columns).T.reshape(-1, dimension))
    demands = np.concatenate(rows)
    invariant = dimension - (np.linalg.matrix_rank(demands, tol=1e-9) if demands.size else 0)
    listed = momenta(case)
    assert len(listed) == invariant
    for quantity in listed:
        coefficients = dict(quantity.coefficients)
        motion = np.array([coefficients.get(g, 0.0) for g in case.group.generators])
        if demands.size:
            assert demands @ motion == pytest.approx(np.zeros(len(demands)), abs=1e-9)


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ("free", ["e23", "e31", "e12", "e01", "e02", "e03"]),
        ("gravity", ["e12", "e01", "e02"]),
        ("anchor at the origin", ["e23", "e31", "e12"]),
        ("anchor elsewhere", ["e23_about_axis", "e31_about_axis", "e12_about_axis"]),
        ("gravity and anchor", ["e12_about_axis"]),
        ("tilted gravity and anchor", ["e23_combination"]),
        ("two anchors", ["e23_combination"]),
        ("three anchors", []),
        ("joined", ["e23", "e31", "e12", "e01", "e02", "e03"]),
        ("joined under gravity", ["e31", "e01", "e03"]),
    ],
)
def test_momenta_have_readable_names(case: str, expected: list[str]) -> None:
    found = [q.name.removeprefix("spatial_momentum.") for q in momenta(CASES[case])]
    assert found == expected


def test_an_axis_is_named_by_a_point_on_it() -> None:
    (quantity,) = momenta(CASES["gravity and anchor"])
    assert quantity.coefficients == (("e12", 1.0), ("e01", -0.7), ("e02", -1.5))
    assert "along e3 through (1.5, -0.7, 0)" in quantity.description


def test_decimals_are_taken_as_written() -> None:
    """0.1 + 0.2 and 0.3 differ in binary; two springs to the same point still leave a sphere."""
    two = scene(
        body("a"),
        anchored("a", [0.1, 0, 0], [0.1, 0.2, 0.3]),
        anchored("a", [0, 0.4, 0], [0.1, 0.2, 0.3]),
    )
    assert len(momenta(two)) == 3
    assert dict(momenta(two)[0].coefficients) == {"e23": 1.0, "e02": 0.3, "e03": -0.2}


def test_a_free_body_has_the_casimirs_of_its_group() -> None:
    assert names(FREE)[-2:] == ["a.casimir.p_squared", "a.casimir.p_dot_pi"]
    assert names(PLANAR["free"])[-1] == "a.casimir.p_squared"
    top = scene(body("a", "center_of_mass = [0, 0, 1]"), group="SO3")
    assert names(top)[-1] == "a.casimir.pi_squared"
    assert not any("casimir" in name for name in names(CASES["gravity"]))


def test_a_body_beside_a_spring_is_free_and_keeps_its_casimirs() -> None:
    case = scene(body("a"), body("b"), anchored("a", [0.1, 0, 0], [0, 0, 1]))
    assert [q.body for q in case.conserved if "casimir" in q.name] == ["b", "b"]


TOP = body(
    "a", "center_of_mass = [0, 0.1, 0.5]\nposition = [1, 2, 3]\nangular_velocity = [1, 2, 3]"
)
BALANCED = body("a", "position = [1, 2, 3]\nangular_velocity = [1, 2, 3]")


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ([TOP], ["e23", "e31", "e12", "a.casimir.pi_squared"]),
        ([TOP, gravity(0, 0, -9.81)], ["e12"]),
        ([BALANCED, gravity(0, 0, -9.81)], ["e23", "e31", "e12", "a.casimir.pi_squared"]),
        ([TOP, anchored("a", [0, 0, 1], [1, 2, 7])], ["e12"]),
        ([TOP, anchored("a", [0, 0, 1], [1, 2, 3])], ["e23", "e31", "e12"]),
        ([TOP, anchored("a", [0, 0, 0], [1, 2, 7])], ["e23", "e31", "e12", "a.casimir.pi_squared"]),
        ([TOP, gravity(0, 0, -9.81), anchored("a", [0, 0, 1], [4, 2, 3])], []),
    ],
    ids=["free", "heavy", "balanced", "anchored above", "anchored at the point", "tied", "both"],
)
def test_a_body_with_a_fixed_point_conserves_rotations_about_it(
    parts: list[str], expected: list[str]
) -> None:
    assert names(scene(*parts, group="SO3"))[1:] == expected


def test_tops_joined_by_a_spring_conserve_the_rotation_about_the_line_of_their_points() -> None:
    other = body("b", "center_of_mass = [0, 0.1, 0.5]\nposition = [1, 2, 5]")
    case = scene(TOP, other, joined("a", [0, 0, 1], "b", [0, 1, 0]), group="SO3")
    assert names(case)[1:] == ["e12"]


def test_energy_near_zero_is_measured_against_its_parts() -> None:
    """At height 4.905 with v = 9.81 m/s the energy vanishes, its two parts do not."""
    case = scene(
        body("a", "position = [0, 0, -4.905]\nvelocity = [9.81, 0, 0]"), gravity(0, 0, -9.81)
    )
    energy = case.conserved[0]
    assert energy.norm == ()
    assert energy.scale == pytest.approx(2 * 9.81**2)


def test_the_scale_of_a_momentum_is_the_norm_of_its_kind() -> None:
    linear = momenta(FREE)[3]
    assert linear.norm == tuple(f"spatial_momentum.e0{k}" for k in (1, 2, 3))
    assert linear.scale == pytest.approx(2 * np.linalg.norm([0.3, 0.1, -0.2]))


def test_initial_spatial_momentum_is_the_momentum_of_the_points() -> None:
    """Against Σ m x×v over the point masses of a body that is turned and displaced."""
    text = """
    algebra = "pga3"
    [[body]]
    name = "a"
    points = [{mass=1, at=[1,0,0]}, {mass=2, at=[0,1,0]}, {mass=3, at=[0,0.5,1]}]
    position = [1, -2, 0.5]
    orientation = { axis = [1, 2, 3], angle = 0.7 }
    velocity = [0.1, 0.2, -0.3]
    angular_velocity = [1, -1, 2]
    [time]
    end = 1
    step = 0.1
    """
    a = parse_scene(text.encode(), name="a", file="a.toml")
    axis, angle = np.array([1, 2, 3]) / np.sqrt(14), 0.7
    hat = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation = np.eye(3) + np.sin(angle) * hat + (1 - np.cos(angle)) * hat @ hat
    angular, linear = np.zeros(3), np.zeros(3)
    kinetic = 0.0
    places: list[tuple[float, list[float]]] = [(1, [1, 0, 0]), (2, [0, 1, 0]), (3, [0, 0.5, 1])]
    for mass, at in places:
        x = rotation @ at + [1, -2, 0.5]
        v = rotation @ (np.array([0.1, 0.2, -0.3]) + np.cross([1, -1, 2], at))
        angular += mass * np.cross(x, v)
        linear += mass * v
        kinetic += 0.5 * mass * v @ v
    assert a.initial_spatial_momentum == pytest.approx([*angular, *linear], rel=1e-13)
    assert a.initial_energy[0] == pytest.approx(kinetic, rel=1e-13)


def test_null_space_is_exact_and_reduced() -> None:
    third = Fraction(1, 3)
    rows = [[Fraction(1), Fraction(2), third], [Fraction(2), Fraction(4), 2 * third]]
    basis = null_space(rows, 3)
    assert basis == [[1, 0, -3], [0, 1, -6]]
    assert all(sum(a * b for a, b in zip(row, x, strict=True)) == 0 for row in rows for x in basis)


def test_bundled_scenes_say_what_their_comments_say() -> None:
    assert names(read_scene("heavy_top"))[1:] == ["e12", "top.momentum.e12"]
    assert names(read_scene("spring_pendulum"))[1:] == ["e12"]
    assert names(read_scene("two_bodies"))[1:] == ["e23", "e31", "e12", "e01", "e02", "e03"]
    assert names(read_scene("planar"))[1:] == []
    assert isinstance(read_scene("planar").interactions[1], Spring)
