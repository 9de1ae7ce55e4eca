// exp and log of every group at the angles where formulas break: 0, tiny, and around multiples of
// π.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "hamotor/cga2/cga2.hpp"
#include "hamotor/cga3/cga3.hpp"
#include "hamotor/cl3/cl3.hpp"
#include "hamotor/pga2/pga2.hpp"
#include "hamotor/pga3/pga3.hpp"
#include "hamotor/pga4/pga4.hpp"
#include "hamotor/scalar.hpp"
#include "hamotor/sta/sta.hpp"

namespace {

constexpr double pi = 3.14159265358979323846;
constexpr double epsilon = 0x1p-52;

template <class T>
double largest(const T& x) {
  double worst = 0;
  for (const auto& c : x.components()) {
    const auto size = std::fabs(static_cast<double>(c));
    if (!(size <= worst)) worst = size;
  }
  return worst;
}

/// The errors so far, in ε of the largest number of the result, divided by 1 + |X|.
struct Errors {
  double exp = 0;
  double log = 0;

  static void see(double& worst, double error) {
    if (!(error <= worst) && worst == worst) worst = error;
  }
};

/// exp X against long double, and exp log exp X against exp X, for X = angle × direction.
template <class G>
void visit(const std::array<double, static_cast<std::size_t>(G::dimension)>& direction,
           double angle, Errors& errors) {
  using Rate = typename G::template Rate<double>;
  using Wide = typename G::template Rate<long double>;
  std::array<double, Rate::size> x{};
  std::array<long double, Rate::size> wide{};
  for (std::size_t k = 0; k < x.size(); ++k) {
    x[k] = angle * direction[k];
    wide[k] = static_cast<long double>(x[k]);
  }
  const auto m = exp(Rate::from(x));
  const auto truth = exp(Wide::from(wide)).components();
  const auto found = m.components();
  const double unit = epsilon * (1 + largest(Rate::from(x)));
  const double size = largest(m);
  double off = 0;
  for (std::size_t k = 0; k < found.size(); ++k) {
    Errors::see(off, std::fabs(static_cast<double>(static_cast<long double>(found[k]) - truth[k])));
  }
  Errors::see(errors.exp, off / (unit * size));
  const auto again = exp(G::log(m));
  Errors::see(errors.log, largest(again - m) / (unit * size));
}

/// Along every plane by itself and each with every other generator, there and moved elsewhere.
///
/// Elsewhere a rotor is −1 to rounding where the half angle is that near π: no digit of its plane
/// is left, and a translation along it would be one across.  In the general conformal group, where
/// nothing tells a translation from a small boost but squares that cancel, a screw elsewhere (a
/// rotation and a null one that commute) is not known that well near π at all.
template <class G>
void visit_group(double* out) {
  constexpr auto n = static_cast<std::size_t>(G::dimension);
  using Rate = typename G::template Rate<double>;
  std::array<double, n> way{};
  for (std::size_t i = 0; i < n; ++i) way[i] = std::sin(1.0 + static_cast<double>(3 * i));
  const auto elsewhere = exp(Rate::from(way));
  const auto generator = [](std::size_t i) {
    std::array<double, n> x{};
    x[i] = 1;
    return Rate::from(x);
  };
  const auto screw = [&](std::size_t i, std::size_t j) {
    return largest(ad(generator(i), generator(j))) == 0 && exp(generator(j)).components()[0] == 1;
  };
  constexpr bool conformal = std::is_same_v<G, hamotor::cga3::SO41>;
  Errors errors;
  for (const double turn : {0.0, 1.0, 2.0, 3.0, 4.0}) {
    for (const double near :
         {0.0, 1e-300, 1e-160, 1e-30, 1e-17, 1e-16, 1e-15, 1e-12, 1e-8, 1e-6, 1e-4, 1e-2, 0.5}) {
      for (const double side : {-1.0, 1.0}) {
        const double angle = turn * pi + side * near;
        const auto both = [&](const std::array<double, n>& direction, bool screwed) {
          visit<G>(direction, angle, errors);
          if (turn == 2.0 && near < (screwed ? 0.1 : 1e-12)) return;
          visit<G>(Ad(elsewhere, Rate::from(direction)).components(), angle, errors);
        };
        for (std::size_t i = 0; i < n; ++i) {
          std::array<double, n> direction{};
          direction[i] = 1;
          both(direction, false);
          for (std::size_t j = 0; j < n; ++j) {
            if (j == i) continue;
            const bool screwed = conformal && screw(i, j);
            direction[j] = 0.3;
            both(direction, screwed);
            direction[j] = 1e-9;
            both(direction, screwed);
            direction[j] = 0;
          }
        }
      }
    }
  }
  out[0] = errors.exp;
  out[1] = errors.log;
}

}  // namespace

/// Writes the largest errors of exp and log in each group, in the order of `edge_groups`.
extern "C" __attribute__((visibility("default"))) void edge_errors(double* out) {
  visit_group<hamotor::cl3::SO3>(out);
  visit_group<hamotor::pga2::SE2>(out + 2);
  visit_group<hamotor::pga3::SO3>(out + 4);
  visit_group<hamotor::pga3::SE3>(out + 6);
  visit_group<hamotor::pga4::SO4>(out + 8);
  visit_group<hamotor::pga4::SE4>(out + 10);
  visit_group<hamotor::cga2::SE2>(out + 12);
  visit_group<hamotor::cga2::Sim2>(out + 14);
  visit_group<hamotor::cga2::SO31>(out + 16);
  visit_group<hamotor::cga3::SE3>(out + 18);
  visit_group<hamotor::cga3::Sim3>(out + 20);
  visit_group<hamotor::cga3::SO41>(out + 22);
  visit_group<hamotor::sta::SO13>(out + 24);
}

/// Their names, one space apart.
extern "C" __attribute__((visibility("default"))) const char* edge_groups() {
  return "cl3::SO3 pga2::SE2 pga3::SO3 pga3::SE3 pga4::SO4 pga4::SE4 cga2::SE2 cga2::Sim2 "
         "cga2::SO31 cga3::SE3 cga3::Sim3 cga3::SO41 sta::SO13";
}
