"""The account of precision as a table, as diagrams, and as one page that needs no network."""

from __future__ import annotations

import gzip
from base64 import b64encode
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from textwrap import fill
from typing import Any, Final

from hamotor.bench.endpoint import ATTITUDE
from hamotor.bench.solvers import TUNED
from hamotor.files import whole, write_whole
from hamotor.run.report import to_json

Rows = Sequence[Mapping[str, Any]]


_RULES: Final = """\
Every contestant starts from the same numbers and ends at the same time; the error is measured \
there, against the reference: attitude, position, momentum and energy each in its unit. Targets \
are for the quantity that is named with the problem.
Times are those of the whole integration on one core, the best of the runs, which are \
interleaved over all contestants in one process; median and worst stand beside it, and the least \
time that the thread had the processor. What takes more than ten times the least time to an error \
as small (ours beside ours without closed forms, public solvers beside each other), or ends with \
an error above 0.01, or takes more than ten times what ends its settings, has only the few runs of \
a first look, as its row says. Set-up (generation, compilation, building a solver, the first step) \
is not in them and listed apart.
A setting meets a target only if the next two finer ones meet it as well.
What fails or does not converge is a row and says why; so is what takes more than half a minute or \
ends its process, of which nothing finer is tried. Settings go from coarse to fine until two in a \
row take longer than 15 ms (10 ms if quick) of processor time, or one four times that, 20 times as \
long where the solver is called from Python; after one that takes so long to fail, the next is \
left out, after another one two, and so on. \
Other kernels, representations and scalars begin with the longest step at which generated kernels \
in double did not fail, and are left out where these take longer than 15 ms at every setting. If \
no scenes are named, one problem of each structure in each algebra and group has them; others that \
are not the benchmark's own are not counted either, and no scene but these is compiled by a second \
compiler.
Scenes and solvers in C++ are compiled with -O3 -march=native, those that lead by each compiler, \
of which the faster counts.
Evaluations are those of rates or forques, and of a Taylor series its order. Operations are \
counted by a run with numbers that count, from the first 200 steps, or 1000 tries of those that \
choose their steps: generated, generic and \
sparse kernels and conformal algebra in double. Steps of explicit methods and splittings take as \
many in any scalar; of others in other scalars, of matrices and of public solvers nobody counts.
A scene in conformal algebra is a general one, with a whole gradient, as is one with generic \
kernels (dense multivectors, by the whole table, or "sparse", by the part of it that the types of \
the operands need): neither knows principal axes.
Scalars with more digits than a double step the motion of the reference's digits and are read in \
all of theirs, with finer tolerances and half a second for a setting; no public solver here has \
such.
Long runs take the scene's step; solvers with a tolerance take 1e-14 and their own steps for the \
same time. Relative errors of what is conserved are taken over its size at the start; the \
attitude, where the motion has a closed form, is held against that in quad. What would take \
more than 3 s (if their length is given by --drift 10 s, or 1 s for each million steps if that is \
more), of public solvers half of that, takes fewer steps. p is the slope of log error over log \
steps in the last two decades.
Problems are measured one after the other; the date of each stands with its reference.
A peer that is not installed is listed with the command that installs it; what a peer cannot \
express is listed, too.
Public solvers integrate a quaternion and body rates (place and velocity), 7 or 13 numbers, where \
that is written for them by hand; otherwise equations generated from the scene, in those of motors \
and momenta, or of rotors, momenta and places, that take the fewest operations, with common parts \
computed once; what they are stands with the problem. Nothing is normalised on the way, motors are \
at the end. Engines of rigid bodies have their own coordinates.
""".splitlines()


def rules(families: Collection[str]) -> list[str]:
    """How it was measured, and how these solvers are tuned."""
    return [*_RULES, *(text for family, text in TUNED.items() if family in families)]


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
    return [
        _standing(account, name, target, dict(enumerate(said["goals"])).get(index))
        for name, said in account["problems"].items()
        for index, target in enumerate(account["targets"])
    ]


