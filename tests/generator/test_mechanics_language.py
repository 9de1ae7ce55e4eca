"""The expression language: what a text means, and that a wrong one is a UsageError and no more."""

from __future__ import annotations

import ast
import operator
import random
import string
import sys
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import pytest
import sympy

from hamotor.errors import UsageError
from hamotor.mechanics import language
from hamotor.mechanics.language import (
    PI,
    Body,
    Function,
    Record,
    Vector,
    Vocabulary,
    body,
    coordinates,
    read_expression,
    read_number,
    read_vector,
    vector,
)

x, y, z, t = sympy.symbols("x y z t", real=True)
V, U = Vector((x, y, z)), Vector((y, z, x))


def _off_axis(v: Vector) -> Vector:
    if v.z == 0:
        raise UsageError("the direction lies in the plane z = 0")
    return v


VOCABULARY = Vocabulary(
    values={
        **dict(zip("xyzt", (x, y, z, t), strict=True)),
        "v": V,
        "u": U,
        "p": Vector((x, y)),
        "m": Record({"e12": x, "e23": y}),
        "scale": t,
    },
    bodies=("top", "box"),
    functions={
        "at": Function((body(), coordinates("x", "y", "z")), lambda _, point: point + V),
        "scale": Function((body(default="top"),), lambda which: x if which.name == "top" else y),
        "momentum": Function((body(),), lambda _: Record({"e12": x, "e23": y})),
        "off_axis": Function((vector("v", 3),), _off_axis),
    },
)


def read(text: str) -> Any:
    return read_expression(text, VOCABULARY, "top.toml: H")


def refused(text: str) -> str:
    with pytest.raises(UsageError) as problem:
        read(text)
    message = str(problem.value)
    assert message.startswith("top.toml: H: ")
    assert message.isprintable()
    assert len(message) < 500
    return message


# ---------------------------------------------------------------- what a text means


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("-x^2", -(x**2)),
        ("(-x)^2", x**2),
        ("2^-x", 2**-x),
        ("x^y^z", x ** (y**z)),
        ("x - y - z", x - y - z),
        ("x/y/z", x / (y * z)),
        ("x/y*z", x * z / y),
        ("x*-y", -x * y),
        ("0.1", sympy.Rational(1, 10)),
        (".5 + 3. + 1.5e-3", sympy.Rational(7003, 2000)),
        ("1e300", sympy.Integer(10) ** 300),
        ("sqrt(4)*8^(1/3)", sympy.Integer(4)),
        ("(4/9)^1.5", sympy.Rational(8, 27)),
        ("sqrt(x^2)", sympy.Abs(x)),
        ("abs(x*y)", sympy.Abs(x * y)),
        ("(x^3)^(1/3)", x),
        ("exp(x)^0.5", sympy.exp(x / 2)),
        ("sin(pi) + cos(pi/2) + cos(pi)", sympy.Integer(-1)),
        ("v.x + u.x", x + y),
        ("[x, y, z, t].w", t),
        ("momentum(box).e23 + m.e12", x + y),
        ("scale + scale() + scale(box)", t + x + y),
        ("cross(p, [1, 2])", 2 * x - y),
        ("norm_squared(p)", x**2 + y**2),
        ("distance(p, [1, 0])", sympy.sqrt((x - 1) ** 2 + y**2)),
        ("at(top, 1, 2, 3).z", z + 3),
        ("at(top, [1, 2, 3]).z", z + 3),
        ("atan2(y, x)", sympy.atan2(y, x)),
    ],
)
def test_meaning(text: str, meaning: object) -> None:
    assert read(text) == meaning
    assert read(text.replace("^", "**")) == meaning
    assert read(text.replace(" ", "\n\t")) == meaning


