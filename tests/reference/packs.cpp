// How far the functions of packs are from the truth, in units of the last place, over arguments of
// every kind: denormal, huge, near zeros, poles and the places where formulas meet.
//
//   packs measure COUNT   one JSON object a line: function, scalar, points, max ulp, where, misses
//   packs sample COUNT    function, scalar, arguments, and the reference in full
//
// The truth is libquadmath's, which packs.py holds against 50 digits.
#include "hamotor/pack.hpp"

#include <quadmath.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "hamotor/angle_increment.hpp"
#include "random.hpp"

namespace {

__extension__ using Quad = __float128;

using reference::Random;

/// A number of any exponent between two, of either sign.
template <class T>
T of_size(Random& random, double low, double high) {
  const double exponent = std::floor(random.between(low, high));
  return static_cast<T>(-random.sign() *
                        std::ldexp(1 + random.uniform(), static_cast<int>(exponent)));
}

/// One of the numbers next to x.
template <class T>
T beside(Random& random, Quad x) {
  T result = static_cast<T>(x);
  for (std::size_t n = random.below(4); n > 0; --n) {
    result = std::nextafter(result, static_cast<T>(-random.sign()) * std::numeric_limits<T>::max());
  }
  return result;
}

constexpr double far_angle = 1e8;
const Quad pi = 2 * asinq(1);
const Quad log_2 = logq(2);

template <class T>
T some_angle(Random& random) {
  using Limits = std::numeric_limits<T>;
  switch (random.below(8)) {
    case 0:
      return of_size<T>(random, Limits::min_exponent - Limits::digits, 26);
    case 1:
      return of_size<T>(random, 26, Limits::max_exponent);
    case 2:
      return beside<T>(random, std::floor(far_angle * 0.636 * random.uniform()) * pi / 2);
    case 3:
      return beside<T>(random, std::floor(50 * random.uniform()) * pi / 4);
    case 4:
      return beside<T>(random, -random.sign() * far_angle);
    case 5:
      return static_cast<T>(random.between(-far_angle, far_angle));
    default:
      return static_cast<T>(random.between(-7, 7));
  }
}

/// Where eˣ is a number, and a little beyond.
template <class T>
T some_exponent(Random& random) {
  using Limits = std::numeric_limits<T>;
  const double least = (Limits::min_exponent - Limits::digits - 2) * M_LN2;
  const double most = (Limits::max_exponent + 1) * M_LN2;
  switch (random.below(6)) {
    case 0:
      return of_size<T>(random, Limits::min_exponent - Limits::digits, 10);
    case 1:
      return beside<T>(random, (std::floor(random.between(least, most) / M_LN2) + 0.5) * log_2);
    case 2:
      return beside<T>(random, Limits::max_exponent * log_2);
    case 3:  // denormal results
      return static_cast<T>(random.between(least, Limits::min_exponent * M_LN2));
    default:
      return static_cast<T>(random.between(least, most));
  }
}

template <class T>
T some_number(Random& random) {
  using Limits = std::numeric_limits<T>;
  return of_size<T>(random, Limits::min_exponent - Limits::digits, Limits::max_exponent);
}

template <class T>
T some_positive(Random& random) {
  if (random.below(4) == 0) return beside<T>(random, 1 + of_size<double>(random, -50, -1) / 2);
  return std::abs(some_number<T>(random));
}

/// Between −1 and 1.
template <class T>
T some_sine(Random& random) {
  const T x =
      random.below(3) == 0
          ? beside<T>(random, -random.sign() * (1 - std::abs(of_size<double>(random, -50, -1))))
      : random.below(2) == 0 ? of_size<T>(random, -140, -1)
                             : static_cast<T>(random.between(-1, 1));
  return std::clamp(x, T(-1), T(1));
}

/// The distance in units of the last place of the truth; infinite where one is a number and the
/// other is none.
template <class T>
double ulps(T found, Quad truth) {
  using Limits = std::numeric_limits<T>;
  if (static_cast<T>(truth) == found) {
    if (!std::isfinite(found)) return 0;
  } else if (!std::isfinite(found)) {
    // What lies less than half a unit beyond the largest number rounds to it.
    const bool overflows = fabsq(truth) > Quad(Limits::max()) * (1 - Quad(Limits::epsilon()));
    return overflows && std::isinf(found) ? 1 : std::numeric_limits<double>::infinity();
  }
  int exponent = 0;
  frexpq(truth, &exponent);
  const int last = std::max(exponent, Limits::min_exponent) - Limits::digits;
  return static_cast<double>(fabsq(Quad(found) - truth) * ldexpq(1, -last));
}

template <class T>
constexpr std::size_t lanes = hamotor::widest<T>;
template <class T>
using Lanes = hamotor::Pack<T, lanes<T>>;

template <class T>
constexpr const char* scalar_name = sizeof(T) == 8 ? "double" : "float";

using Text = std::array<char, 64>;

Text in_full(Quad x) {
  Text text{};
  quadmath_snprintf(text.data(), text.size(), "%.36Qe", x);
  return text;
}

/// One function, over points of `make`: arguments x and, for those of two, y.
template <class T, class Make, class Function, class Exact>
void measure(const char* name, int count, bool sample, const Make& make, const Function& function,
             const Exact& exact) {
  Random random{static_cast<std::uint64_t>(sizeof(T))};
  double worst = 0;
  T where[2] = {};
  for (int n = 0; n < count; n += static_cast<int>(lanes<T>)) {
    Lanes<T> x(0);
    Lanes<T> y(0);
    for (std::size_t k = 0; k < lanes<T>; ++k) {
      x.set(k, make(random));
      y.set(k, make(random));
    }
    const Lanes<T> found = function(x, y);
    for (std::size_t k = 0; k < lanes<T>; ++k) {
      const Quad truth = exact(Quad(x[k]), Quad(y[k]));
      if (sample) {
        std::printf(
            "{\"function\": \"%s\", \"scalar\": \"%s\", \"x\": %.17g, \"y\": %.17g, "
            "\"truth\": \"%s\"}\n",
            name, scalar_name<T>, static_cast<double>(x[k]), static_cast<double>(y[k]),
            in_full(truth).data());
        continue;
      }
      const double error = ulps(found[k], truth);
      if (!(error <= worst)) {
        worst = error;
        where[0] = x[k];
        where[1] = y[k];
      }
    }
  }
  if (!sample) {
    std::printf(
        "{\"function\": \"%s\", \"scalar\": \"%s\", \"points\": %d, \"max_ulp\": %.4g, "
        "\"x\": %.17g, \"y\": %.17g}\n",
        name, scalar_name<T>, count, worst, static_cast<double>(where[0]),
        static_cast<double>(where[1]));
  }
}

template <class T>
void measure_all(int count, bool sample) {
  using P = Lanes<T>;
  const auto each = [&](const char* name, T (*make)(Random&), auto function, auto exact) {
    measure<T>(
        name, count, sample, make, [&](const P& x, const P&) { return function(x); },
        [&](Quad x, Quad) { return exact(x); });
  };
  const auto increment = [](const P& x) { return hamotor::AngleIncrement<P>::of(x); };
  each("AngleIncrement: sin x", some_angle<T>, [&](const P& x) { return increment(x).sine; }, sinq);
  each(
      "AngleIncrement: cos x - 1", some_angle<T>,
      [&](const P& x) { return increment(x).cosine_less_one; },
      [](Quad x) { return -2 * sinq(x / 2) * sinq(x / 2); });
#define HAMOTOR_FUNCTION(name, points) \
  each(#name, points<T>, [](const P& x) { return name(x); }, name##q);
  HAMOTOR_FUNCTION(sqrt, some_positive)
  HAMOTOR_FUNCTION(sin, some_angle)
  HAMOTOR_FUNCTION(cos, some_angle)
  HAMOTOR_FUNCTION(exp, some_exponent)
  HAMOTOR_FUNCTION(tan, some_angle)
  HAMOTOR_FUNCTION(log, some_positive)
  HAMOTOR_FUNCTION(sinh, some_exponent)
  HAMOTOR_FUNCTION(cosh, some_exponent)
  HAMOTOR_FUNCTION(tanh, some_exponent)
  HAMOTOR_FUNCTION(asinh, some_number)
  HAMOTOR_FUNCTION(asin, some_sine)
  HAMOTOR_FUNCTION(acos, some_sine)
  HAMOTOR_FUNCTION(atan, some_number)
  HAMOTOR_FUNCTION(floor, some_exponent)
#undef HAMOTOR_FUNCTION
  measure<T>(
      "atan2", count, sample, some_number<T>, [](const P& y, const P& x) { return atan2(y, x); },
      atan2q);
}

}  // namespace

int main(int count, char** words) {
  if (count != 3) {
    std::fprintf(stderr, "packs measure|sample COUNT\n");
    return 2;
  }
  const bool sample = std::string(words[1]) == "sample";
  measure_all<double>(std::atoi(words[2]), sample);
  measure_all<float>(std::atoi(words[2]), sample);
  return 0;
}
