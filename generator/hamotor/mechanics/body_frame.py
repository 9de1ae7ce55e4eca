"""A Hamiltonian in vectors that are seen from the body, where its equations are cheapest.

On groups of rigid motions the place of a body is told by X = Rᵀ(x − o), o a point of the world, and
by the rows of R, the world's axes seen from the body. All of them move by Ẏ = ξ(a) − Ω × Y, and
what depends on lengths and angles between points only, as potentials do, is a function of
differences of them: no rotation stands between a force and the momenta that it changes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import sympy

from hamotor.mechanics.coordinates import Coordinates, Expr, Point
from hamotor.mechanics.system import Definition

Vector = tuple[Expr, ...]
ZERO = sympy.Integer(0)


class Unsuitable(ValueError):
    """The Hamiltonian is not one of vectors seen from single bodies."""


@dataclass
class BodyFrame:
    """One body's part of the rewriting.

    origin: o, exact numbers; a body with a fixed point has it there, and X = 0.
    """

    body: Coordinates
    number: int
    origin: Vector
    definitions: list[Definition] = field(default_factory=list)
    """Vectors Y = X + a − Rᵀc and their squares, in the order in which they are computed."""
    variations: dict[Expr, tuple[Expr, ...]] = field(default_factory=dict)
    """δ_i of every symbol that a rewritten Hamiltonian holds."""
    centers: Counter[Vector] = field(default_factory=Counter)
    """Points of the world from which squared distances are taken."""
    _vectors: dict[tuple[Vector, Vector], Vector] = field(default_factory=dict)
    _squares: dict[Vector, Expr] = field(default_factory=dict)

    def __post_init__(self) -> None:
        space = self.body.space
        if not space.affine or space.scales:
            raise Unsuitable(f"{self.body.group.name} is no group of rigid motions")
        for k, x in enumerate(self.place):
            if x != 0:
                self.variations[x] = tuple(
                    _exact(v[k]) - _row_times(turn, k, self.place)
                    for v, turn in zip(space.velocities, space.turns, strict=True)
                )
        for variable in self.body.frame_variables:
            self.variations[variable.symbol] = variable.variation

    @cached_property
    def axes(self) -> range:
        """Of the space."""
        return range(self.body.dimension)

    @cached_property
    def place(self) -> Vector:
        """X."""
        if not self.body.space.translates:
            return (ZERO,) * self.body.dimension
        return tuple(sympy.Symbol(f"_X{self.number}_{k}", real=True) for k in self.axes)

    def seen(self, direction: Sequence[Expr]) -> Vector:
        """Rᵀ n."""
        return tuple(
            sympy.Add(*(self.body.rotation[j][k] * direction[j] for j in self.axes))
            for k in self.axes
        )

    def vector(self, at: Vector, center: Vector) -> Vector:
        """Symbols for Rᵀ(y − o − c) = X + a − Rᵀc."""
        if not any(at) and not any(center):
            return self.place
        if (at, center) in self._vectors:
            return self._vectors[at, center]
        name = f"y{len(self._vectors) + 1}"
        symbols = tuple(sympy.Symbol(f"_{name}_{self.number}_{k}", real=True) for k in self.axes)
        held = self.seen(center)
        self.definitions += [
            (s, f"{name}{axis}_{self.number}", x + a - c)
            for s, axis, x, a, c in zip(symbols, "xyzw", self.place, at, held, strict=False)
        ]
        velocities = self.body.velocities_at(at)
        for k, symbol in enumerate(symbols):
            self.variations[symbol] = tuple(
                velocity[k] - _row_times(turn, k, symbols)
                for velocity, turn in zip(velocities, self.body.space.turns, strict=True)
            )
        self._vectors[at, center] = symbols
        return symbols

    def square(self, y: Vector) -> Expr:
        """A symbol for |Y|²."""
        if y in self._squares:
            return self._squares[y]
        name = f"square{len(self._squares) + 1}_{self.number}"
        symbol = sympy.Symbol(f"_{name}", real=True)
        self._squares[y] = symbol
        self.definitions.append((symbol, name, sympy.Add(*(x * x for x in y))))
        # Y · (Ω × Y) cancels.
        self.variations[symbol] = tuple(
            sympy.expand(sympy.Add(*(2 * x * self.variations[x][i] for x in y if x != 0)))
            for i in range(len(self.body.momenta))
        )
        return symbol


def _row_times(turn: Any, k: int, y: Vector) -> Expr:
    """(Γ Y)_k."""
    return sympy.Add(*(_exact(turn[k][j]) * y[j] for j in range(len(y))))


def _exact(x: Any) -> Expr:
    return sympy.Rational(x.numerator, x.denominator)


@dataclass(frozen=True)
class _World:
    """One vector of the world: y of a point of a body, or the world's image of a body's axis."""

    frame: BodyFrame
    symbols: Vector
    point: Point | None
    axis: int = 0


class Rewriting:
    """Expressions of places in the world as expressions of vectors seen from bodies."""

    def __init__(self, frames: Sequence[BodyFrame]) -> None:
        self.frames = frames
        self.vectors: list[_World] = []
        self.component: dict[Expr, tuple[_World, int]] = {}
        for frame in frames:
            for point in frame.body.points:
                self._know(_World(frame, point.symbols, point))
            columns = zip(*frame.body.rotation, strict=True)
            for k, column in enumerate(columns):
                self._know(_World(frame, tuple(column), None, k))
        self.forbidden = {s for frame in frames for s in frame.body.motor}

    def _know(self, vector: _World) -> None:
        self.vectors.append(vector)
        self.component |= {s: (vector, j) for j, s in enumerate(vector.symbols)}

    def __call__(self, x: Expr) -> Expr:
        """The same value.  Unsuitable where components of motors stand in it."""
        held = x.free_symbols
        if held & self.forbidden:
            raise Unsuitable("components of motors")
        if not held & set(self.component):
            return x
        if x in self.component:
            return self._component(x)
        if x.is_Add:
            return self._sum(x)
        return x.func(*map(self, x.args))

    def _component(self, x: Expr) -> Expr:
        vector, j = self.component[x]
        if vector.point is None:
            return x
        frame = vector.frame
        offset = [p + a for p, a in zip(frame.place, vector.point.place, strict=True)]
        row = frame.body.rotation[j]
        return frame.origin[j] + sympy.Add(*(r * y for r, y in zip(row, offset, strict=True)))

    def _sum(self, x: Expr) -> Expr:
        """A sum, what in it is a quadratic form that rotations leave as it is put in vectors."""
        symbols = [s for s in self.component if s in x.free_symbols]
        plain = [a for a in x.args if a.is_polynomial(*symbols)]
        rest = sympy.Add(*(self(a) for a in x.args if a not in plain))
        polynomial = sympy.Poly(sympy.Add(*plain), *symbols)
        if polynomial.total_degree() <= 2:
            found = self._quadratic(polynomial, symbols)
            if found is not None:
                return found + rest
        return sympy.Add(*map(self, plain)) + rest

    def _quadratic(self, polynomial: Any, symbols: Sequence[Expr]) -> Expr | None:
        constant, linear = ZERO, dict[Expr, Expr]()
        pairs: dict[tuple[int, int], dict[tuple[int, int], Expr]] = {}
        for powers, coefficient in polynomial.terms():
            factors = [s for s, n in zip(symbols, powers, strict=True) for _ in range(n)]
            if not factors:
                constant += coefficient
            elif len(factors) == 1:
                linear[factors[0]] = coefficient
            else:
                (v, j), (w, n) = (self.component[s] for s in factors)
                a, b = self.vectors.index(v), self.vectors.index(w)
                if a > b:
                    (a, j), (b, n) = (b, n), (a, j)
                table = pairs.setdefault((a, b), {})
                table[j, n] = table.get((j, n), ZERO) + coefficient
        total = constant
        for (a, b), table in pairs.items():
            product = self._form(self.vectors[a], self.vectors[b], table, linear)
            if product is None:
                return None
            total += product
        return total + sympy.Add(*(c * self._component(s) for s, c in linear.items() if c != 0))

    def _form(
        self, v: _World, w: _World, table: Mapping[tuple[int, int], Expr], linear: dict[Expr, Expr]
    ) -> Expr | None:
        """Σ c_jn v_j w_n in vectors seen from the body; takes the linear terms of a square."""
        if v.frame is not w.frame:
            raise Unsuitable("bodies that see each other")
        frame, axes = v.frame, v.frame.axes
        factor = table.get((0, 0), ZERO)
        if any(table.get((j, j), ZERO) != factor for j in axes):
            return None
        rest = {jn: c for jn, c in table.items() if jn[0] != jn[1] and c != 0}
        total = ZERO
        if factor != 0:
            if v is w and v.point is not None:
                # c |y|² + l·y = c |y − z|² − c |z|², z = −l/2c.
                z = tuple(-linear.pop(s, ZERO) / (2 * factor) for s in v.symbols)
                if any(not x.is_Rational for x in z):
                    return None
                frame.centers[z] += 1
                y = frame.vector(v.point.place, _minus(z, frame.origin))
                total += factor * (frame.square(y) - sympy.Add(*(x * x for x in z)))
            elif v.point is not None and w.point is not None:
                total += factor * sympy.Add(
                    *(p * q for p, q in zip(self._from_world(v), self._from_world(w), strict=True))
                )
            elif v.point is None and w.point is None:
                total += factor if v.axis == w.axis else ZERO
            else:
                point, axis = (v, w) if v.point is not None else (w, v)
                total += factor * self._from_world(point)[axis.axis]
        if not rest:
            return total
        return self._triple(v, w, rest, total)

    def _triple(
        self, v: _World, w: _World, rest: Mapping[tuple[int, int], Expr], total: Expr
    ) -> Expr | None:
        """b·(v × w), where the off-diagonal part is that."""
        frame = v.frame
        if len(frame.axes) != 3 or v is w:
            return None
        planes = ((1, 2), (2, 0), (0, 1))
        b = [rest.get((j, n), ZERO) for j, n in planes]
        back = [rest.get((n, j), ZERO) for j, n in planes]
        if any(x != -y for x, y in zip(b, back, strict=True)):
            return None
        seen = sympy.Matrix(frame.seen(b))
        one, other = (sympy.Matrix(self._in_body(x)) for x in (v, w))
        return total + seen.dot(one.cross(other))

    def _from_world(self, v: _World) -> Vector:
        """Rᵀ y for a point, from the world's origin."""
        assert v.point is not None
        return v.frame.vector(v.point.place, _minus((ZERO,) * len(v.symbols), v.frame.origin))

    def _in_body(self, v: _World) -> Vector:
        if v.point is not None:
            return self._from_world(v)
        return tuple(sympy.Integer(int(k == v.axis)) for k in v.frame.axes)


def _minus(a: Iterable[Expr], b: Iterable[Expr]) -> Vector:
    return tuple(x - y for x, y in zip(a, b, strict=True))
