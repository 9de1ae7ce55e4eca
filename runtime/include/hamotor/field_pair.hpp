// Explicit Runge–Kutta pairs on the motion as ẋ = f(x), in coordinates that the generator chooses.
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <utility>

#include "hamotor/compensated.hpp"
#include "hamotor/packed_series.hpp"
#include "hamotor/runge_kutta_pairs.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/state.hpp"

namespace hamotor {

/// Where the motion of a system in coordinates is declared: a scene specialises it.
template <class System>
struct FieldOf {};

/// A system whose motion is given in coordinates.
template <class System>
concept SystemWithField = HamiltonianSystem<System> && requires {
  { FieldOf<System>::coordinates } -> std::convertible_to<std::size_t>;
};

namespace detail {

/// To x + h Σ c_r y_r over those r < count whose coefficient is present.
template <auto present, std::size_t count, class S, std::size_t n, std::size_t most>
constexpr void move_by(const std::array<S, n>& x, const S& h, const S* c,
                       const std::array<std::array<S, n>, most>& y,
                       std::array<S, n>& sum) noexcept {
  sum = {};
  for (std::size_t r = 0; r < count; ++r) {
    if (!present[r]) continue;
    for (std::size_t i = 0; i < n; ++i) sum[i] = mul_add(c[r], y[r][i], sum[i]);
  }
  for (std::size_t i = 0; i < n; ++i) sum[i] = mul_add(h, sum[i], x[i]);
}

/// Copies numbers that were found one by one.
template <class S, std::size_t n>
HAMOTOR_INLINE constexpr void put_together(const std::array<S, n>& from,
                                           std::array<S, n>& to) noexcept {
  to = from;
}

#ifdef HAMOTOR_PACKS
template <auto present, std::size_t count, class S, std::size_t n, std::size_t most>
  requires(has_packs<S> && n % 4 == 0)
HAMOTOR_INLINE inline void move_by(const std::array<S, n>& x, const S& h, const S* c,
                                   const std::array<std::array<S, n>, most>& y,
                                   std::array<S, n>& result) noexcept {
  using V = HalfLanes<S>;
  std::array<V, n / 4> sum{};
  const auto add = [&](const S& weight, std::size_t r, std::array<V, n / 4>& onto) {
    for (std::size_t i = 0; i < n / 4; ++i) {
      onto[i] =
          packed_mul_add(V{weight, weight, weight, weight}, read<4>(y[r].data() + 4 * i), onto[i]);
    }
  };
  each<count - 1>([&](auto r) {
    if constexpr (present[r]) add(c[r], r, sum);
  });
  for (std::size_t i = 0; i < n / 4; ++i) {
    sum[i] = packed_mul_add(V{h, h, h, h}, sum[i], read<4>(x.data() + 4 * i));
  }
  // Of the slope found last one operation waits.
  if constexpr (present[count - 1]) add(h * c[count - 1], count - 1, sum);
  for (std::size_t i = 0; i < n / 4; ++i) {
    write<4>(result.data() + 4 * i, sum[i]);
  }
}

/// Stored as the packs that they are read as: a load that takes several stores waits for them.
template <class S, std::size_t n>
  requires(has_packs<S> && n % 4 == 0)
HAMOTOR_INLINE inline void put_together(const std::array<S, n>& from,
                                        std::array<S, n>& to) noexcept {
  each<n / 4>([&](auto i) {
    constexpr std::size_t k = 4 * i;
    const HalfLanes<S> x{from[k], from[k + 1], from[k + 2], from[k + 3]};
    write<4>(to.data() + k, x);
  });
}
#endif

}  // namespace detail

/// The pair on components, in coordinates in which the motion has the fewest operations: on rigid
/// motions rotors, momenta and places seen from the body or from the world.
///
/// What is carried from step to step are the coordinates; a state that is not the one a step ended
/// in, or began in, is expressed in them anew. Not symplectic.
template <SystemWithField System, class Pair, Summation summation = Summation::compensated>
class FieldPair {
  using S = typename System::Scalar;
  using Field = FieldOf<System>;
  using Coordinates = typename Field::Coordinates;
  static constexpr std::size_t n = Field::coordinates;  // whole packs
  static constexpr std::size_t bodies = System::bodies;
  static constexpr std::size_t stages = Pair::stages;
  static constexpr std::size_t all_stages = Pair::dense_stages;

 public:
  static constexpr int order = Pair::order;
  static constexpr int lower_order = Pair::lower_order;
  static constexpr std::string_view name = Pair::name_on_components;
  /// The local error of `between` is of this order in the step, and one more.
  static constexpr int dense_order = Pair::dense_order;
  /// Whether sums over steps are compensated.
  static constexpr bool compensated = summation == Summation::compensated;

