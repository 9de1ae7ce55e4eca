// Steppers of a state that is changed between steps: what they keep of another state counts for
// nothing, in each lane by itself.
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <limits>
#include <string_view>
#include <tuple>
#include <type_traits>

#include "hamotor/methods.hpp"
#include "hamotor/pack.hpp"
#include "hamotor/steppers.hpp"
#include "sample_systems.hpp"

namespace {

using hamotor::Pack;
using hamotor::StateOf;
using hamotor::Summation;

/// What may happen to a state between steps.
template <class State>
State changed(State state, int way) {
  using S = typename State::Scalar;
  auto& motor = state.motors.back();
  auto& momentum = state.momenta.back();
  if (way == 0) momentum = S(-1.5) * momentum;
  if (way == 1) motor = -motor;
  if (way == 2) {
    for (auto& mu : state.momenta) mu = S(0.75) * mu;
    motor = motor + S(0.001) * motor;
  }
  return state;
}
constexpr int ways = 3;

template <class Method, class System>
void expect_a_new_stepper_s_bits(const System& system) {
  using S = typename System::Scalar;
  const S h = S(0.02);
  for (int way = 0; way < ways; ++way) {
    auto state = sample::generic_state(system);
    Method used;
    S t(0);
    const auto step = [&](Method& method, auto& at) { method.do_step(system, at, t, h); };
    for (int k = 0; k < 5; ++k, t += h) step(used, state);
    state = changed(state, way);
    auto expected = state;
    Method anew;
    for (int k = 0; k < 3; ++k, t += h) {
      step(used, state);
      step(anew, expected);
      EXPECT_EQ(state, expected) << Method::name << ", change " << way << ", step " << k;
    }
  }
}

template <class Method, class System>
void expect_to_recover(const System& system) {
  using S = typename System::Scalar;
  const S h = S(0.02);
  const auto good = sample::generic_state(system);
  auto state = good;
  Method used;
  used.do_step(system, state, S(0), h);
  state.momenta[0] = std::numeric_limits<S>::quiet_NaN() * state.momenta[0];
  used.do_step(system, state, h, h);
  EXPECT_FALSE(is_finite(state)) << Method::name;
  state = good;
  auto expected = good;
  Method anew;
  used.do_step(system, state, S(0), h);
  anew.do_step(system, expected, S(0), h);
  EXPECT_EQ(state, expected) << Method::name;
}

template <class... Method>
void for_each_of(std::tuple<Method...>, const auto& check) {
  (check(std::type_identity<Method>{}), ...);
}

void expect_of_all_methods(const auto& system) {
  using System = std::remove_cvref_t<decltype(system)>;
  const auto check = [&]<class Method>(std::type_identity<Method>) {
    expect_a_new_stepper_s_bits<Method>(system);
    expect_to_recover<Method>(system);
  };
  for_each_of(hamotor::SteppersOf<System, Summation::plain>{}, check);
  for_each_of(hamotor::SteppersOf<System, Summation::compensated>{}, check);
}

TEST(ChangedStates, of_free_bodies_have_the_bits_of_a_new_stepper_by_every_method) {
  expect_of_all_methods(sample::free_se2());
}

TEST(ChangedStates, of_bodies_with_forces_have_the_bits_of_a_new_stepper_by_every_method) {
  expect_of_all_methods(sample::forced_so3());
}

template <class S, std::size_t W, class Lanes, class Numbers>
void put(Lanes& state, std::size_t lane, const Numbers& from) {
  const auto set = [&](auto& to, const auto& one) {
    auto x = to.components();
    const auto y = one.components();
    for (std::size_t k = 0; k < x.size(); ++k) x[k].set(lane, y[k]);
    to = std::remove_cvref_t<decltype(to)>::from(x);
  };
  for (std::size_t i = 0; i < Numbers::bodies; ++i) {
    set(state.motors[i], from.motors[i]);
    set(state.momenta[i], from.momenta[i]);
  }
}

template <class Numbers, class Lanes>
Numbers lane_of(const Lanes& state, std::size_t lane) {
  Numbers result{};
  const auto get = [&](auto& to, const auto& one) {
    auto x = to.components();
    const auto y = one.components();
    for (std::size_t k = 0; k < x.size(); ++k) x[k] = y[k][lane];
    to = std::remove_cvref_t<decltype(to)>::from(x);
  };
  for (std::size_t i = 0; i < Numbers::bodies; ++i) {
    get(result.motors[i], state.motors[i]);
    get(result.momenta[i], state.momenta[i]);
  }
  return result;
}

/// One lane's state is changed, then two, then all, and the lanes are as steppers of numbers.
template <template <class> class Method, class S, std::size_t W>
void expect_lanes_of_their_own(const auto& make) {
  const auto system = make.template operator()<S>();
  const auto packs = make.template operator()<Pack<S, W>>();
  using System = std::remove_const_t<decltype(system)>;
  using Packs = std::remove_const_t<decltype(packs)>;
  using Member = StateOf<System>;
  std::array<Method<System>, W> alone{};
  std::array<Member, W> members{};
  StateOf<Packs> state{};
  Method<Packs> together;
  for (std::size_t lane = 0; lane < W; ++lane) {
    members[lane] = sample::generic_state(system);
    for (auto& mu : members[lane].momenta) mu = (S(1) + S(0.01) * S(lane)) * mu;
    put<S, W>(state, lane, members[lane]);
  }
  S t(0);
  const S h = S(0.02);
  for (int k = 0; k < 12; ++k, t += h) {
    for (std::size_t lane = 0; lane < W; ++lane) {
      const bool is_changed =
          k == 9 || (k == 3 && lane == W / 2) || (k == 6 && (lane == 0 || lane + 1 == W));
      if (!is_changed) continue;
      members[lane] = changed(members[lane], k / 3 - 1);
      put<S, W>(state, lane, members[lane]);
    }
    together.do_step(packs, state, Pack<S, W>(t), Pack<S, W>(h));
    for (std::size_t lane = 0; lane < W; ++lane) {
      alone[lane].do_step(system, members[lane], t, h);
      EXPECT_EQ(lane_of<Member>(state, lane), members[lane])
          << Method<System>::name << " in lane " << lane << " of " << W << ", step " << k;
    }
  }
}

template <Summation summation>
struct Summed {
  template <class System>
  using Rk4 = hamotor::Rk4<System, summation>;
  template <class System>
  using Splitting2 = hamotor::Splitting<System, 2, summation>;
  template <class System>
  using Splitting4 = hamotor::Splitting<System, 4, summation>;
};
template <Summation summation, std::size_t W>
void expect_of_methods_in_packs(const auto& make) {
  expect_lanes_of_their_own<Summed<summation>::template Rk4, double, W>(make);
  expect_lanes_of_their_own<Summed<summation>::template Splitting2, double, W>(make);
  expect_lanes_of_their_own<Summed<summation>::template Splitting4, double, W>(make);
}

TEST(ChangedStates, of_a_lane_leave_the_others_alone) {
  constexpr auto plain = Summation::plain;
  constexpr auto compensated = Summation::compensated;
  expect_of_methods_in_packs<compensated, 4>([]<class S> { return sample::forced_so3<S>(); });
  expect_of_methods_in_packs<plain, 8>([]<class S> { return sample::forced_se3<S>(); });
  expect_of_methods_in_packs<compensated, 2>([]<class S> { return sample::two_bodies_se2<S>(); });
  expect_of_methods_in_packs<plain, 1>([]<class S> { return sample::free_se3<S>(); });
}

TEST(ChangedStates, of_a_lane_leave_the_others_alone_in_packs_of_any_size) {
  const auto make = []<class S> { return sample::forced_se2<S>(); };
  using Plain = Summed<Summation::plain>;
  using Compensated = Summed<Summation::compensated>;
  expect_lanes_of_their_own<Compensated::Splitting2, double, 16>(make);
  expect_lanes_of_their_own<Plain::Splitting2, double, 32>(make);
  expect_lanes_of_their_own<Compensated::Rk4, float, 1>(make);
  expect_lanes_of_their_own<Plain::Rk4, float, 4>(make);
  expect_lanes_of_their_own<Plain::Splitting2, float, 16>(make);
  expect_lanes_of_their_own<Plain::Rk4, float, 32>(make);
}

}  // namespace
