"""The Hamiltonian of a scene of rigid bodies, as a function in symbols."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import sympy

from hamotor.codegen.spec import bundled_algebra
from hamotor.mechanics import inertia, interactions
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.hamiltonian import Hamiltonian
from hamotor.scene.exact import decimal
from hamotor.scene.interactions import Gravity

if TYPE_CHECKING:
    from hamotor.scene.model import Body, Scene

Expr = Any


def rigid_hamiltonian(scene: Scene) -> Hamiltonian:
    """½ μ K⁻¹ μ − Σ m g·y + Σ ½ k (|Δ| − ℓ)², exact in the decimals that the scene is written in.

    Bodies are in the user's body frames. With a fixed point, places are measured from there.
    """
    spec = bundled_algebra(scene.algebra)
    group = next(g for g in spec.groups if g.name == scene.group.name)
    several = len(scene.bodies) > 1
    coordinates = {
        b.name: Coordinates(b.name, spec.algebra, group, f"{b.name}." if several else "")
        for b in scene.bodies
    }
    energy = sum((_kinetic_energy(b, coordinates[b.name]) for b in scene.bodies), sympy.Integer(0))

    def end(name: str, at: Sequence[float]) -> tuple[Expr, ...]:
        body = coordinates[name]
        # On SO(3) the fixed point itself is no symbol: it does not move.
        place = exact(at)
        y = body.at(place) if any(at) or scene.group.translates else place
        if scene.group.translates:
            return y
        fixed = exact(scene.body_of[name].position)
        return tuple(a + b for a, b in zip(y, fixed, strict=True))

    for acting in scene.interactions:
        if isinstance(acting, Gravity):
            for b in scene.bodies:
                if any(b.center_of_mass) or scene.group.translates:
                    energy += interactions.uniform_gravity(
                        coordinates[b.name],
                        exact([b.mass])[0],
                        exact(b.center_of_mass),
                        exact(acting.acceleration),
                    )
            continue
        near = end(acting.body, acting.at)
        if acting.other is None:
            far = exact(acting.anchor or ())
        else:
            far = end(acting.other, acting.other_at or ())
        energy += interactions.spring(near, far, *exact([acting.stiffness, acting.rest_length]))
    return Hamiltonian(tuple(coordinates.values()), energy)


def exact(numbers: Sequence[float]) -> tuple[Expr, ...]:
    """The decimals that their author wrote, for SymPy."""
    return tuple(sympy.Rational(*decimal(x).as_integer_ratio()) for x in numbers)


def _kinetic_energy(body: Body, coordinates: Coordinates) -> Expr:
    mass = decimal(body.mass)
    center = tuple(decimal(x) for x in body.center_of_mass)
    tensor = [[decimal(x) for x in row] for row in body.inertia]
    moments = inertia.second_moments(mass, center, tensor)
    matrix = inertia.kinetic_matrix(coordinates, mass, center, moments)
    return inertia.kinetic_energy(coordinates, matrix)
