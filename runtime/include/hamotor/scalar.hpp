// The scalar operations that generated kernels are written in.
//
// Kernels are templates over a scalar S: float, double, long double, __float128, MPFR's numbers
// (mpfr.hpp), an exact integer or rational, a pack of lanes.  Everything they need beyond + - * /
// stands here, once, so that a scalar type is adapted in one place.
#pragma once

#include <bit>
#include <cfloat>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

#if defined(__SIZEOF_FLOAT128__) && LDBL_MANT_DIG != 113
#define HAMOTOR_HAS_QUADMATH 1
#if __has_include(<quadmath.h>)
#include <quadmath.h>
#else
// clang does not see the header, which is g++'s own, but links with the library.
extern "C" {
__extension__ __float128 sqrtq(__float128) noexcept;
__extension__ __float128 sinq(__float128) noexcept;
__extension__ __float128 cosq(__float128) noexcept;
__extension__ __float128 tanq(__float128) noexcept;
__extension__ __float128 sinhq(__float128) noexcept;
__extension__ __float128 coshq(__float128) noexcept;
__extension__ __float128 tanhq(__float128) noexcept;
__extension__ __float128 asinhq(__float128) noexcept;
__extension__ __float128 expq(__float128) noexcept;
__extension__ __float128 logq(__float128) noexcept;
__extension__ __float128 asinq(__float128) noexcept;
__extension__ __float128 acosq(__float128) noexcept;
__extension__ __float128 atanq(__float128) noexcept;
__extension__ __float128 floorq(__float128) noexcept;
__extension__ __float128 atan2q(__float128, __float128) noexcept;
__extension__ __float128 fmaq(__float128, __float128, __float128) noexcept;
__extension__ __float128 strtoflt128(const char*, char**) noexcept;
int quadmath_snprintf(char*, std::size_t, const char*, ...) noexcept;
}
#endif
#endif

/// Marks a function that is always inlined where the compiler optimises.
///
/// The compilers weigh size only, and leave a motor product as a call.  Its result then returns
/// through memory, written by component and read back as one vector, for which a processor waits:
/// with g++ 12 a chain of products takes 2.5 times as long, and arrays of them are not vectorised.
#if defined(__GNUC__) && defined(__OPTIMIZE__)
#define HAMOTOR_INLINE [[gnu::always_inline]]
#else
#define HAMOTOR_INLINE
#endif

/// Marks one that is so in ensembles: larger ones only pay where states are packs, which go through
/// memory for a call.
#ifdef HAMOTOR_ENSEMBLE
#define HAMOTOR_INLINE_IN_ENSEMBLES HAMOTOR_INLINE
#else
#define HAMOTOR_INLINE_IN_ENSEMBLES
#endif

/// With HAMOTOR_FUSED multiply-adds are rounded once on every processor, by the C library's
/// function where it has no instruction for them (ten times slower), so that the bits are the same
/// on all.
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA) || defined(HAMOTOR_FUSED)
#define HAMOTOR_FUSES 1
#endif

namespace hamotor {

/// a b + c in a fixed order: one rounding where the hardware has a fused multiply-add or
/// HAMOTOR_FUSED is defined, else two.  The only customisation point of the products.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S mul_add(const S& a, const S& b, const S& c) noexcept {
  // A scalar's own, which it cannot bring as an overload: kernels call this one by its full name.
  if constexpr (requires { S::multiply_add(a, b, c); }) return S::multiply_add(a, b, c);
#ifdef HAMOTOR_FUSES
#if defined(__clang__)
  // clang does not evaluate the builtin at compile time; constants are rounded twice there.
  if (std::is_constant_evaluated()) return a * b + c;
#endif
  if constexpr (std::is_same_v<S, double>) {
    return __builtin_fma(a, b, c);
  } else if constexpr (std::is_same_v<S, float>) {
    return __builtin_fmaf(a, b, c);
  } else {
    return a * b + c;
  }
#else
  return a * b + c;
#endif
}

/// c − a b, rounded as mul_add(−a, b, c).  Of a pack, one instruction also where −a is in several
/// sums: there the compiler would make −a by itself first.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S less_product(const S& a, const S& b, const S& c) noexcept {
  if constexpr (requires { S::less_product(a, b, c); }) {
    return S::less_product(a, b, c);
  } else {
    return mul_add(-a, b, c);
  }
}

