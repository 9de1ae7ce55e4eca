"""From a checked spec to its kernels: every request answered, every group's functions added."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import prod
from string import ascii_lowercase

from hamotor.codegen import closedform, jacobian, lean, nullform, transcendental
from hamotor.codegen.algebra import (
    Algebra,
    Blade,
    Multivector,
    Rational,
    grade,
    ratio,
    reverse_sign,
)
from hamotor.codegen.element import Element
from hamotor.codegen.group import LieGroup
from hamotor.codegen.kernel import (
    Kernel,
    chain_kernel,
    direct_program,
    linear_kernel,
    moved_value,
    parameters_for,
    product_kernel,
    proved,
    quadratic_kernel,
    read_off,
    reversed_value,
    sandwich_kernel,
    value_of,
)
from hamotor.codegen.lanes import in_threes
from hamotor.codegen.matrix import matrix_kernels
from hamotor.codegen.polynomial import Polynomial, PolynomialMultivector, apply_bilinear, scaled
from hamotor.codegen.program import (
    Call,
    Name,
    Parameter,
    Program,
    accumulated,
    polynomial_expression,
)
from hamotor.codegen.spec import AlgebraSpec, Request
from hamotor.codegen.unit import unit_kernels
from hamotor.errors import UsageError

MAXIMUM_TERMS = 200_000
PACKED_STEP = re.compile(r"(four|three|all)_\w+|\w+_three|four|turned|lanes|result|sum\d+")
"""What kernels name, or call, where they take four numbers at a time."""
ClosedForm = Callable[[Algebra, Element, Element, str, str], Kernel]
"""Builds a kernel of an operand, a result, a namespace and what begins an error message."""

LAWS = {
    "gp": "a b, the geometric product",
    "outer": "a ∧ b",
    "inner": "the part of grade |i − j| of a b",
    "left_contraction": "a ⌋ b",
    "right_contraction": "a ⌊ b",
    "regressive": "a ∨ b, the join in PGA: (a ∨ b)* = a* ∧ b*",
    "commutator": "a × b = ½(a b − b a)",
    "anticommutator": "½(a b + b a)",
}


VERSORS = frozenset(
    f"{name}{form}" for name in ("exp", "cayley", "normalize", "sqrt") for form in ("", "_lean")
)
"""Operations whose results are unit versors."""


def bilinear(algebra: Algebra, operation: str) -> Callable[[Blade, Blade], Multivector]:
    """The product of basis blades that an operation of two operands extends."""
    products: dict[str, Callable[[Blade, Blade], Multivector]] = {
        "gp": algebra.geometric,
        "outer": algebra.outer,
        "inner": algebra.inner,
        "left_contraction": algebra.left_contraction,
        "right_contraction": algebra.right_contraction,
        "regressive": algebra.regressive,
        "commutator": algebra.commutator,
        "anticommutator": algebra.anticommutator,
    }
    return products[operation]


def library(spec: AlgebraSpec) -> tuple[Kernel, ...]:
    """Every kernel of a spec, in the order of its requests and then of its groups."""
    kernels = [k for request in stepping_requests(spec) for k in request_kernels(spec, request)]
    for element in {group.element.name: group.element for group in spec.groups}.values():
        kernels += unit_kernels(spec.algebra, element)
    for group in spec.groups:
        kernels += group_kernels(spec, group)
    kernels = [finished(spec.algebra, kernel) for kernel in kernels]
    for kernel in kernels:
        _check_symbols(spec, kernel)
    return tuple(kernels)


def finished(algebra: Algebra, kernel: Kernel) -> Kernel:
    """The kernel without steps that nothing needs, in the order in which it becomes lanes."""
    return in_threes(algebra, replace(kernel, program=kernel.program.without_unused()))


def stepping_requests(spec: AlgebraSpec) -> tuple[Request, ...]:
    """The spec's requests, and the product and the reverse of every type that holds a group."""
    asked = {(r.operation, r.operands, r.grade): r for r in spec.requests}
    for group in spec.groups:
        name = group.element.name
        for request in (Request("gp", (name, name), name), Request("reverse", (name,), None)):
            asked.setdefault((request.operation, request.operands, None), request)
    return tuple(asked.values())


