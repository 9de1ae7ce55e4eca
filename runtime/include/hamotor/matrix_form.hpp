// The classical matrix form of rigid bodies: R, x, Π, P in place of motor and momentum.
//
//   ẋ = R ∂H/∂P      Ṙ = R hat(∂H/∂Π)
//   Π̇ = Π × ∂H/∂Π + Σ_a r_a × ∂H/∂r_a + P × ∂H/∂P      Ṗ = P × ∂H/∂Π − Rᵀ ∂H/∂x
//
// with r_a the rows of R (body to world).  Written without any kernel of geometric algebra, so that
// the two representations check each other; motors appear where a run meets the outside only.
// Eigen: what includes it links Eigen3::Eigen as well as hamotor::hamotor.
#pragma once

#ifndef EIGEN_NO_DEBUG
#define EIGEN_NO_DEBUG  // a step does not stop to check indices that are constants
#endif
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>
#include <tuple>
#include <variant>

#include "hamotor/scene_abi.hpp"

namespace hamotor::matrix_form {

/// A body in D = 2 or 3 dimensions, or its rate of change; without x and P where it has a fixed
/// point.
template <class S, int D, bool translates>
struct Body {
  static constexpr int rotations = D == 3 ? 3 : 1;
  static constexpr int translations = translates ? D : 0;
  using Matrix = Eigen::Matrix<S, D, D>;
  using Vector = Eigen::Matrix<S, translations, 1>;
  using Angular = Eigen::Matrix<S, rotations, 1>;

