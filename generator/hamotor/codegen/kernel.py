"""Kernels that are polynomial in their arguments: what they mean, exactly, and how to compute it.

A `Kernel` carries its meaning (one exact polynomial per component of the result, derived from the
algebra alone) and a `Program`.  `proved` expands the program and compares: a kernel whose program
does not mean what the algebra says cannot leave this module.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, partial

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import (
    Algebra,
    Blade,
    Multivector,
    Rational,
    magnitude,
    ratio,
    reverse_sign,
)
from hamotor.codegen.cyclic import Turn
from hamotor.codegen.element import Element
from hamotor.codegen.nullsplit import SplitProduct, hyperbolic_pairs, split_products, split_program
from hamotor.codegen.polynomial import Polynomial, PolynomialMultivector
from hamotor.codegen.program import (
    Expression,
    MultiplyAdd,
    Name,
    Parameter,
    Product,
    Program,
    Shortcut,
    Sum,
    number,
    number_expression,
    polynomial_expression,
)

ONE: Polynomial = {(): 1}
BladeProduct = Callable[[Blade, Blade], Multivector]


@dataclass(frozen=True)
class Kernel:
    """One function of the generated library.

    name:     C++ function name; law: what it computes, in formulas, for its documentation.
    program:  for every input; shortcut: for most, where there is a shorter one.
    meaning:  component → polynomial in `parameter.component`; None for transcendental kernels.
    turn:     what leaves the program as it is, where it is written in vectors of three.
    pairs:    (kept, possible) products of components, the sparsity of a bilinear kernel.
    """

    name: str
    law: str
    program: Program
    meaning: Mapping[str, Polynomial] | None
    namespace: str = ""
    pairs: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()
    shortcut: Shortcut | None = None
    turn: Turn | None = None

    @property
    def operands(self) -> tuple[Element, ...]:
        """Element types of the arguments."""
        return tuple(p.element for p in self.program.parameters)


def parameters_for(*elements: Element) -> tuple[Parameter, ...]:
    """Parameters named by their types' symbols; equal symbols become a, b."""
    symbols = [element.symbol for element in elements]
    if len(set(symbols)) < len(symbols):
        symbols = ["a", "b", "c", "d"][: len(symbols)]
    return tuple(Parameter(s, e) for s, e in zip(symbols, elements, strict=True))


def value_of(parameter: Parameter) -> PolynomialMultivector:
    """The multivector that a parameter stands for."""
    element = parameter.element
    result: PolynomialMultivector = {b: {(): x} for b, x in element.fixed.items()}
    for component in element.components:
        for blade, x in component.embedding.items():
            poly.add_term(result.setdefault(blade, {}), (f"{parameter.name}.{component.name}",), x)
    return result


def read_off(value: Mapping[Blade, Polynomial], element: Element) -> dict[str, Polynomial]:
    """The components of a multivector in an element type."""
    result: dict[str, Polynomial] = {}
    for component, functional in zip(element.components, element.reading, strict=True):
        total: Polynomial = {}
        for blade, x in functional.items():
            if blade in value:
                poly.add_scaled(total, value[blade], x)
        result[component.name] = total
    return result


def reversed_value(value: Mapping[Blade, Polynomial]) -> PolynomialMultivector:
    """Reversal ~ of a multivector."""
    return {b: poly.scaled(p, reverse_sign(b)) for b, p in value.items()}


def direct_program(
    parameters: tuple[Parameter, ...], meaning: Mapping[str, Polynomial], result: Element | None
) -> Program:
    """The program that evaluates each polynomial as it stands."""
    expression = number_expression if len(meaning) == 1 else polynomial_expression
    outputs = tuple((name, expression(p)) for name, p in meaning.items())
    return Program(parameters, (), outputs, result)


def proved(kernel: Kernel) -> Kernel:
    """The kernel itself, after its program has been expanded and found equal to its meaning."""
    if kernel.meaning is not None and kernel.program.expand() != kernel.meaning:
        raise AssertionError(f"{kernel.name}: the program does not expand to its definition")
    return kernel


