"""From the tables of a scene file to a `GeneralScene`. Every mistake is one UsageError."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import Any

import sympy

from hamotor.codegen.algebra import Algebra
from hamotor.codegen.group import LieGroup
from hamotor.errors import UsageError, suggest
from hamotor.mechanics import inertia, interactions
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.evaluation import evaluated, is_real, momentum_of_rates
from hamotor.mechanics.hamiltonian import Hamiltonian
from hamotor.mechanics.lagrangian import Lagrangian, NotHyperregular
from hamotor.mechanics.language import Vector, read_number, read_vector
from hamotor.mechanics.vocabulary import Speaker, vocabulary
from hamotor.scene import schema
from hamotor.scene.ensemble import Start, Wanted, parameter_draws, read_ensemble, wanted_parameters
from hamotor.scene.exact import of_mpmath
from hamotor.scene.general import (
    GeneralBody,
    GeneralScene,
    MassDistribution,
    exact,
    motor_of,
    unit_deviation,
)
from hamotor.scene.groups import Group
from hamotor.scene.invariants import at_the_start
from hamotor.scene.model import Event, Output, Time
from hamotor.scene.table import Table, listed, quoted

UNIT_TOLERANCE = 1e-6
LARGEST_ENERGY = 1e300

MassReader = Callable[[Table], tuple[float, tuple[float, ...], Any]]
"""(mass, centre of mass, tensor about it) of a body's table."""


@dataclass
class _Draft:
    """A body while it is being read."""

    table: Table
    name: str
    coordinates: Coordinates
    motor: tuple[float, ...]
    mass: MassDistribution | None
    kinetic_matrix: Any

    @property
    def kinetic(self) -> Expr | None:
        if self.kinetic_matrix is None:
            return None
        return inertia.kinetic_energy(self.coordinates, self.kinetic_matrix)


@dataclass
class _System:
    """What acts, while it is being read."""

    drafts: Sequence[_Draft]
    energy: Expr = field(default_factory=lambda: sympy.Integer(0))
    potential: Expr = field(default_factory=lambda: sympy.Integer(0))
    lagrangian: Expr = None
    """L, where the scene gives one; `energy` then holds potentials only."""
    parameters: dict[Expr, Expr] = field(default_factory=dict)
    applied: list[list[Expr]] = field(default_factory=list)
    acting: list[str] = field(default_factory=list)
    wanted: Sequence[Wanted] = ()
    """Parameters that members have values of their own of."""

    def draft(self, table: Table, key: str = "body") -> _Draft:
        """The body that a key names."""
        names = [draft.name for draft in self.drafts]
        name = table.name(key)
        if name not in names:
            table.fail(
                f"unknown body {quoted(name)}; bodies are {listed(names)}.{suggest(name, names)}"
            )
        return self.drafts[names.index(name)]

    def add_potential(self, energy: Expr) -> None:
        """Add a potential that the runtime has no formula of its own for."""
        self.energy += energy
        self.potential += energy

    def numbers(self, table: Table, number: int, key: str) -> tuple[Expr, ...]:
        """A vector of an interaction; what of it is drawn by a symbol with this value."""
        values = table.vector(key)
        return tuple(
            self._own(f"{number}.{key}_{axis}", x) for axis, x in zip("xyzw", values, strict=False)
        )

    def number(self, table: Table, number: int, key: str) -> Expr:
        """The same for a number."""
        return self._own(f"{number}.{key}", table.number(key))

    def _own(self, name: str, x: float) -> Expr:
        if name not in [one.symbol for one in self.wanted]:
            return _number(x)
        symbol = sympy.Symbol(name, real=True)
        self.parameters[symbol] = _number(x)
        return symbol

    def apply(self, draft: _Draft, forque: Sequence[Expr]) -> None:
        """Add an applied forque."""
        if not self.applied:
            self.applied = [[sympy.Integer(0)] * len(d.coordinates.momenta) for d in self.drafts]
        k = list(self.drafts).index(draft)
        self.applied[k] = [a + f for a, f in zip(self.applied[k], forque, strict=True)]


