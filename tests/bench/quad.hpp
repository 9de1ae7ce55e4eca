// The scalar that errors are measured with: __float128 as a type of its own, so that the kernels'
// sqrt, sin, … are found for it.
#pragma once

#include <cmath>
#include <compare>
#include <concepts>
#include <limits>

extern "C" {
// libquadmath; declared here because clang does not see g++'s header.
__extension__ __float128 sqrtq(__float128) noexcept;
__extension__ __float128 sinq(__float128) noexcept;
__extension__ __float128 cosq(__float128) noexcept;
__extension__ __float128 sinhq(__float128) noexcept;
__extension__ __float128 coshq(__float128) noexcept;
__extension__ __float128 atan2q(__float128, __float128) noexcept;
__extension__ __float128 acosq(__float128) noexcept;
__extension__ __float128 fmaq(__float128, __float128, __float128) noexcept;
__extension__ __float128 fabsq(__float128) noexcept;
}

namespace bench {

/// A number with 113 bits.
struct Quad {
  __extension__ using Bits = __float128;
  Bits bits;

  Quad() = default;
  template <class T>
    requires std::integral<T> || std::floating_point<T> || std::same_as<T, Bits>
  constexpr Quad(T x) noexcept : bits(static_cast<Bits>(x)) {}
  constexpr explicit operator double() const noexcept { return static_cast<double>(bits); }
  constexpr explicit operator float() const noexcept { return static_cast<float>(bits); }

  friend constexpr Quad operator+(Quad a, Quad b) noexcept { return a.bits + b.bits; }
  friend constexpr Quad operator-(Quad a, Quad b) noexcept { return a.bits - b.bits; }
  friend constexpr Quad operator*(Quad a, Quad b) noexcept { return a.bits * b.bits; }
  friend constexpr Quad operator/(Quad a, Quad b) noexcept { return a.bits / b.bits; }
  friend constexpr Quad operator-(Quad a) noexcept { return -a.bits; }
  constexpr Quad& operator+=(Quad b) noexcept { return *this = *this + b; }
  constexpr Quad& operator-=(Quad b) noexcept { return *this = *this - b; }
  constexpr Quad& operator*=(Quad b) noexcept { return *this = *this * b; }
  constexpr Quad& operator/=(Quad b) noexcept { return *this = *this / b; }
  friend constexpr bool operator==(Quad a, Quad b) noexcept { return a.bits == b.bits; }
  friend constexpr std::partial_ordering operator<=>(Quad a, Quad b) noexcept {
    if (a.bits < b.bits) return std::partial_ordering::less;
    if (a.bits > b.bits) return std::partial_ordering::greater;
    return a.bits == b.bits ? std::partial_ordering::equivalent : std::partial_ordering::unordered;
  }

  friend Quad sqrt(Quad x) noexcept { return sqrtq(x.bits); }
  friend Quad sin(Quad x) noexcept { return sinq(x.bits); }
  friend Quad cos(Quad x) noexcept { return cosq(x.bits); }
  friend Quad sinh(Quad x) noexcept { return sinhq(x.bits); }
  friend Quad cosh(Quad x) noexcept { return coshq(x.bits); }
  friend Quad atan2(Quad y, Quad x) noexcept { return atan2q(y.bits, x.bits); }
  friend Quad acos(Quad x) noexcept { return acosq(x.bits); }
  friend Quad fma(Quad a, Quad b, Quad c) noexcept { return fmaq(a.bits, b.bits, c.bits); }
  friend Quad abs(Quad x) noexcept { return fabsq(x.bits); }
};

}  // namespace bench

template <>
class std::numeric_limits<bench::Quad> : public std::numeric_limits<long double> {
 public:
  static constexpr int digits = 113;
  static constexpr int digits10 = 33;
  static constexpr int max_digits10 = 36;
  static constexpr bench::Quad epsilon() noexcept {
    return 1.92592994438723585305597794258492732e-34L;
  }
};
