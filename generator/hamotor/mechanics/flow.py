"""The motion of a system as an ordinary differential equation in coordinates of our choice.

Ṁ = M B and μ̇ = ad*_B μ − F, whose solution Taylor methods expand.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass

import sympy

from hamotor.codegen.algebra import Blade, Rational
from hamotor.codegen.program import Program
from hamotor.codegen.taylor import PACK, Quadratic, Recurrence, quadratic, recurrence
from hamotor.mechanics.body_frame import BodyFrame, Rewriting, Unsuitable
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.hamiltonian import TIME, Hamiltonian, inertial
from hamotor.mechanics.straightline import straight_line
from hamotor.mechanics.system import Definition, System, folded, gradient_symbols

WORK = "work"
"""The coordinate that is ∫ dH/dt dt."""
Kind = tuple[int, str, int]

_PER_CALL = 10
_PER_COORDINATE = 8
"""Operations that a function, and what a stepper does with a coordinate, weigh in a choice."""


@dataclass(frozen=True)
class Flow:
    """ẋ = f(x) for coordinates x of the bodies' motors and momenta.

    field: outputs are named like the coordinates, which are all that it reads.
    enter: from `m{k}.NAME`, `mu{k}.NAME` and `t` to `x[i]`, the coordinates in their order.
    leave: from `x[i]` back to `m{k}.NAME` and `mu{k}.NAME`.
    refresh: from `x[i]` to those `x[i]` that follow from others and stand last.
    kinds: body, "motor", "momentum" or "place", and power of a length: which coordinates are
        compared with each other when an error is said to be small; None for time and work.
    """

    field: Program
    enter: Program
    leave: Program
    refresh: Program
    kinds: tuple[Kind | None, ...]
    independent: int
    """How many coordinates stand before those of `refresh`."""

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The names of x."""
        return tuple(name for name, _ in self.field.outputs)

    @property
    def parts(self) -> tuple[int, ...]:
        """A number for those of a kind, −1 for time and work."""
        known = {kind: i for i, kind in enumerate(dict.fromkeys(filter(None, self.kinds)))}
        return tuple(-1 if kind is None else known[kind] for kind in self.kinds)


def cheapest(system: System) -> tuple[Flow, Recurrence, Quadratic | None]:
    """The flow whose recurrence is the least work, that recurrence, and its field if that is
    quadratic and less work in packs."""
    found: list[tuple[Flow, Recurrence, Quadratic | None]] = []
    for flow in rigid_flows(system) or [motor_flow(system)]:
        r = recurrence(flow.field)
        found.append((flow, r, None))
        packed = quadratic(r)
        if packed is not None:
            found.append((flow, r, packed))

    def work(choice: tuple[Flow, Recurrence, Quadratic | None]) -> int:
        # In the time of one sum: a node of its own costs more, a pack of linear terms half of one
        # of products.
        _, r, packed = choice
        if packed is None:
            return 3 * len(r.lanes)
        linear = len(packed.fixed) + len(packed.linear) + packed.packs
        return PACK * len(packed.products) + PACK // 2 * linear

    return min(found, key=work)


def leanest(system: System) -> tuple[str, Flow]:
    """The flow whose field has the fewest operations, and what its coordinates are."""
    found = [("motors and momenta", motor_flow(system))]
    with suppress(Unsuitable):
        about = "rotors, momenta, and places seen from the body"
        found.append((about, body_flow(system, rows=False)))
    with suppress(Unsuitable):
        about = "rotors, angular momenta, and places and linear momenta in the world"
        found.append((about, world_flow(system)))

    def work(choice: tuple[str, Flow]) -> int:
        _, flow = choice
        cost = flow.field.cost
        calls = sum(cost.calls.values())
        return cost.total + _PER_CALL * calls + _PER_COORDINATE * len(flow.coordinates)

    return min(found, key=work)


def flows(system: System) -> list[Flow]:
    """The coordinates that there are for the motion."""
    return [motor_flow(system), *rigid_flows(system)]


