// The free body's motion in closed form, against Taylor series, published digits and itself in more
// digits, in every limit.
#include "hamotor/free_body.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "hamotor/methods.hpp"
#include "sample_systems.hpp"

namespace {

using hamotor::FreeMotion;
using hamotor::FreeRotation;
using sample::distance;
using sample::generic_state;
using sample::spatial_momentum;
using Wide = long double;
using Moments = std::array<double, 3>;

/// A body and its angular momentum at the start.
struct Body {
  std::string what;
  Moments moments;
  Moments angular;

  [[nodiscard]] double fastest() const {
    const double size = std::hypot(angular[0], angular[1], angular[2]);
    Moments sorted = moments;
    std::sort(sorted.begin(), sorted.end());
    double rate = size / std::sqrt(sorted[0] * sorted[1]);
    for (std::size_t k = 0; k < 3; ++k) rate = std::max(rate, std::abs(angular[k]) / moments[k]);
    return rate;
  }
};

/// Every relation of moments and momenta in which a formula could lose its digits.
std::vector<Body> bodies() {
  std::vector<Body> all{{"spherical", {2, 2, 2}, {1, -2, 3}},
                        {"symmetric", {2, 2, 3}, {1, -2, 3}},
                        {"symmetric about x", {1, 2, 2}, {1, -2, 3}},
                        {"symmetric about y", {2, 1, 2}, {1, 2, -3}},
                        {"symmetric, about its equator", {2, 2, 3}, {1, -2, 0}},
                        {"low, middle, high", {1, 2, 3}, {2, 1, 6}},
                        {"high, low, middle", {3, 1, 2}, {2, 1, 6}},
                        {"high, middle, low", {3, 2, 1}, {-2, 1, -0.6}},
                        {"middle, high, low", {2, 3, 1}, {-2, -5, 0.6}},
                        {"middle, low, high", {2, 1, 3}, {2, 1, -3}},
                        {"low, high, middle", {1, 3, 2}, {2, -1, -0.3}},
                        {"about the lowest", {1, 2, 3}, {2, 0, 0}},
                        {"about the middle", {1, 2, 3}, {0, -2, 0}},
                        {"about the highest", {1, 2, 3}, {0, 0, 2}},
                        {"at rest", {1, 2, 3}, {0, 0, 0}},
                        {"close to the separatrix", {1, 2, 4}, {1, 1, std::sqrt(2.0)}},
                        {"on the separatrix", {1, 2, 4}, {-1, 0.5, std::sqrt(2.0)}},
                        {"P1", {1, 2, 3}, {0.002, 4, 0.006}},
                        {"P2", {1, 1.0001, 1.9}, {0.3, 0.20002, 114}},
                        {"flat", {1, 2, 3}, {1e-3, 1e-3, 5}},
                        {"rod", {1, 1, 1e-8}, {1, 2, 1e-10}},
                        {"asymmetric rod", {1, 0.9, 1e-8}, {1, 2, 1e-8}}};
  for (int exponent = -1; exponent >= -16; --exponent) {
    const double d = std::pow(10.0, exponent);
    const std::string by = " by 1e" + std::to_string(exponent);
    all.push_back({"not spherical" + by, {1, 1 + d, 1 + 2.5 * d}, {0.3, 0.5, 0.7}});
    all.push_back({"not symmetric" + by, {1, 1 + d, 2}, {0.3, 0.5, 0.7}});
    all.push_back({"not symmetric above" + by, {0.5, 1 + d, 1}, {0.3, 0.5, 0.7}});
    all.push_back({"not symmetric, across" + by, {0.5, 1 + d, 1}, {0.03, 0.5, 0.7}});
    all.push_back(
        {"not symmetric, at the separatrix" + by, {1, 1 + d, 1.9}, {0.3, 0.5, std::sqrt(d)}});
    all.push_back({"outside the separatrix" + by, {1, 2, 4}, {1, 1, std::sqrt(2.0) * (1 + d)}});
    all.push_back({"inside the separatrix" + by, {1, 2, 4}, {1, -1, -std::sqrt(2.0) * (1 - d)}});
    all.push_back({"off a stable axis" + by, {1, 2, 4}, {1, d, d}});
    all.push_back({"off the unstable axis" + by, {1, 2, 4}, {-d, -1, d}});
  }
  return all;
}

template <class S>
struct Turned {
  std::array<S, 4> rotor;
  std::array<S, 3> angular;
};

template <class S>
std::array<S, 3> in(const Moments& x) {
  return {S(x[0]), S(x[1]), S(x[2])};
}

template <class S>
Turned<S> closed_form(const std::array<S, 3>& moments, const std::array<S, 3>& angular,
                      const S& t) {
  const auto now = FreeRotation<S, 3>(moments, angular).at(t);
  return {{now.rotor.cosine_less_one + S(1), now.rotor.sines[0], now.rotor.sines[1],
           now.rotor.sines[2]},
          now.angular};
}

template <class S>
Turned<S> closed_form(const Body& body, double t) {
  return closed_form<S>(in<S>(body.moments), in<S>(body.angular), S(t));
}

/// Largest difference of rotors, and of momenta relative to their size.
template <class A, class B>
double error(const Turned<A>& a, const Turned<B>& b) {
  double worst = 0;
  double size = 0;
  const auto take = [&](double difference, double over) {
    const double relative = std::abs(difference) / over;
    worst = relative <= worst ? worst : relative;
  };
  for (const B& x : b.angular) size = std::hypot(size, static_cast<double>(x));
  for (std::size_t k = 0; k < 4; ++k) {
    take(static_cast<double>(static_cast<B>(a.rotor[k]) - b.rotor[k]), 1);
  }
  for (std::size_t k = 0; k < 3; ++k) {
    take(static_cast<double>(static_cast<B>(a.angular[k]) - b.angular[k]), size > 0 ? size : 1);
  }
  return worst;
}

/// Euler's equations and q̇ = ½ q Ω by Taylor series, which share nothing with elliptic functions.
template <class S>
Turned<S> taylor(const Body& body, double t) {
  constexpr std::size_t order = 30;
  const auto steps = static_cast<int>(std::ceil(std::abs(t) * body.fastest() / 0.2)) + 1;
  const S h = S(t) / S(steps);
  Turned<S> now{{S(1), S(0), S(0), S(0)}, in<S>(body.angular)};
  const auto moments = in<S>(body.moments);
  using Series = std::array<S, order + 1>;
  const auto coefficient = [](const Series& x, const Series& y, std::size_t k) {
    S sum(0);
    for (std::size_t j = 0; j <= k; ++j) sum = sum + x[j] * y[k - j];
    return sum;
  };
  for (int step = 0; step < steps; ++step) {
    std::array<Series, 4> q{};
    std::array<Series, 3> p{};
    std::array<Series, 3> w{};
    for (std::size_t i = 0; i < 4; ++i) q[i][0] = now.rotor[i];
    for (std::size_t i = 0; i < 3; ++i) p[i][0] = now.angular[i];
    for (std::size_t k = 0; k < order; ++k) {
      const S by = S(1) / S(static_cast<int>(k) + 1);
      for (std::size_t i = 0; i < 3; ++i) w[i][k] = p[i][k] / moments[i];
      S real(0);
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t a = (i + 1) % 3;
        const std::size_t b = (i + 2) % 3;
        p[i][k + 1] = by * (coefficient(p[a], w[b], k) - coefficient(p[b], w[a], k));
        q[i + 1][k + 1] = S(0.5) * by *
                          (coefficient(q[0], w[i], k) + coefficient(q[a + 1], w[b], k) -
                           coefficient(q[b + 1], w[a], k));
        real = real + coefficient(q[i + 1], w[i], k);
      }
      q[0][k + 1] = S(-0.5) * by * real;
    }
    const auto value = [&](const Series& x) {
      S sum = x[order];
      for (std::size_t k = order; k-- > 0;) sum = sum * h + x[k];
      return sum;
    };
    for (std::size_t i = 0; i < 4; ++i) now.rotor[i] = value(q[i]);
    for (std::size_t i = 0; i < 3; ++i) now.angular[i] = value(p[i]);
  }
  return now;
}

