"""A Hamiltonian as straight-line programs: what a system of the runtime computes in a step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import sympy

from hamotor.codegen.program import Program
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.hamiltonian import TIME, Hamiltonian, coadjoint, inertial
from hamotor.mechanics.straightline import straight_line

Definition = tuple[Expr, str, Expr]
"""A symbol, the name it is bound to in C++, and what it stands for."""


@dataclass(frozen=True)
class System:
    """The programs of a Hamiltonian, its parameters folded in.

    In C++ the motor and the momentum of body k are `m{k}` and `mu{k}`, time is `t`.
    """

    hamiltonian: Hamiltonian
    drawn: tuple[Expr, ...] = ()
    """Parameters that stay variables, `parameters[0]` and so on."""

    @cached_property
    def names(self) -> dict[Expr, str]:
        """What comes from outside."""
        names = {TIME: "t"}
        names |= {symbol: f"parameters[{k}]" for k, symbol in enumerate(self.drawn)}
        for k, body in enumerate(self.hamiltonian.bodies):
            components = body.group.element.components
            names |= {s: f"m{k}.{c.name}" for s, c in zip(body.motor, components, strict=True)}
            generators = body.group.generators
            names |= {
                s: f"mu{k}.{g.momentum}" for s, g in zip(body.momenta, generators, strict=True)
            }
        return names

    @cached_property
    def places(self) -> list[Definition]:
        """Where the bodies are: R, s, x and their points."""
        return [
            stage
            for k, body in enumerate(self.hamiltonian.bodies)
            for stage in self.stages_of(body, k)
        ]

    def stages_of(self, body: Coordinates, k: int) -> list[Definition]:
        """Where body k is, in the components of its motor."""
        found: list[Definition] = [
            (v.symbol, self._name(v.symbol, body, k), v.definition) for v in body.frame_variables
        ]
        for point in body.points:
            definition = body.definition(point)
            found += [
                (symbol, self._name(symbol, body, k), expression)
                for symbol, expression in zip(point.symbols, definition, strict=True)
            ]
        return found

    @staticmethod
    def _name(symbol: Expr, body: Coordinates, k: int) -> str:
        return f"{symbol.name.removeprefix(body.prefix)}_{k}"

    @cached_property
    def values(self) -> dict[Expr, Expr]:
        """The parameters that are numbers."""
        return {s: x for s, x in self.hamiltonian.parameters.items() if s not in self.drawn}

    def _program(
        self, outputs: Mapping[str, Expr], between: list[Definition] | None = None
    ) -> Program:
        known = {name: folded(x, self.values) for name, x in outputs.items()}
        stages = [*self.places, *(between or [])]
        definitions = [(s, name, folded(x, self.values)) for s, name, x in stages]
        return straight_line(known, self.names, definitions)

    def of(self, outputs: Mapping[str, Expr], between: Sequence[Definition] = ()) -> Program:
        """A program for other functions of the state and the time.

        between: what else they are written in, besides where the bodies are.
        """
        return self._program(outputs, list(between))

    @cached_property
    def energy(self) -> Program:
        """H, J."""
        return self._program({"value": self.hamiltonian.energy})

    @cached_property
    def power(self) -> Program:
        """dH/dt, W."""
        return self._program({"value": self.hamiltonian.power})

    @cached_property
    def gradient(self) -> Program:
        """B and F of every body: outputs `rate{k}.NAME` and `forque{k}.NAME`."""
        return self._program(self._rates | self.forques, self.pulls)

    @cached_property
    def rate(self) -> Program:
        """B of every body: outputs `rate{k}.NAME`."""
        return self._program(self._rates)

    @cached_property
    def forque(self) -> Program:
        """F of every body: outputs `forque{k}.NAME`."""
        return self._program(self.forques, self.pulls)

    @cached_property
    def inertial(self) -> Program | None:
        """ad*_B μ of every body without what cancels in it, in its rates `rate{k}.NAME` and its
        momenta: outputs `inertial{k}.NAME`.  None where nothing does."""
        h = self.hamiltonian
        outputs: dict[str, Expr] = {}
        names, cancels = dict(self.names), False
        for k, (body, rates) in enumerate(zip(h.bodies, h.rates, strict=True)):
            generators = body.group.generators
            symbols = tuple(sympy.Symbol(f"_rate{k}_{g.rate}", real=True) for g in generators)
            names |= {s: f"rate{k}.{g.rate}" for s, g in zip(symbols, generators, strict=True)}
            left = inertial(body, symbols, rates)
            cancels |= left != coadjoint(body, symbols)
            outputs |= {
                f"inertial{k}.{g.momentum}": x for g, x in zip(generators, left, strict=True)
            }
        return straight_line(outputs, names) if cancels else None

    @cached_property
    def _rates(self) -> dict[str, Expr]:
        h = self.hamiltonian
        return {
            f"rate{k}.{g.rate}": rate
            for k, (body, rates) in enumerate(zip(h.bodies, h.rates, strict=True))
            for g, rate in zip(body.group.generators, rates, strict=True)
        }

    @cached_property
    def pulls(self) -> list[Definition]:
        """Gradients at points, in the world and then in the body frame."""
        found: list[Definition] = []
        for k, body in enumerate(self.hamiltonian.bodies):
            for n, (_, gradient) in enumerate(self.hamiltonian.gradients(body), 1):
                world = gradient_symbols(body, k, n, "world")
                found += [
                    (symbol, f"gradient{n}{axis}_{k}", x)
                    for symbol, axis, x in zip(world, "xyzw", gradient, strict=False)
                ]
                pulled = body.pulled_back(world)
                found += [
                    (symbol, f"pull{n}{axis}_{k}", x)
                    for symbol, axis, x in zip(
                        gradient_symbols(body, k, n, "body"), "xyzw", pulled, strict=False
                    )
                ]
        return found

    @cached_property
    def forques(self) -> dict[str, Expr]:
        """F of every body, in what `pulls` define: `forque{k}.NAME`."""
        h = self.hamiltonian
        outputs = {}
        for k, body in enumerate(h.bodies):
            slopes, gradients = h.slopes(body), h.gradients(body)
            for i, generator in enumerate(body.group.generators):
                total = sum((slope * v.variation[i] for v, slope in slopes), sympy.Integer(0))
                for n, (point, _) in enumerate(gradients, 1):
                    pulled = gradient_symbols(body, k, n, "body")
                    total += sum(v * g for v, g in zip(point.velocities[i], pulled, strict=True))
                if h.applied:
                    total += h.applied[k][i]
                outputs[f"forque{k}.{generator.momentum}"] = total
        return outputs


def gradient_symbols(body: Coordinates, k: int, n: int, frame: str) -> tuple[Expr, ...]:
    """The gradient at the n-th point that H holds, in `world` or pulled back to the `body`."""
    return tuple(
        sympy.Symbol(f"_{frame}{k}_{n}_{axis}", real=True) for axis in range(body.dimension)
    )


def folded(expression: Expr, values: Mapping[Expr, Expr]) -> Expr:
    """The expression with these symbols as numbers."""
    held = {s: x for s, x in values.items() if s in expression.free_symbols}
    return expression.subs(held) if held else expression
