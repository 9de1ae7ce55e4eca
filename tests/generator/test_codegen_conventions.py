"""The conventions of theory.md §1-§3, by numbers through the generator's own programs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy
import pytest

from hamotor.codegen.kernel import Kernel
from hamotor.codegen.library import library
from hamotor.codegen.spec import bundled_path, read_algebra

KERNELS = {name: library(read_algebra(bundled_path(name))) for name in ("pga2", "pga3")}

Numbers = numpy.ndarray[tuple[int, ...], numpy.dtype[numpy.float64]]


def found(algebra: str, name: str, operands: Sequence[str]) -> Kernel:
    for kernel in KERNELS[algebra]:
        if kernel.name == name and [e.cpp_name for e in kernel.operands] == list(operands):
            return kernel
    raise AssertionError(f"no {name} {operands}")


def apply(algebra: str, name: str, *operands: tuple[str, Sequence[float] | Numbers]) -> Numbers:
    """A kernel on components given by element type."""
    kernel = found(algebra, name, [element for element, _ in operands])
    values = {
        f"{p.name}.{c.name}": float(x)
        for p, (_, numbers) in zip(kernel.program.parameters, operands, strict=True)
        for c, x in zip(p.element.components, numbers, strict=True)
    }
    results = kernel.program.evaluate(values, {"number": float})
    return numpy.array(list(results.values()), dtype=float)


def rotation(w: float, x: float, y: float, z: float) -> Numbers:
    """Rotation matrix of a unit quaternion."""
    return numpy.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


DICE = numpy.random.default_rng(20)
QUATERNIONS = [q / numpy.linalg.norm(q) for q in DICE.standard_normal((10, 4))]


def translator(t: Numbers) -> list[float]:
    """T = 1 − ½ t_i e0∧e_i."""
    return [1, 0, 0, 0, *(-t / 2), 0]


def quaternion_motor(q: Numbers) -> list[float]:
    """The map w + x i + y j + z k ↦ w − x e23 − y e31 − z e12."""
    w, x, y, z = q
    return [w, -x, -y, -z, 0, 0, 0, 0]


def test_a_translator_moves_points_by_t_and_leaves_directions() -> None:
    t, x = DICE.standard_normal((2, 3))
    moved = apply("pga3", "sandwich", ("Motor", translator(t)), ("Point", x))
    numpy.testing.assert_allclose(moved, x + t, atol=1e-15)
    kept = apply("pga3", "sandwich", ("Motor", translator(t)), ("Direction", x))
    numpy.testing.assert_allclose(kept, x, atol=1e-15)
    origin = apply("pga3", "sandwich", ("Motor", translator(t)), ("Origin", []))
    numpy.testing.assert_allclose(origin, t, atol=1e-15)


def test_a_translator_of_the_plane_moves_points_by_t() -> None:
    t, x = DICE.standard_normal((2, 2))
    moved = apply("pga2", "sandwich", ("Motor", [1, 0, *(-t / 2)]), ("Point", x))
    numpy.testing.assert_allclose(moved, x + t, atol=1e-15)


@pytest.mark.parametrize("q", QUATERNIONS, ids=lambda q: f"w = {q[0]:.2f}")
def test_rotors_are_quaternions_with_ijk_as_minus_e23_e31_e12(q: Numbers) -> None:
    x = DICE.standard_normal(3)
    moved = apply("pga3", "sandwich", ("Motor", quaternion_motor(q)), ("Point", x))
    numpy.testing.assert_allclose(moved, rotation(*q) @ x, atol=1e-14)
    p = QUATERNIONS[0]
    product = apply("pga3", "gp", ("Motor", quaternion_motor(q)), ("Motor", quaternion_motor(p)))
    w, v = q[0], q[1:]
    u, r = p[0], p[1:]
    hamilton = numpy.r_[w * u - v @ r, w * r + u * v + numpy.cross(v, r)]
    numpy.testing.assert_allclose(product, quaternion_motor(hamilton), atol=1e-14)


def test_a_plane_contains_the_points_that_its_equation_says() -> None:
    """n + δ e0 contains x where n·x + δ = 0; else the join is n·x + δ."""
    n, x = DICE.standard_normal((2, 3))
    delta = 0.7
    (value,) = apply("pga3", "regressive", ("Plane", [delta, *n]), ("Point", x))
    assert abs(value) == pytest.approx(abs(n @ x + delta), abs=1e-14)
    (zero,) = apply("pga3", "regressive", ("Plane", [-n @ x, *n]), ("Point", x))
    assert zero == pytest.approx(0, abs=1e-14)


def test_planes_move_with_their_points() -> None:
    q = QUATERNIONS[1]
    t, n, x = DICE.standard_normal((3, 3))
    motor = apply("pga3", "gp", ("Motor", translator(t)), ("Motor", quaternion_motor(q)))
    moved = apply("pga3", "sandwich", ("Motor", motor), ("Plane", [0.3, *n]))
    point = apply("pga3", "sandwich", ("Motor", motor), ("Point", x))
    numpy.testing.assert_allclose(moved[1:], rotation(*q) @ n, atol=1e-14)
    assert moved[1:] @ point + moved[0] == pytest.approx(n @ x + 0.3, abs=1e-13)


def test_generators_act_on_points_as_the_physical_rates() -> None:
    """With generators −½ e0∧e_i and −½ e_i∧e_j, M' = M B moves a point of the body at Ω × x + V."""
    w, v, x = DICE.standard_normal((3, 3))
    rate = [*w, *v]
    identity = [1, 0, 0, 0, 0, 0, 0, 0]
    change = apply("pga3", "kinematics", ("Motor", identity), ("se3::Rate", rate))
    step = 1e-6
    ahead = apply("pga3", "sandwich", ("Motor", identity + step * change), ("Point", x))
    behind = apply("pga3", "sandwich", ("Motor", identity - step * change), ("Point", x))
    velocity = (ahead - behind) / (2 * step)
    numpy.testing.assert_allclose(velocity, numpy.cross(w, x) + v, atol=1e-9)


