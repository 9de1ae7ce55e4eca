"""Errors of the lean kernels in units of the last place, against power series with 50 digits."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
from tests.reference.oracle import Blade, Oracle, added, scaled

from hamotor.codegen import read_algebra
from hamotor.codegen.algebra import grade
from hamotor.codegen.kernel import Kernel
from hamotor.codegen.library import library
from hamotor.codegen.spec import bundled_path

ALGEBRAS = ("pga3", "pga2", "cl3")
DIGITS = 50
FLOAT: Mapping[str, Callable[..., Any]] = {
    "number": lambda x: np.float64(float(x)),
    "sqrt": np.sqrt,
    "fma": lambda a, b, c: np.float64(float(Fraction(a) * Fraction(b) + Fraction(c))),
    "sin": np.sin,
    "cos": np.cos,
    "acos": np.arccos,
    "abs": np.abs,
    "max_abs": lambda *x: max(map(abs, x)),
    "rounding": lambda: np.float64(2.0**-44),
    "moderate": lambda: np.float64(2.0**208),
}
"""The scalar functions in doubles."""

Value = dict[Blade, Any]


def lean_kernels() -> list[tuple[str, Kernel]]:
    """Every lean kernel of the bundled algebras, with its algebra's name."""
    return [
        (algebra, kernel)
        for algebra in ALGEBRAS
        for kernel in library(read_algebra(bundled_path(algebra)))
        if kernel.name.endswith("_lean")
    ]


