"""Every key a scene may have, in one place: kind, unit, default and what it means.

The reader takes its checks and defaults from here, and the starter scene and the reference are
printed from here, so that none of them can say something else than the others.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

from hamotor.scene.groups import Group
from hamotor.scene.methods import METHOD_NAMES

NAME_PATTERN = r"[A-Za-z][A-Za-z0-9_]*"
MOST_BODIES = 64
MOST_INTERACTIONS = 128
"""A scene of this size takes the compiler some ten seconds."""
MOST_STEPS = 10**12
MOST_BYTES = 1 << 20
LARGEST = 1e36
"""Numbers lie within ±LARGEST and positive ones above 1/LARGEST: their products stay finite."""

EVERYWHERE, SPATIAL, PLANAR, TRANSLATING, SCALING = "", "3-D", "2-D", "translating", "scaling"


def _means_something(where: str, group: Group) -> bool:
    """Whether a key that is for such groups is for this one."""
    return {
        EVERYWHERE: True,
        SPATIAL: group.dimension == 3,
        PLANAR: group.dimension == 2,
        TRANSLATING: group.translates,
        SCALING: group.scales,
    }[where]


@dataclass(frozen=True)
class Key:
    """One key of one table."""

    name: str
    kind: str
    """What the reader checks: `number`, `positive`, `non-negative`, `integer`, `flag`, `text`,
    `name`, `one of`, `vector`, `rotation` (a vector, in the plane a number), `lengths`, `moments`,
    `quaternion`, `matrix`, `times`, `table`, `tables`; in ensembles `whole` (from 0), `wholes`,
    `fractions` (0 to 1), `distribution`, `vectors`."""
    doc: str
    unit: str = ""
    default: str | None = None
    """As TOML; None where the key is required, or left out with a meaning of its own."""
    example: str = ""
    """As TOML, for the starter scene; the default where empty."""
    where: str = EVERYWHERE
    """On which groups it means something."""
    active: bool = True
    """Whether the starter scene sets it; otherwise it stands there as a comment."""


@dataclass(frozen=True)
class Section:
    """One table of a scene file."""

    heading: str
    """As it stands in the file; "" for the top level, a key's name for an inline table."""
    what: str
    """In an error message: `keys of a body are …`."""
    keys: tuple[Key, ...]

    def key(self, name: str) -> Key:
        """The key called `name`."""
        return next(key for key in self.keys if key.name == name)

    def names(self, group: Group) -> list[str]:
        """The keys that mean something on `group`."""
        return [key.name for key in self.keys if _means_something(key.where, group)]


SCENE = Section(
    "",
    "a scene",
    (
        Key("description", "text", "one line about the scene", default='""', example='"my scene"'),
        Key(
            "algebra",
            "one of",
            "pga3, pga2, or any other of `./hamotor list algebras`",
            example='"pga3"',
        ),
        Key(
            "group",
            "one of",
            "SE3: moves freely in space; SO3: turns about the body frame's origin, a fixed point;"
            " SE2: moves in the plane; Sim3 (cga3): also grows and shrinks; and every other group"
            " of the algebra. Left out: the first of the algebra's spec",
            example='"SE3"',
            active=False,
        ),
        Key("body", "tables", "the bodies, at least one"),
        Key("interaction", "tables", "what acts on them", default="[]"),
        Key("hamiltonian", "table", "H, instead of masses"),
        Key("lagrangian", "table", "L, instead of masses"),
        Key("event", "tables", "functions of the state whose zeros are found", default="[]"),
        Key("time", "table", "how far and how finely to integrate"),
        Key("output", "table", "what to record", default="{}"),
        Key("ensemble", "table", "what differs from member to member", default="{}"),
        Key("limits", "table", "how large a scene may be", default="{}"),
    ),
)

