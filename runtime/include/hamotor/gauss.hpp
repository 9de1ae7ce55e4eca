// Gauss collocation on T*G: implicit, symmetric, symplectic, of order 2s with s stages, for any H.
//
// Variational: the discrete Lagrangian of a step is the action of Gauss's quadrature along a curve
// whose coordinates ξ about M̂ are a polynomial of degree s, extremal among those with the same
// ends. These are at ξ = ∓X/2, M̂ half-way between them, which makes the step symmetric.  ξ is the
// logarithm of M̂~M; of rigid motions, place and turn, so that centres of mass move by Gauss's
// method as points do.  One stage is the Lie midpoint rule.  (Marsden & West 2001; Bogfjellmo &
// Marthinsen 2016; Hall & Leok 2017.)
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string_view>
#include <type_traits>

#include "hamotor/canonical_chart.hpp"
#include "hamotor/compensated.hpp"
#include "hamotor/gauss_table.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/stage_equations.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"

namespace hamotor {

namespace detail {

[[nodiscard]] constexpr std::string_view gauss_name(std::size_t stages) noexcept {
  constexpr std::array<std::string_view, 8> names{"lie_midpoint", "gauss4",  "gauss6",  "gauss8",
                                                  "gauss10",      "gauss12", "gauss14", "gauss16"};
  return names[stages - 1];
}

}  // namespace detail

/// Gauss collocation on the group, s = 1 to 8 stages, order 2s, for any H(M, μ, t).
///
/// With chart momenta p of m, the body's momentum turned back to the frame of M̂, a stage is
///     ξ_i = h Σ ã_ij ξ̇_j,  p_i = ½(p₀ + p₁) + h Σ ã_ij ṗ_j,  ã_ij = a_ij − b_j/2,
/// and momenta obey m₁ = m₀ + h Σ b_i ṁ_i, which with P × V and the forques makes the balance of
/// spatial momentum: where H is left-invariant, it and Casimirs are constant but for rounding.
///
/// ξ̇ and ṁ are iterated until no component's change shrinks any more, which is where rounding stops
/// them (Hairer, McLachlan & Razakarivony 2008; Antoñana, Makazaga & Murua 2017), from the last
/// step's polynomials: to a fixed point while that contracts, else by Newton's method with one
/// Jacobian for many steps, so that fast spins and stiff springs converge too (up to 48 unknowns a
/// stage: four bodies in space).  Where stages act on each other as that Jacobian does not know
/// (one moment a millionth of the others), it takes that of all stages together (up to 96
/// unknowns).  What stopped them is held against what rounding of the stages does to ξ̇ and ṁ. Where
/// they settle nowhere else, or not in 20 iterations and one a bit, the state becomes not a number.
template <HamiltonianSystem System, std::size_t stages,
          Summation summation = Summation::compensated>
class Gauss {
  static_assert(stages >= 1 && stages <= 8);
  using S = typename System::Scalar;
  using G = typename System::Group;
  using Element = typename G::template Element<S>;
  using Rate = typename G::template Rate<S>;
  using Momentum = typename G::template Momentum<S>;
  using Chart = CanonicalChart<G, S>;
  static constexpr std::size_t n = System::bodies;
  static constexpr auto dimension = static_cast<std::size_t>(G::dimension);
  static constexpr std::size_t positions = n * dimension;
  /// Whether P × V turns the spin.
  static constexpr bool has_coupling = Chart::translates && !moves_along_momentum<System>;
  /// Whether momenta are unknowns too.
  static constexpr bool has_push = System::has_forque || has_coupling;
  static constexpr std::size_t unknowns = has_push ? 2 * positions : positions;
  static constexpr bool has_newton = unknowns <= 48;
  static constexpr bool has_whole = stages * unknowns <= 96;
  static constexpr int whole_steps = 64;
  static constexpr int most_iterations = 20 + scalar::Limits<S>::digits;
  static inline const auto table = detail::gauss_table<S, stages>();

 public:
  static constexpr int order = 2 * static_cast<int>(stages);
  static constexpr std::string_view name = detail::gauss_name(stages);
  /// Whether sums over steps are compensated.
  static constexpr bool compensated = summation == Summation::compensated;

