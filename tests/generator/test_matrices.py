"""Matrices of versors: what they do, what they cost and what is refused."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import pytest

from hamotor.codegen.kernel import Kernel
from hamotor.codegen.library import request_kernel, request_kernels
from hamotor.codegen.spec import Request, bundled_algebra, parse_algebra
from hamotor.errors import UsageError

COSTS = {
    "pga3 Motor Point": ((25, 21), (9, 9)),
    "pga3 Motor Direction": ((12, 12), (9, 6)),
    "pga3 Motor Plane": ((25, 21), (12, 9)),
    "pga3 Motor Bivector": ((31, 27), (27, 21)),
    "pga2 Motor Point": ((8, 3), (4, 4)),
    "pga4 Motor Point": ((71, 66), (16, 16)),
    "cga3 Motor Vector": ((32, 27), (16, 13)),
    "cga3 Versor Vector": ((113, 107), (25, 20)),
    "cl3 Rotor Vector": ((12, 12), (9, 6)),
    "sta Rotor Vector": ((38, 38), (16, 12)),
}
"""Multiplications and additions of a matrix, and of its application."""


def both(title: str) -> tuple[Kernel, Kernel]:
    algebra, *operands = title.split()
    matrix, transform = request_kernels(
        bundled_algebra(algebra), Request("matrix", tuple(operands), None)
    )
    return matrix, transform


def evaluated(kernel: Kernel, *arguments: dict[str, Fraction]) -> dict[str, Fraction]:
    values = {
        f"{p.name}.{name}": x
        for p, argument in zip(kernel.program.parameters, arguments, strict=True)
        for name, x in argument.items()
    }
    return kernel.program.evaluate(values, {"number": Fraction})


@pytest.mark.parametrize("title", COSTS)
def test_a_matrix_and_its_application_cost_what_they_did(title: str) -> None:
    matrix, transform = (k.program.cost for k in both(title))
    assert ((matrix.mul, matrix.add), (transform.mul, transform.add)) == COSTS[title]


@pytest.mark.parametrize(
    ("title", "unit"),
    [
        ("pga3 Motor Trivector", {"s": "1/3", "e31": "-2/3", "e12": "2/3", "e02": 5, "e03": 5}),
        ("pga3 Motor Origin -> Point", {"s": "3/5", "e23": "4/5", "e01": 2, "e0123": "-3/2"}),
        ("pga3 Mirror Trivector", {"e0": 7, "e1": "2/7", "e2": "-3/7", "e3": "6/7"}),
        ("pga3 Mirror Plane", {"e0": -5, "e1": "2/3", "e2": "1/3", "e3": "-2/3"}),
        ("pga3 Translator Plane", {"s": 1, "e01": 3, "e02": -4, "e03": "1/2"}),
        ("sta Rotor Vector", {"s": "5/4", "e01": "3/4"}),
    ],
)
def test_a_transformed_element_is_the_sandwich_exactly(title: str, unit: dict[str, str]) -> None:
    algebra, left, right, *result = title.replace("->", "").split()
    spec = bundled_algebra(algebra)
    target = result[0] if result else None
    matrix, transform = request_kernels(spec, Request("matrix", (left, right), target))
    sandwich = request_kernel(spec, Request("sandwich", (left, right), target))
    versor = {c.name: Fraction(unit.get(c.name, 0)) for c in spec.elements[left].components}
    dice = Random(title)
    x = {c.name: Fraction(dice.randint(-9, 9)) for c in spec.elements[right].components}
    found = evaluated(transform, evaluated(matrix, versor), x)
    assert found == evaluated(sandwich, versor, x)


def test_what_no_matrix_can_be_made_of_says_why() -> None:
    with pytest.raises(UsageError, match="Plane must be a unit versor"):
        both("pga3 Plane Point")
    text = """name = "flat"
description = "a plane"
basis = ["e1", "e2"]
gram = { diagonal = [1, 1] }
[element.Rot]
doc = "rotor"
symbol = "r"
blades = ["s", "e12"]
unit = true
[element.Vec]
doc = "vector"
symbol = "v"
blades = ["e1", "e2"]
[element.RotVecMatrix]
doc = "taken"
symbol = "q"
blades = ["s"]
[kernels]
matrix = ["Rot Vec"]
"""
    spec = parse_algebra(text, "flat.toml")
    with pytest.raises(UsageError, match="RotVecMatrix is an element type already"):
        request_kernels(spec, spec.requests[0])
