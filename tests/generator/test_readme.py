"""Everything that the README shows is run, and shows what it says."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import hamotor

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"-?\d[\d,]*\.?\d*(?:e[+-]?\d+)?")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(ROOT / "generator")}


def commands() -> list[tuple[str, str]]:
    found = []
    for block in blocks("console"):
        first, _, output = block.partition("\n")
        assert first.startswith("$ ./hamotor "), first
        found.append((first.removeprefix("$ ./hamotor "), output))
    return found


def without_measurements(text: str) -> list[str]:
    """The words of an output: numbers, times, processors and the cache differ between machines."""
    lines = [line for line in text.splitlines() if "compiled" not in line]
    words = [re.sub(NUMBER, "#", line) for line in lines]
    words = [re.sub(r"# threads?, # lanes?, \w+", "# threads, # lanes", line) for line in words]
    return [" ".join(re.sub(r"# (ns|µs|ms|s),", "# s,", line).split()) for line in words]


@pytest.mark.parametrize(("command", "output"), commands(), ids=[c for c, _ in commands()])
def test_readme_command_prints_what_the_readme_shows(
    command: str, output: str, tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "hamotor", *shlex.split(command)],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    if command.startswith("run "):
        assert without_measurements(done.stdout) == without_measurements(output)
    else:
        assert done.stdout == output


def test_readme_python_runs(tmp_path: Path) -> None:
    assert blocks("python")
    for block in blocks("python"):
        subprocess.run([sys.executable, "-c", block], cwd=tmp_path, env=environment(), check=True)


def test_readme_scenes_run_and_conserve_their_energy(tmp_path: Path) -> None:
    scenes = blocks("toml")
    assert len(scenes) >= 2
    for number, text in enumerate(scenes):
        path = tmp_path / f"scene{number}.toml"
        path.write_text(text, encoding="utf-8")
        conserved = hamotor.load(path).run().report["conserved"]
        (energy,) = (x for name, x in conserved.items() if name.startswith("energy"))
        assert energy["max_relative_error"] < 1e-8


def test_readme_application_is_the_consumer_that_packaging_builds() -> None:
    for name, shown in zip(("cloud", "main"), blocks("cpp"), strict=True):
        assert shown == (ROOT / f"tests/consumer/{name}.cpp").read_text(encoding="utf-8")
    assert len(shown.splitlines()) < 30


def test_readme_cmake_lines_are_the_consumers() -> None:
    for block, folder in zip(blocks("cmake"), ("find_package", "add_subdirectory"), strict=True):
        project = (ROOT / "tests/consumer" / folder / "CMakeLists.txt").read_text(encoding="utf-8")
        assert block in project


def test_readme_links_lead_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
