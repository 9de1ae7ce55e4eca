"""Rows at times asked for, events, and runs back in time: of scenes with closed solutions."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hamotor
from hamotor.errors import UsageError
from hamotor.run.result import Run, RunFailed

STONE = """
algebra = "pga3"
[[body]]
name = "stone"
mass = 2
inertia = [1, 2, 2.5]
center_of_mass = [0.1, 0.2, -0.1]
velocity = [1, 0, 5]
angular_velocity = [1, -2, 3]
[[interaction]]
type = "gravity"
acceleration = [0, 0, -10]
[[event]]
name = "apex"
expression = "velocity(0.1, 0.2, -0.1).z"
direction = "falling"
[[event]]
name = "rising"
expression = "velocity(0.1, 0.2, -0.1).z"
direction = "rising"
[[event]]
name = "landing"
expression = "at(0.1, 0.2, -0.1).z + depth + 1000 * (abs(t) - t)"
parameters = { depth = 1.2 }
stop = true
[time]
end = 10
step = 0.03
method = "splitting4"
"""
UPWARDS = 5 + 1 * 0.2 + 2 * 0.1  # the third component of V + Ω × c
APEX = UPWARDS / 10
LANDING = (UPWARDS + math.sqrt(UPWARDS**2 + 2 * 10 * (1.2 - 0.1))) / 10

OSCILLATOR = """
algebra = "pga2"
[hamiltonian]
expression = "momentum(bob).e12^2 + norm_squared(P) / 2 + norm_squared(position) / 2"
[[body]]
name = "bob"
position = [1, 0]
[[event]]
name = "zero"
expression = "P.x - momentum(bob).e01 + position.x"
[time]
end = 10
step = 0.1
method = "gauss8"
"""


def scene_of(folder: Path, text: str) -> hamotor.Simulation:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return hamotor.load(path)


@pytest.fixture(scope="module")
def stone(tmp_path_factory: pytest.TempPathFactory) -> hamotor.Simulation:
    return scene_of(tmp_path_factory.mktemp("stone"), STONE)


def test_events_of_a_turning_body_are_found_and_end_the_run(
    stone: hamotor.Simulation, tmp_path: Path
) -> None:
    run = stone.run(out=tmp_path / "run", csv=True, pictures=False)
    said = run.report["events"]
    assert said["apex"]["times"] == pytest.approx([APEX], abs=1e-12)
    assert said["landing"]["times"] == pytest.approx([LANDING], abs=1e-12)
    assert said["landing"]["stopped"]
    assert said["rising"] == {"direction": "rising", "count": 0, "times": [], "stopped": False}
    assert run.status == "finished"
    assert run.t[-1] == run.report["t_end"] == said["landing"]["times"][0]
    assert run.report["steps"] == math.ceil(LANDING / run.report["step"])
    assert (np.diff(run.t) > 0).all()
    assert list(run.events["event"]) == ["apex", "landing"]
    np.testing.assert_array_equal(run.events["energy"][1], run.energy[-1])
    assert (tmp_path / "run" / "events.csv").read_text(encoding="utf-8").count("\n") == 3
    assert "landing happened at t = " in run.summary()
    again = stone.run()
    np.testing.assert_array_equal(again.events["t"], run.events["t"])
    comparison = hamotor.compare(stone.run(interval=0.25), stone.run(interval=0.25, end=1.0))
    (apex,) = (d for d in comparison.differences if d.quantity == "time of apex")
    assert apex.unit == "s"
    assert apex.largest < 1e-9
    assert comparison.notes == ("landing happened 1 and 0 times",)


def test_rows_at_times_leave_the_steps_as_they_are(stone: hamotor.Simulation) -> None:
    step = 1 / 32
    every = stone.run(end=1.0, step=step)
    times = [0.0, step, 0.4, 0.4001, 20 * step, 1.0]
    at = stone.run(end=1.0, step=step, times=times)
    np.testing.assert_array_equal(at.t, times)
    exact = [0, 1, 4, 5]
    np.testing.assert_array_equal(at.motor()[exact], every.motor()[[0, 1, 20, 32]])
    start = every.report["final"]["stone"], at.report["final"]["stone"]
    assert start[0] == start[1]
    near = stone.run(end=0.4, step=step)
    assert np.abs(near.motor()[-1] - at.motor()[2]).max() < 1e-7
    assert at.report["every"] is None


@pytest.mark.parametrize("ensemble", [False, True])
@pytest.mark.parametrize(
    ("records", "span", "problem"),
    [
        ({"times": (0.5, 1.0)}, {"end": 0.0}, "end must be a finite number"),
        ({"interval": 0.5}, {"end": 0.0}, "end must be a finite number"),
        ({"interval": 0.5}, {"step": 0.0}, "step must be a positive number"),
        ({"interval": 0.5}, {"end": 1e300, "step": 1e-300}, "Take a longer step"),
    ],
)
def test_no_way_to_the_end_is_an_error_whatever_is_recorded(
    stone: hamotor.Simulation,
    ensemble: bool,
    records: dict[str, Any],
    span: dict[str, Any],
    problem: str,
) -> None:
    recorded = replace(stone, **records)
    run = partial(hamotor.run_ensemble, recorded, states=stone.state[np.newaxis])
    with pytest.raises(UsageError, match=problem):
        (run if ensemble else recorded.run)(**span)


def test_an_interval_longer_than_the_run_keeps_two_rows(stone: hamotor.Simulation) -> None:
    np.testing.assert_array_equal(stone.run(end=1e-30, step=1e-31, interval=1e308).t, [0, 1e-30])


def test_intervals_are_steps_where_they_can_be_and_times_elsewhere(
    stone: hamotor.Simulation,
) -> None:
    by_steps = stone.run(end=1.0, step=1 / 32, interval=0.25)
    np.testing.assert_array_equal(by_steps.t, [0, 0.25, 0.5, 0.75, 1.0])
    assert by_steps.report["every"] == 8
    np.testing.assert_array_equal(stone.run(end=1.0, interval=0.3).t, [0, 0.3, 0.6, 0.3 * 3, 1.0])


def test_a_stop_leaves_out_the_times_after_it(stone: hamotor.Simulation) -> None:
    inside = LANDING - 1e-3, LANDING + 1e-3
    run = stone.run(times=[1.0, *inside, 9.0])
    np.testing.assert_array_equal(run.t, [1.0, inside[0]])
    assert run.report["t_end"] == run.report["events"]["landing"]["times"][0]
    alone = stone.run(times=[9.0])
    assert alone.t == pytest.approx([LANDING], abs=1e-12), "a trajectory has a row at least"


def test_a_run_back_in_time_returns_to_the_start(stone: hamotor.Simulation) -> None:
    forwards = stone.run(end=1.0, step=0.01)
    library = stone.compile(method="splitting4").library
    final = forwards.motor()[-1].tolist() + forwards.momentum()[-1].tolist()
    with library.start("splitting4", step=-0.01, state=final) as live:
        done = live.advance(100, 1, None)
        assert live.observe_event(1) is not None, "the apex, seen from its other side"
        assert done + live.advance(100 - done, 1, None) == 100
        np.testing.assert_allclose(live.state(), stone.state, rtol=0, atol=2e-14)
    back = stone.run(end=-1.0, step=0.01, times=[0.0, -0.305, -1.0])
    np.testing.assert_array_equal(back.t, [0.0, -0.305, -1.0])
    assert back.report["step"] == -0.01
    velocity = 10 * 0.305 + UPWARDS
    assert back.trajectory["spatial_momentum.e03"][1] == pytest.approx(2 * velocity, rel=1e-12)


def test_a_tolerance_is_met_back_in_time(stone: hamotor.Simulation) -> None:
    run = stone.run(end=-1.0, tolerance=1e-9, interval=0.5)
    np.testing.assert_array_equal(run.t, [0.0, -0.5, -1.0])
    assert run.report["tolerance"]["achieved"] <= 1e-9


def test_a_time_limit_keeps_what_was_computed(stone: hamotor.Simulation) -> None:
    with pytest.raises(RunFailed, match="time limit passed after step") as caught:
        stone.run(end=-300.0, step=1e-6, every=1000, time_limit=0.2)
    run = caught.value.run
    assert caught.value.exit_code == 3
    assert run.report["failure"]["reason"] == "time_limit"
    assert run.report["failure"]["t"] == run.report["t_end"] == run.t[-1] < 0


def test_a_time_limit_passes_within_one_step(stone: hamotor.Simulation) -> None:
    with pytest.raises(RunFailed, match="time limit passed after step 0 of 1 ") as caught:
        stone.run(end=-1e9, step=-1e9, method="taylor", local_tolerance=1e-9, time_limit=0.2)
    run = caught.value.run
    assert run.report["failure"]["reason"] == "time_limit"
    assert run.t.tolist() == [0.0]
    assert run.report["timing"]["integrate_s"] < 2


def test_the_quantity_that_fails_is_named(stone: hamotor.Simulation) -> None:
    with pytest.raises(RunFailed, match=r"became non-finite in step .* with a step of") as caught:
        stone.run(end=-1e305, step=1e300)
    failure = caught.value.run.report["failure"]
    assert failure["reason"] == "not_finite"
    assert failure["quantity"].startswith("stone.")


def zeros(run: Run) -> list[float]:
    times: list[float] = run.report["events"]["zero"]["times"]
    return times


def test_events_of_a_general_scene_are_found_with_fixed_and_with_chosen_steps(
    tmp_path: Path,
) -> None:
    simulation = scene_of(tmp_path, OSCILLATOR)
    expected = [math.pi * (k + 0.5) for k in range(3)]
    assert zeros(simulation.run()) == pytest.approx(expected, abs=1e-12)
    run = simulation.run(method="rkmk87", local_tolerance=1e-13, step=1.0, times=[0.5, 7.25])
    assert zeros(run) == pytest.approx(expected, abs=1e-11)
    assert run.position()[:, 0] == pytest.approx(np.cos(run.t), abs=1e-12)
    assert run.report["own_steps"] != run.report["steps"] == 10
    assert "steps of its own choice" in run.summary()
    as_the_scene_says = replace(simulation, method="rkmk87", step=1.0, local_tolerance=1e-13)
    assert as_the_scene_says.run(times=[0.5]).report["local_tolerance"] == 1e-13
    met = simulation.run(method="rkmk87", tolerance=1e-10)
    assert met.report["tolerance"]["achieved"] <= 1e-10
    rungs = [rung["local_tolerance"] for rung in met.report["tolerance"]["ladder"]]
    assert all(fine <= coarse / 16 for coarse, fine in itertools.pairwise(rungs))
    assert met.position()[-1, 0] == pytest.approx(math.cos(10), abs=1e-10)
    json.dumps(met.report)


def test_a_method_of_fixed_steps_has_no_local_tolerance(stone: hamotor.Simulation) -> None:
    with pytest.raises(UsageError, match=r"splitting4 does not choose its steps.*rkmk54"):
        stone.run(local_tolerance=1e-9)
    with pytest.raises(UsageError, match="one of every, times and interval"):
        stone.run(every=2, interval=0.1)
    with pytest.raises(UsageError, match="must follow each other"):
        stone.run(times=[0.2, 0.1])
    with pytest.raises(UsageError, match="not between 0 and 10"):
        stone.run(times=[11.0])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"rising"\nexp', '"apex"\nexp', r'event 2: name: "apex" is the name of event 1 already'),
        ('"falling"', '"down"', r'unknown direction "down"; directions are "both"'),
        ("velocity(0.1, 0.2", "speed(0.1, 0.2", r"event 1: expression: .*speed"),
        ("+ depth + 1000 * (abs(t) - t)", "- at(0.1, 0.2, -0.1).z", "must depend on the state"),
        ("stop = true", "stops = true", r'unknown key "stops".*Did you mean "stop"'),
        ("end = 10", "end = 0", "must not be 0"),
        ("end = 10", "end = 10\n[output]\ntimes = [2, 1]", "1, does not come after 2"),
        ("end = 10", "end = 10\n[output]\ntimes = [-2]", "-2, is not between 0 and end = 10"),
        ("end = 10", "end = 10\n[output]\ntimes = [2]\nevery = 2", "contradict each other"),
    ],
)
def test_mistakes_in_events_and_times_are_told(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    text = STONE.replace(old, new, 1)
    if "[output]" in new:
        text = STONE.replace(old, "end = 10") + new.removeprefix("end = 10")
    with pytest.raises(UsageError, match=message):
        scene_of(tmp_path, text)
