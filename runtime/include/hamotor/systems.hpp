// Rigid bodies in their principal frames, and what acts on them.
//
// The kinetic energy of a body is diagonal in its principal frame: origin at the centre of mass (or
// at the fixed point), axes along the principal axes there.  Its free motion is then a product of
// exact flows, each of them a coadjoint motion: orbits, and with them Casimirs and the spatial
// momentum, are preserved exactly.  A system is a list of bodies and a list of interactions, both
// types: what a scene does not need is not compiled.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>
#include <utility>

#include "hamotor/scalar.hpp"
#include "hamotor/space.hpp"
#include "hamotor/state.hpp"

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
  if (x == y && y == z) return {0, 1, 2, 0};
  if (x == y) return {0, 2, 1, 1};
  if (y == z) return {1, 0, 2, 1};
  if (x == z) return {0, 1, 2, 1};
  const int middle = (x < y) == (y < z) ? 1 : (y < x) == (x < z) ? 0 : 2;
  const int a = middle == 0 ? 1 : 0;
  const int b = middle == 2 ? 1 : 2;
  const auto weight = [&](int k) {
    const S c = moments[static_cast<std::size_t>(middle)];
    const S j = moments[static_cast<std::size_t>(k)];
    return scalar::abs((c - j) / j);
  };
  return weight(a) < weight(b) ? RotationSplit{middle, b, a, 2} : RotationSplit{middle, a, b, 2};
}

/// In the plane there is one rotation and nothing to choose.
template <class S>
[[nodiscard]] constexpr RotationSplit rotation_split(const std::array<S, 1>&) noexcept {
  return {};
}

/// Sine of half the angle of a rotation and cosine of half the angle less one, from a quarter of
/// it.
template <class S>
struct HalfAngle {
  S sine;
  S cosine_less_one;

  [[nodiscard]] static constexpr HalfAngle of_quarter(const S& quarter) noexcept {
    const S sine = scalar::sin(quarter);
    return {S(2) * sine * scalar::cos(quarter), S(-2) * sine * sine};
  }
};

namespace detail {

/// Turns momenta and rotors about the axis E_k by −θ and θ: as increments, so that a rounding error
/// is as small as the angle.
template <std::size_t K, class S>
constexpr void turn_about_axis(const HalfAngle<S>& half, std::array<S, 3>& pi,
                               std::array<S, 3>& change, RotorIncrement<S, 3>& q) noexcept {
  constexpr std::size_t i = (K + 1) % 3;
  constexpr std::size_t j = (K + 2) % 3;
  const S sine = S(2) * mul_add(half.sine, half.cosine_less_one, half.sine);
  const S cosine_less_one = S(-2) * half.sine * half.sine;
  const S change_i = mul_add(cosine_less_one, pi[i], sine * pi[j]);
  const S change_j = mul_add(cosine_less_one, pi[j], -sine * pi[i]);
  pi[i] = pi[i] + change_i;
  pi[j] = pi[j] + change_j;
  change[i] = change[i] + change_i;
  change[j] = change[j] + change_j;

  const auto [s, v] = q;
  const S& a = half.cosine_less_one;
  const S& b = half.sine;
  q.cosine_less_one = s + mul_add(a, s, mul_add(-b, v[K], a));
  q.sines[K] = v[K] + mul_add(a, v[K], mul_add(b, s, b));
  q.sines[i] = v[i] + mul_add(a, v[i], b * v[j]);
  q.sines[j] = v[j] + mul_add(a, v[j], -b * v[i]);
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

template <class S, std::size_t D>
[[nodiscard]] constexpr S dot(const std::array<S, D>& a, const std::array<S, D>& b) noexcept {
  S sum = a[0] * b[0];
  for (std::size_t k = 1; k < D; ++k) sum = mul_add(a[k], b[k], sum);
  return sum;
}

}  // namespace detail

/// Free rotation of a body about its principal frame's origin, R = 3 axes or, in the plane, R = 1.
template <class S, std::size_t R, RotationSplit split>
class PrincipalRotation {
 public:
  using Angular = std::array<S, R>;
  static constexpr bool is_exact = R == 1 || split.axes < 2;

  /// What a free rotation does: M ↦ M q, and what it adds to Π.
  struct Change {
    RotorIncrement<S, R> rotor;
    Angular angular;
  };

