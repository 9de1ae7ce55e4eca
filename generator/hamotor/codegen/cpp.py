"""C++ text of expressions, programs and element types.  Nothing here knows an algebra."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Context, Decimal

from hamotor.codegen.algebra import Rational
from hamotor.codegen.element import Element
from hamotor.codegen.program import (
    Accumulation,
    Call,
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Number,
    Product,
    Program,
    Quotient,
    Select,
    Shortcut,
    Sum,
    walk,
)

RATE_JACOBIANS = {
    *(
        f"{name}_{kind}"
        for name in ("dexp", "dexp_inverse")
        for kind in ("rotation", "motion", "dual_rotation", "dual_motion", "complex")
    ),
    "dexp_by_doubling",
    "dexp_inverse_by_elimination",
}
"""Functions of the runtime for the Jacobians of exp and log."""
PAIRS = {
    *RATE_JACOBIANS,
    "bivector_exponential",
    "bivector_logarithm",
    "planes_logarithm",
    "turned_logarithm",
    "compensated_dot_pair",
    "compensated_dot_parts",
    "double_word_sqrt",
    "double_word_sqrt_parts",
    "double_word_product",
    "double_word_ratio",
    "double_word_reciprocal",
    "double_word_scaled",
    "scaling",
    "sin_cos",
}
"""Functions of the runtime that return several numbers."""

_SUM, _PRODUCT, _UNARY, _ATOM = range(4)


WHOLE = 2**53
"""Integers up to this are numbers of every scalar that kernels are used with but float."""


def number_text(value: Rational) -> str:
    """An exact constant of scalar type S; with 62 digits, where its integers are too long."""
    if max(abs(value.numerator), value.denominator) > WHOLE:
        numerator, denominator = Decimal(value.numerator), Decimal(value.denominator)
        short, long = (f"{Context(prec=n).divide(numerator, denominator):E}" for n in (40, 62))
        return f'scalar::number<S>({short}L, [] {{ return "{long}"; }})'
    if value.denominator == 1:
        return f"S({value.numerator})"
    if value.denominator & (value.denominator - 1) == 0 and value.denominator <= 1024:
        return f"S({float(value)!r})"
    return f"(S({value.numerator}) / S({value.denominator}))"


def expression_text(expression: Expression) -> str:
    """C++ text of one expression."""
    return _text(expression)[0]


def _wrapped(expression: Expression, at_least: int) -> str:
    text, level = _text(expression)
    return text if level >= at_least else f"({text})"


def _text(expression: Expression) -> tuple[str, int]:
    match expression:
        case Name(text):
            return text, _ATOM
        case Number(value):
            return number_text(value), _ATOM
        case Negative(x):
            return f"-{_wrapped(x, _ATOM)}", _UNARY
        case Sum(a, Negative(b)):
            return f"{_wrapped(a, _SUM)} - {_wrapped(b, _PRODUCT)}", _SUM
        case Sum(a, b):
            return f"{_wrapped(a, _SUM)} + {_wrapped(b, _PRODUCT)}", _SUM
        case Product(a, b):
            return f"{_wrapped(a, _PRODUCT)} * {_wrapped(b, _UNARY)}", _PRODUCT
        case Quotient(a, b):
            return f"{_wrapped(a, _PRODUCT)} / {_wrapped(b, _ATOM)}", _PRODUCT
        case Accumulation():
            return _accumulation_text(expression), _ATOM
        case MultiplyAdd(_, _, Product() | MultiplyAdd()):
            return f"dot({', '.join(expression_text(x) for x in _chain(expression))})", _ATOM
        case MultiplyAdd(a, b, c):
            arguments = ", ".join(expression_text(x) for x in (a, b, c))
            return f"mul_add({arguments})", _ATOM
        case Call(function, arguments):
            listed = ", ".join(expression_text(x) for x in arguments)
            template = "" if arguments else "<S>"
            return f"scalar::{function}{template}({listed})", _ATOM
        case Select(x, positive, otherwise):
            listed = ", ".join(
                [
                    f"{_wrapped(x, _PRODUCT)} > S(0)",
                    *(expression_text(e) for e in (positive, otherwise)),
                ]
            )
            return f"select({listed})", _ATOM


def _accumulation_text(expression: Expression) -> str:
    """`less(onto(x, a, b, …), c, d, …)`: x + a b + … − c d − …."""
    inner = expression
    terms: list[str] = []
    function = ""
    while isinstance(inner, Accumulation):
        a, sign = (inner.a.x, "less") if isinstance(inner.a, Negative) else (inner.a, "onto")
        if sign != (function or sign):
            break
        function = sign
        terms = [expression_text(a), expression_text(inner.b), *terms]
        inner = inner.c
    return f"hamotor::{function}({', '.join([expression_text(inner), *terms])})"


def _chain(expression: Expression) -> list[Expression]:
    """Arguments of `dot` for a chain of multiply-adds, in the order of evaluation."""
    factors: list[Expression] = []
    while isinstance(expression, MultiplyAdd):
        factors = [expression.a, expression.b, *factors]
        expression = expression.c
    if isinstance(expression, Product):
        return [expression.a, expression.b, *factors]
    return [expression, *factors]


def scalar_type(element: Element | None) -> str:
    """C++ type of a value with scalar S."""
    if element is None or element.name == "Scalar":
        return "S"
    return f"{element.cpp_name}<S>"


def used_names(program: Program) -> set[str]:
    """Everything that the program reads, and the parameters it belongs to."""
    names: set[str] = set()
    for _, expression in (*program.bindings, *program.outputs):
        for node in walk(expression):
            if isinstance(node, Name):
                names.add(node.text)
                names.add(node.text.split(".")[0])
    return names


def signature_text(name: str, program: Program) -> str:
    """`Motor<S> gp(const Motor<S>& a, const Motor<S>& b)`."""
    used = used_names(program)
    arguments = []
    for parameter in program.parameters:
        shown = parameter.name if parameter.name in used else f"/*{parameter.name}*/"
        arguments.append(f"const {scalar_type(parameter.element)}& {shown}")
    return f"{scalar_type(program.result)} {name}({', '.join(arguments)})"


def binding_lines(program: Program) -> list[str]:
    """A statement for each binding, unformatted."""
    return [
        f"const {'auto' if isinstance(x, Call) and x.function in PAIRS else 'S'} {name} ="
        f" {expression_text(x)};"
        for name, x in program.bindings
    ]


def body_lines(program: Program) -> list[str]:
    """Statements of the function body, unformatted."""
    texts = {name: expression_text(e) for name, e in program.outputs}
    return [*binding_lines(program), return_line(program, texts)]


def return_line(program: Program, texts: Mapping[str, str]) -> str:
    """The statement that returns the result; texts: C++ text of each of its components."""
    if program.result is None or program.result.name == "Scalar":
        (text,) = texts.values()
        return f"return {text};"
    fields = ", ".join(f".{name} = {texts[name]}" for name, _ in program.outputs)
    return f"return {{{fields}}};"


def shortcut_lines(shortcut: Shortcut, general: Program) -> list[str]:
    """Statements of a function that takes a shortcut where it may, unformatted."""
    conditions = [f"{_wrapped(x, _PRODUCT)} > S(0)" for _, x in shortcut.where.outputs]
    result = f"() noexcept -> {scalar_type(general.result)}"
    return [
        *binding_lines(shortcut.where),
        f"const auto usual = {' && '.join(conditions)};",
        f"const auto shortly = [&]{result} {{",
        *body_lines(shortcut.program),
        "};",
        "if (scalar::everywhere(usual)) [[likely]] { return shortly(); }",
        f"return scalar::chosen(usual, shortly, [=]{result} {{",
        *body_lines(general),
        "});",
    ]
