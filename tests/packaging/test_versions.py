"""One version everywhere, and every Python package pinned."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import hamotor

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
PINS = dict(re.findall(r"^([a-z0-9-]+)==(\S+)", LOCK, re.MULTILINE))


def test_the_package_has_the_version_of_the_project() -> None:
    assert hamotor.__version__ == PROJECT["version"]


def test_every_direct_requirement_is_pinned() -> None:
    required = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["dev"]]
    assert {re.split("[<>=]", line)[0] for line in required} <= set(PINS)


def test_every_pin_has_a_hash() -> None:
    for requirement in re.split(r"\n(?=\S)", LOCK.strip()):
        assert requirement.startswith("#") or "--hash=sha256:" in requirement


def test_the_environment_holds_the_pinned_versions() -> None:
    for name in ("numpy", "sympy", "jinja2", "pyarrow", "matplotlib", "clang-format", "ruff"):
        assert version(name) == PINS[name]


def test_the_environment_is_consistent() -> None:
    answer = subprocess.run(
        [sys.executable, "-m", "pip", "check"], capture_output=True, text=True, check=False
    )
    assert answer.returncode == 0, answer.stdout
