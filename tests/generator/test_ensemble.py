"""Ensembles: what is drawn, what is summed up, and that no bit depends on who computed it."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.generator.toy import PUSH_AT, RATE_AT, ensemble_of_toys, interrupts, toy, toy_state

import hamotor
from hamotor.errors import ToolError, UsageError
from hamotor.run import build, cluster, ensemble, ensemble_pictures
from hamotor.run.account import account
from hamotor.run.ensemble import CHUNK, PART, Job, Part, Tally
from hamotor.run.ensemble_files import EnsembleFiles
from hamotor.run.ensemble_run import EnsembleFailed, EnsembleInterrupted, EnsembleRun, run_ensemble
from hamotor.run.library import Rows, SceneLibrary
from hamotor.run.sampling import starts
from hamotor.run.simulation import Simulation
from hamotor.run.statistics import Moments
from hamotor.scene import parse_scene, read_scene
from hamotor.scene.model import Scene
from hamotor.scene.motors import motor_of, rotation_matrix


def digest(run: EnsembleRun) -> str:
    """Of everything that must not depend on who computed it."""
    found = hashlib.sha256()
    for name, values in sorted(run.statistics.items()):
        found.update(name.encode() + np.ascontiguousarray(values).tobytes())
    found.update(np.ascontiguousarray(run.states).tobytes())
    said = {k: v for k, v in run.report.items() if k not in {"timing", "provenance"}}
    who = {"engine", "threads", "lanes", "isa"}
    said["ensemble"] = {k: v for k, v in said["ensemble"].items() if k not in who}
    found.update(json.dumps(said, sort_keys=True).encode())
    for member in run.report["ensemble"]["kept"]:
        for values in run.trajectory(member).values():
            found.update(np.ascontiguousarray(values).tobytes())
    return found.hexdigest()


# ---------------------------------------------------------------- what is drawn


SCENE = """
algebra = "{algebra}"
[[body]]
name = "a"
mass = 1.0
{inertia}
[[body]]
name = "b"
mass = 2.0
{inertia}
position = {position}
{more}
[time]
end = 1.0
step = 0.1
[[ensemble.body]]
name = "b"
{draws}
"""
SPATIAL = {
    "algebra": "pga3",
    "inertia": "inertia = [1.0, 2.0, 2.5]",
    "position": "[1, -2, 3]",
    "more": "orientation = { axis = [1, 2, 3], angle = 0.7 }\nvelocity = [0.5, 0, 0]\n"
    "angular_velocity = [0, 0, 1]\ncenter_of_mass = [0.1, 0, 0]",
}
PLANAR = {"algebra": "pga2", "inertia": "inertia = 1.5", "position": "[1, -2]", "more": ""}


def scene_of(draws: str, values: Mapping[str, str] = SPATIAL) -> Scene:
    scene = parse_scene(SCENE.format(draws=draws, **values).encode(), name="s", file="s.toml")
    assert isinstance(scene, Scene)
    return scene


def drawn(scene: Any, members: int, first: int = 0) -> NDArray[np.float64]:
    return starts(scene.ensemble, scene.initial_state, 1, first, members)[0]


def test_members_start_at_the_values_that_are_listed() -> None:
    scene = scene_of(
        "position = { values = [[4, 5, 6], [7, 8, 9]] }\n"
        "velocity = { values = [[1, 2, 3]] }\nangular_velocity = { values = [[0.1, 0.2, 0.3]] }"
    )
    found = drawn(scene, 3)
    body = scene.bodies[1]
    for member, position in enumerate([(4, 5, 6), (7, 8, 9), (4, 5, 6)]):
        np.testing.assert_allclose(found[member, 14:22], motor_of(position, body.rotor), atol=2e-15)
        rate = (0.1, 0.2, 0.3, 1, 2, 3)
        np.testing.assert_allclose(found[member, 22:], body.kinetic_matrix @ rate, atol=1e-14)
    assert (found[:, :14] == scene.initial_state[:14]).all()


def test_general_and_rigid_scenes_draw_alike() -> None:
    draws = "position = { sd = 0.1 }\norientation = { sd = [0.1, 0.2, 0.3] }\nvelocity = { sd = 1 }"
    scene = scene_of(draws)
    np.testing.assert_allclose(drawn(scene.general, 5), drawn(scene, 5), atol=1e-14)


def test_a_spread_turns_about_axes_of_the_body() -> None:
    scene = scene_of("orientation = { axis = [0, 0, 2], low = 0.3, high = 0.3 }")
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    found = rotation_matrix(drawn(scene, 1)[0, 14:18].tolist())
    np.testing.assert_allclose(found, rotation_matrix(scene.bodies[1].rotor) @ turn, atol=1e-15)
    vector = scene_of("orientation = { sd = [0, 0, 0.5] }")
    own = rotation_matrix(scene.bodies[1].rotor)
    rotors = drawn(vector, 4000)[:, 14:18]
    relative = [own.T @ rotation_matrix(r) for r in rotors.tolist()]
    turned = np.array([np.arctan2(r[1, 0], r[0, 0]) for r in relative])
    assert abs(turned.mean()) < 0.03
    assert abs(turned.std() - 0.5) < 0.02
    np.testing.assert_allclose([r[2, 2] for r in relative], 1.0, atol=1e-14)


@pytest.mark.parametrize(("values", "size"), [(SPATIAL, 3), (PLANAR, 2)])
def test_uniform_orientations_know_no_direction(values: Mapping[str, str], size: int) -> None:
    scene = scene_of("orientation = { uniform = true }", values)
    first = len(scene.bodies[0].motor) + len(scene.bodies[0].momentum)
    rotors = drawn(scene, 20_000)[:, first : first + (4 if size == 3 else 2)]
    np.testing.assert_allclose((rotors**2).sum(axis=1), 1.0, atol=1e-15)
    matrices = np.array([rotation_matrix(r) for r in rotors.tolist()])
    # Haar measure: R has mean 0, and every entry of it the variance 1/size.
    np.testing.assert_allclose(matrices.mean(axis=0), 0.0, atol=0.02)
    np.testing.assert_allclose((matrices**2).mean(axis=0), 1 / size, atol=0.02)


def test_distributions_have_their_mean_and_spread_about_the_scenes_own_value() -> None:
    scene = scene_of(
        "velocity = { sd = [1, 2, 0] }\nangular_velocity = { low = [0, 0, 1], high = [1, 2, 1] }"
    )
    body = scene.bodies[1]
    momenta = drawn(scene, 40_000)[:, 22:]
    rates = np.linalg.solve(body.kinetic_matrix, momenta.T)
    np.testing.assert_allclose(rates[3:].mean(axis=1), [0.5, 0, 0], atol=0.03)
    np.testing.assert_allclose(rates[3:].std(axis=1), [1, 2, 0], atol=0.03)
    np.testing.assert_allclose(rates[:3].min(axis=1), [0, 0, 1], atol=1e-3)
    np.testing.assert_allclose(rates[:3].max(axis=1), [1, 2, 1], atol=1e-3)


def test_a_body_that_scales_is_drawn_at_its_sizes() -> None:
    text = (
        'algebra = "cga3"\ngroup = "Sim3"\n[[body]]\nname = "a"\nmass = 1.0\n'
        "inertia = [1.0, 2.0, 2.5]\nposition = [1, 0, 0]\nscale = 2.0\n"
        '[time]\nend = 1.0\nstep = 0.1\n[[ensemble.body]]\nname = "a"\n'
        "scale = { values = [2.0, 4.5] }\nmomentum = { e23 = { values = [1.0] } }\n"
    )
    scene: Any = parse_scene(text.encode(), name="s", file="s.toml")
    found, size = drawn(scene, 2), len(scene.group.motor)
    np.testing.assert_allclose(found[0, :size], scene.bodies[0].motor, atol=1e-15)
    other: Any = parse_scene(
        text.replace("scale = 2.0", "scale = 4.5").encode(), name="s", file="s.toml"
    )
    np.testing.assert_allclose(found[1, :size], other.bodies[0].motor, atol=1e-15)
    assert (found[:, size] == 1.0).all()


@pytest.mark.parametrize(
    ("draws", "message"),
    [
        ('name = "c"', r'\[\[ensemble.body\]\] 1: unknown body "c"; bodies are "a", "b"'),
        ("", "draws nothing; give at least one of"),
        ("postion = { sd = 1 }", 'unknown key "postion".*Did you mean "position"'),
        ("position = { sd = -1 }", "position: sd: must not be negative"),
        ("position = { mean = [0, 0, 0] }", 'missing "sd"'),
        ("position = { sd = 1, low = 0 }", "not several of them"),
        ("position = { low = [0, 0, 1], high = [1, 1, 0] }", "low: must not be above high"),
        ("position = { low = [0, 0, 1] }", 'missing "high"'),
        ("position = { values = [[1, 2]] }", "values: value 1: must be 3 numbers"),
        ("position = { values = [] }", "needs at least one value"),
        ("orientation = { uniform = true, sd = 1 }", '"uniform" stands alone'),
        ("orientation = { low = 0, high = 1 }", 'missing "axis"'),
        ("orientation = {}", "give uniform = true, sd, or low and high"),
        ("velocity = { sd = 1 }\nmomentum = { e12 = { sd = 1 } }", "contradict each other"),
        ("momentum = { e12 = { sd = 1 }, angular = { sd = 1 } }", "angular: is given twice"),
        ("scale = { sd = 1 }", 'key "scale" has no meaning on SE3'),
        ('velocity = { sd = 1 }\n[[ensemble.body]]\nname = "b"', "is the body of .* 1 already"),
    ],
)
def test_mistakes_name_the_key(draws: str, message: str) -> None:
    whole = SCENE.format(draws="", **SPATIAL)
    if draws.startswith("name"):
        whole = whole.replace('[[ensemble.body]]\nname = "b"', "[[ensemble.body]]")
    with pytest.raises(UsageError, match=message):
        parse_scene((whole + draws).encode(), name="s", file="s.toml")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("seed = -1", r"\[ensemble\]: seed: must be at least 0"),
        ("keep = [1, 1]", "keep: has a number twice"),
        ("quantiles = [0.5, 1.5]", "quantiles: number 2: must lie between 0 and 1"),
        ("quantiles = [0.5, 0.25]", "quantiles: must ascend"),
        ("sead = 1", 'unknown key "sead".*Did you mean "seed"'),
        ("final_states = 1", "final_states: must be true or false"),
    ],
)
def test_mistakes_in_ensemble_name_the_key(table: str, message: str) -> None:
    whole = SCENE.format(draws="velocity = { sd = 1 }", **SPATIAL)
    whole = whole.replace("[[ensemble.body]]", f"[ensemble]\n{table}\n[[ensemble.body]]")
    with pytest.raises(UsageError, match=message):
        parse_scene(whole.encode(), name="s", file="s.toml")


# ---------------------------------------------------------------- what is summed up


def test_statistics_are_those_of_the_members() -> None:
    members = 40
    run = run_ensemble(ensemble_of_toys(), members, keep=range(members))
    rows = np.array([run.trajectory(k)["bob.position.x"] for k in range(members)])
    assert run.t.tolist() == pytest.approx([0, 0.25, 0.5])
    np.testing.assert_allclose(run.mean("bob.position.x"), rows.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(
        run.deviation("bob.position.x"), rows.std(axis=0, ddof=1), rtol=1e-13, atol=1e-15
    )
    assert (run.statistics["bob.position.x.min"] == rows.min(axis=0)).all()
    assert (run.statistics["bob.position.x.max"] == rows.max(axis=0)).all()
    for level in (0.25, 0.5):
        np.testing.assert_allclose(
            run.quantile("bob.position.x", level), np.quantile(rows, level, axis=0), rtol=1e-14
        )
    near = replace(ensemble_of_toys().ensemble, quantiles=(0.99999997, 0.99999998))
    both = run_ensemble(replace(ensemble_of_toys(), ensemble=near), members)
    assert {"energy.q0.99999997", "energy.q0.99999998"} < set(both.statistics)
    # x = cos t + p sin t of a uniform p, but for the error of the step.
    assert run.deviation("bob.position.x")[-1] == pytest.approx(
        np.sin(0.5) * run.deviation("bob.momentum.e01")[0], rel=1e-3
    )
    error = run.report["conserved"]["energy"]
    energies = np.array([run.trajectory(k)["energy"] for k in range(members)])
    worst = (np.abs(energies - energies[:, :1]) / energies[:, :1]).max(axis=1)
    assert error["member"] == int(worst.argmax())
    assert error["max_relative_error"] == worst.max()
    assert error["mean_relative_error"] == pytest.approx(worst.mean())


def test_merged_moments_are_those_of_all() -> None:
    values = np.random.default_rng(1).normal(1e6, 1.0, (1000, 2))
    whole, merged = Moments.none(1, 2), Moments.none(1, 2)
    whole.put(0, values)
    for block in np.split(values, [0, 1, 400, 400, 999]):
        part = Moments.none(1, 2)
        part.put(0, block)
        merged.merge(part)
    assert merged.count.tolist() == [1000]
    np.testing.assert_allclose(merged.mean, whole.mean, rtol=1e-15)
    np.testing.assert_allclose(merged.deviation, values.std(axis=0, ddof=1)[np.newaxis], rtol=1e-12)
    assert (merged.low == values.min(axis=0)).all()
    assert (merged.high == values.max(axis=0)).all()


def test_nothing_depends_on_threads_and_a_member_alone_has_its_bits(tmp_path: Path) -> None:
    members = PART + CHUNK + 3
    kept = (5, PART + CHUNK + 1)
    settings: dict[str, Any] = {"end": 0.1, "keep": kept}
    one = run_ensemble(ensemble_of_toys(), members, threads=1, **settings)
    three = run_ensemble(ensemble_of_toys(), members, threads=3, **settings)
    assert digest(three) == digest(one)
    disk = run_ensemble(
        ensemble_of_toys(), members, threads=2, out=tmp_path / "run", csv=True, **settings
    )
    assert digest(disk) == digest(one)
    assert digest(hamotor.open_ensemble(tmp_path / "run")) == digest(one)
    assert (tmp_path / "run" / "statistics.csv").read_text().startswith('"t","members"')
    for member in kept:
        alone = run_ensemble(ensemble_of_toys(), members, member=member, end=0.1)
        assert (alone.states[0] == one.states[member]).all()
        for name, values in alone.trajectory(member).items():
            assert (values == one.trajectory(member)[name]).all()
    with pytest.raises(UsageError, match="holds an ensemble"):
        hamotor.open_run(tmp_path / "run")
    with pytest.raises(UsageError, match="member 6 was not kept; 5, "):
        disk.trajectory(6)


def test_a_member_that_fails_is_no_failed_run(tmp_path: Path) -> None:
    toys = ensemble_of_toys({"FAIL_MEMBER": 7})
    run = run_ensemble(toys, 100, out=tmp_path / "run", keep=range(4))
    negative = run.states[:, 8 + RATE_AT] < 0
    assert 30 < negative.sum() < 70
    assert run.failures["member"].tolist() == np.flatnonzero(negative).tolist()
    assert set(run.failures["reason"]) == {"not_finite"}
    assert run.failures["t"] == pytest.approx(6 * 0.05)
    assert run.status == "finished"
    assert run.report["failures"]["count"] == negative.sum()
    assert run.report["failures"]["first"][0]["member"] == np.flatnonzero(negative)[0]
    assert run.statistics["members"].tolist() == [100, 100, 100 - negative.sum()]
    assert run.statistics["bob.momentum.e12.min"][-1] > 0
    dead = next(k for k in range(4) if negative[k])
    assert len(run.trajectory(dead)["t"]) == 2
    assert f"{negative.sum()} members failed" in run.summary()
    with pytest.raises(EnsembleFailed, match="every member failed"):
        run_ensemble(toys, states=run.states[negative])


def test_a_picture_is_of_the_times_that_were_reached(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[tuple[Mapping[str, Any], NDArray[np.float64]]] = []

    def draw(_report: Any, statistics: Any, sample: NDArray[np.float64], _columns: Any) -> Any:
        shown.append((statistics, sample))
        return {}

    monkeypatch.setattr(ensemble_pictures, "draw_ensemble", draw)
    state = toy_state()
    state[8 + RATE_AT] = -1.0
    with pytest.raises(EnsembleFailed, match="every member failed"):
        run_ensemble(
            ensemble_of_toys({"FAIL_MEMBER": 7}),
            states=np.tile(state, (3, 1)),
            out=tmp_path / "run",
        )
    ((statistics, sample),) = shown
    assert statistics["t"].tolist() == pytest.approx([0, 0.25])
    assert sample.shape[:2] == (3, 2)
    assert np.isfinite(sample).all()


def test_a_kept_member_that_could_not_start_has_no_trajectory() -> None:
    states = np.tile(toy_state(), (3, 1))
    states[1] = np.nan
    run = run_ensemble(toy(end=0.5, step=0.05), states=states, keep=[0, 1])
    assert run.report["ensemble"]["kept"] == [0]
    assert run.failures["member"].tolist() == [1]
    with pytest.raises(UsageError, match="member 1 was not kept; 0 were"):
        run.trajectory(1)


def test_where_no_member_can_start_none_is_named_as_the_worst() -> None:
    with pytest.raises(EnsembleFailed) as failed:
        run_ensemble(toy(end=0.5, step=0.05), states=np.full((3, len(toy_state())), np.nan))
    told = failed.value.run.summary()
    assert "no member has started" in told
    assert "member -1" not in told


def test_what_cannot_be_written_ends_the_others_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[bool] = []
    step = ensemble.run_chunk

    def chunk(library: Any, job: Job, part: Part, first: int, meter: Any) -> Any:
        if first >= PART:
            for _ in range(0 if told else 500):
                if not meter.stopped:
                    time.sleep(0.01)
            told.append(meter.stopped)
            return Tally.none(job, library.description)
        return step(library, job, part, first, meter)

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(ensemble, "run_chunk", chunk)
    monkeypatch.setattr(EnsembleFiles, "append", full)
    with pytest.raises(OSError, match="No space left"):
        run_ensemble(ensemble_of_toys(), 3 * PART, end=0.1, threads=1, out=tmp_path / "run")
    # At most the chunk that was under way.
    assert told in ([], [True])
    assert not (tmp_path / "run").exists()


def test_an_ensemble_is_told_the_same_from_its_folder(tmp_path: Path) -> None:
    run = run_ensemble(ensemble_of_toys(), 1, out=tmp_path / "run", pictures=False)
    assert np.isnan(run.deviation("energy")).all()
    assert hamotor.open_ensemble(tmp_path / "run").summary() == run.summary()


def test_whole_numbers_may_be_those_of_numpy(tmp_path: Path) -> None:
    one = np.ones(1, dtype=np.int64)[0]
    run = run_ensemble(
        ensemble_of_toys(),
        5 * one,
        seed=7 * one,
        threads=one,
        keep=np.arange(2),
        out=tmp_path / "a",
    )
    assert digest(run) == digest(run_ensemble(ensemble_of_toys(), 5, seed=7, keep=[0, 1]))
    alone = run_ensemble(ensemble_of_toys(), 5, seed=7, member=3 * one, out=tmp_path / "b")
    assert (alone.states[0] == run.states[3]).all()


def test_states_of_ones_own_are_where_members_start() -> None:
    states = np.tile(toy_state(), (3, 1))
    states[:, 8 + PUSH_AT] = [0.0, 1.0, 2.0]
    run = run_ensemble(toy(end=0.5, step=0.05), states=states)
    x = run.states[:, 4] * run.states[:, 0] + run.states[:, 5] * run.states[:, 3]
    assert -2 * x == pytest.approx(np.cos(0.5) + states[:, 8 + PUSH_AT] * np.sin(0.5), abs=1e-3)
    assert run.report["ensemble"]["seed"] is None


def test_an_interrupted_ensemble_keeps_what_was_computed(tmp_path: Path) -> None:
    toys = ensemble_of_toys({"SLEEP_US": 2000}, end=100.0, every=1)
    toys.compile(ensembles=True)
    interrupting = interrupts(0.6)
    with pytest.raises(EnsembleInterrupted) as caught:
        run_ensemble(toys, 3, out=tmp_path / "run", threads=1)
    interrupting.join()
    run = caught.value.run
    assert run.status == "interrupted"
    found = hamotor.open_ensemble(tmp_path / "run")
    assert 2 <= len(found.t) < 2000
    assert found.statistics["members"].tolist() == [3] * len(found.t)
    with pytest.raises(EnsembleFailed, match="the time limit passed"):
        run_ensemble(toys, 3, time_limit=0.2, threads=1)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"members": 0}, "members must be a whole number from 1"),
        ({"members": 5, "member": 5}, "there is no member 5: they are 0 to 4"),
        ({"members": 5, "keep": [5]}, "cannot keep member 5: they are 0 to 4"),
        ({"members": 5, "seed": -1}, "a seed is a whole number"),
        ({"members": 5, "times": [0.12]}, "none of 0.05 s ends at t = 0.12 s"),
        ({"members": 5, "scalar": "quad"}, "stepped in double and float, not quad"),
        ({"members": 5, "engine": "dusk"}, 'unknown engine "dusk".*Did you mean "dask"'),
        ({"members": 5, "scheduler": "tcp://x"}, "a scheduler is for the engine dask"),
        ({"members": 5, "local_tolerance": 1e-6}, "splitting2 does not choose its steps"),
        ({"members": 5, "threads": 0}, "threads must be at least 1"),
        ({"members": 5, "every": 0}, "every must be a whole number of steps, at least 1"),
        ({"members": 5.5}, "members must be a whole number, not 5.5"),
        ({"members": 5, "seed": 1.5}, "seed must be a whole number, not 1.5"),
        ({"members": 5, "keep": [1.5]}, "keep: each must be a whole number, not 1.5"),
        ({"members": 5, "keep": 3}, "keep must be a list of whole numbers, not 3"),
        ({"states": np.zeros((2, 14)) + 1j}, "array of real numbers: their type is complex128"),
        ({"states": [[0.0], [0.0, 1.0]]}, "states must be an array of real numbers: "),
        ({"states": np.zeros((2, 3))}, r"states must have shape \(members, 14\), not \(2, 3\)"),
    ],
)
def test_what_cannot_be_is_said_before_anything_is_stepped(
    settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        run_ensemble(ensemble_of_toys(), **settings)


def test_scenes_that_draw_nothing_are_refused() -> None:
    with pytest.raises(UsageError, match=r"dzhanibekov: all members would be the same"):
        run_ensemble("dzhanibekov", 10)
    with pytest.raises(UsageError, match=r"rkmk44.*Did you mean .rkmk4"):
        run_ensemble("tumbling_debris", 10, method="rkmk44")


BOUNCE = """
algebra = "pga3"
[[body]]
name = "a"
mass = 2.0
inertia = [1.0, 2.0, 2.5]
position = [0.3, 0, 1]
angular_velocity = [0.1, 2, 0.3]
[[interaction]]
type = "gravity"
acceleration = [0, 0, -9.0]
[[interaction]]
type = "spring"
body = "a"
anchor = [0, 0, 0]
stiffness = 50.0
[time]
end = 1.0
step = 0.005
method = "rk4"
compensated = true
[output]
every = 100
[[ensemble.parameter]]
name = "stiffness"
interaction = 2
distribution = { low = 20, high = 80 }
[[ensemble.parameter]]
name = "acceleration_z"
interaction = 1
distribution = { values = [-9.0, -1.62, 0] }
"""


@pytest.fixture(scope="module")
def bounce(tmp_path_factory: pytest.TempPathFactory) -> Simulation:
    """A body on a spring of its own stiffness, in a gravity of its own."""
    path = tmp_path_factory.mktemp("scenes") / "bounce.toml"
    path.write_text(BOUNCE)
    return hamotor.load(path)


def test_members_have_parameters_of_their_own(bounce: Simulation) -> None:
    members = 21
    run = run_ensemble(bounce, members, keep=range(members), seed=4)
    _, parameters = starts(bounce.ensemble, bounce.state, 4, 0, members)
    stiffness, field = parameters.T
    assert 20 < stiffness.min() < 35
    assert 65 < stiffness.max() < 80
    assert field[:4].tolist() == [-9.0, -1.62, 0.0, -9.0]
    rest = 2.0 * field / stiffness
    for member in range(members):
        found = run.trajectory(member)
        swing = np.cos(np.sqrt(stiffness[member] / 2.0) * found["t"])
        height = rest[member] + (1.0 - rest[member]) * swing
        np.testing.assert_allclose(found["a.position.z"], height, atol=1e-6)
        np.testing.assert_allclose(found["a.position.x"], 0.3 * swing, atol=1e-6)
        turning = (0.01 + 8.0 + 0.225) / 2
        energy = turning + stiffness[member] * 1.09 / 2 - 2.0 * field[member]
        np.testing.assert_allclose(found["energy"], energy, rtol=1e-7)
    assert run.report["compensated"] is True
    alone = run_ensemble(bounce, members, member=13, seed=4)
    assert (alone.states[0] == run.states[13]).all()


def test_what_is_conserved_is_so_with_every_members_parameters(tmp_path: Path) -> None:
    """The scene's own field is zero and its pull along e1, so that it keeps more than members."""
    pull = """
[[interaction]]
type = "potential"
expression = "dot(k, position)"
parameters = { k = [2.0, 0, 0] }
"""
    text = BOUNCE.replace("[0, 0, -9.0]", "[0, 0, 0]")
    text = (
        text[: text.index('[[interaction]]\ntype = "spring"')] + pull + text[text.index("[time]") :]
    )
    text = (
        text[: text.index("[[ensemble")]
        + """
[[ensemble.parameter]]
name = "acceleration_z"
interaction = 1
distribution = { low = -3, high = 3 }
[[ensemble.parameter]]
name = "k_x"
interaction = 2
distribution = { low = 1, high = 3 }
"""
    )
    path = tmp_path / "pulled.toml"
    path.write_text(text)
    run = run_ensemble(path, 5)
    errors = {name: q["max_relative_error"] for name, q in run.report["conserved"].items()}
    assert set(errors) == {"energy", "spatial_momentum.e02"}
    assert max(errors.values()) < 1e-8


