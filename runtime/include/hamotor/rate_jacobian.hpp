// Jacobians of exp and log on a Lie group of rotors: dexp and its inverse.
//
// dexp(X, Y) = Σ (−1)^k/(k+1)! ad_X^k Y: where M = M₀ exp X, its body rate ~M M' is dexp(X, X').
// Where ad_X³ = −Θ² ad_X with Θ² = t + t_J J, J central in the group's algebra (rotations, rigid
// motions, the groups of every algebra with at most four dimensions),
//
//     dexp = 1 + a(Θ²) ad + b(Θ²) ad²,  dexp⁻¹ = 1 + ad/2 + c(Θ²) ad²,
//     a = −(1 − cos θ)/θ²,  b = (θ − sin θ)/θ³,  c = (1 − (θ/2) cot (θ/2))/θ².
//
// J² = 0 takes f(t) and f'(t) t_J, J² = −1 the function of a complex number, J² = 1 two real ones.
// With h = θ/2, s = sin h / h, k = cos h and d = (s − k)/θ² all follow without cancellation: a is
// −s²/2, b is (1 − s k)/θ², c is d/s.  Near θ = 0, where d and b would cancel, they are series.
// All other groups: by doubling, dexp_{2X} = ½ (1 + Ad exp(−X)) dexp_X, from a short series.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "hamotor/scalar.hpp"

namespace hamotor::scalar {

/// f(ad) = 1 + (linear + linear_j J) ad + (square + square_j J) ad².
template <class S>
struct RateJacobian {
  S linear;
  S linear_j;
  S square;
  S square_j;
};

namespace detail {

/// x + i y; + − * / only, and with numbers from the left.
template <class S>
struct Complex {
  S x;
  S y;

