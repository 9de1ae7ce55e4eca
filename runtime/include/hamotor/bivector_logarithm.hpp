// The numbers in log R for a general rotor R of an algebra with at most five dimensions.
#pragma once

#include <tuple>

#include "hamotor/scalar.hpp"

namespace hamotor::scalar {

/// log R = bivector <R>₂ + twisted <<R>₄ <R>₂>₂.
template <class S>
struct BivectorLogarithm {
  S bivector;
  S twisted;

  [[nodiscard]] constexpr auto numbers() noexcept { return std::tie(bivector, twisted); }
};

namespace detail {

/// θ / sin θ from sin² θ (negative: a boost, θ / sinh θ) and cos θ ≥ −1.
template <class S>
[[nodiscard]] S angle_over_sine(const S& sine_squared, const S& cosine) noexcept {
  const S sine = sqrt(abs(sine_squared));
  if (!(sine > S(0))) return S(1);
  if (sine_squared < S(0)) return asinh(sine) / sine;
  return atan2(sine, cosine) / sine;
}

/// θ² with the sign that θ's square has: positive for a rotation.
template <class S>
[[nodiscard]] S squared_angle(const S& sine_squared, const S& cosine) noexcept {
  const S sine = sqrt(abs(sine_squared));
  const S angle = sine_squared < S(0) ? S(asinh(sine)) : S(atan2(sine, cosine));
  return sine_squared < S(0) ? -(angle * angle) : angle * angle;
}

/// θ cot θ of θ² (negative: θ coth θ).
template <class S>
[[nodiscard]] S angle_cotangent(const S& square) noexcept {
  const S angle = sqrt(abs(square));
  if (!(angle > S(0))) return S(1);
  return angle / (square < S(0) ? S(tanh(angle)) : S(tan(angle)));
}

/// sin² θ of θ² (negative: −sinh² θ).
template <class S>
[[nodiscard]] S squared_sine(const S& square) noexcept {
  const S angle = sqrt(abs(square));
  const S sine = square < S(0) ? S(sinh(angle)) : S(sin(angle));
  return square < S(0) ? -(sine * sine) : sine * sine;
}

/// (θ / sin θ)(c) = Σ a_n (1 − c)^n for c = x + y Q near 1, as a ring element over Q² = rho:
/// a_n = a_{n−1} n / (2n + 1), the expansion of arccos(c) / √(1 − c²).
template <class S>
[[nodiscard]] constexpr BivectorLogarithm<S> logarithm_series(const S& x, const S& y,
                                                              const S& rho) noexcept {
  // u = 1 − c = x + y Q
  constexpr int terms = Limits<S>::digits / 3 + 4;
  S even(1);
  S odd(0);
  for (int n = terms; n > 0; --n) {
    const S ratio = S(n) / S(2 * n + 1);
    const S next_even = mul_add(even, x, odd * y * rho);
    const S next_odd = mul_add(even, y, odd * x);
    even = mul_add(ratio, next_even, S(1));
    odd = ratio * next_odd;
  }
  return {even, odd};
}

/// Of C with the eigenvalues c ± q and `plus`, `minus` = 1 − (c ± q)².
template <class S>
[[nodiscard]] BivectorLogarithm<S> interpolated_logarithm(const S& c, const S& q, const S& square,
                                                          const S& plus, const S& minus) noexcept {
  const S half(0.5);
  const S f_plus = angle_over_sine(plus, c + q);
  const S f_minus = angle_over_sine(minus, c - q);
  const bool boost = plus + minus < S(0);
  // separated in the eigenvalues of C, as a rotation's and a boost's always are; of two boosts C
  // grows as c does, and `square` as c²
  const S size = boost ? S(square / max_abs(c, S(1))) : square;
  if (abs(q) > S(0.25) * abs(size) || (plus < S(0)) != (minus < S(0))) {
    return {half * (f_plus + f_minus), half * (f_plus - f_minus) / q};
  }
  // one plane dominates: a and b are separated, a + b and a − b are near each other
  const S sum = boost ? S(asinh(sqrt(abs(plus)))) : S(atan2(sqrt(abs(plus)), c + q));
  const S difference = boost ? S(asinh(sqrt(abs(minus)))) : S(atan2(sqrt(abs(minus)), c - q));
  const S a = half * (sum + difference);
  const S b = half * (difference - sum);
  const S sign = boost ? S(-1) : S(1);
  const S cot_a = angle_cotangent(sign * a * a);
  const S cot_b = angle_cotangent(sign * b * b);
  const S gap = squared_sine(sign * a * a) - squared_sine(sign * b * b);
  return {half * (f_plus + f_minus), (cot_a - cot_b) / gap};
}

}  // namespace detail

/// The two numbers of log R from c = <R>₀, S = <<R>₂²>₀ and ρ = <R>₄² (a number).
///
/// With R = cosh √Q + …, Q = (log R)², everything is a function of the ring element C = c + <R>₄,
/// in which <R>₂² = C² − 1 and log R = <R>₂ f(C), f(cos θ) = θ / sin θ.  C has the eigenvalues c ±
/// √ρ = cos(a ± b) for rotations by a and b.  f is interpolated between these where they are
/// separated, between a and b (one of them imaginary for a boost) where those are, and by its power
/// series near R = 1, where neither is.  Principal: rotations with a + b ≤ π; a sheet is not
/// changed.  Where nothing turns and c < 0, R is −exp of boosts or null rotations, or −1: no
/// function of <R>₂ alone is a logarithm of it, and this is that of −R, which is the same
/// transformation.
///
/// Where `isoclinic` > 0, `near` is the one of S ± 2 c √ρ that may nearly vanish, of the sign that
/// S has not, without cancellation.
template <class S>
  requires(!has_lanes<S>)
[[nodiscard]] BivectorLogarithm<S> bivector_logarithm(const S& c, const S& square, const S& rho,
                                                      const S& isoclinic, const S& near) noexcept {
  if (c < S(0) && !(rho < S(0)) && !(square < S(0))) {
    const auto f = bivector_logarithm(S(-c), square, rho, isoclinic, near);
    return {-f.bivector, f.twisted};
  }
  const S root = sqrt(abs(rho));
  if (c > S(0) && abs(square) + S(2) * root < S(0.25)) {
    // 1 − c without cancellation: c² = 1 + S − ρ
    const S less = (rho - square) / (S(1) + c);
    return detail::logarithm_series(less, S(-1), rho);
  }
  if (!(rho < S(0))) {
    const S twice = S(2) * c * root;
    S plus = square + twice;
    S minus = square - twice;
    if (isoclinic > S(0)) ((square > S(0)) != (c > S(0)) ? plus : minus) = near;
    return detail::interpolated_logarithm(c, root, square, -plus, -minus);
  }
  // a boost by a and a rotation by b: c = cosh a cos b, √−ρ = sinh a sin b
  const S spread = sqrt(mul_add(square, square, S(-4) * c * c * rho));
  // λ = (sinh a cos b)² and (cosh a sin b)², whose difference is `square`
  const S larger = S(0.5) * (abs(square) + spread);
  const S smaller = larger > S(0) ? -(c * c * rho) / larger : S(0);
  const S boost_part = square < S(0) ? smaller : larger;
  const S turn_part = square < S(0) ? larger : smaller;
  // Everything from these: of b itself near π the sine would have lost its digits.
  const S sinh_a = sqrt(boost_part - rho);
  const S cosh_a = sqrt(S(1) + sinh_a * sinh_a);
  const S turning = sqrt(turn_part);
  const S boosting = c < S(0) ? S(-sqrt(boost_part)) : S(sqrt(boost_part));
  const S a = asinh(sinh_a);
  const S b = atan2(turning, c);
  const S cot_a = sinh_a > S(0) ? a * cosh_a / sinh_a : S(1);
  const S cot_b = turning > S(0) ? b * c / turning : S(1);
  // (f₊ + f₋)/2 with a → i a; sinh² a + sin² b is the sum of both λ
  const S mean = mul_add(a, boosting, b * turning) / spread;
  return {mean, (cot_b - cot_a) / spread};
}

/// The same where √ρ is 0 or no number: S ± 2 c √ρ cannot cancel.
template <class S>
  requires(!has_lanes<S>)
[[nodiscard]] BivectorLogarithm<S> bivector_logarithm(const S& c, const S& square,
                                                      const S& rho) noexcept {
  return bivector_logarithm(c, square, rho, S(0), S(0));
}

/// log R = bivector <R>₂ + twisted <<R>₄ <R>₂>₂ + turn × the unit of y, y = part <R>₂ +
/// part_twisted <<R>₄ <R>₂>₂ the plane that turns by nearly π; all three 0 where none does.
template <class S>
struct TurnedLogarithm {
  S bivector;
  S twisted;
  S turn;
  S part;
  S part_twisted;

