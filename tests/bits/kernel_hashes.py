"""The bits of generated kernels: a program that hashes them, its builds, and the pinned hashes.

`PYTHONPATH=generator .hamotor/venv/bin/python -m tests.bits.kernel_hashes` pins what is generated
now in `pinned.txt`: one line a kernel, so that the diff names the kernels whose arithmetic changed.
"""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path

from hamotor.codegen import bundled_algebras, read_algebra
from hamotor.codegen.kernel import Kernel
from hamotor.codegen.library import library
from hamotor.codegen.program import Call
from hamotor.codegen.spec import bundled_path

ROOT = Path(__file__).resolve().parents[2]
BUILDS = ROOT / ".hamotor" / "build" / "bits"
PINNED = Path(__file__).with_name("pinned.txt")
EVALUATIONS = 4096
COMPILERS = ("g++", "clang++")
LEVELS = ("-O0", "-O1", "-O3")
SCALARS = ("double", "float")
CORRECTLY_ROUNDED = frozenset(
    {
        "sqrt",
        "abs",
        "max_abs",
        "scaling",
        "compensated_dot",
        "compensated_dot_pair",
        "compensated_dot_where",
        "compensated_sum",
        "double_word_ratio",
    }
)
"""Functions of which IEEE 754 fixes every bit; kernels that call any other are left out."""

UPDATE = "PYTHONPATH=generator .hamotor/venv/bin/python -m tests.bits.kernel_hashes"


@dataclass(frozen=True)
class Build:
    """One way to compile the hashes of an algebra's kernels."""

    algebra: str
    compiler: str
    level: str
    fused: bool

    def __str__(self) -> str:
        """For messages: `g++ -O3 -mfma`."""
        return " ".join([self.compiler, self.level, *fused_flags(self.fused)])


@dataclass(frozen=True)
class Hashes:
    """What a kernel's outputs hash to: one number at a time, and in a loop over arrays."""

    single: str
    lanes: str


Report = Mapping[tuple[str, str], Hashes]
"""(kernel, scalar) → hashes."""


def title(kernel: Kernel) -> str:
    """As a call in the algebra's namespace: `se3::coadjoint(se3::Rate, se3::Momentum)`."""
    space = f"{kernel.namespace}::" if kernel.namespace else ""
    return f"{space}{kernel.name}({', '.join(e.cpp_name for e in kernel.operands)})"


@cache
def hashed_kernels(algebra: str) -> tuple[Kernel, ...]:
    """Kernels whose every operation rounds correctly: all that do not call sin, cos, atan2, ...."""
    return tuple(
        kernel
        for kernel in library(read_algebra(bundled_path(algebra)))
        if all(
            node.function in CORRECTLY_ROUNDED
            for node in kernel.program.nodes()
            if isinstance(node, Call)
        )
    )


def inputs(kernel: Kernel) -> int:
    """Numbers that one evaluation takes."""
    return sum(len(element.components) for element in kernel.operands)


def outputs(kernel: Kernel) -> int:
    """Numbers that one evaluation gives."""
    return len(kernel.program.outputs)


def fused_flags(fused: bool) -> tuple[str, ...]:
    """What makes `mul_add` round once; on other processors than x86-64 it always does."""
    return ("-mfma",) if fused and _is_x86() else ()


def processor_can(fused: bool) -> bool:
    """Whether this processor runs programs with, or without, hardware fused multiply-adds."""
    if not _is_x86():
        return fused
    return not fused or " fma " in Path("/proc/cpuinfo").read_text(encoding="utf-8")


def _is_x86() -> bool:
    return platform.machine() in ("x86_64", "AMD64")


def report(build: Build) -> Report:
    """Compile the hashes (once for the same text, headers, compiler and flags) and run them."""
    printed = _run(str(_program(build)))
    lines = [line.split("\t") for line in printed.splitlines()]
    return {(name, scalar): Hashes(single, lanes) for scalar, name, single, lanes in lines}


def reports(builds: Iterable[Build]) -> dict[Build, Report]:
    """The reports of several builds, as many at a time as there are processors."""
    listed = list(builds)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return dict(zip(listed, pool.map(report, listed), strict=True))


def _program(build: Build) -> Path:
    flags = ("-std=c++20", "-ffp-contract=off", build.level, *fused_flags(build.fused))
    source = source_text(build.algebra)
    identity = hashlib.sha256()
    for part in (source, _headers(build.algebra), _version(build.compiler), *flags):
        identity.update(part.encode())
    name = "".join((build.algebra, "-", build.compiler, *flags[2:], "-"))
    program = BUILDS / f"{name}{identity.hexdigest()[:16]}"
    if not program.exists():
        BUILDS.mkdir(parents=True, exist_ok=True)
        older = list(BUILDS.glob(f"{name}{'?' * 16}"))
        unfinished = BUILDS / f"{os.getpid()}-{program.name}"
        code = unfinished.with_name(f"{unfinished.name}.cpp")
        code.write_text(source, encoding="utf-8")
        folders = [f"-I{ROOT / folder}" for folder in ("generated", "runtime/include", ".")]
        _run(build.compiler, *flags, *folders, str(code), "-o", str(unfinished))
        code.unlink()
        unfinished.replace(program)
        for path in older:
            path.unlink(missing_ok=True)
    return program


