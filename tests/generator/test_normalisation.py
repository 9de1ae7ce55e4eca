"""One motion in three normalisations: the right-hand sides agree exactly."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import pytest

from hamotor.codegen import bundled_algebra
from hamotor.codegen.algebra import Algebra, Blade, Multivector, Rational, add_scaled
from hamotor.codegen.group import LieGroup
from hamotor.codegen.normalisation import NORMALISATIONS, convert, convert_inertia
from hamotor.errors import UsageError

ORACLES = Path(__file__).resolve().parents[1] / "oracles"
GROUPS = [
    (name, group)
    for name in ("pga2", "pga3", "pga4", "cga2", "cga3")
    for group in bundled_algebra(name).groups
]
IDS = [f"{name} {group.name}" for name, group in GROUPS]
Vector = tuple[Fraction, ...]


def random_vector(dice: Random, size: int) -> Vector:
    return tuple(Fraction(dice.randint(-9, 9), dice.randint(1, 7)) for _ in range(size))


def random_inertia(dice: Random, size: int) -> list[list[Fraction]]:
    rows = [random_vector(dice, size) for _ in range(size)]
    return [
        [sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0)) for b in rows] for a in rows
    ]


def times(matrix: Sequence[Sequence[Fraction]], vector: Vector) -> Vector:
    return tuple(
        sum((x * y for x, y in zip(row, vector, strict=True)), Fraction(0)) for row in matrix
    )


def combination(
    values: Sequence[Rational], basis: Sequence[Mapping[Blade, Rational]]
) -> Multivector:
    total: Multivector = {}
    for x, element in zip(values, basis, strict=True):
        add_scaled(total, element, x)
    return total


def blades(algebra: Algebra, group: LieGroup) -> list[Multivector]:
    """b_a, the blades that name the generators."""
    named = (algebra.parse_blade(g.name) for g in group.generators)
    return [{blade: sign} for blade, sign in named]


def paired(algebra: Algebra, mu: Multivector, b: Mapping[Blade, Rational]) -> Fraction:
    """(μ ∧ b) / I."""
    return sum(
        (
            Fraction(x * y * algebra.outer(p, q).get(algebra.pseudoscalar, 0))
            for p, x in mu.items()
            for q, y in b.items()
        ),
        Fraction(0),
    )


def dual_of_blades(algebra: Algebra, group: LieGroup) -> list[Multivector]:
    """b_a*, from the duals of the generators."""
    result: list[Multivector] = []
    for dual, blade in zip(group.momentum.components, blades(algebra, group), strict=True):
        x = paired(algebra, dict(dual.embedding), blade)
        result.append({b: y / x for b, y in dual.embedding.items()})
    return result


def bracket(algebra: Algebra, a: Multivector, b: Multivector) -> Multivector:
    total = algebra.multiply(a, b)
    add_scaled(total, algebra.multiply(b, a), -1)
    return total


def physical(algebra: Algebra, group: LieGroup, w: Vector, mu: Vector, f: Vector) -> Vector:
    """μ̇_a = μ([B, E_a]) − F_a, from the structure constants."""
    assert algebra
    size = range(len(w))
    return tuple(
        sum((w[b] * group.structure[b][a][k] * mu[k] for b in size for k in size), Fraction(0))
        - f[a]
        for a in size
    )


def core(algebra: Algebra, group: LieGroup, w: Vector, mu: Vector, f: Vector) -> Vector:
    """[μ, B] − F over blades."""
    basis, dual = blades(algebra, group), dual_of_blades(algebra, group)
    change = bracket(algebra, combination(mu, dual), combination(w, basis))
    return tuple(paired(algebra, change, b) - x for b, x in zip(basis, f, strict=True))


def de_keninck_dorst(algebra: Algebra, group: LieGroup, w: Vector, mu: Vector, f: Vector) -> Vector:
    """B × μ + F over blades."""
    basis, dual = blades(algebra, group), dual_of_blades(algebra, group)
    change = bracket(algebra, combination(w, basis), combination(mu, dual))
    return tuple(paired(algebra, change, b) / 2 + x for b, x in zip(basis, f, strict=True))


RIGHT_HAND_SIDES: dict[str, Callable[[Algebra, LieGroup, Vector, Vector, Vector], Vector]] = {
    "physical": physical,
    "core": core,
    "de_keninck_dorst": de_keninck_dorst,
}


@pytest.mark.parametrize("forced", [False, True], ids=["free", "forced"])
@pytest.mark.parametrize(("algebra", "group"), GROUPS, ids=IDS)
def test_the_three_right_hand_sides_agree(algebra: str, group: LieGroup, forced: bool) -> None:
    space = bundled_algebra(algebra).algebra
    dice = Random(9)
    size = len(group.generators)
    inertia = random_inertia(dice, size)
    w = random_vector(dice, size)
    mu = times(inertia, w)
    forque = random_vector(dice, size) if forced else (Fraction(0),) * size
    expected = physical(space, group, w, mu, forque)
    velocity = combination(w, [g.bivector for g in group.generators])
    for name, right_hand_side in RIGHT_HAND_SIDES.items():
        rate, momentum, force = (
            convert(space, group, kind, x, "physical", name)
            for kind, x in (("rate", w), ("momentum", mu), ("forque", forque))
        )
        matrix = convert_inertia(space, group, inertia, "physical", name)
        assert times(matrix, rate) == momentum
        energy = sum((x * y for x, y in zip(rate, momentum, strict=True)), Fraction(0))
        assert energy == sum(x * y for x, y in zip(w, mu, strict=True))
        found = right_hand_side(space, group, rate, momentum, force)
        assert convert(space, group, "momentum", found, name, "physical") == expected
        if name != "physical":
            scale = Fraction(-1, 2) if name == "de_keninck_dorst" else Fraction(1)
            assert combination([scale * x for x in rate], blades(space, group)) == velocity


@pytest.mark.parametrize(("algebra", "group"), GROUPS, ids=IDS)
def test_conversions_around_the_circle_are_the_identity(algebra: str, group: LieGroup) -> None:
    space = bundled_algebra(algebra).algebra
    start = random_vector(Random(10), len(group.generators))
    circle = (*NORMALISATIONS, NORMALISATIONS[0])
    for kind in ("rate", "momentum", "forque"):
        values = start
        for source, target in pairwise(circle):
            values = convert(space, group, kind, values, source, target)
        assert values == start


def test_core_inertia_of_a_rigid_body_is_four_times_the_physical_one() -> None:
    spec = bundled_algebra("pga3")
    size = range(6)
    inertia = [[Fraction(i + 1) if i == j else Fraction(0) for j in size] for i in size]
    found = convert_inertia(spec.algebra, spec.group("SE3"), inertia, "physical", "core")
    assert [found[i][i] for i in size] == [4, 8, 12, 16, 20, 24]
    same = convert_inertia(spec.algebra, spec.group("SE3"), inertia, "physical", "de_keninck_dorst")
    assert [list(row) for row in same] == inertia


def oracle(name: str) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads((ORACLES / f"{name}.json").read_text("utf-8"))
    return loaded


def momentum_of(group: LieGroup, mu: Mapping[str, str]) -> Vector:
    """The oracle's core numbers in the generators' order."""
    return tuple(Fraction(mu[f"(e{g.name[1]}^e{g.name[2]})*"]) for g in group.generators)


@pytest.mark.parametrize(
    ("name", "algebra", "group"),
    [
        ("01_free_asymmetric_pga3", "pga3", "SE3"),
        ("05_spring_gravity_pga3", "pga3", "SE3"),
        ("10_free_se4_pga4", "pga4", "SE4"),
        ("15_spring_gravity_cga3_se3", "cga3", "SE3"),
    ],
)
def test_core_momenta_of_oracles_are_their_physical_ones(
    name: str, algebra: str, group: str
) -> None:
    data = oracle(name)
    spec = bundled_algebra(algebra)
    lie = spec.group(group)
    for at in (data["initial"], *data["states"]):
        mu = convert(spec.algebra, lie, "momentum", momentum_of(lie, at["mu"]), "core", "physical")
        listed = [Fraction(x) for x in (*at["Pi_body"], *at["P_body"])]
        assert max(abs(x - y) for x, y in zip(mu, listed, strict=True)) < Fraction(1, 10**30)


def test_the_literal_right_hand_side_of_the_elastic_body_converts() -> None:
    """Oracle 12: H = p²/2m + π²/2J + π0²/2J0 in core, on Sim(3)."""
    data = oracle("12_elastic_seed_cga3_sim3")
    spec = bundled_algebra("cga3")
    group = spec.group("Sim3")
    params = data["params"]
    moments = [*params["J"], *[params["m"]] * 3, params["J0"]]
    mu = momentum_of(group, data["initial"]["mu"])
    rate = tuple(x / Fraction(k) for x, k in zip(mu, moments, strict=True))
    free = (Fraction(0),) * 7
    w, momentum = (
        convert(spec.algebra, group, kind, x, "core", "physical")
        for kind, x in (("rate", rate), ("momentum", mu))
    )
    found = physical(spec.algebra, group, w, momentum, free)
    literal = convert(spec.algebra, group, "momentum", found, "physical", "core")
    listed = momentum_of(group, data["initial_rhs (time derivative of M and mu at t=0)"]["mu"])
    assert max(abs(x - y) for x, y in zip(literal, listed, strict=True)) < Fraction(1, 10**30)


def test_unknown_names_are_refused_with_what_there_is() -> None:
    spec = bundled_algebra("pga2")
    group = spec.group("SE2")
    zero = (Fraction(0),) * 3
    with pytest.raises(UsageError, match=r'unknown normalisation "cor".*Did you mean "core"'):
        convert(spec.algebra, group, "rate", zero, "physical", "cor")
    with pytest.raises(UsageError, match=r'unknown quantity "rat".*Did you mean "rate"'):
        convert(spec.algebra, group, "rat", zero, "physical", "core")
