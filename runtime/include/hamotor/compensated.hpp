// Motions of a state as what they add to it, and the digits that each addition would lose.
#pragma once

#include <array>
#include <cstddef>

#include "hamotor/scalar.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"

namespace hamotor {

namespace detail {

/// Largest absolute component.
template <class T>
[[nodiscard]] constexpr typename T::Scalar largest(const T& x) noexcept {
  typename T::Scalar worst(0);
  for (const auto& c : x.components()) worst = scalar::max_abs(worst, c);
  return worst;
}

/// Terms after which every series of exp and dexp has converged, if it converges at all.
inline constexpr int most_series_terms = 60;

/// Whether a term no longer counts beside its sum.
template <class T>
[[nodiscard]] constexpr bool negligible(const T& term, const T& sum) noexcept {
  using S = typename T::Scalar;
  return !(largest(term) > scalar::Limits<S>::epsilon() / S(64) * largest(sum));
}

/// Σ_{k≥1} f^k(x)/k!, its rounding error relative to itself; `whole()` where the series would
/// cancel.
template <class T, class Map, class Whole>
[[nodiscard]] constexpr T exponential_change(const T& x, const Map& f,
                                             const Whole& whole) noexcept {
  using S = typename T::Scalar;
  T term = f(x);
  T sum = term;
  const S first = largest(term);
  for (int k = 2; k < most_series_terms; ++k) {
    term = (S(1) / S(k)) * f(term);
    if (k == 2 && largest(term) > first) return whole();
    sum = sum + term;
    if (negligible(term, sum)) break;
  }
  return sum;
}

/// M exp X − M.
template <class Element, class Rate>
[[nodiscard]] constexpr Element motor_change(const Element& m, const Rate& x) noexcept {
  return exponential_change(
      m, [&](const Element& y) { return kinematics(y, x); }, [&] { return gp(m, exp(x)) - m; });
}

/// Ad*_{exp X} μ − μ.
template <class Momentum, class Rate>
[[nodiscard]] constexpr Momentum momentum_change(const Momentum& mu, const Rate& x) noexcept {
  return exponential_change(
      mu, [&](const Momentum& y) { return coadjoint(x, y); },
      [&] { return Ad_star(exp(x), mu) - mu; });
}

}  // namespace detail

/// What a state's numbers do not hold of it: a sum over steps is then rounded as if in twice the
/// precision (Neumaier 1974), and what a step rounds is relative to its change.
template <class System>
class LowDigits {
  using S = typename System::Scalar;

 public:
  /// Adds a step's change and puts the motors back on the group; returns how far they were off it,
  /// the largest coefficient of M M~ − 1.
  constexpr S add(StateOf<System>& state, const ChangeOf<System>& change) noexcept {
    S worst(0);
    for (std::size_t i = 0; i < System::bodies; ++i) {
      auto& motor = state.motors[i];
      detail::add_compensated(motor, motors_[i], change.motors[i]);
      const auto defect = unit_defect(motor) + unit_defect_change(motor, motors_[i]);
      worst = scalar::max_abs(worst, detail::size(defect));
      detail::add_compensated(motor, motors_[i], unit_correction(motor, defect));
      detail::add_compensated(state.momenta[i], momenta_[i], change.momenta[i]);
    }
    return worst;
  }

 private:
  decltype(StateOf<System>::motors) motors_{};
  decltype(StateOf<System>::momenta) momenta_{};
};

}  // namespace hamotor