def test_show_says_in_what_members_differ(bounce: Simulation) -> None:
    assert bounce.read is not None
    shown = account(bounce.read())
    assert "members differ in\n  parameters: 2.stiffness, 1.acceleration_z\n  by 1 random" in shown
    debris = account(read_scene("tumbling_debris"))
    assert "  fragment: position, orientation, velocities\n  by 13 random numbers each" in debris
    assert "members differ" not in account(read_scene("dzhanibekov"))


def test_an_ensemble_steps_like_single_runs(bounce: Simulation) -> None:
    states = np.tile(bounce.state, (19, 1))
    states[:, 8:] += np.linspace(-1, 1, 19)[:, np.newaxis]
    own = {"2.stiffness": np.full(19, 50), "1.acceleration_z": np.full(19, -9)}
    run = run_ensemble(bounce, states=states, parameters=own, end=0.1)
    library = bounce.compile(method="rk4", compensated=True, ensembles=True).library
    for member in range(19):
        with library.start("rk4", step=0.005, state=states[member]) as live:
            live.advance(20, 0, None)
            assert (live.state() == run.states[member]).all()
    assert "19 members, given states and parameters, 20 steps of 0.005 s" in run.summary()


def test_parameters_and_states_of_ones_own_take_the_place_of_drawn_ones(bounce: Simulation) -> None:
    drawn = run_ensemble(bounce, 7, seed=4, end=0.5, keep=[5])
    states, parameters = starts(bounce.ensemble, bounce.state, 4, 0, 7)
    own = dict(zip(("2.stiffness", "1.acceleration_z"), parameters.T, strict=True))
    for run in (
        run_ensemble(bounce, parameters=own, end=0.5, keep=[5]),
        run_ensemble(bounce, 7, parameters={"2.stiffness": own["2.stiffness"]}, seed=4, end=0.5),
        run_ensemble(bounce, states=states, seed=4, end=0.5),
        run_ensemble(bounce, states=states, parameters=own, end=0.5),
    ):
        assert (run.states == drawn.states).all()
    other = {"2.stiffness": 2 * own["2.stiffness"]}
    found = run_ensemble(bounce, parameters=other, seed=4, end=0.5)
    assert (found.states != drawn.states).any(axis=1).all()


