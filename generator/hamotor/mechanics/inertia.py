"""Kinetic energy from a distribution of mass, on any group that acts affinely.

A body of points X (body frame) with masses m moves at ẋ = s R ξ_B(X), ξ_B(X) = Σ B_i ξ_i(X),
so that T = ½ s² Bᵀ K B with K_ij = Σ m ξ_i(X)·ξ_j(X): the mass, the first and the second moments
are all that it needs (theory.md §4; with a scale it is the breathing body of §5).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import sympy

from hamotor.mechanics.coordinates import Coordinates, Expr


def second_moments(
    mass: Fraction, center: Sequence[Fraction], tensor: Sequence[Sequence[Fraction]]
) -> list[list[Fraction]]:
    """Σ m X Xᵀ about the frame's origin, kg m², from the inertia tensor about the centre of mass.

    In the plane, where the tensor is one number, the moments about both axes are taken equal:
    rotations and scalings need only their sum.
    """
    d = range(len(center))
    if len(tensor) == 1:
        half = tensor[0][0] / 2
        central = [[half if i == j else Fraction(0) for j in d] for i in d]
    else:
        trace = sum((tensor[k][k] for k in d), Fraction(0)) / 2
        central = [[(trace if i == j else 0) - tensor[i][j] for j in d] for i in d]
    return [[central[i][j] + mass * center[i] * center[j] for j in d] for i in d]


def kinetic_matrix(
    body: Coordinates,
    mass: Fraction,
    center: Sequence[Fraction],
    moments: Sequence[Sequence[Fraction]],
) -> Expr:
    """K, a SymPy matrix of exact numbers: rows and columns are the group's generators."""
    space = body.space
    d = range(body.dimension)
    first = [mass * x for x in center]
    fields = [
        (
            [Fraction(x) for x in velocity],
            [[Fraction(turn[j][k]) + (Fraction(growth) if j == k else 0) for k in d] for j in d],
        )
        for velocity, turn, growth in zip(space.velocities, space.turns, space.growths, strict=True)
    ]

    def entry(a: int, b: int) -> Expr:
        (v, turned), (w, other) = fields[a], fields[b]
        total = mass * sum(v[j] * w[j] for j in d)
        total += sum(v[j] * other[j][k] * first[k] for j in d for k in d)
        total += sum(w[j] * turned[j][k] * first[k] for j in d for k in d)
        total += sum(turned[j][k] * moments[k][n] * other[j][n] for j in d for k in d for n in d)
        return sympy.Rational(total.numerator, total.denominator)

    size = len(fields)
    return sympy.Matrix(size, size, entry)


def kinetic_energy(body: Coordinates, matrix: Expr) -> Expr:
    """½ s⁻² μᵀ K⁻¹ μ, J."""
    momenta = sympy.Matrix(body.momenta)
    quadratic = sympy.expand((momenta.T * matrix.inv() * momenta)[0] / 2)
    return quadratic / body.scale**2
