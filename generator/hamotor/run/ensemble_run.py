"""Ensembles from Python: a scene and a number of members in, statistics and states out."""

from __future__ import annotations

import json
import math
import operator
import os
import time
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hamotor.errors import NumericsError, UsageError, suggest
from hamotor.run.choice import choose_method
from hamotor.run.dataset import (
    FAILURES,
    MEMBERS,
    REPORT,
    STATES,
    STATISTICS,
    RunFolder,
    is_run,
    read_trajectory,
)
from hamotor.run.ensemble import Job, Meter, Part, Tally, refuse_impossible, run_parts
from hamotor.run.ensemble_files import EnsembleFiles, failures_of, read_table, states_table
from hamotor.run.ensemble_report import EnsembleOrigin, ensemble_report, ensemble_summary
from hamotor.run.library import Description, Rows
from hamotor.run.progress import NoProgress, PrintedProgress, Progress
from hamotor.run.random_numbers import MOST_SEEDS
from hamotor.run.report import Report, to_json
from hamotor.run.runner import Interruption, Plan, plan, refuse_impossible_span
from hamotor.run.simulation import ROWS, Compiled, Simulation, at_interval, load
from hamotor.run.statistics import quantiles
from hamotor.scene.draws import quantile_name

if TYPE_CHECKING:
    from os import PathLike

Array = NDArray[np.float64]

ENGINES = ("local", "dask")
SCALARS = ("double", "float")
MOST_MEMBERS = 10**12
MOST_KEPT = 1000
MOST_TIMES = 1_000_000
_LISTED_FAILURES = 100


class EnsembleRun:
    """A finished, interrupted or failed run of many members.

    `report` is the content of `run.json`, `folder` where it was written (None: only in memory).
    """

    def __init__(
        self,
        report: Report,
        *,
        folder: Path | None = None,
        statistics: Mapping[str, NDArray[Any]] | None = None,
        states: Rows | None = None,
        failures: Mapping[str, NDArray[Any]] | None = None,
        kept: Mapping[int, Mapping[str, Array]] | None = None,
    ) -> None:
        self.report = report
        self.folder = folder
        self._statistics, self._states = statistics, states
        self._failures, self._kept = failures, kept

    @property
    def statistics(self) -> Mapping[str, NDArray[Any]]:
        """`t`, `members`, and for each column X.mean, X.sd, X.min, X.max, X.q0.5, …: shape (n,).

        `members` is how many were alive at that time.  Read from disk once.
        """
        if self._statistics is None:
            assert self.folder is not None
            self._statistics = read_table(self.folder / STATISTICS)
        return self._statistics

    @property
    def t(self) -> Array:
        """The recorded times, s, shape (n,)."""
        return self.statistics["t"]

    def mean(self, column: str) -> Array:
        """The mean over the members of a column of the trajectory, at the recorded times."""
        return self._of(column, "mean")

    def deviation(self, column: str) -> Array:
        """The standard deviation over the members, at the recorded times."""
        return self._of(column, "sd")

    def quantile(self, column: str, level: float) -> Array:
        """A quantile that the scene asks for, at the recorded times."""
        return self._of(column, quantile_name(level))

    @property
    def states(self) -> Rows:
        """The last states in the order of the members, shape (members, state_size).

        Per body the motor and the momentum; NaN in memory, and left out on disk, where an
        interruption came first.
        """
        if self._states is None:
            assert self.folder is not None
            self._states = states_table(read_table(self.folder / STATES))
        return self._states

    @property
    def failures(self) -> Mapping[str, NDArray[Any]]:
        """`member`, `t` (s, the last good time) and `reason` of those that failed."""
        if self._failures is None:
            assert self.folder is not None
            none = {"member": np.empty(0, dtype=np.int64), "t": np.empty(0), "reason": np.array([])}
            path = self.folder / FAILURES
            self._failures = read_table(path) if path.is_file() else none
        return self._failures

    def trajectory(self, member: int) -> Mapping[str, Array]:
        """The rows of a member that was kept: column → values.  UsageError for another."""
        kept = self.report["ensemble"]["kept"]
        if member not in kept:
            raise UsageError(
                f"member {member} was not kept; {', '.join(map(str, kept)) or 'none'} were. "
                "Name it in keep."
            )
        if self._kept is not None:
            return self._kept[member]
        assert self.folder is not None
        return read_trajectory(self.folder / MEMBERS / str(member))

    @property
    def status(self) -> str:
        """`finished`, `interrupted` or `failed`."""
        return str(self.report["status"])

    def summary(self) -> str:
        """A dozen lines for a person."""
        return ensemble_summary(self.report, folder=self.folder)

    def _of(self, column: str, what: str) -> Array:
        name = f"{column}.{what}"
        if name not in self.statistics:
            raise UsageError(f'no "{name}" in the statistics.{suggest(name, self.statistics)}')
        return self.statistics[name]

    def __repr__(self) -> str:
        said = self.report
        return (
            f"<hamotor.EnsembleRun {said['scene']}: {said['ensemble']['members']:,} members, "
            f"{said['method']}, to t = {said['t_end']:g} s, {said['status']}>"
        )


