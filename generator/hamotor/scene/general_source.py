"""The C++ source of a general scene: its Hamiltonian's programs as a system of the runtime."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from hamotor.codegen import cpp
from hamotor.codegen.algebra import Blade, Rational
from hamotor.codegen.element import Element
from hamotor.codegen.program import Number, Program
from hamotor.errors import UsageError
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.lagrangian import Lagrangian
from hamotor.mechanics.legendre import LagrangianSystem
from hamotor.mechanics.parts import Part, energy_text, is_exact, motion, rate_of
from hamotor.mechanics.proof import prove_energy_balance
from hamotor.mechanics.straightline import straight_line
from hamotor.mechanics.system import System
from hamotor.scene.conserved import ConservedQuantity
from hamotor.scene.general import GeneralScene
from hamotor.scene.invariants import invariants
from hamotor.scene.methods import IN_COORDINATES, SERIES
from hamotor.scene.model import Scene
from hamotor.scene.scalars import Scalar
from hamotor.scene.source import literal_text, needs, rendered, shortened, text_literal
from hamotor.scene.taylor_source import field_text, refusal, required


@dataclass(frozen=True)
class ProgramText:
    """A program as the template wants it."""

    program: Program

    @property
    def lines(self) -> list[str]:
        """Its bindings."""
        return cpp.binding_lines(self.program)

    @property
    def used(self) -> set[str]:
        """What it reads."""
        return cpp.used_names(self.program)

    @property
    def cost(self) -> str:
        """Its operations."""
        return str(self.program.cost)

    @property
    def value(self) -> str:
        """Its outputs, in order."""
        return ", ".join(cpp.expression_text(x) for _, x in self.program.outputs)

    def outputs(self, prefix: str, bodies: int) -> list[list[str]]:
        """The outputs called `prefix0.…`, `prefix1.…`, a list for each body."""
        return [
            [
                cpp.expression_text(x)
                for name, x in self.program.outputs
                if name.startswith(f"{prefix}{k}.")
            ]
            for k in range(bodies)
        ]


def general_source(
    whole: Scene | GeneralScene,
    kernels: str,
    scalar: Scalar,
    method: str | None = None,
    *,
    drawn: bool = False,
) -> str:
    """The text of the C++ file that defines a scene over the runtime's headers.

    kernels: `generated`, or `generic`: products by table, of dense multivectors, or `sparse`: by
    the part of the table that the operands' types can need.
    method: the one that it is for.
    drawn: the parameters that members differ in stay variables of the system.

    ValueError if its programs are not those of its Hamiltonian: a defect of ours.
    """
    scene = whole if isinstance(whole, GeneralScene) else whole.general
    system = System(scene.hamiltonian, scene.drawn) if drawn else scene.system
    kept = invariants(scene, system) if drawn else conserved_by(whole)
    first = scene.bodies[0].coordinates
    by_name = kernels != "generated"
    group_type = f"hamotor::{scene.algebra}::{scene.group.name}"
    if by_name:
        group_type = "hamotor::generic::Group<Tables>"
    if scene.lagrangian is not None:
        own_system = _lagrangian(scene.lagrangian, group_type, by_name)
    else:
        own_system = _hamiltonian(scene, system)
        own_system["inertial"] = None if by_name else _inertial(scene, system)
        split = not (drawn and scene.draws_rates)
        own_system["parts"] = _parts(scene, system, by_name) if split else None
    place = [*(first.position if first.space.affine else first.at((0,) * first.dimension))]
    names = [f"position.{axis}" for axis in "xyzw"[: first.dimension]]
    units = ["m"] * first.dimension
    if first.space.affine and first.space.scales:
        place, names, units = [*place, first.scale], [*names, "scale"], [*units, "1"]
    pivots = None
    if not first.space.translates:
        pivots = [
            ", ".join(cpp.number_text(Fraction(int(x.p), int(x.q))) for x in b.coordinates.origin)
            for b in scene.bodies
        ]
    own = [(q, x) for q, x in kept if x is not None and not has_column(scene, q.name)]
    if drawn:
        _refuse_drawn(scene, method, [x for _, x in own])
    return rendered(
        "general_scene.cpp.jinja",
        scene=scene,
        kernels=kernels,
        scalar=scalar,
        tables=_tables(first) if by_name else None,
        headers=scene.headers,
        header=f"hamotor/{scene.algebra}/{scene.group.name.lower()}.hpp",
        algebra=scene.algebra,
        group=scene.group.name,
        group_type=group_type,
        bodies=[text_literal(body.name) for body in scene.bodies],
        **own_system,
        parameters=[
            (text_literal(s.name), f"S({literal_text(float(scene.hamiltonian.parameters[s]))})")
            for s in system.drawn
        ],
        recurrence=_recurrence(scene, method, by_name),
        field=None if by_name or drawn else _field(scene, method),
        identity=", ".join("1" if name == "s" else "0" for name in scene.group.motor),
        motor_units=[text_literal(motor_unit(scene, name)) for name in scene.group.motor],
        momentum_units=[text_literal(unit) for unit in scene.group.units],
        place_names=[text_literal(name) for name in names],
        place_units=[text_literal(unit) for unit in units],
        place=ProgramText(
            straight_line(
                {f"value{k}": x for k, x in enumerate(place)},
                {
                    s: f"m0.{c.name}"
                    for s, c in zip(first.motor, first.group.element.components, strict=True)
                },
                system.stages_of(first, 0),
            )
        ),
        pivots=pivots,
        scales=len(names) > first.dimension,
        quantities=_quantities(system, [x for _, x in own]),
        events=events_text(scene),
        conserved=[conserved_entry(scene, q, own) for q, _ in kept],
    )


def _refuse_drawn(scene: GeneralScene, method: str | None, own: Sequence[Any]) -> None:
    """UsageError where members cannot have parameters of their own."""
    why = ""
    if scene.lagrangian is not None:
        why = "the rates of its Lagrangian are found by Newton's method"
    elif needs(method, SERIES):
        why = "taylor's recurrence has them as numbers"
    elif any(set(scene.drawn) & x.free_symbols for x in own):
        why = "what the scene conserves depends on them"
    if why:
        names = ", ".join(symbol.name for symbol in scene.drawn)
        raise UsageError(f"{scene.name}: {names} cannot be drawn: {why}.")


def conserved_by(scene: Scene | GeneralScene) -> list[tuple[ConservedQuantity, Any]]:
    """What a run of the scene reports as conserved; and each over the momenta, where it is."""
    if isinstance(scene, GeneralScene):
        return list(scene.invariants)
    formulas = {q.name: x for q, x in scene.general.invariants}
    return [(q, formulas[q.name]) for q in scene.conserved]


def _tables(body: Coordinates) -> dict[str, Any]:
    """A group as numbers: its metric, and how its types lie in the multivectors."""
    group = body.group

    def layout(element: Element) -> dict[str, Any]:
        embeddings = [component.embedding for component in element.components]
        return {
            "names": [text_literal(c.name) for c in element.components],
            "members": [c.name for c in element.components],
            "embedding": _entries(embeddings),
            "reading": _entries(element.reading),
        }

    return {
        "gram": [[literal_text(float(x)) for x in row] for row in body.algebra.gram],
        "generators": [text_literal(g.name) for g in group.generators],
        "element": layout(group.element),
        "rate": layout(group.rate),
        "momentum": layout(group.momentum),
    }


def _entries(rows: Sequence[Mapping[Blade, Rational]]) -> list[str]:
    return [
        f"hamotor::generic::Entry{{{k}, {blade}, {literal_text(float(x))}}}"
        for k, row in enumerate(rows)
        for blade, x in row.items()
    ]


def _hamiltonian(scene: GeneralScene, system: System) -> dict[str, Any]:
    """The system of an H in formulas, for the template; proved with its parameters as numbers."""
    count = len(scene.bodies)
    prove_energy_balance(scene.system)
    gradient = ProgramText(system.gradient)
    forques = [x for name, x in system.gradient.outputs if name.startswith("forque")]
    return {
        "lagrangian": None,
        "hamiltonian": shortened(str(scene.hamiltonian.energy)),
        "has_forque": any(x != Number(0) for x in forques),
        "energy": ProgramText(system.energy),
        "gradient": {
            "cost": gradient.cost,
            "lines": gradient.lines,
            "used": gradient.used,
            "rates": gradient.outputs("rate", count),
            "forques": gradient.outputs("forque", count),
        },
        "power": None if scene.hamiltonian.conservative else ProgramText(system.power),
    }


def _inertial(scene: GeneralScene, system: System) -> dict[str, Any] | None:
    """[μ, B] without what vanishes in it, for the template; None where all of it stays.

    By tables it stays as it is: they are to compare with.
    """
    if system.inertial is None:
        return None
    program = ProgramText(system.inertial)
    velocities = {
        f"rate{k}.{g.rate}"
        for k, body in enumerate(scene.bodies)
        for g, length in zip(body.coordinates.group.generators, scene.group.lengths, strict=True)
        if length
    }
    return {
        "program": program,
        "outputs": program.outputs("inertial", len(scene.bodies)),
        "along": velocities.isdisjoint(program.used),
    }


def _parts(scene: GeneralScene, system: System, by_name: bool) -> dict[str, Any] | None:
    """The known motions of a kinetic energy, for the template; by_name: by the group's own exp."""
    if scene.parts is None:
        return None
    count = len(scene.bodies)
    rate, forque = ProgramText(system.rate), ProgramText(system.forque)
    flows: list[dict[str, Any]] = []
    steps = []
    for k, sets in enumerate(scene.parts):
        calls: list[tuple[str, str]] = []
        for together in sets:
            names = []
            for part in together:
                flows.append(_flow(system, k, part, f"flow_{len(flows)}", by_name))
                names.append(flows[-1]["name"])
            *outer, inner = names
            calls += [
                *((name, "half") for name in outer),
                (inner, "h"),
                *((name, "half") for name in reversed(outer)),
            ]
        steps.append(calls)
    return {
        "exact": is_exact(scene.parts),
        "rate": {"program": rate, "outputs": rate.outputs("rate", count)},
        "forque": {"program": forque, "outputs": forque.outputs("forque", count)},
        "flows": flows,
        "steps": steps,
    }


