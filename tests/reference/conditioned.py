"""The accuracy of every kernel of every bundled algebra, scaled by its conditioning, measured.

conditioned.hpp measures; this module writes one program an algebra from the kernels themselves, so
that a new kernel is measured without a line here.  The reference is the kernel in `__float128`:
the programs of polynomial kernels are proved equal to their definitions when they are generated,
and `worst_defect` holds the others against the equations that define them, in 60 digits with
products from the oracle.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
from tests.reference.oracle import Blade as Word
from tests.reference.oracle import Oracle, scaled
from tests.reference.oracle import added as plus

from hamotor.codegen import bundled_algebras
from hamotor.codegen.algebra import Blade, grade, magnitude
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import BladeProduct, Kernel, read_off, value_of
from hamotor.codegen.library import library
from hamotor.codegen.polynomial import Polynomial, added, apply_bilinear
from hamotor.codegen.spec import AlgebraSpec, bundled_path, read_algebra

ROOT = Path(__file__).resolve().parents[2]
BUILDS = ROOT / ".hamotor" / "build" / "ulp"
MEASURE = Path(__file__).with_name("conditioned.hpp")
RANDOM = MEASURE.with_name("random.hpp")
ALGEBRAS = tuple(bundled_algebras())
SCALARS = ("double", "float")

PRODUCTS = (
    "gp",
    "outer",
    "inner",
    "left_contraction",
    "right_contraction",
    "regressive",
    "commutator",
    "anticommutator",
    "project",
    "sandwich",
    "sandwich_lean",
    "transform",
    "norm_squared",
    "ad",
    "coadjoint",
    "kinematics",
    "Ad",
    "Ad_star_inverse",
    "pairing",
)
"""Polynomial kernels with sums in them; the others only move or change signs of numbers."""


def is_product(name: str) -> bool:
    """Whether a kernel of that name is one of these, or gives a versor's matrix."""
    return name in PRODUCTS or name.endswith("_matrix")


DEFINED = ("exp", "log", "sqrt", "cayley_inverse", "cayley", "inverse", "norm", "normalize")
"""Functions with an equation to hold the reference against; a variant is called NAME_VARIANT."""

SANDWICHES = ("sandwich", "sandwich_lean", "Ad", "Ad_star_inverse")


def bound(kernel: Kernel) -> float:
    """Units of the condition that a kernel may be off."""
    if kernel.meaning is None:
        return 4.0
    return 3.0 if kernel.name == "sandwich_lean" else 2.0


@cache
def spec(algebra: str) -> AlgebraSpec:
    """The bundled algebra."""
    return read_algebra(bundled_path(algebra))


@cache
def _library(algebra: str) -> tuple[Kernel, ...]:
    return library(spec(algebra))


@cache
def kernels(algebra: str) -> tuple[Kernel, ...]:
    """What is measured; dexp and its inverse are in jacobian.md.

    In the order of the library, lean sandwiches last: a kernel's points depend on its place.
    """
    measured = [
        k
        for k in _library(algebra)
        if is_product(k.name) or (k.meaning is None and len(k.operands) == 1)
    ]
    return tuple(sorted(measured, key=lambda k: k.name == "sandwich_lean"))


# ---------------------------------------------------------------- the program


def _number(x: Any) -> str:
    return repr(float(x))


def _parts(values: Iterable[tuple[int, Mapping[Blade, Any]]]) -> str:
    parts = [f"{{{i}, {b}, {_number(x)}}}" for i, value in values for b, x in value.items()]
    return ", ".join(parts) or "{0, 0, 0.0}"


def _element_text(algebra: str, element: Element) -> str:
    name = _identifier(element)
    embedding = _parts(enumerate(c.embedding for c in element.components))
    reading = _parts(enumerate(element.reading))
    unit = "true" if element.unit else "false"
    weights = _weights(algebra, element)
    return (
        f"const std::vector<Part> {name}_embedding{{{embedding}}};\n"
        f"const std::vector<Part> {name}_reading{{{reading}}};\n"
        f"const std::vector<int> {name}_weights{{{', '.join(map(str, weights))}}};\n"
        f"const Element {name}{{{len(element.components)}, {unit}, "
        f"{name}_embedding, {name}_reading, {name}_weights}};\n"
    )


