"""Straight-line programs as operations on four numbers at a time, in the same order.

Four sums of products whose first factors agree term by term, and whose second factors are four
numbers in some order and with some signs, are one sum of products of vectors: what a product of
blades is over a group of four of them.  Every lane does what the scalar text does, in its order,
so that the bits are the same.  Compilers do not find this: over the 16 components of a conformal
product they neither vectorise one object nor a loop over many.
"""

from __future__ import annotations

from collections.abc import Sequence

from hamotor.codegen import cpp
from hamotor.codegen.program import (
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Product,
    Program,
    Sum,
)

WIDTH = 4


class _Unpackable(Exception):
    """These expressions are not one expression of vectors."""


def packed_lines(program: Program) -> list[str] | None:
    """Statements of the function body; None where not every sum of products is one of four."""
    statements = [*program.bindings, *program.outputs]
    groups: dict[tuple[str, ...], list[str]] = {}
    for name, expression in statements:
        if key := _key(expression):
            groups.setdefault(key, []).append(name)
    if not groups or any(len(names) % WIDTH for names in groups.values()):
        return None
    wanted = dict(statements)
    place = {
        f"{p.name}.{c.name}": index
        for p in program.parameters
        for index, c in enumerate(p.element.components)
    }
    packer = _Packer(place, dict(program.bindings))
    try:
        texts = []
        for names in groups.values():
            for start in range(0, len(names), WIDTH):
                lanes = names[start : start + WIDTH]
                texts.append((lanes, packer.text([wanted[name] for name in lanes])))
    except _Unpackable:
        return None
    outputs = {name for name, _ in program.outputs}
    grouped = {name for lanes, _ in texts for name in lanes}
    said = " ".join(text for _, text in texts)
    lines = [
        f"const S {name} = {cpp.expression_text(expression)};"
        for name, expression in program.bindings
        if name not in grouped and f"four({name})" in said
    ]
    lines += packer.loads
    fields: dict[str, str] = {}
    for index, (lanes, text) in enumerate(texts, 1):
        lines.append(f"const auto sum{index} = {text};")
        for lane, name in enumerate(lanes):
            if name in outputs:
                fields[name] = f"sum{index}[{lane}]"
            else:
                lines.append(f"const S {name} = sum{index}[{lane}];")
    listed = ", ".join(
        f".{name} = {fields.get(name) or cpp.expression_text(expression)}"
        for name, expression in program.outputs
    )
    lines.append(f"return {{{listed}}};")
    return lines


def _unsigned(expression: Expression) -> tuple[int, Expression]:
    if isinstance(expression, Negative):
        sign, inner = _unsigned(expression.x)
        return -sign, inner
    return 1, expression


def _pairs(expression: Expression) -> list[tuple[Expression, Expression]] | None:
    """The products of a sum of four products or more, in their order."""
    pairs: list[tuple[Expression, Expression]] = []
    while isinstance(expression, MultiplyAdd):
        pairs.append((expression.a, expression.b))
        expression = expression.c
    if not isinstance(expression, Product) or len(pairs) < WIDTH - 1:
        return None
    pairs.append((expression.a, expression.b))
    return pairs[::-1]


def _key(expression: Expression) -> tuple[str, ...]:
    """What four sums must share: the first factors, but for their signs."""
    pairs = _pairs(expression)
    if pairs is None:
        return ()
    key = []
    for a, b in pairs:
        key.append(cpp.expression_text(_unsigned(a)[1]))
        key += _key(b)
    return tuple(key)


class _Packer:
    def __init__(self, place: dict[str, int], bindings: dict[str, Expression]) -> None:
        self._place = place
        self._bindings = bindings
        self._registers: dict[frozenset[str], list[str]] = {}
        self.loads: list[str] = []

    def text(self, lanes: Sequence[Expression]) -> str:
        """`dot(…)` of vectors for four sums."""
        rows = [_pairs(lane) for lane in lanes]
        arguments: list[str] = []
        for column in zip(*(row or [] for row in rows), strict=True):
            signs = []
            firsts = set()
            seconds = []
            for a, b in column:
                sign_a, first = _unsigned(a)
                sign_b, second = _unsigned(b)
                signs.append(sign_a * sign_b)
                firsts.add(cpp.expression_text(first))
                seconds.append(second)
            if len(firsts) != 1:
                raise _Unpackable
            arguments += [f"four({firsts.pop()})", self._second(signs, seconds)]
        return f"dot({', '.join(arguments)})"

    def _second(self, signs: list[int], lanes: list[Expression]) -> str:
        if all(isinstance(x, MultiplyAdd) for x in lanes):
            if set(signs) != {1}:
                raise _Unpackable
            return self.text(lanes)
        names = [x.text for x in lanes if isinstance(x, Name)]
        if len(set(names)) != WIDTH:
            raise _Unpackable
        register = self._register(names)
        where = [register.index(name) for name in names]
        if where == list(range(WIDTH)) and set(signs) == {1}:
            return self._name(register)
        order = ", ".join(str(s * (k + 1)) for s, k in zip(signs, where, strict=True))
        return f"turned<{order}>({self._name(register)})"

    def _register(self, names: list[str]) -> list[str]:
        key = frozenset(names)
        if key not in self._registers:
            if any(key & other for other in self._registers):
                raise _Unpackable  # not blocks of components: more loads than it saves
            order = sorted(names, key=lambda name: self._place.get(name, -1))
            self._registers[key] = order
            loaded = self._sum(order) or f"four({', '.join(order)})"
            self.loads.append(f"const auto {self._name(order)} = {loaded};")
        return self._registers[key]

    def _sum(self, names: list[str]) -> str:
        """Four bindings ±x ± y, as the sum of two vectors."""
        parts: list[list[tuple[int, Expression]]] = [[], []]
        for name in names:
            expression = self._bindings.get(name)
            if not isinstance(expression, Sum):
                return ""
            for part, x in zip(parts, (expression.a, expression.b), strict=True):
                part.append(_unsigned(x))
        texts = []
        for part in parts:
            if not all(isinstance(x, Name) and x.text in self._place for _, x in part):
                return ""
            texts.append(self._second([s for s, _ in part], [x for _, x in part]))
        return " + ".join(texts)

    @staticmethod
    def _name(register: list[str]) -> str:
        return "four_" + register[0].replace(".", "_")
