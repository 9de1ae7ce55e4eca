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
      { mul_add(x, w, w) } -> std::same_as<typename G::template Rate<S>>;
      { mul_add(x, mu, mu) } -> std::same_as<typename G::template Momentum<S>>;
    };

/// A Hamiltonian system on N copies of a group: Ṁ = M B, μ̇ = [μ, B] − F with B = `rate` = ∂H/∂μ and
/// F = `forque`, the body forque M~ F_s M = +dH (theory: minus the force), both for every body.
///
/// A system in which nothing acts says so by `has_forque = false` and needs no forque.
template <class System>
concept HamiltonianSystem =
    LieGroup<typename System::Group, typename System::Scalar> &&
    requires(const System& system,
             const State<typename System::Group, System::bodies, typename System::Scalar>& state) {
      { system.energy(state) } -> std::same_as<typename System::Scalar>;
      {
        system.rate(state)
      } -> std::same_as<std::array<typename System::Group::template Rate<typename System::Scalar>,
                                   System::bodies>>;
      { System::has_forque } -> std::convertible_to<bool>;
      requires !System::has_forque || requires {
        {
          system.forque(state.motors)
        } -> std::same_as<std::array<
            typename System::Group::template Momentum<typename System::Scalar>, System::bodies>>;
      };
    };

/// The state space of a system.
template <class System>
using StateOf = State<typename System::Group, System::bodies, typename System::Scalar>;

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
    HamiltonianSystem<System> &&
    requires(const System& system, const StateOf<System>& state, typename System::Scalar h) {
      { system.free_change(state.motors, state.momenta, h) } -> std::same_as<ChangeOf<System>>;
    };

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

}  // namespace hamotor
