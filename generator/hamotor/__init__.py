"""Hamotor: Hamiltonian mechanics on rotor groups, as generated C++ that Python can run.

    import hamotor

    run = hamotor.load("dzhanibekov").run(end=10)
    run.t                        # (n,) seconds
    run.motor("handle")          # (n, 8) body to world
    run.rotation("handle")       # (n, 3, 3)
    print(run.summary())

Everything is in SI units.  Motors take the body frame to the world, X_world = M X_body M̃; momenta
are components in the body frame.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hamotor.errors import HamotorError, NumericsError, ToolError, UsageError

if TYPE_CHECKING:
    from hamotor.mechanics import language
    from hamotor.run.comparison import Comparison, compare
    from hamotor.run.dataset import read_trajectory
    from hamotor.run.ensemble_run import (
        EnsembleFailed,
        EnsembleInterrupted,
        EnsembleRun,
        open_ensemble,
        run_ensemble,
    )
    from hamotor.run.result import Run, RunFailed, RunInterrupted, open_run
    from hamotor.run.simulation import Simulation, from_hamiltonian, load
    from hamotor.scene.building import body

__version__ = "0.1.0"

# Loaded on first use: `hamotor list` should not wait for NumPy.
_HOMES = {
    "Comparison": "hamotor.run.comparison",
    "compare": "hamotor.run.comparison",
    "read_trajectory": "hamotor.run.dataset",
    "EnsembleFailed": "hamotor.run.ensemble_run",
    "EnsembleInterrupted": "hamotor.run.ensemble_run",
    "EnsembleRun": "hamotor.run.ensemble_run",
    "open_ensemble": "hamotor.run.ensemble_run",
    "run_ensemble": "hamotor.run.ensemble_run",
    "Run": "hamotor.run.result",
    "RunFailed": "hamotor.run.result",
    "RunInterrupted": "hamotor.run.result",
    "open_run": "hamotor.run.result",
    "Simulation": "hamotor.run.simulation",
    "load": "hamotor.run.simulation",
    "from_hamiltonian": "hamotor.run.simulation",
    "body": "hamotor.scene.building",
}

__all__ = [
    "Comparison",
    "EnsembleFailed",
    "EnsembleInterrupted",
    "EnsembleRun",
    "HamotorError",
    "NumericsError",
    "Run",
    "RunFailed",
    "RunInterrupted",
    "Simulation",
    "ToolError",
    "UsageError",
    "__version__",
    "body",
    "compare",
    "from_hamiltonian",
    "language",
    "load",
    "open_ensemble",
    "open_run",
    "read_trajectory",
    "run_ensemble",
]


def __getattr__(name: str) -> Any:
    if name == "language":
        from hamotor.mechanics import language

        return language
    if name not in _HOMES:
        raise AttributeError(f"module 'hamotor' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