/// sum + a₁ b₁ + a₂ b₂ + …, in one sum: no addition but those of the products, as becomes lanes,
/// where other blocks' operations fill the time in which these wait.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S onto(const S& sum) noexcept {
  return sum;
}
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S onto(const S& sum, const S& a, const S& b,
                                              const Rest&... rest) noexcept {
  return onto(mul_add(a, b, sum), rest...);
}

/// sum − a₁ b₁ − a₂ b₂ − ….
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S less(const S& sum) noexcept {
  return sum;
}
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S less(const S& sum, const S& a, const S& b,
                                              const Rest&... rest) noexcept {
  return less(less_product(a, b, sum), rest...);
}

namespace detail {

template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_in_turn(const S& odd, const S& even) noexcept {
  return odd + even;
}

template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_in_turn(const S& odd, const S& even, const S& a,
                                                     const S& b) noexcept {
  return mul_add(a, b, odd) + even;
}

template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_in_turn(const S& odd, const S& even, const S& a,
                                                     const S& b, const S& c, const S& d,
                                                     const Rest&... rest) noexcept {
  return dot_in_turn(mul_add(a, b, odd), mul_add(c, d, even), rest...);
}

template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_in_four(const S& first, const S& second,
                                                     const S& third, const S& fourth) noexcept {
  return (first + second) + (third + fourth);
}

template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_in_four(const S& first, const S& second,
                                                     const S& third, const S& fourth, const S& a,
                                                     const S& b, const Rest&... rest) noexcept {
  return dot_in_four(second, third, fourth, mul_add(a, b, first), rest...);
}

template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_in_four(const S& first, const S& second,
                                                     const S& third, const S& fourth, const S& a,
                                                     const S& b, const S& c, const S& d, const S& e,
                                                     const S& f, const S& g, const S& h,
                                                     const Rest&... rest) noexcept {
  return dot_in_four(mul_add(a, b, first), mul_add(c, d, second), mul_add(e, f, third),
                     mul_add(g, h, fourth), rest...);
}

template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_of_products(const S& a, const S& b,
                                                         const Rest&... rest) noexcept {
  return onto(a * b, rest...);
}

template <class S, class... Rest>
  requires(sizeof...(Rest) >= 4 && sizeof...(Rest) <= 12)
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_of_products(const S& a, const S& b, const S& c,
                                                         const S& d, const Rest&... rest) noexcept {
  return dot_in_turn(a * b, c * d, rest...);
}

template <class S, class... Rest>
  requires(sizeof...(Rest) >= 10)
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_of_products(const S& a, const S& b, const S& c,
                                                         const S& d, const S& e, const S& f,
                                                         const S& g, const S& h,
                                                         const Rest&... rest) noexcept {
  return dot_in_four(a * b, c * d, e * f, g * h, rest...);
}

template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_from(const S& x, const Rest&... rest) noexcept {
  return onto(x, rest...);
}

template <class S, class... Rest>
  requires(sizeof...(Rest) >= 6 && sizeof...(Rest) <= 14)
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_from(const S& x, const S& a, const S& b,
                                                  const Rest&... rest) noexcept {
  return dot_in_turn(x, a * b, rest...);
}

template <class S, class... Rest>
  requires(sizeof...(Rest) >= 12)
[[nodiscard]] HAMOTOR_INLINE constexpr S dot_from(const S& x, const S& a, const S& b, const S& c,
                                                  const S& d, const S& e, const S& f,
                                                  const Rest&... rest) noexcept {
  return dot_in_four(x, a * b, c * d, e * f, rest...);
}

}  // namespace detail

/// a₁ b₁ + a₂ b₂ + … by multiply-adds in this order; from four products on, as two sums of every
/// other product, a₁ b₁ + a₃ b₃ + … and a₂ b₂ + a₄ b₄ + …: half as many operations wait for each
/// other, and a chain of motor products takes two thirds of the time.  From nine products on, as
/// four sums, (1 + 2) + (3 + 4): no product of up to sixteen is rounded more than six times.
/// With an odd number of arguments the first one is added, as if it were the first product.
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S dot(const S& x, const Rest&... rest) noexcept {
  if constexpr (sizeof...(Rest) % 2 == 0) {
    return detail::dot_from(x, rest...);
  } else {
    return detail::dot_of_products(x, rest...);
  }
}

