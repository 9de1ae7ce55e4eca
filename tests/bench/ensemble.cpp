// `ensemble [--quick]`: bodies' steps a second in packs, one JSON object on stdout.
#include "ensemble.hpp"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <span>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "hamotor/counted.hpp"
#include "hamotor/ensemble.hpp"
#include "hamotor/pack.hpp"
#include "hamotor/pga3/se3.hpp"
#include "hamotor/pga3/so3.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/systems.hpp"

/// Counted like the doubles it stands for: by polynomials, not by the library's functions.
template <>
inline constexpr bool hamotor::detail::has_series<hamotor::Counted> = true;

namespace bench {
namespace {

using hamotor::Summation;
using hamotor::pga3::SE3;
using hamotor::pga3::SO3;
using hamotor::scalar::fixed;
using Lanes = hamotor::Pack<double, hamotor::widest<double>>;
constexpr auto split = hamotor::rotation_split(moments);

template <class S>
constexpr std::array<S, 3> in(const std::array<double, 3>& x) {
  return {fixed<S>(x[0]), fixed<S>(x[1]), fixed<S>(x[2])};
}

/// A body about a fixed point, attitude and angular momentum only.
struct FreeRotation {
  static constexpr const char* name = "free rotation, SO(3)";
  template <class S>
  static constexpr auto system() {
    return hamotor::RigidBodies{
        std::tuple{hamotor::PivotedBody<SO3, S, split>(fixed<S>(mass), in<S>(moments), {}, {})}};
  }
};

struct FreeMotion {
  static constexpr const char* name = "free motion, SE(3)";
  template <class S>
  static constexpr auto system() {
    return hamotor::RigidBodies{
        std::tuple{hamotor::FreeBody<SE3, S, split>(fixed<S>(mass), in<S>(moments))}};
  }
};

/// From a point of the body to the world's origin.
struct Spring {
  static constexpr const char* name = "spring, SE(3)";
  template <class S>
  static constexpr auto system() {
    const auto at = in<S>(spring_at);
    return hamotor::RigidBodies{
        std::tuple{hamotor::FreeBody<SE3, S, split>(fixed<S>(mass), in<S>(moments))},
        std::tuple{
            hamotor::SpringToWorld<0, SE3, S, hamotor::RestLength::zero, hamotor::pga3::Origin<S>>{
                .at = {at[0], at[1], at[2]},
                .anchor = {},
                .stiffness = fixed<S>(stiffness),
                .rest_length = S(0)}}};
  }
};

template <class System>
using Rk4 = hamotor::Rk4<System>;
template <class System>
using Strang = hamotor::Splitting2<System, Summation::plain>;
template <class System>
using Order4 = hamotor::Splitting4<System, Summation::plain>;
template <class System>
using StrangCompensated = hamotor::Splitting2<System>;
template <class System>
using Order4Compensated = hamotor::Splitting4<System>;

template <class System>
hamotor::State<typename System::Group, 1, double> member(std::size_t k) {
  using State = hamotor::State<typename System::Group, 1, double>;
  using Momentum = typename State::Momentum;
  std::array<double, Momentum::size> mu{};
  std::copy_n(momentum_of(k).begin(), mu.size(), mu.begin());
  return {{State::Element::identity()}, {Momentum::from(mu)}};
}

/// Of a step: operations, a multiply-add counted as two, and instructions, counted as one, of which
/// so many multiply.
struct Cost {
  double flops;
  double slots;
  double products;
};
/// Whether an ensemble's steps are made of turns about tiny angles.
template <class Problem, template <class> class Method>
bool has_tiny_turns() {
  const auto system = Problem::template system<double>();
  using System = std::remove_cvref_t<decltype(system)>;
  if constexpr (hamotor::stays_open<Method<System>>) {
    return Method<System>::range_of_turns(system, member<System>(0), step) ==
           hamotor::AngleRange::tiny;
  } else {
    return false;
  }
}

template <class Problem, template <class> class Method>
Cost cost() {
  using S = hamotor::Counted;
  const auto system = Problem::template system<S>();
  using System = std::remove_cvref_t<decltype(system)>;
  hamotor::StateOf<System> state{};
  const auto start = member<System>(0);
  // Read from memory: of what the compiler knows it would know too much.
  hamotor::detail::merge(state, start, [](S& to, const double& from) {
    const volatile double read = from;
    to = S(static_cast<double>(read));
  });
  Method<System> method;
  [[maybe_unused]] const auto plan = [&] {
    if constexpr (hamotor::carries_state<Method<System>>) {
      typename Method<System>::Plan made(system, S::fixed(step));
      method.open(made, state);
      return made;
    } else {
      return 0;
    }
  }();
  [[maybe_unused]] const bool tiny = has_tiny_turns<Problem, Method>();
  const auto take = [&](int many) {
    using hamotor::AngleRange;
    for (int k = 0; k < many; ++k) {
      if constexpr (hamotor::stays_open<Method<System>>) {
        for (std::size_t turn = 0; turn < Method<System>::turns; ++turn) {
          if (tiny) {
            method.template do_turn<AngleRange::tiny>(system, state, S::fixed(step), turn);
          } else {
            method.template do_turn<AngleRange::small>(system, state, S::fixed(step), turn);
          }
        }
      } else if constexpr (hamotor::carries_state<Method<System>>) {
        method.do_open_step(plan);
      } else {
        method.do_step(system, state, S::fixed(0), S::fixed(step));
      }
    }
  };
  take(1);
  hamotor::Counted::counts.fill(0);
  hamotor::Counted::fused = 0;
  constexpr int steps = 16;  // after so many, open steps put their motors back
  take(steps);
  const auto& counts = hamotor::Counted::counts;
  const auto operations = static_cast<double>(counts[S::additions] + counts[S::products]) / steps;
  return {operations, operations - static_cast<double>(S::fused) / steps,
          static_cast<double>(counts[S::products]) / steps};
}

/// What the processor starts a second where nothing waits, lanes counted one by one.
struct Peak {
  /// Multiply-adds alone.
  double multiply_adds = 0;
  /// Multiply-adds and as many additions: some processors have units for these of their own.
  double mixed = 0;