class Measure:
    """Errors of one kernel."""

    def __init__(self, algebra: str, kernel: Kernel) -> None:
        """Look at a kernel of an algebra."""
        spec = read_algebra(bundled_path(algebra))
        self.kernel = kernel
        self.oracle = Oracle([list(row) for row in spec.algebra.gram])
        self.null = {i for i, row in enumerate(spec.algebra.gram) if not any(row)}

    def held(self, value: Value, element: Any) -> list[float]:
        """Components of an element, rounded."""
        masked = {sum(1 << i for i in blade): x for blade, x in value.items()}
        return [
            float(
                sum((self._mp(x) * masked.get(blade, 0) for blade, x in f.items()), mpmath.mpf(0))
            )
            for f in element.reading
        ]

    @staticmethod
    def _mp(x: Any) -> Any:
        return mpmath.mpf(x.numerator) / x.denominator

    def value(self, numbers: Sequence[Any], element: Any) -> Value:
        """The multivector of components."""
        total: Value = {}
        for x, component in zip(numbers, element.components, strict=True):
            for blade, c in component.embedding.items():
                vectors = tuple(i for i in range(8) if blade >> i & 1)
                total[vectors] = total.get(vectors, 0) + self._mp(c) * mpmath.mpf(x)
        return total

    def run(self, numbers: Sequence[float]) -> list[float]:
        """The kernel in doubles."""
        (parameter,) = self.kernel.program.parameters
        names = [f"{parameter.name}.{c.name}" for c in parameter.element.components]
        values = {name: np.float64(x) for name, x in zip(names, numbers, strict=True)}
        with np.errstate(all="ignore"):
            return [float(x) for x in self.kernel.program.evaluate(values, FLOAT).values()]

    def bivector(
        self, dice: random.Random, angle: float, translation: float, element: Any
    ) -> Value:
        """Of an element's grade 2: θ and the translation in any direction."""
        blades = [tuple(i for i in range(8) if b >> i & 1) for b in element.blades if grade(b) == 2]
        value: Value = {blade: mpmath.mpf(dice.gauss(0, 1)) for blade in blades}
        for turning, size in ((True, angle), (False, translation)):
            part = [b for b in blades if (not self.null & set(b)) == turning]
            length = mpmath.sqrt(sum(value[b] ** 2 for b in part)) if part else 1
            for b in part:
                value[b] *= size / length
        return value

    def exponential(self, b: Value) -> Value:
        """Power series of b / 2¹², squared."""
        small = scaled(mpmath.ldexp(1, -12), b)
        one: Value = {(): mpmath.mpf(1)}
        term, total = dict(one), dict(one)
        for n in range(1, 16):
            term = scaled(mpmath.mpf(1) / n, self.oracle.gp(term, small))
            total = added(total, term)
        for _ in range(12):
            total = self.oracle.gp(total, total)
        return total

    def error(self, dice: random.Random, angle: float, translation: float) -> float:
        """Distance from the truth in units of the last place of the result's norm."""
        return self.numbers_and_error(dice, angle, translation)[1]

    def numbers_and_error(
        self, dice: random.Random, angle: float, translation: float, factor: float = 1.0
    ) -> tuple[list[float], float]:
        """The kernel's argument, and how far its result is from the truth.

        factor: a logarithm's argument is this times the versor whose logarithm is the truth.
        """
        (operand,) = self.kernel.operands
        result = self.kernel.program.result
        rates = operand if self.kernel.name in ("exp_lean", "cayley_lean") else result
        with mpmath.workdps(DIGITS):
            match self.kernel.name:
                case "exp_lean":
                    numbers = self.held(self.bivector(dice, angle, translation, rates), operand)
                    truth = self.exponential(self.value(numbers, operand))
                case "log_lean":
                    truth = self.bivector(dice, angle, translation, rates)
                    numbers = self.held(scaled(factor, self.exponential(truth)), operand)
                case "cayley_lean":
                    size = float(mpmath.tan(mpmath.mpf(angle) / 2))
                    numbers = self.held(self.bivector(dice, size, translation, rates), operand)
                    truth = self._cayley(self.value(numbers, operand))
                case "cayley_inverse_lean":
                    size = float(mpmath.tan(mpmath.mpf(angle) / 2))
                    truth = self.bivector(dice, size, translation, rates)
                    numbers = self.held(self._cayley(truth), operand)
                case _:
                    b = self.bivector(dice, angle, translation, operand)
                    exact = self.exponential(b)
                    weight = math.exp(dice.uniform(-3, 3))
                    numbers = self.held(scaled(weight, exact), operand)
                    truth = exact
            found = self.value(self.run(numbers), result)
            return numbers, float(self._distance(found, truth) / self._size(truth) * 2**53)

    def _cayley(self, b: Value) -> Value:
        """(1 + B)(1 − B)⁻¹ = (1 + B)² (1 − B²)⁻¹, where 1 − B² = n + w and w² = 0."""
        one: Value = {(): mpmath.mpf(1)}
        above = added(one, b)
        norm = self.oracle.gp(above, added(one, scaled(-1, b)))
        n = norm[()]
        rest = {blade: x for blade, x in norm.items() if blade}
        inverse = added({(): 1 / n}, scaled(-1 / n**2, rest))
        return self.oracle.gp(self.oracle.gp(above, above), inverse)

    @staticmethod
    def _size(a: Value) -> Any:
        return mpmath.sqrt(sum((x * x for x in a.values()), mpmath.mpf(0)))

    def _distance(self, a: Value, b: Value) -> Any:
        return self._size(added(a, scaled(-1, b)))


def inputs(dice: random.Random, largest: float, count: int) -> Iterator[tuple[float, float]]:
    """Angles up to the largest, also tiny ones, and translations from 1e-6 to 1e3."""
    for i in range(count):
        low = dice.uniform(0, largest) if i % 2 else 10 ** dice.uniform(-12, 0) * min(1, largest)
        yield low, 10 ** dice.uniform(-6, 3)


def worst(algebra: str, kernel: Kernel, largest: float, count: int) -> float:
    """Largest error at half angles up to the largest."""
    dice = random.Random(1)
    measure = Measure(algebra, kernel)
    return max(measure.error(dice, *x) for x in inputs(dice, largest, count))
