// Eight coordinates of a Taylor series in a register, or two: its sum, and the coefficients of
// ẋ = c + L x + Q(x, x).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "hamotor/scalar.hpp"

#if defined(__GNUC__) && defined(__AVX2__) && defined(__FMA__)
#define HAMOTOR_PACKS 1
#include <immintrin.h>
#elif defined(__GNUC__) && defined(HAMOTOR_FUSED)
#define HAMOTOR_PACKS 1
#endif

namespace hamotor {

/// Eight terms weight · x[left] · x[right] of the derivatives of one pack of coordinates.
template <class S>
struct PackedTerm {
  alignas(8 * sizeof(S)) std::array<S, 8> weights;
  std::array<int, 8> left;
  std::array<int, 8> right;
  std::size_t pack;
};

namespace detail {

/// Σ c_k sᵏ over 0 < k ≤ p of every coordinate, odd and even powers apart, so
/// that half as many operations wait for each other.
template <class S, std::size_t n, std::size_t most>
[[nodiscard]] constexpr std::array<S, n> sum_of_powers(const std::array<std::array<S, n>, most>& c,
                                                       std::size_t p, const S& s) noexcept {
  const S square = s * s;
  std::array<S, n> odd{};
  std::array<S, n> even{};
  const auto add = [&](std::array<S, n>& sum, std::size_t k) {
    for (std::size_t i = 0; i < n; ++i) sum[i] = mul_add(sum[i], square, c[k][i]);
  };
  std::size_t k = p;
  if (k % 2 == 1) add(odd, k--);
  for (; k > 0; k -= 2) {
    add(even, k);
    add(odd, k - 1);
  }
  for (std::size_t i = 0; i < n; ++i) even[i] = mul_add(s, odd[i], square * even[i]);
  return even;
}

/// The largest |x₀|, |x₁| s or |x₂| s² of every coordinate.
template <class S, std::size_t n>
[[nodiscard]] constexpr std::array<S, n> sizes_within(const std::array<S, n>& x0,
                                                      const std::array<S, n>& x1,
                                                      const std::array<S, n>& x2,
                                                      const S& s) noexcept {
  std::array<S, n> result{};
  for (std::size_t i = 0; i < n; ++i) {
    result[i] = scalar::max_abs(x0[i], s * x1[i], s * s * x2[i]);
  }
  return result;
}

/// The largest |x| scale of all coordinates.
template <class S, std::size_t n>
[[nodiscard]] constexpr S largest_product(const std::array<S, n>& x,
                                          const std::array<S, n>& scale) noexcept {
  S largest(0);
  for (std::size_t i = 0; i < n; ++i) largest = scalar::max_abs(largest, x[i] * scale[i]);
  return largest;
}

/// Whether no number is infinite or none.
template <class S, std::size_t n>
[[nodiscard]] constexpr bool are_finite(const std::array<S, n>& x) noexcept {
  S sum(0);
  for (std::size_t i = 0; i < n; ++i) sum = mul_add(S(0), x[i], sum);
  return sum == S(0);
}

/// Adds `change` and what earlier sums lost, `low`, and keeps what this one loses.
template <class S, std::size_t n>
constexpr void add_compensated(std::array<S, n>& x, std::array<S, n>& low,
                               const std::array<S, n>& change) noexcept {
  for (std::size_t i = 0; i < n; ++i) {
    const auto sum = scalar::two_sum(x[i], change[i] + low[i]);
    x[i] = sum.hi;
    low[i] = sum.lo;
  }
}

#ifdef HAMOTOR_PACKS

template <class S>
inline constexpr bool has_packs = std::is_same_v<S, double> || std::is_same_v<S, float>;

template <class S>
struct Pack {
  using Lanes [[gnu::vector_size(8 * sizeof(S))]] = S;
};

/// Half of it: where numbers are computed one by one in between, for which a processor that works
/// on 512 bits has one unit less.
template <class S>
struct HalfPack {
  using Lanes [[gnu::vector_size(4 * sizeof(S))]] = S;
};

template <class S>
using HalfLanes = typename HalfPack<S>::Lanes;

/// W numbers as a vector, and the same in memory, wherever they begin.  Not by memcpy, of which g++
/// 12 makes moves of 16 bytes.
template <class S, std::size_t W>
struct VectorOf {
  using type [[gnu::vector_size(W * sizeof(S))]] = S;
  using InMemory [[gnu::vector_size(W * sizeof(S)), gnu::aligned(sizeof(S)), gnu::may_alias]] = S;
};
template <std::size_t W, class S>
[[nodiscard]] HAMOTOR_INLINE inline typename VectorOf<S, W>::type read(const S* from) noexcept {
  return *reinterpret_cast<const typename VectorOf<S, W>::InMemory*>(from);
}
template <std::size_t W, class S>
HAMOTOR_INLINE inline void write(S* to, const typename VectorOf<S, W>::type& x) noexcept {
  *reinterpret_cast<typename VectorOf<S, W>::InMemory*>(to) = x;
}

#if defined(__AVX2__) && defined(__FMA__)
[[nodiscard]] HAMOTOR_INLINE inline HalfLanes<double> packed_mul_add(
    const HalfLanes<double>& a, const HalfLanes<double>& b, const HalfLanes<double>& c) noexcept {
  return _mm256_fmadd_pd(a, b, c);
}

#ifdef __AVX512F__
[[nodiscard]] HAMOTOR_INLINE inline Pack<double>::Lanes packed_mul_add(
    const Pack<double>::Lanes& a, const Pack<double>::Lanes& b,
    const Pack<double>::Lanes& c) noexcept {
  return _mm512_fmadd_pd(a, b, c);
}
#else
/// Eight doubles in two registers: a vector type that is wider than registers lives in memory.
struct Halves {
  using Half = HalfLanes<double>;
  Half low;
  Half high;

