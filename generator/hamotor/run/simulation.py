"""A scene ready to run: its C++ text, its initial state, and the defaults of its time table."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hamotor.errors import UsageError, suggest
from hamotor.run.build import (
    CompiledScene,
    compile_scene,
    default_cache,
    eigen,
    flags_without_packs,
)
from hamotor.run.choice import choose_method
from hamotor.run.dataset import DiskRecorder, MemoryRecorder, RunFolder
from hamotor.run.library import Description, SceneLibrary, Vector, check_method
from hamotor.run.progress import NoProgress, PrintedProgress, Progress
from hamotor.run.remembered import Remembered, key_of
from hamotor.run.report import Origin, report, to_json
from hamotor.run.result import Run, RunFailed, RunInterrupted, units_of
from hamotor.run.runner import (
    Interruption,
    Outcome,
    Recorder,
    integrate,
    plan,
    refuse_impossible_span,
)
from hamotor.run.tolerance import meet_tolerance
from hamotor.scene.draws import ALIKE, Ensemble

if TYPE_CHECKING:
    from hamotor.scene import Form, GeneralScene, Scene
    from hamotor.scene.building import BodyWords

KERNELS = ("generated", "generic", "sparse")
REPRESENTATIONS = ("ga", "matrix")

ROWS = 1000
_MOST_TIMES = 10_000_000


@dataclass(frozen=True)
class Simulation:
    """A scene that can be run.  `hamotor.load` makes one.

    `source` gives the scene's C++ text for (kernels, scalar); `state` is the initial state, per
    body motor and momentum, in the scene's body frame.  Times are in seconds.  `methods`, if given,
    are the names and orders of all that the scene offers, and only the one that is used is
    compiled.  `read` gives the scene that it was made from.
    """

    name: str
    source: Callable[..., str]
    state: Vector
    end: float
    step: float | None
    tolerance: float | None
    method: str
    every: int
    spec_hash: str
    times: tuple[float, ...] | None = None
    interval: float | None = None
    methods: Mapping[str, int] = field(default_factory=dict)
    read: Callable[[], Scene | GeneralScene] | None = None
    matrix_source: Callable[[str], str] | None = None
    """Gives the C++ text in the matrix representation, for a scalar."""
    methods_by_table: Callable[[], Mapping[str, int]] | None = None
    """Gives names and orders of the methods with products by table."""
    has_events: bool = False
    structure: str = ""
    """Its class of `hamotor.scene.structure`, for the choice of a method."""
    local_tolerance: float | None = None
    """1/s, of the scene's method, which chooses its steps."""
    compensated: bool | None = None
    """Whether sums over steps are; None: as is the method's own way."""
    exact_digits: tuple[str, ...] = ()
    """The initial state in 60 digits."""
    ensemble: Ensemble = ALIKE
    """What differs from member to member."""
    member_methods: Mapping[str, int] = field(default_factory=dict)
    """Names and orders of the methods that step members; none given: as `methods`."""

    @property
    def exact_state(self) -> tuple[Fraction, ...]:
        """The initial state in all digits that are known."""
        return tuple(map(Fraction, self.exact_digits or map(repr, map(float, self.state))))

    def compile(
        self,
        *,
        scalar: str = "double",
        kernels: str = "generated",
        representation: str = "ga",
        method: str | Sequence[str] | None = None,
        compensated: bool | None = None,
        ensembles: bool = False,
        extra_flags: Sequence[str] = (),
        progress: Progress | None = None,
    ) -> Compiled:
        """The scene's shared library with a method, compiled or found in the cache, and loaded.

        `method` is one, or several, all that the scene offers if not given, `compensated` how each
        sums up its steps; see `run`.  `ensembles`: that steps many members, too.  `extra_flags`:
        for the compiler.  Raises UsageError for an unknown scalar, kernels, representation or
        method, ToolError when compilation fails.
        """
        from hamotor.scene.methods import texts_of
        from hamotor.scene.scalars import parse_scalar

        numbers = parse_scalar(scalar)
        for name, value, allowed in (
            ("kernels", kernels, KERNELS),
            ("representation", representation, REPRESENTATIONS),
        ):
            if value not in allowed:
                raise UsageError(
                    f'unknown {name} "{value}"; there is {", ".join(allowed)}.'
                    f"{suggest(value, allowed)}"
                )
        methods = () if method is None else (method,) if isinstance(method, str) else tuple(method)
        started = time.perf_counter()
        if representation == "matrix":
            if kernels != "generated":
                raise UsageError("the matrix form has no kernels; leave --kernels out.")
            if self.matrix_source is None:
                raise UsageError(f"{self.name}: has no matrix form.")
            if numbers.name in {"quad", "mpfr"}:
                raise UsageError(
                    "the matrix form is stepped in double, float and long_double; "
                    f"leave --scalar {numbers.name} or --representation matrix out."
                )
            if compensated:
                raise UsageError("the matrix form has plain sums; leave compensated out.")
            source = self.matrix_source(scalar)
        else:
            texts = texts_of(methods, in_coordinates=bool(self.methods) and not ensembles)
            own_text: tuple[str, ...] = (texts,) if texts else ()
            if ensembles and self.ensemble.parameters:
                own_text = (*(own_text or methods[:1] or ("",)), "drawn")
            source = self.source(kernels, scalar, *own_text)
        if methods and self.methods:
            offered = self.offered(kernels, representation)
            for one in methods:
                check_method(one, self.offered_to_ensembles if ensembles else offered)
            source = f'#define HAMOTOR_METHOD "{" ".join(methods)}"\n{source}'
        if compensated is not None:
            source = f"#define HAMOTOR_COMPENSATED {str(compensated).lower()}\n{source}"
        if ensembles:
            source = f"#define HAMOTOR_ENSEMBLE\n#define HAMOTOR_FUSED\n{source}"
        generate_s = time.perf_counter() - started
        fills_packs = not methods or "taylor" in methods
        own_flags = () if fills_packs else flags_without_packs(platform.machine())
        shown = NoProgress() if progress is None else progress
        build = compile_scene(
            source,
            libraries=(eigen(),) if representation == "matrix" else (),
            scalar=scalar,
            extra_flags=(*own_flags, *extra_flags),
            on_compile=lambda: shown.note(f"compiling {self.name} …"),
        )
        return Compiled(build, SceneLibrary(build.library), generate_s, source)

    @property
    def offered_to_ensembles(self) -> Mapping[str, int]:
        """Names and orders of the methods that step members; none where `methods` is."""
        return self.member_methods or self.methods

    def offered(self, kernels: str, representation: str) -> Mapping[str, int]:
        """Names and orders of the methods for a form of the scene; none where `methods` is."""
        from hamotor.scene import Form, methods_offered

        if not self.methods or (kernels, representation) == ("generated", "ga"):
            return self.methods
        if representation == "matrix":
            return methods_offered(Form.MATRIX)
        return self.methods_by_table() if self.methods_by_table else methods_offered(Form.GENERAL)

    def run(
        self,
        *,
        end: float | None = None,
        step: float | None = None,
        tolerance: float | None = None,
        local_tolerance: float | None = None,
        method: str | None = None,
        compensated: bool | None = None,
        every: int | None = None,
        times: Sequence[float] | None = None,
        interval: float | None = None,
        time_limit: float | None = None,
        scalar: str = "double",
        digits: int | None = None,
        kernels: str = "generated",
        representation: str = "ga",
        out: str | os.PathLike[str] | None = None,
        csv: bool = False,
        pictures: bool = True,
        progress: bool | Progress = False,
    ) -> Run:
        """Integrate from t = 0 to `end` (s) and return the run; what is not given, the scene says.

        `end` before 0 is reached back in time.  `step` (s) is shortened if need be so that a whole
        number of steps ends at `end`.

        `tolerance` instead asks for an error of the final state, verified by a second run: half the
        step, or with a method that chooses its steps a sixteenth of the local tolerance, changes it
        by no more.  That is the largest change of a motor's component, and of a momentum's relative
        to its initial norm.  The scene's method, if its accuracy is a step, was chosen for that: it
        gives way to `auto`, the cheapest, unless `method` names it.  `local_tolerance` (1/s) is,
        for methods that choose their steps, the error they allow themselves per second; nothing is
        verified, and `step` is how often they deliver the state (a thousandth of `end` if not
        given).

        `compensated` sums over steps keep the digits that each addition would lose, so that
        rounding errors are of what changes; if neither this nor the scene says, where that costs
        the method less than a tenth.

        Every `every`-th step is recorded, and always the first and the last state; with a
        tolerance, where the scene cannot know the steps, about two thousand rows if not given.
        `times` (s, in order of the run) instead asks for rows at exactly those times and no others,
        `interval` (s) for rows at its multiples and at the end: the steps stay as they are, and a
        row inside one is a part of it, taken on the side, or the method's dense output.

        `time_limit` (s) ends the integration: the run is then "failed", and keeps what it has.

        `scalar`: double, float, long_double, quad (33 digits) or mpfr (`digits` of them, 50 if not
        given).  Those with more digits than a double take the scene's numbers in all digits that
        they are written with; the final state of `run.json` then has all of them, as texts, and
        errors of what is conserved are theirs, while the trajectory stays in doubles.

        `kernels` "generic" runs the same scene with nothing generated but its Hamiltonian: products
        of dense multivectors by table, slow, to compare with; "sparse" takes of the table only what
        the operands' types need.
        `representation` "matrix" runs the scene in the classical form (R, x, Π, P) instead of
        motors, where its group is SE(3), SO(3) or SE(2): the same columns, for comparison.

        With `out` the rows stream to that folder, which then holds `run.json`, `trajectory/`,
        pictures and, with `csv`, `trajectory.csv`; without it nothing is written.

        Raises UsageError, ToolError; RunFailed when a step failed, or the tolerance was not met;
        RunInterrupted after Ctrl-C.  The last two carry in `.run` what was computed, which by then
        is also on disk.
        """
        if digits is not None:
            if scalar != "mpfr":
                raise UsageError("digits are for the scalar mpfr.")
            scalar = f"mpfr{digits}"
        if tolerance is not None and (step is not None or local_tolerance is not None):
            raise UsageError("give a step or a tolerance, not both.")
        if sum(x is not None for x in (every, times, interval)) > 1:
            raise UsageError("give one of every, times and interval: when to record.")
        if csv and out is None:
            raise UsageError("csv needs out: the folder to write trajectory.csv into.")
        at_least_cost = bool(
            method is None and tolerance is not None and self.tolerance is None and self.structure
        )
        end = self.end if end is None else end
        if local_tolerance is not None:
            step = abs(end) / ROWS if step is None else step
        elif step is None and tolerance is None:
            step, tolerance = self.step, self.tolerance
        if method is None and tolerance is None and local_tolerance is None:
            local_tolerance = self.local_tolerance
        refuse_impossible_span(end, step)
        if every is None and times is None and interval is None:
            interval = self.interval
            if self.times is not None:  # an earlier end than the scene's leaves the later ones out
                times = [x for x in self.times if 0 <= x / end <= 1] or None
        if interval is not None:
            times, every = at_interval(interval, end, step)
        methods = self.offered(kernels, representation)
        chosen = "auto" if at_least_cost else method or self.method
        if method is None and chosen not in methods and chosen in self.methods:
            chosen = "auto"  # what the scene asks for is of its specialised form only
        reason = ""
        if methods:
            # Before the compiler runs: a slip of the pen should not take seconds to come back.
            chosen, reason = choose_method(chosen, methods, tolerance, self.structure)
        if compensated is None and representation != "matrix":  # which has plain sums only
            compensated = self.compensated
        folder = None if out is None else RunFolder(out)
        shown = _progress(progress)
        compiled = self.compile(
            scalar=scalar,
            kernels=kernels,
            representation=representation,
            method=chosen,
            compensated=compensated,
            progress=shown,
        )
        description = compiled.library.description
        method = chosen
        if not methods:
            method, reason = choose_method(chosen, description.methods, tolerance, self.structure)
        if at_least_cost and self.method not in {"auto", method}:
            reason += f" (the scene's own: --method {self.method})"
        if local_tolerance is not None and method not in description.error_controlled:
            raise UsageError(
                f"{method} does not choose its steps, so it has no local tolerance; "
                f"{', '.join(sorted(description.error_controlled)) or 'no method here'} do."
            )
        if description.events == () and self.has_events:
            raise UsageError(f"{self.name}: has events, which this form of a scene does not find.")
        deadline = math.inf if time_limit is None else time.perf_counter() + time_limit

        def new_recorder() -> Recorder:
            if folder is None:
                return MemoryRecorder()
            return folder.new_recorder(description, csv=csv)

        try:
            with Interruption() as interruption:
                recorder: Recorder
                if step is not None:
                    planned = plan(
                        method,
                        end=end,
                        step=step,
                        every=_chosen(every, self.every),
                        times=times,
                        tolerance=local_tolerance,
                    )
                    recorder = new_recorder()
                    outcome = integrate(
                        compiled.library,
                        self.exact_state if description.is_wide else self.state,
                        planned,
                        recorder,
                        progress=shown,
                        interruption=interruption,
                        deadline=deadline,
                    )
                elif tolerance is not None:
                    outcome, recorder = meet_tolerance(
                        compiled.library,
                        self.exact_state if description.is_wide else self.state,
                        method=method,
                        end=end,
                        tolerance=tolerance,
                        every=every,
                        new_recorder=new_recorder,
                        times=times,
                        progress=shown,
                        interruption=interruption,
                        deadline=deadline,
                    )
                else:
                    raise UsageError("the scene has neither step nor tolerance; give one of them.")
                run = self._result(
                    compiled, representation, reason, outcome, recorder, folder, csv=csv
                )
        except BaseException:
            if folder is not None:
                folder.abandon()
            raise
        if run.folder is not None and pictures:
            run.plot(run.folder)
        if interruption.asked:
            raise RunInterrupted(run)
        if outcome.status == "failed":
            raise RunFailed(f"{self.name}: {outcome.problem}", run)
        return run

    def _result(
        self,
        compiled: Compiled,
        representation: str,
        reason: str,
        outcome: Outcome,
        recorder: Recorder,
        folder: RunFolder | None,
        *,
        csv: bool,
    ) -> Run:
        from hamotor import __version__

        description = compiled.library.description
        origin = Origin(
            scene=self.name,
            spec_hash=self.spec_hash,
            version=__version__,
            method_reason=reason,
            generate_s=compiled.generate_s,
            representation=representation,
        )
        said = report(origin, compiled.build, description, outcome)
        units = units_of(description)
        names = [event.name for event in outcome.events]
        rows = np.array([event.row for event in outcome.events])
        if isinstance(recorder, DiskRecorder):
            assert folder is not None
            recorder.write_events(names, rows, csv=csv)
            folder.publish(recorder.folder, to_json(said))
            return Run(said, folder=folder.path, units=units)
        assert isinstance(recorder, MemoryRecorder)
        events = {"event": np.array(names)} if names else {}
        if names:
            events |= {c.name: rows[:, k] for k, c in enumerate(description.columns)}
        return Run(said, trajectory=recorder.columns(description), units=units, events=events)


