"""Which duals of bivectors move with their bivectors and which do not: exact, algebra alone.

A momentum is an (n-2)-vector μ with μ(B) I = μ ∧ B.  Two maps Λ² → Λ^(n-2) pass for "the dual" of a
bivector: the complement b* (b ∧ b* = I on basis blades) and the product A I.  A map D is
equivariant under M where D(M A ~M) = M D(A) ~M for every A, under a generator G where
D([G, A]) = [G, D(A)].
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from itertools import combinations
from random import Random

import pytest
from sympy import Matrix

from hamotor.codegen.algebra import (
    Algebra,
    Blade,
    Multivector,
    Rational,
    add_scaled,
    grade,
    reverse_sign,
)

Map = Callable[[Algebra, Multivector], Multivector]


def diagonal(name: str, *squares: int, first: int = 1) -> Algebra:
    """The algebra of an orthogonal basis e_first, e_first+1, … with these squares."""
    size = len(squares)
    basis = tuple(f"e{first + i}" for i in range(size))
    gram = tuple(tuple(squares[i] if i == j else 0 for j in range(size)) for i in range(size))
    return Algebra(name, basis, gram)


def pga(d: int) -> Algebra:
    """e0² = 0 and d Euclidean directions."""
    return diagonal(f"pga{d}", 0, *(1 for _ in range(d)), first=0)


def cga(d: int) -> Algebra:
    """Null basis e0, e1 … ed, ei with e0·ei = −1."""
    last = d + 1
    gram = [[Fraction(int(i == j and 0 < i < last)) for j in range(d + 2)] for i in range(d + 2)]
    gram[0][last] = gram[last][0] = Fraction(-1)
    basis = (*(f"e{i}" for i in range(last)), "ei")
    return Algebra(f"cga{d}", basis, tuple(map(tuple, gram)))


PGA = [pga(2), pga(3), pga(4)]
CGA = [cga(2), cga(3)]
CLIFFORD = [
    diagonal("Cl(3)", 1, 1, 1),
    diagonal("Cl(4)", 1, 1, 1, 1),
    diagonal("Cl(3,1)", 1, 1, 1, -1),
    diagonal("Cl(1,3)", 1, -1, -1, -1),
    diagonal("Cl(4,1)", 1, 1, 1, 1, -1),
]
ALL = [*PGA, *CGA, *CLIFFORD]
every_algebra = pytest.mark.parametrize("algebra", ALL, ids=lambda a: a.name)


def blades(algebra: Algebra, k: int) -> list[Blade]:
    """Basis blades of a grade."""
    return [b for b in range(1 << algebra.dimension) if grade(b) == k]


def blade(algebra: Algebra, name: str, factor: Rational = 1) -> Multivector:
    """A multiple of a basis blade by its name."""
    mask, sign = algebra.parse_blade(name)
    return {mask: sign * factor}


def times(a: Algebra, *factors: Multivector) -> Multivector:
    """The geometric product of all."""
    product: Multivector = {0: 1}
    for factor in factors:
        product = a.multiply(product, factor)
    return product


def bracket(a: Algebra, x: Multivector, y: Multivector) -> Multivector:
    """[x, y] = x y − y x."""
    result = a.multiply(x, y)
    add_scaled(result, a.multiply(y, x), -1)
    return result


def reverse(x: Mapping[Blade, Rational]) -> Multivector:
    """~x."""
    return {b: reverse_sign(b) * c for b, c in x.items()}


def linear(table: Callable[[Blade], Multivector], x: Mapping[Blade, Rational]) -> Multivector:
    """A linear map given on basis blades."""
    result: Multivector = {}
    for b, c in x.items():
        add_scaled(result, table(b), c)
    return result


def wedge(a: Algebra, x: Mapping[Blade, Rational], y: Mapping[Blade, Rational]) -> Multivector:
    """x ∧ y."""
    return linear(lambda b: linear(lambda c: a.outer(b, c), y), x)


def scaled(x: Mapping[Blade, Rational], factor: Rational) -> Multivector:
    """factor x."""
    return {b: factor * c for b, c in x.items() if factor * c}


def pseudoscalar(a: Algebra, factor: Rational = 1) -> Multivector:
    """A multiple of I."""
    return {a.pseudoscalar: factor} if factor else {}


def scalar_part(x: Mapping[Blade, Rational]) -> Rational:
    """<x>₀."""
    return x.get(0, 0)


def complement(a: Algebra, x: Multivector) -> Multivector:
    """x*."""
    return linear(a.complement, x)


def times_pseudoscalar(a: Algebra, x: Multivector) -> Multivector:
    """x I."""
    return a.multiply(x, pseudoscalar(a))


def is_equivariant(a: Algebra, dual: Map, generator: Blade) -> bool:
    """Whether D([G, b]) = [G, D(b)] for every bivector b."""
    g: Multivector = {generator: 1}
    return all(
        dual(a, bracket(a, g, {b: 1})) == bracket(a, g, dual(a, {b: 1})) for b in blades(a, 2)
    )


def is_rotation(a: Algebra, generator: Blade) -> bool:
    """Whether a basis bivector is e_i∧e_j with e_i ⟂ e_j and e_i² = e_j² ≠ 0."""
    i, j = (k for k in range(a.dimension) if generator >> k & 1)
    return a.gram[i][j] == 0 and a.gram[i][i] == a.gram[j][j] != 0


def simple_rotors(a: Algebra) -> dict[Blade, Multivector]:
    """For each basis bivector a rational rotor that is a number plus a multiple of it."""
    rotors: dict[Blade, Multivector] = {}
    for b in blades(a, 2):
        square = scalar_part(a.multiply({b: 1}, {b: 1}))
        cosine, sine = {
            -1: (Fraction(3, 5), Fraction(4, 5)),
            0: (Fraction(1), Fraction(2, 3)),
            1: (Fraction(5, 4), Fraction(3, 4)),
        }[int(square)]
        rotors[b] = {0: cosine, b: sine}
        assert times(a, rotors[b], reverse(rotors[b])) == {0: 1}
    return rotors


def random_rotor(a: Algebra, random: Random) -> Multivector:
    """A product of five simple rational rotors."""
    return times(a, *random.choices(list(simple_rotors(a).values()), k=5))


def random_blades(a: Algebra, k: int, random: Random) -> Multivector:
    """A k-vector with rational coefficients, none zero."""
    return {b: Fraction(random.choice([-5, -3, -1, 1, 2, 4]), 3) for b in blades(a, k)}


def moved(a: Algebra, m: Multivector, x: Multivector) -> Multivector:
    """m x ~m."""
    return times(a, m, x, reverse(m))


def rank(rows: Iterable[Mapping[Blade, Rational]], columns: list[Blade]) -> int:
    """Rank of the multivectors, as rows of their coefficients."""
    return int(Matrix([[row.get(c, 0) for c in columns] for row in rows]).rank())


# ---------------------------------------------------------------- the pairing


@every_algebra
def test_the_wedge_pairing_is_invariant_under_every_rotor(algebra: Algebra) -> None:
    """(~M μ M) ∧ (~M B M) = μ ∧ B, whatever the metric."""
    random = Random(6)
    for _ in range(5):
        inverse = reverse(random_rotor(algebra, random))
        momentum = random_blades(algebra, algebra.dimension - 2, random)
        rate = random_blades(algebra, 2, random)
        pairing = wedge(algebra, momentum, rate)
        assert pairing
        seen_from_the_body = moved(algebra, inverse, momentum), moved(algebra, inverse, rate)
        assert wedge(algebra, *seen_from_the_body) == pairing


@every_algebra
def test_the_complements_of_bivectors_are_their_wedge_dual_basis(algebra: Algebra) -> None:
    """b* ∧ c = I where b = c, else 0: the pairing is nondegenerate for every metric."""
    for b in blades(algebra, 2):
        for c in blades(algebra, 2):
            paired = wedge(algebra, complement(algebra, {b: 1}), {c: 1})
            assert paired == pseudoscalar(algebra, int(b == c))


# ---------------------------------------------------------------- the complement, as a map


@every_algebra
def test_the_complement_is_equivariant_only_under_rotations(algebra: Algebra) -> None:
    """Not under e0∧ei in PGA; e0∧ei, ei∧e∞, e0∧e∞ in CGA; boosts in Cl(p,q)."""
    for generator in blades(algebra, 2):
        expected = is_rotation(algebra, generator)
        assert is_equivariant(algebra, complement, generator) == expected, algebra.blade_name(
            generator
        )


@every_algebra
def test_the_complement_is_equivariant_under_finite_rotations_and_breaks_under_the_rest(
    algebra: Algebra,
) -> None:
    for generator, rotor in simple_rotors(algebra).items():
        keeps = all(
            complement(algebra, moved(algebra, rotor, {b: 1}))
            == moved(algebra, rotor, complement(algebra, {b: 1}))
            for b in blades(algebra, 2)
        )
        assert keeps == is_rotation(algebra, generator), algebra.blade_name(generator)


@pytest.mark.parametrize(
    ("algebra", "size"),
    [
        *((pga(d), d * (d - 1) // 2) for d in (2, 3, 4)),
        *((cga(d), d * (d + 1) // 2) for d in (2, 3)),
    ],
    ids=lambda x: x.name if isinstance(x, Algebra) else str(x),
)
def test_the_complement_knows_a_rotation_group_and_no_more(algebra: Algebra, size: int) -> None:
    """Of all generators, so(d) keeps it in PGA; in CGA so(d+1), of e1 … ed and e0 − e∞.

    The defect D([G, b]) − [G, D(b)] is linear in G; its rank is the number of generators that
    break D.
    """
    defects = []
    for generator in blades(algebra, 2):
        defect: dict[int, Rational] = {}
        for b in blades(algebra, 2):
            g: Multivector = {generator: 1}
            change = complement(algebra, bracket(algebra, g, {b: 1}))
            add_scaled(change, bracket(algebra, g, complement(algebra, {b: 1})), -1)
            defect |= {(b << algebra.dimension) + c: x for c, x in change.items()}
        defects.append(defect)
    columns = sorted({c for defect in defects for c in defect})
    assert len(defects) - rank(defects, columns) == size


@pytest.mark.parametrize("d", [2, 3])
def test_the_complement_depends_on_the_basis_and_counts_translations_twice(d: int) -> None:
    """With e∞ = e+ + e−, blade by blade in e+ and e−, (e1∧e∞)* ∧ (e1∧e∞) is 2 I instead of I."""
    null = cga(d)
    translation = blade(null, "e1i")
    assert wedge(null, complement(null, translation), translation) == pseudoscalar(null)
    orthonormal = diagonal("orthonormal", *(1 for _ in range(d + 1)), -1)
    translation = blade(orthonormal, f"e1{d + 1}") | blade(orthonormal, f"e1{d + 2}")
    twice = wedge(orthonormal, complement(orthonormal, translation), translation)
    assert twice == pseudoscalar(orthonormal, 2)


@pytest.mark.parametrize("algebra", PGA, ids=lambda a: a.name)
def test_a_momentum_moves_as_itself_not_as_the_complement_of_its_bivector(
    algebra: Algebra,
) -> None:
    """A force line through the origin, moved to x, gains the torque x × f; its complement none."""
    line = complement(algebra, blade(algebra, "e02"))
    translator = {0: 1} | blade(algebra, "e01", Fraction(-1, 2))
    expected = complement(algebra, blade(algebra, "e02"))
    add_scaled(expected, complement(algebra, blade(algebra, "e12")), 1)
    assert moved(algebra, translator, line) == expected
    assert complement(algebra, moved(algebra, translator, blade(algebra, "e02"))) == line


# ---------------------------------------------------------------- the product with I


@every_algebra
def test_the_product_with_the_pseudoscalar_is_equivariant_under_every_rotor(
    algebra: Algebra,
) -> None:
    random = Random(11)
    assert all(is_equivariant(algebra, times_pseudoscalar, g) for g in blades(algebra, 2))
    for _ in range(5):
        rotor = random_rotor(algebra, random)
        a = random_blades(algebra, 2, random)
        assert times_pseudoscalar(algebra, moved(algebra, rotor, a)) == moved(
            algebra, rotor, times_pseudoscalar(algebra, a)
        )


@pytest.mark.parametrize(
    ("algebra", "expected", "bivectors"),
    [(pga(2), 1, 3), (pga(3), 3, 6), (pga(4), 6, 10)],
    ids=["pga2", "pga3", "pga4"],
)
def test_the_product_with_the_pseudoscalar_loses_translations_in_pga(
    algebra: Algebra, expected: int, bivectors: int
) -> None:
    """I² = 0: the rank is 1, 3, 6 of 3, 6, 10; every e0∧ei goes to 0."""
    sources = blades(algebra, 2)
    assert len(sources) == bivectors
    images = [times_pseudoscalar(algebra, {b: 1}) for b in sources]
    assert rank(images, blades(algebra, algebra.dimension - 2)) == expected
    lost = [b for b, image in zip(sources, images, strict=True) if not image]
    assert lost == [b for b in sources if b & 1]


@pytest.mark.parametrize("algebra", [*CGA, *CLIFFORD], ids=lambda a: a.name)
def test_the_product_with_the_pseudoscalar_has_full_rank_without_null_directions(
    algebra: Algebra,
) -> None:
    images = [times_pseudoscalar(algebra, {b: 1}) for b in blades(algebra, 2)]
    assert rank(images, blades(algebra, algebra.dimension - 2)) == len(images)


@every_algebra
def test_the_product_with_the_pseudoscalar_pairs_by_the_metric(algebra: Algebra) -> None:
    """(A I) ∧ B = <A B>₀ I = −<A ~B>₀ I."""
    for a in blades(algebra, 2):
        image = times_pseudoscalar(algebra, {a: 1})
        for b in blades(algebra, 2):
            paired = wedge(algebra, image, {b: 1})
            metric = scalar_part(algebra.multiply({a: 1}, {b: 1}))
            assert paired == pseudoscalar(algebra, metric)
            assert metric == -scalar_part(algebra.multiply({a: 1}, reverse({b: 1})))


@pytest.mark.parametrize("algebra", CGA, ids=lambda a: a.name)
def test_the_metric_pairs_translations_with_inversions_in_cga(algebra: Algebra) -> None:
    """<b ~c>₀: ei∧e∞ with e0∧ei is 1, eij with itself 1, e0∧e∞ with itself −1; all others 0.

    So the kinetic energy of the flat A I, a multiple of <B ~B>₀, is 0 for translations.
    """
    d = algebra.dimension - 2
    pairs: dict[tuple[Blade, Blade], int] = {}

    def pair(first: str, second: str, value: int) -> None:
        ((b, x),) = blade(algebra, first).items()
        ((c, y),) = blade(algebra, second).items()
        pairs[b, c] = pairs[c, b] = int(value * x * y)

    for i in range(1, d + 1):
        pair(f"e{i}i", f"e0{i}", 1)
    for i, j in combinations(range(1, d + 1), 2):
        pair(f"e{i}{j}", f"e{i}{j}", 1)
    pair("e0i", "e0i", -1)
    for b in blades(algebra, 2):
        for c in blades(algebra, 2):
            metric = scalar_part(algebra.multiply({b: 1}, reverse({c: 1})))
            assert metric == pairs.get((b, c), 0), (algebra.blade_name(b), algebra.blade_name(c))


@pytest.mark.parametrize("algebra", [*CGA, *CLIFFORD], ids=lambda a: a.name)
def test_a_momentum_given_by_the_metric_is_minus_its_bivector_times_i(algebra: Algebra) -> None:
    """If μ(Z) = <m ~Z>₀ then μ = −m I as an (n-2)-vector, and ad* becomes [m, B] as well."""
    random = Random(4)
    m, z, rate = (random_blades(algebra, 2, random) for _ in range(3))
    flat = scaled(times_pseudoscalar(algebra, m), -1)
    metric = scalar_part(algebra.multiply(m, reverse(z)))
    assert wedge(algebra, flat, z) == pseudoscalar(algebra, metric)
    turned = scaled(times_pseudoscalar(algebra, bracket(algebra, m, rate)), -1)
    assert bracket(algebra, flat, rate) == turned


@pytest.mark.parametrize("algebra", [*CGA, *CLIFFORD], ids=lambda a: a.name)
def test_a_momentum_of_b_times_i_commutes_with_b(algebra: Algebra) -> None:
    """[B I, B] = 0: an "isotropic" inertia by A I has no p × Ω in its equations."""
    rate = random_blades(algebra, 2, Random(9))
    assert not bracket(algebra, times_pseudoscalar(algebra, rate), rate)


# ---------------------------------------------------------------- what stands for the coadjoint


@every_algebra
def test_the_coadjoint_action_on_flat_momenta_is_the_bracket(algebra: Algebra) -> None:
    """[μ, B] ∧ Z = μ ∧ [B, Z] for every Z, whatever the metric."""
    random = Random(2)
    momentum = random_blades(algebra, algebra.dimension - 2, random)
    rate = random_blades(algebra, 2, random)
    for z in blades(algebra, 2):
        assert wedge(algebra, bracket(algebra, momentum, rate), {z: 1}) == wedge(
            algebra, momentum, bracket(algebra, rate, {z: 1})
        )
