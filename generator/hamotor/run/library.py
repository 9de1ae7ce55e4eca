"""The compiled scene seen from Python: its C ABI, version 2, bound with ctypes.

ARCHITECTURE.md states the ABI.  States and rows are contiguous float64 arrays; for scalars with
more digits than a double a run starts from decimals, and a row can be had as such.
"""

from __future__ import annotations

import ctypes
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from enum import IntEnum
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hamotor.errors import ToolError, UsageError, suggest
from hamotor.run.attitude import AXES

ABI_VERSION = 2

Vector = NDArray[np.float64]
Rows = NDArray[np.float64]
Exact = tuple[Fraction, ...]
"""Numbers with all digits of a wide scalar."""


class Failure(IntEnum):
    """Why a run could not go on."""

    NONE = 0
    NOT_FINITE = 1
    NO_CONVERGENCE = 2
    STEP_TOO_SHORT = 3
    LEFT_GROUP = 4


@dataclass(frozen=True)
class Column:
    """One column of the trajectory.  `unit` is "1" for a pure number; `body` "" for the scene."""

    name: str
    unit: str
    frame: str
    body: str


@dataclass(frozen=True)
class Conserved:
    """A quantity that must stay constant.

    Its relative error is taken over the Euclidean norm of the columns in `norm` at the start, or
    over `scale` where there are none; a scale of 0 says that the quantity has none.
    """

    name: str
    column: str
    norm: tuple[str, ...] = ()
    scale: float = 0.0
    description: str = ""


@dataclass(frozen=True)
class Event:
    """A function of the state whose zeros a run finds; `stops` says whether it ends there."""

    name: str
    direction: str
    stops: bool


@dataclass(frozen=True)
class EnsembleDescription:
    """How a library steps many members: so many lanes at once, by these instructions."""

    lanes: int
    isa: str
    parameters: tuple[str, ...]
    """What members can have values of their own of."""


@dataclass(frozen=True)
class Description:
    """What `hamotor_describe` says about a compiled scene."""

    scene: str
    algebra: str
    group: str
    scalar: str
    digits: int
    kernels: str
    compiler: str
    fma: bool
    bodies: tuple[str, ...]
    methods: Mapping[str, int]
    error_controlled: frozenset[str]
    """Methods that can choose their steps by a local tolerance."""
    compensated: Mapping[str, bool | None]
    """Whether a method's sums over steps are compensated; None where it has none."""
    motor: tuple[str, ...]
    momentum: tuple[str, ...]
    columns: tuple[Column, ...]
    conserved: tuple[Conserved, ...]
    events: tuple[Event, ...]
    ensemble: EnsembleDescription | None = None
    """None where the library was not compiled for ensembles."""

    @property
    def is_wide(self) -> bool:
        """Whether the scalar has more digits than a double."""
        return self.scalar not in {"double", "float"}

    @cached_property
    def column_index(self) -> dict[str, int]:
        """Where each column stands in a row."""
        return {column.name: index for index, column in enumerate(self.columns)}

    @property
    def state_size(self) -> int:
        """Numbers in a state: per body the motor's components, then the momentum's."""
        return len(self.bodies) * (len(self.motor) + len(self.momentum))

    def state_columns(self) -> list[int]:
        """The columns that together are the state, in the state's order."""
        index = self.column_index
        return [
            index[f"{body}.{part}.{name}"]
            for body in self.bodies
            for part, names in (("motor", self.motor), ("momentum", self.momentum))
            for name in names
        ]

    def position_columns(self, body: str) -> list[int]:
        """The columns of a body's position: x, y, in space z, and w in four dimensions."""
        return self._present(f"{body}.position.{axis}" for axis in AXES)

    def _present(self, names: Any) -> list[int]:
        index = self.column_index
        return [index[name] for name in names if name in index]