  Matrix R;    ///< body to world
  Vector x;    ///< of the body frame's origin, world frame, m
  Angular pi;  ///< angular momentum about that origin, body frame, kg m²/s
  Vector p;    ///< linear momentum, body frame, kg m/s
};

/// The gradient of H with respect to the four, and what is applied, as it is subtracted from Π̇, Ṗ.
template <class S, int D, bool translates>
struct Gradient {
  using Part = Body<S, D, translates>;
  typename Part::Matrix R;
  typename Part::Vector x;
  typename Part::Angular pi;  ///< Ω
  typename Part::Vector p;    ///< V
  typename Part::Angular applied_pi;
  typename Part::Vector applied_p;
};

/// A system whose H is a function of matrices: `gradient(state, t)` for every body.
template <class System>
concept MatrixSystem =
    requires(const typename System::Bodies& state, const typename System::Scalar& t) {
      { System::dimension } -> std::convertible_to<int>;
      { System::translates } -> std::convertible_to<bool>;
      { System::has_potential } -> std::convertible_to<bool>;
      { System::has_applied } -> std::convertible_to<bool>;
      { System::energy(state, t) } -> std::same_as<typename System::Scalar>;
      { System::gradient(state, t)[0].R(0, 0) } -> std::convertible_to<typename System::Scalar>;
    };

/// hat(w) v = w × v; in the plane w is one number.
template <class S>
[[nodiscard]] Eigen::Matrix<S, 3, 3> hat(const Eigen::Matrix<S, 3, 1>& w) noexcept {
  Eigen::Matrix<S, 3, 3> m;
  m << S(0), -w(2), w(1), w(2), S(0), -w(0), -w(1), w(0), S(0);
  return m;
}
template <class S>
[[nodiscard]] Eigen::Matrix<S, 2, 2> hat(const Eigen::Matrix<S, 1, 1>& w) noexcept {
  Eigen::Matrix<S, 2, 2> m;
  m << S(0), -w(0), w(0), S(0);
  return m;
}

/// Σ_a a_a × b_a over the rows of two matrices: the axial vector of aᵀ b.
template <class S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> axial(const Eigen::Matrix<S, 3, 3>& a,
                                           const Eigen::Matrix<S, 3, 3>& b) noexcept {
  return {a.col(1).dot(b.col(2)) - a.col(2).dot(b.col(1)),
          a.col(2).dot(b.col(0)) - a.col(0).dot(b.col(2)),
          a.col(0).dot(b.col(1)) - a.col(1).dot(b.col(0))};
}
template <class S>
[[nodiscard]] Eigen::Matrix<S, 1, 1> axial(const Eigen::Matrix<S, 2, 2>& a,
                                           const Eigen::Matrix<S, 2, 2>& b) noexcept {
  return Eigen::Matrix<S, 1, 1>(a.col(0).dot(b.col(1)) - a.col(1).dot(b.col(0)));
}

/// a × b of vectors; in the plane one number.
template <class S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> cross(const Eigen::Matrix<S, 3, 1>& a,
                                           const Eigen::Matrix<S, 3, 1>& b) noexcept {
  return {a(1) * b(2) - a(2) * b(1), a(2) * b(0) - a(0) * b(2), a(0) * b(1) - a(1) * b(0)};
}
template <class S>
[[nodiscard]] Eigen::Matrix<S, 1, 1> cross(const Eigen::Matrix<S, 2, 1>& a,
                                           const Eigen::Matrix<S, 2, 1>& b) noexcept {
  return Eigen::Matrix<S, 1, 1>(a(0) * b(1) - a(1) * b(0));
}

/// The rotation by the vector θ (rad), 1 + sin|θ|/|θ| hat(θ) + (1 − cos|θ|)/|θ|² hat(θ)²
/// (Rodrigues 1840).
template <class S>
[[nodiscard]] Eigen::Matrix<S, 3, 3> rotation(const Eigen::Matrix<S, 3, 1>& theta) noexcept {
  const S angle = scalar::sqrt(theta.squaredNorm());
  const S half = S(0.5) * angle;
  const S half_ratio = angle > S(0) ? scalar::sin(half) / half : S(1);
  const S ratio = half_ratio * scalar::cos(half);
  const Eigen::Matrix<S, 3, 3> turn = hat(theta);
  return Eigen::Matrix<S, 3, 3>::Identity() + ratio * turn +
         (S(0.5) * half_ratio * half_ratio) * (turn * turn);
}
template <class S>
[[nodiscard]] Eigen::Matrix<S, 2, 2> rotation(const Eigen::Matrix<S, 1, 1>& theta) noexcept {
  const S c = scalar::cos(theta(0));
  const S s = scalar::sin(theta(0));
  Eigen::Matrix<S, 2, 2> m;
  m << c, -s, s, c;
  return m;
}

/// Π̇ and Ṗ of a body; ẋ and Ṙ need no more than the gradient.
template <class System, class Part, class Slopes>
void set_momentum_rates(const Part& body, const Slopes& h, Part& rate) noexcept {
  if constexpr (System::dimension == 3) {
    rate.pi = cross(body.pi, h.pi);
  } else {
    rate.pi.setZero();
  }
  if constexpr (System::has_potential) rate.pi += axial(body.R, h.R);
  if constexpr (System::translates) {
    rate.pi += cross(body.p, h.p);
    rate.p = -(hat(h.pi) * body.p);
    if constexpr (System::has_potential) rate.p -= body.R.transpose() * h.x;
  }
  if constexpr (System::has_applied) {
    rate.pi -= h.applied_pi;
    rate.p -= h.applied_p;
  }
}

/// One step towards the nearest rotation, R ½(3 − RᵀR); records |RᵀR − 1| before it.
template <class Matrix, class S>
void orthonormalise(Matrix& r, S& worst) noexcept {
  const Matrix defect = r.transpose() * r - Matrix::Identity();
  const S size = defect.cwiseAbs().maxCoeff();
  worst = size > worst ? size : worst;
  r -= S(0.5) * (r * defect);
}

/// What both methods have: the drift, and the work done.
template <class S>
class Account {
 public:
  static constexpr bool compensated = false;
  /// How far the steps so far left the rotations.
  [[nodiscard]] const Drift<S>& drift() const noexcept { return drift_; }
  /// ∫ dH/dt dt over the steps so far, J, by the method's own quadrature.
  [[nodiscard]] const S& work() const noexcept { return work_; }

 protected:
  Drift<S> drift_;
  S work_{};
};

/// The classical Runge–Kutta method of order 4 on the entries of (R, x, Π, P); R is
/// orthonormalised after every step.
template <class System>
class Rk4 : public Account<typename System::Scalar> {
  using S = typename System::Scalar;
  using Bodies = typename System::Bodies;
  static constexpr std::size_t n = System::bodies;