@pytest.mark.parametrize(
    ("own", "message"),
    [
        (
            {"stiffness": [1]},
            r'called "stiffness"; there is 2.stiff.*mean "2.stiffness"',
        ),
        ({"2.stiffness": 3.0}, "must be a number for each member"),
        ({"2.stiffness": ["a"]}, "must be an array of real numbers"),
        ({"2.stiffness": [1, np.nan]}, "of member 1 is not finite: nan"),
        ({"2.stiffness": [1, 2], "1.acceleration_z": [1]}, "2 members, but .* of 1;"),
    ],
)
def test_parameters_of_ones_own_that_do_not_fit_are_refused(
    bounce: Simulation, own: dict[str, Any], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        run_ensemble(bounce, parameters=own)


def test_parameters_are_given_by_name_and_for_all_members(bounce: Simulation) -> None:
    with pytest.raises(UsageError, match="one member by giving its alone"):
        run_ensemble(bounce, parameters={"2.stiffness": [1, 2]}, member=1)
    with pytest.raises(UsageError, match="must be given by name"):
        run_ensemble(bounce, parameters=np.ones((7, 2)))  # type: ignore[arg-type]


def test_a_report_says_what_was_given_and_names_the_seed_of_what_was_drawn(
    tmp_path: Path,
) -> None:
    text = BOUNCE.replace("{ values = [-9.0, -1.62, 0] }", "{ low = -9, high = 0 }")
    (tmp_path / "s.toml").write_text(text)
    bounce = hamotor.load(tmp_path / "s.toml")
    states = np.tile(bounce.state, (3, 1))
    some = {"2.stiffness": [50, 60, 70]}

    def said(seed: int, **own: Any) -> tuple[object, object, Rows]:
        run = run_ensemble(bounce, 3, seed=seed, end=0.05, **own)
        assert ("given" in run.summary()) == bool(own)
        return run.report["ensemble"]["seed"], run.report["ensemble"]["given"], run.states

    for own in ({"states": states, "parameters": some}, {"parameters": some}):
        one, other = said(1, **own), said(2, **own)
        assert (one[0], one[1]) == (1, list(own))
        assert (one[2] != other[2]).any(axis=1).all()
    whole = some | {"1.acceleration_z": [0, -1, -2]}
    assert said(1, parameters=whole)[:2] == (None, ["parameters"])
    assert said(1)[:2] == (1, [])


def test_the_scenes_local_tolerance_is_the_ensembles(bounce: Simulation) -> None:
    own = replace(bounce, method="rkmk87", local_tolerance=1e-10, step=0.5, every=1)
    asked = run_ensemble(own, 9, method="rkmk87", local_tolerance=1e-10)
    found = run_ensemble(own, 9)
    assert found.report["local_tolerance"] == 1e-10
    assert (found.states == asked.states).all()
    assert found.report["conserved"]["energy"]["max_relative_error"] < 1e-8


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "stifness"', 'interaction 2 has no parameter "stifness".*Did you mean "stiff'),
        ('name = "mass"', r'the energy has no parameter "mass"; it has none'),
        ('interaction = 3\nname = "k"', r'interaction 3 has no parameter "k"; it has none'),
        ('name = "stiffness"\ninteraction = 2', '"2.stiffness" is drawn already'),
    ],
)
def test_parameters_that_there_are_not_are_refused(text: str, message: str) -> None:
    draws = f"[[ensemble.parameter]]\n{text}\ndistribution = {{ sd = 1 }}\n"
    if "stifness" in text:
        draws = draws.replace(text, f"{text}\ninteraction = 2")
    with pytest.raises(UsageError, match=message):
        parse_scene((BOUNCE + draws).encode(), name="s", file="s.toml")


