"""Hamiltonians in numbers: where bodies are at a motor, and momenta of given rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mpmath
import sympy

from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.hamiltonian import TIME, Hamiltonian

DIGITS = 40
MOST_ITERATIONS = 50


def evaluated(expression: Expr, known: Mapping[Expr, Expr]) -> Expr:
    """The expression with numbers for its symbols, by mpmath at its current precision."""
    symbols = tuple(s for s in known if s in expression.free_symbols)
    return mpmath.mpf(sympy.lambdify(symbols, expression, "mpmath")(*(known[s] for s in symbols)))


def places(body: Coordinates, motor: Sequence[Expr]) -> dict[Expr, Expr]:
    """The motor's components, the frame's variables and the points at this motor."""
    known = {s: mpmath.mpf(x) for s, x in zip(body.motor, motor, strict=True)}
    for variable in body.frame_variables:
        known[variable.symbol] = evaluated(variable.definition, known)
    for point in body.points:
        for symbol, definition in zip(point.symbols, body.definition(point), strict=True):
            known[symbol] = evaluated(definition, known)
    return known


def momenta_of_rates(
    hamiltonian: Hamiltonian, motors: Sequence[Sequence[float]], rates: Sequence[Sequence[float]]
) -> tuple[tuple[float, ...], ...] | None:
    """μ of every body with ∂H/∂μ = B at t = 0, by Newton's method from μ = 0.

    None where it finds none: H has no momentum of these rates, or is not regular there.
    """
    symbols = [p for body in hamiltonian.bodies for p in body.momenta]
    wanted = [mpmath.mpf(x) for rate in rates for x in rate]
    gradient = [rate for body_rates in hamiltonian.rates for rate in body_rates]
    with mpmath.workdps(DIGITS):
        close = mpmath.mpf(10) ** (8 - DIGITS) * (1 + max(map(abs, wanted)))
        known: dict[Expr, Expr] = {TIME: mpmath.mpf(0)}
        for symbol, value in hamiltonian.parameters.items():
            known[symbol] = mpmath.mpf(value.p) / value.q
        for body, motor in zip(hamiltonian.bodies, motors, strict=True):
            known |= places(body, motor)
        slopes = sympy.lambdify(
            [*known, *symbols],
            [gradient, [[sympy.diff(g, p) for p in symbols] for g in gradient]],
            "mpmath",
            cse=True,
        )
        momenta = [mpmath.mpf(0)] * len(symbols)
        for _ in range(MOST_ITERATIONS):
            try:
                value, matrix = slopes(*known.values(), *momenta)
                miss = mpmath.matrix([b - g for b, g in zip(wanted, value, strict=True)])
                if max(map(abs, miss)) <= close:
                    break
                step = mpmath.lu_solve(mpmath.matrix(matrix), miss)
            except (ZeroDivisionError, ValueError, TypeError):
                return None
            momenta = [p + d for p, d in zip(momenta, step, strict=True)]
        else:
            return None
        numbers = iter(float(p) for p in momenta)
    return tuple(tuple(next(numbers) + 0.0 for _ in body.momenta) for body in hamiltonian.bodies)
