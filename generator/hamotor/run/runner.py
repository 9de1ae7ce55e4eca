"""Stepping a compiled scene: in chunks, so that a run can be watched, interrupted and recorded.

The library takes steps for about a tenth of a second at a time.  Between two chunks rows go to the
recorder, progress is shown, and a Ctrl-C that came meanwhile ends the run.  Nothing computed is
lost.
"""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from types import FrameType, TracebackType
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from hamotor.errors import NumericsError, UsageError
from hamotor.run.library import (
    Conserved,
    Description,
    Exact,
    LiveRun,
    Rows,
    SceneLibrary,
    Vector,
)
from hamotor.run.progress import NoProgress, Progress

Status = Literal["finished", "interrupted", "failed"]

_CHUNK_S = 0.1
_FIRST_CHUNK_STEPS = 64
_LARGEST_GROWTH = 8
_ROWS_PER_CHUNK = 1 << 15
_MOST_STEPS = 10**15
_MOST_HALVINGS = 30
_ROWS_OF_A_TOLERANCE_RUN = 2000
_TOGETHER = 0.01  # below this difference the runs have begun to converge
_STALLED_RUNGS = 3
_PATIENCE = 14
_VANISHING = 1e-12
_FIRST_TURN = 0.25  # a first guess turns the motor by at most a quarter of a radian in a step


class Recorder(Protocol):
    """Where rows go as they come."""

    def append(self, rows: Rows) -> None:
        """Take rows, shape (n, columns), in order of time.  The array may be reused after."""

    def close(self) -> None:
        """No more rows will come."""

    def discard(self) -> None:
        """Forget every row."""


@dataclass(frozen=True)
class Plan:
    """How long a run is: `steps` steps of `step` seconds reach `end`; every `every`-th is kept.

    `asked_step` is the step asked for: the plan's own is the longest that is not longer and
    divides the end time into a whole number of steps.
    """

    method: str
    end: float
    step: float
    steps: int
    every: int
    asked_step: float

    @property
    def exact_step(self) -> Fraction:
        """The step of wide scalars: the end is the decimal that it was given as."""
        return Fraction(repr(self.end)) / self.steps

    @property
    def shortened(self) -> bool:
        """Whether the step had to shrink by more than rounding."""
        return self.step < self.asked_step * (1 - 1e-9)


def plan(method: str, *, end: float, step: float, every: int) -> Plan:
    """Fit a whole number of steps into [0, end].

    Raises UsageError unless end, step (seconds) and every are positive and finite.
    """
    for name, value in (("end", end), ("step", step)):
        if not (math.isfinite(value) and value > 0):
            raise UsageError(f"{name} must be a positive number of seconds, not {value!r}.")
    if every < 1:
        raise UsageError(f"every must be a whole number of steps, at least 1, not {every}.")
    quotient = end / step
    if not quotient < _MOST_STEPS:
        raise UsageError(
            f"end / step = {quotient:.3g} steps, more than the {_MOST_STEPS:.0e} a run may have. "
            "Take a longer step or an earlier end."
        )
    rounding = max(1e-9, 4 * np.finfo(float).eps * quotient)
    steps = max(1, math.ceil(quotient - rounding))
    return Plan(method, end, end / steps, steps, every, step)


@dataclass(frozen=True)
class ConservedError:
    """What became of a quantity that must stay constant.

    `worst` is the largest |value − initial| over all recorded rows, divided by `scale`, the initial
    norm of the quantity.  Where that is zero `scale` is zero and `worst` is absolute.
    """

    initial: float
    final: float
    worst: float
    scale: float


@dataclass(frozen=True)
class Rung:
    """One run of a tolerance ladder; `difference` is to the run before, None for the first."""

    step: float
    steps: int
    difference: float | None
    status: Status
    integrate_s: float


@dataclass(frozen=True)
class Ladder:
    """How a tolerance was met, or was not: `achieved` is the last difference."""

    target: float
    achieved: float | None
    rungs: tuple[Rung, ...]


@dataclass(frozen=True)
class Outcome:
    """A run after its last step.  `final` is the last row; `problem` says why it failed.

    `wide_final` is the last row with all digits, where the scalar has more than a double.
    """

    plan: Plan
    status: Status
    steps_done: int
    rows: int
    initial: Vector
    final: Vector
    conserved: dict[str, ConservedError]
    largest_drift: float
    total_drift: float
    integrate_s: float
    problem: str = ""
    ladder: Ladder | None = None
    wide_final: Exact | None = None

    @property
    def ns_per_step(self) -> float:
        """Time in the stepper per step, nanoseconds; recording to disk is not counted."""
        return 1e9 * self.integrate_s / self.steps_done if self.steps_done else 0.0


