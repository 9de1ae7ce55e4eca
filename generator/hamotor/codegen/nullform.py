"""exp, log and Cayley maps of commuting null bivectors: translations, where B² = 0 for every B."""

from __future__ import annotations

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Algebra, Rational, grade
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import (
    Kernel,
    direct_program,
    parameters_for,
    proved,
    read_off,
    value_of,
)
from hamotor.codegen.polynomial import PolynomialMultivector
from hamotor.codegen.program import Name, Number, Product, Program, Quotient, polynomial_expression


def _bivector(value: PolynomialMultivector) -> PolynomialMultivector:
    return {b: p for b, p in value.items() if grade(b) == 2}


def applies(algebra: Algebra, operand: Element) -> bool:
    """Whether every bivector of the operand, a bivector or a versor type, squares to zero."""
    (a,) = parameters_for(operand)
    value = value_of(a)
    bivector = _bivector(value)
    return set(value) <= {0, *bivector} and not poly.apply_bilinear(
        algebra.geometric, bivector, bivector
    )


def _forward(
    name: str, law: str, factor: Rational, operand: Element, result: Element, namespace: str
) -> Kernel:
    (b,) = parameters_for(operand)
    value = poly.added({0: {(): 1}}, value_of(b), factor)
    meaning = read_off(value, result)
    return proved(Kernel(name, law, direct_program((b,), meaning, result), meaning, namespace))


def _backward(
    name: str, law: str, divisor: Rational, operand: Element, result: Element, namespace: str
) -> Kernel:
    (m,) = parameters_for(operand)
    value = value_of(m)
    scalar = polynomial_expression(poly.scaled(value[0], divisor))
    bindings = (("inverse", Quotient(Number(1), scalar)),)
    outputs = tuple(
        (n, Product(Name("inverse"), polynomial_expression(p)))
        for n, p in read_off(_bivector(value), result).items()
    )
    notes = ("Takes m for the unit versor nearest to it; −m is the same translation.",)
    return Kernel(name, law, Program((m,), bindings, outputs, result), None, namespace, None, notes)


FORWARD: dict[str, tuple[str, Rational]] = {
    "exp": ("exp(B) = 1 + B, since B² = 0", 1),
    "cayley": ("(1 + B)(1 − B)⁻¹ = 1 + 2 B, since B² = 0", 2),
}
BACKWARD: dict[str, tuple[str, Rational]] = {
    "log": ("log(M) = <M>₂ / <M>₀", 1),
    "cayley_inverse": ("(M − 1)(M + 1)⁻¹ = <M>₂ / (2 <M>₀)", 2),
}


def null_kernel(operation: str, operand: Element, result: Element, namespace: str) -> Kernel:
    """`exp`, `log`, `cayley` or `cayley_inverse` of an operand to which `applies`."""
    if operation in FORWARD:
        return _forward(operation, *FORWARD[operation], operand, result, namespace)
    return _backward(operation, *BACKWARD[operation], operand, result, namespace)
