"""Recurrences for the Taylor coefficients of the solution of an ordinary differential equation.

A vector field given as a straight-line program becomes a list of nodes, each of them a function of
time whose coefficient of order k follows from coefficients computed before (Moore 1966; Griewank &
Walther 2008, §13): products are Cauchy sums, quotients, roots, powers and functions satisfy
differential equations of their own. Everything linear stays outside the sums: a value is a linear
form over nodes, and only what two of them multiply convolves.

Every sum has the same shape, Σ_{0<j<k} u_j v_{k−j} over coefficients of lower order only. These
are the lanes: a step of the recurrence computes all of them at once and then adds, node by node,
what the coefficients of order 0 and k contribute.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from hamotor.codegen.polynomial import Polynomial
from hamotor.codegen.program import (
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
    Sum,
    negative,
    polynomial_expression,
    sum_of_products,
)

Form = dict[int, Fraction]
"""Node → coefficient; node 0 is the constant 1."""
ONE = 0


class NotAnalytic(ValueError):
    """The field has no Taylor series everywhere; the argument names the function."""


@dataclass(frozen=True)
class Given:
    """The constant 1 (no name), or a variable whose coefficients the recurrence is for."""

    name: str


@dataclass(frozen=True)
class Combination:
    """A linear form that something else than its coefficients is needed of."""

    terms: tuple[tuple[int, Fraction], ...]


@dataclass(frozen=True)
class Times:
    """a b."""

    a: int
    b: int


@dataclass(frozen=True)
class Over:
    """A linear form over b."""

    terms: tuple[tuple[int, Fraction], ...]
    b: int


@dataclass(frozen=True)
class Root:
    """√a."""

    a: int


@dataclass(frozen=True)
class Power:
    """a^r."""

    a: int
    exponent: Fraction


@dataclass(frozen=True)
class Function:
    """f(a, …), with ḟ = Σ factor w ȧ."""

    name: str
    arguments: tuple[int, ...]
    slopes: tuple[tuple[Fraction, int, int], ...]
    """factor, w, a."""


Node = Given | Combination | Times | Over | Root | Power | Function


@dataclass(frozen=True)
class Row:
    """A node's coefficients c_j, or j c_j."""

    node: int
    slope: bool = False


