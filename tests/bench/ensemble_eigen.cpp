// The same bodies as one writes them with Eigen.  Eight of them are stepped in turn, so that one's
// operations need not wait for its own.
#include <Eigen/Geometry>
#include <vector>

#include "ensemble.hpp"

namespace bench {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::Vector4d;

const Vector3d inverse(1 / moments[0], 1 / moments[1], 1 / moments[2]);

struct Free {
  Vector4d rotation;
  Vector3d angular;
};

struct Sprung {
  Vector4d rotation;
  Vector3d angular;
  Vector3d position;
  Vector3d linear;
};

[[nodiscard]] inline Vector4d turning(const Vector4d& q, const Vector3d& rate) {
  const Quaterniond product = Quaterniond(q) * Quaterniond(0, rate[0], rate[1], rate[2]);
  return 0.5 * product.coeffs();
}

[[nodiscard]] inline Free slope(const Free& x) {
  const Vector3d rate = inverse.cwiseProduct(x.angular);
  return {turning(x.rotation, rate), x.angular.cross(rate)};
}

/// Momenta in the body frame, position in the world.
[[nodiscard]] inline Sprung slope(const Sprung& x) {
  const Vector3d at(spring_at[0], spring_at[1], spring_at[2]);
  const Vector3d rate = inverse.cwiseProduct(x.angular);
  const Quaterniond q(x.rotation);
  const Vector3d force = -stiffness * (q.conjugate() * x.position + at);
  return {turning(x.rotation, rate), x.angular.cross(rate) + at.cross(force),
          q * ((1 / mass) * x.linear), x.linear.cross(rate) + force};
}

[[nodiscard]] inline Free moved(const Free& x, double h, const Free& k) {
  return {x.rotation + h * k.rotation, x.angular + h * k.angular};
}
[[nodiscard]] inline Sprung moved(const Sprung& x, double h, const Sprung& k) {
  return {x.rotation + h * k.rotation, x.angular + h * k.angular, x.position + h * k.position,
          x.linear + h * k.linear};
}

template <class Body>
inline void runge_kutta(Body& x) {
  const Body one = slope(x);
  const Body two = slope(moved(x, step / 2, one));
  const Body three = slope(moved(x, step / 2, two));
  const Body four = slope(moved(x, step, three));
  x = moved(moved(moved(moved(x, step / 6, one), step / 3, two), step / 3, three), step / 6, four);
  x.rotation *= 1.5 - 0.5 * x.rotation.squaredNorm();
}

template <class Body>
[[nodiscard]] EigenResult measured(std::vector<Body>& bodies, int steps, int runs) {
  constexpr std::size_t in_turn = 8;
  const double taken = shortest(runs, [&] {
    for (std::size_t first = 0; first < bodies.size(); first += in_turn) {
      const std::size_t last = std::min(bodies.size(), first + in_turn);
      for (int k = 0; k < steps; ++k) {
        for (std::size_t b = first; b < last; ++b) runge_kutta(bodies[b]);
      }
    }
  });
  const Vector3d& angular = bodies[0].angular;
  return {static_cast<double>(bodies.size()) * steps / taken, {angular[0], angular[1], angular[2]}};
}

}  // namespace

EigenResult eigen_free(std::size_t bodies, int steps, int runs) {
  std::vector<Free> all(bodies);
  for (std::size_t k = 0; k < bodies; ++k) {
    const auto m = momentum_of(k);
    all[k] = {{0, 0, 0, 1}, {m[0], m[1], m[2]}};
  }
  return measured(all, steps, runs);
}

EigenResult eigen_spring(std::size_t bodies, int steps, int runs) {
  std::vector<Sprung> all(bodies);
  for (std::size_t k = 0; k < bodies; ++k) {
    const auto m = momentum_of(k);
    all[k] = {{0, 0, 0, 1}, {m[0], m[1], m[2]}, Vector3d::Zero(), {m[3], m[4], m[5]}};
  }
  return measured(all, steps, runs);
}

}  // namespace bench
