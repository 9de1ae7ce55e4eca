"""The trajectory on disk: a folder of Parquet parts, and the folder of a whole run.

`DIR/trajectory/part-00000.parquet`, `part-00001.parquet`, … hold the rows in order of time; each
part is written under another name and renamed, so a reader only ever sees whole parts.  Every
column carries its unit, frame and body as metadata; the schema carries the scene and the
conventions.

A run is written into a staging folder inside DIR and takes the place of an earlier run there only
when it is complete, `run.json` last: the two are never mixed.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hamotor.errors import UsageError
from hamotor.files import whole
from hamotor.run.library import Description, Rows

if TYPE_CHECKING:
    import pyarrow as pa

TRAJECTORY = "trajectory"
CSV = "trajectory.csv"
EVENTS = "events.parquet"
EVENTS_CSV = "events.csv"
REPORT = "run.json"
PICTURES = ("path.png", "conserved.png", "cloud.png")
STATISTICS = "statistics.parquet"
STATISTICS_CSV = "statistics.csv"
FAILURES = "failures.parquet"
STATES = "states"
MEMBERS = "members"
PARTS = ".parts-"
"""Parts of an ensemble that other processes compute lie in folders whose names begin so."""
_CONTENTS = (
    TRAJECTORY, CSV, EVENTS, EVENTS_CSV, STATISTICS, STATISTICS_CSV, FAILURES, STATES, MEMBERS,
)  # fmt: skip

CONVENTION = (
    "SI units. X_world = M X_body M~, dM/dt = M B. Rates and momenta are physical, in the body "
    "frame; generators -1/2 e_i^e_j and -1/2 e0^e_i; bivectors in the order 23, 31, 12. "
    "Positions and spatial momenta are in the world frame, about its origin."
)

_NUMBERS_PER_PART = 1 << 22
_STAGING = ".running-"
_STAGED: set[str] = set()
"""Names of the staging folders that runs of this process use."""


class MemoryRecorder:
    """Keeps every row in memory.  Raises UsageError above `most_bytes`."""

    def __init__(self, most_bytes: int = 1 << 32) -> None:
        self._blocks: list[Rows] = []
        self._bytes = 0
        self._most_bytes = most_bytes

    def append(self, rows: Rows) -> None:
        """Keep a copy of the rows."""
        self._bytes += rows.nbytes
        if self._bytes > self._most_bytes:
            raise UsageError(
                f"the trajectory needs more than {self._most_bytes >> 20} MiB of memory. "
                "Give out=DIR to stream it to disk, or keep fewer rows with every=N."
            )
        self._blocks.append(rows.copy())

    def close(self) -> None:
        """Nothing to close."""

    def discard(self) -> None:
        """Forget every row."""
        self._blocks.clear()
        self._bytes = 0

    def columns(self, description: Description) -> dict[str, NDArray[np.float64]]:
        """Name → values, shape (rows,) each."""
        table = np.concatenate(self._blocks, axis=0)
        return {
            c.name: np.ascontiguousarray(table[:, k]) for k, c in enumerate(description.columns)
        }


class DiskRecorder:
    """Streams rows into `folder/trajectory/`, and `folder/trajectory.csv` if asked.

    At most one part's worth of rows (32 MiB) is held in memory.
    """

    def __init__(self, folder: Path, description: Description, *, csv: bool = False) -> None:
        self.folder = folder
        self._parts = folder / TRAJECTORY
        self._description = description
        self._rows_per_part = max(1, _NUMBERS_PER_PART // len(description.columns))
        self._waiting: list[Rows] = []
        self._rows_waiting = 0
        self._next_part = 0
        self._csv: _CsvFile | None = None
        self._parts.mkdir(parents=True)
        if csv:
            self._csv = _CsvFile(folder / CSV, description)

    def append(self, rows: Rows) -> None:
        """Take a copy of the rows; write a part when there are enough."""
        self._waiting.append(rows.copy())
        self._rows_waiting += len(rows)
        if self._rows_waiting >= self._rows_per_part:
            self._write_part()

    def close(self) -> None:
        """Write what is still waiting."""
        if self._rows_waiting:
            self._write_part()
        if self._csv is not None:
            self._csv.close()
            self._csv = None

    def write_events(self, names: Sequence[str], rows: Rows, *, csv: bool = False) -> None:
        """Write what happened, if anything did: a name and a row each, in order of time."""
        if not names:
            return
        import pyarrow as pa
        import pyarrow.parquet as pq

        table = _arrow_table(rows, self._description).add_column(
            0, pa.field("event", pa.string(), nullable=False), pa.array(names)
        )
        pq.write_table(table, self.folder / EVENTS, compression="zstd")
        if csv:
            file = _CsvFile(self.folder / EVENTS_CSV, self._description, first=("event",))
            file.append(table)
            file.close()

    def discard(self) -> None:
        """Delete what was written."""
        self._waiting.clear()
        self._rows_waiting = 0
        if self._csv is not None:
            self._csv.close()
            self._csv = None
        shutil.rmtree(self.folder)

    def _write_part(self) -> None:
        import pyarrow.parquet as pq

        rows = np.concatenate(self._waiting, axis=0)
        self._waiting.clear()
        self._rows_waiting = 0
        table = _arrow_table(rows, self._description)
        part = self._parts / f"part-{self._next_part:05d}.parquet"
        with whole(part) as unfinished:
            # Doubles of a smooth motion hardly repeat: a dictionary would only cost time.
            pq.write_table(table, unfinished, compression="zstd", use_dictionary=False)
        self._next_part += 1
        if self._csv is not None:
            self._csv.append(table)


class _CsvFile:
    """RFC 4180: names in the first line, lines end with CR LF, numbers round-trip."""

    def __init__(self, path: Path, description: Description, first: Sequence[str] = ()) -> None:
        self._file = path.open("wb")
        names = (*first, *(column.name for column in description.columns))
        header = ",".join(map(_csv_field, names))
        self._file.write(header.encode() + b"\r\n")

    def append(self, table: pa.Table) -> None:
        import pyarrow as pa
        from pyarrow import csv

        text = pa.BufferOutputStream()
        csv.write_csv(table, text, csv.WriteOptions(include_header=False))
        self._file.write(text.getvalue().to_pybytes().replace(b"\n", b"\r\n"))

    def close(self) -> None:
        self._file.close()


def _csv_field(text: str) -> str:
    if any(mark in text for mark in ',"\r\n'):
        return '"' + text.replace('"', '""') + '"'
    return text


def _arrow_table(rows: Rows, description: Description) -> pa.Table:
    import pyarrow as pa

    fields = [
        pa.field(
            column.name,
            pa.float64(),
            nullable=False,
            metadata={"unit": column.unit, "frame": column.frame, "body": column.body},
        )
        for column in description.columns
    ]
    schema = pa.schema(fields, metadata=schema_metadata(description))
    arrays = [pa.array(np.ascontiguousarray(column)) for column in rows.T]
    return pa.Table.from_arrays(arrays, schema=schema)


def schema_metadata(description: Description) -> dict[str, str]:
    return {
        "hamotor.scene": description.scene,
        "hamotor.algebra": description.algebra,
        "hamotor.group": description.group,
        "hamotor.scalar": description.scalar,
        "hamotor.convention": CONVENTION,
        "hamotor.units": json.dumps({c.name: c.unit for c in description.columns}),
        "hamotor.frames": json.dumps({c.name: c.frame for c in description.columns}),
    }


def trajectory_parts(folder: Path) -> list[Path]:
    """The parts of a run's trajectory in order of time.

    `folder` is the run's folder or its `trajectory`.  Raises UsageError when it has no parts.
    """
    inside = folder / TRAJECTORY
    parts = sorted((inside if inside.is_dir() else folder).glob("part-*.parquet"))
    if not parts:
        raise UsageError(f"{folder} holds no trajectory: no {TRAJECTORY}/part-*.parquet there.")
    return parts


def read_trajectory(folder: str | os.PathLike[str]) -> dict[str, NDArray[np.float64]]:
    """The whole trajectory of a run: name → values, shape (rows,), in order of time.

    `folder` is the run's folder or its `trajectory`.  Raises UsageError when it has none.
    """
    blocks = list(_read_parts(trajectory_parts(Path(folder))))
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def read_events(folder: Path) -> dict[str, NDArray[Any]]:
    """What happened in a run: `event`, the names, and the trajectory's columns at those times.

    Empty where nothing did.
    """
    import pyarrow.parquet as pq

    if not (folder / EVENTS).is_file():
        return {}
    table: Any = pq.read_table(folder / EVENTS)
    return {name: table.column(name).to_numpy() for name in table.column_names}


def read_thinned(
    folder: Path, most_rows: int
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """At most `most_rows` rows of a trajectory of any length, and the extremes between them.

    The second dictionary holds, per column, the largest |value − initial value| of the rows that
    each kept row stands for.
    """
    import pyarrow.parquet as pq

    parts = trajectory_parts(folder)
    total = sum(pq.read_metadata(part).num_rows for part in parts)
    return thinned(_read_parts(parts), total, most_rows)


def thinned(
    blocks: Iterable[Mapping[str, NDArray[np.float64]]], total: int, most_rows: int
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """The same of `total` rows that come in blocks."""
    stride = max(1, -(-total // most_rows))
    kept: list[dict[str, NDArray[np.float64]]] = []
    swings: list[dict[str, NDArray[np.float64]]] = []
    initial: dict[str, float] = {}
    for block in blocks:
        initial = initial or {name: float(values[0]) for name, values in block.items()}
        starts = np.arange(0, len(block["t"]), stride)
        # The first row stays the initial state; every other bin is represented by its last row.
        chosen = np.minimum(starts + stride, len(block["t"])) - 1
        if not kept:
            chosen[0] = 0
        kept.append({name: values[chosen] for name, values in block.items()})
        swings.append(
            {
                name: np.maximum.reduceat(np.abs(values - initial[name]), starts)
                for name, values in block.items()
            }
        )
    return _joined(kept), _joined(swings)


def _joined(blocks: list[dict[str, NDArray[np.float64]]]) -> dict[str, NDArray[np.float64]]:
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def _read_parts(parts: list[Path]) -> Iterator[dict[str, NDArray[np.float64]]]:
    import pyarrow.parquet as pq

    for part in parts:
        try:
            table: Any = pq.read_table(part)
        except (OSError, ValueError) as error:
            raise UsageError(f"{part} cannot be read: {str(error).splitlines()[0]}") from None
        yield {name: table.column(name).to_numpy() for name in table.column_names}


class RunFolder:
    """The folder of a run: staged inside, then published as a whole.

    Raises UsageError when `path` exists and is neither empty nor the folder of a hamotor run.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        # A process's number alone is not enough: a container's processes have the same ones again.
        self._staging = self.path / f"{_STAGING}{os.getpid()}-{secrets.token_hex(4)}"
        self._recordings = 0
        self._existed = self.path.exists()
        self._check()

    def _check(self) -> None:
        if not self.path.exists() and not self.path.is_symlink():
            return
        if not self.path.is_dir():
            raise UsageError(f"--out {self.path}: a file of this name exists; name a folder.")
        foreign = sorted(
            entry.name
            for entry in self.path.iterdir()
            if not entry.name.startswith((_STAGING, PARTS))
        )
        if foreign and not is_run(self.path):
            shown = ", ".join(foreign[:3]) + (", …" if len(foreign) > 3 else "")
            raise UsageError(
                f"--out {self.path}: this folder holds something that is not a hamotor run "
                f"({shown}), and a run takes the place of what was there. Name a new folder, an "
                "empty one, or that of an earlier run."
            )

    def new_recorder(self, description: Description, *, csv: bool) -> DiskRecorder:
        """A recorder into a staging folder.  A run may have several and publish one."""
        return DiskRecorder(self.new_staging(), description, csv=csv)

    def new_staging(self) -> Path:
        """A new folder whose files may be published."""
        folder = self._staging / str(self._recordings)
        if not self._recordings:
            self._remove_abandoned()
            _STAGED.add(self._staging.name)
        self._recordings += 1
        try:
            folder.mkdir(parents=True)
        except OSError as problem:
            raise UsageError(f"--out {self.path}: cannot be written: {problem}") from problem
        return folder

    def publish(self, folder: Path, report: str) -> None:
        """Put the files of a staging folder and `run.json` in the place of an earlier run's.

        Files that no run writes are left alone.
        """
        earlier = self._staging / "earlier"
        earlier.mkdir()
        for name in (REPORT, *_CONTENTS, *PICTURES):
            if (self.path / name).exists():
                (self.path / name).rename(earlier / name)
        for name in _CONTENTS:
            if (folder / name).exists():
                (folder / name).rename(self.path / name)
        unfinished = folder / REPORT
        unfinished.write_text(report, encoding="utf-8")
        unfinished.rename(self.path / REPORT)
        self.abandon()

    def abandon(self) -> None:
        """Delete what is staged, and the folder if it was made for this run and stayed empty."""
        shutil.rmtree(self._staging, ignore_errors=True)
        _STAGED.discard(self._staging.name)
        if not self._existed:
            with contextlib.suppress(OSError):
                self.path.rmdir()

    def _remove_abandoned(self) -> None:
        """Delete the staging folders of processes that were killed."""
        for entry in self.path.glob(f"{_STAGING}*"):
            number = entry.name.removeprefix(_STAGING).partition("-")[0]
            if number.isdigit() and entry.name not in _STAGED and not _is_another(int(number)):
                shutil.rmtree(entry, ignore_errors=True)


def is_run(folder: Path) -> bool:
    """Whether a folder holds a hamotor run: a `run.json` with a scene and a provenance."""
    try:
        said = json.loads((folder / REPORT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(said, dict) and {"scene", "provenance", "final"} <= said.keys()


def _is_another(process: int) -> bool:
    """Whether a process of this number runs that is not this one."""
    if process == os.getpid():
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
