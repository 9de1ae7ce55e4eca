"""From a Hamiltonian to the equations of motion, by symbolic differentiation along the group.

Ṁ = M B, μ̇ = ad*_B μ − F_b with B_i = ∂H/∂μ_i and F_b,i = Σ_q (∂H/∂q) δ_i q, at fixed body momentum
(theory.md §2).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import sympy

from hamotor.codegen.group import LieGroup
from hamotor.mechanics.coordinates import Coordinates, Expr, Point, Variable

TIME = sympy.Symbol("t", real=True)
"""Time, s."""


@dataclass(frozen=True)
class Hamiltonian:
    """H and what else acts, over the coordinates of one or several bodies on one group.

    applied: for each body the body forque that no potential has (damping, thrust, control), one
        component a generator, as it stands in μ̇ = ad*_B μ − F: minus the force. () for none.
    parameters: the values of the symbols that H holds besides the bodies' and t.
    """

    bodies: tuple[Coordinates, ...]
    energy: Expr
    parameters: Mapping[Expr, Expr] = field(default_factory=dict)
    applied: tuple[tuple[Expr, ...], ...] = ()

    @property
    def group(self) -> LieGroup:
        """The group all bodies move on."""
        return self.bodies[0].group

    @cached_property
    def rates(self) -> tuple[tuple[Expr, ...], ...]:
        """B = ∂H/∂μ of each body."""
        return tuple(
            tuple(sympy.diff(self.energy, momentum) for momentum in body.momenta)
            for body in self.bodies
        )

    @cached_property
    def forques(self) -> tuple[tuple[Expr, ...], ...]:
        """F_b = dH along M exp(εE_i), of each body; without what is applied."""
        return tuple(self._forque(body) for body in self.bodies)

    def _forque(self, body: Coordinates) -> tuple[Expr, ...]:
        slopes = self.slopes(body)
        total = [
            sympy.Add(*(slope * v.variation[i] for v, slope in slopes))
            for i in range(len(body.momenta))
        ]
        for point, gradient in self.gradients(body):
            pulled = body.pulled_back(gradient)
            for i, velocity in enumerate(point.velocities):
                total[i] += sum(v * g for v, g in zip(velocity, pulled, strict=True))
        return tuple(total)

    def slopes(self, body: Coordinates) -> list[tuple[Variable, Expr]]:
        """∂H/∂q for every variable q of the body that H holds."""
        held = self.energy.free_symbols
        return [
            (v, sympy.diff(self.energy, v.symbol))
            for v in body.variables.values()
            if v.symbol in held
        ]

    def gradients(self, body: Coordinates) -> list[tuple[Point, tuple[Expr, ...]]]:
        """∂H/∂y for every point y of the body that H holds."""
        return [
            (point, tuple(sympy.diff(self.energy, y) for y in point.symbols))
            for point in body.points_in(self.energy.free_symbols)
        ]

    @cached_property
    def spatial_forques(self) -> tuple[tuple[Expr, ...], ...]:
        """F_s = dH along exp(εE_i) M, of each body; without what is applied."""
        return tuple(self._spatial_forque(body) for body in self.bodies)

    def _spatial_forque(self, body: Coordinates) -> tuple[Expr, ...]:
        slopes = self.slopes(body)
        total = [
            sympy.Add(*(slope * v.spatial_variation[i] for v, slope in slopes))
            for i in range(len(body.momenta))
        ]
        for point, gradient in self.gradients(body):
            for i, velocity in enumerate(body.world_velocities_at(point.symbols)):
                total[i] += sum(v * g for v, g in zip(velocity, gradient, strict=True))
        return tuple(total)

    @property
    def all_forques(self) -> tuple[tuple[Expr, ...], ...]:
        """F_b of each body with what is applied."""
        if not self.applied:
            return self.forques
        return tuple(
            tuple(f + a for f, a in zip(forque, applied, strict=True))
            for forque, applied in zip(self.forques, self.applied, strict=True)
        )

    @property
    def momentum_rates(self) -> tuple[tuple[Expr, ...], ...]:
        """μ̇ of each body."""
        return tuple(
            tuple(c - f for c, f in zip(coadjoint(body, rate), forque, strict=True))
            for body, rate, forque in zip(self.bodies, self.rates, self.all_forques, strict=True)
        )

    @property
    def autonomous(self) -> bool:
        """Whether H does not know the time."""
        return TIME not in self.energy.free_symbols

    @property
    def conservative(self) -> bool:
        """Whether nothing is applied and H is autonomous, so that it is constant."""
        return self.autonomous and not any(any(forque) for forque in self.applied)

    @cached_property
    def power(self) -> Expr:
        """dH/dt = ∂H/∂t − Σ F_applied(B): what time and applied forques do, W."""
        total = sympy.diff(self.energy, TIME)
        for applied, rates in zip(self.applied, self.rates, strict=False):
            total -= sum(f * b for f, b in zip(applied, rates, strict=True))
        return total

    @property
    def separable(self) -> bool:
        """Whether H = T(μ) + U(q, t)."""
        momenta = {p for body in self.bodies for p in body.momenta}
        return all(
            not (rate.free_symbols - momenta - set(self.parameters))
            for rates in self.rates
            for rate in rates
        )

    def prove_energy_balance(self) -> None:
        """Prove dH/dt = `power`, given that B and F are dH. ValueError if not: a defect of ours.

        Along the motion dH/dt = Σ B_i μ̇_i + F_b,i B_i + ∂H/∂t. The forques cancel, what is applied
        stays as `power`, and μ([B, B]) is left, which the structure constants must make vanish.
        That the programs' B and F are dH is for `proof.prove_energy_balance` to show.
        """
        for body in self.bodies:
            rates = tuple(sympy.Dummy() for _ in body.rates)
            work = sum(b * c for b, c in zip(rates, coadjoint(body, rates), strict=True))
            if sympy.expand(work) != 0:
                raise ValueError(f"H is not constant on {body.group.name}: {work}")


def coadjoint(body: Coordinates, rate: Sequence[Expr]) -> tuple[Expr, ...]:
    """ad*_B μ: component i is μ([B, E_i])."""
    return _bracketed(body, rate, [None] * len(body.momenta))


def inertial(body: Coordinates, symbols: Sequence[Expr], rates: Sequence[Expr]) -> tuple[Expr, ...]:
    """ad*_B μ of the rates, in symbols for them, less what cancels among those that are one
    multiple of their momenta: P × V of V = P/m, whose products exceed the torques of a body in
    orbit by all digits."""
    ratios = [sympy.expand(rate / p) for rate, p in zip(rates, body.momenta, strict=True)]
    return _bracketed(body, symbols, ratios)


def _bracketed(
    body: Coordinates, rate: Sequence[Expr], ratios: Sequence[Expr | None]
) -> tuple[Expr, ...]:
    """Σ c_jik B_j μ_k without those pairs that cancel where B_j : μ_j = B_k : μ_k."""
    structure = body.group.structure
    size = range(len(body.momenta))

    def stays(i: int, j: int, k: int) -> bool:
        alike = ratios[j] is not None and ratios[j] == ratios[k]
        return not (alike and structure[j][i][k] + structure[k][i][j] == 0)

    return tuple(
        sum(
            (
                sympy.Rational(structure[j][i][k].numerator, structure[j][i][k].denominator)
                * rate[j]
                * body.momenta[k]
                for j in size
                for k in size
                if structure[j][i][k] and stays(i, j, k)
            ),
            sympy.Integer(0),
        )
        for i in size
    )
