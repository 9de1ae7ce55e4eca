"""Generated kernels as Python functions of coefficient arrays, and random values for them."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import count
from random import Random
from typing import Any

import numpy as np
from tests.peers.conversation import Array

from hamotor.codegen import bundled_algebras, read_algebra
from hamotor.codegen.algebra import Algebra, Multivector, Rational, grade, reverse_sign
from hamotor.codegen.element import Element
from hamotor.codegen.kernel import Kernel
from hamotor.codegen.library import request_kernel
from hamotor.codegen.spec import OPERATIONS, AlgebraSpec, bundled_path
from hamotor.run.build import compile_scene


@cache
def spec(algebra: str) -> AlgebraSpec:
    """A bundled algebra."""
    return read_algebra(bundled_path(algebra))


@cache
def kernels(algebra: str) -> tuple[Kernel, ...]:
    """The kernels of an algebra that its spec asks for, of one or two operands."""
    found = spec(algebra)
    return tuple(
        request_kernel(found, request)
        for request in found.requests
        if len(request.operands) == OPERATIONS[request.operation] and request.operation != "grade"
    )


def algebras_with(operation: str) -> list[str]:
    """The bundled algebras whose specs ask for an operation."""
    return [
        name
        for name in bundled_algebras()
        if any(request.operation == operation for request in spec(name).requests)
    ]


@dataclass(frozen=True)
class Function:
    """One generated kernel, compiled."""

    kernel: Kernel
    address: Any

    @property
    def result(self) -> Element | None:
        """The element type that it returns; None for a number."""
        return self.kernel.program.result

    def __call__(self, *operands: Array) -> Array:
        """The components of the result for the components of the operands."""
        numbers = np.concatenate([*operands, np.zeros(1)])
        outputs = np.empty(len(self.kernel.program.outputs))
        pointer = ctypes.POINTER(ctypes.c_double)
        self.address(numbers.ctypes.data_as(pointer), outputs.ctypes.data_as(pointer))
        return outputs


@cache
def functions(algebra: str) -> tuple[Function, ...]:
    """Every kernel of an algebra, from one shared library."""
    listed = kernels(algebra)
    library = ctypes.CDLL(str(compile_scene(_source(algebra, listed)).library))
    return tuple(Function(k, library[f"kernel_{i}"]) for i, k in enumerate(listed))


def _source(algebra: str, listed: tuple[Kernel, ...]) -> str:
    wrappers = []
    for i, kernel in enumerate(listed):
        places = count()
        operands = []
        for element in kernel.operands:
            components = ", ".join(f"in[{next(places)}]" for _ in element.components)
            number = element.name == "Scalar"
            operands.append(components if number else f"{element.cpp_name}<double>{{{components}}}")
        result = kernel.program.result
        number = result is None or result.name == "Scalar"
        names = [] if result is None or number else [c.name for c in result.components]
        stores = " ".join(f"out[{j}] = y.{name};" for j, name in enumerate(names)) or "out[0] = y;"
        wrappers.append(
            f'extern "C" __attribute__((visibility("default")))\n'
            f"void kernel_{i}([[maybe_unused]] const double* in, double* out) {{\n"
            f"  const auto y = hamotor::{algebra}::{kernel.name}({', '.join(operands)});\n"
            f"  {stores}\n}}\n"
        )
    header = f'#include "hamotor/{algebra}/kernels.hpp"\nusing namespace hamotor::{algebra};\n'
    return header + "\n".join(wrappers)


def embedded(element: Element, components: Array, dimension: int) -> Array:
    """The multivector that an element's components stand for."""
    value = np.zeros(1 << dimension)
    for blade, x in element.fixed.items():
        value[blade] += float(x)
    for component, number in zip(element.components, components, strict=True):
        for blade, x in component.embedding.items():
            value[blade] += float(x) * number
    return value


def read_off(element: Element | None, value: Array) -> Array:
    """An element's components of a multivector; its scalar part where there is no element."""
    if element is None:
        return value[:1]
    return np.array([sum(float(x) * value[b] for b, x in row.items()) for row in element.reading])


# ---------------------------------------------------------------- random values


def random_components(algebra: Algebra, element: Element, random: Random) -> Array:
    """Components in [-1, 1), or of a unit versor where the type is one."""
    if not element.unit:
        return np.array([random.uniform(-1, 1) for _ in element.components])
    exact = _versor(algebra, element, random)
    value = np.zeros(1 << algebra.dimension)
    for blade, x in exact.items():
        value[blade] = float(x)
    return read_off(element, value)


def _versor(algebra: Algebra, element: Element, random: Random) -> Multivector:
    """A product of simple rotors (1 + t b)² / (1 − t² b²) of all the type's planes: exactly unit.

    An odd type's is a unit basis vector moved by such a product.
    """
    if element.grades != (1,):
        planes = [b for b in element.blades if grade(b) == 2]
        return _rotor(algebra, planes, random)
    every = [b for b in range(1 << algebra.dimension) if grade(b) == 2]
    rotor = _rotor(algebra, every, random)
    unit = next(1 << i for i in range(algebra.dimension) if algebra.gram[i][i] == 1)
    turned = algebra.multiply(rotor, {unit: 1})
    return algebra.multiply(turned, {b: reverse_sign(b) * x for b, x in rotor.items()})


def _rotor(algebra: Algebra, planes: list[int], random: Random) -> Multivector:
    product: Multivector = {0: 1}
    for b in planes:
        t = Fraction(random.choice([-3, -2, -1, 1, 2, 3]), 10)
        square: Rational = algebra.multiply({b: 1}, {b: 1}).get(0, 0)
        rest = 1 - t * t * square
        simple = {0: (1 + t * t * square) / rest, b: 2 * t / rest}
        product = algebra.multiply(product, simple)
    return product
