"""Specs for signatures that are not bundled: a complete, commented TOML text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

from hamotor.codegen.spec import GROUP_KERNELS, MAXIMUM_DIMENSION, NAME
from hamotor.errors import UsageError, suggest

GRADE_NAMES = ("Scalar", "Vector", "Bivector", "Trivector", "Quadvector", "Quintvector")
ORIGINS, INFINITIES = "0opq", "ijkl"
PRODUCTS = (
    "gp",
    "outer",
    "inner",
    "left_contraction",
    "right_contraction",
    "regressive",
    "commutator",
    "anticommutator",
    "sandwich",
    "matrix",
    "project",
    "reverse",
    "involute",
    "conjugate",
    "grade",
    "complement",
    "complement_inverse",
    "polarity",
    "polarity_inverse",
    "norm_squared",
    "norm",
    "inverse",
    "sqrt",
    "exp",
    "log",
    "cayley",
    "cayley_inverse",
    "normalize",
)


def starter_spec(
    name: str,
    signature: tuple[int, int, int],
    null_pairs: int = 0,
    products: Sequence[str] | None = None,
) -> str:
    """The TOML text of an algebra with p positive, q negative and r null basis vectors.

    null_pairs: as many of the positive and negative vectors (one of each) are replaced by pairs of
    null vectors with product −1.  products: the kernels to list, all by default; each either an
    operation, for the operands that come with it ("gp"; "dexp" for the group's), or one request
    with its operands as in a spec ("gp Even Vector -> Odd").
    Raises UsageError for impossible numbers, unknown operations and too many dimensions.
    """
    p, q, r = signature
    if not NAME.match(name):
        raise UsageError(f'name "{name}" must match [A-Za-z][A-Za-z0-9_]*')
    if min(p, q, r, null_pairs) < 0 or p + q + r == 0:
        raise UsageError(f"signature {p},{q},{r}: needs three numbers ≥ 0, not all of them 0")
    if null_pairs > min(p, q, len(INFINITIES)):
        raise UsageError(
            f"{null_pairs} null pair(s) need as many positive and negative vectors; "
            f"the signature has {p} and {q}"
        )
    if p + q + r > MAXIMUM_DIMENSION:
        raise UsageError(
            f"signature {p},{q},{r}: {p + q + r} dimensions; {MAXIMUM_DIMENSION} are allowed "
            "(MAXIMUM_DIMENSION in codegen/spec.py lifts the cap)"
        )
    wanted = _wanted(products)
    basis, gram = _basis(p, q, r, null_pairs)
    lines = [
        f"# {name}: the geometric algebra R({p},{q},{r}).  Everything below may be edited.",
        f'name = "{name}"',
        f'description = "geometric algebra R({p},{q},{r})"',
        f"basis = {_array(basis)}",
        gram,
        "",
        "# Element types.  blades: the stored numbers in order (e31 is e3∧e1); symbol: the name of",
        "# a parameter of that type; unit = true: V ~V = 1, which kernels may use; fixed: the part",
        "# that every value shares.",
        *_elements(basis),
        "",
        "# Kernels: LEFT RIGHT -> RESULT; without a result, the smallest element that holds it.",
        "[kernels]",
        *_kernels(basis, wanted, rank=p + q),
    ]
    if len(basis) >= 2:
        lines += ["", *_group(basis, [k for k in GROUP_KERNELS if k in wanted])]
    return "\n".join(lines) + "\n"


def _wanted(products: Sequence[str] | None) -> dict[str, list[str]]:
    """Operation → requests in full; none: those that come with the operation."""
    known = (*PRODUCTS, *GROUP_KERNELS)
    if products is None:
        return {operation: [] for operation in PRODUCTS}
    wanted: dict[str, list[str]] = {}
    whole: set[str] = set()
    for product in products:
        operation, _, operands = " ".join(product.split()).partition(" ")
        if operation not in known:
            raise UsageError(
                f'unknown product "{operation}"; known are {", ".join(known)}.'
                + suggest(operation, known)
            )
        if operands and operation in GROUP_KERNELS:
            raise UsageError(f'"{product}": {operation} takes no operands; it is the group\'s')
        listed = wanted.setdefault(operation, [])
        if operands and operands not in listed:
            listed.append(operands)
        if not operands:
            whole.add(operation)
    return {operation: [] if operation in whole else listed for operation, listed in wanted.items()}


def _basis(p: int, q: int, r: int, null_pairs: int) -> tuple[list[str], str]:
    """Names of the basis vectors and the gram entry: null first, then +, then −; pairs outside."""
    first = 0 if r else 1
    squares = [0] * r + [1] * (p - null_pairs) + [-1] * (q - null_pairs)
    names = [f"e{first + i}" for i in range(len(squares))]
    if not null_pairs:
        return names, f"gram = {{ diagonal = {squares} }}"
    origins = [f"e{c}" for c in (ORIGINS[1:] if r else ORIGINS)[:null_pairs]]
    ends = [f"e{c}" for c in INFINITIES[:null_pairs]]
    basis = [*origins, *names, *ends]
    size = len(basis)
    rows = []
    for i in range(size):
        row = [0] * size
        inner = i - null_pairs
        if 0 <= inner < len(squares):
            row[i] = squares[inner]
        elif i < null_pairs:
            row[size - null_pairs + i] = -1
        else:
            row[i - (size - null_pairs)] = -1
        rows.append(row)
    text = "\n".join(f"  {row}," for row in rows)
    return basis, f"gram = {{ matrix = [\n{text}\n] }}"


def _array(names: Sequence[str]) -> str:
    return "[" + ", ".join(f'"{n}"' for n in names) + "]"


def _blades(basis: Sequence[str], grades: Sequence[int]) -> list[str]:
    return [
        "e" + "".join(name[1:] for name in chosen) if chosen else "s"
        for g in grades
        for chosen in combinations(basis, g)
    ]


def _grade_name(grade: int, dimension: int) -> str:
    if grade == dimension:
        return "Pseudoscalar"
    return GRADE_NAMES[grade] if grade < len(GRADE_NAMES) else f"Grade{grade}vector"


def _element(
    name: str, symbol: str, doc: str, blades: Sequence[str], unit: bool = False
) -> list[str]:
    lines = [
        "",
        f"[element.{name}]",
        f'doc = "{doc}"',
        f'symbol = "{symbol}"',
        f"blades = {_array(blades)}",
    ]
    return [*lines, "unit = true"] if unit else lines


def _elements(basis: Sequence[str]) -> list[str]:
    n = len(basis)
    even, odd = range(0, n + 1, 2), range(1, n + 1, 2)
    lines = _element("Scalar", "s", "A number; functions return it as S itself.", ["s"])
    if n > 1:
        doc = "Even unit versor, V ~V = 1.  Acts by X ↦ V X ~V."
        lines += _element("Versor", "m", doc, _blades(basis, even), unit=True)
    lines += _element("Even", "a", "Any even multivector.", _blades(basis, even))
    lines += _element("Odd", "u", "Any odd multivector.", _blades(basis, odd))
    for grade in range(1, n + 1):
        name = _grade_name(grade, n)
        symbol = "i" if grade == n else "vbtqwxyz"[(grade - 1) % 8]
        lines += _element(name, symbol, f"Multivector of grade {grade}.", _blades(basis, [grade]))
    return lines


def _kernels(basis: Sequence[str], wanted: Mapping[str, Sequence[str]], *, rank: int) -> list[str]:
    """Requests of each wanted operation.  rank: how many vectors of an orthogonal basis are not
    null; blades of higher grades have the square 0, and onto them nothing is projected."""
    n = len(basis)
    name = [_grade_name(g, n) for g in range(n + 1)]
    inner_grades = range(1, n)
    has_versor = n > 1
    requests: dict[str, list[str]] = {
        "gp": ["Even Even", "Even Odd", "Odd Even", "Odd Odd"]
        + (["Versor Versor -> Versor"] if has_versor else [])
        + [f"{name[1]} {name[1]}"],
        "outer": [f"{name[i]} {name[j]}" for i in inner_grades for j in inner_grades if i + j <= n],
        "inner": [
            f"{name[i]} {name[j]} -> {name[abs(i - j)]}" for i in inner_grades for j in inner_grades
        ],
        "left_contraction": [
            f"{name[i]} {name[j]} -> {name[j - i]}"
            for i in inner_grades
            for j in inner_grades
            if i <= j
        ],
        "right_contraction": [
            f"{name[i]} {name[j]} -> {name[i - j]}"
            for i in inner_grades
            for j in inner_grades
            if i >= j
        ],
        "regressive": [
            f"{name[i]} {name[j]} -> {name[i + j - n]}"
            for i in inner_grades
            for j in inner_grades
            if i + j >= n
        ],
        "commutator": [f"{name[j]} {name[2]} -> {name[j]}" for j in inner_grades if n > 2],
        "anticommutator": [f"{name[1]} {name[1]} -> Scalar"] if n > 1 else [],
        "sandwich": [f"Versor {name[j]}" for j in inner_grades if n < 6 or j == 1],
        "matrix": [f"Versor {name[1]}"] if 2 <= n < 6 else [],
        "reverse": (["Versor"] if has_versor else []) + ["Even", "Odd"],
        "grade": [f"Even {g}" for g in range(0, n + 1, 2)]
        + [f"Odd {g}" for g in range(1, n + 1, 2)],
        "complement": [f"{name[g]} -> {name[n - g]}" for g in inner_grades],
        "complement_inverse": [f"{name[g]} -> {name[n - g]}" for g in inner_grades],
        "polarity": [f"{name[g]} -> {name[n - g]}" for g in inner_grades],
        "polarity_inverse": [f"{name[g]} -> {name[n - g]}" for g in inner_grades if rank == n],
        "project": [
            f"{name[i]} {name[j]}" for i in inner_grades for j in inner_grades if i <= j <= rank
        ],
        "involute": ["Even", "Odd"],
        "conjugate": ["Even", "Odd"],
        "norm": [name[g] for g in inner_grades],
        "inverse": ["Even", "Odd"] if n <= 5 else [],
        "sqrt": ["Versor"] if 2 <= n <= 5 else [],
        "norm_squared": ["Even", *(name[g] for g in inner_grades)],
        "exp": [f"{name[2]} -> Versor"] if 2 <= n <= 5 else [],
        "log": [f"Versor -> {name[2]}"] if 2 <= n <= 5 else [],
        "cayley": [f"{name[2]} -> Versor"] if 2 <= n <= 5 else [],
        "cayley_inverse": [f"Versor -> {name[2]}"] if 2 <= n <= 5 else [],
        "normalize": ["Versor"] if 2 <= n <= 5 else [],
    }
    lines = []
    for operation in PRODUCTS:
        listed = wanted.get(operation) or (requests[operation] if operation in wanted else [])
        if listed:
            entries = ", ".join(f'"{text}"' for text in dict.fromkeys(listed))
            lines.append(f"{operation} = [{entries}]")
    return lines


def _group(basis: Sequence[str], kernels: Sequence[str]) -> list[str]:
    lines = [
        "# The group of all even unit versors.  A subgroup has fewer generators, closed under the",
        "# bracket.  Rates and momenta are coordinates over the generators.  Jacobians of exp and",
        '# log are there on request: kernels = ["dexp", "dexp_inverse"].',
        "[[group]]",
        'name = "Spin"',
        'description = "all rotations and boosts"',
        'element = "Versor"',
        *([f"kernels = {_array(kernels)}"] if kernels else []),
        "generators = [",
    ]
    for a, b in combinations(basis, 2):
        blade = f"e{a[1:]}{b[1:]}"
        lines.append(
            f'  {{ name = "{blade}", bivector = {{ {blade} = "-1/2" }}, '
            f'rate = "w{blade[1:]}", momentum = "l{blade[1:]}" }},'
        )
    return [*lines, "]"]
