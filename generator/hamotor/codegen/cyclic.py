"""Programs that stay the same when three basis vectors take each other's places in turn.

The products of Euclidean space, of rigid motions and of conformal space do not change if e1, e2, e3
become e2, e3, e1.  Components are then three of a kind, such as e23, e31, e12, or by themselves,
such as e0123, and so are the sums of a program.  Three sums of a kind, with their terms in one
order, are one sum of vectors of three (`lanes`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise
from math import prod

from hamotor.codegen import polynomial as poly
from hamotor.codegen.algebra import Algebra, Blade, Multivector
from hamotor.codegen.element import Element
from hamotor.codegen.polynomial import Polynomial
from hamotor.codegen.program import (
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Number,
    Product,
    Program,
    Sum,
    negative,
    one_level,
    walk,
)

Signed = tuple[int, str]
"""A name and its sign."""
Three = tuple[Signed, Signed, Signed]
"""What becomes each other, in turn, and the first again."""


class _Fails(Exception):
    """The turn does not leave the program as it is."""


@dataclass(frozen=True)
class Turn:
    """What each name of a program becomes when three basis vectors take each other's places.

    names:   of components of the parameters and of bindings; one may become itself.
    outputs: of the result's components.
    """

    names: Mapping[str, Signed]
    outputs: Mapping[str, Signed]

    @cached_property
    def threes(self) -> Mapping[str, tuple[Three, int]]:
        """The three that a name is of, and its place there; without those by themselves."""
        return _threes(self.names)

    @cached_property
    def outputs_threes(self) -> Mapping[str, tuple[Three, int]]:
        """The same of the result's components."""
        return _threes(self.outputs)

    def image(self, x: Expression) -> Expression:
        """What an expression becomes."""
        return substituted(x, self._values)

    @cached_property
    def _values(self) -> Mapping[str, Expression]:
        return {n: Name(y) if s > 0 else Negative(Name(y)) for n, (s, y) in self.names.items()}


def cyclic_program(algebra: Algebra, program: Program) -> tuple[Program, Turn] | None:
    """The same program with the terms of every three sums in one order, and the turn.

    A sum that becomes itself, of six products or more, is three sums that become each other, where
    nothing in it has been rounded but sums of components.  None where no three basis vectors can be
    turned, or the program has other steps than sums of products.
    """
    for permutation in _permutations(algebra):
        try:
            names = _parameter_images(algebra, permutation, program)
        except _Fails:
            continue
        try:
            return _turned(algebra, permutation, program, names)
        except _Fails:
            return None  # others would rarely do better, and each takes as long
    return None


def _permutations(algebra: Algebra) -> Iterator[Sequence[int]]:
    """Those of three basis vectors in turn that leave the Gram matrix as it is."""
    everything = range(algebra.dimension)
    for i, j, k in combinations(everything, 3):
        image = list(everything)
        image[i], image[j], image[k] = j, k, i
        if all(
            algebra.gram[a][b] == algebra.gram[image[a]][image[b]]
            for a in everything
            for b in everything
        ):
            yield image


def _turned(
    algebra: Algebra, permutation: Sequence[int], program: Program, components: Mapping[str, Signed]
) -> tuple[Program, Turn]:
    names = _binding_images(program, components)
    outputs = _images({n: _polynomial(x) for n, x in program.outputs}, names)
    if any(sign < 0 for sign, _ in outputs.values()):
        raise _Fails

    program, names = _same_signs(algebra, permutation, program, names)
    turn = Turn(names, outputs)
    degrees = _degrees(program)
    bindings = _in_one_order(program.bindings, turn.threes, turn, degrees)
    results = dict(_in_one_order(program.outputs, turn.outputs_threes, turn, degrees))
    ordered = tuple((name, results[name]) for name, _ in program.outputs)
    whole = replace(program, bindings=tuple(bindings), outputs=ordered)
    return _in_order_of_use(whole, turn), turn


def _in_order_of_use(program: Program, turn: Turn) -> Program:
    """Bindings as the outputs need them, each with its three: what is wanted first stands first."""
    bound = dict(program.bindings)
    done: dict[str, Expression] = {}

    def define(x: Expression) -> None:
        for node in walk(x):
            if isinstance(node, Name) and node.text in bound and node.text not in done:
                three, _ = turn.threes.get(node.text, (((1, node.text),), 0))
                for _, name in three:
                    define(bound[name])
                done.update((name, bound[name]) for _, name in three)

    for _, x in program.outputs:
        define(x)
    return replace(program, bindings=tuple(done.items()))


