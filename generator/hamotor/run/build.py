"""From the C++ text of a scene to a shared library, compiled once and kept.

The library's place in the cache is the SHA-256 of everything that decides its bits: the source, the
headers it may include, the compiler's identity, the flags and the processor (`-march=native`).
An unchanged scene therefore never runs the compiler again, not even to ask for its version.
The cache holds the last 200 scenes used.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hamotor.errors import ToolError, UsageError, suggest
from hamotor.files import whole, write_whole

REPOSITORY = Path(__file__).resolve().parents[3]
"""The checkout this package runs from: `generated/` and `runtime/` lie here."""

_HEADER_SUFFIXES = {".h", ".hh", ".hpp", ".hxx", ".inc", ".ipp"}
_ERRORS_SHOWN = 3
_KEPT_SCENES = 200


@dataclass(frozen=True)
class Compiler:
    """A C++ compiler: the command that starts it and the first line of its `--version`."""

    command: tuple[str, ...]
    version: str


@dataclass(frozen=True)
class CompiledScene:
    """A shared library with the scene's C ABI, and how it came to be.

    `compile_s` is the time spent compiling in this call, in seconds: 0 when `cached`.
    """

    library: Path
    source: Path
    compiler: str
    flags: tuple[str, ...]
    processor: str
    compile_s: float
    cached: bool


def default_cache() -> Path:
    """The folder of compiled scenes: $HAMOTOR_CACHE, or `.hamotor/cache` in the checkout."""
    chosen = os.environ.get("HAMOTOR_CACHE")
    if chosen:
        return Path(chosen)
    ours = REPOSITORY / ".hamotor" / "cache"
    if os.access(ours if ours.exists() else REPOSITORY, os.W_OK):
        return ours
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(base) / "hamotor"


def default_includes() -> tuple[Path, ...]:
    """The header folders a scene is compiled against."""
    return (REPOSITORY / "generated", REPOSITORY / "runtime" / "include")


def eigen() -> Path:
    """The headers of Eigen, which the matrix representation is written with.

    They are looked for in $EIGEN3_INCLUDE_DIR and where systems keep them.  Raises ToolError.
    """
    places = [
        os.environ.get("EIGEN3_INCLUDE_DIR", ""),
        *(f"{root}/include/eigen3" for root in ("/usr", "/usr/local", "/opt/homebrew", "/opt")),
    ]
    for place in filter(None, places):
        if (Path(place) / "Eigen" / "Core").is_file():
            return Path(place)
    raise ToolError(
        "Eigen not found, which --representation matrix needs. Install it, for example: "
        "sudo apt-get install libeigen3-dev, or name its folder in EIGEN3_INCLUDE_DIR."
    )


_AVX2 = ("-mavx2", "-mfma", "-mbmi", "-mbmi2")
INSTRUCTION_SETS = {
    "sse2": (),
    "avx2": _AVX2,
    "avx512": (*_AVX2, "-mavx512f", "-mavx512cd", "-mavx512bw", "-mavx512dq", "-mavx512vl"),
}
"""Those of x86-64 that $HAMOTOR_ISA names: what compilers are told beside -march=x86-64."""


def _processor_flags(machine: str) -> tuple[str, ...]:
    """For this processor, or for those that have what $HAMOTOR_ISA names."""
    forced = os.environ.get("HAMOTOR_ISA", "")
    if not forced:
        return ("-mcpu=native" if machine in {"aarch64", "arm64"} else "-march=native",)
    if machine not in {"x86_64", "AMD64"}:
        raise UsageError(f"HAMOTOR_ISA is for x86-64; scenes on {machine} have one form.")
    if forced not in INSTRUCTION_SETS:
        raise UsageError(
            f'HAMOTOR_ISA is "{forced}"; allowed are {", ".join(INSTRUCTION_SETS)}.'
            f"{suggest(forced, INSTRUCTION_SETS)}"
        )
    has = {x for line in _cpuinfo_lines() if line.startswith("flags") for x in line.split()}
    for option in INSTRUCTION_SETS[forced] if has else ():
        feature = option.removeprefix("-m")
        if {feature, f"{feature}1"}.isdisjoint(has):  # /proc/cpuinfo counts the first BMI
            raise UsageError(f'HAMOTOR_ISA is "{forced}"; this processor has no {feature}.')
    return ("-march=x86-64", *INSTRUCTION_SETS[forced])


def flags_for(machine: str) -> tuple[str, ...]:
    """The flags every scene is compiled with on a machine of this kind.

    For its own processor, unless $HAMOTOR_ISA names an instruction set.
    `-ffp-contract=off` because the kernels say themselves where a multiply-add is fused; no
    `-ffast-math`, because the order of the sums is part of the result.
    """
    return (
        "-std=c++20",
        "-O3",
        *_processor_flags(machine),
        "-ffp-contract=off",
        "-fno-math-errno",
        "-shared",
        "-fPIC",
        "-fvisibility=hidden",
    )


def flags_without_packs(machine: str) -> tuple[str, ...]:
    """Registers of 32 bytes, for methods that fill none of 64 themselves.

    g++ 12 packs eight numbers that are about to be stored, a motor's, into one of 64, and what
    reads them next waits for all.  Steps of `rk4` take 0.65 to 0.98 times as long without that,
    those of the Taylor series, which fills such registers, 1.2 times.  The same bits.
    """
    return ("-mprefer-vector-width=256",) if machine in {"x86_64", "AMD64"} else ()


@dataclass(frozen=True)
class Requirement:
    """A library that a scalar is made of: what to link, a text that shows it is there, advice."""

    links: tuple[str, ...]
    probe: str
    missing: str


def requirement_of(scalar: str, machine: str) -> Requirement | None:
    """What scenes of a scalar (`quad`, `mpfr50`) need besides a compiler."""
    if scalar.startswith("mpfr"):
        return Requirement(
            ("-lmpfr", "-lgmp"),
            "#include <mpfr.h>\nint probe(mpfr_ptr x) { return mpfr_sin(x, x, MPFR_RNDN); }\n",
            "MPFR not found, which --scalar mpfr needs. "
            "Install it, for example: sudo apt-get install libmpfr-dev",
        )
    if scalar == "quad" and machine in {"x86_64", "AMD64", "i686", "i386", "ppc64le"}:
        return Requirement(
            ("-lquadmath",),
            'extern "C" __float128 sinq(__float128);\n'
            "__float128 probe(__float128 x) { return sinq(x) / x; }\n",
            "--scalar quad needs a compiler with __float128 and its library libquadmath, "
            "as g++ has: sudo apt-get install g++, or take --scalar mpfr",
        )
    return None  # elsewhere long double has 113 bits


def find_compiler(cache: Path, requirement: Requirement | None = None) -> Compiler:
    """The compiler in $CXX, or else g++, or else clang++: the first that has what is required.

    Raises ToolError when there is none.  Its version is remembered by path, size and time of
    change, so that a second call starts no process.
    """
    tried = []
    for compiler in _compilers(cache):
        if requirement is None or _has(compiler, requirement, cache):
            return compiler
        tried.append(shlex.join(compiler.command))
    assert requirement is not None
    raise ToolError(f"{requirement.missing}. (Tried with {' and '.join(tried)}.)")


def _has(compiler: Compiler, requirement: Requirement, cache: Path) -> bool:
    """Whether what is required compiles and links; a success is remembered."""
    known = json.dumps([compiler.command, compiler.version, requirement.links])
    remembered = cache / "compilers.json"
    answers = _read_json_object(remembered)
    if known in answers:
        return True
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "probe.cpp"
        source.write_text(requirement.probe)
        flags = ("-shared", "-fPIC", "-o", str(source.with_suffix(".so")), str(source))
        try:
            subprocess.run(
                [*compiler.command, *flags, *requirement.links],
                capture_output=True,
                check=True,
                timeout=60,
            )
        except (OSError, subprocess.SubprocessError):
            return False
    answers[known] = "yes"
    cache.mkdir(parents=True, exist_ok=True)
    write_whole(remembered, json.dumps(answers, indent=1))
    return True


def _compilers(cache: Path) -> Iterator[Compiler]:
    """The one in $CXX, or those there are."""
    wanted = os.environ.get("CXX", "").strip()
    if wanted:
        command = tuple(shlex.split(wanted))
        if shutil.which(command[0]) is None:
            raise ToolError(
                f'the compiler in $CXX, "{command[0]}", is not on the PATH. '
                "Correct CXX or unset it to use g++ or clang++."
            )
        yield Compiler(command, _version_of(command, cache))
        return
    names = [name for name in ("g++", "clang++") if shutil.which(name)]
    yield from (Compiler((name,), _version_of((name,), cache)) for name in names)
    if names:
        return
    raise ToolError(
        "no C++ compiler found: neither $CXX nor g++ nor clang++. "
        "Install one, for example: sudo apt-get install g++"
    )


def _version_of(command: tuple[str, ...], cache: Path) -> str:
    identity = [_file_identity(word) for word in command]
    known = json.dumps([command, identity])
    remembered = cache / "compilers.json"
    versions = _read_json_object(remembered)
    version = versions.get(known)
    if version is None:
        try:
            answer = subprocess.run(
                [*command, "--version"], capture_output=True, text=True, check=True, timeout=60
            )
        except (OSError, subprocess.SubprocessError) as problem:
            raise ToolError(f'"{shlex.join(command)} --version" failed: {problem}') from problem
        version = answer.stdout.splitlines()[0].strip() if answer.stdout else command[0]
        versions[known] = version
        cache.mkdir(parents=True, exist_ok=True)
        write_whole(remembered, json.dumps(versions, indent=1))
    return version


def _file_identity(word: str) -> list[str | int]:
    found = shutil.which(word)
    if found is None:
        return [word]
    real = Path(found).resolve()
    status = real.stat()
    return [str(real), status.st_size, status.st_mtime_ns]


def _read_json_object(path: Path) -> dict[str, str]:
    try:
        value = json.loads(path.read_text())
    except (OSError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}


def processor_name() -> str:
    """The processor as its maker calls it, for the provenance of a run."""
    for line in _cpuinfo_lines():
        key, _, value = line.partition(":")
        if key.strip() in {"model name", "Model"} and value.strip():
            return value.strip()
    return platform.processor() or platform.machine()


def _processor_identity() -> str:
    """What `-march=native` depends on: the processor's model and its instruction sets."""
    telling = {
        "vendor_id", "cpu family", "model", "model name", "stepping", "flags",
        "Features", "CPU implementer", "CPU architecture", "CPU variant", "CPU part",
    }  # fmt: skip
    kept = [line for line in _cpuinfo_lines() if line.partition(":")[0].strip() in telling]
    return "\n".join([platform.machine(), platform.processor(), *kept])


