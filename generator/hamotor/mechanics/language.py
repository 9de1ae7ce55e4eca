"""Energies and forces as text: a safe expression language, read node by node into SymPy.

    sum      := product (("+" | "-") product)*
    product  := unary (("*" | "/") unary)*
    unary    := ("+" | "-") unary | power
    power    := postfix (("^" | "**") unary)?             right associative: -x^2 = -(x^2)
    postfix  := atom ("." NAME)*                          v.x, momentum(box).e12
    atom     := NUMBER | NAME | NAME "(" sum ("," sum)* ")" | "[" sum ("," sum)* "]" | "(" sum ")"

A value is a number (a SymPy expression), a `Vector`, a `Record` of named numbers or a `Body`; every
operation checks its operands. What the text may name is a `Vocabulary`. Python composes the same
objects with the operators of `Vector` and the functions here.

Constants are rational. Decimals, + - * / and integer powers are exact; any other function of
constants is its value to 60 significant digits, and `pi` is π to 60. SymPy therefore never sees an
irrational constant, on which its automatic simplification can take unbounded time.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from typing import Any, Literal, NamedTuple, NoReturn, TypeAlias

import sympy

from hamotor.errors import UsageError, suggest

MOST_CHARACTERS = 10_000
MOST_NODES = 2_000
MOST_NESTING = 100
MOST_DIGITS = 60
MOST_DECIMAL_EXPONENT = 400
MOST_EXPONENT = 64
MOST_BITS = 8_192
"""Of the numerator and of the denominator of a constant."""
MOST_WRITTEN_OUT = 100_000
"""Nodes of an expression written out as a tree: nested cross products double it at every level."""
MOST_FUNCTIONS_NESTED = 7
CONSTANT_DIGITS = 60
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

_MOST_MAGNITUDE_BITS = 1_330
_ADDED_AT_ONCE = 8
_HYPERBOLIC_HARDNESS = 4
_MOST_LISTED = 24
_EXCERPT = 60
_AXES = "xyzw"

Scalar: TypeAlias = sympy.Expr


@dataclass(frozen=True)
class Vector:
    """2 to 4 numbers, with + - * / as operators. `a * b` of two vectors is an error."""

    components: tuple[Scalar, ...]

    def __post_init__(self) -> None:
        components = tuple(scalar(component) for component in self.components)
        if not 2 <= len(components) <= len(_AXES):
            raise UsageError(f"a vector has 2 to {len(_AXES)} components, not {len(components)}")
        object.__setattr__(self, "components", components)

    def __len__(self) -> int:
        return len(self.components)

    def __iter__(self) -> Iterator[Scalar]:
        return iter(self.components)

    def __getitem__(self, index: int) -> Scalar:
        return self.components[index]

    @property
    def x(self) -> Scalar:
        return attribute(self, "x")

    @property
    def y(self) -> Scalar:
        return attribute(self, "y")

    @property
    def z(self) -> Scalar:
        return attribute(self, "z")

    @property
    def w(self) -> Scalar:
        return attribute(self, "w")

    def __neg__(self) -> Vector:
        return Vector(tuple(negative(component) for component in self))

    def __add__(self, other: object) -> Vector:
        return _vector(add(self, _value(other)))

    def __radd__(self, other: object) -> Vector:
        return _vector(add(_value(other), self))

    def __sub__(self, other: object) -> Vector:
        return _vector(add(self, negative(_value(other))))

    def __rsub__(self, other: object) -> Vector:
        return _vector(add(_value(other), -self))

    def __mul__(self, other: object) -> Vector:
        return _vector(multiply(self, _value(other)))

    def __rmul__(self, other: object) -> Vector:
        return _vector(multiply(_value(other), self))

    def __truediv__(self, other: object) -> Vector:
        return _vector(divide(self, _value(other)))

    def __rtruediv__(self, other: object) -> NoReturn:
        divide(_value(other), self)
        raise AssertionError("a division by a vector is refused")

    def __pow__(self, other: object) -> NoReturn:
        power(self, _value(other))
        raise AssertionError("a power of a vector is refused")


@dataclass(frozen=True)
class Record:
    """Named numbers, such as the components of a momentum: `momentum(box).e12`."""

    fields: Mapping[str, Scalar]

    def __post_init__(self) -> None:
        for name in self.fields:
            _require_name(name)
        fields = {name: scalar(number) for name, number in self.fields.items()}
        object.__setattr__(self, "fields", fields)

    def __hash__(self) -> int:
        return hash(tuple(self.fields.items()))


@dataclass(frozen=True)
class Body:
    """A body by its name; only functions take it."""

    name: str


Value: TypeAlias = Scalar | Vector | Record | Body


@dataclass(frozen=True)
class Argument:
    """One argument of a `Function`. Made by `number`, `vector`, `body` and `coordinates`."""

    kind: Literal["number", "vector", "body", "coordinates"]
    names: tuple[str, ...]
    dimension: int | None = None
    default: Body | None = None


def number(name: str = "x") -> Argument:
    """A number; the function gets the SymPy expression."""
    return Argument("number", (name,))


def vector(name: str = "v", dimension: int | None = None) -> Argument:
    """A vector of this dimension (any, if None); the function gets the `Vector`."""
    return Argument("vector", (name,), dimension)


def body(name: str = "BODY", default: str | None = None) -> Argument:
    """A body's name; the function gets the `Body`. With a default it may be left out."""
    return Argument("body", (name,), default=None if default is None else Body(default))


