// What a system says of itself: rates and forques are derivatives of its energy.
#include "hamotor/systems.hpp"

#include <gtest/gtest.h>

#include <type_traits>

#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"
#include "sample_systems.hpp"

namespace {

using hamotor::HamiltonianSystem;
using hamotor::RotationSplit;
using hamotor::SplitSystem;
using sample::generic_state;

template <class System>
class Systems : public testing::Test {};

/// A factory as a type, so that one test runs for every system.
template <auto factory>
struct Made {
  static auto make() { return factory(); }
};

using All =
    testing::Types<Made<sample::free_se3<double>>, Made<sample::free_so3<double>>,
                   Made<sample::free_se2<double>>, Made<sample::forced_se3<double>>,
                   Made<sample::forced_so3<double>>, Made<sample::forced_se2<double>>,
                   Made<sample::two_bodies_se3<double>>, Made<sample::two_bodies_se2<double>>>;
TYPED_TEST_SUITE(Systems, All);

TYPED_TEST(Systems, rate_is_the_derivative_of_the_energy_by_the_momentum) {
  const auto system = TypeParam::make();
  using G = typename decltype(system)::Group;
  const auto state = generic_state(system);
  const auto rates = system.rate(state);
  constexpr double e = 1e-3;
  for (std::size_t i = 0; i < state.bodies; ++i) {
    for (std::size_t a = 0; a < static_cast<std::size_t>(G::dimension); ++a) {
      const auto energy = [&](double by) {
        auto there = state;
        auto mu = there.momenta[i].components();
        mu[a] += by;
        there.momenta[i] = G::template Momentum<double>::from(mu);
        return system.energy(there);
      };
      EXPECT_NEAR((energy(e) - energy(-e)) / (2 * e), rates[i].components()[a], 1e-11);
    }
  }
}

TYPED_TEST(Systems, forque_is_the_derivative_of_the_energy_along_the_generators) {
  const auto system = TypeParam::make();
  using System = std::remove_const_t<decltype(system)>;
  using G = typename System::Group;
  const auto state = generic_state(system);
  constexpr double e = 1e-3;
  for (std::size_t i = 0; i < state.bodies; ++i) {
    for (std::size_t a = 0; a < static_cast<std::size_t>(G::dimension); ++a) {
      const auto energy = [&](double by) {
        auto there = state;
        std::array<double, static_cast<std::size_t>(G::dimension)> rate{};
        rate[a] = by;
        there.motors[i] = gp(state.motors[i], exp(G::template Rate<double>::from(rate)));
        return system.energy(there);
      };
      const double slope =
          (8 * (energy(e) - energy(-e)) - (energy(2 * e) - energy(-2 * e))) / (12 * e);
      double forque = 0;
      if constexpr (System::has_forque) forque = system.forque(state.motors)[i].components()[a];
      EXPECT_NEAR(slope, forque, 2e-11) << "body " << i << ", generator " << a;
    }
  }
}

TYPED_TEST(Systems, twice_the_kinetic_energy_is_the_pairing_of_momentum_and_rate) {
  const auto system = TypeParam::make();
  const auto state = generic_state(system);
  const auto rates = system.rate(state);
  double twice = 0;
  for (std::size_t i = 0; i < state.bodies; ++i) twice += pairing(state.momenta[i], rates[i]);
  EXPECT_NEAR(twice, 2 * system.kinetic(state.momenta), 1e-14 * twice);
}

TYPED_TEST(Systems, fulfil_the_concepts) {
  using System = std::remove_const_t<decltype(TypeParam::make())>;
  static_assert(HamiltonianSystem<System>);
  static_assert(SplitSystem<System>);
  static_assert(hamotor::Stepper<hamotor::Rkmk4<System>, System>);
  static_assert(hamotor::Stepper<hamotor::Rk4<System>, System>);
  static_assert(hamotor::Stepper<hamotor::Splitting2<System>, System>);
  static_assert(!HamiltonianSystem<int>);
  static_assert(!hamotor::Stepper<int, System>);
}

TEST(SpringBetween, pulls_with_opposite_forces_along_one_line) {
  const auto system = sample::two_bodies_se3();
  const auto state = generic_state(system);
  const auto forque = system.forque(state.motors);
  const auto total =
      Ad_star_inverse(state.motors[0], forque[0]) + Ad_star_inverse(state.motors[1], forque[1]);
  for (const double x : total.components()) EXPECT_NEAR(x, 0, 1e-14);
}

TEST(Spring, without_a_rest_length_is_smooth_where_its_ends_meet) {
  using namespace sample;
  const RigidBodies system{
      std::tuple{body()},
      std::tuple{SpringToWorld<0, SE3, double, RestLength::zero>{{0, 0, 0}, {0, 0, 0}, 5, 0}}};
  for (const double x : {0.0, 1e-300, 1e-8}) {
    auto motor = hamotor::pga3::Motor<double>::identity();
    motor.e01 = -0.5 * x;
    EXPECT_DOUBLE_EQ(system.forque({motor})[0].p1, 5 * x);
  }
}

TEST(Spring, with_a_rest_length_has_no_force_where_it_has_no_direction) {
  using namespace sample;
  const RigidBodies system{std::tuple{body()},
                           std::tuple{SpringToWorld<0, SE3, double>{{0, 0, 0}, {0, 0, 0}, 5, 1}}};
  for (const double x : system.forque({hamotor::pga3::Motor<double>::identity()})[0].components()) {
    EXPECT_EQ(x, 0);
  }
}

TEST(RotationSplit, takes_the_middle_moment_out) {
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{1, 2, 3}), (RotationSplit{1, 0, 2, 2}));
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{2, 1, 3}), (RotationSplit{0, 1, 2, 2}));
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{3, 1, 2}), (RotationSplit{2, 1, 0, 2}));
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{1, 3, 2}), (RotationSplit{2, 0, 1, 2}));
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{3, 2, 1}), (RotationSplit{1, 2, 0, 2}));
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{2, 3, 1}), (RotationSplit{0, 2, 1, 2}));
}

