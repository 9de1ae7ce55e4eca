// The compiled scene's C ABI, version 2: a scene as a type becomes a shared library.
//
// A scene is a struct with the members listed in `SceneDefinition`; HAMOTOR_SCENE(MyScene) defines
// the C functions for it.  States cross the boundary as doubles in the user's body frames; inside,
// bodies stand in their principal frames.  Nothing throws across it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <new>
#include <sstream>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <variant>
#include <vector>

#include "hamotor/events.hpp"
#include "hamotor/methods.hpp"
#include "hamotor/number_text.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/space.hpp"
#include "hamotor/state.hpp"
#include "hamotor/systems.hpp"

namespace hamotor {

/// What a conserved quantity is computed from.
enum class Quantity {
  energy,            ///< H
  energy_balance,    ///< H less the work done by time and by applied forques
  momentum,          ///< a component of one body's momentum, which has a column anyway
  spatial_momentum,  ///< a combination of the total momentum in the world frame
  p_squared,         ///< |P|² of one body, a Casimir
  p_dot_pi,          ///< P·Π of one body, a Casimir
  pi_squared,        ///< |Π|² of one body, a Casimir of the rotations
  own                ///< one of `Scene::quantities`
};

/// A quantity that the exact motion of a scene keeps constant.
template <class G>
struct Conserved {
  Quantity quantity;
  std::string_view name;  ///< of its column: energy, spatial_momentum.e12, NAME.casimir.p_squared
  std::string_view unit;  ///< of its column
  std::string_view description;  ///< in words
  std::size_t body = 0;          ///< whose Casimir it is
  std::array<double, static_cast<std::size_t>(G::dimension)> coefficients{};  ///< of a momentum
  /// Columns over whose Euclidean norm at the start a relative error is taken; empty names end
  /// them.
  std::array<std::string_view, static_cast<std::size_t>(G::dimension)> norm{};
  double scale = 0;       ///< what to divide by where there are none; 0: no natural scale
  std::size_t index = 0;  ///< among `Scene::quantities`
};

/// A function of the state whose zeros a run reports: one of `Scene::event_values`.
struct Event {
  std::string_view name;
  Crossing direction = Crossing::both;
  bool stops = false;  ///< whether the run is over there
};

/// A scene with events: `event_values(state, t)` are the functions, of the user's body frames.
template <class Scene>
concept EventfulScene = requires {
  { Scene::events.size() } -> std::convertible_to<std::size_t>;  // std::array of Event
};

/// A scene that says itself where a body is: `place(i, motor)` are those of body i in the columns
/// that `place_names` and `place_units` describe, and it has units for its motors and momenta.
template <class Scene>
concept PlacedScene = requires {
  { Scene::place_names.size() } -> std::convertible_to<std::size_t>;
  { Scene::place_units.size() } -> std::convertible_to<std::size_t>;
  { Scene::motor_units.size() } -> std::convertible_to<std::size_t>;
  { Scene::momentum_units.size() } -> std::convertible_to<std::size_t>;
};

/// What a compiled scene says about itself, as a type.
template <class Scene>
concept SceneDefinition =
    requires {
      typename Scene::Group;
      typename Scene::Scalar;
      { Scene::name } -> std::convertible_to<std::string_view>;
      { Scene::kernels } -> std::convertible_to<std::string_view>;   // "generated" or "generic"
      { Scene::bodies.size() } -> std::convertible_to<std::size_t>;  // std::array of names
      {
        Scene::frames.size()
      } -> std::convertible_to<std::size_t>;  // std::array of N: motors from
                                              // principal to body frame
      { Scene::conserved.size() } -> std::convertible_to<std::size_t>;  // std::array of Conserved
      Scene::system;
    } && HamiltonianSystem<std::remove_cvref_t<decltype(Scene::system)>> &&
    std::remove_cvref_t<decltype(Scene::system)>::bodies == Scene::bodies.size() &&
    std::remove_cvref_t<decltype(Scene::system)>::bodies == Scene::frames.size();

namespace scene {

using hamotor::is_finite;

template <class Scene>
using SystemOf = std::remove_cvref_t<decltype(Scene::system)>;

/// Whether H changes by itself along the motion, so that a run has an account of the work done.
template <class Scene>
inline constexpr bool is_powered = requires { &SystemOf<Scene>::power; };

template <class Scene>
[[nodiscard]] constexpr std::size_t event_count() noexcept {
  if constexpr (EventfulScene<Scene>) {
    return Scene::events.size();
  } else {
    return 0;
  }
}

template <class Scene>
inline constexpr std::size_t motor_size =
    Scene::Group::template Element<typename Scene::Scalar>::size;
template <class Scene>
inline constexpr auto momentum_size = static_cast<std::size_t>(Scene::Group::dimension);
template <class Scene>
inline constexpr std::size_t body_size = motor_size<Scene> + momentum_size<Scene>;
template <class Scene>
[[nodiscard]] constexpr std::size_t place_size() noexcept {
  if constexpr (PlacedScene<Scene>) {
    return Scene::place_names.size();
  } else {
    return Space<typename Scene::Group>::dimension;
  }
}

/// Whether a quantity has a column of its own: one component of the spatial momentum has one
/// anyway.
template <class G>
[[nodiscard]] constexpr bool has_own_column(const Conserved<G>& conserved) noexcept {
  if (conserved.quantity == Quantity::energy) return false;
  if (conserved.quantity == Quantity::momentum) return false;
  if (conserved.quantity != Quantity::spatial_momentum) return true;
  std::size_t terms = 0;
  bool unit = true;
  for (const double c : conserved.coefficients) {
    if (c != 0) {
      ++terms;
      unit = unit && c == 1;
    }
  }
  return terms != 1 || !unit;
}

template <class Scene>
[[nodiscard]] constexpr std::size_t columns() noexcept {
  std::size_t count = 1 + Scene::bodies.size() * (body_size<Scene> + place_size<Scene>()) + 1 +
                      (is_powered<Scene> ? 1 : 0) + momentum_size<Scene>;
  for (const auto& conserved : Scene::conserved) count += has_own_column(conserved) ? 1U : 0U;
  return count;
}

/// A blade that holds e0 measures lengths.
[[nodiscard]] constexpr bool is_ideal(std::string_view blade) noexcept {
  return blade.size() > 1 && blade[1] == '0';
}

/// `text` as a JSON string.
[[nodiscard]] inline std::string json_string(std::string_view text) {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string result = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (code < 0x20) {
      result += "\\u00";
      result += digits[code >> 4U];
      result += digits[code & 15U];
    } else {
      result += c;
    }
  }
  return result + '"';
}

/// A JSON array of the texts that `items` appends.
class JsonList {
 public:
  void add(const std::string& item) { text_ += (text_.empty() ? "" : ", ") + item; }
  [[nodiscard]] std::string text() const { return '[' + text_ + ']'; }