def product_kernel(
    algebra: Algebra,
    name: str,
    law: str,
    product: Callable[[Blade, Blade], Multivector],
    left: Element,
    right: Element,
    result: Element,
    namespace: str = "",
    factor: Rational = 1,
) -> Kernel:
    """A bilinear product, read off in `result`; `factor` multiplies it."""
    a, b = parameters_for(left, right)
    value = poly.apply_bilinear(product, value_of(a), value_of(b))
    late = _translating(algebra, value_of(b))
    meaning = {n: _last(poly.scaled(p, factor), late) for n, p in read_off(value, result).items()}
    kept = {m for p in meaning.values() for m in p}
    pairs = (len(kept), (len(a.element.blades)) * (len(b.element.blades)))
    program = direct_program((a, b), meaning, result)
    for pair in hyperbolic_pairs(algebra):
        operands = ((a, value_of(a)), (b, value_of(b)))
        split = split_program(algebra, pair, product, operands, result, factor)
        if split is not None and split.cost.total < program.cost.total:
            program = split
    for operand in (a, b):
        scaled = _operand_scaled(operand, (a, b), meaning, result)
        if scaled is not None and scaled.cost.total <= program.cost.total:
            program = scaled
    return proved(Kernel(name, law, program, meaning, namespace, pairs))


def _last(polynomial: Polynomial, names: frozenset[str]) -> Polynomial:
    """The same terms, those with one of the names last.

    Of a motor the translation is computed last, and where it is the next product's second operand,
    fewer additions then wait for it.
    """
    return {m: polynomial[m] for m in sorted(polynomial, key=lambda m: not names.isdisjoint(m))}


def _operand_scaled(
    operand: Parameter,
    parameters: tuple[Parameter, ...],
    meaning: Mapping[str, Polynomial],
    result: Element,
) -> Program | None:
    """The product with a power of two that all components share taken into an operand: exact, and
    no component of the result waits for it.

    None where they share none, or a term has no component of the operand.
    """
    sizes = {magnitude(poly.content(p)) for p in meaning.values() if p}
    if len(sizes) != 1 or sizes == {1} or not _is_power_of_two(size := sizes.pop()):
        return None
    names, bindings = multiples(value_of(operand), size)
    if not all(any(x in names for x in m) for p in meaning.values() for m in p):
        return None
    values: dict[str, Polynomial] = {x: {(y,): ratio(1, size)} for x, y in names.items()}
    outputs = {n: poly.substituted(p, values) for n, p in meaning.items()}
    direct = direct_program(parameters, outputs, result)
    return replace(direct, bindings=bindings).without_unused()


def _is_power_of_two(x: Rational) -> bool:
    return x > 0 and all(n & (n - 1) == 0 for n in (x.numerator, x.denominator))


def multiples(
    value: PolynomialMultivector, factor: Rational
) -> tuple[dict[str, str], tuple[tuple[str, Expression], ...]]:
    """Names for the multiples of a value's components, by component, and what binds them."""
    prefix = {2: "twice", Fraction(1, 2): "half"}.get(factor, "scaled")
    components = dict.fromkeys(x for p in value.values() for monomial in p for x in monomial)
    names = {x: f"{prefix}_{x.rpartition('.')[2]}" for x in components}
    return names, tuple((y, Product(number(factor), Name(x))) for x, y in names.items())


def linear_kernel(
    name: str,
    law: str,
    transform: Callable[[PolynomialMultivector], PolynomialMultivector],
    operand: Element,
    result: Element,
    namespace: str = "",
) -> Kernel:
    """A linear map of one argument, such as reversal or a grade projection."""
    (a,) = parameters_for(operand)
    meaning = read_off(transform(value_of(a)), result)
    return proved(Kernel(name, law, direct_program((a,), meaning, result), meaning, namespace))


def quadratic_kernel(
    algebra: Algebra, name: str, law: str, operand: Element, result: Element
) -> Kernel:
    """The norm <A ~A> read off in `result`."""
    (a,) = parameters_for(operand)
    value = value_of(a)
    square = poly.apply_bilinear(algebra.geometric, value, reversed_value(value))
    meaning = read_off(square, result)
    return proved(Kernel(name, law, direct_program((a,), meaning, result), meaning))