  constexpr explicit PrincipalRotation(const Angular& moments) noexcept : moments_(moments) {
    for (std::size_t k = 0; k < R; ++k) inverse_[k] = S(1) / moments[k];
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

  /// ½ Σ Π_k²/J_k, J.
  [[nodiscard]] constexpr S energy(const Angular& pi) const noexcept {
    return S(0.5) * detail::dot(pi, rate(pi));
  }

  /// The rotation in the time h: exact for a symmetric or spherical body and in the plane,
  /// otherwise the symmetric composition of order 2 of exact flows that `split` names.
  ///
  /// Every rotation is an increment, 1 − cos by the half angle, so that rounding errors shrink with
  /// the step instead of staying at one unit in the last place of M and Π for every step.
  [[nodiscard]] constexpr Change free_change(const Angular& pi, const S& h) const noexcept {
    if constexpr (R == 1) {
      const auto half = HalfAngle<S>::of_quarter(S(0.25) * h * inverse_[0] * pi[0]);
      return {{half.cosine_less_one, {half.sine}}, {S(0)}};
    } else {
      Change change{about_momentum(pi, S(0.25) * h * inverse_[common]), {}};
      Angular turned = pi;
      if constexpr (split.axes == 2) {
        turn<outer>(S(0.125) * h * outer_, turned, change);
        turn<inner>(S(0.25) * h * inner_, turned, change);
        turn<outer>(S(0.125) * h * outer_, turned, change);
      } else if constexpr (split.axes == 1) {
        turn<outer>(S(0.25) * h * outer_, turned, change);
      }
      return change;
    }
  }

 private:
  static constexpr auto common = static_cast<std::size_t>(split.common);
  static constexpr auto outer = static_cast<std::size_t>(split.outer);
  static constexpr auto inner = static_cast<std::size_t>(split.inner);

  /// The rotation about Π itself, which leaves Π as it is; `quarter` Π is a quarter of its angle.
  [[nodiscard]] static constexpr RotorIncrement<S, R> about_momentum(const Angular& pi,
                                                                     const S& quarter) noexcept {
    const Angular u{quarter * pi[0], quarter * pi[1], quarter * pi[2]};
    const S angle = scalar::sqrt(detail::dot(u, u));
    const auto half = HalfAngle<S>::of_quarter(angle);
    const S ratio = select(angle > S(0), half.sine / angle, S(2));
    return {half.cosine_less_one, {ratio * u[0], ratio * u[1], ratio * u[2]}};
  }

  template <std::size_t K>
  static constexpr void turn(const S& quarter, Angular& pi, Change& change) noexcept {
    detail::turn_about_axis<K>(HalfAngle<S>::of_quarter(quarter * pi[K]), pi, change.angular,
                               change.rotor);
  }

  Angular moments_;
  Angular inverse_{};
  S outer_ = S(0);
  S inner_ = S(0);
};

/// What a body's free motion adds to its motor and its momentum.
template <class G, class S>
struct BodyChange {
  typename G::template Element<S> motor;
  typename G::template Momentum<S> momentum;
};

/// Rigid body that moves freely, in its central principal frame: mass (kg), principal moments (kg
/// m²) about the centre of mass, which is the frame's origin.
template <class G, class S, RotationSplit split = RotationSplit{}>
class FreeBody {
 public:
  using Group = G;
  using Scalar = S;
  using Element = typename G::template Element<S>;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  using Point = typename Space<G>::template Point<S>;
  using Direction = typename Space<G>::template Direction<S>;
  static constexpr std::size_t rotations = Space<G>::rotations;
  static constexpr bool free_motion_is_exact = PrincipalRotation<S, rotations, split>::is_exact;
  static constexpr std::size_t dimension = Space<G>::dimension;
  static_assert(Space<G>::translates, "a body of a group of rotations is a PivotedBody");

  constexpr FreeBody(const S& mass, const std::array<S, rotations>& moments) noexcept
      : mass_(mass), inverse_mass_(S(1) / mass), rotation_(moments) {}

  [[nodiscard]] constexpr const S& mass() const noexcept { return mass_; }

  /// Principal moments, kg m².
  [[nodiscard]] constexpr const std::array<S, rotations>& moments() const noexcept {
    return rotation_.moments();
  }

  /// B = ∂T/∂μ: Ω = Π/J, V = P/m.
  [[nodiscard]] constexpr Rate rate(const Momentum& mu) const noexcept {
    const auto x = mu.components();
    return Rate::from(
        detail::joined(rotation_.rate(detail::first<rotations>(x)), velocity(x, inverse_mass_)));
  }

