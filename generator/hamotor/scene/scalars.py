"""The scalars that a scene can be compiled for, and how C++ writes numbers of them."""

from __future__ import annotations

import re
from dataclasses import dataclass

from hamotor.errors import UsageError, suggest
from hamotor.scene.exact import DIGITS, decimal

NAMES = ("double", "float", "long_double", "quad", "mpfr")
DEFAULT_DIGITS = 50
"""Of MPFR's numbers."""
COUNTED = "counted"
"""Doubles that count operations, for benchmarks."""
_HEADERS = {"mpfr": "hamotor/mpfr.hpp", COUNTED: "hamotor/counted.hpp"}


@dataclass(frozen=True)
class Scalar:
    """A scalar of the runtime; `digits` is how many decimal ones MPFR's numbers have."""

    name: str
    digits: int = 0

    @property
    def cpp(self) -> str:
        """Its C++ type."""
        own = {
            "quad": "hamotor::scalar::Quad",
            "mpfr": f"hamotor::Mpfr<{self.digits}>",
            COUNTED: "hamotor::Counted",
        }
        return own.get(self.name) or self.name.replace("_", " ")

    @property
    def header(self) -> str:
        """What must be included for it; "" for those of the language."""
        return _HEADERS.get(self.name, "")

    @property
    def is_wide(self) -> bool:
        """Whether it has more digits than a double."""
        return self.name not in {"double", "float", COUNTED}

    @property
    def constant(self) -> str:
        """How a constant of the scene is declared: MPFR's are made when the scene is loaded."""
        return "static inline const" if self.name == "mpfr" else "static constexpr"

    @property
    def function(self) -> str:
        """What a function of it that is no template begins with."""
        return "" if self.name == "mpfr" else "constexpr "

    def literal(self, x: float) -> str:
        """`x` in C++, all digits of the number that it stands for; short integers as they are."""
        if x == int(x) and abs(x) < 1e9:
            return str(int(x))
        if not self.is_wide:
            return f"{float(x)!r}{'F' if self.name == 'float' else ''}"
        from hamotor.codegen.cpp import number_text

        return number_text(decimal(x))


def parse_scalar(word: str) -> Scalar:
    """The scalar of this name; `mpfr40` has 40 digits, `mpfr` `DEFAULT_DIGITS`.  UsageError.

    `COUNTED` is known as well, and not offered: it is a double to whom only benchmarks listen.
    """
    found = re.fullmatch(r"(mpfr)([0-9]{1,4})", word)
    name, digits = (found[1], int(found[2])) if found else (word, DEFAULT_DIGITS)
    if name not in (*NAMES, COUNTED):
        raise UsageError(
            f'unknown scalar "{word}"; there is {", ".join(NAMES)}.{suggest(word, NAMES)}'
        )
    if name != "mpfr":
        return Scalar(name)
    if not 17 <= digits <= DIGITS:
        raise UsageError(f"digits must be at least 17 and at most {DIGITS}, not {digits}.")
    return Scalar(name, digits)
