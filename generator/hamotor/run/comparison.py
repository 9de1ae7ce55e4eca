"""Two runs side by side: how far apart they are, in the units of the quantities."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hamotor.errors import UsageError
from hamotor.run.attitude import angle_between
from hamotor.run.result import Run

_SAME_TIME = 1e-9


@dataclass(frozen=True)
class Difference:
    """How far apart two runs are in one quantity: at the last common time, and at most."""

    body: str
    quantity: str
    unit: str
    at_end: float
    largest: float


@dataclass(frozen=True)
class Comparison:
    """The differences of two runs over the times both recorded."""

    times: int
    last_time: float
    differences: tuple[Difference, ...]
    ends: tuple[float, float] = (0.0, 0.0)
    """When each run ends, s."""
    recorded: tuple[int, int] = (0, 0)
    """How many times each recorded."""
    notes: tuple[str, ...] = ()
    """What else tells the runs apart."""

    @property
    def largest(self) -> float:
        """The largest number in the table, whatever its unit; NaN counts as infinite."""
        values = [difference.largest for difference in self.differences]
        return max((np.inf if np.isnan(v) else v for v in values), default=0.0)


def compare(one: Run, other: Run) -> Comparison:
    """Attitude (rad), position (m), momenta (their units) per body, energy (J) and when events
    happened (s), the first of a name in one run beside the first in the other, and so on.

    Compared at the times that both runs recorded.  Raises UsageError when the runs do not hold the
    same bodies in the same space, or share no time.
    """
    if set(one.bodies) != set(other.bodies):
        raise UsageError(
            f"the runs hold different bodies: {', '.join(one.bodies)} and "
            f"{', '.join(other.bodies)}."
        )
    here, there = _common_times(one.t, other.t)
    if not len(here) or (one.t[here[-1]] == 0 and (one.t[-1] or other.t[-1])):
        raise UsageError(
            "the runs share no recorded time after the start; "
            "run both with the same interval, or the same step and every."
        )
    differences = [
        Difference(body, quantity, unit, float(distance[-1]), float(distance.max()))
        for body, quantity, unit, distance in _distances(one, here, other, there)
    ]
    times, notes = _events(one, other)
    return Comparison(
        len(here),
        float(one.t[here[-1]]),
        (*differences, *times),
        (float(one.t[-1]), float(other.t[-1])),
        (len(one.t), len(other.t)),
        notes,
    )


def _events(one: Run, other: Run) -> tuple[list[Difference], tuple[str, ...]]:
    """How far apart in time events are, and which did not happen as often in both runs."""
    found, notes = [], []
    first, second = (
        {str(name): run.events["t"][run.events["event"] == name] for name in run.events["event"]}
        if run.events
        else {}
        for run in (one, other)
    )
    for name in dict.fromkeys([*first, *second]):
        here, there = first.get(name, np.zeros(0)), second.get(name, np.zeros(0))
        both = min(len(here), len(there))
        if both:
            apart = np.abs(here[:both] - there[:both])
            found.append(
                Difference("", f"time of {name}", "s", float(apart[-1]), float(apart.max()))
            )
        if len(here) != len(there):
            notes.append(f"{name} happened {len(here):,} and {len(there):,} times")
    return found, tuple(notes)


_KINDS = {"kg m^2/s": "angular momentum", "kg m/s": "linear momentum"}


def _common_times(
    one: NDArray[np.float64], other: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices of the times that are equal but for rounding; runs may go back in time."""
    grid = _SAME_TIME * max(abs(float(one[-1])), abs(float(other[-1])), np.finfo(float).tiny)
    order = np.argsort(other, kind="stable")
    ascending = other[order]
    after = np.minimum(np.searchsorted(ascending, one), len(other) - 1)
    before = np.maximum(after - 1, 0)
    closer_before = np.abs(ascending[before] - one) < np.abs(ascending[after] - one)
    nearest = order[np.where(closer_before, before, after)]
    here = np.flatnonzero(np.abs(other[nearest] - one) <= grid)
    return here, nearest[here]


def _distances(
    one: Run, here: NDArray[np.intp], other: Run, there: NDArray[np.intp]
) -> Iterator[tuple[str, str, str, NDArray[np.float64]]]:
    for body in one.bodies:
        places = one.position(body)[here], other.position(body)[there]
        if places[0].shape != places[1].shape:
            raise UsageError(f'body "{body}" moves in spaces of different dimension.')
        if one.has_attitude(body) and other.has_attitude(body):
            attitudes = one.rotation(body)[here], other.rotation(body)[there]
            yield body, "attitude", "rad", angle_between(*attitudes)
        yield body, "position", "m", np.linalg.norm(places[0] - places[1], axis=-1)
        if f"{body}.scale" in one.units or f"{body}.scale" in other.units:
            yield body, "scale", "1", np.abs(one.scale(body)[here] - other.scale(body)[there])
        for unit, names in _momenta_by_unit(one, other, body).items():
            kind = _KINDS.get(unit, "momentum")
            change = [one.trajectory[n][here] - other.trajectory[n][there] for n in names]
            yield body, kind, unit, np.linalg.norm(np.stack(change, -1), axis=-1)
    energies = one.energy[here] - other.energy[there]
    yield "", "energy", one.units["energy"], np.abs(energies)


def _momenta_by_unit(one: Run, other: Run, body: str) -> dict[str, list[str]]:
    groups: dict[str, list[str]] = {}
    for name in one.final[body]["momentum"]:
        column = f"{body}.momentum.{name}"
        if column in other.trajectory:
            groups.setdefault(one.units[column], []).append(column)
    return groups


def table(comparison: Comparison) -> str:
    """The comparison as text, one line a quantity."""
    rows = [("body", "quantity", "at the end", "at most", "unit")]
    rows += [
        (d.body, d.quantity, f"{d.at_end:.3g}", f"{d.largest:.3g}", d.unit)
        for d in comparison.differences
    ]
    widths = [max(len(row[k]) for row in rows) for k in range(5)]
    lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) for row in rows]
    counts = [n for n in dict.fromkeys(comparison.recorded) if n > comparison.times]
    of = f", of {' and '.join(f'{n:,}' for n in counts)} recorded" if counts else ""
    lines.append(f"over {comparison.times:,} common times to t = {comparison.last_time:.6g} s{of}")
    beyond = [end for end in comparison.ends if abs(end) > abs(comparison.last_time)]
    apart = max((abs(end - comparison.last_time) for end in beyond), default=0.0)
    if apart > _SAME_TIME * max(map(abs, comparison.ends)):
        one, other = comparison.ends
        lines.append(f"the runs end at t = {one:.6g} s and {other:.6g} s: the rest is not compared")
    lines += comparison.notes
    return "\n".join(line.rstrip() for line in lines)
