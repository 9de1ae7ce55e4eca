"""The trajectory on disk, and the folder of a run."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from tests.generator.toy import toy

from hamotor import open_run, read_trajectory
from hamotor.errors import UsageError
from hamotor.run import dataset
from hamotor.run.dataset import DiskRecorder, MemoryRecorder, RunFolder, read_thinned

DESCRIPTION = toy().compile().description


def rows(first: int, count: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Rows whose every number says which row and column it is."""
    columns = len(DESCRIPTION.columns)
    return np.add.outer(np.arange(first, first + count), np.arange(columns) / 100.0)


def test_rows_come_back_in_order_from_several_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dataset, "_NUMBERS_PER_PART", 10 * len(DESCRIPTION.columns))
    recorder = DiskRecorder(tmp_path, DESCRIPTION)
    for first in range(0, 35, 5):
        recorder.append(rows(first, 5))
    recorder.close()
    names = sorted(p.name for p in (tmp_path / "trajectory").iterdir())
    assert names == [f"part-{k:05d}.parquet" for k in range(4)]
    table = read_trajectory(tmp_path)
    np.testing.assert_array_equal(np.stack(list(table.values()), -1), rows(0, 35))
    np.testing.assert_array_equal(read_trajectory(tmp_path / "trajectory")["t"], np.arange(35.0))


def test_rows_are_copied_so_that_the_caller_may_reuse_its_array(tmp_path: Path) -> None:
    buffer = rows(0, 3)
    recorder = DiskRecorder(tmp_path, DESCRIPTION)
    recorder.append(buffer)
    buffer[:] = np.nan
    recorder.close()
    np.testing.assert_array_equal(read_trajectory(tmp_path)["t"], [0, 1, 2])


def test_parts_written_before_a_crash_are_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dataset, "_NUMBERS_PER_PART", 10 * len(DESCRIPTION.columns))
    recorder = DiskRecorder(tmp_path, DESCRIPTION)
    recorder.append(rows(0, 10))
    recorder.append(rows(10, 7))
    np.testing.assert_array_equal(read_trajectory(tmp_path)["t"], np.arange(10.0))


def test_every_column_tells_its_unit_and_frame(tmp_path: Path) -> None:
    toy().run(out=tmp_path / "run", pictures=False)
    schema = pq.read_schema(tmp_path / "run" / "trajectory" / "part-00000.parquet")
    assert schema.names[0] == "t"
    assert schema.field("bob.momentum.e12").metadata == {
        b"unit": b"kg m^2/s",
        b"frame": b"body",
        b"body": b"bob",
    }
    assert schema.metadata[b"hamotor.scene"] == b"toy"
    assert b"X_world = M X_body M~" in schema.metadata[b"hamotor.convention"]
    assert json.loads(schema.metadata[b"hamotor.units"])["t"] == "s"


def test_csv_is_rfc_4180_and_gives_the_same_doubles(tmp_path: Path) -> None:
    run = toy().run(end=1.0, out=tmp_path / "run", csv=True, pictures=False)
    content = (tmp_path / "run" / "trajectory.csv").read_bytes()
    assert content.count(b"\r\n") == content.count(b"\n") == 102
    with (tmp_path / "run" / "trajectory.csv").open(newline="") as file:
        lines = list(csv.reader(file, strict=True))
    assert lines[0] == list(run.trajectory)
    read = np.array(lines[1:], dtype=np.float64)
    np.testing.assert_array_equal(read, np.stack(list(run.trajectory.values()), -1))


def test_csv_goes_with_a_folder() -> None:
    with pytest.raises(UsageError, match="csv needs out"):
        toy().run(csv=True)


def test_the_same_trajectory_in_memory_and_on_disk(tmp_path: Path) -> None:
    on_disk, in_memory = toy().run(out=tmp_path / "run", pictures=False), toy().run()
    assert list(on_disk.trajectory) == list(in_memory.trajectory)
    for name, values in in_memory.trajectory.items():
        np.testing.assert_array_equal(on_disk.trajectory[name], values)


def test_a_trajectory_too_large_for_memory_is_refused_with_what_to_do() -> None:
    recorder = MemoryRecorder(most_bytes=1000)
    with pytest.raises(UsageError, match=r"out=DIR.*every=N"):
        recorder.append(rows(0, 100))


def test_without_out_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    toy().compile()
    monkeypatch.chdir(tmp_path)
    toy().run()
    assert not list(tmp_path.iterdir())


