// Prints the observed order of methods on one group, free and forced: name, nominal, observed.
// HEADER and GROUP name the group; LENGTH is the time, long enough for errors above rounding.
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <type_traits>

#include "../runtime/group_system.hpp"
#include "../runtime/sample_systems.hpp"
#include "hamotor/adaptive.hpp"
#include "hamotor/gauss.hpp"
#include HEADER

namespace {

using Wide = long double;

template <class Method, class System>
auto after(const System& system, int steps) {
  auto state = sample::generic_state(system);
  Method method;
  for (int k = 0; k < steps; ++k) {
    method.do_step(system, state, 0, Wide(LENGTH) / static_cast<Wide>(steps));
  }
  return state;
}

/// From the shortest steps whose error is well above rounding.
template <class Method, class System>
void print_order(const System& system, const hamotor::StateOf<System>& reference) {
  double before = 0;
  double order = 0;
  for (int steps = 2; steps <= 1024; steps *= 2) {
    const double error = sample::distance(after<Method>(system, steps), reference);
    if (error < 3e-17) break;
    order = std::log2(before / error);
    before = error;
  }
  std::printf("%s %d %.4f\n", std::string(Method::name).c_str(), Method::order, order);
}

template <class System>
void print_orders() {
  const System system;
  const auto reference = after<hamotor::Gauss16<System>>(system, 160);
  print_order<hamotor::Rkmk4<System>>(system, reference);
  print_order<hamotor::CommutatorFree4<System>>(system, reference);
  print_order<hamotor::Rkmk54<System>>(system, reference);
  print_order<hamotor::Rkmk87<System>>(system, reference);
  print_order<hamotor::LieMidpoint<System>>(system, reference);
  print_order<hamotor::Gauss4<System>>(system, reference);
  print_order<hamotor::Gauss6<System>>(system, reference);
  print_order<hamotor::Gauss8<System>>(system, reference);
}

}  // namespace

int main() {
  print_orders<sample::GroupSystem<GROUP, Wide, false>>();
  print_orders<sample::GroupSystem<GROUP, Wide, true>>();
}