class Staging:
    """Bindings of a program under construction: each holds the primitive part of a polynomial.

    unbounded: names beside which all others may be small, such as what translates in a unit versor.
    """

    def __init__(self, unbounded: frozenset[str] = frozenset()) -> None:
        """Start without bindings."""
        self.bindings: list[tuple[str, Expression]] = []
        self.meaning: dict[str, Polynomial] = {}
        self._unbounded = unbounded
        self._behind: dict[str, list[tuple[int, int]]] = {}

    def bind(self, name: str, polynomial: Polynomial) -> Polynomial:
        """Give a polynomial a name; returns the (scaled) name, to be used in its place."""
        if not polynomial:
            return {}
        if len(polynomial) == 1 and len(next(iter(polynomial))) <= 1:
            return polynomial
        content = poly.content(polynomial)
        primitive = self.in_order(poly.scaled(polynomial, ratio(1, content)))
        self.bindings.append((name, _single_last(primitive)))
        self.meaning[name] = primitive
        self._behind[name] = [
            (count, sum(x in self._unbounded for x in monomial))
            for monomial, count in zip(primitive, _roundings(len(primitive)), strict=True)
        ]
        return {(name,): content}

    def in_order(self, polynomial: Polynomial) -> Polynomial:
        """The same terms, those last that have been rounded most often or may be largest.

        A sum rounds its first terms again with every further one.  Of products of names that are
        bound every one counts, by twice its roundings and its degree in what is unbounded.
        """

        def last(monomial: tuple[str, ...]) -> tuple[int, int]:
            own = sum(x in self._unbounded for x in monomial)
            behind = [self._behind.get(x, [(0, 0)]) for x in monomial]
            degree = own + sum(max(degree for _, degree in pairs) for pairs in behind)
            most = sum(max(2 * count + degree for count, degree in pairs) for pairs in behind)
            return own + most, degree

        return {m: polynomial[m] for m in sorted(polynomial, key=last)}


def _roundings(products: int) -> list[int]:
    """How often `dot` rounds each of so many products."""
    sums = 1 if products < 4 else 2 if products < 9 else 4
    return [len(range(index, products, sums)) + sums.bit_length() - 1 for index in range(products)]


def _single_last(p: Polynomial) -> Expression:
    """The sum, its terms of one factor added last where three roundings or more would follow."""
    single: Polynomial = {m: x for m, x in p.items() if len(m) == 1}
    products = {m: x for m, x in p.items() if len(m) != 1}
    if not single or len(products) < 3:
        return polynomial_expression(p)
    return Sum(polynomial_expression(products), polynomial_expression(single))


def _translating(algebra: Algebra, versor: PolynomialMultivector) -> frozenset[str]:
    """The components of null blades: a unit bounds what turns, but not them."""
    return frozenset(
        name
        for blade, p in versor.items()
        if not algebra.blade_product(blade, blade).get(0, 0)
        for monomial in p
        for name in monomial
    )


def chain_kernel(
    algebra: Algebra,
    name: str,
    law: str,
    factors: tuple[
        tuple[Callable[[Blade, Blade], Multivector], Parameter, PolynomialMultivector], ...
    ],
    parameters: tuple[Parameter, ...],
    result: Element,
) -> Kernel:
    """A product of several factors from left to right, each partial product computed once.

    factors: the first one's product is not used.  Every other: how it is multiplied onto what
    stands left of it, its parameter and its value (perhaps reversed).
    """
    staging = Staging()
    (_, _, whole), *others = factors
    so_far = whole
    for index, (product, parameter, value) in enumerate(others):
        whole = poly.apply_bilinear(product, whole, value)
        so_far = poly.apply_bilinear(product, so_far, value)
        if index < len(others) - 1:
            wanted = sorted(so_far)
            bound = {
                b: staging.bind(f"{parameter.name}{index + 1}_{algebra.blade_name(b)}", so_far[b])
                for b in wanted
            }
            so_far = {b: p for b, p in bound.items() if p}
    outputs = tuple((n, polynomial_expression(p)) for n, p in read_off(so_far, result).items())
    program = Program(parameters, tuple(staging.bindings), outputs, result).without_unused()
    return proved(Kernel(name, law, program, read_off(whole, result)))


def moved_value(algebra: Algebra, versor: Element, operand: Element) -> PolynomialMultivector:
    """V X ~V for a unit versor V as exact polynomials, in the grades that X has.

    V ~V = 1 enters as X (1 − V ~V); versors keep grades, so that other grades are 0.
    """
    v, x = (value_of(p) for p in parameters_for(versor, operand))
    product = algebra.geometric
    both = poly.apply_bilinear(product, poly.apply_bilinear(product, v, x), reversed_value(v))
    norm = poly.apply_bilinear(product, v, reversed_value(v))
    sign = -1 if any(g % 2 for g in versor.grades) else 1
    rest = poly.apply_bilinear(product, x, poly.added({0: ONE}, norm, -1))
    moved = poly.added(both, rest, sign)
    return {b: p for b, p in moved.items() if b.bit_count() in operand.grades}


