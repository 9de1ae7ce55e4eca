"""`hamotor bench kernels`: generated kernels against tables, Eigen and peers, with every error.

The C++ of tests/bench is built with each compiler there is, as a user's release would be; each
program times itself with Google Benchmark.  Repetitions are interleaved at random, and a time is
the median of them: what else runs on the machine then disturbs all contestants alike.
"""

from __future__ import annotations

import json
import platform
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any, Final

from hamotor.bench.account import provenance, publish, say
from hamotor.bench.report import MODES, draw_ratios, table
from hamotor.errors import CheckFailed, ToolError

ROOT: Final = Path(__file__).resolve().parents[3]
COMPILERS: Final = ("g++", "clang++")
FLAGS: Final = "-O3 -DNDEBUG"
AGREEMENT: Final = {"float": 1e-5, "double": 1e-11}
"""How far contestants may differ for rounded operands before they are not doing the same."""

MISSING_PEERS: Final = {
    "GLM dual quaternion": "not there: needs Debian's libglm-dev",
    "ganja.js C++": "not there: ./hamotor test --with-peers installs it from npm",
}
UNOBTAINABLE_PEERS: Final = {
    "gafro": "PyPI's pygafro is a compiled module without C++ headers",
    "versor, GATL, GAL, garamon, Klein": "in none of Debian, PyPI and npm",
}


@dataclass(frozen=True)
class Row:
    """One contestant at one operation; times in ns for one operation, one for each repetition."""

    operation: str
    contestant: str
    compiler: str
    scalar: str
    mode: str
    ns: float
    repetitions: list[float]
    max_relative_error: float


def bench_kernels(
    out: Path | None = None, json: bool = False, quick: bool = False, brief: bool = False
) -> dict[str, Any]:
    """Build, run and account for the benchmark of kernels.

    out: where kernels.json and kernels.png go; None: nowhere.  json: print the account on stdout
    instead of the table.  quick: double only, chains and arrays of 256, three repetitions.
    brief: quick, and only motions in chains, beside Eigen's quaternions, with one compiler.
    Returns the account.  Raises ToolError if a tool is missing or the build fails, CheckFailed if
    contestants do not agree on what an operation gives.
    """
    quick = quick or brief
    compilers = compilers_here()[: 1 if brief else None]
    programs = _build(compilers, quick, brief)
    rows: list[Row] = []
    for compiler, program in programs.items():
        say(f"timing, {compiler}")
        rows += _rows(compiler, program, quick, brief)
    account = {
        "benchmark": "kernels",
        "quick": quick,
        "unit": "ns per operation, median of the repetitions",
        "error": "largest relative error of 1000 random inputs against __float128",
        "rows": [asdict(row) for row in rows],
        "not_there": {} if brief else _not_there({row.contestant for row in rows}),
        "provenance": program_provenance(programs),
    }
    publish(account, table, out=out, as_json=json)
    if out is not None:
        draw_ratios(account, out / "kernels.png")
        say(f"wrote {out / 'kernels.png'}")
    return account


def compilers_here() -> list[str]:
    """The compilers to measure with.  ToolError if there is none, or cmake or ninja are missing."""
    found = [compiler for compiler in COMPILERS if shutil.which(compiler)]
    if not found:
        raise ToolError("hamotor bench: no C++ compiler: neither g++ nor clang++")
    if missing := [tool for tool in ("cmake", "ninja") if shutil.which(tool) is None]:
        raise ToolError(
            f"hamotor bench: no such command: {', '.join(missing)}. "
            "`./hamotor bench` installs what it needs, or names the line that does"
        )
    return found


def _build(compilers: Sequence[str], quick: bool, brief: bool) -> dict[str, Path]:
    """The benchmark program of each compiler, built side by side."""
    say(f"building with {' and '.join(compilers)}")
    with ThreadPoolExecutor(len(compilers)) as pool:
        programs = pool.map(
            lambda compiler: build_program(compiler, "kernels", quick=quick, brief=brief), compilers
        )
        return dict(zip(compilers, programs, strict=True))


def build_program(compiler: str, target: str, *, quick: bool, brief: bool = False) -> Path:
    """A program of tests/bench, built as a user's release would be.  ToolError if that fails."""
    kind = "brief-" if brief else "quick-" if quick else ""
    folder = ROOT / ".hamotor" / "build" / f"bench-{kind}{compiler}"
    cache = folder / "CMakeCache.txt"
    home = f"CMAKE_HOME_DIRECTORY:INTERNAL={ROOT}\n"
    if cache.is_file() and home not in cache.read_text(encoding="utf-8"):
        shutil.rmtree(folder)  # the clone was moved
    run_tool(
        "cmake", "-S", str(ROOT), "-B", str(folder), "-G", "Ninja",
        f"-DCMAKE_CXX_COMPILER={compiler}", "-DCMAKE_BUILD_TYPE=Release",
        f"-DCMAKE_CXX_FLAGS_RELEASE={FLAGS}", "-DHAMOTOR_NATIVE=ON",
        "-DHAMOTOR_BUILD_TESTS=OFF", "-DHAMOTOR_BUILD_BENCHMARKS=ON",
        f"-DHAMOTOR_BENCH_DOUBLE_ONLY={'ON' if quick else 'OFF'}",
        f"-DHAMOTOR_BENCH_BRIEF={'ON' if brief else 'OFF'}",
    )  # fmt: skip
    run_tool("cmake", "--build", str(folder), "--target", target)
    return folder / "tests" / "bench" / target


