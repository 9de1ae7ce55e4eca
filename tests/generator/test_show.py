"""What `hamotor show` and `hamotor table` print."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hamotor.codegen import show, table
from hamotor.codegen.library import library
from hamotor.codegen.spec import bundled_algebras, bundled_path, read_algebra
from hamotor.codegen.tree import GENERATED
from hamotor.errors import UsageError

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


def golden(name: str) -> str:
    return (GOLDEN / f"{name}.txt").read_text(encoding="utf-8").removesuffix("\n")


@pytest.mark.parametrize("algebra", ["pga2", "pga3"])
@pytest.mark.parametrize("product", ["gp", "regressive"])
def test_cayley_tables_are_as_printed_before(algebra: str, product: str) -> None:
    assert table(algebra, product) == golden(f"{algebra}_{product}_table")


def test_a_shown_kernel_is_as_printed_before() -> None:
    assert show("pga3", "sandwich", ["motor", "point"]) == golden("pga3_sandwich_motor_point")


@pytest.mark.parametrize("algebra", bundled_algebras())
def test_every_listed_kernel_is_shown_as_it_is_generated(algebra: str) -> None:
    folder = GENERATED / "hamotor" / algebra
    committed = "\n".join(p.read_text(encoding="utf-8") for p in sorted(folder.glob("*.hpp")))
    kernels = library(read_algebra(bundled_path(algebra)))
    names = {re.sub("grade_.*", "grade", re.sub(".*_matrix", "matrix", k.name)) for k in kernels}
    shown = [text for name in sorted(names) for text in show(algebra, name, []).split("\n\n")]
    assert len(shown) == len(kernels)
    for text in shown:
        assert text in committed, text


def test_a_product_without_operands_shows_every_kernel_of_that_name() -> None:
    text = show("pga3", "sandwich", [])
    requested = read_algebra(bundled_path("pga3")).requests
    assert text.count("/// sandwich: ") == sum(r.operation == "sandwich" for r in requested)
    assert text.count("/// Cost: ") == text.count("/// sandwich: ")


def test_a_kernel_that_no_spec_lists_is_made_and_said_to_be_so() -> None:
    text = show("pga3", "outer", ["Plane", "Point"])
    assert 'add "Plane Point" to kernels.outer in pga3.toml' in text
    signature = "Pseudoscalar<S> outer(const Plane<S>& p, const Point<S>& x)"
    assert signature in " ".join(text.split())


def test_chains_of_factors_are_made_as_well() -> None:
    text = show("pga3", "gp", ["plane", "plane", "plane"])
    assert text.startswith("/// gp: Plane Plane Plane -> Odd\n")


def test_group_functions_are_found_by_the_names_of_rates_and_momenta() -> None:
    both = show("pga3", "ad", ["rate", "rate"])
    assert both.count("/// ad: ") == 3
    one = show("pga3", "ad", ["so3::Rate", "so3::Rate"])
    assert one in both
    assert one.count("/// ad: ") == 1


@pytest.mark.parametrize(
    ("algebra", "product", "operands", "message"),
    [
        ("pga33", "gp", [], 'unknown algebra "pga33".* Did you mean "pga3"'),
        ("pga3", "sandwhich", [], 'unknown product "sandwhich".* Did you mean "sandwich"'),
        ("pga3", "gp", ["moter", "motor"], 'unknown element "moter".* Did you mean "Motor"'),
        ("pga3", "gp", ["motor"], "name the operands: gp ELEMENT ELEMENT"),
        ("pga3", "gp", ["motor", "motor", "->"], '"->" must be followed by one element'),
        ("pga3", "gp", ["motor", "motor", "2"], "gp takes no grade"),
        ("pga3", "grade", ["motor"], "grade needs a grade"),
        ("pga3", "ad", ["motor"], "ad is a group's function; there are ad: Rate Rate -> Rate"),
        ("pga3", "gp", ["motor", "se3::rate"], "not those of a group"),
        ("pga3", "exp", ["motor"], "name the result"),
        ("pga3", "exp", ["plane", "->", "motor"], "Plane is not a bivector"),
        ("pga3", "sandwich", ["plane", "point"], "must be a unit versor"),
    ],
)
def test_what_cannot_be_shown_is_named(
    algebra: str, product: str, operands: list[str], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        show(algebra, product, operands)


def test_a_table_of_one_operand_is_refused() -> None:
    with pytest.raises(UsageError, match=r'no table of "grade".*gp'):
        table("pga3", "grade")
    with pytest.raises(UsageError, match=r'Did you mean "commutator"'):
        table("pga3", "comutator")