def _flow(system: System, k: int, part: Part, name: str, by_name: bool) -> dict[str, Any]:
    """One part, for the template."""
    program = None if by_name else motion(system, k, part)
    text = ProgramText(rate_of(system, k, part) if program is None else program)
    outputs = None
    if program is not None:
        outputs = {
            kind: [cpp.expression_text(x) for n, x in program.outputs if n.startswith(f"{kind}.")]
            for kind in ("motor", "momentum")
        }
    return {
        "name": name,
        "body": k,
        "energy": energy_text(part),
        "program": text,
        "motor_is_read": f"m{k}" in text.used,
        "outputs": outputs,
    }


def _recurrence(scene: GeneralScene, method: str | None, by_name: bool) -> str | None:
    """The recurrence for Taylor coefficients, for the method that needs it."""
    if not needs(method, SERIES):
        return None
    if scene.lagrangian is not None:
        raise refusal(scene.name, "the rates of this Lagrangian are found by Newton's method")
    return required(scene.system, scene.name, by_name=by_name)


def _field(scene: GeneralScene, method: str | None) -> str | None:
    """The motion as an ordinary differential equation, for methods that step it as one."""
    if not needs(method, *IN_COORDINATES) or scene.lagrangian is not None:
        return None
    return field_text(scene.system)


