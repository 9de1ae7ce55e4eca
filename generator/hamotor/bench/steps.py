"""`hamotor bench steps`: whole steps of scenes, by kernels, representation and method, with errors.

Every contestant steps the same scene from the same state with the same step; repetitions are
interleaved, and a time is the best of them, since what else runs only adds to it. The error is the
distance at the end from a run in `long double` with shorter steps, of order 8 where the scene has
it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import geometric_mean
from typing import Any, Final

from hamotor.bench.account import provenance, publish, say
from hamotor.errors import UsageError
from hamotor.files import write_whole
from hamotor.run.build import default_cache, find_compiler, flags_for
from hamotor.run.comparison import compare
from hamotor.run.report import to_json
from hamotor.run.result import Run
from hamotor.run.simulation import Simulation, load

SCENES: Final = (
    "planar",
    "tumble",
    "spring_pendulum",
    "heavy_top",
    "free4",
    "breathing_body",
    "conformal_top",
)
"""One for each group: SE(2), SE(3) free and forced, SO(3), SE(4), Sim(3), SO(4,1)."""
STEPS: Final = 2000
QUICK_STEPS: Final = 200
REFERENCES: Final = (("splitting8", 4), ("rkmk87", 4))
"""Methods with how many times shorter their steps are; the first that a scene has is taken."""
BASELINE: Final = "rkmk4"
QUICK_ORDER: Final = 8
"""Quickly, a family is stepped by its method of the highest order up to this one."""
FORMS: Final = {
    "generated": ("generated", "ga"),
    "generic": ("generic", "ga"),
    "sparse": ("sparse", "ga"),
    "matrix": ("generated", "matrix"),
}
"""What a scene is compiled to, unrolled kernels, tables, the part of them that is needed, or
matrices: kernels, representation."""


@dataclass(frozen=True)
class Row:
    """One contestant on one scene."""

    scene: str
    form: str
    family: str
    """The method's name without its order."""
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

    scenes: names or paths; one for each group if not given.  out: where steps.json goes, written
    after each scene; None: nowhere.  json: print the account on stdout instead of the table.
    quick: three repetitions instead of nine, of a tenth of the steps, and one method a family.
    Returns the account.
    Raises UsageError and ToolError as `hamotor run` does.
    """
    rows: list[Row] = []
    about = provenance(
        compiler=find_compiler(default_cache()).version,
        flags=" ".join(flags_for(os.uname().machine)),
    )
    for scene in scenes or SCENES:
        say(f"stepping {scene}")
        rows += _rows(load(scene), quick=quick)
        account = {
            "benchmark": "steps",
            "quick": quick,
            "unit": "ns per step, best of the repetitions",
            "error": "distance at the end from a run in long double with shorter steps",
            "rows": [asdict(row) for row in rows],
            "families": [asdict(family) for family in families(rows)],
            "provenance": about,
        }
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            write_whole(out / "steps.json", to_json(account))
    publish(account, table, out=out, as_json=json)
    return account


def _rows(simulation: Simulation, *, quick: bool) -> list[Row]:
    step = simulation.step
    if step is None:
        raise UsageError(f"{simulation.name}: has a tolerance; the benchmark needs [time] step")
    steps = min(QUICK_STEPS if quick else STEPS, max(round(simulation.end / step), 1))
    end = steps * step
    contestants = _contestants(simulation, quick=quick)
    times: dict[tuple[str, str], list[float]] = {c: [] for c in contestants}
    runs: dict[tuple[str, str], Run] = {}
    for _ in range(3 if quick else 9):
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
    method, finer = _reference(simulation)
    reference = simulation.run(
        end=end, step=step / finer, every=steps * finer, method=method, scalar="long_double"
    )
    own = {method: min(t) for (form, method), t in times.items() if form == "generated"}
    return [
        Row(
            scene=simulation.name,
            form=form,
            family=family_of(method),
            method=method,
            order=int(run.report["order"]),
            step=step,
            ns_per_step=min(times[form, method]),
            repetitions=times[form, method],
            ratio=min(times[form, method]) / own.get(method, own[BASELINE]),
            errors=_errors(run, reference),
        )
        for (form, method), run in runs.items()
    ]


def _one_a_family(offered: Mapping[str, int]) -> list[str]:
    chosen: dict[str, str] = {}
    for method, order in sorted(offered.items(), key=lambda item: item[1]):
        if order <= QUICK_ORDER or family_of(method) not in chosen:
            chosen[family_of(method)] = method
    return [method for method in offered if method == BASELINE or method in chosen.values()]


def family_of(method: str) -> str:
    """`gauss` of `gauss8`."""
    return method.rstrip("0123456789")


@dataclass(frozen=True)
class FamilyRatio:
    """How many times as long as generated kernels a form takes for a family's steps."""

    scene: str
    form: str
    family: str
    ratio: float
    """Geometric mean over the family's methods."""


