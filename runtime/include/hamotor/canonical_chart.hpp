// Canonical coordinates (ξ, p) on T*G about a motor M̂: M = M̂ exp ξ, p = dexp_−ξ^T m, m the momentum
// seen from M̂, that is m = Ad*⁻¹_{exp ξ} μ.
//
// Everything here is a function of ad_ξ or of its transpose A = ad*_ξ.  Where θ²(ξ) = Σ w_k ξ_k²
// makes ad³ = −θ² ad (rotations, rigid motions of the plane) or ad (ad² + θ²)² = 0 (rigid motions
// of space), it is a polynomial of degree 2 or 4, whose coefficients are interpolated at ad² = −θ²,
// there with their slopes.  All other groups take series.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>

#include "hamotor/compensated.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/splitting_schemes.hpp"

namespace hamotor {

namespace detail {

/// B_k/k! for even k (Bernoulli), of which each is about −1/4π² times the one before.
template <class S>
[[nodiscard]] constexpr std::array<S, 32> bernoulli_ratios() noexcept {
  // Σ_{j≤n} c_j/(n + 1 − j)! = 0 for c_j = B_j/j!, n ≥ 1.
  std::array<S, 65> c{};
  std::array<S, 66> inverse_factorial{};
  inverse_factorial[0] = S(1);
  for (std::size_t k = 1; k < 66; ++k) {
    inverse_factorial[k] = inverse_factorial[k - 1] / S(static_cast<int>(k));
  }
  c[0] = S(1);
  for (std::size_t k = 1; k < 65; ++k) {
    S sum(0);
    for (std::size_t j = 0; j < k; ++j) sum = sum + c[j] * inverse_factorial[k + 1 - j];
    c[k] = -sum;
  }
  std::array<S, 32> even{};
  for (std::size_t k = 0; k < 32; ++k) even[k] = c[2 * k + 2];
  return even;
}

/// B_k/k! for k = 2, 4, …, rounded to S once.
template <class S>
struct BernoulliRatios {
  static inline const auto values = [] {
    std::array<S, 32> rounded{};
    const auto exact = bernoulli_ratios<CoefficientScalar<S>>();
    for (std::size_t k = 0; k < rounded.size(); ++k) rounded[k] = static_cast<S>(exact[k]);
    return rounded;
  }();
};

/// Σ f^k(y)/(k+1)!.
template <class T, class Map>
[[nodiscard]] constexpr T dexp_series(const T& y, const Map& f) noexcept {
  using S = typename T::Scalar;
  T sum = y;
  T term = y;
  for (int k = 1; k < most_series_terms; ++k) {
    term = (S(1) / S(k + 1)) * f(term);
    sum = sum + term;
    if (negligible(term, sum)) break;
  }
  return sum;
}

/// Σ B_k/k! f^k(y), the inverse of `dexp_series`.
template <class T, class Map>
[[nodiscard]] constexpr T dexp_series_inverse(const T& y, const Map& f) noexcept {
  using S = typename T::Scalar;
  const auto& ratios = BernoulliRatios<S>::values;
  T power = f(y);
  T sum = mul_add(S(-0.5), power, y);
  for (std::size_t k = 0; k < ratios.size(); ++k) {
    if (k > 0) power = f(power);
    power = f(power);
    const T term = ratios[k] * power;
    sum = sum + term;
    if (negligible(term, sum)) break;
  }
  return sum;
}

/// θ² of a group and how often the factor ad² + θ² is in ad's minimal polynomial; 0 times where
/// there is no such θ².
template <std::size_t n>
struct AdjointPolynomial {
  std::array<int, n> weights{};  ///< θ² = Σ w_k ξ_k²
  int factors = 0;
};

/// Asked of the group's `ad` in integers: θ² from the trace of ad², then the identity itself.
template <class G>
[[nodiscard]] constexpr auto adjoint_polynomial() noexcept {
  using S = long double;  // of which no kernel has another form
  using Rate = typename G::template Rate<S>;
  constexpr auto n = static_cast<std::size_t>(G::dimension);
  const auto unit = [](std::size_t k) {
    std::array<S, n> x{};
    x[k] = 1;
    return Rate::from(x);
  };
  AdjointPolynomial<n> found{};
  for (int factors = 1; factors <= 2; ++factors) {
    bool is_sum_of_squares = true;
    for (std::size_t a = 0; a < n; ++a) {
      S trace = 0;
      for (std::size_t c = 0; c < n; ++c)
        trace += ad(unit(a), ad(unit(a), unit(c))).components()[c];
      found.weights[a] = static_cast<int>(trace) / (-2 * factors);
      if (trace > 0 || static_cast<S>(found.weights[a] * -2 * factors) != trace) {
        is_sum_of_squares = false;
      }
    }
    if (!is_sum_of_squares) continue;
    bool holds = true;
    int number = 5;
    const auto next = [&] {
      std::array<S, n> x{};
      for (auto& c : x) {
        number = (number * 13 + 7) % 31;
        c = static_cast<S>(number - 15);
      }
      return x;
    };
    for (std::size_t trial = 0; trial < n; ++trial) {
      const auto x = next();
      const Rate xi = Rate::from(x);
      S t = 0;
      for (std::size_t k = 0; k < n; ++k) t += static_cast<S>(found.weights[k]) * x[k] * x[k];
      Rate y = ad(xi, Rate::from(next()));
      for (int k = 0; k < factors; ++k) y = ad(xi, ad(xi, y)) + t * y;
      for (const auto& c : y.components()) holds = holds && !(c > 0 || c < 0);
    }
    if (holds) {
      found.factors = factors;
      return found;
    }
  }
  return found;
}

/// `adjoint_polynomial` where the compiler can evaluate the group's `ad`.
template <class G>
struct AdjointPolynomialOf {
  static constexpr AdjointPolynomial<static_cast<std::size_t>(G::dimension)> value{};
};
template <class G>
  requires requires { typename std::bool_constant<(adjoint_polynomial<G>().factors >= 0)>; }
struct AdjointPolynomialOf<G> {
  static constexpr auto value = adjoint_polynomial<G>();
};

/// For h² = t/4: s = sin h / h, k = cos h, and the derivatives s' = −d/2, d' = −e, e' = −f by t.
template <class S>
struct TurningFunctions {
  S s;
  S k;
  S d;
  S e;
  S f;
};

/// e and f as power series, good for 0 ≤ t < 16.
template <class S>
struct TurningSeries {
  static constexpr std::size_t terms = [] {
    double term = 16;
    for (int digit = 0; digit < scalar::Limits<S>::digits; ++digit) term *= 2;
    std::size_t count = 1;
    for (int n = 0; term > 1; ++n, ++count) term *= 4.0 / ((2 * n + 2) * (2 * n + 7));
    return count;
  }();
  using Coefficients = std::array<S, terms>;