def describe(text: str) -> Description:
    """Read the JSON of `hamotor_describe`.  Raises ToolError when it is not what ABI 2 promises."""
    try:
        said = json.loads(text)
        if said["abi"] != ABI_VERSION:
            raise ToolError(
                f"the compiled scene speaks version {said['abi']} of the C ABI, "
                f"this hamotor version {ABI_VERSION}. Build both from the same checkout."
            )
        columns = tuple(
            Column(c["name"], c.get("unit", "1"), c.get("frame", ""), c.get("body", ""))
            for c in said["columns"]
        )
        description = Description(
            scene=said["scene"],
            algebra=said["algebra"],
            group=said["group"],
            scalar=said["scalar"],
            digits=int(said["digits"]),
            kernels=said["kernels"],
            compiler=said["compiler"],
            fma=bool(said["fma"]),
            bodies=tuple(said["bodies"]),
            methods={m["name"]: int(m["order"]) for m in said["methods"]},
            error_controlled=frozenset(m["name"] for m in said["methods"] if m["error_controlled"]),
            compensated={m["name"]: m.get("compensated") for m in said["methods"]},
            motor=tuple(said["motor"]),
            momentum=tuple(said["momentum"]),
            columns=columns,
            conserved=tuple(
                Conserved(
                    name=c["name"],
                    column=c["column"],
                    norm=tuple(c.get("norm", ())),
                    scale=float(c.get("scale", 0.0)),
                    description=c.get("description", ""),
                )
                for c in said["conserved"]
            ),
            events=tuple(
                Event(e["name"], e["direction"], bool(e["stops"])) for e in said["events"]
            ),
            ensemble=EnsembleDescription(int(many["lanes"]), many["isa"], tuple(many["parameters"]))
            if (many := said.get("ensemble"))
            else None,
        )
        description.state_columns()
        for quantity in description.conserved:
            for name in (quantity.column, *quantity.norm):
                description.column_index[name]
    except (ValueError, KeyError, TypeError) as problem:
        raise ToolError(f"the compiled scene describes itself wrongly: {problem!r}") from problem
    return description


