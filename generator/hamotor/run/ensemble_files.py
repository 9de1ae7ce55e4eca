"""An ensemble on disk: statistics, all members' last states, failures, chosen trajectories.

`statistics.parquet` has a row for each recorded time; `states/part-00000.parquet`, … the members'
last states in their order; `failures.parquet` those that stopped early; `members/7/trajectory/` the
rows of member 7, as a run's.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hamotor.errors import UsageError
from hamotor.run.dataset import (
    FAILURES,
    MEMBERS,
    STATES,
    STATISTICS,
    STATISTICS_CSV,
    DiskRecorder,
    schema_metadata,
)
from hamotor.run.ensemble import Job, Part
from hamotor.run.library import Description, Failure, Rows

REASONS = [reason.name.lower() if reason else "" for reason in Failure]


class EnsembleFiles:
    """Takes parts in order and writes them; holds none."""

    def __init__(self, folder: Path, job: Job, description: Description) -> None:
        self._folder, self._job, self._description = folder, job, description
        self._parts = 0
        self._failures: Any = None

    def append(self, part: Part) -> None:
        """Write what is not summed up: states, failures, chosen trajectories."""
        if self._job.ensemble.final_states:
            self._write_states(part)
        self._write_failures(part)
        for member, rows in part.tally.kept.items():
            recorder = DiskRecorder(self._folder / MEMBERS / str(member), self._description)
            recorder.append(rows)
            recorder.close()

    def close(self) -> None:
        """No more parts will come."""
        if self._failures is not None:
            self._failures.close()

    def write_statistics(self, statistics: Mapping[str, NDArray[Any]], *, csv: bool) -> None:
        """A column for each name: those of the trajectory with `.mean` and so on behind."""
        import pyarrow as pa
        import pyarrow.parquet as pq
        from pyarrow import csv as pyarrow_csv

        units = {f"{c.name}.": c.unit for c in self._description.columns}
        arrays = [pa.array(values) for values in statistics.values()]
        fields = [
            pa.field(name, array.type, metadata={"unit": _unit_of(name, units)})
            for name, array in zip(statistics, arrays, strict=True)
        ]
        schema = pa.schema(fields, metadata=schema_metadata(self._description))
        table = pa.Table.from_arrays(arrays, schema=schema)
        pq.write_table(table, self._folder / STATISTICS, compression="zstd")
        if csv:
            pyarrow_csv.write_csv(table, self._folder / STATISTICS_CSV)

    def _write_states(self, part: Part) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        begun = part.steps >= 0
        columns = [self._description.columns[k] for k in self._description.state_columns()]
        fields = [
            pa.field("member", pa.int64()),
            pa.field("steps", pa.int64()),
            pa.field("failure", pa.dictionary(pa.int32(), pa.string())),
            *(
                pa.field(c.name, pa.float64(), metadata={"unit": c.unit, "frame": c.frame})
                for c in columns
            ),
        ]
        arrays = [
            pa.array(part.first + np.flatnonzero(begun)),
            pa.array(part.steps[begun]),
            pa.DictionaryArray.from_arrays(pa.array(part.reasons[begun]), pa.array(REASONS)),
            *(pa.array(np.ascontiguousarray(x)) for x in part.states[begun].T),
        ]
        schema = pa.schema(fields, metadata=schema_metadata(self._description))
        folder = self._folder / STATES
        folder.mkdir(exist_ok=True)
        name = f"part-{self._parts:05d}.parquet"
        self._parts += 1
        # Random doubles do not compress.
        pq.write_table(
            pa.Table.from_arrays(arrays, schema=schema),
            folder / f".{name}",
            compression="none",
            use_dictionary=["failure"],
        )
        (folder / f".{name}").replace(folder / name)

    def _write_failures(self, part: Part) -> None:
        found = failures_of(part, self._job.step)
        if not len(found["member"]):
            return
        import pyarrow as pa
        import pyarrow.parquet as pq

        table = pa.table(found)
        if self._failures is None:
            self._failures = pq.ParquetWriter(self._folder / FAILURES, table.schema)
        self._failures.write_table(table)


def _unit_of(name: str, units: Mapping[str, str]) -> str:
    """Of the column that a statistic is of."""
    return next((unit for start, unit in units.items() if f"{name}.".startswith(start)), "1")


def failures_of(part: Part, step: float) -> dict[str, NDArray[Any]]:
    """The members of a part that failed: `member`, `t` (s, the last good time), `reason`."""
    failed = np.flatnonzero(part.reasons)
    return {
        "member": part.first + failed,
        "t": step * part.steps[failed] + 0.0,
        "reason": np.array(REASONS)[part.reasons[failed]],
    }


def read_table(path: Path) -> dict[str, NDArray[Any]]:
    """A Parquet file, or a folder of them in order: name → values.  UsageError if there is none."""
    import pyarrow.parquet as pq

    parts = sorted(path.glob("part-*.parquet")) if path.is_dir() else [path]
    if not parts or not parts[0].is_file():
        raise UsageError(f"{path} does not exist: it was not written, or there was nothing to.")
    tables = [pq.read_table(part) for part in parts]
    return {
        name: np.concatenate([table.column(name).to_numpy() for table in tables])
        for name in tables[0].column_names
    }


def states_table(table: Mapping[str, NDArray[Any]]) -> Rows:
    """The state columns of what `states/` holds, shape (members, state_size)."""
    names = [name for name in table if name not in {"member", "steps", "failure"}]
    return np.stack([table[name] for name in names], axis=-1)
