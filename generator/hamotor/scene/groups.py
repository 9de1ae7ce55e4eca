"""The groups a scene can live on: the order of their components, and which dimension they act in.

Components stand in the order of the compiled scene's C ABI: rotations before translations, planes
in the order 23, 31, 12.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Group:
    """One group of rotors as a scene sees it."""

    name: str
    algebra: str
    dimension: int
    """Of the space the bodies move in: 2 or 3."""
    motor: tuple[str, ...]
    """Blades of a group element, in order."""
    generators: tuple[str, ...]
    """Blades of the generators -½ e_i∧e_j and -½ e0∧e_i, in order: the keys of a momentum."""
    rotations: int
    """How many of the generators, from the first, are rotations."""

    @property
    def translates(self) -> bool:
        """Whether the body frame's origin can move; otherwise it is a fixed point."""
        return len(self.generators) > self.rotations


SE3 = Group(
    name="SE3",
    algebra="pga3",
    dimension=3,
    motor=("s", "e23", "e31", "e12", "e01", "e02", "e03", "e0123"),
    generators=("e23", "e31", "e12", "e01", "e02", "e03"),
    rotations=3,
)
SO3 = Group(
    name="SO3",
    algebra="pga3",
    dimension=3,
    motor=("s", "e23", "e31", "e12"),
    generators=("e23", "e31", "e12"),
    rotations=3,
)
SE2 = Group(
    name="SE2",
    algebra="pga2",
    dimension=2,
    motor=("s", "e12", "e01", "e02"),
    generators=("e12", "e01", "e02"),
    rotations=1,
)

GROUPS = {group.name: group for group in (SE3, SO3, SE2)}
ALGEBRAS = tuple(dict.fromkeys(group.algebra for group in GROUPS.values()))


def groups_of(algebra: str) -> tuple[Group, ...]:
    """The groups of `algebra`; the first is the default, the smallest that holds any free body."""
    return tuple(group for group in GROUPS.values() if group.algebra == algebra)
