"""Runs in scalars with more digits than a double."""

from __future__ import annotations

import json
import re
import subprocess
from decimal import Context, Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.generator.test_general_scenes import SCENES as ORACLES
from tests.generator.test_general_scenes import ascending, oracle, oracle_text

import hamotor
from hamotor.cli import main
from hamotor.errors import ToolError, UsageError
from hamotor.run import build
from hamotor.scene.reading import bundled_scenes, parse_scene, read_scene
from hamotor.scene.scalars import NAMES, parse_scalar
from hamotor.scene.source import scene_source

SCENE = """
algebra = "pga3"
[[body]]
name = "body"
mass = 1.0
inertia = [1.0, 2.0, 3.0]
momentum = { angular = [0.1, 0.2, 0.3], linear = [0.4, 0, 0] }
[time]
end = 0.3
step = 0.1
"""


@pytest.fixture(scope="module")
def simulation(tmp_path_factory: pytest.TempPathFactory) -> hamotor.Simulation:
    file = tmp_path_factory.mktemp("scalars") / "body.toml"
    file.write_text(SCENE)
    return hamotor.load(file)


def digits_of(run: Any) -> list[str]:
    (body,) = run.final.values()
    return [*body["motor"].values(), *body["momentum"].values()]


def apart(one: list[str], other: list[str]) -> float:
    return max(abs(float(Fraction(a) - Fraction(b))) for a, b in zip(one, other, strict=True))


def test_quad_and_mpfr_agree_in_all_digits_of_quad(
    simulation: hamotor.Simulation, tmp_path: Path
) -> None:
    quad = simulation.run(scalar="quad", method="splitting4", out=tmp_path, pictures=False)
    wide = simulation.run(scalar="mpfr", digits=40, method="splitting4")
    assert apart(digits_of(quad), digits_of(wide)) < 1e-32
    assert (quad.report["scalar"], quad.report["digits"]) == ("quad", 36)
    assert wide.report["digits"] == 42
    said = json.loads((tmp_path / "run.json").read_text())
    assert said["conserved"]["spatial_momentum.e12"]["max_relative_error"] < 1e-31
    (state,) = quad.final.values()
    rotation = [[Fraction(x) for x in row] for row in state["rotation"]]
    assert abs(float(sum(x * x for x in rotation[0]) - 1)) < 1e-33
    assert [float(x) for x in state["position"]] == list(quad.position()[-1])


def test_a_scalar_that_there_is_not_is_refused_with_those_there_are(
    simulation: hamotor.Simulation,
) -> None:
    with pytest.raises(UsageError, match=r'"quads"; there is .*Did you mean "quad"'):
        simulation.run(scalar="quads")
    for name in NAMES:
        assert parse_scalar(name).name == name
    with pytest.raises(UsageError, match="at least 17 and at most 60"):
        simulation.run(scalar="mpfr", digits=61)
    with pytest.raises(UsageError, match="digits are for the scalar mpfr"):
        simulation.run(scalar="quad", digits=40)
    with pytest.raises(UsageError, match="leave --scalar quad or --representation matrix out"):
        simulation.run(scalar="quad", representation="matrix", method="rkmk4")


