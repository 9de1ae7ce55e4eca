// Explicit Runge–Kutta methods by embedded pairs and on the group: for dissipative and non-smooth
// forques, and wherever an error estimate is worth more than a structure.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <type_traits>

#include "hamotor/compensated.hpp"
#include "hamotor/packed_series.hpp"
#include "hamotor/runge_kutta_pairs.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"

namespace hamotor {

namespace detail {

/// B_k/k! of even k (Bernoulli), by k/2 − 1.
inline constexpr std::array<Ratio, 4> bernoulli{{{1, 12}, {-1, 720}, {1, 30240}, {-1, 1209600}}};

/// Ẋ = Σ (−1)^k B_k/k! ad_X^k B of M = M₀ exp X, Ṁ = M B, to the order of a method: of X = O(h) the
/// part along B does not count, so that ad_X^k B = O(h^(k+1)).
template <int order, class Rate>
[[nodiscard]] constexpr Rate dexp_inverse_series(const Rate& x, const Rate& b) noexcept {
  using S = typename Rate::Scalar;
  Rate power = ad(x, b);
  Rate sum = mul_add(S(0.5), power, b);
  for (std::size_t k = 0; 2 * static_cast<int>(k) + 3 <= order; ++k) {
    if (k > 0) power = ad(x, power);
    power = ad(x, power);
    sum = mul_add(number<S>(bernoulli[k]), power, sum);
  }
  return sum;
}

/// H at a state and what its steppers need of it: Ẋ, μ̇ and dH/dt.
template <class System>
struct Slope {
  std::array<typename System::Group::template Rate<typename System::Scalar>, System::bodies> rates;
  std::array<typename System::Group::template Momentum<typename System::Scalar>, System::bodies>
      forces;
  typename System::Scalar power{};
};

/// B, [μ, B] − F and dH/dt at a state and a time, where a slope that is called would have to return
/// through memory at every stage.
template <class System>
[[nodiscard]] HAMOTOR_INLINE constexpr Slope<System> slope_in_place(
    const System& system, const StateOf<System>& state, const typename System::Scalar& t) noexcept {
  const auto now = gradient(system, state, t);
  Slope<System> slope{now.rates, free_momentum_rates(system, state.momenta, now.rates), {}};
  if constexpr (System::has_forque) {
    for (std::size_t i = 0; i < System::bodies; ++i) {
      slope.forces[i] = slope.forces[i] - now.forques[i];
    }
  }
  if constexpr (PoweredSystem<System>) slope.power = system.power(state, t);
  return slope;
}

/// The same.
template <class System>
[[nodiscard]] constexpr Slope<System> slope_of(const System& system, const StateOf<System>& state,
                                               const typename System::Scalar& t) noexcept {
  return slope_in_place(system, state, t);
}

/// Σ c_r x_r over r < count; terms without weight are left out.
template <class S, std::size_t n, std::size_t most>
[[nodiscard]] constexpr std::array<S, n> weighted_sum(const S* c,
                                                      const std::array<std::array<S, n>, most>& x,
                                                      std::size_t count) noexcept {
  std::array<S, n> sum{};
  for (std::size_t r = 0; r < count; ++r) {
    if (c[r] == S(0)) continue;
    for (std::size_t i = 0; i < n; ++i) sum[i] = mul_add(c[r], x[r][i], sum[i]);
  }
  return sum;
}

/// A motor within a step as M₀ exp X, by X.
struct ExponentialChart {
  template <class G, class S>
  using Change = typename G::template Rate<S>;
  template <class Pair>
  static constexpr std::string_view name = Pair::name;

  template <class Motor, class Rate>
  [[nodiscard]] static constexpr Motor moved(const Motor& start, const Rate& x) noexcept {
    return gp(start, exp(x));
  }

