"""What a general scene conserves, in the form that runs and pictures know."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hamotor.scene.conserved import ConservedQuantity

if TYPE_CHECKING:
    from hamotor.scene.general import GeneralScene


def invariants(scene: GeneralScene) -> tuple[tuple[ConservedQuantity, Any], ...]:
    """Each conserved quantity; and what it is over the momenta, if the scene computes it."""
    return (_energy(scene),)


def _energy(scene: GeneralScene) -> tuple[ConservedQuantity, Any]:
    conservative = scene.hamiltonian.conservative
    name = "energy" if conservative else "energy_balance"
    return (
        ConservedQuantity(
            name=name,
            unit="J",
            description="H" if conservative else "H less the work of time and of applied forques",
            coefficients=(),
            body="",
            norm=("energy",),
            scale=0.0,
        ),
        None,
    )
