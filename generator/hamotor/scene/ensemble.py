"""From the tables of a scene's [ensemble] to `draws.Ensemble`.  Every mistake is one UsageError."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from hamotor.codegen.algebra import Algebra
from hamotor.codegen.group import LieGroup
from hamotor.errors import suggest
from hamotor.scene import schema
from hamotor.scene.draws import BodyDraws, Draw, Ensemble, ParameterDraw, Turn
from hamotor.scene.general import product
from hamotor.scene.motors import Matrix, Vector, unit
from hamotor.scene.table import Table, kind_of, listed, quoted


@dataclass(frozen=True)
class Start:
    """A body of the scene as it starts without draws."""

    name: str
    algebra: Algebra
    group: LieGroup
    motor: Vector
    momentum: Vector
    rate: Vector | None
    """None where momenta are not K times rates."""
    kinetic: Matrix
    position: Vector | None
    """m; None where the file gives a motor."""
    scale: float | None


def read_ensemble(
    top: Table,
    started: Callable[[], Sequence[Start]],
    parameters: tuple[ParameterDraw, ...] = (),
) -> Ensemble:
    """The scene's [ensemble].  Every mistake is a UsageError that names the key."""
    table = top.table("ensemble", schema.ENSEMBLE, heading=True)
    tables = table.tables("body")
    starts = started() if tables else ()
    names = [start.name for start in starts]
    bodies = []
    seen: dict[str, int] = {}
    for number, values in enumerate(tables, 1):
        place = f"[[ensemble.body]] {number}"
        body = Table(top.file, place, values, schema.ENSEMBLE_BODY, top.group)
        body.refuse_unknown_keys()
        name = body.name("name")
        if name not in names:
            body.fail(
                f"unknown body {quoted(name)}; bodies are {listed(names)}.{suggest(name, names)}"
            )
        if name in seen:
            body.fail(f'"{name}" is the body of [[ensemble.body]] {seen[name]} already', "name")
        seen[name] = number
        if set(values) == {"name"}:
            allowed = [key for key in body.section.names(top.group) if key != "name"]
            body.fail(f"draws nothing; give at least one of {listed(allowed)}")
        index = names.index(name)
        size = sum(len(s.motor) + len(s.momentum) for s in starts[:index])
        bodies.append(_body(body, starts[index], size))
    return Ensemble(
        seed=table.integer("seed"),
        bodies=tuple(bodies),
        parameters=parameters,
        keep=table.wholes("keep"),
        quantiles=table.fractions("quantiles"),
        final_states=table.flag("final_states"),
    )


@dataclass(frozen=True)
class Wanted:
    """A parameter that the file wants drawn."""

    table: Table
    interaction: int
    """From 1; 0 for a parameter of [hamiltonian] or [lagrangian]."""
    name: str

    @property
    def symbol(self) -> str:
        """How the energy calls it."""
        return f"{self.interaction}.{self.name}" if self.interaction else self.name


def wanted_parameters(top: Table) -> list[Wanted]:
    """What [[ensemble.parameter]] names, before it is known whether there is any such."""
    given = top.values.get("ensemble", {})
    tables = given.get("parameter", []) if isinstance(given, dict) else []
    if not tables:
        return []
    found: list[Wanted] = []
    outer = top.table("ensemble", schema.ENSEMBLE, heading=True)
    for number, values in enumerate(outer.tables("parameter"), 1):
        place = f"[[ensemble.parameter]] {number}"
        table = Table(top.file, place, values, schema.ENSEMBLE_PARAMETER, top.group)
        table.refuse_unknown_keys()
        interaction = table.integer("interaction") if table.has("interaction") else 0
        one = Wanted(table, interaction, table.name("name"))
        if one.symbol in [other.symbol for other in found]:
            table.fail(f"{quoted(one.symbol)} is drawn already", "name")
        found.append(one)
    return found


def parameter_draws(
    wanted: Sequence[Wanted], known: Mapping[str, float]
) -> tuple[ParameterDraw, ...]:
    """The draws of parameters that the energy has, with their values in the scene."""
    found = []
    for one in wanted:
        if one.symbol not in known:
            start = f"{one.interaction}." if one.interaction else ""
            names = [n.removeprefix(start) for n in known if n.startswith(start)]
            names = [name for name in names if "." not in name]
            where = f"interaction {one.interaction}" if one.interaction else "the energy"
            one.table.fail(
                f"{where} has no parameter {quoted(one.name)}; it has {listed(names) or 'none'}."
                f"{suggest(one.name, names)}",
                "name",
            )
        own = known[one.symbol]
        draw = _distribution(one.table, "distribution", 1, (0.0,))
        given = one.table.values["distribution"]
        if draw.shape == "normal" and "mean" not in given:
            draw = Draw("normal", (own,), draw.second)
        found.append(ParameterDraw(one.symbol, draw))
    return tuple(found)


