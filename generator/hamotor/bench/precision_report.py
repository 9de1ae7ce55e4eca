"""The account of precision as a table, as diagrams, and as one page that needs no network."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hamotor.bench.endpoint import ATTITUDE

Rows = Sequence[Mapping[str, Any]]


RULES: Final = """\
Every contestant starts from the same numbers and ends at the same time; the error is measured \
there, against the reference.
Times are those of the whole integration on one core, the best of the runs, which are interleaved \
over all contestants in one process; median and worst stand beside it. Set-up (generation, \
compilation, building a solver) is not in them.
A setting meets a target only if the next two finer ones meet it as well.
What fails or does not converge is a row and says why.
Public solvers integrate a quaternion and body rates (place and velocity): 7 or 13 numbers. C++ \
ones are compiled by each compiler with -O3 -march=native, the faster counts, as do the scenes of \
the methods that lead. heyoka: compact_mode \
off, with and without fast_math, its compilation and the time of an empty call taken off. SciPy's \
rates are plain Python floats, which is faster than NumPy at this size. MuJoCo takes all steps in \
one call.
A peer that is not installed is listed with the command that installs it.
""".splitlines()


@dataclass(frozen=True)
class Best:
    """The cheapest setting that meets a target."""

    name: str
    microseconds: float
    row: Mapping[str, Any]


def name_of(row: Mapping[str, Any]) -> str:
    """A contestant with what distinguishes it."""
    words = [w for w in (row["form"], row["compiler"]) if w]
    return f"{row['contestant']} ({', '.join(words)})" if words else str(row["contestant"])


def by_contestant(rows: Rows) -> dict[tuple[str, str], list[Mapping[str, Any]]]:
    """Rows by problem and contestant, coarse to fine."""
    found: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        found.setdefault((row["problem"], name_of(row)), []).append(row)
    return found


def meeting(ladder: Rows, target: float, quantity: str = ATTITUDE) -> Iterator[Mapping[str, Any]]:
    """Settings that meet a target, as the next two finer ones do."""
    met = [
        row["failure"] is None and row["errors"].get(quantity, float("inf")) <= target
        for row in ladder
    ]
    for index in range(len(ladder) - 2):
        if all(met[index : index + 3]):
            yield ladder[index]


def best(
    rows: Rows, problem: str, target: float, *, ours: bool, quantity: str = ATTITUDE
) -> Best | None:
    """The cheapest way to a target, of Hamotor or of all others; None where nobody gets there."""
    candidates = [
        Best(name, row["best_us"], row)
        for (of, name), ladder in by_contestant(rows).items()
        if of == problem and (ladder[0]["family"] == "hamotor") == ours
        for row in meeting(ladder, target, quantity)
    ]
    return min(candidates, key=lambda found: found.microseconds, default=None)


def standings(account: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Problem by target: the best of ours, the best public solver, their ratio and the goal."""
    rows: Rows = account["rows"]
    found = []
    for name, said in account["problems"].items():
        for index, target in enumerate(account["targets"]):
            our, their = (best(rows, name, target, ours=ours) for ours in (True, False))
            goal = said["goals"][index] if index < len(said["goals"]) else None
            ratio = their.microseconds / our.microseconds if our and their else None
            # Where no public solver arrives, to arrive is all there is to do.
            met = our is not None if their is None else ratio is not None and ratio >= (goal or 1)
            found.append(
                {
                    "problem": name,
                    "target": target,
                    "ours": _said(our),
                    "peer": _said(their),
                    "ratio": ratio,
                    "goal": goal,
                    "verdict": "met" if met else "missed",
                }
            )
    return found


def _said(found: Best | None) -> dict[str, Any] | None:
    return None if found is None else {"name": found.name, "us": found.microseconds}


def table(account: Mapping[str, Any]) -> str:
    """What a person reads: the standings and all that belongs to them."""
    lines = ["time of a whole integration, best of the runs; error: attitude at the end"]
    for name, said in account["problems"].items():
        lines += ["", f"{name}: {said['description']}, {said['end_s']:g} s"]
        lines.append(
            f"  {'error':>6}  {'ours, µs':>9}  {'by':<28}{'peer, µs':>10}  {'by':<28}"
            f"{'x':>6}{'goal':>7}"
        )
        for standing in account["best"]:
            if standing["problem"] != name:
                continue
            ratio, goal = standing["ratio"], standing["goal"]
            lines.append(
                f"  {standing['target']:>6.0e}  {_cells(standing['ours'], 9)}"
                f"{_cells(standing['peer'], 10)}"
                f"{'-' if ratio is None else f'{ratio:.2g}':>6}"
                f"{'-' if goal is None else f'{goal:g}':>7}"
                + ("  missed" if standing["verdict"] == "missed" else "")
            )
        failures = sum(r["problem"] == name and r["failure"] is not None for r in account["rows"])
        if failures:
            lines.append(f"  {failures} settings failed; they are rows of the account")
    lines += _long_runs(account["drift"])
    lines += ["", *(f"not compared: {who}: {why}" for who, why in account["not_there"].items())]
    said = account["provenance"]
    peers = ", ".join(f"{who} {version}" for who, version in said["peers"].items())
    lines.append(f"{said['processor']}; {'; '.join(said['compilers'].values())}; {peers}")
    return "\n".join(lines)


