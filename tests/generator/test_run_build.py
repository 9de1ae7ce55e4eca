"""Compiling a scene: once, whole or not at all, with errors a person can act on."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from hamotor.errors import ToolError, UsageError
from hamotor.run import build, simulation
from hamotor.run.build import compile_scene, find_compiler, headers_digest
from hamotor.run.simulation import load

SMALL = 'extern "C" __attribute__((visibility("default"))) int answer() { return 42; }\n'


@pytest.fixture
def no_process(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Call it to make every later start of a process an error."""

    def refuse(*arguments: Any, **_: Any) -> None:
        raise AssertionError(f"a process was started: {arguments}")

    return lambda: monkeypatch.setattr(subprocess, "run", refuse)


def wrapped_compiler(folder: Path) -> Path:
    """A compiler of our own: a script around the real one."""
    script = folder / "c++wrapped"
    script.write_text(f'#!/bin/sh\nexec {shutil.which("g++") or "clang++"} "$@"\n')
    script.chmod(0o755)
    return script


def test_the_second_compilation_starts_no_process(tmp_path: Path, no_process: Any) -> None:
    first = compile_scene(SMALL, includes=(), cache=tmp_path)
    assert first.library.is_file()
    assert first.compile_s > 0
    assert not first.cached
    no_process()
    second = compile_scene(SMALL, includes=(), cache=tmp_path)
    assert second.library == first.library
    assert second.cached
    assert second.compile_s == 0


def test_another_text_is_another_library(tmp_path: Path) -> None:
    first = compile_scene(SMALL, includes=(), cache=tmp_path)
    second = compile_scene(SMALL.replace("42", "43"), includes=(), cache=tmp_path)
    assert first.library != second.library
    assert not second.cached


def test_a_changed_header_is_compiled_again(tmp_path: Path) -> None:
    include = tmp_path / "include"
    (include / "deep").mkdir(parents=True)
    header = include / "deep" / "value.hpp"
    text = SMALL.replace("42", "value()").replace("extern", '#include "deep/value.hpp"\nextern', 1)
    header.write_text("constexpr int value() { return 1; }\n")
    first = compile_scene(text, includes=(include,), cache=tmp_path / "cache")
    assert compile_scene(text, includes=(include,), cache=tmp_path / "cache").cached
    header.write_text("constexpr int value() { return 2; }\n")
    second = compile_scene(text, includes=(include,), cache=tmp_path / "cache")
    assert not second.cached
    assert first.library != second.library


def test_a_renamed_header_changes_the_digest(tmp_path: Path) -> None:
    (tmp_path / "a.hpp").write_text("int x;")
    before = headers_digest((tmp_path,))
    (tmp_path / "a.hpp").rename(tmp_path / "b.hpp")
    assert headers_digest((tmp_path,)) != before


def test_what_is_no_header_does_not_change_the_digest(tmp_path: Path) -> None:
    (tmp_path / "a.hpp").write_text("int x;")
    before = headers_digest((tmp_path,))
    (tmp_path / "notes.md").write_text("nothing the compiler reads")
    assert headers_digest((tmp_path,)) == before


def test_another_processor_is_another_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = compile_scene(SMALL, includes=(), cache=tmp_path)
    monkeypatch.setattr(build, "_cpuinfo_lines", lambda: ["model name : another", "flags : none"])
    second = compile_scene(SMALL, includes=(), cache=tmp_path)
    assert first.library != second.library
    assert second.processor == "another"


def test_rejected_text_is_a_tool_error_with_the_first_errors_and_the_kept_source(
    tmp_path: Path,
) -> None:
    with pytest.raises(ToolError) as caught:
        compile_scene("int broken( { return nonsense; }\n", includes=(), cache=tmp_path)
    message = str(caught.value)
    assert "error:" in message
    (kept,) = tmp_path.glob("*/scene.cpp")
    assert str(kept) in message
    assert not list(tmp_path.glob("*/*.so"))
    assert caught.value.exit_code == 4


def test_no_compiler_is_a_tool_error_that_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolError, match=r"apt-get install g\+\+"):
        compile_scene(SMALL, includes=(), cache=tmp_path)


def test_a_missing_compiler_in_cxx_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler -O2")
    with pytest.raises(ToolError, match="no-such-compiler"):
        compile_scene(SMALL, includes=(), cache=tmp_path)


def test_cxx_chooses_the_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = wrapped_compiler(tmp_path)
    monkeypatch.setenv("CXX", str(script))
    assert find_compiler(tmp_path).command == (str(script),)


def test_the_version_is_asked_again_only_when_the_compiler_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = wrapped_compiler(tmp_path)
    monkeypatch.setenv("CXX", str(script))
    asked = []
    real = subprocess.run

    def counted(command: Any, **options: Any) -> Any:
        asked.append(command)
        return real(command, **options)

    monkeypatch.setattr(subprocess, "run", counted)
    find_compiler(tmp_path)
    find_compiler(tmp_path)
    assert len(asked) == 1
    script.write_text(script.read_text() + "# changed\n")
    find_compiler(tmp_path)
    assert len(asked) == 2


