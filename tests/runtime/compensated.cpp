// Compensated sums over steps: what they keep of many small ones, in every family that has them.
#include "hamotor/compensated.hpp"

#include <gtest/gtest.h>

#include <array>
#include <tuple>
#include <type_traits>

#include "hamotor/gauss.hpp"
#include "hamotor/moser_veselov.hpp"
#include "hamotor/rkmk.hpp"
#include "hamotor/steppers.hpp"
#include "sample_systems.hpp"

namespace {

using hamotor::Summation;

inline constexpr std::array<double, 3> moments{0.5, 1, 1.25};

/// A free body whose moments are the same in any scalar.
template <class S>
inline constexpr hamotor::RigidBodies body{
    std::tuple{hamotor::FreeBody<sample::SE3, S, hamotor::rotation_split(moments)>(
        S(2), sample::in<S>(moments))}};
template <class S>
using Body = std::remove_const_t<decltype(body<S>)>;

/// A state that a float holds.
template <class S>
auto start() {
  hamotor::StateOf<Body<S>> state{};
  state.motors[0].s = S(1);
  state.momenta[0] = {S(0.75), S(-1.5), S(0.625), S(0.5), S(-0.25), S(1)};
  return state;
}

/// The state after many steps of 2⁻¹⁰ s.
template <class S, class Method>
auto after(Method method, int steps) {
  auto state = start<S>();
  const S h = S(1) / S(1024);
  for (int k = 0; k < steps; ++k) method.do_step(body<S>, state, S(k) * h, h);
  return state;
}

/// A family of methods: `Of<System, summation>`.
template <template <class, Summation> class Method>
struct Family {
  template <class System, Summation summation>
  using Of = Method<System, summation>;
};

template <class System, Summation summation>
using Rkmk54 = hamotor::Rkmk<System, hamotor::DormandPrince54, summation>;
template <class System, Summation summation>
using Splitting4 = hamotor::Splitting<System, 4, summation>;
template <class System, Summation summation>
using Gauss4 = hamotor::Gauss<System, 2, summation>;
template <class System, Summation summation>
using MoserVeselov4 = hamotor::MoserVeselov<System, 4, summation>;

template <class F>
class CompensatedSums : public testing::Test {};
using Families =
    testing::Types<Family<hamotor::Rk4>, Family<hamotor::Rkmk4>, Family<hamotor::CommutatorFree4>,
                   Family<Rkmk54>, Family<Splitting4>, Family<Gauss4>, Family<MoserVeselov4>>;
TYPED_TEST_SUITE(CompensatedSums, Families);

TYPED_TEST(CompensatedSums, lose_far_fewer_digits_over_many_small_steps) {
  constexpr int steps = 30000;
  static const auto reference = after<double>(hamotor::Rk4<Body<double>>{}, steps);
  const auto error = [&](auto method) {
    const auto end = after<float>(method, steps);
    return sample::distance(end.motors[0].template cast<double>(), reference.motors[0]);
  };
  using Float = Body<float>;
  const double plain = error(typename TypeParam::template Of<Float, Summation::plain>{});
  const double kept = error(typename TypeParam::template Of<Float, Summation::compensated>{});
  EXPECT_LT(kept, 0.2 * plain);
  EXPECT_LT(kept, 1e-5);
}

}  // namespace
