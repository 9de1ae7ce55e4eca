"""Lean kernels: their cost, and the accuracy that their notes promise."""

from __future__ import annotations

import math

import pytest
from tests.generator.lean_accuracy import Measure, lean_kernels, worst

from hamotor.codegen.kernel import Kernel

KERNELS = lean_kernels()
IDS = [f"{algebra} {k.namespace} {k.name} {k.operands[0].name}" for algebra, k in KERNELS]
HALF_TURN, WHOLE_TURN = math.pi / 2, 3.14159
PROMISED = {
    "exp_lean": (WHOLE_TURN, 6.0),
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