BODY = Section(
    "[[body]]",
    "a body",
    (
        Key("name", "name", "a letter, then letters, digits and _", example='"body"'),
        Key("mass", "positive", "", unit="kg", example="1.0"),
        Key(
            "inertia",
            "moments",
            "about the centre of mass: three principal moments along the body's axes, or a"
            " symmetric 3x3 matrix; one number in the plane",
            unit="kg m^2",
            example="[1.0, 2.0, 2.5]",
        ),
        Key(
            "box",
            "lengths",
            "instead of inertia: a uniform box with these sides",
            unit="m",
            example="[0.1, 0.2, 0.3]",
            active=False,
        ),
        Key(
            "ellipsoid",
            "lengths",
            "instead of inertia: a uniform ellipsoid with these semi-axes",
            unit="m",
            example="[0.1, 0.2, 0.3]",
            where=SPATIAL,
            active=False,
        ),
        Key(
            "cylinder",
            "table",
            "instead of inertia: a uniform cylinder about the body's third axis",
            unit="m",
            example="{ radius = 0.1, height = 0.3 }",
            where=SPATIAL,
            active=False,
        ),
        Key(
            "disk",
            "positive",
            "instead of inertia: a uniform disk of this radius",
            unit="m",
            where=PLANAR,
            example="0.1",
            active=False,
        ),
        Key(
            "points",
            "tables",
            "instead of mass, inertia and center_of_mass: point masses, kg, at points of the body"
            " frame, m",
            example="[{mass = 2, at = [1, 0, 0]}, {mass = 1, at = [0, 1, 0]},"
            " {mass = 1, at = [0, 0, 1]}]",
            active=False,
        ),
        Key(
            "allow_unphysical_inertia",
            "flag",
            "whether the moments may violate the triangle inequality, as no distribution of mass"
            " does; the equations of motion hold for every positive definite tensor",
            default="false",
            active=False,
        ),
        Key("center_of_mass", "vector", "in the body frame", unit="m", default="0"),
        Key(
            "position",
            "vector",
            "of the body frame's origin, in the world; on SO3 the fixed point",
            unit="m",
            default="0",
        ),
        Key(
            "orientation",
            "table",
            "body to world: {axis, angle}, {quaternion = [w, x, y, z]} or {matrix = 3x3}; in the"
            " plane {angle}",
            default="{}",
            example="{ axis = [0, 0, 1], angle = 0.3 }",
        ),
        Key(
            "velocity",
            "vector",
            "of the body frame's origin, components in the body frame",
            unit="m/s",
            default="0",
            where=TRANSLATING,
        ),
        Key(
            "angular_velocity",
            "rotation",
            "components in the body frame; one number in the plane",
            unit="rad/s",
            default="0",
            example="[0, 2, 0.002]",
        ),
        Key(
            "momentum",
            "table",
            "instead of the velocities: {linear, angular}, components in the body frame, about"
            " its origin",
            unit="kg m/s, kg m^2/s",
            example="{ linear = [0, 0, 0], angular = [0, 4, 0.005] }",
            active=False,
        ),
    ),
)

GENERAL_BODY = Section(
    "[[body]]",
    "a body",
    (
        *BODY.keys,
        Key(
            "kinetic_matrix",
            "matrix",
            "instead of mass and inertia: the symmetric matrix K of the kinetic energy ½ Bᵀ K B,"
            " rows and columns in the order of the group's generators",
            active=False,
        ),
        Key(
            "second_moments",
            "lengths",
            "instead of inertia, in any dimension: Σ m x_k², about the centre of mass",
            unit="kg m^2",
            active=False,
        ),
        Key(
            "scale",
            "positive",
            "by how much it is enlarged",
            where=SCALING,
            default="1.0",
            active=False,
        ),
        Key(
            "motor",
            "table",
            "instead of position, orientation and scale: the components of M by their blades",
            example="{ s = 1 }",
            active=False,
        ),
        Key(
            "rate",
            "table",
            "instead of the velocities: the components of B by the group's generators",
            active=False,
        ),
    ),
)

HAMILTONIAN = Section(
    "[hamiltonian]",
    "a Hamiltonian",
    (
        Key("expression", "expression", "of momenta, places and parameters", unit="J"),
        Key("parameters", "parameters", "names with their values", default="{}"),
    ),
)

LAGRANGIAN = Section(
    "[lagrangian]",
    "a Lagrangian",
    (
        Key("expression", "expression", "of rates, places and parameters", unit="J"),
        Key("parameters", "parameters", "names with their values", default="{}"),
    ),
)

ORIENTATION = Section(
    "orientation",
    "an orientation",
    (
        Key("axis", "vector", "of any length but zero", where=SPATIAL),
        Key("angle", "number", "of the rotation, anticlockwise", unit="rad"),
        Key("quaternion", "quaternion", "[w, x, y, z], unit", where=SPATIAL),
        Key("matrix", "matrix", "orthogonal, determinant 1, rows first", where=SPATIAL),
    ),
)

