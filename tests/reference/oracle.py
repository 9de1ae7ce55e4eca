"""A slow, independent geometric algebra: words of orthogonal vectors, sorted by swapping.

The Gram matrix is diagonalised by congruence, f = P e with P G Pᵀ diagonal; products are taken of
words in the orthogonal vectors f; outer-product blades of the given basis go there and back by
minors of P⁻¹ and P.  Everything else follows its textbook definition.  Exact, for any symmetric
rational Gram matrix: degenerate, null, oblique.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import cache
from itertools import combinations
from typing import Any

Blade = tuple[int, ...]
"""Indices of basis vectors in ascending order: their outer product."""

Multivector = Mapping[Blade, Any]
Matrix = tuple[tuple[Fraction, ...], ...]


def congruence(gram: Sequence[Sequence[Fraction]]) -> Matrix:
    """Rows P of an orthogonal basis: P G Pᵀ is diagonal and P invertible."""
    size = len(gram)

    def product(x: Sequence[Fraction], y: Sequence[Fraction]) -> Fraction:
        total = Fraction(0)
        for i in range(size):
            for j in range(size):
                total += x[i] * Fraction(gram[i][j]) * y[j]
        return total

    rest = [[Fraction(int(i == j)) for j in range(size)] for i in range(size)]
    chosen: list[list[Fraction]] = []
    while rest:
        square = next((k for k, v in enumerate(rest) if product(v, v)), None)
        if square is None:
            pairs = combinations(range(len(rest)), 2)
            pair = next(((k, m) for k, m in pairs if product(rest[k], rest[m])), None)
            if pair is None:
                return tuple(tuple(v) for v in [*chosen, *rest])
            k, m = pair
            rest[k] = [x + y for x, y in zip(rest[k], rest[m], strict=True)]
            square = k
        pivot = rest.pop(square)
        norm = product(pivot, pivot)
        chosen.append(pivot)
        rest = [
            [x - product(v, pivot) / norm * y for x, y in zip(v, pivot, strict=True)] for v in rest
        ]
    return tuple(tuple(v) for v in chosen)


def determinant(matrix: Sequence[Sequence[Fraction]]) -> Fraction:
    """By expansion along the first row."""
    if not matrix:
        return Fraction(1)
    total = Fraction(0)
    for column, x in enumerate(matrix[0]):
        if x:
            minor = [[*row[:column], *row[column + 1 :]] for row in matrix[1:]]
            total += (-1) ** column * x * determinant(minor)
    return total


def inverse(matrix: Matrix) -> Matrix:
    """By Cramer's rule."""
    size = len(matrix)
    whole = determinant(matrix)

    def cofactor(i: int, j: int) -> Fraction:
        rows = [[*row[:j], *row[j + 1 :]] for k, row in enumerate(matrix) if k != i]
        return determinant(rows) * (-1 if (i + j) % 2 else 1)

    return tuple(tuple(cofactor(j, i) / whole for j in range(size)) for i in range(size))


