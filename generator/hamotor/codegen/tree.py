"""The only part of the code generator that touches the disk: format, compare, write."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from hamotor.codegen.compiler import SourceFile
from hamotor.errors import ToolError

ROOT = Path(__file__).resolve().parents[3]
GENERATED = ROOT / "generated"


@dataclass(frozen=True)
class Difference:
    """How one file on disk differs from what the generator writes: stale, missing or orphaned."""

    kind: str
    path: str


ROOM = 40_000
"""Characters that are formatted at a time: several processes share a long file."""
COMPONENT = re.compile(r"(?<=[(,] )-?[a-z]\w*\.\w+(?=[,)])|(?<=\()-?[a-z]\w*\.\w+(?=[,)])")
"""An argument such as `-a.e12`: four tokens, over which clang-format weighs as many line breaks."""
LONG = 3_000
"""Characters of a statement from which on it is given a shorter look."""
STAND_IN = re.compile(r"\$z+")
LIST = re.compile(r"(?<=\bdot\()[^()]{260,}(?=\))")
"""Arguments of a call that fill many lines: which words each holds needs no weighing."""
LIST_STAND_IN = "$" + 74 * "y"
WIDTH = 100


def formatted(files: Sequence[SourceFile]) -> tuple[SourceFile, ...]:
    """The files as clang-format leaves them, in the project's style.

    Of the longest statements, those some of six dimensions, it sees fewer tokens than there
    are, over which it would take most of the time.
    """
    sources = {f.path: _pieces(f.text) for f in files if f.path.endswith((".hpp", ".cpp"))}
    longest_first = sorted((p for pieces in sources.values() for p in pieces), key=len)[::-1]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = dict(zip(longest_first, pool.map(_formatted, longest_first), strict=True))
    texts = {path: "\n".join(found[p] for p in pieces) for path, pieces in sources.items()}
    return tuple(SourceFile(f.path, texts.get(f.path, f.text)) for f in files)


def _pieces(text: str) -> list[str]:
    """The text, cut before documented declarations: their layout does not depend on each other."""
    first, *others = text.split("\n\n/// ")
    pieces = [first]
    for other in others:
        if len(pieces[-1]) + len(other) > ROOM:
            pieces.append(f"/// {other}")
        else:
            pieces[-1] += f"\n\n/// {other}"
    return [*(f"{piece}\n" for piece in pieces[:-1]), pieces[-1]]


def _formatted(text: str) -> str:
    """One piece; where it is long clang-format sees one word for a list that fills lines, and one
    of equal length for every other component.
    """
    if max(map(len, text.split(";"))) < LONG:
        return clang_format(text)
    lists = LIST.findall(text)
    short = LIST.sub(lambda _: LIST_STAND_IN, text)
    shown = COMPONENT.sub(lambda found: "$".ljust(len(found[0]), "z"), short)
    components = COMPONENT.finditer(short)
    before, *others = clang_format(shown).split(LIST_STAND_IN)
    done = [before]
    for arguments, after in zip(lists, others, strict=True):
        column = len(done[-1]) - done[-1].rfind("\n") - 1
        done += [_filled(arguments, column, after.partition("\n")[0]), after]
    return STAND_IN.sub(lambda _: next(components)[0], "".join(done))


def _filled(arguments: str, column: int, after: str) -> str:
    """A list of arguments that begins in this column, in as few lines as hold it and what comes
    after.
    """
    words = [f"{word}," for word in re.split(r",\s*", arguments.strip())]
    words[-1] = words[-1][:-1]
    text, at = words[0], column + len(words[0])
    for word in words[1:]:
        tail = len(after) if word is words[-1] else 0
        if at + 1 + len(word) + tail > WIDTH:
            text += f"\n{' ' * column}{word}"
            at = column + len(word)
        else:
            text += f" {word}"
            at += 1 + len(word)
    return text


def clang_format(text: str) -> str:
    """C++ text in the project's style.  Raises ToolError where the tool cannot be run."""
    tool = Path(sys.executable).with_name("clang-format")
    command = [str(tool), f"--style=file:{ROOT / '.clang-format'}"]
    try:
        done = subprocess.run(
            command, input=text, check=True, capture_output=True, encoding="utf-8"
        )
    except (OSError, subprocess.CalledProcessError) as error:
        detail = error.stderr if isinstance(error, subprocess.CalledProcessError) else error
        raise ToolError(
            f"clang-format failed: {detail}; remove .hamotor/venv and run ./hamotor again"
        ) from error
    return done.stdout


def differences(
    files: Iterable[SourceFile], folder: Path, owned: Iterable[str]
) -> list[Difference]:
    """What `folder` holds that differs from `files`.

    owned: the subfolders in which every file must be one of `files`; others there are orphans.
    """
    wanted = {file.path: file.text for file in files}
    found: list[Difference] = []
    for path, text in wanted.items():
        target = folder / path
        if not target.is_file():
            found.append(Difference("missing", path))
        elif target.read_bytes() != text.encode():
            found.append(Difference("stale", path))
    for subfolder in owned:
        for target in sorted((folder / subfolder).rglob("*")):
            path = target.relative_to(folder).as_posix()
            if target.is_file() and path not in wanted:
                found.append(Difference("orphaned", path))
    return sorted(found, key=lambda d: d.path)


def write(files: Iterable[SourceFile], folder: Path, owned: Iterable[str]) -> list[Difference]:
    """Make `folder` hold exactly `files` in the owned subfolders; returns what was changed."""
    files = list(files)
    changed = differences(files, folder, owned)
    texts = {file.path: file.text for file in files}
    for difference in changed:
        target = folder / difference.path
        if difference.kind == "orphaned":
            target.unlink()
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=target.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.write(texts[difference.path].encode())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(target)
    return changed