def _check_symbols(spec: AlgebraSpec, kernel: Kernel) -> None:
    """Refuse a parameter that is called like one of its kernel's steps."""
    steps = {name for name, _ in kernel.program.bindings}
    if kernel.shortcut is not None:
        steps |= {"usual", "shortly", *(name for name, _ in kernel.shortcut.where.bindings)}
    for parameter in kernel.program.parameters:
        if parameter.name in steps or PACKED_STEP.fullmatch(parameter.name):
            other = next(
                c for c in parameter.name + ascii_lowercase if c.islower() and c not in steps
            )
            raise UsageError(
                f'{spec.file}: element.{parameter.element.name}: "symbol" = "{parameter.name}" is '
                f'a step of {kernel.name} already.  Call it "{other}", for example'
            )


def _keep_promise(
    algebra: Algebra,
    value: Mapping[Blade, Polynomial],
    result: Element,
    where: str,
    *,
    unit: bool,
) -> None:
    """Refuse a result type that says more than is true of every value.

    value: what is computed, as polynomials; unit: whether it is always a unit versor.
    """
    if not (result.fixed or result.unit):
        return
    lost = [b for b in sorted(value) if value[b] and b not in result.blades]
    wrong = [b for b, x in result.fixed.items() if value.get(b, {}) != {(): x}]
    reason = ""
    if lost:
        names = ", ".join(algebra.blade_name(b) for b in lost)
        reason = f"does not hold the result's part along {names}"
    elif wrong:
        names = ", ".join(algebra.blade_name(b) for b in wrong)
        reason = f"has a fixed part along {names}, where the result has another"
    elif result.unit and not unit:
        reason = "promises V ~V = 1, which the result need not satisfy"
    if reason:
        raise UsageError(f"{where}: {result.name} {reason}; name a type that promises less")


def _keep_unary_promise(operation: str, operand: Element, result: Element, where: str) -> None:
    """The same for one operand: versors stay versors, and signs change no fixed part."""
    signs: dict[str, Callable[[Blade], int]] = {
        "reverse": reverse_sign,
        "involute": lambda b: (-1) ** grade(b),
        "conjugate": lambda b: reverse_sign(b) * (-1) ** grade(b),
    }
    sign = signs.get(operation)
    same = result is operand
    fixed = same and sign is not None and all(sign(b) > 0 for b in result.fixed)
    kept = same and (sign is not None or operation == "inverse")
    for broken, promise in (
        (bool(result.fixed) and not fixed, "a fixed part"),
        (result.unit and not kept and operation not in VERSORS, "V ~V = 1"),
    ):
        if broken:
            raise UsageError(
                f"{where}: {result.name} promises more than {operation} keeps: {promise}; name a "
                "type that promises less"
            )


def smallest_element(spec: AlgebraSpec, value: Mapping[Blade, object], where: str) -> Element:
    """The declared element type with the fewest components that holds these blades.

    Types that promise more than their blades (unit versors, normalised points) are not candidates.
    """
    blades = set(value)
    candidates = [
        e for e in spec.elements.values() if blades <= set(e.blades) and not e.unit and not e.fixed
    ]
    if not candidates:
        names = ", ".join(spec.algebra.blade_name(b) for b in sorted(blades)) or "nothing"
        raise UsageError(
            f"{where}: no element type holds the result ({names}); declare one, or name the type "
            'to project onto with "-> RESULT"'
        )
    return min(candidates, key=lambda e: len(e.components))


def request_kernels(spec: AlgebraSpec, request: Request) -> tuple[Kernel, ...]:
    """What a request asks for: a kernel; of `matrix` also its application to an element."""
    if request.operation != "matrix":
        return (request_kernel(spec, request),)
    where = f"{spec.file}: {request}"
    versor, operand, result, _ = _moving(spec, request, where)
    kernels = matrix_kernels(spec.algebra, versor, operand, result)
    matrix = kernels[0].program.result
    if matrix is not None and matrix.name in spec.elements:
        raise UsageError(
            f"{where}: {matrix.name} is an element type already, and what the matrix is called"
        )
    return kernels