def test_thinning_keeps_the_ends_and_the_extremes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dataset, "_NUMBERS_PER_PART", 100 * len(DESCRIPTION.columns))
    recorder = DiskRecorder(tmp_path, DESCRIPTION)
    table = rows(0, 1003)
    table[517, 5] = 1e6
    recorder.append(table[:600])
    recorder.append(table[600:])
    recorder.close()
    kept, swings = read_thinned(tmp_path, 50)
    assert len(kept["t"]) <= 60
    assert (kept["t"][0], kept["t"][-1]) == (0, 1002)
    name = DESCRIPTION.columns[5].name
    assert swings[name].max() == 1e6 - table[0, 5]
    assert swings["t"].max() == 1002


def test_thinning_a_short_trajectory_keeps_every_row(tmp_path: Path) -> None:
    recorder = DiskRecorder(tmp_path, DESCRIPTION)
    recorder.append(rows(0, 20))
    recorder.close()
    kept, swings = read_thinned(tmp_path, 50)
    np.testing.assert_array_equal(kept["t"], np.arange(20.0))
    np.testing.assert_array_equal(swings["t"], np.arange(20.0))


def test_a_second_run_takes_the_place_of_the_first(tmp_path: Path) -> None:
    out = tmp_path / "run"
    toy().run(out=out, csv=True)
    assert {p.name for p in out.iterdir()} == {
        "run.json",
        "trajectory",
        "trajectory.csv",
        "path.png",
        "conserved.png",
    }
    toy().run(end=1.0, out=out, pictures=False)
    assert {p.name for p in out.iterdir()} == {"run.json", "trajectory"}
    assert open_run(out).t[-1] == pytest.approx(1.0)


def test_files_that_no_run_writes_are_left_alone(tmp_path: Path) -> None:
    out = tmp_path / "run"
    toy().run(out=out, pictures=False)
    (out / "notes.txt").write_text("mine")
    toy().run(out=out, pictures=False)
    assert (out / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("name", ["thesis.tex", "run.json"])
def test_a_folder_that_holds_something_else_is_refused_untouched(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text('{"mine": true}')
    with pytest.raises(UsageError, match=f"not a hamotor run.*{name}"):
        toy().run(out=tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == '{"mine": true}'


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("a file")
    with pytest.raises(UsageError, match="a file of this name exists"):
        toy().run(out=tmp_path / "run")


def test_a_folder_that_cannot_be_made_is_a_usage_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot be written"):
        toy().run(out=tmp_path / "file" / "run")


def test_a_run_that_cannot_start_leaves_the_earlier_one(tmp_path: Path) -> None:
    out = tmp_path / "run"
    toy().run(out=out, pictures=False)
    before = (out / "run.json").read_bytes()
    with pytest.raises(UsageError):
        toy().run(out=out, method="eular")
    with pytest.raises(UsageError):
        toy().run(out=out, step=-1.0)
    assert (out / "run.json").read_bytes() == before
    assert {p.name for p in out.iterdir()} == {"run.json", "trajectory"}


def test_a_run_that_cannot_start_makes_no_folder(tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        toy().run(out=tmp_path / "new", method="eular")
    assert not (tmp_path / "new").exists()


def test_what_a_killed_run_left_behind_is_cleared_by_the_next(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    left = tmp_path / f".running-{ended.pid}-1f"
    (left / "0").mkdir(parents=True)
    # A container's process may have had the number that this one has.
    same = tmp_path / f".running-{os.getpid()}"
    (same / "0").mkdir(parents=True)
    alive = tmp_path / f".running-{os.getppid()}-1f"
    alive.mkdir()
    recorder = RunFolder(tmp_path).new_recorder(DESCRIPTION, csv=False)
    recorder.close()
    assert not left.exists()
    assert not same.exists()
    assert alive.exists()


def test_runs_of_one_process_into_one_folder_leave_each_other_alone(tmp_path: Path) -> None:
    first, second = RunFolder(tmp_path), RunFolder(tmp_path)
    staged = first.new_staging()
    (staged / "statistics.parquet").write_text("first")
    second.new_staging()
    second.abandon()
    first.publish(staged, "{}")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.json", "statistics.parquet"]


def test_a_folder_without_a_run_is_not_opened(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="holds no hamotor run"):
        open_run(tmp_path)
    with pytest.raises(UsageError, match="holds no trajectory"):
        read_trajectory(tmp_path)
