"""The benchmark of hard cases: what it passes, and that it fails what breaks its promises."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hamotor.bench import bench_stability, stability
from hamotor.errors import UsageError
from hamotor.run.library import Vector
from hamotor.run.result import Run, RunFailed
from hamotor.run.simulation import Simulation, load
from hamotor.scene import METHODS, Promise
from hamotor.scene.methods import ALL


@pytest.fixture(scope="module")
def needle() -> stability.Case:
    return stability.hard_case("needle", ("rk4", "splitting2"))


@pytest.fixture(scope="module")
def reference(needle: stability.Case) -> stability.Reference:
    return stability.reference_of(needle)


def test_every_case_says_what_is_hard_and_has_a_step() -> None:
    assert len(stability.case_names()) >= 18
    for name in stability.case_names():
        case = load(stability.CASES / f"{name}.toml")
        assert case.step is not None
        assert case.read is not None
        assert case.read().description, name


def test_an_unknown_case_is_an_error() -> None:
    with pytest.raises(UsageError, match=r'no hard case "neddle".*Did you mean "needle"'):
        bench_stability(["neddle"])


def test_condition_and_reference(needle: stability.Case, reference: stability.Reference) -> None:
    # A needle turns about its axis as its momentum there says, divided by a millionth.
    assert 1e5 < reference.condition < 1e8
    assert reference.agreement < 1e-10
    pushed = needle.state + stability.perturbation(needle, 1e-3, 1)
    assert 0 < stability.distance(pushed, needle.state, needle) <= 1e-3


def test_numbers_are_compared_with_their_kind(needle: stability.Case) -> None:
    # In the order of the columns: rotor and translation of the motor, then angular and linear.
    far = needle.state.copy()
    far[4:7] = 1e8
    turned = far.copy()
    turned[1] += 1e-3
    assert stability.distance(turned, far, needle) == pytest.approx(1e-3)


def test_a_splitting_passes(needle: stability.Case, reference: stability.Reference) -> None:
    row = stability.judged("needle", needle, reference, "splitting2")
    assert row.verdict == "pass", row.failures
    assert row.figures["momenta"] < 1e-14
    assert row.figures["reversal"] < 1e-12


def test_a_promise_that_is_not_kept_fails(
    needle: stability.Case, reference: stability.Reference, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert next(m for m in METHODS if m.name == "rk4").promises == Promise.NOTHING
    promising = tuple(replace(m, promises=ALL) for m in METHODS)
    monkeypatch.setattr(stability, "METHODS", promising)
    row = stability.judged("needle", needle, reference, "rk4")
    assert row.verdict == "fail"
    assert any("from the start" in failure for failure in row.failures)


def test_what_returns_in_a_wider_scalar_only_passes(
    needle: stability.Case, reference: stability.Reference, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stability, "reversal", lambda *_: 1e-3)
    row = stability.judged("needle", needle, reference, "splitting2")
    assert row.verdict == "pass", row.failures
    assert any("by roundings of its own" in note for note in row.notes)


def test_a_step_that_is_too_long_is_divided(
    needle: stability.Case, reference: stability.Reference
) -> None:
    row = stability.judged("needle", replace(needle, step=0.1), reference, "rk4")
    assert row.verdict == "pass", row.failures
    assert row.notes[0].startswith("step too long")
    assert row.notes[-1].startswith("judged with a step of 0.")
    assert row.figures["error"] < stability.UNRESOLVED


def test_a_wrong_order_fails(needle: stability.Case, reference: stability.Reference) -> None:
    elsewhere = replace(reference, end=reference.end + 1e-3)
    row = stability.judged("needle", needle, elsewhere, "splitting2")
    assert row.verdict == "fail"
    assert any("falls to" in failure for failure in row.failures)


def stop_above(longest: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets runs with longer steps stop."""
    run = stability._run

    def stopping(simulation: Simulation, *args: Any, **options: Any) -> Run:
        assert simulation.step is not None
        if simulation.step > longest:
            raise RunFailed("stopped", Run({}))
        return run(simulation, *args, **options)

    monkeypatch.setattr(stability, "_run", stopping)


