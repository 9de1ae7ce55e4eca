// Canonical coordinates (ξ, p) on T*G about a motor M̂: M = M̂ exp ξ, or M̂ exp x exp θ where ξ is a
// translation x and a turn θ, and p the momentum that ξ̇ is paired with.  m is the body's momentum
// turned back to the frame of M̂.
//
// Where turns obey ad³ = −θ² ad, θ²(ξ) = Σ w_k ξ_k², everything is a polynomial of degree 2 in
// ad_θ or in its transpose.  All other groups take series.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>

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

/// θ² of a group of turns and translations; nothing turns or all is turned by what turns.
template <std::size_t n>
struct TurningPart {
  std::array<int, n> weights{};  ///< θ² = Σ w_k ξ_k², 0 for a translation
  bool is_all = false;           ///< whether the group is that
  bool has_translations = false;

  /// ξ without translations, or nothing but these.
  template <bool turns, class T>
  [[nodiscard]] constexpr T part(const T& xi) const noexcept {
    auto x = xi.components();
    for (std::size_t k = 0; k < n; ++k) {
      if ((weights[k] != 0) != turns) x[k] = typename T::Scalar(0);
    }
    return T::from(x);
  }
};

/// Asked of the group's `ad` in integers: θ² from the trace of ad², then that translations are an
/// abelian ideal, turns a subalgebra, and ad³ = −θ² ad for these.
template <class G>
[[nodiscard]] constexpr auto turning_part() noexcept {
  using S = long double;  // of which no kernel has another form
  using Rate = typename G::template Rate<S>;
  constexpr auto n = static_cast<std::size_t>(G::dimension);
  const auto unit = [](std::size_t k) {
    std::array<S, n> x{};
    x[k] = 1;
    return Rate::from(x);
  };
  // ad turns the translations of space as it turns the turns: θ² counts twice in the trace.
  for (const int times : {1, 2}) {
    TurningPart<n> found{};
    found.is_all = true;
    for (std::size_t a = 0; a < n; ++a) {
      S trace = 0;
      for (std::size_t c = 0; c < n; ++c)
        trace += ad(unit(a), ad(unit(a), unit(c))).components()[c];
      found.weights[a] = static_cast<int>(trace) / (-2 * times);
      found.has_translations = found.has_translations || found.weights[a] == 0;
      if (trace > 0 || static_cast<S>(found.weights[a] * -2 * times) != trace) {
        found.is_all = false;
      }
    }
    const auto is_none = [&](const Rate& x) {
      for (const auto& c : x.components()) found.is_all = found.is_all && !(c > 0 || c < 0);
    };
    int number = 5;
    const auto next = [&] {
      std::array<S, n> x{};
      for (auto& c : x) {
        number = (number * 13 + 7) % 31;
        c = static_cast<S>(number - 15);
      }
      return Rate::from(x);
    };
    for (std::size_t trial = 0; trial < n; ++trial) {
      const Rate x = next();
      const Rate turn = found.template part<true>(x);
      const Rate shift = found.template part<false>(x);
      S t = 0;
      for (std::size_t k = 0; k < n; ++k) {
        t += static_cast<S>(found.weights[k]) * x.components()[k] * x.components()[k];
      }
      const Rate y = next();
      const Rate once = ad(turn, y);
      is_none(ad(turn, ad(turn, once)) + t * once);
      is_none(found.template part<false>(ad(turn, found.template part<true>(y))));
      is_none(found.template part<true>(ad(shift, y)));
      is_none(ad(shift, found.template part<false>(y)));
    }
    if (found.is_all) return found;
  }
  return TurningPart<n>{};
}

/// One product of a bracket with a turn: out_k ± θ_i y_j.
struct BracketTerm {
  std::size_t k;
  std::size_t i;
  std::size_t j;
  int sign;
};

/// Those of [θ, y], or of its transpose on momenta: `ad` and `coadjoint` multiply by all of ξ.
template <class G, bool transposed>
[[nodiscard]] constexpr auto turning_bracket() noexcept {
  using S = long double;
  constexpr auto n = static_cast<std::size_t>(G::dimension);
  constexpr auto group = turning_part<G>();
  const auto unit = []<class T>(T, std::size_t k) {
    std::array<S, n> x{};
    x[k] = 1;
    return T::from(x);
  };
  struct {
    std::array<BracketTerm, n * n * n> terms{};
    std::size_t count = 0;
  } found;
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = 0; i < n; ++i) {
      if (group.weights[i] == 0) continue;
      const auto turn = unit(typename G::template Rate<S>{}, i);
      std::array<S, n> result{};
      if constexpr (transposed) {
        result = coadjoint(turn, unit(typename G::template Momentum<S>{}, j)).components();
      } else {
        result = ad(turn, unit(typename G::template Rate<S>{}, j)).components();
      }
      for (std::size_t k = 0; k < n; ++k) {
        const int sign = static_cast<int>(result[k]);
        if (sign != 0) found.terms[found.count++] = {k, i, j, sign};
      }
    }
  }
  return found;
}

