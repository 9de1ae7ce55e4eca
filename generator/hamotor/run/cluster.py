"""Parts of an ensemble on the workers of a dask scheduler, on this machine or others.

A part is a file: a worker writes it under another name and renames it, so that a file that is there
is whole, whoever wrote it.  A part that is there is not computed again: neither after a worker died
and dask gave its task to another one, nor when the same command runs once more.  The folder's name
holds the key of all that decides the numbers.
"""

from __future__ import annotations

import json
import logging
import secrets
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from hamotor.errors import HamotorError, ToolError, UsageError
from hamotor.files import whole
from hamotor.run.build import REPOSITORY
from hamotor.run.dataset import PARTS
from hamotor.run.ensemble import OWN, Job, Meter, Part, library_of, run_part
from hamotor.run.library import SceneLibrary

REQUIREMENTS = REPOSITORY / "requirements-dask.lock"
_RETRIES = 3
_POLL_S = 0.05
_JOB = "job.json"


def run_parts_on(
    job: Job,
    folder: Path | None,
    scheduler: str | None,
    workers: int,
    meter: Meter,
    tick: Callable[[], None],
) -> Generator[Part, None, None]:
    """The parts in order, computed by the workers of the scheduler at an address.

    None: `workers` processes of this machine.  `folder` is where parts lie until all are there; a
    scheduler's workers must see it under the same name.  ToolError where dask is not installed, or
    workers cannot do it.
    """
    if scheduler == "":
        raise UsageError("the scheduler's address is empty.")
    if scheduler is not None and folder is None:
        raise UsageError("a scheduler needs out: a folder that all its workers see.")
    distributed = _distributed()
    with ExitStack() as stack:
        if folder is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        parts = (folder / f"{PARTS}{job.key[:32]}").resolve()
        _write_job(parts, job)
        address: Any = scheduler
        if scheduler is None:
            with _deaf_to_interrupts():
                address = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=min(workers, job.parts),
                        threads_per_worker=1,
                        processes=True,
                        dashboard_address=":0",
                        silence_logs=logging.CRITICAL,
                    )
                )
        try:
            client = stack.enter_context(distributed.Client(address, set_as_default=False))
        except (OSError, ValueError) as problem:
            raise ToolError(f"no dask scheduler answers at {scheduler}: {problem}") from problem
        # Of this call alone: the same job into another folder has tasks of its own.
        call = secrets.token_hex(8)
        futures = {
            number: client.submit(
                compute_part,
                str(parts),
                number,
                key=f"hamotor-{call}-{number}",
                priority=-number,
                retries=_RETRIES,
            )
            for number in range(job.parts)
        }
        for number in range(job.parts):
            future = futures.pop(number)
            while not future.done() and not meter.stopped:
                tick()
                time.sleep(_POLL_S)
            if not future.done():
                client.cancel([future, *futures.values()])
                return
            _require_done(future, distributed)
            part = _read(parts, number)
            meter.add(part.tally.member_steps, part.tally.stepping_s)
            tick()
            yield part
    shutil.rmtree(parts, ignore_errors=True)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Processes that start meanwhile leave a Ctrl-C to this one, which then stops them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    earlier = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, earlier)


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise ToolError(
            "--engine dask needs dask.distributed, which is not installed. Install it:\n"
            f"  {sys.executable} -m pip install --require-hashes -r {REQUIREMENTS}"
        ) from None
    return distributed


def _require_done(future: Any, distributed: Any) -> None:
    """ToolError with what went wrong, unless the worker is done."""
    try:
        future.result()
    except HamotorError:
        raise
    except CancelledError as problem:
        raise ToolError(
            f"the dask scheduler was lost: {problem} The same command goes on with the parts that "
            "are there."
        ) from problem
    except distributed.KilledWorker as problem:
        raise ToolError(f"several workers died over the same part: {problem}") from problem
    except (ImportError, AttributeError) as problem:
        raise ToolError(
            f"the workers cannot import hamotor ({problem}); start them with "
            f"PYTHONPATH={REPOSITORY / 'generator'}, in an environment like this one."
        ) from problem
    except OSError as problem:
        raise ToolError(f"a worker failed: {problem}") from problem


def _write_job(parts: Path, job: Job) -> None:
    try:
        parts.mkdir(parents=True, exist_ok=True)
        for name in OWN:
            if (own := getattr(job, name)) is not None:
                with whole(parts / f"{name}.npy") as unfinished, unfinished.open("wb") as file:
                    np.save(file, own)
        with whole(parts / _JOB) as unfinished:
            unfinished.write_text(json.dumps(job.to_json()), encoding="utf-8")
    except OSError as problem:
        raise UsageError(f"--out {parts.parent}: cannot be written: {problem}") from problem


def compute_part(folder: str, number: int) -> None:
    """On a worker: write a part into the folder, unless it is there."""
    path = _path(Path(folder), number)
    if path.is_file():
        return
    job, library = _job(folder)
    part = run_part(library, job, number)
    with whole(path) as unfinished, unfinished.open("wb") as file:
        np.savez(file, **part.to_arrays())


@cache
def _job(folder: str) -> tuple[Job, SceneLibrary]:
    parts = Path(folder)
    own = {
        name: np.load(parts / f"{name}.npy", mmap_mode="r")
        for name in OWN
        if (parts / f"{name}.npy").is_file()
    }
    job = Job.from_json(json.loads((parts / _JOB).read_text(encoding="utf-8")), own)
    return job, library_of(job)


def _path(parts: Path, number: int) -> Path:
    return parts / f"part-{number:05d}.npz"


def _read(parts: Path, number: int) -> Part:
    path = _path(parts, number)
    try:
        with np.load(path) as arrays:
            return Part.from_arrays(dict(arrays))
    except (OSError, ValueError, KeyError, BadZipFile) as problem:
        raise ToolError(
            f"{path} cannot be read ({problem}). If it is there, delete it; if not, the workers "
            "do not see this folder under this name: --out must be shared with them."
        ) from problem
