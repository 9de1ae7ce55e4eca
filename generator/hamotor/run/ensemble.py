"""Stepping an ensemble: members in chunks, chunks in parts, the same ones whoever computes them.

A chunk (4096 members) is what one thread steps at a time and what statistics are summed over; a
part (65,536) is what is written at a time, and what another process or machine computes.  Both
begin at multiples of their size, and all merging goes in the order of the members, so that the bits
of every result are the same for any number of threads and any engine.  Memory holds the parts that
keep the threads busy and one more, whatever the number of members.
"""

from __future__ import annotations

import hashlib
import json
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hamotor import __version__
from hamotor.errors import UsageError
from hamotor.run.library import Description, Failure, LiveEnsemble, Rows, SceneLibrary, Vector
from hamotor.run.runner import scales
from hamotor.run.sampling import starts
from hamotor.run.statistics import Moments, Worst, as_arrays
from hamotor.scene.draws import Ensemble

CHUNK = 4096
PART = 16 * CHUNK
NOT_BEGUN = -1
"""Steps of a member that nobody came to."""

_STRETCH_S = 0.1
_FIRST_STEPS = 16
_MOST_SAMPLED = 1 << 23
"""Numbers kept for quantiles: 64 MiB."""
DRAWN = 2000
"""Members kept for the picture where no quantiles are asked for."""
_MOST_STATISTICS = 1 << 22


OWN = ("states", "parameters")
"""What a `Job` has of the user's own, an array each."""


@dataclass(frozen=True)
class Job:
    """All that decides the numbers of an ensemble."""

    source: str
    """The scene's C++ text."""
    scalar: str
    method: str
    step: float
    recorded: tuple[int, ...]
    """After which steps members are observed, from 0 to the last."""
    ensemble: Ensemble
    own: tuple[float, ...]
    """The scene's own state."""
    seed: int
    first: int
    members: int
    keep: tuple[int, ...]
    """Members whose rows are kept."""
    tolerance: float | None = None
    """The local error per second of a method that chooses its steps, member by member."""
    states: Rows | None = field(default=None, compare=False)
    """States of the user's own, shape (members, state_size), in place of drawn ones."""
    parameters: Rows | None = field(default=None, compare=False)
    """The same of parameters, shape (members, parameters); columns that are drawn are NaN."""

    @property
    def parts(self) -> int:
        """How many parts there are."""
        return -(-self.members // PART)

    def range_of(self, part: int) -> tuple[int, int]:
        """First member of a part and how many it has."""
        first = part * PART
        return self.first + first, min(PART, self.members - first)

    def starts(self, first: int, members: int) -> tuple[Rows, Rows | None]:
        """The states at which these members start, and their parameters: None for the scene's."""
        mine = slice(first - self.first, first - self.first + members)
        own = None if self.parameters is None else self.parameters[mine]
        if self.states is not None and not self.draws_parameters:
            return self.states[mine], own
        states, parameters = starts(self.ensemble, np.array(self.own), self.seed, first, members)
        if self.states is not None:
            states = self.states[mine]
        if own is not None:
            parameters = np.where(np.isnan(own), parameters, own)
        return states, parameters if self.ensemble.parameters else None

    @property
    def draws_parameters(self) -> bool:
        """Whether some are not given."""
        own = self.parameters
        return bool(self.ensemble.parameters) and (own is None or bool(np.isnan(own[0]).any()))

    @property
    def is_drawn(self) -> bool:
        """Whether anything is drawn: a seed then counts."""
        return self.draws_parameters or (self.states is None and bool(self.ensemble.bodies))

    def sampled(self, columns: int) -> int:
        """How many members, from the first, quantiles and the picture are of."""
        wanted = PART if self.ensemble.quantiles else DRAWN
        return min(self.members, wanted, _MOST_SAMPLED // (len(self.recorded) * columns))

    @property
    def steps(self) -> int:
        """Of every member."""
        return self.recorded[-1]

    def to_json(self) -> dict[str, Any]:
        """As plain values; what is of the user's own by its digest."""
        said = {name: getattr(self, name) for name in self.__dataclass_fields__}
        said["ensemble"] = asdict(self.ensemble)
        for name in OWN:
            own = said.pop(name)
            if own is not None:
                said[name] = hashlib.sha256(np.ascontiguousarray(own).tobytes()).hexdigest()
        return said

    @staticmethod
    def from_json(said: Mapping[str, Any], own: Mapping[str, Rows] | None = None) -> Job:
        """What `to_json` made of one; `own`: what is of the user's own, by name."""
        plain = {name: value for name, value in said.items() if name not in OWN}
        return Job(
            **{
                **plain,
                "recorded": tuple(said["recorded"]),
                "ensemble": Ensemble.from_json(said["ensemble"]),
                "own": tuple(said["own"]),
                "keep": tuple(said["keep"]),
                **(own or {}),
            }
        )

    @property
    def key(self) -> str:
        """SHA-256 of all that decides its numbers."""
        said = [self.to_json(), __version__, CHUNK, PART]
        return hashlib.sha256(json.dumps(said).encode()).hexdigest()


@dataclass
class Tally:
    """What is known of members without a row for each: it merges in the order of members."""

    moments: Moments
    """Of the columns beside t."""
    errors: Worst
    """Of the conserved quantities, relative where there is a scale."""
    kept: dict[int, Rows] = field(default_factory=dict)
    sample: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0, 0)))
    """(members, times, columns), NaN where a member had failed."""
    member_steps: int = 0
    stepping_s: float = 0.0
    """Of processors."""

    @staticmethod
    def none(job: Job, description: Description) -> Tally:
        """Of no member."""
        times, columns = len(job.recorded), len(description.columns) - 1
        return Tally(
            Moments.none(times, columns),
            Worst.none(len(description.conserved)),
            sample=np.empty((0, times, columns)),
        )

    def merge(self, other: Tally) -> None:
        """Add members that come after these."""
        self.moments.merge(other.moments)
        self.errors.merge(other.errors)
        self.kept |= other.kept
        if len(other.sample):
            self.sample = np.concatenate([self.sample, other.sample])
        self.member_steps += other.member_steps
        self.stepping_s += other.stepping_s


