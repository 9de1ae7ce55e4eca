"""Which quantities the exact motion under a Hamiltonian keeps constant.

* The energy, if H does not know the time and nothing is applied. Otherwise a run reports the
  balance H − ∫ P dt, P = `Hamiltonian.power`, which no motion changes either.
* Total spatial momenta: with ζ constant in the world, Σ (M μ M~)(ζ) changes by −Σ F_s(ζ), what is
  applied included and the sum over the bodies (Noether's theorem). All ζ are found for which this
  vanishes in every state.
* A body's own momenta: all ζ constant in its frame with μ̇(ζ) = (ad*_B μ − F_b)(ζ) = 0 in every
  state, such as that of a symmetric top about its axis. One that every motion of the group leaves
  as it is would, with a single body, be its spatial momentum again, and is left out.
* Casimirs C of a body: dC/dt = −Σ ∂C/∂μ_i F_b,i, since ad* does not change them.

Candidates come from numbers: the program that steppers run is evaluated with 100 digits at random
states, one more than there could be independent conditions, and the null space is read off by
elimination. Coefficients are the rationals with the smallest denominators that agree to 50 digits,
where there are such. What is reported holds at three more random states to 1e-35 of the forques
(*tested*: what is false there by less would pass; in exchange a symmetry survives constants that
were rounded to 60 digits). It is *proved* where its rate of change expands to zero in SymPy, as a
function of independent x, y, R, s, μ and t; then it holds without any tolerance. That is not tried
for spatial momenta where something is applied, nor where too many terms could arise.

Roots, logarithms and the like are continued to complex numbers beyond their domains, where what
holds as an identity still holds. Absolute values count with either sign in every state, so that
what only one of their branches conserves is not found. Where H has no value in any random state,
nothing but the energy is reported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from typing import Any, Literal

import mpmath
import sympy

from hamotor.codegen.algebra import Blade, reverse_sign
from hamotor.codegen.polynomial import Polynomial
from hamotor.codegen.program import Program
from hamotor.mechanics.coordinates import Coordinates, Expr
from hamotor.mechanics.echelon import null_space
from hamotor.mechanics.hamiltonian import Hamiltonian
from hamotor.mechanics.naming import Generators
from hamotor.mechanics.states import (
    DIGITS,
    Number,
    State,
    Undefined,
    coadjoint,
    largest,
    paired,
    random_states,
    real,
)
from hamotor.mechanics.straightline import straight_line
from hamotor.mechanics.system import System

NEGLIGIBLE = mpmath.mpf(10) ** -45
"""Of the size of the forques: less is no condition on a symmetry."""
AGREEMENT = mpmath.mpf(10) ** -35
RECOGNISED = Fraction(1, 10**50)
MOST_DENOMINATOR = 10**20
CHECKS = 3
MOST_ATTEMPTS = 20
MOST_TERMS_PROVED = 3_000
"""A rate of change that may have more terms is not expanded: it could take longer than the run."""

Matrix = list[list[Number]]


@dataclass(frozen=True)
class Conserved:
    """A quantity that the exact motion keeps constant."""

    name: str
    """Of its column: `energy`, `spatial_momentum.e12`, `BODY.momentum.e12`, `BODY.casimir.NAME`."""
    unit: str
    description: str
    kind: Literal["energy", "energy_balance", "spatial_momentum", "own"]
    proved: bool
    """Symbolically; otherwise tested in random states."""
    coefficients: tuple[tuple[str, Fraction], ...] = ()
    """A spatial momentum: Σ coefficient · component along the generator; leading coefficient 1."""
    body: str = ""
    """Whose own quantity it is."""
    expression: Expr = sympy.S.Zero
    """An own quantity in the body's momentum symbols."""


def conserved(hamiltonian: Hamiltonian, system: System | None = None) -> tuple[Conserved, ...]:
    """The energy or its balance, spatial momenta, own momenta and Casimirs that are constant.

    system: the programs of the Hamiltonian, if they are there already. What they leave open of
        the parameters may have any value.
    """
    system = system or System(hamiltonian)
    found = [_energy(hamiltonian)]
    count = len(hamiltonian.group.generators) + 1 + CHECKS
    with mpmath.workdps(DIGITS), suppress(Undefined):
        states = list(islice(random_states(system), count))
        adjoints = [
            [
                _adjoint(body, motor)
                for body, motor in zip(hamiltonian.bodies, s.motors, strict=True)
            ]
            for s in states
        ]
        found += _spatial_momenta(system, states, adjoints)
        for k in range(len(hamiltonian.bodies)):
            found += _own_momenta(system, states, k)
            found += _casimirs(system, states, k)
    return tuple(found)


