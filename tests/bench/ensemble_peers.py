"""Others' ensembles of the bodies of ensemble.hpp, on one core: `hamotor bench ensemble` starts it.

    python -m tests.bench.ensemble_peers versions
    python -m tests.bench.ensemble_peers jax WIDTH|mujoco [--quick]

Runs in an environment of its own, where nothing of Hamotor is; prints one JSON object.  JAX: the
same formulas as Eigen's, one array for each number of all bodies, a `fori_loop` over the steps
inside one `jit`, which XLA makes loops over registers of WIDTH bits of.  MuJoCo: `rollout`, one
thread, contacts and constraints off.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module, metadata
from typing import Any

MOMENTS = (1.0, 2.0, 3.0)
MASS = 1.0
AT = (0.1, 0.2, 0.05)
STIFFNESS = 50.0
STEP = 0.01
CHECKED = 100
"""Steps after which the first body's angular momentum is told."""
FREE, SPRING = "free rotation, SO(3)", "spring, SE(3)"
PACKAGES = ("jax", "mujoco")

Body = tuple[Any, ...]
"""Quaternion (w, x, y, z), angular momentum; position in the world and linear momentum."""


def momentum_of(k: int) -> list[float]:
    """How body k starts, at the origin: angular and linear momentum."""
    x = 1e-3 * (k % 1000)
    return [1.5 + x, 0.8 - x, 2 + 0.5 * x, 0.1, -x, 0.2]


def cross(a: Sequence[Any], b: Sequence[Any]) -> Body:
    """a × b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def turning(q: Sequence[Any], rate: Sequence[Any]) -> Body:
    """½ q rate."""
    w, i, j, k = q
    a, b, c = rate
    return (
        -0.5 * (i * a + j * b + k * c),
        0.5 * (w * a + j * c - k * b),
        0.5 * (w * b + k * a - i * c),
        0.5 * (w * c + i * b - j * a),
    )


def free_slope(x: Body) -> Body:
    """Of attitude and angular momentum."""
    q, angular = x[:4], x[4:7]
    rate = [m / j for m, j in zip(angular, MOMENTS, strict=True)]
    return (*turning(q, rate), *cross(angular, rate))


def spring_slope(x: Body) -> Body:
    """With a spring from a point of the body to the world's origin."""
    q, angular, position, linear = x[:4], x[4:7], x[7:10], x[10:13]
    rate = [m / j for m, j in zip(angular, MOMENTS, strict=True)]
    inside = rotated((q[0], -q[1], -q[2], -q[3]), position)
    force = [-STIFFNESS * (p + a) for p, a in zip(inside, AT, strict=True)]
    torque = [g + t for g, t in zip(cross(angular, rate), cross(AT, force), strict=True)]
    change = [g + f for g, f in zip(cross(linear, rate), force, strict=True)]
    velocity = rotated(q, [p / MASS for p in linear])
    return (*turning(q, rate), *torque, *velocity, *change)


def rotated(q: Sequence[Any], v: Sequence[Any]) -> Body:
    """v turned by q."""
    twice = [2 * t for t in cross(q[1:], v)]
    return tuple(a + q[0] * t + c for a, t, c in zip(v, twice, cross(q[1:], twice), strict=True))


def runge_kutta(slope: Callable[[Body], Body]) -> Callable[[Body], Body]:
    """A step of the classical method; the quaternion is brought back to length 1."""

    def moved(x: Body, h: float, k: Body) -> Body:
        return tuple(a + h * b for a, b in zip(x, k, strict=True))

    def step(x: Body) -> Body:
        one = slope(x)
        two = slope(moved(x, STEP / 2, one))
        three = slope(moved(x, STEP / 2, two))
        four = slope(moved(x, STEP, three))
        x = tuple(
            a + STEP / 6 * (k1 + 2 * (k2 + k3) + k4)
            for a, k1, k2, k3, k4 in zip(x, one, two, three, four, strict=True)
        )
        back = 1.5 - 0.5 * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3])
        return (*(back * a for a in x[:4]), *x[4:])

    return step


def strang(sin: Callable[[Any], Any], cos: Callable[[Any], Any]) -> Callable[[Body], Body]:
    """A step of the splitting of order 2 of a free body: |Π|²/2J₂ apart, two axes in turn."""

    def about(x: Body, axis: int, h: float) -> Body:
        """By the rate that this axis' momentum gives beyond what J₂ does."""
        angle = (1 / MOMENTS[axis] - 1 / MOMENTS[1]) * h * x[4 + axis]
        s, c = sin(angle), cos(angle)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        angular = list(x[4:7])
        angular[i], angular[j] = c * x[4 + i] + s * x[4 + j], c * x[4 + j] - s * x[4 + i]
        s, c = sin(0.5 * angle), cos(0.5 * angle)
        turned = [c * a for a in x[:4]]
        turned[0] -= s * x[1 + axis]
        turned[1 + axis] += s * x[0]
        turned[1 + i] += s * x[1 + j]
        turned[1 + j] -= s * x[1 + i]
        return (*turned, *angular)

    def step(x: Body) -> Body:
        x = about(x, 0, STEP / 2)
        x = about(x, 2, STEP)
        x = about(x, 0, STEP / 2)
        length2 = x[4] * x[4] + x[5] * x[5] + x[6] * x[6]
        length = length2**0.5
        half = STEP / (2 * MOMENTS[1]) * length
        s, c = sin(half) / length, cos(half)
        r = [s * m for m in x[4:7]]
        w, i, j, k = x[:4]
        return (
            c * w - (i * r[0] + j * r[1] + k * r[2]),
            c * i + w * r[0] + j * r[2] - k * r[1],
            c * j + w * r[1] + k * r[0] - i * r[2],
            c * k + w * r[2] + i * r[1] - j * r[0],
            *x[4:7],
        )

    return step


