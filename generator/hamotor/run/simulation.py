"""A scene ready to run: its C++ text, its initial state, and the defaults of its time table."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hamotor.errors import UsageError, suggest
from hamotor.run.build import CompiledScene, compile_scene, default_cache, eigen
from hamotor.run.dataset import DiskRecorder, MemoryRecorder, RunFolder
from hamotor.run.library import Description, SceneLibrary, Vector, check_method
from hamotor.run.progress import NoProgress, PrintedProgress, Progress
from hamotor.run.remembered import Remembered, key_of
from hamotor.run.report import Origin, report, to_json
from hamotor.run.result import Run, RunFailed, RunInterrupted, units_of
from hamotor.run.runner import Interruption, Outcome, Recorder, integrate, meet_tolerance, plan

if TYPE_CHECKING:
    from hamotor.scene import GeneralScene, Scene
    from hamotor.scene.building import BodyWords

KERNELS = ("generated", "generic")
REPRESENTATIONS = ("ga", "matrix")

_AUTO_METHOD = "splitting2"
_AUTO_REASON = (
    "it keeps every coadjoint orbit exactly and its energy error does not grow over long runs"
)
_FALLBACK_METHOD = "rkmk4"
_SMALL_TOLERANCE = 1e-7  # a heavy top's 1e-9 takes order 2 four times as long as order 4


@dataclass(frozen=True)
class Simulation:
    """A scene that can be run.  `hamotor.load` makes one.

    `source` gives the scene's C++ text for (kernels, scalar); `state` is the initial state, per
    body motor and momentum, in the scene's body frame.  Times are in seconds.  `methods`, if given,
    are the names and orders of all that the scene offers, and only the one that is used is
    compiled.  `read` gives the scene that it was made from.
    """

    name: str
    source: Callable[[str, str], str]
    state: Vector
    end: float
    step: float | None
    tolerance: float | None
    method: str
    every: int
    spec_hash: str
    methods: Mapping[str, int] = field(default_factory=dict)
    read: Callable[[], Scene | GeneralScene] | None = None
    matrix_source: Callable[[str], str] | None = None
    """Gives the C++ text in the matrix representation, for a scalar."""
    exact_digits: tuple[str, ...] = ()
    """The initial state in 60 digits."""

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
        method: str | None = None,
        progress: Progress | None = None,
    ) -> Compiled:
        """The scene's shared library with one method, compiled or found in the cache, and loaded.

        `method` is all that the scene offers if not given.  Raises UsageError for an unknown
        scalar, kernels, representation or method, ToolError when compilation fails.
        """
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
            source = self.matrix_source(scalar)
        else:
            own_text = (method,) if method == "taylor" else ()
            source = self.source(kernels, scalar, *own_text)
        if method is not None and self.methods:
            check_method(method, self.offered(kernels, representation))
            source = f'#define HAMOTOR_METHOD "{method}"\n{source}'
        generate_s = time.perf_counter() - started
        shown = NoProgress() if progress is None else progress
        build = compile_scene(
            source,
            libraries=(eigen(),) if representation == "matrix" else (),
            scalar=scalar,
            on_compile=lambda: shown.note(f"compiling {self.name} …"),
        )
        return Compiled(build, SceneLibrary(build.library), generate_s)

    def offered(self, kernels: str, representation: str) -> Mapping[str, int]:
        """Names and orders of the methods for a form of the scene; none where `methods` is."""
        from hamotor.scene import Form, methods_offered

        if not self.methods or (kernels, representation) == ("generated", "ga"):
            return self.methods
        return methods_offered(Form.MATRIX if representation == "matrix" else Form.GENERAL)

    def run(
        self,
        *,
        end: float | None = None,
        step: float | None = None,
        tolerance: float | None = None,
        method: str | None = None,
        every: int | None = None,
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

        `step` (s) is shortened if need be so that a whole number of steps ends at `end`.
        `tolerance` instead asks for a step so short that halving it changes the final state by no
        more: the largest change of a motor's component, and of a momentum's relative to its initial
        norm.  Every `every`-th step is recorded, and always the first and the last state; with a
        tolerance, where the scene cannot know the steps, about two thousand rows if not given.

        `scalar`: double, float, long_double, quad (33 digits) or mpfr (`digits` of them, 50 if not
        given).  Those with more digits than a double take the scene's numbers in all digits that
        they are written with; the final state of `run.json` then has all of them, as texts, and
        errors of what is conserved are theirs, while the trajectory stays in doubles.

        `kernels` "generic" runs the same scene with nothing generated but its Hamiltonian: products
        of dense multivectors by table, slow, to compare with.
        `representation` "matrix" runs the scene in the classical form (R, x, Π, P) instead of
        motors, where its group is SE(3), SO(3) or SE(2): the same columns, for comparison.

        With `out` the rows stream to that folder, which then holds `run.json`, `trajectory/`,
        pictures and, with `csv`, `trajectory.csv`; without it nothing is written.

        Raises UsageError, ToolError; RunFailed when a number became non-finite or the tolerance was
        not met; RunInterrupted after Ctrl-C.  The last two carry in `.run` what was computed, which
        by then is also on disk.
        """
        if digits is not None:
            if scalar != "mpfr":
                raise UsageError("digits are for the scalar mpfr.")
            scalar = f"mpfr{digits}"
        if step is not None and tolerance is not None:
            raise UsageError("give a step or a tolerance, not both.")
        if csv and out is None:
            raise UsageError("csv needs out: the folder to write trajectory.csv into.")
        end = self.end if end is None else end
        if step is None and tolerance is None:
            step, tolerance = self.step, self.tolerance
        methods = self.offered(kernels, representation)
        chosen = method or self.method
        if method is None and chosen not in methods and chosen in self.methods:
            chosen = "auto"  # what the scene asks for is of its specialised form only
        reason = ""
        if methods:
            # Before the compiler runs: a slip of the pen should not take seconds to come back.
            chosen, reason = choose_method(chosen, methods, tolerance)
        folder = None if out is None else RunFolder(out)
        shown = _progress(progress)
        compiled = self.compile(
            scalar=scalar,
            kernels=kernels,
            representation=representation,
            method=chosen,
            progress=shown,
        )
        description = compiled.library.description
        method = chosen
        if not methods:
            method, reason = choose_method(chosen, description.methods, tolerance)

        def new_recorder() -> Recorder:
            if folder is None:
                return MemoryRecorder()
            return folder.new_recorder(description, csv=csv)

        try:
            with Interruption() as interruption:
                recorder: Recorder
                if step is not None:
                    planned = plan(method, end=end, step=step, every=_chosen(every, self.every))
                    recorder = new_recorder()
                    outcome = integrate(
                        compiled.library,
                        self.exact_state if description.is_wide else self.state,
                        planned,
                        recorder,
                        progress=shown,
                        interruption=interruption,
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
                        progress=shown,
                        interruption=interruption,
                    )
                else:
                    raise UsageError("the scene has neither step nor tolerance; give one of them.")
                run = self._result(compiled, representation, reason, outcome, recorder, folder)
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
        if isinstance(recorder, DiskRecorder):
            assert folder is not None
            folder.publish(recorder, to_json(said))
            return Run(said, folder=folder.path, units=units)
        assert isinstance(recorder, MemoryRecorder)
        return Run(said, trajectory=recorder.columns(description), units=units)


