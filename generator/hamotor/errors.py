"""The exceptions Hamotor raises on purpose, each with the exit code its command ends with."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import ClassVar


class HamotorError(Exception):
    """What went wrong, in one message: what, where, what is allowed, and what to do."""

    exit_code: ClassVar[int] = 1


class CheckFailed(HamotorError):
    """A check ran and found a difference (stale generated files, a failed comparison)."""

    exit_code = 1


class UsageError(HamotorError):
    """Bad usage or bad input: an unknown option, a scene or a spec with a mistake in it."""

    exit_code = 2


class NumericsError(HamotorError):
    """The numbers failed (not finite, not converging); what was computed before is kept."""

    exit_code = 3


class ToolError(HamotorError):
    """A tool is missing, or compilation failed."""

    exit_code = 4


def suggest(word: str, allowed: Iterable[str]) -> str:
    """The end of an error message: ` Did you mean "top"?` for the allowed word closest to `word`.

    Case does not count. Empty where nothing allowed is close.
    """
    by_folded = {candidate.casefold(): candidate for candidate in allowed}
    close = difflib.get_close_matches(word[:100].casefold(), by_folded, n=1)
    return f' Did you mean "{by_folded[close[0]]}"?' if close else ""
