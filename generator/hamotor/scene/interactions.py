"""What acts on the bodies of a scene."""

from __future__ import annotations

from dataclasses import dataclass

from hamotor.scene.motors import Vector


@dataclass(frozen=True)
class Gravity:
    """A uniform field: every body has the potential -m g·x_c, x_c its centre of mass."""

    acceleration: Vector
    """g in the world frame, m/s²."""


@dataclass(frozen=True)
class Spring:
    """A massless spring with potential ½ k (|x - y| - ℓ)², from a body point x to y.

    y is a point of the world, or of another body.
    """

    body: str
    at: Vector
    """The attached point of `body`, in its body frame, m."""
    anchor: Vector | None
    """y, in the world frame, m; None where the spring joins two bodies."""
    other: str | None
    """The other body; None where the spring is anchored to the world."""
    other_at: Vector | None
    """The attached point of `other`, in its body frame, m."""
    stiffness: float
    """k, N/m."""
    rest_length: float
    """ℓ, m."""


@dataclass(frozen=True)
class Potential:
    """Any other potential of the places of bodies; `Scene.potential` holds their sum."""


Interaction = Gravity | Spring | Potential
