// Laws of the discrete Moser–Veselov steps: order, symplecticity, reversal, momenta, failure.
#include "hamotor/moser_veselov.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <type_traits>

#include "hamotor/gauss.hpp"
#include "sample_systems.hpp"
#include "symplecticity.hpp"

namespace {

using hamotor::Failure;
using hamotor::MoserVeselov;
using sample::distance;
using sample::generic_state;
using sample::spatial_momentum;
using sample::stepped;
using Wide = long double;

template <class System>
using Of = std::remove_const_t<System>;

template <int order, class System>
void expect_order(const System& system, int coarse) {
  const auto start = generic_state(system);
  const Wide end(4);
  const auto reference = stepped<hamotor::ClosedForm<System>>(system, start, end, 1);
  const auto error = [&](int steps) {
    return distance(stepped<MoserVeselov<System, order>>(system, start, end / Wide(steps), steps),
                    reference);
  };
  const double fine = error(2 * coarse);
  EXPECT_GT(fine, 1e-17) << "nothing to measure";
  EXPECT_NEAR(std::log2(error(coarse) / fine), order, 0.1);
}

template <class System>
void expect_orders(const System& system, int coarse_at_10) {
  expect_order<2>(system, 40);
  expect_order<4>(system, 40);
  expect_order<6>(system, 40);
  expect_order<8>(system, 30);
  expect_order<10>(system, coarse_at_10);
}

TEST(MoserVeselov, has_its_order_on_the_whole_state_of_free_bodies) {
  expect_orders(sample::free_so3<Wide>(), 12);
  expect_orders(sample::free_se3<Wide>(), 24);
}

TEST(MoserVeselov, has_order_2_with_forces) {
  const auto check = [](const auto& system) {
    using System = std::remove_cvref_t<decltype(system)>;
    const auto start = generic_state(system);
    const auto after = [&](auto method, int steps) {
      return stepped<decltype(method)>(system, start, Wide(0.5) / steps, steps);
    };
    const auto reference = after(hamotor::Gauss8<System>{}, 40);
    const double coarse = distance(after(MoserVeselov<System, 2>{}, 40), reference);
    EXPECT_NEAR(std::log2(coarse / distance(after(MoserVeselov<System, 2>{}, 80), reference)), 2,
                0.1);
  };
  check(sample::forced_so3<Wide>());
  check(sample::forced_se3<Wide>());
  check(sample::forced_se2<Wide>());
  check(sample::two_bodies_se3<Wide>());
}

TEST(MoserVeselov, is_symplectic_at_order_2_only) {
  const auto defect = [](const auto& system, auto order) {
    using System = std::remove_cvref_t<decltype(system)>;
    return sample::symplectic_defect<MoserVeselov<System, order.value>>(system, 0.4);
  };
  using std::integral_constant;
  EXPECT_LT(defect(sample::forced_so3<sample::Dual>(), integral_constant<int, 2>{}), 1e-12);
  EXPECT_LT(defect(sample::forced_se3<sample::Dual>(), integral_constant<int, 2>{}), 1e-12);
  EXPECT_LT(defect(sample::free_so3<sample::Dual>(), integral_constant<int, 2>{}), 1e-12);
  EXPECT_GT(defect(sample::free_so3<sample::Dual>(), integral_constant<int, 4>{}), 1e-6);
}

TEST(MoserVeselov, of_order_10_meets_the_published_errors) {
  // Hairer & Vilmart 2006: 3.7e-12 with 100 steps.
  using Body = hamotor::PivotedBody<sample::SO3, double>;
  const hamotor::RigidBodies system{std::tuple{Body(1, {0.6, 0.8, 1}, {0, 0, 0}, {0, 0, 0})}};
  using System = Of<decltype(system)>;
  System::State start{};
  start.motors[0].s = 1;
  start.momenta[0] = {1.8, 0.4, -0.9};
  const System::State::Element reference{-0.73606136416079393616, 0.57078695124035073325,
                                         0.29938857183079009374, 0.20683908610467319248};
  const auto error = [&](int steps) {
    const auto end = stepped<MoserVeselov<System, 10>>(system, start, 10.0 / steps, steps);
    return distance(end.motors[0], reference);
  };
  EXPECT_NEAR(error(100), 3.7e-12, 0.1e-12);
  EXPECT_LT(error(200), 1e-14);
}

TEST(MoserVeselov, returns_in_reversed_time) {
  const auto check = [](const auto& system, auto order) {
    using System = std::remove_cvref_t<decltype(system)>;
    using Method = MoserVeselov<System, order.value>;
    const auto start = generic_state(system);
    const auto there = stepped<Method>(system, start, 0.05, 100);
    EXPECT_GT(distance(there, start), 0.1);
    EXPECT_LT(distance(stepped<Method>(system, there, -0.05, 100), start), 2e-13);
  };
  check(sample::two_bodies_se3(), std::integral_constant<int, 2>{});
  check(sample::free_se3(), std::integral_constant<int, 6>{});
  check(sample::free_so3(), std::integral_constant<int, 10>{});
}

TEST(MoserVeselov, keeps_spatial_momentum_and_energy) {
  const auto free = sample::free_so3();
  auto state = generic_state(free);
  const auto start = state;
  const double before = free.energy(start);
  MoserVeselov<Of<decltype(free)>, 10> method;
  double worst = 0;
  for (int k = 0; k < 20000; ++k) {
    method.do_step(free, state, 0, 0.05);
    worst = std::max(worst, std::abs(free.energy(state) / before - 1));
  }
  EXPECT_LT(distance(spatial_momentum(state), spatial_momentum(start)), 2e-14);
  EXPECT_LT(worst, 1e-13);
  const auto two = sample::two_bodies_se3();
  const auto begin = generic_state(two);
  const auto end = stepped<MoserVeselov<Of<decltype(two)>, 2>>(two, begin, 0.05, 1000);
  EXPECT_LT(distance(spatial_momentum(end), spatial_momentum(begin)), 1e-12);
}

TEST(MoserVeselov, keeps_the_digits_of_a_needles_spin) {
  const hamotor::RigidBodies system{std::tuple{
      hamotor::PivotedBody<sample::SO3, double>(1, {1, 1.000000005, 1e-8}, {0, 0, 0}, {0, 0, 0})}};
  using System = Of<decltype(system)>;
  System::State start{};
  start.motors[0].s = 1;
  start.momenta[0] = {1, 0.5, 2e-8};
  const auto exact = stepped<hamotor::ClosedForm<System>>(system, start, 20, 1);
  const auto check = [&](auto order, double bound) {
    using Method = MoserVeselov<System, order.value>;
    const auto there = stepped<Method>(system, start, 0.02, 1000);
    EXPECT_LT(distance(there, exact), bound) << order.value;
    EXPECT_LT(distance(stepped<Method>(system, there, -0.02, 1000), start), 1e-13) << order.value;
  };
  check(std::integral_constant<int, 2>{}, 0.05);
  check(std::integral_constant<int, 6>{}, 1e-8);
  check(std::integral_constant<int, 10>{}, 1e-8);
}

template <class Method, class System>
void expect_to_start_anew(const System& system, const hamotor::StateOf<System>& changed) {
  auto state = generic_state(system);
  Method method;
  for (int k = 0; k < 5; ++k) method.do_step(system, state, 0, 0.1);
  state = changed;
  for (int steps = 1; steps < 4; ++steps) {
    method.do_step(system, state, 0, 0.1);
    EXPECT_EQ(state, stepped<Method>(system, changed, 0.1, steps)) << Method::name << ' ' << steps;
  }
}

TEST(MoserVeselov, of_a_changed_state_has_the_bits_of_a_new_stepper) {
  const auto check = [](const auto& system, auto order) {
    using Method = MoserVeselov<std::remove_cvref_t<decltype(system)>, order.value>;
    auto changed = stepped<Method>(system, generic_state(system), 0.1, 3);
    expect_to_start_anew<Method>(system, changed);
    changed.motors[0] = -changed.motors[0];
    expect_to_start_anew<Method>(system, changed);
    for (const double by : {1.5, -0.2, 1e-3}) {
      changed.momenta[0] = by * changed.momenta[0];
      expect_to_start_anew<Method>(system, changed);
    }
  };
  using std::integral_constant;
  check(sample::free_so3(), integral_constant<int, 2>{});
  check(sample::free_so3(), integral_constant<int, 4>{});
  check(sample::free_se3(), integral_constant<int, 6>{});
  check(sample::free_se2(), integral_constant<int, 8>{});
  check(sample::free_so3(), integral_constant<int, 10>{});
  check(sample::forced_so3(), integral_constant<int, 2>{});
  check(sample::forced_se3(), integral_constant<int, 2>{});
  check(sample::two_bodies_se2(), integral_constant<int, 2>{});
}

TEST(MoserVeselov, of_another_state_goes_on_where_a_step_failed) {
  const auto system = sample::free_so3();
  using Method = MoserVeselov<Of<decltype(system)>, 6>;
  const auto start = generic_state(system);
  auto state = start;
  Method method;
  method.do_step(system, state, 0, 100);
  EXPECT_EQ(method.failure(), Failure::no_convergence);
  state = start;
  method.do_step(system, state, 0, 0.1);
  EXPECT_EQ(method.failure(), Failure::none);
  EXPECT_EQ(state, stepped<Method>(system, start, 0.1, 1));
}

TEST(MoserVeselov, stays_where_it_is_in_no_time) {
  const auto check = [](const auto& system, auto order) {
    using Method = MoserVeselov<std::remove_cvref_t<decltype(system)>, order.value>;
    const auto start = generic_state(system);
    EXPECT_EQ(stepped<Method>(system, start, 0, 3), start);
    auto state = start;
    Method method;
    for (const double h : {0.1, 0.0, 0.1, 0.0, 0.1}) method.do_step(system, state, 0, h);
    EXPECT_EQ(method.failure(), Failure::none);
    EXPECT_EQ(state, stepped<Method>(system, start, 0.1, 3));
  };
  check(sample::free_so3(), std::integral_constant<int, 10>{});
  check(sample::forced_se3(), std::integral_constant<int, 2>{});
  check(sample::free_se2(), std::integral_constant<int, 4>{});
}

TEST(MoserVeselov, says_where_a_step_turns_too_far) {
  const auto system = sample::free_so3();
  auto state = generic_state(system);
  MoserVeselov<Of<decltype(system)>, 2> method;
  method.do_step(system, state, 0, 1);
  EXPECT_EQ(method.failure(), Failure::none);
  method.do_step(system, state, 1, 100);
  EXPECT_EQ(method.failure(), Failure::no_convergence);
  EXPECT_TRUE(std::isnan(state.momenta[0].l23));
}

TEST(MoserVeselov, of_symmetric_and_spherical_bodies_and_bodies_at_rest) {
  for (const std::array<double, 3> moments :
       {std::array{2.0, 2.0, 2.0}, {2.0, 2.0, 3.0}, {1.0, 2.0, 2.0}, {1.0, 1.0, 1e-4}}) {
    for (const double size : {1e-200, 1e-8, 1.0, 0.0}) {
      const hamotor::RigidBodies system{
          std::tuple{hamotor::PivotedBody<sample::SO3, double>(1, moments, {0, 0, 0}, {0, 0, 0})}};
      using System = Of<decltype(system)>;
      System::State start{};
      start.motors[0].s = 1;
      start.momenta[0] = {0.3 * size, -0.5 * size, 7e-5 * size};
      const auto exact = stepped<hamotor::ClosedForm<System>>(system, start, 0.5, 1);
      EXPECT_LT(distance(stepped<MoserVeselov<System, 10>>(system, start, 0.01, 50), exact), 2e-15);
    }
  }
}

}  // namespace
