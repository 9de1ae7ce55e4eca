"""Exact polynomials in named components, and multivectors with such coefficients."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from math import gcd, lcm

from hamotor.codegen.algebra import Blade, Multivector, Rational, simplest

Monomial = tuple[str, ...]
Polynomial = dict[Monomial, Rational]
"""Sorted factor names → exact coefficient; no zero coefficients are stored."""

PolynomialMultivector = dict[Blade, Polynomial]


def add_term(into: Polynomial, monomial: Monomial, coefficient: Rational) -> None:
    """Add one term, dropping it if it cancels."""
    total = into.get(monomial, 0) + coefficient
    if total:
        into[monomial] = total
    else:
        into.pop(monomial, None)


def add_scaled(into: Polynomial, other: Mapping[Monomial, Rational], factor: Rational) -> None:
    """Add `factor * other` to `into`."""
    for monomial, coefficient in other.items():
        if total := into.get(monomial, 0) + factor * coefficient:
            into[monomial] = total
        else:
            into.pop(monomial, None)


def times(a: Mapping[Monomial, Rational], b: Mapping[Monomial, Rational]) -> Polynomial:
    """Product of two polynomials."""
    result: Polynomial = {}
    for left, x in a.items():
        for right, y in b.items():
            monomial = tuple(sorted(left + right))
            if total := result.get(monomial, 0) + x * y:
                result[monomial] = total
            else:
                del result[monomial]
    return result


def content(polynomial: Mapping[Monomial, Rational]) -> Rational:
    """Greatest common divisor of the coefficients, with the sign of the first term."""
    coefficients = list(polynomial.values())
    numerator = gcd(*(c.numerator for c in coefficients))
    denominator = lcm(*(c.denominator for c in coefficients))
    sign = -1 if all(c < 0 for c in coefficients) else 1
    return simplest(Fraction(sign * numerator, denominator))


def scaled(a: Mapping[Monomial, Rational], factor: Rational) -> Polynomial:
    """`factor * a`."""
    return {m: simplest(factor * c) for m, c in a.items()} if factor else {}


def apply_bilinear(
    product: Callable[[Blade, Blade], Multivector],
    a: Mapping[Blade, Polynomial],
    b: Mapping[Blade, Polynomial],
) -> PolynomialMultivector:
    """Extend a product of basis blades to multivectors with polynomial coefficients.

    Denominators are multiplied out before: whole numbers take a tenth of the time of fractions.
    """
    result: PolynomialMultivector = {}
    size_a, whole_a = _whole(a)
    size_b, whole_b = _whole(b)
    for blade_a, x in whole_a.items():
        for blade_b, y in whole_b.items():
            table = product(blade_a, blade_b)
            if not table:
                continue
            xy = times(x, y)
            for blade, coefficient in table.items():
                if blade in result:
                    add_scaled(result[blade], xy, coefficient)
                else:
                    result[blade] = {m: coefficient * c for m, c in xy.items()}
    size = size_a * size_b
    if size == 1:
        return {blade: p for blade, p in result.items() if p}
    return {blade: scaled(p, Fraction(1, size)) for blade, p in result.items() if p}


def _whole(a: Mapping[Blade, Polynomial]) -> tuple[int, PolynomialMultivector]:
    """A number, and a multiplied by it, which has whole coefficients."""
    size = lcm(*(c.denominator for p in a.values() for c in p.values()))
    return size, {
        blade: {m: c.numerator * (size // c.denominator) for m, c in p.items()}
        for blade, p in a.items()
    }


def added(
    a: Mapping[Blade, Polynomial], b: Mapping[Blade, Polynomial], factor: Rational = 1
) -> PolynomialMultivector:
    """`a + factor * b`."""
    result: PolynomialMultivector = {blade: dict(p) for blade, p in a.items()}
    for blade, p in b.items():
        add_scaled(result.setdefault(blade, {}), p, factor)
    return {blade: p for blade, p in result.items() if p}


def substituted(
    polynomial: Mapping[Monomial, Rational], values: Mapping[str, Polynomial]
) -> Polynomial:
    """Replace every name found in `values` by its polynomial."""
    result: Polynomial = {}
    for monomial, coefficient in polynomial.items():
        term: Polynomial = {(): coefficient}
        for name in monomial:
            term = times(term, values.get(name, {(name,): 1}))
        add_scaled(result, term, 1)
    return result
