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

/// M M~ − 1: the scalar's part and the pseudoscalar's.
///
/// `unit_defect` takes sums in twice the working precision.  The rounding of |M|² is not
/// independent of the digits that a compensated sum keeps beside M; a projection by it alone turns
/// spatial momenta a little the same way in every step, by 1e-14 in a million.
template <class S>
struct UnitDefect {
  S scalar;
  S pseudoscalar;
};

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

  /// M T − M for the translation T by d, in the body frame.
  template <class S>
  [[nodiscard]] static constexpr pga3::Motor<S> translation_change(
      const pga3::Motor<S>& m, const std::array<S, 3>& d) noexcept {
    const std::array<S, 3> half{S(0.5) * d[0], S(0.5) * d[1], S(0.5) * d[2]};
    return {S(0),
            S(0),
            S(0),
            S(0),
            mul_add(-m.e12, half[1], mul_add(m.e31, half[2], -m.s * half[0])),
            mul_add(m.e12, half[0], mul_add(-m.e23, half[2], -m.s * half[1])),
            mul_add(-m.e31, half[0], mul_add(m.e23, half[1], -m.s * half[2])),
            mul_add(-m.e12, half[2], mul_add(-m.e31, half[1], -m.e23 * half[0]))};
  }

  /// M q − M.
  template <class S>
  [[nodiscard]] static constexpr pga3::Motor<S> rotation_change(
      const pga3::Motor<S>& m, const RotorIncrement<S, 3>& q) noexcept {
    return gp(m, pga3::Rotor<S>{q.cosine_less_one, -q.sines[0], -q.sines[1], -q.sines[2]});
  }

  template <class S>
  [[nodiscard]] static constexpr UnitDefect<S> unit_defect(const pga3::Motor<S>& m) noexcept {
    return {
        scalar::compensated_dot(S(-1), S(1), m.s, m.s, m.e23, m.e23, m.e31, m.e31, m.e12, m.e12),
        S(2) * scalar::compensated_dot(m.e0123, m.s, -m.e01, m.e23, -m.e02, m.e31, -m.e03, m.e12)};
  }

  /// Of M + low, to first order in low.
  template <class S>
  [[nodiscard]] static constexpr UnitDefect<S> unit_defect(const pga3::Motor<S>& m,
                                                           const pga3::Motor<S>& low) noexcept {
    const auto defect = unit_defect(m);
    return {mul_add(S(2), dot(m.s, low.s, m.e23, low.e23, m.e31, low.e31, m.e12, low.e12),
                    defect.scalar),
            mul_add(S(2),
                    dot(m.e0123, low.s, low.e0123, m.s, -m.e01, low.e23, -low.e01, m.e23, -m.e02,
                        low.e31, -low.e02, m.e31, -m.e03, low.e12, -low.e03, m.e12),
                    defect.pseudoscalar)};
  }

  /// −½ (M M~ − 1) M: what brings M back to the group, but for the square of the defect.
  template <class S>
  [[nodiscard]] static constexpr pga3::Motor<S> unit_correction(
      const pga3::Motor<S>& m, const UnitDefect<S>& defect) noexcept {
    const S a = S(-0.5) * defect.scalar;
    const S b = S(-0.5) * defect.pseudoscalar;
    return {a * m.s,
            a * m.e23,
            a * m.e31,
            a * m.e12,
            mul_add(-b, m.e23, a * m.e01),
            mul_add(-b, m.e31, a * m.e02),
            mul_add(-b, m.e12, a * m.e03),
            mul_add(b, m.s, a * m.e0123)};
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

  /// M q − M.
  template <class S>
  [[nodiscard]] static constexpr pga3::Rotor<S> rotation_change(
      const pga3::Rotor<S>& m, const RotorIncrement<S, 3>& q) noexcept {
    return gp(m, pga3::Rotor<S>{q.cosine_less_one, -q.sines[0], -q.sines[1], -q.sines[2]});
  }

  template <class S>
  [[nodiscard]] static constexpr UnitDefect<S> unit_defect(const pga3::Rotor<S>& m) noexcept {
    return {
        scalar::compensated_dot(S(-1), S(1), m.s, m.s, m.e23, m.e23, m.e31, m.e31, m.e12, m.e12),
        S(0)};
  }

  /// Of M + low, to first order in low.
  template <class S>
  [[nodiscard]] static constexpr UnitDefect<S> unit_defect(const pga3::Rotor<S>& m,
                                                           const pga3::Rotor<S>& low) noexcept {
    return {mul_add(S(2), dot(m.s, low.s, m.e23, low.e23, m.e31, low.e31, m.e12, low.e12),
                    unit_defect(m).scalar),
            S(0)};
  }

  /// −½ (M M~ − 1) M.
  template <class S>
  [[nodiscard]] static constexpr pga3::Rotor<S> unit_correction(
      const pga3::Rotor<S>& m, const UnitDefect<S>& defect) noexcept {
    return (S(-0.5) * defect.scalar) * m;
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

  /// M T − M for the translation T by d, in the body frame.
  template <class S>
  [[nodiscard]] static constexpr pga2::Motor<S> translation_change(
      const pga2::Motor<S>& m, const std::array<S, 2>& d) noexcept {
    const std::array<S, 2> half{S(0.5) * d[0], S(0.5) * d[1]};
    return {S(0), S(0), mul_add(-m.e12, half[1], -m.s * half[0]),
            mul_add(m.e12, half[0], -m.s * half[1])};
  }

  /// M q − M.
  template <class S>
  [[nodiscard]] static constexpr pga2::Motor<S> rotation_change(
      const pga2::Motor<S>& m, const RotorIncrement<S, 1>& q) noexcept {
    return gp(m, pga2::Motor<S>{q.cosine_less_one, -q.sines[0], S(0), S(0)});
  }

  template <class S>
  [[nodiscard]] static constexpr UnitDefect<S> unit_defect(const pga2::Motor<S>& m) noexcept {
    return {scalar::compensated_dot(S(-1), S(1), m.s, m.s, m.e12, m.e12), S(0)};
  }

  /// Of M + low, to first order in low.
  template <class S>
  [[nodiscard]] static constexpr UnitDefect<S> unit_defect(const pga2::Motor<S>& m,
                                                           const pga2::Motor<S>& low) noexcept {
    return {mul_add(S(2), dot(m.s, low.s, m.e12, low.e12), unit_defect(m).scalar), S(0)};
  }

  /// −½ (M M~ − 1) M.
  template <class S>
  [[nodiscard]] static constexpr pga2::Motor<S> unit_correction(
      const pga2::Motor<S>& m, const UnitDefect<S>& defect) noexcept {
    return (S(-0.5) * defect.scalar) * m;
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