def request_kernel(spec: AlgebraSpec, request: Request) -> Kernel:
    """The kernel that a request asks for, the first if there are two."""
    if request.operation == "matrix":
        return request_kernels(spec, request)[0]
    where = f"{spec.file}: {request}"
    algebra = spec.algebra
    operands = [spec.element(name, where) for name in request.operands]
    result = spec.element(request.result, where) if request.result else None
    if request.operation in LAWS:
        product = bilinear(algebra, request.operation)
        if len(operands) > 2:
            return _chain(spec, request, operands, result, where)
        left, right = operands
        if result is None:
            a, b = parameters_for(left, right)
            result = smallest_element(
                spec, apply_bilinear(product, value_of(a), value_of(b)), where
            )
        name = request.operation
        a, b = parameters_for(left, right)
        value = apply_bilinear(product, value_of(a), value_of(b))
        unit = name == "gp" and left.unit and right.unit
        _keep_promise(algebra, value, result, where, unit=unit)
        return product_kernel(algebra, name, LAWS[name], product, left, right, result)
    if request.operation in ("sandwich", "sandwich_lean"):
        versor, operand, target, law = _moving(spec, request, where)
        lean_one = request.operation == "sandwich_lean"
        try:
            return sandwich_kernel(
                algebra, request.operation, law, versor, operand, target, lean=lean_one
            )
        except ValueError as error:
            raise UsageError(f"{where}: {error}; ask for that") from error
    if request.operation == "project":
        return _project(spec, operands, result, where)
    try:
        kernel = _unary_kernel(spec, request, operands[0], result, where)
    except ValueError as error:
        raise UsageError(f'{where}: {error}; name one that does with "-> RESULT"') from error
    given = kernel.program.result
    if given is not None and (given.fixed or given.unit):
        _keep_unary_promise(request.operation, operands[0], given, where)
    return kernel


def _moving(
    spec: AlgebraSpec, request: Request, where: str
) -> tuple[Element, Element, Element, str]:
    """Versor, operand and result of a sandwich, and its law; UsageError where it has none."""
    versor, operand = (spec.element(name, where) for name in request.operands)
    if not versor.unit or len({g % 2 for g in versor.grades}) != 1:
        raise UsageError(f"{where}: {versor.name} must be a unit versor (unit = true), even or odd")
    odd = any(g % 2 for g in versor.grades)
    if odd and len(operand.grades) != 1:
        raise UsageError(f"{where}: {operand.name} must be of one grade for an odd versor")
    if odd and operand.fixed:
        raise UsageError(
            f"{where}: {operand.name} has a fixed part, whose sign a reflection may change; "
            "name the type of any weight"
        )
    law = "(−1)^k m x ~m, x of grade k: reflects x in m" if odd else "m x ~m: moves x by m"
    target = spec.element(request.result, where) if request.result else operand
    moved = moved_value(spec.algebra, versor, operand)
    _keep_promise(spec.algebra, moved, target, where, unit=operand.unit)
    return versor, operand, target, law


def _chain(
    spec: AlgebraSpec,
    request: Request,
    operands: list[Element],
    result: Element | None,
    where: str,
) -> Kernel:
    """a b c …, from left to right."""
    product = bilinear(spec.algebra, request.operation)
    terms = prod(max(1, len(e.blades)) for e in operands)
    if terms > MAXIMUM_TERMS:
        raise UsageError(
            f"{where}: {terms} products of components; {MAXIMUM_TERMS} are allowed "
            "(MAXIMUM_TERMS in codegen/library.py lifts the cap)"
        )
    names = ("a", "b", "c", "d", "e", "f")
    parameters = tuple(Parameter(n, e) for n, e in zip(names, operands, strict=False))
    value = value_of(parameters[0])
    for parameter in parameters[1:]:
        value = apply_bilinear(product, value, value_of(parameter))
    target = result or smallest_element(spec, value, where)
    unit = request.operation == "gp" and all(e.unit for e in operands)
    _keep_promise(spec.algebra, value, target, where, unit=unit)
    law = LAWS[request.operation] + "; of all operands from left to right"
    factors = tuple((product, p, value_of(p)) for p in parameters)
    return chain_kernel(spec.algebra, request.operation, law, factors, parameters, target)


