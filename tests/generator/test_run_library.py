"""The C ABI seen from Python."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tests.generator.toy import toy, toy_source, toy_state

from hamotor.errors import ToolError, UsageError
from hamotor.run.build import compile_scene
from hamotor.run.library import SceneLibrary, describe


@pytest.fixture(scope="module")
def library() -> SceneLibrary:
    return toy().compile().library


def test_a_scene_describes_itself(library: SceneLibrary) -> None:
    said = library.description
    assert said.bodies == ("bob",)
    assert said.methods == {"splitting2": 2, "euler": 1}
    assert said.state_size == 14
    assert [said.columns[k].name for k in said.state_columns()][:2] == [
        "bob.motor.s",
        "bob.motor.e23",
    ]
    assert [said.columns[k].unit for k in said.position_columns("bob")] == ["m"] * 3


def test_the_state_put_in_comes_back(library: SceneLibrary) -> None:
    with library.start("splitting2", step=0.1, state=toy_state()) as live:
        np.testing.assert_allclose(live.state(), toy_state(), atol=1e-16)


def test_rows_come_after_every_multiple_of_every_counted_from_the_start(
    library: SceneLibrary,
) -> None:
    rows = np.full((3, len(library.description.columns)), np.nan)
    with library.start("splitting2", step=0.5, state=toy_state()) as live:
        assert live.advance(2, 3, rows) == 2
        assert np.isnan(rows).all()
        assert live.advance(5, 3, rows) == 5
        np.testing.assert_array_equal(rows[:, 0], [1.5, 3.0, np.nan])
        assert live.observe()[0] == 3.5


def test_no_rows_are_written_where_none_are_wanted(library: SceneLibrary) -> None:
    with library.start("splitting2", step=0.5, state=toy_state()) as live:
        assert live.advance(7, 1, None) == 7
        assert live.drift() == pytest.approx((1e-16, 7e-16))


def test_stopping_twice_is_harmless(library: SceneLibrary) -> None:
    live = library.start("splitting2", step=0.5, state=toy_state())
    live.stop()
    live.stop()


def test_an_unknown_method_is_a_usage_error_with_a_suggestion(library: SceneLibrary) -> None:
    with pytest.raises(UsageError, match=r'offers euler, splitting2. Did you mean "splitting2"'):
        library.start("splitting", step=0.1, state=toy_state())


def test_a_state_of_the_wrong_shape_is_refused(library: SceneLibrary) -> None:
    with pytest.raises(ToolError, match=r"\(13,\).*\(14,\)"):
        library.start("splitting2", step=0.1, state=toy_state()[:-1])


def test_another_version_of_the_abi_is_refused() -> None:
    compiled = compile_scene(toy_source(ABI='"1"'))
    with pytest.raises(ToolError, match="version 1 of the C ABI"):
        SceneLibrary(compiled.library)


def test_a_library_that_is_no_scene_is_refused() -> None:
    compiled = compile_scene("int answer() { return 42; }\n")
    with pytest.raises(ToolError, match="not a compiled scene"):
        SceneLibrary(compiled.library)


def test_a_file_that_is_no_library_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.so").write_bytes(b"not a library")
    with pytest.raises(ToolError, match="cannot load"):
        SceneLibrary(tmp_path / "scene.so")


@pytest.mark.parametrize("missing", ["columns", "bodies", "methods", "conserved"])
def test_a_description_with_something_missing_is_refused(
    library: SceneLibrary, missing: str
) -> None:
    said = json.loads(library._c.hamotor_describe())
    del said[missing]
    with pytest.raises(ToolError, match=missing):
        describe(json.dumps(said))


def test_a_conserved_quantity_without_its_column_is_refused(library: SceneLibrary) -> None:
    said = json.loads(library._c.hamotor_describe())
    said["conserved"][0]["column"] = "nowhere"
    with pytest.raises(ToolError, match="nowhere"):
        describe(json.dumps(said))
