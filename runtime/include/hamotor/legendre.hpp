// The Legendre transform by numbers: systems that are given by a Lagrangian L(M, B, t).
//
// Where μ = ∂L/∂B has no inverse in formulas, B is found at every evaluation by Newton's method
// with the Hessian ∂²L/∂B².  H = μ·B − L then, and its forque dH at fixed μ is −dL at fixed B.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

#include "hamotor/scalar.hpp"
#include "hamotor/state.hpp"

namespace hamotor {

/// ∂L/∂B, and ∂²L/∂B² by rows, of N rates.
template <std::size_t N, class S>
struct LegendreDerivatives {
  std::array<S, N> momentum;
  std::array<std::array<S, N>, N> hessian;
};

namespace detail {

/// Solves A x = b by elimination with partial pivoting; not finite if A is singular.
template <std::size_t N, class S>
[[nodiscard]] constexpr std::array<S, N> eliminated(std::array<std::array<S, N>, N> a,
                                                    std::array<S, N> b) noexcept {
  for (std::size_t k = 0; k < N; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < N; ++i) {
      if (scalar::abs(a[i][k]) > scalar::abs(a[pivot][k])) pivot = i;
    }
    std::swap(a[k], a[pivot]);
    std::swap(b[k], b[pivot]);
    for (std::size_t i = k + 1; i < N; ++i) {
      const S factor = a[i][k] / a[k][k];
      for (std::size_t j = k + 1; j < N; ++j) a[i][j] = mul_add(-factor, a[k][j], a[i][j]);
      b[i] = mul_add(-factor, b[k], b[i]);
    }
  }
  for (std::size_t k = N; k-- > 0;) {
    for (std::size_t j = k + 1; j < N; ++j) b[k] = mul_add(-a[k][j], b[j], b[k]);
    b[k] = b[k] / a[k][k];
  }
  return b;
}

/// Σ w_i x_i².
template <std::size_t N, class S>
[[nodiscard]] constexpr S weighted_square(const std::array<S, N>& x,
                                          const std::array<S, N>& weights) noexcept {
  S sum(0);
  for (std::size_t i = 0; i < N; ++i) sum = mul_add(weights[i] * x[i], x[i], sum);
  return sum;
}

}  // namespace detail

/// The rates B at which ∂L/∂B is `momentum`, by Newton's method from `guess`.
///
/// `derivatives(B)` gives ∂L/∂B and ∂²L/∂B².  From B = 0 the first step is the answer for the
/// quadratic part of L.  A step is halved while it leaves the domain of L or does not bring ∂L/∂B
/// nearer, squares weighted by 1/|K_ii| at the guess, so that they are energies.  Errors are
/// squared by every step in the end, so that a step of less than √ε/8 of B is the last.  Not a
/// number where no B is found in 100 evaluations: the momentum is none of L's, or ∂²L/∂B² is
/// singular on the way.
template <std::size_t N, class S, class Derivatives>
[[nodiscard]] constexpr std::array<S, N> legendre_newton(const std::array<S, N>& momentum,
                                                         const Derivatives& derivatives,
                                                         std::array<S, N> guess = {}) noexcept {
  constexpr int most_evaluations = 100;
  const S negligible =
      scalar::constant([] { return scalar::power_of_two<S>(-(scalar::Limits<S>::digits + 6)); });
  const auto missing = [&](const LegendreDerivatives<N, S>& now) {
    std::array<S, N> rest{};
    for (std::size_t i = 0; i < N; ++i) rest[i] = momentum[i] - now.momentum[i];
    return rest;
  };
  std::array<S, N> rates = guess;
  LegendreDerivatives<N, S> now = derivatives(rates);
  std::array<S, N> weights{};
  std::array<S, N> inverse_weights{};
  for (std::size_t i = 0; i < N; ++i) {
    const S size = scalar::abs(now.hessian[i][i]);
    weights[i] = select(size > S(0), size, S(1));
    inverse_weights[i] = S(1) / weights[i];
  }
  std::array<S, N> rest = missing(now);
  S error = detail::weighted_square(rest, inverse_weights);
  for (int evaluations = 1; evaluations < most_evaluations;) {
    const std::array<S, N> step = detail::eliminated(now.hessian, rest);
    S factor(1);
    bool nearer = false;
    std::array<S, N> trial{};
    while (!nearer && evaluations < most_evaluations) {
      for (std::size_t i = 0; i < N; ++i) trial[i] = mul_add(factor, step[i], rates[i]);
      // Not asked to come nearer: rounding would decide it.
      const S moved = detail::weighted_square(step, weights);
      if (moved <= negligible * detail::weighted_square(trial, weights)) return trial;
      now = derivatives(trial);
      ++evaluations;
      const std::array<S, N> left = missing(now);
      const S shrunk = detail::weighted_square(left, inverse_weights);
      nearer = shrunk <= (S(1) - factor * S(0.25)) * error;
      if (nearer) {
        rates = trial;
        rest = left;
        error = shrunk;
      } else {
        factor = factor * S(0.5);
      }
    }
  }
  for (S& rate : rates) rate = rate * S(0) / S(0);
  return rates;
}

