"""A spec may call its things what it likes: what is accepted compiles, the rest is explained."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable
from pathlib import Path

import pytest

from hamotor.codegen import reserved
from hamotor.codegen.compiler import compile_algebra
from hamotor.codegen.library import library
from hamotor.codegen.spec import OPERATIONS, AlgebraSpec, parse_algebra
from hamotor.errors import UsageError

ROOT = Path(__file__).resolve().parents[2]
HEADERS = sorted((ROOT / "runtime/include/hamotor").glob("*.hpp"))
TEMPLATES = sorted((ROOT / "templates").glob("*.jinja"))
KERNELS = sorted((ROOT / "generated/hamotor").glob("*/*kernels.hpp"))
WORD = re.compile(r"[A-Za-z_]\w*")

HEAD = """
name = "NAME"
description = "a plane"
basis = ["e1", "e2"]
gram = { diagonal = [1, 1] }
[element.Scalar]
doc = "A number."
symbol = "s"
blades = ["s"]
[element.Rotor]
doc = "A rotation."
symbol = "r"
blades = ["s", "e12"]
unit = true
[element.Even]
doc = "A rotor of any size."
symbol = "a"
blades = ["s", "e12"]
[element.Bivector]
doc = "An area."
symbol = "b"
blades = ["e12"]
"""
TYPE = """
[element.NAME]
doc = "A type."
symbol = "SYMBOL"
blades = ["s", "e12"]
unit = true
"""
GROUP = """
[[group]]
name = "NAME"
description = "rotations"
element = "Rotor"
kernels = ["dexp", "dexp_inverse"]
generators = [{ name = "x", bivector = { e12 = "-1/2" }, rate = "RATE", momentum = "RATE" }]
"""
UNARY = ("reverse", "norm", "norm_squared", "inverse", "normalize", "sqrt", "involute")


def with_types(named: Iterable[tuple[str, str]]) -> str:
    """Types with their symbols, and every kind of kernel of each."""
    pairs = list(named)
    text = HEAD.replace("NAME", "toy")
    text += "".join(TYPE.replace("NAME", n).replace("SYMBOL", s) for n, s in pairs)
    lines = ["[kernels]"]
    lines += [f"{operation} = {[n for n, _ in pairs]}".replace("'", '"') for operation in UNARY]
    for operation, form in (
        ("gp", "{0} {0} -> {0}"),
        ("outer", "{0} Even -> Even"),
        ("sandwich", "{0} Bivector"),
        ("log", "{0} -> Bivector"),
        ("cayley_inverse", "{0} -> Bivector"),
    ):
        entries = [form.format(n) for n, _ in pairs]
        lines.append(f"{operation} = {entries}".replace("'", '"'))
    return text + "\n".join(lines)


def with_groups(named: Iterable[tuple[str, str]]) -> str:
    groups = (GROUP.replace("NAME", n).replace("RATE", r) for n, r in named)
    return HEAD.replace("NAME", "toy") + "".join(groups)


def accepts(text: str) -> bool:
    try:
        library(parse_algebra(text, "toy.toml"))
    except UsageError:
        return False
    return True


def identifiers(*files: Path) -> list[str]:
    found: set[str] = set()
    for file in files:
        found |= set(WORD.findall(file.read_text(encoding="utf-8")))
    return sorted(found)


def pool() -> list[str]:
    """Whatever templates and kernels say, and what the language and the library reserve."""
    steps = set()
    for file in KERNELS[::3]:
        steps |= set(re.findall(r"const (?:auto|S) (\w+) =", file.read_text(encoding="utf-8")))
    chosen = {*identifiers(*TEMPLATES), *(s for s in steps if "_" not in s or len(s) < 7)}
    chosen |= reserved.KEYWORDS | reserved.MACROS | set(OPERATIONS)
    chosen |= {"EOF", "NULL", "NAN", "EIO", "E2BIG", "S", "T", "N", "I", "SE3", "Std", "Exp", "x1"}
    chosen |= {"Name", "Elements", "Log", "Toy", "Scalar", "Dot", "New", "Ad", "a", "b", "m", "mu"}
    return sorted(name for name in chosen if len(name) < 24)


def compiled(folder: Path, *specs: AlgebraSpec) -> str:
    """What the compiler says about all that these algebras give, with everything instantiated."""
    lines = [f'#include "hamotor/{spec.name}/{spec.name}.hpp"' for spec in specs]
    calls: list[str] = []
    for spec in specs:
        for file in compile_algebra(spec):
            path = folder / file.path
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(file.text, encoding="utf-8")
        space = f"hamotor::{spec.name}"
        types = [name for name in spec.elements if name != "Scalar"]
        lines += [f"template struct {space}::{name}<double>;" for name in types]
        for group in spec.groups:
            lines.append(f"template struct {space}::{group.rate.cpp_name}<double>;")
            lines.append(f"static_assert({space}::{group.name}::dimension == 1);")
        for kernel in library(spec):
            values = ", ".join(f"{space}::{e.cpp_name}<double>{{}}" for e in kernel.operands)
            inner = f"{space}::{kernel.namespace}" if kernel.namespace else space
            calls.append(f"  (void){inner}::{kernel.name}({values});")
    source = folder / "use.cpp"
    source.write_text("\n".join([*lines, "void use() {", *calls, "}"]), encoding="utf-8")
    flags = ["-std=gnu++20", "-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    folders = [f"-I{folder}", f"-I{ROOT / 'runtime/include'}"]
    run = subprocess.run(
        ["g++", *flags, *folders, str(source)], capture_output=True, text=True, check=False
    )
    return run.stderr


@pytest.mark.slow
def test_every_accepted_type_and_symbol_compiles(tmp_path: Path) -> None:
    names = [n for n in pool() if accepts(with_types([(n, "v")])) and n not in ("Even", "Rotor")]
    symbols = [s for s in pool() if accepts(with_types([("Type", s)]))]
    assert len(names) > 20
    assert len(symbols) > 20
    pairs = [(n, "v") for n in names]
    pairs += [(f"Type{i}x", s) for i, s in enumerate(symbols)]
    assert compiled(tmp_path, parse_algebra(with_types(pairs), "toy.toml")) == ""


@pytest.mark.slow
def test_every_accepted_group_and_coordinate_compiles(tmp_path: Path) -> None:
    names = [n for n in pool() if accepts(with_groups([(n, "w")]))]
    names = list({n.lower(): n for n in names}.values())
    rates = [r for r in pool() if accepts(with_groups([("Group", r)]))]
    assert len(names) > 10
    assert len(rates) > 20
    pairs = [(n, "w") for n in names] + [(f"Group{i}x", r) for i, r in enumerate(rates)]
    assert compiled(tmp_path, parse_algebra(with_groups(pairs), "toy.toml")) == ""


@pytest.mark.slow
def test_every_accepted_algebra_compiles(tmp_path: Path) -> None:
    specs = []
    for name in sorted({*pool(), *identifiers(*HEADERS)}):
        text = with_groups([("Spin", "w")]).replace('"toy"', f'"{name}"')
        if accepts(text):
            specs.append(parse_algebra(text, "toy.toml"))
    assert len(specs) > 20
    assert compiled(tmp_path, *specs[::4]) == ""


@pytest.mark.slow
def test_no_macro_is_accepted() -> None:
    text = "".join(f"#include <{h}>\n" for h in ("array", "cmath", "cstddef", "limits", "cstdio"))
    command = ["g++", "-std=gnu++20", "-dM", "-E", "-xc++", "-"]
    run = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    macros = sorted(set(re.findall(r"^#define ([A-Za-z]\w*)", run.stdout, re.MULTILINE)))
    assert len(macros) > 100
    functions = frozenset(OPERATIONS)
    assert not [m for m in macros if not reserved.small(m)]
    assert not [m for m in macros if not reserved.element(m)]
    assert not [m for m in macros if not reserved.group(m, functions)]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "toy"', 'name = "namespace"', '"name" = "namespace" is a keyword of C.*Call it'),
        ('name = "toy"', 'name = "std"', '"std" is a name that generated code uses itself'),
        ('name = "toy"', 'name = "scalar"', '"scalar" is a name that generated code uses'),
        ('name = "toy"', 'name = "detail"', '"detail" is a name of Hamotor\'s runtime'),
        ('name = "toy"', 'name = "linux"', '"linux" is a macro of the C library'),
        ("[element.Even]", "[element.class]", 'element.class: must be .*Call it "Class"'),
        ("[element.Even]", "[element.Rate]", "element.Rate: is a type that every group has"),
        ("[element.Even]", "[element.S]", "element.S: must be letters and digits, the first a"),
        ('symbol = "a"', 'symbol = "dot"', '"symbol" = "dot" is a name that generated code uses'),
        ('symbol = "a"', 'symbol = "auto"', '"symbol" = "auto" is a keyword'),
        ('symbol = "a"', 'symbol = "S"', '"symbol" = "S" must be .*Call it "s"'),
        ('doc = "An area."', 'doc = "An\\narea."', '"doc" becomes a line of a C'),
        ('doc = "An area."', 'doc = "An area\\\\"', '"doc" becomes a line of a C'),
        ('blades = ["e12"]', 'blades = ["1"]', 'the scalar is called "s"'),
        ('name = "Spin"', 'name = "Exp"', "the namespace exp, which is a function"),
        ('name = "Spin"', 'name = "New"', "the namespace new, which is a keyword"),
        ('name = "Spin"', 'name = "Elements"', "elements, which is a function, a member or a file"),
        ('name = "Spin"', 'name = "Toy"', "its namespace, toy, is the algebra's name"),
        ('name = "Spin"', 'name = "Even"', "Even is an element type already"),
        ('name = "Spin"', 'name = "spin"', 'must be letters and digits.*Call it "Spin"'),
        ('rate = "w"', 'rate = "size"', '"rate" = "size" is a name that generated code uses'),
        ('rate = "w"', 'rate = "int"', '"rate" = "int" is a keyword'),
    ],
)
def test_a_name_that_cannot_be_is_explained(old: str, new: str, message: str) -> None:
    text = with_groups([("Spin", "w")])
    assert accepts(text)
    assert old in text
    with pytest.raises(UsageError, match=rf"(?s)^toy\.toml: .*{message}"):
        parse_algebra(text.replace(old, new), "toy.toml")


def test_a_blade_that_is_a_keyword_is_explained() -> None:
    text = HEAD.replace("NAME", "toy").replace("e12", "enum")
    text = text.replace('["e1", "e2"]', '["en", "eu", "em"]').replace("[1, 1]", "[1, 1, 1]")
    with pytest.raises(UsageError, match='"enum" is a keyword of C'):
        parse_algebra(text, "toy.toml")


def test_two_kernels_that_differ_in_their_result_only_are_refused() -> None:
    text = HEAD.replace("NAME", "toy") + '[kernels]\ngp = ["Even Even", "Even Even -> Rotor"]'
    with pytest.raises(UsageError, match="have the same operands, by which alone"):
        parse_algebra(text, "toy.toml")


def test_a_symbol_that_is_a_step_of_its_kernel_is_refused() -> None:
    with pytest.raises(UsageError, match=r'element\.Type: "symbol" = "root" is a step'):
        library(parse_algebra(with_types([("Type", "root")]), "toy.toml"))


@pytest.mark.parametrize("symbol", ["squares", "half_turn", "four", "turned", "four_r_s", "sum12"])
def test_a_symbol_that_a_groups_function_or_lanes_use_is_refused(symbol: str) -> None:
    text = with_groups([("Spin", "w")]).replace('symbol = "r"', f'symbol = "{symbol}"')
    with pytest.raises(UsageError, match=rf'element\.Rotor: "symbol" = "{symbol}" is a step'):
        library(parse_algebra(text, "toy.toml"))


def test_another_symbol_is_named_that_is_no_step() -> None:
    named = with_types([("Type", "f")]).replace("[1, 1]", "[1, -1]")
    with pytest.raises(UsageError, match=r'"f" is a step of log already.  Call it "[a-dg-z]"'):
        library(parse_algebra(named, "toy.toml"))


@pytest.mark.slow
@pytest.mark.parametrize("symbol", ["w", "x", "mu", "a", "b"])
def test_a_groups_functions_compile_with_the_symbols_of_each_other(
    tmp_path: Path, symbol: str
) -> None:
    text = with_groups([("Spin", "w")]).replace('symbol = "r"', f'symbol = "{symbol}"')
    text = text.replace('"dexp_inverse"', '"dexp_inverse", "kinematics_onto"')
    assert compiled(tmp_path, parse_algebra(text, "toy.toml")) == ""


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ("gp = ['Even Even -> Rotor']", "Rotor promises V ~V = 1, which the result need not"),
        ("gp = ['Rotor Bivector -> Rotor']", "Rotor promises V ~V = 1"),
        ("gp = ['Rotor Rotor -> Half']", "Half does not hold the result's part along e12"),
        ("gp = ['Rotor Rotor -> Weighted']", "Weighted has a fixed part along s, where"),
        ("outer = ['Rotor Rotor -> Rotor']", "Rotor promises V ~V = 1"),
        ("grade = ['Rotor 2 -> Rotor']", "promises more than grade keeps"),
        ("reverse = ['Even -> Rotor']", "promises more than reverse keeps: V ~V = 1"),
        ("exp = ['Bivector -> Weighted']", "Weighted promises more than exp keeps: a fixed part"),
        ("exp = ['Bivector -> Half']", "Half does not hold all grades and blades"),
    ],
)
def test_a_result_that_promises_too_much_is_refused(request_: str, message: str) -> None:
    text = HEAD.replace("NAME", "toy") + (
        '[element.Half]\ndoc = "Half."\nsymbol = "h"\nblades = ["s"]\nunit = true\n'
        '[element.Weighted]\ndoc = "Weight 1."\nsymbol = "h"\nblades = ["e12"]\n'
        "fixed = { s = 1 }\n[kernels]\n"
    )
    spec = parse_algebra(text + request_.replace("'", '"'), "toy.toml")
    with pytest.raises(UsageError, match=message):
        library(spec)


def test_what_is_proved_is_accepted() -> None:
    kernels = "[kernels]\ngp = ['Rotor Rotor -> Rotor']\nsandwich = ['Rotor Rotor', 'Rotor Even']"
    text = HEAD.replace("NAME", "toy") + kernels.replace("'", '"')
    assert len(library(parse_algebra(text, "toy.toml"))) == 3