  /// [μ, B] for B = ∂T/∂μ: (Π×Ω, P×Ω).  P × V is zero, as V = P/m, and is left out: in orbit it
  /// is the difference of products that are larger than any torque by all digits.
  [[nodiscard]] constexpr Momentum free_momentum_rate(const Momentum& mu) const noexcept {
    const auto turning = detail::first<rotations>(rate(mu).components());
    return coadjoint(Rate::from(detail::joined(turning, std::array<S, dimension>{})), mu);
  }

  /// ½ μ(B), J.
  [[nodiscard]] constexpr S kinetic(const Momentum& mu) const noexcept {
    const auto x = mu.components();
    const auto p = detail::rest<rotations>(x);
    return rotation_.energy(detail::first<rotations>(x)) +
           S(0.5) * inverse_mass_ * detail::dot(p, p);
  }

  /// The free motion in the time h.  Translation (|P|² is a Casimir) and rotation commute, so that
  /// nothing is lost by splitting them.
  [[nodiscard]] constexpr BodyChange<G, S> free_change(const Element& m, const Momentum& mu,
                                                       const S& h) const noexcept {
    const auto x = mu.components();
    const auto rotated = rotation_.free_change(detail::first<rotations>(x), h);
    const Element moved = Space<G>::translation_change(m, velocity(x, h * inverse_mass_));
    return {moved + Space<G>::rotation_change(m + moved, rotated.rotor),
            Momentum::from(detail::joined(
                rotated.angular,
                detail::turned_back_change(rotated.rotor, detail::rest<rotations>(x))))};
  }

  /// Where a point of the principal frame is in the world, m.
  [[nodiscard]] constexpr Point in_world(const Element& m, const Point& x) const noexcept {
    return sandwich(m, x);
  }

  /// A point of the world in the principal frame, m.
  [[nodiscard]] constexpr Point in_body(const Element& m, const Point& x) const noexcept {
    return sandwich(reverse(m), x);
  }

  /// −m g·x, x the centre of mass; g in the world frame, m/s².
  [[nodiscard]] constexpr S weight_potential(const Element& m, const Direction& g) const noexcept {
    const Point x = sandwich(m, typename Space<G>::template Origin<S>{});
    return -mass_ * detail::dot(g.components(), x.components());
  }

  /// The body forque (+dH) of a field g: −m Rᵀg at the centre of mass.
  [[nodiscard]] constexpr Momentum weight_forque(const Element& m,
                                                 const Direction& g) const noexcept {
    const auto f = sandwich(reverse(m), g).components();
    std::array<S, dimension> p{};
    for (std::size_t k = 0; k < dimension; ++k) p[k] = -mass_ * f[k];
    return Momentum::from(detail::joined(std::array<S, rotations>{}, p));
  }

 private:
  [[nodiscard]] static constexpr std::array<S, dimension> velocity(
      const std::array<S, rotations + dimension>& x, const S& factor) noexcept {
    std::array<S, dimension> v{};
    for (std::size_t k = 0; k < dimension; ++k) v[k] = factor * x[rotations + k];
    return v;
  }

  S mass_;
  S inverse_mass_;
  PrincipalRotation<S, rotations, split> rotation_;
};

/// Rigid body with a fixed point, in the principal frame about that point: mass (kg), principal
/// moments about the fixed point (kg m²), centre of mass (m, that frame), and where in the world
/// the fixed point is (m).  Spatial momenta are taken about the fixed point.
template <class G, class S, RotationSplit split = RotationSplit{}>
class PivotedBody {
 public:
  using Group = G;
  using Scalar = S;
  using Element = typename G::template Element<S>;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  using Point = typename Space<G>::template Point<S>;
  using Direction = typename Space<G>::template Direction<S>;
  static constexpr std::size_t rotations = Space<G>::rotations;
  static constexpr bool free_motion_is_exact = PrincipalRotation<S, rotations, split>::is_exact;
  static constexpr std::size_t dimension = Space<G>::dimension;
  static_assert(!Space<G>::translates, "a body of a group that translates is a FreeBody");

  constexpr PivotedBody(const S& mass, const std::array<S, rotations>& moments,
                        const std::array<S, dimension>& center_of_mass,
                        const std::array<S, dimension>& fixed_point) noexcept
      : mass_(mass), center_(center_of_mass), pivot_(fixed_point), rotation_(moments) {}

