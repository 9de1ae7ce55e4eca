"""Small CMake projects of users: written, configured and built in a folder."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUNDLED = f'add_subdirectory("{ROOT}" hamotor)'


def attempt(*command: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command; its output and its errors are one text."""
    return subprocess.run(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def run(*command: str | Path) -> str:
    """What a command prints, which must succeed."""
    answer = attempt(*command)
    assert answer.returncode == 0, answer.stdout
    return answer.stdout


def project(folder: Path, call: str, find: str = BUNDLED) -> None:
    """Write a project that finds Hamotor and makes a call."""
    folder.mkdir(exist_ok=True)
    (folder / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\n"
        "project(user LANGUAGES CXX)\n"
        "enable_testing()\n"
        f"{find}\n"
        f"{call}\n",
        encoding="utf-8",
    )


def configure(
    folder: Path, *options: str, generator: str = "Ninja"
) -> subprocess.CompletedProcess[str]:
    """Configure the project of a folder in its folder build."""
    return attempt("cmake", "-G", generator, *options, "-S", folder, "-B", folder / "build")


def build(folder: Path, *options: str, generator: str = "Ninja") -> Path:
    """Configure and build the project of a folder; returns the build folder."""
    configured = configure(folder, *options, generator=generator)
    assert configured.returncode == 0, configured.stdout
    run("cmake", "--build", folder / "build")
    return folder / "build"