def sandwich_kernel(
    algebra: Algebra,
    name: str,
    law: str,
    versor: Element,
    operand: Element,
    result: Element,
    namespace: str = "",
    *,
    lean: bool = False,
) -> Kernel:
    """V X ~V for an even unit versor V, (−1)^k V X ~V for an odd one and X of grade k.

    Where V ~V = 1, the change of X is a commutator with V.  It is sparse (what commutes with V
    drops out), so this costs far fewer operations than two products; for an even V its error is
    proportional to the displacement, not to X.  Of several forms that say the same the cheapest is
    taken whose rounding errors are bounded by the terms of X + [V, X] ~V; of two that cost the same
    the one with 2 V, which is known before X.  The unit condition enters each exactly, as a
    multiple of 1 − V ~V, which the proof adds to the definition.

    lean: the cheapest form in the basis A P± of a hyperbolic pair, with terms that cancel only
    because V is a unit.  ValueError where no such form costs less than the other kernel.
    """
    v, x = parameters_for(versor, operand)
    odd = any(g % 2 for g in versor.grades)
    overall = -1 if odd and operand.grades[0] % 2 else 1
    ways = _sandwich_ways(algebra, (v, x), odd=odd)

    def program_of(form: SandwichForm) -> Program:
        return _sandwich_program((v, x), result, overall, form)

    (program, form), leanest = _chosen(ways, program_of, result)
    if lean:
        if leanest is None or leanest[0].cost.total >= program.cost.total:
            raise ValueError(f"no form of {name} takes fewer operations than sandwich")
        program, form = leanest
    notes = LEAN_SANDWICH if lean else ()
    both = poly.apply_bilinear(
        algebra.geometric,
        poly.apply_bilinear(algebra.geometric, value_of(v), value_of(x)),
        reversed_value(value_of(v)),
    )
    defect = poly.added({0: ONE}, form.unit, -1)
    rest_of_unit = poly.apply_bilinear(algebra.geometric, value_of(x), defect)
    moved = form.read(poly.added(both, rest_of_unit, form.sign))
    meaning = {n: poly.scaled(p, overall) for n, p in read_off(moved, result).items()}
    notes = (f"Needs M ~M = 1: computed as {form.note}.", *notes)
    return proved(Kernel(name, law, program, meaning, namespace, None, notes))


LEAN_SANDWICH = (
    "Lean: error at most 3 ulp of the terms of all components together.",
    "A component that is small beside the others, or 0, may be rounding alone.",
)


@dataclass(frozen=True)
class SandwichForm:
    """V X ~V = ±X + `factor` `part` where V is a unit.

    part:   over names that `staging` binds; half of the change, or all of it with 2 V in it.
    unit:   what is 1 where V is a unit: exactly, V X ~V + `sign` X (1 − unit) is computed.
    split:  the product of `part` over A P± of a hyperbolic pair, where that is how it is made.
    """

    note: str
    sign: int
    staging: Staging
    factor: int
    part: PolynomialMultivector
    unit: PolynomialMultivector
    split: SplitProduct | None = None

    def read(self, value: PolynomialMultivector) -> PolynomialMultivector:
        """What is taken for a multivector that has the grades of X where V is a unit."""
        return value if self.split is None else self.split.read(value)


@dataclass(frozen=True)
class _Way:
    """A way to write a sandwich, given whether with 2 V, and that whose terms bound its errors."""

    write: Callable[[bool], SandwichForm]
    reference: Callable[[bool], SandwichForm]
    split: bool = False


def _sandwich_ways(
    algebra: Algebra, parameters: tuple[Parameter, Parameter], *, odd: bool
) -> list[_Way]:
    _, operand = parameters
    kinds = ((algebra.commutator, 1), (algebra.anticommutator, -1))
    ways: list[_Way] = []
    for kind, sign in kinds if odd else kinds[:1]:
        first = partial(_commutator_first, algebra, parameters, kind, sign)
        splits = split_products(algebra, operand.element.grades)
        ways += [
            _Way(first, first),
            *(_Way(partial(first, split=split), first, split=True) for split in splits),
        ]
    if not odd and _has_commutator_last(algebra, value_of(operand)):
        ways.append(_Way(partial(_commutator_last, algebra, parameters), ways[0].write))
    return ways