def test_threads_that_ask_for_a_compiler_at_once_do_not_disturb_each_other(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        for attempt in range(5):
            cache = tmp_path / str(attempt)
            found = list(pool.map(lambda _, cache=cache: find_compiler(cache), range(8)))
            assert len({compiler.version for compiler in found}) == 1
            assert [file.name for file in cache.iterdir()] == ["compilers.json"]


def test_a_damaged_memory_of_versions_is_forgotten(tmp_path: Path) -> None:
    (tmp_path / "compilers.json").write_text("{ not json")
    assert find_compiler(tmp_path).version


def test_the_flags_keep_the_bits_of_the_kernels() -> None:
    assert "-ffp-contract=off" in build.flags_for("x86_64")
    assert "-march=native" in build.flags_for("x86_64")
    assert "-mcpu=native" in build.flags_for("aarch64")
    assert not any("fast-math" in flag for flag in build.flags_for("x86_64"))


@pytest.mark.parametrize(("machine", "expected"), [("x86_64", 1), ("aarch64", 0)])
def test_only_series_fill_the_widest_registers(
    monkeypatch: pytest.MonkeyPatch, machine: str, expected: int
) -> None:
    narrow = ("-mprefer-vector-width=256",) * expected
    given: list[tuple[str, ...]] = []

    def compiled(_: str, *, extra_flags: tuple[str, ...], **__: Any) -> None:
        given.append(extra_flags)
        raise ToolError("not now")

    monkeypatch.setattr(platform, "machine", lambda: machine)
    monkeypatch.setattr(simulation, "compile_scene", compiled)
    for methods in ("rk4", ("rk4", "taylor"), "taylor", None):
        with pytest.raises(ToolError, match="not now"):
            load("kepler").compile(method=methods, extra_flags=("-O1",))
    assert given == [(*narrow, "-O1"), *[("-O1",)] * 3]


def test_an_instruction_set_can_be_forced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "_cpuinfo_lines", lambda: ["flags : sse2 avx2 fma bmi1 bmi2"])
    monkeypatch.setenv("HAMOTOR_ISA", "avx2")
    assert {"-march=x86-64", "-mavx2", "-mfma"} < set(build.flags_for("x86_64"))
    assert "-march=native" not in build.flags_for("x86_64")
    for name, message in (
        ("avx512", "no avx512f"),
        ("avx3", 'is "avx3"; allowed are sse2, avx2, avx512. Did you mean "avx2"'),
    ):
        monkeypatch.setenv("HAMOTOR_ISA", name)
        with pytest.raises(UsageError, match=message):
            build.flags_for("x86_64")
    with pytest.raises(UsageError, match="is for x86-64"):
        build.flags_for("aarch64")


def test_cmake_and_scenes_mean_the_same_instruction_sets() -> None:
    text = (build.REPOSITORY / "cmake" / "HamotorDispatch.cmake").read_text(encoding="utf-8")
    sets: dict[str, tuple[str, ...]] = {}
    for name in build.INSTRUCTION_SETS:
        found = re.search(rf"set\(HAMOTOR_ISA_{name}_OPTIONS([^)]*)\)", text)
        assert found
        words = found[1].replace("${HAMOTOR_ISA_avx2_OPTIONS}", " ".join(sets.get("avx2", ())))
        sets[name] = tuple(word for word in words.split() if word != '""')
        features = re.search(rf"set\(HAMOTOR_ISA_{name}_FEATURES([^)]*)\)", text)
        assert features
        asked = features[1].replace("${HAMOTOR_ISA_avx2_FEATURES}", "avx2 fma bmi bmi2").split()
        assert [f"-m{word}" for word in asked if word != '""'] == list(sets[name])
    assert sets == build.INSTRUCTION_SETS


def test_the_cache_can_be_moved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HAMOTOR_CACHE", str(tmp_path / "elsewhere"))
    assert compile_scene(SMALL, includes=()).library.is_relative_to(tmp_path / "elsewhere")


def test_the_cache_keeps_the_scenes_used_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "_KEPT_SCENES", 2)
    texts = [SMALL.replace("42", str(number)) for number in range(3)]
    first, second = (compile_scene(text, includes=(), cache=tmp_path) for text in texts[:2])
    os.utime(second.library.parent, (1, 1))
    os.utime(first.library.parent, (0, 0))
    assert compile_scene(texts[0], includes=(), cache=tmp_path).cached
    third = compile_scene(texts[2], includes=(), cache=tmp_path)
    assert [scene.library.exists() for scene in (first, second, third)] == [True, False, True]
