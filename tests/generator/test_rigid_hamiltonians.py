"""The Hamiltonian of a scene of rigid bodies, against the scene's own numbers."""

from __future__ import annotations

import numpy as np
import pytest
from tests.generator.test_conserved import CASES
from tests.rigid import RIGID, read_scene

from hamotor.mechanics.hamiltonian import Hamiltonian
from hamotor.mechanics.system import System
from hamotor.scene import Scene

SCENES = {name: read_scene(name) for name in RIGID} | CASES


def at_the_start(scene: Scene, hamiltonian: Hamiltonian) -> dict[object, object]:
    state = iter(scene.initial_state.tolist())
    known: dict[object, object] = {}
    for body in hamiltonian.bodies:
        known |= {symbol: next(state) for symbol in (*body.motor, *body.momenta)}
    for symbol, _, definition in System(hamiltonian).places:
        known[symbol] = definition.subs(known)
    return known


@pytest.mark.parametrize("name", SCENES)
def test_energy_and_rates_at_the_start_are_the_scenes(name: str) -> None:
    scene = SCENES[name]
    hamiltonian = scene.hamiltonian
    known = at_the_start(scene, hamiltonian)
    kinetic, potential, size = scene.initial_energy
    assert float(hamiltonian.energy.subs(known)) == pytest.approx(
        kinetic + potential, rel=0, abs=1e-14 * size
    )
    for body, rates in zip(scene.bodies, hamiltonian.rates, strict=True):
        found = np.array([float(rate.subs(known)) for rate in rates])
        np.testing.assert_allclose(found, body.rate, rtol=0, atol=1e-13 * np.abs(body.rate).max())
