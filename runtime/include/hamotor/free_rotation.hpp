// Free rotation of a rigid body about its principal axes, cut into exactly solvable parts.
//
// Every rotation is an increment, q − 1 and RᵀΠ − Π, so that rounding errors shrink with the step
// instead of staying at one unit in the last place of M and Π for every step.
#pragma once

#include <array>
#include <cstddef>

#include "hamotor/angle_increment.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/space.hpp"
#include "hamotor/splitting_schemes.hpp"

namespace hamotor {

/// How the kinetic energy of rotation is cut into exactly solvable parts.
///
/// T = |Π|²/2J_c + ½ (1/J_o − 1/J_c) Π_o² + ½ (1/J_i − 1/J_c) Π_i².  The first part
/// Poisson-commutes with the others (|Π|² is a Casimir of the rotations), so that only two
/// rotations about axes are left to compose, one for a symmetric body, none for a spherical one.
struct RotationSplit {
  int common = 1;  ///< axis c; c, o and i are a permutation of 0, 1, 2
  int outer = 0;   ///< axis o, turned in two halves
  int inner = 2;   ///< axis i
  int axes = 2;    ///< how many of o, i are turned about: 2, 1 (o) or 0
  /// Whether the part of axis i is so small that its square hardly counts.
  bool nearly_symmetric = false;
  /// Whether the turn about o, of a symmetric body, commutes with what acts on it as well: it is
  /// then left out of the parts of a step and made once, at its end.
  bool spin_apart = false;

