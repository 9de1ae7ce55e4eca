"""The motion of any scene as text that public solvers are given: ẋ = f(t, x) in plain numbers.

The same formulas that `taylor` expands (`mechanics.flow`), in Python for SciPy and heyoka and in
C++ for Boost.odeint and SUNDIALS.  Common parts are local variables, so that all compute the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hamotor.codegen.algebra import Algebra, reverse_sign
from hamotor.codegen.program import (
    Call,
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Number,
    Product,
    Program,
    Quotient,
    Sum,
    renamed,
)
from hamotor.mechanics.flow import WORK, leanest
from hamotor.scene import Scene
from hamotor.scene.general import GeneralBody, GeneralScene, product
from hamotor.scene.principal_system import principal_system

SMOOTH: Final = (
    "sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh",
    "tanh",
)  # fmt: skip
"""What every public solver's numbers have."""


@dataclass(frozen=True)
class Frame:
    """The motor N of the frame that a body's equations are in, seen from the scene's own."""

    body: GeneralBody
    motor: Sequence[float] | None
    """None: the same frame."""

    def enter(self, motor: Sequence[float], momentum: Sequence[float]) -> list[float]:
        """M N and N~ μ N."""
        if self.motor is None:
            return [*motor, *momentum]
        moved = product(self._algebra, self._whole(motor), self._whole(self.motor))
        return [*self._components(moved), *map(float, self._adjoint.T @ np.array(momentum))]

    def back(self, motor: Sequence[float], momentum: Sequence[float]) -> list[float]:
        """M and μ of these."""
        if self.motor is None:
            return [*motor, *momentum]
        moved = product(self._algebra, self._whole(motor), _reverse(self._whole(self.motor)))
        own = np.linalg.solve(self._adjoint.T, np.array(momentum))
        return [*self._components(moved), *map(float, own)]

    @property
    def _algebra(self) -> Algebra:
        return self.body.coordinates.algebra

    @cached_property
    def _adjoint(self) -> NDArray[np.float64]:
        """Column a: N E_a N~ by generators, which are a blade each."""
        assert self.motor is not None
        n = self._whole(self.motor)
        blades = [dict(g.bivector) for g in self.body.coordinates.group.generators]
        turned = [
            product(self._algebra, product(self._algebra, n, _floats(e)), _reverse(n))
            for e in blades
        ]
        return np.array(
            [[t.get(b, 0.0) / float(x) for t in turned] for e in blades for b, x in e.items()]
        )

    def _whole(self, motor: Sequence[float]) -> dict[int, float]:
        whole: dict[int, float] = {}
        for x, c in zip(motor, self.body.coordinates.group.element.components, strict=True):
            for blade, y in c.embedding.items():
                whole[blade] = whole.get(blade, 0.0) + x * float(y)
        return whole

    def _components(self, whole: dict[int, float]) -> list[float]:
        return [
            math.fsum(float(y) * whole.get(blade, 0.0) for blade, y in reading.items())
            for reading in self.body.coordinates.group.element.reading
        ]


def _reverse(whole: dict[int, float]) -> dict[int, float]:
    return {blade: reverse_sign(blade) * x for blade, x in whole.items()}


def _floats(whole: Mapping[int, Any]) -> dict[int, float]:
    return {blade: float(x) for blade, x in whole.items()}


@dataclass(frozen=True)
class Equations:
    """ẋ = f(t, x), x in SI units."""

    about: str
    """What the coordinates are."""
    python: str
    """`rates(t, x)`, a list of what x holds; calls functions by their plain names."""
    cpp: str
    """`struct Equations`, like those of problems.hpp."""
    start: tuple[float, ...]
    """x at t = 0."""
    timed: bool
    """Whether f holds t."""
    names: tuple[str, ...]
    operations: int
    leave: Program
    bodies: tuple[GeneralBody, ...]
    frames: tuple[Frame, ...]

    def state(self, x: Sequence[float] | NDArray[np.float64]) -> list[float]:
        """Motors and momenta in the order of the scene's state; each motor divided by √⟨M M~⟩₀, as
        a quaternion is by its length.  Raises OverflowError for what exploded."""
        try:
            return self._state(x)
        except ValueError as beyond:  # ∞ − ∞, or a function of ∞
            raise OverflowError(str(beyond)) from None

    def _state(self, x: Sequence[float] | NDArray[np.float64]) -> list[float]:
        known = dict(zip(self.names, map(float, x), strict=True))
        for k, body in enumerate(self.bodies):
            square = _square(body, k, known)
            size = math.sqrt(square) if square > 0 else math.nan
            for name in known:
                if name.startswith(f"m{k}."):
                    known[name] /= size
        numbers = {f"x[{i}]": value for i, value in enumerate(known.values())}
        found = self.leave.evaluate(numbers, _FLOATS)
        state: list[float] = []
        for k, (body, frame) in enumerate(zip(self.bodies, self.frames, strict=True)):
            state += frame.back(*([found[name] for name in names] for names in _told(body, k)))
        return state


_FLOATS: Final[dict[str, Any]] = {
    "number": float,
    **{name: getattr(math, name) for name in SMOOTH},
}


