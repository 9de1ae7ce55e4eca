"""A global error target: runs of ever smaller error until two of them agree.

The error of a run is estimated by one of half the step, or, with a method that chooses its steps,
of a sixteenth of the local tolerance.  The order of the method says where to go from there.  Where
such a method's steps are as exact as its numbers, a smaller tolerance gives the same run again,
which verifies nothing: then one from a start some roundings away says what rounding does.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from hamotor.errors import UsageError
from hamotor.run.library import Description, SceneLibrary, Vector
from hamotor.run.progress import Progress
from hamotor.run.runner import (
    Breakdown,
    Interruption,
    Ladder,
    Outcome,
    Plan,
    Recorder,
    Rung,
    Status,
    integrate,
    plan,
)

_MOST_RUNGS = 32
_ROWS = 2000
_TOGETHER = 0.01  # below this difference the runs have begun to converge
_STALLED_RUNGS = 3
_PATIENCE = 14
_FIRST_TURN = 0.25  # a first guess turns the motor by at most a quarter of a radian in a step
_CONSTANT = 100.0  # a step's error is thought to be (turn in the step)^(order + 1) over this
_AIM = 0.3  # of the tolerance: a guess by the order should not fail by a little
_LARGEST_LEAP = 1024.0
_ORDER_OF_EXACT = 16  # whatever: its runs agree at once
_OFF_ORDER = 30.0
_REACHABLE = 1e-13  # what lies below is asked of rounding, not of a method
_CAUTION = (
    0.75  # a first guess that is too coarse costs little, one that is too fine may cost hours
)
_MOST_STEPS = 1e15


def meet_tolerance(
    library: SceneLibrary,
    state: Sequence[float | Fraction] | Vector,
    *,
    method: str,
    end: float,
    tolerance: float,
    every: int | None,
    new_recorder: Callable[[], Recorder],
    times: Sequence[float] | Vector | None = None,
    progress: Progress | None = None,
    interruption: Interruption | None = None,
    deadline: float = math.inf,
) -> tuple[Outcome, Recorder]:
    """Run until the final states of two runs differ by at most `tolerance`.

    The second has half the step of the first or less; where the method chooses its steps, at most a
    sixteenth of its local tolerance.  The difference is the largest over all bodies of |ΔM| (any
    component, the sign of M fixed) and |Δμ| over the norm of the initial momentum.  The finer run
    of the last pair is returned with its recorder; the others are discarded.

    Where a smaller local tolerance changes nothing, the second starts some roundings away.

    Status "failed" with the reason in `problem` when rounding, chaos, the number of runs or
    `deadline` (of `time.perf_counter`) comes first.  A run that the time left would not suffice for
    is not begun.  `every` None keeps about two thousand rows, unless there are `times`.
    """
    if not (math.isfinite(tolerance) and tolerance > 0):
        raise UsageError(f"tolerance must be a positive number, not {tolerance!r}.")
    plan(method, end=end, step=end, every=1 if every is None else every, times=times)
    climb = _Climb(library, state, method, end, tolerance, every, times)
    interruption = Interruption() if interruption is None else interruption
    status: Status = "failed"
    while climb.reason == "":
        if climb.too_late(deadline):
            break
        recorder = new_recorder()
        outcome = integrate(
            library,
            climb.start,
            climb.plan,
            recorder,
            progress=progress,
            interruption=interruption,
            stage=climb.stage,
            deadline=deadline,
        )
        ended = climb.see(outcome, recorder)
        if ended is not None:
            status = ended
            break
    return climb.result(status)


class _Climb:
    """The rungs so far, the best whole run among them, and what comes next.

    A rung is set by one number, `knob`: the step or, where the method chooses steps, its local
    tolerance.  The error is expected to go as knob^order; `check` is what the knob is divided by
    to verify a run.
    """

    def __init__(
        self,
        library: SceneLibrary,
        state: Sequence[float | Fraction] | Vector,
        method: str,
        end: float,
        tolerance: float,
        every: int | None,
        times: Sequence[float] | Vector | None,
    ) -> None:
        description = library.description
        self.description = description
        self.method, self.end, self.target = method, end, tolerance
        self.every, self.times = every, times
        self.start = state
        self.nudged = False
        self.controlled = method in description.error_controlled
        order = description.methods[method] or _ORDER_OF_EXACT
        self.order = 1.0 if self.controlled else float(order)
        self.check = 16.0 if self.controlled else 2.0
        if self.controlled:
            self.knob = max(tolerance, _REACHABLE) / (10 * abs(end))
        else:
            self.knob = first_step(
                library, state, method=method, end=end, order=order, tolerance=tolerance
            )
        self.coarser = self.knob
        self.pair: tuple[float, float] | None = None
        self.off_order = False
        self.rungs: list[Rung] = []
        self.best: tuple[Outcome, Recorder] | None = None
        self.achieved: float | None = None
        self.reason = ""
        self.plan = self._planned()

    def _planned(self) -> Plan:
        step = abs(self.end) / _ROWS if self.controlled else self.knob
        tolerance = self.knob if self.controlled else None
        planned = plan(self.method, end=self.end, step=step, times=self.times, tolerance=tolerance)
        every = max(1, planned.steps // _ROWS) if self.every is None else self.every
        return replace(planned, every=every)

    @property
    def stage(self) -> str:
        """The next rung, for people."""
        if self.nudged:
            return "from a start some roundings away"
        if self.controlled:
            return f"local tolerance {self.knob:.3g}"
        return f"step {abs(self.plan.step):.3g} s"

    def too_late(self, deadline: float) -> bool:
        """Whether the next run would, by the last one's pace, not end in time."""
        if not self.rungs or self.best is None:
            return False
        pace = self.rungs[-1].integrate_s / max(self.best[0].own_steps, 1)
        expected = pace * self.plan.steps
        if self.controlled:
            expected = self.rungs[-1].integrate_s
        left = deadline - time.perf_counter()
        if expected <= left:
            return False
        self.reason = (
            f"the time limit: the next run would take about {expected:.2g} s, "
            f"and {max(left, 0.0):.2g} s are left."
        )
        return True

    def see(self, outcome: Outcome, recorder: Recorder) -> Status | None:
        """Take a run; its status if the climb is over with it."""
        difference = None
        if self.best is not None and self.best[0].status == outcome.status == "finished":
            difference = state_difference(self.description, self.best[0], outcome)
        self.rungs.append(
            Rung(
                self.plan.step,
                outcome.own_steps if self.controlled else self.plan.steps,
                difference,
                outcome.status,
                outcome.integrate_s,
                self.plan.tolerance,
            )
        )
        why = outcome.breakdown.reason if outcome.breakdown else ""
        late = why == "time_limit"
        too_fine = why == "step_too_short"
        if self.best is not None and (
            self.nudged or late or too_fine or outcome.status == "interrupted"
        ):
            # A whole run with a longer step says more than a part of the next one.
            recorder.discard()
        else:
            if self.best is not None:
                self.best[1].discard()
            self.best = outcome, recorder
        self.achieved = difference if outcome.status == "finished" else self.achieved
        if outcome.status == "interrupted":
            return "interrupted"
        if difference == 0 and self._same_steps() and not self.nudged:
            self.start, self.nudged = _nudged(self.start, self.description.digits), True
            return None
        if difference is not None and difference <= self.target:
            return "finished"
        if late:
            self.reason = "the time limit passed."
        elif too_fine:
            self.reason = outcome.problem
        elif self.nudged and difference is not None:
            self.reason = (
                "shorter steps change nothing any more, and a start some roundings away ends "
                f"{difference:.2g} away. The motion amplifies rounding errors: ask for no less, "
                "end it earlier, or take a scalar of more digits."
            )
        else:
            self.reason = _hopeless(self.rungs)
        if not self.reason:
            self._turn_down(difference)
        return "failed" if self.reason else None

    def _same_steps(self) -> bool:
        """Whether the last two runs took the same steps, however different what was asked."""
        return self.controlled and self.rungs[-1].steps == self.rungs[-2].steps

    def _turn_down(self, difference: float | None) -> None:
        """Set the next rung: a check of the last one, or as far as the order says it is to go."""
        last = self.knob if self.controlled else abs(self.plan.step)
        self.knob = last / self.check
        if difference is not None and difference < _TOGETHER and self._follows_order(difference):
            # The difference is the error of the coarser of the two.
            fall = _AIM * max(self.target, _REACHABLE) / difference
            wanted = self.coarser * fall ** (1 / self.order)
            if wanted < last:
                self.knob = min(self.knob, max(wanted, last / _LARGEST_LEAP))
        self.coarser = last
        if len(self.rungs) >= _MOST_RUNGS:
            self.reason = f"{_MOST_RUNGS} runs were not enough."
        elif not self.controlled and abs(self.end) / self.knob >= _MOST_STEPS:
            self.reason = "the number of steps would grow without bound."
        else:
            self.plan = self._planned()

    def _follows_order(self, difference: float) -> bool:
        """Whether errors have fallen as the order says; rounding does not."""
        expected = math.inf
        if self.pair is not None:
            coarser, before = self.pair
            expected = before * (self.coarser / coarser) ** self.order
        self.pair = self.coarser, difference
        self.off_order |= difference > _OFF_ORDER * expected
        return not self.off_order

    def result(self, status: Status) -> tuple[Outcome, Recorder]:
        """The best whole run, with what is to be said about it."""
        assert self.best is not None
        outcome, recorder = self.best
        problem, breakdown = "", outcome.breakdown
        if status == "failed":
            problem = f"the tolerance {self.target:g} was not met: {self.reason}"
            if self.achieved is not None:
                problem += f" The last two whole runs differ by {self.achieved:.2g}."
            if outcome.problem:
                problem += f" In the last run {outcome.problem}"
            breakdown = breakdown or Breakdown(
                "tolerance", float(outcome.final[0]), outcome.plan.step, "", problem
            )
        ladder = Ladder(self.target, self.achieved, tuple(self.rungs))
        return (
            replace(outcome, status=status, problem=problem, breakdown=breakdown, ladder=ladder),
            recorder,
        )