  [[nodiscard]] friend constexpr bool operator==(const RotationSplit&,
                                                 const RotationSplit&) = default;
};

/// The cheapest and most accurate split for the given principal moments (kg m²).
///
/// The middle moment is the common one, which makes the product of the two remaining coefficients,
/// and with it the error, least; the larger coefficient goes outside, where the error is halved.
/// Equal moments are a symmetry and save one or both rotations.
template <class S>
[[nodiscard]] constexpr RotationSplit rotation_split(const std::array<S, 3>& moments) noexcept {
  const S x = moments[0];
  const S y = moments[1];
  const S z = moments[2];
  if (x == y && y == z) return {.common = 0, .outer = 1, .inner = 2, .axes = 0};
  if (x == y) return {.common = 0, .outer = 2, .inner = 1, .axes = 1};
  if (y == z) return {.common = 1, .outer = 0, .inner = 2, .axes = 1};
  if (x == z) return {.common = 0, .outer = 1, .inner = 2, .axes = 1};
  const int middle = (x < y) == (y < z) ? 1 : (y < x) == (x < z) ? 0 : 2;
  const int a = middle == 0 ? 1 : 0;
  const int b = middle == 2 ? 1 : 2;
  const auto weight = [&](int k) {
    const S c = moments[static_cast<std::size_t>(middle)];
    const S j = moments[static_cast<std::size_t>(k)];
    return scalar::abs((c - j) / j);
  };
  const int outer = weight(a) < weight(b) ? b : a;
  const int inner = outer == a ? b : a;
  return {.common = middle,
          .outer = outer,
          .inner = inner,
          .axes = 2,
          .nearly_symmetric = S(20) * weight(inner) < weight(outer)};
}

/// In the plane there is one rotation and nothing to choose.
template <class S>
[[nodiscard]] constexpr RotationSplit rotation_split(const std::array<S, 1>&) noexcept {
  return {};
}

/// The same for a body on which forces act at these points of its principal frame (m) and nowhere
/// else: on a symmetry axis they leave its spin alone.
template <class S, std::size_t R, std::size_t D, std::size_t points>
[[nodiscard]] constexpr RotationSplit rotation_split(
    const std::array<S, R>& moments,
    const std::array<std::array<double, D>, points>& where_forces_act) noexcept {
  RotationSplit split = rotation_split(moments);
  if (R == 1 || split.axes != 1) return split;
  split.spin_apart = true;
  for (const auto& point : where_forces_act) {
    for (std::size_t k = 0; k < D; ++k) {
      if (k != static_cast<std::size_t>(split.outer) && point[k] != 0) split.spin_apart = false;
    }
  }
  return split;
}

namespace detail {

template <class S, std::size_t D>
[[nodiscard]] constexpr S dot(const std::array<S, D>& a, const std::array<S, D>& b) noexcept {
  S sum = a[0] * b[0];
  for (std::size_t k = 1; k < D; ++k) sum = mul_add(a[k], b[k], sum);
  return sum;
}

template <class S>
[[nodiscard]] constexpr std::array<S, 3> cross(const std::array<S, 3>& a,
                                               const std::array<S, 3>& b) noexcept {
  return {mul_add(a[1], b[2], -a[2] * b[1]), mul_add(a[2], b[0], -a[0] * b[2]),
          mul_add(a[0], b[1], -a[1] * b[0])};
}

/// What a free rotation does: M ↦ M q, and what it adds to Π.
template <class S, std::size_t R>
struct Turning {
  RotorIncrement<S, R> rotor;
  std::array<S, R> angular;
};

/// Turns momenta and rotors about the axis E_k by −θ and θ, given θ/2 and θ.
///
/// Π between the turns of a step is its start and what was added since: added to itself every time,
/// its rounding errors would grow, and with them those of the angles.
template <std::size_t K, class S>
HAMOTOR_INLINE constexpr void turn_about_axis(const AngleIncrement<S>& half,
                                              const AngleIncrement<S>& whole,
                                              const std::array<S, 3>& start, std::array<S, 3>& pi,
                                              Turning<S, 3>& change) noexcept {
  constexpr std::size_t i = (K + 1) % 3;
  constexpr std::size_t j = (K + 2) % 3;
  const S& a = half.cosine_less_one;
  const S& b = half.sine;
  const S change_i = mul_add(whole.cosine_less_one, pi[i], whole.sine * pi[j]);
  const S change_j = mul_add(whole.cosine_less_one, pi[j], -whole.sine * pi[i]);
  change.angular[i] = change.angular[i] + change_i;
  change.angular[j] = change.angular[j] + change_j;
  pi[i] = start[i] + change.angular[i];
  pi[j] = start[j] + change.angular[j];

  auto& q = change.rotor;
  const auto [s, v] = q;
  q.cosine_less_one = s + mul_add(a, s, mul_add(-b, v[K], a));
  q.sines[K] = v[K] + mul_add(a, v[K], mul_add(b, s, b));
  q.sines[i] = v[i] + mul_add(a, v[i], b * v[j]);
  q.sines[j] = v[j] + mul_add(a, v[j], -b * v[i]);
}

/// x cos θ + y sin θ and y cos θ − x sin θ of the components x and y.
template <class S, std::size_t N>
HAMOTOR_INLINE constexpr void turn_plane(std::array<S, N>& v, std::size_t x, std::size_t y,
                                         const AngleIncrement<S>& by) noexcept {
  const S before = v[x];
  v[x] = mul_add(by.sine, v[y], mul_add(by.cosine_less_one, before, before));
  v[y] = less_product(by.sine, before, mul_add(by.cosine_less_one, v[y], v[y]));
}

/// The same by sin θ and 1 − cos θ: no sign is changed where that comes as a product.
template <class S, std::size_t N>
HAMOTOR_INLINE constexpr void turn_plane(std::array<S, N>& v, std::size_t x, std::size_t y,
                                         const S& sine, const S& versine) noexcept {
  const S before = v[x];
  v[x] = mul_add(sine, v[y], less_product(versine, before, before));
  v[y] = less_product(sine, before, less_product(versine, v[y], v[y]));
}

/// Turns a body in space about its axis E_K, given half the angle: M ↦ M q, and Π and P back.
template <std::size_t K, class Element, class Momentum, class S>
HAMOTOR_INLINE constexpr void turn_body(Element& motor, Momentum& momentum,
                                        const AngleIncrement<S>& half) noexcept {
  constexpr std::size_t i = (K + 1) % 3;
  constexpr std::size_t j = (K + 2) % 3;
  // s, e23, e31, e12 and, where there are translations, e01, e02, e03, e0123.
  auto m = motor.components();
  turn_plane(m, 0, 1 + K, half);
  turn_plane(m, 1 + i, 1 + j, half);
  if constexpr (m.size() == 8) {
    turn_plane(m, 4 + K, 7, half);
    turn_plane(m, 4 + i, 4 + j, half);
  }
  motor = Element::from(m);
  const S twice = S(2) * half.sine;
  const S sine = mul_add(twice, half.cosine_less_one, twice);
  const S versine = twice * half.sine;
  auto mu = momentum.components();
  for (std::size_t first = 0; first < mu.size(); first += 3) {
    turn_plane(mu, first + i, first + j, sine, versine);
  }
  momentum = Momentum::from(mu);
}

/// q r − 1.
template <class S>
[[nodiscard]] HAMOTOR_INLINE constexpr RotorIncrement<S, 3> composed(
    const RotorIncrement<S, 3>& q, const RotorIncrement<S, 3>& r) noexcept {
  const auto& [s, v] = q;
  const auto& [a, b] = r;
  RotorIncrement<S, 3> product{
      s + (mul_add(a, s, a) - mul_add(v[0], b[0], mul_add(v[1], b[1], v[2] * b[2]))), {}};
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t i = (k + 1) % 3;
    const std::size_t j = (k + 2) % 3;
    product.sines[k] =
        v[k] + (mul_add(s, b[k], b[k]) + mul_add(a, v[k], mul_add(v[i], b[j], -v[j] * b[i])));
  }
  return product;
}

/// Rᵀ p − p for the rotation R of q.
template <class S>
[[nodiscard]] constexpr std::array<S, 3> turned_back_change(const RotorIncrement<S, 3>& q,
                                                            const std::array<S, 3>& p) noexcept {
  const auto& v = q.sines;
  const S x = S(2) * mul_add(p[1], v[2], -p[2] * v[1]);
  const S y = S(2) * mul_add(p[2], v[0], -p[0] * v[2]);
  const S z = S(2) * mul_add(p[0], v[1], -p[1] * v[0]);
  return {x + mul_add(q.cosine_less_one, x, mul_add(y, v[2], -z * v[1])),
          y + mul_add(q.cosine_less_one, y, mul_add(z, v[0], -x * v[2])),
          z + mul_add(q.cosine_less_one, z, mul_add(x, v[1], -y * v[0]))};
}

template <class S>
[[nodiscard]] constexpr std::array<S, 2> turned_back_change(const RotorIncrement<S, 1>& q,
                                                            const std::array<S, 2>& p) noexcept {
  const S& v = q.sines[0];
  const S x = S(2) * v * p[1];
  const S y = S(-2) * v * p[0];
  return {x + mul_add(q.cosine_less_one, x, v * y), y + mul_add(q.cosine_less_one, y, -v * x)};
}

}  // namespace detail

