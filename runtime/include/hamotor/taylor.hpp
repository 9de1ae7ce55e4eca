// Taylor series of the motion, by recurrences that the generator derives for a scene.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <limits>
#include <string_view>

#include "hamotor/packed_series.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"

namespace hamotor {

/// Where the recurrence for the Taylor coefficients of a system is declared: a scene specialises
/// it.
template <class System>
struct RecurrenceOf {};

/// A system with a recurrence for the Taylor coefficients of its motion.
template <class System>
concept AnalyticSystem = HamiltonianSystem<System> && requires {
  { RecurrenceOf<System>::coordinates } -> std::convertible_to<std::size_t>;
};

namespace detail {

/// Whether a recurrence is that of a quadratic field and there are registers for it.
template <class Recurrence, class S>
inline constexpr bool is_packed = has_packs<S> && requires { typename Recurrence::Packed; };

/// The factors of the sums of a recurrence, by order; or what does without them.
template <class Recurrence, class S, std::size_t lanes, std::size_t orders>
struct SeriesRows {
  std::array<std::array<S, lanes>, orders> u{};
  std::array<std::array<S, lanes>, orders> v{};
};
#ifdef HAMOTOR_PACKS
template <class Recurrence, class S, std::size_t lanes, std::size_t orders>
  requires(has_packs<S> && !is_packed<Recurrence, S>)
struct SeriesRows<Recurrence, S, lanes, orders> : CauchySums<S, lanes / 8, orders> {};
template <class Recurrence, class S, std::size_t lanes, std::size_t orders>
  requires is_packed<Recurrence, S>
struct SeriesRows<Recurrence, S, lanes, orders>
    : PackedSeries<typename Recurrence::Packed, S, orders> {};
#endif

/// The order of a series that is to be as accurate as numbers of so many bits.
[[nodiscard]] constexpr int series_order(int bits) noexcept { return 7 + (bits + 1) / 2; }

}  // namespace detail

/// The motion expanded in a Taylor series whose length and reach follow from a tolerance.
///
/// The step is as long as the last three coefficients allow for a relative error ε per unit of time
/// (Jorba & Zou 2005). The order p = 7 − 0.72 ln ε is higher than their 1 − ½ ln ε, which is best
/// where the time of a step goes as p²: here most of it goes as p. The polynomial of a step is
/// dense output: what is asked for within its reach is evaluated, whatever the step asked for.
/// Steps are increments, with compensated sums unless asked otherwise. Without a tolerance, that of
/// the scalar.
///
/// Coefficients are per power of a unit of time near the reach: per s, those of order 19 of a
/// motion at 1000 rad/s exceed a float.
template <AnalyticSystem System, Summation summation = Summation::compensated>
class Taylor {
  using S = typename System::Scalar;
  using Recurrence = RecurrenceOf<System>;
  using Coordinates = typename Recurrence::Coordinates;
  static constexpr std::size_t n = Recurrence::coordinates;  // whole packs
  static constexpr std::size_t bodies = System::bodies;
  static constexpr std::size_t lanes =
      detail::has_packs<S> ? (Recurrence::lanes + 7) / 8 * 8 : Recurrence::lanes;
  static constexpr bool is_powered = requires { Recurrence::work; };

 public:
  /// The highest order: that for full precision.
  static constexpr int order = detail::series_order(scalar::Limits<S>::digits);
  static constexpr std::string_view name = "taylor";
  /// Whether sums over steps are compensated.
  static constexpr bool compensated = summation == Summation::compensated;

  /// Asks for this local error a unit of time, s⁻¹, relative to motors and momenta; for rounding
  /// only, in every step, where it is not positive or a step would have to be better than that.
  constexpr void set_tolerance(const S& tolerance) noexcept {
    tolerance_ = select(tolerance > S(0), tolerance, S(0));
    if (tolerance_ > S(0)) log_tolerance_ = scalar::rough_log2(tolerance_);
    int bits = 0;
    for (S x = tolerance_; x < S(1) && bits < scalar::Limits<S>::digits; x = x + x) ++bits;
    length_ = detail::series_order(bits);
    known_ = false;
  }

  /// Has a call that would take more expansions than this stop on its way; 0 for none.
  constexpr void set_patience(long long expansions) noexcept { patience_ = expansions; }

