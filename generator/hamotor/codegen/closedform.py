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
from hamotor.codegen.kernel import Kernel, parameters_for, read_off, reversed_value, value_of
from hamotor.codegen.polynomial import Polynomial, PolynomialMultivector
from hamotor.codegen.program import (
    Call,
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Number,
    Parameter,
    Product,
    Program,
    Quotient,
    Select,
    Sum,
    negative,
    number,
    polynomial_expression,
    sum_of_products,
)
from hamotor.errors import UsageError

ONE = number(1)
MAXIMUM_DIMENSION = 5


class Writer:
    """Collects bindings; what is already a name or a constant is not bound again."""

    def __init__(self) -> None:
        """Start empty."""
        self.bindings: list[tuple[str, Expression]] = []

    def let(self, name: str, expression: Expression) -> Expression:
        """Bind an expression and return its name."""
        match expression:
            case Name() | Number() | Negative(Name()):
                return expression
            case _:
                self.bindings.append((name, expression))
                return Name(name)

    def let_polynomial(self, name: str, p: Polynomial) -> Polynomial:
        """Bind a polynomial, unless it is one factor or none; returns what stands for it."""
        if not p or (len(p) == 1 and len(next(iter(p))) <= 1):
            return p
        content = poly.content(p)
        self.bindings.append((name, polynomial_expression(poly.scaled(p, ratio(1, content)))))
        return {(name,): content}


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
    quad = {
        b: writer.let_polynomial(f"{names}_{algebra.blade_name(b)}", p)
        for b, p in sorted(square.items())
        if b
    }
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


def outputs_for(
    values: Mapping[Blade, Expression], result: Element
) -> tuple[tuple[str, Expression], ...]:
    """The components of the result, read off blade coefficients.

    A rate has no place for what no element of its group has: those coefficients are zero there.
    Raises ValueError where another result has no place for one of them.
    """
    held = {blade: x for blade, x in values.items() if blade in result.blades}
    if len(held) < len(values) and not result.namespace:
        raise ValueError(f"{result.name} does not hold all grades and blades of the result")
    names: PolynomialMultivector = {b: {(f"{b}",): 1} for b in held}
    outputs: list[tuple[str, Expression]] = []
    for component, p in read_off(names, result).items():
        total: Expression | None = None
        for monomial, x in p.items():
            value = values[int(monomial[0])]
            if abs(x) == 1:
                term = value if x > 0 else negative(value)
                total = term if total is None else Sum(total, term)
            else:
                scaled = number(x)
                total = (
                    Product(scaled, value) if total is None else MultiplyAdd(scaled, value, total)
                )
        outputs.append((component, total if total is not None else number(0)))
    return tuple(outputs)


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
    parts = square_of(algebra, writer, poly.apply_bilinear(algebra.geometric, b, b), "w", where)
    twisted = {
        blade: p
        for blade, p in poly.apply_bilinear(algebra.geometric, b, parts.quad).items()
        if grade(blade) == 2
    }
    writer.let(
        "e",
        Call(
            "bivector_exponential",
            (polynomial_expression(parts.number), polynomial_expression(parts.omega)),
        ),
    )
    out: dict[Blade, Expression] = {0: Name("e.number")}
    terms: list[tuple[Expression, PolynomialMultivector]] = [(Name("e.bivector"), b)]
    for name, value in (("quad", parts.quad), ("twisted", twisted)):
        if value:
            terms.append((writer.let(name, _times(parts.content, Name(f"e.{name}"))), value))
    out = _combination(terms, out)
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    notes = ("Any bivector: two commuting rotations or boosts, isoclinic, simple or null.",)
    return Kernel("exp", "exp(B) = 1 + B + B²/2 + …", program, None, namespace, None, notes)


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
    twisted = {
        b: p
        for b, p in poly.apply_bilinear(algebra.geometric, quad, bivector).items()
        if grade(b) == 2
    }
    arguments = tuple(
        polynomial_expression(p) for p in (value[0], square.get(0, {}), rho.get(0, {}))
    )
    writer.let("f", Call("bivector_logarithm", arguments))
    terms: list[tuple[Expression, PolynomialMultivector]] = [(Name("f.bivector"), bivector)]
    if twisted:
        terms.append((Name("f.twisted"), twisted))
    out = _combination(terms, {})
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    notes = (
        "Principal: exp(log R) = R, the sum of both half angles in [0, π]; for R that is exp of a",
        "bivector (not every unit versor is: −T, T a null rotation, is not).",
    )
    return Kernel("log", "log(R), R ~R = 1", program, None, namespace, None, notes)