def _energy(hamiltonian: Hamiltonian) -> Conserved:
    if hamiltonian.conservative:
        words = "kinetic and potential energy of all bodies"
        return Conserved("energy", "J", words, "energy", proved=True)
    words = "energy minus the work done by applied forques and explicit time dependence"
    return Conserved("energy_balance", "J", words, "energy_balance", proved=True)


def _spatial_momenta(
    system: System, states: Sequence[State], adjoints: Sequence[Sequence[Matrix]]
) -> list[Conserved]:
    hamiltonian = system.hamiltonian
    called = Generators.of(hamiltonian.bodies[0])
    units = dict(zip(called.names, hamiltonian.group.momentum_units, strict=True))
    quantities = []
    for element in _constants(
        [_spatial_change(s, a) for s, a in zip(states, adjoints, strict=True)]
    ):
        terms = [(g, x) for g, x in zip(called.names, element, strict=True) if x != 0]
        suffix, description = called.reading(element)
        quantities.append(
            Conserved(
                name=f"spatial_momentum.{terms[0][0]}{suffix}",
                unit=units[terms[0][0]],
                description=description,
                kind="spatial_momentum",
                proved=not any(map(any, hamiltonian.applied))
                and _vanishes(
                    system,
                    [
                        (x, forque[i])
                        for forque in hamiltonian.spatial_forques
                        for i, x in enumerate(element)
                    ],
                ),
                coefficients=tuple(terms),
            )
        )
    return quantities


def _own_momenta(system: System, states: Sequence[State], k: int) -> list[Conserved]:
    hamiltonian = system.hamiltonian
    body = hamiltonian.bodies[k]
    called = Generators.of(body)
    units = dict(zip(called.names, body.group.momentum_units, strict=True))
    alone = len(hamiltonian.bodies) == 1
    quantities = []
    for element in _constants([_own_change(body, s, k) for s in states]):
        if alone and _is_central(body, element):
            continue
        terms = [(g, x) for g, x in zip(called.names, element, strict=True) if x != 0]
        suffix, description = called.reading(element, body.body)
        rates = hamiltonian.momentum_rates[k]
        quantities.append(
            Conserved(
                name=f"{body.body}.momentum.{terms[0][0]}{suffix}",
                unit=units[terms[0][0]],
                description=description,
                kind="own",
                proved=_vanishes(system, list(zip(element, rates, strict=True))),
                body=body.body,
                expression=sympy.Add(
                    *(_exact(x) * p for x, p in zip(element, body.momenta, strict=True))
                ),
            )
        )
    return quantities


def _casimirs(system: System, states: Sequence[State], k: int) -> list[Conserved]:
    hamiltonian = system.hamiltonian
    body = hamiltonian.bodies[k]
    momenta = {g.momentum: p for g, p in zip(body.group.generators, body.momenta, strict=True)}
    names = {p: f"mu{k}.{name}" for name, p in momenta.items()}
    forques = hamiltonian.all_forques[k]
    quantities = []
    for casimir in body.group.casimirs:
        if all(len(monomial) == 1 for monomial in casimir.numerator):
            continue  # one of the body's own momenta
        expression = _polynomial(casimir.numerator, momenta) / _polynomial(
            casimir.denominator, momenta
        )
        slopes = [sympy.diff(expression, p) for p in body.momenta]
        program = straight_line({str(i): x for i, x in enumerate(slopes)}, names)
        if not any(forques) or all(_is_level(program, s, k) for s in states):
            quantities.append(
                Conserved(
                    name=f"{body.body}.casimir.{casimir.name}",
                    unit=casimir.unit,
                    description=f"{casimir.formula} of {body.body}",
                    kind="own",
                    proved=_vanishes(system, list(zip(slopes, forques, strict=True))),
                    body=body.body,
                    expression=expression,
                )
            )
    return quantities


def _polynomial(polynomial: Polynomial, symbols: Mapping[str, Expr]) -> Expr:
    return sympy.Add(
        *(
            sympy.Rational(x.numerator, x.denominator) * sympy.Mul(*(symbols[n] for n in names))
            for names, x in polynomial.items()
        )
    )


