// What every library of public solvers exports: `time_solver`.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "clock.hpp"
#include "problems.hpp"

namespace bench {

struct Count {
  std::int64_t steps = 0;
  std::int64_t evaluations = 0;
};

/// Runs one solver from `x` to `end` and says what it took; `count` null: no accounting.
template <class Rates>
using Solver = void (*)(const Rates&, State<Rates::size>& x, double end, double setting,
                        Count* count);

template <class Rates>
int time_runs(Solver<Rates> solver, const Problem& problem, double end, double setting,
              std::int64_t repetitions, double* seconds, double* processor, double* state,
              std::int64_t* counts) {
  if (solver == nullptr) return 1;
  const Rates rates{Constants(problem)};
  State<Rates::size> start, x;
  std::copy_n(state, Rates::size, start.begin());
  Clock clock;
  for (std::int64_t i = 0; i < repetitions; ++i) {
    x = start;
    clock.start();
    solver(rates, x, end, setting, nullptr);
    clock.stop(seconds[i], processor[i]);
  }
  Count count;
  solver(rates, start, end, setting, &count);
  std::copy(start.begin(), start.end(), state);
  counts[0] = count.steps;
  counts[1] = count.evaluations;
  return 0;
}

/// Runs solver `name` of `Solvers` `repetitions` times from `state` to `end` and writes the seconds
/// of each and how many of them it had the processor; then once more to count, and writes the last
/// state, steps and evaluations.  `kind`: free, top, sprung or loose (sprung, with a rest length);
/// or, with HAMOTOR_BENCH_EQUATIONS, only equations: those of a class `Equations`. `setting`: the
/// tolerance, of fixed steps their number.  Returns 0; 1 for what is not known; 2 if the solver
/// gave up.
template <class Solvers>
int time_solver(std::string_view kind, const Problem& problem, std::string_view name, double end,
                double setting, std::int64_t repetitions, double* seconds, double* processor,
                double* state, std::int64_t* counts) {
  const auto runs = [&]<class Rates>(Solver<Rates> solver) {
    return time_runs(solver, problem, end, setting, repetitions, seconds, processor, state, counts);
  };
  try {
#ifdef HAMOTOR_BENCH_EQUATIONS
    if (kind == "equations") return runs(Solvers::template find<Equations>(name));
#else
    if (kind == "free") return runs(Solvers::template find<Free>(name));
    if (kind == "top") return runs(Solvers::template find<Top>(name));
    if (kind == "sprung") return runs(Solvers::template find<Sprung<false>>(name));
    if (kind == "loose") return runs(Solvers::template find<Sprung<true>>(name));
#endif
  } catch (...) {  // odeint throws when a step cannot be made small enough
    return 2;
  }
  return 1;
}

}  // namespace bench

/// Exports the solvers of a class with `find<Rates>(name)`; once in a shared library.
#define HAMOTOR_BENCH_SOLVERS(Solvers)                                                             \
  extern "C" __attribute__((visibility("default"))) int time_solver(                               \
      const char* kind, const bench::Problem* problem, const char* name, double end,               \
      double setting, std::int64_t repetitions, double* seconds, double* processor, double* state, \
      std::int64_t* counts) {                                                                      \
    return bench::time_solver<Solvers>(kind, *problem, name, end, setting, repetitions, seconds,   \
                                       processor, state, counts);                                  \
  }                                                                                                \
  static_assert(true)
