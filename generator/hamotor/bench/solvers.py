"""Public solvers beside ours: which there are, with which settings, and how each is tuned."""

from __future__ import annotations

import ctypes
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from typing import Any, Final

from hamotor.bench.account import say
from hamotor.bench.contest import (
    GIVEN,
    Contestant,
    Extent,
    Form,
    environment,
    step_ladder,
    tolerances,
)
from hamotor.bench.problems import ROOT
from hamotor.errors import ToolError
from hamotor.run.build import compile_scene, eigen

BENCH: Final = ROOT / "tests" / "bench" / "precision"
PEERS_PYTHON: Final = ROOT / ".hamotor" / "peers" / "solvers" / "bin" / "python"
INSTALL: Final = "./hamotor bench precision --with-peers"
INSTALL_SUNDIALS: Final = "sudo apt-get install libsundials-dev"

TUNED: Final[Mapping[str, str]] = {
    "odeint": "Boost.odeint: states of fixed size in std::array, controlled steppers from a first "
    "step of 0.01 s, absolute tolerance = relative.",
    "Eigen": "Eigen: the classical Runge-Kutta method as one writes it, vectors of fixed size, "
    "the quaternion normalised after each step.",
    "SUNDIALS": "SUNDIALS: serial vectors over the caller's array, absolute tolerance = relative, "
    "a stop time in place of interpolation, up to a million steps. CVODE with Adams' methods of "
    "order 1 to 12 and fixed-point iteration, since nothing is stiff; ARKODE's explicit pairs that "
    "are its defaults of orders 5 and 8.",
    "heyoka": "heyoka: compact_mode off (on for more than 250 operations, where unrolled code "
    "takes many seconds to compile), with and without fast_math; its compilation and the time "
    "of a call that has nothing to do are taken off; its steps × order stand as evaluations.",
    "SciPy": "SciPy: solve_ivp with rates in plain Python floats, which is faster than NumPy for "
    "so few numbers; only the end is asked for.",
    "MuJoCo": "MuJoCo: a ball or free joint, contacts and constraints off, all steps in one call.",
    "Pinocchio": "Pinocchio: aba and integrate, called from Python; it has no integrator of its "
    "own, so that RK4 (slopes in the tangent space at the step's start) and semi-implicit Euler "
    "are written as its users write them.",
    "Bullet": "Bullet: PyBullet, no damping, no sleeping, one call a step (there is none for "
    "several). A fixed point is a constraint, a spring a force before each "
    "step.",
}
"""How it is done that nobody is slower than it need be."""

_DIFFRAX: Final = (
    "left out: made for batches and gradients on accelerators. Its Dopri8 (0.7.2, 64 bits, compiled"
    " by XLA) took 7 to 190 ms for P4 with tolerances of 1e-4 to 1e-12 when tried, much as SciPy"
)
_THEIRS: Final = Form(kernels="", representation="own")
_GIVEN: Final = Form(kernels="", representation=GIVEN)
_ODEINT: Final = ("odeint rkf78", "odeint dopri5", "odeint Bulirsch-Stoer")
_SUNDIALS: Final = ("CVODE Adams", "ARKODE ERK 5", "ARKODE ERK 8")
_INCLUDES: Final = ("/usr/include", "/usr/local/include", "/opt/homebrew/include")
_PYTHON_IS_SLOWER: Final = 20
"""How many times as long as others those may take that are called from Python."""
_TIGHT: Final = 1e-14
SILENT_S: Final = 30.0
"""How long the stopwatch may be at one setting: some hundred times what any takes."""


def install_peers(part: str = "solvers") -> None:
    """Install the public solvers of a benchmark from PyPI into an environment of their own."""
    say("installing the public solvers of PyPI")
    done = subprocess.run(
        (sys.executable, "-m", "tests.peers.environment", part), cwd=ROOT, check=False
    )
    if done.returncode:
        say("hamotor bench: not all peers could be installed; the others are measured")


