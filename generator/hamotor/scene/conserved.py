"""Which quantities a scene conserves, found exactly from what acts in it.

The total spatial momentum pairs with a Lie algebra element ζ = (ω, v), the velocity field
x ↦ v + ω×x of the world, to ω·L + v·P (about the world's origin). By Noether's theorem it is
conserved if ζ leaves every potential as it is:

* gravity g:                  g·v = 0 and ω×g = 0
* a spring to the anchor A:   v + ω×A = 0
* a spring between bodies:    nothing to demand

With a fixed point (SO3) each body's momentum is taken about its own fixed point P, and v follows
from ω. Gravity demands ω×g = 0 unless the centre of mass is P, a spring to A demands ω×(A - P) = 0,
and one between bodies ω×(P' - P) = 0; a spring that is tied to P itself never acts.

The space of such ζ is computed in rational arithmetic from the decimals of the scene. Each
interaction is asked to be invariant by itself, so that a symmetry which only the sum of several
potentials has is not found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from hamotor.mechanics.echelon import null_space
from hamotor.mechanics.naming import Generators
from hamotor.scene.exact import decimal
from hamotor.scene.groups import Group
from hamotor.scene.interactions import Gravity, Spring

if TYPE_CHECKING:
    from hamotor.scene.model import Body, Scene

Row = list[Fraction]


@dataclass(frozen=True)
class ConservedQuantity:
    """A quantity that the exact motion keeps constant."""

    name: str
    """Of its column: `energy`, `spatial_momentum.e12`, `NAME.casimir.p_squared`."""
    unit: str
    description: str
    """In words; a linear combination is spelled out."""
    coefficients: tuple[tuple[str, float], ...]
    """A spatial momentum as a combination of the group's generators; otherwise empty."""
    body: str
    """The body whose Casimir it is; otherwise ""."""
    norm: tuple[str, ...]
    """Columns whose initial Euclidean norm is the scale of its relative error; may be empty."""
    scale: float
    """That scale in the scene's own initial state; 0 where the quantity has no natural scale."""


def _cross_with(a: Sequence[Fraction]) -> list[Row]:
    """The rows of ω ↦ ω×a."""
    a1, a2, a3 = a
    zero = Fraction(0)
    return [[zero, a3, -a2], [-a3, zero, a1], [a2, -a1, zero]]


def _difference(a: Sequence[float], b: Sequence[float]) -> Row:
    return [decimal(x) - decimal(y) for x, y in zip(a, b, strict=True)]


def _demands_on_motions(scene: Scene) -> list[Row]:
    """The linear conditions on ζ = (ω, v), or (w12, v1, v2) in the plane."""
    zero, one = Fraction(0), Fraction(1)
    rows: list[Row] = []
    for interaction in scene.interactions:
        if isinstance(interaction, Gravity):
            g = [decimal(x) for x in interaction.acceleration]
            if not any(g):
                continue
            if scene.group.dimension == 2:
                rows += [[one, zero, zero], [zero, *g]]
            else:
                rows += [[*row, zero, zero, zero] for row in _cross_with(g)]
                rows.append([zero, zero, zero, *g])
        elif isinstance(interaction, Spring) and interaction.anchor is not None:
            a = [decimal(x) for x in interaction.anchor]
            if scene.group.dimension == 2:
                rows += [[-a[1], one, zero], [a[0], zero, one]]
            else:
                for k, row in enumerate(_cross_with(a)):
                    rows.append([*row, *(one if k == j else zero for j in range(3))])
    return rows


def _demands_on_rotations(scene: Scene) -> list[Row]:
    """The linear conditions on ω where every body has a fixed point."""
    bodies = scene.body_of
    rows: list[Row] = []
    for interaction in scene.interactions:
        if isinstance(interaction, Gravity):
            if any(any(body.center_of_mass) for body in scene.bodies):
                rows += _cross_with([decimal(x) for x in interaction.acceleration])
            continue
        if not isinstance(interaction, Spring):
            continue
        ends = [(bodies[interaction.body].position, any(interaction.at))]
        if interaction.other is None:
            ends.append((interaction.anchor or (), False))
        else:
            ends.append((bodies[interaction.other].position, any(interaction.other_at or ())))
        if any(moves for _, moves in ends):
            rows += _cross_with(_difference(ends[0][0], ends[1][0]))
    return rows


