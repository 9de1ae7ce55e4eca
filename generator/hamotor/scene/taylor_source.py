"""The C++ text of the recurrence for a scene's Taylor coefficients."""

from __future__ import annotations

from typing import Any

from hamotor.codegen import cpp
from hamotor.codegen.program import Program
from hamotor.codegen.taylor import NotAnalytic, steps
from hamotor.errors import UsageError
from hamotor.mechanics.flow import WORK, cheapest
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
        f'{scene}: method "taylor" needs a motion in analytic formulas, but {reason}; use rkmk54'
    )


def recurrence_text(system: System, *, by_name: bool) -> str:
    """The same; NotAnalytic where the motion has no Taylor series everywhere."""
    flow, expansion = cheapest(system)
    programs = steps(expansion)
    h = system.hamiltonian
    bodies = []
    for k, body in enumerate(h.bodies):
        motor = [f"m{k}.{c.name}" for c in body.group.element.components]
        momentum = [f"mu{k}.{g.momentum}" for g in body.group.generators]
        bodies.append(
            {
                "motor": [_output(flow.leave, name) for name in motor],
                "momentum": [_output(flow.leave, name) for name in momentum],
                "coordinates": [
                    flow.coordinates.index(name) if name in flow.coordinates else None
                    for name in motor
                ],
            }
        )
    return rendered(
        "taylor.hpp.jinja",
        by_name=by_name,
        bodies=bodies,
        coordinates=len(flow.coordinates),
        parts=flow.parts,
        independent=flow.independent,
        refresh=_text(flow.refresh),
        work=flow.coordinates.index(WORK) if WORK in flow.coordinates else None,
        lanes=len(expansion.lanes),
        known=programs.known,
        enter=_text(flow.enter),
        leave=_text(flow.leave),
        first=_text(programs.first),
        next=_text(programs.next),
    )


def _output(program: Program, name: str) -> str:
    return cpp.expression_text(dict(program.outputs)[name])


def _text(program: Program) -> dict[str, Any]:
    return {
        "lines": cpp.binding_lines(program),
        "outputs": [(name, cpp.expression_text(x)) for name, x in program.outputs],
        "used": cpp.used_names(program) | {x.split("[")[0] for x in cpp.used_names(program)},
        "cost": str(program.cost),
    }
