"""Every mistake in a scene is one UsageError that names file, place and key."""

# One mistake, one line:
# ruff: noqa: E501

from __future__ import annotations

import os
import random
import re
from pathlib import Path

import pytest

from hamotor.errors import UsageError, suggest
from hamotor.scene import METHOD_NAMES, Scene, parse_scene, read_scene
from hamotor.scene.reading import BUNDLED

TOP = """
algebra = "pga3"
[[body]]
name = "top"
mass = 1.0
inertia = [1, 2, 2.5]
[[interaction]]
type = "gravity"
acceleration = [0, 0, -9.81]
[[interaction]]
type = "spring"
body = "top"
at = [0.1, 0.2, 0.05]
anchor = [0, 0, 2]
stiffness = 50.0
rest_length = 0.5
[time]
end = 10.0
step = 0.01
[output]
every = 2
"""
PLATE = """
algebra = "pga2"
[[body]]
name = "plate"
mass = 1.0
inertia = 2.0
[time]
end = 10.0
step = 0.01
"""
MASS = "mass = 1.0"
INERTIA = "inertia = [1, 2, 2.5]"
FIXED = 'algebra = "pga3"\ngroup = "SO3"'
PGA3 = 'algebra = "pga3"'
BODY = "inertia = [1, 2, 2.5]\n{}"
SECOND = '[[body]]\nname = "second"\nmass = 1\ninertia = [1, 1, 1]\nposition = [5, 0, 0]\n[time]'
ANCHOR = "anchor = [0, 0, 2]"