class SceneLibrary:
    """A loaded scene.  `description` says what it holds; `start` begins a run.

    Raises ToolError when the file cannot be loaded or does not speak this ABI.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._c = ctypes.CDLL(str(path.resolve()))
            self._bind_runs()
        except OSError as problem:
            raise ToolError(f"cannot load the compiled scene: {problem}") from problem
        except AttributeError as problem:
            raise ToolError(
                f"{path} is not a compiled scene: {problem}. Delete it and run again."
            ) from problem
        said = self._c.hamotor_describe()
        self.description = describe(said.decode("utf-8") if said else "")
        if self.description.ensemble is not None:
            self._bind_ensembles()

    def _bind_runs(self) -> None:
        numbers = ctypes.POINTER(ctypes.c_double)
        run = ctypes.c_void_p
        whole = ctypes.c_int64
        number = ctypes.c_double
        signatures: dict[str, tuple[Any, list[Any]]] = {
            "hamotor_describe": (ctypes.c_char_p, []),
            "hamotor_start": (run, [ctypes.c_char_p, number, number, number, numbers]),
            "hamotor_advance": (whole, [run, whole, whole, numbers]),
            "hamotor_set_patience": (None, [run, whole]),
            "hamotor_observe": (None, [run, numbers]),
            "hamotor_start_text": (run, [ctypes.c_char_p, number, ctypes.c_char_p]),
            "hamotor_observe_text": (whole, [run, ctypes.c_char_p, whole]),
            "hamotor_observe_at": (ctypes.c_int32, [run, number, numbers]),
            "hamotor_observe_event": (ctypes.c_int32, [run, whole, numbers]),
            "hamotor_state": (None, [run, numbers]),
            "hamotor_drift": (None, [run, numbers]),
            "hamotor_steps": (whole, [run]),
            "hamotor_failure": (ctypes.c_int32, [run, ctypes.POINTER(whole)]),
            "hamotor_stop": (None, [run]),
        }
        self._bind(signatures)

    def _bind_ensembles(self) -> None:
        numbers, run, whole = ctypes.POINTER(ctypes.c_double), ctypes.c_void_p, ctypes.c_int64
        name, number, count = ctypes.c_char_p, ctypes.c_double, ctypes.c_int32
        start = [name, number, number, number, whole, numbers, numbers, count, count]
        self._bind(
            {
                "hamotor_ensemble_start": (run, start),
                "hamotor_ensemble_advance": (whole, [run, whole]),
                "hamotor_ensemble_observe": (None, [run, whole, whole, numbers]),
                "hamotor_ensemble_states": (None, [run, numbers]),
                "hamotor_ensemble_failures": (
                    None,
                    [run, ctypes.POINTER(count), ctypes.POINTER(whole)],
                ),
                "hamotor_ensemble_stop": (None, [run]),
            }
        )

    def _bind(self, signatures: Mapping[str, tuple[Any, list[Any]]]) -> None:
        for name, (result, arguments) in signatures.items():
            function = getattr(self._c, name)
            function.restype, function.argtypes = result, arguments

    def start(
        self,
        method: str,
        *,
        step: float | Fraction,
        state: Sequence[float | Fraction] | Vector,
        tolerance: float | None = None,
    ) -> LiveRun:
        """Begin a run at t = 0.

        `state`: shape (state_size,), per body the motor (body to world) and the momentum in the
        body frame, physical units.  `step` in seconds.  A wide scalar takes fractions in all its
        digits.  `tolerance`, s⁻¹, is the local error per
        unit of time of a method that chooses steps of its own.  Raises UsageError for an unknown
        method.
        """
        initial = np.ascontiguousarray(state, dtype=np.float64)
        if initial.shape != (self.description.state_size,):
            raise ToolError(
                f"the initial state has shape {initial.shape}; "
                f"the compiled scene wants ({self.description.state_size},)"
            )
        check_method(method, self.description.methods)
        if self.description.is_wide:
            numbers = " ".join(map(in_decimals, (0.0, step, *state)))
            handle = self._c.hamotor_start_text(method.encode(), tolerance or 0.0, numbers.encode())
        else:
            handle = self._c.hamotor_start(
                method.encode(), 0.0, float(step), tolerance or 0.0, _pointer(initial)
            )
        if not handle:
            raise ToolError(f'the compiled scene would not start method "{method}"')
        return LiveRun(self._c, handle, self.description)

    def start_ensemble(
        self,
        method: str,
        *,
        step: float,
        states: Rows,
        parameters: Rows | None = None,
        tolerance: float | None = None,
    ) -> LiveEnsemble | None:
        """Begin a run of every row of `states`, shape (members, state_size), at t = 0.

        `parameters`, shape (members, parameters): None for the scene's own.  Methods that choose
        their steps do so for each.  None for one that the library has no
        ensembles of.
        """
        size = self.description.state_size
        if states.ndim != 2 or states.shape[1] != size or self.description.ensemble is None:
            raise ToolError(
                f"the compiled scene wants states of shape (members, {size}), not {states.shape}, "
                "and to be compiled for ensembles."
            )
        initial = np.ascontiguousarray(states, dtype=np.float64)
        values = None if parameters is None else np.ascontiguousarray(parameters)
        handle = self._c.hamotor_ensemble_start(
            method.encode(),
            0.0,
            step,
            tolerance or 0.0,
            len(initial),
            _pointer(initial),
            None if values is None else _pointer(values),
            1,
            0,
        )
        return LiveEnsemble(self._c, handle, self.description, len(initial)) if handle else None


def check_method(method: str, methods: Mapping[str, int]) -> None:
    """Raise UsageError unless the scene offers this method."""
    if method not in methods:
        from hamotor.scene.methods import what_it_steps

        allowed = f"this scene offers {', '.join(sorted(methods))}."
        if steps := what_it_steps(method):
            raise UsageError(f'method "{method}" is for {steps}; {allowed}')
        raise UsageError(f'unknown method "{method}"; {allowed}{suggest(method, methods)}')


class LiveEnsemble:
    """Many runs of one scene inside the library, side by side.  A context manager."""

    def __init__(self, c: ctypes.CDLL, handle: int, description: Description, members: int) -> None:
        self._c, self._handle, self.description, self.members = c, handle, description, members

    def __enter__(self) -> LiveEnsemble:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def advance(self, steps: int) -> int:
        """Every member that is alive takes so many steps; how many still are."""
        return int(self._c.hamotor_ensemble_advance(self._handle, steps))

    def observe(self, rows: Rows) -> None:
        """Write a row of the columns for every member, shape (members, columns)."""
        self._c.hamotor_ensemble_observe(self._handle, 0, self.members, _pointer(rows))

    def states(self, states: Rows) -> None:
        """Write every member's state now, shape (members, state_size), C-contiguous."""
        self._c.hamotor_ensemble_states(self._handle, _pointer(states))

    def failures(self) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
        """Of every member why it stopped, a `Failure`, and how many steps it took."""
        reasons = np.empty(self.members, dtype=np.int32)
        steps = np.empty(self.members, dtype=np.int64)
        self._c.hamotor_ensemble_failures(
            self._handle,
            reasons.ctypes.data_as(ctypes.POINTER(ctypes.c_int32)),
            steps.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)),
        )
        return reasons, steps

    def stop(self) -> None:
        """Free the runs.  Harmless when called twice."""
        if self._handle:
            self._c.hamotor_ensemble_stop(self._handle)
            self._handle = 0


