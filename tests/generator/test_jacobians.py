"""dexp and dexp_inverse: the power series, the derivative of exp, each other's inverse."""

from __future__ import annotations

import json
from typing import Any

import mpmath
import pytest
from tests.reference import jacobian
from tests.reference.jacobian import BOUND, CLOSED, OTHERS, ROOT, lie_group, multivector, size
from tests.reference.oracle import Oracle, added, scaled

from hamotor.codegen.library import group_kernels
from hamotor.codegen.spec import bundled_algebras, bundled_path, parse_algebra, read_algebra
from hamotor.codegen.starter import starter_spec
from hamotor.errors import UsageError

Value = dict[Any, Any]


def exponential(algebra: Oracle, b: Value) -> Value:
    """Power series of b / 2¹⁰, squared ten times."""
    small = scaled(mpmath.ldexp(1, -10), b)
    term: Value = {(): mpmath.mpf(1)}
    total = dict(term)
    for n in range(1, 60):
        term = scaled(mpmath.mpf(1) / n, algebra.gp(term, small))
        total = added(total, term)
    for _ in range(10):
        total = algebra.gp(total, total)
    return total


@pytest.mark.parametrize("name", CLOSED + OTHERS)
def test_the_series_is_the_body_rate_of_exp(name: str) -> None:
    """~M M' for M = exp(X + t Y), by a central difference: the convention."""
    algebra, group = lie_group(name)
    n = len(group.generators)
    with mpmath.workdps(60):
        x = multivector(group, [mpmath.mpf(i * i % 7 - 3) / 4 for i in range(n)])
        y = multivector(group, [mpmath.mpf(i * i % 5 - 2) / 3 for i in range(1, n + 1)])
        step = mpmath.mpf(10) ** -20
        more = exponential(algebra, added(x, scaled(step, y)))
        less = exponential(algebra, added(x, scaled(-step, y)))
        change = scaled(1 / (2 * step), added(more, scaled(-1, less)))
        rate = algebra.gp(algebra.reverse(exponential(algebra, x)), change)
        error = size(added(rate, scaled(-1, jacobian.dexp(algebra, x, y))))
        assert error < mpmath.mpf(10) ** -35


def test_every_bundled_group_has_both_and_is_measured() -> None:
    names = set()
    for algebra in bundled_algebras():
        for group in read_algebra(bundled_path(algebra)).groups:
            assert group.kernels[:2] == ("dexp", "dexp_inverse")
            names.add(f"{algebra}::{group.name}")
    assert names == {*CLOSED, *OTHERS}


def calls(algebra: str, group: str, name: str) -> dict[str, int]:
    spec = read_algebra(bundled_path(algebra))
    (chosen,) = (g for g in spec.groups if g.name == group)
    (kernel,) = (k for k in group_kernels(spec, chosen) if k.name == name)
    return dict(kernel.program.cost.calls)


@pytest.mark.parametrize(
    ("algebra", "group", "function"),
    [
        ("pga3", "SE3", "dual_rotation"),
        ("cga3", "SE3", "dual_rotation"),
        ("pga3", "SO3", "rotation"),
        ("cl3", "SO3", "rotation"),
        ("pga2", "SE2", "rotation"),
        ("cga2", "SE2", "rotation"),
        ("pga4", "SO4", "rotation"),
        ("sta", "SO13", "complex"),
        ("cga2", "SO31", "complex"),
    ],
)
def test_the_closed_form_that_fits_the_group_is_taken(
    algebra: str, group: str, function: str
) -> None:
    for name in ("dexp", "dexp_inverse"):
        assert f"{name}_{function}" in calls(algebra, group, name)


@pytest.mark.parametrize(
    ("algebra", "group"), [("pga4", "SE4"), ("cga3", "SO41"), ("cga3", "Sim3"), ("cga2", "Sim2")]
)
def test_other_groups_go_by_doubling_and_elimination(algebra: str, group: str) -> None:
    assert "dexp_by_doubling" in calls(algebra, group, "dexp")
    assert "dexp_inverse_by_elimination" in calls(algebra, group, "dexp_inverse")


def test_they_are_emitted_on_request_only() -> None:
    text = starter_spec("foo", (3, 0, 0))
    spec = parse_algebra(text, "foo.toml")
    names = {k.name for k in group_kernels(spec, spec.groups[0])}
    assert "exp" in names
    assert "dexp" not in names
    asked = text.replace('element = "Versor"', 'element = "Versor"\nkernels = ["dexp"]')
    spec = parse_algebra(asked, "foo.toml")
    names = {k.name for k in group_kernels(spec, spec.groups[0])}
    assert "dexp" in names
    assert "dexp_inverse" not in names


@pytest.mark.parametrize(
    ("kernels", "message"),
    [
        ('["dexpinv"]', 'unknown kernel "dexpinv"; those on request are dexp, dexp_inverse'),
        ("[1]", 'unknown kernel "1"'),
        ('["dexp", "dexp"]', '"dexp" is listed twice'),
        ('"dexp"', "must be an array"),
    ],
)
def test_a_wrong_request_is_explained(kernels: str, message: str) -> None:
    text = starter_spec("foo", (3, 0, 0)).replace(
        'element = "Versor"', f'element = "Versor"\nkernels = {kernels}'
    )
    with pytest.raises(UsageError, match=rf"^foo\.toml: group Spin\.kernels: .*{message}"):
        parse_algebra(text, "foo.toml")


def test_more_than_five_dimensions_are_refused() -> None:
    text = starter_spec("foo", (6, 0, 0)).replace(
        'element = "Versor"', 'element = "Versor"\nkernels = ["dexp"]'
    )
    spec = parse_algebra(text, "foo.toml")
    with pytest.raises(UsageError, match="dexp exists in at most 5 dimensions"):
        group_kernels(spec, spec.groups[0])


def test_the_cost_of_se3_is_pinned() -> None:
    index = json.loads((ROOT / "generated/hamotor/pga3/kernels.json").read_text("utf-8"))
    costs = {
        k["name"]: (k["cost"]["mul"], k["cost"]["add"])
        for k in index["kernels"]
        if k["namespace"] == "se3"
    }
    assert (costs["dexp"], costs["dexp_inverse"]) == ((61, 46), (58, 43))


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOSED + OTHERS)
def test_the_quadruple_reference_agrees_with_the_series(name: str) -> None:
    """The inverse too: dexp of it gives the argument back."""
    found = jacobian.disagreement(name, 40)
    assert set(found) == {"dexp", "dexp_inverse"}
    assert found["dexp"] < 1e-29
    assert found["dexp_inverse"] < (1e-29 if name in CLOSED else 1e-20)


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOSED)
def test_rigid_motions_are_within_four_ulp(name: str) -> None:
    for m in jacobian.measurements(4_000, [name]):
        assert m.nan == 0, m
        assert m.max_ulp <= BOUND, m


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_other_groups_lose_no_more_than_the_table_says(name: str) -> None:
    for m in jacobian.measurements(400, [name]):
        assert m.nan == 0, m
        assert m.max_ulp <= LARGEST.get((name, m.function), 10.0), m


LARGEST = {
    ("cga2::SO31", "dexp"): 20.0,
    ("cga2::Sim2", "dexp"): 2e3,
    ("cga2::Sim2", "dexp_inverse"): 2e3,
    ("cga3::Sim3", "dexp"): 2e3,
    ("cga3::Sim3", "dexp_inverse"): 2e4,
    ("cga3::SO41", "dexp_inverse"): 1e8,
}
"""Where dilations by e¹⁰ take more than ten units."""
