// ganja.js' generated C++ for R(3,0,1): a peer that npm has.  CMake writes it once for each scalar.
#include <algorithm>
#include <utility>

#include "contest.hpp"

namespace bench {

namespace ganja_float {
using Number = float;
#include "ganja_pga3d.inc"
}  // namespace ganja_float
namespace ganja_double {
using Number = double;
#include "ganja_pga3d.inc"
}  // namespace ganja_double
namespace ganja_quad {
using Number = Quad;
#include "ganja_pga3d.inc"
}  // namespace ganja_quad

template <class S>
struct Ganja {
  static constexpr const char* name = "ganja.js C++";
  using Multivector = std::conditional_t<
      std::is_same_v<S, float>, ganja_float::PGA3D,
      std::conditional_t<std::is_same_v<S, double>, ganja_double::PGA3D, ganja_quad::PGA3D>>;

  // Its order is 1 e0 e1 e2 e3 e01 e02 e03 e12 e31 e23 e021 e013 e032 e123 e0123.
  static constexpr std::array<std::size_t, 8> motor{0, 10, 9, 8, 5, 6, 7, 15};
  static constexpr std::array<std::size_t, 6> bivector{10, 9, 8, 5, 6, 7};
  static constexpr std::array<std::size_t, 3> trivector{13, 12, 11};
  static constexpr std::array<std::size_t, 4> vector{1, 2, 3, 4};
  [[nodiscard]] static constexpr const auto& indices(kind::Motion) { return motor; }
  [[nodiscard]] static constexpr const auto& indices(kind::Line) { return bivector; }
  [[nodiscard]] static constexpr const auto& indices(kind::Bivector) { return bivector; }
  [[nodiscard]] static constexpr const auto& indices(kind::Point) { return trivector; }
  [[nodiscard]] static constexpr const auto& indices(kind::Direction) { return trivector; }
  [[nodiscard]] static constexpr const auto& indices(kind::Plane) { return vector; }

  template <class Kind>
    requires requires(Kind kind) { indices(kind); }
  [[nodiscard]] static Multivector make(Kind kind, const typename Kind::Exact& x) {
    Multivector all;
    const auto numbers = x.components();
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      all[indices(kind)[i]] = static_cast<S>(numbers[i]);
    }
    if constexpr (std::is_same_v<Kind, kind::Point>) all[14] = S(1);
    return all;
  }
  template <class Kind>
  [[nodiscard]] static typename Kind::Exact exact(Kind kind, const Multivector& x) {
    std::array<Quad, Kind::Exact::size> numbers;
    for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = Quad(x[indices(kind)[i]]);
    return Kind::Exact::from(numbers);
  }

  [[nodiscard]] HAMOTOR_INLINE static Multivector compose(const Multivector& a,
                                                          const Multivector& b) {
    return a * b;
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static Multivector move(Kind, const Multivector& m,
                                                       const Multivector& x) {
    return m * x * ~m;
  }
  [[nodiscard]] HAMOTOR_INLINE static Multivector commutator(const Multivector& a,
                                                             const Multivector& b) {
    return S(0.5) * (a * b - b * a);
  }
};

void enter_ganja() { enter<Ganja>(); }

}  // namespace bench
