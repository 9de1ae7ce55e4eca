"""`hamotor bench stability`: every method on hard cases, judged by what it promises.

A case is a scene of `generator/scenes/hard`. Each method that the scene offers steps it twice, with
the case's step h and with h/2; errors are distances at the end from a reference in a wider scalar,
which two methods of high order agree upon. They are judged against the condition of the case, that
is how much the end moves for a small change of the state, at the start or on the way, so that
nobody is asked for digits that the state does not hold:

* accuracy: the error of h/2 falls as the method's order says, or is at rounding × condition;
* symplectic methods: spatial momenta and Casimirs at rounding; the energy error does not grow,
  other than with the square of the momenta;
* symmetric methods: forward and back again ends at the start, but for what the condition makes of
  rounding or, where a method rounds larger numbers than the state's, in a wider scalar;
* a run in `float` is as good as its digits (one method of each family).

Where h is too long for a method (it stops, its error is beyond 0.1 or does not yet fall as the
order says) it is judged at h/4 or h/16, at h/256 or h/2048 where h/16 stops or leaves no digit, and
the row says so.  It stays `unresolved` where that is too long as well, or where rounding ×
condition leaves no digit in a double: all that is asked then is that numbers stay finite and that
what is promised for every step holds.  A method that stops with all these steps fails.  A case
whose end holds few digits is judged at a half, a quarter or an eighth of its time, and goes on to
its end.

Beside them: exp and log of every group around multiples of π, runs that must stop cleanly, and a
mass that no scalar holds.
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
from dataclasses import asdict, dataclass, field, fields, replace
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np

from hamotor.bench.account import provenance, publish
from hamotor.errors import NumericsError, UsageError, suggest
from hamotor.run.build import compile_scene
from hamotor.run.library import SceneLibrary, Vector
from hamotor.run.result import Run, RunFailed
from hamotor.run.simulation import Compiled, Simulation, load
from hamotor.scene import METHODS, Promise
from hamotor.scene.methods import Method

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
SHORTER: Final = (1, 4, 16)
"""Parts of the case's step that a method is tried with, until it resolves the case."""
FAR_SHORTER: Final = (256, 2048)
"""Parts that a method is judged with where the last of these stops or leaves no digit."""
FEW_DIGITS: Final = 1e-3
"""What rounding may leave at the time at which a case is judged."""
PERTURBATION: Final = 1e-15
PERTURBED_AT: Final = (0.0, 0.25, 0.5, 0.75, 0.98)
"""Parts of the way at which the state is moved, for the condition."""
ROUNDINGS: Final = 16.0
"""Roundings of a step that the condition may multiply."""
MOMENTA_ROUNDINGS: Final = 256.0
"""Of a step, in units of the largest momentum that the motor's lever makes."""
UNRESOLVED: Final = 0.1
GROWTH: Final = 3.0
ORDER_SLACK: Final = 0.7
EPSILON: Final = {"double": 2.0**-52, "float": 2.0**-23}


@dataclass(frozen=True)
class Case(Simulation):
    """A hard case.  One library a scalar holds all the methods that it is run with."""

    by_scalar: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    compiled: dict[str, Compiled] = field(default_factory=dict)

    def compile(self, *, scalar: str = "double", **_: Any) -> Compiled:
        """The library of a scalar; for those beside double in half the compiler's time."""
        if scalar not in self.compiled:
            names = " ".join(self.by_scalar[scalar])
            text = self.source("generated", scalar, names)
            text = f'#define HAMOTOR_METHOD "{names}"\n{text}'
            flags = () if scalar == "double" else ("-O1",)
            build = compile_scene(text, scalar=scalar, extra_flags=flags)
            self.compiled[scalar] = Compiled(build, SceneLibrary(build.library), 0.0, text)
        return self.compiled[scalar]


