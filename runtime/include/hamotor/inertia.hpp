// The inertia of a rigid body, from shapes, tensors and point masses, and its principal frame.
//
// A rate B = (Ω, V), body frame, gives the body's point X the velocity X × B; a mass m there
// carries the momentum line m X ∨ (X × B).  The body's momentum is I(B) = Σ m X ∨ (X × B), a linear
// map with the symmetric matrix K: (Π, P) = K (Ω, V), twice the kinetic energy (Ω, V)·K (Ω, V) (De
// Keninck & Dorst 2011; Dorst & De Keninck 2023).
//
// This is set-up, not stepping: it allocates and throws, and is the only user of
// Eigen: what includes it links Eigen3::Eigen as well as hamotor::hamotor.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>

#include "hamotor/pga2/se2.hpp"
#include "hamotor/pga3/se3.hpp"
#include "hamotor/pga3/so3.hpp"
#include "hamotor/space.hpp"

namespace hamotor {

/// A mass (kg) at a place (m, body frame); D = 2 or 3.
template <std::size_t D>
struct PointMass {
  double mass;
  std::array<double, D> at;
};

/// The frame in which a body's kinetic energy is diagonal, and the body in it.
template <class G>
struct PrincipalFrame {
  double mass;                                      ///< kg
  std::array<double, Space<G>::rotations> moments;  ///< about the frame's origin, kg m²
  typename G::template Element<double> motor;       ///< N: X_body = N X_principal N~
  std::array<double, Space<G>::dimension>
      center_of_mass;  ///< in this frame, m; 0 where it is central
};

/// Inertia of a rigid body in a frame of its own, D = 2 or 3.
///
/// Every constructor throws std::invalid_argument for what no distribution of positive mass has: a
/// mass that is not positive, a tensor that is not symmetric, moments that are negative or violate
/// the triangle inequality, numbers that are not finite.
template <std::size_t D>
class Inertia {
  static_assert(D == 2 || D == 3);
  static constexpr int rotations = D == 3 ? 3 : 1;
  static constexpr int dimension = static_cast<int>(D) + rotations;

 public:
  /// The group of the body's motions.
  using Group = std::conditional_t<D == 3, pga3::SE3, pga2::SE2>;
  using Vector = Eigen::Matrix<double, static_cast<int>(D), 1>;
  using Tensor = Eigen::Matrix<double, rotations, rotations>;
  using KineticMatrix = Eigen::Matrix<double, dimension, dimension>;
  using Moments = std::array<double, static_cast<std::size_t>(rotations)>;
  using Motor = typename Group::template Element<double>;

  /// From principal moments (kg m²) about the centre of mass, along the frame's axes.
  [[nodiscard]] static Inertia of_moments(double mass, const Moments& moments,
                                          const Vector& center_of_mass = Vector::Zero()) {
    return of_tensor(mass,
                     Eigen::Map<const Eigen::Matrix<double, rotations, 1>>(moments.data())
                         .asDiagonal()
                         .toDenseMatrix(),
                     center_of_mass);
  }

  /// From a symmetric tensor (kg m²) about the centre of mass, (3, 3) or in the plane (1, 1).
  [[nodiscard]] static Inertia of_tensor(double mass, const Tensor& tensor,
                                         const Vector& center_of_mass = Vector::Zero()) {
    require_physical(mass, tensor, center_of_mass);
    return Inertia(mass, 0.5 * (tensor + tensor.transpose()), center_of_mass);
  }

  /// A uniform box with edges (m) along the axes; in the plane a rectangle.
  [[nodiscard]] static Inertia of_box(double mass, const std::array<double, D>& edges,
                                      const Vector& center_of_mass = Vector::Zero()) {
    return of_squares(mass, edges, 12, "edge", center_of_mass);
  }

  /// A uniform ellipsoid with semi-axes (m) along the axes.
  [[nodiscard]] static Inertia of_ellipsoid(double mass, const std::array<double, D>& semi_axes,
                                            const Vector& center_of_mass = Vector::Zero())
    requires(D == 3)
  {
    return of_squares(mass, semi_axes, 5, "semi-axis", center_of_mass);
  }

