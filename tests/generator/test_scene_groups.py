"""What scenes see of groups is what the algebras' specs say."""

from __future__ import annotations

import pytest

from hamotor.codegen import bundled_algebras
from hamotor.scene.groups import GROUPS, OPEN, bundled_groups, groups_of


def test_rigid_motions_of_space_are_as_the_c_abi_lists_them() -> None:
    group = GROUPS["SE3"]
    assert (group.algebra, group.dimension, group.rotations) == ("pga3", 3, 3)
    assert group.motor == ("s", "e23", "e31", "e12", "e01", "e02", "e03", "e0123")
    assert group.generators == ("e23", "e31", "e12", "e01", "e02", "e03")
    assert group.units == ("kg m^2/s",) * 3 + ("kg m/s",) * 3
    assert group.translates


def test_rotations_about_a_fixed_point_do_not_translate() -> None:
    group = GROUPS["SO3"]
    assert (group.algebra, group.dimension, group.rotations) == ("pga3", 3, 3)
    assert group.motor == ("s", "e23", "e31", "e12")
    assert not group.translates


def test_rigid_motions_of_the_plane_are_as_the_c_abi_lists_them() -> None:
    group = GROUPS["SE2"]
    assert (group.algebra, group.dimension, group.rotations) == ("pga2", 2, 1)
    assert group.motor == ("s", "e12", "e01", "e02")
    assert group.generators == ("e12", "e01", "e02")
    assert group.translates


@pytest.mark.parametrize("algebra", bundled_algebras())
def test_every_bundled_group_can_be_seen(algebra: str) -> None:
    groups = bundled_groups(algebra)
    assert groups
    for group in groups:
        size = len(group.generators)
        assert len(group.lengths) == len(group.units) == size
        assert group.rotations == group.units.count("kg m^2/s") - sum(
            g in ("e0i", "e10", "e20", "e30") for g in group.generators
        )
        assert group.translates == ("kg m/s" in group.units)


def test_conformal_maps_have_dilation_and_special_conformal_momenta_with_their_units() -> None:
    group = next(g for g in bundled_groups("cga3") if g.name == "SO41")
    assert (group.dimension, group.rotations) == (3, 3)
    units = dict(zip(group.generators, group.units, strict=True))
    assert (units["e0i"], units["e01"]) == ("kg m^2/s", "kg m^3/s")


def test_names_are_known_before_any_spec_is_read() -> None:
    assert list(GROUPS) == ["SE3", "SO3", "SE2"]
    assert [g.name for g in groups_of("pga3")] == ["SE3", "SO3"]
    assert all(groups_of(algebra) for algebra in OPEN)
    assert "SE4" not in GROUPS