def cayley_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """(1 + B)(1 − B)⁻¹ = [1 − S² + ω + 2W + 2(1 − S)B + 2V] / D, D = (1 − S)² − ω."""
    (parameter,) = parameters_for(operand)
    writer = Writer()
    b = _bivector(algebra, writer, parameter, where)
    parts = square_of(algebra, writer, poly.apply_bilinear(algebra.geometric, b, b), "w", where)
    one: Polynomial = {(): 1}
    s = polynomial_expression(parts.number)
    left = poly.added({0: one}, {0: parts.number}, -1)[0]
    rest = writer.let("rest", polynomial_expression(left))
    twisted = poly.apply_bilinear(algebra.geometric, b, parts.quad)
    if parts.omega:
        omega = polynomial_expression(parts.omega)
        determinant = MultiplyAdd(rest, rest, negative(omega))
        inverse = writer.let("inverse", Quotient(ONE, determinant))
        even = Sum(MultiplyAdd(negative(s), s, ONE), omega)
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


def _with_signs(
    writer: Writer, prefix: str, number_part: Polynomial, quad_part: Polynomial
) -> tuple[Expression, Expression] | None:
    """S + q and S − q, for S = Σ ±(x² + y²) and q = Σ ±2 x y, as sums of ±(x ± y)².

    So nothing cancels between S and q.  None where they are not of that kind.
    """
    if len(number_part) != 2 * len(quad_part):
        return None
    sums: tuple[list[tuple[Expression, ...]], list[tuple[Expression, ...]]] = ([], [])
    for index, (monomial, twice) in enumerate(quad_part.items()):
        x, *others = monomial
        square = number_part.get((x, x), 0)
        if len(others) != 1 or number_part.get((others[0],) * 2) != square:
            return None
        if abs(square) != 1 or abs(twice) != 2:
            return None
        for terms, sign, side in zip(sums, (1, -1), ("plus", "minus"), strict=True):
            y: Expression = Name(others[0])
            total = Sum(Name(x), y if sign * twice * square > 0 else negative(y))
            name = writer.let(f"{prefix}{side}_{index}", total)
            terms.append((name if square > 0 else negative(name), name))
    plus, minus = (sum_of_products(terms) for terms in sums)
    return plus, minus


def _on_planes(
    algebra: Algebra,
    writer: Writer,
    square: PolynomialMultivector,
    quad: PolynomialMultivector,
    prefix: str,
) -> tuple[Expression, Expression] | None:
    """What S + W, a square, is where J = 1 and where J = −1, without cancellation.

    J: the only blade of grade 4 in `quad` whose square is not 0.  None unless that is 1.
    """
    squares = [(b, algebra.blade_product(b, b).get(0, 0)) for b in quad]
    turning = [(b, x) for b, x in squares if x]
    if len(turning) != 1 or turning[0][1] != 1:
        return None
    (blade, _), *_ = turning
    return _with_signs(writer, prefix, square.get(0, {}), square.get(blade, {}))


