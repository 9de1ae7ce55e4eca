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
#include <type_traits>

#include "hamotor/compensated.hpp"
#include "hamotor/gauss_table.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/stage_equations.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"

namespace hamotor {

namespace detail {

/// B_k/k! for even k (Bernoulli), of which each is about −1/4π² times the one before.
template <class S>
[[nodiscard]] constexpr std::array<S, 32> bernoulli_ratios() noexcept {
  // Σ_{j≤n} c_j/(n + 1 − j)! = 0 for c_j = B_j/j!, n ≥ 1.
  std::array<S, 65> c{};
  std::array<S, 66> inverse_factorial{};
  inverse_factorial[0] = S(1);
  for (std::size_t k = 1; k < 66; ++k) {
    inverse_factorial[k] = inverse_factorial[k - 1] / S(static_cast<int>(k));
  }
  c[0] = S(1);
  for (std::size_t k = 1; k < 65; ++k) {
    S sum(0);
    for (std::size_t j = 0; j < k; ++j) sum = sum + c[j] * inverse_factorial[k + 1 - j];
    c[k] = -sum;
  }
  std::array<S, 32> even{};
  for (std::size_t k = 0; k < 32; ++k) even[k] = c[2 * k + 2];
  return even;
}

/// B_k/k! for k = 2, 4, …, rounded to S once.
template <class S>
struct BernoulliRatios {
  static inline const auto values = [] {
    std::array<S, 32> rounded{};
    const auto exact = bernoulli_ratios<CoefficientScalar<S>>();
    for (std::size_t k = 0; k < rounded.size(); ++k) rounded[k] = static_cast<S>(exact[k]);
    return rounded;
  }();
};

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
    if (negligible(term, sum)) break;
  }
  return sum;
}

/// Σ (−1)^k B_k/k! f^k(y), the inverse of `dexp_series`.
template <class T, class Map>
[[nodiscard]] constexpr T dexp_series_inverse(const T& y, const Map& f) noexcept {
  using S = typename T::Scalar;
  const auto& ratios = BernoulliRatios<S>::values;
  T power = f(y);
  T sum = mul_add(S(0.5), power, y);
  for (std::size_t k = 0; k < ratios.size(); ++k) {
    if (k > 0) power = f(power);
    power = f(power);
    const T term = ratios[k] * power;
    sum = sum + term;
    if (negligible(term, sum)) break;
  }
  return sum;
}

/// The rate ξ̇ of M̂ exp ξ with body rate B: dexp_ξ⁻¹ B.
template <class Rate>
[[nodiscard]] constexpr Rate chart_rate(const Rate& xi, const Rate& b) noexcept {
  return dexp_series_inverse(b, [&](const Rate& y) { return ad(xi, y); });
}

/// The momentum p of the chart, dexp_ξ^T μ.
template <class Rate, class Momentum>
[[nodiscard]] constexpr Momentum chart_momentum(const Rate& xi, const Momentum& mu) noexcept {
  return dexp_series(mu, [&](const Momentum& y) { return coadjoint(xi, y); });
}

/// The momentum μ of the body, dexp_ξ^−T p.
template <class Rate, class Momentum>
[[nodiscard]] constexpr Momentum body_momentum(const Rate& xi, const Momentum& p) noexcept {
  return dexp_series_inverse(p, [&](const Momentum& y) { return coadjoint(xi, y); });
}

/// ṗ = d/dt dexp_ξ^T μ at ξ̇ = V and μ̇, which is −∂H/∂ξ at constant p where μ̇ = [μ, B] − F.
template <class Rate, class Momentum>
[[nodiscard]] constexpr Momentum chart_force(const Rate& xi, const Rate& v, const Momentum& mu,
                                             const Momentum& mu_rate) noexcept {
  using S = typename Rate::Scalar;
  Momentum term = mu;
  Momentum change = mu_rate;
  Momentum sum = mu_rate;
  for (int k = 1; k < most_series_terms; ++k) {
    const S by = S(-1) / S(k + 1);
    change = by * (coadjoint(v, term) + coadjoint(xi, change));
    term = by * coadjoint(xi, term);
    sum = sum + change;
    if (negligible(change, sum) && k > 1) break;
  }
  return sum;
}

[[nodiscard]] constexpr std::string_view gauss_name(std::size_t stages) noexcept {
  constexpr std::array<std::string_view, 8> names{"lie_midpoint", "gauss4",  "gauss6",  "gauss8",
                                                  "gauss10",      "gauss12", "gauss14", "gauss16"};
  return names[stages - 1];
}

}  // namespace detail

