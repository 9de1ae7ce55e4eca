// A contest: operations of rigid-body geometry, each done by several contestants, timed in a
// dependent chain and over arrays, and compared with itself in __float128.
//
// A contestant is a class template C<S> that says how it holds a thing of some kind,
//   make(kind, exact)  from the pga3 element with __float128 components, rounded to S
//   exact(kind, held)  and back, without rounding
// and which operations it knows.  What it does not know is left out.  Every operation is marked to
// be inlined, so that none is timed with the call that another is spared.
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <random>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "hamotor/pack.hpp"
#include "hamotor/pga3/pga3.hpp"
#include "hamotor/pga3/se3.hpp"
#include "quad.hpp"

namespace bench {

namespace pga3 = hamotor::pga3;

/// A free body's motion and momentum.
template <class S>
struct Body {
  pga3::Motor<S> motion;
  pga3::se3::Momentum<S> momentum;
};

/// Mass (kg) and principal moments (kg m²) of the body that is stepped, and the step (s).
inline constexpr double mass = 1.5;
inline constexpr std::array<double, 3> moments{1.0, 2.0, 3.0};
inline constexpr double step_size = 0.01;

namespace kind {
struct Motion {
  using Exact = pga3::Motor<Quad>;
};
struct Point {
  using Exact = pga3::Point<Quad>;
};
struct Direction {
  using Exact = pga3::Direction<Quad>;
};
struct Plane {
  using Exact = pga3::Plane<Quad>;
};
struct Line {
  using Exact = pga3::Bivector<Quad>;
};
struct Bivector {
  using Exact = pga3::Bivector<Quad>;
};
struct Rate {
  using Exact = pga3::se3::Rate<Quad>;
};
struct Momentum {
  using Exact = pga3::se3::Momentum<Quad>;
};
struct Body {
  using Exact = bench::Body<Quad>;
};
/// A motion held as its matrix on things of a kind: it is given, and the time to make it is not.
template <class Kind>
struct MatrixOn {
  using Exact = pga3::Motor<Quad>;
};
struct Nothing {};
}  // namespace kind

using Values = std::vector<Quad>;

template <class Element>
[[nodiscard]] Values values(const Element& x) {
  const auto all = x.components();
  return Values(all.begin(), all.end());
}

[[nodiscard]] inline Values values(const Values& x) { return x; }

/// What a motion does: the images of the origin and of the axes.  A motor's sign does not count.
[[nodiscard]] Values values(const pga3::Motor<Quad>& m);
[[nodiscard]] Values values(const Body<Quad>& body);

/// Random exact things of size 1.
class Source {
 public:
  explicit Source(std::uint64_t seed) : engine_(seed) {}

  [[nodiscard]] pga3::Motor<Quad> make(kind::Motion);
  template <class Kind>
  [[nodiscard]] pga3::Motor<Quad> make(kind::MatrixOn<Kind>) {
    return make(kind::Motion{});
  }
  [[nodiscard]] pga3::Point<Quad> make(kind::Point);
  [[nodiscard]] pga3::Direction<Quad> make(kind::Direction);
  [[nodiscard]] pga3::Plane<Quad> make(kind::Plane);
  [[nodiscard]] pga3::Bivector<Quad> make(kind::Line);
  [[nodiscard]] pga3::Bivector<Quad> make(kind::Bivector);
  /// Angles up to half a turn, spread so that long chains of brackets neither grow nor vanish.
  [[nodiscard]] pga3::se3::Rate<Quad> make(kind::Rate);
  [[nodiscard]] pga3::se3::Momentum<Quad> make(kind::Momentum);
  [[nodiscard]] Body<Quad> make(kind::Body);
  [[nodiscard]] kind::Nothing make(kind::Nothing) { return {}; }
  /// Kinds that know themselves how.
  template <class Kind>
  [[nodiscard]] auto make(Kind) -> decltype(Kind::make(std::declval<Source&>())) {
    return Kind::make(*this);
  }

  [[nodiscard]] double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }

 private:
  template <class Element>
  [[nodiscard]] Element element();

  std::mt19937_64 engine_;
};

