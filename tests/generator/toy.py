"""A simulation small enough to check by hand: see toy_scene.cpp."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from hamotor.run.simulation import Simulation
from hamotor.scene.draws import BodyDraws, Draw, Ensemble

SOURCE = Path(__file__).with_name("toy_scene.cpp").read_text(encoding="utf-8")
RATE = 2.0


def toy_source(**switches: int | str) -> str:
    """The toy's C++ text with some of its switches set: FAIL_AT, OVERFLOW_AT, SLEEP_US, ABI."""
    return "".join(f"#define {name} {value}\n" for name, value in switches.items()) + SOURCE


def toy_state() -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """At x = 1 m, at rest there, spinning about e3 at 2 rad/s: x(t) = cos t, angle 2 t."""
    state = np.zeros(14)
    state[0], state[4], state[10] = 1.0, -0.5, RATE
    return state


def toy(switches: dict[str, int | str] | None = None, **changes: Any) -> Simulation:
    """The toy as a simulation of 10 s in steps of 0.01 s, or as `changes` say."""
    source = toy_source(**(switches or {}))
    settings: dict[str, Any] = {
        "name": "toy",
        "source": lambda _kernels, _scalar: source,
        "state": toy_state(),
        "end": 10.0,
        "step": 0.01,
        "tolerance": None,
        "method": "auto",
        "every": 1,
        "spec_hash": "0123abcd",
    }
    return Simulation(**{**settings, **changes})


RATE_AT, PUSH_AT = 2, 3
"""Where the toy's momentum has the rate about e3 and the linear momentum along x."""


def ensemble_of_toys(
    switches: dict[str, int | str] | None = None, mean: float = 0.0, **changes: Any
) -> Simulation:
    """Toys with a drawn rate (sd 1) and push p from -1 to 1: x(t) = cos t + p sin t."""
    rate = Draw("normal", (mean - RATE,), (1.0,))
    push = Draw("uniform", (-1.0,), (1.0,))
    body = BodyDraws(motor=0, momentum=8, momenta=((RATE_AT, rate), (PUSH_AT, push)))
    draws = Ensemble(seed=3, bodies=(body,), quantiles=(0.25, 0.5))
    return toy(switches, ensemble=draws, **{"end": 0.5, "step": 0.05, "every": 5, **changes})


def interrupts(after: float, number: int = signal.SIGINT) -> threading.Thread:
    """Sends this process a signal so many seconds after a run has begun to heed it; before, it
    would end the tests."""
    unheeded = signal.getsignal(number)

    def interrupt() -> None:
        while signal.getsignal(number) == unheeded:
            time.sleep(0.01)
        time.sleep(after)
        os.kill(os.getpid(), number)

    thread = threading.Thread(target=interrupt, daemon=True)
    thread.start()
    return thread
