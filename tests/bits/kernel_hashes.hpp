// Hashes of what kernels compute on fixed random inputs, one number at a time and in a loop over
// arrays: equal lines from two builds mean equal bits.
//
// The program that includes this, written by kernel_hashes.py, defines how often each kernel is
// evaluated and the size of the largest: hamotor::bits::evaluations, most_inputs, most_outputs.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <type_traits>

namespace hamotor::bits {

/// A word that depends on both numbers and on nothing else: SplitMix64, entered at `counter`.
[[nodiscard]] constexpr std::uint64_t random_word(std::uint64_t seed, std::uint64_t counter) {
  std::uint64_t z = seed + (counter + 1) * 0x9e3779b97f4a7c15U;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
  return z ^ (z >> 31);
}

/// Uniform in [-1, 1), every bit of the significand in use; no operation rounds.
template <class S>
[[nodiscard]] constexpr S random_number(std::uint64_t seed, std::uint64_t counter) {
  constexpr int digits = std::numeric_limits<S>::digits;
  constexpr std::int64_t half = std::int64_t{1} << (digits - 1);
  const auto word = static_cast<std::int64_t>(random_word(seed, counter) >> (64 - digits));
  return static_cast<S>(word - half) / static_cast<S>(half);
}

/// FNV-1a over bytes.
class Hash {
 public:
  constexpr void operator()(char letter) { bytes(static_cast<unsigned char>(letter), 1); }
  /// The bytes of a number, lowest first.  Every NaN is one: its sign and payload mean nothing.
  template <class S>
  constexpr void operator()(const S& x) {
    using Word = std::conditional_t<sizeof(S) == 4, std::uint32_t, std::uint64_t>;
    bytes(x == x ? std::bit_cast<Word>(x) : ~Word{}, sizeof(S));
  }
  [[nodiscard]] constexpr std::uint64_t value() const { return state_; }

 private:
  constexpr void bytes(std::uint64_t word, std::size_t count) {
    for (; count > 0; --count, word >>= 8) state_ = (state_ ^ (word & 0xffU)) * 0x100000001b3U;
  }
  std::uint64_t state_ = 0xcbf29ce484222325U;
};

/// A kernel applied to elements `first` to `last` - 1 of arrays: component c of element i stands at
/// c * evaluations + i, as loops over lanes want it.
template <class S>
using Loop = void (*)(const S* __restrict in, S* __restrict out, std::size_t first,
                      std::size_t last);

/// Prints `scalar <tab> title <tab> hash one at a time <tab> hash in a loop`.
template <class S>
void report(const char* scalar, const char* title, Loop<S> loop, std::size_t inputs,
            std::size_t outputs) {
  static S in[most_inputs * evaluations];
  static S out[most_outputs * evaluations];

  Hash seed;
  for (const char* letter = title; *letter != 0; ++letter) seed(*letter);
  for (std::size_t i = 0; i < inputs * evaluations; ++i) in[i] = random_number<S>(seed.value(), i);

  const auto hashed = [&] {
    Hash hash;
    for (std::size_t i = 0; i < outputs * evaluations; ++i) hash(out[i]);
    return static_cast<unsigned long long>(hash.value());
  };
  for (std::size_t i = 0; i < evaluations; ++i) loop(in, out, i, i + 1);
  const auto single = hashed();
  for (S& x : out) x = 0;
  loop(in, out, 0, evaluations);
  std::printf("%s\t%s\t%016llx\t%016llx\n", scalar, title, single, hashed());
}

}  // namespace hamotor::bits
