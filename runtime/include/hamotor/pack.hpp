// Lanes: W numbers as one scalar, a body in each.
//
// Kernels, systems and steppers are written for any scalar, and a pack is one: every operation acts
// on each lane as on a single number, with the same rounding, so that a lane's bits depend neither
// on the others nor on how many there are.  Where a formula depends on a number, packs evaluate
// what any lane needs and `select`.
#pragma once

#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>
#include <utility>

#include "hamotor/angle_increment.hpp"
#include "hamotor/scalar.hpp"

#if defined(__x86_64__) && defined(__FMA__) && defined(__GNUC__)
#include <immintrin.h>
#elif defined(__aarch64__) && defined(__ARM_NEON)
#include <arm_neon.h>
#endif

namespace hamotor {

/// Which of W lanes a condition holds in.
template <class T, std::size_t W>
class Mask;

/// W numbers of type T (float or double); W is a power of two, at most 64.
template <class T, std::size_t W>
class Pack {
  static_assert(std::same_as<T, float> || std::same_as<T, double>);
  static_assert(std::has_single_bit(W) && W <= 64);  // as many as a mask has bits

 public:
  using Number = T;
  using Bits = std::conditional_t<sizeof(T) == 8, std::int64_t, std::int32_t>;
  struct VectorOf {
    using type [[gnu::vector_size(W * sizeof(T))]] = T;
  };
  struct BitsOf {
    using type [[gnu::vector_size(W * sizeof(T))]] = Bits;
  };
  /// What the compiler keeps in a register; of one lane a plain number.
  struct Single {
    using type = T;
  };
  struct SingleBits {
    using type = Bits;
  };
  using Vector = typename std::conditional_t<W == 1, Single, VectorOf>::type;
  using BitVector = typename std::conditional_t<W == 1, SingleBits, BitsOf>::type;
  static constexpr std::size_t lanes = W;

  Pack() = default;
  HAMOTOR_INLINE constexpr Pack(const Pack& x) noexcept : v_(x.v_) {}
  /// The same number in every lane.
  template <class Number_>
    requires std::is_arithmetic_v<Number_>
  HAMOTOR_INLINE constexpr Pack(Number_ x) noexcept : v_(static_cast<T>(x) - Vector{}) {}
  HAMOTOR_INLINE constexpr explicit Pack(const Vector& v) noexcept
    requires(W > 1)
      : v_(v) {}
  HAMOTOR_INLINE constexpr Pack& operator=(const Pack& x) noexcept {
    v_ = x.v_;
    return *this;
  }

  [[nodiscard]] HAMOTOR_INLINE constexpr const Vector& vector() const noexcept { return v_; }

  [[nodiscard]] HAMOTOR_INLINE constexpr T operator[](std::size_t lane) const noexcept {
    if constexpr (W == 1) {
      return v_;
    } else {
      return v_[lane];
    }
  }
  HAMOTOR_INLINE constexpr void set(std::size_t lane, T x) noexcept {
    if constexpr (W == 1) {
      v_ = x;
    } else {
      v_[lane] = x;
    }
  }

  /// f of each lane's number.
  template <class Function, class... More>
  [[nodiscard]] static Pack each(const Function& f, const Pack& x, const More&... more) noexcept {
    Pack result;
    for (std::size_t k = 0; k < W; ++k) result.set(k, f(x[k], more[k]...));
    return result;
  }

