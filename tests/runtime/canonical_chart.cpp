// Laws of canonical coordinates on T*G: closed forms are the series where these converge, and
// satisfy their equations beyond.
#include "hamotor/canonical_chart.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "hamotor/cga3/sim3.hpp"
#include "sample_systems.hpp"

namespace {

using hamotor::CanonicalChart;
using sample::distance;
using Wide = long double;

template <class G>
inline constexpr auto turning = hamotor::detail::TurningPartOf<G>::value;

static_assert(turning<sample::SO3>.is_all && !turning<sample::SO3>.has_translations);
static_assert(turning<sample::SE2>.is_all && turning<sample::SE2>.has_translations);
static_assert(turning<sample::SE3>.is_all && turning<sample::SE3>.has_translations);
static_assert(!turning<hamotor::cga3::Sim3>.is_all);

template <class T>
T filled(double from, Wide scale) {
  auto x = T{}.components();
  for (auto& c : x) {
    from = std::fmod(from * 3.7 + 0.61, 2.0);
    c = scale * (static_cast<Wide>(from) - 1);
  }
  return T::from(x);
}

template <class G>
struct Sample {
  using Rate = typename G::template Rate<Wide>;
  using Momentum = typename G::template Momentum<Wide>;
  Rate v = filled<Rate>(0.2, 1);
  Momentum m = filled<Momentum>(0.5, 1);
  Momentum force = filled<Momentum>(0.9, 1);
};

TEST(CanonicalChart, in_closed_form_is_the_series) {
  using G = sample::SO3;
  const Sample<G> s;
  for (const Wide scale : {0.0L, 1e-9L, 0.1L, 1.0L, 2.0L}) {
    const auto xi = filled<Sample<G>::Rate>(0.37, scale);
    const CanonicalChart<G, Wide> closed(xi);
    const CanonicalChart<G, Wide, false> series(xi);
    EXPECT_LT(distance(closed.rate(s.v), series.rate(s.v)), 1e-17);
    EXPECT_LT(distance(closed.body_rate(s.v), series.body_rate(s.v)), 1e-17);
    EXPECT_LT(distance(closed.momentum(s.m), series.momentum(s.m)), 1e-17);
    EXPECT_LT(distance(closed.seen_from_center(s.m), series.seen_from_center(s.m)), 1e-17);
    EXPECT_LT(distance(closed.body_momentum(s.m), series.body_momentum(s.m)), 1e-17);
    EXPECT_LT(
        distance(closed.momentum_rate(s.v, s.m, s.force), series.momentum_rate(s.v, s.m, s.force)),
        1e-17);
  }
}

template <class G>
void expect_laws(Wide scale) {
  const Sample<G> s;
  const auto xi = filled<typename Sample<G>::Rate>(0.37, scale);
  const CanonicalChart<G, Wide> chart(xi);
  EXPECT_LT(distance(chart.rate(chart.body_rate(s.v)), s.v), 1e-15);
  EXPECT_LT(distance(chart.seen_from_center(chart.momentum(s.m)), s.m), 1e-15);
  EXPECT_LT(distance(chart.body_momentum(s.m), Ad_star(exp(chart.turn_of(xi)), s.m)),
            1e-16 * (1 + double(scale)));
  const auto whole = gp(reverse(chart.opposite().element()), chart.element());
  EXPECT_LT(distance(exp(chart.whole_logarithm()), whole), 1e-15 * (1 + double(scale)));
  // The pairing of p with ξ̇ is that of the body's momentum with its rate.
  EXPECT_NEAR(static_cast<double>(pairing(chart.momentum(s.m), s.v)),
              static_cast<double>(pairing(chart.body_momentum(s.m), chart.body_rate(s.v))), 1e-14);
  const auto after = [&](Wide t) {
    return CanonicalChart<G, Wide>(xi + t * s.v).momentum(s.m + t * s.force);
  };
  const Wide e = 1e-3L;
  const auto slope_of = [&](const auto& f) {
    return (1 / (12 * e)) * (Wide(8) * (f(e) - f(-e)) - (f(2 * e) - f(-2 * e)));
  };
  const auto slope = slope_of(after);
  EXPECT_LT(distance(chart.momentum_rate(s.v, s.m, s.force), slope), 1e-11);
  const auto moved = [&](Wide t) { return CanonicalChart<G, Wide>(xi + t * s.v).element(); };
  EXPECT_LT(distance(kinematics(moved(0), chart.body_rate(s.v)), slope_of(moved)), 1e-11);
}

TEST(CanonicalChart, knows_its_equations_on_both_sides_of_where_series_end) {
  for (const Wide scale : {0.5L, 3.0L, 5.0L, 9.0L, 20.0L}) {
    expect_laws<sample::SO3>(scale);
    expect_laws<sample::SE2>(scale);
    expect_laws<sample::SE3>(scale);
  }
}

}  // namespace
