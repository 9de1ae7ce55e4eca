"""Answers by kingdon, whose methods are named as they are there."""

from __future__ import annotations

from functools import cache
from typing import Any

import kingdon  # type: ignore[import-not-found]
from tests.peers.answering import Metric, serve


@cache
def algebra(metric: Metric) -> Any:
    """Its basis blades are the bits of their keys, as ours."""
    return kingdon.Algebra(signature=[int(row[i]) for i, row in enumerate(metric)])


@cache
def named(name: str) -> Any:
    """An algebra with names of its own, as `3DPGA`."""
    return kingdon.Algebra.fromname(name)


def answer(metric: Metric, operation: str, operands: list[Any]) -> list[float]:
    """The operation by kingdon."""
    made = algebra(metric)
    if operation == "upoint":
        return point(*operands)
    values = []
    for x in operands:
        keys = tuple(k for k, c in enumerate(x) if c)
        values.append(made.multivector(keys=keys, values=[x[k] for k in keys]))
    result = getattr(values[0], operation)(*values[1:])
    found = [0.0] * len(made)
    for key, x in result.items():
        found[key] = float(x)
    return found


def point(*x: float) -> list[float]:
    """kingdon's point: the dual of its `upoint` e0 + x."""
    made = named(f"{len(x)}DPGA")
    value = made.upoint(**{f"e{i}": xi for i, xi in enumerate(x, 1)}).dual().asmvtype()
    size = len(x) + 1
    found = [0.0] * (1 << size)
    for key, coefficient in value.items():
        name = made.bin2canon[key].removeprefix("e")
        mask = sum(1 << int(letter) for letter in name)
        swaps = sum(a > b for i, a in enumerate(name) for b in name[i + 1 :])
        found[mask] = float(coefficient) * (-1) ** swaps
    return found


if __name__ == "__main__":
    serve(answer)