MOMENTUM = Section(
    "momentum",
    "a momentum",
    (
        Key("linear", "vector", "", unit="kg m/s", default="0", where=TRANSLATING),
        Key("angular", "rotation", "", unit="kg m^2/s", default="0"),
    ),
)

CYLINDER = Section(
    "cylinder",
    "a cylinder",
    (
        Key("radius", "non-negative", "", unit="m"),
        Key("height", "non-negative", "", unit="m"),
    ),
)

POINT = Section(
    "points",
    "a point mass",
    (
        Key("mass", "positive", "", unit="kg"),
        Key("at", "vector", "in the body frame", unit="m"),
    ),
)

UNTYPED = Section(
    "[[interaction]]",
    "an interaction",
    (
        Key(
            "type",
            "one of",
            "gravity, spring, potential, newtonian, dipole, force, torque or damping",
        ),
    ),
)

GRAVITY = Section(
    "[[interaction]]",
    "gravity",
    (
        Key("type", "one of", "a uniform field that acts on every body", example='"gravity"'),
        Key("acceleration", "vector", "in the world", unit="m/s^2", example="[0, 0, -9.81]"),
    ),
)

SPRING = Section(
    "[[interaction]]",
    "a spring",
    (
        Key("type", "one of", "a massless spring that follows Hooke's law", example='"spring"'),
        Key("body", "name", "the body it pulls", example='"body"'),
        Key(
            "at",
            "vector",
            "where, in that body's frame",
            unit="m",
            default="0",
            example="[0.1, 0.2, 0.05]",
        ),
        Key("anchor", "vector", "its far end, in the world", unit="m", example="[0, 0, 2]"),
        Key("other", "name", "instead of anchor: another body", example='"other"', active=False),
        Key(
            "other_at",
            "vector",
            "where, in the other body's frame",
            unit="m",
            default="0",
            active=False,
        ),
        Key("stiffness", "positive", "", unit="N/m", example="50.0"),
        Key("rest_length", "non-negative", "", unit="m", default="0.0"),
    ),
)

POTENTIAL = Section(
    "[[interaction]]",
    "a potential",
    (
        Key("type", "one of", "any potential energy", example='"potential"'),
        Key("expression", "expression", "of places, parameters and the time", unit="J"),
        Key("parameters", "parameters", "names with their values", default="{}"),
    ),
)

FORCE = Section(
    "[[interaction]]",
    "a force",
    (
        Key("type", "one of", "a force at a point that no potential has", example='"force"'),
        Key("body", "name", "what it acts on"),
        Key("at", "vector", "where, in that body's frame", unit="m", default="0"),
        Key(
            "expression",
            "expression",
            "in the world frame, of places, momenta, rates, parameters and the time",
            unit="N",
        ),
        Key("parameters", "parameters", "names with their values", default="{}"),
    ),
)

TORQUE = Section(
    "[[interaction]]",
    "a torque",
    (
        Key("type", "one of", "a couple that no potential has", example='"torque"'),
        Key("body", "name", "what it acts on"),
        Key(
            "expression",
            "expression",
            "in the world frame, of places, momenta, rates, parameters and the time",
            unit="N m",
        ),
        Key("parameters", "parameters", "names with their values", default="{}"),
    ),
)

DAMPING = Section(
    "[[interaction]]",
    "damping",
    (
        Key("type", "one of", "a forque against the body's rates", example='"damping"'),
        Key("body", "name", "what it acts on"),
        Key("linear", "non-negative", "against V", unit="kg/s", default="0.0"),
        Key("angular", "non-negative", "against Ω", unit="kg m^2/s", default="0.0"),
    ),
)

NEWTONIAN = Section(
    "[[interaction]]",
    "Newtonian attraction",
    (
        Key(
            "type",
            "one of",
            "towards a point of the world, or between two bodies; a body given by points attracts"
            " as those, any other one up to its second moments, in the plane and in four dimensions"
            " as a point at its centre of mass",
            example='"newtonian"',
        ),
        Key("body", "name", "the body attracted"),
        Key("center", "vector", "the attracting point, in the world", unit="m"),
        Key("strength", "positive", "G M of the attracting point", unit="m^3/s^2"),
        Key("other", "name", "instead of center and strength: the other body"),
        Key("constant", "positive", "G between the two bodies", unit="m^3/(kg s^2)"),
    ),
)