def _weights(algebra: str, element: Element) -> list[int]:
    """How each component scales with the unit of length: as the null vectors of its blade do."""
    gram = spec(algebra).algebra.gram
    of_vector = []
    for i, row in enumerate(gram):
        partner = next((j for j, x in enumerate(row) if x and j != i), i)
        of_vector.append(0 if row[i] else -1 if partner > i else 1)
    return [
        sum(w for i, w in enumerate(of_vector) if next(iter(c.embedding), 0) >> i & 1)
        for c in element.components
    ]


def _identifier(element: Element) -> str:
    return element.cpp_name.replace("::", "_") + "_"


def _cpp_type(algebra: str, element: Element) -> str:
    return f"hamotor::{algebra}::{element.cpp_name}"


def _call(algebra: str, kernel: Kernel) -> str:
    scope = "::".join(x for x in ("hamotor", algebra, kernel.namespace) if x)
    return f"{scope}::{kernel.name}"


def _terms(algebra: str, kernel: Kernel) -> str:
    """The monomials of the result, with the numbers of the operands' components."""
    numbers = [
        f"{p.name}.{c.name}" for p in kernel.program.parameters for c in p.element.components
    ]
    place = {name: i for i, name in enumerate(numbers)}
    rows = []
    for output, polynomial in enumerate(_meaning(algebra, kernel).values()):
        for monomial, x in polynomial.items():
            factors = [*(place[name] for name in monomial), -1, -1, -1][:3]
            listed = ", ".join(map(str, factors))
            rows.append(f"{{{output}, {_number(x)}, {{{listed}}}}}")
    return ", ".join(rows)


def _meaning(algebra: str, kernel: Kernel) -> Mapping[str, Polynomial]:
    """The polynomials of a kernel; for a sandwich the sizes of the terms of X + [M, X] ~M."""
    assert kernel.meaning is not None
    if kernel.name not in SANDWICHES:
        return kernel.meaning
    result = kernel.program.result
    assert result is not None
    whole = spec(algebra).algebra
    odd = "M X + X M" in kernel.notes[0]
    bracket = whole.anticommutator if odd else whole.commutator

    def sizes(product: BladeProduct, factor: int) -> BladeProduct:
        return lambda a, b: {c: factor * magnitude(x) for c, x in product(a, b).items()}

    m, x = (
        {b: {n: magnitude(c) for n, c in p.items()} for b, p in value_of(operand).items()}
        for operand in kernel.program.parameters
    )
    change = apply_bilinear(sizes(whole.geometric, 1), apply_bilinear(sizes(bracket, 2), m, x), m)
    moved = added(x, change)
    return {
        component: {n: magnitude(c) for n, c in p.items()}
        for component, p in read_off(moved, result).items()
    }


def _operand_kernel(algebra: str, name: str, *, operand: Element | None, result: Element) -> Any:
    """The kernel of that name that gives this element, perhaps of one given operand."""
    for kernel in _library(algebra):
        fits = operand is None or kernel.operands[0] == operand
        if kernel.name == name and kernel.program.result == result and fits:
            return kernel
    return None


def _input(algebra: str, kernel: Kernel) -> str:
    (operand,) = kernel.operands
    name = _identifier(operand)
    if kernel.name.startswith("normalize"):
        return f"return sampler.near_versor({name});"
    if not operand.unit:
        kind = "numbers" if kernel.name in ("norm", "inverse") else "bivector"
        of = f"{name}.size" if kind == "numbers" else name
        return f"return sampler.{kind}({of});"
    wanted = kernel.program.result if kernel.name.startswith("log") else None
    exponential = _operand_kernel(algebra, "exp", operand=wanted, result=operand)
    if exponential is None:
        return f"return sampler.versor({name});"
    (bivector,) = exponential.operands
    return (
        "const auto m = evaluate<Quad, "
        f"{_cpp_type(algebra, bivector)}>([](const auto& b) {{ return "
        f"{_call(algebra, exponential)}(b); }}, sampler.bivector({_identifier(bivector)}));\n"
        "  return Numbers(m.begin(), m.end());"
    )