  Halves() = default;
  HAMOTOR_INLINE Halves(const Half& a, const Half& b) noexcept : low(a), high(b) {}
  // Copied as two vectors: the copy of a whole object g++ 12 makes of smaller pieces, for which
  // loads of vectors wait.
  HAMOTOR_INLINE Halves(const Halves& x) noexcept : low(x.low), high(x.high) {}
  HAMOTOR_INLINE Halves& operator=(const Halves& x) noexcept {
    low = x.low;
    high = x.high;
    return *this;
  }

  HAMOTOR_INLINE friend Halves operator+(const Halves& a, const Halves& b) noexcept {
    return {a.low + b.low, a.high + b.high};
  }
  HAMOTOR_INLINE friend Halves operator-(const Halves& a, const Halves& b) noexcept {
    return {a.low - b.low, a.high - b.high};
  }
  HAMOTOR_INLINE friend Halves operator*(const Halves& a, const Halves& b) noexcept {
    return {a.low * b.low, a.high * b.high};
  }
  HAMOTOR_INLINE friend Halves operator+(const Halves& a, double x) noexcept {
    return {a.low + x, a.high + x};
  }
  HAMOTOR_INLINE friend Halves operator*(const Halves& a, double x) noexcept {
    return {a.low * x, a.high * x};
  }
  HAMOTOR_INLINE Halves operator-() const noexcept { return {-low, -high}; }
  HAMOTOR_INLINE Halves& operator+=(const Halves& x) noexcept { return *this = *this + x; }
  HAMOTOR_INLINE double operator[](std::size_t lane) const noexcept {
    return lane < 4 ? low[lane] : high[lane - 4];
  }
};

template <>
struct Pack<double> {
  using Lanes = Halves;
};

[[nodiscard]] HAMOTOR_INLINE inline Halves packed_mul_add(const Halves& a, const Halves& b,
                                                          const Halves& c) noexcept {
  return {packed_mul_add(a.low, b.low, c.low), packed_mul_add(a.high, b.high, c.high)};
}
#endif

[[nodiscard]] HAMOTOR_INLINE inline Pack<float>::Lanes packed_mul_add(
    const Pack<float>::Lanes& a, const Pack<float>::Lanes& b,
    const Pack<float>::Lanes& c) noexcept {
  return _mm256_fmadd_ps(a, b, c);
}

[[nodiscard]] HAMOTOR_INLINE inline HalfLanes<float> packed_mul_add(
    const HalfLanes<float>& a, const HalfLanes<float>& b, const HalfLanes<float>& c) noexcept {
  return _mm_fmadd_ps(a, b, c);
}
#else
template <class V>
[[nodiscard]] HAMOTOR_INLINE inline V packed_mul_add(const V& a, const V& b, const V& c) noexcept {
  V sum = c;
  for (std::size_t k = 0; k < sizeof a / sizeof a[0]; ++k) sum[k] = mul_add(a[k], b[k], c[k]);
  return sum;
}
#endif

template <class S>
using Lanes = typename Pack<S>::Lanes;

/// Vectors that take a register each: the halves of eight doubles where registers hold four.
template <class V, std::size_t n>
[[nodiscard]] HAMOTOR_INLINE inline auto in_registers(const std::array<V, n>& x) noexcept {
  if constexpr (requires { x[0].low; }) {
    std::array<typename V::Half, 2 * n> halves;
    for (std::size_t i = 0; i < n; ++i) {
      halves[2 * i] = x[i].low;
      halves[2 * i + 1] = x[i].high;
    }
    return halves;
  } else {
    return x;
  }
}

/// Numbers of x in another order: of two registers by one permutation, of each further one by
/// another.
template <auto numbers, class V, std::size_t n>
[[nodiscard]] HAMOTOR_INLINE inline V permuted(const std::array<V, n>& x) noexcept {
  constexpr int width = static_cast<int>(numbers.size());
  constexpr auto is_read = [](int from) {
    return std::ranges::any_of(numbers, [=](int number) { return number / width == from; });
  };
  constexpr int first = *std::ranges::min_element(numbers) / width;
  constexpr int second = [=] {
    int from = first + 1;
    while (from < static_cast<int>(n) && !is_read(from)) ++from;
    return from < static_cast<int>(n) ? from : first;
  }();
  constexpr auto places = std::make_index_sequence<numbers.size()>{};
  V result = [&]<std::size_t... l>(std::index_sequence<l...>) {
    return __builtin_shufflevector(
        x[first], x[second], (numbers[l] % width + (numbers[l] / width > first ? width : 0))...);
  }(places);
  [&]<std::size_t... c>(std::index_sequence<c...>) {
    const auto take = [&](auto from_) {
      constexpr int from = static_cast<int>(decltype(from_)::value);
      if constexpr (from > second && is_read(from)) {
        result = [&]<std::size_t... l>(std::index_sequence<l...>) {
          return __builtin_shufflevector(
              result, x[from],
              (numbers[l] / width == from ? width + numbers[l] % width : static_cast<int>(l))...);
        }(places);
      }
    };
    (take(std::integral_constant<std::size_t, c>{}), ...);
  }(std::make_index_sequence<n>{});
  return result;
}

/// The same, eight numbers in any registers.
template <auto numbers, class V, std::size_t n>
[[nodiscard]] HAMOTOR_INLINE inline V taken(const std::array<V, n>& x) noexcept {
  if constexpr (requires { x[0].low; }) {
    constexpr auto part = [](std::size_t from) {
      return std::array{numbers[from], numbers[from + 1], numbers[from + 2], numbers[from + 3]};
    };
    const auto halves = in_registers(x);
    return {permuted<part(0)>(halves), permuted<part(4)>(halves)};
  } else {
    return permuted<numbers>(x);
  }
}

template <class S>
[[nodiscard]] HAMOTOR_INLINE inline Lanes<S> load(const S* from) noexcept {
  if constexpr (requires(Lanes<S> x) { x.low; }) {
    return {read<4>(from), read<4>(from + 4)};
  } else {
    return read<8>(from);
  }
}

template <class S>
HAMOTOR_INLINE inline void store(S* to, const Lanes<S>& x) noexcept {
  if constexpr (requires { x.low; }) {
    write<4>(to, x.low);
    write<4>(to + 4, x.high);
  } else {
    write<8>(to, x);
  }
}

/// Σ c_r x_r over r < count; terms without weight are left out.
template <class S, std::size_t n, std::size_t most>
  requires(has_packs<S> && n % 8 == 0)
[[nodiscard]] HAMOTOR_INLINE inline std::array<S, n> weighted_sum(
    const S* c, const std::array<std::array<S, n>, most>& x, std::size_t count) noexcept {
  std::array<Lanes<S>, n / 8> sum{};
  for (std::size_t r = 0; r < count; ++r) {
    if (c[r] == S(0)) continue;
    const Lanes<S> weight = Lanes<S>{} + c[r];
    for (std::size_t i = 0; i < n / 8; ++i) {
      sum[i] = packed_mul_add(weight, load<S>(x[r].data() + 8 * i), sum[i]);
    }
  }
  std::array<S, n> result;
  for (std::size_t i = 0; i < n / 8; ++i) store<S>(result.data() + 8 * i, sum[i]);
  return result;
}

template <class S>
[[nodiscard]] HAMOTOR_INLINE inline Lanes<S> packed_max(const Lanes<S>& a,
                                                        const Lanes<S>& b) noexcept {
  if constexpr (requires { a.low; }) {
    return {a.low > b.low ? a.low : b.low, a.high > b.high ? a.high : b.high};
  } else {
    return a > b ? a : b;
  }
}

/// |x|.
template <class S>
[[nodiscard]] HAMOTOR_INLINE inline Lanes<S> packed_size(const Lanes<S>& x) noexcept {
  return packed_max<S>(x, -x);
}

template <class S, std::size_t n, std::size_t most>
  requires(has_packs<S> && n % 8 == 0)
[[nodiscard]] HAMOTOR_INLINE inline std::array<S, n> sum_of_powers(
    const std::array<std::array<S, n>, most>& c, std::size_t p, const S& s) noexcept {
  using X = std::array<Lanes<S>, n / 8>;
  const Lanes<S> step = Lanes<S>{} + s;
  const Lanes<S> square = step * step;
  X odd{};
  X even{};
  const auto add = [&](X& sum, std::size_t k) {
    for (std::size_t i = 0; i < n / 8; ++i) {
      sum[i] = packed_mul_add(sum[i], square, load<S>(c[k].data() + 8 * i));
    }
  };
  std::size_t k = p;
  if (k % 2 == 1) add(odd, k--);
  for (; k > 0; k -= 2) {
    add(even, k);
    add(odd, k - 1);
  }
  std::array<S, n> result;
  for (std::size_t i = 0; i < n / 8; ++i) {
    store<S>(result.data() + 8 * i, packed_mul_add(step, odd[i], square * even[i]));
  }
  return result;
}

template <class S, std::size_t n>
  requires(has_packs<S> && n % 8 == 0)
[[nodiscard]] HAMOTOR_INLINE inline std::array<S, n> sizes_within(const std::array<S, n>& x0,
                                                                  const std::array<S, n>& x1,
                                                                  const std::array<S, n>& x2,
                                                                  const S& s) noexcept {
  const Lanes<S> step = Lanes<S>{} + s;
  const Lanes<S> square = step * step;
  std::array<S, n> result;
  for (std::size_t i = 0; i < n; i += 8) {
    const Lanes<S> first = packed_size<S>(step * load<S>(x1.data() + i));
    const Lanes<S> second = packed_size<S>(square * load<S>(x2.data() + i));
    const Lanes<S> start = packed_size<S>(load<S>(x0.data() + i));
    store<S>(result.data() + i, packed_max<S>(start, packed_max<S>(first, second)));
  }
  return result;
}

template <class S, std::size_t n>
  requires(has_packs<S> && n % 8 == 0)
[[nodiscard]] HAMOTOR_INLINE inline S largest_product(const std::array<S, n>& x,
                                                      const std::array<S, n>& scale) noexcept {
  Lanes<S> top{};
  for (std::size_t i = 0; i < n; i += 8) {
    top = packed_max<S>(top, packed_size<S>(load<S>(x.data() + i)) * load<S>(scale.data() + i));
  }
  top = packed_max<S>(top, taken<std::array{4, 5, 6, 7, 0, 1, 2, 3}>(std::array{top}));
  top = packed_max<S>(top, taken<std::array{2, 3, 0, 1, 6, 7, 4, 5}>(std::array{top}));
  top = packed_max<S>(top, taken<std::array{1, 0, 3, 2, 5, 4, 7, 6}>(std::array{top}));
  return top[0];
}

template <class S, std::size_t n>
  requires(has_packs<S> && n % 8 == 0)
[[nodiscard]] HAMOTOR_INLINE inline bool are_finite(const std::array<S, n>& x) noexcept {
  Lanes<S> sum{};
  for (std::size_t i = 0; i < n; i += 8) {
    sum = packed_mul_add(Lanes<S>{}, load<S>(x.data() + i), sum);
  }
  sum += taken<std::array{4, 5, 6, 7, 0, 1, 2, 3}>(std::array{sum});
  sum += taken<std::array{2, 3, 0, 1, 6, 7, 4, 5}>(std::array{sum});
  return sum[0] + sum[1] == S(0);
}

template <class S, std::size_t n>
  requires(has_packs<S> && n % 8 == 0)
HAMOTOR_INLINE inline void add_compensated(std::array<S, n>& x, std::array<S, n>& low,
                                           const std::array<S, n>& change) noexcept {
  for (std::size_t i = 0; i < n; i += 8) {
    const Lanes<S> a = load<S>(x.data() + i);
    const Lanes<S> b = load<S>(change.data() + i) + load<S>(low.data() + i);
    const Lanes<S> sum = a + b;
    const Lanes<S> shadow = sum - a;
    store<S>(x.data() + i, sum);
    store<S>(low.data() + i, (a - (sum - shadow)) + (b - shadow));
  }
}

/// What is done for each of a number of packs.
template <std::size_t count, class Action>
HAMOTOR_INLINE inline void each(Action action) noexcept {
  [&]<std::size_t... t>(std::index_sequence<t...>) __attribute__((always_inline)) {
    (action(std::integral_constant<std::size_t, t>{}), ...);
  }(std::make_index_sequence<count>{});
}

/// The factors of packs of products by order, and sums Σ u_j v_{k−j} of them.
template <class S, std::size_t products, std::size_t orders>
class CauchySums {
  using V = Lanes<S>;
  /// Of which registers hold a factor and two sums, or four.
#ifdef __AVX512F__
  static constexpr std::size_t held = 8;
#else
  static constexpr std::size_t held = 16 / sizeof(S);
#endif
  static constexpr std::size_t few = 0;

