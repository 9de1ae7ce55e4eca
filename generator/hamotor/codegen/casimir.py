"""Casimirs of a Lie algebra's dual: rational functions of a momentum that no motion changes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Rational
from hamotor.codegen.polynomial import Polynomial

MAXIMUM_TEXT = 2000
MAXIMUM_POWER = 8
MAXIMUM_TERMS = 1000
MAXIMUM_DEPTH = 20
TOKEN = re.compile(r"\s*(?:([A-Za-z]\w*)|(\d+)|([-+*^()]))")


@dataclass(frozen=True)
class Casimir:
    """C(μ) = numerator / denominator, polynomials in the momentum's coordinates; {C, μ_a} = 0.

    name:    for columns and files, e.g. `p_squared`; formula: for people, e.g. `|p|²`.
    unit:    in SI, e.g. `kg^2 m^2/s^2`.
    """

    name: str
    formula: str
    numerator: Polynomial
    denominator: Polynomial
    unit: str = ""


def parse_polynomial(text: str, names: Sequence[str]) -> Polynomial:
    """A polynomial in `names` with integer coefficients, from + − * ^ and brackets.

    Raises ValueError saying what is wrong.
    """
    if len(text) > MAXIMUM_TEXT:
        raise ValueError(f"longer than {MAXIMUM_TEXT} characters")
    tokens: list[str] = []
    at = 0
    while text[at:].strip():
        match = TOKEN.match(text, at)
        if match is None:
            raise ValueError(f'"{text[at:].strip()[0]}" is not part of a polynomial')
        tokens.append(match.group().strip())
        at = match.end()
    return _Parser(tokens, names).whole()


class _Parser:
    """Recursive descent, on a text of bounded length."""

    def __init__(self, tokens: list[str], names: Sequence[str]) -> None:
        self.tokens = tokens[::-1]
        self.names = names
        self.depth = 0

    def whole(self) -> Polynomial:
        result = self.sum()
        if self.tokens:
            raise ValueError(f'"{self.tokens[-1]}" is out of place')
        return result

    def takes(self, *wanted: str) -> str | None:
        return self.tokens.pop() if self.tokens and self.tokens[-1] in wanted else None

    def sum(self) -> Polynomial:
        sign = -1 if self.takes("-") else 1
        total = poly.scaled(self.product(), sign)
        while operator := self.takes("+", "-"):
            poly.add_scaled(total, self.product(), -1 if operator == "-" else 1)
        return total

    def product(self) -> Polynomial:
        result = self.power()
        while self.takes("*"):
            result = self.times(result, self.power())
        return result

    def times(self, a: Polynomial, b: Polynomial) -> Polynomial:
        if len(a) * len(b) > MAXIMUM_TERMS:
            raise ValueError(f"has more than {MAXIMUM_TERMS} terms")
        return poly.times(a, b)

    def power(self) -> Polynomial:
        base = self.atom()
        if not self.takes("^"):
            return base
        exponent = self.tokens.pop() if self.tokens else ""
        if not exponent.isdecimal() or not 1 <= int(exponent) <= MAXIMUM_POWER:
            raise ValueError(f'"{exponent}" is not a power from 1 to {MAXIMUM_POWER}')
        result = base
        for _ in range(int(exponent) - 1):
            result = self.times(result, base)
        return result

    def atom(self) -> Polynomial:
        if self.takes("("):
            self.depth += 1
            if self.depth > MAXIMUM_DEPTH:
                raise ValueError(f"has more than {MAXIMUM_DEPTH} brackets in one another")
            inner = self.sum()
            self.depth -= 1
            if not self.takes(")"):
                raise ValueError("a bracket is not closed")
            return inner
        if not self.tokens:
            raise ValueError("ends too early")
        token = self.tokens.pop()
        if token.isdecimal():
            return {(): int(token)} if int(token) else {}
        if token not in self.names:
            raise ValueError(f'"{token}" is not one of {", ".join(self.names)}')
        return {(token,): 1}


def derivative(p: Mapping[tuple[str, ...], Rational], name: str) -> Polynomial:
    """∂p/∂name."""
    result: Polynomial = {}
    for monomial, x in p.items():
        if count := monomial.count(name):
            rest = list(monomial)
            rest.remove(name)
            poly.add_term(result, tuple(rest), count * x)
    return result


def unchanged(
    casimir: Casimir,
    names: Sequence[str],
    structure: Sequence[Sequence[Sequence[Rational]]],
) -> bool:
    """Whether {C, μ_b} = Σ ∂C/∂μ_a c_ab^k μ_k vanishes identically for every b, exactly.

    `structure[a][b]` are the coordinates of [E_a, E_b].
    """
    for b in range(len(names)):
        flow: dict[str, Polynomial] = {
            name: {(names[k],): x for k, x in enumerate(structure[a][b]) if x}
            for a, name in enumerate(names)
        }
        rates = []
        for part in (casimir.numerator, casimir.denominator):
            rate: Polynomial = {}
            for name, velocity in flow.items():
                poly.add_scaled(rate, poly.times(derivative(part, name), velocity), 1)
            rates.append(rate)
        total = poly.times(rates[0], casimir.denominator)
        poly.add_scaled(total, poly.times(casimir.numerator, rates[1]), -1)
        if total:
            return False
    return True


def unit_text(kilograms: int, metres: int, seconds: int) -> str:
    """`kg^2 m^2/s^2`, `1/(m s)`, `1`: a product of powers of SI units."""
    powers = (("kg", kilograms), ("m", metres), ("s", seconds))
    above = [n + (f"^{p}" if p > 1 else "") for n, p in powers if p > 0]
    below = [n + (f"^{-p}" if p < -1 else "") for n, p in powers if p < 0]
    top = " ".join(above) or "1"
    if not below:
        return top
    return f"{top}/{below[0]}" if len(below) == 1 else f"{top}/({' '.join(below)})"


def unit_of(p: Polynomial, lengths: Mapping[str, int]) -> tuple[int, int]:
    """(number of momenta, power of length) of a homogeneous polynomial in momenta.

    lengths: for each momentum the power of length in its unit kg m^k/s.  Raises ValueError where
    two terms differ.
    """
    found = {(len(monomial), sum(lengths[n] for n in monomial)) for monomial in p}
    if len(found) > 1:
        raise ValueError("its terms have different units")
    return found.pop() if found else (0, 0)


def value(casimir: Casimir, momentum: Mapping[str, Fraction]) -> Fraction:
    """C at an exact momentum; ZeroDivisionError where its denominator vanishes."""
    parts = []
    for p in (casimir.numerator, casimir.denominator):
        total = Fraction(0)
        for monomial, x in p.items():
            term = Fraction(x)
            for name in monomial:
                term *= momentum[name]
            total += term
        parts.append(total)
    return parts[0] / parts[1]
