"""What `hamotor bench ensemble` makes of what its programs say."""

from __future__ import annotations

from typing import Any

import pytest

from hamotor.bench import ensemble
from hamotor.errors import CheckFailed


def row(contestant: str, bodies: int, threads: int, million: float) -> dict[str, Any]:
    return {
        "problem": "spring",
        "method": "rk4",
        "contestant": contestant,
        "bodies": bodies,
        "threads": threads,
        "steps_per_second": 1e6 * million,
        "flops_per_step": 500,
    }


def said(*rows: dict[str, Any], disagreement: float = 1e-9) -> dict[str, Any]:
    return {"peak_flops": 1e11, "disagreement": disagreement, "rows": list(rows)}


def test_ratios_are_of_the_better_compilers() -> None:
    one = ensemble.account_rows(
        said(row("packs", 1024, 1, 100), row("packs", 1048576, 1, 80), row("Eigen", 1024, 1, 4)),
        "g++",
    )
    other = ensemble.account_rows(
        said(row("packs", 1024, 1, 90), row("packs", 1048576, 2, 152), row("Eigen", 64, 1, 5)),
        "clang++",
    )
    machine = {"lanes": 8, "isa": "avx512", "cores": 2, "peak_flops": 1e11}
    text = ensemble.table({"rows": [*one, *other], "machine": machine})
    (line,) = [x for x in text.splitlines() if x.split()[2:3] == ["1024"]]
    assert line.split()[4:] == ["100.0", "500", "50%", "5.0", "20.0"]
    assert "1048576 bodies at 80% of the rate of 1024; 2 cores at 95% each" in text


def test_bodies_that_move_otherwise_are_not_compared() -> None:
    with pytest.raises(CheckFailed, match="cannot be compared"):
        ensemble.account_rows(said(row("packs", 64, 1, 1), disagreement=1e-3), "g++")