/// `a` where the condition holds, else `b`: both are evaluated, so that lanes share one text.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S select(bool condition, const S& a, const S& b) noexcept {
  return condition ? a : b;
}

/// Whether a condition holds for all of a scalar's numbers, and for any: of a pack's lanes, or of
/// the one number that other scalars are.
[[nodiscard]] HAMOTOR_INLINE constexpr bool all(bool condition) noexcept { return condition; }
[[nodiscard]] HAMOTOR_INLINE constexpr bool any(bool condition) noexcept { return condition; }

/// Whether `mul_add` rounds once for double.
#ifdef HAMOTOR_FUSES
inline constexpr bool has_fused_multiply_add = true;
#else
inline constexpr bool has_fused_multiply_add = false;
#endif

/// An unevaluated sum hi + lo, |lo| ≤ ulp(hi)/2: about twice the digits of S.
template <class S>
struct DoubleWord {
  S hi;
  S lo;
};

/// Sine and cosine of one angle.
template <class S>
struct Turn {
  S sin;
  S cos;
};

namespace scalar {

// The functions that kernels call.  Another scalar type brings its own, found by argument-dependent
// lookup; __float128 has those of libquadmath where g++ has its header (link with -lquadmath).
#define HAMOTOR_FUNCTION(name)                          \
  template <class S>                                    \
  [[nodiscard]] constexpr S name(const S& x) noexcept { \
    using std::name;                                    \
    return name(x);                                     \
  }
HAMOTOR_FUNCTION(sqrt)
HAMOTOR_FUNCTION(sin)
HAMOTOR_FUNCTION(cos)
HAMOTOR_FUNCTION(tan)
HAMOTOR_FUNCTION(sinh)
HAMOTOR_FUNCTION(cosh)
HAMOTOR_FUNCTION(tanh)
HAMOTOR_FUNCTION(asinh)
HAMOTOR_FUNCTION(exp)
HAMOTOR_FUNCTION(log)
HAMOTOR_FUNCTION(asin)
HAMOTOR_FUNCTION(acos)
HAMOTOR_FUNCTION(atan)
HAMOTOR_FUNCTION(floor)
#undef HAMOTOR_FUNCTION

template <class S>
[[nodiscard]] constexpr S atan2(const S& y, const S& x) noexcept {
  using std::atan2;
  return atan2(y, x);
}

/// A number that is the same in every step: one that counts need not count what is found of such
/// numbers alone.
template <class S, class Number>
[[nodiscard]] constexpr S fixed(const Number& x) noexcept {
  if constexpr (requires { S::fixed(1.0); }) {
    return S::fixed(static_cast<double>(x));
  } else {
    return static_cast<S>(x);
  }
}

/// a b + c, rounded once.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S fma(const S& a, const S& b, const S& c) noexcept {
  using std::fma;
  return fma(a, b, c);
}

/// std::numeric_limits, and those of __float128, which not every library gives.
template <class S>
struct Limits : std::numeric_limits<S> {};

namespace detail {
template <class S>
struct Number {
  using type = S;
};
template <class S>
  requires requires { typename S::Number; }
struct Number<S> {
  using type = typename S::Number;
};
}  // namespace detail

/// What a scalar holds one or several of: a pack's lanes, otherwise itself.
template <class S>
using NumberOf = typename detail::Number<S>::type;
template <class S>
inline constexpr bool has_lanes = !std::is_same_v<NumberOf<S>, S>;

/// The numbers that `f` gives for each lane's, gathered: of formulas that fall into cases.
/// `Result<S>::numbers()` is a tuple of references to its numbers.
template <template <class> class Result, class Function, class S, class... More>
  requires has_lanes<S>
[[nodiscard]] constexpr Result<S> by_lane(const Function& f, const S& x,
                                          const More&... more) noexcept {
  Result<S> gathered;
  constexpr auto places =
      std::make_index_sequence<std::tuple_size_v<decltype(gathered.numbers())>>{};
  [&]<std::size_t... i>(std::index_sequence<i...>) {
    ((std::get<i>(gathered.numbers()) = S(0)), ...);
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      Result<NumberOf<S>> one = f(x[lane], more[lane]...);
      (std::get<i>(gathered.numbers()).set(lane, std::get<i>(one.numbers())), ...);
    }
  }(places);
  return gathered;
}