def coordinates(*names: str) -> Argument:
    """As many numbers as names, or one vector of them; the function gets the `Vector`."""
    return Argument("coordinates", names, len(names))


@dataclass(frozen=True)
class Function:
    """A function of the language: what it takes, and what it makes of the checked arguments.

    `apply` gets one value per `Argument`; a UsageError it raises is given the place in the text.
    """

    arguments: tuple[Argument, ...]
    apply: Callable[..., Any]

    def usage(self, name: str) -> str:
        """`at(BODY, x, y, z) or at(BODY, [x, y, z])`."""
        flat = [part for argument in self.arguments for part in argument.names]
        shown = f"{name}({', '.join(flat)})"
        if not any(argument.kind == "coordinates" for argument in self.arguments):
            return shown
        grouped = [
            f"[{', '.join(argument.names)}]"
            if argument.kind == "coordinates"
            else argument.names[0]
            for argument in self.arguments
        ]
        return f"{shown} or {name}({', '.join(grouped)})"

    def __call__(self, name: str, values: Sequence[Value]) -> Value:
        """The function of these values, which are checked; `name` is for the error."""
        rest = list(values)
        taken = [self._take(name, argument, rest) for argument in self.arguments]
        if rest:
            raise self._misuse(name, f"has {_counted(len(rest), 'argument')} too many")
        return _checked_value(self.apply(*taken))

    def _take(self, name: str, argument: Argument, rest: list[Value]) -> Value:
        if argument.default is not None and not (rest and isinstance(rest[0], Body)):
            return argument.default
        if not rest:
            raise self._misuse(name, f"lacks its argument {argument.names[0]}")
        first, shown = rest.pop(0), argument.names[0]
        match argument.kind:
            case "body":
                if isinstance(first, Body):
                    return first
                raise self._misuse(name, f"takes a body's name as {shown}, not {described(first)}")
            case "number":
                if isinstance(first, sympy.Expr):
                    return first
                raise self._misuse(name, f"takes a number as {shown}, not {described(first)}")
            case "vector":
                if isinstance(first, Vector) and argument.dimension in {None, len(first)}:
                    return first
                wanted = (
                    "a vector"
                    if argument.dimension is None
                    else f"a vector of {argument.dimension}"
                )
                raise self._misuse(name, f"takes {wanted} as {shown}, not {described(first)}")
            case "coordinates":
                count = len(argument.names)
                if isinstance(first, Vector) and len(first) == count:
                    return first
                numbers = [first, *rest[: count - 1]]
                wrong = [each for each in numbers if not isinstance(each, sympy.Expr)]
                if wrong or len(numbers) < count:
                    got = described(wrong[0]) if wrong else _counted(len(numbers), "number")
                    raise self._misuse(
                        name, f"takes {count} numbers or a vector of {count}, not {got}"
                    )
                del rest[: count - 1]
                return Vector(tuple(numbers))

    def _misuse(self, name: str, problem: str) -> UsageError:
        return UsageError(f"{name}(…) {problem}; write {self.usage(name)}")


@dataclass(frozen=True)
class Vocabulary:
    """What a text may name beside the built-in functions and `pi`.

    `values` are parameters, the time, shorthands such as `Pi`; `functions` may share a value's name
    (`scale` and `scale(BODY)`). UsageError for a name that is not one, or is given twice.
    """

    values: Mapping[str, Value] = field(default_factory=dict)
    bodies: tuple[str, ...] = ()
    functions: Mapping[str, Function] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in (*self.values, *self.bodies, *self.functions):
            _require_name(name)
        for name in self.bodies:
            if name in self.values or self.bodies.count(name) > 1:
                raise UsageError(
                    f'the name "{name}" is given twice: bodies and values need their own'
                )
        if "pi" in self.values or "pi" in self.bodies:
            raise UsageError('the name "pi" is taken by the number π')
        for name in self.functions:
            if name in FUNCTIONS:
                raise UsageError(f'the name "{name}" is taken by a built-in function')
        for value in self.values.values():
            _checked_value(value)


# ---------------------------------------------------------------- operations on values


def scalar(value: object) -> Scalar:
    """The number as a checked SymPy expression; a float is the decimal it prints as."""
    if isinstance(value, sympy.Expr):
        return _checked(value)
    if isinstance(value, float):
        value = Decimal(repr(value))
    if isinstance(value, Decimal) and not value.is_finite():
        raise UsageError(f"{value} is not a finite number")
    if isinstance(value, (int, Fraction, Decimal)) and not isinstance(value, bool):
        exact = Fraction(value)
        return _checked(sympy.Rational(exact.numerator, exact.denominator))
    raise UsageError(f"expected a number, not {described(value)}")


def described(value: object) -> str:
    """What a value is, for an error: `a vector of 3`."""
    match value:
        case sympy.Expr():
            return "a number"
        case Vector():
            return f"a vector of {len(value)}"
        case Record():
            return f"a record of {_listed(value.fields)}"
        case Body():
            return f'the body "{value.name}"'
        case _:
            return f"a Python {type(value).__name__}"