class LiveRun:
    """A run inside the library: advance it, look at it, stop it.  A context manager."""

    def __init__(self, c: ctypes.CDLL, handle: int, description: Description) -> None:
        self._c, self._handle, self.description = c, handle, description

    def __enter__(self) -> LiveRun:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def advance(self, steps: int, every: int, rows: Rows | None) -> int:
        """Take up to `steps` steps and return how many were taken.

        After each step whose index since the start is a multiple of `every`, one row is written
        into `rows`, shape (≥ rows due, columns), C-contiguous float64; None records nothing.
        Fewer steps than asked for means that an event happened in the last of them, that the next
        one failed, or that it takes more than patience.
        """
        target = None if rows is None else _pointer(rows)
        return int(self._c.hamotor_advance(self._handle, steps, every, target))

    def set_patience(self, tries: int) -> None:
        """Have `advance` return early from a step that takes more than so many of the method's own.

        The next call goes on with it, to the same bits.  0, as in the beginning, for no limit.
        """
        self._c.hamotor_set_patience(self._handle, tries)

    def observe(self) -> Vector:
        """One row of the trajectory for the state now, shape (columns,)."""
        row = np.empty(len(self.description.columns))
        self._c.hamotor_observe(self._handle, _pointer(row))
        return row

    def observe_text(self) -> list[str]:
        """The same row as decimals with all digits of the scalar."""
        text = ctypes.create_string_buffer(len(self.description.columns) * _LONGEST_NUMBER)
        self._c.hamotor_observe_text(self._handle, text, len(text))
        return text.value.decode().split()

    def observe_exactly(self) -> Exact | None:
        """The same row in all digits of the scalar; None where a number is not finite."""
        numbers = list(map(Decimal, self.observe_text()))
        return tuple(map(Fraction, numbers)) if all(x.is_finite() for x in numbers) else None

    def observe_at(self, time: float) -> Vector | None:
        """The row at a time (s) within the next step, by a part of it; None where that fails.

        The run stays where it is.
        """
        row = np.empty(len(self.description.columns))
        fine = self._c.hamotor_observe_at(self._handle, time, _pointer(row))
        return row if fine else None

    def observe_event(self, number: int) -> Vector | None:
        """The row where this event of the description happened in the last step, if it did."""
        row = np.empty(len(self.description.columns))
        happened = self._c.hamotor_observe_event(self._handle, number, _pointer(row))
        return row if happened else None

    def state(self) -> Vector:
        """The state now, shape (state_size,)."""
        state = np.empty(self.description.state_size)
        self._c.hamotor_state(self._handle, _pointer(state))
        return state

    def drift(self) -> tuple[float, float]:
        """|M M̃ − 1| before renormalisation: the largest left by one step, and the run's sum."""
        drift = np.zeros(2)
        self._c.hamotor_drift(self._handle, _pointer(drift))
        return float(drift[0]), float(drift[1])

    def steps(self) -> int:
        """Steps taken so far: the method's own where it chooses them."""
        return int(self._c.hamotor_steps(self._handle))

    def failure(self) -> tuple[Failure, int | None]:
        """Why the run stopped, and the first number of the state that is not finite, if one is."""
        component = ctypes.c_int64(-1)
        reason = self._c.hamotor_failure(self._handle, ctypes.byref(component))
        return Failure(reason), component.value if component.value >= 0 else None

    def stop(self) -> None:
        """Free the run.  Harmless when called twice."""
        if self._handle:
            self._c.hamotor_stop(self._handle)
            self._handle = 0


_LONGEST_NUMBER = 128
_DIGITS = 62


def in_decimals(x: float | Fraction) -> str:
    """`x` with more digits than any scalar has."""
    exact = Fraction(x)
    context = Context(prec=_DIGITS, Emin=-99999, Emax=99999)
    return str(context.divide(Decimal(exact.numerator), Decimal(exact.denominator)))


def _pointer(array: Rows) -> Any:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
