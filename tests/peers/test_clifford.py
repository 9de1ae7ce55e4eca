"""clifford agrees with the generated kernels.

It wants an orthogonal basis: PGA and plain signatures are taken as they are; in CGA
e0 = ½(e₋ − e₊), e∞ = e₊ + e₋, which are its `eo` and `einf`.
"""

from __future__ import annotations

import numpy as np
import pytest
from tests.peers.agreement import Theirs, assert_agree, each, reflected
from tests.peers.conversation import Array, Peer
from tests.peers.frames import Frame, orthogonal_frame
from tests.peers.our_kernels import embedded, functions, spec

from hamotor.codegen import bundled_algebras

pytestmark = pytest.mark.peers


def agrees(peer: Peer, algebra: str, operation: str, theirs: Theirs) -> None:
    assert_agree(peer, orthogonal_frame, algebra, operation, theirs)


@each("gp")
def test_geometric_product(clifford: Peer, algebra: str) -> None:
    """`a * b` is a b."""
    agrees(clifford, algebra, "gp", lambda ask, a, b: ask("*", a, b))


@each("outer")
def test_outer_product(clifford: Peer, algebra: str) -> None:
    """`a ^ b` is a ∧ b."""
    agrees(clifford, algebra, "outer", lambda ask, a, b: ask("^", a, b))


@each("inner")
def test_inner_product(clifford: Peer, algebra: str) -> None:
    """`a | b` is Hestenes' inner product: our `inner`, but 0 where an operand is a number.

    No kernel of ours has a number for an operand.
    """
    agrees(clifford, algebra, "inner", lambda ask, a, b: ask("|", a, b))


@each("left_contraction")
def test_left_contraction(clifford: Peer, algebra: str) -> None:
    """`a.lc(b)` is a ⌋ b."""
    agrees(clifford, algebra, "left_contraction", lambda ask, a, b: ask("lc", a, b))


@each("regressive")
def test_regressive_product(clifford: Peer, algebra: str) -> None:
    """`a & b`, `a.vee(b)`, is a ∨ b, in our order.

    The product is made with a pseudoscalar; ours is `orientation` times theirs.
    """
    agrees(clifford, algebra, "regressive", lambda ask, a, b: ask.orientation * ask("&", a, b))


@each("commutator")
def test_commutator(clifford: Peer, algebra: str) -> None:
    """`a.commutator(b)`, `a.x(b)`, is ½(a b − b a)."""
    agrees(clifford, algebra, "commutator", lambda ask, a, b: ask("commutator", a, b))


@each("anticommutator")
def test_anticommutator(clifford: Peer, algebra: str) -> None:
    """`a.anticommutator(b)` is ½(a b + b a)."""
    agrees(clifford, algebra, "anticommutator", lambda ask, a, b: ask("anticommutator", a, b))


@each("reverse")
def test_reverse(clifford: Peer, algebra: str) -> None:
    """`~a`."""
    agrees(clifford, algebra, "reverse", lambda ask, a: ask("~", a))


@each("involute")
def test_main_involution(clifford: Peer, algebra: str) -> None:
    """`a.gradeInvol()`."""
    agrees(clifford, algebra, "involute", lambda ask, a: ask("gradeInvol", a))


@each("conjugate")
def test_clifford_conjugation(clifford: Peer, algebra: str) -> None:
    """`a.conjugate()`."""
    agrees(clifford, algebra, "conjugate", lambda ask, a: ask("conjugate", a))


@each("complement", "pga2", "pga3", "pga4", "cl3", "sta")
def test_complement(clifford: Peer, algebra: str) -> None:
    """`a.right_complement()`, in any metric.

    Not in CGA: the complement belongs to a basis, and the null basis is not theirs.
    """
    agrees(clifford, algebra, "complement", lambda ask, a: ask("right_complement", a))


@each("complement_inverse", "pga2", "pga3", "pga4", "cl3", "sta")
def test_inverse_complement(clifford: Peer, algebra: str) -> None:
    """`a.left_complement()`."""
    agrees(clifford, algebra, "complement_inverse", lambda ask, a: ask("left_complement", a))


@each("complement", "pga2", "pga3", "pga4")
def test_dual_in_pga(clifford: Peer, algebra: str) -> None:
    """`a.dual()` is the right complement where the metric is degenerate."""
    agrees(clifford, algebra, "complement", lambda ask, a: ask("dual", a))