def add(*values: Value) -> Value:
    """The sum of numbers, or of vectors of one dimension."""
    first = values[0]
    for value in values:
        if isinstance(value, (Record, Body)):
            raise UsageError(f"{described(value)} cannot be added{_field_hint(value)}")
        if isinstance(value, Vector) != isinstance(first, Vector):
            raise UsageError(f"{described(first)} and {described(value)} cannot be added")
        if isinstance(value, Vector) and len(value) != len(_vector(first)):
            raise UsageError(
                f"{described(first)} and {described(value)} cannot be added: dimensions differ"
            )
    if isinstance(first, Vector):
        return Vector(tuple(_sum(parts) for parts in zip(*map(_vector, values), strict=True)))
    return _sum(values)


def negative(value: Value) -> Any:
    """The number or vector with the opposite sign."""
    return -value if isinstance(value, Vector) else _checked(-_number(value, "be negated"))


def multiply(left: Value, right: Value) -> Value:
    """The product of two numbers, or of a number and a vector."""
    if isinstance(left, Vector):
        if isinstance(right, Vector):
            raise UsageError("two vectors have no product *: write dot(a, b) or cross(a, b)")
        factor = _number(right, "be multiplied")
        return Vector(tuple(_checked(component * factor) for component in left))
    factor = _number(left, "be multiplied")
    if isinstance(right, Vector):
        return Vector(tuple(_checked(factor * component) for component in right))
    return _checked(factor * _number(right, "be multiplied"))


def divide(left: Value, right: Value) -> Value:
    """A number or a vector divided by a number."""
    if isinstance(right, Vector):
        raise UsageError(f"{described(right)} cannot divide; norm(v) is its length")
    divisor = _number(right, "divide")
    if divisor == 0:
        raise UsageError("division by zero")
    return multiply(left, power(divisor, sympy.Integer(-1)))


def power(base: Value, exponent: Value) -> Scalar:
    """base^exponent of numbers.

    A constant exponent of a base that is not constant is at most 64 in size; a negative constant
    has integer powers only; 0 has positive powers only.
    """
    if isinstance(base, Vector):
        raise UsageError("a vector has no powers: write norm_squared(v) for v·v")
    u, v = _number(base, "be raised to a power"), _number(exponent, "be an exponent")
    if v.is_Rational:
        return _constant_power(u, v) if u.is_Rational else _rational_power(u, v)
    if u.is_Rational and u <= 0:
        raise UsageError("only positive constants have variable powers")
    _require_small_exponent(v.as_coeff_Add()[0], u)
    _require_small_combined_exponent(u, v)
    return _checked(sympy.Pow(u, v))


def attribute(value: Value, name: str) -> Scalar:
    """`v.x` of a vector, `record.field` of a record."""
    if isinstance(value, Vector):
        allowed: Sequence[str] = _AXES[: len(value)]
        if name in list(allowed):
            return value.components[_AXES.index(name)]
    elif isinstance(value, Record):
        allowed = tuple(value.fields)
        if name in value.fields:
            return value.fields[name]
    else:
        raise UsageError(f"{described(value)} has no components")
    shown = f"{described(value)} has no component {_quoted(name)}"
    if isinstance(value, Record):
        shown = f"the record has no component {_quoted(name)}"
    raise UsageError(f"{shown}; components are {_listed(allowed)}.{suggest(name, allowed)}")


def dot(a: Vector, b: Vector) -> Scalar:
    """Σ aᵢ bᵢ."""
    _require_same_dimension(a, b)
    return _sum([_checked(p * q) for p, q in zip(a, b, strict=True)])


def cross(a: Vector, b: Vector) -> Any:
    """a × b: a vector of 3 for vectors of 3, the number a.x b.y − a.y b.x for vectors of 2."""
    _require_same_dimension(a, b)

    def minor(i: int, j: int) -> Scalar:
        return _sum([_checked(a[i] * b[j]), _checked(-a[j] * b[i])])

    if len(a) == 2:
        return minor(0, 1)
    if len(a) == 3:
        return Vector((minor(1, 2), minor(2, 0), minor(0, 1)))
    raise UsageError("cross takes vectors of 2 or 3")


def norm_squared(v: Vector) -> Scalar:
    """v · v."""
    return _sum([power(component, sympy.Integer(2)) for component in v])


def norm(v: Vector) -> Scalar:
    """√(v · v)."""
    return sqrt(norm_squared(v))


def distance(p: Vector, q: Vector) -> Scalar:
    """|p − q|."""
    _require_same_dimension(p, q)
    return norm(p - q)


def sqrt(x: Scalar) -> Scalar:
    """The square root; of a negative constant it is an error."""
    x = scalar(x)
    if x.is_Rational and x < 0:
        raise UsageError("the square root of a negative constant is not real")
    return power(x, sympy.Rational(1, 2))


def exp(x: Scalar) -> Scalar:
    """The exponential."""
    x = scalar(x)
    if x.is_Rational and abs(x) > _MOST_MAGNITUDE_BITS:
        raise UsageError("the exponential of this constant is too large or too small")
    _require_small_powers_of_logarithms(x)
    return _checked(sympy.exp(x))


def log(x: Scalar) -> Scalar:
    """The natural logarithm; of a constant that is not positive it is an error."""
    x = scalar(x)
    if x.is_Rational and x <= 0:
        raise UsageError("the logarithm of a constant needs a positive one")
    return _checked(sympy.log(x))


