// Many members of one compiled scene through its C ABI.
//
// A library whose source defines HAMOTOR_ENSEMBLE before the scene has these functions beside those
// of one run.  Members differ in their states and in the scene's parameters, and in nothing else; a
// member's numbers do not depend on the others, on the threads or on the lanes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <vector>

#include "hamotor/ensemble.hpp"
#include "hamotor/pack.hpp"
#include "hamotor/scene_abi.hpp"

namespace hamotor::scene {

/// Members of a scene under way, whatever steps them.
class AnyEnsemble {
 public:
  AnyEnsemble() = default;
  AnyEnsemble(const AnyEnsemble&) = delete;
  AnyEnsemble& operator=(const AnyEnsemble&) = delete;
  virtual ~AnyEnsemble() = default;

  [[nodiscard]] virtual std::int64_t advance(std::int64_t steps) = 0;
  virtual void observe(std::int64_t first, std::int64_t count, double* rows) const = 0;
  virtual void read_states(double* states) const = 0;
  virtual void failures(std::int32_t* failure, std::int64_t* step) const = 0;
};

/// A system on a group whose exponential is one formula, without cases.
template <class System>
concept SystemInSpace = requires { Space<typename System::Group>::dimension; };

/// The methods that step all lanes of a pack at once: those with nothing to wait for.  The others
/// choose their own steps or iterate until they have converged.
template <class System, Summation... asked>
struct PackSteppers {
  using type = std::tuple<Rk4<System, asked...>>;
};
template <SystemInSpace System, Summation... asked>
struct PackSteppers<System, asked...> {
  // exp X − 1, which compensated sums take, is a series as long as it needs.
  using Turning = std::conditional_t<((asked == Summation::compensated) || ...), std::tuple<>,
                                     std::tuple<Rkmk4<System>, CommutatorFree4<System>>>;
  using type =
      decltype(std::tuple_cat(std::tuple<Rk4<System, asked...>>{}, Turning{},
                              typename hamotor::detail::SplitSteppers<System, asked...>::type{}));
};

#ifdef HAMOTOR_COMPENSATED
template <class System>
using MembersPacked = typename PackSteppers<System, summation_asked>::type;
#else
template <class System>
using MembersPacked = typename PackSteppers<System>::type;
#endif

template <class Methods>
inline constexpr auto names_of = std::tuple<>{};
template <class... Method>
inline constexpr std::array<std::string_view, sizeof...(Method)> names_of<std::tuple<Method...>>{
    Method::name...};

/// Whether a scene can be had in packs.
template <class Scene>
inline constexpr bool packs = false;
template <class Scene>
  requires requires { typename Scene::template In<Pack<typename Scene::Scalar, 1>>; }
inline constexpr bool packs<Scene> =
    Scene::kernels == "generated" && !requires { SystemOf<Scene>::iterates; };

/// A scene whose members can have parameters of their own.
template <class Scene>
concept ParametrisedScene = requires { Scene::parameters.size(); };

/// The values of a scene's parameters for one member.
template <class Scene>
struct ParametersOf {
  using type = std::array<typename Scene::Scalar, 0>;
};
template <ParametrisedScene Scene>
struct ParametersOf<Scene> {
  using type = std::array<typename Scene::Scalar, Scene::parameters.size()>;
};

/// Whether there are ensembles of a scene: not where members' events would be passed over, nor of
/// scenes that bring their own kind of run.
template <class Scene>
inline constexpr bool has_ensembles = !EventfulScene<Scene> && !requires { typename Scene::Run; };

/// Members of a scene, stepped in scalars `S` by `Method`.
template <class Scene, class S, class Method>
class EnsembleOf final : public AnyEnsemble {
  using Moment = scene::Moment<Scene>;
  using System = SystemOf<Scene>;
  using Stepped = decltype([] {
    if constexpr (is_pack<S>) {
      return std::type_identity<SystemOf<typename Scene::template In<S>>>{};
    } else {
      return std::type_identity<System>{};
    }
  }());
  using Parameters = typename ParametersOf<Scene>::type;
  using Systems = std::conditional_t<ParametrisedScene<Scene>, OneForEach<typename Stepped::type>,
                                     OneForAll<typename Stepped::type>>;
  using Members = hamotor::Ensemble<typename Stepped::type, Method, Systems>;

 public:
  /// `parameters` are none for the scene's own, or those of each member.
  EnsembleOf(const Method& method, double time, double step,
             std::span<const typename Members::Member> members, std::vector<Parameters> parameters,
             unsigned threads)
      : parameters_(std::move(parameters)),
        members_(systems(parameters_), method, static_cast<typename Members::Number>(time),
                 static_cast<typename Members::Number>(step), members, threads) {}