def test_what_stops_is_tried_with_a_far_shorter_step(
    needle: stability.Case, reference: stability.Reference, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert needle.step is not None
    far = needle.step / stability.FAR_SHORTER[0]
    with monkeypatch.context() as patch:
        stop_above(1.5 * far, patch)
        row = stability.judged("needle", needle, reference, "splitting2")
    assert row.verdict == "pass", row.failures
    assert row.step == far
    assert [note.split(":")[0] for note in row.notes] == [
        "step",
        "step of 0.005 s",
        "step of 0.00125 s",
        f"judged with a step of {far:g} s",
    ]
    stop_above(0.0, monkeypatch)
    row = stability.judged("needle", needle, reference, "splitting2")
    assert row.verdict == "fail"
    assert row.failures == ["stops with every step"]


def test_what_is_judged_early_is_carried_on(
    needle: stability.Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    promising = tuple(replace(m, promises=Promise.MOMENTA) for m in METHODS)
    monkeypatch.setattr(stability, "METHODS", promising)

    def carried_on(method: str, step: float) -> stability.Row:
        row = stability.Row("needle", method, 2, {}, "pass", step=step)
        return stability.carried_on(row, needle)

    row = carried_on("splitting2", 0.02)
    assert row.verdict == "pass", row.failures
    row = carried_on("rk4", 0.1)
    assert row.verdict == "fail"
    assert row.failures[0].startswith("momenta change by")
    stop_above(0.0, monkeypatch)
    row = carried_on("splitting2", 0.02)
    assert row.verdict == "fail"
    assert row.failures == [f"does not go on to {needle.end:g} s: stopped"]


def test_energy_errors_may_grow_with_the_square_of_momenta(
    needle: stability.Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    def grows(momenta: Vector, errors: Vector) -> bool:
        run = SimpleNamespace(
            energy=1 + errors,
            conserved={"energy": {"scale": 1.0}},
            bodies=("body",),
            momentum=lambda _: momenta[:, None],
            report={"steps": 400},
            final={},
        )
        monkeypatch.setattr(stability, "_run", lambda *_, **__: run)
        monkeypatch.setattr(stability, "_energy_moved", lambda *_: 0.0)
        early, late, grown, _ = stability._energy_errors(needle, "splitting2")
        return late > stability.GROWTH * early * grown

    falling = np.linspace(1, 10, 400)
    assert not grows(falling, 1e-3 * (falling**2 - 1))
    assert grows(falling, 1e-3 * (falling**4 - 1))
    assert grows(np.ones(400), 1e-3 * (falling**2 - 1))
    assert grows(falling[::-1], 1e-3 * (falling**2 - 1))


def test_exp_and_log_at_their_edges() -> None:
    checks = {check.name: check for check in stability.edges()}
    assert len(checks) == 26
    for name, check in checks.items():
        assert check.passed, (name, check.found)


def test_what_overflows_stops_and_what_is_denormal_is_refused() -> None:
    assert stability.stop_of("expanding").passed
    assert stability.refusal_of_a_denormal_mass().passed


def test_table() -> None:
    row = {"method": "rk4", "verdict": "fail", "figures": {"error": 0.5, "float": 0.25}}
    row |= {"unjudged": {"float": "no digits"}}
    row |= {"failures": ["too far"], "notes": ["judged with a step of 0.1 s"]}
    case = {
        "case": "needle",
        "description": "thin",
        "end": 1.0,
        "judged_at": 0.5,
        "step": 0.1,
        "condition": 10.0,
        "reference": "a and b",
        "reference_agreement": 1e-16,
        "rows": [row, {**row, "verdict": "pass", "failures": []}],
    }
    text = stability.table({"cases": [case], "checks": []})
    assert "    too far\n    judged with a step of 0.1 s\n" in text
    assert "2 rows: 1 pass, 0 unresolved" in text
    assert "judged at 0.5 s" in text
    assert "(2.5e-01)" in text
    assert "float not judged, no digits: rk4, rk4" in text
    row["figures"] = {"error": 0.5, "reversal": float("inf")}
    text = stability.table({"cases": [case], "checks": []})
    assert "inf" not in text
    assert text.count("–") >= 2