/// Gauss collocation on the group, s = 1 to 8 stages, order 2s, for any H(M, μ, t).
///
/// With chart momenta p = dexp_ξ^T μ and W = −∂H/∂ξ a stage is
///     ξ_i = h Σ ã_ij V_j,  p_i = ½(p₀ + p₁) + h Σ ã_ij W_j,  ã_ij = a_ij − b_j/2,
/// and momenta obey M₁μ₁M̃₁ = M₀μ₀M̃₀ − h Σ b_i F_i, F_i the stages' spatial forques: where H is
/// left-invariant, spatial momentum and Casimirs are constant but for rounding.
///
/// V and W are iterated until rounding stops them (Hairer, McLachlan & Razakarivony 2008), from the
/// last step's polynomials: to a fixed point while that contracts, else by Newton's method with one
/// Jacobian for many steps, so that stiff springs converge too (up to 48 unknowns a stage: four
/// bodies in space).  Where neither settles in 20 iterations and one a bit, the state becomes not a
/// number.
template <HamiltonianSystem System, std::size_t stages>
class Gauss {
  static_assert(stages >= 1 && stages <= 8);
  using S = typename System::Scalar;
  using G = typename System::Group;
  using Element = typename G::template Element<S>;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  static constexpr std::size_t n = System::bodies;
  static constexpr auto dimension = static_cast<std::size_t>(G::dimension);
  static constexpr std::size_t unknowns = 2 * n * dimension;
  static constexpr bool has_newton = unknowns <= 48;
  static constexpr int most_iterations = 20 + scalar::Limits<S>::digits;
  static inline const auto table = detail::gauss_table<S, stages>();

