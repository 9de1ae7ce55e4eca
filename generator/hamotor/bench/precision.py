"""`hamotor bench precision`: what each digit costs, by method, and beside public solvers.

Every setting of every contestant integrates the same problem from the same start to the same end,
in one process; what is timed is the integration alone, the set-up is listed apart.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from fractions import Fraction
from math import inf, isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np

from hamotor.bench import endpoint, equations, solvers
from hamotor.bench.account import (
    Progress,
    in_words,
    now_in_words,
    provenance,
    publish,
    say,
)
from hamotor.bench.contest import (
    GIVEN,
    OWN,
    Contestant,
    Extent,
    Form,
    Row,
    environment,
    step_ladder,
    tolerances,
    wide_tolerances,
)
from hamotor.bench.counting import work_of
from hamotor.bench.drift import SAMPLES, Conserved, Drift, drifts, of_method, step_of
from hamotor.bench.endpoint import ATTITUDE, POSITION
from hamotor.bench.precision_report import (
    ahead,
    coverage,
    leaders,
    more_digits,
    over_problems,
    rules,
    standings,
    table,
    write_report,
)
from hamotor.bench.problems import GOALS, TARGETS, Problem, default_problems, own_problems, problem
from hamotor.errors import HamotorError, ToolError, UsageError
from hamotor.files import write_whole
from hamotor.run.build import default_cache, find_compiler, flags_for
from hamotor.run.library import SceneLibrary, in_decimals
from hamotor.run.report import to_json
from hamotor.run.simulation import Compiled, Simulation, load
from hamotor.scene import METHODS
from hamotor.scene.scalars import COUNTED, Scalar

COMPILERS: Final = ("g++", "clang++")
_FORMS: Final = (
    (Form(kernels="generic"), ("rkmk4", "rk4", "rkmk87", "gauss6")),
    (Form(kernels="sparse"), ("rkmk4", "rk4", "rkmk87", "gauss6")),
    (Form(representation="matrix"), ("rkmk4", "rk4")),
    (Form(algebra="conformal"), ("rkmk4", "rk4", "rkmk87", "gauss6", "taylor")),
    (Form(scalar="float"), ("rkmk4", "splitting4", "gauss6")),
    (Form(scalar="long_double"), ("splitting8", "gauss8")),
    (Form(scalar="quad"), ("rk87", "splitting10", "gauss16", "taylor", "closed_form")),
)
"""Kernels, representation, algebra and scalar beside the generated ones in double, with methods."""

FULL: Final = Extent(8, 2 ** (1 / 3), 0.015, 0.15, True, COMPILERS, 10**6, 3.0, counted=True)
QUICK: Final = Extent(
    3, 2.0, 0.01, 0.02, False, COMPILERS[:1],
    methods=("rkmk4", "rk87", "splitting4", "splitting8", "gauss8", "closed_form", "taylor"),
)  # fmt: skip
_TYPICAL_S: Final = {"whole": 100.0, "part": 40.0, "quick": 35.0}
"""What a problem takes on two cores of 3 GHz, without public solvers and long runs."""
_PEERS_S: Final = 120.0
"""What public solvers add to that of a problem, if not quick."""
_LONG_RUNS: Final = 12.0
"""How many times as long as one of a problem's long runs may take all of them take."""


_WIDE_S: Final = 0.5
"""What a setting of a scalar with more digits than a double may take."""

_THE_SAME_WORK: Final = ("rk", "cf", "splitting")
"""Methods whose steps take as many operations in any scalar."""


