// Motions of a state as what they add to it, and the digits that each addition would lose.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>
#include <type_traits>

#include "hamotor/scalar.hpp"
#include "hamotor/space.hpp"
#include "hamotor/state.hpp"

namespace hamotor {

/// Whether a sum over steps carries the digits that each addition would lose.
enum class Summation { plain, compensated };

namespace detail {

/// Adds `change` to `value`; `low` holds what does not fit (Neumaier 1974), so that a rounding
/// error is made in the change only.
template <class T>
constexpr void add_compensated(T& value, T& low, const T& change) noexcept {
  auto sum = value.components();
  auto lost = low.components();
  const auto add = change.components();
  for (std::size_t k = 0; k < sum.size(); ++k) {
    const auto pair = scalar::two_sum(sum[k], add[k] + lost[k]);
    sum[k] = pair.hi;
    lost[k] = pair.lo;
  }
  value = T::from(sum);
  low = T::from(lost);
}

/// Largest absolute coefficient of M M~ − 1.
template <class Defect>
[[nodiscard]] constexpr typename Defect::Scalar size(const Defect& defect) noexcept {
  return std::apply([](const auto&... x) { return scalar::max_abs(x...); }, defect.components());
}

/// M M~ − 1, rounded as its terms are: for steppers that round M itself in every step.  Products by
/// table have no other.
template <class Motor>
[[nodiscard]] HAMOTOR_INLINE constexpr auto rounded_defect(const Motor& m) noexcept {
  using S = typename Motor::Scalar;
  using Defect = decltype(unit_defect_change(m, m));
  if constexpr (requires { Defect::names; }) {
    auto defect = unit_defect_change(m, m).components();
    static_assert(Defect::names[0] == "s");
    defect[0] = mul_add(S(0.5), defect[0], S(-1));
    for (std::size_t k = 1; k < defect.size(); ++k) defect[k] = S(0.5) * defect[k];
    return Defect::from(defect);
  } else {
    return unit_defect(m);
  }
}

/// Puts a motor back on the group by −½ (M M~ − 1) M, rounded as its terms are; returns the largest
/// absolute coefficient of M M~ − 1.
template <class G, class Motor>
HAMOTOR_INLINE constexpr typename Motor::Scalar put_back(Motor& motor) noexcept {
  if constexpr (requires { Space<G>::put_back(motor); }) {
    return Space<G>::put_back(motor);
  } else {
    const auto defect = rounded_defect(motor);
    motor = motor + unit_correction(motor, defect);
    return size(defect);
  }
}

template <class S>
constexpr void record(Drift<S>& drift, const S& defect) noexcept {
  drift.largest = select(defect > drift.largest, defect, drift.largest);
  drift.sum = drift.sum + defect;
}

/// The largest of all bodies' defects.
template <class S, std::size_t N>
constexpr void record(Drift<S>& drift, const std::array<S, N>& defects) noexcept {
  S worst = defects[0];
  for (std::size_t i = 1; i < N; ++i) worst = select(worst > defects[i], worst, defects[i]);
  record(drift, worst);
}

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

/// Puts zeros where a condition does not hold.
template <class Change, class Condition>
constexpr void keep_where(Change& change, const Condition& condition) noexcept {
  for (auto& motor : change.motors) motor = select_each(condition, motor, {});
  for (auto& momentum : change.momenta) momentum = select_each(condition, momentum, {});
}

}  // namespace detail

/// What a state's numbers do not hold of it: a sum over steps is then rounded as if in twice the
/// precision (Neumaier 1974), and what a step rounds is relative to its change.  Of plain sums,
/// nothing.
template <class System, Summation summation = Summation::compensated>
class LowDigits {
  using S = typename System::Scalar;

 public:
  /// Adds a step's change and puts the motors back on the group; returns how far they were off it,
  /// the largest coefficient of M M~ − 1.
  constexpr S add(StateOf<System>& state, const ChangeOf<System>& change) noexcept {
    S worst(0);
    for (std::size_t i = 0; i < System::bodies; ++i) {
      auto& motor = state.motors[i];
      auto& momentum = state.momenta[i];
      if constexpr (summation == Summation::compensated) {
        auto& low = kept_.motors[i];
        detail::add_compensated(motor, low, change.motors[i]);
        const auto defect = unit_defect(motor) + unit_defect_change(motor, low);
        worst = scalar::max_abs(worst, detail::size(defect));
        detail::add_compensated(motor, low, unit_correction(motor, defect));
        detail::add_compensated(momentum, kept_.momenta[i], change.momenta[i]);
      } else {
        motor = motor + change.motors[i];
        worst = scalar::max_abs(worst, detail::put_back<typename System::Group>(motor));
        momentum = momentum + change.momenta[i];
      }
    }
    return worst;
  }

  /// Forgets the digits where a condition does not hold: there, they were of another state.
  template <class Condition>
  constexpr void keep_where(const Condition& condition) noexcept {
    if constexpr (summation == Summation::compensated) {
      if (!all(condition)) detail::keep_where(kept_, condition);
    }
  }

 private:
  struct Nothing {};
  [[no_unique_address]] std::conditional_t<summation == Summation::compensated, ChangeOf<System>,
                                           Nothing> kept_{};
};

}  // namespace hamotor