def rigid_flows(system: System) -> list[Flow]:
    """Those for rigid motions, which are never more work than motors; none for other systems."""
    found: list[Flow] = []
    with suppress(Unsuitable):
        found += [body_flow(system, rows=rows) for rows in (True, False)]
    with suppress(Unsuitable):
        found.append(world_flow(system))
    return found


def motor_flow(system: System) -> Flow:
    """In the components of motors and momenta, for any group and any H; time and work where H
    knows them."""
    h = system.hamiltonian
    outputs: dict[str, Expr] = {}
    kinds: list[Kind | None] = []
    definitions: list[Definition] = list(system.pulls)
    for k, (body, rates) in enumerate(zip(h.bodies, h.rates, strict=True)):
        generators = body.group.generators
        symbols = tuple(sympy.Symbol(f"_rate{k}_{g.rate}", real=True) for g in generators)
        definitions += [
            (symbol, f"rate{k}_{g.rate}", rate)
            for symbol, g, rate in zip(symbols, generators, rates, strict=True)
        ]
        for variable, c in zip(body.motor_variables, body.group.element.components, strict=True):
            outputs[system.names[variable.symbol]] = sum(
                (b * x for b, x in zip(symbols, variable.variation, strict=True)), sympy.Integer(0)
            )
            kinds.append((k, "motor", _length(c.name)))
        turning = inertial(body, symbols, rates)
        for g, momentum, c in zip(generators, body.momenta, turning, strict=True):
            outputs[system.names[momentum]] = c - system.forques[f"forque{k}.{g.momentum}"]
            kinds.append((k, "momentum", _length(g.name)))
    if not h.conservative:
        outputs[system.names[TIME]] = sympy.Integer(1)
        outputs[WORK] = h.power
        kinds += [None, None]
    entered = {f"x[{i}]": _symbol_of(system, name) for i, name in enumerate(outputs)}
    back = {
        name: sympy.Symbol(f"_x{i}", real=True)
        for i, name in enumerate(outputs)
        if name not in {"t", WORK}
    }
    return Flow(
        system.of(outputs, definitions),
        straight_line(entered, system.names),
        straight_line(back, {x: f"x[{i}]" for i, x in enumerate(back.values())}),
        Program((), (), (), None),
        tuple(kinds),
        len(outputs),
    )