@dataclass(frozen=True)
class Compiled:
    """A scene's library with what it cost: `generate_s` seconds to write its C++ text."""

    build: CompiledScene
    library: SceneLibrary
    generate_s: float

    @property
    def description(self) -> Description:
        """What the library holds."""
        return self.library.description


def choose_method(
    asked: str, methods: Mapping[str, int], tolerance: float | None = None
) -> tuple[str, str]:
    """The method to use, and why if the choice was ours (`auto`).  UsageError if unknown."""
    if asked != "auto":
        check_method(asked, {**methods, "auto": 0})
        return asked, ""
    if tolerance is not None and tolerance < _SMALL_TOLERANCE and _FALLBACK_METHOD in methods:
        return _FALLBACK_METHOD, f"order 4 meets a tolerance below {_SMALL_TOLERANCE:g} sooner"
    if _AUTO_METHOD in methods:
        return _AUTO_METHOD, _AUTO_REASON
    if _FALLBACK_METHOD in methods:
        return _FALLBACK_METHOD, f"this scene has no {_AUTO_METHOD}"
    only = next(iter(methods))
    return only, "it is what this scene offers"


def load(scene: str | os.PathLike[str]) -> Simulation:
    """A bundled scene by name, or a scene file by path.

    Raises UsageError for an unknown name or a mistake in the file, naming file and key.
    """
    from hamotor.scene import (
        Form,
        Scene,
        find_scene,
        folder_of,
        methods_offered,
        parse_scene,
        scene_source,
    )
    from hamotor.scene.exact import text

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
            "method": found.time.method,
            "every": found.output.every,
            "spec_hash": found.sha256,
            "methods": methods_offered(found.form if isinstance(found, Scene) else Form.GENERAL),
        }

    def source(*choice: str) -> str:
        text = kept.value(f"source {' '.join(choice)}", lambda: scene_source(read(), *choice))
        return str(text)

    def in_matrices(scalar: str) -> str:
        from hamotor.scene.matrix_source import matrix_source

        return str(kept.value(f"matrix {scalar}", lambda: matrix_source(read(), scalar)))

    known = kept.value("settings", settings)
    return Simulation(
        **{
            **known,
            "state": np.array(known["state"]),
            "exact_digits": tuple(known["exact_digits"]),
        },
        source=source,
        read=read,
        matrix_source=in_matrices,
    )


def from_hamiltonian(energy: Any, bodies: Sequence[BodyWords], **settings: Any) -> Simulation:
    """A Hamiltonian made in Python, ready to run; see `hamotor.scene.building.general_scene`."""
    from hamotor.scene import Form, methods_offered, scene_source
    from hamotor.scene.building import general_scene
    from hamotor.scene.exact import text
    from hamotor.scene.matrix_source import matrix_source

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
        methods=methods_offered(Form.GENERAL),
        read=lambda: scene,
        matrix_source=lambda scalar: matrix_source(scene, scalar),
    )


def _chosen(asked: int | None, default: int) -> int:
    return default if asked is None else asked


def _progress(wanted: bool | Progress) -> Progress:
    if isinstance(wanted, bool):
        return PrintedProgress() if wanted else NoProgress()
    return wanted
