// Preprocessed discrete Moser–Veselov steps of a rigid body, order 2 to 10.
//
// The discrete Moser–Veselov algorithm is the variational integrator of the free rigid body (Moser
// & Veselov 1991): integrable as the body is, so that with other moments of inertia, functions of
// the step and of what is conserved, its orbit is the body's own (Hairer & Vilmart 2006, J. Phys. A
// 39, 13225).  The series for those moments is cut off at the order asked for.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <utility>

#include "hamotor/free_body.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/space.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/systems.hpp"

namespace hamotor {

namespace detail::moser_veselov {

/// A term `over`/`under` Gⁱ C^(k−i) aˡ sᵐ pⁿ of a series' coefficient of h^2k.
struct Term {
  std::size_t energy;               ///< i
  std::array<std::size_t, 3> rest;  ///< l, m, n
  int over;
  int under;
};

// With a = 1/J_m of the middle moment and d_j = 1/J_j − a of the others, the modified moments are
// 1/J̃_m = a + Σ shift_k h^k and 1/J̃_j = 1/J̃_m + (1 + Σ scale_k h^k) d_j.  These are exact, from the
// Taylor series of rational motions: a rotor's e = v/w is a step of the algorithm with moments that
// follow from it linearly.  C = ½ |Π|², G is the kinetic energy less a C, s and p are the sum and
// the product of the d_j.  In H and 1/J_j themselves there are fewer terms, which cancel where
// bodies are thin: by all digits of a double where one moment is 1e-8 of the others.
inline constexpr std::array<Term, 4> scale2{
    {{0, {0, 0, 1}, 1, 6}, {0, {2, 0, 0}, -1, 2}, {1, {0, 1, 0}, -1, 3}, {1, {1, 0, 0}, -1, 1}}};
inline constexpr std::array<Term, 10> scale4{{{0, {0, 0, 2}, 1, 30},
                                              {0, {2, 0, 1}, -1, 12},
                                              {0, {4, 0, 0}, 1, 12},
                                              {1, {0, 1, 1}, -1, 30},
                                              {1, {2, 1, 0}, 1, 6},
                                              {1, {3, 0, 0}, 1, 3},
                                              {2, {0, 0, 1}, -1, 60},
                                              {2, {0, 2, 0}, 1, 30},
                                              {2, {1, 1, 0}, 1, 6},
                                              {2, {2, 0, 0}, 1, 4}}};
inline constexpr std::array<Term, 19> scale6{{{0, {0, 0, 3}, 17, 2520},
                                              {0, {2, 0, 2}, -1, 60},
                                              {0, {4, 0, 1}, 1, 72},
                                              {0, {6, 0, 0}, -1, 180},
                                              {1, {0, 1, 2}, -1, 70},
                                              {1, {1, 0, 2}, -1, 45},
                                              {1, {2, 1, 1}, 1, 60},
                                              {1, {4, 1, 0}, -1, 36},
                                              {1, {5, 0, 0}, -1, 30},
                                              {2, {0, 0, 2}, 41, 2520},
                                              {2, {0, 2, 1}, 1, 420},
                                              {2, {2, 0, 1}, -1, 30},
                                              {2, {2, 2, 0}, -1, 60},
                                              {2, {3, 1, 0}, -1, 18},
                                              {2, {4, 0, 0}, -1, 24},
                                              {3, {0, 1, 1}, 1, 630},
                                              {3, {0, 3, 0}, -1, 630},
                                              {3, {1, 0, 1}, 1, 30},
                                              {3, {1, 2, 0}, -1, 90}}};
inline constexpr std::array<Term, 35> scale8{
    {{0, {0, 0, 4}, 31, 22680}, {0, {2, 0, 3}, -17, 5040}, {0, {4, 0, 2}, 1, 360},
     {0, {6, 0, 1}, -1, 1080},  {0, {8, 0, 0}, 1, 5040},   {1, {0, 1, 3}, -11, 3240},
     {1, {1, 0, 3}, -1, 315},   {1, {2, 1, 2}, 1, 140},    {1, {3, 0, 2}, 1, 135},
     {1, {4, 1, 1}, -1, 360},   {1, {6, 1, 0}, 1, 540},    {1, {7, 0, 0}, 1, 630},
     {2, {0, 0, 3}, 1, 2520},   {2, {0, 2, 2}, 13, 3780},  {2, {1, 1, 2}, 1, 105},
     {2, {2, 0, 2}, 1, 630},    {2, {2, 2, 1}, -1, 840},   {2, {4, 0, 1}, 1, 180},
     {2, {4, 2, 0}, 1, 360},    {2, {5, 1, 0}, 1, 180},    {2, {6, 0, 0}, 1, 360},
     {3, {0, 1, 2}, -11, 1890}, {3, {0, 3, 1}, -1, 11340}, {3, {1, 0, 2}, -1, 45},
     {3, {2, 1, 1}, -2, 315},   {3, {2, 3, 0}, 1, 1260},   {3, {3, 0, 1}, -1, 90},
     {3, {3, 2, 0}, 1, 270},    {4, {0, 0, 2}, 17, 5040},  {4, {0, 2, 1}, -1, 15120},
     {4, {0, 4, 0}, 1, 22680},  {4, {1, 1, 1}, 1, 420},    {4, {1, 3, 0}, 1, 2520},
     {4, {2, 0, 1}, -1, 80},    {4, {2, 2, 0}, 1, 240}}};
inline constexpr std::array<Term, 3> shift2{
    {{0, {3, 0, 0}, -1, 3}, {1, {0, 0, 1}, 1, 6}, {1, {2, 0, 0}, -1, 2}}};
inline constexpr std::array<Term, 6> shift4{{{0, {5, 0, 0}, 1, 30},
                                             {1, {0, 0, 2}, -1, 60},
                                             {1, {4, 0, 0}, 1, 12},
                                             {2, {0, 1, 1}, -1, 60},
                                             {2, {1, 0, 1}, -1, 6},
                                             {2, {2, 1, 0}, -1, 12}}};
inline constexpr std::array<Term, 13> shift6{{{0, {7, 0, 0}, -1, 630},
                                              {1, {0, 0, 3}, 1, 1260},
                                              {1, {6, 0, 0}, -1, 180},
                                              {2, {0, 1, 2}, 13, 2520},
                                              {2, {1, 0, 2}, 2, 45},
                                              {2, {2, 1, 1}, 1, 30},
                                              {2, {3, 0, 1}, 1, 18},
                                              {2, {4, 1, 0}, 1, 72},
                                              {3, {0, 0, 2}, -13, 1260},
                                              {3, {0, 2, 1}, 1, 1260},
                                              {3, {1, 1, 1}, -1, 90},
                                              {3, {2, 0, 1}, 1, 20},
                                              {3, {2, 2, 0}, -1, 60}}};
inline constexpr std::array<Term, 24> shift8{
    {{0, {9, 0, 0}, 1, 22680}, {1, {0, 0, 4}, -1, 45360}, {1, {8, 0, 0}, 1, 5040},
     {2, {0, 1, 3}, -1, 1512}, {2, {1, 0, 3}, -2, 315},   {2, {2, 1, 2}, -2, 315},
     {2, {3, 0, 2}, -2, 135},  {2, {4, 1, 1}, -1, 180},   {2, {5, 0, 1}, -1, 180},
     {2, {6, 1, 0}, -1, 1080}, {3, {0, 0, 3}, 97, 22680}, {3, {0, 2, 2}, -1, 1512},
     {3, {1, 1, 2}, 1, 315},   {3, {2, 0, 2}, -1, 63},    {3, {2, 2, 1}, 2, 315},
     {3, {3, 1, 1}, 1, 270},   {3, {4, 0, 1}, -1, 120},   {3, {4, 2, 0}, 1, 360},
     {4, {0, 1, 2}, -1, 7560}, {4, {0, 3, 1}, -1, 45360}, {4, {1, 0, 2}, 11, 840},
     {4, {1, 2, 1}, -1, 280},  {4, {2, 1, 1}, 11, 840},   {4, {2, 3, 0}, -17, 5040}}};

/// Σ of the terms, of degree k in G and C.
template <class S, std::size_t terms>
[[nodiscard]] constexpr S sum(const std::array<Term, terms>& series, std::size_t k, const S& energy,
                              const S& casimir, const std::array<S, 3>& rest) noexcept {
  S result(0);
  for (const Term& term : series) {
    S value =
        S(term.over) / S(term.under) * power(energy, term.energy) * power(casimir, k - term.energy);
    for (std::size_t j = 0; j < 3; ++j) value = value * power(rest[j], term.rest[j]);
    result = result + value;
  }
  return result;
}

/// Moments of inertia, kg m², with their differences, whose digits they lack where they are alike.
template <class S>
struct Moments {
  std::array<S, 3> values;
  std::array<S, 3> differences;  ///< J₃ − J₂, J₁ − J₃, J₂ − J₁
};

/// The number of the moment that is neither the largest nor the smallest.
template <class S>
[[nodiscard]] constexpr std::size_t middle_of(const std::array<S, 3>& moments) noexcept {
  const auto& [one, two, three] = moments;
  if ((two <= one) == (one <= three)) return 0;
  return (three <= two) == (two <= one) ? 1 : 2;
}

/// The moments with which a step of h is of the given order, for a body of these moments (kg m²)
/// that turns freely with angular momentum `angular` (kg m²/s, principal frame).
template <int order, class S>
[[nodiscard]] constexpr Moments<S> modified_moments(const std::array<S, 3>& moments,
                                                    const std::array<S, 3>& angular,
                                                    const S& h) noexcept {
  static_assert(order == 2 || order == 4 || order == 6 || order == 8 || order == 10);
  const S unit = scalar::max_abs(moments[0], moments[1], moments[2]);
  const S middle = moments[middle_of(moments)];
  const S a = unit / middle;
  std::array<S, 3> d{};
  S sum_of_d(0);
  S energy(0);
  S casimir(0);
  for (std::size_t j = 0; j < 3; ++j) {
    d[j] = (unit / moments[j]) * ((middle - moments[j]) / middle);
    const S x = angular[j] * (h / unit);
    sum_of_d = sum_of_d + d[j];
    casimir = casimir + S(0.5) * x * x;
    energy = energy + S(0.5) * d[j] * x * x;
  }
  // One of the three d_j is 0.
  const std::array<S, 3> rest{a, sum_of_d, d[0] * d[1] + d[1] * d[2] + d[2] * d[0]};
  S scale(0);
  S shift(0);
  const auto add = [&](std::size_t k, const auto& scales, const auto& shifts) {
    scale = scale + sum(scales, k, energy, casimir, rest);
    shift = shift + sum(shifts, k, energy, casimir, rest);
  };
  if constexpr (order >= 10) add(4, scale8, shift8);
  if constexpr (order >= 8) add(3, scale6, shift6);
  if constexpr (order >= 6) add(2, scale4, shift4);
  if constexpr (order >= 4) add(1, scale2, shift2);
  scale = S(1) + scale;
  Moments<S> result{};
  for (std::size_t j = 0; j < 3; ++j) result.values[j] = unit / (a + shift + scale * d[j]);
  for (std::size_t j = 0; j < 3; ++j) {
    const std::size_t k = (j + 1) % 3;
    const std::size_t l = (j + 2) % 3;
    result.differences[j] = result.values[k] * (result.values[l] / unit) * (scale * (d[k] - d[l]));
  }
  return result;
}

/// Steps of one body.
template <class S>
class Rotation {
 public:
  /// With these moments, modified or not.
  template <class Wide>
  constexpr void set_moments(const Moments<Wide>& moments) noexcept {
    for (std::size_t j = 0; j < 3; ++j) {
      moments_[j] = static_cast<S>(moments.values[j]);
      differences_[j] = static_cast<S>(moments.differences[j]);
    }
  }

