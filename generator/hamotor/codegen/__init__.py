"""The code generator: algebra specs in, C++ kernel libraries out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hamotor.codegen import tree
from hamotor.codegen.compiler import SourceFile, compile_algebra
from hamotor.codegen.show import show, table
from hamotor.codegen.spec import AlgebraSpec, bundled_algebras, bundled_path, read_algebra

__all__ = ["bundled_algebras", "generate", "read_algebra", "show", "source_files", "table"]


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