  /// Ẋ of Ṁ = M B, to the order of a method.
  template <int order, class Motor, class Rate>
  [[nodiscard]] static constexpr Rate slope(const Motor& /*there*/, const Rate& x,
                                            const Rate& b) noexcept {
    return dexp_inverse_series<order>(x, b);
  }

  /// An error of X as one of M.
  template <class Motor, class Rate>
  [[nodiscard]] static constexpr Motor error(const Motor& m, const Rate& x) noexcept {
    return kinematics(m, x);
  }
};

/// A motor within a step by its components, which a step's end puts back on the group.
struct Components {
  template <class G, class S>
  using Change = typename G::template Element<S>;
  template <class Pair>
  static constexpr std::string_view name = Pair::name_on_components;

  template <class Motor>
  [[nodiscard]] static constexpr Motor moved(const Motor& start, const Motor& by) noexcept {
    return start + by;
  }

  template <int /*order*/, class Motor, class Rate>
  [[nodiscard]] static constexpr Motor slope(const Motor& there, const Motor& /*by*/,
                                             const Rate& b) noexcept {
    return kinematics(there, b);
  }

  template <class Motor>
  [[nodiscard]] static constexpr Motor error(const Motor& /*m*/, const Motor& by) noexcept {
    return by;
  }
};

}  // namespace detail

/// An explicit Runge–Kutta method by an embedded pair, for motors in some coordinates of a step and
/// for μ, and the error of the lower order.  Not symplectic.
template <HamiltonianSystem System, class Pair, class Coordinates,
          Summation summation = Summation::compensated>
class ExplicitPair : public detail::ExplicitMethod<System, summation> {
  using Base = detail::ExplicitMethod<System, summation>;
  using Base::n;
  using typename Base::G;
  using typename Base::Momenta;
  using typename Base::S;
  using Change = typename Coordinates::template Change<G, S>;
  static constexpr std::size_t stages = Pair::stages;
  static constexpr std::size_t all_stages = Pair::dense_stages;

 public:
  static constexpr int order = Pair::order;
  static constexpr int lower_order = Pair::lower_order;
  static constexpr std::string_view name = Coordinates::template name<Pair>;
  /// The local error of `between` is of this order in the step, and one more.
  static constexpr int dense_order = Pair::dense_order;

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    this->take_up(state);
    h_ = h;
    known_ = 0;
    find_slopes(system, state, t, stages);
    const Sum sum = combined(table.weights);
    if constexpr (std::same_as<Coordinates, detail::Components>) {
      this->shift(state, S(1), sum.motors, sum.forces, sum.power);
    } else {
      this->turn(state, S(1), sum.forces, sum.power, sum.motors);
    }
    this->leave(state);
    error_ = error_of(state, combined(table.error));
  }

  /// The state at the fraction `at` of the last step, which began at `start` and t; of order
  /// `dense_order`.  What that takes beyond the step's own evaluations is evaluated once.
  [[nodiscard]] constexpr StateOf<System> between(const System& system,
                                                  const StateOf<System>& start, const S& t,
                                                  const S& at) noexcept {
    find_slopes(system, start, t, all_stages);
    return moved(start, combined(continuous_weights<Pair>(at)));
  }

  /// ∫ dH/dt dt from the fraction `at` of the last step to its end, J; as `between`.
  [[nodiscard]] constexpr S work_after(const System& system, const StateOf<System>& start,
                                       const S& t, const S& at) noexcept {
    find_slopes(system, start, t, all_stages);
    return combined(table.weights).power - combined(continuous_weights<Pair>(at)).power;
  }

  /// The estimated error of the last step, by the embedded method: the largest of a motor's
  /// component, and of a momentum's relative to the largest component of it.
  [[nodiscard]] constexpr const S& error() const noexcept { return error_; }

 private:
  /// What a step changes, or how fast: motors in their coordinates, momenta and work.
  struct Sum {
    std::array<Change, n> motors;
    Momenta forces;
    S power{};
  };