def hard_case(name: str, methods: Sequence[str] = ()) -> Case:
    """The hard case of this name, to be run with these methods (all that it offers)."""
    scene = load(CASES / f"{name}.toml")
    wanted = tuple(m for m in scene.methods if not methods or m in methods)
    by_scalar = {
        "double": wanted,
        "float": tuple(m for m in wanted if m in QUICK),
        WIDE: tuple(m for m in REFERENCES if m in scene.methods),
    }
    return Case(**{f.name: getattr(scene, f.name) for f in fields(scene)}, by_scalar=by_scalar)


@dataclass(frozen=True)
class Row:
    """One method on one case: figures by name, and what of its promises did not hold."""

    case: str
    method: str
    order: int
    figures: dict[str, float]
    verdict: str
    """`pass`, `unresolved` (finite, and what holds for any step held), `stops` (cleanly, where no
    digit would be left) or `fail`."""
    failures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    """At which step it was judged and why, if not at the case's; why it is unresolved."""
    unjudged: dict[str, str] = field(default_factory=dict)
    """Why a figure, which may be there or not, is not judged."""
    step: float = 0.0
    """At which it was judged, s."""


@dataclass(frozen=True)
class Reference:
    """The end of a case in a wider scalar."""

    end: Vector
    method: str
    agreement: float
    """Distance of two methods' ends."""
    condition: float
    """How many times further apart two runs end than they are at the start and on the way."""


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
    checks: list[Check] = []
    if not cases:
        print("judging exp, log, stops and refusals", file=sys.stderr, flush=True)
        stops = (stop_of("expanding"), stop_of("shrinking"))
        checks = [*edges(), *stops, refusal_of_a_denormal_mass()]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        told = list(pool.map(lambda case: _judged_case(case, quick=quick), cases or known))
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


def _judged_case(name: str, *, quick: bool) -> dict[str, Any]:
    print(f"judging {name}", file=sys.stderr, flush=True)
    whole = hard_case(name, QUICK if quick else ())
    assert whole.step is not None
    case, reference = whole, reference_of(whole)
    for part in (2, 4, 8):
        if _floor(reference, round(case.end / whole.step), "double") <= FEW_DIGITS:
            break
        case = replace(whole, end=round(whole.end / whole.step / part) * whole.step)
        reference = reference_of(case)
    rows = [judged(name, case, reference, method) for method in whole.by_scalar["double"]]
    if case.end < whole.end:
        rows = [carried_on(row, whole) for row in rows]
    return {
        "case": name,
        "description": _description(case),
        "step": case.step,
        "end": whole.end,
        "judged_at": case.end,
        "reference": reference.method,
        "reference_agreement": reference.agreement,
        "condition": reference.condition,
        "rows": [asdict(row) for row in rows],
    }


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


def stop_of(name: str) -> Check:
    """A body that expands, or shrinks, for ever: until the digits of a motor do not hold it."""
    check = f"stop of a body that is {name}"
    try:
        run = hard_case(name, ("rkmk4",)).run(end=1e4, step=0.01, method="rkmk4", every=1000)
    except RunFailed as failed:
        message, kept = str(failed), failed.run.t[-1]
        told = "left the group" in message and "step" in message and "blob." in message
        return Check(check, told and bool(kept > 0), f"kept {kept:g} s: {message}")
    return Check(check, False, f"went on to t = {run.t[-1]:g} s")


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
    return Reference(end, " and ".join(methods), agreement, _condition(simulation, methods))