def read_general(
    top: Table,
    *,
    name: str,
    algebra: Algebra,
    group: LieGroup,
    contents: bytes,
    headers: tuple[str, ...],
    bodies: Sequence[Mapping[str, Any]],
    acting: Sequence[Mapping[str, Any]],
    orientation: Callable[[Table], tuple[float, ...]],
    mass_distribution: MassReader,
    time: Time,
    output: Output,
) -> GeneralScene:
    """The scene; what rigid scenes read in the same way comes as functions of theirs."""
    view = top.group
    reader = _Reader(algebra, group, view, len(bodies) > 1, orientation, mass_distribution)
    drafts = [reader.draft(top.file, number, values) for number, values in enumerate(bodies, 1)]
    names = [draft.name for draft in drafts]
    for number, body in enumerate(names, 1):
        if body in names[: number - 1]:
            first = names.index(body) + 1
            top.fail(f'body {number}: name: "{body}" is the name of body {first} already')
    system = _System(drafts, wanted=wanted_parameters(top))
    own = next((key for key in ("hamiltonian", "lagrangian") if top.has(key)), None)
    if top.has("hamiltonian") and top.has("lagrangian"):
        top.fail('"hamiltonian" and "lagrangian" contradict each other; give one')
    if own is None:
        for draft in drafts:
            if draft.kinetic is None:
                draft.table.fail(
                    'missing "mass" (or "points", or "kinetic_matrix"): without [hamiltonian] or'
                    " [lagrangian] a body needs a kinetic energy"
                )
            system.energy += draft.kinetic
    elif own == "hamiltonian":
        _hamiltonian(top.table(own, schema.HAMILTONIAN, heading=True), system)
    else:
        _lagrangian(top.table(own, schema.LAGRANGIAN, heading=True), system)
    for number, values in enumerate(acting, 1):
        _interaction(top, number, dict(values), view, system)
    symbols = {symbol.name: symbol for symbol in system.parameters}
    draws = parameter_draws(
        system.wanted, {symbol.name: float(x) for symbol, x in system.parameters.items()}
    )
    coordinates = tuple(draft.coordinates for draft in drafts)
    applied = tuple(tuple(forque) for forque in system.applied)
    lagrangian = None
    if own == "lagrangian":
        function = system.lagrangian - system.energy
        lagrangian = Lagrangian(coordinates, function, system.parameters, applied)
        try:
            lagrangian.require_hyperregular(
                [draft.motor for draft in drafts], [_rates(draft) for draft in drafts]
            )
        except NotHyperregular as error:
            top.fail(f"[lagrangian]: {error}")
        hamiltonian = lagrangian.hamiltonian or lagrangian.at_fixed_rates
        started = _started(top, drafts, lagrangian.momentum_of_rates)
        if lagrangian.hamiltonian is not None:
            lagrangian = None
    else:
        hamiltonian = Hamiltonian(coordinates, system.energy, system.parameters, applied)
        started = _started(top, drafts, partial(momentum_of_rates, hamiltonian))
    if lagrangian is None:
        (energy,) = evaluated([hamiltonian.energy], at_the_start(hamiltonian, started))
        if not is_real([energy]) or abs(energy) > LARGEST_ENERGY:
            top.fail(
                "the energy at the start is no finite number: a body is where H has no value, or"
                " numbers are too large"
            )
    return GeneralScene(
        name=name,
        description=top.text("description"),
        algebra=algebra.name,
        group=view,
        bodies=started,
        hamiltonian=hamiltonian,
        lagrangian=lagrangian,
        potential=Hamiltonian(hamiltonian.bodies, system.potential, system.parameters),
        acting=tuple(system.acting),
        time=time,
        output=output,
        sha256=hashlib.sha256(contents).hexdigest(),
        events=_events(top, system, None if lagrangian else hamiltonian),
        headers=headers,
        drawn=tuple(symbols[one.symbol] for one in system.wanted),
        ensemble=read_ensemble(
            top,
            lambda: _starts(drafts, started, None if lagrangian else hamiltonian),
            draws,
        ),
    )


DIRECTIONS = ("both", "rising", "falling")