  [[nodiscard]] constexpr const S& mass() const noexcept { return mass_; }

  /// Principal moments about the fixed point, kg m².
  [[nodiscard]] constexpr const std::array<S, rotations>& moments() const noexcept {
    return rotation_.moments();
  }

  /// Where the fixed point is, world frame, m.
  [[nodiscard]] constexpr const std::array<S, dimension>& fixed_point() const noexcept {
    return pivot_;
  }

  /// B = ∂T/∂μ: Ω = Π/J.
  [[nodiscard]] constexpr Rate rate(const Momentum& mu) const noexcept {
    return Rate::from(rotation_.rate(mu.components()));
  }

  /// [μ, B] for B = ∂T/∂μ: Π×Ω.
  [[nodiscard]] constexpr Momentum free_momentum_rate(const Momentum& mu) const noexcept {
    return coadjoint(rate(mu), mu);
  }

  /// ½ μ(B), J.
  [[nodiscard]] constexpr S kinetic(const Momentum& mu) const noexcept {
    return rotation_.energy(mu.components());
  }

  /// The free motion in the time h.
  [[nodiscard]] constexpr BodyChange<G, S> free_change(const Element& m, const Momentum& mu,
                                                       const S& h) const noexcept {
    const auto rotated = rotation_.free_change(mu.components(), h);
    return {Space<G>::rotation_change(m, rotated.rotor), Momentum::from(rotated.angular)};
  }

  /// Where a point of the principal frame is in the world, m.
  [[nodiscard]] constexpr Point in_world(const Element& m, const Point& x) const noexcept {
    auto y = sandwich(m, x).components();
    for (std::size_t k = 0; k < dimension; ++k) y[k] = y[k] + pivot_[k];
    return Point::from(y);
  }

  /// A point of the world in the principal frame, m.
  [[nodiscard]] constexpr Point in_body(const Element& m, const Point& x) const noexcept {
    auto y = x.components();
    for (std::size_t k = 0; k < dimension; ++k) y[k] = y[k] - pivot_[k];
    return sandwich(reverse(m), Point::from(y));
  }

  /// −m g·x, x the centre of mass; g in the world frame, m/s².
  [[nodiscard]] constexpr S weight_potential(const Element& m, const Direction& g) const noexcept {
    const Point x = in_world(m, Point::from(center_));
    return -mass_ * detail::dot(g.components(), x.components());
  }

  /// The body forque (+dH) of a field g: −c × m Rᵀg.
  [[nodiscard]] constexpr Momentum weight_forque(const Element& m,
                                                 const Direction& g) const noexcept {
    return -mass_ * Space<G>::wrench(regressive(Point::from(center_), sandwich(reverse(m), g)));
  }

 private:
  S mass_;
  std::array<S, dimension> center_;
  std::array<S, dimension> pivot_;
  PrincipalRotation<S, rotations, split> rotation_;
};

/// A uniform field g (world frame, m/s²): every body has the potential −m g·x, x its centre of
/// mass.
template <class G, class S>
struct UniformGravity {
  typename Space<G>::template Direction<S> acceleration;

  template <class System, class Motors>
  [[nodiscard]] constexpr S potential(const System& system, const Motors& motors) const noexcept {
    S sum(0);
    system.for_each_body([&](auto i, const auto& body) {
      sum = sum + body.weight_potential(motors[i], acceleration);
    });
    return sum;
  }

