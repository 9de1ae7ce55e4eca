"""One body on a group of rotors, in symbols: its momenta, and where it is.

Where a body is, is a motor M. A Hamiltonian speaks of it through a few functions of M: on groups
that act affinely, x_world = x + s R x_body, the variables x, R and s; on conformal ones the matrix
L of e_k ↦ M e_k M~, in which points are quotients; and the components of M themselves. Points of
the body are variables too. Each variable knows what it is in M and its derivative along
M exp(εE_i), from which every forque follows: F_b,i = Σ (∂H/∂q) δ_i q.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import sympy

from hamotor.codegen.algebra import Algebra, Blade, Rational, reverse_sign
from hamotor.codegen.group import LieGroup
from hamotor.mechanics.space import Space

Expr = Any
"""A SymPy expression; SymPy has no types of its own."""


@dataclass(frozen=True)
class Variable:
    """A function of the motor that Hamiltonians are written in."""

    symbol: Expr
    definition: Expr
    """In the motor's components, and in variables that stand before it."""
    variation: tuple[Expr, ...]
    """δ_i, its derivative along M exp(εE_i), one for each generator, in variables."""
    spatial_variation: tuple[Expr, ...]
    """Its derivative along exp(εE_i) M, one for each generator, in variables."""


@dataclass(frozen=True)
class Point:
    """A point of the body, y = x + s R a in the world.

    Its derivative along M exp(εE_i) is s R ξ_i(a): a gradient g pulled back to the body, s Rᵀ g,
    is all that a forque needs.
    """

    symbols: tuple[Expr, ...]
    """y."""
    place: tuple[Expr, ...]
    """a, in the body frame, m."""
    velocities: tuple[tuple[Expr, ...], ...]
    """ξ_i(a), what each generator does to a."""


