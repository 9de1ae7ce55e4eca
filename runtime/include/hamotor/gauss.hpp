// Gauss collocation on T*G: implicit, symmetric, symplectic, of order 2s with s stages, for any H.
//
// Variational: the discrete Lagrangian of a step is the action of Gauss's quadrature along the
// curve M(τ) = M̂ exp ξ(τ), ξ a polynomial of degree s, extremal among those with the same ends.  M̂
// is half-way between the ends, M₀ exp(X/2) with M₁ = M₀ exp X, ξ = ∓X/2 there, which makes the
// step symmetric.  One stage is the Lie midpoint rule.  (Marsden & West 2001; Bogfjellmo &
// Marthinsen 2016; Hall & Leok 2017.)
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string_view>

#include "hamotor/compensated.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/splitting_schemes.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"

namespace hamotor {

/// Gauss's quadrature on [0, 1], and the part of the collocation matrix that changes sign with the
/// direction of time: a_ij − b_j/2.
template <class S, std::size_t stages>
struct GaussTable {
  std::array<S, stages> nodes;
  std::array<S, stages> weights;
  std::array<std::array<S, stages>, stages> odd;
};

namespace detail {

/// The zeros of Legendre's polynomial on [0, 1], those below ½.
template <std::size_t stages>
[[nodiscard]] constexpr auto gauss_nodes() noexcept {
  static_assert(stages >= 1 && stages <= 4);
  if constexpr (stages == 1) {
    return std::array<std::string_view, 0>{};
  } else if constexpr (stages == 2) {
    return std::array<std::string_view, 1>{"0.2113248654051871177454256097490212721762"};
  } else if constexpr (stages == 3) {
    return std::array<std::string_view, 1>{"0.1127016653792583114820734600217600389167"};
  } else {
    return std::array<std::string_view, 2>{"0.06943184420297371238802675555359524745214",
                                           "0.3300094782075718675986671204483776563997"};
  }
}

/// ∫₀ˣ Π_{k≠j} (y − c_k)/(c_j − c_k) dy.
template <class S, std::size_t n>
[[nodiscard]] constexpr S lagrange_integral(const std::array<S, n>& c, std::size_t j,
                                            const S& x) noexcept {
  std::array<S, n> polynomial{};
  polynomial[0] = S(1);
  for (std::size_t k = 0; k < n; ++k) {
    if (k == j) continue;
    const S by = S(1) / (c[j] - c[k]);
    for (std::size_t d = n; d-- > 0;) {
      polynomial[d] = by * ((d > 0 ? polynomial[d - 1] : S(0)) - c[k] * polynomial[d]);
    }
  }
  S sum(0);
  for (std::size_t d = n; d-- > 0;) sum = sum * x + polynomial[d] / S(d + 1);
  return sum * x;
}

template <class S, std::size_t stages>
[[nodiscard]] constexpr GaussTable<S, stages> gauss_table() noexcept {
  using Wide = CoefficientScalar<S>;
  std::array<Wide, stages> c{};
  c[stages / 2] = Wide(1) / Wide(2);
  constexpr auto lower = gauss_nodes<stages>();
  for (std::size_t k = 0; k < lower.size(); ++k) {
    c[k] = decimal<Wide>(lower[k]);
    c[stages - 1 - k] = Wide(1) - c[k];
  }
  GaussTable<S, stages> table{};
  for (std::size_t j = 0; j < stages; ++j) {
    const Wide weight = lagrange_integral(c, j, Wide(1));
    table.nodes[j] = static_cast<S>(c[j]);
    table.weights[j] = static_cast<S>(weight);
    for (std::size_t i = 0; i < stages; ++i) {
      table.odd[i][j] = static_cast<S>(lagrange_integral(c, j, c[i]) - weight / Wide(2));
    }
  }
  return table;
}

/// Σ (−1)^k/(k+1)! f^k(y), the series of dexp where f is ad_ξ and of its transpose where f is
/// ad*_ξ.
template <class T, class Map>
[[nodiscard]] constexpr T dexp_series(const T& y, const Map& f) noexcept {
  using S = typename T::Scalar;
  T sum = y;
  T term = y;
  for (int k = 1; k < most_series_terms; ++k) {
    term = (S(-1) / S(k + 1)) * f(term);
    sum = sum + term;
    if (!(largest(term) > scalar::Limits<S>::epsilon() / S(8) * largest(sum))) break;
  }
  return sum;
}

/// The body rate dexp_ξ V of M̂ exp ξ with ξ̇ = V.
template <class Rate>
[[nodiscard]] constexpr Rate dexp_of(const Rate& xi, const Rate& v) noexcept {
  return dexp_series(v, [&](const Rate& y) { return ad(xi, y); });
}

/// The transpose of dexp_ξ.
template <class Rate, class Momentum>
[[nodiscard]] constexpr Momentum dexp_transpose(const Rate& xi, const Momentum& mu) noexcept {
  return dexp_series(mu, [&](const Momentum& y) { return coadjoint(xi, y); });
}

/// ∂/∂ξ <μ, dexp_ξ V> = −Σ_k d_k Σ_{j+l=k−1} ad*(ad_ξ^l V) (ad*_ξ)^j μ, d_k = (−1)^k/(k+1)!.
template <class Rate, class Momentum>
[[nodiscard]] constexpr Momentum dexp_gradient(const Rate& xi, const Rate& v,
                                               const Momentum& mu) noexcept {
  using S = typename Rate::Scalar;
  std::array<Rate, most_series_terms> rates{};
  std::array<Momentum, most_series_terms> momenta{};
  rates[0] = v;
  momenta[0] = mu;
  Momentum sum{};
  S factor(-1);
  for (std::size_t k = 1; k < most_series_terms; ++k) {
    // Of rates and momenta in turn, so that each power is bounded by (k + 1)! with its factor.
    factor = factor * (S(-1) / S(k + 1));
    Momentum part{};
    for (std::size_t l = 0; l < k; ++l) part = part + coadjoint(rates[l], momenta[k - 1 - l]);
    const Momentum term = factor * part;
    sum = sum + term;
    if (k > 1 && !(largest(term) > scalar::Limits<S>::epsilon() / S(8) * largest(sum))) break;
    rates[k] = ad(xi, rates[k - 1]);
    momenta[k] = coadjoint(xi, momenta[k - 1]);
  }
  return sum;
}

[[nodiscard]] constexpr std::string_view gauss_name(std::size_t stages) noexcept {
  constexpr std::array<std::string_view, 4> names{"lie_midpoint", "gauss4", "gauss6", "gauss8"};
  return names[stages - 1];
}

}  // namespace detail

/// Gauss collocation on the group, s stages, order 2s, for any H(M, μ, t).
///
/// With chart momenta p = dexp_ξ^T μ and W = −∂H/∂ξ a stage is
///     ξ_i = h Σ ã_ij V_j,  p_i = ½(p₀ + p₁) + h Σ ã_ij W_j,  ã_ij = a_ij − b_j/2,
/// and momenta obey M₁μ₁M̃₁ = M₀μ₀M̃₀ − h Σ b_i F_i, F_i the stages' spatial forques: where H is
/// left-invariant, spatial momentum and Casimirs are constant but for rounding.  Stages are
/// iterated to a fixed point, which contracts while a step turns by less than about a radian; where
/// it does not in 100 iterations, the state becomes not a number.
template <HamiltonianSystem System, std::size_t stages>
class Gauss {
  using S = typename System::Scalar;
  using G = typename System::Group;
  using Element = typename G::template Element<S>;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  static constexpr std::size_t n = System::bodies;
  static inline const auto table = detail::gauss_table<S, stages>();
  static constexpr int most_iterations = 100;