class Oracle:
    """The geometric algebra of a basis with a Gram matrix."""

    def __init__(self, gram: Sequence[Sequence[Fraction | int]]) -> None:
        """Find an orthogonal basis."""
        self.gram = tuple(tuple(Fraction(x) for x in row) for row in gram)
        self.dimension = len(self.gram)
        self.to_given = congruence(self.gram)
        self.to_orthogonal = inverse(self.to_given)
        self.squares = [
            sum(
                (
                    row[i] * self.gram[i][j] * row[j]
                    for i in range(self.dimension)
                    for j in range(self.dimension)
                ),
                Fraction(0),
            )
            for row in self.to_given
        ]
        self.blades: list[Blade] = [
            blade
            for grade in range(self.dimension + 1)
            for blade in combinations(range(self.dimension), grade)
        ]
        self.pseudoscalar: Blade = tuple(range(self.dimension))
        self.product_of_blades = cache(self._product_of_blades)

    def _word_product(self, a: Blade, b: Blade) -> tuple[Blade, Fraction]:
        """Product of two words of orthogonal vectors: sort by swaps, then square equal ones."""
        word = [*a, *b]
        sign = 1
        for _ in word:
            for k in range(len(word) - 1):
                if word[k] > word[k + 1]:
                    word[k], word[k + 1] = word[k + 1], word[k]
                    sign = -sign
        value = Fraction(sign)
        kept: list[int] = []
        for vector in word:
            if kept and kept[-1] == vector:
                kept.pop()
                value *= self.squares[vector]
            else:
                kept.append(vector)
        return tuple(kept), value

    def _changed(self, blade: Blade, basis: Matrix) -> dict[Blade, Fraction]:
        """A blade of one basis in another, row i of `basis` being vector i there."""
        result = {}
        for other in combinations(range(self.dimension), len(blade)):
            value = determinant([[basis[i][j] for j in other] for i in blade])
            if value:
                result[other] = value
        return result

    def _product_of_blades(self, a: Blade, b: Blade) -> dict[Blade, Fraction]:
        result: dict[Blade, Fraction] = {}
        for word_a, x in self._changed(a, self.to_orthogonal).items():
            for word_b, y in self._changed(b, self.to_orthogonal).items():
                word, z = self._word_product(word_a, word_b)
                if z:
                    for blade, w in self._changed(word, self.to_given).items():
                        result[blade] = result.get(blade, Fraction(0)) + x * y * z * w
        return {blade: x for blade, x in result.items() if x}

    def extended(
        self, product: Callable[[Blade, Blade], Multivector], a: Multivector, b: Multivector
    ) -> dict[Blade, Any]:
        """A product of blades, bilinear."""
        result: dict[Blade, Any] = {}
        for blade_a, x in a.items():
            for blade_b, y in b.items():
                for blade, z in product(blade_a, blade_b).items():
                    term = x * y * _plain(z)
                    result[blade] = result[blade] + term if blade in result else term
        return {blade: x for blade, x in result.items() if x}

    def gp(self, a: Multivector, b: Multivector) -> dict[Blade, Any]:
        """Geometric product."""
        return self.extended(self.product_of_blades, a, b)

    def _graded(
        self, a: Multivector, b: Multivector, grade: Callable[[int, int], int]
    ) -> dict[Blade, Any]:
        def part(x: Blade, y: Blade) -> Multivector:
            wanted = grade(len(x), len(y))
            product = self.product_of_blades(x, y)
            return {blade: z for blade, z in product.items() if len(blade) == wanted}

        return self.extended(part, a, b)

    def outer(self, a: Multivector, b: Multivector) -> dict[Blade, Any]:
        """<a b> of grade i + j."""
        return self._graded(a, b, lambda i, j: i + j)

    def inner(self, a: Multivector, b: Multivector) -> dict[Blade, Any]:
        """<a b> of grade |i − j|."""
        return self._graded(a, b, lambda i, j: abs(i - j))

    def left_contraction(self, a: Multivector, b: Multivector) -> dict[Blade, Any]:
        """<a b> of grade j − i."""
        return self._graded(a, b, lambda i, j: j - i)

    def right_contraction(self, a: Multivector, b: Multivector) -> dict[Blade, Any]:
        """<a b> of grade i − j."""
        return self._graded(a, b, lambda i, j: i - j)

    def commutator(self, a: Multivector, b: Multivector) -> dict[Blade, Any]:
        """½(a b − b a)."""
        return scaled(Fraction(1, 2), added(self.gp(a, b), scaled(-1, self.gp(b, a))))

    def anticommutator(self, a: Multivector, b: Multivector) -> dict[Blade, Any]:
        """½(a b + b a)."""
        return scaled(Fraction(1, 2), added(self.gp(a, b), self.gp(b, a)))

    def reverse(self, a: Multivector) -> dict[Blade, Any]:
        """Every outer product of vectors in reversed order: one swap for each pair."""
        return {blade: x * (-1) ** sum(1 for _ in combinations(blade, 2)) for blade, x in a.items()}

    def grade(self, a: Multivector, grade: int) -> dict[Blade, Any]:
        """<a> of one grade."""
        return {blade: x for blade, x in a.items() if len(blade) == grade}

    def complement(self, a: Multivector) -> dict[Blade, Any]:
        """The linear map with b ∧ b* = I for every basis blade b."""
        result: dict[Blade, Any] = {}
        for blade, x in a.items():
            rest = tuple(i for i in self.pseudoscalar if i not in blade)
            orientation = self.outer({blade: 1}, {rest: 1})[self.pseudoscalar]
            result[rest] = x * orientation  # ±1, its own inverse
        return result

    def complement_inverse(self, a: Multivector) -> dict[Blade, Any]:
        """The multivector whose complement is a."""
        result: dict[Blade, Any] = {}
        for blade in self.blades:
            ((rest, sign),) = self.complement({blade: Fraction(1)}).items()
            if rest in a:
                result[blade] = a[rest] * sign
        return result

    def regressive(self, a: Multivector, b: Multivector) -> dict[Blade, Any]:
        """(a ∨ b)* = a* ∧ b*."""
        return self.complement_inverse(self.outer(self.complement(a), self.complement(b)))

    def sandwich(self, m: Multivector, x: Multivector) -> dict[Blade, Any]:
        """m x ~m."""
        return self.gp(self.gp(m, x), self.reverse(m))

    def cayley(self, bivector: Multivector) -> dict[Blade, Any]:
        """(1 + B)(1 − B)⁻¹, the inverse by solving X (1 − B) = 1 + B over the even blades."""
        even = [blade for blade in self.blades if len(blade) % 2 == 0]
        denominator = added({(): Fraction(1)}, scaled(-1, bivector))
        numerator = added({(): Fraction(1)}, bivector)
        columns = [self.gp({blade: Fraction(1)}, denominator) for blade in even]
        rows = [
            [Fraction(column.get(blade, 0)) for column in columns]
            + [Fraction(numerator.get(blade, 0))]
            for blade in even
        ]
        return {b: x for b, x in zip(even, solved(rows), strict=True) if x}


def solved(rows: list[list[Fraction]]) -> list[Fraction]:
    """The solution of a regular linear system given as an augmented matrix."""
    size = len(rows)
    for column in range(size):
        pivot = next(r for r in range(column, size) if rows[r][column])
        rows[column], rows[pivot] = rows[pivot], rows[column]
        head = rows[column][column]
        rows[column] = [x / head for x in rows[column]]
        for r in range(size):
            if r != column and rows[r][column]:
                factor = rows[r][column]
                rows[r] = [x - factor * y for x, y in zip(rows[r], rows[column], strict=True)]
    return [row[-1] for row in rows]


def _plain(x: Any) -> Any:
    """An integer where it is one: floating-point numbers of any precision multiply with it."""
    return x.numerator if isinstance(x, Fraction) and x.denominator == 1 else x


def scaled(factor: Any, a: Multivector) -> dict[Blade, Any]:
    """`factor` a."""
    return {blade: factor * x for blade, x in a.items() if x}


def added(a: Multivector, b: Multivector) -> dict[Blade, Any]:
    """a + b."""
    result = dict(a)
    for blade, x in b.items():
        result[blade] = result[blade] + x if blade in result else x
    return {blade: x for blade, x in result.items() if x}