  /// The next step is from another state, to which the last steps do not point.
  constexpr void forget() noexcept { known_ = 0; }

  /// The rotation of a step of h ≠ 0 and what it adds to Π; whether there is one.
  ///
  /// With e = v/w of its rotor w + v it solves (1 + |e|²) h Π/2 = J e + e × J e, by Newton's method
  /// from where the last steps point to.
  [[nodiscard]] constexpr bool step(const std::array<S, 3>& angular, const S& h,
                                    RotorIncrement<S, 3>& rotor,
                                    std::array<S, 3>& change) noexcept {
    const S half = S(0.5) * h;
    const std::array<S, 3> a{half * angular[0], half * angular[1], half * angular[2]};
    const auto& [j1, j2, j3] = moments_;
    const auto& [d1, d2, d3] = differences_;
    // Newton's errors are squared: what comes after a change this small is rounding.
    const S enough = S(0.0625) * scalar::sqrt(scalar::Limits<S>::epsilon());
    const bool goes_on = known_ > 0 && h == step_;
    auto [x, y, z] = goes_on ? guess() : std::array<S, 3>{a[0] / j1, a[1] / j2, a[2] / j3};
    S square(0);
    bool found = false;
    for (int i = 0; i < 40 && !found; ++i) {
      square = hamotor::dot(x, x, y, y, z, z);
      const S n = S(1) + square;
      const S f = hamotor::dot(j1, x, d1 * y, z) - n * a[0];
      const S g = hamotor::dot(j2, y, d2 * z, x) - n * a[1];
      const S k = hamotor::dot(j3, z, d3 * x, y) - n * a[2];
      const S a1 = S(-2) * a[0];
      const S a2 = S(-2) * a[1];
      const S a3 = S(-2) * a[2];
      const S m11 = mul_add(a1, x, j1);
      const S m12 = mul_add(d1, z, a1 * y);
      const S m13 = mul_add(d1, y, a1 * z);
      const S m21 = mul_add(d2, z, a2 * x);
      const S m22 = mul_add(a2, y, j2);
      const S m23 = mul_add(d2, x, a2 * z);
      const S m31 = mul_add(d3, y, a3 * x);
      const S m32 = mul_add(d3, x, a3 * y);
      const S m33 = mul_add(a3, z, j3);
      const S c11 = mul_add(m22, m33, -m23 * m32);
      const S c12 = mul_add(m23, m31, -m21 * m33);
      const S c13 = mul_add(m21, m32, -m22 * m31);
      const S c21 = mul_add(m13, m32, -m12 * m33);
      const S c22 = mul_add(m11, m33, -m13 * m31);
      const S c23 = mul_add(m12, m31, -m11 * m32);
      const S c31 = mul_add(m12, m23, -m13 * m22);
      const S c32 = mul_add(m13, m21, -m11 * m23);
      const S c33 = mul_add(m11, m22, -m12 * m21);
      const S inverse = S(1) / hamotor::dot(m11, c11, m12, c12, m13, c13);
      const S by_x = inverse * hamotor::dot(c11, f, c21, g, c31, k);
      const S by_y = inverse * hamotor::dot(c12, f, c22, g, c32, k);
      const S by_z = inverse * hamotor::dot(c13, f, c23, g, c33, k);
      x = x - by_x;
      y = y - by_y;
      z = z - by_z;
      found = scalar::max_abs(by_x, by_y, by_z) <= enough * scalar::max_abs(x, y, z);
    }
    remember({x, y, z}, h);
    square = hamotor::dot(x, x, y, y, z, z);
    const S root = scalar::sqrt(S(1) + square);
    const S w = S(1) / root;
    rotor = {-square * w / (S(1) + root), {w * x, w * y, w * z}};
    // Π turned back by the rotor, Π − (4/h) w² e × J e: by component, so that a momentum about an
    // axis of little inertia keeps its digits beside larger ones.
    const S by = S(-4) * w * w / h;
    change = {by * (d1 * (y * z)), by * (d2 * (z * x)), by * (d3 * (x * y))};
    return found;
  }

