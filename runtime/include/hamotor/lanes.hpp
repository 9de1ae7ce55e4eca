// Four numbers at a time, within one object: for kernels that are sums of products over groups of
// four components.  Lane by lane the same operations as `dot` on scalars, and so the same bits.
#pragma once

#include <cstring>
#include <type_traits>

#include "hamotor/scalar.hpp"

#if defined(__FMA__) && defined(__x86_64__) && defined(__GNUC__)
#define HAMOTOR_LANES 1
#include <immintrin.h>
#endif

namespace hamotor::lanes {

#ifdef HAMOTOR_LANES

/// Whether kernels compute with this scalar four at a time.
template <class S>
inline constexpr bool packed = std::is_same_v<S, double> || std::is_same_v<S, float>;

/// Four numbers.
template <class S>
struct Four {
  using Lanes [[gnu::vector_size(4 * sizeof(S))]] = S;
  Lanes lanes;

  [[nodiscard]] HAMOTOR_INLINE S operator[](int lane) const noexcept { return lanes[lane]; }
  [[nodiscard]] HAMOTOR_INLINE friend Four operator+(const Four& a, const Four& b) noexcept {
    return {a.lanes + b.lanes};
  }
  [[nodiscard]] HAMOTOR_INLINE friend Four operator-(const Four& a, const Four& b) noexcept {
    return {a.lanes - b.lanes};
  }
  [[nodiscard]] HAMOTOR_INLINE friend Four operator*(const Four& a, const Four& b) noexcept {
    return {a.lanes * b.lanes};
  }
};

template <class S>
[[nodiscard]] HAMOTOR_INLINE inline Four<S> four(const S& x) noexcept {
  return {typename Four<S>::Lanes{x, x, x, x}};
}

template <class S>
[[nodiscard]] HAMOTOR_INLINE inline Four<S> four(const S& a, const S& b, const S& c,
                                                 const S& d) noexcept {
  return {typename Four<S>::Lanes{a, b, c, d}};
}

/// Four components of an element that follow each other, from component `first` on.
template <int first, class T, class S>
HAMOTOR_INLINE inline void store(T& element, const Four<S>& x) noexcept {
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) >= (first + 4) * sizeof(S));
  std::memcpy(reinterpret_cast<char*>(&element) + first * sizeof(S), &x.lanes, 4 * sizeof(S));
}

[[nodiscard]] HAMOTOR_INLINE inline Four<double> mul_add(const Four<double>& a,
                                                         const Four<double>& b,
                                                         const Four<double>& c) noexcept {
  return {_mm256_fmadd_pd(a.lanes, b.lanes, c.lanes)};
}

[[nodiscard]] HAMOTOR_INLINE inline Four<float> mul_add(const Four<float>& a, const Four<float>& b,
                                                        const Four<float>& c) noexcept {
  return {_mm_fmadd_ps(a.lanes, b.lanes, c.lanes)};
}

/// Lanes in another order, counted from 0.  Within a half of 256 bits a lane moves in a cycle,
/// across halves in three to six, by processor: where that does, halves are exchanged once, for all
/// orders.
template <int a, int b, int c, int d>
[[nodiscard]] HAMOTOR_INLINE inline __m256d permuted(__m256d x) noexcept {
  if constexpr (a / 2 == c / 2 || b / 2 == d / 2) {
    return __builtin_shufflevector(x, x, a, b, c, d);
  } else {
    constexpr int odd = a % 2 + 2 * (b % 2) + 4 * (c % 2) + 8 * (d % 2);
    const __m256d exchanged = _mm256_permute2f128_pd(x, x, 1);
    return _mm256_shuffle_pd(a < 2 ? x : exchanged, b < 2 ? x : exchanged, odd);
  }
}

template <int a, int b, int c, int d>
[[nodiscard]] HAMOTOR_INLINE inline __m128 permuted(__m128 x) noexcept {
  return __builtin_shufflevector(x, x, a, b, c, d);
}

/// Lanes in another order and with other signs: −2 is the second lane, negated.
template <int a, int b, int c, int d, class S>
[[nodiscard]] HAMOTOR_INLINE inline Four<S> turned(const Four<S>& x) noexcept {
  constexpr auto lane = [](int k) { return (k < 0 ? -k : k) - 1; };
  constexpr auto sign = [](int k) { return k < 0 ? S(-0.0) : S(0); };
  const auto moved = permuted<lane(a), lane(b), lane(c), lane(d)>(x.lanes);
  if constexpr (a > 0 && b > 0 && c > 0 && d > 0) {
    return {moved};
  } else if constexpr (std::is_same_v<S, double>) {
    return {_mm256_xor_pd(moved, _mm256_setr_pd(sign(a), sign(b), sign(c), sign(d)))};
  } else {
    return {_mm_xor_ps(moved, _mm_setr_ps(sign(a), sign(b), sign(c), sign(d)))};
  }
}

/// One lane in all four.
template <int lane, class S>
[[nodiscard]] HAMOTOR_INLINE inline Four<S> each(const Four<S>& x) noexcept {
  return {__builtin_shufflevector(x.lanes, x.lanes, lane, lane, lane, lane)};
}

#else

template <class S>
inline constexpr bool packed = false;

template <class S, class... Rest>
[[nodiscard]] S four(const S& x, const Rest&... rest) noexcept;
template <int first, class T, class S>
void store(T& element, const S& x) noexcept;
template <int a, int b, int c, int d, class S>
[[nodiscard]] S turned(const S& x) noexcept;
template <int lane, class S>
[[nodiscard]] S each(const S& x) noexcept;

#endif

}  // namespace hamotor::lanes
