"""Lean exp and log: the fewest operations, accurate where nothing is extreme.

The closed forms of `transcendental.py` without what makes those accurate for every input: θ is one
number, sums are plain, nothing is scaled.  Both are emitted under names of their own, `exp_lean`
beside `exp`, and only where a spec asks; their notes say what the saving costs.  The lean Cayley
maps and the lean normalisation are the general ones of `closedform.py`.

Where the lean logarithm is as accurate as the general one, `log` itself takes it, as a shortcut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fractions import Fraction

from hamotor.codegen import closedform, transcendental
from hamotor.codegen.algebra import Algebra, Blade, Rational, grade, magnitude
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import Kernel, parameters_for, value_of
from hamotor.codegen.program import (
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Product,
    Program,
    Quotient,
    Select,
    Shortcut,
    Sum,
    negative,
    number,
    opposite,
    sum_of_products,
)
from hamotor.codegen.transcendental import (
    ONE,
    ZERO,
    Plane,
    axis_part,
    call,
    pitch_pairs,
    quadrivector,
    required_split,
)
from hamotor.codegen.writer import Writer, outputs_for
from hamotor.errors import UsageError

Bindings = tuple[tuple[str, Expression], ...]
ClosedForm = Callable[[Algebra, Element, Element, str, str], Kernel]


def _times(factor: Rational, x: Expression) -> Expression:
    return x if factor == 1 else Product(number(factor), x)


def _unsigned(x: Expression) -> Expression:
    return x.x if isinstance(x, Negative) else x


def _one_factor(sizes: set[Rational], where: str) -> Rational:
    if len(sizes) != 1:
        raise UsageError(f"{where}: lean forms need coordinates of one size for all blades")
    return sizes.pop()


def _coordinates(
    algebra: Algebra, operand: Element, where: str
) -> tuple[Plane, dict[Blade, Expression], Rational]:
    """Of a bivector: how its blades split, ± its coordinates by blade, and the factor of all."""
    (parameter,) = parameters_for(operand)
    value = value_of(parameter)
    plane = required_split(algebra, sorted(value), where)
    factor = _one_factor({magnitude(x) for p in value.values() for x in p.values()}, where)
    b: dict[Blade, Expression] = {}
    for blade, p in value.items():
        (((name,), sign),) = p.items()
        b[blade] = Name(name) if sign > 0 else Negative(Name(name))
    return plane, b, factor


def _exp_program(algebra: Algebra, operand: Element, result: Element, where: str) -> Program:
    """exp of B = f (u + v), u its rotation part: sin θ / |u| serves every component."""
    plane, b, factor = _coordinates(algebra, operand, where)
    u = {blade: b[blade] for blade in plane.rotation}
    writer = Writer()
    squares = writer.let("square", _squares(b, plane.rotation))
    length = writer.let("length", call("sqrt", squares))
    angle = writer.let("angle", _times(factor, length))
    cosine = writer.let("cosine", call("cos", angle))
    spin = writer.let("spin", Select(length, Quotient(call("sin", angle), length), number(factor)))
    out: dict[Blade, Expression] = {0: cosine}
    for blade, x in u.items():
        out[blade] = Product(spin, x)
    if plane.pitch:
        terms: list[tuple[Expression, ...]] = [(x, b[v]) for x, v in pitch_pairs(plane, u)]
        product = writer.let("product", sum_of_products(terms))
        rest = (
            Sum(spin, negative(cosine))
            if factor == 1
            else MultiplyAdd(number(-factor), cosine, spin)
        )
        # In this order: of the smallest u the quotient of the other two is no number.
        share = Quotient(Product(rest, product), squares)
        along = writer.let("along", Select(squares, share, ZERO))
        turned = axis_part(plane, u)
        for blade in plane.translation:
            moved = Product(spin, b[blade])
            out[blade] = MultiplyAdd(along, turned[blade], moved) if blade in turned else moved
        out[quadrivector(plane)] = Product(_times(factor, spin), product)
    else:
        for blade in plane.translation:
            out[blade] = Product(spin, b[blade])
    return Program(
        parameters_for(operand), tuple(writer.bindings), outputs_for(out, result), result
    )


def exp_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """exp by the fewest operations."""
    program = _exp_program(algebra, operand, result, where)
    return Kernel(
        "exp_lean", "exp(B) = 1 + B + B²/2 + …", program, None, namespace, None, EXP_NOTES
    )


def shortened_exp_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """exp of every bivector, by the lean one's program for half angles up to π/2."""
    kernel = transcendental.exp_kernel(algebra, operand, result, namespace, where)
    try:
        program = _exp_program(algebra, operand, result, where)
    except UsageError:
        return kernel
    plane, b, factor = _coordinates(algebra, operand, where)
    writer = Writer()
    turning = writer.let("turning", _squares(b, plane.rotation))
    conditions: dict[str, Expression] = {
        "angle": Sum(number(Fraction(79, 32) / factor**2), negative(turning))
    }
    if plane.pitch:
        size = call("max_abs", *(_unsigned(b[v]) for v in plane.translation))
        conditions["moderate"] = Sum(call("moderate"), negative(size))
    near = Program(program.parameters, tuple(writer.bindings), tuple(conditions.items()), None)
    notes = (*kernel.notes, "By a shortcut for half angles up to π/2.")
    return replace(kernel, shortcut=Shortcut(near, program), notes=notes)