 public:
  static constexpr int order = 4;
  static constexpr std::string_view name = "rk4";

  /// Takes `state` from t to t + h.
  void do_step(const System& /*system*/, Bodies& state, const S& t, const S& h) noexcept {
    const S half = S(0.5) * h;
    Bodies there = state;
    Bodies sum;
    S power(0);
    add_slope(state, there, t, h / S(6), half, sum, power, true);
    add_slope(state, there, t + half, h / S(3), half, sum, power);
    add_slope(state, there, t + half, h / S(3), h, sum, power);
    add_slope(state, there, t + h, h / S(6), S(0), sum, power);
    S worst(0);
    for (std::size_t i = 0; i < n; ++i) {
      state[i].R += sum[i].R;
      state[i].x += sum[i].x;
      state[i].pi += sum[i].pi;
      state[i].p += sum[i].p;
      orthonormalise(state[i].R, worst);
    }
    this->work_ += power;
    detail::record(this->drift_, worst);
  }

 private:
  /// Adds `weight` times the slope at `there` to `sum`, and moves `there` to state + ahead slope.
  static void add_slope(const Bodies& state, Bodies& there, const S& t, const S& weight,
                        const S& ahead, Bodies& sum, S& power, bool first = false) noexcept {
    const auto h = System::gradient(there, t);
    if constexpr (requires { System::power(there, t); }) power += weight * System::power(there, t);
    for (std::size_t i = 0; i < n; ++i) {
      typename System::Body rate;
      rate.R = there[i].R * hat(h[i].pi);
      if constexpr (System::translates) rate.x = there[i].R * h[i].p;
      set_momentum_rates<System>(there[i], h[i], rate);
      there[i].R = state[i].R + ahead * rate.R;
      there[i].x = state[i].x + ahead * rate.x;
      there[i].pi = state[i].pi + ahead * rate.pi;
      there[i].p = state[i].p + ahead * rate.p;
      if (first) {
        sum[i] = {weight * rate.R, weight * rate.x, weight * rate.pi, weight * rate.p};
      } else {
        sum[i].R += weight * rate.R;
        sum[i].x += weight * rate.x;
        sum[i].pi += weight * rate.pi;
        sum[i].p += weight * rate.p;
      }
    }
  }
};

/// Runge–Kutta–Munthe-Kaas method of order 4 on SO(D) for R = R₀ exp(hat θ), by Rodrigues' formula,
/// and the classical one for x, Π and P.
template <class System>
class Rkmk4 : public Account<typename System::Scalar> {
  using S = typename System::Scalar;
  using Bodies = typename System::Bodies;
  using Part = typename System::Body;
  using Angular = typename Part::Angular;
  static constexpr std::size_t n = System::bodies;

  struct Slope {
    Angular theta;
    typename Part::Vector x;
    Angular pi;
    typename Part::Vector p;
  };
  using Slopes = std::array<Slope, n>;

 public:
  static constexpr int order = 4;
  static constexpr std::string_view name = "rkmk4";

  /// Takes `state` from t to t + h.
  void do_step(const System& /*system*/, Bodies& state, const S& t, const S& h) noexcept {
    const S half = S(0.5) * h;
    Slopes sum;
    S power(0);
    std::array<Angular, n> theta;
    for (auto& angle : theta) angle.setZero();
    Bodies there = state;
    add_slope(state, there, theta, t, h / S(6), half, sum, power, true);
    add_slope(state, there, theta, t + half, h / S(3), half, sum, power);
    add_slope(state, there, theta, t + half, h / S(3), h, sum, power);
    add_slope(state, there, theta, t + h, h / S(6), S(0), sum, power);
    S worst(0);
    for (std::size_t i = 0; i < n; ++i) {
      state[i].R = state[i].R * rotation<S>(sum[i].theta);
      state[i].x += sum[i].x;
      state[i].pi += sum[i].pi;
      state[i].p += sum[i].p;
      orthonormalise(state[i].R, worst);
    }
    this->work_ += power;
    detail::record(this->drift_, worst);
  }

