// Motions known to 30 digits, computed twice (geometric algebra and classical mechanics) by
// programs that share nothing with this one: tests/oracles.
#include "oracle.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "hamotor/pga3/se3.hpp"
#include "hamotor/pga3/so3.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/systems.hpp"

namespace {

using hamotor::RestLength;
using hamotor::rotation_split;
using hamotor::pga3::SE3;
using hamotor::pga3::SO3;

constexpr std::string_view rhs = "initial_rhs (time derivative of M and mu at t=0)";

std::array<double, 3> triple(const oracle::Value& value) {
  return {value[0].number(), value[1].number(), value[2].number()};
}

/// The oracles' blades are in ascending order, e1^e3 = −e31; wedge and product agree in PGA.
hamotor::pga3::Rotor<double> rotor(const oracle::Value& m) {
  return {m["1"].number(), m["e2^e3"].number(), -m["e1^e3"].number(), m["e1^e2"].number()};
}

hamotor::pga3::Motor<double> motor(const oracle::Value& m) {
  const auto r = rotor(m);
  return {r.s,
          r.e23,
          r.e31,
          r.e12,
          m["e0^e1"].number(),
          m["e0^e2"].number(),
          m["e0^e3"].number(),
          m["e0^e1^e2^e3"].number()};
}

/// Core to physical: μ = −2 (P_i (e0∧e_i)* + Π_k (e_i∧e_j)*).
std::array<double, 3> angular(const oracle::Value& mu) {
  return {-0.5 * mu["(e2^e3)*"].number(), -0.5 * mu["(e3^e1)*"].number(),
          -0.5 * mu["(e1^e2)*"].number()};
}

std::array<double, 3> linear(const oracle::Value& mu) {
  return {-0.5 * mu["(e0^e1)*"].number(), -0.5 * mu["(e0^e2)*"].number(),
          -0.5 * mu["(e0^e3)*"].number()};
}

template <class G>
hamotor::State<G, 1, double> state(const oracle::Value& at);

template <>
hamotor::State<SE3, 1, double> state<SE3>(const oracle::Value& at) {
  const auto l = angular(at["mu"]);
  const auto p = linear(at["mu"]);
  return {{motor(at["M"])}, {{{l[0], l[1], l[2], p[0], p[1], p[2]}}}};
}

template <>
hamotor::State<SO3, 1, double> state<SO3>(const oracle::Value& at) {
  return {{rotor(at["M"])}, {{hamotor::pga3::so3::Momentum<double>::from(angular(at["mu"]))}}};
}

/// Largest difference of two values' components.
template <class T>
double distance(const T& a, const T& b) {
  double largest = 0;
  const auto x = a.components();
  const auto y = b.components();
  for (std::size_t k = 0; k < x.size(); ++k) largest = std::max(largest, std::abs(x[k] - y[k]));
  return largest;
}

template <class T>
double size(const T& a) {
  return distance(a, T{});
}

auto free_asymmetric() {
  const auto data = oracle::read("01_free_asymmetric_pga3");
  constexpr std::array<double, 3> moments{1, 2, 3.5};
  EXPECT_EQ(triple(data["params"]["J_diag(1,2,3)"]), moments);
  return hamotor::RigidBodies{std::tuple{hamotor::FreeBody<SE3, double, rotation_split(moments)>(
      data["params"]["m"].number(), moments)}};
}

auto heavy_top() {
  const auto data = oracle::read("03_heavy_top_cl3");
  constexpr std::array<double, 3> moments{1.2, 2, 2.7};
  EXPECT_EQ(triple(data["params"]["J"]), moments);
  return hamotor::RigidBodies{
      std::tuple{hamotor::PivotedBody<SO3, double, rotation_split(moments)>(
          1, moments, triple(data["params"]["c_body"]), {})},
      std::tuple{hamotor::UniformGravity<SO3, double>{{0, 0, -data["params"]["mg"].number()}}}};
}

auto spring_and_gravity() {
  const auto data = oracle::read("05_spring_gravity_pga3");
  const auto& params = data["params"];
  constexpr std::array<double, 3> moments{0.4, 0.7, 0.9};
  EXPECT_EQ(triple(params["J"]), moments);
  return hamotor::RigidBodies{
      std::tuple{
          hamotor::FreeBody<SE3, double, rotation_split(moments)>(params["m"].number(), moments)},
      std::tuple{hamotor::UniformGravity<SE3, double>{{0, 0, -params["g"].number()}},
                 hamotor::SpringToWorld<0, SE3, double, RestLength::positive>{
                     .at = hamotor::point<SE3>(triple(params["a"])),
                     .anchor = hamotor::point<SE3>(triple(params["A"])),
                     .stiffness = params["k"].number(),
                     .rest_length = params["l0"].number()}}};
}

template <class System>
void expect_initial_rhs(const System& system, const oracle::Value& data) {
  using G = typename System::Group;
  const auto now = state<G>(data["initial"]);
  const auto expected = state<G>(data[rhs]);
  const auto rate = system.rate(now);
  const auto velocity = kinematics(now.motors[0], rate[0]);
  auto force = coadjoint(rate[0], now.momenta[0]);
  if constexpr (System::has_forque) force = force - system.forque(now.motors)[0];
  EXPECT_LE(distance(velocity, expected.motors[0]), 1e-15 * size(expected.motors[0]));
  EXPECT_LE(distance(force, expected.momenta[0]), 1e-15 * size(expected.momenta[0]));
}

template <class System>
void expect_energy(const System& system, const oracle::Value& data) {
  const double energy = data["conserved_initial"]["energy"].number();
  EXPECT_NEAR(system.energy(state<typename System::Group>(data["initial"])), energy,
              1e-15 * std::abs(energy));
}

/// Steps to every listed time; `step(state, t, h)` takes one step, `count` of them in a second.
template <class G, class Step>
void expect_states(const oracle::Value& data, int count, Step&& step) {
  auto now = state<G>(data["initial"]);
  const double h = 1.0 / count;
  int done = 0;
  for (const auto& listed : data["states"].items()) {
    const double t = listed["t"].number();
    for (; done < static_cast<int>(std::lround(t * count)); ++done) step(now, done * h, h);
    const auto expected = state<G>(listed);
    EXPECT_LE(distance(now.motors[0], expected.motors[0]), 1e-10) << "t = " << t;
    EXPECT_LE(distance(now.momenta[0], expected.momenta[0]), 1e-10) << "t = " << t;
  }
}

template <class System>
void expect_rkmk4(const System& system, const oracle::Value& data, int count) {
  hamotor::Rkmk4<System> method;
  expect_states<typename System::Group>(
      data, count, [&](auto& now, double t, double h) { method.do_step(system, now, t, h); });
}

/// Splitting2 in Yoshida's composition of order 6 (1990, solution A): what is symmetric and of
/// order 2 becomes of order 6, and does so only if it is both.
template <class System>
void expect_splitting2(const System& system, const oracle::Value& data, int count) {
  constexpr double a = 0.784513610477560;
  constexpr double b = 0.235573213359357;
  constexpr double c = -1.17767998417887;
  constexpr std::array<double, 7> parts{a, b, c, 1 - 2 * (a + b + c), c, b, a};
  hamotor::Splitting2<System> method;
  expect_states<typename System::Group>(data, count, [&](auto& now, double t, double h) {
    for (const double part : parts) method.do_step(system, now, t, part * h);
  });
}

TEST(FreeAsymmetricBody, right_hand_side_and_energy_are_the_oracles) {
  const auto data = oracle::read("01_free_asymmetric_pga3");
  expect_initial_rhs(free_asymmetric(), data);
  expect_energy(free_asymmetric(), data);
}

TEST(FreeAsymmetricBody, rkmk4_meets_the_oracle_at_every_time) {
  expect_rkmk4(free_asymmetric(), oracle::read("01_free_asymmetric_pga3"), 400);
}

TEST(FreeAsymmetricBody, splitting2_meets_the_oracle_at_every_time) {
  expect_splitting2(free_asymmetric(), oracle::read("01_free_asymmetric_pga3"), 200);
}

TEST(HeavyTop, right_hand_side_and_energy_are_the_oracles) {
  const auto data = oracle::read("03_heavy_top_cl3");
  expect_initial_rhs(heavy_top(), data);
  expect_energy(heavy_top(), data);
}

TEST(HeavyTop, rkmk4_meets_the_oracle_at_every_time) {
  expect_rkmk4(heavy_top(), oracle::read("03_heavy_top_cl3"), 600);
}

TEST(HeavyTop, splitting2_meets_the_oracle_at_every_time) {
  expect_splitting2(heavy_top(), oracle::read("03_heavy_top_cl3"), 200);
}

TEST(SpringAndGravity, right_hand_side_and_energy_are_the_oracles) {
  const auto data = oracle::read("05_spring_gravity_pga3");
  expect_initial_rhs(spring_and_gravity(), data);
  expect_energy(spring_and_gravity(), data);
}

TEST(SpringAndGravity, rkmk4_meets_the_oracle_at_every_time) {
  expect_rkmk4(spring_and_gravity(), oracle::read("05_spring_gravity_pga3"), 2000);
}

TEST(SpringAndGravity, splitting2_meets_the_oracle_at_every_time) {
  expect_splitting2(spring_and_gravity(), oracle::read("05_spring_gravity_pga3"), 400);
}

}  // namespace
