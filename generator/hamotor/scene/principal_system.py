"""The Hamiltonian of a rigid scene in its bodies' principal frames, where steppers see it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

import sympy

from hamotor.mechanics import interactions
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.hamiltonian import Hamiltonian
from hamotor.mechanics.system import System
from hamotor.scene.exact import rounded, short
from hamotor.scene.model import Body, Scene


def principal_system(scene: Scene) -> System:
    """T is a sum of squares; places of the user's body frames are told in principal ones."""
    given = [body.coordinates for body in scene.general.bodies]
    bodies = tuple(Coordinates(c.body, c.algebra, c.group, c.prefix, c.pivot) for c in given)
    pairs = list(zip(scene.bodies, bodies, strict=True))
    energy = sympy.Add(*(_kinetic(body, c) for body, c in pairs))
    if scene.gravity is not None:
        field = _numbers(scene.gravity)
        energy += sympy.Add(
            *(
                interactions.uniform_gravity(
                    c, _number(body.mass), _seen(body, body.center_of_mass), field
                )
                for body, c in pairs
            )
        )
    of = {body.name: (body, c) for body, c in pairs}
    for spring in scene.springs:
        body, c = of[spring.body]
        near = c.at(_seen(body, spring.at))
        if spring.other is None:
            far = _numbers(spring.anchor or ())
        else:
            other, there = of[spring.other]
            far = there.at(_seen(other, spring.other_at or ()))
        energy += interactions.spring(
            near, far, _number(spring.stiffness), _number(spring.rest_length)
        )
    parameters = {}
    if scene.potential is not None:
        replaced: dict[Expr, Expr] = {}
        for own, user, (_, c) in zip(scene.bodies, given, pairs, strict=True):
            replaced |= _places(own, user, c, scene.potential.energy.free_symbols)
        energy += scene.potential.energy.xreplace(replaced)
        parameters = dict(scene.potential.parameters)
    return System(Hamiltonian(bodies, energy, parameters))


def _number(x: float | Fraction) -> Expr:
    exact = short(x)
    return sympy.Rational(exact.numerator, exact.denominator)


def _numbers(values: Iterable[float | Fraction]) -> tuple[Expr, ...]:
    return tuple(map(_number, values))


def _seen(body: Body, point: Sequence[float]) -> tuple[Expr, ...]:
    """A point of the user's body frame in the principal one."""
    return _numbers(body.principal.from_body_frame(point))


def _kinetic(body: Body, c: Coordinates) -> Expr:
    """½ Σ Π²/J + ½ |P|²/m."""
    moments = _numbers(body.principal.moments)
    inertia = [*moments, *[_number(body.mass)] * (len(c.momenta) - len(moments))]
    return sympy.Add(*(p**2 / (2 * j) for p, j in zip(c.momenta, inertia, strict=True)))


def _places(body: Body, user: Coordinates, c: Coordinates, held: set[Expr]) -> dict[Expr, Expr]:
    """What of a user's frame stands in a potential, in variables of the principal one.

    X_user = A X + c, so that R_user = R Aᵀ and M_user = M N~.
    """
    axes = [_numbers(row) for row in body.principal.exact_axes]
    found: dict[Expr, Expr] = {}
    d = range(c.dimension)
    for j in d:
        for k in d:
            if user.rotation[j][k] in held:
                found[user.rotation[j][k]] = sympy.Add(*(c.rotation[j][n] * axes[k][n] for n in d))
    for point in user.points_in(held):
        at = _seen(body, [rounded(Fraction(int(x.p), int(x.q))) for x in point.place])
        found |= dict(zip(point.symbols, c.at(at), strict=True))
    if held & set(user.motor):
        back = _motor_back(body, c)
        found |= dict(zip(user.motor, back, strict=True))
    return found


def _motor_back(body: Body, c: Coordinates) -> list[Expr]:
    """The components of M N~."""
    from hamotor.codegen.algebra import reverse_sign

    components = c.group.element.components
    reverse: dict[int, Expr] = {}
    for x, component in zip(_numbers(body.principal.motor), components, strict=True):
        for blade, y in component.embedding.items():
            reverse[blade] = reverse.get(blade, 0) + reverse_sign(blade) * x * _exact(y)
    total: dict[int, Expr] = {}
    for symbol, component in zip(c.motor, components, strict=True):
        for blade, x in component.embedding.items():
            for other, y in reverse.items():
                for product, z in c.algebra.blade_product(blade, other).items():
                    total[product] = total.get(product, 0) + _exact(x) * _exact(z) * symbol * y
    return [
        sympy.Add(*(_exact(x) * total.get(blade, 0) for blade, x in reading.items()))
        for reading in c.group.element.reading
    ]


def _exact(x: object) -> Expr:
    return sympy.Rational(x.numerator, x.denominator)  # type: ignore[attr-defined]