 private:
  /// By the polynomial through the last steps.
  [[nodiscard]] constexpr std::array<S, 3> guess() const noexcept {
    std::array<S, 3> e{};
    for (std::size_t j = 0; j < 3; ++j) {
      const auto& [one, two, three] = last_[j];
      e[j] = known_ < 2 ? one : known_ < 3 ? S(2) * one - two : S(3) * (one - two) + three;
    }
    return e;
  }

  constexpr void remember(const std::array<S, 3>& e, const S& h) noexcept {
    known_ = known_ > 0 && h == step_ ? known_ + (known_ < 3 ? 1 : 0) : 1;
    step_ = h;
    for (std::size_t j = 0; j < 3; ++j) last_[j] = {e[j], last_[j][0], last_[j][1]};
  }

  std::array<S, 3> moments_{};
  std::array<S, 3> differences_{};
  std::array<std::array<S, 3>, 3> last_{};  ///< components of e, the last one first
  int known_ = 0;
  S step_{};
};

/// A system whose free rotations are these steps, for `Splitting`.
template <RigidSystem System>
class FreelyStepped {
 public:
  using Group = typename System::Group;
  using Scalar = typename System::Scalar;
  static constexpr std::size_t bodies = System::bodies;
  static constexpr bool has_forque = System::has_forque;
  static constexpr bool takes_split_steps = !has_forque;
  using Motors = decltype(StateOf<System>::motors);
  using Momenta = decltype(StateOf<System>::momenta);
  using Rotations = std::array<Rotation<Scalar>, bodies>;

