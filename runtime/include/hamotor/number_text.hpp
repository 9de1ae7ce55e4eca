// Numbers of any scalar as decimals with all their digits, to and from.
#pragma once

#include <array>
#include <concepts>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "hamotor/scalar.hpp"

namespace hamotor {

/// Significant digits after which a text reads back as the same number: 1 + ⌈log₁₀ 2^digits⌉.
template <class S>
inline constexpr int text_digits = 2 + scalar::Limits<S>::digits * 30103 / 100000;

/// The number nearest to the decimal `text`.
template <class S>
[[nodiscard]] S number_from(const std::string& text) {
  if constexpr (requires { S::from_text(text); }) {
    return S::from_text(text);
#ifdef HAMOTOR_HAS_QUADMATH
  } else if constexpr (std::same_as<S, scalar::Float128>) {
    return strtoflt128(text.c_str(), nullptr);
#endif
  } else {
    return static_cast<S>(std::strtold(text.c_str(), nullptr));
  }
}

/// `x` with `text_digits`.
template <class S>
[[nodiscard]] std::string text_of(const S& x) {
  if constexpr (requires { x.text(); }) {
    return x.text();
  } else {
    std::array<char, 64> buffer{};
#ifdef HAMOTOR_HAS_QUADMATH
    if constexpr (std::same_as<S, scalar::Float128>) {
      quadmath_snprintf(buffer.data(), buffer.size(), "%.*Qg", text_digits<S>, x);
      return buffer.data();
    }
#endif
    std::snprintf(buffer.data(), buffer.size(), "%.*Lg", text_digits<S>,
                  static_cast<long double>(x));
    return buffer.data();
  }
}

}  // namespace hamotor