template <class Kind>
using Exact = decltype(std::declval<Source&>().make(Kind{}));

namespace operation {
struct MotorProduct {
  static constexpr const char* name = "motor product";
  using A = kind::Motion;
  using B = kind::Motion;
  using Result = kind::Motion;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto& a, const auto& b)
      -> decltype(C::compose(a, b)) {
    return C::compose(a, b);
  }
};
template <class Kind>
struct Move {
  using A = kind::Motion;
  using B = Kind;
  using Result = Kind;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto& m, const auto& x)
      -> decltype(C::move(Kind{}, m, x)) {
    return C::move(Kind{}, m, x);
  }
};
struct MovePoint : Move<kind::Point> {
  static constexpr const char* name = "point";
};
struct MoveDirection : Move<kind::Direction> {
  static constexpr const char* name = "direction";
};
struct MovePlane : Move<kind::Plane> {
  static constexpr const char* name = "plane";
};
struct MoveLine : Move<kind::Line> {
  static constexpr const char* name = "line";
};
template <class Kind>
struct Transform {
  using A = kind::MatrixOn<Kind>;
  using B = Kind;
  using Result = Kind;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto& m, const auto& x)
      -> decltype(C::transform(Kind{}, m, x)) {
    return C::transform(Kind{}, m, x);
  }
};
struct TransformPoint : Transform<kind::Point> {
  static constexpr const char* name = "point, matrix given";
};
struct TransformDirection : Transform<kind::Direction> {
  static constexpr const char* name = "direction, matrix given";
};
struct TransformPlane : Transform<kind::Plane> {
  static constexpr const char* name = "plane, matrix given";
};
struct TransformLine : Transform<kind::Line> {
  static constexpr const char* name = "line, matrix given";
};
struct Commutator {
  static constexpr const char* name = "commutator";
  using A = kind::Bivector;
  using B = kind::Bivector;
  using Result = kind::Bivector;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto& a, const auto& b)
      -> decltype(C::commutator(a, b)) {
    return C::commutator(a, b);
  }
};
struct Coadjoint {
  static constexpr const char* name = "coadjoint";
  using A = kind::Rate;
  using B = kind::Momentum;
  using Result = kind::Momentum;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto& w, const auto& mu)
      -> decltype(C::coadjoint(w, mu)) {
    return C::coadjoint(w, mu);
  }
};
struct Exp {
  static constexpr const char* name = "exp";
  using A = kind::Nothing;
  using B = kind::Rate;
  using Result = kind::Motion;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto&, const auto& w) -> decltype(C::exp(w)) {
    return C::exp(w);
  }
};
struct Log {
  static constexpr const char* name = "log";
  using A = kind::Nothing;
  using B = kind::Motion;
  using Result = kind::Rate;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto&, const auto& m) -> decltype(C::log(m)) {
    return C::log(m);
  }
};
struct ExpLog {
  static constexpr const char* name = "exp of log";
  using A = kind::Nothing;
  using B = kind::Motion;
  using Result = kind::Motion;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto&, const auto& m)
      -> decltype(C::exp(C::log(m))) {
    return C::exp(C::log(m));
  }
};
struct Normalize {
  static constexpr const char* name = "normalize";
  using A = kind::Nothing;
  using B = kind::Motion;
  using Result = kind::Motion;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto&, const auto& m)
      -> decltype(C::normalize(m)) {
    return C::normalize(m);
  }
};
/// One step of the classical Runge–Kutta method, of a free body.
struct RungeKutta {
  static constexpr const char* name = "RK4 step";
  using A = kind::Nothing;
  using B = kind::Body;
  using Result = kind::Body;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto&, const auto& x)
      -> decltype(C::runge_kutta(x)) {
    return C::runge_kutta(x);
  }
};
struct Rkmk4 {
  static constexpr const char* name = "rkmk4 step";
  using A = kind::Nothing;
  using B = kind::Body;
  using Result = kind::Body;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto&, const auto& x) -> decltype(C::rkmk4(x)) {
    return C::rkmk4(x);
  }
};
struct Splitting2 {
  static constexpr const char* name = "splitting2 step";
  using A = kind::Nothing;
  using B = kind::Body;
  using Result = kind::Body;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto&, const auto& x)
      -> decltype(C::splitting2(x)) {
    return C::splitting2(x);
  }
};
}  // namespace operation

