"""kingdon agrees with the generated kernels.

It wants an orthogonal basis: PGA and plain signatures are taken as they are; in CGA
e0 = ½(e₋ − e₊), e∞ = e₊ + e₋.
"""

from __future__ import annotations

import numpy as np
import pytest
from tests.peers.agreement import Theirs, assert_agree, each
from tests.peers.conversation import Array, Peer
from tests.peers.frames import orthogonal_frame
from tests.peers.our_kernels import embedded, spec

pytestmark = pytest.mark.peers


def agrees(peer: Peer, algebra: str, operation: str, theirs: Theirs) -> None:
    assert_agree(peer, orthogonal_frame, algebra, operation, theirs)


@each("gp")
def test_geometric_product(kingdon: Peer, algebra: str) -> None:
    """`a * b` is a b."""
    agrees(kingdon, algebra, "gp", lambda ask, a, b: ask("gp", a, b))


@each("outer")
def test_outer_product(kingdon: Peer, algebra: str) -> None:
    """`a ^ b` is a ∧ b."""
    agrees(kingdon, algebra, "outer", lambda ask, a, b: ask("op", a, b))


@each("inner")
def test_inner_product(kingdon: Peer, algebra: str) -> None:
    """`a | b` is the part of grade |i − j|, scalars included, as our `inner`."""
    agrees(kingdon, algebra, "inner", lambda ask, a, b: ask("ip", a, b))


@each("left_contraction")
def test_left_contraction(kingdon: Peer, algebra: str) -> None:
    """`a.lc(b)` is a ⌋ b."""
    agrees(kingdon, algebra, "left_contraction", lambda ask, a, b: ask("lc", a, b))


@each("right_contraction")
def test_right_contraction(kingdon: Peer, algebra: str) -> None:
    """`a.rc(b)` is a ⌊ b."""
    agrees(kingdon, algebra, "right_contraction", lambda ask, a, b: ask("rc", a, b))


@each("regressive")
def test_regressive_product(kingdon: Peer, algebra: str) -> None:
    """`a & b` is a ∨ b, in our order.

    The product is made with a pseudoscalar; ours is `orientation` times theirs.
    """
    agrees(kingdon, algebra, "regressive", lambda ask, a, b: ask.orientation * ask("rp", a, b))


@each("commutator")
def test_commutator(kingdon: Peer, algebra: str) -> None:
    """`a.cp(b)` is ½(a b − b a)."""
    agrees(kingdon, algebra, "commutator", lambda ask, a, b: ask("cp", a, b))


@each("anticommutator")
def test_anticommutator(kingdon: Peer, algebra: str) -> None:
    """`a.acp(b)` is ½(a b + b a)."""
    agrees(kingdon, algebra, "anticommutator", lambda ask, a, b: ask("acp", a, b))


@each("reverse")
def test_reverse(kingdon: Peer, algebra: str) -> None:
    """`~a`."""
    agrees(kingdon, algebra, "reverse", lambda ask, a: ask("reverse", a))


@each("involute")
def test_main_involution(kingdon: Peer, algebra: str) -> None:
    """`a.involute()`."""
    agrees(kingdon, algebra, "involute", lambda ask, a: ask("involute", a))


@each("conjugate")
def test_clifford_conjugation(kingdon: Peer, algebra: str) -> None:
    """`a.conjugate()`."""
    agrees(kingdon, algebra, "conjugate", lambda ask, a: ask("conjugate", a))


@each("complement", "pga2", "pga3", "pga4", "cl3", "sta")
def test_complement(kingdon: Peer, algebra: str) -> None:
    """`a.hodge()` is the right complement, without a metric (Hodge's own dual has one).

    Not in CGA: the complement belongs to a basis, and the null basis is not theirs.
    """
    agrees(kingdon, algebra, "complement", lambda ask, a: ask("hodge", a))


@each("complement_inverse", "pga2", "pga3", "pga4", "cl3", "sta")
def test_inverse_complement(kingdon: Peer, algebra: str) -> None:
    """`a.unhodge()` undoes `a.hodge()`."""
    agrees(kingdon, algebra, "complement_inverse", lambda ask, a: ask("unhodge", a))


@each("polarity", "cga2", "cga3", "cl3", "sta")
def test_polarity(kingdon: Peer, algebra: str) -> None:
    """Our a I is `a.unpolarity()`; our I is `orientation` times theirs."""
    agrees(kingdon, algebra, "polarity", lambda ask, a: ask.orientation * ask("unpolarity", a))


@each("polarity_inverse", "cga2", "cga3", "cl3", "sta")
def test_inverse_polarity(kingdon: Peer, algebra: str) -> None:
    """Our a I⁻¹ is `a.polarity()`; our I⁻¹ is theirs divided by `orientation`."""
    agrees(
        kingdon,
        algebra,
        "polarity_inverse",
        lambda ask, a: ask("polarity", a) / ask.orientation,
    )


@each("sandwich")
def test_sandwich(kingdon: Peer, algebra: str) -> None:
    """`m >> x` is m x ~m for unit versors, with (−1)^k on grade k if m is odd, as ours."""
    agrees(kingdon, algebra, "sandwich", lambda ask, m, x: ask("sw", m, x))


@each("project")
def test_projection(kingdon: Peer, algebra: str) -> None:
    """`a @ b` is (a·b) ~b + a (1 − <b ~b>₀): the same for a unit b, the rest is taken off."""

    def projection(ask: Theirs, a: Array, b: Array) -> Array:
        squared = float(ask("gp", b, ask("reverse", b))[0])
        return ask("proj", a, b) - (1 - squared) * a

    agrees(kingdon, algebra, "project", projection)


@each("inverse", "pga2", "pga3", "cga2", "cl3", "sta")
def test_inverse(kingdon: Peer, algebra: str) -> None:
    """`a.inv()`; in five dimensions it takes minutes."""
    agrees(kingdon, algebra, "inverse", lambda ask, a: ask("inv", a))


@each("exp", "pga2", "cl3")
def test_exponential_of_simple_bivectors(kingdon: Peer, algebra: str) -> None:
    """`b.exp()`: only where every bivector squares to a number, in three dimensions."""
    agrees(kingdon, algebra, "exp", lambda ask, b: ask("exp", b))


@each("complement", "pga2", "pga3")
def test_points_are_duals_of_vectors(kingdon: Peer, algebra: str) -> None:
    """`alg.upoint(e1=x, …).dual()` in `2DPGA` and `3DPGA` is our Point of coordinates x, …."""
    found = spec(algebra)
    x = np.random.default_rng(3).uniform(-1, 1, found.algebra.dimension - 1)
    theirs = kingdon.ask(orthogonal_frame(found.algebra).metric, "upoint", *x)
    np.testing.assert_array_equal(
        theirs, embedded(found.elements["Point"], x, found.algebra.dimension)
    )
