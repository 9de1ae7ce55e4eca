// Products by table: all 16 components with every term of the algebra, and only the components and
// terms that the operands have.
#include <utility>

#include "contest.hpp"
#include "table.hpp"

namespace bench {

namespace {

using hamotor::generic::Product;
using hamotor::generic::Term;

// Bit k of a blade is e_k.
inline constexpr std::array<Blade, 8> even{
    {{0, 1}, {12, 1}, {10, -1}, {6, 1}, {3, 1}, {5, 1}, {9, 1}, {15, 1}}};
inline constexpr std::array<Blade, 6> bivector{{{12, 1}, {10, -1}, {6, 1}, {3, 1}, {5, 1}, {9, 1}}};
inline constexpr std::array<Blade, 4> vector{{{1, 1}, {2, 1}, {4, 1}, {8, 1}}};
inline constexpr std::array<Blade, 3> direction{{{13, -1}, {11, 1}, {7, -1}}};
inline constexpr std::array<Blade, 4> trivector{{{13, -1}, {11, 1}, {7, -1}, {14, 1}}};
inline constexpr std::array<Blade, 8> odd{
    {{1, 1}, {2, 1}, {4, 1}, {8, 1}, {14, 1}, {13, -1}, {11, 1}, {7, -1}}};

/// How a kind's coordinates are the algebra's components: blades and a factor.
[[nodiscard]] constexpr const auto& blades_of(kind::Motion) { return even; }
[[nodiscard]] constexpr const auto& blades_of(kind::Point) { return trivector; }
[[nodiscard]] constexpr const auto& blades_of(kind::Direction) { return direction; }
[[nodiscard]] constexpr const auto& blades_of(kind::Plane) { return vector; }
[[nodiscard]] constexpr const auto& blades_of(kind::Line) { return bivector; }
[[nodiscard]] constexpr const auto& blades_of(kind::Bivector) { return bivector; }
[[nodiscard]] constexpr const auto& blades_of(kind::Rate) { return bivector; }
/// Blades of the product of an even multivector with one of that kind.
[[nodiscard]] constexpr const auto& between(kind::Line) { return even; }
template <class Kind>
[[nodiscard]] constexpr const auto& between(Kind) {
  return odd;
}
inline constexpr std::array<Blade, 6> dual_bivector{
    {{3, 1}, {5, 1}, {9, 1}, {12, 1}, {10, -1}, {6, 1}}};
[[nodiscard]] constexpr const auto& blades_of(kind::Momentum) { return dual_bivector; }

[[nodiscard]] constexpr double factor_of(kind::Rate) { return -0.5; }
[[nodiscard]] constexpr double factor_of(kind::Momentum) { return -2.0; }
template <class Kind>
[[nodiscard]] constexpr double factor_of(Kind) {
  return 1.0;
}

template <class Kind>
[[nodiscard]] auto numbers(Kind, const typename Kind::Exact& x) {
  return x.components();
}
[[nodiscard]] std::array<Quad, 4> numbers(kind::Point, const pga3::Point<Quad>& x) {
  return {x.e032, x.e013, x.e021, Quad(1)};
}
template <class Kind, std::size_t N>
[[nodiscard]] auto element(Kind, const std::array<Quad, N>& x) {
  return Kind::Exact::from(x);
}
[[nodiscard]] auto element(kind::Point, const std::array<Quad, 4>& x) {
  return pga3::Point<Quad>{x[0] / x[3], x[1] / x[3], x[2] / x[3]};
}

[[nodiscard]] const hamotor::generic::Algebra<4>& algebra() {
  static const hamotor::generic::Algebra<4> pga3_algebra(
      {{{0, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}});
  return pga3_algebra;
}

/// Σ μ_a T^a from the components of μ to those of B = ∂T/∂μ.
template <class S>
[[nodiscard]] std::array<S, 6> rate_factors() {
  std::array<S, 6> all{};
  for (std::size_t k = 0; k < 3; ++k) {
    all[k] = S(0.25 / moments[k]);
    all[3 + k] = S(0.25 / mass);
  }
  return all;
}

}  // namespace

template <class S>
struct Table {
  static constexpr const char* name = "dense table";
  using Multivector = hamotor::generic::Multivector<4, S>;
  struct DenseBody {
    Multivector motion;
    Multivector momentum;
  };