def _degrees(program: Program) -> dict[str, int]:
    """Of each binding, how many components of parameters are multiplied in it."""
    degrees: dict[str, int] = {}
    for name, x in program.bindings:
        degrees[name] = max(
            (sum(degrees.get(factor, 1) for factor in monomial) for monomial in _polynomial(x)),
            default=0,
        )
    return degrees


def _parameter_images(
    algebra: Algebra, permutation: Sequence[int], program: Program
) -> dict[str, Signed]:
    names: dict[str, Signed] = {}
    for parameter in program.parameters:
        images = _component_images(algebra, permutation, parameter.element)
        for name, (sign, image) in images.items():
            names[f"{parameter.name}.{name}"] = sign, f"{parameter.name}.{image}"
    return names


def _component_images(
    algebra: Algebra, permutation: Sequence[int], element: Element
) -> dict[str, Signed]:
    known = {frozenset(c.embedding.items()): c.name for c in element.components}
    images: dict[str, Signed] = {}
    for component in element.components:
        image: Multivector = {}
        for blade, x in component.embedding.items():
            turned, sign = _turned_blade(algebra, permutation, blade)
            image[turned] = sign * x
        for sign in (1, -1):
            name = known.get(frozenset((b, sign * x) for b, x in image.items()))
            if name is not None and image:
                images[component.name] = sign, name
        if component.name not in images:
            raise _Fails
    return images


def _turned_blade(algebra: Algebra, permutation: Sequence[int], blade: Blade) -> tuple[Blade, int]:
    result, sign = 0, 1
    for i in range(algebra.dimension):
        if blade >> i & 1:
            ((result, s),) = algebra.outer(result, 1 << permutation[i]).items()
            sign *= int(s)
    return result, sign


def _binding_images(program: Program, components: Mapping[str, Signed]) -> dict[str, Signed]:
    """Step by step: of the bindings whose factors' images are known."""
    names = dict(components)
    waiting = {name: _polynomial(x) for name, x in program.bindings}
    while waiting:
        ready = {name: p for name, p in waiting.items() if all(x in names for m in p for x in m)}
        if not ready:
            raise _Fails
        names |= _images(ready, names)
        waiting = {name: p for name, p in waiting.items() if name not in ready}
    return names


def _images(
    polynomials: Mapping[str, Polynomial], names: Mapping[str, Signed]
) -> dict[str, Signed]:
    """Which of the polynomials, with which sign, each of them becomes."""
    known: dict[frozenset[tuple[tuple[str, ...], object]], Signed] = {}
    for name, p in polynomials.items():
        for sign in (1, -1) if p else ():
            signed = sign, name
            if known.setdefault(frozenset(poly.scaled(p, sign).items()), signed) != signed:
                raise _Fails
    images: dict[str, Signed] = {}
    for name, p in polynomials.items():
        image: Polynomial = {}
        for monomial, x in p.items():
            if not all(factor in names for factor in monomial):
                raise _Fails
            turned = [names[factor] for factor in monomial]
            sign = prod(sign for sign, _ in turned)
            image[tuple(sorted(factor for _, factor in turned))] = sign * x
        found = known.get(frozenset(image.items())) if p else (1, name)
        if found is None:
            raise _Fails
        images[name] = found
    return images


def _threes(images: Mapping[str, Signed]) -> dict[str, tuple[Three, int]]:
    """Every name that does not become itself, with its three and its place there."""
    place: dict[str, tuple[Three, int]] = {}
    for name, (sign, second) in images.items():
        if name in place:
            continue
        if second == name:
            if sign < 0:
                raise _Fails
            continue
        next_sign, third = images[second]
        last_sign, first = images[third]
        if first != name or sign * next_sign * last_sign < 0:
            raise _Fails
        three: Three = ((1, name), (sign, second), (sign * next_sign, third))
        place |= {x: (three, k) for k, (_, x) in enumerate(three)}
    return place


def _same_signs(
    algebra: Algebra,
    permutation: Sequence[int],
    program: Program,
    names: Mapping[str, Signed],
) -> tuple[Program, dict[str, Signed]]:
    """Uses of those bindings negated that a three has with the other sign, for them to be negated.

    They get the name that their orientation then has: of c_e12, c_e23, −c_e13 the last is c_e31.
    """
    threes = _threes(names)
    bound = dict(program.bindings)
    now: dict[str, Expression] = {}
    called = {name: name for name in bound}
    for name in bound:
        if name in threes and not threes[name][1]:
            three, _ = threes[name]
            for (_, before), (sign, after) in pairwise(three):
                if sign < 0:
                    called[after] = _turned_name(algebra, permutation, called[before], after)
                    now[after] = Negative(Name(called[after]))
    if len(set(called.values())) < len(called):
        raise _Fails
    bindings = tuple((called[name], substituted(x, now)) for name, x in program.bindings)
    outputs = tuple((name, substituted(x, now)) for name, x in program.outputs)
    images = {name: image for name, image in names.items() if name not in bound}
    for name, (sign, image) in names.items():
        if name in bound:
            by_itself = name not in threes
            images[called[name]] = (sign if by_itself else 1), called[image]
    return replace(program, bindings=bindings, outputs=outputs), images


