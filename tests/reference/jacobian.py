"""The accuracy of dexp and its inverse, measured.

`PYTHONPATH=generator .hamotor/venv/bin/python -m tests.reference.jacobian` measures it and writes
the table in jacobian.md.

jacobian.cpp measures against quadruple precision; `disagreement` holds that reference against the
defining power series, summed with many digits over products from the oracle.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mpmath
from tests.reference.oracle import Oracle, added, scaled
from tests.reference.program import processor_can_fuse, program

from hamotor.codegen.group import LieGroup
from hamotor.codegen.spec import bundled_path, read_algebra

ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path(__file__).with_name("jacobian.cpp")
TABLE = Path(__file__).with_name("jacobian.md")
BOUND = 4.0
CLOSED = (
    "pga3::SE3",
    "pga3::SO3",
    "pga3::T3",
    "pga2::SE2",
    "pga2::T2",
    "cga3::SE3",
    "cga2::SE2",
    "cl3::SO3",
)
"""Groups of rotations and rigid motions in closed form, which keep the bound."""
OTHERS = (
    "pga4::SO4",
    "pga4::SE4",
    "cga2::Sim2",
    "cga2::SO31",
    "cga3::Sim3",
    "cga3::SO41",
    "sta::SO13",
)


@dataclass(frozen=True)
class Measurement:
    """The largest error of one function of one group, and how often it was not a number."""

    group: str
    function: str
    points: int
    max_ulp: float
    nan: int


def _lines(mode: str, points: int, groups: Sequence[str]) -> list[dict[str, Any]]:
    command = [str(program(SOURCE, fused=processor_can_fuse())), mode, str(points), *groups]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    return [json.loads(line.replace(": inf", ": Infinity")) for line in run.stdout.splitlines()]


def measurements(points: int, groups: Sequence[str]) -> list[Measurement]:
    """Errors at `points` points of both functions of each group."""
    return [Measurement(**line) for line in _lines("measure", points, groups)]


def lie_group(name: str) -> tuple[Oracle, LieGroup]:
    """A group as jacobian.cpp names it, with the products of its algebra."""
    algebra, group = name.split("::")
    spec = read_algebra(bundled_path(algebra))
    return Oracle(spec.algebra.gram), next(g for g in spec.groups if g.name == group)


def multivector(group: LieGroup, rate: Sequence[Any]) -> dict[tuple[int, ...], Any]:
    """Σ rate × generator."""
    total: dict[tuple[int, ...], Any] = {}
    for x, generator in zip(rate, group.generators, strict=True):
        for mask, y in generator.bivector.items():
            blade = tuple(i for i in range(mask.bit_length()) if mask >> i & 1)
            share = mpmath.mpf(y.numerator) / y.denominator * x
            total[blade] = total.get(blade, mpmath.mpf(0)) + share
    return {blade: x for blade, x in total.items() if x}


def dexp(algebra: Oracle, x: dict[Any, Any], y: dict[Any, Any]) -> dict[Any, Any]:
    """Σ (−1)^k/(k+1)! ad_x^k y, until the terms vanish in the digits at hand."""
    term, total = dict(y), dict(y)
    for k in range(1, 4000):
        bracket = added(algebra.gp(x, term), scaled(-1, algebra.gp(term, x)))
        term = scaled(mpmath.mpf(-1) / (k + 1), bracket)
        total = added(total, term)
        if size(term) <= mpmath.eps * size(total):
            return total
    raise AssertionError("the series has not converged")


def size(a: dict[Any, Any]) -> Any:
    """Euclidean norm of the components."""
    return mpmath.sqrt(sum((x * x for x in a.values()), mpmath.mpf(0)))


def disagreement(name: str, points: int) -> dict[str, float]:
    """Largest relative distance of the reference from the series, for each function of a group."""
    algebra, group = lie_group(name)
    worst: dict[str, float] = {}
    with mpmath.workdps(120):
        for line in _lines("sample", points, [name]):
            a, b, found = (
                multivector(group, [mpmath.mpf(x) for x in line[key]])
                for key in ("a", "b", "found")
            )
            if line["function"] == "dexp":
                image, wanted = dexp(algebra, a, b), found
                scale = size(image) + size(b)
            else:
                image, wanted = dexp(algebra, a, found), b
                scale = size(b) + size(found) * (1 + size(a))
            error = float(size(added(image, scaled(-1, wanted))) / scale)
            worst[line["function"]] = max(worst.get(line["function"], 0.0), error)
    return worst


def table(found: Sequence[Measurement]) -> str:
    """The measurements as Markdown."""
    lines = ["| group | `dexp` max ulp | `dexp_inverse` max ulp |", "|---|---|---|"]
    for name in dict.fromkeys(m.group for m in found):
        cells = [f"{m.max_ulp:.3g}" for m in found if m.group == name]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


INTRODUCTION = """# Accuracy of the Jacobians of exp and log

Written by `PYTHONPATH=generator .hamotor/venv/bin/python -m tests.reference.jacobian`.

Errors in units of the last place of Σ |x ∂f/∂x| over all arguments x, rotation and translation
rates apart; double with fused multiply-adds, {closed:,} and {others:,} points.  Angles from 0
through denormal numbers and the neighbourhood of 2π to 10⁶ (10³ in the second table), translations
from 0 to 10¹⁰⁰.  The second table's dilations, boosts and special conformal rates go to 10 (a
factor e¹⁰): errors grow with that factor, since what shrinks by it is computed from what grows.
"""


def main() -> None:
    """Measure, and write the table."""
    closed, others = 20_000, 1_000
    parts = [
        INTRODUCTION.format(closed=closed, others=others),
        table(measurements(closed, CLOSED)),
        "",
        table(measurements(others, OTHERS)),
    ]
    TABLE.write_text("\n".join(parts) + "\n", encoding="utf-8")
    sys.stdout.write("\n".join(parts) + "\n")


if __name__ == "__main__":
    main()
