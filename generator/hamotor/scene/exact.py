"""Arithmetic on the numbers that a scene's author wrote: exact, rounded once at the end."""

from __future__ import annotations

import math
from fractions import Fraction


def decimal(x: float) -> Fraction:
    """The shortest decimal that reads back as x: what the author wrote, 0.1 as one tenth."""
    return Fraction(repr(float(x)))


def rounded_once(*products: tuple[float, ...]) -> float:
    """The sum of these products of decimals, correctly rounded."""
    return float(sum(math.prod(map(decimal, factors)) for factors in products))