  /// FLOP/s, of which multiply-adds do the most.
  [[nodiscard]] double flops() const noexcept { return 2 * multiply_adds; }
};

/// Chains of multiply-adds beside chains of additions, in no more registers than AVX2 has, for
/// which no constant is needed: instructions a second.
template <std::size_t multiply_adds, std::size_t additions>
[[gnu::noinline]] double started() {
  constexpr int rounds = 20000;
  constexpr std::size_t chains = multiply_adds + additions;
  std::array<Lanes, chains> numbers;
  const volatile double zero = 0;  // of what the compiler knows nothing would be left to do
  numbers.fill(Lanes(static_cast<double>(zero)));
  const double taken = shortest(10, [&] {
    [&]<std::size_t... k>(std::index_sequence<k...>) {
      std::tuple local{numbers[k]...};
      const auto go_on = [](Lanes& x, auto multiply) {
        x = multiply ? hamotor::mul_add(x, x, x) : x + x;
      };
      for (int n = 0; n < rounds; ++n) {
        (go_on(std::get<k>(local), std::bool_constant<(k < multiply_adds)>{}), ...);
      }
      ((numbers[k] = std::get<k>(local)), ...);
    }(std::make_index_sequence<chains>{});
  });
  double sum = 0;
  for (const Lanes& x : numbers) sum += x[0];
  // Read, so that the loop is not left out.
  if (sum != 0) std::fprintf(stderr, "peak: %g\n", sum);
  return static_cast<double>(rounds * chains * Lanes::lanes) / taken;
}

Peak peak() { return {started<12, 0>(), started<8, 8>()}; }

class Report {
 public:
  explicit Report(bool quick) : quick_(quick) {}

  template <class Problem, template <class> class Method>
  void measure(const char* method, bool all_sizes) {
    const Cost of_step = cost<Problem, Method>();
    const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
    const auto one_more = [&](std::size_t bodies, const std::vector<unsigned>& threads) {
      const auto rates = measured<Problem, Method>(bodies, threads);
      for (std::size_t k = 0; k < threads.size(); ++k) {
        add({Problem::name, method, "packs", bodies, threads[k], rates[k], of_step});
      }
    };
    for (const std::size_t bodies : {64U, 1024U, 16384U, 1048576U}) {
      if (!all_sizes && bodies != 1024) continue;
      const std::size_t most = quick_ ? 16384 : 1048576;
      if (bodies > most) continue;
      const bool by_all = all_sizes && cores > 1 && bodies == most;
      one_more(bodies, by_all ? std::vector{1U, cores} : std::vector{1U});
    }
  }

  void eigen(const char* problem, EigenResult (*run)(std::size_t, int, int)) {
    for (const std::size_t bodies : {64U, 1024U}) {
      const int steps = steps_for(bodies);
      const double found = run(bodies, steps, 4 * bursts(bodies)).steps_per_second;
      add({problem, "rk4", "Eigen", bodies, 1, {found, peak()}, {}});
    }
  }

  /// The first body's angular momentum after a second.
  template <class Problem>
  [[nodiscard]] static std::array<double, 3> angular() {
    const auto system = Problem::template system<double>();
    using System = std::remove_cvref_t<decltype(system)>;
    auto state = member<System>(0);
    Rk4<System> method;
    for (int k = 0; k < 100; ++k) method.do_step(system, state, 0.0, step);
    const auto found = state.momenta[0].components();
    return {found[0], found[1], found[2]};
  }

  /// Whether Eigen's bodies move as ours, relative to |Π|.
  template <class Problem>
  [[nodiscard]] static double disagreement(EigenResult (*run)(std::size_t, int, int)) {
    const auto theirs = run(1, 100, 1).angular;
    const auto ours = angular<Problem>();
    double apart = 0;
    for (std::size_t k = 0; k < 3; ++k) apart = std::max(apart, std::abs(theirs[k] - ours[k]));
    return apart;
  }

