"""`hamotor test` runs everything, says what failed, and leaves nothing of CI to chance."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from hamotor import testing
from hamotor.errors import ToolError
from hamotor.testing import Check, Outcome

ROOT = Path(__file__).resolve().parents[2]
PASSES = Check("passes", ((sys.executable, "-c", "print('it ran')"),))
FAILS = Check("fails", ((sys.executable, "-c", "raise SystemExit(7)"), ("never", "reached")))
READS = Check("reads", ((sys.executable, "-c", "import sys; sys.exit(len(sys.stdin.read()))"),))


def test_a_failure_does_not_stop_the_checks_after_it(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    listed = [Check("fails", FAILS.commands[:1]), PASSES]
    monkeypatch.setattr(testing, "checks", lambda *_: listed)
    assert testing.run_tests(fast=False) == 1
    said = capfd.readouterr().out
    assert "it ran" in said
    assert said.rstrip().splitlines()[-1].startswith("1 of 2 checks failed")


def test_all_passed_is_zero_and_nobody_waits_for_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(testing, "checks", lambda *_: [PASSES, READS])
    assert testing.run_tests(fast=False) == 0


def test_a_missing_tool_is_named_before_anything_runs(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(testing, "checks", lambda *_: [PASSES, FAILS])
    with pytest.raises(ToolError, match="no such command: never"):
        testing.run_tests(fast=False)
    assert "it ran" not in capfd.readouterr().out


def test_the_table_names_the_command_that_failed() -> None:
    command = (sys.executable, "-m", "mypy", *("many.py" for _ in range(100)))
    table = testing.summary([Outcome(PASSES, None, 1.0), Outcome(FAILS, command, 2.0)])
    assert "passed" in table
    assert "-m mypy many.py" in table
    assert max(map(len, table.splitlines())) < 200


def test_fast_leaves_out_clang_and_slow_tests() -> None:
    all_names = [check.name for check in testing.checks(fast=False)]
    fast = testing.checks(fast=True)
    assert set(all_names) - {check.name for check in fast} == {"C++ tests, clang"}
    assert "not slow and not long" in fast[-1].commands[-1]


def test_tests_marked_long_run_only_when_asked_for() -> None:
    assert "not long" in testing.checks(fast=False)[-1].commands[-1]
    assert "-m" not in testing.checks(fast=False, long=True)[-1].commands[-1][4:]


def test_every_compiler_has_its_presets() -> None:
    presets = json.loads((ROOT / "CMakePresets.json").read_text(encoding="utf-8"))
    for kind in ("configurePresets", "buildPresets", "testPresets"):
        names = {preset["name"] for preset in presets[kind]}
        assert {"gcc", "clang", "release", "debug"} <= names


def test_a_build_folder_of_another_place_is_forgotten(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(testing, "ROOT", tmp_path)
    monkeypatch.setattr(testing, "checks", lambda *_: [PASSES])
    for name, home in (("moved", "/elsewhere"), ("kept", tmp_path)):
        cache = tmp_path / ".hamotor" / "build" / name / "CMakeCache.txt"
        cache.parent.mkdir(parents=True)
        cache.write_text(f"CMAKE_HOME_DIRECTORY:INTERNAL={home}\n", encoding="utf-8")
    assert testing.run_tests(fast=True) == 0
    assert [path.name for path in (tmp_path / ".hamotor" / "build").iterdir()] == ["kept"]
