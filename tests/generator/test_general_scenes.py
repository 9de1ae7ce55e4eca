"""Scenes of any Hamiltonian, from their files to their last state, against what is known otherwise.

References: solutions of 30 digits (tests/oracles), closed forms, and classical equations of motion
for R, x and momenta, written here and integrated by extrapolation in long double.
"""

from __future__ import annotations

import json
import math
import random
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import hamotor
from hamotor.codegen.algebra import Algebra, reverse_sign
from hamotor.codegen.spec import bundled_algebra
from hamotor.mechanics.evaluation import evaluated
from hamotor.mechanics.hamiltonian import coadjoint
from hamotor.mechanics.system import System
from hamotor.scene import GeneralScene, Scene, parse_scene, read_scene
from hamotor.scene.general import product
from hamotor.scene.invariants import at_the_start
from hamotor.scene.reading import BUNDLED

ORACLES = Path(__file__).resolve().parents[1] / "oracles"
RHS = "initial_rhs (time derivative of M and mu at t=0)"
Wide = NDArray[np.longdouble]

SPRING = """
[[body]]
name = "body"
mass = 1.5
inertia = [0.4, 0.7, 0.9]
position = [0.3, -0.1, 0.4]
velocity = [0.2, -0.6, 0.3]
angular_velocity = [0.8, 0.5, -1.1]
[[interaction]]
type = "gravity"
acceleration = [0, 0, -0.98]
[[interaction]]
type = "spring"
body = "body"
at = [0.3, -0.2, 0.5]
anchor = [0.2, 0.1, 2.0]
stiffness = 6.0
rest_length = 0.8
"""
# The initial motor and momentum of each oracle replace what its text says of them.
SCENES = {
    "01_free_asymmetric_pga3": """
algebra = "pga3"
[[body]]
name = "body"
mass = 2.0
inertia = [1.0, 2.0, 3.5]
allow_unphysical_inertia = true
""",
    "03_heavy_top_cl3": """
algebra = "cl3"
[[body]]
name = "top"
kinetic_matrix = [[1.2, 0, 0], [0, 2.0, 0], [0, 0, 2.7]]
[[interaction]]
type = "potential"
expression = "weight*at(0.2, 0.1, 0.5).z"
parameters = { weight = 3.0 }
""",
    "05_spring_gravity_pga3": 'algebra = "pga3"\n' + SPRING,
    "10_free_se4_pga4": """
algebra = "pga4"
group = "SE4"
[[body]]
name = "body"
mass = MASS
second_moments = MOMENTS
""",
    "12_elastic_seed_cga3_sim3": """
algebra = "cga3"
group = "Sim3"
[[body]]
name = "body"
[hamiltonian]
# Core parameters are four times the physical ones.
expression = '''
2*norm_squared(P)/m + 2*(Pi.x^2/j.x + Pi.y^2/j.y + Pi.z^2/j.z) + 2*momentum(body).e0i^2/j0
'''
parameters = { m = 1.0, j = [1.0, 2.0, 3.0], j0 = 1.5 }
""",
    "15_spring_gravity_cga3_se3": 'algebra = "cga3"\ngroup = "SE3"\n' + SPRING,
}


def ascending(blade: str) -> tuple[str, int]:
    """`e31` as the oracles write it, e1^e3, and its sign."""
    if blade == "s":
        return "1", 1
    indices, sign = list(blade[1:]), 1
    order = sorted(indices)
    for at, index in enumerate(order):
        if (now := indices.index(index)) != at:
            sign *= (-1) ** (now - at)
            indices.insert(at, indices.pop(now))
    return "^".join(f"e{index}" for index in order), sign


def physical(scene: Any, core: Mapping[str, Mapping[str, str]]) -> tuple[list[float], list[float]]:
    """The components of M and, physical, of μ: generators are −½ of the blades, ½ for e0i."""
    group = scene.general.group if isinstance(scene, Scene) else scene.group
    motor = [sign * float(core["M"][name]) for name, sign in map(ascending, group.motor)]
    momentum = [
        (0.5 if g == "e0i" else -0.5) * float(core["mu"][f"(e{g[1]}^e{g[2]})*"])
        for g in group.generators
    ]
    return motor, momentum


@cache
def oracle(name: str) -> Any:
    return json.loads((ORACLES / f"{name}.json").read_text(encoding="utf-8"))


def oracle_text(name: str) -> str:
    """The scene's text without its initial state."""
    parameters = oracle(name)["params"]
    moments = [float(x) for x in parameters.get("lambda(second moments)", ())]
    mass = parameters.get("m", "1.0")
    text = SCENES[name].replace("MASS", mass).replace("MOMENTS", str(moments))
    return f"{text}\n[time]\nend = 1.0\nstep = 0.001\nmethod = 'rkmk4'\n"


