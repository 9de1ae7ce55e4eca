"""Null spaces by row reduction: exact in rationals, to a threshold in floating point."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

Number = Any
"""A Fraction, or one of mpmath's numbers."""


def reduced_echelon(
    rows: Sequence[Sequence[Number]], columns: int, negligible: Number = 0
) -> list[list[Number]]:
    """The reduced row echelon form, zero rows dropped.

    negligible: a number up to this is no pivot; for rows of size 1 in floating point.
    """
    remaining = [list(row) for row in rows]
    reduced: list[list[Number]] = []
    for column in range(columns):
        pivot = max(remaining, key=lambda row: abs(row[column]), default=None)
        if pivot is None or abs(pivot[column]) <= negligible:
            continue
        remaining = [row for row in remaining if row is not pivot]
        pivot = [x / pivot[column] for x in pivot]

        def cleared(
            row: list[Number], pivot: list[Number] = pivot, column: int = column
        ) -> list[Number]:
            return [x - row[column] * p for x, p in zip(row, pivot, strict=True)]

        remaining = [cleared(row) for row in remaining]
        reduced = [cleared(row) for row in reduced] + [pivot]
    return reduced


def null_space(
    rows: Sequence[Sequence[Number]],
    columns: int,
    one: Number = Fraction(1),
    negligible: Number = 0,
) -> list[list[Number]]:
    """All x with rows·x = 0: a basis in reduced echelon form.

    one: of the numbers' type.
    """
    reduced = reduced_echelon(rows, columns, negligible)
    pivots = [next(k for k in range(columns) if abs(row[k]) > negligible) for row in reduced]
    basis = []
    for free in (k for k in range(columns) if k not in pivots):
        vector = [one - one] * columns
        vector[free] = one
        for row, pivot in zip(reduced, pivots, strict=True):
            vector[pivot] = -row[free]
        basis.append(vector)
    return reduced_echelon(basis, columns, negligible)
