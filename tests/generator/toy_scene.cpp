// A scene small enough to check by hand, speaking version 2 of the compiled scene's C ABI: a body
// that spins about e3 at the constant rate l12 while its position x swings as x'' = -x.
//
// FAIL_AT n        the state becomes infinite in step n
// OVERFLOW_AT n    an observed quantity, not the state, becomes infinite after step n
// FAIL_MEMBER n    members of an ensemble with a negative rate fail in step n
// SLEEP_US n       every step takes at least n microseconds
// CONTROLLED "true"  euler says that it chooses its steps, but takes the same for any tolerance
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <thread>
#include <vector>

#ifndef FAIL_AT
#define FAIL_AT -1
#endif
#ifndef OVERFLOW_AT
#define OVERFLOW_AT -1
#endif
#ifndef SLEEP_US
#define SLEEP_US 0
#endif
#ifndef CONTROLLED
#define CONTROLLED "false"
#endif
#ifndef FAIL_MEMBER
#define FAIL_MEMBER -1
#endif
#ifndef ABI
#define ABI "2"
#endif

#define EXPORT extern "C" __attribute__((visibility("default")))

namespace {

constexpr int columns = 21;

struct Run {
  bool leapfrog;
  double step, start;
  std::int64_t index;
  double angle, rate, x, p;
};

void advance_one(Run& run) {
  const double h = run.step;
  if (run.leapfrog) {
    run.p -= h / 2 * run.x;
    run.x += h * run.p;
    run.p -= h / 2 * run.x;
  } else {
    const double x = run.x;
    run.x += h * run.p;
    run.p -= h * x;
  }
  run.angle += h * run.rate;
}

void write_row(const Run& run, double* row) {
  const double s = std::cos(run.angle / 2), e12 = -std::sin(run.angle / 2);
  const double overflow = run.index == OVERFLOW_AT ? std::numeric_limits<double>::infinity() : 0;
  const double values[columns] = {
      run.start + static_cast<double>(run.index) * run.step,
      s,
      0,
      0,
      e12,
      -run.x * s / 2,
      -run.x * e12 / 2,
      0,
      0,
      0,
      0,
      run.rate,
      run.p,
      0,
      0,
      run.x,
      0,
      0,
      (run.p * run.p + run.x * run.x + run.rate * run.rate) / 2 + overflow,
      run.rate,
      0};
  std::memcpy(row, values, sizeof values);
}

}  // namespace

EXPORT const char* hamotor_describe() {
  return R"({"abi": )" ABI R"(, "scene": "toy", "algebra": "pga3", "group": "SE3",
 "scalar": "double", "digits": 17, "kernels": "generated", "compiler": "toy", "fma": false, "bodies": ["bob"],
 "methods": [{"name": "splitting2", "order": 2, "error_controlled": false}, {"name": "euler", "order": 1, "error_controlled": )" CONTROLLED
         R"(}],
 "motor": ["s","e23","e31","e12","e01","e02","e03","e0123"],
 "momentum": ["e23","e31","e12","e01","e02","e03"],
 "columns": [{"name":"t","unit":"s","frame":"","body":""},
  {"name":"bob.motor.s","unit":"1","frame":"body to world","body":"bob"},
  {"name":"bob.motor.e23","unit":"1","frame":"body to world","body":"bob"},
  {"name":"bob.motor.e31","unit":"1","frame":"body to world","body":"bob"},
  {"name":"bob.motor.e12","unit":"1","frame":"body to world","body":"bob"},
  {"name":"bob.motor.e01","unit":"m","frame":"body to world","body":"bob"},
  {"name":"bob.motor.e02","unit":"m","frame":"body to world","body":"bob"},
  {"name":"bob.motor.e03","unit":"m","frame":"body to world","body":"bob"},
  {"name":"bob.motor.e0123","unit":"m","frame":"body to world","body":"bob"},
  {"name":"bob.momentum.e23","unit":"kg m^2/s","frame":"body","body":"bob"},
  {"name":"bob.momentum.e31","unit":"kg m^2/s","frame":"body","body":"bob"},
  {"name":"bob.momentum.e12","unit":"kg m^2/s","frame":"body","body":"bob"},
  {"name":"bob.momentum.e01","unit":"kg m/s","frame":"body","body":"bob"},
  {"name":"bob.momentum.e02","unit":"kg m/s","frame":"body","body":"bob"},
  {"name":"bob.momentum.e03","unit":"kg m/s","frame":"body","body":"bob"},
  {"name":"bob.position.x","unit":"m","frame":"world","body":"bob"},
  {"name":"bob.position.y","unit":"m","frame":"world","body":"bob"},
  {"name":"bob.position.z","unit":"m","frame":"world","body":"bob"},
  {"name":"energy","unit":"J","frame":"world","body":""},
  {"name":"spatial_momentum.e12","unit":"kg m^2/s","frame":"world","body":""},
  {"name":"spatial_momentum.e02","unit":"kg m/s","frame":"world","body":""}],
 "conserved": [{"name":"energy","column":"energy","norm":["energy"],"scale":1},
  {"name":"spatial_momentum.e12","column":"spatial_momentum.e12",
   "norm":["spatial_momentum.e12"],"scale":1},
  {"name":"spatial_momentum.e02","column":"spatial_momentum.e02",
   "norm":["spatial_momentum.e02"],"scale":0}], "events": [],
 "ensemble": {"lanes": 1, "isa": "toy", "parameters": []}})";
}

