// How far dexp and dexp_inverse are from the truth, over rates of every kind.
//
//   jacobian measure COUNT GROUP...   one JSON object a line: group, function, scalar, max, nan
//   jacobian sample COUNT GROUP...    group, function, both arguments and the reference, in full
//
// The truth is doubling (and elimination) in __float128, which shares nothing with the closed forms
// but exp, Ad and ad; jacobian.py holds it against power series with many digits.  An error is
// divided by what a change of every argument by one part leaves in the result, rotation and
// translation rates apart.
#include "hamotor/rate_jacobian.hpp"

#include <quadmath.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>

#include "hamotor/cga2/cga2.hpp"
#include "hamotor/cga3/cga3.hpp"
#include "hamotor/cl3/cl3.hpp"
#include "hamotor/pga2/pga2.hpp"
#include "hamotor/pga3/pga3.hpp"
#include "hamotor/pga4/pga4.hpp"
#include "hamotor/sta/sta.hpp"
#include "random.hpp"

namespace {

__extension__ using Quad = __float128;

using reference::Random;

constexpr double pi = 3.141592653589793;

// Angles that have gone wrong somewhere, or might.
double some_angle(Random& random, double largest) {
  const double chosen = [&] {
    switch (random.below(14)) {
      case 0:
        return 0.0;
      case 1:
        return 5e-324 * static_cast<double>(1 + random.below(100));
      case 2:
        return random.power_of_ten(-170, -140);
      case 3:
        return 1e-8 * (1 + random.uniform());
      case 4:
        return 1e-4 * (1 + random.uniform());
      case 5:
        return random.power_of_ten(-17, 0);
      case 6:
        return 2 * pi - random.power_of_ten(-12, 0);
      case 7:
        return 2 * pi * (1 + random.power_of_ten(-12, 0));
      case 8:
        return 4 * (1 + 1e-10 * random.symmetric());  // where series and formulas meet
      case 9:
        return pi * (1 + 1e-15 * random.symmetric());
      case 10:
        return random.power_of_ten(0, 6);
      default:
        return 2 * pi * random.uniform();
    }
  }();
  return std::min(chosen, largest);
}

double some_length(Random& random) {
  switch (random.below(8)) {
    case 0:
      return 0.0;
    case 1:
      return random.power_of_ten(-100, 100);
    default:
      return random.power_of_ten(-4, 4);
  }
}

// `turns`: rates that rotate; the others move, or boost where there is nothing else.
template <class Rate>
bool turns(std::size_t i) {
  return Rate::names[i][0] == 'w';
}

template <class Rate>
void fill(Random& random, std::array<double, Rate::size>& x, double angle, double length) {
  double largest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = random.below(5) == 0 ? 0.0 : random.symmetric();
    if (turns<Rate>(i)) largest += x[i] * x[i];
  }
  const double size = largest > 0 ? std::sqrt(largest) : 1;
  for (std::size_t i = 0; i < x.size(); ++i) x[i] *= turns<Rate>(i) ? angle / size : length;
}

template <class Wide, class Rate>
Wide widened(const Rate& x) {
  return x.template cast<Quad>();
}

// In units of the largest component, whose square may be out of range.
template <class Rate>
Quad length_of(const Rate& x, bool turning) {
  const auto components = x.components();
  Quad largest = 0;
  for (std::size_t i = 0; i < Rate::size; ++i) {
    if (turns<Rate>(i) != turning) continue;
    const Quad size = fabsq(components[i]);
    if (!(size <= largest)) largest = size;
  }
  if (!(largest > 0) || isinfq(largest)) return largest;
  Quad sum = 0;
  for (std::size_t i = 0; i < Rate::size; ++i) {
    const Quad part = static_cast<Quad>(components[i]) / largest;
    if (turns<Rate>(i) == turning) sum += part * part;
  }
  return largest * sqrtq(sum);
}

template <class Rate>
Quad bound_of(const Rate& x) {
  Quad sum = 0;
  for (const Quad c : x.components()) sum += fabsq(c);
  return sum;
}

struct Dexp {
  static constexpr const char* name = "dexp";
  template <class Rate>
  static Rate kernel(const Rate& x, const Rate& y) {
    return dexp(x, y);
  }
  template <class Rate>
  static Rate reference(const Rate& x, const Rate& y) {
    return hamotor::scalar::dexp_by_doubling(x, y, bound_of(x));
  }
};

struct DexpInverse {
  static constexpr const char* name = "dexp_inverse";
  template <class Rate>
  static Rate kernel(const Rate& x, const Rate& y) {
    return dexp_inverse(x, y);
  }
  template <class Rate>
  static Rate reference(const Rate& x, const Rate& y) {
    return hamotor::scalar::dexp_inverse_by_elimination(x, y, bound_of(x));
  }
};

// Σ |x_i| |∂f/∂x_i| + Σ |y_i| |∂f/∂y_i|, of the rotating and of the other components.
template <class Function, class Rate>
std::array<Quad, 2> sensitivity(const Rate& x, const Rate& y) {
  std::array<Quad, 2> total{};
  const auto from = x.components();
  const auto onto = y.components();
  for (std::size_t i = 0; i < Rate::size; ++i) {
    const long double step = 0x1p-46L;
    auto more = from;
    auto less = from;
    more[i] *= 1 + step;
    less[i] *= 1 - step;
    std::array<long double, Rate::size> one{};
    one[i] = onto[i];
    const Rate change = (1 / (2 * step)) * (Function::kernel(Rate::from(more), y) -
                                            Function::kernel(Rate::from(less), y));
    const Rate share = Function::kernel(x, Rate::from(one));
    for (const bool turning : {false, true}) {
      total[turning] += length_of(change, turning) + length_of(share, turning);
    }
  }
  return total;
}

