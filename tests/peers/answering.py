"""A peer's side of the conversation: one question a line on stdin, one answer a line on stdout."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from typing import Any

Metric = tuple[tuple[float, ...], ...]
Answer = Callable[[Metric, str, list[Any]], list[float]]
"""(Gram matrix, operation, operands) → coefficients; blade k is the bits of k, ascending."""


def serve(answer: Answer) -> None:
    """Answer until the questions end.  What a library prints goes to stderr."""
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as replies:
        os.dup2(2, 1)
        for line in sys.stdin:
            question = json.loads(line)
            metric = tuple(tuple(row) for row in question["metric"])
            try:
                said: dict[str, Any] = {
                    "value": answer(metric, question["operation"], question["operands"])
                }
            except Exception as error:  # noqa: BLE001  the other side fails the test with it
                said = {"error": f"{type(error).__name__}: {error}"}
            print(json.dumps(said), file=replies, flush=True)
