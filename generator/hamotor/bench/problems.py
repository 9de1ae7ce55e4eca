"""Scenes to measure steppers on, what their exact end is, and how public solvers are given them."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from hamotor.bench import endpoint
from hamotor.bench.account import say
from hamotor.bench.endpoint import ATTITUDE, POSITION, Endpoint
from hamotor.bench.equations import Equations, equations
from hamotor.errors import HamotorError, UsageError
from hamotor.files import write_whole
from hamotor.run.build import default_cache, default_includes, headers_digest
from hamotor.run.library import Description, SceneLibrary
from hamotor.run.report import to_json
from hamotor.run.simulation import Simulation, load
from hamotor.scene import Scene, bundled_scenes, find_scene
from hamotor.scene.motors import rotation_matrix

ROOT: Final = Path(__file__).resolve().parents[3]
SCENES: Final = ROOT / "tests" / "bench" / "problems"
REFERENCES: Final = ROOT / "tests" / "references"
WITNESSES: Final = REFERENCES / "witnesses"
TARGETS: Final = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)

GOALS: Final[Mapping[str, tuple[float | None, ...]]] = {
    "P1": (1.6, 1.9, 1.8, 1.4, None),
    "P2": (300, 11, 3.9, 2.7, None),
    "P3": (11, 6.7, 4.1, 2.2, 1.8),
    "P3b+": (12, 7.6, 4.4, 2.6, 2.0),
    "P4": (1.75, 2.2, 2.0, 2.2, 4.7),
}
"""How many times faster than the best public solver to be at each of `TARGETS`, as prototypes were;
None where no public solver gets there."""

_SERIES: Final = (("taylor", "mpfr50", 1e-36), ("taylor", "quad", 1e-30))
"""Methods, scalars and tolerances, s⁻¹: the first computes a reference or holds its formulas to
account, the second the first one's rounding."""
_PAIR: Final = ("rk87", "quad", 1e-18)
"""Has nothing in common with them, where there is nothing better."""
_LARGEST_DOUBT: Final = 1e-12


@dataclass(frozen=True)
class Witness:
    """A run of ours that a reference was held against."""

    method: str
    scalar: str
    setting: str
    apart: float
    """The largest difference of a number of the end: a motor's or a rotation matrix's, a momentum
    or a place in SI units, relative to the largest of its unit where that is above 1 if there are
    no digits to hold it against."""

    def __str__(self) -> str:
        return f"{self.apart:.1e} ({self.method} in {self.scalar}, {self.setting})"


@dataclass(frozen=True)
class Reference:
    """The exact end of a problem, as far as it is known."""

    exact: Endpoint
    """In fractions."""
    source: str
    certificate: str
    """How it was checked, and to what."""
    witnesses: tuple[Witness, ...] = ()

    @cached_property
    def end(self) -> Endpoint:
        """In long doubles."""
        return endpoint.in_long_doubles(self.exact)


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
        return _from_digits(self._digits, self) if self._digits else _computed(self.simulation)

    @property
    def _digits(self) -> Path | None:
        """The file that holds the digits of its end, if the scene is not cut."""
        file = REFERENCES / f"{self.name}.json"
        whole = isinstance(self.scene, Scene) and self.simulation.end == self.scene.time.end
        return file if whole and file.is_file() else None

    @cached_property
    def wide(self) -> Simulation:
        """What scalars with more digits than a double step: the motion of the reference."""
        return _as_doubles(self) if self._digits else self.simulation

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
            return {**by_hand, "end": self.simulation.end}
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


def problem(asked: str) -> Problem:
    """One of the benchmark's own problems, a bundled scene or a scene file; NAME@END: to this time,
    s, instead of the scene's own.  Raises UsageError."""
    name, _, end = asked.rpartition("@") if "@" in asked else (asked, "", "")
    own = SCENES / f"{name}.toml"
    text = own if own.is_file() else name
    try:
        found = Problem(Path(name).stem, load(text), text)
    except UsageError as refusal:
        if own.is_file() or Path(name).exists():
            raise
        said, known = str(refusal).rstrip("."), ", ".join(own_problems())
        raise UsageError(f"{said}. The benchmark's own problems are {known}.") from None
    if not end:
        return found
    try:
        seconds = float(end)
    except ValueError:
        seconds = math.nan
    if not 0 < seconds < math.inf:
        raise UsageError(f'"{asked}": what follows @ is the end, in seconds')
    return replace(found, simulation=replace(found.simulation, end=seconds))


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
        return Problem(one.name, replace(load(file), end=one.simulation.end))
    except HamotorError as refusal:
        return str(refusal).splitlines()[0]


