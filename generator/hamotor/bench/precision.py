"""`hamotor bench precision`: what each digit costs, by method, and beside public solvers.

Every setting of every contestant integrates the same problem from the same start to the same end,
in one process; what is timed is the integration alone, the set-up is listed apart.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np

from hamotor import __version__
from hamotor.bench import endpoint
from hamotor.bench.drift import Drift, drifts
from hamotor.bench.precision_report import RULES, leaders, standings, table, write_report
from hamotor.bench.problems import GOALS, ROOT, TARGETS, Problem, own_problems, problem
from hamotor.errors import HamotorError, ToolError
from hamotor.run.build import compile_scene, default_cache, eigen, find_compiler, processor_name
from hamotor.run.library import SceneLibrary
from hamotor.scene import METHODS

BENCH: Final = ROOT / "tests" / "bench" / "precision"
PEERS_PYTHON: Final = ROOT / ".hamotor" / "peers" / "solvers" / "bin" / "python"
INSTALL: Final = "./hamotor bench precision --with-peers"
COMPILERS: Final = ("g++", "clang++")
_LONGEST_RUN_S: Final = 300.0

_ODEINT: Final = ("odeint rkf78", "odeint dopri5", "odeint Bulirsch-Stoer")
_FORMS: Final = (
    ("generic", "ga", "double", ("rkmk4", "gauss6")),
    ("generated", "matrix", "double", ("rkmk4", "rk4")),
    ("generated", "ga", "float", ("rkmk4", "splitting4")),
    ("generated", "ga", "long_double", ("splitting8", "gauss8")),
)
"""Kernels, representation and scalar beside the generated ones in double, with some methods."""


@dataclass(frozen=True)
class Contestant:
    """A method, or a public solver, on one problem with all its settings, coarse to fine."""

    problem: str
    name: str
    family: str
    """hamotor, or the public solver's package."""
    form: str
    """Kernels, representation and scalar; of a peer, its options."""
    compiler: str
    kind: str
    settings: Sequence[Any]
    longest_s: float
    said: Mapping[str, Any] = field(default_factory=dict)
    """What the stopwatch needs to know."""


@dataclass(frozen=True)
class Row:
    """One setting of one contestant.  Times in µs for the whole integration."""

    problem: str
    contestant: str
    family: str
    form: str
    compiler: str
    setting: float
    """The step, s, or the tolerance."""
    setting_is: str
    best_us: float | None = None
    median_us: float | None = None
    worst_us: float | None = None
    runs: int = 0
    steps: int | None = None
    evaluations: int | None = None
    set_up_s: float = 0.0
    errors: Mapping[str, float] = field(default_factory=dict)
    failure: str | None = None


@dataclass(frozen=True)
class Extent:
    """How much is measured."""

    rounds: int
    rungs: float
    """Ratio of the steps of neighbouring settings; of tolerances its fourth power."""
    longest_s: float
    enough_s: float
    forms: bool
    compilers: Sequence[str]
    drift: int = 0
    """Steps of the long runs; 0: none."""


FULL: Final = Extent(8, 2 ** (1 / 3), 0.015, 0.15, True, COMPILERS, 10**6)
QUICK: Final = Extent(3, 2.0, 0.004, 0.02, False, COMPILERS[:1])


def bench_precision(
    scenes: Sequence[str] = (),
    out: Path | None = None,
    json: bool = False,
    quick: bool = False,
    with_peers: bool = False,
    drift: int | None = None,
) -> dict[str, Any]:
    """Run and account for the benchmark of precision.

    scenes: names or paths of scenes; the benchmark's own problems if not given.  out: where
    precision.json, the diagrams and precision.html go; None: nowhere.  json: print the account on
    stdout instead of the table.  quick: fewer settings and repetitions, one compiler, no other
    kernels or scalars.  with_peers: first install the public solvers that come from PyPI.  drift:
    steps of the long runs, a million if not given, none if quick.
    Returns the account.  Raises UsageError and ToolError as `hamotor run` does.
    """
    gaps: dict[str, str] = {}
    if with_peers:
        install_peers()
    peers = peers_here(gaps)
    problems = [problem(name) for name in (scenes or own_problems())]
    extent = QUICK if quick else FULL
    if drift is not None:
        extent = replace(extent, drift=drift)
    account = measure(problems, extent, peers, gaps)
    _print(account, as_json=json)
    if out is not None:
        for file in write_report(account, out):
            _say(f"wrote {file}")
    return account