 private:
  std::string text_;
};

template <class Names>
[[nodiscard]] std::string json_strings(const Names& names) {
  JsonList list;
  for (const auto& name : names) list.add(json_string(name));
  return list.text();
}

[[nodiscard]] inline std::string compiler() {
#if defined(__clang__)
  return "clang++ " __clang_version__;
#elif defined(__GNUC__)
  return "g++ " + std::to_string(__GNUC__) + '.' + std::to_string(__GNUC_MINOR__) + '.' +
         std::to_string(__GNUC_PATCHLEVEL__);
#else
  return "unknown";
#endif
}

template <class S>
[[nodiscard]] constexpr std::string_view scalar_name() noexcept {
  if constexpr (std::is_same_v<S, float>) {
    return "float";
  } else if constexpr (std::is_same_v<S, double>) {
    return "double";
  } else if constexpr (std::is_same_v<S, long double>) {
    return "long double";
#ifdef HAMOTOR_HAS_QUAD
  } else if constexpr (std::is_same_v<S, scalar::Quad>) {
    return "quad";
#endif
  } else if constexpr (requires(S x) { x.text(); }) {
    return "mpfr";
  } else {
    return "custom";
  }
}

/// A number as JSON, with all digits.
[[nodiscard]] inline std::string number(double x) {
  std::array<char, 32> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.17g", x);
  return {text.data(), static_cast<std::size_t>(length)};
}

template <class Scene>
[[nodiscard]] std::string columns_json() {
  using Group = typename Scene::Group;
  constexpr auto& blades = Group::template Element<typename Scene::Scalar>::names;
  JsonList list;
  const auto add = [&](std::string_view name, std::string_view unit, std::string_view frame,
                       std::string_view body) {
    list.add("{\"name\": " + json_string(name) + ", \"unit\": " + json_string(unit) +
             ", \"frame\": " + json_string(frame) + ", \"body\": " + json_string(body) + '}');
  };
  const auto momentum_unit = [](std::size_t k) -> std::string_view {
    if constexpr (PlacedScene<Scene>) {
      return Scene::momentum_units[k];
    } else {
      return k < Space<Group>::rotations ? "kg m^2/s" : "kg m/s";
    }
  };
  const auto motor_unit = [&](std::size_t k) -> std::string_view {
    if constexpr (PlacedScene<Scene>) {
      return Scene::motor_units[k];
    } else {
      return is_ideal(blades[k]) ? "m" : "1";
    }
  };
  add("t", "s", "", "");
  for (const std::string_view body : Scene::bodies) {
    const std::string name(body);
    for (std::size_t k = 0; k < blades.size(); ++k) {
      add(name + ".motor." + std::string(blades[k]), motor_unit(k), "body to world", body);
    }
    for (std::size_t k = 0; k < Group::generators.size(); ++k) {
      add(name + ".momentum." + std::string(Group::generators[k]), momentum_unit(k), "body", body);
    }
    for (std::size_t k = 0; k < place_size<Scene>(); ++k) {
      if constexpr (PlacedScene<Scene>) {
        add(name + '.' + std::string(Scene::place_names[k]), Scene::place_units[k], "world", body);
      } else {
        add(name + ".position." + "xyz"[k], "m", "world", body);
      }
    }
  }
  add("energy", "J", "", "");
  if constexpr (is_powered<Scene>) add("work", "J", "", "");
  for (std::size_t k = 0; k < Group::generators.size(); ++k) {
    add("spatial_momentum." + std::string(Group::generators[k]), momentum_unit(k), "world", "");
  }
  for (const auto& conserved : Scene::conserved) {
    if (!has_own_column(conserved)) continue;
    const bool momentum = conserved.quantity == Quantity::spatial_momentum;
    add(conserved.name, conserved.unit, momentum ? "world" : "body",
        momentum || conserved.quantity == Quantity::energy_balance ? std::string_view{}
                                                                   : Scene::bodies[conserved.body]);
  }
  return list.text();
}

template <class Scene>
[[nodiscard]] std::string conserved_json() {
  JsonList list;
  for (const auto& conserved : Scene::conserved) {
    JsonList norm;
    for (const std::string_view column : conserved.norm) {
      if (!column.empty()) norm.add(json_string(column));
    }
    list.add("{\"name\": " + json_string(conserved.name) +
             ", \"column\": " + json_string(conserved.name) + ", \"norm\": " + norm.text() +
             ", \"scale\": " + number(conserved.scale) +
             ", \"description\": " + json_string(conserved.description) + '}');
  }
  return list.text();
}

/// The methods that a library is compiled with, a define before this header of names one space
/// apart; all if there is none.
#ifndef HAMOTOR_METHOD
#define HAMOTOR_METHOD ""
#endif
[[nodiscard]] constexpr bool is_listed(std::string_view names, std::string_view name) noexcept {
  for (std::size_t at = names.find(name); at != names.npos; at = names.find(name, at + 1)) {
    const std::size_t end = at + name.size();
    const bool starts = at == 0 || names[at - 1] == ' ';
    if (starts && (end == names.size() || names[end] == ' ')) return true;
  }
  return false;
}

template <class Method>
inline constexpr bool is_compiled =
    std::string_view(HAMOTOR_METHOD).empty() || is_listed(HAMOTOR_METHOD, Method::name);

template <class Methods, class S>
struct MethodTable;

/// The methods a scene can be run with: their names, and one run of whichever is chosen.
template <class... Method, class S>
struct MethodTable<std::tuple<Method...>, S> {
  static_assert((is_compiled<Method> || ...), "HAMOTOR_METHOD names no method of this scene");