DIPOLE = Section(
    "[[interaction]]",
    "a magnetic dipole",
    (
        Key(
            "type",
            "one of",
            "a dipole of the body in the field of one in the world",
            example='"dipole"',
        ),
        Key("body", "name", "the body that carries it"),
        Key("at", "vector", "where, in that body's frame", unit="m", default="0"),
        Key("moment", "vector", "of the body's dipole, in its frame", unit="A m^2"),
        Key("center", "vector", "where the other dipole is, in the world", unit="m", default="0"),
        Key("source", "vector", "moment of the other dipole, in the world", unit="A m^2"),
    ),
)

INTERACTIONS = {
    "gravity": GRAVITY,
    "spring": SPRING,
    "potential": POTENTIAL,
    "newtonian": NEWTONIAN,
    "dipole": DIPOLE,
    "force": FORCE,
    "torque": TORQUE,
    "damping": DAMPING,
}

EVENT = Section(
    "[[event]]",
    "an event",
    (
        Key("name", "name", "a letter, then letters, digits and _"),
        Key(
            "expression",
            "expression",
            "crosses zero at the event; of places, momenta, rates, parameters and the time. A"
            " crossing is seen where the signs at the two ends of a step differ",
        ),
        Key("parameters", "parameters", "names with their values", default="{}"),
        Key("direction", "one of", "rising, falling or both", default='"both"'),
        Key("stop", "flag", "whether the run ends there", default="false"),
    ),
)

TIME = Section(
    "[time]",
    "[time]",
    (
        Key("end", "number", "not 0; before 0 the run goes back in time", unit="s", example="10.0"),
        Key("step", "positive", "of a fixed step", unit="s", example="0.01"),
        Key(
            "tolerance",
            "positive",
            "instead of step: of the final state, verified by a second, finer run",
            example="1e-10",
            active=False,
        ),
        Key("method", "one of", ", ".join(METHOD_NAMES), default='"auto"'),
        Key(
            "local_tolerance",
            "positive",
            "beside step, for a method that chooses its steps: the error it allows itself;"
            " it delivers the state every step. Nothing is verified",
            unit="1/s",
            example="1e-10",
            active=False,
        ),
        Key(
            "compensated",
            "flag",
            "whether sums over steps keep the digits that each addition would lose; left out: where"
            " that costs the method little",
            example="true",
            active=False,
        ),
    ),
)

OUTPUT = Section(
    "[output]",
    "[output]",
    (
        Key("every", "integer", "how many steps between two recorded rows", default="1"),
        Key(
            "times",
            "times",
            "instead of every: rows at exactly these times and no others; steps stay as they are",
            unit="s",
            example="[0.0, 0.25, 10.0]",
            active=False,
        ),
        Key(
            "interval",
            "positive",
            "instead of every: rows at its multiples, and at the end",
            unit="s",
            example="0.1",
            active=False,
        ),
    ),
)

ENSEMBLE = Section(
    "[ensemble]",
    "[ensemble]",
    (
        Key("seed", "whole", "of the random numbers, at most 10^18", default="0"),
        Key("body", "tables", "[[ensemble.body]]: what is drawn of the bodies", default="[]"),
        Key(
            "parameter",
            "tables",
            "[[ensemble.parameter]]: what is drawn of parameters and interactions",
            default="[]",
        ),
        Key("keep", "wholes", "members whose trajectories are written", default="[]"),
        Key(
            "quantiles",
            "fractions",
            "which ones the statistics have",
            default="[0.05, 0.25, 0.5, 0.75, 0.95]",
        ),
        Key("final_states", "flag", "whether all members' last states are written", default="true"),
    ),
)

ENSEMBLE_BODY = Section(
    "[[ensemble.body]]",
    "what is drawn of a body",
    (
        Key("name", "name", "which body"),
        Key("position", "distribution", "", unit="m", where=TRANSLATING),
        Key("orientation", "table", "a further rotation, about axes of the body frame"),
        Key("scale", "distribution", "by how much it is enlarged", where=SCALING),
        Key(
            "velocity",
            "distribution",
            "components in the body frame",
            unit="m/s",
            where=TRANSLATING,
        ),
        Key("angular_velocity", "distribution", "components in the body frame", unit="rad/s"),
        Key(
            "momentum",
            "table",
            "distributions under linear and angular, or under the group's generators",
        ),
    ),
)