  /// Takes `state` from t to t + h.
  constexpr void do_step(const System& system, StateOf<System>& state, const S& t,
                         const S& h) noexcept {
    const bool goes_on = state == end_;
    if (!goes_on) forget();
    if (goes_on && foresees_ && failure_ == Failure::none && h == h_) {
      foresee();
    } else {
      stay(system, state, t);
    }
    h_ = h;
    for (std::size_t s = 0; s < stages; ++s) step_weights_[s] = h * table.weights[s];
    begin();
    failure_ = solve(system, state, t) ? Failure::none : Failure::no_convergence;
    finish(state);
  }

  /// How far the steps so far left the group.
  [[nodiscard]] constexpr const Drift<S>& drift() const noexcept { return drift_; }

  /// Whether the last step's stages settled.
  [[nodiscard]] constexpr Failure failure() const noexcept { return failure_; }

  /// Iterations of the last step, each `stages` evaluations.
  [[nodiscard]] constexpr int iterations() const noexcept { return iterations_; }

  /// Whether the last step was solved by Newton's method.
  [[nodiscard]] constexpr bool by_newton() const noexcept { return newton_.on; }

  /// ∫ dH/dt dt over the steps so far, J, by the method's own quadrature.
  [[nodiscard]] constexpr const S& work() const noexcept
    requires PoweredSystem<System>
  {
    return work_;
  }

 private:
  using Gradients = Gradient<G, n, S>;
  using Momenta = std::array<Momentum, n>;
  using Vector = detail::Vector<S, unknowns>;
  /// ξ̇ and ṁ, or B and −F, of all bodies as numbers.
  using Slopes = std::array<Vector, stages>;
  struct NoNewton {
    static constexpr bool on = false;
  };
  struct NoWhole {};
  /// The equations of all stages, rows and columns in `units`.
  struct Whole {
    Slopes units{};
    detail::Eliminated<S, stages * unknowns> eliminated{};
  };
  struct Newton {
    bool on = false;
    bool whole = false;  ///< whether by the Jacobian of all stages
    int whole_for = 0;   ///< steps until the smaller ones are tried again
    bool stale = false;  ///< whether the next step is to begin with a new Jacobian
    int iterations = 0;  ///< of the first step that began with this one; 0 before
    S h{};
    detail::StageEquations<S, stages, unknowns> equations{};
    [[no_unique_address]] std::conditional_t<has_whole, Whole, NoWhole> all{};
  };

  /// The next step is from another state: what was lost of the last one, and how it was solved, is
  /// nothing to it.
  constexpr void forget() noexcept {
    low_ = {};
    if constexpr (has_newton) {
      newton_.on = false;
      newton_.whole = false;
      newton_.whole_for = 0;
      newton_.stale = false;
      newton_.iterations = 0;
    }
  }

  /// The first guess where nothing is known: what is at the start.
  constexpr void stay(const System& system, const StateOf<System>& state, const S& t) noexcept {
    gradients_.fill(numbers(system, state, gradient(system, state, t)));
  }

  /// The first guess after a step of the same length: its polynomials, gone on.
  constexpr void foresee() noexcept {
    const Slopes before = gradients_;
    for (std::size_t s = 0; s < stages; ++s) {
      gradients_[s] = {};
      for (std::size_t r = 0; r < stages; ++r) {
        for (std::size_t k = 0; k < unknowns; ++k) {
          gradients_[s][k] = mul_add(table.next[s][r], before[r][k], gradients_[s][k]);
        }
      }
    }
  }

  /// Charts and slopes that the guess of B and F leads to.
  constexpr void begin() noexcept {
    slopes_ = gradients_;
    for (int sweep = 0; sweep < 3; ++sweep) {
      for (std::size_t s = 0; s < stages; ++s) {
        for (std::size_t i = 0; i < n; ++i) charts_[s][i] = Chart(displacement(s, i));
      }
      for (std::size_t s = 0; s < stages; ++s) {
        for (std::size_t i = 0; i < n; ++i) {
          put(slopes_[s], i, charts_[s][i].rate(rate(gradients_[s], i)));
          if constexpr (has_push) {
            if (sweep == 2) {
              put_push(slopes_[s], i,
                       charts_[s][i].opposite().body_momentum(push(gradients_[s], i)));
            }
          }
        }
      }
    }
    beside_ = {};
  }

