"""exp of a general bivector, Cayley maps and normalisation, in closed form for n ≤ 5.

For n ≤ 5 the square of a bivector is B² = S + W with W of grade 4 and W² = ω a number, and B, W
commute.  Everything analytic in B is therefore a combination of 1, W, B and V = <B W>₂ whose
coefficients depend on S and ω alone (theory.md §7).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Algebra, Blade, Rational, grade, magnitude, ratio
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import Kernel, parameters_for, reversed_value, value_of
from hamotor.codegen.nullsplit import hyperbolic_pairs
from hamotor.codegen.polynomial import Polynomial, PolynomialMultivector
from hamotor.codegen.program import (
    Call,
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Parameter,
    Product,
    Program,
    Quotient,
    Select,
    Sum,
    factors_of,
    negative,
    number,
    polynomial_expression,
    sum_of_products,
)
from hamotor.codegen.writer import Writer, outputs_for
from hamotor.errors import UsageError

ONE = number(1)
MAXIMUM_DIMENSION = 5
NOT_SMALL = Fraction(2, 3)
"""Where ω > S²/4 and √ω is below half of this, |S| + √ω ≤ 1: exp is a series there."""
CANCELLED = Fraction(1, 16)
"""What is left of ω's terms where W is needed with all its digits."""


@dataclass(frozen=True)
class Square:
    """A square S + W of a number and a part of grade 4, over names.

    number: S.  quad: W / content, where every coefficient is ± one name if that can be had.
    omega: W².
    """

    number: Polynomial
    quad: PolynomialMultivector
    content: Rational
    omega: Polynomial


def square_of(
    algebra: Algebra, writer: Writer, square: PolynomialMultivector, names: str, where: str
) -> Square:
    """Bind S, W and ω of a square; raises UsageError where it is not a number plus grade 4."""
    quad = _named(algebra, writer, names, {b: p for b, p in sorted(square.items()) if b})
    omega = poly.apply_bilinear(algebra.geometric, quad, quad)
    if any(grade(b) != 4 for b in quad) or any(omega.keys() - {0}):
        raise UsageError(
            f"{where}: closed forms exist for algebras of at most 5 dimensions, where a bivector's "
            f"square is a number plus a part of grade 4 whose own square is a number; "
            f"{algebra.name} has {algebra.dimension}"
        )
    sizes: set[Rational] = {magnitude(x) for p in quad.values() for x in p.values()}
    content: Rational = sizes.pop() if len(sizes) == 1 else 1
    quad = {b: poly.scaled(p, ratio(1, content)) for b, p in quad.items()}
    number_part = writer.let_polynomial("square", square.get(0, {}))
    return Square(number_part, quad, content, writer.let_polynomial("omega", omega.get(0, {})))


def _with_all_digits(
    algebra: Algebra, writer: Writer, square: PolynomialMultivector
) -> PolynomialMultivector:
    """The square, its part W of grade 4 under names; compensated where ω = W² nearly cancels.

    It cannot, if all its terms have one sign.  Otherwise, as where two planes are turned by a large
    boost, ω feels rounding errors of W more than B: it changes by 2 <B W>₂ δB, where |B W| may be
    much less than |B| |W|.
    """
    quad = {b: p for b, p in sorted(square.items()) if b}
    independent: PolynomialMultivector = {b: {(f"{b}",): 1} for b in quad}
    if not (_may_be_isoclinic(algebra, independent) and _may_be_negative(algebra, independent)):
        return square
    rough = _named(algebra, writer, "rough", quad)
    omega = poly.apply_bilinear(algebra.geometric, rough, rough).get(0, {})
    cancels = writer.let("cancels", _cancels(omega))
    return {0: square.get(0, {})} | {
        b: _let_compensated(writer, f"w_{algebra.blade_name(b)}", p, cancels)
        if len(p) > 1
        else rough[b]
        for b, p in quad.items()
    }


def _cancels(omega: Polynomial) -> Expression:
    """Positive where a sum of products of names is much less than its terms."""
    omega = poly.scaled(omega, ratio(1, magnitude(poly.content(omega))))
    sizes: list[tuple[Expression, ...]] = []
    for (x, y), factor in omega.items():
        size = magnitude(factor)
        if x == y and size == 1:
            sizes.append((Name(x), Name(y)))
        else:
            sizes.append((number(size), Call("abs", (Product(Name(x), Name(y)),))))
    left = Call("abs", (polynomial_expression(omega),))
    return MultiplyAdd(number(CANCELLED), sum_of_products(sizes), negative(left))


def _let_compensated(writer: Writer, name: str, p: Polynomial, needed: Expression) -> Polynomial:
    """`let_polynomial`, of products whose sum is compensated where `needed` > 0."""
    if len(p) < 2:
        return writer.let_polynomial(name, p)
    content = poly.content(p)
    factors = factors_of(poly.scaled(p, ratio(1, content)))
    writer.bindings.append((name, Call("compensated_dot_where", (needed, *factors))))
    return {(name,): content}


def _times(content: Rational, expression: Expression) -> Expression:
    return expression if content == 1 else Product(number(content), expression)


def _bivector(
    algebra: Algebra, writer: Writer, parameter: Parameter, where: str
) -> PolynomialMultivector:
    """The bivector that a parameter stands for, over names without coefficients."""
    value = value_of(parameter)
    if any(grade(b) != 2 for b in value):
        raise UsageError(f"{where}: {parameter.element.name} is not a bivector")
    bound: PolynomialMultivector = {}
    for blade, p in sorted(value.items()):
        if len(p) == 1 and all(abs(x) == 1 for x in p.values()):
            bound[blade] = p
        else:
            name = f"b_{algebra.blade_name(blade)}"
            writer.bindings.append((name, polynomial_expression(p)))
            bound[blade] = {(name,): 1}
    return bound


def one_name(p: Polynomial) -> tuple[int, str]:
    """Sign and name of a polynomial that is ± one name."""
    ((monomial, x),) = p.items()
    (name,) = monomial
    return int(x), name


def _combination(
    parts: list[tuple[Expression, PolynomialMultivector]], start: Mapping[Blade, Expression]
) -> dict[Blade, Expression]:
    """Σ coefficient · multivector, added to `start`."""
    out = dict(start)
    for coefficient, value in parts:
        for blade, p in value.items():
            if len(p) == 1 and all(abs(x) == 1 and len(m) == 1 for m, x in p.items()):
                sign, name = one_name(p)
                factor: Expression = Name(name) if sign > 0 else Negative(Name(name))
            else:
                factor = polynomial_expression(p)
            known = out.get(blade)
            out[blade] = (
                Product(coefficient, factor)
                if known is None
                else MultiplyAdd(coefficient, factor, known)
            )
    return out


