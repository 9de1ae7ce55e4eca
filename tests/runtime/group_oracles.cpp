// Motions on larger groups, known to 30 digits: tests/oracles 10 (a free body in four dimensions)
// and 12 (Sim(3), the left-invariant elastic body).
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "hamotor/cga3/sim3.hpp"
#include "hamotor/pga4/se4.hpp"
#include "hamotor/steppers.hpp"
#include "oracle.hpp"

namespace {

constexpr std::string_view rhs = "initial_rhs (time derivative of M and mu at t=0)";

/// "e31" as the oracles write it: ascending blades e1^e3 with a sign.
std::pair<std::string, double> ascending(std::string_view blade) {
  if (blade == "s") return {"1", 1};
  std::string suffixes(blade.substr(1));
  double sign = 1;
  for (std::size_t i = 0; i < suffixes.size(); ++i) {
    for (std::size_t j = i + 1; j < suffixes.size(); ++j) {
      if (suffixes[i] > suffixes[j]) {
        std::swap(suffixes[i], suffixes[j]);
        sign = -sign;
      }
    }
  }
  std::string name;
  for (const char c : suffixes) name += (name.empty() ? "e" : "^e") + std::string(1, c);
  return {name, sign};
}

/// Core to physical: the generators are −½ of the blades, that of the dilation is +½ of it.
template <class G>
hamotor::State<G, 1, double> state(const oracle::Value& at) {
  hamotor::State<G, 1, double> result{};
  auto m = result.motors[0].components();
  for (std::size_t k = 0; k < m.size(); ++k) {
    const auto [name, sign] = ascending(G::template Element<double>::names[k]);
    m[k] = sign * at["M"][name].number();
  }
  auto mu = result.momenta[0].components();
  for (std::size_t k = 0; k < mu.size(); ++k) {
    const std::string blade(G::generators[k]);
    const std::string key = std::string("(e") + blade[1] + "^e" + blade[2] + ")*";
    mu[k] = (blade == "e0i" ? 0.5 : -0.5) * at["mu"][key].number();
  }
  result.motors[0] = G::template Element<double>::from(m);
  result.momenta[0] = G::template Momentum<double>::from(mu);
  return result;
}

/// H = ½ Σ μ_a² / I_a.
template <class G>
struct Diagonal {
  using Group = G;
  using Scalar = double;
  using Rate = typename G::template Rate<double>;
  using State = hamotor::State<G, 1, double>;
  static constexpr std::size_t bodies = 1;
  static constexpr bool has_forque = false;
  std::array<double, static_cast<std::size_t>(G::dimension)> inertia;

  [[nodiscard]] constexpr std::array<Rate, 1> rate(const State& at) const noexcept {
    auto w = at.momenta[0].components();
    for (std::size_t k = 0; k < w.size(); ++k) w[k] /= inertia[k];
    return {Rate::from(w)};
  }
  [[nodiscard]] constexpr double energy(const State& at) const noexcept {
    return 0.5 * pairing(at.momenta[0], rate(at)[0]);
  }
};

template <class T>
double distance(const T& a, const T& b) {
  double largest = 0;
  const auto x = a.components();
  const auto y = b.components();
  for (std::size_t k = 0; k < x.size(); ++k) largest = std::max(largest, std::abs(x[k] - y[k]));
  return largest;
}

template <class G>
void expect_right_hand_side_and_energy(const Diagonal<G>& system, const oracle::Value& data) {
  const auto now = state<G>(data["initial"]);
  const auto expected = state<G>(data[rhs]);
  const auto rate = system.rate(now)[0];
  const auto velocity = kinematics(now.motors[0], rate);
  const auto force = coadjoint(rate, now.momenta[0]);
  EXPECT_LE(distance(velocity, expected.motors[0]), 1e-15 * distance(velocity, {}));
  EXPECT_LE(distance(force, expected.momenta[0]), 1e-15 * distance(force, {}));
  const double energy = data["conserved_initial"]["energy"].number();
  EXPECT_NEAR(system.energy(now), energy, 1e-15 * energy);
}

template <class G>
void expect_trajectory(const Diagonal<G>& system, const oracle::Value& data, int per_second) {
  auto now = state<G>(data["initial"]);
  hamotor::Rkmk4<Diagonal<G>> method;
  int done = 0;
  for (const auto& listed : data["states"].items()) {
    const double t = listed["t"].number();
    for (; done < static_cast<int>(std::lround(t * per_second)); ++done) {
      method.do_step(system, now, 0, 1.0 / per_second);
    }
    const auto expected = state<G>(listed);
    EXPECT_LE(distance(now.motors[0], expected.motors[0]), 1e-10) << "t = " << t;
    EXPECT_LE(distance(now.momenta[0], expected.momenta[0]), 1e-10) << "t = " << t;
  }
}

/// J_ij = λ_i + λ_j.
Diagonal<hamotor::pga4::SE4> body_in_four_dimensions(const oracle::Value& data) {
  const auto& lambda = data["params"]["lambda(second moments)"];
  Diagonal<hamotor::pga4::SE4> system{};
  std::size_t k = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = i + 1; j < 4; ++j) {
      system.inertia[k++] = lambda[i].number() + lambda[j].number();
    }
  }
  for (; k < 10; ++k) system.inertia[k] = data["params"]["m"].number();
  return system;
}

/// The oracle's parameters are literal: four times ours.
Diagonal<hamotor::cga3::Sim3> elastic_body(const oracle::Value& data) {
  const auto& params = data["params"];
  Diagonal<hamotor::cga3::Sim3> system{};
  for (std::size_t k = 0; k < 3; ++k) {
    system.inertia[k] = params["J"][k].number() / 4;
    system.inertia[3 + k] = params["m"].number() / 4;
  }
  system.inertia[6] = params["J0"].number() / 4;
  return system;
}

TEST(FreeBodyInFourDimensions, right_hand_side_and_energy_are_the_oracles) {
  const auto data = oracle::read("10_free_se4_pga4");
  expect_right_hand_side_and_energy(body_in_four_dimensions(data), data);
}

TEST(FreeBodyInFourDimensions, rkmk4_meets_the_oracle_at_every_time) {
  const auto data = oracle::read("10_free_se4_pga4");
  expect_trajectory(body_in_four_dimensions(data), data, 800);
}

TEST(ElasticBody, right_hand_side_and_energy_are_the_oracles) {
  const auto data = oracle::read("12_elastic_seed_cga3_sim3");
  expect_right_hand_side_and_energy(elastic_body(data), data);
}

TEST(ElasticBody, rkmk4_meets_the_oracle_at_every_time) {
  const auto data = oracle::read("12_elastic_seed_cga3_sim3");
  expect_trajectory(elastic_body(data), data, 800);
}

}  // namespace
