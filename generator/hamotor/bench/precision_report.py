"""The account of precision as a table, as diagrams, and as one page that needs no network."""

from __future__ import annotations

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
ones are compiled by each compiler with -O3 -march=native, the faster counts. heyoka: compact_mode \
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


def table(account: Mapping[str, Any]) -> str:
    """Problem by target: the best of ours, the best public solver, their ratio and the goal."""
    rows: Rows = account["rows"]
    lines = ["time of a whole integration, best of the runs; error: attitude at the end"]
    for name, said in account["problems"].items():
        lines += ["", f"{name}: {said['description']}, {said['end_s']:g} s"]
        lines.append(
            f"  {'error':>6}  {'ours, µs':>9}  {'by':<34}{'peer, µs':>10}  {'by':<34}"
            f"{'x':>6}{'goal':>7}"
        )
        for index, target in enumerate(account["targets"]):
            our, their = (best(rows, name, target, ours=ours) for ours in (True, False))
            goal = said["goals"][index] if index < len(said["goals"]) else None
            ratio = their.microseconds / our.microseconds if our and their else None
            verdict = ""
            if goal is not None:
                verdict = "" if ratio is not None and ratio >= goal else "  missed"
            lines.append(
                f"  {target:>6.0e}  {_time(our):>9}  {our.name if our else '-':<34}"
                f"{_time(their):>10}  {their.name if their else '-':<34}"
                f"{'-' if ratio is None else f'{ratio:.2g}':>6}"
                f"{'-' if goal is None else f'{goal:g}':>7}{verdict}"
            )
        failures = [r for r in rows if r["problem"] == name and r["failure"] is not None]
        if failures:
            lines.append(f"  {len(failures)} settings failed; they are rows of the account")
    lines += ["", *(f"not compared: {who}: {why}" for who, why in account["not_there"].items())]
    from_where = account["provenance"]
    peers = ", ".join(f"{who} {version}" for who, version in from_where["peers"].items())
    lines.append(
        f"{from_where['processor']}; {'; '.join(from_where['compilers'].values())}; {peers}"
    )
    return "\n".join(lines)


def _time(found: Best | None) -> str:
    return "-" if found is None else f"{found.microseconds:.4g}"


def write_report(account: Mapping[str, Any], out: Path) -> list[Path]:
    """Write precision.json, diagrams and precision.html; returns the files."""
    import json

    out.mkdir(parents=True, exist_ok=True)
    file = out / "precision.json"
    file.write_text(json.dumps(account, indent=1) + "\n", encoding="utf-8")
    return [file]
