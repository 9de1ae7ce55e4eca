// The reference problems as public solvers are given them: rigid bodies in quaternion (w, x, y, z)
// and body rates, 7 numbers, and for a body that moves also position and velocity in the world, 13.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace bench {

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

}  // namespace bench
