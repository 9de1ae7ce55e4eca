// The laws that generated kernels satisfy, in every scalar: exactly on rational numbers, to
// rounding on the others.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <type_traits>
#include <vector>

#include "../reference/rational.hpp"
#include "hamotor/pga2/pga2.hpp"
#include "hamotor/pga3/pga3.hpp"

namespace {

namespace pga2 = hamotor::pga2;
namespace pga3 = hamotor::pga3;
namespace se3 = hamotor::pga3::se3;
namespace se2 = hamotor::pga2::se2;
using tests::Rational;

#if defined(__SIZEOF_FLOAT128__)
__extension__ using Quad = __float128;
#else
using Quad = long double;
#endif

template <class S>
double tolerance() {
  if constexpr (std::is_same_v<S, Rational>) {
    return 0;
  } else if constexpr (sizeof(S) == 4) {
    return 2e-4;
  } else if constexpr (std::is_same_v<S, double>) {
    return 1e-12;
  } else {
    return std::is_same_v<S, Quad> && sizeof(long double) < 16 ? 1e-28 : 1e-15;
  }
}

template <class S>
double number(const S& x) {
  if constexpr (std::is_same_v<S, Rational>) {
    return static_cast<double>(x.numerator()) / static_cast<double>(x.denominator());
  } else {
    return static_cast<double>(x);
  }
}

template <class T>
void expect_equal(const T& a, const T& b) {
  using S = typename T::Scalar;
  const auto x = a.components();
  const auto y = b.components();
  double size = 1;
  for (const S& component : x) size = std::max(size, std::fabs(number(component)));
  for (std::size_t i = 0; i < x.size(); ++i) {
    if constexpr (std::is_same_v<S, Rational>) {
      EXPECT_TRUE(x[i] == y[i]) << T::names[i] << ": " << number(x[i]) << " and " << number(y[i]);
    } else {
      EXPECT_LE(std::fabs(number(x[i] - y[i])), tolerance<S>() * size) << T::names[i];
    }
  }
}

template <class S>
void expect_equal_numbers(const S& a, const S& b) {
  EXPECT_LE(std::fabs(number(a - b)), tolerance<S>() * std::max(1.0, std::fabs(number(a))));
}

// Small rational numbers and rational unit motors, the same ones in every scalar.
class Sample {
 public:
  template <class S>
  S ratio(int p, int q) {
    return S(p) / S(q);
  }

  template <class T>
  T some() {
    using S = typename T::Scalar;
    std::array<S, T::size> x;
    for (S& component : x) component = ratio<S>(digit(-9, 9), digit(1, 4));
    return T::from(x);
  }

  template <class S>
  pga3::Motor<S> motor() {
    pga3::Motor<S> m = pga3::Motor<S>::identity();
    for (int i = 0; i < 3; ++i) {
      pga3::Motor<S> turn{ratio<S>(3, 5), S(0), S(0), S(0), S(0), S(0), S(0), S(0)};
      (i == 0 ? turn.e23 : i == 1 ? turn.e31 : turn.e12) = ratio<S>(sign() * 4, 5);
      const pga3::Motor<S> translation{S(1),
                                       S(0),
                                       S(0),
                                       S(0),
                                       ratio<S>(digit(-9, 9), 4),
                                       ratio<S>(digit(-9, 9), 4),
                                       ratio<S>(digit(-9, 9), 4),
                                       S(0)};
      m = gp(gp(m, turn), translation);
    }
    return m;
  }

  template <class S>
  pga2::Motor<S> planar_motor() {
    const pga2::Motor<S> turn{ratio<S>(5, 13), ratio<S>(sign() * 12, 13), S(0), S(0)};
    const pga2::Motor<S> translation{S(1), S(0), ratio<S>(digit(-9, 9), 4),
                                     ratio<S>(digit(-9, 9), 4)};
    return gp(turn, translation);
  }

 private:
  int digit(int low, int high) {
    return low + static_cast<int>(random_() % static_cast<unsigned>(high - low + 1));
  }
  int sign() { return digit(0, 1) == 0 ? -1 : 1; }

