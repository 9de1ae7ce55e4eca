"""From a scene's name or file to a checked Scene. Every mistake is one UsageError."""

from __future__ import annotations

import hashlib
import math
import os
import re
import stat
import tomllib
from fractions import Fraction
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from hamotor.codegen.spec import bundled_algebra, bundled_algebras, bundled_group
from hamotor.errors import UsageError, suggest
from hamotor.scene import inertia, schema
from hamotor.scene.ensemble import Start, read_ensemble, wanted_parameters
from hamotor.scene.exact import decimal, rounded, written
from hamotor.scene.general import GeneralScene
from hamotor.scene.groups import ALGEBRAS, groups_of
from hamotor.scene.interactions import Gravity, Interaction, Potential, Spring
from hamotor.scene.methods import METHOD_NAMES, METHODS
from hamotor.scene.model import Body, Output, Scene, Time
from hamotor.scene.motors import (
    Matrix,
    Vector,
    nearest_rotation,
    quaternion_of_matrix,
    rotor_of_angle,
    rotor_of_axis_angle,
    rotor_of_quaternion,
)
from hamotor.scene.table import Table, listed, quoted

BUNDLED = Path(__file__).resolve().parents[2] / "scenes"
UNIT_TOLERANCE = 1e-6
"""How far a quaternion's norm or a matrix's R Rᵀ may be from 1: seven written digits suffice."""
MOST_KEY_PARTS = 16
MOST_SHOWN = 200


def bundled_scenes() -> list[tuple[str, str]]:
    """The bundled scenes' names with their one-line descriptions, by name."""
    return [
        (path.stem, tomllib.loads(path.read_text(encoding="utf-8"))["description"])
        for path in sorted(BUNDLED.glob("*.toml"))
    ]


def read_scene(scene: str | os.PathLike[str]) -> Scene | GeneralScene:
    """The bundled scene of this name, or the scene in the file at this path.

    A bundled scene's name comes first; write ./NAME for a file that is called the same. UsageError
    for anything unreadable, larger than 1 MiB, not UTF-8, not TOML, or wrong.
    """
    contents, name, file = find_scene(scene)
    return parse_scene(contents, name=name, file=file, folder=folder_of(scene))


def folder_of(scene: str | os.PathLike[str]) -> Path:
    """Where a scene's file lies: what it names is sought there."""
    bundled = isinstance(scene, str) and (BUNDLED / f"{scene}.toml").is_file()
    return BUNDLED if bundled else Path(scene).parent


def find_scene(scene: str | os.PathLike[str]) -> tuple[bytes, str, str]:
    """The bytes of a scene's file, its stem, and how messages call it; as `read_scene`."""
    shown = os.fspath(scene)
    path, missing = Path(shown), "there is no such file"
    if isinstance(scene, str) and re.fullmatch(schema.NAME_PATTERN, scene):
        bundled = sorted(file.stem for file in BUNDLED.glob("*.toml"))
        if scene in bundled:
            path, shown = BUNDLED / f"{scene}.toml", f"{scene}.toml"
        else:
            missing = (
                "is neither a bundled scene nor a file; bundled scenes are"
                f" {listed(bundled)}.{suggest(scene, bundled)}"
            )
    shown = shown if shown.isprintable() and len(shown) < MOST_SHOWN else quoted(shown)
    return _contents(path, shown, missing), path.stem, shown


def _contents(path: Path, shown: str, missing: str) -> bytes:
    """The bytes of a regular file of at most 1 MiB. Opening never blocks."""

    def refuse(why: str) -> NoReturn:
        raise UsageError(f"{shown}: {why}")

    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            status = os.fstat(descriptor)
            if stat.S_ISDIR(status.st_mode):
                refuse("is a directory; give the scene's TOML file in it")
            if not stat.S_ISREG(status.st_mode):
                refuse("is not a regular file; a scene is a TOML file")
            too_large = status.st_size > schema.MOST_BYTES
            with os.fdopen(descriptor, "rb", closefd=False) as file:
                contents = b"" if too_large else file.read(schema.MOST_BYTES + 1)
        finally:
            os.close(descriptor)
    except FileNotFoundError:
        refuse(missing)
    except (OSError, ValueError) as error:
        refuse(f"cannot be read: {getattr(error, 'strerror', None) or error}")
    if too_large or len(contents) > schema.MOST_BYTES:
        refuse(f"is larger than the {schema.MOST_BYTES >> 20} MiB that a scene may have")
    return contents


