"""The inertia of a rigid body: from shapes, tensors and point masses to its kinetic matrix.

A rate (Ω, V) gives the body's point x the velocity V + Ω×x (all in the body frame, V the velocity
of the frame's origin). A mass m there carries the momentum line of m(V + Ω×x) through x, which is
m X ∨ (X×B), with moment x × m(V + Ω×x). Summed over the body, with M = Σm, c = Σm x / M:

    P = Σ m (V + Ω×x)       =  M V - M ĉ Ω
    Π = Σ m x×(V + Ω×x)     =  M ĉ V + Σ m (x²1 - x xᵀ) Ω

so that the kinetic matrix K, (Π, P) = K (Ω, V), has the blocks [[J_o, M ĉ], [-M ĉ, M 1]], and the
kinetic energy is ½ (Ω, V)·K (Ω, V) (theory.md §4). J_o = J_c + M (c²1 - c cᵀ) is the tensor about
the frame's origin, J_c the one about the centre of mass. In the plane Ω is one number, Ω×x = Ω(-x2,
x1), and J is one number.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from hamotor.scene.exact import decimal, rounded, rounded_once
from hamotor.scene.motors import Matrix, Vector

RELATIVE_ZERO = 1e-13
"""A principal moment below this fraction of the largest is zero: what rounding leaves of it."""
RELATIVE_EQUALITY = 1e-9
"""Two sides of the triangle inequality this close (relatively) are equal: a flat body or a rod."""


def diagonal(moments: Sequence[float]) -> Matrix:
    """The tensor with these principal moments along the body's axes."""
    a, b, c = moments
    return ((a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c))


def _uniform(mass: float, lengths: Sequence[float], divisor: int) -> Matrix:
    """Moments mass·(b² + c²)/divisor about each axis; in the plane the one about the third."""
    squares = [decimal(x) ** 2 for x in lengths]
    if len(squares) == 2:
        return ((rounded(decimal(mass) * sum(squares) / divisor),),)
    return diagonal([rounded(decimal(mass) * (sum(squares) - x) / divisor) for x in squares])


def box(mass: float, sides: Sequence[float]) -> Matrix:
    """Uniform box with edges along the axes; in the plane a 1×1 tensor. kg m²."""
    return _uniform(mass, sides, 12)


def ellipsoid(mass: float, semi_axes: Sequence[float]) -> Matrix:
    """Uniform ellipsoid with its axes along the body's. kg m²."""
    return _uniform(mass, semi_axes, 5)


def cylinder(mass: float, radius: float, height: float) -> Matrix:
    """Uniform cylinder about the third axis. kg m²."""
    across = rounded(decimal(mass) * (3 * decimal(radius) ** 2 + decimal(height) ** 2) / 12)
    return diagonal((across, across, rounded_once((0.5, mass, radius, radius))))


def disk(mass: float, radius: float) -> Matrix:
    """Uniform disk in the plane: a 1×1 tensor. kg m²."""
    return ((rounded_once((0.5, mass, radius, radius)),),)


def of_points(
    points: Sequence[tuple[float, Sequence[float]]],
) -> tuple[float, Vector, Matrix]:
    """Mass, centre of mass and the tensor about it of point masses (m, x).

    The sums of the module's derivation, taken about the centre of mass, y = x - c:
    Σ m (y²1 - y yᵀ), computed exactly.
    """
    masses = [decimal(m) for m, _ in points]
    mass = sum(masses, Fraction(0))
    axes = range(len(points[0][1]))
    places = [[decimal(x) for x in place] for _, place in points]
    center = [sum(m * x[k] for m, x in zip(masses, places, strict=True)) / mass for k in axes]
    relative = [[x[k] - center[k] for k in axes] for x in places]
    second = [
        [sum(m * y[i] * y[j] for m, y in zip(masses, relative, strict=True)) for j in axes]
        for i in axes
    ]
    trace = sum(second[k][k] for k in axes)
    tensor: Matrix = ((rounded(trace),),)
    if len(axes) == 3:
        tensor = tuple(
            tuple(rounded((trace if i == j else 0) - second[i][j]) for j in axes) for i in axes
        )
    return rounded(mass), tuple(map(rounded, center)), tensor


def about_origin(mass: float, center: Sequence[float], tensor: Matrix) -> NDArray[np.float64]:
    """J_o = J_c + M (c²1 - c cᵀ): the parallel-axis theorem. (3, 3), or (1, 1) in the plane."""
    c = np.array(center, dtype=float)
    if len(tensor) == 1:
        return np.array(tensor) + mass * float(c @ c)
    return np.array(tensor) + mass * (float(c @ c) * np.eye(3) - np.outer(c, c))


