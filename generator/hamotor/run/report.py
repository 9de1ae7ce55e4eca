"""`run.json`, the account of a run, and the summary a person reads.

Numbers of the result carry 17 significant digits, so that reading them gives the same double.  The
final state in a wider scalar is strings with all its digits.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hamotor.run.attitude import has_attitude, rotation_matrices
from hamotor.run.build import CompiledScene
from hamotor.run.library import Description
from hamotor.run.runner import Breakdown, Outcome

_EXACT = {"final", "conserved", "events"}

TOLERANCE = (
    "of the final state, verified by a second run with half the step or less, or a sixteenth of "
    "the local tolerance or less: the largest change of a motor's component, and of a momentum's "
    "relative to its initial norm"
)
_MOST_TIMES = 100
"""The times of an event that run.json lists; the table of events has all."""

Report = dict[str, Any]


@dataclass(frozen=True)
class Origin:
    """Where a run comes from: what the report says of the scene and of how it was made."""

    scene: str
    spec_hash: str
    version: str
    method_reason: str
    generate_s: float
    representation: str = "ga"


def report(
    origin: Origin, compiled: CompiledScene, description: Description, outcome: Outcome
) -> Report:
    """The content of `run.json`.

    `final` per body: `motor` (body to world), `momentum` (body frame), `position` (world, of the
    body frame's origin, m), `rotation` (v_world = R v_body; null where the group bends lines) and
    `scale`.
    """
    plan = outcome.plan
    said: Report = {
        "scene": origin.scene,
        "algebra": description.algebra,
        "group": description.group,
        "method": plan.method,
        "method_reason": origin.method_reason,
        "order": description.methods[plan.method],
        "step": plan.step,
        "asked_step": plan.asked_step,
        "steps": outcome.steps_done,
        "planned_steps": plan.steps,
        "every": plan.every if plan.times is None else None,
        "rows": outcome.rows,
        "local_tolerance": plan.tolerance,
        "compensated": description.compensated[plan.method],
        "own_steps": outcome.own_steps,
        "t_end": float(outcome.final[0]),
        "scalar": description.scalar.replace(" ", "_"),
        "digits": description.digits,
        "kernels": description.kernels,
        "representation": origin.representation,
        "status": outcome.status,
        "problem": outcome.problem,
        "failure": None if outcome.breakdown is None else _failure(outcome.breakdown),
        "events": _events(description, outcome),
        "final": {
            body: final_state(body, description, outcome.final)
            if outcome.wide_final is None
            else final_state(body, description, np.array(outcome.wide_final))
            for body in description.bodies
        },
        "conserved": {
            quantity.name: {
                "initial": error.initial,
                "final": error.final,
                "max_relative_error": error.worst,
                "scale": error.scale,
                "unit": description.columns[description.column_index[quantity.column]].unit,
                "column": quantity.column,
                "description": quantity.description,
            }
            for quantity in description.conserved
            for error in (outcome.conserved[quantity.name],)
        },
        "drift": {"largest_step": outcome.largest_drift, "sum": outcome.total_drift},
    }
    if outcome.ladder is not None:
        ladder = outcome.ladder
        said["tolerance"] = {
            "target": ladder.target,
            "achieved": ladder.achieved,
            "meaning": TOLERANCE,
            "ladder": [
                {
                    "step": rung.step,
                    "local_tolerance": rung.tolerance,
                    "steps": rung.steps,
                    "difference": rung.difference,
                    "status": rung.status,
                    "integrate_s": rung.integrate_s,
                }
                for rung in ladder.rungs
            ],
        }
    said["timing"] = {
        "generate_s": origin.generate_s,
        "compile_s": compiled.compile_s,
        "compile_cached": compiled.cached,
        "integrate_s": outcome.integrate_s,
        "ns_per_step": outcome.ns_per_step,
    }
    said["provenance"] = {
        "version": origin.version,
        "spec": origin.spec_hash,
        "compiler": compiled.compiler,
        "flags": list(compiled.flags),
        "processor": compiled.processor,
        "fma": description.fma,
    }
    return said


def _failure(breakdown: Breakdown) -> dict[str, Any]:
    """What of a step failed: after which time, with which step (s), and in which column."""
    return {
        "reason": breakdown.reason,
        "t": breakdown.time,
        "step": breakdown.step,
        "quantity": breakdown.quantity,
    }


def _events(description: Description, outcome: Outcome) -> dict[str, Any]:
    """Per event of the scene: how often it happened, when, and whether the run ended there."""
    times = {
        event.name: [found.time for found in outcome.events if found.name == event.name]
        for event in description.events
    }
    return {
        event.name: {
            "direction": event.direction,
            "count": len(times[event.name]),
            "times": times[event.name][:_MOST_TIMES],
            "stopped": event.stops and bool(times[event.name]),
        }
        for event in description.events
    }


def final_state(body: str, description: Description, row: NDArray[Any]) -> dict[str, Any]:
    """The state of one body in a row of the trajectory, as `run.json` tells it."""

    def _number(x: Any) -> float | str:
        return float(x) if isinstance(x, np.float64) else in_digits(x, description.digits)

    index = description.column_index
    motor = {blade: row[[index[f"{body}.motor.{blade}"]]] for blade in description.motor}
    turns = has_attitude(description.algebra, motor)
    scale = index.get(f"{body}.scale")
    return {
        "motor": {blade: _number(value[0]) for blade, value in motor.items()},
        "momentum": {
            name: _number(row[index[f"{body}.momentum.{name}"]]) for name in description.momentum
        },
        "position": [_number(row[k]) for k in description.position_columns(body)],
        "rotation": [[_number(x) for x in line] for line in rotation_matrices(motor)[0]]
        if turns
        else None,
        "scale": 1 if scale is None else _number(row[scale]),
    }


def in_digits(x: Fraction | int, digits: int) -> str:
    """A number with so many significant digits."""
    exact = Fraction(x)
    quotient = Context(prec=digits, Emin=-99999, Emax=99999).divide(
        Decimal(exact.numerator), Decimal(exact.denominator)
    )
    return f"{quotient.normalize(Context(prec=digits)):g}"


def to_json(said: Mapping[str, Any]) -> str:
    """One JSON document, indented; numbers that are not finite become null."""
    return _value(said, 0, exact=False) + "\n"


def _value(value: Any, depth: int, *, exact: bool) -> str:
    if isinstance(value, Mapping):
        return _object(value, depth, exact=exact)
    if isinstance(value, list | tuple):
        return _array(value, depth, exact=exact)
    if isinstance(value, float):
        if not math.isfinite(value):
            return "null"
        return _seventeen_digits(value) if exact else json.dumps(value)
    return json.dumps(value, ensure_ascii=False)


def _object(value: Mapping[str, Any], depth: int, *, exact: bool) -> str:
    if not value:
        return "{}"
    inner = " " * (2 * depth + 2)
    members = ",\n".join(
        f"{inner}{json.dumps(name, ensure_ascii=False)}: "
        + _value(member, depth + 1, exact=exact or name in _EXACT)
        for name, member in value.items()
    )
    return f"{{\n{members}\n{' ' * (2 * depth)}}}"


def _array(value: list[Any] | tuple[Any, ...], depth: int, *, exact: bool) -> str:
    if all(isinstance(item, str | int | float) for item in value):
        return "[" + ", ".join(_value(item, depth, exact=exact) for item in value) + "]"
    inner = " " * (2 * depth + 2)
    items = ",\n".join(inner + _value(item, depth + 1, exact=exact) for item in value)
    return f"[\n{items}\n{' ' * (2 * depth)}]"


def _seventeen_digits(value: float) -> str:
    text = format(value, ".17g")
    return text if any(mark in text for mark in ".en") else text + ".0"


def summary(said: Mapping[str, Any], *, folder: Path | None = None) -> str:
    """What happened, for a person: a dozen lines."""
    timing = said["timing"]
    lines = [
        _what(said),
        f"  {_steps(said)} in {_seconds(timing['integrate_s'])}, {_rate(timing)}",
        f"  {_made(timing)}",
    ]
    if said["method_reason"]:
        lines.append(f"  {said['method']} because {said['method_reason']}")
    if abs(said["step"]) < abs(said["asked_step"]) * (1 - 1e-9):
        lines.append(
            f"  the step was shortened from {abs(said['asked_step']):g} s so that a whole number "
            "of steps ends at the end time"
        )
    if "tolerance" in said:
        lines.append(f"  {_tolerance(said['tolerance'])}")
    if said["status"] != "finished":
        lines.append(
            f"  {said['status']} after {said['steps']:,} of {said['planned_steps']:,} steps"
        )
    lines += [f"  {line}" for line in _event_lines(said["events"])]
    lines += ["", "  worst relative error of what must stay constant"]
    lines += _conserved_lines(said["conserved"])
    drift = said["drift"]
    lines += [
        "",
        f"  |{'RᵀR' if said['representation'] == 'matrix' else 'M M̃'} − 1| before renormalisation",
        f"    {drift['largest_step']:.2g} at most in a step, {drift['sum']:.2g} summed over all",
    ]
    if folder is not None:
        lines += ["", *_file_lines(folder, said)]
    return "\n".join(lines)


def _what(said: Mapping[str, Any]) -> str:
    from hamotor.scene import order_in_words

    matrix = said["representation"] == "matrix"
    form = "matrix form" if matrix else f"{said['kernels']} kernels"
    return (
        f"{said['scene']} · {said['group']} in {said['algebra']} · {said['method']} "
        f"({order_in_words(said['order'])}) · {said['scalar']}, {form}"
    )


def _steps(said: Mapping[str, Any]) -> str:
    steps = said["steps"]
    plural = "" if steps == 1 else "s"
    end = f"to t = {said['t_end']:.6g} s"
    if said["local_tolerance"] is not None:
        chosen = f"{said['own_steps']:,} steps of its own choice"
        return f"{chosen} for a local error of {said['local_tolerance']:.2g}/s {end}"
    return f"{steps:,} step{plural} of {said['step']:.6g} s {end}"


def _event_lines(events: Mapping[str, Mapping[str, Any]]) -> list[str]:
    lines = []
    for name, said in events.items():
        if not said["count"]:
            lines.append(f"{name} did not happen")
            continue
        when = ", ".join(f"{t:.9g}" for t in said["times"][:3])
        more = ", …" if said["count"] > 3 else ""
        stopped = "; the run ended there" if said["stopped"] else ""
        lines.append(f"{name} happened at t = {when}{more} s ({said['count']}){stopped}")
    return lines


def _rate(timing: Mapping[str, Any]) -> str:
    return f"{timing['ns_per_step']:.4g} ns/step"


def _made(timing: Mapping[str, Any]) -> str:
    if timing["compile_cached"]:
        return "compiled before, found in the cache"
    return f"compiled in {_seconds(timing['compile_s'])}"


def _tolerance(said: Mapping[str, Any]) -> str:
    runs = len(said["ladder"])
    achieved = "nothing to compare" if said["achieved"] is None else f"{said['achieved']:.2g}"
    return (
        f"tolerance {said['target']:g} of the final state: the last two of {runs} runs differ by"
        f" {achieved}"
    )


def _conserved_lines(conserved: Mapping[str, Mapping[str, Any]]) -> list[str]:
    if not conserved:
        return ["    nothing is conserved in this scene"]
    width = max(len(name) for name in conserved)
    lines = []
    for name, said in conserved.items():
        worst = said["max_relative_error"]
        note = "" if said["scale"] else f"  {said['unit']}, absolute: zero at the start"
        lines.append(f"    {name.ljust(width)}  {worst:.2g}{note}")
    return lines


def _file_lines(folder: Path, said: Mapping[str, Any]) -> list[str]:
    files = ["run.json", f"trajectory/ ({said['rows']:,} rows)"]
    files += [
        name
        for name in ("trajectory.csv", "events.parquet", "events.csv", "path.png", "conserved.png")
        if (folder / name).exists()
    ]
    return [f"  {folder}/", f"    {', '.join(files)}"]


def _seconds(seconds: float) -> str:
    if seconds >= 100:
        return f"{seconds:.0f} s"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.0f} ns"
