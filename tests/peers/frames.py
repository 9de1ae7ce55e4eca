"""Our basis in the orthogonal basis that other libraries have."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from tests.peers.conversation import Array

from hamotor.codegen.algebra import Algebra, Multivector, add_scaled

Vector = Multivector


@dataclass(frozen=True)
class Frame:
    """The linear map that takes our coefficients to another basis of the same space.

    metric:      Gram matrix of that basis.
    matrix:      2ⁿ × 2ⁿ; column k holds our blade k in their blades.
    orientation: our pseudoscalar is this multiple of theirs.
    """

    metric: tuple[tuple[float, ...], ...]
    matrix: Array

    @property
    def orientation(self) -> float:
        """Our pseudoscalar as a multiple of theirs."""
        return float(self.matrix[-1, -1])

    def theirs(self, ours: Array) -> Array:
        """Our coefficients in their basis."""
        return self.matrix @ ours

    def ours(self, theirs: Array) -> Array:
        """Their coefficients in our basis."""
        return np.asarray(np.linalg.solve(self.matrix, theirs), dtype=np.float64)


def same_frame(algebra: Algebra) -> Frame:
    """For libraries that take our basis as it is."""
    metric = tuple(tuple(float(x) for x in row) for row in algebra.gram)
    return Frame(metric, np.eye(1 << algebra.dimension))


def orthogonal_frame(algebra: Algebra) -> Frame:
    """Our basis where it is orthogonal; else e0 = ½(e₋ − e₊) and e∞ = e₊ + e₋, e₊² = 1, e₋² = −1.

    Their order is then e1, e2, …, e₊, e₋.
    """
    n = algebra.dimension
    gram = algebra.gram
    if all(gram[i][j] == 0 for i in range(n) for j in range(i)):
        return same_frame(algebra)
    squares = [*(gram[i][i] for i in range(1, n - 1)), 1, -1]
    metric = tuple(tuple(x if i == j else 0 for j in range(n)) for i, x in enumerate(squares))
    plus, minus = 1 << (n - 2), 1 << (n - 1)
    images: list[Vector] = [{minus: Fraction(1, 2), plus: Fraction(-1, 2)}]
    images += [{1 << i: 1} for i in range(n - 2)]
    images.append({plus: 1, minus: 1})
    other = Algebra("orthogonal", tuple(f"e{i + 1}" for i in range(n)), metric)
    for i in range(n):
        for j in range(n):
            product = other.multiply(images[i], images[j]).get(0, 0)
            assert product == gram[i][j], (i, j)
    matrix = np.zeros((1 << n, 1 << n))
    for mask in range(1 << n):
        image: Multivector = {0: 1}
        for i in range(n):
            if mask >> i & 1:
                image = outer(other, image, images[i])
        for blade, x in image.items():
            matrix[blade, mask] = float(x)
    return Frame(tuple(tuple(float(x) for x in row) for row in metric), matrix)


def outer(algebra: Algebra, a: Multivector, b: Multivector) -> Multivector:
    """a ∧ b."""
    result: Multivector = {}
    for blade_a, x in a.items():
        for blade_b, y in b.items():
            add_scaled(result, algebra.outer(blade_a, blade_b), x * y)
    return result
