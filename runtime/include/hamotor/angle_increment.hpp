// Sines and cosines less one, for scalars and packs alike.
#pragma once

#include <concepts>

#include "hamotor/scalar.hpp"

namespace hamotor {

/// How large angles are known to be: at most 1/16, at most π/4, or nothing is known.
enum class AngleRange { tiny, small, any };

namespace detail {

/// (sin x)/x − 1 over z, and (cos x − 1)/z, z = x² ≤ (π/4)²: minimax polynomials, relative errors
/// of sin x and cos x − 1 below 2.1e-17 before rounding.  Sums in pairs, so that few wait for each
/// other.
///
/// Of tiny angles, z ≤ 2⁻⁸, the third pair is z⁴/11! < 2⁻⁵⁷ beside 1/3!, and z⁴/12! < 2⁻⁶⁰ beside
/// 1/4!: less than half of what their last digits stand for, so that the sum is the same without
/// it, to the bit.
template <AngleRange range = AngleRange::small, class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S sine_series(const S& z) noexcept {
  const S z2 = z * z;
  const S a = mul_add(S(0x1.1111111110babp-7), z, S(-0x1.5555555555555p-3));
  const S b = mul_add(S(0x1.71de37946ed6dp-19), z, S(-0x1.a01a019e820aep-13));
  if constexpr (range == AngleRange::tiny) return mul_add(z2, b, a);
  const S c = mul_add(S(0x1.5e0a4fc16be59p-33), z, S(-0x1.ae6008d114485p-26));
  return mul_add(z2 * z2, c, mul_add(z2, b, a));
}
template <AngleRange range = AngleRange::small, class S>
[[nodiscard]] HAMOTOR_INLINE constexpr S cosine_series(const S& z) noexcept {
  const S z2 = z * z;
  const S a = mul_add(S(-0x1.6c16c16c16963p-10), z, S(0x1.5555555555555p-5));
  const S b = mul_add(S(-0x1.27e4fa16cc2d1p-22), z, S(0x1.a01a019f4ddfdp-16));
  if constexpr (range == AngleRange::tiny) return mul_add(z, mul_add(z2, b, a), S(-0.5));
  const S c = mul_add(S(-0x1.907cd8ff5ede7p-37), z, S(0x1.1eeb67d026ec6p-29));
  return mul_add(z, mul_add(z2 * z2, c, mul_add(z2, b, a)), S(-0.5));
}

/// Whether those polynomials have all digits of S.
template <class S>
inline constexpr bool has_series =
    std::same_as<scalar::NumberOf<S>, double> || std::same_as<scalar::NumberOf<S>, float>;

/// (π/4)², or 1/16².
template <class S, AngleRange range = AngleRange::small>
inline constexpr S series_bound = S(range == AngleRange::tiny ? 0x1p-8 : 0x1.3bd3cc9be45dep-1);

/// An angle of less than 1e8 as quarter turns and a rest of at most π/4 (Cody & Waite 1980), π/2 in
/// three words, where multiply-adds are fused.
template <class S>
struct QuarterTurns {
  S shifted;  ///< the number of quarters in its last bits
  S quarters;
  S rest;

  [[nodiscard]] HAMOTOR_INLINE static constexpr QuarterTurns of(const S& angle) noexcept {
    constexpr double to_integer = 0x1.8p52;
    const S shifted = mul_add(angle, S(0x1.45f306dc9c883p-1), S(to_integer));
    const S quarters = shifted - S(to_integer);
    return {shifted, quarters,
            mul_add(-quarters, S(-0x1.f1976b7ed8fbcp-110),
                    mul_add(-quarters, S(0x1.1a62633145c07p-54),
                            mul_add(-quarters, S(0x1.921fb54442d18p+0), angle)))};
  }

