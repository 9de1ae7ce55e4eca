// Groups of rotors with nothing generated: every function is a product of dense multivectors, all
// 2ⁿ components, by table, or by the part of the table that the operands' types can need.  Slow by
// design: what generated kernels are measured against, and checked against in whole runs.
//
// A struct of tables says which group: `vectors` (n), `gram`, the layouts `Element`, `Rate` and
// `Momentum`, `algebra`, `name`, `generators`, and whether products are `sparse`.
#pragma once

#include <array>
#include <bit>
#include <bitset>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <tuple>
#include <vector>

#include "hamotor/generic.hpp"
#include "hamotor/scalar.hpp"

namespace hamotor::generic {

/// Coefficient of a blade in a component, or of a component's reading of it.
struct Entry {
  std::size_t component;
  std::size_t blade;
  double coefficient;
};

/// A value of a type with components: as a dense multivector, in which they are embedded.
template <class Tables, class Layout, class S>
struct Dense {
  using Scalar = S;
  static constexpr std::size_t size = Layout::names.size();
  static constexpr auto names = Layout::names;

  Multivector<Tables::vectors, S> values{};

  constexpr Dense() noexcept = default;
  /// From its components.
  template <class... X>
    requires(sizeof...(X) == size && (std::convertible_to<X, S> && ...))
  constexpr Dense(const X&... x) noexcept : Dense(from({static_cast<S>(x)...})) {}
  constexpr explicit Dense(const Multivector<Tables::vectors, S>& all) noexcept : values(all) {}

  [[nodiscard]] static constexpr Dense from(const std::array<S, size>& x) noexcept {
    Dense result;
    for (const Entry& e : Layout::embedding) {
      result.values[e.blade] += static_cast<S>(e.coefficient) * x[e.component];
    }
    return result;
  }

  [[nodiscard]] constexpr std::array<S, size> components() const noexcept {
    std::array<S, size> x{};
    for (const Entry& e : Layout::reading) {
      x[e.component] += static_cast<S>(e.coefficient) * values[e.blade];
    }
    return x;
  }