/// The classical Runge–Kutta method, x + h/6 (k₁ + 2k₂ + 2k₃ + k₄); C::slope(x) is k, and
/// C::add(x, c, k) is x + c k.
template <class C, class S, class State>
[[nodiscard]] HAMOTOR_INLINE inline State classical_runge_kutta(const State& x) {
  const S h = static_cast<S>(step_size);
  const State one = C::slope(x);
  const State two = C::slope(C::add(x, S(0.5) * h, one));
  const State three = C::slope(C::add(x, S(0.5) * h, two));
  const State four = C::slope(C::add(x, h, three));
  const State outer = C::add(C::add(x, h / S(6), one), h / S(6), four);
  return C::add(C::add(outer, h / S(3), two), h / S(3), three);
}

/// Largest difference, relative to the largest value.
[[nodiscard]] double relative_difference(const Values& a, const Values& b);

/// What the generated kernel gives in __float128.
template <class Op>
[[nodiscard]] Values reference(const Exact<typename Op::A>& a, const Exact<typename Op::B>& b);

struct Nothing {};

template <class C, class Kind>
[[nodiscard]] auto make(Kind kind, const typename Kind::Exact& x) -> decltype(C::make(kind, x)) {
  return C::make(kind, x);
}
template <class C>
[[nodiscard]] Nothing make(kind::Nothing, const kind::Nothing&) {
  return {};
}

template <class C, class Kind>
using Held = decltype(make<C>(Kind{}, std::declval<const Exact<Kind>&>()));

/// The same numbers in __float128.  Everything held is numbers and, at its end, padding.
template <class Wide, class S, class Narrow>
[[nodiscard]] Wide widened(const Narrow& x) {
  Wide wide{};
  if constexpr (!std::is_same_v<Narrow, Nothing>) {
    constexpr std::size_t n = std::min(sizeof(Narrow) / sizeof(S), sizeof(Wide) / sizeof(Quad));
    std::array<S, n> from;
    std::array<Quad, n> to;
    std::memcpy(from.data(), &x, sizeof from);
    for (std::size_t i = 0; i < n; ++i) to[i] = Quad(from[i]);
    std::memcpy(static_cast<void*>(&wide), to.data(), sizeof to);
  }
  return wide;
}

struct Measured {
  double error;     ///< largest relative error against the same operation in __float128
  double disagree;  ///< largest relative difference of that from the generated kernel
};

/// What an operation gives for held things of its kinds.
template <class C, class Op>
using Given =
    std::remove_cv_t<decltype(Op::template run<C>(std::declval<const Held<C, typename Op::A>&>(),
                                                  std::declval<const Held<C, typename Op::B>&>()))>;

/// A contestant's scalar with as many numbers as a register of the processor has.
template <class S>
using Lanes = hamotor::Pack<S, hamotor::widest<S>>;

/// Things from `exact` on, one in each lane of what C<Lanes<S>> holds.
template <template <class> class C, class S, class Kind>
[[nodiscard]] Held<C<Lanes<S>>, Kind> in_lanes(Kind kind, const Exact<Kind>* exact) {
  Held<C<Lanes<S>>, Kind> block{};
  if constexpr (!std::is_same_v<Kind, kind::Nothing>) {
    using One = Held<C<S>, Kind>;
    constexpr std::size_t n = std::min(sizeof(One) / sizeof(S), sizeof block / sizeof(Lanes<S>));
    auto* const numbers = reinterpret_cast<Lanes<S>*>(&block);
    std::fill_n(numbers, n, Lanes<S>(0));
    for (std::size_t lane = 0; lane < Lanes<S>::lanes; ++lane) {
      const One one = make<C<S>>(kind, exact[lane]);
      const auto* const from = reinterpret_cast<const S*>(&one);
      for (std::size_t i = 0; i < n; ++i) numbers[i].set(lane, from[i]);
    }
  }
  return block;
}

