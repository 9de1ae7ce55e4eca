// What a group of rigid motions acts on: its points and directions, how a line of force is a
// momentum, and the few operations on motors that are cheaper than a whole product.
//
// One specialisation of `Space` for each group; everything that is written over it serves them all.
#pragma once

#include <array>
#include <cstddef>

#include "hamotor/scalar.hpp"

namespace hamotor {

namespace pga3 {
template <class S>
struct Motor;
template <class S>
struct Rotor;
template <class S>
struct Bivector;
template <class S>
struct IdealLine;
template <class S>
struct Point;
template <class S>
struct Origin;
template <class S>
struct Direction;
struct SE3;
struct SO3;
namespace se3 {
template <class S>
struct Momentum;
}
namespace so3 {
template <class S>
struct Momentum;
}
}  // namespace pga3

namespace pga2 {
template <class S>
struct Motor;
template <class S>
struct Line;
template <class S>
struct Point;
template <class S>
struct Origin;
template <class S>
struct Direction;
struct SE2;
namespace se2 {
template <class S>
struct Momentum;
}
}  // namespace pga2

/// q − 1 for a rotation's rotor q = 1 + cosine_less_one − Σ sines_k E_k, E = e23, e31, e12 (or
/// e12): sines = sin(θ/2) n, with all digits however small the angle.
template <class S, std::size_t R>
struct RotorIncrement {
  S cosine_less_one;
  std::array<S, R> sines;
};

namespace detail {

/// Sums that begin with nothing, where others begin with an array's components.
struct Nothing {
  struct Zero {};
  [[nodiscard]] HAMOTOR_INLINE constexpr Zero operator[](std::size_t) const noexcept { return {}; }
};

/// The same of nothing.
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S onto(Nothing::Zero, const S& a, const S& b,
                                              const Rest&... rest) noexcept {
  return hamotor::onto(a * b, rest...);
}
template <class S, class... Rest>
[[nodiscard]] HAMOTOR_INLINE constexpr S less(Nothing::Zero, const S& a, const S& b,
                                              const Rest&... rest) noexcept {
  return hamotor::less(-(a * b), rest...);
}
using hamotor::less;
using hamotor::onto;

/// The products of components, and what they add to others; types of as many components.
template <class T, class Other>
[[nodiscard]] HAMOTOR_INLINE constexpr T each_times(const T& a, const Other& b) noexcept {
  auto x = a.components();
  const auto y = b.components();
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = x[k] * y[k];
  return T::from(x);
}
template <class T, class A, class B>
[[nodiscard]] HAMOTOR_INLINE constexpr T each_mul_add(const A& a, const B& b, const T& c) noexcept {
  const auto x = a.components();
  const auto y = b.components();
  auto z = c.components();
  for (std::size_t k = 0; k < z.size(); ++k) z[k] = mul_add(x[k], y[k], z[k]);
  return T::from(z);
}

/// A factor of 1 that costs nothing.
struct One {
  template <class T>
  [[nodiscard]] HAMOTOR_INLINE friend constexpr T operator*(const One&, const T& x) noexcept {
    return x;
  }
  template <class T>
  [[nodiscard]] HAMOTOR_INLINE friend constexpr T mul_add(const One&, const T& x,
                                                          const T& y) noexcept {
    return x + y;
  }
};

/// Each component by a factor.
template <class Factor, class S, std::size_t D>
[[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, D> scaled(const Factor& factor,
                                                               std::array<S, D> x) noexcept {
  for (auto& component : x) component = factor * component;
  return x;
}
/// x + factor y.
template <class Factor, class S, std::size_t D>
[[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, D> sum_with(
    std::array<S, D> x, const Factor& factor, const std::array<S, D>& y) noexcept {
  for (std::size_t k = 0; k < D; ++k) x[k] = mul_add(factor, y[k], x[k]);
  return x;
}

/// The angular part of a momentum's or rate's components.
template <std::size_t R, class S, std::size_t D>
[[nodiscard]] constexpr std::array<S, R> first(const std::array<S, D>& x) noexcept {
  std::array<S, R> result{};
  for (std::size_t k = 0; k < R; ++k) result[k] = x[k];
  return result;
}

/// What follows the first R components.
template <std::size_t R, class S, std::size_t D>
[[nodiscard]] constexpr std::array<S, D - R> rest(const std::array<S, D>& x) noexcept {
  std::array<S, D - R> result{};
  for (std::size_t k = R; k < D; ++k) result[k - R] = x[k];
  return result;
}

template <class S, std::size_t A, std::size_t B>
[[nodiscard]] constexpr std::array<S, A + B> joined(const std::array<S, A>& a,
                                                    const std::array<S, B>& b) noexcept {
  std::array<S, A + B> result{};
  for (std::size_t k = 0; k < A; ++k) result[k] = a[k];
  for (std::size_t k = 0; k < B; ++k) result[A + k] = b[k];
  return result;
}

/// Half a rotation's matrix, by rows: rotors make it without a factor 2, and what is turned by it
/// can have that.
template <class S, std::size_t D>
struct HalfTurn {
  std::array<std::array<S, D>, D> rows;

  /// start + ½ R x.
  [[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, D> turned(
      std::array<S, D> start, const std::array<S, D>& x) const noexcept {
    for (std::size_t i = 0; i < D; ++i) {
      for (std::size_t k = 0; k < D; ++k) start[i] = mul_add(rows[i][k], x[k], start[i]);
    }
    return start;
  }
  /// ½ Rᵀ x.
  [[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, D> turned_back(
      const std::array<S, D>& x) const noexcept {
    std::array<S, D> y{};
    for (std::size_t i = 0; i < D; ++i) {
      y[i] = rows[0][i] * x[0];
      for (std::size_t k = 1; k < D; ++k) y[i] = mul_add(rows[k][i], x[k], y[i]);
    }
    return y;
  }
};

/// `start` and the moment x × f.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, 3> with_moment(
    const std::array<S, 3>& start, const std::array<S, 3>& x, const std::array<S, 3>& f) noexcept {
  return {less(onto(start[0], x[1], f[2]), x[2], f[1]),
          less(onto(start[1], x[2], f[0]), x[0], f[2]),
          less(onto(start[2], x[0], f[1]), x[1], f[0])};
}
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, 1> with_moment(
    const std::array<S, 1>& start, const std::array<S, 2>& x, const std::array<S, 2>& f) noexcept {
  return {less(onto(start[0], x[0], f[1]), x[1], f[0])};
}

}  // namespace detail

/// Geometry of the space on which G acts; specialised for each group.
template <class G>
struct Space;

/// Rigid motions of space.
template <>
struct Space<pga3::SE3> {
  static constexpr std::size_t dimension = 3;  ///< of the space
  static constexpr std::size_t rotations = 3;  ///< of the generators, the first so many
  static constexpr bool translates = true;
  template <class S>
  using Point = pga3::Point<S>;
  template <class S>
  using Origin = pga3::Origin<S>;
  template <class S>
  using Direction = pga3::Direction<S>;

  /// The momentum (x × f, f) of a force line x ∨ f.
  template <class S>
  [[nodiscard]] static constexpr pga3::se3::Momentum<S> wrench(
      const pga3::Bivector<S>& line) noexcept {
    return {line.e01, line.e02, line.e03, line.e23, line.e31, line.e12};
  }

  /// μ + a (x × f, f).
  template <class S, class Factor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga3::se3::Momentum<S> with_force(
      const pga3::se3::Momentum<S>& mu, const Factor& a, const pga3::Point<S>& x,
      const std::array<S, 3>& f) noexcept {
    return with_lever(mu, a, scaled(a, x), f);
  }
  /// The same where a x is known.
  template <class S, class Factor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga3::se3::Momentum<S> with_lever(
      const pga3::se3::Momentum<S>& mu, const Factor& a, const pga3::Point<S>& lever,
      const std::array<S, 3>& f) noexcept {
    const auto& [x1, x2, x3] = lever;
    return {dot(mu.l23, x2, f[2], -x3, f[1]), dot(mu.l31, x3, f[0], -x1, f[2]),
            dot(mu.l12, x1, f[1], -x2, f[0]), mul_add(a, f[0], mu.p1),
            mul_add(a, f[1], mu.p2),          mul_add(a, f[2], mu.p3)};
  }

  /// a x.
  template <class S, class Factor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga3::Point<S> scaled(
      const Factor& a, const pga3::Point<S>& x) noexcept {
    return {a * x.e032, a * x.e013, a * x.e021};
  }

  /// x − ~M o M of the origin o, in two parts: half of it.
  static constexpr int origin_parts = 2;
  template <class S>
  [[nodiscard]] HAMOTOR_INLINE static constexpr std::array<S, 3> from_origin(
      const pga3::Point<S>& x, const pga3::Motor<S>& m) noexcept {
    using detail::less;
    using detail::onto;
    const S half(0.5);
    return {less(onto(half * x.e032, m.e02, m.e12), m.e01, m.s, m.e03, m.e31, m.e0123, m.e23),
            less(onto(half * x.e013, m.e03, m.e23), m.e02, m.s, m.e01, m.e12, m.e0123, m.e31),
            less(onto(half * x.e021, m.e01, m.e31), m.e03, m.s, m.e02, m.e23, m.e0123, m.e12)};
  }

  /// How a body is turned: s, e23, e31, e12 of its motor.
  template <class S>
  using Attitude = std::array<S, 4>;
  template <class S>
  [[nodiscard]] static constexpr Attitude<S> attitude(const pga3::Motor<S>& m) noexcept {
    return {m.s, m.e23, m.e31, m.e12};
  }
  /// The motor of a body that is turned so, with its frame's origin at x.
  template <class S>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga3::Motor<S> motor(
      const Attitude<S>& a, const std::array<S, 3>& x) noexcept {
    using detail::less;
    const std::array<S, 3> h{S(0.5) * x[0], S(0.5) * x[1], S(0.5) * x[2]};
    return {a[0],
            a[1],
            a[2],
            a[3],
            less(h[1] * a[3], h[2], a[2], h[0], a[0]),
            less(h[2] * a[1], h[0], a[3], h[1], a[0]),
            less(h[0] * a[2], h[1], a[1], h[2], a[0]),
            less(detail::Nothing::Zero{}, h[0], a[1], h[1], a[2], h[2], a[3])};
  }
  template <class S>
  [[nodiscard]] HAMOTOR_INLINE static constexpr detail::HalfTurn<S, 3> half_turn(
      const Attitude<S>& a) noexcept {
    const S first = less_product(a[3], a[3], S(0.5));
    const S third = less_product(a[1], a[1], S(0.5));
    const S xy = a[1] * a[2];
    const S yz = a[2] * a[3];
    const S zx = a[3] * a[1];
    return {
        {{{less_product(a[2], a[2], first), mul_add(a[0], a[3], xy), less_product(a[0], a[2], zx)},
          {less_product(a[0], a[3], xy), less_product(a[1], a[1], first), mul_add(a[0], a[1], yz)},
          {mul_add(a[0], a[2], zx), less_product(a[0], a[1], yz),
           less_product(a[2], a[2], third)}}}};
  }

  /// `start` and 2 a B of a rate B that turns.
  template <class Start, class S>
  [[nodiscard]] HAMOTOR_INLINE static constexpr Attitude<S> with_twice_turning(
      const Start& start, const Attitude<S>& a, const std::array<S, 3>& w) noexcept {
    using detail::less;
    using detail::onto;
    return {onto(start[0], a[1], w[0], a[2], w[1], a[3], w[2]),
            less(onto(start[1], a[2], w[2]), a[0], w[0], a[3], w[1]),
            less(onto(start[2], a[3], w[0]), a[0], w[1], a[1], w[2]),
            less(onto(start[3], a[1], w[1]), a[0], w[2], a[2], w[0])};
  }

  /// M put back on the group, by −½ (M ~M − 1) M, and the largest coefficient of M ~M − 1.
  template <class S>
  HAMOTOR_INLINE static constexpr S put_back(pga3::Motor<S>& m) noexcept {
    const S defect = dot(S(-1), m.s, m.s, m.e23, m.e23, m.e31, m.e31, m.e12, m.e12);
    const S e0123 = detail::less(m.e0123 * m.s, m.e01, m.e23, m.e02, m.e31, m.e03, m.e12);
    const S half = S(-0.5) * defect;
    m = {mul_add(half, m.s, m.s),
         mul_add(half, m.e23, m.e23),
         mul_add(half, m.e31, m.e31),
         mul_add(half, m.e12, m.e12),
         dot(m.e01, half, m.e01, e0123, m.e23),
         dot(m.e02, half, m.e02, e0123, m.e31),
         dot(m.e03, half, m.e03, e0123, m.e12),
         less_product(e0123, m.s, mul_add(half, m.e0123, m.e0123))};
    return scalar::max_abs(defect, e0123 + e0123);
  }

  /// M becomes x M put back on the group, as good as without that factor; the same of x M.
  template <class S>
  HAMOTOR_INLINE static constexpr S put_back(pga3::Motor<S>& m, const S& x) noexcept {
    const S square = dot(m.s, m.s, m.e23, m.e23, m.e31, m.e31, m.e12, m.e12);
    const S e0123 = detail::less(m.e0123 * m.s, m.e01, m.e23, m.e02, m.e31, m.e03, m.e12);
    const S by = mul_add(S(-0.5) * x * x * x, square, S(1.5) * x);
    const S across = x * x * x * e0123;
    m = {by * m.s,
         by * m.e23,
         by * m.e31,
         by * m.e12,
         mul_add(by, m.e01, across * m.e23),
         mul_add(by, m.e02, across * m.e31),
         mul_add(by, m.e03, across * m.e12),
         less_product(across, m.s, by * m.e0123)};
    return scalar::max_abs(mul_add(x * x, square, S(-1)), S(2) * x * x * e0123);
  }

  /// M T − M for the translation T by d, in the body frame.
  template <class S>
  [[nodiscard]] static constexpr pga3::Motor<S> translation_change(
      const pga3::Motor<S>& m, const std::array<S, 3>& d) noexcept {
    const pga3::IdealLine<S> half{S(-0.5) * d[0], S(-0.5) * d[1], S(-0.5) * d[2]};
    return pga3::Motor<S>::from(gp(m, half).components());
  }

  /// M q − M.
  template <class S>
  [[nodiscard]] static constexpr pga3::Motor<S> rotation_change(
      const pga3::Motor<S>& m, const RotorIncrement<S, 3>& q) noexcept {
    return gp(m, pga3::Rotor<S>{q.cosine_less_one, -q.sines[0], -q.sines[1], -q.sines[2]});
  }
};

/// Rotations of space about a fixed point, the frame's origin.
template <>
struct Space<pga3::SO3> {
  static constexpr std::size_t dimension = 3;
  static constexpr std::size_t rotations = 3;
  static constexpr bool translates = false;
  template <class S>
  using Point = pga3::Point<S>;
  template <class S>
  using Origin = pga3::Origin<S>;
  template <class S>
  using Direction = pga3::Direction<S>;

  /// The angular momentum x × f of a force line x ∨ f; the pivot bears the rest.
  template <class S>
  [[nodiscard]] static constexpr pga3::so3::Momentum<S> wrench(
      const pga3::Bivector<S>& line) noexcept {
    return {line.e01, line.e02, line.e03};
  }

  /// μ + a x × f.
  template <class S, class Factor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga3::so3::Momentum<S> with_force(
      const pga3::so3::Momentum<S>& mu, const Factor& a, const pga3::Point<S>& x,
      const std::array<S, 3>& f) noexcept {
    return with_lever(mu, a, scaled(a, x), f);
  }
  /// The same where a x is known.
  template <class S, class Factor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga3::so3::Momentum<S> with_lever(
      const pga3::so3::Momentum<S>& mu, const Factor&, const pga3::Point<S>& lever,
      const std::array<S, 3>& f) noexcept {
    const auto& [x1, x2, x3] = lever;
    return {dot(mu.l23, x2, f[2], -x3, f[1]), dot(mu.l31, x3, f[0], -x1, f[2]),
            dot(mu.l12, x1, f[1], -x2, f[0])};
  }

  /// a x.
  template <class S, class Factor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga3::Point<S> scaled(
      const Factor& a, const pga3::Point<S>& x) noexcept {
    return {a * x.e032, a * x.e013, a * x.e021};
  }

  /// M put back on the group, by −½ (M ~M − 1) M, and |M ~M − 1|.
  template <class S>
  HAMOTOR_INLINE static constexpr S put_back(pga3::Rotor<S>& m) noexcept {
    const S defect = dot(S(-1), m.s, m.s, m.e23, m.e23, m.e31, m.e31, m.e12, m.e12);
    const S half = S(-0.5) * defect;
    m = mul_add(half, m, m);
    return scalar::abs(defect);
  }

  /// M becomes x M put back on the group; |x² M ~M − 1|.
  template <class S>
  HAMOTOR_INLINE static constexpr S put_back(pga3::Rotor<S>& m, const S& x) noexcept {
    const S square = dot(m.s, m.s, m.e23, m.e23, m.e31, m.e31, m.e12, m.e12);
    m = mul_add(S(-0.5) * x * x * x, square, S(1.5) * x) * m;
    return scalar::abs(mul_add(x * x, square, S(-1)));
  }

  /// M q − M.
  template <class S>
  [[nodiscard]] static constexpr pga3::Rotor<S> rotation_change(
      const pga3::Rotor<S>& m, const RotorIncrement<S, 3>& q) noexcept {
    return gp(m, pga3::Rotor<S>{q.cosine_less_one, -q.sines[0], -q.sines[1], -q.sines[2]});
  }
};

/// Rigid motions of the plane.
template <>
struct Space<pga2::SE2> {
  static constexpr std::size_t dimension = 2;
  static constexpr std::size_t rotations = 1;
  static constexpr bool translates = true;
  template <class S>
  using Point = pga2::Point<S>;
  template <class S>
  using Origin = pga2::Origin<S>;
  template <class S>
  using Direction = pga2::Direction<S>;

  /// The momentum (x × f, f) of a force line x ∨ f.
  template <class S>
  [[nodiscard]] static constexpr pga2::se2::Momentum<S> wrench(const pga2::Line<S>& line) noexcept {
    return {line.e0, line.e2, -line.e1};
  }

  /// μ + a (x × f, f).
  template <class S, class Factor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga2::se2::Momentum<S> with_force(
      const pga2::se2::Momentum<S>& mu, const Factor& a, const pga2::Point<S>& x,
      const std::array<S, 2>& f) noexcept {
    return with_lever(mu, a, scaled(a, x), f);
  }
  /// The same where a x is known.
  template <class S, class Factor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga2::se2::Momentum<S> with_lever(
      const pga2::se2::Momentum<S>& mu, const Factor& a, const pga2::Point<S>& lever,
      const std::array<S, 2>& f) noexcept {
    return {dot(mu.l12, lever.e20, f[1], -lever.e01, f[0]), mul_add(a, f[0], mu.p1),
            mul_add(a, f[1], mu.p2)};
  }

  /// a x.
  template <class S, class Factor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga2::Point<S> scaled(
      const Factor& a, const pga2::Point<S>& x) noexcept {
    return {a * x.e20, a * x.e01};
  }

  /// x − ~M o M of the origin o.
  static constexpr int origin_parts = 1;
  template <class S>
  [[nodiscard]] static constexpr std::array<S, 2> from_origin(const pga2::Point<S>& x,
                                                              const pga2::Motor<S>& m) noexcept {
    const auto y = sandwich(reverse(m), pga2::Origin<S>{});
    return {x.e20 - y.e20, x.e01 - y.e01};
  }

  /// How a body is turned: s, e12 of its motor.
  template <class S>
  using Attitude = std::array<S, 2>;
  template <class S>
  [[nodiscard]] static constexpr Attitude<S> attitude(const pga2::Motor<S>& m) noexcept {
    return {m.s, m.e12};
  }
  /// The motor of a body that is turned so, with its frame's origin at x.
  template <class S>
  [[nodiscard]] HAMOTOR_INLINE static constexpr pga2::Motor<S> motor(
      const Attitude<S>& a, const std::array<S, 2>& x) noexcept {
    using detail::less;
    const std::array<S, 2> h{S(0.5) * x[0], S(0.5) * x[1]};
    return {a[0], a[1], less(h[1] * a[1], h[0], a[0]),
            less(detail::Nothing::Zero{}, h[0], a[1], h[1], a[0])};
  }
  template <class S>
  [[nodiscard]] HAMOTOR_INLINE static constexpr detail::HalfTurn<S, 2> half_turn(
      const Attitude<S>& a) noexcept {
    const S cosine = less_product(a[1], a[1], S(0.5));
    const S sine = a[0] * a[1];
    return {{{{cosine, sine}, {-sine, cosine}}}};
  }

  /// `start` and 2 a B of a rate B that turns.
  template <class Start, class S>
  [[nodiscard]] HAMOTOR_INLINE static constexpr Attitude<S> with_twice_turning(
      const Start& start, const Attitude<S>& a, const std::array<S, 1>& w) noexcept {
    return {detail::onto(start[0], a[1], w[0]), detail::less(start[1], a[0], w[0])};
  }

  /// M put back on the group, by −½ (M ~M − 1) M, and |M ~M − 1|.
  template <class S>
  HAMOTOR_INLINE static constexpr S put_back(pga2::Motor<S>& m) noexcept {
    const S defect = dot(S(-1), m.s, m.s, m.e12, m.e12);
    const S half = S(-0.5) * defect;
    m = mul_add(half, m, m);
    return scalar::abs(defect);
  }

  /// M becomes x M put back on the group; |x² M ~M − 1|.
  template <class S>
  HAMOTOR_INLINE static constexpr S put_back(pga2::Motor<S>& m, const S& x) noexcept {
    const S square = dot(m.s, m.s, m.e12, m.e12);
    m = mul_add(S(-0.5) * x * x * x, square, S(1.5) * x) * m;
    return scalar::abs(mul_add(x * x, square, S(-1)));
  }

  /// M T − M for the translation T by d, in the body frame.
  template <class S>
  [[nodiscard]] static constexpr pga2::Motor<S> translation_change(
      const pga2::Motor<S>& m, const std::array<S, 2>& d) noexcept {
    return pga2::Motor<S>::from(
        gp(m, pga2::Direction<S>{S(0.5) * d[1], S(-0.5) * d[0]}).components());
  }

  /// M q − M.
  template <class S>
  [[nodiscard]] static constexpr pga2::Motor<S> rotation_change(
      const pga2::Motor<S>& m, const RotorIncrement<S, 1>& q) noexcept {
    return gp(m, pga2::Motor<S>{q.cosine_less_one, -q.sines[0], S(0), S(0)});
  }
};

/// A point from its coordinates x, y and, in space, z.
template <class G, class S>
[[nodiscard]] constexpr typename Space<G>::template Point<S> point(
    const std::array<S, Space<G>::dimension>& x) noexcept {
  return Space<G>::template Point<S>::from(x);
}

/// A direction from its coordinates x, y and, in space, z.
template <class G, class S>
[[nodiscard]] constexpr typename Space<G>::template Direction<S> direction(
    const std::array<S, Space<G>::dimension>& x) noexcept {
  return Space<G>::template Direction<S>::from(x);
}

}  // namespace hamotor