  [[nodiscard]] constexpr auto numbers() noexcept {
    return std::tie(bivector, twisted, turn, part, part_twisted);
  }
};

/// The numbers of log R also where one plane turns by a half angle b near π beside a boost, a null
/// rotation or a smaller rotation.
///
/// There <R>₂ holds sin b of that plane and all of the other, so that b / sin b would multiply the
/// rounding of the other.  So log R = log(−R) + π × the unit of that plane, of which no number is
/// large.
template <class S>
  requires(!has_lanes<S>)
[[nodiscard]] TurnedLogarithm<S> turned_logarithm(const S& c, const S& square, const S& rho,
                                                  const S& isoclinic, const S& near) noexcept {
  // <R>₂² is `turning` where R turns and `other` in the other plane; their product is c² ρ
  const S product = c * c * rho;
  const S spread = sqrt(abs(mul_add(square, square, S(-4) * product)));
  const S larger = S(0.5) * (square < S(0) ? square - spread : square + spread);
  const S smaller = abs(larger) > S(0) ? S(product / larger) : S(0);
  const S turning = square < S(0) ? larger : smaller;
  const S other = square < S(0) ? smaller : larger;
  const bool apart = S(4) * other > turning;
  if (!(c < S(0) && turning < S(0) && -turning < c * c && apart)) {
    const auto f = bivector_logarithm(c, square, rho, isoclinic, near);
    return {f.bivector, f.twisted, S(0), S(0), S(0)};
  }
  const auto f = bivector_logarithm(S(-c), square, rho, isoclinic, near);
  const S unit = S(1) / ((turning - other) * sqrt(-turning));
  return {-f.bivector, f.twisted, pi<S>(), turning * unit, -c * unit};
}

/// The same where √ρ is 0 or no number.
template <class S>
  requires(!has_lanes<S>)
[[nodiscard]] TurnedLogarithm<S> turned_logarithm(const S& c, const S& square,
                                                  const S& rho) noexcept {
  return turned_logarithm(c, square, rho, S(0), S(0));
}

/// The numbers of log R for algebras with a blade J of grade 4, J² = 1, R = c + q J + ….
///
/// Where J = ±1, R turns by the half angle θ = a ± b about a direction of its own.  `plus` and
/// `minus` are ½ θ / sin θ, the factors of <R>₂ there; `unit_plus` and `unit_minus` are ½ / sin θ.
/// Where R is −1 the direction is any: the `seed` is 1, otherwise 0.  `along` is b cot b and
/// `across` is a cot a − b cot b.
template <class S>
struct PlanesLogarithm {
  S plus;
  S minus;
  S unit_plus;
  S unit_minus;
  S seed_plus;
  S seed_minus;
  S along;
  S across;

