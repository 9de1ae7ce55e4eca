// Events: which crossings count, and when they are, by parts of a step and by dense output.
#include "hamotor/events.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "hamotor/adaptive.hpp"
#include "hamotor/gauss.hpp"
#include "hamotor/steppers.hpp"
#include "sample_systems.hpp"

namespace {

using hamotor::crosses;
using hamotor::Crossing;
using hamotor::locate;

TEST(Events, count_crossings_in_their_direction_once) {
  EXPECT_TRUE(crosses(Crossing::both, -1.0, 1.0));
  EXPECT_TRUE(crosses(Crossing::rising, -1.0, 0.0));
  EXPECT_FALSE(crosses(Crossing::rising, 0.0, 1.0)) << "the step before has ended in it";
  EXPECT_FALSE(crosses(Crossing::rising, 1.0, -1.0));
  EXPECT_TRUE(crosses(Crossing::falling, 1.0, -1.0));
  EXPECT_FALSE(crosses(Crossing::both, 1.0, 2.0));
  EXPECT_FALSE(crosses(Crossing::both, -1.0, std::nan("")));
}

/// A plate that spins in its place.
template <class Method, class System>
void expect_found(const System& system, Method method, double direction) {
  auto state = sample::generic_state(system);
  state.motors[0] = {1, 0, 0, 0};
  state.momenta[0] = {0.2, 0, 0};
  const double rate = state.momenta[0].l12 / 0.3;
  const double h = direction * 1.5 * std::numbers::pi / std::abs(rate);
  int evaluations = 0;
  const auto turned = [&](const auto& there, double) {
    ++evaluations;
    return there.motors[0].s - std::cos(0.5);
  };
  const auto end = hamotor::part_of_step(system, method, state, 0.0, h);
  const double part =
      locate(system, method, state, 0.0, h, turned, turned(state, 0.0), turned(end, h));
  EXPECT_NEAR(part, direction / std::abs(rate), 1e-12) << Method::name;
  EXPECT_LT(evaluations, 20);
}

TEST(Events, are_found_to_rounding_by_parts_of_a_step) {
  const auto system = sample::free_se2();
  using System = std::remove_const_t<decltype(system)>;
  for (const double direction : {1.0, -1.0}) {
    expect_found(system, hamotor::Splitting2<System>{}, direction);
    expect_found(system, hamotor::Gauss8<System>{}, direction);
    expect_found(system, hamotor::Adaptive<System>(1e-14), direction);
  }
}

TEST(Events, are_found_where_a_function_jumps_or_is_flat) {
  const auto system = sample::free_se2();
  using System = std::remove_const_t<decltype(system)>;
  const auto state = sample::generic_state(system);
  const hamotor::Splitting2<System> method{};
  const auto jump = [](const auto&, double t) { return t < 0.7 ? -1.0 : 1e9; };
  EXPECT_NEAR(locate(system, method, state, 0.0, 1.0, jump, -1.0, 1e9), 0.7, 1e-15);
  const auto flat = [](const auto&, double t) { return std::pow(t - 0.7, 9); };
  EXPECT_NEAR(locate(system, method, state, 0.0, 1.0, flat, flat(0, 0.0), flat(0, 1.0)), 0.7,
              1e-12);
  const double late = locate(
      system, method, state, 1e6, 1.0, [](const auto&, double t) { return t - (1e6 + 0.3); }, -0.3,
      0.7);
  EXPECT_NEAR(late, 0.3, 1e-9) << "times have no more digits there";
}

}  // namespace
