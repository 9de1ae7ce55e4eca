// Taylor coefficients of ẋ = c + L x + Q(x, x), eight coordinates in a register.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "hamotor/scalar.hpp"

#if defined(__AVX512F__) && defined(__GNUC__)
#define HAMOTOR_PACKS 1
#include <immintrin.h>
#endif

namespace hamotor {

/// Eight terms weight · x[left] · x[right] of the derivatives of one pack of coordinates.
template <class S>
struct PackedTerm {
  std::size_t pack;
  std::array<int, 8> left;
  std::array<int, 8> right;
  std::array<S, 8> weights;
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

[[nodiscard]] HAMOTOR_INLINE inline Lanes<double> packed_mul_add(Lanes<double> a, Lanes<double> b,
                                                                 Lanes<double> c) noexcept {
  return _mm512_fmadd_pd(a, b, c);
}

[[nodiscard]] HAMOTOR_INLINE inline Lanes<float> packed_mul_add(Lanes<float> a, Lanes<float> b,
                                                                Lanes<float> c) noexcept {
  return _mm256_fmadd_ps(a, b, c);
}

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

  /// Coefficients of orders 1 … p of the motion through x[0].
  template <std::size_t most>
  void expand(std::array<Coordinates, most>& x, std::size_t p) noexcept {
    X now{};
    for (std::size_t c = 0; c < packs; ++c) now[c] = load<S>(x[0].data() + 8 * c);
    const Fixed fixed = fixed_factors(now);
    const Rows u0 = left_factors(now);
    const Rows v0 = right_factors(now);
    X change{};
    for (std::size_t c = 0; c < packs; ++c) change[c] = load<S>(Field::constants.data() + 8 * c);
    each<products>([&](auto t) {
      V& sum = change[Field::products[t].pack];
      sum = packed_mul_add(u0[t], v0[t], sum);
    });
    add_linear(now, fixed, change);
    for (std::size_t k = 1;; ++k) {
      const S over = S(1) / S(static_cast<int>(k));
      for (std::size_t c = 0; c < packs; ++c) {
        now[c] = over * change[c];
        store<S>(x[k].data() + 8 * c, now[c]);
      }
      if (k == p) return;
      Rows sums = inner_sums(k);
      const Rows u = left_factors(now);
      const Rows v = right_factors(now);
      each<products>([&](auto t) {
        store<S>(u_[k].data() + 8 * t, u[t]);
        store<S>(v_[k].data() + 8 * t, v[t]);
        sums[t] = packed_mul_add(u0[t], v[t], packed_mul_add(u[t], v0[t], sums[t]));
      });
      change = X{};
      add_linear(now, fixed, change);
      each<products>([&](auto t) { change[Field::products[t].pack] += sums[t]; });
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

  HAMOTOR_INLINE static void add_linear(const X& x, const Fixed& fixed, X& change) noexcept {
    each<Field::fixed.size()>([&](auto t) {
      constexpr std::size_t i = decltype(t)::value;
      V& sum = change[Field::fixed[i].pack];
      sum = packed_mul_add(fixed[i], taken<Field::fixed[i].right>(x), sum);
    });
    each<Field::linear.size()>([&](auto t) {
      constexpr std::size_t i = decltype(t)::value;
      V& sum = change[Field::linear[i].pack];
      const V weights = load<S>(Field::linear[i].weights.data());
      sum = packed_mul_add(weights, taken<Field::linear[i].right>(x), sum);
    });
  }

  /// Σ u_j v_{k−j} over 0 < j < k, the newest coefficients last.
  [[nodiscard]] HAMOTOR_INLINE Rows inner_sums(std::size_t k) const noexcept {
    Rows rising{};
    Rows falling{};
    std::size_t j = k / 2;
    if (k % 2 == 0 && j > 0) {
      each<products>([&](auto t) {
        rising[t] = load<S>(u_[j].data() + 8 * t) * load<S>(v_[j].data() + 8 * t);
      });
      --j;
    }
    for (; j > 0; --j) {
      const S* const u_low = u_[j].data();
      const S* const v_low = v_[j].data();
      const S* const u_high = u_[k - j].data();
      const S* const v_high = v_[k - j].data();
      each<products>([&](auto t) {
        rising[t] = packed_mul_add(load<S>(u_low + 8 * t), load<S>(v_high + 8 * t), rising[t]);
        falling[t] = packed_mul_add(load<S>(u_high + 8 * t), load<S>(v_low + 8 * t), falling[t]);
      });
    }
    each<products>([&](auto t) { rising[t] += falling[t]; });
    return rising;
  }

  using Stored = std::array<S, 8 * products>;
  alignas(64) std::array<Stored, orders> u_{};
  alignas(64) std::array<Stored, orders> v_{};
};

#else

template <class S>
inline constexpr bool has_packs = false;

#endif

}  // namespace detail
}  // namespace hamotor