def exp_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """exp of a general bivector: any signature, degenerate or not, n ≤ 5."""
    (parameter,) = parameters_for(operand)
    writer = Writer()
    b = _bivector(algebra, writer, parameter, where)
    square = poly.apply_bilinear(algebra.geometric, b, b)
    parts = square_of(algebra, writer, _with_all_digits(algebra, writer, square), "w", where)
    twisted = _twisted(algebra, b, parts.quad)
    negated = {x: poly.scaled(p, -1) for x, p in square.items()}
    planes = _on_planes(algebra, writer, negated, parts.quad)
    if planes:
        w = polynomial_expression(poly.scaled(parts.quad[planes.blade], parts.content))
        arguments: tuple[Expression, ...] = (w, planes.plus, planes.minus)
    else:
        arguments = (polynomial_expression(parts.number), polynomial_expression(parts.omega))
        if _may_be_isoclinic(algebra, parts.quad):
            twisted = _named(algebra, writer, "t", twisted)
            near = _isoclinic(algebra, writer, b, *arguments, number(parts.content), twisted)
            arguments += (near.root, near.square)
    writer.let("e", Call("bivector_exponential", arguments))
    out: dict[Blade, Expression] = {0: Name("e.number")}
    terms: list[tuple[Expression, PolynomialMultivector]] = [(Name("e.bivector"), b)]
    for name, value in (("quad", parts.quad), ("twisted", twisted)):
        if value:
            terms.append((writer.let(name, _times(parts.content, Name(f"e.{name}"))), value))
    out = _combination(terms, out)
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    notes = ("Any bivector: two commuting rotations or boosts, isoclinic, simple or null.",)
    return Kernel("exp", "exp(B) = 1 + B + B²/2 + …", program, None, namespace, None, notes)


@dataclass(frozen=True)
class Isoclinic:
    """S + W, W² = ω, and a bivector B that commutes with W.

    Where `applies` > 0, that is ω > S²/4 and not small, S + `side` may nearly vanish; `side` = ∓√ω
    has the sign that S has not.  If S + W = B² (or is a function of it), then what B² is there is
    `square` = ½ <U²>₀ with U = B + <B W>₂ / `side`, which cancels before it is squared, not after.
    """

    applies: Expression
    root: Expression
    side: Expression
    square: Expression


def _twisted(
    algebra: Algebra, bivector: PolynomialMultivector, quad: PolynomialMultivector
) -> PolynomialMultivector:
    """<B W>₂, where B and W commute: B W has no part of grade 4."""
    product = poly.apply_bilinear(algebra.geometric, bivector, quad)
    return {blade: p for blade, p in product.items() if grade(blade) == 2}


def _may_be_isoclinic(algebra: Algebra, quad: PolynomialMultivector) -> bool:
    """Whether W² can be positive, for W with independent components."""
    omega = poly.apply_bilinear(algebra.geometric, quad, quad).get(0, {})
    return any(x > 0 for x in omega.values())


def _may_be_negative(algebra: Algebra, quad: PolynomialMultivector) -> bool:
    """Whether W² can be negative, for W with independent components."""
    omega = poly.apply_bilinear(algebra.geometric, quad, quad).get(0, {})
    return any(x < 0 for x in omega.values())


def _isoclinic(
    algebra: Algebra,
    writer: Writer,
    bivector: PolynomialMultivector,
    s: Expression,
    omega: Expression,
    content: Expression,
    twisted: PolynomialMultivector,
    least: Rational = 0,
    cancels: Expression | None = None,
) -> Isoclinic:
    """least: √ω is small below half of it.

    twisted: <B W>₂ / content, over names; or its sums, which are compensated where `cancels` > 0.
    """
    root = writer.let("root_omega", Call("sqrt", (omega,)))
    size = writer.let("size", Call("max_abs", (s, number(least)))) if least else s
    quarter = Product(number(Fraction(-1, 4)), size)
    applies = writer.let("isoclinic", MultiplyAdd(quarter, size, omega))
    sign = Select(s, negative(content), content)
    share = writer.let("share", Select(applies, Quotient(sign, root), number(0)))
    if cancels:
        needed = writer.let("needed", Select(applies, cancels, number(0)))
        twisted = {
            b: _let_compensated(writer, f"t_{algebra.blade_name(b)}", p, needed)
            for b, p in twisted.items()
        }
    cancelled: PolynomialMultivector = {}
    for blade, p in bivector.items():
        part = MultiplyAdd(
            share, polynomial_expression(twisted.get(blade, {})), polynomial_expression(p)
        )
        name = f"u_{algebra.blade_name(blade)}"
        writer.let(name, part if blade in twisted else polynomial_expression(p))
        cancelled[blade] = {(name,): 1}
    square = poly.apply_bilinear(algebra.geometric, cancelled, cancelled)[0]
    half = polynomial_expression(poly.scaled(square, ratio(1, 2)))
    return Isoclinic(applies, root, Select(s, negative(root), root), half)


def log_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """Principal logarithm of a general unit rotor: log R = <R>₂ f(<R>₀ + <R>₄), f = θ / sin θ."""
    (parameter,) = parameters_for(operand)
    writer = Writer()
    value = _versor(parameter, where)
    quad = {b: p for b, p in value.items() if grade(b) == 4}
    bivector = {b: p for b, p in value.items() if grade(b) == 2}
    square = poly.apply_bilinear(algebra.geometric, bivector, bivector)
    rho = poly.apply_bilinear(algebra.geometric, quad, quad)
    if any(rho.keys() - {0}) or any(grade(b) not in (0, 4) for b in square):
        raise UsageError(f"{where}: closed forms exist for at most {MAXIMUM_DIMENSION} dimensions")
    negated = {b: poly.scaled(p, -1) for b, p in square.items()}
    turning = all(x > 0 for x in negated.get(0, {}).values())  # no boosts
    planes = _on_planes(algebra, writer, negated, quad) if turning else None
    if planes:
        out = _log_on_planes(algebra, writer, value, planes)
    else:
        out = _log_by_square(algebra, writer, value, square.get(0, {}), rho.get(0, {}))
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    notes = [
        "Principal: exp(log R) = R, the sum of both half angles in [0, π]; for R that is exp of a",
        "bivector (not every unit versor is: −T, T a null rotation, is not).",
    ]
    if not planes:
        notes += [
            "Where nothing turns and <R>₀ < 0 (−T, T a boost or a null rotation; −1): log(−R),",
            "the same transformation, of which exp is −R.",
        ]
    return Kernel("log", "log(R), R ~R = 1", program, None, namespace, None, tuple(notes))


