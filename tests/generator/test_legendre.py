"""Lagrangians without a formula for H: compiled, they do what fifty digits do."""

from __future__ import annotations

import random
import subprocess
from pathlib import Path

import mpmath
import pytest
import sympy
from tests.generator.test_lagrangian import GROUPS, VALUES, body_on, example

from hamotor.codegen.compiler import render
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.evaluation import evaluated, place, random_motor
from hamotor.mechanics.hamiltonian import TIME
from hamotor.mechanics.lagrangian import Lagrangian
from hamotor.mechanics.legendre import LagrangianSystem
from hamotor.run.build import default_cache, default_includes, find_compiler

MAIN = """
#include <cstdio>
#include "hamotor/{algebra}/{group}.hpp"
#include "hamotor/legendre.hpp"
using hamotor::dot, hamotor::mul_add, hamotor::select;
namespace scalar = hamotor::scalar;
{lagrangian}
using S = {scalar};
using System = hamotor::LegendreSystem<Lagrangian<S>>;
static_assert(hamotor::GeneralSystem<System>);
static_assert(hamotor::PoweredSystem<System> == {powered});
int main() {{
  const System::State state{{ {{ {{ {motor} }} }}, {{ {{ {momentum} }} }} }};
  const S t = S({time});
  const auto gradient = System::gradient(state, t);
  std::printf("%.21Lg\\n", static_cast<long double>(System::energy(state, t)));
  for (const S& x : gradient.rates[0].components())
    std::printf("%.21Lg\\n", static_cast<long double>(x));
  for (const S& x : gradient.forques[0].components())
    std::printf("%.21Lg\\n", static_cast<long double>(x));
  {power}
}}
"""
POWER = r'std::printf("%.21Lg\n", static_cast<long double>(System::power(state, t)));'
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]


def computed(
    folder: Path,
    lagrangian: Lagrangian,
    motor: list[float],
    momentum: list[float],
    *,
    algebra: str,
    scalar: str,
    time: float = 0.0,
) -> list[mpmath.mpf]:
    """Energy, rates, forques and, if there is one, power from the compiled system."""
    body, system = lagrangian.bodies[0], LagrangianSystem(lagrangian)
    group = body.group.name
    text = render(
        "lagrangian.cpp.jinja",
        group_type=f"hamotor::{algebra}::{group}",
        by_name=False,
        **system.template_values(),
    )
    source = folder / "system.cpp"
    source.write_text(
        MAIN.format(
            algebra=algebra,
            group=group.lower(),
            lagrangian=text,
            scalar=scalar,
            powered=str(system.power is not None).lower(),
            power="" if system.power is None else POWER,
            motor=", ".join(f"{x!r}L" for x in motor),
            momentum=", ".join(f"{x!r}L" for x in momentum),
            time=time,
        ),
        encoding="utf-8",
    )
    command = find_compiler(default_cache()).command
    includes = [f"-I{path}" for path in default_includes()]
    program = folder / "system"
    # The constants of the state are exact doubles, written as long double.
    flags = ["-std=c++20", "-O1", *WARNINGS, "-Wno-float-conversion", "-Wno-narrowing"]
    subprocess.run([*command, *flags, *includes, str(source), "-o", str(program)], check=True)
    done = subprocess.run([str(program)], check=True, capture_output=True, text=True)
    return [mpmath.mpf(line.lstrip("-") if "nan" in line else line) for line in done.stdout.split()]


def expected(
    lagrangian: Lagrangian, motor: list[float], momentum: list[float], time: float
) -> list[mpmath.mpf]:
    body = lagrangian.bodies[0]
    with mpmath.workdps(50):
        rates = lagrangian.rates_of_momentum([motor], [momentum], time)
        assert rates is not None
        values = {s: mpmath.mpf(int(x.p)) / int(x.q) for s, x in VALUES.items()}
        known = place(body, motor, values | {TIME: mpmath.mpf(time)})
        known |= dict(zip(body.rates, rates, strict=True))
        (value,) = evaluated([lagrangian.function], known)
        pairing = sum(p * b for p, b in zip(map(mpmath.mpf, momentum), rates, strict=True))
        forques = evaluated(lagrangian.at_fixed_rates.all_forques[0], known)
        found = [pairing - value, *rates, *forques]
        if lagrangian.applied or TIME in lagrangian.function.free_symbols:
            work = -sympy.diff(lagrangian.function, TIME)
            for f, b in zip(lagrangian.applied[0], body.rates, strict=True):
                work -= f * b
            found += evaluated([work], known)
        return found


def state(body: Coordinates) -> tuple[list[float], list[float]]:
    drawn = random.Random(5)
    return [float(x) for x in random_motor(body, drawn)], [
        drawn.uniform(-5, 5) for _ in body.momenta
    ]


@pytest.mark.parametrize(("algebra", "group"), [GROUPS[0], GROUPS[1], GROUPS[3]])
@pytest.mark.parametrize(("scalar", "bound"), [("double", 2e-13), ("long double", 1e-16)])
def test_compiled_newton_gives_the_gradient_to_rounding(
    tmp_path: Path, algebra: str, group: str, scalar: str, bound: float
) -> None:
    body = body_on(algebra, group)
    time = 0.25
    function = example(body, closing=False) + sympy.cos(TIME) * body.motor[0]
    damping = tuple(b * abs(b) / 3 for b in body.rates)
    lagrangian = Lagrangian((body,), function, VALUES, (damping,))
    motor, momentum = state(body)
    found = computed(
        tmp_path, lagrangian, motor, momentum, algebra=algebra, scalar=scalar, time=time
    )
    wanted = expected(lagrangian, motor, momentum, time)
    assert len(found) == len(wanted) == 2 + 2 * len(body.rates)
    scale = max(map(abs, wanted))
    assert max(abs(a - b) for a, b in zip(found, wanted, strict=True)) <= bound * scale


def relativistic() -> tuple[Coordinates, Lagrangian]:
    body = body_on("pga3", "T3")
    function = -9 * sympy.sqrt(1 - sum(v**2 for v in body.rates) / 9)
    return body, Lagrangian((body,), function)


def test_steps_that_leave_the_domain_are_halved(tmp_path: Path) -> None:
    _, lagrangian = relativistic()
    motor, momentum = [1.0, 0.0, 0.0, 0.0], [30.0, -40.0, 120.0]
    found = computed(tmp_path, lagrangian, motor, momentum, algebra="pga3", scalar="double")
    energy = 3 * mpmath.sqrt(9 + sum(mpmath.mpf(p) ** 2 for p in momentum))
    assert abs(found[0] / energy - 1) < 1e-13
    for rate, p in zip(found[1:4], momentum, strict=True):
        assert abs(rate / (9 * p / energy) - 1) < 1e-13


def test_momenta_of_no_rates_are_not_numbers(tmp_path: Path) -> None:
    body = body_on("pga3", "T3")
    function = sum(sympy.sqrt(1 + v**2) for v in body.rates)
    found = computed(
        tmp_path,
        Lagrangian((body,), function),
        [1.0, 0.0, 0.0, 0.0],
        [0.5, 1.5, 0.0],
        algebra="pga3",
        scalar="double",
    )
    assert all(mpmath.isnan(x) for x in found[:4])