/// `turning_part` where the compiler can evaluate the group's `ad`.
template <class G>
struct TurningPartOf {
  static constexpr TurningPart<static_cast<std::size_t>(G::dimension)> value{};
};
template <class G>
  requires requires { typename std::bool_constant<turning_part<G>().is_all>; }
struct TurningPartOf<G> {
  static constexpr auto value = turning_part<G>();
};

/// For h² = t/4: s = sin h / h, k = cos h, and the derivatives s' = −d/2, d' = −e by t.
template <class S>
struct TurningFunctions {
  S s;
  S k;
  S d;
  S e;
};

/// e and f = −e' as power series, good for 0 ≤ t < 16.
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
    return {s, mul_add(-t, d, s), d, e};
  }
  const S h = S(0.5) * scalar::sqrt(t);
  const S s = scalar::sin(h) / h;
  const S k = scalar::cos(h);
  const S d = (s - k) / t;
  const S e = mul_add(S(1.5), d, S(-0.125) * s) / t;
  return {s, k, d, e};
}

}  // namespace detail

/// The coordinates at one ξ, for any group.
///
/// Where translations are apart they are made first, M = M̂ exp x exp θ, and m is seen from where
/// the body is, in the frame of M̂: place and P, turn and spin are coordinates of their own, and no
/// spin is the difference of moments of P about another place, many radii of gyration away.
template <class G, class S, bool closed = detail::TurningPartOf<G>::value.is_all>
class CanonicalChart {
  using Element = typename G::template Element<S>;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  static constexpr auto group = detail::TurningPartOf<G>::value;
  static constexpr auto dimension = static_cast<std::size_t>(G::dimension);

 public:
  /// Whether translations are apart.
  static constexpr bool translates = group.has_translations;

  CanonicalChart() noexcept : CanonicalChart(Rate{}) {}
  [[gnu::flatten]] explicit CanonicalChart(const Rate& xi) noexcept : xi_(xi), t_(product(xi, xi)) {
    f_ = detail::turning_functions(t_);
    half_square_ = S(0.5) * f_.s * f_.s;
    square_ = mul_add(S(-1) * f_.k, f_.d, S(0.5) * half_square_);
    inverse_square_ = f_.d / f_.s;
  }

  [[nodiscard]] const Rate& xi() const noexcept { return xi_; }

  /// The same at −ξ.
  [[nodiscard]] CanonicalChart opposite() const noexcept {
    CanonicalChart other = *this;
    other.xi_ = S(-1) * xi_;
    return other;
  }

  /// M̂~M.
  [[nodiscard, gnu::flatten]] Element element() const noexcept {
    if constexpr (translates) {
      const Rate one = bracket(turn(), shift());
      return exp(mul_add(inverse_square_, bracket(turn(), one), mul_add(S(-0.5), one, xi_)));
    } else {
      return exp(xi_);
    }
  }

  /// X with M = M₀ exp X for the motor M₀ at −ξ.
  [[nodiscard, gnu::flatten]] Rate whole_logarithm() const noexcept {
    Rate half = xi_;
    if constexpr (translates) {
      half = mul_add(-square_ / (f_.s * f_.k), bracket(turn(), bracket(turn(), shift())), half);
    }
    return S(2) * half;
  }

  /// ξ̇ for the body rate B; not finite at rotations by 2π.
  [[nodiscard, gnu::flatten]] Rate rate(const Rate& b) const noexcept {
    const Rate one = bracket(turn(), b);
    const Rate two = bracket(turn(), one);
    return joined(polynomial(b, one, two, S(0.5), inverse_square_),
                  polynomial(b, one, two, f_.s * f_.k, half_square_));
  }

  /// B for ξ̇.
  [[nodiscard, gnu::flatten]] Rate body_rate(const Rate& v) const noexcept {
    const Rate one = bracket(turn(), v);
    const Rate two = bracket(turn(), one);
    return joined(polynomial(v, one, two, -half_square_, square_),
                  polynomial(v, one, two, -f_.s * f_.k, half_square_));
  }

  /// p for m.
  [[nodiscard, gnu::flatten]] Momentum momentum(const Momentum& m) const noexcept {
    const Momentum one = bracket(turn(), m);
    return joined(polynomial(m, one, bracket(turn(), one), half_square_, square_), m);
  }

  /// m for p.
  [[nodiscard, gnu::flatten]] Momentum seen_from_center(const Momentum& p) const noexcept {
    const Momentum one = bracket(turn(), p);
    return joined(polynomial(p, one, bracket(turn(), one), S(-0.5), inverse_square_), p);
  }

  /// The body's momentum.
  [[nodiscard, gnu::flatten]] Momentum body_momentum(const Momentum& m) const noexcept {
    const Momentum one = bracket(turn(), m);
    return polynomial(m, one, bracket(turn(), one), f_.s * f_.k, half_square_);
  }