 public:
  using Rows = std::array<V, products>;
  using Stored = std::array<S, 8 * products>;

  alignas(64) std::array<Stored, orders> u{};
  alignas(64) std::array<Stored, orders> v{};

  /// Adds u_i v_j.
  HAMOTOR_INLINE void add(std::size_t i, std::size_t j, Rows& sums) const noexcept {
    each<products>([&](auto t) {
      sums[t] = packed_mul_add(load<S>(u[i].data() + 8 * t), load<S>(v[j].data() + 8 * t), sums[t]);
    });
  }

  /// Σ u_j v_{k−j} over 1 < j < k − 1 for an odd k > 1, and the same for k + 1: two orders in one
  /// pass, with half the loads, for as many products as there are registers for.  The newest
  /// coefficients come last.
  HAMOTOR_INLINE void add_inner(std::size_t k, Rows& sums, Rows& later) const noexcept {
    if (k > 3) {
      add(2, k - 2, sums);
      each<(products + held - 1) / held>([&](auto group) {
        constexpr std::size_t first = held * decltype(group)::value;
        constexpr std::size_t count = std::min(held, products - first);
        using Group = std::array<V, count>;
        // Two sums of every other term where products are too few to wait for each other.
        std::array<Group, (products > few ? 1 : 2)> now{};
        auto next = now;
        Group factor;
        each<count>([&](auto t) { factor[t] = load<S>(v[k - 2].data() + 8 * (first + t)); });
        const auto add_terms = [&](std::size_t j, Group& sum, Group& after) {
          const S* const u_row = u[j].data() + 8 * first;
          const S* const v_row = v[k - j].data() + 8 * first;
          each<count>([&](auto t) {
            const V x = load<S>(u_row + 8 * t);
            after[t] = packed_mul_add(x, factor[t], after[t]);
            factor[t] = load<S>(v_row + 8 * t);
            sum[t] = packed_mul_add(x, factor[t], sum[t]);
          });
        };
        // Of j from 3 to k − 2 there is an odd number.
        add_terms(3, now.front(), next.front());
        for (std::size_t j = 4; j + 2 <= k; j += 2) {
          add_terms(j, now.back(), next.back());
          add_terms(j + 1, now.front(), next.front());
        }
        each<count>([&](auto t) {
          sums[first + t] += now.front()[t];
          later[first + t] += next.front()[t];
          if constexpr (products <= few) {
            sums[first + t] += now.back()[t];
            later[first + t] += next.back()[t];
          }
        });
      });
      add(k - 1, 2, later);
    }
    add(2, k - 1, later);
  }
};

/// The recurrence of a quadratic field whose tables are `Field`, up to an order below `orders`.
template <class Field, class S, std::size_t orders>
class PackedSeries {
  static constexpr std::size_t packs = Field::packs;
  static constexpr std::size_t width = 8 * packs;
  static constexpr std::size_t products = Field::products.size();
  using V = Lanes<S>;
  using X = std::array<V, packs>;
  using Rows = std::array<V, products>;
  using Fixed = std::array<V, Field::fixed.size()>;
  /// Of products, with their weights.
  struct Factors {
    Rows u;
    Rows v;
  };

