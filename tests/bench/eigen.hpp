// How Eigen's contestants hold what is not a motion.
#pragma once

#include <Eigen/Geometry>

#include "contest.hpp"

template <>
struct Eigen::NumTraits<bench::Quad> : Eigen::GenericNumTraits<bench::Quad> {
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 0 };
};

namespace bench {

template <class S>
using Vector3 = Eigen::Matrix<S, 3, 1>;
template <class S>
using Vector4 = Eigen::Matrix<S, 4, 1>;
template <class S>
using Matrix3 = Eigen::Matrix<S, 3, 3>;
template <class S>
using Matrix4 = Eigen::Matrix<S, 4, 4>;

/// Two vectors: of a line, a bivector, a rate or a momentum.
template <class S>
struct Pair {
  Vector3<S> first;
  Vector3<S> second;
};

/// Plane n·x + d = 0.
template <class S>
struct PlaneOf {
  Vector3<S> normal;
  S distance;
};

template <class S, std::size_t N>
[[nodiscard]] Vector3<S> three(const std::array<Quad, N>& x, std::size_t from = 0) {
  return {static_cast<S>(x[from]), static_cast<S>(x[from + 1]), static_cast<S>(x[from + 2])};
}

/// How all of Eigen's contestants hold what is not a motion.
template <class S>
struct Vectors {
  [[nodiscard]] static Vector3<S> make(kind::Point, const pga3::Point<Quad>& x) {
    return three<S>(x.components());
  }
  [[nodiscard]] static Vector3<S> make(kind::Direction, const pga3::Direction<Quad>& x) {
    return three<S>(x.components());
  }
  [[nodiscard]] static PlaneOf<S> make(kind::Plane, const pga3::Plane<Quad>& x) {
    return {three<S>(x.components(), 1), static_cast<S>(x.e0)};
  }
  [[nodiscard]] static Pair<S> make(kind::Line, const pga3::Bivector<Quad>& x) {
    return {three<S>(x.components()), three<S>(x.components(), 3)};
  }
  [[nodiscard]] static Pair<S> make(kind::Bivector, const pga3::Bivector<Quad>& x) {
    return {three<S>(x.components()), three<S>(x.components(), 3)};
  }
  [[nodiscard]] static Pair<S> make(kind::Rate, const pga3::se3::Rate<Quad>& x) {
    return {three<S>(x.components()), three<S>(x.components(), 3)};
  }
  [[nodiscard]] static Pair<S> make(kind::Momentum, const pga3::se3::Momentum<Quad>& x) {
    return {three<S>(x.components()), three<S>(x.components(), 3)};
  }
  template <class Kind>
  [[nodiscard]] static Values exact(Kind, const Vector3<S>& x) {
    return {Quad(x[0]), Quad(x[1]), Quad(x[2])};
  }
  template <class Kind>
  [[nodiscard]] static Values exact(Kind, const Pair<S>& x) {
    return {Quad(x.first[0]),  Quad(x.first[1]),  Quad(x.first[2]),
            Quad(x.second[0]), Quad(x.second[1]), Quad(x.second[2])};
  }
  [[nodiscard]] static Values exact(kind::Plane, const PlaneOf<S>& x) {
    return {Quad(x.distance), Quad(x.normal[0]), Quad(x.normal[1]), Quad(x.normal[2])};
  }
  template <class Linear>
  [[nodiscard]] static Values images(const Linear& rotation, const Vector3<S>& translation) {
    Values all = exact(kind::Point{}, translation);
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < 3; ++i) all.push_back(Quad(rotation(i, k)));
    }
    return all;
  }
};

[[nodiscard]] inline Eigen::Quaternion<Quad> exact_rotation(const pga3::Motor<Quad>& m) {
  return {m.s, -m.e23, -m.e31, -m.e12};
}

/// x ↦ q x q* + t.
template <class S>
struct RotationAndTranslation {
  Eigen::Quaternion<S> rotation;
  Vector3<S> translation;

  [[nodiscard]] static RotationAndTranslation of(const pga3::Motor<Quad>& m) {
    const auto q = exact_rotation(m);
    return {Eigen::Quaternion<S>(static_cast<S>(q.w()), static_cast<S>(q.x()),
                                 static_cast<S>(q.y()), static_cast<S>(q.z())),
            three<S>(sandwich(m, pga3::Origin<Quad>{}).components())};
  }
};

}  // namespace bench
