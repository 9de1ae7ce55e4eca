// Kernels that fall into cases give each lane the bits that its numbers have alone; a NaN is a NaN.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hamotor/cga2/cga2.hpp"
#include "hamotor/cga3/cga3.hpp"
#include "hamotor/pack.hpp"
#include "hamotor/pga3/pga3.hpp"
#include "hamotor/pga4/pga4.hpp"
#include "hamotor/sta/sta.hpp"

namespace {

using hamotor::Pack;
namespace cga2 = hamotor::cga2;
namespace cga3 = hamotor::cga3;
namespace pga3 = hamotor::pga3;
namespace pga4 = hamotor::pga4;
namespace sta = hamotor::sta;

template <std::size_t W, template <class> class Element, class Kernel>
void expect_lanes_as_alone_of(const std::vector<Element<double>>& elements, const Kernel& kernel) {
  for (std::size_t first = 0; first < elements.size(); ++first) {
    const auto of_lane = [&](std::size_t lane) -> const auto& {
      return elements[(first + lane) % elements.size()];
    };
    Element<Pack<double, W>> together{};
    for (std::size_t lane = 0; lane < W; ++lane) {
      auto numbers = together.components();
      const auto alone = of_lane(lane).components();
      for (std::size_t i = 0; i < alone.size(); ++i) numbers[i].set(lane, alone[i]);
      together = together.from(numbers);
    }
    const auto found = kernel(together).components();
    for (std::size_t lane = 0; lane < W; ++lane) {
      const auto alone = kernel(of_lane(lane)).components();
      for (std::size_t i = 0; i < alone.size(); ++i) {
        if (std::isnan(alone[i]) && std::isnan(found[i][lane])) continue;
        EXPECT_EQ(std::bit_cast<std::uint64_t>(double{found[i][lane]}),
                  std::bit_cast<std::uint64_t>(double{alone[i]}))
            << W << " lanes, from element " << first << ", lane " << lane << ", component " << i;
      }
    }
  }
}

template <template <class> class Element, class Kernel>
void expect_lanes_as_alone(const std::vector<Element<double>>& elements, const Kernel& kernel) {
  expect_lanes_as_alone_of<1>(elements, kernel);
  expect_lanes_as_alone_of<4>(elements, kernel);
  expect_lanes_as_alone_of<8>(elements, kernel);
}

constexpr auto exponential = [](const auto& b) { return exp(b); };
constexpr auto logarithm = [](const auto& m) { return log(m); };

// Some by the shortcut, some not: alone, together and mixed.
TEST(KernelsInLanes, the_logarithm_of_a_motor) {
  using Motor = pga3::Motor<double>;
  using Bivector = pga3::Bivector<double>;
  const auto near = exp(Bivector{0.3, -0.2, 0.5, 1, 2, -3});
  const auto far = exp(Bivector{1.5, -0.2, 1.9, 1, 2, -3});
  const Motor moved{1, 0, 0, 0, 4, 5, 6, 0};
  std::vector<Motor> motors(9, near);
  for (const Motor& m : {far, -moved, near, 3.0 * near, moved, 1e100 * near, Motor::identity(),
                         near, far, far, far, far, far, far, far, far, near}) {
    motors.push_back(m);
  }
  expect_lanes_as_alone(motors, logarithm);
}

/// Each basis bivector by itself, sums of two, and all together: tiny, small, large.
template <class Bivector>
[[nodiscard]] std::vector<Bivector> bivectors() {
  std::vector<Bivector> all{Bivector{}};
  for (const double size : {1e-9, 0.1, 1.0, 3.1}) {
    std::array<double, Bivector::size> dense{};
    for (std::size_t i = 0; i < Bivector::size; ++i) {
      dense[i] = size * (0.9 - 0.17 * static_cast<double>((5 * i) % Bivector::size));
      for (std::size_t j = i; j < Bivector::size; ++j) {
        std::array<double, Bivector::size> sparse{};
        sparse[i] = size;
        sparse[j] = size;
        all.push_back(Bivector::from(sparse));
      }
    }
    all.push_back(Bivector::from(dense));
  }
  return all;
}

/// exp of bivectors, log of what that gives and of its negative.
template <template <class> class Bivector>
void expect_exponentials_and_logarithms() {
  const auto all = bivectors<Bivector<double>>();
  expect_lanes_as_alone(all, exponential);
  std::vector<decltype(exp(all[0]))> motions;
  for (const auto& b : all) {
    motions.push_back(exp(b));
    motions.push_back(-exp(b));
  }
  expect_lanes_as_alone(motions, logarithm);
}

TEST(KernelsInLanes, exponentials_and_logarithms_of_conformal_space) {
  expect_exponentials_and_logarithms<cga3::Bivector>();
}

TEST(KernelsInLanes, square_roots_and_cayley_s_maps_of_conformal_space) {
  const auto all = bivectors<cga3::Bivector<double>>();
  expect_lanes_as_alone(all, [](const auto& b) { return cayley(b); });
  std::vector<cga3::Versor<double>> versors;
  for (const auto& b : all) versors.push_back(exp(b));
  expect_lanes_as_alone(versors, [](const auto& m) { return sqrt(m); });
  expect_lanes_as_alone(versors, [](const auto& m) { return normalize(m); });
  expect_lanes_as_alone(versors, [](const auto& m) { return cayley_inverse(m); });
}

TEST(KernelsInLanes, exponentials_and_logarithms_of_the_conformal_plane) {
  expect_exponentials_and_logarithms<cga2::Bivector>();
}

TEST(KernelsInLanes, exponentials_and_logarithms_of_four_dimensions) {
  expect_exponentials_and_logarithms<pga4::Bivector>();
}

TEST(KernelsInLanes, exponentials_and_logarithms_of_spacetime) {
  expect_exponentials_and_logarithms<sta::Bivector>();
}

}  // namespace