TEST(FreeRotation, is_the_solution_in_every_limit) {
  for (const Body& body : bodies()) {
    if (body.fastest() > 100) continue;  // too many steps for the series
    for (const double t : {-1.5, 4.0}) {
      EXPECT_LT(error(closed_form<Wide>(body, t), taylor<Wide>(body, t)), 1e-16) << body.what;
    }
  }
}

#ifdef HAMOTOR_HAS_QUADMATH
using Quad = hamotor::scalar::Float128;

TEST(FreeRotation, in_float128_has_thirty_digits) {
  for (const std::size_t index : {1U, 5U, 7U, 15U, 17U, 40U}) {
    const Body body = bodies()[index];
    EXPECT_LT(error(closed_form<Quad>(body, 3), taylor<Quad>(body, 3)), 1e-31) << body.what;
  }
}

/// What a rounding error of the set-up's arithmetic in every moment and momentum changes.
template <class S>
double condition(const Body& body, double t, const Turned<Quad>& exact) {
  using SetUp = typename hamotor::detail::SetUpScalar<S>::type;
  const Quad by = Quad(1) + Quad(hamotor::scalar::Limits<SetUp>::epsilon());
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    auto moments = in<Quad>(body.moments);
    auto angular = in<Quad>(body.angular);
    moments[k] = by * moments[k];
    sum += error(closed_form<Quad>(moments, in<Quad>(body.angular), Quad(t)), exact);
    angular[k] = by * angular[k];
    sum += error(closed_form<Quad>(in<Quad>(body.moments), angular, Quad(t)), exact);
  }
  return sum;
}

