// Explicit Runge–Kutta–Munthe-Kaas of order 5 with an embedded error estimate, and steps of its own
// choice: for dissipative and non-smooth forques.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string_view>

#include "hamotor/scalar.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"

namespace hamotor {

namespace detail {

/// A rational coefficient.
struct Ratio {
  long long over;
  long long under;
};

/// Dormand & Prince 1980, 5(4): rows of a; the last is b as well.
inline constexpr std::array<std::array<Ratio, 6>, 7> dormand_prince{{
    {},
    {{{1, 5}}},
    {{{3, 40}, {9, 40}}},
    {{{44, 45}, {-56, 15}, {32, 9}}},
    {{{19372, 6561}, {-25360, 2187}, {64448, 6561}, {-212, 729}}},
    {{{9017, 3168}, {-355, 33}, {46732, 5247}, {49, 176}, {-5103, 18656}}},
    {{{35, 384}, {0, 1}, {500, 1113}, {125, 192}, {-2187, 6784}, {11, 84}}},
}};

/// b of order 5 less b of order 4.
inline constexpr std::array<Ratio, 7> dormand_prince_error{
    {{71, 57600}, {0, 1}, {-71, 16695}, {71, 1920}, {-17253, 339200}, {22, 525}, {-1, 40}}};

/// The number, 0 where a row has ended.
template <class S>
[[nodiscard]] constexpr S number(const Ratio& x) noexcept {
  return x.over == 0 ? S(0) : S(x.over) / S(x.under);
}

}  // namespace detail

/// Runge–Kutta–Munthe-Kaas of order 5 by Dormand & Prince's pair 5(4), with the error of its
/// embedded method of order 4 (Munthe-Kaas 1999): seven evaluations a step; not symplectic.
template <HamiltonianSystem System>
class Rkmk54 {
  using S = typename System::Scalar;
  using G = typename System::Group;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  static constexpr std::size_t n = System::bodies;
  static constexpr std::size_t stages = 7;

 public:
  static constexpr int order = 5;
  static constexpr std::string_view name = "rkmk54";

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    std::array<std::array<Rate, n>, stages> slopes{};
    std::array<std::array<Momentum, n>, stages> forces{};
    std::array<S, stages> powers{};
    StateOf<System> there = state;
    std::array<Rate, n> x{};
    for (std::size_t s = 0; s < stages; ++s) {
      S node(0);
      for (std::size_t r = 0; r < s; ++r) {
        node = node + detail::number<S>(detail::dormand_prince[s][r]);
      }
      for (std::size_t i = 0; i < n && s > 0; ++i) {
        x[i] = Rate{};
        there.momenta[i] = state.momenta[i];
        for (std::size_t r = 0; r < s; ++r) {
          const S a = h * detail::number<S>(detail::dormand_prince[s][r]);
          x[i] = mul_add(a, slopes[r][i], x[i]);
          there.momenta[i] = mul_add(a, forces[r][i], there.momenta[i]);
        }
        there.motors[i] = gp(state.motors[i], exp(x[i]));
      }
      const S then = mul_add(node, h, t);
      const auto now = gradient(system, there, then);
      if constexpr (PoweredSystem<System>) powers[s] = system.power(there, then);
      forces[s] = free_momentum_rates(system, there.momenta, now.rates);
      for (std::size_t i = 0; i < n; ++i) {
        slopes[s][i] = dexp_inverse(x[i], now.rates[i]);
        if constexpr (System::has_forque) forces[s][i] = forces[s][i] - now.forques[i];
      }
    }
    error_ = S(0);
    S worst(0);
    for (std::size_t i = 0; i < n; ++i) {
      Rate turned{};
      Momentum pushed{};
      for (std::size_t s = 0; s < stages; ++s) {
        const S e = h * detail::number<S>(detail::dormand_prince_error[s]);
        turned = mul_add(e, slopes[s][i], turned);
        pushed = mul_add(e, forces[s][i], pushed);
      }
      // The last stage is the step: the row of its coefficients is that of the method.
      auto& motor = there.motors[i];
      const S off = size(S(0.5) * kinematics(motor, turned));
      const S momentum = size(there.momenta[i]);
      const S push = size(pushed);
      error_ = scalar::max_abs(error_, off, select(momentum > push, push / momentum, push));
      const auto defect = unit_defect(motor);
      worst = scalar::max_abs(worst, detail::size(defect));
      motor = motor + unit_correction(motor, defect);
    }
    state = there;
    if constexpr (PoweredSystem<System>) {
      for (std::size_t s = 0; s + 1 < stages; ++s) {
        work_ =
            mul_add(h * detail::number<S>(detail::dormand_prince[stages - 1][s]), powers[s], work_);
      }
    }
    detail::record(drift_, worst);
  }

