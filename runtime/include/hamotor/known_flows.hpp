// The motion of parts of a kinetic energy that are solved exactly, one after another.
#pragma once

#include <cstddef>

#include "hamotor/free_rotation.hpp"
#include "hamotor/scalar.hpp"

namespace hamotor {

namespace scalar {

/// (sin x)/x of z = x² ≥ 0.
template <class S>
[[nodiscard]] constexpr S sine_ratio(const S& z) noexcept {
  const auto by_sine = [&] {
    const S x = sqrt(z);
    return select(x > S(0), sin(x) / x, S(1));
  };
  if constexpr (hamotor::detail::has_series<S>) {
    const auto small = z <= hamotor::detail::series_bound<S>;
    const S series = mul_add(z, hamotor::detail::sine_series(z), S(1));
    return all(small) ? series : select(small, series, by_sine());
  } else {
    return by_sine();
  }
}

/// cos x − 1 of z = x² ≥ 0, with all digits however small it is.
template <class S>
[[nodiscard]] constexpr S cosine_less_one(const S& z) noexcept {
  const auto by_sine = [&] {
    const S sine = sin(S(0.5) * sqrt(z));
    return S(-2) * sine * sine;
  };
  if constexpr (hamotor::detail::has_series<S>) {
    const auto small = z <= hamotor::detail::series_bound<S>;
    const S series = z * hamotor::detail::cosine_series(z);
    return all(small) ? series : select(small, series, by_sine());
  } else {
    return by_sine();
  }
}

/// (sinh x)/x of z = x² ≥ 0.
template <class S>
[[nodiscard]] constexpr S sinh_ratio(const S& z) noexcept {
  const S x = sqrt(z);
  return select(x > S(0), sinh(x) / x, S(1));
}

/// cosh x − 1 of z = x² ≥ 0, with all digits however small it is.
template <class S>
[[nodiscard]] constexpr S cosh_less_one(const S& z) noexcept {
  const S sine = sinh(S(0.5) * sqrt(z));
  return S(2) * sine * sine;
}

}  // namespace scalar

/// A body's motor and momentum in the course of several motions, as changes of where they were, so
/// that rounding errors are relative to the change.
template <class G, class S>
class Underway {
 public:
  using Motor = typename G::template Element<S>;
  using Momentum = typename G::template Momentum<S>;

  constexpr Underway(const Motor& motor, const Momentum& momentum) noexcept
      : start_motor_(motor), start_momentum_(momentum), motor_(motor), momentum_(momentum) {}

  [[nodiscard]] constexpr const Motor& motor() const noexcept { return motor_; }
  [[nodiscard]] constexpr const Momentum& momentum() const noexcept { return momentum_; }

  /// All that was added.
  [[nodiscard]] constexpr const Motor& motor_change() const noexcept { return motor_change_; }
  [[nodiscard]] constexpr const Momentum& momentum_change() const noexcept {
    return momentum_change_;
  }

  constexpr void add(const Motor& motor, const Momentum& momentum) noexcept {
    motor_change_ = motor_change_ + motor;
    momentum_change_ = momentum_change_ + momentum;
    motor_ = start_motor_ + motor_change_;
    momentum_ = start_momentum_ + momentum_change_;
  }

  /// The motion at the constant rate B, whatever B is, in unit time: M exp B.
  template <class Rate>
  constexpr void turn(const Rate& rate) noexcept {
    const Motor by = exp(rate);
    add(gp(motor_, by) - motor_, Ad_star(by, momentum_) - momentum_);
  }

 private:
  Motor start_motor_;
  Momentum start_momentum_;
  Motor motor_;
  Momentum momentum_;
  Motor motor_change_{};
  Momentum momentum_change_{};
};

}  // namespace hamotor
