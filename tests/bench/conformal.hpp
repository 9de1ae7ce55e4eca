// The contest in cga3: kinds of things and operations.  See contest.hpp.
#pragma once

#include "contest.hpp"
#include "hamotor/cga3/cga3.hpp"

namespace bench {

namespace cga3 = hamotor::cga3;

namespace kind::conformal {

/// Coordinates of up to ±size.
template <class Element>
[[nodiscard]] Element random(Source& source, double size) {
  std::array<Quad, Element::size> x{};
  for (auto& component : x) component = Quad(source.uniform(-size, size));
  return Element::from(x);
}

/// Point pair of a general map: a rotation by up to half a turn, a scaling, a translation and a
/// special conformal part.
struct Bivector {
  using Exact = cga3::Bivector<Quad>;
  [[nodiscard]] static Exact make(Source& source) { return random<Exact>(source, 1.0); }
};
/// Turns by any angle and moves so little that long chains neither grow nor vanish.
struct Versor {
  using Exact = cga3::Versor<Quad>;
  [[nodiscard]] static Exact make(Source& source) {
    auto b = random<cga3::Bivector<Quad>>(source, 1.0);
    for (Quad* x : {&b.e1i, &b.e2i, &b.e3i, &b.e0i, &b.e01, &b.e02, &b.e03}) *x *= Quad(0.125);
    return exp(b);
  }
};
struct Even {
  using Exact = cga3::Even<Quad>;
  [[nodiscard]] static Exact make(Source& source) {
    return Exact::from(Versor::make(source).components());
  }
};
struct Odd {
  using Exact = cga3::Odd<Quad>;
};
struct Vector {
  using Exact = cga3::Vector<Quad>;
  [[nodiscard]] static Exact make(Source& source) { return random<Exact>(source, 1.0); }
};
/// A versor held as its matrix on vectors: it is given, and the time to make it is not.
struct MatrixOnVector {
  using Exact = cga3::Versor<Quad>;
  [[nodiscard]] static Exact make(Source& source) { return Versor::make(source); }
};
struct Trivector {
  using Exact = cga3::Trivector<Quad>;
  [[nodiscard]] static Exact make(Source& source) { return random<Exact>(source, 1.0); }
};

}  // namespace kind::conformal

/// What a versor does: the images of the basis vectors, one after the other.
[[nodiscard]] Values values(const cga3::Versor<Quad>& m);

namespace operation::conformal {

struct EvenProduct {
  static constexpr const char* name = "cga3 even product";
  using A = kind::conformal::Even;
  using B = kind::conformal::Even;
  using Result = kind::conformal::Even;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto& a, const auto& b)
      -> decltype(C::multiply(a, b)) {
    return C::multiply(a, b);
  }
};
struct VersorProduct {
  static constexpr const char* name = "cga3 versor product";
  using A = kind::conformal::Versor;
  using B = kind::conformal::Versor;
  using Result = kind::conformal::Versor;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto& a, const auto& b)
      -> decltype(C::compose(a, b)) {
    return C::compose(a, b);
  }
};
struct MoveVector : Move<kind::conformal::Vector> {
  static constexpr const char* name = "cga3 vector";
  using A = kind::conformal::Versor;
};
struct TransformVector : Transform<kind::conformal::Vector> {
  static constexpr const char* name = "cga3 vector, matrix given";
  using A = kind::conformal::MatrixOnVector;
};
struct MoveBivector : Move<kind::conformal::Bivector> {
  static constexpr const char* name = "cga3 bivector";
  using A = kind::conformal::Versor;
};
struct BivectorTrivector {
  static constexpr const char* name = "cga3 bivector trivector";
  using A = kind::conformal::Bivector;
  using B = kind::conformal::Trivector;
  using Result = kind::conformal::Odd;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto& a, const auto& b)
      -> decltype(C::bivector_trivector(a, b)) {
    return C::bivector_trivector(a, b);
  }
};
struct Exp {
  static constexpr const char* name = "cga3 exp";
  using A = kind::Nothing;
  using B = kind::conformal::Bivector;
  using Result = kind::conformal::Versor;
  template <class C>
  HAMOTOR_INLINE static constexpr auto run(const auto&, const auto& b) -> decltype(C::exp(b)) {
    return C::exp(b);
  }
};

}  // namespace operation::conformal

/// Enters a contestant for every conformal operation it knows.
template <template <class> class C>
void enter_conformal() {
  enter_for<C, operation::conformal::EvenProduct>();
  enter_for<C, operation::conformal::VersorProduct>();
  enter_for<C, operation::conformal::MoveVector>();
  enter_for<C, operation::conformal::TransformVector>();
  enter_for<C, operation::conformal::MoveBivector>();
  enter_for<C, operation::conformal::BivectorTrivector>();
  enter_for<C, operation::conformal::Exp>();
}

}  // namespace bench