  /// The numbers of a sum one after the other, for whole packs where there are any.
  static constexpr std::size_t numbers =
      n * (std::tuple_size_v<decltype(Change{}.components())> +
           std::tuple_size_v<decltype(Momenta{}[0].components())>)+(PoweredSystem<System> ? 1 : 0);
  using Row = std::array<S, detail::has_packs<S> ? (numbers + 7) / 8 * 8 : numbers>;

  static constexpr void put(Row& row, const Sum& sum) noexcept {
    std::size_t at = 0;
    const auto put_all = [&](const auto& parts) {
      for (const auto& part : parts) {
        for (const S& x : part.components()) row[at++] = x;
      }
    };
    put_all(sum.motors);
    put_all(sum.forces);
    if constexpr (PoweredSystem<System>) row[at] = sum.power;
  }

  [[nodiscard]] static constexpr Sum taken(const Row& row) noexcept {
    Sum sum{};
    std::size_t at = 0;
    const auto take_all = [&](auto& parts) {
      for (auto& part : parts) {
        auto x = part.components();
        for (S& component : x) component = row[at++];
        part = std::remove_reference_t<decltype(part)>::from(x);
      }
    };
    take_all(sum.motors);
    take_all(sum.forces);
    if constexpr (PoweredSystem<System>) sum.power = row[at];
    return sum;
  }

  static constexpr const detail::PairTable<Pair, S>& table = detail::pair_table<Pair, S>;

  /// Finds the slopes of a step from `start` at t that are not known yet, up to so many stages.
  constexpr void find_slopes(const System& system, const StateOf<System>& start, const S& t,
                             std::size_t count) noexcept {
    for (std::size_t s = known_; s < count; ++s) {
      const Sum by = combined(table.rows[s].data(), s);
      StateOf<System> there = start;
      for (std::size_t i = 0; i < n; ++i) {
        there.momenta[i] = start.momenta[i] + by.forces[i];
        there.motors[i] = Coordinates::moved(start.motors[i], by.motors[i]);
      }
      const auto now = detail::slope_in_place(system, there, mul_add(table.nodes[s], h_, t));
      Sum slope{{}, now.forces, now.power};
      for (std::size_t i = 0; i < n; ++i) {
        slope.motors[i] =
            Coordinates::template slope<order>(there.motors[i], by.motors[i], now.rates[i]);
      }
      put(slopes_[s], slope);
    }
    if (known_ < count) known_ = count;
  }

  /// h Σ c_r slope_r over the first `count` stages.
  [[nodiscard]] constexpr Sum combined(const S* c, std::size_t count) const noexcept {
    Row sum = detail::weighted_sum(c, slopes_, count);
    for (S& x : sum) x = h_ * x;
    return taken(sum);
  }
  template <std::size_t size>
  [[nodiscard]] constexpr Sum combined(const std::array<S, size>& c) const noexcept {
    return combined(c.data(), size);
  }

  [[nodiscard]] static constexpr StateOf<System> moved(const StateOf<System>& start,
                                                       const Sum& by) noexcept {
    StateOf<System> there = start;
    for (std::size_t i = 0; i < n; ++i) {
      auto& motor = there.motors[i];
      motor = Coordinates::moved(motor, by.motors[i]);
      motor = motor + unit_correction(motor, unit_defect(motor));
      there.momenta[i] = there.momenta[i] + by.forces[i];
    }
    return there;
  }

  [[nodiscard]] static constexpr S error_of(const StateOf<System>& state, const Sum& by) noexcept {
    S worst(0);
    for (std::size_t i = 0; i < n; ++i) {
      const S off = detail::largest(Coordinates::error(state.motors[i], by.motors[i]));
      const S momentum = detail::largest(state.momenta[i]);
      const S push = detail::largest(by.forces[i]);
      worst = scalar::max_abs(worst, off, select(momentum > push, push / momentum, push));
    }
    return worst;
  }

  alignas(64) std::array<Row, all_stages> slopes_{};
  std::size_t known_ = 0;  ///< how many of them
  S h_{};
  S error_ = S(0);
};

