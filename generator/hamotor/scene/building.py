"""Scenes from Python: bodies whose words are Python objects, and a Hamiltonian made of them.

ball = hamotor.body("cga3", "Sim3")
H = ball.momentum.e12**2 + hamotor.language.norm_squared(ball.P) / 2 + (ball.scale - 1) ** 2
run = hamotor.from_hamiltonian(H, [ball], momenta=[{"e12": 0.3}], end=10, step=0.01).run()
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import sympy

from hamotor.codegen import bundled_algebra
from hamotor.errors import UsageError, suggest
from hamotor.mechanics import language
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.evaluation import momentum_of_rates
from hamotor.mechanics.hamiltonian import Hamiltonian
from hamotor.mechanics.language import Body, Record, Vocabulary
from hamotor.mechanics.vocabulary import Speaker, vocabulary
from hamotor.scene.exact import of_mpmath
from hamotor.scene.general import GeneralBody, GeneralScene, exact, unit_deviation
from hamotor.scene.groups import groups_in
from hamotor.scene.model import Output, Time

UNIT_TOLERANCE = 1e-6


class BodyWords:
    """What an expression may say of one body, as attributes: `P`, `Pi`, `scale`, `momentum.e12`,
    `at(0, 0, 0.1)`. The same objects that text in a scene stands for."""

    def __init__(self, coordinates: Coordinates) -> None:
        self.coordinates = coordinates
        self._words: Vocabulary = vocabulary([Speaker(coordinates)], {})

    def __getattr__(self, name: str) -> Any:
        words = self._words
        if name in words.values and name != "t":
            return words.values[name]
        if name not in words.functions:
            known = sorted({*words.functions, *words.values} - {"t"})
            raise AttributeError(
                f'a body on {self.coordinates.group.name} has no "{name}"; it has'
                f" {', '.join(known)}.{suggest(name, known)}"
            )
        function = words.functions[name]
        body = Body(self.coordinates.body)
        if len(function.arguments) == 1:
            value = function(name, [body])
            return SimpleNamespace(**value.fields) if isinstance(value, Record) else value
        return lambda *given: function(name, [body, *map(_value, given)])


def _value(given: Any) -> Any:
    return given if isinstance(given, language.Vector) else language.scalar(given)


def body(algebra: str, group: str, name: str = "body") -> BodyWords:
    """A body on a group of a bundled algebra; bodies of one scene need names of their own."""
    spec = bundled_algebra(algebra)
    groups = {g.name: g for g in spec.groups}
    if group not in groups:
        raise UsageError(
            f'unknown group "{group}"; groups of {algebra} are {", ".join(groups)}.'
            f"{suggest(group, groups)}"
        )
    return BodyWords(Coordinates(name, spec.algebra, groups[group], prefix=f"{name}."))


def general_scene(
    energy: Expr,
    bodies: Sequence[BodyWords],
    *,
    end: float,
    step: float,
    motors: Sequence[Mapping[str, float]] | None = None,
    momenta: Sequence[Mapping[str, float]] | None = None,
    rates: Sequence[Mapping[str, float]] | None = None,
    parameters: Mapping[Expr, float] | None = None,
    name: str = "scene",
) -> GeneralScene:
    """The scene of this Hamiltonian, J.

    motors: components of each M by blade, at the origin if not given. momenta or rates: components
    by generator, physical, body frame, at rest if neither is given. parameters: symbols of `energy`
    with their values; `language.scalar` and SymPy symbols may be mixed. end, step: s.
    UsageError for what does not fit.
    """
    coordinates = tuple(words.coordinates for words in bodies)
    if len({c.body for c in coordinates}) < len(coordinates) or not coordinates:
        raise UsageError("from_hamiltonian needs bodies, each with a name of its own")
    first = coordinates[0]
    values = {s: language.scalar(x) for s, x in (parameters or {}).items()}
    hamiltonian = Hamiltonian(coordinates, language.scalar(energy), values)
    blades = [c.name for c in first.group.element.components]
    generators = [g.name for g in first.group.generators]
    at = [_row(m, blades, {"s": 1.0}) for m in motors or [{"s": 1.0}] * len(bodies)]
    for c, motor in zip(coordinates, at, strict=True):
        if (deviation := unit_deviation(c, motor)) > UNIT_TOLERANCE:
            raise UsageError(f"the motor of {c.body} is not unit: M M~ − 1 has {deviation:.3g}")
    if momenta is not None and rates is not None:
        raise UsageError("give momenta or rates, not both")
    if momenta is None:
        moving = [_row(r, generators, {}) for r in rates or [{}] * len(bodies)]
        found = momentum_of_rates(hamiltonian, list(map(exact, at)), list(map(exact, moving)))
        given = tuple(tuple(map(of_mpmath, momentum)) for momentum in found)
    else:
        given = tuple(_row(m, generators, {}) for m in momenta)
    spec = bundled_algebra(first.algebra.name)
    unknown = hamiltonian.energy.free_symbols - _symbols(coordinates) - set(values)
    if unknown:
        raise UsageError(f"no value for {', '.join(sorted(map(str, unknown)))}: give parameters")
    return GeneralScene(
        name=name,
        description="",
        algebra=first.algebra.name,
        group=next(g for g in groups_in(spec) if g.name == first.group.name),
        bodies=tuple(
            GeneralBody(c.body, c, motor, momentum, None)
            for c, motor, momentum in zip(coordinates, at, given, strict=True)
        ),
        hamiltonian=hamiltonian,
        lagrangian=None,
        potential=Hamiltonian(coordinates, sympy.Integer(0)),
        acting=(f"H = {hamiltonian.energy}",),
        time=Time(end=end, step=step, tolerance=None, method="auto"),
        output=Output(every=1),
        sha256=hashlib.sha256(str(hamiltonian.energy).encode()).hexdigest(),
    )


def _row(
    given: Mapping[str, float], names: Sequence[str], default: Mapping[str, float]
) -> tuple[float, ...]:
    for key in given:
        if key not in names:
            raise UsageError(
                f'unknown component "{key}"; there are {", ".join(names)}.{suggest(key, names)}'
            )
    return tuple(float(given.get(name, 0.0 if given else default.get(name, 0.0))) for name in names)


def _symbols(bodies: Sequence[Coordinates]) -> set[Expr]:
    from hamotor.mechanics.hamiltonian import TIME

    known = {TIME}
    for c in bodies:
        known |= {*c.momenta, *c.variables, *(y for point in c.points for y in point.symbols)}
    return known
