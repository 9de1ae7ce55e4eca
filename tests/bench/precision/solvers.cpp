// Public solvers of ordinary differential equations on the reference problems: Boost.odeint's, and
// the classical Runge-Kutta method in Eigen's types.
//
// The state is what their users take: quaternion (w, x, y, z) and body rates, 7 numbers, and for a
// body that moves also position and velocity in the world, 13.  Tolerances are both absolute and
// relative.  Steppers are compiled for a state of fixed size, with all that a release build has.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <boost/numeric/odeint.hpp>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace {

namespace odeint = boost::numeric::odeint;

/// The numbers of a problem, as they stand in its reference solution.
struct Problem {
  double inertia[3];
  double mass, gravity, height, stiffness, rest_length;
  double at[3];
};

template <std::size_t n>
using State = std::array<double, n>;

/// q̇ = ½ q ω.
template <std::size_t n>
inline void turn(const State<n>& x, State<n>& rate) {
  rate[0] = 0.5 * (-x[1] * x[4] - x[2] * x[5] - x[3] * x[6]);
  rate[1] = 0.5 * (x[0] * x[4] + x[2] * x[6] - x[3] * x[5]);
  rate[2] = 0.5 * (x[0] * x[5] + x[3] * x[4] - x[1] * x[6]);
  rate[3] = 0.5 * (x[0] * x[6] + x[1] * x[5] - x[2] * x[4]);
}

struct Constants {
  explicit Constants(const Problem& p)
      : a{(p.inertia[1] - p.inertia[2]) / p.inertia[0],
          (p.inertia[2] - p.inertia[0]) / p.inertia[1],
          (p.inertia[0] - p.inertia[1]) / p.inertia[2]},
        inverse{1 / p.inertia[0], 1 / p.inertia[1], 1 / p.inertia[2]},
        lever(p.mass * p.gravity * p.height),
        gravity(p.gravity),
        stiffness(p.stiffness),
        rest_length(p.rest_length),
        inverse_mass(1 / p.mass),
        at{p.at[0], p.at[1], p.at[2]} {}

  double a[3];        // of Euler's equations
  double inverse[3];  // of the moments of inertia
  double lever, gravity, stiffness, rest_length, inverse_mass;
  double at[3];
};

struct Free {
  static constexpr std::size_t size = 7;
  Constants c;
  void operator()(const State<7>& x, State<7>& rate, double) const {
    turn(x, rate);
    rate[4] = c.a[0] * x[5] * x[6];
    rate[5] = c.a[1] * x[6] * x[4];
    rate[6] = c.a[2] * x[4] * x[5];
  }
};

struct Top {
  static constexpr std::size_t size = 7;
  Constants c;
  void operator()(const State<7>& x, State<7>& rate, double) const {
    turn(x, rate);
    const double up1 = 2 * (x[1] * x[3] - x[0] * x[2]);  // of the vertical, in the body
    const double up2 = 2 * (x[2] * x[3] + x[0] * x[1]);
    rate[4] = c.a[0] * x[5] * x[6] + c.inverse[0] * c.lever * up2;
    rate[5] = c.a[1] * x[6] * x[4] - c.inverse[1] * c.lever * up1;
    rate[6] = c.a[2] * x[4] * x[5];
  }
};

/// `loose`: the spring has a rest length.
template <bool loose>
struct Sprung {
  static constexpr std::size_t size = 13;
  Constants c;
  void operator()(const State<13>& x, State<13>& rate, double) const {
    turn(x, rate);
    const double w = x[0], i = x[1], j = x[2], k = x[3];
    const double r11 = 1 - 2 * (j * j + k * k), r12 = 2 * (i * j - w * k),
                 r13 = 2 * (i * k + w * j);
    const double r21 = 2 * (i * j + w * k), r22 = 1 - 2 * (i * i + k * k),
                 r23 = 2 * (j * k - w * i);
    const double r31 = 2 * (i * k - w * j), r32 = 2 * (j * k + w * i),
                 r33 = 1 - 2 * (i * i + j * j);
    const auto& a = c.at;
    const double d1 = x[7] + r11 * a[0] + r12 * a[1] + r13 * a[2];
    const double d2 = x[8] + r21 * a[0] + r22 * a[1] + r23 * a[2];
    const double d3 = x[9] + r31 * a[0] + r32 * a[1] + r33 * a[2];
    double pull = -c.stiffness;
    if constexpr (loose) pull *= 1 - c.rest_length / std::sqrt(d1 * d1 + d2 * d2 + d3 * d3);
    const double f1 = pull * d1, f2 = pull * d2, f3 = pull * d3;
    const double b1 = r11 * f1 + r21 * f2 + r31 * f3;
    const double b2 = r12 * f1 + r22 * f2 + r32 * f3;
    const double b3 = r13 * f1 + r23 * f2 + r33 * f3;
    rate[4] = c.a[0] * x[5] * x[6] + c.inverse[0] * (a[1] * b3 - a[2] * b2);
    rate[5] = c.a[1] * x[6] * x[4] + c.inverse[1] * (a[2] * b1 - a[0] * b3);
    rate[6] = c.a[2] * x[4] * x[5] + c.inverse[2] * (a[0] * b2 - a[1] * b1);
    rate[7] = x[10];
    rate[8] = x[11];
    rate[9] = x[12];
    rate[10] = f1 * c.inverse_mass;
    rate[11] = f2 * c.inverse_mass;
    rate[12] = f3 * c.inverse_mass - c.gravity;
  }
};

