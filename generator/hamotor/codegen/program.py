"""Straight-line programs: what a kernel computes, operation by operation.

Everything that is known about cost and meaning is read off this value: operation counts, the C++
text, the polynomial it stands for (`expand`) and numbers in any arithmetic (`evaluate`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from hamotor.codegen.algebra import Rational, magnitude
from hamotor.codegen.element import Element
from hamotor.codegen.polynomial import Polynomial, add_scaled, scaled, times


@dataclass(frozen=True)
class Name:
    """A component of a parameter (`m.e12`) or an earlier binding."""

    text: str


@dataclass(frozen=True)
class Number:
    """An exact rational constant."""

    value: Rational


@dataclass(frozen=True)
class Negative:
    """−x; free, since every multiply-add exists in a negated form."""

    x: Expression


@dataclass(frozen=True)
class Sum:
    """a + b."""

    a: Expression
    b: Expression


@dataclass(frozen=True)
class Product:
    """a b."""

    a: Expression
    b: Expression


@dataclass(frozen=True)
class MultiplyAdd:
    """a b + c, in one rounding where the hardware has it."""

    a: Expression
    b: Expression
    c: Expression


@dataclass(frozen=True)
class Accumulation(MultiplyAdd):
    """a b + c where c is a sum that goes on: in its order, whatever the length of the chain."""


@dataclass(frozen=True)
class Quotient:
    """a / b."""

    a: Expression
    b: Expression


@dataclass(frozen=True)
class Call:
    """A function of scalars: sqrt, sin, cos, atan2, … or one of the runtime's own."""

    function: str
    arguments: tuple[Expression, ...]


@dataclass(frozen=True)
class Select:
    """`positive if x > 0 else otherwise`, lane by lane."""

    x: Expression
    positive: Expression
    otherwise: Expression


Expression = Name | Number | Negative | Sum | Product | MultiplyAdd | Quotient | Call | Select


def children(expression: Expression) -> tuple[Expression, ...]:
    """The operands of an expression."""
    match expression:
        case Name() | Number():
            return ()
        case Negative(x):
            return (x,)
        case Sum(a, b) | Product(a, b) | Quotient(a, b):
            return (a, b)
        case MultiplyAdd(a, b, c):
            return (a, b, c)
        case Call(_, arguments):
            return arguments
        case Select(x, positive, otherwise):
            return (x, positive, otherwise)


def replace_children(expression: Expression, operands: Iterable[Expression]) -> Expression:
    """The same operation of other operands, in the order of `children`."""
    match expression:
        case Name() | Number():
            return expression
        case Call(function, _):
            return Call(function, tuple(operands))
        case _:
            return type(expression)(*operands)


@dataclass(frozen=True)
class Cost:
    """Operations by kind.  A multiply-add counts as one multiplication and one addition."""

    mul: int = 0
    add: int = 0
    fused: int = 0
    div: int = 0
    calls: Mapping[str, int] = field(default_factory=dict)

    def __add__(self, other: Cost) -> Cost:
        """Total of two costs."""
        names = sorted({*self.calls, *other.calls})
        return Cost(
            self.mul + other.mul,
            self.add + other.add,
            self.fused + other.fused,
            self.div + other.div,
            {n: self.calls.get(n, 0) + other.calls.get(n, 0) for n in names},
        )

    @property
    def total(self) -> int:
        """Multiplications, additions and divisions together."""
        return self.mul + self.add + self.div

    @property
    def instructions(self) -> int:
        """The same where a multiply-add is one."""
        return self.total - self.fused

    def __str__(self) -> str:
        """For a header: `48 mul, 40 add (40 fused)`."""
        parts = [f"{self.mul} mul", f"{self.add} add"]
        if self.fused:
            parts[-1] += f" ({self.fused} fused)"
        if self.div:
            parts.append(f"{self.div} div")
        parts += [f"{count} {name}" for name, count in sorted(self.calls.items())]
        return ", ".join(parts)

    def as_data(self) -> dict[str, int]:
        """For the index of kernels."""
        return {"mul": self.mul, "add": self.add, "fused": self.fused, "div": self.div} | dict(
            sorted(self.calls.items())
        )


@dataclass(frozen=True)
class Parameter:
    """A named argument of a kernel."""

    name: str
    element: Element


