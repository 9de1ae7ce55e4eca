// Eigen, as one writes rigid motions with it: a quaternion and a translation, an Isometry3, a 4×4
// matrix.
#include <Eigen/Geometry>
#include <unsupported/Eigen/MatrixFunctions>

#include "generated.hpp"

template <>
struct Eigen::NumTraits<bench::Quad> : Eigen::GenericNumTraits<bench::Quad> {
  enum { IsComplex = 0, IsInteger = 0, IsSigned = 1, RequireInitialization = 0 };
};

namespace bench {

namespace {

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

[[nodiscard]] Eigen::Quaternion<Quad> exact_rotation(const pga3::Motor<Quad>& m) {
  return {m.s, -m.e23, -m.e31, -m.e12};
}

}  // namespace

/// x ↦ q x q* + t.
template <class S>
struct QuaternionTranslation : Vectors<S> {
  static constexpr const char* name = "Eigen quaternion + translation";
  using Vectors<S>::make;
  using Vectors<S>::exact;
  struct Motion {
    Eigen::Quaternion<S> rotation;
    Vector3<S> translation;
  };
  struct Moving {
    Motion motion;
    Pair<S> momentum;
  };

  [[nodiscard]] static Motion make(kind::Motion, const pga3::Motor<Quad>& m) {
    const auto q = exact_rotation(m);
    return {Eigen::Quaternion<S>(static_cast<S>(q.w()), static_cast<S>(q.x()),
                                 static_cast<S>(q.y()), static_cast<S>(q.z())),
            three<S>(sandwich(m, pga3::Origin<Quad>{}).components())};
  }
  [[nodiscard]] static Moving make(kind::Body, const Body<Quad>& x) {
    return {make(kind::Motion{}, x.motion), make(kind::Momentum{}, x.momentum)};
  }
  [[nodiscard]] static Values exact(kind::Motion, const Motion& x) {
    const Eigen::Quaternion<Quad> q(Quad(x.rotation.w()), Quad(x.rotation.x()),
                                    Quad(x.rotation.y()), Quad(x.rotation.z()));
    Matrix3<Quad> images;
    for (int k = 0; k < 3; ++k) images.col(k) = q * Vector3<Quad>::Unit(k).eval();
    return Vectors<S>::images(images, x.translation);
  }
  [[nodiscard]] static Values exact(kind::Body, const Moving& x) {
    Values all = exact(kind::Motion{}, x.motion);
    for (const Quad y : exact(kind::Momentum{}, x.momentum)) all.push_back(y);
    return all;
  }