 public:
  using Coordinates = std::array<S, width>;

  /// Coefficients of orders 1 … p of the motion through x[0], for time in `unit`, s.
  ///
  /// Flat: rows that are passed to calls return through memory.
  template <std::size_t most>
  [[gnu::flatten]] void expand(std::array<Coordinates, most>& x, std::size_t p, S unit) noexcept {
    X now{};
    X change{};
    for (std::size_t c = 0; c < packs; ++c) {
      now[c] = load<S>(x[0].data() + 8 * c);
      change[c] = load<S>(Field::constants.data() + 8 * c);
    }
    const V in_units = V{} + unit;
    at_0_.fixed = fixed_factors(now);
    at_0_.factors = weighted_factors(now);
    each<products>([&](auto t) {
      V& sum = change[Field::products[t].pack];
      sum = packed_mul_add(at_0_.factors.u[t], taken<Field::products[t].right>(now), sum);
    });
    change = with_linear(now, change);
    X edge{};
    for (std::size_t k = 1;; k += 2) {
      put(k, in_units, change, now, x);
      if (k == p) return;
      if (k == 1) at_1_ = weighted_factors(now);
      Rows sums;
      Rows later;
      each<products>([&](auto t) { sums[t] = later[t] = V{}; });
      if (k > 1) rows_.add_inner(k, sums, later);
      change = derivatives(k, now, weighted(sums, edge), edge);
      put(k + 1, in_units, change, now, x);
      if (k + 1 == p) return;
      change = derivatives(k + 1, now, weighted(later, edge), edge);
    }
  }

