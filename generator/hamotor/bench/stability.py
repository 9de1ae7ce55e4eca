"""`hamotor bench stability`: every method on hard cases, judged by what it promises.

A case is a scene of `generator/scenes/hard`. Each method that the scene offers steps it twice, with
the case's step h and with h/2; errors are distances at the end from a reference in a wider scalar,
which two methods of high order agree upon. They are judged against the condition of the case, that
is how much the end moves for a small change of the start, so that nobody is asked for digits that
the initial state does not hold:

* accuracy: the error of h/2 falls as the method's order says, or is at rounding × condition;
* symplectic methods: spatial momenta and Casimirs at rounding; the energy error does not grow;
* symmetric methods: forward and back again ends at the start;
* a run in `float` is as good as its digits (one method of each family).

Beside them: exp and log of every group around multiples of π, a run that must stop cleanly, and a
mass that no scalar holds.

A step too long for a method (an error beyond 0.1) is `unresolved`: all that is asked
then is that numbers stay finite and that what is promised for every step holds.
"""

from __future__ import annotations

import ctypes
import math
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from hamotor.bench.account import provenance, publish
from hamotor.errors import NumericsError, UsageError, suggest
from hamotor.run.build import compile_scene
from hamotor.run.library import Vector
from hamotor.run.result import Run, RunFailed
from hamotor.run.simulation import Simulation, load
from hamotor.scene import METHODS, Promise

EDGES: Final = Path(__file__).resolve().parents[3] / "tests" / "bench" / "stability" / "edges.cpp"
EDGE_BOUND: Final = 8.0
CASES: Final = Path(__file__).resolve().parents[2] / "scenes" / "hard"
QUICK: Final = ("rkmk4", "taylor", "splitting2", "splitting8", "gauss8", "closed_form")
"""One method of each family."""
REFERENCES: Final = ("taylor", "splitting10", "rkmk87", "gauss8")
"""By preference; the first two that get through a scene make its reference."""
WIDE: Final = "long_double"
FINER: Final = (4, 8, 16)
"""How many times shorter a reference's steps are, until both methods agree."""
AGREED: Final = 1e-15
ROWS: Final = 1000
PERTURBATION: Final = 1e-9
ROUNDINGS: Final = 64.0
"""Roundings of a step that the condition may multiply."""
UNRESOLVED: Final = 0.1
GROWTH: Final = 3.0
ORDER_SLACK: Final = 0.7
EPSILON: Final = {"double": 2.0**-52, "float": 2.0**-23}


@dataclass(frozen=True)
class Row:
    """One method on one case: figures by name, and what of its promises did not hold."""

    case: str
    method: str
    order: int
    figures: dict[str, float]
    verdict: str
    """`pass`, `unresolved` (finite, and what holds for any step held), `stops` (cleanly; a quarter
    of the step gets through) or `fail`."""
    failures: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Reference:
    """The end of a case in a wider scalar."""

    end: Vector
    method: str
    agreement: float
    """Distance of two methods' ends."""
    condition: float
    """How many times further apart two runs end than they start, or than they are half-way."""


def bench_stability(
    cases: Sequence[str] = (), out: Path | None = None, json: bool = False, quick: bool = False
) -> dict[str, Any]:
    """Run and judge the hard cases.

    cases: names; all if not given.  out: where stability.json goes; None: nowhere.  json: print the
    account on stdout instead of the table.  quick: one method of each family instead of all.
    Returns the account.  Raises UsageError for an unknown case, ToolError as `hamotor run` does.
    """
    known = case_names()
    for case in cases:
        if case not in known:
            raise UsageError(
                f'no hard case "{case}"; there are {", ".join(known)}.{suggest(case, known)}'
            )
    told: list[dict[str, Any]] = []
    checks: list[Check] = []
    if not cases:
        print("judging exp, log, stops and refusals", file=sys.stderr, flush=True)
        checks = [*edges(), stop_of_an_overflow(), refusal_of_a_denormal_mass()]
    for case in cases or known:
        print(f"judging {case}", file=sys.stderr, flush=True)
        simulation = load(CASES / f"{case}.toml")
        methods = [m for m in simulation.methods if not quick or m in QUICK]
        _compile(simulation, methods)
        reference = reference_of(simulation)
        rows = [judged(case, simulation, reference, method) for method in methods]
        told.append(
            {
                "case": case,
                "description": _description(simulation),
                "step": simulation.step,
                "end": simulation.end,
                "reference": reference.method,
                "reference_agreement": reference.agreement,
                "condition": reference.condition,
                "rows": [asdict(row) for row in rows],
            }
        )
    account = {
        "benchmark": "stability",
        "quick": quick,
        "cases": told,
        "checks": [asdict(check) for check in checks],
        "failed": [check.name for check in checks if not check.passed]
        + [
            f"{case['case']} {row['method']}"
            for case in told
            for row in case["rows"]
            if row["verdict"] == "fail"
        ],
        "provenance": provenance(),
    }
    publish(account, table, out=out, as_json=json)
    return account