@dataclass(frozen=True)
class Compiled:
    """A scene's library with what it cost: `generate_s` seconds to write `source`."""

    build: CompiledScene
    library: SceneLibrary
    generate_s: float
    source: str

    @property
    def description(self) -> Description:
        """What the library holds."""
        return self.library.description


def load(scene: str | os.PathLike[str]) -> Simulation:
    """A bundled scene by name, or a scene file by path.

    Raises UsageError for an unknown name or a mistake in the file, naming file and key.
    """
    from hamotor.scene import (
        find_scene,
        folder_of,
        methods_offered,
        parse_scene,
        scene_source,
    )
    from hamotor.scene.exact import text
    from hamotor.scene.structure import structure_of

    contents, name, file = find_scene(Path(scene) if isinstance(scene, os.PathLike) else scene)
    kept = Remembered(default_cache(), key_of(contents, name, folder_of(scene)))

    @cache
    def read() -> Scene | GeneralScene:
        return parse_scene(contents, name=name, file=file, folder=folder_of(scene))

    def settings() -> dict[str, Any]:
        found = read()
        return {
            "name": found.name,
            "state": list(map(float, found.initial_state)),
            "exact_digits": list(map(text, found.exact_state)),
            "end": found.time.end,
            "step": found.time.step,
            "tolerance": found.time.tolerance,
            "local_tolerance": found.time.local_tolerance,
            "compensated": found.time.compensated,
            "method": found.time.method,
            "every": found.output.every,
            "times": found.output.times,
            "interval": found.output.interval,
            "has_events": bool(found.events),
            "spec_hash": found.sha256,
            "structure": structure_of(found),
            "ensemble": asdict(_ensemble(found)),
            "methods": methods_offered(found.form),
            "member_methods": methods_offered(_form_of_members(found)),
        }

    def source(*choice: str) -> str:
        text = kept.value(f"source {' '.join(choice)}", lambda: scene_source(read(), *choice))
        return str(text)

    def in_matrices(scalar: str) -> str:
        from hamotor.scene.matrix_source import matrix_source

        return str(kept.value(f"matrix {scalar}", lambda: matrix_source(read(), scalar)))

    def by_table() -> dict[str, int]:
        methods = kept.value("methods by table", lambda: methods_offered(_form_in_tables(read())))
        return dict(methods)

    known = kept.value("settings", settings)
    return Simulation(
        **{
            **known,
            "state": np.array(known["state"]),
            "exact_digits": tuple(known["exact_digits"]),
            "ensemble": Ensemble.from_json(known["ensemble"]),
        },
        source=source,
        read=read,
        matrix_source=in_matrices,
        methods_by_table=by_table,
    )


