"""A unit versor's action on a type of element as a matrix, for many elements or long chains.

The products of the versor's components, in which no element stands, are then made once, and each
element costs one multiply-add an entry, with nothing between it and its image.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import combinations

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Algebra, Rational, magnitude, ratio
from hamotor.codegen.element import Component, Element
from hamotor.codegen.kernel import (
    Kernel,
    direct_program,
    moved_value,
    multiples,
    parameters_for,
    proved,
    read_off,
    value_of,
)
from hamotor.codegen.polynomial import Monomial, Polynomial
from hamotor.codegen.program import (
    Expression,
    MultiplyAdd,
    Parameter,
    Product,
    Program,
    Sum,
    negative,
    number,
    polynomial_expression,
)


def matrix_kernels(
    algebra: Algebra, versor: Element, operand: Element, result: Element
) -> tuple[Kernel, Kernel]:
    """The matrix of X ↦ V X ~V, (−1)^k V X ~V for an odd V and X of grade k, and its application.

    The matrix has a type of its own.  Its numbers are called by row and column, or by row and the
    operand's fixed part: `e032_e013` is the e032 of the image of e013.  What is the same for every
    versor is not stored, and what stands in several places only once.  V ~V = 1 is used: where V is
    a unit, and exactly, the matrix is that of V X ~V ± X (1 − V ~V), which the proof of the
    application compares.
    """
    v, x = parameters_for(versor, operand)
    odd = any(g % 2 for g in versor.grades)
    overall = -1 if odd and operand.grades[0] % 2 else 1
    moved = {
        row: poly.scaled(p, overall)
        for row, p in read_off(moved_value(algebra, versor, operand), result).items()
    }
    entries = _entries(moved, x, algebra)
    meaning: dict[str, Polynomial] = {}
    image: dict[str, Polynomial] = {row: {} for row in moved}
    known: dict[tuple[tuple[Monomial, Rational], ...], tuple[str, int]] = {}
    for (row, factor, name), entry in entries.items():
        rest: Monomial = (f"{x.name}.{factor}",) if factor else ()
        if entry.keys() <= {()}:
            poly.add_scaled(image[row], {rest: 1}, entry.get((), 0))
            continue
        sign = -1 if next(iter(entry.values())) < 0 else 1
        key = tuple(sorted(poly.scaled(entry, sign).items()))
        if key not in known:
            known[key] = name, sign
            meaning[name] = entry
        stored, its_sign = known[key]
        poly.add_term(image[row], tuple(sorted((f"a.{stored}", *rest))), sign * its_sign)

    action = f"{'(−1)^k ' * odd}{v.name} {x.name} ~{v.name}"
    matrix = Element(
        f"{versor.name}{operand.name}Matrix",
        "a",
        tuple(Component(name, {}) for name in meaning),
        {},
        False,
        f"Matrix of {x.name} ↦ {action}, {versor.name} {v.name} and {operand.name} {x.name}: "
        "row_column.",
        functionals=tuple({} for _ in meaning),
    )
    name = f"{re.sub('(?<=[a-z0-9])(?=[A-Z])', '_', operand.name).lower()}_matrix"
    note = "Needs M ~M = 1."
    programs = [_program(v, meaning, matrix, absorbed=absorbed) for absorbed in (True, False)]
    program = min(programs, key=lambda p: p.cost.total)
    law = (
        f"the matrix of {x.name} ↦ {action} for every {operand.name} {x.name}; transform applies it"
    )
    whole = proved(Kernel(name, law, program, meaning, notes=(note,)))

    a, b = parameters_for(matrix, operand)
    names: dict[str, Polynomial]
    names = {f"a.{c.name}": {(f"{a.name}.{c.name}",): 1} for c in matrix.components}
    names |= {f"{x.name}.{c.name}": {(f"{b.name}.{c.name}",): 1} for c in operand.components}
    renamed = {row: poly.substituted(p, names) for row, p in image.items()}
    law = f"the image of {b.name} under {x.name} ↦ {action}, of which {a.name} is the matrix"
    applied = Kernel("transform", law, direct_program((a, b), renamed, result), renamed)
    back = {f"a.{c}": p for c, p in meaning.items()}
    if {row: poly.substituted(p, back) for row, p in image.items()} != moved:
        raise AssertionError(f"{matrix.name}: the matrix is not that of the sandwich")
    return whole, proved(applied)


def _entries(
    moved: Mapping[str, Polynomial], x: Parameter, algebra: Algebra
) -> dict[tuple[str, str, str], Polynomial]:
    """(row, component of x or "" for its fixed part, name of the entry) → polynomial in V."""
    fixed = [algebra.blade_name(b) for b in x.element.fixed]
    columns = [(f"{x.name}.{c.name}", c.name, c.name) for c in x.element.components]
    columns.append(("", "", fixed[0] if len(fixed) == 1 else "fixed"))
    entries: dict[tuple[str, str, str], Polynomial] = {}
    for row, p in moved.items():
        for factor, component, column in columns:
            entry: Polynomial = {}
            for monomial, coefficient in p.items():
                own = [n for n in monomial if n.startswith(f"{x.name}.")]
                if own == [factor] * bool(factor):
                    rest = tuple(n for n in monomial if n not in own)
                    poly.add_term(entry, rest, coefficient)
            if entry:
                entries[row, component, f"{row}_{column}"] = entry
    return entries


def _program(
    v: Parameter, meaning: Mapping[str, Polynomial], result: Element, *, absorbed: bool
) -> Program:
    """Each product of two components once; absorbed: with the factor that all have in common."""
    changing = {n: {m: c for m, c in p.items() if m} for n, p in meaning.items()}
    contents = {n: poly.content(p) for n, p in changing.items()}
    uses = Counter(m for p in changing.values() for m in p)
    factor: Rational = 1
    named: dict[str, str] = {}
    bindings: list[tuple[str, Expression]] = []
    if absorbed:
        factor = magnitude(poly.content({(n,): c for n, c in contents.items()}))
        names, multiplied = multiples(value_of(v), factor)
        named = {x: names[x] for x in _cover(uses)}
        bindings = [(y, e) for y, e in multiplied if y in named.values()]
    terms = {m: _multiplied(m, named) for m in uses}
    for m, count in uses.items():
        if count > 1 and len(m) == 2:
            product = "_".join(x.rpartition(".")[2] for x in m)
            bindings.append((product, polynomial_expression({terms[m]: 1})))
            terms[m] = (product,)
    sums = {n: {terms[m]: ratio(c, contents[n]) for m, c in p.items()} for n, p in changing.items()}
    bindings += _shared_sums(sums)
    outputs: list[tuple[str, Expression]] = []
    for name, inner in sums.items():
        content = ratio(contents[name], factor)
        constant = meaning[name].get((), 0)
        total = polynomial_expression(inner)
        if magnitude(content) != 1:
            outer = number(content)
            total = (
                MultiplyAdd(outer, total, number(constant)) if constant else Product(outer, total)
            )
        elif content < 0:
            total = negative(total) if constant else polynomial_expression(poly.scaled(inner, -1))
        if constant and magnitude(content) == 1:
            total = Sum(number(constant), total)
        outputs.append((name, total))
    return Program((v,), tuple(bindings), tuple(outputs), result)


def _shared_sums(sums: Mapping[str, Polynomial]) -> list[tuple[str, Expression]]:
    """Name what two or more sums have in common of two names, a + b or a − b, and put it there.

    The pair that is found most often comes first, until there is none.
    """
    bindings: list[tuple[str, Expression]] = []
    while True:
        found = Counter(
            (a, b, p[a] == p[b])
            for p in sums.values()
            for a, b in combinations(sorted(m for m in p if len(m) == 1), 2)
            if magnitude(p[a]) == magnitude(p[b])
        )
        if not found or max(found.values()) < 2:
            return bindings
        a, b, same = max(found, key=lambda pair: found[pair])
        name = f"sum_{len(bindings) + 1}"
        bindings.append((name, polynomial_expression({a: 1, b: 1 if same else -1})))
        for p in sums.values():
            if a in p and b in p and p[b] == (p[a] if same else -p[a]):
                p[(name,)] = p.pop(a)
                del p[b]


def _multiplied(monomial: Monomial, named: Mapping[str, str]) -> Monomial:
    """The monomial with its first factor that has a named multiple replaced by that."""
    place = next((i for i, x in enumerate(monomial) if x in named), None)
    if place is None:
        return monomial
    return (named[monomial[place]], *monomial[:place], *monomial[place + 1 :])


def _cover(monomials: Iterable[Monomial]) -> list[str]:
    """A few names of which every monomial has one: those in most monomials, one by one."""
    left = [set(m) for m in monomials]
    chosen = sorted({next(iter(m)) for m in left if len(m) == 1})
    left = [m for m in left if not m & set(chosen)]
    while left:
        counts = Counter(x for m in left for x in sorted(m))
        best = max(sorted(counts), key=lambda x: counts[x])
        chosen.append(best)
        left = [m for m in left if best not in m]
    return chosen