 private:
  /// weight · x[left] and weight · x[right] of each of the products.
  [[nodiscard]] HAMOTOR_INLINE static Factors weighted_factors(const X& x) noexcept {
    Factors result;
    each<products>([&](auto t) {
      constexpr auto& term = Field::products[t];
      result.u[t] = load<S>(term.weights.data()) * taken<term.left>(x);
      result.v[t] = load<S>(term.weights.data()) * taken<term.right>(x);
    });
    return result;
  }

  [[nodiscard]] HAMOTOR_INLINE static Fixed fixed_factors(const X& x) noexcept {
    Fixed result;
    each<Field::fixed.size()>([&](auto t) {
      constexpr auto& term = Field::fixed[t];
      result[t] = load<S>(term.weights.data()) * taken<term.left>(x);
    });
    return result;
  }

  /// Adds the sums of products with their weights.
  [[nodiscard]] HAMOTOR_INLINE static X weighted(const Rows& sums, X onto) noexcept {
    each<products>([&](auto t) {
      constexpr auto& term = Field::products[t];
      onto[term.pack] = packed_mul_add(load<S>(term.weights.data()), sums[t], onto[term.pack]);
    });
    return onto;
  }

  /// How many terms of a list before the i-th, or of all, are added to this pack.
  template <class Terms>
  [[nodiscard]] static constexpr std::size_t before(const Terms& terms, std::size_t pack,
                                                    std::size_t i = Terms{}.size()) noexcept {
    std::size_t count = 0;
    for (std::size_t k = 0; k < i; ++k) count += terms[k].pack == pack ? 1 : 0;
    return count;
  }