  /// Where slopes lead to: the stages' charts, and momenta seen from half-way.
  constexpr void place(const StateOf<System>& state) noexcept {
    for (std::size_t i = 0; i < n; ++i) {
      Rate x{};
      Momentum gained{};
      for (std::size_t s = 0; s < stages; ++s) {
        x = mul_add(step_weights_[s], rate(slopes_[s], i), x);
        charts_[s][i] = Chart(displacement(s, i));
        if constexpr (has_push) {
          gained = mul_add(step_weights_[s], push(slopes_[s], i), gained);
        }
      }
      gained_[i] = gained;
      const Chart chart(S(0.5) * x);
      const Chart opposite = chart.opposite();
      half_way_[i] = chart;
      const Momentum first = chart.body_momentum(state.momenta[i]);
      const Momentum mean = mul_add(S(0.5), gained, first);
      const Momentum middle = S(0.5) * (opposite.momentum(first) + chart.momentum(first + gained));
      std::array<Momentum, stages> forces{};
      for (std::size_t s = 0; s < stages; ++s) {
        balanced_[s][i] = mean;
        if constexpr (has_push) {
          for (std::size_t r = 0; r < stages; ++r) {
            balanced_[s][i] =
                mul_add(table.skew[s][r] * step_weights_[r], push(slopes_[r], i), balanced_[s][i]);
          }
        }
        Momentum changes{};
        if constexpr (has_push) changes = step_weights_[s] * push(slopes_[s], i);
        forces[s] = charts_[s][i].momentum_rate(step_weights_[s] * rate(slopes_[s], i),
                                                balanced_[s][i] + beside_[s][i], changes);
      }
      for (std::size_t s = 0; s < stages; ++s) {
        Momentum p = middle;
        for (std::size_t r = 0; r < stages; ++r) p = mul_add(table.skew[s][r], forces[r], p);
        momenta_[s][i] = charts_[s][i].seen_from_center(p);
        beside_[s][i] = momenta_[s][i] - balanced_[s][i];
      }
    }
  }

  /// By how much slopes there differ from those that led there.
  [[nodiscard]] constexpr Slopes residual(const System& system, const StateOf<System>& state,
                                          const S& t) noexcept {
    const StateOf<System> center = half_way(state);
    Slopes difference{};
    for (std::size_t s = 0; s < stages; ++s) {
      const S then = mul_add(table.nodes[s], h_, t);
      const Seen seen = slope(system, center, charts_[s], momenta_[s], then);
      if constexpr (PoweredSystem<System>) power_[s] = system.power(seen.state, then);
      gradients_[s] = seen.gradient;
      difference[s] = less(seen.slope, slopes_[s]);
    }
    return difference;
  }

  /// The state with its motors half-way.
  [[nodiscard]] constexpr StateOf<System> half_way(const StateOf<System>& state) const noexcept {
    StateOf<System> center = state;
    for (std::size_t i = 0; i < n; ++i) {
      center.motors[i] = gp(state.motors[i], reverse(half_way_[i].opposite().element()));
    }
    return center;
  }

  /// What is at a point of the charts.
  struct Seen {
    StateOf<System> state;
    Vector gradient{};  ///< B and −F
    Vector slope{};     ///< ξ̇ and ṁ
  };

  [[nodiscard, gnu::flatten]] static constexpr Seen slope(const System& system,
                                                          const StateOf<System>& center,
                                                          const std::array<Chart, n>& charts,
                                                          const Momenta& m, const S& t) noexcept {
    Seen seen{center};
    for (std::size_t i = 0; i < n; ++i) {
      if constexpr (System::has_forque) {  // H does not know the motors where it has none.
        seen.state.motors[i] = gp(center.motors[i], charts[i].element());
      }
      seen.state.momenta[i] = charts[i].body_momentum(m[i]);
    }
    const auto now = hamotor::gradient(system, seen.state, t);
    seen.gradient = numbers(system, seen.state, now);
    for (std::size_t i = 0; i < n; ++i) {
      put(seen.slope, i, charts[i].rate(now.rates[i]));
      if constexpr (has_push) {
        put_push(seen.slope, i, charts[i].opposite().body_momentum(push(seen.gradient, i)));
      }
    }
    return seen;
  }

