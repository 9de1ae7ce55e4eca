"""Our side of the conversation with a peer, which runs in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tests.peers.environment import NODE_MODULES, PYTHON, ROOT

Array = NDArray[np.float64]
"""Coefficients; blade k is the outer product of the basis vectors in the bits of k, ascending."""


class Peer:
    """Another library, asked for one operation at a time."""

    def __init__(self, name: str, command: Sequence[str]) -> None:
        """Start the process."""
        self.name = name
        # clifford compiles for seconds what it then does once
        environment = os.environ | {
            "NUMBA_DISABLE_JIT": "1",
            "HAMOTOR_PEERS_NODE": str(NODE_MODULES),
            "PYTHONPATH": str(ROOT),
        }
        self._process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ask(self, metric: Sequence[Sequence[float]], operation: str, *operands: Any) -> Array:
        """The operation as the peer calls it, on coefficient arrays or numbers.

        metric: Gram matrix of the peer's basis vectors.
        """
        asked = [x.tolist() if isinstance(x, np.ndarray) else x for x in operands]
        question = {"metric": metric, "operation": operation, "operands": asked}
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        print(json.dumps(question), file=stdin, flush=True)
        line = stdout.readline()
        if not line:
            raise AssertionError(f"{self.name} ended: {operation}")
        said = json.loads(line)
        if "error" in said:
            raise AssertionError(f"{self.name}: {operation}: {said['error']}")
        return np.array(said["value"], dtype=np.float64)

    def end(self) -> None:
        """Stop the process."""
        with self._process:
            if self._process.stdin is not None:
                self._process.stdin.close()
            self._process.kill()


def python_peer(name: str) -> Peer:
    """A library of Python."""
    return Peer(name, (str(PYTHON), "-m", f"tests.peers.{name}_answers"))


def node_peer(name: str) -> Peer:
    """A library of JavaScript."""
    return Peer(name, ("node", str(ROOT / "tests" / "peers" / f"{name}_answers.js")))
