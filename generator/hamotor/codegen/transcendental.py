"""exp, log, Cayley and normalisation in closed form, for algebras whose rotation planes are simple.

Covered here: bivectors B with B² = −θ² + W, θ² a sum of squares, W of grade 4 and W² = 0: the
projective algebras of the plane and of space and the rotations of space.  With J(B) = <B W>/(2t),
W = 2 t I,

    exp B = cos θ + sinc θ B + sinc θ t I + (sinc θ − cos θ) t J(B) / θ²       (theory.md §7).

The programs are accurate for every finite input, not only for moderate ones:
* θ is a double-word number, so that sin θ is right to an ulp also near multiples of π and for
  large θ, where rounding θ alone would lose log10(θ) digits;
* t is a compensated dot product, so that the part of B along the axis does not leak into the part
  across it when sinc θ ≪ 1;
* rotation and translation parts are scaled by powers of two (exactly) when squares would overflow
  or underflow.
log is the principal one, exp(log M) = M, 0 ≤ θ ≤ π, by atan2 alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Algebra, Blade, grade
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import (
    Kernel,
    Staging,
    parameters_for,
    read_off,
    reversed_value,
    value_of,
)
from hamotor.codegen.polynomial import Polynomial, PolynomialMultivector
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
    number,
    polynomial_expression,
    sum_of_products,
)
from hamotor.errors import UsageError

ONE = number(1)
ZERO = number(0)


@dataclass(frozen=True)
class Plane:
    """How a bivector type splits: what the closed forms need to know about its algebra.

    rotation:    blades whose squares make −θ², with the sign of each component's name.
    translation: the other bivector blades, which square to zero.
    pitch:       (u, v, sign) terms of t: W = 2 t I, t = Σ sign · rotation_u · translation_v.
    along:       J: translation blade → (rotation blade, sign), J(B) = <B I>_2.
    """

    rotation: tuple[Blade, ...]
    translation: tuple[Blade, ...]
    pitch: tuple[tuple[Blade, Blade, int], ...]
    along: Mapping[Blade, tuple[Blade, int]]


def split_bivectors(algebra: Algebra, blades: Sequence[Blade], where: str) -> Plane:
    """Split the bivector blades; raises UsageError where the closed forms here do not apply."""
    names: PolynomialMultivector = {b: {(algebra.blade_name(b),): Fraction(1)} for b in blades}
    square = poly.apply_bilinear(algebra.geometric, names, names)
    rotation = [
        b for b in blades if square.get(0, {}).get((algebra.blade_name(b),) * 2, Fraction(0))
    ]
    scalar = {(algebra.blade_name(b),) * 2: Fraction(-1) for b in rotation}
    quad = [b for b in square if grade(b) == 4]
    translation = [b for b in blades if b not in rotation]
    pitch: list[tuple[Blade, Blade, int]] = []
    along: dict[Blade, tuple[Blade, int]] = {}
    simple = square.get(0, {}) == scalar and set(square) <= {0, *quad} and len(quad) <= 1
    if simple and quad:
        (pseudoscalar,) = quad
        for u in rotation:
            for v in translation:
                x = square[pseudoscalar].get(
                    tuple(sorted((algebra.blade_name(u), algebra.blade_name(v))))
                )
                if x:
                    pitch.append((u, v, int(x / 2)))
            for v, x in algebra.blade_product(u, pseudoscalar).items():
                along[v] = (u, int(x))
        expected = sum(len(p) for b, p in square.items() if b)
        simple = len(pitch) == expected and set(along) <= set(translation)
        simple = simple and not algebra.blade_product(pseudoscalar, pseudoscalar)
    if not simple:
        raise UsageError(
            f"{where}: exp and log in closed form need bivectors with B² = −θ² + W and W² = 0; "
            f"those of {algebra.name} are not of that kind"
        )
    return Plane(tuple(rotation), tuple(translation), tuple(pitch), along)


class Writer:
    """Collects bindings; `let` names an expression and returns the name."""

    def __init__(self) -> None:
        """Start empty."""
        self.bindings: list[tuple[str, Expression]] = []

    def let(self, name: str, expression: Expression) -> Expression:
        """Bind, unless the expression is already a name, its negative or a constant."""
        if isinstance(expression, Name | Number):
            return expression
        if isinstance(expression, Negative) and isinstance(expression.x, Name):
            return expression
        self.bindings.append((name, expression))
        return Name(name)


def call(function: str, *arguments: Expression) -> Call:
    """A scalar function of the runtime."""
    return Call(function, arguments)


def signed(sign: int, x: Expression) -> Expression:
    """±x."""
    return x if sign > 0 else negative(x)


def _coefficients(
    writer: Writer, algebra: Algebra, value: PolynomialMultivector, prefix: str
) -> dict[Blade, Expression]:
    return {
        blade: writer.let(f"{prefix}_{algebra.blade_name(blade)}", polynomial_expression(p))
        for blade, p in sorted(value.items())
    }


def _outputs(
    values: Mapping[Blade, Expression], result: Element
) -> tuple[tuple[str, Expression], ...]:
    """Read the components of the result off named blade coefficients."""
    names: PolynomialMultivector = {b: {(f"#{b}",): Fraction(1)} for b in values}
    outputs: list[tuple[str, Expression]] = []
    for component, p in read_off(names, result).items():
        if len(p) == 1:
            ((monomial, x),) = p.items()
            inner = values[int(monomial[0][1:])]
            if abs(x) == 1:
                outputs.append((component, signed(int(x), inner)))
            else:
                outputs.append((component, Product(number(x), inner)))
        else:
            terms: list[tuple[Expression, ...]] = [
                (number(x), values[int(m[0][1:])]) for m, x in p.items()
            ]
            outputs.append((component, sum_of_products(terms)))
    return tuple(outputs)


def _scaled(
    writer: Writer, values: dict[Blade, Expression], prefix: str, algebra: Algebra
) -> tuple[Expression, dict[Blade, Expression]]:
    """The values times a power of two that keeps their squares in range, and that power."""
    scale = writer.let(f"{prefix}_scale", call("range_scale", call("max_abs", *values.values())))
    return scale, {
        b: writer.let(f"{prefix}_{algebra.blade_name(b)}", Product(scale, x))
        for b, x in values.items()
    }


def _squared(values: Mapping[Blade, Expression]) -> list[Expression]:
    return [x for value in values.values() for x in (value, value)]


def _dot_terms(
    plane: Plane, rotation: Mapping[Blade, Expression], translation: Mapping[Blade, Expression]
) -> list[Expression]:
    terms: list[Expression] = []
    for u, v, sign in plane.pitch:
        terms += [signed(sign, rotation[u]), translation[v]]
    return terms


def exp_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """exp of a bivector or rate."""
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    plane = split_bivectors(algebra, sorted(value), where)
    writer = Writer()
    b = _coefficients(writer, algebra, value, "b")
    ws_scale, ws = _scaled(writer, {u: b[u] for u in plane.rotation}, "w", algebra)
    squares = call("compensated_dot_pair", *_squared(ws))
    theta_s = writer.let("scaled_angle", call("double_word_sqrt", squares))
    theta = writer.let("angle", call("double_word_unscale", theta_s, ws_scale))
    writer.let("turn", call("sin_cos", theta))
    sine, cosine = Name("turn.sin"), Name("turn.cos")
    hi = Name("angle.hi")
    sinc = writer.let("sinc", Select(hi, Quotient(sine, hi), ONE))
    out: dict[Blade, Expression] = {0: cosine}
    for u in plane.rotation:
        out[u] = Product(sinc, b[u])
    if plane.pitch:
        vs_scale, vs = _scaled(writer, {v: b[v] for v in plane.translation}, "v", algebra)
        unscale = writer.let("v_unscale", Quotient(ONE, vs_scale))
        dot = call("compensated_dot", *_dot_terms(plane, ws, vs))
        theta_hi = Name("scaled_angle.hi")
        pitch = writer.let("pitch", Select(theta_hi, Quotient(dot, theta_hi), ZERO))
        inverse = writer.let("inverse_angle", Select(theta_hi, Quotient(ONE, theta_hi), ZERO))
        along = writer.let(
            "along",
            Product(Product(Sum(sinc, Negative(cosine)), inverse), pitch),
        )
        for v in plane.translation:
            terms: Expression = Product(sinc, vs[v])
            if v in plane.along:
                u, sign = plane.along[v]
                terms = MultiplyAdd(along, signed(sign, ws[u]), terms)
            out[v] = Product(unscale, terms)
        out[_quadrivector(plane)] = Product(unscale, Product(sine, pitch))
    else:
        for v in plane.translation:
            out[v] = Product(sinc, b[v])
    program = Program((parameter,), tuple(writer.bindings), _outputs(out, result), result)
    return Kernel(
        "exp",
        "exp(B) = 1 + B + B²/2 + …",
        program,
        None,
        namespace,
        None,
        ("Accurate to 4 ulp of the result's norm for every finite B.",),
    )


def _quadrivector(plane: Plane) -> Blade:
    u, v, _ = plane.pitch[0]
    return u | v


def log_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """Principal logarithm of a unit versor: exp(log M) = M, angle θ in [0, π]."""
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    plane = split_bivectors(algebra, [b for b in sorted(value) if grade(b) == 2], where)
    writer = Writer()
    m = _coefficients(writer, algebra, value, "m")
    scalar = m[0]
    ws_scale, ws = _scaled(writer, {u: m[u] for u in plane.rotation}, "r", algebra)
    squares = writer.let("squares", call("compensated_dot_pair", *_squared(ws)))
    writer.let("scaled_sine", call("double_word_sqrt", squares))
    sine_s = Name("scaled_sine.hi")
    sine = writer.let("sine", Quotient(sine_s, ws_scale))
    angle = writer.let("angle", call("atan2", sine, scalar))
    inverse = writer.let("inverse_sine", Select(sine_s, Quotient(ONE, sine_s), ZERO))
    ratio = writer.let("ratio", Product(angle, inverse))
    out: dict[Blade, Expression] = {u: Product(ratio, ws[u]) for u in plane.rotation}
    notes = ["Principal: exp(log M) = M with half angle in [0, π]; accurate to 4 ulp of the norm."]
    # A half turn of the sheet: M = −T has any axis; the one along its translation gives exp back.
    half_turn = writer.let("half_turn", Select(Negative(scalar), call("pi"), ZERO))
    if plane.pitch:
        vs_scale, vs = _scaled(writer, {v: m[v] for v in plane.translation}, "q", algebra)
        unscale = writer.let("q_unscale", Quotient(ONE, vs_scale))
        dot = writer.let("dot", call("compensated_dot_pair", *_dot_terms(plane, ws, vs)))
        writer.let("share", call("double_word_ratio", dot, squares))
        quad = _quadrivector(plane)
        pss = Product(vs_scale, m[quad])
        norm2 = MultiplyAdd(scalar, scalar, Product(sine, sine))
        pitch = writer.let(
            "pitch",
            Quotient(
                MultiplyAdd(scalar, Product(Name("dot.hi"), inverse), Product(sine, pss)), norm2
            ),
        )
        along = writer.let("along", Product(pitch, inverse))
        length2 = sum_of_products([(vs[v], vs[v]) for v in plane.along])
        length = writer.let("q_length", call("sqrt", length2))
        over = writer.let("half_turn_ratio", Select(length, Quotient(half_turn, length), ZERO))
        first = plane.rotation[0]
        for u in plane.rotation:
            v, sign = next((v, s) for v, (w, s) in plane.along.items() if w == u)
            axis: Expression = Product(over, signed(sign, vs[v]))
            axis = Select(length, axis, half_turn if u == first else ZERO)
            out[u] = Select(sine_s, out[u], axis)
        straight = writer.let("straight", Quotient(ONE, scalar))
        for v in plane.translation:
            u, sign = plane.along[v]
            across = MultiplyAdd(
                Name("share.lo"),
                signed(sign, ws[u]),
                MultiplyAdd(Name("share.hi"), signed(sign, ws[u]), vs[v]),
            )
            general = MultiplyAdd(
                Negative(along), signed(sign, ws[u]), Product(angle, Quotient(across, sine))
            )
            out[v] = Product(unscale, Select(sine_s, general, Product(straight, vs[v])))
    else:
        translation = [m[v] for v in plane.translation]
        if translation:
            size = writer.let("q_size", call("max_abs", *translation))
            half_turn = writer.let("turned", Select(size, ZERO, half_turn))
            straight = writer.let("straight", Quotient(ONE, scalar))
            notes.append(
                "−T, T ≠ 1 a translation, has no logarithm here; that of T, the same motion, is "
                "given."
            )
            for v in plane.translation:
                out[v] = Select(
                    sine_s, Product(angle, Quotient(m[v], sine)), Product(straight, m[v])
                )
        first = plane.rotation[0]
        out[first] = Select(sine_s, out[first], half_turn)
    program = Program((parameter,), tuple(writer.bindings), _outputs(out, result), result)
    return Kernel("log", "log(M), M ~M = 1", program, None, namespace, None, tuple(notes))


def _named(writer: Staging, name: str, expression: Expression) -> Polynomial:
    writer.bindings.append((name, expression))
    return {(name,): Fraction(1)}


def cayley_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """(1 + B)(1 − B)⁻¹ = [1 − S² + 2W + 2(1 − S)B + 2<BW>] / (1 − S)², B² = S + W, W² = 0."""
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    split_bivectors(algebra, sorted(value), where)
    staging = Staging()
    value = {
        b: staging.bind(f"b_{algebra.blade_name(b)}", p)
        if len(p) > 1 or any(abs(x) != 1 for x in p.values())
        else p
        for b, p in sorted(value.items())
    }
    square = poly.apply_bilinear(algebra.geometric, value, value)
    s = staging.bind("s", square.get(0, {}))
    _named(
        staging,
        "inverse",
        Quotient(ONE, polynomial_expression(poly_sum({(): Fraction(1)}, s, Fraction(-1)))),
    )
    twice = _named(staging, "twice", Product(number(2), Name("inverse")))
    out: dict[Blade, Expression] = {
        0: Product(
            polynomial_expression(poly_sum({(): Fraction(1)}, s, Fraction(1))), Name("inverse")
        )
    }
    w = {b: staging.bind(f"w_{algebra.blade_name(b)}", p) for b, p in square.items() if b}
    factor = _named(staging, "w_factor", Product(Name("twice"), Name("inverse"))) if w else {}
    turned = poly.apply_bilinear(algebra.geometric, value, w)
    for b, p in w.items():
        out[b] = polynomial_expression(poly.times(factor, p))
    for b, p in value.items():
        first = polynomial_expression(poly.times(twice, p))
        extra = turned.get(b)
        out[b] = (
            MultiplyAdd(Name("w_factor"), polynomial_expression(extra), first) if extra else first
        )
    program = Program((parameter,), tuple(staging.bindings), _outputs(out, result), result)
    return Kernel("cayley", "(1 + B)(1 − B)⁻¹", program, None, namespace)


def poly_sum(a: Polynomial, b: Polynomial, factor: Fraction) -> Polynomial:
    """a + factor b."""
    total = dict(a)
    poly.add_scaled(total, b, factor)
    return total


def cayley_inverse_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """(M − 1)(M + 1)⁻¹ = <M>₂ (1 + s + p)⁻¹ for M ~M = 1, M = s + <M>₂ + p, p² = 0."""
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    bivector = {b: p for b, p in value.items() if grade(b) == 2}
    split_bivectors(algebra, sorted(bivector), where)
    quad = {b: p for b, p in value.items() if grade(b) == 4}
    staging = Staging()
    inverse = _named(
        staging,
        "inverse",
        Quotient(ONE, polynomial_expression(poly_sum({(): Fraction(1)}, value[0], Fraction(1)))),
    )
    out: dict[Blade, Expression] = {}
    turned = poly.apply_bilinear(algebra.geometric, bivector, quad)
    if quad:
        _named(
            staging,
            "slope",
            Product(
                polynomial_expression(poly.times(inverse, next(iter(quad.values())))),
                Name("inverse"),
            ),
        )
    for b, p in bivector.items():
        first = polynomial_expression(poly.times(inverse, p))
        if b in turned:
            ((monomial, x),) = turned[b].items()
            other = next(n for n in monomial if {(n,): Fraction(1)} not in quad.values())
            out[b] = MultiplyAdd(Name("slope"), signed(-int(x), Name(other)), first)
        else:
            out[b] = first
    program = Program((parameter,), tuple(staging.bindings), _outputs(out, result), result)
    return Kernel(
        "cayley_inverse",
        "(M − 1)(M + 1)⁻¹, M ~M = 1",
        program,
        None,
        namespace,
        None,
        ("Infinite at M = −1, which no finite B reaches.",),
    )


def normalize_kernel(algebra: Algebra, operand: Element, result: Element) -> Kernel:
    """M (~M M)^(−1/2) for an even M with ~M M = N + η I, I² = 0 (theory.md §7)."""
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    square = poly.apply_bilinear(algebra.geometric, reversed_value(value), value)
    rest = [b for b in square if b]
    if any(grade(b) != 4 for b in rest) or len(rest) > 1:
        raise UsageError(
            f"{algebra.name}: normalize {operand.name}: ~M M must be a number plus one null blade "
            "of grade 4"
        )
    staging = Staging()
    norm = staging.bind("norm2", square[0])
    _named(staging, "factor", Quotient(ONE, call("sqrt", polynomial_expression(norm))))
    out: dict[Blade, Expression] = {}
    scaled = {b: poly.times({("factor",): Fraction(1)}, p) for b, p in value.items()}
    if rest:
        (blade,) = rest
        eta = staging.bind("eta", square[blade])
        ((eta_name, eta_scale),) = eta.items()
        _named(
            staging,
            "slip",
            Quotient(
                Product(Product(number(-eta_scale / 2), Name(eta_name[0])), Name("factor")),
                polynomial_expression(norm),
            ),
        )
        turned = poly.apply_bilinear(algebra.geometric, value, {blade: {("slip",): Fraction(1)}})
        for b, p in scaled.items():
            first = polynomial_expression(p)
            if b in turned:
                ((monomial, x),) = turned[b].items()
                other = next(n for n in monomial if n != "slip")
                out[b] = MultiplyAdd(Name("slip"), signed(int(x), Name(other)), first)
            else:
                out[b] = first
    else:
        out = {b: polynomial_expression(p) for b, p in scaled.items()}
    program = Program((parameter,), tuple(staging.bindings), _outputs(out, result), result)
    return Kernel(
        "normalize",
        "M (~M M)^(−1/2): the unit versor nearest to M",
        program,
        None,
    )


__all__ = [
    "cayley_inverse_kernel",
    "cayley_kernel",
    "exp_kernel",
    "log_kernel",
    "normalize_kernel",
]
