"""Principal frames: what the steppers see is the body that the scene describes."""

from __future__ import annotations

import random

import numpy as np
import pytest
from numpy.typing import NDArray
from tests.rigid import parse_scene, read_scene

from hamotor.scene import inertia
from hamotor.scene.motors import Matrix, motor_of, quaternion_of_matrix, rotation_matrix
from hamotor.scene.principal import PrincipalFrame, principal_axes, principal_frame


def random_rotation(rng: random.Random) -> NDArray[np.float64]:
    q = np.array([rng.gauss(0, 1) for _ in range(4)])
    w, x, y, z = q / np.linalg.norm(q)
    return rotation_matrix((w, -x, -y, -z))


def random_body(rng: random.Random) -> tuple[float, tuple[float, ...], Matrix]:
    return inertia.of_points(
        [(rng.uniform(0.1, 2), [rng.uniform(-1, 1) for _ in range(3)]) for _ in range(5)]
    )


def adjoint(frame: PrincipalFrame) -> NDArray[np.float64]:
    """Rates of the principal frame → rates of the body frame: Ω = QΩ', V = QV' - Ω×c."""
    q = frame.axes
    c1, c2, c3 = frame.center
    hat = np.array([[0, -c3, c2], [c3, 0, -c1], [-c2, c1, 0]])
    return np.block([[q, np.zeros((3, 3))], [hat @ q, q]])


@pytest.mark.parametrize("seed", range(50))
def test_the_kinetic_energy_is_diagonal_in_the_principal_frame(seed: int) -> None:
    mass, center, tensor = random_body(random.Random(seed))
    frame = principal_frame(mass, center, tensor)
    change = adjoint(frame)
    kinetic = change.T @ inertia.kinetic_matrix(mass, center, tensor) @ change
    assert kinetic == pytest.approx(np.diag([*frame.moments, mass, mass, mass]), abs=1e-13)


@pytest.mark.parametrize("seed", range(50))
def test_the_inertia_about_a_fixed_point_is_diagonal_in_its_principal_frame(seed: int) -> None:
    mass, center, tensor = random_body(random.Random(seed))
    frame = principal_frame(mass, center, tensor, translates=False)
    about_point = inertia.about_origin(mass, center, tensor)
    assert frame.axes.T @ about_point @ frame.axes == pytest.approx(
        np.diag(frame.moments), abs=1e-13
    )
    assert frame.motor == frame.rotor
    assert frame.center == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("seed", range(50))
def test_the_principal_frame_is_right_handed_and_the_closest_to_the_body_frame(seed: int) -> None:
    mass, center, tensor = random_body(random.Random(seed))
    axes = principal_frame(mass, center, tensor).axes
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1)


def test_a_diagonal_tensor_keeps_its_axes_and_their_order_exactly() -> None:
    for moments in [(3.0, 1.0, 2.5), (1.0, 1.0, 1.0), (2.0, 2.0, 1.0)]:
        assert principal_axes(np.diag(moments)) == (moments, (1.0, 0.0, 0.0, 0.0))


def test_a_body_given_in_its_principal_frame_pays_nothing() -> None:
    for name in ("dzhanibekov", "tumble", "heavy_top", "spring_pendulum", "planar"):
        assert all(frame.is_body_frame for frame in read_scene(name).principal), name


def test_a_slightly_turned_tensor_keeps_the_order_of_its_axes() -> None:
    angle = 0.2
    turn = rotation_matrix((np.cos(angle / 2), 0.0, 0.0, -np.sin(angle / 2)))
    moments, rotor = principal_axes(turn @ np.diag([3.0, 1.0, 2.5]) @ turn.T)
    assert moments == pytest.approx((3.0, 1.0, 2.5))
    assert rotor == pytest.approx((np.cos(angle / 2), 0, 0, -np.sin(angle / 2)))


def test_a_point_of_the_body_goes_to_the_principal_frame_and_back() -> None:
    mass, center, tensor = random_body(random.Random(1))
    frame = principal_frame(mass, center, tensor)
    point = (0.3, -0.4, 0.5)
    inside = frame.from_body_frame(point)
    assert frame.axes @ inside + np.array(center) == pytest.approx(np.array(point), abs=1e-15)


@pytest.mark.parametrize("seed", range(50))
def test_quaternion_and_rotation_matrix_are_inverse_to_each_other(seed: int) -> None:
    rng = random.Random(seed)
    matrix = random_rotation(rng)
    if seed < 6:  # half turns: no component of the quaternion but one
        matrix = np.diag([[1, -1, -1], [-1, 1, -1], [-1, -1, 1]][seed % 3]).astype(float)
    w, x, y, z = quaternion_of_matrix(matrix)
    assert rotation_matrix((w, -x, -y, -z)) == pytest.approx(matrix, abs=1e-15)
    assert w >= 0


def test_a_motor_moves_the_origin_to_the_body_and_turns_it() -> None:
    """By the sandwich of theory.md §1 written out: R from the rotor, and x = the translation."""
    rng = random.Random(7)
    for _ in range(20):
        w, x, y, z = quaternion_of_matrix(random_rotation(rng))
        t = [rng.uniform(-2, 2) for _ in range(3)]
        s, e23, e31, e12, e01, e02, e03, e0123 = motor_of(t, (w, -x, -y, -z))
        assert s * e0123 == pytest.approx(e23 * e01 + e31 * e02 + e12 * e03)  # M M~ = 1
        # The translation is -2 (the e0i part of M) (rotor)~.
        r23, r31, r12 = e23, e31, e12
        back = (
            -2 * (e01 * s + e02 * r12 - e03 * r31 + e0123 * r23),
            -2 * (e02 * s + e03 * r23 - e01 * r12 + e0123 * r31),
            -2 * (e03 * s + e01 * r31 - e02 * r23 + e0123 * r12),
        )
        assert back == pytest.approx(t, abs=1e-14)


def test_given_momentum_and_given_velocities_agree() -> None:
    text = """
    algebra = "pga3"
    [[body]]
    name = "b"
    mass = 2.0
    inertia = [[1.0, 0.1, 0], [0.1, 2.0, 0.2], [0, 0.2, 2.5]]
    center_of_mass = [0.3, -0.1, 0.2]
    {motion}
    [time]
    end = 1
    step = 0.1
    """
    by_rate = parse_scene(
        text.replace("{motion}", "velocity = [1, 2, 3]\nangular_velocity = [-1, 0.5, 2]").encode(),
        name="a",
        file="a.toml",
    ).bodies[0]
    momentum = [float(x) for x in by_rate.momentum]
    given = f"momentum = {{ angular = {momentum[:3]}, linear = {momentum[3:]} }}"
    by_momentum = parse_scene(
        text.replace("{motion}", given).encode(), name="a", file="a.toml"
    ).bodies[0]
    assert by_momentum.momentum == by_rate.momentum
    assert by_momentum.rate == pytest.approx([-1, 0.5, 2, 1, 2, 3], rel=1e-13)
    assert by_rate.kinetic_matrix @ by_rate.rate == pytest.approx(momentum, rel=1e-13)
