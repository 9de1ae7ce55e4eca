// The motion of a free rigid body in closed form, at any time at the cost of a step.
//
// Momenta are Jacobi's elliptic functions of time, the attitude is an elliptic integral of the
// third kind (Jacobi 1849; van Zon & Schofield 2007).  Both are taken as theta functions, whose
// series need four terms for sixteen digits: in the nome q where k² ≤ ½, in the complementary nome,
// as hyperbolic functions, where k² > ½, so that nothing is special about symmetric bodies (q = 0)
// or about the separatrix (q' = 0).
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

#include "hamotor/scalar.hpp"
#include "hamotor/space.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/systems.hpp"

namespace hamotor {

namespace detail {

/// In what a motion's constants are computed: frequencies are multiplied by the time, and their
/// errors with them, so that a few more digits are kept where the processor has them.
template <class S>
struct SetUpScalar {
  using type = S;
};
template <>
struct SetUpScalar<float> {
  using type = double;
};
template <>
struct SetUpScalar<double> {
  using type = long double;
};

/// x as hi + lo in a narrower scalar.
template <class S, class Wide>
[[nodiscard]] constexpr DoubleWord<S> in_two_words(const Wide& x) noexcept {
  const S hi = static_cast<S>(x);
  return {hi, static_cast<S>(x - static_cast<Wide>(hi))};
}

/// a b of double-word numbers, to about twice the working precision.
template <class S>
[[nodiscard]] constexpr DoubleWord<S> product(const DoubleWord<S>& a,
                                              const DoubleWord<S>& b) noexcept {
  const S hi = a.hi * b.hi;
  return scalar::two_sum(hi,
                         scalar::product_error(a.hi, b.hi, hi) + mul_add(a.hi, b.lo, a.lo * b.hi));
}

template <class S>
[[nodiscard]] constexpr DoubleWord<S> sum(const DoubleWord<S>& a, const DoubleWord<S>& b) noexcept {
  const auto hi = scalar::two_sum(a.hi, b.hi);
  return scalar::two_sum(hi.hi, hi.lo + (a.lo + b.lo));
}

/// The integer next to x.
template <class S>
[[nodiscard]] constexpr S nearest(const S& x) noexcept {
  return scalar::floor(x + S(0.5));
}

/// sin and cos of 2π x.
template <class S>
[[nodiscard]] constexpr Turn<S> sin_cos_of_turns(const DoubleWord<S>& x) noexcept {
  const S angle = S(2) * scalar::pi<S>() * ((x.hi - nearest(x.hi)) + x.lo);
  return {scalar::sin(angle), scalar::cos(angle)};
}

/// Arithmetic-geometric mean of 1 and 0 < x ≤ 1.
template <class S>
[[nodiscard]] constexpr S agm_of_one(const S& x) noexcept {
  S a(1);
  S b = x;
  // Quadratic: what is left of (a − b)² is below the last digit.
  const S enough = scalar::sqrt(scalar::Limits<S>::epsilon()) / S(4);
  for (int i = 0; i < 64 && a - b > enough * a; ++i) {
    const S mean = S(0.5) * (a + b);
    b = scalar::sqrt(a * b);
    a = mean;
  }
  return S(0.5) * (a + b);
}

/// Carlson's R_F(x, y, 1) for 0 ≤ x, y ≤ 1, not both 0, by duplication (Carlson 1995).
template <class S>
[[nodiscard]] constexpr S carlson_rf(const S& x_given, const S& y_given) noexcept {
  S x = x_given;
  S y = y_given;
  S z(1);
  // The series leaves out eighth powers of the deviations.
  const S enough = scalar::sqrt(scalar::sqrt(scalar::sqrt(scalar::Limits<S>::epsilon()))) / S(2);
  S centre = (x + y + z) / S(3);
  S dx(0);
  S dy(0);
  for (int i = 0; i < 16 * scalar::Limits<S>::digits; ++i) {
    dx = (centre - x) / centre;
    dy = (centre - y) / centre;
    if (scalar::max_abs(dx, dy, dx + dy) < enough) break;
    const S a = scalar::sqrt(x);
    const S b = scalar::sqrt(y);
    const S c = scalar::sqrt(z);
    const S step = a * b + c * (a + b);
    x = (x + step) / S(4);
    y = (y + step) / S(4);
    z = (z + step) / S(4);
    centre = (x + y + z) / S(3);
  }
  const S dz = -(dx + dy);
  const S e2 = dx * dy - dz * dz;
  const S e3 = dx * dy * dz;
  const S series = S(1) - e2 / S(10) + e3 / S(14) + e2 * e2 / S(24) - S(3) * e2 * e3 / S(44) -
                   S(5) * e2 * e2 * e2 / S(208) + S(3) * e3 * e3 / S(104) + e2 * e2 * e3 / S(16);
  return series / scalar::sqrt(centre);
}

/// xⁿ.
template <class S>
[[nodiscard]] constexpr S power(const S& x, std::size_t n) noexcept {
  S result(1);
  S square = x;
  for (; n > 0; n /= 2) {
    if (n % 2 == 1) result = result * square;
    square = square * square;
  }
  return result;
}

/// How many terms of Σ q^(n² − n), from n = 0, stand out of the rounding errors for q ≤ exp(−π).
template <class S>
[[nodiscard]] constexpr std::size_t theta_terms() noexcept {
  std::size_t n = 1;
  while (453 * n * (n - 1) < 100 * static_cast<std::size_t>(scalar::Limits<S>::digits)) ++n;
  return n;
}

/// The same of Σ q^(n²/2).
template <class S>
[[nodiscard]] constexpr std::size_t half_theta_terms() noexcept {
  std::size_t n = 1;
  while (226 * n * n < 100 * static_cast<std::size_t>(scalar::Limits<S>::digits)) ++n;
  return n;
}

/// A point of a free rotation in the frame of `FreeRotation`, all up to a common positive factor:
/// Π, |Π|, and the phase about Π that is periodic in time.
template <class S>
struct RotationPhase {
  S x, y, z;
  S length;
  S real, imaginary;
};

/// Theta functions of the nome q ≤ exp(−π), for k² ≤ ½.
template <class S>
struct CircularSeries {
  static constexpr std::size_t terms = theta_terms<S>();
  std::array<S, terms> x{};          ///< of cos (2n + 1) v
  std::array<S, terms> y{};          ///< of sin (2n + 1) v
  std::array<S, terms> z{};          ///< of cos 2n v
  std::array<S, terms> length{};     ///< of cos 2n v
  std::array<S, terms> real{};       ///< of cos 2n v
  std::array<S, terms> imaginary{};  ///< of sin 2n v