@cache
def source(algebra: str) -> str:
    """The measuring program of an algebra."""
    whole = spec(algebra)
    blades = range(1 << whole.algebra.dimension)
    product = [
        f"{{{a}, {b}, {c}, {_number(x)}}}"
        for a in blades
        for b in blades
        for c, x in whole.algebra.blade_product(a, b).items()
    ]
    squares = [_number(whole.algebra.blade_product(b, b).get(0, 0)) for b in blades]
    found = kernels(algebra)
    elements = {_identifier(e): e for k in found for e in k.operands}
    for kernel in _library(algebra):
        if kernel.name == "exp":
            elements |= {_identifier(e): e for e in kernel.operands}
    lines = [
        f'#include "hamotor/{algebra}/{algebra}.hpp"',
        *(f'#include "hamotor/{algebra}/{g.rate.namespace}.hpp"' for g in whole.groups),
        f'#include "{MEASURE}"',
        "using namespace conditioned;",
        f"const std::vector<Entry> product{{{', '.join(product)}}};",
        f"const std::vector<double> squares{{{', '.join(squares)}}};",
        f"const std::vector<int> grades{{{', '.join(str(grade(b)) for b in blades)}}};",
        *(_element_text(algebra, e) for e in elements.values()),
    ]
    calls = []
    for index, kernel in enumerate(found):
        types = [_cpp_type(algebra, e) for e in kernel.operands]
        names = [f"x{i}" for i in range(len(types))]
        arguments = ", ".join(f"const auto& {n}" for n in names)
        function = f"[]({arguments}) {{ return {_call(algebra, kernel)}({', '.join(names)}); }}"
        if kernel.meaning is not None:
            lines.append(f"const std::vector<Term> terms_{index}{{{_terms(algebra, kernel)}}};")
            listed = ", ".join(f"&{_identifier(e)}" for e in kernel.operands)
            calls.append(
                f"run.multilinear<{', '.join(types)}>({index}, {{{listed}}}, "
                f"terms_{index}, {function});"
            )
            continue
        (operand,) = kernel.operands
        unit = "[](const auto& a) { return a; }"
        normal = _operand_kernel(algebra, "normalize", operand=operand, result=operand)
        if normal is not None and not kernel.name.startswith("normalize"):
            unit = f"[](const auto& a) {{ return hamotor::{algebra}::normalize(a); }}"
        calls.append(
            f"run.closed_form<{types[0]}>({index}, {_identifier(operand)}, "
            "[](Sampler& sampler) -> Numbers {\n  "
            f"{_input(algebra, kernel)} }}, {function}, {unit});"
        )
    lines += [
        "void all(Run& run) {",
        *calls,
        "}",
        "int main(int argc, char** argv) {",
        f"  const Algebra algebra{{{len(blades)}, product, squares, grades}};",
        "  return conditioned::main(argc, argv, algebra, all);",
        "}",
    ]
    return "\n".join(lines) + "\n"


def program(algebra: str, *, fused: bool, points: int) -> Path:
    """The compiled measuring program; built once for the same text, headers and flags.

    For few points it is not worth optimising.
    """
    level = "-O0" if points < 1000 else "-O1"
    flags = ["-std=gnu++20", level, "-ffp-contract=off", *(["-mfma"] if fused else [])]
    text = source(algebra)
    identity = hashlib.sha256((" ".join(flags) + text).encode())
    headers = [MEASURE, RANDOM, *(ROOT / "runtime" / "include" / "hamotor").glob("*.hpp")]
    headers += (ROOT / "generated" / "hamotor" / algebra).glob("*.hpp")
    for path in sorted(headers):
        identity.update(path.read_bytes())
    stem = f"conditioned-{algebra}{level}-{'fma' if fused else 'plain'}"
    target = BUILDS / f"{stem}-{identity.hexdigest()[:16]}"
    if not target.exists():
        BUILDS.mkdir(parents=True, exist_ok=True)
        for older in BUILDS.glob(f"{stem}-{'?' * 16}"):
            older.unlink(missing_ok=True)
        unfinished = BUILDS / f"{os.getpid()}-{target.name}"
        code = unfinished.with_suffix(".cpp")
        code.write_text(text, encoding="utf-8")
        folders = [f"-I{ROOT / folder}" for folder in ("generated", "runtime/include")]
        command = ["g++", *flags, *folders, str(code), "-o", str(unfinished), "-lquadmath"]
        subprocess.run(command, check=True)
        code.unlink()
        unfinished.replace(target)
    return target


