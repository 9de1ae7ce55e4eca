"""exp and log accurate for every input, for algebras whose rotations have one plane.

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

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Algebra, Blade, grade
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import (
    Kernel,
    parameters_for,
    read_off,
    value_of,
)
from hamotor.codegen.polynomial import PolynomialMultivector
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


def split_bivectors(algebra: Algebra, blades: Sequence[Blade]) -> Plane | None:
    """Split the bivector blades; None where the closed forms here do not apply."""
    names: PolynomialMultivector = {b: {(algebra.blade_name(b),): 1} for b in blades}
    square = poly.apply_bilinear(algebra.geometric, names, names)
    rotation = [b for b in blades if square.get(0, {}).get((algebra.blade_name(b),) * 2, 0)]
    scalar = {(algebra.blade_name(b),) * 2: -1 for b in rotation}
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
        return None
    return Plane(tuple(rotation), tuple(translation), tuple(pitch), along)


def _required_split(algebra: Algebra, blades: Sequence[Blade], where: str) -> Plane:
    plane = split_bivectors(algebra, blades)
    if plane is None:
        raise UsageError(
            f"{where}: this closed form needs bivectors with B² = −θ² + W and W² = 0; "
            f"those of {algebra.name} are not of that kind"
        )
    return plane


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
    names: PolynomialMultivector = {b: {(f"#{b}",): 1} for b in values}
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
    plane = _required_split(algebra, sorted(value), where)
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
    plane = _required_split(algebra, [b for b in sorted(value) if grade(b) == 2], where)
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
        dot = writer.let("overlap", call("compensated_dot_pair", *_dot_terms(plane, ws, vs)))
        writer.let("share", call("double_word_ratio", dot, squares))
        quad = _quadrivector(plane)
        pss = Product(vs_scale, m[quad])
        norm2 = MultiplyAdd(scalar, scalar, Product(sine, sine))
        pitch = writer.let(
            "pitch",
            Quotient(
                MultiplyAdd(scalar, Product(Name("overlap.hi"), inverse), Product(sine, pss)), norm2
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


__all__ = [
    "exp_kernel",
    "log_kernel",
]
