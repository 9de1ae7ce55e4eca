"""Every key a scene may have, in one place: kind, unit, default and what it means.

The reader takes its checks and defaults from here, and the starter scene and the reference are
printed from here, so that none of them can say something else than the others.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

from hamotor.scene.groups import ALGEBRAS, GROUPS, Group

METHODS = ("auto", "rkmk4", "splitting2")
NAME_PATTERN = r"[A-Za-z][A-Za-z0-9_]*"
MOST_BODIES = 64
MOST_INTERACTIONS = 128
"""A scene of this size takes the compiler some ten seconds."""
MOST_STEPS = 10**12
MOST_BYTES = 1 << 20
LARGEST = 1e36
"""Numbers lie within ±LARGEST and positive ones above 1/LARGEST: their products stay finite."""

EVERY_GROUP = tuple(GROUPS)
SPATIAL = ("SE3", "SO3")
PLANAR = ("SE2",)
TRANSLATING = ("SE3", "SE2")


@dataclass(frozen=True)
class Key:
    """One key of one table."""

    name: str
    kind: str
    """What the reader checks: `number`, `positive`, `non-negative`, `integer`, `flag`, `text`,
    `name`, `one of`, `vector`, `rotation` (a vector, in the plane a number), `lengths`, `moments`,
    `quaternion`, `matrix`, `table`, `tables`."""
    doc: str
    unit: str = ""
    default: str | None = None
    """As TOML; None where the key is required, or left out with a meaning of its own."""
    example: str = ""
    """As TOML, for the starter scene; the default where empty."""
    groups: tuple[str, ...] = EVERY_GROUP
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
        return [key.name for key in self.keys if group.name in key.groups]


SCENE = Section(
    "",
    "a scene",
    (
        Key("description", "text", "one line about the scene", default='""', example='"my scene"'),
        Key("algebra", "one of", " or ".join(ALGEBRAS), example='"pga3"'),
        Key(
            "group",
            "one of",
            "SE3: moves freely in space; SO3: turns about the body frame's origin, a fixed point;"
            " SE2: moves in the plane. Left out: SE3 in pga3, SE2 in pga2",
            example='"SE3"',
            active=False,
        ),
        Key("body", "tables", "the bodies, at least one"),
        Key("interaction", "tables", "what acts on them", default="[]"),
        Key("time", "table", "how far and how finely to integrate"),
        Key("output", "table", "what to record", default="{}"),
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
            groups=SPATIAL,
            active=False,
        ),
        Key(
            "cylinder",
            "table",
            "instead of inertia: a uniform cylinder about the body's third axis",
            unit="m",
            example="{ radius = 0.1, height = 0.3 }",
            groups=SPATIAL,
            active=False,
        ),
        Key(
            "disk",
            "positive",
            "instead of inertia: a uniform disk of this radius",
            unit="m",
            groups=PLANAR,
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
            groups=TRANSLATING,
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

ORIENTATION = Section(
    "orientation",
    "an orientation",
    (
        Key("axis", "vector", "of any length but zero", groups=SPATIAL),
        Key("angle", "number", "of the rotation, anticlockwise", unit="rad"),
        Key("quaternion", "quaternion", "[w, x, y, z], unit", groups=SPATIAL),
        Key("matrix", "matrix", "orthogonal, determinant 1, rows first", groups=SPATIAL),
    ),
)

MOMENTUM = Section(
    "momentum",
    "a momentum",
    (
        Key("linear", "vector", "", unit="kg m/s", default="0", groups=TRANSLATING),
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

INTERACTIONS = {"gravity": GRAVITY, "spring": SPRING}

TIME = Section(
    "[time]",
    "[time]",
    (
        Key("end", "positive", "", unit="s", example="10.0"),
        Key("step", "positive", "of a fixed step", unit="s", example="0.01"),
        Key(
            "tolerance",
            "positive",
            "instead of step: halving the step then changes the final state by no more",
            example="1e-10",
            active=False,
        ),
        Key("method", "one of", ", ".join(METHODS), default='"auto"'),
    ),
)

OUTPUT = Section(
    "[output]",
    "[output]",
    (Key("every", "integer", "how many steps between two recorded rows", default="1"),),
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
    BODY,
    ORIENTATION,
    MOMENTUM,
    CYLINDER,
    POINT,
    GRAVITY,
    SPRING,
    TIME,
    OUTPUT,
    LIMITS,
)


WIDTH = 100


def starter_scene() -> str:
    """A commented scene that runs, with every key of a spatial scene in it."""
    blocks = ["# A scene: bodies and what acts on them. Lines that begin with # are alternatives."]
    for section in (SCENE, BODY, GRAVITY, SPRING, TIME, OUTPUT, LIMITS):
        lines = [section.heading] if section.heading else []
        for key in section.keys:
            nested = section is SCENE and key.kind in ("table", "tables")
            if not nested and "SE3" in key.groups:
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
            "| key | unit | default | groups | meaning |",
            "|---|---|---|---|---|",
        ]
        for key in section.keys:
            groups = "" if key.groups == EVERY_GROUP else ", ".join(key.groups)
            default = "" if key.default is None else f"`{key.default}`"
            default = "zero" if key.default == "0" else default
            rows.append(f"| `{key.name}` | {key.unit} | {default} | {groups} | {key.doc} |")
        blocks.append("\n".join(rows))
    return "# The keys of a scene\n\n" + "\n\n".join(blocks) + "\n"