  /// A uniform cylinder of radius and height (m) about the third axis.
  [[nodiscard]] static Inertia of_cylinder(double mass, double radius, double height,
                                           const Vector& center_of_mass = Vector::Zero())
    requires(D == 3)
  {
    require_length(radius, "radius");
    require_length(height, "height");
    const double across = mass * (3 * radius * radius + height * height) / 12;
    return of_moments(mass, {across, across, mass * radius * radius / 2}, center_of_mass);
  }

  /// A uniform disk of radius (m) in the plane.
  [[nodiscard]] static Inertia of_disk(double mass, double radius,
                                       const Vector& center_of_mass = Vector::Zero())
    requires(D == 2)
  {
    require_length(radius, "radius");
    return of_moments(mass, {mass * radius * radius / 2}, center_of_mass);
  }

  /// From point masses: I(B) = Σ m X ∨ (X × B), summed about their centre of mass and moved there.
  [[nodiscard]] static Inertia of_points(std::span<const PointMass<D>> points) {
    if (points.empty()) throw std::invalid_argument("inertia: there are no point masses");
    double mass = 0;
    Vector first_moment = Vector::Zero();
    for (const auto& point : points) {
      require_mass(point.mass);
      const Vector at = Eigen::Map<const Vector>(point.at.data());
      require_finite(at, "the place of a point mass");
      mass += point.mass;
      first_moment += point.mass * at;
    }
    const Vector center = first_moment / mass;
    KineticMatrix about_center = KineticMatrix::Zero();
    for (const auto& point : points) {
      auto at = point.at;
      for (std::size_t k = 0; k < D; ++k) at[k] -= center[static_cast<int>(k)];
      about_center += of_point(point.mass, at);
    }
    const Tensor tensor = about_center.template topLeftCorner<rotations, rotations>();
    return Inertia(mass, 0.5 * (tensor + tensor.transpose()), center);
  }

  [[nodiscard]] double mass() const { return mass_; }
  [[nodiscard]] const Vector& center_of_mass() const { return center_; }

  /// About the centre of mass, kg m².
  [[nodiscard]] const Tensor& tensor() const { return tensor_; }

  /// About the frame's origin, kg m²: J + m (c² 1 − c cᵀ).
  [[nodiscard]] Tensor tensor_about_origin() const {
    if constexpr (D == 3) {
      return tensor_ +
             mass_ * (center_.squaredNorm() * Tensor::Identity() - center_ * center_.transpose());
    } else {
      return tensor_ + mass_ * Tensor::Constant(center_.squaredNorm());
    }
  }

  /// K: (Π, P) = K (Ω, V) about the frame's origin, rotations first; symmetric, (6, 6) or (3, 3).
  [[nodiscard]] KineticMatrix kinetic_matrix() const {
    KineticMatrix k = KineticMatrix::Zero();
    k.template topLeftCorner<rotations, rotations>() = tensor_about_origin();
    k.template bottomRightCorner<static_cast<int>(D), static_cast<int>(D)>().diagonal().setConstant(
        mass_);
    Eigen::Matrix<double, rotations, static_cast<int>(D)> coupling;
    if constexpr (D == 3) {
      coupling << 0, -center_[2], center_[1], center_[2], 0, -center_[0], -center_[1], center_[0],
          0;
    } else {
      coupling << -center_[1], center_[0];
    }
    k.template topRightCorner<rotations, static_cast<int>(D)>() = mass_ * coupling;
    k.template bottomLeftCorner<static_cast<int>(D), rotations>() = mass_ * coupling.transpose();
    return k;
  }

  /// The same body in the frame of X_new = N X N~.
  [[nodiscard]] Inertia moved(const Motor& n) const {
    std::array<double, D> center{};
    Eigen::Map<Vector>(center.data()) = center_;
    const auto moved_center =
        sandwich(n, Space<Group>::template Point<double>::from(center)).components();
    Tensor tensor = tensor_;
    if constexpr (D == 3) {
      const Eigen::Matrix3d turn = rotation_matrix(n);
      tensor = turn * tensor_ * turn.transpose();
      tensor = 0.5 * (tensor + tensor.transpose()).eval();
    }
    return Inertia(mass_, tensor, Eigen::Map<const Vector>(moved_center.data()));
  }

