"""Pairs that step the motion in coordinates of the generator's choice: `rk54` and `rk87`."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import sympy

import hamotor
from hamotor.mechanics.hamiltonian import coadjoint, inertial
from hamotor.run.build import compile_scene
from hamotor.run.library import SceneLibrary, Vector
from hamotor.scene import GeneralScene, scene_source
from hamotor.scene.methods import texts_of

MOTION = """algebra = "pga3"
[[body]]
name = "b"
mass = 2.0
inertia = [1.0, 2.0, 3.0]
center_of_mass = [0.1, 0, 0.2]
position = [0.5, 0.1, -0.2]
angular_velocity = [0.5, 1.0, 0.2]
[[interaction]]
type = "spring"
body = "b"
at = [0.3, 0.2, 0.1]
anchor = [0, 0, 3]
stiffness = 4.0
rest_length = 0.4
[[interaction]]
type = "force"
body = "b"
at = [0, 0.1, 0]
expression = "sin(3*t)*direction(0, 1, 2)"
[[interaction]]
type = "damping"
body = "b"
linear = 0.3
angular = 0.1
[time]
end = 2.0
step = 0.01
"""
"""All at once: a body off its principal frame, time, work, a root."""


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> tuple[SceneLibrary, Vector]:
    path = tmp_path_factory.mktemp("fields") / "motion.toml"
    path.write_text(MOTION)
    simulation = hamotor.load(path)
    source = scene_source(hamotor.scene.read_scene(path), method="rk87")
    assert "struct hamotor::FieldOf" in source
    listed = f'#define HAMOTOR_METHOD "rk54 rk87 rk4"\n{source}'
    return SceneLibrary(compile_scene(listed, extra_flags=["-O1"]).library), simulation.state


Ends = Callable[..., Vector]


@pytest.fixture(scope="module")
def end(motion: tuple[SceneLibrary, Vector]) -> Ends:
    library, start = motion

    @functools.cache
    def row(
        method: str, end: float = 2.0, steps: int = 1, tolerance: float | None = None
    ) -> Vector:
        with library.start(method, step=end / steps, state=start, tolerance=tolerance) as run:
            assert run.advance(steps, 0, None) == steps
            return run.observe()

    return row


@pytest.mark.parametrize("end_s", [2.0, -1.0])
def test_coordinates_do_not_change_the_motion(end: Ends, end_s: float) -> None:
    there = end("rk4", end_s, 20000)  # which steps motors and momenta, by kernels
    assert abs(there[-1]) > 0.1, "work is done"
    for method, bound in (("rk87", 1e-10), ("rk54", 1e-9)):
        apart = np.abs(end(method, end_s, tolerance=1e-11) - there).max()
        assert apart < bound, (method, apart)


@pytest.mark.parametrize(("method", "order", "steps"), [("rk54", 5, 100), ("rk87", 8, 16)])
def test_fixed_steps_converge_with_the_order(
    end: Ends, method: str, order: int, steps: int
) -> None:
    there = end("rk87", tolerance=1e-12)
    errors = [np.abs(end(method, steps=n) - there).max() for n in (steps, 2 * steps)]
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.5, errors


@pytest.mark.parametrize("method", ["rk54", "rk87"])
def test_rows_cost_no_steps_and_lie_on_the_motion(
    motion: tuple[SceneLibrary, Vector], end: Ends, method: str
) -> None:
    library, start = motion
    with library.start(method, step=2.0, state=start, tolerance=1e-8) as run:
        run.advance(1, 0, None)
        whole, taken = run.observe(), run.steps()
    with library.start(method, step=0.04, state=start, tolerance=1e-8) as run:
        run.advance(25, 0, None)
        assert np.abs(run.observe() - end("rk87", 1.0, tolerance=1e-12)).max() < 1e-6
        run.advance(25, 0, None)
        assert np.abs(run.observe() - whole).max() < 1e-12
        assert run.steps() == taken < 300


def test_a_library_of_all_methods_has_the_field() -> None:
    assert texts_of(()) == texts_of(("rk87", "rkmk4")) == "rk54"
    assert texts_of(("rkmk4",)) == texts_of((), in_coordinates=False) == ""


def general(name: str) -> GeneralScene:
    scene = hamotor.scene.read_scene(name)
    return scene if isinstance(scene, GeneralScene) else scene.general


@pytest.mark.parametrize("name", ["gravity_gradient", "free4", "rocket", "conformal_top"])
def test_only_what_cancels_exactly_is_left_out(name: str) -> None:
    h = general(name).hamiltonian
    (body,), (rates,) = h.bodies, h.rates
    symbols = sympy.symbols(f"b:{len(rates)}")
    known = dict(zip(symbols, rates, strict=True))
    left = inertial(body, symbols, rates)
    for x, whole in zip(left, coadjoint(body, symbols), strict=True):
        assert sympy.expand((x - whole).subs(known)) == 0
    if name == "gravity_gradient":
        velocities = set(symbols[3:])
        assert not any(velocities & x.free_symbols for x in left)


def test_added_mass_turns_a_body() -> None:
    assert general("kirchhoff").system.inertial is None


ORBIT = """algebra = "pga3"
[[body]]
name = "satellite"
mass = 500
inertia = [40, 380, 400]
position = [7e6, 0, 0]
velocity = [2938.5, 6950.4, 10.3]
[[interaction]]
type = "force"
body = "satellite"
expression = "sin(3*t)*direction(0, 1, 2)"
[time]
end = 1
step = 0.1
"""


def test_no_stepper_of_a_general_system_turns_a_body_by_rounding(tmp_path: Path) -> None:
    # Products of P and V are 1e10 J, of which rounding would be a torque.
    path = tmp_path / "orbit.toml"
    path.write_text(ORBIT)
    methods = "rk4 rkmk4 gauss4 lie_midpoint"
    source = scene_source(hamotor.scene.read_scene(path), method=methods)
    compiled = compile_scene(f'#define HAMOTOR_METHOD "{methods}"\n{source}', extra_flags=["-O0"])
    library = SceneLibrary(compiled.library)
    for method in methods.split():
        with library.start(method, step=0.1, state=hamotor.load(path).state) as run:
            assert run.advance(10, 0, None) == 10
            momentum = run.state()[8:]
        assert not momentum[:3].any(), method
        assert momentum[3:].all()
