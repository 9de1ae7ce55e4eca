// One-step methods on G × g*, generic over groups and systems.
//
// A step allocates nothing and throws nothing.  A stepper is a value: copy it with its state to
// branch a run, make a new one for another system.  Every step ends with a projection back to the
// group, and what it had to correct is kept, so that it cannot hide an error.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <type_traits>

#include "hamotor/compensated.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/space.hpp"
#include "hamotor/splitting_schemes.hpp"
#include "hamotor/state.hpp"

namespace hamotor {

namespace detail {

/// The series of dexp⁻¹ for M = M₀ exp X, Ṁ = M B: Ẋ = B + ½ [X, B] + 1/12 [X, [X, B]] − …, whose
/// next term is of fourth order in X.
template <class Rate, class S>
[[nodiscard]] constexpr Rate dexp_inverse(const Rate& x, const Rate& b, const S& half) noexcept {
  const Rate once = ad(x, b);
  return mul_add(half, once, mul_add(S(1) / S(12), ad(x, once), b));
}

/// The products of components, and what they add to others.
template <class T>
[[nodiscard]] HAMOTOR_INLINE constexpr T each_times(const T& a, const T& b) noexcept {
  auto x = a.components();
  const auto y = b.components();
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = x[k] * y[k];
  return T::from(x);
}
template <class T, class A, class B>
[[nodiscard]] HAMOTOR_INLINE constexpr T each_mul_add(const A& a, const B& b, const T& c) noexcept {
  const auto x = a.components();
  const auto y = b.components();
  auto z = c.components();
  for (std::size_t k = 0; k < z.size(); ++k) z[k] = mul_add(x[k], y[k], z[k]);
  return T::from(z);
}

/// Whether spins commute with everything else in a system and are left to the end of a step.
template <class System>
inline constexpr bool has_spin_apart = false;
template <class System>
  requires requires { System::spin_apart; }
inline constexpr bool has_spin_apart<System> = System::spin_apart;

/// Whether a system takes whole steps of a splitting by itself.
template <class System>
inline constexpr bool takes_split_steps = false;
template <class System>
  requires requires { System::takes_split_steps; }
inline constexpr bool takes_split_steps<System> = System::takes_split_steps;

/// Whether all of a system's motion is turns about two axes, and what commutes with them.
template <class System>
inline constexpr bool has_two_turns = false;
template <class System>
  requires requires { System::has_two_turns; }
inline constexpr bool has_two_turns<System> = System::has_two_turns;

/// The scheme of a splitting; a free motion that is exact needs none where nothing acts.
///
/// Where nothing acts and for kicks between exact motions there are two exact flows in turn, and
/// schemes for just that; between motions that are themselves of order 2, only compositions.
template <class System, int order>
[[nodiscard]] constexpr auto scheme_of() noexcept {
  static_assert(order == 2 || order == 4 || order == 6 || order == 8 || order == 10);
  constexpr bool free = !System::has_forque && takes_split_steps<System>;
  constexpr bool exact = freely_exact<System>;
  if constexpr (order == 2 || (exact && !System::has_forque)) {
    return Composition<Strang>{};
  } else if constexpr (order == 4) {
    if constexpr (free) {
      return std::conditional_t<System::nearly_symmetric, Blanes864, BlanesMoanFree4>{};
    } else {
      return std::conditional_t<exact, BlanesMoan4, Composition<Suzuki4>>{};
    }
  } else if constexpr (order == 6) {
    if constexpr (free) {
      return BlanesMoanFree6{};
    } else {
      return std::conditional_t<exact, BlanesMoan6, Composition<KahanLi6>>{};
    }
  } else if constexpr (order == 8) {
    return Composition<KahanLi8>{};
  } else {
    return Composition<SofroniouSpaletta10>{};
  }
}

template <class System, int order>
using SchemeOf = decltype(scheme_of<System, order>());

[[nodiscard]] constexpr std::string_view splitting_name(int order) noexcept {
  constexpr std::array<std::string_view, 5> names{"splitting2", "splitting4", "splitting6",
                                                  "splitting8", "splitting10"};
  return names[static_cast<std::size_t>(order / 2 - 1)];
}

/// A scheme's coefficients, rounded to S once.
template <class S, class Scheme>
[[nodiscard]] constexpr SplittingWeights<S, Scheme::stages> rounded_weights() noexcept {
  const auto exact = Scheme::template weights<CoefficientScalar<S>>();
  SplittingWeights<S, Scheme::stages> weights{};
  for (std::size_t k = 0; k < Scheme::stages; ++k) {
    weights.drifts[k] = static_cast<S>(exact.drifts[k]);
  }
  for (std::size_t k = 0; k <= Scheme::stages; ++k) {
    weights.kicks[k] = static_cast<S>(exact.kicks[k]);
  }
  return weights;
}

/// What explicit methods share: how a step's end moves the state, and what is kept of it.
template <HamiltonianSystem System, Summation summation>
class ExplicitMethod {
 protected:
  using S = typename System::Scalar;
  using G = typename System::Group;
  using Motor = typename G::template Element<S>;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  static constexpr std::size_t n = System::bodies;
  using Motors = std::array<Motor, n>;
  using Rates = std::array<Rate, n>;
  using Momenta = std::array<Momentum, n>;

