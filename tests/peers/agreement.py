"""The comparison: every kernel of an operation against a peer, on the same random operands."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np
import pytest
from tests.peers.conversation import Array, Peer
from tests.peers.frames import Frame
from tests.peers.our_kernels import (
    algebras_with,
    embedded,
    functions,
    random_components,
    read_off,
    spec,
)

from hamotor.codegen.algebra import Algebra, grade

TOLERANCE = 1e-13


@dataclass(frozen=True)
class Ask:
    """A peer with the basis it is asked in: `ask("Wedge", a, b)`."""

    peer: Peer
    frame: Frame

    def __call__(self, operation: str, *operands: Any) -> Array:
        """The peer's answer, in its own coefficients."""
        return self.peer.ask(self.frame.metric, operation, *operands)

    @property
    def orientation(self) -> float:
        """Our pseudoscalar as a multiple of the peer's."""
        return self.frame.orientation


Theirs = Callable[..., Array]
"""(ask, operands in the peer's basis) → what ought to be our result, in the peer's basis."""


def each(operation: str, *names: str) -> pytest.MarkDecorator:
    """Run for each bundled algebra (of these, if any are named) whose spec has the operation."""
    found = [a for a in algebras_with(operation) if not names or a in names]
    return pytest.mark.parametrize("algebra", found)


def assert_agree(
    peer: Peer,
    frame_of: Callable[[Algebra], Frame],
    algebra: str,
    operation: str,
    theirs: Theirs,
    *,
    samples: int = 4,
    tolerance: float = TOLERANCE,
) -> None:
    """Our kernels of an operation give what `theirs` gives, relative to its largest coefficient."""
    space = spec(algebra).algebra
    ask = Ask(peer, frame_of(space))
    compared = 0
    for function in functions(algebra):
        kernel = function.kernel
        if kernel.name != operation:
            continue
        types = " ".join(element.name for element in kernel.operands)
        random = Random(zlib.crc32(f"{algebra} {operation} {types}".encode()))
        for _ in range(samples):
            operands = [random_components(space, e, random) for e in kernel.operands]
            values = [
                ask.frame.theirs(embedded(e, x, space.dimension))
                for e, x in zip(kernel.operands, operands, strict=True)
            ]
            whole = ask.frame.ours(theirs(ask, *values))
            expected = read_off(function.result, whole)
            error = np.max(np.abs(function(*operands) - expected), initial=0.0)
            scale = np.max(np.abs(whole))
            assert error <= tolerance * scale, (
                f"{peer.name}: {algebra} {operation} {types}: {error / scale:.1e}\n"
                f"ours   {function(*operands)}\ntheirs {expected}"
            )
            compared += 1
    assert compared


def grades(value: Array) -> Array:
    """The grade of each coefficient's blade."""
    return np.array([grade(k) for k in range(len(value))])


def reflected(versor: Array, value: Array) -> Array:
    """(−1)^k on grade k where the versor is odd: what a reflection does besides m x ~m."""
    odd = np.any(versor[grades(versor) % 2 == 1])
    return np.where(odd & (grades(value) % 2 == 1), -value, value)