  /// Sums of which every fourth term goes to the same: a quarter waits for each other.
  using Chains = std::array<X, 4>;

  HAMOTOR_INLINE void add_linear(const X& x, Chains& sums) const noexcept {
    each<Field::linear.size()>([&](auto t) {
      constexpr auto& term = Field::linear[t];
      V& sum = sums[before(Field::linear, term.pack, t) % 4][term.pack];
      sum = packed_mul_add(load<S>(term.weights.data()), taken<term.right>(x), sum);
    });
    each<Field::fixed.size()>([&](auto t) {
      constexpr auto& term = Field::fixed[t];
      constexpr std::size_t others = before(Field::linear, term.pack);
      V& sum = sums[(others + before(Field::fixed, term.pack, t)) % 4][term.pack];
      sum = packed_mul_add(at_0_.fixed[t], taken<term.right>(x), sum);
    });
  }

  [[nodiscard]] HAMOTOR_INLINE static X joined(const Chains& sums) noexcept {
    X result;
    for (std::size_t c = 0; c < packs; ++c) {
      result[c] = (sums[0][c] + sums[1][c]) + (sums[2][c] + sums[3][c]);
    }
    return result;
  }

  [[nodiscard]] HAMOTOR_INLINE X with_linear(const X& x, const X& onto) const noexcept {
    Chains sums{};
    sums[3] = onto;
    add_linear(x, sums);
    return joined(sums);
  }

