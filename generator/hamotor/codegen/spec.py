"""Algebra specs: what the TOML says, typed and checked.  Every input error is raised here."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

from hamotor.codegen import reserved
from hamotor.codegen.algebra import Algebra, Blade, Rational, simplest
from hamotor.codegen.casimir import Casimir, parse_polynomial
from hamotor.codegen.element import Component, Element, blade_component
from hamotor.codegen.group import Generator, LieGroup, lie_group
from hamotor.errors import UsageError, suggest

BUNDLED = Path(__file__).resolve().parents[2] / "algebras"
MAXIMUM_DIMENSION = 8
MAXIMUM_BYTES = 1 << 20
MAXIMUM_DIGITS = 60
LARGE_EXPONENT = re.compile(r"[eE][-+]?\d{3}")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
INHERITED = ("basis", "gram", "lengths")
KEYS = ("name", "description", "extends", *INHERITED, "element", "kernels", "group")
OPERATIONS = {
    "gp": 2,
    "outer": 2,
    "inner": 2,
    "left_contraction": 2,
    "right_contraction": 2,
    "regressive": 2,
    "commutator": 2,
    "anticommutator": 2,
    "sandwich": 2,
    "sandwich_lean": 2,
    "matrix": 2,
    "project": 2,
    "reverse": 1,
    "involute": 1,
    "conjugate": 1,
    "grade": 1,
    "complement": 1,
    "complement_inverse": 1,
    "polarity": 1,
    "polarity_inverse": 1,
    "norm_squared": 1,
    "norm": 1,
    "inverse": 1,
    "sqrt": 1,
    "exp": 1,
    "log": 1,
    "cayley": 1,
    "cayley_inverse": 1,
    "normalize": 1,
    "exp_lean": 1,
    "log_lean": 1,
    "cayley_lean": 1,
    "cayley_inverse_lean": 1,
    "normalize_lean": 1,
}
"""Operation → number of operands."""
LEAN_FUNCTIONS = ("exp", "log", "cayley", "cayley_inverse")
"""Functions of a group that may be asked for in their lean form, too."""
CHAINS = ("gp", "outer", "regressive")
"""Associative operations, which take any number of operands from two on."""
MAXIMUM_CHAIN = 6
GROUP_KERNELS = ("dexp", "dexp_inverse", "kinematics_onto")
"""What a group's `kernels` may list; its other functions every group has."""


@dataclass(frozen=True)
class Request:
    """One kernel that a spec asks for.  result None: the smallest element that holds it."""

    operation: str
    operands: tuple[str, ...]
    result: str | None
    grade: int | None = None

    def __str__(self) -> str:
        """As the spec writes it."""
        arrow = f" -> {self.result}" if self.result else ""
        grade = f" {self.grade}" if self.grade is not None else ""
        return f"{self.operation} {' '.join(self.operands)}{grade}{arrow}"


@dataclass(frozen=True)
class AlgebraSpec:
    """A checked spec: the algebra, its element types, its groups and the kernels it asks for."""

    file: str
    description: str
    digest: str
    algebra: Algebra
    elements: Mapping[str, Element]
    groups: tuple[LieGroup, ...]
    requests: tuple[Request, ...]

    @property
    def name(self) -> str:
        """The algebra's name."""
        return self.algebra.name

    def group(self, name: str) -> LieGroup:
        """Group by name; raises UsageError with what there is."""
        found = next((group for group in self.groups if group.name == name), None)
        if found is None:
            known = [group.name for group in self.groups]
            raise UsageError(
                f'{self.file}: unknown group "{name}"; groups of {self.name} are '
                f"{', '.join(known)}.{suggest(name, known)}"
            )
        return found

    def element(self, name: str, where: str) -> Element:
        """Element type by name; raises UsageError with what there is."""
        found = self.elements.get(name)
        if found is None:
            known = ", ".join(self.elements)
            raise UsageError(
                f'{where}: unknown element "{name}"; {self.name} has {known}.'
                + suggest(name, self.elements)
            )
        return found