def _one_plus_eigenvalues(
    algebra: Algebra, writer: Writer, value: PolynomialMultivector
) -> tuple[Expression, Expression] | None:
    """1 + s + q and 1 + s − q of M ~M = 1, s + q J + … its grades 0 and 4, J² = 1.

    Where s ± q < 0 as (1 − (s ± q)²) / (1 − (s ± q)), with 1 − (s + q J)² = −<M>₂² in squares:
    so nothing cancels where a pair of planes turns by half an angle of π.
    None where no such J exists.
    """
    bivector = {b: p for b, p in value.items() if grade(b) == 2}
    square = poly.apply_bilinear(algebra.geometric, bivector, bivector)
    rest = _on_planes(
        algebra,
        writer,
        {b: poly.scaled(p, -1) for b, p in square.items()},
        {b: p for b, p in value.items() if grade(b) == 4},
        "",
    )
    if rest is None:
        return None
    (blade,) = (b for b in value if grade(b) == 4 and algebra.blade_product(b, b))
    s, q = (polynomial_expression(value[b]) for b in (0, blade))
    found = []
    for side, quad, far in zip(("plus", "minus"), (q, negative(q)), rest, strict=True):
        cosine = writer.let(f"cosine_{side}", Sum(s, quad))
        near = Sum(ONE, cosine)
        beyond = Quotient(far, Sum(ONE, negative(cosine)))
        found.append(writer.let(f"shifted_{side}", Select(cosine, near, beyond)))
    plus, minus = found
    return plus, minus


def _versor(parameter: Parameter, where: str) -> PolynomialMultivector:
    value = value_of(parameter)
    if any(g % 2 for g in parameter.element.grades) or max(parameter.element.grades) > 4:
        raise UsageError(f"{where}: {parameter.element.name} must be even, with grades 0 to 4")
    return value


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
    planes = _one_plus_eigenvalues(algebra, writer, value)
    rest = _mean(writer, planes) if planes else Name(_one_plus_scalar(algebra, writer, value))
    twisted = {
        b: poly.scaled(p, -1)
        for b, p in poly.apply_bilinear(algebra.geometric, bivector, quad).items()
        if grade(b) == 2
    }
    if omega:
        square = negative(polynomial_expression(omega[0]))
        determinant = Product(*planes) if planes else MultiplyAdd(rest, rest, square)
        inverse = writer.let("inverse", Quotient(ONE, determinant))
        linear = writer.let("linear", Product(rest, inverse))
    else:
        linear = writer.let("linear", Quotient(ONE, rest))
        inverse = writer.let("inverse", Product(linear, linear)) if quad else linear
    out = _combination([(linear, bivector), (inverse, twisted)], {})
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    law = "(M − 1)(M + 1)⁻¹, M ~M = 1"
    notes = ("Infinite at M = −1, which no finite bivector reaches.",)
    return Kernel("cayley_inverse", law, program, None, namespace, None, notes)


def _mean(writer: Writer, planes: tuple[Expression, Expression]) -> Name:
    """1 + s from what it is with q and with −q."""
    mean = writer.let("shifted", Product(number(Fraction(1, 2)), Sum(*planes)))
    assert isinstance(mean, Name)
    return mean


