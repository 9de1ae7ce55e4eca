"""Taylor series of the motion: coefficients, order and step control, dense output.

References: series arithmetic of the system's own programs, which knows no recurrence; solutions of
40 digits (tests/references).
"""

from __future__ import annotations

import functools
import json
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

import hamotor
from hamotor.codegen.program import (
    Call,
    Expression,
    Name,
    Negative,
    Number,
    Product,
    Program,
    Quotient,
    Sum,
)
from hamotor.codegen.taylor import Recurrence, quadratic, recurrence, steps
from hamotor.errors import UsageError
from hamotor.mechanics.flow import WORK, Flow, flows
from hamotor.mechanics.proof import moved
from hamotor.mechanics.states import (
    coadjoint,
    functions,
    momentum_values,
    motor_values,
    random_states,
)
from hamotor.mechanics.straightline import FUNCTIONS
from hamotor.mechanics.system import System
from hamotor.run.library import Failure, SceneLibrary, Vector
from hamotor.scene import Scene, bundled_scenes, read_scene, scene_source
from hamotor.scene.motors import rotation_matrix
from hamotor.scene.principal_system import principal_system

REFERENCES = Path(__file__).resolve().parents[1] / "references"
DIGITS = 50
ORDER = 4
AGREEMENT = mpmath.mpf(10) ** -44


@dataclass(frozen=True)
class Series:
    """A truncated power series, multiplied and divided by the textbook."""

    terms: tuple[Any, ...]

    def __neg__(self) -> Series:
        return Series(tuple(-x for x in self.terms))

    def __add__(self, other: Any) -> Series:
        if not isinstance(other, Series):
            other = constant(other, len(self.terms))
        return Series(tuple(x + y for x, y in zip(self.terms, other.terms, strict=True)))

    def __sub__(self, other: Series) -> Series:
        return self + -other

    def __mul__(self, other: Any) -> Series:
        if not isinstance(other, Series):
            return Series(tuple(x * other for x in self.terms))
        return Series(
            tuple(
                sum(self.terms[j] * other.terms[k - j] for j in range(k + 1))
                for k in range(len(self.terms))
            )
        )

    __radd__ = __add__
    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Series:
        if not isinstance(other, Series):
            return Series(tuple(x / other for x in self.terms))
        return self * lifted(lambda x: 1 / x)(other)

    def __rtruediv__(self, other: Any) -> Series:
        return constant(other, len(self.terms)) / self


def constant(x: Any, length: int) -> Series:
    return Series((x, *[mpmath.mpf(0)] * (length - 1)))


def lifted(f: Callable[..., Any]) -> Callable[[Series], Series]:
    """f of a series by its derivatives, f(a + d) = Σ f⁽ⁿ⁾(a)/n! dⁿ."""

    def on_series(x: Series) -> Series:
        length = len(x.terms)
        rest = Series((mpmath.mpf(0), *x.terms[1:]))
        total, power = constant(mpmath.mpf(0), length), constant(mpmath.mpf(1), length)
        with mpmath.workdps(3 * DIGITS):
            derivatives = mpmath.taylor(f, x.terms[0], length - 1)
        for derivative in derivatives:
            total, power = total + power * derivative, power * rest
        return total

    return on_series


def angle(y: Series, x: Series) -> Series:
    """atan2, from the logarithm of a complex series."""
    turned = lifted(mpmath.log)(x + y * mpmath.mpc(0, 1))
    return Series(tuple(mpmath.im(term) for term in turned.terms))


def series_functions() -> dict[str, Callable[..., Any]]:
    named = {n: lifted(getattr(mpmath, n)) for n in FUNCTIONS.values() if hasattr(mpmath, n)}
    exact = functions(random.Random(1))["number"]
    return named | {"sqrt": lifted(mpmath.sqrt), "atan2": angle, "number": exact}


