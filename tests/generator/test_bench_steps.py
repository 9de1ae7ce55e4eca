"""The benchmark of whole steps: every form of a scene, with its error."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hamotor.bench import bench_steps
from hamotor.bench.steps import _one_a_family
from hamotor.errors import UsageError


@pytest.mark.slow
def test_forms_of_a_scene_differ_in_speed_and_agree_in_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    account = bench_steps(["planar"], tmp_path, quick=True)
    assert json.loads((tmp_path / "steps.json").read_text(encoding="utf-8")) == account
    rows = {(row["form"], row["method"]): row for row in account["rows"]}
    forms = {form for form, _ in rows}
    assert forms == {"generated", "generic", "sparse", "matrix"}
    assert rows["generated", "rkmk4"]["ratio"] == 1
    assert rows["generic", "rkmk4"]["ratio"] > rows["sparse", "rkmk4"]["ratio"] > 1
    errors = [rows[form, "rkmk4"]["errors"]["position (m)"] for form in forms]
    # Formulated in other frames, of the same order: alike, not equal.
    assert errors == pytest.approx([errors[0]] * 4, rel=0.5)
    assert rows["generated", "splitting8"]["errors"]["position (m)"] < errors[0]
    ratios = {(ratio["form"], ratio["family"]): ratio["ratio"] for ratio in account["families"]}
    explicit_and_implicit = {("generic", "rkmk"), ("generic", "gauss"), ("generic", "taylor")}
    assert explicit_and_implicit <= set(ratios)
    assert ratios["generic", "gauss"] > 2
    assert "planar, step" in capsys.readouterr().out


def test_quickly_a_family_is_stepped_by_one_method() -> None:
    offered = {"rkmk4": 4, "rkmk54": 5, "rkmk87": 8, "splitting8": 8, "splitting10": 10, "t": 34}
    assert _one_a_family(offered) == ["rkmk4", "rkmk87", "splitting8", "t"]


def test_a_scene_without_a_step_is_refused(tmp_path: Path) -> None:
    scene = tmp_path / "loose.toml"
    scene.write_text(
        'algebra = "pga2"\n[[body]]\nname = "a"\nmass = 1\ninertia = 1\n'
        "[time]\nend = 1\ntolerance = 1e-6\n",
        encoding="utf-8",
    )
    with pytest.raises(UsageError, match="needs \\[time\\] step"):
        bench_steps([str(scene)])