TEST(FreeRotation, has_the_errors_of_a_few_roundings_at_any_time) {
  for (const Body& body : bodies()) {
    for (const double t : {1e-9, 0.7, -30.0, 1e4}) {
      const auto exact = closed_form<Quad>(body, t);
      EXPECT_LT(error(closed_form<double>(body, t), exact),
                1e-15 + 4 * condition<double>(body, t, exact))
          << body.what << " at " << t;
    }
  }
}
#endif

TEST(FreeRotation, in_float_has_the_errors_of_float) {
  for (const Body& body : bodies()) {
    if (body.fastest() > 1e3) continue;  // a moment of 1e-8 is another one in float
    const auto moments = in<float>(body.moments);
    const auto angular = in<float>(body.angular);
    const auto exact = closed_form<double>({moments[0], moments[1], moments[2]},
                                           {angular[0], angular[1], angular[2]}, 8.0);
    EXPECT_LT(error(closed_form<float>(moments, angular, 8.0F), exact), 5e-7) << body.what;
  }
}

TEST(FreeRotation, knows_no_units) {
  for (const Body& body : bodies()) {
    for (const double by : {0x1p-300, 0x1p300}) {
      Body scaled = body;
      for (double& x : scaled.moments) x *= by;
      for (double& x : scaled.angular) x *= by;
      auto there = closed_form<double>(scaled, 2);
      for (double& x : there.angular) x /= by;
      EXPECT_LT(error(there, closed_form<double>(body, 2)), 1e-15) << body.what;
      for (std::size_t k = 0; k < 3; ++k) scaled.moments[k] = body.moments[k];
      auto faster = closed_form<double>(scaled, 2 / by);
      for (double& x : faster.angular) x /= by;
      EXPECT_LT(error(faster, closed_form<double>(body, 2)), 1e-15) << body.what;
    }
  }
}

TEST(FreeRotation, agrees_with_published_digits) {
  // Hairer & Vilmart 2006, at t = 10.
  const Turned<Wide> asymmetric{
      {-0.73606136416079393616L, -0.57078695124035073325L, -0.29938857183079009374L,
       -0.20683908610467319248L},
      {1.7659625085182075357L, -0.6954641970330891195L, 0.7795549814818710861L}};
  EXPECT_LT(error(closed_form<Wide>({0.6L, 0.8L, 1}, {1.8L, 0.4L, -0.9L}, 10), asymmetric), 1e-17);
  // tests/references/P1.json, at t = 100, ω times the moments.
  const Turned<double> close{
      {-7.2496241234181519144e-05, 4.9366128767406803148e-01, 1.1499935689147677557e-02,
       8.6957821918181778646e-01},
      {4.9038396399203845997e-02, 2 * -1.9993997188352794583e+00, 3 * 2.8359385991269561589e-02}};
  EXPECT_LT(error(closed_form<double>({"", {1, 2, 3}, {0.002, 4, 0.006}}, 100), close), 2e-15);
}

/// A body's motion on a group, restarted half-way.
template <class System>
void expect_group_of_times(const System& system) {
  using G = typename System::Group;
  using S = typename System::Scalar;
  const auto start = generic_state(system);
  const auto motion = [&](const auto& motor, const auto& momentum) {
    return FreeMotion<G, S>(system.template body<0>().mass(), system.template body<0>().moments(),
                            motor, momentum);
  };
  const auto from_start = motion(start.motors[0], start.momenta[0]);
  const auto here = from_start.at(S(3));
  const auto there = motion(here.motor, here.momentum).at(S(-7));
  EXPECT_LT(distance(there.motor, from_start.at(S(-4)).motor), 1e-14);
  EXPECT_LT(distance(there.momentum, from_start.at(S(-4)).momentum), 1e-14);
  EXPECT_LT(distance(from_start.at(S(0)).motor, start.motors[0]), 1e-15);
  EXPECT_LT(distance(from_start.at(S(0)).momentum, start.momenta[0]), 1e-15);
  EXPECT_LT(distance(Ad_star_inverse(here.motor, here.momentum),
                     Ad_star_inverse(start.motors[0], start.momenta[0])),
            1e-14);
}