 public:
  /// Whether sums over steps are compensated.
  static constexpr bool compensated = summation == Summation::compensated;

  /// What is carried from step to step.
  struct Account {
    [[no_unique_address]] LowDigits<System, summation> low;
    Drift<S> drift;
    S work{};
  };

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return account_.drift; }

  /// ∫ dH/dt dt over the steps so far, J, by the method's own quadrature.
  [[nodiscard]] constexpr const S& work() const noexcept
    requires PoweredSystem<System>
  {
    return account_.work;
  }

  /// Of the steps so far.
  [[nodiscard]] constexpr const Account& account() const noexcept { return account_; }

  /// The steps since this account are as if they had not been.
  constexpr void go_back(const Account& account) noexcept { account_ = account; }

  /// The next step is from another state: what sums lost of the last one is nothing to it.
  constexpr void forget() noexcept { account_.low = {}; }

 protected:
  /// Multiplies motors by exp X, for each X in turn, and adds `by` times what pushes the momenta
  /// and works.
  template <std::same_as<Rates>... X>
  constexpr void turn(StateOf<System>& state, const S& by, const Momenta& forces, const S& power,
                      const X&... x) noexcept {
    move(
        state, by, forces, power,
        [&](auto i) {  // not compiled where it is not called: packs have no such series
          Motor change{};
          ((change = change + motor_change(state.motors[i] + change, x[i])), ...);
          return change;
        },
        [&](std::size_t i, Motor& motor) {
          ((motor = gp(motor, exp(x[i]))), ...);
          const auto defect = unit_defect(motor);
          motor = motor + unit_correction(motor, defect);
          return size(defect);
        });
  }

  /// The same where motors gain `by` times `motors`.
  constexpr void shift(StateOf<System>& state, const S& by, const Motors& motors,
                       const Momenta& forces, const S& power) noexcept {
    move(
        state, by, forces, power, [&](std::size_t i) { return by * motors[i]; },
        [&](std::size_t i, Motor& motor) {
          motor = mul_add(by, motors[i], motor);
          return put_back<G>(motor);
        });
  }

  /// The same where each component of a momentum has a factor of its own.
  constexpr void shift(StateOf<System>& state, const S& by, const Motors& motors,
                       const Momenta& factors, const Momenta& forces) noexcept {
    move(
        state, factors, forces, S(0), [&](std::size_t i) { return by * motors[i]; },
        [&](std::size_t i, Motor& motor) {
          motor = mul_add(by, motors[i], motor);
          return put_back<G>(motor);
        });
  }

