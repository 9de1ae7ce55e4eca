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

    def norm(quantity: Conserved) -> tuple[str, ...]:
        if quantity.kind in {"energy", "energy_balance"}:
            return ("energy",)
        if quantity.kind == "own":
            return (quantity.name,)
        alike = quantity.unit
        return tuple(
            f"spatial_momentum.{generator}"
            for generator, unit in zip(group.generators, group.units, strict=True)
            if unit == alike
        )

    return tuple(
        (
            ConservedQuantity(
                name=quantity.name,
                unit=quantity.unit,
                description=quantity.description,
                coefficients=tuple((g, float(x)) for g, x in quantity.coefficients),
                body=quantity.body,
                norm=norm(quantity),
                scale=0.0,
            ),
            quantity.expression if quantity.kind == "own" else None,
        )
        for quantity in conserved(scene.hamiltonian, scene.system)
    )