/// Free rotation of a body about its principal frame's origin, R = 3 axes or, in the plane, R = 1.
template <class S, std::size_t R, RotationSplit split>
class PrincipalRotation {
 public:
  using Angular = std::array<S, R>;
  using Change = detail::Turning<S, R>;
  static constexpr bool is_exact = R == 1 || split.axes < 2;

  constexpr explicit PrincipalRotation(const Angular& moments) noexcept : moments_(moments) {
    const Angular difference = differences();
    for (std::size_t k = 0; k < R; ++k) {
      inverse_[k] = S(1) / moments[k];
      ratios_[k] = difference[k] / moments[k];
    }
    if constexpr (R == 3) {
      const S& c = moments[common];
      outer_ = (c - moments[outer]) / (c * moments[outer]);
      inner_ = (c - moments[inner]) / (c * moments[inner]);
    }
  }

  /// Principal moments, kg m².
  [[nodiscard]] constexpr const Angular& moments() const noexcept { return moments_; }

  /// Ω_k = Π_k / J_k, rad/s.
  [[nodiscard]] constexpr Angular rate(const Angular& pi) const noexcept {
    Angular w{};
    for (std::size_t k = 0; k < R; ++k) w[k] = pi[k] * inverse_[k];
    return w;
  }

  /// 1/J_k.
  [[nodiscard]] constexpr const Angular& inverse_moments() const noexcept { return inverse_; }