def expected_coefficients(system: System) -> dict[str, list[Any]]:
    """The motion's Taylor coefficients at a random state, by iterating Ṁ = M B, μ̇ = ad*_B μ − F."""
    state = next(random_states(system))
    bodies = system.hamiltonian.bodies
    known = {name: [x] for name, x in state.values.items()} | {WORK: [mpmath.mpf(0)]}
    functions_ = series_functions()
    for length in range(1, ORDER + 1):
        values = {n: Series((*c, *[mpmath.mpf(0)] * (length - len(c)))) for n, c in known.items()}
        found = system.gradient.evaluate(values, functions_)
        change: dict[str, Any] = {"t": constant(mpmath.mpf(1), length)}
        change[WORK] = system.power.evaluate(values, functions_)["value"]
        for k, body in enumerate(bodies):
            generators = body.group.generators
            rate = [as_series(found[f"rate{k}.{g.rate}"], length) for g in generators]
            forque = [as_series(found[f"forque{k}.{g.momentum}"], length) for g in generators]
            momentum = [values[f"mu{k}.{g.momentum}"] for g in generators]
            turning = coadjoint(body, rate, momentum)
            change |= momentum_values(
                body, k, [c + -f for c, f in zip(turning, forque, strict=True)]
            )
            motor: dict[int, Any] = {}
            for c in body.group.element.components:
                for blade, x in c.embedding.items():
                    term = values[f"m{k}.{c.name}"] * (mpmath.mpf(x.numerator) / x.denominator)
                    motor[blade] = motor.get(blade, 0) + term
            at = replace(
                state, motors=tuple(motor if i == k else m for i, m in enumerate(state.motors))
            )
            change |= motor_values(body, k, moved(body, at, k, rate))
        for name, derivative in change.items():
            known[name].append(as_series(derivative, length).terms[length - 1] / length)
    return known


def coordinates_of(flow: Flow, motion: Mapping[str, list[Any]]) -> dict[str, list[Any]]:
    """The coefficients of a flow's coordinates."""
    given = {name: Series(tuple(c)) for name, c in motion.items()}
    entered = flow.enter.evaluate(given, series_functions())
    series = {c: as_series(entered[f"x[{i}]"], ORDER + 1) for i, c in enumerate(flow.coordinates)}
    if WORK in series:
        series[WORK] = given[WORK]
    return {name: list(x.terms) for name, x in series.items()}


def expect_way_back(flow: Flow, motion: Mapping[str, list[Any]], start: Mapping[str, Any]) -> None:
    """Leaving gives the state that was entered; coordinates that follow from others do."""
    x = {f"x[{i}]": start[name] for i, name in enumerate(flow.coordinates)}
    for name, value in flow.leave.evaluate(x, plain_functions()).items():
        assert abs(value - motion[name][0]) <= AGREEMENT * max(1, abs(value)), name
    for name, value in flow.refresh.evaluate(x, plain_functions()).items():
        assert abs(value - x[name]) <= AGREEMENT, name


def as_series(x: Any, length: int) -> Series:
    return x if isinstance(x, Series) else constant(mpmath.mpf(x), length)


def plain_functions() -> dict[str, Callable[..., Any]]:
    return functions(random.Random(1))


def expect_equal(
    found: Mapping[str, list[Any]], expected: Mapping[str, list[Any]], what: str
) -> None:
    for name, series in found.items():
        for k, x in enumerate(series):
            size = max(abs(other[k]) for other in expected.values() if len(other) > k)
            assert abs(x - expected[name][k]) <= AGREEMENT * size, f"{what}: {name}, order {k}"


def of_emitted_programs(r: Recurrence, start: Mapping[str, Any]) -> dict[str, list[Any]]:
    """What the programs that become C++ compute."""
    programs, given = steps(r), plain_functions()
    zero = given["number"](Fraction(0))
    names = [name for name, _ in r.derivatives]
    found = {name: [start[name]] for name in names}
    x = {f"x[{i}]": start[name] for i, name in enumerate(names)}
    known = programs.first.evaluate(x, given)
    change = known
    rows: list[Mapping[str, Any]] = [{}]
    for k in range(1, ORDER + 1):
        for i, name in enumerate(names):
            x[f"x[{i}]"] = change[f"change[{i}]"] / k
            found[name].append(x[f"x[{i}]"])
        sums = {
            f"sums[{n}]": sum(
                (rows[j][f"u[{n}]"] * rows[k - j][f"v[{n}]"] for j in range(1, k)), zero
            )
            for n in range(len(r.lanes))
        }
        order = {"k": mpmath.mpf(k), "over_k": 1 / mpmath.mpf(k)}
        change = programs.next.evaluate({**x, **known, **sums, **order}, given)
        rows.append(change)
    return found