  [[nodiscard]] constexpr auto numbers() noexcept {
    return std::tie(plus, minus, unit_plus, unit_minus, seed_plus, seed_minus, along, across);
  }
};

/// From c, q and what −<R>₂² is where J = 1 and where J = −1, without cancellation between them.
template <class S>
  requires(!has_lanes<S>)
[[nodiscard]] PlanesLogarithm<S> planes_logarithm(const S& c, const S& q, const S& plus,
                                                  const S& minus) noexcept {
  struct Turn {
    S angle, ratio, unit, seed;
  };
  const auto turn = [](const S& sine_squared, const S& cosine) -> Turn {
    const S half(0.5);
    const S sine = sqrt(sine_squared);
    if (sine > S(0)) {
      const S angle = atan2(sine, cosine);
      return {angle, half * (angle / sine), half / sine, S(0)};
    }
    if (cosine < S(0)) return {pi<S>(), half * pi<S>(), half, S(1)};
    return {S(0), half, S(0), S(0)};
  };
  const auto cotangent = [](const S& angle) -> S {
    return abs(angle) > S(0) ? S(angle / tan(angle)) : S(1);
  };
  const Turn p = turn(plus, c + q);
  const Turn m = turn(minus, c - q);
  const S along = cotangent(S(0.5) * (p.angle - m.angle));
  const S across = cotangent(S(0.5) * (p.angle + m.angle)) - along;
  return {p.ratio, m.ratio, p.unit, m.unit, p.seed, m.seed, along, across};
}

/// Any of these in each lane of packs, which fall into different cases.
template <class S, class... More>
  requires has_lanes<S>
[[nodiscard]] BivectorLogarithm<S> bivector_logarithm(const S& x, const More&... more) noexcept {
  return by_lane<BivectorLogarithm>(
      [](const auto&... number) { return bivector_logarithm(number...); }, x, more...);
}

template <class S, class... More>
  requires has_lanes<S>
[[nodiscard]] TurnedLogarithm<S> turned_logarithm(const S& x, const More&... more) noexcept {
  return by_lane<TurnedLogarithm>([](const auto&... number) { return turned_logarithm(number...); },
                                  x, more...);
}

template <class S, class... More>
  requires has_lanes<S>
[[nodiscard]] PlanesLogarithm<S> planes_logarithm(const S& x, const More&... more) noexcept {
  return by_lane<PlanesLogarithm>([](const auto&... number) { return planes_logarithm(number...); },
                                  x, more...);
}

}  // namespace hamotor::scalar
