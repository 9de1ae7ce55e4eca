// A compiled scene written by hand: what a scene's source has to say, and all it has to say.
//
// A brick hangs by a corner from a spring; its centre of mass is not at its frame's origin.
//
// For every scene the source must give one struct with
//   Group      the group's tag, its header included (pga3/se3.hpp, pga3/so3.hpp, pga2/se2.hpp)
//   Scalar     float, double, long double; constants as literals with enough digits for it
//   name       the scene's name;  kernels: "generated"
//   bodies     names, std::array<std::string_view, N>
//   frames     per body the motor N from its principal frame to the user's body frame
//              (std::array<Group::Element<Scalar>, N>; the identity where the user's is principal)
//   system     RigidBodies{std::tuple{bodies…}, std::tuple{interactions…}}, constexpr
//     bodies   FreeBody<Group, Scalar, rotation_split(moments)>(mass, moments), or for SO3
//              PivotedBody<Group, Scalar, rotation_split(moments)>(mass, moments, com, fixed_point)
//              moments: principal, kg m², 3 or in the plane 1; com in the principal frame
//     interactions, points on bodies in their *principal* frames:
//              UniformGravity<Group, Scalar>{{gx, gy, gz}}
//              SpringToWorld<body, Group, Scalar, RestLength::…>{at, anchor, stiffness,
//              rest_length} SpringBetween<one, two, Group, Scalar, RestLength::…>{at_one, at_two,
//              stiffness, rest} RestLength::zero where the rest length is 0 (smooth everywhere),
//              else ::positive
//   conserved  std::array<Conserved<Group>, K>: energy, spatial momenta, Casimirs.  The columns
//              spatial_momentum.GENERATOR (total over bodies, world) always exist; a combination of
//              them and every Casimir gets a column of its name.
// and then HAMOTOR_SCENE(Struct).  The linked program below it is only this file's test.
#include <gtest/gtest.h>

#include <cstdlib>
#include <sstream>
#include <string>

#include "hamotor/pga3/se3.hpp"
#include "hamotor/scene_abi.hpp"

namespace {

struct SpringPendulum {
  using Group = hamotor::pga3::SE3;
  using Scalar = double;
  static constexpr std::string_view name = "spring_pendulum";
  static constexpr std::string_view kernels = "generated";
  static constexpr std::array<std::string_view, 1> bodies{"brick"};
  static constexpr std::array<Group::Element<Scalar>, 1> frames{
      {{1, 0, 0, 0, -0.01, 0.005, -0.02, 0}}};  // centre of mass at (0.02, -0.01, 0.04)

  static constexpr std::array<Scalar, 3> brick_moments{
      0.00541666666666666667, 0.00416666666666666667, 0.00208333333333333333};
  static constexpr hamotor::RigidBodies system{
      std::tuple{hamotor::FreeBody<Group, Scalar, hamotor::rotation_split(brick_moments)>(
          0.5, brick_moments)},
      std::tuple{
          hamotor::UniformGravity<Group, Scalar>{{0, 0, -9.81}},
          hamotor::SpringToWorld<0, Group, Scalar, hamotor::RestLength::positive>{
              .at = {0.03, 0.11, 0.11}, .anchor = {0, 0, 0}, .stiffness = 20, .rest_length = 0.5}}};

  static constexpr std::array<hamotor::Conserved<Group>, 2> conserved{
      {{.quantity = hamotor::Quantity::energy,
        .name = "energy",
        .unit = "J",
        .description = "kinetic and potential energy of all bodies",
        .norm = {"energy"}},
       {.quantity = hamotor::Quantity::spatial_momentum,
        .name = "spatial_momentum.e12",
        .unit = "kg m^2/s",
        .description = "total angular momentum e12 about the world's origin, world frame",
        .coefficients = {0, 0, 1, 0, 0, 0},
        .norm = {"spatial_momentum.e23", "spatial_momentum.e31", "spatial_momentum.e12"}}}};
};

}  // namespace

HAMOTOR_SCENE(SpringPendulum);