def _project(
    spec: AlgebraSpec, operands: list[Element], result: Element | None, where: str
) -> Kernel:
    """(a·b) ~b for a normalised b: the projection of a onto b."""
    algebra = spec.algebra
    a, b = parameters_for(*operands)
    factors = (
        (algebra.geometric, a, value_of(a)),
        (algebra.inner, b, value_of(b)),
        (algebra.geometric, b, reversed_value(value_of(b))),
    )
    law = "(a·b) ~b: the projection of a onto b, where b ~b = 1"
    target = result or operands[0]
    kernel = chain_kernel(algebra, "project", law, factors, (a, b), target)
    if not any((kernel.meaning or {}).values()):
        raise UsageError(f"{where}: the projection is 0 for all operands")
    return kernel


def _unary_kernel(
    spec: AlgebraSpec, request: Request, operand: Element, result: Element | None, where: str
) -> Kernel:
    algebra = spec.algebra
    (a,) = parameters_for(operand)
    match request.operation:
        case "reverse":
            return linear_kernel(
                "reverse",
                "~a: every product in reversed order",
                reversed_value,
                operand,
                result or operand,
            )
        case "grade":
            wanted = request.grade if request.grade is not None else 0

            def project(value: PolynomialMultivector) -> PolynomialMultivector:
                return {b: p for b, p in value.items() if grade(b) == wanted}

            target = result or smallest_element(spec, project(value_of(a)), where)
            law = f"<a>_{wanted}: the part of grade {wanted}"
            return linear_kernel(f"grade_{wanted}", law, project, operand, target)
        case "complement":

            def dual(value: PolynomialMultivector) -> PolynomialMultivector:
                return {
                    c: scaled(p, x)
                    for b, p in value.items()
                    for c, x in algebra.complement(b).items()
                }

            target = result or smallest_element(spec, dual(value_of(a)), where)
            law = "a*, the right complement: b ∧ b* = I for every basis blade b"
            return linear_kernel("complement", law, dual, operand, target)
        case "complement_inverse":

            def undual(value: PolynomialMultivector) -> PolynomialMultivector:
                return {
                    c: scaled(p, x)
                    for b, p in value.items()
                    for c, x in algebra.complement_inverse(b).items()
                }

            target = result or smallest_element(spec, undual(value_of(a)), where)
            law = "the multivector whose right complement is a"
            return linear_kernel("complement_inverse", law, undual, operand, target)
        case "involute" | "conjugate" as name:

            def signed(value: PolynomialMultivector) -> PolynomialMultivector:
                turned = reversed_value(value) if name == "conjugate" else value
                return {b: scaled(p, (-1) ** grade(b)) for b, p in turned.items()}

            law = {
                "involute": "(−1)^k on grade k, the main involution",
                "conjugate": "the reverse of the involute (Clifford conjugation)",
            }[name]
            return linear_kernel(name, law, signed, operand, result or operand)
        case "polarity" | "polarity_inverse" as name:
            pseudoscalar = _pseudoscalar(algebra, inverse=name == "polarity_inverse", where=where)

            def polar(value: PolynomialMultivector) -> PolynomialMultivector:
                return apply_bilinear(
                    algebra.geometric, value, {algebra.pseudoscalar: pseudoscalar}
                )

            target = result or smallest_element(spec, polar(value_of(a)), where)
            law = "a I, the metric dual" if name == "polarity" else "a I⁻¹, the inverse metric dual"
            return linear_kernel(name, law, polar, operand, target)
        case "norm":
            squared = quadratic_kernel(
                algebra, "norm_squared", "", operand, spec.element("Scalar", where)
            )
            ((component, expression),) = squared.program.outputs
            root = Call("sqrt", (Call("abs", (expression,)),))
            program = replace(squared.program, outputs=((component, root),))
            return Kernel("norm", "√|<a ~a>₀|", program, None)
        case "inverse":
            return closedform.inverse_kernel(algebra, operand, result or operand, where)
        case "sqrt" as operation:
            if not operand.unit:
                raise UsageError(f"{where}: {operand.name} must be a unit versor (unit = true)")
            _check_stored(algebra, operation, operand, where)
            return closedform.sqrt_kernel(algebra, operand, result or operand, where)
        case "norm_squared":
            target = result or spec.element("Scalar", where)
            return quadratic_kernel(algebra, "norm_squared", "<a ~a>₀", operand, target)
        case "normalize" as operation:
            _check_stored(algebra, operation, operand, where)
            if _simple(algebra, operand) and 0 in operand.blades:
                return transcendental.normalize_kernel(algebra, operand, result or operand, where)
            return closedform.normalize_kernel(algebra, operand, result or operand, where)
        case operation:
            if operation == "normalize_lean":
                result = result or operand
            if result is None:
                raise UsageError(f'{where}: name the result, as in "{request} -> Motor"')
            build_form = _closed_form(algebra, operation, operand, where)
            return build_form(algebra, operand, result, "", where)


