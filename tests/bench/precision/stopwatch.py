"""Times contestants in one process: `-m tests.bench.precision.stopwatch JOB` writes rows of JSON.

A contestant is a list of settings from coarse to fine.  Each setting runs once or, if short or
disturbed, three times, until two in a row take longer than the contestant may or one four times as
long; after each that fails and takes so long, one more of the next is left out.  Who asked is told
how each ended, and answers with those that are worth more; then rounds go over these of all
contestants, so that what else runs on the machine disturbs all alike.  Runs in the peers'
environment and needs nothing of Hamotor.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from math import isfinite
from pathlib import Path
from statistics import median
from typing import Any

from tests.bench.precision import peers

_BATCH_S = 3e-4
"""Shorter runs are repeated until they take this long."""
_LARGEST_BATCH = 10
_SHORT_S = 1e-3
_DISTURBED = 1.3
_FAR = 4

Worth = Callable[[], Iterable[tuple[int, int]]]
"""Contestants and settings that are worth more than one run."""


class CompiledScene:
    """A scene's library with one method; settings are {calls, step, its digits, tolerance}.

    A scalar with more digits than a double starts from `digits` and is read in all of them.
    """

    set_up_s = 0.0

    def __init__(self, setting: Mapping[str, Any], said: Mapping[str, Any], loop: str) -> None:
        scene = ctypes.CDLL(said["library"])
        self._functions: dict[str, Any] = {
            name: ctypes.cast(getattr(scene, f"hamotor_{name}"), ctypes.c_void_p)
            for name in ("start", "advance", "observe", "steps", "stop")
        }
        self._wide: WideScene | None = None
        if said["digits"]:
            self._wide = WideScene(scene, f"0 {setting['digits']} {said['digits']}")
            self._functions |= {"start": self._wide.start, "observe": self._wide.observe}
        self._scene = scene
        self._time = ctypes.CDLL(loop).time_runs
        self._time.restype = ctypes.c_int64
        self._setting, self._method = setting, said["method"].encode()
        self._state = (ctypes.c_double * len(said["state"]))(*said["state"])
        self._columns = said["columns"]

    def run(self, repetitions: int) -> peers.Result:
        """Integrate from the start `repetitions` times."""
        seconds, processor = ((ctypes.c_double * repetitions)() for _ in range(2))
        row = (ctypes.c_double * self._columns)()
        steps = ctypes.c_int64()
        calls = int(self._setting["calls"])
        done = self._time(
            *self._functions.values(), self._method, ctypes.c_double(self._setting["step"]),
            ctypes.c_double(self._setting["tolerance"]), self._state, ctypes.c_int64(calls),
            ctypes.c_int64(repetitions), seconds, processor, row, ctypes.byref(steps),
        )  # fmt: skip
        if done < calls:
            raise peers.Refused(f"not finite after {done} of {calls} steps")
        watch = peers.Watch()
        watch.seconds, watch.processor = list(seconds), list(processor)
        final = self._wide.last if self._wide else list(row)
        return peers.Result(watch, final, steps.value, None)


class WideScene:
    """`start` and `observe` by decimals, for a scalar with more digits than a double."""

    def __init__(self, scene: ctypes.CDLL, numbers: str) -> None:
        start, observe = scene.hamotor_start_text, scene.hamotor_observe_text
        start.restype = ctypes.c_void_p
        start.argtypes = [ctypes.c_char_p, ctypes.c_double, ctypes.c_char_p]
        observe.restype = ctypes.c_int64
        observe.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int64]
        self.last: list[str] = []

        def started(method: bytes, _: float, __: float, tolerance: float, ___: int) -> int:
            handle: int = start(method, tolerance, numbers.encode())
            return handle

        def observed(run: int, _: int) -> None:
            text = ctypes.create_string_buffer(observe(run, None, 0) + 1)
            observe(run, text, len(text))
            self.last = text.value.decode().split()

        pointer, number = ctypes.c_void_p, ctypes.c_double
        self.start = ctypes.CFUNCTYPE(pointer, ctypes.c_char_p, number, number, number, pointer)(
            started
        )
        self.observe = ctypes.CFUNCTYPE(None, pointer, pointer)(observed)


class Entry:
    """One setting of one contestant, and what was seen of it."""

    def __init__(self, at: Mapping[str, int], timed: Any) -> None:
        self.at, self.timed = dict(at), timed
        self.seconds: list[float] = []
        self.processor_s = float("inf")
        self.last: peers.Result | None = None

    def run(self) -> None:
        """Once, or in a batch where it is short."""
        known = min(self.seconds, default=_BATCH_S)
        batch = min(max(int(_BATCH_S / max(known, 1e-9)), 1), _LARGEST_BATCH)
        self.last = self.timed.run(batch)
        self.seconds += self.last.seconds
        self.processor_s = min(self.processor_s, *self.last.processor)

    @property
    def needs_s(self) -> float:
        """What it takes, however busy the machine is."""
        return min(*self.seconds, self.processor_s)

    @property
    def was_disturbed(self) -> bool:
        """Whether it had to wait for the processor in every run."""
        return min(self.seconds) > _DISTURBED * self.processor_s

    def row(self) -> dict[str, Any]:
        """What is written of it."""
        assert self.last is not None
        return {
            **self.at,
            "best_s": min(self.seconds),
            "median_s": median(self.seconds),
            "worst_s": max(self.seconds),
            "processor_s": self.processor_s,
            "runs": len(self.seconds),
            "set_up_s": self.timed.set_up_s,
            "final": self.last.state,
            "steps": self.last.steps,
            "evaluations": self.last.evaluations,
        }


def rows(job: Mapping[str, Any], worth: Worth) -> Iterator[dict[str, Any]]:
    """What each setting gave, and what failed; before each, which comes.

    After a first look at each: `{"asks": true}`, and `worth` says which are to be repeated.
    """
    problem = peers.Problem(job["problem"]) if job["problem"] else None
    skipped = dict(job.get("skipped", ()))
    entries = []
    for index, contestant in enumerate(job.get("contestants", ())):
        slow = failed = left_out = 0
        for number, setting in enumerate(contestant["settings"][: skipped.get(index)]):
            if left_out:
                left_out -= 1
                continue
            at = {"index": index, "setting": number}
            yield at
            began = time.perf_counter()
            try:
                entry = Entry(at, _timed(job, contestant, setting, problem))
                entry.run()
                while len(entry.seconds) < 3 and (
                    sum(entry.seconds) < _SHORT_S
                    or (entry.was_disturbed and entry.needs_s < contestant["longest_s"])
                ):
                    entry.run()
            except (peers.Refused, ArithmeticError, ValueError, RuntimeError) as problem_met:
                yield {**at, "failure": str(problem_met)}
                if time.perf_counter() - began > contestant["longest_s"]:
                    failed += 1
                    left_out = failed
                continue
            entries.append(entry)
            slow = slow + 1 if entry.needs_s > contestant["longest_s"] else 0
            if slow == 2 or entry.needs_s > _FAR * contestant["longest_s"]:
                break
    for entry in entries:
        yield entry.row()
    repeated = []
    if job.get("rounds", 0):
        yield {"asks": True}
        chosen = set(worth())
        repeated = [e for e in entries if (e.at["index"], e.at["setting"]) in chosen]
    for number in range(job.get("rounds", 0)):
        yield {"round": number + 1}
        for entry in repeated:
            if len(entry.seconds) < 3 or sum(entry.seconds) < job["enough_s"]:
                yield entry.at
                entry.run()
    for entry in repeated:
        yield entry.row()
    for index, asked in enumerate(job.get("long_runs", ())):
        at = {"index": index, "setting": 0}
        if index not in skipped:
            yield at
            yield {**at, **long_run(asked, job["problem"])}


def long_run(asked: Mapping[str, Any], said: Mapping[str, Any]) -> dict[str, Any]:
    """States of a peer after every so many steps, up to `samples`; fewer steps if it is slow."""
    every = asked["every"]
    began = time.perf_counter()
    states: list[list[float]] = []
    try:
        while not states:
            problem = peers.Problem({**said, "end": every * asked["step"]})
            setting = asked["tolerance"] or every
            timed = peers.MAKERS[asked["kind"]](problem, setting, **asked["options"])
            first = min(timed.run(1).seconds)
            if every > 1 and first * asked["samples"] > asked["longest_s"]:
                every = max(int(every * asked["longest_s"] / (first * asked["samples"])), 1)
                continue
            for _ in range(asked["samples"]):
                problem.state = timed.run(1).state
                if not all(map(isfinite, problem.state)):
                    raise peers.Refused(f"not finite after {len(states) * every:,} steps")
                states.append(problem.state)
    except (peers.Refused, ArithmeticError, ValueError, RuntimeError) as met:
        return {"every": every, "states": states, "failure": str(met)}
    seconds = time.perf_counter() - began
    return {"every": every, "states": states, "seconds": seconds, "failure": None}


def _timed(
    job: Mapping[str, Any],
    contestant: Mapping[str, Any],
    setting: Any,
    problem: peers.Problem | None,
) -> Any:
    if contestant["kind"] == "scene":
        return CompiledScene(setting, contestant, job["loop"])
    return peers.MAKERS[contestant["kind"]](problem, setting, **contestant["options"])


def main() -> None:
    """Read the job and write its rows; or only which peers there are, without a job."""
    if len(sys.argv) < 2:
        found = {name: peers.version(name) for name in peers.PACKAGES}
        print(json.dumps({"python": sys.version.split()[0], **found}))
        return
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    # Some peers greet on the standard output, which is for rows.
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as answers:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        for row in rows(job, _told):
            print(json.dumps(row), file=answers, flush=True)


def _told() -> Iterable[tuple[int, int]]:
    """What a line of the standard input says."""
    return [(index, setting) for index, setting in json.loads(sys.stdin.readline())]


if __name__ == "__main__":
    main()
