"""What reading a scene gave, kept: deriving equations takes SymPy a second that no second run owes.

The key is the SHA-256 of the scene's text and of the state of this package's files, so that a
change of either derives again.
"""

from __future__ import annotations

import hashlib
import json
import re
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from hamotor.files import write_whole

GENERATOR = Path(__file__).resolve().parents[2]
DERIVING = (
    GENERATOR / "hamotor",
    GENERATOR / "algebras",
    GENERATOR.parent / "templates",
)
"""The folders whose files decide what is derived."""
MOST_KEPT = 200
_ONE_AT_A_TIME = threading.RLock()  # mpmath has one precision for all threads


_OWN_ALGEBRA = re.compile(rb"""^\s*algebra\s*=\s*["']([^"'\n]+\.toml)["']""", re.MULTILINE)


def key_of(contents: bytes, name: str, folder: Path) -> str:
    """Where a scene of this text and name is kept; `folder` is where its file lies."""
    digest = hashlib.sha256(b"%d\0" % len(contents) + contents + name.encode())
    if own := _OWN_ALGEBRA.search(contents):
        with suppress(OSError, ValueError):
            digest.update((folder / own[1].decode()).read_bytes())
    for deriving in DERIVING:
        for path in sorted(deriving.rglob("*")):
            if path.suffix in {".py", ".toml", ".jinja"}:
                status = path.stat()
                place = path.relative_to(GENERATOR.parent).as_posix()
                digest.update(f"{place}\0{status.st_size}\0{status.st_mtime_ns}\n".encode())
    return digest.hexdigest()


class Remembered:
    """A JSON object in the cache under one key; a cache that cannot be used is no error."""

    def __init__(self, folder: Path, key: str) -> None:
        self._path = folder / "scenes" / f"{key}.json"
        self._values: dict[str, Any] = {}
        with suppress(OSError, ValueError):
            found = json.loads(self._path.read_text(encoding="utf-8"))
            self._values = found if isinstance(found, dict) else {}

    def value(self, name: str, derive: Callable[[], Any]) -> Any:
        """What is kept under `name`, or else what `derive` says, kept from now on."""
        with _ONE_AT_A_TIME:
            if name not in self._values:
                self._values[name] = derive()
                self._write()
            return self._values[name]

    def _write(self) -> None:
        with suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(self._path, json.dumps(self._values))
            kept = sorted(self._path.parent.glob("*.json"), key=lambda p: p.stat().st_mtime)
            for old in kept[:-MOST_KEPT]:
                old.unlink(missing_ok=True)