def _ensemble(scene: Scene | GeneralScene) -> Ensemble:
    """With its parameters, where there are any."""
    from hamotor.scene import Scene

    if isinstance(scene, Scene) and scene.draws_parameters:
        return scene.general.ensemble
    return scene.ensemble


def _form_in_tables(scene: Scene | GeneralScene) -> Form:
    """What kinds of methods step it with products by table."""
    from hamotor.scene import Scene

    return (scene.general if isinstance(scene, Scene) else scene).form


def _form_of_members(scene: Scene | GeneralScene) -> Form:
    """What kinds of methods step members."""
    from hamotor.scene import Form, Scene

    if isinstance(scene, Scene):
        if not scene.draws_parameters:
            return scene.form
        scene = scene.general
    return Form.GENERAL if scene.draws_rates else scene.form


def from_hamiltonian(energy: Any, bodies: Sequence[BodyWords], **settings: Any) -> Simulation:
    """A Hamiltonian made in Python, ready to run; see `hamotor.scene.building.general_scene`."""
    from hamotor.scene import methods_offered, scene_source
    from hamotor.scene.building import general_scene
    from hamotor.scene.exact import text
    from hamotor.scene.matrix_source import matrix_source
    from hamotor.scene.structure import structure_of

    scene = general_scene(energy, bodies, **settings)
    return Simulation(
        name=scene.name,
        source=lambda *choice: scene_source(scene, *choice),
        state=scene.initial_state,
        exact_digits=tuple(map(text, scene.exact_state)),
        end=scene.time.end,
        step=scene.time.step,
        tolerance=None,
        method=scene.time.method,
        every=scene.output.every,
        spec_hash=scene.sha256,
        methods=methods_offered(scene.form),
        structure=structure_of(scene),
        read=lambda: scene,
        matrix_source=lambda scalar: matrix_source(scene, scalar),
        methods_by_table=lambda: methods_offered(scene.form),
    )