def _log_by_square(
    algebra: Algebra,
    writer: Writer,
    value: PolynomialMultivector,
    square: Polynomial,
    rho: Polynomial,
) -> dict[Blade, Expression]:
    """From <R>₀, S = <<R>₂²>₀ and ρ = <R>₄²."""
    quad = {b: p for b, p in value.items() if grade(b) == 4}
    bivector = {b: p for b, p in value.items() if grade(b) == 2}
    twisted = _twisted(algebra, quad, bivector)
    c, number_part, root = (polynomial_expression(p) for p in (value[0], square, rho))
    arguments: tuple[Expression, ...] = (c, number_part, root)
    # planes that are not each other's dual: rounding of one is no turn in the other
    mixed = not all(algebra.blade_product(b, b).get(0) for b in quad) or len(quad) > 1
    commuting = bool(square) and mixed
    if commuting:
        twisted = _named(algebra, writer, "t", twisted)
    if _may_be_isoclinic(algebra, quad):
        # <R>₂² = S + 2 c <R>₄
        number_part, root = writer.let("square", number_part), writer.let("rho", root)
        twice = writer.let("twice", Product(number(2), c))
        omega = writer.let("omega", Product(Product(twice, twice), root))
        near = _isoclinic(algebra, writer, bivector, number_part, omega, twice, twisted)
        arguments = (c, number_part, root, near.applies, near.square)
    writer.let("f", Call("turned_logarithm" if commuting else "bivector_logarithm", arguments))
    terms: list[tuple[Expression, PolynomialMultivector]] = [(Name("f.bivector"), bivector)]
    if twisted:
        terms.append((Name("f.twisted"), twisted))
    if commuting:
        terms += _turned_plane(algebra, writer, bivector, twisted)
    return _combination(terms, {})


def _turned_plane(
    algebra: Algebra,
    writer: Writer,
    bivector: PolynomialMultivector,
    twisted: PolynomialMultivector,
) -> list[tuple[Expression, PolynomialMultivector]]:
    """f.turn times the unit of y, freed of what rounding left of the plane that commutes with it.

    With 2 V = <y²>₄ and y² ≈ −|y|² that is y + <y V>₂ / |y|².
    """
    parts: list[tuple[Expression, PolynomialMultivector]] = [
        (Name("f.part"), bivector),
        (Name("f.part_twisted"), twisted),
    ]
    y: PolynomialMultivector = {}
    for blade, x in sorted(_combination(parts, {}).items()):
        writer.let(name := f"y_{algebra.blade_name(blade)}", x)
        y[blade] = {(name,): 1}
    square = poly.apply_bilinear(algebra.geometric, y, y)
    quad = {b: poly.scaled(p, ratio(1, 2)) for b, p in square.items() if b}
    twice = _twisted(algebra, y, _named(algebra, writer, "v", quad))
    length2 = writer.let("length2", Call("abs", (polynomial_expression(square[0]),)))
    turn, zero = Name("f.turn"), number(0)
    spin = writer.let("spin", Select(turn, Quotient(turn, Call("sqrt", (length2,))), zero))
    away = writer.let("away", Select(turn, Quotient(spin, length2), zero))
    return [(spin, y), (away, twice)]


def _log_on_planes(
    algebra: Algebra, writer: Writer, value: PolynomialMultivector, planes: Planes
) -> dict[Blade, Expression]:
    """Where J = 1 and where J = −1 by themselves, and then what e0 brings: M = (1 + t) R.

    With exp L = R, L = a A + b B in planes A, B with the larger half angle a, that is
    b cot b t − ½ [L, t] + (a cot a − b cot b) t_A; t_A = −A × (A × t) is the part of t in A, of
    which nothing else is left by rounding.
    """
    q = polynomial_expression(value[planes.blade])
    sides = (planes.plus, planes.minus)
    writer.let("f", Call("planes_logarithm", (polynomial_expression(value[0]), q, *sides)))
    pairs = planes.pairs
    plus: list[Expression] = [Name(f"plus_{i}") for i in range(len(pairs))]
    minus: list[Expression] = [Name(f"minus_{i}") for i in range(len(pairs))]
    plus[0] = writer.let("seeded_plus", Sum(plus[0], Name("f.seed_plus")))
    minus[0] = writer.let("seeded_minus", Sum(minus[0], Name("f.seed_minus")))

    def joined(by_plus: str, by_minus: str) -> dict[str, Expression]:
        names: dict[str, Expression] = {}
        for pair, high, low in zip(pairs, plus, minus, strict=True):
            above, below = Product(Name(by_plus), high), Product(Name(by_minus), low)
            other = Negative(below)
            names[pair.x] = Sum(above, below)
            names[pair.y] = Sum(above, other) if pair.sign > 0 else Sum(below, Negative(above))
        return names

    def bound(prefix: str, names: Mapping[str, Expression]) -> PolynomialMultivector:
        found: PolynomialMultivector = {}
        for blade, p in value.items():
            if grade(blade) == 2 and (factor := one_name(p))[1] in names:
                sign, of = factor
                writer.let(name := f"{prefix}_{algebra.blade_name(blade)}", names[of])
                found[blade] = {(name,): sign}
        return found

    rotation = bound("r", joined("f.plus", "f.minus"))
    out = {blade: polynomial_expression(p) for blade, p in rotation.items()}
    kept = {0, planes.blade, *rotation}
    rotor = {b: p for b, p in value.items() if b in kept}
    moved = {b: p for b, p in value.items() if b not in kept}
    if not moved:
        return out

    def cross(a: PolynomialMultivector, b: PolynomialMultivector) -> PolynomialMultivector:
        return poly.apply_bilinear(algebra.commutator, a, b)

    t = poly.apply_bilinear(algebra.geometric, moved, reversed_value(rotor))
    t = _named(algebra, writer, "t", {b: p for b, p in t.items() if grade(b) == 2})
    plane = bound("a", joined("f.unit_plus", "f.unit_minus"))
    turned = _named(algebra, writer, "w", cross(plane, t))
    parts: list[tuple[Expression, PolynomialMultivector]] = [
        (Name("f.along"), t),
        (number(-1), cross(rotation, t)),
        (Negative(Name("f.across")), cross(plane, turned)),
    ]
    return out | _combination(parts, {})


