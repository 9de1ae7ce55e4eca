"""How many operations a method's steps take: a run with numbers that count what is done with them.

`hamotor/counted.hpp` is that scalar.  What the compiler folds is not counted, a multiply-add is a
product and an addition, and every lane of packed code counts as what it stands for.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from hamotor.run.library import Failure, SceneLibrary

KINDS: Final = ("additions", "products", "quotients", "roots", "functions")
_STEPS: Final = 200
_TRIES: Final = 1000
"""Steps that are counted, of methods that choose them tries."""


@dataclass(frozen=True)
class Work:
    """What a whole run takes."""

    evaluations: int
    operations: int
    per_step: Mapping[str, float]


def work_of(
    library: SceneLibrary, method: str, state: Any, setting: Mapping[str, float], steps: int
) -> Work | None:
    """The work of `steps` steps, from the first ones; None where they fail.

    A method that chooses its steps does so within as many calls as `setting` says, and what it
    rejects is counted with what it takes.
    """
    counts_of = ctypes.CDLL(str(library.path)).hamotor_counts
    counts = (ctypes.c_int64 * (len(KINDS) + 1))()
    controlled = setting["tolerance"] > 0
    calls = int(setting["calls"]) if controlled else min(int(setting["calls"]), _STEPS)
    with library.start(
        method, step=setting["step"], state=state, tolerance=setting["tolerance"] or None
    ) as live:
        live.set_patience(_TRIES)
        counts_of(counts)
        live.advance(calls, 0, None)
        taken = live.steps()
        counts_of(counts)
        failed = live.failure()[0] is not Failure.NONE
    if failed or not taken:
        return None
    *operations, evaluations = (count / taken for count in counts)
    return Work(
        evaluations=round(evaluations * steps),
        operations=round(sum(operations) * steps),
        per_step=dict(zip(KINDS, operations, strict=True)),
    )