  /// Iterates the stages; false where they do not settle.
  [[nodiscard]] constexpr bool solve(const System& system, const StateOf<System>& state,
                                     const S& t) noexcept {
    const Slopes guess = slopes_;
    place(state);
    S before(0);
    int since = 0;                         // iterations in this way
    bool fresh = false;                    // whether Newton's Jacobian is of this step
    [[maybe_unused]] bool begins = false;  // and of its start
    for (iterations_ = 1; iterations_ <= most_iterations; ++iterations_) {
      const Slopes off = residual(system, state, t);
      Slopes by = off;
      if constexpr (has_newton) {
        if (newton_.on) {
          if (iterations_ == 1 && newton_.whole && --newton_.whole_for < 0) {
            newton_.whole = false;
            newton_.stale = true;
          }
          if (iterations_ == 1 && (newton_.stale || newton_.h != h_)) {
            linearise(system, state, t);
            begins = true;
            fresh = true;
          }
          by = corrections(off);
        }
      }
      const S change = size(by);
      // Where polynomials foretell nothing, as of stiff springs, the next step starts without them.
      if (iterations_ == 1) foresees_ = change < S(0.05);
      ++since;
      const bool finite = change - change == S(0);
      const bool shrinks = shrunk(by, since == 1);
      // Where a better Jacobian is to be had, less is taken for rounding.
      const bool best = !has_newton || (fresh && (whole() || !has_whole));
      const bool small = change <= S(best ? 65536 : 16) * scalar::Limits<S>::epsilon();
      // The first two need not show all components, but where the Jacobian knows them.
      const bool known = since > (whole() ? 1 : 2);
      const bool slow = known && change > S(0.25) * before;
      // A second Jacobian in a step helps only where the first was of another place.
      const bool stuck = slow && (!fresh || change > S(0.75) * before);
      const bool settled = finite && known && (!shrinks || (fresh && stuck)) &&
                           (small || is_rounding(system, state, t, off));
      if (!finite || (stuck && !small && !settled)) {
        if constexpr (has_newton) {
          const bool further = !newton_.on || (has_whole && fresh && !newton_.whole);
          if (!finite || (further && change > S(0.1))) {
            if (!further && since == 1) return false;
            slopes_ = guess;
            beside_ = {};
            place(state);
          }
          if (further && newton_.on) {
            newton_.whole = true;
            newton_.whole_for = whole_steps;
          }
          newton_.on = true;
          settle(state);
          linearise(system, state, t);
          newton_.iterations = 0;  // known better at the next step's start
          begins = false;
          fresh = true;
          since = 0;
          continue;
        } else if (!finite) {
          return false;
        }
      }
      for (std::size_t s = 0; s < stages; ++s) {
        for (std::size_t k = 0; k < unknowns; ++k) slopes_[s][k] = slopes_[s][k] + by[s][k];
      }
      settle(state);
      if (settled) {
        if constexpr (has_newton) {
          if (begins) newton_.iterations = iterations_;
          newton_.stale = iterations_ > newton_.iterations + 2;
        }
        return true;
      }
      before = change;
    }
    return false;
  }

  /// Whether Newton's method has the Jacobian of all stages.
  [[nodiscard]] constexpr bool whole() const noexcept {
    if constexpr (has_newton) return newton_.whole;
    return false;
  }

  /// `place`, with Newton's better Jacobian until momenta no longer wait for each other.
  constexpr void settle(const StateOf<System>& state) noexcept {
    place(state);
    for (int again = 0; whole() && again < 3; ++again) place(state);
  }

