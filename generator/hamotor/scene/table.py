"""One TOML table, read key by key: every mistake is an error that names file, place and key."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any, NoReturn

from hamotor.errors import UsageError, suggest
from hamotor.scene.exact import rounded
from hamotor.scene.groups import Group
from hamotor.scene.motors import Matrix, Vector
from hamotor.scene.schema import LARGEST, NAME_PATTERN, Section

LONGEST_TEXT = 200
LONGEST_NAME = 64
MOST_EXPRESSION = 10_000
"""Longer ones are refused by the language itself."""


def quoted(text: str) -> str:
    """`text` in double quotes, safe to print: control characters escaped, shortened if long."""
    shown = text if len(text) <= 60 else text[:57] + "..."
    return '"' + "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in shown) + '"'


def listed(names: Iterable[str]) -> str:
    """`"a", "b"`, shortened if there are many."""
    every = [quoted(name) for name in names]
    return ", ".join(every[:20]) + (f" and {len(every) - 20} more" if len(every) > 20 else "")


def kind_of(value: object) -> str:
    """What a TOML value is, as its author would call it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"the text {quoted(value)}"
    if isinstance(value, int):
        return f"the number {value}" if abs(value) < 10**20 else "a number of more than 20 digits"
    if isinstance(value, float):
        return f"the number {value!r}"
    if isinstance(value, list):
        return f"an array of length {len(value)}"
    if isinstance(value, dict):
        return "a table"
    return "a date or time"


