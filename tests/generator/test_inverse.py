"""The inverse of any multivector, exactly, in every kind of signature up to five dimensions."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import combinations
from random import Random
from typing import Any

import pytest

from hamotor.codegen.library import request_kernel
from hamotor.codegen.spec import AlgebraSpec, parse_algebra
from hamotor.errors import UsageError

Gram = list[list[int]]

OBLIQUE: Gram = [[2, 1, 0, 0], [1, -1, 3, 0], [0, 3, 0, 1], [0, 0, 1, 1]]
CONFORMAL: Gram = [[0, 0, 0, 0, -1], [0, 1, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0]]
CONFORMAL.append([-1, 0, 0, 0, 0])


def diagonal(*squares: int) -> Gram:
    return [[x if i == j else 0 for j in range(len(squares))] for i, x in enumerate(squares)]


GRAMS = {
    "R(1)": diagonal(1),
    "R(0,1)": diagonal(-1),
    "R(0,0,1)": diagonal(0),
    "R(2)": diagonal(1, 1),
    "R(1,1)": diagonal(1, -1),
    "R(1,0,1)": diagonal(0, 1),
    "R(3)": diagonal(1, 1, 1),
    "R(2,0,1)": diagonal(0, 1, 1),
    "R(0,0,3)": diagonal(0, 0, 0),
    "R(4)": diagonal(1, 1, 1, 1),
    "R(1,3)": diagonal(1, -1, -1, -1),
    "R(3,0,1)": diagonal(0, 1, 1, 1),
    "R(2,0,2)": diagonal(0, 0, 1, 1),
    "oblique": OBLIQUE,
    "R(5)": diagonal(1, 1, 1, 1, 1),
    "R(2,3)": diagonal(1, 1, -1, -1, -1),
    "R(4,0,1)": diagonal(0, 1, 1, 1, 1),
    "R(1,1,3)": diagonal(0, 0, 0, 1, -1),
    "R(4,1) null": CONFORMAL,
}


def blades(n: int) -> list[str]:
    digits = [str(i + 1) for i in range(n)]
    return ["s"] + ["e" + "".join(c) for g in range(1, n + 1) for c in combinations(digits, g)]


def algebra(gram: Gram, held: list[str] | None = None, wanted: str = "All") -> AlgebraSpec:
    n = len(gram)
    lines = [
        'name = "foo"',
        'description = "a test"',
        f"basis = {json.dumps([f'e{i + 1}' for i in range(n)])}",
        f"gram = {{ matrix = {json.dumps(gram)} }}",
        "[element.All]",
        'doc = "Any multivector."',
        'symbol = "a"',
        f"blades = {json.dumps(held or blades(n))}",
        "[element.Whole]",
        'doc = "Any multivector."',
        'symbol = "w"',
        f"blades = {json.dumps(blades(n))}",
        "[kernels]",
        f'inverse = ["{wanted}"]',
    ]
    return parse_algebra("\n".join(lines), "foo.toml")


def inverted(spec: AlgebraSpec, numbers: dict[int, Fraction]) -> dict[int, Fraction]:
    """The kernel on exact rationals; blades are bit masks."""
    kernel = request_kernel(spec, spec.requests[0])
    (parameter,) = kernel.program.parameters
    values = {
        f"{parameter.name}.{c.name}": numbers.get(blade, Fraction(0)) * x
        for c in parameter.element.components
        for blade, x in c.embedding.items()
    }
    found = kernel.program.evaluate(values, {"number": Fraction})
    result = kernel.program.result
    assert result is not None
    total: dict[int, Fraction] = {}
    for c in result.components:
        for blade, x in c.embedding.items():
            total[blade] = total.get(blade, Fraction(0)) + x * found[c.name]
    return {blade: x for blade, x in total.items() if x}


def random_value(held: Any, seed: int) -> dict[int, Fraction]:
    random = Random(seed)
    numbers = {b: Fraction(random.randint(-9, 9), random.randint(1, 5)) for b in held}
    return {b: x for b, x in numbers.items() if x}


@pytest.mark.parametrize("gram", GRAMS.values(), ids=GRAMS)
def test_inverse_from_both_sides(gram: Gram) -> None:
    spec = algebra(gram)
    tried = 0
    for seed in range(6):
        value = random_value(spec.elements["All"].blades, seed)
        try:
            inverse = inverted(spec, value)
        except ZeroDivisionError:
            continue
        tried += 1
        assert spec.algebra.multiply(value, inverse) == {0: 1}
        assert spec.algebra.multiply(inverse, value) == {0: 1}
    assert tried >= 4


@pytest.mark.parametrize(
    ("gram", "held"),
    [
        (diagonal(1, 1, 1), ["s", "e1", "e2", "e3"]),
        (diagonal(0, 1, 1, 1), ["s", "e1", "e2", "e12", "e123"]),
        (diagonal(1, -1, -1, -1), ["e1", "e2", "e34"]),
        (CONFORMAL, ["s", "e1", "e5", "e23"]),
    ],
)
def test_inverse_of_a_sparse_element(gram: Gram, held: list[str]) -> None:
    spec = algebra(gram, held, "All -> Whole")
    for seed in range(20, 26):
        value = random_value(spec.elements["All"].blades, seed)
        try:
            inverse = inverted(spec, value)
        except ZeroDivisionError:
            continue
        assert spec.algebra.multiply(value, inverse) == {0: 1}
        break
    else:
        raise AssertionError("nothing was invertible")


@pytest.mark.parametrize(
    ("gram", "value"),
    [
        (diagonal(1, 1, 1, 1), {0: 1, 1: 1}),  # 1 + e1 = 2 × an idempotent
        (diagonal(0, 1, 1), {1: 1}),
        (diagonal(0, 1, 1), {1: 3, 7: 2}),  # the ideal of e0
        (diagonal(1, 1, 1, 1, 1), {0: 1, 16: -1}),
        (CONFORMAL, {1: 1, 3: 5}),
        (diagonal(1, -1), {}),
    ],
)
def test_what_has_no_inverse_divides_by_zero(gram: Gram, value: dict[int, int]) -> None:
    spec = algebra(gram)
    with pytest.raises(ZeroDivisionError):
        inverted(spec, {blade: Fraction(x) for blade, x in value.items()})
    kernel = request_kernel(spec, spec.requests[0])
    assert "Not finite where a has no inverse." in kernel.notes


def test_more_than_five_dimensions_are_refused() -> None:
    spec = algebra(diagonal(1, 1, 1, 1, 1, 1))
    message = "neither even nor odd exists for at most 5 dimensions; foo has 6"
    with pytest.raises(UsageError, match=message):
        request_kernel(spec, spec.requests[0])


def test_a_type_that_does_not_hold_the_inverse_is_refused() -> None:
    spec = algebra(diagonal(1, 1, 1), ["s", "e1", "e23"])
    with pytest.raises(UsageError, match="has parts along e123, which All does not hold; name a"):
        request_kernel(spec, spec.requests[0])


def test_costs_are_pinned() -> None:
    costs = []
    for n in range(1, 6):
        spec = algebra(diagonal(*([1] * n)))
        cost = request_kernel(spec, spec.requests[0]).program.cost
        costs.append((cost.mul, cost.add, cost.div))
    assert costs == [(4, 1, 1), (8, 3, 1), (47, 19, 1), (191, 135, 1), (1339, 1111, 1)]
