// The linear equations of Newton's method for the stages of a Gauss method.
//
// Dense elimination of our own: the matrices have a few dozen rows at most, and a step allocates
// nothing.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "hamotor/gauss_table.hpp"
#include "hamotor/scalar.hpp"

namespace hamotor::detail {

template <class S, std::size_t size>
using Vector = std::array<S, size>;
template <class S, std::size_t size>
using Matrix = std::array<std::array<S, size>, size>;

template <class S, std::size_t size>
[[nodiscard]] constexpr Vector<S, size> times(const Matrix<S, size>& a,
                                              const Vector<S, size>& x) noexcept {
  Vector<S, size> result{};
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t k = 0; k < size; ++k) result[i] = mul_add(a[i][k], x[k], result[i]);
  }
  return result;
}

/// A matrix as the product of triangular ones, rows exchanged so that pivots are large.
template <class S, std::size_t size>
class Eliminated {
 public:
  constexpr Eliminated() noexcept = default;
  constexpr explicit Eliminated(const Matrix<S, size>& a) noexcept : lu_(a) {
    for (std::size_t k = 0; k < size; ++k) {
      std::size_t best = k;
      for (std::size_t i = k + 1; i < size; ++i) {
        if (scalar::abs(lu_[i][k]) > scalar::abs(lu_[best][k])) best = i;
      }
      rows_[k] = best;
      std::swap(lu_[k], lu_[best]);
      for (std::size_t i = k + 1; i < size; ++i) {
        const S by = lu_[i][k] / lu_[k][k];
        lu_[i][k] = by;
        for (std::size_t j = k + 1; j < size; ++j) {
          lu_[i][j] = mul_add(-by, lu_[k][j], lu_[i][j]);
        }
      }
    }
  }

  /// x of a x = b.
  [[nodiscard]] constexpr Vector<S, size> solve(Vector<S, size> b) const noexcept {
    for (std::size_t k = 0; k < size; ++k) std::swap(b[k], b[rows_[k]]);
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t k = 0; k < i; ++k) b[i] = mul_add(-lu_[i][k], b[k], b[i]);
    }
    for (std::size_t i = size; i-- > 0;) {
      for (std::size_t k = i + 1; k < size; ++k) b[i] = mul_add(-lu_[i][k], b[k], b[i]);
      b[i] = b[i] / lu_[i][i];
    }
    return b;
  }

 private:
  Matrix<S, size> lu_{};
  std::array<std::size_t, size> rows_{};
};

/// (1 − h A ⊗ J) δ = r for the collocation matrix A of Gauss's nodes.
///
/// In Legendre polynomials A is tridiagonal (Hairer & Wanner 1996, IV.5), so that elimination goes
/// block by block.  The leading blocks are those of fewer stages, which are regular for every
/// eigenvalue of J without positive real part.
template <class S, std::size_t stages, std::size_t size>
class StageEquations {
 public:
  using Slopes = std::array<Vector<S, size>, stages>;

  constexpr void set(const Matrix<S, size>& jacobian, const S& h) noexcept {
    jacobian_ = jacobian;
    h_ = h;
    Matrix<S, size> block{};
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t k = 0; k < size; ++k) block[i][k] = S(-0.5) * h * jacobian[i][k];
      block[i][i] = block[i][i] + S(1);
    }
    blocks_[0] = Eliminated<S, size>(block);
    for (std::size_t k = 1; k < stages; ++k) {
      block = {};
      for (std::size_t column = 0; column < size; ++column) {
        Vector<S, size> x{};
        for (std::size_t i = 0; i < size; ++i) x[i] = jacobian[i][column];
        x = times(jacobian_, blocks_[k - 1].solve(x));
        for (std::size_t i = 0; i < size; ++i) block[i][column] = below(k) * above(k - 1) * x[i];
      }
      for (std::size_t i = 0; i < size; ++i) block[i][i] = block[i][i] + S(1);
      blocks_[k] = Eliminated<S, size>(block);
    }
  }

  /// δ at the stages from r there.
  [[nodiscard]] constexpr Slopes solve(const GaussTable<S, stages>& table,
                                       const Slopes& r) const noexcept {
    Slopes x{};
    for (std::size_t k = 0; k < stages; ++k) {
      for (std::size_t j = 0; j < stages; ++j) {
        const S by = S(static_cast<int>(2 * k + 1)) * table.weights[j] * table.legendre[k][j];
        for (std::size_t i = 0; i < size; ++i) x[k][i] = mul_add(by, r[j][i], x[k][i]);
      }
    }
    for (std::size_t k = 1; k < stages; ++k) {
      const auto y = times(jacobian_, blocks_[k - 1].solve(x[k - 1]));
      for (std::size_t i = 0; i < size; ++i) x[k][i] = mul_add(below(k), y[i], x[k][i]);
    }
    for (std::size_t k = stages; k-- > 0;) {
      if (k + 1 < stages) {
        const auto y = times(jacobian_, x[k + 1]);
        for (std::size_t i = 0; i < size; ++i) x[k][i] = mul_add(-above(k), y[i], x[k][i]);
      }
      x[k] = blocks_[k].solve(x[k]);
    }
    Slopes result{};
    for (std::size_t j = 0; j < stages; ++j) {
      for (std::size_t k = 0; k < stages; ++k) {
        for (std::size_t i = 0; i < size; ++i) {
          result[j][i] = mul_add(table.legendre[k][j], x[k][i], result[j][i]);
        }
      }
    }
    return result;
  }

 private:
  /// A's entries in Legendre polynomials P_k, times h: below the diagonal, and minus above it.
  [[nodiscard]] constexpr S below(std::size_t k) const noexcept {
    return h_ / S(static_cast<int>(2 * (2 * k - 1)));
  }
  [[nodiscard]] constexpr S above(std::size_t k) const noexcept {
    return h_ / S(static_cast<int>(2 * (2 * k + 3)));
  }

  Matrix<S, size> jacobian_{};
  std::array<Eliminated<S, size>, stages> blocks_{};
  S h_{};
};

}  // namespace hamotor::detail
