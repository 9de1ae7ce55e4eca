"""Kernels in lanes of three: sums that become each other when e1, e2, e3 become e2, e3, e1."""

from __future__ import annotations

import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

from hamotor.codegen import bundled_algebras, read_algebra
from hamotor.codegen.algebra import Algebra
from hamotor.codegen.compiler import compile_algebra
from hamotor.codegen.cyclic import cyclic_program
from hamotor.codegen.kernel import Kernel
from hamotor.codegen.lanes import THREES_OPERATIONS, packed_body
from hamotor.codegen.library import library
from hamotor.codegen.program import Name, one_level, walk
from hamotor.codegen.spec import bundled_path, parse_algebra

ROOT = Path(__file__).resolve().parents[2]
SPECS = {name: read_algebra(bundled_path(name)) for name in bundled_algebras()}
IN_THREES = [
    (name, kernel) for name, spec in SPECS.items() for kernel in library(spec) if kernel.turn
]


def title(algebra: str, kernel: Kernel) -> str:
    return " ".join([algebra, kernel.namespace, kernel.name, *(e.name for e in kernel.operands)])


TITLES = [title(*pair) for pair in IN_THREES]


def test_what_costs_most_is_in_threes() -> None:
    assert "cga3  sandwich Versor Bivector" in TITLES
    assert "cga3  gp Bivector Trivector" in TITLES
    assert "cga3 so41 Ad_star_inverse Versor Momentum" in TITLES
    assert "cga3  unit_defect_change Versor Versor" in TITLES
    assert "pga3  sandwich Motor Bivector" in TITLES
    assert "sta  sandwich Rotor Bivector" in TITLES
    assert all(kernel.program.cost.total >= THREES_OPERATIONS for _, kernel in IN_THREES)


@pytest.mark.parametrize(("algebra", "kernel"), IN_THREES, ids=TITLES)
def test_every_three_become_each_other_term_by_term(algebra: str, kernel: Kernel) -> None:
    turn = kernel.turn
    assert turn is not None
    for statements, threes in (
        (dict(kernel.program.bindings), turn.threes),
        (dict(kernel.program.outputs), turn.outputs_threes),
    ):
        assert threes, algebra
        for name, x in statements.items():
            if name not in threes:
                assert one_level(turn.image(x)) == one_level(x)
                continue
            three, _ = threes[name]
            for (_, before), (_, after) in pairwise((*three, three[0])):
                assert turn.image(statements[before]) == statements[after]


@pytest.mark.parametrize(("algebra", "kernel"), IN_THREES, ids=TITLES)
def test_no_step_is_read_before_it_is_made(algebra: str, kernel: Kernel) -> None:
    known = {f"{p.name}.{c.name}" for p in kernel.program.parameters for c in p.element.components}
    for name, x in (*kernel.program.bindings, *kernel.program.outputs):
        assert {node.text for node in walk(x) if isinstance(node, Name)} <= known, algebra
        known.add(name)


def body(wanted: str) -> list[str]:
    ((_, kernel),) = [pair for pair in IN_THREES if title(*pair) == wanted]
    return packed_body(kernel)


def test_a_product_is_sums_of_vectors_and_totals() -> None:
    lines = body("cga3  gp Bivector Trivector")
    assert "const auto three_b_e23 = four(b.e23, b.e31, b.e12, b.e23);" in lines
    assert sum(line.startswith("const auto all_") for line in lines) == 4
    (returned,) = [line for line in lines if line.startswith("return")]
    assert returned.count("lanes::total(dot(") == 4
    e0 = "lanes::total(dot(-three_b_e01, three_t_e01i, -three_b_e23, three_t_e023))"
    assert f".e0 = {e0}, .e1 = all_e1[0], .e2 = all_e1[1], .e3 = all_e1[2]," in returned


def test_components_of_the_other_orientation_are_negated_in_their_lane() -> None:
    lines = body("pga4  sandwich Motor Hyperplane")
    assert "const auto three_m_e12 = four(m.e12, m.e23, -m.e13, m.e12);" in lines


def test_a_step_is_called_after_the_orientation_that_it_has() -> None:
    ((_, kernel),) = [p for p in IN_THREES if title(*p) == "pga3  sandwich Motor Bivector"]
    steps = [name for name, _ in kernel.program.bindings]
    assert steps[3:6] == ["c_e12", "c_e23", "c_e31"], "what the first results need stands first"


def test_small_kernels_are_in_lanes_where_loops_do_not_become_lanes() -> None:
    condition = "if constexpr (lanes::packed<S> && !lanes::loops_become_lanes) {"
    assert body("pga3  sandwich Motor Bivector")[0] == condition
    assert body("cga3  sandwich Versor Bivector")[0] == "if constexpr (lanes::packed<S>) {"


@pytest.mark.parametrize("diagonal", ["1, 1, 2", "1, 2, 3", "1, 1, -1"])
def test_three_vectors_of_unequal_squares_are_not_turned(diagonal: str) -> None:
    text = f"""
name = "foo"
description = "Vectors of unequal squares."
basis = ["e1", "e2", "e3"]
gram = {{ diagonal = [{diagonal}] }}

[element.Even]
doc = "Even."
symbol = "a"
blades = ["s", "e12", "e13", "e23"]

[kernels]
gp = ["Even Even"]
"""
    spec = parse_algebra(text, "foo.toml")
    (product,) = library(spec)
    assert cyclic_program(spec.algebra, product.program) is None
    gram = tuple(tuple(int(i == k) for k in range(3)) for i in range(3))
    euclidean = Algebra("foo", spec.algebra.basis, gram)
    assert cyclic_program(euclidean, library(SPECS["cl3"])[0].program) is not None


SCALAR = """
name = "foo"
description = "A number that is a product of three."
basis = ["e1", "e2", "e3", "e4"]
gram = { diagonal = [1, 1, 1, 1] }

[element.Scalar]
doc = "A number."
symbol = "s"
blades = ["s"]

[element.Even]
doc = "Even."
symbol = "a"
blades = ["s", "e12", "e13", "e14", "e23", "e24", "e34", "e1234"]

[kernels]
gp = ["Even Even Even -> Scalar"]
"""


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_lanes_compile_for_a_number_and_with_symbols_like_steps(
    tmp_path: Path, compiler: str
) -> None:
    (kernel,) = library(parse_algebra(SCALAR, "foo.toml"))
    assert kernel.turn is not None
    assert packed_body(kernel)[-3].startswith("return dot(")
    text = bundled_path("pga3").read_text("utf-8")
    pga3 = text.replace('symbol = "m"', 'symbol = "c"')
    assert pga3.count('symbol = "c"') == 1
    for name, spec_text in (("foo", SCALAR), ("pga3", pga3)):
        spec = parse_algebra(spec_text, f"{name}.toml")
        for file in compile_algebra(spec):
            path = tmp_path / file.path
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(file.text, encoding="utf-8")
    source = tmp_path / "both.cpp"
    source.write_text(BOTH, encoding="utf-8")
    runtime = ROOT / "runtime" / "include"
    flags = ("-std=c++20", "-mavx2", "-mfma", "-Wall", "-Wextra", "-Werror", "-fsyntax-only")
    done = subprocess.run(
        [compiler, *flags, "-I", tmp_path, "-I", runtime, source],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


BOTH = """
#include "hamotor/foo/foo.hpp"
#include "hamotor/pga3/pga3.hpp"

double number(const hamotor::foo::Even<double>& a) { return gp(a, a, a); }
auto line(const hamotor::pga3::Motor<double>& m, const hamotor::pga3::Bivector<double>& b) {
  return sandwich(m, b);
}
"""
