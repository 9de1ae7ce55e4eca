"""Orientations and positions as the components of motors, each rounded once.

Conventions (theory.md §1): X_world = M X_body M~, the translation by t is T = 1 - ½ t_i e0∧e_i, the
rotation by the unit quaternion (q0, q1, q2, q3) is the rotor q0 - q1 e23 - q2 e31 - q3 e12, and a
body at x with that orientation has M = T(x)·Rotor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hamotor.scene.exact import decimal, exactly, rounded_once, unit_vector, with_digits

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]
Square = Matrix | NDArray[np.float64]


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
    """`vector` divided by its Euclidean norm; doubles whose norm rounds to 1 stay as they are."""
    divided = _unit_doubles(vector)
    return tuple(map(exactly, divided, unit_vector(map(decimal, vector))))


def _unit_doubles(vector: Sequence[float]) -> Vector:
    largest = max(abs(x) for x in vector)
    scaled = [x / largest for x in vector]
    norm = math.sqrt(math.fsum(x * x for x in scaled))
    if abs(math.sqrt(math.fsum(x * x for x in vector)) - 1.0) < 2.3e-16:
        return tuple(float(x) for x in vector)
    return tuple(x / norm for x in scaled)


def rotor_of_axis_angle(axis: Sequence[float], angle: float) -> Vector:
    """(s, e23, e31, e12) of the rotation by `angle` (rad) about `axis` (any length but zero)."""
    n = unit(axis)
    cosine, sine = _half_turn(angle)
    return (
        cosine,
        *(exactly(-float(sine) * x + 0.0, -decimal(sine) * decimal(x)) for x in n),
    )


def _half_turn(angle: float) -> tuple[float, float]:
    """Cosine and sine of half an angle."""
    if angle == 0:
        return 1.0, 0.0
    import mpmath

    cosine, sine = with_digits(
        lambda half: (mpmath.cos(half), mpmath.sin(half)), decimal(angle) / 2
    )
    return exactly(math.cos(angle / 2), cosine), exactly(math.sin(angle / 2), sine)


def negative(x: float) -> float:
    """−x, and 0 for 0."""
    return exactly(-x + 0.0, -decimal(x))


def rotor_of_quaternion(q: Sequence[float]) -> Vector:
    """(s, e23, e31, e12) of the unit quaternion (q0, q1, q2, q3), body to world."""
    q0, q1, q2, q3 = unit(q)
    return (q0, negative(q1), negative(q2), negative(q3))


def rotor_of_angle(angle: float) -> Vector:
    """(s, e12) of the planar rotation by `angle` (rad), anticlockwise."""
    cosine, sine = _half_turn(angle)
    return (cosine, negative(sine))


def quaternion_of_matrix(matrix: Square) -> Vector:
    """The unit quaternion of a rotation matrix (body to world), q0 >= 0.

    Divides by the largest component, so that no angle loses digits (Shepperd 1978).
    """
    rows = _quaternions(np.array(matrix))
    exact_rows = _quaternions(np.array([[decimal(x) for x in row] for row in matrix]))
    largest = max(range(4), key=lambda k: rows[k][k])
    q = unit(
        [exactly(float(x), y) for x, y in zip(rows[largest], exact_rows[largest], strict=True)]
    )
    first = next(x for x in q if x != 0.0)
    return tuple(map(negative, q)) if first < 0 else q


def nearest_rotation(matrix: Square) -> Matrix:
    """The rotation matrix nearest to one that is a rotation but for rounding."""
    left, _, right = np.linalg.svd(np.array(matrix))
    size = len(matrix)

    def polar(*entries: Any) -> list[Any]:
        import mpmath

        turn = mpmath.matrix(size, size)
        for k, x in enumerate(entries):
            turn[k // size, k % size] = x
        # Newton's iteration (Higham 1986): its error is squared by every step.
        for _ in range(8):
            turn = (turn + (turn**-1).T) / 2
        return list(turn)

    exact = with_digits(polar, *(decimal(x) for row in matrix for x in row))
    flat = [exactly(float(x), y) for x, y in zip((left @ right).flat, exact, strict=True)]
    return tuple(tuple(flat[k : k + size]) for k in range(0, size * size, size))


def _quaternions(r: NDArray[Any]) -> tuple[tuple[Any, ...], ...]:
    """Four multiples of the quaternion of a rotation matrix: by q0, q1, q2 and q3."""
    squares = (
        1 + r[0, 0] + r[1, 1] + r[2, 2],
        1 + r[0, 0] - r[1, 1] - r[2, 2],
        1 - r[0, 0] + r[1, 1] - r[2, 2],
        1 - r[0, 0] - r[1, 1] + r[2, 2],
    )
    return (
        (squares[0], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]),
        (r[2, 1] - r[1, 2], squares[1], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]),
        (r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], squares[2], r[1, 2] + r[2, 1]),
        (r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], squares[3]),
    )


def rotation_matrix(rotor: Sequence[Any]) -> NDArray[Any]:
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
    half = [rounded_once((-0.5, t)) for t in translation]
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
