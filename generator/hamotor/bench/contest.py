"""Who is measured in `bench precision`, with which settings, and what a measurement is."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from hamotor.run.library import in_decimals

GIVEN = "equations generated from the scene"
"""The representation of public solvers where no equations are written for them by hand."""


@dataclass(frozen=True)
class Form:
    """How a scene is compiled; a public solver has a representation of its own, or `GIVEN`."""

    kernels: str = "generated"
    representation: str = "ga"
    algebra: str = ""
    """"": the scene's own."""
    scalar: str = "double"

    @property
    def label(self) -> str:
        """What distinguishes it from generated kernels of the scene's algebra in double."""
        words = (self.kernels, self.representation, self.algebra, self.scalar)
        usual = {"generated", "ga", "", "double", "own", GIVEN}
        return ", ".join(w for w in words if w not in usual)


OWN = Form()


@dataclass(frozen=True)
class Contestant:
    """A method, or a public solver, on one problem with all its settings, coarse to fine."""

    problem: str
    name: str
    family: str
    """hamotor, or the public solver's package."""
    compiler: str
    kind: str
    """Who times it: scene, or one of `MAKERS` of the peers."""
    settings: Sequence[Any]
    longest_s: float
    form: Form = OWN
    options: str = ""
    """Of a public solver that is measured with several: which."""
    fixed_steps: bool = False
    """Of a public solver: whether its settings are numbers of steps."""
    said: Mapping[str, Any] = field(default_factory=dict)
    """What the stopwatch needs to know."""
    counted: Any = None
    """Of ours: the same compiled with numbers that count, a `SceneLibrary`; None: not counted."""

    @property
    def label(self) -> str:
        """Form and options."""
        return ", ".join(filter(None, (self.form.label, self.options)))

    @property
    def is_ours(self) -> bool:
        """Whether it is a method of Hamotor."""
        return self.family == "hamotor"


@dataclass(frozen=True)
class Row:
    """One setting of one contestant.  Times in µs for the whole integration."""

    problem: str
    contestant: str
    family: str
    form: str
    compiler: str
    kernels: str
    representation: str
    algebra: str
    scalar: str
    setting: float
    """The step, s, or the tolerance."""
    setting_is: str
    best_us: float | None = None
    median_us: float | None = None
    worst_us: float | None = None
    cpu_us: float | None = None
    """The least time that the thread had the processor."""
    runs: int = 0
    steps: int | None = None
    evaluations: int | None = None
    """Of rates or forques; a Taylor series of order p counts as p."""
    operations: int | None = None
    """Additions, products, quotients, roots and functions, of the scalar."""
    per_step: Mapping[str, float] = field(default_factory=dict)
    """Operations of a step, by kind."""
    set_up_s: float = 0.0
    errors: Mapping[str, float] = field(default_factory=dict)
    failure: str | None = None


@dataclass(frozen=True)
class Extent:
    """How much is measured."""

    rounds: int
    rungs: float
    """Ratio of the steps of neighbouring settings; of tolerances its fourth power."""
    longest_s: float
    enough_s: float
    forms: bool
    compilers: Sequence[str]
    drift: int = 0
    """Steps of the long runs; 0: none."""
    longest_run_s: float = 10.0
    """That one of them may take; what would take longer takes fewer steps."""
    counted: bool = False
    """Whether operations are counted."""
    methods: Sequence[str] = ()
    """The only ones; all if empty."""


def step_ladder(end: float, rungs: float) -> list[dict[str, Any]]:
    """Steps, coarse to fine, as a scene's library takes them, each `rungs` times the next."""
    counts: list[int] = []
    size = 1.0
    while size < 1e7:
        if not counts or round(size) > counts[-1]:
            counts.append(round(size))
        size *= rungs
    return [
        {"calls": n, "step": end / n, "digits": in_decimals(Fraction(end) / n), "tolerance": 0.0}
        for n in counts
    ]


def tolerances(extent: Extent, finest: float) -> list[float]:
    """Tolerances, coarse to fine."""
    found = [1e-2]
    while (finer := found[-1] / extent.rungs**4) > finest:
        found.append(finer)
    return found


def wide_tolerances(digits: int) -> list[float]:
    """Those of a scalar that has more than a double, coarse to fine."""
    return [10.0**-k for k in range(8, digits - 2, 2)]


@contextmanager
def environment(**changes: str) -> Iterator[None]:
    """These variables of the environment while the block runs."""
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
