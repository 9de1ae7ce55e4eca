// A double that counts what is done with it: operations, and evaluations of a system's gradient.
//
// Two numbers that the compiler knows cost nothing, and are not counted.  A multiply-add is one of
// each, and counted by itself besides.  Comparisons, changes of sign and choices are not counted.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <compare>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "hamotor/scalar.hpp"

namespace hamotor {

/// Double precision; what was done with all numbers of it stands in `counts`.
///
/// What is computed of `fixed` numbers and constants alone is fixed, too, and not counted: a loop
/// of steps finds it once, before it begins.
class Counted {
 public:
  /// What is told apart; the last one is of `state.hpp`.
  enum Kind : std::size_t { additions, products, quotients, roots, functions, evaluations };
  static inline std::array<std::int64_t, 6> counts{};
  /// How many of the additions and products are pairs that one instruction does.
  static inline std::int64_t fused = 0;

  Counted() = default;
  template <class Number>
    requires std::is_arithmetic_v<Number>
  constexpr Counted(Number x) noexcept : value_(static_cast<double>(x)) {}

  /// A number that is the same in every step.
  [[nodiscard]] static constexpr Counted fixed(double x) noexcept {
    Counted result(x);
    result.fixed_ = true;
    return result;
  }

  template <class Number>
    requires std::is_arithmetic_v<Number>
  explicit constexpr operator Number() const noexcept {
    return static_cast<Number>(value_);
  }

  friend constexpr Counted operator+(const Counted& a, const Counted& b) noexcept {
    return count(additions, a.value_ + b.value_, a, b);
  }
  friend constexpr Counted operator-(const Counted& a, const Counted& b) noexcept {
    return count(additions, a.value_ - b.value_, a, b);
  }
  friend constexpr Counted operator*(const Counted& a, const Counted& b) noexcept {
    return count(products, a.value_ * b.value_, a, b);
  }
  friend constexpr Counted operator/(const Counted& a, const Counted& b) noexcept {
    return count(quotients, a.value_ / b.value_, a, b);
  }
  friend constexpr Counted operator-(Counted a) noexcept {
    a.value_ = -a.value_;
    return a;
  }
  constexpr Counted& operator+=(const Counted& b) noexcept { return *this = *this + b; }
  constexpr Counted& operator-=(const Counted& b) noexcept { return *this = *this - b; }
  constexpr Counted& operator*=(const Counted& b) noexcept { return *this = *this * b; }
  constexpr Counted& operator/=(const Counted& b) noexcept { return *this = *this / b; }
  friend constexpr bool operator==(const Counted& a, const Counted& b) noexcept {
    return a.value_ == b.value_;
  }
  friend constexpr std::partial_ordering operator<=>(const Counted& a, const Counted& b) noexcept {
    return a.value_ <=> b.value_;
  }

  friend Counted sqrt(const Counted& x) noexcept { return count(roots, std::sqrt(x.value_), x, x); }
#define HAMOTOR_COUNTED(name)                           \
  friend Counted name(const Counted& x) noexcept {      \
    return count(functions, std::name(x.value_), x, x); \
  }
  HAMOTOR_COUNTED(sin)
  HAMOTOR_COUNTED(cos)
  HAMOTOR_COUNTED(tan)
  HAMOTOR_COUNTED(sinh)
  HAMOTOR_COUNTED(cosh)
  HAMOTOR_COUNTED(tanh)
  HAMOTOR_COUNTED(asinh)
  HAMOTOR_COUNTED(exp)
  HAMOTOR_COUNTED(log)
  HAMOTOR_COUNTED(asin)
  HAMOTOR_COUNTED(acos)
  HAMOTOR_COUNTED(atan)
#undef HAMOTOR_COUNTED
  friend Counted floor(const Counted& x) noexcept { return std::floor(x.value_); }
  friend Counted atan2(const Counted& y, const Counted& x) noexcept {
    return count(functions, std::atan2(y.value_, x.value_), y, x);
  }
  [[nodiscard]] HAMOTOR_INLINE static constexpr Counted multiply_add(const Counted& a,
                                                                     const Counted& b,
                                                                     const Counted& c) noexcept {
    if (std::is_constant_evaluated()) return a * b + c;
    const auto before = counts[additions] + counts[products];
    const Counted result = a * b + c;
    if (counts[additions] + counts[products] == before + 2) ++fused;
    return result;
  }
  friend constexpr Counted fma(const Counted& a, const Counted& b, const Counted& c) noexcept {
    const Counted twice_rounded = a * b + c;
    if (std::is_constant_evaluated()) return twice_rounded;
    return std::fma(a.value_, b.value_, c.value_);
  }

  static Counted rough_log2(const Counted& x) noexcept {
    return count(functions, scalar::rough_log2(x.value_), x, x);
  }
  static Counted rough_exp2(const Counted& x) noexcept {
    return count(functions, scalar::rough_exp2(x.value_), x, x);
  }

  static constexpr void note_evaluations(std::int64_t times) noexcept {
    if (!std::is_constant_evaluated()) counts[evaluations] += times;
  }

 private:
  [[nodiscard]] static constexpr Counted count(Kind kind, double value, const Counted& a,
                                               const Counted& b) noexcept {
    Counted result(value);
    if (std::is_constant_evaluated()) {
      result.fixed_ = a.fixed_ || b.fixed_;
      return result;
    }
    const bool a_is = a.fixed_ || __builtin_constant_p(a.value_);
    const bool b_is = b.fixed_ || __builtin_constant_p(b.value_);
    result.fixed_ = a_is && b_is && (a.fixed_ || b.fixed_);
    if (!result.fixed_ && !__builtin_constant_p(value)) ++counts[kind];
    return result;
  }

  double value_ = 0;
  bool fixed_ = false;
};

template <>
struct scalar::Limits<Counted> : std::numeric_limits<double> {
  static constexpr Counted epsilon() noexcept { return std::numeric_limits<double>::epsilon(); }
  static constexpr Counted max() noexcept { return std::numeric_limits<double>::max(); }
};

}  // namespace hamotor

/// Writes what was counted since the last call.
extern "C" [[gnu::used, gnu::visibility("default")]] inline void hamotor_counts(
    std::int64_t* counts) {
  std::ranges::copy(hamotor::Counted::counts, counts);
  hamotor::Counted::counts.fill(0);
}