@each("polarity_inverse", "cga2", "cga3", "cl3", "sta")
def test_inverse_polarity(clifford: Peer, algebra: str) -> None:
    """Our a I⁻¹ is `a.dual()` elsewhere; our I⁻¹ is theirs divided by `orientation`."""
    agrees(clifford, algebra, "polarity_inverse", lambda ask, a: ask("dual", a) / ask.orientation)


@each("sandwich")
def test_sandwich(clifford: Peer, algebra: str) -> None:
    """`m * x * ~m`; a reflection in an odd m has (−1)^k on grade k besides."""
    agrees(
        clifford,
        algebra,
        "sandwich",
        lambda ask, m, x: reflected(m, ask("*", ask("*", m, x), ask("~", m))),
    )


@each("inverse")
def test_inverse(clifford: Peer, algebra: str) -> None:
    """`a.leftLaInv()`, by linear algebra."""
    agrees(clifford, algebra, "inverse", lambda ask, a: ask("leftLaInv", a))


@each("exp")
def test_exponential(clifford: Peer, algebra: str) -> None:
    """`b.exp()`, at most fourteen terms of the series: enough for b/16, then squared four times.

    Terms below `clifford.eps` are left out: 1e-12, set to 1e-20 for this.
    """

    def exponential(ask: Theirs, b: Array) -> Array:
        result = ask("exp", b / 16)
        for _ in range(4):
            result = ask("*", result, result)
        return result

    agrees(clifford, algebra, "exp", exponential)


# ---------------------------------------------------------------- what stands in clifford.g3c

conformal = pytest.mark.skipif("cga3" not in bundled_algebras(), reason="cga3 is not bundled")


def frame_of_g3c() -> Frame:
    """Conformal space in the basis of `clifford.g3c`: e1, e2, e3, e₊, e₋."""
    return orthogonal_frame(spec("cga3").algebra)


def g3c(peer: Peer, operation: str, *operands: Array | float) -> Array:
    """A function of clifford's conformal space, its result in our basis."""
    frame = frame_of_g3c()
    return frame.ours(peer.ask(frame.metric, operation, *operands))


def euclidean(*x: float) -> Array:
    """The vector x in clifford's basis."""
    value = np.zeros(32)
    value[[1, 2, 4]] = x
    return value


def ours(element: str, *components: float) -> Array:
    """One of our elements of cga3."""
    return embedded(spec("cga3").elements[element], np.array(components), 5)


def our_exponential(line: Array) -> Array:
    """Our exp of a Line of cga3."""
    (exp,) = (
        f
        for f in functions("cga3")
        if f.kernel.name == "exp" and f.kernel.operands[0].name == "Line"
    )
    return ours("Motor", *exp(line))


@conformal
def test_conformal_points(clifford: Peer) -> None:
    """`up(x)` = eo + x + ½ x² einf is our Point of x, with e0 = eo and e∞ = einf."""
    x = np.array([0.3, -0.7, 1.9])
    expected = ours("Point", *x, 0.5 * x @ x)
    np.testing.assert_allclose(g3c(clifford, "up", euclidean(*x)), expected, atol=1e-15)


@conformal
def test_conformal_translators(clifford: Peer) -> None:
    """`generate_translation_rotor(t)` = 1 + ½ einf t is our exp(−½ t∧e∞)."""
    t = np.array([0.4, 1.1, -0.6])
    theirs = g3c(clifford, "g3c.generate_translation_rotor", euclidean(*t))
    np.testing.assert_allclose(theirs, our_exponential(np.array([0, 0, 0, *(-t / 2)])), atol=1e-15)


@conformal
def test_conformal_rotors(clifford: Peer) -> None:
    """`generate_rotation_rotor(θ, u, v)` is our exp(−½ θ u∧v) for orthogonal unit vectors."""
    theirs = g3c(
        clifford,
        "g3c.generate_rotation_rotor",
        0.9,
        euclidean(0.6, 0.8, 0),
        euclidean(0, 0, 1),
    )
    # u∧v = 0.8 e23 − 0.6 e31
    line = -0.45 * np.array([0.8, -0.6, 0, 0, 0, 0])
    np.testing.assert_allclose(theirs, our_exponential(line), atol=1e-15)


@conformal
def test_conformal_dilators(clifford: Peer) -> None:
    """`generate_dilation_rotor(s)`, by s, is our exp(½ log s e0∧e∞).

    It writes einf∧no for e0∧e∞: its `no` is −eo.
    """
    half = np.log(2.5) / 2
    theirs = g3c(clifford, "g3c.generate_dilation_rotor", 2.5)
    expected = ours("Dilator", np.cosh(half), np.sinh(half))
    np.testing.assert_allclose(theirs, expected, atol=1e-15)
