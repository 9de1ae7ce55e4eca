"""One kernel's C++ text, and Cayley tables, for people to read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from hamotor.codegen import tree
from hamotor.codegen.algebra import Algebra, Blade, Rational, grade
from hamotor.codegen.compiler import SourceFile, kernel_data, kernel_title
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import Kernel
from hamotor.codegen.library import LAWS, bilinear, finished, library, request_kernel
from hamotor.codegen.spec import (
    OPERATIONS,
    AlgebraSpec,
    Request,
    bundled_path,
    read_algebra,
)
from hamotor.errors import UsageError, suggest


def show(algebra: str, product: str, operands: Sequence[str]) -> str:
    """C++ text of the kernels `product` of these operands, each with title, law and cost.

    algebra:  name of a bundled algebra.
    product:  an operation of specs (`gp`, `sandwich`, `exp`, …) or a group's function (`ad`, …).
    operands: names of element types in any case, a grade after `grade`'s operand, then perhaps
        `->` and a result type; none: every kernel of that name that the spec asks for.

    A kernel that the spec does not list is made on the fly, and its text says so.
    Raises UsageError for an unknown algebra, product, element or combination.
    """
    spec, listed = _read(bundled_path(algebra))
    known = list(dict.fromkeys([*OPERATIONS, *(_operation(k) for k in listed)]))
    if product not in known:
        raise UsageError(
            f'{algebra}: unknown product "{product}"; there are {", ".join(known)}.'
            + suggest(product, known)
        )
    where = " ".join(["show", algebra, product, *operands])
    wanted, power, result = _split(operands, where)
    name = product if power is None else f"{product}_{power}"
    named = [k for k in listed if k.name == name or (not wanted and _operation(k) == product)]
    types = _types(spec, listed)
    for word in [*wanted, *([result] if result else [])]:
        _require(word, types, where)
    found = [
        k
        for k in named
        if not wanted
        or (
            len(wanted) == len(k.operands)
            and all(_is(w, e) for w, e in zip(wanted, k.operands, strict=True))
        )
    ]
    if result is not None:
        found = [k for k in found if _is(result, k.program.result or spec.elements["Scalar"])]
    if found:
        return _text([(kernel, ()) for kernel in found])
    chain = product in LAWS and len(wanted) > 2
    if not chain and len(wanted) != OPERATIONS.get(product):
        raise UsageError(_no_such(product, named, where))
    return _made_on_the_fly(spec, product, wanted, result, power, where)


def table(algebra: str, product: str) -> str:
    """Cayley table of a product of basis blades: row times column, `.` for 0.

    Rows and columns stand in ascending grade; `e13` is e1 ∧ e3, also in a null basis.
    Raises UsageError for an unknown algebra or a product that is not one of two operands.
    """
    spec = read_algebra(bundled_path(algebra))
    if product not in LAWS:
        raise UsageError(
            f'{algebra}: no table of "{product}"; there are tables of {", ".join(LAWS)}.'
            + suggest(product, LAWS)
        )
    space, multiply = spec.algebra, bilinear(spec.algebra, product)
    blades = sorted(range(1 << space.dimension), key=lambda b: (grade(b), b))
    head = [_cell(space, {b: 1}) for b in blades]
    rows = [["", *head]]
    for a, name in zip(blades, head, strict=True):
        rows.append([name, *(_cell(space, multiply(a, b)) for b in blades)])
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows))]
    lines = [
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        for row in rows
    ]
    rule = "-" * len(lines[0])
    title = f"{spec.name}: {product}, {LAWS[product]}; row a, column b"
    return "\n".join([title, "", lines[0], rule, *lines[1:]])


@cache
def _read(path: Path) -> tuple[AlgebraSpec, tuple[Kernel, ...]]:
    """A bundled spec and its kernels, which take a moment for a large algebra."""
    spec = read_algebra(path)
    return spec, library(spec)


def _split(operands: Sequence[str], where: str) -> tuple[list[str], int | None, str | None]:
    """The operands' types, the grade and the result's type."""
    words = list(operands)
    result: str | None = None
    if "->" in words:
        arrow = words.index("->")
        if len(words) != arrow + 2:
            raise UsageError(f'{where}: "->" must be followed by one element type')
        result = words[arrow + 1]
        words = words[:arrow]
    power = int(words.pop()) if words and words[-1].isdecimal() else None
    return words, power, result


def _operation(kernel: Kernel) -> str:
    """The operation of a spec that a kernel answers: `grade_2` answers `grade`."""
    if kernel.name.endswith("_matrix"):
        return "matrix"
    return "grade" if kernel.name.startswith("grade_") else kernel.name


def _types(spec: AlgebraSpec, kernels: Sequence[Kernel]) -> list[Element]:
    used = (e for kernel in kernels for e in kernel.operands)
    return list({e.cpp_name: e for e in [*spec.elements.values(), *used]}.values())


def _is(word: str, element: Element) -> bool:
    return word.casefold() in (element.name.casefold(), element.cpp_name.casefold())


def _require(word: str, types: Sequence[Element], where: str) -> None:
    if not any(_is(word, e) for e in types):
        names = [e.cpp_name for e in types]
        raise UsageError(
            f'{where}: unknown element "{word}"; there are {", ".join(names)}.'
            + suggest(word, names)
        )


def _no_such(product: str, named: Sequence[Kernel], where: str) -> str:
    if product in OPERATIONS:
        count = OPERATIONS[product]
        form = " ".join(["ELEMENT"] * count + ["GRADE"] * (product == "grade"))
        message = f'{where}: name the operands: {product} {form}, then perhaps "->" RESULT'
    else:
        message = f"{where}: {product} is a group's function"
    if named:
        message += "; there are " + ", ".join(kernel_title(k) for k in named)
    return message


def _made_on_the_fly(
    spec: AlgebraSpec,
    product: str,
    wanted: Sequence[str],
    result: str | None,
    power: int | None,
    where: str,
) -> str:
    names = {name.casefold(): name for name in spec.elements}
    own = []
    for word in [*wanted, *([result] if result else [])]:
        if word.casefold() not in names:
            raise UsageError(
                f"{where}: kernels on request have the element types of {spec.file}, not those of "
                f"a group, as operands: {', '.join(spec.elements)}"
            )
        own.append(names[word.casefold()])
    if (product == "grade") != (power is not None):
        must = "needs a grade, as in grade Even 2" if product == "grade" else "takes no grade"
        raise UsageError(f"{where}: {product} {must}")
    target = own.pop() if result else None
    request = Request(product, tuple(own), target, power)
    asked = str(request).removeprefix(f"{product} ")
    note = f'Not in generated/: for that, add "{asked}" to kernels.{product} in {spec.file}.'
    return _text([(finished(spec.algebra, request_kernel(spec, request)), (note,))])


def _text(kernels: Sequence[tuple[Kernel, Sequence[str]]]) -> str:
    """Kernels, each with further notes, formatted."""
    files: list[SourceFile] = []
    for kernel, notes in kernels:
        data = kernel_data(kernel)
        sparsity = f"  Sparsity: {data['sparsity']}." if data["sparsity"] else ""
        lines = [
            f"/// {data['title']}",
            f"/// {data['law']}.",
            *(f"/// {note}" for note in [*data["notes"], *notes]),
            f"/// Cost: {data['cost']}.{sparsity}",
            "template <class S>",
            f"{data['attributes']} constexpr {data['signature']} noexcept {{",
            *data["body"],
            "}",
        ]
        files.append(SourceFile(f"{len(files)}.hpp", "\n".join(lines) + "\n"))
    return "\n\n".join(file.text.rstrip("\n") for file in tree.formatted(files))


def _cell(algebra: Algebra, value: Mapping[Blade, Rational]) -> str:
    """`-e12`, `-1+e04` or `1/2·e12`; `.` for 0."""
    text = ""
    for blade, x in sorted(value.items()):
        sign = "-" if x < 0 else "+" if text else ""
        name = algebra.blade_name(blade) if blade else "1"
        size = "" if abs(x) == 1 else f"{abs(x)}" if not blade else f"{abs(x)}·"
        text += sign + size + (name if blade or abs(x) == 1 else "")
    return text or "."
