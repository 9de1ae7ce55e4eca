"""Every polynomial kernel equals the oracle, exactly, wherever that determines it.

The list of kernels is the generated index itself: a kernel without a definition here fails.  The
C++ kernels run on exact rational numbers; the definitions are the oracle's and theory.md's.

A kernel that is linear in an operand is determined by basis vectors (and by 0 where the operand
has a fixed part); one that is quadratic by sums of two; a sandwich, quadratic in a unit versor, by
versors whose quadratic monomials span all that M ~M = 1 leaves of them.  Multiples and random
points guard the degrees themselves.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import combinations_with_replacement, product
from pathlib import Path
from typing import Any

import pytest
from tests.reference.oracle import Blade, Oracle, added, scaled

ROOT = Path(__file__).resolve().parents[2]
GENERATED = ROOT / "generated"
BUILDS = ROOT / ".hamotor" / "build" / "exact"
ALGEBRAS = sorted(path.parent.name for path in GENERATED.glob("hamotor/*/kernels.json"))

LARGEST_SPANNED = 8
"""Versors with more components are tried on samples: the generator itself proves them on all."""
SAMPLES = 12

Value = dict[Blade, Fraction]
Point = tuple[Fraction, ...]


@dataclass(frozen=True)
class Element:
    """An element type as the index gives it."""

    name: str
    unit: bool
    fixed: Value
    embeddings: tuple[Value, ...]

    @property
    def size(self) -> int:
        """Number of components."""
        return len(self.embeddings)

    def value(self, components: Sequence[Fraction]) -> Value:
        """The multivector with these components."""
        total: Value = dict(self.fixed)
        for x, embedding in zip(components, self.embeddings, strict=True):
            total = added(total, scaled(x, embedding))
        return total

    def basis(self) -> list[Point]:
        """0 and the basis vectors."""
        zero = (Fraction(0),) * self.size
        return [zero, *(_with(zero, i, Fraction(1)) for i in range(self.size))]


def _with(point: Point, index: int, value: Fraction) -> Point:
    return (*point[:index], value, *point[index + 1 :])


class Library:
    """The generated library of an algebra: its index, its oracle and its kernels on rationals."""

    def __init__(self, name: str) -> None:
        """Read the index."""
        index = json.loads((GENERATED / "hamotor" / name / "kernels.json").read_text("utf-8"))
        self.name = name
        self.suffixes = [vector[1:] for vector in index["basis"]]
        self.oracle = Oracle([[Fraction(x) for x in row] for row in index["gram"]])
        self.elements = {e["name"]: self._element(e) for e in index["elements"]}
        self.kernels: list[dict[str, Any]] = index["kernels"]
        # A matrix is determined by its images, one by one: together they are a sandwich.
        self.polynomial = [
            self._whole(k)
            for k in self.kernels
            if k["polynomial"] and not k["name"].endswith("_matrix")
        ]
        self._moved = cache(self._moved_blade)
        self.versors = cache(self._versors)

    def _whole(self, kernel: dict[str, Any]) -> dict[str, Any]:
        """The kernel; of a matrix's application to an element, both steps in one."""
        if kernel["name"] != "transform":
            return kernel
        matrix, operand = kernel["operands"]
        ((first, versor),) = {
            (k["name"], *k["operands"]) for k in self.kernels if k["result"] == matrix
        }
        return kernel | {"operands": [versor, operand], "first": first}

    def _blade(self, name: str) -> Blade:
        if name == "s":
            return ()
        blade = []
        rest = name[1:]
        while rest:
            index = next(i for i, s in enumerate(self.suffixes) if rest.startswith(s))
            blade.append(index)
            rest = rest[len(self.suffixes[index]) :]
        assert blade == sorted(blade)
        return tuple(blade)

    def _value(self, data: Mapping[str, str]) -> Value:
        return {self._blade(blade): Fraction(x) for blade, x in data.items()}

    def _element(self, data: Mapping[str, Any]) -> Element:
        embeddings = tuple(self._value(e) for e in data["components"].values())
        return Element(data["name"], data["unit"], self._value(data["fixed"]), embeddings)

    def operands(self, kernel: Mapping[str, Any]) -> list[Element]:
        """Element types of a kernel's arguments."""
        return [self.elements[name] for name in kernel["operands"]]

    def group_of(self, kernel: Mapping[str, Any]) -> tuple[Element, Element]:
        """Rates and momenta of the group that a kernel belongs to."""
        space = kernel["namespace"]
        return self.elements[f"{space}::Rate"], self.elements[f"{space}::Momentum"]

    def definition(self, kernel: Mapping[str, Any]) -> Callable[..., Value]:
        """What a kernel must be: a function of multivectors."""
        o = self.oracle
        name: str = kernel["name"]
        if name.startswith("grade_"):
            wanted = int(name.removeprefix("grade_"))
            return lambda a: o.grade(a, wanted)
        definitions: dict[str, Callable[..., Value]] = {
            "gp": o.gp,
            "outer": o.outer,
            "inner": o.inner,
            "left_contraction": o.left_contraction,
            "right_contraction": o.right_contraction,
            "regressive": o.regressive,
            "commutator": o.commutator,
            "anticommutator": o.anticommutator,
            "reverse": o.reverse,
            "complement": o.complement,
            "complement_inverse": self.complement_inverse,
            "polarity": lambda a: o.gp(a, self.pseudoscalar),
            "polarity_inverse": lambda a: scaled(
                1 / Fraction(o.gp(self.pseudoscalar, self.pseudoscalar)[()]),
                o.gp(a, self.pseudoscalar),
            ),
            "involute": self.involute,
            "conjugate": lambda a: self.involute(o.reverse(a)),
            "project": lambda a, b: o.gp(o.inner(a, b), o.reverse(b)),
            "norm_squared": lambda a: o.grade(o.gp(a, o.reverse(a)), 0),
            "exp": self.null_exponential,
            "cayley": o.cayley,
            "unit_defect": lambda m: added(o.gp(m, o.reverse(m)), {(): Fraction(-1)}),
            "unit_defect_change": lambda m, x: added(o.gp(m, o.reverse(x)), o.gp(x, o.reverse(m))),
            "unit_correction": lambda m, d: scaled(Fraction(-1, 2), o.gp(d, m)),
            "sandwich": self.sandwich,
            "sandwich_lean": self.sandwich,
            "transform": self.sandwich,
            "ad": self.bracket,
            "coadjoint": lambda w, mu: self.bracket(mu, w),
            "kinematics": o.gp,
            "kinematics_onto": lambda x, m, w: added(x, scaled(2, o.gp(m, w))),
            "Ad": self.sandwich,
            "Ad_star_inverse": self.sandwich,
            "pairing": lambda mu, w: {(): x} if (x := self.pairing(mu, w)) else {},
        }
        return definitions[name]

    @property
    def pseudoscalar(self) -> Value:
        """I."""
        return {self.oracle.pseudoscalar: Fraction(1)}

    def involute(self, a: Value) -> Value:
        """(−1)^k on grade k."""
        return {blade: -x if len(blade) % 2 else x for blade, x in a.items()}

    def complement_inverse(self, a: Value) -> Value:
        """The multivector whose right complement is a: ± the complement itself, blade by blade."""
        total: Value = {}
        for blade, x in a.items():
            once = self.oracle.complement({blade: Fraction(1)})
            ((_, sign),) = self.oracle.complement(once).items()
            total = added(total, scaled(x * sign, once))
        return total

    def components(self, kernel: Mapping[str, Any], value: Value) -> Point:
        """What the result type of a kernel keeps of a value.

        The dual of a subalgebra is a quotient: a momentum keeps its pairings with the generators.
        A projection keeps the part that its result type holds.
        """
        result = self.elements[kernel["result"]]
        if kernel["result"].endswith("::Momentum"):
            rate, _ = self.group_of(kernel)
            return tuple(self.pairing(value, generator) for generator in rate.embeddings)
        if kernel["name"] == "project":
            kept = {b for e in result.embeddings for b in e} | set(result.fixed)
            value = {b: x for b, x in value.items() if b in kept}
        found = tuple(
            sum((value.get(b, Fraction(0)) / x for b, x in e.items()), Fraction(0)) / len(e)
            for e in result.embeddings
        )
        assert result.value(found) == value, f"{kernel['name']} {kernel['operands']}: not closed"
        return found

    def null_exponential(self, b: Value) -> Value:
        """exp b = 1 + b, the only exponential that is polynomial."""
        assert not self.oracle.gp(b, b)
        return added({(): Fraction(1)}, b)

    def bracket(self, a: Value, b: Value) -> Value:
        """a b − b a."""
        return added(self.oracle.gp(a, b), scaled(-1, self.oracle.gp(b, a)))

    def pairing(self, mu: Value, w: Value) -> Fraction:
        """μ(w), with μ(w) I = μ ∧ w."""
        return Fraction(self.oracle.outer(mu, w).get(self.oracle.pseudoscalar, 0))

    def sandwich(self, m: Value, x: Value) -> Value:
        """m x ~m, from the images of basis blades."""
        key = tuple(sorted(m.items()))
        total: Value = {}
        odd = any(len(blade) % 2 for blade in m)
        for blade, coefficient in x.items():
            sign = -1 if odd and len(blade) % 2 else 1
            total = added(total, scaled(sign * coefficient, self._moved(key, blade)))
        return total

    def _moved_blade(self, m: tuple[tuple[Blade, Fraction], ...], blade: Blade) -> Value:
        return self.oracle.sandwich(dict(m), {blade: Fraction(1)})

    def _versors(self, name: str) -> tuple[Point, ...]:
        """Rational unit versors, as many as determine any quadratic function on all of them."""
        o, element = self.oracle, self.elements[name]
        blades = [b for e in element.embeddings for b in e]
        planes = [b for b in blades if len(b) == 2]
        dice = random.Random(element.name)
        if not planes:
            return self._mirrors(element)
        monomials = list(combinations_with_replacement(range(element.size), 2))
        span = Span()
        points: list[Point] = []
        full = len(monomials) + 1 - self._conditions(element)
        if element.size > LARGEST_SPANNED:
            full = SAMPLES
        for _ in range(50 * full):
            if span.rank == full:
                break
            bivector: Value = {b: x for b in planes if (x := Fraction(dice.randint(-2, 2)))}
            try:
                value = o.cayley(bivector)
            except StopIteration:  # 1 − B has no inverse
                continue
            assert set(value) <= set(blades)
            assert o.gp(value, o.reverse(value)) == {(): 1}
            point = tuple(
                value.get(b, Fraction(0)) * x for e in element.embeddings for b, x in e.items()
            )
            if span.grows([Fraction(1), *(point[i] * point[j] for i, j in monomials)]):
                points.append(point)
        assert span.rank == full
        identity = tuple(Fraction(int(e == {(): 1})) for e in element.embeddings)
        return (*points, identity, tuple(-x for x in identity))

    def _mirrors(self, element: Element) -> tuple[Point, ...]:
        """Rational unit vectors, b ~b = 1: a unit vector reflected in random ones."""
        o = self.oracle
        basis = [e for e in element.embeddings if o.gp(e, o.reverse(e)) == {(): 1}]
        dice = random.Random(element.name)
        points: list[Point] = []
        for _ in range(60):
            vector: Value = {
                b: Fraction(dice.randint(-3, 3)) for e in element.embeddings for b in e
            }
            square = o.gp(vector, vector).get((), Fraction(0))
            if not square:
                continue
            moved = scaled(1 / Fraction(square), o.gp(o.gp(vector, basis[0]), vector))
            assert o.gp(moved, moved) == {(): 1}
            points.append(
                tuple(
                    moved.get(b, Fraction(0)) * x for e in element.embeddings for b, x in e.items()
                )
            )
        assert points
        return tuple(points)

    def _conditions(self, element: Element) -> int:
        """Independent equations among those that M ~M = 1 asks of an element."""
        o = self.oracle
        rows: dict[Blade, list[Fraction]] = {}
        pairs = list(combinations_with_replacement(range(element.size), 2))
        for column, (i, j) in enumerate(pairs):
            a, b = element.embeddings[i], element.embeddings[j]
            square = o.gp(a, o.reverse(b))
            if i != j:
                square = added(square, o.gp(b, o.reverse(a)))
            for blade, x in square.items():
                rows.setdefault(blade, [Fraction(0)] * len(pairs))[column] = Fraction(x)
        span = Span()
        for row in rows.values():
            span.grows(row)
        return span.rank

    def points(self, kernel: Mapping[str, Any]) -> list[tuple[Point, ...]]:
        """Arguments that determine a kernel, and some that guard its degree."""
        operands = self.operands(kernel)
        dice = random.Random(str(kernel))
        if kernel["name"] in ("norm_squared", "unit_defect"):
            (element,) = operands
            basis = element.basis()
            sums: list[Point] = [
                tuple(x + y for x, y in zip(a, b, strict=True))
                for a, b in combinations_with_replacement(basis, 2)
            ]
            sums += [_random(dice, element) for _ in range(20)]
            return [(point,) for point in sums]
        choices: list[Sequence[Point]] = [element.basis() for element in operands]
        if kernel["name"] in ("sandwich", "sandwich_lean", "transform", "Ad", "Ad_star_inverse"):
            choices[0] = self.versors(operands[0].name)
            extra = [(dice.choice(choices[0]), _random(dice, operands[1])) for _ in range(20)]
            return [*product(*choices), *extra]
        doubled = [
            tuple(tuple(2 * x for x in point) for point in points) for points in product(*choices)
        ]
        spread = [tuple(_random(dice, e) for e in operands) for _ in range(20)]
        return [*product(*choices), *doubled, *spread]