def body_flow(system: System, *, rows: bool) -> Flow:
    """In rotors, momenta and vectors seen from the bodies; for rigid motions.

    rows: what of R is needed are coordinates of their own; otherwise polynomials of the rotor.
    Unsuitable for other groups, and where bodies see each other.
    """
    h = system.hamiltonian
    first = [BodyFrame(body, k, _origin(body)) for k, body in enumerate(h.bodies)]
    energy = folded(h.energy, h.parameters)
    Rewriting(first)(energy)
    frames = [
        BodyFrame(f.body, f.number, f.centers.most_common(1)[0][0])
        if f.centers and f.body.space.translates
        else BodyFrame(f.body, f.number, f.origin)
        for f in first
    ]
    rewritten = Rewriting(frames)
    energy = rewritten(energy)
    applied = [[rewritten(folded(x, h.parameters)) for x in forque] for forque in h.applied]

    motion: dict[Expr, Expr] = {}
    places: list[Definition] = [d for frame in frames for d in frame.definitions]
    rates: list[Definition] = []
    power = sympy.diff(energy, TIME)
    kinds: dict[Expr, Kind | None] = {}
    for frame in frames:
        body, k = frame.body, frame.number
        b = tuple(sympy.Symbol(f"_rate{k}_{g.rate}", real=True) for g in body.group.generators)
        slopes_of_h = tuple(sympy.diff(energy, p) for p in body.momenta)
        rates += [
            (s, f"rate{k}_{g.rate}", slope)
            for s, g, slope in zip(b, body.group.generators, slopes_of_h, strict=True)
        ]
        held = [s for s in frame.variations if s in energy.free_symbols]
        slopes = [(sympy.diff(energy, s), frame.variations[s]) for s in held]
        turning = inertial(body, b, slopes_of_h)
        for variable, c in zip(body.motor_variables, body.group.element.components, strict=True):
            if not _length(c.name):
                motion[variable.symbol] = _dot(b, variable.variation)
                kinds[variable.symbol] = k, "motor", 0
        for i, (momentum, g) in enumerate(zip(body.momenta, body.group.generators, strict=True)):
            forque = sympy.Add(*(slope * variation[i] for slope, variation in slopes))
            if applied:
                forque += applied[k][i]
                power -= applied[k][i] * b[i]
            motion[momentum] = turning[i] - forque
            kinds[momentum] = k, "momentum", _length(g.name)
        for x in frame.place:
            if x != 0:
                motion[x] = _dot(b, frame.variations[x])
                kinds[x] = k, "place", 1
    if not h.conservative:
        motion[TIME], motion[_WORK] = sympy.Integer(1), power
        kinds[TIME] = kinds[_WORK] = None
    independent = list(motion)
    rotations: list[Definition] = [
        (v.symbol, f"{v.symbol.name.removeprefix(f.body.prefix)}_{f.number}", v.definition)
        for f in frames
        for v in f.body.frame_variables
    ]
    if rows:
        used = _needed(motion.values(), [*places, *rates])
        for frame in frames:
            b = tuple(s for s, _, _ in rates if s.name.startswith(f"_rate{frame.number}_"))
            for row in frame.body.rotation:
                for r in row if used & set(row) else ():
                    motion[r] = _dot(b, frame.variations[r])
                    kinds[r] = frame.number, "motor", 0
    names = _names(system, motion, rotations)
    indexed = {s: f"x[{i}]" for i, s in enumerate(motion)}
    definitions = [d for d in [*rotations, *places, *rates] if d[0] not in motion]
    follows = {indexed[s]: x for s, _, x in rotations if s in motion}
    return Flow(
        straight_line({names[s]: x for s, x in motion.items()}, names, definitions),
        _entering(system, frames, motion, rotations),
        straight_line(_left(system, frames), indexed),
        straight_line(follows, indexed),
        tuple(kinds[s] for s in motion),
        len(independent),
    )