def _events(top: Table, system: _System, hamiltonian: Hamiltonian | None) -> tuple[Event, ...]:
    """What the file calls events; of rates only where H gives them."""
    found: list[Event] = []
    for number, values in enumerate(top.tables("event"), 1):
        table = Table(top.file, f"event {number}", values, schema.EVENT, top.group)
        table.refuse_unknown_keys()
        name, text = table.name("name"), table.expression("expression")
        if name in (names := [event.name for event in found]):
            table.fail(f'"{name}" is the name of event {names.index(name) + 1} already', "name")
        speakers = [
            Speaker(
                draft.coordinates,
                None if hamiltonian is None else hamiltonian.rates[k],
                momenta=True,
                kinetic=None if system.lagrangian is not None else draft.kinetic,
            )
            for k, draft in enumerate(system.drafts)
        ]
        own = _System(system.drafts)
        words = _vocabulary(table, speakers, own, f"event{number}.")
        expression = read_number(text, words, f"{top.file}: {table.place}: expression")
        if not expression.free_symbols - set(own.parameters):
            table.fail("must depend on the state or on the time t", "expression")
        found.append(
            Event(
                name=name,
                text=text,
                expression=expression.subs(own.parameters),
                direction=table.choice("direction", DIRECTIONS, "directions"),
                stops=table.flag("stop"),
            )
        )
    return tuple(found)


@dataclass(frozen=True)
class _Reader:
    """What reading a body needs to know of its scene."""

    algebra: Algebra
    group: LieGroup
    view: Group
    several: bool
    orientation: Callable[[Table], tuple[float, ...]]
    mass_distribution: MassReader

    def draft(self, file: str, number: int, values: Mapping[str, Any]) -> _Draft:
        """The body of this table."""
        table = Table(file, f"body {number}", dict(values), schema.GENERAL_BODY, self.view)
        table.refuse_unknown_keys()
        name = table.name("name")
        table = Table(file, f'body {number} "{name}"', table.values, table.section, self.view)
        prefix = f"{name}." if self.several else ""
        pivot = () if self.view.translates else _numbers(table.vector("position"))
        body = Coordinates(name, self.algebra, self.group, prefix, pivot)
        mass = _mass(table, body, self.mass_distribution)
        matrix = _kinetic_matrix(table, body, mass)
        return _Draft(table, name, body, _motor(table, body, self.orientation), mass, matrix)


SHAPES = ("inertia", "box", "ellipsoid", "cylinder", "disk", "points", "second_moments")


def _mass(
    table: Table, body: Coordinates, mass_distribution: MassReader
) -> MassDistribution | None:
    if not any(table.has(key) for key in (*SHAPES, "mass")):
        return None
    if not body.space.affine:
        table.fail(f"{table.group.name} bends straight lines: a mass has no kinetic energy on it")
    if table.has("kinetic_matrix"):
        table.fail('"kinetic_matrix" and "mass" contradict each other; give one')
    if table.has("second_moments") or table.group.dimension == 4:
        for key in SHAPES[:-1]:
            if table.has(key):
                table.fail(f'give "second_moments" instead of "{key}"')
        center = exact(table.vector("center_of_mass"))
        diagonal = exact(table.lengths("second_moments"))
        mass = Fraction(*_ratio(table.number("mass")))
        d = range(len(center))
        moments = tuple(
            tuple(mass * center[i] * center[j] + (diagonal[i] if i == j else 0) for j in d)
            for i in d
        )
        return MassDistribution(mass, center, moments)
    given, at, tensor = mass_distribution(table)
    mass, center = Fraction(*_ratio(given)), exact(at)
    rows = [exact(row) for row in tensor]
    moments = tuple(tuple(row) for row in inertia.second_moments(mass, center, rows))
    points: tuple[tuple[Fraction, tuple[Fraction, ...]], ...] = ()
    if table.has("points"):
        points = tuple(
            (Fraction(*_ratio(p["mass"])), exact(p["at"])) for p in table.tables("points")
        )
    return MassDistribution(mass, center, moments, points)


def _ratio(x: float) -> tuple[int, int]:
    (fraction,) = exact((x,))
    return fraction.numerator, fraction.denominator


def _kinetic_matrix(table: Table, body: Coordinates, mass: MassDistribution | None) -> Any:
    size = len(body.momenta)
    if mass is not None:
        matrix = inertia.kinetic_matrix(body, mass.mass, mass.center, mass.moments)
        what = "the body's masses"
    elif table.has("kinetic_matrix"):
        rows = table.matrix("kinetic_matrix", size)
        matrix = sympy.Matrix([[_number(x) for x in row] for row in rows])
        what = "kinetic_matrix"
        if matrix != matrix.T:
            table.fail("must be symmetric", "kinetic_matrix")
    else:
        return None
    if not matrix.is_positive_definite:
        table.fail(f"{what}: the kinetic energy on {table.group.name} is not positive definite")
    return matrix