  std::mt19937 random_{7};
};

constexpr int rounds = 10;

template <class S>
class Products : public testing::Test, public Sample {};
template <class S>
class Groups : public testing::Test, public Sample {};
template <class S>
class Exponentials : public testing::Test, public Sample {};

using Scalars = testing::Types<float, double, long double, Quad, Rational>;
using Floats = testing::Types<float, double, long double>;

TYPED_TEST_SUITE(Products, Scalars, );
TYPED_TEST_SUITE(Groups, Scalars, );
TYPED_TEST_SUITE(Exponentials, Floats, );

TYPED_TEST(Products, are_associative) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto a = this->template some<pga3::Even<S>>();
    const auto b = this->template some<pga3::Even<S>>();
    const auto c = this->template some<pga3::Even<S>>();
    const auto u = S(1) / S(64);  // keeps every number near 1
    expect_equal(gp(u * gp(a, b), c), gp(a, u * gp(b, c)));
  }
}

TYPED_TEST(Products, are_reversed_in_reversed_order) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto a = this->template some<pga3::Even<S>>();
    const auto b = this->template some<pga3::Even<S>>();
    expect_equal(reverse(gp(a, b)), gp(reverse(b), reverse(a)));
    const auto m = this->template motor<S>();
    expect_equal(gp(m, reverse(m)), pga3::Motor<S>::identity());
    expect_equal(reverse(reverse(a)), a);
  }
}

TYPED_TEST(Products, of_grades_add_up_to_the_geometric_product) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto a = this->template some<pga3::Plane<S>>();
    const auto b = this->template some<pga3::Plane<S>>();
    const auto whole = gp(a, b);
    expect_equal(grade_2(whole), outer(a, b));
    expect_equal_numbers(grade_0(whole), inner(a, b));
    const auto x = this->template some<pga3::Bivector<S>>();
    const auto y = this->template some<pga3::Bivector<S>>();
    expect_equal(grade_2(gp(x, y)), commutator(x, y));
    expect_equal(commutator(x, y), -commutator(y, x));
  }
}

TYPED_TEST(Products, commutator_satisfies_jacobi) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto a = this->template some<pga3::Bivector<S>>();
    const auto b = this->template some<pga3::Bivector<S>>();
    const auto c = this->template some<pga3::Bivector<S>>();
    const auto u = S(1) / S(64);
    const auto sum = commutator(u * a, commutator(b, c)) + commutator(u * b, commutator(c, a)) +
                     commutator(u * c, commutator(a, b));
    expect_equal(sum, S(0) * a);
  }
}

TYPED_TEST(Products, sandwich_composes) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto m = this->template motor<S>();
    const auto n = this->template motor<S>();
    const auto x = this->template some<pga3::Point<S>>();
    expect_equal(sandwich(gp(m, n), x), sandwich(m, sandwich(n, x)));
    const auto b = this->template some<pga3::Bivector<S>>();
    expect_equal(sandwich(reverse(m), sandwich(m, b)), b);
    const auto p = this->template some<pga3::Plane<S>>();
    expect_equal(sandwich(pga3::Motor<S>::identity(), p), p);
    expect_equal(sandwich(-m, x), sandwich(m, x));
  }
}

TYPED_TEST(Products, sandwich_moves_products_with_their_factors) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto m = this->template motor<S>();
    const auto p = this->template some<pga3::Plane<S>>();
    const auto q = this->template some<pga3::Plane<S>>();
    expect_equal(sandwich(m, outer(p, q)), outer(sandwich(m, p), sandwich(m, q)));
    const auto x = this->template some<pga3::Point<S>>();
    const auto y = this->template some<pga3::Point<S>>();
    expect_equal(sandwich(m, regressive(x, y)), regressive(sandwich(m, x), sandwich(m, y)));
    expect_equal_numbers(regressive(sandwich(m, p), sandwich(m, x)), regressive(p, x));
    const auto a = this->template some<pga3::Bivector<S>>();
    const auto b = this->template some<pga3::Bivector<S>>();
    const auto u = S(1) / S(16);
    expect_equal(sandwich(m, commutator(u * a, u * b)),
                 commutator(sandwich(m, u * a), sandwich(m, u * b)));
  }
}

TYPED_TEST(Products, in_the_plane_satisfy_the_same_laws) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto m = this->template planar_motor<S>();
    const auto n = this->template planar_motor<S>();
    expect_equal(gp(m, reverse(m)), pga2::Motor<S>::identity());
    const auto x = this->template some<pga2::Point<S>>();
    const auto y = this->template some<pga2::Point<S>>();
    expect_equal(sandwich(gp(m, n), x), sandwich(m, sandwich(n, x)));
    expect_equal(sandwich(m, regressive(x, y)), regressive(sandwich(m, x), sandwich(m, y)));
  }
}

