"""Dual numbers a + b ε with ε² = 0: derivatives of a program by running it, without symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Dual:
    """a + b ε: a value and its derivative along one direction."""

    value: Any
    slope: Any

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __add__(self, other: Dual) -> Dual:
        return Dual(self.value + other.value, self.slope + other.slope)

    def __mul__(self, other: Dual) -> Dual:
        slope = self.slope * other.value + self.value * other.slope
        return Dual(self.value * other.value, slope)

    def __truediv__(self, other: Dual) -> Dual:
        value = self.value / other.value
        return Dual(value, (self.slope - value * other.slope) / other.value)


def dual_functions(functions: Mapping[str, Callable[..., Any]]) -> dict[str, Callable[..., Any]]:
    """The functions that a program may call, on dual numbers over those that are given."""
    f = functions

    def lifted(name: str, derivative: Callable[[Any, Any], Any]) -> Callable[[Dual], Dual]:
        def on_dual(x: Dual) -> Dual:
            value = f[name](x.value)
            return Dual(value, derivative(x.value, value) * x.slope)

        return on_dual

    def atan2(y: Dual, x: Dual) -> Dual:
        squared = x.value * x.value + y.value * y.value
        slope = (x.value * y.slope - y.value * x.slope) / squared
        return Dual(f["atan2"](y.value, x.value), slope)

    derivatives: dict[str, Callable[[Any, Any], Any]] = {
        "sqrt": lambda _, y: 1 / (2 * y),
        "exp": lambda _, y: y,
        "log": lambda x, _: 1 / x,
        "sin": lambda x, _: f["cos"](x),
        "cos": lambda x, _: -f["sin"](x),
        "tan": lambda _, y: 1 + y * y,
        "asin": lambda x, _: 1 / f["sqrt"](1 - x * x),
        "acos": lambda x, _: -1 / f["sqrt"](1 - x * x),
        "atan": lambda x, _: 1 / (1 + x * x),
        "sinh": lambda x, _: f["cosh"](x),
        "cosh": lambda x, _: f["sinh"](x),
        "tanh": lambda _, y: 1 - y * y,
        "abs": lambda x, _: f["sign"](x),
        "sign": lambda x, _: 0 * x,
    }
    return {
        **{name: lifted(name, derivative) for name, derivative in derivatives.items()},
        "atan2": atan2,
        "number": lambda x: Dual(f["number"](x), f["number"](0)),
    }