def cayley_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """(1 + B)(1 − B)⁻¹ = [1 − S² + ω + 2W + 2(1 − S)B + 2V] / D, D = (1 − S)² − ω."""
    (parameter,) = parameters_for(operand)
    writer = Writer()
    b = _bivector(algebra, writer, parameter, where)
    square = poly.apply_bilinear(algebra.geometric, b, b)
    parts = square_of(algebra, writer, _with_all_digits(algebra, writer, square), "w", where)
    one: Polynomial = {(): 1}
    s = polynomial_expression(parts.number)
    twisted = _twisted(algebra, b, parts.quad)
    negated = {x: poly.scaled(p, -1) for x, p in square.items()}
    planes = _on_planes(algebra, writer, negated, parts.quad)
    determinant: Expression
    even: Expression
    if planes:
        planes = planes.bound(writer, "square")
        shifted = planes.plus_one().bound(writer, "rest")
        rest = shifted.mean(writer, "rest")
        determinant = shifted.product
        even = MultiplyAdd(negative(planes.plus), planes.minus, ONE)
    else:
        left = poly.added({0: one}, {0: parts.number}, -1)[0]
        rest = writer.let("rest", polynomial_expression(left))
        omega = polynomial_expression(parts.omega)
        determinant = MultiplyAdd(rest, rest, negative(omega))
        even = Sum(MultiplyAdd(negative(s), s, ONE), omega)
        if _may_be_isoclinic(algebra, parts.quad):
            twisted = _named(algebra, writer, "t", twisted)
            isoclinic = _isoclinic(
                algebra, writer, b, s, omega, number(parts.content), twisted, NOT_SMALL
            )
            near = writer.let("near", isoclinic.square)
            far = writer.let("far", Sum(s, negative(isoclinic.side)))
            apart = Product(Sum(ONE, negative(near)), Sum(ONE, negative(far)))
            determinant = Select(isoclinic.applies, apart, determinant)
            even = Select(isoclinic.applies, MultiplyAdd(negative(near), far, ONE), even)
    if parts.omega:
        inverse = writer.let("inverse", Quotient(ONE, determinant))
        twice = writer.let("twice", Product(number(2), inverse))
        linear = writer.let("linear", Product(rest, twice))
        twice = writer.let("even", _times(parts.content, twice))
    else:
        inverse = writer.let("inverse", Quotient(ONE, rest))
        even = Sum(ONE, s)
        linear = writer.let("linear", Product(number(2), inverse))
        twice = linear
        if parts.quad:
            twice = writer.let("even", _times(parts.content, Product(linear, inverse)))
    out = _combination(
        [(linear, b), (twice, parts.quad), (twice, twisted)], {0: Product(even, inverse)}
    )
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    notes = ("Infinite where 1 − B has no inverse: only where B² has an eigenvalue 1 (a boost).",)
    return Kernel("cayley", "(1 + B)(1 − B)⁻¹", program, None, namespace, None, notes)


@dataclass(frozen=True)
class Pair:
    """Names of dual components of a bivector: x + `sign` y where J = 1, x − `sign` y elsewhere."""

    x: str
    y: str
    sign: int


@dataclass(frozen=True)
class Planes:
    """What an element of grades 0 and 4 is where J = 1 and where J = −1; J: `blade`, J² = 1."""

    blade: Blade
    plus: Expression
    minus: Expression
    pairs: tuple[Pair, ...] = ()
    """What it is the square of, if it is one."""

    @property
    def product(self) -> Expression:
        """The number that is a + b J times a − b J."""
        return Product(self.plus, self.minus)

    def bound(self, writer: Writer, name: str) -> Planes:
        """The same under names."""
        plus = writer.let(f"{name}_plus", self.plus)
        return Planes(self.blade, plus, writer.let(f"{name}_minus", self.minus))

    def plus_one(self) -> Planes:
        """1 + this."""
        return Planes(self.blade, Sum(ONE, self.plus), Sum(ONE, self.minus))

    def mean(self, writer: Writer, name: str) -> Expression:
        """The part without J."""
        return writer.let(name, Product(number(Fraction(1, 2)), Sum(self.plus, self.minus)))


def _on_planes(
    algebra: Algebra, writer: Writer, square: PolynomialMultivector, quad: PolynomialMultivector
) -> Planes | None:
    """S + W, a square, where J = 1 and where J = −1, without cancellation between S and W.

    J: the only blade of grade 4 in `quad` whose square is not 0.  With S = Σ ±(x² + y²) and
    W = Σ ±2 x y J + … these are sums of ±(x ± y)².  None where they are not of that kind.
    """
    squares = {b: algebra.blade_product(b, b).get(0, 0) for b in quad}
    turning = [b for b, x in squares.items() if x]
    if len(turning) != 1 or squares[turning[0]] != 1:
        return None
    (blade,) = turning
    number_part, quad_part = square.get(0, {}), square.get(blade, {})
    pairs: list[tuple[str, str, Rational, Rational]] = []
    for monomial, twice in quad_part.items():
        x, *others = monomial
        sign = number_part.get((x, x), 0)
        if len(others) != 1 or number_part.get((others[0],) * 2) != sign:
            return None
        if abs(sign) != 1 or abs(twice) != 2:
            return None
        pairs.append((x, others[0], sign, sign * twice))
    if len(number_part) != 2 * len(pairs):
        return None
    sides = []
    for side, name in ((1, "plus"), (-1, "minus")):
        terms: list[tuple[Expression, ...]] = []
        for index, (x, y, sign, twice) in enumerate(pairs):
            other = Name(y) if side * twice > 0 else negative(Name(y))
            total = writer.let(f"{name}_{index}", Sum(Name(x), other))
            terms.append((total if sign > 0 else negative(total), total))
        sides.append(sum_of_products(terms))
    plus, minus = sides
    dual = tuple(Pair(x, y, 1 if twice > 0 else -1) for x, y, _, twice in pairs)
    return Planes(blade, plus, minus, dual)


def _one_plus_versor(
    algebra: Algebra, writer: Writer, value: PolynomialMultivector
) -> Planes | None:
    """1 + s + Q, s + Q = q J + … the grades 0 and 4 of M, M ~M = 1.

    Where s ± q < 0 as (1 − (s ± q)²) / (1 − (s ± q)), with 1 − (s + q J)² = −<M>₂² in squares:
    so nothing cancels where a pair of planes turns by half an angle of π.
    """
    bivector = {b: p for b, p in value.items() if grade(b) == 2}
    square = poly.apply_bilinear(algebra.geometric, bivector, bivector)
    negated = {b: poly.scaled(p, -1) for b, p in square.items()}
    quad = {b: p for b, p in value.items() if grade(b) == 4}
    rest = _on_planes(algebra, writer, negated, quad)
    if rest is None:
        return None
    s, q = (polynomial_expression(value[b]) for b in (0, rest.blade))
    cosines = Planes(rest.blade, Sum(s, q), Sum(s, negative(q))).bound(writer, "cosine")

    def shifted(cosine: Expression, far: Expression) -> Expression:
        beyond = Quotient(far, Sum(ONE, negative(cosine)))
        return Select(cosine, Sum(ONE, cosine), beyond)

    plus, minus = shifted(cosines.plus, rest.plus), shifted(cosines.minus, rest.minus)
    return Planes(rest.blade, plus, minus).bound(writer, "shifted")


