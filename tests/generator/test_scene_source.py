"""The C++ of a scene: what stands in it, and that it moves as classical mechanics says."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.rigid import RIGID, parse_scene, read_scene

from hamotor.errors import UsageError
from hamotor.run.build import compile_scene
from hamotor.run.library import SceneLibrary
from hamotor.scene import Scene, scene_source
from hamotor.scene.motors import rotation_matrix

Array = NDArray[np.float64]
ORACLES = Path(__file__).resolve().parents[1] / "oracles"


def scene(text: str) -> Scene:
    return parse_scene(text.encode(), name="test", file="test.toml")


def library(of: Scene, method: str, scalar: str = "double") -> SceneLibrary:
    source = scene_source(of, scalar=scalar)
    text = f'#define HAMOTOR_METHOD "{method}"\n{source}'
    return SceneLibrary(compile_scene(text).library)


class TestText:
    """Data and types, and nothing that the scene does not need."""

    def test_equal_scenes_give_equal_text(self) -> None:
        assert scene_source(read_scene("two_bodies")) == scene_source(read_scene("two_bodies"))

    def test_numbers_read_back_exactly(self) -> None:
        planar = read_scene("planar")
        found = re.search(r"plate_moments\{\s*([^}]*)\}", scene_source(planar))
        assert found is not None
        assert (float(found[1]),) == planar.principal[0].moments

    def test_literals_have_the_precision_of_the_scalar(self) -> None:
        assert "{0.02, 0.05, 0.06}" in re.sub(r"\s+", " ", self.flat("double"))
        assert "{0.02F, 0.05F, 0.06F}" in self.flat("float")
        assert "{(S(1) / S(50)), (S(1) / S(20)), (S(3) / S(50))}" in self.flat("quad")

    def flat(self, scalar: str) -> str:
        text = re.sub(r"\s+", " ", scene_source(read_scene("two_bodies"), scalar=scalar))
        return text.replace("{ ", "{")

    def test_a_free_body_has_no_interaction(self) -> None:
        text = scene_source(read_scene("tumble"))
        assert "Gravity" not in text
        assert "Spring" not in text

    def test_where_forces_act_is_said_of_bodies_in_space(self) -> None:
        def points(name: str) -> list[str]:
            text = re.sub(r"\s+", "", scene_source(read_scene(name)))
            found = re.findall(r"(\w+)_points\{\{(.*?)\}\};", text)
            assert text.count("_points)>") == len(found)
            return [f"{body}{at}" for body, at in found]

        assert points("heavy_top") == ["top{0,0,0.05}"]
        assert points("spring_pendulum") == ["brick{0.05,0.1,0.15}"]
        assert points("tumble") == []
        assert points("planar") == []

    def test_a_spring_without_rest_length_has_the_smooth_potential(self) -> None:
        text = (BODIES["SE2"] + "[time]\nend = 1\nstep = 0.1\n").replace("rest_length = 0.3\n", "")
        assert "RestLength::zero" in scene_source(scene(text))
        assert "RestLength::positive" not in scene_source(scene(text))

    def test_gravities_are_added_and_vanishing_ones_left_out(self) -> None:
        gravity = '[[interaction]]\ntype = "gravity"\nacceleration = [0, 0, {}]\n'
        body = 'algebra = "pga3"\n[[body]]\nname = "b"\nmass = 1\ninertia = [1, 1, 1]\n'
        time = "[time]\nend = 1\nstep = 0.1\n"
        half = scene_source(scene(body + 2 * gravity.format(-4.9) + time))
        assert half.count("UniformGravity") == 1
        assert "{0, 0, -9.8}" in half
        none = scene_source(scene(body + gravity.format(1) + gravity.format(-1) + time))
        assert "UniformGravity" not in none

    def test_the_text_holds_nothing_of_the_file_but_checked_names(self) -> None:
        source = scene_source(
            parse_scene(
                b'description = "*/ \\\\ #include"\n' + BODIES["SE3"].encode() + TIME,
                name='"; int x\\\n',
                file="x",
            )
        )
        assert "#include <" not in source
        assert 'name = "scene____int_x__"' in source

    @pytest.mark.parametrize(("what", "word"), [("kernels", "generatd"), ("scalar", "doubel")])
    def test_unknown_kernels_and_scalars_are_usage_errors(self, what: str, word: str) -> None:
        with pytest.raises(UsageError, match=f'unknown {what} "{word}".*Did you mean'):
            scene_source(read_scene("tumble"), **{what: word})

    def test_a_body_too_small_for_single_precision_is_refused(self) -> None:
        text = BODIES["SE2"].replace("mass = 2.0\ninertia = 0.7", "mass = 1e-20\ninertia = 1e-30")
        with pytest.raises(UsageError, match=r'body "b": the mass 1e-20 is too small for float'):
            scene_source(scene(text + TIME.decode()), scalar="float")


TIME = b"[time]\nend = 1\nstep = 0.1\n"
SPRINGS = """
[[interaction]]
type = "spring"
body = "a"
at = {at}
other = "b"
other_at = {other_at}
stiffness = 2.0
rest_length = 0.3
[[interaction]]
type = "spring"
body = "b"
at = {other_at}
anchor = {anchor}
stiffness = 3.0
"""
GRAVITY = """
[[interaction]]
type = "gravity"
acceleration = {}
"""
IN_SPACE = """
[[body]]
name = "a"
mass = 1.3
inertia = [[1.0, 0.2, -0.1], [0.2, 1.4, 0.3], [-0.1, 0.3, 1.1]]
center_of_mass = [0.2, -0.1, 0.3]
position = [0.5, 0.1, -0.4]
orientation = { axis = [1, -2, 0.5], angle = 0.9 }
{velocity}
angular_velocity = [0.5, -1.0, 0.7]
[[body]]
name = "b"
points = [
  { mass = 0.5, at = [0.4, 0, 0] }, { mass = 0.7, at = [0, 0.6, 0.1] },
  { mass = 0.4, at = [0, -0.1, 0.5] }, { mass = 0.3, at = [-0.3, -0.2, -0.3] },
]
position = [-0.8, 0.6, 0.3]
orientation = { quaternion = [0.5, -0.5, 0.5, 0.5] }
angular_velocity = [-0.3, 0.4, 1.2]
"""
SPATIAL_SPRINGS = SPRINGS.format(at=[0.3, 0.2, -0.1], other_at=[-0.2, 0.4, 0.1], anchor=[0, 1, 2])
BODIES = {
    "SE3": 'algebra = "pga3"\n'
    + IN_SPACE.replace("{velocity}", "velocity = [0.3, 0.1, -0.2]")
    + SPATIAL_SPRINGS
    + GRAVITY.format([0.3, -0.5, -2]),
    "SO3": 'algebra = "pga3"\ngroup = "SO3"\n'
    + IN_SPACE.replace("{velocity}", "")
    + SPATIAL_SPRINGS
    + GRAVITY.format([0.3, -0.5, -2]),
    "SE2": """
