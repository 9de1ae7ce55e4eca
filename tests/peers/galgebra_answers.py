"""Answers by galgebra, symbolic and therefore exact, over any Gram matrix."""

from __future__ import annotations

import operator
from fractions import Fraction
from functools import cache, reduce
from typing import Any

from galgebra.ga import Ga  # type: ignore[import-not-found]
from sympy import N, Rational
from tests.peers.answering import Metric, serve

OPERATORS = {
    "*": operator.mul,
    "^": operator.xor,
    "|": operator.or_,
    "<": operator.lt,
    ">": operator.gt,
    ">>": operator.rshift,
    "<<": operator.lshift,
}


@cache
def algebra(metric: Metric) -> Any:
    """The algebra, and its blades for each bit mask."""
    size = len(metric)
    names = " ".join(f"a{i}" for i in range(size))
    made = Ga(names, g=[[Rational(x) for x in row] for row in metric])
    vectors = made.mv()
    blades = [
        reduce(operator.xor, (v for i, v in enumerate(vectors) if mask >> i & 1), made.mv(1))
        for mask in range(1 << size)
    ]
    return made, blades


def answer(metric: Metric, operation: str, operands: list[Any]) -> list[float]:
    """The operation by galgebra."""
    made, blades = algebra(metric)
    values = []
    for x in operands:
        terms = (Rational(Fraction(c)) * b for c, b in zip(x, blades, strict=True) if c)
        values.append(sum(terms, made.mv(0)))
    if operation in OPERATORS:
        result = OPERATORS[operation](*values)
    elif operation == "sandwich":
        versor, x = values
        result = versor * x * versor.rev()
    else:
        result = getattr(values[0], operation)(*values[1:])
    return [float(N(c, 30)) for c in result.blade_coefs(blades)]


if __name__ == "__main__":
    serve(answer)