def world_flow(system: System) -> Flow:
    """In rotors, angular momenta and the world's x and p = R P; for rigid motions of bodies whose
    velocity is a multiple of P, also of bodies that see each other.

    ẋ = P/m and ṗ = f have no products. Unsuitable for other groups, other kinetic energies, and
    where forques are applied.
    """
    h = system.hamiltonian
    if h.applied or not h.autonomous:
        raise Unsuitable("applied forques")
    motion: dict[Expr, Expr] = {}
    kinds: dict[Expr, Kind | None] = {}
    names: dict[Expr, str] = {}
    places: list[Definition] = []
    rates: list[Definition] = []
    back: dict[str, Expr] = {}
    entered: dict[Expr, Expr] = {}
    rotations: list[Definition] = []
    for k, body in enumerate(h.bodies):
        space, generators = body.space, body.group.generators
        if not space.affine or space.scales or not space.translates:
            raise Unsuitable(f"{body.group.name} is no group of rigid motions")
        d = range(body.dimension)
        x, p = body.position, tuple(sympy.Symbol(f"_p{k}_{j}", real=True) for j in d)
        moves = [any(v) for v in space.velocities]
        mass = _mass_of(h, k, moves)
        held = h.energy.free_symbols & set(body.motor)
        if held:
            raise Unsuitable("components of motors")
        turned = [(v.symbol, f"R{k}_{n}", v.definition) for n, v in enumerate(body.frame_variables)]
        rotations += turned
        places += turned
        for n, point in enumerate(body.points):
            if any(point.place):
                offset = body.turned(point.place)
                places += [
                    (s, f"y{n}{'xyzw'[j]}_{k}", x[j] + offset[j])
                    for j, s in enumerate(point.symbols)
                ]
        b = tuple(sympy.Symbol(f"_rate{k}_{g.rate}", real=True) for g in generators)
        rates += [
            (s, f"rate{k}_{g.rate}", folded(rate, h.parameters))
            for s, g, rate, moving in zip(b, generators, h.rates[k], moves, strict=True)
            if not moving
        ]
        still = {s: sympy.Integer(0) for s, moving in zip(b, moves, strict=True) if moving}
        for variable, c in zip(body.motor_variables, body.group.element.components, strict=True):
            if not _length(c.name):
                motion[variable.symbol] = _dot(b, variable.variation).subs(still)
                kinds[variable.symbol] = k, "motor", 0
        turning = inertial(body, b, h.rates[k])
        for i, (momentum, g) in enumerate(zip(body.momenta, generators, strict=True)):
            if not moves[i]:
                motion[momentum] = turning[i] - system.forques[f"forque{k}.{g.momentum}"]
                kinds[momentum] = k, "momentum", 0
        forces = [sympy.Integer(0) for _ in d]
        for n, _ in enumerate(h.gradients(body), 1):
            for j, s in enumerate(gradient_symbols(body, k, n, "world")):
                forces[j] -= s
        for j in d:
            motion[x[j]], kinds[x[j]] = p[j] / mass, (k, "place", 1)
            motion[p[j]], kinds[p[j]] = forces[j], (k, "momentum", 1)
            names |= {x[j]: f"x{k}_{j}", p[j]: f"p{k}_{j}"}
        linear = _momentum_of(body)
        entered |= dict(zip(x, body.origin, strict=True))
        entered |= dict(zip(p, body.turned(linear), strict=True))
        seen = dict(zip(linear, body.turned_back(p), strict=True))
        frame = BodyFrame(body, k, x)
        left = _left(system, [frame], (sympy.Integer(0),) * body.dimension)
        back |= {name: value.subs(seen) for name, value in left.items()}
    pulls = [(s, name, folded(value, h.parameters)) for s, name, value in system.pulls]
    motion = {s: folded(value, h.parameters) for s, value in motion.items()}
    names |= {s: system.names[s] for s in motion if s not in names}
    indexed = {s: f"x[{i}]" for i, s in enumerate(motion)}
    return Flow(
        straight_line({names[s]: x for s, x in motion.items()}, names, [*places, *pulls, *rates]),
        straight_line(
            {f"x[{i}]": entered.get(s, s) for i, s in enumerate(motion)}, system.names, rotations
        ),
        straight_line(back, indexed, rotations),
        Program((), (), (), None),
        tuple(kinds[s] for s in motion),
        len(motion),
    )


def _mass_of(h: Hamiltonian, k: int, moves: list[bool]) -> Expr:
    """m of V = P/m."""
    body = h.bodies[k]
    pairs = [
        (folded(rate, h.parameters), p)
        for rate, p, moving in zip(h.rates[k], body.momenta, moves, strict=True)
        if moving
    ]
    inverse = {sympy.expand(rate / p) for rate, p in pairs}
    (found, *others) = inverse
    linear = {p for _, p in pairs}
    turning = [r for r, moving in zip(h.rates[k], moves, strict=True) if not moving]
    if others or not found.is_Rational or any(r.free_symbols & linear for r in turning):
        raise Unsuitable("V is no multiple of P")
    return 1 / found


def _momentum_of(body: Coordinates) -> tuple[Expr, ...]:
    """P, by the world's directions."""
    return tuple(
        sympy.Add(
            *(_exact(v[j]) * m for v, m in zip(body.space.velocities, body.momenta, strict=True))
        )
        for j in range(body.dimension)
    )


_WORK = sympy.Symbol("_work", real=True)


def _origin(body: Coordinates) -> tuple[Expr, ...]:
    return body.origin if not body.space.translates else (sympy.Integer(0),) * body.dimension


