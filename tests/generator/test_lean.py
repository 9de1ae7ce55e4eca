"""Lean kernels: their cost, and the accuracy that their notes promise."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from tests.generator.lean_accuracy import ALGEBRAS, FLOAT, Measure, inputs, lean_kernels, worst

from hamotor.codegen import read_algebra
from hamotor.codegen.kernel import Kernel
from hamotor.codegen.library import library
from hamotor.codegen.spec import bundled_path

KERNELS = lean_kernels()
IDS = [f"{algebra} {k.namespace} {k.name} {k.operands[0].name}" for algebra, k in KERNELS]
HALF_TURN, WHOLE_TURN = math.pi / 2, 3.14159
PROMISED = {
    "exp_lean": (2.0, 6.0),
    "log_lean": (HALF_TURN, 4.0),
    "cayley_lean": (WHOLE_TURN, 6.0),
    "cayley_inverse_lean": (HALF_TURN, 4.0),
    "normalize_lean": (WHOLE_TURN, 4.0),
}
"""Half angle up to which, and units of the last place to which, a kernel is accurate."""
COSTS = {
    ("pga3", "", "exp_lean"): (17, 8, 2),
    ("pga3", "", "log_lean"): (14, 5, 1),
    ("pga3", "se3", "exp_lean"): (20, 8, 2),
    ("pga3", "se3", "log_lean"): (16, 5, 1),
    ("pga3", "so3", "exp_lean"): (7, 2, 1),
    ("pga3", "so3", "log_lean"): (5, 1, 1),
    ("pga2", "", "exp_lean"): (4, 0, 1),
    ("pga2", "", "log_lean"): (4, 1, 1),
    ("cl3", "", "exp_lean"): (6, 2, 1),
    ("cl3", "", "log_lean"): (4, 1, 1),
}


@pytest.mark.parametrize(("algebra", "kernel"), KERNELS, ids=IDS)
def test_errors_are_within_what_the_notes_say(algebra: str, kernel: Kernel) -> None:
    largest, bound = PROMISED[kernel.name]
    assert f"at most {bound:.0f} ulp" in " ".join(kernel.notes)
    assert 0.2 < worst(algebra, kernel, largest, 60) <= bound


def test_log_loses_digits_only_near_the_second_sheet() -> None:
    (log,) = [k for a, k in KERNELS if (a, k.namespace, k.name) == ("pga3", "", "log_lean")]
    assert 10 < worst("pga3", log, 3.0, 100) <= 80
    assert 1e3 < worst("pga3", log, WHOLE_TURN, 100) < 1e5


@pytest.mark.parametrize(("algebra", "kernel"), KERNELS, ids=IDS)
def test_no_nan_at_the_identity_half_turns_and_denormals(algebra: str, kernel: Kernel) -> None:
    measure = Measure(algebra, kernel)
    (operand,) = kernel.operands
    sizes = [0.0, 5e-324, 1e-310, 1e-200, 1e-162, 1e-154, 1e-100, 1e-17, 1e-8]
    if operand.unit:
        for scalar in (1.0, 1.0 - 2**-53, 1.0 + 2**-52, 0.0):
            for small in sizes:
                found = measure.run([scalar, *(small for _ in operand.components[1:])])
                # What is nearly zero is no versor: from here on nothing is promised.
                if scalar or small > DIVIDING.get(kernel.name, -1.0):
                    assert all(math.isfinite(x) for x in found), (scalar, small)
        if kernel.name == "log_lean":
            for scalar in (-1.0, -1.0 + 2**-53):
                found = measure.run([scalar, *(1e-20 for _ in operand.components[1:])])
                assert all(math.isfinite(x) for x in found)
        return
    for turning in (*sizes, math.pi / 2, math.pi):
        for moving in (*sizes, 1.0, 1e100):
            found = measure.run(
                [turning if c.name in TURNING else moving for c in operand.components]
            )
            assert all(math.isfinite(x) for x in found), (turning, moving)


DIVIDING = {"normalize_lean": 1e-150, "cayley_inverse_lean": 1e-8}
"""Kernels that divide by a norm, with the largest components of what has none."""
TURNING = {"e23", "e31", "e12", "w23", "w31", "w12"}


@pytest.mark.parametrize("name", COSTS)
def test_costs_are_at_or_below_the_lowest_known(name: tuple[str, str, str]) -> None:
    (cost,) = [k.program.cost for a, k in KERNELS if (a, k.namespace, k.name) == name]
    assert (cost.mul, cost.add, cost.div) == COSTS[name]
    called = set(cost.calls) - {"select"}
    assert called == ({"sqrt", "sin", "cos"} if name[2] == "exp_lean" else {"sqrt", "acos"})


# ---------------------------------------------------------------- shortcuts

SHORTENED = [
    (algebra, kernel)
    for algebra in ALGEBRAS
    for kernel in library(read_algebra(bundled_path(algebra)))
    if kernel.shortcut is not None
]
SHORTENED_EXPONENTIALS = [(a, k) for a, k in SHORTENED if k.name == "exp"]
SHORTENED_LOGARITHMS = [(a, k) for a, k in SHORTENED if k.name == "log"]
SHORTENED_IDS = [f"{a} {k.namespace} {k.name} {k.operands[0].name}" for a, k in SHORTENED]


def taken(kernel: Kernel, numbers: Sequence[float]) -> dict[str, bool]:
    """Which conditions of the kernel's shortcut hold for these components."""
    assert kernel.shortcut is not None
    (parameter,) = kernel.program.parameters
    components = parameter.element.components
    values = {
        f"{parameter.name}.{c.name}": np.float64(x)
        for c, x in zip(components, numbers, strict=True)
    }
    with np.errstate(all="ignore"):
        found = kernel.shortcut.where.evaluate(values, FLOAT)
    return {name: bool(x > 0) for name, x in found.items()}


