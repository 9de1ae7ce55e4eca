// A Hamiltonian system on any group: for tests that are to hold on all of them.
#pragma once

#include <array>
#include <cstddef>

#include "hamotor/state.hpp"

namespace sample {

/// H = ½ Σ μ_a²/I_a + ¼ μ_1 μ_n + Σ c_A M_A: no symmetry but the group's, and none with forques;
/// split in parts that the generator knows nothing of.
template <class G, class S, bool forced = true>
struct GroupSystem {
  using Group = G;
  using Scalar = S;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  using State = hamotor::State<G, 1, S>;
  static constexpr std::size_t bodies = 1;
  static constexpr bool has_forque = forced;

  [[nodiscard]] std::array<Rate, 1> rate(const State& state) const noexcept {
    auto w = state.momenta[0].components();
    const S first = w.front();
    const S last = w.back();
    for (std::size_t a = 0; a < w.size(); ++a) w[a] = w[a] / inertia(a);
    w.front() = w.front() + S(0.25) * last;
    w.back() = w.back() + S(0.25) * first;
    return {Rate::from(w)};
  }

  /// Σ c_A (M E_a)_A, the derivative of the potential along M exp(ε E_a).
  [[nodiscard]] std::array<Momentum, 1> forque(const decltype(State::motors)& motors) const noexcept
    requires(forced)
  {
    std::array<S, static_cast<std::size_t>(G::dimension)> f{};
    for (std::size_t a = 0; a < f.size(); ++a) {
      std::array<S, static_cast<std::size_t>(G::dimension)> unit{};
      unit[a] = S(1);
      f[a] = weighted(kinematics(motors[0], Rate::from(unit)));
    }
    return {Momentum::from(f)};
  }

  /// By Strang's splitting of T into ½ a_k (μ(ℓ_k))², along whose flow μ(ℓ_k) is constant.
  [[nodiscard]] hamotor::ChangeOf<GroupSystem> free_change(const decltype(State::motors)& motors,
                                                           const decltype(State::momenta)& momenta,
                                                           const S& h) const noexcept {
    auto motor = motors[0];
    auto momentum = momenta[0];
    constexpr auto n = static_cast<std::size_t>(G::dimension);
    const auto flow = [&](std::size_t k) {
      std::array<S, n> direction{};
      S factor = S(0.25);
      if (k < n) {
        direction[k] = S(1);
        factor = S(1) / inertia(k) - (k == 0 || k + 1 == n ? factor : S(0));
      } else {
        direction.front() = direction.back() = S(1);
      }
      const Rate along = Rate::from(direction);
      const auto turn = exp(S(0.5) * h * factor * pairing(momentum, along) * along);
      motor = gp(motor, turn);
      momentum = Ad_star(turn, momentum);
    };
    for (std::size_t k = 0; k <= n; ++k) flow(k);
    for (std::size_t k = n + 1; k-- > 0;) flow(k);
    return {{motor - motors[0]}, {momentum - momenta[0]}};
  }

  [[nodiscard]] S energy(const State& state) const noexcept {
    const S kinetic = S(0.5) * pairing(state.momenta[0], rate(state)[0]);
    return forced ? kinetic + weighted(state.motors[0]) : kinetic;
  }

 private:
  [[nodiscard]] static S inertia(std::size_t a) noexcept {
    return S(1) + S(0.3) * S(static_cast<int>(a * a % 7));
  }

  template <class Element>
  [[nodiscard]] static S weighted(const Element& m) noexcept {
    S sum(0);
    int k = 0;
    for (const S& x : m.components()) sum = sum + (S(0.4) - S(0.15) * S(k++ % 5)) * x;
    return sum;
  }
};

}  // namespace sample