TEST(RotationSplit, leaves_the_spin_apart_where_forces_act_on_the_axis) {
  using Points = std::array<std::array<double, 3>, 2>;
  constexpr std::array<double, 3> symmetric{2, 2, 1};
  constexpr std::array<double, 3> asymmetric{2, 3, 1};
  constexpr Points on_axis{{{0, 0, 1}, {0, 0, -2}}};
  constexpr Points beside_it{{{0, 0, 1}, {0.1, 0, 0}}};
  EXPECT_TRUE(hamotor::rotation_split(symmetric, on_axis).spin_apart);
  EXPECT_FALSE(hamotor::rotation_split(symmetric, beside_it).spin_apart);
  EXPECT_FALSE(hamotor::rotation_split(asymmetric, on_axis).spin_apart);
  EXPECT_FALSE(hamotor::rotation_split(symmetric).spin_apart);
}

TEST(RotationSplit, knows_a_nearly_symmetric_body) {
  const auto split = hamotor::rotation_split(std::array<double, 3>{1, 1.0001, 1.9});
  EXPECT_TRUE(split.nearly_symmetric);
  EXPECT_EQ(split.inner, 0);
  EXPECT_FALSE(hamotor::rotation_split(std::array<double, 3>{1, 2, 3}).nearly_symmetric);
}

template <class G, class Body>
void expect_the_origin_to_be_a_point(const Body& body) {
  using hamotor::RestLength;
  using hamotor::SpringToWorld;
  using Space = hamotor::Space<G>;
  using Point = typename Space::template Point<double>;
  using Origin = typename Space::template Origin<double>;
  std::array<double, Space::dimension> at{};
  at[0] = 0.3;
  at[1] = -0.2;
  const hamotor::RigidBodies general{
      std::tuple{body},
      std::tuple{SpringToWorld<0, G, double>{Point::from(at), Point::from({}), 5, 0.4}}};
  const hamotor::RigidBodies lean{
      std::tuple{body}, std::tuple{SpringToWorld<0, G, double, RestLength::positive, Origin>{
                            Point::from(at), Origin{}, 5, 0.4}}};
  const auto state = sample::generic_state(general);
  EXPECT_NEAR(lean.energy(state), general.energy(state), 1e-14 * general.energy(state));
  const auto expected = general.forque(state.motors)[0].components();
  const auto found = lean.forque(state.motors)[0].components();
  for (std::size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-14);
}