TYPED_TEST(Groups, coadjoint_is_the_transpose_of_the_bracket) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto a = this->template some<se3::Rate<S>>();
    const auto b = this->template some<se3::Rate<S>>();
    const auto mu = S(1) / S(64) * this->template some<se3::Momentum<S>>();
    expect_equal_numbers(pairing(coadjoint(a, mu), b), pairing(mu, ad(a, b)));
    const auto v = this->template some<se2::Rate<S>>();
    const auto w = this->template some<se2::Rate<S>>();
    const auto nu = S(1) / S(64) * this->template some<se2::Momentum<S>>();
    expect_equal_numbers(pairing(coadjoint(v, nu), w), pairing(nu, ad(v, w)));
  }
}

TYPED_TEST(Groups, Ad_star_is_the_transpose_of_Ad) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto m = this->template motor<S>();
    const auto w = S(1) / S(64) * this->template some<se3::Rate<S>>();
    const auto mu = this->template some<se3::Momentum<S>>();
    expect_equal_numbers(pairing(se3::Ad_star(m, mu), w), pairing(mu, se3::Ad(m, w)));
    expect_equal_numbers(pairing(se3::Ad_star_inverse(m, mu), se3::Ad(m, w)), pairing(mu, w));
    expect_equal(se3::Ad_star(m, se3::Ad_star_inverse(m, mu)), mu);
    expect_equal(se3::Ad_inverse(m, se3::Ad(m, w)), w);
  }
}

TYPED_TEST(Groups, Ad_is_a_homomorphism_that_keeps_brackets) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto m = this->template motor<S>();
    const auto n = this->template motor<S>();
    const auto v = S(1) / S(16) * this->template some<se3::Rate<S>>();
    const auto w = S(1) / S(16) * this->template some<se3::Rate<S>>();
    expect_equal(se3::Ad(gp(m, n), v), se3::Ad(m, se3::Ad(n, v)));
    expect_equal(se3::Ad(m, se3::ad(v, w)), se3::ad(se3::Ad(m, v), se3::Ad(m, w)));
  }
}

TYPED_TEST(Groups, kinematics_is_the_product_with_the_rate_and_turns_Ad_over) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto m = this->template motor<S>();
    const auto w = S(1) / S(16) * this->template some<se3::Rate<S>>();
    // m w = (Ad_m w) m
    const auto spatial = se3::kinematics(pga3::Motor<S>::identity(), se3::Ad(m, w));
    expect_equal(se3::kinematics(m, w), gp(spatial, m));
  }
}

TYPED_TEST(Exponentials, of_opposite_rates_are_inverse) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto w = S(1) / S(4) * this->template some<se3::Rate<S>>();
    const auto m = exp(w);
    expect_equal(exp(-w), reverse(m));
    expect_equal(gp(m, m), exp(S(2) * w));
    expect_equal(se3::Ad(m, w), w);
  }
}

TYPED_TEST(Exponentials, are_inverted_by_the_logarithm_below_a_full_turn) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto w = S(1) / S(8) * this->template some<se3::Rate<S>>();
    expect_equal(pga3::SE3::log(exp(w)), w);
    const auto v = S(1) / S(8) * this->template some<se2::Rate<S>>();
    expect_equal(pga2::SE2::log(exp(v)), v);
    expect_equal(se3::cayley_inverse(se3::cayley(w)), w);
  }
}

// The logarithm is right to rounding, and that much of it the exponential passes on.
template <class S>
void expect_log_gives_back(const pga3::Motor<S>& m) {
  const auto b = log(m);
  S size = S(1);
  for (const S& x : b.components()) size = std::max(size, std::fabs(x));
  const auto back = exp(b).components();
  const auto given = m.components();
  for (std::size_t i = 0; i < given.size(); ++i) {
    EXPECT_LE(std::fabs(back[i] - given[i]), 16 * std::numeric_limits<S>::epsilon() * size);
  }
}