def _condition(simulation: Simulation, methods: Sequence[str]) -> float:
    """How much further apart runs end than a change puts them, rms over the times of the change.

    The larger of two methods': projections to the group, which only some need, magnify as well.
    """
    squares = []
    for part in PERTURBED_AT:
        largest = 1.0
        state = simulation.state
        if part > 0:
            before = replace(simulation, end=part * simulation.end)
            state = end_state(_run(before, methods[0], FINER[0], scalar=WIDE))
        rest = replace(started(simulation, state), end=(1 - part) * simulation.end)
        for method in methods:
            there = end_state(_run(rest, method, FINER[0], scalar=WIDE))
            for seed in (1, 2):
                changed = started(rest, state, perturbation(rest, PERTURBATION, seed))
                moved = end_state(_run(changed, method, FINER[0], scalar=WIDE))
                largest = max(largest, distance(moved, there, simulation) / PERTURBATION)
        squares.append(largest**2)
    return math.sqrt(sum(squares) / len(squares))


def started(simulation: Simulation, state: Vector, change: Vector | None = None) -> Simulation:
    """The same scene from another state, and a change of it that a double may not hold."""
    if change is None:
        return replace(simulation, state=state, exact_digits=())
    exact = [Fraction(x) + Fraction(dx) for x, dx in zip(state, change, strict=True)]
    return replace(simulation, state=state + change, exact_digits=tuple(map(str, exact)))


def _survives(simulation: Simulation, method: str, scalar: str = WIDE) -> bool:
    try:
        _run(simulation, method, FINER[0], scalar=scalar)
    except RunFailed:
        return False
    return True


def perturbation(simulation: Simulation, size: float, seed: int) -> Vector:
    """A change of every number of the initial state by up to `size` of the largest of its kind."""
    random = np.random.default_rng(seed)
    change = np.zeros_like(simulation.state)
    for kind in _kinds(simulation):
        largest = np.abs(simulation.state[kind]).max()
        change[kind] = size * largest * random.uniform(-1, 1, len(kind))
    return change


def _kinds(simulation: Simulation) -> list[list[int]]:
    """Which numbers of a state are alike: of one body, motor or momentum, in one unit."""
    found = simulation.compile(method=next(iter(simulation.methods))).description
    columns = [found.columns[k] for k in found.state_columns()]
    kinds: dict[tuple[str, str, str], list[int]] = {}
    for index, column in enumerate(columns):
        part = column.name.removeprefix(f"{column.body}.").partition(".")[0]
        kinds.setdefault((column.body, part, column.unit), []).append(index)
    return list(kinds.values())


def distance(one: Vector, other: Vector, simulation: Simulation, *also: Vector) -> float:
    """The largest difference of two numbers, relative to the largest of their kind.

    That is the largest in `other`, or in `also`: other states that the scene goes through.
    """
    off, sizes = np.abs(one - other), np.max(np.abs([other, *also]), axis=0)
    kinds = _kinds(simulation)
    return max(float(off[kind].max() / max(sizes[kind].max(), 1e-300)) for kind in kinds)


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
    """One method on one case, with the first of the steps h, h/4 and h/16 that resolves it.

    With h/256 or h/2048 where h/16 stops or leaves no digit.
    """
    traits = next(m for m in METHODS if m.name == method)
    notes: list[str] = []
    for shorter in (*SHORTER, *FAR_SHORTER):
        assert simulation.step is not None
        finer = replace(simulation, step=simulation.step / shorter)
        of_step = f" of {finer.step:g} s" if shorter > 1 else ""
        steps = round(simulation.end / simulation.step) * shorter
        floor = _floor(reference, steps, "double")
        try:
            coarse = _run(finer, method, 1, watched=True)
            fine = _run(finer, method, 2)
        except RunFailed as failed:
            notes.append(f"step{of_step}: {failed}")
            if shorter >= SHORTER[-1] and floor > UNRESOLVED:
                return Row(case, method, traits.order, {"rounding": floor}, "stops", [], notes)
            continue
        error = distance(end_state(coarse), reference.end, simulation)
        resolved = error <= UNRESOLVED or traits.order == 0 or not math.isfinite(error)
        half = distance(end_state(fine), reference.end, simulation)
        last = shorter == FAR_SHORTER[-1] or (shorter >= SHORTER[-1] and resolved)
        if last or (resolved and half <= _allowed(traits, error, floor)) or floor > UNRESOLVED:
            if not resolved and floor > UNRESOLVED:
                notes.append(f"rounding × condition is {floor:.0e}: no digit is left to judge")
            elif not resolved:
                notes.append(f"step too long even at {finer.step:g} s: error {error:.1e}")
            elif shorter > 1:
                notes.append(f"judged with a step of {finer.step:g} s")
            return _judged_at(case, finer, reference, traits, (coarse, fine), notes)
        notes.append(f"step{of_step} too long: error {error:.1e}, with half of it {half:.1e}")
    failures = ["stops with every step"]
    return Row(case, method, traits.order, {"rounding": floor}, "fail", failures, notes)