  /// By how much Newton's method changes slopes.
  [[nodiscard]] constexpr Slopes corrections(const Slopes& residual) const noexcept {
    if constexpr (has_whole) {
      if (newton_.whole) {
        const Slopes& units = newton_.all.units;
        detail::Vector<S, stages * unknowns> x{};
        for (std::size_t k = 0; k < x.size(); ++k) {
          const std::size_t s = k / unknowns;
          x[k] = residual[s][k % unknowns] / units[s][k % unknowns];
        }
        x = newton_.all.eliminated.solve(x);
        Slopes by{};
        for (std::size_t k = 0; k < x.size(); ++k) {
          const std::size_t s = k / unknowns;
          by[s][k % unknowns] = x[k] * units[s][k % unknowns];
        }
        return by;
      }
    }
    return newton_.equations.solve(table, residual);
  }

  /// The Jacobian of all stages, by differences of the residual.
  constexpr void linearise_all(const System& system, const StateOf<System>& state,
                               const S& t) noexcept
    requires has_whole
  {
    constexpr std::size_t size = stages * unknowns;
    // ε^⅜: where rounding is magnified, ε^½ leaves no digit of a difference.
    const S fourth = scalar::sqrt(scalar::sqrt(scalar::Limits<S>::epsilon()));
    const S root = fourth * scalar::sqrt(fourth);
    Slopes& units = newton_.all.units;
    for (std::size_t s = 0; s < stages; ++s) {
      for (std::size_t i = 0; i < n; ++i) {
        const Rate now = rate(slopes_[s], i);
        const auto rates = now.components();
        const S least = S(0.01) * detail::largest(now) +
                        root * detail::largest(state.motors[i]) / scalar::abs(h_);
        const S pushed = detail::largest(momenta_[s][i]) + detail::largest(gained_[i]);
        for (std::size_t k = 0; k < dimension; ++k) {
          units[s][i * dimension + k] = root * (scalar::abs(rates[k]) + least);
          if constexpr (has_push) {
            units[s][positions + i * dimension + k] =
                select(pushed > S(0), root * pushed / scalar::abs(h_), S(1));
          }
        }
      }
    }
    detail::Matrix<S, size> matrix{};
    Gauss there = *this;
    const Slopes here = there.residual(system, state, t);
    for (std::size_t column = 0; column < size; ++column) {
      const std::size_t from = column / unknowns;
      there.slopes_ = slopes_;
      there.beside_ = beside_;
      S& moved = there.slopes_[from][column % unknowns];
      moved = moved + units[from][column % unknowns];
      there.settle(state);
      const Slopes off = there.residual(system, state, t);
      for (std::size_t row = 0; row < size; ++row) {
        const std::size_t s = row / unknowns;
        const std::size_t k = row % unknowns;
        matrix[row][column] = (here[s][k] - off[s][k]) / units[s][k];
      }
    }
    newton_.all.eliminated = detail::Eliminated<S, size>(matrix);
  }

  /// Whether any component's change is less than half of what it was at its lowest.
  [[nodiscard]] constexpr bool shrunk(const Slopes& by, bool is_first) noexcept {
    bool any = false;
    for (std::size_t k = 0; k < unknowns; ++k) {
      const S now = largest_of(by, k);
      if (is_first || now < S(0.5) * lowest_[k]) {
        any = any || now > S(0);
        lowest_[k] = now;
      }
    }
    return any;
  }

  [[nodiscard]] static constexpr S largest_of(const Slopes& by, std::size_t k) noexcept {
    S largest(0);
    for (const Vector& x : by) largest = scalar::max_abs(largest, x[k]);
    return largest;
  }

