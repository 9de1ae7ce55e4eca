"""What `hamotor bench ensemble` makes of what its programs say."""

from __future__ import annotations

from pathlib import Path
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
        "slots_per_step": 0 if contestant == "Eigen" else 250,
        "products_per_step": 240,
        "peak_flops": 1e11,
        "peak_mixed": 5e10,
    }


def said(*rows: dict[str, Any], disagreement: float = 1e-9) -> dict[str, Any]:
    return {"peak_flops": 1e11, "disagreement": disagreement, "rows": list(rows)}


def test_ratios_are_of_the_better_compilers() -> None:
    more = {"flops_per_step": 510, "slots_per_step": 260, "products_per_step": 250}
    ours = ensemble.account_rows(
        {
            "g++": said(
                row("packs", 1024, 1, 100) | more,
                row("packs", 1048576, 1, 80) | more,
                row("Eigen", 1024, 1, 4),
            ),
            "clang++": said(
                row("packs", 1024, 1, 90), row("packs", 1048576, 2, 152), row("Eigen", 64, 1, 5)
            ),
        }
    )
    machine = {"lanes": 8, "isa": "avx512", "cores": 2, "peak_flops": 1e11}
    theirs = row("JAX", 16384, 1, 20) | {"angular": [1, 2, 3]}
    account = {
        "rows": [*ours, theirs],
        "machine": machine,
        "tuned": {"JAX": "tuned"},
        "gaps": {"mujoco": "not installed: command"},
    }
    text = ensemble.table(account)
    (line,) = [x for x in text.splitlines() if x.split()[2:3] == ["1024"]]
    assert line.split()[4:] == ["100.0", "500", "50%", "200", "5.0", "20.0"]
    assert "JAX, spring, rk4: 20 million with 16384 bodies; ours is 5.0 times as fast" in text
    assert "mujoco: not installed: command" in text
    assert "1048576 bodies at 80% of the rate of 1024; 2 cores at 95% each" in text


def test_additions_with_units_of_their_own_do_not_bound() -> None:
    found = row("packs", 1024, 2, 100)
    shared = ensemble.bound(found)
    apart = ensemble.bound(found | {"peak_mixed": 1e11})
    assert shared == pytest.approx(2 * 5e10 / 250)
    assert apart == pytest.approx(2 * 5e10 / 240)


def test_bodies_that_move_otherwise_are_not_compared() -> None:
    with pytest.raises(CheckFailed, match="cannot be compared"):
        ensemble.account_rows({"g++": said(row("packs", 64, 1, 1), disagreement=1e-3)})


def test_peers_that_move_otherwise_are_not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    found = row("JAX", 1024, 1, 10) | {"angular": [1.0, 2.0, 3.1]}
    monkeypatch.setattr(ensemble, "_peers", lambda *_: {"rows": [found]})
    kept = ensemble.peer_rows({"jax": "1"}, {"spring": [1, 2, 3.101]}, {}, quick=True)
    assert [x["contestant"] for x in kept] == ["JAX", "JAX"]
    with pytest.raises(CheckFailed, match=r"JAX's bodies .* cannot be compared"):
        ensemble.peer_rows({"jax": "1"}, {"spring": [1, 2, 4]}, {}, quick=True)


def test_a_peer_that_is_not_there_says_what_installs_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(ensemble, "PEERS_PYTHON", tmp_path / "python")
    gaps: dict[str, str] = {}
    assert ensemble.peers_here(gaps) == {}
    assert gaps == dict.fromkeys(("jax", "mujoco"), f"not installed: {ensemble.INSTALL}")