  /// Six times the mean of a step of the classical method.
  template <class T>
  [[nodiscard]] static constexpr T mean(const T& one, const T& two, const T& three,
                                        const T& four) noexcept {
    return mul_add(S(2), two + three, one + four);
  }

 private:
  /// Motors gain `change(i)`, or, in plain sums, become what `moved(i, motor)` makes of them, which
  /// returns how far off the group they were; momenta gain `by`, or by[i] component by component,
  /// times what pushes them.
  template <class By, class Change, class Moved>
  constexpr void move(StateOf<System>& state, const By& by, const Momenta& forces,
                      [[maybe_unused]] const S& power, const Change& change,
                      const Moved& moved) noexcept {
    if constexpr (compensated) {
      ChangeOf<System> changes{};
      for (std::size_t i = 0; i < n; ++i) {
        changes.motors[i] = change(i);
        if constexpr (std::is_same_v<By, Momenta>) {
          changes.momenta[i] = each_times(by[i], forces[i]);
        } else {
          changes.momenta[i] = by * forces[i];
        }
      }
      record(account_.drift, account_.low.add(state, changes));
    } else {
      std::array<S, n> defects{};
      for (std::size_t i = 0; i < n; ++i) {
        defects[i] = moved(i, state.motors[i]);
        if constexpr (std::is_same_v<By, Momenta>) {
          state.momenta[i] = each_mul_add(by[i], forces[i], state.momenta[i]);
        } else {
          state.momenta[i] = mul_add(by, forces[i], state.momenta[i]);
        }
      }
      record(account_.drift, defects);
    }
    if constexpr (PoweredSystem<System>) account_.work = mul_add(by, power, account_.work);
  }

  Account account_;
};

}  // namespace detail

/// Runge–Kutta–Munthe-Kaas method of order 4: the classical Runge–Kutta method for X in
/// M = M₀ exp X and for μ (Munthe-Kaas 1998; Iserles, Munthe-Kaas, Nørsett & Zanna 2000).
/// Four evaluations of rate and forque a step; not symplectic.
template <HamiltonianSystem System, Summation summation = Summation::plain>
class Rkmk4 : public detail::ExplicitMethod<System, summation> {
  using Base = detail::ExplicitMethod<System, summation>;
  using Base::mean;
  using Base::n;
  using typename Base::Momenta;
  using typename Base::Rates;
  using typename Base::S;

 public:
  static constexpr int order = 4;
  static constexpr std::string_view name = "rkmk4";

  /// Takes `state` from t to t + h.  Flat: a slope that is called returns through memory.
  [[gnu::flatten]] constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                                          const S& h) noexcept {
    const S half_step = S(0.5) * h;
    const Slope one = slope(system, state, t, Rates{});
    const Slope two = slope_at(system, state, t, half_step, one);
    const Slope three = slope_at(system, state, t, half_step, two);
    const Slope four = slope_at(system, state, t, h, three);

    Rates x{};
    Momenta force{};
    for (std::size_t i = 0; i < n; ++i) {
      x[i] = (h / S(6)) * mean(one.rate[i], two.rate[i], three.rate[i], four.rate[i]);
      force[i] = mean(one.force[i], two.force[i], three.force[i], four.force[i]);
    }
    this->turn(state, h / S(6), force, mean(one.power, two.power, three.power, four.power), x);
  }

 private:
  /// Ẋ, μ̇ and dH/dt.
  struct Slope {
    Rates rate;
    Momenta force;
    S power{};
  };

  /// At the state, in the coordinate X.
  [[nodiscard]] static constexpr Slope slope(const System& system, const StateOf<System>& state,
                                             const S& t, const Rates& x) noexcept {
    const auto now = gradient(system, state, t);
    Slope result{};
    result.force = free_momentum_rates(system, state.momenta, now.rates);
    for (std::size_t i = 0; i < n; ++i) {
      result.rate[i] = detail::dexp_inverse(x[i], now.rates[i], S(0.5));
      if constexpr (System::has_forque) result.force[i] = result.force[i] - now.forques[i];
    }
    if constexpr (PoweredSystem<System>) result.power = system.power(state, t);
    return result;
  }

  /// At the time h after `state` at t if `before` were the slope in between.
  [[nodiscard]] static constexpr Slope slope_at(const System& system, const StateOf<System>& state,
                                                const S& t, const S& h,
                                                const Slope& before) noexcept {
    StateOf<System> there = state;
    Rates x{};
    for (std::size_t i = 0; i < n; ++i) {
      x[i] = h * before.rate[i];
      there.momenta[i] = mul_add(h, before.force[i], state.momenta[i]);
      if constexpr (System::has_forque) there.motors[i] = gp(state.motors[i], exp(x[i]));
    }
    return slope(system, there, t + h, x);
  }
};