  /// At v = 2π `turns`.
  [[nodiscard]] constexpr RotationPhase<S> at(const S& turns) const noexcept {
    const auto one = sin_cos_of_turns(DoubleWord<S>{turns, S(0)});
    const Turn<S> two{S(2) * one.sin * one.cos, mul_add(S(-2) * one.sin, one.sin, S(1))};
    RotationPhase<S> r{x[0] * one.cos, y[0] * one.sin, z[0], length[0], real[0], S(0)};
    Turn<S> even{S(0), S(1)};
    for (std::size_t n = 1; n < terms; ++n) {
      even = {mul_add(even.sin, two.cos, even.cos * two.sin),
              mul_add(even.cos, two.cos, -even.sin * two.sin)};
      const S odd_cos = mul_add(even.cos, one.cos, -even.sin * one.sin);
      const S odd_sin = mul_add(even.sin, one.cos, even.cos * one.sin);
      r.x = mul_add(x[n], odd_cos, r.x);
      r.y = mul_add(y[n], odd_sin, r.y);
      r.z = mul_add(z[n], even.cos, r.z);
      r.length = mul_add(length[n], even.cos, r.length);
      r.real = mul_add(real[n], even.cos, r.real);
      r.imaginary = mul_add(imaginary[n], even.sin, r.imaginary);
    }
    return r;
  }
};

/// Theta functions of the complementary nome q' ≤ exp(−π), for k² > ½, over the exponential that
/// they grow with.
template <class S>
struct HyperbolicSeries {
  static constexpr std::size_t terms = theta_terms<S>();
  static constexpr std::size_t phase_terms = half_theta_terms<S>();
  S root_nome{};  ///< √q'
  S x{};
  S y{};
  S z{};
  std::array<S, terms> odd{};              ///< q'^(n²)
  std::array<S, terms> even{};             ///< q'^(n² − n)
  std::array<S, phase_terms> real{};       ///< q'^(n²/2) cos (2n + 1) η
  std::array<S, phase_terms> imaginary{};  ///< ± q'^(n²/2) sin (2n + 1) η

