"""What `hamotor bench kernels` makes of what its programs say."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from hamotor.bench import bench_kernels, kernels
from hamotor.bench.report import MODES, best_eigen, draw_ratios, table
from hamotor.errors import CheckFailed, ToolError


def row(contestant: str, ns: float, compiler: str = "g++", mode: str = "latency") -> dict[str, Any]:
    return {
        "operation": "point",
        "contestant": contestant,
        "compiler": compiler,
        "scalar": "double",
        "mode": mode,
        "ns": ns,
        "repetitions": [ns],
        "max_relative_error": 1e-16,
    }


def account(*rows: dict[str, Any]) -> dict[str, Any]:
    return {
        "rows": list(rows),
        "unit": "ns",
        "error": "largest",
        "not_there": {"Klein": "nowhere"},
        "provenance": {"processor": "P", "compilers": {"g++": "g++ 12"}, "flags": "-O3"},
    }


def test_ratios_are_to_the_best_eigen_of_all_compilers() -> None:
    rows = [
        row("generated", 3.0),
        row("generated", 8.0, "clang++"),
        row("Eigen Isometry3", 10.0),
        row("Eigen Isometry3", 5.0, "clang++"),
        row("Eigen quaternion + translation", 4.0, "clang++"),
    ]
    assert best_eigen(rows) == 4.0
    (generated,) = [x for x in table(account(*rows)).splitlines() if x.startswith("  generated")]
    assert generated.split()[1:] == ["3.00", "0.75", "8.00", "2.00", "1.0e-16"]


def test_without_eigen_there_is_no_ratio_and_no_bar(tmp_path: Path) -> None:
    said = account(row("generated", 3.0))
    (generated,) = [x for x in table(said).splitlines() if x.startswith("  generated")]
    assert generated.split()[1:] == ["3.00", "-", "1.0e-16"]
    draw_ratios(said, tmp_path / "empty.png")
    assert (tmp_path / "empty.png").stat().st_size > 1000


def test_what_could_not_be_compared_is_said() -> None:
    assert "not compared: Klein: nowhere" in table(account(row("generated", 1.0)))


def program(folder: Path, errors: list[dict[str, Any]]) -> Path:
    """A program that answers like the benchmark's."""
    made = folder / "tests" / "bench" / "kernels"
    made.parent.mkdir(parents=True)
    lines = "\n".join(json.dumps(x) for x in errors)
    (folder / "errors").write_text(lines, encoding="utf-8")
    times = {
        "benchmarks": [
            {
                "run_name": f"{x['operation']}|{x['contestant']}|double|{mode}",
                "run_type": "iteration",
                "items_per_second": rate,
            }
            for x in errors
            for mode in ("latency", "array/256")
            for rate in (1e9, 5e8, 2.5e8)
        ]
    }
    (folder / "times").write_text(json.dumps(times), encoding="utf-8")
    made.write_text(
        "#!/bin/sh\n"
        f'case $1 in --errors=*) cp "{folder}/errors" "${{1#--errors=}}" ;;\n'
        f'*) for a; do case $a in --benchmark_out=*) cp "{folder}/times" '
        '"${a#--benchmark_out=}" ;; esac; done ;;\nesac\n',
        encoding="utf-8",
    )
    made.chmod(0o755)
    return made


def said(contestant: str, disagreement: float = 1e-16) -> dict[str, Any]:
    return {
        "operation": "point",
        "contestant": contestant,
        "scalar": "double",
        "max_relative_error": 2e-16,
        "disagreement": disagreement,
    }


def test_a_time_is_the_median_of_its_repetitions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made = program(tmp_path / "build", [said("generated"), said("Eigen Isometry3")])
    (tmp_path / "build" / "CMakeCache.txt").write_text("", encoding="utf-8")
    monkeypatch.setattr(kernels, "compilers_here", lambda: ["g++"])
    monkeypatch.setattr(kernels, "_build", lambda *_: {"g++": made})
    found = bench_kernels(tmp_path / "out", json=True, quick=True)
    assert [(r["contestant"], r["mode"], r["ns"]) for r in found["rows"]] == [
        (contestant, mode, 2.0)
        for contestant in ("generated", "Eigen Isometry3")
        for mode in ("latency", "array of 256")
    ]
    assert {r["mode"] for r in found["rows"]} <= set(MODES)
    assert json.loads(capsys.readouterr().out) == found
    assert json.loads((tmp_path / "out" / "kernels.json").read_text(encoding="utf-8")) == found
    assert (tmp_path / "out" / "kernels.png").exists()
    assert "GLM dual quaternion" in found["not_there"]


def test_a_contestant_that_does_something_else_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = program(tmp_path, [said("generated"), said("ganja.js C++", 0.5)])
    monkeypatch.setattr(kernels, "compilers_here", lambda: ["g++"])
    monkeypatch.setattr(kernels, "_build", lambda *_: {"g++": made})
    with pytest.raises(CheckFailed, match=r"point, ganja.js C\+\+, double: differs"):
        bench_kernels()


def test_without_a_compiler_the_error_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ToolError, match=r"no C\+\+ compiler: neither g\+\+ nor clang"):
        bench_kernels()


@pytest.mark.slow
def test_every_operation_is_measured_and_every_contestant_agrees(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernels, "compilers_here", lambda: ["g++"])
    found = bench_kernels(tmp_path, quick=True)
    measured = {(r["operation"], r["contestant"]) for r in found["rows"]}
    assert {operation for operation, _ in measured} == {
        "motor product", "point", "direction", "plane", "line", "point, matrix given",
        "direction, matrix given", "plane, matrix given", "line, matrix given", "commutator",
        "coadjoint", "exp", "log", "exp of log", "normalize", "RK4 step", "rkmk4 step",
        "splitting2 step", "cga3 even product", "cga3 versor product", "cga3 vector",
        "cga3 vector, matrix given",
        "cga3 bivector", "cga3 bivector trivector", "cga3 exp",
    }  # fmt: skip
    assert all((operation, "generated") in measured for operation, _ in measured)
    assert all(r["ns"] > 0 and r["max_relative_error"] < 1e-13 for r in found["rows"])
    assert "double, latency" in capsys.readouterr().out