  [[nodiscard]] HAMOTOR_INLINE static Motion compose(const Motion& a, const Motion& b) {
    return {a.rotation * b.rotation, a.rotation * b.translation + a.translation};
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector3<S> move(kind::Point, const Motion& m,
                                                      const Vector3<S>& x) {
    return m.rotation * x + m.translation;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector3<S> move(kind::Direction, const Motion& m,
                                                      const Vector3<S>& x) {
    return m.rotation * x;
  }
  [[nodiscard]] HAMOTOR_INLINE static PlaneOf<S> move(kind::Plane, const Motion& m,
                                                      const PlaneOf<S>& x) {
    const Vector3<S> normal = m.rotation * x.normal;
    return {normal, x.distance - normal.dot(m.translation)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Pair<S> move(kind::Line, const Motion& m, const Pair<S>& x) {
    const Vector3<S> direction = m.rotation * x.first;
    return {direction, m.rotation * x.second + m.translation.cross(direction)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Pair<S> commutator(const Pair<S>& a, const Pair<S>& b) {
    return {b.first.cross(a.first), b.second.cross(a.first) + b.first.cross(a.second)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Pair<S> coadjoint(const Pair<S>& w, const Pair<S>& mu) {
    return {mu.first.cross(w.first) + mu.second.cross(w.second), mu.second.cross(w.first)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Motion exp(const Pair<S>& w) {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const S square = w.first.squaredNorm();
    const S angle = sqrt(square);
    if (square < S(1e-12)) {
      const Vector3<S> half = S(0.5) * w.first;
      return {Eigen::Quaternion<S>(S(1), half[0], half[1], half[2]),
              w.second + half.cross(w.second)};
    }
    const S half_sine = sin(S(0.5) * angle);
    const S half_cosine = cos(S(0.5) * angle);
    const S sine = S(2) * half_sine * half_cosine;
    const Vector3<S> v = (half_sine / angle) * w.first;
    const Vector3<S> turned = w.first.cross(w.second);
    return {Eigen::Quaternion<S>(half_cosine, v[0], v[1], v[2]),
            w.second + (S(2) * half_sine * half_sine / square) * turned +
                ((angle - sine) / (square * angle)) * w.first.cross(turned)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Pair<S> log(const Motion& m) {
    using std::atan2;
    const S sine = m.rotation.vec().norm();
    const S half = atan2(sine, m.rotation.w());
    if (sine < S(1e-6)) {
      const Vector3<S> w = S(2) * m.rotation.vec();
      return {w, m.translation - S(0.5) * w.cross(m.translation)};
    }
    const Vector3<S> axis = m.rotation.vec() / sine;
    const Vector3<S> w = (S(2) * half) * axis;
    const Vector3<S> turned = axis.cross(m.translation);
    return {w, m.translation - half * turned +
                   (S(1) - half * m.rotation.w() / sine) * axis.cross(turned)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Motion normalize(const Motion& m) {
    return {m.rotation.normalized(), m.translation};
  }
  [[nodiscard]] HAMOTOR_INLINE static Moving slope(const Moving& x) {
    const Vector3<S> inverse(S(1 / moments[0]), S(1 / moments[1]), S(1 / moments[2]));
    const Pair<S> w{inverse.cwiseProduct(x.momentum.first), S(1 / mass) * x.momentum.second};
    const Eigen::Quaternion<S> pure(S(0), w.first[0], w.first[1], w.first[2]);
    Eigen::Quaternion<S> turning = x.motion.rotation * pure;
    turning.coeffs() *= S(0.5);
    return {{turning, x.motion.rotation * w.second}, coadjoint(w, x.momentum)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Moving add(const Moving& x, const S& h, const Moving& k) {
    return {{Eigen::Quaternion<S>(
                 Vector4<S>(x.motion.rotation.coeffs() + h * k.motion.rotation.coeffs())),
             x.motion.translation + h * k.motion.translation},
            {x.momentum.first + h * k.momentum.first, x.momentum.second + h * k.momentum.second}};
  }
  [[nodiscard]] HAMOTOR_INLINE static Moving runge_kutta(const Moving& body) {
    return classical_runge_kutta<QuaternionTranslation, S>(body);
  }
};

template <class S>
struct Isometry : Vectors<S> {
  static constexpr const char* name = "Eigen Isometry3";
  using Vectors<S>::make;
  using Vectors<S>::exact;
  using Motion = Eigen::Transform<S, 3, Eigen::Isometry>;

  [[nodiscard]] static Motion make(kind::Motion, const pga3::Motor<Quad>& m) {
    Motion motion = Motion::Identity();
    const Matrix3<Quad> rotation = exact_rotation(m).toRotationMatrix();
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) motion.linear()(i, k) = static_cast<S>(rotation(i, k));
    }
    motion.translation() = three<S>(sandwich(m, pga3::Origin<Quad>{}).components());
    return motion;
  }
  [[nodiscard]] static Values exact(kind::Motion, const Motion& m) {
    return Vectors<S>::images(m.linear(), m.translation());
  }

  [[nodiscard]] HAMOTOR_INLINE static Motion compose(const Motion& a, const Motion& b) {
    return a * b;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector3<S> move(kind::Point, const Motion& m,
                                                      const Vector3<S>& x) {
    return m * x;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector3<S> move(kind::Direction, const Motion& m,
                                                      const Vector3<S>& x) {
    return m.linear() * x;
  }
  [[nodiscard]] HAMOTOR_INLINE static PlaneOf<S> move(kind::Plane, const Motion& m,
                                                      const PlaneOf<S>& x) {
    const Vector3<S> normal = m.linear() * x.normal;
    return {normal, x.distance - normal.dot(m.translation())};
  }
  [[nodiscard]] HAMOTOR_INLINE static Pair<S> move(kind::Line, const Motion& m, const Pair<S>& x) {
    const Vector3<S> direction = m.linear() * x.first;
    return {direction, m.linear() * x.second + m.translation().cross(direction)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Motion exp(const Pair<S>& w) {
    using std::cos;
    using std::sin;
    const S angle = w.first.norm();
    Motion motion;
    if (angle < S(1e-6)) {
      motion = Eigen::Translation<S, 3>(w.second);
      return motion;
    }
    const Vector3<S> axis = w.first / angle;
    const Vector3<S> turned = axis.cross(w.second);
    motion.linear() = Eigen::AngleAxis<S>(angle, axis).toRotationMatrix();
    motion.translation() = w.second + ((S(1) - cos(angle)) / angle) * turned +
                           (S(1) - sin(angle) / angle) * axis.cross(turned);
    motion.makeAffine();
    return motion;
  }
  [[nodiscard]] HAMOTOR_INLINE static Pair<S> log(const Motion& m) {
    using std::tan;
    const Eigen::AngleAxis<S> turn(m.linear());
    const S angle = turn.angle();
    if (angle < S(1e-6)) return {angle * turn.axis(), m.translation()};
    const Vector3<S> turned = turn.axis().cross(m.translation());
    return {angle * turn.axis(),
            m.translation() - S(0.5) * angle * turned +
                (S(1) - S(0.5) * angle / tangent(S(0.5) * angle)) * turn.axis().cross(turned)};
  }

 private:
  [[nodiscard]] static S tangent(const S& x) {
    using std::cos;
    using std::sin;
    using std::tan;
    if constexpr (std::is_same_v<S, Quad>) {
      return sin(x) / cos(x);
    } else {
      return tan(x);
    }
  }
};

/// Homogeneous matrices: points and directions are four numbers, rates are matrices too.
template <class S>
struct Homogeneous {
  static constexpr const char* name = "Eigen 4x4 matrix";
  using Motion = Matrix4<S>;

  [[nodiscard]] static Motion make(kind::Motion, const pga3::Motor<Quad>& m) {
    return Isometry<S>::make(kind::Motion{}, m).matrix();
  }
  [[nodiscard]] static Vector4<S> make(kind::Point, const pga3::Point<Quad>& x) {
    return {static_cast<S>(x.e032), static_cast<S>(x.e013), static_cast<S>(x.e021), S(1)};
  }
  [[nodiscard]] static Vector4<S> make(kind::Direction, const pga3::Direction<Quad>& x) {
    return {static_cast<S>(x.e032), static_cast<S>(x.e013), static_cast<S>(x.e021), S(0)};
  }
  [[nodiscard]] static Matrix4<S> twist(const Vector3<S>& w, const Vector3<S>& v) {
    Matrix4<S> m;
    m << S(0), -w[2], w[1], v[0], w[2], S(0), -w[0], v[1], -w[1], w[0], S(0), v[2], S(0), S(0),
        S(0), S(0);
    return m;
  }
  [[nodiscard]] static Matrix4<S> make(kind::Rate, const pga3::se3::Rate<Quad>& x) {
    return twist(three<S>(x.components()), three<S>(x.components(), 3));
  }
  /// Half the bracket of bivectors is the commutator of these, with generators −½ e23, …: a sign.
  [[nodiscard]] static Matrix4<S> make(kind::Bivector, const pga3::Bivector<Quad>& x) {
    return -twist(three<S>(x.components()), three<S>(x.components(), 3));
  }
  [[nodiscard]] static Values exact(kind::Motion, const Motion& m) {
    return Vectors<S>::images(m, m.template topRightCorner<3, 1>());
  }
  [[nodiscard]] static Values exact(kind::Bivector, const Matrix4<S>& m) {
    return {Quad(-m(2, 1)), Quad(-m(0, 2)), Quad(-m(1, 0)),
            Quad(-m(0, 3)), Quad(-m(1, 3)), Quad(-m(2, 3))};
  }
  template <class Kind>
  [[nodiscard]] static Values exact(Kind, const Vector4<S>& x) {
    return {Quad(x[0]), Quad(x[1]), Quad(x[2])};
  }

  [[nodiscard]] HAMOTOR_INLINE static Motion compose(const Motion& a, const Motion& b) {
    return a * b;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector4<S> move(kind::Point, const Motion& m,
                                                      const Vector4<S>& x) {
    return m * x;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector4<S> move(kind::Direction, const Motion& m,
                                                      const Vector4<S>& x) {
    return m * x;
  }
  [[nodiscard]] HAMOTOR_INLINE static Matrix4<S> commutator(const Matrix4<S>& a,
                                                            const Matrix4<S>& b) {
    return a * b - b * a;
  }
  [[nodiscard]] HAMOTOR_INLINE static Motion exp(const Matrix4<S>& w) {
    if constexpr (std::is_same_v<S, Quad>) {
      const Vector3<S> v(w(0, 3), w(1, 3), w(2, 3));
      return Isometry<S>::exp({Vector3<S>(w(2, 1), w(0, 2), w(1, 0)), v}).matrix();
    } else {
      return w.exp();
    }
  }
};

void enter_eigen() {
  enter<QuaternionTranslation>();
  enter<Isometry>();
  enter<Homogeneous>();
}

}  // namespace bench
