// Every bundled group can be stepped: free motion with a quadratic Hamiltonian, no line of code for
// any one of them.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>

#include "hamotor/cga2/cga2.hpp"
#include "hamotor/cga3/cga3.hpp"
#include "hamotor/cl3/cl3.hpp"
#include "hamotor/gauss.hpp"
#include "hamotor/pga2/pga2.hpp"
#include "hamotor/pga3/pga3.hpp"
#include "hamotor/pga4/pga4.hpp"
#include "hamotor/sta/sta.hpp"
#include "hamotor/steppers.hpp"

namespace {

using hamotor::Rkmk4;

/// H = ½ Σ μ_a² / I_a + ¼ μ_1 μ_n: left-invariant, with no symmetry but the group's.
template <class G>
struct Quadratic {
  using Group = G;
  using Scalar = double;
  using Rate = typename G::template Rate<double>;
  static constexpr std::size_t bodies = 1;
  static constexpr bool has_forque = false;
  using State = hamotor::State<G, 1, double>;

  [[nodiscard]] constexpr std::array<Rate, 1> rate(const State& state) const noexcept {
    auto w = state.momenta[0].components();
    const double first = w.front();
    const double last = w.back();
    for (std::size_t a = 0; a < w.size(); ++a) w[a] /= 1 + 0.3 * static_cast<double>(a * a % 7);
    w.front() += 0.25 * last;
    w.back() += 0.25 * first;
    return {Rate::from(w)};
  }
  [[nodiscard]] constexpr double energy(const State& state) const noexcept {
    return 0.5 * pairing(state.momenta[0], rate(state)[0]);
  }
};

template <class G>
hamotor::State<G, 1, double> start() {
  hamotor::State<G, 1, double> state{};
  std::array<double, static_cast<std::size_t>(G::dimension)> x{};
  double value = 0.37;
  const auto next = [&] {
    value = std::fmod(value * 3.7 + 0.61, 2.0);
    return 0.8 * (value - 1);
  };
  for (auto& w : x) w = next();
  state.motors[0] = exp(G::template Rate<double>::from(x));
  for (auto& l : x) l = next();
  state.momenta[0] = G::template Momentum<double>::from(x);
  return state;
}

template <class T>
double distance(const T& a, const T& b) {
  double largest = 0;
  const auto x = a.components();
  const auto y = b.components();
  for (std::size_t k = 0; k < x.size(); ++k) largest = std::max(largest, std::abs(x[k] - y[k]));
  return largest;
}

template <class G>
class Group : public testing::Test {
 protected:
  using State = hamotor::State<G, 1, double>;
  using System = Quadratic<G>;