def parse_scene(
    contents: bytes, *, name: str, file: str, folder: Path = Path()
) -> Scene | GeneralScene:
    """The scene that a TOML file in `folder` holds; `file` is how messages call it.

    `name` becomes the scene's, with every character that a name cannot have as an underscore.
    """
    values = _toml(contents, file)
    top = Table(file, "", values, schema.SCENE, groups_of(ALGEBRAS[0])[0])
    algebra = _algebra(top)
    if _is_general(top, algebra):
        return _general(top, algebra, name, contents, folder)
    groups = {group.name: group for group in groups_of(algebra)}
    group = next(iter(groups.values()))
    if top.has("group"):
        group = groups[top.choice("group", list(groups), f"groups of {algebra}")]
    top = Table(file, "", values, schema.SCENE, group)
    top.refuse_unknown_keys()
    limits = top.table("limits", schema.LIMITS, heading=True)
    bodies = _bodies(top, limits.integer("bodies"))
    time = _time(top.table("time", schema.TIME, heading=True))
    scene = Scene(
        name=_identifier(name),
        description=top.text("description"),
        group=group,
        bodies=bodies,
        interactions=_interactions(top, bodies, limits.integer("interactions")),
        time=time,
        output=_output(top, time.end),
        sha256=hashlib.sha256(contents).hexdigest(),
        has_events=bool(top.tables("event")),
        reread=lambda: _general(top, algebra, name, contents, folder),
        ensemble=read_ensemble(top, lambda: _starts(bodies)),
        draws_parameters=bool(wanted_parameters(top)),
    )
    if scene.draws_parameters:
        scene.general  # noqa: B018  # read now, so that their mistakes are told now
    if scene.potential is not None and not scene.general.hamiltonian.autonomous:
        return scene.general
    _refuse_singular_springs(top, scene)
    scene.events  # noqa: B018  # read now, so that their mistakes are told now
    with np.errstate(all="ignore"):
        if not math.isfinite(sum(scene.initial_energy)):
            top.fail("the energy at the start overflows; choose other units or smaller numbers")
    return scene


def _starts(bodies: tuple[Body, ...]) -> list[Start]:
    """The bodies as [ensemble] sees them."""
    return [
        Start(
            name=body.name,
            algebra=bundled_algebra(body.group.algebra).algebra,
            group=bundled_group(body.group.algebra, body.group.name),
            motor=body.motor,
            momentum=body.momentum,
            rate=tuple(body.rate),
            kinetic=tuple(map(tuple, body.kinetic_matrix.tolist())),
            position=body.position,
            scale=None,
        )
        for body in bodies
    ]


RIGID_INTERACTIONS = ("gravity", "spring", "potential", "newtonian", "dipole")
"""What acts on places alone, so that it is a kick between free motions."""


def _is_general(top: Table, algebra: str) -> bool:
    """Whether the scene needs more than rigid bodies in potentials."""
    if algebra not in ALGEBRAS or top.has("hamiltonian") or top.has("lagrangian"):
        return True
    if top.has("group") and top.values["group"] not in [g.name for g in groups_of(algebra)]:
        return True
    acting = top.values.get("interaction", [])
    kinds = (
        [x.get("type") for x in acting if isinstance(x, dict)] if isinstance(acting, list) else []
    )
    bodies = top.values.get("body", [])
    new_keys = any(
        isinstance(body, dict) and {"kinetic_matrix", "motor", "rate", "second_moments"} & set(body)
        for body in (bodies if isinstance(bodies, list) else [])
    )
    return new_keys or any(
        kind in schema.INTERACTIONS and kind not in RIGID_INTERACTIONS
        for kind in kinds
        if isinstance(kind, str)
    )