  /// The frame in which the kinetic energy is diagonal: for SE3 and SE2 the central principal axes,
  /// for SO3 the principal axes about the frame's origin, which is the fixed point.
  ///
  /// A diagonal tensor keeps its axes exactly; otherwise each principal axis takes the place and
  /// the direction of the axis it lies closest to.  Throws std::invalid_argument if there is no
  /// inertia about an axis: the momentum would not determine the rate.
  template <class G = Group>
  [[nodiscard]] PrincipalFrame<G> principal_frame() const {
    static_assert(Space<G>::dimension == D, "a group of motions of another space");
    if constexpr (D == 2) {
      require_inertia(tensor_(0, 0), tensor_(0, 0));
      return {mass_, {tensor_(0, 0)}, translation(center_), {}};
    } else if constexpr (Space<G>::translates) {
      const auto [moments, rotor] = principal_axes(tensor_);
      return {mass_, moments, gp(translation(center_), rotor), {}};
    } else {
      const auto [moments, rotor] = principal_axes(tensor_about_origin());
      std::array<double, D> center{};
      Eigen::Map<Vector>(center.data()) = center_;
      return {mass_, moments, rotor,
              sandwich(reverse(rotor), pga3::Point<double>::from(center)).components()};
    }
  }

 private:
  Inertia(double mass, const Tensor& tensor, const Vector& center)
      : mass_(mass), tensor_(tensor), center_(center) {}

  /// The matrix of B ↦ m X ∨ (X × B).
  [[nodiscard]] static KineticMatrix of_point(double mass, const std::array<double, D>& at) {
    const auto x = Space<Group>::template Point<double>::from(at);
    KineticMatrix k;
    for (int column = 0; column < dimension; ++column) {
      std::array<double, static_cast<std::size_t>(dimension)> rate{};
      rate[static_cast<std::size_t>(column)] = 1;
      const auto momentum = Space<Group>::wrench(regressive(x, commutator(x, bivector(rate))));
      const auto components = momentum.components();
      k.col(column) =
          mass * Eigen::Map<const Eigen::Matrix<double, dimension, 1>>(components.data());
    }
    return k;
  }

  [[nodiscard]] static auto bivector(
      const std::array<double, static_cast<std::size_t>(dimension)>& rate) {
    if constexpr (D == 3) {
      return pga3::Bivector<double>::from(rate);
    } else {
      return pga2::Bivector<double>::from(rate);
    }
  }

  [[nodiscard]] static Inertia of_squares(double mass, const std::array<double, D>& lengths,
                                          double divisor, const char* what,
                                          const Vector& center_of_mass) {
    double sum = 0;
    for (const double x : lengths) {
      require_length(x, what);
      sum += x * x;
    }
    Moments moments{};
    if constexpr (D == 3) {
      for (std::size_t k = 0; k < 3; ++k) {
        const double b = lengths[(k + 1) % 3];
        const double c = lengths[(k + 2) % 3];
        moments[k] = mass * (b * b + c * c) / divisor;
      }
    } else {
      moments[0] = mass * sum / divisor;
    }
    return of_moments(mass, moments, center_of_mass);
  }

  [[nodiscard]] static Motor translation(const Vector& by) {
    Motor result = Motor::identity();
    result.e01 = -0.5 * by[0];
    result.e02 = -0.5 * by[1];
    if constexpr (D == 3) result.e03 = -0.5 * by[2];
    return result;
  }

  [[nodiscard]] static Eigen::Matrix3d rotation_matrix(const pga3::Motor<double>& n) {
    return Eigen::Quaterniond(n.s, -n.e23, -n.e31, -n.e12).normalized().toRotationMatrix();
  }

  struct PrincipalAxes {
    std::array<double, 3> moments;
    pga3::Rotor<double> rotor;
  };

