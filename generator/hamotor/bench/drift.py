"""Long runs: how the errors of conserved quantities, and of the phase, grow with the steps.

Rounding errors that are independent add up as √n, and those of the phase, which a wrong momentum
makes grow, as n^1.5 (Brouwer's law); biased ones as n and n². A symplectic method's own error of
the energy does not grow at all, that of the phase as n.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hamotor.bench.endpoint import ATTITUDE
from hamotor.bench.problems import Problem
from hamotor.run.attitude import angle_between, rotation_matrices
from hamotor.run.library import Description, SceneLibrary
from hamotor.run.simulation import Simulation
from hamotor.scene.motors import motor_of, rotation_matrix, rotor_of_quaternion

SAMPLES: Final = 1000
_POINTS: Final = 24
_TURNED: Final = 0.5
"""Where an error of the phase is no longer small, rad."""

Rows = NDArray[np.float64]


@dataclass(frozen=True)
class Drift:
    """One conserved quantity of one long run, or its phase."""

    problem: str
    contestant: str
    family: str
    steps: int
    step: float
    """Of fixed steps; others took as many as their tolerance wants for `steps` of these."""
    quantity: str
    largest: float | None
    """Relative, of all samples; of the attitude in radians.  None where there is no sample."""
    exponent: float | None
    """p in error ∝ steps^p, fitted to the largest error so far over the last two decades."""
    exponent_error: float | None
    """Its standard error."""
    seconds: float
    curve: Sequence[tuple[float, float]] = field(default=())
    """(Steps, largest error so far), at steps a constant factor apart."""
    failure: str | None = None


class Conserved:
    """A scene's conserved quantities along runs that others made, and its exact attitude if known.

    Attitudes are exact for a free body: theta functions in quad, at any time.
    """

    def __init__(self, problem: Problem, library: SceneLibrary, method: str) -> None:
        self._problem, self._library, self._method = problem, library, method
        self._exact: dict[tuple[Fraction, int], Rows] = {}

    @property
    def description(self) -> Description:
        """Of the rows."""
        return self._library.description

    def start(self) -> Rows:
        """The row of the start."""
        return self._observe(self._problem.simulation.state)

    def rows(self, states: Sequence[Sequence[float]]) -> Rows:
        """Rows of states in the coordinates that public solvers have, as the scene itself sees
        them, up to the first that exploded."""
        found = []
        for x in states:
            try:
                found.append(self._observe(self._state(x)))
            except OverflowError:
                break
        return np.array(found)

    def exact(self, interval: Fraction, samples: int) -> Rows | None:
        """Rows at multiples of `interval`, or None where the motion has no closed form."""
        simulation = self._problem.simulation
        if "closed_form" not in simulation.methods:
            return None
        if (interval, samples) not in self._exact:
            library = simulation.compile(scalar="quad", method="closed_form").library
            rows = np.zeros((samples, len(library.description.columns)))
            with library.start("closed_form", step=interval, state=simulation.exact_state) as live:
                live.advance(samples, 1, rows)
            self._exact[interval, samples] = rows
        return self._exact[interval, samples]

    def _observe(self, state: Any) -> Rows:
        step = self._problem.simulation.end
        with self._library.start(self._method, step=step, state=state) as live:
            return live.observe()

    def _state(self, x: Sequence[float]) -> list[float]:
        """From generated equations', or a quaternion and body rates (place and velocity)."""
        generated = self._problem.generated
        if generated is not None:
            return generated.state(x)
        (body,) = self._problem.scene.bodies
        rotor = rotor_of_quaternion(x[:4])
        kinetic = np.array(body.kinetic_matrix)[:3, :3]
        momentum = [float(p) for p in kinetic @ np.array(x[4:7])]
        if len(x) == 7 and not body.group.translates:
            return [*map(float, rotor), *momentum]
        if len(x) == 7:  # turned alone: it stays, and moves on, as it started
            velocity = rotation_matrix(body.rotor) @ np.array(body.momentum[3:]) / body.mass
            x = [*x, *body.position, *velocity]
        motor = dict(
            zip(
                ("s", "e23", "e31", "e12", "e01", "e02", "e03", "e0123"),
                motor_of(x[7:10], rotor),
                strict=True,
            )
        )
        turned = rotation_matrices({k: np.array([v]) for k, v in motor.items()})[0]
        linear = body.mass * turned.T @ np.array(x[10:13])
        blades = [float(motor[name]) for name in self.description.motor]
        return [*blades, *momentum, *(float(p) for p in linear)]