def families(rows: Sequence[Row]) -> list[FamilyRatio]:
    """The ratios of all forms but the generated one."""
    ratios: dict[tuple[str, str, str], list[float]] = {}
    generated = {(row.scene, row.method) for row in rows if row.form == "generated"}
    for row in rows:
        if row.form != "generated" and (row.scene, row.method) in generated:
            ratios.setdefault((row.scene, row.form, row.family), []).append(row.ratio)
    return [
        FamilyRatio(scene, form, family, geometric_mean(found))
        for (scene, form, family), found in ratios.items()
    ]


def _reference(simulation: Simulation) -> tuple[str, int]:
    """The method of the reference, and how many times shorter its steps are."""
    return next(r for r in REFERENCES if r[0] in simulation.offered(*FORMS["generated"]))


def _contestants(simulation: Simulation, *, quick: bool) -> list[tuple[str, str]]:
    """Forms with methods, all of them compiled, on as many processors as there are."""
    found = []
    for form, (kernels, representation) in FORMS.items():
        offered = simulation.offered(kernels, representation)
        try:
            simulation.compile(
                kernels=kernels, representation=representation, method=next(iter(offered))
            )
        except UsageError:
            continue  # a group without this form
        found += [(form, method) for method in (_one_a_family(offered) if quick else offered)]

    def compiled(form: str, method: str, scalar: str = "double") -> None:
        kernels, representation = FORMS[form]
        simulation.compile(
            scalar=scalar, kernels=kernels, representation=representation, method=method
        )

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        waiting = [pool.submit(compiled, *contestant) for contestant in found]
        method, _ = _reference(simulation)
        waiting.append(pool.submit(compiled, "generated", method, "long_double"))
        for one in waiting:
            one.result()
    return found


def _errors(run: Run, reference: Run) -> dict[str, float]:
    errors: dict[str, float] = {}
    for difference in compare(run, reference).differences:
        key = f"{difference.quantity} ({difference.unit})"
        errors[key] = max(errors.get(key, 0.0), difference.at_end)
    return errors


def table(account: Mapping[str, Any]) -> str:
    """A block for each scene: method, form, time, ratio, errors of place and attitude."""
    lines = [f"{account['unit']}; error: {account['error']}"]
    scene = ""
    for row in account["rows"]:
        if row["scene"] != scene:
            scene = row["scene"]
            lines += ["", f"{scene}, step {row['step']:g} s"]
            lines.append(f"  {'method':<15} {'form':<10} {'ns/step':>9} {'ratio':>7}  errors")
        errors = "  ".join(
            f"{name.split(' (')[0]} {value:.1e}"
            for name, value in row["errors"].items()
            if name.startswith(("attitude", "position", "scale", "energy"))
        )
        lines.append(
            f"  {row['method']:<15} {row['form']:<10} {row['ns_per_step']:>9.1f}"
            f" {row['ratio']:>7.2f}  {errors}"
        )
    lines += ["", "times as long as generated kernels, by family", ""]
    return "\n".join([*lines, *families_table(account["families"])])


def families_table(ratios: Sequence[Mapping[str, Any]]) -> list[str]:
    """The ratios in Markdown: families and forms by scene."""
    scenes = list(dict.fromkeys(ratio["scene"] for ratio in ratios))
    found: dict[tuple[str, str], dict[str, float]] = {}
    for ratio in ratios:
        found.setdefault((ratio["form"], ratio["family"]), {})[ratio["scene"]] = ratio["ratio"]
    first = max((len(f"{family}, {form}") for form, family in found), default=0)
    lines = [
        " | ".join([f"| {'':<{first}}", *scenes]) + " |",
        "|---" * (len(scenes) + 1) + "|",
    ]
    for (form, family), row in sorted(found.items()):
        cells = [f"{row[scene]:.1f}" if scene in row else "–" for scene in scenes]
        aligned = [f"{cell:>{len(scene)}}" for cell, scene in zip(cells, scenes, strict=True)]
        lines.append(" | ".join([f"| {f'{family}, {form}':<{first}}", *aligned]) + " |")
    return lines