MISTAKES: dict[str, tuple[str, str, str, list[str]]] = {
    # what: (scene, what to replace, by what, fragments of the message)
    "unknown key": (TOP, MASS, "mas = 1.0", ['body 1: unknown key "mas"', '"mass"', 'Did you mean "mass"?']),
    "unknown key of the scene": (TOP, PGA3, 'algbra = "pga3"', ["algebra"]),
    "unknown table": (TOP, "[output]", "[outputs]", ['unknown key "outputs"', 'Did you mean "output"?']),
    "unknown key of time": (TOP, "step = 0.01", "stp = 0.01", ['[time]: unknown key "stp"', '"step"']),
    "unknown key of output": (TOP, "every = 2", "evry = 2", ['[output]: unknown key "evry"', "every"]),
    "unknown key of gravity": (TOP, "acceleration =", "acc =", ["interaction 1: unknown key", '"acceleration"']),
    "unknown key of a spring": (TOP, "stiffness =", "stiffnes =", ['interaction 2: unknown key "stiffnes"; keys of a spring are', 'Did you mean "stiffness"?']),
    "unknown key of an orientation": (TOP, MASS, f"{MASS}\norientation = {{ axis = [0,0,1], angel = 1 }}", ['body 1 "top": orientation: unknown key "angel"', 'Did you mean "angle"?']),
    "unknown key of a momentum": (TOP, MASS, f"{MASS}\nmomentum = {{ linar = [0,0,1] }}", ['momentum: unknown key "linar"', 'Did you mean "linear"?']),
    "unknown key of limits": (TOP, "[output]", "[limits]\nbody = 3\n[output]", ['[limits]: unknown key "body"']),
    "unknown body": (TOP, 'body = "top"', 'body = "topp"', ['interaction 2: unknown body "topp"; bodies are "top". Did you mean "top"?']),
    "unknown other body": (TOP, ANCHOR, 'other = "second"', ['interaction 2: unknown body "second"; bodies are "top".']),
    "body called like a word": (TOP.replace('"top"', '"position"'), 'type = "gravity"\nacceleration = [0, 0, -9.81]', 'type = "potential"\nexpression = "position.z"', ['interaction 1: the body "position" has the name of something else; rename it']),
    "unknown interaction": (TOP, '"gravity"', '"gravty"', ['interaction 1: unknown type "gravty"; types are "gravity", "spring", "potential", "newtonian", "dipole", "force", "torque", "damping". Did you mean "gravity"?']),
    "unknown algebra": (TOP, '"pga3"', '"pga5"', ['unknown algebra "pga5"; algebras are "cga2", "cga3", "cl3", "pga2", "pga3", "pga4", "sta".', "Did you mean"]),
    "unknown group": (TOP, PGA3, f'{PGA3}\ngroup = "SE4"', ['unknown group "SE4"; groups of pga3 are "SE3", "SO3", "T3".', "Did you mean"]),
    "group of another algebra": (TOP, PGA3, f'{PGA3}\ngroup = "SE2"', ['unknown group "SE2"; groups of pga3 are "SE3", "SO3", "T3".']),
    "unknown method": (TOP, "step = 0.01", 'step = 0.01\nmethod = "rkmk"', ['[time]: unknown method "rkmk"; methods are ' + ", ".join(f'"{name}"' for name in METHOD_NAMES[:9]), '. Did you mean "rkmk4"?']),
    "missing algebra": (TOP, PGA3, "", ['missing "algebra"']),
    "missing bodies": ('algebra = "pga3"\n[time]\nend = 1\nstep = 1', "", "", ["at least one [[body]]"]),
    "missing name": (TOP, 'name = "top"', "", ['body 1: missing "name"']),
    "missing mass": (TOP, MASS, "", ['body 1 "top": missing "mass"', "kg"]),
    "missing inertia": (TOP, INERTIA, "", ['missing "inertia" or "box" or "ellipsoid" or "cylinder" or "points"']),
    "missing planar inertia": (PLATE, "inertia = 2.0", "", ['missing "inertia" or "box" or "disk" or "points"']),
    "missing type": (TOP, 'type = "gravity"', "", ['interaction 1: missing "type": gravity, spring, potential']),
    "missing acceleration": (TOP, "acceleration = [0, 0, -9.81]", "", ['interaction 1: missing "acceleration"']),
    "missing anchor": (TOP, ANCHOR, "", ['interaction 2: missing "anchor" or "other"']),
    "missing stiffness": (TOP, "stiffness = 50.0", "", ['interaction 2: missing "stiffness"']),
    "missing time": (TOP, "[time]\nend = 10.0\nstep = 0.01", "", ['missing "time"']),
    "missing end": (TOP, "end = 10.0", "", ['[time]: missing "end"', "s"]),
    "missing step": (TOP, "step = 0.01", "", ['[time]: missing "step" or "tolerance"']),
    "missing angle": (TOP, MASS, f"{MASS}\norientation = {{ axis = [0,0,1] }}", ['orientation: missing "angle"']),
    "missing axis": (TOP, MASS, f"{MASS}\norientation = {{ angle = 1 }}", ['orientation: missing "axis"']),
    "missing height": (TOP, INERTIA, "cylinder = { radius = 1 }", ['cylinder: missing "height"']),
    "missing place of a point": (TOP, f"{MASS}\n{INERTIA}", "points = [{ mass = 1 }]", ['points: point 1: missing "at"']),
    "a bool is not a number": (TOP, MASS, "mass = true", ["mass: must be a number, not true"]),
    "a text is not a number": (TOP, MASS, 'mass = "1 kg"', ['mass: must be a number, not the text "1 kg"']),
    "a date is not a number": (TOP, MASS, "mass = 2020-01-01", ["mass: must be a number, not a date"]),
    "an array is not a number": (TOP, "end = 10.0", "end = [1]", ["[time]: end: must be a number, not an array of length 1"]),
    "a table is not a number": (TOP, "end = 10.0", "end = {}", ["end: must be a number, not a table"]),
    "a bool in a vector": (TOP, "[0, 0, -9.81]", "[0, true, 1]", ["acceleration: number 2 of 3: must be a number, not true"]),
    "a vector too short": (TOP, "[0, 0, -9.81]", "[0, 0]", ["acceleration: must be 3 numbers, [x, y, z], not an array of length 2"]),
    "a vector too long": (PLATE, MASS, f"{MASS}\nposition = [0, 0, 0]", ["position: must be 2 numbers, [x, y], not an array of length 3"]),
    "a vector that is a number": (TOP, "[0, 0, -9.81]", "9.81", ["acceleration: must be 3 numbers", "not the number 9.81"]),
    "a planar angular velocity": (PLATE, MASS, f"{MASS}\nangular_velocity = [0, 0, 1]", ["angular_velocity: must be a number, not an array of length 3"]),
    "a matrix of the wrong shape": (TOP, INERTIA, "inertia = [[1, 0], [0, 1]]", ["inertia: must be a 3x3 matrix"]),
    "a ragged matrix": (TOP, INERTIA, "inertia = [[1, 0, 0], [0, 1], [0, 0, 1]]", ["inertia: must be a 3x3 matrix"]),
    "a text in a matrix": (TOP, INERTIA, 'inertia = [[1, 0, 0], [0, "1", 0], [0, 0, 1]]', ["inertia: row 2, column 2: must be a number"]),
    "moments too few": (TOP, INERTIA, "inertia = [1, 2]", ["inertia: must be 3 numbers, the principal moments, or a 3x3 matrix"]),
    "a number as a spatial inertia": (TOP, INERTIA, "inertia = 1.0", ["inertia: must be 3 numbers, the principal moments, or a 3x3 matrix"]),
    "moments in the plane": (PLATE, "inertia = 2.0", "inertia = [1, 2, 3]", ["inertia: must be a number"]),
    "a name that is a number": (TOP, 'name = "top"', "name = 1", ["name: must be a name in quotes, not the number 1"]),
    "body is a table": (TOP, "[[body]]", "[body]", ["body: must be an array of tables: write [[body]], not [body]"]),
    "body is a number": (TOP.replace("[[body]]", "[x]"), PGA3, f"body = 1\n{PGA3}", ['unknown key "x"']),
    "bodies are numbers": ('algebra = "pga3"\nbody = [1]\n[time]\nend = 1\nstep = 1', "", "", ["body: must be an array of tables, not an array of length 1"]),
    "time is a number": ('algebra = "pga3"\ntime = 1\n[[body]]\nname="a"\nmass=1\ninertia=[1,1,1]', "", "", ["time: must be a table, not the number 1"]),
    "orientation is an array": (TOP, MASS, f"{MASS}\norientation = [1, 0, 0, 0]", ["orientation: must be a table, not an array of length 4"]),
    "description is a number": (TOP, PGA3, f"{PGA3}\ndescription = 1", ["description: must be text, not the number 1"]),
    "description of several lines": (TOP, PGA3, f'{PGA3}\ndescription = "a\\nb"', ['description: must be one printable line, not "a\\nb"']),
    "description too long": (TOP, PGA3, f'{PGA3}\ndescription = "{"a" * 201}"', ["description: must be at most 200 characters, not 201"]),
    "algebra is a number": (TOP, '"pga3"', "3", ['algebra: must be one of "cga2", "cga3", "cl3", "pga2", "pga3", "pga4", "sta", not the number 3']),
    "nan": (TOP, MASS, "mass = nan", ["mass: must be finite, not nan"]),
    "infinity": (TOP, "[0, 0, -9.81]", "[0, 0, -inf]", ["acceleration: number 3 of 3: must be finite, not -inf"]),
    "nan in a matrix": (TOP, INERTIA, "inertia = [[1, 0, 0], [0, nan, 0], [0, 0, 1]]", ["inertia: row 2, column 2: must be finite"]),
    "overflow": (TOP, MASS, "mass = 1e999", ["mass: must be finite, not inf"]),
    "a number that is too large": (TOP, MASS, "mass = 1e40", ["mass: must lie within ±1e+36"]),
    "an integer too large for a double": (TOP, MASS, f"mass = 1{'0' * 400}", ["mass: must lie within ±1e+36"]),
    "a number that is too small": (TOP, MASS, "mass = 1e-200", ["mass: must be at least 1e-36"]),
    "negative mass": (TOP, MASS, "mass = -1.0", ["mass: must be positive, not -1"]),
    "zero mass": (TOP, MASS, "mass = 0", ["mass: must be positive, not 0"]),
    "negative stiffness": (TOP, "stiffness = 50.0", "stiffness = -50", ["interaction 2: stiffness: must be positive, not -50"]),
    "negative rest length": (TOP, "rest_length = 0.5", "rest_length = -1", ["rest_length: must not be negative: -1"]),
    "end zero": (TOP, "end = 10.0", "end = 0", ["[time]: end: must not be 0"]),
    "end infinite": (TOP, "end = 10.0", "end = inf", ["end: must be finite"]),
    "step zero": (TOP, "step = 0.01", "step = 0", ["[time]: step: must be positive, not 0"]),
    "step negative": (TOP, "step = 0.01", "step = -0.01", ["step: must be positive, not -0.01"]),
    "step longer than the run": (TOP, "step = 0.01", "step = 11", ["step: 11 is longer than end = 10"]),
    "absurdly many steps": (TOP, "step = 0.01", "step = 1e-12", ["step: end / step is 1e+13; at most 1e+12 steps"]),
    "tolerance zero": (TOP, "step = 0.01", "tolerance = 0", ["tolerance: must be positive"]),
    "local tolerance of a fixed step": (TOP, "step = 0.01", 'step = 0.01\nmethod = "rkmk4"\nlocal_tolerance = 1e-9', ["local_tolerance: needs a method that chooses its steps", 'not "rkmk4"']),
    "compensated sums": (TOP, "step = 0.01", "step = 0.01\ncompensated = 1", ["compensated: must be true or false, not the number 1"]),
    "local tolerance and tolerance": (TOP, "step = 0.01", 'tolerance = 1e-9\nmethod = "taylor"\nlocal_tolerance = 1e-9', ["local_tolerance: is for a run in steps"]),
    "step and tolerance": (TOP, "step = 0.01", "step = 0.01\ntolerance = 1e-9", ['"step" and "tolerance" contradict each other']),
    "every zero": (TOP, "every = 2", "every = 0", ["[output]: every: must be at least 1", "not the number 0"]),
    "every a fraction": (TOP, "every = 2", "every = 2.5", ["every: must be an integer, not the number 2.5"]),
    "every a bool": (TOP, "every = 2", "every = true", ["every: must be an integer, not true"]),
    "non-unit quaternion": (TOP, MASS, f"{MASS}\norientation = {{ quaternion = [1, 1, 0, 0] }}", ["orientation: quaternion: must be a unit quaternion, but its norm is 1.41421356", "did you mean [0.7071068, 0.7071068, 0, 0]?"]),
    "zero quaternion": (TOP, MASS, f"{MASS}\norientation = {{ quaternion = [0, 0, 0, 0] }}", ["must be a unit quaternion, but its norm is 0"]),
    "short quaternion": (TOP, MASS, f"{MASS}\norientation = {{ quaternion = [1, 0, 0] }}", ["quaternion: must be 4 numbers, [w, x, y, z]"]),
    "zero axis": (TOP, MASS, f"{MASS}\norientation = {{ axis = [0, 0, 0], angle = 1 }}", ["orientation: axis: must not be zero"]),
    "non-orthogonal matrix": (TOP, MASS, f"{MASS}\norientation = {{ matrix = [[1, 0, 0], [0, 1, 0.1], [0, 0, 1]] }}", ["orientation: matrix: must be orthogonal, but R R^T differs from 1 by 0.1"]),
    "reflection": (TOP, MASS, f"{MASS}\norientation = {{ matrix = [[1, 0, 0], [0, 1, 0], [0, 0, -1]] }}", ["must be a rotation, but its determinant is -1"]),
    "huge matrix": (TOP, MASS, f"{MASS}\norientation = {{ matrix = [[1e36, 0, 0], [0, 1, 0], [0, 0, 1]] }}", ["must be orthogonal"]),
    "two orientations": (TOP, MASS, f"{MASS}\norientation = {{ quaternion = [1, 0, 0, 0], matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }}", ['"quaternion" and "matrix" contradict each other']),
    "axis and quaternion": (TOP, MASS, f"{MASS}\norientation = {{ quaternion = [1, 0, 0, 0], axis = [0, 0, 1] }}", ['"axis" and "quaternion" contradict each other']),
    "angle and quaternion": (TOP, MASS, f"{MASS}\norientation = {{ quaternion = [1, 0, 0, 0], angle = 1 }}", ['"angle" and "quaternion" contradict each other']),
    "quaternion in the plane": (PLATE, MASS, f"{MASS}\norientation = {{ quaternion = [1, 0, 0, 0] }}", ['key "quaternion" has no meaning on SE2; keys of an orientation are "angle"']),
    "non-symmetric inertia": (TOP, INERTIA, "inertia = [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]", ["inertia: must be symmetric, but row 1, column 2 is 0.1 and row 2, column 1 is 0"]),
    "indefinite inertia": (TOP, INERTIA, "inertia = [[1, 2, 0], [2, 1, 0], [0, 0, 2]]", ["inertia: must be positive definite, but its principal moments are -1, 2, 3"]),
    "negative moment": (TOP, INERTIA, "inertia = [1, -1, 1]", ["inertia: must be positive definite, but its principal moments are -1, 1, 1"]),
    "triangle inequality": (TOP, INERTIA, "inertia = [1, 5, 2]", ["inertia: the principal moments violate the triangle inequality 5 <= 1 + 2: no distribution of mass has them", "allow_unphysical_inertia = true"]),
    "triangle inequality of a matrix": (TOP, INERTIA, "inertia = [[1, 0, 0], [0, 3, 2], [0, 2, 3]]", ["inertia: the principal moments violate the triangle inequality 5 <= 1 + 1"]),
    "indefinite though unphysical is allowed": (TOP, INERTIA, "inertia = [1, -1, 1]\nallow_unphysical_inertia = true", ["must be positive definite"]),
    "a flag that is a number": (TOP, INERTIA, "inertia = [1, 1, 5]\nallow_unphysical_inertia = 1", ["allow_unphysical_inertia: must be true or false, not the number 1"]),
    "thin rod": (TOP, INERTIA, "inertia = [1, 1, 0]", ["inertia: the body has no moment of inertia about the axis (0, 0, 1)", "give it some thickness"]),
    "rod as a box": (TOP, INERTIA, "box = [1, 0, 0]", ["box: the body has no moment of inertia about the axis (1, 0, 0)"]),
    "rod as points": (TOP, f"{MASS}\n{INERTIA}", "points = [{ mass = 1, at = [1, 1, 1] }, { mass = 1, at = [2, 2, 2] }]", ["points: the body has no moment of inertia about the axis (0.5774, 0.5774, 0.5774)"]),
    "one point": (TOP, f"{MASS}\n{INERTIA}", "points = [{ mass = 1, at = [1, 1, 1] }]", ["points: the body has no moment of inertia"]),
    "zero inertia": (TOP, INERTIA, "inertia = [0, 0, 0]", ["no moment of inertia"]),
    "zero planar inertia": (PLATE, "inertia = 2.0", "inertia = 0", ["inertia: the body has no moment of inertia about its centre of mass"]),
    "negative planar inertia": (PLATE, "inertia = 2.0", "inertia = -2", ["inertia: must be positive definite, but its principal moments are -2"]),
    "pendulum through its own axis": (TOP.replace(PGA3, FIXED), INERTIA, "inertia = [0, 0, 0]\ncenter_of_mass = [0, 0, 1]", ["no moment of inertia about the axis (0, 0, 1) through the fixed point"]),
    "moments that are too small": (TOP, INERTIA, "inertia = [1e-109, 1e-109, 1e-109]", ["inertia: the principal moments must lie within 1e-108 and 1e+108, so that nothing overflows"]),
    "no points": (TOP, f"{MASS}\n{INERTIA}", "points = []", ["points: needs at least one point"]),
    "negative point mass": (TOP, f"{MASS}\n{INERTIA}", "points = [{ mass = -1, at = [1, 1, 1] }]", ["points: point 1: mass: must be positive"]),
    "negative side": (TOP, INERTIA, "box = [1, 2, -3]", ["box: number 3 must not be negative: -3"]),
    "negative radius": (TOP, INERTIA, "cylinder = { radius = -1, height = 1 }", ["cylinder: radius: must not be negative"]),
    "disk in space": (TOP, INERTIA, "disk = 1", ['key "disk" has no meaning on SE3; keys of a body are']),
    "cylinder in the plane": (PLATE, "inertia = 2.0", "cylinder = { radius = 1, height = 1 }", ['key "cylinder" has no meaning on SE2']),
    "two inertias": (TOP, INERTIA, f"{INERTIA}\nbox = [1, 1, 1]", ['"inertia" and "box" contradict each other; give one']),
    "points and mass": (TOP, INERTIA, "points = [{ mass = 1, at = [1, 1, 1] }]", ['"points" and "mass" contradict each other']),
    "points and centre of mass": (TOP, f"{MASS}\n{INERTIA}", "points = [{ mass = 1, at = [1, 1, 1] }]\ncenter_of_mass = [0, 0, 0]", ['"points" and "center_of_mass" contradict each other']),
    "velocity and momentum": (TOP, MASS, f"{MASS}\nvelocity = [0, 0, 0]\nmomentum = {{ linear = [0, 0, 0] }}", ['"momentum" and "velocity" contradict each other; give one']),
    "angular velocity and momentum": (TOP, MASS, f"{MASS}\nangular_velocity = [0, 0, 0]\nmomentum = {{}}", ['"momentum" and "angular_velocity" contradict each other; give one']),
    "velocity of a fixed point": (TOP.replace(PGA3, FIXED), MASS, f"{MASS}\nvelocity = [0, 0, 0]", ['key "velocity" has no meaning on SO3']),
    "linear momentum of a fixed point": (TOP.replace(PGA3, FIXED), MASS, f"{MASS}\nmomentum = {{ linear = [0, 0, 0] }}", ['momentum: key "linear" has no meaning on SO3']),
    "anchor and other": (TOP, ANCHOR, f'{ANCHOR}\nother = "top"', ['"anchor" and "other" contradict each other']),
    "anchor and other_at": (TOP, ANCHOR, f"{ANCHOR}\nother_at = [0, 0, 0]", ['"anchor" and "other_at" contradict each other']),
    "spring to itself": (TOP, ANCHOR, 'other = "top"', ['interaction 2: other: "top" cannot be tied to itself by a spring']),
    "spring without length": (TOP, ANCHOR, "anchor = [0.1, 0.2, 0.05]", ["interaction 2: rest_length: the spring starts with length 0", "move one of its ends"]),
    "spring between bodies without length": (TOP.replace("[time]", SECOND), ANCHOR, 'other = "second"\nother_at = [-4.9, 0.2, 0.05]', ["interaction 2: rest_length: the spring starts with length 0"]),
    "duplicate names": (TOP.replace("[time]", SECOND), '"second"', '"top"', ['body 2: name: "top" is the name of body 1 already']),
    "name with a space": (TOP, 'name = "top"', 'name = "my top"', ['name: "my top" is not a name']),
    "name that injects": (TOP, 'name = "top"', 'name = "top; } int x"', ["is not a name"]),
    "name that is empty": (TOP, 'name = "top"', 'name = ""', ['name: "" is not a name']),
    "name with a line end": (TOP, 'name = "top"', 'name = "top\\n"', ['name: "top\\n" is not a name']),
    "name beyond ASCII": (TOP, 'name = "top"', 'name = "töp"', ["is not a name"]),
    "name too long": (TOP, 'name = "top"', f'name = "{"a" * 65}"', ["is not a name", "at most 64"]),
    "escapes in a message": (TOP, '"gravity"', '"\\u001b[31m"', ['unknown type "\\u001b[31m"']),
    "energy overflow": (TOP.replace(INERTIA, "inertia = [1e-100, 1e-100, 1e-100]"), MASS, "mass = 1e36\ncenter_of_mass = [1.123e35, 2.3451e35, 3.7777e35]\nangular_velocity = [1.31313e35, -2.91717e35, 1.7e35]", ["the energy at the start overflows"]),
    "not TOML": (TOP, "mass = 1.0", "mass =", ["is not valid TOML", "line 5"]),
    "unclosed text": (TOP, '"gravity"', '"gravity', ["is not valid TOML", "line 8"]),
    "unfinished": (TOP, "every = 2\n", "every = [2", ["is not valid TOML", "line 21, the end of the document"]),
    "a key set twice": (TOP, MASS, f"{MASS}\n{MASS}", ["is not valid TOML", "line 6"]),
    "nested too deeply": (TOP, MASS, f"mass = {'[' * 5000}", ["is not valid TOML: brackets are nested too deeply"]),
    "a key of too many parts": (TOP, MASS, f"mass{'.a' * 100000} = 1", ["line 5: a key of more than 16 parts"]),
    "a number of too many digits": (TOP, MASS, f"mass = {'9' * 5000}", ["is not valid TOML: a number of thousands of digits"]),
    "a hexadecimal number of too many digits": (TOP, MASS, f"mass = 0x{'f' * 5000}", ["mass: must lie within ±1e+36"]),
    "the same for an integer": (TOP, "every = 2", f"every = 0x{'f' * 5000}", ["every: must be at least 1 and at most 10^18, not a number of more than 20 digits"]),
}  # fmt: skip