def _versor(parameter: Parameter, where: str) -> PolynomialMultivector:
    value = value_of(parameter)
    if not value or any(g not in (0, 2, 4) for g in parameter.element.grades):
        raise UsageError(f"{where}: {parameter.element.name} must be even, with grades 0 to 4")
    return value


def _named(
    algebra: Algebra, writer: Writer, prefix: str, value: PolynomialMultivector
) -> PolynomialMultivector:
    """The value under names."""
    return {
        blade: writer.let_polynomial(f"{prefix}_{algebra.blade_name(blade)}", p)
        for blade, p in value.items()
    }


def _renamed(x: Expression, name: str, multiple: Polynomial) -> Polynomial:
    """A multiple of x, x under another name; nothing if it is none."""
    for monomial, factor in multiple.items():
        if [Name(text) for text in monomial] == [x]:
            return {(name,): factor}
    return {}


def _times_name(
    algebra: Algebra,
    writer: Writer,
    prefix: str,
    value: PolynomialMultivector,
    factor: str,
    sign: int = 1,
) -> PolynomialMultivector:
    """The value times a named number, under names."""
    return {
        b: writer.let_polynomial(
            f"{prefix}_{algebra.blade_name(b)}", poly.times(p, {(factor,): sign})
        )
        for b, p in value.items()
    }


def cayley_inverse_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """(M − 1)(M + 1)⁻¹ = <M>₂ (1 + s − Q) / ((1 + s)² − Q²), s + Q = M's grades 0 and 4."""
    (parameter,) = parameters_for(operand)
    writer = Writer()
    value = _versor(parameter, where)
    quad = {b: p for b, p in value.items() if grade(b) == 4}
    bivector = {b: p for b, p in value.items() if grade(b) == 2}
    omega = poly.apply_bilinear(algebra.geometric, quad, quad)
    if any(omega.keys() - {0}):
        raise UsageError(f"{where}: closed forms exist for at most 5 dimensions")
    planes = _one_plus_versor(algebra, writer, value)
    if planes:
        # one division after the other: their product may be beyond the range
        sides = [
            writer.let(f"inverse_{side}", Quotient(ONE, x))
            for side, x in (("plus", planes.plus), ("minus", planes.minus))
        ]
        linear = Planes(planes.blade, sides[0], sides[1]).mean(writer, "linear")
        quad = _times_name(algebra, writer, "q", quad, "inverse_plus")
        inverse = sides[1]
    else:
        rest = Name(_one_plus_scalar(algebra, writer, value))
        if omega and (other := _square_subtracted(omega[0])):
            # scaled by a power of two, because squares may vanish near −1
            writer.let("scaling", Call("scaling", (Call("max_abs", (rest, other)),)))
            inward = Name("scaling.in")
            near = writer.let("near", Product(inward, rest))
            slip = writer.let("slip", Product(inward, other))
            square = MultiplyAdd(near, near, Product(slip, slip))
            writer.let("inverse", Quotient(inward, square))
            linear = writer.let("linear", Product(near, Name("inverse")))
            scaled = _times_name(algebra, writer, "q", quad, "scaling.in")
            quad = {b: _renamed(other, "slip", p) or scaled[b] for b, p in quad.items()}
            inverse = Name("inverse")
        elif omega:
            norm = _norm_squared(algebra, writer, value, rest, divided=True)
            inverse = writer.let("inverse", Quotient(ONE, norm))
            linear = writer.let("linear", Product(rest, inverse))
        else:
            linear = writer.let("linear", Quotient(ONE, rest))
            inverse = writer.let("inverse", Product(linear, linear)) if quad else linear
    twisted = {
        b: poly.scaled(p, -1)
        for b, p in poly.apply_bilinear(algebra.geometric, bivector, quad).items()
        if grade(b) == 2
    }
    out = _combination([(linear, bivector), (inverse, twisted)], {})
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    law = "(M − 1)(M + 1)⁻¹, M ~M = 1"
    notes = ("Infinite at M = −1, which no finite bivector reaches.",)
    return Kernel("cayley_inverse", law, program, None, namespace, None, notes)


def inverse_kernel(algebra: Algebra, operand: Element, result: Element, where: str) -> Kernel:
    """A⁻¹ = ~A (N − Q) / (N² − q) for A even or odd, n ≤ 5: A ~A = N + Q, Q of grade 4, Q² = q.

    Even elements that are matrices of quaternions are inverted as such: fewer operations, and for
    those that hardly have an inverse more digits.
    """
    (parameter,) = parameters_for(operand)
    writer = Writer()
    value = value_of(parameter)
    if len({g % 2 for g in operand.grades}) != 1:
        return _mixed_inverse_kernel(algebra, parameter, result, where)
    square = poly.apply_bilinear(algebra.geometric, value, reversed_value(value))
    matrix = _Matrix.of(algebra)
    if matrix and 0 in operand.grades and square.keys() - {0}:
        out = matrix.inverse(writer, value)
        return _inverse(algebra, parameter, writer, out, result, where)
    parts = square_of(algebra, writer, square, "q", where)
    norm = writer.let("norm2", polynomial_expression(parts.number))
    reversed_ = reversed_value(value)
    if not parts.quad:
        factor = writer.let("factor", Quotient(ONE, norm))
        out = _combination([(factor, reversed_)], {})
    else:
        omega = negative(polynomial_expression(parts.omega)) if parts.omega else None
        squared: Expression = Product(norm, norm)
        if omega is not None:
            squared = MultiplyAdd(norm, norm, omega)
        if planes := _on_planes(algebra, writer, square, parts.quad):
            planes = planes.bound(writer, "norm2")
            norm, squared = planes.mean(writer, "norm2"), planes.product
        inverse = writer.let("inverse", Quotient(ONE, squared))
        factor = writer.let("factor", Product(norm, inverse))
        slip = writer.let("slip", _times(-parts.content, inverse))
        turned = poly.apply_bilinear(algebra.geometric, reversed_, parts.quad)
        if len(parts.quad) == 1:
            ((blade, p),) = parts.quad.items()
            slip = writer.let("turn", Product(slip, polynomial_expression(p)))
            turned = poly.apply_bilinear(algebra.geometric, reversed_, {blade: {(): 1}})
        out = _combination([(factor, reversed_), (slip, turned)], {})
    return _inverse(algebra, parameter, writer, out, result, where)