/// Whether squares of numbers and of their inverses overflow only where nothing is meant by them.
template <class S>
inline constexpr bool has_boundless_exponents = Limits<S>::max_exponent > (1 << 20);

#ifdef HAMOTOR_HAS_QUADMATH
__extension__ using Float128 = __float128;

inline Float128 sqrt(const Float128& x) noexcept { return sqrtq(x); }
inline Float128 sin(const Float128& x) noexcept { return sinq(x); }
inline Float128 cos(const Float128& x) noexcept { return cosq(x); }
inline Float128 tan(const Float128& x) noexcept { return tanq(x); }
inline Float128 sinh(const Float128& x) noexcept { return sinhq(x); }
inline Float128 cosh(const Float128& x) noexcept { return coshq(x); }
inline Float128 tanh(const Float128& x) noexcept { return tanhq(x); }
inline Float128 asinh(const Float128& x) noexcept { return asinhq(x); }
inline Float128 exp(const Float128& x) noexcept { return expq(x); }
inline Float128 log(const Float128& x) noexcept { return logq(x); }
inline Float128 asin(const Float128& x) noexcept { return asinq(x); }
inline Float128 acos(const Float128& x) noexcept { return acosq(x); }
inline Float128 atan(const Float128& x) noexcept { return atanq(x); }
inline Float128 floor(const Float128& x) noexcept { return floorq(x); }
inline Float128 atan2(const Float128& y, const Float128& x) noexcept { return atan2q(y, x); }
inline Float128 fma(const Float128& a, const Float128& b, const Float128& c) noexcept {
  return fmaq(a, b, c);
}

template <>
struct Limits<Float128> {
  static constexpr int digits = 113;
  static constexpr int max_exponent = 16384;
  static constexpr Float128 epsilon() noexcept { return Float128(0x1p-112L); }
  static constexpr Float128 max() noexcept {
    return (Float128(2) - epsilon()) * Float128(0x1p+16383L);
  }
};

/// The scalar of 113 bits.
using Quad = Float128;
#define HAMOTOR_HAS_QUAD 1
#elif LDBL_MANT_DIG == 113
using Quad = long double;
#define HAMOTOR_HAS_QUAD 1
#endif

namespace detail {

template <class Make>
inline constexpr bool is_made_by_compiler =
    requires { typename std::bool_constant<(static_cast<void>(Make{}()), true)>; };

template <class S>
struct Two {
  constexpr S operator()() const noexcept { return S(1) + S(1); }
};

template <class Make>
[[nodiscard]] const auto& made_once() noexcept {
  static const auto value = Make{}();
  return value;
}

}  // namespace detail

/// What a lambda without captures makes: by the compiler, or once at run time for numbers that it
/// cannot calculate with (MPFR's).
template <class Make>
[[nodiscard]] constexpr auto constant(const Make&) noexcept {
  if constexpr (detail::is_made_by_compiler<Make>) {
    constexpr auto value = Make{}();
    return value;
  } else {
    return detail::made_once<Make>();
  }
}

/// Whether the compiler calculates with numbers of this type.
template <class S>
inline constexpr bool is_literal = detail::is_made_by_compiler<detail::Two<S>>;

namespace detail {

/// 10^n, exact while 5^n has no more digits than S.
template <class S>
[[nodiscard]] constexpr S power_of_ten(int n) noexcept {
  S result(1);
  for (; n > 0; --n) result = result * S(10);
  return result;
}

}  // namespace detail

