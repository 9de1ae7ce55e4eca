"""Lie groups of rotors: closure, Jacobi, dual bases; rates and momenta as mechanics has them."""

from __future__ import annotations

import re
from fractions import Fraction
from itertools import product
from random import Random

import numpy
import pytest

from hamotor.codegen.algebra import Algebra
from hamotor.codegen.casimir import Casimir, derivative, parse_polynomial, value
from hamotor.codegen.group import LieGroup
from hamotor.codegen.library import group_kernels
from hamotor.codegen.program import Program
from hamotor.codegen.spec import (
    AlgebraSpec,
    bundled_algebras,
    bundled_group,
    bundled_path,
    read_algebra,
)
from hamotor.errors import UsageError

SPECS = {name: read_algebra(bundled_path(name)) for name in bundled_algebras()}
GROUPS = [(name, group) for name, spec in SPECS.items() for group in spec.groups]
IDS = [f"{name} {group.name}" for name, group in GROUPS]

Matrix = numpy.ndarray[tuple[int, ...], numpy.dtype[numpy.float64]]


def program(spec: AlgebraSpec, group: LieGroup, name: str) -> Program:
    return next(k.program for k in group_kernels(spec, group) if k.name == name)


def evaluate(code: Program, *operands: Matrix) -> Matrix:
    """A program on numbers, in its components' order."""
    values = {
        f"{p.name}.{c.name}": float(x)
        for p, numbers in zip(code.parameters, operands, strict=True)
        for c, x in zip(p.element.components, numbers, strict=True)
    }
    return numpy.array(list(code.evaluate(values, {"number": float}).values()), dtype=float)


@pytest.mark.parametrize(("algebra", "group"), GROUPS, ids=IDS)
def test_structure_constants_are_antisymmetric_and_satisfy_jacobi(
    algebra: str, group: LieGroup
) -> None:
    assert algebra
    c = group.structure
    size = range(len(group.generators))
    for a, b in product(size, size):
        assert all(c[a][b][k] == -c[b][a][k] for k in size)
    for a, b, d, e in product(size, size, size, size):
        cyclic = [(a, b, d), (b, d, a), (d, a, b)]
        assert not sum(c[x][y][k] * c[k][z][e] for x, y, z in cyclic for k in size)


@pytest.mark.parametrize(("algebra", "group"), GROUPS, ids=IDS)
def test_structure_constants_are_the_brackets_of_the_generators(
    algebra: str, group: LieGroup
) -> None:
    space = SPECS[algebra].algebra
    for a, left in enumerate(group.generators):
        for b, right in enumerate(group.generators):
            rest = space.multiply(left.bivector, right.bivector)
            for blade, x in space.multiply(right.bivector, left.bivector).items():
                rest[blade] = rest.get(blade, 0) - x
            for x, generator in zip(group.structure[a][b], group.generators, strict=True):
                for blade, y in generator.bivector.items():
                    rest[blade] = rest.get(blade, 0) - x * y
            assert not any(rest.values())


@pytest.mark.parametrize(("algebra", "group"), GROUPS, ids=IDS)
def test_dual_basis_pairs_to_the_identity(algebra: str, group: LieGroup) -> None:
    space = SPECS[algebra].algebra
    for a, t in enumerate(group.momentum.components):
        for b, generator in enumerate(group.generators):
            wedge = sum(
                (
                    x * y * space.outer(p, q).get(space.pseudoscalar, 0)
                    for p, x in t.embedding.items()
                    for q, y in generator.bivector.items()
                ),
                Fraction(0),
            )
            assert wedge == int(a == b)


def test_coadjoint_is_the_classical_formula_in_space() -> None:
    """ad*_(ξ,u)(Π, P) = (Π × ξ + P × u, P × ξ), theory.md §3."""
    spec = SPECS["pga3"]
    code = program(spec, spec.groups[0], "coadjoint")
    dice = numpy.random.default_rng(3)
    for _ in range(20):
        xi, u, angular, linear = dice.standard_normal((4, 3))
        found = evaluate(code, numpy.r_[xi, u], numpy.r_[angular, linear])
        expected = numpy.r_[
            numpy.cross(angular, xi) + numpy.cross(linear, u), numpy.cross(linear, xi)
        ]
        numpy.testing.assert_allclose(found, expected, atol=1e-14)


