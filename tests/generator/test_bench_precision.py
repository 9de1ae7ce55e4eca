"""The benchmark of precision: what it compares is the same motion, and what it counts is met."""

from __future__ import annotations

import gzip
import json
import re
import subprocess
import sys
from base64 import b64decode
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.bench.precision import peers, stopwatch

from hamotor.bench import endpoint, precision, problems, readme, solvers
from hamotor.bench.account import Progress
from hamotor.bench.contest import Contestant, Extent, Form, Row
from hamotor.bench.drift import Conserved, _growth
from hamotor.bench.endpoint import ATTITUDE, ENERGY, POSITION
from hamotor.bench.precision import measure
from hamotor.bench.precision_report import best, coverage, draw, more_digits, over_problems, table
from hamotor.bench.problems import (
    REFERENCES,
    Problem,
    Reference,
    default_problems,
    own_problems,
    problem,
)
from hamotor.bench.summary import summary
from hamotor.errors import UsageError
from hamotor.run.library import SceneLibrary
from hamotor.scene import bundled_scenes


@pytest.mark.parametrize("name", own_problems())
def test_public_solvers_are_given_the_motion_of_the_reference(name: str) -> None:
    given = problem(name).for_peers
    assert not isinstance(given, str)
    one = peers.Problem(given)
    first = json.loads((REFERENCES / f"{name}.json").read_text(encoding="utf-8"))["checkpoints"][0]
    state = np.array(one.state)
    steps = int(first["t"] * 16 * max(10.0, *abs(state[4:7])))  # a sixteenth of a radian each
    h = first["t"] / steps

    def rate(x: Any) -> Any:
        return np.array(peers.rates(one, x.tolist()))

    for _ in range(steps):
        k1 = rate(state)
        k2 = rate(state + h / 2 * k1)
        k3 = rate(state + h / 2 * k2)
        k4 = rate(state + h * k3)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    expected = [*first["q"], *first["w"], *first.get("x", ()), *first.get("v", ())]
    assert state == pytest.approx([float(x) for x in expected], abs=1e-4)


@pytest.mark.parametrize("name", own_problems())
def test_the_energy_of_a_scene_is_that_of_its_reference(name: str) -> None:
    one = problem(name)
    state = one.for_peers["state"]  # type: ignore[index]
    start = endpoint.of_quaternion(one.scene, state)
    assert endpoint.errors(start, one.reference.end)[ENERGY] < 1e-14 * abs(
        float(one.reference.end[ENERGY][0, 0])
    )
    assert one.scene.initial_energy[0] + one.scene.initial_energy[1] == pytest.approx(
        float(start[ENERGY][0, 0]), rel=1e-14
    )


