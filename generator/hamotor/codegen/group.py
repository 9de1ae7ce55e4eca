"""Lie groups of rotors: generators, their dual basis, structure constants, all proved exactly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from hamotor.codegen.algebra import (
    Algebra,
    Blade,
    Multivector,
    Rational,
    add_scaled,
    grade,
    simplest,
)
from hamotor.codegen.casimir import Casimir, unchanged, unit_of, unit_text
from hamotor.codegen.element import Component, Element, inverse_matrix
from hamotor.errors import UsageError


@dataclass(frozen=True)
class Generator:
    """One generator E_a (a bivector) and the names of its rate and momentum coordinates."""

    name: str
    bivector: Mapping[Blade, Rational]
    rate: str
    momentum: str


@dataclass(frozen=True)
class LieGroup:
    """A group of rotors: the element type that holds it and the generators of its Lie algebra.

    dual: the basis T^a of Λ^{n−2} with T^a ∧ E_b = δ I (theory: the wedge-dual basis).
    structure[a][b]: coordinates of [E_a, E_b].
    lean: the functions that are wanted in their lean form, too.
    casimirs: functions of the momentum that Poisson-commute with all of it.
    *_units: SI units of the components of elements, rates and momenta.
    rate_lengths: the power of length in each rate's unit.
    kernels: functions on request, beyond those that every group has.
    """

    name: str
    description: str
    element: Element
    generators: tuple[Generator, ...]
    rate: Element
    momentum: Element
    structure: tuple[tuple[tuple[Rational, ...], ...], ...]
    casimirs: tuple[Casimir, ...]
    element_units: tuple[str, ...]
    rate_units: tuple[str, ...]
    momentum_units: tuple[str, ...]
    rate_lengths: tuple[int, ...]
    lean: tuple[str, ...] = ()
    kernels: tuple[str, ...] = ()


def lie_group(
    algebra: Algebra,
    name: str,
    description: str,
    element: Element,
    generators: tuple[Generator, ...],
    where: str,
    casimirs: tuple[Casimir, ...] = (),
) -> LieGroup:
    """Derive a group from its generators and prove what it must satisfy.

    Raises UsageError, beginning with `where`, if a generator is not a bivector, if the element type
    does not hold the group, if the generators are dependent or do not close under the bracket, if a
    Casimir is none or has terms of different units, or if the pairing is not invariant.
    """
    namespace = name.lower()
    for generator in generators:
        if {grade(b) for b in generator.bivector} != {2}:
            raise UsageError(f"{where}: generator {generator.name} is not a bivector")
    _require_holder(algebra, element, generators, where)
    rate = Element(
        "Rate",
        "w",
        tuple(Component(g.rate, g.bivector) for g in generators),
        {},
        False,
        f"Rate of {name}: element of its Lie algebra in physical coordinates, body frame.",
        namespace,
    )
    momentum = Element(
        "Momentum",
        "mu",
        tuple(
            Component(g.momentum, t)
            for g, t in zip(generators, _dual_basis(algebra, generators, where), strict=True)
        ),
        {},
        False,
        f"Momentum of {name}: element of the dual of its Lie algebra in physical coordinates, "
        "body frame.",
        namespace,
        tuple(_pairing_with(algebra, g.bivector) for g in generators),
    )
    structure = tuple(
        tuple(_bracket(algebra, rate, name, a, b, where) for b in generators) for a in generators
    )
    _prove_invariance(algebra, rate, momentum, structure, where)
    powers = [_length_power(algebra, g) for g in generators]
    return LieGroup(
        name,
        description,
        element,
        generators,
        rate,
        momentum,
        structure,
        tuple(_proved_casimir(c, generators, structure, powers, where) for c in casimirs),
        tuple(
            unit_text(0, algebra.length_power(next(iter(c.embedding))), 0)
            for c in element.components
        ),
        tuple(
            "rad/s" if not power and _turns(algebra, g) else unit_text(0, power, -1)
            for g, power in zip(generators, powers, strict=True)
        ),
        tuple(unit_text(1, 2 - power, -1) for power in powers),
        tuple(powers),
    )


def _length_power(algebra: Algebra, generator: Generator) -> int:
    """The power of length in a rate: of a screw, that of its rotation; its pitch is a number."""
    return min((algebra.length_power(b) for b in generator.bivector), key=abs)


def _turns(algebra: Algebra, generator: Generator) -> bool:
    return algebra.multiply(generator.bivector, generator.bivector).get(0, 0) < 0


def _proved_casimir(
    casimir: Casimir,
    generators: tuple[Generator, ...],
    structure: tuple[tuple[tuple[Rational, ...], ...], ...],
    powers: list[int],
    where: str,
) -> Casimir:
    """The Casimir with its unit, after {C, μ_a} = 0 has been proved for every a."""
    names = [g.momentum for g in generators]
    if not unchanged(casimir, names, structure):
        raise UsageError(
            f"{where}: {casimir.name} is no Casimir: it does not Poisson-commute with every "
            "momentum"
        )
    lengths = {name: 2 - power for name, power in zip(names, powers, strict=True)}
    try:
        above, below = (unit_of(p, lengths) for p in (casimir.numerator, casimir.denominator))
    except ValueError as error:
        raise UsageError(f"{where}: Casimir {casimir.name}: {error}") from error
    degree = above[0] - below[0]
    return replace(casimir, unit=unit_text(degree, above[1] - below[1], -degree))


def _require_holder(
    algebra: Algebra, element: Element, generators: tuple[Generator, ...], where: str
) -> None:
    """Refuse an element type that does not hold every product of the group's elements."""
    blades = set(element.blades)
    if not element.unit or element.fixed or 0 not in blades:
        raise UsageError(
            f"{where}: {element.name} must be a type of unit versors that holds 1: unit = true, "
            '"s" among its blades, nothing fixed'
        )
    needed = {
        *(b for generator in generators for b in generator.bivector),
        *(c for a in blades for b in blades for c in algebra.blade_product(a, b)),
    }
    if needed - blades:
        names = ", ".join(algebra.blade_name(b) for b in sorted(needed - blades))
        raise UsageError(
            f"{where}: {element.name} does not hold the group: generators and products of its "
            f"elements need {names} as well"
        )


