// MPFR's numbers as a scalar: any number of digits, correctly rounded, about a microsecond an
// operation.  Link with -lmpfr -lgmp.
//
// Numbers hold their digits themselves (MPFR's custom interface), so that states are copied like
// arrays of doubles and nothing is allocated.
#pragma once

#include <mpfr.h>

#include <array>
#include <compare>
#include <concepts>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>

#include "hamotor/scalar.hpp"

namespace hamotor {

/// A number of `decimal_digits` significant digits, rounded to nearest.
template <int decimal_digits>
class Mpfr {
 public:
  /// Bits of the significand: log₂ 10 < 3.322.
  static constexpr int bits = (decimal_digits * 3322 + 999) / 1000 + 1;

  Mpfr() = default;
  template <std::signed_integral Integer>
  Mpfr(Integer x) noexcept {
    set([&](mpfr_ptr to) { mpfr_set_si(to, static_cast<long>(x), rounding); });
  }
  template <std::unsigned_integral Integer>
  Mpfr(Integer x) noexcept {
    set([&](mpfr_ptr to) { mpfr_set_ui(to, static_cast<unsigned long>(x), rounding); });
  }
  template <std::floating_point Float>
  Mpfr(Float x) noexcept {
    set([&](mpfr_ptr to) { mpfr_set_ld(to, static_cast<long double>(x), rounding); });
  }

  /// The number that a decimal stands for, correctly rounded.
  [[nodiscard]] static Mpfr from_text(std::string_view text) {
    return made(
        [&](mpfr_ptr to) { mpfr_strtofr(to, std::string(text).c_str(), nullptr, 10, rounding); });
  }

  /// 2^exponent.
  [[nodiscard]] static Mpfr power_of_two(long exponent) noexcept {
    return made([&](mpfr_ptr to) { mpfr_set_ui_2exp(to, 1, exponent, rounding); });
  }

  [[nodiscard]] static Mpfr pi() noexcept {
    return made([](mpfr_ptr to) { mpfr_const_pi(to, rounding); });
  }

  template <std::floating_point Float>
  explicit operator Float() const noexcept {
    View x(*this);
    if constexpr (std::same_as<Float, long double>) {
      return mpfr_get_ld(x, rounding);
    } else {
      return static_cast<Float>(mpfr_get_d(x, rounding));
    }
  }

  /// So many significant digits that the text reads back as the same number.
  [[nodiscard]] std::string text() const {
    std::array<char, decimal_digits + 40> buffer{};
    View x(*this);
    mpfr_snprintf(buffer.data(), buffer.size(), "%.*Rg", decimal_digits + 2,
                  static_cast<mpfr_srcptr>(x));
    return buffer.data();
  }

  friend Mpfr operator+(const Mpfr& a, const Mpfr& b) noexcept { return of(mpfr_add, a, b); }
  friend Mpfr operator-(const Mpfr& a, const Mpfr& b) noexcept { return of(mpfr_sub, a, b); }
  friend Mpfr operator*(const Mpfr& a, const Mpfr& b) noexcept { return of(mpfr_mul, a, b); }
  friend Mpfr operator/(const Mpfr& a, const Mpfr& b) noexcept { return of(mpfr_div, a, b); }
  friend Mpfr operator-(const Mpfr& a) noexcept { return of(mpfr_neg, a); }
  friend constexpr bool operator==(const Mpfr& a, const Mpfr& b) noexcept { return equal(a, b); }
  friend std::partial_ordering operator<=>(const Mpfr& a, const Mpfr& b) noexcept {
    View x(a);
    View y(b);
    if (mpfr_unordered_p(x, y) != 0) return std::partial_ordering::unordered;
    return mpfr_cmp(x, y) <=> 0;
  }