  /// At an argument of at most half a period, ½ log 1/q'.
  [[nodiscard]] constexpr RotationPhase<S> at(const S& argument) const noexcept {
    const S side = select(argument < S(0), S(-1), S(1));
    const S fall = scalar::exp(-scalar::abs(argument));
    const S rise = select(root_nome > S(0), root_nome / fall, S(0));
    const S fall2 = fall * fall;
    const S low_rise = rise * rise;
    const S low_fall = root_nome * root_nome * fall2;
    S cosh_sum = S(1) + fall2;
    S sinh_sum = S(1) - fall2;
    S positive(1);
    S alternating(1);
    S rises(1);
    S falls(1);
    S sign(1);
    for (std::size_t n = 1; n < terms; ++n) {
      sign = -sign;
      rises = rises * low_rise;
      falls = falls * low_fall;
      cosh_sum = mul_add(odd[n], mul_add(falls, fall2, rises), cosh_sum);
      sinh_sum = mul_add(sign * odd[n], mul_add(-falls, fall2, rises), sinh_sum);
      const S both = even[n] * (rises + falls);
      positive = positive + both;
      alternating = mul_add(sign, both, alternating);
    }
    S re = real[0] * (S(1) + fall);
    S im = imaginary[0] * (S(1) - fall);
    rises = S(1);
    falls = fall;
    for (std::size_t n = 1; n < phase_terms; ++n) {
      rises = rises * rise;
      falls = falls * (root_nome * fall);
      re = mul_add(real[n], rises + falls, re);
      im = mul_add(imaginary[n], rises - falls, im);
    }
    return {
        x * fall * alternating, side * y * sinh_sum, z * fall * positive, cosh_sum, re, side * im};
  }
};

/// The axes of a body's principal frame in another order and with other signs, right-handed.
template <class S>
struct AxisOrder {
  std::array<std::size_t, 3> axes{0, 1, 2};
  std::array<S, 3> signs{S(1), S(1), S(1)};

  template <class T>
  [[nodiscard]] constexpr std::array<T, 3> into(const std::array<T, 3>& v) const noexcept {
    std::array<T, 3> r{};
    for (std::size_t k = 0; k < 3; ++k) r[k] = static_cast<T>(signs[k]) * v[axes[k]];
    return r;
  }
  template <class T>
  [[nodiscard]] constexpr std::array<T, 3> out_of(const std::array<T, 3>& v) const noexcept {
    std::array<T, 3> r{};
    for (std::size_t k = 0; k < 3; ++k) r[axes[k]] = static_cast<T>(signs[k]) * v[k];
    return r;
  }
};

}  // namespace detail

/// What a free rotation has done after a time: M ↦ M q, and Π now.
template <class S, std::size_t R>
struct FreelyTurned {
  RotorIncrement<S, R> rotor;
  std::array<S, R> angular;  ///< body frame, kg m²/s
};

/// Free rotation of a rigid body, from its principal moments (kg m²) and its angular momentum at
/// t = 0 (kg m²/s, principal frame), of any size and in any relation.
///
/// With J_z the moment about whose axis Π keeps circling, J_y the middle one and D_z = |1/J_z −
/// 1/J_x| Π_x² + |1/J_z − 1/J_y| Π_y², D_x likewise, u = λ t + u₀:
///   Π_x ∝ cn u, Π_y ∝ sn u, Π_z ∝ dn u, λ² = |1/J_z − 1/J_y| D_x, k² ∝ D_z / D_x,
/// all of them and k'² sums of positive terms but for k'², which is the distance from the
/// separatrix.  The attitude is the shortest rotation from Π to J_z's axis and a rotation χ about
/// it with χ̇ = (2E + |Π| Π_z / J_z) / (|Π| + Π_z): a linear function of time and twice the argument
/// of ϑ₄(πu/2K + i w | nome q²), where dn(2iKw/π) = |Π| / max Π_z.
///
/// Errors are those of a few operations, and what the frequencies' errors do in the time t: those
/// are computed in long double for double (double for float), where it is more precise, and angles
/// are reduced in two words, so that the motion of 10⁴ radians still has an error of 1e-15.
template <class S, std::size_t R>
class FreeRotation {
  static_assert(R == 3);
  using Wide = typename detail::SetUpScalar<S>::type;

 public:
  using Angular = std::array<S, 3>;

  constexpr FreeRotation(const Angular& moments, const Angular& angular) noexcept {
    set_up({Wide(moments[0]), Wide(moments[1]), Wide(moments[2])},
           {Wide(angular[0]), Wide(angular[1]), Wide(angular[2])});
    start_ = rotor_at({S(0), S(0)}).second;
    for (std::size_t k = 1; k < 4; ++k) start_[k] = -start_[k];
  }