@pytest.mark.parametrize(
    ("text", "built"),
    [
        ("x*v + u/2", x * V + U / 2),
        ("-(v - u)*3.7", -(V - U) * 3.7),
        ("cross(v, [1, 2, 3])", language.cross(V, Vector((1, 2, 3)))),
        ("dot(v, u)", language.dot(V, U)),
        ("norm(v - u)", language.norm(V - U)),
        ("norm_squared(v)", language.norm_squared(V)),
        ("distance(v, u)", language.distance(V, U)),
        ("2*v", Decimal(2) * V),
        ("v/3", V / 3),
        ("sin(2)*v", language.sin(2) * V),
        ("sqrt(3*x)", language.sqrt(3 * x)),
        ("abs(x - y) + tanh(x)", language.absolute(x - y) + language.tanh(x)),
        ("x^2/(2*t) + 3*x*y/2", x**2 / (2 * t) + 3 * x * y / 2),
        ("top", Body("top")),
    ],
)
def test_text_and_python_build_the_same_object(text: str, built: object) -> None:
    assert read(text) == built


@pytest.mark.parametrize(
    ("text", "function", "argument"),
    [
        *((f"{name}(0.3)", name, "0.3") for name in ("sin", "cos", "tan", "asin", "acos", "atan")),
        *((f"{name}(0.3)", name, "0.3") for name in ("sinh", "cosh", "tanh", "exp", "log", "sqrt")),
    ],
)
def test_functions_of_constants_have_sixty_digits(text: str, function: str, argument: str) -> None:
    exact = getattr(sympy, function)(sympy.Rational(argument))
    assert read(text).is_Rational
    assert abs(sympy.N(read(text) - exact, 10)) < sympy.Rational(1, 10**59)
    assert abs(sympy.N(PI - sympy.pi, 10)) < sympy.Rational(1, 10**58)


def test_derivatives_of_the_absolute_value_are_signs() -> None:
    assert read("abs(x*y - z)").diff(x) == y * sympy.sign(x * y - z)
    spring = read("abs(norm(v) - 2)")
    assert spring.diff(x) == x / sympy.sqrt(x**2 + y**2 + z**2) * sympy.sign(
        sympy.sqrt(x**2 + y**2 + z**2) - 2
    )
    assert not read("abs(log(x))").diff(x).has(sympy.re, sympy.im, sympy.Derivative)


_OPERATIONS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}


def _python_value(node: ast.AST) -> Fraction:
    """The value by Python's grammar, in fractions."""
    match node:
        case ast.BinOp(left, operation, right):
            base, other = _python_value(left), _python_value(right)
            if isinstance(operation, ast.Pow):
                if other.denominator != 1 or abs(other) > 6:
                    raise OverflowError
                return base ** int(other)
            return Fraction(_OPERATIONS[type(operation)](base, other))
        case ast.UnaryOp(operation, operand):
            return Fraction(_OPERATIONS[type(operation)](_python_value(operand)))
        case ast.Constant(int(number)):
            return Fraction(number)
    raise TypeError(node)


