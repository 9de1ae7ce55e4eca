"""`auto`: what was measured, and which scenes it is taken for."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import hamotor
from hamotor.bench.choice import tabulated
from hamotor.bench.endpoint import ATTITUDE
from hamotor.run.choice import TABLE, choose_method
from hamotor.scene import METHODS, Form, methods_offered
from hamotor.scene.methods import ALL
from hamotor.scene.structure import STRUCTURES, structure_of

FREE = methods_offered(Form.SPLIT | Form.FREE)
SPLIT = methods_offered(Form.SPLIT)
GENERAL = methods_offered(Form.GENERAL)


def table() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(TABLE.read_text(encoding="utf-8"))["structures"]
    return found


def test_the_table_speaks_of_known_structures_and_methods_in_order_of_time() -> None:
    by_name = {m.name: m for m in METHODS}
    assert set(table()) == set(STRUCTURES) - {"rough"}
    for measured in table().values():
        for entries in measured["cheapest"].values():
            assert {e["method"] for e in entries} <= set(by_name)
            times = [e["us"] for e in entries]
            assert times == sorted(times)
        assert all(by_name[e["method"]].promises & ALL == ALL for e in measured["preserving"])


@pytest.mark.parametrize(
    ("scene", "structure"),
    [
        ("tumble", "free"),
        ("heavy_top", "symmetric"),
        ("spring_pendulum", "asymmetric"),
        ("magnet", "field"),
        ("planar", "planar"),
        ("two_bodies", "several"),
        ("kirchhoff", "parts"),
        ("breathing_body", "general"),
        ("rocket", "forced"),
    ],
)
def test_scenes_have_the_structure_they_were_measured_for(scene: str, structure: str) -> None:
    assert hamotor.load(scene).structure == structure


def test_a_force_with_a_corner_is_rough(tmp_path: Path) -> None:
    path = tmp_path / "rough.toml"
    path.write_text(
        """
algebra = "pga2"
[[body]]
name = "sledge"
mass = 1
inertia = 1
velocity = [1, 0]
[[interaction]]
type = "force"
body = "sledge"
expression = "-0.2 * abs(velocity(0, 0).x) * [1, 0]"
[time]
end = 2
step = 0.01
""",
        encoding="utf-8",
    )
    simulation = hamotor.load(path)
    assert simulation.structure == "rough"
    assert choose_method("auto", simulation.methods, 1e-6, "rough")[0] == "rk54"


def test_what_is_exact_is_taken_for_free_bodies_and_said_to_be_measured() -> None:
    method, reason = choose_method("auto", FREE, 1e-10, "free")
    assert method == "closed_form"
    assert "in the least time" in reason
    assert choose_method("auto", GENERAL, 1e-10, "free")[0] in GENERAL, "of what is offered"
    assert "measured" in choose_method("auto", GENERAL, 1e-10, "rough")[1]


def test_without_a_tolerance_structure_is_kept() -> None:
    assert choose_method("auto", SPLIT, None, "symmetric")[0] == "splitting2"
    general = choose_method("auto", GENERAL, None, "general")[0]
    assert {m.name: m.promises for m in METHODS}[general] & ALL == ALL
    assert choose_method("auto", GENERAL, None, "forced")[0] == "rkmk4"


def test_smaller_tolerances_take_more_time() -> None:
    for measured in table().values():
        best = [entries[0]["us"] for entries in measured["cheapest"].values() if entries]
        assert best == sorted(best)


def test_a_tolerance_is_met_by_the_method_that_was_chosen() -> None:
    run = hamotor.load("tumble").run(end=50.0, tolerance=1e-10)
    assert run.report["method"] == "closed_form"
    assert run.report["tolerance"]["achieved"] <= 1e-10
    assert "because it reached 1e-10" in run.summary()
    assert "(the scene's own: --method splitting2)" in run.summary()


def test_a_method_for_steps_gives_way_to_a_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled: list[str] = []

    class Compiled(Exception):
        pass

    def compile_(_: hamotor.Simulation, *, method: str, **__: object) -> None:
        compiled.append(method)
        raise Compiled

    monkeypatch.setattr(hamotor.Simulation, "compile", compile_)
    scene = hamotor.load("gravity_gradient")
    for simulation, asked in (
        (scene, {"tolerance": 1e-6}),
        (scene, {"tolerance": 1e-6, "method": "rkmk4"}),
        (scene, {"step": 1.0}),
        (replace(scene, step=None, tolerance=1e-3), {"tolerance": 1e-6}),
    ):
        with pytest.raises(Compiled):
            simulation.run(**asked)
    assert compiled == ["rk87", "rkmk4", "rkmk4", "rkmk4"]


def test_an_account_is_reduced_to_what_is_cheapest() -> None:
    def row(method: str, us: float, error: float) -> dict[str, Any]:
        return {
            "problem": "heavy_top",
            "contestant": method,
            "family": "hamotor",
            "form": "",
            "compiler": "g++",
            "best_us": us,
            "steps": us * 10,
            "errors": {"attitude (rad)": error},
            "failure": None,
        }

    def ladder(method: str, cost: float, order: int) -> list[dict[str, Any]]:
        return [row(method, cost * 2**k, 10.0 ** (-order * k)) for k in range(9)]

    rows = [*ladder("rkmk4", 10, 1), *ladder("splitting2", 50, 2)]
    told = {"norm": ATTITUDE, "end_s": 1.5}
    account = {"targets": [1e-2, 1e-6], "rows": rows, "problems": {"heavy_top": told}}
    said = tabulated(account, "heavy_top")
    assert said["structure"] == "symmetric"
    assert said["measured_on"] == "the first 1.5 s of heavy_top"
    names = {t: [e["method"] for e in entries] for t, entries in said["cheapest"].items()}
    assert names == {"0.01": ["rkmk4", "splitting2"], "1e-06": ["splitting2", "rkmk4"]}
    assert said["cheapest"]["1e-06"][0]["us"] == 50 * 8
    assert [e["method"] for e in said["preserving"]] == ["splitting2"]
    assert structure_of(hamotor.load("heavy_top").read()) == "symmetric"  # type: ignore[misc]
