"""Three ways to scale rates and momenta, exactly converted into each other (theory.md §3).

physical:          B = Σ w_a E_a over a group's generators: Ω, V and Π, P in SI units.
core:              B = Σ c_a b_a over the blades b_a themselves: Ṁ = M B, μ̇ = [μ, B] − F.
de_keninck_dorst:  Ṁ = −½ M B, μ̇ = B × μ + F with B = −2 B_core, μ = −½ μ_core and F the force
                   itself (Dorst & De Keninck, May the Forque Be with You: Dynamics in PGA).

A forque is +dH in the first two, minus the force.  Energies are the same in all three: inertias of
`core` are four times the physical ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from hamotor.codegen.algebra import Algebra
from hamotor.codegen.group import Generator, LieGroup
from hamotor.errors import UsageError, suggest

NORMALISATIONS = ("physical", "core", "de_keninck_dorst")
DE_KENINCK_DORST = {"rate": Fraction(-2), "momentum": Fraction(-1, 2), "forque": Fraction(1, 2)}
"""What takes each quantity from `core` to De Keninck and Dorst's form."""
KINDS = tuple(DE_KENINCK_DORST)


def blade_factor(algebra: Algebra, generator: Generator) -> Fraction:
    """f with E = f b, b the blade that names the generator, or else the ascending one.

    Raises UsageError where the generator is not a multiple of one blade.
    """
    if len(generator.bivector) != 1:
        raise UsageError(
            f"generator {generator.name} mixes blades: its only normalisation is physical"
        )
    ((blade, x),) = generator.bivector.items()
    try:
        named, sign = algebra.parse_blade(generator.name)
    except ValueError:
        named, sign = blade, 1
    return Fraction(x) * (sign if named == blade else 1)


def _factor(kind: str, normalisation: str, f: Fraction) -> Fraction:
    """What takes a physical coordinate to that normalisation."""
    for what, value, allowed in (
        ("quantity", kind, KINDS),
        ("normalisation", normalisation, NORMALISATIONS),
    ):
        if value not in allowed:
            raise UsageError(
                f'unknown {what} "{value}"; there is {", ".join(allowed)}.{suggest(value, allowed)}'
            )
    if normalisation == "physical":
        return Fraction(1)
    core = f if kind == "rate" else 1 / f
    if normalisation == "core":
        return core
    return DE_KENINCK_DORST[kind] * core


def convert(
    algebra: Algebra,
    group: LieGroup,
    kind: str,
    values: Sequence[Fraction],
    source: str,
    target: str,
) -> tuple[Fraction, ...]:
    """Coordinates of a `rate`, `momentum` or `forque`, in the generators' order, exactly.

    Raises UsageError for an unknown kind or normalisation.
    """
    factors = [blade_factor(algebra, g) for g in group.generators]
    return tuple(
        x * _factor(kind, target, f) / _factor(kind, source, f)
        for x, f in zip(values, factors, strict=True)
    )


def convert_inertia(
    algebra: Algebra,
    group: LieGroup,
    inertia: Sequence[Sequence[Fraction]],
    source: str,
    target: str,
) -> tuple[tuple[Fraction, ...], ...]:
    """The matrix that takes rates to momenta, in another normalisation, exactly."""
    factors = [blade_factor(algebra, g) for g in group.generators]
    momenta, rates = (
        [_factor(kind, target, f) / _factor(kind, source, f) for f in factors]
        for kind in ("momentum", "rate")
    )
    return tuple(
        tuple(x * m / r for x, r in zip(row, rates, strict=True))
        for row, m in zip(inertia, momenta, strict=True)
    )
