// cga3 by table: all 32 components with every term of the algebra, and only the components and
// terms that the operands have.
#include "conformal.hpp"
#include "table.hpp"

namespace bench {

namespace {

using hamotor::generic::Product;

/// Blades of an element's components, read off their names: bit 0 is e0, bit 4 is ei.
template <class Element>
[[nodiscard]] constexpr auto blades_of() {
  std::array<Blade, Element::size> all{};
  for (std::size_t i = 0; i < Element::size; ++i) {
    if (Element::names[i] == "s") {
      all[i] = {0, 1};
      continue;
    }
    unsigned blade = 0;
    int sign = 1;
    for (const char digit : Element::names[i].substr(1)) {
      const unsigned bit = digit == 'i' ? 4U : static_cast<unsigned>(digit - '0');
      if (std::popcount(blade >> (bit + 1)) % 2 == 1) sign = -sign;
      blade |= 1U << bit;
    }
    all[i] = {blade, sign};
  }
  return all;
}

template <class Kind>
inline constexpr auto blades = blades_of<typename Kind::Exact>();

[[nodiscard]] const hamotor::generic::Algebra<5>& algebra() {
  static const hamotor::generic::Algebra<5> cga3_algebra(
      {{{0, 0, 0, 0, -1}, {0, 1, 0, 0, 0}, {0, 0, 1, 0, 0}, {0, 0, 0, 1, 0}, {-1, 0, 0, 0, 0}}});
  return cga3_algebra;
}

}  // namespace

template <class S>
struct ConformalTable {
  static constexpr const char* name = "dense table";
  using Multivector = hamotor::generic::Multivector<5, S>;

  template <class Kind>
  [[nodiscard]] static auto make(Kind, const typename Kind::Exact& x)
      -> std::enable_if_t<(Kind::Exact::size > 0), Multivector> {
    Multivector all{};
    const auto coordinates = x.components();
    for (std::size_t i = 0; i < coordinates.size(); ++i) {
      all[blades<Kind>[i].blade] = static_cast<S>(Quad(blades<Kind>[i].sign) * coordinates[i]);
    }
    return all;
  }
  template <class Kind>
  [[nodiscard]] static auto exact(Kind, const Multivector& x) {
    std::array<Quad, Kind::Exact::size> coordinates;
    for (std::size_t i = 0; i < coordinates.size(); ++i) {
      coordinates[i] = Quad(x[blades<Kind>[i].blade]) * Quad(blades<Kind>[i].sign);
    }
    return Kind::Exact::from(coordinates);
  }

  static inline const auto geometric = algebra().terms(Product::geometric);

  [[nodiscard]] HAMOTOR_INLINE static Multivector reversed(Multivector x) {
    for (unsigned blade = 0; blade < 32; ++blade) {
      if ((std::popcount(blade) & 2) != 0) x[blade] = -x[blade];
    }
    return x;
  }
  [[nodiscard]] HAMOTOR_INLINE static Multivector multiply(const Multivector& a,
                                                           const Multivector& b) {
    return hamotor::generic::multiply<5, S>(geometric, a, b);
  }
  [[nodiscard]] HAMOTOR_INLINE static Multivector compose(const Multivector& a,
                                                          const Multivector& b) {
    return multiply(a, b);
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static Multivector move(Kind, const Multivector& m,
                                                       const Multivector& x) {
    return multiply(multiply(m, x), reversed(m));
  }
  [[nodiscard]] HAMOTOR_INLINE static Multivector bivector_trivector(const Multivector& a,
                                                                     const Multivector& b) {
    return multiply(a, b);
  }
};

template <class S>
struct ConformalSparse {
  static constexpr const char* name = "sparse terms";
  template <class Kind>
  using Held = std::array<S, Kind::Exact::size>;

  template <class Kind>
  [[nodiscard]] static auto make(Kind, const typename Kind::Exact& x) -> Held<Kind> {
    const auto from = x.components();
    Held<Kind> all;
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<S>(from[i]);
    return all;
  }
  template <class Kind>
  [[nodiscard]] static auto exact(Kind, const Held<Kind>& x) {
    std::array<Quad, Kind::Exact::size> all;
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = Quad(x[i]);
    return Kind::Exact::from(all);
  }

  using Even = kind::conformal::Even;
  using Odd = kind::conformal::Odd;
  /// The blades of the product of a versor with a thing of some kind.
  template <class Kind>
  using Between = std::conditional_t<std::is_same_v<Kind, kind::conformal::Vector>, Odd, Even>;
  template <class A, class B, class C>
  static inline const TermList<S> product{algebra().terms(Product::geometric), blades<A>, blades<B>,
                                          blades<C>, 1.0};

  [[nodiscard]] HAMOTOR_INLINE static Held<Even> reversed(Held<Even> m) {
    for (std::size_t i = 0; i < m.size(); ++i) {
      if ((std::popcount(blades<Even>[i].blade) & 2) != 0) m[i] = -m[i];
    }
    return m;
  }
  [[nodiscard]] HAMOTOR_INLINE static Held<Even> multiply(const Held<Even>& a,
                                                          const Held<Even>& b) {
    return product<Even, Even, Even>.template multiply<16>(a, b);
  }
  [[nodiscard]] HAMOTOR_INLINE static Held<Even> compose(const Held<Even>& a, const Held<Even>& b) {
    return multiply(a, b);
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static Held<Kind> move(Kind, const Held<Even>& m,
                                                      const Held<Kind>& x) {
    const auto half = product<Even, Kind, Between<Kind>>.template multiply<16>(m, x);
    return product<Between<Kind>, Even, Kind>.template multiply<Kind::Exact::size>(half,
                                                                                   reversed(m));
  }
  [[nodiscard]] HAMOTOR_INLINE static Held<Odd> bivector_trivector(
      const Held<kind::conformal::Bivector>& a, const Held<kind::conformal::Trivector>& b) {
    return product<kind::conformal::Bivector, kind::conformal::Trivector, Odd>.template multiply<16>(
        a, b);
  }
};

void enter_conformal_tables() {
  enter_conformal<ConformalTable>();
  enter_conformal<ConformalSparse>();
}

}  // namespace bench