/// The thing in a lane.
template <class One, class S, class Block>
[[nodiscard]] One of_lane(const Block& block, std::size_t lane) {
  constexpr std::size_t n = std::min(sizeof(One) / sizeof(S), sizeof block / sizeof(Lanes<S>));
  One one{};
  const auto* const numbers = reinterpret_cast<const Lanes<S>*>(&block);
  auto* const to = reinterpret_cast<S*>(&one);
  for (std::size_t i = 0; i < n; ++i) to[i] = numbers[i][lane];
  return one;
}

/// Worst of 1000 random inputs; `in_packs`: computed by C<Lanes<S>>, several at once.
template <template <class> class C, class S, class Op, bool in_packs = false>
[[nodiscard]] Measured measure() {
  using A = typename Op::A;
  using B = typename Op::B;
  using Result = Given<C<S>, Op>;
  constexpr std::size_t count = 1000;
  Source source(2);
  std::vector<Exact<A>> exact_a;
  std::vector<Exact<B>> exact_b;
  for (std::size_t i = 0; i < count; ++i) {
    exact_a.push_back(source.make(A{}));
    exact_b.push_back(source.make(B{}));
  }
  std::vector<Result> results(count);
  if constexpr (in_packs) {
    constexpr std::size_t lanes = Lanes<S>::lanes;
    for (std::size_t i = 0; i < count; i += lanes) {
      const std::size_t from = std::min(i, count - lanes);
      const auto block = Op::template run<C<Lanes<S>>>(in_lanes<C, S>(A{}, &exact_a[from]),
                                                       in_lanes<C, S>(B{}, &exact_b[from]));
      for (std::size_t lane = 0; lane < lanes; ++lane)
        results[from + lane] = of_lane<Result, S>(block, lane);
    }
  } else {
    for (std::size_t i = 0; i < count; ++i)
      results[i] = Op::template run<C<S>>(make<C<S>>(A{}, exact_a[i]), make<C<S>>(B{}, exact_b[i]));
  }
  Measured worst{0.0, 0.0};
  for (std::size_t i = 0; i < count; ++i) {
    const auto wide_a = widened<Held<C<Quad>, A>, S>(make<C<S>>(A{}, exact_a[i]));
    const auto wide_b = widened<Held<C<Quad>, B>, S>(make<C<S>>(B{}, exact_b[i]));
    const auto wide = Op::template run<C<Quad>>(wide_a, wide_b);
    using Wide = std::remove_cv_t<decltype(wide)>;
    const Values truth = values(C<Quad>::exact(typename Op::Result{}, wide));
    const Values found =
        values(C<Quad>::exact(typename Op::Result{}, widened<Wide, S>(results[i])));
    const Values generated = reference<Op>(exact_a[i], exact_b[i]);
    const double error = relative_difference(found, truth);
    const double disagree = relative_difference(truth, generated);
    if (!(error <= worst.error)) worst.error = error;
    if (!(disagree <= worst.disagree)) worst.disagree = disagree;
  }
  return worst;
}

/// An element rounded to numbers, the same in every lane where S has several.
template <class S, class Element>
[[nodiscard]] auto rounded(const Element& x) {
  return x.template cast<hamotor::scalar::NumberOf<S>>().template cast<S>();
}

/// The first number that a thing holds.
template <class S, class T>
[[nodiscard]] S& first(T& x) {
  return *reinterpret_cast<S*>(&x);
}

/// Has every number of a thing computed, each by itself.  Kept as a whole it would go to memory:
/// g++ 12 packs eight numbers into a register of 64 bytes for that, all of which the next operation
/// then waits for, with a port less of the processor until it is done.
template <class S, class T>
HAMOTOR_INLINE inline void compute(const T& x) {
  const auto one = [](S number) {
#if defined(__x86_64__)
    asm volatile("" : : "x"(number));
#elif defined(__aarch64__)
    asm volatile("" : : "w"(number));
#else
    benchmark::DoNotOptimize(number);
#endif
  };
  const S* const numbers = reinterpret_cast<const S*>(&x);
  [&]<std::size_t... k>(std::index_sequence<k...>) {
    (one(numbers[k]), ...);
  }(std::make_index_sequence<sizeof(T) / sizeof(S)>{});
}