_Written = tuple[Program, SandwichForm]


def _chosen(
    ways: Iterable[_Way], program_of: Callable[[SandwichForm], Program], result: Element
) -> tuple[_Written, _Written | None]:
    """The cheapest form whose terms are bounded, and the cheapest over A P±, bounded or not.

    The first is over A P± only where that saves a tenth of the instructions: each conversion is a
    rounding more.
    """

    @cache
    def sizes(write: Callable[[bool], SandwichForm]) -> Mapping[str, Polynomial]:
        return _sizes(write(False), result)

    def bounded(way: _Way) -> bool:
        first = way.reference
        return way.write is first or _no_larger_terms(sizes(way.write), sizes(first))

    def written(way: _Way, doubled: bool) -> _Written:
        form = way.write(doubled)
        return program_of(form), form

    def operations(one: _Written) -> int:
        return one[0].cost.total

    def cheaper(way: _Way) -> _Written:
        return min(written(way, True), written(way, False), key=operations)

    whole = [(cheaper(way), way) for way in ways if not way.split]
    whole.sort(key=lambda pair: operations(pair[0]))
    best = next(one for one, way in whole if bounded(way))
    most = best[0].cost.instructions * 9 // 10
    split = [(written(way, False), way) for way in ways if way.split]
    split.sort(key=lambda pair: operations(pair[0]))
    pays = (way for one, way in split if one[0].cost.instructions <= most and bounded(way))
    if (way := next(pays, None)) is not None:
        best = cheaper(way)
    return best, cheaper(split[0][1]) if split else None


def _sizes(form: SandwichForm, result: Element) -> Mapping[str, Polynomial]:
    """`part` multiplied out, with the absolute values of all terms: what its rounding scales with.

    A component of `result` is read off by absolute values, too.
    """
    known: dict[str, Polynomial] = {}

    def expanded(p: Polynomial) -> Polynomial:
        total: Polynomial = {}
        for monomial, x in p.items():
            product: Polynomial = {(): magnitude(x)}
            for factor in monomial:
                product = poly.times(product, known.get(factor, {(factor,): 1}))
            poly.add_scaled(total, product, 1)
        return total

    for name, p in form.staging.meaning.items():
        known[name] = expanded(p)
    part = {blade: expanded(p) for blade, p in form.part.items()}
    sizes: dict[str, Polynomial] = {}
    for component, functional in zip(result.components, result.reading, strict=True):
        total = sizes.setdefault(component.name, {})
        for blade, x in functional.items():
            poly.add_scaled(total, part.get(blade, {}), magnitude(x))
    return sizes


def _no_larger_terms(sizes: Mapping[str, Polynomial], allowed: Mapping[str, Polynomial]) -> bool:
    """Whether no term of one form is missing or smaller in another, whatever the numbers are.

    A term may cancel only because V is a unit: the long translation of a screw along a line that
    it only turns is in such terms, and leaves its rounding error there.
    """
    return all(
        x <= allowed[component].get(monomial, 0)
        for component, terms in sizes.items()
        for monomial, x in terms.items()
    )


def _bound(
    algebra: Algebra, staging: Staging, prefix: str, value: PolynomialMultivector
) -> PolynomialMultivector:
    bound = {
        blade: staging.bind(f"{prefix}_{algebra.blade_name(blade)}", p)
        for blade, p in sorted(value.items())
    }
    return {blade: p for blade, p in bound.items() if p}


def _twice(
    algebra: Algebra, versor: PolynomialMultivector, doubled: bool
) -> tuple[PolynomialMultivector, Staging]:
    """The versor, or its double over names that are bound, and where to bind what follows."""
    translating = _translating(algebra, versor)
    if not doubled:
        return versor, Staging(translating)
    names, bindings = multiples(versor, 2)
    staging = Staging(translating | {names[x] for x in translating})
    staging.bindings += bindings
    return {
        b: {tuple(names[x] for x in m): c if m else 2 * c for m, c in p.items()}
        for b, p in versor.items()
    }, staging