  /// At the time t, s, before or after the start.
  [[nodiscard]] constexpr FreelyTurned<S, 3> at(const DoubleWord<S>& t) const noexcept {
    const auto [direction, now] = rotor_at(t);
    const auto& [w, x, y, z] = start_;
    const auto& [a, b, c, d] = now;
    const auto turned = order_.out_of(std::array<S, 3>{hamotor::dot(w, b, x, a, y, d, -z, c),
                                                       hamotor::dot(w, c, y, a, z, b, -x, d),
                                                       hamotor::dot(w, d, z, a, x, c, -y, b)});
    auto angular = order_.out_of(direction);
    for (auto& component : angular) component = momentum_ * component;
    return {{hamotor::dot(w, a, -x, b, -y, c, -z, d) - S(1), turned}, angular};
  }

  [[nodiscard]] constexpr FreelyTurned<S, 3> at(const S& t) const noexcept {
    return at(DoubleWord<S>{t, S(0)});
  }

  /// The modulus of the elliptic functions, squared, and its complement 1 − k²: 0 at the
  /// separatrix.
  [[nodiscard]] constexpr const S& modulus_squared() const noexcept { return modulus_squared_; }
  [[nodiscard]] constexpr const S& complement_squared() const noexcept {
    return complement_squared_;
  }

 private:
  /// Π / |Π| and the unit rotor w, x, y, z up to a constant one, in the frame of `order_`.
  [[nodiscard]] constexpr std::pair<Angular, std::array<S, 4>> rotor_at(
      const DoubleWord<S>& t) const noexcept {
    const auto phase = detail::sum(detail::product(rate_, t), start_phase_);
    const S periods = detail::nearest(phase.hi * inverse_period_);
    const auto passed = detail::product(period_, DoubleWord<S>{-periods, S(0)});
    const auto rest = detail::sum(phase, passed);
    auto p = hyperbolic_ ? hyperbolic_series_.at(rest.hi + rest.lo)
                         : circular_series_.at(rest.hi + rest.lo);
    const bool odd = hyperbolic_ && periods != S(2) * detail::nearest(S(0.5) * periods);
    if (odd) {
      p.x = -p.x;
      p.y = -p.y;
    }
    const auto precession = detail::sin_cos_of_turns(
        detail::sum(detail::product(precession_, t),
                    detail::product(precession_per_period_, DoubleWord<S>{periods, S(0)})));
    const S cosine = mul_add(precession.cos, p.real, -precession.sin * p.imaginary);
    const S sine = mul_add(precession.sin, p.real, precession.cos * p.imaginary);
    const S upright = p.length + p.z;
    const S factor = S(1) / scalar::sqrt(mul_add(cosine, cosine, sine * sine) *
                                         mul_add(upright, upright, mul_add(p.x, p.x, p.y * p.y)));
    const S inverse_length = S(1) / p.length;
    return {{p.x * inverse_length, p.y * inverse_length, p.z * inverse_length},
            {factor * cosine * upright, factor * mul_add(cosine, p.y, sine * p.x),
             factor * mul_add(-cosine, p.x, sine * p.y), factor * sine * upright}};
  }