/// The longest array.
inline constexpr std::size_t longest = 4096;

/// Random exact things, made once: that takes longer than to time what is done with them.
template <class Kind, std::uint64_t seed>
[[nodiscard]] const std::vector<Exact<Kind>>& exact_sample() {
  static const std::vector<Exact<Kind>> all = [] {
    Source source(seed);
    std::vector<Exact<Kind>> made(longest);
    for (auto& x : made) x = source.make(Kind{});
    return made;
  }();
  return all;
}

/// The first `count` of them, as a contestant holds them.
template <class C, class Kind, std::uint64_t seed>
[[nodiscard]] std::vector<Held<C, Kind>> sample(std::size_t count) {
  std::vector<Held<C, Kind>> all;
  all.reserve(count);
  const auto& exact = exact_sample<Kind, seed>();
  for (std::size_t i = 0; i < count; ++i) all.push_back(make<C>(Kind{}, exact[i]));
  return all;
}

/// The same, in lanes.
template <template <class> class C, class S, class Kind, std::uint64_t seed>
[[nodiscard]] std::vector<Held<C<Lanes<S>>, Kind>> sample_in_lanes(std::size_t count) {
  std::vector<Held<C<Lanes<S>>, Kind>> all;
  const auto& exact = exact_sample<Kind, seed>();
  for (std::size_t i = 0; i < count; i += Lanes<S>::lanes)
    all.push_back(in_lanes<C, S>(Kind{}, &exact[i]));
  return all;
}

/// Time an operation takes when its second operand is the result of the one before; where result
/// and operand are of different kinds, one number of it is (times 0).  The first operand is another
/// one every time.  Chains begin anew from the same start after 256 operations.
template <template <class> class C, class S, class Op>
void latency(benchmark::State& state) {
  using B = Held<C<S>, typename Op::B>;
  constexpr std::size_t length = 256;
  const auto a = sample<C<S>, typename Op::A, 0>(length);
  const auto b = sample<C<S>, typename Op::B, 1>(length);
  // A read that nobody foresees.  After DoNotOptimize, g++ 12 took another number for it.
  const volatile S unknown(0);
  const S zero = unknown;
  auto last = Op::template run<C<S>>(a[0], b[0]);
  for (auto _ : state) {
    if constexpr (std::is_same_v<decltype(last), B>) {
      auto x = b[0];
      first<S>(x) += zero * first<S>(last);
      for (std::size_t i = 0; i < length; ++i) x = Op::template run<C<S>>(a[i], x);
      last = x;
    } else {
      for (std::size_t i = 0; i < length; ++i) {
        auto x = b[i];
        first<S>(x) += zero * first<S>(last);
        last = Op::template run<C<S>>(a[i], x);
        // All of it, not only the number that is waited for.
        compute<S>(last);
      }
    }
    benchmark::DoNotOptimize(last);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(length) * state.iterations());
}

/// The time of operations over arrays of operands and results; the argument says how many.
template <class C, class Op>
void over_arrays(benchmark::State& state, const std::vector<Held<C, typename Op::A>>& a,
                 const std::vector<Held<C, typename Op::B>>& b) {
  std::vector<Given<C, Op>> result;
  for (std::size_t i = 0; i < a.size(); ++i) result.push_back(Op::template run<C>(a[i], b[i]));
  for (auto _ : state) {
    const auto* const left = a.data();
    const auto* const right = b.data();
    auto* const out = result.data();
    benchmark::DoNotOptimize(left);
    benchmark::DoNotOptimize(right);
    benchmark::DoNotOptimize(out);
    for (std::size_t i = 0; i < a.size(); ++i) out[i] = Op::template run<C>(left[i], right[i]);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.range(0) * state.iterations());
}

/// Arrays of structures: each thing by itself.
template <template <class> class C, class S, class Op>
void throughput(benchmark::State& state) {
  const auto length = static_cast<std::size_t>(state.range(0));
  over_arrays<C<S>, Op>(state, sample<C<S>, typename Op::A, 0>(length),
                        sample<C<S>, typename Op::B, 1>(length));
}

