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

/// y + A x for A given by its columns, which is a loop without dependences.
template <class S, std::size_t size>
[[nodiscard]] constexpr Vector<S, size> add_product(const Matrix<S, size>& columns,
                                                    const Vector<S, size>& x,
                                                    Vector<S, size> y) noexcept {
  for (std::size_t k = 0; k < size; ++k) {
    for (std::size_t i = 0; i < size; ++i) y[i] = mul_add(columns[k][i], x[k], y[i]);
  }
  return y;
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

/// δ_i − h J Σ ã_ij δ_j − (C + (2c_i − 1) D) ½ h Σ b_j δ_j = r_i for Gauss's nodes c, weights b and
/// collocation matrix a, ã_ij = a_ij − b_j/2: what is common to all stages may act otherwise than
/// what is not, and on each otherwise.
///
/// In Legendre polynomials A is tridiagonal (Hairer & Wanner 1996, IV.5), so that elimination goes
/// block by block.  The leading blocks are those of fewer stages, which are regular for every
/// eigenvalue of J without positive real part.  They are inverted once: substitution would wait for
/// itself.
template <class S, std::size_t stages, std::size_t size>
class StageEquations {
 public:
  using Slopes = std::array<Vector<S, size>, stages>;

  constexpr void set(const Matrix<S, size>& jacobian, const Matrix<S, size>& common,
                     const Matrix<S, size>& slope, const S& h) noexcept {
    Matrix<S, size> block{};
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t k = 0; k < size; ++k) block[i][k] = S(-0.5) * h * common[i][k];
      block[i][i] = block[i][i] + S(1);
    }
    for (std::size_t k = 0; k < stages; ++k) {
      inverse_[k] = inverse(block);
      if (k + 1 == stages) break;
      // A's entries in Legendre polynomials P_k, times h, are ± this.
      const S by = h / S(static_cast<int>(2 * (2 * k + 1)));
      const S above = h / S(static_cast<int>(2 * (2 * k + 3)));
      Matrix<S, size> down{};
      Matrix<S, size> up{};
      for (std::size_t column = 0; column < size; ++column) {
        for (std::size_t row = 0; row < size; ++row) {
          // From P_0 to P_1 also what is common to all stages.
          down[column][row] =
              by * (k == 0 ? jacobian[row][column] + slope[row][column] : jacobian[row][column]);
          up[column][row] = -above * jacobian[row][column];
        }
      }
      block = {};
      for (std::size_t column = 0; column < size; ++column) {
        down_[k][column] = add_product(down, inverse_[k][column], {});
        up_[k][column] = add_product(inverse_[k], up[column], {});
      }
      for (std::size_t column = 0; column < size; ++column) {
        const auto x = add_product(down_[k], up[column], {});
        for (std::size_t i = 0; i < size; ++i) block[i][column] = -x[i];
        block[column][column] = block[column][column] + S(1);
      }
    }
  }

  /// δ at the stages from r there.
  [[nodiscard]] constexpr Slopes solve(const GaussTable<S, stages>& table,
                                       const Slopes& r) const noexcept {
    Slopes x{};
    for (std::size_t k = 0; k < stages; ++k) {
      for (std::size_t j = 0; j < stages; ++j) {
        for (std::size_t i = 0; i < size; ++i) {
          x[k][i] = mul_add(table.coefficients[k][j], r[j][i], x[k][i]);
        }
      }
    }
    for (std::size_t k = 1; k < stages; ++k) x[k] = add_product(down_[k - 1], x[k - 1], x[k]);
    x[stages - 1] = add_product(inverse_[stages - 1], x[stages - 1], {});
    for (std::size_t k = stages - 1; k-- > 0;) {
      x[k] = add_product(up_[k], x[k + 1], add_product(inverse_[k], x[k], {}));
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
  /// By columns.
  [[nodiscard]] static constexpr Matrix<S, size> inverse(const Matrix<S, size>& a) noexcept {
    const Eliminated<S, size> eliminated(a);
    Matrix<S, size> columns{};
    for (std::size_t k = 0; k < size; ++k) {
      Vector<S, size> unit{};
      unit[k] = S(1);
      columns[k] = eliminated.solve(unit);
    }
    return columns;
  }

  std::array<Matrix<S, size>, stages> inverse_{};  ///< of the diagonal blocks
  std::array<Matrix<S, size>, stages> down_{};     ///< to the next block, after that inverse
  std::array<Matrix<S, size>, stages> up_{};       ///< from the next block, before it
};

}  // namespace hamotor::detail