  [[nodiscard]] static Coefficients coefficients(int first, int odd) {
    using Wide = CoefficientScalar<S>;
    Coefficients result{};
    Wide c = Wide(1) / Wide(first);
    for (std::size_t n = 0; n < terms; ++n) {
      result[n] = static_cast<S>(c);
      const int k = static_cast<int>(n);
      c = -c / Wide(4 * (2 * k + 2) * (2 * k + odd));
    }
    return result;
  }
  static inline const Coefficients e = coefficients(480, 7);
  static inline const Coefficients f = coefficients(26880, 9);
};

/// Of 0 ≤ t, by recurrence (that of spherical Bessel functions) in the direction that is stable.
template <class S>
[[nodiscard]] TurningFunctions<S> turning_functions(const S& t) noexcept {
  if (t < S(16)) {
    using Series = TurningSeries<S>;
    S e = Series::e[Series::terms - 1];
    S f = Series::f[Series::terms - 1];
    for (std::size_t n = Series::terms - 1; n-- > 0;) {
      e = mul_add(e, t, Series::e[n]);
      f = mul_add(f, t, Series::f[n]);
    }
    const S d = mul_add(S(-16) * t, f, S(40) * e);
    const S s = mul_add(S(-8) * t, e, S(12) * d);
    return {s, mul_add(-t, d, s), d, e, f};
  }
  const S h = S(0.5) * scalar::sqrt(t);
  const S s = scalar::sin(h) / h;
  const S k = scalar::cos(h);
  const S d = (s - k) / t;
  const S e = mul_add(S(1.5), d, S(-0.125) * s) / t;
  const S f = mul_add(S(2.5), e, S(-0.0625) * d) / t;
  return {s, k, d, e, f};
}

}  // namespace detail

/// The coordinates at one ξ, for any group.
template <class G, class S, int factors = detail::AdjointPolynomialOf<G>::value.factors>
class CanonicalChart {
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  static constexpr auto polynomial = detail::AdjointPolynomialOf<G>::value;
  static constexpr auto dimension = static_cast<std::size_t>(G::dimension);