namespace detail {

/// What `Rk4` takes through its stages: M and μ, of any system.
template <HamiltonianSystem System>
class MomentumStages {
  using S = typename System::Scalar;
  static constexpr std::size_t n = System::bodies;

 public:
  using Place = StateOf<System>;
  /// Ṁ, μ̇ and dH/dt.
  struct Slope {
    decltype(Place::motors) motors;
    decltype(Place::momenta) momenta;
    S power{};
  };

  constexpr MomentumStages(const System& system, const S& t, const S& h) noexcept
      : system_(system), time_(t), half_step_(S(0.5) * h) {}

  [[nodiscard]] HAMOTOR_INLINE constexpr Place start(const StateOf<System>& state) const noexcept {
    return state;
  }

  /// After so many half steps.
  [[nodiscard]] HAMOTOR_INLINE constexpr Slope slope(const Place& there,
                                                     int halves) const noexcept {
    const S t = mul_add(S(halves), half_step_, time_);
    const auto now = gradient(system_, there, t);
    Slope result{};
    result.momenta = free_momentum_rates(system_, there.momenta, now.rates);
    for (std::size_t i = 0; i < n; ++i) {
      result.motors[i] = kinematics(there.motors[i], now.rates[i]);
      if constexpr (System::has_forque) result.momenta[i] = result.momenta[i] - now.forques[i];
    }
    if constexpr (PoweredSystem<System>) result.power = system_.power(there, t);
    return result;
  }

  HAMOTOR_INLINE constexpr void add_last(Slope& sum, const Place& there,
                                         int halves) const noexcept {
    const Slope last = slope(there, halves);
    for (std::size_t i = 0; i < n; ++i) {
      sum.motors[i] = sum.motors[i] + last.motors[i];
      sum.momenta[i] = sum.momenta[i] + last.momenta[i];
    }
    if constexpr (PoweredSystem<System>) sum.power = sum.power + last.power;
  }

  [[nodiscard]] HAMOTOR_INLINE constexpr Place moved(const Place& from, int halves,
                                                     const Slope& along) const noexcept {
    const S by = S(halves) * half_step_;
    Place there{};
    for (std::size_t i = 0; i < n; ++i) {
      there.motors[i] = mul_add(by, along.motors[i], from.motors[i]);
      there.momenta[i] = mul_add(by, along.momenta[i], from.momenta[i]);
    }
    return there;
  }

 private:
  const System& system_;
  S time_;
  S half_step_;
};

/// The same with rates B = ∂H/∂μ in place of momenta, which are constant multiples of them, and
/// h/4 as unit of time: nothing is then multiplied by J or h at every stage.
template <RateSystem System>
class RateStages {
  using S = typename System::Scalar;
  using Space = hamotor::Space<typename System::Group>;
  static constexpr std::size_t n = System::bodies;