  constexpr FreelyStepped(const System& system, Rotations& rotations, bool& found) noexcept
      : system_(system), rotations_(rotations), found_(found) {}

  [[nodiscard]] constexpr Scalar energy(const StateOf<System>& state) const noexcept {
    return system_.energy(state);
  }
  [[nodiscard]] constexpr auto rate(const StateOf<System>& state) const noexcept {
    return system_.rate(state);
  }
  [[nodiscard]] constexpr Momenta forque(const Motors& motors) const noexcept
    requires(has_forque)
  {
    return system_.forque(motors);
  }

  [[nodiscard]] constexpr ChangeOf<FreelyStepped> free_change(const Motors& motors,
                                                              const Momenta& momenta,
                                                              const Scalar& h) const noexcept {
    ChangeOf<FreelyStepped> result{};
    system_.for_each_body([&](auto i, const auto& body) {
      constexpr std::size_t rotations = Space<Group>::rotations;
      if constexpr (rotations == 1) {
        const auto change = body.free_change(motors[i], momenta[i], h);
        result.motors[i] = change.motor;
        result.momenta[i] = change.momentum;
      } else {
        const auto mu = momenta[i].components();
        const auto angular = first<rotations>(mu);
        RotorIncrement<Scalar, rotations> rotor{};
        std::array<Scalar, rotations> turned{};
        found_ = rotations_[i].step(angular, h, rotor, turned) && found_;
        if constexpr (Space<Group>::translates) {
          const auto p = rest<rotations>(mu);
          auto way = p;
          for (auto& x : way) x = x * (h / body.mass());
          const auto moved = Space<Group>::translation_change(motors[i], way);
          result.motors[i] = moved + Space<Group>::rotation_change(motors[i] + moved, rotor);
          result.momenta[i] =
              Momenta::value_type::from(joined(turned, turned_back_change(rotor, p)));
        } else {
          result.motors[i] = Space<Group>::rotation_change(motors[i], rotor);
          result.momenta[i] = Momenta::value_type::from(turned);
        }
      }
    });
    return result;
  }