 public:
  CanonicalChart() noexcept : CanonicalChart(Rate{}) {}
  [[gnu::flatten]] explicit CanonicalChart(const Rate& xi) noexcept : xi_(xi), t_(product(xi, xi)) {
    f_ = detail::turning_functions(t_);
    half_square_ = S(0.5) * f_.s * f_.s;
    half_slope_ = S(0.5) * f_.s * f_.d;
    square_ = mul_add(S(-1) * f_.k, f_.d, S(0.5) * half_square_);
    square_slope_ = mul_add(S(0.125) * f_.s, f_.d, S(-1) * f_.k * f_.e);
    const S inverse = S(1) / f_.s;
    inverse_square_ = f_.d * inverse;
    inverse_slope_ = mul_add(S(-0.5) * inverse_square_, inverse_square_, f_.e * inverse);
  }

  [[nodiscard]] const Rate& xi() const noexcept { return xi_; }

  /// The same at −ξ.
  [[nodiscard]] CanonicalChart opposite() const noexcept {
    CanonicalChart other = *this;
    other.xi_ = S(-1) * xi_;
    return other;
  }

  /// ξ̇ = dexp_ξ⁻¹ B for the body rate B; not finite at rotations by 2π.
  [[nodiscard, gnu::flatten]] Rate rate(const Rate& b) const noexcept {
    return applied(
        b, [&](const Rate& y) { return ad(xi_, y); }, S(0.5), S(0), inverse_square_,
        inverse_slope_);
  }

  /// B = dexp_ξ ξ̇.
  [[nodiscard, gnu::flatten]] Rate body_rate(const Rate& v) const noexcept {
    return applied(
        v, [&](const Rate& y) { return ad(xi_, y); }, -half_square_, -half_slope_, square_,
        square_slope_);
  }

  /// p for the momentum m seen from M̂.
  [[nodiscard, gnu::flatten]] Momentum momentum(const Momentum& m) const noexcept {
    return applied(m, turn(), half_square_, half_slope_, square_, square_slope_);
  }

  /// m for p.
  [[nodiscard, gnu::flatten]] Momentum seen_from_center(const Momentum& p) const noexcept {
    return applied(p, turn(), S(-0.5), S(0), inverse_square_, inverse_slope_);
  }

  /// The body's momentum Ad*_{exp ξ} m.
  [[nodiscard, gnu::flatten]] Momentum body_momentum(const Momentum& m) const noexcept {
    return applied(m, turn(), f_.s * f_.k, mul_add(S(0.5) * f_.d, f_.k, S(0.125) * f_.s * f_.s),
                   half_square_, half_slope_);
  }

  /// ṗ where ξ̇ = v and ṁ is known.
  [[nodiscard, gnu::flatten]] Momentum momentum_rate(const Rate& v, const Momentum& m,
                                                     const Momentum& m_rate) const noexcept {
    const S turns = S(2) * product(xi_, v);
    const Momentum one = coadjoint(xi_, m);
    const Momentum two = coadjoint(xi_, one);
    const Momentum d_one = coadjoint(v, m) + coadjoint(xi_, m_rate);
    const Momentum d_two = coadjoint(v, one) + coadjoint(xi_, d_one);
    const Momentum sum = mul_add(square_, d_two, mul_add(half_square_, d_one, m_rate));
    if constexpr (factors == 1) {
      return mul_add(-turns * half_slope_, one, mul_add(-turns * square_slope_, two, sum));
    } else {
      const Momentum three = coadjoint(xi_, two);
      const Momentum four = coadjoint(xi_, three);
      const Momentum d_three = coadjoint(v, two) + coadjoint(xi_, d_two);
      const Momentum d_four = coadjoint(v, three) + coadjoint(xi_, d_three);
      const S half_curve = S(0.25) * mul_add(f_.d, f_.d, S(2) * f_.s * f_.e);
      const S square_curve = mul_add(S(0.0625) * f_.d, f_.d, S(-1) * f_.k * f_.f);
      return mul_add(half_slope_, mul_add(t_, d_one, d_three),
                     mul_add(square_slope_, mul_add(t_, d_two, d_four),
                             mul_add(-turns * half_curve, mul_add(t_, one, three),
                                     mul_add(-turns * square_curve, mul_add(t_, two, four), sum))));
    }
  }

