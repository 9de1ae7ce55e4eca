"""A scene as a frozen value: what the TOML says, checked and in one form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hamotor.scene import inertia
from hamotor.scene.conserved import ConservedQuantity, conserved_quantities
from hamotor.scene.draws import ALIKE, Ensemble
from hamotor.scene.exact import decimal, rounded
from hamotor.scene.groups import Group
from hamotor.scene.interactions import Gravity, Interaction, Potential, Spring
from hamotor.scene.methods import Form
from hamotor.scene.motors import Matrix, Vector, cross, motor_of, rotation_matrix
from hamotor.scene.principal import PrincipalFrame, principal_frame

if TYPE_CHECKING:
    from hamotor.mechanics.hamiltonian import Hamiltonian
    from hamotor.scene.general import GeneralScene


@dataclass(frozen=True)
class Body:
    """A rigid body: its mass distribution, where it starts and with what momentum.

    Quantities of the body are components in the user's body frame.
    """

    name: str
    group: Group
    mass: float
    """kg."""
    inertia: Matrix
    """Tensor about the centre of mass, kg m²: (3, 3), or (1, 1) in the plane."""
    center_of_mass: Vector
    """m."""
    position: Vector
    """Of the body frame's origin in the world at the start, m."""
    rotor: Vector
    """Orientation at the start, body to world: (s, e23, e31, e12), in the plane (s, e12)."""
    momentum: Vector
    """At the start, about the body frame's origin: angular (kg m²/s), then linear (kg m/s)."""

    @cached_property
    def kinetic_matrix(self) -> NDArray[np.float64]:
        """K: momentum = K·(Ω, V), rotations first. Symmetric positive definite, (dim g, dim g)."""
        return inertia.kinetic_matrix(
            self.mass, self.center_of_mass, self.inertia, translates=self.group.translates
        )

    @cached_property
    def principal(self) -> PrincipalFrame:
        """The frame in which K is diagonal."""
        return principal_frame(
            self.mass, self.center_of_mass, self.inertia, translates=self.group.translates
        )

    @cached_property
    def motor(self) -> Vector:
        """M at the start, X_world = M X_body M~, in the order of `group.motor`.

        With a fixed point the world frame is the one translated there: the rotor alone.
        """
        return motor_of(self.position, self.rotor) if self.group.translates else self.rotor

    @property
    def rate(self) -> NDArray[np.float64]:
        """(Ω, V) at the start, body frame, rad/s and m/s: K⁻¹ applied in the principal frame."""
        frame = self.principal
        angular = np.array(self.momentum[: self.group.rotations])
        linear = np.array(self.momentum[self.group.rotations :])
        center = frame.center
        if self.group.translates:
            angular = angular - cross(center, linear)
        moments = np.array(frame.moments)
        if self.group.dimension == 2:
            rotation = angular / moments
            return np.concatenate(
                [rotation, linear / self.mass - rotation * (-center[1], center[0])]
            )
        rotation = frame.axes @ ((frame.axes.T @ angular) / moments)
        if not self.group.translates:
            return np.asarray(rotation)
        return np.concatenate([rotation, linear / self.mass - cross(rotation, center)])

    def in_world(self, point: Vector) -> NDArray[np.float64]:
        """Where a point of the body frame is in the world at the start, m."""
        return np.asarray(rotation_matrix(self.rotor) @ np.array(point) + np.array(self.position))


@dataclass(frozen=True)
class Time:
    """How far, how finely and how a scene is integrated."""

    end: float
    """s; before 0 the run goes back in time."""
    step: float | None
    """Of a fixed step, s; None where a tolerance is given."""
    tolerance: float | None
    """Of the final state, verified by a second, finer run. None where a step is given."""
    method: str
    """`auto`, or a method's name."""
    local_tolerance: float | None = None
    """Of a method that chooses its steps, 1/s; beside a step, at which it delivers the state."""
    compensated: bool | None = None
    """Whether sums over steps keep the digits that each addition would lose; None: as is the
    method's own way."""


@dataclass(frozen=True)
class Output:
    """What of a run is recorded: every so many steps, at times, or at the multiples of one."""

    every: int = 1
    """Every how many steps a row is written."""
    times: tuple[float, ...] | None = None
    """When rows are written, s, in order of the run; None: every so many steps."""
    interval: float | None = None
    """Rows at its multiples, s; None: as the others say."""


@dataclass(frozen=True)
class Event:
    """A function of the state whose zeros a run finds."""

    name: str
    text: str
    """As the file has it."""
    expression: Any
    """Over the symbols of the scene's coordinates, parameters folded in (SymPy)."""
    direction: str
    """`rising`, `falling` or `both`."""
    stops: bool
    """Whether the run ends there."""