algebra = "pga2"
[[body]]
name = "a"
box = [0.6, 0.8]
mass = 1.5
center_of_mass = [0.2, -0.1]
position = [0.5, 0.1]
orientation = { angle = 0.7 }
velocity = [0.3, -0.4]
angular_velocity = 1.1
[[body]]
name = "b"
mass = 2.0
inertia = 0.7
position = [-0.8, 0.6]
angular_velocity = -0.6
"""
    + SPRINGS.format(at=[0.3, 0.2], other_at=[-0.2, 0.4], anchor=[0, 1])
    + GRAVITY.format([0.3, -2]),
}


def newton_euler(of: Scene, end: float, steps: int) -> tuple[Array, Array]:
    """Orientations (n, 3, 3) and places (n, 3) of the centres of mass at `end`, world frame.

    Newton's and Euler's equations for rotation matrices and world momenta, fourth-order
    Runge–Kutta. A planar body is one that turns about the third axis.
    """

    def in_space(x: tuple[float, ...] | None) -> Array:
        return np.array([*(x or (0.0, 0.0, 0.0)), 0.0][:3])

    translates, n = of.group.translates, len(of.bodies)
    gravity, centers = in_space(of.gravity), [in_space(b.center_of_mass) for b in of.bodies]
    tensors, rotations, places, linear, angular = [], [], [], [], []
    for body, c in zip(of.bodies, centers, strict=True):
        rotation = np.eye(3)
        rotation[: of.group.dimension, : of.group.dimension] = rotation_matrix(body.rotor)
        about = (
            np.array(body.inertia) if of.group.dimension == 3 else body.inertia[0][0] * np.eye(3)
        )
        if not translates:
            about = about + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
        rate = body.rate
        spin = rate[:3] if of.group.dimension == 3 else np.array([0, 0, rate[0]])
        velocity = in_space(tuple(rate[of.group.rotations :])) + np.cross(spin, c)
        tensors.append(about)
        rotations.append(rotation)
        places.append(in_space(body.position) + (rotation @ c if translates else 0))
        linear.append(body.mass * rotation @ velocity if translates else np.zeros(3))
        angular.append(rotation @ about @ spin)
    state = [np.array(x) for x in (rotations, places, linear, angular)]
    index = {body.name: k for k, body in enumerate(of.bodies)}

    def slope(state: list[Array]) -> list[Array]:
        rotation, place, p, l = state
        turned, moved, force, torque = (np.zeros_like(x) for x in state)
        for k, body in enumerate(of.bodies):
            x, y, z = rotation[k] @ np.linalg.solve(tensors[k], rotation[k].T @ l[k])
            turned[k] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ rotation[k]
            moved[k], force[k] = p[k] / body.mass, body.mass * gravity
            if not translates:
                torque[k] = np.cross(rotation[k] @ centers[k], force[k])
        for spring in of.springs:
            ends = [(index[spring.body], in_space(spring.at))]
            if spring.other is not None:
                ends.append((index[spring.other], in_space(spring.other_at)))
            arms = [rotation[k] @ (at - (centers[k] if translates else 0)) for k, at in ends]
            far = in_space(spring.anchor) if spring.other is None else place[ends[1][0]] + arms[1]
            d = far - place[ends[0][0]] - arms[0]
            pull = spring.stiffness * (1 - spring.rest_length / np.linalg.norm(d)) * d
            for (k, _), arm, f in zip(ends, arms, (pull, -pull), strict=False):
                force[k] += f
                torque[k] += np.cross(arm, f)
        return [turned, moved, force, torque] if translates else [turned, 0 * moved, 0 * p, torque]

    h = end / steps
    for _ in range(steps):
        one = slope(state)
        two = slope([x + h / 2 * s for x, s in zip(state, one, strict=True)])
        three = slope([x + h / 2 * s for x, s in zip(state, two, strict=True)])
        four = slope([x + h * s for x, s in zip(state, three, strict=True)])
        state = [
            x + h / 6 * (a + 2 * b + 2 * c + d)
            for x, a, b, c, d in zip(state, one, two, three, four, strict=True)
        ]
    assert len(state[0]) == n
    return state[0], state[1]


@pytest.mark.parametrize("group", list(BODIES))
def test_a_compiled_scene_moves_as_newton_and_euler_say(group: str) -> None:
    """Matrix inertia, centres of mass off the origin, gravity, both springs, two bodies."""
    of, end = scene(BODIES[group] + TIME.decode()), 1.0
    rotations, places = newton_euler(of, end, 1000)
    compiled = library(of, "rkmk4")
    size = len(of.group.motor) + len(of.group.generators)
    with compiled.start("rkmk4", step=end / 1000, state=of.initial_state) as run:
        assert run.state() == pytest.approx(of.initial_state, abs=2e-15)
        assert run.advance(1000, 1, None) == 1000
        state, row = run.state(), run.observe()
    d = of.group.dimension
    for k, body in enumerate(of.bodies):
        rotation = rotation_matrix(state[k * size :][: 4 if d == 3 else 2].tolist())
        assert rotation == pytest.approx(rotations[k][:d, :d], abs=1e-10)
        if of.group.translates:
            position = row[compiled.description.position_columns(body.name)]
            center = position + rotation @ np.array(body.center_of_mass)
            assert center == pytest.approx(places[k][:d], abs=1e-10)


@pytest.mark.parametrize("name", RIGID)
def test_a_compiled_scene_conserves_what_it_says(name: str) -> None:
    """And what Python says of the start is what the library observes there."""
    of = read_scene(name)
    compiled = library(of, "splitting2")
    column = compiled.description.column_index
    with compiled.start("splitting2", step=1e-4, state=of.initial_state) as run:
        first = run.observe()
        assert run.advance(2000, 1, None) == 2000
        last = run.observe()
    conserved = {q.name: q for q in compiled.description.conserved}
    assert list(conserved) == [q.name for q in of.conserved]
    for quantity in of.conserved:
        norm = np.linalg.norm([first[column[name]] for name in quantity.norm])
        if quantity.norm and quantity.scale:
            assert norm == pytest.approx(quantity.scale, rel=1e-13)
        bound = 1e-6 if quantity.name == "energy" else 1e-13
        error = abs(last[column[quantity.name]] - first[column[quantity.name]])
        assert error <= bound * (quantity.scale or norm or 1)
    spatial = [first[column[f"spatial_momentum.{g}"]] for g in of.group.generators]
    bound = 1e-15 * max(1.0, *map(abs, spatial))
    assert spatial == pytest.approx(of.initial_spatial_momentum, rel=1e-13, abs=bound)
    kinetic, potential, magnitude = of.initial_energy
    assert first[column["energy"]] == pytest.approx(kinetic + potential, abs=1e-14 * magnitude)


def test_combinations_and_casimirs_have_columns_that_stay_constant() -> None:
    free = """
