"""A quadratic kinetic energy cut into parts whose motion is known, on any group.

T = ½ μᵀAμ with a constant A is a sum of ½ μᵀQμ along whose own motion B = Qμ is constant, so that
it is M exp(hB) and μ turns by it (ad*, theory.md §2): one direction at a time, Q = a ℓ ℓᵀ, for
which μ(ℓ) is constant as μ([ℓ, ℓ]) = 0; several that commute; a ball.  Where B² is a number,
exp B = C + S B with C = cos, S = sin (B² < 0), cosh, sinh, or 1, 1 (B² = 0).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product

import sympy

from hamotor.codegen.algebra import Algebra, Blade
from hamotor.codegen.group import LieGroup
from hamotor.codegen.program import Program
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.hamiltonian import Hamiltonian
from hamotor.mechanics.straightline import (
    COSH_LESS_ONE,
    COSINE_LESS_ONE,
    SINE_RATIO,
    SINH_RATIO,
    straight_line,
)
from hamotor.mechanics.system import Definition, System, folded

Matrix = tuple[tuple[Fraction, ...], ...]
Parts = tuple[tuple[tuple["Part", ...], ...], ...]
"""For each body sets of parts; those of different sets commute."""
STEP = sympy.Symbol("_h", real=True)
"""The time of a part."""
BALL = ("e23", "e31", "e12")
"""The rotations of space, of which Q may be a multiple of 1."""


@dataclass(frozen=True)
class Part:
    """½ μᵀQμ of one body, along whose motion B = Qμ is constant."""

    algebra: Algebra
    group: LieGroup
    matrix: Matrix
    """Q, exact."""

    @cached_property
    def square(self) -> Matrix | None:
        """B² as a quadratic form of μ; None where it is no number."""
        size = range(len(self.matrix))
        total: dict[Blade, dict[tuple[int, ...], Fraction]] = {}
        for (i, k, x), (j, l, y) in product(self.entries, self.entries):
            one, other = self.group.generators[i], self.group.generators[j]
            for blade, z in self.algebra.multiply(one.bivector, other.bivector).items():
                _add(total.setdefault(blade, {}), (k, l), x * y * Fraction(z))
        if any(x for blade, terms in total.items() if blade for x in terms.values()):
            return None
        number = total.get(0, {})
        return tuple(
            tuple(
                number.get((min(k, l), max(k, l)), Fraction(0)) / (1 if k == l else 2) for l in size
            )
            for k in size
        )

    @cached_property
    def sign(self) -> int | None:
        """That of B² where it is a number, and of one sign for all μ."""
        if self.square is None:
            return None
        signs = {1 if factor > 0 else -1 for factor, _ in directions(self.square)}
        return None if len(signs) > 1 else next(iter(signs), 0)

    @property
    def entries(self) -> list[tuple[int, int, Fraction]]:
        """Those of Q that are not 0."""
        return [(i, j, x) for i, row in enumerate(self.matrix) for j, x in enumerate(row) if x]

    def is_known(self) -> bool:
        """Whether B is constant: Q ad*_B μ = 0 for every μ."""
        totals: list[dict[tuple[int, ...], Fraction]] = [{} for _ in self.matrix]
        for j, i, k, bracket in _brackets(self.group):
            for row, total in zip(self.matrix, totals, strict=True):
                if row[i]:
                    for l, x in enumerate(self.matrix[j]):
                        _add(total, (k, l), row[i] * bracket * x)
        return not any(x for total in totals for x in total.values())

    def commutes_with(self, other: Part) -> bool:
        """Whether the two motions may be taken in either order: μ([Qμ, Q'μ]) = 0 for every μ."""
        total: dict[tuple[int, ...], Fraction] = {}
        for i, j, k, bracket in _brackets(self.group):
            for (l, x), (m, y) in product(enumerate(self.matrix[i]), enumerate(other.matrix[j])):
                if x and y:
                    _add(total, (k, l, m), bracket * x * y)
        return not any(total.values())

    def with_(self, other: Part) -> Part:
        """Both together."""
        return Part(self.algebra, self.group, _sum(self.matrix, other.matrix))


def _add(total: dict[tuple[int, ...], Fraction], factors: Sequence[int], x: Fraction) -> None:
    """Adds x times a product of momenta."""
    key = tuple(sorted(factors))
    total[key] = total.get(key, Fraction(0)) + x


def _brackets(group: LieGroup) -> list[tuple[int, int, int, Fraction]]:
    """[E_i, E_j] has x E_k."""
    return [
        (i, j, k, Fraction(x))
        for i, row in enumerate(group.structure)
        for j, bracket in enumerate(row)
        for k, x in enumerate(bracket)
        if x
    ]


def directions(matrix: Matrix) -> Iterator[tuple[Fraction, tuple[Fraction, ...]]]:
    """A symmetric matrix as Σ a ℓ ℓᵀ: pairs (a, ℓ)."""
    rest = matrix
    size = range(len(matrix))
    while any(map(any, rest)):
        i = next((i for i in size if rest[i][i]), None)
        if i is not None:
            vector = rest[i]
            length = rest[i][i]
        else:
            i, j = next((i, j) for i, j in product(size, size) if rest[i][j])
            vector = tuple(a + b for a, b in zip(rest[i], rest[j], strict=True))
            length = 2 * rest[i][j]
        first = next(x for x in vector if x)
        direction = tuple(x / first for x in vector)
        factor = first * first / length
        yield factor, direction
        rest = _sum(rest, _outer(-factor, direction))


def _outer(factor: Fraction, direction: Sequence[Fraction]) -> Matrix:
    return tuple(tuple(factor * x * y for y in direction) for x in direction)


def _sum(one: Matrix, other: Matrix) -> Matrix:
    return tuple(
        tuple(x + y for x, y in zip(a, b, strict=True)) for a, b in zip(one, other, strict=True)
    )


def kinetic_matrices(h: Hamiltonian) -> tuple[Matrix, ...] | None:
    """A of each body, H = Σ ½ μᵀAμ + U(M); None where H is not of this form."""
    if not h.conservative or not h.separable:
        return None
    found = []
    for body, rates in zip(h.bodies, h.rates, strict=True):
        rows = []
        for rate in rates:
            exact = folded(rate, h.parameters)
            row = [sympy.diff(exact, momentum) for momentum in body.momenta]
            rest = exact - sum(a * p for a, p in zip(row, body.momenta, strict=True))
            if not all(a.is_Rational for a in row) or sympy.expand(rest) != 0:
                return None
            rows.append(tuple(Fraction(int(a.p), int(a.q)) for a in row))
        found.append(tuple(rows))
    return tuple(found)


def kinetic_parts(h: Hamiltonian) -> Parts | None:
    """The kinetic energy of each body in parts; None where H is not ½ μᵀAμ + U(M)."""
    matrices = kinetic_matrices(h)
    if matrices is None:
        return None
    return tuple(parts_of(body, a) for body, a in zip(h.bodies, matrices, strict=True))


def is_exact(parts: Parts) -> bool:
    """Whether all parts of each body commute."""
    return all(len(together) == 1 for sets in parts for together in sets)


def parts_of(body: Coordinates, matrix: Matrix) -> tuple[tuple[Part, ...], ...]:
    """The parts of ½ μᵀAμ, in sets that commute with one another.

    ValueError if they are not what they should be: a defect of ours.
    """
    algebra, group = body.algebra, body.group
    found: list[Part] = []
    rest = matrix
    ball = _ball(group, matrix)
    if ball is not None:
        found.append(Part(algebra, group, ball))
        rest = _sum(rest, tuple(tuple(-x for x in row) for row in ball))
    for factor, direction in directions(rest):
        part = Part(algebra, group, _outer(factor, direction))
        for k, other in enumerate(found):
            both = other.with_(part)
            if both.sign == 0 and both.is_known():
                found[k] = both
                break
        else:
            found.append(part)
    total: Matrix = tuple(tuple(Fraction(0) for _ in row) for row in matrix)
    for part in found:
        total = _sum(total, part.matrix)
    if total != matrix or not all(part.is_known() for part in found):
        raise ValueError(f"the parts of the kinetic energy on {group.name} are not its parts")
    return _sets(found)


def _ball(group: LieGroup, matrix: Matrix) -> Matrix | None:
    """The middle moment of a rotation about principal axes, as a moment about all of them."""
    names = [g.name for g in group.generators]
    if not set(BALL) <= set(names):
        return None
    axes = [names.index(name) for name in BALL]
    if any(x for i in axes for j, x in enumerate(matrix[i]) if i != j):
        return None
    middle = sorted(matrix[i][i] for i in axes)[1]
    size = range(len(matrix))
    return tuple(tuple(middle if i == j and i in axes else Fraction(0) for j in size) for i in size)


def _sets(parts: Sequence[Part]) -> tuple[tuple[Part, ...], ...]:
    """Parts that do not commute, directly or by others, are in one set."""
    sets: list[list[Part]] = []
    for part in parts:
        joined = [s for s in sets if not all(part.commutes_with(other) for other in s)]
        sets = [s for s in sets if s not in joined]
        sets.append([*(p for s in joined for p in s), part])
    return tuple(map(tuple, sets))


def motion(system: System, k: int, part: Part) -> Program | None:
    """What a part adds to motor and momentum of body k in the time `h`: `motor.…`, `momentum.…`.

    None where B² is no number or of no certain sign: then exp B is for the group's own function.
    """
    if part.sign is None or part.square is None:
        return None
    body = system.hamiltonian.bodies[k]
    momenta = body.momenta
    names = [g.rate for g in body.group.generators]
    stages: list[Definition] = []

    def stage(name: str, value: Expr) -> Expr:
        if value == 0:
            return sympy.Integer(0)
        symbol = sympy.Symbol(f"_{name}", real=True)
        stages.append((symbol, name, value))
        return symbol

    found = list(directions(part.matrix))
    one = [_exact(x) for x in found[0][1]] if len(found) == 1 else None
    if one is not None:
        along = sum(x * p for x, p in zip(one, momenta, strict=True))
        turn = stage("turn", STEP * _exact(found[0][0]) * along)
        rate = [x * turn for x in one]
    else:
        rate = [
            stage(
                f"turn_{name}",
                STEP * sum(_exact(q) * p for q, p in zip(row, momenta, strict=True)),
            )
            for name, row in zip(names, part.matrix, strict=True)
        ]
    sines, less = rate, sympy.Integer(0)
    if part.sign:
        circular = part.sign < 0
        square = stage("square", sympy.expand(part.sign * _square(part, rate)))
        ratio = stage("ratio", (SINE_RATIO if circular else SINH_RATIO)(square))
        less = stage("less", (COSINE_LESS_ONE if circular else COSH_LESS_ONE)(square))
        if one is not None:
            sine = stage("sine", ratio * turn)
            sines = [x * sine for x in one]
        else:
            sines = [stage(f"sine_{n}", ratio * b) for n, b in zip(names, rate, strict=True)]
    speeds = [sum(_exact(q) * p for q, p in zip(row, momenta, strict=True)) for row in part.matrix]
    turned = _coadjoint(body.group, speeds, momenta)
    once = [
        stage(f"turning_{name}", x) if sympy.expand(full) != 0 else sympy.Integer(0)
        for name, x, full in zip(names, _coadjoint(body.group, sines, momenta), turned, strict=True)
    ]
    twice = _coadjoint(body.group, sines, once)
    outputs = {
        f"motor.{c.name}": less * v.symbol
        + sum(s * x for s, x in zip(sines, v.variation, strict=True))
        for v, c in zip(body.motor_variables, body.group.element.components, strict=True)
    } | {
        f"momentum.{name}": less * a + a + b / 2
        for name, a, b in zip(names, once, twice, strict=True)
    }
    return straight_line(outputs, system.names | {STEP: "h"}, stages)


def rate_of(system: System, k: int, part: Part) -> Program:
    """h B of a part of body k, by component."""
    body = system.hamiltonian.bodies[k]
    outputs = {
        f"rate.{g.rate}": STEP * sum(_exact(q) * p for q, p in zip(row, body.momenta, strict=True))
        for g, row in zip(body.group.generators, part.matrix, strict=True)
    }
    return straight_line(outputs, system.names | {STEP: "h"})


def energy_text(part: Part) -> str:
    """Which momenta a part is quadratic in."""
    held = [
        g.momentum for g, row in zip(part.group.generators, part.matrix, strict=True) if any(row)
    ]
    return f"½ μᵀQμ, in {', '.join(held)}"


def _square(part: Part, rate: Sequence[Expr]) -> Expr:
    """B² in the components of B."""
    generators = part.group.generators
    return sum(
        (
            _exact(Fraction(part.algebra.multiply(one.bivector, other.bivector).get(0, 0))) * a * b
            for a, one in zip(rate, generators, strict=True)
            for b, other in zip(rate, generators, strict=True)
        ),
        sympy.Integer(0),
    )


def _coadjoint(group: LieGroup, rate: Sequence[Expr], momentum: Sequence[Expr]) -> list[Expr]:
    """ad*_B μ."""
    size = range(len(rate))
    return [
        sum(
            (
                _exact(Fraction(group.structure[j][i][k])) * rate[j] * momentum[k]
                for j in size
                for k in size
                if group.structure[j][i][k]
            ),
            sympy.Integer(0),
        )
        for i in size
    ]


def _exact(x: Fraction) -> Expr:
    return sympy.Rational(x.numerator, x.denominator)