def _wedge(algebra: Algebra, a: Mapping[Blade, Rational], b: Mapping[Blade, Rational]) -> Fraction:
    """Coefficient of I in a ∧ b."""
    return sum(
        (
            Fraction(x * y * algebra.outer(blade_a, blade_b).get(algebra.pseudoscalar, 0))
            for blade_a, x in a.items()
            for blade_b, y in b.items()
        ),
        Fraction(0),
    )


def _pairing_with(algebra: Algebra, bivector: Mapping[Blade, Rational]) -> Multivector:
    """The functional m ↦ (m ∧ E) / I on (n−2)-vectors."""
    result: Multivector = {}
    for blade, x in bivector.items():
        ((rest, sign),) = algebra.complement_inverse(blade).items()
        result[rest] = x * sign
    return result


def _dual_basis(
    algebra: Algebra, generators: tuple[Generator, ...], where: str
) -> list[Multivector]:
    complements = []
    for generator in generators:
        total: Multivector = {}
        for blade, x in generator.bivector.items():
            add_scaled(total, algebra.complement(blade), x)
        complements.append(total)
    table = [[_wedge(algebra, c, g.bivector) for g in generators] for c in complements]
    inverse = inverse_matrix(table)
    if inverse is None:
        raise UsageError(f"{where}: the generators are linearly dependent")
    dual = []
    for row in inverse:
        total = {}
        for x, complement in zip(row, complements, strict=True):
            add_scaled(total, complement, simplest(x))
        dual.append(total)
    return dual


def _bracket(
    algebra: Algebra, rate: Element, name: str, a: Generator, b: Generator, where: str
) -> tuple[Rational, ...]:
    bracket = algebra.multiply(a.bivector, b.bivector)
    add_scaled(bracket, algebra.multiply(b.bivector, a.bivector), -1)
    coordinates = tuple(
        sum((x * bracket.get(blade, 0) for blade, x in reading.items()), 0)
        for reading in rate.reading
    )
    rest = dict(bracket)
    for x, component in zip(coordinates, rate.components, strict=True):
        add_scaled(rest, component.embedding, -x)
    if rest:
        left = ", ".join(algebra.blade_name(blade) for blade in sorted(rest))
        raise UsageError(
            f"{where}: {name} is not closed: the bracket of {a.name} and {b.name} has parts "
            f"along {left}, which no generator spans; add a generator or leave one out"
        )
    return coordinates


def _prove_invariance(
    algebra: Algebra,
    rate: Element,
    momentum: Element,
    structure: tuple[tuple[tuple[Rational, ...], ...], ...],
    where: str,
) -> None:
    """Prove (ad*_B μ)(ζ) = μ([B, ζ]) with (ad*_B μ) read off [μ, B] (theory.md §2, factor 1)."""
    for b, rate_component in enumerate(rate.components):
        for m, momentum_component in enumerate(momentum.components):
            bracket = algebra.multiply(momentum_component.embedding, rate_component.embedding)
            add_scaled(
                bracket,
                algebra.multiply(rate_component.embedding, momentum_component.embedding),
                -1,
            )
            for z, reading in enumerate(momentum.reading):
                found = sum(
                    (x * bracket.get(blade, 0) for blade, x in reading.items()),
                    0,
                )
                if found != structure[b][z][m]:
                    raise UsageError(
                        f"{where}: the pairing is not invariant for {rate_component.name} and "
                        f"{momentum_component.name}: this is a defect of the generator"
                    )