/// Runge–Kutta–Munthe-Kaas: the pair for X in M = M₀ exp X and for μ (Munthe-Kaas 1999).
template <HamiltonianSystem System, class Pair, Summation summation = Summation::compensated>
using Rkmk = ExplicitPair<System, Pair, detail::ExponentialChart, summation>;
/// The pair for the components of M and μ, put back on the group after every step: rates and
/// forques of a stage are those of a motor that is not quite unit, as in `Rk4`.
template <HamiltonianSystem System, class Pair, Summation summation = Summation::compensated>
using Rk = ExplicitPair<System, Pair, detail::Components, summation>;

/// Order 5 with an error of order 4: seven evaluations a step, within which it is of order 4.
template <HamiltonianSystem System>
using Rkmk54 = Rkmk<System, DormandPrince54>;
/// Order 8 with an error of order 7: thirteen evaluations a step, within which it is of order 7 by
/// five more.
template <HamiltonianSystem System>
using Rkmk87 = Rkmk<System, PrinceDormand87>;
/// As `Rkmk54`, without exponentials and brackets.
template <HamiltonianSystem System>
using Rk54 = Rk<System, DormandPrince54>;
/// As `Rkmk87`, without exponentials and brackets.
template <HamiltonianSystem System>
using Rk87 = Rk<System, PrinceDormand87>;

/// Commutator-free method of order 4: products of exponentials in place of brackets, two for the
/// last half of a step (Celledoni, Marthinsen & Owren 2003).  Four evaluations a step; not
/// symplectic.
template <HamiltonianSystem System, Summation summation = Summation::plain>
class CommutatorFree4 : public detail::ExplicitMethod<System, summation> {
  using Base = detail::ExplicitMethod<System, summation>;
  using Base::mean;
  using Base::n;
  using typename Base::Momenta;
  using typename Base::Rate;
  using typename Base::Rates;
  using typename Base::S;
  using Slope = detail::Slope<System>;

 public:
  static constexpr int order = 4;
  static constexpr std::string_view name = "cf4";

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    this->take_up(state);
    const S half = S(0.5) * h;
    const Slope one = detail::slope_of(system, state, t);
    StateOf<System> there = moved(state, half, one);
    const auto middle = there.motors;
    const Slope two = detail::slope_of(system, there, t + half);
    const Slope three = detail::slope_of(system, moved(state, half, two), t + half);
    for (std::size_t i = 0; i < n; ++i) {
      there.motors[i] = gp(middle[i], exp(h * three.rates[i] - half * one.rates[i]));
      there.momenta[i] = mul_add(h, three.forces[i], state.momenta[i]);
    }
    const Slope four = detail::slope_of(system, there, t + h);

    Rates first{};
    Rates second{};
    Momenta forces{};
    for (std::size_t i = 0; i < n; ++i) {
      const Rate inner = S(2) * (two.rates[i] + three.rates[i]);
      first[i] = (h / S(12)) * (mul_add(S(3), one.rates[i], inner) - four.rates[i]);
      second[i] = (h / S(12)) * (mul_add(S(3), four.rates[i], inner) - one.rates[i]);
      forces[i] = mean(one.forces[i], two.forces[i], three.forces[i], four.forces[i]);
    }
    this->turn(state, h / S(6), forces, mean(one.power, two.power, three.power, four.power), first,
               second);
    this->leave(state);
  }

 private:
  [[nodiscard]] static constexpr StateOf<System> moved(const StateOf<System>& state, const S& h,
                                                       const Slope& along) noexcept {
    StateOf<System> there{};
    for (std::size_t i = 0; i < n; ++i) {
      there.motors[i] = gp(state.motors[i], exp(h * along.rates[i]));
      there.momenta[i] = mul_add(h, along.forces[i], state.momenta[i]);
    }
    return there;
  }
};

}  // namespace hamotor
