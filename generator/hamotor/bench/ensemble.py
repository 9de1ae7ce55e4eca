"""`hamotor bench ensemble`: bodies' steps a second in packs of lanes, beside Eigen's one by one.

One C++ program of tests/bench per compiler measures everything in one process, the processor's
peak included, beside each row, for clocks change: multiply-adds that wait for nothing, in registers
of the same width.  A time is the shortest of many runs, because whatever else the machine does only
adds to it.  JAX and MuJoCo,
where they are installed, step the same bodies on one core in processes of their own.
"""

from __future__ import annotations

import json as json_text
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from hamotor.bench.account import publish, say
from hamotor.bench.kernels import build_program, compilers_here, program_provenance, run_tool
from hamotor.bench.problems import ROOT
from hamotor.bench.solvers import install_peers
from hamotor.errors import CheckFailed, ToolError

IN_CACHE: Final = 1024
"""Bodies whose ratio to Eigen and share of the peak the table shows."""
AGREEMENT: Final = 1e-6
"""Of the angular momenta after a second by two ways of Runge and Kutta's method."""

PEERS: Final[Mapping[str, Sequence[Sequence[str]]]] = {
    "jax": (("jax", "256"), ("jax", "512")),
    "mujoco": (("mujoco",),),
}
"""The package of each, and with what words tests/bench/ensemble_peers.py is started."""
PEERS_PYTHON: Final = ROOT / ".hamotor" / "peers" / "ensembles" / "bin" / "python"
INSTALL: Final = "./hamotor bench ensemble --with-peers"
PEERS_AGREEMENT: Final = 1e-2
"""The same of other methods: MuJoCo's is of order 2 in the attitude, as is a splitting."""
TUNED: Final[Mapping[str, str]] = {
    "JAX": "the same formulas in float64, an array for each number of all bodies, all steps in one "
    "jit, one thread, the better of registers of 256 and 512 bits",
    "MuJoCo": "RK4 by rollout, one thread, a ball or free joint, a tendon for the spring, contacts "
    "and constraints off",
}
"""How it is done that nobody is slower than it need be."""

Rows = Sequence[Mapping[str, Any]]


def bench_ensemble(
    out: Path | None = None, json: bool = False, quick: bool = False, with_peers: bool = False
) -> dict[str, Any]:
    """Build and run the benchmark of ensembles, some three minutes, and account for it.

    out: where ensemble.json goes; None: nowhere.  json: print the account instead of the table.
    quick: fewer repetitions, no more than 16,384 bodies.  with_peers: first install JAX and MuJoCo
    from PyPI, in an environment of their own.  Returns the account.  Raises ToolError
    if a tool is missing or the build fails, CheckFailed if others' bodies move otherwise.
    """
    if with_peers:
        install_peers("ensembles")
    compilers = compilers_here()
    say(f"building with {' and '.join(compilers)}")
    programs = {c: build_program(c, "ensemble", quick=True) for c in compilers}
    found = {}
    for compiler, program in programs.items():
        say(f"timing, {compiler}")
        found[compiler] = json_text.loads(run_tool(str(program), *(["--quick"] if quick else [])))
    rows = account_rows(found)
    said = next(iter(found.values()))
    machine = {
        **{k: said[k] for k in ("lanes", "isa", "cores")},
        "peak_flops": max(x["peak_flops"] for x in found.values()),
    }
    angular = said["angular"]
    gaps: dict[str, str] = {}
    versions = peers_here(gaps)
    rows += peer_rows(versions, angular, gaps, quick=quick)
    account = {
        "benchmark": "ensemble",
        "quick": quick,
        "unit": "bodies' steps per second, of all threads together",
        "machine": machine,
        "rows": rows,
        "gaps": gaps,
        "tuned": TUNED,
        "provenance": {**program_provenance(programs), "peers": versions},
    }
    publish(account, table, out=out, as_json=json)
    return account