 public:
  static constexpr int order = 2 * static_cast<int>(stages);
  static constexpr std::string_view name = detail::gauss_name(stages);

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    if (foresees_ && failure_ == Failure::none && h == h_ && state == end_) {
      foresee();
    } else {
      stay(system, state, t);
    }
    h_ = h;
    for (std::size_t s = 0; s < stages; ++s) step_weights_[s] = h * table.weights[s];
    begin(state);
    failure_ = solve(system, state, t) ? Failure::none : Failure::no_convergence;
    finish(state);
  }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return drift_; }

  /// Whether the last step's stages settled.
  [[nodiscard]] constexpr Failure failure() const noexcept { return failure_; }

  /// Iterations of the last step, each `stages` evaluations.
  [[nodiscard]] constexpr int iterations() const noexcept { return iterations_; }

  /// Whether the last step was solved by Newton's method.
  [[nodiscard]] constexpr bool by_newton() const noexcept { return newton_.on; }

  /// ∫ dH/dt dt over the steps so far, J, by the method's own quadrature.
  [[nodiscard]] constexpr const S& work() const noexcept
    requires PoweredSystem<System>
  {
    return work_;
  }

 private:
  using Gradients = Gradient<G, n, S>;
  using Slopes = std::array<Gradients, stages>;
  using Momenta = std::array<Momentum, n>;
  using Vector = detail::Vector<S, unknowns>;
  struct NoNewton {
    static constexpr bool on = false;
  };
  struct Newton {
    bool on = false;
    S h{};
    detail::StageEquations<S, stages, unknowns> equations{};
  };

  /// The first guess where nothing is known: what is at the start.
  constexpr void stay(const System& system, const StateOf<System>& state, const S& t) noexcept {
    const auto now = gradient(system, state, t);
    for (std::size_t s = 0; s < stages; ++s) {
      gradients_[s].rates = now.rates;
      if constexpr (System::has_forque) gradients_[s].forques = now.forques;
    }
  }

  /// The first guess after a step of the same length: its polynomials, gone on.
  constexpr void foresee() noexcept {
    const auto gradients = gradients_;
    for (std::size_t s = 0; s < stages; ++s) {
      gradients_[s] = {};
      for (std::size_t r = 0; r < stages; ++r) {
        const S& by = table.next[s][r];
        for (std::size_t i = 0; i < n; ++i) {
          auto& there = gradients_[s];
          there.rates[i] = mul_add(by, gradients[r].rates[i], there.rates[i]);
          if constexpr (System::has_forque) {
            there.forques[i] = mul_add(by, gradients[r].forques[i], there.forques[i]);
          }
        }
      }
    }
  }

  /// From the first guess.
  constexpr void begin(const StateOf<System>& state) noexcept {
    xi_ = {};
    beside_ = {};
    place(state);
  }

  /// The charts and the momenta that rates and forques of the stages lead to.
  ///
  /// Momenta are seen from half-way, m = Ad*⁻¹_{exp ξ} μ with ṁ = −Ad*⁻¹_{exp ξ} F, so that they do
  /// not turn with the stages while these are iterated: p = dexp_{−ξ}^T m.
  constexpr void place(const StateOf<System>& state) noexcept {
    for (int sweep = 0; sweep < 2; ++sweep) {
      for (std::size_t s = 0; s < stages; ++s) {
        for (std::size_t i = 0; i < n; ++i) {
          rates_[s][i] = detail::chart_rate(xi_[s][i], gradients_[s].rates[i]);
        }
      }
      for (std::size_t s = 0; s < stages; ++s) {
        for (std::size_t i = 0; i < n; ++i) {
          xi_[s][i] = {};
          for (std::size_t r = 0; r < stages; ++r) {
            xi_[s][i] = mul_add(table.skew[s][r] * step_weights_[r], rates_[r][i], xi_[s][i]);
          }
        }
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      Rate x{};
      std::array<Momentum, stages> pushes{};
      taken_[i] = {};
      for (std::size_t s = 0; s < stages; ++s) {
        x = mul_add(step_weights_[s], rates_[s][i], x);
        way_[s][i] = exp(xi_[s][i]);
        if constexpr (System::has_forque) {
          pushes[s] = -step_weights_[s] * Ad_star_inverse(way_[s][i], gradients_[s].forques[i]);
          taken_[i] = taken_[i] - pushes[s];
        }
      }
      half_way_[i] = S(0.5) * x;
      half_[i] = exp(half_way_[i]);
      const Momentum first = Ad_star(half_[i], state.momenta[i]);
      const Momentum middle =
          S(0.5) * (detail::chart_momentum(half_way_[i], first) +
                    detail::chart_momentum(S(-1) * half_way_[i], first - taken_[i]));
      const Momentum mean = first - S(0.5) * taken_[i];
      std::array<Momentum, stages> balanced{};
      std::array<Momentum, stages> forces{};
      for (std::size_t s = 0; s < stages; ++s) {
        balanced[s] = mean;
        if constexpr (System::has_forque) {
          for (std::size_t r = 0; r < stages; ++r) {
            balanced[s] = mul_add(table.skew[s][r], pushes[r], balanced[s]);
          }
        }
        forces[s] = detail::chart_force(S(-1) * xi_[s][i], -step_weights_[s] * rates_[s][i],
                                        balanced[s] + beside_[s][i], pushes[s]);
      }
      for (std::size_t s = 0; s < stages; ++s) {
        Momentum p = middle;
        for (std::size_t r = 0; r < stages; ++r) p = mul_add(table.skew[s][r], forces[r], p);
        const Momentum m = detail::body_momentum(S(-1) * xi_[s][i], p);
        beside_[s][i] = m - balanced[s];
        momenta_[s][i] = Ad_star(way_[s][i], m);
      }
    }
  }

  /// By how much rates and forques there differ from those that led there.
  [[nodiscard]] constexpr Slopes residual(const System& system, const StateOf<System>& state,
                                          const S& t) noexcept {
    StateOf<System> center = state;
    for (std::size_t i = 0; i < n; ++i) center.motors[i] = gp(state.motors[i], half_[i]);
    Slopes difference{};
    for (std::size_t s = 0; s < stages; ++s) {
      StateOf<System> there{{}, momenta_[s]};
      for (std::size_t i = 0; i < n; ++i) there.motors[i] = gp(center.motors[i], way_[s][i]);
      const S then = mul_add(table.nodes[s], h_, t);
      const auto now = gradient(system, there, then);
      if constexpr (PoweredSystem<System>) power_[s] = system.power(there, then);
      for (std::size_t i = 0; i < n; ++i) {
        difference[s].rates[i] = now.rates[i] - gradients_[s].rates[i];
        if constexpr (System::has_forque) {
          difference[s].forques[i] = now.forques[i] - gradients_[s].forques[i];
        }
      }
    }
    return difference;
  }

  /// Iterates the stages; false where they do not settle.
  [[nodiscard]] constexpr bool solve(const System& system, const StateOf<System>& state,
                                     const S& t) noexcept {
    const auto guess = gradients_;
    S before(0);
    int since = 0;  // iterations in this way
    for (iterations_ = 1; iterations_ <= most_iterations; ++iterations_) {
      Slopes by = residual(system, state, t);
      if constexpr (has_newton) {
        if (newton_.on) {
          if (newton_.h != h_) linearise(system, state, t);
          by = corrected(by);
        }
      }
      const S change = size(by);
      // Where polynomials foretell nothing, as of stiff springs, the next step starts without them.
      if (iterations_ == 1) foresees_ = change < S(0.05);
      ++since;
      const bool finite = change - change == S(0);
      const bool small = change <= S(65536) * scalar::Limits<S>::epsilon();
      const bool slow = since > 2 && change > S(0.25) * before;
      if (!finite || (slow && !small)) {
        if constexpr (has_newton) {
          if (!finite || (!newton_.on && change > S(0.1))) {
            if (newton_.on && since == 1) return false;
            gradients_ = guess;
            begin(state);
          }
          newton_.on = true;
          linearise(system, state, t);
          since = 0;
          continue;
        } else if (!finite) {
          return false;
        }
      }
      for (std::size_t s = 0; s < stages; ++s) {
        for (std::size_t i = 0; i < n; ++i) {
          gradients_[s].rates[i] = gradients_[s].rates[i] + by[s].rates[i];
          if constexpr (System::has_forque) {
            gradients_[s].forques[i] = gradients_[s].forques[i] + by[s].forques[i];
          }
        }
      }
      place(state);
      // Rounding is reached where small changes shrink no more; the first two need not show all
      // components.
      if (since > 2 && small && (change <= S(0) || !(change < before))) return true;
      before = change;
    }
    return false;
  }

  /// The size of a change of rates and forques, relative to Σ |μ B|.
  [[nodiscard]] constexpr S size(const Slopes& by) const noexcept {
    S changed(0);
    S whole(0);
    S both(0);
    for (std::size_t s = 0; s < stages; ++s) {
      for (std::size_t i = 0; i < n; ++i) {
        add_sizes(by[s].rates[i], momenta_[s][i], changed);
        add_sizes(gradients_[s].rates[i], momenta_[s][i], whole);
        if constexpr (System::has_forque) {
          const Momentum push = h_ * by[s].forques[i];
          add_sizes(gradients_[s].rates[i], push, changed);
          add_sizes(by[s].rates[i], push, both);
        }
      }
    }
    // The root sees a small component beside a large one, as a spin, to first order.
    return select(whole > S(0), changed / whole + scalar::sqrt(both / whole), changed + both);
  }

  /// Adds Σ |V_k μ_k|.
  static constexpr void add_sizes(const Rate& v, const Momentum& mu, S& sum) noexcept {
    const auto x = v.components();
    const auto y = mu.components();
    for (std::size_t k = 0; k < x.size(); ++k) sum = sum + scalar::abs(x[k] * y[k]);
  }

  /// Newton's change of rates and forques for a difference of them.
  [[nodiscard]] constexpr Slopes corrected(const Slopes& difference) const noexcept {
    typename detail::StageEquations<S, stages, unknowns>::Slopes r{};
    for (std::size_t s = 0; s < stages; ++s) r[s] = numbers(difference[s]);
    r = newton_.equations.solve(table, r);
    Slopes by{};
    for (std::size_t s = 0; s < stages; ++s) {
      for (std::size_t i = 0; i < n; ++i) {
        std::array<S, dimension> rate{};
        std::array<S, dimension> forque{};
        for (std::size_t k = 0; k < dimension; ++k) {
          rate[k] = r[s][i * dimension + k];
          forque[k] = -r[s][(n + i) * dimension + k];
        }
        by[s].rates[i] = Rate::from(rate);
        by[s].forques[i] = Momentum::from(forque);
      }
    }
    return by;
  }

  /// B and −F, which displacements and pushes grow by.
  [[nodiscard]] static constexpr Vector numbers(const Gradients& slope) noexcept {
    Vector x{};
    for (std::size_t i = 0; i < n; ++i) {
      const auto rate = slope.rates[i].components();
      for (std::size_t k = 0; k < dimension; ++k) x[i * dimension + k] = rate[k];
      if constexpr (System::has_forque) {
        const auto forque = slope.forques[i].components();
        for (std::size_t k = 0; k < dimension; ++k) x[(n + i) * dimension + k] = -forque[k];
      }
    }
    return x;
  }

  /// The Jacobian of (B, −F) at the middle stage for displacements η and pushes φ that change its
  /// motor to M exp η and its momentum to μ + ad*_η μ + φ, by differences of the gradient: Newton's
  /// method asks no more of it than to be near.
  constexpr void linearise(const System& system, const StateOf<System>& state,
                           const S& t) noexcept {
    constexpr std::size_t at = stages / 2;
    StateOf<System> center = state;
    for (std::size_t i = 0; i < n; ++i) {
      center.motors[i] = gp(gp(state.motors[i], half_[i]), way_[at][i]);
      center.momenta[i] = momenta_[at][i];
    }
    const S then = mul_add(table.nodes[at], h_, t);
    const auto slope = gradient(system, center, then);
    const Vector here = numbers(slope);
    const S root = scalar::sqrt(scalar::Limits<S>::epsilon());
    detail::Matrix<S, unknowns> jacobian{};
    for (std::size_t i = 0; i < n; ++i) {
      // Of what the step does not move, little is known.
      const auto rate = slope.rates[i].components();
      const S moved = scalar::abs(h_) * detail::largest(slope.rates[i]);
      S pushed = detail::largest(center.momenta[i]);
      if constexpr (System::has_forque) {
        pushed = pushed + scalar::abs(h_) * detail::largest(slope.forques[i]);
      }
      for (std::size_t k = 0; k < dimension; ++k) {
        const S step = root * (scalar::abs(h_ * rate[k]) + S(0.01) * moved +
                               root * detail::largest(center.motors[i]));
        std::array<S, dimension> unit{};
        unit[k] = step;
        const Rate eta = Rate::from(unit);
        StateOf<System> there = center;
        there.motors[i] = center.motors[i] + detail::motor_change(center.motors[i], eta);
        there.momenta[i] = center.momenta[i] + coadjoint(eta, center.momenta[i]);
        fill(jacobian, i * dimension + k, here, numbers(gradient(system, there, then)), step);
        if (!(pushed > S(0))) continue;
        unit[k] = root * pushed;
        there = center;
        there.momenta[i] = center.momenta[i] + Momentum::from(unit);
        fill(jacobian, (n + i) * dimension + k, here, numbers(gradient(system, there, then)),
             unit[k]);
      }
    }
    newton_.h = h_;
    newton_.equations.set(jacobian, h_);
  }

  static constexpr void fill(detail::Matrix<S, unknowns>& jacobian, std::size_t column,
                             const Vector& here, const Vector& there, const S& step) noexcept {
    for (std::size_t row = 0; row < unknowns; ++row) {
      jacobian[row][column] = (there[row] - here[row]) / step;
    }
  }

  /// Moves the state; what it loses in each step is kept.
  constexpr void finish(StateOf<System>& state) noexcept {
    ChangeOf<System> change{};
    for (std::size_t i = 0; i < n; ++i) {
      const Rate x = S(2) * half_way_[i];
      change.motors[i] = detail::motor_change(state.motors[i], x);
      change.momenta[i] =
          detail::momentum_change(state.momenta[i], x) - Ad_star(half_[i], taken_[i]);
    }
    detail::record(drift_, low_.add(state, change));
    if (failure_ != Failure::none) {
      for (auto& mu : state.momenta) mu = S(std::numeric_limits<double>::quiet_NaN()) * mu;
    }
    if constexpr (PoweredSystem<System>) {
      for (std::size_t s = 0; s < stages; ++s) work_ = mul_add(step_weights_[s], power_[s], work_);
    }
    end_ = state;
  }

  std::array<Gradients, stages> gradients_{};        ///< B and F at the stages
  std::array<Momenta, stages> momenta_{};            ///< μ there
  std::array<Momenta, stages> beside_{};             ///< m there less the balance of the forques
  Momenta taken_{};                                  ///< h Σ b Ad*⁻¹ F, seen from half-way
  std::array<std::array<Rate, n>, stages> rates_{};  ///< V = ξ̇ there
  std::array<std::array<Rate, n>, stages> xi_{};
  std::array<std::array<Element, n>, stages> way_{};  ///< exp ξ
  std::array<Rate, n> half_way_{};                    ///< X/2
  std::array<Element, n> half_{};                     ///< exp(X/2)
  std::array<S, stages> step_weights_{};              ///< h b
  std::array<S, stages> power_{};
  S h_{};
  StateOf<System> end_{};  ///< what the last step left
  [[no_unique_address]] std::conditional_t<has_newton, Newton, NoNewton> newton_;
  LowDigits<System> low_;
  Drift<S> drift_;
  S work_{};
  Failure failure_ = Failure::none;
  int iterations_ = 0;
  bool foresees_ = false;
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
template <HamiltonianSystem System>
using Gauss12 = Gauss<System, 6>;
template <HamiltonianSystem System>
using Gauss16 = Gauss<System, 8>;

}  // namespace hamotor
