"""`hamotor bench steps`: whole steps of scenes, by kernels, representation and method, with errors.

Every contestant steps the same scene from the same state with the same step; repetitions are
interleaved, and a time is the median of them. The error is the distance at the end from a run in
`long double` with shorter steps, of order 8 where the scene has it.
"""

from __future__ import annotations

import json
import platform
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any, Final

from hamotor import __version__
from hamotor.errors import UsageError
from hamotor.run.build import processor_name
from hamotor.run.comparison import compare
from hamotor.run.result import Run
from hamotor.run.simulation import Simulation, load

SCENES: Final = ("tumble", "heavy_top", "spring_pendulum", "breathing_body")
STEPS: Final = 2000
REFERENCES: Final = (("splitting8", 4), ("rkmk4", 32))
"""Methods with how many times shorter their steps are; the first that a scene has is taken."""
FORMS: Final = {
    "generated": ("generated", "ga"),
    "generic": ("generic", "ga"),
    "matrix": ("generated", "matrix"),
}
"""What a scene is compiled to, unrolled kernels, tables, or matrices: kernels, representation."""


@dataclass(frozen=True)
class Row:
    """One contestant on one scene."""

    scene: str
    form: str
    method: str
    order: int
    step: float
    ns_per_step: float
    repetitions: list[float]
    ratio: float
    """To the generated kernels with the same method, or with rkmk4 where they have not got it."""
    errors: dict[str, float]
    """At the end, over all bodies: by quantity, in its unit."""


def bench_steps(
    scenes: Sequence[str] = (), out: Path | None = None, json: bool = False, quick: bool = False
) -> dict[str, Any]:
    """Run and account for the benchmark of steps.

    scenes: names or paths; four bundled ones if not given.  out: where steps.json goes; None:
    nowhere.  json: print the account on stdout instead of the table.  quick: three repetitions
    instead of nine.  Returns the account.  Raises UsageError and ToolError as `hamotor run` does.
    """
    rows: list[Row] = []
    for scene in scenes or SCENES:
        print(f"stepping {scene}", file=sys.stderr, flush=True)
        rows += _rows(load(scene), 3 if quick else 9)
    account = {
        "benchmark": "steps",
        "quick": quick,
        "unit": "ns per step, median of the repetitions",
        "error": "distance at the end from a run in long double with shorter steps",
        "rows": [asdict(row) for row in rows],
        "provenance": {
            "version": __version__,
            "processor": processor_name(),
            "machine": platform.machine(),
        },
    }
    _print(account, as_json=json)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        _write(account, out / "steps.json")
    return account


def _rows(simulation: Simulation, repetitions: int) -> list[Row]:
    step = simulation.step
    if step is None:
        raise UsageError(f"{simulation.name}: has a tolerance; the benchmark needs [time] step")
    steps = min(STEPS, max(round(simulation.end / step), 1))
    end = steps * step
    contestants = _contestants(simulation)
    times: dict[tuple[str, str], list[float]] = {c: [] for c in contestants}
    runs: dict[tuple[str, str], Run] = {}
    for _ in range(repetitions):
        for form, method in contestants:
            kernels, representation = FORMS[form]
            run = simulation.run(
                end=end,
                step=step,
                every=steps,
                method=method,
                kernels=kernels,
                representation=representation,
            )
            times[form, method].append(float(run.report["timing"]["ns_per_step"]))
            runs[form, method] = run
    method, finer = next(r for r in REFERENCES if r[0] in simulation.offered(*FORMS["generated"]))
    reference = simulation.run(
        end=end, step=step / finer, every=steps * finer, method=method, scalar="long_double"
    )
    own = {method: median(t) for (form, method), t in times.items() if form == "generated"}
    return [
        Row(
            scene=simulation.name,
            form=form,
            method=method,
            order=int(run.report["order"]),
            step=step,
            ns_per_step=median(times[form, method]),
            repetitions=times[form, method],
            ratio=median(times[form, method]) / own.get(method, own["rkmk4"]),
            errors=_errors(run, reference),
        )
        for (form, method), run in runs.items()
    ]


def _contestants(simulation: Simulation) -> list[tuple[str, str]]:
    found = []
    for form, (kernels, representation) in FORMS.items():
        offered = simulation.offered(kernels, representation)
        try:
            simulation.compile(
                kernels=kernels, representation=representation, method=next(iter(offered))
            )
        except UsageError:
            continue  # a group without this form
        found += [(form, method) for method in offered]
    return found


def _errors(run: Run, reference: Run) -> dict[str, float]:
    errors: dict[str, float] = {}
    for difference in compare(run, reference).differences:
        key = f"{difference.quantity} ({difference.unit})"
        errors[key] = max(errors.get(key, 0.0), difference.at_end)
    return errors


def _print(account: Mapping[str, Any], *, as_json: bool) -> None:
    print(json.dumps(account, indent=1) if as_json else table(account), flush=True)


def _write(account: Mapping[str, Any], file: Path) -> None:
    file.write_text(json.dumps(account, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {file}", file=sys.stderr, flush=True)


def table(account: Mapping[str, Any]) -> str:
    """A block for each scene: method, form, time, ratio, errors of place and attitude."""
    lines = [f"{account['unit']}; error: {account['error']}"]
    scene = ""
    for row in account["rows"]:
        if row["scene"] != scene:
            scene = row["scene"]
            lines += ["", f"{scene}, step {row['step']:g} s"]
            lines.append(f"  {'method':<12} {'form':<10} {'ns/step':>9} {'ratio':>7}  errors")
        errors = "  ".join(
            f"{name.split(' (')[0]} {value:.1e}"
            for name, value in row["errors"].items()
            if name.startswith(("attitude", "position", "scale", "energy"))
        )
        lines.append(
            f"  {row['method']:<12} {row['form']:<10} {row['ns_per_step']:>9.1f}"
            f" {row['ratio']:>7.2f}  {errors}"
        )
    return "\n".join(lines)
