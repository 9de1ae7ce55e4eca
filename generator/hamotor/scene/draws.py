"""What differs from member to member of an ensemble, as numbers: who draws needs no algebra.

Every draw is a change of the scene's own start.  A body's motor becomes T(δx) M R S, with a
translation in the world and a rotation and growth in the body's frame; momenta are linear in rates,
so that a change of these changes them by K δB.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from hamotor.scene.motors import Matrix, Vector

Shape = Literal["normal", "uniform", "values"]


@dataclass(frozen=True)
class Draw:
    """A vector for each member.

    `normal`: mean `first`, standard deviation `second`; `uniform`: from `first` to `second`; both
    use a random number for each component.  `values`: member i has number i mod their count.
    """

    shape: Shape
    first: Vector = ()
    second: Vector = ()
    values: tuple[Vector, ...] = ()

    @property
    def numbers(self) -> int:
        """Random numbers that a member needs."""
        return len(self.first)


@dataclass(frozen=True)
class Turn:
    """A rotation in the body's frame.

    `all`: any, by normal numbers that are divided by their norm; `vector`: a rotation vector, rad;
    `axis`: an angle about `axis`, in the plane about the only one.
    """

    kind: Literal["all", "vector", "axis"]
    draw: Draw
    axis: Vector = ()


@dataclass(frozen=True)
class BodyDraws:
    """What is drawn of one body."""

    motor: int
    """Where its motor begins in the state."""
    momentum: int
    """Where its momentum begins in the state."""
    terms: tuple[tuple[int, int, int, int, float], ...] = ()
    """(k, i, j, l, c): c T_i R_j S_l is part of the motor's component k, with T = (1, δx), R the
    rotor (s, e23, e31, e12 or s, e12) and S = ((√q + 1/√q)/2, (√q − 1/√q)/2) for q times the size.
    Empty where the motor stays."""
    place: Draw | None = None
    turn: Turn | None = None
    growth: Draw | None = None
    momenta: tuple[tuple[int, Draw], ...] = ()
    """Changes of the momentum's components from this one on."""
    rates: tuple[tuple[int, Draw], ...] = ()
    """Changes of the rate's components from this one on."""
    kinetic: Matrix = ()
    """K: momentum = K · rate; where rates are drawn."""

    @property
    def draws(self) -> tuple[Draw, ...]:
        """All of them, in the order in which they take random numbers."""
        motor = (self.place, None if self.turn is None else self.turn.draw, self.growth)
        return (
            *(draw for draw in motor if draw is not None),
            *(draw for _, draw in (*self.momenta, *self.rates)),
        )


@dataclass(frozen=True)
class ParameterDraw:
    """A parameter of the energy or of an interaction, which every member has one of its own."""

    name: str
    """`k` of [hamiltonian] or [lagrangian], `2.k` of the second interaction."""
    draw: Draw
    """Of its value."""


@dataclass(frozen=True)
class Ensemble:
    """What a scene says of its ensembles."""

    seed: int = 0
    bodies: tuple[BodyDraws, ...] = ()
    parameters: tuple[ParameterDraw, ...] = ()
    keep: tuple[int, ...] = ()
    quantiles: tuple[float, ...] = ()
    final_states: bool = True

    @staticmethod
    def from_json(said: Mapping[str, Any]) -> Ensemble:
        """What `dataclasses.asdict` made of one, after a way through JSON."""
        return Ensemble(
            seed=said["seed"],
            bodies=tuple(map(_body_from_json, said["bodies"])),
            parameters=tuple(
                ParameterDraw(x["name"], _draw_from_json(x["draw"])) for x in said["parameters"]
            ),
            keep=tuple(said["keep"]),
            quantiles=tuple(said["quantiles"]),
            final_states=said["final_states"],
        )


def _draw_from_json(said: Mapping[str, Any]) -> Draw:
    values = tuple(map(tuple, said["values"]))
    return Draw(said["shape"], tuple(said["first"]), tuple(said["second"]), values)


def _body_from_json(said: Mapping[str, Any]) -> BodyDraws:
    def draw(x: Mapping[str, Any] | None) -> Draw | None:
        return None if x is None else _draw_from_json(x)

    turn = said["turn"]
    return BodyDraws(
        motor=said["motor"],
        momentum=said["momentum"],
        terms=tuple((k, i, j, l, c) for k, i, j, l, c in said["terms"]),
        place=draw(said["place"]),
        turn=None
        if turn is None
        else Turn(turn["kind"], _draw_from_json(turn["draw"]), tuple(turn["axis"])),
        growth=draw(said["growth"]),
        momenta=tuple((k, _draw_from_json(x)) for k, x in said["momenta"]),
        rates=tuple((k, _draw_from_json(x)) for k, x in said["rates"]),
        kinetic=tuple(map(tuple, said["kinetic"])),
    )


def quantile_name(level: float) -> str:
    """`q0.25`: what statistics call a quantile, in all digits of its level."""
    return f"q{float(level)!r}"


ALIKE = Ensemble()
"""Nothing differs."""