def expect_packs(r: Recurrence, start: Mapping[str, Any], found: Mapping[str, list[Any]]) -> None:
    """The tables of a quadratic field give its derivatives."""
    packed = quadratic(r)
    if packed is None:
        return
    number = plain_functions()["number"]
    names = [r.derivatives[old][0] for old in packed.order]
    x = [start[name] for name in names]
    derivatives = [number(c) for c in packed.constants]
    for kind in (packed.products, packed.fixed, packed.linear):
        for term in kind:
            for lane, weight in enumerate(term.weights):
                if weight:
                    factor = 1 if kind is packed.linear else x[term.left[lane]]
                    value = number(weight) * factor * x[term.right[lane]]
                    derivatives[8 * term.pack + lane] += value
    for name, derivative in zip(names, derivatives, strict=True):
        assert abs(derivative - found[name][1]) <= AGREEMENT * max(1, abs(derivative)), name


@pytest.mark.parametrize("name", [name for name, _ in bundled_scenes()])
def test_coefficients_are_those_of_series_arithmetic(name: str) -> None:
    scene = read_scene(name)
    system = principal_system(scene) if isinstance(scene, Scene) else scene.system
    with mpmath.workdps(DIGITS):
        motion = expected_coefficients(system)
        for flow in flows(system):
            expected = coordinates_of(flow, motion)
            start = {coordinate: c[0] for coordinate, c in expected.items()}
            series = recurrence(flow.field)
            found = series.coefficients(start, ORDER, plain_functions())
            expect_equal(found, expected, name)
            expect_equal(of_emitted_programs(series, start), found, f"{name}, as programs")
            expect_way_back(flow, motion, start)
            expect_packs(series, start, found)


def test_every_function_has_its_series() -> None:
    x, y = Name("x"), Name("y")
    calls = ["exp", "sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan"]
    terms: list[Expression] = [Call(f, (Product(Number(Fraction(1, 3)), x),)) for f in calls]
    square = Sum(Product(x, x), Product(y, y))
    terms += [Call("log", (square,)), Call("atan2", (y, x)), Quotient(x, Sum(y, Number(2)))]
    terms += [Call("sqrt", (Product(Number(2), square),))]
    terms += [Quotient(y, Product(square, Call("sqrt", (Product(Number(3), square),))))]
    derivative: Expression = terms[0]
    for term in terms[1:]:
        derivative = Sum(derivative, term)
    field = Program((), (), (("x", derivative), ("y", Product(x, Negative(y)))), None)
    with mpmath.workdps(DIGITS):
        start = {"x": mpmath.mpf("0.3"), "y": mpmath.mpf("-0.7")}
        expected = {name: [value] for name, value in start.items()}
        for length in range(1, ORDER + 1):
            values = {name: Series(tuple(c)) for name, c in expected.items()}
            for name, series in field.evaluate(values, series_functions()).items():
                expected[name].append(series.terms[-1] / length)
        r = recurrence(field)
        expect_equal(r.coefficients(start, ORDER, plain_functions()), expected, "functions")
        expect_equal(of_emitted_programs(r, start), expected, "functions, as programs")


def test_what_is_not_analytic_is_refused_by_name(tmp_path: Path) -> None:
    text = """algebra = "pga3"
[[body]]
name = "b"
mass = 1.0
inertia = [1.0, 2.0, 3.0]
[[interaction]]
type = "potential"
expression = "abs(at(b, 0, 0, 1).z)"
[time]
end = 1.0
step = 0.01
"""
    path = tmp_path / "floor.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=r'method "taylor" needs .* abs'):
        scene_source(read_scene(path), method="taylor")


