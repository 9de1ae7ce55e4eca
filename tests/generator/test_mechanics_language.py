"""The expression language: what a text means, and that a wrong one is a UsageError and no more."""

from __future__ import annotations

import pytest
import sympy

from hamotor.mechanics.language import (
    Function,
    Record,
    Vector,
    Vocabulary,
    body,
    coordinates,
    cross,
    dot,
    norm,
    read_expression,
)

x, y, z, t = sympy.symbols("x y z t", real=True)
V, U = Vector((x, y, z)), Vector((y, z, x))
VOCABULARY = Vocabulary(
    values={"x": x, "y": y, "z": z, "t": t, "v": V, "u": U, "m": Record({"e12": x, "e23": y})},
    bodies=("top", "box"),
    functions={
        "at": Function((body(), coordinates("x", "y", "z")), lambda _, point: point + V),
        "scale": Function((body(default="top"),), lambda which: x if which.name == "top" else y),
    },
)


@pytest.mark.parametrize(
    ("text", "built"),
    [
        ("x*v + u/2", x * V + U / 2),
        ("-(v - u)", -(V - U)),
        ("dot(v, u)", dot(V, U)),
        ("cross(v, [1, 2, 3])", cross(V, Vector((1, 2, 3)))),
        ("norm(v - u)", norm(V - U)),
        ("at(top, 0.1, 0, 0).x", 0.1 + x),
        ("scale(box) + scale()", x + y),
    ],
)
def test_text_and_python_build_the_same_object(text: str, built: object) -> None:
    if isinstance(built, sympy.Expr):
        built = sympy.nsimplify(built, rational=True)
    assert read_expression(text, VOCABULARY, "H") == built
