"""The kinetic matrix against I(B) = Σ m X ∨ (X × B), evaluated exactly in the algebra."""

from __future__ import annotations

import itertools
import random
from fractions import Fraction

import numpy as np
import pytest

from hamotor.scene import inertia
from hamotor.scene.motors import Matrix

Multivector = dict[tuple[int, ...], Fraction]


def sorted_with_sign(indices: tuple[int, ...]) -> tuple[tuple[int, ...], int]:
    inversions = sum(a > b for a, b in itertools.combinations(indices, 2))
    return tuple(sorted(indices)), (-1) ** inversions


def add(*terms: Multivector) -> Multivector:
    total: Multivector = {}
    for term in terms:
        for blade, x in term.items():
            total[blade] = total.get(blade, Fraction(0)) + x
    return {blade: x for blade, x in total.items() if x}


def scaled(a: Multivector, factor: Fraction) -> Multivector:
    return {blade: x * factor for blade, x in a.items()}


def geometric_product(a: Multivector, b: Multivector) -> Multivector:
    """With e0² = 0 and ei² = 1: equal neighbours contract after sorting."""
    terms = []
    for (blade_a, x), (blade_b, y) in itertools.product(a.items(), b.items()):
        indices, sign = sorted_with_sign(blade_a + blade_b)
        if indices.count(0) < 2:
            rest = tuple(i for i in indices if indices.count(i) == 1)
            terms.append({rest: x * y * sign})
    return add(*terms)


def commutator(a: Multivector, b: Multivector) -> Multivector:
    difference = add(geometric_product(a, b), scaled(geometric_product(b, a), Fraction(-1)))
    return scaled(difference, Fraction(1, 2))


def outer(a: Multivector, b: Multivector) -> Multivector:
    terms = []
    for (blade_a, x), (blade_b, y) in itertools.product(a.items(), b.items()):
        if not set(blade_a) & set(blade_b):
            indices, sign = sorted_with_sign(blade_a + blade_b)
            terms.append({indices: x * y * sign})
    return add(*terms)


def complement(a: Multivector, n: int) -> Multivector:
    """The right complement: b ∧ b* = e0∧e1∧…∧e(n-1)."""
    terms = []
    for blade, x in a.items():
        rest = tuple(i for i in range(n) if i not in blade)
        terms.append({rest: x * sorted_with_sign(blade + rest)[1]})
    return add(*terms)


def undone_complement(a: Multivector, n: int) -> Multivector:
    terms = []
    for blade, x in a.items():
        rest = tuple(i for i in range(n) if i not in blade)
        terms.append({rest: x * sorted_with_sign(rest + blade)[1]})
    return add(*terms)


def regressive(a: Multivector, b: Multivector, n: int) -> Multivector:
    return undone_complement(outer(complement(a, n), complement(b, n)), n)


def oriented(i: int, j: int) -> Multivector:
    blade, sign = sorted_with_sign((i, j))
    return {blade: Fraction(sign)}


ROTATIONS = {3: [(2, 3), (3, 1), (1, 2)], 2: [(1, 2)]}


def generators(d: int) -> list[Multivector]:
    """B_D of a unit rate, rotations first: e_i∧e_j and e0∧e_i."""
    return [oriented(i, j) for i, j in ROTATIONS[d]] + [oriented(0, i) for i in range(1, d + 1)]


def momentum_by_algebra(
    points: list[tuple[int, list[int]]], rate: list[int], d: int
) -> list[Fraction]:
    """The coefficients of Σ m X ∨ (X × B) on the wedge-dual basis of the generators."""
    n = d + 1
    basis = generators(d)
    b = add(*(scaled(g, Fraction(w)) for g, w in zip(basis, rate, strict=True)))
    total: Multivector = {}
    for mass, place in points:
        point = complement(
            {(0,): Fraction(1), **{(k,): Fraction(x) for k, x in enumerate(place, 1)}}, n
        )
        line = regressive(point, commutator(point, b), n)
        total = add(total, scaled(line, Fraction(mass)))
    whole = tuple(range(n))
    # μ^f ∧ B = μ(B) I
    return [outer(total, g).get(whole, Fraction(0)) for g in basis]


