"""Lie groups of rotors: closure, Jacobi, dual bases; rates and momenta as mechanics has them."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from random import Random

import numpy
import pytest

from hamotor.codegen.group import LieGroup
from hamotor.codegen.library import group_kernels
from hamotor.codegen.program import Program
from hamotor.codegen.spec import AlgebraSpec, bundled_algebras, bundled_path, read_algebra

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


@pytest.mark.parametrize(("algebra", "group"), GROUPS, ids=IDS)
def test_pairing_is_invariant_under_the_group(algebra: str, group: LieGroup) -> None:
    """(Ad_star_inverse μ)(Ad w) = μ(w), exactly, for rational versors."""
    spec = SPECS[algebra]
    kernels = {k.name: k.program for k in group_kernels(spec, group)}
    ad, star = kernels["Ad"], kernels["Ad_star_inverse"]
    dice = Random(6)
    components = group.element.components
    blades = {b: (c.name, s) for c in components for b, s in c.embedding.items()}
    for _ in range(5):
        versor = {0: Fraction(1)}
        for _ in range(3):  # products of 1 + b with b² = 0 or a rational rotation
            generator = dice.choice(group.generators).bivector
            square = spec.algebra.multiply(generator, generator).get(0, 0)
            t = Fraction(dice.randint(1, 4), dice.randint(5, 9))  # below 1: no boost is infinite
            scale = 1 - t * t * square
            factor = {0: Fraction(1 + t * t * square) / scale} | {
                b: 2 * t * x / scale for b, x in generator.items()
            }
            versor = {b: Fraction(x) for b, x in spec.algebra.multiply(versor, factor).items()}
        symbol = group.element.symbol
        m = {f"{symbol}.{c.name}": Fraction(0) for c in components}
        m |= {f"{symbol}.{blades[b][0]}": x * blades[b][1] for b, x in versor.items()}
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