  /// The state after a unit of time in so many steps, and what had to be corrected.
  static State stepped(int steps, double* drift = nullptr) {
    State state = start<G>();
    Rkmk4<System> method;
    for (int k = 0; k < steps; ++k) method.do_step(System{}, state, 0, 1.0 / steps);
    if (drift != nullptr) *drift = method.drift().largest;
    return state;
  }
  template <class Method>
  static State stepped_with(int steps) {
    State state = start<G>();
    Method method;
    for (int k = 0; k < steps; ++k) method.do_step(System{}, state, 0, 1.0 / steps);
    return state;
  }
  static double error(const State& a, const State& b) {
    return std::max(distance(a.motors[0], b.motors[0]), distance(a.momenta[0], b.momenta[0]));
  }
  static auto spatial(const State& state) {
    return Ad_star_inverse(state.motors[0], state.momenta[0]);
  }
};

using NonAbelian =
    testing::Types<hamotor::cga2::SE2, hamotor::cga2::Sim2, hamotor::cga2::SO31, hamotor::cga3::SE3,
                   hamotor::cga3::Sim3, hamotor::cga3::SO41, hamotor::cl3::SO3, hamotor::pga2::SE2,
                   hamotor::pga3::SE3, hamotor::pga3::SO3, hamotor::pga4::SE4, hamotor::pga4::SO4,
                   hamotor::sta::SO13>;

struct Name {
  template <class G>
  static std::string GetName(int) {
    return std::string(G::algebra) + "_" + std::string(G::name);
  }
};

TYPED_TEST_SUITE(Group, NonAbelian, Name);

TYPED_TEST(Group, rkmk4_has_order_4) {
  const auto reference = this->stepped(1600);
  constexpr int steps = TypeParam::dimension > 3 ? 40 : 10;
  const double coarse = this->error(this->stepped(steps), reference);
  const double fine = this->error(this->stepped(2 * steps), reference);
  EXPECT_GT(fine, 1e-12) << "nothing to measure";
  EXPECT_NEAR(std::log2(coarse / fine), 4, 0.1);
}

TYPED_TEST(Group, gauss_collocation_has_order_4_and_keeps_the_spatial_momentum) {
  using Gauss4 = hamotor::Gauss4<Quadratic<TypeParam>>;
  const auto reference = this->template stepped_with<Gauss4>(320);
  constexpr int steps = TypeParam::dimension > 3 ? 20 : 10;
  const auto end = this->template stepped_with<Gauss4>(2 * steps);
  const double coarse = this->error(this->template stepped_with<Gauss4>(steps), reference);
  const double fine = this->error(end, reference);
  EXPECT_GT(fine, 1e-12) << "nothing to measure";
  EXPECT_NEAR(std::log2(coarse / fine), 4, 0.1);
  EXPECT_LT(distance(this->spatial(end), this->spatial(start<TypeParam>())), 1e-12);
}

TYPED_TEST(Group, spatial_momentum_is_conserved_to_the_methods_error) {
  const auto before = this->spatial(start<TypeParam>());
  const auto lost = [&](int steps) {
    return distance(this->spatial(this->stepped(steps)), before);
  };
  EXPECT_GT(std::log2(lost(40) / lost(80)), 3.8);
  EXPECT_LT(lost(800), 2e-11);
}

TYPED_TEST(Group, steps_stay_on_the_group_to_rounding) {
  double drift = 0;
  const auto end = this->stepped(200, &drift);
  const auto size = distance(end.motors[0], typename TypeParam::template Element<double>{});
  EXPECT_LT(drift, 4e-15 * size * size);
  EXPECT_LT(hamotor::detail::size(unit_defect(end.motors[0])), 2e-15 * size * size);
}

TYPED_TEST(Group, correction_leaves_the_square_of_the_defect) {
  auto motor = start<TypeParam>().motors[0];
  const auto changed = [&](double by) {
    auto x = motor.components();
    for (std::size_t k = 0; k < x.size(); ++k) x[k] += by * std::cos(static_cast<double>(k));
    return TypeParam::template Element<double>::from(x);
  };
  for (const double by : {1e-3, 1e-5}) {
    const auto off = changed(by);
    const auto defect = unit_defect(off);
    const auto left = unit_defect(off + unit_correction(off, defect));
    const double size = hamotor::detail::size(defect);
    EXPECT_GT(size, by / 100);
    EXPECT_LT(hamotor::detail::size(left), 8 * size * size + 1e-14);
  }
}

/// Under e0 → −e∞ both have the same coefficients in the same order.
TEST(RigidMotions, in_conformal_and_projective_algebra_are_the_same_coefficients) {
  const auto end = [](auto group, int steps) {
    using G = decltype(group);
    auto state = start<G>();
    Rkmk4<Quadratic<G>> method;
    for (int k = 0; k < steps; ++k) method.do_step(Quadratic<G>{}, state, 0, 0.01);
    return state;
  };
  for (const int steps : {1, 300}) {
    const auto conformal = end(hamotor::cga3::SE3{}, steps);
    const auto projective = end(hamotor::pga3::SE3{}, steps);
    const auto motor = conformal.motors[0].components();
    const auto momentum = conformal.momenta[0].components();
    for (std::size_t k = 0; k < motor.size(); ++k) {
      EXPECT_NEAR(motor[k], projective.motors[0].components()[k], 2e-14);
    }
    for (std::size_t k = 0; k < momentum.size(); ++k) {
      EXPECT_NEAR(momentum[k], projective.momenta[0].components()[k], 2e-14);
    }
  }
}

/// An isotropic oscillator on ℝⁿ, H = |P|²/2m + ½ k |x|².
template <class G, std::size_t n>
struct Oscillator {
  using Group = G;
  using Scalar = double;
  using Rate = typename G::template Rate<double>;
  using Momentum = typename G::template Momentum<double>;
  static constexpr std::size_t bodies = 1;
  static constexpr bool has_forque = true;
  static constexpr double mass = 1.5;
  static constexpr double stiffness = 3;
  using State = hamotor::State<G, 1, double>;