@dataclass(frozen=True)
class Program:
    """Bindings in order, then one expression per component of the result.

    result None: the program returns one scalar, under the output name `value`.
    """

    parameters: tuple[Parameter, ...]
    bindings: tuple[tuple[str, Expression], ...]
    outputs: tuple[tuple[str, Expression], ...]
    result: Element | None

    @cached_property
    def cost(self) -> Cost:
        """Operation count by kind."""
        found = Counter(
            node.function if isinstance(node, Call) else type(node) for node in self.nodes()
        )
        exactly_fused = found.pop("fma", 0)
        calls = {kind: n for kind, n in found.items() if isinstance(kind, str)}
        if selects := found[Select]:
            calls["select"] = selects
        both = found[MultiplyAdd] + found[Accumulation] + exactly_fused
        split = sum(_split_sums(x) for _, x in (*self.bindings, *self.outputs))
        return Cost(
            mul=found[Product] + both,
            add=found[Sum] + both,
            fused=both - split,
            div=found[Quotient],
            calls=dict(sorted(calls.items())),
        )

    def without_unused(self) -> Program:
        """The same outputs without the bindings that they do not need."""
        needed: set[str] = set()
        kept: list[tuple[str, Expression]] = []

        def read(expression: Expression) -> None:
            for node in walk(expression):
                if isinstance(node, Name):
                    needed.add(node.text.split(".")[0])

        for _, expression in self.outputs:
            read(expression)
        for name, expression in reversed(self.bindings):
            if name in needed:
                kept.append((name, expression))
                read(expression)
        return replace(self, bindings=tuple(reversed(kept)))

    def nodes(self) -> Iterator[Expression]:
        """Every expression in the program."""
        for _, expression in (*self.bindings, *self.outputs):
            yield from walk(expression)

    def expand(self) -> dict[str, Polynomial]:
        """The polynomials in the parameters that the outputs stand for.

        Raises ValueError if the program is not polynomial.
        """
        known: dict[str, Polynomial] = {}
        for name, expression in self.bindings:
            known[name] = _expand(expression, known)
        return {name: _expand(expression, known) for name, expression in self.outputs}

    def evaluate(
        self, values: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]]
    ) -> dict[str, Any]:
        """Run the program on numbers of any type.

        values:    `parameter.component` → number.
        functions: the scalar functions by name, and `number` (from a Fraction).
        """
        known = dict(values)
        for name, expression in self.bindings:
            known[name] = _evaluate(expression, known, functions)
        return {name: _evaluate(e, known, functions) for name, e in self.outputs}


@dataclass(frozen=True)
class Shortcut:
    """A shorter program that is as accurate as another where all outputs of `where` are positive.

    All three have the same parameters, `program` has the other's result.
    """

    where: Program
    program: Program


def renamed(program: Program, names: Mapping[str, str]) -> Program:
    """The same program with other names for what it reads and gives."""

    def other(x: Expression) -> Expression:
        if isinstance(x, Name):
            return Name(names.get(x.text, x.text))
        return replace_children(x, map(other, children(x)))

    return replace(
        program,
        bindings=tuple((name, other(x)) for name, x in program.bindings),
        outputs=tuple((names.get(name, name), other(x)) for name, x in program.outputs),
    )


def walk(expression: Expression) -> Iterator[Expression]:
    """The expression and everything below it, in the order of reading."""
    rest = [expression]
    while rest:
        node = rest.pop()
        yield node
        rest += reversed(children(node))


def _split_sums(expression: Expression, inside: bool = False) -> int:
    """How many sums `dot` adds to each other without fusing.

    Chains of four products or more are two sums, of nine or more four (runtime, scalar.hpp).
    inside: the expression is the rest of a longer chain.
    """
    found = 0
    if type(expression) is MultiplyAdd and not inside:
        products = 0
        rest: Expression = expression
        while isinstance(rest, MultiplyAdd):
            products += 1
            rest = rest.c
        products += isinstance(rest, Product)
        found = 3 if products >= 9 else int(products >= 4)
    for child in children(expression):
        in_chain = isinstance(expression, MultiplyAdd) and child is expression.c
        found += _split_sums(child, in_chain)
    return found


def one_level(expression: Expression) -> Polynomial:
    """The polynomial in the names that an expression reads.  ValueError where it is none."""
    return _expand(expression, {})


def _expand(expression: Expression, known: Mapping[str, Polynomial]) -> Polynomial:
    match expression:
        case Name(text):
            return dict(known[text]) if text in known else {(text,): 1}
        case Number(value):
            return {(): value} if value else {}
        case Negative(x):
            return scaled(_expand(x, known), -1)
        case Sum(a, b):
            total = _expand(a, known)
            add_scaled(total, _expand(b, known), 1)
            return total
        case Product(a, b):
            return times(_expand(a, known), _expand(b, known))
        case MultiplyAdd(a, b, c):
            total = _expand(c, known)
            add_scaled(total, times(_expand(a, known), _expand(b, known)), 1)
            return total
        case Call("compensated_sum", arguments):
            total = {}
            for x in arguments:
                add_scaled(total, _expand(x, known), 1)
            return total
        case Call("compensated_dot", arguments):
            total = {}
            for a, b in zip(arguments[::2], arguments[1::2], strict=True):
                add_scaled(total, times(_expand(a, known), _expand(b, known)), 1)
            return total
        case _:
            raise ValueError(f"not a polynomial: {expression}")


def _evaluate(
    expression: Expression, known: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]]
) -> Any:
    if isinstance(expression, Name):
        if expression.text in known:
            return known[expression.text]
        binding, _, field_name = expression.text.partition(".")
        return getattr(known[binding], field_name)
    if isinstance(expression, Number):
        return functions["number"](expression.value)
    operands = [_evaluate(child, known, functions) for child in children(expression)]
    match expression:
        case Negative():
            return -operands[0]
        case Sum():
            return operands[0] + operands[1]
        case Product():
            return operands[0] * operands[1]
        case MultiplyAdd():
            return operands[0] * operands[1] + operands[2]
        case Quotient():
            return operands[0] / operands[1]
        case Select():
            return operands[1] if operands[0] > 0 else operands[2]
        case Call(function, _):
            return functions[function](*operands)