 public:
  struct Place {
    typename System::Motors motors;
    typename System::Rates rates;  ///< h B/4
  };
  /// h Ṁ/2, and μ̇ in units of the system's.
  struct Slope {
    typename System::Motors motors;
    typename System::Momenta momenta;
  };

  constexpr RateStages(const System& system, const S& /*t*/, const S& h) noexcept
      : system_(system), unit_(S(0.25) * h) {}

  [[nodiscard]] HAMOTOR_INLINE constexpr Place start(const StateOf<System>& state) const noexcept {
    return {state.motors, system_.rates_in(unit_, state.momenta)};
  }

  [[nodiscard]] HAMOTOR_INLINE constexpr Slope slope(const Place& there,
                                                     int /*halves*/) const noexcept {
    Slope result{};
    const auto nothing = [](std::size_t) { return Nothing{}; };
    result.momenta = system_.slopes_in(nothing, unit_, there.motors, there.rates);
    for (std::size_t i = 0; i < n; ++i) {
      result.motors[i] = Space::with_twice_velocity(Nothing{}, there.motors[i], there.rates[i]);
    }
    return result;
  }

  /// The last slope's terms are added to the sum one by one.
  HAMOTOR_INLINE constexpr void add_last(Slope& sum, const Place& there,
                                         int /*halves*/) const noexcept {
    const auto start = [&](std::size_t i) { return sum.momenta[i].components(); };
    sum.momenta = system_.slopes_in(start, unit_, there.motors, there.rates);
    for (std::size_t i = 0; i < n; ++i) {
      sum.motors[i] =
          Space::with_twice_velocity(sum.motors[i].components(), there.motors[i], there.rates[i]);
    }
  }

  [[nodiscard]] HAMOTOR_INLINE constexpr Place moved(const Place& from, int halves,
                                                     const Slope& along) const noexcept {
    const auto weights = system_.rate_weights();
    Place there{};
    for (std::size_t i = 0; i < n; ++i) {
      there.motors[i] = halves == 1 ? from.motors[i] + along.motors[i]
                                    : mul_add(S(halves), along.motors[i], from.motors[i]);
      there.rates[i] = each_mul_add(S(2 * halves) * weights[i], along.momenta[i], from.rates[i]);
    }
    return there;
  }

  /// What slopes are to be multiplied by for h μ̇/6.
  [[nodiscard]] HAMOTOR_INLINE constexpr typename System::Momenta sixth() const noexcept {
    const S whole = S(1.5) * unit_;
    return system_.momentum_weights(select(whole == S(0), S(0), S(1) / whole));
  }

 private:
  const System& system_;
  S unit_;
};

}  // namespace detail

/// The classical Runge–Kutta method of order 4 on the components of M and μ, put back on the group
/// after every step.
///
/// No exponentials: about half the time of `Rkmk4`, whose error is smaller where bodies turn fast.
/// Four evaluations of rate and forque a step; not symplectic.
template <HamiltonianSystem System, Summation summation = Summation::plain>
class Rk4 : public detail::ExplicitMethod<System, summation> {
  using Base = detail::ExplicitMethod<System, summation>;
  using Base::n;
  using typename Base::S;
  static constexpr auto stages_of() noexcept {
    if constexpr (RateSystem<System>) {
      return std::type_identity<detail::RateStages<System>>{};
    } else {
      return std::type_identity<detail::MomentumStages<System>>{};
    }
  }
  using Stages = typename decltype(stages_of())::type;

 public:
  static constexpr int order = 4;
  static constexpr std::string_view name = "rk4";

  /// A step under way: what its stages need of each other.
  class Step {
   public:
    static constexpr std::size_t stages = 4;

    constexpr Step(const System& system, const StateOf<System>& state, const S& t,
                   const S& h) noexcept
        : stages_(system, t, h), start_(stages_.start(state)), here_(start_) {}

