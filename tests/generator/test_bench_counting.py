"""Operations that are counted at run time are those that the generator says."""

from __future__ import annotations

import ctypes

import pytest

from hamotor.run.build import compile_scene

pytestmark = pytest.mark.slow

_SOURCE = """
#include "hamotor/counted.hpp"
#include "hamotor/pga3/pga3.hpp"
#include "hamotor/state.hpp"

using hamotor::Counted;
using Motor = hamotor::pga3::Motor<Counted>;

extern "C" [[gnu::visibility("default")]] double product(const double* x) {
  Motor a, b;
  a = Motor::from({x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]});
  b = Motor::from({x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[0]});
  hamotor::note_evaluations<Counted>(3);
  hamotor::note_evaluations<double>(5);
  double sum = 0;
  for (const Counted& c : gp(a, b).components()) sum += static_cast<double>(c);
  return sum;
}

extern "C" [[gnu::visibility("default")]] double functions(double x) {
  const Counted y(x);
  const Counted folded = Counted(3) * Counted(4);
  return static_cast<double>(sqrt(y) / y + sin(y) - fma(y, y, folded));
}
"""


def test_counted_operations_of_a_motor_product_are_those_of_its_program() -> None:
    library = ctypes.CDLL(str(compile_scene(_SOURCE).library))
    library.product.restype = library.functions.restype = ctypes.c_double
    counts = (ctypes.c_int64 * 6)()
    library.hamotor_counts(counts)
    library.product((ctypes.c_double * 8)(*range(1, 9)))
    library.hamotor_counts(counts)
    # 48 of 64 pairs of blades do not vanish, in 8 sums.
    assert list(counts) == [40, 48, 0, 0, 0, 3]
    library.functions(ctypes.c_double(0.5))
    library.hamotor_counts(counts)
    assert list(counts) == [3, 1, 1, 1, 1, 0]
    library.hamotor_counts(counts)
    assert not any(counts)
