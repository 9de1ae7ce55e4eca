// Four numbers at a time, within one object: for kernels that are sums of products over groups of
// four components.  Lane by lane the same operations as `dot` on scalars, and so the same bits.
#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>

#include "hamotor/scalar.hpp"

#if defined(__FMA__) && defined(__x86_64__) && defined(__GNUC__)
#define HAMOTOR_LANES 1
#endif

namespace hamotor::lanes {

#ifdef HAMOTOR_LANES

/// Whether kernels compute with this scalar four at a time.
template <class S>
inline constexpr bool packed = std::is_same_v<S, double> || std::is_same_v<S, float>;

/// Whether loops over many objects become lanes by themselves, one object each, which is faster
/// than three lanes within one: clang does it with the kernels that are inlined into the loop.
#ifdef __clang__
inline constexpr bool loops_become_lanes = true;
#else
inline constexpr bool loops_become_lanes = false;
#endif

/// Four numbers.  Compilers' vectors and built-in functions serve: <immintrin.h> would take longer
/// to read than the kernels of pga3.
template <class S>
struct Four {
  using Lanes [[gnu::vector_size(4 * sizeof(S))]] = S;
  Lanes lanes;

  [[nodiscard]] HAMOTOR_INLINE S operator[](int lane) const noexcept { return lanes[lane]; }
  [[nodiscard]] HAMOTOR_INLINE friend Four operator-(const Four& a) noexcept { return {-a.lanes}; }
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

template <class S>
[[nodiscard]] HAMOTOR_INLINE inline Four<S> mul_add(const Four<S>& a, const Four<S>& b,
                                                    const Four<S>& c) noexcept {
#if __has_builtin(__builtin_elementwise_fma)
  return {__builtin_elementwise_fma(a.lanes, b.lanes, c.lanes)};
#else
  if constexpr (std::is_same_v<S, double>) {
    return {__builtin_ia32_vfmaddpd256(a.lanes, b.lanes, c.lanes)};
  } else {
    return {__builtin_ia32_vfmaddps(a.lanes, b.lanes, c.lanes)};
  }
#endif
}

/// Lanes in another order, counted from 0.  Within a half of 256 bits a lane moves in a cycle,
/// across halves in three to six, by processor: where that does, halves are exchanged once, for all
/// orders.
template <int a, int b, int c, int d, class S>
[[nodiscard]] HAMOTOR_INLINE inline auto permuted(const Four<S>& x) noexcept {
  constexpr bool from_both_halves = a / 2 != c / 2 && b / 2 != d / 2;
  if constexpr (std::is_same_v<S, double> && from_both_halves) {
#if __has_builtin(__builtin_ia32_vperm2f128_pd256)
    const auto exchanged = __builtin_ia32_vperm2f128_pd256(x.lanes, x.lanes, 1);
#else
    const auto exchanged = __builtin_shufflevector(x.lanes, x.lanes, 2, 3, 0, 1);
#endif
    return __builtin_shufflevector(a < 2 ? x.lanes : exchanged, b < 2 ? x.lanes : exchanged, a % 2,
                                   4 + b % 2, 2 + c % 2, 6 + d % 2);
  } else {
    return __builtin_shufflevector(x.lanes, x.lanes, a, b, c, d);
  }
}

/// Lanes in another order and with other signs: −2 is the second lane, negated.
template <int a, int b, int c, int d, class S>
[[nodiscard]] HAMOTOR_INLINE inline Four<S> turned(const Four<S>& x) noexcept {
  constexpr auto lane = [](int k) { return (k < 0 ? -k : k) - 1; };
  constexpr auto sign = [](int k) { return k < 0 ? S(-0.0) : S(0); };
  const typename Four<S>::Lanes moved = permuted<lane(a), lane(b), lane(c), lane(d)>(x);
  if constexpr (a > 0 && b > 0 && c > 0 && d > 0) {
    return {moved};
  } else {
    constexpr typename Four<S>::Lanes signs{sign(a), sign(b), sign(c), sign(d)};
#if __has_builtin(__builtin_ia32_xorpd256)
    // g++ takes the integers' instruction otherwise, whose result floating point waits for.
    if constexpr (std::is_same_v<S, double>) {
      return {__builtin_ia32_xorpd256(moved, signs)};
    } else {
      return {__builtin_ia32_xorps(moved, signs)};
    }
#else
    using Bits [[gnu::vector_size(4 * sizeof(S))]] =
        std::conditional_t<std::is_same_v<S, double>, std::int64_t, std::int32_t>;
    return {reinterpret_cast<typename Four<S>::Lanes>(reinterpret_cast<Bits>(moved) ^
                                                      reinterpret_cast<Bits>(signs))};
#endif
  }
}

/// The sum of the first three lanes.
template <class S>
[[nodiscard]] HAMOTOR_INLINE inline S total(const Four<S>& x) noexcept {
  return (x[0] + x[1]) + x[2];
}

/// One lane in all four.
template <int lane, class S>
[[nodiscard]] HAMOTOR_INLINE inline Four<S> each(const Four<S>& x) noexcept {
  return {__builtin_shufflevector(x.lanes, x.lanes, lane, lane, lane, lane)};
}

#else

template <class S>
inline constexpr bool packed = false;
inline constexpr bool loops_become_lanes = false;

template <class S, class... Rest>
[[nodiscard]] S four(const S& x, const Rest&... rest) noexcept;
template <int first, class T, class S>
void store(T& element, const S& x) noexcept;
template <int a, int b, int c, int d, class S>
[[nodiscard]] S turned(const S& x) noexcept;
template <class S>
[[nodiscard]] S total(const S& x) noexcept;
template <int lane, class S>
[[nodiscard]] S each(const S& x) noexcept;

#endif

}  // namespace hamotor::lanes