  /// Whether a residual is no more than what rounding of the stages' states makes it.
  [[nodiscard]] constexpr bool is_rounding(const System& system, const StateOf<System>& state,
                                           const S& t, const Slopes& residual) noexcept {
    const S epsilon = scalar::Limits<S>::epsilon();
    Slopes noise{};
    // By many roundings and with two choices of signs: one might move nothing by chance, where few
    // digits are left of a difference of large numbers.
    const S by = S(64) * epsilon;
    for (const std::size_t alike : {std::size_t(1), std::size_t(2)}) {
      const auto rounded = [&](auto& x) {
        auto numbers = x.components();
        for (std::size_t k = 0; k < numbers.size(); ++k) {
          numbers[k] = mul_add(k / alike % 2 == 0 ? by : -by, numbers[k], numbers[k]);
        }
        x = std::remove_reference_t<decltype(x)>::from(numbers);
      };
      const StateOf<System> center = half_way(state);
      auto off = center;
      for (auto& motor : off.motors) rounded(motor);
      for (std::size_t s = 0; s < stages; ++s) {
        const S then = mul_add(table.nodes[s], h_, t);
        auto charts = charts_[s];
        auto momenta = momenta_[s];
        for (std::size_t i = 0; i < n; ++i) {
          Rate xi = charts[i].xi();
          rounded(xi);
          charts[i] = Chart(xi);
          // The balance of p, of which m is made, and what the step began with, turned.
          Momentum p = charts_[s][i].momentum(momenta[i]);
          rounded(p);
          Momentum before = half_way_[i].opposite().body_momentum(charts[i].seen_from_center(p));
          rounded(before);
          momenta[i] = half_way_[i].body_momentum(before);
        }
        const Vector moved = less(slope(system, off, charts, momenta, then).slope,
                                  slope(system, center, charts_[s], momenta_[s], then).slope);
        for (std::size_t k = 0; k < unknowns; ++k) {
          noise[s][k] = scalar::max_abs(noise[s][k], moved[k]);
        }
      }
    }
    // Where rounding moves the stages by more, they say nothing.
    if (!(size(noise) < S(0.01)) || !(size(residual) < S(0.01))) return false;
    for (std::size_t k = 0; k < unknowns; ++k) {
      const S bound = largest_of(noise, k) + S(16) * epsilon * largest_of(slopes_, k);
      if (!(largest_of(residual, k) <= bound)) return false;
    }
    return true;
  }

  /// The size of a change of slopes, relative to Σ |ξ̇ m|.
  [[nodiscard]] constexpr S size(const Slopes& by) const noexcept {
    S changed(0);
    S whole(0);
    S both(0);
    for (std::size_t s = 0; s < stages; ++s) {
      for (std::size_t i = 0; i < n; ++i) {
        const auto m = momenta_[s][i].components();
        for (std::size_t k = 0; k < dimension; ++k) {
          const std::size_t at = i * dimension + k;
          changed = changed + scalar::abs(by[s][at] * m[k]);
          whole = whole + scalar::abs(slopes_[s][at] * m[k]);
          if constexpr (has_push) {
            const S pushed = h_ * by[s][positions + at];
            changed = changed + scalar::abs(slopes_[s][at] * pushed);
            both = both + scalar::abs(by[s][at] * pushed);
          }
        }
      }
    }
    // The root sees a small component beside a large one, as a spin, to first order.
    return select(whole > S(0), changed / whole + scalar::sqrt(both / whole), changed + both);
  }

  /// The Jacobian of ξ̇ and ṁ in the middle, by differences of the gradient: Newton's method asks no
  /// more of it than to be near.
  ///
  /// What is common to all stages moves M̂ instead of ξ, on which the first and the last stage are
  /// asked.
  constexpr void linearise(const System& system, const StateOf<System>& state,
                           const S& t) noexcept {
    if constexpr (has_whole) {
      if (newton_.whole) {
        newton_.h = h_;
        linearise_all(system, state, t);
        return;
      }
    }
    const StateOf<System> center = half_way(state);
    const std::array<Chart, n> middle{};
    Momenta momenta{};
    for (std::size_t i = 0; i < n; ++i) {
      momenta[i] = mul_add(S(0.5), gained_[i], half_way_[i].body_momentum(state.momenta[i]));
    }
    using Matrix = detail::Matrix<S, unknowns>;
    const Matrix jacobian = differences(
        system, center, middle, momenta, mul_add(S(0.5), h_, t),
        [](auto&, auto& charts, auto&, std::size_t i, const Rate& by) { charts[i] = Chart(by); });
    const auto common = [&](std::size_t s) {
      return differences(system, center, charts_[s], momenta_[s], mul_add(table.nodes[s], h_, t),
                         [&](auto& moved, auto&, auto& m, std::size_t i, const Rate& by) {
                           const Chart opposite = half_way_[i].opposite();
                           const Rate eta = Ad(opposite.element(), opposite.body_rate(by));
                           moved.motors[i] =
                               moved.motors[i] + detail::motor_change(moved.motors[i], eta);
                           // What the step began with is seen from there.
                           m[i] = m[i] + coadjoint(Chart::turn_of(eta),
                                                   half_way_[i].body_momentum(state.momenta[i]));
                         });
    };
    Matrix mean = common(0);
    Matrix slope{};
    if constexpr (stages > 1) {
      const Matrix first = mean;
      const Matrix last = common(stages - 1);
      for (std::size_t row = 0; row < unknowns; ++row) {
        for (std::size_t k = 0; k < unknowns; ++k) {
          mean[row][k] = S(0.5) * (first[row][k] + last[row][k]);
          slope[row][k] = S(0.5) * (last[row][k] - first[row][k]) / table.legendre[1][stages - 1];
        }
      }
    }
    newton_.h = h_;
    newton_.equations.set(jacobian, mean, slope, h_);
  }

