"""Public solvers on the reference problems, as their users would write them, tuned.

Everyone integrates a quaternion (w, x, y, z) and body rates, 7 numbers, and for a body that moves
also position and velocity in the world, 13; MuJoCo has its own. Imported by `stopwatch.py` in the
peers' environment: nothing here needs Hamotor.
"""

from __future__ import annotations

import ctypes
import importlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

Vector = list[float]


class Refused(Exception):
    """A peer cannot do what it was asked; the text says why."""


class Problem:
    """A rigid body as `precision.py` describes it: kind free, top, sprung or loose."""

    def __init__(self, said: Mapping[str, Any]) -> None:
        self.kind: str = said["kind"]
        self.moments: Vector = said["moments"]
        self.mass: float = said["mass"]
        self.gravity: float = said["gravity"]
        self.height: float = said["height"]
        self.stiffness: float = said["stiffness"]
        self.rest_length: float = said["rest_length"]
        self.at: Vector = said["at"]
        self.end: float = said["end"]
        self.state: Vector = said["state"]

    @property
    def moves(self) -> bool:
        """Whether the state holds a position and a velocity."""
        return len(self.state) == 13


def rates(problem: Problem, x: Sequence[Any], sqrt: Callable[[Any], Any] = math.sqrt) -> list[Any]:
    """The time derivative of the state, in numbers or in expressions that know + − × ÷."""
    w, i, j, k, a, b, c = x[:7]
    j1, j2, j3 = problem.moments
    found = [
        0.5 * (-i * a - j * b - k * c),
        0.5 * (w * a + j * c - k * b),
        0.5 * (w * b + k * a - i * c),
        0.5 * (w * c + i * b - j * a),
    ]
    spin = [
        (j2 - j3) / j1 * (b * c) if j2 != j3 else 0.0,
        (j3 - j1) / j2 * (c * a) if j3 != j1 else 0.0,
        (j1 - j2) / j3 * (a * b) if j1 != j2 else 0.0,
    ]
    if problem.kind == "free":
        return [*found, *spin]
    if problem.kind == "top":
        lever = problem.mass * problem.gravity * problem.height
        spin[0] += 2 * lever / j1 * (j * k + w * i)
        spin[1] += 2 * lever / j2 * (w * j - i * k)
        return [*found, *spin]
    p, q, r = problem.at
    rows = (
        (1 - 2 * (j * j + k * k), 2 * (i * j - w * k), 2 * (i * k + w * j)),
        (2 * (i * j + w * k), 1 - 2 * (i * i + k * k), 2 * (j * k - w * i)),
        (2 * (i * k - w * j), 2 * (j * k + w * i), 1 - 2 * (i * i + j * j)),
    )
    reach = [x[7 + n] + rows[n][0] * p + rows[n][1] * q + rows[n][2] * r for n in range(3)]
    pull = -problem.stiffness
    if problem.kind == "loose":
        length = sqrt(reach[0] * reach[0] + reach[1] * reach[1] + reach[2] * reach[2])
        pull = pull * (1 - problem.rest_length / length)
    force = [pull * d for d in reach]
    inside = [
        rows[0][n] * force[0] + rows[1][n] * force[1] + rows[2][n] * force[2] for n in range(3)
    ]
    torque = (
        q * inside[2] - r * inside[1],
        r * inside[0] - p * inside[2],
        p * inside[1] - q * inside[0],
    )
    spin = [s + t / moment for s, t, moment in zip(spin, torque, problem.moments, strict=True)]
    speed = [f / problem.mass for f in force]
    speed[2] = speed[2] - problem.gravity
    return [*found, *spin, *x[10:13], *speed]


class Watch:
    """Seconds of each repetition, and how many of them this thread had the processor."""

    def __init__(self) -> None:
        self.seconds: Vector = []
        self.processor: Vector = []

    def time(self, work: Callable[[], Any]) -> Any:
        """Do the work once and return its answer."""
        had = time.thread_time()
        began = time.perf_counter()
        answer = work()
        self.seconds.append(time.perf_counter() - began)
        self.processor.append(time.thread_time() - had)
        return answer


class Result:
    """What one setting gave: times of each repetition, the last state, what it took."""

    def __init__(
        self, watch: Watch, state: Vector, steps: int | None, evaluations: int | None
    ) -> None:
        self.seconds, self.processor, self.state = watch.seconds, watch.processor, state
        self.steps, self.evaluations = steps, evaluations


