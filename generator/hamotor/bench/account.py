"""What every benchmark says: on the screen, in a file, of what machine and with which tools."""

from __future__ import annotations

import os
import platform
import sys
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from threading import Lock
from typing import Any, Final

from hamotor import __version__
from hamotor.run.build import default_includes, headers_digest, processor_name
from hamotor.run.report import to_json

_EVERY_S: Final = 10.0
"""Between two lines of progress."""


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


def in_words(seconds: float) -> str:
    """`40 s`, `3 min`."""
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


class Progress:
    """How far something is that takes minutes: a line now and then, with the time that is left."""

    def __init__(self, what: str, total: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._what, self._total, self._clock = what, total, clock
        self._began = self._said = clock()
        self._done = 0.0
        self._lock = Lock()
        say(what)

    def add(self) -> None:
        """One more is done."""
        with self._lock:
            self.at(self._done + 1)

    def at(self, done: float, doing: str = "") -> None:
        """So many of the total are done; `doing`: what comes now."""
        self._done = done
        now = self._clock()
        if now - self._said < _EVERY_S or not 0 < done < self._total:
            return
        self._said = now
        left = (now - self._began) * (self._total - done) / done
        parts = [f"{self._what}: {done / self._total:.0%}", doing, f"about {in_words(left)} left"]
        say(", ".join(filter(None, parts)))


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
