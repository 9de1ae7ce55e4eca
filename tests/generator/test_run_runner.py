"""Stepping: what is kept, when it ends, and what is said about it."""

from __future__ import annotations

import io
import itertools
import math
import signal
import threading
import time

import numpy as np
import pytest
from tests.generator.toy import RATE, interrupts, toy, toy_state

from hamotor.errors import NumericsError, UsageError
from hamotor.run import runner, tolerance
from hamotor.run.dataset import MemoryRecorder
from hamotor.run.library import SceneLibrary
from hamotor.run.progress import PrintedProgress
from hamotor.run.result import RunFailed, RunInterrupted
from hamotor.run.runner import integrate, plan
from hamotor.run.tolerance import meet_tolerance


@pytest.fixture(scope="module")
def library() -> SceneLibrary:
    return toy().compile().library


def test_a_whole_number_of_steps_ends_at_the_end_time() -> None:
    fitted = plan("euler", end=1.0, step=0.3, every=1)
    assert (fitted.steps, fitted.step) == (4, 0.25)
    assert fitted.shortened


@pytest.mark.parametrize(
    ("end", "step", "steps"),
    [(100.0, 0.01, 10_000), (0.3, 0.1, 3), (1e6, 0.01, 10**8), (5.0, 7.0, 1), (1e-9, 1e-10, 10)],
)
def test_a_step_that_fits_is_not_shortened(end: float, step: float, steps: int) -> None:
    fitted = plan("euler", end=end, step=step, every=1)
    assert fitted.steps == steps
    assert fitted.shortened == (step > end)


@pytest.mark.parametrize(
    ("end", "step", "every"),
    [(0.0, 0.1, 1), (1.0, -0.1, 1), (1.0, 0.0, 1), (1.0, math.nan, 1), (math.inf, 1.0, 1)],
)
def test_times_must_be_finite_and_go_one_way(end: float, step: float, every: int) -> None:
    with pytest.raises(UsageError, match=r"finite number|positive number"):
        plan("euler", end=end, step=step, every=every)


def test_every_must_be_a_step_at_least() -> None:
    with pytest.raises(UsageError, match="at least 1"):
        plan("euler", end=1.0, step=0.1, every=0)


def test_every_fits_the_library_that_counts_the_steps() -> None:
    assert plan("euler", end=1.0, step=0.1, every=10**18).every == 10**18
    with pytest.raises(UsageError, match=r"at most 1e\+18, not 1000000000000000001"):
        plan("euler", end=1.0, step=0.1, every=10**18 + 1)


def test_more_steps_than_any_run_could_take_are_refused() -> None:
    with pytest.raises(UsageError, match="longer step"):
        plan("euler", end=1e9, step=1e-9, every=1)


def test_the_time_of_a_row_is_its_index_times_the_step() -> None:
    run = toy().run(end=100.0, step=0.1)
    np.testing.assert_array_equal(run.t, np.arange(1001) * 0.1)


def test_the_first_and_the_last_state_are_always_recorded() -> None:
    run = toy().run(end=1.0, step=0.1, every=4)
    np.testing.assert_allclose(run.t, [0.0, 0.4, 0.8, 1.0])
    assert run.report["rows"] == 4


def test_every_longer_than_the_run_keeps_two_rows() -> None:
    assert len(toy().run(end=1.0, step=0.1, every=1000).t) == 2


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("splitting2", 2)])
def test_the_error_falls_with_the_order_of_the_method(method: str, order: int) -> None:
    errors = [
        abs(toy().run(end=1.0, step=step, method=method).position()[-1, 0] - math.cos(1.0))
        for step in (0.02, 0.01)
    ]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


