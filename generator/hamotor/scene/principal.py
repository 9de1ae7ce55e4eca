"""The frame in which a body's kinetic energy is diagonal.

For a body that translates: origin at the centre of mass, axes along the central principal axes. For
one with a fixed point: axes along the principal axes about that point. A motor M of the user's body
frame becomes M' = M N, and a momentum μ' = N~ μ N.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hamotor.scene import inertia
from hamotor.scene.exact import DIGITS, decimal, exactly, with_digits
from hamotor.scene.motors import (
    Matrix,
    Square,
    Vector,
    motor_of,
    nearest_rotation,
    quaternion_of_matrix,
    rotation_matrix,
    rotor_of_quaternion,
)


@dataclass(frozen=True)
class PrincipalFrame:
    """The constant rigid motion from a body's principal frame to the user's body frame."""

    mass: float
    """kg."""
    moments: Vector
    """Principal moments of inertia about the frame's origin, kg m²: three, or one in the plane."""
    motor: Vector
    """N, X_user = N X_principal N~, in the order of the group's motor components."""
    center: Vector
    """The principal frame's origin in the user's body frame, m (zero for a fixed point)."""
    rotor: Vector
    """The rotation part of N: (s, e23, e31, e12) or, in the plane, (s, e12)."""

    @property
    def is_body_frame(self) -> bool:
        """Whether N is the identity: the body is given in its principal frame already."""
        return self.motor[0] == 1.0 and not any(self.motor[1:])

    @property
    def axes(self) -> NDArray[np.float64]:
        """The principal axes, as columns in the user's body frame."""
        return rotation_matrix(self.rotor)

    @cached_property
    def exact_axes(self) -> tuple[tuple[Fraction, ...], ...]:
        """The same, as the numbers that these stand for."""
        return tuple(map(tuple, rotation_matrix([decimal(x) for x in self.rotor])))

    def from_body_frame(self, point: Sequence[float]) -> Vector:
        """A point of the user's body frame, in the principal frame."""
        if self.is_body_frame:
            return tuple(point)
        relative = np.array(point, dtype=float) - np.array(self.center)
        exact = [decimal(x) - decimal(c) for x, c in zip(point, self.center, strict=True)]
        columns = zip(*self.exact_axes, strict=True)
        return tuple(
            exactly(float(x), sum((a * y for a, y in zip(axis, exact, strict=True)), Fraction(0)))
            for x, axis in zip(self.axes.T @ relative, columns, strict=True)
        )


def principal_axes(tensor: Square) -> tuple[Vector, Vector]:
    """Principal moments and the rotor of a symmetric (3, 3) tensor.

    A diagonal tensor keeps its axes exactly. Otherwise each principal axis takes the place and the
    direction of the body axis it lies closest to, so that the choice depends on nothing else.
    """
    matrix = np.array(tensor)
    if not (matrix - np.diag(np.diag(matrix))).any():
        return tuple(tensor[k][k] for k in range(3)), (1.0, 0.0, 0.0, 0.0)
    moments, vectors = np.linalg.eigh(matrix)
    moments = _equal_where_rounding_parts_them(moments)
    order = max(
        itertools.permutations(range(3)),
        key=lambda columns: sum(abs(vectors[row, column]) for row, column in enumerate(columns)),
    )
    axes = vectors[:, order]
    axes = axes * np.where(np.diag(axes) < 0, -1.0, 1.0)
    if np.linalg.det(axes) < 0:
        least_aligned = int(np.argmin(np.abs(np.diag(axes))))
        axes[:, least_aligned] *= -1.0
    rows = nearest_rotation(tuple(tuple(float(x) for x in row) for row in axes))
    exact_moments, exact_axes = _diagonalised(tensor, rows)
    axes_of_digits = tuple(
        tuple(exactly(float(x), y) for x, y in zip(row, exact_row, strict=True))
        for row, exact_row in zip(axes, exact_axes, strict=True)
    )
    rotor = rotor_of_quaternion(quaternion_of_matrix(axes_of_digits))
    found = zip((moments[k] for k in order), exact_moments, strict=True)
    return tuple(exactly(float(x), y) for x, y in found), rotor


def _diagonalised(
    tensor: Square, axes: Square
) -> tuple[tuple[Fraction, ...], tuple[tuple[Fraction, ...], ...]]:
    """Principal moments and axes (columns) to all digits, from axes that are right to a double's.

    Jacobi's rotations, which leave alone what is equal.
    """

    def turned(*entries: Any) -> list[Any]:
        import mpmath

        a, r = (
            mpmath.matrix([entries[k + 3 * i : k + 3 * i + 3] for i in range(3)]) for k in (0, 9)
        )
        a = r.T * a * r
        negligible = mpmath.norm(a) * mpmath.mpf(10) ** -DIGITS
        for _ in range(6):
            for i, j in ((0, 1), (1, 2), (0, 2)):
                if abs(a[i, j]) <= negligible:
                    continue
                angle = mpmath.atan2(2 * a[i, j], a[i, i] - a[j, j]) / 2
                angle -= mpmath.pi * mpmath.nint(2 * angle / mpmath.pi) / 2
                turn = mpmath.eye(3)
                turn[i, i] = turn[j, j] = mpmath.cos(angle)
                turn[j, i] = mpmath.sin(angle)
                turn[i, j] = -turn[j, i]
                a, r = turn.T * a * turn, r * turn
        moments = [a[k, k] for k in range(3)]
        for i, j in ((0, 1), (1, 2), (0, 2)):
            if abs(moments[i] - moments[j]) <= negligible:
                moments[j] = moments[i]
        return [*moments, *r]

    flat = with_digits(turned, *(decimal(x) for m in (tensor, axes) for row in m for x in row))
    return flat[:3], (flat[3:6], flat[6:9], flat[9:])


def _equal_where_rounding_parts_them(moments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ascending moments, equal ones exactly equal: a symmetric body gets the symmetric flow."""
    equal = moments.copy()
    for k in (1, 2):
        if moments[k] - moments[k - 1] <= 8 * np.finfo(float).eps * moments[2]:
            equal[k] = equal[k - 1]
    return equal


def principal_frame(
    mass: float, center: Sequence[float], tensor: Matrix, *, translates: bool = True
) -> PrincipalFrame:
    """The principal frame of a body with this `tensor` about its centre of mass.

    `center` and `tensor` are in the user's body frame. With `translates=False` the frame's origin
    is a fixed point, and the parallel-axis theorem moves the tensor there.
    """
    if len(tensor) == 1:
        origin = tuple(center)
        return PrincipalFrame(
            mass, (tensor[0][0],), motor_of(origin, (1.0, 0.0)), origin, (1.0, 0.0)
        )
    if translates:
        moments, rotor = principal_axes(tensor)
        origin = tuple(center)
        return PrincipalFrame(mass, moments, motor_of(origin, rotor), origin, rotor)
    about = zip(
        inertia.about_origin(mass, center, tensor),
        inertia.exactly_about_origin(mass, center, tensor),
        strict=True,
    )
    moments, rotor = principal_axes(
        tuple(tuple(map(exactly, map(float, row), exact)) for row, exact in about)
    )
    return PrincipalFrame(mass, moments, rotor, (0.0, 0.0, 0.0), rotor)