  friend constexpr Complex operator+(const Complex& a, const Complex& b) noexcept {
    return {a.x + b.x, a.y + b.y};
  }
  friend constexpr Complex operator-(const Complex& a, const Complex& b) noexcept {
    return {a.x - b.x, a.y - b.y};
  }
  friend constexpr Complex operator*(const Complex& a, const Complex& b) noexcept {
    return {mul_add(a.x, b.x, -a.y * b.y), mul_add(a.x, b.y, a.y * b.x)};
  }
  friend constexpr Complex operator*(const S& a, const Complex& b) noexcept {
    return {a * b.x, a * b.y};
  }
  friend constexpr Complex operator/(const Complex& a, const Complex& b) noexcept {
    // Scaled, so that the square of the divisor stays in range.
    const S size = max_abs(b.x, b.y);
    const S re = b.x / size;
    const S im = b.y / size;
    const S norm = size * mul_add(re, re, im * im);
    return {mul_add(a.x, re, a.y * im) / norm, mul_add(a.y, re, -a.x * im) / norm};
  }
};

template <class S>
[[nodiscard]] constexpr S one_of(const S&) noexcept {
  return S(1);
}

template <class S>
[[nodiscard]] constexpr Complex<S> one_of(const Complex<S>&) noexcept {
  return {S(1), S(0)};
}

/// |Θ²| below which the series are taken; they have no singularity there, nor anywhere.
inline constexpr int series_limit = 16;

/// Terms that bring Σ (±16)^n / (2n + 3)! below an eighth of an ulp of its value.
template <class S>
[[nodiscard]] constexpr int jacobian_terms() noexcept {
  double term = 64;
  for (int digit = 1; digit < Limits<S>::digits; ++digit) term *= 2;
  int n = 0;
  while (term > 1) {
    term *= static_cast<double>(series_limit) / ((2 * n + 4) * (2 * n + 5));
    ++n;
  }
  return n;
}

// Ratios of one coefficient to the one before it, of b, −b', d and −d' in −Θ² or −Θ²/4.
struct RatioB {
  template <class S>
  static constexpr S at(int n) {
    return S(1) / S((2 * n + 4) * (2 * n + 5));
  }
};
struct RatioB1 {
  template <class S>
  static constexpr S at(int n) {
    return S(n + 2) / S((n + 1) * (2 * n + 6) * (2 * n + 7));
  }
};
struct RatioD {
  template <class S>
  static constexpr S at(int n) {
    return S(1) / S((2 * n + 2) * (2 * n + 5));
  }
};
struct RatioD1 {
  template <class S>
  static constexpr S at(int n) {
    return S(1) / S((2 * n + 2) * (2 * n + 7));
  }
};

/// 1 + r₀ x (1 + r₁ x (1 + …)).
template <class Ratio, class S, int n = 0, class Z>
[[nodiscard]] constexpr Z nested_series(const Z& x) noexcept {
  if constexpr (n == jacobian_terms<S>()) {
    return one_of(x);
  } else {
    return one_of(x) + (Ratio::template at<S>(n) * x) * nested_series<Ratio, S, n + 1>(x);
  }
}

/// s = sin h / h, k = cos h, d = (s − k)/Θ², b = (1 − s k)/Θ² for h = √Θ²/2.
template <class Z>
struct HalfAngle {
  Z s;
  Z k;
  Z d;
  Z b;
};

template <class S>
[[nodiscard]] constexpr HalfAngle<S> with_quotients(const S& t, const S& s, const S& k) noexcept {
  const bool near = abs(t) < S(series_limit);
  const S d = S(1) / S(12) * nested_series<RatioD, S>(S(-0.25) * t);
  const S b = S(1) / S(6) * nested_series<RatioB, S>(-t);
  return {s, k, select(near, d, (s - k) / t), select(near, b, (S(1) - s * k) / t)};
}

/// t ≥ 0: a rotation.
template <class S>
[[nodiscard]] S sinc_half(const S& t) noexcept {
  const S h = S(0.5) * sqrt(t);
  return select(h > S(0), sin(h) / h, S(1));
}

template <class S>
[[nodiscard]] HalfAngle<S> half_rotation(const S& t) noexcept {
  return with_quotients(t, sinc_half(t), S(cos(S(0.5) * sqrt(t))));
}

/// Any sign of t: a boost where it is negative.
template <class S>
[[nodiscard]] HalfAngle<S> half_motion(const S& t) noexcept {
  const S h = S(0.5) * sqrt(abs(t));
  const bool boost = t < S(0);
  const S s = select(h > S(0), select(boost, S(sinh(h)), S(sin(h))) / h, S(1));
  return with_quotients(t, s, select(boost, S(cosh(h)), S(cos(h))));
}

template <class S>
[[nodiscard]] HalfAngle<Complex<S>> half_complex(const Complex<S>& t) noexcept {
  // The root's larger part has no cancellation; the smaller one follows from it.
  const S size = max_abs(t.x, t.y);
  const bool moves = size > Limits<S>::epsilon() * Limits<S>::epsilon();  // else s = k = 1
  const S inverse = select(moves, S(1) / size, S(0));
  const S x = t.x * inverse;
  const S y = t.y * inverse;
  const S larger = sqrt(size) * sqrt(S(0.5) * (abs(x) + sqrt(mul_add(x, x, y * y))));
  const S smaller = select(larger > S(0), S(0.5) * t.y / larger, S(0));
  const bool turns = t.x > S(0);
  const Complex<S> h{S(0.5) * select(turns, larger, smaller),
                     S(0.5) * select(turns, smaller, larger)};
  const S sin_x = sin(h.x);
  const S cos_x = cos(h.x);
  const S sinh_y = sinh(h.y);
  const S cosh_y = cosh(h.y);
  const Complex<S> ratio = Complex<S>{sin_x * cosh_y, cos_x * sinh_y} / h;
  const Complex<S> s{select(moves, ratio.x, S(1)), select(moves, ratio.y, S(0))};
  const Complex<S> k{cos_x * cosh_y, -sin_x * sinh_y};
  const Complex<S> one{S(1), S(0)};
  const bool near = size < S(series_limit);
  const Complex<S> near_d = S(1) / S(12) * nested_series<RatioD, S>(S(-0.25) * t);
  const Complex<S> near_b = S(1) / S(6) * nested_series<RatioB, S>(S(-1) * t);
  const Complex<S> far_d = (s - k) / t;
  const Complex<S> far_b = (one - s * k) / t;
  return {s,
          k,
          {select(near, near_d.x, far_d.x), select(near, near_d.y, far_d.y)},
          {select(near, near_b.x, far_b.x), select(near, near_b.y, far_b.y)}};
}

template <class S>
[[nodiscard]] constexpr RateJacobian<S> dexp_of(const HalfAngle<S>& f) noexcept {
  return {S(-0.5) * (f.s * f.s), S(0), f.b, S(0)};
}

template <class S>
[[nodiscard]] constexpr RateJacobian<S> dexp_inverse_of(const HalfAngle<S>& f) noexcept {
  return {S(0.5), S(0), f.d / f.s, S(0)};
}

/// a' = s d/2, and b' = (s²/4 − 3b/2)/t.
template <class S>
[[nodiscard]] constexpr RateJacobian<S> dexp_of(const HalfAngle<S>& f, const S& t,
                                                const S& t_j) noexcept {
  const S near = S(-1) / S(120) * nested_series<RatioB1, S>(-t);
  const S far = mul_add(S(-1.5), f.b, S(0.25) * (f.s * f.s)) / t;
  const S slope = select(abs(t) < S(series_limit), near, far);
  return {S(-0.5) * (f.s * f.s), S(0.5) * (f.s * f.d) * t_j, f.b, slope * t_j};
}

/// c' = d'/s + d²/(2 s²), with d' = (s/8 − 3d/2)/t.
template <class S>
[[nodiscard]] constexpr RateJacobian<S> dexp_inverse_of(const HalfAngle<S>& f, const S& t,
                                                        const S& t_j) noexcept {
  const S near = S(-1) / S(480) * nested_series<RatioD1, S>(S(-0.25) * t);
  const S far = mul_add(S(-1.5), f.d, S(0.125) * f.s) / t;
  const S slope = select(abs(t) < S(series_limit), near, far);
  const S c = f.d / f.s;
  return {S(0.5), S(0), c, mul_add(S(0.5) * c, c, slope / f.s) * t_j};
}

}  // namespace detail

/// dexp for Θ² = t ≥ 0.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_rotation(const S& t) noexcept {
  return detail::dexp_of(detail::half_rotation(t));
}