def _random(dice: random.Random, element: Element) -> Point:
    return tuple(Fraction(dice.randint(-50, 50)) for _ in range(element.size))


class Span:
    """The span of rational vectors, in echelon form."""

    def __init__(self) -> None:
        """Start with nothing."""
        self._rows: list[tuple[int, list[Fraction]]] = []

    @property
    def rank(self) -> int:
        """Dimension of the span."""
        return len(self._rows)

    def grows(self, vector: Sequence[Fraction]) -> bool:
        """Add a vector; whether it was outside of the span."""
        rest = list(vector)
        for pivot, row in self._rows:
            if rest[pivot]:
                factor = rest[pivot]
                rest = [x - factor * y for x, y in zip(rest, row, strict=True)]
        pivot = next((i for i, x in enumerate(rest) if x), -1)
        if pivot < 0:
            return False
        head = rest[pivot]
        self._rows.append((pivot, [x / head for x in rest]))
        return True


# ---------------------------------------------------------------- the kernels in C++


def _cpp_type(name: str) -> str:
    return "S" if name == "Scalar" else f"{name}<S>"


def source(library: Library) -> str:
    """A program: kernel numbers and arguments in, results out, all exact."""
    cases = []
    for number, kernel in enumerate(library.polynomial):
        lines = []
        for position, (name, element) in enumerate(
            zip(kernel["operands"], library.operands(kernel), strict=True)
        ):
            reads = ", ".join("read()" for _ in range(element.size))
            lines.append(f"const {_cpp_type(name)} a{position}{{{reads}}};")
        names = [f"a{i}" for i in range(len(kernel["operands"]))]
        if first := kernel.get("first"):
            names[0] = f"{first}({names[0]})"
        arguments = ", ".join(names)
        space = f"{kernel['namespace']}::" if kernel["namespace"] else ""
        lines.append(f"write({space}{kernel['name']}({arguments}));")
        cases.append(f"    case {number}: {{ {' '.join(lines)} break; }}")
    return "\n".join(
        [
            "#include <cstdio>",
            f'#include "hamotor/{library.name}/{library.name}.hpp"',
            '#include "tests/reference/rational.hpp"',
            f"namespace hamotor::{library.name} {{",
            "using S = tests::Rational;",
            "S read() {",
            "  long long p = 0, q = 1;",
            '  if (std::scanf("%lld/%lld", &p, &q) != 2) std::abort();',
            "  return S(p, q);",
            "}",
            "void write(const S& x) {",
            '  std::printf("%lld/%lld ", (long long)x.numerator(), (long long)x.denominator());',
            "}",
            "template <class T>",
            "void write(const T& value) {",
            "  for (const S& x : value.components()) write(x);",
            "}",
            "void evaluate(int kernel) {",
            "  switch (kernel) {",
            *cases,
            "    default: std::abort();",
            "  }",
            '  std::printf("\\n");',
            "}",
            f"}}  // namespace hamotor::{library.name}",
            "int main() {",
            f'  for (int k = 0; std::scanf("%d", &k) == 1;) hamotor::{library.name}::evaluate(k);',
            "}",
            "",
        ]
    )