def sin(x: Scalar) -> Scalar:
    """The sine of an angle in radians."""
    return _checked(sympy.sin(scalar(x)))


def cos(x: Scalar) -> Scalar:
    """The cosine of an angle in radians."""
    return _checked(sympy.cos(scalar(x)))


def tan(x: Scalar) -> Scalar:
    """The tangent of an angle in radians."""
    return _checked(sympy.tan(scalar(x)))


def asin(x: Scalar) -> Scalar:
    """The arc sine in [−π/2, π/2]; of a constant outside [−1, 1] it is an error."""
    return _checked(sympy.asin(_within_unit(scalar(x))))


def acos(x: Scalar) -> Scalar:
    """The arc cosine in [0, π]; of a constant outside [−1, 1] it is an error."""
    return _checked(sympy.acos(_within_unit(scalar(x))))


def atan(x: Scalar) -> Scalar:
    """The arc tangent in (−π/2, π/2)."""
    return _checked(sympy.atan(scalar(x)))


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """The angle of the point (x, y) in (−π, π]."""
    y, x = scalar(y), scalar(x)
    if y == 0 and x == 0:
        raise UsageError("atan2(0, 0) is undefined")
    return _checked(sympy.atan2(y, x))


def sinh(x: Scalar) -> Scalar:
    """The hyperbolic sine."""
    return _checked(sympy.sinh(_within_exponential(scalar(x))))


def cosh(x: Scalar) -> Scalar:
    """The hyperbolic cosine."""
    return _checked(sympy.cosh(_within_exponential(scalar(x))))


def tanh(x: Scalar) -> Scalar:
    """The hyperbolic tangent."""
    return _checked(sympy.tanh(_within_exponential(scalar(x))))


def absolute(x: Scalar) -> Scalar:
    """|x|, `abs` in a text: SymPy's Abs, whose derivative is sign(x), where x is known to be real.

    Where SymPy cannot tell (a logarithm, a root), √(x²), because the derivative of its Abs would
    then speak of real and imaginary parts.
    """
    x = scalar(x)
    if _is_surely_real(x):
        return _checked(sympy.Abs(x))
    return sqrt(power(x, sympy.Integer(2)))


FUNCTIONS: Mapping[str, Function] = {
    **{
        function.__name__: Function((number(),), function)
        for function in (sqrt, exp, log, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh)
    },
    "abs": Function((number(),), absolute),
    "atan2": Function((number("y"), number("x")), atan2),
    "dot": Function((vector("a"), vector("b")), dot),
    "cross": Function((vector("a"), vector("b")), cross),
    "norm": Function((vector(),), norm),
    "norm_squared": Function((vector(),), norm_squared),
    "distance": Function((vector("p"), vector("q")), distance),
}
"""The built-in functions by their names in a text."""


def _value(value: object) -> Value:
    return value if isinstance(value, (Vector, Record, Body)) else scalar(value)


def _vector(value: Value) -> Vector:
    if not isinstance(value, Vector):
        raise UsageError(f"expected a vector, not {described(value)}")
    return value


def _number(value: Value, verb: str) -> Scalar:
    if isinstance(value, (Vector, Record, Body)):
        raise UsageError(f"{described(value)} cannot {verb}{_field_hint(value)}")
    return value


def _checked_value(value: Value) -> Value:
    """The value if it is one. The numbers in vectors and records were checked when made."""
    return value if isinstance(value, (Vector, Record, Body)) else scalar(value)


def _field_hint(value: Value) -> str:
    return (
        f": name one of its components, {_listed(value.fields)}"
        if isinstance(value, Record)
        else ""
    )


def _require_same_dimension(a: Vector, b: Vector) -> None:
    if len(_vector(a)) != len(_vector(b)):
        raise UsageError(f"{described(a)} and {described(b)} have different dimensions")


def _within_unit(x: Scalar) -> Scalar:
    if x.is_Rational and abs(x) > 1:
        raise UsageError("the arc sine and arc cosine of a constant need one within [-1, 1]")
    return x


def _within_exponential(x: Scalar) -> Scalar:
    if x.is_Rational and abs(x) > _MOST_MAGNITUDE_BITS:
        raise UsageError("the hyperbolic function of this constant is too large")
    return x


# ---------------------------------------------------------------- SymPy, kept within bounds


def _sum(terms: Sequence[Scalar]) -> Scalar:
    """Σ terms, a few at a time: pairwise is quadratic, and constants must stay short."""
    total = terms[0]
    for start in range(1, len(terms), _ADDED_AT_ONCE):
        total = _checked(sympy.Add(total, *terms[start : start + _ADDED_AT_ONCE]))
    return total


def _bits(rational: Scalar) -> int:
    return max(int(rational.p).bit_length(), int(rational.q).bit_length())


def _constant_power(base: Scalar, exponent: Scalar) -> Scalar:
    if base == 0 and exponent <= 0:
        raise UsageError("0 has positive powers only")
    if base in {0, 1}:
        return base
    if abs(exponent) * _bits(base) > MOST_BITS:
        raise UsageError("this power of a constant is too large or too small")
    if exponent.is_Integer:
        return _checked(sympy.Rational(Fraction(int(base.p), int(base.q)) ** int(exponent)))
    if base < 0:
        raise UsageError("a power of a negative constant that is not an integer is not real")
    root = _exact_root(base, int(exponent.q)) if exponent.q <= MOST_EXPONENT else None
    if root is not None:
        return _constant_power(root, sympy.Integer(exponent.p))
    return _decimal(sympy.Pow(base, exponent, evaluate=False))