def _nudged(state: Sequence[float | Fraction] | Vector, digits: int) -> Sequence[float | Fraction]:
    """A state some roundings away: as far as they may bring it in a hundred steps."""
    relative = Fraction(1, 10 ** (digits - 2))
    moved = [Fraction(x) * (1 + (-1) ** k * relative) for k, x in enumerate(state)]
    return [type(x)(y) for x, y in zip(state, moved, strict=True)]


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
            f"after {len(rungs)} runs, each finer than the last, they still end in different "
            "places. "
            "The motion is chaotic over this time: end it earlier."
        )
    if differences.index(best) >= len(differences) - _STALLED_RUNGS:
        return ""
    return (
        f"the runs came within {best:.2g} of each other and not closer. The motion amplifies "
        "rounding errors to that size: ask for no less, or end it earlier."
    )


def first_step(
    library: SceneLibrary,
    state: Sequence[float | Fraction] | Vector,
    *,
    method: str,
    end: float,
    order: int,
    tolerance: float,
) -> float:
    """A step to begin a ladder with, seconds: from how fast the initial state changes.

    One very short step gives the fastest rate ω of a motor or a momentum relative to its size; with
    an error of (h ω)^(order + 1) / 100 of that a step tolerance^¾ would just be met, the tolerance
    relative to the largest motor.  Between 1/256 and a quarter of 1/ω, and at least 16 steps.
    """
    description = library.description
    start = np.asarray(state, dtype=np.float64)
    longest = abs(end) / 16
    probe = end * 2.0**-20
    with library.start(method, step=probe, state=start) as live:
        if live.advance(1, 1, None) < 1:
            return longest
        rates = np.abs(live.state() - start) / abs(probe)
    omega, largest = 0.0, 1.0
    motors, momenta = len(description.motor), len(description.momentum)
    for body in range(len(description.bodies)):
        at = body * (motors + momenta)
        motor, momentum = slice(at, at + motors), slice(at + motors, at + motors + momenta)
        largest = max(largest, float(np.linalg.norm(start[motor])))
        for part in motor, momentum:
            size = float(np.linalg.norm(start[part]))
            if size > 0:
                omega = max(omega, float(rates[part].max()) / size)
    if omega == 0:
        return longest
    aim = max(tolerance / largest, _REACHABLE) ** _CAUTION
    turn: float = (_CONSTANT * aim / max(omega * abs(end), 1.0)) ** (1 / order)
    return min(longest, min(_FIRST_TURN, max(turn, _FIRST_TURN / 64)) / omega)


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
