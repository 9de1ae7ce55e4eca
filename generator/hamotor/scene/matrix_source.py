"""The C++ source of a scene in the classical matrix form (R, x, Π, P), without motors.

Written apart from `general_source`, so that the two check each other: H as a function of matrices
is differentiated with respect to their entries, and the equations of motion stand in the runtime's
`matrix_form.hpp`. Bodies are in the user's body frames.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import sympy

from hamotor.codegen import cpp
from hamotor.codegen.program import Number, Program
from hamotor.errors import UsageError
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.hamiltonian import TIME, Hamiltonian
from hamotor.mechanics.straightline import straight_line
from hamotor.scene.general import GeneralScene
from hamotor.scene.general_source import (
    ProgramText,
    conserved_by,
    conserved_entry,
    has_column,
    motor_unit,
)
from hamotor.scene.model import Scene
from hamotor.scene.scalars import parse_scalar
from hamotor.scene.source import rendered, shortened, text_literal

Expr = Any

LAYOUTS = {
    3: (("s", "e23", "e31", "e12"), ("e0{0}", "e{0}i"), ("e0123", "e123i")),
    2: (("s", "e12"), ("e0{0}", "e{0}i"), ()),
}
"""Components of a motor by the dimension of space: rotor; translation, projective and conformal;
what is left."""


def matrix_source(scene: Scene | GeneralScene, scalar: str) -> str:
    """The text of the C++ file that defines `scene` in matrices over the runtime's headers.

    UsageError where the group or the Hamiltonian has no matrix form.
    """
    invariants = conserved_by(scene)
    scene = scene if isinstance(scene, GeneralScene) else scene.general
    form = _MatrixForm(scene.name, scene.hamiltonian)
    own = [(q, x) for q, x in invariants if x is not None and not has_column(scene, q.name)]
    quantities = ProgramText(form.program({f"value{k}": x for k, (_, x) in enumerate(own)}))
    return rendered(
        "matrix_scene.cpp.jinja",
        scene=scene,
        scalar=parse_scalar(scalar).cpp,
        hamiltonian=shortened(str(scene.hamiltonian.energy)),
        dimension=form.dimension,
        translates=form.translates,
        bodies=[text_literal(body.name) for body in scene.bodies],
        blades=[text_literal(name) for name in scene.group.motor],
        generators=[text_literal(name) for name in scene.group.generators],
        has_potential=form.has("R") or form.has("x"),
        has_applied=form.has("applied"),
        energy=ProgramText(form.program({"value": form.energy})),
        gradient=ProgramText(form.gradient),
        assignments=[(name, cpp.expression_text(value)) for name, value in form.gradient.outputs],
        power=None
        if scene.hamiltonian.conservative
        else ProgramText(form.program({"value": form.power})),
        motor_units=[text_literal(motor_unit(scene, blade)) for blade in scene.group.motor],
        momentum_units=[text_literal(unit) for unit in scene.group.units],
        place_names=[text_literal(f"position.{axis}") for axis in "xyz"[: form.dimension]],
        place_units=[text_literal("m")] * form.dimension,
        fixed_points=[
            [cpp.number_text(Fraction(int(x.p), int(x.q))) for x in body.origin]
            for body in scene.hamiltonian.bodies
            if not form.translates
        ],
        quantities={"count": len(own), "program": quantities} if own else None,
        conserved=[conserved_entry(scene, q, own) for q, _ in invariants],
    )


@dataclass(frozen=True)
class _MatrixForm:
    """H as a function of R, x, Π and P."""

    scene: str
    hamiltonian: Hamiltonian

    def __post_init__(self) -> None:
        body = self.hamiltonian.bodies[0]
        if not _has_matrix_form(body):
            raise UsageError(
                f"{self.scene}: {body.group.name} has no matrix form (R, x, Π, P); it is for SE(3),"
                " SO(3) and SE(2). Leave out --representation matrix."
            )
        motors = {s for b in self.hamiltonian.bodies for s in b.motor}
        held = self.hamiltonian.energy.free_symbols & motors
        if held:
            raise UsageError(
                f"{self.scene}: H holds the motor's component {min(s.name for s in held)}, which no"
                " function of (R, x, Π, P) is: a motor and its negative are one rotation."
                " Leave out --representation matrix."
            )

    @property
    def dimension(self) -> int:
        """Of space."""
        return self.hamiltonian.bodies[0].dimension

    @property
    def translates(self) -> bool:
        """Whether bodies have x and P."""
        return self.hamiltonian.bodies[0].space.translates

    def _folded(self, x: Expr) -> Expr:
        values = self.hamiltonian.parameters
        return sympy.sympify(x).subs(dict(values)) if values else x

    @cached_property
    def energy(self) -> Expr:
        """H, parameters folded in."""
        return self._folded(self.hamiltonian.energy)

    @cached_property
    def power(self) -> Expr:
        """dH/dt = ∂H/∂t − applied · rates, W."""
        total = sympy.diff(self.energy, TIME)
        for body, applied in zip(self.hamiltonian.bodies, self.hamiltonian.applied, strict=False):
            for momentum, forque in zip(body.momenta, applied, strict=True):
                total -= self._folded(forque) * sympy.diff(self.energy, momentum)
        return total

    @cached_property
    def names(self) -> dict[Expr, str]:
        """What comes from outside."""
        names: dict[Expr, str] = {TIME: "t"}
        for k, body in enumerate(self.hamiltonian.bodies):
            size = range(self.dimension)
            names |= {body.rotation[i][j]: f"b{k}.R({i}, {j})" for i in size for j in size}
            for position, symbol in enumerate(body.momenta):
                names[symbol] = f"b{k}.{self._slot('pi', 'p', position)}"
            if self.translates:
                names |= {s: f"b{k}.x({i})" for i, s in enumerate(body.position)}
        return names

    def _slot(self, angular: str, linear: str, position: int) -> str:
        turning = 3 if self.dimension == 3 else 1
        if position < turning:
            return f"{angular}({position})"
        return f"{linear}({position - turning})"

    @cached_property
    def places(self) -> list[tuple[Expr, str, Expr]]:
        """Points of the bodies, y = x + R a."""
        found: list[tuple[Expr, str, Expr]] = []
        for k, body in enumerate(self.hamiltonian.bodies):
            at = body.position if self.translates else body.origin
            for point in body.points:
                if self.translates and not any(point.place):
                    continue
                for symbol, x, row in zip(point.symbols, at, body.rotation, strict=True):
                    moved = x + sum(r * a for r, a in zip(row, point.place, strict=True))
                    found.append((symbol, f"{symbol.name.removeprefix(body.prefix)}_{k}", moved))
        return found

    def program(
        self, outputs: Mapping[str, Expr], between: Sequence[tuple[Expr, str, Expr]] = ()
    ) -> Program:
        """A program for functions of the state and the time."""
        folded = {name: self._folded(x) for name, x in outputs.items()}
        definitions = [(s, name, self._folded(x)) for s, name, x in [*self.places, *between]]
        return straight_line(folded, self.names, definitions)

    @cached_property
    def gradient(self) -> Program:
        """∂H/∂(R, x, Π, P) and what is applied: outputs `[k].R(i, j)`, `[k].x(i)`, …."""
        outputs: dict[str, Expr] = {}
        slopes: list[tuple[Expr, str, Expr]] = []
        size = range(self.dimension)
        for k, body in enumerate(self.hamiltonian.bodies):
            at_points = []
            for n, point in enumerate(body.points):
                if not self.energy.free_symbols & set(point.symbols):
                    continue
                symbols = tuple(sympy.Symbol(f"_slope{k}_{n}_{i}", real=True) for i in size)
                for axis, slope, y in zip("xyz", symbols, point.symbols, strict=False):
                    slopes.append((slope, f"slope{n}{axis}_{k}", sympy.diff(self.energy, y)))
                at_points.append((point.place, symbols))
            for i in size:
                for j in size:
                    outputs[f"[{k}].R({i}, {j})"] = sympy.diff(
                        self.energy, body.rotation[i][j]
                    ) + sum(slope[i] * place[j] for place, slope in at_points)
            if self.translates:
                for i in size:
                    outputs[f"[{k}].x({i})"] = sum(
                        (slope[i] for _, slope in at_points), sympy.Integer(0)
                    )
            for position, symbol in enumerate(body.momenta):
                outputs[f"[{k}].{self._slot('pi', 'p', position)}"] = sympy.diff(
                    self.energy, symbol
                )
            applied = self.hamiltonian.applied[k] if self.hamiltonian.applied else ()
            for position, forque in enumerate(applied):
                outputs[f"[{k}].{self._slot('applied_pi', 'applied_p', position)}"] = forque
        return self.program(outputs, slopes)

    def has(self, part: str) -> bool:
        """Whether a part of the gradient is anything but zero."""
        return any(
            f"].{part}" in name and value != Number(0) for name, value in self.gradient.outputs
        )


def _has_matrix_form(body: Coordinates) -> bool:
    """Whether the group is SE(3), SO(3) or SE(2), with its components in the usual order."""
    space, d = body.space, body.dimension
    if d not in LAYOUTS or space.scales or not space.affine:
        return False
    rotor, ideal, rest = LAYOUTS[d]
    names = tuple(c.name for c in body.group.element.components)
    allowed = [rotor]
    if space.translates:
        allowed = [
            (*rotor, *(form.format(i + 1) for i in range(d)), *([rest[n]] if rest else []))
            for n, form in enumerate(ideal)
        ]
    planes = [(1, 2), (2, 0), (0, 1)] if d == 3 else [(0, 1)]
    turns = [
        tuple(
            tuple(1 if (j, i) == plane else -1 if (i, j) == plane else 0 for j in range(d))
            for i in range(d)
        )
        for plane in planes
    ]
    still = (0,) * d
    flat = tuple((0,) * d for _ in range(d))
    moves = [tuple(int(i == j) for j in range(d)) for i in range(d)] if space.translates else []
    return (
        names in allowed
        and list(space.turns) == [*turns, *(flat for _ in moves)]
        and list(space.velocities) == [*(still for _ in turns), *moves]
    )
