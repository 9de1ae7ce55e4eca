// Laws of the explicit pair 5(4): order, its estimate, and steps that meet a tolerance.
#include "hamotor/adaptive.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "sample_systems.hpp"

namespace {

using hamotor::Adaptive;
using hamotor::Rk54;
using hamotor::Rk87;
using hamotor::Rkmk54;
using hamotor::Rkmk87;
using hamotor::StateOf;
using sample::distance;
using sample::generic_state;
using Wide = long double;

template <class System>
using CommutatorFree4 = hamotor::CommutatorFree4<System>;

template <class System>
using Of = std::remove_const_t<System>;

template <template <class> class Method, class System>
auto stepped(const System& system, int steps) {
  using S = typename System::Scalar;
  auto state = generic_state(system);
  Method<System> method;
  for (int k = 0; k < steps; ++k) method.do_step(system, state, 0, 1 / S(steps));
  return state;
}

template <template <class> class Method, class System>
void expect_order(const System& system, int coarse) {
  const auto reference = stepped<Rkmk87>(system, std::max(8 * coarse, 200));
  const double fine = distance(stepped<Method>(system, 2 * coarse), reference);
  EXPECT_GT(fine, 1e-17) << "nothing to measure";
  EXPECT_NEAR(std::log2(distance(stepped<Method>(system, coarse), reference) / fine),
              Method<System>::order, 0.1)
      << Method<System>::name;
}

template <class System>
void expect_orders(const System& system, int coarse) {
  expect_order<CommutatorFree4>(system, coarse);
  expect_order<Rkmk54>(system, coarse);
}

TEST(ExplicitMethods, have_their_orders) {
  expect_orders(sample::free_se3<Wide>(), 80);
  expect_orders(sample::free_so3<Wide>(), 40);
  expect_orders(sample::forced_se3<Wide>(), 160);
  expect_orders(sample::forced_so3<Wide>(), 80);
  expect_orders(sample::forced_se2<Wide>(), 160);
  expect_orders(sample::two_bodies_se3<Wide>(), 160);
  expect_order<Rkmk87>(sample::forced_se3<Wide>(), 48);
  expect_order<Rkmk87>(sample::forced_so3<Wide>(), 16);
  expect_order<Rkmk87>(sample::forced_se2<Wide>(), 16);
  expect_order<Rk54>(sample::forced_so3<Wide>(), 80);
  expect_order<Rk87>(sample::forced_so3<Wide>(), 16);
}

/// A rooted tree by its subtrees, an index into `trees` each; γ is Butcher's density.
struct Tree {
  std::vector<std::size_t> branches;
  int vertices;
  Wide density;
};

/// All rooted trees of up to so many vertices: one more vertex under a multiset of smaller trees.
std::vector<Tree> rooted_trees(int most) {
  std::vector<Tree> trees;
  const auto grow = [&](const auto& self, Tree tree, std::size_t from, int left) -> void {
    if (left == 0) {
      tree.density *= tree.vertices;
      trees.push_back(tree);
      return;
    }
    for (std::size_t k = from; k < trees.size() && trees[k].vertices <= left; ++k) {
      Tree next = tree;
      next.branches.push_back(k);
      next.density *= trees[k].density;
      self(self, next, k, left - trees[k].vertices);
    }
  };
  for (int vertices = 1; vertices <= most; ++vertices) {
    grow(grow, Tree{{}, vertices, 1}, 0, vertices - 1);
  }
  return trees;
}

/// Largest |Σ b_i Φ_i(t) − θⁿ/γ(t)| over the trees of up to `order` vertices n: Butcher's order
/// conditions, at the fraction θ of a step.
template <class Pair, std::size_t stages>
Wide order_defect(const std::array<Wide, stages>& weights, int order, Wide at = 1) {
  const auto trees = rooted_trees(order);
  std::vector<std::array<Wide, stages>> phi;
  Wide worst = 0;
  for (const Tree& tree : trees) {
    std::array<Wide, stages> value{};
    value.fill(1);
    for (const std::size_t branch : tree.branches) {
      for (std::size_t i = 0; i < stages; ++i) {
        const auto row = hamotor::detail::numbers<Wide>(Pair::rows[i]);
        Wide sum = 0;
        for (std::size_t j = 0; j < i; ++j) sum += row[j] * phi[branch][j];
        value[i] *= sum;
      }
    }
    Wide sum = 0;
    for (std::size_t i = 0; i < stages; ++i) sum += weights[i] * value[i];
    worst = std::max(worst, std::abs(sum - std::pow(at, tree.vertices) / tree.density));
    phi.push_back(value);
  }
  return worst;
}

template <class Pair>
void expect_order_conditions() {
  const auto weights = hamotor::detail::numbers<Wide>(Pair::weights);
  auto lower = weights;
  const auto error = hamotor::detail::numbers<Wide>(Pair::error);
  for (std::size_t i = 0; i < lower.size(); ++i) lower[i] -= error[i];
  EXPECT_LT(order_defect<Pair>(weights, Pair::order), 3e-18L);
  EXPECT_LT(order_defect<Pair>(lower, Pair::lower_order), 3e-18L);
  EXPECT_GT(order_defect<Pair>(weights, Pair::order + 1), 1e-7L);
  EXPECT_GT(order_defect<Pair>(lower, Pair::lower_order + 1), 1e-7L);
}

TEST(Pairs, meet_the_order_conditions) {
  EXPECT_EQ(rooted_trees(8).size(), 1U + 1 + 2 + 4 + 9 + 20 + 48 + 115);
  expect_order_conditions<hamotor::DormandPrince54>();
  expect_order_conditions<hamotor::PrinceDormand87>();
}

template <class Pair>
void expect_continuous_extension() {
  for (const Wide at : {0.1L, 0.5L, 0.9L, 1.0L}) {
    const auto weights = hamotor::continuous_weights<Pair>(at);
    EXPECT_LT(order_defect<Pair>(weights, Pair::dense_order, at), 1e-17L) << at;
    EXPECT_GT(order_defect<Pair>(weights, Pair::dense_order + 1, at), at < 1 ? 1e-9L : 0) << at;
  }
}

TEST(Pairs, have_continuous_extensions_of_their_orders) {
  expect_continuous_extension<hamotor::DormandPrince54>();
  expect_continuous_extension<hamotor::PrinceDormand87>();
}

template <template <class> class Method, class System>
void expect_order_within_a_step(const System& system, Wide h) {
  const auto start = generic_state(system);
  for (const Wide at : {0.15L, 0.4L, 0.75L}) {
    const auto error = [&](Wide length) {
      auto state = start;
      Method<System> method;
      method.do_step(system, state, 0, length);
      auto reference = start;
      Rkmk87<System> finer;
      for (int k = 0; k < 4; ++k) finer.do_step(system, reference, 0, length * at / 4);
      return distance(method.between(system, start, 0, at), reference);
    };
    EXPECT_NEAR(std::log2(error(h) / error(h / 2)), Method<System>::dense_order + 1, 0.25)
        << Method<System>::name << " at " << at;
  }
}

TEST(ExplicitPair, is_interpolated_to_its_dense_order) {
  expect_order_within_a_step<Rkmk54>(sample::forced_se3<Wide>(), 0.002L);
  expect_order_within_a_step<Rkmk87>(sample::forced_se3<Wide>(), 0.04L);
  expect_order_within_a_step<Rkmk87>(sample::two_bodies_se3<Wide>(), 0.04L);
  expect_order_within_a_step<Rk54>(sample::forced_so3<Wide>(), 0.01L);
  expect_order_within_a_step<Rk87>(sample::forced_so3<Wide>(), 0.04L);
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

TEST(ExponentialChart, an_error_of_the_exponent_is_what_it_does_to_the_motor) {
  const auto m = generic_state(sample::forced_se3()).motors[0];
  const hamotor::pga3::se3::Rate<double> x{1e-6, -2e-6, 3e-6, 5e-6, -4e-6, 2e-6};
  const auto done = (gp(m, exp(x)) - m).components();
  const auto said = hamotor::detail::ExponentialChart::error(m, x).components();
  for (std::size_t k = 0; k < done.size(); ++k) EXPECT_NEAR(said[k], done[k], 1e-10);
}

template <class System>
void expect_tolerance_met(const System& system) {
  const auto reference = stepped<Rkmk87>(system, 400);
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

/// The states at the given times, and the method that took them there.
template <class Method, class System>
auto states_at(const System& system, const std::vector<double>& times) {
  auto state = generic_state(system);
  Method method(1e-9);
  std::vector<StateOf<System>> states;
  double t = 0;
  for (const double time : times) {
    method.do_step(system, state, t, time - t);
    t = time;
    states.push_back(state);
  }
  return std::pair{states, method};
}

template <class Method, class System>
void expect_output_for_nothing(const System& system) {
  std::vector<double> often;
  for (int k = 1; k <= 256; ++k) often.push_back(k / 128.0);
  const auto [rare, few] = states_at<Method>(system, {1.0, 2.0});
  const auto [dense, many] = states_at<Method>(system, often);
  EXPECT_EQ(many.tried(), few.tried());
  EXPECT_EQ(many.steps(), few.steps());
  EXPECT_EQ(many.drift().sum, few.drift().sum) << "steps are the same to the last bit";
  EXPECT_EQ(dense[127], rare[0]);
  EXPECT_EQ(dense[255], rare[1]);
  for (const std::size_t k : {37U, 101U, 250U}) {
    Rkmk87<System> finer;
    auto reference = generic_state(system);
    for (int j = 0; j < 100; ++j) finer.do_step(system, reference, 0, often[k] / 100);
    EXPECT_LT(distance(dense[k], reference), 1e-7);
  }
}

TEST(Adaptive, takes_no_step_more_for_states_at_more_times) {
  const auto system = sample::forced_se3();
  using System = Of<decltype(system)>;
  expect_output_for_nothing<Adaptive<System>>(system);
  expect_output_for_nothing<Adaptive<System, Rkmk87<System>>>(system);
  expect_output_for_nothing<Adaptive<System, Rk87<System>>>(system);
}

TEST(Adaptive, is_the_same_after_looks_into_its_next_step) {
  const auto system = sample::forced_se3();
  using System = Of<decltype(system)>;
  Adaptive<System, Rkmk87<System>> looked(1e-9);
  auto undisturbed = looked;
  auto state = generic_state(system);
  auto same = state;
  const auto start = state;
  for (int k = 0; k < 4; ++k) {
    for (const double part : {0.125, 0.375, 0.0625}) {
      double work = 0;
      const auto there = looked.look(system, state, 0.5 * k, 0.5, part, work);
      auto reference = start;
      Adaptive<System, Rkmk87<System>>(1e-11).do_step(system, reference, 0, 0.5 * k + part);
      EXPECT_LT(distance(there, reference), 1e-7);
    }
    looked.do_step(system, state, 0.5 * k, 0.5);
    undisturbed.do_step(system, same, 0.5 * k, 0.5);
    EXPECT_EQ(state, same);
  }
  EXPECT_EQ(looked.tried(), undisturbed.tried()) << "no step is taken twice";
}

TEST(Adaptive, of_order_8_needs_fewer_evaluations_for_a_small_error) {
  const auto system = sample::forced_so3();
  using System = Of<decltype(system)>;
  auto state = generic_state(system);
  auto other = state;
  Adaptive<System, Rkmk87<System>> high(1e-11);
  Adaptive<System> low(1e-11);
  high.do_step(system, state, 0, 1);
  low.do_step(system, other, 0, 1);
  EXPECT_LT(distance(state, other), 1e-10);
  EXPECT_LT(13 * high.tried(), 3 * low.tried());
}

TEST(Adaptive, starts_anew_from_a_state_that_was_changed) {
  const auto system = sample::forced_so3();
  using System = Of<decltype(system)>;
  auto state = generic_state(system);
  Adaptive<System> used(1e-9);
  used.do_step(system, state, 0, 0.3);
  state.motors[0] = gp(state.motors[0], state.motors[0]);
  auto same = state;
  used.do_step(system, state, 0.3, 0.3);
  Adaptive<System> fresh(1e-9);
  fresh.do_step(system, same, 0.3, 0.3);
  EXPECT_EQ(state, same);
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

TEST(Adaptive, asks_no_step_for_less_than_rounding) {
  const auto system = sample::forced_se3();
  Adaptive<Of<decltype(system)>, Rkmk87<Of<decltype(system)>>> fine(1e-15);
  Adaptive<Of<decltype(system)>, Rkmk87<Of<decltype(system)>>> impossible(1e-25);
  auto state = generic_state(system);
  auto same = state;
  fine.do_step(system, state, 0, 1);
  impossible.do_step(system, same, 0, 1);
  EXPECT_LT(distance(same, state), 1e-13);
  EXPECT_LT(impossible.tried(), 10 * fine.tried());
}

TEST(Adaptive, says_where_a_time_is_none) {
  const auto system = sample::forced_so3();
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const double h : {infinity, -infinity, std::numeric_limits<double>::quiet_NaN()}) {
    Adaptive<std::remove_const_t<decltype(system)>> method(1e-6);
    const auto start = generic_state(system);
    auto state = start;
    method.do_step(system, state, 0, h);
    EXPECT_EQ(method.failure(), hamotor::Failure::not_finite) << h;
    EXPECT_FALSE(is_finite(state)) << h;
    state = start;
    method.do_step(system, state, 0, 0.1);
    EXPECT_EQ(method.failure(), hamotor::Failure::none) << h;
    auto expected = start;
    decltype(method)(1e-6).do_step(system, expected, 0, 0.1);
    EXPECT_EQ(state, expected) << h;
  }
}

TEST(Adaptive, goes_on_to_the_same_bits_from_where_its_patience_ended) {
  const auto system = sample::forced_se3();
  auto at_once = generic_state(system);
  auto in_parts = at_once;
  Adaptive<Of<decltype(system)>> whole(1e-9);
  Adaptive<Of<decltype(system)>> patient(1e-9);
  whole.do_step(system, at_once, 0, 1);
  patient.set_patience(7);
  long long calls = 0;
  do {
    EXPECT_EQ(in_parts, generic_state(system));
    patient.do_step(system, in_parts, 0, 1);
    EXPECT_LE(patient.tried(), 8 * ++calls);
  } while (patient.paused());
  EXPECT_GT(calls, 2);
  EXPECT_EQ(in_parts, at_once);
  EXPECT_EQ(patient.tried(), whole.tried());
}

TEST(Adaptive, ends_where_rounding_is_all_that_it_estimates) {
  const auto system = sample::free_so3<double>();
  for (int k = 0; k < 40; ++k) {
    auto state = generic_state(system);
    state.momenta[0] = 20 * state.momenta[0];
    Adaptive<Of<decltype(system)>, Rkmk87<Of<decltype(system)>>> method(3.6e-15 * (1 + 0.01 * k));
    method.do_step(system, state, 0, 10);
    EXPECT_LT(method.tried(), 20000) << k;  // 2200 would do at a tolerance that can be had
  }
}

}  // namespace
