// What the tables of both algebras share.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "hamotor/generic.hpp"

namespace bench {

struct Blade {
  unsigned blade;
  int sign;  ///< of the stored component: e31 is −e13
};

/// A product of two lists of blades onto a third: the terms between them.
template <class S>
class TermList {
 public:
  template <std::size_t A, std::size_t B, std::size_t C>
  TermList(const std::vector<hamotor::generic::Term>& terms, const std::array<Blade, A>& a,
           const std::array<Blade, B>& b, const std::array<Blade, C>& c, double factor) {
    for (const hamotor::generic::Term& t : terms) {
      for (std::size_t i = 0; i < A; ++i) {
        for (std::size_t j = 0; j < B; ++j) {
          for (std::size_t k = 0; k < C; ++k) {
            if (t.a == a[i].blade && t.b == b[j].blade && t.c == c[k].blade) {
              terms_.push_back({static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(j),
                                static_cast<std::uint16_t>(k),
                                S(factor * t.coefficient * a[i].sign * b[j].sign * c[k].sign)});
            }
          }
        }
      }
    }
  }
  template <std::size_t C, std::size_t A, std::size_t B>
  [[nodiscard]] std::array<S, C> multiply(const std::array<S, A>& a,
                                          const std::array<S, B>& b) const {
    std::array<S, C> c{};
    for (const Entry& t : terms_) c[t.c] += t.coefficient * a[t.a] * b[t.b];
    return c;
  }

 private:
  struct Entry {
    std::uint16_t a;
    std::uint16_t b;
    std::uint16_t c;
    S coefficient;
  };
  std::vector<Entry> terms_;
};

}  // namespace bench
