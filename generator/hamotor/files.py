"""Files that are there as a whole or not at all."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Where to write what will be `path`: who reads that sees the old file or all of the new one.

    The name is of this thread of this machine, so that none disturbs another; what a block leaves
    behind that fails is removed.
    """
    writer = f"{os.uname().nodename}-{os.getpid()}-{threading.get_native_id()}"
    unfinished = path.with_name(f".{writer}-{path.name}")
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def write_whole(path: Path, text: str) -> None:
    """Write a text so."""
    with whole(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
