"""Closed forms written step by step: bindings under names, and components of the result."""

from __future__ import annotations

from collections.abc import Mapping

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Blade, ratio
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import read_off
from hamotor.codegen.polynomial import Polynomial, PolynomialMultivector
from hamotor.codegen.program import (
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Number,
    Product,
    Sum,
    number,
    opposite,
    polynomial_expression,
)


class Writer:
    """Collects bindings; what is already a name or a constant is not bound again."""

    def __init__(self) -> None:
        """Start empty."""
        self.bindings: list[tuple[str, Expression]] = []

    def let(self, name: str, expression: Expression) -> Expression:
        """Bind an expression and return its name."""
        match expression:
            case Name() | Number() | Negative(Name()):
                return expression
            case _:
                self.bindings.append((name, expression))
                return Name(name)

    def let_polynomial(self, name: str, p: Polynomial) -> Polynomial:
        """Bind a polynomial, unless it is one factor or none; returns what stands for it."""
        if not p or (len(p) == 1 and len(next(iter(p))) <= 1):
            return p
        content = poly.content(p)
        self.bindings.append((name, polynomial_expression(poly.scaled(p, ratio(1, content)))))
        return {(name,): content}


def outputs_for(
    values: Mapping[Blade, Expression], result: Element
) -> tuple[tuple[str, Expression], ...]:
    """The components of the result, read off blade coefficients.

    A rate has no place for what no element of its group has: those coefficients are zero there.
    Raises ValueError where another result has no place for one of them.
    """
    held = {blade: x for blade, x in values.items() if blade in result.blades}
    if len(held) < len(values) and not result.namespace:
        raise ValueError(f"{result.name} does not hold all grades and blades of the result")
    names: PolynomialMultivector = {b: {(f"{b}",): 1} for b in held}
    outputs: list[tuple[str, Expression]] = []
    for component, p in read_off(names, result).items():
        total: Expression | None = None
        for monomial, x in p.items():
            value = values[int(monomial[0])]
            if abs(x) == 1:
                term = value if x > 0 else opposite(value)
                total = term if total is None else Sum(total, term)
            else:
                scaled = number(x)
                total = (
                    Product(scaled, value) if total is None else MultiplyAdd(scaled, value, total)
                )
        outputs.append((component, total if total is not None else number(0)))
    return tuple(outputs)