TEST(FreeMotion, is_a_group_of_times_that_keeps_the_spatial_momentum) {
  expect_group_of_times(sample::free_so3());
  expect_group_of_times(sample::free_se3());
  expect_group_of_times(sample::free_se2());
}

template <class System>
void expect_agreement_with_a_method_of_high_order(const System& system) {
  const auto start = generic_state(system);
  auto closed = start;
  auto small = start;
  hamotor::ClosedForm<System> method;
  hamotor::Gauss8<System> gauss;
  for (int k = 0; k < 60; ++k) gauss.do_step(system, small, Wide(k) / 20, Wide(1) / 20);
  for (int k = 0; k < 4; ++k) method.do_step(system, closed, Wide(0.75) * k, Wide(0.75));
  EXPECT_GT(distance(closed, start), 0.1);
  EXPECT_LT(distance(closed, small), 1e-12);
  EXPECT_LT(static_cast<double>(method.drift().largest), 1e-18);
}

TEST(ClosedForm, is_the_motion_on_every_group) {
  expect_agreement_with_a_method_of_high_order(sample::free_so3<Wide>());
  expect_agreement_with_a_method_of_high_order(sample::free_se3<Wide>());
  expect_agreement_with_a_method_of_high_order(sample::free_se2<Wide>());
  using sample::RigidBodies;
  expect_agreement_with_a_method_of_high_order(
      RigidBodies{std::tuple{sample::body<Wide>(), sample::symmetric_body<Wide>()}});
}

TEST(ClosedForm, does_not_collect_errors) {
  const auto system = sample::free_so3();
  using System = std::remove_const_t<decltype(system)>;
  const auto start = generic_state(system);
  auto state = start;
  hamotor::ClosedForm<System> method;
  constexpr double h = 0x1p-5;
  for (int k = 0; k < 20000; ++k) method.do_step(system, state, k * h, h);
  auto once = start;
  hamotor::ClosedForm<System>{}.do_step(system, once, 0, 20000 * h);
  EXPECT_LT(distance(state, once), 1e-16);
  EXPECT_LT(distance(spatial_momentum(state), spatial_momentum(start)), 1e-15);
}

TEST(ClosedForm, starts_anew_where_the_state_was_changed) {
  const auto system = sample::free_se3();
  using System = std::remove_const_t<decltype(system)>;
  auto state = generic_state(system);
  hamotor::ClosedForm<System> method;
  method.do_step(system, state, 0, 0.3);
  state.momenta[0].l12 += 0.5;
  auto other = state;
  method.do_step(system, state, 0.3, 0.7);
  hamotor::ClosedForm<System>{}.do_step(system, other, 5, 0.7);
  EXPECT_LT(distance(state, other), 1e-15);
}

TEST(ClosedForm, starts_anew_where_the_time_is_another) {
  const auto system = sample::free_se3();
  using Method = hamotor::ClosedForm<std::remove_const_t<decltype(system)>>;
  auto state = generic_state(system);
  Method method;
  method.do_step(system, state, 0, 0.7);
  auto other = state;
  method.do_step(system, state, 3, 0.7);
  Method{}.do_step(system, other, 3, 0.7);
  EXPECT_EQ(state, other);
  // From one time all the time, as nothing here depends on it.
  for (int k = 0; k < 3; ++k) method.do_step(system, state, 5, 0.7);
  Method{}.do_step(system, other, 5, 3 * 0.7);
  EXPECT_LT(distance(state, other), 1e-14);
}

TEST(ClosedForm, of_momenta_that_are_no_numbers_has_none) {
  const auto system = sample::free_so3();
  for (std::size_t k = 0; k < 3; ++k) {
    for (const double size : {0.0, 1.0}) {
      auto state = generic_state(system);
      std::array<double, 3> momentum{size, size, size};
      momentum[k] = std::nan("");
      state.momenta[0] = sample::SO3::Momentum<double>::from(momentum);
      hamotor::ClosedForm<std::remove_const_t<decltype(system)>>{}.do_step(system, state, 0, 0.7);
      EXPECT_FALSE(is_finite(state)) << k << ' ' << size;
    }
  }
}

}  // namespace