/// The number that a decimal stands for, [-]digits[.digits][E[-]digits], within a unit in the last
/// place of __float128: of its first 60 digits.  Wider scalars bring a `from_text` of their own.
template <class S>
[[nodiscard]] constexpr S decimal(std::string_view text) noexcept {
  constexpr int piece = 30;  // 10^30 < 2^113
  const bool negative = text.front() == '-';
  S high(0);
  S low(0);
  int digits = 0;
  int scale = 0;
  bool fraction = false;
  std::size_t at = negative ? 1 : 0;
  for (; at < text.size() && text[at] != 'e' && text[at] != 'E'; ++at) {
    if (text[at] == '.') {
      fraction = true;
      continue;
    }
    S& part = digits < piece ? high : low;
    if (digits < 2 * piece) {
      part = part * S(10) + S(text[at] - '0');
      scale -= fraction ? 1 : 0;
      digits += digits > 0 || text[at] != '0' ? 1 : 0;
    } else {
      scale += fraction ? 0 : 1;
    }
  }
  if (at < text.size()) {
    int exponent = 0;
    const bool down = text[at + 1] == '-';
    for (at += down || text[at + 1] == '+' ? 2 : 1; at < text.size(); ++at) {
      exponent = 10 * exponent + (text[at] - '0');
    }
    scale += down ? -exponent : exponent;
  }
  S value = high;
  if (digits > piece) {
    // Joined below the point, where both are as wide as S at most.
    value = high + low / detail::power_of_ten<S>(digits - piece);
    scale += digits - piece;
  }
  constexpr int most = 48;  // 5^48 < 2^113
  for (; scale > most; scale -= most) value = value * detail::power_of_ten<S>(most);
  for (; scale < -most; scale += most) value = value / detail::power_of_ten<S>(most);
  value =
      scale < 0 ? value / detail::power_of_ten<S>(-scale) : value * detail::power_of_ten<S>(scale);
  return negative ? -value : value;
}

/// A constant of generated code: `rounded` where S has no more digits than long double, or else
/// what `Text{}()`, its decimal, stands for.
template <class S, class Text>
[[nodiscard]] constexpr S number(long double rounded, const Text&) noexcept {
  if constexpr (Limits<S>::digits <= std::numeric_limits<long double>::digits) {
    return static_cast<S>(rounded);
  } else if constexpr (is_literal<S>) {
    return constant([] { return decimal<S>(Text{}()); });
  } else {
    return constant([] { return S::from_text(Text{}()); });
  }
}

template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S abs(const S& x) noexcept {
  if constexpr (std::is_same_v<S, double>) {
    return __builtin_fabs(x);
  } else if constexpr (std::is_same_v<S, float>) {
    return __builtin_fabsf(x);
  } else if constexpr (requires { S::magnitude(x); }) {
    return S::magnitude(x);
  } else {
    return select(x < S(0), -x, x);
  }
}

/// −1, 0 or 1.
template <class S>
[[nodiscard]] constexpr S sign(const S& x) noexcept {
  return select(x > S(0), S(1), select(x < S(0), S(-1), S(0)));
}

/// Largest of the absolute values.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S max_abs(const S& x) noexcept {
  return abs(x);
}

template <class S, std::same_as<S>... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S max_abs(const S& x, const S& y,
                                                 const Rest&... rest) noexcept {
  const S a = abs(x);
  const S b = abs(y);
  const S larger = select(a > b, a, b);
  if constexpr (sizeof...(Rest) == 0) {
    return larger;
  } else {
    const S others = max_abs(rest...);
    return select(larger > others, larger, others);
  }
}

/// log₂ x of an x > 0 within 0.09, a large number if x is none: between powers of two a straight
/// line.  For lengths of steps: what is chosen by it is the same with every compiler and library.
template <class S>
[[nodiscard]] constexpr S rough_log2(const S& x) noexcept {
  if constexpr (std::is_same_v<S, double>) {
    return mul_add(static_cast<double>(std::bit_cast<std::int64_t>(x)), 0x1p-52, -1023.0);
  } else if constexpr (std::is_same_v<S, float>) {
    return static_cast<float>(rough_log2(static_cast<double>(x)));
  } else if constexpr (requires { S::rough_log2(x); }) {
    return S::rough_log2(x);
  } else {
    return log(x) / log(S(2));
  }
}

/// 2ˣ within a part of 2e-4, of x from −1022 to 1023; for the same.
template <class S>
[[nodiscard]] constexpr S rough_exp2(const S& x) noexcept {
  if constexpr (std::is_same_v<S, double>) {
    const double above = select(x > -1022, x, -1022.0);
    const double within = select(above < 1023, above, 1023.0);
    const int whole = static_cast<int>(within + 1023);
    const double t = within + 1023 - whole;
    const double power = std::bit_cast<double>(static_cast<std::uint64_t>(whole) << 52);
    const double bend = mul_add(t, -0.07924492, -0.30410988);
    return power * mul_add(t * (1 - t), bend, 1 + t);
  } else if constexpr (std::is_same_v<S, float>) {
    return static_cast<float>(rough_exp2(static_cast<double>(x)));
  } else if constexpr (requires { S::rough_exp2(x); }) {
    return S::rough_exp2(x);
  } else {
    return exp(x * log(S(2)));
  }
}

