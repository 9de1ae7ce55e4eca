"""A run as its caller holds it: arrays by name, the account of it, its pictures."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hamotor.errors import NumericsError, UsageError, suggest
from hamotor.run.attitude import AXES, has_attitude, rotation_matrices
from hamotor.run.dataset import REPORT, is_run, read_events, read_thinned, read_trajectory, thinned
from hamotor.run.library import Description
from hamotor.run.report import Report, summary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_DRAWN_ROWS = 20_000


class Run:
    """A finished, interrupted or failed run.

    `report` is the content of `run.json`, `folder` where it was written (None: only in memory).
    Arrays have one row per recorded time; SI units; body names as in the scene.
    """

    def __init__(
        self,
        report: Report,
        *,
        folder: Path | None = None,
        trajectory: Mapping[str, Array] | None = None,
        units: Mapping[str, str] | None = None,
        events: Mapping[str, NDArray[Any]] | None = None,
    ) -> None:
        self.report = report
        self.folder = folder
        self._trajectory = trajectory
        self._units = units
        self._events = events

    @property
    def trajectory(self) -> Mapping[str, Array]:
        """Every column of the trajectory: name → values, shape (n,).  Read from disk once."""
        if self._trajectory is None:
            assert self.folder is not None
            self._trajectory = read_trajectory(self.folder)
        return self._trajectory

    @property
    def events(self) -> Mapping[str, NDArray[Any]]:
        """What happened: `event`, the events' names, and every column of the trajectory then.

        Shape (n,) each, in order of the run; empty where nothing happened.  Read from disk once.
        """
        if self._events is None:
            self._events = {} if self.folder is None else read_events(self.folder)
        return self._events

    @property
    def units(self) -> Mapping[str, str]:
        """Column name → unit; "1" for a pure number."""
        if self._units is None:
            assert self.folder is not None
            self._units = _units_on_disk(self.folder)
        return self._units

    @property
    def status(self) -> str:
        """`finished`, `interrupted` or `failed`."""
        return str(self.report["status"])

    @property
    def bodies(self) -> tuple[str, ...]:
        """The names of the bodies, in the scene's order."""
        return tuple(self.report["final"])

    @property
    def t(self) -> Array:
        """The recorded times, s, shape (n,)."""
        return self.trajectory["t"]

    @property
    def energy(self) -> Array:
        """The total energy, J, shape (n,)."""
        return self.trajectory["energy"]

    @property
    def final(self) -> Mapping[str, Mapping[str, Any]]:
        """The last state, per body: motor, momentum, position, rotation, scale.

        Numbers; strings with all digits where the scalar is wider than a double.
        """
        final: Mapping[str, Mapping[str, Any]] = self.report["final"]
        return final

    @property
    def conserved(self) -> Mapping[str, Mapping[str, Any]]:
        """Per conserved quantity: initial, final, max_relative_error, scale, unit."""
        conserved: Mapping[str, Mapping[str, Any]] = self.report["conserved"]
        return conserved

    def motor(self, body: str | None = None) -> Array:
        """The motor, body to world: shape (n, components) in the order of its blades.

        `body` may be left out where there is only one.  Raises UsageError for an unknown body.
        """
        return self._stacked(body, "motor")

    def momentum(self, body: str | None = None) -> Array:
        """The momentum in the body frame: shape (n, dimension), angular first, then linear."""
        return self._stacked(body, "momentum")

    def position(self, body: str | None = None) -> Array:
        """Where the body frame's origin is in the world, m: shape (n, 2, 3 or 4)."""
        body = self._body(body)
        names = [f"{body}.position.{axis}" for axis in AXES]
        return np.stack([self.trajectory[n] for n in names if n in self.trajectory], axis=-1)

    def rotation(self, body: str | None = None) -> Array:
        """R with v_world = R v_body: shape (n, d, d).

        Raises UsageError where the group bends lines, as `has_attitude` says.
        """
        body = self._body(body)
        blades = self.final[body]["motor"]
        if not self.has_attitude(body):
            raise UsageError(f"{self.report['group']} does not keep lines straight: no rotation.")
        return rotation_matrices({b: self.trajectory[f"{body}.motor.{b}"] for b in blades})

    def has_attitude(self, body: str | None = None) -> bool:
        """Whether the body has a rotation: not in space-time, nor where lines are bent."""
        return has_attitude(self.report["algebra"], self.final[self._body(body)]["motor"])

    def scale(self, body: str | None = None) -> Array:
        """By how much the body is enlarged: shape (n,); ones where the group keeps lengths."""
        column = f"{self._body(body)}.scale"
        return self.trajectory.get(column, np.ones_like(self.t))

    def summary(self) -> str:
        """A dozen lines for a person."""
        return summary(self.report, folder=self.folder)

    def plot(self, folder: str | os.PathLike[str] | None = None) -> dict[str, Figure]:
        """Draw the paths and attitudes and the errors of the conserved quantities.

        Returns file name → matplotlib Figure (`path.png`, `conserved.png`) and, if `folder` is
        given, writes them there.
        """
        from hamotor.run.pictures import draw, save

        figures = draw(self.report, *self._thinned())
        if folder is not None:
            save(figures, Path(folder))
        return figures

    def _thinned(self) -> tuple[Mapping[str, Array], Mapping[str, Array]]:
        if self._trajectory is None and self.folder is not None:
            return read_thinned(self.folder, _DRAWN_ROWS)
        return thinned([self.trajectory], len(self.t), _DRAWN_ROWS)

    def _stacked(self, body: str | None, part: str) -> Array:
        body = self._body(body)
        names = self.final[body][part]
        return np.stack([self.trajectory[f"{body}.{part}.{name}"] for name in names], axis=-1)

    def _body(self, body: str | None) -> str:
        if body is None:
            if len(self.bodies) == 1:
                return self.bodies[0]
            raise UsageError(f"which body? This run has {', '.join(self.bodies)}.")
        if body not in self.bodies:
            raise UsageError(
                f'unknown body "{body}"; this run has {", ".join(self.bodies)}.'
                f"{suggest(body, self.bodies)}"
            )
        return body

    def __repr__(self) -> str:
        report = self.report
        return (
            f"<hamotor.Run {report['scene']}: {report['method']}, {report['steps']:,} steps to "
            f"t = {report['t_end']:g} s, {report['status']}>"
        )


