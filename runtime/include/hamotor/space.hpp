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
