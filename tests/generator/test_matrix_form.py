"""Motors and matrices, two representations of one motion, written apart: they must agree."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import hamotor
from hamotor.run.library import SceneLibrary
from hamotor.scene import bundled_scenes, parse_scene
from hamotor.scene.matrix_source import matrix_source

OFTEN = {"heavy_top", "spring_pendulum", "conformal_pendulum", "kirchhoff", "rocket"}
"""Compiled for every change; the other scenes only when asked for."""
BUNDLED = [
    pytest.param(name, marks=() if name in OFTEN else pytest.mark.long)
    for name, _ in bundled_scenes()
    if hamotor.load(name).read().group.name in ("SE3", "SO3", "SE2")  # type: ignore[misc]
]
BODY = """
[[body]]
name = "{name}"
mass = 1.5
center_of_mass = [0.1, -0.2, 0.05]
inertia = [[0.3, 0.02, 0.01], [0.02, 0.4, -0.03], [0.01, -0.03, 0.5]]
position = {position}
orientation = {{ axis = [1, 2, -1], angle = 2.8 }}
velocity = [0.3, -0.5, 0.2]
angular_velocity = [1, 2, 3]
"""
TIME = "[time]\nend = 1\nstep = 0.001\n"
GRAVITY = '[[interaction]]\ntype = "gravity"\nacceleration = [0.3, -0.2, -9.81]\n'
OWN = {
    "conformal": 'algebra = "cga3"\ngroup = "SE3"\n'
    + BODY.format(name="one", position=[1, 2, -1])
    + BODY.format(name="two", position=[0.5, 0, 0.3])
    + GRAVITY
    + '[[interaction]]\ntype = "spring"\nbody = "one"\nat = [0.2, 0, 0.1]\nother = "two"\n'
    "other_at = [0, 0.3, 0]\nstiffness = 20\nrest_length = 0.4\n" + TIME,
    "not_conservative": 'algebra = "pga3"\n'
    + BODY.format(name="one", position=[1, 2, -1])
    + '[[interaction]]\ntype = "damping"\nbody = "one"\nlinear = 0.3\nangular = 0.2\n'
    '[[interaction]]\ntype = "potential"\nexpression = "cos(3*t)*at(one, 0.1, 0.2, 0.3).z^2"\n'
    + TIME,
    "top": 'algebra = "cl3"\ngroup = "SO3"\n[[body]]\nname = "top"\n'
    "momentum = { angular = [0.3, 0.4, 5] }\n"
    '[hamiltonian]\nexpression = "Pi.x^2/2 + Pi.y^2/3 + Pi.z^2 + 3*direction(0,0,1).z'
    ' + direction(0,1,0).x*direction(1,0,0).z"\n' + TIME,
    "plane": 'algebra = "pga2"\ngroup = "SE2"\n[[body]]\nname = "plate"\n'
    "momentum = { angular = 0.3, linear = [0.4, 0.5] }\norientation = { angle = 1 }\n"
    '[hamiltonian]\nexpression = "Pi^2/2 + P.x^2 + P.y^2/3 + Pi*P.x/9'
    ' + direction(0,1).x + at(a,2).y^2"\nparameters = { a = 0.7 }\n' + TIME,
}


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Scenes of the test's own, as files."""
    folder = tmp_path_factory.mktemp("scenes")
    for name, text in OWN.items():
        (folder / f"{name}.toml").write_text(text)
    return {name: str(folder / f"{name}.toml") for name in OWN}


def both(scene: str, scalar: str = "long_double") -> tuple[hamotor.Simulation, list[SceneLibrary]]:
    simulation = hamotor.load(scene)
    return simulation, [
        simulation.compile(scalar=scalar, method="rkmk4").library,
        simulation.compile(scalar=scalar, representation="matrix").library,
    ]


def after(
    simulation: hamotor.Simulation, library: SceneLibrary, method: str, step: float, steps: int
) -> NDArray[np.longdouble]:
    with library.start(method, step=step, state=simulation.state) as run:
        assert run.advance(steps, 0, None) == steps
        return np.array(run.observe_text(), np.longdouble)


def sizes(library: SceneLibrary, row: NDArray[np.longdouble]) -> NDArray[np.longdouble]:
    """For each column the norm of what it is a component of: a body's motor, momentum, …."""
    parts = [
        re.sub(r"[^.]*$", "", column.name) or column.name for column in library.description.columns
    ]
    units = [column.unit for column in library.description.columns]
    keys = list(zip(parts, units, strict=True))
    return np.array(
        [np.linalg.norm([x for x, k in zip(row, keys, strict=True) if k == key]) for key in keys]
    )


def exactly_unit(simulation: hamotor.Simulation, library: SceneLibrary) -> NDArray[np.float64]:
    """The scene's momenta, at motors that are unit without a rounding error."""
    said = library.description
    states = simulation.state.reshape(len(said.bodies), -1).copy()
    for k, state in enumerate(states):
        rotor = [0.5, 0.5, 0.5, 0.5] if "e23" in said.motor else [0.0, 1.0]
        state[: len(rotor)] = rotor
        x = np.array([0.75 + k, -1.5, 0.25 * k])
        if len(said.motor) == 8:
            b = np.array(rotor[1:])
            state[4:8] = [*(-0.5 * (rotor[0] * x - np.cross(x, b))), -0.5 * (x @ b)]
        elif "e23" not in said.motor:
            state[2:4] = [0.5 * x[1], -0.5 * x[0]]
    return states.ravel()