namespace {

using Row = std::array<double, hamotor::scene::columns<SpringPendulum>()>;

constexpr std::array<double, 14> start{1, 0,    0, 0,     -0.2, 0,    0.45,
                                       0, 0.02, 0, 0.001, 0.1,  0.15, 0.05};

TEST(ExampleScene, describes_every_column_it_writes) {
  const std::string text = hamotor_describe();
  std::size_t described = 0;
  for (std::size_t at = text.find("\"frame\""); at != std::string::npos;
       at = text.find("\"frame\"", at + 1)) {
    ++described;
  }
  EXPECT_EQ(described, std::tuple_size_v<Row>);
  EXPECT_NE(text.find("{\"name\": \"splitting2\", \"order\": 2, "), std::string::npos);
  EXPECT_NE(text.find("\"brick.motor.e0123\", \"unit\": \"m\""), std::string::npos);
}

TEST(ExampleScene, unknown_method_starts_nothing) {
  EXPECT_EQ(hamotor_start("euler", 0, 0.01, 0, start.data()), nullptr);
  EXPECT_EQ(hamotor_start(nullptr, 0, 0.01, 0, start.data()), nullptr);
}

TEST(ExampleScene, gives_the_state_back_in_the_users_frame) {
  void* run = hamotor_start("splitting2", 0, 0.01, 0, start.data());
  ASSERT_NE(run, nullptr);
  std::array<double, 14> state{};
  hamotor_state(run, state.data());
  for (std::size_t k = 0; k < state.size(); ++k) EXPECT_NEAR(state[k], start[k], 1e-16);
  hamotor_stop(run);
}

TEST(ExampleScene, rows_come_every_so_many_steps_and_their_invariants_hold) {
  for (const char* method : {"rkmk4", "rk4", "splitting2"}) {
    void* run = hamotor_start(method, 2.0, 0.001, 0, start.data());
    ASSERT_NE(run, nullptr);
    Row first{};
    hamotor_observe(run, first.data());
    std::string text(30 * first.size(), ' ');
    const auto size =
        hamotor_observe_text(run, text.data(), static_cast<std::int64_t>(text.size()));
    EXPECT_LT(size, static_cast<std::int64_t>(text.size()));
    std::istringstream words(text);
    for (const double x : first) {
      std::string word;
      words >> word;
      EXPECT_EQ(std::strtod(word.c_str(), nullptr), x);
    }
    EXPECT_EQ(hamotor_observe_text(run, text.data(), 4), size);
    EXPECT_EQ(std::string(text.c_str()).size(), 3U);
    std::array<Row, 4> rows{};
    EXPECT_EQ(hamotor_advance(run, 7, 5, rows[0].data()), 7);
    EXPECT_EQ(hamotor_advance(run, 10, 5, rows[1].data()), 10);
    EXPECT_DOUBLE_EQ(first[0], 2.0);
    EXPECT_DOUBLE_EQ(rows[0][0], 2.005);
    EXPECT_DOUBLE_EQ(rows[1][0], 2.010);
    EXPECT_DOUBLE_EQ(rows[2][0], 2.015);
    EXPECT_EQ(rows[3][0], 0);
    const std::size_t energy = 1 + 14 + 3;
    EXPECT_NEAR(rows[2][energy], first[energy], 1e-5 * std::abs(first[energy]));
    EXPECT_NEAR(rows[2][energy + 3], first[energy + 3], 1e-10);
    std::array<double, 2> drift{};
    hamotor_drift(run, drift.data());
    EXPECT_GT(drift[1], 0);
    // Steps of rk4 leave the group by an error of the method, all others by rounding.
    EXPECT_LT(drift[0], std::string_view(method) == "rk4" ? 1e-10 : 1e-14);
    hamotor_stop(run);
  }
}

TEST(ExampleScene, keeps_the_last_finite_state) {
  void* run = hamotor_start("splitting2", 0, 1e200, 0, start.data());
  ASSERT_NE(run, nullptr);
  const std::int64_t done = hamotor_advance(run, 100, 1, nullptr);
  EXPECT_LT(done, 100);
  std::array<double, 14> state{};
  hamotor_state(run, state.data());
  for (const double x : state) EXPECT_TRUE(std::isfinite(x));
  EXPECT_EQ(hamotor_advance(run, 1, 1, nullptr), 0);
  std::int64_t component = -1;
  EXPECT_EQ(hamotor_failure(run, &component), 1);
  EXPECT_GE(component, 0);
  hamotor_stop(run);
}

}  // namespace