def _algebra(top: Table) -> str:
    """The name of a bundled algebra, or of a spec file beside the scene."""
    given = top.values.get("algebra")
    if isinstance(given, str) and given.endswith(".toml"):
        return given
    return top.choice("algebra", bundled_algebras(), "algebras")


def _general(top: Table, algebra: str, name: str, contents: bytes, folder: Path) -> GeneralScene:
    from hamotor.scene.algebra import in_one_text, scene_algebra
    from hamotor.scene.general_reading import read_general

    found = scene_algebra(folder / algebra if algebra.endswith(".toml") else algebra)
    spec = found.spec
    groups = {group.name: group for group in spec.groups}
    chosen = next(iter(groups))
    if top.has("group"):
        chosen = top.choice("group", list(groups), f"groups of {algebra}")
    view = next(group for group in found.groups if group.name == chosen)
    top = Table(top.file, "", top.values, schema.SCENE, view)
    top.refuse_unknown_keys()
    limits = top.table("limits", schema.LIMITS, heading=True)
    counted = []
    for key, what in (("body", "bodies"), ("interaction", "interactions")):
        tables = top.tables(key) if top.has(key) else []
        most = limits.integer(what)
        if len(tables) > most:
            top.fail(
                f"{len(tables)} {what} are more than the {most} allowed;"
                f" allow more with [limits] {what} = {len(tables)}"
            )
        counted.append(tables)
    if not counted[0]:
        top.fail("a scene needs at least one [[body]]")
    time = _time(top.table("time", schema.TIME, heading=True))
    return read_general(
        top,
        name=_identifier(name),
        algebra=spec.algebra,
        group=groups[chosen],
        contents=contents,
        headers=in_one_text(found.headers),
        bodies=counted[0],
        acting=counted[1],
        orientation=_orientation,
        mass_distribution=_mass_distribution,
        time=time,
        output=_output(top, time.end),
    )


def _identifier(name: str) -> str:
    identifier = re.sub(r"[^A-Za-z0-9_]", "_", name)[:64]
    return identifier if re.match(r"[A-Za-z]", identifier) else f"scene_{identifier}"


_LONG_KEY = re.compile(
    r"""(?<![A-Za-z0-9_-])(?:(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"""
    f"{{{MOST_KEY_PARTS}}}"
)


def _toml(contents: bytes, file: str) -> dict[str, Any]:
    try:
        text = contents.decode("utf-8")
    except UnicodeDecodeError as error:
        line = contents.count(b"\n", 0, error.start) + 1
        raise UsageError(f"{file}: line {line}: is not UTF-8 text") from None
    # A dotted key of n parts costs the TOML reader n² time and memory.
    if long_key := _LONG_KEY.search(text):
        line = text.count("\n", 0, long_key.start()) + 1
        raise UsageError(f"{file}: line {line}: a key of more than {MOST_KEY_PARTS} parts")
    try:
        return tomllib.loads(text, parse_float=written)
    except RecursionError:
        raise UsageError(f"{file}: is not valid TOML: brackets are nested too deeply") from None
    except ValueError as error:
        end = f"at line {text.count(chr(10)) + 1}, the end of the document"
        problem = str(error).replace("at end of document", end)
        if "line" not in problem:
            problem = "a number of thousands of digits"
        raise UsageError(f"{file}: is not valid TOML: {_printable(problem)}") from None


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)[:200]