def equations(scene: Scene | GeneralScene) -> Equations | str:
    """Those with the fewest operations of the coordinates that there are, of rigid bodies in their
    principal frames; or why there are none."""
    general = scene.general if isinstance(scene, Scene) else scene
    if general.lagrangian is not None:
        return (
            "L has no Legendre transform in formulas: its rates are found by iterations at every "
            "step, so that there are no equations to hand over"
        )
    frames = tuple(Frame(body, None) for body in general.bodies)
    system = general.system
    if isinstance(scene, Scene):
        frames = tuple(
            Frame(body, None if own.principal.is_body_frame else own.principal.motor)
            for body, own in zip(general.bodies, scene.bodies, strict=True)
        )
        system = principal_system(scene)
    about, flow = leanest(system)
    unknown = sorted(flow.field.cost.calls.keys() - set(SMOOTH))
    if unknown:
        return f"the motion is not smooth: it holds {', '.join(unknown)}"
    names = tuple(name for name in flow.coordinates if name not in ("t", WORK))
    outputs = dict(flow.field.outputs)
    field = replace(
        flow.field, outputs=tuple((name, outputs[name]) for name in names)
    ).without_unused()
    field = renamed(field, {name: f"x{i}" for i, name in enumerate(names)})
    kept = [i for i, name in enumerate(flow.coordinates) if name in names]
    start = {"t": 0.0}
    for k, (body, frame) in enumerate(zip(general.bodies, frames, strict=True)):
        motor, momentum = _told(body, k)
        seen = frame.enter(body.motor, body.momentum)
        start |= dict(zip([*motor, *momentum], seen, strict=True))
    entered = flow.enter.evaluate(start, _FLOATS)
    leave = renamed(flow.leave, {f"x[{old}]": f"x[{new}]" for new, old in enumerate(kept)})
    return Equations(
        about=f"{about}: {len(names)} numbers, {field.cost}",
        python=python_text(field),
        cpp=cpp_text(field),
        start=tuple(float(entered[f"x[{i}]"]) for i in kept),
        timed="t" in _read(field),
        names=names,
        operations=field.cost.total,
        leave=leave,
        bodies=general.bodies,
        frames=frames,
    )


def _told(body: GeneralBody, k: int) -> tuple[list[str], list[str]]:
    group = body.coordinates.group
    motor = [f"m{k}.{c.name}" for c in group.element.components]
    return motor, [f"mu{k}.{g.momentum}" for g in group.generators]


def _square(body: GeneralBody, k: int, known: dict[str, float]) -> float:
    """⟨M M~⟩₀ of the components that are coordinates; the others contribute nothing to it."""
    whole: dict[int, float] = {}
    for c in body.coordinates.group.element.components:
        for blade, y in c.embedding.items():
            x = known.get(f"m{k}.{c.name}", 0.0)
            whole[blade] = whole.get(blade, 0.0) + x * float(y)
    algebra = body.coordinates.algebra
    return math.fsum(
        x * reverse_sign(b) * y * float(algebra.blade_product(a, b).get(0, 0))
        for a, x in whole.items()
        for b, y in whole.items()
    )


def _read(program: Program) -> set[str]:
    return {node.text for node in program.nodes() if isinstance(node, Name)}


def python_text(field: Program) -> str:
    """`rates(t, x)` of a program over `x0`, `x1`, … and `t`, an output for each of them."""
    given = ", ".join(f"x{i}" for i in range(len(field.outputs)))
    lines = ["def rates(t, x):", f"    ({given},) = x"]
    lines += [f"    {name} = {_text(x)}" for name, x in field.bindings]
    lines += ["    return [", *(f"        {_text(x)}," for _, x in field.outputs), "    ]"]
    return "\n".join(lines) + "\n"


def cpp_text(field: Program) -> str:
    """`struct Equations` of the same."""
    size, read = len(field.outputs), _read(field)
    lines = [
        "struct Equations {",
        f"  static constexpr std::size_t size = {size};",
        "  explicit Equations(const Constants&) {}",
        f"  void operator()(const State<{size}>& x, State<{size}>& rate,",
        "                  [[maybe_unused]] double t) const {",
        *(f"    const double x{i} = x[{i}];" for i in range(size) if f"x{i}" in read),
        *(f"    const double {name} = {_text(x, 'std::')};" for name, x in field.bindings),
        *(f"    rate[{i}] = {_text(x, 'std::')};" for i, (_, x) in enumerate(field.outputs)),
        "  }",
        "};",
    ]
    return "\n".join(lines) + "\n"


_SUM, _PRODUCT, _ATOM = range(3)


def _text(x: Expression, functions: str = "", at_least: int = _SUM) -> str:
    """Text that C++ and Python read alike."""

    def of(part: Expression, least: int = _SUM) -> str:
        return _text(part, functions, least)

    level = _SUM
    match x:
        case Name(name):
            return name
        case Number(value):
            text, level = repr(float(value)), _ATOM if value >= 0 else _SUM
        case Negative(a):
            text = f"-{of(a, _ATOM)}"
        case Sum(a, Negative(b)):
            text = f"{of(a)} - {of(b, _PRODUCT)}"
        case Sum(a, b):
            text = f"{of(a)} + {of(b, _PRODUCT)}"
        case MultiplyAdd(Negative(a), b, c):
            text = f"{of(c)} - {of(a, _PRODUCT)} * {of(b, _ATOM)}"
        case MultiplyAdd(a, b, c):
            text = f"{of(c)} + {of(a, _PRODUCT)} * {of(b, _ATOM)}"
        case Product(a, b):
            text, level = f"{of(a, _PRODUCT)} * {of(b, _ATOM)}", _PRODUCT
        case Quotient(a, b):
            text, level = f"{of(a, _PRODUCT)} / {of(b, _ATOM)}", _PRODUCT
        case Call(function, arguments) if function in SMOOTH:
            text, level = f"{functions}{function}({', '.join(map(of, arguments))})", _ATOM
        case _:
            raise ValueError(f"no text for {x}")
    return text if level >= at_least else f"({text})"
