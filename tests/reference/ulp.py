"""The accuracy of exp, log, Cayley's maps and normalize for every finite input, measured.

`PYTHONPATH=generator .hamotor/venv/bin/python -m tests.reference.ulp` measures it and writes the
table in ulp.md; with names of algebras, only their rows of the second table; with `--json` it
prints the measurements instead.

ulp.cpp measures against quadruple precision in classical form; `worst_disagreement` holds that
reference against this module's own: power series and linear equations for multivectors, products
from the oracle, 100 digits.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
from tests.reference import conditioned
from tests.reference.oracle import Blade, Oracle, added, scaled
from tests.reference.program import processor_can_fuse, program

SOURCE = Path(__file__).with_name("ulp.cpp")
TABLE = Path(__file__).with_name("ulp.md")
SCALARS = ("double", "float")
POINTS = 100_000
"""Of every form of a function that takes every finite input, and of every kernel."""

BOUND = 4.0
"""Units of the last place of the result's norm that a function may be off."""

EVEN: tuple[tuple[Blade, int], ...] = (
    ((), 1),
    ((2, 3), 1),
    ((1, 3), -1),
    ((1, 2), 1),
    ((0, 1), 1),
    ((0, 2), 1),
    ((0, 3), 1),
    ((0, 1, 2, 3), 1),
)
"""s, e23, e31, e12, e01, e02, e03, e0123: the order of ulp.cpp."""