TYPED_TEST(Exponentials, give_a_motor_back_from_its_logarithm_with_its_sign) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto m = this->template motor<S>();
    expect_log_gives_back(m);
    expect_log_gives_back(-m);
  }
  for (const S tiny : {S(1e-3), S(1e-8), S(1e-20), std::numeric_limits<S>::denorm_min()}) {
    for (const S sign : {S(1), S(-1)}) {
      const S turned = sign * std::sqrt(1 - 6 * tiny * tiny);
      expect_log_gives_back<S>({turned, tiny, -tiny, S(2) * tiny, S(0), S(0), S(0), S(0)});
      // a screw along its axis: the translation is parallel to the rotation
      const S pitch = S(0.25);
      const S cosine = sign * std::sqrt(1 - tiny * tiny);
      expect_log_gives_back<S>(
          {cosine, tiny, S(0), S(0), pitch, S(0), S(0), tiny * pitch / cosine});
    }
  }
}

TYPED_TEST(Exponentials, reach_minus_one_and_every_minus_translation) {
  using S = TypeParam;
  expect_log_gives_back<S>({S(-1), S(0), S(0), S(0), S(0), S(0), S(0), S(0)});
  expect_log_gives_back<S>({S(-1), S(0), S(0), S(0), S(3), S(-4), S(12), S(0)});
  expect_log_gives_back<S>({S(-1), S(0), S(0), S(0), S(0), S(0), S(1e-30), S(0)});
  const auto rotor = exp(pga3::SO3::log(pga3::Rotor<S>{S(-1), S(0), S(0), S(0)}));
  EXPECT_NEAR(static_cast<double>(rotor.s), -1, tolerance<S>());
}

TYPED_TEST(Exponentials, are_unit_motors_and_normalize_keeps_them) {
  using S = TypeParam;
  for (int i = 0; i < rounds; ++i) {
    const auto m = exp(this->template some<se3::Rate<S>>());
    expect_equal(gp(m, reverse(m)), pga3::Motor<S>::identity());
    expect_equal(normalize(m), m);
    expect_equal(normalize(S(3) * m), m);
    const auto c = se3::cayley(this->template some<se3::Rate<S>>());
    expect_equal(gp(c, reverse(c)), pga3::Motor<S>::identity());
  }
}

TYPED_TEST(Exponentials, of_large_angles_are_finite_unit_motors) {
  using S = TypeParam;
  const S largest = std::numeric_limits<S>::max();
  for (const S size : {S(1e10), S(1e30), largest / S(4), largest}) {
    const auto m = exp(se3::Rate<S>{size, -size, size, S(1), S(2), S(3)});
    const auto r = grade_2(pga3::Even<S>::from(m.components()));
    const S norm = m.s * m.s + r.e23 * r.e23 + r.e31 * r.e31 + r.e12 * r.e12;
    EXPECT_NEAR(static_cast<double>(norm), 1, 1e-5);
  }
}

TEST(Elements, keep_their_components_in_order) {
  using Motor = pga3::Motor<double>;
  static_assert(Motor::size == 8 && Motor::names[3] == "e12");
  constexpr std::array<double, 8> x{1, 2, 3, 4, 5, 6, 7, 8};
  static_assert(Motor::from(x).components() == x);
  static_assert(Motor::from(x).e0123 == 8);
  static_assert(Motor::from(x).cast<float>().e31 == 3.0F);
  static_assert(pga3::Origin<double>::size == 0);
  static_assert(std::is_aggregate_v<Motor> && std::is_trivially_copyable_v<Motor>);
}

TEST(Kernels, are_evaluated_at_compile_time) {
  using Motor = pga3::Motor<double>;
  constexpr Motor half_turn{0, 0, 0, 1, 0, 0, 0, 0};
  static_assert(gp(half_turn, half_turn) == -Motor::identity());
  constexpr pga3::Point<double> x{1, 2, 3};
  static_assert(sandwich(half_turn, x) == pga3::Point<double>{-1, -2, 3});
  constexpr se3::Rate<double> spin{0, 0, 2, 0, 0, 0};
  constexpr se3::Rate<double> slide{0, 0, 0, 1, 0, 0};
  static_assert(se3::ad(spin, slide).v2 == 2);
  constexpr se3::Momentum<double> push{0, 0, 0, 3, 0, 0};
  static_assert(pairing(push, slide) == 3);
  static_assert(regressive(pga3::Plane<double>{0, 1, 0, 0}, x) != 0);
}

}  // namespace
