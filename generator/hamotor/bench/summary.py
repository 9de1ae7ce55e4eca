"""`hamotor bench`: in about two minutes, what the generated kernels and the steppers are worth."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from dataclasses import replace
from json import dumps
from pathlib import Path
from typing import Any, Final

from hamotor.bench.kernels import bench_kernels
from hamotor.bench.precision import QUICK, measure
from hamotor.bench.precision_report import Best, best
from hamotor.bench.problems import problem
from hamotor.bench.report import best_eigen
from hamotor.bench.solvers import install_peers, peers_here

METHODS: Final = ("taylor", "rk87", "splitting4", "splitting8", "rkmk4")
PROBLEM: Final = "P4"
TARGETS: Final = (1e-4, 1e-8, 1e-12)
_OURS: Final = {"RK4 step": "generated, Rk4"}
"""Who takes part for us, where it is not the kernel by itself."""
_WORDS: Final = {what: f"move a {what}" for what in ("point", "direction", "plane", "line")}


def bench_summary(
    out: Path | None = None, json: bool = False, with_peers: bool = False
) -> dict[str, Any]:
    """Run the quick benchmark of kernels and a few methods on one problem, and say what came out.

    out: where kernels.json and its picture go; None: nowhere.  json: print both accounts on stdout
    instead.  with_peers: as for `bench_precision`.  Returns them.  Raises as both benchmarks do.
    """
    with contextlib.redirect_stdout(io.StringIO()):
        kernels = bench_kernels(out, brief=True)
    if with_peers:
        install_peers()
    gaps: dict[str, str] = {}
    peers = peers_here(gaps)
    precision = measure([problem(PROBLEM)], replace(QUICK, methods=METHODS), peers, gaps)
    account = {"benchmark": "summary", "kernels": kernels, "precision": precision}
    print(dumps(account, indent=1) if json else summary(kernels, precision), flush=True)
    return account


def _ratio(ours: Best | None, theirs: Best) -> str:
    return "-" if ours is None else f"{ours.microseconds / theirs.microseconds:.2f}"


def summary(kernels: Mapping[str, Any], precision: Mapping[str, Any]) -> str:
    """Both accounts in some thirty lines."""
    lines = [
        "Kernels: generated code beside the best Eigen, one operation waiting for the last, double",
        f"  {'':<24}{'generated':>12}{'Eigen':>10}{'ratio':>8}{'error':>10}{'Eigen':>8}",
    ]
    chosen = [r for r in kernels["rows"] if r["mode"] == "latency" and r["scalar"] == "double"]
    for operation in dict.fromkeys(row["operation"] for row in chosen):
        here = [row for row in chosen if row["operation"] == operation]
        ours = [row for row in here if row["contestant"] == _OURS.get(operation, "generated")]
        baseline = best_eigen(here)
        if not ours or baseline is None:
            continue
        fastest = min(ours, key=lambda row: row["ns"])
        theirs = next(row for row in here if row["ns"] == baseline)
        lines.append(
            f"  {_WORDS.get(operation, operation):<24}{fastest['ns']:>9.1f} ns{baseline:>7.1f} ns"
            f"{fastest['ns'] / baseline:>8.2f}{fastest['max_relative_error']:>10.0e}"
            f"{theirs['max_relative_error']:>8.0e}"
        )
    lines += [
        "  below 1 is faster than Eigen; error: the largest, relative, of 1000 inputs, Eigen's;",
        "  exp and log keep their digits at every angle, exp_lean and log_lean take less time",
        "",
    ]
    (name, said), *_ = precision["problems"].items()
    lines.append(
        f"Motion: {said['description']}, {said['end_s']:g} s; what an error at its end costs"
    )
    lines.append(
        f"  {'attitude':<12}{'Hamotor':>10}  {'method':<22}{'public solver':>14}  ratio  which"
    )
    rows = precision["rows"]
    for target in TARGETS:
        our, their = (best(rows, name, target, ours=ours) for ours in (True, False))
        lines.append(
            f"  {target:<5.0e} rad   "
            + (f"{our.microseconds:>7.0f} µs  {our.name:<22}" if our else f"{'-':>10}  {'':<22}")
            + (
                f"{their.microseconds:>11.0f} µs  {_ratio(our, their):>5}  {their.name}"
                if their
                else f"{'-':>14}"
            )
        )
    lines += [
        f"  not compared: {who}: {why}"
        for who, why in precision["not_there"].items()
        if not why.startswith("left out")
    ]
    lines.append(
        f"  below 1 is faster than the fastest public solver; of ours {', '.join(METHODS)} ran"
    )
    before = said["set_up"]
    lines.append(
        f"  before the first step, once: {before['generate_s']:.1f} s to generate,"
        f" {before['compile_s']:.1f} s to compile"
    )
    lines += [
        "",
        "More: ./hamotor bench kernels, steps, precision or stability; each writes its account,",
        "precision also a page to explore. Times are the best of few runs on a machine as busy as",
        "yours is now: read the ratios.",
    ]
    return "\n".join(lines)