def inverse_kernel(algebra: Algebra, operand: Element, result: Element, where: str) -> Kernel:
    """A⁻¹ = ~A (N − Q) / (N² − q) for A even or odd, n ≤ 5: A ~A = N + Q, Q of grade 4, Q² = q."""
    (parameter,) = parameters_for(operand)
    writer = Writer()
    value = value_of(parameter)
    if len({g % 2 for g in operand.grades}) != 1:
        return _mixed_inverse_kernel(algebra, parameter, result, where)
    square = poly.apply_bilinear(algebra.geometric, value, reversed_value(value))
    parts = square_of(algebra, writer, square, "q", where)
    norm = writer.let("norm2", polynomial_expression(parts.number))
    reversed_ = reversed_value(value)
    if not parts.quad:
        factor = writer.let("factor", Quotient(ONE, norm))
        out = _combination([(factor, reversed_)], {})
    else:
        omega = negative(polynomial_expression(parts.omega)) if parts.omega else None
        squared = MultiplyAdd(norm, norm, omega) if omega is not None else Product(norm, norm)
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

    So near M = −1 nothing cancels in it.
    """
    norm = poly.apply_bilinear(algebra.geometric, value, reversed_value(value))[0]
    rest = poly.added({0: norm}, {0: poly.times(value[0], value[0])}, -1)[0]
    s = polynomial_expression(value[0])
    far = Quotient(polynomial_expression(rest), Sum(ONE, negative(s)))
    writer.let("shifted", Select(s, Sum(ONE, s), far))
    return "shifted"


def sqrt_kernel(algebra: Algebra, operand: Element, result: Element, where: str) -> Kernel:
    """√M = (1 + M) (N + W)^(−1/2) for M ~M = 1, N + W = (1 + ~M)(1 + M) = 2 (1 + s) + 2 Q.

    s + Q: M's grades 0 and 4.
    """
    (parameter,) = parameters_for(operand)
    writer = Writer()
    value = _versor(parameter, where)
    quad = {b: p for b, p in value.items() if grade(b) == 4}
    planes = _one_plus_eigenvalues(algebra, writer, value)
    rest = _mean(writer, planes).text if planes else _one_plus_scalar(algebra, writer, value)
    shifted: Polynomial = {(rest,): 1}
    omega = poly.apply_bilinear(algebra.geometric, quad, quad)
    if any(omega.keys() - {0}):
        raise UsageError(f"{where}: closed forms exist for at most {MAXIMUM_DIMENSION} dimensions")
    parts = Square(shifted, quad, 1, omega.get(0, {}))
    value[0] = shifted
    out = _over_root(algebra, writer, value, parts, planes, twice=True)
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    notes = ("Not finite at M = −1, which is half a turn of the sheet from 1.",)
    return Kernel("sqrt", "√m: half the motion, √m √m = m", program, None, "", None, notes)


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
    planes: tuple[Expression, Expression] | None = None,
    *,
    twice: bool = False,
) -> dict[Blade, Expression]:
    """A (N + Q)^(−1/2) for a square N + Q that commutes with A; twice: A (2 N + 2 Q)^(−1/2).

    planes: N + q and N − q, q² = Q², where they are known better than from N and q.
    """
    half = number(Fraction(1, 2))
    norm = polynomial_expression(parts.number)
    content = ratio(-parts.content, 2)
    if planes and twice:
        roots = [
            writer.let(f"root_{side}", Call("sqrt", (Product(number(2), x),)))
            for side, x in zip(("plus", "minus"), planes, strict=True)
        ]
        radius = writer.let("radius", Product(*roots))
        root = writer.let("root", Sum(*roots))
        content = 4 * content
    else:
        radius = norm
        doubled: Expression = Product(number(2), norm)
        if parts.omega:
            omega = negative(polynomial_expression(parts.omega))
            radius = writer.let("radius", Call("sqrt", (MultiplyAdd(norm, norm, omega),)))
            doubled = Sum(norm, radius)
            if twice and any(x < 0 for x in parts.omega.values()):
                # boosts beside half an angle near π: N < 0, and nothing may cancel
                doubled = Select(norm, doubled, Quotient(omega, Sum(radius, negative(norm))))
        square = doubled if twice else Product(half, doubled) if parts.omega else norm
        root = writer.let("root", Call("sqrt", (square,)))
    if not parts.quad:
        factor = writer.let("factor", Quotient(ONE, root))
        return _combination([(factor, value)], {})

    def over(x: Expression) -> Expression:
        # near M = −1 the product of the roots, which are near 0 there, may underflow
        if twice:
            return Quotient(Quotient(x, radius), root)
        return Quotient(x, Product(root, radius))

    share: Expression = Quotient(root, radius)
    factor = writer.let("factor", Product(half, share) if twice else share)
    turned = poly.apply_bilinear(algebra.geometric, value, parts.quad)
    quad = next(iter(parts.quad.values()))
    if len(parts.quad) == 1 and len(quad) == 1:
        # one grade-4 blade: take it into the factor, so that each component costs one fma
        (blade,) = parts.quad
        turned = poly.apply_bilinear(algebra.geometric, value, {blade: {(): 1}})
        part = polynomial_expression(poly.scaled(quad, content))
        slip = writer.let("turn", over(part))
    else:
        slip = writer.let("slip", over(number(content)))
    return _combination([(factor, value), (slip, turned)], {})