def _long_runs(drift: Rows) -> list[str]:
    """The energy at the end of the long runs, with how it grew."""
    lines = (
        ["", "long runs: largest relative error of the energy, growing as steps^p"] if drift else []
    )
    for row in drift:
        if row["quantity"] != "energy":
            continue
        grown = "-"
        if row["exponent"] is not None:
            grown = f"{row['exponent']:.2f} ± {row['exponent_error']:.2f}"
        lines.append(
            f"  {row['problem']:<12}{row['contestant']:<18}{row['steps']:>12,} steps of"
            f" {row['step']:g} s{row['largest']:>10.1e}   p = {grown}"
        )
    return lines


def _cells(found: Mapping[str, Any] | None, width: int) -> str:
    if found is None:
        return f"{'-':>{width}}  {'-':<28}"
    return f"{found['us']:>{width}.4g}  {found['name']:<28}"


def write_report(account: Mapping[str, Any], out: Path) -> list[Path]:
    """Write precision.json, a diagram of each problem as PNG and SVG, and precision.html.

    Returns the files.  The page holds the whole account and needs no network.
    """
    out.mkdir(parents=True, exist_ok=True)
    # A browser reads no NaN.
    whole = json.dumps(account, allow_nan=False)
    files = [out / "precision.json", out / "precision.html"]
    files[0].write_text(json.dumps(account, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    # What a script element holds ends at its first end tag, in a string or not.
    page = _PAGE.read_text(encoding="utf-8").replace("@ACCOUNT@", whole.replace("</", "<\\/"))
    files[1].write_text(page, encoding="utf-8")
    for name in account["problems"]:
        files += _draw(account, name, out / f"precision_{name}")
    return files


_PAGE: Final = Path(__file__).resolve().parents[3] / "templates" / "precision.html"
_SHOWN: Final = 7
_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7f3c8d")
_PEERS: Final = {
    "heyoka": "#000000", "odeint": "#8a5a00", "Eigen": "#777777", "SciPy": "#999999",
    "MuJoCo": "#bbbbbb",
}  # fmt: skip


def _draw(account: Mapping[str, Any], problem: str, stem: Path) -> list[Path]:
    """Error over time: the methods that are ahead somewhere, and every public solver."""
    from matplotlib.figure import Figure

    ladders = {
        name: ladder
        for (of, name), ladder in by_contestant(account["rows"]).items()
        if of == problem
    }
    chosen = _ahead(ladders)
    figure = Figure(figsize=(8.6, 5.6), layout="constrained")
    ax = figure.subplots()
    colours = iter(_COLOURS)
    for name in chosen:
        ladder = [
            row
            for row in ladders[name]
            if row["failure"] is None and 0 < row["errors"].get(ATTITUDE, -1) < 1
        ]
        family = ladders[name][0]["family"]
        ours = family == "hamotor"
        ax.plot(
            [row["best_us"] for row in ladder],
            [row["errors"][ATTITUDE] for row in ladder],
            marker="o" if ours else "s", markersize=3, linewidth=1.6 if ours else 1.1,
            linestyle="-" if ours else "--", label=name,
            color=next(colours) if ours else _PEERS[family],
        )  # fmt: skip
    for target in account["targets"]:
        ax.axhline(target, color="#eeeeee", linewidth=0.8, zorder=0)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("time of the whole integration, µs (best of the runs)")
    ax.set_ylabel("error of the attitude at the end, rad")
    ax.set_title(f"{problem}: {account['problems'][problem]['description']}", fontsize=11)
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    files = [stem.with_suffix(suffix) for suffix in (".png", ".svg")]
    for file in files:
        unfinished = file.with_name(f".{os.getpid()}-{file.name}")
        figure.savefig(unfinished, dpi=150, format=file.suffix[1:])
        unfinished.replace(file)
    return files


def leaders(rows: Rows, problem: str) -> list[str]:
    """Our methods that take at most twice the least time to some error, a decade each."""
    ladders = {
        ladder[0]["contestant"]: ladder
        for (of, _), ladder in by_contestant(rows).items()
        if of == problem and ladder[0]["family"] == "hamotor"
    }
    leading: set[str] = set()
    for decade in range(3, 14):
        times = {
            name: min((row["best_us"] for row in meeting(ladder, 10.0**-decade)), default=None)
            for name, ladder in ladders.items()
        }
        least = min((t for t in times.values() if t is not None), default=0.0)
        leading |= {name for name, t in times.items() if t is not None and t <= 2 * least}
    return [name for name in ladders if name in leading]


def _ahead(ladders: Mapping[str, Rows]) -> list[str]:
    """Ours by how many decades of error they reach first, and one of each public solver."""
    decades = [10.0**-k for k in range(3, 13)]
    score: dict[str, float] = {}
    fastest: dict[tuple[str, float], float] = {}
    for name, ladder in ladders.items():
        for target in decades:
            times = [row["best_us"] for row in meeting(ladder, target)]
            if times:
                fastest[name, target] = min(times)

    def is_ours(name: str) -> bool:
        return bool(ladders[name][0]["family"] == "hamotor")

    for target in decades:
        for side in (True, False):
            times_here = {
                name: fastest[name, target]
                for name in ladders
                if (name, target) in fastest and is_ours(name) == side
            }
            for name, needed in times_here.items():
                score[name] = score.get(name, 0.0) + min(times_here.values()) / needed
    ranked = sorted(score, key=lambda name: -score[name])
    peers: dict[str, str] = {}
    for name in ranked:
        if not is_ours(name):
            peers.setdefault(ladders[name][0]["contestant"], name)
    return [*[name for name in ranked if is_ours(name)][:_SHOWN], *peers.values()]