  /// J_k dΩ_k/dt = (J_i − J_j) Ω_i Ω_j for i, j, k in cyclic order: those differences, and over
  /// J_k.
  [[nodiscard]] constexpr Angular differences() const noexcept {
    Angular result{};
    if constexpr (R == 3) {
      for (std::size_t k = 0; k < R; ++k) result[k] = moments_[(k + 1) % 3] - moments_[(k + 2) % 3];
    }
    return result;
  }
  [[nodiscard]] constexpr const Angular& ratios() const noexcept { return ratios_; }

  /// ½ Σ Π_k²/J_k, J.
  [[nodiscard]] constexpr S energy(const Angular& pi) const noexcept {
    return S(0.5) * detail::dot(pi, rate(pi));
  }

  /// The rotation in the time h, less the spin where that is apart: exact for a symmetric or
  /// spherical body and in the plane, otherwise by Strang's splitting.
  [[nodiscard]] constexpr Change free_change(const Angular& pi, const S& h) const noexcept {
    if constexpr (split.spin_apart) {
      return {spherical_change(pi, h), {}};
    } else {
      const SplittingWeights<S, 1> strang{{S(1)}, {S(0.5), S(0.5)}};
      return free_step(pi, h, strang);
    }
  }

  /// All of the rotation in the time h, by a splitting with the turn about o outside and that about
  /// i inside where it is not exact.
  template <std::size_t stages>
  [[nodiscard]] constexpr Change free_step(
      const Angular& pi, const S& h, const SplittingWeights<S, stages>& weights) const noexcept {
    if constexpr (R == 1) {
      const auto half = AngleIncrement<S>::of(S(0.5) * h * inverse_[0] * pi[0]);
      return {{half.cosine_less_one, {half.sine}}, {S(0)}};
    } else {
      Change change{spherical_change(pi, h), {}};
      Angular turned = pi;
      if constexpr (split.axes == 2) {
        const S outer_rate = S(0.5) * h * outer_;
        const S inner_rate = S(0.5) * h * inner_;
        for (std::size_t k = 0; k < stages; ++k) {
          turn<outer>(weights.kicks[k] * outer_rate, pi, turned, change);
          turn<inner>(weights.drifts[k] * inner_rate, pi, turned, change);
        }
        turn<outer>(weights.kicks[stages] * outer_rate, pi, turned, change);
      } else if constexpr (split.axes == 1) {
        turn<outer>(S(0.5) * h * outer_, pi, turned, change);
      }
      return change;
    }
  }

  /// The turn about o alone, exact.
  [[nodiscard]] constexpr Change spin_change(const Angular& pi, const S& h) const noexcept
    requires(R == 3)
  {
    Change change{};
    Angular turned = pi;
    turn<outer>(S(0.5) * h * outer_, pi, turned, change);
    return change;
  }

  /// Half the turn about o, or about i, in the time h, of an angle in the range.
  template <bool is_outer, AngleRange range>
  [[nodiscard]] HAMOTOR_INLINE constexpr AngleIncrement<S> half_turn(const Angular& pi,
                                                                     const S& h) const noexcept
    requires(R == 3)
  {
    const S x = S(0.5) * h * (is_outer ? outer_ : inner_) * pi[is_outer ? outer : inner];
    if constexpr (range == AngleRange::any) {
      return AngleIncrement<S>::of(x);
    } else {
      return AngleIncrement<S>::template of_small<range>(x);
    }
  }