def _exact_root(base: Scalar, index: int) -> Scalar | None:
    numerator, exact = sympy.integer_nthroot(int(base.p), index)
    denominator, also_exact = sympy.integer_nthroot(int(base.q), index)
    return sympy.Rational(numerator, denominator) if exact and also_exact else None


def _rational_power(base: Scalar, exponent: Scalar) -> Scalar:
    _require_small_exponent(exponent, base)
    if not exponent.is_Integer:
        coefficient, rest = base.as_coeff_Mul()
        if abs(coefficient) != 1:
            # SymPy would factorise the coefficient.
            signed = rest if coefficient > 0 else -rest
            return _checked(_constant_power(abs(coefficient), exponent) * power(signed, exponent))
        if isinstance(base, sympy.exp):
            return exp(multiply(exponent, base.exp))
        if base.is_Pow and base.exp.is_Rational:
            return _power_of_power(base, exponent)
    _require_small_combined_exponent(base, exponent)
    return _checked(sympy.Pow(base, exponent))


def _power_of_power(base: Scalar, exponent: Scalar) -> Scalar:
    """(uⁿ)^q for rational n and fractional q, where it is real: uⁿ^q, or |u|ⁿ^q for even n.

    SymPy would ask for arg(u).
    """
    combined = base.exp * exponent
    if not base.exp.is_even or combined.is_even:
        return power(base.base, combined)
    if _is_surely_real(base.base):
        return power(absolute(base.base), combined)
    if _profile(base.base).nesting > 2:
        raise UsageError("the root of a square, or the absolute value, of what may not be real")
    return _checked(sympy.Pow(sympy.Pow(base.base, 2), combined / 2))


def _is_surely_real(x: Scalar) -> bool:
    """Whether SymPy knows quickly that the expression is real: no roots, logarithms, quotients."""
    return _profile(x).real


def _require_small_combined_exponent(base: Scalar, exponent: Scalar) -> None:
    """(uⁿ)ᵛ may become uⁿᵛ at once."""
    inner, power_of_inner = base.as_base_exp()
    combined = power_of_inner * exponent
    _require_small_powers_of_logarithms(combined)
    if combined.is_Rational and inner is not sympy.E:
        _require_small_exponent(combined, inner)


def _require_small_exponent(exponent: Scalar, base: Scalar) -> None:
    if abs(exponent) > MOST_EXPONENT:
        raise UsageError(f"an exponent is at most {MOST_EXPONENT} in size")
    if base.is_Rational and abs(exponent) * _bits(base) > MOST_BITS:
        raise UsageError("this power of a constant is too large or too small")


def _require_small_powers_of_logarithms(x: Scalar) -> None:
    """exp(n log u) is uⁿ at once, so n must be as small as an exponent."""
    for term in sympy.Add.make_args(x):
        coefficient, rest = term.as_coeff_Mul()
        if isinstance(rest, sympy.log) and abs(coefficient) > MOST_EXPONENT:
            raise UsageError(f"an exponent is at most {MOST_EXPONENT} in size")


_ALLOWED = (
    *(sympy.Add, sympy.Mul, sympy.Pow, sympy.Symbol, sympy.Rational, sympy.NumberSymbol),
    *(sympy.exp, sympy.log, sympy.Abs, sympy.sign),
    *(sympy.sin, sympy.cos, sympy.tan, sympy.asin, sympy.acos, sympy.atan, sympy.atan2),
    *(sympy.sinh, sympy.cosh, sympy.tanh),
)


@dataclass(frozen=True)
class _Profile:
    """Nodes of an expression as a tree, and whether it is or holds an irrational constant."""

    size: int
    constant: bool
    irrational: bool
    real: bool = True
    nonnegative: bool = False
    nesting: int = 0


@lru_cache(maxsize=1 << 15)
def _profile(expression: Any) -> _Profile:
    if expression.is_Rational:
        if _bits(expression) > MOST_BITS:
            raise UsageError("a constant becomes too large, too small or too long")
        return _Profile(1, constant=True, irrational=False, nonnegative=bool(expression >= 0))
    if expression.is_Symbol:
        return _Profile(1, constant=False, irrational=False)
    if isinstance(expression, sympy.Float):
        raise UsageError(f"{expression} is a SymPy Float: give decimals as Rational or as text")
    if not isinstance(expression, _ALLOWED):
        raise UsageError("this is undefined or not real")
    parts = [_profile(argument) for argument in expression.args]
    constant = all(part.constant for part in parts)
    if expression.is_Pow and expression.base is not sympy.E:
        _require_small_exponent(expression.exp.as_coeff_Add()[0], expression.base)
    return _Profile(
        1 + sum(part.size for part in parts),
        constant,
        constant or any(part.irrational for part in parts),
        *_real_and_nonnegative(expression, parts),
        max((part.nesting for part in parts), default=0) + _hardness(expression),
    )


def _hardness(expression: Any) -> int:
    """How much a node adds to the depth to which SymPy has to ask for signs and zeros."""
    if expression.is_Pow and expression.exp.is_Integer:
        return 1 if expression.exp < 0 else 0
    if isinstance(expression, (sympy.sinh, sympy.cosh, sympy.tanh)):
        return _HYPERBOLIC_HARDNESS
    return int(not (expression.is_Add or expression.is_Mul))


