// The numbers in exp B for a general bivector B of an algebra with at most five dimensions.
#pragma once

#include <tuple>

#include "hamotor/scalar.hpp"

namespace hamotor::scalar {

/// exp B = number + quad W + bivector B + twisted <B W>₂, where B² = S + W.
template <class S>
struct BivectorExponential {
  S number;
  S quad;
  S bivector;
  S twisted;

  [[nodiscard]] constexpr auto numbers() noexcept {
    return std::tie(number, quad, bivector, twisted);
  }
};

namespace detail {

/// cosh √x: cos √−x for negative x.
template <class S>
[[nodiscard]] S cosh_root(const S& x) noexcept {
  return x < S(0) ? cos(sqrt(-x)) : cosh(sqrt(x));
}

/// sinh √x / √x: sin √−x / √−x for negative x, 1 at 0.
template <class S>
[[nodiscard]] S sinhc_root(const S& x) noexcept {
  const S root = sqrt(abs(x));
  if (!(root > S(0))) return S(1);
  return (x < S(0) ? sin(root) : sinh(root)) / root;
}

/// x + y W with W² = ω.
template <class S>
struct Ring {
  S x;
  S y;
};

template <class S>
[[nodiscard]] constexpr Ring<S> times(const Ring<S>& a, const Ring<S>& b, const S& omega) noexcept {
  return {mul_add(a.x, b.x, omega * (a.y * b.y)), mul_add(a.x, b.y, a.y * b.x)};
}

/// Terms of the two series that bring |S| + √|ω| ≤ 1 below half an ulp.
template <class S>
[[nodiscard]] constexpr int series_terms() noexcept {
  // the remainder after n terms is about 1/(2n + 2)!
  double rest = 8;
  for (int digit = 1; digit < Limits<S>::digits; ++digit) rest *= 2;
  int n = 1;
  for (;; ++n) {
    rest /= (2 * n + 1) * (2 * n + 2);
    if (rest < 1) return n;
  }
}

/// Horner's scheme for cosh √(S + W) and sinh √(S + W) / √(S + W) in the ring of x + y W.
template <class S>
[[nodiscard]] constexpr BivectorExponential<S> exponential_series(const S& s,
                                                                  const S& omega) noexcept {
  Ring<S> even{S(1), S(0)};
  Ring<S> odd{S(1), S(0)};
  const Ring<S> square{s, S(1)};
  for (int n = series_terms<S>(); n > 0; --n) {
    const S even_scale = S(1) / S(2 * n * (2 * n - 1));
    const S odd_scale = S(1) / S(2 * n * (2 * n + 1));
    const Ring<S> e = times(even, square, omega);
    const Ring<S> o = times(odd, square, omega);
    even = {mul_add(e.x, even_scale, S(1)), e.y * even_scale};
    odd = {mul_add(o.x, odd_scale, S(1)), o.y * odd_scale};
  }
  return {even.x, even.y, odd.x, odd.y};
}

/// By the eigenvalues high = S + w and low = S − w of B² as an element of the ring, w² = ω.
template <class S>
[[nodiscard]] BivectorExponential<S> isoclinic_exponential(const S& high, const S& low,
                                                           const S& w) noexcept {
  const S half(0.5);
  const S cosh_high = cosh_root(high);
  const S cosh_low = cosh_root(low);
  const S sinh_high = sinhc_root(high);
  const S sinh_low = sinhc_root(low);
  const S share = half / w;
  return {half * (cosh_high + cosh_low), share * (cosh_high - cosh_low),
          half * (sinh_high + sinh_low), share * (sinh_high - sinh_low)};
}

/// By the eigenvalues (S ± gap)/2 of B² on its planes, gap² = S² − ω.
template <class S>
[[nodiscard]] BivectorExponential<S> plane_exponential(const S& s, const S& omega,
                                                       const S& gap) noexcept {
  const S half(0.5);
  const S large = half * (s < S(0) ? s - gap : s + gap);
  const S small = S(0.25) * omega / large;
  const S c_large = cosh_root(large);
  const S c_small = cosh_root(small);
  const S h_large = sinhc_root(large);
  const S h_small = sinhc_root(small);
  const S inverse = S(1) / (large - small);
  return {c_large * c_small, half * (h_large * h_small),
          inverse * mul_add(large * h_large, c_small, -(small * h_small) * c_large),
          half * inverse * mul_add(c_large, h_small, -h_large * c_small)};
}

}  // namespace detail

/// The four numbers of exp B from S = <B²>₀ and ω = W² (theory.md §7).
///
/// B² has the eigenvalues λ₁, λ₂ = (S ± √(S² − ω))/2 on its two planes and, as an element of the
/// ring of x + y W, the eigenvalues S ± √ω.  Of the two ways to interpolate, the one with separated
/// nodes is taken: λ where ω is small or negative (one plane, null planes, a boost and a rotation),
/// S ± √ω where the planes are nearly or exactly isoclinic or where λ is complex.  Small B go by
/// the power series, in which neither matters.  Each form is free of cancellation.
template <class S>
  requires(!has_lanes<S>)
[[nodiscard]] BivectorExponential<S> bivector_exponential(const S& s, const S& omega) noexcept {
  const S root = sqrt(abs(omega));
  if (!(abs(s) + root > S(1))) return detail::exponential_series(s, omega);
  if (omega > S(0.25) * (s * s)) return detail::isoclinic_exponential(s + root, s - root, root);
  return detail::plane_exponential(s, omega, sqrt(mul_add(s, s, -omega)));
}

/// The same for algebras with a blade J of grade 4, J² = 1, from w in W = w J + … and, without
/// cancellation between S and W, what −B² is where J = 1 and where J = −1.
template <class S>
  requires(!has_lanes<S>)
[[nodiscard]] BivectorExponential<S> bivector_exponential(const S& w, const S& plus,
                                                          const S& minus) noexcept {
  const S s = S(-0.5) * (plus + minus);
  const S omega = w * w;
  if (!(abs(s) + abs(w) > S(1))) return detail::exponential_series(s, omega);
  if (omega > S(0.25) * (s * s)) return detail::isoclinic_exponential(-plus, -minus, w);
  return detail::plane_exponential(s, omega, sqrt(plus * minus));
}

/// The same with √ω and, where ω > S²/4, with S + √ω (for S > 0: S − √ω) without cancellation.
template <class S>
  requires(!has_lanes<S>)
[[nodiscard]] BivectorExponential<S> bivector_exponential(const S& s, const S& omega, const S& root,
                                                          const S& near) noexcept {
  if (omega > S(0.25) * (s * s) && abs(s) + root > S(1)) {
    if (s > S(0)) return detail::isoclinic_exponential(s + root, near, root);
    return detail::isoclinic_exponential(near, s - root, root);
  }
  return bivector_exponential(s, omega);
}

/// Any of these in each lane of packs, which fall into different cases.
template <class S, class... More>
  requires has_lanes<S>
[[nodiscard]] BivectorExponential<S> bivector_exponential(const S& x,
                                                          const More&... more) noexcept {
  return by_lane<BivectorExponential>(
      [](const auto&... number) { return bivector_exponential(number...); }, x, more...);
}

}  // namespace hamotor::scalar
