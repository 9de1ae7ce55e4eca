// Many members of one compiled scene through its C ABI.
//
// A library whose source defines HAMOTOR_ENSEMBLE before the scene has these functions beside those
// of one run.  Members differ in their states and in the scene's parameters, and in nothing else; a
// member's numbers do not depend on the others, on the threads or on the lanes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <string>
#include <vector>

#include "hamotor/scene_abi.hpp"

namespace hamotor::scene {

/// Members of a scene under way, all with one method, time and step.
template <class Scene>
class Ensemble {
 public:
  /// `states` has a row of `Run`'s state for each member.
  Ensemble(const typename MethodsOf<Scene>::AnyOf& method, double time, double step,
           std::int64_t members, const double* states) {
    runs_.reserve(static_cast<std::size_t>(members));
    for (std::int64_t i = 0; i < members; ++i) {
      runs_.emplace_back(method, time, step, states + static_cast<std::size_t>(i) * row);
    }
    steps_.assign(runs_.size(), 0);
  }

  /// Every member that is alive takes so many steps; how many still are.
  [[nodiscard]] std::int64_t advance(std::int64_t steps) noexcept {
    std::int64_t alive = 0;
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      const auto done = runs_[i].advance(steps, 0, nullptr);
      steps_[i] += done;
      alive += done == steps ? 1 : 0;
    }
    return alive;
  }

  void observe(std::int64_t first, std::int64_t count, double* rows) const noexcept {
    for (std::int64_t i = first; i < first + count; ++i, rows += columns<Scene>()) {
      runs_[static_cast<std::size_t>(i)].observe(rows);
    }
  }

  void read_states(double* states) const noexcept {
    for (const auto& run : runs_) {
      run.read_state(states);
      states += row;
    }
  }

  void failures(std::int32_t* failure, std::int64_t* step) const noexcept {
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      std::int64_t component = 0;
      failure[i] = static_cast<std::int32_t>(runs_[i].failure(component));
      step[i] = steps_[i];
    }
  }

 private:
  static constexpr std::size_t row = Scene::bodies.size() * body_size<Scene>;

  std::vector<RunOf<Scene>> runs_;
  std::vector<std::int64_t> steps_;
};

/// `hamotor_ensemble_start`: NULL for a method that is unknown or not compiled, for lanes that
/// there are not, or without memory.
template <class Scene>
[[nodiscard]] void* start_ensemble(const char* method, double time, double step, double tolerance,
                                   std::int64_t members, const double* states,
                                   const double* /*parameters*/, std::int32_t /*threads*/,
                                   std::int32_t lanes) noexcept {
  typename MethodsOf<Scene>::AnyOf chosen;
  if (method == nullptr || !MethodsOf<Scene>::choose(method, chosen)) return nullptr;
  if (members < 0 || lanes < 0 || lanes > 1) return nullptr;
  MethodsOf<Scene>::set_tolerance(tolerance, chosen);
  try {
    return new Ensemble<Scene>(chosen, time, step, members, states);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}

/// What `hamotor_describe` says of ensembles.
template <class Scene>
[[nodiscard]] std::string ensemble_json() {
  return R"({"lanes": 1, "isa": "scalar", "parameters": []})";
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
    return static_cast<hamotor::scene::Ensemble<Scene>*>(ensemble)->advance(steps);                \
  }                                                                                                \
  HAMOTOR_SCENE_EXPORT void hamotor_ensemble_observe(const void* ensemble, std::int64_t first,     \
                                                     std::int64_t count, double* rows) {           \
    static_cast<const hamotor::scene::Ensemble<Scene>*>(ensemble)->observe(first, count, rows);    \
  }                                                                                                \
  HAMOTOR_SCENE_EXPORT void hamotor_ensemble_states(const void* ensemble, double* states) {        \
    static_cast<const hamotor::scene::Ensemble<Scene>*>(ensemble)->read_states(states);            \
  }                                                                                                \
  HAMOTOR_SCENE_EXPORT void hamotor_ensemble_failures(const void* ensemble, std::int32_t* failure, \
                                                      std::int64_t* step) {                        \
    static_cast<const hamotor::scene::Ensemble<Scene>*>(ensemble)->failures(failure, step);        \
  }                                                                                                \
  HAMOTOR_SCENE_EXPORT void hamotor_ensemble_stop(void* ensemble) {                                \
    delete static_cast<hamotor::scene::Ensemble<Scene>*>(ensemble);                                \
  }                                                                                                \
  static_assert(sizeof(hamotor::scene::Ensemble<Scene>) > 0)
