"""Two pictures of a run: where the bodies went, and how well what is constant stayed so.

Colours are Okabe and Ito's, which colour-blind readers can tell apart.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from hamotor.files import whole
from hamotor.run.attitude import AXES, has_attitude, rotation_matrices

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Table = Mapping[str, Array]

BLUE, VERMILLION, _GREEN = "#0072B2", "#D55E00", "#009E73"
_PURPLE, ORANGE, _SKY, _BLACK = "#CC79A7", "#E69F00", "#56B4E9", "#222222"
AXIS_COLOURS = (VERMILLION, _GREEN, BLUE, ORANGE)
_BODY_COLOURS = (_BLACK, _PURPLE, ORANGE, _SKY, _GREEN, BLUE, VERMILLION)
_LINE_COLOURS = (BLUE, VERMILLION, _GREEN, _PURPLE, ORANGE, _SKY, _BLACK)
_GREY = "#8a8a8a"
_DARK_GREY = "#555555"

_DPI = 150
_TRIADS = 12
_SPHERES_DRAWN = 3
_COARSE_TURN = 0.35  # radians between rows: a line would cut through the sphere, dots do not lie
_CROWDED = 100.0  # radians of trace on one sphere
_WIDE_SCALE = 20.0
_FLOOR = 1e-17
_NOISE = 1e-13
_EPSILON = float(np.finfo(float).eps)


def draw(report: Mapping[str, Any], table: Table, swings: Table) -> dict[str, Figure]:
    """Both pictures, by file name.

    `table`: recorded rows, column → (n,); `swings`: the largest |value − initial| around each of
    them.
    """
    return {
        "path.png": draw_path(report, table),
        "conserved.png": draw_conserved(report, table["t"], swings),
    }


def save(figures: Mapping[str, Figure], folder: Path) -> None:
    """Write the pictures into a folder, each as a whole or not at all."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        with whole(folder / name) as unfinished:
            figure.savefig(unfinished, dpi=_DPI, format="png")


def draw_path(report: Mapping[str, Any], table: Table) -> Figure:
    """Paths of the bodies that move from their place, attitudes of all of them."""
    bodies = list(report["final"])
    planar = f"{bodies[0]}.position.z" not in table and (
        "e23" not in report["final"][bodies[0]]["motor"]
    )
    plain = all(f"{body}.scale" not in table and _turns(body, report) for body in bodies)
    return _draw_planar(report, table) if planar and plain else _draw_spatial(report, table)


def _draw_spatial(report: Mapping[str, Any], table: Table) -> Figure:
    """A column for the paths, one for each attitude, and one over time for sizes and for motors."""
    bodies = list(report["final"])
    moving = [body for body in bodies if _extent(_position(body, table)) > 0]
    turning = [body for body in bodies if _turns(body, report) and _has_rotor(body, report)]
    turning = turning[:_SPHERES_DRAWN]
    scaling = [body for body in bodies if f"{body}.scale" in table]
    bending = [body for body in bodies if not _turns(body, report)][:_SPHERES_DRAWN]
    panels = len(turning) + len(bending) + bool(moving) + bool(scaling)
    figure = new_figure(5.2 * panels + 1.2, 8.2, layout=None)
    # Each column shows one thing in space and, below it, over time.
    grid = figure.add_gridspec(
        2,
        panels,
        height_ratios=(2.2, 1),
        left=0.85 / (5.2 * panels + 1.2),
        right=1 - 0.35 / (5.2 * panels + 1.2),
        bottom=0.125,
        top=0.875,
        wspace=0.22,
        hspace=0.1,
    )
    title(figure, report)
    column = 0
    if moving:
        space: Any = figure.add_subplot(grid[0, column], projection="3d")
        _draw_paths(space, report, table, moving)
        _draw_coordinates(figure.add_subplot(grid[1, column]), table, moving)
        column += 1
    for body in turning:
        rotation = _rotation(body, report, table)
        space = figure.add_subplot(grid[0, column], projection="3d")
        _draw_sphere(space, body, rotation)
        _draw_turning(figure.add_subplot(grid[1, column]), table["t"], rotation)
        column += 1
    if scaling:
        _draw_scales(figure.add_subplot(grid[:, column]), table, bodies)
        column += 1
    for body in bending:
        _draw_motor(figure.add_subplot(grid[:, column]), body, report, table)
        column += 1
    dimension = max((_rotation(body, report, table).shape[-1] for body in turning), default=0)
    _legend(figure, moving if len(moving) > 1 else [], axes=dimension)
    return figure


