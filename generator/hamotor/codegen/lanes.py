"""Straight-line programs as operations on four numbers at a time, in the same order.

Four sums of products whose first factors agree term by term, and whose second factors are four
numbers in some order and with some signs, are one sum of products of vectors: what a product of
blades is over a group of four of them.  Every lane does what the scalar text does, in its order,
so that the bits are the same.  Compilers do not find this: over the 16 components of a conformal
product they neither vectorise one object nor a loop over many.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import permutations

from hamotor.codegen import cpp
from hamotor.codegen.algebra import Algebra
from hamotor.codegen.cyclic import Three, Turn, cyclic_program, substituted
from hamotor.codegen.kernel import Kernel, proved
from hamotor.codegen.program import (
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Number,
    Product,
    Program,
    Sum,
    children,
    replace_children,
    walk,
)

WIDTH = 4
PACKED = "lanes::packed<S>"
INLINED_OPERATIONS = 128
"""Kernels of at most so many additions, multiplications and divisions are always inlined: for
them the way of a result through memory costs more than the arithmetic."""
PACKED_OPERATIONS = 48
"""Kernels of at least so many operations are written four lanes at a time where they can be."""
THREES_OPERATIONS = 80
"""Those of at least so many that cannot be, three at a time."""


def in_threes(algebra: Algebra, kernel: Kernel) -> Kernel:
    """The kernel with its terms in the order of lanes of three, where it is to have them."""
    cost = kernel.program.cost
    if kernel.meaning is None or cost.calls or cost.total < THREES_OPERATIONS:
        return kernel
    found = cyclic_program(algebra, kernel.program)
    if found is None or _fours(kernel.program) is not None:
        return kernel
    return proved(replace(kernel, program=found[0], turn=found[1]))


def packed_body(kernel: Kernel) -> list[str]:
    """What a kernel of many operations does first, where the scalar and the processor allow it."""
    if kernel.shortcut is not None:
        return []
    where = PACKED
    if kernel.turn is None:
        packed = _fours(kernel.program)
    else:
        packed = threes_lines(kernel.program, kernel.turn)
        if kernel.program.cost.total <= INLINED_OPERATIONS:
            where += " && !lanes::loops_become_lanes"
    if packed is None:
        return []
    return [
        f"if constexpr ({where}) {{",
        "if (!std::is_constant_evaluated()) {",
        "using lanes::four;",
        "using lanes::turned;",
        *packed,
        "}",
        "}",
    ]


def _fours(program: Program) -> list[str] | None:
    cost = program.cost
    if cost.calls or cost.total < PACKED_OPERATIONS:
        return None
    return packed_lines(program, whole=cost.total <= INLINED_OPERATIONS)


class _Unpackable(Exception):
    """These expressions are not one expression of vectors."""


def packed_lines(program: Program, *, whole: bool) -> list[str] | None:
    """Statements of the function body; None where not every sum of products is one of four.

    whole: None as well where a component of the result is none of these sums.
    """
    statements = [*program.bindings, *program.outputs]
    groups: dict[tuple[str, ...], list[str]] = {}
    for name, expression in statements:
        if key := _key(expression):
            groups.setdefault(key, []).append(name)
    if not groups or any(len(names) % WIDTH for names in groups.values()):
        return None
    if whole and not all(_key(expression) for _, expression in program.outputs):
        return None
    wanted = dict(statements)
    packer = _Packer(program)
    texts = []
    try:
        for names in groups.values():
            for start in range(0, len(names), WIDTH):
                order = packer.best_order(names[start : start + WIDTH], wanted)
                texts.append(packer.text([wanted[name] for name in order]))
                vector = f"sum{len(texts)}"
                packer.sums |= {name: (vector, lane) for lane, name in enumerate(order)}
    except _Unpackable:
        return None
    place = packer.sums
    said = " ".join(texts)
    lines = [
        f"const S {name} = {cpp.expression_text(expression)};"
        for name, expression in program.bindings
        if name not in place and f"four({name})" in said
    ]
    lines += packer.loads
    lines += [f"const auto sum{index} = {text};" for index, text in enumerate(texts, 1)]
    return [*lines, *_returned(program, place)]


def _returned(program: Program, place: Mapping[str, tuple[str, int]]) -> list[str]:
    """The statements that bring the sums into the result, four components at a time if possible."""
    blocks = [
        _block(list(program.outputs[start : start + WIDTH]), place)
        for start in range(0, len(program.outputs), WIDTH)
    ]
    if all(blocks):
        return [
            f"{cpp.scalar_type(program.result)} result;",
            *(f"lanes::store<{WIDTH * k}>(result, {text});" for k, text in enumerate(blocks)),
            "return result;",
        ]
    outputs = {name for name, _ in program.outputs}
    lines = [
        f"const S {name} = {where}[{lane}];"
        for name, (where, lane) in place.items()
        if name not in outputs
    ]
    texts = {}
    for name, expression in program.outputs:
        where, lane = place.get(name, ("", 0))
        texts[name] = f"{where}[{lane}]" if where else cpp.expression_text(expression)
    return [*lines, cpp.return_line(program, texts)]


def _block(
    outputs: Sequence[tuple[str, Expression]], place: Mapping[str, tuple[str, int]]
) -> str | None:
    """Four components of the result as one vector: four lanes, or sums ±x ± y and multiples."""
    if len(outputs) < WIDTH:
        return None
    if all(name in place for name, _ in outputs):
        whole = _in_order(place, [Name(name) for name, _ in outputs])
        return _turned(*whole) if whole else None
    factors, left, right = [], [], []
    for _, expression in outputs:
        match expression:
            case Product(Number() as factor, Sum(x, y)):
                factors.append(cpp.expression_text(factor))
            case Sum(x, y):
                pass
            case _:
                return None
        left.append(x)
        right.append(y)
    sides = _in_order(place, left), _in_order(place, right)
    if len(factors) not in (0, WIDTH) or sides[0] is None or sides[1] is None:
        return None
    both = _added(sides[0], sides[1])
    return f"four({', '.join(factors)}) * ({both})" if factors else both


_Turned = tuple[str, tuple[int, ...]]
"""A vector, and its lanes in the order and with the signs of `turned`."""


def _turned(vector: str, order: Sequence[int]) -> str:
    if list(order) == list(range(1, WIDTH + 1)):
        return vector
    return f"turned<{', '.join(map(str, order))}>({vector})"


def _added(a: _Turned, b: _Turned) -> str:
    """a + b, by the same bits a difference where one's first lane is negated: a vector that is
    wanted with both signs is then turned once."""
    negative_a, negative_b = a[1][0] < 0, b[1][0] < 0
    if negative_a and not negative_b:
        a, b, negative_a, negative_b = b, a, negative_b, negative_a
    if negative_b and not negative_a:
        return f"{_turned(*a)} - {_turned(b[0], [-lane for lane in b[1]])}"
    return f"{_turned(*a)} + {_turned(*b)}"


def _in_order(place: Mapping[str, tuple[str, int]], lanes: Sequence[Expression]) -> _Turned | None:
    """Lanes of one sum, in another order and with signs."""
    order = []
    vectors = set()
    for lane in lanes:
        sign, x = _unsigned(lane)
        if not isinstance(x, Name) or x.text not in place:
            return None
        vector, number = place[x.text]
        vectors.add(vector)
        order.append(sign * (number + 1))
    if len(vectors) != 1:
        return None
    return vectors.pop(), tuple(order)


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


def threes_lines(program: Program, turn: Turn) -> list[str]:
    """Statements of the function body: a program's threes as vectors, the first again as fourth.

    What becomes itself is computed by itself, three sums that become each other by `total`.
    """
    threes = _Threes(turn)
    for name, x in program.bindings:
        if name not in turn.threes:
            text = threes.alone(x)
            threes.lines.append(f"const S {name} = {text};")
            continue
        three, place = turn.threes[name]
        if not place:
            threes.bind(three, x)
    fields: dict[str, str] = {}
    for name, x in program.outputs:
        if name not in turn.outputs_threes:
            fields[name] = threes.alone(x)
            continue
        three, place = turn.outputs_threes[name]
        if not place:
            text = threes.vector(x)
            threes.lines.append(f"const auto all_{name} = {text};")
            fields |= {n: f"all_{name}[{lane}]" for lane, (_, n) in enumerate(three)}
    return [*threes.lines, cpp.return_line(program, fields)]


class _Threes:
    def __init__(self, turn: Turn) -> None:
        self._turn = turn
        self._registers: dict[Three, str] = {}
        self._bound: set[str] = set()
        self._read: set[str] = set()
        self.lines: list[str] = []

    def bind(self, three: Three, x: Expression) -> None:
        """A binding of three names."""
        text = self.vector(x)
        register = f"{three[0][1]}_three"
        self._registers[three] = register
        self._bound |= {name for _, name in three}
        self.lines.append(f"const auto {register} = {text};")

    def vector(self, x: Expression) -> str:
        """An expression and what it becomes, as one of vectors."""
        names = {node.text for node in walk(x) if isinstance(node, Name)}
        return cpp.expression_text(
            _of_vectors(substituted(x, {name: self._lanes(name) for name in sorted(names)}))
        )

    def alone(self, x: Expression) -> str:
        """An expression that becomes itself, of numbers and totals of vectors."""
        summed = self._totals(x)
        for node in walk(summed):
            if isinstance(node, Name) and node.text in self._bound - self._read:
                three, place = self._turn.threes[node.text]
                self.lines.append(f"const S {node.text} = {self._registers[three]}[{place}];")
                self._read.add(node.text)
        return cpp.expression_text(summed)

    def _totals(self, x: Expression) -> Expression:
        match x:
            case Sum(Sum(a, b), c) if self._turn.image(a) == b and self._turn.image(b) == c:
                return Name(f"lanes::total({self.vector(a)})")
            case Name() | Number():
                return x
            case _:
                return replace_children(x, map(self._totals, children(x)))

    def _lanes(self, name: str) -> Expression:
        if name not in self._turn.threes:
            return Name(f"four({name})")
        three, place = self._turn.threes[name]
        if three not in self._registers:
            first = three[0][1]
            register = f"three_{first.replace('.', '_')}"
            held = ", ".join(f"{'-' * (sign < 0)}{n}" for sign, n in (*three, three[0]))
            self.lines.append(f"const auto {register} = four({held});")
            self._registers[three] = register
        lanes = Name(_turned(self._registers[three], _NEXT[place]))
        return lanes if three[place][0] > 0 else Negative(lanes)


_NEXT = ((1, 2, 3, 4), (2, 3, 4, 2), (3, 1, 2, 3))
"""Three lanes in turn, from each on; the fourth is always the first again."""


def _of_vectors(x: Expression) -> Expression:
    match x:
        case Number():
            return Name(f"four({cpp.expression_text(x)})")
        case Name():
            return x
        case _:
            return replace_children(x, map(_of_vectors, children(x)))


class _Packer:
    def __init__(self, program: Program) -> None:
        self._place = {
            f"{p.name}.{c.name}": (p.name, index)
            for p in program.parameters
            for index, c in enumerate(p.element.components)
        }
        self._bindings = dict(program.bindings)
        self._registers: dict[frozenset[str], list[str]] = {}
        self._shuffles: set[tuple[str, tuple[int, ...]]] = set()
        self.loads: list[str] = []
        self.sums: dict[str, tuple[str, int]] = {}

    def best_order(self, names: Sequence[str], wanted: Mapping[str, Expression]) -> list[str]:
        """The order of lanes that takes the fewest shuffles that no other sum takes.

        One of the result counts as three: all else is behind it.
        """
        kept = dict(self._registers), set(self._shuffles), list(self.loads)
        found = []
        for order in permutations(names):
            self.text([wanted[name] for name in order])
            turned = list(order) != list(names)
            found.append((len(self._shuffles) + 3 * turned, list(order)))
            self._registers, self._shuffles, self.loads = (
                dict(kept[0]),
                set(kept[1]),
                list(kept[2]),
            )
        return min(found, key=lambda shuffles_and_order: shuffles_and_order[0])[1]

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
            arguments += [firsts.pop(), self._second(signs, seconds)]
        arguments[::2] = self._broadcast(arguments[::2])
        return f"dot({', '.join(arguments)})"

    def _broadcast(self, firsts: Sequence[str]) -> list[str]:
        """Each number in all lanes; four sums of components in turn from one register."""
        texts: list[str] = []
        while len(texts) < len(firsts):
            names = list(firsts[len(texts) : len(texts) + WIDTH])
            if sums := self.sums.get(names[0]):
                vector, lane = sums
                texts.append(f"lanes::each<{lane}>({vector})")
            elif len(set(names)) == WIDTH and (register := self._bound(names)):
                where = (register.index(name) for name in names)
                texts += [f"lanes::each<{lane}>({self._name(register)})" for lane in where]
            else:
                texts.append(f"four({names[0]})")
        return texts

    def _bound(self, names: list[str]) -> list[str] | None:
        """The register of four bindings, where they are a sum of two vectors."""
        known = self._registers.get(frozenset(names))
        if known is None and self._sum(names):
            known = self._register(names)
        return known if known and known[0] in self._bindings else None

    def _second(self, signs: list[int], lanes: list[Expression]) -> str:
        if all(isinstance(x, MultiplyAdd) for x in lanes):
            if set(signs) != {1}:
                raise _Unpackable
            return self.text(lanes)
        return _turned(*self._lanes(signs, lanes))

    def _lanes(self, signs: list[int], lanes: list[Expression]) -> _Turned:
        names = [x.text for x in lanes if isinstance(x, Name)]
        if len(set(names)) != WIDTH:
            raise _Unpackable
        register = self._register(names)
        where = [register.index(name) for name in names]
        if where != list(range(WIDTH)):
            self._shuffles.add((self._name(register), tuple(where)))
        order = tuple(s * (k + 1) for s, k in zip(signs, where, strict=True))
        return self._name(register), order

    def _register(self, names: list[str]) -> list[str]:
        key = frozenset(names)
        if key not in self._registers:
            if not self.sums.keys().isdisjoint(key) or any(
                key & other for other in self._registers
            ):
                raise _Unpackable  # not blocks of components: more loads than it saves
            order = sorted(names, key=self._first_place)
            self._registers[key] = order
            loaded = self._sum(order) or f"four({', '.join(order)})"
            self.loads.append(f"const auto {self._name(order)} = {loaded};")
        return self._registers[key]

    def _first_place(self, name: str) -> tuple[str, int]:
        """Where a component stands, or the first that is added in a binding."""
        match self._bindings.get(name):
            case Sum(a, _) if isinstance(x := _unsigned(a)[1], Name):
                name = x.text
        return self._place.get(name, ("", 0))

    def _sum(self, names: list[str]) -> str:
        """Four bindings ±x ± y, as the sum of two vectors."""
        parts: list[list[tuple[int, Expression]]] = [[], []]
        for name in names:
            expression = self._bindings.get(name)
            if not isinstance(expression, Sum):
                return ""
            for part, x in zip(parts, (expression.a, expression.b), strict=True):
                part.append(_unsigned(x))
        sides = []
        for part in parts:
            if not all(isinstance(x, Name) and x.text in self._place for _, x in part):
                return ""
            sides.append(self._lanes([s for s, _ in part], [x for _, x in part]))
        return _added(*sides)

    @staticmethod
    def _name(register: list[str]) -> str:
        return "four_" + register[0].replace(".", "_")