  /// Coefficients of order k from those of the derivatives.
  template <std::size_t most>
  HAMOTOR_INLINE static void put(std::size_t k, const V& unit, const X& change, X& now,
                                 std::array<Coordinates, most>& x) noexcept {
    for (std::size_t c = 0; c < packs; ++c) {
      now[c] = (unit * reciprocals[k]) * change[c];
      store<S>(x[k].data() + 8 * c, now[c]);
    }
  }

  /// Coefficients of order k of the derivatives, from what products of other orders than 0 and k
  /// contribute; keeps u_k and v_k, and what they and u_1 and v_1 contribute to order k + 1.
  [[nodiscard]] HAMOTOR_INLINE X derivatives(std::size_t k, const X& now, const X& known,
                                             X& edge) noexcept {
    Chains sums{};
    sums[3] = known;
    add_linear(now, sums);
    X one{};
    X other{};
    each<products>([&](auto t) {
      constexpr auto& term = Field::products[t];
      constexpr std::size_t others = before(Field::linear, term.pack) +
                                     before(Field::fixed, term.pack) +
                                     2 * before(Field::products, term.pack, t);
      const V left = taken<term.left>(now);
      const V right = taken<term.right>(now);
      V& sum = sums[others % 4][term.pack];
      sum = packed_mul_add(at_0_.factors.u[t], right, sum);
      V& next = sums[(others + 1) % 4][term.pack];
      next = packed_mul_add(left, at_0_.factors.v[t], next);
      one[term.pack] = packed_mul_add(at_1_.u[t], right, one[term.pack]);
      if (k > 1) other[term.pack] = packed_mul_add(left, at_1_.v[t], other[term.pack]);
      store<S>(rows_.u[k].data() + 8 * t, left);
      store<S>(rows_.v[k].data() + 8 * t, right);
    });
    for (std::size_t c = 0; c < packs; ++c) edge[c] = one[c] + other[c];
    return joined(sums);
  }

  /// 1/k.
  static constexpr std::array<S, orders> reciprocals = [] {
    std::array<S, orders> result{};
    for (std::size_t k = 1; k < orders; ++k) result[k] = S(1) / S(static_cast<int>(k));
    return result;
  }();

  struct Start {
    Factors factors;
    Fixed fixed;
  };

  Start at_0_{};
  Factors at_1_{};
  CauchySums<S, products, orders> rows_;
};

#else

template <class S>
inline constexpr bool has_packs = false;

#endif

}  // namespace detail
}  // namespace hamotor
