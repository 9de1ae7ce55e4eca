"""A Lagrangian as straight-line programs, for systems that find their rates by Newton's method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy

from hamotor.codegen.cpp import expression_text, used_names
from hamotor.codegen.program import Program
from hamotor.mechanics.coordinates import Expr
from hamotor.mechanics.hamiltonian import TIME
from hamotor.mechanics.lagrangian import Lagrangian
from hamotor.mechanics.system import System


@dataclass(frozen=True)
class LagrangianSystem:
    """The programs of a Lagrangian, its parameters folded in.

    In C++ the motor and the rates of body k are `m{k}` and `w{k}`, time is `t`; what calls them is
    `LegendreSystem` of the runtime.
    """

    lagrangian: Lagrangian

    @cached_property
    def _of_function(self) -> _RateSystem:
        return _RateSystem(self.lagrangian.at_fixed_rates)

    @cached_property
    def value(self) -> Program:
        """L, J."""
        return self._of_function.program({"value": self.lagrangian.function})

    @cached_property
    def derivatives(self) -> Program:
        """∂L/∂B and half of ∂²L/∂B²: outputs `momentum{i}` and `hessian{i}.{j}`, j ≤ i."""
        lagrangian = self.lagrangian
        outputs = {f"momentum{i}": x for i, x in enumerate(lagrangian.momenta)}
        outputs |= {
            f"hessian{i}.{j}": lagrangian.hessian[i][j]
            for i in range(len(lagrangian.rates))
            for j in range(i + 1)
        }
        return self._of_function.program(outputs)

    @cached_property
    def forque(self) -> Program:
        """F = −dL of every body and what is applied: outputs `forque{k}.NAME`."""
        return self._of_function.forque

    @property
    def has_forque(self) -> bool:
        """Whether anything acts."""
        fixed = self.lagrangian.at_fixed_rates
        return any(x != 0 for forque in fixed.all_forques for x in forque)

    @cached_property
    def power(self) -> Program | None:
        """dH/dt = −∂L/∂t − Σ F_applied(B), W; None where it is zero."""
        lagrangian = self.lagrangian
        total = -sympy.diff(lagrangian.function, TIME)
        for body, applied in zip(lagrangian.bodies, lagrangian.applied, strict=False):
            total -= sum(f * b for f, b in zip(applied, body.rates, strict=True))
        return self._of_function.program({"value": total}) if total != 0 else None

    def template_values(self) -> dict[str, Any]:
        """What `templates/lagrangian.cpp.jinja` renders."""
        size = range(len(self.lagrangian.rates))
        derivatives = _texts(self.derivatives)
        outputs = derivatives["outputs"]
        return {
            "lagrangian": {
                "bodies": len(self.lagrangian.bodies),
                "size": len(size),
                "value": _texts(self.value),
                "derivatives": derivatives
                | {
                    "momentum": [outputs[f"momentum{i}"] for i in size],
                    "hessian": [
                        [outputs[f"hessian{max(i, j)}.{min(i, j)}"] for j in size] for i in size
                    ],
                },
                "forque": _texts(self.forque)
                | {
                    "bodies": [
                        [
                            _texts(self.forque)["outputs"][f"forque{k}.{g.momentum}"]
                            for g in body.group.generators
                        ]
                        for k, body in enumerate(self.lagrangian.bodies)
                    ]
                },
                "has_forque": self.has_forque,
                "power": None if self.power is None else _texts(self.power),
            }
        }


class _RateSystem(System):
    """The programs of −L: rates come from outside as well."""

    @cached_property
    def names(self) -> dict[Expr, str]:
        """What comes from outside."""
        names = {TIME: "t"}
        for k, body in enumerate(self.hamiltonian.bodies):
            components = body.group.element.components
            names |= {s: f"m{k}.{c.name}" for s, c in zip(body.motor, components, strict=True)}
            generators = body.group.generators
            names |= {s: f"w{k}.{g.rate}" for s, g in zip(body.rates, generators, strict=True)}
        return names

    def program(self, outputs: Mapping[str, Expr]) -> Program:
        """A program over the same places."""
        return self._program(outputs)


def _texts(program: Program) -> dict[str, Any]:
    return {
        "cost": str(program.cost),
        "used": used_names(program),
        "lines": [f"const S {name} = {expression_text(x)};" for name, x in program.bindings],
        "outputs": {name: expression_text(x) for name, x in program.outputs},
    }