def _lines(
    algebra: str, mode: str, scalar: str, points: int, *, fused: bool
) -> list[dict[str, Any]]:
    command = [str(program(algebra, fused=fused, points=points)), mode, scalar, str(points)]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    text = run.stdout.replace(": inf", ": Infinity").replace(": -nan", ": NaN")
    return [json.loads(line.replace(": nan", ": NaN")) for line in text.splitlines()]


@dataclass(frozen=True)
class KernelMeasurement:
    """The errors of one kernel.

    max_ulp, median_ulp: in units of the condition.  other: the largest in units of each
    component's own condition (polynomial kernels) or of the result's norm (the others).
    """

    algebra: str
    kernel: Kernel
    scalar: str
    points: int
    judged: int
    max_ulp: float
    median_ulp: float
    other: float
    nan: int
    worst: tuple[str, ...]

    @property
    def bound(self) -> float:
        """The largest error allowed."""
        return bound(self.kernel)

    @property
    def fits(self) -> bool:
        """Whether nothing was off by more than the bound, or not a number."""
        return self.max_ulp <= self.bound and self.nan == 0

    @property
    def title(self) -> str:
        """For messages: `pga3 exp(se3::Rate)`."""
        operands = ", ".join(e.cpp_name for e in self.kernel.operands)
        return f"{self.algebra} {self.kernel.name}({operands})"


def measurements(
    points: int, *, fused: bool, algebras: Sequence[str] = ALGEBRAS
) -> list[KernelMeasurement]:
    """Errors of every measured kernel at `points` points, double and float."""

    def measured(job: tuple[str, str]) -> list[KernelMeasurement]:
        algebra, scalar = job
        return [
            KernelMeasurement(
                algebra,
                kernels(algebra)[line["index"]],
                scalar,
                line["points"],
                line["judged"],
                line["max_ulp"],
                line["median_ulp"],
                line["other"],
                line["nan"],
                tuple(line["worst"]),
            )
            for line in _lines(algebra, "measure", scalar, points, fused=fused)
        ]

    for algebra in algebras:
        source(algebra)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda algebra: program(algebra, fused=fused, points=points), algebras))
        jobs = [(algebra, scalar) for algebra in algebras for scalar in SCALARS]
        return [m for found in pool.map(measured, jobs) for m in found]


# ---------------------------------------------------------------- the reference's reference

Value = dict[Word, Any]
ONE: Value = {(): mpmath.mpf(1)}


@cache
def _oracle(algebra: str) -> Oracle:
    return Oracle([[Fraction(x) for x in row] for row in spec(algebra).algebra.gram])


def _value(element: Element | None, numbers: Sequence[Any]) -> Value:
    if element is None:
        return {(): numbers[0]}
    value: Value = {}
    for component, x in zip(element.components, numbers, strict=True):
        for blade, factor in component.embedding.items():
            word = tuple(i for i in range(blade.bit_length()) if blade >> i & 1)
            value[word] = value.get(word, 0) + x * factor.numerator / factor.denominator
    return {word: x for word, x in value.items() if x}


def _size(a: Value) -> Any:
    return mpmath.sqrt(sum((x * x for x in a.values()), mpmath.mpf(0)))