class Interruption:
    """Ctrl-C and SIGTERM held back while a run steps and is written: `asked` turns true.

    The run ends itself after the chunk it is in.  Outside the main thread signals are left alone.
    """

    def __init__(self) -> None:
        self.asked = False
        self._earlier: dict[int, object] = {}

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._earlier[number] = signal.signal(number, self._hold)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for number, handler in self._earlier.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _hold(self, _number: int, _frame: FrameType | None) -> None:
        self.asked = True


class _ConservedWatch:
    """The worst error of every conserved quantity over the rows seen so far."""

    def __init__(self, description: Description, initial: Vector) -> None:
        index = description.column_index
        self._quantities = description.conserved
        self._columns = [index[q.column] for q in self._quantities]
        self._initial = initial[self._columns]
        self._scales = np.array([_scale(description, q, initial) for q in self._quantities])
        self._largest = np.zeros(len(self._quantities))
        self._exact_initial: Exact | None = None

    def see(self, rows: Rows) -> None:
        if len(rows) and self._columns:
            change = np.abs(rows[:, self._columns] - self._initial).max(axis=0)
            self._largest = np.maximum(self._largest, change)

    def see_exactly(self, row: Exact) -> None:
        """Take a row in all digits, in place of doubles; the first one is the initial state."""
        if self._exact_initial is None:
            self._exact_initial = row
        change = [abs(float(row[k] - self._exact_initial[k])) for k in self._columns]
        self._largest = np.maximum(self._largest, change)

    def errors(self, final: Vector) -> dict[str, ConservedError]:
        worst = self._largest / np.where(self._scales > 0, self._scales, 1.0)
        return {
            quantity.name: ConservedError(
                initial=float(self._initial[k]),
                final=float(final[self._columns[k]]),
                worst=float(worst[k]),
                scale=float(self._scales[k]),
            )
            for k, quantity in enumerate(self._quantities)
        }


def _scale(description: Description, quantity: Conserved, initial: Vector) -> float:
    """What a conserved quantity's error is divided by; 0 where it is zero but for rounding."""
    index = description.column_index
    norm = float(np.linalg.norm(initial[[index[name] for name in quantity.norm]]))
    unit = description.columns[index[quantity.column]].unit
    alike = [k for k, column in enumerate(description.columns) if column.unit == unit]
    if norm <= _VANISHING * float(np.linalg.norm(initial[alike])):
        norm = 0.0
    return norm or quantity.scale


def integrate(
    library: SceneLibrary,
    state: Sequence[float | Fraction] | Vector,
    plan: Plan,
    recorder: Recorder,
    *,
    progress: Progress | None = None,
    interruption: Interruption | None = None,
    stage: str = "",
) -> Outcome:
    """Step the scene from t = 0 to the plan's end and record rows.

    The first row is the initial state, the last the final one, whether or not `every` divides the
    number of steps.  A number that becomes non-finite ends the run with status "failed": rows up
    to then are kept.  The recorder is closed.
    """
    interruption = Interruption() if interruption is None else interruption
    progress = NoProgress() if progress is None else progress
    step = plan.exact_step if library.description.is_wide else plan.step
    with library.start(plan.method, step=step, state=state) as live:
        progress.begin(stage, plan.steps)
        try:
            return _step_in_chunks(live, plan, recorder, progress, interruption)
        finally:
            progress.end()
            recorder.close()


def _step_in_chunks(
    live: LiveRun, plan: Plan, recorder: Recorder, progress: Progress, interruption: Interruption
) -> Outcome:
    kept = _KeptRows(live, plan, recorder)
    problem = ""
    interrupted = False
    done, chunk = 0, _FIRST_CHUNK_STEPS
    seconds = 0.0
    buffer = np.empty((0, len(live.description.columns)))
    while done < plan.steps and not problem:
        if interruption.asked:
            interrupted = True
            break
        asked = min(chunk, plan.steps - done, _ROWS_PER_CHUNK * plan.every)
        if live.description.is_wide:  # every row is the state after a chunk, in all digits
            asked = min(asked, plan.every - done % plan.every)
        due = (done + asked) // plan.every - done // plan.every
        if due > len(buffer):
            buffer = np.empty((due, len(live.description.columns)))
        started = time.perf_counter()
        taken = live.advance(asked, plan.every, buffer if due else None)
        spent = time.perf_counter() - started
        seconds += spent
        rows_at = plan.every * np.arange(
            done // plan.every + 1, (done + taken) // plan.every + 1, dtype=np.int64
        )
        problem = kept.keep(buffer[: len(rows_at)], rows_at)
        done += taken
        if taken < asked and not problem:
            kept.keep(live.observe()[np.newaxis], np.array([done]))
            problem = _failure(live, plan, done, kept.initial)
        progress.advance(done, seconds)
        chunk = _next_chunk(asked, spent)
    if kept.step < done and not problem:
        problem = kept.keep(live.observe()[np.newaxis], np.array([done]))
    largest, total = live.drift()
    return Outcome(
        plan=plan,
        status="failed" if problem else "interrupted" if interrupted else "finished",
        steps_done=kept.step,
        rows=kept.rows,
        initial=kept.initial,
        final=kept.last,
        conserved=kept.conserved.errors(kept.last),
        largest_drift=largest,
        total_drift=total,
        integrate_s=seconds,
        problem=problem,
        wide_final=kept.exact_last,
    )


