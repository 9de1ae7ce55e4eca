// Exact rational numbers, so that kernels can be checked without any tolerance.
#pragma once

#include <cmath>
#include <compare>
#include <cstdint>
#include <cstdlib>
#include <numeric>

namespace tests {

/// p / q in lowest terms, q > 0.  Ends the program rather than overflow.
class Rational {
 public:
  constexpr Rational() = default;
  explicit constexpr Rational(int value) : p_(value) {}
  explicit constexpr Rational(std::int64_t p, std::int64_t q) : Rational(reduced(p, q)) {}
  /// The number itself: a double is a fraction with a power of two below.
  explicit constexpr Rational(double value) {
    while (value != static_cast<double>(static_cast<std::int64_t>(value))) {
      value *= 2;
      q_ *= 2;
    }
    p_ = static_cast<std::int64_t>(value);
  }

  [[nodiscard]] constexpr std::int64_t numerator() const { return p_; }
  [[nodiscard]] constexpr std::int64_t denominator() const { return q_; }

  friend constexpr Rational operator+(const Rational& a, const Rational& b) {
    return reduced(Wide(a.p_) * b.q_ + Wide(b.p_) * a.q_, Wide(a.q_) * b.q_);
  }
  friend constexpr Rational operator-(const Rational& a, const Rational& b) { return a + -b; }
  friend constexpr Rational operator*(const Rational& a, const Rational& b) {
    return reduced(Wide(a.p_) * b.p_, Wide(a.q_) * b.q_);
  }
  friend constexpr Rational operator/(const Rational& a, const Rational& b) {
    if (b.p_ == 0) std::abort();
    return reduced(Wide(a.p_) * b.q_, Wide(a.q_) * b.p_);
  }
  friend constexpr Rational operator-(const Rational& a) { return reduced(-Wide(a.p_), a.q_); }
  friend constexpr Rational fma(const Rational& a, const Rational& b, const Rational& c) {
    return a * b + c;
  }
  friend constexpr bool operator==(const Rational&, const Rational&) = default;
  friend constexpr std::strong_ordering operator<=>(const Rational& a, const Rational& b) {
    return Wide(a.p_) * b.q_ <=> Wide(b.p_) * a.q_;
  }

 private:
  __extension__ using Wide = __int128;

  // Not inlined: kernels are, whole, and this would make them very long.
  [[gnu::noinline]] static constexpr Rational reduced(Wide p, Wide q) {
    Wide a = p < 0 ? -p : p;
    Wide b = q < 0 ? -q : q;
    while (b != 0) {
      const Wide rest = a % b;
      a = b;
      b = rest;
    }
    if (q < 0) a = -a;
    Rational result;
    result.p_ = static_cast<std::int64_t>(p / a);
    result.q_ = static_cast<std::int64_t>(q / a);
    if (result.p_ != p / a || result.q_ != q / a) std::abort();
    return result;
  }

  std::int64_t p_ = 0;
  std::int64_t q_ = 1;
};

}  // namespace tests
