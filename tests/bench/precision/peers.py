"""Public solvers on the reference problems, as their users would write them, tuned.

Everyone integrates a quaternion (w, x, y, z) and body rates, 7 numbers, and for a body that moves
also position and velocity in the world, 13; MuJoCo has its own.  Of other scenes solvers are given
equations as Python text.  Imported by `stopwatch.py` in the peers' environment: nothing here needs
Hamotor.
"""

from __future__ import annotations

import ctypes
import importlib
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

Vector = list[float]


FUNCTIONS = (
    "sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh",
    "tanh",
)  # fmt: skip
"""What equations may call."""


class Refused(Exception):
    """A peer cannot do what it was asked; the text says why."""


class Problem:
    """A rigid body as `precision.py` describes it: kind free, top, sprung or loose; or `equations`
    of any scene, as text."""

    def __init__(self, said: Mapping[str, Any]) -> None:
        self.kind: str = said["kind"]
        self.python: str = said.get("python", "")
        self.operations: int = said.get("operations", 0)
        self.moments: Vector = said.get("moments", [0.0] * 3)
        self.mass: float = said.get("mass", 0.0)
        self.gravity: float = said.get("gravity", 0.0)
        self.height: float = said.get("height", 0.0)
        self.stiffness: float = said.get("stiffness", 0.0)
        self.rest_length: float = said.get("rest_length", 0.0)
        self.at: Vector = said.get("at", [0.0] * 3)
        self.end: float = said["end"]
        self.state: Vector = said["state"]

    def rates(self, functions: Any = math) -> Callable[[Any, Sequence[Any]], list[Any]]:
        """The time derivative of the state as a function of time and state, in numbers, or in
        expressions that `functions` (a module) knows."""
        if not self.python:
            return lambda _, x: rates(self, x, functions.sqrt)
        named: dict[str, Any] = {name: getattr(functions, name) for name in FUNCTIONS}
        exec(self.python, named)  # noqa: S102 - which the generator wrote
        found: Callable[[Any, Sequence[Any]], list[Any]] = named["rates"]
        return found

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
        self, watch: Watch, state: Sequence[Any], steps: int | None, evaluations: int | None
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
        state = (ctypes.c_double * len(self._problem.state))(*self._problem.state)
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
        return Result(watch, list(state), counts[0], counts[1])


_UNROLLED = 250
"""Beyond so many operations heyoka's unrolled code takes more than seconds to compile, each time
that its order changes."""


