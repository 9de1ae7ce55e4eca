"""What the motion under a Hamiltonian conserves, found from the Hamiltonian alone."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy
from tests.generator.hamiltonians import (
    HAMILTONIANS,
    ZERO,
    Q,
    body_on,
    free,
    heavy_top,
)
from tests.generator.test_conserved import CASES
from tests.rigid import RIGID, read_scene

from hamotor.mechanics.hamiltonian import TIME, Hamiltonian
from hamotor.mechanics.proof import prove_energy_balance
from hamotor.mechanics.symmetries import conserved
from hamotor.mechanics.system import System

SCENES = {name: read_scene(name) for name in RIGID} | CASES


@pytest.mark.parametrize("name", SCENES)
def test_rigid_scenes_conserve_what_their_exact_linear_algebra_says(name: str) -> None:
    scene = SCENES[name]
    found = {q.name: q for q in conserved(scene.hamiltonian)}
    for expected in scene.conserved:
        q = found.pop(expected.name)
        assert q.unit == expected.unit
        assert tuple((g, float(x)) for g, x in q.coefficients) == expected.coefficients
        if not expected.body:
            assert q.description == expected.description
    assert not {n for n in found if ".momentum." not in n}


def names(hamiltonian: Hamiltonian) -> list[str]:
    return [q.name for q in conserved(hamiltonian)]


SE3_MOMENTA = tuple(f"spatial_momentum.{g}" for g in ("e23", "e31", "e12", "e01", "e02", "e03"))
SIMILARITIES = ("e23", "e31", "e12", "e1i", "e2i", "e3i", "e0i")
CONSERVED: dict[str, list[str]] = {
    "symmetric heavy top": ["energy", "spatial_momentum.e12", "top.momentum.e12"],
    "asymmetric heavy top": ["energy", "spatial_momentum.e12"],
    "gravity and spring": ["energy", "spatial_momentum.e12_about_axis"],
    "gravity and spring, conformal": ["energy", "spatial_momentum.e12_about_axis"],
    "two bodies": ["energy", *SE3_MOMENTA],
    "Kirchhoff": [
        "energy",
        "spatial_momentum.e12",
        *SE3_MOMENTA[3:],
        "hull.casimir.p_squared",
    ],
    "dipole": ["energy", "spatial_momentum.e31_combination"],
    "conformal body": [
        "energy",
        *(f"spatial_momentum.{g}" for g in SIMILARITIES),
        "body.casimir.p_dot_pi_squared_over_p_squared",
    ],
    "breathing body": [
        "energy",
        "spatial_momentum.e12",
        "spatial_momentum.e1i",
        "spatial_momentum.e2i",
    ],
    "full conformal in a potential": [
        "energy",
        "spatial_momentum.e23_about_axis",
        "spatial_momentum.e31_about_axis",
        "spatial_momentum.e12",
    ],
    "not quadratic": ["energy_balance"],
    "damped and driven": ["energy_balance"],
}


@pytest.mark.parametrize("name", CONSERVED)
def test_conserved_quantities_are_those_of_the_textbook(name: str) -> None:
    found = conserved(HAMILTONIANS[name]())
    assert [q.name for q in found] == CONSERVED[name]
    assert all(q.proved for q in found)


def test_the_momentum_about_the_axis_of_a_dipole_field_is_kept() -> None:
    _, about_axis = conserved(HAMILTONIANS["dipole"]())
    assert about_axis.coefficients == (("e31", Fraction(1)), ("e12", Fraction(10, 3)))


def test_a_hair_of_asymmetry_ends_the_spin() -> None:
    assert names(heavy_top("1", "1.000000000001", "2.5")) == ["energy", "spatial_momentum.e12"]


def test_an_axis_of_symmetry_may_lie_anywhere_in_the_body() -> None:
    body = body_on("cl3", "SO3", "top")
    along = sum(a * p for a, p in zip((3, 0, 4), body.momenta, strict=True))
    energy = sum(p**2 for p in body.momenta) / 2 + Q(1, 7) * along**2
    (spin,) = (q for q in conserved(Hamiltonian((body,), energy)) if q.name.startswith("top.mom"))
    assert spin.name == "top.momentum.e23_combination"
    assert spin.description == "e23 + 1.33333333333*e12, of top, body frame"
    assert sympy.expand(spin.expression - along / 3) == 0
    assert spin.proved


def test_a_plate_spins_about_its_centre_of_mass_wherever_it_pulls() -> None:
    body = body_on("pga2", "SE2", "plate")
    spin, p1, p2 = body.momenta
    centre = body.at((Q(1, 2), Q(-1, 3)))
    about_centre = spin + p1 * Q(-1, 3) - p2 * Q(1, 2)
    energy = (p1**2 + p2**2 + about_centre**2) / 2 + sum(x**2 for x in centre)
    own = {q.name: q for q in conserved(Hamiltonian((body,), energy)) if q.kind == "own"}
    assert list(own) == ["plate.momentum.e12_about_axis"]
    found = own["plate.momentum.e12_about_axis"]
    assert sympy.expand(found.expression - about_centre) == 0
    assert "about (0.5, -0.333333333333)" in found.description


def test_a_body_that_only_translates_reports_each_momentum_once() -> None:
    body = body_on("pga3", "T3")
    energy = free(body, 1, 1, 1) + body.position[2] ** 2
    assert names(Hamiltonian((body,), energy)) == [
        "energy",
        "spatial_momentum.e01",
        "spatial_momentum.e02",
    ]


def test_a_couple_leaves_linear_momentum_and_its_square() -> None:
    body = body_on("pga3", "SE3")
    energy = free(body, 1, 2, 3, 4, 5, 6) + 3 * body.rotation[2][1]
    assert names(Hamiltonian((body,), energy)) == [
        "energy",
        "spatial_momentum.e12",
        "spatial_momentum.e01",
        "spatial_momentum.e02",
        "spatial_momentum.e03",
        "body.casimir.p_squared",
    ]


def test_what_is_applied_is_pulled_to_the_world() -> None:
    body = body_on("pga3", "SE3")
    energy = free(body, 1, 2, 3, 4, 4, 4)
    upward = tuple(body.rotation[2])
    pulled = Hamiltonian((body,), energy, {}, ((ZERO, ZERO, ZERO, *upward),))
    assert names(pulled) == [
        "energy_balance",
        "spatial_momentum.e12",
        "spatial_momentum.e01",
        "spatial_momentum.e02",
    ]
    damped = Hamiltonian((body,), energy, {}, (tuple(p / 9 for p in body.momenta),))
    assert names(damped) == ["energy_balance"]


def test_time_is_no_symmetry_but_space_may_be() -> None:
    body = body_on("pga3", "SE3")
    energy = free(body, 1, 2, 3, 4, 4, 4) + sympy.cos(3 * TIME) * body.position[0]
    assert names(Hamiltonian((body,), energy)) == [
        "energy_balance",
        "spatial_momentum.e23",
        "spatial_momentum.e02",
        "spatial_momentum.e03",
    ]


def test_a_quantity_that_only_one_branch_of_an_absolute_value_keeps_is_not_listed() -> None:
    body = body_on("pga3", "T3")
    depth = body.position[2] + 1000
    energy = free(body, 1, 1, 1) + (sympy.Abs(depth) - depth) ** 2
    assert names(Hamiltonian((body,), energy)) == [
        "energy",
        "spatial_momentum.e01",
        "spatial_momentum.e02",
    ]


def test_a_weak_symmetry_breaking_is_seen_beside_a_huge_force() -> None:
    body = body_on("pga3", "SE3")
    heavy = Q(10) ** 24
    energy = free(body, heavy, 2 * heavy, 3 * heavy, heavy, heavy, heavy)
    energy += heavy**2 / sympy.sqrt(sum(x**2 for x in body.position))
    assert names(Hamiltonian((body,), energy)) == [
        "energy",
        "spatial_momentum.e23",
        "spatial_momentum.e31",
        "spatial_momentum.e12",
    ]


def test_a_direction_given_by_rounded_irrational_numbers_is_found() -> None:
    body = body_on("pga3", "SE3")
    energy = free(body, 1, 2, 3, 4, 4, 4)
    direction = Q(str(sympy.sin(Q(3, 10)).evalf(60))), Q(str(sympy.cos(Q(3, 10)).evalf(60)))
    energy += direction[0] * body.position[0] + direction[1] * body.position[2]
    found = {q.name: q for q in conserved(Hamiltonian((body,), energy))}
    assert list(found) == [
        "energy",
        "spatial_momentum.e23_combination",
        "spatial_momentum.e01_combination",
        "spatial_momentum.e02",
    ]
    slope = found["spatial_momentum.e01_combination"].coefficients[1][1]
    assert abs(slope + Fraction(str(sympy.tan(Q(3, 10)).evalf(60)))) < Fraction(1, 10**55)


@pytest.mark.parametrize(
    ("algebra", "group"), [("cga3", "SO41"), ("cga3", "Sim3"), ("pga4", "SO4"), ("cga2", "SO31")]
)
def test_free_bodies_keep_every_spatial_momentum_and_every_casimir(
    algebra: str, group: str
) -> None:
    body = body_on(algebra, group)
    energy = free(body, *range(1, len(body.momenta) + 1))
    found = conserved(Hamiltonian((body,), energy))
    assert [q.name for q in found] == [
        "energy",
        *(f"spatial_momentum.{g.name}" for g in body.group.generators),
        *(f"body.casimir.{c.name}" for c in body.group.casimirs),
    ]
    assert all(q.proved for q in found)


def test_two_bodies_keep_the_total_and_a_symmetric_one_its_spin() -> None:
    a, b = (body_on("pga3", "SE3", name, f"{name}.") for name in "ab")
    gap = sum((x - y) ** 2 for x, y in zip(a.position, b.at((Q(1, 5), ZERO, ZERO)), strict=True))
    energy = free(a, 1, 1, 2, 3, 3, 3) + free(b, 1, 1, 2, 3, 3, 3) + (sympy.sqrt(gap) - 1) ** 2
    assert names(Hamiltonian((a, b), energy)) == [
        "energy",
        *(f"spatial_momentum.{g.name}" for g in a.group.generators),
        "a.momentum.e12",
    ]


def test_functions_are_continued_where_their_domain_is_far_away() -> None:
    body = body_on("pga3", "T3")
    x, y, _ = body.position
    for potential in (sympy.sqrt(x - 1000), sympy.log(x - 7) * sympy.acos(3 + x)):
        assert names(Hamiltonian((body,), free(body, 1, 1, 1) + potential)) == [
            "energy",
            "spatial_momentum.e02",
            "spatial_momentum.e03",
        ]
    angle = sympy.atan2(sympy.sqrt(x - 1000), y)
    assert names(Hamiltonian((body,), free(body, 1, 1, 1) + angle)) == [
        "energy",
        "spatial_momentum.e03",
    ]


def test_a_tower_of_exponentials_ends_with_the_energy_alone() -> None:
    body = body_on("pga3", "T3")
    tower = sympy.exp(sympy.exp(sympy.exp(sympy.exp(body.position[0] + 3))))
    system = System(Hamiltonian((body,), free(body, 1, 1, 1) + tower))
    assert [q.name for q in conserved(system.hamiltonian, system)] == ["energy"]
    prove_energy_balance(system)


def test_a_large_power_is_not_multiplied_out() -> None:
    body = body_on("pga3", "SE3")
    many = sum(body.momenta) + sum(body.position)
    found = conserved(Hamiltonian((body,), many**60))
    assert [q.name for q in found] == [
        "energy",
        "spatial_momentum.e23_combination",
        "spatial_momentum.e01_combination",
        "spatial_momentum.e02_combination",
        "body.momentum.e23_combination",
    ]