# ---------------------------------------------------------------- whole runs


FALL = """algebra = "pga3"
group = "T3"
[[body]]
name = "b"
position = [1, 0, 0]
[hamiltonian]
expression = "norm_squared(P)/2 - 1/norm(position)"
[time]
end = 2.0
step = 0.01
"""
"""From rest at distance 1 to an attracting centre."""


def library_of(folder: Path, problem: str) -> tuple[SceneLibrary, Vector, dict[str, Any]]:
    """A problem of tests/references with the method compiled, its start and its solution."""
    reference = json.loads((REFERENCES / f"{problem}.json").read_text())
    given = reference["params"]
    top, forced = problem == "P3", problem in {"P3", "P4"}
    lever = given["m"] * given["l"] ** 2 if top else 0.0
    moments = given["J"]
    lines = [
        'algebra = "pga3"',
        'group = "SO3"' if top else "",
        "[[body]]",
        'name = "b"',
        f"mass = {float(given['m'])}",
        f"inertia = {[moments[0] - lever, moments[1] - lever, moments[2]]}",
        f"center_of_mass = [0, 0, {given['l']}]" if top else f"position = {given['x0']}",
        f"orientation = {{ quaternion = {given['q0']} }}",
        f"angular_velocity = {given['w0']}",
        "" if top else f"velocity = {given['v0']}",
        *(["[[interaction]]", 'type = "gravity"', "acceleration = [0, 0, -9.81]"] * forced),
    ]
    if problem == "P4":
        lines += ["[[interaction]]", 'type = "spring"', 'body = "b"', f"at = {given['a']}"]
        lines += ["anchor = [0, 0, 0]", f"stiffness = {given['k']}"]
    lines += ["[time]", f"end = {given['T']}", "step = 0.01", 'method = "taylor"']
    path = folder / f"{problem}.toml"
    path.write_text("\n".join(lines))
    simulation = hamotor.load(path)
    compiled = simulation.compile(method="taylor")
    assert compiled.description.methods == simulation.methods, "the runtime and the list agree"
    assert "taylor" in compiled.description.error_controlled
    return compiled.library, simulation.state, reference


@pytest.fixture(scope="module")
def problems(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Any]:
    folder = tmp_path_factory.mktemp("problems")
    return functools.cache(lambda problem: library_of(folder, problem))


def rotation_error(state: Vector, checkpoint: Mapping[str, Any]) -> float:
    w, x, y, z = (float(c) for c in checkpoint["q"])
    found, expected = rotation_matrix(state[:4].tolist()), rotation_matrix((w, -x, -y, -z))
    return float(np.abs(found - expected).max())


@pytest.mark.parametrize(
    ("problem", "tolerance", "bound"),
    [
        ("P1", 1e-6, 5e-3), ("P1", 1e-9, 5e-6), ("P1", 1e-12, 5e-9),
        ("P3", 1e-6, 1e-5), ("P3", 1e-9, 1e-8), ("P3", 1e-12, 3e-11),
        ("P4", 1e-6, 1e-3), ("P4", 1e-9, 1e-6), ("P4", 1e-12, 1e-9),
    ],
)  # fmt: skip
def test_errors_follow_the_tolerance(
    problems: Callable[[str], Any], problem: str, tolerance: float, bound: float
) -> None:
    library, start, reference = problems(problem)
    end = float(reference["params"]["T"])
    with library.start("taylor", step=end, state=start, tolerance=tolerance) as run:
        assert run.advance(1, 0, None) == 1
        assert rotation_error(run.state(), reference["checkpoints"][-1]) < bound


def test_dense_output_costs_no_steps_and_no_digits(problems: Callable[[str], Any]) -> None:
    library, start, reference = problems("P4")
    with library.start("taylor", step=5.0, state=start, tolerance=1e-13) as run:
        for checkpoint in reference["checkpoints"]:
            run.advance(1, 0, None)
            assert rotation_error(run.state(), checkpoint) < 1e-10
        coarse, at_the_end = run.steps(), run.state()
    with library.start("taylor", step=0.01, state=start, tolerance=1e-13) as run:
        assert run.advance(5000, 0, None) == 5000
        assert run.steps() == coarse < 1000
        assert np.abs(run.state() - at_the_end).max() < 1e-12


