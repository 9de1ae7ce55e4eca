"""Where the peers are installed: an environment of their own, apart from what Hamotor needs.

`python -m tests.peers.environment` installs them; `./hamotor test --with-peers` does so first.
Public solvers to measure beside have another one, `python -m tests.peers.environment solvers`, as
have those for ensembles (`ensembles`) and dask (`dask`), which sees the packages of ours as well.
"""

from __future__ import annotations

import fcntl
import hashlib
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
FOLDER = ROOT / ".hamotor" / "peers"
INSTALL = "./hamotor test --with-peers"

PYTHON = FOLDER / "python" / "bin" / "python"
NODE_MODULES = FOLDER / "node" / "node_modules"
_PYTHON_PINS = (HERE / "requirements.txt",)
_SOLVER_PINS = (ROOT / "tests" / "bench" / "precision" / "requirements.txt",)
_ENSEMBLE_PINS = (ROOT / "tests" / "bench" / "ensemble_requirements.txt",)
_DASK_PINS = (ROOT / "requirements-dask.lock",)
DASK_PYTHON = FOLDER / "dask" / "bin" / "python"
INSTALL_DASK = ".hamotor/venv/bin/python -m tests.peers.environment dask"
_NODE_PINS = (HERE / "package.json", HERE / "package-lock.json")


def has_python_peers() -> bool:
    """Whether clifford, kingdon and galgebra are installed, as pinned."""
    return _stamp("python") == _digest(_PYTHON_PINS)


def has_node_peers() -> bool:
    """Whether ganja.js is installed, as pinned, and there is a node to run it."""
    return shutil.which("node") is not None and _stamp("node") == _digest(_NODE_PINS)


def install() -> list[str]:
    """Install what is missing; returns why what is still missing could not be."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with (FOLDER / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return [
            *([] if has_python_peers() else _install_python("python", _PYTHON_PINS)),
            *_install_node(),
        ]


def install_solvers() -> list[str]:
    """The same for the public solvers that `./hamotor bench precision` measures beside."""
    return _install_part("solvers", _SOLVER_PINS)


def install_ensembles() -> list[str]:
    """The same for what `./hamotor bench ensemble` measures beside."""
    return _install_part("ensembles", _ENSEMBLE_PINS)


def _install_part(part: str, pins: tuple[Path, ...]) -> list[str]:
    FOLDER.mkdir(parents=True, exist_ok=True)
    with (FOLDER / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return [] if _stamp(part) == _digest(pins) else _install_python(part, pins)


def has_dask() -> bool:
    """Whether dask is installed, as pinned."""
    return _stamp("dask") == _digest(_DASK_PINS)


def install_dask() -> list[str]:
    """The same for dask, in an environment that has all that ours has."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with (FOLDER / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if has_dask():
            return []
        problems = _install_python("dask", _DASK_PINS)
        for packages in (FOLDER / "dask" / "lib").glob("python3*/site-packages"):
            (packages / "hamotor.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
        return problems


def _install_python(part: str, pins: tuple[Path, ...]) -> list[str]:
    folder = FOLDER / part
    shutil.rmtree(folder, ignore_errors=True)
    python = str(folder / "bin" / "python")
    pip = (python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet")
    words = pins[0].read_text(encoding="utf-8").split()
    names = ", ".join(word.partition("==")[0] for word in words if "==" in word)
    return _run_all(
        names,
        (
            (sys.executable, "-m", "venv", str(folder)),
            (*pip, "--only-binary=:all:", "--requirement", str(pins[0])),
        ),
        folder,
        pins,
    )


def _install_node() -> list[str]:
    if has_node_peers():
        return []
    if missing := [tool for tool in ("node", "npm") if shutil.which(tool) is None]:
        return [f"ganja.js: no such command: {', '.join(missing)}"]
    folder = FOLDER / "node"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for path in _NODE_PINS:
        shutil.copy(path, folder)
    install = ("npm", "ci", "--prefix", str(folder), "--ignore-scripts", "--no-audit", "--no-fund")
    return _run_all("ganja.js", (install,), folder, _NODE_PINS)


def _run_all(
    peers: str, commands: Iterable[tuple[str, ...]], folder: Path, pins: tuple[Path, ...]
) -> list[str]:
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            last = (done.stderr or done.stdout).strip().splitlines()[-1:] or ["no output"]
            return [f"{peers}: {' '.join(command)}: {last[0]}"]
    (folder / "stamp").write_text(_digest(pins), encoding="utf-8")
    return []


def _digest(paths: Iterable[Path]) -> str:
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in paths)).hexdigest()


def _stamp(part: str) -> str:
    stamp = FOLDER / part / "stamp"
    return stamp.read_text(encoding="utf-8") if stamp.is_file() else ""


if __name__ == "__main__":
    others = {"solvers": install_solvers, "ensembles": install_ensembles, "dask": install_dask}
    asked = others.get(" ".join(sys.argv[1:]), install)
    if problems := asked():
        sys.exit("\n".join(problems))