class _KeptRows:
    """The rows recorded so far: `step` is the index of the last one, `last` the row itself.

    `exact_last` is the same in all digits of a wide scalar, whose rows come one by one.
    """

    def __init__(self, live: LiveRun, plan: Plan, recorder: Recorder) -> None:
        initial = live.observe()
        self._live = live
        self._columns = live.description.columns
        self._plan = plan
        self._recorder = recorder
        self.initial = self.last = initial
        self.exact_last: Exact | None = None
        self.conserved = _ConservedWatch(live.description, initial)
        self.step = self.rows = 0
        if self.keep(initial[np.newaxis], np.zeros(1, dtype=np.int64)):
            name = self._columns[int(np.argmin(np.isfinite(initial)))].name
            raise NumericsError(f"{name} is not finite in the initial state.")

    def keep(self, rows: Rows, steps: NDArray[np.int64]) -> str:
        """Keep the rows after these steps, up to the first that is not finite; say what is not."""
        if not len(rows) or (self.rows and steps[0] <= self.step):
            return ""
        # A row's time is its index times the step, so that rounding does not pile up.
        rows[:, 0] = self._plan.step * steps
        finite = np.isfinite(rows)
        good = len(rows) if finite.all() else int(np.argmin(finite.all(axis=1)))
        if good:
            exact = self._live.observe_exactly() if self._live.description.is_wide else None
            if exact is None:
                self.conserved.see(rows[:good])
            else:
                self.conserved.see_exactly(exact)
                self.exact_last = exact
            self._recorder.append(rows[:good])
            self.rows += good
            self.step = int(steps[good - 1])
            self.last = rows[good - 1].copy()
        if good == len(rows):
            return ""
        name = self._columns[int(np.argmin(finite[good]))].name
        return (
            f"{name} became non-finite between step {self.step} and step {steps[good]} "
            f"(t = {steps[good] * self._plan.step:.6g} s). {_advice(self._plan)}"
        )


def _next_chunk(asked: int, spent: float) -> int:
    if spent <= 0:
        return asked * _LARGEST_GROWTH
    fitting = asked * _CHUNK_S / spent
    return max(1, int(min(fitting, asked * _LARGEST_GROWTH)))


def _failure(live: LiveRun, plan: Plan, done: int, initial: Vector) -> str:
    """Which part of the state left the finite numbers: the one that had grown the most."""
    description = live.description
    columns = description.state_columns()
    now = live.state()
    growth = np.abs(now) / np.maximum(np.abs(initial[columns]), 1.0)
    worst = int(np.argmax(growth))
    name = description.columns[columns[worst]].name
    return (
        f"the state became non-finite in step {done + 1}, after t = {done * plan.step:.6g} s. "
        f"In the last finite state {name} = {now[worst]:.6g} had grown the most. "
        f"{_advice(plan)}"
    )


def _advice(plan: Plan) -> str:
    return f"Try a shorter step than {plan.step:.6g} s."