def _plain_blades(operand: Element, where: str) -> dict[Blade, Expression]:
    """The operand's coefficients; UsageError where they are not its components but for signs."""
    (parameter,) = parameters_for(operand)
    m: dict[Blade, Expression] = {}
    for blade, p in value_of(parameter).items():
        (((name,), x),) = p.items()
        if abs(x) != 1:
            raise UsageError(f"{where}: {operand.name} must be stored in plain blades")
        m[blade] = Name(name) if x > 0 else Negative(Name(name))
    return m


def _squares(m: Mapping[Blade, Expression], blades: Iterable[Blade]) -> Expression:
    return sum_of_products([(x, x) for x in (_unsigned(m[blade]) for blade in blades)])


def _log_program(
    algebra: Algebra, operand: Element, result: Element, where: str, *, turned_far: bool = False
) -> Program:
    """Logarithm of a unit versor M = c + r + q + p by sin²θ = 1 − c²: a = θ / sin θ, θ = acos c.

    a r for the rotation part, a q + (a c − 1) p / sin²θ J(r) for the translation part.  For small
    θ, a and the bracket are smooth functions of c, whose rounding does them no harm; nothing else
    is needed for θ, so that acos and the root go side by side.
    """
    (parameter,) = parameters_for(operand)
    m = _plain_blades(operand, where)
    plane = required_split(algebra, [b for b in sorted(m) if grade(b) == 2], where)
    factor = _one_factor({magnitude(x) for f in result.reading for x in f.values()}, where)
    cosine = m[0]
    writer = Writer()
    # acos knows c, not sin θ: where the processor does not fuse, this must be rounded once as well.
    square: Expression = call("fma", negative(cosine), cosine, ONE)
    if turned_far and not plane.pitch:
        square = Select(cosine, square, _squares(m, plane.rotation))
    square = writer.let("square", square)
    angle = call("acos", cosine)
    if plane.pitch:
        inverse = writer.let("inverse", Quotient(ONE, square))
        ratio: Expression = Product(angle, call("sqrt", inverse))
    else:
        ratio = Quotient(angle, call("sqrt", square))
    stretch = writer.let("stretch", Select(square, ratio, ONE))
    scaled = writer.let("scaled", _times(factor, stretch))
    r = {blade: m[blade] for blade in plane.rotation}
    out: dict[Blade, Expression] = {blade: Product(scaled, x) for blade, x in r.items()}
    if plane.pitch:
        quad = m[quadrivector(plane)]
        rest = _times(factor, MultiplyAdd(stretch, cosine, number(-1)))
        slope = Product(quad, inverse)
        along = writer.let("along", Select(square, Product(rest, slope), ZERO))
        turned = axis_part(plane, r)
        for blade in plane.translation:
            out[blade] = MultiplyAdd(along, turned[blade], Product(scaled, m[blade]))
    else:
        for blade in plane.translation:
            out[blade] = Product(scaled, m[blade])
    if not result.namespace and (lost := sorted(out.keys() - set(result.blades))):
        names = ", ".join(algebra.blade_name(blade) for blade in lost)
        raise UsageError(f"{where}: {result.name} does not hold the result's part along {names}")
    outputs: list[tuple[str, Expression]] = []
    for component, functional in zip(result.components, result.reading, strict=True):
        ((blade, x),) = functional.items()
        value = out.get(blade, ZERO)
        outputs.append((component.name, value if x > 0 else opposite(value)))
    return Program((parameter,), tuple(writer.bindings), tuple(outputs), result)


def log_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """Logarithm of a unit versor by the fewest operations."""
    program = _log_program(algebra, operand, result, where)
    return Kernel("log_lean", "log(M), M ~M = 1", program, None, namespace, None, LOG_NOTES)