  [[nodiscard]] std::int64_t advance(std::int64_t steps) override {
    return static_cast<std::int64_t>(members_.advance(steps));
  }
  void observe(std::int64_t first, std::int64_t count, double* rows) const override {
    for (std::int64_t k = 0; k < count; ++k, rows += columns<Scene>()) {
      const auto member = static_cast<std::size_t>(first + k);
      moment(member).write_row(system_of(member), rows);
    }
  }
  void read_states(double* states) const override {
    for (std::size_t k = 0; k < members_.size(); ++k) {
      moment(k).write_state(states);
      states += Scene::bodies.size() * body_size<Scene>;
    }
  }
  void failures(std::int32_t* failure, std::int64_t* step) const override {
    for (std::size_t k = 0; k < members_.size(); ++k) {
      failure[k] = static_cast<std::int32_t>(members_.failure(k));
      step[k] = members_.steps(k);
    }
  }

 private:
  [[nodiscard]] static const auto& system() noexcept {
    if constexpr (is_pack<S>) {
      return Scene::template In<S>::system;
    } else {
      return Scene::system;
    }
  }

  [[nodiscard]] static Systems systems([[maybe_unused]] std::span<const Parameters> parameters) {
    if constexpr (!ParametrisedScene<Scene>) {
      return system();
    } else {
      Systems result{{system()}};
      if (parameters.empty()) return result;
      constexpr std::size_t lanes = lanes_of<S>;
      const std::size_t blocks = (parameters.size() + lanes - 1) / lanes;
      result.systems.resize(blocks + 1, system());
      // Lanes to spare repeat the last member, as their states do.
      for (std::size_t k = 0; k < result.systems.size() * lanes; ++k) {
        const Parameters& from = parameters[std::min(k, parameters.size() - 1)];
        auto& to = result.systems[k / lanes].parameters;
        for (std::size_t p = 0; p < from.size(); ++p) {
          hamotor::detail::set_lane(to[p], k % lanes, from[p]);
        }
      }
      return result;
    }
  }

  [[nodiscard]] System system_of([[maybe_unused]] std::size_t member) const noexcept {
    System result = Scene::system;
    if constexpr (ParametrisedScene<Scene>) {
      if (!parameters_.empty()) result.parameters = parameters_[member];
    }
    return result;
  }

  [[nodiscard]] Moment moment(std::size_t member) const noexcept {
    Moment now{members_.time(member), members_.state(member), {}};
    if constexpr (PoweredSystem<System>) now.work = members_.work(member);
    return now;
  }

  std::vector<Parameters> parameters_;
  Members members_;
};

/// Starts members by the method of this name, if it is among these; S is what they are stepped in.
template <class Scene, class S, class Methods>
struct EnsembleStart;
template <class Scene, class S, class... Method>
struct EnsembleStart<Scene, S, std::tuple<Method...>> {
  using Member = StateOf<SystemOf<Scene>>;
  using Parameters = typename ParametersOf<Scene>::type;