/// π, correctly rounded to S.
template <class S>
[[nodiscard]] constexpr S pi() noexcept {
  if constexpr (requires { S::pi(); }) {
    return S::pi();
  } else if constexpr (Limits<S>::digits > std::numeric_limits<long double>::digits) {
    // Three doubles, of which the first two are exact in 106 bits.
    return S(0x1.921fb54442d18p+1L) + S(0x1.1a62633145c07p-53L) - S(0x1.f1976b7ed8fbcp-109L);
  } else {
    return S(3.141592653589793238462643383279502884L);
  }
}

/// 2^exponent, exact.
template <class S>
[[nodiscard]] constexpr S power_of_two(int exponent) noexcept {
  S result(1);
  const S factor = exponent < 0 ? S(0.5) : S(2);
  for (int i = exponent < 0 ? -exponent : exponent; i > 0; --i) result = result * factor;
  return result;
}

/// Powers of two that bring numbers of a size into and out of the range where their squares and
/// products neither overflow nor lose digits: all 1 almost always.  The roots are for factors that
/// would themselves overflow: x `out` = (x `root_out`) `root_out`.
template <class S>
struct Scaling {
  S in;
  S out;
  S root_in;
  S root_out;
};

/// The scaling for numbers of which `largest` has the largest absolute value; denormal or not.
template <class S>
[[nodiscard]] constexpr Scaling<S> scaling(const S& largest) noexcept {
  if constexpr (has_boundless_exponents<S>) {
    return {S(1), S(1), S(1), S(1)};
  } else {
    constexpr int half = Limits<S>::max_exponent / 2;
    constexpr int shrink = half + 4;
    constexpr int grow = half + 2 * Limits<S>::digits;
    constexpr S large = power_of_two<S>(half - 4);
    constexpr S small = power_of_two<S>(12 - half);
    constexpr Scaling<S> from_large{power_of_two<S>(-shrink), power_of_two<S>(shrink),
                                    power_of_two<S>(-shrink / 2), power_of_two<S>(shrink / 2)};
    constexpr Scaling<S> from_small{power_of_two<S>(grow), power_of_two<S>(-grow),
                                    power_of_two<S>(grow / 2), power_of_two<S>(-grow / 2)};
    // Not selects alone: by a branch that is foreseen a processor goes on as if none were scaled.
    if (all(largest < large) && all(largest > small)) [[likely]] {
      return {S(1), S(1), S(1), S(1)};
    }
    const auto choose = [&](const S& if_large, const S& if_small) {
      return select(largest > large, if_large, select(largest < small, if_small, S(1)));
    };
    return {choose(from_large.in, from_small.in), choose(from_large.out, from_small.out),
            choose(from_large.root_in, from_small.root_in),
            choose(from_large.root_out, from_small.root_out)};
  }
}

/// By how much of its size rounding may have changed a number, after a few operations: 256 ε.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S rounding() noexcept {
  return S(256) * S(Limits<S>::epsilon());
}

/// What is far from overflow, also multiplied with itself or divided by ε: 1/ε⁴, 2·10⁶² of doubles.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S moderate() noexcept {
  const S square = S(Limits<S>::epsilon()) * S(Limits<S>::epsilon());
  return S(1) / (square * square);
}

namespace detail {

template <class Make>
[[nodiscard, gnu::cold, gnu::noinline]] constexpr auto aside(const Make& make) noexcept {
  return make();
}

}  // namespace detail

/// Whether a condition holds in all lanes.
template <class Condition>
[[nodiscard]] HAMOTOR_INLINE constexpr bool everywhere(const Condition& condition) noexcept {
  return all(condition);
}

/// `usual()` in the lanes where the condition holds, which are not all, else `other()`.
template <class Condition, class Usual, class Other>
[[nodiscard]] HAMOTOR_INLINE constexpr auto chosen(const Condition& condition, const Usual& usual,
                                                   const Other& other) noexcept {
  const auto general = detail::aside(other);
  if constexpr (std::is_same_v<Condition, bool>) {
    return general;
  } else {
    auto numbers = general.components();
    const auto usual_ones = detail::aside(usual).components();
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      numbers[i] = select(condition, usual_ones[i], numbers[i]);
    }
    return general.from(numbers);
  }
}

