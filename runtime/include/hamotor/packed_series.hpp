// Taylor coefficients of ẋ = c + L x + Q(x, x), eight coordinates in a register.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "hamotor/scalar.hpp"

#if defined(__GNUC__) && (defined(__AVX512F__) || defined(HAMOTOR_FUSED))
#define HAMOTOR_PACKS 1
#endif
#if defined(__AVX512F__) && defined(__GNUC__)
#include <immintrin.h>
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

#ifdef HAMOTOR_PACKS

template <class S>
inline constexpr bool has_packs = std::is_same_v<S, double> || std::is_same_v<S, float>;

template <class S>
struct Pack {
  using Lanes [[gnu::vector_size(8 * sizeof(S))]] = S;
};

template <class S>
using Lanes = typename Pack<S>::Lanes;

#ifdef __AVX512F__
[[nodiscard]] HAMOTOR_INLINE inline Lanes<double> packed_mul_add(const Lanes<double>& a,
                                                                 const Lanes<double>& b,
                                                                 const Lanes<double>& c) noexcept {
  return _mm512_fmadd_pd(a, b, c);
}

[[nodiscard]] HAMOTOR_INLINE inline Lanes<float> packed_mul_add(const Lanes<float>& a,
                                                                const Lanes<float>& b,
                                                                const Lanes<float>& c) noexcept {
  return _mm256_fmadd_ps(a, b, c);
}
#else
template <class V>
[[nodiscard]] HAMOTOR_INLINE inline V packed_mul_add(const V& a, const V& b, const V& c) noexcept {
  V sum = c;
  for (int k = 0; k < 8; ++k) sum[k] = mul_add(a[k], b[k], c[k]);
  return sum;
}
#endif

template <class S>
[[nodiscard]] HAMOTOR_INLINE inline Lanes<S> load(const S* from) noexcept {
  Lanes<S> x;
  __builtin_memcpy(&x, from, sizeof x);
  return x;
}

