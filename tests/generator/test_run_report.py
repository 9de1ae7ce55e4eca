"""`run.json`, the summary, and the run object."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.generator.toy import RATE, toy

import hamotor
from hamotor.errors import UsageError
from hamotor.run.attitude import angle_between, has_attitude, rotation_matrices
from hamotor.run.report import summary, to_json


def report_on_disk(folder: Path, **options: Any) -> Any:
    toy().run(out=folder, pictures=False, **options)
    return json.loads((folder / "run.json").read_text(), parse_constant=pytest.fail)


def test_the_report_holds_what_the_contract_promises(tmp_path: Path) -> None:
    said = report_on_disk(tmp_path)
    promised = """scene algebra group method method_reason order step steps t_end scalar kernels
        representation status final conserved drift timing provenance"""
    assert set(promised.split()) <= said.keys()
    assert set(said["final"]["bob"]) == {"motor", "momentum", "position", "rotation", "scale"}
    assert {"initial", "final", "max_relative_error"} <= said["conserved"]["energy"].keys()
    assert {"generate_s", "compile_s", "integrate_s", "ns_per_step"} <= said["timing"].keys()
    assert {"version", "spec", "compiler", "flags", "processor", "fma"} <= said["provenance"].keys()
    assert (said["scene"], said["algebra"], said["group"]) == ("toy", "pga3", "SE3")
    assert (said["order"], said["steps"], said["step"], said["t_end"]) == (2, 1000, 0.01, 10.0)
    assert (said["status"], said["representation"]) == ("finished", "ga")
    assert said["provenance"]["spec"] == "0123abcd"


def test_the_final_state_is_the_last_row_to_the_last_bit(tmp_path: Path) -> None:
    said = report_on_disk(tmp_path)
    table = hamotor.read_trajectory(tmp_path)
    for part in ("motor", "momentum"):
        for name, value in said["final"]["bob"][part].items():
            assert value == table[f"bob.{part}.{name}"][-1]


def test_results_carry_seventeen_digits() -> None:
    text = to_json({"final": {"x": 0.1, "n": 3.0, "m": [1 / 3]}, "step": 0.1})
    assert '"x": 0.10000000000000001' in text
    assert '"n": 3.0' in text
    assert "0.33333333333333331" in text
    assert '"step": 0.1' in text


def test_any_double_survives_the_report() -> None:
    generator = np.random.default_rng(7)
    numbers = generator.standard_normal(2000) * 10.0 ** generator.integers(-300, 300, 2000)
    values = [*numbers.tolist(), 5e-324, 1.7976931348623157e308, -0.0, 0.0]
    assert json.loads(to_json({"final": {"x": values}}))["final"]["x"] == values


def test_what_is_not_finite_is_null_so_that_any_reader_can_read_it() -> None:
    said = json.loads(to_json({"a": math.nan, "b": math.inf}), parse_constant=pytest.fail)
    assert said == {"a": None, "b": None}


def test_a_quarter_turn_about_e3_takes_the_first_axis_to_the_second() -> None:
    half = math.pi / 4
    zero = np.zeros(1)
    blades = {"s": np.array([math.cos(half)]), "e12": np.array([-math.sin(half)])}
    space = rotation_matrices({**blades, "e23": zero, "e31": zero})[0]
    np.testing.assert_allclose(space, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(rotation_matrices(blades)[0], [[0, -1], [1, 0]], atol=1e-15)


def test_rotation_matrices_are_those_of_the_quaternion() -> None:
    q = np.random.default_rng(3).standard_normal((500, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    blades = {"s": q[:, 0], "e23": -q[:, 1], "e31": -q[:, 2], "e12": -q[:, 3]}
    matrices = rotation_matrices(blades)
    v = np.random.default_rng(4).standard_normal((500, 3))
    axis, w = q[:, 1:], q[:, :1]
    rotated = v + 2 * np.cross(axis, np.cross(axis, v) + w * v)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", matrices, v), rotated, atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 1.5, 3.1])
def test_the_angle_between_attitudes_keeps_its_digits(angle: float) -> None:
    blades = {"s": np.cos([0.4, 0.4 + angle / 2]), "e12": -np.sin([0.4, 0.4 + angle / 2])}
    zero = np.zeros(2)
    for motor in (blades, {**blades, "e23": zero, "e31": zero}):
        one, other = rotation_matrices(motor)
        found = angle_between(one[np.newaxis], other[np.newaxis])[0]
        assert found == pytest.approx(angle, rel=1e-9, abs=1e-15)


def test_the_arrays_of_a_run_have_the_shapes_they_promise() -> None:
    run = toy().run()
    n = 1001
    assert run.t.shape == run.energy.shape == (n,)
    assert run.motor("bob").shape == (n, 8)
    assert run.momentum().shape == (n, 6)
    assert run.position().shape == (n, 3)
    assert run.rotation().shape == (n, 3, 3)
    assert run.units["bob.momentum.e01"] == "kg m/s"
    angle = np.unwrap(np.arctan2(run.rotation()[:, 1, 0], run.rotation()[:, 0, 0]))
    np.testing.assert_allclose(angle, RATE * run.t, atol=1e-9)


def test_an_unknown_body_is_a_usage_error_with_a_suggestion() -> None:
    with pytest.raises(UsageError, match=r'unknown body "bop".*Did you mean "bob"'):
        toy().run().motor("bop")


def test_a_run_read_from_disk_is_the_run(tmp_path: Path) -> None:
    run = toy().run(out=tmp_path, pictures=False)
    for path in (tmp_path, tmp_path / "run.json"):
        read = hamotor.open_run(path)
        assert read.report == json.loads(to_json(run.report))
        np.testing.assert_array_equal(read.motor(), run.motor())
        assert read.units == run.units


def test_the_summary_tells_what_a_person_wants_to_know(tmp_path: Path) -> None:
    text = toy().run(out=tmp_path, method="euler", step=0.3).summary()
    assert "toy · SE3 in pga3 · euler (order 1)" in text
    assert "34 steps of 0.294118 s to t = 10 s" in text
    assert "ns/step" in text
    assert "the step was shortened from 0.3 s" in text
    assert "energy" in text
    assert "absolute: zero at the start" in text
    assert "before renormalisation" in text
    assert str(tmp_path) in text
    assert "path.png" in text
    assert max(map(len, text.splitlines())) <= 110


def test_the_summary_of_a_failed_run_says_how_far_it_came() -> None:
    with pytest.raises(hamotor.RunFailed) as caught:
        toy({"FAIL_AT": 501}).run()
    assert "failed after 500 of 1,000 steps" in summary(caught.value.run.report)


def test_an_unknown_scalar_is_refused_before_anything_is_compiled() -> None:
    with pytest.raises(UsageError, match="double, float, long_double"):
        toy().run(scalar="half")
    with pytest.raises(UsageError, match='unknown kernels "hand"'):
        toy().run(kernels="hand")


def test_importing_hamotor_does_not_wait_for_numpy() -> None:
    code = "import hamotor, sys; assert 'numpy' not in sys.modules; hamotor.load; dir(hamotor)"
    package = Path(hamotor.__file__).parents[1]
    subprocess.run(
        [sys.executable, "-c", code], check=True, env={**os.environ, "PYTHONPATH": str(package)}
    )
    with pytest.raises(AttributeError, match="no attribute 'lod'"):
        hamotor.lod  # noqa: B018


def test_a_rotor_of_four_dimensions_turns_two_planes_at_once() -> None:
    a, b = 0.4, -1.1
    ca, sa, cb, sb = math.cos(a / 2), math.sin(a / 2), math.cos(b / 2), math.sin(b / 2)
    motor = {"s": ca * cb, "e12": -sa * cb, "e34": -ca * sb, "e1234": sa * sb, "e01": 0.3}
    found = rotation_matrices({blade: np.array([x]) for blade, x in motor.items()})[0]
    expected = np.zeros((4, 4))
    for at, angle in ((0, a), (2, b)):
        c, s = math.cos(angle), math.sin(angle)
        expected[at : at + 2, at : at + 2] = [[c, -s], [s, c]]
    np.testing.assert_allclose(found, expected, atol=1e-15)


@pytest.mark.parametrize(
    ("algebra", "blades", "turns"),
    [
        ("pga3", ["s", "e23", "e01"], True),
        ("pga3", ["s", "e01", "e02", "e03"], True),
        ("cga3", ["s", "e23", "e1i", "e0i"], True),
        ("cga3", ["s", "e23", "e1i", "e0i", "e01"], False),
        ("sta", ["s", "e23", "e01"], False),
    ],
)
def test_motors_that_bend_lines_have_no_attitude(
    algebra: str, blades: list[str], turns: bool
) -> None:
    assert has_attitude(algebra, blades) is turns