class Compiled:
    """A library of `timing.hpp`. `setting` is the tolerance, or the number of steps."""

    class _Problem(ctypes.Structure):
        _fields_ = (
            ("inertia", ctypes.c_double * 3),
            ("mass", ctypes.c_double),
            ("gravity", ctypes.c_double),
            ("height", ctypes.c_double),
            ("stiffness", ctypes.c_double),
            ("rest_length", ctypes.c_double),
            ("at", ctypes.c_double * 3),
        )

    set_up_s = 0.0

    def __init__(self, problem: Problem, setting: float, *, library: str, solver: str) -> None:
        self._problem, self._setting, self._solver = problem, setting, solver.encode()
        self._time = ctypes.CDLL(library).time_solver
        three = ctypes.c_double * 3
        self._c = self._Problem(
            three(*problem.moments), problem.mass, problem.gravity, problem.height,
            problem.stiffness, problem.rest_length, three(*problem.at),
        )  # fmt: skip

    def run(self, repetitions: int) -> Result:
        """Integrate from the start `repetitions` times."""
        seconds, processor = ((ctypes.c_double * repetitions)() for _ in range(2))
        state = (ctypes.c_double * 13)(*self._problem.state)
        counts = (ctypes.c_int64 * 2)()
        refused = self._time(
            self._problem.kind.encode(), ctypes.byref(self._c), self._solver,
            ctypes.c_double(self._problem.end), ctypes.c_double(self._setting),
            ctypes.c_int64(repetitions), seconds, processor, state, counts,
        )  # fmt: skip
        if refused:
            raise Refused("the solver gave up" if refused == 2 else "unknown solver")
        watch = Watch()
        watch.seconds, watch.processor = list(seconds), list(processor)
        last = list(state)[: len(self._problem.state)]
        return Result(watch, last, counts[0], counts[1])


class Heyoka:
    """Taylor series of heyoka.py; `setting` is the tolerance, from which its order follows."""

    def __init__(self, problem: Problem, setting: float, *, fast_math: bool) -> None:
        heyoka = importlib.import_module("heyoka")
        names = ["qw", "qx", "qy", "qz", "wx", "wy", "wz", "x", "y", "z", "vx", "vy", "vz"]
        variables = heyoka.make_vars(*names[: len(problem.state)])
        found = rates(problem, variables, heyoka.sqrt)
        zero = heyoka.expression(0.0)
        began = time.perf_counter()
        self._integrator = heyoka.taylor_adaptive(
            [(v, zero + r) for v, r in zip(variables, found, strict=True)],
            problem.state,
            tol=setting,
            compact_mode=False,
            fast_math=fast_math,
        )
        self.set_up_s = time.perf_counter() - began
        self._problem = problem
        self._integrator.propagate_until(problem.end)
        idle = Watch()
        for _ in range(50):
            idle.time(self._propagate)
        self._idle_s, self._idle_processor_s = min(idle.seconds), min(idle.processor)

    def _propagate(self) -> Any:
        return self._integrator.propagate_until(self._problem.end)

    def run(self, repetitions: int) -> Result:
        """The same; the time of a call that has nothing to do is taken off."""
        integrator = self._integrator
        watch = Watch()
        for _ in range(repetitions):
            integrator.time = 0.0
            integrator.state[:] = self._problem.state
            answer = watch.time(self._propagate)
        watch.seconds = [max(s - self._idle_s, 0.0) for s in watch.seconds]
        watch.processor = [max(s - self._idle_processor_s, 0.0) for s in watch.processor]
        steps = int(answer[3])
        state = [float(x) for x in integrator.state]
        return Result(watch, state, steps, steps * integrator.order)