def _number(x: float) -> Expr:
    return sympy.Rational(*_ratio(x))


def _numbers(values: Sequence[float]) -> tuple[Expr, ...]:
    return tuple(_number(x) for x in values)


def _motor(
    table: Table, body: Coordinates, orientation: Callable[[Table], tuple[float, ...]]
) -> tuple[float, ...]:
    names = table.group.motor
    if table.has("motor"):
        for key in ("position", "orientation", "scale"):
            if table.has(key) and (key != "position" or table.group.translates):
                table.fail(f'"motor" and "{key}" contradict each other; give one')
        given = table.components("motor", names)
        motor = tuple(given.get(name, 0.0) for name in names)
        if (deviation := unit_deviation(body, motor)) > UNIT_TOLERANCE:
            table.fail(f"must be unit, but M M~ differs from 1 by {deviation:.3g}", "motor")
        return motor
    translates = table.group.translates
    position = table.vector("position") if translates else ()
    scale = table.number("scale") if table.group.scales else 1.0
    turns = table.group.dimension in {2, 3}
    if not turns and (table.has("orientation") or any(position)):
        table.fail(f'{table.group.name}: give "motor" instead of position and orientation')
    rotor = orientation(table) if turns else (1.0, 0.0, 0.0, 0.0)
    found = motor_of(body, position, rotor, scale)
    if found is None:
        table.fail(f"{table.group.name} does not reach this position and orientation")
    return found


def _parameters(table: Table, system: _System, reserved: str) -> dict[str, Any]:
    """Symbols of the table's parameters, their values put into the system."""
    found: dict[str, Any] = {}
    place = "parameters"
    for name, value in table.parameters(place).items():
        several = isinstance(value, tuple)
        values = value if isinstance(value, tuple) else (value,)
        symbols = []
        for axis, x in zip("xyzw", values, strict=False):
            own = f"{name}_{axis}" if several else name
            symbol = sympy.Symbol(reserved + own, real=True)
            if symbol in system.parameters:
                table.fail(f'"{own}" is a number of its own and one of a vector; rename one', place)
            if any(draft.coordinates.has_symbol(symbol.name) for draft in system.drafts):
                table.fail(f'"{own}" is what a coordinate of the body is called; rename it', place)
            system.parameters[symbol] = _number(x)
            symbols.append(symbol)
        found[name] = Vector(tuple(symbols)) if several else symbols[0]
    return found


def _speakers(system: _System, *, rates: bool, momenta: bool) -> list[Speaker]:
    speakers = []
    if system.lagrangian is not None:
        given = [draft.coordinates for draft in system.drafts]
        return [Speaker(body, body.rates if rates else None, momenta=False) for body in given]
    for draft in system.drafts:
        derivative = (
            tuple(sympy.diff(system.energy, p) for p in draft.coordinates.momenta)
            if rates
            else None
        )
        speakers.append(Speaker(draft.coordinates, derivative, momenta, draft.kinetic))
    return speakers


def _hamiltonian(table: Table, system: _System) -> None:
    text = table.expression("expression")
    words = _vocabulary(table, _speakers(system, rates=False, momenta=True), system)
    system.energy += read_number(text, words, f"{table.file}: {table.place}: expression")
    system.acting.append(f"H = {text}")


def _lagrangian(table: Table, system: _System) -> None:
    text = table.expression("expression")
    speakers = [Speaker(d.coordinates, d.coordinates.rates, momenta=False) for d in system.drafts]
    words = _vocabulary(table, speakers, system)
    system.lagrangian = read_number(text, words, f"{table.file}: {table.place}: expression")
    system.acting.append(f"L = {text}")


def _vocabulary(
    table: Table, speakers: Sequence[Speaker], system: _System, reserved: str = ""
) -> Any:
    parameters = _parameters(table, system, reserved)
    try:
        return vocabulary(speakers, parameters)
    except UsageError as error:
        table.fail(str(error))


