"""The C++ text of a scene's motion as ẋ = f(x), and of the recurrence for its Taylor series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from hamotor.codegen import cpp
from hamotor.codegen.program import Program, renamed
from hamotor.codegen.taylor import PACK, NotAnalytic, PackedTerm, Quadratic, steps
from hamotor.errors import UsageError
from hamotor.mechanics.flow import WORK, Flow, cheapest, leanest
from hamotor.mechanics.system import System
from hamotor.scene.source import rendered


def required(system: System, scene: str, *, by_name: bool) -> str:
    """The type `Recurrence` of this system of a scene.  UsageError where it is not analytic.

    by_name: motors and momenta have their components by index only (generic kernels).
    """
    try:
        return recurrence_text(system, by_name=by_name)
    except NotAnalytic as error:
        raise refusal(scene, f"H or what is applied holds {error}") from error


def refusal(scene: str, reason: str) -> UsageError:
    """Why a scene has no Taylor series."""
    return UsageError(
        f'{scene}: method "taylor" needs a motion in analytic formulas, but {reason}; use rk54'
    )


def recurrence_text(system: System, *, by_name: bool) -> str:
    """The same; NotAnalytic where the motion has no Taylor series everywhere."""
    flow, expansion, packed = cheapest(system)
    order = packed.order if packed else tuple(range(len(flow.coordinates)))
    # Where packs want them; `x[i]` is renamed everywhere.
    places = {f"x[{old}]": f"x[{new}]" for new, old in enumerate(order)}
    programs = steps(
        replace(expansion, derivatives=tuple(expansion.derivatives[old] for old in order))
    )
    padding = -len(order) % PACK
    return rendered(
        "taylor.hpp.jinja",
        **_coordinates(system, flow, order, by_name=by_name),
        follows=["true" if old >= flow.independent else "false" for old in order]
        + ["false"] * padding,
        lanes=len(expansion.lanes),
        known=programs.known,
        refresh=_text(renamed(flow.refresh, places)),
        first=_text(programs.first),
        next=_text(programs.next),
        packed=_packed(packed, padding) if packed else None,
    )


def field_text(system: System) -> str:
    """The type `Field` of a system: its motion in the coordinates with the fewest operations."""
    _, flow = leanest(system)
    order = range(len(flow.coordinates))
    given = _coordinates(system, flow, order, by_name=False)
    padding = len(given["parts"]) - len(order)
    places = {name: f"x[{i}]" for i, name in enumerate(flow.coordinates)}
    rates = renamed(flow.field, places)
    weight = {"motor": "1", "place": "0.5", "momentum": "0"}
    return rendered(
        "field.hpp.jinja",
        **given,
        numbers=len(order),
        time=flow.coordinates.index("t") if "t" in flow.coordinates else None,
        held=[
            (k, n, place)
            for k, body in enumerate(given["bodies"])
            for n, place in enumerate(body["coordinates"])
            if place is not None
        ],
        weights=[
            *("0" if kind is None else weight[kind[1]] for kind in flow.kinds),
            *["0"] * padding,
        ],
        rates=_text(
            replace(
                rates,
                outputs=tuple((f"change[{i}]", x) for i, (_, x) in enumerate(rates.outputs)),
            )
        ),
    )


def _coordinates(
    system: System, flow: Flow, order: Sequence[int], *, by_name: bool
) -> dict[str, Any]:
    """What both texts say of coordinates, in this order: `coordinates.hpp.jinja`."""
    places = {f"x[{old}]": f"x[{new}]" for new, old in enumerate(order)}
    names = [flow.coordinates[old] for old in order]
    leave = renamed(flow.leave, places)
    entered = dict(renamed(flow.enter, places).outputs)
    padding = -len(names) % PACK
    bodies = []
    for k, body in enumerate(system.hamiltonian.bodies):
        motor = [f"m{k}.{c.name}" for c in body.group.element.components]
        momentum = [f"mu{k}.{g.momentum}" for g in body.group.generators]
        bodies.append(
            {
                "motor": [_output(leave, name) for name in motor],
                "momentum": [_output(leave, name) for name in momentum],
                "coordinates": [names.index(name) if name in names else None for name in motor],
            }
        )
    return {
        "by_name": by_name,
        "bodies": bodies,
        "coordinates": len(names) + padding,
        "parts": [*(flow.parts[old] for old in order), *[-1] * padding],
        "work": names.index(WORK) if WORK in names else None,
        "enter": _text(
            replace(
                flow.enter,
                outputs=tuple((f"x[{i}]", entered[f"x[{i}]"]) for i in range(len(names))),
            )
        ),
        "leave": _text(leave),
    }


def _packed(field: Quadratic, padding: int) -> dict[str, Any]:
    """A quadratic field as tables."""

    def table(terms: tuple[PackedTerm, ...]) -> list[dict[str, Any]]:
        return [
            {
                "pack": t.pack,
                "left": t.left,
                "right": t.right,
                "weights": [cpp.number_text(x) for x in t.weights],
            }
            for t in terms
        ]

    return {
        "packs": field.packs,
        "products": table(field.products),
        "fixed": table(field.fixed),
        "linear": table(field.linear),
        "constants": [*map(cpp.number_text, field.constants), *["S(0)"] * padding],
    }


def _output(program: Program, name: str) -> str:
    return cpp.expression_text(dict(program.outputs)[name])


def _text(program: Program) -> dict[str, Any]:
    return {
        "lines": cpp.binding_lines(program),
        "outputs": [(name, cpp.expression_text(x)) for name, x in program.outputs],
        "used": cpp.used_names(program) | {x.split("[")[0] for x in cpp.used_names(program)},
        "cost": str(program.cost),
    }
