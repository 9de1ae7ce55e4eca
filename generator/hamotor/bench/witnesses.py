"""Runs of ours beside the references of digits, kept with them.

    python -m hamotor.bench.witnesses [PROBLEM…]

holds the references of the benchmark's own problems (all, or these) against other methods and other
precisions, and writes by how much they differ to `tests/references/witnesses`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence

from hamotor.bench.problems import (
    REFERENCES,
    WITNESSES,
    in_words,
    kept_text,
    own_problems,
    problem,
    witnesses_of,
)
from hamotor.files import write_whole


def main(names: Sequence[str]) -> int:
    """Make them anew, unless the cache has them, and print what came out."""
    WITNESSES.mkdir(exist_ok=True)
    for name in names or own_problems():
        kept = WITNESSES / f"{name}.json"
        kept.unlink(missing_ok=True)
        said = json.loads((REFERENCES / f"{name}.json").read_text(encoding="utf-8"))
        key, witnesses = witnesses_of(problem(name), said)
        write_whole(kept, kept_text(key, witnesses))
        print(f"{name}: {in_words(witnesses)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