def own_problems() -> list[str]:
    """Names of the problems that have scenes of their own."""
    return sorted(file.stem for file in SCENES.glob("*.toml"))


def default_problems() -> list[str]:
    """The benchmark's own problems and the bundled scenes, chaotic ones to where a reference can
    be had."""
    own = own_problems()
    scenes = [name for name, _ in bundled_scenes() if name not in own]
    return own + [f"{name}@{_ENDS[name]:g}" if name in _ENDS else name for name in scenes]


_ENDS: Final = {"two_bodies": 2.0, "spring_pendulum": 5.0, "conformal_pendulum": 5.0}


def _from_digits(file: Path, one: Problem) -> Reference:
    said = json.loads(file.read_text(encoding="utf-8"))
    last, scene = said["checkpoints"][-1], one.scene
    if last["t"] != scene.time.end:
        raise UsageError(f"{file.name} ends at {last['t']} s, the scene at {scene.time.end} s")
    state = [*last["q"], *last["w"], *last.get("x", ()), *last.get("v", ())]
    _, witnesses = witnesses_of(one, said)
    return Reference(
        endpoint.of_quaternion(scene, state, said["energy0"], Fraction),
        f"tests/references/{file.name}: {said['method'].split(';')[0]}",
        f"two orders, differing by {said['crosscheck_max_abs_diff']}; " + in_words(witnesses),
        witnesses,
    )


def in_words(witnesses: Sequence[Witness]) -> str:
    """By how much they differ from a reference."""
    return "no number of the state differs by more than " + ", ".join(map(str, witnesses))


def witnesses_of(one: Problem, said: Mapping[str, Any]) -> tuple[str, tuple[Witness, ...]]:
    """Runs of ours beside a reference of digits: those that are kept, if the scene and the runs are
    still what the key says, or else new ones."""
    simulation = one.wide
    runs: list[tuple[str, str, float]] = list(_SERIES)
    other = "closed_form" if "closed_form" in simulation.methods else "gauss16"
    runs.append((other, "quad", 0.0))
    key = _key_of(simulation, runs)
    cached = default_cache() / "references" / f"{key}.json"
    for file in (WITNESSES / f"{one.name}.json", cached):
        kept = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
        if kept.get("key") == key:
            return key, tuple(Witness(**witness) for witness in kept["witnesses"])
    found = []
    for method, scalar, tolerance in runs:
        say(f"{one.name}: {method} in {scalar} beside the reference")
        library = simulation.compile(scalar=scalar, method=method).library
        description, row, setting = _end_of(simulation, library, method, tolerance)
        found.append(Witness(method, scalar, setting, _apart(description, row, said)))
        if not found[-1].apart < _LARGEST_DOUBT:
            raise UsageError(f"{one.name}: its reference is contradicted: {found[-1]}")
    cached.parent.mkdir(parents=True, exist_ok=True)
    write_whole(cached, kept_text(key, found))
    return key, tuple(found)


def kept_text(key: str, witnesses: Sequence[Witness]) -> str:
    """What is kept of witnesses."""
    return to_json({"key": key, "witnesses": [asdict(witness) for witness in witnesses]})


def _key_of(simulation: Simulation, runs: Sequence[tuple[str, str, float]]) -> str:
    known = json.dumps([simulation.spec_hash, simulation.end, _steps(simulation), runs])
    return hashlib.sha256(known.encode()).hexdigest()


_WITH_A_POINT: Final = re.compile(r"(?<![\w.])\d+\.\d+(?:[eE][-+]?\d+)?")


def _as_doubles(one: Problem) -> Simulation:
    """The scene with the doubles that its numbers are rounded to, in all digits: in scalars with
    more digits, too, the motion that everybody steps in double."""
    lines = [
        line
        if line.startswith("description")
        else _WITH_A_POINT.sub(lambda x: format(Decimal(float(x[0])), "f"), line.partition("#")[0])
        for line in find_scene(one.text)[0].decode("utf-8").splitlines()
    ]
    file = default_cache() / "doubles" / f"{one.name}.toml"
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, "\n".join(lines) + "\n")
    return load(file)