class SciPy:
    """solve_ivp with rates in plain Python floats: faster than NumPy for so few numbers."""

    set_up_s = 0.0

    def __init__(self, problem: Problem, setting: float, *, method: str) -> None:
        self._solve = importlib.import_module("scipy.integrate").solve_ivp
        self._problem, self._setting, self._method = problem, setting, method

    def run(self, repetitions: int) -> Result:
        """The same."""
        problem = self._problem
        relative = max(self._setting, 3e-14)  # the least that it takes

        def rate(_: float, x: Any) -> list[Any]:
            return rates(problem, x.tolist())

        def solve() -> Any:
            return self._solve(
                rate, (0.0, problem.end), problem.state, method=self._method,
                rtol=relative, atol=self._setting, t_eval=[problem.end],
            )  # fmt: skip

        watch = Watch()
        for _ in range(repetitions):
            found = watch.time(solve)
        if not found.success:
            raise Refused(found.message)
        return Result(watch, [float(x) for x in found.y[:, -1]], None, int(found.nfev))


class MuJoCo:
    """MuJoCo with the joint the problem has; `setting` is the number of steps."""

    set_up_s = 0.0

    def __init__(self, problem: Problem, setting: float, *, integrator: str) -> None:
        self._mujoco = importlib.import_module("mujoco")
        # Otherwise it writes a file where it is started; what it warns of is seen below.
        self._mujoco.set_mju_user_warning(lambda _: None)
        self._problem, self._steps = problem, int(setting)
        began = time.perf_counter()
        self._model = self._mujoco.MjModel.from_xml_string(self._xml(integrator))
        self._data = self._mujoco.MjData(self._model)
        self.set_up_s = time.perf_counter() - began

    def _xml(self, integrator: str) -> str:
        p = self._problem
        top = p.kind == "top"
        moments = list(p.moments)
        if top:  # about the centre of mass
            moments[0] -= p.mass * p.height**2
            moments[1] -= p.mass * p.height**2
        inertia = " ".join(repr(m) for m in moments)
        at = " ".join(repr(a) for a in p.at)
        held = p.kind in {"sprung", "loose"}
        gravity = 0.0 if p.kind == "free" else p.gravity
        spring = f'stiffness="{p.stiffness!r}" springlength="{p.rest_length!r}"'
        sites = '<site site="anchor"/><site site="at"/>'
        tendon = f"<tendon><spatial {spring}>{sites}</spatial></tendon>" if held else ""
        return f"""
<mujoco>
 <compiler boundinertia="0" balanceinertia="false"/>
 <option timestep="{p.end / self._steps!r}" integrator="{integrator}" gravity="0 0 {-gravity!r}">
  <flag contact="disable" constraint="disable"/>
 </option>
 <worldbody>
  <site name="anchor" pos="0 0 0"/>
  <body name="body">
   <joint type="{"ball" if top else "free"}"/>
   <inertial pos="0 0 {p.height if top else 0!r}" mass="{p.mass!r}" diaginertia="{inertia}"/>
   <site name="at" pos="{at}"/>
  </body>
 </worldbody>
 {tendon}
</mujoco>"""

    def run(self, repetitions: int) -> Result:
        """The same; all steps in one call."""
        mujoco, model, data = self._mujoco, self._model, self._data
        problem = self._problem
        turn, spin = problem.state[:4], problem.state[4:7]
        place, speed = problem.state[7:10], problem.state[10:13]
        ball = problem.kind == "top"
        watch = Watch()
        for _ in range(repetitions):
            mujoco.mj_resetData(model, data)
            data.qpos[:] = turn if ball else [*(place or [0.0] * 3), *turn]
            data.qvel[:] = spin if ball else [*(speed or [0.0] * 3), *spin]
            watch.time(lambda: mujoco.mj_step(model, data, self._steps))
        if any(int(w.number) for w in data.warning):
            raise Refused("MuJoCo warns that the simulation is unstable")
        at = 0 if ball else 3
        state = [*data.qpos[at : at + 4], *data.qvel[at : at + 3]]
        if problem.moves:
            state += [*data.qpos[:3], *data.qvel[:3]]
        steps = self._steps
        return Result(watch, [float(x) for x in state], steps, None)


MAKERS: Mapping[str, Callable[..., Any]] = {
    "compiled": Compiled,
    "heyoka": Heyoka,
    "scipy": SciPy,
    "mujoco": MuJoCo,
}


PACKAGES = ("heyoka", "scipy", "mujoco", "pybullet", "pin")
"""Those that come from PyPI."""


def version(package: str) -> str | None:
    """Of an installed package; None where it is not."""
    try:
        return importlib.import_module("importlib.metadata").version(package)  # type: ignore[no-any-return]
    except importlib.import_module("importlib.metadata").PackageNotFoundError:
        return None