@dataclass
class Part:
    """A range of members after their last step."""

    first: int
    states: Rows
    """(members, state_size), the last good one of each."""
    steps: NDArray[np.int64]
    """That each took; `NOT_BEGUN` for those that nobody came to."""
    reasons: NDArray[np.int32]
    """Why each stopped: a `Failure`."""
    tally: Tally

    def complete(self, job: Job) -> bool:
        """Whether every member went to the end, or failed."""
        return bool(((self.steps == job.steps) | (self.reasons != 0)).all())

    def to_arrays(self) -> dict[str, Any]:
        """By name, for `numpy.savez`."""
        tally = self.tally
        return {
            "first": self.first,
            "states": self.states,
            "steps": self.steps,
            "reasons": self.reasons,
            **as_arrays("moments", tally.moments),
            **as_arrays("errors", tally.errors),
            "sample": tally.sample,
            "work": np.array([tally.member_steps, tally.stepping_s]),
            **{f"kept.{member}": rows for member, rows in tally.kept.items()},
        }

    @staticmethod
    def from_arrays(arrays: Mapping[str, Any]) -> Part:
        """What `to_arrays` gave.  KeyError where something is missing."""

        def fields(prefix: str) -> dict[str, Any]:
            start = f"{prefix}."
            return {k.removeprefix(start): v for k, v in arrays.items() if k.startswith(start)}

        errors = fields("errors")
        tally = Tally(
            moments=Moments(**fields("moments")),
            errors=Worst(**{**errors, "count": int(errors["count"])}),
            kept={int(member): rows for member, rows in fields("kept").items()},
            sample=arrays["sample"],
            member_steps=int(arrays["work"][0]),
            stepping_s=float(arrays["work"][1]),
        )
        return Part(
            int(arrays["first"]), arrays["states"], arrays["steps"], arrays["reasons"], tally
        )