def _interaction(
    top: Table, number: int, values: dict[str, Any], view: Group, system: _System
) -> None:
    place = f"interaction {number}"
    kinds = tuple(schema.INTERACTIONS)
    kind = Table(top.file, place, values, schema.UNTYPED, view).choice("type", kinds, "types")
    table = Table(top.file, place, values, schema.INTERACTIONS[kind], view)
    table.refuse_unknown_keys()
    if not system.drafts[0].coordinates.space.affine and kind != "potential":
        table.fail(f'"{kind}" needs a group that keeps straight lines, not {view.name}')
    readers = {
        "gravity": _gravity,
        "spring": _spring,
        "potential": _potential,
        "newtonian": _newtonian,
        "dipole": _dipole,
        "force": _force,
        "torque": _torque,
        "damping": _damping,
    }
    readers[kind](table, system, number)


def _gravity(table: Table, system: _System, number: int) -> None:
    field_ = system.numbers(table, number, "acceleration")
    for draft in system.drafts:
        if draft.mass is None:
            table.fail(f'body "{draft.name}" has no mass for gravity to act on')
        system.energy += interactions.uniform_gravity(
            draft.coordinates,
            _rational(draft.mass.mass),
            tuple(map(_rational, draft.mass.center)),
            field_,
        )
    system.acting.append(f"gravity {_shown(table.vector('acceleration'))} m/s^2 on every body")


def _rational(x: Fraction) -> Expr:
    return sympy.Rational(x.numerator, x.denominator)


def _shown(values: Sequence[float]) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in values) + ")"


def _spring(table: Table, system: _System, number: int) -> None:
    draft = system.draft(table)
    near = draft.coordinates.at(_numbers(table.vector("at")))
    if table.one_of("anchor", "other") == "anchor":
        if table.has("other_at"):
            table.fail('"anchor" and "other_at" contradict each other; "other_at" is for "other"')
        far: tuple[Expr, ...] = _numbers(table.vector("anchor"))
        end = f"the point {_shown(table.vector('anchor'))} of the world"
    else:
        other = system.draft(table, "other")
        if other is draft:
            table.fail(f'"{draft.name}" cannot be tied to itself by a spring', "other")
        far = other.coordinates.at(_numbers(table.vector("other_at")))
        end = f"{_shown(table.vector('other_at'))} of {other.name}"
    stiffness, rest = table.number("stiffness"), table.number("rest_length")
    system.energy += interactions.spring(
        near,
        far,
        system.number(table, number, "stiffness"),
        system.number(table, number, "rest_length"),
    )
    system.acting.append(
        f"spring from {_shown(table.vector('at'))} of {draft.name} to {end}, {stiffness:g} N/m,"
        f" rest length {rest:g} m"
    )


def _potential(table: Table, system: _System, number: int) -> None:
    text = table.expression("expression")
    words = _vocabulary(table, _speakers(system, rates=False, momenta=False), system, f"{number}.")
    system.add_potential(read_number(text, words, f"{table.file}: {table.place}: expression"))
    system.acting.append(f"potential {text}")


def _newtonian(table: Table, system: _System, number: int) -> None:
    draft = system.draft(table)
    if table.one_of("center", "other") == "center":
        center = _numbers(table.vector("center"))
        strength = system.number(table, number, "strength")
        system.add_potential(_attracted(table, draft, center, strength))
        system.acting.append(
            f"Newtonian attraction of {draft.name} to {_shown(table.vector('center'))},"
            f" {table.number('strength'):g} m^3/s^2, {_as(draft)}"
        )
        return
    other = system.draft(table, "other")
    if other is draft:
        table.fail(f'"{draft.name}" does not attract itself', "other")
    constant = system.number(table, number, "constant")
    one, two = _weights(table, draft), _weights(table, other)
    energy = interactions.newtonian_of_points(one, two)
    for extended, attracting in ((draft, two), (other, one)):
        if _has_second_moments(extended):
            center, tensor = _center_and_tensor(extended)
            energy -= sum(
                weight * interactions.quadrupole(extended.coordinates, center, tensor, place)
                for weight, place in attracting
            )
    system.add_potential(constant * energy)
    system.acting.append(
        f"Newtonian attraction between {draft.name} and {other.name},"
        f" G = {table.number('constant'):g} m^3/(kg s^2), {draft.name} {_as(draft)},"
        f" {other.name} {_as(other)}"
    )


