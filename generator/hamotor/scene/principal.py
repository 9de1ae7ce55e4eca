"""The frame in which a body's kinetic energy is diagonal.

For a body that translates: origin at the centre of mass, axes along the central principal axes. For
one with a fixed point: axes along the principal axes about that point. A motor M of the user's body
frame becomes M' = M N, and a momentum μ' = N~ μ N.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hamotor.scene import inertia
from hamotor.scene.motors import (
    Matrix,
    Vector,
    motor_of,
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

    def from_body_frame(self, point: Sequence[float]) -> Vector:
        """A point of the user's body frame, in the principal frame."""
        if self.is_body_frame:
            return tuple(float(x) for x in point)
        relative = np.array(point, dtype=float) - np.array(self.center)
        return tuple(float(x) for x in self.axes.T @ relative)


def principal_axes(tensor: NDArray[np.float64]) -> tuple[Vector, Vector]:
    """Principal moments and the rotor of a symmetric (3, 3) tensor.

    A diagonal tensor keeps its axes exactly. Otherwise each principal axis takes the place and the
    direction of the body axis it lies closest to, so that the choice depends on nothing else.
    """
    off_diagonal = tensor - np.diag(np.diag(tensor))
    if not off_diagonal.any():
        return tuple(float(x) for x in np.diag(tensor)), (1.0, 0.0, 0.0, 0.0)
    moments, vectors = np.linalg.eigh(tensor)
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
    rotor = rotor_of_quaternion(quaternion_of_matrix(axes))
    return tuple(float(moments[k]) for k in order), rotor


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
        origin = tuple(float(x) for x in center)
        return PrincipalFrame(
            mass, (tensor[0][0],), motor_of(origin, (1.0, 0.0)), origin, (1.0, 0.0)
        )
    if translates:
        moments, rotor = principal_axes(np.array(tensor))
        origin = tuple(float(x) for x in center)
        return PrincipalFrame(mass, moments, motor_of(origin, rotor), origin, rotor)
    moments, rotor = principal_axes(inertia.about_origin(mass, center, tensor))
    return PrincipalFrame(mass, moments, rotor, (0.0, 0.0, 0.0), rotor)