def _draw_scales(axes: Axes, table: Table, bodies: Sequence[str]) -> None:
    for number, body in enumerate(bodies):
        axes.plot(table["t"], table[f"{body}.scale"], color=_body_colour(number), linewidth=1.2)
    axes.set(xlabel="time (s)", ylabel="scale")
    axes.set_title("size", fontsize=10)
    low = min(float(table[f"{body}.scale"].min()) for body in bodies)
    high = max(float(table[f"{body}.scale"].max()) for body in bodies)
    if high > _WIDE_SCALE * low:
        axes.set_yscale("log")
    quiet_grid(axes)


def _draw_motor(axes: Axes, body: str, report: Mapping[str, Any], table: Table) -> None:
    styles: tuple[Literal["-", "--", ":"], ...] = ("-", "--", ":")
    for number, blade in enumerate(report["final"][body]["motor"]):
        axes.plot(
            table["t"],
            table[f"{body}.motor.{blade}"],
            styles[number // len(_LINE_COLOURS) % len(styles)],
            color=_LINE_COLOURS[number % len(_LINE_COLOURS)],
            linewidth=1.0,
            label=blade,
        )
    axes.set(xlabel="time (s)", ylabel="component")
    axes.set_title(f"motor of {body}", fontsize=10)
    axes.legend(fontsize=8, frameon=False, ncols=2)
    quiet_grid(axes)


def _draw_coordinates(axes: Axes, table: Table, moving: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    styles: tuple[Literal["-", "--", ":", "-."], ...] = ("-", "--", ":", "-.")
    styles = styles[: _position(moving[0], table).shape[-1]]
    for number, body in enumerate(moving):
        for values, style in zip(_position(body, table).T, styles, strict=False):
            axes.plot(table["t"], values, style, color=_body_colour(number), linewidth=1.0)
    axes.set(xlabel="time (s)", ylabel="position (m)")
    handles = [Line2D([], [], color=_BLACK, linestyle=style, linewidth=1.0) for style in styles]
    axes.legend(
        handles,
        AXES[: len(styles)],
        loc="lower right",
        bbox_to_anchor=(1, 1),
        ncols=len(styles),
        fontsize=8,
        frameon=False,
    )
    quiet_grid(axes)


def _draw_turning(axes: Axes, t: Array, rotation: Array) -> None:
    for axis, colour in enumerate(AXIS_COLOURS[: rotation.shape[-1]]):
        cosine = rotation[:, :, axis] @ rotation[0, :, axis]
        mark = "." if _is_coarse(rotation[:, :, axis]) else "-"
        axes.plot(t, cosine, mark, color=colour, linewidth=1.0, markersize=1.5, alpha=0.85)
    axes.set(xlabel="time (s)", ylabel="cos of the angle turned", ylim=(-1.08, 1.08))
    quiet_grid(axes)


def quiet_grid(axes: Axes) -> None:
    axes.grid(visible=True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    axes.margins(x=0.01)


def _draw_paths(axes: Any, report: Mapping[str, Any], table: Table, moving: Sequence[str]) -> None:
    paths = {body: _in_three(_position(body, table)) for body in moving}
    everything = np.concatenate(list(paths.values()))
    length = 0.1 * _extent(everything)
    turning = [body for body in moving if _turns(body, report) and _has_rotor(body, report)]
    for number, (body, path) in enumerate(paths.items()):
        colour = _body_colour(number)
        axes.plot(*path.T, color=colour, linewidth=1.1, alpha=0.85)
        axes.scatter(*path[:1].T, color=colour, marker="o", s=30, depthshade=False)
        axes.scatter(*path[-1:].T, color=colour, marker="s", s=30, depthshade=False)
        if body not in turning:
            continue
        size = table.get(f"{body}.scale", np.ones(len(path)))
        lengths = length * size / size.max()
        tips = lengths[:, None, None] * _in_three(_rotation(body, report, table), 1)
        for row in _evenly(path):
            for axis, axis_colour in enumerate(AXIS_COLOURS[: tips.shape[-1]]):
                tip = path[row] + tips[row, :, axis]
                axes.plot(*np.stack([path[row], tip]).T, color=axis_colour, linewidth=1.2)
    low, high = everything.min(axis=0), everything.max(axis=0)
    middle = (low + high) / 2
    half = np.maximum((high - low) / 2, 0.12 * float((high - low).max())) + length
    axes.set(
        xlim=(middle[0] - half[0], middle[0] + half[0]),
        ylim=(middle[1] - half[1], middle[1] + half[1]),
        zlim=(middle[2] - half[2], middle[2] + half[2]),
        xlabel="x (m)",
        ylabel="y (m)",
        zlabel="z (m)",
    )
    title = "path of the body frame's origin"
    if turning:
        title += "\nand the body axes on the way"
    if f"{moving[0]}.position.w" in table:
        title += ", seen along the fourth axis"
    axes.set_title(title, fontsize=10)
    # A tall box would reach beyond its panel.
    axes.set_box_aspect(half / half.max(), zoom=1.05 if half[2] < half.max() else 0.85)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(few_ticks())
    axes.tick_params(labelsize=8)


def _draw_sphere(axes: Any, body: str, rotation: Array) -> None:
    turns = np.linspace(0, 2 * np.pi, 97)
    for level in np.radians([-60, -30, 0, 30, 60]):
        ring = np.stack([np.cos(turns), np.sin(turns), 0 * turns]) * np.cos(level)
        ring[2] = np.sin(level)
        axes.plot(*ring, color=_GREY, linewidth=0.4, alpha=0.6)
    for meridian in np.radians(range(0, 180, 30)):
        ring = np.stack(
            [np.cos(turns) * np.cos(meridian), np.cos(turns) * np.sin(meridian), np.sin(turns)]
        )
        axes.plot(*ring, color=_GREY, linewidth=0.4, alpha=0.6)
    unit = np.eye(3)
    seen = "on the unit sphere"
    if rotation.shape[-1] == 4:
        seen = "in the unit ball, seen along the fourth axis"
    rotation = _in_three(rotation, 1)
    for axis, colour in enumerate(AXIS_COLOURS[: rotation.shape[-1]]):
        tips = rotation[:, :, axis]
        if _is_coarse(tips):
            axes.plot(*tips.T, ".", color=colour, markersize=1.2, alpha=0.5)
        else:
            width, alpha = (0.5, 0.6) if _arc_length(tips) > _CROWDED else (0.9, 0.8)
            axes.plot(*tips.T, color=colour, linewidth=width, alpha=alpha)
        axes.plot(*np.stack([0 * tips[-1], tips[-1]]).T, color=colour, linewidth=2.2)
        axes.scatter(*tips[:1].T, color=colour, marker="o", s=30, depthshade=False)
        axes.scatter(*tips[-1:].T, color=colour, marker="s", s=30, depthshade=False)
    for axis, label in enumerate(("e1", "e2", "e3")):
        tip = 1.22 * unit[axis]
        axes.plot(*np.stack([tip / 1.22, tip]).T, color=_GREY, linewidth=1.0)
        # Above the traces, whatever their depth, on a halo that keeps it readable.
        axes.text(
            *(1.12 * tip),
            label,
            color=_DARK_GREY,
            fontsize=9,
            ha="center",
            va="center",
            zorder=100,
            path_effects=_halo(),
        )
    axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(-1, 1))
    axes.set_axis_off()
    axes.set_title(f"attitude of {body}\ntraces of its axes {seen}", fontsize=10)
    axes.set_box_aspect((1, 1, 1), zoom=1.27)


def _legend(figure: Figure, bodies: Sequence[str], axes: int = 3) -> None:
    from matplotlib.lines import Line2D

    entries = [
        (Line2D([], [], color=_body_colour(number), linewidth=1.5), body)
        for number, body in enumerate(bodies)
    ]
    entries += [
        (Line2D([], [], color=colour, linewidth=2.5), f"body axis {k}")
        for k, colour in enumerate(AXIS_COLOURS[:axes], start=1)
    ]
    for marker, label in (("o", "start"), ("s", "end")):
        entries.append((Line2D([], [], color=_BLACK, marker=marker, linestyle="none"), label))
    figure.legend(
        [handle for handle, _ in entries],
        [label for _, label in entries],
        loc="outside lower center" if figure.get_layout_engine() else "lower center",
        ncols=min(len(entries), 8),
        frameon=False,
        fontsize=9,
    )


def _body_colour(number: int) -> str:
    return _BODY_COLOURS[number % len(_BODY_COLOURS)]


def _draw_planar(report: Mapping[str, Any], table: Table) -> Figure:
    figure = new_figure(11, 5.2)
    title(figure, report)
    place: Axes = figure.add_subplot(1, 2, 1)
    turn: Axes = figure.add_subplot(1, 2, 2)
    bodies = list(report["final"])
    extent = _extent(np.concatenate([_position(body, table) for body in bodies]))
    for number, body in enumerate(bodies):
        colour = _body_colour(number)
        path = _position(body, table)
        rotation = _rotation(body, report, table)
        place.plot(*path.T, color=colour, linewidth=1.2)
        place.plot(*path[0], "o", color=colour, markersize=6)
        place.plot(*path[-1], "s", color=colour, markersize=6)
        for row in _evenly(path):
            for axis, axis_colour in enumerate(AXIS_COLOURS[:2]):
                tip = path[row] + 0.08 * (extent or 1.0) * rotation[row, :, axis]
                place.plot(*np.stack([path[row], tip]).T, color=axis_colour, linewidth=1.4)
        angle = np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
        turn.plot(table["t"], angle, color=colour, linewidth=1.2)
    place.set(
        xlabel="x (m)",
        ylabel="y (m)",
        title="path of the body frame's origin\nand the body axes on the way",
    )
    place.set_aspect("equal", adjustable="datalim")
    turn.set(xlabel="time (s)", ylabel="angle (rad)", title="attitude")
    for axes in (place, turn):
        quiet_grid(axes)
        axes.title.set_fontsize(10)
    _legend(figure, bodies if len(bodies) > 1 else [], axes=2)
    return figure


def draw_conserved(report: Mapping[str, Any], t: Array, swings: Table) -> Figure:
    """Error of every conserved quantity against time, on a logarithmic axis.

    A quantity that started at zero has no relative error: its absolute one is drawn dashed.
    """
    figure = new_figure(9, 5.8)
    title(figure, report, "what must stay constant")
    axes: Axes = figure.add_subplot(1, 1, 1)
    smallest, largest = _EPSILON, _EPSILON
    exact = []
    for name, said in report["conserved"].items():
        error = swings[said["column"]] / (said["scale"] or 1.0)
        if not error.any():
            exact.append(name)
            continue
        # What is only rounding noise stays in the background.
        noise = bool(error.max() < _NOISE)
        axes.plot(
            t,
            np.maximum(error, _FLOOR),
            "-" if said["scale"] else "--",
            color=_LINE_COLOURS[len(axes.lines) % len(_LINE_COLOURS)],
            linewidth=0.6 if noise else 1.2,
            alpha=0.7 if noise else 0.95,
            zorder=2 if noise else 3,
            label=name if said["scale"] else f"{name} (absolute, {said['unit']})",
        )
        positive = error[error > 0]
        smallest, largest = min(smallest, positive.min()), max(largest, positive.max())
    axes.axhline(_EPSILON, color=_GREY, linewidth=0.9, linestyle=":")
    # Beside the axes, where no curve can cross it.
    axes.annotate(
        "rounding\nof a double",
        (1, _EPSILON),
        xycoords=("axes fraction", "data"),
        xytext=(5, 0),
        textcoords="offset points",
        va="center",
        fontsize=8,
        color=_DARK_GREY,
    )
    axes.set_yscale("log")
    bottom = max(_FLOOR, 10.0 ** np.floor(np.log10(smallest)))
    axes.set_ylim(bottom, 10.0 ** (np.ceil(np.log10(largest)) + 0.3))
    axes.set_xlim(float(t[0]), float(t[-1]) if t[-1] > t[0] else float(t[0]) + 1)
    axes.set(
        xlabel="time (s)",
        ylabel="relative error |Q(t) − Q(0)| / |Q(0)|",
    )
    quiet_grid(axes)
    handles = [line for line in axes.lines if not str(line.get_label()).startswith("_")]
    legend = figure.legend(
        handles,
        [str(line.get_label()) for line in handles],
        loc="outside lower center",
        ncols=3,
        frameon=False,
        fontsize=8.5,
        title=textwrap.fill("without any error: " + ", ".join(exact), 105) if exact else None,
        title_fontsize=8.5,
    )
    for line in legend.get_lines():
        line.set(linewidth=2, alpha=1)
    return figure


def new_figure(
    width: float, height: float, layout: Literal["constrained"] | None = "constrained"
) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout=layout, facecolor="white")


def title(figure: Figure, report: Mapping[str, Any], what: str = "") -> None:
    how = (
        f"{report['method']}, step {report['step']:.4g} s, {report['group']} in {report['algebra']}"
    )
    figure.suptitle(
        f"{report['scene']}{': ' if what else ''}{what}\n{how}", fontsize=11, fontweight="bold"
    )


def _halo() -> list[Any]:
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=3, foreground="white")]