def bundled_algebras() -> list[str]:
    """Names of the specs that come with Hamotor."""
    return sorted(path.stem for path in BUNDLED.glob("*.toml"))


def bundled_path(name: str) -> Path:
    """Path of a bundled spec; raises UsageError where there is none of that name."""
    known = bundled_algebras()
    if name not in known:
        raise UsageError(
            f'unknown algebra "{name}"; bundled are {", ".join(known)}.{suggest(name, known)}'
        )
    return BUNDLED / f"{name}.toml"


@cache
def bundled_algebra(name: str) -> AlgebraSpec:
    """A bundled spec, read and proved once in a process; no kernel is made.

    Raises UsageError where there is none of that name.
    """
    return read_algebra(bundled_path(name))


def bundled_group(algebra: str, name: str) -> LieGroup:
    """The group `name` of the bundled algebra; its element type is `.element`.

    Raises UsageError, with what there is, for an unknown algebra or group.
    """
    return bundled_algebra(algebra).group(name)


def read_algebra(path: Path) -> AlgebraSpec:
    """Read and check an algebra's spec file."""
    return parse_algebra(read_text(path), path.name)


def read_text(path: Path) -> str:
    """The text of a spec file; raises UsageError where it is not a readable one."""
    try:
        if not path.is_file():
            raise UsageError(f"{path.name}: not a readable file")
        if path.stat().st_size > MAXIMUM_BYTES:
            raise UsageError(f"{path.name}: larger than {MAXIMUM_BYTES} bytes, the cap for a spec")
        return path.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path.name}: cannot be read: {error}") from error


def parse_algebra(text: str, file: str) -> AlgebraSpec:
    """Check the text of an algebra's spec; `file` names it in messages.

    Raises UsageError naming the file, the key, what is allowed and the nearest allowed word.
    """
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise UsageError(f"{file}: not valid TOML: brackets are nested too deeply") from None
    except ValueError as error:
        decoded = isinstance(error, tomllib.TOMLDecodeError)
        problem = error if decoded else "a number of thousands of digits"
        raise UsageError(f"{file}: not valid TOML: {problem}") from error
    reader = _Reader(file)
    reader.known_keys(data, KEYS, "")
    base = ""
    if "extends" in data:
        base = reader.extended(data)
    algebra = reader.algebra(data)
    elements = reader.elements(data, algebra)
    groups = reader.groups(data, algebra, elements)
    requests = reader.requests(data, elements)
    digest = hashlib.sha256((base + text).encode()).hexdigest()
    description = reader.text(data, "description", "")
    return AlgebraSpec(file, description, digest, algebra, elements, groups, requests)


def _group_refusal(name: str) -> str:
    return reserved.group(name, frozenset(OPERATIONS))


def _other_name(name: str, refusal: Callable[[str], str]) -> str:
    """A suggestion near a name that cannot be taken."""
    plain = "".join(c for c in name if c.isalnum())
    candidates = (name.capitalize(), plain[:1].upper() + plain[1:], plain.lower(), f"{plain}1")
    tried = [*candidates, f"{plain.lower()}1", f"{plain.capitalize()}Type"]
    found = next((c for c in tried if NAME.match(c) and not refusal(c)), "")
    return f'.  Call it "{found}", for example' if found else ""


