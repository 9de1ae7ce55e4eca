// Eigen, as one writes rigid motions with it: an Isometry3, a 4×4 matrix.
#include <unsupported/Eigen/MatrixFunctions>

#include "eigen.hpp"

namespace bench {

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
  template <class Kind>
  [[nodiscard]] static Motion make(kind::MatrixOn<Kind>, const pga3::Motor<Quad>& m) {
    return make(kind::Motion{}, m);
  }
  [[nodiscard]] static Values exact(kind::Motion, const Motion& m) {
    return Vectors<S>::images(m.linear(), m.translation());
  }

  [[nodiscard]] HAMOTOR_INLINE static Motion compose(const Motion& a, const Motion& b) {
    return a * b;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector3<S> transform(kind::Point, const Motion& m,
                                                           const Vector3<S>& x) {
    return m * x;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector3<S> transform(kind::Direction, const Motion& m,
                                                           const Vector3<S>& x) {
    return m.linear() * x;
  }
  [[nodiscard]] HAMOTOR_INLINE static PlaneOf<S> transform(kind::Plane, const Motion& m,
                                                           const PlaneOf<S>& x) {
    const Vector3<S> normal = m.linear() * x.normal;
    return {normal, x.distance - normal.dot(m.translation())};
  }
  [[nodiscard]] HAMOTOR_INLINE static Pair<S> transform(kind::Line, const Motion& m,
                                                        const Pair<S>& x) {
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

/// The matrix of a quaternion and a translation, made anew by each operation: motions are held in
/// as few numbers as motors, and change as often.
template <class S>
struct ConvertedIsometry : Vectors<S> {
  static constexpr const char* name = "Eigen Isometry3, converted";
  using Vectors<S>::make;
  using Vectors<S>::exact;
  using Motion = RotationAndTranslation<S>;

  [[nodiscard]] static Motion make(kind::Motion, const pga3::Motor<Quad>& m) {
    return Motion::of(m);
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static auto move(Kind kind, const Motion& m, const auto& x) {
    typename Isometry<S>::Motion matrix;
    matrix.linear() = m.rotation.toRotationMatrix();
    matrix.translation() = m.translation;
    matrix.makeAffine();
    return Isometry<S>::transform(kind, matrix, x);
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
  template <class Kind>
  [[nodiscard]] static Motion make(kind::MatrixOn<Kind>, const pga3::Motor<Quad>& m) {
    return make(kind::Motion{}, m);
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
  [[nodiscard]] HAMOTOR_INLINE static Vector4<S> transform(kind::Point, const Motion& m,
                                                           const Vector4<S>& x) {
    return m * x;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector4<S> transform(kind::Direction, const Motion& m,
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

void enter_eigen_matrix() {
  enter<Isometry>();
  enter<ConvertedIsometry>();
  enter<Homogeneous>();
}

}  // namespace bench