/// dexp for real Θ² = t of any sign.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_motion(const S& t) noexcept {
  return detail::dexp_of(detail::half_motion(t));
}

/// dexp for Θ² = t + t_J J with J² = 0, t ≥ 0.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_dual_rotation(const S& t, const S& t_j) noexcept {
  return detail::dexp_of(detail::half_rotation(t), t, t_j);
}

/// dexp for Θ² = t + t_J J with J² = 0, t of any sign.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_dual_motion(const S& t, const S& t_j) noexcept {
  return detail::dexp_of(detail::half_motion(t), t, t_j);
}

/// dexp for Θ² = t + t_J J with J² = −1.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_complex(const S& t, const S& t_j) noexcept {
  const auto f = detail::half_complex(detail::Complex<S>{t, t_j});
  const auto linear = S(-0.5) * (f.s * f.s);
  return {linear.x, linear.y, f.b.x, f.b.y};
}

/// dexp⁻¹ for Θ² = t ≥ 0; not finite at θ = 2π, 4π, …, where dexp is singular.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_inverse_rotation(const S& t) noexcept {
  return detail::dexp_inverse_of(detail::half_rotation(t));
}

/// dexp⁻¹ for real Θ² = t of any sign.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_inverse_motion(const S& t) noexcept {
  return detail::dexp_inverse_of(detail::half_motion(t));
}

/// dexp⁻¹ for Θ² = t + t_J J with J² = 0, t ≥ 0.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_inverse_dual_rotation(const S& t, const S& t_j) noexcept {
  return detail::dexp_inverse_of(detail::half_rotation(t), t, t_j);
}

/// dexp⁻¹ for Θ² = t + t_J J with J² = 0, t of any sign.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_inverse_dual_motion(const S& t, const S& t_j) noexcept {
  return detail::dexp_inverse_of(detail::half_motion(t), t, t_j);
}

/// dexp⁻¹ for Θ² = t + t_J J with J² = −1.
template <class S>
[[nodiscard]] RateJacobian<S> dexp_inverse_complex(const S& t, const S& t_j) noexcept {
  const auto f = detail::half_complex(detail::Complex<S>{t, t_j});
  const auto square = f.d / f.s;
  return {S(0.5), S(0), square.x, square.y};
}

namespace detail {

/// dexp of several rates at one x: a series for x / 2^n, then n doublings.
///
/// The eigenvalues of ad_x are at most 2 `size` in absolute value.  Those of x / 2^n are at most
/// 1/4, so that after n terms less than 4⁻ⁿ/(n + 1)! is left, but for the polynomial factor of
/// a Jordan block, which has at most nine vectors.
template <class S, class Rate, std::size_t count>
void transform_by_dexp(const Rate& x, const S& size, std::array<Rate, count>& rates) noexcept {
  constexpr int terms = 9 + jacobian_terms<S>();
  int doublings = 0;
  S scale(1);
  while (doublings < Limits<S>::max_exponent && size * scale > S(0.125)) {
    scale = S(0.5) * scale;
    ++doublings;
  }
  Rate part = scale * x;
  for (Rate& y : rates) {
    Rate total = y;
    for (int n = terms; n > 1; --n) total = mul_add(S(-1) / S(n), ad(part, total), y);
    y = total;
  }
  for (; doublings > 0; --doublings) {
    const auto back = exp(-part);
    for (Rate& y : rates) y = S(0.5) * (y + Ad(back, y));
    part = part + part;
  }
}

}  // namespace detail