def _lagrangian(lagrangian: Lagrangian, group_type: str, by_name: bool) -> dict[str, Any]:
    """The system of an L whose rates are found by Newton's method, for the template."""
    values = LagrangianSystem(lagrangian).template_values()
    text = rendered("lagrangian.cpp.jinja", group_type=group_type, by_name=by_name, **values)
    return {"lagrangian": text, "parts": None, "inertial": None}


def motor_unit(scene: GeneralScene, blade: str) -> str:
    """Lengths: e0 in a projective algebra, e∞ in a conformal one, where e0 is 1/length."""
    if scene.algebra.startswith("pga"):
        return "m" if "0" in blade else "1"
    if scene.algebra.startswith("cga"):
        power = ("i" in blade) - ("0" in blade)
        return {1: "m", 0: "1", -1: "1/m"}[power]
    return "1"


def has_column(scene: GeneralScene, name: str) -> bool:
    """Whether it is one component of a body's momentum."""
    return any(
        name == f"{b.name}.momentum.{g}" for b in scene.bodies for g in scene.group.generators
    )


def events_text(scene: GeneralScene) -> dict[str, Any] | None:
    """What the templates want of a scene's events; their functions over users' motors."""
    if not scene.events:
        return None
    values = {f"value{k}": event.expression for k, event in enumerate(scene.events)}
    return {
        "program": ProgramText(scene.system.of(values)),
        "list": [
            {
                "name": text_literal(event.name),
                "direction": event.direction,
                "stops": "true" if event.stops else "false",
                "text": shortened(event.text),
            }
            for event in scene.events
        ],
    }


def _quantities(system: System, expressions: Sequence[Any]) -> dict[str, Any] | None:
    if not expressions:
        return None
    body = ProgramText(system.of({f"value{k}": x for k, x in enumerate(expressions)}))
    return {
        "count": len(expressions),
        "lines": body.lines,
        "used": body.used,
        "value": body.value,
    }


def conserved_entry(scene: GeneralScene, quantity: Any, own: Sequence[Any]) -> dict[str, Any]:
    """What the template wants of a conserved quantity; own: those that the scene computes."""
    coefficients = dict(quantity.coefficients)
    names = [body.name for body in scene.bodies]
    indices = [q.name for q, _ in own]
    is_own = quantity.name in indices
    kind = "own" if is_own else "momentum" if quantity.body else quantity.name.split(".", 1)[0]
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
        "index": indices.index(quantity.name) if is_own else 0,
    }