  constexpr void set_up(const std::array<Wide, 3>& moments,
                        const std::array<Wide, 3>& angular) noexcept {
    // The direction of Π, so that nothing overflows, whatever the units.
    const Wide largest = scalar::max_abs(angular[0], angular[1], angular[2]);
    std::array<Wide, 3> p{Wide(0), Wide(0), Wide(1)};
    Wide momentum(0);
    const auto rests = [](const Wide& x) { return x == Wide(0); };
    if (!(rests(angular[0]) && rests(angular[1]) && rests(angular[2]))) {
      for (std::size_t k = 0; k < 3; ++k) p[k] = angular[k] / largest;
      const Wide length = scalar::sqrt(detail::dot(p, p));
      for (auto& component : p) component = component / length;
      momentum = largest * length;
    }
    momentum_ = static_cast<S>(momentum);

    const Wide side = choose_axes(moments, p);
    const auto wide_order = detail::AxisOrder<Wide>{
        order_.axes, {Wide(order_.signs[0]), Wide(order_.signs[1]), Wide(order_.signs[2])}};
    const auto [px, py, pz] = wide_order.into(p);
    const Wide& jx = moments[order_.axes[0]];
    const Wide& jy = moments[order_.axes[1]];
    const Wide& jz = moments[order_.axes[2]];
    // |1/J_z − 1/J_y| and |1/J_y − 1/J_x| over |1/J_z − 1/J_x|.
    const Wide extremes = scalar::abs(jz - jx);
    const bool spherical = !(extremes > Wide(0));
    const Wide zy = spherical ? Wide(1) : scalar::abs(jz - jy) / extremes * (jx / jy);
    const Wide yx = spherical ? Wide(0) : scalar::abs(jy - jx) / extremes * (jz / jy);
    const Wide dz = px * px + zy * py * py;
    const Wide dx = pz * pz + yx * py * py;

    Wide k2(0);
    Wide complement2(1);
    if (yx * dz > Wide(0)) {
      k2 = yx * dz / (zy * dx);
      complement2 = (zy * pz * pz - yx * px * px) / (zy * dx);
      if (complement2 < Wide(0)) complement2 = Wide(0);
    }
    modulus_squared_ = static_cast<S>(k2);
    complement_squared_ = static_cast<S>(complement2);
    hyperbolic_ = k2 > Wide(0.5);

    Motion m{};
    m.k2 = k2;
    m.agm = detail::agm_of_one(scalar::sqrt(complement2));
    m.agm_complement = detail::agm_of_one(scalar::sqrt(k2));
    m.frequency = momentum * (extremes / jz / jx) * scalar::sqrt(zy * dx);
    m.side = side;
    m.x = scalar::sqrt(dz);
    m.y = -side * scalar::sqrt(dz / zy);
    m.z = scalar::sqrt(dx);
    m.pole_sine2 = zy;
    m.pole_cosine2 = yx;
    const Wide cosine = m.x > Wide(0) ? px / m.x : Wide(1);
    const Wide sine = m.x > Wide(0) ? py / m.y : Wide(0);
    const Wide delta = m.z > Wide(0) ? pz / m.z : Wide(1);
    if (cosine > Wide(0) || delta > Wide(0)) {
      m.argument = sine * detail::carlson_rf(cosine * cosine, delta * delta);
    } else {
      // At rest on the middle axis, where the argument is infinite.
      m.argument = sine * Wide(2 * scalar::Limits<Wide>::digits);
      m.frequency = Wide(0);
    }
    const auto turning = [&](const Wide& z) {
      Wide twice_energy(0);
      for (std::size_t k = 0; k < 3; ++k)
        twice_energy = twice_energy + momentum / moments[k] * p[k] * p[k];
      return (twice_energy + momentum / jz * z) / (Wide(1) + z);
    };
    if (hyperbolic_) {
      set_up_hyperbolic(m, turning(m.z * scalar::sqrt(complement2)));
    } else {
      set_up_circular(m, turning(side > Wide(0) ? m.z * scalar::sqrt(complement2) : m.z));
    }
  }

  /// What both kinds of series are set up from.
  struct Motion {
    Wide k2;
    Wide agm;             ///< π/2K
    Wide agm_complement;  ///< π/2K'
    Wide frequency;       ///< λ
    Wide argument;        ///< u₀
    Wide side;            ///< 1 where J_z is the smallest moment, −1 where it is the largest
    Wide x, y, z;         ///< largest components
    Wide pole_sine2, pole_cosine2;  ///< sn² and cn² of i times where dn u = |Π|/Π_z, modulus k'
  };

  /// The axes in the order x, y, z above, signs such that Π_x and Π_z are not negative.
  [[nodiscard]] constexpr Wide choose_axes(const std::array<Wide, 3>& moments,
                                           const std::array<Wide, 3>& p) noexcept {
    std::size_t low = 0;
    std::size_t middle = 1;
    std::size_t high = 2;
    const auto sort = [&](std::size_t& a, std::size_t& b) {
      if (moments[b] < moments[a]) std::swap(a, b);
    };
    sort(low, middle);
    sort(middle, high);
    sort(low, middle);
    const Wide from_low = (moments[middle] - moments[low]) / moments[low];
    const Wide from_high = (moments[high] - moments[middle]) / moments[high];
    const Wide circles_low = from_low * p[low] * p[low];
    const Wide circles_high = from_high * p[high] * p[high];
    const bool about_low =
        circles_low > circles_high || (circles_low == circles_high && from_low >= from_high);
    order_.axes = about_low ? std::array{high, middle, low} : std::array{low, middle, high};
    const bool even = order_.axes[1] == (order_.axes[0] + 1) % 3;
    const S x = p[order_.axes[0]] < Wide(0) ? S(-1) : S(1);
    const S z = p[order_.axes[2]] < Wide(0) ? S(-1) : S(1);
    order_.signs = {x, even ? x * z : -x * z, z};
    return about_low ? Wide(1) : Wide(-1);
  }