def shortened_log_kernel(
    algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
) -> Kernel:
    """The logarithm for every unit versor, by the lean one's program wherever that is accurate."""
    kernel = transcendental.log_kernel(algebra, operand, result, namespace, where)
    try:
        program = _log_program(algebra, operand, result, where, turned_far=True)
    except UsageError:
        return kernel
    near = Program(program.parameters, *_near_unity(algebra, operand, where), None)
    range_ = "below π/2" if "moderate" in dict(near.outputs) else "up to 2.6"
    notes = (
        *kernel.notes,
        f"By a shortcut for half angles {range_} where M ~M = 1 + δ, |δ| < 256 ε, whose error is",
        "up to |δ| more; elsewhere M stands for the unit versor nearest to it.",
    )
    return replace(kernel, shortcut=Shortcut(near, program), notes=notes)


def _near_unity(algebra: Algebra, operand: Element, where: str) -> tuple[Bindings, Bindings]:
    """Where the lean logarithm is accurate: bindings, and numbers that are positive there."""
    m = _plain_blades(operand, where)
    plane = required_split(algebra, [b for b in sorted(m) if grade(b) == 2], where)
    writer = Writer()
    rounding = call("rounding")
    rest = Sum(_squares(m, plane.rotation), number(-1))
    defect = writer.let("defect", MultiplyAdd(m[0], m[0], rest))
    conditions: dict[str, Expression] = {
        "angle": m[0] if plane.pitch else Sum(m[0], number(Fraction(7, 8))),
        "unit": Sum(rounding, negative(call("abs", defect))),
    }
    if plane.pitch:
        quad = m[quadrivector(plane)]
        size = writer.let("size", call("max_abs", *(m[v] for v in plane.translation), quad))
        terms = [(negative(x), m[v]) for x, v in pitch_pairs(plane, m)]
        slip = writer.let("slip", sum_of_products([(m[0], quad), *terms]))
        excess = MultiplyAdd(rounding, size, negative(call("abs", slip)))
        conditions["motor"] = Select(size, excess, ONE)
        conditions["moderate"] = Sum(call("moderate"), negative(size))
    return tuple(writer.bindings), tuple(conditions.items())


EXP_NOTES = (
    "Lean: error at most 6 ulp of the result's norm, measured for half angles θ up to 2; then, of",
    "translations across the axis, it grows like 1/(π − θ): 30 at 2.9; beyond π it grows with the",
    "angle.  Squares of coordinates must not overflow.",
)
LOG_NOTES = (
    "Lean: error at most 4 ulp of the result's norm, measured for half angles θ up to π/2; then it",
    "grows like 1/(π − θ)²: 80 at 3, 3e4 at 3.14159.  At −1, which has no direction, 0.",
)
CAYLEY_NOTES = (
    "Lean: error at most 6 ulp of the result's norm, measured for half angles up to 3.14159.",
    "Squares of coordinates must not overflow.",
)
CAYLEY_INVERSE_NOTES = (
    "Lean: error at most 4 ulp of the result's norm, measured for half angles θ up to π/2; then it",
    "grows like 1/(π − θ)²: 30 at 3, 2e4 at 3.14159.  Not finite at M = −1.",
)
NORMALIZE_NOTES = (
    "Lean: error at most 4 ulp of the result's norm, measured.  Squares of coordinates must",
    "neither overflow nor vanish.",
)


def _renamed(form: ClosedForm, name: str, notes: tuple[str, ...]) -> ClosedForm:
    def build(
        algebra: Algebra, operand: Element, result: Element, namespace: str, where: str
    ) -> Kernel:
        kernel = form(algebra, operand, result, namespace, where)
        return replace(kernel, name=name, notes=notes)

    return build


def _normalize(
    algebra: Algebra, operand: Element, result: Element, _namespace: str, where: str
) -> Kernel:
    return closedform.normalize_kernel(algebra, operand, result, where)


LEAN: Mapping[str, ClosedForm] = {
    "exp_lean": exp_kernel,
    "log_lean": log_kernel,
    "cayley_lean": _renamed(closedform.cayley_kernel, "cayley_lean", CAYLEY_NOTES),
    "cayley_inverse_lean": _renamed(
        closedform.cayley_inverse_kernel, "cayley_inverse_lean", CAYLEY_INVERSE_NOTES
    ),
    "normalize_lean": _renamed(_normalize, "normalize_lean", NORMALIZE_NOTES),
}
"""Operation → what builds its kernel."""