  /// What is carried from step to step beside the state.
  struct Account {
    Drift<S> drift;
    S work{};
  };

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& /*system*/, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    const bool goes_on = take_up(state, t);
    h_ = h;
    // Where the last stage is at the end of a step it is the first one of the next.
    if constexpr (Pair::end_stage < stages) {
      if (goes_on) slopes_[0] = slopes_[Pair::end_stage];
      if (!goes_on) find_slope<0>();
      find_slopes<1, stages>();
    } else {
      find_slopes<0, stages>();
    }
    Point& end = points_[1 - begin_];
    combine<in_weights>(table().weights, end.x);
    if constexpr (is_powered) account_.work = account_.work + end.x[Field::work];
    for (std::size_t i = 0; i < n; ++i) {
      const auto sum = scalar::two_sum(begin().x[i], end.x[i] + begin().low[i]);
      end.x[i] = sum.hi;
      end.low[i] = compensated ? sum.lo : S(0);
    }
    end.state = Field::leave(end.x);
    S worst(0);
    for (std::size_t i = 0; i < bodies; ++i) {
      auto& motor = end.state.motors[i];
      const auto defect = detail::rounded_defect(motor);
      worst = scalar::max_abs(worst, detail::size(defect));
      const auto correction = unit_correction(motor, defect);
      motor = motor + correction;
      const auto components = correction.components();
      for (const auto& [body, component, place] : Field::held) {
        if (body != i) continue;
        const auto sum = scalar::two_sum(end.x[place], components[component] + end.low[place]);
        end.x[place] = sum.hi;
        end.low[place] = compensated ? sum.lo : S(0);
      }
    }
    detail::record(account_.drift, worst);
    state = end.state;
    Coordinates off;
    combine<in_error>(table().error, off);
    error_ = error_of(off);
  }

  /// The state at the fraction `at` of the last step; of order `dense_order`.  What that takes
  /// beyond the step's own evaluations is evaluated once.
  [[nodiscard]] constexpr StateOf<System> between(const System& /*system*/,
                                                  const StateOf<System>& /*start*/, const S& /*t*/,
                                                  const S& at) noexcept {
    find_the_rest();
    Coordinates x;
    combine<in_output>(continuous_weights<Pair>(at), x);
    for (std::size_t i = 0; i < n; ++i) x[i] = begin().x[i] + (x[i] + begin().low[i]);
    StateOf<System> there = Field::leave(x);
    for (auto& motor : there.motors) motor = motor + unit_correction(motor, unit_defect(motor));
    return there;
  }

  /// ∫ dH/dt dt from the fraction `at` of the last step to its end, J; as `between`.
  [[nodiscard]] constexpr S work_after(const System& /*system*/, const StateOf<System>& /*start*/,
                                       const S& /*t*/, const S& at) noexcept
    requires PoweredSystem<System>
  {
    find_the_rest();
    Coordinates whole;
    Coordinates part;
    combine<in_weights>(table().weights, whole);
    combine<in_output>(continuous_weights<Pair>(at), part);
    return whole[Field::work] - part[Field::work];
  }

