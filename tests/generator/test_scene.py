"""Scenes that are right: what is read is what was written."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from tests.rigid import parse_scene, read_scene

from hamotor import scene as scenes
from hamotor.scene import (
    GROUPS,
    Gravity,
    Scene,
    Spring,
    bundled_scenes,
    scene_reference,
    starter_scene,
)
from hamotor.scene.reading import BUNDLED
from hamotor.scene.schema import INTERACTIONS, SECTIONS, STARTER_SECTIONS

# Initial states of the oracles 01 and 05: physical input, motor, and momentum, to all digits.
FREE_BODY = """
algebra = "pga3"
[[body]]
name = "body"
mass = 2.0
inertia = [1.0, 2.0, 3.5]
allow_unphysical_inertia = true
position = [0.5, -0.25, 1.0]
orientation = { quaternion = [0.4444444444444444444, 0.4444444444444444444, 0.7777777777777777778, 0] }
velocity = [0.3, -0.2, 0.1]
angular_velocity = [0.4, 1.1, -0.3]
[time]
end = 5
step = 0.01
"""  # noqa: E501
SPRING_AND_GRAVITY = """
algebra = "pga3"
[[body]]
name = "body"
mass = 1.5
inertia = [0.4, 0.7, 0.9]
position = [0.3, -0.1, 0.4]
orientation = { quaternion = [0.4444444444444444444, 0.1111111111111111111, 0.8888888888888888889, 0] }
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
[time]
end = 5
step = 0.01
"""  # noqa: E501


def scene(text: str) -> Scene:
    return parse_scene(text.encode(), name="test", file="test.toml")


def test_the_initial_state_of_a_free_body_is_right_to_the_last_digit() -> None:
    """Oracle 01, whose moments no body has: 3.5 > 1 + 2."""
    expected = [
        0.4444444444444444444,
        -0.4444444444444444444,
        -0.7777777777777777778,
        0.0,
        0.2777777777777777778,
        -0.1666666666666666667,
        -0.4722222222222222222,
        0.01388888888888888889,
        0.4,
        2.2,
        -1.05,
        0.6,
        -0.4,
        0.2,
    ]
    assert scene(FREE_BODY).initial_state.tolist() == pytest.approx(expected, rel=1e-15, abs=0)


def test_the_initial_state_on_a_spring_is_right_to_the_last_digit() -> None:
    """Oracle 05."""
    expected = [
        0.4444444444444444444,
        -0.1111111111111111111,
        -0.8888888888888888889,
        0.0,
        0.1111111111111111111,
        0.0,
        -0.2277777777777777778,
        -0.02777777777777777778,
        0.32,
        0.35,
        -0.99,
        0.3,
        -0.9,
        0.45,
    ]
    state = scene(SPRING_AND_GRAVITY).initial_state
    assert state.tolist() == pytest.approx(expected, rel=2e-15, abs=2e-17)


def test_everything_of_a_scene_arrives() -> None:
    read = scene(SPRING_AND_GRAVITY)
    assert (read.algebra, read.group.name) == ("pga3", "SE3")
    assert read.interactions == (
        Gravity(acceleration=(0.0, 0.0, -0.98)),
        Spring(
            body="body",
            at=(0.3, -0.2, 0.5),
            anchor=(0.2, 0.1, 2.0),
            other=None,
            other_at=None,
            stiffness=6.0,
            rest_length=0.8,
        ),
    )
    assert read.gravity == (0.0, 0.0, -0.98)
    assert read.springs == read.interactions[1:]
    assert (read.time.end, read.time.step, read.time.tolerance) == (5.0, 0.01, None)
    assert read.time.method == "auto"
    assert read.output.every == 1
    assert re.fullmatch("[0-9a-f]{64}", read.sha256)


def test_the_three_forms_of_an_orientation_agree() -> None:
    text = FREE_BODY.replace(re.findall("orientation = .*", FREE_BODY)[0], "orientation = {}")
    half = math.sqrt(0.5)
    forms = {
        "axis": "{ axis = [0, 0, 5], angle = 1.5707963267948966 }",
        "quaternion": f"{{ quaternion = [{half!r}, 0, 0, {half!r}] }}",
        "rounded": "{ quaternion = [0.7071068, 0, 0, 0.7071068] }",
        "matrix": "{ matrix = [[0, -1, 0], [1, 0, 0], [0, 0, 1]] }",
    }
    for form in forms.values():
        rotor = scene(text.replace("orientation = {}", f"orientation = {form}")).bodies[0].rotor
        assert rotor == pytest.approx((half, 0, 0, -half), abs=2e-16)
    assert scene(text).bodies[0].rotor == (1.0, 0.0, 0.0, 0.0)


def test_a_planar_body_turns_anticlockwise() -> None:
    text = """
    algebra = "pga2"
    [[body]]
    name = "disk"
    mass = 2
    disk = 0.5
    center_of_mass = [0.1, 0]
    position = [3, 4]
    orientation = { angle = 1.0 }
    velocity = [1, 2]
    angular_velocity = 3
    [time]
    end = 1
    tolerance = 1e-9
    """
    body = scene(text).bodies[0]
    assert body.in_world((1.0, 0.0)) == pytest.approx([3 + math.cos(1), 4 + math.sin(1)])
    # Points of the sandwich M X M~: x = R X + t with t = -2 (e01, e02) turned back by the rotor.
    s, e12, e01, e02 = body.motor
    assert (-2 * (e01 * s + e02 * e12), -2 * (e02 * s - e01 * e12)) == pytest.approx((3, 4))
    # p = m (V + Ω×c), π = J Ω + c×p
    assert body.momentum == pytest.approx((0.25 * 3 + 0.1 * 2 * 2.3, 2.0, 2 * 2.3))
    assert body.rate == pytest.approx([3, 1, 2])
    assert scene(text).group is GROUPS["SE2"]
    chosen = 'step = 0.1\n    method = "rkmk54"\n    local_tolerance = 1e-6'
    assert scene(text.replace("tolerance = 1e-9", chosen)).time.local_tolerance == 1e-6
    assert scene(text).time.compensated is None
    plain = text.replace("tolerance = 1e-9", "tolerance = 1e-9\n    compensated = false")
    assert scene(plain).time.compensated is False


def test_the_state_of_a_fixed_point_is_a_rotor_and_an_angular_momentum() -> None:
    top = read_scene("heavy_top")
    assert len(top.initial_state) == 7
    assert top.bodies[0].momentum == pytest.approx((0, 0, 0.5 * 0.2 * 0.04**2 * 150))


def test_a_point_on_a_rigid_massless_rod_is_a_body_with_a_fixed_point() -> None:
    """Its inertia about its own centre vanishes, the one about an off-axis pivot does not."""
    text = """
    algebra = "pga3"
    group = "SO3"
    [[body]]
    name = "rod"
    points = [{ mass = 1, at = [1, 0, 0] }, { mass = 1, at = [1, 1, 0] }]
    [time]
    end = 1
    step = 0.1
    """
    body = scene(text).bodies[0]
    assert body.kinetic_matrix == pytest.approx(np.array([[1, -1, 0], [-1, 2, 0], [0, 0, 3]]))


def test_bundled_scenes_are_the_promised_ones_and_describe_themselves() -> None:
    described = dict(bundled_scenes())
    assert set(described) >= {
        "dzhanibekov",
        "heavy_top",
        "planar",
        "spring_pendulum",
        "tumble",
        "two_bodies",
    }
    assert all(20 < len(description) < 100 for description in described.values())


@pytest.mark.parametrize("name", [name for name, _ in bundled_scenes()])
def test_a_bundled_scene_reads_and_its_lines_fit(name: str) -> None:
    assert scenes.read_scene(name).name == name
    lines = (BUNDLED / f"{name}.toml").read_text(encoding="utf-8").split("\n")
    assert max(map(len, lines)) <= 110


def test_tumble_is_the_published_conservation_test() -> None:
    tumble = read_scene("tumble")
    a, b, c = 0.1**2, 0.2**2, 0.3**2
    assert tumble.bodies[0].rate == pytest.approx([1, 2, 3, 0, 0, 0])
    assert tumble.principal[0].moments == pytest.approx(((b + c) / 12, (a + c) / 12, (a + b) / 12))
    assert tumble.time.step == 0.01
    assert tumble.time.end == 5.0


def test_the_handle_of_dzhanibekov_spins_about_its_intermediate_axis() -> None:
    handle = read_scene("dzhanibekov").bodies[0]
    first, second, third = handle.principal.moments
    assert first < second < third
    assert handle.center_of_mass == (0.0, 0.0, 0.0)
    assert abs(handle.rate[1]) > 100 * max(abs(handle.rate[0]), abs(handle.rate[2]))


def test_a_file_is_named_by_its_stem_made_an_identifier(tmp_path: Path) -> None:
    for stem, name in [("my-top", "my_top"), ("2nd", "scene_2nd"), ("a\nb */", "a_b___")]:
        file = tmp_path / "x.toml"
        file.write_text(FREE_BODY, encoding="utf-8")
        assert parse_scene(file.read_bytes(), name=stem, file="x").name == name


def test_a_bundled_name_comes_before_a_file_and_a_path_is_a_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("tumble").write_text(FREE_BODY, encoding="utf-8")
    Path("mine").write_text(FREE_BODY, encoding="utf-8")
    assert read_scene("tumble").bodies[0].name == "box"
    assert read_scene("./tumble").bodies[0].name == "body"
    assert read_scene(Path("tumble")).bodies[0].name == "body"
    assert read_scene("mine").name == "mine"


def test_the_starter_scene_reads_as_it_is_and_with_its_alternatives() -> None:
    starter = starter_scene()
    assert scene(starter).springs
    assert max(map(len, starter.split("\n"))) <= 100
    for alternative, instead_of in [
        ("box", ["inertia"]),
        ("ellipsoid", ["inertia"]),
        ("cylinder", ["inertia"]),
        ("points", ["inertia", "mass", "center_of_mass"]),
        ("momentum", ["velocity", "angular_velocity"]),
        ("tolerance", ["step"]),
        ("bodies", []),
        ("interactions", []),
        ("group", []),
    ]:
        text = re.sub(rf"(?m)^# ({alternative} = )", r"\1", starter)
        assert text != starter
        for key in instead_of:
            text = re.sub(rf"(?m)^{key} = .*$", "", text)
        scene(text)


def test_the_starter_scene_has_every_key_of_a_spatial_scene() -> None:
    starter = starter_scene()
    for section in STARTER_SECTIONS:
        if section.heading.startswith("["):
            for key in section.keys:
                if key.where in {"", "3-D", "translating"}:
                    assert re.search(rf"(?m)^(# )?{key.name} = ", starter), key.name


def test_the_reference_names_every_key_with_its_unit() -> None:
    reference = scene_reference()
    for section in SECTIONS:
        for key in section.keys:
            assert f"| `{key.name}` | {key.unit} |" in reference


def test_defaults_in_the_schema_are_toml() -> None:
    for section in SECTIONS:
        for key in section.keys:
            for text in filter(None, (key.default, key.example)):
                tomllib.loads(f"{key.name} = {text}")
    assert {"gravity", "spring", "potential", "force"} <= set(INTERACTIONS)
