// Whether a step is symplectic on T*G: its Jacobian by dual numbers.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <vector>

#include "dual.hpp"
#include "sample_systems.hpp"

namespace sample {

namespace detail {

template <template <class> class T>
T<Dual> with_slope(const T<double>& value, const T<double>& slope) {
  constexpr std::size_t n = T<double>::names.size();
  std::array<Dual, n> both{};
  for (std::size_t k = 0; k < n; ++k) both[k] = {value.components()[k], slope.components()[k]};
  return T<Dual>::from(both);
}

template <template <class> class T>
T<double> part_of(const T<Dual>& x, double Dual::* part) {
  constexpr std::size_t n = T<double>::names.size();
  std::array<double, n> components{};
  for (std::size_t k = 0; k < n; ++k) components[k] = x.components()[k].*part;
  return T<double>::from(components);
}

}  // namespace detail

template <class Method, class System>
auto stepped(const System& system, hamotor::StateOf<System> state, typename System::Scalar h,
             int steps, typename System::Scalar from = 0) {
  using S = typename System::Scalar;
  Method method;
  for (int k = 0; k < steps; ++k) method.do_step(system, state, from + S(k) * h, h);
  return state;
}

/// By how much a step of a system in dual numbers changes the canonical form of T*G,
/// ω = ρ₂(ξ₁) − ρ₁(ξ₂) + μ([ξ₁, ξ₂]) for δM = M ξ and δμ = ρ.
template <class Method, class System>
double symplectic_defect(const System& system, double h) {
  static_assert(std::is_same_v<typename System::Scalar, Dual>);
  using G = typename System::Group;
  using Rate = typename G::template Rate<double>;
  using Momentum = typename G::template Momentum<double>;
  constexpr auto n = static_cast<std::size_t>(G::dimension);
  struct Tangent {
    Rate xi;
    Momentum rho;
  };
  const auto unit = [](std::size_t a) {
    std::array<double, n> x{};
    if (a < n) x[a] = 1;
    return x;
  };
  const auto start = generic_state(system);
  const auto motor = detail::part_of(start.motors[0], &Dual::value);
  std::vector<Tangent> before;
  std::vector<Tangent> after;
  Momentum image{};
  for (std::size_t a = 0; a < 2 * n; ++a) {
    const Tangent basis{Rate::from(unit(a)), Momentum::from(unit(a - n))};
    auto state = start;
    state.motors[0] = detail::with_slope(motor, kinematics(motor, basis.xi));
    state.momenta[0] =
        detail::with_slope(detail::part_of(start.momenta[0], &Dual::value), basis.rho);
    state = stepped<Method>(system, state, Dual(h), 1, Dual(0.3));
    image = detail::part_of(state.momenta[0], &Dual::value);
    const auto moved = gp(reverse(detail::part_of(state.motors[0], &Dual::value)),
                          detail::part_of(state.motors[0], &Dual::slope))
                           .components();
    // M~ δM in the generators, each of which has its own blades.
    std::array<double, n> xi{};
    for (std::size_t k = 0; k < n; ++k) {
      const auto generator = kinematics(exp(Rate{}), Rate::from(unit(k))).components();
      double square = 0;
      for (std::size_t c = 0; c < moved.size(); ++c) {
        xi[k] += generator[c] * moved[c];
        square += generator[c] * generator[c];
      }
      xi[k] /= square;
    }
    before.push_back(basis);
    after.push_back({Rate::from(xi), detail::part_of(state.momenta[0], &Dual::slope)});
  }
  const auto form = [](const Tangent& a, const Tangent& b, const Momentum& mu) {
    return pairing(b.rho, a.xi) - pairing(a.rho, b.xi) + pairing(mu, ad(a.xi, b.xi));
  };
  const auto at = detail::part_of(start.momenta[0], &Dual::value);
  double worst = 0;
  for (std::size_t a = 0; a < 2 * n; ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      worst = std::max(worst,
                       std::abs(form(after[a], after[b], image) - form(before[a], before[b], at)));
    }
  }
  return worst;
}

}  // namespace sample