@dataclass(frozen=True)
class Recurrence:
    """Coefficients of order k + 1 of the variables from those of order k and before."""

    nodes: tuple[Node, ...]
    """In the order in which the coefficients of one order are computed."""
    lanes: tuple[tuple[Row, Row], ...]
    """u and v of the sums Σ_{0<j<k} u_j v_{k−j}."""
    derivatives: tuple[tuple[str, Form], ...]
    """The variables and their derivatives."""

    @cached_property
    def variables(self) -> dict[str, int]:
        """The variables' nodes."""
        return {n.name: i for i, n in enumerate(self.nodes) if isinstance(n, Given) and n.name}

    @cached_property
    def constants(self) -> frozenset[int]:
        """Nodes without coefficients of order 1 or more."""
        return _constants(self.nodes, self.derivatives)

    def lane(self, u: Row, v: Row) -> int | None:
        """Where this sum is; None if it is zero."""
        return self._places.get((u, v))

    @cached_property
    def _places(self) -> dict[tuple[Row, Row], int]:
        places = {lane: k for k, lane in enumerate(self.lanes)}
        return places | {(v, u): k for (u, v), k in places.items()}

    # ------------------------------------------------------------ numbers

    def coefficients(
        self,
        values: Mapping[str, Any],
        order: int,
        functions: Mapping[str, Callable[..., Any]],
    ) -> dict[str, list[Any]]:
        """Coefficients of orders 0 … `order` of the variables, in numbers of any type.

        values: of the variables, at order 0. functions: by name, and `number` (from a Fraction).
        """
        number = functions["number"]
        c: list[list[Any]] = [[] for _ in self.nodes]
        state = dict(values)
        for k in range(order + 1):
            for i, node in enumerate(self.nodes):
                c[i].append(self._coefficient(node, i, k, c, state, functions))
            state = {
                name: sum((number(x) * c[n][k] for n, x in form.items()), number(Fraction(0)))
                / number(Fraction(k + 1))
                for name, form in self.derivatives
            }
        return {name: c[self.variables[name]] for name, _ in self.derivatives}

    @staticmethod
    def _coefficient(
        node: Node,
        own: int,
        k: int,
        c: list[list[Any]],
        state: Mapping[str, Any],
        functions: Mapping[str, Callable[..., Any]],
    ) -> Any:
        def number(x: Fraction | int) -> Any:
            return functions["number"](Fraction(x))

        def total(terms: Iterable[Any]) -> Any:
            return sum(terms, number(0))

        def inner(u: int, v: int) -> Any:
            return total(c[u][j] * c[v][k - j] for j in range(1, k))

        def inner_slope(u: int, v: int) -> Any:
            return total(number(j) * c[u][j] * c[v][k - j] for j in range(1, k))

        def form(terms: tuple[tuple[int, Fraction], ...]) -> Any:
            return total(number(x) * c[n][k] for n, x in terms)

        match node:
            case Given(""):
                return number(int(k == 0))
            case Given(name):
                return state[name]
            case Combination(terms):
                return form(terms)
            case Times(a, b) if k == 0:
                return c[a][0] * c[b][0]
            case Times(a, b):
                return inner(a, b) + c[a][0] * c[b][k] + c[a][k] * c[b][0]
            case Over(terms, b) if k == 0:
                return form(terms) / c[b][0]
            case Over(terms, b):
                return (form(terms) - inner(own, b) - c[own][0] * c[b][k]) / c[b][0]
            case Root(a) if k == 0:
                return functions["sqrt"](c[a][0])
            case Root(a):
                return (c[a][k] - inner(own, own)) / (number(2) * c[own][0])
            case Power(a, r) if k == 0:
                return _power(c[a][0], r, functions)
            case Power(a, r):
                rest = number(r) * inner_slope(a, own) - inner_slope(own, a)
                edge = number(r) * number(k) * c[a][k] * c[own][0]
                return (rest + edge) / (number(k) * c[a][0])
            case Function(name, arguments, _) if k == 0:
                return functions[name](*(c[a][0] for a in arguments))
            case Function(_, _, slopes):
                return total(
                    number(x) * (inner_slope(a, w) / number(k) + c[a][k] * c[w][0])
                    for x, w, a in slopes
                )


def _power(x: Any, exponent: Fraction, functions: Mapping[str, Callable[..., Any]]) -> Any:
    """x^r for r a multiple of ½."""
    whole = abs(exponent.numerator) // exponent.denominator
    value = functions["number"](Fraction(1))
    for _ in range(whole):
        value = value * x
    if exponent.denominator == 2:
        value = value * functions["sqrt"](x)
    return functions["number"](Fraction(1)) / value if exponent < 0 else value


# ---------------------------------------------------------------- from a program


def recurrence(field: Program) -> Recurrence:
    """The recurrence of ẋ = f(x): outputs of the program are named like the variables they are the
    derivatives of, and it reads nothing but variables.

    NotAnalytic where the field has no Taylor series.
    """
    return _Builder([name for name, _ in field.outputs]).build(field)


@dataclass(frozen=True)
class _Power:
    """(factor · base)^exponent."""

    base: int
    factor: Fraction
    exponent: Fraction

    def with_factor(self, factor: Fraction) -> tuple[Fraction, _Power] | None:
        """The same as a rational multiple of a power of another multiple of the base."""
        if factor == self.factor:
            return Fraction(1), self
        if self.exponent.denominator != 1:
            return None
        ratio: Fraction = (self.factor / factor) ** int(self.exponent)
        return ratio, _Power(self.base, factor, self.exponent)