@dataclass(frozen=True)
class Coordinates:
    """Symbols of one body on `group`; those of several bodies differ by the prefix `BODY.`.

    pivot: where the body frame's origin is in the world, on a group that does not move it; () is
        the world's origin.
    """

    body: str
    algebra: Algebra
    group: LieGroup
    prefix: str = ""
    pivot: tuple[Expr, ...] = ()
    _points: dict[tuple[Expr, ...], Point] = field(default_factory=dict, repr=False, compare=False)

    def _symbol(self, name: str) -> Expr:
        return sympy.Symbol(self.prefix + name, real=True)

    def has_symbol(self, name: str) -> bool:
        """Whether a symbol of the body has this name, or a point asked for later may have it."""
        own = name.removeprefix(self.prefix)
        components = {c.name for c in self.group.element.components}
        numbers = {x for g in self.group.generators for x in (g.rate, g.momentum)}
        return name.startswith(self.prefix) and (
            own in {"scale", *components, *numbers}
            or re.fullmatch(r"[RL][0-9]{2}|(x|y[0-9]+)[xyzw]", own) is not None
        )

    @cached_property
    def motor(self) -> tuple[Expr, ...]:
        """The components of M, in storage order."""
        return tuple(self._symbol(c.name) for c in self.group.element.components)

    @cached_property
    def rates(self) -> tuple[Expr, ...]:
        """The components of B, physical, body frame."""
        return tuple(self._symbol(g.rate) for g in self.group.generators)

    @cached_property
    def momenta(self) -> tuple[Expr, ...]:
        """The components of μ, physical, body frame."""
        return tuple(self._symbol(g.momentum) for g in self.group.generators)

    @cached_property
    def space(self) -> Space:
        """How the group acts on the points of its space."""
        return Space.of(self.algebra, self.group)

    @property
    def dimension(self) -> int:
        """Of the space that the body is in."""
        return len(self.space.directions)

    # ------------------------------------------------------------------ where the body is

    @cached_property
    def rotation(self) -> tuple[tuple[Expr, ...], ...]:
        """R[j][k], the component along j of the world's image of the body's direction k."""
        d = range(self.dimension)
        return tuple(tuple(self._symbol(f"R{j + 1}{k + 1}") for k in d) for j in d)

    @cached_property
    def scale(self) -> Expr:
        """s, by how much the body is enlarged; 1 where the group keeps lengths."""
        return self._symbol("scale") if self.space.scales else sympy.Integer(1)

    @cached_property
    def motor_variables(self) -> tuple[Variable, ...]:
        """The components of M as variables: δ_i M = M E_i, and E_i M for the world's E_i."""
        body = [self._motor_times(g.bivector, from_left=False) for g in self.group.generators]
        world = [self._motor_times(g.bivector, from_left=True) for g in self.group.generators]
        return tuple(
            Variable(symbol, symbol, tuple(c[k] for c in body), tuple(c[k] for c in world))
            for k, symbol in enumerate(self.motor)
        )

    def _motor_times(self, bivector: Mapping[Blade, Rational], *, from_left: bool) -> list[Expr]:
        """The components of M E, or of E M."""
        total: dict[Blade, Expr] = {}
        for symbol, component in zip(self.motor, self.group.element.components, strict=True):
            factors = (component.embedding, bivector)
            for blade, x in self.algebra.multiply(*factors[:: -1 if from_left else 1]).items():
                total[blade] = total.get(blade, 0) + symbol * _exact(x)
        return [
            _sum(_exact(x) * total.get(blade, 0) for blade, x in reading.items())
            for reading in self.group.element.reading
        ]

    @cached_property
    def frame_variables(self) -> tuple[Variable, ...]:
        """R and s as variables; L where the group does not act affinely."""
        space = self.space
        if not space.affine:
            return self._conformal_variables
        image = self.image
        d = range(self.dimension)
        variables = []
        if space.scales:
            growth = tuple(self.scale * _exact(x) for x in space.growths)
            definition = image[space.infinity][space.infinity]
            variables.append(Variable(self.scale, definition, growth, growth))
        variables += [
            Variable(
                self.rotation[j][k],
                image[j + 1][k + 1],
                tuple(
                    _sum(self.rotation[j][n] * _exact(turn[n][k]) for n in d)
                    for turn in space.turns
                ),
                tuple(
                    _sum(_exact(turn[j][n]) * self.rotation[n][k] for n in d)
                    for turn in space.turns
                ),
            )
            for j in d
            for k in d
        ]
        return tuple(variables)

    @property
    def _conformal_variables(self) -> tuple[Variable, ...]:
        size = range(self.space.basis_size)
        brackets = self.space.brackets
        matrix = self.conformal_matrix
        return tuple(
            Variable(
                matrix[j][k],
                self.image[j][k],
                tuple(
                    _sum(matrix[j][n] * _exact(x) for n, x in row[k].items()) for row in brackets
                ),
                tuple(
                    _sum(_exact(row[n].get(j, 0)) * matrix[n][k] for n in size) for row in brackets
                ),
            )
            for j in size
            for k in size
        )

    @cached_property
    def conformal_matrix(self) -> tuple[tuple[Expr, ...], ...]:
        """L[j][k] = [M e_k M~]_j over e0, e1, …, e∞."""
        size = range(self.space.basis_size)
        return tuple(tuple(self._symbol(f"L{j}{k}") for k in size) for j in size)

    @cached_property
    def variables(self) -> dict[Expr, Variable]:
        """Every variable by its symbol."""
        return {v.symbol: v for v in (*self.frame_variables, *self.motor_variables)}

    @cached_property
    def origin(self) -> tuple[Expr, ...]:
        """x in the components of M; the pivot where the group does not move it."""
        if not self.space.translates:
            return self.pivot or (sympy.Integer(0),) * self.dimension
        return tuple(self.scale * self.image[j + 1][0] for j in range(self.dimension))

    def at(self, place: tuple[Expr, ...]) -> tuple[Expr, ...]:
        """Where a point of the body frame is in the world, y: symbols of a `Point`.

        On groups that bend straight lines, quotients in L.
        """
        if not self.space.affine:
            return self._conformal_point(place)
        if not any(place) and not self.space.translates:
            return self.origin
        if place not in self._points:
            name = "x" if not any(place) else f"y{1 + sum(any(a) for a in self._points)}"
            self._points[place] = Point(
                tuple(self._symbol(f"{name}{axis}") for axis in "xyzw"[: self.dimension]),
                place,
                self.velocities_at(place),
            )
        return self._points[place].symbols

    def world_velocities_at(self, y: tuple[Expr, ...]) -> tuple[tuple[Expr, ...], ...]:
        """What each generator of the world does to a point of the body that is at y: about the
        pivot, where the group does not move it."""
        if self.space.translates:
            return self.velocities_at(y)
        return self.velocities_at(tuple(a - b for a, b in zip(y, self.origin, strict=True)))

    def velocities_at(self, place: tuple[Expr, ...]) -> tuple[tuple[Expr, ...], ...]:
        """ξ_i(a), what each generator does to a point a: of the body's or of the world's space."""
        d = range(self.dimension)
        return tuple(
            tuple(
                _exact(v[j])
                + _sum(_exact(turn[j][k]) * a for k, a in enumerate(place))
                + _exact(growth) * place[j]
                for j in d
            )
            for v, turn, growth in zip(
                self.space.velocities, self.space.turns, self.space.growths, strict=True
            )
        )

    @property
    def position(self) -> tuple[Expr, ...]:
        """Where the body frame's origin is in the world."""
        return self.at((sympy.Integer(0),) * self.dimension)

    @property
    def points(self) -> tuple[Point, ...]:
        """Every point asked for so far."""
        return tuple(self._points.values())

    def points_in(self, symbols: set[Expr]) -> tuple[Point, ...]:
        """The points of which a coordinate is among the symbols."""
        return tuple(p for p in self._points.values() if symbols & set(p.symbols))

    def definition(self, point: Point) -> tuple[Expr, ...]:
        """x + s R a, x in the components of M."""
        turned = self.turned(point.place)
        return tuple(x + self.scale * y for x, y in zip(self.origin, turned, strict=True))

    def pulled_back(self, gradient: tuple[Expr, ...]) -> tuple[Expr, ...]:
        """s Rᵀ g, for the gradient g of a potential at a point of the body."""
        return tuple(self.scale * x for x in self.turned_back(gradient))

    def turned(self, direction: tuple[Expr, ...]) -> tuple[Expr, ...]:
        """R n: a direction of the body in the world."""
        return tuple(
            _sum(r * n for r, n in zip(row, direction, strict=True)) for row in self.rotation
        )

    def turned_back(self, direction: tuple[Expr, ...]) -> tuple[Expr, ...]:
        """Rᵀ n: a direction of the world in the body frame."""
        columns = zip(*self.rotation, strict=True)
        return tuple(
            _sum(r * n for r, n in zip(column, direction, strict=True)) for column in columns
        )

    @cached_property
    def image(self) -> list[list[Expr]]:
        """[M e_k M~]_j in the motor's components, M M~ = 1 used on the diagonal; origin first."""
        space, components = self.space, self.group.element.components
        symbols = self.motor
        norm: dict[Blade, Expr] = {}
        size = space.basis_size
        image = [[sympy.Integer(0)] * size for _ in range(size)]
        for a, left in zip(symbols, components, strict=True):
            for b, right in zip(symbols, components, strict=True):
                reverse = {blade: reverse_sign(blade) * x for blade, x in right.embedding.items()}
                for blade, x in self.algebra.multiply(left.embedding, reverse).items():
                    norm[blade] = norm.get(blade, 0) + _exact(x) * a * b
                for k in range(size):
                    column = space.sandwich(left.embedding, k, reverse)
                    for j, x in column.items():
                        image[j][k] += _exact(x) * a * b
        excess = norm.get(0, sympy.Integer(0)) - 1
        for j in range(1, len(space.directions) + 1):
            image[j][j] = sympy.expand(image[j][j] - excess)
        return image

    def _conformal_point(self, point: tuple[Expr, ...]) -> tuple[Expr, ...]:
        vector = [sympy.Integer(1), *point, _sum(x * x for x in point) / 2]
        origin, *moved, _ = (
            _sum(x * y for x, y in zip(row, vector, strict=True)) for row in self.conformal_matrix
        )
        return tuple(x / origin for x in moved)


def _sum(terms: Iterable[Expr]) -> Expr:
    return sum(terms, sympy.Integer(0))


def _exact(x: Rational) -> Expr:
    return sympy.Rational(x.numerator, x.denominator)
