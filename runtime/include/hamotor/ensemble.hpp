// Many members of one system, each on a lane, stepped by one method.
//
// Members are kept in blocks of as many as a pack has lanes: structures of arrays, each block a
// state, and a stepper, whose numbers are packs.  A block is loaded once for many steps, two are
// stepped in turn, so that one's operations fill the time in which another's wait, and threads take
// contiguous pieces.  No member knows of the others: its bits are the
// same alone.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <system_error>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "hamotor/angle_increment.hpp"
#include "hamotor/pack.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/state.hpp"

namespace hamotor {

namespace detail {

/// One lane's number of a scalar, and one lane's condition.
template <class S>
[[nodiscard]] constexpr scalar::NumberOf<S> lane_of(const S& x, std::size_t lane) noexcept {
  if constexpr (is_pack<S>) {
    return x[lane];
  } else {
    return x;
  }
}
template <class S>
constexpr void set_lane(S& x, std::size_t lane, const scalar::NumberOf<S>& value) noexcept {
  if constexpr (is_pack<S>) {
    x.set(lane, value);
  } else {
    x = value;
  }
}
template <class Condition>
[[nodiscard]] constexpr bool holds_in(const Condition& condition, std::size_t lane) noexcept {
  if constexpr (std::is_same_v<Condition, bool>) {
    return condition;
  } else {
    return condition[lane];
  }
}

/// f(component of `to`, component of `from`) for all of an element.
template <class To, class From, class Function>
[[nodiscard]] constexpr To merged(const To& to, const From& from, const Function& f) noexcept {
  auto x = to.components();
  const auto y = from.components();
  for (std::size_t k = 0; k < x.size(); ++k) f(x[k], y[k]);
  return To::from(x);
}

/// The same for all of a state.
template <class To, class From, class Function>
constexpr void merge(To& to, const From& from, const Function& f) noexcept {
  for (std::size_t i = 0; i < To::bodies; ++i) {
    to.motors[i] = merged(to.motors[i], from.motors[i], f);
    to.momenta[i] = merged(to.momenta[i], from.momenta[i], f);
  }
}

}  // namespace detail

/// One system for all members.
template <class System>
struct OneForAll {
  System system;
  constexpr OneForAll(const System& one) noexcept : system(one) {}
  [[nodiscard]] constexpr const System& operator()(std::size_t /*block*/) const noexcept {
    return system;
  }
};

/// A system for each block of members.
template <class System>
struct OneForEach {
  std::vector<System> systems;
  /// Blocks to spare at the end take the last one.
  [[nodiscard]] constexpr const System& operator()(std::size_t block) const noexcept {
    return systems[std::min(block, systems.size() - 1)];
  }
};

/// Whether a method's steps can be left open, and its states be closed when they are asked for.
template <class Method>
inline constexpr bool stays_open = false;
template <class Method>
  requires requires { Method::stays_open; }
inline constexpr bool stays_open<Method> = Method::stays_open;

/// Whether a method carries something else than the state, which is made of it when asked for.
template <class Method>
inline constexpr bool carries_state = false;
template <class Method>
  requires requires { Method::carries_state; }
inline constexpr bool carries_state<Method> = Method::carries_state;

/// Members of a system under way.
///
/// `Systems` gives the system of a block, in which each lane may have parameters of its own.  With
/// a number for the system's scalar in place of a pack, any method works, one member at a time:
/// those that choose their own steps or iterate until they have converged would have to wait for
/// the slowest lane.
template <HamiltonianSystem System, Stepper<System> Method, class Systems = OneForAll<System>>
class Ensemble {
 public:
  using Scalar = typename System::Scalar;
  using Number = scalar::NumberOf<Scalar>;
  using Member = State<typename System::Group, System::bodies, Number>;
  static constexpr std::size_t lanes = lanes_of<Scalar>;

  /// Every member starts at `time` with a copy of `method`; `threads` 0 are all cores.  May throw
  /// std::bad_alloc.
  Ensemble(Systems systems, const Method& method, Number time, Number step,
           std::span<const Member> members, unsigned threads = 0)
      : systems_(std::move(systems)),
        time_(time),
        step_(step),
        members_(members.size()),
        threads_(threads == 0 ? std::max(1U, std::thread::hardware_concurrency()) : threads),
        bundles_((members.size() + in_bundle - 1) / in_bundle),
        ends_(members.size()) {
    // Lanes to spare repeat the last member, so that nothing odd happens in them.
    for (std::size_t k = 0; k < bundles_.size() * in_bundle; ++k) {
      Block& block = block_of(k);
      block.method = method;
      if constexpr (requires { block.method.forget(); }) block.method.forget();
      detail::merge(block.state, members[std::min(k, members.size() - 1)],
                    [&](Scalar& to, const Number& from) { detail::set_lane(to, k % lanes, from); });
    }
    if constexpr (stays_open<Method>) {
      for (std::size_t k = 0; k < bundles_.size() * in_turn; ++k) {
        Block& block = bundles_[k / in_turn][k % in_turn];
        block.method.open(systems_(k), block.state, Scalar(step_));
      }
    }
  }