def _exponential(oracle: Oracle, b: Value) -> Value:
    """Power series of b / 2ᵏ, squared k times."""
    halvings = 12 + max(0, int(mpmath.log(_size(b) + 1, 2)))
    small = scaled(mpmath.ldexp(1, -halvings), b)
    term, total = dict(ONE), dict(ONE)
    for n in range(1, 18):
        term = scaled(mpmath.mpf(1) / n, oracle.gp(term, small))
        total = plus(total, term)
    for _ in range(halvings):
        total = oracle.gp(total, total)
    return total


def _unit(oracle: Oracle, m: Value) -> Value:
    """m (~m m)^(−1/2) for m within a few digits of a unit versor, by Newton's iteration."""
    square = oracle.gp(oracle.reverse(m), m)
    root: Value = dict(ONE)
    for _ in range(5):
        correction = oracle.gp(square, oracle.gp(root, root))
        half = mpmath.mpf(1) / 2
        root = oracle.gp(root, plus(scaled(3 * half, ONE), scaled(-half, correction)))
    return oracle.gp(m, root)


def _defect(oracle: Oracle, name: str, a: Value, f: Value) -> Any:
    """How far f is from the equation that defines name(a), relative to the sizes in it."""
    minus_a = scaled(-1, a)
    if name == "exp":
        left, right, sizes = f, _exponential(oracle, a), _size(f) * (1 + _size(a))
    elif name == "log":
        left, right = _exponential(oracle, f), _unit(oracle, a)
        sizes = _size(right) * (1 + _size(f))
    elif name == "sqrt":
        left, right, sizes = oracle.gp(f, f), _unit(oracle, a), _size(f) ** 2
    elif name == "cayley":
        left, right = oracle.gp(f, plus(ONE, minus_a)), plus(ONE, a)
        sizes = (1 + _size(f)) * (1 + _size(a))
    elif name == "cayley_inverse":
        unit = _unit(oracle, a)
        left, right = oracle.gp(f, plus(unit, ONE)), plus(unit, scaled(-1, ONE))
        sizes = (1 + _size(f)) * (1 + _size(a))
    elif name == "inverse":
        left, right, sizes = oracle.gp(a, f), ONE, 1 + _size(a) * _size(f)
    elif name == "norm":
        square = oracle.gp(a, oracle.reverse(a)).get((), mpmath.mpf(0))
        left, right, sizes = oracle.gp(f, f), {(): abs(square)}, _size(a) ** 2
    else:  # normalize: ~f f = 1, and ~f a has no part but of grades 0 and 4
        kept = oracle.gp(oracle.reverse(f), a)
        slip = {w: x for w, x in kept.items() if len(w) not in (0, 4)}
        off = plus(oracle.gp(oracle.reverse(f), f), scaled(-1, ONE))
        return _size(off) / _size(f) ** 2 + _size(slip) / (_size(f) * _size(a))
    return _size(plus(left, scaled(-1, right))) / (sizes or 1)


def worst_defect(algebra: str, points: int, *, fused: bool) -> dict[str, float]:
    """Function and operand → how far the reference is from satisfying what defines it."""
    worst: dict[str, float] = {}
    oracle = _oracle(algebra)
    with mpmath.workdps(60):
        for line in _lines(algebra, "sample", "double", points, fused=fused):
            kernel = kernels(algebra)[line["index"]]
            if kernel.meaning is not None:
                continue
            (operand,) = kernel.operands
            if not all(abs(float(x)) < 1e12 for x in line["truth"]):
                continue  # infinite, or near it
            truth = [mpmath.mpf(x) for x in line["truth"]]
            a = _value(operand, [mpmath.mpf(float(x)) for x in line["input"]])
            f = _value(kernel.program.result, truth)
            name = f"{kernel.name} {operand.cpp_name}"
            base = next(n for n in DEFINED if kernel.name == n or kernel.name.startswith(f"{n}_"))
            worst[name] = max(worst.get(name, 0.0), float(_defect(oracle, base, a, f)))
    return worst


# ---------------------------------------------------------------- the published table


def excepted(found: KernelMeasurement) -> bool:
    """Whether no bound is claimed for this kernel, whose function the table marks."""
    return _mark(found.kernel.name) != ""