 private:
  /// θ̇ = Ω + ½ θ × Ω + 1/12 θ × (θ × Ω) + …, whose next term is of fourth order in θ.
  [[nodiscard]] static Angular angle_rate(const Angular& theta, const Angular& w) noexcept {
    if constexpr (System::dimension == 3) {
      const Angular once = cross(theta, w);
      return w + S(0.5) * once + cross(theta, once) / S(12);
    } else {
      return w;
    }
  }

  /// Adds `weight` times the slope at `there` to `sum`, and moves `there` and θ ahead along it.
  static void add_slope(const Bodies& state, Bodies& there, std::array<Angular, n>& theta,
                        const S& t, const S& weight, const S& ahead, Slopes& sum, S& power,
                        bool first = false) noexcept {
    const auto h = System::gradient(there, t);
    if constexpr (requires { System::power(there, t); }) power += weight * System::power(there, t);
    for (std::size_t i = 0; i < n; ++i) {
      Part rate;
      const Angular turn = angle_rate(theta[i], h[i].pi);
      if constexpr (System::translates) rate.x = there[i].R * h[i].p;
      set_momentum_rates<System>(there[i], h[i], rate);
      if (first) {
        sum[i] = {weight * turn, weight * rate.x, weight * rate.pi, weight * rate.p};
      } else {
        sum[i].theta += weight * turn;
        sum[i].x += weight * rate.x;
        sum[i].pi += weight * rate.pi;
        sum[i].p += weight * rate.p;
      }
      if (ahead == S(0)) continue;
      theta[i] = ahead * turn;
      there[i].R = state[i].R * rotation<S>(theta[i]);
      there[i].x = state[i].x + ahead * rate.x;
      there[i].pi = state[i].pi + ahead * rate.pi;
      there[i].p = state[i].p + ahead * rate.p;
    }
  }
};

// ---------------------------------------------------------------- motors, at the boundary

/// The rotor of a rotation, (s, e23, e31, e12) or (s, e12), up to its sign: from the largest of
/// the four numbers, so that none is lost (Shepperd 1978).
template <class S>
[[nodiscard]] std::array<S, 4> rotor_of(const Eigen::Matrix<S, 3, 3>& r) noexcept {
  const S trace = r.trace();
  Eigen::Index largest = 0;
  const S diagonal = r.diagonal().maxCoeff(&largest);
  std::array<S, 4> q{};
  if (trace >= diagonal) {
    const S s = S(0.5) * scalar::sqrt(S(1) + trace);
    const S f = S(0.25) / s;
    q = {s, f * (r(1, 2) - r(2, 1)), f * (r(2, 0) - r(0, 2)), f * (r(0, 1) - r(1, 0))};
  } else {
    const auto i = largest;
    const auto j = (i + 1) % 3;
    const auto k = (i + 2) % 3;
    const S v = S(0.5) * scalar::sqrt(S(1) + r(i, i) - r(j, j) - r(k, k));
    const S f = S(0.25) / v;
    q[0] = f * (r(j, k) - r(k, j));
    q[static_cast<std::size_t>(i) + 1] = v;
    q[static_cast<std::size_t>(j) + 1] = f * (r(i, j) + r(j, i));
    q[static_cast<std::size_t>(k) + 1] = f * (r(i, k) + r(k, i));
  }
  return q;
}
template <class S>
[[nodiscard]] std::array<S, 2> rotor_of(const Eigen::Matrix<S, 2, 2>& r) noexcept {
  if (r(0, 0) >= S(0)) {
    const S s = scalar::sqrt(S(0.5) * (S(1) + r(0, 0)));
    return {s, S(0.5) * r(0, 1) / s};
  }
  const S v = scalar::sqrt(S(0.5) * (S(1) - r(0, 0)));
  return {S(0.5) * r(0, 1) / v, v};
}

/// The rotation of a unit rotor.
template <class S>
[[nodiscard]] Eigen::Matrix<S, 3, 3> matrix_of(const std::array<S, 4>& q) noexcept {
  const Eigen::Matrix<S, 3, 1> v(-q[1], -q[2], -q[3]);
  const Eigen::Matrix<S, 3, 3> turn = hat(v);
  return Eigen::Matrix<S, 3, 3>::Identity() + S(2) * q[0] * turn + S(2) * (turn * turn);
}
template <class S>
[[nodiscard]] Eigen::Matrix<S, 2, 2> matrix_of(const std::array<S, 2>& q) noexcept {
  Eigen::Matrix<S, 2, 2> m;
  const S c = S(1) - S(2) * q[1] * q[1];
  const S s = S(-2) * q[0] * q[1];
  m << c, -s, s, c;
  return m;
}

/// The rest of the motor T(x) q: its components e01, e02, e03, e0123, or e01, e02.
template <class S>
[[nodiscard]] std::array<S, 4> ideal_part(const Eigen::Matrix<S, 3, 1>& x,
                                          const std::array<S, 4>& q) noexcept {
  const Eigen::Matrix<S, 3, 1> b(q[1], q[2], q[3]);
  const Eigen::Matrix<S, 3, 1> u = S(-0.5) * (q[0] * x - cross(x, b));
  return {u(0), u(1), u(2), S(-0.5) * x.dot(b)};
}
template <class S>
[[nodiscard]] std::array<S, 2> ideal_part(const Eigen::Matrix<S, 2, 1>& x,
                                          const std::array<S, 2>& q) noexcept {
  return {S(-0.5) * (q[0] * x(0) - q[1] * x(1)), S(-0.5) * (q[0] * x(1) + q[1] * x(0))};
}

/// x from a motor's rotor and the rest.
template <class S>
[[nodiscard]] Eigen::Matrix<S, 3, 1> place_of(const std::array<S, 4>& q,
                                              const std::array<S, 4>& ideal) noexcept {
  const Eigen::Matrix<S, 3, 1> b(q[1], q[2], q[3]);
  const Eigen::Matrix<S, 3, 1> u(ideal[0], ideal[1], ideal[2]);
  return S(-2) * (q[0] * u + cross(u, b) + ideal[3] * b);
}
template <class S>
[[nodiscard]] Eigen::Matrix<S, 2, 1> place_of(const std::array<S, 2>& q,
                                              const std::array<S, 2>& ideal) noexcept {
  return {S(-2) * (q[0] * ideal[0] + q[1] * ideal[1]), S(-2) * (q[0] * ideal[1] - q[1] * ideal[0])};
}

/// Which of the two rotors ±q of a rotation a body has reached.
///
/// R alone forgets the sign.  It is kept by a rotor that was right: as long as R is less than a
/// quarter turn away from it, the nearer of ±q continues it.
template <class Matrix>
class Sheet {
  using S = typename Matrix::Scalar;
  using Rotor = decltype(rotor_of(Matrix{}));