def measure(
    problems: Sequence[Problem],
    extent: Extent,
    peers: Mapping[str, str],
    gaps: Mapping[str, str],
) -> dict[str, Any]:
    """The account of these problems, with the peers there are (package → version)."""
    compilers = _compilers(extent)
    contestants: list[Contestant] = []
    refused: list[Row] = []
    said: dict[str, Any] = {}
    missing = dict(gaps)
    for one in problems:
        _say(f"{one.name}: reference")
        reference = one.reference
        said[one.name] = {
            "description": getattr(one.scene, "description", ""),
            "end_s": one.simulation.end,
            "reference": reference.source,
            "certificate": reference.certificate,
            "goals": list(GOALS.get(one.name, ())),
            "set_up": _set_up(one, extent),
        }
        _say(f"{one.name}: compiling methods with {compilers[0]}")
        made, failed = _scenes(one, compilers[0], extent)
        contestants += made
        refused += failed
        if isinstance(one.for_peers, str):
            missing[f"public solvers on {one.name}"] = one.for_peers
        else:
            contestants += _public(one.name, compilers, peers, extent)
    if len(compilers) > 1:
        ours = [c for c in contestants if c.family == "hamotor" and not c.form]
        first = [asdict(row) for row in _times(problems, ours, replace(extent, rounds=0))]
        for one in problems:
            leading = leaders(first, one.name)
            for compiler in compilers[1:]:
                _say(f"{one.name}: compiling {', '.join(leading)} with {compiler}")
                contestants += _scenes(one, compiler, replace(extent, forms=False), leading)[0]
    rows = refused + _times(problems, contestants, extent)
    long_runs = _long_runs(problems, contestants, compilers[0], extent.drift)
    account = {
        "benchmark": "precision",
        "targets": list(TARGETS),
        "problems": said,
        "rows": [asdict(row) for row in rows],
        "drift": [asdict(drift) for drift in long_runs],
        "not_there": missing,
        "rules": list(RULES),
        "provenance": _provenance(compilers, peers, extent),
    }
    return {**account, "best": standings(account)}


def _print(account: Mapping[str, Any], *, as_json: bool) -> None:
    print(json.dumps(account, indent=1, allow_nan=False) if as_json else table(account), flush=True)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _long_runs(
    problems: Sequence[Problem], contestants: Sequence[Contestant], compiler: str, steps: int
) -> list[Drift]:
    """The generated kernels in double; a method that would take minutes takes fewer steps."""
    by_name = {one.name: one.simulation for one in problems}
    found: list[Drift] = []
    for c in contestants:
        if not steps or c.family != "hamotor" or c.form or c.compiler != compiler:
            continue
        _say(f"{c.problem}: {steps:,} steps of {c.name}")
        library = SceneLibrary(Path(c.said["library"]))
        trial = drifts(c.problem, by_name[c.problem], library, c.name, 1000)
        needed = trial[0].seconds / 1000 if trial else 0.0
        affordable = min(steps, int(_LONGEST_RUN_S / max(needed, 1e-9)))
        if trial and trial[0].steps == 1000:
            trial = drifts(c.problem, by_name[c.problem], library, c.name, affordable)
        found += trial
    return found