  [[nodiscard]] static std::string json() {
    JsonList list;
    (list.add("{\"name\": " + json_string(Method::name) +
              ", \"order\": " + std::to_string(Method::order) +
              ", \"error_controlled\": " + (ErrorControlled<Method, S> ? "true" : "false") +
              ", \"compensated\": " + sums<Method>() + '}'),
     ...);
    return list.text();
  }

  template <class... Compiled>
  static std::variant<Compiled...> variant_of(const std::tuple<std::type_identity<Compiled>...>&);
  using AnyOf = decltype(variant_of(
      std::tuple_cat(std::conditional_t<is_compiled<Method>, std::tuple<std::type_identity<Method>>,
                                        std::tuple<>>{}...)));

  /// Sets `method` to the one called `name`; false if the library is compiled without it.
  [[nodiscard]] static bool choose(std::string_view name, AnyOf& method) {
    return (choose_one<Method>(name, method) || ...);
  }

  /// Gives the method a tolerance; one that is not positive, or for a method that knows none,
  /// changes nothing.
  static void set_tolerance(double tolerance, AnyOf& method) noexcept {
    std::visit(
        [&](auto& chosen) {
          if constexpr (ErrorControlled<std::remove_cvref_t<decltype(chosen)>, S>) {
            if (tolerance > 0) chosen.set_tolerance(S(tolerance));
          }
        },
        method);
  }

 private:
  /// Whether sums over steps are compensated; null where there are none.
  template <class One>
  [[nodiscard]] static std::string sums() {
    if constexpr (requires { One::compensated; }) {
      return One::compensated ? "true" : "false";
    } else {
      return "null";
    }
  }

