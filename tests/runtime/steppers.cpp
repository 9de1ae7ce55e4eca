// Laws of the steppers: order, reversibility, symplecticity, what they conserve, what they report.
#include "hamotor/steppers.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <type_traits>
#include <vector>

#include "sample_systems.hpp"
#include "symplecticity.hpp"

namespace {

using hamotor::Rk4;
using hamotor::Rkmk4;
using hamotor::Splitting2;
using hamotor::Summation;
using sample::distance;
using sample::generic_state;
using sample::spatial_momentum;

template <class Method, class System>
auto stepped(const System& system, hamotor::StateOf<System> state, double h, int steps) {
  using S = typename System::Scalar;
  Method method;
  for (int k = 0; k < steps; ++k) method.do_step(system, state, S(k) * S(h), S(h));
  return state;
}

/// Slope of log error over log step between two steps, against a reference of much finer steps.
template <class Method, class System>
double measured_order(const System& system, int coarse) {
  const auto start = generic_state(system);
  constexpr double end = 1;
  const auto reference = stepped<Rkmk4<System>>(system, start, end / 4000, 4000);
  const auto error = [&](int steps) {
    return distance(stepped<Method>(system, start, end / steps, steps), reference);
  };
  return std::log2(error(coarse) / error(2 * coarse));
}

template <class System>
void expect_orders(const System& system) {
  EXPECT_NEAR(measured_order<Rkmk4<System>>(system, 60), 4, 0.1);
  EXPECT_NEAR(measured_order<Rk4<System>>(system, 120), 4, 0.1);
  EXPECT_NEAR(measured_order<Splitting2<System>>(system, 100), 2, 0.1);
}

TEST(Order, of_a_free_body_in_space) { expect_orders(sample::free_se3()); }
TEST(Order, of_a_free_body_with_a_fixed_point) { expect_orders(sample::free_so3()); }
TEST(Order, of_a_forced_body_in_space) { expect_orders(sample::forced_se3()); }
TEST(Order, of_a_forced_body_with_a_fixed_point) { expect_orders(sample::forced_so3()); }
TEST(Order, of_a_forced_body_in_the_plane) { expect_orders(sample::forced_se2()); }
TEST(Order, of_two_bodies_in_space) { expect_orders(sample::two_bodies_se3()); }
TEST(Order, of_two_bodies_in_the_plane) { expect_orders(sample::two_bodies_se2()); }

/// A system whose momenta have to be stepped themselves.
template <class System>
struct WithoutRates : System {
  constexpr explicit WithoutRates(const System& system) : System(system) {}
  void in_rates() const = delete;
};

template <Summation summation, class System>
long double apart_without_rates(const System& system) {
  static_assert(hamotor::RateSystem<System>);
  static_assert(!hamotor::RateSystem<WithoutRates<System>>);
  using Plain = WithoutRates<System>;
  const auto start = generic_state(system);
  const auto one = stepped<Rk4<System, summation>>(system, start, 0.05, 20);
  const auto other = stepped<Rk4<Plain, summation>>(Plain(system), start, 0.05, 20);
  return distance(one, other);
}

TEST(Rk4, a_step_of_no_length_leaves_the_state) {
  const auto expect = [](const auto& system) {
    const auto start = generic_state(system);
    using Method = Rk4<std::remove_cvref_t<decltype(system)>>;
    EXPECT_LT(distance(start, stepped<Method>(system, start, 0.0, 1)), 1e-15);
  };
  expect(sample::forced_so3());
  expect(sample::forced_se3());
}

TEST(Rk4, steps_rates_as_it_steps_momenta) {
  constexpr auto plain = Summation::plain;
  EXPECT_LT(apart_without_rates<plain>(sample::free_so3()), 3e-15);
  EXPECT_LT(apart_without_rates<plain>(sample::forced_so3()), 3e-15);
  constexpr auto compensated = Summation::compensated;
  EXPECT_LT(apart_without_rates<compensated>(sample::free_se3()), 3e-15);
  EXPECT_LT(apart_without_rates<compensated>(sample::forced_se2()), 3e-15);
  EXPECT_LT(apart_without_rates<compensated>(sample::two_bodies_se3()), 3e-15);
}

/// How many times as large errors are with positions and velocities seen from the body.
template <class System>
double gained_in_the_world(const System& system) {
  static_assert(hamotor::WorldSystem<System>);
  const auto start = generic_state(system);
  const auto reference = stepped<Rkmk4<System>>(system, start, 1.0 / 2000, 2000);
  const WithoutRates seen_from_body(system);
  return distance(stepped<Rk4<decltype(seen_from_body)>>(seen_from_body, start, 0.02, 50),
                  reference) /
         distance(stepped<Rk4<System>>(system, start, 0.02, 50), reference);
}

TEST(Rk4, errs_less_with_positions_in_the_world) {
  EXPECT_GT(gained_in_the_world(sample::free_se3()), 8);
  EXPECT_GT(gained_in_the_world(sample::forced_se3()), 2);
  EXPECT_GT(gained_in_the_world(sample::two_bodies_se3()), 1.5);
  EXPECT_GT(gained_in_the_world(sample::forced_se2()), 1.5);
}

TEST(Rk4, a_free_body_flies_straight_however_fast_it_turns) {
  const auto system = sample::free_se3();
  auto start = generic_state(system);
  start.momenta[0].l23 = 60;
  const auto end = stepped<Rk4<std::remove_const_t<decltype(system)>>>(system, start, 0.001, 500);
  const auto before = spatial_momentum(start);
  const auto after = spatial_momentum(end);
  const auto from = sandwich(start.motors[0], hamotor::pga3::Origin<double>{});
  const auto to = sandwich(end.motors[0], hamotor::pga3::Origin<double>{});
  const double time_over_mass = 0.5 / system.body<0>().mass();
  EXPECT_NEAR(after.p1, before.p1, 1e-14);
  EXPECT_NEAR(after.p2, before.p2, 1e-14);
  EXPECT_NEAR(to.e032 - from.e032, time_over_mass * before.p1, 1e-13);
  EXPECT_NEAR(to.e021 - from.e021, time_over_mass * before.p3, 1e-13);
}

TEST(Rk4, takes_up_a_state_that_was_changed_between_steps) {
  const auto system = sample::forced_se3();
  using Method = Rk4<std::remove_const_t<decltype(system)>>;
  Method method;
  auto state = generic_state(system);
  method.do_step(system, state, 0.0, 0.05);
  state.momenta[0].p2 += 1;
  const auto expected = stepped<Method>(system, state, 0.05, 1);
  method.do_step(system, state, 0.0, 0.05);
  EXPECT_EQ(state, expected);
}

/// Against order 8 in shorter steps, in long double: an error of 1e-17 is then one of the method.
template <int order, class System>
double splitting_order(const System& system, int coarse) {
  using hamotor::Splitting;
  const auto after = [&]<int of>(std::integral_constant<int, of>, int steps) {
    auto state = generic_state(system);
    Splitting<System, of> method;
    const auto h = 1 / static_cast<long double>(steps);
    for (int k = 0; k < steps; ++k) method.do_step(system, state, 0, h);
    return state;
  };
  const auto reference = after(std::integral_constant<int, 8>{}, 6 * coarse);
  const auto error = [&](int steps) {
    return distance(after(std::integral_constant<int, order>{}, steps), reference);
  };
  const double fine = error(2 * coarse);
  EXPECT_GT(fine, 1e-17) << "nothing to measure";
  return std::log2(error(coarse) / fine);
}

/// The least steps in which each order is seen: fewer where less acts.
struct Steps {
  int four;
  int six;
  int eight;
};

template <class System>
void expect_splitting_orders(const System& system, const Steps& coarse) {
  EXPECT_NEAR((splitting_order<4>(system, coarse.four)), 4, 0.1);
  EXPECT_NEAR((splitting_order<6>(system, coarse.six)), 6, 0.1);
  EXPECT_NEAR((splitting_order<8>(system, coarse.eight)), 8, 0.1);
}

TEST(Splitting, has_its_order_for_free_and_forced_bodies) {
  using Wide = long double;
  expect_splitting_orders(sample::free_se3<Wide>(), {10, 6, 3});
  expect_splitting_orders(sample::free_so3<Wide>(), {10, 6, 3});
  expect_splitting_orders(sample::forced_se3<Wide>(), {20, 20, 40});
  expect_splitting_orders(sample::forced_so3<Wide>(), {30, 20, 14});
  expect_splitting_orders(sample::two_bodies_se3<Wide>(), {20, 20, 30});
}

TEST(Splitting, has_its_order_where_the_free_motion_is_exact) {
  using Wide = long double;
  expect_splitting_orders(sample::forced_se2<Wide>(), {20, 10, 10});
  expect_splitting_orders(sample::two_bodies_se2<Wide>(), {40, 40, 30});
  expect_splitting_orders(sample::symmetric_top<Wide>(), {10, 16, 10});
  expect_splitting_orders(sample::spinning_pendulum<Wide>(), {80, 30, 24});
}

/// Errors of the fourth order have ε³ in them, those of the eighth only ε.
TEST(Splitting4, is_of_a_higher_order_for_a_nearly_symmetric_body) {
  const auto system = sample::nearly_symmetric_so3<long double>();
  using System = std::remove_const_t<decltype(system)>;
  const auto after = [&](auto method, int steps) {
    auto state = generic_state(system);
    state.momenta[0] = 10.0L * state.momenta[0];
    for (int k = 0; k < steps; ++k) method.do_step(system, state, 0, 1.0L / steps);
    return state;
  };
  const auto reference = after(hamotor::Splitting10<System>{}, 200);
  const auto order = [&](int steps) {
    const auto error = [&](int n) {
      return distance(after(hamotor::Splitting4<System>{}, n), reference);
    };
    return std::log2(error(steps) / error(2 * steps));
  };
  EXPECT_GT(order(1), 8);
  EXPECT_NEAR(order(64), 4, 0.1);
}

/// The spin that is left out of the parts of a step is back at its end.
template <int order, class Apart, class Together>
void expect_same_steps(const Apart& apart, const Together& together) {
  hamotor::Splitting<Apart, order> one;
  hamotor::Splitting<Together, order> other;
  auto a = generic_state(apart);
  hamotor::StateOf<Together> b{a.motors, a.momenta};
  for (int k = 0; k < 20; ++k) {
    one.do_step(apart, a, 0, 0.2);
    other.do_step(together, b, 0, 0.2);
  }
  EXPECT_LT(distance(a.motors[0], b.motors[0]), 2e-14);
  EXPECT_LT(distance(a.momenta[0], b.momenta[0]), 2e-14);
}

TEST(Splitting, of_a_top_takes_the_steps_of_a_symmetric_body) {
  const auto top = sample::symmetric_top();
  const auto body = sample::symmetric_body_on_a_pivot();
  static_assert(top.is_top && !body.is_top && !body.spin_apart);
  expect_same_steps<2>(top, body);
  expect_same_steps<4>(top, body);
  expect_same_steps<6>(top, body);
}

TEST(Splitting, of_a_top_turns_by_any_angle) {
  const auto top = sample::symmetric_top();
  const auto body = sample::symmetric_body_on_a_pivot();
  for (const double scale : {0.0, 1.0, 1e2, 1e5}) {
    auto a = generic_state(top);
    a.momenta[0] = scale * a.momenta[0];
    hamotor::StateOf<std::remove_const_t<decltype(body)>> b{a.motors, a.momenta};
    Splitting2<std::remove_const_t<decltype(top)>>{}.do_step(top, a, 0, 0.7);
    Splitting2<std::remove_const_t<decltype(body)>>{}.do_step(body, b, 0, 0.7);
    EXPECT_LT(distance(a.motors[0], b.motors[0]), 1e-15 * (8 + scale)) << scale;
    EXPECT_LT(distance(a.momenta[0], b.momenta[0]), 1e-15 * (8 + scale) * (8 + scale)) << scale;
  }
}

TEST(Splitting, of_order_10_has_order_10) {
  const auto system = sample::forced_so3<long double>();
  auto state = generic_state(system);
  using System = std::remove_const_t<decltype(system)>;
  const auto after = [&](int steps) {
    auto end = state;
    hamotor::Splitting10<System> method;
    for (int k = 0; k < steps; ++k) {
      method.do_step(system, end, 0, 1 / static_cast<long double>(steps));
    }
    return end;
  };
  const auto reference = after(30);
  EXPECT_NEAR(std::log2(distance(after(5), reference) / distance(after(10), reference)), 10, 0.3);
}

TEST(Order, of_rkmk4_for_a_free_body_in_the_plane) {
  const auto system = sample::free_se2();
  EXPECT_NEAR(measured_order<Rkmk4<std::remove_const_t<decltype(system)>>>(system, 10), 4, 0.1);
}

/// One step of any length is the exact motion.
template <class System>
void expect_exact(const System& system) {
  const auto start = generic_state(system);
  const auto reference = stepped<Rkmk4<System>>(system, start, 1.0 / 4000, 4000);
  EXPECT_LT(distance(stepped<Splitting2<System>>(system, start, 1, 1), reference), 2e-12);
}

TEST(Splitting2, is_exact_for_a_symmetric_body) {
  expect_exact(hamotor::RigidBodies{std::tuple{sample::symmetric_body()}});
}

TEST(Splitting2, is_exact_for_a_spherical_body) {
  constexpr std::array<double, 3> moments{0.6, 0.6, 0.6};
  using Ball = hamotor::FreeBody<sample::SE3, double, hamotor::rotation_split(moments)>;
  expect_exact(hamotor::RigidBodies{std::tuple{Ball(1.3, moments)}});
}

TEST(Splitting2, is_exact_for_a_free_body_in_the_plane) { expect_exact(sample::free_se2()); }

template <class System>
void expect_reversible(const System& system) {
  const auto start = generic_state(system);
  Splitting2<System> method;
  auto state = start;
  for (int k = 0; k < 200; ++k) method.do_step(system, state, 0, 0.02);
  EXPECT_GT(distance(state, start), 0.1);
  for (int k = 0; k < 200; ++k) method.do_step(system, state, 0, -0.02);
  EXPECT_LT(distance(state, start), 1e-13);
}

template <class Method, class System>
void expect_returns(const System& system) {
  const auto start = generic_state(system);
  Method method;
  auto state = start;
  for (int k = 0; k < 50; ++k) method.do_step(system, state, 0, 0.05);
  EXPECT_GT(distance(state, start), 0.1);
  for (int k = 0; k < 50; ++k) method.do_step(system, state, 0, -0.05);
  EXPECT_LT(distance(state, start), 2e-13);
}

template <class System>
void expect_splittings_return(const System& system) {
  expect_returns<hamotor::Splitting4<System>>(system);
  expect_returns<hamotor::Splitting6<System>>(system);
  expect_returns<hamotor::Splitting8<System>>(system);
}

TEST(Splitting, is_time_reversible_to_rounding) {
  expect_splittings_return(sample::free_se3());
  expect_splittings_return(sample::forced_so3());
  expect_splittings_return(sample::forced_se2());
  expect_splittings_return(sample::symmetric_top());
  expect_splittings_return(sample::spinning_pendulum());
}

TEST(Splitting2, is_time_reversible_to_rounding) {
  expect_reversible(sample::free_se3());
  expect_reversible(sample::forced_so3());
  expect_reversible(sample::forced_se2());
  expect_reversible(sample::two_bodies_se2());
}

TEST(Splitting, is_symplectic_and_rkmk4_is_not) {
  using sample::Dual;
  const auto defect = [](const auto& system, auto order, double h) {
    using System = std::remove_cvref_t<decltype(system)>;
    return sample::symplectic_defect<hamotor::Splitting<System, order.value>>(system, h);
  };
  constexpr std::integral_constant<int, 2> two;
  constexpr std::integral_constant<int, 4> four;
  constexpr std::integral_constant<int, 6> six;
  constexpr std::integral_constant<int, 8> eight;
  EXPECT_LT(defect(sample::free_se3<Dual>(), two, 0.3), 1e-13);
  EXPECT_LT(defect(sample::forced_se3<Dual>(), two, 0.3), 1e-13);
  EXPECT_LT(defect(sample::forced_so3<Dual>(), two, 0.3), 1e-13);
  EXPECT_LT(defect(sample::forced_se2<Dual>(), two, 0.3), 1e-13);
  EXPECT_LT(defect(sample::free_so3<Dual>(), four, 0.7), 1e-13);
  EXPECT_LT(defect(sample::free_so3<Dual>(), six, 0.7), 1e-13);
  EXPECT_LT(defect(sample::nearly_symmetric_so3<Dual>(), four, 2), 1e-13);
  EXPECT_LT(defect(sample::symmetric_top<Dual>(), four, 0.7), 1e-13);
  EXPECT_LT(defect(sample::symmetric_top<Dual>(), six, 0.7), 1e-13);
  EXPECT_LT(defect(sample::symmetric_top<Dual>(), eight, 0.7), 1e-13);
  EXPECT_LT(defect(sample::spinning_pendulum<Dual>(), six, 0.7), 1e-13);
  const auto top = sample::forced_so3<Dual>();
  EXPECT_GT(sample::symplectic_defect<Rkmk4<std::remove_const_t<decltype(top)>>>(top, 0.3), 1e-6);
}

TEST(Splitting2, keeps_casimirs_and_the_spatial_momentum_to_rounding) {
  const auto system = sample::free_se3();
  const auto start = generic_state(system);
  const auto casimirs = [](const auto& mu) {
    return std::array{mu.p1 * mu.p1 + mu.p2 * mu.p2 + mu.p3 * mu.p3,
                      mu.p1 * mu.l23 + mu.p2 * mu.l31 + mu.p3 * mu.l12};
  };
  const auto end =
      stepped<Splitting2<std::remove_const_t<decltype(system)>>>(system, start, 0.1, 10000);
  const auto before = casimirs(start.momenta[0]);
  const auto after = casimirs(end.momenta[0]);
  EXPECT_NEAR(after[0], before[0], 2e-15);
  EXPECT_NEAR(after[1], before[1], 2e-15);
  const auto p = spatial_momentum(start).components();
  const auto q = spatial_momentum(end).components();
  for (std::size_t k = 3; k < 6; ++k) EXPECT_NEAR(p[k], q[k], 2e-14);
}

template <class Method, class System>
double lost_momentum(const System& system, double h, int steps) {
  const auto start = generic_state(system);
  return distance(spatial_momentum(stepped<Method>(system, start, h, steps)),
                  spatial_momentum(start));
}

TEST(Splitting2, keeps_the_total_spatial_momentum_of_two_bodies) {
  const auto space = sample::two_bodies_se3();
  EXPECT_LT(lost_momentum<Splitting2<std::remove_const_t<decltype(space)>>>(space, 0.02, 5000),
            1e-12);
  const auto plane = sample::two_bodies_se2();
  EXPECT_LT(lost_momentum<Splitting2<std::remove_const_t<decltype(plane)>>>(plane, 0.02, 5000),
            1e-12);
}

TEST(Rkmk4, keeps_the_total_spatial_momentum_to_its_order) {
  const auto system = sample::two_bodies_se3();
  using Method = Rkmk4<std::remove_const_t<decltype(system)>>;
  EXPECT_LT(lost_momentum<Method>(system, 0.002, 500), 1e-9);
}

/// MuJoCo's own conservation test: a uniform box 0.1 × 0.2 × 0.3 m of 1 kg turning at (1, 2, 3)
/// rad/s, in steps of 0.01 s.
struct Tumble {
  static constexpr std::array<double, 3> moments{13e-2 / 12, 10e-2 / 12, 5e-2 / 12};
  static constexpr hamotor::RigidBodies system{std::tuple{
      hamotor::FreeBody<sample::SE3, double, hamotor::rotation_split(moments)>(1, moments)}};
  using System = std::remove_const_t<decltype(system)>;
  static auto start() {
    hamotor::StateOf<System> state{};
    state.motors[0] = hamotor::pga3::Motor<double>::identity();
    state.momenta[0] = {moments[0], 2 * moments[1], 3 * moments[2], 0, 0, 0};
    return state;
  }
};

/// Least-squares line through equally spaced values: its rise from first to last, with the standard
/// error of that.
struct Trend {
  double rise;
  double error;