@dataclass(frozen=True)
class _Matrix:
    """Even elements as 2 × 2 matrices of quaternions.

    Null vectors n, m with n·m = g, beside three others of one sign, whose product I commutes with
    those.  With P± = ½(1 ± n∧m/g): a P+ + b P− + c I n + d I m ↦ (a, c; −2g I² d, b), with a, b, c,
    d even in the three, respects products.
    """

    algebra: Algebra
    pair: tuple[int, int]

    @classmethod
    def of(cls, algebra: Algebra) -> _Matrix | None:
        """The matrices for an algebra, if it has such vectors."""
        for pair in hyperbolic_pairs(algebra):
            rest = [i for i in range(algebra.dimension) if i not in pair]
            block = [[algebra.gram[i][j] for j in rest if j != i] for i in rest]
            signs = {algebra.gram[i][i] > 0 for i in rest if algebra.gram[i][i]}
            whole = all(algebra.gram[i][i] for i in rest) and not any(map(any, block))
            if len(rest) == 3 and len(signs) == 1 and whole:
                return cls(algebra, pair)
        return None

    @property
    def _both(self) -> Blade:
        return 1 << self.pair[0] | 1 << self.pair[1]

    @property
    def _volume(self) -> Blade:
        return (1 << self.algebra.dimension) - 1 & ~self._both

    @property
    def _quaternion(self) -> list[Blade]:
        return [b for b in range(self._volume + 1) if not b & self._both and grade(b) % 2 == 0]

    @property
    def _lower(self) -> Rational:
        """−2g I²."""
        square = self.algebra.blade_product(self._volume, self._volume)[0]
        return ratio(-2 * self.algebra.gram[self.pair[0]][self.pair[1]] * square, 1)

    def _beside(self, blade: Blade, null: int) -> tuple[Blade, Rational]:
        """A I n for an even blade A: a blade and its coefficient."""
        ((odd, x),) = self.algebra.blade_product(blade, self._volume).items()
        ((whole, sign),) = self.algebra.outer(odd, 1 << null).items()
        return whole, x * sign

    def _across(self, blade: Blade) -> tuple[Blade, Rational]:
        """A n∧m / g for an even blade A."""
        whole = blade | self._both
        gram = self.algebra.gram[self.pair[0]][self.pair[1]]
        return whole, ratio(self.algebra.outer(blade, self._both)[whole], gram)

    def _entries(self, writer: Writer, value: PolynomialMultivector) -> list[PolynomialMultivector]:
        """a, c, −2g I² d and b, over names."""
        a, c, d, b = found = [dict[Blade, Polynomial]() for _ in range(4)]
        for blade in self._quaternion:
            name = self.algebra.blade_name(blade)
            whole, x = self._across(blade)
            still = {0: value.get(blade, {})}
            across = {0: poly.scaled(value.get(whole, {}), ratio(1, x))}
            for letter, entry, sign in (("a", a, 1), ("b", b, -1)):
                p = poly.added(still, across, sign).get(0, {})
                entry[blade] = writer.let_polynomial(f"{letter}_{name}", p)
            for entry, null, factor in ((c, self.pair[0], 1), (d, self.pair[1], self._lower)):
                whole, x = self._beside(blade, null)
                entry[blade] = poly.scaled(value.get(whole, {}), ratio(factor, x))
        return found

    def inverse(self, writer: Writer, value: PolynomialMultivector) -> dict[Blade, Expression]:
        """By Schur's complement, of a and b or of c and d, whichever are larger.

        Then what is subtracted is no larger than what it is subtracted from, block by block and for
        any unit of length: errors are those of a change of the blocks by ε, while a quotient by
        N² − q has those of a change by ε of the squares.
        """
        algebra, product = self.algebra, self.algebra.geometric
        entries = self._entries(writer, value)

        def norm(q: PolynomialMultivector) -> Expression:
            return polynomial_expression(poly.apply_bilinear(product, q, reversed_value(q))[0])

        def inverted(
            name: str, q: PolynomialMultivector, size: Expression
        ) -> PolynomialMultivector:
            over = f"over_{name}"
            writer.let(over, Quotient(ONE, size))
            reverse = reversed_value(q)
            return _times_name(algebra, writer, f"inverse_{name}", reverse, over)

        def times(
            name: str, x: PolynomialMultivector, y: PolynomialMultivector
        ) -> PolynomialMultivector:
            return _named(algebra, writer, name, poly.apply_bilinear(product, x, y))

        sizes = [
            writer.let(f"size_{letter}", norm(q)) for letter, q in zip("acdb", entries, strict=True)
        ]
        apart = MultiplyAdd(sizes[0], sizes[3], negative(Product(sizes[1], sizes[2])))
        diagonal = writer.let("diagonal", apart)

        def chosen(name: str, k: int, other: int) -> PolynomialMultivector:
            picked: PolynomialMultivector = {}
            for blade, p in entries[k].items():
                whole = f"{name}_{algebra.blade_name(blade)}"
                x, y = (polynomial_expression(q) for q in (p, entries[other][blade]))
                writer.let(whole, Select(diagonal, x, y))
                picked[blade] = {(whole,): 1}
            return picked

        # (p, q; r, s): the matrix, or its columns exchanged
        p, q, r, s = chosen("p", 0, 1), chosen("q", 1, 0), chosen("r", 2, 3), chosen("s", 3, 2)
        size = writer.let("size", Select(diagonal, sizes[0], sizes[1]))
        pivot = inverted("p", p, size)
        u, v = times("u", r, pivot), times("v", pivot, q)
        rest = poly.added(s, poly.apply_bilinear(product, u, q), -1)
        rest = _named(algebra, writer, "rest", rest)
        last = inverted("rest", rest, writer.let("size_of_rest", norm(rest)))
        right, lower = times("right", v, last), times("lower", last, u)
        first = poly.added(pivot, poly.apply_bilinear(product, right, u))
        first = _named(algebra, writer, "first", first)
        # (first, −right; −lower, last), its rows exchanged where the columns were
        signed = [
            first,
            *({b: poly.scaled(x, -1) for b, x in part.items()} for part in (right, lower)),
            last,
        ]

        def entry(k: int, other: int, blade: Blade, sign: int = 1) -> Expression:
            x, y = (polynomial_expression(poly.scaled(signed[i][blade], sign)) for i in (k, other))
            return Select(diagonal, x, y)

        out: dict[Blade, Expression] = {}
        for blade in self._quaternion:
            name = algebra.blade_name(blade)
            a = writer.let(f"inverse_a_{name}", entry(0, 2, blade))
            b = writer.let(f"inverse_b_{name}", entry(3, 1, blade))
            out[blade] = Product(number(Fraction(1, 2)), Sum(a, b))
            whole, x = self._across(blade)
            out[whole] = Product(number(ratio(x, 2)), Sum(a, negative(b)))
            for null, k, other, scale in (
                (self.pair[0], 1, 3, 1),
                (self.pair[1], 2, 0, ratio(1, self._lower)),
            ):
                whole, x = self._beside(blade, null)
                sign = 1 if x * scale > 0 else -1
                out[whole] = _times(magnitude(x * scale), entry(k, other, blade, sign))
        return out


