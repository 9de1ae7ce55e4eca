// Whole runs of a compiled scene through its C ABI, timed where no interpreter is in the way.
#include <cstdint>

#include "clock.hpp"

namespace {

using Start = void* (*)(const char* method, double time, double step, double tolerance,
                        const double* state);
using Advance = std::int64_t (*)(void* run, std::int64_t steps, std::int64_t every, double* rows);
using Observe = void (*)(const void* run, double* row);
using Steps = std::int64_t (*)(const void* run);
using Stop = void (*)(void* run);

}  // namespace

/// Runs `repetitions` times from `state`: `calls` steps of the method, or with a tolerance as many
/// as it takes within each.  Writes the seconds that every `hamotor_advance` took, how many of them
/// it had the processor, the row of the last state and the steps taken.  Returns how many of
/// `calls` were done, -1 if it did not start.
extern "C" __attribute__((visibility("default"))) std::int64_t time_runs(
    Start start, Advance advance, Observe observe, Steps steps, Stop stop, const char* method,
    double step, double tolerance, const double* state, std::int64_t calls,
    std::int64_t repetitions, double* seconds, double* processor, double* row,
    std::int64_t* taken) {
  bench::Clock clock;
  std::int64_t done = 0;
  for (std::int64_t i = 0; i < repetitions; ++i) {
    void* const run = start(method, 0, step, tolerance, state);
    if (run == nullptr) return -1;
    clock.start();
    done = advance(run, calls, 0, nullptr);
    clock.stop(seconds[i], processor[i]);
    observe(run, row);
    *taken = steps(run);
    stop(run);
  }
  return done;
}
