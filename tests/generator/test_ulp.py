"""exp, log, Cayley's maps and normalize: 4 ulp of the result's norm, and never a NaN."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from tests.reference.ulp import (
    BOUND,
    SCALARS,
    TABLE,
    Measurement,
    measurements,
    processor_can_fuse,
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
    rows = set(
        re.findall(r"^\| `(\w+)` \| ([\w ]+) \|", TABLE.read_text(encoding="utf-8"), re.MULTILINE)
    )
    expected = set()
    for algebra in ("pga2", "pga3"):
        index = json.loads((INDEX / algebra / "kernels.json").read_text(encoding="utf-8"))
        for kernel in index["kernels"]:
            if kernel["name"] in MEASURED:
                (operand,) = kernel["operands"]
                where = kernel["namespace"].upper() or algebra
                expected.add((kernel["name"], f"{where} {operand.split('::')[-1]}"))
    assert rows == expected


def test_the_published_errors_are_within_the_bound() -> None:
    cells = re.findall(r"\| (\d+\.\d+) \| (\d+\.\d+) (?=\|)", TABLE.read_text(encoding="utf-8"))
    assert cells
    for largest, median in cells:
        assert float(median) <= float(largest) <= BOUND


def test_a_measurement_fits_only_without_nan_and_within_the_bound() -> None:
    good = Measurement("exp", "pga3 Bivector", "double", 10, 3.5, 0.1, 0, 0.2)
    assert good.fits
    for key, value in (("max_ulp", 4.1), ("max_ulp", float("nan")), ("nan", 1), ("beyond", 1.5)):
        assert not Measurement(**(good.__dict__ | {key: value})).fits
