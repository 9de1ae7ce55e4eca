// Dual numbers: a value and its derivative with respect to one parameter.
#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include "hamotor/scalar.hpp"

namespace sample {

/// value + slope ε, ε² = 0: a scalar that differentiates what is computed with it, exactly.
struct Dual {
  double value = 0;
  double slope = 0;

  constexpr Dual() = default;
  template <class Number>
    requires std::is_arithmetic_v<Number>
  constexpr explicit(false) Dual(Number x) : value(static_cast<double>(x)) {}
  constexpr Dual(double x, double dx) : value(x), slope(dx) {}

  friend constexpr Dual operator-(const Dual& a) { return {-a.value, -a.slope}; }
  friend constexpr Dual operator+(const Dual& a, const Dual& b) {
    return {a.value + b.value, a.slope + b.slope};
  }
  friend constexpr Dual operator-(const Dual& a, const Dual& b) { return a + -b; }
  friend constexpr Dual operator*(const Dual& a, const Dual& b) {
    return {a.value * b.value, a.slope * b.value + a.value * b.slope};
  }
  friend constexpr Dual operator/(const Dual& a, const Dual& b) {
    const double quotient = a.value / b.value;
    return {quotient, (a.slope - quotient * b.slope) / b.value};
  }
  friend constexpr bool operator==(const Dual& a, const Dual& b) = default;
  friend constexpr bool operator<(const Dual& a, const Dual& b) { return a.value < b.value; }
  friend constexpr bool operator>(const Dual& a, const Dual& b) { return b < a; }
  friend constexpr bool operator<=(const Dual& a, const Dual& b) { return a.value <= b.value; }
  friend constexpr bool operator>=(const Dual& a, const Dual& b) { return b <= a; }
};

inline Dual sqrt(const Dual& x) {
  const double root = std::sqrt(x.value);
  return {root, 0.5 * x.slope / root};
}
inline Dual exp(const Dual& x) { return {std::exp(x.value), std::exp(x.value) * x.slope}; }
inline Dual log(const Dual& x) { return {std::log(x.value), x.slope / x.value}; }
inline Dual sinh(const Dual& x) { return {std::sinh(x.value), std::cosh(x.value) * x.slope}; }
inline Dual cosh(const Dual& x) { return {std::cosh(x.value), std::sinh(x.value) * x.slope}; }
inline Dual sin(const Dual& x) { return {std::sin(x.value), std::cos(x.value) * x.slope}; }
inline Dual cos(const Dual& x) { return {std::cos(x.value), -std::sin(x.value) * x.slope}; }
inline Dual fma(const Dual& a, const Dual& b, const Dual& c) {
  return {std::fma(a.value, b.value, c.value), a.slope * b.value + a.value * b.slope + c.slope};
}

}  // namespace sample

/// Rounding is that of the values.
template <>
struct hamotor::scalar::Limits<sample::Dual> : std::numeric_limits<double> {};