def exactly_about_origin(
    mass: float, center: Sequence[float], tensor: Matrix
) -> list[list[Fraction]]:
    """The same of the numbers that these stand for."""
    c = [decimal(x) for x in center]
    square = sum((x * x for x in c), Fraction(0))
    axes = range(len(tensor))
    if len(tensor) == 1:
        return [[decimal(tensor[0][0]) + decimal(mass) * square]]
    return [
        [
            decimal(tensor[i][j]) + decimal(mass) * ((square if i == j else 0) - c[i] * c[j])
            for j in axes
        ]
        for i in axes
    ]


def kinetic_matrix(
    mass: float, center: Sequence[float], tensor: Matrix, *, translates: bool = True
) -> NDArray[np.float64]:
    """K of the body frame: momentum = K·rate, rotations first, translations second.

    (6, 6) in space, (3, 3) in the plane; with `translates=False` the rotation block alone (the
    frame's origin is fixed).
    """
    rotational = about_origin(mass, center, tensor)
    if not translates:
        return rotational
    if len(tensor) == 1:
        c1, c2 = center
        coupling = mass * np.array([[-c2, c1]])
        return np.block([[rotational, coupling], [coupling.T, mass * np.eye(2)]])
    c1, c2, c3 = center
    coupling = mass * np.array([[0.0, -c3, c2], [c3, 0.0, -c1], [-c2, c1, 0.0]])
    return np.block([[rotational, coupling], [coupling.T, mass * np.eye(3)]])


def momentum(
    mass: float, center: Vector, tensor: Matrix, rotation: Vector, velocity: Vector | None
) -> Vector:
    """K·(Ω, V) in the body frame, angular before linear; every component is rounded once.

    P = M (V + Ω×c) and Π = J_c Ω + c×P. With `velocity=None` the frame's origin is a fixed point:
    Π alone.
    """
    if len(tensor) == 1:
        (w,), (c1, c2), (v1, v2) = rotation, center, velocity or (0.0, 0.0)
        about_center = [(tensor[0][0], w), (mass, c1, c1, w), (mass, c2, c2, w)]
        return (
            rounded_once(*about_center, (mass, c1, v2), (-mass, c2, v1)),
            rounded_once((mass, v1), (-mass, w, c2)),
            rounded_once((mass, v2), (mass, w, c1)),
        )
    v = velocity or (0.0, 0.0, 0.0)
    angular: list[float] = []
    linear: list[float] = []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        terms: list[tuple[float, ...]] = [(tensor[i][n], rotation[n]) for n in range(3)]
        # c×V, and c×(Ω×c) = c²Ω - (c·Ω)c
        terms += [(mass, center[j], v[k]), (-mass, center[k], v[j])]
        for n in (j, k):
            terms += [
                (mass, center[n], center[n], rotation[i]),
                (-mass, center[n], rotation[n], center[i]),
            ]
        angular.append(rounded_once(*terms))
        linear.append(
            rounded_once(
                (mass, v[i]), (mass, rotation[j], center[k]), (-mass, rotation[k], center[j])
            )
        )
    return tuple(angular) if velocity is None else (*angular, *linear)


def negative_moments(tensor: Matrix) -> str:
    """The principal moments of a symmetric tensor, listed, if one of them is negative, or ""."""
    moments = principal_moments(tensor)
    largest = max(abs(x) for x in moments)
    return _listed(moments) if moments[0] < -RELATIVE_ZERO * largest else ""


def violated_inequality(tensor: Matrix) -> str:
    """The triangle inequality that this tensor about the centre of mass violates, or "".

    No principal moment of a distribution of mass exceeds the sum of the other two. Equality is
    physical: a flat body has J3 = J1 + J2, and a rod has J1 = J2, J3 = 0.
    """
    if len(tensor) == 1:
        return ""
    smallest, middle, largest = principal_moments(tensor)
    if largest <= (smallest + middle) * (1 + RELATIVE_EQUALITY):
        return ""
    return f"{largest:.6g} <= {smallest:.6g} + {middle:.6g}"


def principal_moments(tensor: Matrix) -> list[float]:
    """The eigenvalues of a symmetric tensor, ascending."""
    return [float(x) for x in np.linalg.eigvalsh(np.array(tensor))]


def vanishing_axis(kinetic: NDArray[np.float64]) -> Vector | None:
    """The axis about which this rotation block (n, n) has no inertia, or None.

    Without inertia about an axis the momentum does not determine the rate, and the Hamiltonian does
    not exist.
    """
    moments, axes = np.linalg.eigh(kinetic)
    if moments[0] > RELATIVE_ZERO * moments[-1]:
        return None
    axis = axes[:, 0] * np.sign(axes[np.argmax(np.abs(axes[:, 0])), 0])
    return tuple(float(x) for x in axis)


def _listed(numbers: Sequence[float]) -> str:
    return ", ".join(f"{x:.6g}" for x in numbers)