def test_bracket_of_rates_is_the_commutator_of_rigid_velocities() -> None:
    """[(ξ, u), (η, v)] as 4×4 matrices of x ↦ ξ × x + u: the bracket of SE(3)."""
    spec = SPECS["pga3"]
    code = program(spec, spec.groups[0], "ad")
    dice = numpy.random.default_rng(4)

    def matrix(rate: Matrix) -> Matrix:
        (x, y, z), u = rate[:3], rate[3:]
        result = numpy.zeros((4, 4))
        result[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        result[:3, 3] = u
        return result

    for _ in range(20):
        a, b = dice.standard_normal((2, 6))
        expected = matrix(a) @ matrix(b) - matrix(b) @ matrix(a)
        numpy.testing.assert_allclose(matrix(evaluate(code, a, b)), expected, atol=1e-13)


def test_the_bracket_and_coadjoint_of_the_plane_are_the_classical_ones() -> None:
    """se(2) as 3 × 3 matrices of x ↦ ω Jx + u, and its transpose."""
    spec = SPECS["pga2"]
    ad = program(spec, spec.groups[0], "ad")
    coadjoint = program(spec, spec.groups[0], "coadjoint")
    dice = numpy.random.default_rng(5)

    def matrix(rate: Matrix) -> Matrix:
        w, x, y = rate
        return numpy.array([[0, -w, x], [w, 0, y], [0, 0, 0]])

    for _ in range(20):
        a, b, mu = dice.standard_normal((3, 3))
        bracket = evaluate(ad, a, b)
        expected = matrix(a) @ matrix(b) - matrix(b) @ matrix(a)
        numpy.testing.assert_allclose(matrix(bracket), expected, atol=1e-14)
        assert evaluate(coadjoint, a, mu) @ b == pytest.approx(mu @ bracket, abs=1e-14)


def rational_versor(space: Algebra, group: LieGroup, dice: Random) -> dict[str, Fraction]:
    """A product of three exact group elements, by the names that programs read."""
    components = group.element.components
    blades = {b: (c.name, s) for c in components for b, s in c.embedding.items()}
    versor = {0: Fraction(1)}
    for _ in range(3):  # products of 1 + b with b² = 0 or a rational rotation
        generator = dice.choice(group.generators).bivector
        square = space.multiply(generator, generator).get(0, 0)
        t = Fraction(dice.randint(1, 4), dice.randint(5, 9))  # below 1: no boost is infinite
        scale = 1 - t * t * square
        factor = {0: Fraction(1 + t * t * square) / scale} | {
            b: 2 * t * x / scale for b, x in generator.items()
        }
        versor = {b: Fraction(x) for b, x in space.multiply(versor, factor).items()}
    symbol = group.element.symbol
    m = {f"{symbol}.{c.name}": Fraction(0) for c in components}
    return m | {f"{symbol}.{blades[b][0]}": x * blades[b][1] for b, x in versor.items()}


@pytest.mark.parametrize(("algebra", "group"), GROUPS, ids=IDS)
def test_pairing_is_invariant_under_the_group(algebra: str, group: LieGroup) -> None:
    """(Ad_star_inverse μ)(Ad w) = μ(w), exactly, for rational versors."""
    spec = SPECS[algebra]
    kernels = {k.name: k.program for k in group_kernels(spec, group)}
    ad, star = kernels["Ad"], kernels["Ad_star_inverse"]
    dice = Random(6)
    for _ in range(5):
        m = rational_versor(spec.algebra, group, dice)
        for _ in range(3):
            w = [Fraction(dice.randint(-9, 9)) for _ in group.generators]
            mu = [Fraction(dice.randint(-9, 9)) for _ in group.generators]
            number = {"number": Fraction}
            rates = {f"w.{g.rate}": x for g, x in zip(group.generators, w, strict=True)}
            momenta = {f"mu.{g.momentum}": x for g, x in zip(group.generators, mu, strict=True)}
            moved = list(ad.evaluate(m | rates, number).values())
            seen = list(star.evaluate(m | momenta, number).values())
            assert sum(x * y for x, y in zip(moved, seen, strict=True)) == sum(
                x * y for x, y in zip(w, mu, strict=True)
            )


def random_momentum(group: LieGroup, dice: Random) -> dict[str, Fraction]:
    return {g.momentum: Fraction(dice.randint(1, 9), dice.randint(1, 5)) for g in group.generators}


def rank(rows: list[list[Fraction]]) -> int:
    rows = [list(row) for row in rows]
    found = 0
    for column in range(len(rows[0]) if rows else 0):
        pivot = next((row for row in rows[found:] if row[column]), None)
        if pivot is None:
            continue
        rows.remove(pivot)
        rows.insert(found, pivot)
        found += 1
        for row in rows[found:]:
            factor = row[column] / pivot[column]
            row[:] = [x - factor * y for x, y in zip(row, pivot, strict=True)]
    return found


@pytest.mark.parametrize(("algebra", "group"), GROUPS, ids=IDS)
def test_casimirs_are_constant_on_coadjoint_orbits(algebra: str, group: LieGroup) -> None:
    """C(M μ ~M) = C(μ), exactly, for rational M: without the structure constants."""
    spec = SPECS[algebra]
    star = program(spec, group, "Ad_star_inverse")
    dice = Random(7)
    for _ in range(5):
        m = rational_versor(spec.algebra, group, dice)
        mu = random_momentum(group, dice)
        moved = star.evaluate(m | {f"mu.{k}": x for k, x in mu.items()}, {"number": Fraction})
        for casimir in group.casimirs:
            assert value(casimir, mu) == value(casimir, moved) != 0


@pytest.mark.parametrize(("algebra", "group"), GROUPS, ids=IDS)
def test_every_group_lists_all_its_casimirs(algebra: str, group: LieGroup) -> None:
    """As many independent ones as the Poisson tensor c_ab^k μ_k has null directions."""
    assert algebra
    mu = random_momentum(group, Random(8))
    size = range(len(group.generators))
    momenta = [mu[g.momentum] for g in group.generators]
    poisson = [
        [
            sum((c * x for c, x in zip(group.structure[a][b], momenta, strict=True)), Fraction(0))
            for b in size
        ]
        for a in size
    ]
    index = len(group.generators) - rank(poisson)
    assert len(group.casimirs) == index
    gradients = []
    for casimir in group.casimirs:
        d = value(Casimir("", "", casimir.denominator, {(): 1}), mu)
        n = value(Casimir("", "", casimir.numerator, {(): 1}), mu)
        row = []
        for g in group.generators:
            dn, dd = (
                value(Casimir("", "", derivative(p, g.momentum), {(): 1}), mu)
                for p in (casimir.numerator, casimir.denominator)
            )
            row.append(dn * d - n * dd)
        gradients.append(row)
    assert rank(gradients) == index


def test_units_of_rates_and_momenta_follow_from_the_lengths() -> None:
    group = bundled_group("cga3", "SO41")
    rates = dict(zip([g.rate for g in group.generators], group.rate_units, strict=True))
    momenta = dict(zip([g.momentum for g in group.generators], group.momentum_units, strict=True))
    assert [rates[k] for k in ("w23", "v1", "d", "u1")] == ["rad/s", "m/s", "1/s", "1/(m s)"]
    assert [momenta[k] for k in ("l23", "p1", "q", "k1")] == [
        "kg m^2/s",
        "kg m/s",
        "kg m^2/s",
        "kg m^3/s",
    ]
    assert {c.name: c.unit for c in group.casimirs} == {
        "quadratic": "kg^2 m^4/s^2",
        "quartic": "kg^4 m^8/s^4",
    }
    motor = bundled_group("pga3", "SE3")
    names = [c.name for c in motor.element.components]
    lengths = {n for n, u in zip(names, motor.element_units, strict=True) if u == "m"}
    assert lengths == {"e01", "e02", "e03", "e0123"}


def test_an_unknown_group_is_named_with_what_there_is() -> None:
    with pytest.raises(UsageError, match=r'unknown group "SE".*SE3, SO3, T3.*Did you mean "SE3"'):
        bundled_group("pga3", "SE")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("l1 *", "ends too early"),
        ("(l1", "a bracket is not closed"),
        ("l1 l2", '"l2" is out of place'),
        ("l3", '"l3" is not one of l1, l2'),
        ("l1^99", '"99" is not a power from 1 to 8'),
        ("l1 / l2", '"/" is not part of a polynomial'),
        ("l1 + " * 500 + "l1", "longer than 2000 characters"),
        ("(" * 1990, "has more than 20 brackets in one another"),
        ("((l1+l2+1)^8)^8", "has more than 1000 terms"),
    ],
)
def test_a_polynomial_that_cannot_be_read_says_why(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        parse_polynomial(text, ["l1", "l2"])


def test_a_polynomial_reads_as_it_is_written() -> None:
    assert parse_polynomial("-(l1 - 2*l2)^2 + 3", ["l1", "l2"]) == {
        ("l1", "l1"): -1,
        ("l1", "l2"): 4,
        ("l2", "l2"): -4,
        (): 3,
    }