def more_digits(account: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The same for targets beyond a double's digits, where a scalar with more of them arrives."""
    found = [_standing(account, p, target) for p in account["problems"] for target in _FINER]
    return [standing for standing in found if standing["ours"]]


_FINER: Final = (1e-16, 1e-20, 1e-24, 1e-28)


def _standing(
    account: Mapping[str, Any], problem: str, target: float, goal: float | None = None
) -> dict[str, Any]:
    norm = account["problems"][problem]["norm"]
    our, their = (
        best(account["rows"], problem, target, ours=ours, quantity=norm) for ours in (True, False)
    )
    ratio = their.microseconds / our.microseconds if our and their else None
    # Where no public solver arrives, to arrive is all there is to do.
    met = our is not None if their is None else ratio is not None and ratio >= (goal or 1)
    return {
        "problem": problem,
        "target": target,
        "ours": _said(our),
        "peer": _said(their),
        "ratio": ratio,
        "goal": goal,
        "verdict": "met" if met else "missed",
    }


def over_problems(best: Rows) -> list[dict[str, Any]]:
    """For each target, how many times as long the best public solver takes as the best of ours:
    the median and the worst over the problems, and where only one of the two arrives."""
    found = []
    for target in dict.fromkeys(row["target"] for row in best):
        here = [row for row in best if row["target"] == target]
        ratios = {row["problem"]: row["ratio"] for row in here if row["ratio"] is not None}
        worst = min(ratios, key=lambda name: ratios[name], default=None)
        found.append(
            {
                "target": target,
                "median": median(ratios.values()) if ratios else None,
                "worst": ratios[worst] if worst is not None else None,
                "worst_on": worst,
                "only_ours": [r["problem"] for r in here if r["ours"] and not r["peer"]],
                "only_peers": [r["problem"] for r in here if r["peer"] and not r["ours"]],
            }
        )
    return found


_MEASURED: Final = {
    "kernels": ("generated", "sparse", "generic"),
    "representation": ("ga", "matrix"),
    "scalar": ("float", "double", "long_double", "quad"),
    "algebra": (),
    "family": (),
}
"""What rows differ in, with what should be there; none are those of any problem."""
_COSTS: Final = {
    "best_us": "time", "cpu_us": "processor time", "steps": "steps", "evaluations": "evaluations",
    "operations": "operations",
}  # fmt: skip


def coverage(account: Mapping[str, Any]) -> list[dict[str, Any]]:
    """How many rows of each problem there are for everything that one can choose: kernels,
    representations, algebras, scalars, solvers, errors and costs; and how many long runs."""
    problems = account["problems"]
    done: Rows = [row for row in account["rows"] if row["failure"] is None]

    def line(what: str, value: str, rows: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
        counts = Counter(row["problem"] for row in rows)
        return {"what": what, "value": value, "rows": {p: counts[p] for p in problems}}

    found = []
    for axis, expected in _MEASURED.items():
        ours = [r for r in done if axis == "family" or r["family"] == "hamotor"]
        there = dict.fromkeys([*expected, *(r[axis] for r in ours if r[axis])])
        found += [line(axis, value, (r for r in ours if r[axis] == value)) for value in there]
    errors = dict.fromkeys(quantity for row in done for quantity in row["errors"])
    found += [line("error", e, (r for r in done if e in r["errors"])) for e in errors]
    found += [
        line("cost", word, (r for r in done if r[key] is not None)) for key, word in _COSTS.items()
    ]
    runs = {(d["problem"], d["family"], d["contestant"]) for d in account["drift"]}
    families = dict.fromkeys(family for _, family, _ in sorted(runs))
    return found + [
        line("long runs", family, ({"problem": p} for p, f, _ in runs if f == family))
        for family in families
    ]


def _said(found: Best | None) -> dict[str, Any] | None:
    if found is None:
        return None
    kept = {key: found.row[f"{key}_us"] for key in ("median", "worst", "cpu")}
    return {"name": found.name, "us": found.microseconds, **kept}


def table(account: Mapping[str, Any]) -> str:
    """What a person reads: the standings and all that belongs to them."""
    lines = ["time of a whole integration, best of the runs (worst in brackets); error at the end"]
    for name, said in account["problems"].items():
        lines += ["", f"{name}: {said['description']}, {said['end_s']:g} s; error: {said['norm']}"]
        if said.get("public_solvers"):
            lines.append(f"  public solvers have {said['public_solvers']}")
        lines.append(
            f"  {'error':>6}  {'ours, µs':>18}  {'by':<28}{'peer, µs':>18}  {'by':<28}"
            f"{'x':>6}{'goal':>7}"
        )
        for standing in [*account["best"], *account["more_digits"]]:
            if standing["problem"] != name:
                continue
            ratio, goal = standing["ratio"], standing["goal"]
            lines.append(
                f"  {standing['target']:>6.0e}  {_cells(standing['ours'], 18)}"
                f"{_cells(standing['peer'], 18)}"
                f"{'-' if ratio is None else f'{ratio:.2g}':>6}"
                f"{'-' if goal is None else f'{goal:g}':>7}"
                + ("  missed" if standing["verdict"] == "missed" else "")
            )
        failures = sum(r["problem"] == name and r["failure"] is not None for r in account["rows"])
        if failures:
            lines.append(f"  {failures} settings failed; they are rows of the account")
    if len(account["problems"]) > 1:
        lines += ["", "time of the best public solver over that of the best of ours"]
        for row in account["over_problems"]:
            if row["worst"] is not None:
                lines.append(
                    f"  {row['target']:>6.0e}  median {row['median']:.2g},"
                    f" worst {row['worst']:.2g} ({row['worst_on']})"
                    + (
                        f"; only ours arrive: {', '.join(row['only_ours'])}"
                        * bool(row["only_ours"])
                    )
                    + (f"; only peers: {', '.join(row['only_peers'])}" * bool(row["only_peers"]))
                )
    lines += _long_runs(account["drift"])
    lines += ["", *(f"not compared: {who}: {why}" for who, why in account["not_there"].items())]
    said = account["provenance"]
    peers = ", ".join(f"{who} {version}" for who, version in said["peers"].items())
    lines.append(f"{said['processor']}; {'; '.join(said['compilers'].values())}; {peers}")
    return "\n".join(lines)


def _long_runs(drift: Rows) -> list[str]:
    """Energy, the worst momentum and phase at the end of the long runs, with how they grew."""
    runs: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in drift:
        runs.setdefault((row["problem"], row["contestant"]), []).append(row)
    if not runs:
        return []
    lines = [
        "",
        "long runs: the largest error, relative or of the attitude in rad, growing as steps^p",
        f"  {'':<34}{'steps':>13}  {'energy':<18}{'momentum':<18}attitude",
    ]
    asked = {p: max(r["steps"] for r in drift if r["problem"] == p) for p, _ in runs}
    for (problem, contestant), rows in runs.items():
        kinds = (
            [r for r in rows if r["quantity"] in ("energy", "energy_balance")],
            [r for r in rows if "momentum" in r["quantity"]],
            [r for r in rows if r["quantity"] == ATTITUDE],
        )
        cells = "".join(f"{_growth(kind):<18}" for kind in kinds)
        first = rows[0]
        why = first["failure"] or ("too slow for more" * (first["steps"] < asked[problem]))
        line = f"  {problem:<12}{contestant:<22}{first['steps']:>13,}  {cells}{why}"
        lines.append(line.rstrip())
    return lines


def _growth(rows: Rows) -> str:
    """The largest of these quantities' errors and its exponent."""
    there = [r for r in rows if r["largest"] is not None]
    if not there:
        return "-"
    worst = max(there, key=lambda r: r["largest"])
    grown = "-" if worst["exponent"] is None else f"{worst['exponent']:.2f}"
    return f"{worst['largest']:.1e} p {grown}"


def _cells(found: Mapping[str, Any] | None, width: int) -> str:
    if found is None:
        return f"{'-':>{width}}  {'-':<28}"
    time = f"{found['us']:.4g} ({found['worst']:.4g})"
    return f"{time:>{width}}  {found['name']:<28}"


def write_report(
    account: Mapping[str, Any], out: Path, drawn: Collection[str] | None = None
) -> list[Path]:
    """Write precision.json, a diagram of each problem as PNG and SVG, and precision.html.

    drawn: the problems to draw; all if not given.  Returns the files.  The page holds the whole
    account, compressed, and needs no network.
    """
    out.mkdir(parents=True, exist_ok=True)
    text = to_json(account)  # a browser reads no NaN
    files = [out / "precision.json", out / "precision.html"]
    write_whole(files[0], text)
    packed = b64encode(gzip.compress(text.encode(), mtime=0)).decode()  # 1/7 of its length
    write_whole(files[1], _PAGE.read_text(encoding="utf-8").replace("@ACCOUNT@", packed))
    for name in account["problems"] if drawn is None else drawn:
        stem = out / f"precision_{name}"
        files += draw(account, name, [stem.with_suffix(".png"), stem.with_suffix(".svg")])
    return files


_PAGE: Final = Path(__file__).resolve().parents[3] / "templates" / "precision.html"
_SHOWN: Final = 7
_COARSEST: Final = 1e-3
_TITLE: Final = 56
_MARKERS: Final = "s^vDP"
_COLOURS: Final = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7f3c8d")
_PEERS: Final = {
    "heyoka": "#000000", "odeint": "#8a5a00", "SUNDIALS": "#b8860b", "Eigen": "#777777",
    "SciPy": "#999999", "MuJoCo": "#bbbbbb", "Pinocchio": "#a0a0d0", "Bullet": "#d0a0a0",
}  # fmt: skip


def draw(account: Mapping[str, Any], problem: str, files: Sequence[Path]) -> Sequence[Path]:
    """Error over time: the methods that are ahead somewhere, and every public solver; those that
    do not arrive anywhere by their names.

    A bar reaches from the best of the runs to the median.
    """
    from matplotlib.figure import Figure

    ladders = _ladders(account["rows"], problem)
    norm = account["problems"][problem]["norm"]
    chosen = ahead(account["rows"], problem, norm)
    figure = Figure(figsize=(8.6, 5.6), layout="constrained")
    ax = figure.subplots()
    colours = iter(_COLOURS)
    shown: dict[str, int] = {}
    any_point = False  # without one there is no logarithm of anything
    for name in chosen:
        ladder = [
            row
            for row in ladders[name]
            if row["failure"] is None and 0 < row["errors"].get(norm, -1) < 1 and row["best_us"] > 0
        ]
        any_point |= bool(ladder)
        family = ladders[name][0]["family"]
        ours = family == "hamotor"
        shown[family] = shown.get(family, -1) + 1
        ax.errorbar(
            [row["best_us"] for row in ladder],
            [row["errors"][norm] for row in ladder],
            xerr=[[0.0] * len(ladder), [row["median_us"] - row["best_us"] for row in ladder]],
            marker="o" if ours else _MARKERS[shown[family] % len(_MARKERS)], markersize=3.5,
            linewidth=1.6 if ours else 1.1, linestyle="-" if ours else "--", elinewidth=0.7,
            label=name,
            color=next(colours) if ours else _PEERS[family],
        )  # fmt: skip
    arrived = {ladders[name][0]["contestant"] for name in chosen}
    for who in dict.fromkeys(
        ladder[0]["contestant"] for ladder in ladders.values() if ladder[0]["family"] != "hamotor"
    ):
        if who not in arrived:
            ax.errorbar([], [], linestyle="", label=f"{who}: not within {_COARSEST:g} in time")
    for target in account["targets"]:
        ax.axhline(target, color="#eeeeee", linewidth=0.8, zorder=0)
    if any_point:
        ax.set_xscale("log")
        ax.set_yscale("log")
    ax.set_xlabel("time of the whole integration, µs (best of the runs; bars to the median)")
    ax.set_ylabel(f"error at the end: {norm}")
    title = f"{problem}: {account['problems'][problem]['description']}"
    ax.set_title(fill(title, _TITLE), loc="left", fontsize=10)  # beside the legend, not over it
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    for file in files:
        with whole(file) as unfinished:
            figure.savefig(unfinished, dpi=150, format=file.suffix[1:])
    return files


def leaders(rows: Rows, problem: str, norm: str) -> list[str]:
    """Our methods that take at most twice the least time to some error, a decade each."""
    ladders = {
        ladder[0]["contestant"]: ladder
        for (of, _), ladder in by_contestant(rows).items()
        if of == problem and ladder[0]["family"] == "hamotor"
    }
    leading: set[str] = set()
    for decade in range(3, 14):
        times = {
            name: min(
                (row["best_us"] for row in meeting(ladder, 10.0**-decade, norm)), default=None
            )
            for name, ladder in ladders.items()
        }
        least = min((t for t in times.values() if t is not None), default=0.0)
        leading |= {name for name, t in times.items() if t is not None and t <= 2 * least}
    return [name for name in ladders if name in leading]


def _ladders(rows: Rows, problem: str) -> dict[str, list[Mapping[str, Any]]]:
    return {name: ladder for (of, name), ladder in by_contestant(rows).items() if of == problem}


def ahead(rows: Rows, problem: str, norm: str) -> list[str]:
    """Ours by how many decades of error they reach first, and the public solvers that arrive."""
    ladders = _ladders(rows, problem)
    decades = [10.0**-k for k in range(3, 13)]
    score: dict[str, float] = {}
    fastest: dict[tuple[str, float], float] = {}
    for name, ladder in ladders.items():
        for target in decades:
            times = [row["best_us"] for row in meeting(ladder, target, norm)]
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
    found: dict[tuple[str, str], str] = {}  # of each the better compiler's
    for name in sorted(score, key=lambda name: -score[name]):
        first = ladders[name][0]
        found.setdefault((first["contestant"], first["form"] if is_ours(name) else ""), name)
    ours = [name for name in found.values() if is_ours(name)]
    return [*ours[:_SHOWN], *(name for name in found.values() if not is_ours(name))]
