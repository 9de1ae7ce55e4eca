"""Numbers of a scene with more digits than a double: as they are written, and what follows."""

from __future__ import annotations

import copy
import pickle
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest

from hamotor.scene.exact import Exactly, decimal, rounded, rounded_once, text, written
from hamotor.scene.model import Scene
from hamotor.scene.motors import rotation_matrix
from hamotor.scene.reading import parse_scene

HEAD = "[time]\nend = 1.0\nstep = 0.1\n"


def scene_of(text: str) -> Any:
    return parse_scene((text + HEAD).encode(), name="scene", file="scene.toml")


@pytest.mark.parametrize("x", [0.1, -2.5, 1e300, 3.0, 1 / 3])
def test_a_double_stands_for_its_shortest_decimal(x: float) -> None:
    assert decimal(x) == Fraction(repr(x))
    assert type(written(repr(x))) is float


@pytest.mark.parametrize(
    "digits", ["0.1234567890123456789012345", "-3_000.000000000000000000001", "1e22", "2.5E-30"]
)
def test_digits_beyond_a_double_are_remembered(digits: str) -> None:
    x = written(digits)
    assert x == float(digits)
    assert decimal(x) == Fraction(digits.replace("_", ""))
    assert type(x + 1) is float
    assert decimal(pickle.loads(pickle.dumps(x))) == decimal(copy.copy(x)) == decimal(x)


@pytest.mark.parametrize("digits", ["inf", "nan", "1e-400000000", "1e400000000", "0.0", "-0.0"])
def test_numbers_without_a_decimal_of_their_own_are_doubles(digits: str) -> None:
    assert type(written(digits)) is float


def test_a_sum_is_rounded_once_and_known_exactly() -> None:
    total = rounded_once((0.1, 0.2), (1.0, rounded(Fraction(1, 3))))
    assert isinstance(total, Exactly)
    assert decimal(total) == Fraction(1, 50) + Fraction(1, 3)
    assert total == float(decimal(total))
    assert Fraction(text(rounded(Fraction(1, 3)))) == Fraction("0." + 60 * "3")


def test_written_digits_reach_every_part_of_a_body() -> None:
    x = "0.12345678901234567890123456789"
    body = f'algebra = "pga3"\n[[body]]\nname = "body"\nmass = {x}\nbox = [{x}, 1, 2]\n'
    scene = scene_of(body + f"position = [{x}, 0, 0]\nvelocity = [0, {x}, 0]\n")
    assert isinstance(scene, Scene)
    (read,) = scene.bodies
    value = Fraction(x)
    assert decimal(read.mass) == value
    assert decimal(read.principal.moments[1]) == value * (4 + value**2) / 12
    assert scene.exact_state[scene.group.motor.index("e01")] == -value / 2
    assert value**2 in scene.exact_state
    matrix = scene.general.bodies[0].kinetic_matrix
    assert Fraction(int(matrix[3, 3].p), int(matrix[3, 3].q)) == value


def norm_squared(numbers: Any) -> Any:
    return sum((x * x for x in numbers), Fraction(0))


@pytest.mark.parametrize("algebra", ["pga3", "cl3", "cga3"])
@pytest.mark.parametrize(
    "orientation",
    [
        "{ axis = [1, 2, 3], angle = 0.7 }",
        "{ quaternion = [0.5773502, 0.5773502, 0.5773502, 0.0] }",
        "{ matrix = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]] }",
        "{ matrix = [[0.3600001, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]] }",
    ],
)
def test_orientations_have_sixty_digits(algebra: str, orientation: str) -> None:
    scene = scene_of(
        f'algebra = "{algebra}"\n'
        f'[[body]]\nname = "body"\nmass = 1.0\nbox = [1, 2, 3]\norientation = {orientation}\n'
    )
    size = len(scene.group.motor)
    rotor = [
        x
        for x, blade in zip(scene.exact_state[:size], scene.group.motor, strict=True)
        if blade in {"s", "e23", "e31", "e12"}
    ]
    assert abs(norm_squared(rotor) - 1) < Fraction(1, 10**58)
    assert np.allclose(scene.initial_state, [float(x) for x in scene.exact_state], atol=2e-16)
    if "axis" in orientation:
        with mpmath.workdps(70):
            expected = mpmath.cos(mpmath.mpf(7) / 20)
            found = mpmath.mpf(rotor[0].numerator) / rotor[0].denominator
            assert abs(found - expected) < mpmath.mpf(10) ** -59


def test_a_principal_frame_diagonalises_to_sixty_digits() -> None:
    scene = scene_of(
        'algebra = "pga3"\n[[body]]\nname = "body"\nmass = 2.5\ncenter_of_mass = [0.1, 0.2, 0.3]\n'
        "inertia = [[2.0, 0.3, -0.1], [0.3, 1.7, 0.05], [-0.1, 0.05, 2.4]]\n"
    )
    frame = scene.bodies[0].principal
    axes = rotation_matrix([decimal(x) for x in frame.rotor])
    tensor = np.array([[decimal(x) for x in row] for row in scene.bodies[0].inertia])
    turned = axes.T @ tensor @ axes
    for i in range(3):
        for j in range(3):
            wanted = decimal(frame.moments[i]) if i == j else 0
            assert abs(turned[i, j] - wanted) < Fraction(1, 10**57)
    point = [0.3, -0.2, 0.7]
    inside = [decimal(x) for x in frame.from_body_frame(point)]
    outside = axes @ np.array(inside) + np.array([decimal(x) for x in frame.center])
    assert max(abs(a - decimal(b)) for a, b in zip(outside, point, strict=True)) < 1e-57


def test_points_of_a_body_in_its_principal_frame_keep_their_digits() -> None:
    scene = scene_of(
        'algebra = "pga3"\n[[body]]\nname = "body"\nmass = 1.0\ninertia = [1.0, 2.0, 3.0]\n'
    )
    point = (written("0.1000000000000000055511151231257827"), 0.2, 0.3)
    inside = scene.bodies[0].principal.from_body_frame(point)
    assert decimal(inside[0]) == Fraction("0.1000000000000000055511151231257827")


def test_a_symmetric_body_stays_symmetric_in_a_turned_frame() -> None:
    # Two equal moments: of 1 + 2 n nᵀ for n = (2, 3, 6)/7, in decimals that are not exact.
    n = np.array([2, 3, 6]) / 7
    rows = (np.eye(3) * 3 - np.outer(n, n)).tolist()
    scene = scene_of(f'algebra = "pga3"\n[[body]]\nname = "body"\nmass = 1.0\ninertia = {rows}\n')
    moments = sorted(scene.bodies[0].principal.moments)
    assert moments[1] == moments[2]