  /// Whether the last call stopped on its way: its state is as it was, and the same call goes on.
  [[nodiscard]] constexpr bool paused() const noexcept { return paused_; }

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& /*system*/, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    failure_ = Failure::none;
    if (!((t + h) - (t + h) == S(0))) return fail(state, Failure::not_finite);
    const bool goes_on = known_ && state == delivered_ && is_near(t, time_, h);
    if (!goes_on || (paused_ && h != asked_)) start(state, t);
    if (!paused_) offset_ = offset_ + h;
    asked_ = h;
    const long long last = steps_ + patience_;
    while (scalar::abs(offset_) > reach_) {
      paused_ = patience_ > 0 && steps_ >= last;
      if (paused_) return;
      const S step = select(offset_ > S(0), reach_, -reach_);
      if (!(reach_ > scalar::Limits<S>::epsilon() * scalar::abs(t))) {
        return fail(state, step - step == S(0) ? Failure::step_too_short : Failure::not_finite);
      }
      advance(step);
      offset_ = offset_ - step;
    }
    if (!(reach_ > S(0))) return fail(state, Failure::not_finite);
    paused_ = false;
    time_ = t + h;
    const Coordinates change = increment(offset_);
    Coordinates x = coefficients_[0];
    for (std::size_t i = 0; i < n; ++i) x[i] = x[i] + (change[i] + low_[i]);
    if constexpr (is_powered) work_ = work_before_ + x[Recurrence::work];
    state = Recurrence::leave(x);
    state.motors = corrected(state.motors);
    delivered_ = state;
  }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return drift_; }

  /// ∫ dH/dt dt over the steps so far, J.
  [[nodiscard]] constexpr const S& work() const noexcept
    requires is_powered
  {
    return work_;
  }

  /// Expansions so far.
  [[nodiscard]] constexpr long long steps() const noexcept { return steps_; }

  /// Why the last `do_step` could not reach its end.
  [[nodiscard]] constexpr Failure failure() const noexcept { return failure_; }

  /// The order in use.
  [[nodiscard]] constexpr int length() const noexcept { return length_; }

  /// How far the polynomial at hand is used in either direction of time, s.
  [[nodiscard]] constexpr const S& reach() const noexcept { return reach_; }

 private:
  using Row = std::array<S, lanes>;

  /// More than any time, s.
  [[nodiscard]] static constexpr S unlimited() noexcept {
    const S e = scalar::Limits<S>::epsilon();
    return S(1) / (e * e);
  }

  [[nodiscard]] static constexpr bool is_near(const S& a, const S& b, const S& h) noexcept {
    const S size = select(scalar::abs(a) > scalar::abs(h), scalar::abs(a), scalar::abs(h));
    return scalar::abs(a - b) <= S(8) * scalar::Limits<S>::epsilon() * size;
  }

  constexpr void fail(StateOf<System>& state, Failure reason) noexcept {
    failure_ = reason;
    for (auto& mu : state.momenta) mu = S(std::numeric_limits<double>::quiet_NaN()) * mu;
    known_ = false;
    paused_ = false;
  }

  constexpr void start(const StateOf<System>& state, const S& t) noexcept {
    known_ = true;
    paused_ = false;
    delivered_ = state;
    time_ = t;
    coefficients_[0] = Recurrence::enter(state, t);
    low_ = {};
    defects_ = {};
    offset_ = S(0);
    if constexpr (is_powered) work_before_ = work_;
    expand();
  }

  /// Moves the centre of the expansion.
  ///
  /// What motors lack before a step they lack after it, as (M q)(M q)~ = M M~.  Found before, it
  /// waits for none of the step's parts.
  constexpr void advance(const S& step) noexcept {
    Coordinates& x = coefficients_[0];
    detail::add_compensated(x, low_, increment(step));
    if constexpr (!compensated) low_ = {};
    const Motors motors = corrected(Recurrence::leave(x).motors);
    Recurrence::replace_motors(x, motors);
    Recurrence::refresh(x);
    for (std::size_t i = 0; i < n; ++i) low_[i] = select(Recurrence::follows[i], S(0), low_[i]);
    S worst(0);
    for (std::size_t i = 0; i < bodies; ++i) {
      defects_[i] = unit_defect(motors[i]);
      worst = scalar::max_abs(worst, detail::size(defects_[i]));
    }
    detail::record(drift_, worst);
    expand();
  }

  using Motors = decltype(StateOf<System>::motors);

  /// Put back on the group by what was lacking at the centre.
  [[nodiscard]] constexpr Motors corrected(Motors motors) const noexcept {
    for (std::size_t i = 0; i < bodies; ++i) {
      motors[i] = motors[i] + unit_correction(motors[i], defects_[i]);
    }
    return motors;
  }

  /// x(offset) − x(0).
  [[nodiscard]] constexpr Coordinates increment(const S& offset) const noexcept {
    return detail::sum_of_powers(coefficients_, static_cast<std::size_t>(length_), offset / unit_);
  }

  /// Expands about coefficients_[0], again where the unit turns out to be far from the reach.
  constexpr void expand() noexcept {
    ++steps_;
    for (int unit_changes = 0;; ++unit_changes) {
      note_evaluations<S>(length_);
      if constexpr (detail::is_packed<Recurrence, S>) {
        rows_.expand(coefficients_, static_cast<std::size_t>(length_), unit_);
      } else {
        expand_node_by_node();
      }
      const S reach = reach_of_coefficients();
      const S unit = unit_changes < 4 ? unit_near(reach) : unit_;
      if (unit == unit_) {
        reach_ = select(reach < unlimited(), reach * unit_, reach);
        return;
      }
      unit_ = unit;
    }
  }

  /// The unit of time for coefficients of which this, in units, is the reach: a power of 2 s, and
  /// the one at hand unless it is so far off that coefficients might overflow or vanish.
  [[nodiscard]] constexpr S unit_near(S reach) const noexcept {
    const auto p = static_cast<std::size_t>(length_);
    if (!(is_finite(p) && reach > S(0) && reach < unlimited())) {
      std::size_t top = p;
      while (top > 0 && !(is_finite(top) && is_moving(top))) --top;
      if (top == 0) return unit_;
      reach = radius(top);
    }
    const S longest = unlimited() / S(2);
    const S wanted = reach * unit_;
    if (!(wanted < longest && wanted > S(1) / longest)) return unit_;
    if (S(16) * reach > S(1) && reach < S(16)) return unit_;
    S unit = unit_;
    while (unit > wanted) unit = unit / S(2);
    while (unit + unit < wanted) unit = unit + unit;
    return unit;
  }

  [[nodiscard]] constexpr bool is_finite(std::size_t k) const noexcept {
    return detail::are_finite(coefficients_[k]);
  }

  [[nodiscard]] constexpr bool is_moving(std::size_t k) const noexcept {
    const Sizes found = sizes(k);
    return std::any_of(found.begin(), found.end(), [](const S& x) { return x > S(0); });
  }

  [[gnu::flatten]] constexpr void expand_node_by_node() noexcept {
    typename Recurrence::Known known{};
    alignas(64) Row sums{};
    Recurrence::first(coefficients_[0], known, unit_, coefficients_[1]);
    const auto p = static_cast<std::size_t>(length_);
    const auto next = [&](std::size_t k) {
      const S over = S(1) / S(static_cast<int>(k));
      const S over_next = unit_ / S(static_cast<int>(k + 1));
      Recurrence::next(S(static_cast<int>(k)), over, coefficients_[k], known, sums.data(),
                       rows_.u[k].data(), rows_.v[k].data(), over_next, coefficients_[k + 1]);
    };
#ifdef HAMOTOR_PACKS
    if constexpr (detail::has_packs<S>) {
      using Sums = typename decltype(rows_)::Rows;
      const auto put = [&](const Sums& found) {
        for (std::size_t t = 0; t < lanes / 8; ++t) {
          detail::store<S>(sums.data() + 8 * t, found[t]);
        }
      };
      for (std::size_t k = 1; k < p; k += 2) {
        Sums found{};
        Sums later{};
        if (k > 1) {
          rows_.add_inner(k, found, later);
          rows_.add(1, k - 1, found);
          rows_.add(k - 1, 1, found);
        }
        put(found);
        next(k);
        if (k + 1 == p) return;
        rows_.add(1, k, later);
        if (k > 1) rows_.add(k, 1, later);
        put(later);
        next(k + 1);
      }
      return;
    }
#endif
    for (std::size_t k = 1; k < p; ++k) {
      add_products(k, sums);
      next(k);
    }
  }

  /// Σ u_j v_{k−j} over 0 < j < k, the newest coefficients last.
  constexpr void add_products(std::size_t k, Row& sums) const noexcept {
    sums = {};
    for (std::size_t j = k / 2; j > 0; --j) {
      for (std::size_t l = 0; l < lanes; ++l) {
        sums[l] = mul_add(rows_.u[j][l], rows_.v[k - j][l], sums[l]);
        if (k - j != j) sums[l] = mul_add(rows_.u[k - j][l], rows_.v[j][l], sums[l]);
      }
    }
  }

  static constexpr auto kinds = static_cast<std::size_t>(
      *std::max_element(Recurrence::parts.begin(), Recurrence::parts.end()) + 1);
  using Sizes = std::array<S, kinds>;

  /// The largest coefficient of one order of each kind of coordinate.
  [[nodiscard]] constexpr Sizes sizes(std::size_t k) const noexcept {
    Sizes result{};
    for (std::size_t i = 0; i < n; ++i) {
      if (Recurrence::parts[i] < 0) continue;
      S& largest = result[static_cast<std::size_t>(Recurrence::parts[i])];
      largest = scalar::max_abs(largest, coefficients_[k][i]);
    }
    return result;
  }

  /// 1 / the size of every coordinate's kind, which is what they have or reach within `span`; 0 for
  /// coordinates that are not compared.
  [[nodiscard]] constexpr Coordinates scales(const S& span) const noexcept {
    Coordinates scale =
        detail::sizes_within(coefficients_[0], coefficients_[1], coefficients_[2], span);
    Sizes over{};
    for (std::size_t i = 0; i < n; ++i) {
      if (Recurrence::parts[i] < 0) continue;
      S& largest = over[static_cast<std::size_t>(Recurrence::parts[i])];
      largest = select(largest > scale[i], largest, scale[i]);
    }
    for (S& x : over) x = select(x > S(0), S(1) / x, S(0));
    for (std::size_t i = 0; i < n; ++i) {
      scale[i] =
          Recurrence::parts[i] < 0 ? S(0) : over[static_cast<std::size_t>(Recurrence::parts[i])];
    }
    return scale;
  }

  /// The step, in units, whose last three terms stay below the tolerance times the size of the
  /// coordinates, which is what they have or reach within a step as long as the last one.
  [[nodiscard]] constexpr S reach_of_coefficients() const noexcept {
    const auto p = static_cast<std::size_t>(length_);
    const Coordinates scale =
        scales(steps_ > 1 && reach_ < unlimited() ? reach_ / unit_ : radius(p) / S(8));
    const S log_epsilon(1 - scalar::Limits<S>::digits);
    const S log_tolerance = log_tolerance_ + scalar::rough_log2(unit_);
    S shortest = unlimited();
    for (std::size_t m = p - 2; m <= p; ++m) {
      const S ratio = detail::largest_product(coefficients_[m], scale);
      if (!(ratio > S(0))) continue;
      // r hᵐ ≤ ε, or, if that is longer, r hᵐ ≤ e h.
      const S log_ratio = scalar::rough_log2(ratio);
      S exponent = (log_epsilon - log_ratio) * (S(1) / S(static_cast<int>(m)));
      if (tolerance_ > S(0)) {
        const S asked = (log_tolerance - log_ratio) * (S(1) / S(static_cast<int>(m) - 1));
        exponent = select(asked > exponent, asked, exponent);
      }
      shortest = select(shortest > exponent, exponent, shortest);
    }
    return select(shortest < unlimited(), scalar::rough_exp2(shortest), unlimited());
  }

  /// Of convergence, about, in units, from coefficients of up to order p.
  [[nodiscard]] constexpr S radius(std::size_t p) const noexcept {
    S shortest = unlimited();
    for (std::size_t j = 0; j < 3; ++j) {
      const Sizes first = sizes(j);
      for (std::size_t m = std::max(p, j + 3) - 2; m <= p; ++m) {
        const Sizes last = sizes(m);
        for (std::size_t g = 0; g < kinds; ++g) {
          if (!(first[g] > S(0)) || !(last[g] > S(0))) continue;
          const S r = scalar::rough_exp2(scalar::rough_log2(first[g] / last[g]) /
                                         S(static_cast<int>(m - j)));
          shortest = select(shortest > r, r, shortest);
        }
      }
    }
    return shortest;
  }

  alignas(64) std::array<Coordinates, static_cast<std::size_t>(order) + 1> coefficients_{};
  detail::SeriesRows<Recurrence, S, lanes, static_cast<std::size_t>(order) + 1> rows_;
  Coordinates low_{};
  std::array<decltype(unit_defect(typename StateOf<System>::Element{})), bodies> defects_{};
  StateOf<System> delivered_{};
  S tolerance_ = S(0);
  S log_tolerance_ = S(0);
  S unit_ = S(1);
  S reach_ = S(0);
  S offset_ = S(0);
  S asked_ = S(0);
  S time_ = S(0);
  S work_{};
  S work_before_{};
  Drift<S> drift_;
  long long steps_ = 0;
  long long patience_ = 0;
  int length_ = order;
  Failure failure_ = Failure::none;
  bool known_ = false;
  bool paused_ = false;
};

}  // namespace hamotor
