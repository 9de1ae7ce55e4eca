"""The rotation matrix a motor holds.

A motor's rotor part is s + e23 e2∧e3 + e31 e3∧e1 + e12 e1∧e2 with quaternion (q0, q1, q2, q3) =
(s, −e23, −e31, −e12); in the plane s = cos φ/2 and e12 = −sin φ/2.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Float = TypeVar("Float", np.float64, np.longdouble)


def rotation_matrices(
    blades: Mapping[str, NDArray[Float]],
) -> NDArray[Float]:
    """R with v_world = R v_body, shape (n, 3, 3), or (n, 2, 2) for a motor without e23.

    `blades`: blade → components of the motors, shape (n,) each.  The size of the rotor part does
    not matter: only its direction is used.
    """
    s, e12 = blades["s"], blades["e12"]
    if "e23" not in blades:
        size = s * s + e12 * e12
        cos, sin = (s * s - e12 * e12) / size, -2 * s * e12 / size
        return np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)
    w, x, y, z = s, -blades["e23"], -blades["e31"], -e12
    twice = 2 / (w * w + x * x + y * y + z * z)
    rows = [
        [1 - twice * (y * y + z * z), twice * (x * y - w * z), twice * (x * z + w * y)],
        [twice * (x * y + w * z), 1 - twice * (x * x + z * z), twice * (y * z - w * x)],
        [twice * (x * z - w * y), twice * (y * z + w * x), 1 - twice * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def angle_between(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """The angle of the rotation from one attitude to the other, radians in [0, π], shape (n,).

    Both: shape (n, d, d).  From |R1 − R2|, which keeps its digits at small angles: for a rotation
    by α in one plane |R − 1|_F = 2√2 sin α/2.
    """
    distance = np.linalg.norm(one - other, axis=(-2, -1))
    half: NDArray[np.float64] = np.arcsin(np.clip(distance / (2 * np.sqrt(2)), 0, 1))
    return 2 * half