def _bodies(top: Table, most: int) -> tuple[Body, ...]:
    tables = top.tables("body") if top.has("body") else []
    if not tables:
        top.fail("a scene needs at least one [[body]]")
    if len(tables) > most:
        top.fail(
            f"{len(tables)} bodies are more than the {most} allowed;"
            f" allow more with [limits] bodies = {len(tables)}"
        )
    bodies: list[Body] = []
    first: dict[str, int] = {}
    for number, values in enumerate(tables, 1):
        body = _body(Table(top.file, f"body {number}", values, schema.BODY, top.group))
        if body.name in first:
            top.fail(
                f'body {number}: name: "{body.name}" is the name of body {first[body.name]} already'
            )
        first[body.name] = number
        bodies.append(body)
    return tuple(bodies)


def _body(table: Table) -> Body:
    table.refuse_unknown_keys()
    name = table.name("name")
    table = Table(table.file, f'{table.place} "{name}"', table.values, table.section, table.group)
    mass, center, tensor = _mass_distribution(table)
    if table.has("momentum"):
        for key in ("velocity", "angular_velocity"):
            if table.has(key):
                table.fail(f'"momentum" and "{key}" contradict each other; give one')
        given = table.table("momentum", schema.MOMENTUM)
        linear = given.vector("linear") if table.group.translates else ()
        momentum = (*given.rotation("angular"), *linear)
    else:
        velocity = table.vector("velocity") if table.group.translates else None
        momentum = inertia.momentum(
            mass, center, tensor, table.rotation("angular_velocity"), velocity
        )
    return Body(
        name=name,
        group=table.group,
        mass=mass,
        inertia=tensor,
        center_of_mass=center,
        position=table.vector("position"),
        rotor=_orientation(table),
        momentum=momentum,
    )


def _mass_distribution(table: Table) -> tuple[float, Vector, Matrix]:
    """Mass, centre of mass and the tensor about it, checked to be physical."""
    source = table.one_of("inertia", "box", "ellipsoid", "cylinder", "disk", "points")
    if source == "points":
        for key in ("mass", "center_of_mass"):
            if table.has(key):
                table.fail(f'"points" and "{key}" contradict each other: "{key}" follows from them')
        mass, center, tensor = inertia.of_points(_points(table))
    else:
        mass, center = table.number("mass"), table.vector("center_of_mass")
        tensor = _tensor(table, source, mass)
    if negative := inertia.negative_moments(tensor):
        table.fail(f"must be positive definite, but its principal moments are {negative}", source)
    if not table.flag("allow_unphysical_inertia") and (
        inequality := inertia.violated_inequality(tensor)
    ):
        table.fail(
            f"the principal moments violate the triangle inequality {inequality}: no distribution"
            " of mass has them; if they are meant, write allow_unphysical_inertia = true",
            source,
        )
    kinetic = inertia.kinetic_matrix(mass, center, tensor, translates=table.group.translates)
    about = tensor if table.group.translates else kinetic
    if (axis := inertia.vanishing_axis(np.array(about))) is not None:
        where = "its centre of mass" if table.group.translates else "the fixed point"
        if len(axis) == 3:
            where = f"the axis ({', '.join(f'{x + 0.0:.4g}' for x in axis)}) through {where}"
        table.fail(
            f"the body has no moment of inertia about {where}, so that its momentum cannot tell"
            " how fast it turns; give it some thickness",
            source,
        )
    moments = np.linalg.eigvalsh(np.array(about))
    if moments[0] < schema.LARGEST**-3 or moments[-1] > schema.LARGEST**3:
        table.fail(
            f"the principal moments must lie within {schema.LARGEST**-3:g} and"
            f" {schema.LARGEST**3:g}, so that nothing overflows",
            source,
        )
    return mass, center, tensor


def _points(table: Table) -> list[tuple[float, Vector]]:
    points = []
    for number, values in enumerate(table.tables("points"), 1):
        place = f"{table.place}: points: point {number}"
        point = Table(table.file, place, values, schema.POINT, table.group)
        point.refuse_unknown_keys()
        points.append((point.number("mass"), point.vector("at")))
    if not points:
        table.fail("needs at least one point", "points")
    return points