def test_a_step_in_parts_ends_in_the_same_bits(problems: Callable[[str], Any]) -> None:
    library, start, _ = problems("P4")
    with library.start("taylor", step=5.0, state=start, tolerance=1e-13) as run:
        assert run.advance(2, 0, None) == 2
        taken, there = run.steps(), run.state()
    with library.start("taylor", step=5.0, state=start, tolerance=1e-13) as run:
        run.set_patience(3)
        calls = done = 0
        while done < 2:
            before = run.state()
            done += (more := run.advance(2 - done, 0, None))
            calls += 1
            assert run.steps() <= 4 * calls
            assert more or np.array_equal(run.state(), before)
        assert calls > taken / 6 > 1
        assert run.steps() == taken
        np.testing.assert_array_equal(run.state(), there)


def test_the_account_of_work_is_a_coordinate() -> None:
    simulation = hamotor.load("rocket")
    library = simulation.compile(method="taylor").library
    column = {c.name: k for k, c in enumerate(library.description.columns)}
    with library.start("taylor", step=4.0, state=simulation.state) as run:
        before = run.observe()
        assert run.advance(1, 0, None) == 1
        after = run.observe()
    gained = after[column["energy"]] - before[column["energy"]]
    assert gained > 1
    assert abs(gained - after[column["work"]]) < 1e-11 * gained


def test_a_collision_stops_the_run(tmp_path: Path) -> None:
    path = tmp_path / "fall.toml"
    path.write_text(FALL)
    simulation = hamotor.load(path)
    library = simulation.compile(method="taylor").library
    with library.start("taylor", step=1.0, state=simulation.state, tolerance=1e-9) as run:
        assert run.advance(1, 0, None) == 1
        assert run.advance(1, 0, None) == 0, "the centre is reached at t = π/√8"
        assert run.failure()[0] in {Failure.STEP_TOO_SHORT, Failure.NOT_FINITE}


@pytest.mark.parametrize("faster", [2.0**60, 2.0**-60])
def test_a_free_motion_is_the_same_at_any_speed(
    problems: Callable[[str], Any], faster: float
) -> None:
    # Per s, coefficients of order 34 would exceed the range of a double, or vanish.
    library, start, _ = problems("P1")
    ends = []
    for speed in (1.0, faster):
        state = np.concatenate([start[:8], speed * start[8:]])
        with library.start("taylor", step=10.0 / speed, state=state) as run:
            assert run.advance(1, 0, None) == 1
            ends.append(run.state())
            taken = run.steps()
    assert taken > 5
    assert np.abs(ends[1][:8] - ends[0][:8]).max() < 1e-12 * np.abs(ends[0][:8]).max()


def test_time_runs_backwards(problems: Callable[[str], Any]) -> None:
    library, start, _ = problems("P4")
    with library.start("taylor", step=5.0, state=start) as run:
        run.advance(1, 0, None)
        there = run.state()
    with library.start("taylor", step=-5.0, state=there) as run:
        run.advance(1, 0, None)
        assert np.abs(run.state() - start).max() < 1e-12


def test_a_step_without_an_end_fails(problems: Callable[[str], Any]) -> None:
    library, start, _ = problems("P4")
    for step in (np.inf, -np.inf, np.nan):
        with library.start("taylor", step=step, state=start) as run:
            assert run.advance(1, 0, None) == 0
            assert run.failure()[0] == Failure.NOT_FINITE


def test_tighter_tolerances_take_higher_orders_not_many_more_steps(
    problems: Callable[[str], Any],
) -> None:
    library, start, _ = problems("P3")
    taken = []
    for tolerance in (1e-6, 1e-14):
        with library.start("taylor", step=20.0, state=start, tolerance=tolerance) as run:
            run.advance(1, 0, None)
            taken.append(run.steps())
    assert 0.3 < taken[1] / taken[0] < 3
