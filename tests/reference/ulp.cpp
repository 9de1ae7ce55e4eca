// How far exp, log, Cayley and normalize are from the truth, in units of the last place of the
// result's norm, over inputs of every kind: θ = 0, denormal, near multiples of π, huge; v = 0,
// tiny, huge; across the axis, along it, between.
//
//   ulp measure SCALAR COUNT [FUNCTION]   one JSON object a line: function, scalar, points, max and
//   median error, … ulp sample SCALAR COUNT [FUNCTION]    input and reference of points, to check
//   the reference
//
// The truth here is classical: quaternion and translation in __float128, split along and across the
// axis.  ulp.py checks it against 50 digits and multivectors alone.
#include <quadmath.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "hamotor/pga2/pga2.hpp"
#include "hamotor/pga3/pga3.hpp"
#include "random.hpp"

namespace {

__extension__ using Quad = __float128;
using Vector = std::array<Quad, 3>;

// s + r·(e23, e31, e12) + q·(e01, e02, e03) + p e0123; a bivector has s = p = 0.
template <class S>
struct Even {
  S s{};
  std::array<S, 3> r{};
  std::array<S, 3> q{};
  S p{};
};

Quad dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Vector times(Quad x, const Vector& a) { return {x * a[0], x * a[1], x * a[2]}; }

Vector plus(const Vector& a, const Vector& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

// v across and along r; the part across by a double cross product, which keeps relative accuracy.
struct Split {
  Quad length;
  Vector axis;
  Vector across;
  Quad along;
};

Split split(const Vector& r, const Vector& v) {
  const Quad length = sqrtq(dot(r, r));
  if (length == 0) return {0, {}, v, 0};
  const Vector axis = times(1 / length, r);
  return {length, axis, times(1 / (length * length), cross(cross(r, v), r)), dot(r, v) / length};
}

Even<Quad> exp_reference(const Even<Quad>& b) {
  const Quad square = dot(b.r, b.r);
  if (square == 0) return {1, {}, b.q, 0};
  const Quad angle = sqrtq(square);
  Quad sine = 0;
  Quad cosine = 0;
  sincosq(angle, &sine, &cosine);
  const Quad sinc = sine / angle;
  const Quad product = dot(b.r, b.q);
  const Quad along = (cosine - sinc) * (product / square);
  return {cosine, times(sinc, b.r), plus(times(sinc, b.q), times(along, b.r)), sinc * product};
}

// The unit motor nearest to m: what log, Cayley's inverse and normalize mean by m.
Even<Quad> normalize_reference(const Even<Quad>& m) {
  const Split q = split(m.r, m.q);
  const Quad norm = sqrtq(m.s * m.s + dot(m.r, m.r));
  const Quad cosine = m.s / norm;
  const Quad sine = q.length / norm;
  const Quad pitch = (cosine * q.along + sine * m.p) / norm;
  return {cosine, times(1 / norm, m.r),
          plus(times(1 / norm, q.across), times(cosine * pitch, q.axis)), sine * pitch};
}

// Angle, axis, the dual angle (pitch) and what is across, of the unit motor nearest to m.
struct Screw {
  Quad sine, cosine, pitch;
  Vector axis, across;
};

Screw screw(const Even<Quad>& m) {
  const Split q = split(m.r, m.q);
  const Quad norm = sqrtq(m.s * m.s + dot(m.r, m.r));
  const Quad cosine = m.s / norm;
  const Quad sine = q.length / norm;
  return {sine, cosine, (cosine * q.along + sine * m.p) / norm, q.axis, times(1 / norm, q.across)};
}

// No r: 1 or −1 times a translation; −1 turns about the translation, or about e12.
Even<Quad> log_reference(const Even<Quad>& m) {
  const Screw k = screw(m);
  if (k.sine == 0) {
    Even<Quad> b;
    b.q = times(1 / m.s, m.q);
    const Quad length = sqrtq(dot(m.q, m.q));
    if (m.s < 0) b.r = length == 0 ? Vector{0, 0, M_PIq} : times(M_PIq / length, m.q);
    return b;
  }
  const Quad angle = atan2q(k.sine, k.cosine);
  return {0, times(angle, k.axis), plus(times(angle / k.sine, k.across), times(k.pitch, k.axis)),
          0};
}

// In the plane −T, T a translation, is no exponential: the logarithm of the same motion T stands
// in.
Even<Quad> planar_log_reference(const Even<Quad>& m) {
  Even<Quad> b = log_reference(m);
  if (dot(m.r, m.r) == 0 && dot(m.q, m.q) != 0) b.r = {0, 0, 0};
  return b;
}

Even<Quad> cayley_reference(const Even<Quad>& b) {
  const Split v = split(b.r, b.q);
  const Quad square = v.length * v.length;
  const Quad inverse = 1 / (1 + square);
  const Vector along = times((1 - square) * inverse * v.along, v.axis);
  return {(1 - square) * inverse, times(2 * inverse, b.r),
          times(2 * inverse, plus(v.across, along)), 4 * v.length * v.along * inverse * inverse};
}

Even<Quad> cayley_inverse_reference(const Even<Quad>& m) {
  const Screw k = screw(m);
  const Quad inverse = k.cosine > 0 ? 1 / (1 + k.cosine) : (1 - k.cosine) / (k.sine * k.sine);
  return {0, times(k.sine * inverse, k.axis),
          times(inverse, plus(k.across, times(k.pitch, k.axis))), 0};
}

// ---------------------------------------------------------------- inputs

struct Random : reference::Random {
  Quad power_of_ten(double low, double high) {
    const double exponent = between(low, high);
    const double whole = std::floor(exponent * 3.3219280948873623);
    return ldexpq(std::exp2(exponent * 3.3219280948873623 - whole), static_cast<int>(whole));
  }
};

template <class S>
Quad smallest() {
  return std::numeric_limits<S>::denorm_min();
}

// Half angles that have gone wrong somewhere.
template <class S>
Quad some_angle(Random& random) {
  const Quad tiny = std::numeric_limits<S>::min();
  const Quad ulp = std::numeric_limits<S>::epsilon();
  const bool wide = sizeof(S) > 4;
  const Quad uniform = random.uniform();
  switch (random.below(20)) {
    case 0:
      return 0;
    case 1:
      return smallest<S>() * static_cast<Quad>(1 + random.below(1000));
    case 2:
      return tiny * uniform;
    case 3:
      return (wide ? Quad(1e-300) : Quad(1e-35)) * (1 + uniform);
    case 4:
      return sqrtq(tiny) * random.power_of_ten(-3, 3);
    case 5:
      return Quad(1e-8) * (1 + uniform);
    case 6:
      return Quad(1e-4) * (1 + uniform);
    case 7:
      return M_PIq / 2 * (1 + ulp * (2 * uniform - 1));
    case 8:
      return M_PIq - Quad(1e-12) * uniform;
    case 9:
      return M_PIq * (1 + ulp * (4 * uniform - 2));
    case 10:
      return 2 * M_PIq * (1 + ulp * (4 * uniform - 2));
    case 11:
      return M_PIq * static_cast<Quad>(1 + random.below(1000)) * (1 + ulp * uniform);
    case 12:
      return Quad(1e6) * uniform;
    case 13:
      return (wide ? Quad(1e15) : Quad(1e7)) * uniform;
    case 14:
      return random.power_of_ten(-17, 0);
    case 15:
      return M_PIq - random.power_of_ten(-17, 0);
    case 16:
      return M_PIq * static_cast<Quad>(1 + random.below(20));
    default:
      return M_PIq * uniform;
  }
}

template <class S>
Quad some_length(Random& random) {
  const bool wide = sizeof(S) > 4;
  const Quad uniform = random.uniform();
  switch (random.below(16)) {
    case 0:
      return 0;
    case 1:
      return smallest<S>() * static_cast<Quad>(1 + random.below(1000));
    case 2:
      return Quad(std::numeric_limits<S>::min()) * (1 + uniform);
    case 3:
      return (wide ? Quad(1e-160) : Quad(1e-20)) * (1 + uniform);
    case 4:
      return Quad(1e-8) * uniform;
    case 5:
      return (wide ? Quad(1e16) : Quad(1e8)) * (1 + uniform);
    case 6:
      return (wide ? Quad(1e154) : Quad(1e19)) * (1 + uniform);
    case 7:
      return (wide ? Quad(1e300) : Quad(1e35)) * (1 + uniform);
    case 8:
      return Quad(std::numeric_limits<S>::max()) * uniform / 4;
    case 9:
      return wide ? random.power_of_ten(-300, 300) : random.power_of_ten(-35, 35);
    default:
      return random.power_of_ten(-4, 4);
  }
}

using Direction = std::array<double, 3>;

Direction unit(const Direction& v, const Direction& otherwise) {
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  return length > 0 ? Direction{v[0] / length, v[1] / length, v[2] / length} : otherwise;
}

Direction some_direction(Random& random) {
  switch (random.below(6)) {
    case 0: {
      Direction axis{};
      axis[random.below(3)] = random.below(2) ? 1 : -1;
      return axis;
    }
    case 1: {  // nearly along an axis
      Direction axis{random.symmetric() * 1e-9, random.symmetric() * 1e-9,
                     random.symmetric() * 1e-20};
      axis[random.below(3)] = 1;
      return unit(axis, axis);
    }
    case 2: {
      const auto n = [&] { return static_cast<double>(random.below(9)) - 4; };
      return unit({n(), n(), n()}, {0, 0, 1});
    }
    default:
      return unit({random.symmetric(), random.symmetric(), random.symmetric()}, {1, 0, 0});
  }
}

// Along, across, nearly so, or in between.
Direction direction_to(Random& random, const Direction& a) {
  const Direction b = some_direction(random);
  const Direction across =
      unit({a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]}, b);
  const auto mixed = [&](const Direction& x, const Direction& y) {
    const auto little = static_cast<double>(random.power_of_ten(-20, 0));
    return Direction{x[0] + little * y[0], x[1] + little * y[1], x[2] + little * y[2]};
  };
  switch (random.below(5)) {
    case 0:
      return a;
    case 1:
      return across;
    case 2:
      return mixed(a, across);
    case 3:
      return mixed(across, a);
    default:
      return b;
  }
}

Vector times(Quad x, const Direction& a) { return {x * a[0], x * a[1], x * a[2]}; }

template <class S>
Even<S> rounded(const Even<Quad>& x) {
  Even<S> y;
  y.s = static_cast<S>(x.s);
  y.p = static_cast<S>(x.p);
  for (std::size_t i = 0; i < 3; ++i) {
    y.r[i] = static_cast<S>(x.r[i]);
    y.q[i] = static_cast<S>(x.q[i]);
  }
  return y;
}

template <class S>
Even<Quad> exact(const Even<S>& x) {
  Even<Quad> y;
  y.s = x.s;
  y.p = x.p;
  for (std::size_t i = 0; i < 3; ++i) {
    y.r[i] = x.r[i];
    y.q[i] = x.q[i];
  }
  return y;
}

// Which components a function's argument has.
enum class Space { spatial, planar, rotations };

Even<Quad> restricted(Even<Quad> x, Space space) {
  if (space == Space::rotations) x.q = {0, 0, 0};
  if (space == Space::planar) {
    x.r = {0, 0, x.r[2]};
    x.q[2] = 0;
  }
  if (space != Space::spatial) x.p = 0;
  return x;
}

Even<Quad> some_bivector(Random& random, Space space, Quad angle, Quad length) {
  const Direction axis = space == Space::planar ? Direction{0, 0, 1} : some_direction(random);
  Even<Quad> b{0, times(angle, axis), times(length, direction_to(random, axis)), 0};
  return restricted(b, space);
}

template <class S>
Even<S> bivector_input(Random& random, Space space) {
  const Quad angle = some_angle<S>(random);
  const Quad length = some_length<S>(random);
  return rounded<S>(some_bivector(random, space, angle, length));
}

// A unit motor, rounded; sometimes one in closed form.
template <class S>
Even<S> motor_input(Random& random, Space space) {
  const Quad angle = some_angle<S>(random);
  const Quad length = some_length<S>(random);
  Even<Quad> b = some_bivector(random, space, angle, length);
  if (random.below(10) == 0) {  // ±1, half turns, translations, and screws of half a turn
    const auto sign = static_cast<Quad>(random.below(2)) * 2 - 1;
    Even<Quad> m;
    if (random.below(2)) {
      m.s = sign;
      if (random.below(2)) m.q = b.q;
    } else {
      m.r[2] = sign;
      if (random.below(2)) m.p = length;
    }
    return rounded<S>(restricted(m, space));
  }
  return rounded<S>(restricted(exp_reference(b), space));
}

// The same, but not −1 times a translation, which Cayley's inverse sends to infinity.
template <class S>
Even<S> finite_motor_input(Random& random, Space space) {
  Even<S> m = motor_input<S>(random, space);
  if (m.s < 0 && m.r == std::array<S, 3>{}) m.s = -m.s;
  return m;
}

template <class S>
bool finite(const Even<S>& x) {
  bool all = std::isfinite(x.s) && std::isfinite(x.p);
  for (std::size_t i = 0; i < 3; ++i) all = all && std::isfinite(x.r[i]) && std::isfinite(x.q[i]);
  return all;
}

// A motor times anything, and then not a motor any more; with a rotor part.
template <class S>
Even<S> any_even_input(Random& random, Space space) {
  Even<Quad> m = exact(motor_input<S>(random, space));
  const bool wide = sizeof(S) > 4;
  const double range = random.below(2) ? (wide ? 300 : 30) : 1;
  const Quad scale = random.power_of_ten(-range, range);
  const Quad slip = random.below(2) ? random.power_of_ten(-16, 0) : Quad(0);
  const auto moved = [&](Quad x) { return scale * x * (1 + slip * random.symmetric()); };
  m.s = moved(m.s);
  m.p = moved(m.p);
  for (std::size_t i = 0; i < 3; ++i) {
    m.r[i] = moved(m.r[i]);
    m.q[i] = moved(m.q[i]);
  }
  const Even<S> x = rounded<S>(m);
  const bool usable = finite(x) && (x.s != 0 || x.r != std::array<S, 3>{});
  return usable ? x : any_even_input<S>(random, space);
}

// Anything finite: any exponent, or the largest or smallest number.
template <class S>
S wild(Random& random) {
  const S sign = random.below(2) ? S(1) : S(-1);
  switch (random.below(6)) {
    case 0:
      return sign * S(0);
    case 1:
      return sign * std::numeric_limits<S>::max();
    case 2:
      return sign * std::numeric_limits<S>::denorm_min();
    default: {
      constexpr int lowest = std::numeric_limits<S>::min_exponent - std::numeric_limits<S>::digits;
      constexpr int span = std::numeric_limits<S>::max_exponent - lowest;
      const int exponent = lowest + static_cast<int>(random.below(span));
      return sign * static_cast<S>(std::ldexp(1 + random.uniform(), exponent));
    }
  }
}

// The function's own kind of argument, with its bivector parts replaced by anything finite; a
// motor keeps its unit rotor part.
template <class S>
Even<S> wild_input(Random& random, Even<S> x, Space space, bool versor) {
  for (std::size_t i = 0; i < 3; ++i) {
    const bool turns = space != Space::planar || i == 2;
    const bool moves = space == Space::spatial || (space == Space::planar && i < 2);
    if (!versor && turns) x.r[i] = wild<S>(random);
    if (moves) x.q[i] = wild<S>(random);
  }
  if (versor && space == Space::spatial) x.p = wild<S>(random);
  return x;
}

// ---------------------------------------------------------------- functions under test

template <class S>
struct Function {
  std::string name;
  std::string form;
  Space space;
  std::function<Even<S>(Random&, Space)> input;
  std::function<Even<S>(const Even<S>&)> kernel;
  std::function<Even<Quad>(const Even<Quad>&)> reference;
};

template <class S>
hamotor::pga3::Motor<S> motor3(const Even<S>& x) {
  return {x.s, x.r[0], x.r[1], x.r[2], x.q[0], x.q[1], x.q[2], x.p};
}
template <class S>
hamotor::pga3::Rotor<S> rotor3(const Even<S>& x) {
  return {x.s, x.r[0], x.r[1], x.r[2]};
}
template <class S>
hamotor::pga2::Motor<S> motor2(const Even<S>& x) {
  return {x.s, x.r[2], x.q[0], x.q[1]};
}
template <class S>
Even<S> even(const hamotor::pga3::Motor<S>& m) {
  return {m.s, {m.e23, m.e31, m.e12}, {m.e01, m.e02, m.e03}, m.e0123};
}
template <class S>
Even<S> even(const hamotor::pga3::Rotor<S>& m) {
  return {m.s, {m.e23, m.e31, m.e12}, {}, {}};
}
template <class S>
Even<S> even(const hamotor::pga2::Motor<S>& m) {
  return {m.s, {S(0), S(0), m.e12}, {m.e01, m.e02, S(0)}, {}};
}
template <class S>
Even<S> even(const hamotor::pga3::Bivector<S>& b) {
  return {{}, {b.e23, b.e31, b.e12}, {b.e01, b.e02, b.e03}, {}};
}
template <class S>
Even<S> even(const hamotor::pga2::Bivector<S>& b) {
  return {{}, {S(0), S(0), b.e12}, {b.e01, b.e02, S(0)}, {}};
}
template <class S>
Even<S> even(const hamotor::pga3::se3::Rate<S>& w) {
  return {{}, {w.w23, w.w31, w.w12}, {w.v1, w.v2, w.v3}, {}};
}
template <class S>
Even<S> even(const hamotor::pga3::so3::Rate<S>& w) {
  return {{}, {w.w23, w.w31, w.w12}, {}, {}};
}
template <class S>
Even<S> even(const hamotor::pga2::se2::Rate<S>& w) {
  return {{}, {S(0), S(0), w.w12}, {w.v1, w.v2, S(0)}, {}};
}

using Reference = std::function<Even<Quad>(const Even<Quad>&)>;

Even<Quad> multiplied(Quad x, Even<Quad> a) {
  return {x * a.s, times(x, a.r), times(x, a.q), x * a.p};
}

// A rate w stands for the bivector −w/2.
Reference of_rate(Reference f) {
  return [f](const Even<Quad>& w) { return f(multiplied(Quad(-0.5), w)); };
}
Reference to_rate(Reference f) {
  return [f](const Even<Quad>& m) { return multiplied(Quad(-2), f(m)); };
}

template <class S>
std::vector<Function<S>> functions() {
  namespace pga2 = hamotor::pga2;
  namespace pga3 = hamotor::pga3;
  const auto bivectors = bivector_input<S>;
  const auto motors = motor_input<S>;
  const auto finite_motors = finite_motor_input<S>;
  const auto evens = any_even_input<S>;
  const auto spatial = Space::spatial;
  const auto planar = Space::planar;
  const auto rotations = Space::rotations;
  using X = const Even<S>&;
  const auto bivector3 = [](X x) {
    return pga3::Bivector<S>{x.r[0], x.r[1], x.r[2], x.q[0], x.q[1], x.q[2]};
  };
  const auto bivector2 = [](X x) { return pga2::Bivector<S>{x.r[2], x.q[0], x.q[1]}; };
  const auto rate3 = [](X x) {
    return pga3::se3::Rate<S>{x.r[0], x.r[1], x.r[2], x.q[0], x.q[1], x.q[2]};
  };
  const auto rate2 = [](X x) { return pga2::se2::Rate<S>{x.r[2], x.q[0], x.q[1]}; };
  const auto spin = [](X x) { return pga3::so3::Rate<S>{x.r[0], x.r[1], x.r[2]}; };
  return {
      {"exp", "pga3 Bivector", spatial, bivectors, [=](X x) { return even(exp(bivector3(x))); },
       exp_reference},
      {"exp", "SE3 Rate", spatial, bivectors, [=](X x) { return even(exp(rate3(x))); },
       of_rate(exp_reference)},
      {"exp", "SO3 Rate", rotations, bivectors, [=](X x) { return even(exp(spin(x))); },
       of_rate(exp_reference)},
      {"exp", "pga2 Bivector", planar, bivectors, [=](X x) { return even(exp(bivector2(x))); },
       exp_reference},
      {"exp", "SE2 Rate", planar, bivectors, [=](X x) { return even(exp(rate2(x))); },
       of_rate(exp_reference)},
      {"log", "pga3 Motor", spatial, motors, [](X x) { return even(log(motor3(x))); },
       log_reference},
      {"log", "SE3 Motor", spatial, motors, [](X x) { return even(pga3::SE3::log(motor3(x))); },
       to_rate(log_reference)},
      {"log", "SO3 Rotor", rotations, motors, [](X x) { return even(pga3::SO3::log(rotor3(x))); },
       to_rate(log_reference)},
      {"log", "pga2 Motor", planar, motors, [](X x) { return even(log(motor2(x))); },
       planar_log_reference},
      {"log", "SE2 Motor", planar, motors, [](X x) { return even(pga2::SE2::log(motor2(x))); },
       to_rate(planar_log_reference)},
      {"cayley", "pga3 Bivector", spatial, bivectors,
       [=](X x) { return even(cayley(bivector3(x))); }, cayley_reference},
      {"cayley", "SE3 Rate", spatial, bivectors, [=](X x) { return even(cayley(rate3(x))); },
       of_rate(cayley_reference)},
      {"cayley", "SO3 Rate", rotations, bivectors, [=](X x) { return even(cayley(spin(x))); },
       of_rate(cayley_reference)},
      {"cayley", "pga2 Bivector", planar, bivectors,
       [=](X x) { return even(cayley(bivector2(x))); }, cayley_reference},
      {"cayley", "SE2 Rate", planar, bivectors, [=](X x) { return even(cayley(rate2(x))); },
       of_rate(cayley_reference)},
      {"cayley_inverse", "pga3 Motor", spatial, finite_motors,
       [](X x) { return even(cayley_inverse(motor3(x))); }, cayley_inverse_reference},
      {"cayley_inverse", "SE3 Motor", spatial, finite_motors,
       [](X x) { return even(pga3::SE3::cayley_inverse(motor3(x))); },
       to_rate(cayley_inverse_reference)},
      {"cayley_inverse", "SO3 Rotor", rotations, finite_motors,
       [](X x) { return even(pga3::SO3::cayley_inverse(rotor3(x))); },
       to_rate(cayley_inverse_reference)},
      {"cayley_inverse", "pga2 Motor", planar, finite_motors,
       [](X x) { return even(cayley_inverse(motor2(x))); }, cayley_inverse_reference},
      {"cayley_inverse", "SE2 Motor", planar, finite_motors,
       [](X x) { return even(pga2::SE2::cayley_inverse(motor2(x))); },
       to_rate(cayley_inverse_reference)},
      {"normalize", "pga3 Motor", spatial, evens, [](X x) { return even(normalize(motor3(x))); },
       normalize_reference},
      {"normalize", "pga3 Rotor", rotations, evens, [](X x) { return even(normalize(rotor3(x))); },
       normalize_reference},
      {"normalize", "pga2 Motor", planar, evens, [](X x) { return even(normalize(motor2(x))); },
       normalize_reference},
  };
}

// ---------------------------------------------------------------- judging

template <class T>
std::array<T, 8> components(const Even<T>& x) {
  return {x.s, x.r[0], x.r[1], x.r[2], x.q[0], x.q[1], x.q[2], x.p};
}

// The size of numbers that differ from the truth or are it: for that, 64 bits are plenty.
using Wide = long double;

template <std::size_t n>
Wide norm(const std::array<Wide, n>& x) {
  Wide sum = 0;
  for (const Wide c : x) sum += c * c;
  return std::sqrt(sum);
}

template <class S>
Wide ulp(Wide size) {
  int exponent = 0;
  std::frexp(size, &exponent);
  const Wide unit = std::ldexp(Wide(1), exponent - std::numeric_limits<S>::digits);
  return std::max<Wide>(unit, std::numeric_limits<S>::denorm_min());
}

struct Judgement {
  double error = 0;    // in ulp of the norm
  double allowed = 0;  // extra, from the angle being a double-word number; in the same unit
  bool overflow = false;
  bool nan = false;
};

template <class S>
Judgement judge(const Function<S>& f, const Even<S>& x) {
  const auto truth = components(f.reference(exact(x)));
  const auto found = components(f.kernel(x));
  Judgement result;
  std::array<Wide, 8> sizes{};
  std::array<Wide, 8> errors{};
  for (std::size_t i = 0; i < 8; ++i) {
    result.nan = result.nan || found[i] != found[i];
    sizes[i] = static_cast<Wide>(truth[i]);
    errors[i] = static_cast<Wide>(truth[i] - found[i]);
    result.overflow =
        result.overflow || !(std::fabs(sizes[i]) <= std::numeric_limits<S>::max() / 4);
  }
  if (result.nan || result.overflow) return result;
  const Wide unit = ulp<S>(norm(sizes));
  result.error = static_cast<double>(norm(errors) / unit);
  const Wide epsilon = std::numeric_limits<S>::epsilon();
  const std::array<Wide, 3> moved{x.q[0], x.q[1], x.q[2]};
  result.allowed = static_cast<double>(epsilon * epsilon * norm(moved) / unit);
  return result;
}

std::string hexadecimal(Quad x) {
  std::array<char, 64> text{};
  quadmath_snprintf(text.data(), text.size(), "%.40Qe", x);
  return text.data();
}

std::string list(const Even<Quad>& x) {
  std::string text;
  for (const Quad c : components(x)) text += (text.empty() ? "\"" : ", \"") + hexadecimal(c) + "\"";
  return "[" + text + "]";
}

template <class S>
void measure(const char* scalar, std::size_t count, const std::string& only) {
  for (const Function<S>& f : functions<S>()) {
    if (!only.empty() && f.name != only) continue;
    Random random{{std::hash<std::string>{}(f.name + f.form)}};
    std::vector<double> errors;
    Even<S> worst{};
    double largest = -1;
    double beyond = 0;  // (error − 4) / allowed where v is too large for a double-word angle
    std::size_t nans = 0;
    std::size_t overflows = 0;
    Even<S> nan_input{};
    for (std::size_t i = 0; i < count; ++i) {
      const Even<S> x = f.input(random, f.space);
      const Judgement found = judge(f, x);
      if (found.nan) {
        ++nans;
        nan_input = x;
        continue;
      }
      if (found.overflow) {
        ++overflows;
        continue;
      }
      if (f.name == "exp" && found.allowed > 0.5) {
        beyond = std::max(beyond, (found.error - 4) / found.allowed);
        continue;
      }
      errors.push_back(found.error);
      if (!(found.error <= largest)) {
        largest = found.error;
        worst = x;
      }
    }
    const bool versor = f.name == "log" || f.name == "cayley_inverse" || f.name == "normalize";
    std::size_t wild_nans = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Even<S> x = wild_input(random, f.input(random, f.space), f.space, versor);
      const auto found = components(f.kernel(x));
      const bool nan = std::any_of(found.begin(), found.end(), [](S c) { return c != c; }) &&
                       !judge(f, x).overflow;
      wild_nans += nan;
      if (nan) nan_input = x;
    }
    const std::size_t judged = errors.size();
    std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(judged / 2),
                     errors.end());
    std::printf(
        "{\"function\": \"%s\", \"form\": \"%s\", \"scalar\": \"%s\", \"points\": %zu, "
        "\"judged\": %zu, \"max_ulp\": %.4g, \"median_ulp\": %.4g, \"nan\": %zu, \"wild_nan\": "
        "%zu, "
        "\"overflow\": %zu, \"beyond\": %.4g, \"worst\": %s, \"nan_input\": %s}\n",
        f.name.c_str(), f.form.c_str(), scalar, count, judged, largest, errors[judged / 2], nans,
        wild_nans, overflows, beyond, list(exact(worst)).c_str(), list(exact(nan_input)).c_str());
    std::fflush(stdout);
  }
}

