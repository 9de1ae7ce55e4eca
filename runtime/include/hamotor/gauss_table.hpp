// Gauss's quadrature and its collocation matrix, for any number of stages and any scalar.
#pragma once

#include <array>
#include <cstddef>

#include "hamotor/scalar.hpp"
#include "hamotor/splitting_schemes.hpp"

namespace hamotor {

/// Gauss's quadrature on [0, 1], and its collocation matrix a_ij = (½ + skew_ij) b_j.
///
/// skew is antisymmetric to the last bit, which is the condition of symplecticity: rounded
/// coefficients define a method that is symplectic as exactly (Antoñana, Makazaga & Murua 2017).
template <class S, std::size_t stages>
struct GaussTable {
  std::array<S, stages> nodes;                         ///< c
  std::array<S, stages> weights;                       ///< b
  std::array<std::array<S, stages>, stages> skew;      ///< a_ij/b_j − ½
  std::array<std::array<S, stages>, stages> next;      ///< of stages j, their polynomial at 1 + c_i
  std::array<std::array<S, stages>, stages> legendre;  ///< P_k(2c_j − 1), by k
  std::array<std::array<S, stages>, stages> coefficients;  ///< (2k + 1) b_j P_k(2c_j − 1), by k
};

namespace detail {

/// P_0(x), …, P_count−1(x), Legendre's polynomials.
template <class S, std::size_t count>
[[nodiscard]] constexpr std::array<S, count> legendre_polynomials(const S& x) noexcept {
  std::array<S, count> p{};
  p[0] = S(1);
  if constexpr (count > 1) p[1] = x;
  for (std::size_t k = 2; k < count; ++k) {
    const int n = static_cast<int>(k);
    p[k] = (S(2 * n - 1) * x * p[k - 1] - S(n - 1) * p[k - 2]) / S(n);
  }
  return p;
}

/// The zeros of P_stages on [−1, 1] in rising order: between those of the polynomial of one degree
/// less, by bisection and Newton's method.
template <class S, std::size_t stages>
[[nodiscard]] constexpr std::array<S, stages> legendre_zeros() noexcept {
  std::array<S, stages + 1> found{};  // of the degree before, with 1 as the last
  found[0] = S(1);
  std::array<S, stages> zeros{};
  for (std::size_t n = 1; n <= stages; ++n) {
    S from(-1);
    for (std::size_t k = 0; k < n; ++k) {
      S low = from;
      S high = found[k];
      from = high;
      const auto value = [&](const S& x) { return legendre_polynomials<S, stages + 1>(x)[n]; };
      const bool rises = (n - k) % 2 == 1;
      for (int halving = 0; halving < 8; ++halving) {
        const S middle = S(0.5) * (low + high);
        ((value(middle) < S(0)) == rises ? low : high) = middle;
      }
      S x = S(0.5) * (low + high);
      for (int bits = 4; bits < 2 * scalar::Limits<S>::digits; bits *= 2) {
        const auto p = legendre_polynomials<S, stages + 1>(x);
        const S slope = S(static_cast<int>(n)) * (x * p[n] - p[n - 1]) / (x * x - S(1));
        x = x - p[n] / slope;
      }
      zeros[k] = x;
    }
    for (std::size_t k = 0; k < n; ++k) found[k] = zeros[k];
    found[n] = S(1);
  }
  return zeros;
}

template <class S, std::size_t stages>
[[nodiscard]] constexpr GaussTable<S, stages> gauss_table() noexcept {
  using Wide = CoefficientScalar<S>;
  const auto zeros = legendre_zeros<Wide, stages>();
  std::array<std::array<Wide, stages + 1>, stages> p{};
  std::array<Wide, stages> weights{};
  GaussTable<S, stages> table{};
  for (std::size_t j = 0; j < stages; ++j) {
    // The same numbers from both ends.
    const Wide x = Wide(0.5) * (zeros[j] - zeros[stages - 1 - j]);
    p[j] = legendre_polynomials<Wide, stages + 1>(x);
    const Wide before = Wide(static_cast<int>(stages)) * p[j][stages - 1];
    weights[j] = (Wide(1) - x * x) / (before * before);
    table.nodes[j] = static_cast<S>((Wide(1) + x) / Wide(2));
    table.weights[j] = static_cast<S>(weights[j]);
    for (std::size_t k = 0; k < stages; ++k) {
      table.legendre[k][j] = static_cast<S>(p[j][k]);
      table.coefficients[k][j] =
          static_cast<S>(Wide(static_cast<int>(2 * k + 1)) * weights[j] * p[j][k]);
    }
  }
  for (std::size_t i = 0; i < stages; ++i) {
    const auto later = legendre_polynomials<Wide, stages>(p[i][1] + Wide(2));
    for (std::size_t j = 0; j < stages; ++j) {
      // ℓ_j = b_j Σ (2k + 1) P_k(x_j) P_k, and (2k + 1) ∫ P_k = P_k+1 − P_k−1.
      Wide skew = p[i][1];
      Wide next(1);
      for (std::size_t k = 1; k < stages; ++k) {
        skew = skew + p[j][k] * (p[i][k + 1] - p[i][k - 1]);
        next = next + Wide(static_cast<int>(2 * k + 1)) * p[j][k] * later[k];
      }
      if (i < j) {
        table.skew[i][j] = static_cast<S>(skew / Wide(2));
        table.skew[j][i] = -table.skew[i][j];
      }
      table.next[i][j] = static_cast<S>(weights[j] * next);
    }
  }
  return table;
}

}  // namespace detail

}  // namespace hamotor
