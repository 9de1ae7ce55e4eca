"""Peers are installed on demand; one that is missing is a skipped test, never a silent one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tests.peers import environment
from tests.peers.conftest import require

from hamotor import testing
from hamotor.testing import Check, Outcome


def test_a_missing_peer_is_skipped_by_name_and_says_what_installs_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(environment, "FOLDER", tmp_path)
    assert not environment.has_python_peers()
    with pytest.raises(pytest.skip.Exception, match=r"kingdon .* `\./hamotor test --with-peers`"):
        require("kingdon", environment.has_python_peers())


def test_without_node_the_installer_names_ganja_and_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(environment, "FOLDER", tmp_path)
    monkeypatch.setattr(environment, "has_python_peers", lambda: True)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert environment.install() == ["ganja.js: no such command: node, npm"]


def test_the_option_installs_peers_before_any_other_check(monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[Check] = []

    def run(check: Check) -> Outcome:
        ran.append(check)
        return Outcome(check, None, 0.0)

    monkeypatch.setattr(testing, "_run", run)
    monkeypatch.setattr(testing, "checks", lambda *_: [Check("the rest", ())])
    assert testing.run_tests(fast=True, with_peers=True) == 0
    assert testing.run_tests(fast=True) == 0
    assert [check.name for check in ran] == [
        "install peers",
        "the rest",
        "the rest",
    ]


def test_every_pin_is_exact_and_names_no_registry() -> None:
    folder = Path(__file__).parent
    pins = (folder / "requirements.txt").read_text(encoding="utf-8").split()
    assert all(pin.count("==") == 1 for pin in pins)
    assert {pin.partition("==")[0] for pin in pins} >= {"clifford", "kingdon", "galgebra"}
    lock = (folder / "package-lock.json").read_text(encoding="utf-8")
    assert "resolved" not in lock
    package = json.loads((folder / "package.json").read_text(encoding="utf-8"))
    assert json.loads(lock)["packages"][""]["dependencies"] == package["dependencies"]
