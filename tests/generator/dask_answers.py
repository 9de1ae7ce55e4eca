"""Run by the Python that has dask: an ensemble on two worker processes, one of which is killed.

Prints, as JSON, whether the numbers are those of this process, and what became of the workers.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from pathlib import Path

import distributed
import numpy as np
from tests.generator.test_ensemble import BOUNCE, digest
from tests.generator.toy import ensemble_of_toys

from hamotor.run.dataset import PARTS
from hamotor.run.ensemble import PART
from hamotor.run.ensemble_run import EnsembleRun, run_ensemble

MEMBERS = 5 * PART + 17
END = 40.0


def own_parameters_differ(out: Path) -> int:
    """Numbers of states that workers find otherwise than this process, of parameters given."""
    scene = out.with_suffix(".toml")
    scene.write_text(BOUNCE, encoding="utf-8")
    own = {"2.stiffness": np.linspace(20, 80, 2 * PART)}
    here = run_ensemble(scene, parameters=own, seed=3, end=0.05)
    there = run_ensemble(scene, parameters=own, seed=3, end=0.05, engine="dask", out=out)
    return int((np.asarray(there.states) != here.states).sum())


def main(out: Path) -> None:
    """Compute the same ensemble here and there."""
    here = run_ensemble(ensemble_of_toys(), MEMBERS, end=END, every=400, keep=[3, 4 * PART])
    found: list[EnsembleRun] = []
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        before = set(client.run(os.getpid).values())

        def compute() -> None:
            found.append(
                run_ensemble(
                    ensemble_of_toys(),
                    MEMBERS,
                    end=END,
                    every=400,
                    keep=[3, 4 * PART],
                    engine="dask",
                    scheduler=cluster.scheduler_address,
                    out=out,
                )
            )

        thread = threading.Thread(target=compute)
        thread.start()
        while not list(out.glob(f"{PARTS}*/part-*.npz")):
            time.sleep(0.01)
        parts_before = len(list(out.glob(f"{PARTS}*/part-*.npz")))
        os.kill(min(before), signal.SIGKILL)
        thread.join()
        client.wait_for_workers(2, timeout=30)
        after = set(client.run(os.getpid).values())
    (there,) = found
    answer = {
        "same": digest(there) == digest(here),
        "states_differ": int((np.asarray(there.states) != here.states).sum()),
        "killed": len(before - after),
        "parts_before": parts_before,
        "left_behind": [path.name for path in out.glob(f"{PARTS}*")],
        "engine": there.report["ensemble"]["engine"],
        "status": there.status,
        "own_parameters_differ": own_parameters_differ(out.with_name("own")),
    }
    print(json.dumps(answer))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