  template <class One>
  [[nodiscard]] static bool choose_one(std::string_view name, AnyOf& method) {
    if constexpr (is_compiled<One>) {
      if (name == One::name) {
        method.template emplace<One>();
        return true;
      }
    }
    return false;
  }
};

/// The steppers, with sums as HAMOTOR_COMPENSATED asks for, a define before this header: `true` or
/// `false`; without it as is each method's own way.
#ifdef HAMOTOR_COMPENSATED
inline constexpr Summation summation_asked =
    HAMOTOR_COMPENSATED ? Summation::compensated : Summation::plain;
template <class System>
using CompiledSteppers = SteppersOf<System, summation_asked>;
#else
template <class System>
using CompiledSteppers = SteppersOf<System>;
#endif

template <class Scene>
using MethodsOf = MethodTable<CompiledSteppers<SystemOf<Scene>>, typename Scene::Scalar>;

template <class Scene>
[[nodiscard]] std::string events_json() {
  JsonList list;
  if constexpr (EventfulScene<Scene>) {
    constexpr std::array<std::string_view, 3> directions{"both", "rising", "falling"};
    for (const Event& event : Scene::events) {
      list.add("{\"name\": " + json_string(event.name) + ", \"direction\": " +
               json_string(directions[static_cast<std::size_t>(event.direction)]) +
               ", \"stops\": " + (event.stops ? "true" : "false") + '}');
    }
  }
  return list.text();
}

/// What a library that is compiled for ensembles says of them (ensemble_abi.hpp).
template <class Scene>
[[nodiscard]] std::string ensemble_json();

/// The JSON of `hamotor_describe`.
template <class Scene>
[[nodiscard]] std::string description() {
  using Group = typename Scene::Group;
#ifdef HAMOTOR_ENSEMBLE
  const std::string ensemble = ",\n \"ensemble\": " + ensemble_json<Scene>();
#else
  const std::string ensemble;
#endif
  return "{\"abi\": 2, \"scene\": " + json_string(Scene::name) +
         ", \"algebra\": " + json_string(Group::algebra) +
         ", \"group\": " + json_string(Group::name) +
         ", \"scalar\": " + json_string(scalar_name<typename Scene::Scalar>()) +
         ", \"digits\": " + std::to_string(text_digits<typename Scene::Scalar>) +
         ", \"kernels\": " + json_string(Scene::kernels) +
         ", \"compiler\": " + json_string(compiler()) +
         ", \"fma\": " + (has_fused_multiply_add ? "true" : "false") +
         ",\n \"bodies\": " + json_strings(Scene::bodies) +
         ",\n \"methods\": " + MethodsOf<Scene>::json() +
         ",\n \"motor\": " + json_strings(Group::template Element<typename Scene::Scalar>::names) +
         ",\n \"momentum\": " + json_strings(Group::generators) +
         ",\n \"columns\": " + columns_json<Scene>() +
         ",\n \"conserved\": " + conserved_json<Scene>() +
         ",\n \"events\": " + events_json<Scene>() + ensemble + "}\n";
}

/// Where the first number of a state that is not finite stands, −1 if there is none.
template <class G, std::size_t N, class S>
[[nodiscard]] constexpr std::int64_t first_not_finite(const State<G, N, S>& state) noexcept {
  std::int64_t at = 0;
  const auto is_bad = [](const S& x) { return !(x - x == S(0)); };
  for (std::size_t i = 0; i < N; ++i) {
    for (const S& x : state.motors[i].components()) {
      if (is_bad(x)) return at;
      ++at;
    }
    for (const S& x : state.momenta[i].components()) {
      if (is_bad(x)) return at;
      ++at;
    }
  }
  return -1;
}

/// The steps a method took, `calls` where it has none of its own.
template <class Method>
[[nodiscard]] std::int64_t steps_of(const Method& method, std::int64_t calls) noexcept {
  if constexpr (requires { method.steps(); }) {
    return static_cast<std::int64_t>(method.steps());
  } else {
    return calls;
  }
}

/// Why a method delivered a state that is not finite.
template <class Method>
[[nodiscard]] Failure reason_of(const Method& method) noexcept {
  const Failure said = failure_of(method);
  return said == Failure::none ? Failure::not_finite : said;
}

/// A scene's system at a moment, with its rows: of the system that is compiled, or of one with
/// other parameters.
template <class Scene>
struct Moment {
  using System = SystemOf<Scene>;
  using S = typename Scene::Scalar;
  using G = typename Scene::Group;
  using Motor = typename G::template Element<S>;
  using Momentum = typename G::template Momentum<S>;
  static constexpr std::size_t n = System::bodies;

  S time;
  StateOf<System> state;
  S work;