  void print(double disagreement) const {
    std::printf(
        "{\"lanes\": %zu, \"isa\": \"%s\", \"cores\": %u, \"peak_flops\": %.6g, "
        "\"disagreement\": %.3g,\n %s,\n \"rows\": [\n%s]}\n",
        Lanes::lanes, std::string(hamotor::instruction_set).c_str(),
        std::thread::hardware_concurrency(), peak_, disagreement, reference().c_str(),
        rows_.c_str());
  }

 private:
  [[nodiscard]] static std::string reference() {
    const auto free = angular<FreeRotation>();
    const auto spring = angular<Spring>();
    std::array<char, 512> text{};
    std::snprintf(text.data(), text.size(),
                  "\"angular\": {\"%s\": [%.17g, %.17g, %.17g], \"%s\": [%.17g, %.17g, %.17g]}",
                  FreeRotation::name, free[0], free[1], free[2], Spring::name, spring[0], spring[1],
                  spring[2]);
    return text.data();
  }

  [[nodiscard]] static int steps_for(std::size_t bodies) {
    return bodies > 100000 ? 32 : bodies > 4096 ? 256 : static_cast<int>(131072 / bodies);
  }
  [[nodiscard]] int bursts(std::size_t bodies) const { return bodies > 4096 ? 6 : quick_ ? 5 : 25; }

  /// Steps a second, and the peak meanwhile: a processor's clock changes.
  struct Rate {
    double rate = 0;
    Peak peak{};
  };

  /// By so many threads each, all of them in turn.
  template <class Problem, template <class> class Method>
  [[nodiscard]] std::vector<Rate> measured(std::size_t bodies,
                                           const std::vector<unsigned>& threads) {
    const auto system = Problem::template system<Lanes>();
    using System = std::remove_cvref_t<decltype(system)>;
    using Ensemble = hamotor::Ensemble<System, Method<System>>;
    std::vector<typename Ensemble::Member> members;
    for (std::size_t k = 0; k < bodies; ++k) members.push_back(member<System>(k));
    std::vector<Ensemble> ensembles;
    for (const unsigned many : threads) {
      ensembles.emplace_back(system, Method<System>{}, 0.0, step, members, many);
    }
    const int steps = steps_for(bodies);
    std::vector<Rate> found(threads.size());
    for (int burst = 0; burst < bursts(bodies); ++burst) {
      const Peak now = peak();
      for (std::size_t k = 0; k < threads.size(); ++k) {
        const double taken = shortest(
            bodies > 100000 ? 3 : 4,
            [&] {
              if (ensembles[k].advance(steps) != bodies) std::fprintf(stderr, "a body failed\n");
            },
            threads[k] == 1 ? own_time : wall_time);
        found[k].rate = std::max(found[k].rate, static_cast<double>(bodies) * steps / taken);
        Peak& most = found[k].peak;
        most = {std::max(most.multiply_adds, now.multiply_adds), std::max(most.mixed, now.mixed)};
      }
    }
    return found;
  }

  struct Row {
    const char* problem;
    const char* method;
    const char* contestant;
    std::size_t bodies;
    unsigned threads;
    Rate found;
    Cost of_step;
  };
  void add(const Row& row) {
    peak_ = std::max(peak_, row.found.peak.flops());
    std::array<char, 512> text{};
    std::snprintf(
        text.data(), text.size(),
        "%s  {\"problem\": \"%s\", \"method\": \"%s\", \"contestant\": \"%s\", "
        "\"bodies\": %zu, \"threads\": %u, \"steps_per_second\": %.6g, "
        "\"flops_per_step\": %.4g, \"slots_per_step\": %.4g, \"products_per_step\": %.4g, "
        "\"peak_flops\": %.6g, \"peak_mixed\": %.6g}",
        rows_.empty() ? "" : ",\n", row.problem, row.method, row.contestant, row.bodies,
        row.threads, row.found.rate, row.of_step.flops, row.of_step.slots, row.of_step.products,
        row.found.peak.flops(), row.found.peak.mixed);
    rows_ += text.data();
  }

  bool quick_;
  double peak_ = 0;
  std::string rows_;
};

void run(bool quick) {
  Report report(quick);
  report.measure<FreeRotation, Rk4>("rk4", true);
  report.eigen(FreeRotation::name, eigen_free);
  report.measure<Spring, Rk4>("rk4", true);
  report.eigen(Spring::name, eigen_spring);
  report.measure<FreeMotion, Rk4>("rk4", false);
  report.measure<FreeRotation, Strang>("splitting2, plain sums", true);
  report.measure<FreeRotation, StrangCompensated>("splitting2", false);
  report.measure<FreeRotation, Order4>("splitting4, plain sums", false);
  report.measure<Spring, Strang>("splitting2, plain sums", false);
  report.measure<Spring, StrangCompensated>("splitting2", false);
  report.measure<Spring, Order4>("splitting4, plain sums", false);
  report.print(std::max(Report::disagreement<FreeRotation>(eigen_free),
                        Report::disagreement<Spring>(eigen_spring)));
}

}  // namespace
}  // namespace bench

int main(int count, char** words) {
  bench::run(count > 1 && std::strcmp(words[1], "--quick") == 0);
  return 0;
}
