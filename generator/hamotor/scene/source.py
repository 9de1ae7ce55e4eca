"""The C++ source of a scene: constants and types over the runtime, compiled to the C ABI."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hamotor.errors import UsageError, suggest
from hamotor.scene.conserved import ConservedQuantity
from hamotor.scene.exact import decimal
from hamotor.scene.general import GeneralScene
from hamotor.scene.methods import IN_COORDINATES, SERIES
from hamotor.scene.model import Body, Scene
from hamotor.scene.motors import Vector
from hamotor.scene.scalars import Scalar, parse_scalar

TEMPLATES = Path(__file__).resolve().parents[3] / "templates"
KERNELS = ("generated", "generic", "sparse")
SMALLEST_FLOAT, LARGEST_FLOAT = 1e-18, 1e18
"""Masses and moments beyond these have products that overflow in single precision."""
INLINED_FORQUE = 256
"""Forques of so many operations become part of every stage of a step of packs (a quarter less time
of a magnet's 145); of more, what they cost hides the call, and compiling takes twice as long."""


def scene_source(
    scene: Scene | GeneralScene,
    kernels: str = "generated",
    scalar: str = "double",
    method: str | None = None,
    form: str = "own",
) -> str:
    """The text of the C++ file that defines `scene` over the runtime's headers.

    method: the one that it is for, or several, one space apart; those of `SERIES` and
        `IN_COORDINATES` have texts of their own, which nothing else needs.
    form: "drawn": what [[ensemble.parameter]] draws stays variable, and the form is the general
        one.
    Deterministic: equal arguments give equal text. UsageError for unknown kernels or scalars, and
    for numbers that do not fit the scalar.
    """
    if kernels not in KERNELS:
        raise UsageError(
            f'unknown kernels "{kernels}"; there is {", ".join(KERNELS)}.'
            f"{suggest(kernels, KERNELS)}"
        )
    numbers = parse_scalar(scalar)
    if not isinstance(scene, Scene) or kernels != "generated" or form == "drawn":
        from hamotor.scene.general_source import general_source

        return general_source(scene, kernels, numbers, method, drawn=form == "drawn")
    if scalar == "float":
        _refuse_numbers_beyond_float(scene)
    return rendered(
        "scene.cpp.jinja",
        scene=scene,
        kernels=kernels,
        scalar=numbers,
        header=f"hamotor/{scene.algebra}/{scene.group.name.lower()}.hpp",
        bodies=[_body(scene, body, numbers) for body in scene.bodies],
        interactions=_interactions(scene, numbers),
        potential=_potential(scene),
        conserved=[_conserved(scene, quantity) for quantity in scene.conserved],
        recurrence=_recurrence(scene) if needs(method, SERIES) else None,
        field=_field(scene) if needs(method, *IN_COORDINATES) else None,
        events=_events(scene),
    )


def needs(method: str | None, *names: str) -> bool:
    """Whether a source is for one of these methods."""
    return not set(names).isdisjoint((method or "").split())


def _recurrence(scene: Scene) -> str:
    """The recurrence for Taylor coefficients.  UsageError where the motion is not analytic."""
    from hamotor.scene.principal_system import principal_system
    from hamotor.scene.taylor_source import required

    return required(principal_system(scene), scene.name, by_name=False)


def _field(scene: Scene) -> str:
    """The motion as an ordinary differential equation in the cheapest coordinates."""
    from hamotor.scene.principal_system import principal_system
    from hamotor.scene.taylor_source import field_text

    return field_text(principal_system(scene))


def rendered(template: str, **values: Any) -> str:
    """The text of a template with these values; a missing value is an error."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    return environment.get_template(template).render(**values)


def _refuse_numbers_beyond_float(scene: Scene) -> None:
    for body in scene.bodies:
        for what, x in [("mass", body.mass), *(("moment", x) for x in body.principal.moments)]:
            if not SMALLEST_FLOAT <= x <= LARGEST_FLOAT:
                raise UsageError(
                    f'{scene.name}: body "{body.name}": the {what} {x:g} is too'
                    f" {'large' if x > 1 else 'small'} for float; compile for double"
                )


def literal_text(x: float) -> str:
    """`x` as a C++ literal of type double."""
    return DOUBLE.literal(x)


DOUBLE = Scalar("double")


def _literals(values: Sequence[float], scalar: Scalar) -> str:
    return ", ".join(map(scalar.literal, values))


def text_literal(text: str) -> str:
    """`text` as a C++ string literal."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _body(scene: Scene, body: Body, scalar: Scalar) -> dict[str, Any]:
    frame = body.principal
    forced = _where_forces_act(scene, body)
    arguments = [scalar.literal(body.mass), f"{body.name}_moments"]
    if not body.group.translates:
        center = frame.from_body_frame(body.center_of_mass)
        arguments += [f"{{{_literals(point, scalar)}}}" for point in (center, body.position)]
    return {
        "name": body.name,
        "type": "FreeBody" if body.group.translates else "PivotedBody",
        "is_principal": frame.is_body_frame,
        "moments": list(map(scalar.literal, frame.moments)),
        "order": list(map(literal_text, _told_apart(frame.moments))),
        "frame": _literals(frame.motor, scalar),
        "arguments": arguments,
        "forced": [", ".join(map(literal_text, map(float, point))) for point in forced],
    }


def _told_apart(moments: Sequence[float]) -> list[float]:
    """Doubles of moments: equal where these are, and nowhere else."""
    found: list[float] = []
    for k, x in enumerate(moments):
        y = float(x)
        while any(y == z and decimal(x) != decimal(moments[n]) for n, z in enumerate(found[:k])):
            y = math.nextafter(y, math.inf)
        found.append(y)
    return found


def _where_forces_act(scene: Scene, body: Body) -> list[Vector]:
    """The points of the principal frame, beside its origin, where forces act on a body in space.

    None are given where they are not known.
    """
    if scene.group.dimension != 3 or scene.potential is not None:
        return []
    points = [spring.at for spring in scene.springs if spring.body == body.name]
    points += [spring.other_at or () for spring in scene.springs if spring.other == body.name]
    if scene.gravity is not None and not body.group.translates:
        points.append(body.center_of_mass)
    return [body.principal.from_body_frame(point) for point in points]


def _potential(scene: Scene) -> dict[str, Any] | None:
    """Everything that acts on places and is no gravity and no spring: one potential."""
    if scene.potential is None:
        return None
    from hamotor.codegen import cpp
    from hamotor.codegen.program import Number, Program
    from hamotor.mechanics.system import System

    system = System(scene.potential)

    def text_of(program: Program) -> dict[str, Any]:
        used = cpp.used_names(program)
        return {
            "bodies": [k for k in range(len(scene.bodies)) if f"m{k}" in used],
            "lines": cpp.binding_lines(program),
            "cost": str(program.cost),
            "is_inlined": program.cost.total <= INLINED_FORQUE,
        }

    components: dict[int, list[str]] = {}
    acts: set[int] = set()
    for name, expression in system.forque.outputs:
        k = int(name.removeprefix("forque").split(".")[0])
        components.setdefault(k, []).append(cpp.expression_text(expression))
        if expression != Number(0):
            acts.add(k)
    value = cpp.expression_text(system.energy.outputs[0][1])
    return {
        "text": shortened(str(scene.potential.energy)),
        "energy": {**text_of(system.energy), "value": value},
        "forque": {**text_of(system.forque), "outputs": [(k, components[k]) for k in sorted(acts)]},
    }


def _events(scene: Scene) -> dict[str, Any] | None:
    if not scene.has_events:
        return None
    from hamotor.scene.general_source import events_text

    return events_text(scene.general)


def shortened(text: str) -> str:
    """Text for a comment, of bearable length."""
    return text if len(text) <= 400 else f"{text[:397]}..."


def _interactions(scene: Scene, scalar: Scalar) -> list[dict[str, Any]]:
    interactions = []
    if scene.gravity is not None:
        interactions.append(
            {
                "type": "UniformGravity<Group, Scalar>",
                "members": [f".acceleration = {{{_literals(scene.gravity, scalar)}}}"],
            }
        )
    number = {body.name: k for k, body in enumerate(scene.bodies)}

    def attached(name: str, at: Sequence[float]) -> str:
        return f"{{{_literals(scene.body_of[name].principal.from_body_frame(at), scalar)}}}"

    for spring in scene.springs:
        slack = "zero" if spring.rest_length == 0 else "positive"
        common = f"Group, Scalar, hamotor::RestLength::{slack}"
        near = attached(spring.body, spring.at)
        if spring.other is None:
            at_origin = scene.group.translates and not any(spring.anchor or ())
            anchor = "" if at_origin else _literals(spring.anchor or (), scalar)
            if at_origin:
                common += ", typename hamotor::Space<Group>::template Origin<Scalar>"
            kind = f"SpringToWorld<{number[spring.body]}, {common}>"
            ends = [f".at = {near}", f".anchor = {{{anchor}}}"]
        else:
            kind = f"SpringBetween<{number[spring.body]}, {number[spring.other]}, {common}>"
            far = attached(spring.other, spring.other_at or ())
            ends = [f".at_one = {near}", f".at_two = {far}"]
        interactions.append(
            {
                "type": kind,
                "members": [
                    *ends,
                    f".stiffness = {scalar.literal(spring.stiffness)}",
                    f".rest_length = {scalar.literal(spring.rest_length)}",
                ],
            }
        )
    return interactions


def _conserved(scene: Scene, quantity: ConservedQuantity) -> dict[str, Any]:
    kind = quantity.name.split(".", 1)[0]
    if quantity.body:
        kind = "momentum" if ".momentum." in quantity.name else quantity.name.rsplit(".", 1)[-1]
    coefficients = dict(quantity.coefficients)
    names = [body.name for body in scene.bodies]
    return {
        "kind": kind,
        "name": text_literal(quantity.name),
        "unit": text_literal(quantity.unit),
        "description": text_literal(quantity.description),
        "body": names.index(quantity.body) if quantity.body else 0,
        "coefficients": [literal_text(coefficients.get(g, 0.0)) for g in scene.group.generators]
        if coefficients
        else [],
        "norm": [text_literal(column) for column in quantity.norm],
        "scale": literal_text(quantity.scale),
    }
