"""How far a run is: a bar on a terminal, otherwise a line now and then.  Always on stderr."""

from __future__ import annotations

import sys
import time
from typing import Protocol, TextIO

_BAR_WIDTH = 24
_QUIET_S = 1.0
_REDRAW_S = 0.1
_LINE_EVERY_S = 10.0


class Progress(Protocol):
    """Told after every chunk of steps; `done` counts steps of the present stage."""

    def note(self, text: str) -> None:
        """Something that takes a while begins."""

    def begin(self, stage: str, total: int) -> None:
        """A stage of `total` steps begins; `stage` is "" or says which one, for people."""

    def advance(self, done: int, stepping_s: float) -> None:
        """`done` steps are taken, `stepping_s` seconds were spent in the stepper alone."""

    def end(self) -> None:
        """The stage is over."""


class NoProgress:
    """Says nothing."""

    def note(self, text: str) -> None:
        """Say nothing."""

    def begin(self, stage: str, total: int) -> None:
        """Say nothing."""

    def advance(self, done: int, stepping_s: float) -> None:
        """Say nothing."""

    def end(self) -> None:
        """Say nothing."""


class PrintedProgress:
    """Shows steps, rate and time left; keeps quiet for a stage shorter than a second."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_terminal = self._stream.isatty()
        self._drawn = 0
        self._stage, self._total, self._begun, self._next = "", 0, 0.0, 0.0

    def note(self, text: str) -> None:
        """Print the text as a line."""
        print(text, file=self._stream, flush=True)

    def begin(self, stage: str, total: int) -> None:
        """Start the clock of a stage."""
        self._stage, self._total = stage, total
        self._begun = time.monotonic()
        self._next = self._begun + (_QUIET_S if self._is_terminal else _LINE_EVERY_S)

    def advance(self, done: int, stepping_s: float) -> None:
        """Draw when it is time to."""
        now = time.monotonic()
        if now < self._next or done <= 0:
            return
        self._next = now + (_REDRAW_S if self._is_terminal else _LINE_EVERY_S)
        rate = done / max(now - self._begun, 1e-9)
        left = (self._total - done) / rate
        text = (
            f"{done / self._total:6.1%}  {_count(done)} of {_count(self._total)} steps  "
            f"{_count(rate)} steps/s  {1e9 * stepping_s / done:.3g} ns/step  {_clock(left)} left"
        )
        if self._stage:
            text = f"{self._stage}: {text}"
        if not self._is_terminal:
            print(text.strip(), file=self._stream, flush=True)
            return
        filled = int(_BAR_WIDTH * done / self._total)
        line = f"[{'█' * filled}{'·' * (_BAR_WIDTH - filled)}] {text}"
        print("\r" + line.ljust(self._drawn), end="", file=self._stream, flush=True)
        self._drawn = len(line)

    def end(self) -> None:
        """Wipe the bar, so that the summary stands alone."""
        if self._drawn:
            print("\r" + " " * self._drawn + "\r", end="", file=self._stream, flush=True)
            self._drawn = 0


def _count(number: float) -> str:
    for unit, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if number >= size:
            return f"{number / size:.3g} {unit}" if number < 999.5 * size else f"{number:.3g}"
    return f"{number:.3g}"


def _clock(seconds: float) -> str:
    whole = int(seconds + 0.5)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60}:{whole % 60:02d} min"
    return f"{whole // 3600}:{whole % 3600 // 60:02d} h"