  template <class Kind>
  [[nodiscard]] static Multivector make(Kind kind, const typename Kind::Exact& x) {
    Multivector all{};
    const auto coordinates = numbers(kind, x);
    const auto& blades = blades_of(kind);
    for (std::size_t i = 0; i < blades.size(); ++i) {
      all[blades[i].blade] =
          static_cast<S>(Quad(blades[i].sign * factor_of(kind)) * coordinates[i]);
    }
    return all;
  }
  [[nodiscard]] static DenseBody make(kind::Body, const Body<Quad>& x) {
    return {make(kind::Motion{}, x.motion), make(kind::Momentum{}, x.momentum)};
  }
  template <class Kind>
  [[nodiscard]] static auto exact(Kind kind, const Multivector& x) {
    const auto& blades = blades_of(kind);
    std::array<Quad, std::tuple_size_v<std::remove_cvref_t<decltype(blades)>>> coordinates;
    for (std::size_t i = 0; i < blades.size(); ++i) {
      coordinates[i] = Quad(x[blades[i].blade]) / Quad(blades[i].sign * factor_of(kind));
    }
    return element(kind, coordinates);
  }
  [[nodiscard]] static Body<Quad> exact(kind::Body, const DenseBody& x) {
    return {exact(kind::Motion{}, x.motion), exact(kind::Momentum{}, x.momentum)};
  }

  static inline const std::vector<Term> geometric = algebra().terms(Product::geometric);
  static inline const std::vector<Term> bracket = algebra().terms(Product::commutator);
  static inline const std::array<S, 6> factors = rate_factors<S>();

  [[nodiscard]] HAMOTOR_INLINE static Multivector reversed(Multivector x) {
    for (unsigned blade = 0; blade < 16; ++blade) {
      if ((std::popcount(blade) & 2) != 0) x[blade] = -x[blade];
    }
    return x;
  }
  [[nodiscard]] HAMOTOR_INLINE static Multivector gp(const Multivector& a, const Multivector& b) {
    return hamotor::generic::multiply<4, S>(geometric, a, b);
  }

  [[nodiscard]] HAMOTOR_INLINE static Multivector compose(const Multivector& a,
                                                          const Multivector& b) {
    return gp(a, b);
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static Multivector move(Kind, const Multivector& m,
                                                       const Multivector& x) {
    return gp(gp(m, x), reversed(m));
  }
  [[nodiscard]] HAMOTOR_INLINE static Multivector commutator(const Multivector& a,
                                                             const Multivector& b) {
    return hamotor::generic::multiply<4, S>(bracket, a, b);
  }
  [[nodiscard]] HAMOTOR_INLINE static Multivector coadjoint(const Multivector& w,
                                                            const Multivector& mu) {
    Multivector twice = hamotor::generic::multiply<4, S>(bracket, mu, w);
    for (S& x : twice) x = x + x;
    return twice;
  }
  [[nodiscard]] HAMOTOR_INLINE static DenseBody slope(const DenseBody& x) {
    Multivector w{};
    for (std::size_t i = 0; i < 6; ++i) {
      const Blade& dual = dual_bivector[i];
      w[bivector[i].blade] = S(bivector[i].sign * dual.sign) * factors[i] * x.momentum[dual.blade];
    }
    return {gp(x.motion, w), coadjoint(w, x.momentum)};
  }
  [[nodiscard]] HAMOTOR_INLINE static DenseBody add(DenseBody x, const S& h, const DenseBody& k) {
    for (std::size_t i = 0; i < 16; ++i) {
      x.motion[i] += h * k.motion[i];
      x.momentum[i] += h * k.momentum[i];
    }
    return x;
  }
  [[nodiscard]] HAMOTOR_INLINE static DenseBody runge_kutta(const DenseBody& body) {
    return classical_runge_kutta<Table, S>(body);
  }
};

template <class S>
struct Sparse {
  static constexpr const char* name = "sparse terms";
  using Motion = std::array<S, 8>;
  using Six = std::array<S, 6>;
  struct SparseBody {
    Motion motion;
    Six momentum;
  };

