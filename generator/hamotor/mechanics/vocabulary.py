"""What a Hamiltonian may speak of: momenta, places and points of bodies, parameters, the time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from hamotor.errors import UsageError
from hamotor.mechanics import language
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.hamiltonian import TIME
from hamotor.mechanics.language import Argument, Body, Function, Record, Value, Vector, Vocabulary


@dataclass(frozen=True)
class Speaker:
    """One body as an expression knows it.

    rates: its rates B, where a text may speak of them: symbols of a Lagrangian, or ∂H/∂μ.
    momenta: whether a text may speak of its momenta.
    kinetic: its kinetic energy in momenta, if it has a mass.
    """

    coordinates: Coordinates
    rates: tuple[Expr, ...] | None = None
    momenta: bool = True
    kinetic: Expr | None = None


def vocabulary(bodies: Sequence[Speaker], parameters: Mapping[str, Expr]) -> Vocabulary:
    """The words for these bodies; with one body its name may be left out everywhere.

    parameters: symbols by name. UsageError for a parameter with the name of something else.
    """
    speakers = {b.coordinates.body: b for b in bodies}
    only = next(iter(speakers)) if len(speakers) == 1 else None
    first = bodies[0].coordinates
    functions: dict[str, Function] = {}
    values: dict[str, Value] = {"t": TIME}

    def of_body(
        name: str, apply: Callable[..., Any], *arguments: Argument, shorthand: bool = True
    ) -> None:
        def applied(body: Body, *rest: Any) -> Any:
            return apply(speakers[body.name], *rest)

        functions[name] = Function((language.body("BODY", only), *arguments), applied)
        if only is not None and shorthand and not arguments:
            values[name] = apply(speakers[only])

    point = language.coordinates(*"xyzw"[: first.dimension])
    constants = set(parameters.values())
    of_body("at", lambda b, a: Vector(_point(b.coordinates, tuple(a), constants)), point)
    of_body("position", lambda b: Vector(b.coordinates.position))
    if first.space.affine:
        of_body("direction", lambda b, n: Vector(b.coordinates.turned(tuple(n))), point)
        of_body("to_body", lambda b, n: Vector(b.coordinates.turned_back(tuple(n))), point)
        if first.space.scales:
            of_body("scale", lambda b: b.coordinates.scale)
    motor = [c.name for c in first.group.element.components]
    of_body("motor", lambda b: _record(motor, b.coordinates.motor), shorthand=False)
    generators = [g.name for g in first.group.generators]
    kinds = []
    if all(b.momenta for b in bodies):
        of_body("momentum", lambda b: _record(generators, b.coordinates.momenta), shorthand=False)
        kinds.append(("Pi", "P", lambda b: b.coordinates.momenta))
    if all(b.rates is not None for b in bodies):
        of_body("rate", lambda b: _record(generators, b.rates), shorthand=False)
        kinds.append(("Omega", "V", lambda b: b.rates))
        if first.space.affine:
            of_body("velocity", _velocity, point)
    turning, moving = _parts(first)
    for angular, linear, numbers in kinds:
        if turning:
            of_body(angular, lambda b, n=numbers: _vector([n(b)[i] for i in turning]))
        if moving:
            of_body(linear, lambda b, n=numbers: _vector([n(b)[i] for i in moving]))
    if all(b.kinetic is not None for b in bodies):
        of_body("kinetic", lambda b: b.kinetic)
    for name in speakers:
        if name in values or name == "pi":
            raise UsageError(f'the body "{name}" has the name of something else; rename it')
    for name, symbol in parameters.items():
        if name in values or name in functions or name in speakers or name == "pi":
            raise UsageError(f'the parameter "{name}" has the name of something else; rename it')
        values[name] = symbol
    return Vocabulary(values, tuple(speakers), functions)


def _record(names: Sequence[str], numbers: Sequence[Expr] | None) -> Record:
    return Record(dict(zip(names, numbers or (), strict=True)))


def _vector(numbers: list[Expr]) -> Vector | Expr:
    return numbers[0] if len(numbers) == 1 else Vector(tuple(numbers))


def _parts(body: Coordinates) -> tuple[list[int], list[int]]:
    """Which generators turn about e1, e2, e3 (or in the plane), and which move along e1, e2, …"""
    space = body.space
    turning, moving = [], []
    for i, (velocity, turn, growth) in enumerate(
        zip(space.velocities, space.turns, space.growths, strict=True)
    ):
        if any(velocity) and not any(map(any, turn)):
            moving.append(i)
        elif not any(velocity) and not growth and any(map(any, turn)):
            turning.append(i)
    in_order = len(moving) in (0, space_size := body.dimension)
    whole = len(turning) == {2: 1, 3: 3}.get(space_size)
    return (turning if whole else []), (moving if in_order else [])


def _point(body: Coordinates, place: tuple[Expr, ...], constants: set[Expr]) -> tuple[Expr, ...]:
    if all(x.free_symbols <= constants for x in place):
        return body.at(place)
    if not body.space.affine:
        raise UsageError("at(…) takes constants and parameters on this group")
    turned = body.turned(place)
    return tuple(x + body.scale * y for x, y in zip(body.position, turned, strict=True))


def _velocity(body: Speaker, place: Vector) -> Vector:
    """ẏ = s R ξ_B(a), in the world, m/s."""
    coordinates = body.coordinates
    space = coordinates.space
    a = tuple(place)
    moved = [sympy.Integer(0)] * coordinates.dimension
    for rate, velocity, turn, growth in zip(
        body.rates or (), space.velocities, space.turns, space.growths, strict=True
    ):
        for j in range(coordinates.dimension):
            moved[j] += rate * (
                velocity[j] + sum(turn[j][k] * a[k] for k in range(len(a))) + growth * a[j]
            )
    return Vector(tuple(coordinates.scale * x for x in coordinates.turned(tuple(moved))))