def _pseudoscalar(algebra: Algebra, *, inverse: bool, where: str) -> Polynomial:
    """The coefficient of I, or of I⁻¹; raises UsageError where I has no inverse."""
    if not inverse:
        return {(): 1}
    square = algebra.blade_product(algebra.pseudoscalar, algebra.pseudoscalar).get(0, 0)
    if not square:
        raise UsageError(
            f"{where}: I² = 0 in {algebra.name}, so that a I cannot be undone; use complement"
        )
    return {(): ratio(1, square)}


def group_kernels(spec: AlgebraSpec, group: LieGroup) -> list[Kernel]:
    """The functions of a Lie group on its elements, rates and momenta (theory.md §2)."""
    algebra, element, rate, momentum = spec.algebra, group.element, group.rate, group.momentum
    namespace = rate.namespace
    where = f"{spec.file}: group {group.name}"

    def bracket(a: Blade, b: Blade) -> Multivector:
        return {c: 2 * x for c, x in algebra.commutator(a, b).items()}

    def reversed_bracket(a: Blade, b: Blade) -> Multivector:
        return bracket(b, a)

    def product(
        name: str,
        law: str,
        table: Callable[[Blade, Blade], Multivector],
        left: Element,
        right: Element,
        result: Element,
        factor: Rational = 1,
    ) -> Kernel:
        return product_kernel(algebra, name, law, table, left, right, result, namespace, factor)

    kernels = [
        product("ad", "ad_a b = [a, b] = a b − b a", bracket, rate, rate, rate),
        product(
            "coadjoint",
            "ad*_w μ = [μ, w], so that (ad*_w μ)(b) = μ([w, b])",
            reversed_bracket,
            rate,
            momentum,
            momentum,
        ),
        product(
            "kinematics",
            "m w: the velocity of m with body rate w (not a unit versor)",
            algebra.geometric,
            element,
            rate,
            element,
        ),
        sandwich_kernel(
            algebra, "Ad", "m w ~m: a body rate as a spatial rate", element, rate, rate, namespace
        ),
        sandwich_kernel(
            algebra,
            "Ad_star_inverse",
            "m μ ~m: a body momentum as a spatial momentum; Ad_star(m, μ) = Ad_star_inverse(~m, μ)",
            element,
            momentum,
            momentum,
            namespace,
        ),
        _pairing(group),
    ]
    m, w = parameters_for(element, rate)
    velocity = apply_bilinear(algebra.geometric, value_of(m), value_of(w))
    if lost := [algebra.blade_name(b) for b in sorted(velocity) if b not in element.blades]:
        raise UsageError(
            f"{where}: {element.name} does not hold {', '.join(lost)}, which its product with a "
            "generator has; name an element type that the group stays in"
        )
    kernels += [
        _kinematics_onto(algebra, group)
        if name == "kinematics_onto"
        else jacobian.jacobian_kernel(algebra, group, name, where)
        for name in group.kernels
    ]
    if algebra.dimension > closedform.MAXIMUM_DIMENSION:
        return kernels
    operations = [
        ("exp", rate, element),
        ("log", element, rate),
        ("cayley", rate, element),
        ("cayley_inverse", element, rate),
    ]
    operations += [(f"{f}_lean", a, b) for f, a, b in operations if f in group.lean]
    for operation, operand, result in operations:
        build = _closed_form(algebra, operation, operand, where)
        kernels.append(build(algebra, operand, result, namespace, where))
    return kernels