def test_what_cannot_have_drawn_parameters_is_refused(bounce: Simulation) -> None:
    with pytest.raises(UsageError, match=r"2.stiffness, 1.acceleration_z cannot be drawn: taylor"):
        run_ensemble(bounce, 3, method="taylor")
    with pytest.raises(UsageError, match=r"method .closed_form. is for free rigid bodies"):
        run_ensemble(bounce, 3, method="closed_form")


# ---------------------------------------------------------------- other processes


def job_of(
    tmp_path: Path, members: int, monkeypatch: pytest.MonkeyPatch
) -> tuple[Job, EnsembleRun]:
    """A job of the toy as `run_ensemble` makes it, and what it gives here."""
    jobs: list[Job] = []
    toys = ensemble_of_toys()
    whole = run_ensemble(toys, members, end=0.1, keep=[2], out=tmp_path / "local")

    def note(job: Job, *_: Any) -> Any:
        jobs.append(job)
        none: list[Part] = []
        return (part for part in none)

    monkeypatch.setattr(cluster, "run_parts_on", note)
    with pytest.raises(EnsembleFailed):
        run_ensemble(toys, members, end=0.1, keep=[2], engine="dask")
    return jobs[0], whole


def test_a_part_is_a_file_that_is_written_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job, whole = job_of(tmp_path, PART + 10, monkeypatch)
    parts = tmp_path / "parts"
    cluster._write_job(parts, job)
    for number in range(job.parts):
        cluster.compute_part(str(parts), number)
    found = [cluster._read(parts, number) for number in range(job.parts)]
    assert [len(part.states) for part in found] == [PART, 10]
    assert (np.concatenate([part.states for part in found]) == whole.states).all()
    total = found[0].tally
    total.merge(found[1].tally)
    assert (total.moments.mean[:, 14] == whole.mean("bob.position.x")).all()
    assert (total.kept[2][:, 15] == whole.trajectory(2)["bob.position.x"]).all()
    files = {path: path.stat().st_mtime_ns for path in parts.iterdir()}
    cluster.compute_part(str(parts), 0)
    assert {path: path.stat().st_mtime_ns for path in parts.iterdir()} == files
    (parts / "part-00001.npz").write_bytes(b"half a part")
    with pytest.raises(ToolError, match=r"part-00001.npz cannot be read"):
        cluster._read(parts, 1)
    assert replace(job, seed=4).key != job.key
    assert Job.from_json(json.loads(json.dumps(job.to_json()))) == job
    assert isinstance(Part.from_arrays(found[0].to_arrays()), Part)