def test_precedence_and_associativity_are_python_s() -> None:
    source = random.Random(4)
    compared = 0
    for _ in range(3_000):
        parts = [str(source.randint(1, 3))]
        for _ in range(source.randint(1, 7)):
            parts += [source.choice(["+", "-", "*", "/", "**", "*-", "**-", "-+"])]
            parts += [str(source.randint(1, 3))]
        if source.random() < 0.5:
            start = 2 * source.randrange(len(parts) // 2)
            parts[start], parts[-1] = f"-({parts[start]}", f"{parts[-1]})"
        text = "".join(parts)
        try:
            expected = _python_value(ast.parse(text, mode="eval").body)
        except (OverflowError, ZeroDivisionError):
            continue
        assert Fraction(int(read(text).p), int(read(text).q)) == expected, text
        compared += 1
    assert compared > 1_000


# ---------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "column 1 (>><<): the expression is empty"),
        ("x +", "column 4 (x +>><<): expected a number, a name, a vector or a bracket, but the"),
        (
            "x + * y",
            "column 5 (x + >>*<< y): expected a number, a name, a vector or a bracket, not",
        ),
        ("m*Pu^2", 'unknown name "Pu"; names are x, y'),
        ("tpo", 'Did you mean "top"?'),
        ("2x", 'expected an operator between "2" and "x"; a product is written a*b'),
        ("x y", 'expected an operator between "x" and "y"'),
        ("(x)(y)", 'expected an operator between ")" and "("'),
        ("x(y)", "x is not a function; a product is written x*(…)"),
        ("((x)", 'column 1 (>>(<<(x)): this "(" is not closed by ")"'),
        ("x)", '")" is out of place'),
        ("x, y", 'a "," stands between arguments or components only'),
        ("[x, y)", '")" is out of place'),
        ("x · y", "U+00B7 (MIDDLE DOT) is not in the language; write * or dot(a, b)"),
        ("х", "U+0445 (CYRILLIC SMALL LETTER HA) is not in the language"),
        ("ｘ", "U+FF58 (FULLWIDTH LATIN SMALL LETTER X)"),
        ("x\0", "U+0000 (a control character)"),
        ("١ + x", "U+0661"),
        ("v + 1", "a vector of 3 and a number cannot be added"),
        ("v + p", "dimensions differ"),
        ("v*u", "write dot(a, b) or cross(a, b)"),
        ("v^2", "write norm_squared(v)"),
        ("2^v", "a vector of 3 cannot be an exponent"),
        ("1/v", "norm(v) is its length"),
        ("dot(v, p)", "a vector of 3 and a vector of 2 have different dimensions"),
        ("cross([x, y, z, t], [x, y, z, t])", "cross takes vectors of 2 or 3"),
        ("[x]", "a vector has 2 to 4 components, not 1"),
        ("[]", "a vector has 2 to 4 components, not 0"),
        ("[x, y, z, t, x]", "a vector has 2 to 4 components, not 5"),
        ("[v, x]", "a component is a number, not a vector of 3"),
        ("v.w", 'a vector of 3 has no component "w"; components are x, y, z'),
        ("m.e13", 'the record has no component "e13"; components are e12, e23'),
        ("m*2", "name one of its components, e12, e23"),
        ("x.y", "a number has no components"),
        ("v.__class__", "U+005F (LOW LINE)"),
        ("v.components", 'has no component "components"'),
        ("top.name", 'the body "top" has no components'),
        ("top + 1", 'the body "top" cannot be added'),
        ("-top", 'the body "top" cannot be negated'),
        ("sin", "sin is a function; write sin(x)"),
        ("at", "at is a function; write at(BODY, x, y, z) or at(BODY, [x, y, z])"),
        ("sin(v)", "sin(…) takes a number as x, not a vector of 3"),
        ("sin()", "sin(…) lacks its argument x; write sin(x)"),
        ("sin(x, y)", "sin(…) has 1 argument too many"),
        ("norm(x)", "norm(…) takes a vector as v, not a number"),
        ("at(top, 1, 2)", "takes 3 numbers or a vector of 3, not 2 numbers"),
        ("at(top, p)", "takes 3 numbers or a vector of 3, not a vector of 2"),
        ("at(1, 2, 3, 4)", "takes a body's name as BODY, not a number"),
        ("off_axis(p)", "takes a vector of 3 as v, not a vector of 2"),
        ("off_axis([1, 2, 0])", "column 1 (>>off_axis<<([1, 2, 0])): the direction lies in"),
        ("sine(x)", 'Did you mean "sin"?'),
        ("system(x)", 'unknown function "system"; functions are'),
        ("x/0", "division by zero"),
        ("x/(y - y)", "division by zero"),
        ("0^0", "0 has positive powers only"),
        ("0^-1", "0 has positive powers only"),
        ("(-2)^x", "only positive constants have variable powers"),
        ("(-8)^(1/3)", "a power of a negative constant that is not an integer is not real"),
        ("sqrt(-2)", "the square root of a negative constant is not real"),
        ("sqrt(-x^2)", "undefined or not real"),
        ("log(0)", "the logarithm of a constant needs a positive one"),
        ("asin(2)", "need one within [-1, 1]"),
        ("tan(pi/2)", "the tangent has a pole here"),
        ("atan2(0, x - x)", "atan2(0, 0) is undefined"),
        ("9**9**9", "this power of a constant is too large or too small"),
        ("x^65", "an exponent is at most 64 in size"),
        ("x*" * 70 + "x", "an exponent is at most 64 in size"),
        ("exp(1e9)", "too large or too small"),
        ("cosh(1e9)", "too large"),
        ("1e401", "a decimal exponent is at most 400 in size"),
        ("1" * 61, "a number has at most 60 digits"),
        ("abs(log(log(log(x))))", "what may not be real"),
        ("sin(" * 9 + "x" + ")" * 9, "nested more than 7 deep"),
    ],
)
def test_every_error_says_what_where_and_what_is_allowed(text: str, expected: str) -> None:
    assert expected in refused(text)