def _inverse(
    algebra: Algebra,
    parameter: Parameter,
    writer: Writer,
    out: Mapping[Blade, Expression],
    result: Element,
    where: str,
) -> Kernel:
    if lost := [algebra.blade_name(b) for b in sorted(out) if b not in result.blades]:
        raise UsageError(
            f"{where}: the inverse has parts along {', '.join(lost)}, which {result.name} does not "
            'hold; name a type that does with "-> RESULT"'
        )
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    notes = ("Not finite where a has no inverse.",)
    return Kernel("inverse", "a⁻¹: a a⁻¹ = 1", program, None, "", None, notes)


def _mixed_inverse_kernel(
    algebra: Algebra, parameter: Parameter, result: Element, where: str
) -> Kernel:
    """A⁻¹ for any multivector, n ≤ 5, by involutions (Hitzer & Sangwine 2017, Shirokov 2021).

    With A′ the Clifford conjugate, [B]ₖ a sign change of the grades k: B = A A′ has grades 0, 3, 4;
    C = B [B]₃₄ is a number for n ≤ 4.  For n = 5 C = B [B]₃ has grades 0, 1, 4 and C [C]₁₄ is a
    number N.  A⁻¹ = A′ [B]₃ [C]₁₄ / N, or A′ [B]₃₄ / N.  These are identities of polynomials in the
    components and the Gram matrix, so that they hold in degenerate algebras and in oblique bases.
    """
    if algebra.dimension > MAXIMUM_DIMENSION:
        raise UsageError(
            f"{where}: the inverse of a multivector that is neither even nor odd exists for at "
            f"most {MAXIMUM_DIMENSION} dimensions; {algebra.name} has {algebra.dimension}"
        )
    writer = Writer()

    def bound(prefix: str, value: PolynomialMultivector) -> PolynomialMultivector:
        named = {
            b: writer.let_polynomial(f"{prefix}_{algebra.blade_name(b)}", p)
            for b, p in sorted(value.items())
        }
        return {b: p for b, p in named.items() if p}

    def product(a: PolynomialMultivector, b: PolynomialMultivector) -> PolynomialMultivector:
        return poly.apply_bilinear(algebra.geometric, a, b)

    def flipped(value: PolynomialMultivector, *grades: int) -> PolynomialMultivector:
        return {b: poly.scaled(p, -1 if grade(b) in grades else 1) for b, p in value.items()}

    value = value_of(parameter)
    adjugate = {b: poly.scaled(p, (-1) ** grade(b)) for b, p in reversed_value(value).items()}
    # Grades whose sign changes, and grades of the product, which as names they no longer show.
    last = ((1, 4), (0,)) if algebra.dimension == MAXIMUM_DIMENSION else ((3, 4), (0,))
    stages = [last] if algebra.dimension < MAXIMUM_DIMENSION else [((3,), (0, 1, 4)), last]
    norm = bound("b", product(value, adjugate))
    for name, (changed, kept) in zip("cd", stages, strict=False):
        if not norm.keys() - {0}:
            break
        factor = flipped(norm, *changed)
        adjugate = bound(f"{name}_adjugate", product(adjugate, factor))
        norm = bound(name, {b: p for b, p in product(norm, factor).items() if grade(b) in kept})
    denominator = polynomial_expression(norm.get(0, {}))
    inverse = writer.let("inverse", Quotient(ONE, denominator))
    out: dict[Blade, Expression] = {
        b: Product(inverse, polynomial_expression(p)) for b, p in adjugate.items()
    }
    return _inverse(algebra, parameter, writer, out, result, where)


def _one_plus_scalar(algebra: Algebra, writer: Writer, value: PolynomialMultivector) -> str:
    """Name of 1 + s, s = <M>₀, M ~M = 1; for s ≤ 0 as (1 − s²) / (1 − s), 1 − s² from the others.

    So near M = −1 nothing cancels in it.  Where there are no others, s is 1 or −1.
    """
    norm = poly.apply_bilinear(algebra.geometric, value, reversed_value(value))[0]
    rest = poly.added({0: norm}, {0: poly.times(value[0], value[0])}, -1).get(0, {})
    s = polynomial_expression(value[0])
    whole = Sum(ONE, s)
    far = Quotient(polynomial_expression(rest), Sum(ONE, negative(s)))
    writer.let("shifted", Select(s, whole, far) if rest else whole)
    return "shifted"


def _norm_squared(
    algebra: Algebra,
    writer: Writer,
    value: PolynomialMultivector,
    n: Expression,
    divided: bool = False,
) -> Expression:
    """N² − Q², where M ~M = 1, 1 + M = N + <M>₂ + Q; N is bound.  divided: without its root.

    Where one of c = s ± √Q² is near −1, N ± √Q² = 1 + c is (1 − c²) / (1 − c), 1 − c² from <M>₂.
    """
    quad = {b: p for b, p in value.items() if grade(b) == 4}
    square = poly.apply_bilinear(algebra.geometric, quad, quad)[0]
    omega = polynomial_expression(square)
    if not _may_be_isoclinic(algebra, quad):
        return MultiplyAdd(n, n, negative(omega))
    bivector = {b: p for b, p in value.items() if grade(b) == 2}
    omega = writer.let("omega", omega)
    twisted = _twisted(algebra, bivector, quad)
    cancels = _cancels(square) if divided and _may_be_negative(algebra, quad) else None
    if not cancels:
        twisted = _named(algebra, writer, "t", twisted)
    isoclinic = _isoclinic(algebra, writer, bivector, n, omega, ONE, twisted, cancels=cancels)
    side = writer.let("side", isoclinic.side)
    cosine = writer.let("cosine", Sum(polynomial_expression(value[0]), side))
    beyond = Quotient(negative(isoclinic.square), Sum(ONE, negative(cosine)))
    near = Select(cosine, Sum(ONE, cosine), beyond)
    apart: Expression = Product(near, Sum(n, negative(side)))
    if not divided or min(algebra.signature[:2]) < 2:  # both have one sign, but for rounding
        apart = Call("abs", (apart,))
    return Select(isoclinic.applies, apart, MultiplyAdd(n, n, negative(omega)))