def published(table: str) -> dict[tuple[str, str, str], float]:
    """Function name, algebra and scalar → the largest error in the second table of ulp.md."""
    rows = re.findall(
        r"^\| `(\w+)`(?: ‡)? \| (\w+) \| \d+ \| (\S+) \| \S+ \| (\S+) \|", table, re.MULTILINE
    )
    return {
        (name, algebra, scalar): float(error)
        for name, algebra, *errors in rows
        for scalar, error in zip(SCALARS, errors, strict=True)
    }


def _mark(name: str) -> str:
    return " ‡" if name.endswith("_lean") and not is_product(name) else ""


def introduction() -> str:
    """What the second table says and how it was made."""
    return """## Every kernel, scaled by its conditioning

Every kernel of each bundled algebra, at as many points as the last column says; a row holds the
largest error of all its kernels.  Operands: numbers of equal and of very different sizes, small
integers, zeros; unit versors that are products of up to four exponentials, turned or not, with half
angles at 0, π/4, π/2 and π and near them, and translations to 10⁴; bivectors up to length 1,000
that are arbitrary, simple, isoclinic or nearly so, and turned.

Products, sandwiches and the like, bound 2: the unit is ε Σ|terms|, ε = 2⁻⁵² (float: 2⁻²³), the
terms being those of the definition multiplied out, for a sandwich those of X + [M, X] ~M, and both
error and Σ|terms| Euclidean norms over the components.  *By component*: the same with the largest
ratio of any single component, which a product through 2 × 2 matrices does not bound, nor does
`sandwich_lean`, whose bound is 3.

All others, bound 4: the unit is the last place of max(|f|, κ).  κ is the norm of what the result
changes by when a component changes by ±ε of the largest component of the same weight (the same
power of length; both signs, because one may lead across a cut), added up over the components and
divided by ε; for functions of unit versors, of the unit versor nearest to the rounded one.  *Of
the norm*: the unit is the last place of |f| alone.  Points where κ ε > |f|/8, which have no
digit left, are not judged.
"""


def _cells(found: Sequence[KernelMeasurement]) -> str:
    """What stands in a row, after the algebra, for the kernels of one function."""
    by_scalar = {s: [m for m in found if m.scalar == s] for s in SCALARS}
    cells = [str(len(by_scalar[SCALARS[0]]))]
    for measured in by_scalar.values():
        largest = max(m.max_ulp for m in measured)
        other = max(m.other for m in measured)
        cells.append(f"{largest:.3g} | {other:.2g}")
    cells.append(f"{min(m.points for m in found):,}")
    return " | ".join(cells)


def table(found: Sequence[KernelMeasurement], before: str = "") -> str:
    """The measurements as Markdown, one row for a function of an algebra.

    before: a table whose rows stay, of algebras that are not in `found`.
    """
    rows: dict[bool, dict[tuple[str, str], str]] = {True: {}, False: {}}
    groups: dict[tuple[bool, str, str], list[KernelMeasurement]] = {}
    for m in found:
        key = (m.kernel.meaning is not None, m.kernel.name, m.algebra)
        groups.setdefault(key, []).append(m)
    for (polynomial, name, algebra), of_one in groups.items():
        rows[polynomial][name, algebra] = _cells(of_one)
    measured = {m.algebra for m in found}
    for name, algebra, cells in re.findall(
        r"^\| `(\w+)`(?: ‡)? \| (\w+) \| (.*) \|$", before, re.MULTILINE
    ):
        if algebra not in measured:
            rows[is_product(name)][name, algebra] = cells
    blocks = []
    for polynomial, of_kind in rows.items():
        second = "by component" if polynomial else "of the norm"
        lines = [
            f"| function | algebra | kernels | double | {second} | float | {second} | points |",
            "|---|---|---|---|---|---|---|---|",
        ]
        for (name, algebra), cells in sorted(of_kind.items()):
            lines.append(f"| `{name}`{_mark(name)} | {algebra} | {cells} |")
        blocks.append("\n".join(lines))
    blocks.append("‡ The fewest operations: no bound is claimed; see each kernel's documentation.")
    return "\n\n".join(blocks)