def test_an_error_in_a_long_text_shows_only_its_surroundings() -> None:
    message = refused("x + " * 200 + "wrong" + " + y" * 200)
    assert "column 801 (…" in message
    assert ">>wrong<< + y" in message
    assert len(message) < 200


def test_what_a_key_needs_is_checked() -> None:
    assert read_number("dot(v, u)", VOCABULARY, "H") == x * y + y * z + z * x
    assert read_vector("v + u", VOCABULARY, "F", 3) == V + U
    with pytest.raises(UsageError, match=r"H: expected a number, not a vector of 3; norm\(v\)"):
        read_number("v", VOCABULARY, "H")
    with pytest.raises(UsageError, match="name one of its components, e12, e23"):
        read_number("m", VOCABULARY, "H")
    with pytest.raises(UsageError, match=r"F: expected a vector of 3, \[x, y, z\], not a vector"):
        read_vector("p", VOCABULARY, "F", 3)


@pytest.mark.parametrize(
    ("build", "expected"),
    [
        (lambda: V * U, "write dot"),
        (lambda: V + 1, "cannot be added"),
        (lambda: 1 - V, "cannot be added"),
        (lambda: 1 / V, "cannot divide"),
        (lambda: V**2, "no powers"),
        (lambda: V / 0, "division by zero"),
        (lambda: Vector((x, "1; system()")), "expected a number, not a Python str"),
        (lambda: Vector((x, float("nan"))), "NaN is not a finite number"),
        (lambda: Vector((x, sympy.oo)), "undefined or not real"),
        (lambda: Vector((x, sympy.I * x)), "undefined or not real"),
        (lambda: Vector((x, sympy.Float(2) * x)), "SymPy Float"),
        (lambda: Vocabulary(values={"x;int": x}), "is not a name"),
        (lambda: Vocabulary(bodies=("_top",)), "is not a name"),
        (lambda: Vocabulary(bodies=("top\n",)), "is not a name"),
        (lambda: Record({"a b": x}), "is not a name"),
        (lambda: Vocabulary(values={"top": x}, bodies=("top",)), '"top" is given twice'),
        (lambda: Vocabulary(values={"pi": x}), '"pi" is taken'),
        (lambda: Vocabulary(functions={"sin": Function((), lambda: x)}), "built-in function"),
    ],
)
def test_python_mistakes_are_usage_errors_too(build: Callable[[], object], expected: str) -> None:
    with pytest.raises(UsageError, match=expected):
        build()


# ---------------------------------------------------------------- hostile texts


def _calls(work: Callable[[], object]) -> int:
    """How many functions the work calls: a time that does not depend on the machine."""
    count = 0

    def counting(_frame: object, event: str, _argument: object) -> None:
        nonlocal count
        count += event in {"call", "c_call"}

    sys.setprofile(counting)
    try:
        work()
    finally:
        sys.setprofile(None)
    return count