class _Builder:
    """Nodes, each of them once."""

    def __init__(self, variables: Iterable[str]) -> None:
        self.nodes: list[Node] = []
        self.known: dict[Node, int] = {}
        self.powers: dict[int, _Power] = {}
        self.node(Given(""))
        self.forms = {name: {self.node(Given(name)): Fraction(1)} for name in variables}

    def build(self, field: Program) -> Recurrence:
        for name, expression in field.bindings:
            self.forms[name] = self.form(expression)
        derivatives = [(name, self.form(expression)) for name, expression in field.outputs]
        return _without_unused(self.nodes, derivatives)

    def node(self, node: Node) -> int:
        if node not in self.known:
            self.known[node] = len(self.nodes)
            self.nodes.append(node)
        return self.known[node]

    def form(self, x: Expression) -> Form:
        match x:
            case Name(text):
                return self.forms[text]
            case Number(value):
                return {ONE: Fraction(value)} if value else {}
            case Negative(a):
                return _scaled(self.form(a), Fraction(-1))
            case Sum(a, b):
                return _sum(self.form(a), self.form(b))
            case Product(a, b):
                return self.product(self.form(a), self.form(b))
            case MultiplyAdd(a, b, c):
                return _sum(self.product(self.form(a), self.form(b)), self.form(c))
            case Quotient(a, b):
                return self.quotient(self.form(a), self.form(b))
            case Call(function, arguments):
                return self.call(function, [self.form(a) for a in arguments])
            case Select():
                raise NotAnalytic("select")

    def exact(self, form: Form) -> int:
        """The form as one node."""
        if len(form) == 1:
            ((node, factor),) = form.items()
            if factor == 1:
                return node
        node = self.node(Combination(_terms(form)))
        factor, base = self.operand(form)
        if factor != 1:
            self.powers[node] = _Power(base, factor, Fraction(1))
        return node

    def operand(self, form: Form) -> tuple[Fraction, int]:
        """The form as a multiple of one node; forms that differ by a factor share it."""
        factor = form[min(form, key=lambda n: (n == ONE, n))]
        if len(form) == 1:
            return factor, next(iter(form))
        return factor, self.node(Combination(_terms(_scaled(form, 1 / factor))))

    def as_power(self, node: int) -> _Power:
        return self.powers.get(node, _Power(node, Fraction(1), Fraction(1)))

    def product(self, one: Form, other: Form) -> Form:
        if not one or not other:
            return {}
        if set(one) == {ONE}:
            return _scaled(other, one[ONE])
        if set(other) == {ONE}:
            return _scaled(one, other[ONE])
        (x, a), (y, b) = self.operand(one), self.operand(other)
        together = self.product_of_powers(self.as_power(a), self.as_power(b))
        if together is not None:
            return _scaled(together, x * y)
        node = self.node(Times(*sorted((a, b))))
        if a == b and a not in self.powers:
            self.powers[node] = _Power(a, Fraction(1), Fraction(2))
        return {node: x * y}

    def product_of_powers(self, one: _Power, other: _Power) -> Form | None:
        if one.base != other.base:
            return None
        factor = one.factor if one.exponent.denominator != 1 else other.factor
        first, second = one.with_factor(factor), other.with_factor(factor)
        if first is None or second is None:
            return None
        exponent = one.exponent + other.exponent
        form = self.power(_Power(one.base, factor, exponent))
        return None if form is None else _scaled(form, first[0] * second[0])

    def quotient(self, over: Form, under: Form) -> Form:
        if not under:
            raise ZeroDivisionError("a division by 0 in a vector field")
        if not over:
            return {}
        y, b = self.operand(under)
        over = _scaled(over, 1 / y)
        if b == ONE:
            return over
        below = self.as_power(b)
        inverse = self.power(_Power(below.base, below.factor, -below.exponent))
        if inverse is not None:
            return self.product(over, inverse)
        return {self.node(Over(_terms(over), b)): Fraction(1)}

    def power(self, power: _Power) -> Form | None:
        """None if it is no node of its own: whole powers are regular at 0."""
        if power.exponent == 0:
            return {ONE: Fraction(1)}
        if power.exponent == 1:
            return {power.base: power.factor}
        if power.exponent.denominator == 1:
            return None
        base = self.exact({power.base: power.factor})
        half = power.exponent == Fraction(1, 2)
        node = self.node(Root(base) if half else Power(base, power.exponent))
        self.powers[node] = power
        return {node: Fraction(1)}

    def root_of(self, form: Form, exponent: Fraction) -> Form:
        """The form to a power that is not whole."""
        base = self.as_power(self.exact(form))
        if base.exponent != 1:
            base = _Power(self.exact(form), Fraction(1), Fraction(1))
        found = self.power(_Power(base.base, base.factor, exponent))
        assert found is not None
        return found

    def call(self, name: str, arguments: list[Form]) -> Form:
        if name == "sqrt":
            return self.root_of(arguments[0], Fraction(1, 2))
        if name not in _SLOPES:
            raise NotAnalytic("abs" if name == "sign" else name)
        given = tuple(self.exact(form) for form in arguments)
        return {self.function(name, given): Fraction(1)}

    def function(self, name: str, given: tuple[int, ...]) -> int:
        for i, known in enumerate(self.nodes):
            if isinstance(known, Function) and (known.name, known.arguments) == (name, given):
                return i
        # Its derivative may hold the function itself: first its place, then what is there.
        own = len(self.nodes)
        self.nodes.append(Function(name, given, ()))
        slopes = tuple(
            (factor, node, a)
            for form, a in zip(_SLOPES[name](self, own, given), given, strict=True)
            for factor, node in [self.operand(form)]
        )
        self.nodes[own] = Function(name, given, slopes)
        return own

    def square(self, node: int) -> Form:
        """x²."""
        return self.product({node: Fraction(1)}, {node: Fraction(1)})

    def sphere(self, y: int, x: int) -> Form:
        """x² + y²."""
        return _sum(self.square(x), self.square(y))

    def one_plus(self, factor: int, node: int) -> Form:
        """1 ± x²."""
        return _sum({ONE: Fraction(1)}, _scaled(self.square(node), Fraction(factor)))

    def arc(self, factor: int, node: int) -> Form:
        """±1/√(1 − x²)."""
        return _scaled(self.root_of(self.one_plus(-1, node), Fraction(-1, 2)), Fraction(factor))

    def over(self, factor: int, node: int | None, under: Form) -> Form:
        """±x over something; 1 where there is no x."""
        return self.quotient({ONE if node is None else node: Fraction(factor)}, under)