  /// The state in principal frames of one in the user's.
  template <class Number>
  [[nodiscard]] static StateOf<System> from_user(const Number* numbers) noexcept {
    StateOf<System> result{};
    for (std::size_t i = 0; i < n; ++i) {
      const Motor motor = Motor::from(read<motor_size<Scene>>(numbers));
      const Momentum momentum = Momentum::from(read<momentum_size<Scene>>(numbers));
      result.motors[i] = gp(motor, Scene::frames[i]);
      result.momenta[i] = Ad_star(Scene::frames[i], momentum);
    }
    return result;
  }

  /// The state in the user's body frames.
  void write_state(double* to) const noexcept {
    for (std::size_t i = 0; i < n; ++i) {
      to = write(user_motor(i).components(), to);
      to = write(user_momentum(i).components(), to);
    }
  }

  /// One row of columns.
  template <class Number>
  void write_row(const System& system, Number* row) const noexcept {
    *row++ = static_cast<Number>(time);
    std::array<Momentum, n> spatial{};
    for (std::size_t i = 0; i < n; ++i) {
      const Motor motor = user_motor(i);
      row = write(motor.components(), row);
      row = write(user_momentum(i).components(), row);
      row = write(place(system, i, motor), row);
      spatial[i] = Ad_star_inverse(state.motors[i], state.momenta[i]);
    }
    for (std::size_t i = 1; i < n; ++i) spatial[0] = spatial[0] + spatial[i];
    const auto total = spatial[0].components();
    const S h = energy(system, state, time);
    *row++ = static_cast<Number>(h);
    if constexpr (PoweredSystem<System>) *row++ = static_cast<Number>(work);
    row = write(total, row);
    for (const auto& conserved : Scene::conserved) {
      if (!has_own_column(conserved)) continue;
      *row++ = static_cast<Number>(value_of(conserved, h, total));
    }
  }

 private:
  [[nodiscard]] Motor user_motor(std::size_t i) const noexcept {
    return gp(state.motors[i], reverse(Scene::frames[i]));
  }

  [[nodiscard]] Momentum user_momentum(std::size_t i) const noexcept {
    return Ad_star_inverse(Scene::frames[i], state.momenta[i]);
  }

  [[nodiscard]] static auto place([[maybe_unused]] const System& system,
                                  [[maybe_unused]] std::size_t i, const Motor& motor) noexcept {
    if constexpr (PlacedScene<Scene>) {
      return Scene::place(i, motor);
    } else if constexpr (Space<G>::translates) {
      return sandwich(motor, typename Space<G>::template Origin<S>{}).components();
    } else {
      std::array<S, place_size<Scene>()> where{};
      system.for_each_body([&](auto k, const auto& body) {
        if (k == i) where = body.fixed_point();
      });
      return where;
    }
  }

  [[nodiscard]] static S combination(const std::array<double, momentum_size<Scene>>& coefficients,
                                     const std::array<S, momentum_size<Scene>>& total) noexcept {
    S sum(0);
    for (std::size_t k = 0; k < total.size(); ++k) {
      if (coefficients[k] != 0) sum = mul_add(S(coefficients[k]), total[k], sum);
    }
    return sum;
  }

  [[nodiscard]] S value_of(const Conserved<G>& conserved, const S& h,
                           const std::array<S, momentum_size<Scene>>& total) const noexcept {
    if (conserved.quantity == Quantity::spatial_momentum) {
      return combination(conserved.coefficients, total);
    }
    if constexpr (PoweredSystem<System>) {
      if (conserved.quantity == Quantity::energy_balance) return h - work;
    }
    if constexpr (requires { Scene::quantities(state, time); }) {
      return Scene::quantities(state, time)[conserved.index];
    } else if constexpr (PlacedScene<Scene>) {
      return S(std::numeric_limits<double>::quiet_NaN());
    } else {
      return casimir(conserved.quantity, conserved.body);
    }
  }

  [[nodiscard]] S casimir(Quantity quantity, std::size_t i) const noexcept {
    constexpr std::size_t rotations = Space<G>::rotations;
    const auto mu = state.momenta[i].components();
    const auto pi = detail::first<rotations>(mu);
    if (quantity == Quantity::pi_squared) return detail::dot(pi, pi);
    if constexpr (Space<G>::translates) {
      const auto p = detail::rest<rotations>(mu);
      if (quantity == Quantity::p_squared) return detail::dot(p, p);
      if constexpr (rotations == 3) {
        if (quantity == Quantity::p_dot_pi) return detail::dot(p, pi);
      }
    }
    return S(std::numeric_limits<double>::quiet_NaN());
  }

  template <std::size_t size, class Number>
  [[nodiscard]] static std::array<S, size> read(const Number*& from) noexcept {
    std::array<S, size> result{};
    for (S& x : result) x = static_cast<S>(*from++);
    return result;
  }