def meet_tolerance(
    library: SceneLibrary,
    state: Sequence[float | Fraction] | Vector,
    *,
    method: str,
    end: float,
    tolerance: float,
    every: int | None,
    new_recorder: Callable[[], Recorder],
    progress: Progress | None = None,
    interruption: Interruption | None = None,
) -> tuple[Outcome, Recorder]:
    """Halve the step until the final states of two runs differ by at most `tolerance`.

    The difference is the largest over all bodies of |ΔM| (any component, the sign of M fixed) and
    |Δμ| over the norm of the initial momentum.  The finer run of the last pair is returned with its
    recorder; the others are discarded.  Status "failed" with the reason in `problem` when rounding,
    chaos or the cap on halvings comes first.  `every` None keeps about two thousand rows.
    """
    if not (math.isfinite(tolerance) and tolerance > 0):
        raise UsageError(f"tolerance must be a positive number, not {tolerance!r}.")
    plan(method, end=end, step=end, every=1 if every is None else every)
    step = first_step(library, state, method=method, end=end)
    rungs: list[Rung] = []
    best: tuple[Outcome, Recorder] | None = None
    achieved: float | None = None
    reason = ""
    status: Status = "failed"
    interruption = Interruption() if interruption is None else interruption
    for _ in range(_MOST_HALVINGS + 1):
        rung_plan = plan(method, end=end, step=step, every=1)
        rung_plan = replace(
            rung_plan,
            every=max(1, rung_plan.steps // _ROWS_OF_A_TOLERANCE_RUN) if every is None else every,
        )
        recorder = new_recorder()
        outcome = integrate(
            library,
            state,
            rung_plan,
            recorder,
            progress=progress,
            interruption=interruption,
            stage=f"step {rung_plan.step:.3g} s",
        )
        difference = None
        if best is not None and best[0].status == outcome.status == "finished":
            difference = state_difference(library.description, best[0], outcome)
        rungs.append(
            Rung(
                rung_plan.step,
                rung_plan.steps,
                difference,
                outcome.status,
                outcome.integrate_s,
            )
        )
        if outcome.status == "interrupted" and best is not None:
            # A whole run with a longer step says more than a part of the next one.
            recorder.discard()
            status = "interrupted"
            break
        if best is not None:
            best[1].discard()
        best = outcome, recorder
        achieved = difference
        if outcome.status == "interrupted":
            status = "interrupted"
            break
        if difference is not None and difference <= tolerance:
            status = "finished"
            break
        reason = _hopeless(rungs)
        if reason:
            break
        # Half of the step in use, so that the steps of a rung are nested in the next one's.
        step = rung_plan.step / 2
        if rung_plan.steps * 2 >= _MOST_STEPS:
            reason = "the number of steps would grow without bound."
            break
    else:
        reason = f"{_MOST_HALVINGS} halvings of the step were not enough."
    assert best is not None
    outcome, recorder = best
    if status == "failed":
        reason = f"the tolerance {tolerance:g} was not met: {reason}"
        if outcome.problem:
            reason += f" In the last run {outcome.problem}"
    ladder = Ladder(tolerance, achieved, tuple(rungs))
    return replace(outcome, status=status, problem=reason, ladder=ladder), recorder


def _hopeless(rungs: Sequence[Rung]) -> str:
    """Why further halving would not help; "" while it may."""
    differences = [rung.difference for rung in rungs if rung.difference is not None]
    if not differences:
        return ""
    best = min(differences)
    if best >= _TOGETHER:
        if len(rungs) <= _PATIENCE:
            return ""
        return (
            f"after {len(rungs) - 1} halvings of the step the runs still end in different places. "
            "The motion is chaotic over this time: end it earlier."
        )
    if differences.index(best) >= len(differences) - _STALLED_RUNGS:
        return ""
    return (
        f"the runs came within {best:.2g} of each other and not closer. The motion amplifies "
        "rounding errors to that size: ask for no less, or end it earlier."
    )


def first_step(
    library: SceneLibrary, state: Sequence[float | Fraction] | Vector, *, method: str, end: float
) -> float:
    """A step to begin a ladder with, seconds: from how fast the initial state changes.

    One very short step gives the rates of the motor's and the momentum's components; the guess lets
    no component change by more than a quarter of its natural size, and takes at least 16 steps.
    """
    description = library.description
    start = np.asarray(state, dtype=np.float64)
    longest = end / 16
    probe = end * 2.0**-20
    with library.start(method, step=probe, state=start) as live:
        if live.advance(1, 1, None) < 1:
            return longest
        rates = np.abs(live.state() - start) / probe
    guess = longest
    motors, momenta = len(description.motor), len(description.momentum)
    for body in range(len(description.bodies)):
        at = body * (motors + momenta)
        momentum = slice(at + motors, at + motors + momenta)
        size = float(np.linalg.norm(start[momentum]))
        fastest = float(rates[at : at + motors].max())
        if size > 0:
            fastest = max(fastest, float(rates[momentum].max()) / size)
        if fastest > 0:
            guess = min(guess, _FIRST_TURN / fastest)
    return guess


def state_difference(description: Description, one: Outcome, other: Outcome) -> float:
    """How far apart two final states are, by the measure `meet_tolerance` states."""
    columns = description.state_columns()
    a, b, start = one.final[columns], other.final[columns], other.initial[columns]
    motors, momenta = len(description.motor), len(description.momentum)
    worst = 0.0
    for body in range(len(description.bodies)):
        at = body * (motors + momenta)
        motor = slice(at, at + motors)
        momentum = slice(at + motors, at + motors + momenta)
        sign = 1.0 if float(a[motor] @ b[motor]) >= 0 else -1.0
        size = float(np.linalg.norm(start[momentum])) or float(np.linalg.norm(b[momentum])) or 1.0
        worst = max(
            worst,
            float(np.abs(a[motor] - sign * b[motor]).max()),
            float(np.abs(a[momentum] - b[momentum]).max()) / size,
        )
    return worst
