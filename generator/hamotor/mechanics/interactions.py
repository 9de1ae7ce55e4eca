"""What acts on bodies, as potentials and as forques over their coordinates.

Forces of a potential U on a point y are −∂U/∂y; forques that no potential has are given as they
stand in μ̇ = ad*_B μ − F: minus the force (theory.md §2, §8).
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy

from hamotor.mechanics.coordinates import Coordinates, Expr

Numbers = Sequence[Expr]


def _dot(a: Numbers, b: Numbers) -> Expr:
    return sum((x * y for x, y in zip(a, b, strict=True)), sympy.Integer(0))


def _difference(a: Numbers, b: Numbers) -> tuple[Expr, ...]:
    return tuple(x - y for x, y in zip(a, b, strict=True))


def uniform_gravity(body: Coordinates, mass: Expr, center: Numbers, field: Numbers) -> Expr:
    """−m g·y, y the centre of mass."""
    return -mass * _dot(field, body.at(tuple(center)))


def spring(near: Numbers, far: Numbers, stiffness: Expr, rest_length: Expr) -> Expr:
    """½ k (|y − z| − ℓ)² between two points of the world."""
    d = _difference(near, far)
    if rest_length == 0:
        return stiffness * _dot(d, d) / 2
    return stiffness * (sympy.sqrt(_dot(d, d)) - rest_length) ** 2 / 2


def newtonian_of_points(
    one: Sequence[tuple[Expr, Numbers]], other: Sequence[tuple[Expr, Numbers]]
) -> Expr:
    """−Σ w w'/|y − y'| over weighted points of the world; one weight holds the constant."""
    return -sum(
        w * v / sympy.sqrt(_dot(_difference(y, z), _difference(y, z)))
        for w, y in one
        for v, z in other
    )


def newtonian_of_moments(
    body: Coordinates,
    mass: Expr,
    center: Numbers,
    tensor: Sequence[Numbers],
    attractor: Numbers,
    strength: Expr,
) -> Expr:
    """MacCullagh's formula, −μ (m/r + q): exact up to second moments, q those of `quadrupole`."""
    d = _difference(attractor, body.at(tuple(center)))
    return -strength * (mass / sympy.sqrt(_dot(d, d)) + quadrupole(body, center, tensor, attractor))


def quadrupole(
    body: Coordinates, center: Numbers, tensor: Sequence[Numbers], attractor: Numbers
) -> Expr:
    """s² (tr J − 3 n·J n)/2r³, what second moments add to m/r.

    tensor: J about the centre of mass, body frame, (3, 3).  n is the direction of the attractor
    seen from the body, s by how much the body is enlarged.
    """
    d = _difference(attractor, body.at(tuple(center)))
    square = _dot(d, d)
    seen = body.turned_back(d)
    trace = sum(tensor[k][k] for k in range(3))
    quadratic = sum(
        tensor[j][k] * seen[j] * seen[k] for j in range(3) for k in range(3) if tensor[j][k]
    )
    r = sympy.sqrt(square)
    return body.scale**2 * (trace - 3 * quadratic / square) / (2 * r**3)


VACUUM = sympy.Rational(1, 10**7)
"""μ₀/4π, T m/A, as before the SI of 2019; its relative deviation since is 1e-10."""


def dipole(
    body: Coordinates, place: Numbers, moment: Numbers, center: Numbers, source: Numbers
) -> Expr:
    """−n·B(y) for the dipole R n at y in the field B = μ₀/4π (3 r̂ (r̂·m) − m)/r³ of the other."""
    d = _difference(body.at(tuple(place)), center)
    n = body.turned(tuple(moment))
    square = _dot(d, d)
    r3 = square * sympy.sqrt(square)
    return -VACUUM * (3 * _dot(n, d) * _dot(source, d) / square - _dot(n, source)) / r3


def force_forque(body: Coordinates, place: Numbers, force: Numbers) -> tuple[Expr, ...]:
    """The forque of a force f, world frame, at a point of the body: −ξ_i(a)·s Rᵀ f."""
    pulled = body.pulled_back(tuple(force))
    if not body.space.affine:
        raise ValueError("forces need a group that acts affinely")
    return tuple(-_dot(velocity, pulled) for velocity in body.velocities_at(tuple(place)))


def torque_forque(body: Coordinates, torque: Numbers) -> tuple[Expr, ...]:
    """The forque of a couple τ: world frame in space, one number in the plane."""
    if body.dimension == 2:
        matrix = [[0, -torque[0]], [torque[0], 0]]
    else:
        x, y, z = body.turned_back(tuple(torque))
        matrix = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    d = range(body.dimension)
    return tuple(
        -sum((matrix[j][k] * turn[j][k] for j in d for k in d), sympy.Integer(0)) / 2
        for turn in body.space.turns
    )


def damping_forque(
    body: Coordinates, rates: Numbers, linear: Expr, angular: Expr
) -> tuple[Expr, ...]:
    """c B_i, with the linear coefficient for translations and the angular one for rotations."""
    return tuple(
        (linear if any(velocity) else angular if any(map(any, turn)) else sympy.Integer(0)) * rate
        for rate, velocity, turn in zip(rates, body.space.velocities, body.space.turns, strict=True)
    )
