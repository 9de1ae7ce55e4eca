"""Scenes with products by table instead of generated kernels: the same motion, to rounding."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.generator.hamiltonians import GROUPS

import hamotor
from hamotor.codegen.spec import bundled_algebra
from hamotor.run.library import SceneLibrary
from hamotor.scene import bundled_scenes

OFTEN = {"heavy_top", "spring_pendulum", "breathing_body", "rocket", "two_bodies"}
OFTEN |= {"SE3", "Sim3", "SE4", "SO13", "SE2"}
"""Compiled for every change; the others only when asked for."""
OTHERS = {"SE3": ["rk4"], "Sim3": ["splitting4"]}
"""Methods of other kinds: without an exponential, and by parts of the kinetic energy."""
BUNDLED = [
    pytest.param(name, marks=() if name in OFTEN else pytest.mark.long)
    for name, _ in bundled_scenes()
]
STEPS = 20
ORBITING = "gravity_gradient"


def agree_in(simulation: hamotor.Simulation, scalar: str, *methods: str) -> None:
    """After some steps.

    Stages of `rk4` leave the group, where forques of rigid bodies and those of the general form
    differ: it agrees to rounding where both are of the general form.
    """
    rounding = float(np.finfo(np.double if scalar == "double" else np.longdouble).eps)
    for method in methods:
        libraries = [
            simulation.compile(kernels=kernels, scalar=scalar, method=method).library
            for kernels in ("generated", "generic")
        ]
        found = []
        for library in libraries:
            step = (simulation.step or 1e-3) / 4
            with library.start(method, step=step, state=simulation.state) as run:
                assert run.advance(STEPS, 0, None) == STEPS
                found.append(np.array(run.observe_text(), np.longdouble))
        agree(libraries, found, rounding)


def agree(libraries: list[SceneLibrary], found: list[np.ndarray], rounding: float) -> None:
    """To rounding of the largest number that has the same unit, and in orbit to that of P × V."""
    columns = libraries[0].description.columns
    assert columns == libraries[1].description.columns
    assert [library.description.kernels for library in libraries] == ["generated", "generic"]
    for k, column in enumerate(columns):
        alike = [row[n] for row in found for n, c in enumerate(columns) if c.unit == column.unit]
        size = max(1e-9, float(np.max(np.abs(alike))))
        lost = 1e7 if libraries[0].description.scene == ORBITING else 1
        assert abs(found[0][k] - found[1][k]) <= 64 * STEPS * rounding * size * lost, column.name


@pytest.mark.parametrize("name", BUNDLED)
def test_bundled_scenes_move_alike(name: str) -> None:
    # In orbit P × V is the difference of products of 1e10 N m, ten digits more than any torque.
    agree_in(hamotor.load(name), "long_double" if name == ORBITING else "double", "rkmk4")


@pytest.mark.parametrize(
    ("algebra", "group"),
    [pytest.param(*g, marks=() if g[1] in OFTEN else pytest.mark.long) for g in GROUPS],
)
def test_every_group_moves_alike(algebra: str, group: str, tmp_path: Path) -> None:
    generators = [
        g.name
        for found in bundled_algebra(algebra).groups
        if found.name == group
        for g in found.generators
    ]
    energy = " + ".join(f"{k + 2}/7*momentum(it).{g}^2" for k, g in enumerate(generators))
    coupled = f"momentum(it).{generators[0]}*momentum(it).{generators[-1]}/5"
    momenta = ", ".join(f"{g} = {0.3 - 0.1 * k:.1f}" for k, g in enumerate(generators))
    path = tmp_path / "any.toml"
    path.write_text(
        f'algebra = "{algebra}"\ngroup = "{group}"\n[[body]]\nname = "it"\n'
        f"momentum = {{ {momenta} }}\n"
        f'[hamiltonian]\nexpression = "{energy} + {coupled} + motor(it).s^2/3"\n'
        "[time]\nend = 1\nstep = 0.01\n"
    )
    agree_in(hamotor.load(path), "long_double", "rkmk4", *OTHERS.get(group, []))


@pytest.mark.parametrize("name", ["spring_pendulum", "breathing_body"])
def test_sparse_tables_give_the_same_bits_as_whole_ones(name: str) -> None:
    simulation = hamotor.load(name)
    ends = []
    for kernels in ("generic", "sparse"):
        library = simulation.compile(kernels=kernels, method="rkmk4").library
        assert library.description.kernels == kernels
        with library.start("rkmk4", step=1e-3, state=simulation.state) as run:
            assert run.advance(STEPS, 0, None) == STEPS
            ends.append(run.state())
    np.testing.assert_array_equal(ends[0], ends[1])


def test_a_run_says_which_kernels_it_had() -> None:
    simulation = hamotor.load("tumble")
    assert simulation.method == "splitting2"
    run = simulation.run(end=0.05, kernels="generic")
    assert run.report["kernels"] == "generic"
    assert run.report["method"] == "splitting2"
    assert "generic kernels" in run.summary()
    with pytest.raises(hamotor.UsageError, match=r'"moser_veselov2".*rkmk4'):
        simulation.run(end=0.05, method="moser_veselov2", kernels="generic")
    with pytest.raises(hamotor.UsageError, match="matrix form has no kernels"):
        simulation.run(end=0.05, kernels="generic", representation="matrix")
