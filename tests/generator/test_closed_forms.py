"""Closed forms satisfy the equations that define them, exactly where they are rational."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import mpmath
import pytest

from hamotor.codegen import bundled_algebras
from hamotor.codegen.algebra import Algebra, Blade, grade, reverse_sign
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import Kernel
from hamotor.codegen.library import library
from hamotor.codegen.spec import AlgebraSpec, bundled_path, parse_algebra, read_algebra
from hamotor.codegen.starter import starter_spec

CLOSED_FORMS = ("inverse", "sqrt", "cayley", "cayley_inverse", "normalize")
SIGNATURES = ((1, 0, 1), (1, 0, 3), (2, 2, 0), (2, 1, 2), (3, 1, 1))
SPECS = {name: read_algebra(bundled_path(name)) for name in bundled_algebras()}
for p, q, r in SIGNATURES:
    text = starter_spec(f"r{p}{q}{r}", (p, q, r), products=CLOSED_FORMS)
    SPECS[f"r{p}{q}{r}"] = parse_algebra(text, "starter.toml")
KERNELS = {name: library(spec) for name, spec in SPECS.items()}
Value = dict[Blade, Any]


def kernels(name: str) -> list[Any]:
    return [
        pytest.param(
            SPECS[algebra], kernel, id=f"{algebra}-{kernel.namespace}-{kernel.operands[0].name}"
        )
        for algebra, all_kernels in KERNELS.items()
        for kernel in all_kernels
        if kernel.name == name
    ]


def product(algebra: Algebra, a: Mapping[Blade, Any], b: Mapping[Blade, Any]) -> Value:
    total: Value = {}
    for left, x in a.items():
        for right, y in b.items():
            for blade, z in algebra.blade_product(left, right).items():
                total[blade] = total.get(blade, 0) + x * y * exact(z)
    return {blade: x for blade, x in total.items() if x}


def exact(x: Any) -> Any:
    return mpmath.mpf(x.numerator) / x.denominator if isinstance(x, Fraction) else x


def reverse(a: Mapping[Blade, Any]) -> Value:
    return {b: reverse_sign(b) * x for b, x in a.items()}


def value(element: Element, numbers: Mapping[str, Any], convert: Callable[[Any], Any]) -> Value:
    total: Value = {b: convert(x) for b, x in element.fixed.items()}
    for component in element.components:
        for blade, x in component.embedding.items():
            total[blade] = total.get(blade, 0) + convert(x) * numbers[component.name]
    return {blade: x for blade, x in total.items() if x}


def run(
    kernel: Kernel, numbers: Mapping[str, Any], functions: Mapping[str, Callable[..., Any]]
) -> dict[str, Any]:
    (parameter,) = kernel.program.parameters
    named = {f"{parameter.name}.{n}": x for n, x in numbers.items()}
    return kernel.program.evaluate(named, functions)


def small_fractions(element: Element, seed: int) -> dict[str, Fraction]:
    generator = random.Random(seed)
    return {
        c.name: Fraction(generator.randint(-9, 9), generator.randint(1, 9))
        for c in element.components
    }


def dot(*factors: Any) -> Any:
    return sum(x * y for x, y in zip(factors[::2], factors[1::2], strict=True))


# The runtime's functions in arithmetic that needs no care: nothing is rounded or overflows.
ARITHMETIC: dict[str, Callable[..., Any]] = {
    "abs": abs,
    "max_abs": lambda *values: max(abs(x) for x in values),
    "scaling": lambda _: SimpleNamespace(**{"in": 1, "out": 1, "root_in": 1, "root_out": 1}),
    "compensated_dot": dot,
    "compensated_dot_where": lambda _, *factors: dot(*factors),
    "compensated_dot_pair": lambda *factors: SimpleNamespace(hi=dot(*factors), lo=0),
    "double_word_ratio": lambda a, b: SimpleNamespace(hi=a.hi / b.hi, lo=0),
}
RATIONAL: dict[str, Callable[..., Any]] = ARITHMETIC | {"number": Fraction}


def result_of(kernel: Kernel) -> Element:
    assert kernel.program.result is not None
    return kernel.program.result


@pytest.mark.parametrize(("spec", "kernel"), kernels("inverse"))
def test_inverse_times_the_original_is_one(spec: AlgebraSpec, kernel: Kernel) -> None:
    tried = 0
    for seed in range(12):
        numbers = small_fractions(kernel.operands[0], seed)
        original = value(kernel.operands[0], numbers, Fraction)
        try:
            inverse = value(result_of(kernel), run(kernel, numbers, RATIONAL), Fraction)
        except ZeroDivisionError:
            continue
        tried += 1
        assert product(spec.algebra, original, inverse) == {0: 1}
        assert product(spec.algebra, inverse, original) == {0: 1}
    assert tried >= 6


HIGH_PRECISION: dict[str, Callable[..., Any]] = ARITHMETIC | {
    "number": lambda x: mpmath.mpf(x.numerator) / x.denominator,
    "sqrt": lambda x: mpmath.sqrt(x) if x >= 0 else mpmath.nan,
    "length": mpmath.hypot,
}


def distance(a: Mapping[Blade, Any], b: Mapping[Blade, Any]) -> Any:
    return max((abs(a.get(k, 0) - b.get(k, 0)) for k in {*a, *b}), default=0)


def roots(*kernels: Kernel) -> bool:
    """Whether any of the kernels takes square roots, so that rationals do not stay rational."""
    return any("sqrt" in kernel.program.cost.calls for kernel in kernels)


@pytest.mark.parametrize(("spec", "kernel"), kernels("cayley"))
def test_cayley_is_the_quotient_and_a_unit_versor(spec: AlgebraSpec, kernel: Kernel) -> None:
    functions = HIGH_PRECISION if roots(kernel) else RATIONAL
    number, allowed = functions["number"], mpmath.mpf(10) ** -50 if roots(kernel) else 0
    with mpmath.workdps(60):
        for seed in range(6):
            numbers = {n: number(x) for n, x in small_fractions(kernel.operands[0], seed).items()}
            b = value(kernel.operands[0], numbers, number)
            m = value(result_of(kernel), run(kernel, numbers, functions), number)
            one_minus = {0: number(Fraction(1))} | {blade: -x for blade, x in b.items()}
            assert distance(product(spec.algebra, m, one_minus), {0: 1} | b) <= allowed
            assert distance(product(spec.algebra, m, reverse(m)), {0: 1}) <= allowed


@pytest.mark.parametrize(("spec", "kernel"), kernels("cayley_inverse"))
def test_cayley_inverse_undoes_cayley(spec: AlgebraSpec, kernel: Kernel) -> None:
    operand, result = kernel.operands[0], result_of(kernel)
    (forward,) = (
        k
        for k in KERNELS[spec.name]
        if k.name == "cayley" and k.operands[0] is result and result_of(k) is operand
    )
    rooted = roots(kernel, forward)
    functions = HIGH_PRECISION if rooted else RATIONAL
    with mpmath.workdps(60):
        for seed in range(6):
            numbers = {n: functions["number"](x) for n, x in small_fractions(result, seed).items()}
            again = run(kernel, run(forward, numbers, functions), functions)
            if rooted:
                assert max(abs(again[n] - x) for n, x in numbers.items()) < mpmath.mpf(10) ** -45
            else:
                assert again == numbers


def unit_versor(spec: AlgebraSpec, element: Element, seed: int) -> dict[str, Any] | None:
    """A unit value of the element: the Cayley transform of a small bivector of its own blades."""
    algebra = spec.algebra
    generator = random.Random(seed)
    blades = [b for b in element.blades if grade(b) == 2]
    b = {blade: Fraction(generator.randint(-9, 9), 40) for blade in blades}
    # (1 + B)(1 − B)⁻¹ by the geometric series, in 60 digits
    numbers: Value = {0: mpmath.mpf(1)}
    power: Value = {0: mpmath.mpf(1)}
    for _ in range(400):
        power = product(
            algebra, power, {k: mpmath.mpf(x.numerator) / x.denominator for k, x in b.items()}
        )
        for blade, x in power.items():
            numbers[blade] = numbers.get(blade, 0) + 2 * x
    if set(numbers) - set(element.blades):
        return None
    return {
        c.name: sum(
            (
                mpmath.mpf(x.numerator) / x.denominator * numbers.get(blade, 0)
                for blade, x in f.items()
            ),
            mpmath.mpf(0),
        )
        for c, f in zip(element.components, element.reading, strict=True)
    }


@pytest.mark.parametrize(("spec", "kernel"), kernels("sqrt"))
def test_sqrt_squares_to_the_motion(spec: AlgebraSpec, kernel: Kernel) -> None:
    with mpmath.workdps(60):
        for seed in range(3):
            numbers = unit_versor(spec, kernel.operands[0], seed)
            assert numbers is not None
            m = value(kernel.operands[0], numbers, HIGH_PRECISION["number"])
            root = value(
                result_of(kernel), run(kernel, numbers, HIGH_PRECISION), HIGH_PRECISION["number"]
            )
            assert distance(product(spec.algebra, root, root), m) < mpmath.mpf(10) ** -50


@pytest.mark.parametrize(("spec", "kernel"), kernels("normalize"))
def test_normalize_gives_a_unit_versor_and_keeps_unit_versors(
    spec: AlgebraSpec, kernel: Kernel
) -> None:
    with mpmath.workdps(60):
        for seed in range(3):
            numbers = unit_versor(spec, kernel.operands[0], seed)
            assert numbers is not None
            generator = random.Random(seed)
            spoiled = {n: x + mpmath.mpf(generator.randint(-9, 9)) / 50 for n, x in numbers.items()}
            again = run(kernel, spoiled, HIGH_PRECISION)
            m = value(result_of(kernel), again, HIGH_PRECISION["number"])
            assert distance(product(spec.algebra, m, reverse(m)), {0: 1}) < mpmath.mpf(10) ** -50
            kept = run(kernel, numbers, HIGH_PRECISION)
            assert max(abs(kept[n] - numbers[n]) for n in numbers) < mpmath.mpf(10) ** -50