def _compilers(extent: Extent) -> list[str]:
    if os.environ.get("CXX"):
        return [" ".join(find_compiler(default_cache()).command)]
    found = []
    for compiler in extent.compilers:
        try:
            with _environment(CXX=compiler):
                find_compiler(default_cache())
        except ToolError:
            continue
        found.append(compiler)
    if not found:
        find_compiler(default_cache())  # says what to install
    return found


@contextmanager
def _environment(**changes: str) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def install_peers() -> None:
    """Install the public solvers from PyPI into an environment of their own."""
    _say("installing heyoka, SciPy and MuJoCo")
    done = subprocess.run(
        (sys.executable, "-m", "tests.peers.environment", "solvers"), cwd=ROOT, check=False
    )
    if done.returncode:
        _say("hamotor bench: not all peers could be installed; the others are measured")


def _stopwatch(*arguments: str) -> subprocess.Popen[str]:
    python = PEERS_PYTHON if PEERS_PYTHON.is_file() else Path(sys.executable)
    return subprocess.Popen(
        (str(python), "-m", "tests.bench.precision.stopwatch", *arguments),
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )


def peers_here(gaps: dict[str, str]) -> dict[str, str]:
    """Versions of the public solvers there are; what is missing goes to `gaps`."""
    with _stopwatch() as answering:
        assert answering.stdout is not None
        versions = json.loads(answering.stdout.read() or "{}")
    for package, version in versions.items():
        if version is None:
            gaps[package] = f"not installed: {INSTALL}"
    return {package: version for package, version in versions.items() if version is not None}


def _scenes(
    one: Problem, compiler: str, extent: Extent, only: Sequence[str] | None = None
) -> tuple[list[Contestant], list[Row]]:
    """Our methods on a problem, or `only` these, compiled; and those that could not be."""
    simulation = one.simulation
    choices = [("generated", "ga", "double", m) for m in simulation.offered("generated", "ga")]
    if extent.forms:
        for kernels, representation, scalar, methods in _FORMS:
            offered = simulation.offered(kernels, representation)
            choices += [(kernels, representation, scalar, m) for m in methods if m in offered]
    if only is not None:
        choices = [choice for choice in choices if choice[-1] in only]
    cache = default_cache() / "precision" / one.name

    def compiled(choice: tuple[str, str, str, str]) -> Contestant | Row:
        kernels, representation, scalar, method = choice
        form = _form(kernels, representation, scalar)
        try:
            built = simulation.compile(
                scalar=scalar, kernels=kernels, representation=representation, method=method
            )
        except HamotorError as refusal:
            return Row(
                one.name, method, "hamotor", form, compiler, 0.0, "step",
                failure=str(refusal).splitlines()[0],
            )  # fmt: skip
        description = built.description
        return Contestant(
            problem=one.name,
            name=method,
            family="hamotor",
            form=form,
            compiler=compiler,
            kind="scene",
            settings=_ladder(
                simulation.end, extent, controlled=method in description.error_controlled
            ),
            longest_s=extent.longest_s,
            said={
                "library": str(built.build.library),
                "method": method,
                "state": [float(x) for x in simulation.state],
                "columns": len(description.columns),
                "description": description,
            },
        )

    # A method that the list names and this scene's library has not got is a gap of the list.
    with _environment(CXX=compiler, HAMOTOR_CACHE=str(cache)), ThreadPoolExecutor(2) as pool:
        found = list(pool.map(compiled, choices))
    return (
        [c for c in found if isinstance(c, Contestant)],
        [r for r in found if isinstance(r, Row)],
    )


def _form(kernels: str, representation: str, scalar: str) -> str:
    words = [w for w in (kernels, representation, scalar) if w not in {"generated", "ga", "double"}]
    return ", ".join(words)


