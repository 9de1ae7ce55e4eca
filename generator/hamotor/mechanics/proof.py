"""The programs of a system against its Hamiltonian: what is checked before anything is compiled."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

import mpmath

from hamotor.codegen.algebra import Blade
from hamotor.mechanics.coordinates import Coordinates
from hamotor.mechanics.dual import Dual, dual_functions
from hamotor.mechanics.states import (
    DIGITS,
    Number,
    State,
    Undefined,
    coadjoint,
    largest,
    momentum_values,
    motor_values,
    random_states,
    real,
)
from hamotor.mechanics.straightline import straight_line
from hamotor.mechanics.system import System

AGREEMENT = mpmath.mpf(10) ** -40
"""Of two derivatives, relative to the largest of the terms that they stand among."""


def prove_energy_balance(system: System) -> None:
    """Show that steppers compute a motion with dH/dt = `power`. ValueError if not: our defect.

    Proved, in symbols: ad* does no work (`Hamiltonian.prove_energy_balance`). Tested, at a random
    state in 100 digits to 40: the rates and forques of the gradient program are the derivatives of
    the energy program along μ and along M exp(εE_i), which dual numbers give without any of the
    tables that the forques were derived from; along the whole motion, what is applied and t
    included, the energy program changes by the power program. Where H has no value in any random
    state, nothing is tested.
    """
    system.hamiltonian.prove_energy_balance()
    with mpmath.workdps(DIGITS), suppress(Undefined):
        state = next(random_states(system))
        for k in range(len(system.hamiltonian.bodies)):
            _prove_gradient(system, state, k)
        _prove_power(system, state)


def slopes(system: System, state: State, k: int) -> tuple[list[Number], list[Number]]:
    """∂H/∂μ_i and dH along M exp(εE_i) of body k, by dual numbers."""
    body = system.hamiltonian.bodies[k]
    size = range(len(state.momenta[k]))
    units = [[real(int(i == j)) for j in size] for i in size]
    rates = [energy_slope(system, state, momentum_values(body, k, unit)) for unit in units]
    forques = [
        energy_slope(system, state, motor_values(body, k, moved(body, state, k, unit)))
        for unit in units
    ]
    return rates, forques


def moved(body: Coordinates, state: State, k: int, rate: list[Number]) -> Mapping[Blade, Number]:
    """M B of body k."""
    total: dict[Blade, Number] = {}
    for x, generator in zip(rate, body.group.generators, strict=True):
        if x:
            product = body.algebra.multiply(state.motors[k], generator.bivector)
            for blade, y in product.items():
                total[blade] = total.get(blade, 0) + x * y
    return total


def energy_slope(system: System, state: State, direction: Mapping[str, Number]) -> Number:
    """The derivative of the energy program when what it is given changes in a direction."""
    nothing = mpmath.mpf(0)
    values = {name: Dual(x, direction.get(name, nothing)) for name, x in state.values.items()}
    return system.energy.evaluate(values, dual_functions(state.functions))["value"].slope


def _prove_gradient(system: System, state: State, k: int) -> None:
    body = system.hamiltonian.bodies[k]
    rates, forques = slopes(system, state, k)
    _require(state.rates[k], rates, largest(rates), f"rate of {body.body}")
    expected = [f + a for f, a in zip(forques, applied(system, state, k), strict=True)]
    _require(state.forques[k], expected, state.size(k), f"forque of {body.body}")


def applied(system: System, state: State, k: int) -> list[Number]:
    """What is applied to body k."""
    h = system.hamiltonian
    if not h.applied:
        return [mpmath.mpf(0)] * len(state.momenta[k])
    outputs = {str(i): x.subs(dict(h.parameters)) for i, x in enumerate(h.applied[k])}
    program = straight_line(outputs, system.names, system.places)
    return list(program.evaluate(state.values, state.functions).values())


def _prove_power(system: System, state: State) -> None:
    direction = {"t": mpmath.mpf(1)}
    sizes = []
    for k, body in enumerate(system.hamiltonian.bodies):
        rate, forque = state.rates[k], state.forques[k]
        turning = coadjoint(body, rate, state.momenta[k])
        change = [c - f for c, f in zip(turning, forque, strict=True)]
        direction |= motor_values(body, k, moved(body, state, k, rate))
        direction |= momentum_values(body, k, change)
        sizes.append(largest(rate) * state.size(k))
    power = system.power.evaluate(state.values, state.functions)["value"]
    found = energy_slope(system, state, direction)
    if abs(found - power) > AGREEMENT * max(*sizes, abs(power)):
        raise ValueError(f"dH/dt is {mpmath.nstr(found)} where the power is {mpmath.nstr(power)}")


def _require(found: list[Number], expected: list[Number], size: Number, what: str) -> None:
    for i, (x, y) in enumerate(zip(found, expected, strict=True)):
        if abs(x - y) > AGREEMENT * size:
            raise ValueError(f"{what}, component {i}: {mpmath.nstr(x)}, dH gives {mpmath.nstr(y)}")