  /// Where nothing acts a free motion is the whole step.
  template <class Weights>
  [[nodiscard]] constexpr ChangeOf<FreelyStepped> split_step(const Motors& motors,
                                                             const Momenta& momenta,
                                                             const Scalar& h,
                                                             const Weights&) const noexcept
    requires(takes_split_steps)
  {
    return free_change(motors, momenta, h);
  }

 private:
  const System& system_;
  Rotations& rotations_;
  bool& found_;
};

[[nodiscard]] constexpr std::string_view name_of(int order) noexcept {
  constexpr std::array<std::string_view, 5> names{
      "moser_veselov2", "moser_veselov4", "moser_veselov6", "moser_veselov8", "moser_veselov10"};
  return names[static_cast<std::size_t>(order / 2 - 1)];
}

}  // namespace detail::moser_veselov

/// The discrete Moser–Veselov algorithm for rigid bodies, of order 2 with kicks for potentials
/// (then it is RATTLE) or, for free bodies, of order 4 to 10 by modified moments of inertia.
///
/// One forque a step and, for every body, one quadratic equation in three unknowns, by Newton's
/// method.  Symmetric; every rotation is a coadjoint motion, so that Casimirs of free bodies and
/// the spatial momentum are constant but for rounding, whatever the step, and energy errors are
/// bounded. Order 2 is symplectic.  Above order 2 the moments depend on the state by what it
/// conserves, and the motion of the momenta is a Poisson map, but that of the whole state is not
/// symplectic. A step that turns a body too far for the equation to have a solution (h Π/2J of
/// about 1) fails.  A state that is not the one the last step left starts anew.
template <RigidSystem System, int nominal_order, Summation summation = Summation::compensated>
  requires(nominal_order == 2 || FreeSystem<System>)
class MoserVeselov {
  using S = typename System::Scalar;
  using Stepped = detail::moser_veselov::FreelyStepped<System>;
  static constexpr std::size_t rotations = Space<typename System::Group>::rotations;