def test_the_size_of_the_chunks_does_not_change_a_bit(
    library: SceneLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = []
    for chunk_s, first in ((0.1, 64), (1e-7, 1), (1e-6, 7)):
        monkeypatch.setattr(runner, "_CHUNK_S", chunk_s)
        monkeypatch.setattr(runner, "_FIRST_CHUNK_STEPS", first)
        recorder = MemoryRecorder()
        fitted = plan("splitting2", end=10.0, step=0.01, every=3)
        outcome = integrate(library, toy_state(), fitted, recorder)
        columns = recorder.columns(library.description)
        tables.append(np.stack(list(columns.values())))
        assert outcome.rows == tables[-1].shape[1]
    np.testing.assert_array_equal(tables[0], tables[1])
    np.testing.assert_array_equal(tables[0], tables[2])


def test_the_worst_error_is_the_worst_of_the_recorded_rows() -> None:
    run = toy().run(end=10.0, step=0.1)
    energy = run.energy
    worst = np.abs(energy - energy[0]).max() / abs(energy[0])
    assert run.conserved["energy"]["max_relative_error"] == worst
    assert worst > 1e-5


def test_what_starts_at_zero_has_an_absolute_error() -> None:
    said = toy().run().conserved["spatial_momentum.e02"]
    assert (said["scale"], said["max_relative_error"]) == (0, 0)


def test_a_number_that_becomes_infinite_ends_the_run_and_keeps_what_was_computed() -> None:
    with pytest.raises(RunFailed, match=r"step 501, after t = 5 s.*shorter step") as caught:
        toy({"FAIL_AT": 501}).run(every=3)
    run = caught.value.run
    assert caught.value.exit_code == 3
    assert run.status == "failed"
    assert run.report["steps"] == 500
    assert run.t[-1] == pytest.approx(5.0)
    assert len(run.t) == 1 + 166 + 1
    assert run.position()[-1, 0] == pytest.approx(math.cos(5.0), abs=1e-4)


def test_failing_in_the_first_step_keeps_the_initial_state() -> None:
    with pytest.raises(RunFailed) as caught:
        toy({"FAIL_AT": 1}).run()
    assert caught.value.run.report["steps"] == 0
    assert len(caught.value.run.t) == 1


@pytest.mark.parametrize(("every", "rows", "steps"), [(1, 300, 299), (7, 300 // 7 + 1, 294)])
def test_an_observed_quantity_that_becomes_infinite_is_named(
    every: int, rows: int, steps: int
) -> None:
    at = 300 if every == 1 else 301
    with pytest.raises(RunFailed, match=f"energy became non-finite.*step {at}") as caught:
        toy({"OVERFLOW_AT": at}).run(every=every)
    run = caught.value.run
    assert len(run.t) == rows
    assert run.report["steps"] == steps
    assert np.isfinite(run.energy).all()


def test_an_infinite_initial_state_is_refused_before_the_first_step() -> None:
    with pytest.raises(NumericsError, match="energy is not finite in the initial state"):
        toy({"OVERFLOW_AT": 0}).run()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_run_and_keeps_what_was_computed(number: int) -> None:
    simulation = toy({"SLEEP_US": 1000})
    simulation.compile()
    interrupting = interrupts(0.3, number)
    with pytest.raises(RunInterrupted) as caught:
        simulation.run(end=1000.0, step=0.01)
    interrupting.join()
    run = caught.value.run
    assert run.status == "interrupted"
    assert 0 < run.report["steps"] < run.report["planned_steps"]
    assert len(run.t) == run.report["steps"] + 1
    assert signal.getsignal(number) in {signal.default_int_handler, signal.SIG_DFL}


def test_a_run_steps_outside_the_main_thread_too() -> None:
    runs = []
    thread = threading.Thread(target=lambda: runs.append(toy().run(end=1.0)))
    thread.start()
    thread.join()
    assert runs[0].status == "finished"


def test_the_tolerance_is_met_by_a_run_that_a_finer_one_verifies() -> None:
    run = toy().run(tolerance=1e-8)
    said = run.report["tolerance"]
    assert said["target"] == 1e-8
    assert said["achieved"] <= 1e-8
    steps = [rung["steps"] for rung in said["ladder"]]
    assert all(2 * coarse <= fine for coarse, fine in itertools.pairwise(steps))
    assert run.report["steps"] == steps[-1]
    differences = [rung["difference"] for rung in said["ladder"]]
    assert differences[0] is None
    assert differences[-1] <= 1e-8 < differences[-2]
    assert abs(run.position()[-1, 0] - math.cos(10.0)) <= 1e-8
    assert len(run.t) < 5000


def test_a_tolerance_below_rounding_is_refused_with_what_can_be_reached() -> None:
    with pytest.raises(RunFailed, match=r"came within .* rounding errors to that size") as caught:
        toy().run(end=1.0, tolerance=1e-30)
    assert caught.value.run.status == "failed"
    assert caught.value.run.t[-1] == pytest.approx(1.0)


def test_the_same_run_once_more_verifies_nothing() -> None:
    simulation = toy({"CONTROLLED": '"true"'}, method="euler")
    run = simulation.run(tolerance=1e-12)
    said = run.report["tolerance"]
    first, again, nudged = (rung["difference"] for rung in said["ladder"])
    assert (first, again) == (None, 0)
    assert 1e-16 < nudged == said["achieved"] < 1e-12
    assert run.momentum()[0, 2] == RATE, "of the runs, the one from the start that was given"
    with pytest.raises(RunFailed, match=r"a start some roundings away ends .* scalar of more"):
        simulation.run(tolerance=1e-17)


def test_the_cap_on_halvings_is_an_error(
    library: SceneLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tolerance, "_MOST_RUNGS", 3)
    outcome, _ = meet_tolerance(
        library,
        toy_state(),
        method="euler",
        end=10.0,
        tolerance=1e-9,
        every=None,
        new_recorder=MemoryRecorder,
    )
    assert outcome.status == "failed"
    assert "3 runs were not enough" in outcome.problem


def test_a_ladder_that_would_take_too_long_keeps_its_last_whole_run() -> None:
    simulation = toy({"SLEEP_US": 100})
    simulation.compile()
    with pytest.raises(RunFailed, match=r"the time limit.* whole runs differ by") as caught:
        simulation.run(end=1.0, tolerance=1e-4, method="euler", time_limit=0.8)
    run = caught.value.run
    assert run.status == "failed"
    assert run.t[-1] == 1.0
    assert 1e-4 < run.report["tolerance"]["achieved"] < 0.1


def test_an_interrupted_ladder_keeps_the_last_whole_run() -> None:
    simulation = toy({"SLEEP_US": 100})
    simulation.compile()
    interrupting = interrupts(0.9)
    with pytest.raises(RunInterrupted) as caught:
        simulation.run(tolerance=1e-15)
    interrupting.join()
    run = caught.value.run
    assert run.status == "interrupted"
    assert run.report["tolerance"]["ladder"][-1]["status"] == "interrupted"
    assert run.t[-1] == pytest.approx(10.0)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, math.nan, math.inf])
def test_a_tolerance_must_be_positive(tolerance: float) -> None:
    with pytest.raises(UsageError, match="tolerance must be a positive number"):
        toy().run(tolerance=tolerance)


def test_a_step_and_a_tolerance_exclude_each_other() -> None:
    with pytest.raises(UsageError, match="not both"):
        toy().run(step=0.1, tolerance=1e-3)


def test_auto_chooses_the_symplectic_splitting_and_says_why() -> None:
    report = toy().run(method="auto").report
    assert report["method"] == "splitting2"
    assert "coadjoint" in report["method_reason"]
    assert toy().run(method="euler").report["method_reason"] == ""


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_short_run_shows_no_progress() -> None:
    for stream in (Terminal(), io.StringIO()):
        toy().run(progress=PrintedProgress(stream))
        assert "steps/s" not in stream.getvalue()


def test_a_long_run_shows_a_bar_on_a_terminal_and_wipes_it() -> None:
    stream = Terminal()
    toy({"SLEEP_US": 1000}).run(end=14.0, progress=PrintedProgress(stream))
    shown = stream.getvalue()
    assert "\r[" in shown
    assert "steps/s" in shown
    assert "left" in shown
    assert shown.endswith("\r")


def test_without_a_terminal_there_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stream = io.StringIO()
    progress = PrintedProgress(stream)
    now = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    progress.begin("", 1000)
    for second in range(1, 36):
        now = float(second)
        progress.advance(second * 20, second * 0.5)
    progress.end()
    lines = stream.getvalue().splitlines()
    assert len(lines) == 3
    assert lines[0].startswith("20.0%  200 of 1 k steps  20 steps/s")
    assert lines[0].endswith("40 s left")
    assert "\r" not in stream.getvalue()