 public:
  void start(const Matrix& r, const Rotor& q) noexcept {
    matrix_ = r;
    rotor_ = q;
  }

  /// The rotor of r that continues those before.
  [[nodiscard]] Rotor rotor(const Matrix& r) const noexcept {
    Rotor q = rotor_of(r);
    S along(0);
    for (std::size_t k = 0; k < q.size(); ++k) along += q[k] * rotor_[k];
    if (along < S(0)) {
      for (S& x : q) x = -x;
    }
    return q;
  }

  /// To be called after every step.
  void follow(const Matrix& r) noexcept {
    constexpr S quarter_turn(Matrix::RowsAtCompileTime - 2);  // tr(R₀ᵀ R) there
    if (matrix_.cwiseProduct(r).sum() < quarter_turn) start(r, rotor(r));
  }

 private:
  Matrix matrix_;
  Rotor rotor_{};
};

/// A scene under way, in matrices; with the interface of `scene::Run`.
template <class Scene>
class Run {
  using System = scene::SystemOf<Scene>;
  using S = typename Scene::Scalar;
  using Part = typename System::Body;
  using Methods = scene::MethodsOf<Scene>;
  static constexpr std::size_t n = System::bodies;
  static constexpr std::size_t rotor_size = System::dimension == 3 ? 4 : 2;
  static constexpr std::size_t momentum_size = scene::momentum_size<Scene>;
  static constexpr bool powered = scene::is_powered<Scene>;