def bench_precision(
    scenes: Sequence[str] = (),
    out: Path | None = None,
    json: bool = False,
    quick: bool = False,
    with_peers: bool = False,
    drift: int | None = None,
) -> dict[str, Any]:
    """Run and account for the benchmark of precision.

    scenes: names or paths of scenes, NAME@END to end at this time (s); if not given the benchmark's
    own problems and all bundled scenes, of which one of each structure in each algebra and group
    has other kernels, representations, algebras and scalars, too.  out: where precision.json, the
    diagrams and precision.html go, written again after every problem, and precision_NAME.json, from
    which a later call takes what it would only measure again; None: nowhere.  json: print the
    account on stdout instead of the table.  quick: a method of each family, fewer settings and
    repetitions, one compiler, no other kernels or scalars, nothing counted.  with_peers: first
    install the public solvers that come from PyPI.  drift: steps of the long runs, a million if not
    given, none if quick.
    Returns the account.  Raises UsageError and ToolError as `hamotor run` does.
    """
    problems = [problem(name) for name in dict.fromkeys(scenes or default_problems())]
    gaps: dict[str, str] = {}
    if with_peers:
        solvers.install_peers()
    peers = solvers.peers_here(gaps)
    extent = QUICK if quick else FULL
    if drift is not None:
        extent = replace(extent, drift=drift, longest_run_s=max(10.0, drift / 1e6))
    alike = None if scenes or quick else alike_to(problems)
    account = measure(problems, extent, peers, gaps, out, alike)
    publish(account, table, out=None, as_json=json)
    return account


def alike_to(problems: Sequence[Problem]) -> dict[str, str]:
    """Problems whose structure, algebra and group another one before them has, and which that is.

    One whose bodies have several groups is like no other.
    """
    first: dict[tuple[str, ...], str] = {}
    found = {}
    for one in problems:
        group = getattr(getattr(one.scene, "group", None), "name", one.name)
        name = first.setdefault((one.simulation.structure, one.algebra, group), one.name)
        if name != one.name:
            found[one.name] = name
    return found


def _extent_of(one: Problem, extent: Extent, alike: Mapping[str, str] | None) -> Extent:
    """Of what is not the benchmark's own less, beside many others."""
    if alike is None:
        return extent
    forms = extent.forms and one.name not in alike
    if one.name in own_problems():
        return replace(extent, forms=forms)
    counted = extent.counted and forms
    return replace(extent, forms=forms, counted=counted, compilers=extent.compilers[:1])