  static Trend of(const std::vector<double>& y) {
    const auto n = static_cast<double>(y.size());
    double mean = 0;
    for (const double value : y) mean += value / n;
    double xx = 0;
    double xy = 0;
    for (std::size_t k = 0; k < y.size(); ++k) {
      const double x = static_cast<double>(k) / (n - 1) - 0.5;
      xx += x * x;
      xy += x * (y[k] - mean);
    }
    const double rise = xy / xx;
    double rest = 0;
    for (std::size_t k = 0; k < y.size(); ++k) {
      const double x = static_cast<double>(k) / (n - 1) - 0.5;
      rest += (y[k] - mean - rise * x) * (y[k] - mean - rise * x);
    }
    return {rise, std::sqrt(rest / (n - 2) / xx)};
  }
};

TEST(Tumble, million_steps_bound_the_energy_error_and_keep_the_angular_momentum) {
  auto state = Tumble::start();
  const double energy = Tumble::system.energy(state);
  const auto momentum = spatial_momentum(state);
  const auto norm = [](const auto& mu) { return std::hypot(mu.l23, mu.l31, mu.l12); };
  Splitting2<Tumble::System> method;
  constexpr int blocks = 200;
  constexpr int per_block = 5000;
  std::vector<double> means;
  double worst = 0;
  double lost = 0;
  for (int block = 0; block < blocks; ++block) {
    double mean = 0;
    for (int k = 0; k < per_block; ++k) {
      method.do_step(Tumble::system, state, 0, 0.01);
      const double error = Tumble::system.energy(state) / energy - 1;
      worst = std::max(worst, std::abs(error));
      mean += error / per_block;
    }
    means.push_back(mean);
    lost = std::max(lost, norm(spatial_momentum(state) - momentum) / norm(momentum));
  }
  const Trend trend = Trend::of(means);
  RecordProperty("energy_error", std::to_string(worst));
  EXPECT_LT(worst, 1e-5);
  EXPECT_LT(std::abs(trend.rise), 4 * trend.error + 1e-12)
      << trend.rise << " +- " << trend.error << " over a million steps";
  EXPECT_LT(trend.error, 1e-8);
  EXPECT_LT(lost, 5e-14);
  EXPECT_LT(std::abs(norm(state.momenta[0]) / norm(momentum) - 1), 1e-14);
  EXPECT_LT(method.drift().largest, 2e-17) << "a step rounds its change, not the motor";
  EXPECT_LT(method.drift().sum, 1e-11);
}

TEST(Drift, shows_what_renormalisation_had_to_correct) {
  const auto system = sample::forced_se3();
  using System = std::remove_const_t<decltype(system)>;
  auto state = generic_state(system);
  state.motors[0] = (1 + 1e-6) * state.motors[0];
  state.motors[0].e0123 += 3e-6;
  const auto defect = unit_defect(state.motors[0]);
  Rkmk4<System> rkmk4;
  Splitting2<System> splitting2;
  auto other = state;
  rkmk4.do_step(system, state, 0, 1e-3);
  splitting2.do_step(system, other, 0, 1e-3);
  const double expected = std::max(std::abs(defect.s), std::abs(defect.e0123));
  for (const auto& drift : {rkmk4.drift(), splitting2.drift()}) {
    EXPECT_NEAR(drift.largest, expected, 1e-10);
    EXPECT_EQ(drift.sum, drift.largest);
  }
  for (const auto& corrected : {state, other}) {
    const auto left = unit_defect(corrected.motors[0]);
    EXPECT_LT(std::abs(left.s), 5e-11);
    EXPECT_LT(std::abs(left.e0123), 5e-11);
  }
}

TEST(Drift, is_known_to_far_less_than_a_rounding_of_the_motor) {
  using Wide = long double;
  constexpr sample::SE3::Rate<double> rate{0.3, -0.7, 0.2, 1.1, 0.4, -0.9};
  for (int k = 0; k < 50; ++k) {
    const auto hi = exp((0.1 * k) * rate);
    const auto low = (1e-17 * (k % 7 - 3)) * hi + 2e-17 * reverse(hi);
    const auto wide = [&](double a, double b) { return static_cast<Wide>(a) + b; };
    const Wide s = wide(hi.s, low.s), i = wide(hi.e0123, low.e0123);
    const Wide r[]{wide(hi.e23, low.e23), wide(hi.e31, low.e31), wide(hi.e12, low.e12)};
    const Wide t[]{wide(hi.e01, low.e01), wide(hi.e02, low.e02), wide(hi.e03, low.e03)};
    const Wide scalar = s * s + r[0] * r[0] + r[1] * r[1] + r[2] * r[2] - 1;
    const Wide pseudoscalar = 2 * (s * i - r[0] * t[0] - r[1] * t[1] - r[2] * t[2]);
    const auto defect = unit_defect(hi) + unit_defect_change(hi, low);
    EXPECT_NEAR(defect.s, static_cast<double>(scalar), 1e-18);
    EXPECT_NEAR(defect.e0123, static_cast<double>(pseudoscalar), 1e-18);
  }
}

TEST(Drift, correction_is_the_groups_own_normalisation) {
  auto motor = generic_state(sample::free_se3()).motors[0];
  motor.s *= 1 + 1e-9;
  motor.e0123 += 1e-9;
  const auto corrected = motor + unit_correction(motor, unit_defect(motor));
  EXPECT_LT(distance(corrected, normalize(motor)), 4e-16);
}

template <class S>
void expect_same_motion_as_double(double tolerance) {
  const auto system = sample::two_bodies_se3();
  const auto same = sample::two_bodies_se3<S>();
  using System = std::remove_const_t<decltype(system)>;
  using Same = std::remove_const_t<decltype(same)>;
  const auto start = generic_state(system);
  const auto expected = stepped<Splitting2<System>>(system, start, 0.01, 200);
  const auto got = stepped<Splitting2<Same>>(same, generic_state(same), 0.01, 200);
  const auto fourth = stepped<Rkmk4<Same>>(same, generic_state(same), 0.01, 200);
  const auto expected_fourth = stepped<Rkmk4<System>>(system, start, 0.01, 200);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT(distance(got.motors[i].template cast<double>(), expected.motors[i]), tolerance);
    EXPECT_LT(distance(fourth.momenta[i].template cast<double>(), expected_fourth.momenta[i]),
              tolerance);
  }
}

TEST(Scalars, float_and_long_double_move_alike) {
  expect_same_motion_as_double<float>(2e-5);
  expect_same_motion_as_double<long double>(1e-13);
}

TEST(Splitting2, evaluates_the_forque_anew_when_the_state_was_changed_between_steps) {
  const auto system = sample::forced_se3();
  using Method = Splitting2<std::remove_const_t<decltype(system)>, Summation::plain>;
  Method used;
  auto state = generic_state(system);
  used.do_step(system, state, 0, 0.01);
  state.motors[0] = gp(state.motors[0], state.motors[0]);
  auto fresh_state = state;
  used.do_step(system, state, 0, 0.01);
  Method fresh;
  fresh.do_step(system, fresh_state, 0, 0.01);
  EXPECT_EQ(state, fresh_state);
}

}  // namespace