class EnsembleFailed(NumericsError):
    """No member reached the end, or time ran out; `run` holds what was computed until then."""

    def __init__(self, message: str, run: EnsembleRun) -> None:
        super().__init__(message)
        self.run = run


class EnsembleInterrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM ended the ensemble; `run` holds what was computed until then."""

    def __init__(self, run: EnsembleRun) -> None:
        super().__init__("interrupted")
        self.run = run


def open_ensemble(folder: str | PathLike[str]) -> EnsembleRun:
    """An ensemble that was written to disk.  Raises UsageError where there is none."""
    path = Path(folder)
    report = json.loads((path / REPORT).read_text(encoding="utf-8")) if is_run(path) else {}
    if "ensemble" not in report:
        raise UsageError(f"{path} holds no ensemble of hamotor.")
    return EnsembleRun(report, folder=path)


def run_ensemble(
    scene: str | PathLike[str] | Simulation,
    members: int | None = None,
    *,
    states: Rows | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    seed: int | None = None,
    member: int | None = None,
    keep: Sequence[int] | NDArray[np.integer[Any]] | None = None,
    threads: int | None = None,
    engine: str = "local",
    scheduler: str | None = None,
    end: float | None = None,
    step: float | None = None,
    local_tolerance: float | None = None,
    method: str | None = None,
    compensated: bool | None = None,
    every: int | None = None,
    times: Sequence[float] | None = None,
    interval: float | None = None,
    time_limit: float | None = None,
    scalar: str = "double",
    out: str | PathLike[str] | None = None,
    csv: bool = False,
    pictures: bool = True,
    progress: bool | Progress = False,
) -> EnsembleRun:
    """Integrate many members of a scene from t = 0 to `end` (s); what is not given, the scene says.

    Members start where the scene's [ensemble] draws them with `seed`, or at `states`, shape
    (members, state_size): per body the motor, body to world, and the momentum, body frame.
    `parameters` takes the place of drawn ones: by the name that the scene's [[ensemble.parameter]]
    has ("k", "2.stiffness" of the second interaction), a number for each member.
    `member` runs that one alone: it gives the bits that it has among all.  Every `every`-th step,
    at `times` or at the multiples of `interval`, which steps must reach, statistics are taken over
    the members that are alive, and the rows of those in `keep` are kept.  With `local_tolerance`
    (1/s) methods that choose their steps do so for each member, and `step` is how often they
    deliver the state.  Sums over steps are `compensated` or not as in `Simulation.run`.

    `threads` of this machine (all if not given); or `engine` "dask" computes on the workers of
    `scheduler` (its address; without one, processes on this machine).  No result depends on either.
    With `out` the folder then holds run.json, statistics.parquet, states/, failures.parquet,
    members/ and, with `pictures`, cloud.png; without it all is in memory.

    Raises UsageError, ToolError; EnsembleInterrupted after Ctrl-C, and EnsembleFailed where no
    member reached the end or `time_limit` (s) passed; these carry in `.run` what was computed.  A
    member that fails is no error: it is in `failures`.
    """
    simulation = scene if isinstance(scene, Simulation) else load(scene)
    members, member = _whole("members", members), _whole("member", member)
    threads, seed = _whole("threads", threads), _whole("seed", seed)
    given = None if states is None else _as_numbers("states", states)
    own = {} if parameters is None else _as_parameters(simulation, parameters)
    chosen, reason = method or simulation.method, ""
    if offered := simulation.offered_to_ensembles:
        if method is None and chosen not in offered:
            chosen = "auto"  # what the scene asks for is of its specialised form only
        chosen, reason = choose_method(chosen, offered, None, simulation.structure)
    if scalar not in SCALARS:
        raise UsageError(f"ensembles are stepped in {' and '.join(SCALARS)}, not {scalar}.")
    if engine not in ENGINES:
        raise UsageError(
            f'unknown engine "{engine}"; there is {", ".join(ENGINES)}.{suggest(engine, ENGINES)}'
        )
    if scheduler is not None and engine != "dask":
        raise UsageError("a scheduler is for the engine dask.")
    if csv and out is None:
        raise UsageError("csv needs out: the folder to write statistics.csv into.")
    first, count = _range(simulation, members, member, given, own)
    kept = simulation.ensemble.keep if keep is None else _whole_numbers("keep", keep)
    if member is not None:
        kept = (member,)
    _check_kept(kept, first, count, whole=keep is not None)
    seed = simulation.ensemble.seed if seed is None else seed
    if not 0 <= seed < MOST_SEEDS:
        raise UsageError(f"a seed is a whole number from 0 and below 2^64, not {seed}.")
    if method is None and local_tolerance is None:
        local_tolerance = simulation.local_tolerance
    elif local_tolerance is not None and step is None:
        step = abs(simulation.end if end is None else end) / ROWS
    planned, recorded = _planned(
        simulation, chosen, end, step, local_tolerance, every, times, interval
    )
    threads = _cores() if threads is None else threads
    if threads < 1:
        raise UsageError(f"threads must be at least 1, not {threads}.")
    folder = None if out is None else RunFolder(out)
    shown = _progress(progress)
    if simulation.has_events:
        raise UsageError(
            f"{simulation.name}: has events, which ensembles do not find; remove them."
        )
    compiled = simulation.compile(
        scalar=scalar,
        method=chosen if simulation.methods else None,
        compensated=simulation.compensated if compensated is None else compensated,
        ensembles=True,
        progress=shown,
    )
    description = compiled.description
    if not simulation.methods:
        chosen, reason = choose_method(chosen, description.methods)
    if local_tolerance is not None and chosen not in description.error_controlled:
        raise UsageError(f"{chosen} does not choose its steps, so it has no local tolerance.")
    if description.ensemble is None:
        raise UsageError(f"{simulation.name}: scenes of its kind are not stepped as ensembles.")
    job = Job(
        source=compiled.source,
        scalar=scalar,
        method=chosen,
        step=planned.step,
        recorded=recorded,
        ensemble=simulation.ensemble,
        own=tuple(map(float, simulation.state)),
        seed=seed,
        first=first,
        members=count,
        keep=tuple(k for k in kept if first <= k < first + count),
        tolerance=local_tolerance,
        states=given,
        parameters=_columns(simulation, count, own),
    )
    refuse_impossible(compiled.library, job)
    deadline = math.inf if time_limit is None else time.perf_counter() + time_limit
    began = time.perf_counter()
    try:
        with Interruption() as interruption:
            meter = Meter(lambda: interruption.asked or time.perf_counter() > deadline)
            shown.begin("", count * job.steps)
            gathered = _Gathered(job, description, folder)
            parts = _parts(compiled, job, gathered, engine, scheduler, threads, meter, shown)
            try:
                # Where a part cannot be written nobody goes on with the others.
                with closing(parts):
                    for part in parts:
                        gathered.append(part)
            finally:
                shown.end()
            run = gathered.result(
                _origin(simulation, compiled, planned, reason, engine, threads, job),
                interrupted=interruption.asked,
                wall_s=time.perf_counter() - began,
                csv=csv,
            )
    except BaseException:
        if folder is not None:
            folder.abandon()
        raise
    if run.folder is not None and pictures and len(run.t):
        from hamotor.run.ensemble_pictures import draw_ensemble
        from hamotor.run.pictures import save

        columns = [column.name for column in description.columns[1:]]
        # Of an interrupted run there are statistics at the first times only.
        sample = gathered.total.sample[:, : len(run.t)]
        save(draw_ensemble(run.report, run.statistics, sample, columns), run.folder)
    if run.status == "interrupted":
        raise EnsembleInterrupted(run)
    if run.status == "failed":
        raise EnsembleFailed(f"{simulation.name}: {run.report['problem']}", run)
    return run


def _parts(
    compiled: Compiled,
    job: Job,
    gathered: _Gathered,
    engine: str,
    scheduler: str | None,
    threads: int,
    meter: Meter,
    shown: Progress,
) -> Generator[Part, None, None]:
    def tick() -> None:
        shown.advance(meter.steps, meter.seconds)

    if engine == "local":
        return run_parts(compiled.library, job, threads, meter, tick, gathered.states)
    from hamotor.run.cluster import run_parts_on

    folder = None if gathered.folder is None else gathered.folder.path
    return run_parts_on(job, folder, scheduler, threads, meter, tick)


def _origin(
    simulation: Simulation,
    compiled: Compiled,
    planned: Plan,
    reason: str,
    engine: str,
    threads: int,
    job: Job,
) -> EnsembleOrigin:
    from hamotor import __version__

    return EnsembleOrigin(
        scene=simulation.name,
        spec_hash=simulation.spec_hash,
        version=__version__,
        method_reason=reason,
        generate_s=compiled.generate_s,
        build=compiled.build,
        description=compiled.description,
        plan=planned,
        job=job,
        engine=engine,
        threads=threads,
    )


class _Gathered:
    """What the parts were, in order: on disk as they come, or in memory."""

    def __init__(self, job: Job, description: Description, folder: RunFolder | None) -> None:
        self.job, self.description, self.folder = job, description, folder
        self.total = Tally.none(job, description)
        self.completed = self.failed = self.begun = 0
        self.reasons = np.zeros(len(_reason_names()), dtype=np.int64)
        self.failures: list[dict[str, NDArray[Any]]] = []
        self.states: Rows | None = None
        self.kept: list[int] = []
        self._staging = self._files = None
        if folder is None:
            try:
                self.states = np.full((job.members, description.state_size), np.nan)
            except MemoryError:
                raise UsageError(
                    f"there is no memory for the last states of {job.members:,} members. Give "
                    "out=DIR to have them on disk."
                ) from None
        else:
            self._staging = folder.new_staging()
            self._files = EnsembleFiles(self._staging, job, description)

    def append(self, part: Part) -> None:
        """Take the next part."""
        failed = part.reasons != 0
        self.begun += int((part.steps >= 0).sum())
        self.completed += int(((part.steps == self.job.steps) & ~failed).sum())
        self.failed += int(failed.sum())
        self.reasons += np.bincount(part.reasons, minlength=len(self.reasons))
        found = failures_of(part, self.job.step)
        listed = sum(len(x["member"]) for x in self.failures)
        if self._files is None:
            assert self.states is not None
            begin = part.first - self.job.first
            ours = self.states[begin : begin + len(part.states)]
            if ours.ctypes.data != part.states.ctypes.data:
                ours[:] = part.states
            self.failures.append(found)
        else:
            self._files.append(part)
            if listed < _LISTED_FAILURES:
                self.failures.append({k: x[:_LISTED_FAILURES] for k, x in found.items()})
        self.kept += sorted(part.tally.kept)
        self.total.merge(part.tally)
        if self._files is not None:
            self.total.kept.clear()

    def result(
        self, origin: EnsembleOrigin, *, interrupted: bool, wall_s: float, csv: bool
    ) -> EnsembleRun:
        """The run, written and published if it has a folder."""
        job, total = self.job, self.total
        everyone = self.completed + self.failed == job.members
        status, problem = "finished", ""
        if not everyone:
            status = "interrupted" if interrupted else "failed"
            problem = f"the time limit passed; {self.completed:,} members were done." * (
                not interrupted
            )
        elif self.failed == job.members:
            status, problem = "failed", "every member failed."
        statistics = self._statistics()
        failures = {
            name: np.concatenate([found[name] for found in self.failures])
            if self.failures
            else np.empty(0)
            for name in ("member", "t", "reason")
        }
        said = ensemble_report(
            origin,
            status=status,
            problem=problem,
            counts={"begun": self.begun, "completed": self.completed, "failed": self.failed},
            reasons=dict(zip(_reason_names(), self.reasons.tolist(), strict=True)),
            failures={name: values[:_LISTED_FAILURES] for name, values in failures.items()},
            statistics=statistics,
            total=total,
            kept=self.kept,
            wall_s=wall_s,
        )
        if self._files is None:
            names = [column.name for column in self.description.columns]
            kept = {
                member: dict(zip(names, np.ascontiguousarray(rows.T), strict=True))
                for member, rows in total.kept.items()
            }
            return EnsembleRun(
                said, statistics=statistics, states=self.states, failures=failures, kept=kept
            )
        assert self.folder is not None
        assert self._staging is not None
        self._files.close()
        self._files.write_statistics(statistics, csv=csv)
        self.folder.publish(self._staging, to_json(said))
        return EnsembleRun(said, folder=self.folder.path, statistics=statistics)

    def _statistics(self) -> dict[str, NDArray[Any]]:
        job, moments = self.job, self.total.moments
        there = moments.count > 0
        levels = job.ensemble.quantiles if len(self.total.sample) else ()
        sampled = quantiles(self.total.sample.transpose(1, 0, 2), levels)
        found: dict[str, NDArray[Any]] = {
            "t": (job.step * np.array(job.recorded) + 0.0)[there],
            "members": moments.count[there],
        }
        deviation = moments.deviation
        for k, column in enumerate(self.description.columns[1:]):
            found[f"{column.name}.mean"] = moments.mean[there, k]
            found[f"{column.name}.sd"] = deviation[there, k]
            found[f"{column.name}.min"] = moments.low[there, k]
            found[f"{column.name}.max"] = moments.high[there, k]
            for level, values in zip(levels, sampled, strict=True):
                found[f"{column.name}.{quantile_name(level)}"] = values[there, k]
        return found


def _reason_names() -> list[str]:
    from hamotor.run.library import Failure

    return [reason.name.lower() for reason in Failure]


def _whole(name: str, value: object) -> Any:
    """A whole number, of NumPy too, as Python's; None stays.  UsageError for anything else."""
    if value is None:
        return None
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise UsageError(f"{name} must be a whole number, not {value!r}.") from None