def source_text(algebra: str) -> str:
    """C++ text that reports every hashed kernel of an algebra, for each scalar."""
    kernels = hashed_kernels(algebra)
    loops = "\n".join(_loop(f"loop_{i}", algebra, kernel) for i, kernel in enumerate(kernels))
    reports = "\n".join(
        f'  bits::report<S>(scalar, "{title(k)}", loop_{i}<S>, {inputs(k)}, {outputs(k)});'
        for i, k in enumerate(kernels)
    )
    runs = "\n".join(f'  all<{scalar}>("{scalar}");' for scalar in SCALARS)
    return f"""#include "hamotor/{algebra}/{algebra}.hpp"

#include <cstddef>

namespace hamotor::bits {{
inline constexpr std::size_t evaluations = {EVALUATIONS};
inline constexpr std::size_t most_inputs = {max(map(inputs, kernels))};
inline constexpr std::size_t most_outputs = {max(map(outputs, kernels))};
}}

#include "tests/bits/kernel_hashes.hpp"

using namespace hamotor;
using namespace hamotor::{algebra};
constexpr std::size_t n = bits::evaluations;

{loops}
template <class S>
void all(const char* scalar) {{
{reports}
}}

int main() {{
{runs}
}}
"""


def _loop(name: str, algebra: str, kernel: Kernel) -> str:
    """The loop that a compiler may turn into lanes; one turn of it is the kernel on its own."""
    columns = count()
    operands = []
    for element in kernel.operands:
        components = ", ".join(f"in[{next(columns)} * n + i]" for _ in element.components)
        scalar = element.name == "Scalar"
        operands.append(components if scalar else f"{element.cpp_name}<S>{{{components}}}")
    function = f"{algebra}::{title(kernel).partition('(')[0]}"
    result = kernel.program.result
    if result is None or result.name == "Scalar":
        stores = "out[i] = y;"
    else:
        stores = " ".join(
            f"out[{j} * n + i] = y.{c.name};" for j, c in enumerate(result.components)
        )
    return f"""template <class S>
[[gnu::noinline]] void {name}(const S* __restrict in, S* __restrict out, std::size_t first,
                              std::size_t last) {{
  for (std::size_t i = first; i < last; ++i) {{
    const auto y = {function}({", ".join(operands)});
    {stores}
  }}
}}
"""


@cache
def _headers(algebra: str) -> str:
    folders = (ROOT / "generated" / "hamotor" / algebra, ROOT / "runtime", Path(__file__).parent)
    paths = sorted(path for folder in folders for path in folder.rglob("*.hpp"))
    return "\0".join(path.read_text(encoding="utf-8") for path in paths)


@cache
def _version(compiler: str) -> str:
    return _run(compiler, "--version")


def _run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: exit status {done.returncode}\n{done.stderr}")
    return done.stdout


# ---------------------------------------------------------------- the pinned hashes

Pins = Mapping[str, Mapping[str, str]]
"""`algebra kernel` → column → hash."""

HEADER = f"""\
# What {EVALUATIONS} evaluations of each generated kernel hash to, all but exp, log and their like:
# the same from every compiler, at every level, in scalar code and in lanes, with -mfma and without.
# Written by `{UPDATE}`.
"""


def column(scalar: str, fused: bool) -> str:
    """Name of a column of the pinned file."""
    return f"{scalar}{'-fma' if fused else ''}"


COLUMNS = tuple(column(scalar, fused) for scalar in SCALARS for fused in (False, True))


def pinned() -> Pins:
    """What the committed file says."""
    lines = PINNED.read_text(encoding="utf-8").splitlines()
    rows = [line.split("  ") for line in lines if line and not line.startswith("#")]
    return {name: dict(zip(COLUMNS, hashes, strict=True)) for *hashes, name in rows}


def pinned_text(pins: Pins) -> str:
    """The file that says so; kernels in the order of their algebras and requests."""
    head = f"# {COLUMNS[0]:<16}" + "".join(f"  {name:<16}" for name in COLUMNS[1:]) + "  kernel"
    rows = ["  ".join([*(hashes[c] for c in COLUMNS), name]) for name, hashes in pins.items()]
    return "\n".join([HEADER.rstrip(), head, *rows]) + "\n"


def measured(algebras: Iterable[str], compiler: str, level: str) -> Pins:
    """What one compiler gives now, one number at a time."""
    builds = [Build(a, compiler, level, fused) for a in algebras for fused in (False, True)]
    pins: dict[str, dict[str, str]] = {}
    for build, found in reports(builds).items():
        for (name, scalar), hashes in found.items():
            row = pins.setdefault(f"{build.algebra} {name}", {})
            row[column(scalar, build.fused)] = hashes.single
    return pins


def main() -> None:
    """Pin what is generated now."""
    if not (processor_can(True) and processor_can(False)):
        sys.exit("this processor cannot give all columns: it needs x86-64 with fma")
    PINNED.write_text(pinned_text(measured(bundled_algebras(), "g++", "-O1")), encoding="utf-8")


if __name__ == "__main__":
    main()
