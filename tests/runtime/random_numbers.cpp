// A member's random numbers: those of run_ensemble, to the bit.

#include "hamotor/random_numbers.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

namespace {

using hamotor::MemberNumbers;

/// FNV-1a of numbers' bits, word by word.
class Hash {
 public:
  void add(double x) { hash_ = (hash_ ^ std::bit_cast<std::uint64_t>(x)) * 0x100000001b3; }
  [[nodiscard]] std::string text() const {
    std::array<char, 17> digits{};
    std::snprintf(digits.data(), digits.size(), "%016llx", static_cast<unsigned long long>(hash_));
    return digits.data();
  }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325;
};

// test_random_numbers.py finds the same with the generator's own.
TEST(MemberNumbers, have_the_bits_of_run_ensembles) {
  Hash hash;
  for (const std::uint64_t seed : {std::uint64_t{0}, std::uint64_t{2026}, ~std::uint64_t{0}}) {
    for (std::uint64_t member = 0; member < 200; ++member) {
      MemberNumbers numbers(seed, member * member * member * 125'003, 9);
      hash.add(numbers.uniform(-2, 3));
      hash.add(numbers.normal(1, 0.5));
      for (const double x : numbers.rotor()) hash.add(x);
      std::array<double, 3> turn{};
      for (double& x : turn) x = numbers.normal(0, 20);
      for (const double x : hamotor::rotor_of(turn)) hash.add(x);
    }
  }
  for (const double x : {0x1p-54, 1e-12, 0.0749, 0.5, 0.9251, 1 - 1e-9, 1 - 0x1p-53}) {
    hash.add(hamotor::normal_of(x));
  }
  EXPECT_EQ(hash.text(), "bd1ec2a0b85cf9a5");
}

TEST(MemberNumbers, begin_at_counters_of_two_words) {
  constexpr std::uint64_t last = std::numeric_limits<std::uint64_t>::max();
  // blocks of four: 2 · (2⁶⁴ − 1) = 2⁶⁵ − 2, and the next block but one has a carry
  MemberNumbers numbers(7, last, 8);
  const auto first = hamotor::philox4x64({last, 1, 0, 0}, {7, 0});
  const auto second = hamotor::philox4x64({0, 2, 0, 0}, {7, 0});
  for (const auto& words : {first, second}) {
    for (const std::uint64_t word : words) {
      EXPECT_EQ(numbers.uniform(), hamotor::uniform_of(word));
    }
  }
}

TEST(MemberNumbers, are_neither_0_nor_1) {
  EXPECT_EQ(hamotor::uniform_of(0), 0x1p-54);
  EXPECT_EQ(hamotor::uniform_of(~std::uint64_t{0}), 1 - 0x1p-53);
  EXPECT_NEAR(hamotor::normal_of(hamotor::uniform_of(~std::uint64_t{0})), 8.2, 0.1);
}

TEST(MemberNumbers, are_spread_as_they_should_be) {
  constexpr int members = 20'000;
  double sum = 0;
  double squares = 0;
  std::array<double, 4> attitudes{};
  for (std::uint64_t k = 0; k < members; ++k) {
    MemberNumbers numbers(3, k, 5);
    const double x = numbers.normal(2, 3);
    sum += x;
    squares += (x - 2) * (x - 2);
    const auto q = numbers.rotor();
    double norm = 0;
    for (std::size_t i = 0; i < q.size(); ++i) {
      attitudes[i] += q[i] * q[i];
      norm += q[i] * q[i];
    }
    EXPECT_NEAR(norm, 1, 1e-15);
  }
  EXPECT_NEAR(sum / members, 2, 0.1);
  EXPECT_NEAR(std::sqrt(squares / members), 3, 0.1);
  for (const double square : attitudes) EXPECT_NEAR(square / members, 0.25, 0.01);
}

TEST(MemberNumbers, rotors_of_small_turns_are_halves_of_them) {
  const auto q = hamotor::rotor_of({1e-200, -2e-200, 0});
  EXPECT_EQ(q[0], 1);
  EXPECT_EQ(q[1], -5e-201);
  EXPECT_EQ(q[2], 1e-200);
  EXPECT_EQ(q[3], 0);
  EXPECT_EQ(hamotor::rotor_of({0, 0, 0}), (std::array<double, 4>{1, 0, 0, 0}));
}

}  // namespace