def _itself(node: int, factor: int = 1) -> Form:
    return {node: Fraction(factor)}


_SLOPES: dict[str, Callable[[_Builder, int, tuple[int, ...]], tuple[Form, ...]]] = {
    "exp": lambda _builder, own, _: (_itself(own),),
    "log": lambda b, _, x: (b.over(1, None, _itself(x[0])),),
    "sin": lambda b, _, x: (_itself(b.function("cos", x)),),
    "cos": lambda b, _, x: (_itself(b.function("sin", x), -1),),
    "tan": lambda b, own, _: (b.one_plus(1, own),),
    "sinh": lambda b, _, x: (_itself(b.function("cosh", x)),),
    "cosh": lambda b, _, x: (_itself(b.function("sinh", x)),),
    "tanh": lambda b, own, _: (b.one_plus(-1, own),),
    "asin": lambda b, _, x: (b.arc(1, x[0]),),
    "acos": lambda b, _, x: (b.arc(-1, x[0]),),
    "atan": lambda b, _, x: (b.over(1, None, b.one_plus(1, x[0])),),
    "atan2": lambda b, _, x: (b.over(1, x[1], b.sphere(*x)), b.over(-1, x[0], b.sphere(*x))),
}
"""∂f/∂x for each argument of f, as forms; the node of f itself is the second parameter."""