  /// Where the number of quarters is odd, and where it is 2 or 3 less a multiple of 4.
  [[nodiscard]] HAMOTOR_INLINE constexpr auto odd() const noexcept
    requires requires { S::has_bit(shifted, 0); }
  {
    return S::has_bit(shifted, 0);
  }
  [[nodiscard]] HAMOTOR_INLINE constexpr auto opposite() const noexcept
    requires requires { S::has_bit(shifted, 1); }
  {
    return S::has_bit(shifted, 1);
  }
};

}  // namespace detail

/// Sine of an angle and its cosine less one, both with all digits however small the angle.
template <class S>
struct AngleIncrement {
  S sine;
  S cosine_less_one;

  [[nodiscard]] HAMOTOR_INLINE static constexpr AngleIncrement of(const S& angle) noexcept {
    if constexpr (detail::has_series<S>) {
      if (all(is_small(angle))) return of_small(angle);
    }
    return of_any(angle);
  }

  /// `a` where the condition holds, else `b`.
  template <class Condition>
  [[nodiscard]] HAMOTOR_INLINE static constexpr AngleIncrement chosen(
      const Condition& condition, const AngleIncrement& a, const AngleIncrement& b) noexcept {
    return {select(condition, a.sine, b.sine),
            select(condition, a.cosine_less_one, b.cosine_less_one)};
  }

  /// Whether the polynomials are for this angle.
  [[nodiscard]] HAMOTOR_INLINE static constexpr auto is_small(const S& angle) noexcept {
    return angle * angle <= detail::series_bound<S>;
  }

  template <AngleRange range = AngleRange::small>
    requires(range != AngleRange::any)
  [[nodiscard]] HAMOTOR_INLINE static constexpr AngleIncrement of_small(const S& angle) noexcept {
    const S z = angle * angle;
    return {mul_add(angle * z, detail::sine_series<range>(z), angle),
            z * detail::cosine_series<range>(z)};
  }

  /// Of twice the angle.
  [[nodiscard]] HAMOTOR_INLINE constexpr AngleIncrement twice() const noexcept {
    return {S(2) * mul_add(sine, cosine_less_one, sine), S(-2) * sine * sine};
  }

 private:
  [[nodiscard]] static constexpr AngleIncrement of_any(const S& angle) noexcept {
    if constexpr (scalar::has_lanes<S>) {
      return of_each(angle);
    } else {
      if constexpr (std::same_as<S, double> && has_fused_multiply_add) {
        if (scalar::abs(angle) < S(1e8)) return reduced(angle);
      }
      return far(angle);
    }
  }

  /// What each lane's own size asks for; rare, and kept out of the way of what is not.
  [[nodiscard, gnu::cold, gnu::noinline]] static AngleIncrement of_each(const S& angle) noexcept {
    AngleIncrement result = far(angle);
    if constexpr (std::same_as<scalar::NumberOf<S>, double> && has_fused_multiply_add) {
      result = chosen(scalar::abs(angle) < S(1e8), reduced(angle), result);
    }
    return chosen(is_small(angle), of_small(angle), result);
  }

  [[nodiscard]] static constexpr AngleIncrement far(const S& angle) noexcept {
    const S sine = scalar::sin(S(0.5) * angle);
    return {S(2) * sine * scalar::cos(S(0.5) * angle), S(-2) * sine * sine};
  }

  [[nodiscard]] static constexpr AngleIncrement reduced(const S& angle) noexcept {
    const auto turned = detail::QuarterTurns<S>::of(angle);
    const auto [sine, cosine_less_one] = of_small(turned.rest);
    if constexpr (requires { turned.odd(); }) {
      const auto odd = turned.odd();
      const auto opposite = turned.opposite();
      return chosen(
          opposite,
          chosen(odd, {S(-1) - cosine_less_one, sine - S(1)}, {-sine, -cosine_less_one - S(2)}),
          chosen(odd, {S(1) + cosine_less_one, -sine - S(1)}, {sine, cosine_less_one}));
    } else {
      switch (static_cast<long long>(turned.quarters) & 3) {
        case 0:
          return {sine, cosine_less_one};
        case 1:
          return {S(1) + cosine_less_one, -sine - S(1)};
        case 2:
          return {-sine, -cosine_less_one - S(2)};
        default:
          return {-S(1) - cosine_less_one, sine - S(1)};
      }
    }
  }
};

}  // namespace hamotor