def carried_on(row: Row, whole: Simulation) -> Row:
    """The row of a case that was judged early, after the run to its end: it gets there, with the
    momenta that it promises."""
    traits = next(m for m in METHODS if m.name == row.method)
    failures = list(row.failures)
    try:
        run = _run(replace(whole, step=row.step or whole.step), row.method, 1, watched=True)
    except RunFailed as failed:
        failures.append(f"does not go on to {whole.end:g} s: {failed}")
    else:
        if Promise.MOMENTA in traits.promises:
            failures += _momenta(run)[1]
    return replace(row, failures=failures, verdict="fail" if failures else row.verdict)


def _allowed(traits: Method, error: float, floor: float) -> float:
    """What may be left of an error with half the step."""
    by_order = error / 2 ** (traits.order - ORDER_SLACK) if traits.order else 0.0
    return max(by_order, floor)


def _floor(reference: Reference, steps: int, scalar: str) -> float:
    """What rounding in every step may leave at the end."""
    rounding = ROUNDINGS * EPSILON[scalar] * math.sqrt(steps)
    return rounding * reference.condition + 2 * reference.agreement


def _judged_at(
    case: str,
    simulation: Simulation,
    reference: Reference,
    traits: Method,
    runs: tuple[Run, Run],
    notes: list[str],
) -> Row:
    """The verdict at a step, from the runs with it and with half of it."""
    coarse, method = runs[0], traits.name
    figures: dict[str, float] = {}
    failures: list[str] = []
    steps = int(coarse.report["steps"])
    floor = _floor(reference, steps, "double")
    error, finer = (distance(end_state(run), reference.end, simulation) for run in runs)
    figures |= {"error": error, "error at half the step": finer, "rounding": floor}
    if not math.isfinite(error + finer):
        failures.append("a number is not finite")
    exact = traits.order == 0
    verdict = "pass"
    if error > UNRESOLVED and not exact:
        verdict = "unresolved"
    elif finer > _allowed(traits, error, floor):
        failures.append(f"error {error:.1e} falls to {finer:.1e} only, rounding being {floor:.1e}")
    if Promise.MOMENTA in traits.promises:
        figures["momenta"], wrong = _momenta(coarse)
        failures += wrong
    if Promise.SYMPLECTIC in traits.promises and verdict != "unresolved":
        early, late, grown, rounding = _energy_errors(simulation, method)
        figures["energy"] = max(early, late)
        if late > GROWTH * early * grown + 4 * floor + rounding:
            failures.append(f"the energy error grows from {early:.1e} to {late:.1e}")
    if Promise.SYMMETRIC in traits.promises and verdict != "unresolved":
        end = end_state(coarse)
        back = reversal(simulation, method, end, steps)
        figures["reversal"] = back
        if not math.isfinite(back):
            failures.append("stops on the way back")
        elif back > floor:
            # What the way back magnifies is of other sizes at its start than at its end.
            condition = _condition_back(simulation, method, end, steps)
            bound = max(floor, floor / reference.condition * condition)
            if not back <= bound:
                told = f"returns {back:.1e} from the start, more than {bound:.1e}"
                wide = _reversal_in_wide(simulation, method, end, steps)
                if wide <= bound:
                    notes.append(f"{told}, by roundings of its own: {wide:.1e} in {WIDE}")
                else:
                    failures.append(f"{told}; {wide:.1e} in {WIDE}")
    unjudged: dict[str, str] = {}
    if verdict != "unresolved" and method in QUICK:
        found, wrong, why = _in_float(simulation, reference, method, error)
        failures += wrong
        figures |= {} if found is None else {"float": found}
        unjudged |= {"float": why} if why else {}
    return Row(
        case,
        method,
        traits.order,
        figures,
        "fail" if failures else verdict,
        failures,
        notes,
        unjudged,
        simulation.step or 0.0,
    )


