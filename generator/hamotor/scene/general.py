"""Scenes of any Hamiltonian, on any group: what the rigid bodies of `model` do not cover.

A scene is general if it gives `[hamiltonian]` or `[lagrangian]`, lives on a group without rigid
bodies of its own in the runtime, or has forques that no potential has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hamotor.codegen.algebra import Algebra, reverse_sign
from hamotor.scene.conserved import ConservedQuantity
from hamotor.scene.draws import ALIKE, Ensemble
from hamotor.scene.exact import decimal, rounded, with_digits
from hamotor.scene.groups import Group
from hamotor.scene.methods import Form
from hamotor.scene.model import Event, Output, Time
from hamotor.scene.motors import Vector

if TYPE_CHECKING:
    from hamotor.mechanics.coordinates import Coordinates
    from hamotor.mechanics.hamiltonian import Hamiltonian
    from hamotor.mechanics.lagrangian import Lagrangian
    from hamotor.mechanics.parts import Parts
    from hamotor.mechanics.system import System

Exact = tuple[Fraction, ...]


@dataclass(frozen=True)
class MassDistribution:
    """Mass and its first two moments, in the body frame; exact."""

    mass: Fraction
    """kg."""
    center: Exact
    """m."""
    moments: tuple[Exact, ...]
    """Σ m X Xᵀ about the frame's origin, kg m²."""
    points: tuple[tuple[Fraction, Exact], ...] = ()
    """The point masses, where the body was given by points."""


@dataclass(frozen=True)
class GeneralBody:
    """A body of a general scene: coordinates on the group, and where it starts."""

    name: str
    coordinates: Coordinates
    motor: Vector
    """M at the start, in the order of the group's element."""
    momentum: Vector
    """μ at the start, physical, body frame."""
    mass: MassDistribution | None
    kinetic_matrix: Any = None
    """K (SymPy, exact), where the body has a kinetic energy of its own."""


@dataclass(frozen=True)
class GeneralScene:
    """Bodies on a group, their Hamiltonian, and how to integrate them."""

    name: str
    description: str
    algebra: str
    group: Group
    bodies: tuple[GeneralBody, ...]
    hamiltonian: Hamiltonian
    """H; where `lagrangian` is given, −L at fixed rates in its place."""
    lagrangian: Lagrangian | None
    """L, where the Legendre transform does not close in formulas."""
    potential: Hamiltonian
    """The part of H that is neither kinetic energy nor uniform gravity nor springs."""
    acting: tuple[str, ...]
    """What H is made of, a line each, for `hamotor show`."""
    time: Time
    output: Output
    sha256: str
    events: tuple[Event, ...] = ()
    """Functions of the state whose zeros a run finds."""
    headers: tuple[str, ...] = ()
    """Texts of the headers of an algebra of the user's own."""
    drawn: tuple[Any, ...] = ()
    """The parameters that members have values of their own of (SymPy's symbols)."""
    ensemble: Ensemble = ALIKE
    """What differs from member to member."""

    @cached_property
    def initial_state(self) -> NDArray[np.float64]:
        """Per body its motor's and then its momentum's components."""
        return np.array([x for body in self.bodies for x in (*body.motor, *body.momentum)])

    @cached_property
    def exact_state(self) -> Exact:
        """The same as the numbers that these stand for, to `exact.DIGITS`."""
        return exact([x for body in self.bodies for x in (*body.motor, *body.momentum)])

    @cached_property
    def system(self) -> System:
        """The programs of the Hamiltonian."""
        from hamotor.mechanics.system import System

        return System(self.hamiltonian)

    @cached_property
    def parts(self) -> Parts | None:
        """The kinetic energy of each body in parts whose motion is known; None where H is not
        ½ μᵀAμ + U(M) with constant A."""
        from hamotor.mechanics.parts import kinetic_parts

        return None if self.lagrangian is not None else kinetic_parts(self.hamiltonian)

    @property
    def draws_rates(self) -> bool:
        """Whether what members differ in is part of the kinetic energy."""
        symbols = {s for rates in self.hamiltonian.rates for x in rates for s in x.free_symbols}
        return bool(symbols & set(self.drawn))

    @property
    def form(self) -> Form:
        """What kinds of methods step it."""
        return Form.GENERAL if self.parts is None else Form.GENERAL | Form.PARTS

    @cached_property
    def conserved(self) -> tuple[ConservedQuantity, ...]:
        """What the exact motion keeps constant."""
        return tuple(quantity for quantity, _ in self.invariants)

    @cached_property
    def invariants(self) -> tuple[tuple[ConservedQuantity, Any], ...]:
        """Each conserved quantity; and what it is over the momenta, if the scene computes it."""
        from hamotor.scene.invariants import invariants

        return invariants(self)


