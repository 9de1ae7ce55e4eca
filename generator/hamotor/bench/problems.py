"""Scenes to measure steppers on, what their exact end is, and how public solvers are given them."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from hamotor.bench import endpoint
from hamotor.bench.account import write_whole
from hamotor.bench.endpoint import ATTITUDE, POSITION, Endpoint
from hamotor.bench.equations import Equations, equations
from hamotor.errors import HamotorError, UsageError
from hamotor.run.build import default_cache, default_includes, headers_digest
from hamotor.run.library import SceneLibrary
from hamotor.run.simulation import Simulation, load
from hamotor.scene import Scene, find_scene

ROOT: Final = Path(__file__).resolve().parents[3]
SCENES: Final = ROOT / "tests" / "bench" / "problems"
REFERENCES: Final = ROOT / "tests" / "references"
TARGETS: Final = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)

GOALS: Final[Mapping[str, tuple[float | None, ...]]] = {
    "P1": (1.6, 1.9, 1.8, 1.4, None),
    "P2": (300, 11, 3.9, 2.7, None),
    "P3": (11, 6.7, 4.1, 2.2, 1.8),
    "P3b": (12, 7.6, 4.4, 2.6, 2.0),
    "P4": (1.75, 2.2, 2.0, 2.2, 4.7),
}
"""How many times faster than the best public solver to be at each of `TARGETS`, as prototypes were;
None where no public solver gets there."""

_WITNESSES: Final = (
    ("taylor", "mpfr50", 1e-36),
    ("taylor", "quad", 1e-30),
    ("rkmk87", "quad", 1e-20),
)
"""Methods, scalars and tolerances, s⁻¹: the first computes a reference, the second holds its
rounding to account, the third, which has nothing in common with them, its formulas."""
_LARGEST_DOUBT: Final = 1e-12


@dataclass(frozen=True)
class Reference:
    """The exact end of a problem, as far as it is known."""

    end: Endpoint
    source: str
    certificate: str
    """How it was checked, and to what."""


@dataclass(frozen=True)
class Problem:
    """A scene from its start to its end."""

    name: str
    simulation: Simulation
    text: str | Path = ""
    """What names the scene's text; "" where it has none."""

    @cached_property
    def scene(self) -> Any:
        """What the simulation was made from."""
        assert self.simulation.read is not None
        return self.simulation.read()

    @property
    def algebra(self) -> str:
        """The scene's own."""
        return str(self.scene.algebra)

    @cached_property
    def reference(self) -> Reference:
        """From `tests/references`, or else computed in 50 digits and again in quad."""
        file = REFERENCES / f"{self.name}.json"
        if file.is_file() and isinstance(self.scene, Scene):
            return _from_digits(file, self.scene)
        return _computed(self.simulation)

    @cached_property
    def norm(self) -> str:
        """The quantity whose error the targets are for: attitude, where there is none position."""
        known = self.reference.end
        return next((q for q in (ATTITUDE, POSITION) if q in known), next(iter(known)))

    @cached_property
    def conformal(self) -> Problem | str:
        """The same motion in conformal algebra, or why there is none."""
        return _conformal(self)

    @cached_property
    def for_peers(self) -> Mapping[str, Any] | str:
        """What public solvers are given, or why they are not: the numbers of the equations written
        for them by hand, or else equations generated from the scene."""
        by_hand = _for_peers(self.scene)
        if not isinstance(by_hand, str):
            return by_hand
        generated = self.equations
        if isinstance(generated, str):
            return f"{by_hand}, and {generated}"
        return {
            "kind": "equations",
            "python": generated.python,
            "operations": generated.operations,
            "end": self.simulation.end,
            "state": list(generated.start),
        }

    @cached_property
    def equations(self) -> Equations | str:
        """Those generated from the scene, or why there are none."""
        return equations(self.scene)

    @property
    def generated(self) -> Equations | None:
        """The same where public solvers are given them."""
        given = self.for_peers
        if isinstance(given, str) or given["kind"] != "equations":
            return None
        assert isinstance(self.equations, Equations)
        return self.equations

    def end_of_peer(self, state: Sequence[float], observed_by: tuple[str, str]) -> Endpoint:
        """The end in a public solver's coordinates; `observed_by`: a library of the scene's and
        its method."""
        if self.generated is None:
            return endpoint.of_quaternion(self.scene, state)
        file, method = observed_by
        library = SceneLibrary(Path(file))
        of_scene = self.generated.state(state)
        with library.start(method, step=self.simulation.end, state=np.array(of_scene)) as live:
            return endpoint.of_row(library.description, live.observe())


def problem(name: str) -> Problem:
    """One of the benchmark's own problems, a bundled scene or a scene file.  Raises UsageError."""
    own = SCENES / f"{name}.toml"
    text = own if own.is_file() else name
    return Problem(Path(name).stem, load(text), text)


_TWINS: Final = {"pga3": ("cga3", "SE3"), "pga2": ("cga2", "SE2")}


def _conformal(one: Problem) -> Problem | str:
    """The scene's text with another algebra and group."""
    scene = one.scene
    if not isinstance(scene, Scene) or not one.text:
        return "only rigid bodies are put into conformal algebra"
    fixed = not scene.group.translates
    if fixed and (scene.interactions or any(any(b.center_of_mass) for b in scene.bodies)):
        return "conformal algebra has no group of rotations alone, which would hold a point fixed"
    algebra, group = _TWINS[scene.algebra]
    lines = find_scene(one.text)[0].decode("utf-8").splitlines()
    first_table = next((i for i, line in enumerate(lines) if line.startswith("[")), len(lines))
    kept = [
        line
        for i, line in enumerate(lines)
        if i >= first_table or not re.match(r"\s*(algebra|group)\s*=", line)
    ]
    file = default_cache() / "twins" / f"{one.name}.toml"
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, "\n".join([f'algebra = "{algebra}"', f'group = "{group}"', *kept]) + "\n")
    try:
        return Problem(one.name, load(file))
    except HamotorError as refusal:
        return str(refusal).splitlines()[0]