def _momenta(run: Run) -> tuple[float, list[str]]:
    """By how much momenta and Casimirs change, and whether that is more than rounding."""
    change = _worst(run, lambda name: name.startswith(("spatial_momentum", "casimir")))
    lever = max(1.0, float(np.abs(np.concatenate([run.motor(b) for b in run.bodies])).max()))
    steps = int(run.report["steps"])
    bound = MOMENTA_ROUNDINGS * EPSILON["double"] * math.sqrt(steps) * lever**2
    return change, [f"momenta change by {change:.1e}, more than {bound:.1e}"] * (change > bound)


def reversal(simulation: Simulation, method: str, end: Vector, steps: int) -> float:
    """How far from the start as many steps back from `end` arrive."""
    start = _back(simulation, method, end, steps)
    return math.inf if start is None else distance(start, simulation.state, simulation, end)


def _back(simulation: Simulation, method: str, end: Vector, steps: int) -> Vector | None:
    library = simulation.compile(method=method).library
    with library.start(method, step=-simulation.end / steps, state=end) as run:
        return run.state() if run.advance(steps, 0, None) == steps else None


def _reversal_in_wide(simulation: Simulation, method: str, end: Vector, steps: int) -> float:
    """How far from the start as many steps there and back in the wider scalar arrive.

    Infinite where it stops.  What a method promises but for rounding holds there, whatever larger
    numbers it rounds beside those of the state.
    """
    assert isinstance(simulation, Case)
    alone = replace(simulation, by_scalar={WIDE: (method,)}, compiled={})
    library = alone.compile(scalar=WIDE).library
    state = simulation.state
    for step in (simulation.end / steps, -simulation.end / steps):
        with library.start(method, step=step, state=state) as run:
            if run.advance(steps, 0, None) != steps:
                return math.inf
            state = run.state()
    return distance(state, simulation.state, simulation, end)


def _condition_back(simulation: Simulation, method: str, end: Vector, steps: int) -> float:
    """How much further apart than their ends the starts are that lead there, for small changes."""
    size = 1e-12
    starts = [
        _back(simulation, method, end + size * change, steps)
        for change in (0.0, perturbation(started(simulation, end), 1.0, 1))
    ]
    if starts[0] is None or starts[1] is None:
        return 1.0
    return distance(starts[1], starts[0], simulation, end) / size


def _in_float(
    simulation: Simulation, reference: Reference, method: str, error: float
) -> tuple[float | None, list[str], str]:
    """The error of a run in float, if there is one; what is wrong with it; why it is not judged."""
    assert simulation.step is not None
    floor = _floor(reference, round(simulation.end / simulation.step), "float")
    few = "rounding × condition leaves no digit of a float"
    try:
        run = _run(simulation, method, 1, scalar="float")
    except UsageError as refused:
        return None, [], f"refused: {refused}"
    except RunFailed as failed:
        if floor > UNRESOLVED:
            return None, [], f"stops cleanly: {few}"
        return None, [f"float: {failed}"], ""
    found = distance(end_state(run), reference.end, simulation)
    if floor > UNRESOLVED:
        return found, [] if math.isfinite(found) else ["float: not finite"], few
    bound = floor + 2 * error
    wrong = [f"float: error {found:.1e}, more than {bound:.1e}"]
    return found, wrong if not found <= bound else [], ""


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