def _compile(simulation: Simulation, methods: Sequence[str]) -> None:
    """All that a case needs, on all cores; runs find it in the cache."""
    wanted = {(method, "double") for method in methods}
    wanted |= {(method, "float") for method in methods if method in QUICK}
    wanted |= {(method, WIDE) for method in REFERENCES if method in simulation.methods}

    def compiled(what: tuple[str, str]) -> None:
        with suppress(UsageError):  # a number that the scalar does not hold
            simulation.compile(method=what[0], scalar=what[1])

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compiled, sorted(wanted)))


def case_names() -> list[str]:
    """The hard cases, in alphabetical order."""
    return sorted(file.stem for file in CASES.glob("*.toml"))


@dataclass(frozen=True)
class Check:
    """Something that is no run of a case."""

    name: str
    passed: bool
    found: str


def edges() -> list[Check]:
    """exp and log of each group at 0, next to it, and around multiples of π up to 4π.

    Along every plane, all of it and with a little of every other generator.  exp is held against
    long double, exp log M against M; errors in ε (1 + |X|) of the largest number of M.
    """
    library = ctypes.CDLL(str(compile_scene(EDGES.read_text(encoding="utf-8")).library))
    library.edge_groups.restype = ctypes.c_char_p
    groups = library.edge_groups().decode().split()
    errors = (ctypes.c_double * (2 * len(groups)))()
    library.edge_errors(errors)
    return [
        Check(f"{function} {group}", error <= EDGE_BOUND, f"{error:.2g} units")
        for group, *both in zip(groups, errors[::2], errors[1::2], strict=True)
        for function, error in zip(("exp", "log"), both, strict=True)
    ]


def stop_of_an_overflow() -> Check:
    """A body that expands by e³ a second, until its numbers overflow."""
    expanding = load(CASES / "expanding.toml")
    try:
        run = expanding.run(end=1e4, step=0.01, method="rkmk4", every=1000)
    except RunFailed as failed:
        message, kept = str(failed), failed.run.t[-1]
        told = "left the group" in message and "step" in message and "blob." in message
        return Check("stop of an overflow", told and bool(kept > 0), f"kept {kept:g} s: {message}")
    return Check("stop of an overflow", False, f"went on to t = {run.t[-1]:g} s")


def refusal_of_a_denormal_mass() -> Check:
    """A mass below what products of two keep finite is refused, by name."""
    text = (CASES / "tiny_mass.toml").read_text(encoding="utf-8").replace("1e-35", "1e-310")
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "denormal.toml"
        scene.write_text(text, encoding="utf-8")
        try:
            load(scene)
        except UsageError as refused:
            return Check("refusal of a denormal mass", "mass" in str(refused), str(refused))
    return Check("refusal of a denormal mass", False, "was accepted")


def reference_of(simulation: Simulation) -> Reference:
    """The end of the scene in long double, and its condition.

    Steps are shortened until two methods agree or no step of `FINER` is left; what then remains
    between them is part of every verdict.
    """
    candidates = (m for m in REFERENCES if m in simulation.methods and _survives(simulation, m))
    methods = list(islice(candidates, 2))
    if not methods:
        raise NumericsError(f"{simulation.name}: no method for a reference gets through it.")
    second = methods[-1]

    simulation = started(simulation, simulation.state)  # the digits that a double has

    def end_of(start: Simulation, method: str, finer: int) -> Vector:
        return end_state(_run(start, method, finer, scalar=WIDE))

    tried: list[tuple[float, int, Vector]] = []
    for finer in FINER:
        end = end_of(simulation, methods[0], finer)
        agreement = distance(end, end_of(simulation, second, 2 * finer), simulation)
        tried.append((agreement, finer, end))
        if agreement < AGREED:
            break
    agreement, finer, end = min(tried, key=lambda found: found[0])
    half = replace(simulation, end=simulation.end / 2)
    middle = end_of(half, methods[0], finer)
    condition = 1.0
    for start, to in ((simulation, end), (started(half, middle), None)):
        there = end_of(start, methods[0], finer) if to is None else to
        for seed in (1, 2):
            moved = end_of(started(start, perturbed(start, PERTURBATION, seed)), methods[0], finer)
            condition = max(condition, distance(moved, there, simulation) / PERTURBATION)
    return Reference(end, " and ".join(methods), agreement, condition)