template <class S>
void sample(const char* scalar, std::size_t count, const std::string& only) {
  for (const Function<S>& f : functions<S>()) {
    if (!only.empty() && f.name != only) continue;
    Random random{{std::hash<std::string>{}(f.name + f.form)}};
    for (std::size_t i = 0; i < count; ++i) {
      const Even<Quad> x = exact(f.input(random, f.space));
      std::printf(
          "{\"function\": \"%s\", \"form\": \"%s\", \"scalar\": \"%s\", \"input\": %s, "
          "\"reference\": %s}\n",
          f.name.c_str(), f.form.c_str(), scalar, list(x).c_str(), list(f.reference(x)).c_str());
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4 && argc != 5) {
    std::fprintf(stderr, "usage: ulp measure|sample float|double COUNT [FUNCTION]\n");
    return 2;
  }
  const bool measuring = std::strcmp(argv[1], "measure") == 0;
  const bool wide = std::strcmp(argv[2], "double") == 0;
  const auto count = static_cast<std::size_t>(std::atoll(argv[3]));
  const std::string only = argc == 5 ? argv[4] : "";
  if (measuring) {
    wide ? measure<double>("double", count, only) : measure<float>("float", count, only);
  } else {
    wide ? sample<double>("double", count, only) : sample<float>("float", count, only);
  }
  return 0;
}