  [[nodiscard]] friend constexpr bool operator==(const Dense&, const Dense&) = default;
  [[nodiscard]] friend constexpr Dense operator+(const Dense& a, const Dense& b) noexcept {
    return mul_add(S(1), a, b);
  }
  [[nodiscard]] friend constexpr Dense operator-(const Dense& a, const Dense& b) noexcept {
    return mul_add(S(-1), b, a);
  }
  [[nodiscard]] friend constexpr Dense operator*(const S& a, const Dense& x) noexcept {
    return mul_add(a, x, Dense{});
  }
  [[nodiscard]] friend constexpr Dense mul_add(const S& a, const Dense& x,
                                               const Dense& y) noexcept {
    Dense result;
    for (std::size_t k = 0; k < x.values.size(); ++k) {
      result.values[k] = hamotor::mul_add(a, x.values[k], y.values[k]);
    }
    return result;
  }
};

template <class Tables, class S>
using ElementOf = Dense<Tables, typename Tables::Element, S>;
template <class Tables, class S>
using RateOf = Dense<Tables, typename Tables::Rate, S>;
template <class Tables, class S>
using MomentumOf = Dense<Tables, typename Tables::Momentum, S>;

/// M M~ − 1, all components.
template <class Tables, class S>
struct Defect {
  using Scalar = S;
  static constexpr std::array<std::string_view, 1> names{"s"};  ///< of the first component
  Multivector<Tables::vectors, S> values;
  [[nodiscard]] constexpr const auto& components() const noexcept { return values; }
  [[nodiscard]] static constexpr Defect from(const Multivector<Tables::vectors, S>& x) noexcept {
    return {x};
  }
  [[nodiscard]] friend constexpr Defect operator+(const Defect& a, const Defect& b) noexcept {
    Defect sum = a;
    for (std::size_t k = 0; k < sum.values.size(); ++k) sum.values[k] += b.values[k];
    return sum;
  }
};

/// The group that the tables describe.
template <class Tables>
struct Group {
  template <class S>
  using Element = ElementOf<Tables, S>;
  template <class S>
  using Rate = RateOf<Tables, S>;
  template <class S>
  using Momentum = MomentumOf<Tables, S>;
  static constexpr int dimension = static_cast<int>(Tables::generators.size());
  static constexpr std::string_view algebra = Tables::algebra;
  static constexpr std::string_view name = Tables::name;
  static constexpr auto generators = Tables::generators;
};

/// The components of a value as an aggregate whose members have names.
template <class Named, class Value>
[[nodiscard]] constexpr Named named(const Value& value) noexcept {
  return std::apply([](const auto&... x) { return Named{x...}; }, value.components());
}

namespace detail {

/// Which blades of a multivector may be other than 0, a bit each.
template <class Tables>
using Blades = std::bitset<std::size_t{1} << Tables::vectors>;

/// The blades of a type with components.
template <class Tables, class Layout>
struct Held {
  [[nodiscard]] static Blades<Tables> blades() {
    Blades<Tables> all;
    for (const Entry& e : Layout::embedding) all.set(e.blade);
    return all;
  }
};

/// The terms of a product of operands that hold certain blades, made when first asked for.
template <class Tables, class A, class B>
struct ProductOf {
  [[nodiscard]] static const std::vector<Term>& terms() {
    static const std::vector<Term> needed = [] {
      auto all = Algebra<Tables::vectors>(Tables::gram).terms(Product::geometric);
      if constexpr (Tables::sparse) {
        const auto a = A::blades();
        const auto b = B::blades();
        std::erase_if(all, [&](const Term& t) { return !a[t.a] || !b[t.b]; });
      }
      return all;
    }();
    return needed;
  }
  [[nodiscard]] static Blades<Tables> blades() {
    Blades<Tables> all;
    for (const Term& t : terms()) all.set(t.c);
    return all;
  }
};

template <class Tables, class S, class A, class B>
[[gnu::noinline]] Multivector<Tables::vectors, S> product(
    const Multivector<Tables::vectors, S>& a, const Multivector<Tables::vectors, S>& b) noexcept {
  return multiply<Tables::vectors, S>(ProductOf<Tables, A, B>::terms(), a, b);
}

template <class Multivector>
[[nodiscard]] Multivector reversed(Multivector x) noexcept {
  for (std::size_t blade = 0; blade < x.size(); ++blade) {
    if ((std::popcount(blade) & 2) != 0) x[blade] = -x[blade];
  }
  return x;
}

/// ab − ba.
template <class Tables, class S, class A, class B>
[[nodiscard]] Multivector<Tables::vectors, S> bracket(
    const Multivector<Tables::vectors, S>& a, const Multivector<Tables::vectors, S>& b) noexcept {
  auto result = product<Tables, S, A, B>(a, b);
  const auto back = product<Tables, S, B, A>(b, a);
  for (std::size_t k = 0; k < result.size(); ++k) result[k] -= back[k];
  return result;
}

/// M x M~ for an x of one of the group's types.
template <class Tables, class S, class Layout>
[[nodiscard]] Multivector<Tables::vectors, S> moved(
    const Multivector<Tables::vectors, S>& m, const Multivector<Tables::vectors, S>& x) noexcept {
  using M = Held<Tables, typename Tables::Element>;
  using Half = ProductOf<Tables, M, Held<Tables, Layout>>;
  return product<Tables, S, Half, M>(product<Tables, S, M, Held<Tables, Layout>>(m, x),
                                     reversed(m));
}

/// Only what the components hold: a momentum is a coset, and brackets cancel but for rounding.
template <class Value, class Multivector>
[[nodiscard]] Value held(const Multivector& values) noexcept {
  return Value::from(Value(values).components());
}

}  // namespace detail

template <class Tables, class S>
[[nodiscard]] ElementOf<Tables, S> gp(const ElementOf<Tables, S>& a,
                                      const ElementOf<Tables, S>& b) noexcept {
  using M = detail::Held<Tables, typename Tables::Element>;
  return ElementOf<Tables, S>(detail::product<Tables, S, M, M>(a.values, b.values));
}

template <class Tables, class S>
[[nodiscard]] ElementOf<Tables, S> reverse(const ElementOf<Tables, S>& m) noexcept {
  return ElementOf<Tables, S>(detail::reversed(m.values));
}

/// M B.
template <class Tables, class S>
[[nodiscard]] ElementOf<Tables, S> kinematics(const ElementOf<Tables, S>& m,
                                              const RateOf<Tables, S>& w) noexcept {
  using M = detail::Held<Tables, typename Tables::Element>;
  using W = detail::Held<Tables, typename Tables::Rate>;
  return ElementOf<Tables, S>(detail::product<Tables, S, M, W>(m.values, w.values));
}

/// [a, b] = ab − ba.
template <class Tables, class S>
[[nodiscard]] RateOf<Tables, S> ad(const RateOf<Tables, S>& a,
                                   const RateOf<Tables, S>& b) noexcept {
  using W = detail::Held<Tables, typename Tables::Rate>;
  return detail::held<RateOf<Tables, S>>(detail::bracket<Tables, S, W, W>(a.values, b.values));
}

/// ad*_w μ = [μ, w].
template <class Tables, class S>
[[nodiscard]] MomentumOf<Tables, S> coadjoint(const RateOf<Tables, S>& w,
                                              const MomentumOf<Tables, S>& mu) noexcept {
  using Mu = detail::Held<Tables, typename Tables::Momentum>;
  using W = detail::Held<Tables, typename Tables::Rate>;
  return detail::held<MomentumOf<Tables, S>>(
      detail::bracket<Tables, S, Mu, W>(mu.values, w.values));
}

/// M μ M~: a body momentum as a spatial one.
template <class Tables, class S>
[[nodiscard]] MomentumOf<Tables, S> Ad_star_inverse(const ElementOf<Tables, S>& m,
                                                    const MomentumOf<Tables, S>& mu) noexcept {
  return detail::held<MomentumOf<Tables, S>>(
      detail::moved<Tables, S, typename Tables::Momentum>(m.values, mu.values));
}

/// M~ μ M: a spatial momentum as a body one.
template <class Tables, class S>
[[nodiscard]] MomentumOf<Tables, S> Ad_star(const ElementOf<Tables, S>& m,
                                            const MomentumOf<Tables, S>& mu) noexcept {
  return Ad_star_inverse(reverse(m), mu);
}

/// M w M~: a body rate as a spatial one.
template <class Tables, class S>
[[nodiscard]] RateOf<Tables, S> Ad(const ElementOf<Tables, S>& m,
                                   const RateOf<Tables, S>& w) noexcept {
  return detail::held<RateOf<Tables, S>>(
      detail::moved<Tables, S, typename Tables::Rate>(m.values, w.values));
}

/// μ(w).
template <class Tables, class S>
[[nodiscard]] S pairing(const MomentumOf<Tables, S>& mu, const RateOf<Tables, S>& w) noexcept {
  const auto a = mu.components();
  const auto b = w.components();
  S sum(0);
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

/// exp w by its series, of w halved until it is small, and squaring.
template <class Tables, class S>
[[nodiscard]] ElementOf<Tables, S> exp(const RateOf<Tables, S>& w) noexcept {
  using M = detail::Held<Tables, typename Tables::Element>;
  using W = detail::Held<Tables, typename Tables::Rate>;
  S size(0);
  for (const S& x : w.values) size = scalar::max_abs(size, x);
  int halvings = 0;
  S factor(1);
  while (size * factor > S(0.25) && halvings < 64) {
    factor = S(0.5) * factor;
    ++halvings;
  }
  const auto small = (factor * w).values;
  Multivector<Tables::vectors, S> sum{};
  sum[0] = S(1);
  auto term = sum;
  for (int k = 1; k < 40; ++k) {
    term = detail::product<Tables, S, M, W>(term, small);
    bool changed = false;
    for (std::size_t blade = 0; blade < sum.size(); ++blade) {
      term[blade] /= static_cast<S>(k);
      const S before = sum[blade];
      sum[blade] += term[blade];
      changed = changed || sum[blade] != before;
    }
    if (!changed) break;
  }
  for (; halvings > 0; --halvings) sum = detail::product<Tables, S, M, M>(sum, sum);
  return ElementOf<Tables, S>(sum);
}

/// M M~ − 1.
template <class Tables, class S>
[[nodiscard]] Defect<Tables, S> unit_defect(const ElementOf<Tables, S>& m) noexcept {
  using M = detail::Held<Tables, typename Tables::Element>;
  Defect<Tables, S> defect{detail::product<Tables, S, M, M>(m.values, detail::reversed(m.values))};
  defect.values[0] -= S(1);
  return defect;
}

/// M low~ + low M~: by how much the defect of M + low differs, but for low².
template <class Tables, class S>
[[nodiscard]] Defect<Tables, S> unit_defect_change(const ElementOf<Tables, S>& m,
                                                   const ElementOf<Tables, S>& low) noexcept {
  using M = detail::Held<Tables, typename Tables::Element>;
  return Defect<Tables, S>{
             detail::product<Tables, S, M, M>(m.values, detail::reversed(low.values))} +
         Defect<Tables, S>{
             detail::product<Tables, S, M, M>(low.values, detail::reversed(m.values))};
}

/// −½ (M M~ − 1) M: what takes M back to the group.
template <class Tables, class S>
[[nodiscard]] ElementOf<Tables, S> unit_correction(const ElementOf<Tables, S>& m,
                                                   const Defect<Tables, S>& defect) noexcept {
  using M = detail::Held<Tables, typename Tables::Element>;
  using Square = detail::ProductOf<Tables, M, M>;
  return S(-0.5) *
         ElementOf<Tables, S>(detail::product<Tables, S, Square, M>(defect.values, m.values));
}

}  // namespace hamotor::generic