@pytest.mark.parametrize("d", [2, 3])
def test_kinetic_matrix_is_the_join_formula_on_every_rate(d: int) -> None:
    rng = random.Random(d)
    for _ in range(20):
        points = [
            (rng.choice([1, 2, 4]), [rng.randint(-9, 9) * 4 for _ in range(d)]) for _ in range(5)
        ]
        mass = sum(m for m, _ in points)
        points.append((16 - mass if mass < 16 else 32 - mass, [0] * d))  # Σm a power of two
        total, center, tensor = inertia.of_points(points)
        kinetic = inertia.kinetic_matrix(total, center, tensor)
        for column in range(len(kinetic)):
            rate = [int(k == column) for k in range(len(kinetic))]
            assert kinetic[:, column].tolist() == momentum_by_algebra(points, rate, d)


@pytest.mark.parametrize("d", [2, 3])
def test_momentum_is_the_kinetic_matrix_times_the_rate(d: int) -> None:
    rng = random.Random(d)
    for _ in range(20):
        points = [(rng.randint(1, 9), [rng.randint(-9, 9) for _ in range(d)]) for _ in range(4)]
        rate = [rng.randint(-9, 9) for _ in generators(d)]
        rotations = len(ROTATIONS[d])
        mass, center, tensor = inertia.of_points(points)
        momentum = inertia.momentum(
            mass, center, tensor, tuple(rate[:rotations]), tuple(rate[rotations:])
        )
        exact = momentum_by_algebra(points, rate, d)
        assert momentum == pytest.approx([float(x) for x in exact], rel=1e-14, abs=1e-12)
        product = inertia.kinetic_matrix(mass, center, tensor) @ rate
        assert momentum == pytest.approx(product.tolist(), rel=1e-12, abs=1e-11)


def test_a_fixed_origin_leaves_the_rotation_block_about_it() -> None:
    points = [(1.0, [1.0, 2.0, 3.0]), (2.0, [-1.0, 0.5, 0.0]), (3.0, [0.0, 0.0, -2.0])]
    mass, center, tensor = inertia.of_points(points)
    about_point = sum(m * (np.dot(x, x) * np.eye(3) - np.outer(x, x)) for m, x in points)
    fixed = inertia.kinetic_matrix(mass, center, tensor, translates=False)
    assert fixed == pytest.approx(np.array(about_point), rel=1e-14)
    momentum = inertia.momentum(mass, center, tensor, (0.3, -0.2, 0.7), None)
    assert momentum == pytest.approx((fixed @ [0.3, -0.2, 0.7]).tolist(), rel=1e-14)


@pytest.mark.parametrize(
    ("tensor", "expected"),
    [
        (inertia.box(12.0, (1.0, 2.0, 3.0)), (13.0, 10.0, 5.0)),
        (inertia.ellipsoid(5.0, (1.0, 2.0, 3.0)), (13.0, 10.0, 5.0)),
        (inertia.cylinder(12.0, 2.0, 3.0), (21.0, 21.0, 24.0)),
    ],
)
def test_uniform_bodies_have_the_moments_of_the_textbook(
    tensor: Matrix, expected: tuple[float, ...]
) -> None:
    assert tensor == inertia.diagonal(expected)


def test_planar_bodies_have_the_polar_moment() -> None:
    assert inertia.box(12.0, (1.0, 2.0)) == ((5.0,),)
    assert inertia.disk(2.0, 3.0) == ((9.0,),)


def test_a_box_is_its_eight_corners_shrunk_by_the_square_root_of_three() -> None:
    """A uniform box has second moments a²/12; eight corners at ±a/(2√3) have the same."""
    sides = (0.3, 0.5, 0.7)
    corners = [
        (0.25, [s * a / (2 * 3**0.5) for s, a in zip(signs, sides, strict=True)])
        for signs in itertools.product((-1, 1), repeat=3)
    ]
    _, center, tensor = inertia.of_points(corners)
    assert center == pytest.approx((0, 0, 0), abs=1e-17)
    assert np.array(tensor) == pytest.approx(np.array(inertia.box(2.0, sides)), rel=1e-14)


@pytest.mark.parametrize(
    "moments", [(1.0, 1.0, 2.0), (2.0, 1.0, 3.0), (1.0, 1.0, 0.0), (0.1, 0.2, 0.3)]
)
def test_flat_bodies_and_rods_keep_the_triangle_inequality(moments: tuple[float, ...]) -> None:
    tensor = inertia.diagonal(moments)
    assert inertia.violated_inequality(tensor) == ""
    assert inertia.negative_moments(tensor) == ""


def test_unphysical_moments_name_the_inequality_they_violate() -> None:
    assert inertia.violated_inequality(inertia.diagonal((1.0, 3.5, 2.0))) == "3.5 <= 1 + 2"
    assert inertia.negative_moments(inertia.diagonal((1.0, -1.0, 1.0))) == "-1, 1, 1"