@pytest.mark.parametrize("name", [*BUNDLED, *OWN])
def test_right_hand_sides_agree(name: str, own: dict[str, str]) -> None:
    """The increment of one step of a ten-thousandth of a radian, over its length: the methods'
    own errors, of fourth order, are below 1e-16 then."""
    simulation, libraries = both(own.get(name, name))
    simulation = replace(simulation, state=exactly_unit(simulation, libraries[0]))
    state = libraries[0].description.state_columns()
    start = after(simulation, libraries[0], "rkmk4", 1.0, 0)
    size = np.maximum(sizes(libraries[0], start)[state], 1e-3)

    def rates(library: SceneLibrary, step: float) -> NDArray[np.longdouble]:
        return ((after(simulation, library, "rkmk4", step, 1) - start) / step)[state]

    fastest = max(1.0, float(np.max(np.abs(rates(libraries[0], 2.0**-30)) / size)))
    one, other = (rates(library, 2.0 ** -round(np.log2(8192 * fastest))) for library in libraries)
    bound = 1e-14 * fastest * size
    if name == "double_asteroid":
        # In orbit P × V is the difference of products far larger than any torque.
        bound *= 100
    np.testing.assert_array_less(np.abs(one - other), bound)


@pytest.mark.parametrize("method", ["rkmk4", "rk4"])
@pytest.mark.parametrize("name", [*BUNDLED, *OWN])
def test_trajectories_agree_to_the_methods_errors(
    name: str, method: str, own: dict[str, str]
) -> None:
    simulation, (ga, matrix) = both(own.get(name, name))
    step = (simulation.step or 1e-3) / 8
    assert ga.description.columns == matrix.description.columns
    assert ga.description.conserved == matrix.description.conserved
    ends = []
    errors = np.zeros(len(ga.description.columns), np.longdouble)
    for library, used in ((ga, "rkmk4"), (matrix, method)):
        coarse = after(simulation, library, used, step, 400)
        ends.append(after(simulation, library, used, step / 2, 800))
        errors += sizes(ga, coarse - ends[-1])  # sixteen times the finer one's
    size = np.maximum(sizes(ga, ends[0]), 1e-6)
    # In orbit P × V of matrices is the difference of products of 1e10 N m, ten digits more than any
    # torque.
    rounding = {"gravity_gradient": 1e-7, "double_asteroid": 1e-9}.get(name, 1e-14)
    np.testing.assert_array_less(errors, 1e-4 * size)
    np.testing.assert_array_less(np.abs(ends[0] - ends[1]), errors / 8 + rounding * size)


@pytest.mark.parametrize("method", ["rkmk4", "rk4"])
def test_matrices_converge_with_order_four(method: str) -> None:
    simulation, (_, matrix) = both("spring_pendulum")
    ends = [after(simulation, matrix, method, 0.5 / steps, steps) for steps in (100, 200, 400, 800)]
    errors = [float(np.abs(a - b).max()) for a, b in itertools.pairwise(ends)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 4) < 0.25), orders


def test_a_run_in_matrices_is_a_run(tmp_path: Path) -> None:
    """Its motor follows every turn, through −1 as well."""
    runs = {
        form: hamotor.load("tumble").run(
            end=5, step=0.005, every=50, method="rkmk4", representation=form, out=tmp_path / form
        )
        for form in ("ga", "matrix")
    }
    one, other = runs["ga"], runs["matrix"]
    assert other.report["representation"] == "matrix"
    assert other.report["kernels"] == "none"
    assert "matrix form" in other.summary()
    assert "RᵀR" in other.summary()
    assert one.motor("box")[:, 0].min() < -0.5
    np.testing.assert_allclose(one.motor("box"), other.motor("box"), rtol=0, atol=1e-7)
    for said in other.conserved.values():
        assert said["max_relative_error"] < 1e-8


def test_a_method_that_only_motors_have_gives_way_unless_it_is_asked_for() -> None:
    simulation = hamotor.load("tumble")
    assert simulation.method == "splitting2"
    run = simulation.run(end=0.1, representation="matrix")
    assert run.report["method"] == "rkmk4"
    with pytest.raises(hamotor.UsageError, match=r'"splitting2".*rkmk4'):
        simulation.run(end=0.1, method="splitting2", representation="matrix")
    with pytest.raises(hamotor.UsageError, match="plain sums; leave compensated out"):
        simulation.run(end=0.1, compensated=True, representation="matrix")


def scene_of(text: str) -> Any:
    return parse_scene(text.encode(), name="test", file="test.toml")


def test_what_has_no_matrix_form_says_so() -> None:
    growing = scene_of(
        'algebra = "cga3"\ngroup = "Sim3"\n[[body]]\nname = "one"\n[hamiltonian]\n'
        'expression = "(dot(P, P) + momentum(one).e12^2 + momentum(one).e0i^2)/2"\n' + TIME
    )
    with pytest.raises(hamotor.UsageError, match=r"Sim3 has no matrix form.*SE\(3\)"):
        matrix_source(growing, "double")
    spinor = scene_of(
        'algebra = "pga3"\n[[body]]\nname = "one"\n[hamiltonian]\n'
        'expression = "dot(P, P) + dot(Pi, Pi) + motor(one).e12"\n' + TIME
    )
    with pytest.raises(hamotor.UsageError, match=r"component e12.*one rotation"):
        matrix_source(spinor, "double")