@dataclass(frozen=True)
class Scene:
    """Bodies on a group, what acts on them, and how to integrate them."""

    name: str
    """The file's stem, made an identifier."""
    description: str
    group: Group
    bodies: tuple[Body, ...]
    interactions: tuple[Interaction, ...]
    time: Time
    output: Output
    sha256: str
    """Of the file's bytes, hexadecimal."""
    has_events: bool
    """Whether the file has events; what they are is read with `general`."""
    reread: Callable[[], GeneralScene] = field(repr=False, compare=False)
    """Reads `general`."""
    ensemble: Ensemble = ALIKE
    """What differs from member to member; parameters are read with `general`."""
    draws_parameters: bool = False
    """Whether members have parameters of their own; then `general` is what is stepped."""

    @cached_property
    def general(self) -> GeneralScene:
        """The same scene with nothing specialised: coordinates on a group and a Hamiltonian."""
        return self.reread()

    @property
    def events(self) -> tuple[Event, ...]:
        """Functions of the state whose zeros a run finds."""
        return self.general.events if self.has_events else ()

    @cached_property
    def potential(self) -> Hamiltonian | None:
        """The sum of all `Potential`s over the user's body frames; None where there are none."""
        if not any(isinstance(i, Potential) for i in self.interactions):
            return None
        return self.general.potential

    @property
    def algebra(self) -> str:
        """The algebra's name."""
        return self.group.algebra

    @cached_property
    def initial_state(self) -> NDArray[np.float64]:
        """Per body its motor's and then its momentum's components, in the user's body frame."""
        return np.array([x for body in self.bodies for x in (*body.motor, *body.momentum)])

    @cached_property
    def exact_state(self) -> tuple[Fraction, ...]:
        """The same as the numbers that these stand for, to `exact.DIGITS`."""
        return tuple(decimal(x) for body in self.bodies for x in (*body.motor, *body.momentum))

    @property
    def principal(self) -> tuple[PrincipalFrame, ...]:
        """The principal frame of each body."""
        return tuple(body.principal for body in self.bodies)

    @cached_property
    def conserved(self) -> tuple[ConservedQuantity, ...]:
        """What the exact motion keeps constant: energy, momenta by symmetry, Casimirs."""
        if self.potential is not None:
            return tuple(q for q in self.general.conserved if _has_a_formula(self, q))
        found = conserved_quantities(self)
        if not any(len(set(frame.moments)) < len(frame.moments) for frame in self.principal):
            return found
        # Only a symmetric body can keep momenta of its own frame.
        own = [q for q in self.general.conserved if ".momentum." in q.name]
        return (*found, *(q for q in own if _has_a_formula(self, q)))

    @cached_property
    def hamiltonian(self) -> Hamiltonian:
        """H in symbols, over momenta and places in the user's body frames."""
        return self.general.hamiltonian

    @property
    def gravity(self) -> Vector | None:
        """The sum of all gravities, world frame, m/s²; None where it vanishes."""
        fields = [i.acceleration for i in self.interactions if isinstance(i, Gravity)]
        total = tuple(rounded(sum(map(decimal, g), Fraction(0))) for g in zip(*fields, strict=True))
        return total if any(total) else None

    @property
    def form(self) -> Form:
        """What kinds of methods step it."""
        acts = self.gravity is not None or len(self.springs) or self.potential is not None
        return Form.SPLIT if acts else Form.SPLIT | Form.FREE

    @property
    def springs(self) -> tuple[Spring, ...]:
        """The springs, in the scene's order."""
        return tuple(i for i in self.interactions if isinstance(i, Spring))

    @cached_property
    def body_of(self) -> dict[str, Body]:
        """The bodies by name."""
        return {body.name: body for body in self.bodies}

    def spring_vector(self, spring: Spring) -> NDArray[np.float64]:
        """From a spring's far end to its point on `spring.body` at the start, world frame, m."""
        near = self.body_of[spring.body].in_world(spring.at)
        if spring.other is None:
            return np.asarray(near - np.array(spring.anchor))
        return near - self.body_of[spring.other].in_world(spring.other_at or ())

    @cached_property
    def initial_energy(self) -> tuple[float, float, float]:
        """Kinetic energy, potential energy, and the sum of all terms' magnitudes, J, at the start.

        The potential of gravity is measured from the world's origin.
        """
        kinetic = sum(0.5 * float(np.array(b.momentum) @ b.rate) for b in self.bodies)
        potentials = []
        if self.gravity is not None:
            for body in self.bodies:
                height = body.in_world(body.center_of_mass)
                potentials.append(-body.mass * float(np.array(self.gravity) @ height))
        for spring in self.springs:
            length = float(np.linalg.norm(self.spring_vector(spring)))
            potentials.append(0.5 * spring.stiffness * (length - spring.rest_length) ** 2)
        if self.potential is not None:
            potentials.append(self._initial_potential(self.potential))
        return kinetic, sum(potentials), kinetic + sum(abs(u) for u in potentials)

    def _initial_potential(self, potential: Hamiltonian) -> float:
        from hamotor.mechanics.evaluation import evaluated, place, values_of

        known = values_of(potential.parameters)
        for coordinates, body in zip(potential.bodies, self.bodies, strict=True):
            known = place(coordinates, body.motor, known)
        return float(evaluated([potential.energy], known)[0])

    @cached_property
    def initial_spatial_momentum(self) -> Vector:
        """The total momentum in the world frame, in the order of `group.generators`.

        Angular momenta are taken about the world's origin, with a fixed point about that point.
        """
        total = np.zeros(len(self.group.generators))
        rotations = self.group.rotations
        for body in self.bodies:
            rotation = rotation_matrix(body.rotor)
            angular = np.array(body.momentum[:rotations])
            if self.group.dimension == 3:
                angular = rotation @ angular
            if self.group.translates:
                linear = rotation @ np.array(body.momentum[rotations:])
                total[rotations:] += linear
                angular = angular + cross(body.position, linear)
            total[:rotations] += angular
        return tuple(float(x) for x in total)


def _has_a_formula(scene: Scene, quantity: ConservedQuantity) -> bool:
    """Whether the runtime computes it for rigid bodies: all but combinations of own momenta."""
    momenta = {f"{b.name}.momentum.{g}" for b in scene.bodies for g in scene.group.generators}
    return not quantity.body or ".casimir." in quantity.name or quantity.name in momenta
