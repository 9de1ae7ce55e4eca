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

#include "hamotor/angle_increment.hpp"
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
    weights.drifts[k] = scalar::fixed<S>(exact.drifts[k]);
  }
  for (std::size_t k = 0; k <= Scheme::stages; ++k) {
    weights.kicks[k] = scalar::fixed<S>(exact.kicks[k]);
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

  struct Nothing {};
  /// What is carried from step to step; `left` is the state that the last one left.
  struct Account {
    [[no_unique_address]] LowDigits<System, summation> low;
    [[no_unique_address]] std::conditional_t<compensated, StateOf<System>, Nothing> left{};
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
  /// Before a step from this state: what sums lost of others is nothing to it.
  constexpr void take_up([[maybe_unused]] const StateOf<System>& state) noexcept {
    if constexpr (compensated) account_.low.keep_where(are_same(state, account_.left));
  }

  /// After a step to this state.
  constexpr void leave([[maybe_unused]] const StateOf<System>& state) noexcept {
    if constexpr (compensated) account_.left = state;
  }

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

  /// Motors become `by` times `motors`; momenta gain each component by a factor of its own.
  constexpr void settle(StateOf<System>& state, const S& by, const Motors& motors,
                        const Momenta& factors, const Momenta& forces) noexcept
    requires(!compensated)
  {
    move(
        state, factors, forces, S(0), [](std::size_t) { return Motor{}; },
        [&](std::size_t i, Motor& motor) {
          motor = motors[i];
          return Space<G>::put_back(motor, by);
        });
  }

  /// How far a step left the group.
  constexpr void note(const std::array<S, n>& defects) noexcept { record(account_.drift, defects); }

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
    this->take_up(state);
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
    this->leave(state);
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

/// Adds the slope of a stage, of the first three, to those before it.
template <std::size_t number, class Slope>
HAMOTOR_INLINE constexpr void add_slope(Slope& sum, const Slope& slope) noexcept {
  using S = std::remove_cvref_t<decltype(slope.motors[0].components()[0])>;
  if constexpr (number == 0) {
    sum = slope;
  } else {
    for (std::size_t i = 0; i < slope.motors.size(); ++i) {
      sum.motors[i] = mul_add(S(2), slope.motors[i], sum.motors[i]);
      sum.momenta[i] = mul_add(S(2), slope.momenta[i], sum.momenta[i]);
    }
    if constexpr (requires { slope.power; }) sum.power = mul_add(S(2), slope.power, sum.power);
  }
}

/// What `Rk4` takes through its stages: M and μ, of any system.
template <HamiltonianSystem System>
class MomentumStages {
  using S = typename System::Scalar;
  static constexpr std::size_t n = System::bodies;

 public:
  using Place = StateOf<System>;
  /// Ṁ, μ̇ and dH/dt.
  struct Sum {
    decltype(Place::motors) motors;
    decltype(Place::momenta) momenta;
    S power{};
  };

  constexpr MomentumStages(const System& system, const S& h) noexcept
      : system_(system), half_step_(S(0.5) * h) {}

  [[nodiscard]] HAMOTOR_INLINE constexpr Place start(const StateOf<System>& state) const noexcept {
    return state;
  }

  /// From the stage of this number of a step from t, whose slope joins the sum, to the next one's
  /// place.
  template <std::size_t number>
  [[nodiscard]] HAMOTOR_INLINE constexpr Place next(const S& t, const Place& start,
                                                    const Place& here, Sum& sum) const noexcept {
    const Sum along = slope(number == 0 ? t : t + half_step_, here);
    add_slope<number>(sum, along);
    const S by = S(number == 2 ? 2 : 1) * half_step_;
    Place there{};
    for (std::size_t i = 0; i < n; ++i) {
      there.motors[i] = mul_add(by, along.motors[i], start.motors[i]);
      there.momenta[i] = mul_add(by, along.momenta[i], start.momenta[i]);
    }
    return there;
  }

  HAMOTOR_INLINE constexpr void add_last(const S& t, const Place& here, Sum& sum) const noexcept {
    const Sum last = slope(mul_add(S(2), half_step_, t), here);
    for (std::size_t i = 0; i < n; ++i) {
      sum.motors[i] = sum.motors[i] + last.motors[i];
      sum.momenta[i] = sum.momenta[i] + last.momenta[i];
    }
    if constexpr (PoweredSystem<System>) sum.power = sum.power + last.power;
  }

 private:
  [[nodiscard]] HAMOTOR_INLINE constexpr Sum slope(const S& t, const Place& there) const noexcept {
    const auto now = gradient(system_, there, t);
    Sum result{};
    result.momenta = free_momentum_rates(system_, there.momenta, now.rates);
    for (std::size_t i = 0; i < n; ++i) {
      result.motors[i] = kinematics(there.motors[i], now.rates[i]);
      if constexpr (System::has_forque) result.momenta[i] = result.momenta[i] - now.forques[i];
    }
    if constexpr (PoweredSystem<System>) result.power = system_.power(there, t);
    return result;
  }

  const System& system_;
  S half_step_;
};

/// The same with rates B = ∂H/∂μ in place of momenta, which are constant multiples of them, and
/// h/4 as unit of time: nothing is then multiplied by J or h at every stage.
///
/// In plain sums a motor's slope is nowhere by itself: M₂ = M + h/2 Ṁ₁, M₃ and M₄ are one sum each,
/// and the step ends at (M₂ − M + h/2 Ṁ₄ + 2 M₃ + M₄)/3.
template <RateSystem System, Summation summation>
class RateStages {
  using S = typename System::Scalar;
  using Motor = typename System::Group::template Element<S>;
  static constexpr std::size_t n = System::bodies;

 public:
  /// Whether the sum is of places, three times the step's end.
  static constexpr bool sums_places = summation == Summation::plain;

  struct Place {
    typename System::Motors motors;
    typename System::Rates rates;  ///< h B/4
  };
  /// h Ṁ/2, and μ̇ in units of the system's.
  struct Slopes {
    typename System::Motors motors;
    typename System::Momenta momenta;
  };
  /// Of places the last two apart: what is small is summed first.
  struct Places : Slopes {
    typename System::Motors later;
  };
  using Sum = std::conditional_t<sums_places, Places, Slopes>;

  constexpr RateStages(const System& system, const S& h) noexcept
      : form_(system.in_rates(S(0.25) * h)) {
    const S whole = S(0.375) * h;
    sixth_ = form_.momentum_weights(select(whole == S(0), S(0), S(1) / whole));
    for (std::size_t i = 0; i < n; ++i) {
      half_step_[i] = S(2) * form_.rate_weights()[i];
      whole_step_[i] = S(4) * form_.rate_weights()[i];
    }
  }

  [[nodiscard]] HAMOTOR_INLINE constexpr Place start(const StateOf<System>& state) const noexcept {
    return {state.motors, form_.rates(state.momenta)};
  }

  /// From the stage of this number, whose slope joins the sum, to the next one's place.
  template <std::size_t number>
  [[nodiscard]] HAMOTOR_INLINE constexpr Place next(const S& /*t*/, const Place& start,
                                                    const Place& here, Sum& sum) const noexcept {
    constexpr int halves = number == 2 ? 2 : 1;
    Place there{};
    Slopes along{};
    note_evaluations<S>(1);
    along.momenta = form_.slopes(nothing, here.motors, here.rates);
    for (std::size_t i = 0; i < n; ++i) {
      if constexpr (sums_places) {
        const auto rate = halves == 2 ? here.rates[i] + here.rates[i] : here.rates[i];
        there.motors[i] = kinematics_onto(start.motors[i], here.motors[i], rate);
        along.motors[i] = there.motors[i];
      } else {
        along.motors[i] = kinematics_onto(Motor{}, here.motors[i], here.rates[i]);
        there.motors[i] = mul_add(S(halves), along.motors[i], start.motors[i]);
      }
    }
    add<number>(sum, along, start);
    const auto& weights = halves == 2 ? whole_step_ : half_step_;
    for (std::size_t i = 0; i < n; ++i) {
      there.rates[i] = each_mul_add(weights[i], along.momenta[i], start.rates[i]);
    }
    return there;
  }

  /// The last slope's terms are added to the sum one by one.
  HAMOTOR_INLINE constexpr void add_last(const S& /*t*/, const Place& here,
                                         Sum& sum) const noexcept {
    const auto start = [&](std::size_t i) { return sum.momenta[i].components(); };
    note_evaluations<S>(1);
    sum.momenta = form_.slopes(start, here.motors, here.rates);
    for (std::size_t i = 0; i < n; ++i) {
      sum.motors[i] = kinematics_onto(sum.motors[i], here.motors[i], here.rates[i]);
      if constexpr (sums_places) sum.motors[i] = sum.motors[i] + sum.later[i];
    }
  }

  /// What slopes are to be multiplied by for h μ̇/6.
  [[nodiscard]] constexpr const typename System::Momenta& sixth() const noexcept { return sixth_; }

 private:
  static constexpr Nothing nothing(std::size_t /*body*/) noexcept { return {}; }

  /// Adds what one of the first three stages found.
  template <std::size_t number>
  HAMOTOR_INLINE static constexpr void add(Sum& sum, const Slopes& along,
                                           const Place& start) noexcept {
    if constexpr (!sums_places) {
      add_slope<number>(sum, along);
    } else {
      for (std::size_t i = 0; i < n; ++i) {
        if constexpr (number == 0) {
          sum.motors[i] = along.motors[i] - start.motors[i];
          sum.momenta[i] = along.momenta[i];
        } else {
          sum.later[i] =
              number == 1 ? along.motors[i] : mul_add(S(2), sum.later[i], along.motors[i]);
          sum.momenta[i] = mul_add(S(2), along.momenta[i], sum.momenta[i]);
        }
      }
    }
  }

  decltype(std::declval<const System&>().in_rates(S())) form_;
  typename System::Rates half_step_;
  typename System::Rates whole_step_;
  typename System::Momenta sixth_;
};

/// The same of bodies that translate, with their positions and velocities in the world: these are
/// linear in each other, so that three evaluations of the force are all their stages need
/// (Nyström 1925), and where nothing acts they are exact however fast bodies turn.
///
/// What is carried from step to step has no units of h.
template <WorldSystem System>
class WorldStages {
  using S = typename System::Scalar;
  using G = typename System::Group;
  using Space = hamotor::Space<G>;
  using Form = decltype(std::declval<const System&>().in_world(S()));
  using Attitudes = typename Form::Attitudes;
  using Vectors = typename Form::Vectors;
  using Turnings = typename Form::Turnings;
  static constexpr std::size_t n = System::bodies;
  static constexpr std::size_t rotations = Space::rotations;
  static constexpr std::size_t dimension = Space::dimension;

 public:
  /// Bodies in the world.
  struct Carried {
    Attitudes attitudes;
    Turnings angular;    ///< Π, body frame
    Vectors positions;   ///< m
    Vectors velocities;  ///< m/s
  };

  constexpr WorldStages(const System& system, const S& h) noexcept
      : form_(system.in_world(S(0.25) * h)) {
    const S whole = S(0.375) * h;
    const S per_whole = select(whole == S(0), S(0), S(1) / whole);
    sixth_ = form_.momentum_weights(per_whole);
    for (std::size_t k = 0; k < by_forces_.size(); ++k) {
      by_forces_[k] = std::array{S(4), S(8), S(8) / S(3), per_whole}[k] * form_.force_unit();
    }
    time_ = h;
    half_time_ = S(0.5) * h;
    half_step_ = form_.rate_weights();
    whole_step_ = form_.rate_weights();
    for (std::size_t i = 0; i < n; ++i) {
      half_step_[i] = scaled(S(2), half_step_[i]);
      whole_step_[i] = scaled(S(4), whole_step_[i]);
    }
    system.for_each_body([&](auto i, const auto& body) {
      twice_mass_[i] = S(2) * body.mass();
      per_half_mass_[i] = S(2) / body.mass();
    });
  }

  [[nodiscard]] constexpr Carried carried(const StateOf<System>& state) const noexcept {
    Carried result{};
    for (std::size_t i = 0; i < n; ++i) {
      const auto& motor = state.motors[i];
      const auto momentum = state.momenta[i].components();
      const auto velocity = scaled(per_half_mass_[i], rest<rotations>(momentum));
      result.attitudes[i] = Space::attitude(motor);
      result.angular[i] = first<rotations>(momentum);
      result.positions[i] = sandwich(motor, typename Space::template Origin<S>{}).components();
      result.velocities[i] = Space::half_turn(result.attitudes[i]).turned({}, velocity);
    }
    return result;
  }

  [[nodiscard]] constexpr StateOf<System> state(const Carried& carried) const noexcept {
    using State = StateOf<System>;
    State result{};
    for (std::size_t i = 0; i < n; ++i) {
      const auto& attitude = carried.attitudes[i];
      const auto momentum = scaled(twice_mass_[i], carried.velocities[i]);
      result.motors[i] = Space::motor(attitude, carried.positions[i]);
      result.momenta[i] = State::Momentum::from(
          joined(carried.angular[i], Space::half_turn(attitude).turned_back(momentum)));
    }
    return result;
  }

  /// `a` in the lanes where a condition holds, else `b`.
  template <class Condition>
  [[nodiscard]] static constexpr Carried selected(const Condition& condition, const Carried& a,
                                                  Carried b) noexcept {
    const auto keep = [&](const auto& from, auto& to) {
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t k = 0; k < to[i].size(); ++k) {
          to[i][k] = select(condition, from[i][k], to[i][k]);
        }
      }
    };
    keep(a.attitudes, b.attitudes);
    keep(a.angular, b.angular);
    keep(a.positions, b.positions);
    keep(a.velocities, b.velocities);
    return b;
  }

  /// A step, and how far each body's left the group.
  [[nodiscard]] HAMOTOR_INLINE constexpr std::array<S, n> step(Carried& at) const noexcept {
    note_evaluations<S>(4);
    const Turnings start = form_.rates(at.angular);
    const auto one = form_.slopes(nothing, Nothing{}, at.attitudes, at.positions, start);
    const Attitudes second = turned(at.attitudes, at.attitudes, start);
    const Turnings second_rates = turning(half_step_, one, start);
    Vectors positions = moved(half_time_, at.velocities, at.positions);
    const Vectors end = moved(time_, at.velocities, at.positions);

    const auto two = form_.slopes(nothing, Nothing{}, second, positions, second_rates);
    const Attitudes third = turned(at.attitudes, second, second_rates);
    const Turnings third_rates = turning(half_step_, two, start);
    if constexpr (System::has_forque) positions = moved(by_forces_[0], forces(one), positions);

    const auto three = form_.slopes(nothing, Nothing{}, third, positions, third_rates);
    Turnings twice_rates = third_rates;
    for (auto& rate : twice_rates) rate = scaled(S(2), rate);
    const Attitudes fourth = turned(at.attitudes, third, twice_rates);
    const Turnings fourth_rates = turning(whole_step_, three, start);
    if constexpr (System::has_forque) positions = moved(by_forces_[1], forces(two), end);

    Turnings moments{};
    Vectors pushed{};
    Vectors twice_pushed{};
    for (std::size_t i = 0; i < n; ++i) {
      moments[i] = sum_with(one[i].moment, S(2), sum_with(two[i].moment, One{}, three[i].moment));
      if constexpr (System::has_forque) {
        const auto later = sum_with(two[i].force, One{}, three[i].force);
        pushed[i] = sum_with(one[i].force, One{}, later);
        twice_pushed[i] = sum_with(pushed[i], One{}, later);
      }
    }
    const auto sum = form_.slopes([&](std::size_t i) { return moments[i]; }, twice_pushed, fourth,
                                  positions, fourth_rates);

    std::array<S, n> defects{};
    for (std::size_t i = 0; i < n; ++i) {
      Attitude place = at.attitudes[i];
      for (std::size_t k = 0; k < place.size(); ++k) place[k] = second[i][k] - place[k];
      place = Space::with_twice_turning(place, fourth[i], fourth_rates[i]);
      for (std::size_t k = 0; k < place.size(); ++k) {
        place[k] = place[k] + mul_add(S(2), third[i][k], fourth[i][k]);
      }
      // A third of this, put back on the group.
      S square = place[0] * place[0];
      for (std::size_t k = 1; k < place.size(); ++k) square = mul_add(place[k], place[k], square);
      at.attitudes[i] = scaled(mul_add(S(-0.5) / S(27), square, S(0.5)), place);
      defects[i] = scalar::abs(mul_add(S(1) / S(9), square, S(-1)));
      for (std::size_t k = 0; k < rotations; ++k) {
        at.angular[i][k] = mul_add(sixth_[i][k], sum[i].moment[k], at.angular[i][k]);
      }
    }
    at.positions = end;
    if constexpr (System::has_forque) {
      at.positions = moved(by_forces_[2], pushed, end);
      at.velocities = moved(by_forces_[3], forces(sum), at.velocities);
    }
    return defects;
  }

 private:
  using Attitude = typename Space::template Attitude<S>;
  using Pushes = typename Form::Pushes;

  static constexpr Nothing nothing(std::size_t /*body*/) noexcept { return {}; }

  [[nodiscard]] HAMOTOR_INLINE static constexpr Attitudes turned(const Attitudes& start,
                                                                 const Attitudes& here,
                                                                 const Turnings& rates) noexcept {
    Attitudes there{};
    for (std::size_t i = 0; i < n; ++i) {
      there[i] = Space::with_twice_turning(start[i], here[i], rates[i]);
    }
    return there;
  }
  [[nodiscard]] HAMOTOR_INLINE static constexpr Turnings turning(const Turnings& weights,
                                                                 const Pushes& along,
                                                                 Turnings rates) noexcept {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < rotations; ++k) {
        rates[i][k] = mul_add(weights[i][k], along[i].moment[k], rates[i][k]);
      }
    }
    return rates;
  }
  [[nodiscard]] HAMOTOR_INLINE static constexpr Vectors moved(const S& by, const Vectors& along,
                                                              Vectors positions) noexcept {
    for (std::size_t i = 0; i < n; ++i) positions[i] = sum_with(positions[i], by, along[i]);
    return positions;
  }
  [[nodiscard]] HAMOTOR_INLINE static constexpr Vectors forces(const Pushes& pushes) noexcept {
    Vectors result{};
    for (std::size_t i = 0; i < n; ++i) result[i] = pushes[i].force;
    return result;
  }

  Form form_;
  Turnings half_step_;
  Turnings whole_step_;
  Turnings sixth_;
  std::array<S, 4> by_forces_;  ///< of positions at three places, and of the velocity
  S time_;
  S half_time_;
  std::array<S, n> twice_mass_;
  std::array<S, n> per_half_mass_;
};

}  // namespace detail

