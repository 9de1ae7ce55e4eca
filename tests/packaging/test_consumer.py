"""An application links Hamotor with CMake in both ways, on a machine without Python and Eigen."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CONSUMER = ROOT / "tests" / "consumer"
TOOLS = ("cmake", "ninja", "g++", "as", "ld", "ar", "ranlib", "sh")

pytestmark = pytest.mark.slow


@pytest.fixture
def tools(tmp_path: Path) -> Path:
    """A PATH with a compiler and CMake on it and nothing else, so no Python."""
    folder = tmp_path / "tools"
    folder.mkdir()
    for name in TOOLS:
        real = shutil.which(name)
        assert real, f"{name} is needed by this test"
        (folder / name).symlink_to(real)
    assert shutil.which("python3", path=str(folder)) is None
    return folder


def run(tools: Path, *command: str | Path) -> str:
    kept = {name: os.environ[name] for name in ("HOME", "TMPDIR") if name in os.environ}
    answer = subprocess.run(
        command,
        env=kept | {"PATH": str(tools)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert answer.returncode == 0, answer.stdout
    return answer.stdout


def configure(tools: Path, source: Path, build: Path, *options: str) -> None:
    compiler = f"-DCMAKE_CXX_COMPILER={tools / 'g++'}"
    run(tools, "cmake", "-G", "Ninja", compiler, *options, "-S", source, "-B", build)


def step_a_body(tools: Path, project: str, build: Path, *options: str) -> str:
    configure(tools, CONSUMER / project, build, *options)
    run(tools, "cmake", "--build", build)
    return run(tools, build / "consumer")


def test_an_installed_and_a_bundled_hamotor_step_the_same_body(tools: Path, tmp_path: Path) -> None:
    prefix = tmp_path / "prefix"
    no_eigen = "-DCMAKE_DISABLE_FIND_PACKAGE_Eigen3=ON"
    configure(tools, ROOT, tmp_path / "own", "-DHAMOTOR_BUILD_TESTS=OFF", no_eigen)
    run(tools, "cmake", "--install", tmp_path / "own", "--prefix", prefix)
    installed = step_a_body(
        tools, "find_package", tmp_path / "installed", f"-DCMAKE_PREFIX_PATH={prefix}", no_eigen
    )
    release = "-DCMAKE_BUILD_TYPE=Release"
    bundled = step_a_body(tools, "add_subdirectory", tmp_path / "bundled", no_eigen, release)
    assert installed == bundled
    found = re.search(r"relative energy error (\S+)", bundled)
    assert found
    assert abs(float(found[1])) < 1e-5
    cloud = run(tools, tmp_path / "bundled" / "cloud")
    assert cloud == "20000 of 20000, relative energy error 6.5e-13, mean of e3 up 0.0053\n"


def test_the_consumer_is_short() -> None:
    lines = (CONSUMER / "main.cpp").read_text(encoding="utf-8").splitlines()
    assert len(lines) < 30


def test_an_older_hamotor_is_refused(tools: Path, tmp_path: Path) -> None:
    prefix = tmp_path / "prefix"
    configure(tools, ROOT, tmp_path / "own", "-DHAMOTOR_BUILD_TESTS=OFF")
    run(tools, "cmake", "--install", tmp_path / "own", "--prefix", prefix)
    project = tmp_path / "wants_more"
    project.mkdir()
    (project / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\n"
        "project(wants_more LANGUAGES CXX)\n"
        "find_package(hamotor 99.0)\n"
        'if(hamotor_FOUND)\n  message(FATAL_ERROR "took an older one")\nendif()\n'
    )
    configure(tools, project, tmp_path / "refused", f"-DCMAKE_PREFIX_PATH={prefix}")
