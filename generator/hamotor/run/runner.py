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
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from types import FrameType, TracebackType
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from hamotor.errors import NumericsError, UsageError
from hamotor.run.library import (
    Conserved,
    Description,
    Exact,
    Failure,
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
_FIRST_PATIENCE = 256
_ROWS_PER_CHUNK = 1 << 15
_MOST_STEPS = 10**15
_MOST_EVERY = 10**18
_VANISHING = 1e-12
_ALIKE = 8 * float(np.finfo(float).eps)


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
    divides the end time into a whole number of steps.  Both have the sign of `end`.  `times`, if
    given, are when rows are kept instead, in order of the run.  `tolerance` is the local error per
    second of a method that chooses its own steps between those of the plan.
    """

    method: str
    end: float
    step: float
    steps: int
    every: int
    asked_step: float
    times: Vector | None = None
    tolerance: float | None = None

    @property
    def exact_step(self) -> Fraction:
        """The step of wide scalars: the end is the decimal that it was given as."""
        return Fraction(repr(self.end)) / self.steps

    @property
    def shortened(self) -> bool:
        """Whether the step had to shrink by more than rounding."""
        return abs(self.step) < abs(self.asked_step) * (1 - 1e-9)

    def time(self, index: float | NDArray[np.int64]) -> Any:
        """When these steps are taken, s: an index times the step, so that no rounding piles up."""
        return self.step * index + 0.0


def plan(
    method: str,
    *,
    end: float,
    step: float,
    every: int = 1,
    times: Sequence[float] | Vector | None = None,
    tolerance: float | None = None,
) -> Plan:
    """Fit a whole number of steps into [0, end]; a negative end is reached back in time.

    Raises UsageError unless end (s) is finite and not zero, step (s) finite and of the sign of
    end or positive, every positive, and times go from 0 to end.
    """
    refuse_impossible_span(end, step)
    if tolerance is not None and not (math.isfinite(tolerance) and tolerance > 0):
        raise UsageError(f"a local tolerance must be a positive number, not {tolerance!r}.")
    step = math.copysign(step, end)
    if not 1 <= every <= _MOST_EVERY:
        raise UsageError(
            f"every must be a whole number of steps, at least 1 and at most {_MOST_EVERY:.0e}, "
            f"not {every}."
        )
    quotient = end / step
    rounding = max(1e-9, 4 * np.finfo(float).eps * quotient)
    steps = max(1, math.ceil(quotient - rounding))
    chosen = None if times is None else _checked_times(times, end)
    return Plan(method, end, end / steps, steps, every, step, chosen, tolerance)


def refuse_impossible_span(end: float, step: float | None = None) -> None:
    """UsageError unless steps of `step` (s), where one is given, can reach `end` (s)."""
    if not (math.isfinite(end) and end != 0):
        raise UsageError(f"end must be a finite number of seconds and not zero, not {end!r}.")
    if step is None:
        return
    if not (math.isfinite(step) and step != 0 and (step > 0 or end < 0)):
        raise UsageError(f"step must be a positive number of seconds, not {step!r}.")
    quotient = abs(end / step)
    if not quotient < _MOST_STEPS:
        raise UsageError(
            f"end / step = {quotient:.3g} steps, more than the {_MOST_STEPS:.0e} a run may have. "
            "Take a longer step or an earlier end."
        )


def _checked_times(times: Sequence[float] | Vector, end: float) -> Vector:
    found = np.asarray(times, dtype=np.float64)
    parts = found / end
    if found.ndim != 1 or not len(found):
        raise UsageError("the times to record at must be a list of numbers, s.")
    for time_, part in zip(found, parts, strict=True):
        if not 0 <= part <= 1:
            raise UsageError(f"cannot record at t = {time_:g} s: not between 0 and {end:g} s.")
    if (np.diff(parts) <= 0).any():
        raise UsageError("the times to record at must follow each other from 0 to the end.")
    return found


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
    tolerance: float | None = None
    """Of a method that chooses its steps: its local error per second."""


@dataclass(frozen=True)
class Ladder:
    """How a tolerance was met, or was not: `achieved` is the last difference."""

    target: float
    achieved: float | None
    rungs: tuple[Rung, ...]


@dataclass(frozen=True)
class Happened:
    """An event that a run found: its name, whether the run ended there, and the row then."""

    name: str
    stops: bool
    row: Vector

    @property
    def time(self) -> float:
        """When, s."""
        return float(self.row[0])


@dataclass(frozen=True)
class Breakdown:
    """Why a run could not go on: the time and the step, s, that failed, and what of the state."""

    reason: str
    """`not_finite`, `no_convergence`, `step_too_short` or `time_limit`."""
    time: float
    """The last that was reached, s."""
    step: float
    quantity: str
    """The column that became non-finite; "" where none did, or it is not known."""
    message: str


@dataclass(frozen=True)
class Outcome:
    """A run after its last step.  `final` is the last state's row; `problem` says why it failed.

    `wide_final` is that row with all digits, where the scalar has more than a double.
    """

    plan: Plan
    status: Status
    steps_done: int
    own_steps: int
    """Steps that the method took; more or fewer than `steps_done` where it chooses them."""
    rows: int
    initial: Vector
    final: Vector
    conserved: dict[str, ConservedError]
    largest_drift: float
    total_drift: float
    integrate_s: float
    problem: str = ""
    breakdown: Breakdown | None = None
    ladder: Ladder | None = None
    wide_final: Exact | None = None
    events: tuple[Happened, ...] = ()

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
    return float(scales(description, quantity, initial[np.newaxis])[0])


def scales(description: Description, quantity: Conserved, initial: Rows) -> Vector:
    """The same for many initial rows, shape (n, columns)."""
    index = description.column_index
    norm = _norms(initial, [index[name] for name in quantity.norm])
    unit = description.columns[index[quantity.column]].unit
    alike = [k for k, column in enumerate(description.columns) if column.unit == unit]
    norm[norm <= _VANISHING * _norms(initial, alike)] = 0.0
    return np.where(norm > 0.0, norm, quantity.scale)


def _norms(rows: Rows, columns: Sequence[int]) -> Vector:
    """Euclidean, over some columns; added column by column."""
    square = np.zeros(len(rows))
    for k in columns:
        square += rows[:, k] * rows[:, k]
    return np.sqrt(square)


def integrate(
    library: SceneLibrary,
    state: Sequence[float | Fraction] | Vector,
    plan: Plan,
    recorder: Recorder,
    *,
    progress: Progress | None = None,
    interruption: Interruption | None = None,
    stage: str = "",
    deadline: float = math.inf,
) -> Outcome:
    """Step the scene from t = 0 to the plan's end, or to an event that stops it; record rows.

    The first row is the initial state, the last the final one, whether or not `every` divides the
    number of steps; where the plan has times, rows are at those alone.  A step that fails ends the
    run with status "failed", as does `deadline` (of `time.perf_counter`) between two chunks: rows
    up to then are kept.  A step in which the method takes many of its own is done in chunks as
    well.  The recorder is closed.
    """
    interruption = Interruption() if interruption is None else interruption
    progress = NoProgress() if progress is None else progress
    step = plan.exact_step if library.description.is_wide else plan.step
    with library.start(plan.method, step=step, state=state, tolerance=plan.tolerance) as live:
        progress.begin(stage, plan.steps)
        try:
            return _Stepping(live, plan, recorder).run(progress, interruption, deadline)
        finally:
            progress.end()
            recorder.close()


class _Stepping:
    """A run from its first step to its last."""

    def __init__(self, live: LiveRun, plan: Plan, recorder: Recorder) -> None:
        self.live, self.plan = live, plan
        self.columns = live.description.columns
        self.kept = _KeptRows(live, plan, recorder)
        self.due = _Due(plan)
        self.buffer = np.empty((0, len(self.columns)))
        self.done = 0
        self.seconds = 0.0
        self.breakdown: Breakdown | None = None
        self.events: list[Happened] = []
        self.stopped: Happened | None = None

    def run(self, progress: Progress, interruption: Interruption, deadline: float) -> Outcome:
        """Step to the end, or as far as it goes."""
        plan, kept = self.plan, self.kept
        chunk, patience = _FIRST_CHUNK_STEPS, _FIRST_PATIENCE
        self.live.set_patience(patience)
        interrupted = late = False
        while self.done < plan.steps and not self.breakdown and not self.stopped:
            if interruption.asked:
                interrupted = True
                break
            if time.perf_counter() > deadline:
                late = True
                break
            asked = min(chunk, plan.steps - self.done, _ROWS_PER_CHUNK * plan.every)
            if self.live.description.is_wide and plan.times is None:
                # Every row is the state after a chunk, in all digits.
                asked = min(asked, plan.every - self.done % plan.every)
            self._observe_due()
            if self.due:
                asked = min(asked, self.due.index - self.done)
            before = self.done
            spent = self._advance(asked)
            progress.advance(self.done, self.seconds)
            if spent and self.done > before:
                chunk = _next_chunk(asked, spent)
            elif spent:  # within a step that takes long
                chunk, patience = 1, _next_chunk(patience, spent)
                self.live.set_patience(patience)
        if not self.breakdown and not self.stopped:
            self._observe_due()
            self.breakdown = kept.flush()
        if not self.breakdown:
            last = self.live.observe() if self.stopped is None else self.stopped.row.copy()
            if self.stopped is None:
                last[0] = plan.time(self.done)
            self.breakdown = kept.finish(last, self.done)
        if late and not self.breakdown:
            self.breakdown = self._out_of_time()
        kept.at_least_one_row()
        largest, total = self.live.drift()
        failed = self.breakdown is not None
        return Outcome(
            plan=plan,
            status="failed" if failed else "interrupted" if interrupted else "finished",
            steps_done=kept.step,
            own_steps=self.live.steps(),
            rows=kept.rows,
            initial=kept.initial,
            final=kept.last,
            conserved=kept.conserved.errors(kept.last),
            largest_drift=largest,
            total_drift=total,
            integrate_s=self.seconds,
            problem=self.breakdown.message if self.breakdown else "",
            breakdown=self.breakdown,
            wide_final=kept.exact_last,
            events=tuple(self.events),
        )

    def _advance(self, asked: int) -> float:
        """Take up to `asked` steps and keep what they give; the seconds they took."""
        plan, kept, live, first = self.plan, self.kept, self.live, self.done
        every = plan.every if plan.times is None else 0
        expected = (first + asked) // every - first // every if every else 0
        if expected > len(self.buffer):
            self.buffer = np.empty((expected, len(self.columns)))
        started = time.perf_counter()
        taken = live.advance(asked, every, self.buffer if expected else None)
        spent = time.perf_counter() - started
        self.seconds += spent
        self.done += taken
        if taken:
            self._see_events()
        beyond = self.done - (self.stopped is not None)  # a stop comes before the end of its step
        self.breakdown = kept.flush(self.stopped)
        if every and not self.breakdown:
            numbers = np.arange(first // every + 1, beyond // every + 1, dtype=np.int64)
            self.breakdown = kept.keep(self.buffer[: len(numbers)], every * numbers)
        reason, component = live.failure()
        if reason is not Failure.NONE and not self.breakdown:
            kept.stop_at(live.observe(), self.done)
            self.breakdown = self._failure(reason, component)
        return spent

    def _see_events(self) -> None:
        found = [
            Happened(event.name, event.stops, row)
            for k, event in enumerate(self.live.description.events)
            if (row := self.live.observe_event(k)) is not None
        ]
        for happened in sorted(found, key=lambda event: event.time / self.plan.end):
            self.events.append(happened)
            if happened.stops:
                self.stopped = happened
                return

    def _observe_due(self) -> None:
        """Rows at the times asked for in the step that comes next."""
        while self.due and self.due.index <= self.done:
            moment = self.due.pop()
            if abs(moment - self.plan.time(self.done)) <= _ALIKE * abs(moment):
                row: Vector | None = self.live.observe()
            else:
                row = self.live.observe_at(moment)
            if row is None:
                return  # the step itself will say why
            row[0] = moment
            self.kept.waiting.append(row)

    def _out_of_time(self) -> Breakdown:
        at = self.plan.time(self.done)
        return Breakdown(
            "time_limit",
            at,
            self.plan.step,
            "",
            f"the time limit passed after step {self.done:,} of {self.plan.steps:,} "
            f"(t = {at:.6g} s); what was computed until then is kept.",
        )

    def _failure(self, reason: Failure, component: int | None) -> Breakdown:
        """What of the next step failed, and what in the last good state had grown the most."""
        plan, description = self.plan, self.live.description
        columns = description.state_columns()
        at = plan.time(self.done)
        name = "" if component is None else description.columns[columns[component]].name
        where = f"in step {self.done + 1}, after t = {at:.6g} s, with a step of {plan.step:.6g} s"
        if reason is Failure.NO_CONVERGENCE:
            what = f"the iteration of {plan.method} did not converge {where}."
            name = ""
        elif reason is Failure.STEP_TOO_SHORT:
            what = (
                f"{plan.method} would need steps shorter than rounding {where}: a local error of "
                f"{plan.tolerance or 0:.2g} per second is out of reach there."
            )
            name = ""
        elif reason is Failure.LEFT_GROUP:
            what = f"a motor left the group {where}: |M M~ − 1| was too large to project."
            name = ""
        else:
            what = f"{name or 'the state'} became non-finite {where}."
        now = self.live.state()
        growth = np.abs(now) / np.maximum(np.abs(self.kept.initial[columns]), 1.0)
        worst = int(np.argmax(growth))
        grown = description.columns[columns[worst]].name
        return Breakdown(
            reason.name.lower(),
            at,
            plan.step,
            name,
            f"{what} In the last finite state {grown} = {now[worst]:.6g} had grown the most. "
            f"{_advice(plan)}",
        )


class _Due:
    """The times asked for that are still to come; `index` is the step before the next."""

    def __init__(self, plan: Plan) -> None:
        self._times = np.empty(0) if plan.times is None else plan.times
        quotients = self._times / plan.step
        nearest = np.rint(quotients)
        alike = np.abs(quotients - nearest) <= _ALIKE * np.maximum(np.abs(quotients), 1.0)
        self._indices = np.where(alike, nearest, np.floor(quotients)).astype(np.int64)
        self._next = 0

    def __bool__(self) -> bool:
        return self._next < len(self._times)

    @property
    def index(self) -> int:
        """How many steps are to be taken before the next time is due."""
        return int(self._indices[self._next])

    def pop(self) -> float:
        """The next time, s."""
        self._next += 1
        return float(self._times[self._next - 1])


class _KeptRows:
    """The rows recorded so far: `step` is the index of the last state seen, `last` its row.

    `exact_last` is the same in all digits of a wide scalar.
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
        self.waiting: list[Vector] = []
        """Rows inside the step that is being taken."""
        if not np.isfinite(initial).all():
            name = self._columns[int(np.argmin(np.isfinite(initial)))].name
            raise NumericsError(f"{name} is not finite in the initial state.")
        if plan.times is None:
            self.keep(initial[np.newaxis], np.zeros(1, dtype=np.int64))
        elif live.description.is_wide:
            self._see(initial[np.newaxis], record=False)

    def keep(self, rows: Rows, steps: NDArray[np.int64]) -> Breakdown | None:
        """Keep the rows after these steps, up to the first that is not finite; say what is not."""
        if not len(rows) or (self.rows and steps[0] <= self.step):
            return None
        rows[:, 0] = self._plan.time(steps)
        good = self._good(rows)
        breakdown = (
            self._not_finite(rows[good], f"step {steps[good]}") if good < len(rows) else None
        )
        if good:
            self._see(rows[:good], record=self._plan.times is None)
            self.step = int(steps[good - 1])
        return breakdown

    def flush(self, stop: Happened | None = None) -> Breakdown | None:
        """Keep the rows that wait, up to an event that stops the run."""
        rows = self.waiting
        if stop is not None:
            rows = [row for row in rows if row[0] / stop.time <= 1]
        self.waiting = []
        if not rows:
            return None
        block = np.stack(rows)
        good = self._good(block)
        if good:
            self._see(block[:good], record=True, now=False)
        return self._not_finite(block[good], "the next step") if good < len(block) else None

    def finish(self, row: Vector, step: int) -> Breakdown | None:
        """See the final state; it has a row unless it has one already, or rows are at times."""
        if step == self.step and row[0] == self.last[0]:
            return None
        if not self._good(row[np.newaxis]):
            return self._not_finite(row, f"step {step}")
        now = row[0] == self._plan.time(step)
        self._see(row[np.newaxis], record=self._plan.times is None, now=now)
        self.step = step
        return None

    def stop_at(self, row: Vector, step: int) -> None:
        """See the last good state; where rows are at times, one inside the next step is later."""
        if self._plan.times is None or not self.rows:
            self.keep(row[np.newaxis], np.array([step]))
        self.step = step

    def at_least_one_row(self) -> None:
        """A trajectory without rows would be none: where no time was reached, the last state."""
        if not self.rows:
            self._recorder.append(self.last[np.newaxis])
            self.rows += 1

    def _see(self, rows: Rows, *, record: bool, now: bool = True) -> None:
        """`now`: the last row is the state now, which a wide scalar has in more digits."""
        self.last = rows[-1].copy()
        if not self._live.description.is_wide:
            self.conserved.see(rows)
        elif not now:
            self.exact_last = tuple(map(Fraction, self.last.tolist()))
        elif (exact := self._live.observe_exactly()) is not None:
            self.conserved.see_exactly(exact)
            self.exact_last = exact
        if record:
            self._recorder.append(rows)
            self.rows += len(rows)

    @staticmethod
    def _good(rows: Rows) -> int:
        """How many rows come before the first that is not finite."""
        finite = np.isfinite(rows).all(axis=1)
        return len(rows) if finite.all() else int(np.argmin(finite))

    def _not_finite(self, row: Vector, where: str) -> Breakdown:
        name = self._columns[int(np.argmin(np.isfinite(row)))].name
        return Breakdown(
            "not_finite",
            self._plan.time(self.step),
            self._plan.step,
            name,
            f"{name} became non-finite between step {self.step} and {where} "
            f"(t = {row[0]:.6g} s). {_advice(self._plan)}",
        )


def _next_chunk(asked: int, spent: float) -> int:
    fitting = asked * _CHUNK_S / spent
    return max(1, int(min(fitting, asked * _LARGEST_GROWTH)))


def _advice(plan: Plan) -> str:
    if plan.tolerance is not None:
        return "Try another tolerance or an earlier end."
    return f"Try a shorter step than {abs(plan.step):.6g} s."