def _body(table: Table, start: Start, first: int) -> BodyDraws:
    group = table.group
    place = growth = turn = None
    if table.has("position"):
        place = _distribution(table, "position", group.dimension, start.position)
    if table.has("orientation"):
        turn = _turn(table)
    if table.has("scale"):
        growth = _growth(table, start)
    momenta, rates = _momenta(table, start), _rates(table, start)
    if momenta and rates:
        table.fail('"momentum" and velocities contradict each other; give one')
    moved = bool(place or turn or growth)
    return BodyDraws(
        motor=first,
        momentum=first + len(start.motor),
        terms=_terms(table, start, bool(place), bool(turn), bool(growth)) if moved else (),
        place=place,
        turn=turn,
        growth=growth,
        momenta=momenta,
        rates=rates,
        kinetic=start.kinetic if rates else (),
    )


def _distribution(table: Table, key: str, size: int, own: Vector | None) -> Draw:
    """The distribution under `key`, as one of the change of the scene's `own` value."""
    given = table.table(key, schema.DISTRIBUTION)
    kinds = [k for k in (("mean", "sd"), ("low", "high"), ("values",)) if any(map(given.has, k))]
    if len(kinds) != 1:
        given.fail(
            "give sd (and mean) for a normal distribution, low and high for a uniform one, or"
            f" values{', and not several of them' if kinds else ''}"
        )
    relative = kinds[0][0] == "mean" and not given.has("mean")
    if own is None and not relative:
        given.fail("is relative to a value that the scene does not give; give sd alone")
    zero = own or (0.0,) * size
    if kinds[0] == ("values",):
        rows = given.vectors("values", size)
        return Draw("values", values=tuple(_minus(row, zero) for row in rows))
    if relative:
        return Draw("normal", (0.0,) * size, _spread(given, size))
    if kinds[0][0] == "mean":
        return Draw("normal", _minus(_vector(given, "mean", size), zero), _spread(given, size))
    low, high = _vector(given, "low", size), _vector(given, "high", size)
    if any(a > b for a, b in zip(low, high, strict=True)):
        given.fail("must not be above high", "low")
    return Draw("uniform", _minus(low, zero), _minus(high, zero))


def _minus(a: Vector, b: Vector) -> Vector:
    return tuple(float(x) - float(y) for x, y in zip(a, b, strict=True))


def _vector(table: Table, key: str, size: int) -> Vector:
    if size == 1:
        return (float(table.number(key)),)
    return tuple(map(float, table.numbers(key, size, "one for each component")))


def _spread(table: Table, size: int) -> Vector:
    """A standard deviation for each component: one number is for all."""
    alone = not isinstance(table.values.get("sd", []), list)
    sd = (float(table.number("sd")),) * size if alone else _vector(table, "sd", size)
    if any(x < 0 for x in sd):
        table.fail("must not be negative", "sd")
    return sd


def _turn(table: Table) -> Turn:
    group = table.group
    if group.dimension not in {2, 3}:
        table.fail(f"{group.name}: rotations are drawn in two and three dimensions", "orientation")
    planar = group.dimension == 2
    given = table.table("orientation", schema.TURN)
    if given.flag("uniform"):
        if len(given.values) > 1:
            given.fail('"uniform" stands alone: all orientations alike')
        count = 2 if planar else 4
        return Turn("all", Draw("normal", (0.0,) * count, (1.0,) * count))
    ranged = given.has("low") or given.has("high")
    if ranged == given.has("sd"):
        given.fail("give uniform = true, sd, or low and high of an angle; one of them")
    if not planar and not given.has("axis"):
        if ranged:
            given.fail('missing "axis", about which the angle from low to high is')
        return Turn("vector", Draw("normal", (0.0,) * 3, _spread(given, 3)))
    axis: Vector = ()
    if not planar:
        axis = tuple(map(float, given.vector("axis")))
        if not any(axis):
            given.fail("must not be zero", "axis")
        axis = tuple(map(float, unit(axis)))
    if not ranged:
        return Turn("axis", Draw("normal", (0.0,), _spread(given, 1)), axis)
    low, high = given.number("low"), given.number("high")
    if low > high:
        given.fail("must not be above high", "low")
    return Turn("axis", Draw("uniform", (float(low),), (float(high),)), axis)


