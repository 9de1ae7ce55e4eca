// Eigen, as one writes rigid motions with it: a quaternion and a translation.
#include "eigen.hpp"

namespace bench {

template <class S>
struct QuaternionTranslation : Vectors<S> {
  static constexpr const char* name = "Eigen quaternion + translation";
  using Vectors<S>::make;
  using Vectors<S>::exact;
  using Motion = RotationAndTranslation<S>;
  struct Moving {
    Motion motion;
    Pair<S> momentum;
  };

  [[nodiscard]] static Motion make(kind::Motion, const pga3::Motor<Quad>& m) {
    return Motion::of(m);
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

void enter_eigen_quaternion() { enter<QuaternionTranslation>(); }

}  // namespace bench