  /// The range in which every half turn in the time h is and remains: |Π| is constant but for
  /// rounding, for which there is room.
  [[nodiscard]] constexpr AngleRange range_of_turns(const Angular& pi, const S& h) const noexcept
    requires(R == 3)
  {
    if constexpr (detail::has_series<S>) {
      const S rate = S(0.5) * h * scalar::max_abs(outer_, inner_);
      const S largest = rate * rate * detail::dot(pi, pi);
      const S room(0.99);
      if (all(largest <= room * detail::series_bound<S, AngleRange::tiny>)) return AngleRange::tiny;
      if (all(largest <= room * detail::series_bound<S>)) return AngleRange::small;
    }
    return AngleRange::any;
  }

  /// q − 1 for the motion of a ball of moments J_c: the rotation about Π itself, which leaves Π as
  /// it is.
  [[nodiscard]] constexpr RotorIncrement<S, R> spherical_change(const Angular& pi,
                                                                const S& h) const noexcept
    requires(R == 3)
  {
    const S factor = S(0.5) * h * inverse_[common];
    const Angular u{factor * pi[0], factor * pi[1], factor * pi[2]};
    const auto [ratio, cosine_less_one] = half_about(detail::dot(u, u));
    return {cosine_less_one, {ratio * u[0], ratio * u[1], ratio * u[2]}};
  }