EXPORT void* hamotor_start(const char* method, double time, double step, double,
                           const double* state) {
  const bool leapfrog = std::strcmp(method, "splitting2") == 0;
  if (!leapfrog && std::strcmp(method, "euler") != 0) return nullptr;
  const double s = state[0], e12 = state[3];
  const double x = -2 * (state[4] * s + state[5] * e12) / (s * s + e12 * e12);
  return new Run{leapfrog, step, time, 0, 2 * std::atan2(-e12, s), state[10], x, state[11]};
}

EXPORT std::int64_t hamotor_advance(void* handle, std::int64_t steps, std::int64_t every,
                                    double* rows) {
  Run& run = *static_cast<Run*>(handle);
  for (std::int64_t k = 0; k < steps; ++k) {
    if (run.index + 1 == FAIL_AT) return k;
    advance_one(run);
    ++run.index;
    if (SLEEP_US > 0) std::this_thread::sleep_for(std::chrono::microseconds(SLEEP_US));
    if (rows != nullptr && run.index % every == 0) {
      write_row(run, rows);
      rows += columns;
    }
  }
  return steps;
}

EXPORT void hamotor_observe(const void* handle, double* row) {
  write_row(*static_cast<const Run*>(handle), row);
}

EXPORT void* hamotor_start_text(const char*, double, const char*) { return nullptr; }

EXPORT std::int64_t hamotor_observe_text(const void*, char*, std::int64_t) { return 0; }

EXPORT void hamotor_set_patience(void*, std::int64_t) {}

EXPORT std::int32_t hamotor_observe_at(const void* handle, double time, double* row) {
  Run run = *static_cast<const Run*>(handle);
  run.step = time - (run.start + run.step * static_cast<double>(run.index));
  run.start = time;
  run.index = 0;
  advance_one(run);
  write_row(run, row);
  return 1;
}

EXPORT std::int32_t hamotor_observe_event(const void*, std::int64_t, double*) { return 0; }

EXPORT void hamotor_state(const void* handle, double* state) {
  double row[columns];
  write_row(*static_cast<const Run*>(handle), row);
  std::memcpy(state, row + 1, 14 * sizeof(double));
}

EXPORT void hamotor_drift(const void* handle, double* drift) {
  drift[0] = 1e-16;
  drift[1] = 1e-16 * static_cast<double>(static_cast<const Run*>(handle)->index);
}

EXPORT std::int64_t hamotor_steps(const void* handle) {
  return static_cast<const Run*>(handle)->index;
}

EXPORT std::int32_t hamotor_failure(const void* handle, std::int64_t* component) {
  *component = -1;
  return static_cast<const Run*>(handle)->index + 1 == FAIL_AT ? 1 : 0;
}

EXPORT void hamotor_stop(void* handle) { delete static_cast<Run*>(handle); }

// Many of them, one after the other.
namespace {

struct Member {
  Run* run;
  bool failed;
};

using Members = std::vector<Member>;

}  // namespace

EXPORT void* hamotor_ensemble_start(const char* method, double time, double step, double tolerance,
                                    std::int64_t count, const double* states, const double*,
                                    std::int32_t, std::int32_t) {
  auto* members = new Members;
  for (std::int64_t k = 0; k < count; ++k) {
    void* run = hamotor_start(method, time, step, tolerance, states + 14 * k);
    if (run == nullptr) return nullptr;
    members->push_back({static_cast<Run*>(run), false});
  }
  return members;
}

EXPORT std::int64_t hamotor_ensemble_advance(void* handle, std::int64_t steps) {
  std::int64_t alive = 0;
  for (Member& member : *static_cast<Members*>(handle)) {
    for (std::int64_t k = 0; k < steps && !member.failed; ++k) {
      member.failed = member.run->index + 1 == FAIL_MEMBER && member.run->rate < 0;
      if (!member.failed) hamotor_advance(member.run, 1, 1, nullptr);
    }
    alive += member.failed ? 0 : 1;
  }
  return alive;
}

EXPORT void hamotor_ensemble_observe(const void* handle, std::int64_t first, std::int64_t count,
                                     double* rows) {
  const Members& members = *static_cast<const Members*>(handle);
  for (std::int64_t k = 0; k < count; ++k) write_row(*members[first + k].run, rows + columns * k);
}

EXPORT void hamotor_ensemble_states(const void* handle, double* states) {
  for (const Member& member : *static_cast<const Members*>(handle)) {
    hamotor_state(member.run, states);
    states += 14;
  }
}

EXPORT void hamotor_ensemble_failures(const void* handle, std::int32_t* failure,
                                      std::int64_t* step) {
  for (const Member& member : *static_cast<const Members*>(handle)) {
    *failure++ = member.failed ? 1 : 0;
    *step++ = member.run->index;
  }
}

EXPORT void hamotor_ensemble_stop(void* handle) {
  auto* members = static_cast<Members*>(handle);
  for (const Member& member : *members) hamotor_stop(member.run);
  delete members;
}
