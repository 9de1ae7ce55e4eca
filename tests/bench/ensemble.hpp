// What `hamotor bench ensemble` compares: bodies, and how long something takes.
#pragma once

#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <limits>

namespace bench {

inline constexpr std::array<double, 3> moments{1, 2, 3};
inline constexpr double mass = 1;
inline constexpr std::array<double, 3> spring_at{0.1, 0.2, 0.05};
inline constexpr double stiffness = 50;
inline constexpr double step = 0.01;

/// How body k of an ensemble starts, at the origin: angular and linear momentum.
[[nodiscard]] inline std::array<double, 6> momentum_of(std::size_t k) noexcept {
  const double x = 1e-3 * static_cast<double>(k % 1000);
  return {1.5 + x, 0.8 - x, 2 + 0.5 * x, 0.1, -x, 0.2};
}

/// What this thread has computed for, in seconds: what else runs takes nothing from it but caches.
[[nodiscard]] inline double own_time() noexcept {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// What has passed, in seconds: for several threads.
[[nodiscard]] inline double wall_time() noexcept {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Shortest time of several runs: what else the machine does only adds to it.
template <class Run>
[[nodiscard]] double shortest(int runs, const Run& run, double (*time)() noexcept = own_time) {
  double best = std::numeric_limits<double>::infinity();
  for (int k = 0; k < runs; ++k) {
    const double start = time();
    run();
    best = std::min(best, time() - start);
  }
  return best;
}

/// Bodies of Eigen's quaternions and vectors, an array of structures: steps a second of the
/// classical Runge–Kutta method, free (attitude only) or on a spring, and where the first body's
/// angular momentum ends.
struct EigenResult {
  double steps_per_second;
  std::array<double, 3> angular;
};
[[nodiscard]] EigenResult eigen_free(std::size_t bodies, int steps, int runs);
[[nodiscard]] EigenResult eigen_spring(std::size_t bodies, int steps, int runs);

}  // namespace bench
