// Steps of a length that a tolerance asks for, and states at the times that a caller asks for.
#pragma once

#include <cstddef>
#include <limits>
#include <string_view>
#include <utility>

#include "hamotor/rkmk.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/state.hpp"

namespace hamotor {

/// A pair with an error estimate, in steps that keep it below `tolerance` a unit of time (s⁻¹), or
/// below rounding a step where that is more.
///
/// The steps are the pair's own, whatever times are asked for: a state within the last of them is
/// interpolated (dense output).  A state that is not the one delivered before, or a time that is
/// not, starts anew.  Without a tolerance it is the method itself, one
/// step a call.  The state becomes not a number where a step would have to be shorter than rounding
/// of the time it is part of.
template <class System, class Method = Rkmk54<System>>
class Adaptive {
  using S = typename System::Scalar;

 public:
  static constexpr int order = Method::order;
  static constexpr std::string_view name = Method::name;
  /// Whether sums over steps are compensated.
  static constexpr bool compensated = Method::compensated;

  constexpr Adaptive() noexcept = default;
  constexpr explicit Adaptive(const S& tolerance) noexcept : tolerance_(tolerance) {}

  /// Asks for this local error a unit of time, s⁻¹; 0 for one step a call.
  constexpr void set_tolerance(const S& tolerance) noexcept { tolerance_ = tolerance; }

  /// Has a call that would try more steps than this stop on its way; 0 for none.
  constexpr void set_patience(long long tries) noexcept { patience_ = tries; }

  /// Whether the last call stopped on its way: its state is as it was, and the same call goes on.
  [[nodiscard]] constexpr bool paused() const noexcept { return paused_; }

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    failure_ = Failure::none;
    paused_ = false;
    if (!(tolerance_ > S(0))) {
      method_.do_step(system, state, t, h);
      if constexpr (PoweredSystem<System>) work_ = method_.work();
      ++tried_;
      ++taken_;
      return;
    }
    if (!((t + h) - (t + h) == S(0))) {  // no step would reach such a time, nor miss it
      failure_ = Failure::not_finite;
      for (auto& mu : state.momenta) mu = S(std::numeric_limits<double>::quiet_NaN()) * mu;
      return;
    }
    reach(system, state, t, h, t + h);
  }

  /// The state after the part `part` of a step from `state`, t to t + h, and the work done until
  /// then; that step may follow as if this had not been asked.  What has to be found for it is kept
  /// for the step, so that it is found once; that is never paused.
  constexpr StateOf<System> look(const System& system, const StateOf<System>& state, const S& t,
                                 const S& h, const S& part, S& work) noexcept {
    StateOf<System> there = state;
    const S target = t + part;
    const S direction = scalar::sign(h);
    if (!(tolerance_ > S(0)) || direction * (target - before_.time) < S(0)) {
      Adaptive aside = *this;
      aside.set_patience(0);
      aside.do_step(system, there, t, part);
      work = aside.work_;
      return there;
    }
    const S work_before = work_;
    const long long patience = std::exchange(patience_, 0);
    reach(system, there, t, h, target);
    patience_ = patience;
    paused_ = false;
    work = work_;
    work_ = work_before;
    delivered_ = state;
    delivered_time_ = t;
    return there;
  }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const auto& drift() const noexcept { return method_.drift(); }

  /// ∫ dH/dt dt over the time so far, J, by the method's own quadrature.
  [[nodiscard]] constexpr const S& work() const noexcept
    requires PoweredSystem<System>
  {
    return work_;
  }

  /// Steps taken so far.
  [[nodiscard]] constexpr long long steps() const noexcept { return taken_; }

  /// Why the last `do_step` could not reach its end.
  [[nodiscard]] constexpr Failure failure() const noexcept { return failure_; }

  /// Steps tried so far, accepted or not.
  [[nodiscard]] constexpr long long tried() const noexcept { return tried_; }

 private:
  /// A state that a step ends in.
  struct Mark {
    S time = S(0);
    StateOf<System> state{};
  };

  /// Takes `state` from t to the target, by steps that are those of h.
  constexpr void reach(const System& system, StateOf<System>& state, const S& t, const S& h,
                       const S& target) noexcept {
    const S direction = scalar::sign(h);
    const bool is_past = direction * (target - before_.time) < S(0);
    if (is_past || !goes_on(state, t, direction)) start(system, state, t, h);
    // Times that differ by rounding are the same.
    const S slack = S(4) * scalar::Limits<S>::epsilon() * scalar::max_abs(target, ahead_.time, h);
    const long long last = tried_ + patience_;
    while (direction * (target - ahead_.time) > slack) {
      if (patience_ > 0 && tried_ >= last) {
        paused_ = true;
        delivered_ = state;
        delivered_time_ = t;
        return;
      }
      if (!advance(system, h)) {
        for (auto& mu : state.momenta) mu = S(std::numeric_limits<double>::quiet_NaN()) * mu;
        delivered_ = state;
        return;
      }
    }
    deliver(system, state, target, slack);
  }

  [[nodiscard]] constexpr bool goes_on(const StateOf<System>& state, const S& t,
                                       const S& direction) const noexcept {
    const S slack = S(64) * scalar::Limits<S>::epsilon() * scalar::max_abs(t, ahead_.time);
    return direction * proposed_ > S(0) && scalar::abs(t - delivered_time_) <= slack &&
           state == delivered_;
  }