class Meter:
    """Counts the steps of all members, from any thread; and says when to stop."""

    def __init__(self, stop: Callable[[], bool] = lambda: False) -> None:
        self._lock = threading.Lock()
        self._stop = stop
        self._abandoned = False
        self.steps = 0
        self.seconds = 0.0

    @property
    def stopped(self) -> bool:
        """Whether the rest is not wanted any more."""
        return self._abandoned or self._stop()

    def abandon(self) -> None:
        """Nobody takes what is computed from now on."""
        self._abandoned = True

    def add(self, steps: int, seconds: float) -> None:
        """Steps were taken, in so many seconds of one thread."""
        with self._lock:
            self.steps += steps
            self.seconds += seconds


def refuse_impossible(library: SceneLibrary, job: Job) -> None:
    """UsageError for what an ensemble cannot be, before anything is stepped."""
    columns = len(library.description.columns)
    if len(job.recorded) * columns > _MOST_STATISTICS:
        raise UsageError(
            f"statistics of {columns} columns at {len(job.recorded):,} times are too many; record "
            f"at most {_MOST_STATISTICS // columns:,} times, with --every or --interval."
        )
    with _start(library, job, job.first, 1):
        pass


def _start(library: SceneLibrary, job: Job, first: int, members: int) -> LiveEnsemble:
    states, parameters = job.starts(first, members)
    live = library.start_ensemble(
        job.method,
        step=job.step,
        states=states,
        parameters=parameters,
        tolerance=job.tolerance,
    )
    if live is None:
        raise UsageError(f"{job.method} does not step ensembles of this scene.")
    return live


def run_chunk(library: SceneLibrary, job: Job, part: Part, first: int, meter: Meter) -> Tally:
    """Step the chunk of a part that begins with member `first`; write its states there."""
    description = library.description
    own = slice(first - part.first, min(first - part.first + CHUNK, len(part.states)))
    members = own.stop - own.start
    tally = Tally.none(job, description)
    if meter.stopped:
        return tally
    rows = np.empty((members, len(description.columns)))
    alive = np.ones(members, dtype=bool)
    sampled = min(max(job.first + job.sampled(rows.shape[1] - 1) - first, 0), members)
    sample = np.full((sampled, len(job.recorded), rows.shape[1] - 1), np.nan)
    kept: dict[int, list[Vector]] = {k: [] for k in job.keep if first <= k < first + members}
    done = 0
    stretch = _FIRST_STEPS
    with _start(library, job, first, members) as live:
        live.observe(rows)
        watch = _Watch(description, rows)
        alive &= watch.finite
        part.reasons[own][~alive] = Failure.NOT_FINITE
        part.steps[own] = 0
        for time_, target in enumerate(job.recorded):
            while done < target and not meter.stopped:
                asked = min(stretch, target - done)
                began, worked = time.perf_counter(), time.thread_time()
                going = live.advance(asked)
                worked = time.thread_time() - worked
                spent = time.perf_counter() - began
                done += asked
                tally.member_steps += asked * going
                tally.stepping_s += worked
                meter.add(asked * going, worked)
                stretch = max(1, int(min(8 * asked, asked * _STRETCH_S / max(spent, 1e-9))))
            if done < target:
                break
            live.observe(rows)
            rows[:, 0] = job.step * target
            _bury(live, rows, alive, part.reasons[own], part.steps[own], done)
            good = rows if alive.all() else rows[alive]
            tally.moments.put(time_, good[:, 1:])
            watch.see(rows, alive)
            sample[:, time_] = np.where(alive[:sampled, np.newaxis], rows[:sampled, 1:], np.nan)
            for member, trajectory in kept.items():
                if alive[member - first]:
                    trajectory.append(rows[member - first].copy())
        live.states(part.states[own])
    part.steps[own][alive] = done
    tally.errors = watch.errors(first)
    tally.sample = sample
    tally.kept = {member: np.array(found) for member, found in kept.items() if found}
    return tally


def _bury(
    live: LiveEnsemble,
    rows: Rows,
    alive: NDArray[np.bool_],
    reasons: NDArray[np.int32],
    steps: NDArray[np.int64],
    done: int,
) -> None:
    """Note which of those alive failed since the last time: by a step, or by what is observed."""
    failures, taken = live.failures()
    by_step = alive & (failures != 0)
    reasons[by_step], steps[by_step] = failures[by_step], taken[by_step]
    by_row = alive & ~by_step & ~np.isfinite(rows).all(axis=1)
    reasons[by_row], steps[by_row] = Failure.NOT_FINITE, done
    alive &= ~(by_step | by_row)