def own_problems() -> list[str]:
    """Names of the problems that have scenes of their own."""
    return sorted(file.stem for file in SCENES.glob("*.toml"))


def _from_digits(file: Path, scene: Scene) -> Reference:
    said = json.loads(file.read_text(encoding="utf-8"))
    last = said["checkpoints"][-1]
    if last["t"] != scene.time.end:
        raise UsageError(f"{file.name} ends at {last['t']} s, the scene at {scene.time.end} s")
    state = [*last["q"], *last["w"], *last.get("x", ()), *last.get("v", ())]
    return Reference(
        endpoint.of_quaternion(scene, state, said["energy0"]),
        f"tests/references/{file.name}: {said['method'].split(';')[0]}",
        f"two orders, differing by {said['crosscheck_max_abs_diff']}",
    )


def _computed(simulation: Simulation) -> Reference:
    """In two precisions and by two methods, kept; UsageError where they do not agree to 1e-12."""
    runs = [f"{method} in {scalar}, tolerance {error:g}" for method, scalar, error in _WITNESSES]
    key = json.dumps(
        [simulation.spec_hash, simulation.end, runs, headers_digest(default_includes())]
    )
    file = default_cache() / "references" / f"{hashlib.sha256(key.encode()).hexdigest()}.json"
    kept = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    first = simulation.compile(scalar=_WITNESSES[0][1], method=_WITNESSES[0][0])
    if not kept:
        row, *others = (
            _end_of(simulation, method, scalar, error) for method, scalar, error in _WITNESSES
        )
        columns = first.description.state_columns()
        apart = [
            float(max(abs(Fraction(row[c]) - Fraction(other[c])) for c in columns))
            for other in others
        ]
        kept = {"row": row, "apart": apart}
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, json.dumps(kept))
    rows, apart = kept["row"], kept["apart"]
    for run, distance in zip(runs[1:], apart, strict=True):
        if not distance < _LARGEST_DOUBT:
            raise UsageError(
                f"{simulation.name}: {runs[0]} and {run} end {distance:.1e} apart, so that there is"
                " no reference. The motion is chaotic or not smooth: end it earlier."
            )
    return Reference(
        endpoint.of_row(first.description, [np.longdouble(x) for x in rows]),
        runs[0],
        "no number of the state differs by more than "
        + ", ".join(f"{d:.1e} ({run})" for run, d in zip(runs[1:], apart, strict=True)),
    )


def _end_of(simulation: Simulation, method: str, scalar: str, tolerance: float) -> list[str]:
    """The row at the end, in decimals with all digits."""
    library = simulation.compile(scalar=scalar, method=method).library
    parts = 16  # an answer to Ctrl-C now and then
    step = Fraction(simulation.end) / parts
    with library.start(
        method, step=step, state=simulation.exact_state, tolerance=tolerance
    ) as live:
        if any(live.advance(1, 0, None) < 1 for _ in range(parts)):
            raise UsageError(f"{simulation.name}: no reference: {live.failure()[0].name}")
        return live.observe_text()


def _for_peers(scene: Any) -> Mapping[str, Any] | str:
    if not isinstance(scene, Scene) or scene.group.dimension != 3 or scene.group.scales:
        return "only rigid bodies in space are formulated for them"
    if len(scene.bodies) != 1:
        return "only one body is formulated for them"
    (body,) = scene.bodies
    others = [i for i in scene.interactions if type(i).__name__ not in {"Gravity", "Spring"}]
    gravity = scene.gravity or (0.0, 0.0, 0.0)
    moves = body.group.translates
    tensor = np.array(body.kinetic_matrix[:3, :3])
    center = body.center_of_mass
    springs = scene.springs
    if others or len(springs) > 1 or any(gravity[:2]) or gravity[2] > 0:
        return "only gravity downwards and one spring are formulated for them"
    if np.any(tensor - np.diag(np.diag(tensor))) or any(center[: 3 if moves else 2]):
        return "only bodies in their principal axes are formulated for them"
    if any(any(s.anchor or (1,)) for s in springs) or (springs and not moves):
        return "only springs from the world's origin to a free body are formulated for them"
    kind = "free"
    if springs:
        kind = "loose" if springs[0].rest_length else "sprung"
    elif any(gravity):
        if moves:
            return "a falling body is not formulated for them"
        kind = "top"
    s, e23, e31, e12 = body.rotor
    state = [s, -e23, -e31, -e12, *body.rate[:3]]
    if springs:
        rotation = body.in_world((1, 0, 0)), body.in_world((0, 1, 0)), body.in_world((0, 0, 1))
        axes = np.array(rotation) - np.array(body.position)
        state += [*body.position, *(axes.T @ body.rate[3:])]
    return {
        "kind": kind,
        "moments": [float(x) for x in np.diag(tensor)],
        "mass": body.mass,
        "gravity": -gravity[2],
        "height": center[2],
        "stiffness": springs[0].stiffness if springs else 0.0,
        "rest_length": springs[0].rest_length if springs else 0.0,
        "at": list(springs[0].at) if springs else [0.0, 0.0, 0.0],
        "end": scene.time.end,
        "state": [float(x) for x in state],
    }
