"""The methods a scene can be run with: names, orders and what each is for.  The only list of them.

The runtime's steppers say the same names and orders; tests compare.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import Flag, auto


class Form(Flag):
    """How a scene is given to its stepper."""

    SPLIT = auto()
    """Rigid bodies: kinetic energy, whose motion is known, and a potential."""
    FREE = auto()
    """Rigid bodies in which nothing acts; they are split as well."""
    GENERAL = auto()
    """Any H: its whole gradient."""
    PARTS = auto()
    """A kinetic energy in parts whose motion is known, and a potential, on any group."""
    MATRIX = auto()
    """Matrices in place of motors."""


class Promise(Flag):
    """What every step of a method holds, whatever its length."""

    NOTHING = 0
    MOMENTA = auto()
    """Spatial momenta that no forque changes, and Casimirs of free bodies, but for rounding."""
    SYMPLECTIC = auto()
    """The canonical structure of T*G, so that the energy error stays bounded."""
    SYMMETRIC = auto()
    """A step back undoes a step, but for rounding."""


@dataclass(frozen=True)
class Method:
    """A one-step method, and the forms of a scene that it steps."""

    name: str
    order: int
    """0 where a step is exact but for rounding."""
    description: str
    forms: Form
    promises: Promise = Promise.NOTHING
    error_controlled: bool = False
    """Whether it chooses its steps where it is given a local tolerance."""


ANY = Form.SPLIT | Form.GENERAL
KEPT = Promise.MOMENTA | Promise.SYMMETRIC
ALL = KEPT | Promise.SYMPLECTIC
SPLITTABLE = Form.SPLIT | Form.PARTS
AUTO = "auto"
METHODS = (
    Method("rkmk4", 4, "Runge-Kutta-Munthe-Kaas, explicit", ANY | Form.MATRIX),
    Method(
        "rkmk54",
        5,
        "Runge-Kutta-Munthe-Kaas by Dormand & Prince's pair, explicit",
        ANY,
        error_controlled=True,
    ),
    Method("rkmk87", 8, "the same by Prince & Dormand's pair", ANY, error_controlled=True),
    Method("cf4", 4, "commutator-free, explicit: two exponentials in place of brackets", ANY),
    Method("rk4", 4, "classical Runge-Kutta, cheaper; less exact for spin", ANY | Form.MATRIX),
    Method("rk54", 5, "as rk4 by Dormand & Prince's pair", ANY, error_controlled=True),
    Method("rk87", 8, "the same by Prince & Dormand's pair", ANY, error_controlled=True),
    Method("splitting2", 2, "Strang splitting, symplectic, keeps orbits", SPLITTABLE, ALL),
    Method("splitting4", 4, "the same in 5 to 7 parts a step", SPLITTABLE, ALL),
    Method("splitting6", 6, "the same in 9 to 15 parts a step", SPLITTABLE, ALL),
    Method("splitting8", 8, "the same in 17 parts a step", SPLITTABLE, ALL),
    Method("splitting10", 10, "the same in 35 parts a step, for the last digits", SPLITTABLE, ALL),
    Method("moser_veselov2", 2, "discrete Moser-Veselov: RATTLE", Form.SPLIT, ALL),
    Method("moser_veselov4", 4, "the same with modified moments; Poisson", Form.FREE, KEPT),
    Method("moser_veselov6", 6, "the same, for free bodies only", Form.FREE, KEPT),
    Method("moser_veselov8", 8, "the same", Form.FREE, KEPT),
    Method("moser_veselov10", 10, "the same, for the last digits", Form.FREE, KEPT),
    Method("closed_form", 0, "free bodies at any time, by theta functions", Form.FREE, ALL),
    Method("lie_midpoint", 2, "midpoint rule, symplectic for any H, implicit", ANY, ALL),
    Method("gauss4", 4, "Gauss collocation, the same with 2 stages", ANY, ALL),
    Method("gauss6", 6, "the same with 3 stages", ANY, ALL),
    Method("gauss8", 8, "the same with 4 stages", ANY, ALL),
    Method("gauss12", 12, "the same with 6 stages", ANY, ALL),
    Method("gauss16", 16, "the same with 8 stages, for the last digits", ANY, ALL),
    Method(
        "taylor", 34, "Taylor series; order and step by a tolerance", ANY, error_controlled=True
    ),
)
SERIES = "taylor"
"""Expands the motion, which is in the source of a scene for this method only."""
IN_COORDINATES = ("rk54", "rk87")
"""Step the motion in coordinates of the generator's choice, in sources that are for them or for all
methods."""
METHOD_NAMES = (AUTO, *(method.name for method in METHODS if method.forms & (ANY | Form.FREE)))
"""What a scene may ask for."""


def texts_of(methods: Collection[str], *, in_coordinates: bool = True) -> str:
    """Of these methods those that stand for the texts of their own that a source needs, one space
    apart.  None stand for all but `SERIES`."""
    found = [SERIES] if SERIES in methods else []
    if in_coordinates and (not methods or set(methods) & set(IN_COORDINATES)):
        found.append(IN_COORDINATES[0])
    return " ".join(found)


def methods_offered(form: Form) -> dict[str, int]:
    """Names and orders of the methods for this form of a scene."""
    return {method.name: method.order for method in METHODS if method.forms & form}


def what_it_steps(name: str) -> str:
    """What a method is for that not every scene offers; empty for others."""
    for method in METHODS:
        if method.name == name and not method.forms & Form.GENERAL:
            if method.forms & Form.PARTS:
                return "kinetic energies in parts of known motion, and potentials of place"
            bodies = "rigid bodies with generated kernels"
            return f"{bodies}, in potentials" if method.forms & Form.SPLIT else f"free {bodies}"
    return ""


def order_in_words(order: int) -> str:
    """`order 4`, or `exact`."""
    return f"order {order}" if order else "exact"