/// dexp(x, y) for a group of any kind; `size` bounds the eigenvalues of x as a rotor's bivector.
/// Found with the rate: ad, exp and Ad.  Every step is an average, which nothing amplifies.
template <class S, class Rate>
[[nodiscard]] Rate dexp_by_doubling(const Rate& x, const Rate& y, const S& size) noexcept {
  std::array<Rate, 1> rates{y};
  detail::transform_by_dexp(x, size, rates);
  return rates[0];
}

/// dexp(x, ·)⁻¹ y for a group of any kind, by elimination with partial pivoting in rows and
/// columns of one size, since rates of translation may be of any.  Not finite, or as large as
/// rounding leaves it, where dexp is singular.
template <class S, class Rate>
[[nodiscard]] Rate dexp_inverse_by_elimination(const Rate& x, const Rate& y,
                                               const S& size) noexcept {
  constexpr std::size_t n = Rate::size;
  std::array<Rate, n> images{};
  for (std::size_t i = 0; i < n; ++i) {
    std::array<S, n> unit{};
    unit[i] = S(1);
    images[i] = Rate::from(unit);
  }
  detail::transform_by_dexp(x, size, images);
  std::array<std::array<S, n + 1>, n> rows{};
  for (std::size_t column = 0; column < n; ++column) {
    const auto image = images[column].components();
    for (std::size_t i = 0; i < n; ++i) rows[i][column] = image[i];
  }
  const auto wanted = y.components();
  std::array<S, n> column_size{};
  for (std::size_t i = 0; i < n; ++i) {
    S largest(0);
    for (std::size_t k = 0; k < n; ++k) largest = max_abs(largest, rows[i][k]);
    for (std::size_t k = 0; k < n; ++k) {
      rows[i][k] = rows[i][k] / largest;
      column_size[k] = max_abs(column_size[k], rows[i][k]);
    }
    rows[i][n] = wanted[i] / largest;
  }
  for (auto& row : rows) {
    for (std::size_t k = 0; k < n; ++k) row[k] = row[k] / column_size[k];
  }
  // Columns with few entries first: the translations of a semidirect product are then solved for
  // before the rest, into which nothing of theirs leaks.
  std::array<std::size_t, n> order{};
  for (std::size_t step = 0; step < n; ++step) order[step] = step;
  for (std::size_t step = 0; step < n; ++step) {
    std::size_t fewest = n + 1;
    for (std::size_t k = step; k < n; ++k) {
      std::size_t entries = 0;
      for (std::size_t i = step; i < n; ++i) {
        if (abs(rows[i][order[k]]) > S(0)) ++entries;
      }
      if (entries < fewest) {
        fewest = entries;
        std::swap(order[step], order[k]);
      }
    }
    const std::size_t column = order[step];
    std::size_t pivot = step;
    for (std::size_t i = step + 1; i < n; ++i) {
      if (abs(rows[i][column]) > abs(rows[pivot][column])) pivot = i;
    }
    std::swap(rows[step], rows[pivot]);
    for (std::size_t i = step + 1; i < n; ++i) {
      if (!(abs(rows[i][column]) > S(0))) continue;
      const S factor = -rows[i][column] / rows[step][column];
      for (std::size_t k = 0; k <= n; ++k) {
        rows[i][k] = mul_add(factor, rows[step][k], rows[i][k]);
      }
      rows[i][column] = S(0);
    }
  }
  std::array<S, n> found{};
  for (std::size_t step = n; step-- > 0;) {
    S rest = rows[step][n];
    for (std::size_t k = step + 1; k < n; ++k) {
      rest = mul_add(-rows[step][order[k]], found[order[k]], rest);
    }
    found[order[step]] = rest / rows[step][order[step]];
  }
  for (std::size_t k = 0; k < n; ++k) found[k] = found[k] / column_size[k];
  return Rate::from(found);
}

}  // namespace hamotor::scalar
