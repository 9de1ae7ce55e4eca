"""What reading a scene gave is kept, until its text or the generator changes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import hamotor
from hamotor.run import remembered
from hamotor.run.remembered import Remembered, key_of


def test_a_value_is_derived_once(tmp_path: Path) -> None:
    asked: list[int] = []

    def derive() -> float:
        asked.append(1)
        return 0.1

    assert Remembered(tmp_path, "a").value("x", derive) == 0.1
    assert Remembered(tmp_path, "a").value("x", derive) == 0.1
    assert Remembered(tmp_path, "b").value("x", derive) == 0.1
    assert len(asked) == 2


def test_another_text_another_name_or_another_generator_is_another_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.py").write_text("1", encoding="utf-8")
    monkeypatch.setattr(remembered, "DERIVING", (tmp_path,))
    monkeypatch.setattr(remembered, "GENERATOR", tmp_path / "generator")
    keys = {
        key_of(b"x", "one", tmp_path),
        key_of(b"y", "one", tmp_path),
        key_of(b"x", "two", tmp_path),
    }
    (tmp_path / "a.py").write_text("12", encoding="utf-8")
    assert len(keys | {key_of(b"x", "one", tmp_path)}) == 4


def test_a_damaged_cache_is_no_error(tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    for text in ("{", "[]", "\x00"):
        (tmp_path / "scenes" / "a.json").write_text(text, encoding="utf-8")
        assert Remembered(tmp_path, "a").value("x", lambda: 1) == 1
    assert json.loads((tmp_path / "scenes" / "a.json").read_text(encoding="utf-8")) == {"x": 1}


def test_a_mistake_is_told_every_time_and_not_kept(tmp_path: Path) -> None:
    scene = tmp_path / "bad.toml"
    scene.write_text('algebra = "pga3"\n', encoding="utf-8")
    for _ in range(2):
        with pytest.raises(hamotor.UsageError, match=r"bad\.toml"):
            hamotor.load(scene)


def test_a_remembered_scene_has_the_same_source_and_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HAMOTOR_CACHE", str(tmp_path))
    first, second = hamotor.load("heavy_top"), hamotor.load("heavy_top")
    assert first.source("generated", "double") == second.source("generated", "double")
    assert list(first.state) == list(second.state)
    assert (first.end, first.step, first.spec_hash) == (second.end, second.step, second.spec_hash)
