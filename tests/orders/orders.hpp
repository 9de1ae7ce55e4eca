// Prints the observed order of a method: the system, the method, its nominal order, the observed
// one, and the error it is from.
#pragma once

#include <cmath>
#include <cstdio>
#include <string>

#include "../runtime/sample_systems.hpp"
#include "hamotor/adaptive.hpp"
#include "hamotor/gauss.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/steppers.hpp"

namespace orders {

using Wide = hamotor::scalar::Quad;

template <class Method, class System>
auto after(const System& system, double length, int steps) {
  using S = typename System::Scalar;
  auto state = sample::generic_state(system);
  Method method;
  const S h = S(length) / S(steps);
  for (int k = 0; k < steps; ++k) method.do_step(system, state, S(k) * h, h);
  return state;
}

template <class State>
bool is_finite(const State& state) {
  for (const auto& momentum : state.momenta) {
    for (const auto& x : momentum.components()) {
      if (!std::isfinite(static_cast<double>(x))) return false;
    }
  }
  return true;
}

/// What errors must be well above.
template <class S>
inline constexpr double rounding = hamotor::scalar::Limits<S>::digits > 113 ? 1e-40 : 1e-31;

/// The order settles as steps become shorter; the last one is from errors well above rounding.
/// 0 where the very first error is rounding.
template <class Method, class System>
void print_order(const char* name, const System& system, double length,
                 const hamotor::StateOf<System>& reference) {
  double error = 0;
  double order = 0;
  for (int steps = 2; steps <= 2048; steps *= 2) {
    const auto state = after<Method>(system, length, steps);
    if (!is_finite(state)) continue;  // steps too long for an implicit method
    const double found = sample::distance(state, reference);
    if (found < rounding<typename System::Scalar>) break;
    const double last = order;
    if (error > 0) order = std::log2(error / found);
    error = found;
    if (last > 0 && error < 1e-3 && std::abs(order - last) < 0.01) break;
  }
  std::printf("%s %s %d %.3f %.1e\n", name, std::string(Method::name).c_str(), Method::order, order,
              error);
}

template <template <class> class... Methods>
struct List {
  template <class System>
  static void print(const char* name, const System& system, double length,
                    const hamotor::StateOf<System>& reference) {
    (print_order<Methods<System>>(name, system, length, reference), ...);
  }
};

template <class System>
using Rkmk4 = hamotor::Rkmk4<System>;
template <class System>
using CommutatorFree4 = hamotor::CommutatorFree4<System>;
template <class System>
using Rk4 = hamotor::Rk4<System>;
template <class System>
using Splitting2 = hamotor::Splitting<System, 2>;
template <class System>
using Splitting4 = hamotor::Splitting<System, 4>;
template <class System>
using Splitting6 = hamotor::Splitting<System, 6>;
template <class System>
using Splitting8 = hamotor::Splitting<System, 8>;
template <class System>
using Splitting10 = hamotor::Splitting<System, 10>;

using Splittings = List<Splitting2, Splitting4, Splitting6, Splitting8, Splitting10>;
using Explicit = List<Rkmk4, CommutatorFree4, Rk4, hamotor::Rkmk54, hamotor::Rkmk87, hamotor::Rk54,
                      hamotor::Rk87>;
using Implicit =
    List<hamotor::LieMidpoint, hamotor::Gauss4, hamotor::Gauss6, hamotor::Gauss8, hamotor::Gauss12>;

}  // namespace orders