def started(simulation: Simulation, state: Vector) -> Simulation:
    """The same scene from another state."""
    return replace(simulation, state=state, exact_digits=())


def _survives(simulation: Simulation, method: str, scalar: str = WIDE) -> bool:
    try:
        _run(simulation, method, FINER[0], scalar=scalar)
    except RunFailed:
        return False
    return True


def perturbed(simulation: Simulation, size: float, seed: int) -> Vector:
    """The initial state with every number changed by up to `size` of the largest of its kind."""
    random = np.random.default_rng(seed)
    state = simulation.state.copy()
    for part in _parts(simulation, state):
        part[:] += size * np.abs(part).max() * random.uniform(-1, 1, len(part))
    return state


def _parts(simulation: Simulation, state: Vector) -> list[Vector]:
    """Views of the motor and the momentum of each body."""
    run = simulation.compile(method=next(iter(simulation.methods))).description
    motor, momentum = len(run.motor), len(run.momentum)
    ends = np.cumsum([0, *([motor, momentum] * len(run.bodies))])
    return [state[a:b] for a, b in pairwise(ends)]


def distance(one: Vector, other: Vector, simulation: Simulation) -> float:
    """The largest difference of a motor's or a momentum's number, relative to the largest of it."""
    pairs = zip(_parts(simulation, one), _parts(simulation, other), strict=True)
    return max(float(np.abs(a - b).max() / max(np.abs(b).max(), 1e-300)) for a, b in pairs)


def end_state(run: Run) -> Vector:
    """The last state of a run as doubles."""
    return np.array(
        [
            float(number)
            for body in run.final.values()
            for part in ("motor", "momentum")
            for number in body[part].values()
        ]
    )


def judged(case: str, simulation: Simulation, reference: Reference, method: str) -> Row:
    """One method on one case."""
    traits = next(m for m in METHODS if m.name == method)
    figures: dict[str, float] = {}
    failures: list[str] = []
    verdict = "pass"
    try:
        coarse = _run(simulation, method, 1, watched=True)
        fine = _run(simulation, method, 2)
    except RunFailed as failed:
        stops = "stops" if _survives(simulation, method, "double") else "fail"
        return Row(case, method, traits.order, figures, stops, [str(failed)])
    steps = int(coarse.report["steps"])
    floor = (
        ROUNDINGS * EPSILON["double"] * math.sqrt(steps) * reference.condition
        + 2 * reference.agreement
    )
    error, finer = (distance(end_state(run), reference.end, simulation) for run in (coarse, fine))
    figures |= {"error": error, "error at half the step": finer, "rounding": floor}
    if not math.isfinite(error + finer):
        failures.append("a number is not finite")
    exact = traits.order == 0
    if error > UNRESOLVED and not exact:
        verdict = "unresolved"
    elif finer > max(0.0 if exact else error / 2 ** (traits.order - ORDER_SLACK), floor):
        failures.append(f"error {error:.1e} falls to {finer:.1e} only, rounding being {floor:.1e}")
    if Promise.MOMENTA in traits.promises:
        momenta = _worst(coarse, lambda name: name.startswith(("spatial_momentum", "casimir")))
        lever = max(
            1.0, float(np.abs(np.concatenate([coarse.motor(b) for b in coarse.bodies])).max())
        )
        momenta_bound = 4 * ROUNDINGS * EPSILON["double"] * math.sqrt(steps) * lever**2
        figures["momenta"] = momenta
        if momenta > momenta_bound:
            failures.append(f"momenta change by {momenta:.1e}, more than {momenta_bound:.1e}")
    if Promise.SYMPLECTIC in traits.promises and verdict != "unresolved":
        early, late = _energy_errors(simulation, method)
        figures["energy"] = max(early, late)
        if late > GROWTH * early + 4 * floor:
            failures.append(f"the energy error grows from {early:.1e} to {late:.1e}")
    if Promise.SYMMETRIC in traits.promises:
        back = reversal(simulation, method, end_state(coarse), steps)
        figures["reversal"] = back
        if verdict != "unresolved" and back > floor:
            failures.append(f"returns {back:.1e} from the start")
    if verdict != "unresolved" and method in QUICK:
        figures["float"], wrong = _in_float(simulation, reference, method, error, floor)
        failures += wrong
    return Row(case, method, traits.order, figures, "fail" if failures else verdict, failures)


