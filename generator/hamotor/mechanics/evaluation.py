"""Numbers for symbols: where bodies are, what expressions are there, momenta for rates."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any

import mpmath
import sympy

from hamotor.errors import UsageError
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.hamiltonian import TIME, Hamiltonian

Numbers = Sequence[Any]
Values = dict[Expr, Any]
MOST_STEPS = 200
"""Of Newton's method; near its solution it needs five."""
MOST_HALVINGS = 60
DIGITS = 70
"""Of momenta at the start, ten of them for rounding."""


def values_of(parameters: Mapping[Expr, Any], time: Any = 0) -> Values:
    """Parameters and the time as numbers of mpmath's precision."""
    return {TIME: mpmath.mpf(time)} | {s: number(x) for s, x in parameters.items()}


def number(value: Any) -> Any:
    """A number, a fraction or a rational of SymPy in mpmath's precision."""
    if isinstance(value, Fraction):
        return mpmath.mpf(value.numerator) / value.denominator
    if getattr(value, "is_Rational", False):
        return mpmath.mpf(int(value.p)) / int(value.q)
    return mpmath.mpf(value)


def place(body: Coordinates, motor: Numbers, known: Values) -> Values:
    """`known`, and where the body is: its motor, and the variables and points that follow."""
    found = known | dict(zip(body.motor, map(number, motor), strict=True))
    for variable in body.frame_variables:
        (found[variable.symbol],) = evaluated([variable.definition], found)
    for point in body.points:
        found |= dict(zip(point.symbols, evaluated(body.definition(point), found), strict=True))
    return found


def evaluated(expressions: Sequence[Expr], values: Values) -> list[Any]:
    """The expressions in mpmath's precision; complex or not finite outside their domain."""
    symbols = tuple(values)
    try:
        found = _function(tuple(expressions), symbols)(*values.values())
    except (ZeroDivisionError, OverflowError):
        return [mpmath.nan] * len(expressions)
    return [number(x) if isinstance(x, int | sympy.Expr) else x for x in found]


@lru_cache(maxsize=256)
def _function(expressions: tuple[Expr, ...], symbols: tuple[Expr, ...]) -> Callable[..., Any]:
    function: Callable[..., Any] = sympy.lambdify(symbols, expressions, "mpmath", cse=True)
    return function


def is_real(numbers: Sequence[Any]) -> bool:
    """Whether all are real and finite."""
    return all(isinstance(x, mpmath.mpf) and mpmath.isfinite(x) for x in numbers)


def random_motor(body: Coordinates, drawn: random.Random) -> list[Any]:
    """The components of a product of exponentials of the generators, |coefficients| ≤ 1."""
    algebra, motor = body.algebra, {0: mpmath.mpf(1)}

    def product(a: dict[int, Any], b: dict[int, Any]) -> dict[int, Any]:
        total: dict[int, Any] = {}
        for left, x in a.items():
            for right, y in b.items():
                for blade, z in algebra.blade_product(left, right).items():
                    total[blade] = total.get(blade, 0) + x * y * int(z)
        return total

    for generator in body.group.generators:
        factor = mpmath.mpf(drawn.uniform(-1, 1))
        step = {b: factor * x.numerator / x.denominator for b, x in generator.bivector.items()}
        term = total = {0: mpmath.mpf(1)}
        for k in range(1, 2 * mpmath.mp.dps):
            term = {blade: x / k for blade, x in product(term, step).items()}
            total = {b: total.get(b, 0) + term.get(b, 0) for b in {**total, **term}}
        motor = product(motor, total)
    return [
        sum((motor.get(b, 0) * x.numerator / x.denominator for b, x in row.items()), mpmath.mpf(0))
        for row in body.group.element.reading
    ]


def solved(
    residual: Callable[[Numbers], list[Any]], jacobian: Callable[[Numbers], Any], start: Numbers
) -> list[Any] | None:
    """A zero by Newton's method, steps halved while the residual does not shrink.

    None where it is not found: the Jacobian is singular, or steps no longer help.
    """
    x, tolerance = list(start), mpmath.mpf(10) ** (5 - mpmath.mp.dps)
    error = residual(x)
    if not is_real(error):
        return None
    for _ in range(MOST_STEPS):
        if not any(error):
            return x
        try:
            step = mpmath.lu_solve(jacobian(x), mpmath.matrix(error))
        except ZeroDivisionError:
            return None
        factor = mpmath.mpf(1)
        for _ in range(MOST_HALVINGS):
            trial = [a - factor * b for a, b in zip(x, step, strict=True)]
            left = residual(trial)
            if is_real(left) and mpmath.norm(left) <= (1 - factor / 4) * mpmath.norm(error):
                break
            factor /= 2
        else:
            small = mpmath.norm(step) <= tolerance * (1 + mpmath.norm(x))
            return x if small else None
        x, error = trial, left
    return None


def momentum_of_rates(
    hamiltonian: Hamiltonian,
    motors: Sequence[Numbers],
    rates: Sequence[Numbers],
    time: float = 0,
) -> tuple[tuple[Any, ...], ...]:
    """μ of each body for which ∂H/∂μ are these rates (physical, body frame), to `DIGITS`.

    motors: the components of each body's M. UsageError where there is no such μ, or none is found.
    """
    bodies = hamiltonian.bodies
    momenta = [p for body in bodies for p in body.momenta]
    slopes = [x for body_rates in hamiltonian.rates for x in body_rates]
    with mpmath.workdps(DIGITS):
        wanted = [number(x) for body_rates in rates for x in body_rates]
        known = values_of(hamiltonian.parameters, time)
        for body, motor in zip(bodies, motors, strict=True):
            known = place(body, motor, known)
        hessian = [sympy.diff(slope, p) for slope in slopes for p in momenta]

        def values(x: Numbers) -> Values:
            return known | dict(zip(momenta, x, strict=True))

        def residual(x: Numbers) -> list[Any]:
            return [a - b for a, b in zip(evaluated(slopes, values(x)), wanted, strict=True)]

        def jacobian(x: Numbers) -> Any:
            size = len(momenta)
            flat = evaluated(hessian, values(x))
            return mpmath.matrix([flat[i : i + size] for i in range(0, size * size, size)])

        drawn = random.Random(1)
        for attempt in range(4):
            start = [mpmath.mpf(drawn.uniform(-1, 1) if attempt else 0) for _ in momenta]
            found = solved(residual, jacobian, start)
            if found is not None:
                numbers = iter(found)
                return tuple(tuple(next(numbers) for _ in body.momenta) for body in bodies)
    shown = ", ".join(
        f"{symbol} = {float(x):g}"
        for symbol, x in zip((w for body in bodies for w in body.rates), wanted, strict=True)
    )
    raise UsageError(f"no momentum has the rates {shown}: ∂H/∂μ does not take these values")