/// √(x² + y²), whose squares neither overflow nor vanish.
template <class S>
[[nodiscard]] constexpr S length(const S& x, const S& y) noexcept {
  const Scaling<S> scale = scaling(max_abs(x, y));
  const S a = scale.in * x;
  const S b = scale.in * y;
  return scale.out * sqrt(mul_add(a, a, b * b));
}

/// The rounding error of a product: a b = product + product_error exactly (barring underflow).
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S product_error(const S& a, const S& b,
                                                       const S& product) noexcept {
  if constexpr (std::is_same_v<S, long double> && std::numeric_limits<S>::digits == 64) {
    // No processor fuses 80-bit numbers, and a library's fmal takes 200 ns: in halves (Dekker
    // 1971), unless they would overflow.
    constexpr S bound = power_of_two<S>(8000);
    if (abs(a) < bound && abs(b) < bound) {
      constexpr S splitter = power_of_two<S>(32) + S(1);
      const S a_hi = splitter * a - (splitter * a - a);
      const S b_hi = splitter * b - (splitter * b - b);
      const S a_lo = a - a_hi;
      const S b_lo = b - b_hi;
      return a_lo * b_lo - (((product - a_hi * b_hi) - a_lo * b_hi) - a_hi * b_lo);
    }
  }
  return scalar::fma(a, b, -product);
}

/// a + b as an exact double-word (Knuth's two-sum).
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr DoubleWord<S> two_sum(const S& a, const S& b) noexcept {
  const S sum = a + b;
  const S shadow = sum - a;
  return {sum, (a - (sum - shadow)) + (b - shadow)};
}

/// a + b + … as if computed in twice the precision and rounded once (Ogita et al. 2005, Sum2).
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S compensated_sum(const S& a, const Rest&... rest) noexcept {
  S sum = a;
  S low(0);
  const auto add = [&](const S& x) {
    const auto total = two_sum(sum, x);
    sum = total.hi;
    low = low + total.lo;
  };
  (add(rest), ...);
  return sum + low;
}

namespace detail {

template <class S>
HAMOTOR_INLINE constexpr void accumulate(S&, S&) noexcept {}

template <class S, class... Rest>
HAMOTOR_INLINE constexpr void accumulate(S& sum, S& low, const S& a, const S& b,
                                         const Rest&... rest) noexcept {
  const S product = a * b;
  const auto total = two_sum(sum, product);
  sum = total.hi;
  low = low + (total.lo + product_error(a, b, product));
  accumulate(sum, low, rest...);
}

}  // namespace detail

/// a₁ b₁ + a₂ b₂ + … to about twice the working precision, as the sum that is rounded at every
/// term, known early, and what that lost: of squares, up to 2 ulp.
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr DoubleWord<S> compensated_dot_parts(
    const S& a, const S& b, const Rest&... rest) noexcept {
  S sum = a * b;
  S low = product_error(a, b, sum);
  detail::accumulate(sum, low, rest...);
  return {sum, low};
}

/// a₁ b₁ + a₂ b₂ + … to about twice the working precision (Ogita, Rump & Oishi 2005, Dot2).
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr DoubleWord<S> compensated_dot_pair(
    const S& a, const S& b, const Rest&... rest) noexcept {
  const auto parts = compensated_dot_parts(a, b, rest...);
  return two_sum(parts.hi, parts.lo);
}

/// a₁ b₁ + a₂ b₂ + … as if computed in twice the precision and rounded once.
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S compensated_dot(const S& a, const S& b,
                                                         const Rest&... rest) noexcept {
  return compensated_dot_pair(a, b, rest...).hi;
}

/// a₁ b₁ + a₂ b₂ + …: `compensated_dot` where `needed` > 0, `dot` elsewhere.  By a branch: where
/// digits cancel is foreseen, and the compensated sum takes four times as long.
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S compensated_dot_where(const S& needed,
                                                               const Rest&... rest) noexcept {
  const auto where = needed > S(0);
  const S plain = dot(rest...);
  if (!any(where)) [[likely]]
    return plain;
  return select(where, compensated_dot(rest...), plain);
}

