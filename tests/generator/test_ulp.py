"""Products: 2 ulp, all others 4, of what their conditioning leaves; some 4 of the result's norm."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from tests.reference import conditioned
from tests.reference.program import processor_can_fuse
from tests.reference.ulp import (
    BOUND,
    SCALARS,
    TABLE,
    Measurement,
    measurements,
    worst_disagreement,
)

INDEX = Path(__file__).resolve().parents[2] / "generated" / "hamotor"
POINTS = {True: 50_000, False: 35_000}


@pytest.mark.slow
@pytest.mark.parametrize("scalar", SCALARS)
def test_the_quadruple_reference_agrees_with_a_hundred_digits(scalar: str) -> None:
    found = worst_disagreement(60, scalar)
    wrong = {name: error for name, error in found.items() if not error < 1e-31}
    assert not wrong
    assert len(found) == 23


@pytest.mark.slow
@pytest.mark.parametrize("fused", [True, False], ids=["fma", "two roundings"])
def test_errors_are_at_most_four_ulp_of_the_norm_and_nothing_is_nan(fused: bool) -> None:
    if fused and not processor_can_fuse():
        pytest.skip("this processor has no fused multiply-add")
    found = measurements(POINTS[fused], fused=fused)
    points: dict[tuple[str, str], int] = {}
    for m in found:
        key = (m.function, m.scalar)
        points[key] = points.get(key, 0) + m.points
    assert min(points.values()) >= 100_000
    assert len(points) == 5 * len(SCALARS)
    wrong = [m for m in found if not m.fits]
    assert not wrong, "\n".join(map(str, wrong))


MEASURED = ("exp", "log", "cayley", "cayley_inverse", "normalize")


def test_every_form_of_a_measured_function_is_in_the_table() -> None:
    first = TABLE.read_text(encoding="utf-8").partition("## Every kernel")[0]
    rows = set(re.findall(r"^\| `(\w+)` \| ([\w ]+) \|", first, re.MULTILINE))
    expected = set()
    for algebra in ("pga2", "pga3"):
        index = json.loads((INDEX / algebra / "kernels.json").read_text(encoding="utf-8"))
        for kernel in index["kernels"]:
            if kernel["name"] in MEASURED:
                (operand,) = kernel["operands"]
                where = kernel["namespace"].upper() or algebra
                if where in ("T2", "T3"):  # translations alone: linear, and in the second table
                    continue
                expected.add((kernel["name"], f"{where} {operand.split('::')[-1]}"))
    assert rows == expected


def test_the_published_errors_are_within_the_bound() -> None:
    first = TABLE.read_text(encoding="utf-8").partition("## Every kernel")[0]
    cells = re.findall(r"\| (\d+\.\d+) \| (\d+\.\d+) (?=\|)", first)
    assert cells
    for largest, median in cells:
        assert float(median) <= float(largest) <= BOUND


def test_a_measurement_fits_only_without_nan_and_within_the_bound() -> None:
    good = Measurement("exp", "pga3 Bivector", "double", 10, 3.5, 0.1, 0, 0.2)
    assert good.fits
    for key, value in (("max_ulp", 4.1), ("max_ulp", float("nan")), ("nan", 1), ("beyond", 1.5)):
        assert not Measurement(**(good.__dict__ | {key: value})).fits


# ---------------------------------------------------------------- every kernel of every algebra


def expect_within_bounds(found: list[conditioned.KernelMeasurement]) -> None:
    """The bound, or what the table says where that is more: the same points, but fewer."""
    published = conditioned.published(TABLE.read_text(encoding="utf-8"))

    def fits(m: conditioned.KernelMeasurement) -> bool:
        if m.fits or not conditioned.excepted(m):
            return m.fits
        largest = 1.01 * published[m.kernel.name, m.algebra, m.scalar]  # of three digits
        return m.max_ulp <= max(m.bound, largest) and m.nan <= m.points / 50

    wrong = [m for m in found if not fits(m)]
    assert not wrong, "\n".join(f"{m.title} {m.scalar}: {m.max_ulp}, {m.nan} nan" for m in wrong)


def test_kernels_of_cl3_are_within_their_condition() -> None:
    found = conditioned.measurements(500, fused=processor_can_fuse(), algebras=["cl3"])
    assert len(found) == len(conditioned.kernels("cl3")) * len(conditioned.SCALARS)
    assert min(m.judged for m in found) >= 300
    expect_within_bounds(found)


@pytest.mark.slow
@pytest.mark.parametrize("algebra", conditioned.ALGEBRAS)
def test_every_kernel_is_within_its_condition(algebra: str) -> None:
    """And the quadruple kernels, which it is held against, satisfy what defines them."""
    found = conditioned.measurements(300, fused=processor_can_fuse(), algebras=[algebra])
    assert len(found) == len(conditioned.kernels(algebra)) * len(conditioned.SCALARS)
    expect_within_bounds(found)
    defects = conditioned.worst_defect(algebra, 8, fused=processor_can_fuse())
    accurate = {name: x for name, x in defects.items() if "_lean " not in name}
    wrong = {name: defect for name, defect in accurate.items() if not defect < 1e-22}
    assert accurate
    assert not wrong


def test_the_second_table_has_a_row_for_every_function_of_every_algebra() -> None:
    second = TABLE.read_text(encoding="utf-8").partition("## Every kernel")[2]
    rows = re.findall(
        r"^\| `(\w+)`( ‡)? \| (\w+) \| (\d+) \| ([\d.e+-]+) \| [\w.+-]+ \| ([\d.e+-]+) \|",
        second,
        re.MULTILINE,
    )
    counted: dict[tuple[str, str], int] = {}
    bounds = {}
    for algebra in conditioned.ALGEBRAS:
        for kernel in conditioned.kernels(algebra):
            key = (kernel.name, algebra)
            counted[key] = counted.get(key, 0) + 1
            bounds[key] = conditioned.bound(kernel)
    assert {(name, algebra): int(n) for name, _, algebra, n, _, _ in rows} == counted
    for name, mark, algebra, _, *errors in rows:
        exceeds = max(map(float, errors)) > bounds[name, algebra]
        assert not exceeds or mark, (name, algebra)