def _whole_numbers(name: str, values: object) -> tuple[int, ...]:
    """Different ones in order."""
    if not isinstance(values, Iterable):
        raise UsageError(f"{name} must be a list of whole numbers, not {values!r}.")
    return tuple(sorted({_whole(f"{name}: each", value) for value in values}))


def _as_numbers(name: str, values: object) -> Array:
    """Real numbers as doubles, not copied where they are.  UsageError for what is none."""
    try:
        found = np.asarray(values)
        if found.dtype.kind not in "biufO":
            raise TypeError(f"their type is {found.dtype}")
        return np.asarray(found, dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise UsageError(f"{name} must be an array of real numbers: {problem}.") from None


def _as_parameters(simulation: Simulation, given: object) -> dict[str, Array]:
    """A finite number for each member, by the parameter's name."""
    if not isinstance(given, Mapping):
        raise UsageError('parameters must be given by name: {"k": a number for each member}.')
    names = [parameter.name for parameter in simulation.ensemble.parameters]
    found = {}
    for name, values in given.items():
        if name not in names:
            known = f"there is {', '.join(names)}" if names else "the scene has none"
            raise UsageError(
                f'parameters: no [[ensemble.parameter]] is called "{name}"; {known}.'
                f"{suggest(name, names)}"
            )
        what = f'parameters["{name}"]'
        numbers = _as_numbers(what, values)
        if numbers.ndim != 1:
            raise UsageError(f"{what} must be a number for each member, not {numbers.shape}.")
        if not np.isfinite(numbers).all():
            member = int(np.argmin(np.isfinite(numbers)))
            raise UsageError(f"{what} of member {member} is not finite: {numbers[member]}.")
        found[name] = numbers
    return found


def _columns(simulation: Simulation, members: int, given: Mapping[str, Array]) -> Rows | None:
    """Parameters, shape (members, parameters): NaN where they are not given; None for none."""
    if not given:
        return None
    undrawn = np.full(members, np.nan)
    names = [parameter.name for parameter in simulation.ensemble.parameters]
    return np.column_stack([given.get(name, undrawn) for name in names])


def _range(
    simulation: Simulation,
    members: int | None,
    member: int | None,
    states: Rows | None,
    parameters: Mapping[str, Array],
) -> tuple[int, int]:
    """First member and how many."""
    lengths = {f'parameters["{name}"]': len(x) for name, x in parameters.items()}
    if states is not None:
        shape = states.shape
        if len(shape) != 2 or shape[1] != len(simulation.state) or not shape[0]:
            raise UsageError(
                f"states must have shape (members, {len(simulation.state)}), not {shape}: "
                "per body the motor and the momentum."
            )
        lengths["states"] = shape[0]
    for name, count in lengths.items():
        if members not in {None, count}:
            raise UsageError(f"{members} members, but {name} of {count}; leave members out.")
        members = count
    if lengths:
        if member is not None:
            raise UsageError(
                f"with {' and '.join(lengths)} of your own, run one member by giving its alone."
            )
    elif not (simulation.ensemble.bodies or simulation.ensemble.parameters):
        raise UsageError(
            f"{simulation.name}: all members would be the same; say in [[ensemble.body]] or "
            "[[ensemble.parameter]] what differs, or give states."
        )
    if members is None or not 1 <= members <= MOST_MEMBERS:
        raise UsageError(f"members must be a whole number from 1 to {MOST_MEMBERS:.0e}.")
    if member is None:
        return 0, members
    if not 0 <= member < members:
        raise UsageError(f"there is no member {member}: they are 0 to {members - 1}.")
    return member, 1


def _check_kept(kept: Sequence[int], first: int, members: int, *, whole: bool) -> None:
    if len(kept) > MOST_KEPT:
        raise UsageError(f"at most {MOST_KEPT} members' trajectories are kept, not {len(kept)}.")
    for k in kept if whole else ():
        if not first <= k < first + members:
            raise UsageError(f"cannot keep member {k}: they are {first} to {first + members - 1}.")


def _planned(
    simulation: Simulation,
    method: str,
    end: float | None,
    step: float | None,
    tolerance: float | None,
    every: int | None,
    times: Sequence[float] | None,
    interval: float | None,
) -> tuple[Plan, tuple[int, ...]]:
    """How far and how finely, and after which steps members are observed."""
    if sum(x is not None for x in (every, times, interval)) > 1:
        raise UsageError("give one of every, times and interval: when to record.")
    end = simulation.end if end is None else end
    step = simulation.step if step is None else step
    if step is None:
        raise UsageError(
            f"{simulation.name}: has a tolerance of the final state, which is verified for single "
            "runs only; give a step or a local tolerance."
        )
    refuse_impossible_span(end, step)
    if every is None and times is None and interval is None:
        every, interval = simulation.every, simulation.interval
        if simulation.times is not None:
            times = [x for x in simulation.times if 0 <= x / end <= 1] or None
    if interval is not None:
        times, every = at_interval(interval, end, step)
    every = 1 if every is None else every
    planned = plan(method, end=end, step=step, every=every, times=times, tolerance=tolerance)
    if planned.times is None:
        if planned.steps // planned.every > MOST_TIMES:
            raise UsageError(
                f"statistics at {planned.steps // planned.every:,} times are too many; record "
                f"every {-(-planned.steps // MOST_TIMES):,} steps or more rarely, with --every."
            )
        found = {*range(0, planned.steps + 1, planned.every)}
    else:
        nearest = np.rint(planned.times / planned.step).astype(np.int64)
        off = np.abs(planned.times - planned.step * nearest)
        if (off > 1e-9 * abs(planned.step) + 1e-12 * np.abs(planned.times)).any():
            time_ = float(planned.times[int(np.argmax(off))])
            raise UsageError(
                f"an ensemble is observed between steps, and none of {planned.step:g} s ends at "
                f"t = {time_:g} s; record at multiples of the step."
            )
        found = {*nearest.tolist()}
    return planned, tuple(sorted(found | {0, planned.steps}))


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _progress(wanted: bool | Progress) -> Progress:
    if isinstance(wanted, bool):
        return PrintedProgress() if wanted else NoProgress()
    return wanted