def measure(
    problems: Sequence[Problem],
    extent: Extent,
    peers: Mapping[str, str],
    gaps: Mapping[str, str],
    out: Path | None = None,
    alike: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """The account of these problems, with the peers there are (package → version).

    With `out` the report is written after each problem; what was measured before with all the same
    is read from there.  Of several problems those that cannot be measured are gaps; one alone
    raises.  alike: what each of these is so like that only generated kernels in double are measured
    of it, not counted if it is not the benchmark's own; of those one compiler is enough then.
    """
    about = _provenance(_compilers(extent), peers, extent)
    missing = dict(gaps)
    extents = {one.name: _extent_of(one, extent, alike) for one in problems}
    kept: dict[str, Mapping[str, Any]] = {}
    for one in problems:
        part = _read(_file_of(one, out), _key(one, extents[one.name], about))
        if part is not None:
            kept[one.name] = part
    left = Left([_typical_s(extents[p.name], peers) for p in problems if p.name not in kept])
    parts: dict[str, Mapping[str, Any]] = {}
    for index, one in enumerate(problems):
        own = extents[one.name]
        if one.name in kept:
            parts[one.name] = kept[one.name]
            continue
        try:
            say(f"{one.name}: {index + 1} of {len(problems)} problems, {left}")
            measured = _measured(one, own, peers)
            if of := (alike or {}).get(one.name):
                measured["missing"][f"other kernels, scalars and such on {one.name}"] = (
                    f"left out: its structure, algebra and group are those of {of}, which has"
                    f" them; bench precision {one.name} measures them here"
                )
            parts[one.name] = {"key": _key(one, own, about), **measured}
        except KeyboardInterrupt:
            done = ", ".join(parts) or "no problem yet"
            say(f"hamotor bench: kept: {done}; the same command goes on with {one.name}")
            raise
        except HamotorError as refusal:
            if len(problems) == 1:
                raise
            missing[one.name] = str(refusal)
            say(f"{one.name}: {refusal}")
            continue
        finally:
            left.done()
        file = _file_of(one, out)
        if out is None or file is None:
            continue
        out.mkdir(parents=True, exist_ok=True)
        write_whole(file, to_json(parts[one.name]))
        waiting = {
            p.name: "not measured yet; the same command goes on"
            for p in problems[index + 1 :]
            if p.name not in kept
        }
        # In the order asked for, those measured before among them.
        known = {p.name: {**kept, **parts}[p.name] for p in problems if p.name in {*kept, *parts}}
        account = _account(known, {**missing, **waiting}, about)
        for written in write_report(account, out, [one.name]):
            say(f"wrote {written}")
    if not parts:
        raise UsageError("hamotor bench: none of these scenes can be measured; see above")
    account = _account(parts, missing, about)
    if out is not None and kept.keys() == parts.keys():
        for written in write_report(account, out):
            say(f"wrote {written}")
    return account


def _file_of(one: Problem, out: Path | None) -> Path | None:
    return None if out is None else out / f"precision_{one.name}.json"


def _typical_s(extent: Extent, peers: Mapping[str, str]) -> float:
    kind = "whole" if extent.forms else "quick" if extent.methods else "part"
    solvers_s = _PEERS_S if peers and kind != "quick" else 0.0
    return _TYPICAL_S[kind] + solvers_s + _LONG_RUNS * extent.longest_run_s * bool(extent.drift)


class Left:
    """How long is left: what is typical, times how much longer than that it took until now."""

    def __init__(self, typical_s: Sequence[float]) -> None:
        self._typical_s, self._done = list(typical_s), 0
        self._began = time.perf_counter()

    def done(self) -> None:
        """One more is."""
        self._done += 1

    def __str__(self) -> str:
        took = time.perf_counter() - self._began
        factor = took / sum(self._typical_s[: self._done]) if self._done else 1.0
        left = factor * sum(self._typical_s[self._done :])
        machine = "" if self._done else " on two cores"
        return f"about {in_words(left)} for the {len(self._typical_s) - self._done} left{machine}"


def _account(
    parts: Mapping[str, Mapping[str, Any]], missing: Mapping[str, str], about: Mapping[str, Any]
) -> dict[str, Any]:
    rows = [row for part in parts.values() for row in part["rows"]]
    account = {
        "benchmark": "precision",
        "targets": list(TARGETS),
        "problems": {
            name: {**part["problem"], "leading": ahead(rows, name, part["problem"]["norm"])}
            for name, part in parts.items()
        },
        "rows": rows,
        "drift": [drift for part in parts.values() for drift in part["drift"]],
        "not_there": {**missing, **{k: v for p in parts.values() for k, v in p["missing"].items()}},
        "rules": rules({row["family"] for row in rows}),
        "provenance": {
            **about,
            "wall_s": sum(sum(part["problem"]["wall_s"].values()) for part in parts.values()),
        },
    }
    best = standings(account)
    return {
        **account,
        "best": best,
        "more_digits": more_digits(account),
        "over_problems": over_problems(best),
        "coverage": coverage(account),
    }


def _key(one: Problem, extent: Extent, about: Mapping[str, Any]) -> str:
    """Of all that a measurement depends on but the time of day."""
    said = {k: v for k, v in about.items() if k not in ("date", "load")}
    known = [one.name, one.simulation.spec_hash, one.simulation.end, asdict(extent), said]
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


def _read(file: Path | None, key: str) -> dict[str, Any] | None:
    """What was measured before, if with all the same."""
    if file is None or not file.is_file():
        return None
    try:
        part: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    except ValueError:
        return None
    if part.get("key") != key:
        return None
    say(f"{file}: measured {part['problem']['measured']['date']}; remove it to measure again")
    return part


def _measured(one: Problem, extent: Extent, peers: Mapping[str, str]) -> dict[str, Any]:
    """One problem's part of the account."""
    watch = {"reference": -time.perf_counter()}

    def next_is(what: str) -> None:
        now = time.perf_counter()
        last = list(watch)[-1]
        watch[last] = round(watch[last] + now, 1)
        watch[what] = -now

    measured = {"date": now_in_words(), "load": list(os.getloadavg())}
    compilers = _compilers(extent)
    missing: dict[str, str] = {}
    say(f"{one.name}: reference")
    reference = one.reference
    next_is("compile")
    set_up = _set_up(one, extent)
    contestants, refused = _scenes(one, compilers[0], extent)
    if POSITION not in reference.end:
        missing[f"errors of the position on {one.name}"] = "its body has a fixed point"
    if ATTITUDE not in reference.end:
        missing[f"errors of the attitude on {one.name}"] = "its bodies have none"
    if extent.methods:
        missing["other kernels, representations, algebras and scalars"] = "left out if quick"
    elif isinstance(one.conformal, str):
        missing[f"{one.name} in conformal algebra"] = one.conformal
    if isinstance(one.for_peers, str):
        missing[f"public solvers on {one.name}"] = one.for_peers
    else:
        given = one.generated.cpp if one.generated else ""
        contestants += solvers.contestants(one.name, compilers, peers, extent, missing, given)
    if extent.forms or len(compilers) > 1:
        ours = [c for c in contestants if c.is_ours and not c.label]
        uncounted = [replace(c, counted=None) for c in ours]
        first = [asdict(row) for row in _times(one, uncounted, replace(extent, rounds=0))]
        leading = leaders(first, one.name, one.norm)
        slow = too_slow_for_other_forms(contestants, first)
        refused += [_left_out(c, one) for c in slow]
        contestants = begun_where_they_do_not_fail([c for c in contestants if c not in slow], first)
        for compiler in compilers[1:]:
            contestants += _scenes(one, compiler, replace(extent, forms=False), leading)[0]
    next_is("time")
    rows = _times(one, contestants, extent)
    next_is("long_runs")
    if extent.drift and one.generated is not None and one.generated.timed:
        missing[f"long runs of public solvers on {one.name}"] = (
            "its equations hold the time, and theirs are short runs, each from t = 0"
        )
    long_runs = _long_runs(one, contestants, compilers[0], extent)
    next_is("end")
    del watch["end"]
    return {
        "problem": {
            "description": getattr(one.scene, "description", ""),
            "end_s": one.simulation.end,
            "reference": reference.source,
            "certificate": reference.certificate,
            "witnesses": [asdict(witness) for witness in reference.witnesses],
            "norm": one.norm,
            "public_solvers": _formulation(one),
            "goals": list(GOALS.get(one.name, ())),
            "set_up": set_up,
            "scene": one.simulation.spec_hash,
            "measured": measured,
            "wall_s": watch,
        },
        "rows": [asdict(row) for row in refused + rows],
        "drift": [asdict(drift) for drift in long_runs],
        "missing": missing,
    }


def _formulation(one: Problem) -> str:
    """What public solvers integrate."""
    if isinstance(one.for_peers, str):
        return ""
    if one.generated is None:
        return "equations written by hand: quaternion and body rates, place and velocity if any"
    return f"{GIVEN}: {one.generated.about}"


def _long_runs(
    one: Problem, contestants: Sequence[Contestant], compiler: str, extent: Extent
) -> list[Drift]:
    """The generated kernels in double, and peers beside them on another core; what would take too
    long takes fewer steps."""
    steps, longest_s = extent.drift, extent.longest_run_s
    if not steps:
        return []
    ours = [c for c in contestants if c.is_ours and not c.label and c.compiler == compiler]
    if not ours:
        return []
    simulation = one.simulation
    step = step_of(simulation)
    asked = solvers.long_runs(contestants, compiler, step, steps, SAMPLES, longest_s / 2)
    if one.generated is not None and one.generated.timed:
        asked = []
    first, *_ = ours
    of = Conserved(one, SceneLibrary(Path(first.said["library"])), first.name)
    found: list[Drift] = []
    with ThreadPoolExecutor(1) as pool:
        job = {"problem": one.for_peers if asked else None, "long_runs": asked}
        theirs = pool.submit(solvers.timed, job, max(solvers.SILENT_S, 12 * longest_s))
        for c in ours:
            library = SceneLibrary(Path(c.said["library"]))
            trial, _, _, seconds = of_method(simulation, library, c.name, 1000)
            affordable = min(steps, int(longest_s / max(seconds / max(trial, 1), 1e-9)))
            say(f"{one.name}: {affordable:,} steps of {c.name}")
            done, every, rows, seconds = of_method(simulation, library, c.name, affordable)
            failure = None if done == affordable else f"stopped after {done:,} steps"
            about = Drift(
                one.name, c.name, c.family, done, step, "", None, None, None, seconds,
                failure=failure,
            )  # fmt: skip
            found += drifts(about, of, every, every * Fraction(step), rows)
        answers = theirs.result()
    for (index, _), said in sorted(answers.items()):
        run = asked[index]
        states = said.get("states", ())
        rows = of.rows(states)
        exploded = "what comes next is too large to read" if len(rows) < len(states) else None
        every = said.get("every", run["every"])
        about = Drift(
            problem=one.name,
            contestant=run["name"],
            family=run["family"],
            steps=every * len(rows),
            step=step,
            quantity="",
            largest=None,
            exponent=None,
            exponent_error=None,
            seconds=said.get("seconds", 0.0),
            failure=said["failure"] or exploded,
        )
        found += drifts(about, of, every, Fraction(every * step), rows)
    return found


def _compilers(extent: Extent) -> list[str]:
    if os.environ.get("CXX"):
        return [" ".join(find_compiler(default_cache()).command)]
    found = []
    for compiler in extent.compilers:
        try:
            with environment(CXX=compiler):
                find_compiler(default_cache())
        except ToolError:
            continue
        found.append(compiler)
    if not found:
        find_compiler(default_cache())  # says what to install
    return found


def _scenes(
    one: Problem, compiler: str, extent: Extent, only: Sequence[str] | None = None
) -> tuple[list[Contestant], list[Row]]:
    """Our methods on a problem, or `only` these, compiled; and those that could not be."""
    choices = [
        (OWN, m) for m in one.simulation.methods if not extent.methods or m in extent.methods
    ]
    if extent.forms:
        for form, methods in _FORMS:
            simulation = _in_form(one, form)
            offered = simulation.offered(form.kernels, form.representation) if simulation else {}
            choices += [(form, m) for m in methods if m in offered]
    if only is not None:
        choices = [choice for choice in choices if choice[-1] in only]
    together: dict[Form, list[str]] = {}
    for form, method in choices:
        alike = form.scalar == "double" or method.startswith(_THE_SAME_WORK)
        if extent.counted and form.representation == "ga" and alike:
            together.setdefault(replace(form, scalar=COUNTED), []).append(method)
        together.setdefault(form, []).append(method)
    wanted = [(form, tuple(dict.fromkeys(methods))) for form, methods in together.items()]
    wanted.sort(key=lambda each: (each[0].scalar == COUNTED, len(each[1])), reverse=True)
    progress = Progress(
        f"{one.name}: compiling with {compiler}, libraries: {len(wanted)}", len(wanted)
    )

    def compiled(each: tuple[Form, tuple[str, ...]]) -> Mapping[str, Compiled | str]:
        simulation = _in_form(one, each[0])
        assert simulation is not None
        built = _together(simulation, *each)
        progress.add()
        return built

    cache = default_cache() / "precision" / one.name
    with environment(CXX=compiler, HAMOTOR_CACHE=str(cache)), ThreadPoolExecutor(2) as pool:
        found = dict(zip((form for form, _ in wanted), pool.map(compiled, wanted), strict=True))

    def contestant(form: Form, method: str) -> Contestant | Row:
        simulation, built = _in_form(one, form), found[form][method]
        assert simulation is not None
        counted = found.get(replace(form, scalar=COUNTED), {}).get(method)
        if form.algebra:
            form = replace(form, algebra=str(one.conformal.scene.algebra))  # type: ignore[union-attr]
        if isinstance(built, str):
            return Row(
                one.name, method, "hamotor", form.label, compiler, form.kernels,
                form.representation, form.algebra or one.algebra, form.scalar, 0.0, "step",
                failure=built,
            )  # fmt: skip
        description = built.description
        if method in description.error_controlled:
            wide = wide_tolerances(description.digits)
            allowed = wide if description.is_wide else tolerances(extent, 1e-18)
            (whole,) = step_ladder(simulation.end, inf)
            settings = [{**whole, "tolerance": tolerance} for tolerance in allowed]
        else:
            rungs = extent.rungs**2 if description.is_wide else extent.rungs
            settings = step_ladder(simulation.end, rungs)
        return Contestant(
            problem=one.name,
            name=method,
            family="hamotor",
            compiler=compiler,
            kind="scene",
            settings=settings,
            longest_s=_WIDE_S if description.is_wide else extent.longest_s,
            form=form,
            said={
                "library": str(built.build.library),
                "method": method,
                "state": [float(x) for x in simulation.state],
                "digits": " ".join(map(in_decimals, simulation.exact_state))
                if description.is_wide
                else "",
                "columns": len(description.columns),
                "description": description,
            },
            counted=counted.library if isinstance(counted, Compiled) else None,
        )

    each = [contestant(*choice) for choice in choices]
    return (
        [c for c in each if isinstance(c, Contestant)],
        [r for r in each if isinstance(r, Row)],
    )


def _together(
    simulation: Simulation, form: Form, methods: tuple[str, ...]
) -> dict[str, Compiled | str]:
    """A library with all these methods but Taylor's series, which has one of its own for the flags
    it is compiled with alone; or why one cannot be compiled.

    One takes a fifth of the time that one for each does, and a method's steps as long as in a
    library of its own, to 4 %.  What is only counted is compiled for less time: what -O1 folds is
    what -O3 does, to two operations a step.
    """
    others = tuple(m for m in methods if m != "taylor")
    if others != methods and others:
        parts = (others, ("taylor",))
        return {m: c for part in parts for m, c in _together(simulation, form, part).items()}
    try:
        built = simulation.compile(
            scalar=form.scalar,
            kernels=form.kernels,
            representation=form.representation,
            method=methods,
            extra_flags=("-O1",) if form.scalar == COUNTED else (),
        )
    except HamotorError as refusal:
        if len(methods) == 1:
            return {methods[0]: " ".join(map(str.strip, str(refusal).splitlines()[:2]))}
        return {m: c for m in methods for c in _together(simulation, form, (m,)).values()}
    return dict.fromkeys(methods, built)


def _in_form(one: Problem, form: Form) -> Simulation | None:
    if not form.algebra:
        return one.wide if Scalar(form.scalar).is_wide else one.simulation
    return None if isinstance(one.conformal, str) else one.conformal.simulation


def _times(one: Problem, contestants: Sequence[Contestant], extent: Extent) -> list[Row]:
    """Every setting of every contestant, timed in one process."""
    job = {
        "rounds": extent.rounds,
        "enough_s": extent.enough_s,
        "loop": solvers.compiled(_compilers(extent)[0], "loop.cpp"),
        "problem": None if isinstance(one.for_peers, str) else one.for_peers,
        "contestants": [
            {
                "kind": c.kind,
                "settings": list(c.settings),
                "longest_s": c.longest_s,
                **{key: value for key, value in c.said.items() if key != "description"},
            }
            for c in contestants
        ],
    }
    ours = ((c.said["library"], c.name) for c in contestants if c.is_ours and not c.label)
    observed_by = next(ours, ("", ""))

    def worth(answers: solvers.Answers) -> list[solvers.At]:
        places = sorted(answers)
        uncounted = [replace(c, counted=None) for c in contestants]
        seen = [
            _row(uncounted[c], setting, answers[c, setting], one, observed_by)
            for c, setting in places
        ]
        chosen = [
            k
            for k in worth_repeating(seen, one.norm)
            if answers[places[k]]["best_s"] < _HOPELESS * contestants[places[k][0]].longest_s
        ]
        say(f"{one.name}: {len(chosen)} of {len(seen)} settings are worth repeating")
        return [places[k] for k in chosen]

    progress = Progress(f"{one.name}: timing {len(contestants)} contestants", 1)
    first = _FIRST_LOOK if extent.rounds else 1.0

    def tell(round_: int, contestant: int) -> None:
        done = contestant / len(contestants)
        if not round_:
            progress.at(first * done, f"first look at {contestants[contestant].name}")
        else:
            done = (round_ - 1 + done) / extent.rounds
            progress.at(first + (1 - first) * done, f"round {round_} of {extent.rounds}")

    answers = solvers.timed(job, worth=worth, progress=tell)
    return [
        _row(contestants[contestant], setting, said, one, observed_by)
        for (contestant, setting), said in sorted(answers.items())
    ]


def begun_where_they_do_not_fail(
    contestants: Sequence[Contestant], first: Sequence[Mapping[str, Any]]
) -> list[Contestant]:
    """Other forms of methods without the steps that are longer than any at which generated kernels
    in double did not fail: iterations that do not converge take seconds in quad."""
    longest: dict[str, float] = {}
    for row in first:
        if row["failure"] is None:
            who = row["contestant"]
            longest[who] = max(longest.get(who, 0.0), row["setting"])
    return [
        replace(c, settings=[s for s in c.settings if s["step"] <= longest[c.name]])
        if c.is_ours and c.label and c.name in longest and not c.settings[0]["tolerance"]
        else c
        for c in contestants
    ]


def too_slow_for_other_forms(
    contestants: Sequence[Contestant], first: Sequence[Mapping[str, Any]]
) -> list[Contestant]:
    """Other forms of methods whose generated kernels in double took longer at every setting than
    may be: in quad each would take half a minute, to say no more than that."""
    least: dict[str, float] = {}
    for row in first:
        if row["failure"] is None:
            who = row["contestant"]
            least[who] = min(least.get(who, float("inf")), row["best_us"])
    return [
        c
        for c in contestants
        if c.is_ours and c.label and least.get(c.name, 0.0) > 1e6 * c.longest_s
    ]


def _left_out(c: Contestant, one: Problem) -> Row:
    form, setting = c.form, c.settings[0]
    return Row(
        one.name, c.name, "hamotor", c.label, c.compiler, form.kernels, form.representation,
        form.algebra or one.algebra, form.scalar, setting["tolerance"] or setting["step"],
        "tolerance" if setting["tolerance"] else "step",
        failure="left out: generated kernels in double take longer than"
        f" {1e3 * c.longest_s:g} ms at every setting",
    )  # fmt: skip


_FIRST_LOOK: Final = 0.7
"""Its share of the time."""
_HOPELESS: Final = 10.0
_COARSE: Final = 1e-2


def worth_repeating(rows: Sequence[Row], quantity: str) -> list[int]:
    """Indices of the rows that take at most ten times the least time to an error as small, ours
    among ours but for closed forms, public solvers among themselves; none of errors above 0.01."""
    exact = {m.name for m in METHODS if m.order == 0}
    found: list[int] = []
    for ours in (True, False):
        here = [
            (row.errors[quantity], row.best_us, index)
            for index, row in enumerate(rows)
            if (row.family == "hamotor") == ours
            and row.failure is None
            and row.best_us is not None
            and row.errors.get(quantity, 1.0) <= _COARSE
        ]
        least = float("inf")
        for _, us, index in sorted(here):
            if rows[index].contestant not in exact:
                least = min(least, us)
            if us <= _HOPELESS * least:
                found.append(index)
    return sorted(found)


def _row(
    contestant: Contestant,
    index: int,
    said: Mapping[str, Any],
    one: Problem,
    observed_by: tuple[str, str],
) -> Row:
    """`observed_by`: a library of the scene's and its method, which read the states of others."""
    setting = contestant.settings[index]
    what = "tolerance"
    if contestant.is_ours:
        value = setting["tolerance"]
        if not value:
            value, what = setting["step"], "step"
    elif contestant.fixed_steps:
        value, what = one.simulation.end / setting, "step"
    else:
        value = setting
    form = contestant.form
    row = Row(
        problem=contestant.problem,
        contestant=contestant.name,
        family=contestant.family,
        form=contestant.label,
        compiler=contestant.compiler,
        kernels=form.kernels if form.representation == "ga" else "",
        representation=form.representation,
        algebra=(form.algebra or one.algebra) if form.representation == "ga" else "",
        scalar=form.scalar,
        setting=value,
        setting_is=what,
        failure=said.get("failure"),
    )
    if row.failure is not None:
        return row
    if not all(isfinite(float(x)) for x in said["final"]):
        return replace(row, failure="not finite at the end")
    with np.errstate(all="ignore"):  # a run that exploded may leave what a double holds
        there = one.reference.end
        if contestant.said.get("digits"):
            there = one.reference.exact
            found = endpoint.of_row(contestant.said["description"], said["final"], Fraction)
        elif contestant.is_ours:
            found = endpoint.of_row(contestant.said["description"], said["final"])
        else:
            try:
                found = one.end_of_peer(said["final"], observed_by)
            except OverflowError:
                return replace(row, failure="its end is too large to read")
        errors = endpoint.errors(found, there)
    work = None
    if contestant.counted is not None:
        state = contestant.said["state"]
        work = work_of(contestant.counted, contestant.name, state, setting, said["steps"])
    return replace(
        row,
        best_us=said["best_s"] * 1e6,
        median_us=said["median_s"] * 1e6,
        worst_us=said["worst_s"] * 1e6,
        cpu_us=said["processor_s"] * 1e6,
        runs=said["runs"],
        steps=said["steps"],
        evaluations=work.evaluations if work else said["evaluations"],
        operations=work.operations if work else None,
        per_step=work.per_step if work else {},
        set_up_s=said["set_up_s"],
        errors={name: e for name, e in errors.items() if isfinite(e)},
        failure=None if all(map(isfinite, errors.values())) else "an error is not finite",
    )


def _set_up(one: Problem, extent: Extent) -> dict[str, float]:
    """What comes before the first step, with nothing in any cache, s."""
    method = next(iter(one.simulation.methods))
    compiler = _compilers(extent)[0]
    with (
        tempfile.TemporaryDirectory() as folder,
        environment(HAMOTOR_CACHE=folder, CXX=compiler),
    ):
        fresh = load(one.text) if one.text else one.simulation  # which remembers no text
        built = fresh.compile(method=method)
        end = one.simulation.end
        began = time.perf_counter()
        with built.library.start(method, step=end * 2.0**-20, state=one.simulation.state) as live:
            live.advance(1, 0, None)
            first_step_s = time.perf_counter() - began
    return {
        "generate_s": built.generate_s,
        "compile_s": built.build.compile_s,
        "first_step_us": first_step_s * 1e6,
    }


def _provenance(
    compilers: Sequence[str], peers: Mapping[str, str], extent: Extent
) -> dict[str, Any]:
    versions = {}
    for compiler in compilers:
        with environment(CXX=compiler):
            versions[compiler] = find_compiler(default_cache()).version
    files = sorted(file for file in solvers.BENCH.iterdir() if file.is_file())
    files.append(Path(equations.__file__))
    return provenance(
        bench=hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).hexdigest(),
        compilers=versions,
        flags=" ".join(flags_for(os.uname().machine)),
        peers=dict(peers),
        methods=len(METHODS),
        rounds=extent.rounds,
        counted=extent.counted,
        drift=extent.drift,
    )