  static constexpr std::array<double, n> position(const typename G::template Element<double>& t) {
    return G::log(t).components();
  }
  [[nodiscard]] constexpr std::array<Rate, 1> rate(const State& state) const noexcept {
    auto v = state.momenta[0].components();
    for (double& x : v) x /= mass;
    return {Rate::from(v)};
  }
  [[nodiscard]] constexpr std::array<Momentum, 1> forque(
      const decltype(State::motors)& motors) const noexcept {
    auto x = position(motors[0]);
    for (double& f : x) f *= stiffness;
    return {Momentum::from(x)};
  }
  [[nodiscard]] constexpr double energy(const State& state) const noexcept {
    return 0.5 * pairing(state.momenta[0], rate(state)[0]);
  }
};

/// Hamilton's equations ẋ = ∂H/∂p, ṗ = −∂H/∂x by the classical Runge–Kutta method.
template <std::size_t n>
struct Classical {
  std::array<double, n> x;
  std::array<double, n> p;

  void step(double h) {
    constexpr double mass = 1.5;
    constexpr double stiffness = 3;
    for (std::size_t k = 0; k < n; ++k) {
      const double x1 = p[k] / mass;
      const double p1 = -stiffness * x[k];
      const double x2 = (p[k] + h / 2 * p1) / mass;
      const double p2 = -stiffness * (x[k] + h / 2 * x1);
      const double x3 = (p[k] + h / 2 * p2) / mass;
      const double p3 = -stiffness * (x[k] + h / 2 * x2);
      const double x4 = (p[k] + h * p3) / mass;
      const double p4 = -stiffness * (x[k] + h * x3);
      x[k] += h / 6 * (x1 + 2 * x2 + 2 * x3 + x4);
      p[k] += h / 6 * (p1 + 2 * p2 + 2 * p3 + p4);
    }
  }
};

template <class G, std::size_t n>
void expect_classical_hamilton_equations() {
  using System = Oscillator<G, n>;
  auto state = start<G>();
  Classical<n> classical{System::position(state.motors[0]), state.momenta[0].components()};
  Rkmk4<System> method;
  for (int step = 0; step < 300; ++step) {
    method.do_step(System{}, state, 0, 0.05);
    classical.step(0.05);
  }
  const auto x = System::position(state.motors[0]);
  const auto p = state.momenta[0].components();
  for (std::size_t k = 0; k < n; ++k) {
    EXPECT_NEAR(x[k], classical.x[k], 1e-14);
    EXPECT_NEAR(p[k], classical.p[k], 1e-14);
  }
}

TEST(Translations, are_stepped_by_the_classical_hamilton_equations) {
  expect_classical_hamilton_equations<hamotor::pga2::T2, 2>();
  expect_classical_hamilton_equations<hamotor::pga3::T3, 3>();
}

TEST(Translations, take_the_origin_to_the_coordinates_that_log_gives) {
  const auto t = start<hamotor::pga3::T3>().motors[0];
  const auto x = hamotor::pga3::T3::log(t).components();
  const auto point = sandwich(t, hamotor::pga3::Point<double>{}).components();
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(point[k], x[k], 1e-16);
  const auto s = start<hamotor::pga2::T2>().motors[0];
  const auto y = hamotor::pga2::T2::log(s).components();
  const auto place = sandwich(s, hamotor::pga2::Point<double>{}).components();
  for (std::size_t k = 0; k < 2; ++k) EXPECT_NEAR(place[k], y[k], 1e-16);
}

/// log exp(b) and log(−exp(b)) are b: nothing turns in it, and −exp(b) is no exponential.
template <class Bivector>
void expect_log_of_both_signs(const Bivector& b) {
  const auto r = exp(b);
  const auto expected = b.components();
  for (const double sign : {1.0, -1.0}) {
    const auto found = log(sign * r).components();
    for (std::size_t k = 0; k < expected.size(); ++k) {
      EXPECT_NEAR(found[k], expected[k], 1e-14) << Bivector::names[k] << ", sign " << sign;
    }
  }
}

TEST(Logarithms, of_minus_a_boost_or_null_rotation_are_those_of_the_same_transformation) {
  using Sta = hamotor::sta::Bivector<double>;
  using Cga2 = hamotor::cga2::Bivector<double>;
  using Cga3 = hamotor::cga3::Bivector<double>;
  expect_log_of_both_signs(Sta{});
  expect_log_of_both_signs(Sta{0, 0, 0, 0.7, 0, 0});
  expect_log_of_both_signs(Sta{0, 0, 0, 1e-9, -2e-9, 0});
  expect_log_of_both_signs(Sta{0, 0, 0, -1.5, 0.25, 2});
  expect_log_of_both_signs(Sta{0, 0.5, 0, 0.5, 0, 0});
  expect_log_of_both_signs(Sta{0, 0.5, 0, 1.5, 0, 0});
  expect_log_of_both_signs(Cga3{});
  expect_log_of_both_signs(Cga3{0, 0, 0, 0, 0, 0, 0.3, 0, 0, 0});
  expect_log_of_both_signs(Cga3{0, 0, 0, 0.5, -3, 2, 0, 0, 0, 0});
  expect_log_of_both_signs(Cga3{0, 0, 0, 0.5, -3, 0, 1.25, 0, 0, 0});
  expect_log_of_both_signs(Cga3{0, 0, 0, 0, 0, 0, 0, 0.5, 0, 0.25});
  expect_log_of_both_signs(Cga3{0, 0, 0, 0, 0.5, 0, 0, 0, -0.5, 0});
  expect_log_of_both_signs(Cga2{});
  expect_log_of_both_signs(Cga2{0, 0.5, -3, 0, 0, 0});
  expect_log_of_both_signs(Cga2{0, 0.25, 0, -0.5, 0, 0});
}

/// exp(log(−exp(b))) is −exp(b): something turns in b.
template <class Bivector>
void expect_log_reaches_minus(const Bivector& b) {
  const auto r = exp(b);
  const auto expected = r.components();
  const auto found = exp(log(-r)).components();
  for (std::size_t k = 0; k < expected.size(); ++k) {
    EXPECT_NEAR(found[k], -expected[k], 1e-13) << decltype(r)::names[k];
  }
}

TEST(Logarithms, of_minus_a_rotation_are_its_own) {
  using Sta = hamotor::sta::Bivector<double>;
  using Cga3 = hamotor::cga3::Bivector<double>;
  expect_log_reaches_minus(Sta{0.5, 0, 0, 0, 0, 0});
  expect_log_reaches_minus(Sta{0.5, 0, 0, 0.25, 0, 0});
  expect_log_reaches_minus(Sta{1e-6, 0, 2, 1.5, 0, 0.5});
  expect_log_reaches_minus(Cga3{0.5, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  expect_log_reaches_minus(Cga3{0.5, 0, 0, 2, -1, 0, 0, 0, 0, 0});
  expect_log_reaches_minus(Cga3{0.5, 0, -1, 0, 0, 0, 0.75, 0, 0, 0});
  expect_log_reaches_minus(Cga3{0.5, 0.1, 0, 0.25, 0, 0, 0, 0.5, 0, 0});
}

}  // namespace