# ---------------------------------------------------------------- building expressions


def number(value: Rational) -> Number:
    """An exact constant."""
    return Number(value)


def negative(x: Expression) -> Expression:
    """−x, folding double signs and constants."""
    match x:
        case Negative(inner):
            return inner
        case Number(value):
            return Number(-value)
        case Product(a, Negative(b)):
            return Product(a, b)
        case Product(Negative(a), b):
            return Product(a, b)
        case _:
            return Negative(x)


def opposite(x: Expression) -> Expression:
    """−x for a result, with the sign inside a chain of multiply-adds, where it costs nothing.

    From outside, g++ 12 moves it there by itself, where numbers are alone and not in lanes, and a
    sum that cancels is then a zero of the other sign.
    """
    match x:
        case MultiplyAdd(a, b, c):
            a, b = _opposite_factors(a, b)
            return replace(x, a=a, b=b, c=opposite(c))
        case Product(a, b):
            return Product(*_opposite_factors(a, b))
        case _:
            return negative(x)


def _opposite_factors(a: Expression, b: Expression) -> tuple[Expression, Expression]:
    return (a, b.x) if isinstance(b, Negative) else (negative(a), b)


def sum_of_products(terms: list[tuple[Expression, ...]]) -> Expression:
    """Σ of products of one or two factors, as one chain of multiply-adds in the given order.

    Terms of one factor go first, so that every product can be fused onto them.
    """
    single = [t[0] for t in terms if len(t) == 1]
    double = [t for t in terms if len(t) == 2]
    if single:
        total = single[0]
        for x in single[1:]:
            total = Sum(total, x)
    elif double:
        a, b = double.pop(0)
        total = Product(a, b)
    else:
        return number(0)
    for a, b in double:
        total = MultiplyAdd(a, b, total)
    return total


def accumulated(start: Expression, polynomial: Polynomial) -> Expression:
    """start + Σ, in one chain of multiply-adds: what is added before what is subtracted, so that no
    factor's sign is changed.  ValueError where coefficients are not ±1 or terms no products."""
    total = start
    for sign in (1, -1):
        for monomial, coefficient in polynomial.items():
            if len(monomial) != 2 or abs(coefficient) != 1:
                raise ValueError(f"{coefficient} {monomial} is no product of two")
            if coefficient == sign:
                a, b = map(Name, monomial)
                total = Accumulation(a if sign > 0 else Negative(a), b, total)
    return total


def polynomial_expression(polynomial: Polynomial) -> Expression:
    """An expression for a polynomial of degree at most two in each term.

    Terms keep their order; coefficients of equal size are taken out of the sum.
    """
    if not polynomial:
        return number(0)
    groups: dict[Rational, list[tuple[Expression, ...]]] = {}
    for monomial, coefficient in polynomial.items():
        factors: list[Expression] = [Name(text) for text in monomial]
        size = magnitude(coefficient)
        if not factors:
            groups.setdefault(1, []).append((Number(coefficient),))
            continue
        if coefficient < 0:
            factors[0] = negative(factors[0])
        if len(factors) > 2:
            raise ValueError(f"a term has more than two factors: {monomial}")
        groups.setdefault(size, []).append(tuple(factors))
    unscaled = groups.pop(1, [])
    terms = [*((Number(size), sum_of_products(group)) for size, group in groups.items())]
    if not unscaled and len(terms) == 1:
        return Product(*terms[0])
    return sum_of_products([*unscaled, *terms])


def number_expression(polynomial: Polynomial) -> Expression:
    """An expression for a polynomial of degree two, none of whose products is rounded often.

    At most four times, so that the error is at most 2 ε Σ|terms|; `dot` rounds the first of seven
    to twelve products five times.  For results of one number, beside which no larger one stands.
    """
    if len(polynomial) <= 6:
        return polynomial_expression(polynomial)
    groups: dict[Rational, list[Polynomial]] = {}
    for monomial, coefficient in polynomial.items():
        pieces = groups.setdefault(magnitude(coefficient), [{}])
        if len(pieces[-1]) == 4:
            pieces.append({})
        pieces[-1][monomial] = coefficient
    sums = [polynomial_expression(piece) for pieces in groups.values() for piece in pieces]
    return Sum(*sums) if len(sums) == 2 else Call("compensated_sum", tuple(sums))


def factors_of(polynomial: Polynomial) -> tuple[Expression, ...]:
    """The factors of its terms of degree 0 and 2, two by two, as arguments of `compensated_dot`."""
    factors: list[Expression] = []
    for monomial, x in sorted(polynomial.items(), key=lambda term: len(term[0])):
        if not monomial:
            factors += [number(x), number(1)]
            continue
        a, b = (Name(text) for text in monomial)
        size = magnitude(x)
        first: Expression = a if size == 1 else Product(number(size), a)
        factors += [first if x > 0 else negative(first), b]
    return tuple(factors)