    /// The next stage.
    template <std::size_t number>
    HAMOTOR_INLINE constexpr void take() noexcept {
      if constexpr (number == 3) {
        stages_.add_last(sum_, here_, 2);
      } else {
        const auto slope = stages_.slope(here_, number == 0 ? 0 : 1);
        if constexpr (number == 0) {
          sum_ = slope;
        } else {
          add_twice(slope);
        }
        here_ = stages_.moved(start_, number == 2 ? 2 : 1, slope);
      }
    }

   private:
    friend Rk4;

    HAMOTOR_INLINE constexpr void add_twice(const typename Stages::Slope& slope) noexcept {
      for (std::size_t i = 0; i < n; ++i) {
        sum_.motors[i] = mul_add(S(2), slope.motors[i], sum_.motors[i]);
        sum_.momenta[i] = mul_add(S(2), slope.momenta[i], sum_.momenta[i]);
      }
      if constexpr (PoweredSystem<System>) sum_.power = mul_add(S(2), slope.power, sum_.power);
    }

    Stages stages_;
    typename Stages::Place start_;
    typename Stages::Place here_;
    typename Stages::Slope sum_{};
  };

  /// Takes `state` from t to t + h.  Flat: a slope that is called returns through memory.
  [[gnu::flatten]] constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                                          const S& h) noexcept {
    Step step(system, state, t, h);
    step.template take<0>();
    step.template take<1>();
    step.template take<2>();
    step.template take<3>();
    finish(step, state, h);
  }

  /// Moves `state`, which `step` began with, to its end.
  HAMOTOR_INLINE constexpr void finish(const Step& step, StateOf<System>& state,
                                       const S& h) noexcept {
    const auto& sum = step.sum_;
    if constexpr (RateSystem<System>) {
      this->shift(state, S(1) / S(3), sum.motors, step.stages_.sixth(), sum.momenta);
    } else {
      this->shift(state, h / S(6), sum.motors, sum.momenta, sum.power);
    }
  }
};

/// Symmetric, symplectic splitting of order 2, 4, 6, 8 or 10: kicks and free motions in turn, where
/// a free motion is exact or itself a symmetric composition of exact flows.
///
/// Order 2 is Strang's.  Where the free motion is exact, orders 4 and 6 are Runge–Kutta–Nyström
/// splittings; everything else is a composition of Strang's map.  Every part is a coadjoint motion
/// or a kick: Casimirs of free bodies and the spatial momentum are constant but for rounding,
/// whatever the step, and the energy error is bounded.  With compensated sums a rounding error is
/// relative to the change in a part of a step instead of to the state.  A forque at the end of a
/// step is kept for the start of the next.
template <SplitSystem System, int nominal_order, Summation summation = Summation::compensated>
class Splitting {
  using S = typename System::Scalar;
  using G = typename System::Group;
  using Motors = decltype(StateOf<System>::motors);
  using Momenta = decltype(StateOf<System>::momenta);
  using Scheme = detail::SchemeOf<System, nominal_order>;
  static constexpr std::size_t n = System::bodies;

 public:
  static constexpr int order = nominal_order;
  static constexpr std::string_view name = detail::splitting_name(nominal_order);
  /// Whether sums over steps are compensated.
  static constexpr bool compensated = summation == Summation::compensated;
  /// Free motions in a step.
  static constexpr std::size_t stages = Scheme::stages;
  /// Whether steps can be left open: the turn that ends one and the turn that begins the next are
  /// made as one, and what commutes with all turns once, when the state is asked for.
  static constexpr bool stays_open = summation == Summation::plain && detail::has_two_turns<System>;
  /// Turns in an open step.
  static constexpr std::size_t turns = 2 * stages;