[[body]]
name = "free"
mass = 1
inertia = [1, 2, 2.5]
velocity = [1, 2, 3]
angular_velocity = [1, 2, 3]
"""
    bodies = IN_SPACE.replace("{velocity}", "")
    of = scene('algebra = "pga3"\n' + bodies + free + SPATIAL_SPRINGS + TIME.decode())
    compiled = library(of, "splitting2")
    names = [q.name for q in compiled.description.conserved]
    assert "spatial_momentum.e23_about_axis" in names
    assert "free.casimir.p_dot_pi" in names
    with compiled.start("splitting2", step=1e-3, state=of.initial_state) as run:
        first = run.observe()
        assert run.advance(2000, 1, None) == 2000
        last = run.observe()
    for name in names[1:]:
        k = compiled.description.column_index[name]
        assert last[k] == pytest.approx(first[k], rel=1e-12)


ORACLE_SCENES = {
    "01_free_asymmetric_pga3": """
algebra = "pga3"
[[body]]
name = "body"
mass = 2.0
inertia = [1.0, 2.0, 3.5]
allow_unphysical_inertia = true
position = [0.5, -0.25, 1.0]
orientation = { quaternion = [0.44444444444444444, 0.44444444444444444, 0.77777777777777778, 0] }
velocity = [0.3, -0.2, 0.1]
angular_velocity = [0.4, 1.1, -0.3]
""",
    "05_spring_gravity_pga3": """