  constexpr void set_up_circular(const Motion& m, const Wide& turning) noexcept {
    const Wide pi = scalar::pi<Wide>();
    const bool steady = !(m.k2 > Wide(0));
    const Wide q = steady ? Wide(0) : scalar::exp(-pi * m.agm / m.agm_complement);
    // exp 2w = q exp(2w) / q
    Wide rise(1);
    if (!steady) {
      const Wide pole = scalar::sqrt(m.pole_sine2) *
                        detail::carlson_rf(m.pole_cosine2, m.pole_cosine2 + m.k2 * m.pole_sine2);
      rise = scalar::exp(Wide(2) * m.agm * pole - pi * m.agm / m.agm_complement);
    }
    constexpr std::size_t terms = detail::CircularSeries<S>::terms;
    Wide odd_sum(0);
    Wide even_sum(0);
    Wide alternating_sum(0);
    // χ at v = 0 or π/2, where it turns slowest, so that nothing cancels below.
    Wide real_there(0);
    Wide slope_there(0);
    std::array<Wide, terms> real{};
    std::array<Wide, terms> imaginary{};
    for (std::size_t n = 0; n < terms; ++n) {
      const Wide sign(n % 2 == 0 ? 1 : -1);
      const Wide even = Wide(n == 0 ? 1 : 2) * detail::power(q, n * n);
      odd_sum = odd_sum + detail::power(q, n * (n + 1));
      even_sum = even_sum + even;
      alternating_sum = alternating_sum + sign * even;
      if (n == 0) {
        real[0] = Wide(1);
      } else {
        const Wide larger = detail::power(q, n * (2 * n - 1)) * detail::power(rise, n);
        const Wide smaller = detail::power(q, 2 * n * n) * detail::power(q / rise, n);
        real[n] = sign * (larger + smaller);
        imaginary[n] = sign * (smaller - larger);
      }
      const Wide there = m.side > Wide(0) ? sign : Wide(1);
      real_there = real_there + there * real[n];
      slope_there = slope_there + there * Wide(2 * n) * imaginary[n];
    }
    auto& series = circular_series_;
    for (std::size_t n = 0; n < terms; ++n) {
      const Wide sign(n % 2 == 0 ? 1 : -1);
      const Wide odd = detail::power(q, n * (n + 1)) / odd_sum;
      const Wide even = Wide(n == 0 ? 1 : 2) * detail::power(q, n * n);
      series.x[n] = static_cast<S>(m.x * alternating_sum * odd);
      series.y[n] = static_cast<S>(m.y * even_sum * sign * odd);
      series.z[n] = static_cast<S>(m.z * alternating_sum / even_sum * even);
      series.length[n] = static_cast<S>(sign * even);
      series.real[n] = static_cast<S>(real[n]);
      series.imaginary[n] = static_cast<S>(m.side * imaginary[n]);
    }
    const Wide rate = m.frequency * m.agm;
    rate_ = detail::in_two_words<S>(rate / (Wide(2) * pi));
    start_phase_ = detail::in_two_words<S>(m.argument * m.agm / (Wide(2) * pi));
    period_ = {S(1), S(0)};
    inverse_period_ = S(1);
    precession_ = detail::in_two_words<S>(
        (turning - Wide(2) * m.side * rate * slope_there / real_there) / (Wide(4) * pi));
  }