  friend Mpfr sqrt(const Mpfr& x) noexcept { return of(mpfr_sqrt, x); }
  friend Mpfr sin(const Mpfr& x) noexcept { return of(mpfr_sin, x); }
  friend Mpfr cos(const Mpfr& x) noexcept { return of(mpfr_cos, x); }
  friend Mpfr tan(const Mpfr& x) noexcept { return of(mpfr_tan, x); }
  friend Mpfr sinh(const Mpfr& x) noexcept { return of(mpfr_sinh, x); }
  friend Mpfr cosh(const Mpfr& x) noexcept { return of(mpfr_cosh, x); }
  friend Mpfr tanh(const Mpfr& x) noexcept { return of(mpfr_tanh, x); }
  friend Mpfr asinh(const Mpfr& x) noexcept { return of(mpfr_asinh, x); }
  friend Mpfr exp(const Mpfr& x) noexcept { return of(mpfr_exp, x); }
  friend Mpfr log(const Mpfr& x) noexcept { return of(mpfr_log, x); }
  friend Mpfr asin(const Mpfr& x) noexcept { return of(mpfr_asin, x); }
  friend Mpfr acos(const Mpfr& x) noexcept { return of(mpfr_acos, x); }
  friend Mpfr atan(const Mpfr& x) noexcept { return of(mpfr_atan, x); }
  friend Mpfr floor(const Mpfr& x) noexcept {
    return made([&](mpfr_ptr to) { mpfr_floor(to, static_cast<mpfr_srcptr>(View(x))); });
  }
  friend Mpfr atan2(const Mpfr& y, const Mpfr& x) noexcept { return of(mpfr_atan2, y, x); }
  friend Mpfr fma(const Mpfr& a, const Mpfr& b, const Mpfr& c) noexcept {
    return of(mpfr_fma, a, b, c);
  }

 private:
  static constexpr mpfr_rnd_t rounding = MPFR_RNDN;
  static constexpr std::size_t limbs =
      (static_cast<std::size_t>(bits) + GMP_NUMB_BITS - 1) / GMP_NUMB_BITS;

  /// A number as MPFR's functions take it.
  class View {
   public:
    explicit View(const Mpfr& x) noexcept {
      // MPFR has no pointer to limbs that it promises not to write; a source is only read.
      mpfr_custom_init_set(x_, x.kind_, x.exponent_, bits, const_cast<mp_limb_t*>(x.limbs_.data()));
    }
    operator mpfr_srcptr() const noexcept { return x_; }
    operator mpfr_ptr() noexcept { return x_; }

   private:
    mpfr_t x_;
  };

  // Apart from `operator==`, which defaulted comparisons of constexpr types call.
  [[nodiscard]] static bool equal(const Mpfr& a, const Mpfr& b) noexcept {
    return mpfr_equal_p(View(a), View(b)) != 0;
  }

  template <class Set>
  void set(const Set& to_value) noexcept {
    View to(*this);
    to_value(static_cast<mpfr_ptr>(to));
    kind_ = mpfr_custom_get_kind(static_cast<mpfr_ptr>(to));
    exponent_ = mpfr_custom_get_exp(static_cast<mpfr_ptr>(to));
  }

  template <class Set>
  [[nodiscard]] static Mpfr made(const Set& to_value) noexcept {
    Mpfr result;
    result.set(to_value);
    return result;
  }

  template <class Function, class... Number>
  [[nodiscard]] static Mpfr of(Function function, const Number&... x) noexcept {
    return made([&](mpfr_ptr to) { function(to, static_cast<mpfr_srcptr>(View(x))..., rounding); });
  }

  int kind_ = MPFR_ZERO_KIND;
  mpfr_exp_t exponent_ = 0;
  std::array<mp_limb_t, limbs> limbs_{};
};

template <int decimal_digits>
struct scalar::Limits<Mpfr<decimal_digits>> {
  static constexpr int digits = Mpfr<decimal_digits>::bits;
  static constexpr int max_exponent = std::numeric_limits<int>::max();
  static Mpfr<decimal_digits> epsilon() noexcept {
    return Mpfr<decimal_digits>::power_of_two(1 - digits);
  }
  /// A number larger than any that means something: the largest has 2^62 bits before the point.
  static Mpfr<decimal_digits> max() noexcept {
    return Mpfr<decimal_digits>::power_of_two(max_exponent);
  }
};

}  // namespace hamotor
