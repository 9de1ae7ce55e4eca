// Events: when a function of the state crosses zero.
#pragma once

#include "hamotor/scalar.hpp"
#include "hamotor/state.hpp"

namespace hamotor {

/// In which direction a function must cross zero to be an event.
enum class Crossing { both, rising, falling };

/// Whether a function with these values before and after a step has crossed zero in it.  A step
/// that begins at zero crosses none: the one before has ended there.
template <class S>
[[nodiscard]] constexpr bool crosses(Crossing direction, const S& before, const S& after) noexcept {
  const bool rises = before < S(0) && !(after < S(0)) && after == after;
  const bool falls = before > S(0) && !(after > S(0)) && after == after;
  return (rises && direction != Crossing::falling) || (falls && direction != Crossing::rising);
}

/// The state after the part `part` (s) of a step from `start` at t; neither the stepper nor the
/// start changes.  Of an error as large as that of a step of this length, or of dense output.
template <class System, class Method, class States, class S>
[[nodiscard]] constexpr States part_of_step(const System& system, Method method, States start,
                                            const S& t, const S& part) noexcept {
  method.do_step(system, start, t, part);
  return start;
}

/// After which part of the step from `start`, t to t + h, `function(state, time)` is zero, s: to
/// rounding of the time or of h.  Its values there, `before` and `after`, have unlike signs.
///
/// By parts of the step and Chandrupatla's method (1997): inverse quadratic interpolation where
/// that is safe, or else bisection; some eight parts.
template <class System, class Method, class States, class S, class Function>
[[nodiscard]] constexpr S locate(const System& system, const Method& method, const States& start,
                                 const S& t, const S& h, const Function& function, const S& before,
                                 const S& after) noexcept {
  constexpr int most = 200;
  const S size = select(scalar::abs(t) > scalar::abs(h), scalar::abs(t), scalar::abs(h));
  const S near = S(2) * scalar::Limits<S>::epsilon() * size;
  S a = h, fa = after;  // the latest point, and the other end of the bracket
  S b(0), fb = before;
  S fraction(0.5);
  for (int k = 0; k < most; ++k) {
    const S x = mul_add(fraction, b - a, a);
    const S fx = function(part_of_step(system, method, start, t, x), t + x);
    S c = a, fc = fa;  // the point that leaves the bracket
    if ((fx > S(0)) != (fa > S(0)) || fx == S(0)) {
      c = b;
      fc = fb;
      b = a;
      fb = fa;
    }
    a = x;
    fa = fx;
    const S width = scalar::abs(b - a);
    const bool latest = scalar::abs(fa) < scalar::abs(fb);
    if (fa == S(0) || width <= near) return latest ? a : b;
    const S least = near / width;
    if (!(least < S(0.5))) return latest ? a : b;
    const S xi = (a - b) / (c - b);
    const S phi = (fa - fb) / (fc - fb);
    fraction = S(0.5);
    if (phi * phi < xi && (S(1) - phi) * (S(1) - phi) < S(1) - xi) {
      fraction = fa / (fb - fa) * (fc / (fb - fc)) +
                 (c - a) / (b - a) * (fa / (fc - fa)) * (fb / (fc - fb));
    }
    fraction =
        select(fraction < least, least, select(fraction > S(1) - least, S(1) - least, fraction));
  }
  return a;
}

}  // namespace hamotor