class _Reader:
    """Turns TOML values into checked ones; every message begins with the file's name."""

    def __init__(self, file: str) -> None:
        self.file = file

    def fail(self, where: str, message: str) -> UsageError:
        return UsageError(
            f"{self.file}: {where}: {message}" if where else f"{self.file}: {message}"
        )

    def extended(self, data: dict[str, Any]) -> str:
        """Add the metric and the element types of the bundled algebra that `data` extends.

        Returns that algebra's text.  Its kernels and groups are not taken over.
        """
        name = self.text(data, "extends", "")
        if name not in bundled_algebras():
            known = bundled_algebras()
            raise self.fail(
                "extends",
                f'unknown algebra "{name}"; bundled are {", ".join(known)}.{suggest(name, known)}',
            )
        base_text = read_text(bundled_path(name))
        base = tomllib.loads(base_text)
        for key in INHERITED:
            if key in data:
                raise self.fail(key, f'is that of {name}, which "extends" names; leave it out')
            if key in base:
                data[key] = base[key]
        own = self.table(data.get("element", {}), "element")
        data["element"] = {**base["element"], **own}
        return base_text

    def known_keys(self, table: Mapping[str, Any], allowed: tuple[str, ...], where: str) -> None:
        for key in table:
            if key not in allowed:
                raise self.fail(
                    where,
                    f'unknown key "{key}"; allowed are {", ".join(allowed)}.'
                    + suggest(key, allowed),
                )

    def text(
        self, table: Mapping[str, Any], key: str, where: str, default: str | None = None
    ) -> str:
        value = table.get(key, default)
        if not isinstance(value, str):
            raise self.fail(
                where, f'"{key}" must be a text' + ("" if key in table else "; it is missing")
            )
        if any(ord(c) < 32 for c in value) or value.endswith("\\"):
            raise self.fail(
                where,
                f'"{key}" becomes a line of a C++ comment: line ends, control characters and a '
                "backslash at its end are not allowed",
            )
        return value

    def name(
        self,
        table: Mapping[str, Any],
        key: str,
        where: str,
        refusal: Callable[[str], str] = lambda _: "",
    ) -> str:
        """A name that C++ can take; refusal: why it cannot, or nothing."""
        value = self.text(table, key, where)
        if not NAME.match(value):
            raise self.fail(where, f'"{key}" = "{value}" must match [A-Za-z][A-Za-z0-9_]*')
        if reason := refusal(value):
            raise self.fail(where, f'"{key}" = "{value}" {reason}{_other_name(value, refusal)}')
        return value

    def rational(self, value: Any, where: str) -> Rational:
        if isinstance(value, bool) or not isinstance(value, int | str):
            raise self.fail(
                where, f'{value!r} must be an integer or a fraction in a text, like "-1/2"'
            )
        large = (
            len(value) > MAXIMUM_DIGITS or LARGE_EXPONENT.search(value)
            if isinstance(value, str)
            else abs(value) >= 10**MAXIMUM_DIGITS
        )
        if large:
            raise self.fail(
                where,
                f"a number of more than {MAXIMUM_DIGITS} digits, or its exponent of more than 2",
            )
        try:
            return simplest(Fraction(value))
        except (ValueError, ZeroDivisionError) as error:
            raise self.fail(where, f"{value!r} is not a fraction") from error

    def table(self, value: Any, where: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise self.fail(where, "must be a table")
        return value

    def array(self, value: Any, where: str) -> list[Any]:
        if not isinstance(value, list):
            raise self.fail(where, "must be an array")
        return value

    def algebra(self, data: Mapping[str, Any]) -> Algebra:
        name = self.name(data, "name", "", reserved.algebra)
        basis = self.array(data.get("basis"), "basis")
        for vector in basis:
            if not isinstance(vector, str) or not re.fullmatch(r"e[0-9a-z]", vector):
                raise self.fail("basis", f'"{vector}" must be "e" and one digit or small letter')
        if len(set(basis)) != len(basis):
            raise self.fail("basis", "a basis vector is listed twice")
        if not 1 <= len(basis) <= MAXIMUM_DIMENSION:
            raise self.fail(
                "basis",
                f"{len(basis)} vectors; 1 to {MAXIMUM_DIMENSION} are allowed "
                "(MAXIMUM_DIMENSION in codegen/spec.py lifts the cap)",
            )
        gram = self.table(data.get("gram"), "gram")
        self.known_keys(gram, ("diagonal", "matrix"), "gram")
        if len(gram) != 1:
            raise self.fail("gram", 'needs exactly one of "diagonal" and "matrix"')
        size = len(basis)
        if "diagonal" in gram:
            squares = [
                self.rational(x, "gram.diagonal")
                for x in self.array(gram["diagonal"], "gram.diagonal")
            ]
            if len(squares) != size:
                raise self.fail("gram.diagonal", f"{len(squares)} numbers for {size} basis vectors")
            rows = [[squares[i] if i == j else 0 for j in range(size)] for i in range(size)]
        else:
            rows = [
                [self.rational(x, "gram.matrix") for x in self.array(row, "gram.matrix")]
                for row in self.array(gram["matrix"], "gram.matrix")
            ]
            if len(rows) != size or any(len(row) != size for row in rows):
                raise self.fail(
                    "gram.matrix", f"must be {size} × {size}, one row for each basis vector"
                )
            for i in range(size):
                for j in range(i):
                    if rows[i][j] != rows[j][i]:
                        raise self.fail(
                            "gram.matrix",
                            f"not symmetric: {basis[i]}·{basis[j]} = {rows[i][j]} but "
                            f"{basis[j]}·{basis[i]} = {rows[j][i]}",
                        )
        lengths = self.lengths(data, basis, rows)
        return Algebra(name, tuple(basis), tuple(tuple(row) for row in rows), lengths)

    def lengths(
        self, data: Mapping[str, Any], basis: list[str], gram: list[list[Rational]]
    ) -> tuple[int, ...]:
        table = self.table(data.get("lengths", {}), "lengths")
        self.known_keys(table, tuple(basis), "lengths")
        for vector, power in table.items():
            if isinstance(power, bool) or not isinstance(power, int) or abs(power) > 9:
                raise self.fail("lengths", f'"{vector}" must be an integer from -9 to 9')
        powers = tuple(table.get(vector, 0) for vector in basis)
        for i, row in enumerate(gram):
            for j, product in enumerate(row):
                if product and powers[i] + powers[j]:
                    raise self.fail(
                        "lengths",
                        f"{basis[i]}·{basis[j]} = {product} is a number, so that the powers of "
                        "length of both must cancel",
                    )
        return powers

    def blade(self, algebra: Algebra, text: Any, where: str) -> tuple[Blade, int]:
        if not isinstance(text, str):
            raise self.fail(where, f"{text!r} is not the name of a blade")
        try:
            return algebra.parse_blade(text)
        except ValueError as error:
            raise self.fail(where, str(error)) from error

    def multivector(self, algebra: Algebra, value: Any, where: str) -> dict[Blade, Rational]:
        result: dict[Blade, Rational] = {}
        for text, coefficient in self.table(value, where).items():
            blade, sign = self.blade(algebra, text, where)
            if blade in result:
                raise self.fail(where, f'"{text}" names a blade that is already there')
            result[blade] = sign * self.rational(coefficient, f"{where}.{text}")
        return {blade: x for blade, x in result.items() if x}

    def elements(self, data: Mapping[str, Any], algebra: Algebra) -> dict[str, Element]:
        elements: dict[str, Element] = {}
        for name, entry in self.table(data.get("element", {}), "element").items():
            where = f"element.{name}"
            if not NAME.match(name):
                raise self.fail(where, "must match [A-Za-z][A-Za-z0-9_]*")
            if reason := reserved.element(name):
                raise self.fail(where, reason + _other_name(name, reserved.element))
            table = self.table(entry, where)
            self.known_keys(table, ("doc", "symbol", "blades", "unit", "fixed"), where)
            components: list[Component] = []
            fixed = self.multivector(algebra, table.get("fixed", {}), f"{where}.fixed")
            seen: set[Blade] = set(fixed)
            for text in self.array(table.get("blades"), f"{where}.blades"):
                blade, _ = self.blade(algebra, text, f"{where}.blades")
                if text == "1":
                    raise self.fail(f"{where}.blades", 'the scalar is called "s" here, not "1"')
                if text in reserved.KEYWORDS:
                    raise self.fail(
                        f"{where}.blades", f'"{text}" is a keyword of C++; order it otherwise'
                    )
                if blade in seen:
                    raise self.fail(
                        f"{where}.blades", f'"{text}" names a blade that is already there'
                    )
                seen.add(blade)
                components.append(blade_component(algebra, text))
            unit = table.get("unit", False)
            if not isinstance(unit, bool):
                raise self.fail(f"{where}.unit", "must be true or false")
            symbol = self.name(table, "symbol", where, reserved.small)
            doc = self.text(table, "doc", where)
            elements[name] = Element(name, symbol, tuple(components), fixed, unit, doc)
        scalar = elements.get("Scalar")
        if scalar and (scalar.blades != (0,) or scalar.fixed or scalar.unit):
            raise self.fail(
                "element.Scalar",
                'is the type of numbers; its blades must be ["s"], without "fixed" and "unit"',
            )
        return elements

    def groups(
        self, data: Mapping[str, Any], algebra: Algebra, elements: Mapping[str, Element]
    ) -> tuple[LieGroup, ...]:
        groups: list[LieGroup] = []
        for index, entry in enumerate(self.array(data.get("group", []), "group"), 1):
            table = self.table(entry, f"group {index}")
            name = self.name(table, "name", f"group {index}", _group_refusal)
            where = f"group {name}"
            if name in elements:
                raise self.fail(where, f"{name} is an element type already")
            if name.lower() == algebra.name:
                raise self.fail(where, f"its namespace, {name.lower()}, is the algebra's name")
            keys = ("name", "description", "element", "generators", "casimirs", "kernels", "lean")
            self.known_keys(table, keys, where)
            if any(group.name.lower() == name.lower() for group in groups):
                raise self.fail(where, "there are two groups of that name")
            holder = self.text(table, "element", where)
            if holder not in elements:
                raise self.fail(
                    where,
                    f'unknown element "{holder}"; elements are {", ".join(elements)}.'
                    + suggest(holder, elements),
                )
            generators: list[Generator] = []
            for item in self.array(table.get("generators"), f"{where}.generators"):
                one = self.table(item, f"{where}.generators")
                self.known_keys(
                    one, ("name", "bivector", "rate", "momentum"), f"{where}.generators"
                )
                generator = self.name(one, "name", f"{where}.generators")
                bivector = self.multivector(
                    algebra, one.get("bivector"), f"{where}.{generator}.bivector"
                )
                generators.append(
                    Generator(
                        generator,
                        bivector,
                        self.name(one, "rate", f"{where}.{generator}", reserved.small),
                        self.name(one, "momentum", f"{where}.{generator}", reserved.small),
                    )
                )
            for what in ("name", "rate", "momentum"):
                names = [getattr(g, what) for g in generators]
                if len(set(names)) != len(names):
                    raise self.fail(where, f"two generators have the same {what}")
            description = self.text(table, "description", where)
            group = lie_group(
                algebra,
                name,
                description,
                elements[holder],
                tuple(generators),
                f"{self.file}: {where}",
                self.casimirs(table, [g.momentum for g in generators], where),
            )
            lean = self.array(table.get("lean", []), f"{where}.lean")
            for function in lean:
                if function not in LEAN_FUNCTIONS:
                    raise self.fail(
                        f"{where}.lean",
                        f'unknown function "{function}"; allowed are {", ".join(LEAN_FUNCTIONS)}.'
                        + suggest(str(function), LEAN_FUNCTIONS),
                    )
            kernels = self.group_kernels(table, where)
            groups.append(replace(group, kernels=kernels, lean=tuple(lean)))
        return tuple(groups)

    def casimirs(
        self, group: Mapping[str, Any], momenta: list[str], where: str
    ) -> tuple[Casimir, ...]:
        found: dict[str, Casimir] = {}
        for item in self.array(group.get("casimirs", []), f"{where}.casimirs"):
            table = self.table(item, f"{where}.casimirs")
            keys = ("name", "formula", "numerator", "denominator")
            self.known_keys(table, keys, f"{where}.casimirs")
            name = self.name(table, "name", f"{where}.casimirs")
            place = f"{where}.casimirs.{name}"
            if name in found:
                raise self.fail(place, "there are two Casimirs of that name")
            parts = []
            for key, default in (("numerator", None), ("denominator", "1")):
                text = self.text(table, key, place, default)
                try:
                    parts.append(parse_polynomial(text, momenta))
                except ValueError as error:
                    raise self.fail(f"{place}.{key}", str(error)) from error
                if not parts[-1]:
                    raise self.fail(f"{place}.{key}", "is zero")
            formula = self.text(table, "formula", place, name)
            found[name] = Casimir(name, formula, parts[0], parts[1])
        return tuple(found.values())

    def group_kernels(self, table: Mapping[str, Any], where: str) -> tuple[str, ...]:
        names: list[str] = []
        for name in self.array(table.get("kernels", []), f"{where}.kernels"):
            if not isinstance(name, str) or name not in GROUP_KERNELS:
                raise self.fail(
                    f"{where}.kernels",
                    f'unknown kernel "{name}"; those on request are {", ".join(GROUP_KERNELS)}.'
                    + suggest(str(name), GROUP_KERNELS),
                )
            if name in names:
                raise self.fail(f"{where}.kernels", f'"{name}" is listed twice')
            names.append(name)
        return tuple(names)

    def requests(
        self, data: Mapping[str, Any], elements: Mapping[str, Element]
    ) -> tuple[Request, ...]:
        requests: list[Request] = []
        for operation, entries in self.table(data.get("kernels", {}), "kernels").items():
            if operation not in OPERATIONS:
                raise self.fail(
                    "kernels",
                    f'unknown operation "{operation}"; known are {", ".join(OPERATIONS)}.'
                    + suggest(operation, OPERATIONS),
                )
            where = f"kernels.{operation}"
            for text in self.array(entries, where):
                if not isinstance(text, str):
                    raise self.fail(
                        where, f'{text!r} must be a text such as "Motor Motor -> Motor"'
                    )
                left, arrow, right = text.partition("->")
                words = left.split()
                grade: int | None = None
                if operation == "grade" and len(words) == 2 and words[1].isdecimal():
                    grade = int(words.pop())
                wanted = OPERATIONS[operation]
                fits = len(words) == wanted or (
                    operation in CHAINS and wanted <= len(words) <= MAXIMUM_CHAIN
                )
                if not fits or (arrow and len(right.split()) != 1):
                    raise self.fail(
                        where,
                        f'"{text}" must be {wanted} element name(s)'
                        + (" and a grade" if operation == "grade" else "")
                        + ', then perhaps "-> RESULT"',
                    )
                for word in [*words, *right.split()]:
                    if word not in elements:
                        raise self.fail(
                            where,
                            f'"{text}": unknown element "{word}"; elements are '
                            f"{', '.join(elements)}." + suggest(word, elements),
                        )
                if "Scalar" in words:
                    raise self.fail(
                        where,
                        f'"{text}": Scalar is a number, which functions return and do not take; '
                        'declare another element with blades = ["s"] for that',
                    )
                request = Request(operation, tuple(words), right.strip() or None, grade)
                if request in requests:
                    raise self.fail(where, f'"{text}" is listed twice')
                for other in requests:
                    if (other.operation, other.operands, other.grade or 0) == (
                        operation,
                        request.operands,
                        grade or 0,
                    ):
                        raise self.fail(
                            where,
                            f'"{text}" and "{other}" have the same operands, by which alone C++ '
                            "tells functions apart; leave one out",
                        )
                requests.append(request)
        return tuple(requests)