  template <class Number, std::size_t size>
  [[nodiscard]] static Number* write(const std::array<S, size>& values, Number* to) noexcept {
    for (const S& x : values) *to++ = static_cast<Number>(x);
    return to;
  }
};

/// A scene under way.
template <SceneDefinition Scene>
class Run {
  using System = SystemOf<Scene>;
  using S = typename Scene::Scalar;
  using G = typename Scene::Group;
  using Moment = scene::Moment<Scene>;
  static constexpr std::size_t n = System::bodies;

 public:
  /// Starts from `state`, user's body frames; `Number` is double or the scene's scalar.
  template <class Number>
  Run(const typename MethodsOf<Scene>::AnyOf& method, const std::type_identity_t<Number>& time,
      const std::type_identity_t<Number>& step, const Number* state) noexcept
      : method_(method), time_(S(time)), step_(S(step)), state_(Moment::from_user(state)) {}

  /// Has `advance` return early rather than try more than this many of the method's own steps in
  /// one of the run's: the next call goes on.  0, as in the beginning, for none.
  void set_patience(std::int64_t tries) noexcept {
    std::visit(
        [&](auto& method) {
          if constexpr (Patient<std::remove_cvref_t<decltype(method)>>) method.set_patience(tries);
        },
        method_);
  }

  /// Up to `steps` steps; a row after each whose index is a multiple of `every`.  Returns the steps
  /// done: fewer mean that an event happened in the last of them, that the next one failed or that
  /// it takes more than patience; the state is then the last that is good.
  [[nodiscard]] std::int64_t advance(std::int64_t steps, std::int64_t every,
                                     double* rows) noexcept {
    return std::visit([&](auto& method) { return advance_with(method, steps, every, rows); },
                      method_);
  }

  /// One row of columns.
  template <class Number>
  void observe(Number* row) const noexcept {
    moment().write_row(Scene::system, row);
  }

  /// One row of columns at a time that is not the end of a step, by a part of a step from the
  /// state now; the run is left as it is.  False where that step fails.
  [[nodiscard]] bool observe_at(double time, double* row) const noexcept {
    return std::visit(
        [&](auto& method) {
          const S part = S(time) - now();
          Moment there{S(time), state_, S(0)};
          if constexpr (requires {
                          method.look(Scene::system, state_, part, step_, part, there.work);
                        }) {
            if (scalar::abs(part) <= scalar::abs(step_)) {
              there.state = method.look(Scene::system, state_, now(), step_, part, there.work);
              return observe(there, row);
            }
          }
          auto aside = unhurried(method);
          if constexpr (requires { aside.forget(); }) {
            if (failure_ != Failure::none) aside.forget();  // the step that failed left another
          }
          go_on(aside, Scene::system, there.state, now(), part);
          there.work = work_of(aside);
          return observe(there, row);
        },
        method_);
  }

  /// One row of columns where event k happened in the last step; false where it did not.
  [[nodiscard]] bool observe_event(std::int64_t k, double* row) const noexcept {
    const auto at = static_cast<std::size_t>(k);
    if (at >= happened_.size() || !happened_[at]) return false;
    return observe(moments_[at], row);
  }

  /// The state in the user's body frames.
  void read_state(double* state) const noexcept { moment().write_state(state); }

  [[nodiscard]] const Drift<S>& drift() const noexcept { return drift_; }

  /// Steps taken so far: the method's own where it chooses them.
  [[nodiscard]] std::int64_t steps() const noexcept {
    return std::visit([&](const auto& method) { return steps_of(method, index_); }, method_);
  }

  /// Why the run stopped, and the first component of the refused state that is not finite, as
  /// `read_state` counts; −1 where all are.
  [[nodiscard]] Failure failure(std::int64_t& component) const noexcept {
    component = component_;
    return failure_;
  }

 private:
  [[nodiscard]] static bool observe(const Moment& moment, double* row) noexcept {
    if (!is_finite(moment.state)) return false;
    moment.write_row(Scene::system, row);
    return true;
  }

  template <class Method>
  [[nodiscard]] std::int64_t advance_with(Method& method, std::int64_t steps, std::int64_t every,
                                          double* rows) noexcept {
    if (failure_ != Failure::none) return 0;
    StateOf<System> state = state_;
    for (std::int64_t done = 0; done < steps; ++done) {
      [[maybe_unused]] const auto before = if_eventful(method);
      go_on(method, Scene::system, state, now(), step_);
      if constexpr (Patient<Method>) {
        if (method.paused()) return done;
      }
      if (!is_finite(state)) {
        failure_ = reason_of(method);
        component_ = first_not_finite(state);
        return done;
      }
      if (method.drift().largest > S(largest_defect)) {
        failure_ = Failure::left_group;
        return done;
      }
      bool eventful = false;
      if constexpr (EventfulScene<Scene>) eventful = note_events(before, state);
      state_ = state;
      drift_ = method.drift();
      if constexpr (PoweredSystem<System>) work_ = method.work();
      ++index_;
      if (rows != nullptr && every > 0 && index_ % every == 0) {
        observe(rows);
        rows += columns<Scene>();
      }
      if (eventful) return done + 1;
    }
    return steps;
  }

