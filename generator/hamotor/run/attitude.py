"""The rotation matrix a motor holds.

A motor's rotor part are its blades of directions alone: in space s + e23 e2∧e3 + e31 e3∧e1 +
e12 e1∧e2 with quaternion (q0, q1, q2, q3) = (s, −e23, −e31, −e12), in the plane s = cos φ/2 and
e12 = −sin φ/2. What translates or scales adds blades with e0 or e∞, and a factor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

AXES = "xyzw"
"""Of positions, in order."""


def has_attitude(algebra: str, blades: Iterable[str]) -> bool:
    """Whether such motors turn bodies: not in space-time, nor where they bend lines.

    Conformal maps that do so have blades with e0 and without e∞.
    """
    if algebra.startswith("cga"):
        return not any("0" in blade and "i" not in blade for blade in blades)
    return algebra != "sta"


def rotation_matrices(
    blades: Mapping[str, NDArray[Any]],
) -> NDArray[Any]:
    """R with v_world = R v_body, shape (n, d, d), d the highest index among the blades.

    `blades`: blade → components of the motors, shape (n,) each.  The size of the rotor part does
    not matter: only its direction is used.  R_jk is the part along e_j of M e_k M~ / M M~.
    Numbers are doubles, or objects such as fractions.
    """
    dimension = max(int(index) for blade in blades for index in blade[1:] if index.isdecimal())
    rotor = [(blade[1:], x) for blade, x in blades.items() if not set(blade) & {"0", "i"}]
    size = np.sum([x * x for _, x in rotor], axis=0)
    rotation = np.zeros((len(size), dimension, dimension), size.dtype)
    for left, x in rotor:
        for right, y in rotor:
            for k in range(dimension):
                sign, indices = _sorted(f"{left}{k + 1}{right[::-1]}")
                if len(indices) == 1:
                    rotation[:, int(indices) - 1, k] += sign * x * y / size
    return rotation


def _sorted(indices: str) -> tuple[int, str]:
    """A product of orthonormal vectors as a sign and a blade."""
    sign, rest = 1, ""
    for index in indices:
        larger = sum(other > index for other in rest)
        sign *= (-1) ** larger
        at = len(rest) - larger
        if rest[:at].endswith(index):
            rest = rest[: at - 1] + rest[at:]
        else:
            rest = rest[:at] + index + rest[at:]
    return sign, rest


def angle_between(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """The angle of the rotation from one attitude to the other, radians in [0, π], shape (n,).

    Both: shape (n, d, d).  From |R1 − R2|, which keeps its digits at small angles: for a rotation
    by α in one plane |R − 1|_F = 2√2 sin α/2.
    """
    distance = np.linalg.norm(one - other, axis=(-2, -1))
    half: NDArray[np.float64] = np.arcsin(np.clip(distance / (2 * np.sqrt(2)), 0, 1))
    return 2 * half
