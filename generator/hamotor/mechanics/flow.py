"""The motion of a system as an ordinary differential equation in coordinates of our choice.

Ṁ = M B and μ̇ = ad*_B μ − F, whose solution Taylor methods expand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy

from hamotor.codegen.program import Program
from hamotor.mechanics.coordinates import Expr
from hamotor.mechanics.hamiltonian import TIME, coadjoint
from hamotor.mechanics.straightline import straight_line
from hamotor.mechanics.system import Definition, System

WORK = "work"
"""The coordinate that is ∫ dH/dt dt."""


@dataclass(frozen=True)
class Flow:
    """ẋ = f(x) for coordinates x of the bodies' motors and momenta.

    field: outputs are named like the coordinates, which are all that it reads.
    enter: from `m{k}.NAME`, `mu{k}.NAME` and `t` to `x[i]`, the coordinates in their order.
    leave: from `x[i]` back to `m{k}.NAME` and `mu{k}.NAME`.
    parts: which coordinates are compared with each other when an error is said to be small; one
        number for those of a kind, −1 for time and work.
    """

    field: Program
    enter: Program
    leave: Program
    parts: tuple[int, ...]

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The names of x."""
        return tuple(name for name, _ in self.field.outputs)


def motor_flow(system: System) -> Flow:
    """In the components of motors and momenta, for any group and any H; time and work where H
    knows them."""
    h = system.hamiltonian
    outputs: dict[str, Expr] = {}
    kinds: list[tuple[int, str, int] | None] = []
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
        turning = coadjoint(body, symbols)
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
        _numbered(kinds),
    )


def _symbol_of(system: System, name: str) -> Expr:
    if name == WORK:
        return sympy.Integer(0)
    return next(symbol for symbol, text in system.names.items() if text == name)


def _length(blade: str) -> int:
    """The power of a length that a blade carries: e0 of a projective, e∞ of a conformal algebra."""
    return blade.count("0") - blade.count("i")


def _numbered(kinds: list[tuple[int, str, int] | None]) -> tuple[int, ...]:
    known: Mapping[tuple[int, str, int], int] = {
        kind: i for i, kind in enumerate(dict.fromkeys(k for k in kinds if k is not None))
    }
    return tuple(-1 if kind is None else known[kind] for kind in kinds)