def _weights(table: Table, draft: _Draft) -> list[tuple[Expr, tuple[Expr, ...]]]:
    if draft.mass is None:
        table.fail(f'body "{draft.name}" has no mass to attract or be attracted')
    points = draft.mass.points or ((draft.mass.mass, draft.mass.center),)
    return [
        (_rational(mass), draft.coordinates.at(tuple(map(_rational, at)))) for mass, at in points
    ]


def _has_second_moments(draft: _Draft) -> bool:
    """Whether it attracts as more than the points in its file: known in space only."""
    return draft.mass is not None and not draft.mass.points and draft.coordinates.dimension == 3


def _as(draft: _Draft) -> str:
    assert draft.mass is not None
    if _has_second_moments(draft):
        return "up to second moments"
    return "point by point" if draft.mass.points else "as a point at its centre of mass"


def _center_and_tensor(draft: _Draft) -> tuple[tuple[Expr, ...], list[tuple[Expr, ...]]]:
    """The centre of mass and J about it: tr S 1 − S of the second moments S about it."""
    assert draft.mass is not None
    mass, center = draft.mass.mass, draft.mass.center
    d = range(len(center))
    about = [[draft.mass.moments[i][j] - mass * center[i] * center[j] for j in d] for i in d]
    trace = sum((about[k][k] for k in d), Fraction(0))
    tensor = [tuple(_rational((trace if i == j else 0) - about[i][j]) for j in d) for i in d]
    return tuple(map(_rational, center)), tensor


def _attracted(table: Table, draft: _Draft, center: Sequence[Expr], strength: Expr) -> Expr:
    if draft.mass is None:
        table.fail(f'body "{draft.name}" has no mass to be attracted')
    if not _has_second_moments(draft):
        weighted = _weights(table, draft)
        return interactions.newtonian_of_points(weighted, [(strength, tuple(center))])
    at, tensor = _center_and_tensor(draft)
    mass = _rational(draft.mass.mass)
    return interactions.newtonian_of_moments(draft.coordinates, mass, at, tensor, center, strength)


def _dipole(table: Table, system: _System, _number_of: int) -> None:
    draft = system.draft(table)
    vectors = [_numbers(table.vector(key)) for key in ("at", "moment", "center", "source")]
    system.add_potential(interactions.dipole(draft.coordinates, *vectors))
    system.acting.append(
        f"dipole {_shown(table.vector('moment'))} A m^2 of {draft.name} in the field of"
        f" {_shown(table.vector('source'))} A m^2 at {_shown(table.vector('center'))}"
    )


def _force(table: Table, system: _System, number: int) -> None:
    draft = system.draft(table)
    words = _vocabulary(table, _speakers(system, rates=True, momenta=True), system, f"{number}.")
    text = table.expression("expression")
    where = f"{table.file}: {table.place}: expression"
    force = tuple(read_vector(text, words, where, table.group.dimension))
    place = _numbers(table.vector("at"))
    system.apply(draft, interactions.force_forque(draft.coordinates, place, force))
    system.acting.append(f"force {text} N at {_shown(table.vector('at'))} of {draft.name}")


def _torque(table: Table, system: _System, number: int) -> None:
    draft = system.draft(table)
    words = _vocabulary(table, _speakers(system, rates=True, momenta=True), system, f"{number}.")
    text = table.expression("expression")
    where = f"{table.file}: {table.place}: expression"
    if table.group.dimension == 2:
        torque: tuple[Expr, ...] = (read_number(text, words, where),)
    elif table.group.dimension == 3:
        torque = tuple(read_vector(text, words, where, 3))
    else:
        table.fail("torques are for two and three dimensions")
    system.apply(draft, interactions.torque_forque(draft.coordinates, torque))
    system.acting.append(f"torque {text} N m on {draft.name}")


def _damping(table: Table, system: _System, number: int) -> None:
    draft = system.draft(table)
    linear, angular = table.number("linear"), table.number("angular")
    rates = draft.coordinates.rates
    if system.lagrangian is None:
        rates = tuple(sympy.diff(system.energy, p) for p in draft.coordinates.momenta)
    forque = interactions.damping_forque(
        draft.coordinates,
        rates,
        system.number(table, number, "linear"),
        system.number(table, number, "angular"),
    )
    system.apply(draft, forque)
    system.acting.append(
        f"damping of {draft.name}, {linear:g} kg/s linear, {angular:g} kg m^2/s angular"
    )