 public:
  /// Starts from `state`: motors and momenta.
  template <class Number>
  Run(const typename Methods::AnyOf& method, const std::type_identity_t<Number>& time,
      const std::type_identity_t<Number>& step, const Number* state) noexcept
      : method_(method), time_(S(time)), step_(S(step)) {
    for (std::size_t i = 0; i < n; ++i) {
      std::array<S, rotor_size> rotor{};
      read(state, rotor);
      bodies_[i].R = matrix_of(rotor);
      sheets_[i].start(bodies_[i].R, rotor);
      if constexpr (System::translates) {
        std::array<S, rotor_size> ideal{};
        read(state, ideal);
        bodies_[i].x = place_of(rotor, ideal);
      }
      read(state, bodies_[i].pi);
      read(state, bodies_[i].p);
    }
  }

  /// No method of this form takes steps of its own.
  static void set_patience(std::int64_t /*tries*/) noexcept {}

  /// As `scene::Run::advance`.
  [[nodiscard]] std::int64_t advance(std::int64_t steps, std::int64_t every,
                                     double* rows) noexcept {
    return std::visit([&](auto& method) { return advance_with(method, steps, every, rows); },
                      method_);
  }

  /// One row of columns.
  template <class Number>
  void observe(Number* row) const noexcept {
    *row++ = static_cast<Number>(now());
    std::array<S, momentum_size> total{};
    for (std::size_t i = 0; i < n; ++i) {
      const Part& body = bodies_[i];
      row = write_motor(i, row);
      row = write(body.pi, row);
      row = write(body.p, row);
      if constexpr (System::translates) {
        row = write(body.x, row);
      } else {
        row = write(Scene::fixed_points[i], row);
      }
      add_spatial(body, total);
    }
    const S h = System::energy(bodies_, now());
    *row++ = static_cast<Number>(h);
    if constexpr (powered) *row++ = static_cast<Number>(work_);
    row = write(total, row);
    for (const auto& conserved : Scene::conserved) {
      if (!scene::has_own_column(conserved)) continue;
      *row++ = static_cast<Number>(value_of(conserved, h, total));
    }
  }

  /// As `scene::Run::observe_at`.
  [[nodiscard]] bool observe_at(double time, double* row) const noexcept {
    return std::visit(
        [&](auto method) {
          Run there = *this;
          const S part = S(time) - now();
          method.do_step(Scene::system, there.bodies_, now(), part);
          if (!is_finite(there.bodies_)) return false;
          for (std::size_t i = 0; i < n; ++i) there.sheets_[i].follow(there.bodies_[i].R);
          if constexpr (powered) there.work_ = method.work();
          there.time_ = S(time);
          there.index_ = 0;
          there.observe(row);
          return true;
        },
        method_);
  }

  /// This form has no events.
  [[nodiscard]] static bool observe_event(std::int64_t /*k*/, double* /*row*/) noexcept {
    return false;
  }

  /// The state as motors and momenta.
  void read_state(double* state) const noexcept {
    for (std::size_t i = 0; i < n; ++i) {
      state = write_motor(i, state);
      state = write(bodies_[i].pi, state);
      state = write(bodies_[i].p, state);
    }
  }

  [[nodiscard]] const Drift<S>& drift() const noexcept { return drift_; }

  /// Steps taken so far.
  [[nodiscard]] std::int64_t steps() const noexcept { return index_; }

  /// Why the run stopped; which component is not told, −1.
  [[nodiscard]] Failure failure(std::int64_t& component) const noexcept {
    component = -1;
    return failed_ ? Failure::not_finite : Failure::none;
  }