  [[nodiscard]] HAMOTOR_INLINE friend constexpr Pack operator+(const Pack& a,
                                                               const Pack& b) noexcept {
    return Pack(a.v_ + b.v_);
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Pack operator-(const Pack& a,
                                                               const Pack& b) noexcept {
    return Pack(a.v_ - b.v_);
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Pack operator*(const Pack& a,
                                                               const Pack& b) noexcept {
    return Pack(a.v_ * b.v_);
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Pack operator/(const Pack& a,
                                                               const Pack& b) noexcept {
    return Pack(a.v_ / b.v_);
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Pack operator-(const Pack& a) noexcept {
    return Pack(-a.v_);
  }
  HAMOTOR_INLINE constexpr Pack& operator+=(const Pack& b) noexcept { return *this = *this + b; }
  HAMOTOR_INLINE constexpr Pack& operator-=(const Pack& b) noexcept { return *this = *this - b; }
  HAMOTOR_INLINE constexpr Pack& operator*=(const Pack& b) noexcept { return *this = *this * b; }
  HAMOTOR_INLINE constexpr Pack& operator/=(const Pack& b) noexcept { return *this = *this / b; }

  [[nodiscard]] HAMOTOR_INLINE friend constexpr Mask<T, W> operator<(const Pack& a,
                                                                     const Pack& b) noexcept {
    return Mask<T, W>(a.v_ < b.v_);
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Mask<T, W> operator<=(const Pack& a,
                                                                      const Pack& b) noexcept {
    return Mask<T, W>(a.v_ <= b.v_);
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Mask<T, W> operator>(const Pack& a,
                                                                     const Pack& b) noexcept {
    return Mask<T, W>(a.v_ > b.v_);
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Mask<T, W> operator>=(const Pack& a,
                                                                      const Pack& b) noexcept {
    return Mask<T, W>(a.v_ >= b.v_);
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Mask<T, W> operator==(const Pack& a,
                                                                      const Pack& b) noexcept {
    return Mask<T, W>(a.v_ == b.v_);
  }

  /// a b + c in each lane, rounded as `mul_add` of numbers.
  [[nodiscard]] HAMOTOR_INLINE static constexpr Pack multiply_add(const Pack& a, const Pack& b,
                                                                  const Pack& c) noexcept {
    if constexpr (has_fused_multiply_add) {
      if (!std::is_constant_evaluated()) return fused(a, b, c);
    }
    return a * b + c;
  }
  /// c − a b in each lane, rounded as `less_product` of numbers.
  [[nodiscard]] HAMOTOR_INLINE static constexpr Pack less_product(const Pack& a, const Pack& b,
                                                                  const Pack& c) noexcept {
#if defined(__x86_64__) && defined(__FMA__) && defined(__GNUC__)
    if (!std::is_constant_evaluated()) {
      if constexpr (std::same_as<T, double>) {
#ifdef __AVX512F__
        if constexpr (W == 8) return Pack(Vector(_mm512_fnmadd_pd(a.v_, b.v_, c.v_)));
#endif
        if constexpr (W == 4) return Pack(Vector(_mm256_fnmadd_pd(a.v_, b.v_, c.v_)));
        if constexpr (W == 2) return Pack(Vector(_mm_fnmadd_pd(a.v_, b.v_, c.v_)));
      } else {
#ifdef __AVX512F__
        if constexpr (W == 16) return Pack(Vector(_mm512_fnmadd_ps(a.v_, b.v_, c.v_)));
#endif
        if constexpr (W == 8) return Pack(Vector(_mm256_fnmadd_ps(a.v_, b.v_, c.v_)));
        if constexpr (W == 4) return Pack(Vector(_mm_fnmadd_ps(a.v_, b.v_, c.v_)));
      }
    }
#endif
    return multiply_add(-a, b, c);
  }
  /// a b + c in each lane, rounded once.
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Pack fma(const Pack& a, const Pack& b,
                                                         const Pack& c) noexcept {
    if constexpr (has_fused_multiply_add) {
      return fused(a, b, c);
    } else {
      return each([](T x, T y, T z) { return std::fma(x, y, z); }, a, b, c);
    }
  }

  [[nodiscard]] HAMOTOR_INLINE friend Pack sqrt(const Pack& x) noexcept {
#if defined(__x86_64__) && defined(__FMA__) && defined(__GNUC__)
    if constexpr (std::same_as<T, double>) {
#ifdef __AVX512F__
      if constexpr (W == 8) return Pack(Vector(_mm512_maskz_sqrt_pd(0xff, x.v_)));
#endif
      if constexpr (W == 4) return Pack(Vector(_mm256_sqrt_pd(x.v_)));
      if constexpr (W == 2) return Pack(Vector(_mm_sqrt_pd(x.v_)));
    } else {
#ifdef __AVX512F__
      if constexpr (W == 16) return Pack(Vector(_mm512_maskz_sqrt_ps(0xffff, x.v_)));
#endif
      if constexpr (W == 8) return Pack(Vector(_mm256_sqrt_ps(x.v_)));
      if constexpr (W == 4) return Pack(Vector(_mm_sqrt_ps(x.v_)));
    }
#endif
#if defined(__aarch64__) && defined(__ARM_NEON)
    if constexpr (std::same_as<T, double> && W == 2) return Pack(Vector(vsqrtq_f64(x.v_)));
    if constexpr (std::same_as<T, float> && W == 4) return Pack(Vector(vsqrtq_f32(x.v_)));
#endif
    return each([](T y) { return std::sqrt(y); }, x);
  }

  /// |x| in each lane.
  [[nodiscard]] HAMOTOR_INLINE static constexpr Pack magnitude(const Pack& x) noexcept {
    if constexpr (W == 1) {
      return Pack(scalar::abs<T>(x.v_));
    } else {
      const auto bits = reinterpret_cast<BitVector>(x.v_) & ~sign_bit;
      return Pack(reinterpret_cast<Vector>(bits));
    }
  }

  /// Where a number's binary representation has this bit, 0 the last.
  [[nodiscard]] HAMOTOR_INLINE static constexpr Mask<T, W> has_bit(const Pack& x,
                                                                   int place) noexcept {
    if constexpr (W == 1) {
      return Mask<T, W>((std::bit_cast<Bits>(x.v_) & (Bits{1} << place)) != 0);
    } else {
      return Mask<T, W>((reinterpret_cast<BitVector>(x.v_) & (Bits{1} << place)) != 0);
    }
  }

  /// The number that each lane's bits, moved up by so many places, represent.
  [[nodiscard]] HAMOTOR_INLINE static constexpr Pack bits_moved_up(const Pack& x,
                                                                   int places) noexcept {
    if constexpr (W == 1) {
      using Unsigned = std::make_unsigned_t<Bits>;
      return Pack(std::bit_cast<T>(std::bit_cast<Unsigned>(x.v_) << places));
    } else {
      return Pack(reinterpret_cast<Vector>(reinterpret_cast<BitVector>(x.v_) << places));
    }
  }

 private:
  static constexpr Bits sign_bit = static_cast<Bits>(Bits{1} << (8 * sizeof(T) - 1));

  [[nodiscard]] HAMOTOR_INLINE static Pack fused(const Pack& a, const Pack& b,
                                                 const Pack& c) noexcept {
    if constexpr (W == 1) {
      return Pack(hamotor::mul_add<T>(a.v_, b.v_, c.v_));
    } else {
#if defined(__x86_64__) && defined(__FMA__) && defined(__GNUC__)
      if constexpr (std::same_as<T, double>) {
#ifdef __AVX512F__
        if constexpr (W == 8) return Pack(Vector(_mm512_fmadd_pd(a.v_, b.v_, c.v_)));
#endif
        if constexpr (W == 4) return Pack(Vector(_mm256_fmadd_pd(a.v_, b.v_, c.v_)));
        if constexpr (W == 2) return Pack(Vector(_mm_fmadd_pd(a.v_, b.v_, c.v_)));
      } else {
#ifdef __AVX512F__
        if constexpr (W == 16) return Pack(Vector(_mm512_fmadd_ps(a.v_, b.v_, c.v_)));
#endif
        if constexpr (W == 8) return Pack(Vector(_mm256_fmadd_ps(a.v_, b.v_, c.v_)));
        if constexpr (W == 4) return Pack(Vector(_mm_fmadd_ps(a.v_, b.v_, c.v_)));
      }
#elif defined(__aarch64__) && defined(__ARM_NEON)
      if constexpr (std::same_as<T, double>) {
        if constexpr (W == 2) return Pack(Vector(vfmaq_f64(c.v_, a.v_, b.v_)));
      } else {
        if constexpr (W == 4) return Pack(Vector(vfmaq_f32(c.v_, a.v_, b.v_)));
      }
#endif
      return each([](T x, T y, T z) { return hamotor::mul_add<T>(x, y, z); }, a, b, c);
    }
  }

  Vector v_;
};

template <class T, std::size_t W>
class Mask {
 public:
  using Lanes = std::remove_cvref_t<decltype(std::declval<typename Pack<T, W>::Vector>() <
                                             std::declval<typename Pack<T, W>::Vector>())>;

  Mask() = default;
  HAMOTOR_INLINE constexpr explicit Mask(const Lanes& lanes) noexcept : lanes_(lanes) {}

  [[nodiscard]] HAMOTOR_INLINE constexpr bool operator[](std::size_t lane) const noexcept {
    if constexpr (W == 1) {
      return lanes_;
    } else {
      return lanes_[lane] != 0;
    }
  }

  [[nodiscard]] HAMOTOR_INLINE friend constexpr Mask operator&&(const Mask& a,
                                                                const Mask& b) noexcept {
    if constexpr (W == 1) {
      return Mask(a.lanes_ && b.lanes_);
    } else {
      return Mask(a.lanes_ & b.lanes_);
    }
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Mask operator||(const Mask& a,
                                                                const Mask& b) noexcept {
    if constexpr (W == 1) {
      return Mask(a.lanes_ || b.lanes_);
    } else {
      return Mask(a.lanes_ | b.lanes_);
    }
  }
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Mask operator!(const Mask& a) noexcept {
    if constexpr (W == 1) {
      return Mask(!a.lanes_);
    } else {
      return Mask(~a.lanes_);
    }
  }

  /// Whether the condition holds in every lane.
  [[nodiscard]] HAMOTOR_INLINE friend constexpr bool all(const Mask& mask) noexcept {
    return mask.bits() == every;
  }
  /// Whether the condition holds in any lane.
  [[nodiscard]] HAMOTOR_INLINE friend constexpr bool any(const Mask& mask) noexcept {
    return mask.bits() != 0;
  }

  /// `a` in the lanes where the condition holds, else `b`.
  [[nodiscard]] HAMOTOR_INLINE friend constexpr Pack<T, W> select(const Mask& mask,
                                                                  const Pack<T, W>& a,
                                                                  const Pack<T, W>& b) noexcept {
    return Pack<T, W>(mask.lanes_ ? a.vector() : b.vector());
  }

 private:
  using Bits = std::conditional_t<(W < 32), unsigned, std::uint64_t>;
  static constexpr Bits every = static_cast<Bits>(~std::uint64_t{0} >> (64 - W));

  /// A bit for each lane.
  [[nodiscard]] HAMOTOR_INLINE constexpr Bits bits() const noexcept {
    if constexpr (W == 1) {
      return lanes_ ? 1 : 0;
    } else {
#if defined(__x86_64__) && defined(__FMA__) && defined(__GNUC__)
      if (!std::is_constant_evaluated()) {
#ifdef __AVX512DQ__
        if constexpr (W == 8 && sizeof(T) == 8) return _mm512_movepi64_mask(vector<__m512i>());
        if constexpr (W == 16 && sizeof(T) == 4) return _mm512_movepi32_mask(vector<__m512i>());
#endif
        if constexpr (W == 4 && sizeof(T) == 8) return low(_mm256_movemask_pd(vector<__m256d>()));
        if constexpr (W == 2 && sizeof(T) == 8) return low(_mm_movemask_pd(vector<__m128d>()));
        if constexpr (W == 8 && sizeof(T) == 4) return low(_mm256_movemask_ps(vector<__m256>()));
        if constexpr (W == 4 && sizeof(T) == 4) return low(_mm_movemask_ps(vector<__m128>()));
      }
#endif
      Bits result = 0;
      for (std::size_t k = 0; k < W; ++k) result |= lanes_[k] != 0 ? Bits{1} << k : Bits{0};
      return result;
    }
  }

  template <class Register>
  [[nodiscard]] HAMOTOR_INLINE Register vector() const noexcept {
    return reinterpret_cast<Register>(lanes_);
  }
  [[nodiscard]] HAMOTOR_INLINE static constexpr unsigned low(int mask) noexcept {
    return static_cast<unsigned>(mask);
  }

  Lanes lanes_;
};

/// Whether a scalar is a pack.
template <class S>
inline constexpr bool is_pack = false;
template <class T, std::size_t W>
inline constexpr bool is_pack<Pack<T, W>> = true;

/// How many numbers a scalar holds.
template <class S>
inline constexpr std::size_t lanes_of = 1;
template <class T, std::size_t W>
inline constexpr std::size_t lanes_of<Pack<T, W>> = W;

/// As many lanes as fill a register of the processor that is compiled for.
#if defined(__AVX512F__)
inline constexpr std::size_t register_bytes = 64;
#elif defined(__AVX__)
inline constexpr std::size_t register_bytes = 32;
#else
inline constexpr std::size_t register_bytes = 16;
#endif
template <class T>
inline constexpr std::size_t widest = register_bytes / sizeof(T);

/// What registers of that size are called.
inline constexpr std::string_view instruction_set =
#if defined(__AVX512F__)
    "avx512";
#elif defined(__AVX2__) && defined(__FMA__)
    "avx2";
#elif defined(__AVX__)
    "avx";
#elif defined(__x86_64__)
    "sse2";
#elif defined(__ARM_NEON)
    "neon";
#else
    "generic";
#endif

namespace scalar {
template <class T, std::size_t W>
struct Limits<Pack<T, W>> : Limits<T> {};
}  // namespace scalar

// Functions of the library, lane by lane: potentials may call them, steppers do not.
#define HAMOTOR_FUNCTION(name)                                    \
  template <class T, std::size_t W>                               \
  [[nodiscard]] Pack<T, W> name(const Pack<T, W>& x) noexcept {   \
    return Pack<T, W>::each([](T y) { return std::name(y); }, x); \
  }
HAMOTOR_FUNCTION(tan)
HAMOTOR_FUNCTION(sinh)
HAMOTOR_FUNCTION(cosh)
HAMOTOR_FUNCTION(tanh)
HAMOTOR_FUNCTION(asinh)
HAMOTOR_FUNCTION(log)
HAMOTOR_FUNCTION(asin)
HAMOTOR_FUNCTION(acos)
HAMOTOR_FUNCTION(atan)
HAMOTOR_FUNCTION(floor)
#undef HAMOTOR_FUNCTION

template <class T, std::size_t W>
[[nodiscard]] Pack<T, W> atan2(const Pack<T, W>& y, const Pack<T, W>& x) noexcept {
  return Pack<T, W>::each([](T a, T b) { return std::atan2(a, b); }, y, x);
}

namespace detail {

/// f of angles below 1e8 by quarter turns and polynomials, of others by the library.
template <class T, std::size_t W, class ByTurns, class Library>
[[nodiscard]] HAMOTOR_INLINE inline hamotor::Pack<T, W> of_angle(const hamotor::Pack<T, W>& x,
                                                                 const ByTurns& by_turns,
                                                                 const Library& library) noexcept {
  using S = hamotor::Pack<T, W>;
  if constexpr (std::same_as<T, double> && has_fused_multiply_add) {
    const auto near = scalar::abs(x) < hamotor::Pack<T, W>(1e8);
    const auto turned = QuarterTurns<S>::of(x);
    // The rest in two words: the last digit of a sine is that of its angle.  Beside multiples of
    // π/2 the first two terms cancel, so that their difference is found without an error.
    const S first = scalar::fma(-turned.quarters, S(0x1.921fb54442d18p+0), x);
    const S second = turned.quarters * S(-0x1.1a62633145c07p-54);
    const S second_lo = -scalar::fma(turned.quarters, S(0x1.1a62633145c07p-54), second);
    const auto [hi, sum_lo] = scalar::two_sum(first, second);
    const S lo = scalar::fma(-turned.quarters, S(-0x1.f1976b7ed8fbcp-110), sum_lo + second_lo);
    const S square = hi * hi;
    const S cosine = S(1) + mul_add(-lo, hi, square * cosine_series(square));
    const S sine = hi + mul_add(hi * square, sine_series(square), lo * cosine);
    const auto value = by_turns(turned, sine, cosine);
    if (all(near)) return value;
    return select(near, value, hamotor::Pack<T, W>::each(library, x));
  } else {
    return hamotor::Pack<T, W>::each(library, x);
  }
}

/// eʳ − 1 − r over r² for |r| ≤ ½ log 2: minimax polynomial, error of eʳ below 1e-18.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S exp_series(const S& r) noexcept {
  const S r2 = r * r;
  const S r4 = r2 * r2;
  const S a = mul_add(S(0x1.555555555555bp-3), r, S(0x1.0000000000000p-1));
  const S b = mul_add(S(0x1.111111110ebcdp-7), r, S(0x1.555555555555ep-5));
  const S c = mul_add(S(0x1.a01a01b3b2c5cp-13), r, S(0x1.6c16c16c1359ap-10));
  const S d = mul_add(S(0x1.71ddefa5b8d57p-19), r, S(0x1.a01a01b45194cp-16));
  const S e = mul_add(S(0x1.af6cb16587cd4p-26), r, S(0x1.27e4bf378e3f6p-22));
  const S f = mul_add(S(0x1.1f9de61ee4139p-29), r2, e);
  return mul_add(r4, mul_add(r4, f, mul_add(r2, d, c)), mul_add(r2, b, a));
}

/// 2ⁿ of an integer −1023 < n < 1024.
template <std::size_t W>
[[nodiscard]] HAMOTOR_INLINE constexpr hamotor::Pack<double, W> power_of_two(
    const hamotor::Pack<double, W>& n) noexcept {
  return hamotor::Pack<double, W>::bits_moved_up(n + hamotor::Pack<double, W>(0x1.8p52 + 1023), 52);
}

}  // namespace detail

template <class T, std::size_t W>
[[nodiscard]] Pack<T, W> sin(const Pack<T, W>& x) noexcept {
  const Pack<T, W> value = detail::of_angle(
      x,
      [](const auto& turned, const auto& sine, const auto& cosine) {
        const auto some = select(turned.odd(), cosine, sine);
        return select(turned.opposite(), -some, some);
      },
      [](T y) { return std::sin(y); });
  return select(x == Pack<T, W>(0), x, value);  // −0 too
}

template <class T, std::size_t W>
[[nodiscard]] Pack<T, W> cos(const Pack<T, W>& x) noexcept {
  return detail::of_angle(
      x,
      [](const auto& turned, const auto& sine, const auto& cosine) {
        const auto value = select(turned.odd(), -sine, cosine);
        return select(turned.opposite(), -value, value);
      },
      [](T y) { return std::cos(y); });
}

/// By eˣ = 2ⁿ eʳ, r = x − n log 2; for float the library's.
template <class T, std::size_t W>
[[nodiscard]] Pack<T, W> exp(const Pack<T, W>& x) noexcept {
  using P = Pack<T, W>;
  if constexpr (std::same_as<T, double> && has_fused_multiply_add) {
    // Beyond, the result is 0 or infinite, and halves of n would be no exponents any more.
    const P bounded = select(x > P(710), P(710), select(x < P(-750), P(-750), x));
    constexpr double to_integer = 0x1.8p52;
    const P shifted = scalar::fma(bounded, P(0x1.71547652b82fep+0), P(to_integer));
    const P n = shifted - P(to_integer);
    const P r = scalar::fma(-n, P(0x1.abc9e3b39803fp-56),
                            scalar::fma(-n, P(0x1.62e42fefa39efp-1), bounded));
    const P value = P(1) + scalar::fma(r * r, detail::exp_series(r), r);
    // 2ⁿ may have no exponent of its own where the product has one.
    const P half = scalar::fma(P(0.5), n, P(to_integer)) - P(to_integer);
    return value * detail::power_of_two(half) * detail::power_of_two(n - half);
  } else {
    return P::each([](T y) { return std::exp(y); }, x);
  }
}

}  // namespace hamotor