def _cpuinfo_lines() -> list[str]:
    """The first processor's block of /proc/cpuinfo; empty where there is no such file."""
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8", errors="replace") as file:
            block: list[str] = []
            for line in file:
                if not line.strip():
                    break
                block.append(line.strip())
            return block
    except OSError:
        return []


def headers_digest(includes: Iterable[Path]) -> str:
    """SHA-256 over the names and contents of every header below the given folders."""
    digest = hashlib.sha256()
    for folder in includes:
        headers = (p for p in folder.rglob("*") if p.suffix in _HEADER_SUFFIXES and p.is_file())
        for path in sorted(headers):
            content = path.read_bytes()
            digest.update(f"{path.relative_to(folder).as_posix()}\0{len(content)}\0".encode())
            digest.update(content)
    return digest.hexdigest()


def _version_of_eigen(folder: Path) -> str:
    """The file that says its version, whole."""
    macros = folder / "Eigen" / "src" / "Core" / "util" / "Macros.h"
    return hashlib.sha256(macros.read_bytes()).hexdigest() if macros.is_file() else ""


def compile_scene(
    source: str,
    *,
    includes: Sequence[Path] | None = None,
    libraries: Sequence[Path] = (),
    links: Sequence[str] = (),
    scalar: str = "double",
    extra_flags: Sequence[str] = (),
    cache: Path | None = None,
    on_compile: Callable[[], None] = lambda: None,
) -> CompiledScene:
    """Compile the C++ text of a scene to a shared library, or find it compiled already.

    `libraries` are folders of headers that others maintain: a version is what distinguishes them.
    `links` are options that name what to link with; `extra_flags` come after the usual ones, and
    those in $HAMOTOR_CXXFLAGS after these.
    `scalar` is what the scene calculates with.

    `on_compile` is called before the compiler starts, and not where it need not.

    Raises ToolError (exit 4) when there is no compiler or when it rejects the text; the message
    then holds its first errors and the path of the source, which is kept.
    """
    includes = default_includes() if includes is None else tuple(includes)
    cache = default_cache() if cache is None else cache
    requirement = requirement_of(scalar, platform.machine())
    compiler = find_compiler(cache, requirement)
    chosen = shlex.split(os.environ.get("HAMOTOR_CXXFLAGS", ""))
    flags = (*flags_for(platform.machine()), *extra_flags, *chosen)
    links = (*links, *(() if requirement is None else requirement.links))
    key = hashlib.sha256(
        json.dumps(
            [
                source,
                headers_digest(includes),
                [(str(folder), _version_of_eigen(folder)) for folder in libraries],
                compiler.command,
                compiler.version,
                [*flags, *links],
                _processor_identity(),
            ]
        ).encode()
    ).hexdigest()
    folder = cache / key
    library, kept_source = folder / "scene.so", folder / "scene.cpp"
    cached = library.is_file()
    compile_s = 0.0
    if cached:
        _mark_as_used(folder)
    else:
        _forget_old_scenes(cache)
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(kept_source, source)
        on_compile()
        started = time.perf_counter()
        _run_compiler(compiler, flags, links, includes, libraries, kept_source, library)
        compile_s = time.perf_counter() - started
    return CompiledScene(
        library=library,
        source=kept_source,
        compiler=compiler.version,
        flags=(*flags, *links),
        processor=processor_name(),
        compile_s=compile_s,
        cached=cached,
    )


