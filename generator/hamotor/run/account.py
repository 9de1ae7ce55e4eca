"""What a scene models, in words: `hamotor show SCENE`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hamotor.scene import Body, GeneralScene, Output, Scene


def account(scene: Scene | GeneralScene) -> str:
    """What is modelled, what is left out, what is conserved and how it is integrated."""
    from hamotor.scene import Scene

    return _rigid(scene) if isinstance(scene, Scene) else _general(scene)


def _general(scene: GeneralScene) -> str:
    blocks = [
        [f"{scene.name}: {scene.description}" if scene.description else scene.name],
        [f"group  {scene.group.name} in {scene.group.algebra}, {_state_size(scene)} numbers"],
    ]
    for body in scene.bodies:
        lines = [f"body {body.name}"]
        if body.mass is not None:
            lines.append(f"  mass      {float(body.mass.mass):g} kg")
        motor = zip(scene.group.motor, body.motor, strict=True)
        momentum = zip(scene.group.generators, body.momentum, strict=True)
        lines.append(f"  motor     {_named(motor)}")
        lines.append(f"  momentum  {_named(momentum)}")
        blocks.append(lines)
    blocks.append(["acting", *(f"  {line}" for line in scene.acting or ["nothing"])])
    blocks.append(["conserved", *_conserved(scene)])
    blocks.append(["left out", *(f"  {line}" for line in _not_in(scene))])
    blocks.append(["cost of an evaluation", *_cost(scene)])
    blocks += _events(scene)
    blocks += _members(scene)
    blocks.append(["time", *(f"  {line}" for line in _time(scene))])
    return "\n\n".join("\n".join(block) for block in blocks)


def _members(scene: Scene | GeneralScene) -> list[list[str]]:
    """What differs from member to member of an ensemble, where anything does."""
    from hamotor.run.sampling import numbers_each
    from hamotor.scene import Scene

    whole = isinstance(scene, Scene) and scene.draws_parameters
    ensemble = scene.general.ensemble if isinstance(scene, Scene) and whole else scene.ensemble
    lines = []
    size = len(scene.group.motor) + len(scene.group.generators)
    for body in ensemble.bodies:
        drawn = {
            "position": body.place,
            "orientation": body.turn,
            "scale": body.growth,
            "velocities": body.rates,
            "momentum": body.momenta,
        }
        name = scene.bodies[body.motor // size].name
        lines.append(f"  {name}: {', '.join(what for what, draw in drawn.items() if draw)}")
    if ensemble.parameters:
        names = ", ".join(parameter.name for parameter in ensemble.parameters)
        lines.append(f"  parameters: {names}")
    if not lines:
        return []
    return [["members differ in", *lines, f"  by {numbers_each(ensemble)} random numbers each"]]


def _cost(scene: GeneralScene) -> list[str]:
    if scene.lagrangian is not None:
        from hamotor.mechanics.legendre import LagrangianSystem

        newton = LagrangianSystem(scene.lagrangian)
        return [
            "  ∂L/∂B = μ is solved for B by Newton's method: no formula inverts it",
            f"  ∂L/∂B and ∂²L/∂B²  {newton.derivatives.cost}, in each iteration",
            f"  −dL                {newton.forque.cost}",
        ]
    system = scene.system
    lines = [
        f"  H             {system.energy.cost}",
        f"  ∂H/∂μ and dH  {system.gradient.cost}",
    ]
    if not scene.hamiltonian.conservative:
        lines.append(f"  power         {system.power.cost}")
    return lines


def _named(numbers: Iterable[tuple[str, float]]) -> str:
    shown = [f"{name} {x:.6g}" for name, x in numbers if x]
    return ", ".join(shown) or "0"


def _not_in(scene: GeneralScene) -> list[str]:
    """What the equations do not hold, so that nothing of it is computed."""
    h, space = scene.hamiltonian, scene.bodies[0].coordinates.space
    lines = []
    if not any(any(forque) for forque in h.all_forques):
        lines.append("potentials: H does not know where the bodies are")
    if not h.applied:
        lines.append("damping, thrust and control: every forque has a potential")
    if h.autonomous:
        lines.append("the time: H does not change by itself")
    if not space.scales:
        lines.append("dilation")
    lines.append("contact and friction")
    return lines


def _rigid(scene: Scene) -> str:
    blocks = [
        [f"{scene.name}: {scene.description}" if scene.description else scene.name],
        [f"group  {scene.group.name} in {scene.group.algebra}, {_state_size(scene)} numbers"],
    ]
    blocks += [_body(body) for body in scene.bodies]
    if scene.interactions:
        blocks.append(["acting"])
        blocks[-1] += [f"  {line}" for line in scene.general.acting]
    blocks.append(["conserved", *_conserved(scene)])
    blocks.append(["left out", *(f"  {line}" for line in _left_out(scene))])
    blocks += _events(scene)
    blocks += _members(scene)
    blocks.append(["time", *(f"  {line}" for line in _time(scene))])
    return "\n\n".join("\n".join(block) for block in blocks)


def _state_size(scene: Scene | GeneralScene) -> int:
    return len(scene.bodies) * (len(scene.group.motor) + len(scene.group.generators))


def _body(body: Body) -> list[str]:
    lines = [f"body {body.name}", f"  mass               {body.mass:g} kg"]
    inertia = np.asarray(body.inertia)
    off_diagonal = inertia - np.diag(np.diag(inertia))
    if off_diagonal.any():
        lines.append(f"  inertia            {_rows(inertia)} kg m^2, about the centre of mass")
    else:
        lines.append(
            f"  inertia            {_numbers(np.diag(inertia))} kg m^2, about the centre of mass"
        )
    if any(body.center_of_mass):
        lines.append(f"  centre of mass     {_numbers(body.center_of_mass)} m in the body frame")
    rotations = body.group.rotations
    rate = body.rate
    lines.append(f"  position           {_numbers(body.position)} m")
    if body.group.translates:
        lines.append(f"  velocity           {_numbers(rate[rotations:])} m/s, body frame")
    lines.append(f"  angular velocity   {_numbers(rate[:rotations])} rad/s, body frame")
    if not body.group.translates:
        lines.append("  turns about its position, which is fixed")
    return lines


def _conserved(scene: Scene | GeneralScene) -> list[str]:
    width = max(len(quantity.name) for quantity in scene.conserved)
    return [
        f"  {quantity.name.ljust(width)}  {quantity.description} ({quantity.unit})"
        for quantity in scene.conserved
    ]


def _left_out(scene: Scene) -> list[str]:
    lines = []
    if not scene.interactions:
        lines.append("potentials: nothing acts, so steps have no kick")
    if not scene.group.translates:
        lines.append("translation: the reaction at the fixed point is not computed")
    if scene.group.dimension == 2:
        lines.append("the third dimension")
    lines.append("dilation, contact, friction and damping")
    return lines


def _time(scene: Scene | GeneralScene) -> list[str]:
    time = scene.time
    lines = [f"end        {time.end:g} s"]
    if time.step is not None:
        lines.append(f"step       {time.step:g} s")
    if time.tolerance is not None:
        lines.append(f"tolerance  {time.tolerance:g}")
    if time.local_tolerance is not None:
        lines.append(f"local tol. {time.local_tolerance:g} 1/s")
    if time.compensated is not None:
        lines.append(f"sums       {'compensated' if time.compensated else 'plain'}")
    return [*lines, f"method     {time.method}", f"recorded   {_recorded(scene.output)}"]


def _recorded(output: Output) -> str:
    if output.times is not None:
        shown = ", ".join(f"{t:g}" for t in output.times[:6])
        return f"at t = {shown}{', …' if len(output.times) > 6 else ''} s"
    if output.interval is not None:
        return f"every {output.interval:g} s"
    return f"every {_ordinal(output.every)} step"


def _events(scene: Scene | GeneralScene) -> list[list[str]]:
    """What is sought on the way, a block if there is any."""
    if not scene.events:
        return []
    width = max(len(event.name) for event in scene.events)
    how = {"both": "crosses", "rising": "rises through", "falling": "falls through"}
    return [
        [
            "events",
            *(
                f"  {event.name.ljust(width)}  {event.text} {how[event.direction]} 0"
                f"{'; the run ends there' if event.stops else ''}"
                for event in scene.events
            ),
        ]
    ]


def _ordinal(number: int) -> str:
    if number == 1:
        return "single"
    if number % 100 not in {11, 12, 13}:
        ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    else:
        ending = "th"
    return f"{number}{ending}"


def _numbers(values: Iterable[float]) -> str:
    return "(" + ", ".join(f"{float(value):.6g}" for value in values) + ")"


def _rows(matrix: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    return "(" + ", ".join(_numbers(row) for row in matrix) + ")"