 private:
  template <class Method>
  [[nodiscard]] std::int64_t advance_with(Method& method, std::int64_t steps, std::int64_t every,
                                          double* rows) noexcept {
    if (failed_) return 0;
    typename System::Bodies bodies = bodies_;
    for (std::int64_t done = 0; done < steps; ++done) {
      method.do_step(Scene::system, bodies, now(), step_);
      if (!is_finite(bodies)) {
        failed_ = true;
        return done;
      }
      bodies_ = bodies;
      for (std::size_t i = 0; i < n; ++i) sheets_[i].follow(bodies[i].R);
      drift_ = method.drift();
      if constexpr (powered) work_ = method.work();
      ++index_;
      if (rows != nullptr && every > 0 && index_ % every == 0) {
        observe(rows);
        rows += scene::columns<Scene>();
      }
    }
    return steps;
  }

  [[nodiscard]] S now() const noexcept { return mul_add(static_cast<S>(index_), step_, time_); }

  [[nodiscard]] static bool is_finite(const typename System::Bodies& bodies) noexcept {
    S sum(0);
    for (const Part& body : bodies) {
      sum += S(0) * (body.R.sum() + body.x.sum() + body.pi.sum() + body.p.sum());
    }
    return sum == S(0);
  }

  /// The momentum in the world frame, about the world's origin.
  static void add_spatial(const Part& body, std::array<S, momentum_size>& total) noexcept {
    typename Part::Angular angular = body.pi;
    if constexpr (System::dimension == 3) angular = body.R * body.pi;
    if constexpr (System::translates) {
      const typename Part::Vector linear = body.R * body.p;
      angular += cross(body.x, linear);
      for (std::size_t k = 0; k < System::dimension; ++k) {
        total[Part::rotations + k] += linear(static_cast<Eigen::Index>(k));
      }
    }
    for (std::size_t k = 0; k < Part::rotations; ++k) {
      total[k] += angular(static_cast<Eigen::Index>(k));
    }
  }

  template <class Conserved>
  [[nodiscard]] S value_of(const Conserved& conserved, const S& h,
                           const std::array<S, momentum_size>& total) const noexcept {
    if (conserved.quantity == Quantity::spatial_momentum) {
      S sum(0);
      for (std::size_t k = 0; k < momentum_size; ++k)
        sum += S(conserved.coefficients[k]) * total[k];
      return sum;
    }
    if (conserved.quantity == Quantity::energy_balance) return h - work_;
    if constexpr (requires { Scene::quantities(bodies_, time_); }) {
      return Scene::quantities(bodies_, now())[conserved.index];
    } else {
      return std::numeric_limits<S>::quiet_NaN();
    }
  }

  template <class Number>
  [[nodiscard]] Number* write_motor(std::size_t i, Number* to) const noexcept {
    const auto rotor = sheets_[i].rotor(bodies_[i].R);
    to = write(rotor, to);
    if constexpr (System::translates) to = write(ideal_part(bodies_[i].x, rotor), to);
    return to;
  }

  template <class Number, class Values>
  static void read(const Number*& from, Values& values) noexcept {
    for (S& x : values) x = static_cast<S>(*from++);
  }
  template <class Number, int size>
  static void read(const Number*& from, Eigen::Matrix<S, size, 1>& values) noexcept {
    for (Eigen::Index k = 0; k < size; ++k) values(k) = static_cast<S>(*from++);
  }

  template <class Number, std::size_t size>
  [[nodiscard]] static Number* write(const std::array<S, size>& values, Number* to) noexcept {
    for (const S& x : values) *to++ = static_cast<Number>(x);
    return to;
  }
  template <class Number, int size>
  [[nodiscard]] static Number* write(const Eigen::Matrix<S, size, 1>& values, Number* to) noexcept {
    for (Eigen::Index k = 0; k < size; ++k) *to++ = static_cast<Number>(values(k));
    return to;
  }

  typename Methods::AnyOf method_;
  S time_;
  S step_;
  typename System::Bodies bodies_{};
  std::array<Sheet<typename Part::Matrix>, n> sheets_{};
  Drift<S> drift_;
  S work_{};
  std::int64_t index_ = 0;
  bool failed_ = false;
};

}  // namespace hamotor::matrix_form

namespace hamotor::detail {

template <matrix_form::MatrixSystem System, Summation... asked>
struct Steppers<System, asked...> {
  using type = std::tuple<matrix_form::Rkmk4<System>, matrix_form::Rk4<System>>;
};

}  // namespace hamotor::detail