  /// Adds the body forques.
  template <class System, class Motors, class Momenta>
  constexpr void add_forque(const System& system, const Motors& motors,
                            Momenta& forque) const noexcept {
    system.for_each_body([&](auto i, const auto& body) {
      forque[i] = forque[i] + body.weight_forque(motors[i], acceleration);
    });
  }
};

/// Whether a spring has a length at which it is slack.  Without one its potential is ½ k r², smooth
/// everywhere and cheaper; with one, ½ k (r − ℓ)², which has no direction to pull in at r = 0: the
/// force is taken as zero there.
enum class RestLength { zero, positive };

namespace detail {

/// k (1 − ℓ/r), the force over the extension r.
template <RestLength rest, class S>
[[nodiscard]] constexpr S tension(const S& stiffness, const S& rest_length,
                                  const S& length_squared) noexcept {
  if constexpr (rest == RestLength::zero) {
    return stiffness;
  } else {
    const S length = scalar::sqrt(length_squared);
    return select(length > S(0), stiffness - stiffness * (rest_length / length), S(0));
  }
}

template <RestLength rest, class S>
[[nodiscard]] constexpr S spring_energy(const S& stiffness, const S& rest_length,
                                        const S& length_squared) noexcept {
  if constexpr (rest == RestLength::zero) {
    return S(0.5) * stiffness * length_squared;
  } else {
    const S extension = scalar::sqrt(length_squared) - rest_length;
    return S(0.5) * stiffness * extension * extension;
  }
}

template <class Point>
[[nodiscard]] constexpr auto difference(const Point& x, const Point& y) noexcept {
  auto d = x.components();
  const auto b = y.components();
  for (std::size_t k = 0; k < d.size(); ++k) d[k] = d[k] - b[k];
  return d;
}

}  // namespace detail

/// Spring from a point of body number `index` to a point of the world.
template <std::size_t index, class G, class S, RestLength rest = RestLength::positive>
struct SpringToWorld {
  typename Space<G>::template Point<S> at;      ///< in the body's principal frame, m
  typename Space<G>::template Point<S> anchor;  ///< in the world, m
  S stiffness;                                  ///< N/m
  S rest_length;                                ///< m; not read where `rest` is zero

  template <class System, class Motors>
  [[nodiscard]] constexpr S potential(const System& system, const Motors& motors) const noexcept {
    const auto d =
        detail::difference(system.template body<index>().in_world(motors[index], at), anchor);
    return detail::spring_energy<rest>(stiffness, rest_length, detail::dot(d, d));
  }

  /// Adds the body forque: the spring's line, joined in the body frame, times −k (1 − ℓ/r).
  template <class System, class Motors, class Momenta>
  constexpr void add_forque(const System& system, const Motors& motors,
                            Momenta& forque) const noexcept {
    const auto end = system.template body<index>().in_body(motors[index], anchor);
    const auto d = detail::difference(at, end);
    const S pull = detail::tension<rest>(stiffness, rest_length, detail::dot(d, d));
    forque[index] = mul_add(-pull, Space<G>::wrench(regressive(at, end)), forque[index]);
  }
};

/// Spring between points of the bodies number `one` and `two`.
template <std::size_t one, std::size_t two, class G, class S,
          RestLength rest = RestLength::positive>
struct SpringBetween {
  static_assert(one != two, "a spring between two points of one rigid body never acts");
  typename Space<G>::template Point<S> at_one;  ///< in the principal frame of body `one`, m
  typename Space<G>::template Point<S> at_two;  ///< in the principal frame of body `two`, m
  S stiffness;                                  ///< N/m
  S rest_length;                                ///< m; not read where `rest` is zero

  template <class System, class Motors>
  [[nodiscard]] constexpr S potential(const System& system, const Motors& motors) const noexcept {
    const auto d = extension(system, motors);
    return detail::spring_energy<rest>(stiffness, rest_length, detail::dot(d, d));
  }

  /// Adds the two body forques, of one force and its opposite.
  template <class System, class Motors, class Momenta>
  constexpr void add_forque(const System& system, const Motors& motors,
                            Momenta& forque) const noexcept {
    using Direction = typename Space<G>::template Direction<S>;
    auto f = extension(system, motors);
    const S pull = detail::tension<rest>(stiffness, rest_length, detail::dot(f, f));
    for (auto& x : f) x = pull * x;
    const Direction force = Direction::from(f);
    forque[one] =
        forque[one] - Space<G>::wrench(regressive(at_one, sandwich(reverse(motors[one]), force)));
    forque[two] =
        forque[two] + Space<G>::wrench(regressive(at_two, sandwich(reverse(motors[two]), force)));
  }

 private:
  /// From the end on `one` to the end on `two`, world frame.
  template <class System, class Motors>
  [[nodiscard]] constexpr auto extension(const System& system,
                                         const Motors& motors) const noexcept {
    return detail::difference(system.template body<two>().in_world(motors[two], at_two),
                              system.template body<one>().in_world(motors[one], at_one));
  }
};

/// Bodies, each in its principal frame, and what acts on them:
/// H = Σ T_i(μ_i) + Σ U_j(M), and every part of it only if its type is listed.
template <class Bodies, class Interactions = std::tuple<>>
class RigidBodies;

template <class... Body, class... Interaction>
class RigidBodies<std::tuple<Body...>, std::tuple<Interaction...>> {
  using FirstBody = std::tuple_element_t<0, std::tuple<Body...>>;

