"""Two runs side by side."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.generator.toy import RATE, toy

from hamotor import Run, compare
from hamotor.errors import UsageError
from hamotor.run.comparison import table


def differences(one: Run, other: Run) -> dict[str, Any]:
    return {d.quantity: d for d in compare(one, other).differences}


def test_a_run_does_not_differ_from_itself() -> None:
    run = toy().run()
    assert compare(run, run).largest == 0


def test_differences_are_in_the_units_of_the_quantities() -> None:
    fast = toy().state.copy()
    fast[10] = RATE + 0.001
    found = differences(toy().run(), toy(state=fast).run())
    assert found["attitude"].at_end == pytest.approx(0.01, rel=1e-6)
    assert found["attitude"].unit == "rad"
    assert found["angular momentum"].largest == pytest.approx(0.001)
    assert found["angular momentum"].unit == "kg m^2/s"
    assert found["linear momentum"].unit == "kg m/s"
    assert found["position"].largest == pytest.approx(0, abs=1e-12)
    assert found["energy"].at_end == pytest.approx((RATE + 0.001) ** 2 / 2 - RATE**2 / 2)


def test_the_largest_difference_may_lie_before_the_end() -> None:
    coarse, fine = toy().run(end=2 * math.pi, step=math.pi / 50), toy().run(end=6.0)
    with pytest.raises(UsageError, match="no recorded time"):
        compare(coarse, fine)
    found = differences(toy().run(step=0.1), toy().run(step=0.01))["position"]
    assert found.largest > found.at_end > 0


def test_runs_with_other_steps_are_compared_where_their_times_meet() -> None:
    comparison = compare(toy().run(step=0.02), toy().run(step=0.03, end=9.0))
    assert comparison.times == 151
    assert comparison.last_time == pytest.approx(9.0)


def test_runs_back_in_time_are_compared_as_well() -> None:
    comparison = compare(toy().run(step=0.02, end=-2.0), toy().run(step=0.01, end=-2.0))
    assert comparison.times == 101
    assert comparison.last_time == pytest.approx(-2.0)
    with pytest.raises(UsageError, match="no recorded time"):
        compare(toy().run(end=-2.0), toy().run(end=2.0))


def test_runs_of_other_bodies_are_refused() -> None:
    run = toy().run()
    stranger = Run({**run.report, "final": {"bill": {}}}, trajectory=run.trajectory)
    with pytest.raises(UsageError, match="different bodies: bob and bill"):
        compare(run, stranger)


def test_not_a_number_is_not_a_small_difference() -> None:
    run = toy().run()
    strange = dict(run.trajectory)
    strange["energy"] = np.full_like(run.energy, np.nan)
    other = Run(run.report, trajectory=strange, units=run.units)
    assert compare(run, other).largest == math.inf


def test_the_table_is_readable() -> None:
    text = table(compare(toy().run(), toy().run(method="euler")))
    lines = text.splitlines()
    assert lines[0].split() == ["body", "quantity", "at", "the", "end", "at", "most", "unit"]
    assert any(line.startswith("bob") and line.endswith("rad") for line in lines)
    assert lines[-1] == "over 1,001 common times to t = 10 s"
    *_, over, ends = table(
        compare(toy().run(step=0.01), toy().run(step=0.02, end=9.0))
    ).splitlines()
    assert over == "over 451 common times to t = 9 s, of 1,001 recorded"
    assert ends == "the runs end at t = 10 s and 9 s: the rest is not compared"