# ---------------------------------------------------------------- motors


def product(
    algebra: Algebra,
    a: Mapping[int, Any],
    b: Mapping[int, Any],
    total: Callable[[list[Any]], Any] = math.fsum,
) -> dict[int, Any]:
    """Geometric product of multivectors; `total` adds what makes a component."""
    terms: dict[int, list[Any]] = {}
    for blade_a, x in a.items():
        for blade_b, y in b.items():
            for blade, z in algebra.blade_product(blade_a, blade_b).items():
                terms.setdefault(blade, []).append(x * y * z)
    return {blade: total(values) for blade, values in terms.items()}


def motor_of(
    coordinates: Coordinates, position: Sequence[float], rotor: Sequence[float], scale: float
) -> Vector | None:
    """M = T(x) R S(s) (theory.md §1); the rotor as (s, e23, e31, e12), in the plane (s, e12).

    None where the group does not reach that place.
    """
    algebra, space = coordinates.algebra, coordinates.space
    planes = ("e12",) if len(rotor) == 2 else ("e23", "e31", "e12")
    one = Fraction(1)
    turned = {0: decimal(rotor[0])}
    for name, r in zip(planes, exact(rotor[1:]), strict=True):
        blade, sign = algebra.parse_blade(name)
        turned[blade] = sign * r
    moved = {0: one}
    if space.origin is not None:
        # T = 1 − ½ x_i e0∧e_i, in the null basis 1 − ½ x_i e_i∧e∞.
        other = space.origin if space.at_infinity is None else space.at_infinity
        for direction, x in zip(space.directions, exact(position), strict=False):
            moved[1 << direction | 1 << other] = -x / 2
    grown = {0: one}
    if space.origin is not None and space.at_infinity is not None:
        # S = exp(½ ln s e0∧e∞), whose square is 1.
        (root,) = with_digits(lambda s: s**0.5, decimal(scale))
        grown = {
            0: (root + 1 / root) / 2,
            1 << space.origin | 1 << space.at_infinity: (root - 1 / root) / 2,
        }
    whole = product(algebra, product(algebra, moved, turned, sum), grown, sum)
    element = coordinates.group.element
    motor = [
        sum((Fraction(y) * whole.get(blade, 0) for blade, y in reading.items()), Fraction(0))
        for reading in element.reading
    ]
    for x, component in zip(motor, element.components, strict=True):
        for blade, y in component.embedding.items():
            whole[blade] = whole.get(blade, 0) - x * y
    size = max(1.0, *(abs(float(x)) for x in motor))
    reached = max(map(abs, whole.values())) <= 1e-12 * size
    return tuple(map(rounded, motor)) if reached else None


def unit_deviation(coordinates: Coordinates, motor: Sequence[float]) -> float:
    """The largest coefficient of M M~ − 1."""
    whole: dict[int, float] = {}
    for x, component in zip(motor, coordinates.group.element.components, strict=True):
        for blade, y in component.embedding.items():
            whole[blade] = whole.get(blade, 0.0) + x * float(y)
    back = {blade: reverse_sign(blade) * x for blade, x in whole.items()}
    square = product(coordinates.algebra, whole, back)
    square[0] = square.get(0, 0.0) - 1.0
    return max(abs(float(x)) for x in square.values())


def exact(numbers: Sequence[float]) -> Exact:
    """The decimals that their author wrote."""
    return tuple(decimal(x) for x in numbers)