class _Watch:
    """The worst error of every conserved quantity of every member."""

    def __init__(self, description: Description, initial: Rows) -> None:
        index = description.column_index
        self.finite = np.isfinite(initial).all(axis=1)
        self._columns = [index[q.column] for q in description.conserved]
        self._initial = initial[:, self._columns].copy()
        self._largest = np.zeros_like(self._initial)
        self._scales = np.ones_like(self._initial)
        with np.errstate(invalid="ignore", over="ignore"):
            for k, quantity in enumerate(description.conserved):
                scale = scales(description, quantity, initial)
                self._scales[:, k] = np.where(scale > 0, scale, 1.0)

    def see(self, rows: Rows, alive: NDArray[np.bool_]) -> None:
        """Take these rows of the members that are alive."""
        with np.errstate(invalid="ignore", over="ignore"):
            change = np.abs(rows[:, self._columns] - self._initial)
        np.maximum(self._largest, change, out=self._largest, where=alive[:, np.newaxis])

    def errors(self, first: int) -> Worst:
        """Over all members that had a finite start."""
        members = first + np.flatnonzero(self.finite)
        return Worst.of((self._largest / self._scales)[self.finite], members)


def begin_part(job: Job, description: Description, number: int, states: Rows | None) -> Part:
    """A part with nothing computed; `states` is where its last states shall lie."""
    first, members = job.range_of(number)
    if states is None:
        states = np.full((members, description.state_size), np.nan)
    return Part(
        first,
        states,
        np.full(members, NOT_BEGUN, dtype=np.int64),
        np.zeros(members, dtype=np.int32),
        Tally.none(job, description),
    )


def chunks_of(part: Part) -> range:
    """The first members of a part's chunks."""
    return range(part.first, part.first + len(part.states), CHUNK)


def run_part(library: SceneLibrary, job: Job, number: int) -> Part:
    """A part, in this thread."""
    part = begin_part(job, library.description, number, None)
    for first in chunks_of(part):
        part.tally.merge(run_chunk(library, job, part, first, Meter()))
    return part


def run_parts(
    library: SceneLibrary,
    job: Job,
    threads: int,
    meter: Meter,
    tick: Callable[[], None],
    states: Rows | None = None,
) -> Generator[Part, None, None]:
    """The parts in order, computed by threads of this process; fewer where the meter says stop.

    `tick` is called now and then while they are waited for.  `states`, shape (members, state_size),
    is where the last states shall lie; None: in arrays of their own.  Closed before its end it
    leaves the rest at once.
    """
    with ThreadPoolExecutor(threads) as pool, _left_at_once(pool, meter):

        def submit(number: int) -> tuple[Part, list[Future[Tally]]]:
            begin = number * PART
            its_own = None if states is None else states[begin : begin + PART]
            part = begin_part(job, library.description, number, its_own)
            return part, [
                pool.submit(run_chunk, library, job, part, first, meter)
                for first in chunks_of(part)
            ]

        ahead = 1 + -(-threads // (PART // CHUNK))
        waiting = deque(submit(number) for number in range(min(ahead, job.parts)))
        number = len(waiting)
        while waiting:
            part, futures = waiting.popleft()
            for future in futures:
                while not wait([future], timeout=_STRETCH_S).done:
                    tick()
                part.tally.merge(future.result())
            tick()
            if number < job.parts and not meter.stopped:
                waiting.append(submit(number))
                number += 1
            yield part


@contextmanager
def _left_at_once(pool: ThreadPoolExecutor, meter: Meter) -> Iterator[None]:
    """What is still under way at the end of the block is not waited for to its own end."""
    try:
        yield
    finally:
        meter.abandon()
        pool.shutdown(wait=False, cancel_futures=True)


def library_of(job: Job) -> SceneLibrary:
    """The job's library, compiled on this machine or found in its cache."""
    from hamotor.run.build import compile_scene

    return SceneLibrary(compile_scene(job.source, scalar=job.scalar).library)
