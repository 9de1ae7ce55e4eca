r"""The table that `method = "auto"` reads, from measurements of `bench precision`.

    python -m hamotor.bench.choice P1 P3 P4 magnet planar two_bodies@2 kirchhoff \
        breathing_body rocket

measures these scenes, `NAME@END` to this time (s) instead of the scene's own; accounts that there
are already, `DIR/precision.json`, are taken as they are.  A problem stands for the structure that
its scene has.  Structures that no account covers keep what the table says of them; of several
accounts of one structure the last counts.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hamotor.bench.contest import Extent
from hamotor.bench.precision import COMPILERS, measure
from hamotor.bench.precision_report import by_contestant, meeting
from hamotor.bench.problems import problem
from hamotor.errors import UsageError
from hamotor.run.choice import TABLE
from hamotor.scene import METHODS
from hamotor.scene.methods import ALL
from hamotor.scene.structure import STRUCTURES, structure_of

_KEPT = 4
_EXTENT = Extent(3, 2.0, 0.2, 0.05, False, COMPILERS[:1])
_SPLIT = ("free", "planar", "several", "symmetric", "asymmetric", "field", "parts")
_ORDER_WITHOUT_SPLIT = 4
"""Where a step has to be iterated, order 4 costs hardly more than order 2."""


def tabulated(account: Mapping[str, Any], name: str) -> dict[str, Any]:
    """What one problem of an account says: the cheapest methods of each target, and the cheapest
    steps of those that keep momenta and the symplectic structure.  Times in µs, ns a step."""
    ladders = {
        rows[0]["contestant"]: rows
        for (of, _), rows in by_contestant(account["rows"]).items()
        if of == name
        and rows[0]["family"] == "hamotor"
        and not rows[0]["form"]
        and rows[0]["compiler"].startswith("g++")
    }
    told = account["problems"][name]
    cheapest = {}
    for target in account["targets"]:
        times = [
            (min(row["best_us"] for row in met), method)
            for method, ladder in ladders.items()
            if (met := list(meeting(ladder, target, told["norm"])))
        ]
        cheapest[f"{target:g}"] = [
            {"method": method, "us": us} for us, method in sorted(times)[:_KEPT]
        ]
    measured = problem(name)
    whole = told["end_s"] == measured.simulation.end
    structure = structure_of(measured.scene)
    least = 2 if structure in _SPLIT else _ORDER_WITHOUT_SPLIT
    keeping = {
        m.name for m in METHODS if m.promises & ALL == ALL and (m.order >= least or m.order == 0)
    }
    steps = []
    for method in keeping & ladders.keys():
        rows = [r for r in ladders[method] if r["failure"] is None and (r["steps"] or 0) >= 64]
        if rows:
            steps.append((1e3 * min(r["best_us"] / r["steps"] for r in rows), method))
    return {
        "structure": structure,
        "measured_on": name if whole else f"the first {told['end_s']:g} s of {name}",
        "cheapest": cheapest,
        "preserving": [
            {"method": method, "ns_per_step": ns}
            for ns, method in sorted(steps)[:_KEPT]
            if structure not in ("forced", "rough")
        ],
    }


def main(files: Sequence[str]) -> int:
    """Put these scenes and accounts into the table."""
    if not files:
        raise UsageError("give scenes to measure, or files precision.json of bench precision")
    table: dict[str, Any] = {"structures": {}}
    if TABLE.is_file():
        table = json.loads(TABLE.read_text(encoding="utf-8"))
    for file in files:
        if file.endswith(".json"):
            account = json.loads(Path(file).read_text(encoding="utf-8"))
        else:
            account = measure([problem(file)], _EXTENT, {}, {})
        for name in account["problems"]:
            said = tabulated(account, name)
            structure = said.pop("structure")
            said["processor"] = account["provenance"].get("processor", "")
            table["structures"][structure] = said
            print(f"{structure} ({STRUCTURES[structure]}): measured on {name}")
            for target, entries in said["cheapest"].items():
                print(
                    f"  {target:>6}  "
                    + ", ".join(f"{e['method']} {e['us']:.4g} µs" for e in entries)
                )
            print(
                "  kept    "
                + ", ".join(f"{e['method']} {e['ns_per_step']:.3g} ns" for e in said["preserving"])
            )
    TABLE.write_text(json.dumps(table, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