def program(library: Library) -> Path:
    """The compiled program; built once for the same text and headers."""
    text = source(library)
    headers = [
        *sorted((GENERATED / "hamotor" / library.name).glob("*.hpp")),
        *sorted((ROOT / "runtime/include").rglob("*.hpp")),
        ROOT / "tests/reference/rational.hpp",
    ]
    identity = hashlib.sha256(text.encode())
    for path in headers:
        identity.update(path.read_bytes())
    target = BUILDS / f"{library.name}-{identity.hexdigest()[:16]}"
    if not target.exists():
        BUILDS.mkdir(parents=True, exist_ok=True)
        for older in BUILDS.glob(f"{library.name}-{'?' * 16}"):
            older.unlink(missing_ok=True)
        unfinished = BUILDS / f"{os.getpid()}-{target.name}"
        code = unfinished.with_name(f"{unfinished.name}.cpp")
        code.write_text(text, encoding="utf-8")
        folders = [f"-I{folder}" for folder in (GENERATED, ROOT / "runtime/include", ROOT)]
        command = ["g++", "-std=c++20", "-O0", *folders, str(code), "-o", str(unfinished)]
        subprocess.run(command, check=True)
        code.unlink()
        unfinished.replace(target)
    return target


def evaluated(
    library: Library, arguments: Sequence[tuple[int, tuple[Point, ...]]]
) -> list[list[Fraction]]:
    """Results of kernels by number, in C++."""
    lines = [
        f"{number} {' '.join(f'{x.numerator}/{x.denominator}' for p in points for x in p)}"
        for number, points in arguments
    ]
    run = subprocess.run(
        [str(program(library))], input="\n".join(lines), check=True, capture_output=True, text=True
    )
    return [[Fraction(word) for word in line.split()] for line in run.stdout.splitlines()]


