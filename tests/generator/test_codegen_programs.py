"""Programs: they expand to what the algebra says, at pinned costs; C++ and Python agree."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from hamotor.codegen import bundled_algebras, cpp, read_algebra
from hamotor.codegen.kernel import Kernel, proved
from hamotor.codegen.lanes import packed_lines
from hamotor.codegen.library import library
from hamotor.codegen.program import (
    Call,
    Cost,
    Expression,
    MultiplyAdd,
    Name,
    Negative,
    Number,
    Product,
    Program,
    Quotient,
    Select,
    Sum,
    number,
    polynomial_expression,
    sum_of_products,
)
from hamotor.codegen.spec import bundled_path

ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = {name: library(read_algebra(bundled_path(name))) for name in bundled_algebras()}
KERNELS = [(name, kernel) for name, kernels in LIBRARIES.items() for kernel in kernels]


def title(algebra: str, kernel: Kernel) -> str:
    space = f"{kernel.namespace}::" if kernel.namespace else ""
    return f"{algebra} {space}{kernel.name} {' '.join(e.name for e in kernel.operands)}"


IDS = [title(*k) for k in KERNELS]


@pytest.mark.parametrize(("algebra", "kernel"), KERNELS, ids=IDS)
def test_a_program_expands_to_what_its_kernel_means(algebra: str, kernel: Kernel) -> None:
    if kernel.meaning is None and kernel.program.cost.total == 0 and not kernel.program.cost.calls:
        assert kernel.name in ("dexp", "dexp_inverse"), "of rates that commute: the identity"
        expected = {c.name: {(f"b.{c.name}",): 1} for c in kernel.operands[1].components}
        assert kernel.program.expand() == expected
    elif kernel.meaning is None:
        with pytest.raises(ValueError, match="not a polynomial"):
            kernel.program.expand()
    else:
        assert kernel.program.expand() == kernel.meaning, algebra


def mutations(expression: Expression) -> Iterator[Expression]:
    """The expression with one thing wrong: a sign, a name, an operation."""
    match expression:
        case Name(text):
            yield Negative(expression)
            yield Name(f"{text}_")
        case Number(value):
            yield Number(value + 1)
        case Negative(x):
            yield x
        case Sum(a, b):
            yield Product(a, b)
            yield from (Sum(x, b) for x in mutations(a))
        case Product(a, b):
            yield Sum(a, b)
            yield from (Product(x, b) for x in mutations(a))
            yield from (Product(a, x) for x in mutations(b))
        case MultiplyAdd(a, b, c):
            yield Product(a, b)
            yield from (MultiplyAdd(x, b, c) for x in mutations(a))
            yield from (MultiplyAdd(a, b, x) for x in mutations(c))
        case _:
            pass


def mutants(program: Program) -> Iterator[Program]:
    for part in ("bindings", "outputs"):
        lines = getattr(program, part)
        for i, (name, expression) in enumerate(lines):
            for wrong in mutations(expression):
                changed = (*lines[:i], (name, wrong), *lines[i + 1 :])
                yield (
                    replace(program, bindings=changed)
                    if part == "bindings"
                    else replace(program, outputs=changed)
                )


def test_every_mutated_program_is_caught() -> None:
    caught = 0
    names = ("gp", "sandwich", "sandwich_lean", "Ad", "regressive", "pairing")
    kernels = [*LIBRARIES["pga3"], *LIBRARIES["cga2"]]
    for kernel in (k for k in kernels if k.name in names):
        for wrong in mutants(kernel.program):
            with pytest.raises(AssertionError, match="does not expand to its definition"):
                proved(replace(kernel, program=wrong))
            caught += 1
    assert caught > 1000


COSTS = {
    "pga3 gp Motor Motor": (48, 40),
    "pga3 gp Rotor Rotor": (16, 12),
    "pga3 gp Motor Bivector": (36, 28),
    "pga3 commutator Bivector Bivector": (18, 12),
    "pga3 sandwich Motor Point": (21, 18),
    "pga3 sandwich Motor Trivector": (25, 18),
    "pga3 sandwich Motor Direction": (18, 12),
    "pga3 sandwich Motor Origin": (15, 9),
    "pga3 sandwich Motor Bivector": (51, 39),
    "pga3 sandwich Motor Plane": (26, 18),
    "pga2 sandwich Motor Line": (11, 6),
    "pga4 sandwich Motor Hyperplane": (61, 48),
    "pga4 sandwich Motor Bivector": (166, 142),
    "pga4 sandwich Motor Trivector": (188, 163),
    "cga3 sandwich Motor Plane": (26, 18),
    "cga3 sandwich Motor Point": (32, 28),
    "cga3 sandwich Motor Line": (51, 39),
    "cga3 sandwich Versor Vector": (120, 100),
    "cga3 sandwich Versor Bivector": (198, 187),
    "cga3 sandwich_lean Versor Vector": (88, 79),
    "cga3 sandwich_lean Versor Bivector": (174, 159),
    "cga3 sandwich_lean Motor Bivector": (96, 78),
    "cga3 gp Even Even": (136, 136),
    "cga3 commutator Bivector Bivector": (60, 50),
    "cga3 commutator Trivector Bivector": (60, 50),
    "pga3 sandwich Rotor Direction": (18, 12),
    "pga3 se3::ad Rate Rate": (18, 12),
    "pga3 se3::coadjoint Rate Momentum": (18, 12),
    "pga3 se3::pairing Momentum Rate": (6, 5),
    "pga3 so3::ad Rate Rate": (6, 3),
    "pga2 gp Motor Motor": (12, 8),
    "pga2 commutator Bivector Bivector": (4, 2),
    "pga3 se3::kinematics Motor Rate": (42, 28),
    "pga3 so3::kinematics Rotor Rate": (15, 8),
}
"""Multiplications and additions at most: the lowest published, where there are such."""


@pytest.mark.parametrize("name", COSTS)
def test_costs_are_at_or_below_the_lowest_known(name: str) -> None:
    costs = {title(*k): k[1].program.cost for k in KERNELS}
    assert (costs[name].mul, costs[name].add) <= COSTS[name]
    assert costs[name].add <= COSTS[name][1]


def test_a_long_screw_leaves_its_axis_where_it_is_to_the_last_bit() -> None:
    (kernel,) = (k for a, k in KERNELS if title(a, k) == "pga3 sandwich Motor Bivector")
    line = dict.fromkeys(("e23", "e31", "e01", "e02", "e03"), 0.0) | {"e12": 3.0}
    for half_angle in (0.1, 0.2, 0.7, 1.1, 1.9):
        cosine, sine = math.cos(half_angle), math.sin(half_angle)
        motor = dict.fromkeys(("e23", "e31", "e01", "e02"), 0.0)
        motor |= {"s": cosine, "e12": sine, "e03": -1e9 * cosine, "e0123": -1e9 * sine}
        values = {f"m.{n}": x for n, x in motor.items()} | {f"b.{n}": x for n, x in line.items()}
        assert kernel.program.evaluate(values, {"number": float}) == line


def test_what_a_versor_leaves_at_zero_stays_there_but_for_the_lean_form() -> None:
    """Translated by far, a bivector along an axis gains no part that it has no terms in."""
    exact, lean = (
        next(k for a, k in KERNELS if title(a, k) == f"cga3 {name} Motor Bivector")
        for name in ("sandwich", "sandwich_lean")
    )
    motor = {f"m.{c.name}": 0.0 for c in exact.operands[0].components}
    motor |= {"m.s": math.cos(0.7), "m.e12": math.sin(0.7)}
    motor |= {"m.e3i": 1e6 * math.cos(0.7), "m.e123i": 1e6 * math.sin(0.7)}
    bivector = {f"b.{c.name}": 0.0 for c in exact.operands[1].components} | {"b.e12": 3.0}
    found = exact.program.evaluate(motor | bivector, {"number": float})
    assert found == {c.name: 3.0 * (c.name == "e12") for c in exact.operands[1].components}
    about = lean.program.evaluate(motor | bivector, {"number": float})
    assert max(abs(about[n] - found[n]) for n in found) < 1e-9


def test_the_index_gives_the_programs_costs() -> None:
    for algebra, kernels in LIBRARIES.items():
        path = ROOT / "generated" / "hamotor" / algebra / "kernels.json"
        listed = json.loads(path.read_text("utf-8"))["kernels"]
        assert [k["name"] for k in listed] == [k.name for k in kernels]
        assert [k["cost"] for k in listed] == [k.program.cost.as_data() for k in kernels]


def test_costs_count_by_kind() -> None:
    x, y = Name("x"), Name("y")
    program = Program((), (("z", MultiplyAdd(x, y, Sum(x, Negative(y)))),), (("value", x),), None)
    assert program.cost == Cost(mul=1, add=2, fused=1)
    assert str(program.cost) == "1 mul, 2 add (1 fused)"
    program = replace(program, outputs=(("value", Quotient(Product(x, y), Select(x, y, x))),))
    assert program.cost.as_data() == {"mul": 2, "add": 2, "fused": 1, "div": 1, "select": 1}


def test_sums_of_products_fuse_onto_what_is_not_a_product() -> None:
    a, b, c = Name("a"), Name("b"), Name("c")
    assert sum_of_products([(a, b), (c,)]) == MultiplyAdd(a, b, c)
    assert sum_of_products([(a, b), (b, c)]) == MultiplyAdd(b, c, Product(a, b))
    assert sum_of_products([]) == number(0)
    halves = polynomial_expression({("a", "b"): Fraction(1, 2), ("c",): Fraction(-1, 2)})
    assert halves == Product(number(Fraction(1, 2)), MultiplyAdd(a, b, Negative(c)))
    with pytest.raises(ValueError, match="more than two factors"):
        polynomial_expression({("a", "b", "c"): 1})


def roundings(expression: Expression) -> int:
    """How often what is multiplied is rounded at most, until it is part of the result."""
    match expression:
        case Name() | Number():
            return 0
        case Negative(x) | Product(Number(), x):
            return roundings(x)
        case Product(a, b) | Sum(a, b):
            return 1 + max(roundings(a), roundings(b))
        case Call("compensated_sum" | "compensated_dot", arguments):
            return 1 + max(map(roundings, arguments))
        case MultiplyAdd():
            terms: list[int] = []
            while isinstance(expression, MultiplyAdd):
                terms.append(max(roundings(expression.a), roundings(expression.b)))
                expression = expression.c
            last = expression
            first = max(map(roundings, (last.a, last.b))) if isinstance(last, Product) else -1
            terms.append(first if first >= 0 else roundings(last) - 1)
            sums = 1 if len(terms) < 4 else 2 if len(terms) < 9 else 4
            return max(
                own + len(range(index, len(terms), sums)) + sums // 2
                for index, own in enumerate(reversed(terms))
            )
    raise AssertionError(expression)


def test_no_product_is_rounded_more_than_four_times_in_a_result_of_one_number() -> None:
    single = [k for _, k in KERNELS if k.meaning and len(k.program.outputs) == 1]
    assert len(single) > 40
    for kernel in single:
        ((_, expression),) = kernel.program.outputs
        assert not kernel.program.bindings
        assert roundings(expression) <= 4, kernel


def exact_dot(*factors: Fraction) -> Fraction:
    return sum((a * b for a, b in zip(factors[::2], factors[1::2], strict=True)), Fraction(0))


@pytest.mark.slow
def test_cpp_and_python_evaluate_alike(tmp_path: Path) -> None:
    """All polynomial kernels of pga3 at one point, in C++ doubles and in Python fractions."""
    calls = []
    expected: list[float] = []
    for kernel in LIBRARIES["pga3"]:
        if kernel.meaning is None:
            continue
        program = kernel.program
        values = {
            f"{p.name}.{c.name}": Fraction((7 * i + 3 * j) % 11 - 5, 4)
            for j, p in enumerate(program.parameters)
            for i, c in enumerate(p.element.components)
        }
        results = program.evaluate(values, {"number": Fraction, "compensated_dot": exact_dot})
        expected += [float(x) for x in results.values()]
        arguments = ", ".join(
            f"{p.element.cpp_name}<double>{{"
            + ", ".join(str(float(values[f"{p.name}.{c.name}"])) for c in p.element.components)
            + "}"
            for p in program.parameters
        )
        space = f"{kernel.namespace}::" if kernel.namespace else ""
        calls.append(f"print({space}{kernel.name}({arguments}));")
    code = tmp_path / "alike.cpp"
    lines = [
        "#include <cstdio>",
        '#include "hamotor/pga3/pga3.hpp"',
        "using namespace hamotor::pga3;",
        'void print(double x) { std::printf("%.17g\\n", x); }',
        "template <class T>",
        "void print(const T& value) {",
        "  for (double x : value.components()) print(x);",
        "}",
        "int main() {",
        *calls,
        "}",
    ]
    code.write_text("\n".join(lines), "utf-8")
    folders = [f"-I{ROOT / folder}" for folder in ("generated", "runtime/include")]
    target = str(tmp_path / "alike")
    subprocess.run(["g++", "-std=c++20", *folders, str(code), "-o", target], check=True)
    run = subprocess.run([target], check=True, capture_output=True, text=True)
    found = [float(line) for line in run.stdout.splitlines()]
    assert len(found) == len(expected) > 300
    assert all(math.isclose(a, b, rel_tol=1e-14) for a, b in zip(found, expected, strict=True))


def test_the_page_lists_every_kernel_with_its_cost() -> None:
    for algebra, kernels in LIBRARIES.items():
        page = (ROOT / "generated" / "hamotor" / algebra / "kernels.md").read_text("utf-8")
        rows = [line for line in page.splitlines() if line.startswith("| `")]
        assert len(rows) == len(kernels)
        for kernel in kernels:
            cost = kernel.program.cost
            operands = ", ".join(e.cpp_name for e in kernel.operands)
            assert any(
                f" {kernel.name}({operands})` | " in row and f" | {cost.mul} | {cost.add} | " in row
                for row in rows
            ), kernel.name


def test_sums_of_four_agreeing_components_are_packed_in_their_order() -> None:
    packed = {
        title(algebra, kernel): packed_lines(kernel.program, whole=False)
        for algebra, kernel in KERNELS
        if kernel.name == "gp" and algebra in ("cga3", "pga3")
    }
    lines = packed["cga3 gp Even Even"]
    assert lines is not None
    assert sum(line.startswith("const auto sum") for line in lines) == 4
    assert "const auto four_b_e01 = four(b.e01, b.e02, b.e03, b.e0123);" in lines
    both = "turned<1, 2, -3, 4>(sum1) + turned<1, 2, -3, 4>(sum2)"
    assert f"lanes::store<0>(result, {both});" in lines
    difference = "turned<1, 2, -3, 4>(sum2) - turned<1, 2, -3, 4>(sum1)"
    assert f"lanes::store<8>(result, {difference});" in lines
    assert not any(line.startswith("const S ") for line in lines)
    assert any("four(a.e01), turned<-1, -4, -3, -2>(four_b_e1i)" in line for line in lines)
    assert packed["cga3 gp Vector Vector"] is None
    lines = packed["cga3 gp Similarity Similarity"]
    assert lines is not None
    halves = "four(S(-0.5), S(-0.5), S(0.5), S(-0.5)) * (sum1 - sum2)"
    assert f"lanes::store<8>(result, {halves});" in lines
    lines = packed["pga3 gp Motor Motor"]
    assert lines is not None
    assert "lanes::store<4>(result, sum2);" in lines, "what is computed last is not turned as well"


def test_small_kernels_are_packed_where_no_component_is_left_over() -> None:
    partly = {
        title(algebra, kernel): kernel.program
        for algebra, kernel in KERNELS
        if kernel.name == "gp" and algebra == "pga3"
    }["pga3 gp Bivector Motor"]
    assert packed_lines(partly, whole=False) is not None
    assert packed_lines(partly, whole=True) is None


@pytest.mark.parametrize("algebra", ["pga2", "pga3", "pga4"])
def test_a_product_adds_the_second_operands_translation_last(algebra: str) -> None:
    (product,) = [
        kernel
        for name, kernel in KERNELS
        if name == algebra
        and kernel.name == "gp"
        and [e.cpp_name for e in kernel.operands] == ["Motor", "Motor"]
    ]
    mixed = 0
    for _, expression in product.program.outputs:
        late = ["b.e0" in cpp.expression_text(b) for _, b in factors(expression)]
        assert late == sorted(late)
        mixed += len(set(late)) == 2
    assert mixed > 0


def factors(expression: Expression) -> list[tuple[Expression, Expression]]:
    """The factors of a sum of products, in its order."""
    later: list[tuple[Expression, Expression]] = []
    while isinstance(expression, MultiplyAdd):
        later.append((expression.a, expression.b))
        expression = expression.c
    assert isinstance(expression, Product)
    return [(expression.a, expression.b), *reversed(later)]
