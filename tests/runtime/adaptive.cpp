// Laws of the explicit pair 5(4): order, its estimate, and steps that meet a tolerance.
#include "hamotor/adaptive.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <type_traits>

#include "sample_systems.hpp"

namespace {

using hamotor::Adaptive;
using hamotor::Rkmk54;
using sample::distance;
using sample::generic_state;
using Wide = long double;

template <class System>
using Of = std::remove_const_t<System>;

template <class System>
auto stepped(const System& system, int steps) {
  using S = typename System::Scalar;
  auto state = generic_state(system);
  Rkmk54<System> method;
  for (int k = 0; k < steps; ++k) method.do_step(system, state, 0, 1 / S(steps));
  return state;
}

template <class System>
void expect_order_5(const System& system, int coarse) {
  const auto reference = stepped(system, 16 * coarse);
  const double fine = distance(stepped(system, 2 * coarse), reference);
  EXPECT_NEAR(std::log2(distance(stepped(system, coarse), reference) / fine), 5, 0.1);
}

TEST(Rkmk54, has_order_5) {
  expect_order_5(sample::free_se3<Wide>(), 80);
  expect_order_5(sample::free_so3<Wide>(), 40);
  expect_order_5(sample::forced_se3<Wide>(), 160);
  expect_order_5(sample::forced_so3<Wide>(), 80);
  expect_order_5(sample::forced_se2<Wide>(), 160);
  expect_order_5(sample::two_bodies_se3<Wide>(), 160);
}

TEST(Rkmk54, estimates_an_error_of_fifth_order_in_the_step) {
  const auto system = sample::forced_se3<Wide>();
  const auto estimate = [&](Wide h) {
    auto state = generic_state(system);
    Rkmk54<Of<decltype(system)>> method;
    method.do_step(system, state, 0, h);
    return static_cast<double>(method.error());
  };
  EXPECT_NEAR(std::log2(estimate(0.002L) / estimate(0.001L)), 5, 0.1);
}

template <class System>
void expect_tolerance_met(const System& system) {
  const auto reference = stepped(system, 4000);
  double before = 1;
  long long tried_before = 0;
  for (const double tolerance : {1e-5, 1e-7, 1e-9}) {
    auto state = generic_state(system);
    Adaptive<System> method(tolerance);
    for (int k = 0; k < 5; ++k) method.do_step(system, state, 0.2 * k, 0.2);
    const double error = distance(state, reference);
    EXPECT_LT(error, 10 * tolerance);
    EXPECT_LT(error, before);
    EXPECT_GT(method.tried(), tried_before);
    before = error;
    tried_before = method.tried();
  }
}

TEST(Adaptive, errors_follow_the_tolerance) {
  expect_tolerance_met(sample::forced_se3());
  expect_tolerance_met(sample::forced_so3());
  expect_tolerance_met(sample::two_bodies_se2());
}

TEST(Adaptive, is_the_method_itself_without_a_tolerance) {
  const auto system = sample::forced_se3();
  using System = Of<decltype(system)>;
  static_assert(hamotor::ErrorControlled<Adaptive<System>, double>);
  static_assert(!hamotor::ErrorControlled<Rkmk54<System>, double>);
  auto one = generic_state(system);
  auto other = one;
  Adaptive<System> method;
  Rkmk54<System> plain;
  for (int k = 0; k < 3; ++k) {
    method.do_step(system, one, 0.1 * k, 0.1);
    plain.do_step(system, other, 0.1 * k, 0.1);
  }
  EXPECT_EQ(one, other);
  EXPECT_EQ(method.steps(), 3);
}

TEST(Adaptive, remembers_its_step_from_call_to_call) {
  const auto system = sample::forced_se3();
  Adaptive<Of<decltype(system)>> method(1e-9);
  auto state = generic_state(system);
  method.do_step(system, state, 0, 1);
  const long long taken = method.steps();
  const long long refused = method.tried() - taken;
  method.do_step(system, state, 1, 1);
  EXPECT_GT(taken, 10);
  EXPECT_LE(method.tried() - method.steps(), refused + 2);
  EXPECT_NEAR(static_cast<double>(method.steps()), 2.0 * static_cast<double>(taken),
              0.3 * static_cast<double>(taken));
}

TEST(Adaptive, runs_backwards) {
  const auto system = sample::forced_se3();
  const auto start = generic_state(system);
  auto state = start;
  Adaptive<Of<decltype(system)>> method(1e-11);
  method.do_step(system, state, 0, 1);
  EXPECT_GT(distance(state, start), 0.1);
  method.do_step(system, state, 1, -1);
  EXPECT_LT(distance(state, start), 1e-9);
}

TEST(Adaptive, gives_no_number_for_a_tolerance_below_rounding) {
  const auto system = sample::forced_se3();
  auto state = generic_state(system);
  Adaptive<Of<decltype(system)>> method(1e-25);
  method.do_step(system, state, 0, 1);
  EXPECT_TRUE(std::isnan(state.momenta[0].l23));
  EXPECT_EQ(method.failure(), hamotor::Failure::step_too_short);
}

}  // namespace