MomentaOfRates = Callable[[Any, Any], tuple[tuple[Any, ...], ...]]


def _started(
    top: Table, drafts: Sequence[_Draft], momenta_of: MomentaOfRates
) -> tuple[GeneralBody, ...]:
    """The bodies with their momenta: as given, or of the rates that are given."""
    given = [_momentum(draft) for draft in drafts]
    rates = [_rates(draft) for draft in drafts]
    if any(momentum is None for momentum in given):
        try:
            found = momenta_of([exact(draft.motor) for draft in drafts], list(map(exact, rates)))
        except UsageError as error:
            top.fail(f"{error}; give momenta")
        given = [
            its_own if its_own is not None else tuple(map(of_mpmath, of_rates))
            for its_own, of_rates in zip(given, found, strict=True)
        ]
    return tuple(
        GeneralBody(
            name=draft.name,
            coordinates=draft.coordinates,
            motor=draft.motor,
            momentum=momentum or (),
            mass=draft.mass,
            kinetic_matrix=draft.kinetic_matrix,
        )
        for draft, momentum in zip(drafts, given, strict=True)
    )


def _starts(
    drafts: Sequence[_Draft], started: Sequence[GeneralBody], hamiltonian: Hamiltonian | None
) -> list[Start]:
    """The bodies as [ensemble] sees them."""
    found = []
    for k, (draft, body) in enumerate(zip(drafts, started, strict=True)):
        table, given = draft.table, not draft.table.has("motor")
        rate = None
        kinetic: tuple[tuple[float, ...], ...] = ()
        if body.kinetic_matrix is not None and hamiltonian is not None:
            inverse = body.kinetic_matrix.inv()
            of_momenta = inverse * sympy.Matrix(body.coordinates.momenta)
            if all(
                sympy.expand(a - b) == 0
                for a, b in zip(hamiltonian.rates[k], of_momenta, strict=True)
            ):
                rate = tuple(map(float, inverse * sympy.Matrix(_numbers(body.momentum))))
                kinetic = tuple(tuple(map(float, row)) for row in body.kinetic_matrix.tolist())
        position = table.vector("position") if table.group.translates and given else None
        found.append(
            Start(
                name=body.name,
                algebra=body.coordinates.algebra,
                group=body.coordinates.group,
                motor=body.motor,
                momentum=body.momentum,
                rate=rate,
                kinetic=kinetic,
                position=position,
                scale=table.number("scale") if table.group.scales and given else None,
            )
        )
    return found


SPEEDS = ("velocity", "angular_velocity")


def _momentum(draft: _Draft) -> tuple[float, ...] | None:
    """μ at the start, if the file gives it."""
    table = draft.table
    given = [key for key in ("momentum", "rate", *SPEEDS) if table.has(key)]
    if len(given) > 1 and given != list(SPEEDS):
        table.fail(f"{' and '.join(map(quoted, given))} contradict each other; give one")
    if given != ["momentum"]:
        return None
    value = table.values["momentum"]
    if isinstance(value, dict) and not set(value) <= {"linear", "angular"}:
        components = table.components("momentum", table.group.generators)
        return tuple(components.get(name, 0.0) for name in table.group.generators)
    split = table.table("momentum", schema.MOMENTUM)
    return _joined(draft, split.rotation("angular"), split, "linear")


def _rates(draft: _Draft) -> tuple[float, ...]:
    """B at the start, zero unless the file gives it."""
    table = draft.table
    if table.has("rate"):
        components = table.components("rate", table.group.generators)
        return tuple(components.get(name, 0.0) for name in table.group.generators)
    if any(table.has(key) for key in SPEEDS):
        return _joined(draft, table.rotation("angular_velocity"), table, "velocity")
    return (0.0,) * len(draft.coordinates.momenta)


def _joined(
    draft: _Draft, angular: tuple[float, ...], table: Table, linear: str
) -> tuple[float, ...]:
    """Rotations and then translations; what else the group has is zero."""
    group = table.group
    if group.rotations not in ((1,) if group.dimension == 2 else (3,)):
        table.fail(
            f"{group.name}: give the components by generators: {', '.join(group.generators)}"
        )
    moving = table.vector(linear) if group.translates else ()
    numbers = (*angular, *moving)
    return (*numbers, *(0.0,) * (len(draft.coordinates.momenta) - len(numbers)))