def _tensor(table: Table, source: str, mass: float) -> Matrix:
    if source == "box":
        return inertia.box(mass, table.lengths("box"))
    if source == "ellipsoid":
        return inertia.ellipsoid(mass, table.lengths("ellipsoid"))
    if source == "disk":
        return inertia.disk(mass, table.number("disk"))
    if source == "cylinder":
        cylinder = table.table("cylinder", schema.CYLINDER)
        return inertia.cylinder(mass, cylinder.number("radius"), cylinder.number("height"))
    if table.group.dimension == 2:
        return ((table.number("inertia"),),)
    value = table.values["inertia"]
    if isinstance(value, list) and any(isinstance(row, list) for row in value):
        return _symmetric(table, table.matrix("inertia"))
    return inertia.diagonal(table.numbers("inertia", 3, "the principal moments, or a 3x3 matrix"))


def _symmetric(table: Table, matrix: Matrix) -> Matrix:
    largest = max(abs(x) for row in matrix for x in row)
    for i in range(3):
        for j in range(i):
            if abs(matrix[i][j] - matrix[j][i]) > 1e-12 * largest:
                table.fail(
                    f"must be symmetric, but row {j + 1}, column {i + 1} is {matrix[j][i]:g}"
                    f" and row {i + 1}, column {j + 1} is {matrix[i][j]:g}",
                    "inertia",
                )
    return tuple(
        tuple(rounded((decimal(matrix[i][j]) + decimal(matrix[j][i])) / 2) for j in range(3))
        for i in range(3)
    )


def _orientation(table: Table) -> Vector:
    """The rotor, body to world."""
    given = table.table("orientation", schema.ORIENTATION)
    if table.group.dimension == 2:
        return rotor_of_angle(given.number("angle") if given.values else 0.0)
    if not given.values:
        return (1.0, 0.0, 0.0, 0.0)
    form = given.one_of("axis", "quaternion", "matrix") if not given.has("angle") else "axis"
    for other in ("quaternion", "matrix"):
        if form == "axis" and given.has(other):
            given.fail(f'"angle" and "{other}" contradict each other; give axis and angle, or one')
    if form == "axis":
        axis = given.vector("axis")
        if not any(axis):
            given.fail("must not be zero", "axis")
        return rotor_of_axis_angle(axis, given.number("angle"))
    if form == "quaternion":
        q = given.numbers("quaternion", 4, "[w, x, y, z]")
        norm = math.hypot(*q)
        if abs(norm - 1) > UNIT_TOLERANCE:
            hint = (
                f"; did you mean [{', '.join(f'{x / norm:.7g}' for x in q)}]?" if norm > 0 else ""
            )
            given.fail(f"must be a unit quaternion, but its norm is {norm:.9g}{hint}", "quaternion")
        return rotor_of_quaternion(q)
    rows = given.matrix("matrix")
    matrix = np.array(rows)
    with np.errstate(over="ignore"):
        deviation = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if not deviation <= UNIT_TOLERANCE:
        given.fail(f"must be orthogonal, but R R^T differs from 1 by {deviation:.3g}", "matrix")
    if np.linalg.det(matrix) < 0:
        given.fail("must be a rotation, but its determinant is -1: it is a reflection", "matrix")
    return rotor_of_quaternion(quaternion_of_matrix(nearest_rotation(rows)))


def _interactions(top: Table, bodies: tuple[Body, ...], most: int) -> tuple[Interaction, ...]:
    tables = top.tables("interaction")
    if len(tables) > most:
        top.fail(
            f"{len(tables)} interactions are more than the {most} allowed;"
            f" allow more with [limits] interactions = {len(tables)}"
        )
    interactions: list[Interaction] = []
    for number, values in enumerate(tables, 1):
        place = f"interaction {number}"
        kinds = tuple(schema.INTERACTIONS)
        untyped = Table(top.file, place, values, schema.UNTYPED, top.group)
        kind = untyped.choice("type", kinds, "types")
        table = Table(top.file, place, values, schema.INTERACTIONS[kind], top.group)
        table.refuse_unknown_keys()
        if kind == "gravity":
            interactions.append(Gravity(acceleration=table.vector("acceleration")))
        elif kind != "spring":
            interactions.append(Potential())
        else:
            interactions.append(_spring(table, [body.name for body in bodies]))
    return tuple(interactions)


