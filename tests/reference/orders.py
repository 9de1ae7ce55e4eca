"""The orders of all methods, observed on every kind of group, free and forced.

`PYTHONPATH=generator .hamotor/venv/bin/python -m tests.reference.orders` measures them and writes
the tables in orders.md.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mpmath

import hamotor
from hamotor.run.build import default_cache, default_includes, find_compiler

SOURCES = Path(__file__).parents[1] / "orders"
TABLE = Path(__file__).with_name("orders.md")
GROUPS = {
    "SE(2)": ("pga2/se2.hpp", "pga2::SE2", 3.0),
    "SE(3)": ("pga3/se3.hpp", "pga3::SE3", 1.0),
    "SE(4)": ("pga4/se4.hpp", "pga4::SE4", 1.5),
    "Sim(3)": ("cga3/sim3.hpp", "cga3::Sim3", 0.8),
    "SO(4,1)": ("cga3/so41.hpp", "cga3::SO41", 0.5),
}
"""Header, group, and a time in s over which errors stand well above rounding."""
SERIES = {
    "SE(2)": "planar",
    "SE(3)": "spring_pendulum",
    "SE(4)": "free4",
    "Sim(3)": "breathing_body",
    "SO(4,1)": "conformal_top",
}
"""Scenes for Taylor series, whose recurrences are a scene's."""
SERIES_TOLERANCE = 1e-6
SERIES_ORDER = 17
"""What that tolerance asks for: 7 + ½ · 20 bits."""


@dataclass(frozen=True)
class Observation:
    """The order that a method has on a system, and the error that it was seen down to."""

    system: str
    method: str
    nominal: int
    observed: float
    error: float

    @property
    def miss(self) -> float:
        """How far the order is from what it should be."""
        return abs(self.observed - self.nominal)


def observed_on(group: str, *, quick: bool = False) -> list[Observation]:
    """H = T + U and H = T on one group of `GROUPS`; quick: three methods."""
    header, name, length = GROUPS[group]
    words = [f'-DHEADER="hamotor/{header}"', f"-DGROUP=hamotor::{name}"]
    libraries = () if quick else ("-lmpfr", "-lgmp")
    return _observations(
        "orders.cpp", [*words, *(["-DQUICK"] if quick else [])], libraries, [str(length)]
    )


def observed_of_rigid_bodies() -> list[Observation]:
    """Splittings and discrete Moser–Veselov steps of bodies whose free motion is known."""
    return _observations("rigid_orders.cpp")


def _observations(
    source: str,
    words: Sequence[str] = (),
    libraries: Sequence[str] = (),
    arguments: Sequence[str] = (),
) -> list[Observation]:
    includes = [f"-I{folder}" for folder in default_includes()]
    flags = ["-std=c++20", "-O1", "-ffp-contract=off", *includes, *words]
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "orders"
        command = [*find_compiler(default_cache()).command, *flags, str(SOURCES / source)]
        subprocess.run([*command, "-o", str(program), "-lquadmath", *libraries], check=True)
        run = subprocess.run([program, *arguments], check=True, capture_output=True, text=True)
    found = []
    for line in run.stdout.splitlines():
        system, method, nominal, observed, error = line.split()
        found.append(
            Observation(
                system.replace("_", " "), method, int(nominal), float(observed), float(error)
            )
        )
    return found


def observed_of_series(group: str) -> Observation:
    """The order of a single polynomial of a Taylor series: its local error goes as h^(p+1)."""
    simulation = hamotor.load(SERIES[group])
    time, error, order = 6.4, 0.0, 0.0
    while True:
        time /= 2
        coarse = simulation.run(
            end=time,
            step=time,
            method="taylor",
            scalar="quad",
            local_tolerance=SERIES_TOLERANCE,
            pictures=False,
        )
        if coarse.report["own_steps"] > 1:
            continue
        fine = simulation.run(end=time, step=time, method="taylor", scalar="quad", pictures=False)
        with mpmath.workdps(40):
            found = float(_distance(coarse.report["final"], fine.report["final"]))
        if found < 1e-29:
            return Observation(group, "taylor", SERIES_ORDER, order, error)
        if error:
            order = float(mpmath.log(error / found, 2)) - 1
        error = found


def _distance(one: Mapping[str, Mapping[str, Mapping[str, str]]], other: object) -> mpmath.mpf:
    assert isinstance(other, Mapping)
    return max(
        abs(mpmath.mpf(x) - mpmath.mpf(other[body][part][name]))
        for body, state in one.items()
        for part in ("motor", "momentum")
        for name, x in state[part].items()
    )


def table(columns: Mapping[str, Sequence[Observation]]) -> str:
    """A row for each method, a column for each system; observed orders."""
    methods = dict.fromkeys((o.method, o.nominal) for found in columns.values() for o in found)
    lines = [f"| method | order | {' | '.join(columns)} |", "|---" * (len(columns) + 2) + "|"]
    for method, nominal in methods:
        cells = []
        for found in columns.values():
            own = [o for o in found if o.method == method]
            cells.append(f"{own[0].observed:.2f}" if own else "")
        lines.append(f"| {method} | {nominal} | {' | '.join(cells)} |")
    return "\n".join(lines)


def by_system(found: Sequence[Observation]) -> dict[str, list[Observation]]:
    """Observations of each system."""
    systems = dict.fromkeys(o.system for o in found)
    return {system: [o for o in found if o.system == system] for system in systems}


INTRODUCTION = """# Observed orders

Written by `PYTHONPATH=generator .hamotor/venv/bin/python -m tests.reference.orders`.

log₂ of the ratio of errors with steps h and h/2 in `__float128` (gauss16: 50 digits), h halved
until the order settles or errors come near rounding, against Gauss collocation of order 16 with
steps far shorter.

The same Hamiltonian on every group: a quadratic kinetic energy that is not diagonal, without and
with a potential.
"""
RIGID = """
Rigid bodies by their exact parts, with gravity and springs where they are forced:
"""
SERIES_TEXT = """
A polynomial of a Taylor series of the order {order} that a local tolerance of {tolerance:g} asks
for, in bundled scenes:
"""


def main() -> None:
    """Measure, and write the tables."""
    columns: dict[str, list[Observation]] = {}
    for group in GROUPS:
        for system, found in by_system(observed_on(group)).items():
            columns[f"{group} {system}"] = found
    series = {group: [observed_of_series(group)] for group in SERIES}
    parts = [
        INTRODUCTION,
        table(columns),
        RIGID,
        table(by_system(observed_of_rigid_bodies())),
        SERIES_TEXT.format(order=SERIES_ORDER, tolerance=SERIES_TOLERANCE),
        table(series),
    ]
    text = "\n".join(parts) + "\n"
    TABLE.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