def run_tool(*command: str) -> str:
    """What a command prints.  ToolError with its first errors if it fails."""
    done = subprocess.run(
        command, capture_output=True, text=True, errors="replace", check=False, cwd=ROOT
    )
    if done.returncode != 0:
        lines = (done.stdout + done.stderr).splitlines()
        telling = [line for line in lines if "rror" in line] or lines
        shown = "\n".join(f"  {line}" for line in telling[:5])
        raise ToolError(f"hamotor bench: {command[0]} failed:\n{shown}")
    return done.stdout


def _rows(compiler: str, program: Path, quick: bool, brief: bool) -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        errors = _errors(program, Path(folder) / "errors")
        chosen = "double.*latency" if brief else "double.*(latency|256)" if quick else "."
        times = Path(folder) / "times.json"
        run_tool(
            str(program),
            f"--benchmark_filter={chosen}",
            f"--benchmark_repetitions={3 if quick else 7}",
            f"--benchmark_min_time={0.002 if quick else 0.005}",
            "--benchmark_enable_random_interleaving=true",
            f"--benchmark_out={times}",
            "--benchmark_out_format=json",
        )
        measured = json.loads(times.read_text(encoding="utf-8"))["benchmarks"]
    found: dict[str, list[float]] = {}
    for row in measured:
        if row["run_type"] == "iteration":
            found.setdefault(row["run_name"], []).append(1e9 / row["items_per_second"])
    rows = []
    for name, nanoseconds in found.items():
        operation, contestant, scalar, mode = name.split("|")
        rows.append(
            Row(
                operation=operation,
                contestant=contestant,
                compiler=compiler,
                scalar=scalar,
                mode=mode.replace("array/", "array of "),
                ns=median(nanoseconds),
                repetitions=nanoseconds,
                max_relative_error=errors[operation, contestant, scalar],
            )
        )
    place = {entry: index for index, entry in enumerate(errors)}
    return sorted(
        rows,
        key=lambda r: (place[r.operation, r.contestant, r.scalar], MODES.index(r.mode)),
    )


def _errors(program: Path, file: Path) -> dict[tuple[str, str, str], float]:
    """Largest relative error by operation, contestant and scalar, once all were seen to agree."""
    run_tool(str(program), f"--errors={file}")
    errors = {}
    for line in file.read_text(encoding="utf-8").splitlines():
        row = json.loads(line)
        if not row["disagreement"] <= AGREEMENT[row["scalar"]]:
            raise CheckFailed(
                f"hamotor bench: {row['operation']}, {row['contestant']}, {row['scalar']}: differs "
                f"from the generated kernel by {row['disagreement']:.2g} in __float128; it does "
                "something else and cannot be compared"
            )
        errors[row["operation"], row["contestant"], row["scalar"]] = row["max_relative_error"]
    return errors


def _not_there(contestants: set[str]) -> dict[str, str]:
    missing = {peer: why for peer, why in MISSING_PEERS.items() if peer not in contestants}
    return missing | UNOBTAINABLE_PEERS


def program_provenance(programs: Mapping[str, Path]) -> dict[str, Any]:
    """Where the programs of each compiler come from."""
    program = next(iter(programs.values()))
    return provenance(
        compilers={compiler: _first_line(compiler, "--version") for compiler in programs},
        flags=f"-std=gnu++20 {FLAGS} -fno-math-errno "
        + ("-mcpu=native" if platform.machine() in {"aarch64", "arm64"} else "-march=native"),
        contraction="generated: -ffp-contract=off (it fuses by itself); all others: fast",
        eigen=_package_version(program, "Eigen3"),
        google_benchmark=_package_version(program, "benchmark"),
    )


def _first_line(*command: str) -> str:
    return run_tool(*command).splitlines()[0].strip()


def _package_version(program: Path, package: str) -> str:
    """Version of a CMake package that the build of the program found."""
    cache = program.parents[2] / "CMakeCache.txt"
    for line in cache.read_text(encoding="utf-8").splitlines():
        if line.startswith(f"{package}_DIR:"):
            file = Path(line.partition("=")[2]) / f"{package}ConfigVersion.cmake"
            if file.is_file():
                found = re.search(r'PACKAGE_VERSION "([^"]+)"', file.read_text(encoding="utf-8"))
                return found[1] if found else "unknown"
    return "unknown"
