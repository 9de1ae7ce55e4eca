// Ensembles: a member's bits are its own, whatever the lanes, the threads and the other members do.
#include "hamotor/ensemble.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <tuple>
#include <vector>

#include "hamotor/pack.hpp"
#include "hamotor/pga3/pga3.hpp"
#include "hamotor/rkmk.hpp"
#include "hamotor/steppers.hpp"
#include "sample_systems.hpp"

namespace {

using hamotor::Ensemble;
using hamotor::Failure;
using hamotor::Pack;

/// What numbers' bits are, all together (FNV-1a).
class Hash {
 public:
  template <class State>
  void add(const State& state) {
    for (std::size_t i = 0; i < State::bodies; ++i) {
      for (const double x : state.motors[i].components()) add(x);
      for (const double x : state.momenta[i].components()) add(x);
    }
  }
  void add(double x) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &x, sizeof bits);
    value_ = (value_ ^ bits) * 0x100000001b3U;
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

template <class System>
using MemberOf = hamotor::State<typename System::Group, System::bodies, double>;

/// Members of which some turn slowly; with `fast` some so that an angle of a step is many turns.
template <class System>
std::vector<MemberOf<System>> members_of(const System& system, std::size_t count, double fast = 0) {
  std::vector<MemberOf<System>> members(count, sample::generic_state(system));
  for (std::size_t k = 0; k < count; ++k) {
    for (auto& momentum : members[k].momenta) {
      auto x = momentum.components();
      for (double& c : x) c *= 1 + 0.1 * static_cast<double>(k) + (k % 7 == 3 ? fast : 0);
      momentum = std::remove_cvref_t<decltype(momentum)>::from(x);
    }
  }
  return members;
}

constexpr std::size_t count = 41;
constexpr int steps = 70;
constexpr double step = 0.02;

/// All members' bits after the steps, `parts` ensembles one after the other.
template <template <class> class Method, class System>
std::uint64_t hash_in(const System& system, const std::vector<MemberOf<System>>& members,
                      unsigned threads, std::size_t parts) {
  Hash hash;
  for (std::size_t part = 0; part < parts; ++part) {
    const std::size_t first = members.size() * part / parts;
    const std::size_t last = members.size() * (part + 1) / parts;
    Ensemble ensemble(system, Method<System>{}, 0.0, step,
                      std::span(members).subspan(first, last - first), threads);
    ensemble.advance(steps / 2);
    ensemble.advance(steps - steps / 2);
    for (std::size_t k = 0; k < ensemble.size(); ++k) hash.add(ensemble.state(k));
  }
  return hash.value();
}

template <class System>
using Rk4 = hamotor::Rk4<System>;
template <class System>
using Rkmk4 = hamotor::Rkmk4<System>;
template <class System>
using Splitting2 = hamotor::Splitting2<System>;

TEST(Ensembles, members_have_the_same_bits_in_any_lane_part_and_thread) {
  const auto members = members_of(sample::forced_so3(), count);
  const auto alone = hash_in<Rk4>(sample::forced_so3<Pack<double, 1>>(), members, 1, count);
  const auto two = sample::forced_so3<Pack<double, 2>>();
  const auto four = sample::forced_so3<Pack<double, 4>>();
  const auto eight = sample::forced_so3<Pack<double, 8>>();
  EXPECT_EQ(hash_in<Rk4>(two, members, 1, 1), alone);
  EXPECT_EQ(hash_in<Rk4>(four, members, 2, 1), alone);
  EXPECT_EQ(hash_in<Rk4>(eight, members, 1, 1), alone);
  EXPECT_EQ(hash_in<Rk4>(eight, members, 3, 2), alone);
}

TEST(Ensembles, take_no_steps_where_there_are_fewer_than_none) {
  const auto system = sample::forced_so3<Pack<double, 4>>();
  const auto members = members_of(sample::forced_so3(), 3);
  Ensemble ensemble(system, Rk4<std::remove_const_t<decltype(system)>>{}, 0.5, step,
                    std::span(members));
  EXPECT_EQ(ensemble.advance(-7), 3U);
  EXPECT_EQ(ensemble.time(0), 0.5);
  EXPECT_EQ(ensemble.steps(0), 0);
  EXPECT_EQ(ensemble.state(0), members[0]);
}

TEST(Ensembles, of_32_lanes_have_the_same_bits_and_failures) {
  const auto members = members_of(sample::forced_so3(), count);
  const auto system = sample::forced_so3<Pack<double, 32>>();
  const auto one = sample::forced_so3<Pack<double, 1>>();
  EXPECT_EQ(hash_in<Rk4>(system, members, 1, 1), hash_in<Rk4>(one, members, 1, 1));
  auto failing = members;
  failing[31].momenta[0].l31 = std::numeric_limits<double>::quiet_NaN();
  Ensemble ensemble(system, Rk4<std::remove_const_t<decltype(system)>>{}, 0.0, step,
                    std::span(failing));
  EXPECT_EQ(ensemble.advance(steps), count - 1);
  EXPECT_EQ(ensemble.failure(31), Failure::not_finite);
}

TEST(Ensembles, angles_of_any_size_have_the_same_bits_in_any_lane) {
  const auto members = members_of(sample::forced_so3(), count, 1e3);
  const auto alone = hash_in<Splitting2>(sample::forced_so3<Pack<double, 1>>(), members, 1, 1);
  EXPECT_EQ(hash_in<Splitting2>(sample::forced_so3<Pack<double, 4>>(), members, 2, 3), alone);
  const auto plates = members_of(sample::forced_se2(), count, 1e3);
  const auto plate = hash_in<Rkmk4>(sample::forced_se2<Pack<double, 1>>(), plates, 1, 1);
  EXPECT_EQ(hash_in<Rkmk4>(sample::forced_se2<Pack<double, 8>>(), plates, 2, 2), plate);
}

template <template <class> class Method, class System, class Packs>
void expect_bits_of_a_run(const System& system, const Packs& packs) {
  const auto members = members_of(system, 5);
  Ensemble ensemble(packs, Method<Packs>{}, 0.5, step, std::span(members));
  EXPECT_EQ(ensemble.advance(1), 5U);
  EXPECT_EQ(ensemble.advance(steps - 1), 5U);
  for (std::size_t k = 0; k < 5; ++k) {
    auto state = members[k];
    Method<System> method;
    for (int n = 0; n < steps; ++n) method.do_step(system, state, 0.0, step);
    EXPECT_EQ(ensemble.state(k), state);
  }
  EXPECT_EQ(ensemble.time(4), hamotor::mul_add(double(steps), step, 0.5));
}

TEST(Ensembles, a_member_has_the_bits_of_a_run_by_itself) {
  expect_bits_of_a_run<Rk4>(sample::forced_so3(), sample::forced_so3<Pack<double, 8>>());
  expect_bits_of_a_run<Rk4>(sample::forced_se3(), sample::forced_se3<Pack<double, 8>>());
  expect_bits_of_a_run<Splitting2>(sample::forced_so3(), sample::forced_so3<Pack<double, 4>>());
}

template <template <class> class Method>
void expect_nothing_of_steps_before() {
  const auto system = sample::forced_se3<Pack<double, 4>>();
  const auto members = members_of(sample::forced_se3(), 5);
  Method<std::remove_const_t<decltype(system)>> used;
  auto state = sample::generic_state(system);
  for (int k = 0; k < 3; ++k) used.do_step(system, state, 0, 0.1);
  Ensemble after(system, used, 0.0, step, std::span(members));
  Ensemble anew(system, decltype(used){}, 0.0, step, std::span(members));
  after.advance(steps);
  anew.advance(steps);
  for (std::size_t k = 0; k < 5; ++k) EXPECT_EQ(after.state(k), anew.state(k));
}

TEST(Ensembles, of_a_method_that_took_steps_begin_anew) {
  expect_nothing_of_steps_before<Rk4>();
  expect_nothing_of_steps_before<Splitting2>();
}

template <class System>
using Open2 = hamotor::Splitting2<System, hamotor::Summation::plain>;
template <class System>
using Open4 = hamotor::Splitting4<System, hamotor::Summation::plain>;

TEST(Ensembles, steps_left_open_are_those_of_a_run_but_for_rounding) {
  const auto system = sample::free_se3();
  using System = std::remove_const_t<decltype(system)>;
  const auto lanes = sample::free_se3<Pack<double, 4>>();
  const auto members = members_of(system, count, 50);
  Ensemble ensemble(lanes, Open4<std::remove_const_t<decltype(lanes)>>{}, 0.0, step,
                    std::span(members));
  const auto expect_near_a_run = [&](int steps_done) {
    for (std::size_t k = 0; k < count; k += 5) {
      auto expected = members[k];
      Open4<System> method;
      for (int n = 0; n < steps_done; ++n) method.do_step(system, expected, 0.0, step);
      const auto found = ensemble.state(k);
      const double size = 1 + std::abs(found.motors[0].e01) + std::abs(found.momenta[0].l12);
      for (std::size_t c = 0; c < 8; ++c) {
        EXPECT_NEAR(found.motors[0].components()[c], expected.motors[0].components()[c],
                    1e-12 * size);
      }
      for (std::size_t c = 0; c < 6; ++c) {
        EXPECT_NEAR(found.momenta[0].components()[c], expected.momenta[0].components()[c],
                    1e-12 * size);
      }
    }
  };
  expect_near_a_run(0);
  ensemble.advance(1);
  expect_near_a_run(1);
  ensemble.advance(steps - 1);
  expect_near_a_run(steps);
}

TEST(Ensembles, steps_left_open_do_not_depend_on_lanes_or_on_when_they_are_looked_at) {
  const auto members = members_of(sample::free_so3(), count, 1e3);
  const auto alone = hash_in<Open2>(sample::free_so3<Pack<double, 1>>(), members, 1, count);
  const auto eight = sample::free_so3<Pack<double, 8>>();
  EXPECT_EQ(hash_in<Open2>(eight, members, 2, 3), alone);
  Ensemble ensemble(eight, Open2<std::remove_const_t<decltype(eight)>>{}, 0.0, step,
                    std::span(members));
  Hash hash;
  for (int n = 0; n < steps; ++n) {
    ensemble.advance(1);
    if (n % 9 == 0) {
      EXPECT_TRUE(std::isfinite(ensemble.state(7).motors[0].s));
    }
  }
  for (std::size_t k = 0; k < count; ++k) hash.add(ensemble.state(k));
  EXPECT_EQ(hash.value(), alone);
}

TEST(Ensembles, a_member_that_fails_keeps_its_last_state_and_the_others_go_on) {
  const auto system = sample::forced_so3<Pack<double, 8>>();
  auto members = members_of(sample::forced_so3(), count);
  const auto unharmed = hash_in<Rk4>(system, members, 1, 1);
  const auto far = members[9];
  members[9].momenta[0].l23 = 1e200;  // overflows in the first step
  members[20].momenta[0].l12 = 4e5;   // leaves the group at once
  members[31].momenta[0].l31 = std::numeric_limits<double>::quiet_NaN();
  Ensemble ensemble(system, Rk4<decltype(system)>{}, 0.0, step, std::span(members), 2);
  EXPECT_EQ(ensemble.advance(steps), count - 3);
  EXPECT_EQ(ensemble.failure(9), Failure::not_finite);
  EXPECT_EQ(ensemble.failure(20), Failure::left_group);
  EXPECT_EQ(ensemble.failure(31), Failure::not_finite);
  EXPECT_EQ(ensemble.failure(30), Failure::none);
  EXPECT_EQ(ensemble.steps(9), 0);
  EXPECT_EQ(ensemble.steps(20), 0);
  EXPECT_EQ(ensemble.steps(30), steps);
  EXPECT_EQ(ensemble.state(9), members[9]);
  EXPECT_EQ(ensemble.state(20), members[20]);

  const auto untouched = members_of(sample::forced_so3(), count);
  Ensemble fine(system, Rk4<decltype(system)>{}, 0.0, step, std::span(untouched), 1);
  fine.advance(steps);
  Hash hash;
  for (std::size_t k = 0; k < count; ++k) {
    hash.add(fine.state(k));
    if (k == 9 || k == 20 || k == 31) continue;
    EXPECT_EQ(ensemble.state(k), fine.state(k));
  }
  EXPECT_EQ(hash.value(), unharmed);
  EXPECT_EQ(far, untouched[9]);
}

TEST(Ensembles, the_example_of_the_documentation) {
  using hamotor::pga3::SE3;
  using Lanes = Pack<double, hamotor::widest<double>>;
  constexpr std::array<double, 3> moments{1, 2, 3};
  const hamotor::RigidBodies system{
      std::tuple{hamotor::FreeBody<SE3, Lanes, hamotor::rotation_split(moments)>(1.5, {1, 2, 3})}};

  std::vector<MemberOf<std::remove_cvref_t<decltype(system)>>> members(1000);
  for (std::size_t k = 0; k < members.size(); ++k) {
    members[k].motors[0] = SE3::Element<double>::identity();
    members[k].momenta[0] = {0.001, 2 + 0.001 * static_cast<double>(k), 0, 1.5, 0, 0};
  }
  Ensemble ensemble(system, Rk4<std::remove_cvref_t<decltype(system)>>{}, 0.0, 0.01,
                    std::span(members));
  EXPECT_EQ(ensemble.advance(100), 1000U);
  EXPECT_NEAR(ensemble.state(999).momenta[0].l31, 2.999, 1e-5);
}

TEST(Packs, functions_know_the_ends_of_the_numbers) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Pack<double, 4> x(0);
  const std::array<double, 4> ends{-infinity, infinity, -800, -745.1};
  for (std::size_t k = 0; k < 4; ++k) x.set(k, ends[k]);
  const auto e = exp(x);
  EXPECT_EQ(e[0], 0);
  EXPECT_EQ(e[1], infinity);
  EXPECT_EQ(e[2], 0);
  EXPECT_EQ(e[3], std::exp(-745.1));
  x = Pack<double, 4>(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(std::isnan(exp(x)[0]) && std::isnan(sin(x)[1]) && std::isnan(cos(x)[2]));
  x.set(2, -0.0);
  EXPECT_TRUE(std::signbit((-Pack<double, 4>(0))[3]));
  EXPECT_FALSE(std::signbit(hamotor::scalar::abs(x)[2]));
  EXPECT_TRUE(std::signbit(sin(x)[2]) && std::isnan(sin(x)[3]));
}

template <class T, std::size_t W>
void expect_a_number_s_less_product() {
  const T third = T(1) / T(3);
  const auto found =
      hamotor::less_product(Pack<T, W>(third), Pack<T, W>(T(0.7)), Pack<T, W>(third));
  EXPECT_EQ(found[W - 1], hamotor::mul_add(-third, T(0.7), third));
}

TEST(Packs, a_product_is_taken_away_with_the_rounding_of_a_number) {
  expect_a_number_s_less_product<double, 8>();
  expect_a_number_s_less_product<double, 4>();
  expect_a_number_s_less_product<double, 2>();
  expect_a_number_s_less_product<double, 1>();
  expect_a_number_s_less_product<float, 16>();
  expect_a_number_s_less_product<float, 8>();
  expect_a_number_s_less_product<float, 4>();
}

template <class S, std::size_t W>
void expect_masks_of_all_lanes() {
  using P = Pack<S, W>;
  EXPECT_TRUE(all(P(1) == P(1)));
  EXPECT_FALSE(any(P(1) == P(2)));
  for (std::size_t lane = 0; lane < W; ++lane) {
    P x(1);
    x.set(lane, S(2));
    EXPECT_TRUE(any(x == P(2))) << lane << " of " << W;
    EXPECT_FALSE(all(x == P(1))) << lane << " of " << W;
    EXPECT_EQ(select(x == P(2), P(3), x)[lane], 3);
    EXPECT_EQ(sqrt(x * x)[lane], 2);
  }
}

template <class S>
void expect_packs_of_any_size() {
  expect_masks_of_all_lanes<S, 1>();
  expect_masks_of_all_lanes<S, 2>();
  expect_masks_of_all_lanes<S, 4>();
  expect_masks_of_all_lanes<S, 8>();
  expect_masks_of_all_lanes<S, 16>();
  expect_masks_of_all_lanes<S, 32>();
  expect_masks_of_all_lanes<S, 64>();
}

TEST(Packs, know_all_of_up_to_64_lanes) {
  expect_packs_of_any_size<double>();
  expect_packs_of_any_size<float>();
}

TEST(Packs, masks_choose_lane_by_lane) {
  Pack<double, 4> x(2);
  x.set(1, -1);
  const auto negative = x < Pack<double, 4>(0);
  EXPECT_TRUE(any(negative));
  EXPECT_FALSE(all(negative));
  EXPECT_TRUE(all(negative || !negative));
  EXPECT_FALSE(any(negative && !negative));
  const auto chosen = select(negative, Pack<double, 4>(7), x);
  EXPECT_EQ(chosen[0], 2);
  EXPECT_EQ(chosen[1], 7);
}

}  // namespace