def sqrt_kernel(algebra: Algebra, operand: Element, result: Element, where: str) -> Kernel:
    """√M = (1 + M) (2 N + 2 Q)^(−1/2), where M ~M = 1, 1 + M = N + <M>₂ + Q, Q of grade 4.

    With r = √(N² − Q²) and u = √(N + r) this is u/2 + Q/(2u) + <M>₂ (u − Q/u)/(2r).
    """
    (parameter,) = parameters_for(operand)
    writer = Writer()
    value = _versor(parameter, where)
    bivector = {b: p for b, p in value.items() if grade(b) == 2}
    quad = {b: p for b, p in value.items() if grade(b) == 4}
    omega = poly.apply_bilinear(algebra.geometric, quad, quad)
    if any(omega.keys() - {0}):
        raise UsageError(f"{where}: closed forms exist for at most {MAXIMUM_DIMENSION} dimensions")
    half = number(Fraction(1, 2))
    if planes := _one_plus_versor(algebra, writer, value):
        roots = [
            writer.let(f"root_{side}", Call("sqrt", (Product(half, x),)))
            for side, x in (("plus", planes.plus), ("minus", planes.minus))
        ]
        radius = writer.let("radius", Product(number(2), Product(*roots)))
        root = writer.let("root", Sum(*roots))
    else:
        norm = Name(_one_plus_scalar(algebra, writer, value))
        radius = norm
        square: Expression = Product(number(2), norm)
        if omega:
            if other := _square_subtracted(omega[0]):
                length = Call("length", (norm, other))
            else:
                length = Call("sqrt", (_norm_squared(algebra, writer, value, norm),))
            radius = writer.let("radius", length)
            part = polynomial_expression(omega[0])
            square = _norm_plus_radius(algebra, writer, quad, norm, radius, part)
        root = writer.let("root", Call("sqrt", (square,)))
    out: dict[Blade, Expression] = {0: Product(half, root)}
    if not quad:
        out = _combination([(writer.let("factor", Quotient(ONE, root)), bivector)], out)
    else:
        # Q first by one root and then by the other: their product may be beyond the range
        if omega:
            per_root = writer.let("per_root", Quotient(half, root))
            inverse = writer.let("inverse", Quotient(ONE, radius))
            factor = writer.let("factor", Product(half, Product(root, inverse)))
        else:
            factor = writer.let("factor", Quotient(ONE, root))
            per_root = writer.let("per_root", Product(half, factor))
            writer.let("inverse", Product(Product(number(2), factor), factor))
        turned = _times_name(algebra, writer, "turn", quad, "inverse", -1)
        twisted = poly.apply_bilinear(algebra.geometric, bivector, turned)
        twisted = {b: p for b, p in twisted.items() if grade(b) == 2}
        out = _combination([(per_root, quad), (factor, bivector), (per_root, twisted)], out)
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    notes = ("Not finite at M = −1, which is half a turn of the sheet from 1.",)
    return Kernel("sqrt", "√m: half the motion, √m √m = m", program, None, "", None, notes)


def _norm_plus_radius(
    algebra: Algebra,
    writer: Writer,
    quad: PolynomialMultivector,
    norm: Expression,
    radius: Expression,
    omega: Expression,
) -> Expression:
    """N + r, r = √(N² − ω), of N + Q, Q² = ω; `quad`: Q up to a factor.

    Where N < 0 only ω < 0 leaves it a root (boosts beside half an angle near π, or M ~M of what
    hardly has an inverse): there as −ω / (|N| + r), which does not cancel.
    """
    if not _may_be_negative(algebra, quad):
        return Sum(norm, radius)
    total = writer.let("total", Sum(Call("abs", (norm,)), radius))
    return Select(norm, total, Quotient(negative(omega), total))


def _square_subtracted(omega: Polynomial) -> Name | None:
    """The x of ω = −x²."""
    if len(omega) == 1:
        (((x, *others), factor),) = omega.items()
        if factor == -1 and others == [x]:
            return Name(x)
    return None


def normalize_kernel(algebra: Algebra, operand: Element, result: Element, where: str) -> Kernel:
    """M (~M M)^(−1/2) with ~M M = N + Q, Q² = q: (u − Q/2u)/r, r² = N² − q, u² = (N + r)/2."""
    (parameter,) = parameters_for(operand)
    writer = Writer()
    value = _versor(parameter, where)
    square = poly.apply_bilinear(algebra.geometric, reversed_value(value), value)
    parts = square_of(algebra, writer, square, "q", where)
    norm = writer.let_polynomial("norm2", parts.number)
    parts = Square(norm, parts.quad, parts.content, parts.omega)
    out = _over_root(algebra, writer, value, parts)
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    law = "M (~M M)^(−1/2): the unit versor nearest to M"
    return Kernel("normalize", law, program, None)


def _over_root(
    algebra: Algebra,
    writer: Writer,
    value: PolynomialMultivector,
    parts: Square,
) -> dict[Blade, Expression]:
    """A (N + Q)^(−1/2) for a square N + Q that commutes with A."""
    half = number(Fraction(1, 2))
    norm = polynomial_expression(parts.number)
    radius = square = norm
    if parts.omega:
        omega = polynomial_expression(parts.omega)
        radius = writer.let("radius", Call("sqrt", (MultiplyAdd(norm, norm, negative(omega)),)))
        total = _norm_plus_radius(algebra, writer, parts.quad, norm, radius, omega)
        square = Product(half, total)
    root = writer.let("root", Call("sqrt", (square,)))
    if not parts.quad:
        factor = writer.let("factor", Quotient(ONE, root))
        return _combination([(factor, value)], {})

    factor = writer.let("factor", Quotient(root, radius))
    turned = poly.apply_bilinear(algebra.geometric, value, parts.quad)
    content = ratio(-parts.content, 2)
    quad = next(iter(parts.quad.values()))
    if len(parts.quad) == 1 and len(quad) == 1:
        # one grade-4 blade: take it into the factor, so that each component costs one fma
        (blade,) = parts.quad
        turned = poly.apply_bilinear(algebra.geometric, value, {blade: {(): 1}})
        part = polynomial_expression(poly.scaled(quad, content))
        slip = writer.let("turn", Quotient(part, Product(root, radius)))
    else:
        slip = writer.let("slip", Quotient(number(content), Product(root, radius)))
    return _combination([(factor, value), (slip, turned)], {})
