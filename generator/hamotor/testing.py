"""What `hamotor test` runs: lint, format, types, stale files, the C++ and the Python tests."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hamotor.errors import ToolError

ROOT: Final = Path(__file__).resolve().parents[2]
FORMATTED_CPP: Final = ("runtime", "tests", "generated")

Command = tuple[str, ...]


@dataclass(frozen=True)
class Check:
    """One line of the closing table: it passes when each of its commands exits with 0."""

    name: str
    commands: tuple[Command, ...]


@dataclass(frozen=True)
class Outcome:
    """What became of one check; `failed` is the command that failed, None where none did."""

    check: Check
    failed: Command | None
    seconds: float


INSTALL_PEERS: Final = Check(
    "install peers", ((sys.executable, "-P", "tests/peers/environment.py"),)
)


def checks(fast: bool, long: bool = False) -> list[Check]:
    """The checks in the order they run.

    fast: without clang and the tests marked slow.  long: with the tests marked long.
    """
    listed = [
        Check("ruff check", (_module("ruff", "check", "."),)),
        Check("ruff format", (_module("ruff", "format", "--check", "."),)),
        Check("mypy", (_module("mypy"),)),
        Check("clang-format", (_clang_format(),)),
        Check("generate --check", (_module("hamotor", "generate", "--check"),)),
        _cpp_tests("gcc"),
    ]
    if not fast:
        listed.append(_cpp_tests("clang"))
    left_out = "not slow and not long" if fast else "" if long else "not long"
    chosen = ("-m", left_out) if left_out else ()
    listed.append(Check("pytest", (_module("pytest", "--numprocesses=auto", *chosen),)))
    return listed


def run_tests(fast: bool, with_peers: bool = False, long: bool = False) -> int:
    """Run every check, whatever the ones before it did; 0 if all passed, 1 if any failed.

    fast, long: less or more than what continuous integration runs.
    with_peers: first install the libraries that kernels are compared with; tests that find none of
    them are skipped, and say so.
    Raises ToolError before anything runs if a tool is missing.
    """
    chosen = [*([INSTALL_PEERS] if with_peers else []), *checks(fast, long)]
    _require_tools(chosen)
    _forget_moved_builds()
    outcomes = [_run(check) for check in chosen]
    print(summary(outcomes), flush=True)
    return int(any(outcome.failed for outcome in outcomes))


def summary(outcomes: list[Outcome]) -> str:
    """The closing table: a line a check with its wall time, and the command of each that failed."""
    width = max(len(outcome.check.name) for outcome in outcomes)
    lines = [_heading("hamotor test")]
    for outcome in outcomes:
        verdict = "FAILED" if outcome.failed else "passed"
        lines.append(f"{outcome.check.name:<{width}}  {verdict}  {outcome.seconds:7.1f} s")
        if outcome.failed:
            lines.append(f"{'':<{width}}  {_readable(outcome.failed)}")
    failures = sum(outcome.failed is not None for outcome in outcomes)
    seconds = sum(outcome.seconds for outcome in outcomes)
    verdict = f"{failures} of {len(outcomes)} checks failed" if failures else "all checks passed"
    lines.append(f"{verdict} in {seconds:.0f} s")
    return "\n".join(lines)


def _run(check: Check) -> Outcome:
    print(_heading(check.name), flush=True)
    started = time.monotonic()
    failed = next((command for command in check.commands if not _succeeds(command)), None)
    return Outcome(check, failed, time.monotonic() - started)


def _succeeds(command: Command) -> bool:
    return subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, check=False).returncode == 0


def _heading(title: str) -> str:
    return f"\n-- {title} ".ljust(80, "-")


def _module(name: str, *arguments: str) -> Command:
    return (sys.executable, "-P", "-m", name, *arguments)


def _clang_format() -> Command:
    """The pinned clang-format; run through Python, so that it survives a move of the clone."""
    start = "import clang_format; clang_format.clang_format()"
    return (sys.executable, "-P", "-c", start, "--dry-run", "-Werror", *_cpp_sources())


def _cpp_sources() -> Iterator[str]:
    for folder in FORMATTED_CPP:
        for path in sorted((ROOT / folder).rglob("*.[ch]pp")):
            yield str(path.relative_to(ROOT))


def _cpp_tests(preset: str) -> Check:
    """Configure, build and run the C++ tests as CMakePresets.json says."""
    return Check(
        f"C++ tests, {preset}",
        (
            ("cmake", "--preset", preset),
            ("cmake", "--build", "--preset", preset),
            ("ctest", "--preset", preset),
        ),
    )


def _require_tools(chosen: list[Check]) -> None:
    tools = {command[0] for check in chosen for command in check.commands}
    if missing := sorted(tool for tool in tools if shutil.which(tool) is None):
        raise ToolError(
            f"hamotor test: no such command: {', '.join(missing)}. "
            "`./hamotor test` installs what it needs, or names the line that does"
        )


def _forget_moved_builds() -> None:
    """Remove the build folders that came along when the clone was moved: CMake refuses them."""
    for cache in (ROOT / ".hamotor" / "build").glob("*/CMakeCache.txt"):
        if f"CMAKE_HOME_DIRECTORY:INTERNAL={ROOT}\n" not in cache.read_text(encoding="utf-8"):
            shutil.rmtree(cache.parent)


def _readable(command: Command) -> str:
    """The command as one would type it in the clone, without the names of a hundred files."""
    words = [word.removeprefix(f"{ROOT}/") for word in command]
    return shlex.join(words if len(words) <= 10 else words[:7]) + " ..." * (len(words) > 10)