/// Structures of arrays in blocks: as many things at once as a register has numbers.
template <template <class> class C, class S, class Op>
void throughput_in_lanes(benchmark::State& state) {
  const auto length = static_cast<std::size_t>(state.range(0));
  over_arrays<C<Lanes<S>>, Op>(state, sample_in_lanes<C, S, typename Op::A, 0>(length),
                               sample_in_lanes<C, S, typename Op::B, 1>(length));
}

/// Where measured errors go: a JSON object a line.
using ErrorReport = void (*)(std::FILE*);
std::vector<ErrorReport>& error_reports();

/// What a contestant is called where it takes arrays in lanes; nullptr: it does not.
template <template <class> class C>
inline constexpr const char* name_in_lanes = nullptr;

template <template <class> class C, class S, class Op, bool in_packs>
void report_errors(std::FILE* file) {
  const Measured worst = measure<C, S, Op, in_packs>();
  std::fprintf(file,
               R"({"operation": "%s", "contestant": "%s", "scalar": "%s", )"
               R"("max_relative_error": %.4g, "disagreement": %.4g})"
               "\n",
               Op::name, in_packs ? name_in_lanes<C> : C<S>::name,
               std::is_same_v<S, float> ? "float" : "double", worst.error, worst.disagree);
}

template <template <class> class C, class S, class Op>
void enter_one(const char* scalar) {
  const auto called = [&](const char* contestant, const char* mode) {
    return std::string(Op::name) + "|" + contestant + "|" + scalar + "|" + mode;
  };
  benchmark::RegisterBenchmark(called(C<S>::name, "latency").c_str(), &latency<C, S, Op>);
  benchmark::RegisterBenchmark(called(C<S>::name, "array").c_str(), &throughput<C, S, Op>)
      ->Arg(256)
      ->Arg(longest);
  error_reports().push_back(&report_errors<C, S, Op, false>);
#ifndef HAMOTOR_BENCH_BRIEF
  if constexpr (name_in_lanes<C> != nullptr) {
    benchmark::RegisterBenchmark(called(name_in_lanes<C>, "array").c_str(),
                                 &throughput_in_lanes<C, S, Op>)
        ->Arg(256)
        ->Arg(longest);
    error_reports().push_back(&report_errors<C, S, Op, true>);
  }
#endif
}

/// Whether a contestant can hold an operation's operands and do it.
template <class C, class Op>
concept Knows = requires {
  typename Held<C, typename Op::A>;
  typename Held<C, typename Op::B>;
  Op::template run<C>(std::declval<const Held<C, typename Op::A>&>(),
                      std::declval<const Held<C, typename Op::B>&>());
};

/// Enters a contestant for one operation, if it knows it.
template <template <class> class C, class Op>
void enter_for() {
  if constexpr (Knows<C<double>, Op>) {
#ifndef HAMOTOR_BENCH_DOUBLE_ONLY
    enter_one<C, float, Op>("float");
#endif
    enter_one<C, double, Op>("double");
  }
}

/// Enters a contestant for every operation it knows.
template <template <class> class C>
void enter() {
  enter_for<C, operation::MotorProduct>();
  enter_for<C, operation::MovePoint>();
  enter_for<C, operation::MoveDirection>();
  enter_for<C, operation::MovePlane>();
  enter_for<C, operation::MoveLine>();
  enter_for<C, operation::TransformPoint>();
  enter_for<C, operation::TransformDirection>();
  enter_for<C, operation::TransformPlane>();
  enter_for<C, operation::TransformLine>();
  enter_for<C, operation::Commutator>();
  enter_for<C, operation::Coadjoint>();
  enter_for<C, operation::Exp>();
  enter_for<C, operation::Log>();
  enter_for<C, operation::ExpLog>();
  enter_for<C, operation::Normalize>();
  enter_for<C, operation::RungeKutta>();
  enter_for<C, operation::Rkmk4>();
  enter_for<C, operation::Splitting2>();
}

}  // namespace bench