def _terms(form: Form) -> tuple[tuple[int, Fraction], ...]:
    return tuple(sorted(form.items()))


def _scaled(form: Form, factor: Fraction) -> Form:
    return {node: factor * x for node, x in form.items()}


def _sum(one: Form, other: Form) -> Form:
    total = dict(one)
    for node, x in other.items():
        total[node] = total.get(node, Fraction(0)) + x
    return {node: x for node, x in total.items() if x}


def _read(node: Node) -> set[int]:
    """The nodes that a node's coefficients follow from."""
    match node:
        case Given():
            return set()
        case Combination(terms):
            return {n for n, _ in terms}
        case Times(a, b):
            return {a, b}
        case Over(terms, b):
            return {b, *(n for n, _ in terms)}
        case Root(a) | Power(a, _):
            return {a}
        case Function(_, arguments, slopes):
            return {*arguments, *(n for _, w, a in slopes for n in (w, a))}


def _sums(own: int, node: Node) -> list[tuple[Row, Row]]:
    """The lanes that a node's coefficients need."""
    match node:
        case Times(a, b):
            return [(Row(a), Row(b))]
        case Over(_, b):
            return [(Row(own), Row(b))]
        case Root():
            return [(Row(own), Row(own))]
        case Power(a, _):
            return [(Row(a, slope=True), Row(own)), (Row(own, slope=True), Row(a))]
        case Function(_, _, slopes):
            return [(Row(a, slope=True), Row(w)) for _, w, a in slopes]
        case _:
            return []


def _without_unused(nodes: list[Node], derivatives: list[tuple[str, Form]]) -> Recurrence:
    used = {ONE, *(n for _, form in derivatives for n in form)}
    used |= {i for i, node in enumerate(nodes) if isinstance(node, Given)}
    found = set(used)
    while found:
        found = {n for i in found for n in _read(nodes[i])} - used
        used |= found
    place = {old: new for new, old in enumerate(sorted(used))}

    def moved_terms(terms: Iterable[tuple[int, Fraction]]) -> tuple[tuple[int, Fraction], ...]:
        return tuple((place[n], x) for n, x in terms)

    def moved(node: Node) -> Node:
        match node:
            case Given():
                return node
            case Combination(terms):
                return Combination(moved_terms(terms))
            case Times(a, b):
                return Times(place[a], place[b])
            case Over(terms, b):
                return Over(moved_terms(terms), place[b])
            case Root(a):
                return Root(place[a])
            case Power(a, r):
                return Power(place[a], r)
            case Function(name, arguments, slopes):
                return Function(
                    name,
                    tuple(place[a] for a in arguments),
                    tuple((x, place[w], place[a]) for x, w, a in slopes),
                )

    kept = tuple(moved(nodes[i]) for i in sorted(used))
    forms = tuple((name, dict(moved_terms(form.items()))) for name, form in derivatives)
    constants = _constants(kept, forms)
    lanes: list[tuple[Row, Row]] = []
    for own, node in enumerate(kept):
        for u, v in _sums(own, node):
            known = (u, v) in lanes or (v, u) in lanes
            if not known and not {u.node, v.node} & constants:
                lanes.append((u, v))
    return Recurrence(kept, tuple(lanes), forms)


def _constants(nodes: Sequence[Node], derivatives: Iterable[tuple[str, Form]]) -> frozenset[int]:
    names = {"", *(name for name, form in derivatives if not form)}
    found: set[int] = set()
    for i, node in enumerate(nodes):
        if node.name in names if isinstance(node, Given) else _read(node) - {i} <= found:
            found.add(i)
    return frozenset(found)


