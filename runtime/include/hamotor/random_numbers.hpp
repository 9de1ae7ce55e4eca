// Random numbers of an ensemble: a member's are the same whoever else is drawn with it.
//
// The bits are those of `run_ensemble` and of every machine: what is made of the generator's words
// uses additions, multiplications, divisions and square roots only, uncontracted
// (-ffp-contract=off, which hamotor::hamotor asks for), where the C library's logarithms and sines
// differ.
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace hamotor {

namespace detail {

/// The 128 bits of a b: high and low.
[[nodiscard]] constexpr std::array<std::uint64_t, 2> long_product(std::uint64_t a,
                                                                  std::uint64_t b) noexcept {
  constexpr std::uint64_t half = 0xffffffff;
  const std::uint64_t low = (a & half) * (b & half);
  const std::uint64_t across = (a >> 32) * (b & half) + (low >> 32);
  const std::uint64_t middle = (a & half) * (b >> 32) + (across & half);
  return {(a >> 32) * (b >> 32) + (across >> 32) + (middle >> 32), a * b};
}

/// Of coefficients, highest power first.
template <std::size_t n>
[[nodiscard]] constexpr double polynomial(const std::array<double, n>& coefficients,
                                          double x) noexcept {
  double sum = coefficients[0];
  for (std::size_t k = 1; k < n; ++k) sum = sum * x + coefficients[k];
  return sum;
}

/// ln x of a positive number to two units in the last place: 2 artanh of (m − 1)/(m + 1).
[[nodiscard]] inline double portable_log(double x) noexcept {
  constexpr std::array<double, 12> artanh{1.0 / 23, 1.0 / 21, 1.0 / 19, 1.0 / 17,
                                          1.0 / 15, 1.0 / 13, 1.0 / 11, 1.0 / 9,
                                          1.0 / 7,  1.0 / 5,  1.0 / 3,  1.0};
  int exponent = 0;
  double mantissa = std::frexp(x, &exponent);
  if (mantissa < 0x1.6a09e667f3bcdp-1) {  // √½
    mantissa *= 2;
    --exponent;
  }
  const double power = exponent;
  const double s = (mantissa - 1) / (mantissa + 1);
  // ln 2 in two numbers, of which multiples of the first are exact
  return power * 0.6931471803691238 +
         (2 * s * polynomial(artanh, s * s) + power * 1.9082149292705877e-10);
}

/// {cos x, sin x} for up to a thousand turns, to two units in the last place of the larger one.
[[nodiscard]] inline std::array<double, 2> portable_cosine_and_sine(double x) noexcept {
  constexpr std::array<double, 9> sines{1.0 / 355687428096000,
                                        -1.0 / 1307674368000,
                                        1.0 / 6227020800,
                                        -1.0 / 39916800,
                                        1.0 / 362880,
                                        -1.0 / 5040,
                                        1.0 / 120,
                                        -1.0 / 6,
                                        1.0};
  constexpr std::array<double, 10> cosines{-1.0 / 6402373705728000,
                                           1.0 / 20922789888000,
                                           -1.0 / 87178291200,
                                           1.0 / 479001600,
                                           -1.0 / 3628800,
                                           1.0 / 40320,
                                           -1.0 / 720,
                                           1.0 / 24,
                                           -1.0 / 2,
                                           1.0};
  const double quadrant = std::nearbyint(x * (2 / 3.141592653589793));
  // π/2 in three parts
  const double r = ((x - quadrant * 1.5707963267341256) - quadrant * 6.077100506303966e-11) -
                   quadrant * 2.0222662487959506e-21;
  const double cosine = polynomial(cosines, r * r);
  const double sine = r * polynomial(sines, r * r);
  switch (static_cast<std::int64_t>(quadrant) & 3) {
    case 0:
      return {cosine, sine};
    case 1:
      return {-sine, cosine};
    case 2:
      return {-cosine, -sine};
    default:
      return {sine, -cosine};
  }
}

}  // namespace detail

/// Four words for each counter: Philox4x64-10 (Salmon, Moraes, Dror & Shaw, SC 2011).
[[nodiscard]] constexpr std::array<std::uint64_t, 4> philox4x64(
    std::array<std::uint64_t, 4> counter, std::array<std::uint64_t, 2> key) noexcept {
  for (int round = 0; round < 10; ++round) {
    const auto [high0, low0] = detail::long_product(0xd2e7470ee14c6c93, counter[0]);
    const auto [high1, low1] = detail::long_product(0xca5a826395121157, counter[2]);
    counter = {high1 ^ counter[1] ^ key[0], low1, high0 ^ counter[3] ^ key[1], low0};
    key[0] += 0x9e3779b97f4a7c15;
    key[1] += 0xbb67ae8584caa73b;
  }
  return counter;
}

/// The number in (0, 1) of a word whose bits are random: the middle of one of 2⁵³ parts, rounded.
[[nodiscard]] constexpr double uniform_of(std::uint64_t word) noexcept {
  return std::min((static_cast<double>(word >> 11) + 0.5) * 0x1p-53, 1 - 0x1p-53);
}

/// The standard normal number of a uniform one in (0, 1): the inverse of the distribution.
///
/// Relative error some 1e-15: Wichura, Algorithm AS 241 (PPND16), Applied Statistics 37 (1988) 477.
[[nodiscard]] inline double normal_of(double uniform) noexcept {
  using Coefficients = std::array<double, 8>;
  constexpr auto ratio = [](const Coefficients& above, const Coefficients& below, double x) {
    return detail::polynomial(above, x) / detail::polynomial(below, x);
  };
  const double q = uniform - 0.5;
  if (!(std::abs(q) > 0.425)) {
    return q * ratio({2.5090809287301226727e3, 3.3430575583588128105e4, 6.7265770927008700853e4,
                      4.5921953931549871457e4, 1.3731693765509461125e4, 1.9715909503065514427e3,
                      1.3314166789178437745e2, 3.3871328727963666080e0},
                     {5.2264952788528545610e3, 2.8729085735721942674e4, 3.9307895800092710610e4,
                      2.1213794301586595867e4, 5.3941960214247511077e3, 6.8718700749205790830e2,
                      4.2313330701600911252e1, 1.0},
                     0.180625 - q * q);
  }
  const double r = std::sqrt(-detail::portable_log(q < 0 ? uniform : 1 - uniform));
  const double z =
      r > 5
          ? ratio({2.01033439929228813265e-7, 2.71155556874348757815e-5, 1.24266094738807843860e-3,
                   2.65321895265761230930e-2, 2.96560571828504891230e-1, 1.78482653991729133580e0,
                   5.46378491116411436990e0, 6.65790464350110377720e0},
                  {2.04426310338993978564e-15, 1.42151175831644588870e-7, 1.84631831751005468180e-5,
                   7.86869131145613259100e-4, 1.48753612908506148525e-2, 1.36929880922735805310e-1,
                   5.99832206555887937690e-1, 1.0},
                  r - 5)
          : ratio({7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1,
                   1.27045825245236838258e0, 3.64784832476320460504e0, 5.76949722146069140550e0,
                   4.63033784615654529590e0, 1.42343711074968357734e0},
                  {1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2,
                   1.48103976427480074590e-1, 6.89767334985100004550e-1, 1.67638483018380384940e0,
                   2.05319162663775882187e0, 1.0},
                  r - 1.6);
  return q < 0 ? -z : z;
}

/// The rotor {s, e23, e31, e12} of a rotation vector, rad, with the same bits everywhere.
[[nodiscard]] inline std::array<double, 4> rotor_of(const std::array<double, 3>& turn) noexcept {
  const double angle = std::sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
  const auto [cosine, sine] = detail::portable_cosine_and_sine(0.5 * angle);
  const double ratio = angle > 0 ? sine / angle : 0.5;
  return {cosine, -ratio * turn[0], -ratio * turn[1], -ratio * turn[2]};
}

/// The random numbers of one member, one after the other.
///
/// Those of `run_ensemble` for the same seed, member and count, in the order in which a scene's
/// [ensemble] takes them: per body position, orientation, growth, momenta and rates, then
/// parameters.
class MemberNumbers {
 public:
  /// `each`: how many a member takes at most, the same for all members of an ensemble.
  constexpr MemberNumbers(std::uint64_t seed, std::uint64_t member, std::uint64_t each) noexcept
      : seed_(seed), left_(each) {
    const auto [high, low] = detail::long_product(member, (each + 3) / 4);
    counter_ = {low, high, 0, 0};
  }

  /// Uniform in (0, 1).
  [[nodiscard]] constexpr double uniform() noexcept {
    assert(left_ > 0 && "a member takes no more numbers than MemberNumbers was told");
    --left_;
    if (next_ == words_.size()) {
      if (++counter_[0] == 0) ++counter_[1];
      words_ = philox4x64(counter_, {seed_, 0});
      next_ = 0;
    }
    return uniform_of(words_[next_++]);
  }
  [[nodiscard]] constexpr double uniform(double low, double high) noexcept {
    return low + (high - low) * uniform();
  }

  [[nodiscard]] double normal(double mean = 0, double deviation = 1) noexcept {
    return mean + deviation * normal_of(uniform());
  }

  /// {s, e23, e31, e12} of a rotation in space of which all are equally likely; takes four numbers.
  [[nodiscard]] std::array<double, 4> rotor() noexcept {
    std::array<double, 4> q{};
    for (double& x : q) x = normal();
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (double& x : q) x /= norm;
    return q;
  }

 private:
  std::uint64_t seed_;
  std::uint64_t left_;
  std::array<std::uint64_t, 4> counter_{};
  std::array<std::uint64_t, 4> words_{};
  std::size_t next_ = 4;
};

}  // namespace hamotor
