"""What a general scene conserves, in the form that runs and pictures know."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hamotor.scene.conserved import ConservedQuantity

if TYPE_CHECKING:
    from hamotor.scene.general import GeneralScene


def invariants(scene: GeneralScene) -> tuple[tuple[ConservedQuantity, Any], ...]:
    """Each conserved quantity; and what it is over the momenta, if the scene computes it."""
    from hamotor.mechanics.symmetries import Conserved, conserved

    group = scene.group
    start = _at_the_start(scene)

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
        for quantity in conserved(scene.hamiltonian, scene.system)
    )


CANCELLED = 1e-9
"""A sum is near zero if it is less than so much of its terms."""


def _at_the_start(scene: GeneralScene) -> dict[Any, Any]:
    """What every symbol of H is at the start, as mpmath numbers."""
    import mpmath

    from hamotor.mechanics.hamiltonian import TIME
    from hamotor.mechanics.numbers import places

    known: dict[Any, Any] = {TIME: mpmath.mpf(0)}
    for symbol, value in scene.hamiltonian.parameters.items():
        known[symbol] = mpmath.mpf(value.p) / value.q
    for body in scene.bodies:
        known |= places(body.coordinates, body.motor)
        known |= dict(zip(body.coordinates.momenta, map(mpmath.mpf, body.momentum), strict=True))
    return known


def _size(total: Any, known: dict[Any, Any]) -> tuple[float, float]:
    """A sum's value, and the sum of its terms' magnitudes."""
    import sympy

    from hamotor.mechanics.numbers import evaluated

    terms = [evaluated(term, known) for term in sympy.Add.make_args(total)]
    return float(sum(terms)), float(sum(map(abs, terms)))