@pytest.mark.parametrize(("text", "old", "new", "fragments"), MISTAKES.values(), ids=list(MISTAKES))
def test_a_mistake_is_one_clear_message(
    text: str, old: str, new: str, fragments: list[str]
) -> None:
    assert old in text
    with pytest.raises(UsageError) as caught:
        parse_scene(text.replace(old, new, 1).encode(), name="heavy_top", file="heavy_top.toml")
    message = str(caught.value)
    assert message.startswith("heavy_top.toml: ")
    for fragment in fragments:
        assert fragment in message
    assert message.isprintable()
    assert len(message) < 500
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("text", [TOP, PLATE])
def test_the_scenes_the_mistakes_are_made_in_are_right(text: str) -> None:
    parse_scene(text.encode(), name="right", file="right.toml")


def test_the_message_of_the_style_guide() -> None:
    with pytest.raises(UsageError) as caught:
        parse_scene(
            TOP.replace('body = "top"', 'body = "topp"').encode(), name="t", file="heavy_top.toml"
        )
    assert str(caught.value) == (
        'heavy_top.toml: interaction 2: unknown body "topp"; bodies are "top". Did you mean "top"?'
    )


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ("p1 = 7", '[hamiltonian]: parameters: "p1" is what a coordinate of the body is called'),
        ("xx = 7", '"xx" is what a coordinate of the body is called; rename it'),
        ("s = 7", '"s" is what a coordinate of the body is called; rename it'),
        ("k = [1, 2, 3], k_x = 7", '"k_x" is a number of its own and one of a vector; rename one'),
    ],
)
def test_a_parameter_has_a_symbol_of_its_own(parameters: str, message: str) -> None:
    general = TOP[: TOP.index("mass")] + "[hamiltonian]\nexpression = " + '"norm_squared(P)"\n'
    text = f"{general}parameters = {{ {parameters} }}\n{TOP[TOP.index('[time]') :]}"
    with pytest.raises(UsageError, match=re.escape(message)):
        parse_scene(text.encode(), name="top", file="top.toml")