def _dot(a: Iterable[Expr], b: Iterable[Expr]) -> Expr:
    return sympy.Add(*(x * y for x, y in zip(a, b, strict=True)))


def _needed(wanted: Iterable[Expr], definitions: list[Definition]) -> set[Expr]:
    """The symbols that the expressions hold, through definitions."""
    found = {s for x in wanted for s in x.free_symbols}
    for symbol, _, x in reversed(definitions):
        if symbol in found:
            found |= x.free_symbols
    return found


def _names(system: System, motion: Iterable[Expr], rotations: list[Definition]) -> dict[Expr, str]:
    rows = {s: name for s, name, _ in rotations}

    def name(s: Expr) -> str:
        if s is _WORK:
            return WORK
        return system.names.get(s) or rows.get(s) or s.name.removeprefix("_")

    return {s: name(s) for s in motion}


def _entering(
    system: System,
    frames: list[BodyFrame],
    motion: Iterable[Expr],
    rotations: list[Definition],
) -> Program:
    """The coordinates of a state: X = Rᵀ(x − o)."""
    seen: dict[Expr, Expr] = {_WORK: sympy.Integer(0)}
    for frame in frames:
        if frame.body.space.translates:
            offset = [x - o for x, o in zip(frame.body.origin, frame.origin, strict=True)]
            seen |= dict(zip(frame.place, frame.seen(offset), strict=True))
    outputs = {f"x[{i}]": seen.get(s, s) for i, s in enumerate(motion)}
    return straight_line(outputs, system.names, rotations)


def _left(
    system: System, frames: list[BodyFrame], seen_at: tuple[Expr, ...] | None = None
) -> dict[str, Expr]:
    """M = T(o) R T(X), T(v) = 1 + Σ v_i E_i, in the coordinates; and momenta as they are.

    seen_at: X, if it is not the frame's own.
    """
    outputs: dict[str, Expr] = {}
    for frame in frames:
        body = frame.body
        rotor: dict[Blade, Expr] = {}
        for symbol, c in zip(body.motor, body.group.element.components, strict=True):
            if not _length(c.name):
                for blade, x in c.embedding.items():
                    rotor[blade] = rotor.get(blade, 0) + symbol * _exact(x)
        place = frame.place if seen_at is None else seen_at
        there, seen = _translator(body, frame.origin), _translator(body, place)
        motor = _product(body, _product(body, there, rotor), seen)
        for symbol, reading in zip(body.motor, body.group.element.reading, strict=True):
            outputs[system.names[symbol]] = sympy.Add(
                *(_exact(x) * motor.get(blade, 0) for blade, x in reading.items())
            )
        outputs |= {system.names[p]: p for p in body.momenta}
    return outputs


def _translator(body: Coordinates, v: tuple[Expr, ...]) -> dict[Blade, Expr]:
    total: dict[Blade, Expr] = {0: sympy.Integer(1)}
    if not body.space.translates:
        return total
    for g, velocity in zip(body.group.generators, body.space.velocities, strict=True):
        for x, y in zip(v, velocity, strict=True):
            for blade, z in g.bivector.items():
                total[blade] = total.get(blade, 0) + x * _exact(y) * _exact(z)
    return total


def _product(
    body: Coordinates, a: Mapping[Blade, Expr], b: Mapping[Blade, Expr]
) -> dict[Blade, Expr]:
    total: dict[Blade, Expr] = {}
    for left, x in a.items():
        for right, y in b.items():
            for blade, z in body.algebra.blade_product(left, right).items():
                total[blade] = total.get(blade, 0) + _exact(z) * x * y
    return total


def _exact(x: Rational) -> Expr:
    return sympy.Rational(x.numerator, x.denominator)


def _symbol_of(system: System, name: str) -> Expr:
    if name == WORK:
        return sympy.Integer(0)
    return next(symbol for symbol, text in system.names.items() if text == name)


def _length(blade: str) -> int:
    """The power of a length that a blade carries: e0 of a projective, e∞ of a conformal algebra."""
    return blade.count("0") - blade.count("i")