def is_free(scene: Scene, body: Body) -> bool:
    """Whether nothing acts on `body`, so that its momentum stays on one coadjoint orbit."""
    for interaction in scene.interactions:
        if isinstance(interaction, Gravity):
            moves = scene.group.translates or any(body.center_of_mass)
            if moves and any(interaction.acceleration):
                return False
        elif isinstance(interaction, Spring):
            if body.name not in (interaction.body, interaction.other):
                continue
            at = interaction.at if body.name == interaction.body else interaction.other_at
            if scene.group.translates or any(at or ()):
                return False
        else:
            return False
    return True


def conserved_quantities(scene: Scene) -> tuple[ConservedQuantity, ...]:
    """Energy, the conserved components of the total spatial momentum, Casimirs of free bodies."""
    return (_energy(scene), *_momenta(scene), *_casimirs(scene))


def _energy(scene: Scene) -> ConservedQuantity:
    kinetic, potential, magnitude = scene.initial_energy
    total = kinetic + potential
    vanishes = abs(total) <= 1e-9 * magnitude
    return ConservedQuantity(
        name="energy",
        unit="J",
        description="kinetic and potential energy of all bodies",
        coefficients=(),
        body="",
        norm=() if vanishes else ("energy",),
        scale=magnitude if vanishes else abs(total),
    )


def _momenta(scene: Scene) -> list[ConservedQuantity]:
    group = scene.group
    demands = _demands_on_motions(scene) if group.translates else _demands_on_rotations(scene)
    spatial = dict(zip(group.generators, scene.initial_spatial_momentum, strict=True))
    called = _generators(group)
    quantities = []
    for element in null_space(demands, len(group.generators)):
        terms = [(g, x) for g, x in zip(group.generators, element, strict=True) if x != 0]
        leading = terms[0][0]
        angular = leading in group.generators[: group.rotations]
        rotations, translations = (
            group.generators[: group.rotations],
            group.generators[group.rotations :],
        )
        alike = rotations if angular else translations
        suffix, description = called.reading(element)
        quantities.append(
            ConservedQuantity(
                name=f"spatial_momentum.{leading}{suffix}",
                unit="kg m^2/s" if angular else "kg m/s",
                description=description,
                coefficients=tuple((g, float(x)) for g, x in terms),
                body="",
                norm=tuple(f"spatial_momentum.{g}" for g in alike),
                scale=float(np.linalg.norm([spatial[g] for g in alike])),
            )
        )
    return quantities


def _generators(group: Group) -> Generators:
    turning = tuple(range(group.rotations))
    moving = tuple(range(group.rotations, len(group.generators)))
    kinds = ("angular",) * len(turning) + ("linear",) * len(moving)
    return Generators(group.generators, group.dimension, turning, moving, kinds, group.translates)


def _casimirs(scene: Scene) -> list[ConservedQuantity]:
    """Functions of a momentum that no Hamiltonian of a free body can change (theory.md §5)."""
    group = scene.group
    quantities = []
    for body in scene.bodies:
        if not is_free(scene, body):
            continue
        angular = np.array(body.momentum[: group.rotations])
        linear = np.array(body.momentum[group.rotations :])
        if not group.translates:
            values = [("pi_squared", "kg^2 m^4/s^2", "|π|²", float(angular @ angular), 0.0)]
        else:
            values = [("p_squared", "kg^2 m^2/s^2", "|p|²", float(linear @ linear), 0.0)]
            if group.dimension == 3:
                magnitude = math.sqrt(float(angular @ angular) * float(linear @ linear))
                values.append(
                    ("p_dot_pi", "kg^2 m^3/s^2", "p·π", float(linear @ angular), magnitude)
                )
        for name, unit, formula, value, magnitude in values:
            column = f"{body.name}.casimir.{name}"
            vanishes = abs(value) <= 1e-9 * magnitude
            quantities.append(
                ConservedQuantity(
                    name=column,
                    unit=unit,
                    description=f"{formula} of {body.name}, on which nothing acts",
                    coefficients=(),
                    body=body.name,
                    norm=() if vanishes else (column,),
                    scale=magnitude if vanishes else abs(value),
                )
            )
    return quantities