def _real_and_nonnegative(expression: Any, parts: Sequence[_Profile]) -> tuple[bool, bool]:
    """Whether an expression is seen to be real wherever its symbols are, and not negative."""
    real = all(part.real for part in parts)
    nonnegative = all(part.nonnegative for part in parts)
    if expression.is_Add or expression.is_Mul:
        return real, nonnegative
    if isinstance(expression, (sympy.Abs, sympy.cosh, sympy.exp)):
        return real, real
    if expression.is_Pow:
        base = parts[0]
        if expression.exp.is_Integer:
            return real, real and (base.nonnegative or bool(expression.exp.is_even))
        return real and base.nonnegative, real and base.nonnegative
    if isinstance(expression, sympy.log):
        return nonnegative, False
    return real and not isinstance(expression, (sympy.tan, sympy.asin, sympy.acos)), False


def _checked(expression: Any) -> Scalar:
    """The expression if it is real, finite and short enough; constants in it become rational."""
    profile = _profile(expression)
    if profile.irrational:
        expression = _with_rational_constants(expression)
        profile = _profile(expression)
    if profile.size > MOST_WRITTEN_OUT:
        raise UsageError(f"the expression, written out, has more than {MOST_WRITTEN_OUT} parts")
    if profile.nesting > MOST_FUNCTIONS_NESTED:
        raise UsageError(
            f"functions, quotients and roots are nested more than {MOST_FUNCTIONS_NESTED} deep"
        )
    return expression


def _with_rational_constants(expression: Any) -> Any:
    if not _profile(expression).irrational:
        return expression
    arguments = [_with_rational_constants(argument) for argument in expression.args]
    rebuilt = expression.func(*arguments) if arguments else expression
    profile = _profile(rebuilt)
    if profile.constant and profile.irrational:
        return _decimal(rebuilt)
    if profile.irrational:
        raise UsageError("this combines constants in a way that cannot be evaluated")
    return rebuilt


def _decimal(constant: Any) -> Scalar:
    """One function of rational constants, to 60 digits.

    0 for a sine or cosine that vanishes at a multiple of π: `pi` has an error in its 60th digit.
    """
    value = constant.evalf(CONSTANT_DIGITS)
    if not isinstance(value, sympy.Float):
        raise UsageError("this is undefined or not real")
    _sign, mantissa, exponent, bits = value._mpf_
    if mantissa and abs(exponent + bits) > _MOST_MAGNITUDE_BITS:
        raise UsageError("a constant becomes too large or too small")
    if isinstance(constant, (sympy.sin, sympy.cos, sympy.tan)) and abs(constant.args[0]) > 1:
        noise = sympy.Rational(1, 10 ** (CONSTANT_DIGITS - 10))
        if abs(value) < noise:
            return sympy.Integer(0)
        if abs(value) > 1 / noise:
            raise UsageError("the tangent has a pole here")
    return sympy.Rational(str(value))


PI = sympy.Rational(str(sympy.pi.evalf(CONSTANT_DIGITS)))
"""π to 60 digits."""


# ---------------------------------------------------------------- text


def read_expression(text: str, vocabulary: Vocabulary, where: str) -> Value:
    """The value that the text means.

    `where` opens every error (`top.toml: interaction 2: potential`). UsageError for anything that
    is not in the language, names nothing, has no real value or is too large; nothing is executed.
    """
    reader = _Reader(text, where)
    steps = reader.steps()
    return _evaluated(steps, vocabulary, reader)


def read_number(text: str, vocabulary: Vocabulary, where: str) -> Scalar:
    """The number that the text means, as `read_expression`; UsageError for any other value."""
    value = read_expression(text, vocabulary, where)
    if not isinstance(value, sympy.Expr):
        hint = "; norm(v) is its length" if isinstance(value, Vector) else _field_hint(value)
        raise UsageError(f"{where}: expected a number, not {described(value)}{hint}")
    return value


def read_vector(text: str, vocabulary: Vocabulary, where: str, dimension: int) -> Vector:
    """The vector that the text means, as `read_expression`; UsageError for any other value."""
    value = read_expression(text, vocabulary, where)
    if not isinstance(value, Vector) or len(value) != dimension:
        shown = ", ".join(_AXES[:dimension])
        raise UsageError(
            f"{where}: expected a vector of {dimension}, [{shown}], not {described(value)}"
        )
    return value


_Kind: TypeAlias = Literal["number", "name", "sign", "end"]


class _Token(NamedTuple):
    kind: _Kind
    text: str
    start: int


@dataclass(frozen=True)
class _Step:
    """One step of the program that a text is: it takes `count` values and leaves one."""

    kind: Literal["number", "name", "call", "vector", "sum", "negative", "binary", "attribute"]
    token: _Token
    count: int = 0
    signs: str = ""


_NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_SIGN = re.compile(r"\*\*|[-+*/^()\[\],.]")
_OPENS = {"(": ")", "[": "]"}
_INSTEAD = {
    "·": "* or dot(a, b)",
    "×": "* or cross(a, b)",
    "−": "-",
    "÷": "/",
    "²": "^2",
    "³": "^3",
    "√": "sqrt(x)",
    "π": "pi",
    "½": "0.5",
    "|": "abs(x) or norm(v)",
}