class RunFailed(NumericsError):
    """The numbers failed on the way; `run` holds what was computed until then."""

    def __init__(self, message: str, run: Run) -> None:
        super().__init__(message)
        self.run = run


class RunInterrupted(KeyboardInterrupt):
    """Ctrl-C or SIGTERM ended the run; `run` holds what was computed until then."""

    def __init__(self, run: Run) -> None:
        super().__init__("interrupted")
        self.run = run


def open_run(folder: str | os.PathLike[str]) -> Run:
    """A run that was written to disk.  Raises UsageError where there is none."""
    path = Path(folder)
    if path.name == REPORT and path.is_file():
        path = path.parent
    if not is_run(path):
        raise UsageError(f"{path} holds no hamotor run: no valid {REPORT} there.")
    report = json.loads((path / REPORT).read_text(encoding="utf-8"))
    if "ensemble" in report:
        raise UsageError(f"{path} holds an ensemble; open it with hamotor.open_ensemble.")
    return Run(report, folder=path)


def units_of(description: Description) -> dict[str, str]:
    """Column name → unit."""
    return {column.name: column.unit for column in description.columns}


def _units_on_disk(folder: Path) -> dict[str, str]:
    import pyarrow.parquet as pq

    from hamotor.run.dataset import trajectory_parts

    schema = pq.read_schema(trajectory_parts(folder)[0])
    return {
        field.name: (field.metadata or {}).get(b"unit", b"1").decode("utf-8") for field in schema
    }