def test_too_many_bodies_say_the_cap_and_how_to_lift_it() -> None:
    body = '[[body]]\nname = "b{}"\nmass = 1\ninertia = [1, 1, 1]\n'
    many = 'algebra = "pga3"\n' + "".join(body.format(k) for k in range(65))
    many += "[time]\nend = 1\nstep = 0.1\n"
    with pytest.raises(
        UsageError, match=r"65 bodies are more than the 64 .* \[limits\] bodies = 65"
    ):
        parse_scene(many.encode(), name="many", file="many.toml")
    lifted = f"{many}[limits]\nbodies = 65\n"
    assert len(parse_scene(lifted.encode(), name="many", file="many.toml").bodies) == 65


def test_too_many_interactions_say_the_cap_and_how_to_lift_it() -> None:
    many = TOP + '[[interaction]]\ntype = "gravity"\nacceleration = [0, 0, 1]\n' * 127
    with pytest.raises(UsageError, match=r"129 interactions .* \[limits\] interactions = 129"):
        parse_scene(many.encode(), name="many", file="many.toml")


class TestFiles:
    """What is not a readable TOML file of at most 1 MiB is refused before it is read."""

    def refused(self, path: Path | str) -> str:
        with pytest.raises(UsageError) as caught:
            read_scene(path)
        return str(caught.value)

    def test_a_missing_file(self, tmp_path: Path) -> None:
        assert "there is no such file" in self.refused(tmp_path / "none.toml")
        assert "there is no such file" in self.refused("none/none.toml")

    def test_an_unknown_name_suggests_a_bundled_scene(self) -> None:
        message = self.refused("heavytop")
        assert message.startswith("heavytop: is neither a bundled scene nor a file")
        assert message.endswith('Did you mean "heavy_top"?')

    def test_a_directory(self, tmp_path: Path) -> None:
        assert "is a directory" in self.refused(tmp_path)

    def test_a_fifo_does_not_block(self, tmp_path: Path) -> None:
        os.mkfifo(tmp_path / "fifo")
        assert "is not a regular file" in self.refused(tmp_path / "fifo")

    def test_a_device(self) -> None:
        assert "is not a regular file" in self.refused("/dev/zero")

    @pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
    def test_an_unreadable_file(self, tmp_path: Path) -> None:
        file = tmp_path / "secret.toml"
        file.write_text(TOP)
        file.chmod(0)
        assert "cannot be read: Permission denied" in self.refused(file)

    def test_a_huge_file(self, tmp_path: Path) -> None:
        file = tmp_path / "huge.toml"
        with file.open("wb") as out:
            out.truncate(1 << 40)  # sparse
        assert "is larger than the 1 MiB that a scene may have" in self.refused(file)

    def test_a_file_of_exactly_the_limit_is_read(self, tmp_path: Path) -> None:
        file = tmp_path / "large.toml"
        file.write_bytes(TOP.encode() + b"#" * ((1 << 20) - len(TOP)))
        assert read_scene(file).name == "large"

    def test_a_file_that_is_not_text(self, tmp_path: Path) -> None:
        file = tmp_path / "binary.toml"
        file.write_bytes(b'algebra = "pga3"\n\xff\xfe')
        assert "line 2: is not UTF-8 text" in self.refused(file)

    def test_an_empty_file(self, tmp_path: Path) -> None:
        (tmp_path / "empty.toml").touch()
        assert 'missing "algebra"' in self.refused(tmp_path / "empty.toml")

    def test_paths_that_no_file_can_have(self) -> None:
        assert "cannot be read" in self.refused("a\0b.toml")
        assert "cannot be read" in self.refused("a" * 5000)
        assert self.refused("no\nsuch.toml").isprintable()

    def test_a_loop_of_links(self, tmp_path: Path) -> None:
        (tmp_path / "loop.toml").symlink_to(tmp_path / "loop.toml")
        assert "cannot be read" in self.refused(tmp_path / "loop.toml")


