"""The pictures of a run: what stands in them, for every kind of motion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.generator.toy import toy

from hamotor import Run
from hamotor.run.pictures import draw_conserved, draw_path

Array = NDArray[np.float64]


def spinning(body: str, t: Array, place: Array, *, planar: bool = False) -> dict[str, Array]:
    """A body that turns at 1 rad/s while its origin goes through `place`, shape (n, d)."""
    table = {f"{body}.motor.s": np.cos(t / 2), f"{body}.motor.e12": -np.sin(t / 2)}
    if not planar:
        table |= {f"{body}.motor.e23": 0 * t, f"{body}.motor.e31": 0 * t}
    axes = "xy" if planar else "xyz"
    return table | {f"{body}.position.{a}": place[:, k] for k, a in enumerate(axes)}


def account(table: Mapping[str, Array], conserved: Mapping[str, Any] | None = None) -> Any:
    bodies = dict.fromkeys(name.partition(".")[0] for name in table if ".motor." in name)
    motors = {b: [n.split(".")[2] for n in table if n.startswith(f"{b}.motor.")] for b in bodies}
    return {
        "scene": "drawn",
        "method": "splitting2",
        "step": 0.01,
        "group": "SE3",
        "algebra": "pga3",
        "final": {body: {"motor": dict.fromkeys(motors[body], 0.0)} for body in bodies},
        "conserved": conserved or {},
    }


def titles(figure: Any) -> list[str]:
    return [axes.get_title().splitlines()[0] for axes in figure.axes if axes.get_title()]


T = np.linspace(0, 6, 200)
CIRCLE = np.stack([np.cos(T), np.sin(T), 0.1 * T], -1)


def test_a_body_that_moves_has_a_path_and_an_attitude() -> None:
    table = {"t": T, **spinning("top", T, CIRCLE)}
    figure = draw_path(account(table), table)
    assert titles(figure) == [
        "path of the body frame's origin",
        "attitude of top",
    ]
    assert figure.axes[0].get_xlabel() == "x (m)"


def test_a_body_that_stays_in_its_place_has_an_attitude_only() -> None:
    table = {"t": T, **spinning("top", T, 0 * CIRCLE + 5.0 + 1e-16)}
    assert titles(draw_path(account(table), table)) == ["attitude of top"]


def test_several_bodies_share_one_picture_and_are_named() -> None:
    table = {"t": T, **spinning("sun", T, 0 * CIRCLE), **spinning("moon", T, CIRCLE)}
    table |= spinning("mars", T, 2 * CIRCLE)
    figure = draw_path(account(table), table)
    entries = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "moon" in entries
    assert "mars" in entries
    assert titles(figure)[1:] == ["attitude of sun", "attitude of moon", "attitude of mars"]


def test_what_is_shown_in_space_is_shown_over_time_below_it() -> None:
    table = {"t": T, **spinning("top", T, CIRCLE)}
    below = [axes for axes in draw_path(account(table), table).axes if not axes.get_title()]
    assert [axes.get_xlabel() for axes in below] == ["time (s)", "time (s)"]
    turned = np.asarray(below[1].lines[0].get_ydata(), dtype=np.float64)
    np.testing.assert_allclose(turned, np.cos(T), atol=1e-12)


def test_a_planar_scene_is_drawn_in_the_plane() -> None:
    table = {"t": T, **spinning("plate", T, CIRCLE[:, :2], planar=True)}
    figure = draw_path(account(table), table)
    assert [axes.get_xlabel() for axes in figure.axes] == ["x (m)", "time (s)"]
    assert figure.axes[1].get_ylabel() == "angle (rad)"


def test_a_run_of_one_row_can_be_drawn(tmp_path: Path) -> None:
    run = toy().run()
    short = {name: values[:1] for name, values in run.trajectory.items()}
    Run(run.report, trajectory=short, units=run.units).plot(tmp_path)
    assert (tmp_path / "path.png").exists()


def conserved(scale: float = 1.0) -> dict[str, Any]:
    return {"scale": scale, "unit": "J", "column": "q"}


def test_the_axis_of_errors_is_logarithmic_and_reaches_rounding() -> None:
    swings = {"q": 1e-9 * (1 - np.cos(T))}
    figure = draw_conserved(account({}, {"q": conserved()}), T, swings)
    axes = figure.axes[0]
    assert axes.get_yscale() == "log"
    assert axes.get_ylim()[0] < 2.3e-16
    assert axes.get_ylim()[1] > 2e-9
    assert axes.get_xlabel() == "time (s)"


def test_quantities_without_any_error_are_named_below() -> None:
    quantities = {"q": conserved(), "p": {**conserved(), "column": "p"}}
    figure = draw_conserved(account({}, quantities), T, {"q": 0 * T, "p": 1e-9 * T})
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["p"]
    assert figure.legends[0].get_title().get_text() == "without any error: q"


def test_an_absolute_error_is_dashed_and_has_its_unit() -> None:
    figure = draw_conserved(account({}, {"q": conserved(0.0)}), T, {"q": 1e-12 * T})
    (line,) = (line for line in figure.axes[0].lines if line.get_label() == "q (absolute, J)")
    assert line.get_linestyle() == "--"


def test_a_scene_that_conserves_nothing_has_a_picture_too(tmp_path: Path) -> None:
    draw_conserved(account({}), T, {}).savefig(tmp_path / "conserved.png")


def test_pictures_are_written_as_png_beside_the_run(tmp_path: Path) -> None:
    toy().run(out=tmp_path)
    for name in ("path.png", "conserved.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


@pytest.mark.parametrize("rows", [2, 3, 50])
def test_few_rows_can_be_drawn(tmp_path: Path, rows: int) -> None:
    toy().run(end=float(rows - 1), step=1.0).plot(tmp_path)


def four_dimensional(t: Array) -> dict[str, Array]:
    """Turning in the planes 12 and 34 at once, while the origin goes round in four dimensions."""
    c, s = np.cos(t / 2), np.sin(t / 2)
    motor = {"s": c * c, "e12": -s * c, "e34": -s * c, "e1234": s * s, "e04": 0 * t}
    place = np.stack([np.cos(t), np.sin(t), 0.1 * t, np.cos(2 * t)], -1)
    return {f"top.motor.{blade}": x for blade, x in motor.items()} | {
        f"top.position.{axis}": place[:, k] for k, axis in enumerate("xyzw")
    }


def test_four_dimensions_are_seen_along_the_fourth() -> None:
    table = {"t": T, **four_dimensional(T)}
    figure = draw_path(account(table), table)
    assert titles(figure) == ["path of the body frame's origin", "attitude of top"]
    assert "seen along the fourth axis" in figure.axes[0].get_title()
    entries = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "body axis 4" in entries
    over_time = [axes for axes in figure.axes if not axes.get_title()]
    assert [len(axes.lines) for axes in over_time] == [4, 4]
    for line in over_time[1].lines:
        np.testing.assert_allclose(np.asarray(line.get_ydata()), np.cos(T), atol=1e-12)


def test_a_body_that_scales_has_its_size_over_time() -> None:
    table = {"t": T, **spinning("top", T, CIRCLE), "top.scale": 1 + 0.1 * np.sin(T)}
    figure = draw_path(account(table), table)
    assert titles(figure)[-1] == "size"
    (line,) = figure.axes[-1].lines
    np.testing.assert_array_equal(np.asarray(line.get_ydata()), table["top.scale"])
    assert figure.axes[-1].get_yscale() == "linear"
    table["top.scale"] = np.exp(T)
    assert draw_path(account(table), table).axes[-1].get_yscale() == "log"


def test_a_group_that_bends_lines_shows_its_motor_instead_of_an_attitude() -> None:
    table = {"t": T, **spinning("top", T, CIRCLE), "top.motor.e01": 0 * T}
    figure = draw_path(account(table) | {"algebra": "cga3"}, table)
    assert titles(figure) == ["path of the body frame's origin", "motor of top"]
    assert "axes" not in figure.axes[0].get_title()
    assert len(figure.axes[-1].lines) == 5
