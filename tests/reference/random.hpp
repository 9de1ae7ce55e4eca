// Reproducible random numbers for programs that measure, the same on every machine: SplitMix64
// (Steele, Lea & Flood 2014).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace reference {

struct Random {
  std::uint64_t state;

  std::uint64_t bits() {
    std::uint64_t z = (state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double symmetric() { return 2 * uniform() - 1; }
  double power_of_ten(double low, double high) { return std::pow(10.0, between(low, high)); }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(bits() % n); }
  double sign() { return below(2) == 0 ? -1 : 1; }
};

}  // namespace reference