def _spring(table: Table, bodies: list[str]) -> Spring:
    def body(key: str) -> str:
        name = table.name(key)
        if name not in bodies:
            table.fail(
                f"unknown body {quoted(name)}; bodies are {listed(bodies)}.{suggest(name, bodies)}"
            )
        return name

    near = body("body")
    anchor = other = other_at = None
    if table.one_of("anchor", "other") == "anchor":
        if table.has("other_at"):
            table.fail('"anchor" and "other_at" contradict each other; "other_at" is for "other"')
        anchor = table.vector("anchor")
    else:
        other, other_at = body("other"), table.vector("other_at")
        if other == near:
            table.fail(f'"{near}" cannot be tied to itself by a spring', "other")
    return Spring(
        body=near,
        at=table.vector("at"),
        anchor=anchor,
        other=other,
        other_at=other_at,
        stiffness=table.number("stiffness"),
        rest_length=table.number("rest_length"),
    )


def _refuse_singular_springs(top: Table, scene: Scene) -> None:
    """A spring that pushes but has no length has no direction."""
    for number, spring in enumerate(scene.interactions, 1):
        if not isinstance(spring, Spring) or spring.rest_length == 0:
            continue
        near = scene.body_of[spring.body]
        sizes = [*near.position, *spring.at, *(spring.anchor or ()), *(spring.other_at or ())]
        size = max(spring.rest_length, *map(abs, sizes))
        if float(np.linalg.norm(scene.spring_vector(spring))) <= 1e-12 * size:
            top.fail(
                f"interaction {number}: rest_length: the spring starts with length 0, where a"
                f" spring of rest length {spring.rest_length:g} pushes in no direction;"
                " move one of its ends"
            )


def _output(top: Table, end: float) -> Output:
    table = top.table("output", schema.OUTPUT, heading=True)
    if sum(map(table.has, ("every", "times", "interval"))) == 0:
        return Output()
    given = table.one_of("every", "times", "interval")
    if given == "every":
        return Output(every=table.integer("every"))
    if given == "times":
        return Output(times=table.times("times", end))
    return Output(interval=table.number("interval"))


def _time(table: Table) -> Time:
    end = table.number("end")
    if end == 0:
        table.fail("must not be 0: a run takes time, forwards or back", "end")
    step = tolerance = None
    if table.one_of("step", "tolerance") == "step":
        step = table.number("step")
        if step > abs(end):
            table.fail(f"{step:g} is longer than end = {end:g}", "step")
        if abs(Fraction(end)) > schema.MOST_STEPS * Fraction(step):
            table.fail(
                f"end / step is {abs(end) / step:.3g}; at most {schema.MOST_STEPS:.0e} steps are"
                " allowed",
                "step",
            )
    else:
        tolerance = table.number("tolerance")
    method = table.choice("method", METHOD_NAMES, "methods")
    return Time(
        end=end,
        step=step,
        tolerance=tolerance,
        method=method,
        local_tolerance=_local_tolerance(table, method) if table.has("local_tolerance") else None,
        compensated=table.flag("compensated") if table.has("compensated") else None,
    )


def _local_tolerance(table: Table, method: str) -> float:
    able = [m.name for m in METHODS if m.error_controlled]
    if table.has("tolerance"):
        table.fail("is for a run in steps; a tolerance is met by any method", "local_tolerance")
    if method not in able:
        table.fail(
            f'needs a method that chooses its steps: {", ".join(able)}; not "{method}"',
            "local_tolerance",
        )
    return table.number("local_tolerance")