def reversal(simulation: Simulation, method: str, end: Vector, steps: int) -> float:
    """How far from the start as many steps back from `end` arrive."""
    assert simulation.step is not None
    library = simulation.compile(method=method).library
    with library.start(method, step=-simulation.end / steps, state=end) as run:
        if run.advance(steps, 0, None) < steps:
            return math.inf
        return distance(run.state(), simulation.state, simulation)


def _in_float(
    simulation: Simulation, reference: Reference, method: str, error: float, floor: float
) -> tuple[float, list[str]]:
    try:
        run = _run(simulation, method, 1, scalar="float")
    except UsageError:
        return math.nan, []  # refused by name
    except RunFailed:
        # A clean stop, where float has too few digits to go on.
        digits = EPSILON["float"] / EPSILON["double"] * floor
        return math.nan, [] if digits > UNRESOLVED else ["float: stops"]
    found = distance(end_state(run), reference.end, simulation)
    steps = int(run.report["steps"])
    bound = ROUNDINGS * EPSILON["float"] * math.sqrt(steps) * reference.condition + 2 * error
    wrong = [f"float: error {found:.1e}, more than {bound:.1e}"]
    return found, wrong if not found <= bound else []


def _run(
    simulation: Simulation,
    method: str,
    finer: int,
    *,
    scalar: str = "double",
    watched: bool = False,
) -> Run:
    assert simulation.step is not None
    steps = round(simulation.end / simulation.step) * finer
    return simulation.run(
        method=method,
        step=simulation.end / steps,
        every=max(steps // ROWS, 1) if watched else steps,
        scalar=scalar,
    )


def _worst(run: Run, wanted: Callable[[str], bool]) -> float:
    """The largest relative error of the conserved quantities whose names are wanted."""
    errors = (q["max_relative_error"] for name, q in run.conserved.items() if wanted(name))
    return max(map(float, errors), default=0.0)


def _energy_errors(simulation: Simulation, method: str) -> tuple[float, float]:
    """The largest relative energy errors of the first and the last of four such runs.

    A trend that is linear in time gives the last one four times the first.
    """
    try:
        run = _run(replace(simulation, end=4 * simulation.end), method, 1, watched=True)
    except RunFailed as failed:
        run = failed.run
    energy = run.energy
    errors = np.abs(energy - energy[0]) / (run.conserved["energy"]["scale"] or 1.0)
    quarter = max(len(errors) // 4, 1)
    return float(errors[:quarter].max()), float(errors[-quarter:].max())


def _description(simulation: Simulation) -> str:
    assert simulation.read is not None
    return simulation.read().description


COLUMNS: Final = ("error", "error at half the step", "momenta", "energy", "reversal", "float")
HEADS: Final = ("error", "half step", "momenta", "energy", "reversal", "float")


def table(account: Mapping[str, Any]) -> str:
    """A block for each case, a line for each method, and what failed."""
    lines = []
    for case in account["cases"]:
        lines.append(f"{case['case']}: {case['description']}")
        lines.append(
            f"  {case['end']:g} s, step {case['step']:g} s; condition {case['condition']:.1e}; "
            f"reference {case['reference']}, {case['reference_agreement']:.0e} apart"
        )
        lines.append(f"  {'method':<14}" + "".join(f"{head:>11}" for head in HEADS))
        for row in case["rows"]:
            cells = "".join(
                f"{row['figures'][name]:>11.1e}" if name in row["figures"] else f"{'':>11}"
                for name in COLUMNS
            )
            lines.append(f"  {row['method']:<14}{cells}  {row['verdict']}")
            lines += [f"    {failure}" for failure in row["failures"]]
        lines.append("")
    for check in account["checks"]:
        lines.append(f"{check['name']}: {check['found']}: {'pass' if check['passed'] else 'fail'}")
    if account["checks"]:
        lines.append("")
    rows = [row for case in account["cases"] for row in case["rows"]]
    count = Counter(row["verdict"] for row in rows)
    lines.append(
        f"{len(rows)} judged: {count['pass']} pass, {count['unresolved']} unresolved (step too long"
        f" for the method; finite, momenta kept where promised), {count['stops']} stop cleanly,"
        f" {count['fail']} fail"
    )
    return "\n".join(lines)