def at_interval(
    interval: float, end: float, step: float | None
) -> tuple[list[float] | None, int | None]:
    """When to record at the multiples of an interval: at times, or every so many steps."""
    if not (math.isfinite(interval) and interval > 0):
        raise UsageError(f"interval must be a positive number of seconds, not {interval!r}.")
    count = max(1.0, abs(end) / interval)  # a longer one gives the same two rows
    if step is not None:
        steps = abs(end / step)
        whole = round(steps) / count  # steps from row to row, of a step that divides the end
        if abs(steps - round(steps)) < 1e-9 * steps and abs(whole - round(whole)) < 1e-12 * whole:
            return None, round(whole)
    if count > _MOST_TIMES:
        raise UsageError(
            f"{count:.3g} rows at intervals of {interval:g} s are more than {_MOST_TIMES:,}; "
            "take a longer interval, or one that is a multiple of the step."
        )
    times = [math.copysign(interval * k, end) for k in range(int(count * (1 + 1e-12)) + 1)]
    if abs(times[-1]) < abs(end) * (1 - 1e-12):
        times.append(end)
    else:
        times[-1] = end
    return times, None


def _chosen(asked: int | None, default: int) -> int:
    return default if asked is None else asked


def _progress(wanted: bool | Progress) -> Progress:
    if isinstance(wanted, bool):
        return PrintedProgress() if wanted else NoProgress()
    return wanted