def _growth(table: Table, start: Start) -> Draw:
    own = start.scale
    if own is None:
        table.fail('is for bodies that are given by position, not by "motor"', "scale")
    draw = _distribution(table, "scale", 1, (own,))
    if draw.shape != "normal" and min((*draw.first, *(x for v in draw.values for x in v))) <= -own:
        table.fail("must be positive", "scale")

    def ratio(vector: Vector) -> Vector:
        return tuple(x / own for x in vector)

    return Draw(draw.shape, ratio(draw.first), ratio(draw.second), tuple(map(ratio, draw.values)))


def _parts(table: Table) -> dict[str, tuple[int, int]]:
    """Where angular and linear components stand in a rate or momentum: first, count."""
    group = table.group
    if group.rotations != (1 if group.dimension == 2 else 3):
        return {}
    parts = {"angular": (0, group.rotations)}
    if group.translates:
        parts["linear"] = (group.rotations, group.dimension)
    return parts


def _momenta(table: Table, start: Start) -> tuple[tuple[int, Draw], ...]:
    if not table.has("momentum"):
        return ()
    given = table.values["momentum"]
    if not isinstance(given, dict):
        table.fail(f"must be a table, not {kind_of(given)}", "momentum")
    parts = _parts(table)
    components = {name: (k, 1) for k, name in enumerate(table.group.generators)}
    known = {**parts, **components}
    found = []
    section = schema.Section(
        "momentum",
        "a drawn momentum",
        tuple(schema.Key(name, "distribution", "") for name in known),
    )
    inner = table.table("momentum", section)
    taken: set[int] = set()
    for name in given:
        first, count = known[name]
        if taken & set(range(first, first + count)):
            inner.fail("is given twice", name)
        taken |= set(range(first, first + count))
        own = start.momentum[first : first + count]
        found.append((first, _distribution(inner, name, count, tuple(map(float, own)))))
    if not found:
        inner.fail(f"draws nothing; give at least one of {listed(known)}")
    return tuple(found)


def _rates(table: Table, start: Start) -> tuple[tuple[int, Draw], ...]:
    found = []
    parts = _parts(table)
    for key, part in (("angular_velocity", "angular"), ("velocity", "linear")):
        if not table.has(key):
            continue
        if part not in parts:
            table.fail(f"{table.group.name}: give momentum by generators instead", key)
        if start.rate is None:
            table.fail("the momentum here is not K times the rate; give momentum instead", key)
        first, count = parts[part]
        own = tuple(map(float, start.rate[first : first + count]))
        found.append((first, _distribution(table, key, count, own)))
    return tuple(found)


def _terms(
    table: Table, start: Start, moves: bool, turns: bool, grows: bool
) -> tuple[tuple[int, int, int, int, float], ...]:
    """The components of T M R S over those of T, R and S; UsageError where the group has none."""
    from hamotor.mechanics.space import Space

    algebra, group = start.algebra, start.group
    space = Space.of(algebra, group)
    element = group.element
    motor: dict[int, float] = {}
    for x, component in zip(start.motor, element.components, strict=True):
        for blade, y in component.embedding.items():
            motor[blade] = motor.get(blade, 0.0) + float(x) * float(y)
    one = {0: 1.0}
    translations: list[dict[int, float]] = [one]
    if moves:
        assert space.origin is not None
        other = space.origin if space.at_infinity is None else space.at_infinity
        # T = 1 − ½ x_i e0∧e_i, in the null basis 1 − ½ x_i e_i∧e∞ (theory of `general.motor_of`).
        translations += [{1 << d | 1 << other: -0.5} for d in space.directions]
    rotors: list[dict[int, float]] = [one]
    if turns:
        for name in ("e12",) if len(space.directions) == 2 else ("e23", "e31", "e12"):
            blade, sign = algebra.parse_blade(name)
            rotors.append({blade: float(sign)})
    growths: list[dict[int, float]] = [one]
    if grows:
        assert space.origin is not None
        assert space.at_infinity is not None
        growths.append({1 << space.origin | 1 << space.at_infinity: 1.0})
    found = []
    for i, t in enumerate(translations):
        for j, r in enumerate(rotors):
            for l, s in enumerate(growths):
                whole = product(algebra, product(algebra, product(algebra, t, motor), r), s)
                size = max(1.0, *map(abs, whole.values()))
                for k, reading in enumerate(element.reading):
                    c = sum(float(y) * whole.get(blade, 0.0) for blade, y in reading.items())
                    if c:
                        found.append((k, i, j, l, c))
                    for blade, y in element.components[k].embedding.items():
                        whole[blade] = whole.get(blade, 0.0) - c * float(y)
                if any(abs(x) > 1e-12 * size for x in whole.values()):
                    table.fail(f"{table.group.name} does not hold the motions that are drawn")
    return tuple(sorted(found))
