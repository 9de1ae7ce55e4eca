// Rigid bodies in their principal frames, and what acts on them.
//
// The kinetic energy of a body is diagonal in its principal frame: origin at the centre of mass (or
// at the fixed point), axes along the principal axes there.  Its free motion is then a product of
// exact flows, each of them a coadjoint motion: orbits, and with them Casimirs and the spatial
// momentum, are preserved exactly.  A system is a list of bodies and a list of interactions, both
// types: what a scene does not need is not compiled.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <tuple>
#include <utility>

#include "hamotor/free_rotation.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/space.hpp"
#include "hamotor/state.hpp"

namespace hamotor {

namespace detail {

struct Ones {
  [[nodiscard]] constexpr One operator[](std::size_t) const noexcept { return {}; }
};

template <std::size_t D, class S>
[[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, D> filled(const S& x) noexcept {
  std::array<S, D> result{};
  result.fill(x);
  return result;
}
/// x − y of points, also of the origin y, which has no components.
template <class Point, class Other>
[[nodiscard]] constexpr auto difference(const Point& x, [[maybe_unused]] const Other& y) noexcept {
  auto d = x.components();
  if constexpr (Other::size > 0) {
    const auto b = y.components();
    for (std::size_t k = 0; k < d.size(); ++k) d[k] = d[k] - b[k];
  }
  return d;
}

/// `start` and p × w, in the plane p × w e3.
template <class Start, class S>
[[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, 3> turned_at(
    const Start& start, const std::array<S, 3>& p, const std::array<S, 3>& w) noexcept {
  return {less(onto(start[0], p[1], w[2]), p[2], w[1]),
          less(onto(start[1], p[2], w[0]), p[0], w[2]),
          less(onto(start[2], p[0], w[1]), p[1], w[0])};
}
template <class Start, class S>
[[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, 2> turned_at(
    const Start& start, const std::array<S, 2>& p, const std::array<S, 1>& w) noexcept {
  return {onto(start[0], p[1], w[0]), less(start[1], p[0], w[0])};
}

/// `start` and, for each component of w, the product of the others by a factor.
template <class Start, class S, class Factors>
[[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, 3> others_product(
    const Start& start, const Factors& factors, const std::array<S, 3>& w) noexcept {
  if constexpr (std::is_same_v<Factors, Ones>) {
    return {onto(start[0], w[1], w[2]), onto(start[1], w[2], w[0]), onto(start[2], w[0], w[1])};
  } else {
    return {onto(start[0], factors[0], w[1] * w[2]), onto(start[1], factors[1], w[2] * w[0]),
            onto(start[2], factors[2], w[0] * w[1])};
  }
}
template <class Start, class S, class Factors>
[[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, 1> others_product(
    const Start& start, const Factors&, const std::array<S, 1>&) noexcept {
  if constexpr (std::is_same_v<Start, Nothing>) {
    return {S(0)};
  } else {
    return {start[0]};
  }
}

/// An interaction whose forques count by weights that are always the same.
template <class Interaction, class Weights>
struct Weighted {
  const Interaction& interaction;
  Weights weights;

  template <class System, class Motors, class Momenta>
  HAMOTOR_INLINE constexpr void add_forque(const System& system, const Motors& motors,
                                           Momenta& forque) const noexcept {
    interaction.add_forque(system, motors, forque, weights);
  }
};
template <class System, class Interaction, class Weights>
[[nodiscard]] constexpr auto weighted(const System& system, const Interaction& interaction,
                                      const Weights& weights) noexcept {
  if constexpr (requires { interaction.weighted(system, weights); }) {
    return interaction.weighted(system, weights);
  } else {
    return Weighted<Interaction, Weights>{interaction, weights};
  }
}

/// Where a body is in the world.
template <class G, class S>
struct Pose {
  typename Space<G>::template Attitude<S> attitude;
  std::array<S, Space<G>::dimension> position;
  HalfTurn<S, Space<G>::dimension> half_turn;  ///< of the attitude
};

/// What changes the momenta of a body: the moment in the body's frame, the force in the world's.
template <class G, class S>
struct Push {
  std::array<S, Space<G>::rotations> moment;
  std::array<S, Space<G>::dimension> force;
};

/// Adds a force, world frame, at a point of a body; `lever` is twice where.
template <class G, class S>
HAMOTOR_INLINE constexpr void push_at(const Pose<G, S>& pose, Push<G, S>& push,
                                      const std::array<S, Space<G>::dimension>& lever,
                                      const std::array<S, Space<G>::dimension>& force) noexcept {
  push.force = sum_with(push.force, One{}, force);
  push.moment = with_moment(push.moment, lever, pose.half_turn.turned_back(force));
}

/// An interaction that knows body forques only, as it pushes bodies.
template <class System, class Interaction, class Weights>
struct PushOfForque {
  const System& system;
  const Interaction& interaction;
  Weights weights;

  template <class G, class S, std::size_t n>
  HAMOTOR_INLINE constexpr void add(const std::array<Pose<G, S>, n>& poses,
                                    std::array<Push<G, S>, n>& pushes) const noexcept {
    constexpr std::size_t turns = Space<G>::rotations;
    typename System::Motors motors{};
    for (std::size_t i = 0; i < n; ++i) {
      motors[i] = Space<G>::motor(poses[i].attitude, poses[i].position);
    }
    typename System::Momenta forques{};
    interaction.add_forque(system, motors, forques, weights);
    for (std::size_t i = 0; i < n; ++i) {
      const auto x = forques[i].components();
      std::array<S, Space<G>::dimension> twice{};
      for (std::size_t k = 0; k < twice.size(); ++k) twice[k] = x[turns + k] + x[turns + k];
      for (std::size_t k = 0; k < turns; ++k) pushes[i].moment[k] = pushes[i].moment[k] + x[k];
      pushes[i].force = poses[i].half_turn.turned(pushes[i].force, twice);
    }
  }
};
template <class System, class Interaction, class Weights>
[[nodiscard]] constexpr auto push_of(const System& system, const Interaction& interaction,
                                     const Weights& weights) noexcept {
  if constexpr (requires { interaction.push(system, weights); }) {
    return interaction.push(system, weights);
  } else {
    return PushOfForque<System, Interaction, Weights>{system, interaction, weights};
  }
}

/// What follows the first R numbers that sums begin with.
template <std::size_t R>
[[nodiscard]] HAMOTOR_INLINE constexpr Nothing rest(const Nothing& nothing) noexcept {
  return nothing;
}

}  // namespace detail

/// What a body's free motion adds to its motor and its momentum.
template <class G, class S>
struct BodyChange {
  typename G::template Element<S> motor;
  typename G::template Momentum<S> momentum;
};

/// What rigid bodies in their principal frames share: their inertia and their free motion.
template <class G, class S, RotationSplit split>
class PrincipalBody {
 public:
  using Group = G;
  using Scalar = S;
  using Element = typename G::template Element<S>;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  using Point = typename Space<G>::template Point<S>;
  using Origin = typename Space<G>::template Origin<S>;
  using Direction = typename Space<G>::template Direction<S>;
  static constexpr std::size_t rotations = Space<G>::rotations;
  static constexpr std::size_t dimension = Space<G>::dimension;
  static constexpr bool free_motion_is_exact = PrincipalRotation<S, rotations, split>::is_exact;
  static constexpr bool spin_apart = split.spin_apart;
  static constexpr bool nearly_symmetric = split.nearly_symmetric;
  /// Whether the free rotation is composed of turns about two axes.
  static constexpr bool has_two_turns = !free_motion_is_exact;

  /// kg.
  [[nodiscard]] constexpr const S& mass() const noexcept { return mass_; }

  /// Principal moments about the frame's origin, kg m².
  [[nodiscard]] constexpr const std::array<S, rotations>& moments() const noexcept {
    return rotation_.moments();
  }

  /// The free motion in the time h, less the spin where that is apart.  Translation (|P|² is a
  /// Casimir) and rotation commute, so that nothing is lost by splitting them.
  [[nodiscard]] constexpr BodyChange<G, S> free_change(const Element& m, const Momentum& mu,
                                                       const S& h) const noexcept {
    return moved(m, mu, h, rotation_.free_change(angular(mu), h));
  }

  /// The spin that is apart, in the time h.
  [[nodiscard]] constexpr BodyChange<G, S> spin_change(const Element& m, const Momentum& mu,
                                                       const S& h) const noexcept
    requires(spin_apart)
  {
    return turned(m, mu, rotation_.spin_change(angular(mu), h));
  }

  /// All of the free motion in the time h, by a splitting of the rotation.
  template <std::size_t stages>
  [[nodiscard]] constexpr BodyChange<G, S> free_step(
      const Element& m, const Momentum& mu, const S& h,
      const SplittingWeights<S, stages>& weights) const noexcept {
    return moved(m, mu, h, rotation_.free_step(angular(mu), h, weights));
  }

  /// A part of the free motion: the turn about the axis o, or about i, in the time h, of
  /// half an angle in the range.
  template <bool is_outer, AngleRange range>
  HAMOTOR_INLINE constexpr void turn(Element& m, Momentum& mu, const S& h) const noexcept
    requires(has_two_turns)
  {
    constexpr auto axis = static_cast<std::size_t>(is_outer ? split.outer : split.inner);
    detail::turn_body<axis>(m, mu, rotation_.template half_turn<is_outer, range>(angular(mu), h));
  }

  /// The range in which half of those turns' angles are and remain.
  [[nodiscard]] constexpr AngleRange range_of_turns(const Momentum& mu, const S& h) const noexcept
    requires(has_two_turns)
  {
    return rotation_.range_of_turns(angular(mu), h);
  }

  /// What else the free motion adds in the time h: it commutes with those turns, and is exact.
  [[nodiscard]] constexpr BodyChange<G, S> commuting_change(const Element& m, const Momentum& mu,
                                                            const S& h) const noexcept
    requires(has_two_turns)
  {
    return moved(m, mu, h, {rotation_.spherical_change(angular(mu), h), {}});
  }

 protected:
  using Rotation = PrincipalRotation<S, rotations, split>;
  using Turning = typename Rotation::Change;

  constexpr PrincipalBody(const S& mass, const std::array<S, rotations>& moments) noexcept
      : mass_(mass), inverse_mass_(S(1) / mass), rotation_(moments) {}

  S mass_;
  S inverse_mass_;
  Rotation rotation_;

  /// Π.
  [[nodiscard]] static constexpr std::array<S, rotations> angular(const Momentum& mu) noexcept {
    return detail::first<rotations>(mu.components());
  }

  /// P times a factor.
  [[nodiscard]] static constexpr std::array<S, dimension> velocity(const Momentum& mu,
                                                                   const S& factor) noexcept {
    const auto x = mu.components();
    std::array<S, dimension> v{};
    for (std::size_t k = 0; k < dimension; ++k) v[k] = factor * x[rotations + k];
    return v;
  }

  [[nodiscard]] static constexpr BodyChange<G, S> turned(const Element& m,
                                                         [[maybe_unused]] const Momentum& mu,
                                                         const Turning& by) noexcept {
    if constexpr (Space<G>::translates) {
      // One expression: with the motor's change as a variable g++ 12 takes half as long again.
      return {Space<G>::rotation_change(m, by.rotor),
              Momentum::from(detail::joined(
                  by.angular,
                  detail::turned_back_change(by.rotor, detail::rest<rotations>(mu.components()))))};
    } else {
      return {Space<G>::rotation_change(m, by.rotor), Momentum::from(by.angular)};
    }
  }

 private:
  /// First, where bodies translate, by V h in the body frame, then turned.
  [[nodiscard]] constexpr BodyChange<G, S> moved(const Element& m, const Momentum& mu,
                                                 [[maybe_unused]] const S& h,
                                                 const Turning& by) const noexcept {
    if constexpr (Space<G>::translates) {
      const Element shift = Space<G>::translation_change(m, velocity(mu, h * inverse_mass_));
      const auto change = turned(m + shift, mu, by);
      return {shift + change.motor, change.momentum};
    } else {
      return turned(m, mu, by);
    }
  }
};

/// Rigid body that moves freely, in its central principal frame: mass (kg), principal moments (kg
/// m²) about the centre of mass, which is the frame's origin.
template <class G, class S, RotationSplit split = RotationSplit{}>
class FreeBody : public PrincipalBody<G, S, split> {
  using Base = PrincipalBody<G, S, split>;
  using Base::angular;
  using Base::inverse_mass_;
  using Base::mass_;
  using Base::rotation_;
  using Base::velocity;

 public:
  using Base::dimension;
  using Base::rotations;
  using typename Base::Direction;
  using typename Base::Element;
  using typename Base::Momentum;
  using typename Base::Origin;
  using typename Base::Point;
  using typename Base::Rate;
  static_assert(Space<G>::translates, "a body of a group of rotations is a PivotedBody");

  constexpr FreeBody(const S& mass, const std::array<S, rotations>& moments) noexcept
      : Base(mass, moments) {}

  /// B = ∂T/∂μ: Ω = Π/J, V = P/m.
  [[nodiscard]] constexpr Rate rate(const Momentum& mu) const noexcept {
    return Rate::from(detail::joined(rotation_.rate(angular(mu)), velocity(mu, inverse_mass_)));
  }

  /// [μ, B] for B = ∂T/∂μ: (Π×Ω, P×Ω).  P × V is zero, as V = P/m, and is left out.
  [[nodiscard]] static constexpr Momentum free_momentum_rate(const Momentum& mu,
                                                             const Rate& rate) noexcept {
    const auto pi = angular(mu);
    const auto turning = detail::first<rotations>(rate.components());
    const auto p = detail::rest<rotations>(mu.components());
    if constexpr (rotations == 3) {
      return Momentum::from(detail::joined(detail::cross(pi, turning), detail::cross(p, turning)));
    } else {
      return Momentum::from({S(0), p[1] * turning[0], -p[0] * turning[0]});
    }
  }

  /// What momenta are to be multiplied by for `unit` B.
  [[nodiscard]] constexpr Rate rates_in(const S& unit) const noexcept {
    return Rate::from(detail::joined(detail::scaled(unit, rotation_.inverse_moments()),
                                     detail::filled<dimension>(unit * inverse_mass_)));
  }

  /// `start` and unit² [μ, B] of `unit` B with the mass as unit of masses; where no forque is added
  /// to it, the angular part with J_i − J_j as unit.  `factors`: of the angular part.
  template <class Factors, class Start>
  [[nodiscard]] HAMOTOR_INLINE static constexpr Momentum slope(const Factors& factors,
                                                               const Start& start,
                                                               const Rate& rate) noexcept {
    const auto x = rate.components();
    const auto turning = detail::first<rotations>(x);
    return Momentum::from(detail::joined(
        detail::others_product(start, factors, turning),
        detail::turned_at(detail::rest<rotations>(start), detail::rest<rotations>(x), turning)));
  }
  template <bool has_forque>
  [[nodiscard]] constexpr auto slope_factors() const noexcept {
    if constexpr (has_forque) {
      return detail::scaled(inverse_mass_, rotation_.differences());
    } else {
      return detail::Ones{};
    }
  }
  /// What a forque counts for then.
  [[nodiscard]] constexpr S forque_weight(const S& unit) const noexcept {
    return -unit * unit * inverse_mass_;
  }
  /// What such a slope is to be multiplied by for that of the rate, in the same unit.
  template <bool has_forque>
  [[nodiscard]] constexpr Rate rate_weights() const noexcept {
    return Rate::from(detail::joined(
        has_forque ? detail::scaled(mass_, rotation_.inverse_moments()) : rotation_.ratios(),
        detail::filled<dimension>(S(1))));
  }
  /// And for x times that of the momentum.
  template <bool has_forque>
  [[nodiscard]] constexpr Momentum momentum_weights(const S& x) const noexcept {
    const S mass = x * mass_;
    return Momentum::from(detail::joined(
        has_forque ? detail::filled<rotations>(mass) : detail::scaled(x, rotation_.differences()),
        detail::filled<dimension>(mass)));
  }

  /// ½ μ(B), J.
  [[nodiscard]] constexpr S kinetic(const Momentum& mu) const noexcept {
    const auto p = detail::rest<rotations>(mu.components());
    return rotation_.energy(angular(mu)) + S(0.5) * inverse_mass_ * detail::dot(p, p);
  }

  /// Where a point of the principal frame is in the world, m.
  [[nodiscard]] constexpr Point in_world(const Element& m, const Point& x) const noexcept {
    return sandwich(m, x);
  }

  /// From a point of the world to one of the body, principal frame, m, over `reach_parts`: from the
  /// world's origin in half of the operations.
  [[nodiscard]] constexpr std::array<S, dimension> reach(const Element& m, const Point& from,
                                                         const Point& to) const noexcept {
    return detail::difference(to, sandwich(reverse(m), from));
  }
  [[nodiscard]] constexpr std::array<S, dimension> reach(const Element& m, const Origin&,
                                                         const Point& to) const noexcept {
    return Space<G>::from_origin(to, m);
  }
  template <class From>
  static constexpr int reach_parts = std::is_same_v<From, Origin> ? Space<G>::origin_parts : 1;

  /// −m g·x, x the centre of mass; g in the world frame, m/s².
  [[nodiscard]] constexpr S weight_potential(const Element& m, const Direction& g) const noexcept {
    const Point x = sandwich(m, typename Space<G>::template Origin<S>{});
    return -mass_ * detail::dot(g.components(), x.components());
  }

  /// μ and `weight` times the body forque (+dH) of a field g: −m Rᵀg at the centre of mass.
  template <class Weight>
  [[nodiscard]] constexpr Momentum with_weight_forque(const Momentum& mu, const Element& m,
                                                      const Direction& g,
                                                      const Weight& weight) const noexcept {
    const auto f = sandwich(reverse(m), g).components();
    auto x = mu.components();
    for (std::size_t k = 0; k < dimension; ++k) {
      x[rotations + k] = mul_add(weight * -mass_, f[k], x[rotations + k]);
    }
    return Momentum::from(x);
  }
};

/// Rigid body with a fixed point, in the principal frame about that point: mass (kg), principal
/// moments about the fixed point (kg m²), centre of mass (m, that frame), and where in the world
/// the fixed point is (m).  Spatial momenta are taken about the fixed point.
template <class G, class S, RotationSplit split = RotationSplit{}>
class PivotedBody : public PrincipalBody<G, S, split> {
  using Base = PrincipalBody<G, S, split>;
  using Base::mass_;
  using Base::rotation_;

 public:
  using Base::dimension;
  using Base::rotations;
  using typename Base::Direction;
  using typename Base::Element;
  using typename Base::Momentum;
  using typename Base::Point;
  using typename Base::Rate;
  static_assert(!Space<G>::translates, "a body of a group that translates is a FreeBody");

  constexpr PivotedBody(const S& mass, const std::array<S, rotations>& moments,
                        const std::array<S, dimension>& center_of_mass,
                        const std::array<S, dimension>& fixed_point) noexcept
      : Base(mass, moments), center_(center_of_mass), pivot_(fixed_point) {}

  /// Where the fixed point is, world frame, m.
  [[nodiscard]] constexpr const std::array<S, dimension>& fixed_point() const noexcept {
    return pivot_;
  }

  /// B = ∂T/∂μ: Ω = Π/J.
  [[nodiscard]] constexpr Rate rate(const Momentum& mu) const noexcept {
    return Rate::from(rotation_.rate(mu.components()));
  }

  /// [μ, B] for B = ∂T/∂μ: Π×Ω.
  [[nodiscard]] static constexpr Momentum free_momentum_rate(const Momentum& mu,
                                                             const Rate& rate) noexcept {
    return coadjoint(rate, mu);
  }

  /// What momenta are to be multiplied by for `unit` B.
  [[nodiscard]] constexpr Rate rates_in(const S& unit) const noexcept {
    return Rate::from(detail::scaled(unit, rotation_.inverse_moments()));
  }

  /// `start` and unit² [μ, B] of `unit` B; where no forque is added to it, with J_i − J_j as unit.
  template <class Factors, class Start>
  [[nodiscard]] HAMOTOR_INLINE static constexpr Momentum slope(const Factors& factors,
                                                               const Start& start,
                                                               const Rate& rate) noexcept {
    return Momentum::from(detail::others_product(start, factors, rate.components()));
  }
  template <bool has_forque>
  [[nodiscard]] constexpr auto slope_factors() const noexcept {
    if constexpr (has_forque) {
      return rotation_.differences();
    } else {
      return detail::Ones{};
    }
  }
  /// What a forque counts for then.
  [[nodiscard]] constexpr S forque_weight(const S& unit) const noexcept { return -unit * unit; }
  /// What such a slope is to be multiplied by for that of the rate, in the same unit.
  template <bool has_forque>
  [[nodiscard]] constexpr Rate rate_weights() const noexcept {
    return Rate::from(has_forque ? rotation_.inverse_moments() : rotation_.ratios());
  }
  /// And for x times that of the momentum.
  template <bool has_forque>
  [[nodiscard]] constexpr Momentum momentum_weights(const S& x) const noexcept {
    return Momentum::from(has_forque ? detail::filled<rotations>(x)
                                     : detail::scaled(x, rotation_.differences()));
  }

  /// ½ μ(B), J.
  [[nodiscard]] constexpr S kinetic(const Momentum& mu) const noexcept {
    return rotation_.energy(mu.components());
  }

  /// The motion in the field g (world frame, m/s²) in the time h, by a splitting, of a body whose
  /// centre of mass is on its axis of symmetry.
  template <std::size_t stages>
  [[nodiscard]] constexpr BodyChange<G, S> top_step(
      const Element& m, const Momentum& mu, const Direction& g, const S& h,
      const SplittingWeights<S, stages>& weights) const noexcept
    requires(split.spin_apart)
  {
    return Base::turned(
        m, mu,
        rotation_.top_step(mu.components(), sandwich(reverse(m), g).components(),
                           mass_ * center_[static_cast<std::size_t>(split.outer)], h, weights));
  }

  /// Where a point of the principal frame is in the world, m.
  [[nodiscard]] constexpr Point in_world(const Element& m, const Point& x) const noexcept {
    auto y = sandwich(m, x).components();
    for (std::size_t k = 0; k < dimension; ++k) y[k] = y[k] + pivot_[k];
    return Point::from(y);
  }

  /// From a point of the world to one of the body, principal frame, m.
  [[nodiscard]] constexpr std::array<S, dimension> reach(const Element& m, const Point& from,
                                                         const Point& to) const noexcept {
    auto y = from.components();
    for (std::size_t k = 0; k < dimension; ++k) y[k] = y[k] - pivot_[k];
    return detail::difference(to, sandwich(reverse(m), Point::from(y)));
  }
  template <class From>
  static constexpr int reach_parts = 1;

  /// −m g·x, x the centre of mass; g in the world frame, m/s².
  [[nodiscard]] constexpr S weight_potential(const Element& m, const Direction& g) const noexcept {
    const Point x = in_world(m, Point::from(center_));
    return -mass_ * detail::dot(g.components(), x.components());
  }

  /// μ and `weight` times the body forque (+dH) of a field g: −c × m Rᵀg.
  template <class Weight>
  [[nodiscard]] constexpr Momentum with_weight_forque(const Momentum& mu, const Element& m,
                                                      const Direction& g,
                                                      const Weight& weight) const noexcept {
    return Space<G>::with_force(mu, weight * -mass_, Point::from(center_),
                                sandwich(reverse(m), g).components());
  }

 private:
  std::array<S, dimension> center_;
  std::array<S, dimension> pivot_;
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

  /// Adds the body forques, each body's with a weight.
  template <class System, class Motors, class Momenta, class Weights>
  HAMOTOR_INLINE constexpr void add_forque(const System& system, const Motors& motors,
                                           Momenta& forque, const Weights& weights) const noexcept {
    system.for_each_body([&](auto i, const auto& body) {
      forque[i] = body.with_weight_forque(forque[i], motors[i], acceleration, weights[i]);
    });
  }

  /// What bodies that move freely are pushed by, for always the same weights.
  template <class System, std::size_t n>
  [[nodiscard]] constexpr auto push(const System& system,
                                    const std::array<S, n>& weights) const noexcept {
    Weight<n> result{};
    system.for_each_body([&](auto i, const auto& body) {
      result.forces[i] = detail::scaled(weights[i] * -body.mass(), acceleration.components());
    });
    return result;
  }

 private:
  template <std::size_t n>
  struct Weight {
    std::array<std::array<S, Space<G>::dimension>, n> forces;

    HAMOTOR_INLINE constexpr void add(const std::array<detail::Pose<G, S>, n>& /*poses*/,
                                      std::array<detail::Push<G, S>, n>& pushes) const noexcept {
      for (std::size_t i = 0; i < n; ++i) {
        pushes[i].force = detail::sum_with(pushes[i].force, detail::One{}, forces[i]);
      }
    }
  };
};

/// Whether a spring has a length at which it is slack.  Without one its potential is ½ k r², smooth
/// everywhere and cheaper; with one, ½ k (r − ℓ)², which has no direction to pull in at r = 0: the
/// force is taken as zero there.
enum class RestLength { zero, positive };

namespace detail {

/// k (1 − ℓ/r), the force over the extension r between the ends.
template <RestLength rest, class S, std::size_t D>
[[nodiscard]] constexpr S tension(const S& stiffness, const S& rest_length,
                                  const std::array<S, D>& extension) noexcept {
  if constexpr (rest == RestLength::zero) {
    return stiffness;
  } else {
    const S length = scalar::sqrt(dot(extension, extension));
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

}  // namespace detail

/// Spring from a point of body number `index` to a point of the world: any Point or, for a body
/// that moves freely, the Origin.
template <std::size_t index, class G, class S, RestLength rest = RestLength::positive,
          class Anchor = typename Space<G>::template Point<S>>
struct SpringToWorld {
  typename Space<G>::template Point<S> at;  ///< in the body's principal frame, m
  Anchor anchor;                            ///< in the world, m
  S stiffness;                              ///< N/m
  S rest_length;                            ///< m; not read where `rest` is zero

  template <class System, class Motors>
  [[nodiscard]] constexpr S potential(const System& system, const Motors& motors) const noexcept {
    const auto d =
        detail::difference(system.template body<index>().in_world(motors[index], at), anchor);
    return detail::spring_energy<rest>(stiffness, rest_length, detail::dot(d, d));
  }

  /// Adds the body forque with a weight: the line of k (1 − ℓ/r) times the extension, in the body
  /// frame.
  template <class System, class Motors, class Momenta, class Weights>
  HAMOTOR_INLINE constexpr void add_forque(const System& system, const Motors& motors,
                                           Momenta& forque, const Weights& weights) const noexcept {
    const auto reach = system.template body<index>().reach(motors[index], anchor, at);
    const S pull = weights[index] * tension<System>(reach);
    forque[index] = Space<G>::with_force(forque[index], pull, at, reach);
  }

  /// What does that for always the same weights, without what is then always the same.
  template <class System, class Weights>
  [[nodiscard]] constexpr auto weighted(const System& /*system*/,
                                        const Weights& weights) const noexcept
    requires(rest == RestLength::zero)
  {
    const S pull = weights[index] * tension<System>(std::array<S, Space<G>::dimension>{});
    return Pull{*this, pull, Space<G>::scaled(pull, at)};
  }

  /// How it pushes the body, for always the same weights.
  template <class System, std::size_t n>
  [[nodiscard]] constexpr auto push(const System& /*system*/,
                                    const std::array<S, n>& weights) const noexcept {
    if constexpr (rest == RestLength::zero) {
      const S pull = weights[index] * stiffness;
      return Push<S>{*this, pull, twice(pull), twice(pull)};
    } else {
      return Push<S>{*this, weights[index], twice(S(1)), twice(S(1))};
    }
  }

  /// The same where nothing else acts, with forces in units of `force_unit`: there is none before.
  template <std::size_t n>
  [[nodiscard]] constexpr auto push_alone(const std::array<S, n>& weights) const noexcept
    requires(rest == RestLength::zero)
  {
    return Push<detail::One>{*this, {}, twice(S(1)), twice(force_unit(weights))};
  }
  template <std::size_t n>
  [[nodiscard]] constexpr S force_unit(const std::array<S, n>& weights) const noexcept {
    return weights[index] * stiffness;
  }

 private:
  /// `at` by twice a factor.
  [[nodiscard]] constexpr std::array<S, Space<G>::dimension> twice(const S& factor) const noexcept {
    return detail::scaled(S(2) * factor, at.components());
  }

  template <class Factor>
  struct Push {
    const SpringToWorld& spring;
    [[no_unique_address]] Factor factor;       ///< of the force over the extension or its part
    std::array<S, Space<G>::dimension> lever;  ///< to where the force is
    std::array<S, Space<G>::dimension> moment_lever;  ///< of the extension's moment or the force's

    template <std::size_t n>
    HAMOTOR_INLINE constexpr void add(const std::array<detail::Pose<G, S>, n>& poses,
                                      std::array<detail::Push<G, S>, n>& pushes) const noexcept {
      using Point = typename Space<G>::template Point<S>;
      const auto& pose = poses[index];
      const auto apart = detail::difference(Point::from(pose.position), spring.anchor);
      if constexpr (rest == RestLength::zero) {
        // Without R at, whose moment is none.
        auto& [moment, force] = pushes[index];
        if constexpr (std::is_same_v<Factor, detail::One>) {
          force = pose.half_turn.turned(apart, lever);
        } else {
          force = pose.half_turn.turned(detail::sum_with(force, factor, apart), lever);
        }
        moment = detail::with_moment(moment, moment_lever, pose.half_turn.turned_back(apart));
      } else {
        const auto reach = pose.half_turn.turned(apart, lever);
        const S pull = detail::tension<rest>(spring.stiffness, spring.rest_length, reach);
        detail::push_at(pose, pushes[index], moment_lever, detail::scaled(factor * pull, reach));
      }
    }
  };

  struct Pull {
    const SpringToWorld& spring;
    S pull;
    typename Space<G>::template Point<S> lever;

    template <class System, class Motors, class Momenta>
    HAMOTOR_INLINE constexpr void add_forque(const System& system, const Motors& motors,
                                             Momenta& forque) const noexcept {
      const auto reach =
          system.template body<index>().reach(motors[index], spring.anchor, spring.at);
      forque[index] = Space<G>::with_lever(forque[index], pull, lever, reach);
    }
  };

  /// The force over the reach.
  template <class System>
  [[nodiscard]] constexpr S tension(
      const std::array<S, Space<G>::dimension>& reach) const noexcept {
    constexpr int parts = System::template BodyAt<index>::template reach_parts<Anchor>;
    if constexpr (parts == 1) {
      return detail::tension<rest>(stiffness, rest_length, reach);
    } else {
      return S(parts) * detail::tension<rest>(stiffness, S(1.0 / parts) * rest_length, reach);
    }
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

  /// Adds the two body forques, of one force and its opposite, each with a weight.
  template <class System, class Motors, class Momenta, class Weights>
  HAMOTOR_INLINE constexpr void add_forque(const System& system, const Motors& motors,
                                           Momenta& forque, const Weights& weights) const noexcept {
    const auto f = extension(system, motors);
    const S pull = detail::tension<rest>(stiffness, rest_length, f);
    forque[one] = with_end(forque[one], weights[one] * -pull, motors[one], at_one, f);
    forque[two] = with_end(forque[two], weights[two] * pull, motors[two], at_two, f);
  }

  /// How it pushes the two bodies, for always the same weights.
  template <class System, std::size_t n>
  [[nodiscard]] constexpr auto push(const System& /*system*/,
                                    const std::array<S, n>& weights) const noexcept {
    return Push{*this, -weights[one], weights[two], detail::scaled(S(2), at_one.components()),
                detail::scaled(S(2), at_two.components())};
  }

 private:
  struct Push {
    const SpringBetween& spring;
    S weight_one;
    S weight_two;
    std::array<S, Space<G>::dimension> lever_one;  ///< twice `at_one`
    std::array<S, Space<G>::dimension> lever_two;

    template <std::size_t n>
    HAMOTOR_INLINE constexpr void add(const std::array<detail::Pose<G, S>, n>& poses,
                                      std::array<detail::Push<G, S>, n>& pushes) const noexcept {
      using Point = typename Space<G>::template Point<S>;
      const auto from = poses[one].half_turn.turned(poses[one].position, lever_one);
      const auto to = poses[two].half_turn.turned(poses[two].position, lever_two);
      const auto reach = detail::difference(Point::from(to), Point::from(from));
      const S pull = detail::tension<rest>(spring.stiffness, spring.rest_length, reach);
      detail::push_at(poses[one], pushes[one], lever_one, detail::scaled(weight_one * pull, reach));
      detail::push_at(poses[two], pushes[two], lever_two, detail::scaled(weight_two * pull, reach));
    }
  };

  /// μ and `pull` times the force line of f, world frame, through a point of a body.  A function,
  /// as g++ leaves a lambda as a call, for which a state goes through memory.
  template <class Momentum, class Motor>
  [[nodiscard]] HAMOTOR_INLINE static constexpr Momentum with_end(
      const Momentum& mu, const S& pull, const Motor& motor,
      const typename Space<G>::template Point<S>& at,
      const std::array<S, Space<G>::dimension>& f) noexcept {
    using Direction = typename Space<G>::template Direction<S>;
    return Space<G>::with_force(mu, pull, at,
                                sandwich(reverse(motor), Direction::from(f)).components());
  }

  /// From the end on `one` to the end on `two`, world frame.
  template <class System, class Motors>
  [[nodiscard]] HAMOTOR_INLINE constexpr auto extension(const System& system,
                                                        const Motors& motors) const noexcept {
    return detail::difference(system.template body<two>().in_world(motors[two], at_two),
                              system.template body<one>().in_world(motors[one], at_one));
  }
};

namespace detail {

/// One body with a fixed point and its centre of mass on its axis of symmetry, in a uniform field
/// and nothing else.
template <class Bodies, class Interactions>
inline constexpr bool is_top = false;
template <class G, class S, RotationSplit split>
inline constexpr bool
    is_top<std::tuple<PivotedBody<G, S, split>>, std::tuple<UniformGravity<G, S>>> =
        split.spin_apart;

/// One body on a smooth spring, and nothing else.
template <class Bodies, class Interactions>
inline constexpr bool is_on_a_spring = false;
template <class Body, std::size_t index, class G, class S, class Anchor>
inline constexpr bool is_on_a_spring<
    std::tuple<Body>, std::tuple<SpringToWorld<index, G, S, RestLength::zero, Anchor>>> = true;

}  // namespace detail

/// Bodies, each in its principal frame, and what acts on them:
/// H = Σ T_i(μ_i) + Σ U_j(M), and every part of it only if its type is listed.
template <class Bodies, class Interactions = std::tuple<>>
class RigidBodies;

/// Their equations of motion with rates in place of momenta, and any time as unit: `unit` B, and
/// unit² μ̇ with units for each component in which it takes the fewest operations.  What is the same
/// in every step is found once.
template <class System>
class RateForm;

/// The same of bodies that translate, with their position and velocity in the world, where what is
/// linear is exact: rates turn, in the body's frame, and pushes hold the force over the mass.
template <class System>
class WorldForm;

template <class... Body, class... Interaction>
class RigidBodies<std::tuple<Body...>, std::tuple<Interaction...>> {
  using FirstBody = std::tuple_element_t<0, std::tuple<Body...>>;

 public:
  using Group = typename FirstBody::Group;
  using Scalar = typename FirstBody::Scalar;
  static constexpr std::size_t bodies = sizeof...(Body);
  static constexpr bool has_forque = sizeof...(Interaction) > 0;
  static constexpr bool moves_along_momentum = true;
  static constexpr bool free_motion_is_exact = (Body::free_motion_is_exact && ...);
  static constexpr bool nearly_symmetric =
      ((Body::free_motion_is_exact || Body::nearly_symmetric) && ...);
  static constexpr bool spin_apart = has_forque && (Body::spin_apart || ...);
  /// Whether the system takes whole steps of a splitting by itself.
  static constexpr bool is_top = detail::is_top<std::tuple<Body...>, std::tuple<Interaction...>>;
  static constexpr bool takes_split_steps = !has_forque || is_top;
  /// Whether all that moves is bodies whose free rotations are composed of turns about two axes.
  static constexpr bool has_two_turns = !has_forque && (Body::has_two_turns && ...);
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

  /// Type of body number `index`.
  template <std::size_t index>
  using BodyAt = std::tuple_element_t<index, std::tuple<Body...>>;

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

  /// [μ, B] for every body at its own rates, body frame.
  [[nodiscard]] static constexpr Momenta free_momentum_rates(const Momenta& momenta,
                                                             const Rates& rates) noexcept {
    return free_momentum_rates(momenta, rates, std::index_sequence_for<Body...>{});
  }

  /// F_b = M~ F_s M = +dH for every body, body frame: μ̇ = [μ, B] − F_b.
  [[nodiscard]] constexpr Momenta forque(const Motors& motors) const noexcept
    requires(has_forque)
  {
    Momenta result{};
    add_forques(motors, result, detail::Ones{});
    return result;
  }

  /// The same equations of motion with `unit` B in place of μ.
  [[nodiscard]] constexpr auto in_rates(const Scalar& unit) const noexcept {
    return RateForm<RigidBodies>(*this, unit);
  }

  /// And with positions and velocities in the world.
  [[nodiscard]] constexpr auto in_world(const Scalar& unit) const noexcept
    requires(Space<Group>::translates)
  {
    return WorldForm<RigidBodies>(*this, unit);
  }

  /// What the free motion, H = T, adds in the time h, less the spins that are apart.
  [[nodiscard]] constexpr ChangeOf<RigidBodies> free_change(const Motors& motors,
                                                            const Momenta& momenta,
                                                            const Scalar& h) const noexcept {
    return for_bodies(
        [&](auto i, const auto& one) { return one.free_change(motors[i], momenta[i], h); });
  }

  /// What the spins that are apart add in the time h: they commute with H.
  [[nodiscard]] constexpr ChangeOf<RigidBodies> spin_change(const Motors& motors,
                                                            const Momenta& momenta,
                                                            const Scalar& h) const noexcept
    requires(spin_apart)
  {
    return for_bodies([&](auto i, const auto& one) {
      if constexpr (std::remove_cvref_t<decltype(one)>::spin_apart) {
        return one.spin_change(motors[i], momenta[i], h);
      } else {
        return BodyChange<Group, Scalar>{};
      }
    });
  }

  /// The turn of every body about its axis o, or i, in the time h.
  template <bool is_outer, AngleRange range>
  HAMOTOR_INLINE constexpr void turn(Motors& motors, Momenta& momenta,
                                     const Scalar& h) const noexcept
    requires(has_two_turns)
  {
    turn_each<is_outer, range>(motors, momenta, h, std::make_index_sequence<bodies>{});
  }

  /// The range in which half of all those turns' angles are and remain.
  [[nodiscard]] constexpr AngleRange range_of_turns(const Momenta& momenta,
                                                    const Scalar& h) const noexcept
    requires(has_two_turns)
  {
    AngleRange range = AngleRange::tiny;
    for_each_body([&](auto i, const auto& one) {
      range = std::max(range, one.range_of_turns(momenta[i], h));
    });
    return range;
  }

  /// What all that commutes with those turns adds in the time h.
  [[nodiscard]] constexpr ChangeOf<RigidBodies> commuting_change(const Motors& motors,
                                                                 const Momenta& momenta,
                                                                 const Scalar& h) const noexcept
    requires(has_two_turns)
  {
    return for_bodies(
        [&](auto i, const auto& one) { return one.commuting_change(motors[i], momenta[i], h); });
  }

  /// What a whole step of a splitting adds.
  template <std::size_t stages>
  [[nodiscard]] constexpr ChangeOf<RigidBodies> split_step(
      const Motors& motors, const Momenta& momenta, const Scalar& h,
      const SplittingWeights<Scalar, stages>& weights) const noexcept
    requires(takes_split_steps)
  {
    return for_bodies([&](auto i, const auto& one) {
      if constexpr (is_top) {
        return one.top_step(motors[i], momenta[i], std::get<0>(interactions_).acceleration, h,
                            weights);
      } else {
        return one.free_step(motors[i], momenta[i], h, weights);
      }
    });
  }

 private:
  friend RateForm<RigidBodies>;
  friend WorldForm<RigidBodies>;

  template <std::size_t... i>
  [[nodiscard]] static constexpr Momenta free_momentum_rates(const Momenta& momenta,
                                                             const Rates& rates,
                                                             std::index_sequence<i...>) noexcept {
    return {Body::free_momentum_rate(momenta[i], rates[i])...};
  }

  /// A function, as g++ sometimes leaves a lambda as a call, for which a state goes through memory.
  template <bool is_outer, AngleRange range, std::size_t... i>
  HAMOTOR_INLINE constexpr void turn_each(Motors& motors, Momenta& momenta, const Scalar& h,
                                          std::index_sequence<i...>) const noexcept {
    (std::get<i>(bodies_).template turn<is_outer, range>(motors[i], momenta[i], h), ...);
  }

  template <class Weights>
  constexpr void add_forques(const Motors& motors, Momenta& forque,
                             const Weights& weights) const noexcept {
    std::apply(
        [&](const auto&... interaction) {
          (interaction.add_forque(*this, motors, forque, weights), ...);
        },
        interactions_);
  }

  /// change(std::integral_constant i, body number i) of every body.
  template <class Change>
  [[nodiscard]] constexpr ChangeOf<RigidBodies> for_bodies(Change&& change) const noexcept {
    ChangeOf<RigidBodies> result{};
    for_each_body([&](auto i, const auto& one) {
      const auto [motor, momentum] = change(i, one);
      result.motors[i] = motor;
      result.momenta[i] = momentum;
    });
    return result;
  }

  std::tuple<Body...> bodies_;
  std::tuple<Interaction...> interactions_;
};

template <class... Body, class... Interaction>
class RateForm<RigidBodies<std::tuple<Body...>, std::tuple<Interaction...>>> {
  using System = RigidBodies<std::tuple<Body...>, std::tuple<Interaction...>>;
  using S = typename System::Scalar;
  using Motors = typename System::Motors;
  using Momenta = typename System::Momenta;
  using Rates = typename System::Rates;
  using Forques = std::array<S, System::bodies>;
  using Each = std::index_sequence_for<Body...>;

 public:
  /// Keeps a reference to the system.
  constexpr RateForm(const System& system, const S& unit) noexcept
      : RateForm(system, unit, Each{}) {}

  /// `unit` B.
  [[nodiscard]] HAMOTOR_INLINE constexpr Rates rates(const Momenta& momenta) const noexcept {
    return rates(momenta, Each{});
  }

  /// unit² μ̇ at these motors and `unit` B, added to `start(i)`: for every body components, or
  /// nothing.
  template <class Start>
  [[nodiscard]] HAMOTOR_INLINE constexpr Momenta slopes(const Start& start, const Motors& motors,
                                                        const Rates& rates) const noexcept {
    return slopes(start, motors, rates, Each{}, std::index_sequence_for<Interaction...>{});
  }

  /// What such slopes are to be multiplied by for unit² Ḃ.
  [[nodiscard]] constexpr const Rates& rate_weights() const noexcept { return rate_weights_; }

  /// And for x unit² μ̇.
  [[nodiscard]] constexpr Momenta momentum_weights(const S& x) const noexcept {
    return momentum_weights(x, Each{});
  }

 private:
  template <std::size_t... i>
  constexpr RateForm(const System& system, const S& unit, std::index_sequence<i...>) noexcept
      : system_(system),
        per_momentum_{system.template body<i>().rates_in(unit)...},
        factors_{system.template body<i>().template slope_factors<System::has_forque>()...},
        rate_weights_{system.template body<i>().template rate_weights<System::has_forque>()...},
        interactions_(std::apply(
            [&](const auto&... interaction) {
              return std::tuple{
                  detail::weighted(system, interaction,
                                   Forques{system.template body<i>().forque_weight(unit)...})...};
            },
            system.interactions_)) {}

  template <std::size_t... i>
  [[nodiscard]] HAMOTOR_INLINE constexpr Rates rates(const Momenta& momenta,
                                                     std::index_sequence<i...>) const noexcept {
    return {detail::each_times(per_momentum_[i], momenta[i])...};
  }

  template <class Start, std::size_t... i, std::size_t... j>
  [[nodiscard]] HAMOTOR_INLINE constexpr Momenta slopes(const Start& start, const Motors& motors,
                                                        const Rates& rates,
                                                        std::index_sequence<i...>,
                                                        std::index_sequence<j...>) const noexcept {
    Momenta result{Body::slope(std::get<i>(factors_), start(i), rates[i])...};
    (std::get<j>(interactions_).add_forque(system_, motors, result), ...);
    return result;
  }

  template <std::size_t... i>
  [[nodiscard]] constexpr Momenta momentum_weights(const S& x,
                                                   std::index_sequence<i...>) const noexcept {
    return {system_.template body<i>().template momentum_weights<System::has_forque>(x)...};
  }

  const System& system_;
  Rates per_momentum_;
  std::tuple<decltype(std::declval<Body>().template slope_factors<System::has_forque>())...>
      factors_;
  Rates rate_weights_;
  std::tuple<decltype(detail::weighted(std::declval<const System&>(),
                                       std::declval<const Interaction&>(),
                                       std::declval<Forques>()))...>
      interactions_;
};

template <class... Body, class... Interaction>
class WorldForm<RigidBodies<std::tuple<Body...>, std::tuple<Interaction...>>> {
  using System = RigidBodies<std::tuple<Body...>, std::tuple<Interaction...>>;
  using S = typename System::Scalar;
  using G = typename System::Group;
  using Space = hamotor::Space<G>;
  static constexpr std::size_t n = System::bodies;
  static constexpr std::size_t rotations = Space::rotations;
  using Weights = std::array<S, n>;
  using Each = std::index_sequence_for<Body...>;

 public:
  using Attitudes = std::array<typename Space::template Attitude<S>, n>;
  using Vectors = std::array<std::array<S, Space::dimension>, n>;  ///< in the world
  using Turnings = std::array<std::array<S, rotations>, n>;        ///< in the body's frame
  using Pushes = std::array<detail::Push<G, S>, n>;

  /// Keeps a reference to the system.
  constexpr WorldForm(const System& system, const S& unit) noexcept
      : WorldForm(system, unit, Each{}) {}

  /// `unit` Ω of angular momenta.
  [[nodiscard]] HAMOTOR_INLINE constexpr Turnings rates(const Turnings& momenta) const noexcept {
    Turnings result{};
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < rotations; ++k) {
        result[i][k] = per_momentum_[i][k] * momenta[i][k];
      }
    }
    return result;
  }

  /// unit² Π̇, each component of it in a unit of the system's own, added to `start(i)`: for every
  /// body components, or nothing; and unit² v̇ in such a unit added to `forces`, or to nothing.
  template <class Start, class Forces>
  [[nodiscard]] HAMOTOR_INLINE constexpr Pushes slopes(const Start& start, const Forces& forces,
                                                       const Attitudes& attitudes,
                                                       const Vectors& positions,
                                                       const Turnings& rates) const noexcept {
    return slopes(start, forces, attitudes, positions, rates, Each{},
                  std::index_sequence_for<Interaction...>{});
  }

  /// What such slopes are to be multiplied by for unit² Ω̇.
  [[nodiscard]] constexpr const Turnings& rate_weights() const noexcept { return rate_weights_; }

  /// And for x unit² Π̇.
  [[nodiscard]] constexpr Turnings momentum_weights(const S& x) const noexcept {
    return momentum_weights(x, Each{});
  }

  /// And the force for unit² v̇.
  [[nodiscard]] constexpr const S& force_unit() const noexcept { return force_unit_; }

 private:
  static constexpr bool is_on_a_spring =
      detail::is_on_a_spring<std::tuple<Body...>, std::tuple<Interaction...>>;

  template <class One>
  [[nodiscard]] static constexpr auto push_of(const System& system, const One& interaction,
                                              const Weights& weights) noexcept {
    if constexpr (is_on_a_spring) {
      return interaction.push_alone(weights);
    } else {
      return detail::push_of(system, interaction, weights);
    }
  }

  template <class Components>
  [[nodiscard]] static constexpr std::array<S, rotations> turning(const Components& x) noexcept {
    return detail::first<rotations>(x.components());
  }

  template <std::size_t... i>
  constexpr WorldForm(const System& system, const S& unit, std::index_sequence<i...>) noexcept
      : per_momentum_{turning(system.template body<i>().rates_in(unit))...},
        factors_{system.template body<i>().template slope_factors<System::has_forque>()...},
        rate_weights_{
            turning(system.template body<i>().template rate_weights<System::has_forque>())...},
        system_(system),
        pushes_(std::apply(
            [&](const auto&... interaction) {
              return std::tuple{
                  push_of(system, interaction,
                          Weights{system.template body<i>().forque_weight(unit)...})...};
            },
            system.interactions_)) {
    if constexpr (is_on_a_spring) {
      force_unit_ = std::get<0>(system.interactions_)
                        .force_unit(Weights{system.template body<i>().forque_weight(unit)...});
    }
  }

  [[nodiscard]] static constexpr std::array<S, Space::dimension> force_of(
      const detail::Nothing&, std::size_t /*body*/) noexcept {
    return {};
  }
  [[nodiscard]] static constexpr const std::array<S, Space::dimension>& force_of(
      const Vectors& forces, std::size_t body) noexcept {
    return forces[body];
  }

  template <class Start, class Forces, std::size_t... i, std::size_t... j>
  [[nodiscard]] HAMOTOR_INLINE constexpr Pushes slopes(const Start& start, const Forces& forces,
                                                       const Attitudes& attitudes,
                                                       const Vectors& positions,
                                                       const Turnings& rates,
                                                       std::index_sequence<i...>,
                                                       std::index_sequence<j...>) const noexcept {
    Pushes result{detail::Push<G, S>{
        detail::others_product(start(i), std::get<i>(factors_), rates[i]), force_of(forces, i)}...};
    if constexpr (System::has_forque) {
      const std::array<detail::Pose<G, S>, n> poses{
          detail::Pose<G, S>{attitudes[i], positions[i], Space::half_turn(attitudes[i])}...};
      (std::get<j>(pushes_).add(poses, result), ...);
      if constexpr (is_on_a_spring && !std::is_same_v<Forces, detail::Nothing>) {
        result[0].force = detail::sum_with(result[0].force, detail::One{}, forces[0]);
      }
    }
    return result;
  }

  template <std::size_t... i>
  [[nodiscard]] constexpr Turnings momentum_weights(const S& x,
                                                    std::index_sequence<i...>) const noexcept {
    return {
        turning(system_.template body<i>().template momentum_weights<System::has_forque>(x))...};
  }

  Turnings per_momentum_;
  std::tuple<decltype(std::declval<Body>().template slope_factors<System::has_forque>())...>
      factors_;
  Turnings rate_weights_;
  const System& system_;
  S force_unit_{1};
  std::tuple<decltype(push_of(std::declval<const System&>(), std::declval<const Interaction&>(),
                              std::declval<Weights>()))...>
      pushes_;
};

template <class... Body>
RigidBodies(std::tuple<Body...>) -> RigidBodies<std::tuple<Body...>, std::tuple<>>;
template <class... Body, class... Interaction>
RigidBodies(std::tuple<Body...>, std::tuple<Interaction...>)
    -> RigidBodies<std::tuple<Body...>, std::tuple<Interaction...>>;

}  // namespace hamotor