def few_ticks() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4)


def _position(body: str, table: Table) -> Array:
    names = [f"{body}.position.{axis}" for axis in AXES]
    return np.stack([table[name] for name in names if name in table], axis=-1)


def _in_three(vectors: Array, axis: int = -1) -> Array:
    """Vectors of two dimensions with a zero, of four without their last component."""
    missing = 3 - vectors.shape[axis]
    if missing > 0:
        shape = list(vectors.shape)
        shape[axis] = missing
        return np.concatenate([vectors, np.zeros(shape)], axis=axis)
    return np.take(vectors, range(3), axis=axis)


def _turns(body: str, report: Mapping[str, Any]) -> bool:
    return has_attitude(report["algebra"], report["final"][body]["motor"])


def _has_rotor(body: str, report: Mapping[str, Any]) -> bool:
    """Whether anything but 1 turns directions; on translations nothing does."""
    return any(not set(blade) & set("s0i") for blade in report["final"][body]["motor"])


def _rotation(body: str, report: Mapping[str, Any], table: Table) -> Array:
    blades = report["final"][body]["motor"]
    return rotation_matrices({blade: table[f"{body}.motor.{blade}"] for blade in blades})


def _extent(points: Array) -> float:
    """The longest side of the box around the points; 0 where it is only rounding."""
    if not len(points):
        return 0.0
    side = float(np.ptp(points, axis=0).max())
    return side if side > 1e-9 * max(1.0, float(np.abs(points).max())) else 0.0


def _evenly(path: Array) -> list[int]:
    """Rows at which to draw the body's axes: evenly spread over the recorded times."""
    return sorted(set(np.linspace(0, len(path) - 1, min(_TRIADS, len(path))).round().astype(int)))


def _is_coarse(tips: Array) -> bool:
    if len(tips) < 3:
        return True
    return float(np.median(np.linalg.norm(np.diff(tips, axis=0), axis=1))) > _COARSE_TURN


def _arc_length(tips: Array) -> float:
    return float(np.linalg.norm(np.diff(tips, axis=0), axis=1).sum())