  /// The estimated error of the last step, by the embedded method: the largest of a motor's
  /// component, and of a momentum's relative to the largest component of its kind, angular or
  /// linear, in the step.
  [[nodiscard]] constexpr const S& error() const noexcept { return error_; }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return account_.drift; }

  /// ∫ dH/dt dt over the steps so far, J, by the method's own quadrature.
  [[nodiscard]] constexpr const S& work() const noexcept
    requires PoweredSystem<System>
  {
    return account_.work;
  }

  /// Of the steps so far.
  [[nodiscard]] constexpr const Account& account() const noexcept { return account_; }

  /// The last step is as if it had not been.
  constexpr void go_back(const Account& account) noexcept { account_ = account; }

  /// The next step is from another state: what sums lost of the last one is nothing to it.
  constexpr void forget() noexcept { is_known_ = false; }

 private:
  static constexpr bool is_powered = requires { Field::work; };
  static constexpr bool is_timed = requires { Field::time; };

  [[nodiscard]] static constexpr const detail::PairTable<Pair, S>& table() noexcept {
    return detail::pair_table<Pair, S>;
  }

  /// Where a step begins or ends.
  struct Point {
    Coordinates x{};
    Coordinates low{};  ///< what sums lost
    StateOf<System> state{};
  };

  [[nodiscard]] constexpr const Point& begin() const noexcept { return points_[begin_]; }

  /// Begins at the end of the last step, or again where that began, if the state is the one there;
  /// whether it is at the end.
  constexpr bool take_up(const StateOf<System>& state, const S& t) noexcept {
    const bool goes_on = is_known_ && state == points_[1 - begin_].state;
    if (goes_on) {
      begin_ = 1 - begin_;
    } else if (!(is_known_ && state == begin().state)) {
      points_[begin_] = {Field::enter(state, t), {}, state};
      is_known_ = true;
    }
    if constexpr (is_timed) {
      points_[begin_].x[Field::time] = t;
      points_[begin_].low[Field::time] = S(0);
    }
    return goes_on;
  }

  /// Which coefficients of a row are not 0.
  template <class Text, std::size_t count>
  [[nodiscard]] static constexpr std::array<bool, count> present(
      const std::array<Text, count>& row) noexcept {
    std::array<bool, count> result{};
    for (std::size_t k = 0; k < count; ++k) result[k] = detail::number<double>(row[k]) != 0;
    return result;
  }

  /// Finds the slopes of the last step that are not known yet, of the stages `first` to `last`.
  template <std::size_t first, std::size_t last>
  constexpr void find_slopes() noexcept {
    [&]<std::size_t... s>(std::index_sequence<s...>) {
      (find_slope<first + s>(), ...);
    }(std::make_index_sequence<last - first>{});
    known_ = last;
  }

  template <std::size_t s>
  HAMOTOR_INLINE constexpr void find_slope() noexcept {
    note_evaluations<S>(1);
    if constexpr (s == 0) {
      slope_at(begin().x, slopes_[0]);
    } else {
      constexpr auto pattern = present(Pair::rows[s]);
      detail::move_by<pattern, s>(begin().x, h_, table().rows[s].data(), slopes_, there_);
      // Known beforehand: what depends on time only need not wait for slopes.
      if constexpr (is_timed) {
        there_[Field::time] = mul_add(table().nodes[s], h_, begin().x[Field::time]);
      }
      slope_at(there_, slopes_[s]);
    }
  }

  /// Called, not inlined: a field is of hundreds of operations, and there are as many stages.
  [[gnu::noinline]] static constexpr void slope_at(const Coordinates& x,
                                                   Coordinates& slope) noexcept {
    Coordinates change{};
    Field::rates(x, change);
    detail::put_together(change, slope);
  }

  /// Those that only a continuous extension needs.
  constexpr void find_the_rest() noexcept {
    if constexpr (stages < all_stages) {
      if (known_ == stages) find_slopes<stages, all_stages>();
    }
  }

  /// h Σ c_r slope_r over those r whose coefficient is present.
  template <auto present, std::size_t size>
  constexpr void combine(const std::array<S, size>& c, Coordinates& sum) const noexcept {
    detail::move_by<present, size>(Coordinates{}, h_, c.data(), slopes_, sum);
  }

  static constexpr auto in_weights = present(Pair::weights);
  static constexpr auto in_error = present(Pair::error);
  static constexpr auto in_output = [] {
    std::array<bool, all_stages> result{};
    result.fill(true);
    return result;
  }();

  static constexpr auto kinds =
      static_cast<std::size_t>(*std::max_element(Field::parts.begin(), Field::parts.end()) + 1);

  /// The largest of all errors, momenta's beside what they have or gain in the step.
  [[nodiscard]] constexpr S error_of(const Coordinates& off) const noexcept {
    std::array<S, kinds> sizes{};
    std::array<S, kinds> errors{};
    S worst(0);
    for (std::size_t i = 0; i < n; ++i) {
      if (Field::parts[i] < 0) continue;
      const auto kind = static_cast<std::size_t>(Field::parts[i]);
      if (Field::weights[i] > 0) {
        worst = scalar::max_abs(worst, S(Field::weights[i]) * off[i]);
        continue;
      }
      sizes[kind] = scalar::max_abs(sizes[kind], begin().x[i], h_ * slopes_[0][i]);
      errors[kind] = scalar::max_abs(errors[kind], off[i]);
    }
    for (std::size_t kind = 0; kind < kinds; ++kind) {
      const S& size = sizes[kind];
      const S& error = errors[kind];
      worst = scalar::max_abs(worst, select(size > error, error / size, error));
    }
    return worst;
  }

  alignas(64) std::array<Coordinates, all_stages> slopes_{};
  Coordinates there_{};  ///< at a stage
  std::array<Point, 2> points_{};
  std::size_t begin_ = 0;  ///< where the last step began
  Account account_;
  std::size_t known_ = 0;  ///< slopes
  bool is_known_ = false;  ///< whether the points are any
  S h_{};
  S error_ = S(0);
};

}  // namespace hamotor