@pytest.fixture
def poor_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that has neither library."""
    script = tmp_path / "poor++"
    script.write_text('#!/bin/sh\n[ "$1" = --version ] && echo "poor++ 1" && exit\nexit 1\n')
    script.chmod(0o755)
    monkeypatch.setenv("CXX", str(script))


@pytest.mark.usefixtures("poor_compiler")
def test_a_compiler_without_what_a_scalar_needs_is_told_with_a_remedy(tmp_path: Path) -> None:
    for scalar, remedy in (
        ("quad", "__float128.*apt-get install g.*--scalar mpfr.*poor"),
        ("mpfr40", r"MPFR not found.*sudo apt-get install libmpfr-dev.*poor"),
    ):
        with pytest.raises(ToolError, match=remedy):
            build.compile_scene("", scalar=scalar, cache=tmp_path)


def test_without_cxx_the_first_compiler_that_can_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, answer in (("g++", 1), ("clang++", 0)):
        script = tmp_path / name
        script.write_text(
            f'#!/bin/sh\n[ "$1" = --version ] && echo {name} && exit\nexit {answer}\n'
        )
        script.chmod(0o755)
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    requirement = build.requirement_of("quad", "x86_64")
    assert build.find_compiler(tmp_path).command == ("g++",)
    assert build.find_compiler(tmp_path, requirement).command == ("clang++",)
    assert build.requirement_of("quad", "aarch64") is None


def test_decimals_reach_the_runtime_in_all_their_digits(simulation: hamotor.Simulation) -> None:
    assert Fraction(1, 10) in simulation.exact_state
    library = simulation.compile(scalar="quad", method="splitting4").library
    third = [x + Fraction(1, 3) for x in simulation.exact_state]
    with library.start("splitting4", step=Fraction(1, 10), state=third) as run:
        row = run.observe_exactly()
        assert row is not None
        state = [row[k] for k in library.description.state_columns()]
        assert max(abs(float(a - b)) for a, b in zip(state, third, strict=True)) < 1e-33
    start = simulation.exact_state  # a motor: what is none would stop the run
    with library.start("splitting4", step=Fraction(1, 10), state=start) as run:
        assert run.advance(1, 0, None) == 1
        assert abs(Fraction(run.observe_text()[0]) - Fraction(1, 10)) < Fraction(1, 10**34)
        assert np.isfinite(run.observe()).all()


def test_constants_of_formulas_have_their_digits_in_the_source(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(
        'algebra = "cl3"\n[[body]]\nname = "top"\n'
        "kinetic_matrix = [[1, 0, 0], [0, 2, 0], [0, 0, 3]]\n"
        "[[interaction]]\n"
        'type = "potential"\nexpression = "sqrt(2)*at(0, 0, 1).z"\n'
        "[time]\nend = 1.0\nstep = 0.1\n"
    )
    text = hamotor.load(file).source("generated", "quad")
    found = re.search(r'number<S>\((.*)L, \[\] \{ return "(.*)"; \}\)', text)
    assert found is not None
    assert abs(Fraction(found[2]) ** 2 - 2) < Fraction(1, 10**58)


QUICK = "03_heavy_top_cl3"
"""The oracle that is cheapest to compile; the others take a minute together."""


def digits(x: Fraction) -> str:
    """A number of finitely many decimals, written out."""
    return str(Context(prec=60).divide(Decimal(x.numerator), Decimal(x.denominator)))


def physical_digits(group: Any, core: Any) -> tuple[list[Fraction], list[Fraction]]:
    """The components of M and, physical, of μ: generators are −½ of the blades, ½ for e0i."""
    motor = [sign * Fraction(core["M"][name]) for name, sign in map(ascending, group.motor)]
    momentum = [
        Fraction(1 if g == "e0i" else -1, 2) * Fraction(core["mu"][f"(e{g[1]}^e{g[2]})*"])
        for g in group.generators
    ]
    return motor, momentum


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.long] if n != QUICK else []) for n in ORACLES]
)
def test_an_oracle_is_met_in_25_digits(name: str, tmp_path: Path) -> None:
    text = oracle_text(name)
    group = parse_scene(text.encode(), name="oracle", file="oracle.toml").group
    motor, momentum = physical_digits(group, oracle(name)["initial"])
    given = ""
    for key, names, values in (
        ("motor", group.motor, motor),
        ("momentum", group.generators, momentum),
    ):
        listed = ", ".join(f"{n} = {digits(x)}" for n, x in zip(names, values, strict=True))
        given += f"{key} = {{ {listed} }}\n"
    text = re.sub(r"^(position|velocity|angular_velocity) = .*\n", "", text, flags=re.MULTILINE)
    text = re.sub(r'^(name = "(?:body|top)"\n)', rf"\1{given}", text, flags=re.MULTILINE)
    (tmp_path / "oracle.toml").write_text(text)
    for state in oracle(name)["states"]:
        command = [*f"run {tmp_path}/oracle.toml --scalar quad --method taylor".split()]
        command += [*f"--step {state['t']} --end {state['t']} --out {tmp_path}/out".split()]
        assert main([*command, "--no-pictures"]) == 0
        said = json.loads((tmp_path / "out" / "run.json").read_text())
        (final,) = said["final"].values()
        found = map(Fraction, [*final["motor"].values(), *final["momentum"].values()])
        wanted = [x for part in physical_digits(group, state) for x in part]
        for a, b in zip(found, wanted, strict=True):
            assert float(abs(a - b)) <= 1e-25 * max(1.0, abs(float(b))), state["t"]


@pytest.mark.parametrize("scalar", ["quad", "mpfr"])
def test_every_method_compiles_in_a_wide_scalar(scalar: str, tmp_path: Path) -> None:
    source = tmp_path / "scene.cpp"
    source.write_text(scene_source(read_scene("spring_pendulum"), scalar=scalar))
    command = [*build.find_compiler(tmp_path).command, "-std=c++20", "-fsyntax-only"]
    includes = [f"-I{folder}" for folder in build.default_includes()]
    subprocess.run([*command, *includes, str(source)], check=True)


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name, _ in bundled_scenes()])
def test_bundled_scenes_stay_near_in_float(name: str) -> None:
    simulation = hamotor.load(name)
    step = simulation.step or simulation.end / 1000
    one, other = (
        simulation.run(scalar=scalar, step=step, end=50 * step) for scalar in ("float", "double")
    )
    assert one.report["status"] == "finished"
    for body in one.bodies:
        for part in ("motor", "momentum"):
            a, b = (np.array([*run.final[body][part].values()]) for run in (one, other))
            assert np.abs(a - b).max() <= 1e-3 * max(1e-3, np.abs(b).max())


@pytest.mark.parametrize("method", ["splitting2", "taylor"])
def test_a_box_has_exact_moments_in_the_source(method: str) -> None:
    """m (a² + b²)/12 of tenths are short fractions; one rounded to a double is not."""
    text = scene_source(read_scene("tumble"), scalar="quad", method=method)
    assert "scalar::number<S>(" not in text
    assert "S(240)" in text or "/ S(120)" in text
