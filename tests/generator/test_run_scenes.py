"""The bundled scenes, all the way: file → C++ → library → steps → report, trajectory, pictures."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import hamotor
from hamotor.run.choice import choose_method
from hamotor.scene import METHODS, Form, bundled_scenes, methods_offered

SCENES = [name for name, _ in bundled_scenes()]
PACKAGE = Path(hamotor.__file__).parents[1]
PROBLEMS = PACKAGE.parent / "tests" / "bench" / "problems"


def command(*arguments: str, folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "hamotor", *arguments],
        env={**os.environ, "PYTHONPATH": str(PACKAGE)},
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize("name", SCENES)
def test_a_bundled_scene_runs_and_keeps_what_is_conserved(name: str, tmp_path: Path) -> None:
    run = hamotor.load(name).run(out=tmp_path)
    assert run.status == "finished"
    assert {p.name for p in tmp_path.iterdir()} == {
        "run.json",
        "trajectory",
        "path.png",
        "conserved.png",
    }
    for quantity, said in run.conserved.items():
        symplectic = run.report["method"] == "splitting2"
        allowed = 1e-6 if not symplectic else 1e-3 if quantity == "energy" else 1e-12
        assert said["max_relative_error"] <= allowed, quantity
    for body in filter(run.has_attitude, run.bodies):
        rotation = run.rotation(body)
        unit = np.einsum("nij,nkj->nik", rotation, rotation)
        np.testing.assert_allclose(unit, np.eye(unit.shape[-1])[np.newaxis] + 0 * unit, atol=1e-13)


@pytest.mark.parametrize("name", SCENES)
def test_the_state_a_scene_starts_from_is_the_first_row(name: str) -> None:
    simulation = hamotor.load(name)
    run = simulation.run(end=1e-6, step=1e-6)
    first = [
        run.trajectory[f"{body}.{part}.{blade}"][0]
        for body in run.bodies
        for part in ("motor", "momentum")
        for blade in run.final[body][part]
    ]
    size = max(1.0, np.abs(simulation.state).max())
    np.testing.assert_allclose(first, simulation.state, rtol=0, atol=1e-14 * size)


def test_the_final_state_in_a_wider_scalar_has_all_its_digits(tmp_path: Path) -> None:
    run = hamotor.load("tumble").run(scalar="long_double", end=1, out=tmp_path, pictures=False)
    (said,) = json.loads((tmp_path / "run.json").read_text())["final"].values()
    motor = {blade: np.longdouble(text) for blade, text in said["motor"].items()}
    rotor = np.array([motor[blade] for blade in ("s", "e23", "e31", "e12")])
    assert all(isinstance(text, str) for text in said["motor"].values())
    assert abs(rotor @ rotor - 1) < 4 * np.finfo(np.longdouble).eps
    assert [float(x) for x in motor.values()] == list(run.motor()[-1])
    rotation = np.array(said["rotation"], dtype=np.longdouble)
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 8 * np.finfo(np.longdouble).eps


@pytest.mark.parametrize("method", ["rkmk4", "rk4", "splitting2"])
def test_the_methods_agree_where_the_steps_are_short(method: str) -> None:
    simulation = hamotor.load("tumble")
    reference = simulation.run(method="rkmk4", step=1e-3)
    run = simulation.run(method=method, step=1e-4, every=10)
    assert hamotor.compare(reference, run).largest < 1e-7


def test_a_tolerance_is_a_bound_on_the_error_of_the_final_state() -> None:
    simulation = hamotor.load("tumble")
    reference = simulation.run(method="rkmk4", step=2.5e-4).motor()[-1]
    for tolerance in (1e-4, 1e-7):
        final = simulation.run(method="splitting2", tolerance=tolerance).motor()[-1]
        sign = np.sign(final @ reference)
        assert np.abs(final - sign * reference).max() <= tolerance


def test_a_scene_that_cannot_be_told_from_chaos_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from hamotor.run import tolerance

    monkeypatch.setattr(tolerance, "_PATIENCE", 4)
    with pytest.raises(hamotor.RunFailed, match="chaotic over this time: end it earlier"):
        hamotor.load("spring_pendulum").run(tolerance=1e-6)


def test_the_second_command_does_not_compile_again(tmp_path: Path) -> None:
    first = command("run", "tumble", "--json", folder=tmp_path)
    first.communicate(timeout=300)
    assert first.returncode == 0
    second = command("run", "tumble", "--json", folder=tmp_path)
    printed, messages = second.communicate(timeout=300)
    said = json.loads(printed)
    assert messages == ""
    assert said["timing"]["compile_cached"] is True
    assert said["timing"]["compile_s"] == 0
    assert printed == (tmp_path / "runs" / "tumble" / "run.json").read_text()


def test_ctrl_c_keeps_what_was_computed_and_exits_with_130(tmp_path: Path) -> None:
    hamotor.load("tumble").compile(method="splitting2")
    options = "--end 1e9 --every 10000 --no-pictures --json --out kept"
    process = command("run", "tumble", *options.split(), folder=tmp_path)
    while not list(tmp_path.glob("kept/.running-*/0/trajectory")):
        assert process.poll() is None
        time.sleep(0.05)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    printed, messages = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted; what was computed is kept" in messages
    said = json.loads(printed)
    assert said["status"] == "interrupted"
    run = hamotor.open_run(tmp_path / "kept")
    assert run.t[-1] == said["t_end"] > 0
    assert not [p for p in (tmp_path / "kept").iterdir() if p.name.startswith(".")]


def test_the_api_does_what_the_readme_promises() -> None:
    run = hamotor.load("dzhanibekov").run(end=10)
    assert run.t[-1] == 10.0
    assert run.motor("handle").shape == (len(run.t), 8)
    assert run.rotation("handle").shape == (len(run.t), 3, 3)


def test_a_scene_is_compiled_with_the_one_method_it_is_run_with() -> None:
    simulation = hamotor.load("heavy_top")
    compiled = simulation.compile(method="splitting6")
    # The recurrence for Taylor series is written for that method only (test_taylor.py).
    listed = {name: order for name, order in simulation.methods.items() if name != "taylor"}
    assert compiled.description.methods == listed, "the runtime and the list agree"
    split = [m for m in METHODS if m.forms & Form.SPLIT and m.name in listed]
    chosen = {m.name for m in split if m.error_controlled}
    assert compiled.description.error_controlled == chosen
    state = simulation.state
    with compiled.library.start("splitting6", step=0.01, state=state) as live:
        assert live.advance(3, 1, None) == 3
    with pytest.raises(hamotor.HamotorError, match="would not start"):
        compiled.library.start("rkmk4", step=0.01, state=state)


@pytest.mark.parametrize(
    "method", [m.name for m in METHODS if m.name.startswith("splitting") and m.order > 2]
)
def test_higher_orders_meet_a_reference_in_longer_steps(method: str) -> None:
    simulation = hamotor.load("heavy_top")
    reference = simulation.run(method="rkmk4", end=0.5, step=5e-5, every=100)
    run = simulation.run(method=method, end=0.5, step=5e-3, every=1)
    assert hamotor.compare(reference, run).largest < (1e-6 if method == "splitting4" else 1e-9)


def test_free_bodies_are_stepped_in_closed_form_and_by_moser_veselov() -> None:
    simulation = hamotor.load("tumble")
    exact = simulation.run(method="closed_form", step=0.5, every=1)
    assert "(exact)" in exact.summary()
    assert max(row["max_relative_error"] for row in exact.report["conserved"].values()) < 4e-15
    discrete = simulation.run(method="moser_veselov10", step=1e-2, every=50)
    assert hamotor.compare(exact, discrete).largest < 1e-12
    reference = simulation.run(method="rkmk4", step=1e-3, every=500)
    assert hamotor.compare(reference, exact).largest < 1e-7
    assert "moser_veselov2" in hamotor.load("heavy_top").methods
    assert not {"moser_veselov4", "closed_form"} & set(hamotor.load("heavy_top").methods)


@pytest.mark.parametrize("name", ["heavy_top", "breathing_body"])
def test_gauss_collocation_runs_every_form_of_a_scene(name: str) -> None:
    simulation = hamotor.load(name)
    reference = simulation.run(method="rkmk4", end=0.2, step=5e-5, every=40)
    run = simulation.run(method="gauss6", end=0.2, step=2e-3, every=1)
    assert hamotor.compare(reference, run).largest < 1e-9


def test_stages_that_do_not_converge_stop_the_run() -> None:
    with pytest.raises(hamotor.RunFailed, match="gauss4 did not converge in step") as caught:
        hamotor.load("heavy_top").run(method="gauss4", step=2.5)
    assert caught.value.run.status == "failed"
    assert caught.value.run.report["failure"]["reason"] == "no_convergence"


def test_a_method_that_needs_a_split_is_refused_where_there_is_none() -> None:
    with pytest.raises(hamotor.UsageError, match=r"this scene offers auto, .*gauss4"):
        choose_method("splitting4", methods_offered(Form.GENERAL))


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "steps", "step", "allowed"),
    [("tumble", 10**8, 0.01, 1e-13), (PROBLEMS / "P1.toml", 10**7, 0.005, 2e-15)],
    ids=["tumble", "P1"],
)
def test_energy_wanders_by_rounding_and_has_no_trend(
    scene: str | Path, steps: int, step: float, allowed: float
) -> None:
    run = hamotor.load(scene).run(
        method="splitting6", end=steps * step, step=step, every=steps // 1000, pictures=False
    )
    energy = run.trajectory["energy"]
    assert len(energy) == 1001
    errors = energy / energy[0] - 1
    assert abs(errors).max() < allowed
    wandering = np.diff(errors)
    slope, error = wandering.mean(), wandering.std(ddof=1) / np.sqrt(len(wandering))
    assert abs(slope) < 3 * error, f"{slope:.2e} +- {error:.2e} in a thousandth of the run"