template <class Function, class Group>
void go(const char* group, bool measure, std::size_t count, double angle_limit,
        double length_limit) {
  using Rate = typename Group::template Rate<double>;
  using Wide = typename Group::template Rate<Quad>;
  Random random{20240229};
  double worst = 0;
  std::size_t nan = 0;
  std::size_t points = 0;
  while (points < count) {
    std::array<double, Rate::size> a{};
    std::array<double, Rate::size> b{};
    const double limit = measure ? angle_limit : std::min(angle_limit, 20.0);
    const double length = measure ? length_limit : std::min(length_limit, 20.0);
    fill<Rate>(random, a, some_angle(random, limit), std::min(some_length(random), length));
    fill<Rate>(random, b, some_length(random), some_length(random));
    if (std::all_of(b.begin(), b.end(), [](double x) { return x == 0; })) continue;
    ++points;
    const Rate x = Rate::from(a);
    const Rate y = Rate::from(b);
    const Wide wide_x = widened<Wide>(x);
    const Wide wide_y = widened<Wide>(y);
    const Wide truth = Function::reference(wide_x, wide_y);
    if (!measure) {
      std::printf("{\"group\": \"%s\", \"function\": \"%s\"", group, Function::name);
      for (const auto& [key, value] : {std::pair{"a", wide_x}, {"b", wide_y}, {"found", truth}}) {
        std::printf(", \"%s\": [", key);
        const char* comma = "";
        for (const Quad c : value.components()) {
          char text[64];
          quadmath_snprintf(text, sizeof text, "%.40Qg", c);
          std::printf("%s\"%s\"", comma, text);
          comma = ", ";
        }
        std::printf("]");
      }
      std::printf("}\n");
      continue;
    }
    const Wide found = widened<Wide>(Function::kernel(x, y));
    const Wide error = found - truth;
    const auto scale =
        sensitivity<Function>(x.template cast<long double>(), y.template cast<long double>());
    for (const bool turning : {false, true}) {
      const Quad size = length_of(error, turning);
      // What is exactly 0 by symmetry the truth has only to its own last place.
      const Quad around = (1 + length_of(wide_x, true) + (turning ? 0 : length_of(wide_x, false))) *
                          (length_of(wide_y, true) + (turning ? 0 : length_of(wide_y, false)));
      const Quad part = scale[turning] * std::numeric_limits<double>::epsilon() + around * 1e-33Q +
                        static_cast<Quad>(std::numeric_limits<double>::min());
      const auto ulp = static_cast<double>(size / part);
      if (std::isnan(ulp)) {
        ++nan;
      } else if (ulp > worst) {
        worst = ulp;
        if (std::getenv("VERBOSE") != nullptr) {
          std::printf("%s %s %g ulp, turning %d:", group, Function::name, ulp, turning);
          for (const double c : a) std::printf(" %a", c);
          std::printf(" |");
          for (const double c : b) std::printf(" %a", c);
          std::printf("\n");
        }
      }
    }
  }
  if (measure) {
    std::printf(
        "{\"group\": \"%s\", \"function\": \"%s\", \"points\": %zu, \"max_ulp\": %.3f, \"nan\": "
        "%zu}\n",
        group, Function::name, points, worst, nan);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const bool measure = argc > 1 && std::strcmp(argv[1], "measure") == 0;
  const auto count = static_cast<std::size_t>(argc > 2 ? std::atoi(argv[2]) : 100);
  const auto wanted = [&](const char* name) {
    return argc < 4 ||
           std::any_of(
               argv + 3, argv + argc, [&](const char* x) { return std::strcmp(x, name) == 0; });
  };
#define GROUP(algebra, name, angle, length)                                                      \
  if (wanted(#algebra "::" #name)) {                                                             \
    go<Dexp, hamotor::algebra::name>(#algebra "::" #name, measure, count, angle, length);        \
    go<DexpInverse, hamotor::algebra::name>(#algebra "::" #name, measure, count, angle, length); \
  }
  GROUP(pga3, SE3, 1e6, 1e100)
  GROUP(pga3, SO3, 1e6, 1e100)
  GROUP(pga2, SE2, 1e6, 1e100)
  GROUP(cga3, SE3, 1e6, 1e100)
  GROUP(cga2, SE2, 1e6, 1e100)
  GROUP(cl3, SO3, 1e6, 1e100)
  GROUP(pga3, T3, 1e6, 1e100)
  GROUP(pga2, T2, 1e6, 1e100)
  GROUP(pga4, SO4, 1e3, 1e100)
  GROUP(pga4, SE4, 1e3, 1e4)
  GROUP(cga2, Sim2, 1e3, 10)
  GROUP(cga2, SO31, 1e3, 10)
  GROUP(cga3, Sim3, 1e3, 10)
  GROUP(cga3, SO41, 1e3, 10)
  GROUP(sta, SO13, 1e3, 10)
}