def test_a_suggestion_is_close_or_absent() -> None:
    assert suggest("topp", ["top", "bottom"]) == ' Did you mean "top"?'
    assert suggest("SO3", ["so3"]) == ' Did you mean "so3"?'
    assert suggest("xyz", ["top"]) == ""
    assert suggest("top", []) == ""


VALUES = [
    "0", "-0.0", "1", "-1", "1e36", "-1e36", "1e37", "1e-36", "1e-300", "5e-324", "1e400", "nan",
    "-inf", "true", '"x"', '""', "[]", "{}", "[[]]", "[1]", "[1, 2]", "[0, 0, 0]", "[0, 0, 0, 0]",
    "[1e36, 1e36, 1e36]", "[[1,0,0],[0,1,0],[0,0,1]]", "[1e-36, 1e-36, 1e-36]", "1979-05-27",
    "12:00:00", "0x" + "f" * 300, "9" * 400, '"\\u0000"', '"brick"', "1_000", "[{}]", "[[1,2],3]",
]  # fmt: skip


def mutated(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    for _ in range(rng.choice([1, 1, 2, 5])):
        k = rng.randrange(len(lines))
        match rng.randrange(7):
            case 0:
                del lines[k]
            case 1:
                lines.insert(k, rng.choice(lines))
            case 2:
                lines[k], other = rng.choice(lines), lines[k]
                lines.append(other)
            case 3:
                lines[k] = re.sub(r"=.*", lambda _: f"= {rng.choice(VALUES)}", lines[k])
            case 4:
                numbers = list(re.finditer(r"-?\d[\d.e-]*", lines[k]))
                if numbers:
                    hit = rng.choice(numbers)
                    lines[k] = lines[k][: hit.start()] + rng.choice(VALUES) + lines[k][hit.end() :]
            case 5:
                at = rng.randrange(len(lines[k]) + 1)
                lines[k] = (
                    lines[k][:at]
                    + chr(rng.choice([0, 9, 34, 39, 61, 91, 93, 123, 125, 955, 0x1F600]))
                    + lines[k][at:]
                )
            case 6:
                at = rng.randrange(len(lines[k]) + 1)
                lines[k] = lines[k][:at] + lines[k][at + 1 :]
        if not lines:
            return ""
    return "\n".join(lines)


# The other general scenes take seconds for every hundred mutations and read by the same code.
MUTATED = [
    *("dzhanibekov", "heavy_top", "planar", "spring_pendulum", "tumble", "two_bodies"),
    *("asymmetric_top", "kepler", "rocket"),
]


@pytest.mark.parametrize("name", MUTATED)
def test_no_mutation_of_a_scene_raises_anything_but_a_usage_error(name: str) -> None:
    text = (BUNDLED / f"{name}.toml").read_text(encoding="utf-8")
    text = "\n".join(line.split("#")[0].rstrip() for line in text.split("\n") if line[:1] != "#")
    rng = random.Random(name)
    read, messages = 0, []
    for _ in range(400):
        contents = mutated(text, rng).encode("utf-8", "surrogatepass")
        try:
            scene = parse_scene(contents, name=name, file="mutated.toml")
        except UsageError as error:
            messages.append(str(error))
        else:
            read += 1
            assert len(scene.initial_state) > 0
            assert all(abs(x) < 1e308 for x in scene.initial_state)
            if read % 10 == 1:  # symmetries take a second with two bodies
                assert len(scene.conserved) > 0
                assert all(0 <= q.scale < 1e308 for q in scene.conserved)
            if isinstance(scene, Scene):
                assert all(min(p.moments) > 0 for p in scene.principal)
    assert read > 20
    assert all(message.startswith("mutated.toml: ") for message in messages)
    assert all(message.isprintable() for message in messages)
