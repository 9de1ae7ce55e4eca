"""The algebra of a scene: a bundled one, or a spec of the user's own with the headers it needs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from hamotor.errors import UsageError
from hamotor.scene.groups import Group, bundled_groups, groups_in

if TYPE_CHECKING:
    from hamotor.codegen.compiler import SourceFile
    from hamotor.codegen.spec import AlgebraSpec, Request


@dataclass(frozen=True)
class SceneAlgebra:
    """An algebra that a scene is compiled over.

    headers: to lie in a folder of includes; none for a bundled algebra, whose headers are in
        `generated/`.
    """

    spec: AlgebraSpec
    groups: tuple[Group, ...]
    headers: tuple[SourceFile, ...]


def scene_algebra(where: str | Path, requests: Sequence[Request] = ()) -> SceneAlgebra:
    """The bundled algebra of that name, or that of a spec file (a path, or a name with `.toml`).

    For a spec file only what stepping needs is generated: the types that hold its groups, with
    product, reverse and the way back to the group, and the groups' own functions; and what
    `requests` names, with its types.  Raises UsageError for a spec with an error in it and for an
    algebra whose name is taken.
    """
    from hamotor.codegen.spec import bundled_algebra, bundled_algebras, read_algebra

    if not str(where).endswith(".toml"):
        return SceneAlgebra(bundled_algebra(str(where)), bundled_groups(str(where)), ())
    spec = read_algebra(Path(where))
    if spec.name in bundled_algebras():
        raise UsageError(f'{spec.file}: "name" = "{spec.name}" is taken; choose another')
    if not spec.groups:
        raise UsageError(f"{spec.file}: has no group, so that nothing can move; add a [[group]]")
    return SceneAlgebra(spec, groups_in(spec), stepping_headers(spec, requests))


def stepping_headers(spec: AlgebraSpec, requests: Sequence[Request] = ()) -> tuple[SourceFile, ...]:
    """The headers that stepping on the spec's groups needs, and those requests; unformatted."""
    from hamotor.codegen.compiler import compile_algebra

    used = {"Scalar", *(group.element.name for group in spec.groups)}
    for request in requests:
        used |= {*request.operands, *([request.result] if request.result else [])}
    elements = {name: element for name, element in spec.elements.items() if name in used}
    small = replace(spec, elements=elements, requests=tuple(requests))
    return tuple(f for f in compile_algebra(small) if f.path.endswith(".hpp"))


def in_one_text(headers: Sequence[SourceFile]) -> tuple[str, ...]:
    """The headers' texts, without each other's includes, in an order for one file."""
    texts = {header.path: header.text for header in headers}
    includes = re.compile(r'^#include "([^"]+)"\n', re.MULTILINE)
    done: list[str] = []

    def add(path: str) -> None:
        if path in done:
            return
        for needed in includes.findall(texts[path]):
            if needed in texts:
                add(needed)
        done.append(path)

    for path in texts:
        add(path)

    def without_own_includes(text: str) -> str:
        kept = includes.sub(lambda found: "" if found[1] in texts else found[0], text)
        return kept.replace("#pragma once\n", "")

    return tuple(without_own_includes(texts[path]) for path in done)