  constexpr void set_up_hyperbolic(const Motion& m, const Wide& turning) noexcept {
    const Wide pi = scalar::pi<Wide>();
    const bool separatrix = !(m.agm > Wide(0));
    const Wide half_period = separatrix ? Wide(0) : Wide(0.5) * pi * m.agm_complement / m.agm;
    const Wide p = separatrix ? Wide(0) : scalar::exp(-half_period);
    const Wide q = p * p;
    const Wide pole = scalar::sqrt(m.pole_sine2) *
                      detail::carlson_rf(m.pole_cosine2, m.pole_cosine2 + m.k2 * m.pole_sine2);
    const Wide eta = Wide(0.5) * m.agm_complement * pole;

    auto& series = hyperbolic_series_;
    Wide odd_sum(0);
    Wide even_sum(0);
    Wide alternating_sum(0);
    for (std::size_t n = 0; n < series.terms; ++n) {
      const Wide sign(n % 2 == 0 ? 1 : -1);
      const Wide even = Wide(n == 0 ? 1 : 2) * detail::power(q, n * n);
      odd_sum = odd_sum + detail::power(q, n * (n + 1));
      even_sum = even_sum + even;
      alternating_sum = alternating_sum + sign * even;
      series.odd[n] = static_cast<S>(detail::power(q, n * n));
      series.even[n] = static_cast<S>(n == 0 ? Wide(1) : detail::power(q, n * (n - 1)));
    }
    // χ at half a period, where the phase is η.
    Wide real_there(1);
    Wide slope_there(0);
    for (std::size_t n = 0; n <= detail::half_theta_terms<Wide>(); ++n) {
      const Wide weight = detail::power(p, n * n);
      const Wide angle = Wide(2 * n + 1) * eta;
      if (n < series.phase_terms) {
        series.real[n] = static_cast<S>(weight * scalar::cos(angle));
        series.imaginary[n] = static_cast<S>(m.side * weight * scalar::sin(angle));
      }
      if (n > 0) {
        real_there = real_there + Wide(2) * weight * scalar::cos(Wide(2 * n) * eta);
        slope_there = slope_there + Wide(2 * n) * weight * scalar::sin(Wide(2 * n) * eta);
      }
    }
    series.root_nome = static_cast<S>(p);
    series.x = static_cast<S>(Wide(2) * m.x * odd_sum / alternating_sum);
    series.y = static_cast<S>(m.y * even_sum / alternating_sum);
    series.z = static_cast<S>(Wide(2) * m.z * odd_sum / even_sum);
    const Wide rate = m.frequency * m.agm_complement;
    rate_ = detail::in_two_words<S>(rate);
    start_phase_ = detail::in_two_words<S>(m.argument * m.agm_complement);
    period_ = detail::in_two_words<S>(Wide(2) * half_period);
    inverse_period_ = separatrix ? S(0) : static_cast<S>(Wide(0.5) / half_period);
    precession_ = detail::in_two_words<S>(
        (turning - Wide(2) * m.side * rate * slope_there / real_there) / (Wide(4) * pi));
    precession_per_period_ = detail::in_two_words<S>(m.side * eta / pi);
  }

  S momentum_{};  ///< |Π|
  S modulus_squared_{};
  S complement_squared_{};
  bool hyperbolic_ = false;
  detail::AxisOrder<S> order_;
  DoubleWord<S> rate_{};         ///< of the series' argument
  DoubleWord<S> start_phase_{};  ///< the series' argument at t = 0
  DoubleWord<S> period_{};       ///< of the series' argument; 0 where there is none
  S inverse_period_{};
  DoubleWord<S> precession_{};             ///< ½ dχ/dt less what is periodic, turns/s
  DoubleWord<S> precession_per_period_{};  ///< turns
  detail::CircularSeries<S> circular_series_;
  detail::HyperbolicSeries<S> hyperbolic_series_;
  std::array<S, 4> start_{};
};

/// Free rotation in the plane: by Π/J t.
template <class S>
class FreeRotation<S, 1> {
  using Wide = typename detail::SetUpScalar<S>::type;

 public:
  using Angular = std::array<S, 1>;

  constexpr FreeRotation(const Angular& moments, const Angular& angular) noexcept
      : angular_(angular),
        half_rate_(detail::in_two_words<S>(Wide(angular[0]) / Wide(moments[0]) /
                                           (Wide(4) * scalar::pi<Wide>()))) {}

  /// At the time t, s, before or after the start.
  [[nodiscard]] constexpr FreelyTurned<S, 1> at(const DoubleWord<S>& t) const noexcept {
    const auto half = detail::sin_cos_of_turns(detail::product(half_rate_, t));
    return {{half.cos - S(1), {half.sin}}, angular_};
  }

 private:
  Angular angular_;
  DoubleWord<S> half_rate_;  ///< turns/s
};

/// The motion of a free rigid body on SE(3), SE(2) or SO(3) from its state at t = 0: a value.
template <class G, class S>
class FreeMotion {
 public:
  using Element = typename G::template Element<S>;
  using Momentum = typename G::template Momentum<S>;
  static constexpr std::size_t rotations = Space<G>::rotations;
  struct Now {
    Element motor;      ///< principal frame to world
    Momentum momentum;  ///< principal frame
  };