def _turned_name(algebra: Algebra, permutation: Sequence[int], before: str, otherwise: str) -> str:
    """`c_e31` after `c_e23`; the other name where that is not called after a blade."""
    prefix, _, blade = before.rpartition("_")
    suffixes = algebra.suffixes()
    rest, turned = blade.removeprefix("e"), "e"
    while rest:
        index = next((i for i, s in enumerate(suffixes) if s and rest.startswith(s)), None)
        if index is None:
            return otherwise
        turned += suffixes[permutation[index]]
        rest = rest[len(suffixes[index]) :]
    return f"{prefix}_{turned}" if prefix else turned


def _in_one_order(
    statements: Sequence[tuple[str, Expression]],
    threes: Mapping[str, tuple[Three, int]],
    turn: Turn,
    degrees: Mapping[str, int],
) -> list[tuple[str, Expression]]:
    """The statements, each three together: the second and third are what the one before becomes.

    A sum of products that have been rounded already keeps its order, which bounds its error.
    """
    ordered: list[tuple[str, Expression]] = []
    for name, x in statements:
        if name not in threes:
            given = all(degrees.get(y, 1) == 1 for monomial in _polynomial(x) for y in monomial)
            ordered.append((name, _as_three_sums(x, turn) if given else x))
            continue
        three, place = threes[name]
        if place:
            continue
        second = turn.image(x)
        images = (x, second, turn.image(second))
        ordered += [(n, image) for (_, n), image in zip(three, images, strict=True)]
    return ordered


def _as_three_sums(x: Expression, turn: Turn) -> Expression:
    """A sum of products that becomes itself as three that become each other, and what is left."""
    if isinstance(x, Product | MultiplyAdd) and isinstance(x.a, Number):
        return replace(x, b=_as_three_sums(x.b, turn))
    terms: list[Product] = []
    start: Expression | None = x
    while type(start) is MultiplyAdd:
        terms.append(Product(start.a, start.b))
        start = start.c
    if isinstance(start, Product):
        terms.append(start)
        start = None
    left = {_key(term): term for term in reversed(terms)}
    if len(left) < len(terms):
        return x
    first: list[Product] = []
    alone: list[Product] = []
    while left:
        key, term = next(iter(left.items()))
        after = turn.image(term)
        keys = (key, _key(after), _key(turn.image(after)))
        if len(set(keys)) == 3 and all(k in left for k in keys):
            first.append(term)
        else:
            keys = (key,) * 3
            alone.append(term)
        for k in set(keys):
            del left[k]
    if len(first) < 2:
        return x
    total = _sum(first, None)
    second = turn.image(total)
    threefold: Expression = Sum(Sum(total, second), turn.image(second))
    if start is not None:
        threefold = Sum(start, threefold)
    return _sum(alone, threefold) if alone else threefold


def _sum(terms: Sequence[Product], start: Expression | None) -> Expression:
    total = start
    for term in terms:
        total = term if total is None else MultiplyAdd(term.a, term.b, total)
    assert total is not None
    return total


def _key(term: Expression) -> frozenset[tuple[tuple[str, ...], object]]:
    return frozenset(_polynomial(term).items())


def _polynomial(x: Expression) -> Polynomial:
    try:
        return one_level(x)
    except ValueError as error:
        raise _Fails from error


def substituted(x: Expression, values: Mapping[str, Expression]) -> Expression:
    """An expression with other ones for names; of a product's signs one is left at most."""
    match x:
        case Name(text):
            return values.get(text, x)
        case Number():
            return x
        case Negative(inner):
            return negative(substituted(inner, values))
        case Sum(a, b):
            return Sum(substituted(a, values), substituted(b, values))
        case Product(a, b):
            return Product(*_factors(substituted(a, values), substituted(b, values)))
        case MultiplyAdd(a, b, c):
            a, b = _factors(substituted(a, values), substituted(b, values))
            return replace(x, a=a, b=b, c=substituted(c, values))
        case _:
            raise _Fails


def _factors(a: Expression, b: Expression) -> tuple[Expression, Expression]:
    return (negative(a), b.x) if isinstance(b, Negative) else (a, b)