  /// Every member that is alive takes so many steps, none where there are fewer than 0: back goes
  /// an ensemble of a negative step.  How many still are alive.
  std::size_t advance(std::int64_t steps) {
    steps = std::max<std::int64_t>(steps, 0);
    const std::size_t workers = std::min<std::size_t>(threads_, bundles_.size());
    if (workers > 0) {
      // In pieces, which whoever is free takes: cores are not equally fast, nor left alone.
      const std::size_t piece = std::max<std::size_t>(1, bundles_.size() / (workers * 128));
      std::atomic<std::size_t> taken{0};
      const auto work = [&] {
        while (true) {
          const std::size_t first = taken.fetch_add(piece, std::memory_order_relaxed);
          if (first >= bundles_.size()) return;
          advance_range(first, std::min(first + piece, bundles_.size()), steps);
        }
      };
      std::vector<std::jthread> others;
      try {
        for (std::size_t w = 1; w < workers; ++w) others.emplace_back(work);
      } catch (const std::system_error&) {  // no more threads to be had: the others do it
      }
      work();
    }
    index_ += steps;
    return static_cast<std::size_t>(std::count_if(
        ends_.begin(), ends_.end(), [](const End& end) { return end.why == Failure::none; }));
  }

  [[nodiscard]] std::size_t size() const noexcept { return members_; }

  /// The state of a member: the last good one where it failed.
  [[nodiscard]] Member state(std::size_t member) const noexcept {
    Member result{};
    auto state = block_of(member).state;
    if constexpr (stays_open<Method>) {
      state = block_of(member).method.closed(systems_(member / lanes), state, Scalar(step_),
                                             Scalar(static_cast<Number>(steps(member))));
    }
    detail::merge(result, state, [&](Number& to, const Scalar& from) {
      to = detail::lane_of(from, member % lanes);
    });
    return result;
  }

  /// Why a member stopped.
  [[nodiscard]] Failure failure(std::size_t member) const noexcept { return ends_[member].why; }

  /// Steps that a member took.
  [[nodiscard]] std::int64_t steps(std::size_t member) const noexcept {
    return failure(member) == Failure::none ? index_ : ends_[member].steps;
  }

  /// The time of a member's state.
  [[nodiscard]] Number time(std::size_t member) const noexcept {
    return mul_add(static_cast<Number>(steps(member)), step_, time_);
  }

  /// ∫ dH/dt dt of a member, J.
  [[nodiscard]] Number work(std::size_t member) const noexcept
    requires PoweredSystem<System>
  {
    if (failure(member) != Failure::none) return ends_[member].work;
    return detail::lane_of(block_of(member).method.work(), member % lanes);
  }

  /// How far a member's steps left the group; of one that failed, with the step that did.
  [[nodiscard]] Drift<Number> drift(std::size_t member) const noexcept {
    const auto& drift = block_of(member).method.drift();
    return {detail::lane_of(drift.largest, member % lanes),
            detail::lane_of(drift.sum, member % lanes)};
  }

 private:
  /// Blocks that are stepped in turn: a step's operations wait for each other, those of an open
  /// step for twice as long as there are any.
  static constexpr std::size_t in_turn = !is_pack<Scalar> ? 1 : stays_open<Method> ? 8 : 2;
  static constexpr std::size_t in_bundle = in_turn * lanes;
  /// Steps between looks whether all numbers are finite; a bundle in which one is not takes them
  /// again one by one.
  static constexpr std::int64_t unseen = 64;

  struct Block {
    StateOf<System> state;
    Method method;
  };
  using Bundle = std::array<Block, in_turn>;
  struct NoWork {};
  struct End {
    Failure why = Failure::none;
    std::int64_t steps = 0;
    [[no_unique_address]] std::conditional_t<PoweredSystem<System>, Number, NoWork> work{};
  };

  [[nodiscard]] Block& block_of(std::size_t member) noexcept {
    return bundles_[member / in_bundle][member / lanes % in_turn];
  }
  [[nodiscard]] const Block& block_of(std::size_t member) const noexcept {
    return bundles_[member / in_bundle][member / lanes % in_turn];
  }

  [[nodiscard]] Scalar now(std::int64_t index) const noexcept {
    return mul_add(Scalar(static_cast<Number>(index)), Scalar(step_), Scalar(time_));
  }

  void advance_range(std::size_t first, std::size_t last, std::int64_t steps) noexcept {
    for (std::size_t bundle = first; bundle < last; ++bundle) {
      for (std::int64_t done = 0; done < steps; done += unseen) {
        const std::int64_t many = std::min(unseen, steps - done);
        const std::size_t alive = alive_in(bundle);
        if (alive == in_bundle) {
          Bundle after = bundles_[bundle];
          step(after, bundle, index_ + done, many);
          if (are_good(after)) {
            bundles_[bundle] = after;
            continue;
          }
        }
        if (alive > 0) step_watched(bundle, index_ + done, many);
      }
    }
  }

