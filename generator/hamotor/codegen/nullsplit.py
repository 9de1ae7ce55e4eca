"""Cheaper products for algebras with a hyperbolic pair: matrices over the rest of the algebra.

Null vectors n, m with n·m = g ≠ 0, orthogonal to all other basis vectors, span a factor of 2 × 2
matrices: with E = n ∧ m, E² = g², the idempotents P± = ½(1 ± E/g) are its diagonal units.  Written
in A P+ and A P− instead of A and A E, half of all products vanish: conformal even × even is a
product of 2 × 2 quaternion matrices, 128 multiplications instead of 256.  Nothing here knows that:
the change of basis is applied to any bilinear product, and the cost decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Algebra, Blade, Multivector, Rational, magnitude, ratio
from hamotor.codegen.element import Element
from hamotor.codegen.polynomial import Polynomial, PolynomialMultivector
from hamotor.codegen.program import (
    Expression,
    Parameter,
    Product,
    Program,
    number,
    polynomial_expression,
)


def hyperbolic_pairs(algebra: Algebra) -> list[tuple[int, int]]:
    """Pairs of null basis vectors that see each other and nothing else."""
    pairs = []
    for i in range(algebra.dimension):
        partners = [j for j in range(algebra.dimension) if algebra.gram[i][j]]
        if len(partners) == 1 and partners[0] > i:
            j = partners[0]
            if [k for k in range(algebra.dimension) if algebra.gram[j][k]] == [i]:
                pairs.append((i, j))
    return pairs


def _times_pair(algebra: Algebra, pair: tuple[int, int], blade: Blade) -> tuple[Blade, Rational]:
    """A E/g for a blade A without the pair: a blade and its coefficient."""
    i, j = pair
    both = 1 << i | 1 << j
    sign = algebra.outer(blade, both)[blade | both]
    return blade | both, ratio(sign, algebra.gram[i][j])


def split_program(
    algebra: Algebra,
    pair: tuple[int, int],
    product: Callable[[Blade, Blade], Multivector],
    operands: tuple[
        tuple[Parameter, PolynomialMultivector], tuple[Parameter, PolynomialMultivector]
    ],
    result: Element,
    factor: Rational,
) -> Program | None:
    """The product computed in the basis A P±; None where an operand or the result forbids it."""
    if not result.is_blades:
        return None
    bindings: list[tuple[str, Expression]] = []

    def bind(name: str, p: Polynomial) -> Polynomial:
        bindings.append((name, polynomial_expression(p)))
        return {(name,): 1}

    values = [split_value(algebra, pair, value, p.name, bind) for p, value in operands]
    turned = poly.apply_bilinear(product, *values)
    both = 1 << pair[0] | 1 << pair[1]
    outputs: dict[str, Expression] = {}
    by_blade = {next(iter(c.embedding)): c for c in result.components}

    def out(blade: Blade, p: Polynomial) -> None:
        component = by_blade[blade]
        outputs[component.name] = polynomial_expression(
            poly.scaled(p, ratio(factor, component.embedding[blade]))
        )

    for blade, half_sum in by_blade.items():
        if blade & both == both and blade ^ both in by_blade:
            continue
        other, sign = (0, 0) if blade & both else _times_pair(algebra, pair, blade)
        if other not in by_blade or blade & both:
            out(blade, turned.get(blade, {}))
            continue
        name = algebra.blade_name(blade)
        plus, minus = dict(turned.get(blade, {})), dict(turned.get(blade, {}))
        rest = turned.get(other, {})
        poly.add_scaled(plus, rest, ratio(1, sign))
        poly.add_scaled(minus, rest, ratio(-1, sign))
        # Terms that do not come from A P± in both operands would be doubled first and the results
        # halved: half sums, of which only the other terms are halved, cost less.
        whole = 2 if any(magnitude(x) == 2 for p in (plus, minus) for x in p.values()) else 1
        halves: dict[str, Polynomial] = {}
        for half, p in (("plus", plus), ("minus", minus)):
            if p:
                expression = polynomial_expression(poly.scaled(p, ratio(1, whole)))
                bindings.append((f"{half}_{name}", expression))
                halves[half] = {(f"{half}_{name}",): whole}
        total: Polynomial = {}
        difference: Polynomial = {}
        for half, sign_of_half in (("plus", 1), ("minus", -1)):
            poly.add_scaled(total, halves.get(half, {}), 1)
            poly.add_scaled(difference, halves.get(half, {}), sign_of_half)
        half_difference = by_blade[other]
        outputs[half_sum.name] = _halved(total, ratio(factor, half_sum.embedding[blade]))
        outputs[half_difference.name] = _halved(
            difference, ratio(factor * sign, half_difference.embedding[other])
        )
    ordered = tuple((c.name, outputs[c.name]) for c in result.components)
    return Program(tuple(p for p, _ in operands), tuple(bindings), ordered, result)


def _halved(p: Polynomial, factor: Rational) -> Expression:
    if not p:
        return number(0)
    content = ratio(poly.content(p) * factor, 2)
    if magnitude(content) == 1:
        return polynomial_expression(poly.scaled(p, ratio(factor, 2)))
    return Product(
        number(content), polynomial_expression(poly.scaled(p, ratio(1, poly.content(p))))
    )


def split_value(
    algebra: Algebra,
    pair: tuple[int, int],
    value: Mapping[Blade, Polynomial],
    prefix: str,
    bind: Callable[[str, Polynomial], Polynomial],
) -> PolynomialMultivector:
    """The same multivector over sums and differences of its coefficients, which `bind` names."""
    both = 1 << pair[0] | 1 << pair[1]
    result: PolynomialMultivector = {}
    for blade, p in value.items():
        if blade & both not in (0, both):
            result[blade] = dict(p)
    for blade in sorted({b & ~both for b in value if b & both in (0, both)}):
        other, sign = _times_pair(algebra, pair, blade)
        parts: dict[int, Polynomial] = {}
        for direction, half in ((1, "plus"), (-1, "minus")):
            total: Polynomial = dict(value.get(blade, {}))
            poly.add_scaled(total, value.get(other, {}), ratio(direction, sign))
            if len(total) > 1:
                total = bind(f"{prefix}_{half}_{algebra.blade_name(blade)}", total)
            parts[direction] = total
        plus, minus = parts[1], parts[-1]
        for target, sum_sign, scale in ((blade, 1, 1), (other, -1, sign)):
            mixed: Polynomial = {}
            poly.add_scaled(mixed, plus, ratio(scale, 2))
            poly.add_scaled(mixed, minus, ratio(sum_sign * scale, 2))
            if mixed:
                result[target] = mixed
    return result


@dataclass(frozen=True)
class SplitProduct:
    """A geometric product over A P±, of which only certain grades are wanted.

    Of A and A E a result may want one alone, as a bivector does: its coefficient of A P+ is then
    that of A, and that of A P− as well, if the other is 0.  side: +1 or −1, on which of the two it
    is read off, for half of the operations; or 0: it is multiplied out as in the given basis, so
    that no term is added that must cancel.
    """

    algebra: Algebra
    pair: tuple[int, int]
    side: int
    grades: frozenset[int]

    def __str__(self) -> str:
        """How the product is made, for a kernel's documentation."""
        n, m = (self.algebra.basis[i] for i in self.pair)
        return f"multiplied out in A P±, P± = ½(1 ± {n}∧{m}/{n}·{m})"

    def multiply(
        self,
        left: PolynomialMultivector,
        right: PolynomialMultivector,
        prefixes: tuple[str, str],
        bind: Callable[[str, Polynomial], Polynomial],
    ) -> PolynomialMultivector:
        """The product, over sums and differences of coefficients that `bind` names."""
        sides = [
            split_value(self.algebra, self.pair, value, prefix, bind)
            for value, prefix in zip((left, right), prefixes, strict=True)
        ]
        split = self.read(poly.apply_bilinear(self.algebra.geometric, *sides))
        if self.side:
            return split
        given = poly.apply_bilinear(self.algebra.geometric, left, right)
        both = self._both
        return {b: (given if b & both in (0, both) else split).get(b, {}) for b in given}

    def read(self, value: Mapping[Blade, Polynomial]) -> PolynomialMultivector:
        """The wanted grades of a multivector, read off on this side."""
        result = {b: dict(p) for b, p in value.items() if b.bit_count() in self.grades}
        for blade in {b & ~self._both for b in value if b & self._both in (0, self._both)}:
            other, sign = _times_pair(self.algebra, self.pair, blade)
            ends = [b for b in (blade, other) if b.bit_count() in self.grades]
            if self.side and len(ends) == 1:
                zero, scale = (other, ratio(1, sign)) if ends == [blade] else (blade, sign)
                total = result.setdefault(ends[0], {})
                poly.add_scaled(total, value.get(zero, {}), self.side * scale)
        return result

    @property
    def _both(self) -> Blade:
        return 1 << self.pair[0] | 1 << self.pair[1]


def split_products(algebra: Algebra, grades: Iterable[int]) -> list[SplitProduct]:
    """Those of every hyperbolic pair."""
    wanted = frozenset(grades)
    pairs = hyperbolic_pairs(algebra)
    return [SplitProduct(algebra, pair, side, wanted) for pair in pairs for side in (0, 1, -1)]
