"""SymPy expressions as straight-line programs, in the form that kernels are written in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

import sympy

from hamotor.codegen.program import (
    Call,
    Expression,
    Name,
    Number,
    Product,
    Program,
    Quotient,
    negative,
    sum_of_products,
)
from hamotor.mechanics.coordinates import Expr

SINE_RATIO = sympy.Function("sine_ratio", real=True)
"""(sin x)/x of x²."""
COSINE_LESS_ONE = sympy.Function("cosine_less_one", real=True)
"""cos x − 1 of x²."""
SINH_RATIO = sympy.Function("sinh_ratio", real=True)
"""(sinh x)/x of x²."""
COSH_LESS_ONE = sympy.Function("cosh_less_one", real=True)
"""cosh x − 1 of x²."""
FUNCTIONS = {
    sympy.exp: "exp",
    sympy.log: "log",
    sympy.sin: "sin",
    sympy.cos: "cos",
    sympy.tan: "tan",
    sympy.asin: "asin",
    sympy.acos: "acos",
    sympy.atan: "atan",
    sympy.atan2: "atan2",
    sympy.sinh: "sinh",
    sympy.cosh: "cosh",
    sympy.tanh: "tanh",
    sympy.Abs: "abs",
    sympy.sign: "sign",
    SINE_RATIO: "sine_ratio",
    COSINE_LESS_ONE: "cosine_less_one",
    SINH_RATIO: "sinh_ratio",
    COSH_LESS_ONE: "cosh_less_one",
}
"""The functions that a program may call, by the name the runtime has for them."""
MOST_MULTIPLICATIONS = 64
"""A whole exponent up to this is a product; beyond, exp and log."""


def straight_line(
    outputs: Mapping[str, Expr],
    names: Mapping[Expr, str],
    definitions: Sequence[tuple[Expr, str, Expr]] = (),
) -> Program:
    """A program for the outputs, common parts computed once.

    names: how the symbols that come from outside are written in C++.
    definitions: symbols with the name they are bound to and what they stand for, each in what
        stands before it; only those that the outputs need are computed.
    """
    definitions, outputs = _constants_folded(definitions, outputs)
    needed = _needed(outputs.values(), definitions)
    stages = [*((name, expression) for _, name, expression in needed), *outputs.items()]
    known = dict(names) | {symbol: name for symbol, name, _ in needed}
    shared, reduced = sympy.cse(
        [expression for _, expression in stages],
        symbols=sympy.numbered_symbols("_shared", real=True),
        order="none",
    )
    return _Scheduler(known, shared).program(
        dict(zip((name for name, _ in stages), reduced, strict=True)), set(outputs)
    )


def _constants_folded(
    definitions: Sequence[tuple[Expr, str, Expr]], outputs: Mapping[str, Expr]
) -> tuple[list[tuple[Expr, str, Expr]], dict[str, Expr]]:
    """Definitions that are plain numbers put in where they are used."""
    constants: dict[Expr, Expr] = {}
    kept = []
    for symbol, name, expression in definitions:
        value = _with(expression, constants)
        if value.is_Rational:
            constants[symbol] = value
        else:
            kept.append((symbol, name, value))
    return kept, {name: _with(x, constants) for name, x in outputs.items()}


def _with(expression: Expr, constants: Mapping[Expr, Expr]) -> Expr:
    held = {s: x for s, x in constants.items() if s in expression.free_symbols}
    return expression.subs(held) if held else expression


def _needed(
    wanted: Iterable[Expr], definitions: Sequence[tuple[Expr, str, Expr]]
) -> list[tuple[Expr, str, Expr]]:
    symbols = {s for expression in wanted for s in expression.free_symbols}
    kept = []
    for definition in reversed(definitions):
        if definition[0] in symbols:
            kept.append(definition)
            symbols |= definition[2].free_symbols
    return kept[::-1]


class _Scheduler:
    """Binds each shared expression right before its first use, under a name t1, t2, …."""

    def __init__(self, names: Mapping[Expr, str], shared: Sequence[tuple[Expr, Expr]]) -> None:
        self.names = dict(names)
        self.shared = dict(shared)
        self.bindings: list[tuple[str, Expression]] = []
        self.temporaries: dict[Expression, str] = {}

    def program(self, stages: Mapping[str, Expr], outputs: set[str]) -> Program:
        results = []
        for name, expression in stages.items():
            value = self.expression(expression)
            if name in outputs:
                results.append((name, value))
            else:
                self.bindings.append((name, value))
        return Program((), tuple(self.bindings), tuple(results), None)

    def bound(self, expression: Expression) -> Expression:
        """A name for the value, so that it may be used twice."""
        if isinstance(expression, Name | Number):
            return expression
        if expression not in self.temporaries:
            self.temporaries[expression] = f"t{len(self.temporaries) + 1}"
            self.bindings.append((self.temporaries[expression], expression))
        return Name(self.temporaries[expression])

    def expression(self, x: Expr) -> Expression:
        if x in self.names:
            return Name(self.names[x])
        if x in self.shared:
            value = self.bound(self.expression(self.shared[x]))
            if isinstance(value, Name):
                self.names[x] = value.text
            return value
        if x.is_Rational:
            return Number(Fraction(int(x.p), int(x.q)))
        if x is sympy.pi or x is sympy.E:
            return Number(Fraction(str(x.evalf(50))))
        if x.is_Add:
            return self._sum(x)
        if x.is_Mul:
            return self._product(x)
        if x.is_Pow:
            return self._power(x.base, x.exp)
        if type(x) in FUNCTIONS:
            return Call(FUNCTIONS[type(x)], tuple(self.expression(a) for a in x.args))
        raise ValueError(f"no C++ for {x}")

    def _sum(self, x: Expr) -> Expression:
        terms: list[tuple[Expression, ...]] = []
        by_size: dict[Expr, list[tuple[Expression, ...]]] = {}
        for term in sympy.Add.make_args(x):
            coefficient, rest = term.as_coeff_Mul()
            if rest == 1:
                terms.append((self.expression(coefficient),))
                continue
            factors = self._two_factors(rest, negate=bool(coefficient < 0))
            by_size.setdefault(abs(coefficient), []).append(factors)
        terms += by_size.pop(sympy.Integer(1), [])
        for size, group in by_size.items():
            scale = self.expression(size)
            if len(group) == 1 and len(group[0]) == 1:
                terms.append((scale, group[0][0]))
            else:
                terms.append((scale, sum_of_products(group)))
        if len(terms) == 1 and len(terms[0]) == 2:
            return Product(*terms[0])
        return sum_of_products(terms)

    def _two_factors(self, x: Expr, *, negate: bool) -> tuple[Expression, ...]:
        """The factors of a product, all but the last multiplied already."""
        value = self.expression(x)
        if isinstance(value, Product):
            return (negative(value.a) if negate else value.a), value.b
        return (negative(value) if negate else value,)

    def _product(self, x: Expr) -> Expression:
        coefficient, rest = x.as_coeff_Mul()
        above, below = [], []
        for factor in sympy.Mul.make_args(rest):
            if factor.is_Pow and factor.exp.is_Rational and factor.exp < 0:
                below.append(1 / factor)
            else:
                above.append(factor)
        negate = bool(coefficient < 0)
        size = abs(coefficient)
        factors = [self.expression(f) for f in above]
        if size != 1 or not above:
            factors.insert(0, self.expression(size))
        value = _times(factors)
        if negate:
            value = negative(value)
        if below:
            value = Quotient(value, _times([self.expression(f) for f in below]))
        return value

    def _power(self, base: Expr, exponent: Expr) -> Expression:
        if exponent.is_Rational and exponent < 0:
            return Quotient(Number(1), self.expression(1 / sympy.Pow(base, exponent)))
        if exponent.is_Integer and int(exponent) <= MOST_MULTIPLICATIONS:
            return self._whole_power(self.bound(self.expression(base)), int(exponent))
        if exponent.is_Rational and exponent.q == 2 and int(exponent.p) <= MOST_MULTIPLICATIONS:
            value = self.expression(base)
            if exponent.p == 1:
                return Call("sqrt", (value,))
            root = Call("sqrt", (self.bound(value),))
            return Product(self._whole_power(self.bound(value), int(exponent.p) // 2), root)
        if base is sympy.E:
            return Call("exp", (self.expression(exponent),))
        power = Product(self.expression(exponent), Call("log", (self.expression(base),)))
        return Call("exp", (power,))

    def _whole_power(self, base: Expression, exponent: int) -> Expression:
        if exponent == 1:
            return base
        half = self.bound(self._whole_power(base, exponent // 2)) if exponent > 3 else base
        square = Product(half, half)
        return Product(square, base) if exponent % 2 else square


def _times(factors: list[Expression]) -> Expression:
    value = factors[0]
    for factor in factors[1:]:
        value = Product(value, factor)
    return value