def oracle_scene(name: str) -> str:
    """The scene's text with the oracle's initial motor and momentum."""
    text = oracle_text(name)
    first = parse_scene(text.encode(), name="oracle", file="oracle.toml")
    motor, momentum = physical(first, oracle(name)["initial"])
    group = first.group
    text = re.sub(r"^(position|velocity|angular_velocity) = .*\n", "", text, flags=re.MULTILINE)
    state = "".join(
        f"{key} = {{ {', '.join(f'{n} = {x!r}' for n, x in zip(names, values, strict=True))} }}\n"
        for key, names, values in (
            ("motor", group.motor, motor),
            ("momentum", group.generators, momentum),
        )
    )
    return re.sub(r'^(name = "(?:body|top)"\n)', rf"\1{state}", text, flags=re.MULTILINE)


def load(text: str, folder: Path) -> Any:
    """A scene's text by way of a file, as the command line reads it."""
    file = folder / "scene.toml"
    file.write_text(text, encoding="utf-8")
    return hamotor.load(file)


@pytest.mark.parametrize("name", SCENES)
def test_an_oracle_is_met_from_its_scene_file(name: str, tmp_path: Path) -> None:
    simulation = load(oracle_scene(name), tmp_path)
    scene = read_scene(tmp_path / "scene.toml")
    states = oracle(name)["states"]
    times = [float(state["t"]) for state in states]
    run = simulation.run(step=1 / 2048, end=max(times), every=64)
    for t, state in zip(times, states, strict=True):
        row = int(np.flatnonzero(np.abs(run.t - t) < 1e-9)[0])
        motor, momentum = physical(scene, state)
        assert np.abs(run.motor()[row] - motor).max() <= 1e-10
        assert np.abs(run.momentum()[row] - momentum).max() <= 1e-10


