"""What packs of lanes compute is as accurate as the table says."""

from __future__ import annotations

import re

import pytest
from tests.reference import packs
from tests.reference.packs import BOUND, BOUNDS, TABLE


@pytest.mark.slow
def test_functions_of_packs_keep_their_bounds() -> None:
    found = packs.measurements(4_000)
    assert {m.scalar for m in found} == {"double", "float"}
    for m in found:
        assert m.max_ulp <= m.bound, m


@pytest.mark.slow
def test_the_quadruple_reference_agrees_with_fifty_digits() -> None:
    assert packs.disagreement(24) < 1e-32


def test_the_table_lists_every_function_within_its_bound() -> None:
    rows = re.findall(
        r"^\| ([^|]+) \| ([\d.]+) \| ([\d.]+) \|", TABLE.read_text("utf-8"), re.MULTILINE
    )
    assert {name for name, *_ in rows} == {*packs.EXACT, "atan2"}
    for name, *errors in rows:
        for scalar, error in zip(("double", "float"), errors, strict=True):
            assert float(error) <= BOUNDS.get((name, scalar), BOUND)
