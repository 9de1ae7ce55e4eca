"""What every benchmark says: on the screen, in a file, of what machine and with which tools."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from hamotor import __version__
from hamotor.run.build import default_includes, headers_digest, processor_name
from hamotor.run.report import to_json


def provenance(**more: Any) -> dict[str, Any]:
    """Hamotor and its headers, the machine with what else it does, the date; and `more`."""
    return {
        "version": __version__,
        "headers": headers_digest(default_includes()),
        "date": now_in_words(),
        "python": platform.python_version(),
        "system": platform.system(),
        "machine": platform.machine(),
        "processor": processor_name(),
        "processors": os.cpu_count(),
        "load": list(os.getloadavg()),
        **more,
    }


def now_in_words() -> str:
    """Date and time of day, UTC, to a second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def say(text: str) -> None:
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)


def write_whole(file: Path, text: str) -> None:
    """Write a file so that whoever reads it sees the old text or the new one."""
    unfinished = file.with_name(f".{os.getpid()}-{file.name}")
    unfinished.write_text(text, encoding="utf-8")
    unfinished.replace(file)


def publish(
    account: Mapping[str, Any],
    table: Callable[[Mapping[str, Any]], str],
    *,
    out: Path | None,
    as_json: bool,
) -> None:
    """Print the account, as a table or as JSON, and write it to `out`/BENCHMARK.json if given."""
    text = to_json(account)
    print(text if as_json else table(account), flush=True)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        file = out / f"{account['benchmark']}.json"
        file.write_text(text, encoding="utf-8")
        say(f"wrote {file}")