 private:
  /// (1 + (odd + odd_slope z) f + (even + even_slope z) f²) y with z = f² + θ².
  template <class T, class Map>
  [[nodiscard]] T applied(const T& y, const Map& f, const S& odd, const S& odd_slope, const S& even,
                          const S& even_slope) const noexcept {
    const T one = f(y);
    const T two = f(one);
    const T sum = mul_add(even, two, mul_add(odd, one, y));
    if constexpr (factors == 1) {
      return sum;
    } else {
      const T three = f(two);
      return mul_add(odd_slope, mul_add(t_, one, three),
                     mul_add(even_slope, mul_add(t_, two, f(three)), sum));
    }
  }

  [[nodiscard]] auto turn() const noexcept {
    return [this](const Momentum& y) { return coadjoint(xi_, y); };
  }

  /// The scalar product of which θ² is the square.
  [[nodiscard]] static S product(const Rate& a, const Rate& b) noexcept {
    const auto x = a.components();
    const auto y = b.components();
    S sum(0);
    for (std::size_t k = 0; k < dimension; ++k) {
      if (polynomial.weights[k] != 0) sum = mul_add(S(polynomial.weights[k]) * x[k], y[k], sum);
    }
    return sum;
  }

  // Functions of z = ad² at z = −θ², and slopes by z; curves are second derivatives.
  Rate xi_{};
  S t_{};
  detail::TurningFunctions<S> f_{};
  S half_square_{};  ///< (cosh √z − 1)/z
  S half_slope_{};
  S square_{};  ///< (sinh √z − √z)/√z³
  S square_slope_{};
  S inverse_square_{};  ///< ((√z/2) coth (√z/2) − 1)/z
  S inverse_slope_{};
};

/// By series in ad.
template <class G, class S>
class CanonicalChart<G, S, 0> {
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;

 public:
  CanonicalChart() = default;
  explicit CanonicalChart(const Rate& xi) noexcept : xi_(xi) {}

  [[nodiscard]] const Rate& xi() const noexcept { return xi_; }

  [[nodiscard]] CanonicalChart opposite() const noexcept { return CanonicalChart(S(-1) * xi_); }

  [[nodiscard]] Rate rate(const Rate& b) const noexcept {
    return detail::dexp_series_inverse(b, [&](const Rate& y) { return ad(y, xi_); });
  }

  [[nodiscard]] Rate body_rate(const Rate& v) const noexcept {
    return detail::dexp_series(v, [&](const Rate& y) { return ad(y, xi_); });
  }

  [[nodiscard]] Momentum momentum(const Momentum& m) const noexcept {
    return detail::dexp_series(m, turn());
  }

  [[nodiscard]] Momentum seen_from_center(const Momentum& p) const noexcept {
    return detail::dexp_series_inverse(p, turn());
  }

  [[nodiscard]] Momentum body_momentum(const Momentum& m) const noexcept {
    return m + detail::momentum_change(m, xi_);
  }

  [[nodiscard]] Momentum momentum_rate(const Rate& v, const Momentum& m,
                                       const Momentum& m_rate) const noexcept {
    Momentum term = m;
    Momentum change = m_rate;
    Momentum sum = m_rate;
    for (int k = 1; k < detail::most_series_terms; ++k) {
      const S by = S(1) / S(k + 1);
      change = by * (coadjoint(v, term) + coadjoint(xi_, change));
      term = by * coadjoint(xi_, term);
      sum = sum + change;
      if (detail::negligible(change, sum) && k > 1) break;
    }
    return sum;
  }

 private:
  [[nodiscard]] auto turn() const noexcept {
    return [this](const Momentum& y) { return coadjoint(xi_, y); };
  }

  Rate xi_{};
};

}  // namespace hamotor
