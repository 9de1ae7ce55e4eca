// Scenes of every group through the compiled scene's interface, and numbers that are not finite.
#include "hamotor/scene_abi.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "sample_systems.hpp"

namespace {

using hamotor::Conserved;
using hamotor::Quantity;
using hamotor::scene::Run;

/// A top whose frame is turned against its principal frame.
struct TurnedTop {
  using Group = sample::SO3;
  using Scalar = double;
  static constexpr std::string_view name = "turned_top";
  static constexpr std::string_view kernels = "generated";
  static constexpr std::array<std::string_view, 1> bodies{"top"};
  static constexpr std::array<Group::Element<Scalar>, 1> frames{{{0.8, 0, -0.6, 0}}};
  static constexpr auto system = sample::forced_so3();
  static constexpr std::array<Conserved<Group>, 1> conserved{
      {{.quantity = Quantity::energy, .name = "energy", .unit = "J", .description = "\"H\""}}};
};

struct TwoPlates {
  using Group = sample::SE2;
  using Scalar = float;
  static constexpr std::string_view name = "two_plates";
  static constexpr std::string_view kernels = "generated";
  static constexpr std::array<std::string_view, 2> bodies{"left", "right"};
  static constexpr std::array<Group::Element<Scalar>, 2> frames{{{1, 0, 0.5F, 0}, {1, 0, 0, 0}}};
  static constexpr auto system = sample::two_bodies_se2<float>();
  static constexpr std::array<Conserved<Group>, 3> conserved{
      {{.quantity = Quantity::spatial_momentum,
        .name = "spatial_momentum.e01",
        .unit = "kg m/s",
        .description = "",
        .coefficients = {0, 1, 0}},
       {.quantity = Quantity::spatial_momentum,
        .name = "spatial_momentum.e12_about_axis",
        .unit = "kg m^2/s",
        .description = "",
        .coefficients = {1, 2, -3}},
       {.quantity = Quantity::p_squared,
        .name = "right.casimir.p_squared",
        .unit = "",
        .description = "",
        .body = 1}}};
};

struct FreeBodies {
  using Group = sample::SE3;
  using Scalar = long double;
  static constexpr std::string_view name = "free_bodies";
  static constexpr std::string_view kernels = "generated";
  static constexpr std::array<std::string_view, 2> bodies{"a", "b"};
  static constexpr std::array<Group::Element<Scalar>, 2> frames{
      {Group::Element<Scalar>::identity(), Group::Element<Scalar>::identity()}};
  static constexpr hamotor::RigidBodies system{
      std::tuple{sample::body<long double>(), sample::symmetric_body<long double>()}};
  static constexpr std::array<Conserved<Group>, 2> conserved{{{.quantity = Quantity::p_squared,
                                                               .name = "a.casimir.p_squared",
                                                               .unit = "",
                                                               .description = "",
                                                               .body = 0},
                                                              {.quantity = Quantity::p_dot_pi,
                                                               .name = "b.casimir.p_dot_pi",
                                                               .unit = "",
                                                               .description = "",
                                                               .body = 1}}};
};

template <class Scene>
Run<Scene> start(const char* method, const std::vector<double>& state, double step = 0.01) {
  typename hamotor::scene::MethodsOf<Scene>::AnyOf chosen;
  EXPECT_TRUE(hamotor::scene::MethodsOf<Scene>::choose(method, chosen));
  return Run<Scene>(chosen, 0, step, state.data());
}

template <class Scene>
std::vector<double> row(const Run<Scene>& run) {
  std::vector<double> result(hamotor::scene::columns<Scene>());
  run.observe(result.data());
  return result;
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

template <class Scene>
void expect_described() {
  const std::string text = hamotor::scene::description<Scene>();
  EXPECT_EQ(count(text, "\"unit\""), hamotor::scene::columns<Scene>());
  EXPECT_EQ(count(text, "{"), count(text, "}"));
  EXPECT_EQ(count(text, "\"scale\""), Scene::conserved.size());
}

TEST(SceneAbi, describes_as_many_columns_as_it_writes) {
  expect_described<TurnedTop>();
  expect_described<TwoPlates>();
  expect_described<FreeBodies>();
  EXPECT_EQ(hamotor::scene::columns<TurnedTop>(), 1U + 4 + 3 + 3 + 1 + 3);
  EXPECT_EQ(hamotor::scene::columns<TwoPlates>(), 1U + 2 * (4 + 3 + 2) + 1 + 3 + 2);
  EXPECT_EQ(count(hamotor::scene::description<TurnedTop>(), R"(\"H\")"), 1U);
}

TEST(SceneAbi, a_body_with_a_fixed_point_stays_there_and_turns_in_its_own_frame) {
  const std::vector<double> state{0.8, 0, 0, -0.6, 0.1, 0.2, 0.3};
  auto run = start<TurnedTop>("splitting2", state);
  EXPECT_EQ(run.advance(100, 1, nullptr), 100);
  const auto now = row(run);
  EXPECT_DOUBLE_EQ(now[0], 1.0);
  EXPECT_EQ((std::array{now[8], now[9], now[10]}), (std::array{0.3, -0.4, 0.2}));
  std::vector<double> back(7);
  run.read_state(back.data());
  for (std::size_t k = 0; k < 7; ++k) EXPECT_EQ(back[k], now[1 + k]);
  auto again = start<TurnedTop>("splitting2", back, -0.01);
  EXPECT_EQ(again.advance(100, 1, nullptr), 100);
  again.read_state(back.data());
  for (std::size_t k = 0; k < 7; ++k) EXPECT_NEAR(back[k], state[k], 1e-13);
}

TEST(SceneAbi, momenta_and_their_combinations_are_totals_over_the_bodies) {
  const std::vector<double> state{1, 0, -0.5, 0.25, 0.1, 0.2, 0.3, 1, 0, 0, -1, 0.4, 0.5, 0.6};
  const auto now = row(start<TwoPlates>("rkmk4", state));
  const std::size_t energy = 1 + 2 * 9;
  EXPECT_FLOAT_EQ(static_cast<float>(now[8]), 1.0F);  // where the frames are
  EXPECT_FLOAT_EQ(static_cast<float>(now[9]), -0.5F);
  EXPECT_FLOAT_EQ(static_cast<float>(now[18]), 2.0F);
  const double l = 0.1 + (1 * 0.3 - -0.5 * 0.2) + 0.4 + (0 * 0.6 - 2 * 0.5);
  EXPECT_NEAR(now[energy + 1], l, 1e-6);
  EXPECT_NEAR(now[energy + 2], 0.7, 1e-6);
  EXPECT_NEAR(now[energy + 3], 0.9, 1e-6);
  EXPECT_NEAR(now[energy + 4], l + 2 * 0.7 - 3 * 0.9, 1e-6);
  EXPECT_NEAR(now[energy + 5], 0.25 + 0.36, 1e-6);
}

TEST(SceneAbi, casimirs_are_those_of_their_bodies) {
  std::vector<double> state(28, 0);
  state[0] = state[14] = 1;
  const std::array<double, 6> mu{0.1, 0.2, 0.3, 1, 2, 3};
  std::copy(mu.begin(), mu.end(), state.begin() + 8);
  std::copy(mu.rbegin(), mu.rend(), state.begin() + 22);
  const auto now = row(start<FreeBodies>("splitting2", state));
  EXPECT_DOUBLE_EQ(now[now.size() - 2], 14);
  EXPECT_DOUBLE_EQ(now.back(), 0.3 * 3 + 0.2 * 2 + 0.1 * 1);
}

TEST(SceneAbi, a_run_that_fails_stays_at_its_last_finite_state) {
  std::vector<double> state{1, 0, 0, 0, 1e308, 0, 0};
  auto run = start<TurnedTop>("rkmk4", state, 1);
  std::vector<double> rows(hamotor::scene::columns<TurnedTop>() * 10, 7.0);
  const auto done = run.advance(10, 1, rows.data());
  ASSERT_LT(done, 10);
  EXPECT_EQ(rows[static_cast<std::size_t>(done) * hamotor::scene::columns<TurnedTop>()], 7.0);
  EXPECT_EQ(row(run)[0], static_cast<double>(done));
  EXPECT_EQ(run.advance(1, 1, rows.data()), 0);
  std::vector<double> last(7);
  run.read_state(last.data());
  for (const double x : last) EXPECT_TRUE(std::isfinite(x));
}

TEST(SceneAbi, sees_every_number_that_is_not_finite) {
  auto state = sample::generic_state(sample::two_bodies_se3());
  EXPECT_TRUE(hamotor::scene::is_finite(state));
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity()}) {
    for (std::size_t i = 0; i < 2; ++i) {
      for (std::size_t k = 0; k < 8; ++k) {
        auto broken = state;
        auto motor = broken.motors[i].components();
        motor[k] = bad;
        broken.motors[i] = hamotor::pga3::Motor<double>::from(motor);
        EXPECT_FALSE(hamotor::scene::is_finite(broken));
      }
      for (std::size_t k = 0; k < 6; ++k) {
        auto broken = state;
        auto momentum = broken.momenta[i].components();
        momentum[k] = bad;
        broken.momenta[i] = hamotor::pga3::se3::Momentum<double>::from(momentum);
        EXPECT_FALSE(hamotor::scene::is_finite(broken));
      }
    }
  }
}

}  // namespace
