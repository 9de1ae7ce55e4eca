// Generic multivectors: all 2ⁿ components, products by table.  What generated kernels are measured
// against and, since nothing here is unrolled or folded, what they are checked against.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

namespace hamotor::generic {

/// Components over the basis blades; blade k is the outer product of the basis vectors in the bits
/// of k, in ascending order.
template <int N, class S>
using Multivector = std::array<S, std::size_t{1} << N>;

/// One term of a product of basis blades: a b contains `coefficient` times blade c.
struct Term {
  std::uint16_t a;
  std::uint16_t b;
  std::uint16_t c;
  double coefficient;
};

/// The parts of a product that are kept.
enum class Product {
  geometric,
  outer,
  inner,
  left_contraction,
  right_contraction,
  commutator,
  anticommutator,
  regressive
};

/// Geometric algebra of dimension N over any symmetric Gram matrix.
template <int N>
class Algebra {
 public:
  static constexpr unsigned blades = 1U << N;
  static constexpr unsigned pseudoscalar = blades - 1;
  using Gram = std::array<std::array<double, N>, N>;
  using Sum = std::map<unsigned, double>;

  explicit Algebra(const Gram& gram) : gram_(gram) {}

  /// Every nonzero term of a product of basis blades, ordered by a, b, c.
  [[nodiscard]] std::vector<Term> terms(Product kind) const {
    std::vector<Term> all;
    for (unsigned a = 0; a < blades; ++a) {
      for (unsigned b = 0; b < blades; ++b) {
        for (const auto& [c, x] : product(kind, a, b)) {
          all.push_back({static_cast<std::uint16_t>(a), static_cast<std::uint16_t>(b),
                         static_cast<std::uint16_t>(c), x});
        }
      }
    }
    return all;
  }

  /// A product of two basis blades.
  [[nodiscard]] Sum product(Product kind, unsigned a, unsigned b) const {
    const int i = std::popcount(a);
    const int j = std::popcount(b);
    switch (kind) {
      case Product::geometric:
        return geometric(a, b);
      case Product::outer:
        return graded(a, b, i + j);
      case Product::inner:
        return graded(a, b, i < j ? j - i : i - j);
      case Product::left_contraction:
        return graded(a, b, j - i);
      case Product::right_contraction:
        return graded(a, b, i - j);
      case Product::commutator:
      case Product::anticommutator: {
        Sum total;
        const double sign = kind == Product::commutator ? -0.5 : 0.5;
        add(total, geometric(a, b), 0.5);
        add(total, geometric(b, a), sign);
        return total;
      }
      case Product::regressive: {
        Sum total;
        const unsigned a_dual = pseudoscalar ^ a;
        const unsigned b_dual = pseudoscalar ^ b;
        if ((a_dual & b_dual) != 0) return total;
        const unsigned meet = pseudoscalar ^ (a_dual | b_dual);
        // (a ∨ b)* = a* ∧ b* with c ∧ c* = I
        const double sign = outer_sign(a, a_dual) * outer_sign(b, b_dual) *
                            outer_sign(a_dual, b_dual) * outer_sign(meet, a_dual | b_dual);
        total[meet] = sign;
        return total;
      }
    }
    return {};
  }

  /// Sign of a ∧ b relative to the blade of both, for disjoint a and b.
  [[nodiscard]] static double outer_sign(unsigned a, unsigned b) {
    int swaps = 0;
    for (unsigned rest = a >> 1; rest != 0; rest >>= 1) swaps += std::popcount(rest & b);
    return swaps % 2 == 0 ? 1.0 : -1.0;
  }

 private:
  static void add(Sum& into, const Sum& other, double factor) {
    for (const auto& [blade, x] : other) {
      if ((into[blade] += factor * x) == 0.0) into.erase(blade);
    }
  }

  [[nodiscard]] Sum graded(unsigned a, unsigned b, int wanted) const {
    Sum kept;
    for (const auto& [c, x] : geometric(a, b)) {
      if (std::popcount(c) == wanted) kept[c] = x;
    }
    return kept;
  }

  /// v B for a basis vector v = e_k: the outer product and the contraction.
  [[nodiscard]] Sum vector_times(int k, unsigned b) const {
    Sum total;
    double sign = 1.0;
    for (int other = 0; other < N; ++other) {
      if ((b >> other & 1U) == 0U) continue;
      const double g = gram_[static_cast<std::size_t>(k)][static_cast<std::size_t>(other)];
      if (g != 0.0) add(total, Sum{{b ^ (1U << other), sign * g}}, 1.0);
      sign = -sign;
    }
    if ((b >> k & 1U) == 0U) add(total, Sum{{b | 1U << k, outer_sign(1U << k, b)}}, 1.0);
    return total;
  }

  /// A B for basis blades.  With A = v ∧ A′ = ½(v A′ ± A′ v), only products with vectors are
  /// needed.
  [[nodiscard]] Sum geometric(unsigned a, unsigned b) const {
    if (a == 0U) return Sum{{b, 1.0}};
    const int k = std::countr_zero(a);
    const unsigned rest = a & (a - 1U);
    // v ∧ A′ = v A′ − v⌋A′
    Sum total;
    for (const auto& [blade, x] : geometric(rest, b)) add(total, vector_times(k, blade), x);
    for (const auto& [blade, x] : vector_times(k, rest)) {
      if (std::popcount(blade) < std::popcount(rest)) add(total, geometric(blade, b), -x);
    }
    return total;
  }

  Gram gram_;
};

/// The product of two dense multivectors from a list of terms: every term of the algebra is done.
template <int N, class S>
[[nodiscard]] Multivector<N, S> multiply(const std::vector<Term>& terms, const Multivector<N, S>& a,
                                         const Multivector<N, S>& b) {
  Multivector<N, S> c{};
  for (const Term& t : terms) c[t.c] += static_cast<S>(t.coefficient) * a[t.a] * b[t.b];
  return c;
}

}  // namespace hamotor::generic
