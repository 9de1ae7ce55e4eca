// Public solvers of ordinary differential equations on the reference problems: Boost.odeint's, and
// the classical Runge-Kutta method in Eigen's types.
//
// Tolerances are both absolute and relative.  Steppers are compiled for a state of fixed size, with
// all that a release build has.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <boost/numeric/odeint.hpp>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "timing.hpp"

namespace {

namespace odeint = boost::numeric::odeint;
using bench::Count;
using bench::Solver;
using bench::State;

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

/// `steps` classical Runge-Kutta steps of odeint.
template <class Rates>
void odeint_rk4(const Rates& rates, State<Rates::size>& x, double end, double steps, Count* count) {
  const auto whole = static_cast<std::int64_t>(steps);
  odeint::runge_kutta4<State<Rates::size>> stepper;
  odeint::integrate_n_steps(stepper, rates, x, 0.0, end / steps, static_cast<std::size_t>(whole));
  if (count != nullptr) *count = {whole, 4 * whole};
}

struct Solvers {
  template <class Rates>
  static Solver<Rates> find(std::string_view name) {
    if (name == "odeint rkf78") return fehlberg78<Rates>;
    if (name == "odeint dopri5") return dopri5<Rates>;
    if (name == "odeint Bulirsch-Stoer") return bulirsch_stoer<Rates>;
    if (name == "odeint rk4") return odeint_rk4<Rates>;
#ifndef HAMOTOR_BENCH_EQUATIONS  // which hold no quaternion to normalise
    if (name == "Eigen rk4") return eigen_rk4<Rates>;
#endif
    return nullptr;
  }
};

}  // namespace

HAMOTOR_BENCH_SOLVERS(Solvers);