class _Reader:
    """A text on its way to steps in postfix order; every count is bounded."""

    def __init__(self, text: str, where: str) -> None:
        if not isinstance(text, str):
            raise UsageError(f"{where}: expected an expression as text, not {described(text)}")
        if len(text) > MOST_CHARACTERS:
            raise UsageError(
                f"{where}: the expression has {len(text)} characters; at most {MOST_CHARACTERS}"
            )
        self.text, self.where = text, where
        self._tokens = self._split()
        self._at = 0
        self._nesting = self._nodes = 0
        self._steps: list[_Step] = []

    def refuse(self, token: _Token, problem: str) -> NoReturn:
        """Raise the error that says where the text is wrong, and shows the place >>so<<."""
        width = max(len(token.text), 1)
        start = max(0, token.start - _EXCERPT // 2)
        end = min(len(self.text), token.start + min(width, _EXCERPT // 2) + _EXCERPT // 2)
        stop = min(token.start + width, end)
        shown = (
            ("…" if start else "")
            + _printable(self.text[start : token.start])
            + f">>{_printable(self.text[token.start : stop])}<<"
            + _printable(self.text[stop:end])
            + ("…" if end < len(self.text) else "")
        )
        raise UsageError(f"{self.where}: column {token.start + 1} ({shown}): {problem}")

    def steps(self) -> list[_Step]:
        """The whole text as steps."""
        if self._next.kind == "end":
            self.refuse(self._next, "the expression is empty")
        self._sum()
        if self._at < len(self._tokens) - 1:
            self._refuse_next()
        return self._steps

    def _split(self) -> list[_Token]:
        tokens: list[_Token] = []
        at = 0
        while (at := _past_space(self.text, at)) < len(self.text):
            tokens.append(self._token(at))
            at += len(tokens[-1].text)
        return [*tokens, _Token("end", "", at)]

    def _token(self, at: int) -> _Token:
        patterns: tuple[tuple[_Kind, re.Pattern[str]], ...]
        patterns = (("number", _NUMBER), ("name", NAME), ("sign", _SIGN))
        for kind, pattern in patterns:
            if match := pattern.match(self.text, at):
                return _Token(kind, match.group(), at)
        return self._refuse_character(at)

    def _refuse_character(self, at: int) -> NoReturn:
        character = self.text[at]
        name = unicodedata.name(character, "a control character")
        hint = f"; write {_INSTEAD[character]}" if character in _INSTEAD else ""
        if not hint:
            hint = "; names are a letter a-z or A-Z, then letters, digits and _"
        self.refuse(
            _Token("sign", character, at),
            f"the character U+{ord(character):04X} ({name}) is not in the language{hint}",
        )

    def _refuse_nodes(self, token: _Token) -> NoReturn:
        self.refuse(token, f"the expression has more than {MOST_NODES} parts")

    @property
    def _next(self) -> _Token:
        return self._tokens[self._at]

    def _take(self) -> _Token:
        token = self._next
        self._at += 1
        return token

    def _is_next(self, *signs: str) -> bool:
        return self._next.kind == "sign" and self._next.text in signs

    def _emit(self, step: _Step) -> None:
        self._steps.append(step)
        self._nodes += len(step.signs) or 1
        if self._nodes > MOST_NODES:
            self._refuse_nodes(step.token)

    def _enter(self, token: _Token) -> None:
        self._nesting += 1
        if self._nesting > MOST_NESTING:
            self.refuse(token, f"the expression is nested more than {MOST_NESTING} deep")

    def _leave(self) -> None:
        self._nesting -= 1

    def _sum(self) -> None:
        first = self._next
        self._product()
        signs = "+"
        while self._is_next("+", "-"):
            first = first if len(signs) > 1 else self._next
            signs += self._take().text
            self._product()
        if len(signs) > 1:
            self._emit(_Step("sum", first, len(signs), signs))

    def _product(self) -> None:
        self._unary()
        while self._is_next("*", "/"):
            operator = self._take()
            self._unary()
            self._emit(_Step("binary", operator, 2))

    def _unary(self) -> None:
        if not self._is_next("+", "-"):
            self._power()
            return
        operator = self._take()
        self._enter(operator)
        self._unary()
        self._leave()
        if operator.text == "-":
            self._emit(_Step("negative", operator, 1))

    def _power(self) -> None:
        self._postfix()
        if self._is_next("^", "**"):
            operator = self._take()
            self._enter(operator)
            self._unary()
            self._leave()
            self._emit(_Step("binary", operator, 2))

    def _postfix(self) -> None:
        self._atom()
        while self._is_next("."):
            self._take()
            if self._next.kind != "name":
                self.refuse(self._next, "expected the name of a component after the point")
            self._emit(_Step("attribute", self._take(), 1))

    def _atom(self) -> None:
        token = self._take()
        if token.kind == "number":
            self._emit(_Step("number", token))
        elif token.kind == "name":
            if self._is_next("("):
                count = self._items(self._take())
                self._emit(_Step("call", token, count))
            else:
                self._emit(_Step("name", token))
        elif token.text == "(":
            self._enter(token)
            self._sum()
            self._close(token)
        elif token.text == "[":
            count = self._items(token)
            self._emit(_Step("vector", token, count))
        else:
            self._at -= 1
            self._refuse_missing()

    def _items(self, opening: _Token) -> int:
        """Expressions up to the closing bracket, and how many."""
        self._enter(opening)
        count = 0
        if not self._is_next(_OPENS[opening.text]):
            self._sum()
            count = 1
            while self._is_next(","):
                self._take()
                self._sum()
                count += 1
        self._close(opening)
        return count

    def _close(self, opening: _Token) -> None:
        closing = _OPENS[opening.text]
        if self._next.kind == "end":
            self.refuse(opening, f'this "{opening.text}" is not closed by "{closing}"')
        if not self._is_next(closing):
            self._refuse_next()
        self._take()
        self._leave()

    def _refuse_missing(self) -> NoReturn:
        token = self._next
        expected = "expected a number, a name, a vector or a bracket"
        if token.kind == "end":
            self.refuse(token, f"{expected}, but the expression ends")
        self.refuse(token, f'{expected}, not "{token.text}"')

    def _refuse_next(self) -> NoReturn:
        """Something follows a complete expression."""
        token = self._next
        if token.kind in {"number", "name"} or token.text in _OPENS:
            before = self._tokens[self._at - 1]
            self.refuse(
                token,
                f"expected an operator between {_quoted(before.text)} and {_quoted(token.text)};"
                " a product is written a*b",
            )
        if token.text == ",":
            self.refuse(token, 'a "," stands between arguments or components only')
        self.refuse(token, f'"{token.text}" is out of place')


def _evaluated(steps: list[_Step], vocabulary: Vocabulary, reader: _Reader) -> Value:
    stack: list[Value] = []
    for step in steps:
        values = stack[len(stack) - step.count :] if step.count else []
        del stack[len(stack) - step.count :]
        try:
            stack.append(_step_value(step, values, vocabulary))
        except UsageError as problem:
            reader.refuse(step.token, str(problem))
        except RecursionError:
            reader.refuse(step.token, "the expression is nested too deeply")
    return stack[0]


def _step_value(step: _Step, values: list[Value], vocabulary: Vocabulary) -> Value:
    match step.kind:
        case "number":
            return _literal(step.token.text)
        case "name":
            return _named(step.token.text, vocabulary)
        case "call":
            return _called(step.token.text, values, vocabulary)
        case "vector":
            for value in values:
                if not isinstance(value, sympy.Expr):
                    raise UsageError(f"a component is a number, not {described(value)}")
            return Vector(tuple(values))
        case "sum":
            signed = zip(step.signs, values, strict=True)
            return add(*(value if sign == "+" else negative(value) for sign, value in signed))
        case "negative":
            return negative(values[0])
        case "attribute":
            return attribute(values[0], step.token.text)
        case "binary":
            operation = {"*": multiply, "/": divide}.get(step.token.text, power)
            return operation(*values)


def _literal(text: str) -> Scalar:
    mantissa, _, exponent = text.lower().partition("e")
    if sum(character.isdigit() for character in mantissa) > MOST_DIGITS:
        raise UsageError(f"a number has at most {MOST_DIGITS} digits")
    if len(exponent) > MOST_DIGITS or abs(int(exponent or "0")) > MOST_DECIMAL_EXPONENT:
        raise UsageError(f"a decimal exponent is at most {MOST_DECIMAL_EXPONENT} in size")
    return scalar(Fraction(text.rstrip(".") if not exponent else text))


def _named(name: str, vocabulary: Vocabulary) -> Value:
    if name in vocabulary.values:
        return vocabulary.values[name]
    if name in vocabulary.bodies:
        return Body(name)
    if name == "pi":
        return PI
    functions = {**FUNCTIONS, **vocabulary.functions}
    if name in functions:
        raise UsageError(f"{name} is a function; write {functions[name].usage(name)}")
    names = [*vocabulary.values, *vocabulary.bodies, "pi"]
    raise UsageError(
        f"unknown name {_quoted(name)}; names are {_listed(names)}.{suggest(name, names)}"
    )


def _called(name: str, values: list[Value], vocabulary: Vocabulary) -> Value:
    functions = {**FUNCTIONS, **vocabulary.functions}
    if name in functions:
        return functions[name](name, values)
    if name in {*vocabulary.values, *vocabulary.bodies, "pi"}:
        raise UsageError(f"{name} is not a function; a product is written {name}*(…)")
    raise UsageError(
        f"unknown function {_quoted(name)}; functions are {_listed(sorted(functions))}."
        f"{suggest(name, functions)}"
    )


def _require_name(name: str) -> None:
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise UsageError(
            f"{_quoted(str(name))} is not a name: a letter a-z or A-Z, then letters, digits and _"
        )


def _past_space(text: str, at: int) -> int:
    while at < len(text) and text[at] in " \t\r\n":
        at += 1
    return at


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


def _quoted(text: str) -> str:
    shown = _printable(text)
    return f'"{shown}"' if len(shown) <= _EXCERPT else f'"{shown[:_EXCERPT]}…"'


def _listed(names: Mapping[str, Any] | Sequence[str]) -> str:
    every = list(names)
    shown = ", ".join(every[:_MOST_LISTED])
    return shown if len(every) <= _MOST_LISTED else f"{shown} and {len(every) - _MOST_LISTED} more"