def _ladder(end: float, extent: Extent, *, controlled: bool) -> list[dict[str, float]]:
    """Steps or tolerances, coarse to fine."""
    if controlled:
        return [{"calls": 1, "step": end, "tolerance": t} for t in _tolerances(extent, 1e-18)]
    counts: list[int] = []
    size = 1.0
    while size < 1e7:
        if not counts or round(size) > counts[-1]:
            counts.append(round(size))
        size *= extent.rungs
    return [{"calls": n, "step": end / n, "tolerance": 0.0} for n in counts]


def _tolerances(extent: Extent, finest: float) -> list[float]:
    found = [1e-2]
    while (finer := found[-1] / extent.rungs**4) > finest:
        found.append(finer)
    return found


def _public(
    name: str, compilers: Sequence[str], peers: Mapping[str, str], extent: Extent
) -> list[Contestant]:
    """The public solvers on one problem."""
    found = []

    def add(
        who: str, family: str, kind: str, options: Mapping[str, Any], settings: Sequence[float],
        longest_s: float = extent.longest_s, compiler: str = "", form: str = "",
    ) -> None:  # fmt: skip
        found.append(
            Contestant(
                name, who, family, form, compiler, kind, settings, longest_s, {"options": options}
            )
        )

    steps = [float(s["calls"]) for s in _ladder(1.0, extent, controlled=False)]
    for compiler in compilers:
        library = _compile(compiler, "solvers.cpp")
        for solver in _ODEINT:
            options = {"library": library, "solver": solver}
            add(
                solver, "odeint", "compiled", options, _tolerances(extent, 1e-16), compiler=compiler
            )
        options = {"library": library, "solver": "Eigen rk4"}
        add("Eigen rk4", "Eigen", "compiled", options, steps, compiler=compiler)
    if "heyoka" in peers:
        for fast in (False, True):
            add(
                "heyoka", "heyoka", "heyoka", {"fast_math": fast}, _tolerances(extent, 1e-16),
                form="fast_math" * fast,
            )  # fmt: skip
    slow = 40 * extent.longest_s
    if "scipy" in peers:
        coarse = _tolerances(extent, 3e-14)
        for method in ("DOP853", "LSODA"):
            add(f"SciPy {method}", "SciPy", "scipy", {"method": method}, coarse, slow)
    if "mujoco" in peers:
        for integrator in ("RK4", "implicitfast"):
            options = {"integrator": integrator}
            add(f"MuJoCo {integrator}", "MuJoCo", "mujoco", options, steps[::3], slow)
    return found


def _compile(compiler: str, file: str) -> str:
    with _environment(CXX=compiler):
        built = compile_scene(
            (BENCH / file).read_text(encoding="utf-8"), includes=(), libraries=(eigen(),)
        )
    return str(built.library)


def _times(
    problems: Sequence[Problem], contestants: Sequence[Contestant], extent: Extent
) -> list[Row]:
    """Every setting of every contestant, timed in one process."""
    job = {
        "rounds": extent.rounds,
        "enough_s": extent.enough_s,
        "loop": _compile(_compilers(extent)[0], "loop.cpp"),
        "problems": {
            one.name: None if isinstance(one.for_peers, str) else one.for_peers for one in problems
        },
        "contestants": [
            {
                "problem": c.problem,
                "kind": c.kind,
                "settings": list(c.settings),
                "longest_s": c.longest_s,
                **{key: value for key, value in c.said.items() if key != "description"},
            }
            for c in contestants
        ],
    }
    by_name = {one.name: one for one in problems}
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "job.json"
        file.write_text(json.dumps(job), encoding="utf-8")
        with _stopwatch(str(file)) as timing:
            assert timing.stdout is not None
            for line in timing.stdout:
                said = json.loads(line)
                contestant = contestants[said["contestant"]]
                rows.append(_row(contestant, said, by_name[contestant.problem]))
        if timing.returncode:
            raise ToolError("hamotor bench: the process that times stopped; see its message above")
    order = {(c.problem, c.name, c.form, c.compiler): n for n, c in enumerate(contestants)}
    rows.sort(key=lambda r: (order[r.problem, r.contestant, r.form, r.compiler], -r.setting))
    return rows