@cache
def library_of(name: str) -> Library:
    """The library of an algebra, read once."""
    return Library(name)


# ---------------------------------------------------------------- the laws


def test_there_are_algebras_to_check() -> None:
    assert {"pga2", "pga3"} <= set(ALGEBRAS)


@pytest.mark.parametrize("algebra", ALGEBRAS)
def test_every_kernel_equals_its_definition_on_all_that_determines_it(algebra: str) -> None:
    library = library_of(algebra)
    arguments = [
        (number, points)
        for number, kernel in enumerate(library.polynomial)
        for points in library.points(kernel)
    ]
    found = evaluated(library, arguments)
    assert len(found) == len(arguments)
    wrong = []
    for (number, points), components in zip(arguments, found, strict=True):
        kernel = library.polynomial[number]
        operands = library.operands(kernel)
        values = [e.value(p) for e, p in zip(operands, points, strict=True)]
        expected = library.definition(kernel)(*values)
        if tuple(components) != library.components(kernel, expected):
            wrong.append(f"{kernel['name']} {kernel['operands']}: {points} gave {components}")
    assert not wrong, "\n".join([f"{len(wrong)} wrong", *wrong[:10]])


@pytest.mark.parametrize("algebra", ALGEBRAS)
def test_dual_basis_and_coadjoint_are_what_the_pairing_says(algebra: str) -> None:
    """T^a ∧ E_b = δ I, and (ad*_w μ)(b) = μ([w, b]) with ad*_w μ = [μ, w]."""
    library = library_of(algebra)
    groups = {k["namespace"]: library.group_of(k) for k in library.kernels if k["namespace"]}
    assert groups
    for rate, momentum in groups.values():
        for a, t in enumerate(momentum.embeddings):
            for b, generator in enumerate(rate.embeddings):
                assert library.pairing(t, generator) == int(a == b)
        for w in rate.embeddings:
            for mu in momentum.embeddings:
                moved = library.bracket(mu, w)
                for z in rate.embeddings:
                    assert library.pairing(moved, z) == library.pairing(mu, library.bracket(w, z))