def stopwatch(*arguments: str) -> subprocess.Popen[str]:
    """The process that times, in the peers' environment where there is one."""
    python = PEERS_PYTHON if PEERS_PYTHON.is_file() else Path(sys.executable)
    return subprocess.Popen(
        (str(python), "-m", "tests.bench.precision.stopwatch", *arguments),
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


At = tuple[int, int]
"""A contestant (or long run) of a job and its setting."""
Answers = dict[At, Any]


def timed(
    job: Mapping[str, Any],
    silent_s: float = SILENT_S,
    worth: Callable[[Answers], Iterable[At]] = lambda answers: answers,
    progress: Callable[[int, int], None] | None = None,
) -> Answers:
    """What the stopwatch says of a job, by contestant (or long run) and setting.

    What it was at when it had said nothing for `silent_s`, or ended, is a failure; the rest is
    begun again without this contestant's finer settings.  worth: which settings are to be repeated,
    from a first look at each; all if not given.  progress: is told the round, 0 for the first
    look, and the contestant.
    """
    answers: Answers = {}
    skipped: dict[int, int] = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "job.json"
        while True:
            file.write_text(json.dumps({**job, "skipped": list(skipped.items())}), encoding="utf-8")
            met = _timed_until(str(file), silent_s, answers, worth, progress)
            if met is None:
                return answers
            at, why = met
            if at is None:
                raise ToolError(f"hamotor bench: {why}; see its message above")
            say(f"hamotor bench: {why}; that is a row, the rest begins again")
            skipped[at[0]] = at[1]
            answers[at] = {"failure": why}


def _timed_until(
    file: str,
    silent_s: float,
    answers: Answers,
    worth: Callable[[Answers], Iterable[At]],
    progress: Callable[[int, int], None] | None,
) -> tuple[At | None, str] | None:
    """Gather answers until the stopwatch is done, None, or had to be given up: at what, and why."""
    lines: Queue[str | None] = Queue()
    at: At | None = None
    why = ""
    rounds = 0
    with stopwatch(file) as timing:
        stdout = timing.stdout
        assert stdout is not None

        def listen() -> None:
            for line in stdout:
                lines.put(line)
            lines.put(None)

        listener = Thread(target=listen, daemon=True)
        listener.start()
        try:
            while (line := lines.get(timeout=silent_s)) is not None:
                said = json.loads(line)
                if "asks" in said:
                    assert timing.stdin is not None
                    with suppress(BrokenPipeError):  # it is seen to have ended
                        chosen = json.dumps(list(worth(answers))) + "\n"
                        os.write(timing.stdin.fileno(), chosen.encode())
                elif "round" in said:
                    rounds = said["round"]
                else:
                    at = int(said.pop("index")), int(said.pop("setting"))
                    if said:
                        answers[at] = said
                    if progress is not None:
                        progress(rounds, at[0])
            if timing.wait():
                why = f"the process that times ended with {timing.returncode}"
        except Empty:
            why = f"timed out: nothing for {silent_s:g} s"
        finally:
            timing.kill()
            listener.join()
    return (at, why) if why else None


def peers_here(gaps: dict[str, str]) -> dict[str, str]:
    """Versions of the public solvers there are; what is missing goes to `gaps`."""
    with stopwatch() as answering:
        assert answering.stdout is not None
        versions = json.loads(answering.stdout.read() or "{}")
    for package, version in versions.items():
        if version is None:
            gaps[package] = f"not installed: {INSTALL}"
    found = {package: version for package, version in versions.items() if version is not None}
    gaps["diffrax"] = _DIFFRAX
    boost = _version_in("boost/version.hpp", "#define BOOST_LIB_VERSION")
    if boost is None:
        gaps["odeint"] = "not installed: sudo apt-get install libboost-dev"
    else:
        found["boost"] = boost.replace("_", ".")
    sundials = _version_in("sundials/sundials_config.h", "#define SUNDIALS_VERSION ")
    if sundials is None:
        gaps["SUNDIALS"] = f"not installed: {INSTALL_SUNDIALS}"
    else:
        found["sundials"] = sundials
    return found


def _version_in(header: str, line: str) -> str | None:
    for root in _INCLUDES:
        file = Path(root) / header
        if file.is_file():
            for text in file.read_text(encoding="utf-8").splitlines():
                if text.startswith(line):
                    return text.split('"')[1]
    return None


def compiled(compiler: str, file: str, *links: str, equations: str = "") -> str:
    """The library of one of the benchmark's C++ files; `equations`: for these, C++, alone."""
    text = (BENCH / file).read_text(encoding="utf-8")
    if equations:
        text = (
            '#include "problems.hpp"\n#define HAMOTOR_BENCH_EQUATIONS\n'
            f"namespace bench {{\n{equations}}}\n{text}"
        )
    with environment(CXX=compiler):
        built = compile_scene(
            text,
            includes=(BENCH,),
            libraries=(eigen(),),
            links=links,
        )
    return str(built.library)


def libraries(
    compilers: Sequence[str], peers: Mapping[str, str], gaps: dict[str, str], equations: str = ""
) -> list[tuple[str, str, str, Sequence[str]]]:
    """Solvers in C++ with controlled steps: compiler, family, library, names."""
    found: list[tuple[str, str, str, Sequence[str]]] = []
    for compiler in compilers:
        if "boost" in peers:
            library = compiled(compiler, "solvers.cpp", equations=equations)
            found.append((compiler, "odeint", library, _ODEINT))
        if "sundials" not in peers:
            continue
        links = ("-lsundials_cvode", "-lsundials_arkode", "-lsundials_nvecserial")
        try:
            library = compiled(compiler, "sundials.cpp", *links, equations=equations)
            ctypes.CDLL(library)
        except (ToolError, OSError) as problem:
            gaps["SUNDIALS"] = f"{INSTALL_SUNDIALS}; {str(problem).splitlines()[0]}"
        else:
            found.append((compiler, "SUNDIALS", library, _SUNDIALS))
    return found


def contestants(
    name: str,
    compilers: Sequence[str],
    peers: Mapping[str, str],
    extent: Extent,
    gaps: dict[str, str],
    equations: str = "",
) -> list[Contestant]:
    """The public solvers on one problem; `equations`: those generated from it, C++, where none are
    written by hand."""
    found = []
    form = _GIVEN if equations else _THEIRS

    def add(
        who: str, family: str, kind: str, options: Mapping[str, Any], settings: Sequence[float],
        longest_s: float = extent.longest_s, compiler: str = "", label: str = "",
        fixed: bool = False,
    ) -> None:  # fmt: skip
        found.append(
            Contestant(
                problem=name, name=who, family=family, compiler=compiler, kind=kind,
                settings=settings, longest_s=longest_s, form=form, options=label,
                fixed_steps=fixed, said={"options": options},
            )
        )  # fmt: skip

    steps = [float(s["calls"]) for s in step_ladder(1.0, extent.rungs)]
    for compiler, family, library, names in libraries(compilers, peers, gaps, equations):
        for solver in names:
            options: Mapping[str, Any] = {"library": library, "solver": solver}
            settings = tolerances(extent, 1e-16)
            add(solver, family, "compiled", options, settings, compiler=compiler)
        if family == "odeint":
            own_steps = (("Eigen rk4", "Eigen"), ("odeint rk4", "odeint"))
            for solver, of in own_steps[1:] if equations else own_steps:
                options = {"library": library, "solver": solver}
                add(solver, of, "compiled", options, steps, compiler=compiler, fixed=True)
    if "heyoka" in peers:
        for fast in (False, True):
            options = {"fast_math": fast}
            label = "fast_math" * fast
            add("heyoka", "heyoka", "heyoka", options, tolerances(extent, 1e-16), label=label)
    slow = _PYTHON_IS_SLOWER * extent.longest_s
    if "scipy" in peers:
        coarse = tolerances(extent, 3e-14)[::2]
        for method in ("DOP853", "LSODA"):
            add(f"SciPy {method}", "SciPy", "scipy", {"method": method}, coarse, slow)
    if equations:
        engines = [p for p in ("mujoco", "pin", "pybullet") if p in peers]
        if engines:
            gaps[f"{', '.join(engines)} on {name}"] = (
                "models are written for one body alone: free, a top, or held by a spring"
            )
        return found
    if "mujoco" in peers:
        for integrator in ("RK4", "implicitfast"):
            who = f"MuJoCo {integrator}"
            options = {"integrator": integrator}
            add(who, "MuJoCo", "mujoco", options, steps[::3], slow, fixed=True)
    if "pin" in peers:
        for integrator in ("RK4", "semi-implicit"):
            who = f"Pinocchio {integrator}"
            options = {"integrator": integrator}
            add(who, "Pinocchio", "pinocchio", options, steps[::3], slow, fixed=True)
    if "pybullet" in peers:
        add("Bullet", "Bullet", "bullet", {}, steps[::3], slow, fixed=True)
    return found


def long_runs(
    contestants: Sequence[Contestant], compiler: str, step: float, steps: int, samples: int,
    longest_s: float,
) -> list[dict[str, Any]]:  # fmt: skip
    """What the stopwatch is asked for: `steps` steps of the scene's, or the time that they take
    with a tight tolerance, of one of each solver."""
    samples = min(samples, steps)
    return [
        {
            "name": c.name,
            "family": c.family,
            "kind": c.kind,
            "options": c.said["options"],
            "step": step,
            "every": steps // samples,
            "samples": samples,
            "tolerance": 0.0 if c.fixed_steps else _TIGHT,
            "longest_s": longest_s,
        }
        for c in contestants
        if not c.is_ours and c.compiler in ("", compiler) and not c.options
    ]