def account_rows(found: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """What the program of each compiler measured.

    CheckFailed if its contestants do not do the same.
    """
    rows = []
    for compiler, said in found.items():
        if not said["disagreement"] <= AGREEMENT:
            raise CheckFailed(
                f"hamotor bench: Eigen's bodies differ from ours by {said['disagreement']:.2g} of "
                "their angular momentum after a second; they cannot be compared"
            )
        rows += [{**row, "compiler": compiler} for row in said["rows"]]
    return [_shares(row | _least_counts(row, rows)) for row in rows]


def _least_counts(row: Mapping[str, Any], rows: Rows) -> dict[str, float]:
    """A step's operations: those of the compiler that knows most of what is always the same."""
    same = ("problem", "method", "contestant")
    alike = [other for other in rows if all(other[key] == row[key] for key in same)]
    counts = ("flops_per_step", "slots_per_step", "products_per_step")
    return {count: min(other[count] for other in alike) for count in counts}


def _shares(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row's counts, its share of the peak and its bound."""
    peak = row["peak_flops"] * row["threads"]
    return {
        **row,
        "share_of_peak": row["steps_per_second"] * row["flops_per_step"] / peak,
        "bound": bound(row),
    }


def bound(row: Mapping[str, Any]) -> float | None:
    """Steps a second if the processor started an instruction wherever it can.

    Where additions have units of their own those that multiply take longest (these steps have more
    of them), elsewhere it is all of them together.  None where instructions were not counted.
    """
    if not row["slots_per_step"]:
        return None
    multiplying = row["products_per_step"] / (row["peak_flops"] / 2)
    starting = row["slots_per_step"] / row["peak_mixed"]
    return float(row["threads"] / max(multiplying, starting))


def _peers(*words: str) -> Any:
    """What tests/bench/ensemble_peers.py says.  ToolError if it fails."""
    return json_text.loads(run_tool(str(PEERS_PYTHON), "-m", "tests.bench.ensemble_peers", *words))


def peers_here(gaps: dict[str, str]) -> dict[str, str]:
    """Versions of the peers there are; what is missing goes to `gaps`."""
    said = _peers("versions") if PEERS_PYTHON.is_file() else {}
    versions = {name: said[name] for name in PEERS if said.get(name) is not None}
    gaps |= {name: f"not installed: {INSTALL}" for name in PEERS if name not in versions}
    return versions


def peer_rows(
    versions: Mapping[str, str],
    angular: Mapping[str, Sequence[float]],
    gaps: dict[str, str],
    *,
    quick: bool,
) -> list[dict[str, Any]]:
    """What the peers there are measured; `angular`: where the first body's momentum must be."""
    rows: list[dict[str, Any]] = []
    for name in versions:
        for words in PEERS[name]:
            say(f"timing, {' '.join(words)}")
            try:
                said = _peers(*words, *(["--quick"] if quick else []))
            except ToolError as problem:
                gaps[name] = str(problem)
                continue
            rows += [{**row, "compiler": " ".join(words)} for row in said["rows"]]
    for row in rows:
        apart = math.dist(row["angular"], angular[row["problem"]])
        if not apart <= PEERS_AGREEMENT * math.hypot(*angular[row["problem"]]):
            raise CheckFailed(
                f"hamotor bench: {row['contestant']}'s bodies ({row['problem']}, {row['method']}) "
                f"differ from ours by {apart:.2g}; they cannot be compared"
            )
    return rows


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
            f"{'of peak':>9}{'bound':>8}{'Eigen':>8}{'ratio':>7}"
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
            f"{row['share_of_peak']:>9.0%}{row['bound'] / 1e6:>8.0f}"
        )
        if eigen is not None and (method, bodies) == ("rk4", IN_CACHE):
            rate = eigen["steps_per_second"]
            text += f"{rate / 1e6:>8.1f}{row['steps_per_second'] / rate:>7.1f}"
        lines.append(text)
    lines += [
        *beside(account),
        *scaling(rows),
        "  FLOP: operations of a step, counted, a multiply-add as two, of which a peak is made up;",
        "  bound: steps if multiplications and additions were started wherever the processor can;",
        "  Eigen: the same by quaternion and vectors, an array of structures, the best compiler.",
        "  Shortest times on a machine as busy as yours is now: read the ratios.",
    ]
    return "\n".join(lines)


def beside(account: Mapping[str, Any]) -> list[str]:
    """Others than Eigen, each with as many bodies as it is fastest with; and what is missing."""
    rows = account["rows"]
    lines = []
    for who, problem, method in dict.fromkeys(
        (row["contestant"], row["problem"], row["method"])
        for row in rows
        if row["contestant"] not in {"packs", "Eigen"}
    ):
        case = {"problem": problem, "method": method}
        theirs = best(rows, **case, contestant=who)
        ours = best(rows, **case, contestant="packs", bodies=IN_CACHE, threads=1)
        assert theirs is not None
        assert ours is not None
        rate = theirs["steps_per_second"]
        lines.append(
            f"  {who}, {problem}, {method}: {rate / 1e6:.3g} million with {theirs['bodies']} "
            f"bodies; ours is {ours['steps_per_second'] / rate:.1f} times as fast"
        )
    lines += [f"  {who}: {how}" for who, how in account["tuned"].items() if lines]
    return [*lines, *(f"  {who}: {why}" for who, why in account["gaps"].items())]


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
