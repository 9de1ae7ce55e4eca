"""The launcher: what it installs, what it says where it may not, and that it recovers.

Each test runs the real launcher in a small clone of its own, with a PATH that holds only what
the test puts there.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHON = os.path.realpath(sys.executable)
ALWAYS_THERE = (
    *("env", "grep", "id", "ln", "mkdir", "mv", "readlink", "rm", "sh", "sha256sum", "tail"),
    "flock",
)
FOR_TESTS = ("cmake", "ninja", "g++", "clang++")
MAIN = """
import json, os, sys
print(json.dumps({"arguments": sys.argv[1:], "folder": os.getcwd(), "prefix": sys.prefix}))
"""
UNREACHABLE = "http://127.0.0.1:9"


@dataclass(frozen=True)
class Clone:
    """A clone with the real launcher, an empty lock and a package that prints how it was called."""

    root: Path
    tools: Path

    def call(
        self,
        *arguments: str,
        via: Path | None = None,
        folder: Path | None = None,
        **environment: str,
    ) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [via or self.root / "hamotor", *arguments],
            cwd=folder or self.root,
            env=self.environment() | environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )

    def environment(self) -> dict[str, str]:
        return {"PATH": str(self.tools), "HAMOTOR_PYTHON": PYTHON, "HOME": str(self.root)}

    def add_tool(self, name: str, script: str | None = None) -> None:
        """Put the real tool on the PATH, or a shell script in its place."""
        path = self.tools / name
        path.unlink(missing_ok=True)
        if script is None:
            real = shutil.which(name)
            assert real, f"{name} is needed by this test"
            path.symlink_to(real)
        else:
            path.write_text(f"#!/bin/sh\n{script}\n")
            path.chmod(0o755)

    @property
    def stamp(self) -> Path:
        return self.root / ".hamotor" / "venv" / "stamp"


def make_clone(root: Path) -> Clone:
    tools = root.parent / f"{root.name}-tools"
    tools.mkdir(parents=True)
    package = root / "generator" / "hamotor"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(MAIN)
    (root / "requirements.lock").write_text("# nothing\n")
    shutil.copy(ROOT / "hamotor", root / "hamotor")
    clone = Clone(root, tools)
    for name in ALWAYS_THERE:
        clone.add_tool(name)
    return clone


@pytest.fixture
def fresh(tmp_path: Path) -> Clone:
    """A clone on which nothing was called yet."""
    return make_clone(tmp_path / "clone")


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Clone:
    clone = make_clone(tmp_path_factory.mktemp("prepared") / "clone")
    answer = clone.call("list")
    assert answer.returncode == 0, answer.stderr
    return clone


@pytest.fixture
def ready(prepared: Clone, tmp_path: Path) -> Clone:
    """A clone that was set up, and then moved into a folder with a space in its name."""
    root = tmp_path / "a folder" / "clone"
    shutil.copytree(prepared.root, root, symlinks=True)
    tools = tmp_path / "tools"
    shutil.copytree(prepared.tools, tools, symlinks=True)
    return Clone(root, tools)


def test_a_ready_clone_only_hands_over(ready: Clone, tmp_path: Path) -> None:
    for name in set(ALWAYS_THERE) - {"sha256sum"}:
        (ready.tools / name).unlink()
    answer = ready.call("show", "two words", "*", "", folder=tmp_path)
    assert (answer.returncode, answer.stderr) == (0, "")
    said = json.loads(answer.stdout)
    assert said["arguments"] == ["show", "two words", "*", ""]
    assert said["folder"] == str(tmp_path)
    assert said["prefix"] == str(ready.root / ".hamotor" / "venv")


def test_a_link_to_the_launcher_is_followed(ready: Clone, tmp_path: Path) -> None:
    link = tmp_path / "link to hamotor"
    link.symlink_to(ready.root / "hamotor")
    answer = ready.call("list", via=link, folder=tmp_path)
    assert (answer.returncode, answer.stderr) == (0, "")


def test_a_file_in_the_current_folder_is_not_imported(ready: Clone, tmp_path: Path) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit('imported')\n")
    (tmp_path / "hamotor").mkdir()
    (tmp_path / "hamotor" / "__main__.py").write_text("raise SystemExit('imported')\n")
    answer = ready.call("list", folder=tmp_path, PYTHONPATH=str(tmp_path))
    assert (answer.returncode, answer.stderr) == (0, "")


def test_the_exit_code_is_that_of_the_command(ready: Clone) -> None:
    (ready.root / "generator" / "hamotor" / "__main__.py").write_text("raise SystemExit(3)\n")
    assert ready.call("list").returncode == 3


def lose_the_stamp(clone: Clone) -> None:
    clone.stamp.unlink()
    shutil.rmtree(clone.root / ".hamotor" / "venv" / "lib")


def change_the_lock(clone: Clone) -> None:
    (clone.root / "requirements.lock").write_text("# nothing else\n")


def remove_the_interpreter(clone: Clone) -> None:
    python = clone.root / ".hamotor" / "venv" / "bin" / "python"
    python.unlink()
    python.symlink_to("/nowhere/python3.11")


@pytest.mark.parametrize("damage", [lose_the_stamp, change_the_lock, remove_the_interpreter])
def test_a_stale_or_unfinished_environment_is_built_anew(
    ready: Clone, damage: Callable[[Clone], None]
) -> None:
    damage(ready)
    answer = ready.call("list")
    assert answer.returncode == 0, answer.stderr
    assert len(answer.stderr.splitlines()) == 1
    assert "installing the pinned Python packages" in answer.stderr
    assert ready.call("list").stderr == ""


def test_a_setup_killed_midway_recovers_at_the_next_call(fresh: Clone) -> None:
    killer = fresh.tools / "killer"
    fresh.add_tool(
        killer.name,
        f'case $2 in *realpath*) echo "{killer}"; exit ;; esac\n'
        'if [ "$1" = -m ]; then mkdir -p "$3/lib"; kill -KILL $PPID; fi',
    )
    assert fresh.call("list", HAMOTOR_PYTHON=str(killer)).returncode == -9
    assert (fresh.root / ".hamotor" / "venv" / "lib").exists()
    assert not fresh.stamp.exists()
    answer = fresh.call("list")
    assert answer.returncode == 0, answer.stderr


def test_two_first_calls_set_up_once(fresh: Clone) -> None:
    calls = [
        subprocess.Popen(
            [fresh.root / "hamotor", "list"],
            env=fresh.environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    said = [call.communicate()[1] for call in calls]
    assert [call.returncode for call in calls] == [0, 0], said
    assert "".join(said).count("installing the pinned Python packages") == 1


def test_a_missing_compiler_is_named_with_the_line_that_installs_it(ready: Clone) -> None:
    ready.add_tool("apt-get", "exit 100")
    answer = ready.call("run", "tumble", HAMOTOR_NO_APT="1")
    assert answer.returncode == 4
    assert answer.stderr.splitlines()[-1].endswith("apt-get install -y g++")


def test_missing_tools_are_named_all_at_once(ready: Clone) -> None:
    ready.add_tool("apt-get", "exit 100")
    answer = ready.call("test", HAMOTOR_NO_APT="1")
    assert answer.returncode == 4
    packages = answer.stderr.splitlines()[-1].split("install -y ")[1].split()
    assert {"g++", "clang", "cmake", "ninja-build"} <= set(packages)


def test_fast_tests_need_no_clang(ready: Clone) -> None:
    for name in set(FOR_TESTS) - {"clang++"}:
        ready.add_tool(name)
    answer = ready.call("test", "--fast", HAMOTOR_NO_APT="1")
    assert (answer.returncode, answer.stderr) == (0, "")


def test_any_one_compiler_will_do_for_scenes(ready: Clone) -> None:
    ready.add_tool("clang++", "exit 0")
    assert ready.call("run", "tumble").returncode == 0
    (ready.tools / "clang++").unlink()
    ready.add_tool("my-compiler", "exit 0")
    assert ready.call("run", "tumble", CXX="my-compiler -v").returncode == 0


def test_a_cxx_that_is_no_command_is_an_error(ready: Clone) -> None:
    answer = ready.call("run", "tumble", CXX="g+++")
    assert answer.returncode == 4
    assert "CXX=g+++: no such command" in answer.stderr


def test_without_apt_get_the_packages_are_named(ready: Clone) -> None:
    answer = ready.call("run", "tumble")
    assert answer.returncode == 4
    assert "missing: g++ (Debian's names)" in answer.stderr


def test_root_installs_what_is_missing(ready: Clone) -> None:
    log = ready.root / "apt.log"
    ready.add_tool("id", "echo 0")
    ready.add_tool(
        "apt-get",
        f'echo "$@" >>"{log}"; for last; do :; done\n'
        f'[ "$last" = update ] || ln -s /bin/sh "{ready.tools}/g++"',
    )
    answer = ready.call("run", "tumble")
    assert answer.returncode == 0, answer.stderr
    assert answer.stderr == "hamotor: installing system packages: g++\n"
    asked = log.read_text().splitlines()
    assert len(asked) == 2
    assert asked[1].endswith("install --no-install-recommends g++")
    assert ready.call("run", "tumble").stderr == ""


def test_sudo_without_a_password_installs_what_is_missing(ready: Clone) -> None:
    ready.add_tool("id", "echo 1000")
    ready.add_tool("sudo", 'shift; [ "$1" = true ] || exec "$@"')
    ready.add_tool("apt-get", f'ln -sf /bin/sh "{ready.tools}/g++"')
    answer = ready.call("run", "tumble")
    assert answer.returncode == 0, answer.stderr


@pytest.mark.parametrize("sudo", [None, "exit 1"])
def test_who_may_not_install_is_told_the_line(ready: Clone, sudo: str | None) -> None:
    ready.add_tool("id", "echo 1000")
    ready.add_tool("apt-get", "exit 100")
    if sudo:
        ready.add_tool("sudo", sudo)
    answer = ready.call("run", "tumble")
    assert answer.returncode == 4
    line = answer.stderr.splitlines()[-1].strip()
    assert line == "sudo apt-get update && sudo apt-get install -y g++"


def bench_needs(clone: Clone) -> list[str]:
    """What `bench` needs and this machine lacks: headers are looked for where they always are."""
    for name in FOR_TESTS[:3]:
        clone.add_tool(name)
    answer = clone.call("bench", HAMOTOR_NO_APT="1")
    return answer.stderr.splitlines()[-1].split("install -y ")[1:] if answer.returncode else []


def test_peers_of_benchmarks_come_along_where_they_may_be_installed(ready: Clone) -> None:
    needed = bench_needs(ready)
    log = ready.root / "apt.log"
    ready.add_tool("id", "echo 0")
    ready.add_tool("apt-get", f'echo "$@" >>"{log}"; exit 100')
    answer = ready.call("bench", "precision", "--with-peers")
    assert "clang" in log.read_text().splitlines()[-1].split()
    assert answer.returncode == (4 if needed else 0)
    assert needed or "could not install them, and goes without" in answer.stderr
    log.unlink()
    ready.call("bench", "precision", "--with-peers", HAMOTOR_NO_APT="1")
    assert not log.exists()
    if not needed:
        assert ready.call("bench").stderr == ""


def test_system_packages_without_a_network_are_a_clear_error(ready: Clone) -> None:
    ready.add_tool("id", "echo 0")
    ready.add_tool("apt-get", "echo 'E: Failed to fetch g++: Could not resolve the host'; exit 100")
    answer = ready.call("run", "tumble")
    assert answer.returncode == 4
    assert "could not install the system packages (no network?)" in answer.stderr
    assert "apt-get install -y g++" in answer.stderr


def test_python_packages_without_a_network_are_a_clear_error(ready: Clone) -> None:
    (ready.root / "requirements.lock").write_text(f"hamotor-absent==1.0 --hash=sha256:{64 * '0'}\n")
    answer = ready.call("list", HTTPS_PROXY=UNREACHABLE, HTTP_PROXY=UNREACHABLE, PIP_RETRIES="1")
    assert answer.returncode == 4, answer.stderr
    assert "no network? The first use needs one, later uses do not" in answer.stderr
    assert not ready.stamp.exists()


@pytest.mark.parametrize("named", [True, False])
def test_an_old_python_is_a_clear_error(fresh: Clone, named: bool) -> None:
    fresh.add_tool("python3", '[ "$1" = -V ] && echo "Python 3.10.12"; exit 1')
    answer = fresh.call("list", HAMOTOR_PYTHON="python3" if named else "")
    assert answer.returncode == 4
    assert "needs Python 3.11 or newer" in answer.stderr
    assert named or "3.10.12" in answer.stderr


def test_a_python_without_venv_asks_for_the_package(fresh: Clone) -> None:
    fresh.add_tool("apt-get", "exit 100")
    fresh.add_tool(
        "python3.12",
        f'case $2 in *realpath*) echo "{fresh.tools}/python3.12" ;; *ensurepip*) exit 1 ;; esac',
    )
    answer = fresh.call("list", HAMOTOR_PYTHON="python3.12", HAMOTOR_NO_APT="1")
    assert answer.returncode == 4
    assert answer.stderr.splitlines()[-1].endswith("apt-get install -y python3.12-venv")


def test_a_bare_machine_is_told_everything_in_one_line(fresh: Clone) -> None:
    fresh.add_tool("apt-get", "exit 100")
    answer = fresh.call("run", "tumble", HAMOTOR_PYTHON="", HAMOTOR_NO_APT="1")
    assert answer.returncode == 4
    assert answer.stderr.splitlines()[-1].endswith("install -y g++ python3 python3-venv")


def test_a_clone_that_cannot_be_written_is_a_clear_error(fresh: Clone) -> None:
    (fresh.root / ".hamotor").touch()
    answer = fresh.call("list")
    assert answer.returncode == 4
    assert "must be writable on first use" in answer.stderr
