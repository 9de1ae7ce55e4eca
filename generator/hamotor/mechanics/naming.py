"""What the momentum paired with a constant element of a Lie algebra is called."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hamotor.mechanics.coordinates import Coordinates


@dataclass(frozen=True)
class Generators:
    """The generators of a group by what they do to space."""

    names: tuple[str, ...]
    dimension: int
    """Of space."""
    turning: tuple[int, ...]
    """The rotation of the plane, or those about e1, e2 and e3; () if there are others."""
    moving: tuple[int, ...]
    """The translations along e1, e2, …; () if the group fixes the origin."""
    kinds: tuple[str, ...]
    """Of each: `angular`, `linear`, `dilation` or `conformal` (quadratic in the position)."""
    translates: bool
    """Whether the origin moves; otherwise it is a fixed point of every body."""

    @staticmethod
    def of(body: Coordinates) -> Generators:
        """Read off how the group acts on the points of space."""
        space = body.space
        kinds = []
        for velocity, turn, growth, bracket in zip(
            space.velocities, space.turns, space.growths, space.brackets, strict=True
        ):
            at_infinity = set() if space.at_infinity is None else set(bracket[space.infinity])
            if at_infinity - {space.infinity}:
                kinds.append("conformal")
            elif any(velocity):
                kinds.append("linear")
            else:
                kinds.append("angular" if any(map(any, turn)) or not growth else "dilation")
        turning = tuple(i for i, kind in enumerate(kinds) if kind == "angular")
        return Generators(
            tuple(g.name for g in body.group.generators),
            body.dimension,
            turning if len(turning) == {2: 1, 3: 3}.get(body.dimension) else (),
            tuple(i for i, kind in enumerate(kinds) if kind == "linear"),
            tuple(kinds),
            space.translates,
        )

    def reading(self, element: Sequence[Fraction], body: str = "") -> tuple[str, str]:
        """The name's suffix and the words for the momentum paired with `element`.

        body: whose momentum it is, in its own frame; "" for the total in the world frame.
        """
        frame = f"of {body}, body frame" if body else "world frame"
        terms = [(i, x) for i, x in enumerate(element) if x != 0]
        if len(terms) == 1:
            origin = "the fixed point"
            if self.translates:
                origin = "the body frame's origin" if body else "the world's origin"
            words = self._of_one(terms[0][0], origin)
            return "", f"{words}, {frame}" if body else f"total {words}, {frame}"
        spelled = spelled_out([(self.names[i], x) for i, x in terms])
        axis = self._axis(element)
        if axis:
            words = f"{spelled}: angular momentum about {axis}"
            return "_about_axis", f"{words}, {frame}" if body else words
        return "_combination", f"{spelled}, {'' if body else 'total over the bodies, '}{frame}"

    def _axis(self, element: Sequence[Fraction]) -> str:
        """Where the axis of a rotation is that is parallel to a basis vector; otherwise ""."""
        omega = [element[i] for i in self.turning]
        v = [element[i] for i in self.moving]
        others = {*range(len(element))} - {*self.turning, *self.moving}
        if (
            len(v) != self.dimension
            or sum(1 for w in omega if w != 0) != 1
            or any(element[i] != 0 for i in others)
        ):
            return ""
        if self.dimension == 2:
            return point([-v[1], v[0]])  # v = -ω×A with ω = 1
        k = next(i for i, w in enumerate(omega) if w != 0)
        if v[k] != 0:
            return ""
        i, j = (k + 1) % 3, (k + 2) % 3
        through = [Fraction(0)] * 3
        through[i], through[j] = -v[j], v[i]
        return f"the axis along e{k + 1} through {point(through)}"

    def _of_one(self, generator: int, origin: str) -> str:
        kind, name = self.kinds[generator], self.names[generator]
        if kind == "linear":
            return f"linear momentum along e{self.moving.index(generator) + 1}"
        return f"{kind} momentum {name} about {origin}"


def spelled_out(terms: Sequence[tuple[str, Fraction]]) -> str:
    """A linear combination in words: `e12 - 0.5*e01`."""
    text = "" if terms[0][1] == 1 else f"{float(terms[0][1]):.12g}*"
    text += terms[0][0]
    for name, x in terms[1:]:
        factor = "" if abs(x) == 1 else f"{float(abs(x)):.12g}*"
        text += f" {'-' if x < 0 else '+'} {factor}{name}"
    return text


def point(coordinates: Sequence[Fraction]) -> str:
    """A point in words: `(1, 0, -0.5)`."""
    return "(" + ", ".join(f"{float(x):.12g}" for x in coordinates) + ")"