  [[nodiscard]] static std::unique_ptr<AnyEnsemble> by(std::string_view name, double time,
                                                       double step, double tolerance,
                                                       std::span<const Member> members,
                                                       std::span<const Parameters> parameters,
                                                       unsigned threads) {
    std::unique_ptr<AnyEnsemble> result;
    const auto consider = [&]<class One>(std::type_identity<One>) {
      if constexpr (is_compiled<One>) {
        if (name != One::name) return;
        One method;
        if constexpr (ErrorControlled<One, typename Scene::Scalar>) {
          if (tolerance > 0) method.set_tolerance(typename Scene::Scalar(tolerance));
        }
        result = std::make_unique<EnsembleOf<Scene, S, One>>(
            method, time, step, members,
            std::vector<Parameters>(parameters.begin(), parameters.end()), threads);
      }
    };
    (consider(std::type_identity<Method>{}), ...);
    return result;
  }
};

/// The methods of a tuple whose names are not among these.
template <class Methods, class Packed>
struct Others;
template <class... Method, class Packed>
struct Others<std::tuple<Method...>, Packed> {
  template <class One>
  static constexpr bool is_other = std::find(names_of<Packed>.begin(), names_of<Packed>.end(),
                                             One::name) == names_of<Packed>.end();
  using type = decltype(std::tuple_cat(
      std::conditional_t<is_other<Method>, std::tuple<Method>, std::tuple<>>{}...));
};

/// `hamotor_ensemble_start`: NULL for a method that is unknown or not compiled, for lanes that
/// there are not, for a scene of which there are no ensembles, or without memory.
template <class Scene>
[[nodiscard]] void* start_ensemble(const char* method, double time, double step, double tolerance,
                                   std::int64_t count, const double* states,
                                   const double* parameters, std::int32_t threads,
                                   std::int32_t lanes) noexcept {
  if constexpr (has_ensembles<Scene>) {
    using S = typename Scene::Scalar;
    using System = SystemOf<Scene>;
    if (method == nullptr || count < 1 || threads < 0) return nullptr;
    try {
      std::vector<StateOf<System>> members;
      members.reserve(static_cast<std::size_t>(count));
      for (std::int64_t k = 0; k < count; ++k) {
        members.push_back(Moment<Scene>::from_user(states));
        states += Scene::bodies.size() * body_size<Scene>;
      }
      std::vector<typename ParametersOf<Scene>::type> values;
      if (ParametrisedScene<Scene> && parameters != nullptr) {
        values.resize(static_cast<std::size_t>(count));
        for (auto& its_own : values) {
          for (S& x : its_own) x = static_cast<S>(*parameters++);
        }
      }
      std::unique_ptr<AnyEnsemble> started;
      const auto start = [&]<class Lanes, class Methods>(std::type_identity<Lanes>,
                                                         std::type_identity<Methods>) {
        if (started) return;
        started = EnsembleStart<Scene, Lanes, Methods>::by(method, time, step, tolerance, members,
                                                           values, static_cast<unsigned>(threads));
      };
      if constexpr (packs<Scene>) {
        using Wide = Pack<S, widest<S>>;
        using One = Pack<S, 1>;
        using WideSystem = SystemOf<typename Scene::template In<Wide>>;
        using OneSystem = SystemOf<typename Scene::template In<One>>;
        using Packed = MembersPacked<WideSystem>;
        if (lanes == 0 || lanes == static_cast<std::int32_t>(widest<S>)) {
          start(std::type_identity<Wide>{}, std::type_identity<Packed>{});
        } else if (lanes == 1) {
          start(std::type_identity<One>{}, std::type_identity<MembersPacked<OneSystem>>{});
        }
        if (lanes <= 1) {
          start(std::type_identity<S>{},
                std::type_identity<typename Others<CompiledSteppers<System>, Packed>::type>{});
        }
      } else if (lanes == 0 || lanes == 1) {
        start(std::type_identity<S>{}, std::type_identity<CompiledSteppers<System>>{});
      }
      return started.release();
    } catch (const std::exception&) {
      return nullptr;
    }
  } else {
    return nullptr;
  }
}

/// What `hamotor_describe` says of ensembles.
template <class Scene>
[[nodiscard]] std::string ensemble_json() {
  if constexpr (!has_ensembles<Scene>) {
    return "null";
  } else {
    std::string parameters = "[]";
    if constexpr (ParametrisedScene<Scene>) parameters = json_strings(Scene::parameters);
    std::string lanes = "1";
    std::string isa = "scalar";
    if constexpr (packs<Scene>) {
      lanes = std::to_string(widest<typename Scene::Scalar>);
      isa = instruction_set;
    }
    return "{\"lanes\": " + lanes + ", \"isa\": " + json_string(isa) +
           ", \"parameters\": " + parameters + "}";
  }
}

}  // namespace hamotor::scene

#define HAMOTOR_ENSEMBLE_FUNCTIONS(Scene)                                                          \
  HAMOTOR_SCENE_EXPORT void* hamotor_ensemble_start(                                               \
      const char* method, double time, double step, double tolerance, std::int64_t members,        \
      const double* states, const double* parameters, std::int32_t threads, std::int32_t lanes) {  \
    return hamotor::scene::start_ensemble<Scene>(method, time, step, tolerance, members, states,   \
                                                 parameters, threads, lanes);                      \
  }                                                                                                \
  HAMOTOR_SCENE_EXPORT std::int64_t hamotor_ensemble_advance(void* ensemble, std::int64_t steps) { \
    return static_cast<hamotor::scene::AnyEnsemble*>(ensemble)->advance(steps);                    \
  }                                                                                                \
  HAMOTOR_SCENE_EXPORT void hamotor_ensemble_observe(const void* ensemble, std::int64_t first,     \
                                                     std::int64_t count, double* rows) {           \
    static_cast<const hamotor::scene::AnyEnsemble*>(ensemble)->observe(first, count, rows);        \
  }                                                                                                \
  HAMOTOR_SCENE_EXPORT void hamotor_ensemble_states(const void* ensemble, double* states) {        \
    static_cast<const hamotor::scene::AnyEnsemble*>(ensemble)->read_states(states);                \
  }                                                                                                \
  HAMOTOR_SCENE_EXPORT void hamotor_ensemble_failures(const void* ensemble, std::int32_t* failure, \
                                                      std::int64_t* step) {                        \
    static_cast<const hamotor::scene::AnyEnsemble*>(ensemble)->failures(failure, step);            \
  }                                                                                                \
  HAMOTOR_SCENE_EXPORT void hamotor_ensemble_stop(void* ensemble) {                                \
    delete static_cast<hamotor::scene::AnyEnsemble*>(ensemble);                                    \
  }                                                                                                \
  static_assert(sizeof(hamotor::scene::AnyEnsemble) > 0)