  /// A step of a splitting of the symmetric top whose centre of mass is `lever`/m up its axis o, in
  /// a field that is `field` in the body frame: kicks outside, the motion of a ball inside, and the
  /// spin once, at the end.  `lever` is kg m, `field` m/s².
  ///
  /// The ball turns Rᵀg as well as M, so that neither M nor a sine or a root stands between one
  /// kick and the next: Rᵀg is carried through the step by itself and only the change of M is
  /// summed up.  Π·Rᵀg and Π_o are constant.
  template <std::size_t stages>
  [[nodiscard]] constexpr Change top_step(const Angular& pi, const Angular& field, const S& lever,
                                          const S& h,
                                          const SplittingWeights<S, stages>& w) const noexcept
    requires(R == 3 && split.axes == 1)
  {
    constexpr std::size_t i = (outer + 1) % 3;
    constexpr std::size_t j = (outer + 2) % 3;
    Change change{};
    Angular p = pi;
    Angular g = field;
    const S vertical = detail::dot(p, g);
    const S torque = h * lever;
    const S half_rate = S(0.5) * h * inverse_[common];
    const auto kick = [&](const S& weight) {
      const S by = weight * torque;
      p[i] = mul_add(-by, g[j], p[i]);
      p[j] = mul_add(by, g[i], p[j]);
      change.angular[i] = mul_add(-by, g[j], change.angular[i]);
      change.angular[j] = mul_add(by, g[i], change.angular[j]);
    };
    for (std::size_t k = 0; k < stages; ++k) {
      kick(w.kicks[k]);
      const S factor = w.drifts[k] * half_rate;
      Angular u{};
      u[outer] = factor * p[outer];
      u[i] = factor * p[i];
      u[j] = factor * p[j];
      const S square = mul_add(u[i], u[i], mul_add(u[j], u[j], u[outer] * u[outer]));
      const auto [ratio, cosine_less_one] = half_about(square);
      const S half_sine = mul_add(ratio, cosine_less_one, ratio);
      const S half_versine = ratio * ratio;
      const S along = factor * vertical;
      const Angular before = g;
      for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t b = (a + 1) % 3;
        const std::size_t c = (a + 2) % 3;
        const S crossed = S(2) * mul_add(before[b], u[c], -before[c] * u[b]);
        const S across = S(2) * mul_add(along, u[a], -square * before[a]);
        g[a] = mul_add(half_sine, crossed, mul_add(half_versine, across, before[a]));
      }
      change.rotor = detail::composed(
          change.rotor,
          RotorIncrement<S, 3>{cosine_less_one, {ratio * u[0], ratio * u[1], ratio * u[2]}});
    }
    kick(w.kicks[stages]);
    turn<outer>(S(0.5) * h * outer_, pi, p, change);
    return change;
  }

 private:
  static constexpr auto common = static_cast<std::size_t>(split.common);
  static constexpr auto outer = static_cast<std::size_t>(split.outer);
  static constexpr auto inner = static_cast<std::size_t>(split.inner);

  struct HalfAbout {
    S sine_ratio;
    S cosine_less_one;
  };

  /// (sin x)/x and cos x − 1 from x²: no root and no quotient where x is small.
  [[nodiscard]] HAMOTOR_INLINE static constexpr HalfAbout half_about(const S& square) noexcept {
    if constexpr (detail::has_series<S>) {
      const auto small = square <= detail::series_bound<S>;
      if (all(small)) return by_series(square);
      if constexpr (scalar::has_lanes<S>) return by_each(square);
    }
    return by_angle(square);
  }

  /// What each lane's own size asks for.
  [[nodiscard, gnu::cold, gnu::noinline]] static HalfAbout by_each(const S& square) noexcept {
    const auto small = square <= detail::series_bound<S>;
    const HalfAbout near = by_series(square);
    const HalfAbout far = by_angle(square);
    return {select(small, near.sine_ratio, far.sine_ratio),
            select(small, near.cosine_less_one, far.cosine_less_one)};
  }

  [[nodiscard]] HAMOTOR_INLINE static constexpr HalfAbout by_series(const S& square) noexcept {
    return {mul_add(square, detail::sine_series(square), S(1)),
            square * detail::cosine_series(square)};
  }

  [[nodiscard]] static constexpr HalfAbout by_angle(const S& square) noexcept {
    const S x = scalar::sqrt(square);
    const auto half = AngleIncrement<S>::of(x);
    return {select(x > S(0), half.sine / x, S(1)), half.cosine_less_one};
  }

  template <std::size_t K>
  HAMOTOR_INLINE static constexpr void turn(const S& half_per_momentum, const Angular& start,
                                            Angular& pi, Change& change) noexcept {
    using Increment = AngleIncrement<S>;
    const S x = half_per_momentum * pi[K];
    if constexpr (detail::has_series<S>) {
      // The next turn waits for this one's Π: not for the half angle as well, where it need not.
      const auto small = Increment::is_small(x + x);
      if (all(small)) {
        detail::turn_about_axis<K>(Increment::of_small(x), Increment::of_small(x + x), start, pi,
                                   change);
        return;
      }
      if constexpr (scalar::has_lanes<S>) {
        const auto [half, whole] = halves_and_wholes(x);
        detail::turn_about_axis<K>(half, whole, start, pi, change);
        return;
      }
    }
    const auto half = Increment::of(x);
    detail::turn_about_axis<K>(half, half.twice(), start, pi, change);
  }

  struct HalfAndWhole {
    AngleIncrement<S> half;
    AngleIncrement<S> whole;
  };

  /// What each lane's own size asks for.
  [[nodiscard, gnu::cold, gnu::noinline]] static HalfAndWhole halves_and_wholes(
      const S& x) noexcept {
    using Increment = AngleIncrement<S>;
    const auto half = Increment::of(x);
    return {half, Increment::chosen(Increment::is_small(x + x), Increment::of_small(x + x),
                                    half.twice())};
  }

  Angular moments_;
  Angular inverse_{};
  Angular ratios_{};
  S outer_ = S(0);
  S inner_ = S(0);
};

}  // namespace hamotor