@dataclass(frozen=True)
class Table:
    """One table of a scene file, with its place for messages."""

    file: str
    place: str
    """`body "top"`, `interaction 2`, `[time]`; "" at the top level."""
    values: dict[str, Any]
    section: Section
    group: Group

    def fail(self, message: str, key: str = "") -> NoReturn:
        """Raise the UsageError for `message`, about `key` where one is given."""
        raise UsageError(": ".join(part for part in (self.file, self.place, key, message) if part))

    def refuse_unknown_keys(self) -> None:
        """Every key must be in the schema and mean something on this group."""
        allowed = self.section.names(self.group)
        for name in self.values:
            if name in allowed:
                continue
            if any(key.name == name for key in self.section.keys):
                self.fail(
                    f'key "{name}" has no meaning on {self.group.name};'
                    f" keys of {self.section.what} are {listed(allowed)}"
                )
            self.fail(
                f"unknown key {quoted(name)}; keys of {self.section.what} are"
                f" {listed(allowed)}.{suggest(name, allowed)}"
            )

    def has(self, name: str) -> bool:
        """Whether the file sets this key."""
        return name in self.values

    def one_of(self, *names: str) -> str:
        """The single key of `names` that is set; none or several is an error."""
        allowed = [name for name in names if name in self.section.names(self.group)]
        given = [name for name in allowed if self.has(name)]
        if not given:
            self.fail(f"missing {' or '.join(quoted(name) for name in allowed)}")
        if len(given) > 1:
            self.fail(
                f"{' and '.join(quoted(name) for name in given)} contradict each other; give one"
            )
        return given[0]

    def _value(self, name: str) -> Any:
        key = self.section.key(name)
        if name in self.values:
            return self.values[name]
        if key.default is None:
            unit = f", {key.unit}" if key.unit else ""
            meaning = f": {key.doc}{unit}" if key.doc else f" ({key.unit})" if key.unit else ""
            self.fail(f'missing "{name}"{meaning}')
        default = tomllib.loads(f"value = {key.default}")["value"]
        if default == 0 and key.kind in ("vector", "rotation"):
            planar_rotation = key.kind == "rotation" and self.group.dimension == 2
            return 0.0 if planar_rotation else [0.0] * self.group.dimension
        return default

    def _number(self, value: object, name: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fail(f"must be a number, not {kind_of(value)}", name)
        if isinstance(value, float) and not math.isfinite(value):
            self.fail(f"must be finite, not {value!r}", name)
        if abs(value) > LARGEST:
            self.fail(f"must lie within ±{LARGEST:g}, so that nothing overflows", name)
        if value == 0:
            return 0.0
        return value if isinstance(value, float) else rounded(Fraction(value))

    def number(self, name: str) -> float:
        """A finite number of the kind the schema asks for."""
        value = self._value(name)
        kind = self.section.key(name).kind
        number = self._number(value, name)
        if kind == "positive" and number <= 0:
            self.fail(f"must be positive, not {number:g}", name)
        if kind == "positive" and number < 1 / LARGEST:
            self.fail(f"must be at least {1 / LARGEST:g}, so that nothing overflows", name)
        if kind == "non-negative" and number < 0:
            self.fail(f"must not be negative: {number:g}", name)
        return number

    def integer(self, name: str) -> int:
        """An integer, at least 1, of the kind `whole` at least 0."""
        least = 0 if self.section.key(name).kind == "whole" else 1
        return self._integer(self._value(name), name, least)

    def _integer(self, value: object, name: str, least: int) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            self.fail(f"must be an integer, not {kind_of(value)}", name)
        if not least <= value <= 10**18:
            self.fail(f"must be at least {least} and at most 10^18, not {kind_of(value)}", name)
        return value

    def wholes(self, name: str) -> tuple[int, ...]:
        """Different integers from 0, in order."""
        found = [
            self._integer(x, f"{name}: number {k}", 0) for k, x in enumerate(self._array(name), 1)
        ]
        if len(set(found)) < len(found):
            self.fail("has a number twice", name)
        return tuple(sorted(found))

    def fractions(self, name: str) -> tuple[float, ...]:
        """Numbers between 0 and 1, in ascending order."""
        found = tuple(
            self._number(x, f"{name}: number {k}") for k, x in enumerate(self._array(name), 1)
        )
        for k, x in enumerate(found, 1):
            if not 0 < x < 1:
                self.fail(f"must lie between 0 and 1, not {x:g}", f"{name}: number {k}")
        if any(a >= b for a, b in pairwise(found)):
            self.fail("must ascend", name)
        return found

    def vectors(self, name: str, length: int) -> tuple[Vector, ...]:
        """At least one array of `length` finite numbers; where that is 1, numbers."""
        found = []
        for k, value in enumerate(rows := self._array(name), 1):
            row = value if isinstance(value, list) else [value]
            if len(row) != length:
                self.fail(f"must be {length} numbers, not {kind_of(value)}", f"{name}: value {k}")
            found.append(tuple(self._number(x, f"{name}: value {k}") for x in row))
        if not rows:
            self.fail("needs at least one value", name)
        return tuple(found)

    def _array(self, name: str) -> list[Any]:
        value = self._value(name)
        if not isinstance(value, list):
            self.fail(f"must be an array, not {kind_of(value)}", name)
        return value

    def times(self, name: str, end: float) -> tuple[float, ...]:
        """Numbers from 0 to `end`, each later in the run than the one before it."""
        value = self._value(name)
        if not isinstance(value, list) or not value:
            self.fail(f"must be an array of times, s, not {kind_of(value)}", name)
        found = tuple(
            self._number(x, f"{name}: number {k} of {len(value)}") + 0.0
            for k, x in enumerate(value, 1)
        )
        for k, (before, x) in enumerate(zip((None, *found), found, strict=False), 1):
            if not 0 <= x / end <= 1:
                self.fail(f"number {k}, {x:g}, is not between 0 and end = {end:g}", name)
            if before is not None and not before / end < x / end:
                self.fail(f"number {k}, {x:g}, does not come after {before:g}", name)
        return found

    def flag(self, name: str) -> bool:
        """true or false."""
        value = self._value(name)
        if not isinstance(value, bool):
            self.fail(f"must be true or false, not {kind_of(value)}", name)
        return value

    def numbers(self, name: str, length: int, what: str) -> Vector:
        """`length` finite numbers; `what` says what they are."""
        value = self._value(name)
        if not isinstance(value, list) or len(value) != length:
            self.fail(f"must be {length} numbers, {what}, not {kind_of(value)}", name)
        return tuple(
            self._number(x, f"{name}: number {k} of {length}") for k, x in enumerate(value, 1)
        )

    def vector(self, name: str) -> Vector:
        """A vector of the space's dimension."""
        components = f"[{', '.join('xyzw'[: self.group.dimension])}]"
        return self.numbers(name, self.group.dimension, components)

    def rotation(self, name: str) -> Vector:
        """An angular velocity or momentum: a vector, in the plane one number."""
        return (self.number(name),) if self.group.dimension == 2 else self.vector(name)

    def lengths(self, name: str) -> Vector:
        """As many non-negative lengths as the space has dimensions, not all of them zero."""
        lengths = self.numbers(name, self.group.dimension, "one length per axis")
        for k, x in enumerate(lengths, 1):
            if x < 0:
                self.fail(f"number {k} must not be negative: {x:g}", name)
        return lengths

    def matrix(self, name: str, size: int = 3) -> Matrix:
        """A square matrix, rows first."""
        rows = self._value(name)
        if (
            not isinstance(rows, list)
            or len(rows) != size
            or any(not isinstance(row, list) or len(row) != size for row in rows)
        ):
            shown = ", ".join(["[..]"] * size) if size <= 4 else "[..], …"
            self.fail(f"must be a {size}x{size} matrix [{shown}], not {kind_of(rows)}", name)
        return tuple(
            tuple(self._number(x, f"{name}: row {i}, column {j}") for j, x in enumerate(row, 1))
            for i, row in enumerate(rows, 1)
        )

    def text(self, name: str) -> str:
        """One printable line of text."""
        value = self._value(name)
        if not isinstance(value, str):
            self.fail(f"must be text, not {kind_of(value)}", name)
        if len(value) > LONGEST_TEXT:
            self.fail(f"must be at most {LONGEST_TEXT} characters, not {len(value)}", name)
        if not value.isprintable():
            self.fail(f"must be one printable line, not {quoted(value)}", name)
        return value

    def expression(self, name: str) -> str:
        """Text in the language of Hamiltonians; line breaks are spaces."""
        value = self._value(name)
        if not isinstance(value, str):
            self.fail(f"must be an expression in quotes, not {kind_of(value)}", name)
        return " ".join(value.split()) if len(value) <= MOST_EXPRESSION else value

    def parameters(self, name: str) -> dict[str, float | Vector]:
        """Names with a number or an array of 2 to 4 numbers each."""
        values = self._value(name)
        if not isinstance(values, dict):
            self.fail(f"must be a table of names and numbers, not {kind_of(values)}", name)
        found: dict[str, float | Vector] = {}
        for key, value in values.items():
            if not re.fullmatch(NAME_PATTERN, key) or len(key) > LONGEST_NAME:
                self.fail(
                    f"{quoted(key)} is not a name: a letter, then letters, digits and _", name
                )
            if isinstance(value, list):
                if not 2 <= len(value) <= 4:
                    self.fail(f"must have 2 to 4 numbers, not {len(value)}", f"{name}: {key}")
                found[key] = tuple(self._number(x, f"{name}: {key}") for x in value)
            else:
                found[key] = self._number(value, f"{name}: {key}")
        return found

    def components(self, name: str, allowed: Sequence[str]) -> dict[str, float]:
        """A table of numbers, each by one of the names in `allowed`."""
        values = self._value(name)
        if not isinstance(values, dict):
            self.fail(f"must be a table of numbers, not {kind_of(values)}", name)
        for key in values:
            if key not in allowed:
                self.fail(
                    f"unknown component {quoted(key)}; there are {listed(allowed)}."
                    f"{suggest(key, allowed)}",
                    name,
                )
        return {key: self._number(value, f"{name}: {key}") for key, value in values.items()}

    def choice(self, name: str, allowed: Sequence[str], plural: str) -> str:
        """One of the texts in `allowed`."""
        value = self._value(name)
        if not isinstance(value, str):
            self.fail(f"must be one of {listed(allowed)}, not {kind_of(value)}", name)
        if value not in allowed:
            self.fail(
                f"unknown {name} {quoted(value)}; {plural} are {listed(allowed)}."
                f"{suggest(value, allowed)}"
            )
        return value

    def name(self, name: str) -> str:
        """A name: a letter, then letters, digits and underscores."""
        value = self._value(name)
        if not isinstance(value, str):
            self.fail(f"must be a name in quotes, not {kind_of(value)}", name)
        if not re.fullmatch(NAME_PATTERN, value) or len(value) > LONGEST_NAME:
            self.fail(
                f"{quoted(value)} is not a name: a letter, then letters, digits and _,"
                f" at most {LONGEST_NAME} in all",
                name,
            )
        return value

    def table(self, name: str, section: Section, *, heading: bool = False) -> Table:
        """The table under `name`, its keys checked; `heading`: it is a [name] of the file."""
        value = self._value(name)
        if not isinstance(value, dict):
            self.fail(f"must be a table, not {kind_of(value)}", name)
        place = f"[{name}]" if heading else ": ".join(p for p in (self.place, name) if p)
        inner = Table(self.file, place, value, section, self.group)
        inner.refuse_unknown_keys()
        return inner

    def tables(self, name: str) -> list[dict[str, Any]]:
        """The array of tables under `name`, their keys not yet checked."""
        value = self._value(name)
        if isinstance(value, dict):
            self.fail(f"must be an array of tables: write [[{name}]], not [{name}]", name)
        if not isinstance(value, list) or any(not isinstance(x, dict) for x in value):
            self.fail(f"must be an array of tables, not {kind_of(value)}", name)
        return value