/// A system from a Lagrangian, which says for motors, rates and time
///
///     Scalar lagrangian(motors, rates, t)                          L, J
///     LegendreDerivatives<N, Scalar> derivatives(motors, rates, t)   of L in the rates of all
///     bodies std::array<Momentum, bodies> forque(motors, rates, t)        −dL and what is applied
///     Scalar power(motors, rates, t)                               dH/dt, W; if it is not zero
///
/// as static functions, N = bodies × dimension of the group.
template <class Lagrangian>
struct LegendreSystem {
  using Group = typename Lagrangian::Group;
  using Scalar = typename Lagrangian::Scalar;
  using S = Scalar;
  static constexpr std::size_t bodies = Lagrangian::bodies;
  static constexpr bool has_forque = Lagrangian::has_forque;
  /// Every body of an ensemble converges in its own time.
  static constexpr bool iterates = true;
  static constexpr auto dimension = static_cast<std::size_t>(Group::dimension);
  static constexpr std::size_t size = bodies * dimension;
  using State = hamotor::State<Group, bodies, S>;
  using Rate = typename Group::template Rate<S>;
  using Rates = std::array<Rate, bodies>;

  /// B of every body; not numbers where momenta belong to none.
  [[nodiscard]] static constexpr Rates rates(const State& state, const S& t) noexcept {
    std::array<S, size> momentum{};
    for (std::size_t k = 0; k < bodies; ++k) {
      const auto components = state.momenta[k].components();
      for (std::size_t i = 0; i < dimension; ++i) momentum[k * dimension + i] = components[i];
    }
    return separate(legendre_newton(momentum, [&](const std::array<S, size>& joint) {
      return Lagrangian::derivatives(state.motors, separate(joint), t);
    }));
  }

  /// H = μ·B − L, J.
  [[nodiscard]] static constexpr S energy(const State& state, const S& t) noexcept {
    const Rates b = rates(state, t);
    S sum = -Lagrangian::lagrangian(state.motors, b, t);
    for (std::size_t k = 0; k < bodies; ++k) sum = sum + pairing(state.momenta[k], b[k]);
    return sum;
  }

  /// B and F = −dL of every body.
  [[nodiscard]] static constexpr Gradient<Group, bodies, S> gradient(const State& state,
                                                                     const S& t) noexcept {
    const Rates b = rates(state, t);
    if constexpr (has_forque) {
      return {b, Lagrangian::forque(state.motors, b, t)};
    } else {
      return {b, {}};
    }
  }

  /// dH/dt, W.
  [[nodiscard]] static constexpr S power(const State& state, const S& t) noexcept
    requires requires(const Rates& b) { Lagrangian::power(state.motors, b, t); }
  {
    return Lagrangian::power(state.motors, rates(state, t), t);
  }

 private:
  [[nodiscard]] static constexpr Rates separate(const std::array<S, size>& joint) noexcept {
    Rates result{};
    for (std::size_t k = 0; k < bodies; ++k) {
      std::array<S, dimension> components{};
      for (std::size_t i = 0; i < dimension; ++i) components[i] = joint[k * dimension + i];
      result[k] = Rate::from(components);
    }
    return result;
  }
};

}  // namespace hamotor
