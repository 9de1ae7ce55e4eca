"""Element types: an ordered set of named components, each embedded in the algebra exactly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from hamotor.codegen.algebra import (
    Algebra,
    Blade,
    Multivector,
    Rational,
    add_scaled,
    grades_of,
    simplest,
)


@dataclass(frozen=True)
class Component:
    """One stored number of an element and the multivector that it multiplies."""

    name: str
    embedding: Mapping[Blade, Rational]


@dataclass(frozen=True)
class Element:
    """A type of multivector: motor, bivector, point, … or a rate or momentum of a group.

    fixed: the part that is the same in every value (a normalised point has weight 1).
    unit:  values satisfy M ~M = 1; kernels may use it.
    functionals: how each component is read off a multivector; None: from the embedding.  A momentum
        has its own, since the dual of a subalgebra is a quotient: μ_a I = μ ∧ E_a.
    """

    name: str
    symbol: str
    components: tuple[Component, ...]
    fixed: Mapping[Blade, Rational]
    unit: bool
    doc: str
    namespace: str = ""
    functionals: tuple[Mapping[Blade, Rational], ...] | None = None

    @property
    def cpp_name(self) -> str:
        """Name as seen from the algebra's namespace."""
        return f"{self.namespace}::{self.name}" if self.namespace else self.name

    @property
    def blades(self) -> tuple[Blade, ...]:
        """Every blade that a value can hold, ascending."""
        found = {blade for component in self.components for blade in component.embedding}
        return tuple(sorted(found | set(self.fixed)))

    @property
    def grades(self) -> tuple[int, ...]:
        """The grades that a value can hold."""
        return grades_of(self.blades)

    @cached_property
    def reading(self) -> tuple[Mapping[Blade, Rational], ...]:
        """For each component the linear functional that reads it off a multivector, exact."""
        if self.functionals is not None:
            return self.functionals
        columns = [component.embedding for component in self.components]
        normal = [[_dot(a, b) for b in columns] for a in columns]
        inverse = inverse_matrix(normal)
        if inverse is None:
            raise ValueError(f"the components of {self.name} are linearly dependent")
        functionals = []
        for row in inverse:
            functional: Multivector = {}
            for factor, column in zip(row, columns, strict=True):
                if factor:
                    add_scaled(functional, column, factor)
            functionals.append({blade: simplest(x) for blade, x in sorted(functional.items())})
        return tuple(functionals)

    @property
    def is_blades(self) -> bool:
        """Whether every component is one basis blade with coefficient ±1."""
        return all(
            len(c.embedding) == 1 and all(abs(x) == 1 for x in c.embedding.values())
            for c in self.components
        )


def _dot(a: Mapping[Blade, Rational], b: Mapping[Blade, Rational]) -> Fraction:
    return sum((Fraction(x * b[blade]) for blade, x in a.items() if blade in b), Fraction(0))


def inverse_matrix(matrix: list[list[Fraction]]) -> list[list[Fraction]] | None:
    """Exact inverse of a square rational matrix; None where it is singular."""
    size = len(matrix)
    rows = [[*row, *(Fraction(int(i == j)) for j in range(size))] for i, row in enumerate(matrix)]
    for column in range(size):
        pivot = next((r for r in range(column, size) if rows[r][column]), None)
        if pivot is None:
            return None
        rows[column], rows[pivot] = rows[pivot], rows[column]
        if (factor := rows[column][column]) != 1:
            rows[column] = [x / factor for x in rows[column]]
        for r in range(size):
            if r != column and (factor := rows[r][column]):
                rows[r] = [x - factor * y for x, y in zip(rows[r], rows[column], strict=True)]
    return [row[size:] for row in rows]


def blade_component(algebra: Algebra, name: str) -> Component:
    """Component named after an oriented blade, e.g. `e31` holds the coefficient of e3 ∧ e1."""
    blade, sign = algebra.parse_blade(name)
    return Component(name, {blade: sign})
