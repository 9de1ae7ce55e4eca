"""The code generator: algebra specs in, C++ kernel libraries out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hamotor.codegen.spec import (
    bundled_algebra,
    bundled_algebras,
    bundled_group,
    read_algebra,
)

if TYPE_CHECKING:
    from hamotor.codegen.generation import generate, generate_library, source_files
    from hamotor.codegen.printing import show, table
    from hamotor.codegen.starter import starter_spec

# Loaded on first use: a scene asks for groups and their laws, not for C++ text.
_HOMES = {
    "generate": "hamotor.codegen.generation",
    "generate_library": "hamotor.codegen.generation",
    "source_files": "hamotor.codegen.generation",
    "show": "hamotor.codegen.printing",
    "table": "hamotor.codegen.printing",
    "starter_spec": "hamotor.codegen.starter",
}

__all__ = [
    "bundled_algebra",
    "bundled_algebras",
    "bundled_group",
    "generate",
    "generate_library",
    "read_algebra",
    "show",
    "source_files",
    "starter_spec",
    "table",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'hamotor.codegen' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value
