"""Generated libraries on disk: what differs from the specs, and what is written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hamotor.codegen import tree
from hamotor.codegen.compiler import SourceFile, compile_algebra
from hamotor.codegen.spec import (
    AlgebraSpec,
    bundled_algebras,
    bundled_path,
    parse_algebra,
    read_algebra,
)
from hamotor.codegen.standalone import standalone_files
from hamotor.errors import UsageError


def source_files(specs: Sequence[AlgebraSpec]) -> tuple[SourceFile, ...]:
    """Every generated file of these algebras, formatted."""
    return tree.formatted([file for spec in specs for file in compile_algebra(spec)])


def generate(
    names: Sequence[str] = (), *, check: bool = False, out: Path | None = None
) -> list[tree.Difference]:
    """Write the libraries of bundled algebras (all by default), or only say what would change.

    check: write nothing.  out: another folder than the committed `generated/`.
    Returns how the folder differed: stale, missing or orphaned files; empty if it was up to date.
    Raises UsageError for an unknown name or a spec with an error in it.
    """
    chosen = list(names) or bundled_algebras()
    specs = [read_algebra(bundled_path(name)) for name in chosen]
    files = source_files(specs)
    folder = out or tree.GENERATED
    owned = ["."] if not names and out is None else [f"hamotor/{name}" for name in chosen]
    return (tree.differences if check else tree.write)(files, folder, owned)


def generate_library(
    spec_text: str, file: str, out: Path, *, check: bool = False
) -> list[tree.Difference]:
    """Write the library of any spec as a folder of its own: headers, CMake target, test.

    file: what the spec is called in messages.  out: the folder; a folder that holds anything but an
    earlier library of the same algebra is refused.  check: write nothing.
    Returns how the folder differed.  Raises UsageError for a spec with an error in it.
    """
    spec = parse_algebra(spec_text, file)
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out}: is not a folder")
    marker = out / f"{spec.name}.toml"
    if not marker.is_file() and any(not path.is_dir() for path in out.rglob("*")):
        raise UsageError(
            f"{out}: holds files that are not a library of {spec.name}; name an empty folder"
        )
    files = tree.formatted(standalone_files(spec, spec_text))
    return (tree.differences if check else tree.write)(files, out, ["include/hamotor", "test"])