/// √x as √hi, known early, and what that leaves; 0 for 0.  The low part of x may be some ulp.
template <class S>
[[nodiscard]] constexpr DoubleWord<S> double_word_sqrt_parts(const DoubleWord<S>& x) noexcept {
  const S root = sqrt(x.hi);
  const S rest = -product_error(root, root, x.hi) + x.lo;
  return {root, select(root > S(0), rest / (root + root), S(0))};
}

/// √x of a double-word number ≥ 0; 0 for 0.  The low part of x may be some ulp.
template <class S>
[[nodiscard]] constexpr DoubleWord<S> double_word_sqrt(const DoubleWord<S>& x) noexcept {
  const auto parts = double_word_sqrt_parts(x);
  return two_sum(parts.hi, parts.lo);
}

/// x times a power of two; what would overflow becomes the largest number.
template <class S>
[[nodiscard]] constexpr DoubleWord<S> double_word_scaled(const DoubleWord<S>& x,
                                                         const S& power) noexcept {
  const S hi = x.hi * power;
  if constexpr (has_boundless_exponents<S>) {
    return {hi, x.lo * power};
  } else {
    constexpr S largest = Limits<S>::max();
    return {select(hi > largest, largest, hi), x.lo * power};
  }
}

/// a b of double-word numbers, to about twice the working precision.
template <class S>
[[nodiscard]] constexpr DoubleWord<S> double_word_product(const DoubleWord<S>& a,
                                                          const DoubleWord<S>& b) noexcept {
  const S product = a.hi * b.hi;
  const S rest = product_error(a.hi, b.hi, product) + mul_add(a.hi, b.lo, a.lo * b.hi);
  return two_sum(product, rest);
}

/// 1 / x of a double-word number, to about twice the working precision.
template <class S>
[[nodiscard]] constexpr DoubleWord<S> double_word_reciprocal(const DoubleWord<S>& x) noexcept {
  const S quotient = S(1) / x.hi;
  const S rest = -product_error(quotient, x.hi, S(1)) - quotient * x.lo;
  return two_sum(quotient, quotient * rest);
}

/// a / b of double-word numbers, to about twice the working precision.
template <class S>
[[nodiscard]] constexpr DoubleWord<S> double_word_ratio(const DoubleWord<S>& a,
                                                        const DoubleWord<S>& b) noexcept {
  const S quotient = a.hi / b.hi;
  const S rest = -product_error(quotient, b.hi, a.hi);
  return two_sum(quotient, (rest + a.lo - quotient * b.lo) / b.hi);
}

/// sin and cos of a double-word angle, each as accurate as the scalar's own sin and cos up to
/// angles of about 1/(8 ε); beyond, of an angle that agrees in its leading word.  The low part may
/// be some ulp: a branch, not a select, lets a processor start with the leading word at once.
template <class S>
[[nodiscard]] constexpr Turn<S> sin_cos(DoubleWord<S> angle) noexcept {
  const S moderate = constant([] { return power_of_two<S>(Limits<S>::digits - 8); });
  if (const auto small = abs(angle.hi) < moderate; !all(small)) {
    // A low part that is larger still is not used, and could overflow the sum.
    const auto sum = two_sum(angle.hi, select(abs(angle.lo) < S(4), angle.lo, S(0)));
    angle = {select(small, angle.hi, sum.hi), select(small, angle.lo, sum.lo)};
  }
  const S sine = sin(angle.hi);
  const S cosine = cos(angle.hi);
  // At most 1/16 up to angles of 1/(8 ε): four terms of each series are enough.
  const S lo = select(abs(angle.lo) < S(0.75), angle.lo, S(0));
  const S square = lo * lo;
  const S sine_tail =
      mul_add(square, mul_add(square, S(-1) / S(5040), S(1) / S(120)), S(-1) / S(6));
  const S cosine_tail =
      mul_add(square, mul_add(square, S(1) / S(40320), S(-1) / S(720)), S(1) / S(24));
  const S sine_lo = mul_add(lo * square, sine_tail, lo);
  const S cosine_lo_less_1 = square * mul_add(square, cosine_tail, S(-1) / S(2));
  return {mul_add(sine_lo, cosine, mul_add(cosine_lo_less_1, sine, sine)),
          mul_add(-sine_lo, sine, mul_add(cosine_lo_less_1, cosine, cosine))};
}

}  // namespace scalar
}  // namespace hamotor