  /// ṗ where ξ̇ = v and ṁ is known.
  [[nodiscard, gnu::flatten]] Momentum momentum_rate(const Rate& v, const Momentum& m,
                                                     const Momentum& m_rate) const noexcept {
    const S turns = S(2) * product(xi_, v);
    const Rate turning = group.template part<true>(v);
    const Momentum one = bracket(turn(), m);
    const Momentum two = bracket(turn(), one);
    const Momentum d_one = bracket(turning, m) + bracket(turn(), m_rate);
    const Momentum d_two = bracket(turning, one) + bracket(turn(), d_one);
    const S half_slope = S(0.5) * f_.s * f_.d;
    const S square_slope = mul_add(S(0.125) * f_.s, f_.d, S(-1) * f_.k * f_.e);
    const Momentum sum = mul_add(square_, d_two, mul_add(half_square_, d_one, m_rate));
    return joined(mul_add(-turns * half_slope, one, mul_add(-turns * square_slope, two, sum)),
                  m_rate);
  }

  /// What of a rate turns the frame in which m is seen.
  [[nodiscard]] static Rate turn_of(const Rate& x) noexcept { return group.template part<true>(x); }

  /// And what does not.
  [[nodiscard]] static Rate shift_of(const Rate& x) noexcept {
    return group.template part<false>(x);
  }

 private:
  /// y + odd f(y) + even f²(y).
  template <class T>
  [[nodiscard]] static T polynomial(const T& y, const T& one, const T& two, const S& odd,
                                    const S& even) noexcept {
    return mul_add(even, two, mul_add(odd, one, y));
  }

  /// What turns of one, and the translations of the other.
  template <class T>
  [[nodiscard]] static T joined(const T& turns, const T& shifts) noexcept {
    auto x = turns.components();
    if constexpr (translates) {
      const auto y = shifts.components();
      for (std::size_t k = 0; k < dimension; ++k) {
        if (group.weights[k] == 0) x[k] = y[k];
      }
    }
    return T::from(x);
  }

  /// [θ, y], or [μ, θ].
  template <class T>
  [[nodiscard]] static T bracket(const Rate& turn, const T& of) noexcept {
    static constexpr auto bracket = detail::turning_bracket<G, std::is_same_v<T, Momentum>>();
    const auto x = turn.components();
    const auto y = of.components();
    std::array<S, dimension> sum{};
    [&]<std::size_t... t>(std::index_sequence<t...>) {
      const auto add = [&]<std::size_t at>(std::integral_constant<std::size_t, at>) {
        constexpr auto term = bracket.terms[at];
        static_assert(term.sign == 1 || term.sign == -1);
        sum[term.k] = mul_add(term.sign > 0 ? x[term.i] : -x[term.i], y[term.j], sum[term.k]);
      };
      (add(std::integral_constant<std::size_t, t>{}), ...);
    }(std::make_index_sequence<bracket.count>{});
    return T::from(sum);
  }

  [[nodiscard]] Rate turn() const noexcept { return group.template part<true>(xi_); }
  [[nodiscard]] Rate shift() const noexcept { return group.template part<false>(xi_); }

  /// The scalar product of which θ² is the square.
  [[nodiscard]] static S product(const Rate& a, const Rate& b) noexcept {
    const auto x = a.components();
    const auto y = b.components();
    S sum(0);
    for (std::size_t k = 0; k < dimension; ++k) {
      if (group.weights[k] != 0) sum = mul_add(S(group.weights[k]) * x[k], y[k], sum);
    }
    return sum;
  }

  Rate xi_{};
  S t_{};
  detail::TurningFunctions<S> f_{};
  S half_square_{};     ///< (1 − cos θ)/θ²
  S square_{};          ///< (θ − sin θ)/θ³
  S inverse_square_{};  ///< (1 − (θ/2) cot (θ/2))/θ²
};

/// By series in ad.
template <class G, class S>
class CanonicalChart<G, S, false> {
  using Element = typename G::template Element<S>;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;

 public:
  static constexpr bool translates = false;

  CanonicalChart() noexcept : CanonicalChart(Rate{}) {}
  explicit CanonicalChart(const Rate& xi) noexcept : CanonicalChart(xi, exp(xi)) {}

  [[nodiscard]] const Rate& xi() const noexcept { return xi_; }

  [[nodiscard]] CanonicalChart opposite() const noexcept {
    return CanonicalChart(S(-1) * xi_, reverse(element_));
  }

  [[nodiscard]] const Element& element() const noexcept { return element_; }

  [[nodiscard]] Rate whole_logarithm() const noexcept { return S(2) * xi_; }

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
    return Ad_star(element_, m);
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

  [[nodiscard]] static const Rate& turn_of(const Rate& x) noexcept { return x; }

 private:
  CanonicalChart(const Rate& xi, const Element& element) noexcept : xi_(xi), element_(element) {}

  [[nodiscard]] auto turn() const noexcept {
    return [this](const Momentum& y) { return coadjoint(xi_, y); };
  }

  Rate xi_;
  Element element_;
};

}  // namespace hamotor