  [[nodiscard]] static PrincipalAxes principal_axes(const Eigen::Matrix3d& tensor) {
    const Eigen::Matrix3d diagonal = tensor.diagonal().asDiagonal();
    if (tensor == diagonal) {
      require_inertia(tensor.diagonal().minCoeff(), tensor.diagonal().maxCoeff());
      return {{tensor(0, 0), tensor(1, 1), tensor(2, 2)}, pga3::Rotor<double>::identity()};
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(tensor);
    require_inertia(solver.eigenvalues()[0], solver.eigenvalues()[2]);
    const Eigen::Matrix3d& vectors = solver.eigenvectors();
    std::array<int, 3> order{0, 1, 2};
    std::array<int, 3> best = order;
    double closest = -1;
    do {
      const double closeness = std::abs(vectors(0, order[0])) + std::abs(vectors(1, order[1])) +
                               std::abs(vectors(2, order[2]));
      if (closeness > closest) {
        closest = closeness;
        best = order;
      }
    } while (std::next_permutation(order.begin(), order.end()));
    Eigen::Matrix3d axes;
    std::array<double, 3> moments{};
    for (int k = 0; k < 3; ++k) {
      const int column = best[static_cast<std::size_t>(k)];
      axes.col(k) = (vectors(k, column) < 0 ? -1.0 : 1.0) * vectors.col(column);
      moments[static_cast<std::size_t>(k)] = solver.eigenvalues()[column];
    }
    if (axes.determinant() < 0) {
      int least = 0;
      axes.diagonal().cwiseAbs().minCoeff(&least);
      axes.col(least) *= -1;
    }
    const Eigen::Quaterniond q = Eigen::Quaterniond(axes).normalized();
    return {moments, {q.w(), -q.x(), -q.y(), -q.z()}};
  }

  template <class Matrix>
  static void require_finite(const Matrix& x, const char* what) {
    if (!x.allFinite()) {
      throw std::invalid_argument(std::string("inertia: ") + what + " is not finite");
    }
  }

  static void require_mass(double mass) {
    if (!(mass > 0 && std::isfinite(mass))) {
      throw std::invalid_argument("inertia: a mass must be positive and finite, not " + text(mass));
    }
  }

  static void require_length(double length, const char* what) {
    if (!(length >= 0 && std::isfinite(length))) {
      throw std::invalid_argument(std::string("inertia: ") + what +
                                  " must be finite and not negative, not " + text(length));
    }
  }

  static void require_physical(double mass, const Tensor& tensor, const Vector& center) {
    require_mass(mass);
    require_finite(center, "the centre of mass");
    require_finite(tensor, "the inertia tensor");
    const double size = tensor.cwiseAbs().maxCoeff();
    if ((tensor - tensor.transpose()).cwiseAbs().maxCoeff() > relative_asymmetry * size) {
      throw std::invalid_argument("inertia: the tensor is not symmetric");
    }
    const Eigen::SelfAdjointEigenSolver<Tensor> solver(tensor, Eigen::EigenvaluesOnly);
    const auto& moments = solver.eigenvalues();
    if (moments[0] < -relative_zero * size) {
      throw std::invalid_argument("inertia: the principal moment " + text(moments[0]) +
                                  " is negative");
    }
    if constexpr (D == 3) {
      if (moments[2] > (moments[0] + moments[1]) * (1 + relative_equality)) {
        throw std::invalid_argument("inertia: no body has the principal moments " +
                                    text(moments[0]) + ", " + text(moments[1]) + ", " +
                                    text(moments[2]) +
                                    ": the largest exceeds the sum of the other two");
      }
    }
  }

  static void require_inertia(double smallest, double largest) {
    if (!(smallest > relative_zero * largest)) {
      throw std::invalid_argument(
          "inertia: the body has no inertia about one axis, so that its momentum does not "
          "determine "
          "its rate of turning");
    }
  }

  [[nodiscard]] static std::string text(double x) {
    std::ostringstream stream;
    stream << x;
    return stream.str();
  }

  /// Of the largest entry: what decimals and rounding may leave of symmetry.
  static constexpr double relative_asymmetry = 1e-12;
  /// Of the largest moment: what rounding leaves of zero.
  static constexpr double relative_zero = 1e-13;
  /// How close two sides of the triangle inequality are equal: a flat body or a rod.
  static constexpr double relative_equality = 1e-9;

  double mass_;
  Tensor tensor_;
  Vector center_;
};

}  // namespace hamotor