def _kinematics_onto(algebra: Algebra, group: LieGroup) -> Kernel:
    """x + 2 m w, twice because generators are halves of blades: terms then have no factor."""
    m, w = parameters_for(group.element, group.rate)
    start = Parameter("start" if "x" in {m.name, w.name} else "x", group.element)
    twice = apply_bilinear(algebra.geometric, value_of(m), value_of(w))
    gained = {n: scaled(p, 2) for n, p in read_off(twice, group.element).items()}
    meaning, outputs = {}, []
    for name, p in gained.items():
        meaning[name] = {(f"{start.name}.{name}",): 1, **p}
        try:
            total = accumulated(Name(f"{start.name}.{name}"), p)
        except ValueError:
            total = polynomial_expression(meaning[name])
        outputs.append((name, total))
    law = "x + 2 m w: twice the velocity of m with body rate w, added to x term by term"
    program = Program((start, m, w), (), tuple(outputs), group.element)
    return proved(Kernel("kinematics_onto", law, program, meaning, group.rate.namespace))


def _simple(algebra: Algebra, operand: Element) -> bool:
    """Whether the forms that are accurate for every input apply to the operand's bivectors."""
    bivectors = [b for b in operand.blades if grade(b) == 2]
    plane = transcendental.split_bivectors(algebra, bivectors)
    if plane is None or not plane.rotation:
        return False
    # Of a motor, the forms need the whole of space: a translation along every axis of rotation.
    return 0 not in operand.blades or not plane.pitch or set(plane.along) == {*plane.translation}


def _check_stored(algebra: Algebra, operation: str, operand: Element, where: str) -> None:
    """Refuse an operand of a closed form that does not store what the form reads."""
    function = operation.removesuffix("_lean")
    if function in ("log", "cayley_inverse", "sqrt") and 0 not in operand.blades:
        raise UsageError(f"{where}: {operand.name} has no scalar part, which {function} needs")
    translation = nullform.applies(algebra, operand) and function in nullform.BACKWARD
    if operand.fixed and not (translation and operation == function):
        raise UsageError(
            f"{where}: {operand.name} has a fixed part; name a type that stores all its blades"
        )


def _closed_form(algebra: Algebra, operation: str, operand: Element, where: str) -> ClosedForm:
    _check_stored(algebra, operation, operand, where)
    if operation in lean.LEAN:
        return lean.LEAN[operation]
    simple: dict[str, ClosedForm] = {
        "exp": lean.shortened_exp_kernel,
        "log": lean.shortened_log_kernel,
        "cayley": transcendental.cayley_kernel,
        "cayley_inverse": transcendental.cayley_inverse_kernel,
    }
    general: dict[str, ClosedForm] = {
        "exp": closedform.exp_kernel,
        "log": closedform.log_kernel,
        "cayley": closedform.cayley_kernel,
        "cayley_inverse": closedform.cayley_inverse_kernel,
    }
    forward = operation in nullform.FORWARD
    if nullform.applies(algebra, operand) and not (forward and 0 in operand.blades):
        return lambda _algebra, operand, result, namespace, _where: nullform.null_kernel(
            operation, operand, result, namespace
        )
    forms = simple if _simple(algebra, operand) else general
    return forms[operation]


def _pairing(group: LieGroup) -> Kernel:
    """<μ, w> = Σ μ_a w_a, since rate and momentum coordinates are dual."""
    parameters = parameters_for(group.momentum, group.rate)
    mu, w = parameters
    meaning: dict[str, Polynomial] = {
        "s": {
            tuple(sorted((f"{mu.name}.{g.momentum}", f"{w.name}.{g.rate}"))): 1
            for g in group.generators
        }
    }
    program = direct_program(parameters, meaning, None)
    law = "μ(w) = (μ ∧ w) / I: twice the kinetic energy if w is the rate of μ"
    return proved(Kernel("pairing", law, program, meaning, group.rate.namespace))
