"""A Clifford algebra over any symmetric rational Gram matrix: blades and their exact products.

A basis blade is a bit mask over the basis vectors and stands for their *outer* product in
ascending order.  In a null or otherwise oblique basis the outer product of two basis vectors is not
their geometric product, so products follow Clifford's rule `v A = v ∧ A + v ⌋ A` and nothing
assumes an orthogonal basis.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

Blade = int
Rational = int | Fraction
"""An exact coefficient; integers stay integers, which is several times faster."""
Multivector = dict[Blade, Rational]


def simplest(x: Rational) -> Rational:
    """The same number, as an integer if it is one."""
    return x.numerator if x.denominator == 1 else x


def magnitude(x: Rational) -> Rational:
    """|x|, exact."""
    return x if x >= 0 else -x


def ratio(a: Rational, b: Rational) -> Rational:
    """a / b, exact."""
    return simplest(Fraction(a, b))


def grade(blade: Blade) -> int:
    """Number of basis vectors in the blade."""
    return blade.bit_count()


def add_scaled(into: Multivector, other: Mapping[Blade, Rational], factor: Rational) -> None:
    """Add `factor * other` to `into`, dropping what cancels."""
    for blade, coefficient in other.items():
        total = into.get(blade, 0) + factor * coefficient
        if total:
            into[blade] = total
        else:
            into.pop(blade, None)


def outer_sign(a: Blade, b: Blade) -> int:
    """Sign of `a ∧ b` relative to the blade `a | b`; 0 if they share a vector."""
    if a & b:
        return 0
    swaps = 0
    rest = a >> 1
    while rest:
        swaps += (rest & b).bit_count()
        rest >>= 1
    return -1 if swaps & 1 else 1


@dataclass(frozen=True)
class Algebra:
    """Geometric algebra of the vector space with the given basis and Gram matrix.

    basis: names of the basis vectors, in the order that orients the pseudoscalar.
    gram:  symmetric matrix of the inner products of the basis vectors, exact.
    lengths: for each basis vector the power of length that a coefficient of it carries (e0 of PGA:
        1, e∞ of CGA: 1 and its e0: −1); empty: none does.
    """

    name: str
    basis: tuple[str, ...]
    gram: tuple[tuple[Rational, ...], ...]
    lengths: tuple[int, ...] = ()
    _products: dict[tuple[Blade, Blade], Multivector] = field(
        default_factory=dict, repr=False, compare=False
    )

    @property
    def dimension(self) -> int:
        """Number of basis vectors, n."""
        return len(self.basis)

    @property
    def pseudoscalar(self) -> Blade:
        """The blade of all basis vectors, I."""
        return (1 << self.dimension) - 1

    @property
    def signature(self) -> tuple[int, int, int]:
        """(p, q, r): numbers of positive, negative and null directions (Sylvester)."""
        rows = [list(row) for row in self.gram]
        positive = negative = 0
        live = list(range(self.dimension))
        while live:
            pivot = next((i for i in live if rows[i][i]), None)
            if pivot is None:
                pair = next(((i, j) for i in live for j in live if rows[i][j]), None)
                if pair is None:
                    break
                i, j = pair  # replace e_i by e_i + e_j, whose square is 2 e_i·e_j
                for k in range(self.dimension):
                    rows[i][k] += rows[j][k]
                for k in range(self.dimension):
                    rows[k][i] += rows[k][j]
                pivot = i
            square = Fraction(rows[pivot][pivot])
            positive, negative = positive + (square > 0), negative + (square < 0)
            live.remove(pivot)
            column = {i: rows[i][pivot] / square for i in live}
            for i in live:
                for j in live:
                    rows[i][j] -= column[i] * rows[pivot][j]
        return positive, negative, self.dimension - positive - negative

    def length_power(self, blade: Blade) -> int:
        """The power of length in the unit of the blade's coefficient."""
        return sum(power for i, power in enumerate(self.lengths) if blade >> i & 1)

    def _contract_vector(self, vector: int, blade: Blade) -> Multivector:
        """Left contraction of a basis vector on a basis blade."""
        result: Multivector = {}
        sign = 1
        for other in range(self.dimension):
            if blade >> other & 1:
                product = self.gram[vector][other]
                if product:
                    result[blade ^ (1 << other)] = sign * product
                sign = -sign
        return result

    def _vector_times(self, vector: int, blade: Blade) -> Multivector:
        result = self._contract_vector(vector, blade)
        bit = 1 << vector
        sign = outer_sign(bit, blade)
        if sign:
            add_scaled(result, {blade | bit: sign}, 1)
        return result

    def blade_product(self, a: Blade, b: Blade) -> Multivector:
        """Geometric product of two basis blades, exact."""
        known = self._products.get((a, b))
        if known is not None:
            return known
        result: Multivector = {}
        if a == 0:
            result[b] = 1
        else:
            # a = v ∧ rest = v rest − v⌋rest
            vector = (a & -a).bit_length() - 1
            rest = a & (a - 1)
            for blade, coefficient in self.blade_product(rest, b).items():
                add_scaled(result, self._vector_times(vector, blade), coefficient)
            for blade, coefficient in self._contract_vector(vector, rest).items():
                add_scaled(result, self.blade_product(blade, b), -coefficient)
        self._products[a, b] = result
        return result

    def geometric(self, a: Blade, b: Blade) -> Multivector:
        """Geometric product a b."""
        return self.blade_product(a, b)

    def _graded(self, a: Blade, b: Blade, keep: Callable[[int, int], int]) -> Multivector:
        wanted = keep(grade(a), grade(b))
        return {c: x for c, x in self.blade_product(a, b).items() if grade(c) == wanted}

    def outer(self, a: Blade, b: Blade) -> Multivector:
        """Outer product a ∧ b."""
        sign = outer_sign(a, b)
        return {a | b: sign} if sign else {}

    def inner(self, a: Blade, b: Blade) -> Multivector:
        """Symmetric inner product: the part of grade |i − j| (scalars included)."""
        return self._graded(a, b, lambda i, j: abs(i - j))

    def left_contraction(self, a: Blade, b: Blade) -> Multivector:
        """Left contraction a ⌋ b: the part of grade j − i."""
        return self._graded(a, b, lambda i, j: j - i)

    def right_contraction(self, a: Blade, b: Blade) -> Multivector:
        """Right contraction a ⌊ b: the part of grade i − j."""
        return self._graded(a, b, lambda i, j: i - j)

    def _symmetrised(self, a: Blade, b: Blade, sign: int) -> Multivector:
        twice: Multivector = {}
        add_scaled(twice, self.blade_product(a, b), 1)
        add_scaled(twice, self.blade_product(b, a), sign)
        return {blade: simplest(Fraction(x, 2)) for blade, x in twice.items()}

    def commutator(self, a: Blade, b: Blade) -> Multivector:
        """Commutator product a × b = ½(ab − ba)."""
        return self._symmetrised(a, b, -1)

    def anticommutator(self, a: Blade, b: Blade) -> Multivector:
        """Anticommutator product ½(ab + ba)."""
        return self._symmetrised(a, b, 1)

    def complement(self, a: Blade) -> Multivector:
        """Right complement a*: a ∧ a* = I.  Needs no metric."""
        rest = self.pseudoscalar ^ a
        return {rest: outer_sign(a, rest)}

    def complement_inverse(self, a: Blade) -> Multivector:
        """The blade whose right complement is a (the left complement of a)."""
        rest = self.pseudoscalar ^ a
        return {rest: outer_sign(rest, a)}

    def regressive(self, a: Blade, b: Blade) -> Multivector:
        """Regressive product (join in PGA): (a ∨ b)* = a* ∧ b*."""
        ((a_dual, a_sign),) = self.complement(a).items()
        ((b_dual, b_sign),) = self.complement(b).items()
        result: Multivector = {}
        for blade, coefficient in self.outer(a_dual, b_dual).items():
            add_scaled(result, self.complement_inverse(blade), coefficient * a_sign * b_sign)
        return result

    def multiply(self, a: Mapping[Blade, Rational], b: Mapping[Blade, Rational]) -> Multivector:
        """Geometric product of two multivectors."""
        result: Multivector = {}
        for blade_a, x in a.items():
            for blade_b, y in b.items():
                add_scaled(result, self.blade_product(blade_a, blade_b), x * y)
        return result

    def suffixes(self) -> tuple[str, ...]:
        """What each basis vector contributes to a blade's name: `e1` gives `1`."""
        return tuple(name[1:] for name in self.basis)

    def blade_name(self, blade: Blade) -> str:
        """Name of a blade with its vectors in ascending order; the scalar is `s`."""
        if blade == 0:
            return "s"
        suffixes = self.suffixes()
        return "e" + "".join(suffixes[i] for i in range(self.dimension) if blade >> i & 1)

    def parse_blade(self, text: str) -> tuple[Blade, int]:
        """Blade and orientation sign of a name such as `e31` (= −e13).

        Raises ValueError, naming the basis vectors, where the name is not a blade of this algebra.
        """
        if text in ("s", "1"):
            return 0, 1
        blade, sign = 0, 1
        rest = text[1:] if text.startswith("e") else ""
        suffixes = sorted(enumerate(self.suffixes()), key=lambda item: -len(item[1]))
        while rest:
            index = next((i for i, suffix in suffixes if rest.startswith(suffix)), None)
            if index is None or blade >> index & 1:
                break
            sign *= outer_sign(blade, 1 << index)
            blade |= 1 << index
            rest = rest[len(self.basis[index]) - 1 :]
        if rest or not blade:
            known = ", ".join(self.basis)
            raise ValueError(f'"{text}" is not a blade; the basis vectors are {known}')
        return blade, sign


def reverse_sign(blade: Blade) -> int:
    """Sign of the reversal ~ on a blade: (−1)^(k(k−1)/2)."""
    k = grade(blade)
    return -1 if (k * (k - 1) // 2) & 1 else 1


def grades_of(blades: Iterable[Blade]) -> tuple[int, ...]:
    """The distinct grades, ascending."""
    return tuple(sorted({grade(blade) for blade in blades}))
