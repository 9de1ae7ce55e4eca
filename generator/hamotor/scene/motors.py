"""Orientations and positions as the components of motors, each rounded once.

Conventions (theory.md §1): X_world = M X_body M~, the translation by t is T = 1 - ½ t_i e0∧e_i, the
rotation by the unit quaternion (q0, q1, q2, q3) is the rotor q0 - q1 e23 - q2 e31 - q3 e12, and a
body at x with that orientation has M = T(x)·Rotor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hamotor.scene.exact import rounded_once

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]


def cross(
    a: Sequence[float] | NDArray[np.float64], b: Sequence[float] | NDArray[np.float64]
) -> NDArray[np.float64]:
    """a×b: (3,), or in the plane its one component, (1,)."""
    if len(a) == 2:
        return np.array([a[0] * b[1] - a[1] * b[0]])
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def unit(vector: Sequence[float]) -> Vector:
    """`vector` divided by its Euclidean norm; one whose norm rounds to 1 is returned as it is."""
    largest = max(abs(x) for x in vector)
    scaled = [x / largest for x in vector]
    norm = math.sqrt(math.fsum(x * x for x in scaled))
    if abs(math.sqrt(math.fsum(x * x for x in vector)) - 1.0) < 2.3e-16:
        return tuple(float(x) for x in vector)
    return tuple(x / norm for x in scaled)


def rotor_of_axis_angle(axis: Sequence[float], angle: float) -> Vector:
    """(s, e23, e31, e12) of the rotation by `angle` (rad) about `axis` (any length but zero)."""
    n = unit(axis)
    sine = math.sin(angle / 2)
    return (math.cos(angle / 2), *(-sine * x + 0.0 for x in n))


def rotor_of_quaternion(q: Sequence[float]) -> Vector:
    """(s, e23, e31, e12) of the unit quaternion (q0, q1, q2, q3), body to world."""
    q0, q1, q2, q3 = unit(q)
    return (q0, -q1 + 0.0, -q2 + 0.0, -q3 + 0.0)


def rotor_of_angle(angle: float) -> Vector:
    """(s, e12) of the planar rotation by `angle` (rad), anticlockwise."""
    return (math.cos(angle / 2), -math.sin(angle / 2) + 0.0)


def quaternion_of_matrix(matrix: NDArray[np.float64]) -> Vector:
    """The unit quaternion of a rotation matrix (body to world), q0 >= 0.

    Divides by the largest component, so that no angle loses digits (Shepperd 1978).
    """
    r = matrix
    squares = (
        1 + r[0, 0] + r[1, 1] + r[2, 2],
        1 + r[0, 0] - r[1, 1] - r[2, 2],
        1 - r[0, 0] + r[1, 1] - r[2, 2],
        1 - r[0, 0] - r[1, 1] + r[2, 2],
    )
    rows = (
        (squares[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]),
        (r[2, 1] - r[1, 2], squares[1], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]),
        (r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], squares[2], r[1, 2] + r[2, 1]),
        (r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[3]),
    )
    largest = max(range(4), key=lambda k: squares[k])
    q = unit([float(x) for x in rows[largest]])
    first = next(x for x in q if x != 0.0)
    return tuple(-x + 0.0 for x in q) if first < 0 else q


def rotation_matrix(rotor: Sequence[float]) -> NDArray[np.float64]:
    """R, body to world, of the rotor (s, e23, e31, e12) or, in the plane, (s, e12)."""
    if len(rotor) == 2:
        s, z = rotor[0], -rotor[1]
        return np.array([[s * s - z * z, -2 * s * z], [2 * s * z, s * s - z * z]])
    w, x, y, z = rotor[0], -rotor[1], -rotor[2], -rotor[3]
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def motor_of(translation: Sequence[float], rotor: Sequence[float]) -> Vector:
    """T(translation)·Rotor in the order s,e23,e31,e12,e01,e02,e03,e0123 or s,e12,e01,e02."""
    half = [-0.5 * t for t in translation]
    if len(rotor) == 2:
        s, r12 = rotor
        h1, h2 = half
        return (
            s,
            r12,
            rounded_once((h1, s), (-h2, r12)),
            rounded_once((h2, s), (h1, r12)),
        )
    s, r23, r31, r12 = rotor
    h1, h2, h3 = half
    return (
        s,
        r23,
        r31,
        r12,
        rounded_once((h1, s), (-h2, r12), (h3, r31)),
        rounded_once((h2, s), (h1, r12), (-h3, r23)),
        rounded_once((h3, s), (h2, r23), (-h1, r31)),
        rounded_once((h1, r23), (h2, r31), (h3, r12)),
    )
