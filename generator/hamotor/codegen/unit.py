"""How far an even element is from its group, M ~M − 1, and the step that brings it back."""

from __future__ import annotations

from fractions import Fraction

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Algebra, magnitude, ratio
from hamotor.codegen.element import Component, Element
from hamotor.codegen.kernel import (
    ONE,
    Kernel,
    direct_program,
    parameters_for,
    proved,
    read_off,
    reversed_value,
    value_of,
)
from hamotor.codegen.polynomial import Polynomial, PolynomialMultivector
from hamotor.codegen.program import (
    Call,
    Expression,
    Name,
    Parameter,
    Product,
    Program,
    factors_of,
    number,
    polynomial_expression,
)


def unit_kernels(algebra: Algebra, element: Element) -> tuple[Kernel, ...]:
    """`unit_defect`, `unit_defect_change` and `unit_correction` of an even element type.

    The type must be closed under products.  The defect D = M ~M − 1 has a type of its own, with the
    components that do not vanish identically: the number, and a part of grade 4 (Study's condition)
    if the type has one.  It is taken in twice the working precision: its rounding would not be
    independent of the digits that a compensated sum keeps beside M, and a projection by it alone
    turns spatial momenta a little the same way in every step, by 1e-14 in a million.
    """
    (m,) = parameters_for(element)
    value = value_of(m)
    square = poly.apply_bilinear(algebra.geometric, value, reversed_value(value))
    defect = poly.added(square, {0: ONE}, -1)
    oriented = {b: c for c in element.components for b in c.embedding if len(c.embedding) == 1}
    parts = (oriented.get(b, Component(algebra.blade_name(b), {b: 1})) for b in sorted(defect))
    result = Element(
        f"{element.name}Defect",
        "d" if element.symbol != "d" else "defect",
        tuple(parts),
        {},
        False,
        f"M ~M − 1 of a {element.name}: zero on the group.",
    )
    meaning = read_off(defect, result)
    outputs = tuple((n, _in_all_digits(p)) for n, p in meaning.items())
    law = "m ~m − 1, how far m is from the group"
    program = Program((m,), (), outputs, result)
    notes = ("Rounded once, as if computed in twice the precision.",)
    found = Kernel("unit_defect", law, program, meaning, "", None, notes)
    return (
        proved(found),
        _change(algebra, m, result),
        _correction(algebra, m, Parameter(result.symbol, result)),
    )


def _in_all_digits(p: Polynomial) -> Expression:
    """The sum of the terms of degree 0 and 2, rounded once."""
    content = 1 if () in p else magnitude(poly.content(p))
    total = Call("compensated_dot", factors_of(poly.scaled(p, ratio(1, content))))
    return total if content == 1 else Product(number(content), total)


def _change(algebra: Algebra, m: Parameter, result: Element) -> Kernel:
    low = Parameter("low", m.element)
    value, change = value_of(m), value_of(low)
    both = poly.added(
        poly.apply_bilinear(algebra.geometric, value, reversed_value(change)),
        poly.apply_bilinear(algebra.geometric, change, reversed_value(value)),
    )
    meaning = read_off(both, result)
    law = "m ~low + low ~m: unit_defect(m + low) − unit_defect(m), but for low²"
    program = direct_program((m, low), meaning, result)
    return proved(Kernel("unit_defect_change", law, program, meaning))


def _correction(algebra: Algebra, m: Parameter, d: Parameter) -> Kernel:
    halves: list[tuple[str, Expression]] = []
    named: PolynomialMultivector = {}
    for component in d.element.components:
        ((blade, sign),) = component.embedding.items()
        name = f"half_{component.name}"
        halves.append((name, Product(number(Fraction(-1, 2)), Name(f"{d.name}.{component.name}"))))
        named[blade] = {(name,): sign}
    value = value_of(m)
    whole = poly.apply_bilinear(algebra.geometric, value_of(d), value)
    meaning: dict[str, Polynomial] = {
        n: poly.scaled(p, Fraction(-1, 2)) for n, p in read_off(whole, m.element).items()
    }
    product = poly.apply_bilinear(algebra.geometric, named, value)
    outputs = tuple((n, polynomial_expression(p)) for n, p in read_off(product, m.element).items())
    law = "−½ d m: what to add to m, whose defect is d, to be on the group but for d²"
    program = Program((m, d), tuple(halves), outputs, m.element)
    return proved(Kernel("unit_correction", law, program, meaning))