struct Count {
  std::int64_t steps = 0;
  std::int64_t evaluations = 0;
};

/// Runs one solver from `x` to `end` and says what it took.
template <class Rates>
using Solver = void (*)(const Rates&, State<Rates::size>& x, double end, double setting, Count*);

/// `setting` is the tolerance.  `Count` null: no accounting.
template <class Controlled, class Rates>
void controlled(Controlled stepper, const Rates& rates, State<Rates::size>& x, double end,
                Count* count) {
  constexpr double first_step = 1e-2;
  if (count == nullptr) {
    odeint::integrate_adaptive(stepper, rates, x, 0.0, end, first_step);
    return;
  }
  const auto counting = [&](const State<Rates::size>& y, State<Rates::size>& rate, double t) {
    ++count->evaluations;
    rates(y, rate, t);
  };
  count->steps = static_cast<std::int64_t>(
      odeint::integrate_adaptive(stepper, counting, x, 0.0, end, first_step));
}

template <class Rates>
void fehlberg78(const Rates& rates, State<Rates::size>& x, double end, double tolerance,
                Count* count) {
  controlled(odeint::make_controlled(tolerance, tolerance,
                                     odeint::runge_kutta_fehlberg78<State<Rates::size>>()),
             rates, x, end, count);
}

template <class Rates>
void dopri5(const Rates& rates, State<Rates::size>& x, double end, double tolerance, Count* count) {
  controlled(odeint::make_controlled(tolerance, tolerance,
                                     odeint::runge_kutta_dopri5<State<Rates::size>>()),
             rates, x, end, count);
}

template <class Rates>
void bulirsch_stoer(const Rates& rates, State<Rates::size>& x, double end, double tolerance,
                    Count* count) {
  controlled(odeint::bulirsch_stoer<State<Rates::size>>(tolerance, tolerance), rates, x, end,
             count);
}

/// `steps` classical Runge-Kutta steps with Eigen's vectors, the quaternion normalised after each.
template <class Rates>
void eigen_rk4(const Rates& rates, State<Rates::size>& x, double end, double steps, Count* count) {
  constexpr auto n = static_cast<int>(Rates::size);
  using Vector = Eigen::Matrix<double, n, 1>;
  const auto rate = [&](const Vector& y) {
    State<Rates::size> in, out;
    Eigen::Map<Vector>(in.data()) = y;
    rates(in, out, 0.0);
    return Vector(Eigen::Map<Vector>(out.data()));
  };
  const auto whole = static_cast<std::int64_t>(steps);
  const double h = end / steps;
  Vector y = Eigen::Map<Vector>(x.data());
  for (std::int64_t i = 0; i < whole; ++i) {
    const Vector k1 = rate(y);
    const Vector k2 = rate(y + 0.5 * h * k1);
    const Vector k3 = rate(y + 0.5 * h * k2);
    const Vector k4 = rate(y + h * k3);
    y += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    y.template head<4>().normalize();
  }
  Eigen::Map<Vector>(x.data()) = y;
  if (count != nullptr) *count = {whole, 4 * whole};
}

template <class Rates>
Solver<Rates> find(std::string_view name) {
  if (name == "odeint rkf78") return fehlberg78<Rates>;
  if (name == "odeint dopri5") return dopri5<Rates>;
  if (name == "odeint Bulirsch-Stoer") return bulirsch_stoer<Rates>;
  if (name == "Eigen rk4") return eigen_rk4<Rates>;
  return nullptr;
}

template <class Rates>
int time_runs(const Problem& problem, std::string_view name, double end, double setting,
              std::int64_t repetitions, double* seconds, double* state, std::int64_t* counts) {
  using Clock = std::chrono::steady_clock;
  const Rates rates{Constants(problem)};
  const Solver<Rates> solver = find<Rates>(name);
  if (solver == nullptr) return 1;
  State<Rates::size> start, x;
  std::copy_n(state, Rates::size, start.begin());
  for (std::int64_t i = 0; i < repetitions; ++i) {
    x = start;
    const auto began = Clock::now();
    solver(rates, x, end, setting, nullptr);
    const auto ended = Clock::now();
    seconds[i] = std::chrono::duration<double>(ended - began).count();
  }
  Count count;
  solver(rates, start, end, setting, &count);
  std::copy(x.begin(), x.end(), state);
  counts[0] = count.steps;
  counts[1] = count.evaluations;
  return 0;
}

}  // namespace

/// Runs solver `name` `repetitions` times from `state` to `end` and writes the seconds of each, the
/// last state, steps and evaluations.  `kind`: free, top, sprung or loose (sprung, with a rest
/// length).  `setting`: the tolerance, of fixed steps their number.  Returns 0; 1 for what is not
/// known; 2 if the solver gave up.
extern "C" __attribute__((visibility("default"))) int time_solver(
    const char* kind, const Problem* problem, const char* name, double end, double setting,
    std::int64_t repetitions, double* seconds, double* state, std::int64_t* counts) {
  const std::string_view asked = kind;
  const auto time = asked == "free"     ? time_runs<Free>
                    : asked == "top"    ? time_runs<Top>
                    : asked == "sprung" ? time_runs<Sprung<false>>
                    : asked == "loose"  ? time_runs<Sprung<true>>
                                        : nullptr;
  if (time == nullptr) return 1;
  try {
    return time(*problem, name, end, setting, repetitions, seconds, state, counts);
  } catch (...) {  // odeint throws when a step cannot be made small enough
    return 2;
  }
}