def _energy_errors(simulation: Simulation, method: str) -> tuple[float, float, float, float]:
    """The largest relative energy errors of the first and the last of four such runs.

    A trend that is linear in time gives the last one four times the first. Beside them by how
    much the squares of the momenta, and with them the terms of the energy, grow, and what rounding
    may make of the last: of a body that has fallen far, energies cancel that are far larger.
    """
    try:
        run = _run(replace(simulation, end=4 * simulation.end), method, 1, watched=True)
    except RunFailed as failed:
        run = failed.run
    energy = run.energy
    scale = run.conserved["energy"]["scale"] or 1.0
    errors = np.abs(energy - energy[0]) / scale
    quarter = max(len(errors) // 4, 1)
    sizes = [np.square(run.momentum(body)).sum(axis=1) for body in run.bodies]
    grown = max(float(x[-quarter:].max() / max(x[:quarter].max(), 1e-300)) for x in sizes)
    rounding = ROUNDINGS * EPSILON["double"] * math.sqrt(int(run.report["steps"]))
    cancelled = _energy_moved(simulation, method, end_state(run)) / scale
    return (
        float(errors[:quarter].max()),
        float(errors[-quarter:].max()),
        max(grown, 1.0),
        rounding * cancelled,
    )


def _energy_moved(simulation: Simulation, method: str, state: Vector) -> float:
    """By how much the energy of a state moves, over the size of a change of its numbers, J."""
    size = 1e-8
    assert simulation.step is not None
    there = replace(started(simulation, state), end=simulation.step)

    def energy(change: Vector | float) -> float:
        try:
            run = _run(started(there, state + change), method, 1)
        except RunFailed as failed:
            run = failed.run
        return float(run.energy[0])

    changes = [perturbation(there, size, seed) for seed in (1, 2)]
    return max(abs(energy(change) - energy(0.0)) for change in changes) / size


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
        if case["judged_at"] < case["end"]:
            lines.append(
                f"  judged at {case['judged_at']:g} s, which holds more digits, then carried on"
            )
        lines.append(f"  {'method':<14}" + "".join(f"{head:>11}" for head in HEADS))
        for row in case["rows"]:
            cells = "".join(_cell(row, name) for name in COLUMNS)
            lines.append(f"  {row['method']:<14}{cells}  {row['verdict']}")
            lines += [f"    {line}" for line in [*row["failures"], *row["notes"]]]
        whys: dict[str, list[str]] = {}
        for row in case["rows"]:
            for name, why in row["unjudged"].items():
                whys.setdefault(f"{name} not judged, {why}", []).append(row["method"])
        lines += [f"  {why}: {', '.join(found)}" for why, found in whys.items()]
        lines.append("")
    for check in account["checks"]:
        lines.append(f"{check['name']}: {check['found']}: {'pass' if check['passed'] else 'fail'}")
    if account["checks"]:
        lines.append("")
    rows = [row for case in account["cases"] for row in case["rows"]]
    count = Counter(row["verdict"] for row in rows)
    lines.append(
        f"{len(rows)} rows: {count['pass']} pass, {count['unresolved']} unresolved (step too long,"
        f" or no digit to judge; finite, momenta kept where promised), {count['stops']} stop"
        f" cleanly, {count['fail']} fail"
    )
    if any(row["unjudged"] for row in rows):
        lines.append("(…): not judged; –: no number, and why stands below the case")
    return "\n".join(lines)


def _cell(row: Mapping[str, Any], name: str) -> str:
    found = row["figures"].get(name)
    if found is None or not math.isfinite(found):
        return f"{'–' if found is not None or name in row['unjudged'] else '':>11}"
    text = f"{found:.1e}"
    return f"{f'({text})' if name in row['unjudged'] else text:>11}"
