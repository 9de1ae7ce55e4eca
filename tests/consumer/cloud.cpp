// Twenty thousand bricks that tumble, eight at a time where registers hold as many.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <tuple>
#include <vector>

#include "hamotor/ensemble.hpp"
#include "hamotor/pga3/se3.hpp"
#include "hamotor/random_numbers.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/systems.hpp"

using SE3 = hamotor::pga3::SE3;
constexpr std::array moments{1.0, 2.0, 3.0};  // kg m²

template <class Scalar>
auto world() {
  hamotor::FreeBody<SE3, Scalar, hamotor::rotation_split(moments)> brick(2, {1, 2, 3});
  return hamotor::RigidBodies{std::tuple{brick}};
}

int main() {
  auto one = world<double>();
  auto many = world<hamotor::Pack<double, hamotor::widest<double>>>();

  std::vector<decltype(one)::State> members;
  for (std::uint64_t k = 0; k < 20'000; ++k) {
    hamotor::MemberNumbers numbers(1, k, 6);  // the seed, whose, and how many each takes
    const auto [s, e23, e31, e12] = numbers.rotor();
    const double spin = numbers.normal(2, 0.5);
    const double tilt = numbers.uniform(-1, 1);
    members.push_back({{{{s, e23, e31, e12, 0, 0, 0, 0}}}, {{{spin, 0.1, tilt, 0, 0, 0}}}});
  }
  hamotor::Ensemble ensemble(many, hamotor::Splitting4<decltype(many)>{}, 0.0, 0.01, members);
  const std::size_t alive = ensemble.advance(1000);

  double worst = 0;
  double upright = 0;
  for (std::size_t k = 0; k < members.size(); ++k) {
    const auto state = ensemble.state(k);
    worst = std::max(worst, std::abs(one.energy(state) / one.energy(members[k]) - 1));
    const auto& m = state.motors[0];
    upright += 1 - 2 * (m.e23 * m.e23 + m.e31 * m.e31);
  }
  std::printf("%zu of %zu, relative energy error %.1e, mean of e3 up %.4f\n", alive, members.size(),
              worst, upright / static_cast<double>(members.size()));
}