template <class S>
HAMOTOR_INLINE inline void store(S* to, const Lanes<S>& x) noexcept {
  __builtin_memcpy(to, &x, sizeof x);
}

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

 public:
  using Coordinates = std::array<S, width>;

  /// Coefficients of orders 1 … p of the motion through x[0], for time in `unit`, s.
  ///
  /// Flat: rows that are passed to calls return through memory.
  template <std::size_t most>
  [[gnu::flatten]] void expand(std::array<Coordinates, most>& x, std::size_t p, S unit) noexcept {
    X now{};
    for (std::size_t c = 0; c < packs; ++c) now[c] = load<S>(x[0].data() + 8 * c);
    const V in_units = V{} + unit;
    X change{};
    for (std::size_t c = 0; c < packs; ++c) change[c] = load<S>(Field::constants.data() + 8 * c);
    at_0_.fixed = fixed_factors(now);
    at_0_.u = left_factors(now);
    at_0_.v = right_factors(now);
    each<products>([&](auto t) {
      V& sum = change[Field::products[t].pack];
      sum = packed_mul_add(at_0_.u[t], at_0_.v[t], sum);
      at_0_.v[t] = load<S>(Field::products[t].weights.data()) * at_0_.v[t];
    });
    add_linear(now, change);
    for (std::size_t k = 1;; k += 2) {
      put(k, in_units, change, now, x);
      if (k == p) return;
      Rows sums{};
      Rows later{};
      if (k > 1) add_inner(k, sums, later);
      change = derivatives(k, now, sums);
      put(k + 1, in_units, change, now, x);
      if (k + 1 == p) return;
      add(1, k, later);
      if (k > 1) add(k, 1, later);
      change = derivatives(k + 1, now, later);
    }
  }

 private:
  template <std::size_t count, class Action>
  HAMOTOR_INLINE static void each(Action action) noexcept {
    [&]<std::size_t... t>(std::index_sequence<t...>) {
      (action(std::integral_constant<std::size_t, t>{}), ...);
    }(std::make_index_sequence<count>{});
  }

  /// Lanes of x in another order.
  template <std::array<int, 8> lanes>
  [[nodiscard]] HAMOTOR_INLINE static V taken(const X& x) noexcept {
    return [&]<std::size_t... l>(std::index_sequence<l...>) {
      return __builtin_shufflevector(x[0], x[packs - 1], lanes[l]...);
    }(std::make_index_sequence<8>{});
  }

  /// weight · x[left] of each of the terms.
  [[nodiscard]] HAMOTOR_INLINE static Rows left_factors(const X& x) noexcept {
    Rows result;
    each<products>([&](auto t) {
      constexpr std::size_t i = decltype(t)::value;
      result[i] = load<S>(Field::products[i].weights.data()) * taken<Field::products[i].left>(x);
    });
    return result;
  }

  [[nodiscard]] HAMOTOR_INLINE static Fixed fixed_factors(const X& x) noexcept {
    Fixed result;
    each<Field::fixed.size()>([&](auto t) {
      constexpr std::size_t i = decltype(t)::value;
      result[i] = load<S>(Field::fixed[i].weights.data()) * taken<Field::fixed[i].left>(x);
    });
    return result;
  }

  [[nodiscard]] HAMOTOR_INLINE static Rows right_factors(const X& x) noexcept {
    Rows result;
    each<products>([&](auto t) {
      constexpr std::size_t i = decltype(t)::value;
      result[i] = taken<Field::products[i].right>(x);
    });
    return result;
  }

  HAMOTOR_INLINE void add_linear(const X& x, X& change) const noexcept {
    each<Field::fixed.size()>([&](auto t) {
      constexpr std::size_t i = decltype(t)::value;
      V& sum = change[Field::fixed[i].pack];
      sum = packed_mul_add(at_0_.fixed[i], taken<Field::fixed[i].right>(x), sum);
    });
    each<Field::linear.size()>([&](auto t) {
      constexpr std::size_t i = decltype(t)::value;
      V& sum = change[Field::linear[i].pack];
      const V weights = load<S>(Field::linear[i].weights.data());
      sum = packed_mul_add(weights, taken<Field::linear[i].right>(x), sum);
    });
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

  /// Coefficients of order k of the derivatives, from Σ u_j v_{k−j} over 0 < j < k; keeps u_k, v_k.
  [[nodiscard]] HAMOTOR_INLINE X derivatives(std::size_t k, const X& now,
                                             const Rows& sums) noexcept {
    X change{};
    X other{};
    each<products>([&](auto t) { change[Field::products[t].pack] += sums[t]; });
    add_linear(now, other);
    each<products>([&](auto t) {
      constexpr std::size_t i = decltype(t)::value;
      const V left = taken<Field::products[i].left>(now);
      const V right = taken<Field::products[i].right>(now);
      V& one = change[Field::products[i].pack];
      V& two = other[Field::products[i].pack];
      one = packed_mul_add(at_0_.u[i], right, one);
      two = packed_mul_add(left, at_0_.v[i], two);
      store<S>(u_[k].data() + 8 * i, load<S>(Field::products[i].weights.data()) * left);
      store<S>(v_[k].data() + 8 * i, right);
    });
    for (std::size_t c = 0; c < packs; ++c) change[c] += other[c];
    return change;
  }

  /// Adds u_i v_j.
  HAMOTOR_INLINE void add(std::size_t i, std::size_t j, Rows& sums) const noexcept {
    each<products>([&](auto t) {
      sums[t] =
          packed_mul_add(load<S>(u_[i].data() + 8 * t), load<S>(v_[j].data() + 8 * t), sums[t]);
    });
  }

  /// Σ u_j v_{k−j} over 0 < j < k for an odd k > 1, and for k + 1 what of it is known: two orders
  /// in one pass, with half the loads.  The newest coefficients come last.
  HAMOTOR_INLINE void add_inner(std::size_t k, Rows& sums, Rows& later) const noexcept {
    if (k > 3) {
      Rows v;
      each<products>([&](auto t) { v[t] = load<S>(v_[k - 2].data() + 8 * t); });
      add(2, k - 2, sums);
      for (std::size_t j = 3; j + 2 <= k; ++j) {
        const S* const u_row = u_[j].data();
        const S* const v_row = v_[k - j].data();
        each<products>([&](auto t) {
          const V u = load<S>(u_row + 8 * t);
          later[t] = packed_mul_add(u, v[t], later[t]);
          v[t] = load<S>(v_row + 8 * t);
          sums[t] = packed_mul_add(u, v[t], sums[t]);
        });
      }
      add(k - 1, 2, later);
    }
    add(2, k - 1, later);
    add(1, k - 1, sums);
    add(k - 1, 1, sums);
  }

  /// 1/k.
  static constexpr std::array<S, orders> reciprocals = [] {
    std::array<S, orders> result{};
    for (std::size_t k = 1; k < orders; ++k) result[k] = S(1) / S(static_cast<int>(k));
    return result;
  }();

  /// Of order 0; v with the weights.
  struct Start {
    Rows u{};
    Rows v{};
    Fixed fixed{};
  };

  using Stored = std::array<S, 8 * products>;
  Start at_0_;
  alignas(64) std::array<Stored, orders> u_{};
  alignas(64) std::array<Stored, orders> v_{};
};

#else

template <class S>
inline constexpr bool has_packs = false;

#endif

}  // namespace detail
}  // namespace hamotor
