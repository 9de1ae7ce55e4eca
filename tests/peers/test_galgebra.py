"""GAlgebra agrees with the generated kernels.

It takes any Gram matrix, so that our basis, null vectors included, is its basis; and it is
symbolic: our numbers are its rationals, its products are exact, and slow: one sample a kernel.
"""

from __future__ import annotations

import pytest
from tests.peers.agreement import Theirs, assert_agree, each, reflected
from tests.peers.conversation import Peer
from tests.peers.frames import same_frame

pytestmark = pytest.mark.peers


def agrees(peer: Peer, algebra: str, operation: str, theirs: Theirs) -> None:
    assert_agree(peer, same_frame, algebra, operation, theirs, samples=1)


@each("gp")
def test_geometric_product(galgebra: Peer, algebra: str) -> None:
    """`a * b` is a b."""
    agrees(galgebra, algebra, "gp", lambda ask, a, b: ask("*", a, b))


@each("outer")
def test_outer_product(galgebra: Peer, algebra: str) -> None:
    """`a ^ b` is a ∧ b."""
    agrees(galgebra, algebra, "outer", lambda ask, a, b: ask("^", a, b))


@each("inner")
def test_inner_product(galgebra: Peer, algebra: str) -> None:
    """`a | b` is Hestenes' inner product: our `inner`, but 0 where an operand is a number.

    No kernel of ours has a number for an operand.
    """
    agrees(galgebra, algebra, "inner", lambda ask, a, b: ask("|", a, b))


@each("left_contraction")
def test_left_contraction(galgebra: Peer, algebra: str) -> None:
    """`a < b` is a ⌋ b."""
    agrees(galgebra, algebra, "left_contraction", lambda ask, a, b: ask("<", a, b))


@each("right_contraction")
def test_right_contraction(galgebra: Peer, algebra: str) -> None:
    """`a > b` is a ⌊ b."""
    agrees(galgebra, algebra, "right_contraction", lambda ask, a, b: ask(">", a, b))


@each("commutator")
def test_commutator(galgebra: Peer, algebra: str) -> None:
    """`a >> b` is ½(a b − b a)."""
    agrees(galgebra, algebra, "commutator", lambda ask, a, b: ask(">>", a, b))


@each("anticommutator")
def test_anticommutator(galgebra: Peer, algebra: str) -> None:
    """`a << b` is ½(a b + b a)."""
    agrees(galgebra, algebra, "anticommutator", lambda ask, a, b: ask("<<", a, b))


@each("reverse")
def test_reverse(galgebra: Peer, algebra: str) -> None:
    """`a.rev()`."""
    agrees(galgebra, algebra, "reverse", lambda ask, a: ask("rev", a))


@each("involute")
def test_main_involution(galgebra: Peer, algebra: str) -> None:
    """`a.g_invol()`."""
    agrees(galgebra, algebra, "involute", lambda ask, a: ask("g_invol", a))


@each("conjugate")
def test_clifford_conjugation(galgebra: Peer, algebra: str) -> None:
    """`a.ccon()`."""
    agrees(galgebra, algebra, "conjugate", lambda ask, a: ask("ccon", a))


@each("polarity", "cga2", "cga3", "cl3", "sta")
def test_polarity(galgebra: Peer, algebra: str) -> None:
    """`a.dual()` in its default mode `I+` is a I, with I normalised to I² = ±1, as ours is."""
    agrees(galgebra, algebra, "polarity", lambda ask, a: ask("dual", a))


@each("sandwich")
def test_sandwich(galgebra: Peer, algebra: str) -> None:
    """`m * x * m.rev()`; a reflection in an odd m has (−1)^k on grade k besides."""
    agrees(galgebra, algebra, "sandwich", lambda ask, m, x: reflected(m, ask("sandwich", m, x)))


@each("exp", "pga2", "cl3")
def test_exponential_of_simple_bivectors(galgebra: Peer, algebra: str) -> None:
    """`b.exp()`: only where every bivector squares to a number, in three dimensions."""
    agrees(galgebra, algebra, "exp", lambda ask, b: ask("exp", b))