  template <class Method>
  [[nodiscard]] static S work_of([[maybe_unused]] const Method& method) noexcept {
    if constexpr (PoweredSystem<System>) {
      return method.work();
    } else {
      return S(0);
    }
  }

  /// The method as it is, but for steps to their end.
  template <class Method>
  [[nodiscard]] static Method unhurried(Method method) noexcept {
    if constexpr (Patient<Method>) method.set_patience(0);
    return method;
  }

  template <class Method>
  [[nodiscard]] static auto if_eventful([[maybe_unused]] const Method& method) noexcept {
    if constexpr (EventfulScene<Scene>) {
      return unhurried(method);
    } else {
      return 0;
    }
  }

  [[nodiscard]] static auto event_values(const StateOf<System>& state, const S& t) noexcept {
    StateOf<System> users = state;
    for (std::size_t i = 0; i < n; ++i) {
      users.motors[i] = gp(state.motors[i], reverse(Scene::frames[i]));
      users.momenta[i] = Ad_star_inverse(Scene::frames[i], state.momenta[i]);
    }
    return Scene::event_values(users, t);
  }

  /// Finds the events of the step that `before` takes from the state now to `after`.
  template <class Method>
  [[nodiscard]] bool note_events(const Method& before, const StateOf<System>& after) noexcept {
    bool any = false;
    const S start = now();
    const auto values_before = event_values(state_, start);
    const auto values_after =
        event_values(after, mul_add(static_cast<S>(index_ + 1), step_, time_));
    for (std::size_t k = 0; k < Scene::events.size(); ++k) {
      happened_[k] = crosses(Scene::events[k].direction, values_before[k], values_after[k]);
      if (!happened_[k]) continue;
      any = true;
      const auto value = [&](const StateOf<System>& state, const S& t) {
        return event_values(state, t)[k];
      };
      const S part = locate(Scene::system, before, state_, start, step_, value, values_before[k],
                            values_after[k]);
      Method method = before;
      StateOf<System> state = state_;
      go_on(method, Scene::system, state, start, part);
      moments_[k] = {start + part, state, work_of(method)};
    }
    return any;
  }

  [[nodiscard]] S now() const noexcept { return mul_add(static_cast<S>(index_), step_, time_); }

  [[nodiscard]] Moment moment() const noexcept { return {now(), state_, work_}; }

  mutable typename MethodsOf<Scene>::AnyOf method_;  ///< a look ahead keeps what it has found
  S time_;
  S step_;
  StateOf<System> state_{};
  Drift<S> drift_;
  S work_{};
  std::int64_t index_ = 0;
  std::array<bool, event_count<Scene>()> happened_{};
  std::array<Moment, event_count<Scene>()> moments_{};
  std::int64_t component_ = -1;
  Failure failure_ = Failure::none;
};

template <class Scene>
struct RunType {
  using type = Run<Scene>;
};
template <class Scene>
  requires requires { typename Scene::Run; }
struct RunType<Scene> {
  using type = typename Scene::Run;
};

/// What runs a scene: its own `Run` if it names one (another representation), or `scene::Run`.
template <class Scene>
using RunOf = typename RunType<Scene>::type;

/// `hamotor_start`: NULL for a method that is unknown or not compiled, or without memory.
template <class Scene>
[[nodiscard]] void* start(const char* method, double time, double step, double tolerance,
                          const double* state) noexcept {
  typename MethodsOf<Scene>::AnyOf chosen;
  if (method == nullptr || !MethodsOf<Scene>::choose(method, chosen)) return nullptr;
  MethodsOf<Scene>::set_tolerance(tolerance, chosen);
  return new (std::nothrow) RunOf<Scene>(chosen, time, step, state);
}

/// `hamotor_start_text`: `numbers` are time, step and state as decimals, blanks between them.
template <class Scene>
[[nodiscard]] void* start(const char* method, double tolerance, const char* numbers) {
  using S = typename Scene::Scalar;
  typename MethodsOf<Scene>::AnyOf chosen;
  if (method == nullptr || !MethodsOf<Scene>::choose(method, chosen)) return nullptr;
  MethodsOf<Scene>::set_tolerance(tolerance, chosen);
  std::vector<S> read;
  std::istringstream words(numbers);
  for (std::string word; words >> word;) read.push_back(number_from<S>(word));
  if (read.size() != 2 + Scene::bodies.size() * body_size<Scene>) return nullptr;
  return new (std::nothrow) RunOf<Scene>(chosen, read[0], read[1], &read[2]);
}

/// `hamotor_observe_text`: one row of columns in all digits, blanks between them; how many
/// characters it has, of which at most `size` with a closing zero are written.
template <class Scene>
[[nodiscard]] std::int64_t observe_text(const RunOf<Scene>& run, char* text, std::int64_t size) {
  std::array<typename Scene::Scalar, columns<Scene>()> row{};
  run.observe(row.data());
  std::string words;
  for (const auto& x : row) words += text_of(x) + ' ';
  words.pop_back();
  if (size > 0) {
    const auto kept = std::min(words.size(), static_cast<std::size_t>(size - 1));
    text[words.copy(text, kept)] = '\0';
  }
  return static_cast<std::int64_t>(words.size());
}

}  // namespace scene
}  // namespace hamotor