class Heyoka:
    """Taylor series of heyoka.py; `setting` is the tolerance, from which its order follows."""

    def __init__(self, problem: Problem, setting: float, *, fast_math: bool) -> None:
        heyoka = importlib.import_module("heyoka")
        variables = heyoka.make_vars(*(f"x{i}" for i in range(len(problem.state))))
        found = problem.rates(heyoka)(heyoka.time, variables)
        zero = heyoka.expression(0.0)
        began = time.perf_counter()
        self._integrator = heyoka.taylor_adaptive(
            [(v, zero + r) for v, r in zip(variables, found, strict=True)],
            problem.state,
            tol=setting,
            compact_mode=problem.operations > _UNROLLED,
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

        rates = problem.rates()

        def rate(t: float, x: Any) -> list[Any]:
            return rates(t, x.tolist())

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
        inertia = " ".join(repr(m) for m in central_moments(p))
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


def rotated(q: Sequence[float], v: Sequence[float]) -> Vector:
    """A vector of the body in the world, for a quaternion (w, x, y, z)."""
    w, x, y, z = q
    twice = (
        2 * (y * v[2] - z * v[1]),
        2 * (z * v[0] - x * v[2]),
        2 * (x * v[1] - y * v[0]),
    )
    return [
        v[0] + w * twice[0] + y * twice[2] - z * twice[1],
        v[1] + w * twice[1] + z * twice[0] - x * twice[2],
        v[2] + w * twice[2] + x * twice[1] - y * twice[0],
    ]


def seen_from(q: Sequence[float], v: Sequence[float]) -> Vector:
    """A vector of the world in the body."""
    return rotated((q[0], -q[1], -q[2], -q[3]), v)


def pull(problem: Problem, place: Sequence[float], arm: Sequence[float]) -> Vector:
    """The spring's force on a body at `place`, held at `arm` from there, both in the world."""
    reach = [x + a for x, a in zip(place, arm, strict=True)]
    size = -problem.stiffness
    if problem.rest_length:
        size *= 1 - problem.rest_length / math.sqrt(sum(d * d for d in reach))
    return [size * d for d in reach]


def central_moments(problem: Problem) -> Vector:
    """About the centre of mass: those of a top are about its fixed point."""
    away = problem.mass * problem.height**2 if problem.kind == "top" else 0.0
    j1, j2, j3 = problem.moments
    return [j1 - away, j2 - away, j3]


class Bullet:
    """PyBullet, one step a call; `setting` is the number of steps.

    A top is held by a constraint, a spring by a force before each step.
    """

    def __init__(self, problem: Problem, setting: float) -> None:
        self._problem, self._steps = problem, int(setting)
        began = time.perf_counter()
        self._bullet = bullet = importlib.import_module("pybullet")
        if not bullet.isConnected():
            bullet.connect(bullet.DIRECT)
        bullet.resetSimulation()
        bullet.setTimeStep(problem.end / self._steps)
        bullet.setGravity(0, 0, 0.0 if problem.kind == "free" else -problem.gravity)
        self._body = bullet.createMultiBody(baseMass=problem.mass)
        bullet.changeDynamics(
            self._body, -1, localInertiaDiagonal=central_moments(problem), linearDamping=0,
            angularDamping=0, maxJointVelocity=1e9, activationState=4,
        )  # fmt: skip
        if problem.kind == "top":
            self._put(problem.state)
            bullet.createConstraint(
                self._body, -1, -1, -1, bullet.JOINT_POINT2POINT, [0, 0, 0],
                [0, 0, -problem.height], [0, 0, 0],
            )  # fmt: skip
        self.set_up_s = time.perf_counter() - began

    def _put(self, x: Vector) -> None:
        q, spin = x[:4], rotated(x[:4], x[4:7])
        place, speed = x[7:10] or [0.0] * 3, x[10:13] or [0.0] * 3
        if self._problem.kind == "top":
            place = rotated(q, [0.0, 0.0, self._problem.height])
            speed = [
                spin[1] * place[2] - spin[2] * place[1],
                spin[2] * place[0] - spin[0] * place[2],
                spin[0] * place[1] - spin[1] * place[0],
            ]
        self._bullet.resetBasePositionAndOrientation(self._body, place, [*q[1:], q[0]])
        self._bullet.resetBaseVelocity(self._body, speed, spin)

    def _where(self) -> tuple[Vector, Vector]:
        place, (x, y, z, w) = self._bullet.getBasePositionAndOrientation(self._body)
        return list(place), [w, x, y, z]

    def _advance(self) -> None:
        bullet, body, problem = self._bullet, self._body, self._problem
        held = problem.kind in {"sprung", "loose"}
        for _ in range(self._steps):
            if held:
                place, q = self._where()
                arm = rotated(q, problem.at)
                at = [p + a for p, a in zip(place, arm, strict=True)]
                force = pull(problem, place, arm)
                bullet.applyExternalForce(body, -1, force, at, bullet.WORLD_FRAME)
            bullet.stepSimulation()

    def run(self, repetitions: int) -> Result:
        """The same."""
        watch = Watch()
        for _ in range(repetitions):
            self._put(self._problem.state)
            watch.time(self._advance)
        place, q = self._where()
        speed, spin = self._bullet.getBaseVelocity(self._body)
        state = [*q, *seen_from(q, spin)]
        if self._problem.moves:
            state += [*place, *speed]
        return Result(watch, state, self._steps, None)


class Pinocchio:
    """Pinocchio's forward dynamics (aba) and integrate, in a loop in Python; `setting` is the
    number of steps.

    The integrator is ours to write, as it is everybody's: RK4 with all slopes in the tangent
    space of the step's start, or Euler's with the new velocity.
    """

    def __init__(self, problem: Problem, setting: float, *, integrator: str) -> None:
        self._problem, self._steps = problem, int(setting)
        self._numpy = importlib.import_module("numpy")
        self._pinocchio = pin = importlib.import_module("pinocchio")
        began = time.perf_counter()
        joint = pin.JointModelFreeFlyer() if problem.moves else pin.JointModelSpherical()
        inertia = pin.Inertia(
            problem.mass,
            self._numpy.array([0.0, 0.0, problem.height if problem.kind == "top" else 0.0]),
            self._numpy.diag(central_moments(problem)),
        )
        self._model = pin.Model()
        index = self._model.addJoint(0, joint, pin.SE3.Identity(), "body")
        self._model.appendBodyToJoint(index, inertia, pin.SE3.Identity())
        gravity = 0.0 if problem.kind == "free" else -problem.gravity
        self._model.gravity.linear = self._numpy.array([0.0, 0.0, gravity])
        self._data = self._model.createData()
        self._still = self._numpy.zeros(self._model.nv)
        self._forces = pin.StdVec_Force()
        self._forces.extend([pin.Force.Zero(), pin.Force.Zero()])
        self._step = {"RK4": self._runge_kutta, "semi-implicit": self._euler}[integrator]
        self._evaluations = {"RK4": 4, "semi-implicit": 1}[integrator]
        self.set_up_s = time.perf_counter() - began

    def _acceleration(self, q: Any, v: Any) -> Any:
        problem = self._problem
        if problem.kind not in {"sprung", "loose"}:
            return self._pinocchio.aba(self._model, self._data, q, v, self._still)
        numbers = q.tolist()
        turn = [numbers[6], *numbers[3:6]]
        force = seen_from(turn, pull(problem, numbers[:3], rotated(turn, problem.at)))
        a, b, c = problem.at
        self._forces[1].linear = self._numpy.array(force)
        self._forces[1].angular = self._numpy.array(
            [
                b * force[2] - c * force[1],
                c * force[0] - a * force[2],
                a * force[1] - b * force[0],
            ]
        )
        return self._pinocchio.aba(self._model, self._data, q, v, self._still, self._forces)

    def _runge_kutta(self, q: Any, v: Any, h: float) -> tuple[Any, Any]:
        integrate, model = self._pinocchio.integrate, self._model
        a1 = self._acceleration(q, v)
        v2 = v + h / 2 * a1
        a2 = self._acceleration(integrate(model, q, h / 2 * v), v2)
        v3 = v + h / 2 * a2
        a3 = self._acceleration(integrate(model, q, h / 2 * v2), v3)
        v4 = v + h * a3
        a4 = self._acceleration(integrate(model, q, h * v3), v4)
        moved = integrate(model, q, h / 6 * (v + 2 * v2 + 2 * v3 + v4))
        return moved, v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    def _euler(self, q: Any, v: Any, h: float) -> tuple[Any, Any]:
        v = v + h * self._acceleration(q, v)
        return self._pinocchio.integrate(self._model, q, h * v), v

    def run(self, repetitions: int) -> Result:
        """The same."""
        array, problem = self._numpy.array, self._problem
        x, h = problem.state, problem.end / self._steps
        turn = [*x[1:4], x[0]]
        start_q = array([*x[7:10], *turn])
        start_v = array([*seen_from(x[:4], x[10:13]), *x[4:7]] if problem.moves else x[4:7])

        def integrate() -> tuple[Any, Any]:
            q, v = start_q, start_v
            for _ in range(self._steps):
                q, v = self._step(q, v, h)
            return q, v

        watch = Watch()
        for _ in range(repetitions):
            q, v = (list(map(float, y)) for y in watch.time(integrate))
        last = [q[-1], *q[-4:-1]]
        state = [*last, *v[-3:]]
        if problem.moves:
            state += [*q[:3], *rotated(last, v[:3])]
        return Result(watch, state, self._steps, self._evaluations * self._steps)


MAKERS: Mapping[str, Callable[..., Any]] = {
    "compiled": Compiled,
    "heyoka": Heyoka,
    "scipy": SciPy,
    "mujoco": MuJoCo,
    "bullet": Bullet,
    "pinocchio": Pinocchio,
}


PACKAGES = ("heyoka", "scipy", "mujoco", "pybullet", "pin")
"""Those that come from PyPI."""


def version(package: str) -> str | None:
    """Of an installed package; None where it is not."""
    try:
        return importlib.import_module("importlib.metadata").version(package)  # type: ignore[no-any-return]
    except importlib.import_module("importlib.metadata").PackageNotFoundError:
        return None
