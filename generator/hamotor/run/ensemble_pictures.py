"""The picture of an ensemble: where its members went, and how far they are from one another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hamotor.run.attitude import AXES
from hamotor.run.ensemble import DRAWN
from hamotor.run.pictures import (
    AXIS_COLOURS,
    BLUE,
    ORANGE,
    VERMILLION,
    few_ticks,
    new_figure,
    quiet_grid,
    title,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


def draw_ensemble(
    report: Mapping[str, Any],
    statistics: Mapping[str, NDArray[Any]],
    sample: Array,
    columns: list[str],
) -> dict[str, Figure]:
    """`cloud.png`: members at the first, the middle and the last time, and coordinates over time.

    `sample`: rows of some members, (members, times, columns without t), NaN after a failure.
    Coordinates are those of the bodies' positions in m; a scene without any has its energy drawn.
    """
    places = [name for name in columns if ".position." in name]
    dotted = [places[k : k + n] for k, n in _bodies(places)] if len(sample) else []
    wide = 6.2 if dotted else 0.0
    figure = new_figure(wide + 6.0, 5.4)
    title(figure, report, f"{report['ensemble']['members']:,} members")
    grid = figure.add_gridspec(1, 2 if dotted else 1, width_ratios=(1.1, 1) if dotted else None)
    if dotted:
        spatial = len(dotted[0]) >= len("xyz")
        space: Any = figure.add_subplot(grid[0, 0], projection="3d" if spatial else None)
        _draw_dots(space, sample, [[columns.index(name) for name in body] for body in dotted])
        times = statistics["t"][[0, len(statistics["t"]) // 2, -1]]
        for artist, t in zip(space.collections, times, strict=False):
            artist.set_label(f"t = {t:.4g} s")
        space.legend(fontsize=8, frameon=False, loc="upper left", markerscale=4)
    _draw_fans(figure.add_subplot(grid[0, -1]), statistics, places[:3] or ["energy"])
    return {"cloud.png": figure}


def _bodies(places: list[str]) -> list[tuple[int, int]]:
    """Where each body's coordinates begin, and how many there are."""
    names = [name.rpartition(".position.")[0] for name in places]
    return [(names.index(body), names.count(body)) for body in dict.fromkeys(names)]


def _draw_dots(space: Any, sample: Array, bodies: list[list[int]]) -> None:
    times = sample.shape[1]
    for time, colour in zip((0, times // 2, times - 1), (ORANGE, BLUE, VERMILLION), strict=True):
        rows = sample[:DRAWN, time]
        points = np.concatenate([rows[:, body[:3]] for body in bodies])
        points = points[np.isfinite(points).all(axis=1)]
        space.scatter(*points.T, s=1.5, color=colour, alpha=0.6, linewidths=0)
    space.set_aspect("equal")
    for axis, name in zip(("x", "y", "z"), AXES, strict=False):
        if hasattr(space, f"set_{axis}label"):
            getattr(space, f"set_{axis}label")(f"{name} (m)", fontsize=9)
            getattr(space, f"{axis}axis").set_major_locator(few_ticks())
    space.tick_params(labelsize=8)


def _draw_fans(axes: Axes, statistics: Mapping[str, NDArray[Any]], names: list[str]) -> None:
    t = statistics["t"]
    for name, colour in zip(names, AXIS_COLOURS, strict=False):
        mean, deviation = statistics[f"{name}.mean"], statistics[f"{name}.sd"]
        axes.plot(t, mean, color=colour, linewidth=1.2, label=name)
        axes.fill_between(t, mean - deviation, mean + deviation, color=colour, alpha=0.18)
        for edge in ("min", "max"):
            axes.plot(t, statistics[f"{name}.{edge}"], ":", color=colour, linewidth=0.8)
    place = ".position." in names[0]
    axes.set(xlabel="time (s)", ylabel="position (m)" if place else "energy (J)")
    axes.set_title("mean, ± one standard deviation; dotted: extremes", fontsize=9)
    axes.legend(fontsize=8, frameon=False, loc="upper left")
    quiet_grid(axes)
