// What a simulation is made of: a state on a group, a system that moves it, a stepper that steps
// it.
//
// The concepts below are the whole contract between them.  A type that misses a part is refused at
// compile time with the requirement that it fails.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <utility>

#include "hamotor/scalar.hpp"

namespace hamotor {

/// A point of (G × g*)^N: one group element and one body momentum for each of N bodies.
///
/// Motors take body to world, X_world = M X_body M~.  Momenta are physical, in the body frame:
/// angular (kg m²/s) before linear (kg m/s), about the body frame's origin.
template <class G, std::size_t N, class S>
struct State {
  using Group = G;
  using Scalar = S;
  using Element = typename G::template Element<S>;
  using Momentum = typename G::template Momentum<S>;
  static constexpr std::size_t bodies = N;

  std::array<Element, N> motors;
  std::array<Momentum, N> momenta;

  [[nodiscard]] friend constexpr bool operator==(const State&, const State&) = default;
};

/// Where two states have the same numbers: of packs, in which lanes.
template <class G, std::size_t N, class S>
[[nodiscard]] constexpr auto are_same(const State<G, N, S>& a, const State<G, N, S>& b) noexcept {
  auto same = S(0) == S(0);
  if constexpr (std::same_as<decltype(same), bool>) {
    same = a == b;
  } else {
    const auto compare = [&](const auto& x, const auto& y) {
      const auto one = x.components();
      const auto other = y.components();
      for (std::size_t k = 0; k < one.size(); ++k) same = same && one[k] == other[k];
    };
    for (std::size_t i = 0; i < N; ++i) {
      compare(a.motors[i], b.motors[i]);
      compare(a.momenta[i], b.momenta[i]);
    }
  }
  return same;
}

/// The components of `a` in the lanes where a condition holds, else those of `b`.
template <class Condition, class T>
[[nodiscard]] constexpr T select_each(const Condition& condition, const T& a, const T& b) noexcept {
  auto x = a.components();
  const auto y = b.components();
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = select(condition, x[k], y[k]);
  return T::from(x);
}

/// Whether every number of a state is finite: one multiply-add for each (0·∞ and 0·NaN are NaN).
template <class G, std::size_t N, class S>
[[nodiscard]] constexpr auto is_finite(const State<G, N, S>& state) noexcept {
  S sum(0);
  for (std::size_t i = 0; i < N; ++i) {
    S part(0);
    for (const S& x : state.motors[i].components()) part = mul_add(S(0), x, part);
    for (const S& x : state.momenta[i].components()) sum = mul_add(S(0), x, sum);
    sum = sum + part;
  }
  return sum == S(0);
}

/// A group of rotors with the generated kernels that mechanics on it needs, in the scalar S.
template <class G, class S = double>
concept LieGroup =
    requires(const typename G::template Element<S>& m, const typename G::template Rate<S>& w,
             const typename G::template Momentum<S>& mu, const S& x) {
      { G::dimension } -> std::convertible_to<int>;
      { G::name } -> std::convertible_to<std::string_view>;
      { ad(w, w) } -> std::same_as<typename G::template Rate<S>>;
      { coadjoint(w, mu) } -> std::same_as<typename G::template Momentum<S>>;
      { kinematics(m, w) } -> std::same_as<typename G::template Element<S>>;
      { Ad_star(m, mu) } -> std::same_as<typename G::template Momentum<S>>;
      { Ad_star_inverse(m, mu) } -> std::same_as<typename G::template Momentum<S>>;
      { pairing(mu, w) } -> std::same_as<S>;
      { exp(w) } -> std::same_as<typename G::template Element<S>>;
      { gp(m, m) } -> std::same_as<typename G::template Element<S>>;
      { reverse(m) } -> std::same_as<typename G::template Element<S>>;
      { unit_correction(m, unit_defect(m)) } -> std::same_as<typename G::template Element<S>>;
      { mul_add(x, w, w) } -> std::same_as<typename G::template Rate<S>>;
      { mul_add(x, mu, mu) } -> std::same_as<typename G::template Momentum<S>>;
    };

/// The gradient of H at a state: for every body the rate B = ∂H/∂μ and the body forque
/// F = M~ F_s M = +dH (theory: minus the force), so that Ṁ = M B and μ̇ = [μ, B] − F.
template <class G, std::size_t N, class S>
struct Gradient {
  std::array<typename G::template Rate<S>, N> rates;
  std::array<typename G::template Momentum<S>, N> forques;
};

/// A system H = T(μ) + U(M) that says ∂T/∂μ by `rate` and dU by `forque`.
///
/// A system in which nothing acts says so by `has_forque = false` and needs no forque.
template <class System>
concept SeparableSystem = requires(
    const System& system,
    const State<typename System::Group, System::bodies, typename System::Scalar>& state) {
  { system.energy(state) } -> std::same_as<typename System::Scalar>;
  {
    system.rate(state)
  } -> std::same_as<
      std::array<typename System::Group::template Rate<typename System::Scalar>, System::bodies>>;
  { System::has_forque } -> std::convertible_to<bool>;
  requires !System::has_forque || requires {
    {
      system.forque(state.motors)
    } -> std::same_as<std::array<typename System::Group::template Momentum<typename System::Scalar>,
                                 System::bodies>>;
  };
};

/// A system with any H(M, μ, t), and forques of no potential if there are: the whole gradient at
/// once, at a time.
template <class System>
concept GeneralSystem =
    requires(const System& system,
             const State<typename System::Group, System::bodies, typename System::Scalar>& state,
             const typename System::Scalar& t) {
      { system.energy(state, t) } -> std::same_as<typename System::Scalar>;
      {
        system.gradient(state, t)
      } -> std::same_as<Gradient<typename System::Group, System::bodies, typename System::Scalar>>;
      { System::has_forque } -> std::convertible_to<bool>;
    };

/// A Hamiltonian system on N copies of a group.
template <class System>
concept HamiltonianSystem = LieGroup<typename System::Group, typename System::Scalar> &&
                            (SeparableSystem<System> || GeneralSystem<System>);

/// A system whose energy is not constant by itself: `power(state, t)` is dH/dt, W.
template <class System>
concept PoweredSystem = GeneralSystem<System> && requires(const System& system) {
  system.power(State<typename System::Group, System::bodies, typename System::Scalar>{},
               typename System::Scalar{});
};

/// A system whose momenta are constant multiples of its rates, so that these can be stepped in
/// their place, with any time as unit: `in_rates(unit)` has
/// - `rates(momenta)`: unit B;
/// - `slopes(start, motors, rates)`: unit² μ̇ at these rates, each component of it in a unit of the
///   system's own, added to the components `start(i)` of body i;
/// - `rate_weights()`: what slopes are to be multiplied by for unit² Ḃ;
/// - `momentum_weights(x)`: and for x unit² μ̇.
template <class System>
concept RateSystem =
    SeparableSystem<System> &&
    requires(
        const System& system, const typename System::Motors& motors,
        const typename System::Rates& rates, const typename System::Momenta& momenta,
        const typename System::Scalar& unit,
        decltype(std::declval<typename System::Momenta>()[0].components()) (*start)(std::size_t)) {
      { system.in_rates(unit).rates(momenta) } -> std::same_as<typename System::Rates>;
      {
        system.in_rates(unit).slopes(start, motors, rates)
      } -> std::same_as<typename System::Momenta>;
      { system.in_rates(unit).rate_weights() } -> std::convertible_to<typename System::Rates>;
      { system.in_rates(unit).momentum_weights(unit) } -> std::same_as<typename System::Momenta>;
    };

/// A rate system whose bodies can also be stepped in the world: attitude and rate in place of motor
/// and momentum, position and velocity in the world's frame, where they are linear.
template <class System>
concept WorldSystem =
    RateSystem<System> && requires(const System& system, const typename System::Scalar& unit) {
      system.in_world(unit).momentum_weights(unit);
    };

/// The state space of a system.
template <class System>
using StateOf = State<typename System::Group, System::bodies, typename System::Scalar>;

/// Tells a scalar that counts (counted.hpp) that rates or forques are evaluated so many times.
template <class S>
constexpr void note_evaluations([[maybe_unused]] int times) noexcept {
  if constexpr (requires { S::note_evaluations(times); }) S::note_evaluations(times);
}

/// The gradient of H at a state and a time; a separable system's forque only where it has one.
template <HamiltonianSystem System>
[[nodiscard]] constexpr auto gradient(const System& system, const StateOf<System>& state,
                                      const typename System::Scalar& t) noexcept {
  note_evaluations<typename System::Scalar>(1);
  if constexpr (GeneralSystem<System>) {
    return system.gradient(state, t);
  } else {
    Gradient<typename System::Group, System::bodies, typename System::Scalar> result{
        system.rate(state), {}};
    if constexpr (System::has_forque) result.forques = system.forque(state.motors);
    return result;
  }
}

/// The rates of all bodies of a system.
template <class System>
using RatesOf =
    std::array<typename System::Group::template Rate<typename System::Scalar>, System::bodies>;

/// A system that finds [μ, B] of its own B itself, without what vanishes in it, as P × V of
/// V = P/m: products that in orbit exceed any torque by all digits.
template <class System>
concept InertialSystem =
    requires(const System& system, const decltype(StateOf<System>::momenta)& momenta,
             const RatesOf<System>& rates) { system.free_momentum_rates(momenta, rates); };

/// Whether a system says that P × V of all its bodies vanishes.
template <class System>
inline constexpr bool moves_along_momentum = false;
template <class System>
  requires requires { System::moves_along_momentum; }
inline constexpr bool moves_along_momentum<System> = System::moves_along_momentum;

/// [μ, B] for every body at these rates.
template <HamiltonianSystem System>
[[nodiscard]] constexpr auto free_momentum_rates(const System& system,
                                                 const decltype(StateOf<System>::momenta)& momenta,
                                                 const RatesOf<System>& rates) noexcept {
  if constexpr (InertialSystem<System>) {
    return system.free_momentum_rates(momenta, rates);
  } else {
    auto result = momenta;
    for (std::size_t i = 0; i < System::bodies; ++i) result[i] = coadjoint(rates[i], momenta[i]);
    return result;
  }
}

/// H at a state and a time, J.
template <HamiltonianSystem System>
[[nodiscard]] constexpr typename System::Scalar energy(const System& system,
                                                       const StateOf<System>& state,
                                                       const typename System::Scalar& t) noexcept {
  if constexpr (GeneralSystem<System>) {
    return system.energy(state, t);
  } else {
    return system.energy(state);
  }
}

/// By how much a state changes: what is to be added to its motors and momenta.
template <class System>
struct ChangeOf {
  std::array<typename System::Group::template Element<typename System::Scalar>, System::bodies>
      motors;
  std::array<typename System::Group::template Momentum<typename System::Scalar>, System::bodies>
      momenta;
};

/// A system H = T(μ) + U(M) whose free motion, H = T, is solved exactly or by a symmetric
/// composition of exact flows: `free_change(motors, momenta, h)` is what it adds in the time h.
template <class System>
concept SplitSystem =
    HamiltonianSystem<System> && SeparableSystem<System> &&
    requires(const System& system, const StateOf<System>& state, typename System::Scalar h) {
      { system.free_change(state.motors, state.momenta, h) } -> std::same_as<ChangeOf<System>>;
    };

/// Whether a system says that its free motion is exact, not only symmetric and of order 2.
template <class System>
inline constexpr bool freely_exact = false;
template <class System>
  requires requires { System::free_motion_is_exact; }
inline constexpr bool freely_exact<System> = System::free_motion_is_exact;

/// How far steps left the group: |M M~ − 1|, largest absolute coefficient over all bodies, before
/// the motor was put back.
template <class S>
struct Drift {
  S largest = S(0);  ///< left by any one step
  S sum = S(0);      ///< over all steps
};

/// One-step method: `do_step` takes `state` from time t to t + h in place.
template <class Method, class System>
concept Stepper = HamiltonianSystem<System> && std::default_initializable<Method> &&
                  requires(Method method, const System& system, StateOf<System>& state,
                           typename System::Scalar t) {
                    { Method::order } -> std::convertible_to<int>;
                    { Method::name } -> std::convertible_to<std::string_view>;
                    { method.do_step(system, state, t, t) } -> std::same_as<void>;
                    { method.drift() } -> std::convertible_to<Drift<typename System::Scalar>>;
                  };

/// A step of a new method, or from the state that its last step left: methods that would look
/// whether it is that one do not.
template <class System, Stepper<System> Method>
HAMOTOR_INLINE constexpr void go_on(Method& method, const System& system, StateOf<System>& state,
                                    const typename System::Scalar& t,
                                    const typename System::Scalar& h) noexcept {
  if constexpr (requires { method.go_on(system, state, t, h); }) {
    method.go_on(system, state, t, h);
  } else {
    method.do_step(system, state, t, h);
  }
}

/// A stepper that can choose the steps within a `do_step` itself, by an estimate of their error.
///
/// `set_tolerance(e)` asks for a local error of at most e per unit of time, s⁻¹, of a motor's
/// components and of a momentum's relative to its largest; without it the stepper has a default of
/// its own, which may be one step a call.  `steps()` are those taken so far.  The state is always
/// delivered at t + h; a stepper whose last step has a polynomial that reaches there (dense
/// output) evaluates it, so that its own steps may be longer than h.
template <class Method, class S>
concept ErrorControlled = requires(Method method, const Method& constant, const S& tolerance) {
  { method.set_tolerance(tolerance) } -> std::same_as<void>;
  { constant.steps() } -> std::convertible_to<long long>;
};

/// A stepper that takes steps of its own and can stop on the way to where it is asked for.
///
/// After `set_patience(n)` a call of `do_step` that would try more than n of them ends early, with
/// the state as it was, and `paused()` is true: the same call again goes on, to the same bits.
template <class Method>
concept Patient = requires(Method method, const Method& constant, long long tries) {
  { method.set_patience(tries) } -> std::same_as<void>;
  { constant.paused() } -> std::same_as<bool>;
};

/// Why a run could not take a step.  What a stepper says so of has momenta that are not numbers.
enum class Failure {
  none,
  not_finite,      ///< the motion left the finite numbers, or the system has none there
  no_convergence,  ///< the iteration for an implicit step did not settle
  step_too_short,  ///< the tolerance would need steps below rounding of the time
  left_group       ///< |M M~ − 1| before the projection was so large that M is no motor any more
};

/// What |M M~ − 1| may be before a step's projection, which is then still one: of dilations and
/// boosts by more than 1/ε, M holds too few digits for that.
inline constexpr double largest_defect = 0.5;

/// Why a stepper's last step failed: what `failure()` says where the stepper has it.
template <class Method>
[[nodiscard]] constexpr Failure failure_of(const Method& method) noexcept {
  if constexpr (requires {
                  { method.failure() } -> std::same_as<Failure>;
                }) {
    return method.failure();
  } else {
    return Failure::none;
  }
}

}  // namespace hamotor
