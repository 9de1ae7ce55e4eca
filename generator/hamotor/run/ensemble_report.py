"""`run.json` of an ensemble, and the summary a person reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hamotor.run.build import CompiledScene
from hamotor.run.ensemble import CHUNK, OWN, Job, Tally
from hamotor.run.library import Description
from hamotor.run.report import Report
from hamotor.run.runner import Plan
from hamotor.run.sampling import numbers_each
from hamotor.scene.draws import quantile_name

_SHOWN_COLUMNS = 12


@dataclass(frozen=True)
class EnsembleOrigin:
    """Where an ensemble comes from, and who computed it."""

    scene: str
    spec_hash: str
    version: str
    method_reason: str
    generate_s: float
    build: CompiledScene
    description: Description
    plan: Plan
    job: Job
    engine: str
    threads: int


def ensemble_report(
    origin: EnsembleOrigin,
    *,
    status: str,
    problem: str,
    counts: Mapping[str, int],
    reasons: Mapping[str, int],
    failures: Mapping[str, NDArray[Any]],
    statistics: Mapping[str, NDArray[Any]],
    total: Tally,
    kept: list[int],
    wall_s: float,
) -> Report:
    """The content of `run.json`.

    `final`: per column of the trajectory the statistics over the members alive at the end.
    `conserved`: per quantity the largest relative error of any member, whose it is, and the mean.
    Nothing but `timing`, `provenance`, and engine, threads, lanes and isa in `ensemble`, depends on
    who computed it.
    """
    job, plan, description = origin.job, origin.plan, origin.description
    how = description.ensemble
    index = description.column_index
    told = (
        "mean",
        "sd",
        "min",
        "max",
        *(map(quantile_name, job.ensemble.quantiles) if len(total.sample) else ()),
    )
    return {
        "scene": origin.scene,
        "algebra": description.algebra,
        "group": description.group,
        "method": job.method,
        "method_reason": origin.method_reason,
        "order": description.methods[job.method],
        "step": job.step,
        "asked_step": plan.asked_step,
        "steps": job.steps,
        "local_tolerance": job.tolerance,
        "compensated": description.compensated[job.method],
        "rows": len(statistics["t"]),
        "t_end": float(statistics["t"][-1]) if len(statistics["t"]) else 0.0,
        "scalar": description.scalar.replace(" ", "_"),
        "digits": description.digits,
        "kernels": description.kernels,
        "representation": "ga",
        "status": status,
        "problem": problem,
        "ensemble": {
            "members": job.members,
            "first": job.first,
            **counts,
            "seed": job.seed if job.is_drawn else None,
            "given": [name for name in OWN if getattr(job, name) is not None],
            "random_numbers": "Philox4x64-10",
            "random_numbers_each": numbers_each(job.ensemble) if job.is_drawn else 0,
            "chunk": CHUNK,
            "kept": kept,
            "quantiles_of_members": len(total.sample) if job.ensemble.quantiles else 0,
            "lanes": 1 if how is None else how.lanes,
            "isa": "" if how is None else how.isa,
            "engine": origin.engine,
            "threads": origin.threads,
        },
        "failures": {
            "count": counts["failed"],
            "reasons": {name: n for name, n in reasons.items() if n and name != "none"},
            "first": [
                {"member": int(member), "t": float(t), "reason": str(reason)}
                for member, t, reason in zip(*failures.values(), strict=True)
            ],
        },
        "final": {
            column.name: {
                "unit": column.unit,
                **{what: float(statistics[f"{column.name}.{what}"][-1]) for what in told},
            }
            for column in description.columns[1:]
        }
        if len(statistics["t"])
        else {},
        "conserved": {
            quantity.name: {
                "max_relative_error": float(total.errors.value[k]),
                "member": int(total.errors.member[k]),
                "mean_relative_error": float(total.errors.mean[k]),
                "unit": description.columns[index[quantity.column]].unit,
                "column": quantity.column,
                "description": quantity.description,
            }
            for k, quantity in enumerate(description.conserved)
        },
        "timing": {
            "generate_s": origin.generate_s,
            "compile_s": origin.build.compile_s,
            "compile_cached": origin.build.cached,
            "wall_s": wall_s,
            "member_steps": total.member_steps,
            "integrate_s": total.stepping_s,
            "ns_per_step": 1e9 * total.stepping_s / max(total.member_steps, 1),
            "member_steps_per_s": total.member_steps / wall_s,
        },
        "provenance": {
            "version": origin.version,
            "spec": origin.spec_hash,
            "compiler": origin.build.compiler,
            "flags": list(origin.build.flags),
            "processor": origin.build.processor,
            "fma": description.fma,
        },
    }


def ensemble_summary(said: Mapping[str, Any], *, folder: Path | None = None) -> str:
    """What happened, for a person."""
    from hamotor.scene import order_in_words

    many, timing = said["ensemble"], said["timing"]
    steps = f"{said['steps']:,} steps of {said['step']:.6g} s to t = {said['t_end']:.6g} s"
    who = f"{many['members']:,} members"
    if many["members"] == 1:
        who = f"member {many['first']:,} alone"
    given = " and ".join(many.get("given", []))
    seed = "" if many["seed"] is None else f"seed {many['seed']}"
    start = ", ".join(filter(None, (seed, given and f"given {given}")))
    where = f"{many['threads']} thread{'s' * (many['threads'] != 1)}"
    what = (
        f"{said['scene']} · {said['group']} in {said['algebra']} · {said['method']} "
        f"({order_in_words(said['order'])}) · {said['scalar']}"
    )
    speed = (
        f"  {timing['wall_s']:.3g} s in all, {timing['member_steps_per_s'] / 1e6:.3g} million "
        f"steps of members a second, {timing['ns_per_step']:.3g} ns of a core for each "
        f"({'dask' if many['engine'] == 'dask' else where}, "
        f"{many['lanes']} lane{'s' * (many['lanes'] != 1)}, {many['isa']})"
    )
    lines = [what, f"  {who}, {start}, {steps}", speed]
    if said["method_reason"]:
        lines.append(f"  {said['method']} because {said['method_reason']}")
    if said["status"] != "finished":
        lines.append(f"  {said['status']}: {many['completed']:,} members are done")
    if said["failures"]["count"]:
        kinds = ", ".join(f"{n:,} {name}" for name, n in said["failures"]["reasons"].items())
        first = said["failures"]["first"][0]
        lines.append(
            f"  {said['failures']['count']:,} members failed ({kinds}), the first of them "
            f"member {first['member']:,} after t = {first['t']:.6g} s"
        )
    lines += ["", *_final_lines(said)]
    lines += ["", "  worst relative error of what must stay constant, and whose it is"]
    conserved = said["conserved"]
    width = max(map(len, conserved), default=0)
    for name, error in conserved.items():
        if error["member"] < 0:
            lines.append(f"    {name.ljust(width)}  no member has started")
            continue
        worst = f"{_number(error['max_relative_error']):.2g}"
        lines.append(f"    {name.ljust(width)}  {worst:<8} member {error['member']:,}")
    if not conserved:
        lines.append("    nothing is conserved in this scene")
    if folder is not None:
        lines += ["", f"  {folder}/", f"    {', '.join(_files(folder, said))}"]
    return "\n".join(lines)


def _final_lines(said: Mapping[str, Any]) -> list[str]:
    """Positions and energy at the end: mean and spread."""
    final = said["final"]
    told = [n for n in final if ".position." in n or n.endswith(".scale") or n == "energy"]
    if not told:
        return ["  no member has reached a recorded time"]
    width = max(map(len, told[:_SHOWN_COLUMNS]))
    lines = [f"  {'at the end'.ljust(width + 2)}{'mean':>14}{'sd':>12}{'min':>14}{'max':>14}"]
    for name in told[:_SHOWN_COLUMNS]:
        x = {what: _number(final[name][what]) for what in ("mean", "sd", "min", "max")}
        lines.append(
            f"    {name.ljust(width)}{x['mean']:>14.6g}{_short(x['sd'])}{x['min']:>14.6g}"
            f"{x['max']:>14.6g}  {final[name]['unit']}"
        )
    return lines


def _number(x: float | None) -> float:
    """Of a report that may have been read from a file, where null is what is not finite."""
    return np.nan if x is None else x


def _short(x: float) -> str:
    return f"{'' if np.isnan(x) else f'{x:.4g}':>12}"


def _files(folder: Path, said: Mapping[str, Any]) -> list[str]:
    files = ["run.json", f"statistics.parquet ({said['rows']:,} times)"]
    kept = said["ensemble"]["kept"]
    for name, shown in (
        ("statistics.csv", "statistics.csv"),
        ("states", f"states/ ({said['ensemble']['begun']:,} members)"),
        ("failures.parquet", "failures.parquet"),
        ("cloud.png", "cloud.png"),
        ("members", f"members/ ({len(kept)} trajector{'y' if len(kept) == 1 else 'ies'})"),
    ):
        if (folder / name).exists():
            files.append(shown)
    return files