Even = dict[Blade, Any]
ALGEBRA = Oracle([[0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
DIGITS = 100


@dataclass(frozen=True)
class Measurement:
    """The errors of one function in one form."""

    function: str
    form: str
    scalar: str
    points: int
    max_ulp: float
    median_ulp: float
    nan: int
    beyond: float

    @property
    def fits(self) -> bool:
        """Whether nothing was off by more than the bound, or not a number."""
        return self.max_ulp <= BOUND and self.nan == 0 and self.beyond <= 1


def _lines(fused: bool, mode: str, scalar: str, points: int) -> list[dict[str, Any]]:
    command = [str(program(SOURCE, fused=fused)), mode, scalar, str(points)]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    text = run.stdout.replace(": inf", ": Infinity").replace(": -nan", ": NaN")
    return [json.loads(line.replace(": nan", ": NaN")) for line in text.splitlines()]


def measurements(
    points: int, *, fused: bool, scalars: Sequence[str] = SCALARS
) -> list[Measurement]:
    """Errors at `points` points of each function in each form and scalar."""
    program(SOURCE, fused=fused)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        found = pool.map(lambda scalar: _lines(fused, "measure", scalar, points), scalars)
        return [
            Measurement(
                line["function"],
                line["form"],
                line["scalar"],
                line["points"],
                line["max_ulp"],
                line["median_ulp"],
                line["nan"] + line["wild_nan"],
                line["beyond"],
            )
            for lines in found
            for line in lines
        ]


# ---------------------------------------------------------------- the reference's reference


def _even(numbers: Sequence[str], exactly: bool) -> Even:
    """Components as multivector; exactly: the numbers are doubles, printed with fewer digits."""
    read: Callable[[str], Any] = (lambda x: mpmath.mpf(float(x))) if exactly else mpmath.mpf
    return {
        blade: sign * read(x) for (blade, sign), x in zip(EVEN, numbers, strict=True) if read(x)
    }


def _size(a: Even) -> Any:
    return mpmath.sqrt(sum((x * x for x in a.values()), mpmath.mpf(0)))


def _distance(a: Even, b: Even) -> Any:
    return _size(added(a, scaled(-1, b)))


def _turning(a: Even) -> Any:
    return _size({blade: x for blade, x in a.items() if 0 not in blade})


ONE: Even = {(): mpmath.mpf(1)}


def exponential(b: Even) -> Even:
    """Power series of b / 2ᵏ, squared k times."""
    turning = _turning(b)
    halvings = 20 + max(0, int(mpmath.log(turning, 2)) + 1) if turning else 0
    small = scaled(mpmath.ldexp(1, -halvings), b)
    term, total = dict(ONE), dict(ONE)
    for n in range(1, 20):
        term = scaled(mpmath.mpf(1) / n, ALGEBRA.gp(term, small))
        total = added(total, term)
    for _ in range(halvings):
        total = ALGEBRA.gp(total, total)
    return total


def nearest_unit(m: Even) -> Even:
    """m (~m m)^(−1/2) by Newton's iteration for the inverse root."""
    square = ALGEBRA.gp(ALGEBRA.reverse(m), m)
    root: Even = {(): 1 / mpmath.sqrt(square[()])}
    for _ in range(3):
        correction = ALGEBRA.gp(square, ALGEBRA.gp(root, root))
        root = ALGEBRA.gp(root, added(scaled(mpmath.mpf(3) / 2, ONE), scaled(-0.5, correction)))
    return ALGEBRA.gp(m, root)


def _exp_error(b: Even, found: Even) -> Any:
    """Relative to what the result's conditioning leaves: it feels θ, and where sin θ ≪ 1 also B."""
    truth = exponential(b)
    return _distance(found, truth) / (_size(truth) * (1 + _turning(b)) + _size(b))


def _log_error(m: Even, found: Even) -> Any:
    unit = nearest_unit(m)
    if _turning(found) > mpmath.pi * (1 + mpmath.mpf(10) ** -30):
        return mpmath.inf
    back = exponential(found)
    if mpmath.sign(m.get((), 0)) < 0 and _turning(found) == 0:
        back = scaled(-1, back)  # −T in the plane: the logarithm of T stands in
    return _distance(back, unit) / (1 + _size(found))


def _cayley_error(b: Even, found: Even) -> Any:
    """X (1 − B) = 1 + B."""
    left = ALGEBRA.gp(found, added(ONE, scaled(-1, b)))
    return _distance(left, added(ONE, b)) / (_size(found) * (1 + _size(b)))


def _cayley_inverse_error(m: Even, found: Even) -> Any:
    """B (M + 1) = M − 1."""
    unit = nearest_unit(m)
    plus, minus = added(unit, ONE), added(unit, scaled(-1, ONE))
    size = _size(found) * _size(plus) + _size(minus)
    return _distance(ALGEBRA.gp(found, plus), minus) / (size or 1)


def _normalize_error(m: Even, found: Even) -> Any:
    truth = nearest_unit(m)
    return _distance(found, truth) / _size(truth)


ERRORS = {
    "exp": _exp_error,
    "log": _log_error,
    "cayley": _cayley_error,
    "cayley_inverse": _cayley_inverse_error,
    "normalize": _normalize_error,
}


def worst_disagreement(points: int, scalar: str) -> dict[str, float]:
    """Function and form → largest relative distance of ulp.cpp's reference from this one's."""
    worst: dict[str, float] = {}
    with mpmath.workdps(DIGITS):
        for line in _lines(processor_can_fuse(), "sample", scalar, points):
            argument = _even(line["input"], exactly=True)
            found = _even(line["reference"], exactly=False)
            rate = line["form"].endswith("Rate")
            if rate:
                argument = scaled(mpmath.mpf(-1) / 2, argument)
            elif line["form"].split()[0] in ("SE3", "SO3", "SE2"):
                found = scaled(mpmath.mpf(-1) / 2, found)
            name = f"{line['function']} {line['form']}"
            error = float(ERRORS[line["function"]](argument, found))
            worst[name] = max(worst.get(name, 0.0), error)
    return worst


# ---------------------------------------------------------------- the published table


def table(found: Sequence[Measurement]) -> str:
    """The measurements as Markdown."""
    rows = {(m.function, m.form): dict[str, Measurement]() for m in found}
    for m in found:
        rows[m.function, m.form][m.scalar] = m
    lines = [
        "| function | of | double max | median | float max | median |",
        "|---|---|---|---|---|---|",
    ]
    for (function, form), by_scalar in rows.items():
        cells = [f"{by_scalar[s].max_ulp:.2f} | {by_scalar[s].median_ulp:.2f}" for s in SCALARS]
        lines.append(f"| `{function}` | {form} | {' | '.join(cells)} |")
    return "\n".join(lines)


@cache
def introduction(points: int) -> str:
    """What the table says and how it was made."""
    return f"""# Accuracy of the generated kernels

Written by `PYTHONPATH=generator .hamotor/venv/bin/python -m tests.reference.ulp`; with names of
algebras behind it, only their rows of the second table.

## exp, log, Cayley's maps and normalize for every finite input

Errors in units of the last place of the result's norm, at {points:,} points of each row: half
angles from 0 through denormal numbers and the neighbourhood of multiples of π to 10¹⁵ (float:
10⁷); translations from 0 to the largest number, along the axis, across it and in between; motors
that are the exponentials of such, times anything for `normalize`.  No finite argument gives a NaN,
if only the function has a value there that is a number: `cayley_inverse` has none at −1 times a
translation, `normalize` none where there is no rotor part.

`exp` is judged like this where ε² of the translation is below half the last place of the result.
Beyond, where the half angle is within about ε of a multiple of π and the translation above 1/ε, as
much as ε² of the translation may come on top.

Built with fused multiply-adds; without them the bound of 4 holds as well, and is tested.  The truth
is quadruple precision, which is itself held against multivectors with 100 digits.
"""


def main() -> None:
    """Measure, and write the table or print the measurements."""
    fused = processor_can_fuse()
    if algebras := [name for name in sys.argv[1:] if name in conditioned.ALGEBRAS]:
        whole = TABLE.read_text(encoding="utf-8")
        first, heading, _ = conditioned.introduction().partition("\n")
        kept, _, before = whole.partition(first + heading)
        each = conditioned.measurements(POINTS, fused=fused, algebras=algebras)
        parts = [conditioned.introduction(), conditioned.table(each, before) + "\n"]
        TABLE.write_text(kept + "\n".join(parts), encoding="utf-8")
        return
    found = measurements(POINTS, fused=fused)
    if "--json" in sys.argv[1:]:
        json.dump([m.__dict__ for m in found], sys.stdout, indent=1)
        return
    each = conditioned.measurements(POINTS, fused=fused)
    parts = [introduction(POINTS), table(found) + "\n"]
    parts += [conditioned.introduction(), conditioned.table(each) + "\n"]
    TABLE.write_text("\n".join(parts), encoding="utf-8")
    print(TABLE.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