def _vanishes(system: System, terms: Sequence[tuple[Any, Expr]]) -> bool:
    """Whether Σ coefficient · expression expands to zero, variables taken as independent."""
    total = sympy.Add(*(_exact(x) * expression for x, expression in terms if x and expression))
    if total == 0:
        return True
    if _most_terms(total) > MOST_TERMS_PROVED:
        return False
    total = sympy.expand(total.subs(system.values))
    if total == 0:
        return True
    numerator = sympy.numer(sympy.together(total))
    return bool(_most_terms(numerator) <= MOST_TERMS_PROVED and sympy.expand(numerator) == 0)


def _most_terms(expression: Expr) -> float:
    """How many terms an expression has at most when it is expanded, inside functions too."""
    if not expression.args:
        return 1
    parts = [_most_terms(x) for x in expression.args]
    if expression.is_Mul:
        return math.prod(parts)
    if expression.is_Pow and expression.exp.is_Integer:
        power = abs(int(expression.exp))
        return math.comb(min(int(parts[0]), MOST_TERMS_PROVED) + power - 1, power)
    return sum(parts)


def _exact(x: Any) -> Expr:
    return sympy.Rational(x.numerator, x.denominator) if isinstance(x, Fraction) else x


def _constants(changes: Sequence[tuple[Sequence[Number], Number]]) -> list[list[Fraction]]:
    """All ζ for which change·ζ vanishes in every state; the last `CHECKS` states are tests.

    changes: how fast each component changes, and the size of the terms that make it up.
    """
    rows = [[x / size for x in change] if size else list(change) for change, size in changes]
    basis = null_space(rows[:-CHECKS], len(rows[0]), mpmath.mpf(1), NEGLIGIBLE)
    return [
        element
        for element in ([_recognised(x) for x in vector] for vector in basis)
        if all(abs(_paired(row, element)) <= AGREEMENT for row in rows[-CHECKS:])
    ]


def _paired(row: Sequence[Number], element: Sequence[Fraction]) -> Number:
    """row·element, the element taken to have size 1."""
    return sum(x * y for x, y in zip(row, element, strict=True)) / real(largest(element))


def _recognised(x: Number) -> Fraction:
    x = mpmath.re(x)
    mantissa, exponent = x.man_exp
    exact = Fraction(int(mpmath.sign(x)) * int(mantissa)) * Fraction(2) ** int(exponent)
    simple = exact.limit_denominator(MOST_DENOMINATOR)
    return simple if abs(simple - exact) <= RECOGNISED * max(Fraction(1), abs(exact)) else exact


def _spatial_change(state: State, adjoints: Sequence[Matrix]) -> tuple[list[Number], Number]:
    """Σ F_s, for each generator of the world F_b of what M~ makes of it; and its terms' size."""
    change = [
        sum(
            x * f
            for adjoint, forque in zip(adjoints, state.forques, strict=True)
            for x, f in zip(adjoint[j], forque, strict=True)
        )
        for j in range(len(state.forques[0]))
    ]
    sizes = (state.size(k) * max(map(largest, adjoint)) for k, adjoint in enumerate(adjoints))
    return change, max(sizes)


def _adjoint(body: Coordinates, motor: Mapping[Blade, Number]) -> Matrix:
    """Row j: M~ E_j M in the generators."""
    reverse: Any = {blade: reverse_sign(blade) * x for blade, x in motor.items()}
    rows = []
    for generator in body.group.generators:
        half = body.algebra.multiply(reverse, generator.bivector)
        moved = body.algebra.multiply(half, motor)
        rows.append([paired(reading, moved) for reading in body.group.rate.reading])
    return rows


def _own_change(body: Coordinates, state: State, k: int) -> tuple[list[Number], Number]:
    """μ̇ of body k, and its terms' size."""
    turning = coadjoint(body, state.rates[k], state.momenta[k])
    return [c - f for c, f in zip(turning, state.forques[k], strict=True)], state.size(k)


def _is_central(body: Coordinates, element: Sequence[Fraction]) -> bool:
    """Whether [ζ, E_i] = 0 for all generators."""
    size = range(len(element))
    return not any(
        sum(x * row[i][k] for x, row in zip(element, body.group.structure, strict=True))
        for i in size
        for k in size
    )


def _is_level(slopes: Program, state: State, k: int) -> bool:
    """Whether ∂C/∂μ · F_b vanishes for body k."""
    found = list(slopes.evaluate(state.values, state.functions).values())
    change = sum(x * f for x, f in zip(found, state.forques[k], strict=True))
    return bool(abs(change) <= AGREEMENT * largest(found) * state.size(k))