 public:
  static constexpr int order = 2 * static_cast<int>(stages);
  static constexpr std::string_view name = detail::gauss_name(stages);

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    start(system, state, t, h);
    S before(0);
    bool settled = false;
    for (iterations_ = 0; !settled && iterations_ < most_iterations;) {
      const S change = iterate(system, state, t, h);
      ++iterations_;
      // Rounding is reached where changes are small and shrink no more; the first two need not show
      // all components.
      const bool small = change <= S(4096) * scalar::Limits<S>::epsilon();
      settled = iterations_ > 2 && small && (change <= S(0) || !(change < before));
      if (!(change - change == S(0))) break;
      before = change;
    }
    failure_ = settled ? Failure::none : Failure::no_convergence;
    S worst(0);
    for (std::size_t i = 0; i < n; ++i) {
      auto& motor = state.motors[i];
      // By halves as in `iterate`: what the last iteration left does not enter spatial momenta.
      motor = gp(gp(motor, half_[i]), half_[i]);
      const auto defect = unit_defect(motor);
      worst = scalar::max_abs(worst, detail::size(defect));
      motor = motor + unit_correction(motor, defect);
      state.momenta[i] = Ad_star(half_[i], last_[i]);
      if (!settled) {
        state.momenta[i] = S(std::numeric_limits<double>::quiet_NaN()) * state.momenta[i];
      }
    }
    if constexpr (PoweredSystem<System>) {
      for (std::size_t s = 0; s < stages; ++s) {
        work_ = mul_add(h * table.weights[s], power_[s], work_);
      }
    }
    detail::record(drift_, worst);
  }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return drift_; }

  /// Whether the last step's stages settled.
  [[nodiscard]] constexpr Failure failure() const noexcept { return failure_; }

  /// Iterations of the last step, each `stages` evaluations.
  [[nodiscard]] constexpr int iterations() const noexcept { return iterations_; }

  /// ∫ dH/dt dt over the steps so far, J, by the method's own quadrature.
  [[nodiscard]] constexpr const S& work() const noexcept
    requires PoweredSystem<System>
  {
    return work_;
  }

 private:
  /// The first guess: rates and momenta of the start.
  constexpr void start(const System& system, const StateOf<System>& state, const S& t,
                       const S& h) noexcept {
    const auto now = gradient(system, state, t);
    for (std::size_t s = 0; s < stages; ++s) {
      rates_[s] = now.rates;
      momenta_[s] = state.momenta;
    }
    place(h);
  }

  /// Where the rates lead: ξ of the stages and of the end, from half-way.
  constexpr void place(const S& h) noexcept {
    for (std::size_t i = 0; i < n; ++i) {
      Rate x{};
      for (std::size_t s = 0; s < stages; ++s) x = mul_add(table.weights[s], rates_[s][i], x);
      half_way_[i] = (S(0.5) * h) * x;
      half_[i] = exp(half_way_[i]);
      if constexpr (stages > 1) {
        for (std::size_t s = 0; s < stages; ++s) {
          Rate there{};
          for (std::size_t r = 0; r < stages; ++r) {
            there = mul_add(table.odd[s][r], rates_[r][i], there);
          }
          xi_[s][i] = h * there;
          way_[s][i] = exp(xi_[s][i]);
        }
      }
    }
  }

  /// Rates from the gradient, then momenta with the new rates; by how much they changed, relative
  /// to Σ |μ V|.
  constexpr S iterate(const System& system, const StateOf<System>& state, const S& t,
                      const S& h) noexcept {
    S changed(0);
    S size(0);
    std::array<std::array<Momentum, n>, stages> forques{};
    std::array<std::array<Rate, n>, stages> rates = rates_;
    std::array<std::array<Rate, n>, stages> rate_changes{};
    S both(0);
    for (std::size_t s = 0; s < stages; ++s) {
      StateOf<System> there{{}, momenta_[s]};
      for (std::size_t i = 0; i < n; ++i) {
        there.motors[i] = gp(state.motors[i], half_[i]);
        if constexpr (stages > 1) there.motors[i] = gp(there.motors[i], way_[s][i]);
      }
      const S then = mul_add(table.nodes[s], h, t);
      const auto now = gradient(system, there, then);
      if constexpr (PoweredSystem<System>) power_[s] = system.power(there, then);
      if constexpr (System::has_forque) forques[s] = now.forques;
      for (std::size_t i = 0; i < n; ++i) {
        const Rate change = now.rates[i] - body_rate(s, i);
        rates[s][i] = rates_[s][i] + change;
        rate_changes[s][i] = change;
        add_sizes(change, momenta_[s][i], changed);
        add_sizes(rates[s][i], momenta_[s][i], size);
      }
    }
    rates_ = rates;
    place(h);
    for (std::size_t i = 0; i < n; ++i) {
      const Momentum first = Ad_star(half_[i], state.momenta[i]);
      last_[i] = first;
      std::array<Momentum, stages> w{};
      for (std::size_t s = 0; s < stages; ++s) {
        if constexpr (stages > 1) {
          w[s] = detail::dexp_gradient(xi_[s][i], rates_[s][i], momenta_[s][i]);
        }
        if constexpr (System::has_forque) {
          Momentum force = forques[s][i];
          if constexpr (stages > 1) {
            w[s] = w[s] - detail::dexp_transpose(xi_[s][i], force);
            force = Ad_star_inverse(way_[s][i], force);
          }
          last_[i] = mul_add(-h * table.weights[s], force, last_[i]);
        }
      }
      const Momentum ends = S(0.5) * (detail::dexp_transpose(half_way_[i], first) +
                                      detail::dexp_transpose(S(-1) * half_way_[i], last_[i]));
      for (std::size_t s = 0; s < stages; ++s) {
        Momentum p = ends;
        if constexpr (stages > 1) {
          for (std::size_t r = 0; r < stages; ++r) p = mul_add(h * table.odd[s][r], w[r], p);
          p = p - detail::dexp_transpose(xi_[s][i], momenta_[s][i]);
        } else {
          p = p - momenta_[s][i];
        }
        momenta_[s][i] = momenta_[s][i] + p;
        add_sizes(rates_[s][i], p, changed);
        add_sizes(rate_changes[s][i], p, both);
      }
    }
    // The root sees a small component beside a large one, as a spin, to first order.
    return select(size > S(0), changed / size + scalar::sqrt(both / size), changed + both);
  }

  /// The rate of body i at stage s.
  [[nodiscard]] constexpr Rate body_rate(std::size_t s, std::size_t i) const noexcept {
    if constexpr (stages > 1) {
      return detail::dexp_of(xi_[s][i], rates_[s][i]);
    } else {
      return rates_[s][i];
    }
  }

  /// Adds Σ |V_k μ_k|.
  static constexpr void add_sizes(const Rate& v, const Momentum& mu, S& sum) noexcept {
    const auto x = v.components();
    const auto y = mu.components();
    for (std::size_t k = 0; k < x.size(); ++k) sum = sum + scalar::abs(x[k] * y[k]);
  }

  std::array<std::array<Rate, n>, stages> rates_{};        ///< V: ξ̇ at the stages
  std::array<std::array<Momentum, n>, stages> momenta_{};  ///< μ at the stages
  std::array<std::array<Rate, n>, stages> xi_{};
  std::array<std::array<Element, n>, stages> way_{};  ///< exp ξ
  std::array<Rate, n> half_way_{};                    ///< X/2
  std::array<Element, n> half_{};                     ///< exp(X/2)
  std::array<Momentum, n> last_{};                    ///< μ₁, seen from half-way
  std::array<S, stages> power_{};
  Drift<S> drift_;
  S work_{};
  Failure failure_ = Failure::none;
  int iterations_ = 0;
};

/// The midpoint rule on the group, order 2: M₁ = M₀ exp(h B), B and F half-way.
template <HamiltonianSystem System>
using LieMidpoint = Gauss<System, 1>;
template <HamiltonianSystem System>
using Gauss4 = Gauss<System, 2>;
template <HamiltonianSystem System>
using Gauss6 = Gauss<System, 3>;
template <HamiltonianSystem System>
using Gauss8 = Gauss<System, 4>;

}  // namespace hamotor