def test_a_force_line_holds_force_and_torque() -> None:
    """X ∨ f∞ = f_i (e0∧e_i)* + (x × f)_k (e_i∧e_j)*: theory.md §2."""
    x, f = DICE.standard_normal((2, 3))
    line = apply("pga3", "regressive", ("Point", x), ("Direction", f))
    torque = numpy.cross(x, f)
    # (e0∧e1)* = e23 and (e2∧e3)* = e01, and cyclic
    numpy.testing.assert_allclose(line, numpy.r_[f, torque], atol=1e-14)


def test_the_join_of_two_points_is_the_line_of_their_difference() -> None:
    x, y = DICE.standard_normal((2, 3))
    line = apply("pga3", "regressive", ("Point", x), ("Point", y))
    numpy.testing.assert_allclose(line, numpy.r_[y - x, numpy.cross(x, y - x)], atol=1e-14)


def test_momenta_are_complements_of_rates_in_physical_coordinates() -> None:
    """Momentum coordinates pair with rates to P·V + Π·Ω."""
    angular, linear, w, v = DICE.standard_normal((4, 3))
    (value,) = apply(
        "pga3", "pairing", ("se3::Momentum", [*angular, *linear]), ("se3::Rate", [*w, *v])
    )
    assert value == pytest.approx(angular @ w + linear @ v, abs=1e-14)


def test_spatial_momentum_is_transported_as_mechanics_says() -> None:
    """M μ ~M: linear part R P, angular part about the world's origin R Π + t × R P."""
    q = QUATERNIONS[2]
    t, angular, linear = DICE.standard_normal((3, 3))
    motor = apply("pga3", "gp", ("Motor", translator(t)), ("Motor", quaternion_motor(q)))
    found = apply(
        "pga3", "Ad_star_inverse", ("Motor", motor), ("se3::Momentum", [*angular, *linear])
    )
    R = rotation(*q)
    expected = numpy.r_[R @ angular + numpy.cross(t, R @ linear), R @ linear]
    numpy.testing.assert_allclose(found, expected, atol=1e-13)


def test_spatial_rates_are_transported_as_mechanics_says() -> None:
    """M w ~M: angular part R Ω, linear part R V + t × R Ω."""
    q = QUATERNIONS[3]
    t, w, v = DICE.standard_normal((3, 3))
    motor = apply("pga3", "gp", ("Motor", translator(t)), ("Motor", quaternion_motor(q)))
    found = apply("pga3", "Ad", ("Motor", motor), ("se3::Rate", [*w, *v]))
    R = rotation(*q)
    expected = numpy.r_[R @ w, R @ v + numpy.cross(t, R @ w)]
    numpy.testing.assert_allclose(found, expected, atol=1e-13)
