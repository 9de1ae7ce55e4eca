"""The groups a scene can live on: views of the algebras' specs, made when first asked for.

Components stand in the order of the specs, which is that of the compiled scene's C ABI: rotations
before translations, planes in the order 23, 31, 12.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hamotor.codegen.spec import AlgebraSpec


@dataclass(frozen=True)
class Group:
    """One group of rotors as a scene sees it."""

    name: str
    algebra: str
    dimension: int
    """Of the space the bodies move in: 2, 3 or 4."""
    motor: tuple[str, ...]
    """Blades of a group element, in order."""
    generators: tuple[str, ...]
    """Names of the generators, in order: the keys of a momentum."""
    rotations: int
    """How many of the generators, from the first, are rotations."""
    lengths: tuple[int, ...]
    """The power of length in each rate: 0 for rotations and dilations, 1 for translations, −1 for
    special conformal motions."""
    units: tuple[str, ...]
    """Of the momenta, in SI."""
    scales: bool = False
    """Whether bodies change their size, and lines stay straight."""

    @property
    def translates(self) -> bool:
        """Whether the body frame's origin can move; otherwise it is a fixed point."""
        return 1 in self.lengths


def groups_in(spec: AlgebraSpec) -> tuple[Group, ...]:
    """The groups of an algebra's spec, bundled or a user's own."""
    from hamotor.mechanics.space import Space

    groups = []
    for group in spec.groups:
        space = Space.of(spec.algebra, group)
        turning = [unit == "rad/s" for unit in group.rate_units]
        groups.append(
            Group(
                name=group.name,
                algebra=spec.name,
                dimension=len(space.directions),
                motor=tuple(c.name for c in group.element.components),
                generators=tuple(g.name for g in group.generators),
                rotations=[*turning, False].index(False),
                lengths=group.rate_lengths,
                units=group.momentum_units,
                scales=space.scales and space.affine,
            )
        )
    return tuple(groups)


@cache
def bundled_groups(algebra: str) -> tuple[Group, ...]:
    """Every group of a bundled algebra; UsageError where there is no such algebra."""
    from hamotor.codegen.spec import bundled_algebra

    return groups_in(bundled_algebra(algebra))


OPEN = {"pga3": ("SE3", "SO3"), "pga2": ("SE2",)}
"""The groups that scenes can name, by algebra."""
ALGEBRAS = tuple(OPEN)


def groups_of(algebra: str) -> tuple[Group, ...]:
    """The groups of `algebra`; the first is the default, the smallest that holds any free body."""
    return tuple(group for group in bundled_groups(algebra) if group.name in OPEN[algebra])


class _OpenGroups(Mapping[str, Group]):
    """Name → group: names at once, groups when asked for."""

    def __iter__(self) -> Iterator[str]:
        return (name for names in OPEN.values() for name in names)

    def __len__(self) -> int:
        return sum(len(names) for names in OPEN.values())

    def __getitem__(self, name: str) -> Group:
        for algebra, names in OPEN.items():
            if name in names:
                return next(group for group in groups_of(algebra) if group.name == name)
        raise KeyError(name)


GROUPS: Mapping[str, Group] = _OpenGroups()
