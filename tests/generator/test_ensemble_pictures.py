"""The picture of an ensemble shows the members it was given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hamotor.run.ensemble_pictures import draw_ensemble

TIMES, MEMBERS = 5, 7


def account_of(columns: list[str]) -> tuple[dict[str, Any], dict[str, NDArray[Any]], NDArray[Any]]:
    sample = np.random.default_rng(1).normal(size=(MEMBERS, TIMES, len(columns)))
    statistics: dict[str, NDArray[Any]] = {"t": np.linspace(0, 2, TIMES)}
    for k, name in enumerate(columns):
        statistics[f"{name}.mean"] = sample[..., k].mean(axis=0)
        statistics[f"{name}.sd"] = sample[..., k].std(axis=0)
        statistics[f"{name}.min"] = sample[..., k].min(axis=0)
        statistics[f"{name}.max"] = sample[..., k].max(axis=0)
    report = {"scene": "s", "method": "rk4", "step": 0.1, "group": "SE3", "algebra": "pga3"}
    return report | {"ensemble": {"members": MEMBERS}}, statistics, sample


def places(*bodies: str, axes: str) -> list[str]:
    return ["a.motor.s", *(f"{body}.position.{axis}" for body in bodies for axis in axes), "energy"]


@pytest.mark.parametrize("axes", ["xy", "xyz"])
def test_dots_are_where_the_members_of_all_bodies_are(axes: str) -> None:
    columns = places("a", "b", axes=axes)
    report, statistics, sample = account_of(columns)
    sample[3, -1] = np.nan  # a member that has failed
    figure = draw_ensemble(report, statistics, sample, columns)["cloud.png"]
    figure.canvas.draw()
    shown = figure.axes[0].collections
    assert [str(dots.get_label()) for dots in shown] == ["t = 0 s", "t = 1 s", "t = 2 s"]
    start: Any = shown[0]
    found = np.stack(start._offsets3d, axis=-1) if axes == "xyz" else start.get_offsets()
    both = sample[:, 0, 1:-1].reshape(MEMBERS, 2, len(axes)).transpose(1, 0, 2)
    np.testing.assert_array_equal(np.asarray(found), both.reshape(-1, len(axes)))
    last: Any = shown[2]
    left = last._offsets3d[0] if axes == "xyz" else last.get_offsets()
    assert len(left) == 2 * (MEMBERS - 1)


def test_without_positions_it_shows_the_energy() -> None:
    report, statistics, sample = account_of(["a.motor.s", "energy"])
    figure = draw_ensemble(report, statistics, sample, ["a.motor.s", "energy"])["cloud.png"]
    (axes,) = figure.axes
    assert axes.get_ylabel() == "energy (J)"
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), statistics["energy.mean"])