algebra = "pga3"
[[body]]
name = "body"
mass = 1.5
inertia = [0.4, 0.7, 0.9]
position = [0.3, -0.1, 0.4]
orientation = { quaternion = [0.44444444444444444, 0.11111111111111111, 0.88888888888888889, 0] }
velocity = [0.2, -0.6, 0.3]
angular_velocity = [0.8, 0.5, -1.1]
[[interaction]]
type = "gravity"
acceleration = [0, 0, -0.98]
[[interaction]]
type = "spring"
body = "body"
at = [0.3, -0.2, 0.5]
anchor = [0.2, 0.1, 2.0]
stiffness = 6.0
rest_length = 0.8
""",
    # J = diag(1.2, 2, 2.7) about the fixed point, m g = 3, c = (0.2, 0.1, 0.5): with m = 0.1 the
    # tensor about the centre of mass is J - m (c² 1 - c cᵀ).
    "03_heavy_top_cl3": """
algebra = "pga3"
group = "SO3"
[[body]]
name = "top"
mass = 0.1
inertia = [[1.174, 0.002, 0.01], [0.002, 1.971, 0.005], [0.01, 0.005, 2.695]]
center_of_mass = [0.2, 0.1, 0.5]
orientation = { quaternion = [0.4, -0.2, 0.4, 0.8] }
angular_velocity = [0.5, -0.3, 2.0]
[[interaction]]
type = "gravity"
acceleration = [0, 0, -30]
""",
}


@pytest.mark.parametrize("oracle", list(ORACLE_SCENES))
def test_a_scene_file_reaches_the_oracle(oracle: str) -> None:
    """The whole way: TOML, principal frame, C++, compiler, stepper."""
    expected = json.loads((ORACLES / f"{oracle}.json").read_text(encoding="utf-8"))
    of = scene(ORACLE_SCENES[oracle] + TIME.decode())
    step, time = 2.0**-11, 0.0
    with library(of, "rkmk4").start("rkmk4", step=step, state=of.initial_state) as run:
        for there in expected["states"]:
            steps = round((float(there["t"]) - time) / step)
            time = float(there["t"])
            assert run.advance(steps, 1, None) == steps
            state = run.state()
            rotation = np.array(there["R"], dtype=float)
            assert rotation_matrix(state[:4].tolist()) == pytest.approx(rotation, abs=1e-10)
            momentum = [*there["Pi_body"], *there.get("P_body", [])]
            assert state[len(of.group.motor) :] == pytest.approx(
                np.array(momentum, dtype=float), abs=1e-10
            )
            for blade, value in there["M"].items():
                name = "s" if blade == "1" else "e" + re.sub("[e^]", "", blade)
                k = of.group.motor.index(name.replace("e13", "e31"))
                sign = -1 if name == "e13" else 1
                assert sign * state[k] == pytest.approx(float(value), abs=1e-10)


def test_a_spring_and_the_same_potential_as_an_expression_move_alike() -> None:
    """In a frame that is not the principal one; both as kicks of the splitting."""
    head = """
algebra = "pga3"
[[body]]
name = "brick"
mass = 1.5
inertia = [[0.4, 0.05, 0], [0.05, 0.7, 0], [0, 0, 0.9]]
center_of_mass = [0.1, 0, 0]
position = [0.3, -0.1, 0.4]
velocity = [0.2, -0.6, 0.3]
angular_velocity = [0.8, 0.5, -1.1]
[[interaction]]
"""
    spring = """
type = "spring"
body = "brick"
at = [0.3, -0.2, 0.5]
anchor = [0.2, 0.1, 2.0]
stiffness = 6
rest_length = 0.8
"""
    potential = """
type = "potential"
expression = "k/2*(distance(at(brick, 0.3, -0.2, 0.5), a) - l)^2"
parameters = { k = 6.0, a = [0.2, 0.1, 2.0], l = 0.8 }
"""
    ends = []
    for acting in (spring, potential):
        of = scene(f"{head}{acting}[time]\nend = 1\nstep = 0.01\n")
        with library(of, "splitting2").start(
            "splitting2", step=0.01, state=of.initial_state
        ) as run:
            run.advance(200, 1, None)
            ends.append(run.state())
    assert ends[0] == pytest.approx(ends[1], abs=1e-13)
