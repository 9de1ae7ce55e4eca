"""What a general scene conserves, in the form that runs and pictures know."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hamotor.scene.conserved import ConservedQuantity

if TYPE_CHECKING:
    from hamotor.mechanics.evaluation import Values
    from hamotor.mechanics.hamiltonian import Hamiltonian
    from hamotor.mechanics.system import System
    from hamotor.scene.general import GeneralBody, GeneralScene


def invariants(
    scene: GeneralScene, system: System | None = None
) -> tuple[tuple[ConservedQuantity, Any], ...]:
    """Each conserved quantity; and what it is over the momenta, if the scene computes it.

    system: the scene's programs; where it leaves parameters open, what any of their values keeps.
    """
    from hamotor.mechanics.symmetries import Conserved, conserved

    if scene.lagrangian is not None:
        return (_of_newton(scene),)
    group = scene.group
    start = at_the_start(scene.hamiltonian, scene.bodies)

    def measure(quantity: Conserved) -> tuple[tuple[str, ...], float]:
        """`norm` and `scale`: of a sum that cancels at the start, that of its terms."""
        if quantity.kind == "spatial_momentum":
            alike = zip(group.generators, group.units, strict=True)
            return tuple(f"spatial_momentum.{g}" for g, u in alike if u == quantity.unit), 0.0
        own = quantity.kind == "own"
        total = quantity.expression if own else scene.hamiltonian.energy
        value, magnitude = _size(total, start)
        if abs(value) <= CANCELLED * magnitude:
            return (), magnitude
        return (quantity.name if own else "energy",), abs(value)

    return tuple(
        (
            ConservedQuantity(
                name=quantity.name,
                unit=quantity.unit,
                description=quantity.description,
                coefficients=tuple((g, float(x)) for g, x in quantity.coefficients),
                body=quantity.body,
                norm=measure(quantity)[0],
                scale=measure(quantity)[1],
            ),
            quantity.expression if quantity.kind == "own" else None,
        )
        for quantity in conserved(scene.hamiltonian, system or scene.system)
        if quantity.kind != "own" or _has_a_value(quantity.expression, start)
    )


def _of_newton(scene: GeneralScene) -> tuple[ConservedQuantity, None]:
    """The energy: symmetries are not sought where H is no formula."""
    constant = scene.hamiltonian.conservative
    words = "μ·B − L" if constant else "μ·B − L less the work of time and of applied forques"
    name = "energy" if constant else "energy_balance"
    return ConservedQuantity(name, "J", words, (), "", ("energy",), 0.0), None


CANCELLED = 1e-9
"""A sum is near zero if it is less than so much of its terms."""


def _has_a_value(own: Any, known: Values) -> bool:
    """A quotient of momenta has none where they vanish."""
    from hamotor.mechanics.evaluation import evaluated, is_real

    return is_real(evaluated([own], known))


def _size(total: Any, known: Values) -> tuple[float, float]:
    """A sum's value, and the sum of its terms' magnitudes."""
    import sympy

    from hamotor.mechanics.evaluation import evaluated

    terms = evaluated(sympy.Add.make_args(total), known)
    return float(sum(terms)), float(sum(map(abs, terms)))


def at_the_start(hamiltonian: Hamiltonian, bodies: Sequence[GeneralBody]) -> Values:
    """What every symbol of H is at the start, as mpmath numbers."""
    import mpmath

    from hamotor.mechanics.evaluation import place, values_of

    known = values_of(hamiltonian.parameters)
    for body in bodies:
        known = place(body.coordinates, body.motor, known)
        known |= dict(zip(body.coordinates.momenta, map(mpmath.mpf, body.momentum), strict=True))
    return known