  /// The first step, about a third of what the tolerance will allow: with ω the largest rate of
  /// anything, beside its size, by first or second derivatives, (100 e/ω)^(1/p)/ω, at most 1/ω.
  constexpr void start(const System& system, const StateOf<System>& state, const S& t,
                       const S& h) noexcept {
    ahead_ = {t, state};
    before_ = ahead_;
    method_.forget();
    const Change first = change(system, state, t);
    S fastest = rate_of(state, first);
    proposed_ = h;
    if (!(fastest > S(0))) return;
    const S little = scalar::sign(h) * (S(0.01) / fastest);
    StateOf<System> there = state;
    for (std::size_t i = 0; i < System::bodies; ++i) {
      there.motors[i] = mul_add(little, first.motors[i], there.motors[i]);
      there.momenta[i] = mul_add(little, first.momenta[i], there.momenta[i]);
    }
    Change turn = change(system, there, t + little);
    for (std::size_t i = 0; i < System::bodies; ++i) {
      turn.motors[i] = turn.motors[i] - first.motors[i];
      turn.momenta[i] = turn.momenta[i] - first.momenta[i];
    }
    const S bend = scalar::sqrt(rate_of(state, turn) / scalar::abs(little));
    fastest = select(bend > fastest, bend, fastest);
    const S room = S(100) * tolerance_ / fastest;
    const S part = scalar::rough_exp2(scalar::rough_log2(room) / S(Method::lower_order));
    proposed_ = scalar::sign(h) * (select(part < S(1), part, S(1)) / fastest);
  }

  using Change = ChangeOf<System>;

  /// Ṁ and μ̇.
  [[nodiscard]] static constexpr Change change(const System& system, const StateOf<System>& state,
                                               const S& t) noexcept {
    const auto slope = detail::slope_of(system, state, t);
    Change result{{}, slope.forces};
    for (std::size_t i = 0; i < System::bodies; ++i) {
      result.motors[i] = kinematics(state.motors[i], slope.rates[i]);
    }
    return result;
  }

  /// The largest change of a motor or a momentum beside it, s⁻¹; of what is 0, none.
  [[nodiscard]] static constexpr S rate_of(const StateOf<System>& state,
                                           const Change& by) noexcept {
    S fastest(0);
    const auto count = [&](const S& size, const S& gain) {
      if (size > S(0)) fastest = scalar::max_abs(fastest, gain / size);
    };
    for (std::size_t i = 0; i < System::bodies; ++i) {
      count(detail::largest(state.motors[i]), detail::largest(by.motors[i]));
      count(detail::largest(state.momenta[i]), detail::largest(by.momenta[i]));
    }
    return fastest;
  }

  /// One step ahead, of whatever length is accepted; false where none can be that counts beside the
  /// time and h.
  [[nodiscard]] constexpr bool advance(const System& system, const S& h) noexcept {
    const auto account = method_.account();
    const S least = scalar::Limits<S>::epsilon() * scalar::max_abs(ahead_.time, h);
    const S least_error = rounding();
    S ratio(0);
    for (bool refused = false;; refused = true) {
      if (!(scalar::abs(proposed_) > least)) {
        return stop(ratio - ratio == S(0) ? Failure::step_too_short : Failure::not_finite);
      }
      Mark next = ahead_;
      method_.do_step(system, next.state, ahead_.time, proposed_);
      next.time = ahead_.time + proposed_;
      ++tried_;
      const S allowance = tolerance_ * scalar::abs(proposed_);
      ratio = method_.error() / select(allowance > least_error, allowance, least_error);
      S factor = factor_for(ratio);
      if (ratio <= S(1)) {
        before_ = ahead_;
        ahead_ = next;
        ++taken_;
        if (refused && factor > S(1)) factor = S(1);
        proposed_ = factor * proposed_;
        return true;
      }
      method_.go_back(account);
      proposed_ = factor * proposed_;
    }
  }

  [[nodiscard]] constexpr bool stop(Failure why) noexcept {
    failure_ = why;
    proposed_ = S(0);
    return false;
  }

  /// What rounding makes of an error of any step ahead.
  [[nodiscard]] constexpr S rounding() const noexcept {
    S size(1);
    for (const auto& motor : ahead_.state.motors) {
      size = scalar::max_abs(size, detail::largest(motor));
    }
    return S(8) * scalar::Limits<S>::epsilon() * size;
  }

  constexpr void deliver(const System& system, StateOf<System>& state, const S& target,
                         const S& slack) noexcept {
    if (scalar::abs(ahead_.time - target) <= slack) {
      state = ahead_.state;
      if constexpr (PoweredSystem<System>) work_ = method_.work();
    } else {
      const S at = (target - before_.time) / (ahead_.time - before_.time);
      state = method_.between(system, before_.state, before_.time, at);
      if constexpr (PoweredSystem<System>) {
        work_ = method_.work() - method_.work_after(system, before_.state, before_.time, at);
      }
    }
    delivered_ = state;
    delivered_time_ = target;
  }

  /// 0.9 ratio^(−1/p), within 1/5 and 5: the estimate of order p over h goes as h^p.
  [[nodiscard]] static constexpr S factor_for(const S& ratio) noexcept {
    if (!(ratio - ratio == S(0))) return S(0.2);
    const S least = S(1) / S(1000000);
    const S log_ratio = scalar::rough_log2(select(ratio > least, ratio, least));
    const S factor = S(0.9) * scalar::rough_exp2(log_ratio / S(-Method::lower_order));
    return select(factor < S(0.2), S(0.2), select(factor > S(5), S(5), factor));
  }

  Mark before_;  ///< where the last step began
  Mark ahead_;   ///< where it ended: at the delivered time or later
  Method method_{};
  StateOf<System> delivered_{};
  S delivered_time_ = S(0);
  S tolerance_ = S(0);
  S proposed_ = S(0);  ///< signed
  S work_{};
  Failure failure_ = Failure::none;
  long long tried_ = 0;
  long long taken_ = 0;
  long long patience_ = 0;
  bool paused_ = false;
};

}  // namespace hamotor
