"""Arithmetic on the numbers that a scene's author wrote: exact, rounded once at the end.

A number is a double that may remember what it was rounded from, for scalars with more digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any

DIGITS = 60
"""Of what is irrational: roots, sines, principal axes."""


class Exactly(float):
    """A double with the number that it stands for; arithmetic on it gives plain doubles."""

    exact: Fraction

    def __new__(cls, rounded: float, exact: Fraction) -> Exactly:
        """`rounded` is the double, nearest to `exact` but for rounding errors."""
        number = super().__new__(cls, rounded)
        number.exact = exact
        return number

    def __reduce__(self) -> tuple[Any, ...]:
        return Exactly, (float(self), self.exact)


def decimal(x: float) -> Fraction:
    """The number that x stands for: the shortest decimal that reads back as x, 0.1 as one tenth."""
    return x.exact if isinstance(x, Exactly) else _shortest(x)


def _shortest(x: float) -> Fraction:
    return Fraction(repr(float(x)))


def exactly(rounded: float, exact: Fraction) -> float:
    """The double `rounded`, which stands for `exact`."""
    return float(rounded) if _shortest(rounded) == exact else Exactly(rounded, exact)


def written(text: str) -> float:
    """The number that this text is, as a double; digits beyond a double's are remembered."""
    x = float(text)
    if not math.isfinite(x) or x == 0:
        return x
    return exactly(x, Fraction(text.replace("_", "")))


def rounded(exact: Fraction | int) -> float:
    """The nearest double."""
    return exactly(float(exact), Fraction(exact))


def rounded_once(*products: tuple[float, ...]) -> float:
    """The sum of these products of decimals, correctly rounded."""
    return rounded(sum(math.prod(map(decimal, factors)) for factors in products))


def with_digits(function: Callable[..., Any], *numbers: Fraction) -> tuple[Fraction, ...]:
    """What a function of mpmath's numbers gives for these, to `DIGITS` of the largest."""
    import mpmath

    with mpmath.workdps(DIGITS + 10):
        found = function(*(mpmath.mpf(x.numerator) / x.denominator for x in numbers))
        several = found if isinstance(found, tuple | list) else (found,)
        noise = max(map(abs, several)) * mpmath.mpf(10) ** -(DIGITS + 5)
        return tuple(from_mpmath(x) if abs(x) > noise else Fraction(0) for x in several)


def from_mpmath(x: Any) -> Fraction:
    """A number of mpmath, as it is."""
    sign, mantissa, exponent, _ = x._mpf_
    return Fraction(-mantissa if sign else mantissa) * Fraction(2) ** int(exponent)


def of_mpmath(x: Any) -> float:
    """The double nearest to a number of mpmath."""
    return rounded(from_mpmath(x))


def unit_vector(numbers: Iterable[Fraction]) -> tuple[Fraction, ...]:
    """The numbers divided by their Euclidean norm."""
    kept = tuple(numbers)
    square = sum((x * x for x in kept), Fraction(0))
    if square == 1:
        return kept
    (norm,) = with_digits(lambda x: x**0.5, square)
    return tuple(x / norm for x in kept)


def short(x: float | Fraction) -> Fraction:
    """The number that x stands for; in `DIGITS` where its fraction is longer."""
    exact = x if isinstance(x, Fraction) else decimal(x)
    return exact if exact.denominator < 10**DIGITS else Fraction(text(exact))


def text(x: float | Fraction) -> str:
    """The number that x stands for, with `DIGITS`."""
    exact = x if isinstance(x, Fraction) else decimal(x)
    digits = Context(prec=DIGITS).divide(Decimal(exact.numerator), Decimal(exact.denominator))
    return format(digits.normalize(Context(prec=DIGITS)), "E")
