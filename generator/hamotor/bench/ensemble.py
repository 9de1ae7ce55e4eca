"""`hamotor bench ensemble`: bodies' steps a second in packs of lanes, beside Eigen's one by one.

One C++ program of tests/bench per compiler measures everything in one process, the processor's
peak included: multiply-adds that wait for nothing, in registers of the same width.  A time is the
shortest of many runs, because whatever else the machine does only adds to it.
"""

from __future__ import annotations

import json as json_text
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from hamotor.bench.account import publish, say
from hamotor.bench.kernels import build_program, compilers_here, program_provenance, run_tool
from hamotor.errors import CheckFailed

IN_CACHE: Final = 1024
"""Bodies whose ratio to Eigen and share of the peak the table shows."""
AGREEMENT: Final = 1e-6
"""Of the angular momenta after a second by two ways of Runge and Kutta's method."""

Rows = Sequence[Mapping[str, Any]]


def bench_ensemble(
    out: Path | None = None, json: bool = False, quick: bool = False
) -> dict[str, Any]:
    """Build and run the benchmark of ensembles, some three minutes, and account for it.

    out: where ensemble.json goes; None: nowhere.  json: print the account instead of the table.
    quick: fewer repetitions, no more than 16,384 bodies.  Returns the account.  Raises ToolError
    if a tool is missing or the build fails, CheckFailed if Eigen's bodies move otherwise.
    """
    compilers = compilers_here()
    say(f"building with {' and '.join(compilers)}")
    programs = {c: build_program(c, "ensemble", quick=True) for c in compilers}
    rows: list[dict[str, Any]] = []
    machine: dict[str, Any] = {}
    for compiler, program in programs.items():
        say(f"timing, {compiler}")
        said = json_text.loads(run_tool(str(program), *(["--quick"] if quick else [])))
        rows += account_rows(said, compiler)
        peak = max(said["peak_flops"], machine.get("peak_flops", 0.0))
        machine = {**{k: said[k] for k in ("lanes", "isa", "cores")}, "peak_flops": peak}
    account = {
        "benchmark": "ensemble",
        "quick": quick,
        "unit": "bodies' steps per second, of all threads together",
        "machine": machine,
        "rows": rows,
        "provenance": program_provenance(programs),
    }
    publish(account, table, out=out, as_json=json)
    return account


def account_rows(said: Mapping[str, Any], compiler: str) -> list[dict[str, Any]]:
    """What one program measured.  CheckFailed if its contestants do not do the same."""
    if not said["disagreement"] <= AGREEMENT:
        raise CheckFailed(
            f"hamotor bench: Eigen's bodies differ from ours by {said['disagreement']:.2g} of their"
            " angular momentum after a second; they cannot be compared"
        )
    return [
        {
            **row,
            "compiler": compiler,
            "share_of_peak": row["steps_per_second"]
            * row["flops_per_step"]
            / (said["peak_flops"] * row["threads"]),
        }
        for row in said["rows"]
    ]


def best(rows: Rows, **wanted: Any) -> Mapping[str, Any] | None:
    """The fastest of the rows with these values."""
    found = [row for row in rows if all(row[key] == value for key, value in wanted.items())]
    return max(found, key=lambda row: float(row["steps_per_second"]), default=None)


def table(account: Mapping[str, Any]) -> str:
    """The account for reading: the better compiler of each row."""
    rows, machine = account["rows"], account["machine"]
    lines = [
        (
            f"Million steps a second; {machine['lanes']} lanes ({machine['isa']}),"
            f" peak of one core {machine['peak_flops'] / 1e9:.0f} GFLOP/s"
        ),
        (
            f"  {'':<22}{'method':<23}{'bodies':>9}{'cores':>7}{'steps':>9}{'FLOP':>7}"
            f"{'of peak':>9}{'Eigen':>8}{'ratio':>7}"
        ),
    ]
    seen = dict.fromkeys(
        (row["problem"], row["method"], row["bodies"], row["threads"])
        for row in rows
        if row["contestant"] == "packs"
    )
    for problem, method, bodies, threads in seen:
        case = {"problem": problem, "method": method}
        row = best(rows, **case, contestant="packs", bodies=bodies, threads=threads)
        eigen = best(rows, problem=problem, contestant="Eigen")
        assert row is not None
        text = (
            f"  {problem:<22}{method:<23}{bodies:>9}{threads:>7}"
            f"{row['steps_per_second'] / 1e6:>9.1f}{row['flops_per_step']:>7.0f}"
            f"{row['share_of_peak']:>9.0%}"
        )
        if eigen is not None and (method, bodies) == ("rk4", IN_CACHE):
            rate = eigen["steps_per_second"]
            text += f"{rate / 1e6:>8.1f}{row['steps_per_second'] / rate:>7.1f}"
        lines.append(text)
    lines += [
        *scaling(rows),
        "  FLOP: operations of a step, counted, a multiply-add as two, of which a peak is made up;",
        "  Eigen: the same by quaternion and vectors, an array of structures, the best compiler.",
        "  Shortest times on a machine as busy as yours is now: read the ratios.",
    ]
    return "\n".join(lines)


def scaling(rows: Rows) -> list[str]:
    """What more bodies and more cores cost each method that was measured so."""
    lines = []
    for problem, method in dict.fromkeys((row["problem"], row["method"]) for row in rows):
        case = {"problem": problem, "method": method, "contestant": "packs"}
        ours = [row for row in rows if all(row[k] == v for k, v in case.items())]
        many = max((row["bodies"] for row in ours), default=0)
        cores = max((row["threads"] for row in ours), default=1)
        near = best(ours, bodies=IN_CACHE, threads=1)
        far = best(ours, bodies=many, threads=1)
        all_cores = best(ours, bodies=many, threads=cores)
        if near is None or far is None or all_cores is None or cores == 1:
            continue
        kept = far["steps_per_second"] / near["steps_per_second"]
        efficiency = all_cores["steps_per_second"] / (cores * far["steps_per_second"])
        lines.append(
            f"  {problem}, {method}: {many} bodies at {kept:.0%} of the rate of {IN_CACHE};"
            f" {cores} cores at {efficiency:.0%} each"
        )
    return lines
