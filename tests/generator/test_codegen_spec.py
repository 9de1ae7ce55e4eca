"""Every mistake in a spec is one message with file, key and what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from hamotor.cli import main
from hamotor.codegen.library import library
from hamotor.codegen.spec import (
    MAXIMUM_BYTES,
    MAXIMUM_DIMENSION,
    bundled_path,
    parse_algebra,
    read_algebra,
)
from hamotor.errors import UsageError

GOOD = """
name = "plane"
description = "the Euclidean plane"
basis = ["e1", "e2"]
gram = { diagonal = [1, 1] }
[element.Scalar]
doc = "A number."
symbol = "s"
blades = ["s"]
[element.Vector]
doc = "A vector."
symbol = "v"
blades = ["e1", "e2"]
[element.Rotor]
doc = "A rotation."
symbol = "r"
blades = ["s", "e12"]
unit = true
[element.Bivector]
doc = "An area."
symbol = "b"
blades = ["e12"]
[kernels]
gp = ["Rotor Rotor -> Rotor"]
outer = ["Vector Vector"]
[[group]]
name = "SO2"
description = "rotations"
element = "Rotor"
generators = [{ name = "e12", bivector = { e12 = "-1/2" }, rate = "w12", momentum = "l12" }]
"""

SPACE = """
name = "space"
description = "space"
basis = ["e1", "e2", "e3"]
gram = { diagonal = [1, 1, 1] }
[element.Rotor]
doc = "A rotation."
symbol = "r"
blades = ["s", "e23", "e31", "e12"]
unit = true
[[group]]
name = "SO3"
description = "rotations"
element = "Rotor"
generators = [
  { name = "a", bivector = { e23 = 1 }, rate = "wa", momentum = "la" },
  { name = "b", bivector = { e31 = 1 }, rate = "wb", momentum = "lb" },
  { name = "c", bivector = { e12 = 1 }, rate = "wc", momentum = "lc" },
]
"""

INCOMPLETE = """
[element.Half]
doc = "Half a turn."
symbol = "h"
blades = ["e12"]
unit = true
[element.Weighted]
doc = "A rotor of another size."
symbol = "h"
blades = ["e12"]
fixed = { s = 1 }
[element.Wide]
doc = "An area and a vector."
symbol = "w"
blades = ["e12", "e1"]
"""


def replaced(text: str, old: str, new: str) -> str:
    assert text.count(old) >= 1
    return text.replace(old, new, 1)


def test_the_examples_are_right_before_they_are_broken() -> None:
    assert parse_algebra(GOOD, "plane.toml").name == "plane"
    assert len(parse_algebra(SPACE, "space.toml").groups[0].generators) == 3


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'basis = ["e1", "e2"]',
            'bases = ["e1", "e2"]',
            'unknown key "bases".*Did you mean "basis"',
        ),
        ('name = "plane"', "", '"name" must be a text; it is missing'),
        ('name = "plane"', 'name = "2d"', r'"name" = "2d" must match \[A-Za-z\]'),
        ('name = "plane"', "name = 3", '"name" must be a text'),
        ('basis = ["e1", "e2"]', "basis = 3", "basis: must be an array"),
        ('basis = ["e1", "e2"]', 'basis = ["x", "e2"]', 'basis: "x" must be "e" and one digit'),
        ('basis = ["e1", "e2"]', 'basis = ["e1", "e1"]', "basis: a basis vector is listed twice"),
        ('basis = ["e1", "e2"]', "basis = []", "basis: 0 vectors; 1 to"),
        ("diagonal = [1, 1]", "diagonal = [1]", "gram.diagonal: 1 numbers for 2 basis vectors"),
        ("diagonal = [1, 1]", "diagonal = [1, 0.5]", "gram.diagonal: 0.5 must be an integer or a"),
        ("diagonal = [1, 1]", "diagonal = [1, true]", "gram.diagonal: True must be an integer"),
        ("diagonal = [1, 1]", 'diagonal = [1, "1/0"]', "'1/0' is not a fraction"),
        ("diagonal = [1, 1]", 'diagonal = [1, "one"]', "'one' is not a fraction"),
        (
            "diagonal = [1, 1]",
            'diagonal = [1, "1e999999"]',
            "a number of more than 60 digits, or its",
        ),
        ("diagonal = [1, 1]", f"diagonal = [1, {'9' * 61}]", "a number of more than 60 digits"),
        ("diagonal = [1, 1]", f"diagonal = [1, 0x{'9' * 9000}]", "a number of more than 60 digits"),
        ("diagonal = [1, 1]", f"diagonal = [1, {'9' * 9000}]", "a number of thousands of digits"),
        ("diagonal = [1, 1]", f"diagonal = {'[' * 9000}", "brackets are nested too deeply"),
        ("diagonal = [1, 1]", "matrx = [[1]]", 'gram: unknown key "matrx".*Did you mean "matrix"'),
        ("{ diagonal = [1, 1] }", "{}", 'gram: needs exactly one of "diagonal" and "matrix"'),
        ("{ diagonal = [1, 1] }", "7", "gram: must be a table"),
        (
            "{ diagonal = [1, 1] }",
            "{ diagonal = [1, 1] }\nlengths = { e1 = 1 }",
            "lengths: e1·e1 = 1",
        ),
        (
            "{ diagonal = [1, 1] }",
            "{ diagonal = [1, 1] }\nlengths = { e1 = 0.5 }",
            "must be an integer",
        ),
        ("diagonal = [1, 1]", "matrix = [[1, 0]]", "gram.matrix: must be 2 × 2"),
        (
            "diagonal = [1, 1]",
            "matrix = [[1, 2], [3, 1]]",
            "gram.matrix: not symmetric: e2·e1 = 3 but e1·e2 = 2",
        ),
        (
            'blades = ["e1", "e2"]',
            'blades = ["e1", "e3"]',
            '"e3" is not a blade; the basis vectors',
        ),
        ('blades = ["e1", "e2"]', 'blades = ["e1", "e1"]', '"e1" names a blade that is already'),
        ('blades = ["s", "e12"]', 'blades = ["e21", "e12"]', '"e12" names a blade that is already'),
        ('blades = ["e1", "e2"]', 'blades = ["e1", 2]', "2 is not the name of a blade"),
        ('blades = ["e1", "e2"]', "", "element.Vector.blades: must be an array"),
        ("unit = true", 'unit = "yes"', "element.Rotor.unit: must be true or false"),
        ("unit = true", "untit = true", 'element.Rotor: unknown key "untit".*Did you mean "unit"'),
        ("unit = true", "fixed = { e12 = 1 }", '"e12" names a blade that is already there'),
        ("unit = true", "fixed = { e12 = 1, e21 = 1 }", '"e21" names a blade that is already'),
        ('symbol = "v"', 'symbol = "v-"', 'element.Vector: "symbol" = "v-" must match'),
        ('doc = "A vector."', "", 'element.Vector: "doc" must be a text; it is missing'),
        ("[element.Vector]", "[element.3d]", "element.3d: must match"),
        ('blades = ["s"]', 'blades = ["e1"]', "element.Scalar: is the type of numbers"),
        (
            'blades = ["s"]',
            "blades = []\nfixed = { s = 1 }",
            "element.Scalar: is the type of numbers",
        ),
        ('blades = ["s"]', 'blades = ["s"]\nunit = true', "element.Scalar: is the type of numbers"),
        ('["Vector Vector"]', '["Scalar Vector"]', "Scalar is a number, which functions return"),
        ("outer =", "outr =", 'kernels: unknown operation "outr".*Did you mean "outer"'),
        ('["Vector Vector"]', '["Vector"]', 'kernels.outer: "Vector" must be 2 element name'),
        ('["Vector Vector"]', '["Vector Vector ->"]', "kernels.outer: .* must be 2 element name"),
        ('["Vector Vector"]', "[2]", "kernels.outer: 2 must be a text such as"),
        ('["Vector Vector"]', '"Vector Vector"', "kernels.outer: must be an array"),
        (
            '["Vector Vector"]',
            '["Vector Vectr"]',
            'kernels.outer: "Vector Vectr": unknown element "Vectr".*Did you mean "Vector"',
        ),
        (
            '["Vector Vector"]',
            '["Vector Vector", "Vector Vector"]',
            'kernels.outer: "Vector Vector" is listed twice',
        ),
        ('element = "Rotor"', 'element = "Roter"', 'unknown element "Roter".*Did you mean "Rotor"'),
        ('rate = "w12"', 'rat = "w12"', 'generators: unknown key "rat".*Did you mean "rate"'),
        ('rate = "w12"', 'rate = "1"', 'group SO2.e12: "rate" = "1" must match'),
        ('{ e12 = "-1/2" }', '{ e13 = "-1/2" }', '"e13" is not a blade'),
        ('{ e12 = "-1/2" }', "{ e1 = 1 }", "group SO2: generator e12 is not a bivector"),
        ('{ e12 = "-1/2" }', "{ e12 = 0 }", "group SO2: generator e12 is not a bivector"),
        ('{ e12 = "-1/2" }', '"e12"', "group SO2.e12.bivector: must be a table"),
        ("[[group]]", "[group]", "group: must be an array"),
        ("[kernels]", "[kernels", "not valid TOML"),
    ],
)
def test_a_mistake_is_named_with_file_and_key(old: str, new: str, message: str) -> None:
    with pytest.raises(UsageError, match=rf"(?s)^plane\.toml: .*{message}"):
        parse_algebra(replaced(GOOD, old, new), "plane.toml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("e12 = 1", "e31 = 1", "SO3: the generators are linearly dependent"),
        ('momentum = "lb"', 'momentum = "la"', "SO3: two generators have the same momentum"),
        ('rate = "wb"', 'rate = "wa"', "SO3: two generators have the same rate"),
        (
            '  { name = "c", bivector = { e12 = 1 }, rate = "wc", momentum = "lc" },\n',
            "",
            "SO3 is not closed: the bracket of a and b has parts along e12, which no generator",
        ),
        (
            'blades = ["s", "e23", "e31", "e12"]',
            'blades = ["s", "e12"]',
            "Rotor does not hold the group: .* need e13, e23 as well",
        ),
        *(
            ("\n]\n", f'\n]\ncasimirs = [{{ name = "c", {text} }}]\n', message)
            for text, message in (
                ('numerator = "la"', "SO3: c is no Casimir: it does not Poisson-commute"),
                ('numerator = "la^2 + lb^2 - lc^2"', "SO3: c is no Casimir"),
                ('numerator = "1 + la^2 + lb^2 + lc^2"', "Casimir c: its terms have different"),
                ('numerator = "ld"', 'SO3.casimirs.c.numerator: "ld" is not one of la, lb, lc'),
                ('numerator = "0"', "SO3.casimirs.c.numerator: is zero"),
                ('numerator = "la", denominator = "0"', "SO3.casimirs.c.denominator: is zero"),
            )
        ),
        ("unit = true", "unit = false", "SO3: Rotor must be a type of unit versors"),
    ],
)
def test_a_wrong_group_is_named(old: str, new: str, message: str) -> None:
    with pytest.raises(UsageError, match=rf"^space\.toml: group .*{message}"):
        parse_algebra(replaced(SPACE, old, new), "space.toml")


@pytest.mark.parametrize(
    ("request_line", "message"),
    [
        ('gp = ["Vector Rotor"]', None),
        ('gp = ["Vector Vector"]', "no element type holds the result"),
        ('outer = ["Vector Bivector"]', None),
        ('sandwich = ["Vector Vector"]', "Vector must be a unit versor"),
        ('sandwich_lean = ["Rotor Vector"]', "no form of sandwich_lean takes fewer operations"),
        ('exp = ["Bivector"]', 'name the result, as in "exp Bivector -> Motor"'),
        ('exp = ["Vector -> Rotor"]', "Vector is not a bivector"),
        ('grade = ["Rotor 2 3"]', "must be 1 element name"),
        ('log = ["Rotor -> Weighted"]', "Weighted promises more than log keeps: a fixed part"),
        (
            'log = ["Weighted -> Bivector"]',
            "Weighted has a fixed part; name a type that stores all",
        ),
        ('log = ["Half -> Bivector"]', "Half has no scalar part, which log needs"),
        ('log_lean = ["Half -> Bivector"]', "Half has no scalar part, which log needs"),
        ('cayley_inverse = ["Half -> Bivector"]', "Half has no scalar part, which cayley_inverse"),
        ('sqrt = ["Half"]', "Half has no scalar part, which sqrt needs"),
        ('normalize = ["Half"]', None),
        ('log_lean = ["Rotor -> Wide"]', None),
        ('log_lean = ["Rotor -> Vector"]', "Vector does not hold the result's part along e12"),
    ],
)
def test_a_request_that_cannot_be_met_is_named(request_line: str, message: str | None) -> None:
    text = replaced(GOOD, 'gp = ["Rotor Rotor -> Rotor"]\nouter = ["Vector Vector"]', request_line)
    text = replaced(text, "[kernels]", f"{INCOMPLETE}[kernels]")
    if message is None:
        assert len(library(parse_algebra(text, "plane.toml"))) > 0
        return
    with pytest.raises(UsageError, match=rf"^plane\.toml: .*{message}"):
        library(parse_algebra(text, "plane.toml"))


@pytest.mark.parametrize("operation", ["exp", "cayley"])
def test_a_bivector_with_a_number_in_it_is_none_also_where_it_is_null(operation: str) -> None:
    text = replaced(GOOD, "diagonal = [1, 1]", "diagonal = [0, 1]")
    text = replaced(text, 'gp = ["Rotor Rotor -> Rotor"]', f'{operation} = ["Rotor -> Rotor"]')
    with pytest.raises(UsageError, match="Rotor is not a bivector"):
        library(parse_algebra(text, "plane.toml"))


def test_the_cap_on_dimensions_says_how_to_lift_it() -> None:
    names = [f"e{i}" for i in range(MAXIMUM_DIMENSION + 1)]
    basis = "basis = [" + ", ".join(f'"{n}"' for n in names) + "]"
    with pytest.raises(UsageError, match=r"basis: 9 vectors; 1 to 8 are allowed .*lifts the cap"):
        parse_algebra(replaced(GOOD, 'basis = ["e1", "e2"]', basis), "plane.toml")


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"^none\.toml: not a readable file"):
        read_algebra(tmp_path / "none.toml")
    with pytest.raises(UsageError, match="not a readable file"):
        read_algebra(tmp_path)
    huge = tmp_path / "huge.toml"
    huge.write_text("#" * (MAXIMUM_BYTES + 1), "utf-8")
    with pytest.raises(UsageError, match=rf"^huge\.toml: larger than {MAXIMUM_BYTES} bytes"):
        read_algebra(huge)
    latin = tmp_path / "latin.toml"
    latin.write_bytes(b'name = "caf\xe9"')
    with pytest.raises(UsageError, match=r"^latin\.toml: cannot be read"):
        read_algebra(latin)


def test_unknown_algebras_are_named_with_what_there_is() -> None:
    with pytest.raises(UsageError, match=r'unknown algebra "pga33"; .*Did you mean "pga3"'):
        bundled_path("pga33")


def test_a_wrong_name_on_the_command_line_exits_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["generate", "pga33"]) == 2
    assert 'Did you mean "pga3"' in capsys.readouterr().err
