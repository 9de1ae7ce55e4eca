// Kernels have all digits in scalars wider than a double: no series, threshold or constant in them
// is made for 53 bits.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <tuple>

#include "hamotor/cga3/cga3.hpp"
#include "hamotor/cl3/cl3.hpp"
#include "hamotor/number_text.hpp"
#include "hamotor/pga3/pga3.hpp"
#include "hamotor/pga4/pga4.hpp"
#include "hamotor/sta/sta.hpp"
#if __has_include(<mpfr.h>)
#include "hamotor/mpfr.hpp"
#endif

namespace {

namespace scalar = hamotor::scalar;

template <class T>
double apart(const T& a, const T& b) {
  using S = typename T::Scalar;
  const auto x = a.components();
  const auto y = b.components();
  S distance(0);
  S size(1);
  for (std::size_t k = 0; k < x.size(); ++k) {
    distance = scalar::max_abs(distance, x[k] - y[k]);
    size = scalar::max_abs(size, x[k]);
  }
  return static_cast<double>(distance / (size * scalar::Limits<S>::epsilon()));
}

template <class T>
T scaled(const T& x, const typename T::Scalar& by) {
  auto c = x.components();
  for (auto& k : c) k = by * k;
  return T::from(c);
}

template <class Rate>
Rate some_rate(const typename Rate::Scalar& size, int first) {
  using S = typename Rate::Scalar;
  std::array<S, Rate::size> x{};
  int k = first;
  for (S& c : x) {
    k = (k * 37 + 11) % 101;
    c = size * S(k - 50) / S(51);
  }
  return Rate::from(x);
}

template <class Scalar_, class Group_>
struct Case {
  using Scalar = Scalar_;
  using Group = Group_;
};

template <class C>
class WideKernels : public testing::Test {};

template <class S>
using CasesOf = std::tuple<Case<S, hamotor::cl3::SO3>, Case<S, hamotor::pga3::SE3>,
                           Case<S, hamotor::pga4::SE4>, Case<S, hamotor::cga3::Sim3>,
                           Case<S, hamotor::cga3::SO41>, Case<S, hamotor::sta::SO13>>;
template <class S>
using SomeCasesOf = std::tuple<Case<S, hamotor::pga3::SE3>, Case<S, hamotor::cga3::SO41>>;

template <class Tuple>
struct TypesOf;
template <class... C>
struct TypesOf<std::tuple<C...>> {
  using type = testing::Types<C...>;
};

#if __has_include(<mpfr.h>) && defined(HAMOTOR_HAS_QUAD)
using Cases = decltype(std::tuple_cat(CasesOf<scalar::Quad>{}, SomeCasesOf<hamotor::Mpfr<50>>{}));
#elif __has_include(<mpfr.h>)
using Cases = CasesOf<hamotor::Mpfr<50>>;
#elif defined(HAMOTOR_HAS_QUAD)
using Cases = CasesOf<scalar::Quad>;
#else
using Cases = CasesOf<long double>;
#endif
TYPED_TEST_SUITE(WideKernels, TypesOf<Cases>::type, );

TYPED_TEST(WideKernels, laws_hold_to_the_last_digits) {
  using S = typename TypeParam::Scalar;
  using Rate = typename TypeParam::Group::template Rate<S>;
  constexpr double few_ulp = 200;
  for (const double size : {1e-9, 0.3, 1.7}) {
    for (int first = 1; first < 4; ++first) {
      const std::string where = std::to_string(size) + ", " + std::to_string(first);
      const Rate w = some_rate<Rate>(S(size), first);
      const Rate v = some_rate<Rate>(S(1), first + 7);
      const auto m = exp(w);
      const auto half = exp(scaled(w, S(0.5)));
      EXPECT_LT(apart(gp(half, half), m), few_ulp) << "exp " << where;
      EXPECT_LT(apart(normalize(scaled(m, S(1.5))), m), few_ulp) << "normalize " << where;
      EXPECT_LT(apart(sqrt(gp(half, half)), half), 30 * few_ulp) << "sqrt " << where;
      if constexpr (requires { exp(log(m)); }) {
        EXPECT_LT(apart(exp(log(m)), m), few_ulp) << "log " << where;
      }
      if constexpr (requires { cayley(cayley_inverse(m)); }) {
        EXPECT_LT(apart(cayley(cayley_inverse(m)), m), 30 * few_ulp) << "cayley " << where;
      }
      const Rate moved = dexp(w, v);
      EXPECT_LT(apart(dexp_inverse(w, moved), v), 30 * few_ulp) << "dexp_inverse " << where;
      const Rate twice = scaled(moved + Ad(exp(scaled(w, S(-1))), moved), S(0.5));
      EXPECT_LT(apart(dexp(scaled(w, S(2)), v), twice), 30 * few_ulp) << "dexp " << where;
    }
  }
}

/// As the series of exp for S² = ω that the isoclinic forms take over from: (exp(B/2^k))^(2^k).
TYPED_TEST(WideKernels, exp_is_a_power_of_exp_of_a_part) {
  using S = typename TypeParam::Scalar;
  using Rate = typename TypeParam::Group::template Rate<S>;
  const Rate w = some_rate<Rate>(S(2), 5);
  auto power = exp(scaled(w, scalar::power_of_two<S>(-8)));
  for (int k = 0; k < 8; ++k) power = gp(power, power);
  EXPECT_LT(apart(power, exp(w)), 2e4);
}

TEST(Decimals, read_back_as_the_same_number) {
  const auto check = []<class S>(S x) {
    for (int k = 0; k < 50; ++k) {
      x = -x * S(97) / S(31);
      EXPECT_TRUE(hamotor::number_from<S>(hamotor::text_of(x)) == x) << hamotor::text_of(x);
      EXPECT_TRUE(hamotor::number_from<S>(hamotor::text_of(S(1) / x)) == S(1) / x);
    }
  };
  check(1.0F);
  check(1.0);
  check(1.0L);
#ifdef HAMOTOR_HAS_QUAD
  check(scalar::Quad(1));
#endif
#if __has_include(<mpfr.h>)
  check(hamotor::Mpfr<50>(1));
#endif
}

#ifdef HAMOTOR_HAS_QUAD
TEST(Decimals, constants_are_within_an_ulp) {
  using scalar::Quad;
  static_assert(scalar::decimal<Quad>("0.1") == Quad(1) / Quad(10));
  static_assert(scalar::decimal<Quad>("-2.5e3") == Quad(-2500));
  static_assert(scalar::decimal<Quad>("3") == Quad(3));
  for (const std::string text :
       {"3.14159265358979323846264338327950288419716939937510582097494459",
        "-1234567890123456789012345678901234567890.5E-70", "6.02214076e+230",
        "0.000000000000000000000000000000000000000000000000000000000000000123456789"}) {
    const Quad exact = hamotor::number_from<Quad>(text);
    const Quad error = (scalar::decimal<Quad>(text) - exact) / exact;
    EXPECT_LE(static_cast<double>(scalar::abs(error / scalar::Limits<Quad>::epsilon())), 3) << text;
  }
}
#endif

}  // namespace