  /// The estimated error of the last step, by the method of order 4: the largest of a motor's
  /// component, and of a momentum's relative to the largest component of it.
  [[nodiscard]] constexpr const S& error() const noexcept { return error_; }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return drift_; }

  /// ∫ dH/dt dt over the steps so far, J, by the method's own quadrature.
  [[nodiscard]] constexpr const S& work() const noexcept
    requires PoweredSystem<System>
  {
    return work_;
  }

 private:
  /// B + ½ [X, B] + 1/12 ad² B − 1/720 ad⁴ B; the next term is of sixth order in X.
  [[nodiscard]] static constexpr Rate dexp_inverse(const Rate& x, const Rate& b) noexcept {
    const Rate once = ad(x, b);
    const Rate twice = ad(x, once);
    const Rate fourth = ad(x, ad(x, twice));
    return mul_add(S(-1) / S(720), fourth, mul_add(S(1) / S(12), twice, mul_add(S(0.5), once, b)));
  }

  template <class T>
  [[nodiscard]] static constexpr S size(const T& x) noexcept {
    S largest(0);
    for (const S& c : x.components()) largest = scalar::max_abs(largest, c);
    return largest;
  }

  Drift<S> drift_;
  S error_ = S(0);
  S work_{};
};

/// A method with an error estimate, in as many steps as keep it below `tolerance` a unit of time
/// (s⁻¹): `do_step` covers the time h by steps of its own choice, the last of which ends there, and
/// remembers their length for the next call.  Without a tolerance it is the method itself, one step
/// a call.  The state becomes not a number where a step would have to be shorter than rounding of
/// the time it is part of.
template <class System, class Method = Rkmk54<System>>
class Adaptive {
  using S = typename System::Scalar;

 public:
  static constexpr int order = Method::order;
  static constexpr std::string_view name = Method::name;

  constexpr Adaptive() noexcept = default;
  constexpr explicit Adaptive(const S& tolerance) noexcept : tolerance_(tolerance) {}

  /// Asks for this local error a unit of time, s⁻¹; 0 for one step a call.
  constexpr void set_tolerance(const S& tolerance) noexcept { tolerance_ = tolerance; }

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    failure_ = Failure::none;
    if (!(tolerance_ > S(0))) {
      method_.do_step(system, state, t, h);
      ++tried_;
      ++taken_;
      return;
    }
    const S direction = scalar::sign(h);
    const S whole = scalar::abs(h);
    S done(0);
    while (done < whole) {
      const bool last = !(proposed_ > S(0)) || done + proposed_ >= whole;
      const S step = last ? whole - done : proposed_;
      StateOf<System> trial = state;
      Method method = method_;
      method.do_step(system, trial, mul_add(direction, done, t), direction * step);
      ++tried_;
      // Per unit step: the estimate, of order p, over h goes as h^(p−1).
      const S ratio = method.error() / (tolerance_ * step);
      const bool accepted = ratio <= S(1);
      const S factor = shrinking(ratio);
      if (accepted) {
        state = trial;
        method_ = method;
        ++taken_;
        done = last ? whole : done + step;
        // A step cut short by the end of the interval says little about the next.
        if (!last || factor < S(1) || !(proposed_ > step)) proposed_ = factor * step;
      } else {
        proposed_ = factor * step;
        if (!(done + proposed_ > done) || !(proposed_ > scalar::Limits<S>::epsilon() * whole)) {
          const S error = method.error();
          failure_ = error - error == S(0) ? Failure::step_too_short : Failure::not_finite;
          for (auto& mu : state.momenta) mu = S(std::numeric_limits<double>::quiet_NaN()) * mu;
          return;
        }
      }
    }
  }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const auto& drift() const noexcept { return method_.drift(); }

  /// ∫ dH/dt dt over the steps so far, J, by the method's own quadrature.
  [[nodiscard]] constexpr const S& work() const noexcept
    requires PoweredSystem<System>
  {
    return method_.work();
  }

  /// Steps taken so far.
  [[nodiscard]] constexpr long long steps() const noexcept { return taken_; }

  /// Why the last `do_step` could not reach its end.
  [[nodiscard]] constexpr Failure failure() const noexcept { return failure_; }

  /// Steps tried so far, accepted or not.
  [[nodiscard]] constexpr long long tried() const noexcept { return tried_; }

 private:
  /// 0.9 ratio^(−1/4), within 1/5 and 5.
  [[nodiscard]] static constexpr S shrinking(const S& ratio) noexcept {
    if (!(ratio - ratio == S(0))) return S(0.2);
    if (!(ratio > S(1) / S(10000))) return S(5);
    const S factor = S(0.9) / scalar::sqrt(scalar::sqrt(ratio));
    return select(factor < S(0.2), S(0.2), select(factor > S(5), S(5), factor));
  }

  Method method_;
  S tolerance_ = S(0);
  S proposed_ = S(0);
  Failure failure_ = Failure::none;
  long long tried_ = 0;
  long long taken_ = 0;
};

}  // namespace hamotor