#if defined(_WIN32)
#define HAMOTOR_SCENE_EXPORT extern "C" __declspec(dllexport)
#else
#define HAMOTOR_SCENE_EXPORT extern "C" __attribute__((visibility("default")))
#endif

#ifdef HAMOTOR_ENSEMBLE
#include "hamotor/ensemble_abi.hpp"
#define HAMOTOR_SCENE_ENSEMBLE(Scene) HAMOTOR_ENSEMBLE_FUNCTIONS(Scene)
#else
#define HAMOTOR_SCENE_ENSEMBLE(Scene) static_assert(sizeof(hamotor::scene::RunOf<Scene>) > 0)
#endif

/// Defines the C functions of the compiled scene `Scene`; once in a shared library.
#define HAMOTOR_SCENE(Scene)                                                                    \
  HAMOTOR_SCENE_EXPORT const char* hamotor_describe() {                                         \
    static const std::string text = hamotor::scene::description<Scene>();                       \
    return text.c_str();                                                                        \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT void* hamotor_start(const char* method, double time, double step,        \
                                           double tolerance, const double* state) {             \
    return hamotor::scene::start<Scene>(method, time, step, tolerance, state);                  \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT std::int64_t hamotor_advance(void* run, std::int64_t steps,              \
                                                    std::int64_t every, double* rows) {         \
    return static_cast<hamotor::scene::RunOf<Scene>*>(run)->advance(steps, every, rows);        \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT void hamotor_set_patience(void* run, std::int64_t tries) {               \
    static_cast<hamotor::scene::RunOf<Scene>*>(run)->set_patience(tries);                       \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT void hamotor_observe(const void* run, double* row) {                     \
    static_cast<const hamotor::scene::RunOf<Scene>*>(run)->observe(row);                        \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT void* hamotor_start_text(const char* method, double tolerance,           \
                                                const char* numbers) {                          \
    return hamotor::scene::start<Scene>(method, tolerance, numbers);                            \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT std::int64_t hamotor_observe_text(const void* run, char* text,           \
                                                         std::int64_t size) {                   \
    return hamotor::scene::observe_text<Scene>(                                                 \
        *static_cast<const hamotor::scene::RunOf<Scene>*>(run), text, size);                    \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT std::int32_t hamotor_observe_at(const void* run, double time,            \
                                                       double* row) {                           \
    return static_cast<const hamotor::scene::RunOf<Scene>*>(run)->observe_at(time, row);        \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT std::int32_t hamotor_observe_event(const void* run, std::int64_t event,  \
                                                          double* row) {                        \
    return static_cast<const hamotor::scene::RunOf<Scene>*>(run)->observe_event(event, row);    \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT void hamotor_state(const void* run, double* state) {                     \
    static_cast<const hamotor::scene::RunOf<Scene>*>(run)->read_state(state);                   \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT void hamotor_drift(const void* run, double* drift) {                     \
    const auto& so_far = static_cast<const hamotor::scene::RunOf<Scene>*>(run)->drift();        \
    drift[0] = static_cast<double>(so_far.largest);                                             \
    drift[1] = static_cast<double>(so_far.sum);                                                 \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT std::int64_t hamotor_steps(const void* run) {                            \
    return static_cast<const hamotor::scene::RunOf<Scene>*>(run)->steps();                      \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT std::int32_t hamotor_failure(const void* run, std::int64_t* component) { \
    return static_cast<std::int32_t>(                                                           \
        static_cast<const hamotor::scene::RunOf<Scene>*>(run)->failure(*component));            \
  }                                                                                             \
  HAMOTOR_SCENE_EXPORT void hamotor_stop(void* run) {                                           \
    delete static_cast<hamotor::scene::RunOf<Scene>*>(run);                                     \
  }                                                                                             \
  HAMOTOR_SCENE_ENSEMBLE(Scene)