def test_an_error_is_an_angle_and_a_distance() -> None:
    scene = problem("P4").scene
    turned = [np.cos(5e-9), 0, 0, np.sin(5e-9), 0, 0, 0, 3, 4, 0, 0, 0, 0]
    still = [1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    here, there = (endpoint.of_quaternion(scene, state) for state in (turned, still))
    found = endpoint.errors(here, there)
    assert found[ATTITUDE] == pytest.approx(1e-8, rel=1e-6)
    assert found[POSITION] == pytest.approx(5)


def _rows(errors: Sequence[float], microseconds: Sequence[float]) -> list[Mapping[str, Any]]:
    return [
        {
            "problem": "p", "contestant": "m", "family": "hamotor", "form": "", "compiler": "",
            "failure": None, "errors": {ATTITUDE: e},
            **{f"{of}_us": t for of in ("best", "median", "worst", "cpu")},
        }
        for e, t in zip(errors, microseconds, strict=True)
    ]  # fmt: skip


def test_a_diagram_without_a_point_is_empty(tmp_path: Path) -> None:
    problem_said = {"norm": ATTITUDE, "description": "nothing turns"}
    account = {"problems": {"p": problem_said}, "rows": _rows([0.0] * 4, [1.0] * 4), "targets": [1]}
    (file,) = draw(account, "p", [tmp_path / "p.png"])
    assert file.is_file()


def test_translations_have_no_attitude() -> None:
    assert endpoint.turns(["s", "e12"])
    assert endpoint.turns(["s", "e23", "e31", "e12", "e01", "e02", "e03", "e0123"])
    assert not endpoint.turns(["s", "e01", "e02", "e03"])
    assert not endpoint.turns(["s", "e1i", "e2i", "e0i"])


def test_a_setting_counts_only_if_the_next_two_finer_ones_meet_the_target() -> None:
    rows = _rows([1e-7, 1e-3, 1e-5, 1e-7, 1e-8], [1, 2, 4, 8, 16])
    found = best(rows, "p", 1e-4, ours=True)
    assert found is not None
    assert found.microseconds == 4
    assert best(rows, "p", 1e-6, ours=True) is None
    assert best(rows, "p", 1e-4, ours=False) is None


@pytest.mark.long
def test_a_reference_in_two_precisions_has_25_digits() -> None:
    reference = problem("planar").reference
    found = re.search(
        r"differs by more than (\S+) \(taylor in quad.*, (\S+) \(rk87", reference.certificate
    )
    assert found is not None
    assert float(found[1]) < 1e-25
    assert float(found[2]) < 1e-15


@pytest.mark.slow
def test_a_methods_settings_are_timed_and_reported_from_coarse_to_fine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation = replace(problem("planar").simulation, methods={"splitting8": 8})
    one = Problem("planar", simulation)
    library = simulation.compile(method="splitting8").library
    with library.start("splitting8", step=simulation.end / 4000, state=simulation.state) as live:
        live.advance(4000, 0, None)
        end = endpoint.of_row(library.description, live.observe(), Fraction)
    vars(one)["reference"] = Reference(end, "splitting8", "none")  # one in quad takes a minute
    extent = Extent(
        2, 2.0, 0.001, 0.01, forms=False, compilers=("g++",), drift=20_000, counted=True
    )
    account = measure([one], extent, {}, {}, tmp_path)
    assert account["problems"]["planar"]["public_solvers"].startswith("equations generated")
    for method in simulation.methods:
        rows = [r for r in account["rows"] if r["contestant"] == method]
        steps = [row["setting"] for row in rows]
        assert steps == sorted(steps, reverse=True)
        errors = [row["errors"][POSITION] for row in rows if row["failure"] is None]
        assert min(errors) < 1e-3 * max(errors)
        assert all(0 < row["best_us"] <= row["median_us"] <= row["worst_us"] for row in rows)
        assert all(row["cpu_us"] < 1e6 for row in rows)
        finest = rows[-1]
        assert 16 <= finest["evaluations"] / finest["steps"] <= 18
        assert finest["operations"] / finest["steps"] > 17 * finest["per_step"]["roots"]
        assert finest["operations"] == pytest.approx(
            finest["steps"] * sum(finest["per_step"].values()), rel=1e-6
        )
    (energy,) = (row for row in account["drift"] if row["quantity"] == "energy")
    assert energy["steps"] == 20_000
    assert 0 < energy["largest"] < 1e-10
    assert "long runs" in table(account)
    page = (tmp_path / "precision.html").read_text(encoding="utf-8")
    assert not re.findall(r"(?:src|href)=|https?://(?!www\.w3\.org/2000/svg)", page)
    embedded = re.search(r'type="application/gzip">(.*?)</script>', page)
    assert embedded is not None
    written = json.loads((tmp_path / "precision.json").read_text(encoding="utf-8"))
    assert json.loads(gzip.decompress(b64decode(embedded[1]))) == written
    assert (tmp_path / "precision_planar.svg").is_file()

    def never(*_: Any) -> None:
        pytest.fail("measured again")

    # Cut after a problem, the same call goes on; the next problem's failure is a gap.
    monkeypatch.setattr(precision, "_measured", never)
    assert measure([one], extent, {}, {}, tmp_path)["rows"] == written["rows"]
    monkeypatch.setattr(precision, "_measured", _refused)
    both = measure([one, Problem("other", simulation)], extent, {}, {}, tmp_path)
    assert list(both["problems"]) == ["planar"]
    assert both["not_there"]["other"] == "no reference"
    with pytest.raises(UsageError, match="no reference"):
        measure([one], replace(extent, rounds=3), {}, {}, tmp_path)


@pytest.mark.slow
def test_a_long_run_of_rotations_alone_is_one_of_the_whole_body() -> None:
    one = problem("tumble")
    library = one.simulation.compile(method="splitting2").library
    assert not isinstance(one.for_peers, str)
    of = Conserved(one, library, "splitting2")
    (row,) = of.rows([one.for_peers["state"]])
    assert row == pytest.approx(of.start(), abs=1e-15)


@pytest.mark.slow
def test_quad_is_measured_in_all_its_digits(monkeypatch: pytest.MonkeyPatch) -> None:
    one = problem("planar")
    monkeypatch.setattr(precision, "_FORMS", ((Form(scalar="quad"), ("splitting10",)),))
    extent = Extent(0, 2.0, 0.01, 0.01, forms=True, compilers=("g++",), methods=("none",))
    ((wide,), _) = precision._scenes(one, "g++", extent)
    library = SceneLibrary(Path(wide.said["library"]))
    step = Fraction(one.simulation.end) / 16384
    with library.start("splitting10", step=step, state=one.simulation.exact_state) as live:
        live.advance(16384, 0, None)
        end = endpoint.of_row(library.description, live.observe_text(), Fraction)
    vars(one)["reference"] = Reference(end, "splitting10", "none")
    settings = [s for s in wide.settings if s["calls"] in (1024, 4096)]
    rows = precision._times(one, [replace(wide, settings=settings)], extent)
    coarse, fine = (row.errors[POSITION] for row in rows)
    assert fine < 1e-18
    assert 4**9.9 < coarse / fine < 4**10.1


def _refused(*_: Any) -> None:
    raise UsageError("no reference")


def test_a_solver_that_hangs_or_crashes_is_a_row_and_the_rest_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    script = """
import json, os, sys, time
skipped = dict(json.load(open(sys.argv[1]))["skipped"])
for index in range(3):
    for setting in range(skipped.get(index, 2)):
        at = {"index": index, "setting": setting}
        print(json.dumps(at), flush=True)
        if (index, setting) == (0, 1):
            time.sleep(60)
        if (index, setting) == (1, 0):
            os.abort()
        print(json.dumps({**at, "final": [1.0]}), flush=True)
"""

    def stopwatch(file: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            (sys.executable, "-c", script, file), stdout=subprocess.PIPE, text=True
        )

    monkeypatch.setattr(solvers, "stopwatch", stopwatch)
    answers = solvers.timed({}, silent_s=1.0)
    assert answers.keys() == {(0, 0), (0, 1), (1, 0), (2, 0), (2, 1)}
    assert "timed out" in answers[0, 1]["failure"]
    assert answers[1, 0]["failure"].endswith("ended with -6")
    assert all("final" in answers[at] for at in ((0, 0), (2, 0), (2, 1)))


def test_the_readme_says_what_the_account_does() -> None:
    def ladder(problem: str, who: str, family: str, microseconds: float) -> list[dict[str, Any]]:
        rows = _rows([1e-5] * 3, [microseconds] * 3)
        return [{**row, "problem": problem, "contestant": who, "family": family} for row in rows]

    rows = []
    for name in readme.SHOWN:
        rows += ladder(name, "taylor", "hamotor", 10.0)
        rows += ladder(name, "splitting4", "hamotor", 80.0)
        rows += ladder(name, "gauss6", "hamotor", 30.0)
        rows += ladder(name, "heyoka", "heyoka", 20.0)
    rows += ladder("P1", "closed_form", "hamotor", 2.0)
    wide = [{**row, "form": "quad", "compiler": "g++"} for row in _rows([1e-21] * 3, [4e4] * 3)]
    rows += [{**row, "problem": "P1", "contestant": "taylor"} for row in wide]
    said = {"norm": ATTITUDE, "end_s": 5.0, "goals": []}
    account: dict[str, Any] = {
        "targets": [1e-4, 1e-6],
        "problems": dict.fromkeys(readme.SHOWN, said),
        "rows": rows,
        "provenance": {"processor": "one"},
    }
    text = readme.text({**account, "more_digits": more_digits(account)})
    assert "| spring, 5 s | 10 / 20 | none / none |" in text
    assert "| free, 5 s | 2 / 20 | none / none |" in text
    assert "Without the closed form the free body takes us 0.5 times as long" in text
    assert "splittings take 4 times as long as the fastest public solver" in text
    assert "Gauss collocation takes 3 to 15 times as long as the fastest of ours" in text
    assert text.endswith(
        "free 1e-16 in 40 ms (taylor in quad) and 1e-20 in 40 ms (taylor in quad)."
    )


def test_what_is_no_problem_is_told_the_benchmarks_own() -> None:
    with pytest.raises(UsageError, match=r"benchmark's own problems are HVa, P1, .*P4"):
        problem("P5")


@pytest.mark.parametrize("name", own_problems())
def test_a_reference_is_confirmed_by_other_methods_and_precisions(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: Any) -> None:
        pytest.fail("what is kept is of another scene: python -m hamotor.bench.witnesses")

    monkeypatch.setattr(problems, "_end_of", never)
    witnesses = problem(name).reference.witnesses
    assert {w.method for w in witnesses} in ({"taylor", "gauss16"}, {"taylor", "closed_form"})
    assert {"mpfr50", "quad"} <= {w.scalar for w in witnesses}
    assert max(w.apart for w in witnesses) < 1e-25
    assert next(w.apart for w in witnesses if w.scalar == "mpfr50") < 1e-32


@pytest.mark.long
def test_a_reference_is_confirmed_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(problems, "WITNESSES", tmp_path)
    monkeypatch.setenv("HAMOTOR_CACHE", str(tmp_path))
    assert max(w.apart for w in problem("HVa").reference.witnesses) < 1e-25


def test_what_is_hopelessly_slow_is_not_repeated() -> None:
    def row(who: str, family: str, error: float, us: float) -> Row:
        return Row(
            "p", who, family, "", "", "", "", "", "double", 0.0, "step",
            best_us=us, errors={ATTITUDE: error},
        )  # fmt: skip

    rows = [
        row("taylor", "hamotor", 1e-6, 10),
        row("gauss8", "hamotor", 1e-6, 99),
        row("gauss8", "hamotor", 1e-5, 101),
        row("gauss8", "hamotor", 1e-7, 101),
        row("closed_form", "hamotor", 1e-12, 1),
        row("heyoka", "heyoka", 1e-6, 1000),
        row("SciPy", "SciPy", 1e-6, 20_000),
        row("rk4", "hamotor", 0.1, 1),
        replace(row("rk4", "hamotor", 0.1, 1), failure="not finite"),
    ]
    assert precision.worth_repeating(rows, ATTITUDE) == [0, 1, 3, 4, 5]


def test_other_forms_begin_where_a_method_does_not_fail() -> None:
    settings = [{"step": 1 / 2**k, "tolerance": 0.0} for k in range(4)]
    quad = Contestant(
        "p", "gauss8", "hamotor", "g++", "scene", settings, 1.0, Form(scalar="quad")
    )  # fmt: skip
    own = replace(quad, form=Form())
    first = [{"contestant": "gauss8", "setting": 0.5, "failure": None}]
    first += [{"contestant": "gauss8", "setting": 1.0, "failure": "not finite"}]
    found = precision.begun_where_they_do_not_fail([own, quad], first)
    assert found == [own, replace(quad, settings=settings[1:])]
    slow = [{"contestant": "gauss8", "best_us": us, "failure": None} for us in (3e6, 1.1e6)]
    assert precision.too_slow_for_other_forms([own, quad], slow) == [quad]
    slow[1]["best_us"] = 0.9e6
    assert not precision.too_slow_for_other_forms([own, quad], slow)


def test_of_each_structure_in_each_algebra_one_problem_is_measured_in_all_forms() -> None:
    default = {name.partition("@")[0] for name in default_problems()}
    assert default == {*own_problems(), *(name for name, _ in bundled_scenes())}
    some = [problem(name) for name in ("P1", "P3", "heavy_top", "dzhanibekov", "tumble")]
    assert precision.alike_to(some) == {"heavy_top": "P3", "tumble": "dzhanibekov"}
    said = str(precision.Left([130.0, 50.0]))
    assert said == "about 3 min for the 2 left on two cores"


def test_what_is_alike_is_measured_in_one_form(monkeypatch: pytest.MonkeyPatch) -> None:
    extents: dict[str, Extent] = {}

    def measured(one: Problem, extent: Extent, _: Mapping[str, str]) -> dict[str, Any]:
        extents[one.name] = extent
        said = {"norm": ATTITUDE, "goals": [], "wall_s": {"time": 1.0}}
        return {"problem": said, "rows": [], "drift": [], "missing": {}}

    monkeypatch.setattr(precision, "_measured", measured)
    some = [problem(name) for name in ("P3", "P3b+", "heavy_top")]
    account = measure(some, precision.FULL, {}, {}, None, precision.alike_to(some))
    assert [extents[one.name].forms for one in some] == [True, False, False]
    assert [extents[one.name].counted for one in some] == [True, True, False]
    assert [len(extents[one.name].compilers) for one in some] == [2, 2, 1]
    gaps = " ".join(account["not_there"].values())
    assert "those of P3, which has them; bench precision heavy_top measures them here" in gaps


def test_a_problem_may_end_earlier() -> None:
    cut = problem("P4@1.5")
    assert (cut.name, cut.simulation.end) == ("P4", 1.5)
    assert cut.for_peers["end"] == 1.5  # type: ignore[index]
    assert not isinstance(cut.conformal, str)
    assert cut.conformal.simulation.end == 1.5
    with pytest.raises(UsageError, match="the end, in seconds"):
        problem("P4@soon")


def test_what_had_to_wait_for_the_processor_is_not_slow() -> None:
    class Timed:
        set_up_s = 0.0

        def run(self, _: int) -> peers.Result:
            watch = peers.Watch()
            watch.seconds, watch.processor = [0.03], [0.001]
            return peers.Result(watch, [0.0], 1, 1)

    entry = stopwatch.Entry({"index": 0, "setting": 0}, Timed())
    entry.run()
    assert entry.was_disturbed
    assert entry.needs_s == 0.001


def test_what_there_is_is_counted_by_problem() -> None:
    rows = [
        {
            "problem": "p", "family": "hamotor", "kernels": "generated", "representation": "ga",
            "algebra": "pga3", "scalar": "double", "errors": {ATTITUDE: 1e-3}, "failure": None,
            "best_us": 1.0, "cpu_us": 1.0, "steps": 1, "evaluations": 1, "operations": None,
        }
    ] * 2  # fmt: skip
    account = {"problems": ["p", "q"], "rows": rows, "drift": []}
    found = {(line["what"], line["value"]): line["rows"] for line in coverage(account)}
    assert found["kernels", "generated"] == {"p": 2, "q": 0}
    assert found["scalar", "quad"] == {"p": 0, "q": 0}
    assert found["error", ATTITUDE]["p"] == found["cost", "steps"]["p"] == 2
    assert found["cost", "operations"] == {"p": 0, "q": 0}


def test_progress_says_how_long_is_left(capsys: pytest.CaptureFixture[str]) -> None:
    now = iter([0.0, 1.0, 20.0, 40.0])
    progress = Progress("P1: compiling", 4, lambda: next(now))
    progress.add()
    progress.add()
    progress.at(4)
    assert capsys.readouterr().err.splitlines() == [
        "P1: compiling",
        "P1: compiling: 50%, about 20 s left",
    ]


def test_over_problems_the_worst_is_named() -> None:
    rows = [
        {"problem": name, "target": 1e-4, "ours": {}, "peer": {}, "ratio": ratio}
        for name, ratio in (("a", 3.0), ("b", 0.5), ("c", 2.0))
    ]
    (found,) = over_problems(rows)
    assert (found["median"], found["worst"], found["worst_on"]) == (2.0, 0.5, "b")


def test_growth_is_the_exponent_of_the_largest_error_so_far() -> None:
    counts = np.arange(1.0, 1001) * 100
    exponent, doubt = _growth(counts, 1e-16 * counts**0.5)
    assert exponent == pytest.approx(0.5)
    assert doubt == pytest.approx(0, abs=1e-9)
    exponent, _ = _growth(counts, np.full(1000, 1e-16))
    assert exponent == pytest.approx(0, abs=1e-12)
    assert _growth(counts, np.zeros(1000)) == (None, None)


def test_the_summary_says_what_a_kernel_and_a_digit_cost() -> None:
    kernel = {
        "mode": "latency", "scalar": "double", "operation": "motor * motor", "compiler": "g++",
        "max_relative_error": 1e-16,
    }  # fmt: skip
    kernels = {
        "rows": [
            {**kernel, "contestant": "generated", "ns": 3.0},
            {**kernel, "contestant": "Eigen quaternion + translation", "ns": 6.0},
        ]
    }
    precision = {
        "problems": {
            "p": {
                "description": "a body",
                "end_s": 1.0,
                "set_up": {"generate_s": 0.5, "compile_s": 4.0},
            }
        },
        "rows": _rows([1e-5, 1e-5, 1e-5], [7, 8, 9]),
        "not_there": {"heyoka": "not installed"},
    }
    text = summary(kernels, precision)
    assert re.search(r"motor \* motor +3\.0 ns +6\.0 ns +0\.50", text)
    assert re.search(r"1e-04 rad +7 µs  m ", text)
    assert "heyoka: not installed" in text
    assert "0.5 s to generate, 4.0 s to compile" in text


def test_the_problems_are_named_as_their_references() -> None:
    assert own_problems() == sorted(Path(file).stem for file in REFERENCES.glob("*.json"))


@pytest.mark.slow
def test_public_solvers_in_cpp_end_where_the_reference_does() -> None:
    gaps: dict[str, str] = {}
    there = solvers.libraries(("g++",), solvers.peers_here(gaps), gaps)
    for _, family, library, names in there:
        for name in ("P1", "P3", "P4"):
            given = problem(name).for_peers
            assert not isinstance(given, str)
            for solver in names:
                peer = peers.Compiled(peers.Problem(given), 1e-11, library=library, solver=solver)
                result = peer.run(1)
                end = endpoint.of_quaternion(problem(name).scene, result.state)
                errors = endpoint.errors(end, problem(name).reference.end)
                assert errors[ATTITUDE] < 1e-4, (family, solver, name)
                assert result.evaluations is not None
                assert result.steps is not None
                assert result.evaluations > result.steps > 10
                assert 0 < result.processor[0] < 10
    assert {family for _, family, _, _ in there} | gaps.keys() >= {"odeint", "SUNDIALS"}


def test_a_scene_in_conformal_algebra_is_the_same_motion() -> None:
    twin = problem("P4").conformal
    assert not isinstance(twin, str)
    assert twin.scene.algebra == "cga3"
    own = problem("P4").simulation
    start, other = own.state, twin.simulation.state
    # T = 1 - ½ t e_i∧e∞ has the translation of 1 - ½ t e0∧e_i, with e0 → -e∞.
    assert other[8:] == pytest.approx(start[8:], abs=1e-15)
    assert other[:4] == pytest.approx(start[:4], abs=1e-15)
    assert "point fixed" in str(problem("P3").conformal)


def test_peers_that_are_not_there_are_gaps_with_their_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(solvers, "_INCLUDES", ())
    gaps: dict[str, str] = {}
    here = solvers.peers_here(gaps)
    assert not here.keys() & {"boost", "sundials"}
    assert gaps["SUNDIALS"].endswith("apt-get install libsundials-dev")
    assert solvers.libraries(("g++",), here, gaps) == []


def test_every_family_says_how_it_is_tuned() -> None:
    gaps: dict[str, str] = {}
    every = dict.fromkeys((*solvers.peers_here(gaps), *peers.PACKAGES), "1")
    every.pop("boost", None)
    every.pop("sundials", None)
    extent = Extent(1, 2.0, 0.001, 0.01, forms=False, compilers=())
    found = solvers.contestants("P1", (), every, extent, gaps)
    assert {c.family for c in found} <= solvers.TUNED.keys()


@pytest.mark.skipif(not solvers.PEERS_PYTHON.is_file(), reason="./hamotor bench --with-peers")
@pytest.mark.parametrize("name", ["P1", "P3", "P4"])
def test_engines_of_rigid_bodies_are_given_the_same_motion(name: str) -> None:
    there = solvers.peers_here({})
    given = problem(name).for_peers
    assert not isinstance(given, str)
    first = json.loads((REFERENCES / f"{name}.json").read_text(encoding="utf-8"))["checkpoints"][0]
    end = float(first["t"])
    extent = Extent(0, 2.0, 1e9, 0.0, forms=False, compilers=())
    every = solvers.contestants(name, (), there, extent, {})
    found = [c for c in every if c.name.endswith("RK4") or c.family == "Bullet"]
    job = {
        "rounds": 0,
        "enough_s": 0.0,
        "problem": {**given, "end": end},
        "contestants": [
            {
                "kind": c.kind, "longest_s": 1e9, "settings": [round(end * 1000)], **c.said,
            }
            for c in found
        ],
    }  # fmt: skip
    rows = {found[index].name: row for (index, _), row in solvers.timed(job).items()}
    expected = endpoint.of_quaternion(
        problem(name).scene, [*first["q"], *first["w"], *first.get("x", ()), *first.get("v", ())]
    )
    for who, row in rows.items():
        here = endpoint.of_quaternion(problem(name).scene, row["final"])
        assert endpoint.errors(here, expected)[ATTITUDE] < (0.3 if who == "Bullet" else 1e-2), who


def test_settings_that_take_long_to_fail_are_not_all_tried() -> None:
    tried = []

    class Failing:
        set_up_s = 0.0

        def __init__(self, _: peers.Problem | None, setting: int) -> None:
            self.setting = setting

        def run(self, _: int) -> peers.Result:
            tried.append(self.setting)
            if self.setting < 7:
                raise peers.Refused("no")
            watch = peers.Watch()
            watch.seconds = watch.processor = [far * 2e-12]
            return peers.Result(watch, [0.0], 1, 1)

    far = 1
    contestant = {
        "kind": "failing", "settings": list(range(12)), "longest_s": 1e-12, "options": {}
    }  # fmt: skip
    job = {"problem": None, "contestants": [contestant], "rounds": 1, "enough_s": 1.0}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(peers, "MAKERS", {"failing": Failing})
        said = list(stopwatch.rows(job, lambda: [(0, 9)]))
    assert [row["setting"] for row in said if "failure" in row] == [0, 2, 5]
    assert list(dict.fromkeys(tried)) == [0, 2, 5, 9, 10]
    runs = [row["runs"] for row in said if row.get("setting") == 9 and "runs" in row]
    assert runs[-1] > runs[0]
    far = 3
    tried.clear()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(peers, "MAKERS", {"failing": Failing})
        list(stopwatch.rows({**job, "rounds": 0}, list))
    assert list(dict.fromkeys(tried)) == [0, 2, 5, 9]


def test_a_long_run_that_explodes_is_a_row_that_says_when() -> None:
    given = problem("P1").for_peers
    assert not isinstance(given, str)

    start = given["state"][4]

    class Exploding:
        """Numbers for two intervals."""

        def __init__(self, problem: peers.Problem, _: float) -> None:
            self.problem = problem

        def run(self, _: int) -> peers.Result:
            watch = peers.Watch()
            watch.time(lambda: None)
            done = self.problem.state[4] - start + 1
            state = [*self.problem.state[:4], self.problem.state[4] + 1, 0.0, 0.0]
            return peers.Result(watch, state if done < 2.5 else [float("nan")] * 7, 1, 1)

    asked = {
        "kind": "exploding", "options": {}, "tolerance": 0.0, "every": 5, "step": 0.1,
        "samples": 4, "longest_s": 1e9,
    }  # fmt: skip
    makers = {"exploding": Exploding}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(peers, "MAKERS", makers)
        said = stopwatch.long_run(asked, given)
    assert said["failure"] == "not finite after 10 steps"
    assert len(said["states"]) == 2
