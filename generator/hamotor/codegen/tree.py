"""The only part of the code generator that touches the disk: format, compare, write."""

from __future__ import annotations

import os
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


def formatted(files: Sequence[SourceFile]) -> tuple[SourceFile, ...]:
    """The files as clang-format leaves them, in the project's style."""
    headers = [f for f in files if f.path.endswith((".hpp", ".cpp"))]
    tool = Path(sys.executable).with_name("clang-format")
    with tempfile.TemporaryDirectory() as folder:
        names = []
        for index, file in enumerate(headers):
            path = Path(folder) / f"{index}.cpp"
            path.write_text(file.text, encoding="utf-8")
            names.append(str(path))
        command = [str(tool), f"--style=file:{ROOT / '.clang-format'}", "-i"]
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            largest_first = sorted(names, key=lambda name: -Path(name).stat().st_size)
            list(pool.map(lambda name: _run([*command, name]), largest_first))
        texts = {
            f.path: Path(n).read_text(encoding="utf-8") for f, n in zip(headers, names, strict=True)
        }
    return tuple(SourceFile(f.path, texts.get(f.path, f.text)) for f in files)


def _run(command: Sequence[str]) -> None:
    try:
        subprocess.run(command, check=True, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError) as error:
        detail = error.stderr if isinstance(error, subprocess.CalledProcessError) else error
        raise ToolError(
            f"clang-format failed: {detail}; remove .hamotor/venv and run ./hamotor again"
        ) from error


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
