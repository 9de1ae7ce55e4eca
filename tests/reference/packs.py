"""The accuracy of what packs of lanes compute, measured.

`PYTHONPATH=generator .hamotor/venv/bin/python -m tests.reference.packs` measures it and writes the
table in packs.md.

packs.cpp measures against quadruple precision; `disagreement` holds that reference against 50
digits.
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
from tests.reference.program import processor_can_fuse, program

SOURCE = Path(__file__).with_name("packs.cpp")
TABLE = Path(__file__).with_name("packs.md")
POINTS = 1_000_000
OURS = ("AngleIncrement: sin x", "AngleIncrement: cos x - 1", "sqrt", "sin", "cos", "exp")
"""What is computed for all lanes at once; the others are the C library's, lane by lane."""
BOUNDS = {
    ("AngleIncrement: sin x", "double"): 2.0,
    ("AngleIncrement: cos x - 1", "double"): 3.5,
    ("AngleIncrement: sin x", "float"): 2.0,
    ("sqrt", "double"): 0.5,
    ("sqrt", "float"): 0.5,
    ("floor", "double"): 0.0,
    ("floor", "float"): 0.0,
    ("sin", "double"): 1.4,
    ("cos", "double"): 1.4,
    ("exp", "double"): 1.01,
}
BOUND = 2.5
"""Of all others, in units of the last place."""

EXACT: dict[str, Any] = {
    "AngleIncrement: sin x": mpmath.sin,
    "AngleIncrement: cos x - 1": lambda x: -2 * mpmath.sin(x / 2) ** 2,
    **{
        name: getattr(mpmath, name)
        for name in (
            "sqrt", "sin", "cos", "exp", "tan", "log", "sinh", "cosh", "tanh", "asinh", "asin",
            "acos", "atan", "floor",
        )
    },
}  # fmt: skip


@dataclass(frozen=True)
class Measurement:
    """The largest error of one function, and the argument where it is."""

    function: str
    scalar: str
    points: int
    max_ulp: float
    x: float
    y: float

    @property
    def bound(self) -> float:
        """What it must not exceed."""
        return BOUNDS.get((self.function, self.scalar), BOUND)


def _lines(mode: str, points: int) -> list[dict[str, Any]]:
    command = [str(program(SOURCE, fused=processor_can_fuse())), mode, str(points)]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    return [json.loads(line.replace(": inf", ": Infinity")) for line in run.stdout.splitlines()]


def measurements(points: int) -> list[Measurement]:
    """Errors at `points` points of each function, in double and float."""
    return [Measurement(**line) for line in _lines("measure", points)]


def disagreement(points: int) -> float:
    """Largest relative distance of the reference from 50 digits, over all functions."""
    worst = mpmath.mpf(0)
    with mpmath.workdps(50):
        for line in _lines("sample", points):
            name, x, y = line["function"], mpmath.mpf(line["x"]), mpmath.mpf(line["y"])
            # The largest angles have 300 digits before the point.
            with mpmath.workdps(400):
                exact = mpmath.atan2(x, y) if name == "atan2" else EXACT[name](x)
            found = mpmath.mpf(line["truth"])
            if exact != found:
                worst = max(worst, abs(found - exact) / abs(exact))
    return float(worst)


def table(found: Sequence[Measurement]) -> str:
    """The measurements as Markdown."""
    lines = ["| function | double, max ulp | float, max ulp | by |", "|---|---|---|---|"]
    for name in dict.fromkeys(m.function for m in found):
        errors = {m.scalar: f"{m.max_ulp:.3f}" for m in found if m.function == name}
        lines.append(f"| {name} | {errors['double']} | {errors['float']} | {_by(name)} |")
    return "\n".join(lines)


def _by(name: str) -> str:
    if name == "sqrt":
        return "the processor"
    if name not in OURS:
        return "the C library, lane by lane"
    return "polynomials" if name.startswith("Angle") else "polynomials; float: the C library"


INTRODUCTION = """# Accuracy of the functions of packs

Written by `PYTHONPATH=generator .hamotor/venv/bin/python -m tests.reference.packs`.

Errors in units of the last place of the truth, fused multiply-adds, {points:,} points a function
and scalar: all exponents from denormal numbers on, angles beside multiples of π/4 and π/2 up to 10⁸
and of any size beyond, exponents beside odd multiples of (log 2)/2 and where results are denormal
or overflow, numbers beside 1. Steppers need `AngleIncrement` and roots only; the others are
for potentials. Beyond 10⁸ sines and cosines of angles are the C library's too.
"""


def main() -> None:
    """Measure, and write the table."""
    text = f"{INTRODUCTION.format(points=POINTS)}\n{table(measurements(POINTS))}\n"
    TABLE.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