TEST(Spring, to_the_origin_is_one_to_a_point) {
  expect_the_origin_to_be_a_point<hamotor::pga3::SE3>(sample::body());
  expect_the_origin_to_be_a_point<hamotor::pga2::SE2>(sample::plate());
}

TEST(AngleIncrement, has_all_digits_of_any_angle) {
  using hamotor::AngleIncrement;
  using Wide = long double;
  double worst = 0;
  const auto expect_close = [&](double x) {
    const auto angle = AngleIncrement<double>::of(x);
    const Wide sine = std::sin(static_cast<Wide>(x));
    const Wide quarter = std::sin(static_cast<Wide>(x) / 2);
    worst = std::max({worst, static_cast<double>(std::abs((angle.sine - sine) / sine)),
                      static_cast<double>(std::abs((angle.cosine_less_one + 2 * quarter * quarter) /
                                                   (2 * quarter * quarter)))});
  };
  for (int k = 1; k < 4000; ++k) {
    expect_close(k * 1.9e-4);
    expect_close(-k * 1.9e-4);
    expect_close(std::ldexp(1.1, -k / 8));
  }
  EXPECT_LT(worst, 3e-16);
  for (int k = 1; k < 4000; ++k) {
    for (const double x : {k * 0.0113, -k * 1.7, k * 1.1e5, -k * 3e7}) {
      const auto angle = AngleIncrement<double>::of(x);
      EXPECT_NEAR(angle.sine, static_cast<double>(std::sin(static_cast<Wide>(x))), 2.3e-16);
      EXPECT_NEAR(angle.cosine_less_one, static_cast<double>(std::cos(static_cast<Wide>(x)) - 1),
                  4.5e-16);
    }
  }
  EXPECT_EQ(AngleIncrement<double>::of(0).sine, 0);
  EXPECT_EQ(AngleIncrement<double>::of(0).cosine_less_one, 0);
  EXPECT_TRUE(std::isnan(AngleIncrement<double>::of(std::nan("")).sine));
}

template <class S>
void expect_tiny_angles_as_small_ones() {
  using Increment = hamotor::AngleIncrement<S>;
  using hamotor::AngleRange;
  const auto expect_same = [](S x) {
    const auto tiny = Increment::template of_small<AngleRange::tiny>(x);
    const auto small = Increment::of_small(x);
    ASSERT_EQ(tiny.sine, small.sine) << x;
    ASSERT_EQ(tiny.cosine_less_one, small.cosine_less_one) << x;
  };
  const S last = S(1) / S(16);
  S next_to_last = last;
  for (int k = 0; k < 200000; ++k) {
    expect_same(next_to_last = std::nextafter(next_to_last, S(0)));
    expect_same(last * static_cast<S>(k) / S(200000));
  }
  for (int k = 0; k < 1200; ++k) expect_same(std::ldexp(S(-1.3), -5 - k));
  expect_same(last);
  expect_same(0);
}

TEST(AngleIncrement, of_tiny_angles_has_the_bits_of_small_ones) {
  expect_tiny_angles_as_small_ones<double>();
  expect_tiny_angles_as_small_ones<float>();
}

TEST(RotationSplit, a_symmetry_saves_rotations) {
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{2, 2, 1}), (RotationSplit{0, 2, 1, 1}));
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{1, 2, 2}), (RotationSplit{1, 0, 2, 1}));
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{2, 1, 2}), (RotationSplit{0, 1, 2, 1}));
  EXPECT_EQ(hamotor::rotation_split(std::array<double, 3>{2, 2, 2}), (RotationSplit{0, 1, 2, 0}));
}

TEST(RigidBodies, are_constants_of_the_compiler) {
  static constexpr auto system = sample::forced_se3();
  static_assert(system.body<0>().mass() == 1.5);
  static_assert(sizeof(sample::free_se3()) == sizeof(sample::body()) + sizeof(double));
}

}  // namespace