/// The classical Runge–Kutta method of order 4 on the components of M and μ, put back on the group
/// after every step; of rigid bodies that translate on the components of attitude and angular
/// momentum, and of position and velocity in the world.
///
/// No exponentials: about half the time of `Rkmk4`, whose error is smaller where bodies turn fast.
/// Four evaluations of rate and forque a step; not symplectic.
template <HamiltonianSystem System, Summation summation = Summation::plain>
class Rk4 : public detail::ExplicitMethod<System, summation> {
  using Base = detail::ExplicitMethod<System, summation>;
  using typename Base::S;
  static constexpr auto stages_of() noexcept {
    if constexpr (WorldSystem<System> && summation == Summation::plain) {
      return std::type_identity<detail::WorldStages<System>>{};
    } else if constexpr (RateSystem<System>) {
      return std::type_identity<detail::RateStages<System, summation>>{};
    } else {
      return std::type_identity<detail::MomentumStages<System>>{};
    }
  }
  using Stages = typename decltype(stages_of())::type;

 public:
  static constexpr int order = 4;
  static constexpr std::string_view name = "rk4";
  /// Whether steps can be left open: what they carry in place of the state is made a state, by
  /// `closed`, when that is asked for.  Of a run by itself every step is closed, and its bits are
  /// the same.
  static constexpr bool carries_state = requires { typename Stages::Carried; };