  /// Body with principal moments about its centre of mass or, on SO(3), its fixed point, kg m²;
  /// its mass, kg, is not read on SO(3).
  constexpr FreeMotion(const S& mass, const std::array<S, rotations>& moments, const Element& motor,
                       const Momentum& momentum) noexcept
      : start_{motor, momentum},
        inverse_mass_(S(1) / mass),
        rotation_(moments, detail::first<rotations>(momentum.components())) {}

  /// At the time t, s, before or after the start: exact but for rounding.
  [[nodiscard]] constexpr Now at(const S& t) const noexcept { return at(DoubleWord<S>{t, S(0)}); }

  /// At a time of more digits.
  [[nodiscard]] constexpr Now at(const DoubleWord<S>& t) const noexcept {
    const auto turned = rotation_.at(t);
    if constexpr (Space<G>::translates) {
      const auto p = detail::rest<rotations>(start_.momentum.components());
      auto way = p;
      for (auto& x : way) x = x * (inverse_mass_ * t.hi);
      const Element moved = start_.motor + Space<G>::translation_change(start_.motor, way);
      auto linear = detail::turned_back_change(turned.rotor, p);
      for (std::size_t k = 0; k < p.size(); ++k) linear[k] = p[k] + linear[k];
      return {moved + Space<G>::rotation_change(moved, turned.rotor),
              Momentum::from(detail::joined(turned.angular, linear))};
    } else {
      return {start_.motor + Space<G>::rotation_change(start_.motor, turned.rotor),
              Momentum::from(turned.angular)};
    }
  }

 private:
  Now start_;
  S inverse_mass_;
  FreeRotation<S, rotations> rotation_;
};

/// A system of rigid bodies, each in its principal frame.
template <class System>
concept RigidSystem = SplitSystem<System> && requires(const System& system) {
  system.template body<0>().moments();
  system.template body<0>().mass();
};

/// A system of rigid bodies in which nothing acts.
template <class System>
concept FreeSystem = RigidSystem<System> && !System::has_forque;

/// Free bodies in closed form: every step is evaluated from the state that the first one started
/// at, so that errors do not add up, whatever the step.  A state changed in between starts anew,
/// and so does a time that is not the one delivered.
template <FreeSystem System>
class ClosedForm {
  using S = typename System::Scalar;
  using G = typename System::Group;
  static constexpr std::size_t n = System::bodies;

 public:
  static constexpr int order = 0;  ///< exact but for rounding
  static constexpr std::string_view name = "closed_form";

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    if (!(motions_ && state == delivered_ && is_delivered(t, h))) {
      motions_ = from(system, state, std::make_index_sequence<n>{});
      start_ = t;
    }
    const auto since = scalar::two_sum(t, -start_);
    const auto elapsed = detail::sum(since, DoubleWord<S>{h, S(0)});
    S worst(0);
    for (std::size_t i = 0; i < n; ++i) {
      const auto now = (*motions_)[i].at(elapsed);
      const auto defect = unit_defect(now.motor);
      worst = scalar::max_abs(worst, detail::size(defect));
      state.motors[i] = now.motor + unit_correction(now.motor, defect);
      state.momenta[i] = now.momentum;
    }
    detail::record(drift_, worst);
    delivered_ = state;
    delivered_time_ = t + h;
  }

  /// How far from the group the motors were evaluated.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return drift_; }

 private:
  using Motions = std::array<FreeMotion<G, S>, n>;

  template <std::size_t... i>
  [[nodiscard]] static constexpr Motions from(const System& system, const StateOf<System>& state,
                                              std::index_sequence<i...>) noexcept {
    return {FreeMotion<G, S>(system.template body<i>().mass(), system.template body<i>().moments(),
                             state.motors[i], state.momenta[i])...};
  }

  /// Times that differ by rounding are the same.
  [[nodiscard]] constexpr bool is_delivered(const S& t, const S& h) const noexcept {
    const S size = scalar::max_abs(scalar::max_abs(t, delivered_time_), h);
    return scalar::abs(t - delivered_time_) <= S(8) * scalar::Limits<S>::epsilon() * size;
  }

  std::optional<Motions> motions_;
  S start_{};
  StateOf<System> delivered_{};
  S delivered_time_{};
  Drift<S> drift_;
};

}  // namespace hamotor
