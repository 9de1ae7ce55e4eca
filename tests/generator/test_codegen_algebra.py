"""The algebra engine against the oracle, for any Gram matrix; signatures; names of blades."""

from __future__ import annotations

import random
from collections.abc import Callable
from fractions import Fraction

import numpy
import pytest
from tests.reference.oracle import Blade, Oracle

from hamotor.codegen.algebra import Algebra, Multivector, Rational, grades_of, reverse_sign

Gram = tuple[tuple[Rational, ...], ...]

NULL_PLANE: Gram = ((0, 0, 0, -1), (0, 1, 0, 0), (0, 0, 1, 0), (-1, 0, 0, 0))
PGA3: Gram = tuple(tuple(int(i == j and i > 0) for j in range(4)) for i in range(4))
ALL_NULL: Gram = ((0, 0, 0), (0, 0, 0), (0, 0, 0))
LIGHT_CONE: Gram = ((0, 1, 1), (1, 0, 1), (1, 1, 0))


def random_gram(seed: int) -> Gram:
    """Symmetric, rational, up to 4 × 4; a third of them degenerate."""
    dice = random.Random(seed)
    size = dice.randint(1, 4)

    def number() -> Rational:
        return Fraction(dice.randint(-3, 3), dice.choice([1, 1, 2, 3]))

    rows = [[number() for _ in range(size)] for _ in range(size)]
    symmetric = [[rows[min(i, j)][max(i, j)] for j in range(size)] for i in range(size)]
    if seed % 3 == 0 and size > 1:  # the last vector is a combination of the others
        weights = [dice.randint(-2, 2) for _ in range(size - 1)]
        for i in range(size - 1):
            symmetric[i][-1] = symmetric[-1][i] = sum(
                (w * symmetric[i][k] for k, w in enumerate(weights)), Fraction(0)
            )
        symmetric[-1][-1] = sum((w * symmetric[k][-1] for k, w in enumerate(weights)), Fraction(0))
    return tuple(tuple(row) for row in symmetric)


IDS = ["null plane", "pga3", "all null", "light cone", *(f"random {i}" for i in range(24))]
GRAMS = [NULL_PLANE, PGA3, ALL_NULL, LIGHT_CONE, *(random_gram(seed) for seed in range(24))]


def algebra_of(gram: Gram) -> Algebra:
    return Algebra("some", tuple(f"e{i}" for i in range(len(gram))), gram)


def mask(blade: Blade) -> int:
    return sum(1 << i for i in blade)


def as_masks(value: dict[Blade, Fraction]) -> Multivector:
    return {mask(blade): x for blade, x in value.items()}


@pytest.mark.parametrize("gram", GRAMS, ids=IDS)
def test_every_product_of_basis_blades_equals_the_oracle(gram: Gram) -> None:
    algebra, oracle = algebra_of(gram), Oracle(gram)
    products: list[tuple[Callable[[int, int], Multivector], Callable[..., dict[Blade, Fraction]]]]
    products = [
        (algebra.geometric, oracle.gp),
        (algebra.outer, oracle.outer),
        (algebra.inner, oracle.inner),
        (algebra.left_contraction, oracle.left_contraction),
        (algebra.right_contraction, oracle.right_contraction),
        (algebra.commutator, oracle.commutator),
        (algebra.anticommutator, oracle.anticommutator),
        (algebra.regressive, oracle.regressive),
    ]
    for a in oracle.blades:
        for b in oracle.blades:
            for ours, theirs in products:
                expected = as_masks(theirs({a: Fraction(1)}, {b: Fraction(1)}))
                assert ours(mask(a), mask(b)) == expected, (ours.__name__, a, b)


@pytest.mark.parametrize("gram", GRAMS[:12], ids=IDS[:12])
def test_complement_and_reversal_equal_the_oracle(gram: Gram) -> None:
    algebra, oracle = algebra_of(gram), Oracle(gram)
    for blade in oracle.blades:
        one = {blade: Fraction(1)}
        assert algebra.complement(mask(blade)) == as_masks(oracle.complement(one))
        assert algebra.complement_inverse(mask(blade)) == as_masks(oracle.complement_inverse(one))
        assert {mask(blade): reverse_sign(mask(blade))} == as_masks(oracle.reverse(one))


@pytest.mark.parametrize("gram", GRAMS, ids=IDS)
def test_signature_is_sylvesters(gram: Gram) -> None:
    """Signs of the eigenvalues, and of the diagonal after any change of basis."""
    eigenvalues = numpy.linalg.eigvalsh(numpy.array(gram, dtype=float))
    expected = (
        int((eigenvalues > 1e-9).sum()),
        int((eigenvalues < -1e-9).sum()),
        int((abs(eigenvalues) <= 1e-9).sum()),
    )
    assert algebra_of(gram).signature == expected
    squares = Oracle(gram).squares
    assert expected[:2] == (sum(x > 0 for x in squares), sum(x < 0 for x in squares))


def test_associativity_in_a_null_basis() -> None:
    algebra = algebra_of(NULL_PLANE)
    blades = range(1 << algebra.dimension)
    for a in blades:
        for b in blades:
            for c in blades:
                left = algebra.multiply(algebra.geometric(a, b), {c: 1})
                assert left == algebra.multiply({a: 1}, algebra.geometric(b, c))


def test_blades_are_named_and_read_with_their_orientation() -> None:
    algebra = Algebra("conformal", ("e0", "e1", "e2", "ei"), NULL_PLANE)
    assert algebra.blade_name(0) == "s"
    assert algebra.blade_name(0b1011) == "e01i"
    assert algebra.parse_blade("e01i") == (0b1011, 1)
    assert algebra.parse_blade("ei10") == (0b1011, -1)
    assert algebra.parse_blade("e21") == (0b0110, -1)
    assert algebra.parse_blade("s") == (0, 1)
    for blade in range(16):
        assert algebra.parse_blade(algebra.blade_name(blade)) == (blade, 1)
    for wrong in ("e11", "e4", "x1", "e", "", "e1e2"):
        with pytest.raises(
            ValueError, match="is not a blade; the basis vectors are e0, e1, e2, ei"
        ):
            algebra.parse_blade(wrong)
    assert grades_of([0b11, 0b1, 0b110, 0]) == (0, 1, 2)