def _row(contestant: Contestant, said: Mapping[str, Any], one: Problem) -> Row:
    setting = contestant.settings[said["setting"]]
    what = "tolerance"
    if contestant.kind == "scene":
        if setting["tolerance"]:
            value = setting["tolerance"]
        else:
            value, what = setting["step"], "step"
    elif contestant.family in {"Eigen", "MuJoCo"}:
        value, what = one.simulation.end / setting, "step"
    else:
        value = setting
    row = Row(
        problem=contestant.problem,
        contestant=contestant.name,
        family=contestant.family,
        form=contestant.form,
        compiler=contestant.compiler,
        setting=value,
        setting_is=what,
        failure=said.get("failure"),
    )
    if row.failure is not None:
        return row
    if not all(map(isfinite, said["final"])):
        return replace(row, failure="not finite at the end")
    with np.errstate(all="ignore"):  # a run that exploded may leave what a double holds
        if contestant.kind == "scene":
            found = endpoint.of_row(contestant.said["description"], said["final"])
        else:
            found = endpoint.of_quaternion(one.scene, said["final"])
        errors = endpoint.errors(found, one.reference.end)
    return Row(
        **{
            **asdict(row),
            "best_us": said["best_s"] * 1e6,
            "median_us": said["median_s"] * 1e6,
            "worst_us": said["worst_s"] * 1e6,
            "runs": said["runs"],
            "steps": said["steps"],
            "evaluations": said["evaluations"],
            "set_up_s": said["set_up_s"],
            "errors": {name: e for name, e in errors.items() if isfinite(e)},
            "failure": None if all(map(isfinite, errors.values())) else "an error is not finite",
        }
    )


def _set_up(one: Problem, extent: Extent) -> dict[str, float]:
    """What comes before the first step, with nothing in any cache, s."""
    method = next(iter(one.simulation.methods))
    compiler = _compilers(extent)[0]
    with (
        tempfile.TemporaryDirectory() as folder,
        _environment(HAMOTOR_CACHE=folder, CXX=compiler),
    ):
        built = one.simulation.compile(method=method)
        end = one.simulation.end
        began = time.perf_counter()
        with built.library.start(method, step=end * 2.0**-20, state=one.simulation.state) as live:
            live.advance(1, 0, None)
            first_step_s = time.perf_counter() - began
    return {
        "generate_s": built.generate_s,
        "compile_s": built.build.compile_s,
        "first_step_us": first_step_s * 1e6,
    }


def _provenance(
    compilers: Sequence[str], peers: Mapping[str, str], extent: Extent
) -> dict[str, Any]:
    versions = {}
    flags: Sequence[str] = ()
    for compiler in compilers:
        with _environment(CXX=compiler):
            versions[compiler] = find_compiler(default_cache()).version
    from hamotor.run.build import default_includes, flags_for, headers_digest

    flags = flags_for(platform.machine())
    return {
        "hamotor": __version__,
        "headers": headers_digest(default_includes()),
        "bench": hashlib.sha256(
            b"\0".join(file.read_bytes() for file in sorted(BENCH.iterdir()) if file.is_file())
        ).hexdigest(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "compilers": versions,
        "flags": " ".join(flags),
        "peers": {**peers, "boost": _boost_version()},
        "methods": len(METHODS),
        "rounds": extent.rounds,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "processor": processor_name(),
        "processors": os.cpu_count(),
        "load": list(os.getloadavg()),
    }


def _boost_version() -> str:
    for root in ("/usr/include", "/usr/local/include"):
        file = Path(root) / "boost" / "version.hpp"
        if file.is_file():
            for line in file.read_text(encoding="utf-8").splitlines():
                if line.startswith("#define BOOST_LIB_VERSION"):
                    return line.split('"')[1].replace("_", ".")
    return "not there"
