// Laws of Gauss collocation on the group: order, symplecticity, reversal, momentum, failure.
#include "hamotor/gauss.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "sample_systems.hpp"
#include "symplecticity.hpp"

namespace {

using hamotor::Gauss;
using hamotor::Gauss8;
using hamotor::LieMidpoint;
using hamotor::StateOf;
using sample::distance;
using sample::generic_state;
using sample::spatial_momentum;
using sample::stepped;
using sample::symplectic_defect;
using Wide = long double;

template <class System>
using Of = std::remove_const_t<System>;

/// H = ½ E² (1 + ¼ sin 3t) for the energy E of another system: neither separable nor autonomous.
template <class Base>
struct Squared {
  using Group = typename Base::Group;
  using Scalar = typename Base::Scalar;
  using State = StateOf<Base>;
  static constexpr std::size_t bodies = Base::bodies;
  static constexpr bool has_forque = Base::has_forque;
  Base base;

  [[nodiscard]] Scalar factor(const Scalar& t) const noexcept {
    return 1 + Scalar(0.25) * hamotor::scalar::sin(3 * t);
  }
  [[nodiscard]] Scalar energy(const State& state, const Scalar& t) const noexcept {
    const Scalar e = base.energy(state);
    return Scalar(0.5) * e * e * factor(t);
  }
  [[nodiscard]] auto gradient(const State& state, const Scalar& t) const noexcept {
    auto result = hamotor::gradient(base, state, t);
    const Scalar by = base.energy(state) * factor(t);
    for (auto& rate : result.rates) rate = by * rate;
    for (auto& forque : result.forques) forque = by * forque;
    return result;
  }
};

template <std::size_t stages, class System>
void expect_order(const System& system, int coarse) {
  const auto start = generic_state(system);
  const Wide end = Wide(0.5);
  const auto reference = stepped<Gauss8<System>>(system, start, end / 60, 60);
  const auto error = [&](int steps) {
    return distance(stepped<Gauss<System, stages>>(system, start, end / Wide(steps), steps),
                    reference);
  };
  const double fine = error(2 * coarse);
  EXPECT_GT(fine, 1e-17) << "nothing to measure";
  EXPECT_NEAR(std::log2(error(coarse) / fine), 2.0 * static_cast<double>(stages), 0.1);
}

TEST(Gauss, has_order_of_twice_its_stages) {
  const auto space = sample::forced_se3<Wide>();
  expect_order<1>(space, 20);
  expect_order<2>(space, 10);
  expect_order<3>(space, 20);
  expect_order<3>(sample::free_so3<Wide>(), 3);
  expect_order<2>(sample::forced_se2<Wide>(), 10);
}

TEST(Gauss, has_its_order_where_small_momenta_stand_beside_a_fast_spin) {
  using Top = hamotor::PivotedBody<sample::SO3, Wide, hamotor::RotationSplit{0, 2, 1, 1}>;
  const hamotor::RigidBodies system{
      std::tuple{Top(1, {0.3L, 0.3L, 0.05L}, {0, 0, 0.5L}, {0, 0, 0})},
      std::tuple{hamotor::UniformGravity<sample::SO3, Wide>{{0, 0, -9.81L}}}};
  using System = Of<decltype(system)>;
  auto start = generic_state(system);
  start.momenta[0] = {0, 0, 150 * 0.05L};
  const auto after = [&](int steps) {
    return stepped<hamotor::Gauss6<System>>(system, start, Wide(0.1) / steps, steps);
  };
  const auto reference = stepped<hamotor::Splitting8<System>>(system, start, Wide(0.002), 50);
  const double fine = distance(after(160), reference);
  EXPECT_LT(fine, 1e-9);
  EXPECT_NEAR(std::log2(distance(after(80), reference) / fine), 6, 0.1);
}

TEST(Gauss, has_its_order_where_the_energy_does_not_separate_and_depends_on_time) {
  const auto base = sample::forced_so3<Wide>();
  expect_order<2>(Squared<Of<decltype(base)>>{base}, 10);
}

TEST(Gauss, of_four_stages_has_order_8) {
  const auto system = sample::forced_so3<Wide>();
  using System = Of<decltype(system)>;
  const auto start = generic_state(system);
  const auto after = [&](int steps) {
    return stepped<Gauss8<System>>(system, start, 1 / Wide(steps), steps);
  };
  const auto reference = after(60);
  EXPECT_NEAR(std::log2(distance(after(8), reference) / distance(after(16), reference)), 8, 0.1);
}

template <std::size_t... stages, class System>
void expect_symplectic(const System& system) {
  const double h = 0.15;
  EXPECT_LT(std::max({symplectic_defect<Gauss<System, stages>>(system, h)...}), 1e-12);
  EXPECT_GT((symplectic_defect<hamotor::Rkmk4<System>>(system, h)), 1e-8) << "nothing is tested";
}

TEST(Gauss, is_symplectic) {
  expect_symplectic<1, 3>(sample::forced_se3<sample::Dual>());
  expect_symplectic<4>(sample::forced_so3<sample::Dual>());
}

TEST(Gauss, is_symplectic_where_the_energy_does_not_separate) {
  const auto base = sample::forced_se2<sample::Dual>();
  expect_symplectic<1, 2>(Squared<Of<decltype(base)>>{base});
}

template <class Method, class System>
void expect_returns(const System& system) {
  const auto start = generic_state(system);
  auto state = stepped<Method>(system, start, 0.05, 100);
  EXPECT_GT(distance(state, start), 0.1);
  state = stepped<Method>(system, state, -0.05, 100);
  EXPECT_LT(distance(state, start), 2e-13);
}

TEST(Gauss, is_time_reversible_to_rounding) {
  const auto space = sample::forced_se3();
  expect_returns<LieMidpoint<Of<decltype(space)>>>(space);
  expect_returns<hamotor::Gauss4<Of<decltype(space)>>>(space);
  const auto plane = sample::two_bodies_se2();
  expect_returns<hamotor::Gauss6<Of<decltype(plane)>>>(plane);
}

template <class Method, class System>
double lost_momentum(const System& system) {
  const auto start = generic_state(system);
  return distance(spatial_momentum(stepped<Method>(system, start, 0.05, 1000)),
                  spatial_momentum(start));
}

TEST(Gauss, keeps_the_spatial_momentum_to_rounding) {
  const auto free = sample::free_se3();
  EXPECT_LT(lost_momentum<LieMidpoint<Of<decltype(free)>>>(free), 1e-12);
  EXPECT_LT(lost_momentum<hamotor::Gauss4<Of<decltype(free)>>>(free), 1e-12);
  const auto two = sample::two_bodies_se3();
  EXPECT_LT(lost_momentum<hamotor::Gauss6<Of<decltype(two)>>>(two), 1e-11);
}

TEST(Gauss, energy_error_does_not_grow) {
  const auto base = sample::forced_so3();
  const Squared<Of<decltype(base)>> system{base};
  const auto worst_within = [&](auto method, int steps) {
    auto state = generic_state(system);
    const double before = base.energy(state);
    double worst = 0;
    // The time of an autonomous system: its factor is the constant 1.
    for (int k = 0; k < steps; ++k) {
      method.do_step(system, state, 0, 0.02);
      worst = std::max(worst, std::abs(base.energy(state) / before - 1));
    }
    return worst;
  };
  using System = Of<decltype(system)>;
  const double early = worst_within(hamotor::Gauss4<System>{}, 2000);
  const double late = worst_within(hamotor::Gauss4<System>{}, 20000);
  EXPECT_LT(late, 1.5 * early);
  EXPECT_LT(late, 1e-4);
}

/// Largest defect of Σ b_j c_j^(k−1) = 1/k for k ≤ 2s and of Σ a_ij c_j^(k−1) = c_i^k/k for k ≤ s.
template <std::size_t stages>
Wide quadrature_defect() {
  const auto table = hamotor::detail::gauss_table<Wide, stages>();
  Wide worst = 0;
  for (std::size_t i = 0; i <= stages; ++i) {
    const bool all = i == stages;
    for (int k = 1; k <= static_cast<int>(all ? 2 * stages : stages); ++k) {
      Wide sum = 0;
      for (std::size_t j = 0; j < stages; ++j) {
        const Wide a = all ? 1 : Wide(0.5) + table.skew[i][j];
        sum += a * table.weights[j] * std::pow(table.nodes[j], Wide(k - 1));
      }
      worst = std::max(worst, std::abs(sum - std::pow(all ? 1 : table.nodes[i], Wide(k)) / k));
    }
  }
  for (std::size_t i = 0; i < stages; ++i) {
    for (std::size_t j = 0; j < stages; ++j) {
      if (table.skew[i][j] != -table.skew[j][i]) worst = 1;
    }
  }
  return worst;
}

TEST(GaussTable, integrates_polynomials_and_is_symplectic_to_the_last_bit) {
  EXPECT_LT(quadrature_defect<1>(), 1e-18L);
  EXPECT_LT(quadrature_defect<2>(), 1e-18L);
  EXPECT_LT(quadrature_defect<5>(), 1e-18L);
  EXPECT_LT(quadrature_defect<8>(), 1e-18L);
}

auto on_a_spring(double stiffness, double rest_length) {
  return hamotor::RigidBodies{
      std::tuple{sample::body()},
      std::tuple{hamotor::SpringToWorld<0, sample::SE3, double>{.at = {0.3, -0.2, 0.5},
                                                                .anchor = {0.2, 0.1, 2},
                                                                .stiffness = stiffness,
                                                                .rest_length = rest_length}}};
}

TEST(Gauss, converges_for_a_stiff_spring_by_newtons_method) {
  auto state = generic_state(on_a_spring(1, 0));
  const double length = std::sqrt(2 * on_a_spring(1, 0).potential(state.motors));
  const auto system = on_a_spring(1e6, 0.999 * length);
  using System = Of<decltype(system)>;
  const auto before = system.energy(state);
  hamotor::Gauss8<System> method;
  for (int k = 0; k < 100; ++k) {
    method.do_step(system, state, 0, 0.006);  // seven radians of its oscillation
    ASSERT_EQ(method.failure(), hamotor::Failure::none) << k;
  }
  EXPECT_TRUE(method.by_newton());
  EXPECT_LT(method.iterations(), 40);
  EXPECT_NEAR(system.energy(state) / before, 1, 0.2);
}

/// Nearly symmetric, at 60 rad/s.
TEST(Gauss, converges_for_a_fast_spin_in_few_iterations) {
  using Body = hamotor::PivotedBody<sample::SO3, double>;
  const hamotor::RigidBodies system{std::tuple{Body(1, {1, 1.0001, 1.9}, {0, 0, 0}, {0, 0, 0})}};
  using System = Of<decltype(system)>;
  const auto start = [] {
    StateOf<System> state{};
    state.motors[0].s = 1;
    state.momenta[0] = {0.3, 0.2 * 1.0001, 60 * 1.9};
    return state;
  }();
  const auto after = [&](int steps, int most_iterations) {
    auto state = start;
    hamotor::Gauss16<System> method;
    int iterations = 0;
    for (int k = 0; k < steps; ++k) {
      method.do_step(system, state, 0, 2.0 / steps);
      EXPECT_EQ(method.failure(), hamotor::Failure::none);
      iterations += method.iterations();
    }
    EXPECT_LT(iterations, most_iterations * steps);
    return state;
  };
  const auto reference = after(160, 14);
  EXPECT_LT(distance(after(60, 22), reference), 1e-11);
  EXPECT_LT(distance(after(40, 60), reference), 1e-9);  // three radians a step
}

TEST(Gauss, settles_at_rounding_where_positions_have_lost_digits) {
  const double far = 1e8;
  const hamotor::RigidBodies system{
      std::tuple{sample::body()},
      std::tuple{hamotor::SpringToWorld<0, sample::SE3, double, hamotor::RestLength::zero>{
          .at = {0.05, 0.1, 0.15}, .anchor = {far, far, -far}, .stiffness = 20, .rest_length = 0}}};
  using System = Of<decltype(system)>;
  StateOf<System> start{};
  start.motors[0] = exp(sample::SE3::Rate<double>{0, 0, 0, far + 0.5, far, -far});
  start.momenta[0] = {0, 0, 1, 0, 0.3, 0};
  const auto check = [&](auto method, int steps, double h, double bound) {
    auto state = start;
    for (int k = 0; k < steps; ++k) {
      method.do_step(system, state, 0, h);
      ASSERT_EQ(method.failure(), hamotor::Failure::none) << method.name << " step " << k;
    }
    EXPECT_NEAR(system.energy(state) / system.energy(start), 1, bound) << method.name;
  };
  check(hamotor::Gauss8<System>{}, 200, 0.01, 1e-5);
  check(hamotor::LieMidpoint<System>{}, 2000, 3e-4, 1e-5);
}

/// One moment a part in 1e8 of the others: errors of attitude are errors of that rate 1e8 times as
/// large, which stages hand on to each other.
TEST(Gauss, converges_where_one_moment_is_nothing_beside_the_others) {
  const hamotor::RigidBodies system{
      std::tuple{hamotor::FreeBody<sample::SE3, double>(1, {1, 1.000000005, 1e-8})}};
  using System = Of<decltype(system)>;
  StateOf<System> state{};
  state.motors[0].s = 1;
  state.momenta[0] = {1, 0.5, 2e-8, 0.1, 0.2, -0.3};
  const auto before = system.energy(state);
  hamotor::Gauss8<System> method;
  for (int k = 0; k < 100; ++k) {
    method.do_step(system, state, 0, 0.005);
    ASSERT_EQ(method.failure(), hamotor::Failure::none) << k;
  }
  EXPECT_NEAR(system.energy(state) / before, 1, 1e-14);
}

TEST(Gauss, gives_no_number_where_the_stages_do_not_converge) {
  const auto system = sample::forced_se3();
  auto state = generic_state(system);
  hamotor::Gauss4<Of<decltype(system)>> method;
  method.do_step(system, state, 0, 40);
  EXPECT_TRUE(std::isnan(state.momenta[0].l23));
}

TEST(Gauss, of_a_body_at_rest_leaves_it_there) {
  const auto system = sample::free_se3();
  auto state = generic_state(system);
  state.momenta[0] = {};
  const auto start = state;
  hamotor::Gauss4<Of<decltype(system)>> method;
  for (int k = 0; k < 3; ++k) method.do_step(system, state, 0, 0.5);
  EXPECT_LT(distance(state, start), 1e-15);
}

TEST(Gauss, moves_alike_in_float_and_double) {
  const auto single = sample::forced_so3<float>();
  const auto twice = sample::forced_so3();
  const auto a =
      stepped<hamotor::Gauss4<Of<decltype(single)>>>(single, generic_state(single), 0.05F, 40);
  const auto b =
      stepped<hamotor::Gauss4<Of<decltype(twice)>>>(twice, generic_state(twice), 0.05, 40);
  EXPECT_LT(distance(a.motors[0].template cast<double>(), b.motors[0]), 2e-5);
  EXPECT_LT(distance(a.momenta[0].template cast<double>(), b.momenta[0]), 2e-5);
}

}  // namespace
