// Whether a step is symplectic on T*G.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "sample_systems.hpp"

namespace sample {

template <class Method, class System>
auto stepped(const System& system, hamotor::StateOf<System> state, typename System::Scalar h,
             int steps, typename System::Scalar from = 0) {
  using S = typename System::Scalar;
  Method method;
  for (int k = 0; k < steps; ++k) method.do_step(system, state, from + S(k) * h, h);
  return state;
}

/// By how much a step changes the canonical form of T*G, ω = ρ₂(ξ₁) − ρ₁(ξ₂) + μ([ξ₁, ξ₂]) for
/// δM = M ξ and δμ = ρ, its Jacobian by differences of fourth order in long double.
template <class Method, class System>
double symplectic_defect(const System& system, long double h) {
  using Wide = long double;
  using G = typename System::Group;
  using Rate = typename G::template Rate<Wide>;
  using Momentum = typename G::template Momentum<Wide>;
  constexpr auto n = static_cast<std::size_t>(G::dimension);
  struct Tangent {
    Rate xi;
    Momentum rho;
  };
  const auto start = generic_state(system);
  const Wide from = Wide(0.3);
  const auto image = stepped<Method>(system, start, h, 1, from);
  constexpr Wide e = 1e-4L;
  const auto moved = [&](const Tangent& by, Wide factor) {
    auto state = start;
    state.motors[0] = gp(start.motors[0], exp(factor * by.xi));
    state.momenta[0] = start.momenta[0] + factor * by.rho;
    const auto there = stepped<Method>(system, state, h, 1, from);
    return Tangent{G::log(gp(reverse(image.motors[0]), there.motors[0])),
                   there.momenta[0] - image.momenta[0]};
  };
  std::vector<Tangent> before;
  std::vector<Tangent> after;
  for (std::size_t a = 0; a < 2 * n; ++a) {
    std::array<Wide, n> unit{};
    unit[a % n] = 1;
    const Tangent basis{a < n ? Rate::from(unit) : Rate{},
                        a < n ? Momentum{} : Momentum::from(unit)};
    const auto p1 = moved(basis, e);
    const auto m1 = moved(basis, -e);
    const auto p2 = moved(basis, 2 * e);
    const auto m2 = moved(basis, -2 * e);
    before.push_back(basis);
    after.push_back({(1 / (12 * e)) * (Wide(8) * (p1.xi - m1.xi) - (p2.xi - m2.xi)),
                     (1 / (12 * e)) * (Wide(8) * (p1.rho - m1.rho) - (p2.rho - m2.rho))});
  }
  const auto form = [](const Tangent& a, const Tangent& b, const Momentum& mu) {
    return pairing(b.rho, a.xi) - pairing(a.rho, b.xi) + pairing(mu, ad(a.xi, b.xi));
  };
  Wide worst = 0;
  for (std::size_t a = 0; a < 2 * n; ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      worst = std::max(worst, std::abs(form(after[a], after[b], image.momenta[0]) -
                                       form(before[a], before[b], start.momenta[0])));
    }
  }
  return static_cast<double>(worst);
}

}  // namespace sample