  /// What is the same in all steps of h; keeps a reference to the system.
  class Plan {
   public:
    constexpr Plan(const System& system, const S& h) noexcept : stages_(system, h), step_(h) {}

   private:
    friend Rk4;
    Stages stages_;
    S step_;
  };

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    do_step(Plan(system, h), state, t);
  }

  /// The same by a plan for h.  Flat: a slope that is called returns through memory.
  [[gnu::flatten]] constexpr void do_step(const Plan& plan, StateOf<System>& state,
                                          const S& t) noexcept {
    take_up(plan, state);
    go_on(plan, state, t);
    if constexpr (!carries_state) {
      this->leave(state);
    } else if constexpr (keeps_left) {
      known_.left = state;
    }
  }

  /// The same of a new stepper, or from the state that its last step left, which is not compared
  /// with that.  `do_step` does not know of these steps: before it, `forget`.
  constexpr void go_on(const System& system, StateOf<System>& state, const S& t,
                       const S& h) noexcept {
    go_on(Plan(system, h), state, t);
  }
  [[gnu::flatten]] constexpr void go_on(const Plan& plan, StateOf<System>& state,
                                        const S& t) noexcept {
    if constexpr (carries_state) {
      open(plan, state);
      do_open_step(plan);
      state = closed(plan);
    } else {
      const Stages& stages = plan.stages_;
      const auto start = stages.start(state);
      typename Stages::Sum sum{};
      const auto second = stages.template next<0>(t, start, start, sum);
      const auto third = stages.template next<1>(t, start, second, sum);
      const auto fourth = stages.template next<2>(t, start, third, sum);
      stages.add_last(t, fourth, sum);
      if constexpr (!RateSystem<System>) {
        this->shift(state, plan.step_ / S(6), sum.motors, sum.momenta, sum.power);
      } else if constexpr (Stages::sums_places) {
        this->settle(state, S(1) / S(3), sum.motors, stages.sixth(), sum.momenta);
      } else {
        this->shift(state, S(1) / S(3), sum.motors, stages.sixth(), sum.momenta);
      }
    }
  }

  /// Takes up a state, the first one; later ones are known.
  constexpr void open(const Plan& plan, const StateOf<System>& state) noexcept
    requires(carries_state)
  {
    if (known_.any) return;
    known_.carried = plan.stages_.carried(state);
    known_.any = true;
  }

  /// A step from there.
  [[gnu::flatten]] HAMOTOR_INLINE constexpr void do_open_step(const Plan& plan) noexcept
    requires(carries_state)
  {
    this->note(plan.stages_.step(known_.carried));
  }

  /// The state after the steps so far.
  [[nodiscard]] constexpr StateOf<System> closed(const Plan& plan) const noexcept
    requires(carries_state)
  {
    return plan.stages_.state(known_.carried);
  }

  /// The next step is from another state.
  constexpr void forget() noexcept {
    Base::forget();
    if constexpr (carries_state) known_.any = false;
  }

 private:
  struct Nothing {};
  /// Whether the state that the last step left is kept.  That of packs is found again for a run, so
  /// that ensembles, which need none, have less to store.
  static constexpr bool keeps_left = std::same_as<decltype(S(0) == S(0)), bool>;
  template <class Carrying>
  struct Known {
    typename Carrying::Carried carried{};
    [[no_unique_address]] std::conditional_t<keeps_left, StateOf<System>, Nothing> left{};
    bool any = false;
  };

  /// Takes up a state in the lanes in which it is not the one that the last step left.
  constexpr void take_up([[maybe_unused]] const Plan& plan, const StateOf<System>& state) noexcept {
    if constexpr (carries_state) {
      const auto same = [&] {
        if constexpr (keeps_left) {
          return are_same(state, known_.left);
        } else {
          return are_same(state, closed(plan));
        }
      }();
      if (!any(same)) known_.any = false;
      if (!known_.any || all(same)) return;
      known_.carried = Stages::selected(same, known_.carried, plan.stages_.carried(state));
    } else {
      Base::take_up(state);
    }
  }

  [[no_unique_address]] std::conditional_t<carries_state, Known<Stages>, Nothing> known_{};
};