@pytest.mark.parametrize("algebra", ALGEBRAS)
def test_no_kernel_is_without_a_definition(algebra: str) -> None:
    library = library_of(algebra)
    known = {"exp", "log", "cayley", "cayley_inverse", "normalize", "norm", "inverse", "sqrt"}
    known |= {"dexp", "dexp_inverse"}
    for kernel in library.kernels:
        if kernel["name"].endswith("_matrix"):
            assert any(kernel["name"] == k.get("first") for k in library.polynomial)
        elif kernel["polynomial"]:
            assert callable(library.definition(kernel))
        else:
            assert kernel["name"].removesuffix("_lean") in known, (
                "see test_closed_forms.py and test_jacobians.py"
            )


def test_a_wrong_kernel_is_caught(tmp_path: Path) -> None:
    """One changed sign in one generated product, and the comparison would see it."""
    library = library_of("pga2")
    header = (GENERATED / "hamotor/pga2/kernels.hpp").read_text("utf-8")
    start = header.index("/// gp: Motor Motor -> Motor")
    wrong = header[:start] + header[start:].replace("-a.e12", "a.e12", 1)
    assert wrong != header
    folder = tmp_path / "hamotor" / "pga2"
    folder.mkdir(parents=True)
    for path in (GENERATED / "hamotor/pga2").glob("*.hpp"):
        text = wrong if path.name == "kernels.hpp" else path.read_text("utf-8")
        (folder / path.name).write_text(text, "utf-8")
    code = tmp_path / "wrong.cpp"
    code.write_text(source(library), "utf-8")
    folders = [f"-I{folder}" for folder in (tmp_path, ROOT / "runtime/include", ROOT)]
    subprocess.run(
        ["g++", "-std=c++20", "-O0", *folders, str(code), "-o", str(tmp_path / "wrong")],
        check=True,
    )
    number = next(
        n
        for n, k in enumerate(library.polynomial)
        if k["name"] == "gp" and k["operands"] == ["Motor", "Motor"]
    )
    points = library.points(library.polynomial[number])
    lines = [
        f"{number} {' '.join(f'{x.numerator}/{x.denominator}' for p in ps for x in p)}"
        for ps in points
    ]
    run = subprocess.run(
        [str(tmp_path / "wrong")],
        input="\n".join(lines),
        check=True,
        capture_output=True,
        text=True,
    )
    found = [[Fraction(word) for word in line.split()] for line in run.stdout.splitlines()]
    right = evaluated(library, [(number, p) for p in points])
    assert found != right
