"""Answers by clifford, whose operators and methods are named as they are there."""

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

import clifford  # type: ignore[import-not-found]
from tests.peers.answering import Metric, serve

OPERATORS: dict[str, Callable[..., Any]] = {
    "*": operator.mul,
    "^": operator.xor,
    "|": operator.or_,
    "&": operator.and_,
    "~": operator.invert,
}


@cache
def layout(metric: Metric) -> Any:
    """The algebra, and its blade values for each bit mask."""
    squares = [int(row[i]) for i, row in enumerate(metric)]
    if squares == [1, 1, 1, 1, -1]:
        made = import_module("clifford.g3c").layout
    else:
        ids = clifford.BasisVectorIds.ordered_integers(len(squares))
        made = clifford.Layout(squares, ids=ids)
    first = made.bladeTupList[1][0]
    masks = [sum(1 << (i - first) for i in blade) for blade in made.bladeTupList]
    return made, masks


def answer(metric: Metric, operation: str, operands: list[Any]) -> list[float]:
    """The operation by clifford."""
    made, masks = layout(metric)
    values = [
        made.MultiVector([x[mask] for mask in masks]) if isinstance(x, list) else x
        for x in operands
    ]
    if operation in OPERATORS:
        result = OPERATORS[operation](*values)
    elif operation.startswith("g3c."):
        tools = import_module("clifford.tools.g3c")
        result = getattr(tools, operation.removeprefix("g3c."))(*values)
    elif operation == "up":
        result = made.up(*values)
    else:
        result = getattr(values[0], operation)(*values[1:])
    found = [0.0] * len(masks)
    for mask, x in zip(masks, result.value, strict=True):
        found[mask] = float(x)
    return found


if __name__ == "__main__":
    clifford.eps(1e-20)
    serve(answer)