  /// Lanes that have not failed; those to spare at the end count with the last member.
  [[nodiscard]] std::size_t alive_in(std::size_t bundle) const noexcept {
    std::size_t alive = 0;
    for (std::size_t k = bundle * in_bundle; k < (bundle + 1) * in_bundle; ++k) {
      alive += ends_[std::min(k, members_ - 1)].why == Failure::none ? 1U : 0U;
    }
    return alive;
  }

  [[gnu::flatten, gnu::noinline]] void step(Bundle& blocks, std::size_t bundle, std::int64_t index,
                                            std::int64_t steps) const noexcept {
    [&]<std::size_t... g>(std::index_sequence<g...>) {
      const std::array<System, in_turn> systems{systems_(bundle * in_turn + g)...};
      const Scalar h(step_);
      if constexpr (stays_open<Method>) {
        const auto take = [&]<AngleRange range> {
          for (std::int64_t k = 0; k < steps; ++k) {
            for (std::size_t turn = 0; turn < Method::turns; ++turn) {
              (blocks[g].method.template do_turn<range>(systems[g], blocks[g].state, h, turn), ...);
            }
          }
        };
        // The same bits whichever it is: only what cannot count is left out.
        switch (std::max({Method::range_of_turns(systems[g], blocks[g].state, h)...})) {
          case AngleRange::tiny:
            return take.template operator()<AngleRange::tiny>();
          case AngleRange::small:
            return take.template operator()<AngleRange::small>();
          case AngleRange::any:
            return take.template operator()<AngleRange::any>();
        }
      } else if constexpr (requires { typename Method::Plan; }) {
        const std::array<typename Method::Plan, in_turn> plans{
            typename Method::Plan(systems[g], h)...};
        if constexpr (carries_state<Method>) {
          (blocks[g].method.open(plans[g], blocks[g].state), ...);
          for (std::int64_t k = 0; k < steps; ++k) (blocks[g].method.do_open_step(plans[g]), ...);
          ((blocks[g].state = blocks[g].method.closed(plans[g])), ...);
        } else {
          for (std::int64_t k = 0; k < steps; ++k) {
            const Scalar t = now(index + k);
            (blocks[g].method.go_on(plans[g], blocks[g].state, t), ...);
          }
        }
      } else {
        for (std::int64_t k = 0; k < steps; ++k) {
          const Scalar t = now(index + k);
          (go_on(blocks[g].method, systems[g], blocks[g].state, t, h), ...);
        }
      }
    }(std::make_index_sequence<in_turn>{});
  }

  /// Step by step, each lane as far as it gets.
  void step_watched(std::size_t bundle, std::int64_t index, std::int64_t steps) noexcept {
    for (std::int64_t k = 0; k < steps; ++k) {
      Bundle after = bundles_[bundle];
      step(after, bundle, index + k, 1);
      for (std::size_t g = 0; g < in_turn; ++g) {
        const auto finite = is_finite(after[g].state);
        const auto on_group = after[g].method.drift().largest <= Scalar(Number(largest_defect));
        auto& [state, method] = bundles_[bundle][g];
        for (std::size_t lane = 0; lane < lanes; ++lane) {
          const std::size_t member = std::min(bundle * in_bundle + g * lanes + lane, members_ - 1);
          End& end = ends_[member];
          const bool good = detail::holds_in(finite, lane) && detail::holds_in(on_group, lane);
          if (end.why == Failure::none && good) {
            detail::merge(state, after[g].state, [&](Scalar& to, const Scalar& from) {
              detail::set_lane(to, lane, detail::lane_of(from, lane));
            });
          } else if (end.why == Failure::none) {
            end.why =
                detail::holds_in(finite, lane) ? Failure::left_group : reason_of(after[g].method);
            end.steps = index + k;
            if constexpr (PoweredSystem<System>) end.work = detail::lane_of(method.work(), lane);
          }
        }
        method = after[g].method;
      }
    }
  }

  [[nodiscard]] static bool are_good(const Bundle& blocks) noexcept {
    bool good = true;
    for (const Block& block : blocks) {
      good = good && all(is_finite(block.state)) &&
             all(block.method.drift().largest <= Scalar(Number(largest_defect)));
    }
    return good;
  }

  [[nodiscard]] static Failure reason_of(const Method& method) noexcept {
    const Failure said = failure_of(method);
    return said == Failure::none ? Failure::not_finite : said;
  }

  Systems systems_;
  Number time_;
  Number step_;
  std::size_t members_;
  unsigned threads_;
  std::int64_t index_ = 0;
  std::vector<Bundle> bundles_;
  std::vector<End> ends_;
};

template <HamiltonianSystem System, class Method, class... More>
Ensemble(System, Method, More...) -> Ensemble<System, Method>;

}  // namespace hamotor