/// Symmetric, symplectic splitting of order 2, 4, 6, 8 or 10: kicks and free motions in turn, where
/// a free motion is exact or itself a symmetric composition of exact flows.
///
/// Order 2 is Strang's.  Where the free motion is exact, orders 4 and 6 are Runge–Kutta–Nyström
/// splittings; everything else is a composition of Strang's map.  Every part is a coadjoint motion
/// or a kick: Casimirs of free bodies and the spatial momentum are constant but for rounding,
/// whatever the step, and the energy error is bounded.  With compensated sums a rounding error is
/// relative to the change in a part of a step instead of to the state.  A forque at the end of a
/// step is kept for the start of the next; where that is of another state, it starts anew.
template <SplitSystem System, int nominal_order, Summation summation = Summation::compensated>
class Splitting {
  using S = typename System::Scalar;
  using G = typename System::Group;
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
  [[gnu::flatten]] constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                                          const S& h) noexcept {
    if constexpr (keeps_any) take_up(system, state);
    go_on(system, state, t, h);
    if constexpr (keeps_any) left_ = state;
  }

  /// The same of a new stepper, or from the state that its last step left, which is not compared
  /// with that.  `do_step` does not know of these steps: before it, `forget`.
  [[gnu::flatten]] constexpr void go_on(const System& system, StateOf<System>& state,
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
        if (!known_.any) find_forque(state.motors);
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
      if constexpr (opens_with_kick) known_.any = true;
    }
  }

  /// The next step is from another state.
  constexpr void forget() noexcept {
    if constexpr (System::has_forque) known_.any = false;
    low_ = {};
    open_steps_ = 0;
  }

  /// From a state to one inside the first step, to be taken further by open steps of h.
  constexpr void open(const System& system, StateOf<System>& state, const S& h) const noexcept
    requires(stays_open)
  {
    system.template turn<true, AngleRange::any>(state.motors, state.momenta, weights.kicks[0] * h);
  }

  /// The range of half the angles of all turns of steps of h, from this state on: |Π| is constant
  /// but for rounding, for which there is room.
  [[nodiscard]] static constexpr AngleRange range_of_turns(const System& system,
                                                           const StateOf<System>& state,
                                                           const S& h) noexcept
    requires(stays_open)
  {
    S largest = weights.kicks[stages] + weights.kicks[0];
    for (const S& weight : weights.drifts) largest = scalar::max_abs(largest, weight);
    for (const S& weight : weights.kicks) largest = scalar::max_abs(largest, weight);
    return system.range_of_turns(state.momenta, largest * h);
  }

  /// Takes an open state through one of the `turns` of a step of h, which are taken in this order.
  /// They leave the group by rounding only, so that motors are put back every 16 steps.
  template <AngleRange range>
  [[gnu::flatten]] HAMOTOR_INLINE constexpr void do_turn(const System& system,
                                                         StateOf<System>& state, const S& h,
                                                         std::size_t number) noexcept
    requires(stays_open)
  {
    const std::size_t stage = stages == 1 ? 0 : number / 2;  // a constant, where it is one
    if (number % 2 == 0) {
      system.template turn<false, range>(state.motors, state.momenta, weights.drifts[stage] * h);
      return;
    }
    const bool last = stage + 1 == stages;
    const S weight = last ? weights.kicks[stages] + weights.kicks[0] : weights.kicks[stage + 1];
    system.template turn<true, range>(state.motors, state.momenta, weight * h);
    if (!last) return;
    open_steps_ = (open_steps_ + 1) % 16;
    if (open_steps_ == 0) put_back(state);
  }

  /// The state after so many open steps of h.
  [[nodiscard]] constexpr StateOf<System> closed(const System& system, StateOf<System> state,
                                                 const S& h, const S& steps) const noexcept
    requires(stays_open)
  {
    system.template turn<true, AngleRange::any>(state.motors, state.momenta, -weights.kicks[0] * h);
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
  struct NothingLeft {};  // members of one empty type would each have an address
  struct KnownForque {
    bool any = false;
    Momenta forque{};
  };
  static constexpr bool takes_whole_steps = detail::takes_split_steps<System>;
  static inline const auto weights = detail::rounded_weights<S, Scheme>();
  static constexpr bool opens_with_kick =
      System::has_forque && detail::rounded_weights<double, Scheme>().kicks[0] > 0;

  /// Whether anything is kept of the state that a step leaves.
  static constexpr bool keeps_any = compensated || (opens_with_kick && !takes_whole_steps);

  /// Forgets what is kept in the lanes in which a state is not the one that the last step left.
  constexpr void take_up(const System& system, const StateOf<System>& state) noexcept {
    const auto same = are_same(state, left_);
    if (all(same)) return;
    if constexpr (compensated) detail::keep_where(low_, same);
    if constexpr (opens_with_kick && !takes_whole_steps) {
      if (!any(same)) known_.any = false;
      if (!known_.any) return;
      note_evaluations<S>(1);
      const Momenta anew = system.forque(state.motors);
      for (std::size_t i = 0; i < n; ++i) {
        known_.forque[i] = select_each(same, known_.forque[i], anew[i]);
      }
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
  [[no_unique_address]] std::conditional_t<keeps_any, StateOf<System>, NothingLeft> left_{};
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