ENSEMBLE_PARAMETER = Section(
    "[[ensemble.parameter]]",
    "a drawn parameter",
    (
        Key(
            "name",
            "name",
            "one of the parameters of [hamiltonian] or [lagrangian], or of an interaction (of a"
            " vector k_x, k_y …), or an interaction's acceleration_x …, stiffness, rest_length,"
            " strength, constant, linear, angular",
        ),
        Key("interaction", "integer", "which interaction it belongs to, from 1", active=False),
        Key("distribution", "distribution", "of its value"),
    ),
)

DISTRIBUTION = Section(
    "distribution",
    "a distribution",
    (
        Key("mean", "vector", "of a normal distribution; left out: the scene's own value"),
        Key("sd", "lengths", "standard deviation of a normal distribution; one for all, or each"),
        Key("low", "vector", "least value of a uniform distribution"),
        Key("high", "vector", "largest value of a uniform distribution"),
        Key(
            "values",
            "vectors",
            "instead: an array of values; member i has number i mod their count",
        ),
    ),
)

TURN = Section(
    "orientation",
    "a drawn orientation",
    (
        Key("uniform", "flag", "all orientations alike", default="false"),
        Key(
            "sd",
            "lengths",
            "of a normal rotation vector, one for all components or each; with axis: of the angle",
            unit="rad",
        ),
        Key("axis", "vector", "of the rotation, in the body frame", where=SPATIAL),
        Key("low", "number", "least angle of a uniform distribution", unit="rad"),
        Key("high", "number", "largest angle of a uniform distribution", unit="rad"),
    ),
)

LIMITS = Section(
    "[limits]",
    "[limits]",
    (
        Key("bodies", "integer", "most bodies", default=str(MOST_BODIES), active=False),
        Key(
            "interactions",
            "integer",
            "most interactions",
            default=str(MOST_INTERACTIONS),
            active=False,
        ),
    ),
)

SECTIONS = (
    SCENE,
    GENERAL_BODY,
    HAMILTONIAN,
    LAGRANGIAN,
    ORIENTATION,
    MOMENTUM,
    CYLINDER,
    POINT,
    *INTERACTIONS.values(),
    EVENT,
    TIME,
    OUTPUT,
    ENSEMBLE,
    ENSEMBLE_BODY,
    ENSEMBLE_PARAMETER,
    DISTRIBUTION,
    TURN,
    LIMITS,
)


WIDTH = 100
STARTER_SECTIONS = (SCENE, BODY, GRAVITY, SPRING, TIME, OUTPUT, LIMITS)


def starter_scene() -> str:
    """A commented scene that runs, with every key of a spatial scene in it."""
    blocks = ["# A scene: bodies and what acts on them. Lines that begin with # are alternatives."]
    for section in STARTER_SECTIONS:
        lines = [section.heading] if section.heading else []
        for key in section.keys:
            nested = section is SCENE and key.kind in ("table", "tables")
            if not nested and key.where in (EVERYWHERE, SPATIAL, TRANSLATING):
                lines += _starter_lines(key)
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks) + "\n"


def _starter_lines(key: Key) -> list[str]:
    """The key's setting with its comment beside it, or above it where the line would be long."""
    default = "[0, 0, 0]" if key.kind in ("vector", "rotation") else key.default
    setting = f"{'' if key.active else '# '}{key.name} = {key.example or default}"
    comment = "; ".join(part for part in (key.unit, key.doc) if part)
    beside = f"{setting:<37}# {comment}".rstrip("# ")
    if len(beside) <= WIDTH and len(setting) < 37:
        return [beside]
    return [*textwrap.wrap(comment, WIDTH, initial_indent="# ", subsequent_indent="# "), setting]


def scene_reference() -> str:
    """Every key of a scene as Markdown tables."""
    blocks = []
    for section in SECTIONS:
        title = f"`{section.heading}`" if section.heading else "Top level"
        rows = [
            f"## {title}"
            if section.heading in ("", section.what)
            else f"## {title}: {section.what}",
            "",
            "| key | unit | default | on groups | meaning |",
            "|---|---|---|---|---|",
        ]
        for key in section.keys:
            default = "" if key.default is None else f"`{key.default}`"
            default = "zero" if key.default == "0" else default
            rows.append(f"| `{key.name}` | {key.unit} | {default} | {key.where} | {key.doc} |")
        blocks.append("\n".join(rows))
    return "# The keys of a scene\n\n" + "\n\n".join(blocks) + "\n"