def _mark_as_used(folder: Path) -> None:
    # A cache that others may only read serves as well.
    with suppress(OSError):
        os.utime(folder)


def _forget_old_scenes(cache: Path) -> None:
    """Make room for one more: of the scenes in the cache keep those that were used last."""
    ages = []
    # Another process may be tidying up too.
    for source in cache.glob(f"{'[0-9a-f]' * 64}/scene.cpp"):
        with suppress(OSError):
            ages.append((source.parent.stat().st_mtime_ns, source.parent))
    for _, folder in sorted(ages, reverse=True)[_KEPT_SCENES - 1 :]:
        shutil.rmtree(folder, ignore_errors=True)


def _run_compiler(
    compiler: Compiler,
    flags: Sequence[str],
    links: Sequence[str],
    includes: Sequence[Path],
    libraries: Sequence[Path],
    source: Path,
    library: Path,
) -> None:
    command = [*compiler.command, *flags]
    for folder in includes:
        command += ["-I", str(folder)]
    for folder in libraries:
        command += ["-isystem", str(folder)]
    try:
        with whole(library) as unfinished:
            command += ["-o", str(unfinished), str(source), *links]
            answer = subprocess.run(
                command, capture_output=True, text=True, errors="replace", check=False
            )
            if answer.returncode != 0:
                raise ToolError(
                    f"{compiler.command[0]} rejected the compiled scene:\n"
                    f"{_first_errors(answer.stderr)}\n"
                    f"The source is kept in {source}\n"
                    f"The command was: {shlex.join(command)}"
                )
    except OSError as problem:
        raise ToolError(f"could not run {compiler.command[0]}: {problem}") from problem


def _first_errors(output: str) -> str:
    lines = output.strip().splitlines()
    errors = [line for line in lines if "error" in line.lower()]
    return "\n".join("  " + line for line in (errors or lines or ["no message"])[:_ERRORS_SHOWN])