  /// Takes `state` from t to t + h.
  [[gnu::flatten]] constexpr void do_step(const System& system, StateOf<System>& state,
                                          const S& /*t*/, const S& h) noexcept {
    if constexpr (takes_whole_steps) {
      if constexpr (System::has_forque) note_evaluations<S>(static_cast<int>(stages));
      add(state, system.split_step(state.motors, state.momenta, h, weights));
    } else {
      StateOf<System> there = state;
      ChangeOf<System> change{};
      const auto moves = [&](const ChangeOf<System>& by) {
        for (std::size_t i = 0; i < n; ++i) {
          change.motors[i] = change.motors[i] + by.motors[i];
          change.momenta[i] = change.momenta[i] + by.momenta[i];
          there.motors[i] = state.motors[i] + change.motors[i];
          there.momenta[i] = state.momenta[i] + change.momenta[i];
        }
      };
      [[maybe_unused]] const auto kick = [&](const S& weight) {
        if constexpr (System::has_forque) {
          for (std::size_t i = 0; i < n; ++i) {
            change.momenta[i] = mul_add(-weight * h, known_.forque[i], change.momenta[i]);
            there.momenta[i] = state.momenta[i] + change.momenta[i];
          }
        }
      };
      [[maybe_unused]] const auto find_forque = [&](const auto& motors) {
        if constexpr (System::has_forque) {
          note_evaluations<S>(1);
          known_.forque = system.forque(motors);
        }
      };
      if constexpr (opens_with_kick) {
        if (!is_known_at(state.motors)) find_forque(state.motors);
        kick(weights.kicks[0]);
      }
      for (std::size_t k = 0; k < stages; ++k) {
        const bool last = k + 1 == stages;
        moves(system.free_change(there.motors, there.momenta, weights.drifts[k] * h));
        if constexpr (detail::has_spin_apart<System>) {
          if (last) moves(system.spin_change(there.motors, there.momenta, h));
        }
        if constexpr (System::has_forque) {
          if (opens_with_kick || !last) {
            find_forque(there.motors);
            kick(weights.kicks[k + 1]);
          }
        }
      }
      add(state, change);
      if constexpr (System::has_forque) {
        known_.any = opens_with_kick;
        known_.at = state.motors;
      }
    }
  }

  /// From a state to one inside the first step, to be taken further by open steps of h.
  constexpr void open(const System& system, StateOf<System>& state, const S& h) const noexcept
    requires(stays_open)
  {
    system.template turn<true, false>(state.motors, state.momenta, weights.kicks[0] * h);
  }

  /// Whether all turns of steps of h are small, from this state on: |Π| is constant but for
  /// rounding, for which there is room.
  [[nodiscard]] static constexpr bool turns_stay_small(const System& system,
                                                       const StateOf<System>& state,
                                                       const S& h) noexcept
    requires(stays_open)
  {
    S largest = weights.kicks[stages] + weights.kicks[0];
    for (const S& weight : weights.drifts) largest = scalar::max_abs(largest, weight);
    for (const S& weight : weights.kicks) largest = scalar::max_abs(largest, weight);
    return system.turns_stay_small(state.momenta, largest * h);
  }

  /// Takes an open state through one of the `turns` of a step of h, which are taken in this order.
  /// They leave the group by rounding only, so that motors are put back every 16 steps.
  template <bool is_small>
  [[gnu::flatten]] HAMOTOR_INLINE constexpr void do_turn(const System& system,
                                                         StateOf<System>& state, const S& h,
                                                         std::size_t number) noexcept
    requires(stays_open)
  {
    const std::size_t stage = stages == 1 ? 0 : number / 2;  // a constant, where it is one
    if (number % 2 == 0) {
      system.template turn<false, is_small>(state.motors, state.momenta, weights.drifts[stage] * h);
      return;
    }
    const bool last = stage + 1 == stages;
    const S weight = last ? weights.kicks[stages] + weights.kicks[0] : weights.kicks[stage + 1];
    system.template turn<true, is_small>(state.motors, state.momenta, weight * h);
    if (!last) return;
    open_steps_ = (open_steps_ + 1) % 16;
    if (open_steps_ == 0) put_back(state);
  }

