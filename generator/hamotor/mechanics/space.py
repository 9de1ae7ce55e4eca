"""How a group of rotors acts on the points of its space: exact, and without symbols."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from hamotor.codegen.algebra import Algebra, Blade, Multivector, Rational, add_scaled
from hamotor.codegen.group import LieGroup

Linear = tuple[tuple[Rational, ...], ...]
"""A matrix of exact numbers, rows first."""


@dataclass(frozen=True)
class Space:
    """How a group acts on the points of the space its algebra is about.

    The vectors e0 (the origin, where there is one), e1 … and e∞ (where there is one) are moved
    linearly. All numbers are exact.
    """

    algebra: Algebra
    origin: int | None
    directions: tuple[int, ...]
    at_infinity: int | None
    generators: tuple[Mapping[Blade, Rational], ...]

    @staticmethod
    def of(algebra: Algebra, group: LieGroup) -> Space:
        """Read off the metric: projective (e0² = 0), conformal (e0·e∞ = −1) or of vectors."""
        n = algebra.dimension
        null = [not any(row) for row in algebra.gram]
        generators = tuple(g.bivector for g in group.generators)
        if null[0] and not any(null[1:]):
            return Space(algebra, 0, tuple(range(1, n)), None, generators)
        first, last = algebra.gram[0], algebra.gram[-1]
        if n > 2 and not first[0] and not last[-1] and first[-1] == -1 and first.count(0) == n - 1:
            return Space(algebra, 0, tuple(range(1, n - 1)), n - 1, generators)
        return Space(algebra, None, tuple(range(n)), None, generators)

    @property
    def basis_size(self) -> int:
        """Origin, directions and infinity, with a place for the origin even if there is none."""
        return 1 + len(self.directions) + (self.at_infinity is not None)

    @property
    def infinity(self) -> int:
        """Where e∞ stands."""
        return self.basis_size - 1

    @property
    def _vectors(self) -> list[int | None]:
        end = [] if self.at_infinity is None else [self.at_infinity]
        return [self.origin, *self.directions, *end]

    @property
    def _is_projective(self) -> bool:
        return self.origin is not None and self.at_infinity is None

    def _embedded(self, k: int) -> Multivector:
        """Basis vector k as the multivector that motors act on: in PGA its dual."""
        vector = self._vectors[k]
        if vector is None:
            return {}
        return self.algebra.complement(1 << vector) if self._is_projective else {1 << vector: 1}

    def _coordinates(self, element: Multivector) -> dict[int, Rational]:
        found: dict[int, Rational] = {}
        for k in range(self.basis_size):
            for blade, sign in self._embedded(k).items():
                if blade in element:
                    found[k] = element[blade] * sign
        return found

    def sandwich(
        self, left: Mapping[Blade, Rational], k: int, right: Mapping[Blade, Rational]
    ) -> dict[int, Rational]:
        """Coordinates of left e_k right."""
        return self._coordinates(
            self.algebra.multiply(self.algebra.multiply(left, self._embedded(k)), right)
        )

    @cached_property
    def brackets(self) -> tuple[tuple[dict[int, Rational], ...], ...]:
        """[E_i, e_k], for each generator and each basis vector."""
        result = []
        for generator in self.generators:
            row = []
            for k in range(self.basis_size):
                bracket = self.algebra.multiply(generator, self._embedded(k))
                back = self.algebra.multiply(self._embedded(k), generator)
                add_scaled(bracket, back, -1)
                row.append(self._coordinates(bracket))
            result.append(tuple(row))
        return tuple(result)

    @property
    def affine(self) -> bool:
        """Whether straight lines stay straight: no generator moves e∞ but by a factor."""
        if self.at_infinity is None:
            return True
        return all(set(row[self.infinity]) <= {self.infinity} for row in self.brackets)

    @cached_property
    def velocities(self) -> tuple[tuple[Rational, ...], ...]:
        """Of the origin under each generator."""
        d = range(1, len(self.directions) + 1)
        return tuple(tuple(row[0].get(j, 0) for j in d) for row in self.brackets)

    @cached_property
    def turns(self) -> tuple[Linear, ...]:
        """Γ_i, what each generator does to directions: Γ[j][k] along j of the image of k."""
        d = range(1, len(self.directions) + 1)
        return tuple(tuple(tuple(row[k].get(j, 0) for k in d) for j in d) for row in self.brackets)

    @cached_property
    def growths(self) -> tuple[Rational, ...]:
        """σ_i, the relative growth of lengths under each generator."""
        if self.at_infinity is None:
            return (0,) * len(self.generators)
        return tuple(row[self.infinity].get(self.infinity, 0) for row in self.brackets)

    @property
    def translates(self) -> bool:
        """Whether the origin moves."""
        return any(any(v) for v in self.velocities)

    @property
    def scales(self) -> bool:
        """Whether lengths change."""
        return any(self.growths)
