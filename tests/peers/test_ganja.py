"""ganja.js agrees with the generated kernels.

It wants an orthogonal basis, null vectors first: PGA and plain signatures are taken as they are; in
CGA e0 = ½(e₋ − e₊), e∞ = e₊ + e₋.  Its numbers are made double (`baseType`), as they are float.
"""

from __future__ import annotations

import numpy as np
import pytest
from tests.peers.agreement import Theirs, assert_agree, each, reflected
from tests.peers.conversation import Array, Peer
from tests.peers.frames import orthogonal_frame
from tests.peers.our_kernels import embedded, spec

pytestmark = pytest.mark.peers


def agrees(
    peer: Peer, algebra: str, operation: str, theirs: Theirs, tolerance: float = 1e-13
) -> None:
    assert_agree(peer, orthogonal_frame, algebra, operation, theirs, tolerance=tolerance)


@each("gp")
def test_geometric_product(ganja: Peer, algebra: str) -> None:
    """`a * b` is a b."""
    agrees(ganja, algebra, "gp", lambda ask, a, b: ask("Mul", a, b))


@each("outer")
def test_outer_product(ganja: Peer, algebra: str) -> None:
    """`a ^ b` is a ∧ b."""
    agrees(ganja, algebra, "outer", lambda ask, a, b: ask("Wedge", a, b))


@each("inner")
def test_inner_product(ganja: Peer, algebra: str) -> None:
    """`a | b` is the part of grade |i − j|, scalars included, as our `inner`."""
    agrees(ganja, algebra, "inner", lambda ask, a, b: ask("Dot", a, b))


@each("left_contraction")
def test_left_contraction(ganja: Peer, algebra: str) -> None:
    """`a << b` is a ⌋ b."""
    agrees(ganja, algebra, "left_contraction", lambda ask, a, b: ask("LDot", a, b))


@each("regressive")
def test_regressive_product(ganja: Peer, algebra: str) -> None:
    """`b & a` is a ∨ b: the operands change places.

    The product is made with a pseudoscalar; ours is `orientation` times theirs.
    """
    agrees(ganja, algebra, "regressive", lambda ask, a, b: ask.orientation * ask("Vee", b, a))


@each("commutator")
def test_commutator(ganja: Peer, algebra: str) -> None:
    """It has none: a × b = ½(`a * b` − `b * a`)."""
    agrees(
        ganja,
        algebra,
        "commutator",
        lambda ask, a, b: 0.5 * (ask("Mul", a, b) - ask("Mul", b, a)),
    )


@each("reverse")
def test_reverse(ganja: Peer, algebra: str) -> None:
    """Ours is `.Reverse`; its `~a` is Clifford conjugation."""
    agrees(ganja, algebra, "reverse", lambda ask, a: ask("Reverse", a))


@each("involute")
def test_main_involution(ganja: Peer, algebra: str) -> None:
    """`.Involute`."""
    agrees(ganja, algebra, "involute", lambda ask, a: ask("Involute", a))


@each("conjugate")
def test_clifford_conjugation(ganja: Peer, algebra: str) -> None:
    """`.Conjugate`, which is its `~a`."""
    agrees(ganja, algebra, "conjugate", lambda ask, a: ask("Conjugate", a))


@each("complement", "pga2", "pga3", "pga4")
def test_complement_in_pga(ganja: Peer, algebra: str) -> None:
    """`!a` is the right complement where there is a null basis vector (r > 0)."""
    agrees(ganja, algebra, "complement", lambda ask, a: ask("Dual", a))


@each("complement_inverse", "pga2", "pga3", "pga4")
def test_inverse_complement_in_pga(ganja: Peer, algebra: str) -> None:
    """`.UnDual` undoes `!a`."""
    agrees(ganja, algebra, "complement_inverse", lambda ask, a: ask("UnDual", a))


@each("gp", "cga2", "cga3", "cl3", "sta")
def test_dual_without_null_basis_vectors(ganja: Peer, algebra: str) -> None:
    """`!a` is a I where r = 0, not the complement; I is `orientation` times theirs, I² = ±1."""
    space = spec(algebra).algebra
    frame = orthogonal_frame(space)
    a = np.random.default_rng(5).uniform(-1, 1, 1 << space.dimension)
    pseudoscalar = np.zeros_like(a)
    pseudoscalar[-1] = 1
    theirs = ganja.ask(frame.metric, "Dual", frame.theirs(a))
    expected = np.zeros_like(a)
    for blade, x in enumerate(a):
        for c, y in space.geometric(blade, space.pseudoscalar).items():
            expected[c] += float(y) * x
    np.testing.assert_allclose(frame.ours(theirs) * frame.orientation, expected, atol=1e-13)


@each("polarity", "cga2", "cga3", "cl3", "sta")
def test_polarity(ganja: Peer, algebra: str) -> None:
    """`!a` is a I where r = 0; our I is `orientation` times theirs."""
    agrees(ganja, algebra, "polarity", lambda ask, a: ask.orientation * ask("Dual", a))


@each("sandwich")
def test_sandwich(ganja: Peer, algebra: str) -> None:
    """`m >>> x` is m x ~m; a reflection in an odd m has (−1)^k on grade k besides."""
    agrees(ganja, algebra, "sandwich", lambda ask, m, x: reflected(m, ask("sw", m, x)))


@each("inverse")
def test_inverse(ganja: Peer, algebra: str) -> None:
    """`.Inverse`."""
    agrees(ganja, algebra, "inverse", lambda ask, a: ask("Inverse", a))


@each("exp")
def test_exponential(ganja: Peer, algebra: str) -> None:
    """`.Exp()` of a bivector.

    It splits the bivector by square roots of differences, and loses digits in pga4 where our result
    agrees with thirty digits.
    """
    tolerance = 1e-12 if algebra == "pga4" else 1e-13
    agrees(ganja, algebra, "exp", lambda ask, b: ask("exp", b), tolerance)


@each("log")
def test_logarithm(ganja: Peer, algebra: str) -> None:
    """`.Log()` of a motor with a positive scalar part: there both are principal."""
    agrees(ganja, algebra, "log", lambda ask, m: ask("Log", m))


@each("complement", "pga2", "pga3")
def test_points_are_duals_of_vectors(ganja: Peer, algebra: str) -> None:
    """`!(1e0 + x 1e1 + y 1e2 + …)` is our Point of coordinates x, y, …."""
    found = spec(algebra)
    x = np.random.default_rng(3).uniform(-1, 1, found.algebra.dimension - 1)
    theirs = ganja.ask(orthogonal_frame(found.algebra).metric, "Dual", projective_vector(x))
    ours = embedded(found.elements["Point"], x, found.algebra.dimension)
    np.testing.assert_array_equal(theirs, ours)


def projective_vector(x: Array) -> Array:
    """e0 + x."""
    value = np.zeros(2 << len(x))
    value[1] = 1
    for i, xi in enumerate(x, 1):
        value[1 << i] = xi
    return value
