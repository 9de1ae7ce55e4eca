"""Where a run ends, whoever made it, and how far from another end: errors in their units."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hamotor.run.attitude import has_attitude, rotation_matrices
from hamotor.run.library import Description
from hamotor.scene import Scene
from hamotor.scene.motors import rotation_matrix

Wide = NDArray[Any]
"""Long doubles, or fractions that hold all digits of a number."""
Endpoint = Mapping[str, Wide]
"""By quantity with its unit: attitudes (bodies, d, d), everything else (bodies, components)."""
Number = Callable[[Any], Any]
"""`np.longdouble` or `Fraction`, of doubles or decimals."""

ATTITUDE, POSITION, ENERGY = "attitude (rad)", "position (m)", "energy (J)"


def of_row(
    description: Description, row: Sequence[Any] | NDArray[Any], number: Number = np.longdouble
) -> Endpoint:
    """The end that a scene's row of columns holds."""
    values = np.array([number(value) for value in row])
    index = description.column_index
    found: dict[str, Any] = {}
    for body in description.bodies:
        if has_attitude(description.algebra, description.motor) and turns(description.motor):
            motor = {b: values[[index[f"{body}.motor.{b}"]]] for b in description.motor}
            found.setdefault(ATTITUDE, []).append(rotation_matrices(motor)[0])
        found.setdefault(POSITION, []).append(values[description.position_columns(body)])
        by_unit: dict[str, list[Any]] = {}
        for name in description.momentum:
            column = index[f"{body}.momentum.{name}"]
            by_unit.setdefault(description.columns[column].unit, []).append(values[column])
        for unit, components in by_unit.items():
            found.setdefault(f"momentum ({unit})", []).append(components)
    found[ENERGY] = [[values[index["energy"]]]]
    return {name: np.array(value) for name, value in found.items()}


def turns(blades: Sequence[str]) -> bool:
    """Whether motors with these blades turn anything: translations alone keep every attitude."""
    return sum(not set(blade) & {"0", "i"} for blade in blades) > 1


def of_quaternion(
    scene: Scene, state: Sequence[Any], energy: Any = None, number: Number = np.longdouble
) -> Endpoint:
    """The end of a single body, from quaternion, body rates, and position and velocity if any.

    Numbers may be decimal strings of any length.  Without `energy` it is computed from the state
    where that holds all of it; not from fractions.
    """
    x = np.array([number(value) for value in state])
    (body,) = scene.bodies
    rotation = _rotation(x[:4])
    moments = np.array([[number(m) for m in row] for row in body.kinetic_matrix[:3, :3]])
    momentum = moments @ x[4:7]
    found = {ATTITUDE: rotation[None], "momentum (kg m^2/s)": momentum[None]}
    if len(x) == 13:
        found[POSITION] = x[None, 7:10]
        found["momentum (kg m/s)"] = (number(body.mass) * rotation.T @ x[10:13])[None]
    if energy is not None:
        found[ENERGY] = np.array([[number(energy)]])
    elif len(x) == 13 or not body.group.translates:
        found[ENERGY] = np.array([[_energy(scene, rotation, momentum, x)]])
    return found


def _rotation(q: Wide) -> Wide:
    square = q @ q
    w, i, j, k = q
    return rotation_matrix([w, -i, -j, -k]) / (square if square > 0 else np.nan)


def _energy(scene: Scene, rotation: Wide, momentum: Wide, x: Wide) -> Any:
    (body,) = scene.bodies
    total = momentum @ x[4:7] / 2
    place = np.array(body.position, dtype=np.longdouble)
    if len(x) == 13:
        place = x[7:10]
        total += body.mass * (x[10:13] @ x[10:13]) / 2
    if scene.gravity is not None:
        center = place + rotation @ np.array(body.center_of_mass)
        total -= body.mass * (np.array(scene.gravity) @ center)
    for spring in scene.springs:
        reach = place + rotation @ np.array(spring.at) - np.array(spring.anchor)
        total += spring.stiffness * (np.sqrt(reach @ reach) - spring.rest_length) ** 2 / 2
    return total


def errors(found: Endpoint, reference: Endpoint) -> dict[str, float]:
    """The largest distance over the bodies, by quantity, in what both ends know."""
    distances = {}
    for name, here in found.items():
        if name not in reference:
            continue
        apart = (here - reference[name]).astype(np.longdouble)
        if name == ATTITUDE:
            # |R1 - R2| = 2 √2 sin α/2 keeps its digits at small angles.
            chord = np.sqrt(np.sum(apart**2, axis=(-2, -1)) / 8)
            distance = 2 * np.arcsin(np.clip(chord, 0, 1))
        else:
            distance = np.sqrt(np.sum(apart**2, axis=-1))
        distances[name] = float(distance.max())
    return distances


def in_long_doubles(end: Endpoint) -> Endpoint:
    """An end of fractions, rounded."""

    def rounded(x: Fraction) -> Any:
        return np.longdouble(float(x)) + np.longdouble(float(x - Fraction(float(x))))

    return {
        name: np.array([rounded(x) for x in value.flat]).reshape(value.shape)
        for name, value in end.items()
    }
