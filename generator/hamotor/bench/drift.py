"""Long runs: how the errors of conserved quantities grow with the number of steps.

Rounding errors that are independent add up as √n (Brouwer's law), biased ones as n; a symplectic
method's own error of the energy does not grow at all.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hamotor.run.library import Description, SceneLibrary
from hamotor.run.simulation import Simulation

_SAMPLES: Final = 1000
_POINTS: Final = 24


@dataclass(frozen=True)
class Drift:
    """One conserved quantity of one long run."""

    problem: str
    contestant: str
    steps: int
    step: float
    quantity: str
    largest: float
    """Relative, of all samples."""
    exponent: float | None
    """p in error ∝ steps^p, fitted to the largest error so far over the last two decades."""
    exponent_error: float | None
    """Its standard error."""
    seconds: float


def drifts(
    name: str, simulation: Simulation, library: SceneLibrary, method: str, steps: int
) -> list[Drift]:
    """Take `steps` steps of the scene's own size; a row for every conserved quantity.

    Shorter where a state is not finite: the rows say how many steps were taken.
    """
    step = simulation.step or simulation.end / 1000
    every = max(steps // _SAMPLES, 1)
    description = library.description
    rows = np.zeros((steps // every, len(description.columns)))
    with library.start(method, step=step, state=simulation.state) as live:
        start = live.observe()
        began = time.perf_counter()
        done = live.advance(steps, every, rows)
        seconds = time.perf_counter() - began
    rows = rows[: done // every]
    counts = every * np.arange(1.0, len(rows) + 1)
    found = []
    for quantity, error in _relative_errors(description, start, rows).items():
        largest = np.maximum.accumulate(error)
        exponent, doubt = _growth(counts, largest)
        worst = float(largest[-1]) if len(largest) else 0.0
        found.append(Drift(name, method, done, step, quantity, worst, exponent, doubt, seconds))
    return found


def _relative_errors(
    description: Description, start: NDArray[np.float64], rows: NDArray[np.float64]
) -> Mapping[str, NDArray[np.float64]]:
    index = description.column_index
    found = {}
    for quantity in description.conserved:
        norm = np.linalg.norm([start[index[column]] for column in quantity.norm] or [0.0])
        scale: Any = float(norm) or quantity.scale
        if scale:
            column = index[quantity.column]
            found[quantity.name] = np.abs(rows[:, column] - start[column]) / scale
    return found


def _growth(
    counts: NDArray[np.float64], largest: NDArray[np.float64]
) -> tuple[float | None, float | None]:
    """The slope of log error over log steps, at points a constant factor apart."""
    if len(counts) < 10 or largest[-1] == 0:
        return None, None
    wanted = np.geomspace(max(counts[0], counts[-1] / 100), counts[-1], _POINTS)
    at = np.unique(np.searchsorted(counts, wanted).clip(max=len(counts) - 1))
    at = at[largest[at] > 0]
    if len(at) < 5:
        return None, None
    x, y = np.log(counts[at]), np.log(largest[at])
    x = x - x.mean()
    slope = float(x @ y / (x @ x))
    left = y - y.mean() - slope * x
    return slope, float(np.sqrt(left @ left / (len(at) - 2) / (x @ x)))