  /// Of ξ̇ and ṁ, by rates that `move` takes and by m.
  template <class Move>
  [[nodiscard]] constexpr detail::Matrix<S, unknowns> differences(
      const System& system, const StateOf<System>& center, const std::array<Chart, n>& charts,
      const Momenta& momenta, const S& t, const Move& move) const noexcept {
    detail::Matrix<S, unknowns> jacobian{};
    const Vector here = slope(system, center, charts, momenta, t).slope;
    const S root = scalar::sqrt(scalar::Limits<S>::epsilon());
    const auto fill = [&](std::size_t column, const Vector& there, const S& step) {
      for (std::size_t row = 0; row < unknowns; ++row) {
        jacobian[row][column] = (there[row] - here[row]) / step;
      }
    };
    for (std::size_t i = 0; i < n; ++i) {
      // Of what the step does not move, little is known.
      const auto rates = rate(slopes_[stages / 2], i).components();
      const S moved = scalar::abs(h_) * detail::largest(rate(slopes_[stages / 2], i));
      const S pushed = detail::largest(momenta[i]) + detail::largest(gained_[i]);
      for (std::size_t k = 0; k < dimension; ++k) {
        std::array<S, dimension> unit{};
        unit[k] = root * (scalar::abs(h_ * rates[k]) + S(0.01) * moved +
                          root * detail::largest(center.motors[i]));
        auto moved_center = center;
        auto moved_charts = charts;
        auto moved_momenta = momenta;
        move(moved_center, moved_charts, moved_momenta, i, Rate::from(unit));
        fill(i * dimension + k, slope(system, moved_center, moved_charts, moved_momenta, t).slope,
             unit[k]);
        if constexpr (has_push) {
          if (!(pushed > S(0))) continue;
          unit[k] = root * pushed;
          moved_momenta = momenta;
          moved_momenta[i] = momenta[i] + Momentum::from(unit);
          fill(positions + i * dimension + k, slope(system, center, charts, moved_momenta, t).slope,
               unit[k]);
        }
      }
    }
    return jacobian;
  }

  /// Moves the state; what it loses in each step is kept.
  constexpr void finish(StateOf<System>& state) noexcept {
    ChangeOf<System> change{};
    for (std::size_t i = 0; i < n; ++i) {
      const Rate x = half_way_[i].whole_logarithm();
      change.motors[i] = detail::motor_change(state.motors[i], x);
      change.momenta[i] = detail::momentum_change(state.momenta[i], Chart::turn_of(x));
      if constexpr (has_push) {
        change.momenta[i] = change.momenta[i] + half_way_[i].body_momentum(gained_[i]);
      }
    }
    detail::record(drift_, low_.add(state, change));
    if (failure_ != Failure::none) {
      for (auto& mu : state.momenta) mu = S(std::numeric_limits<double>::quiet_NaN()) * mu;
    }
    if constexpr (PoweredSystem<System>) {
      for (std::size_t s = 0; s < stages; ++s) work_ = mul_add(step_weights_[s], power_[s], work_);
    }
    end_ = state;
  }