  /// The state after so many open steps of h.
  [[nodiscard]] constexpr StateOf<System> closed(const System& system, StateOf<System> state,
                                                 const S& h, const S& steps) const noexcept
    requires(stays_open)
  {
    system.template turn<true, false>(state.motors, state.momenta, -weights.kicks[0] * h);
    const auto change = system.commuting_change(state.motors, state.momenta, steps * h);
    for (std::size_t i = 0; i < n; ++i) {
      state.motors[i] = state.motors[i] + change.motors[i];
      state.momenta[i] = state.momenta[i] + change.momenta[i];
    }
    return state;
  }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return drift_; }

 private:
  struct Nothing {};
  struct KnownForque {
    bool any = false;
    Motors at{};
    Momenta forque{};
  };
  static constexpr bool takes_whole_steps = detail::takes_split_steps<System>;
  static inline const auto weights = detail::rounded_weights<S, Scheme>();
  static constexpr bool opens_with_kick =
      System::has_forque && detail::rounded_weights<double, Scheme>().kicks[0] > 0;

  /// Packs are not compared: an ensemble changes no state between steps.
  [[nodiscard]] constexpr bool is_known_at(const Motors& motors) const noexcept {
    if constexpr (requires {
                    { S(0) == S(0) } -> std::same_as<bool>;
                  }) {
      return known_.at == motors && known_.any;
    } else {
      return known_.any;
    }
  }

  /// Adds what a step changes, and puts the motors back on the group.
  ///
  /// What was lacking before the step is lacking after it, as (M q)(M q)~ = M M~.  Found before, it
  /// waits for none of the step's parts and none of the next step's for it.
  constexpr void add(StateOf<System>& state, const ChangeOf<System>& change) noexcept {
    std::array<S, n> defects{};
    for (std::size_t i = 0; i < n; ++i) {
      auto& motor = state.motors[i];
      auto& momentum = state.momenta[i];
      if constexpr (compensated) {
        auto defect = unit_defect(motor);
        auto& low = low_.motors[i];
        defect = defect + unit_defect_change(motor, low);
        const auto correction = unit_correction(motor + change.motors[i], defect);
        detail::add_compensated(motor, low, change.motors[i] + correction);
        detail::add_compensated(momentum, low_.momenta[i], change.momenta[i]);
        defects[i] = detail::size(defect);
      } else {
        const auto defect = detail::rounded_defect(motor);
        motor = motor + change.motors[i];
        motor = motor + unit_correction(motor, defect);
        momentum = momentum + change.momenta[i];
        defects[i] = detail::size(defect);
      }
    }
    detail::record(drift_, defects);
  }

  constexpr void put_back(StateOf<System>& state) noexcept {
    std::array<S, n> defects{};
    for (std::size_t i = 0; i < n; ++i) {
      defects[i] = detail::put_back<G>(state.motors[i]);
    }
    detail::record(drift_, defects);
  }

  [[no_unique_address]] std::conditional_t<System::has_forque, KnownForque, Nothing> known_;
  [[no_unique_address]] std::conditional_t<compensated, ChangeOf<System>, Nothing> low_{};
  Drift<S> drift_;
  unsigned open_steps_ = 0;
};

template <SplitSystem System, Summation summation = Summation::compensated>
using Splitting2 = Splitting<System, 2, summation>;
template <SplitSystem System, Summation summation = Summation::compensated>
using Splitting4 = Splitting<System, 4, summation>;
template <SplitSystem System, Summation summation = Summation::compensated>
using Splitting6 = Splitting<System, 6, summation>;
template <SplitSystem System, Summation summation = Summation::compensated>
using Splitting8 = Splitting<System, 8, summation>;
template <SplitSystem System, Summation summation = Summation::compensated>
using Splitting10 = Splitting<System, 10, summation>;

}  // namespace hamotor
