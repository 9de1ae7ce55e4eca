"""What a benchmark of runs says: on the screen, in a file, and of what machine."""

from __future__ import annotations

import platform
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from hamotor import __version__
from hamotor.run.build import processor_name
from hamotor.run.report import to_json


def provenance() -> dict[str, str]:
    """The version of Hamotor, the processor and its architecture."""
    return {
        "version": __version__,
        "processor": processor_name(),
        "machine": platform.machine(),
    }


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
        print(f"wrote {file}", file=sys.stderr, flush=True)