 public:
  static constexpr int order = nominal_order;
  static constexpr std::string_view name = detail::moser_veselov::name_of(nominal_order);
  /// Whether sums over steps are compensated.
  static constexpr bool compensated = summation == Summation::compensated;

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    failure_ = Failure::none;
    if (h == S(0)) return;  // whose moments and change are quotients of zeros
    const bool goes_on = state == delivered_;
    if (!goes_on) {
      for (auto& rotation : rotations_) rotation.forget();
      splitting_.forget();
    }
    if (!(set_up_for_ == h && (order == 2 || goes_on))) set_up(system, state, h);
    bool found = true;
    splitting_.go_on(Stepped(system, rotations_, found), state, t, h);
    if (!found) {
      failure_ = Failure::no_convergence;
      for (auto& momentum : state.momenta) momentum = (S(0) / S(0)) * momentum;
    }
    delivered_ = state;
  }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return splitting_.drift(); }

  /// Why the last step failed.
  [[nodiscard]] constexpr Failure failure() const noexcept { return failure_; }

 private:
  constexpr void set_up(const System& system, const StateOf<System>& state, const S& h) noexcept {
    set_up_for_ = h;
    if constexpr (rotations == 3) {
      using Wide = typename detail::SetUpScalar<S>::type;
      system.for_each_body([&](auto i, const auto& body) {
        const auto angular = detail::first<rotations>(state.momenta[i].components());
        std::array<Wide, 3> moments{};
        std::array<Wide, 3> momentum{};
        for (std::size_t j = 0; j < 3; ++j) {
          moments[j] = Wide(body.moments()[j]);
          momentum[j] = Wide(angular[j]);
        }
        rotations_[i].set_moments(
            detail::moser_veselov::modified_moments<order>(moments, momentum, Wide(h)));
      });
    }
  }

  typename Stepped::Rotations rotations_{};
  Splitting<Stepped, 2, summation> splitting_;
  StateOf<System> delivered_{};
  S set_up_for_{};  ///< h; 0 before the first step
  Failure failure_ = Failure::none;
};

}  // namespace hamotor