 public:
  using Group = typename FirstBody::Group;
  using Scalar = typename FirstBody::Scalar;
  static constexpr std::size_t bodies = sizeof...(Body);
  static constexpr bool has_forque = sizeof...(Interaction) > 0;
  static constexpr bool free_motion_is_exact = (Body::free_motion_is_exact && ...);
  using Motors = std::array<typename Group::template Element<Scalar>, bodies>;
  using Momenta = std::array<typename Group::template Momentum<Scalar>, bodies>;
  using Rates = std::array<typename Group::template Rate<Scalar>, bodies>;
  using State = hamotor::State<Group, bodies, Scalar>;
  static_assert((std::is_same_v<typename Body::Group, Group> && ...),
                "all bodies of a system move on one group");
  static_assert((std::is_same_v<typename Body::Scalar, Scalar> && ...),
                "all bodies of a system have one scalar type");

  constexpr explicit RigidBodies(const std::tuple<Body...>& all_bodies,
                                 const std::tuple<Interaction...>& interactions = {}) noexcept
      : bodies_(all_bodies), interactions_(interactions) {}

  /// Body number `index`.
  template <std::size_t index>
  [[nodiscard]] constexpr const auto& body() const noexcept {
    return std::get<index>(bodies_);
  }

  /// visit(std::integral_constant i, body number i) for every body.
  template <class Visit>
  constexpr void for_each_body(Visit&& visit) const noexcept {
    [&]<std::size_t... i>(std::index_sequence<i...>) {
      (visit(std::integral_constant<std::size_t, i>{}, std::get<i>(bodies_)), ...);
    }(std::make_index_sequence<bodies>{});
  }

  /// Kinetic energy, J.
  [[nodiscard]] constexpr Scalar kinetic(const Momenta& momenta) const noexcept {
    Scalar sum(0);
    for_each_body([&](auto i, const auto& one) { sum = sum + one.kinetic(momenta[i]); });
    return sum;
  }

  /// Potential energy, J.
  [[nodiscard]] constexpr Scalar potential(const Motors& motors) const noexcept {
    Scalar sum(0);
    std::apply(
        [&](const auto&... interaction) {
          ((sum = sum + interaction.potential(*this, motors)), ...);
        },
        interactions_);
    return sum;
  }

  /// H, J.
  [[nodiscard]] constexpr Scalar energy(const State& state) const noexcept {
    return kinetic(state.momenta) + potential(state.motors);
  }

  /// B = ∂H/∂μ for every body, body frame.
  [[nodiscard]] constexpr Rates rate(const State& state) const noexcept {
    Rates result{};
    for_each_body([&](auto i, const auto& one) { result[i] = one.rate(state.momenta[i]); });
    return result;
  }

  /// [μ, B] for every body, body frame.
  [[nodiscard]] constexpr Momenta free_momentum_rates(const Momenta& momenta) const noexcept {
    Momenta result{};
    for_each_body([&](auto i, const auto& one) { result[i] = one.free_momentum_rate(momenta[i]); });
    return result;
  }

  /// F_b = M~ F_s M = +dH for every body, body frame: μ̇ = [μ, B] − F_b.
  [[nodiscard]] constexpr Momenta forque(const Motors& motors) const noexcept
    requires(has_forque)
  {
    Momenta result{};
    std::apply(
        [&](const auto&... interaction) { (interaction.add_forque(*this, motors, result), ...); },
        interactions_);
    return result;
  }

  /// What the free motion, H = T, adds in the time h.
  [[nodiscard]] constexpr ChangeOf<RigidBodies> free_change(const Motors& motors,
                                                            const Momenta& momenta,
                                                            const Scalar& h) const noexcept {
    ChangeOf<RigidBodies> result{};
    for_each_body([&](auto i, const auto& one) {
      const auto change = one.free_change(motors[i], momenta[i], h);
      result.motors[i] = change.motor;
      result.momenta[i] = change.momentum;
    });
    return result;
  }

 private:
  std::tuple<Body...> bodies_;
  std::tuple<Interaction...> interactions_;
};

template <class... Body>
RigidBodies(std::tuple<Body...>) -> RigidBodies<std::tuple<Body...>, std::tuple<>>;
template <class... Body, class... Interaction>
RigidBodies(std::tuple<Body...>, std::tuple<Interaction...>)
    -> RigidBodies<std::tuple<Body...>, std::tuple<Interaction...>>;

}  // namespace hamotor
