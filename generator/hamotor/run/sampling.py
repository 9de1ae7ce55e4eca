"""Where the members of an ensemble start: its distributions, drawn for some of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hamotor.run.library import Rows, Vector
from hamotor.run.random_numbers import Array, cosine_and_sine, normals, uniforms
from hamotor.scene.draws import BodyDraws, Draw, Ensemble, Turn


def numbers_each(ensemble: Ensemble) -> int:
    """Random numbers that every member has."""
    of_bodies = sum(draw.numbers for body in ensemble.bodies for draw in body.draws)
    return of_bodies + sum(parameter.draw.numbers for parameter in ensemble.parameters)


def starts(
    ensemble: Ensemble, own: Vector, seed: int, first: int, members: int
) -> tuple[Rows, Rows]:
    """The states at which `members` members from `first` start, and their parameters.

    Shapes (members, state_size) and (members, parameters).  `own` is the scene's own state, per
    body the motor and the momentum.  A member's rows do not depend on the others.
    """
    each = numbers_each(ensemble)
    numbers = uniforms(seed, first, members, each) if each else np.empty((members, 0))
    drawn = _Drawn(numbers, first)
    states = np.tile(np.asarray(own, dtype=np.float64), (members, 1))
    for body in ensemble.bodies:
        _place(body, drawn, states)
    parameters = [drawn.take(parameter.draw)[0] for parameter in ensemble.parameters]
    return states, np.array(parameters).reshape(len(parameters), members).T.copy()


class _Drawn:
    """The random numbers of a range of members, taken column by column."""

    def __init__(self, numbers: Array, first: int) -> None:
        self._numbers, self._first, self._used = numbers, first, 0

    def take(self, draw: Draw) -> list[Array]:
        """The components of a draw, an array over the members each."""
        if draw.shape == "values":
            members = self._first + np.arange(len(self._numbers))
            return list(np.array(draw.values)[members % len(draw.values)].T)
        used = self._used
        self._used += draw.numbers
        columns = np.ascontiguousarray(self._numbers[:, used : self._used].T)
        if draw.shape == "normal":
            triples = zip(draw.first, draw.second, normals(columns), strict=True)
            return [mean + sd * z for mean, sd, z in triples]
        return [a + (b - a) * u for a, b, u in zip(draw.first, draw.second, columns, strict=True)]


def _place(body: BodyDraws, drawn: _Drawn, states: Rows) -> None:
    """Change a body's part of the states."""
    moves = [] if body.place is None else drawn.take(body.place)
    rotor = None if body.turn is None else _rotor(body.turn, drawn)
    growth = None if body.growth is None else _growth(drawn.take(body.growth)[0])
    if body.terms:
        motor: dict[int, Array] = {}
        for k, i, j, l, c in body.terms:
            term = np.full(len(states), c)
            if i:
                term = term * moves[i - 1]
            if rotor is not None:
                term = term * rotor[j]
            if growth is not None:
                term = term * growth[l]
            motor[k] = motor[k] + term if k in motor else term
        for k, values in motor.items():
            states[:, body.motor + k] = values
    for component, change in _momentum_changes(body, drawn):
        states[:, body.momentum + component] += change


def _momentum_changes(body: BodyDraws, drawn: _Drawn) -> Iterator[tuple[int, Array]]:
    for first, draw in body.momenta:
        yield from enumerate(drawn.take(draw), first)
    for first, draw in body.rates:
        for column, change in enumerate(drawn.take(draw), first):
            for row, line in enumerate(body.kinetic):
                if line[column]:
                    yield row, line[column] * change


def _rotor(turn: Turn, drawn: _Drawn) -> list[Array]:
    """(s, e23, e31, e12), in the plane (s, e12)."""
    numbers = drawn.take(turn.draw)
    if turn.kind == "all":
        # Normal numbers know no direction: divided by their norm, they lie anywhere on the sphere.
        norm = _norm(numbers)
        return [x / norm for x in numbers]
    if turn.kind == "axis":
        cosine, sine = cosine_and_sine(0.5 * numbers[0])
        return [cosine, *(-n * sine for n in turn.axis or (1.0,))]
    angle = _norm(numbers)
    cosine, sine = cosine_and_sine(0.5 * angle)
    ratio = np.where(angle > 0.0, sine / np.where(angle > 0.0, angle, 1.0), 0.5)
    return [cosine, *(-ratio * x for x in numbers)]


def _norm(components: list[Array]) -> Array:
    square = components[0] * components[0]
    for x in components[1:]:
        square = square + x * x
    norm: Array = np.sqrt(square)
    return norm


def _growth(change: Array) -> list[Array]:
    """√q to components, for bodies of 1 + `change` times their size; NaN where that is negative."""
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(1.0 + change)
        return [(root + 1.0 / root) / 2.0, (root - 1.0 / root) / 2.0]
