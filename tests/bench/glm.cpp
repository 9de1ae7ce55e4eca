// GLM's dual quaternions: a peer that Debian has (libglm-dev).
#define GLM_ENABLE_EXPERIMENTAL
#include <glm/gtx/dual_quaternion.hpp>

#include "contest.hpp"

namespace bench {

template <class S>
struct Glm {
  static constexpr const char* name = "GLM dual quaternion";
  using Motion = glm::tdualquat<S, glm::defaultp>;
  using Vector = glm::vec<3, S, glm::defaultp>;
  using Quaternion = glm::qua<S, glm::defaultp>;

  [[nodiscard]] static Motion make(kind::Motion, const pga3::Motor<Quad>& m) {
    const auto number = [](Quad x) { return static_cast<S>(x); };
    return Motion(Quaternion(number(m.s), number(-m.e23), number(-m.e31), number(-m.e12)),
                  Quaternion(number(-m.e0123), number(-m.e01), number(-m.e02), number(-m.e03)));
  }
  [[nodiscard]] static Vector make(kind::Point, const pga3::Point<Quad>& x) {
    return Vector(static_cast<S>(x.e032), static_cast<S>(x.e013), static_cast<S>(x.e021));
  }
  [[nodiscard]] static pga3::Motor<Quad> exact(kind::Motion, const Motion& m) {
    return {Quad(m.real.w),  Quad(-m.real.x), Quad(-m.real.y), Quad(-m.real.z),
            Quad(-m.dual.x), Quad(-m.dual.y), Quad(-m.dual.z), Quad(-m.dual.w)};
  }
  [[nodiscard]] static pga3::Point<Quad> exact(kind::Point, const Vector& x) {
    return {Quad(x.x), Quad(x.y), Quad(x.z)};
  }

  [[nodiscard]] HAMOTOR_INLINE static Motion compose(const Motion& a, const Motion& b) {
    return a * b;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector move(kind::Point, const Motion& m, const Vector& x) {
    return m * x;
  }
};

void enter_glm() { enter<Glm>(); }

}  // namespace bench