def of_method(
    simulation: Simulation, library: SceneLibrary, method: str, steps: int
) -> tuple[int, int, Rows, float]:
    """`steps` steps of the scene's own size: steps done, steps between rows, rows, seconds.

    Fewer where a state is not finite.
    """
    every = max(steps // SAMPLES, 1)
    rows = np.zeros((steps // every, len(library.description.columns)))
    with library.start(method, step=step_of(simulation), state=simulation.state) as live:
        began = time.perf_counter()
        done = live.advance(steps, every, rows)
        seconds = time.perf_counter() - began
    return done, every, rows[: done // every], seconds


def step_of(simulation: Simulation) -> float:
    """The step of a scene's long runs, s."""
    return simulation.step or simulation.end / 1000


def drifts(
    about: Drift, conserved: Conserved, every: int, interval: Fraction, rows: Rows
) -> list[Drift]:
    """Rows of the report for one long run: `about` with every quantity in turn.

    `rows`: after each `every` steps, which take `interval`, s.
    """
    if not len(rows):
        return [replace(about, quantity=conserved.description.conserved[0].name)]
    counts = every * np.arange(1.0, len(rows) + 1)
    errors = dict(_relative_errors(conserved.description, conserved.start(), rows))
    exact = conserved.exact(interval, len(rows))
    if exact is not None:
        errors[ATTITUDE] = _angles(conserved.description, rows, exact)
    return [_fitted(about, quantity, counts, error) for quantity, error in errors.items()]


def _fitted(about: Drift, quantity: str, counts: Rows, error: Rows) -> Drift:
    largest = np.maximum.accumulate(error)
    fitted = largest
    if quantity == ATTITUDE:  # no line where it has come round
        fitted = largest[: int(np.searchsorted(largest, _TURNED))]
    exponent, doubt = _growth(counts[: len(fitted)], fitted)
    return replace(
        about,
        quantity=quantity,
        largest=float(largest[-1]),
        exponent=exponent,
        exponent_error=doubt,
        curve=[(float(counts[i]), float(largest[i])) for i in _spread(counts)],
    )


def _angles(description: Description, rows: Rows, exact: Rows) -> Rows:
    index = description.column_index
    worst = np.zeros(len(rows))
    for body in description.bodies:
        here, there = (
            rotation_matrices({b: of[:, index[f"{body}.motor.{b}"]] for b in description.motor})
            for of in (rows, exact)
        )
        worst = np.maximum(worst, angle_between(here, there))
    return worst


def _relative_errors(description: Description, start: Rows, rows: Rows) -> Mapping[str, Rows]:
    index = description.column_index
    found = {}
    for quantity in description.conserved:
        norm = np.linalg.norm([start[index[column]] for column in quantity.norm] or [0.0])
        scale: Any = float(norm) or quantity.scale
        if scale:
            column = index[quantity.column]
            found[quantity.name] = np.abs(rows[:, column] - start[column]) / scale
    return found


def _spread(counts: Rows) -> NDArray[np.int64]:
    """Where counts lie a constant factor apart, over the last two decades."""
    wanted = np.geomspace(max(counts[0], counts[-1] / 100), counts[-1], _POINTS)
    return np.unique(np.searchsorted(counts, wanted).clip(max=len(counts) - 1))


def _growth(counts: Rows, largest: Rows) -> tuple[float | None, float | None]:
    """The slope of log error over log steps, at points a constant factor apart."""
    if len(counts) < 10 or largest[-1] == 0:
        return None, None
    at = _spread(counts)
    at = at[largest[at] > 0]
    if len(at) < 5:
        return None, None
    x, y = np.log(counts[at]), np.log(largest[at])
    x = x - x.mean()
    slope = float(x @ y / (x @ x))
    left = y - y.mean() - slope * x
    return slope, float(np.sqrt(left @ left / (len(at) - 2) / (x @ x)))