def shortest(runs: int, run: Callable[[], Any]) -> float:
    """Shortest time that the processor had for one of several runs, s."""
    best = float("inf")
    for _ in range(runs):
        began = time.process_time()
        run()
        best = min(best, time.process_time() - began)
    return best


def row(
    problem: str, method: str, contestant: str, bodies: int, rate: float, angular: Sequence[float]
) -> dict[str, Any]:
    """What one contest said."""
    return {
        "problem": problem,
        "method": method,
        "contestant": contestant,
        "bodies": bodies,
        "threads": 1,
        "steps_per_second": rate,
        "flops_per_step": 0,
        "angular": [float(x) for x in angular],
    }


def repeated(loop: Any, step: Callable[[Body], Body], x: Body, steps: Any) -> Any:
    """x after so many steps."""
    return loop(0, steps, lambda _, y: step(y), x)


def by_jax(width: str, quick: bool) -> list[dict[str, Any]]:
    """JAX on one core, in double."""
    os.environ["XLA_FLAGS"] = (
        "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
        f" --xla_cpu_prefer_vector_width={width}"
    )
    jax: Any = import_module("jax")
    jnp: Any = import_module("jax.numpy")
    np: Any = import_module("numpy")
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_platforms", "cpu")
    rows = []
    for problem, method, step in (
        (FREE, "rk4", runge_kutta(free_slope)),
        (SPRING, "rk4", runge_kutta(spring_slope)),
        (FREE, "splitting2, plain sums", strang(jnp.sin, jnp.cos)),
    ):
        for bodies in (1024, 16384):
            momenta = np.array([momentum_of(k) for k in range(bodies)]).T
            still = np.zeros(bodies)
            numbers = [still + 1, still, still, still, *momenta[:3]]
            if problem == SPRING:
                numbers += [still, still, still, *momenta[3:]]
            start = tuple(map(jnp.asarray, numbers))

            compiled = jax.jit(partial(repeated, jax.lax.fori_loop, step))

            def run(steps: int, compiled: Any = compiled, start: Body = start) -> Any:
                return jax.block_until_ready(compiled(start, steps))

            end = run(CHECKED)
            steps = max(32, (1 << 17) // bodies)
            taken = shortest(10 if quick else 50, partial(run, steps))
            angular = [end[4 + n][0] for n in range(3)]
            rows.append(row(problem, method, "JAX", bodies, bodies * steps / taken, angular))
    return rows


def by_mujoco(quick: bool) -> list[dict[str, Any]]:
    """MuJoCo's Runge-Kutta method of four stages on one core."""
    mujoco: Any = import_module("mujoco")
    np: Any = import_module("numpy")
    rows = []
    bodies, steps = 64, 200
    for problem in (FREE, SPRING):
        sites = '<site site="anchor"/><site site="at"/>'
        tendon = f'<spatial stiffness="{STIFFNESS}" springlength="0">{sites}</spatial>'
        model = mujoco.MjModel.from_xml_string(f"""
<mujoco>
 <compiler boundinertia="0" balanceinertia="false"/>
 <option timestep="{STEP}" integrator="RK4" gravity="0 0 0">
  <flag contact="disable" constraint="disable"/>
 </option>
 <worldbody>
  <site name="anchor" pos="0 0 0"/>
  <body>
   <joint type="{"ball" if problem == FREE else "free"}"/>
   <inertial pos="0 0 0" mass="{MASS}" diaginertia="{" ".join(map(str, MOMENTS))}"/>
   <site name="at" pos="{" ".join(map(str, AT))}"/>
  </body>
 </worldbody>
 {f"<tendon>{tendon}</tendon>" if problem == SPRING else ""}
</mujoco>""")
        data = mujoco.MjData(model)
        states = []
        for k in range(bodies):
            mujoco.mj_resetData(model, data)
            momentum = momentum_of(k)
            rate = [m / j for m, j in zip(momentum[:3], MOMENTS, strict=True)]
            speed = [p / MASS for p in momentum[3:]]
            data.qvel[:] = rate if problem == FREE else [*speed, *rate]
            state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
            mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
            states.append(state)
        start = np.array(states)
        with import_module("mujoco.rollout").Rollout(nthread=0) as rollout:

            def run(
                n: int, rollout: Any = rollout, model: Any = model, data: Any = data,
                start: Any = start,
            ) -> Any:  # fmt: skip
                return rollout.rollout(model, data, start, nstep=n)[0]

            end = run(CHECKED)[0, -1]
            taken = shortest(3 if quick else 10, partial(run, steps))
        rate = end[-3:]
        angular = [j * w for j, w in zip(MOMENTS, rate, strict=True)]
        rows.append(row(problem, "rk4", "MuJoCo", bodies, bodies * steps / taken, angular))
    return rows


def versions() -> dict[str, str | None]:
    """Of the packages; None where one is not installed."""
    found: dict[str, str | None] = {}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = None
    return found


def main(words: Sequence[str]) -> None:
    """Print what was asked for."""
    quick = "--quick" in words
    if words[0] == "versions":
        said: Any = versions()
    else:
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
        said = {"rows": by_mujoco(quick) if words[0] == "mujoco" else by_jax(words[1], quick)}
    print(json.dumps(said))


if __name__ == "__main__":
    main(sys.argv[1:])
