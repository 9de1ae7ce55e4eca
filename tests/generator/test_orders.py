"""Every method has its order on every kind of group, free and forced."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pytest
from tests.reference import orders
from tests.reference.orders import GROUPS, SERIES, TABLE, Observation

from hamotor.scene.methods import METHODS

METHODS_WITH_AN_ORDER = {method.name for method in METHODS if method.order}
"""All but the exact one."""


def expect_orders(found: Sequence[Observation]) -> None:
    assert not [o for o in found if o.miss > 0.1]


def test_observed_orders_are_within_a_tenth_of_the_nominal() -> None:
    found = orders.observed_on("SE(2)", quick=True)
    assert {o.method for o in found} == {"rkmk4", "splitting4", "gauss4"}
    assert len(found) == 6
    expect_orders(found)


def test_the_table_of_orders_has_every_method_within_a_tenth() -> None:
    rows = re.findall(r"\n\| (\w+) \| (\d+) \| (.*) \|", TABLE.read_text(encoding="utf-8"))
    assert {method for method, _, _ in rows} == METHODS_WITH_AN_ORDER
    cells = [(m, int(p), float(x)) for m, p, row in rows for x in row.split("|") if x.strip()]
    assert len(cells) == 2 * 18 * len(GROUPS) + 8 * 6 + 2 * 4 + len(SERIES)
    assert not [cell for cell in cells if abs(cell[2] - cell[1]) > 0.1]


@pytest.mark.long
@pytest.mark.parametrize("group", GROUPS)
def test_every_method_has_its_order_on(group: str) -> None:
    found = orders.observed_on(group)
    assert len(found) == 36
    expect_orders(found)


@pytest.mark.long
def test_methods_for_rigid_bodies_have_their_orders() -> None:
    expect_orders(orders.observed_of_rigid_bodies())


@pytest.mark.long
@pytest.mark.parametrize("group", SERIES)
def test_series_have_their_order_on(group: str) -> None:
    expect_orders([orders.observed_of_series(group)])