class Scheduler:
    """In the place of dask's module: a scheduler that computes a task at once, and once."""

    class KilledWorker(Exception):
        pass

    def __init__(self) -> None:
        self.tasks: dict[str, Future[Any]] = {}

    @contextmanager
    def Client(self, address: str, **_: Any) -> Iterator[Scheduler]:
        if not address[-1].isdigit():
            raise ValueError("missing port number")
        yield self

    def submit(self, compute: Callable[..., Any], *of: Any, key: str, **_: Any) -> Future[Any]:
        if key not in self.tasks:
            self.tasks[key] = Future()
            self.tasks[key].set_result(compute(*of))
        return self.tasks[key]


def test_an_ensemble_into_another_folder_has_tasks_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", Scheduler())
    one, two = (
        run_ensemble(
            ensemble_of_toys(), 9, engine="dask", scheduler="tcp://a:1", out=tmp_path / name
        )
        for name in ("one", "two")
    )
    assert digest(one) == digest(two) == digest(run_ensemble(ensemble_of_toys(), 9))


def test_a_scheduler_that_is_not_there_is_no_error_of_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scheduler = Scheduler()
    monkeypatch.setitem(sys.modules, "distributed", scheduler)
    settings: dict[str, Any] = {"engine": "dask", "out": tmp_path / "run"}
    with pytest.raises(ToolError, match="no dask scheduler answers at nonsense: missing port"):
        run_ensemble(ensemble_of_toys(), 9, scheduler="nonsense", **settings)
    with pytest.raises(UsageError, match="the scheduler's address is empty"):
        run_ensemble(ensemble_of_toys(), 9, scheduler="", **settings)
    lost: Future[Any] = Future()
    lost.cancel()
    monkeypatch.setattr(scheduler, "submit", lambda *_, **__: lost)
    with pytest.raises(ToolError, match=r"scheduler was lost.*The same command goes on"):
        run_ensemble(ensemble_of_toys(), 9, scheduler="tcp://a:1", **settings)


