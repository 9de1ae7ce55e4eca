"""dexp and its inverse, the Jacobians of exp and log on a group: rate, rate → rate.

    dexp(X, Y) = Σ (−1)^k/(k+1)! ad_X^k Y = ~M d(M), M = exp X          (theory.md §7)

Where the square of a rate is X² = −Θ²/4 with Θ² = t + t_J J and J is central in the group's algebra
(one quadrivector, or none), ad_X³ = −Θ² ad_X, which is proved for each group.  A function of ad_X
is then 1 + a ad + b ad² with a and b functions of one real, dual or complex number or of two real
ones, whatever the group's dimension: rotations, rigid motions of the plane and of space, the
Lorentz group.  All other groups go by doubling and, for the inverse, elimination.  In five
dimensions ad_X has up to nine eigenvalues, any of which may coincide, and a polynomial through them
is as bad as the closest two.  Where an eigenvalue comes without its negative (similarities), even
and odd parts in ad_X are e^|λ| large and cancel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import (
    Algebra,
    Blade,
    Rational,
    add_scaled,
    magnitude,
    ratio,
)
from hamotor.codegen.closedform import square_of
from hamotor.codegen.element import Element
from hamotor.codegen.group import LieGroup
from hamotor.codegen.kernel import Kernel, value_of
from hamotor.codegen.polynomial import Polynomial
from hamotor.codegen.program import (
    Call,
    Expression,
    Name,
    Number,
    Parameter,
    Product,
    Program,
    Sum,
    negative,
    number,
    polynomial_expression,
    sum_of_products,
)
from hamotor.codegen.writer import Writer
from hamotor.errors import UsageError

MAXIMUM_DIMENSION = 5
LAWS = {
    "dexp": "Σ (−1)^k/(k+1)! ad_a^k b: the body rate of exp(a) where a changes at rate b",
    "dexp_inverse": "Σ B_k/k! (−ad_a)^k b: the rate of a where exp(a) has body rate b",
}
NOTES = {
    "dexp": ("M = M0 exp(a) has ~M M' = dexp(a, a').",),
    "dexp_inverse": (
        "M = M0 exp(a), M' = M b has a' = dexp_inverse(a, b).  Not finite at rotations by 2π, 4π,",
        "…, where exp is not locally one-to-one.",
    ),
}


@dataclass(frozen=True)
class Cubic:
    """ad_X³ = −(t + t_J J) ad_X, over the coordinates of X.

    turn:   J as a map of rate coordinates: the column of each; empty where there is no J.
    square: J², −1, 0 or 1.
    """

    t: Polynomial
    t_j: Polynomial
    turn: tuple[tuple[Rational, ...], ...]
    square: int

    @property
    def is_definite(self) -> bool:
        """Whether t is a sum of squares: rotations without boosts."""
        return all(len(set(m)) == 1 and x > 0 for m, x in self.t.items())


def jacobian_kernel(algebra: Algebra, group: LieGroup, name: str, where: str) -> Kernel:
    """`dexp` or `dexp_inverse` of a group."""
    if algebra.dimension > MAXIMUM_DIMENSION:
        raise UsageError(
            f"{where}: {name} exists in at most {MAXIMUM_DIMENSION} dimensions, as exp does; "
            f"{algebra.name} has {algebra.dimension}"
        )
    parameters = (Parameter("a", group.rate), Parameter("b", group.rate))
    cubic = _cubic(algebra, group)
    if cubic is None:
        return _general(algebra, group, name, parameters, where)
    program = _closed_form(group, name, parameters, cubic)
    return Kernel(name, LAWS[name], program, None, group.rate.namespace, None, NOTES[name])


def _bracket(group: LieGroup, a: Sequence[Polynomial], b: Sequence[Polynomial]) -> list[Polynomial]:
    """Coordinates of [A, B]."""
    total: list[Polynomial] = [{} for _ in group.generators]
    for x, row in zip(a, group.structure, strict=True):
        for y, coordinates in zip(b, row, strict=True):
            if x and y and any(coordinates):
                product = poly.times(x, y)
                for into, z in zip(total, coordinates, strict=True):
                    poly.add_scaled(into, product, z)
    return total


def _turned(turn: Sequence[Sequence[Rational]], a: Sequence[Polynomial]) -> list[Polynomial]:
    """Coordinates of J A."""
    total: list[Polynomial] = [{} for _ in a]
    for x, column in zip(a, turn, strict=True):
        for into, z in zip(total, column, strict=True):
            poly.add_scaled(into, x, z)
    return total


def _names(parameter: Parameter) -> list[Polynomial]:
    return [{(f"{parameter.name}.{c.name}",): 1} for c in parameter.element.components]


def _cubic(algebra: Algebra, group: LieGroup) -> Cubic | None:
    """The law of ad_X³, proved with X and Y as symbols; None where there is none of this kind."""
    x, y = Parameter("a", group.rate), Parameter("b", group.rate)
    square = poly.apply_bilinear(algebra.geometric, value_of(x), value_of(x))
    t = poly.scaled(square.pop(0, {}), -4)
    if len(square) > 1:
        return None
    turn: tuple[tuple[Rational, ...], ...] = ()
    t_j: Polynomial = {}
    kind: Rational = 0
    for quad, p in square.items():
        columns = [_coordinates(algebra, group.rate, quad, g.bivector) for g in group.generators]
        own = algebra.blade_product(quad, quad)
        kind = own.get(0, 0)
        if None in columns or own.keys() - {0} or kind not in (-1, 0, 1):
            return None
        turn = tuple(column for column in columns if column is not None)
        t_j = poly.scaled(p, -4)
    once = _bracket(group, _names(x), _names(y))
    thrice = _bracket(group, _names(x), _bracket(group, _names(x), once))
    expected = [poly.scaled(poly.times(t, q), -1) for q in once]
    if turn:
        for into, q in zip(expected, _turned(turn, once), strict=True):
            poly.add_scaled(into, poly.times(t_j, q), -1)
    if thrice != expected:
        return None
    cubic = Cubic(t, t_j, turn, int(kind))
    return cubic if cubic.is_definite or _is_unimodular(group) else None


def _is_unimodular(group: LieGroup) -> bool:
    """Whether tr ad_X = 0 for every X."""
    size = range(len(group.generators))
    return not any(sum(group.structure[a][b][b] for b in size) for a in size)


def _coordinates(
    algebra: Algebra, rate: Element, quad: Blade, bivector: Mapping[Blade, Rational]
) -> tuple[Rational, ...] | None:
    """J E over the generators; None where it is none of their combinations."""
    product = algebra.multiply({quad: 1}, bivector)
    coordinates = tuple(
        sum((x * product.get(blade, 0) for blade, x in reading.items()), 0)
        for reading in rate.reading
    )
    for x, component in zip(coordinates, rate.components, strict=True):
        add_scaled(product, component.embedding, -x)
    return None if product else coordinates


def _closed_form(
    group: LieGroup, name: str, parameters: tuple[Parameter, Parameter], cubic: Cubic
) -> Program:
    a, b = parameters
    writer = Writer()

    def bound(prefix: str, polynomials: Sequence[Polynomial]) -> list[Polynomial]:
        components = group.rate.components
        return [
            writer.let_polynomial(f"{prefix}_{c.name}", p)
            for c, p in zip(components, polynomials, strict=True)
        ]

    once = bound("bracket", _bracket(group, _names(a), _names(b)))
    twice = bound("double", _bracket(group, _names(a), once))
    terms: list[tuple[str, list[Polynomial]]] = []
    if cubic.square == 1:
        halves = [_split_square(writer, cubic, _names(a), sign) for sign in (1, -1)]
        kind = "rotation" if cubic.is_definite else "motion"
        for which, t in zip(("plus", "minus"), halves, strict=True):
            writer.let(which, Call(f"{name}_{kind}", (polynomial_expression(t),)))
        half = Number(Fraction(1, 2))
        for field in ("linear", "square"):
            plus, minus = Name(f"plus.{field}"), Name(f"minus.{field}")
            writer.let(field, Product(half, Sum(plus, minus)))
            writer.let(f"{field}_j", Product(half, Sum(plus, negative(minus))))
        prefix = ""
    else:
        arguments = [polynomial_expression(cubic.t)]
        if cubic.turn:
            arguments.append(polynomial_expression(cubic.t_j))
        sign = "rotation" if cubic.is_definite else "motion"
        kind = sign if not cubic.turn else "complex" if cubic.square else f"dual_{sign}"
        writer.let("f", Call(f"{name}_{kind}", tuple(arguments)))
        prefix = "f."
    terms = [("linear", once), ("square", twice)]
    if cubic.turn:
        turned = _turned(cubic.turn, once)
        constant = name == "dexp_inverse"  # its coefficient of ad is the number 1/2
        terms += [] if constant else [("linear_j", turned)]
        terms += [("square_j", _turned(cubic.turn, twice))]
    outputs: list[tuple[str, Expression]] = []
    for i, component in enumerate(group.rate.components):
        summands: list[tuple[Expression, ...]] = [(Name(f"{b.name}.{component.name}"),)]
        for field, values in terms:
            if values[i]:
                summands.append((Name(prefix + field), polynomial_expression(values[i])))
        outputs.append((component.name, sum_of_products(summands)))
    program = Program(parameters, tuple(writer.bindings), tuple(outputs), group.rate)
    return program.without_unused()


def _split_square(writer: Writer, cubic: Cubic, x: Sequence[Polynomial], sign: int) -> Polynomial:
    """t ± t_J as the square of X (1 ± J), so that nearly isoclinic X do not cancel."""
    bound: dict[tuple[tuple[tuple[str, ...], Rational], ...], str] = {}
    values: dict[str, Polynomial] = {}
    for one, other in zip(x, _turned(cubic.turn, x), strict=True):
        half = dict(one)
        poly.add_scaled(half, other, sign)
        ((coordinate,),) = one
        if not half:
            values[coordinate] = {}
            continue
        leading = half[min(half)]
        primitive = poly.scaled(half, ratio(1, leading))
        key = tuple(sorted(primitive.items()))
        if key not in bound:
            bound[key] = f"{'sum' if sign > 0 else 'difference'}{len(bound) + 1}"
            writer.bindings.append((bound[key], polynomial_expression(primitive)))
        values[coordinate] = {(bound[key],): leading}
    return poly.scaled(poly.substituted(cubic.t, values), Fraction(1, 2))


def _general(
    algebra: Algebra,
    group: LieGroup,
    name: str,
    parameters: tuple[Parameter, Parameter],
    where: str,
) -> Kernel:
    """By doubling; what bounds |X| as a rotor's bivector is √(|S| + √|ω|) with X² = S + W."""
    a, b = parameters
    writer = Writer()
    x = {
        blade: writer.let_polynomial(f"x_{algebra.blade_name(blade)}", p)
        for blade, p in sorted(value_of(a).items())
    }
    square = poly.apply_bilinear(algebra.geometric, x, x)
    parts = square_of(algebra, writer, square, "w", where)
    size: Expression = Call("abs", (polynomial_expression(parts.number),))
    if parts.omega:
        omega = Call("abs", (polynomial_expression(parts.omega),))
        content = number(magnitude(parts.content))
        root: Expression = Call("sqrt", (omega,))
        size = Sum(size, root if parts.content == 1 else Product(content, root))
    writer.let("size", Call("sqrt", (size,)))
    method = {"dexp": "dexp_by_doubling", "dexp_inverse": "dexp_inverse_by_elimination"}[name]
    writer.let("jacobian", Call(method, (Name(a.name), Name(b.name), Name("size"))))
    outputs = tuple((c.name, Name(f"jacobian.{c.name}")) for c in group.rate.components)
    program = Program(parameters, tuple(writer.bindings), outputs, group.rate).without_unused()
    return Kernel(name, LAWS[name], program, None, group.rate.namespace, None, NOTES[name])