def _apart(description: Description, row: Sequence[str], said: Mapping[str, Any]) -> float:
    """The largest difference of a body's rotation matrix, momenta and place from the last state
    of a reference of digits."""
    last, params = said["checkpoints"][-1], said["params"]
    q, w, x, v = ([Fraction(number) for number in last.get(key, ())] for key in "qwxv")
    (body,) = description.bodies
    index = description.column_index

    def numbers(columns: Sequence[str]) -> list[Fraction]:
        return [Fraction(row[index[column]]) for column in columns]

    rotor = numbers([f"{body}.motor.{blade}" for blade in ("s", "e23", "e31", "e12")])
    there = rotation_matrix([q[0], -q[1], -q[2], -q[3]])
    differences = list((rotation_matrix(rotor) - there).flat)
    momenta = [Fraction(moment) * rate for moment, rate in zip(params["J"], w, strict=True)]
    if v:
        momenta += [Fraction(params["m"]) * speed for speed in there.T @ np.array(v)]
        here = [Fraction(row[column]) for column in description.position_columns(body)]
        differences += [a - b for a, b in zip(here, x, strict=True)]
    own = numbers([f"{body}.momentum.{name}" for name in description.momentum])
    differences += [a - b for a, b in zip(own, momenta, strict=True)]
    return float(max(map(abs, differences)))


def _computed(simulation: Simulation) -> Reference:
    """In two precisions and by two methods, kept; UsageError where they do not agree to 1e-12."""
    runs = [*_SERIES, _PAIR]
    key = json.dumps([_key_of(simulation, runs), headers_digest(default_includes())])
    file = default_cache() / "references" / f"{hashlib.sha256(key.encode()).hexdigest()}.json"
    kept = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    method, scalar, tolerance = runs[0]
    by_scalar: dict[str, list[str]] = {}
    for m, s, _ in runs:
        by_scalar.setdefault(s, []).append(m)

    def compiled(each: str) -> SceneLibrary:
        # Nobody times these.
        return simulation.compile(scalar=each, method=by_scalar[each], extra_flags=("-O1",)).library

    if not kept:
        with ThreadPoolExecutor(len(runs)) as pool:
            libraries = dict(zip(by_scalar, pool.map(compiled, by_scalar), strict=True))
            (_, row, _), *others = pool.map(
                lambda run: _end_of(simulation, libraries[run[1]], run[0], run[2]), runs
            )
        description = libraries[scalar].description
        witnesses = [
            asdict(Witness(other[0], other[1], setting, _relative(description, row, there)))
            for other, (_, there, setting) in zip(runs[1:], others, strict=True)
        ]
        kept = {"row": row, "witnesses": witnesses}
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, json.dumps(kept))
    source = f"{method} in {scalar}, {_setting(simulation, tolerance)}"
    found = tuple(Witness(**witness) for witness in kept["witnesses"])
    for witness in found:
        if not witness.apart < _LARGEST_DOUBT:
            raise UsageError(
                f"{simulation.name}: {source} and another run differ by {witness}, so that there is"
                " no reference. The motion is chaotic or not smooth: end it earlier."
            )
    end = endpoint.of_row(compiled(scalar).description, kept["row"], Fraction)
    return Reference(end, source, in_words(found), found)


def _relative(description: Description, row: Sequence[str], there: Sequence[str]) -> float:
    """The largest difference of two rows' states, of numbers above 1 relative to the largest of
    their unit: an asteroid's momenta are large numbers."""
    columns = description.state_columns()
    sizes: dict[str, Fraction] = {}
    for c in columns:
        unit = description.columns[c].unit
        sizes[unit] = max(sizes.get(unit, Fraction(1)), abs(Fraction(row[c])))
    return float(
        max(
            abs(Fraction(row[c]) - Fraction(there[c])) / sizes[description.columns[c].unit]
            for c in columns
        )
    )


def _steps(simulation: Simulation) -> int:
    """How many of half the scene's length there are to its end."""
    return max(round(2 * simulation.end / simulation.step), 1) if simulation.step else 1000


def _setting(simulation: Simulation, tolerance: float) -> str:
    if tolerance:
        return f"tolerance {tolerance:g}"
    return f"steps of {simulation.end / _steps(simulation):g} s"


def _end_of(
    simulation: Simulation, library: SceneLibrary, method: str, tolerance: float
) -> tuple[Description, list[str], str]:
    """What the row at the end holds, the row in decimals with all digits, and how it was made."""
    parts = 16 if tolerance else _steps(simulation)  # an answer to Ctrl-C now and then
    step = Fraction(simulation.end) / parts
    with library.start(
        method, step=step, state=simulation.exact_state, tolerance=tolerance or None
    ) as live:
        if any(live.advance(1, 0, None) < 1 for _ in range(parts)):
            raise UsageError(f"{simulation.name}: no reference: {live.failure()[0].name}")
        return library.description, live.observe_text(), _setting(simulation, tolerance)


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
        "state": [float(x) for x in state],
    }