def test_dask_is_an_extra_that_the_error_tells_how_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    message = r"-m pip install --require-hashes -r .*dask.lock"
    with pytest.raises(ToolError, match=message) as caught:
        run_ensemble(ensemble_of_toys(), 10, engine="dask")
    assert caught.value.exit_code == 4
    assert cluster.REQUIREMENTS.is_file()


def test_states_of_another_shape_are_refused() -> None:
    library: SceneLibrary = toy().compile().library
    with pytest.raises(ToolError, match="states of shape"):
        library.start_ensemble("splitting2", step=0.1, states=np.zeros((1, 3)))


@pytest.mark.long
@pytest.mark.parametrize("method", ["rk4", "taylor"])
def test_no_bit_depends_on_the_instruction_set(
    monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    found = {}
    for name in build.INSTRUCTION_SETS:
        monkeypatch.setenv("HAMOTOR_ISA", name)
        try:
            build.flags_for(os.uname().machine)
        except UsageError:  # not on this machine
            continue
        run = run_ensemble("tumbling_debris", 16, end=1.0, method=method)
        assert run.report["ensemble"]["isa"] == name
        found[name] = digest(run)
    monkeypatch.delenv("HAMOTOR_ISA")
    run = run_ensemble("tumbling_debris", 16, end=1.0, method=method)
    assert {*found.values()} <= {digest(run)}
