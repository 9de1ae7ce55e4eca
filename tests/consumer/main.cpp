// A brick on a spring, for ten seconds: all that an application needs of Hamotor.
#include <array>
#include <cstdio>
#include <tuple>

#include "hamotor/pga3/se3.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/systems.hpp"

using SE3 = hamotor::pga3::SE3;

int main() {
  constexpr std::array moments{1.0, 2.0, 3.0};  // kg m²
  hamotor::FreeBody<SE3, double, hamotor::rotation_split(moments)> brick(2.0, moments);
  hamotor::UniformGravity<SE3, double> gravity{{0, 0, -9.81}};
  hamotor::SpringToWorld<0, SE3, double, hamotor::RestLength::zero> spring{
      .at = {0.1, 0.2, 0.05}, .anchor = {0, 0, 0}, .stiffness = 50, .rest_length = 0};
  hamotor::RigidBodies world{std::tuple{brick}, std::tuple{gravity, spring}};

  decltype(world)::State state{{SE3::Element<double>::identity()}, {{{0, 4, 0.006, 0, 0, 0}}}};
  const double before = world.energy(state);
  hamotor::Splitting2<decltype(world)> stepper;
  for (int i = 0; i < 10'000; ++i) stepper.do_step(world, state, 1e-3 * i, 1e-3);
  const auto& m = state.motors[0];
  std::printf("motor %.17g %.17g %.17g %.17g\n", m.s, m.e23, m.e31, m.e12);
  std::printf("relative energy error %.1e\n", world.energy(state) / before - 1);
}