  /// ξ of a body at a stage, h Σ ã ξ̇.
  [[nodiscard]] constexpr Rate displacement(std::size_t s, std::size_t i) const noexcept {
    Rate xi{};
    for (std::size_t r = 0; r < stages; ++r) {
      xi = mul_add(table.skew[s][r] * step_weights_[r], rate(slopes_[r], i), xi);
    }
    return xi;
  }

  /// B and what pushes μ, body frame.
  [[nodiscard]] static constexpr Vector numbers([[maybe_unused]] const System& system,
                                                [[maybe_unused]] const StateOf<System>& state,
                                                const Gradients& slope) noexcept {
    Vector x{};
    [[maybe_unused]] Momenta coupling{};
    if constexpr (has_coupling) {
      RatesOf<System> shifts{};
      for (std::size_t i = 0; i < n; ++i) shifts[i] = Chart::shift_of(slope.rates[i]);
      coupling = free_momentum_rates(system, state.momenta, shifts);
    }
    for (std::size_t i = 0; i < n; ++i) {
      put(x, i, slope.rates[i]);
      if constexpr (has_push) {
        Momentum push{};
        if constexpr (System::has_forque) push = push - slope.forques[i];
        if constexpr (has_coupling) push = push + coupling[i];
        put_push(x, i, push);
      }
    }
    return x;
  }

  static constexpr void put(Vector& x, std::size_t i, const Rate& b) noexcept {
    const auto from = b.components();
    for (std::size_t k = 0; k < dimension; ++k) x[i * dimension + k] = from[k];
  }
  static constexpr void put_push(Vector& x, std::size_t i, const Momentum& f) noexcept {
    const auto from = f.components();
    for (std::size_t k = 0; k < dimension; ++k) x[positions + i * dimension + k] = from[k];
  }
  [[nodiscard]] static constexpr Rate rate(const Vector& x, std::size_t i) noexcept {
    std::array<S, dimension> b{};
    for (std::size_t k = 0; k < dimension; ++k) b[k] = x[i * dimension + k];
    return Rate::from(b);
  }
  [[nodiscard]] static constexpr Momentum push(const Vector& x, std::size_t i) noexcept {
    std::array<S, dimension> f{};
    for (std::size_t k = 0; k < dimension; ++k) f[k] = x[positions + i * dimension + k];
    return Momentum::from(f);
  }
  [[nodiscard]] static constexpr Vector less(Vector x, const Vector& y) noexcept {
    for (std::size_t k = 0; k < unknowns; ++k) x[k] = x[k] - y[k];
    return x;
  }
  Slopes slopes_{};     ///< ξ̇ and ṁ at the stages
  Slopes gradients_{};  ///< B and −F there
  std::array<std::array<Chart, n>, stages> charts_{};
  std::array<Momenta, stages> momenta_{};   ///< m
  std::array<Momenta, stages> balanced_{};  ///< m as the balance of forques has it
  std::array<Momenta, stages> beside_{};    ///< m less that
  Momenta gained_{};                        ///< h Σ b ṁ
  std::array<Chart, n> half_way_{};         ///< that of M₁, at X/2
  std::array<S, stages> step_weights_{};    ///< h b
  std::array<S, stages> power_{};
  Vector lowest_{};  ///< the smallest change of each component so far
  S h_{};
  StateOf<System> end_{};  ///< what the last step left
  [[no_unique_address]] std::conditional_t<has_newton, Newton, NoNewton> newton_;
  [[no_unique_address]] LowDigits<System, summation> low_;
  Drift<S> drift_;
  S work_{};
  Failure failure_ = Failure::none;
  int iterations_ = 0;
  bool foresees_ = false;
};

/// The midpoint rule on the group, order 2: M₁ = M₀ exp(h B), B and F half-way.
template <HamiltonianSystem System>
using LieMidpoint = Gauss<System, 1>;
template <HamiltonianSystem System>
using Gauss4 = Gauss<System, 2>;
template <HamiltonianSystem System>
using Gauss6 = Gauss<System, 3>;
template <HamiltonianSystem System>
using Gauss8 = Gauss<System, 4>;
template <HamiltonianSystem System>
using Gauss12 = Gauss<System, 6>;
template <HamiltonianSystem System>
using Gauss16 = Gauss<System, 8>;

}  // namespace hamotor