  template <class Kind>
  [[nodiscard]] static auto make(Kind kind, const typename Kind::Exact& x) {
    const auto exact_numbers = numbers(kind, x);
    std::array<S, std::tuple_size_v<std::remove_cv_t<decltype(exact_numbers)>>> all;
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i] = static_cast<S>(Quad(factor_of(kind)) * exact_numbers[i]);
    }
    return all;
  }
  [[nodiscard]] static SparseBody make(kind::Body, const Body<Quad>& x) {
    return {make(kind::Motion{}, x.motion), make(kind::Momentum{}, x.momentum)};
  }
  template <class Kind, std::size_t N>
  [[nodiscard]] static auto exact(Kind kind, const std::array<S, N>& x) {
    std::array<Quad, N> all;
    for (std::size_t i = 0; i < N; ++i) all[i] = Quad(x[i]) / Quad(factor_of(kind));
    return element(kind, all);
  }
  [[nodiscard]] static Body<Quad> exact(kind::Body, const SparseBody& x) {
    return {exact(kind::Motion{}, x.motion), exact(kind::Momentum{}, x.momentum)};
  }

  static inline const TermList<S> motor_product{algebra().terms(Product::geometric), even, even,
                                                even, 1.0};
  static inline const TermList<S> kinematics{algebra().terms(Product::geometric), even, bivector,
                                             even, 1.0};
  static inline const TermList<S> bivector_bracket{algebra().terms(Product::commutator), bivector,
                                                   bivector, bivector, 1.0};
  static inline const TermList<S> momentum_bracket{algebra().terms(Product::commutator),
                                                   dual_bivector, bivector, dual_bivector, 2.0};
  static inline const std::array<S, 6> factors = rate_factors<S>();
  /// m x, and that times ~m.
  template <class Kind>
  static inline const TermList<S> left{algebra().terms(Product::geometric), even, blades_of(Kind{}),
                                       between(Kind{}), 1.0};
  template <class Kind>
  static inline const TermList<S> right{algebra().terms(Product::geometric), between(Kind{}), even,
                                        blades_of(Kind{}), 1.0};

  [[nodiscard]] HAMOTOR_INLINE static Motion reversed(const Motion& m) {
    return {m[0], -m[1], -m[2], -m[3], -m[4], -m[5], -m[6], m[7]};
  }
  [[nodiscard]] HAMOTOR_INLINE static Motion compose(const Motion& a, const Motion& b) {
    return motor_product.template multiply<8>(a, b);
  }
  template <class Kind, std::size_t N>
  [[nodiscard]] HAMOTOR_INLINE static std::array<S, N> move(Kind, const Motion& m,
                                                            const std::array<S, N>& x) {
    return right<Kind>.template multiply<N>(left<Kind>.template multiply<8>(m, x), reversed(m));
  }
  [[nodiscard]] HAMOTOR_INLINE static Six commutator(const Six& a, const Six& b) {
    return bivector_bracket.template multiply<6>(a, b);
  }
  [[nodiscard]] HAMOTOR_INLINE static Six coadjoint(const Six& w, const Six& mu) {
    return momentum_bracket.template multiply<6>(mu, w);
  }
  [[nodiscard]] HAMOTOR_INLINE static SparseBody slope(const SparseBody& x) {
    Six w;
    for (std::size_t i = 0; i < 6; ++i) w[i] = factors[i] * x.momentum[i];
    return {kinematics.template multiply<8>(x.motion, w), coadjoint(w, x.momentum)};
  }
  [[nodiscard]] HAMOTOR_INLINE static SparseBody add(SparseBody x, const S& h,
                                                     const SparseBody& k) {
    for (std::size_t i = 0; i < 8; ++i) x.motion[i] += h * k.motion[i];
    for (std::size_t i = 0; i < 6; ++i) x.momentum[i] += h * k.momentum[i];
    return x;
  }
  [[nodiscard]] HAMOTOR_INLINE static SparseBody runge_kutta(const SparseBody& body) {
    return classical_runge_kutta<Sparse, S>(body);
  }
};

void enter_tables() {
  enter<Table>();
  enter<Sparse>();
}

}  // namespace bench
