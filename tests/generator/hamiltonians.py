"""Hamiltonians of every kind, which several tests share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy

from hamotor.codegen import bundled_algebras, read_algebra
from hamotor.codegen.spec import bundled_path
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.hamiltonian import TIME, Hamiltonian
from hamotor.scene import bundled_scenes, read_scene

Q = sympy.Rational
ZERO = sympy.Integer(0)
GROUPS = [
    (name, group.name)
    for name in bundled_algebras()
    for group in read_algebra(bundled_path(name)).groups
]


def body_on(algebra: str, group: str, name: str = "body", prefix: str = "") -> Coordinates:
    spec = read_algebra(bundled_path(algebra))
    found = next(g for g in spec.groups if g.name == group)
    return Coordinates(name, spec.algebra, found, prefix)


def place(*numbers: str | int) -> tuple[Any, ...]:
    return tuple(Q(x) for x in numbers)


def free(body: Coordinates, *inertia: Any) -> Any:
    """Σ μ_i²/2J_i."""
    return sum(p**2 / (2 * Q(j)) for p, j in zip(body.momenta, inertia, strict=True))


def coupled(body: Coordinates) -> Any:
    """½ μ A μ with a full matrix A."""
    mu = body.momenta
    return sum(
        a * b * Q(1 + 7 * int(i == j), 3 + i + j)
        for i, a in enumerate(mu)
        for j, b in enumerate(mu)
    )


def dot(a: Any, b: Any) -> Any:
    return sum(x * y for x, y in zip(a, b, strict=True))


def difference(a: Any, b: Any) -> tuple[Any, ...]:
    return tuple(x - y for x, y in zip(a, b, strict=True))


def spring(near: Any, far: Any, stiffness: Any, rest: Any) -> Any:
    apart = difference(near, far)
    return stiffness * (sympy.sqrt(dot(apart, apart)) - rest) ** 2 / 2


def heavy_top(*inertia: str) -> Hamiltonian:
    body = body_on("cl3", "SO3", "top")
    return Hamiltonian((body,), free(body, *inertia) + Q("0.98") * body.at(place(0, 0, "0.05"))[2])


def gravity_and_spring(algebra: str) -> Hamiltonian:
    body = body_on(algebra, "SE3", "brick")
    corner = body.at(place("0.05", "0.1", "0.15"))
    energy = free(body, 2, 3, 5, "0.5", "0.5", "0.5") + Q("4.905") * body.position[2]
    stiffness = sympy.Symbol("stiffness", real=True)
    energy += spring(corner, place(1, "0.2", -1), stiffness, Q("0.5"))
    return Hamiltonian((body,), energy, {stiffness: Q(20)})


def two_bodies() -> Hamiltonian:
    a, b = (body_on("pga3", "SE3", name, f"{name}.") for name in ("wheel", "hammer"))
    near, far = a.at(place("0.3", 0, 0)), b.at(place(0, "0.2", "0.05"))
    apart = difference(a.position, b.position)
    energy = free(a, 2, 2, 3, 2, 2, 2) + coupled(b) + spring(near, far, Q(15), Q("0.4"))
    return Hamiltonian((a, b), energy - 3 / sympy.sqrt(dot(apart, apart)))


def kirchhoff() -> Hamiltonian:
    """A bottom-heavy body in an ideal fluid: buoyancy and weight make a couple."""
    body = body_on("pga3", "SE3", "hull")
    upright = body.turned(place("0.1", "-0.2", 1))[2]
    return Hamiltonian((body,), coupled(body) - Q("1.3") * upright)


def dipole() -> Hamiltonian:
    """A magnetic dipole in the field of another at the origin."""
    body = body_on("pga3", "SE3", "magnet")
    x, moment = body.position, body.turned(place(1, 2, "0.5"))
    source = place(0, "0.3", 1)
    r = sympy.sqrt(dot(x, x))
    field = [3 * dot(source, x) * y / r**5 - m / r**3 for y, m in zip(x, source, strict=True)]
    return Hamiltonian((body,), free(body, 1, 2, 3, 2, 2, 2) - dot(moment, field))


def conformal_body() -> Hamiltonian:
    """H = p²/2m + Σ π_k²/2J_k + π0²/2J0."""
    body = body_on("cga3", "Sim3")
    return Hamiltonian((body,), free(body, 1, 2, 3, 2, 2, 2, "0.7"))


def breathing_body() -> Hamiltonian:
    """x = r + s R X with an elastic potential in s, under gravity."""
    body = body_on("cga3", "Sim3")
    s = body.scale
    energy = free(body, 1, 2, 3, 2, 2, 2, "0.7") / s**2 + 5 * (s - 1) ** 2 - sympy.log(s)
    return Hamiltonian((body,), energy + Q("9.81") * body.at(place("0.1", 0, "0.3"))[2])


def full_conformal(*, with_potential: bool) -> Hamiltonian:
    body = body_on("cga3", "SO41")
    energy = coupled(body)
    if with_potential:
        y = body.at(place(0, "0.1", "0.2"))
        energy += 2 * dot(y, y) + y[2]
    return Hamiltonian((body,), energy)


def not_quadratic() -> Hamiltonian:
    """A relativistic kinetic energy and functions of every kind, of the time too."""
    body = body_on("pga3", "SE3")
    momenta, (x, y, z) = body.momenta, body.position
    energy = sympy.sqrt(1 + dot(momenta[3:], momenta[3:])) + free(body, 1, 2, 3, 9, 9, 9) ** 2
    energy += sympy.exp(-x / 3) + sympy.atan2(y, x) * sympy.cosh(z / 2) + sympy.tanh(momenta[0])
    energy += sympy.sin(3 * TIME + z) * sympy.cos(y) + sympy.Abs(x - y) ** 3
    return Hamiltonian((body,), energy + sympy.asin(body.rotation[0][2] / 3) + body.motor[3] ** 2)


def damped_and_driven() -> Hamiltonian:
    body = body_on("pga2", "SE2")
    energy = free(body, 1, 2, 2) + spring(body.at(place("0.1", 0)), place(1, 1), Q(3), Q(1, 2))
    drag = tuple(p / 10 for p in body.momenta)
    thrust = (sympy.cos(TIME), body.rotation[0][0] * body.position[1], ZERO)
    return Hamiltonian(
        (body,), energy, {}, (tuple(a - b for a, b in zip(drag, thrust, strict=True)),)
    )


def of_group(algebra: str, group: str) -> Hamiltonian:
    body = body_on(algebra, group)
    return Hamiltonian((body,), coupled(body))


HAMILTONIANS: dict[str, Callable[[], Hamiltonian]] = {
    **{f"free {a} {g}": lambda a=a, g=g: of_group(a, g) for a, g in GROUPS},  # type: ignore[misc]
    **{f"scene {n}": lambda n=n: read_scene(n).hamiltonian for n, _ in bundled_scenes()},  # type: ignore[misc]
    "symmetric heavy top": lambda: heavy_top("0.2", "0.2", "0.1"),
    "asymmetric heavy top": lambda: heavy_top("0.2", "0.3", "0.1"),
    "gravity and spring": lambda: gravity_and_spring("pga3"),
    "gravity and spring, conformal": lambda: gravity_and_spring("cga3"),
    "two bodies": two_bodies,
    "Kirchhoff": kirchhoff,
    "dipole": dipole,
    "conformal body": conformal_body,
    "breathing body": breathing_body,
    "full conformal": lambda: full_conformal(with_potential=False),
    "full conformal in a potential": lambda: full_conformal(with_potential=True),
    "not quadratic": not_quadratic,
    "damped and driven": damped_and_driven,
}