def farthest(kernel: Kernel) -> float:
    """The half angle up to which a kernel takes its shortcut."""
    assert kernel.shortcut is not None
    pitched = "moderate" in dict(kernel.shortcut.where.outputs)
    return HALF_TURN if pitched or kernel.name == "exp" else math.acos(-7 / 8)


def shortcut(kernel: Kernel) -> Kernel:
    """The shortcut as a kernel of its own."""
    assert kernel.shortcut is not None
    return replace(kernel, name=f"{kernel.name}_lean", program=kernel.shortcut.program)


def test_exponentials_and_logarithms_have_shortcuts() -> None:
    assert [kernel.name for _, kernel in SHORTENED].count("exp") == 7
    assert [kernel.name for _, kernel in SHORTENED].count("log") == 7
    assert len(SHORTENED) == 14


@pytest.mark.parametrize(("algebra", "kernel"), SHORTENED, ids=SHORTENED_IDS)
def test_a_shortcut_is_taken_where_it_may_be_and_as_accurate(algebra: str, kernel: Kernel) -> None:
    measure, dice = Measure(algebra, shortcut(kernel)), random.Random(2)
    allowed = 4.5 if kernel.name == "exp" else 4
    for angle, translation in inputs(dice, 0.999 * farthest(kernel), 60):
        numbers, error = measure.numbers_and_error(dice, angle, translation)
        assert all(taken(kernel, numbers).values()), (angle, translation)
        assert error <= allowed, (angle, translation)


@pytest.mark.parametrize(
    ("algebra", "kernel"), SHORTENED_EXPONENTIALS, ids=lambda x: getattr(x, "namespace", x)
)
def test_an_exponential_s_shortcut_is_not_taken_where_it_would_be_wrong(
    algebra: str, kernel: Kernel
) -> None:
    measure, dice = Measure(algebra, shortcut(kernel)), random.Random(3)
    beyond, _ = measure.numbers_and_error(dice, HALF_TURN + 0.01, 1.0)
    assert not taken(kernel, beyond)["angle"]
    for factor in (1e200, math.inf, math.nan):
        assert not taken(kernel, [factor * x for x in beyond])["angle"], factor
    if "moderate" in taken(kernel, beyond):
        far, _ = measure.numbers_and_error(dice, 1.0, 1e100)
        assert not taken(kernel, far)["moderate"]


@pytest.mark.parametrize(
    ("algebra", "kernel"), SHORTENED_LOGARITHMS, ids=lambda x: getattr(x, "namespace", x)
)
def test_what_is_not_unit_counts_once_in_a_shortcut(algebra: str, kernel: Kernel) -> None:
    measure, dice = Measure(algebra, shortcut(kernel)), random.Random(4)
    defect = 240 * 2.0**-52
    for angle, translation in inputs(dice, 0.999 * farthest(kernel), 60):
        for sign in (1, -1):
            factor = 1 + sign * defect / 2
            numbers, error = measure.numbers_and_error(dice, angle, translation, factor)
            assert all(taken(kernel, numbers).values()), (angle, translation)
            assert error <= 4 + defect * 2**53, (angle, translation)


@pytest.mark.parametrize(
    ("algebra", "kernel"), SHORTENED_LOGARITHMS, ids=lambda x: getattr(x, "namespace", x)
)
def test_a_logarithm_s_shortcut_is_not_taken_where_it_would_be_wrong(
    algebra: str, kernel: Kernel
) -> None:
    measure, dice = Measure(algebra, shortcut(kernel)), random.Random(3)
    beyond, _ = measure.numbers_and_error(dice, farthest(kernel) + 0.01, 1.0)
    assert not taken(kernel, beyond)["angle"]
    numbers, _ = measure.numbers_and_error(dice, 1.0, 1.0)
    for factor in (1 + 1e-12, 1 - 1e-12, 2.0, -0.5, 0.0, 1e200, math.nan):
        assert not all(taken(kernel, [factor * x for x in numbers]).values()), factor
    if farthest(kernel) == HALF_TURN:
        names = [c.name for c in kernel.operands[0].components]
        quad = max(range(len(names)), key=lambda i: len(names[i]))
        slipped = [x + 1e-12 * (i == quad) for i, x in enumerate(numbers)]
        assert not taken(kernel, slipped)["motor"]
        far, _ = measure.numbers_and_error(dice, 1e-8, 1e100)
        assert not taken(kernel, far)["moderate"]