# ---------------------------------------------------------------- as programs


@dataclass(frozen=True)
class Steps:
    """A recurrence as straight-line programs.

    first: from `x[i]`, the variables, to `known[i]` and `change[i]`, their derivatives.
    next: from the coefficients `x[i]` of order k, `sums[i]`, `known[i]`, k and `over_k` = 1/k to
        `change[i]` and the coefficients `u[i]` and `v[i]` of the lanes.
    known: how many numbers of order 0 the second needs.
    """

    first: Program
    next: Program
    known: int


def steps(r: Recurrence) -> Steps:
    """The programs of a recurrence."""
    return _Steps(r).programs()


class _Steps:
    def __init__(self, r: Recurrence) -> None:
        self.r = r
        self.places = {r.variables[name]: i for i, (name, _) in enumerate(r.derivatives)}
        self.known: dict[tuple[str, Expression], int] = {}

    def programs(self) -> Steps:
        r = self.r
        bound = [i for i, node in enumerate(r.nodes) if not isinstance(node, Given)]
        first = [(f"n{i}", self._value(r.nodes[i])) for i in bound]
        next_ = [(f"n{i}", self._coefficient(i, r.nodes[i])) for i in bound if i not in r.constants]
        rows = []
        for name, column in (("u", 0), ("v", 1)):
            for k, lane in enumerate(r.lanes):
                rows.append((f"{name}[{k}]", self._row(lane[column])))
        changes = [form for _, form in r.derivatives]
        known = [(f"known[{i}]", x) for (_, x), i in self.known.items()]
        at_0 = [(f"change[{i}]", self._form(f, order_0=True)) for i, f in enumerate(changes)]
        at_k = [(f"change[{i}]", self._form(f)) for i, f in enumerate(changes)]
        return Steps(
            Program((), tuple(first), (*known, *at_0), None).without_unused(),
            Program((), tuple(next_), (*rows, *at_k), None).without_unused(),
            len(known),
        )

    def _name(self, node: int) -> Name:
        return Name(f"x[{self.places[node]}]" if node in self.places else f"n{node}")

    def _of_order_0(self, what: str, x: Expression) -> Expression:
        """A number that is computed once."""
        place = self.known.setdefault((what, x), len(self.known))
        return Name(f"known[{place}]")

    def _at_0(self, node: int, factor: int = 1) -> Expression:
        if node == ONE:
            return Number(Fraction(factor))
        x = self._name(node)
        return self._of_order_0("value", x if factor == 1 else Product(Number(Fraction(factor)), x))

    def _row(self, row: Row) -> Expression:
        x = self._name(row.node)
        return Product(Name("k"), x) if row.slope else x

    def _sum(self, u: Row, v: Row) -> Expression | None:
        lane = self.r.lane(u, v)
        return None if lane is None else Name(f"sums[{lane}]")

    def _form(self, form: Form, *, order_0: bool = False) -> Expression:
        """The form over coefficients of one order."""
        terms: Polynomial = {}
        for node, x in form.items():
            if node == ONE and order_0:
                terms[()] = x
            elif node not in self.r.constants or order_0:
                terms[self._name(node).text,] = x
        return polynomial_expression(terms)

    def _value(self, node: Node) -> Expression:
        """At order 0."""
        match node:
            case Combination(terms):
                return self._form(dict(terms), order_0=True)
            case Times(a, b):
                return Product(self._name(a), self._name(b))
            case Over(terms, b):
                return Quotient(self._form(dict(terms), order_0=True), self._name(b))
            case Root(a):
                return Call("sqrt", (self._name(a),))
            case Power(a, r):
                return _power_expression(self._name(a), r)
            case Function(name, arguments, _):
                return Call(name, tuple(map(self._name, arguments)))
            case Given():
                raise ValueError(node)

    def _coefficient(self, own: int, node: Node) -> Expression:
        """At order k."""
        match node:
            case Combination(terms):
                return self._form(dict(terms))
            case Times(a, b):
                edges = [(a, b, 2)] if a == b else [(a, b, 1), (b, a, 1)]
                found = self._sum(Row(a), Row(b))
                return sum_of_products(
                    [
                        *([(found,)] if found else []),
                        *(
                            (self._at_0(left, factor), self._name(right))
                            for left, right, factor in edges
                            if right not in self.r.constants
                        ),
                    ]
                )
            case Over(terms, b):
                inverse = self._of_order_0("inverse", Quotient(Number(1), self._name(b)))
                total = [(self._form(dict(terms)),)] if set(dict(terms)) - self.r.constants else []
                rest: list[tuple[Expression, ...]] = [*total]
                if (found := self._sum(Row(own), Row(b))) is not None:
                    rest.append((negative(found),))
                if b not in self.r.constants:
                    rest.append((negative(self._at_0(own)), self._name(b)))
                return Product(inverse, sum_of_products(rest))
            case Root(a):
                half = self._of_order_0(
                    "inverse", Quotient(Number(Fraction(1, 2)), self._name(own))
                )
                found = self._sum(Row(own), Row(own))
                assert found is not None
                return Product(half, Sum(self._name(a), negative(found)))
            case Power(a, r):
                inverse = self._of_order_0("inverse", Quotient(Number(1), self._name(a)))
                slope = self._of_order_0(
                    "value", Product(Number(r), Quotient(self._name(own), self._name(a)))
                )
                up = self._sum(Row(a, slope=True), Row(own))
                down = self._sum(Row(own, slope=True), Row(a))
                assert up is not None
                assert down is not None
                inside = sum_of_products([(negative(down),), (Number(r), up)])
                return sum_of_products(
                    [(Product(Name("over_k"), inverse), inside), (slope, self._name(a))]
                )
            case Function(_, _, slopes):
                parts: list[tuple[Expression, ...]] = []
                for factor, w, a in slopes:
                    if a in self.r.constants:
                        continue
                    found = self._sum(Row(a, slope=True), Row(w))
                    terms_: list[tuple[Expression, ...]] = [(self._at_0(w), self._name(a))]
                    if found is not None:
                        terms_.append((Name("over_k"), found))
                    parts.append((Number(factor), sum_of_products(terms_)))
                return sum_of_products(parts)
            case Given():
                raise ValueError(node)


