"""Ensembles on dask: a real cluster of processes, one of which is killed while it computes."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest
from tests.peers.environment import DASK_PYTHON, INSTALL_DASK, ROOT, has_dask


@pytest.mark.long
@pytest.mark.skipif(not has_dask(), reason=f"dask is not installed: {INSTALL_DASK}")
def test_a_worker_that_is_killed_changes_no_bit(tmp_path: Path) -> None:
    done = subprocess.run(
        [str(DASK_PYTHON), "-m", "tests.generator.dask_answers", str(tmp_path / "run")],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT / "generator")},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout.splitlines()[-1])
    assert 1 <= answer.pop("parts_before") < 6
    assert answer == {
        "same": True,
        "states_differ": 0,
        "killed": 1,
        "left_behind": [],
        "engine": "dask",
        "status": "finished",
        "own_parameters_differ": 0,
    }