FLOATS: dict[str, Callable[..., Any]] = {
    "number": float,
    "sqrt": math.sqrt,
    "dot": lambda *x: math.fsum(a * b for a, b in zip(x[::2], x[1::2], strict=True)),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_right_hand_side_is_the_oracles(name: str) -> None:
    """Ṁ = M B and μ̇ = ad*_B μ − F of the programs that are compiled, in double precision."""
    read = parse_scene(oracle_scene(name).encode(), name="oracle", file="oracle.toml")
    scene: GeneralScene = read.general if isinstance(read, Scene) else read
    (body,) = scene.bodies
    coordinates, group = body.coordinates, body.coordinates.group
    values = {f"m0.{c.name}": x for c, x in zip(group.element.components, body.motor, strict=True)}
    values |= {f"mu0.{g.momentum}": x for g, x in zip(group.generators, body.momentum, strict=True)}
    found = System(scene.hamiltonian).gradient.evaluate(values, FLOATS)
    rates = tuple(found[f"rate0.{g.rate}"] for g in group.generators)
    forques = [found[f"forque0.{g.momentum}"] for g in group.generators]
    motor: dict[int, float] = {}
    for x, component in zip(body.motor, group.element.components, strict=True):
        for blade, sign in component.embedding.items():
            motor[blade] = motor.get(blade, 0.0) + x * float(sign)
    rate: dict[int, float] = {}
    for x, generator in zip(rates, group.generators, strict=True):
        for blade, coefficient in generator.bivector.items():
            rate[blade] = rate.get(blade, 0.0) + x * float(coefficient)
    whole = product(coordinates.algebra, motor, rate)
    moving = [
        sum(float(x) * whole.get(blade, 0.0) for blade, x in reading.items())
        for reading in group.element.reading
    ]
    known = dict(zip(coordinates.momenta, body.momentum, strict=True))
    star = [float(x.subs(known)) for x in coadjoint(coordinates, rates)]
    changing = np.array(star) - forques
    expected_motor, expected_momentum = map(np.array, physical(read, oracle(name)[RHS]))
    assert np.abs(moving - expected_motor).max() <= 1e-14 * np.abs(expected_motor).max()
    assert np.abs(changing - expected_momentum).max() <= 1e-14 * np.abs(expected_momentum).max()


# ------------------------------------------------ systems of the same kinds, with other numbers

Field = Callable[[Wide], Wide]
LEVELS = 9
HALF = np.longdouble(0.5)


def extrapolated(field: Field, state: Wide, end: float, steps: int) -> Wide:
    """Gragg, Bulirsch and Stoer's method with fixed steps, of order 18, in long double."""
    length = np.longdouble(end) / steps
    for _ in range(steps):
        table: list[Wide] = []
        for level in range(LEVELS):
            n = 2 * (level + 1)
            h = length / n
            before, now = state, state + h * field(state)
            for _ in range(n - 1):
                before, now = now, before + 2 * h * field(now)
            row = [(before + now + h * field(now)) * HALF]
            for k, coarser in enumerate(table):
                ratio = np.longdouble(level + 1) / np.longdouble(level - k)
                row.append(row[k] + (row[k] - coarser) / (ratio * ratio - 1))
            table = row
        state = table[-1]
    return state


def hat(w: Wide) -> Wide:
    zero = np.longdouble(0)
    return np.array([[zero, -w[2], w[1]], [w[2], zero, -w[0]], [-w[1], w[0], zero]])


def wide(values: Any) -> Wide:
    """The decimals in the text, to all digits of a long double."""
    return np.array([np.longdouble(repr(float(x))) for x in np.ravel(values)]).reshape(
        np.shape(values)
    )


def quaternion(drawn: random.Random) -> list[float]:
    """Rational and of length 1 to all digits of a double: a multiple of 1/25."""
    signs = [drawn.choice((-1, 1)) for _ in range(4)]
    numbers = drawn.sample([2 / 5, 4 / 5, 2 / 5, 1 / 5], 4)
    return [sign * x for sign, x in zip(signs, numbers, strict=True)]


def turned(q: list[float]) -> Wide:
    w, x, y, z = wide(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class Drawn:
    """A random rigid body: its text, and its classical equations m ẍ = f, (J Ω)˙ = J Ω×Ω + τ."""

    def __init__(self, seed: str) -> None:
        self.random = random.Random(seed)
        self.mass = self.number(0.5, 3)
        parts = [self.number(0.2, 1) for _ in range(3)]
        self.moments = [round(sum(parts) - x, 3) for x in parts]
        self.position, self.velocity, self.turning = (self.vector(1) for _ in range(3))
        self.quaternion = quaternion(self.random)

    def number(self, low: float, high: float) -> float:
        return round(self.random.uniform(low, high), 3)

    def vector(self, size: float) -> list[float]:
        return [self.number(-size, size) for _ in range(3)]

    def text(self, acting: str, algebra: str = "pga3", mass: str = "") -> str:
        mass = mass or f"mass = {self.mass}\ninertia = {self.moments}"
        return f"""
algebra = "{algebra}"
group = "SE3"
[[body]]
name = "body"
{mass}
position = {self.position}
orientation = {{ quaternion = {self.quaternion} }}
velocity = {self.velocity}
angular_velocity = {self.turning}
{acting}
[time]
end = 1.0
step = 0.001
method = "rkmk4"
"""

    def at_the_end(self, acting: Callable[[Wide, Wide], tuple[Wide, Wide]]) -> tuple[Wide, Wide]:
        """x and R at t = 1 for (force, torque in the body frame) of (x, R)."""
        mass, moments = wide(self.mass), wide(self.moments)
        rotation = turned(self.quaternion)

        def field(y: Wide) -> Wide:
            x, v, r, w = y[:3], y[3:6], y[6:15].reshape(3, 3), y[15:]
            force, torque = acting(x, r)
            spin = (np.cross(moments * w, w) + torque) / moments
            return np.concatenate([v, force / mass, (r @ hat(w)).ravel(), spin])

        y = np.concatenate(
            [
                wide(self.position),
                rotation @ wide(self.velocity),
                rotation.ravel(),
                wide(self.turning),
            ]
        )
        y = extrapolated(field, y, 1.0, 40)
        return y[:3], y[6:15].reshape(3, 3)


def expect(run: Any, x: Wide, rotation: Wide) -> None:
    assert np.abs(run.position()[-1] - x).max() <= 1e-10
    assert np.abs(run.rotation()[-1] - rotation).max() <= 1e-10


@pytest.mark.parametrize(("algebra", "seed"), [("pga3", "a"), ("cga3", "b")])
def test_a_spring_with_gravity(algebra: str, seed: str, tmp_path: Path) -> None:
    drawn = Drawn(f"spring {seed}")
    at, anchor, gravity = drawn.vector(0.5), [*drawn.vector(1)[:2], 3.0], drawn.vector(5)
    stiffness, rest = drawn.number(2, 9), drawn.number(0.3, 1)
    text = drawn.text(
        f"""
[[interaction]]
type = "gravity"
acceleration = {gravity}
[[interaction]]
type = "spring"
body = "body"
at = {at}
anchor = {anchor}
stiffness = {stiffness}
rest_length = {rest}
""",
        algebra,
    )

    def acting(x: Wide, r: Wide) -> tuple[Wide, Wide]:
        pull = x + r @ wide(at) - wide(anchor)
        length = np.sqrt(pull @ pull)
        force = -wide(stiffness) * (length - wide(rest)) * pull / length
        return force + wide(drawn.mass) * wide(gravity), np.cross(wide(at), r.T @ force)

    expect(load(text, tmp_path).run(step=1 / 4000), *drawn.at_the_end(acting))


def test_points_in_a_newtonian_field(tmp_path: Path) -> None:
    """Four point masses on the axes, so that the principal axes are the body's."""
    drawn = Drawn("newton")
    a, b, c = (drawn.number(0.2, 0.6) for _ in range(3))
    places = [[a, 0, 0], [-a, 0, 0], [0, b, 0], [0, -b, 0], [0, 0, c], [0, 0, -c]]
    drawn.mass, mass = 3.0, 0.5
    drawn.moments = [b * b + c * c, a * a + c * c, a * a + b * b]
    drawn.position = [2.0, -0.5, 0.7]
    strength, center = drawn.number(2, 5), drawn.vector(0.3)
    points = ", ".join(f"{{ mass = {mass}, at = {place} }}" for place in places)
    text = drawn.text(
        f"""
[[interaction]]
type = "newtonian"
body = "body"
center = {center}
strength = {strength}
""",
        mass=f"points = [{points}]",
    )

    def acting(x: Wide, r: Wide) -> tuple[Wide, Wide]:
        force, torque = wide([0, 0, 0]), wide([0, 0, 0])
        for place in places:
            d = x + r @ wide(place) - wide(center)
            pull = -wide(strength) * wide(mass) * d / np.sqrt(d @ d) ** 3
            force, torque = force + pull, torque + np.cross(wide(place), r.T @ pull)
        return force, torque

    expect(load(text, tmp_path).run(step=1 / 4000), *drawn.at_the_end(acting))


FAR_APART = """
{algebra}
[[body]]
name = "one"
{one}
orientation = {{ axis = [1, 2, 3], angle = 0.7 }}
[[body]]
name = "two"
{two}
position = [3, -1, 2]
orientation = {{ axis = [0, 2, -1], angle = 2 }}
{more}
[[interaction]]
type = "newtonian"
body = "one"
other = "two"
constant = 1.0
[time]
end = 1
step = 0.1
"""


def energy_of_two(one: str, two: str, algebra: str = 'algebra = "pga3"', more: str = "") -> float:
    """At the start, of two bodies at rest."""
    text = FAR_APART.format(algebra=algebra, one=one, two=two, more=more)
    found = parse_scene(text.encode(), name="pair", file="pair.toml")
    general = found.general if isinstance(found, Scene) else found
    values = at_the_start(general.hamiltonian, general.bodies)
    return float(evaluated([general.hamiltonian.energy], values)[0])


def of_axes(center: Sequence[float], size: float = 0.1, *, points: bool = True) -> str:
    """Point masses of 0.5 kg on three axes about a centre, or the same mass and second moments."""
    lengths = (0.6 * size, 0.3 * size, size)
    if points:
        at = np.array(center) + [sign * x for x in np.diag(lengths) for sign in (1, -1)]
        return f"points = [{', '.join(f'{{ mass = 0.5, at = {place.tolist()} }}' for place in at)}]"
    a, b, c = (x**2 for x in lengths)
    return f"mass = 3\ninertia = [{b + c}, {a + c}, {a + b}]\ncenter_of_mass = {list(center)}"


@pytest.mark.parametrize(("one", "two"), [(True, False), (False, True), (False, False)])
def test_bodies_attract_each_other_up_to_second_moments(one: bool, two: bool) -> None:
    here, there = [0.2, 0, -0.1], [0, 0.3, 0]
    exact = energy_of_two(of_axes(here), of_axes(there))
    as_points = energy_of_two(of_axes(here, 1e-6), of_axes(there, 1e-6))
    assert abs(as_points / exact - 1) > 1e-5
    found = energy_of_two(of_axes(here, points=one), of_axes(there, points=two))
    assert found == pytest.approx(exact, rel=1e-7)


def test_second_moments_grow_with_the_body() -> None:
    algebra, more = 'algebra = "cga3"\ngroup = "Sim3"', "scale = 2.5"
    center = [0.0, 0.0, 0.0]
    given, small = of_axes(center, 0.03, points=False), of_axes(center, 0.03)
    exact = energy_of_two(small, small, algebra, more)
    assert abs(energy_of_two(given, given, algebra) / exact - 1) > 1e-5
    assert energy_of_two(given, given, algebra, more) == pytest.approx(exact, rel=1e-7)


def test_a_dipole_in_the_field_of_another(tmp_path: Path) -> None:
    drawn = Drawn("dipole")
    drawn.position = [1.1, 0.4, -0.6]
    at, moment = drawn.vector(0.2), drawn.vector(900)
    center, source = drawn.vector(0.2), drawn.vector(900)
    text = drawn.text(f"""
[[interaction]]
type = "dipole"
body = "body"
at = {at}
moment = {moment}
center = {center}
source = {source}
""")

    def acting(x: Wide, r: Wide) -> tuple[Wide, Wide]:
        """Force and torque as textbooks have them: (n·∇)B and n×B."""
        d = x + r @ wide(at) - wide(center)
        n, m = r @ wide(moment), wide(source)
        distance = np.sqrt(d @ d)
        u = d / distance
        constant = np.longdouble("1e-7")
        field = constant * (3 * u * (m @ u) - m) / distance**3
        force = (m @ u) * n + (n @ u) * m + (m @ n) * u - 5 * (m @ u) * (n @ u) * u
        force = 3 * constant * force / distance**4
        return force, np.cross(wide(at), r.T @ force) + r.T @ np.cross(n, field)

    expect(load(text, tmp_path).run(step=1 / 4000), *drawn.at_the_end(acting))


def test_a_driven_and_damped_body(tmp_path: Path) -> None:
    """Thrust as a function of time along a turning axis, linear and angular damping."""
    drawn = Drawn("driven")
    at, axis, thrust = drawn.vector(0.3), drawn.vector(1), drawn.number(1, 4)
    text = drawn.text(f"""
[[interaction]]
type = "force"
body = "body"
at = {at}
expression = "thrust*(1 + sin(3*t))*direction({axis[0]}, {axis[1]}, {axis[2]})"
parameters = {{ thrust = {thrust} }}
[[interaction]]
type = "damping"
body = "body"
linear = 0.7
angular = 0.3
""")
    mass, moments = wide(drawn.mass), wide(drawn.moments)

    def field(y: Wide) -> Wide:
        v, r, w, t = y[3:6], y[6:15].reshape(3, 3), y[15:18], y[18]
        push = wide(thrust) * (1 + np.sin(3 * t)) * wide(axis)
        force = r @ push - wide(0.7) * v
        torque = np.cross(wide(at), push) - wide(0.3) * w
        spin = (np.cross(moments * w, w) + torque) / moments
        return np.concatenate([v, force / mass, (r @ hat(w)).ravel(), spin, wide([1])])

    rotation = turned(drawn.quaternion)
    start = [wide(drawn.position), rotation @ wide(drawn.velocity), rotation.ravel()]
    y = extrapolated(field, np.concatenate([*start, wide(drawn.turning), wide([0])]), 1.0, 40)
    run = load(text, tmp_path).run(step=1 / 4000)
    expect(run, y[:3], y[6:15].reshape(3, 3))
    assert run.conserved["energy_balance"]["max_relative_error"] <= 1e-10


def test_a_heavy_top_of_other_numbers(tmp_path: Path) -> None:
    """Euler and Poisson's equations on the rotors of Cl(3)."""
    drawn = Drawn("top")
    matrix, place = np.diag(drawn.moments).tolist(), drawn.vector(0.6)
    text = f"""
algebra = "cl3"
[[body]]
name = "top"
kinetic_matrix = {matrix}
orientation = {{ quaternion = {drawn.quaternion} }}
angular_velocity = {drawn.turning}
[[interaction]]
type = "potential"
expression = "4.5*at({place[0]}, {place[1]}, {place[2]}).z"
[time]
end = 1.0
step = 0.001
"""
    weight = wide([0, 0, -4.5])
    _, rotation = drawn.at_the_end(lambda _, r: (0 * weight, np.cross(wide(place), r.T @ weight)))
    run = load(text, tmp_path).run(step=1 / 4000, method="splitting6")
    assert np.abs(run.rotation()[-1] - rotation).max() <= 1e-10


def test_a_free_body_in_four_dimensions_of_other_numbers(tmp_path: Path) -> None:
    """Π = Λ Ω + Ω Λ, Π̇ = [Π, Ω], Ṙ = R Ω, with Ω v = ω-plane by plane; ẋ = R V constant."""
    drawn = random.Random("four")
    moments = [round(drawn.uniform(0.3, 2), 3) for _ in range(4)]
    planes = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    rates = {f"e{i + 1}{j + 1}": round(drawn.uniform(-1, 1), 3) for i, j in planes}
    speeds = {f"e0{k + 1}": round(drawn.uniform(-1, 1), 3) for k in range(4)}
    shown = ", ".join(f"{name} = {x}" for name, x in (rates | speeds).items())
    text = f"""
algebra = "pga4"
group = "SE4"
[[body]]
name = "body"
mass = 1.3
second_moments = {moments}
rate = {{ {shown} }}
[time]
end = 2.0
step = 0.001
"""
    spread = np.diag(wide(moments))
    sums = wide(moments)[:, None] + wide(moments)[None, :]
    omega = np.zeros((4, 4), np.longdouble)
    for (i, j), x in zip(planes, rates.values(), strict=True):
        omega[j, i], omega[i, j] = wide(x), -wide(x)

    def field(y: Wide) -> Wide:
        r, p = y[:16].reshape(4, 4), y[16:].reshape(4, 4)
        w = p / sums
        return np.concatenate([(r @ w).ravel(), (p @ w - w @ p).ravel()])

    start = np.concatenate(
        [np.eye(4, dtype=np.longdouble).ravel(), (spread @ omega + omega @ spread).ravel()]
    )
    rotation = extrapolated(field, start, 2.0, 40)[:16].reshape(4, 4)
    run = load(text, tmp_path).run(step=1 / 2000, method="splitting6")
    assert np.abs(run.rotation()[-1] - rotation).max() <= 1e-10
    assert np.abs(run.position()[-1] - 2 * wide(list(speeds.values()))).max() <= 1e-10


def test_a_body_in_an_ideal_fluid_of_other_numbers(tmp_path: Path) -> None:
    """Kirchhoff: Π̇ = Π×Ω + P×V + τ, Ṗ = P×Ω, with (Ω, V) = K⁻¹ (Π, P) and K full."""
    drawn = Drawn("fluid")
    root = [[drawn.number(-1, 1) for _ in range(6)] for _ in range(6)]
    matrix = np.array(root) @ np.transpose(root) + 2 * np.eye(6)
    matrix = np.round((matrix + matrix.T) / 2, 3)
    depth, weight = drawn.number(0.1, 0.5), drawn.number(2, 6)
    text = drawn.text(
        f"""
[[interaction]]
type = "potential"
expression = "weight*direction(0, 0, -depth).z"
parameters = {{ weight = {weight}, depth = {depth} }}
""",
        mass=f"kinetic_matrix = {matrix.tolist()}",
    )
    inverse = np.linalg.inv(matrix).astype(np.longdouble)
    for _ in range(3):  # Newton's iteration for the digits that a double lacks
        inverse = inverse @ (2 * np.eye(6) - wide(matrix) @ inverse)

    def field(y: Wide) -> Wide:
        r, angular, linear = y[3:12].reshape(3, 3), y[12:15], y[15:]
        rates = inverse @ y[12:]
        w, v = rates[:3], rates[3:]
        couple = np.cross(wide([0, 0, -depth]), r.T @ wide([0, 0, -weight]))
        turning = np.cross(angular, w) + np.cross(linear, v) + couple
        return np.concatenate([r @ v, (r @ hat(w)).ravel(), turning, np.cross(linear, w)])

    start = wide(matrix) @ wide([*drawn.turning, *drawn.velocity])
    rotation = turned(drawn.quaternion)
    y = extrapolated(
        field, np.concatenate([wide(drawn.position), rotation.ravel(), start]), 1.0, 40
    )
    run = load(text, tmp_path).run(step=1 / 4000)
    expect(run, y[:3], y[3:12].reshape(3, 3))
    assert np.abs(run.momentum()[-1] - y[12:]).max() <= 1e-10


def conformal_generators() -> list[Wide]:
    """What each generator of SO(4,1) does to e0, e1, e2, e3, e∞: columns are the images."""
    matrices = []
    for i, j in ((1, 2), (2, 0), (0, 1)):  # x ↦ ω×x
        matrix = np.zeros((5, 5), np.longdouble)
        matrix[1 + j, 1 + i], matrix[1 + i, 1 + j] = 1, -1
        matrices.append(matrix)
    for i in (1, 2, 3):  # e0 ↦ e_i, e_i ↦ e∞: translations
        matrix = np.zeros((5, 5), np.longdouble)
        matrix[i, 0] = matrix[4, i] = 1
        matrices.append(matrix)
    matrices.append(np.diag(wide([-1, 0, 0, 0, 1])))  # dilation
    for i in (1, 2, 3):  # e_i ↦ −e0, e∞ ↦ −e_i: special conformal motions
        matrix = np.zeros((5, 5), np.longdouble)
        matrix[0, i] = matrix[i, 4] = -1
        matrices.append(matrix)
    return matrices


def test_a_quadratic_hamiltonian_on_all_conformal_maps(tmp_path: Path) -> None:
    """L̇ = L A(B) and μ̇_i = c_jiᵏ B_j μ_k with 5 × 5 matrices; [A_i, A_j] = c_ijᵏ A_k."""
    drawn = random.Random("conformal")
    names = ["e23", "e31", "e12", "e1i", "e2i", "e3i", "e0i", "e01", "e02", "e03"]
    inertia = [round(drawn.uniform(1, 4), 3) for _ in names]
    momentum = [round(drawn.uniform(-1, 1), 3) for _ in names]
    terms = " + ".join(
        f"momentum(top).{name}^2/{2 * x!r}" for name, x in zip(names, inertia, strict=True)
    )
    shown = ", ".join(f"{name} = {x}" for name, x in zip(names, momentum, strict=True))
    text = f"""
algebra = "cga3"
group = "SO41"
[[body]]
name = "top"
momentum = {{ {shown} }}
[hamiltonian]
expression = "{terms}"
[time]
end = 2.0
step = 0.001
"""
    generators = conformal_generators()
    columns = np.stack([g.ravel() for g in generators], -1).astype(np.float64)
    structure = np.zeros((10, 10, 10), np.longdouble)
    for i, a in enumerate(generators):
        for j, b in enumerate(generators):
            bracket = (a @ b - b @ a).ravel().astype(np.float64)
            found = np.linalg.lstsq(columns, bracket, rcond=None)[0]
            assert np.abs(columns @ found - bracket).max() < 1e-12
            structure[i, j] = np.round(found)

    def field(y: Wide) -> Wide:
        matrix, mu = y[:25].reshape(5, 5), y[25:]
        rates = mu / wide(inertia)
        rate = sum(b * g for b, g in zip(rates, generators, strict=True))
        return np.concatenate([(matrix @ rate).ravel(), np.einsum("jik,j,k", structure, rates, mu)])

    y = extrapolated(field, np.concatenate([np.eye(5).ravel(), wide(momentum)]), 2.0, 40)
    run = load(text, tmp_path).run(step=1 / 2000, method="splitting6")
    assert np.abs(run.momentum()[-1] - y[25:]).max() <= 1e-10
    origin = y[:25].reshape(5, 5)[:, 0]
    assert np.abs(run.position()[-1] - origin[1:4] / origin[0]).max() <= 1e-10


# ------------------------------------------------------------------------ bundled scenes


def test_the_conformal_body_runs_along_a_hyperbolic_geodesic() -> None:
    """x = x0 + n (c + ρ tanh(κt + t0)), s = (ρ/α) sech(κt + t0), α = √(J0/m)."""
    run = hamotor.load("conformal_body").run(step=1 / 4000, every=100)
    growth, speed, alpha = 0.6, 0.3, math.sqrt(1.5)
    kappa = math.hypot(growth, speed / alpha)
    t0 = -math.atanh(growth / kappa)
    radius = alpha * math.cosh(t0)
    now = kappa * run.t + t0
    assert np.abs(run.scale() - radius / alpha / np.cosh(now)).max() <= 1e-10
    x = radius * (np.tanh(now) - math.tanh(t0))
    assert np.abs(run.position() - x[:, None] * [1, 0, 0]).max() <= 1e-10
    assert run.scale().max() == pytest.approx(2.645, abs=1e-3)
    assert run.scale()[-1] < 0.2


def test_the_breathing_body_swings_as_newton_says() -> None:
    """I0 s¨ = s Ω·JΩ − V′(s), (s² J Ω)˙ = s² J Ω×Ω, and r as if it did not breathe."""
    moments = wide([0.3, 0.4, 0.5])
    spread = moments.sum() / 2

    def field(y: Wide) -> Wide:
        s, speed, r, momentum = y[0], y[1], y[2:11].reshape(3, 3), y[11:]
        w = momentum / (s * s * moments)
        force = s * (w @ (moments * w)) - 20 * (s - 1)
        return np.concatenate(
            [
                [speed, force / spread],
                (r @ hat(w)).ravel(),
                np.cross(momentum, w),
            ]
        )

    spin = wide([0.3, 4.0, 1.0])
    start = np.concatenate([wide([1, 0]), np.eye(3).ravel(), moments * spin])
    y = extrapolated(field, start, 3.0, 120)
    run = hamotor.load("breathing_body").run(end=3.0, step=1 / 8000, every=100)
    assert abs(run.scale()[-1] - y[0]) <= 1e-10
    assert np.abs(run.rotation()[-1] - y[2:11].reshape(3, 3)).max() <= 1e-10
    assert np.abs(run.position()[-1] - [0.6, 0, 0.3]).max() <= 1e-10
    assert run.scale().max() > 1.3
    assert int((np.diff(np.sign(np.diff(run.scale()))) < 0).sum()) >= 3


def test_kovalevskayas_integral_is_constant() -> None:
    run = hamotor.load("kovalevskaya").run(step=1 / 2000)
    w = run.momentum() / [2, 2, 1]
    vertical = run.rotation()[:, 2, :]
    strength = 9.81 * 0.5
    z = (w[:, 0] + 1j * w[:, 1]) ** 2 - strength * (vertical[:, 0] + 1j * vertical[:, 1])
    integral = np.abs(z) ** 2
    assert np.ptp(np.abs(w[:, 0])) > 0.5
    assert np.abs(integral / integral[0] - 1).max() < 1e-8


def test_the_satellite_librates_at_the_rate_of_the_gravity_gradient() -> None:
    """Small swings: n √(3 (J2 − J1)/J3), n the orbital rate; these, of 0.4 rad, are 2 % slower."""
    run = hamotor.load("gravity_gradient").run()
    axis, out = run.rotation()[:, :2, 0], run.position()[:, :2]
    swing = np.arctan2(
        out[:, 0] * axis[:, 1] - out[:, 1] * axis[:, 0],
        out[:, 0] * axis[:, 0] + out[:, 1] * axis[:, 1],
    )
    crossings = run.t[1:][np.diff(np.sign(swing)) != 0]
    rate = math.pi / np.diff(crossings).mean()
    small = math.sqrt(3.986004418e14 / 7e6**3 * 3 * (380 - 40) / 400)
    assert np.abs(swing).max() < 0.45
    assert 0.93 * small < rate < small


def test_a_first_step_is_of_the_motion_and_not_of_metres() -> None:
    # 7500 m/s are no fast motion at 7e6 m: steps of a fraction of a turn, not of a metre.
    run = hamotor.load("gravity_gradient").run(method="rkmk4", tolerance=1e-3)
    steps = [rung["steps"] for rung in run.report["tolerance"]["ladder"]]
    assert 100 < steps[0] < 4000
    assert steps[-1] < 40000


# ---------------------------------------------------------------------- PGA, CGA, far away

IMAGES = {"s": "s", "e23": "e23", "e31": "e31", "e12": "e12", "e0123": "e123i"}
IMAGES |= {f"e0{k}": f"e{k}i" for k in "123"}


def test_the_pendulum_moves_in_conformal_algebra_as_in_projective() -> None:
    """Coefficient by coefficient under e0 → −e∞, and so to rounding."""
    one = hamotor.load("spring_pendulum").run(end=1.0, method="rkmk4")
    other = hamotor.load("conformal_pendulum").run(end=1.0)
    for pga, cga in IMAGES.items():
        here = one.trajectory[f"brick.motor.{pga}"]
        there = other.trajectory[f"brick.motor.{cga}"]
        assert np.abs(here - there).max() <= 1e-13, pga
    for k, name in enumerate(("e1i", "e2i", "e3i")):
        here = one.trajectory[f"brick.momentum.e0{k + 1}"]
        assert np.abs(here - other.trajectory[f"brick.momentum.{name}"]).max() <= 1e-12


def test_two_bodies_of_1e12_kg_move_alike_in_both_algebras(tmp_path: Path) -> None:
    """With constants that no integer of C++ holds, and two bodies that pull at each other."""
    text = (BUNDLED / "double_asteroid.toml").read_text(encoding="utf-8")
    text = text.replace('algebra = "pga3"', 'algebra = "cga3"\ngroup = "SE3"')
    one = hamotor.load("double_asteroid").run(end=20000)
    other = load(text, tmp_path).run(end=20000)
    for body in ("primary", "moon"):
        assert np.ptp(one.position(body), axis=0).max() > 500
        assert np.abs(one.position(body) - other.position(body)).max() <= 1e-12 * 2000
        assert np.abs(one.rotation(body) - other.rotation(body)).max() <= 1e-12


@pytest.mark.parametrize("far", [1e6, 1e8])
def test_far_from_the_origin_the_null_basis_keeps_its_digits(far: float, tmp_path: Path) -> None:
    text = f"""
algebra = "cga3"
group = "SE3"
[[body]]
name = "body"
mass = 1.0
inertia = [0.3, 0.4, 0.5]
position = [{far}, {-0.5 * far}, {0.25 * far}]
orientation = {{ quaternion = [0.4, -0.2, 0.4, 0.8] }}
angular_velocity = [0.5, 1.0, -0.7]
[time]
end = 1.0
step = 0.01
"""
    run = load(text, tmp_path).run()
    error = np.abs(run.position() - far * np.array([1, -0.5, 0.25])).max() / far
    assert error <= 1e-14


Sparse = dict[int, float]


def rounded_product(algebra: Algebra, a: Sparse, b: Sparse) -> Sparse:
    """In doubles, as a kernel computes it: each sum rounded term by term."""
    result: Sparse = {}
    for left, x in a.items():
        for right, y in b.items():
            for blade, sign in algebra.blade_product(left, right).items():
                result[blade] = result.get(blade, 0.0) + x * y * float(sign)
    return result


def moved(
    algebra: Algebra, directions: list[int], infinity: list[int], q: Any, x: Any, point: Sparse
) -> Sparse:
    """T R point (T R)~ with T = 1 − ½ x_i e_i∧e∞; e∞ is the sum of the given vectors."""
    rotor = {0: q[0]}
    for (i, j), component in zip(((1, 2), (2, 0), (0, 1)), q[1:], strict=True):
        for blade, sign in algebra.outer(directions[i], directions[j]).items():
            rotor[blade] = -component * float(sign)
    shift = {0: 1.0}
    for direction, distance in zip(directions, x, strict=True):
        for vector in infinity:
            for blade, sign in algebra.outer(direction, vector).items():
                shift[blade] = -0.5 * distance * float(sign)
    motor = rounded_product(algebra, shift, rotor)
    back = {blade: reverse_sign(blade) * value for blade, value in motor.items()}
    return rounded_product(algebra, rounded_product(algebra, motor, point), back)


@pytest.mark.parametrize(("far", "lost"), [(1e6, 2e-5), (1e8, 0.1)])
def test_a_basis_with_e_plus_and_e_minus_would_lose_them(far: float, lost: float) -> None:
    """e∞ = e₊ + e₋: x²/2 stands in both, and the point's weight 1 is what they differ by."""
    null = bundled_algebra("cga3").algebra
    squares = tuple(tuple((i == j) * (-1 if i == 4 else 1) for j in range(5)) for i in range(5))
    orthonormal = Algebra("orthonormal", ("1", "2", "3", "p", "m"), squares)
    vectors = [1 << k for k in range(5)]
    drawn = np.random.default_rng(1)
    errors = {"null": 0.0, "orthonormal": 0.0}
    for _ in range(20):
        q = drawn.standard_normal(4)
        q /= np.linalg.norm(q)
        x, place = far * drawn.uniform(-1, 1, 3), drawn.uniform(-1, 1, 3)
        expected = x + turned(list(q)).astype(np.float64) @ place
        half = 0.5 * float(place @ place)
        point = dict(zip(vectors, [1.0, *place, half], strict=True))
        image = moved(null, vectors[1:4], vectors[4:], q, x, point)
        found = np.array([image[v] for v in vectors[1:4]]) / image[vectors[0]]
        errors["null"] = max(errors["null"], np.abs(found - expected).max() / far)
        point = dict(zip(vectors, [*place, half - 0.5, half + 0.5], strict=True))
        image = moved(orthonormal, vectors[:3], vectors[3:], q, x, point)
        with np.errstate(divide="ignore"):
            weight = np.float64(image[vectors[4]] - image[vectors[3]])
            found = np.array([image[v] for v in vectors[:3]]) / weight
        errors["orthonormal"] = max(errors["orthonormal"], np.abs(found - expected).max() / far)
    assert errors["null"] <= 1e-15
    assert errors["orthonormal"] >= lost


def test_runs_on_a_group_that_bends_lines_have_no_rotation() -> None:
    run = hamotor.load("conformal_top").run(end=0.5)
    assert run.final["top"]["rotation"] is None
    with pytest.raises(hamotor.UsageError, match="does not keep lines straight"):
        run.rotation()


def test_the_last_state_of_a_similarity_has_its_size() -> None:
    run = hamotor.load("breathing_body").run(end=0.5)
    assert run.final["ball"]["scale"] == run.scale()[-1] != 1
    assert isinstance(read_scene("breathing_body"), GeneralScene)
