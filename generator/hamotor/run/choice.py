"""`method = "auto"`: the cheapest method that was measured on scenes of the same structure.

`choice.json` is written by `python -m hamotor.bench.choice` from accounts of `bench precision`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from hamotor.run.library import check_method

TABLE = Path(__file__).with_name("choice.json")

_PRESERVING = {
    "splitting2": (
        "it keeps every coadjoint orbit exactly and its energy error does not grow over long runs"
    ),
}
_FALLBACKS = ("splitting2", "rkmk4")
_ROUGH = "rk54", "it chooses its steps, so that it can shorten them at corners; not measured"


@cache
def _table() -> Any:
    return json.loads(TABLE.read_text(encoding="utf-8"))


def choose_method(
    asked: str,
    methods: Mapping[str, int],
    tolerance: float | None = None,
    structure: str = "",
) -> tuple[str, str]:
    """The method to use, and why if the choice was ours (`auto`).  UsageError if unknown.

    `structure` is one of `hamotor.scene.structure.STRUCTURES`; of an unknown one nothing is
    measured.
    """
    if asked != "auto":
        check_method(asked, {**methods, "auto": 0})
        return asked, ""
    structures = _table()["structures"]
    found = None
    if tolerance is None and structure in structures:
        found = _preserving(structures[structure], methods)
    elif tolerance is not None and structure == "rough" and _ROUGH[0] in methods:
        found = _ROUGH
    elif tolerance is not None and structure in structures:
        found = _cheapest(structures[structure], methods, tolerance)
    if found is not None:
        return found
    for name in _FALLBACKS:
        if name in methods:
            return name, _PRESERVING.get(name, "nothing cheaper was measured on such scenes")
    only = next(iter(methods))
    return only, "it is what this scene offers"


def _preserving(measured: Any, methods: Mapping[str, int]) -> tuple[str, str] | None:
    for entry in measured["preserving"]:
        name = entry["method"]
        if name in methods:
            default = (
                f"it keeps momenta and the symplectic structure, and of such methods its steps "
                f"were the cheapest on {measured['measured_on']}"
            )
            return name, _PRESERVING.get(name, default)
    return None


def _cheapest(
    measured: Any, methods: Mapping[str, int], tolerance: float
) -> tuple[str, str] | None:
    """The first method of the nearest target below the tolerance, or of the smallest one."""
    targets = sorted(measured["cheapest"], key=float, reverse=True)
    for target in [t for t in targets if float(t) <= tolerance * 1.0001] or targets[-1:]:
        offered = [entry for entry in measured["cheapest"][target] if entry["method"] in methods]
        if offered:
            first = offered[0]
            reason = (
                f"it reached {target} on {measured['measured_on']} in the least time, "
                f"{first['us']:.3g} µs"
            )
            if len(offered) > 1:
                reason += f", before {offered[1]['method']} with {offered[1]['us']:.3g} µs"
            return first["method"], reason
    return None