def _commutator_first(
    algebra: Algebra,
    parameters: tuple[Parameter, Parameter],
    kind: Callable[[Blade, Blade], Multivector],
    sign: int,
    doubled: bool,
    split: SplitProduct | None = None,
) -> SandwichForm:
    """V X ~V = X + [V, X] ~V = −X + {V, X} ~V: the (anti)commutator is multiplied by ~V.

    split: how that product is made, if in the basis A P± of a hyperbolic pair.
    """
    versor, value = (value_of(p) for p in parameters)
    left, staging = _twice(algebra, versor, doubled)
    moved = _bound(algebra, staging, "c", poly.apply_bilinear(kind, left, value))
    back = reversed_value(versor)
    unit = poly.apply_bilinear(algebra.geometric, versor, back)
    form = "X + 2 (M × X) ~M" if sign > 0 else "−X + 2 ½(M X + X M) ~M"
    factor = 1 if doubled else 2
    if split is None:
        part = poly.apply_bilinear(algebra.geometric, moved, back)
        return SandwichForm(form, sign, staging, factor, part, unit)
    part = split.multiply(moved, back, ("c", parameters[0].name), staging.bind)
    return SandwichForm(f"{form} {split}", sign, staging, factor, part, unit, split)


def _null_vectors(algebra: Algebra) -> list[int]:
    """The basis vectors that see nothing, themselves neither."""
    return [i for i in range(algebra.dimension) if not any(algebra.gram[i])]


def _has_commutator_last(algebra: Algebra, value: PolynomialMultivector) -> bool:
    """Whether `_commutator_last` is there: X's grades agree in that sign, one vector at most is
    null."""
    return len(_null_vectors(algebra)) <= 1 and len({reverse_sign(b) for b in value}) == 1


def _commutator_last(
    algebra: Algebra, parameters: tuple[Parameter, Parameter], doubled: bool
) -> SandwichForm:
    """With V = R + D, D what contains the null vector e0 of a degenerate algebra, and Y = X ~R,

        V X ~V = R X ~R + D Y + (its reverse, of the sign of X's) = X + 2 (R × Y + <D Y>),

    where <…> keeps the grades whose reversal has X's sign.  Y is shared by both terms.
    """
    versor, value = (value_of(p) for p in parameters)
    null = _null_vectors(algebra)
    (sign,) = {reverse_sign(b) for b in value}
    mask = sum(1 << i for i in null)
    turning = {b: p for b, p in versor.items() if not b & mask}
    moving = {b: p for b, p in versor.items() if b & mask}
    back = reversed_value(turning)
    twice, staging = _twice(algebra, versor, doubled)
    right = reversed_value({b: p for b, p in twice.items() if not b & mask})
    turned = _bound(algebra, staging, "y", poly.apply_bilinear(algebra.geometric, value, right))
    part = poly.apply_bilinear(algebra.commutator, turning, turned)
    across = poly.apply_bilinear(algebra.geometric, moving, turned)
    part = poly.added(part, {b: p for b, p in across.items() if reverse_sign(b) == sign})
    unit = poly.apply_bilinear(algebra.geometric, back, turning)
    form = f"X + 2 (R × Y + <D Y>), Y = X ~R, {algebra.basis[null[0]]} in D = M − R" if null else ""
    form = form if moving else "X + 2 R × (X ~R)"
    return SandwichForm(form, 1, staging, 1 if doubled else 2, part, unit)


def _sandwich_program(
    parameters: tuple[Parameter, Parameter], result: Element, overall: int, form: SandwichForm
) -> Program:
    change = read_off(form.part, result)
    still = read_off(value_of(parameters[1]), result)
    outputs: list[tuple[str, Expression]] = []
    for component in result.components:
        kept = poly.scaled(still[component.name], overall * form.sign)
        rest = poly.scaled(change[component.name], overall * form.factor)
        content = poly.content(rest) if rest else 1
        inner = form.staging.in_order(poly.scaled(rest, ratio(1, content)))
        total: Expression
        if magnitude(content) == 1:
            total = polynomial_expression(kept | poly.scaled(inner, content))
        elif kept:
            whole = polynomial_expression(inner)
            total = MultiplyAdd(number(content), whole, polynomial_expression(kept))
        else:
            total = Product(number(content), polynomial_expression(inner))
        outputs.append((component.name, total))
    bindings = tuple(form.staging.bindings)
    return Program(parameters, bindings, tuple(outputs), result).without_unused()
