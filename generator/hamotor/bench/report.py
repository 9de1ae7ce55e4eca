"""A benchmark's account as a table and as a picture: times, ratios to the best Eigen, errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

from hamotor.files import whole

BASELINE = "Eigen"
MODES = ("latency", "array of 256", "array of 4096")
_BLUE, _SKY, _GREY = "#0072B2", "#56B4E9", "#8a8a8a"
_ORANGE, _VERMILLION, _GREEN, _PURPLE = "#E69F00", "#D55E00", "#009E73", "#CC79A7"
_COLOURS = {
    "generated": _BLUE,
    "generated, lean": "#4f9bd9",
    "generated, converted": "#9cc7ea",
    "generated, Rk4": "#1b4f8a",
    "generated, packs": "#00305a",
    "Eigen quaternion + translation": _ORANGE,
    "Eigen Isometry3": _VERMILLION,
    "Eigen Isometry3, converted": "#f0b08a",
    "Eigen 4x4 matrix": _PURPLE,
    "Eigen 5x5 matrix": _VERMILLION,
    "Eigen 4x4 complex": _PURPLE,
    "GLM dual quaternion": _GREEN,
    "ganja.js C++": _SKY,
    "sparse terms": "#bbbbbb",
    "dense table": "#555555",
}
_HATCHES = {"g++": "", "clang++": "////"}
_TICKS = (0.0625, 0.125, 0.25, 0.5, 1, 2, 4, 8, 16, 32, 64, 128)

Rows = Sequence[Mapping[str, Any]]


def table(account: Mapping[str, Any]) -> str:
    """What a person reads: for each scalar and mode, contestants by operation.

    A time is the better compiler's; `x` is its ratio to the best of Eigen's over both compilers,
    so less than 1 is faster than Eigen.
    """
    rows: Rows = account["rows"]
    compilers = list(dict.fromkeys(row["compiler"] for row in rows))
    lines = []
    for scalar in dict.fromkeys(row["scalar"] for row in rows):
        for mode in MODES:
            chosen = [r for r in rows if r["scalar"] == scalar and r["mode"] == mode]
            if chosen:
                lines += [*_block(chosen, compilers, f"{scalar}, {mode}"), ""]
    lines += [f"not compared: {peer}: {why}" for peer, why in account["not_there"].items()]
    said = account["provenance"]
    lines += [
        f"ns: {account['unit']}; x: ratio to the best Eigen over all compilers (< 1 is faster)",
        "matrix given: made before, once; converted: made anew by each operation",
        "packs: arrays of blocks, a number of each of as many things as a register holds",
        f"error: {account['error']}",
        f"{said['processor']}; {'; '.join(said['compilers'].values())}; {said['flags']}",
    ]
    return "\n".join(lines)


def _block(rows: Rows, compilers: Sequence[str], title: str) -> list[str]:
    width = max(len(row["contestant"]) for row in rows)
    head = "".join(f"{compiler + ' ns':>12}{'x':>7}" for compiler in compilers)
    lines = [f"-- {title} ".ljust(80, "-"), f"{'':<{width + 2}}{head}{'error':>10}"]
    for operation in dict.fromkeys(row["operation"] for row in rows):
        lines.append(operation)
        here = [row for row in rows if row["operation"] == operation]
        baseline = best_eigen(here)
        for contestant in dict.fromkeys(row["contestant"] for row in here):
            cells = ""
            error = 0.0
            for compiler in compilers:
                found = _one(here, contestant, compiler)
                if found is None:
                    cells += f"{'-':>12}{'-':>7}"
                    continue
                ratio = f"{found['ns'] / baseline:.2f}" if baseline else "-"
                cells += f"{found['ns']:>12.2f}{ratio:>7}"
                error = max(error, found["max_relative_error"])
            lines.append(f"  {contestant:<{width}}{cells}{error:>10.1e}")
    return lines


def _one(rows: Rows, contestant: str, compiler: str) -> Mapping[str, Any] | None:
    for row in rows:
        if row["contestant"] == contestant and row["compiler"] == compiler:
            return row
    return None


def best_eigen(rows: Rows) -> float | None:
    """Shortest time of any of Eigen's forms over all compilers, None where Eigen has none."""
    times = [row["ns"] for row in rows if row["contestant"].startswith(BASELINE)]
    return min(times) if times else None


def draw_ratios(account: Mapping[str, Any], file: Path) -> None:
    """Bars of ratios to the best Eigen, double: a chain above, arrays of 256 below."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    rows: Rows = [row for row in account["rows"] if row["scalar"] == "double"]
    modes = MODES[:2]
    figure = Figure(figsize=(18.0, 9.5), layout="constrained")
    figure.suptitle(
        "Time relative to the best Eigen over all compilers, double (below 1 is faster)"
    )
    axes = figure.subplots(len(modes), 1)
    contestants = [c for c in _COLOURS if any(row["contestant"] == c for row in rows)]
    compilers = list(dict.fromkeys(row["compiler"] for row in rows))
    for ax, mode in zip(axes, modes, strict=True):
        chosen = [row for row in rows if row["mode"] == mode]
        operations = [
            operation
            for operation in dict.fromkeys(row["operation"] for row in chosen)
            if best_eigen([row for row in chosen if row["operation"] == operation])
        ]
        for place, operation in enumerate(operations):
            here = [row for row in chosen if row["operation"] == operation]
            _draw_operation(ax, place, here, contestants, compilers)
        ax.axhline(1.0, color="#222222", linewidth=1.0)
        ax.set_yscale("log", base=2)
        ax.set_ylim(_TICKS[0], _TICKS[-1])
        ax.set_yticks(_TICKS, [f"{tick:g}" for tick in _TICKS])
        ax.set_xlim(-0.55, len(operations) - 0.45)
        ax.set_xticks(range(len(operations)), [fill(name, 10) for name in operations], fontsize=8)
        ax.set_ylabel(f"{mode}\ntime / best Eigen")
        ax.grid(axis="y", color="#dddddd", linewidth=0.6)
        ax.set_axisbelow(True)
    patches = [Patch(facecolor=_COLOURS[c], edgecolor="white", label=c) for c in contestants]
    patches += [
        Patch(facecolor="white", edgecolor=_GREY, hatch=_HATCHES.get(c, ".."), label=c)
        for c in compilers
    ]
    figure.legend(handles=patches, loc="outside lower center", ncols=5, frameon=False)
    with whole(file) as unfinished:
        figure.savefig(unfinished, dpi=150, format="png")


def _draw_operation(
    ax: Any, place: int, rows: Rows, contestants: Sequence[str], compilers: Sequence[str]
) -> None:
    baseline = best_eigen(rows)
    present = [
        row
        for contestant in contestants
        for compiler in compilers
        if (row := _one(rows, contestant, compiler)) is not None
    ]
    width = 0.86 / len(present)
    for index, row in enumerate(present):
        ratio = row["ns"] / (baseline or row["ns"])
        x = place - 0.43 + (index + 0.5) * width
        ax.bar(
            x, ratio - 1.0, width, bottom=1.0, color=_COLOURS[row["contestant"]],
            edgecolor="white", linewidth=0.4, hatch=_HATCHES.get(row["compiler"], ".."),
        )  # fmt: skip
        if row["contestant"] in {"generated", "generated, packs"}:
            above = ratio >= 1
            ax.text(x, ratio * (1.08 if above else 0.93), f"{ratio:.2f}", rotation=90, ha="center",
                    va="bottom" if above else "top", fontsize=8, color=_BLUE)  # fmt: skip
