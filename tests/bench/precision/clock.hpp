// Seconds of a piece of work: on the clock on the wall, and those that this thread had a processor.
#pragma once

#include <time.h>

#include <algorithm>
#include <chrono>
#include <limits>

namespace bench {

/// Wall time stands inside of processor time, which is slow to ask for: what asking costs is
/// measured and taken off.
class Clock {
 public:
  Clock() {
    double idle = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 100; ++i) {
      double wall = 0;
      double processor = 0;
      start();
      stop(wall, processor);
      idle = std::min(idle, processor);
    }
    idle_ = idle;
  }

  void start() noexcept {
    processor_ = processor_now();
    wall_ = std::chrono::steady_clock::now();
  }

  /// Seconds since `start`.
  void stop(double& wall, double& processor) const noexcept {
    const auto ended = std::chrono::steady_clock::now();
    processor = std::max(processor_now() - processor_ - idle_, 0.0);
    wall = std::chrono::duration<double>(ended - wall_).count();
  }

 private:
  [[nodiscard]] static double processor_now() noexcept {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }

  std::chrono::steady_clock::time_point wall_;
  double processor_ = 0;
  double idle_ = 0;
};

}  // namespace bench
