"""exp, log, Cayley maps, normalisation: accurate for every input, where rotations have one plane.

Covered here: bivectors B with B² = −θ² + W, θ² a sum of squares, W of grade 4 and W² = 0: the
projective algebras of the plane and of space and the rotations of space.  With J(B) = <B W>/(2t),
W = 2 t I,

    exp B = cos θ + sinc θ B + sinc θ t I + (sinc θ − cos θ) t J(B) / θ²       (theory.md §7).

The programs are accurate for every finite input, not only for moderate ones:
* θ is a double-word number, so that sin θ is right to an ulp also near multiples of π and for
  large θ, where rounding θ alone would lose log10(θ) digits;
* sums that may cancel are compensated: the part of B along the axis does not leak into the part
  across it when sinc θ ≪ 1, nor that of M near −1;
* rotation and translation parts are scaled by powers of two (exactly) when squares would overflow
  or underflow.
log is the principal one, exp(log M) = M, 0 ≤ θ ≤ π, by atan2 alone.  It, Cayley's maps and
`normalize` take a motor that is not quite a unit for the unit motor nearest to it.
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
    parameters_for,
    value_of,
)
from hamotor.codegen.polynomial import PolynomialMultivector
from hamotor.codegen.program import (
    Call,
    Expression,
    MultiplyAdd,
    Name,
    Negative,
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
from hamotor.codegen.writer import Writer, outputs_for
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


def required_split(algebra: Algebra, blades: Sequence[Blade], where: str) -> Plane:
    if others := [algebra.blade_name(b) for b in blades if grade(b) != 2]:
        raise UsageError(f"{where}: takes bivectors, which {', '.join(others)} are not")
    plane = split_bivectors(algebra, blades)
    if plane is None:
        raise UsageError(
            f"{where}: this closed form needs bivectors with B² = −θ² + W and W² = 0; "
            f"those of {algebra.name} are not of that kind"
        )
    return plane


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


@dataclass(frozen=True)
class Scaled:
    """Numbers times the power of two that keeps their squares in range.

    inward, outward: names of that power and its inverse; the roots are their square roots.
    """

    values: dict[Blade, Expression]
    inward: Expression
    outward: Expression
    root_inward: Expression
    root_outward: Expression


def _scaled(
    writer: Writer,
    values: Mapping[Blade, Expression],
    prefix: str,
    algebra: Algebra,
    *others: Expression,
) -> Scaled:
    """Scale values by the largest of them and of the others."""
    name = f"{prefix}_scaling"
    writer.let(name, call("scaling", call("max_abs", *others, *values.values())))
    inward, outward, root_inward, root_outward = (
        Name(f"{name}.{field}") for field in ("in", "out", "root_in", "root_out")
    )
    scaled = {
        b: writer.let(f"{prefix}_{algebra.blade_name(b)}", Product(inward, x))
        for b, x in values.items()
    }
    return Scaled(scaled, inward, outward, root_inward, root_outward)


def _squared(values: Mapping[Blade, Expression]) -> list[Expression]:
    return [x for value in values.values() for x in (value, value)]


def pitch_pairs(
    plane: Plane, rotation: Mapping[Blade, Expression]
) -> list[tuple[Expression, Blade]]:
    """The factors of t = Σ rotation_u translation_v: signed rotation part and blade v."""
    return [(signed(sign, rotation[u]), v) for u, v, sign in plane.pitch]


def axis_part(plane: Plane, rotation: Mapping[Blade, Expression]) -> dict[Blade, Expression]:
    """J of the rotation part: the translation blades along the axis."""
    return {v: signed(sign, rotation[u]) for v, (u, sign) in plane.along.items()}


def _commutator(
    algebra: Algebra, a: Mapping[Blade, Expression], b: Mapping[Blade, Expression]
) -> dict[Blade, list[tuple[Expression, Expression]]]:
    """a × b = ½(ab − ba) as sums of signed products."""
    result: dict[Blade, list[tuple[Expression, Expression]]] = {}
    for blade_a, x in a.items():
        for blade_b, y in b.items():
            for blade, sign in algebra.commutator(blade_a, blade_b).items():
                result.setdefault(blade, []).append((signed(int(sign), x), y))
    return result


def _part(pair: Expression, part: str) -> Name:
    """The `hi` or `lo` of a named double-word number."""
    assert isinstance(pair, Name)
    return Name(f"{pair.text}.{part}")


def exp_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """exp of a bivector or rate."""
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    plane = required_split(algebra, sorted(value), where)
    writer = Writer()
    b = _coefficients(writer, algebra, value, "b")
    w = _scaled(writer, {u: b[u] for u in plane.rotation}, "w", algebra)
    # sin and cos of √hi take longest: they start before what its rounding lost is known.
    writer.let("squares", call("compensated_dot_parts", *_squared(w.values)))
    writer.let("root", call("double_word_sqrt_parts", Name("squares")))
    writer.let("angle", call("double_word_scaled", Name("root"), w.outward))
    writer.let("turn", call("sin_cos", Name("angle")))
    sine, cosine = Name("turn.sin"), Name("turn.cos")
    length = writer.let("length", Sum(Name("root.hi"), Name("root.lo")))
    spin = writer.let("spin", Select(length, Quotient(sine, length), ZERO))
    out: dict[Blade, Expression] = {0: cosine}
    for u in plane.rotation:
        out[u] = Product(spin, w.values[u])
    if plane.translation:
        # Scaled up, θ is so small that sin θ / θ is 1; sin θ itself may be denormal there.
        moderate = Sum(number(Fraction(3, 2)), Negative(w.inward))
        sinc = writer.let("sinc", Select(moderate, Product(spin, w.inward), ONE))
    if plane.pitch:
        v = _scaled(writer, {v: b[v] for v in plane.translation}, "v", algebra)
        terms = [x for axis, blade in pitch_pairs(plane, w.values) for x in (axis, v.values[blade])]
        exact = writer.let("overlap", call("compensated_dot_parts", *terms))
        product = writer.let("product", Sum(_part(exact, "hi"), _part(exact, "lo")))
        # Far from θ = 0 the translation along the axis is mostly made of this.
        writer.let("ratio", call("double_word_ratio", exact, Name("squares")))
        share = Select(length, Name("ratio.hi"), ZERO)
        along = writer.let("along", Product(Sum(sinc, Negative(cosine)), share))
        axis = axis_part(plane, w.values)
        for blade in plane.translation:
            moved: Expression = Product(sinc, v.values[blade])
            if blade in axis:
                moved = MultiplyAdd(along, axis[blade], moved)
            out[blade] = Product(v.outward, moved)
        out[quadrivector(plane)] = Product(v.outward, Product(spin, product))
    else:
        for blade in plane.translation:
            out[blade] = Product(sinc, b[blade])
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    bound = "Relative error at most 4 ulp of the result's norm"
    notes = [f"{bound}, for half angles up to 1/(8 ε)."]
    if plane.translation:
        notes = [f"{bound} and ε² of the translation's, for half", "angles up to 1/(8 ε)."]
    return Kernel("exp", "exp(B) = 1 + B + B²/2 + …", program, None, namespace, None, tuple(notes))


def quadrivector(plane: Plane) -> Blade:
    u, v, _ = plane.pitch[0]
    return u | v


def log_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """Principal logarithm of a unit versor: exp(log M) = M, angle θ in [0, π].

    With M = cos θ + sin θ L + …: the rotation part is θ L; the translation part is θ / sin θ
    times the part of M's across the axis, −L × (L × M), plus the pitch along it.
    """
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    plane = required_split(algebra, [b for b in sorted(value) if grade(b) == 2], where)
    writer = Writer()
    m = _coefficients(writer, algebra, value, "m")
    cosine = m[0]
    r = _scaled(writer, {u: m[u] for u in plane.rotation}, "r", algebra)
    squares = writer.let("squares", call("compensated_dot_parts", *_squared(r.values)))
    square = writer.let("square", Sum(_part(squares, "hi"), _part(squares, "lo")))
    length = writer.let("length", call("sqrt", square))
    sine = writer.let("sine", Product(length, r.outward))
    angle = writer.let("angle", call("atan2", sine, cosine))
    # θ / sin θ itself where it is moderate; else scaled, and applied in steps that stay in range.
    ratio = Select(cosine, Quotient(angle, sine), Quotient(angle, length))
    stretch = writer.let("stretch", Select(length, ratio, ZERO))
    out: dict[Blade, Expression] = {
        u: Product(stretch, Select(cosine, m[u], x)) for u, x in r.values.items()
    }
    half_turn = writer.let("half_turn", Select(Negative(cosine), call("pi"), ZERO))
    first = plane.rotation[0]
    notes = [
        "Principal: exp(log M) = M with half angle in [0, π].  Relative error at most 4 ulp of the",
        "result's norm.",
    ]
    if not plane.translation:
        out[first] = Select(length, out[first], half_turn)
        program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
        return Kernel("log", "log(M), M ~M = 1", program, None, namespace, None, tuple(notes))

    straight = writer.let("straight", Quotient(ONE, cosine))
    moved = {v: m[v] for v in plane.translation}
    if not plane.pitch:
        root = writer.let("root", Select(cosine, ONE, r.root_inward))
        size = writer.let("q_size", call("max_abs", *moved.values()))
        turned = writer.let("turned", Select(size, ZERO, half_turn))
        out[first] = Select(length, out[first], turned)
        for blade, x in moved.items():
            across = Product(Product(Product(stretch, x), root), root)
            out[blade] = Select(length, across, Product(straight, x))
        notes.append(
            "−T, T ≠ 1 a translation, has no logarithm here; that of T, the same motion, is given."
        )
        program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
        return Kernel("log", "log(M), M ~M = 1", program, None, namespace, None, tuple(notes))

    quad = quadrivector(plane)
    q = _scaled(writer, moved | {quad: m[quad]}, "q", algebra)
    root = writer.let(
        "root", Select(cosine, q.root_outward, Product(r.root_inward, q.root_outward))
    )
    inverse = writer.let("inverse", call("double_word_reciprocal", squares))
    terms = [x for part, v in pitch_pairs(plane, r.values) for x in (part, q.values[v])]
    overlap = writer.let("overlap", call("compensated_dot_pair", *terms))
    share = writer.let("share", call("double_word_product", overlap, inverse))
    terms = [cosine, _part(share, "hi"), q.values[quad], r.outward]
    pitch = writer.let("pitch", call("compensated_dot_parts", *terms))
    low = MultiplyAdd(cosine, _part(share, "lo"), _part(pitch, "lo"))
    lengthwise = Sum(_part(pitch, "hi"), low)
    sine2 = Product(square, r.outward), r.outward
    norm2 = writer.let("norm2", sum_of_products([sine2, (cosine, cosine)]))
    along = writer.let("along", Quotient(negative(lengthwise), norm2))
    q_moved = {v: q.values[v] for v in moved}
    normal = {}
    for blade, ((a, b), (c, d)) in _commutator(algebra, r.values, q_moved).items():
        name = algebra.blade_name(blade)
        exact = writer.let(f"moment_{name}", call("compensated_dot_pair", a, b, c, d))
        product = writer.let(f"n_{name}", call("double_word_product", exact, inverse))
        normal[blade] = _part(product, "hi")
    axis = axis_part(plane, r.values)
    double = _commutator(algebra, r.values, normal)
    # −T turns by π about the direction of its translation.
    squares = sum_of_products([(q.values[v], q.values[v]) for v in moved])
    q_length = writer.let("q_length", call("sqrt", squares))
    turn = writer.let("turn", Select(q_length, Quotient(half_turn, q_length), ZERO))
    for blade, x in axis.items():
        u, sign = plane.along[blade]
        about: Expression = Product(turn, signed(-sign, q.values[blade]))
        about = Select(q_length, about, half_turn if u == first else ZERO)
        out[u] = Select(length, out[u], about)
        (a, b), (c, d) = double[blade]
        # Rounded twice, also where the processor does not fuse.
        part = Product(stretch, negative(call("fma", c, d, Product(a, b))))
        across = Product(Product(part, root), root)
        moved_along = Product(Product(along, x), q.outward)
        out[blade] = Select(length, Sum(across, moved_along), Product(straight, m[blade]))
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    return Kernel("log", "log(M), M ~M = 1", program, None, namespace, None, tuple(notes))


def cayley_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """(1 + B)(1 − B)⁻¹: the rotation by 2 atan θ and what it does to the rest.

    With B = r + q, D = 1 + θ², g = r / D: 2 g, and 2 (q / D − 2 (g·q) g) for the translation part.
    """
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    plane = required_split(algebra, sorted(value), where)
    writer = Writer()
    b = _coefficients(writer, algebra, value, "b")
    r = _scaled(writer, {u: b[u] for u in plane.rotation}, "r", algebra, ONE)
    squares = _squared(r.values)
    writer.let("total", call("compensated_dot_pair", r.inward, r.inward, *squares))
    inverse = writer.let("inverse", Quotient(ONE, Name("total.hi")))
    rest = sum_of_products([(r.inward, r.inward), *((negative(x), x) for x in r.values.values())])
    out: dict[Blade, Expression] = {0: Product(rest, inverse)}
    twice = writer.let("twice", Product(number(2), inverse))
    factor = writer.let("factor", Product(twice, r.inward))
    for u, x in r.values.items():
        out[u] = Product(factor, x)
    if plane.pitch:
        q = _scaled(writer, {v: b[v] for v in plane.translation}, "q", algebra)
        root = writer.let("root", Product(r.inward, q.root_outward))
        terms = [x for part, v in pitch_pairs(plane, r.values) for x in (part, q.values[v])]
        writer.let("product", call("compensated_dot_pair", *terms))
        writer.let("ratio", call("double_word_ratio", Name("product"), Name("total")))
        pitch = writer.let("pitch", Product(number(2), Name("ratio.hi")))
        pitch_low = writer.let("pitch_low", Product(number(2), Name("ratio.lo")))
        axis = axis_part(plane, r.values)
        for v, x in q.values.items():
            moved = x
            if v in axis:
                moved = MultiplyAdd(pitch_low, axis[v], MultiplyAdd(pitch, axis[v], x))
            out[v] = Product(Product(Product(twice, moved), root), root)
        screw = Product(Product(Product(factor, pitch), root), root)
        out[quadrivector(plane)] = screw
    else:
        for v in plane.translation:
            out[v] = Product(Product(factor, b[v]), r.inward)
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    notes = ("Relative error at most 4 ulp of the result's norm.",)
    return Kernel("cayley", "(1 + B)(1 − B)⁻¹", program, None, namespace, None, notes)


def cayley_inverse_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """(M − 1)(M + 1)⁻¹ for M ~M = 1.

    With M = c + r + q + p: r / (1 + c) for the rotation part.  For c ≤ 0 the same number
    is (1 − c) r / r², which does not cancel near M = −1.
    """
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    plane = required_split(algebra, [b for b in sorted(value) if grade(b) == 2], where)
    writer = Writer()
    m = _coefficients(writer, algebra, value, "m")
    cosine = m[0]
    r = _scaled(writer, {u: m[u] for u in plane.rotation}, "r", algebra)
    writer.let("squares", call("compensated_dot_pair", *_squared(r.values)))
    square = Name("squares.hi")
    near = Quotient(ONE, Sum(ONE, cosine))
    far = Quotient(Sum(ONE, negative(cosine)), square)
    inverse = writer.let("inverse", Select(cosine, near, far))
    size = writer.let("size", Select(cosine, r.outward, r.inward))
    out: dict[Blade, Expression] = {
        u: Product(Product(inverse, x), size) for u, x in r.values.items()
    }
    moved = {v: m[v] for v in plane.translation}
    root: Expression = Select(cosine, ONE, r.root_inward)
    if plane.pitch:
        quad = quadrivector(plane)
        q = _scaled(writer, moved | {quad: m[quad]}, "q", algebra)
        root = Product(root, q.root_outward)
        terms = [x for part, v in pitch_pairs(plane, r.values) for x in (part, q.values[v])]
        writer.let("product", call("compensated_dot_pair", *terms))
        writer.let("ratio", call("double_word_ratio", Name("product"), Name("squares")))
        share, share_low = (
            writer.let(name, Select(square, Name(f"ratio.{part}"), ZERO))
            for name, part in (("share", "hi"), ("share_low", "lo"))
        )
        terms = [cosine, share, cosine, share_low, q.values[quad], r.outward]
        along = writer.let("along", negative(call("compensated_dot", *terms)))
        for v, x in axis_part(plane, r.values).items():
            terms = [x, along, x, share, x, share_low, q.values[v], ONE]
            moved[v] = call("compensated_dot", *terms)
    if plane.translation:
        root = writer.let("root", root)
        inward = writer.let("inward", Select(cosine, ONE, r.inward))
    for v, x in moved.items():
        out[v] = Product(Product(Product(Product(x, root), inverse), inward), root)
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    law = "(M − 1)(M + 1)⁻¹, M ~M = 1"
    notes = (
        "Relative error at most 4 ulp of the result's norm.  Infinite or not a number at M = −1,",
        "which no finite bivector reaches.",
    )
    return Kernel("cayley_inverse", law, program, None, namespace, None, notes)


def normalize_kernel(algebra: Algebra, operand: Element, result: Element, where: str) -> Kernel:
    """M (~M M)^(−1/2): the unit versor nearest to M, with ~M M = N² + 2 e I."""
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    plane = required_split(algebra, [b for b in sorted(value) if grade(b) == 2], where)
    writer = Writer()
    m = _coefficients(writer, algebra, value, "m")
    r = _scaled(writer, {u: m[u] for u in (0, *plane.rotation)}, "r", algebra)
    square = writer.let("square", sum_of_products([(x, x) for x in r.values.values()]))
    inverse = writer.let("inverse", Quotient(ONE, call("sqrt", square)))
    out: dict[Blade, Expression] = {u: Product(inverse, x) for u, x in r.values.items()}
    if plane.translation:
        quads = [quadrivector(plane)] if plane.pitch else []
        q = _scaled(writer, {v: m[v] for v in (*plane.translation, *quads)}, "q", algebra)
        root = writer.let("root", Product(r.root_inward, q.root_outward))
        moved = q.values
        if plane.pitch:
            quad = quadrivector(plane)
            products = [(negative(x), q.values[v]) for x, v in pitch_pairs(plane, r.values)]
            defect = sum_of_products([(r.values[0], q.values[quad]), *products])
            slip = negative(writer.let("slip", Quotient(defect, square)))
            across = axis_part(plane, r.values) | {quad: r.values[0]}
            moved = {v: MultiplyAdd(slip, across[v], x) for v, x in moved.items()}
        # What is known last is multiplied once.
        factor = writer.let("factor", Product(inverse, root))
        for v, x in moved.items():
            out[v] = Product(Product(x, root), factor)
    program = Program((parameter,), tuple(writer.bindings), outputs_for(out, result), result)
    law = "M (~M M)^(−1/2): the unit versor nearest to M"
    notes = ("Relative error at most 4 ulp of the result's norm, unless M has no rotor part.",)
    return Kernel("normalize", law, program, None, "", None, notes)


__all__ = [
    "cayley_inverse_kernel",
    "cayley_kernel",
    "exp_kernel",
    "log_kernel",
    "normalize_kernel",
]
