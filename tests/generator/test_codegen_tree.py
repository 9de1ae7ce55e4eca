"""Generated files: what is committed is what is generated anywhere; differences are named."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hamotor.cli import main
from hamotor.codegen import generate, read_algebra, source_files
from hamotor.codegen.compiler import SourceFile, compile_algebra
from hamotor.codegen.spec import bundled_path
from hamotor.codegen.tree import (
    GENERATED,
    ROOT,
    Difference,
    clang_format,
    differences,
    formatted,
    write,
)


def test_committed_files_are_what_the_generator_writes() -> None:
    assert generate(check=True) == []


def test_every_committed_file_is_generated_by_some_algebra() -> None:
    listed = {p.relative_to(GENERATED).parts[:2] for p in GENERATED.rglob("*") if p.is_file()}
    assert listed
    for room, algebra in listed:
        assert room == "hamotor"
        assert bundled_path(algebra).is_file()


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    shutil.copytree(GENERATED / "hamotor" / "pga2", tmp_path / "hamotor" / "pga2")
    return tmp_path


def test_check_names_the_stale_the_missing_and_the_orphaned_file(copy: Path) -> None:
    folder = copy / "hamotor" / "pga2"
    assert generate(["pga2"], check=True, out=copy) == []
    with (folder / "se2.hpp").open("a", encoding="utf-8") as stream:
        stream.write("// edited by hand\n")
    (folder / "kernels.hpp").unlink()
    (folder / "leftover.hpp").write_text("", "utf-8")
    found = [
        Difference("missing", "hamotor/pga2/kernels.hpp"),
        Difference("orphaned", "hamotor/pga2/leftover.hpp"),
        Difference("stale", "hamotor/pga2/se2.hpp"),
    ]
    assert generate(["pga2"], check=True, out=copy) == found
    assert (folder / "leftover.hpp").exists(), "a check writes nothing"
    assert generate(["pga2"], out=copy) == found
    assert generate(["pga2"], check=True, out=copy) == []
    assert not (folder / "leftover.hpp").exists()


def test_other_algebras_files_are_no_orphans(copy: Path) -> None:
    other = copy / "hamotor" / "pga3" / "kernels.hpp"
    other.parent.mkdir()
    other.write_text("mine", "utf-8")
    assert generate(["pga2"], check=True, out=copy) == []
    assert generate(["pga2"], out=copy) == []
    assert other.read_text("utf-8") == "mine"


def test_check_on_the_command_line_exits_with_1_and_the_command_that_fixes_it(
    copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (copy / "hamotor" / "pga2" / "kernels.hpp").unlink()
    assert main(["generate", "pga2", "--check", "--out", str(copy)]) == 1
    said = capsys.readouterr().err
    assert "missing" in said
    assert "hamotor/pga2/kernels.hpp" in said
    assert f"./hamotor generate pga2 --out {copy}" in said
    assert main(["generate", "pga2", "--out", str(copy)]) == 0
    assert main(["generate", "pga2", "--check", "--out", str(copy)]) == 0


def test_writing_touches_only_what_changed(tmp_path: Path) -> None:
    files = [SourceFile("a/one.hpp", "1\n"), SourceFile("a/two.hpp", "2\n")]
    assert [d.kind for d in write(files, tmp_path, ["a"])] == ["missing", "missing"]
    before = (tmp_path / "a/one.hpp").stat().st_mtime_ns
    files[1] = SourceFile("a/two.hpp", "3\n")
    assert write(files, tmp_path, ["a"]) == [Difference("stale", "a/two.hpp")]
    assert (tmp_path / "a/one.hpp").stat().st_mtime_ns == before
    assert (tmp_path / "a/two.hpp").read_text("utf-8") == "3\n"
    assert differences(files, tmp_path, ["a"]) == []
    assert not list(tmp_path.rglob("*.tmp"))


def test_a_file_formatted_in_pieces_is_the_file_formatted_at_once() -> None:
    files = compile_algebra(read_algebra(bundled_path("pga3")))
    (kernels,) = [file for file in files if file.path == "hamotor/pga3/kernels.hpp"]
    long = SourceFile(kernels.path, kernels.text * 2)
    assert len(long.text) > 2 * 40_000
    (found,) = formatted([long])
    assert found.text == clang_format(long.text)


@pytest.mark.long
def test_products_of_six_dimensions_take_a_processor_less_than_five_seconds(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hamotor", "generate", "--signature", "6,0,0"]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "generator")}
    before = os.times()
    subprocess.run(
        [*command, "--name", "six", "--out", str(tmp_path)],
        env=environment,
        check=True,
        capture_output=True,
    )
    after = os.times()
    busy = (
        after.children_user + after.children_system - before.children_user - before.children_system
    )
    assert busy < 5.0


@pytest.mark.slow
def test_output_does_not_depend_on_the_hash_seed() -> None:
    code = (
        "import hashlib\n"
        "from hamotor.codegen.compiler import compile_algebra\n"
        "from hamotor.codegen.spec import bundled_algebras, bundled_path, read_algebra\n"
        "for name in bundled_algebras():\n"
        "    for file in compile_algebra(read_algebra(bundled_path(name))):\n"
        "        print(file.path, hashlib.sha256(file.text.encode()).hexdigest())\n"
    )
    printed = set()
    for seed in ("0", "1", "31337"):
        environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT / "generator")}
        run = subprocess.run(
            [sys.executable, "-c", code],
            env=environment,
            check=True,
            capture_output=True,
            text=True,
        )
        printed.add(run.stdout)
    assert len(printed) == 1
    assert printed.pop().count("\n") > 10


def test_headers_carry_command_spec_and_digest_but_no_path_or_date() -> None:
    spec = read_algebra(bundled_path("pga2"))
    digest = hashlib.sha256(bundled_path("pga2").read_bytes()).hexdigest()[:8]
    for file in source_files([spec]):
        if file.path.endswith(".hpp"):
            head = file.text[:600]
            assert head.startswith("// Generated by `hamotor generate pga2`.  Do not edit")
            assert f"Spec sha256:{digest}" in head
            assert "#pragma once" in head
        assert str(ROOT) not in file.text
        assert not any(f"20{year}" in file.text[:600].split("sha256")[0] for year in range(24, 40))