def _power_expression(x: Expression, exponent: Fraction) -> Expression:
    """x^r for r a multiple of ½."""
    factors = [x] * (abs(exponent.numerator) // 2)
    if exponent.denominator == 2:
        factors.append(Call("sqrt", (x,)))
    value = factors[0]
    for factor in factors[1:]:
        value = Product(value, factor)
    return Quotient(Number(1), value) if exponent < 0 else value


# ---------------------------------------------------------------- eight lanes


PACK = 8
"""Lanes of a pack."""
MOST_PACKS, MOST_PRODUCTS = 4, 32
"""Of coordinates, and of the packs of products: of more, permutations would take longest."""


@dataclass(frozen=True)
class PackedTerm:
    """Eight terms weight · x[left] · x[right], added to eight derivatives; linear ones have no
    left."""

    pack: int
    left: tuple[int, ...]
    right: tuple[int, ...]
    weights: tuple[Fraction, ...]


@dataclass(frozen=True)
class Quadratic:
    """ẋ = c + L x + Q(x, x) for variables in an order in which packs of derivatives are alike.

    order: the variables' places in the recurrence. products: of two functions of time; fixed: of
    one that is constant, on the left.
    """

    order: tuple[int, ...]
    products: tuple[PackedTerm, ...]
    fixed: tuple[PackedTerm, ...]
    linear: tuple[PackedTerm, ...]
    constants: tuple[Fraction, ...]

    @property
    def packs(self) -> int:
        """Of variables."""
        return -(-len(self.order) // PACK)


def quadratic(r: Recurrence) -> Quadratic | None:
    """The field as a quadratic one; None where it is none, or has too many terms for packs."""
    if len(r.derivatives) > MOST_PACKS * PACK:
        return None
    places = {r.variables[name]: i for i, (name, _) in enumerate(r.derivatives)}
    values: dict[int, _Quadratic] = {ONE: {(): Fraction(1)}}
    for i, node in enumerate(r.nodes):
        value = _as_quadratic(node, i, places, values)
        if value is None:
            return None
        values[i] = value
    fields = [_combined(form.items(), values) for _, form in r.derivatives]
    constant = {places[n] for n in r.constants if n in places}

    def varying(field: _Quadratic) -> int:
        return sum(len(m) == 2 and not constant & set(m) for m in field)

    order = sorted(range(len(fields)), key=lambda i: -varying(fields[i]))
    new = {old: i for i, old in enumerate(order)}
    rows: dict[str, list[list[tuple[Fraction, int, int]]]] = {
        kind: [[] for _ in order] for kind in ("products", "fixed", "linear")
    }
    constants = [Fraction(0)] * len(order)
    for old, field in enumerate(fields):
        for monomial, x in sorted(field.items()):
            at = new[old]
            if not monomial:
                constants[at] = x
            elif len(monomial) == 1:
                rows["linear"][at].append((x, 0, new[monomial[0]]))
            else:
                a, b = sorted(monomial, key=lambda i: i not in constant)
                kind = "fixed" if a in constant else "products"
                rows[kind][at].append((x, new[a], new[b]))
    terms = {kind: _packed(table) for kind, table in rows.items()}
    if len(terms["products"]) > MOST_PRODUCTS or len(terms["linear"]) > MOST_PRODUCTS:
        return None
    return Quadratic(
        tuple(order), terms["products"], terms["fixed"], terms["linear"], tuple(constants)
    )


_Quadratic = dict[tuple[int, ...], Fraction]
"""Places of variables, sorted → coefficient; of degree two at most."""


def _as_quadratic(
    node: Node, own: int, places: Mapping[int, int], values: Mapping[int, _Quadratic]
) -> _Quadratic | None:
    match node:
        case Given(name):
            return {(places[own],): Fraction(1)} if name else {(): Fraction(1)}
        case Combination(terms):
            return _combined(terms, values)
        case Times(a, b):
            product: _Quadratic = {}
            for one, x in values[a].items():
                for other, y in values[b].items():
                    monomial = tuple(sorted((*one, *other)))
                    product[monomial] = product.get(monomial, Fraction(0)) + x * y
            return product if max(map(len, product), default=0) <= 2 else None
        case _:
            return None


def _combined(
    terms: Iterable[tuple[int, Fraction]], values: Mapping[int, _Quadratic]
) -> _Quadratic:
    total: _Quadratic = {}
    for node, x in terms:
        for monomial, y in values[node].items():
            total[monomial] = total.get(monomial, Fraction(0)) + x * y
    return {monomial: x for monomial, x in total.items() if x}


def _packed(rows: list[list[tuple[Fraction, int, int]]]) -> tuple[PackedTerm, ...]:
    """The n-th terms of eight derivatives side by side, for every n."""
    found = []
    for pack in range(-(-len(rows) // PACK)):
        lanes = [*rows[PACK * pack : PACK * (pack + 1)]]
        lanes += [[]] * (PACK - len(lanes))
        for n in range(max(map(len, lanes))):
            # What has no weight reads what is read anyway.
            _, *read = next(lane[n] for lane in lanes if n < len(lane))
            terms = [lane[n] if n < len(lane) else (Fraction(0), *read) for lane in lanes]
            weights, left, right = zip(*terms, strict=True)
            found.append(PackedTerm(pack, left, right, weights))
    return tuple(found)
