"""Statistics of many members: moments and extremes, merged in one order whoever computed them.

Members are taken in chunks whose boundaries never change; sums run over a chunk, and chunks are
merged pairwise (Chan, Golub & LeVeque, 1979) in the order of their members.  So the bits do not
depend on threads, processes or machines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hamotor.run.library import Rows

Array = NDArray[np.float64]


@dataclass
class Moments:
    """Of `columns` quantities at `times` times over so many members.

    Shapes: count (times,), the others (times, columns).  Where the count is 0 the others are 0 or
    infinite.
    """

    count: NDArray[np.int64]
    mean: Array
    squares: Array
    """Σ (x − mean)²."""
    low: Array
    high: Array

    @staticmethod
    def none(times: int, columns: int) -> Moments:
        """Of no member."""
        shape = (times, columns)
        return Moments(
            count=np.zeros(times, dtype=np.int64),
            mean=np.zeros(shape),
            squares=np.zeros(shape),
            low=np.full(shape, np.inf),
            high=np.full(shape, -np.inf),
        )

    def put(self, time: int, rows: Rows) -> None:
        """Take these members, a row each, as all there are at a time."""
        self.count[time] = len(rows)
        if not len(rows):
            return
        # Over axis 0 NumPy adds row by row: an order that no processor changes.
        mean = np.add.reduce(rows, axis=0) / len(rows)
        off = rows - mean
        # The mean is off by the rounding of a long sum; the differences know by how much.
        self.mean[time] = mean + np.add.reduce(off, axis=0) / len(rows)
        off *= off
        self.squares[time] = np.add.reduce(off, axis=0)
        self.low[time] = rows.min(axis=0)
        self.high[time] = rows.max(axis=0)

    def merge(self, other: Moments) -> None:
        """Add the members of `other`, which come after these."""
        count = self.count + other.count
        some = np.maximum(count, 1).astype(np.float64)[:, np.newaxis]
        mine = self.count.astype(np.float64)[:, np.newaxis]
        theirs = other.count.astype(np.float64)[:, np.newaxis]
        apart = other.mean - self.mean
        share = theirs / some
        self.mean = np.where(mine == 0, other.mean, self.mean + apart * share)
        between = np.where((mine == 0) | (theirs == 0), 0.0, apart * apart * (mine * share))
        self.squares = self.squares + other.squares + between
        self.low = np.minimum(self.low, other.low)
        self.high = np.maximum(self.high, other.high)
        self.count = count

    @property
    def deviation(self) -> Array:
        """Standard deviation, with n − 1; NaN for fewer than two members."""
        degrees = self.count[:, np.newaxis] - 1
        with np.errstate(invalid="ignore"):
            return np.where(degrees > 0, np.sqrt(self.squares / np.maximum(degrees, 1)), np.nan)

    def blank(self, values: Array) -> Array:
        """`values`, with NaN where there is no member."""
        return np.where(self.count[:, np.newaxis] > 0, values, np.nan)


@dataclass
class Worst:
    """Of each quantity the largest value, whose it is, and the mean over all members."""

    value: Array
    member: NDArray[np.int64]
    """−1 where there is none."""
    total: Array
    count: int

    @staticmethod
    def none(quantities: int) -> Worst:
        """Of no member."""
        member = np.full(quantities, -1, dtype=np.int64)
        return Worst(np.zeros(quantities), member, np.zeros(quantities), 0)

    @staticmethod
    def of(values: Array, members: NDArray[np.int64]) -> Worst:
        """Of `values`, shape (members, quantities)."""
        if not len(members):
            return Worst.none(values.shape[1])
        first = values.argmax(axis=0)
        total = np.add.reduce(values, axis=0)
        largest = values[first, np.arange(values.shape[1])]
        return Worst(largest, members[first], total, len(members))

    def merge(self, other: Worst) -> None:
        """Add members that come after these."""
        worse = (other.member >= 0) & ((self.member < 0) | (other.value > self.value))
        self.value = np.where(worse, other.value, self.value)
        self.member = np.where(worse, other.member, self.member)
        self.total = self.total + other.total
        self.count += other.count

    @property
    def mean(self) -> Array:
        """NaN where there is no member."""
        return self.total / self.count if self.count else np.full_like(self.total, np.nan)


def quantiles(samples: Array, levels: tuple[float, ...]) -> Array:
    """Of samples (times, members, columns) at each level: shape (levels, times, columns).

    Between two members linearly (definition 7 of Hyndman & Fan, 1996).  Members whose row is NaN
    are left out.
    """
    times, _, columns = samples.shape
    found = np.full((len(levels), times, columns), np.nan)
    for time, rows in enumerate(samples):
        there = rows[~np.isnan(rows[:, 0])] if columns else rows
        if not len(there):
            continue
        ordered = np.sort(there, axis=0)
        for k, level in enumerate(levels):
            place = level * (len(ordered) - 1)
            below = int(place)
            above = min(below + 1, len(ordered) - 1)
            part = place - below
            found[k, time] = ordered[below] + part * (ordered[above] - ordered[below])
    return found


def as_arrays(prefix: str, of: Moments | Worst) -> dict[str, Any]:
    """Its fields by name, to be written."""
    return {f"{prefix}.{name}": value for name, value in vars(of).items()}