BIG = str(10**58 + 7)
HOSTILE = [
    "9**9**9",
    "9^9^9^9^9^9",
    "x*" * 100_000 + "x",
    "x" * 10_001,
    "\0" * 9_999,
    "(" * 5_000 + "x" + ")" * 4_999,
    "[" * 9_999,
    "-" * 9_999 + "x",
    "x^" * 4_999 + "x",
    "f(" * 3_000,
    "x+" * 1_500 + "x",
    "x.x" * 3_000,
    "1" * 9_999,
    "1e" + "9" * 9_000,
    "1e-" + "9" * 9_000,
    "__import__('os').system('true')",
    "x.__class__.__bases__[0].__subclasses__()",
    "x; system(1)",
    "x /* */ + y // z",
    '#include "x"',
    "lambda: x",
    "x if x else y",
    "cross(" * 60 + "v" + ", [x, y, 1])" * 60,
    "(" * 12 + "3*x" + ")^64" * 12,
    "exp(1e9*log(3*x))",
    "(exp(1e9*x*log(3*y)))^(1/x)",
    "(2^(1e9*x))^(1/x)",
    "2^(x + 1e9)*2^(-x)",
    "(3*x)^(y + 1e9)",
    "exp(x*1e9)*exp(2000 - x*1e9)*exp(exp(9))",
    "exp(exp(exp(exp(9))))",
    "+".join(f"x/{int(BIG) + 2 * n}" for n in range(150)),
    "*".join(f"sqrt({n}*x + {n})" for n in range(2, 9)) + "*9**9**9",
    "sqrt(-" + BIG + ")",
    "tanh(1e400)",
    "abs(tan(abs(tan(abs(tan(x))))))",
    "sqrt(" * 90 + "x + y" + " + 1)" * 90,
    "cosh(cosh(cosh(x)))",
]


@pytest.mark.parametrize("text", HOSTILE, ids=lambda text: text[:24].replace("\0", "0"))
def test_hostile_texts_are_refused_after_bounded_work(text: str) -> None:
    sympy.core.cache.clear_cache()
    assert _calls(lambda: refused(text)) < 300_000


@pytest.mark.parametrize(
    "text",
    [
        f"sqrt({BIG}*{int(BIG) + 2})",
        f"({BIG}*x)^0.123456789123456789",
        "7^900^(1/3)",
        "2^0.333333333333333333",
        "sin(1e400) + tan(1e300)",
        "*".join(f"({n}*x)^(1/{n})" for n in range(2, 40)),
        "+".join(f"x/{n}" for n in range(2, 200)),
        "*".join(["exp(x)"] * 60),
        "x + " * 900 + "y",
        "(" * 99 + "x" + ")" * 99,
        "-" * 99 + "x",
    ],
    ids=lambda text: text[:24],
)
def test_awkward_but_right_texts_are_read_after_bounded_work(text: str) -> None:
    sympy.core.cache.clear_cache()
    assert _calls(lambda: read(text)) < 1_000_000


SEEDS = [
    "dot(v, u)/2 + 9.81*m.e12*at(top, 0.1, 0, 0).z",
    "0.5*x*(norm(v - u) - 1.5)^2 - log(y^2 + 1)",
    "exp(-x^2/2)*sin(3*t)*cross(v, [0, 0, 1])",
    "-1e3/distance(at(box, [1, 2, 3]), v) + abs(z)^1.5",
    "momentum(box).e23^2/(2*scale(box)) + atan2(y, x)",
]
FRAGMENTS = [
    *SEEDS,
    *"+-*/^()[],.xyztvum0123456789 ",
    *("**", "e5", "1e9", "sqrt(", "log(", ")^2", ")^0.5", ")^-1", "tan(", "top", "__", "π", "\0"),
    *string.punctuation,
]


def _mutated(source: random.Random) -> str:
    text = source.choice(SEEDS)
    for _ in range(source.randint(1, 4)):
        start = source.randrange(len(text) + 1)
        end = min(len(text), start + source.choice([0, 0, 1, 2, 6]))
        text = text[:start] + source.choice(FRAGMENTS) + text[end:]
    return text


def test_only_usage_errors_come_out_of_random_texts() -> None:
    source = random.Random(20)
    accepted = 0
    for number in range(20_000):
        if number % 2:
            text = _mutated(source)
        else:
            text = "".join(source.choice(FRAGMENTS[5:]) for _ in range(source.randint(1, 12)))
        try:
            value = read(text)
        except UsageError:
            continue
        accepted += 1
        assert isinstance(value, (sympy.Expr, Vector, Record, Body)), text
    assert 300 < accepted < 10_000
