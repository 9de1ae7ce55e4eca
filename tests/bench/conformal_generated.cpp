// The generated kernels of cga3.
#include "conformal.hpp"

namespace bench {

namespace {

template <class S>
struct ConformalGenerated {
  static constexpr const char* name = "generated";

  template <class Kind>
  [[nodiscard]] static auto make(Kind, const typename Kind::Exact& x) {
    return rounded<S>(x);
  }
  [[nodiscard]] static auto make(kind::conformal::MatrixOnVector, const cga3::Versor<Quad>& m) {
    return rounded<S>(vector_matrix(m));
  }
  template <class Kind>
  [[nodiscard]] static auto exact(Kind, const auto& x) {
    return x.template cast<Quad>();
  }
  [[nodiscard]] HAMOTOR_INLINE static auto multiply(const cga3::Even<S>& a,
                                                    const cga3::Even<S>& b) {
    return gp(a, b);
  }
  [[nodiscard]] HAMOTOR_INLINE static auto compose(const cga3::Versor<S>& a,
                                                   const cga3::Versor<S>& b) {
    return gp(a, b);
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static auto move(Kind, const cga3::Versor<S>& m, const auto& x) {
    return sandwich(m, x);
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static auto transform(Kind, const auto& a, const auto& x) {
    return cga3::transform(a, x);
  }
  template <class Kind>
  [[nodiscard]] static auto transform(Kind, const cga3::Versor<S>& m, const auto& x) {
    return sandwich(m, x);
  }
  [[nodiscard]] HAMOTOR_INLINE static auto bivector_trivector(const cga3::Bivector<S>& a,
                                                              const cga3::Trivector<S>& b) {
    return gp(a, b);
  }
  [[nodiscard]] HAMOTOR_INLINE static auto exp(const cga3::Bivector<S>& b) { return cga3::exp(b); }
};

/// The sandwiches with the fewest operations, accurate as wholes and not component by component.
template <class S>
struct ConformalLean : ConformalGenerated<S> {
  static constexpr const char* name = "generated, lean";

  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static auto move(Kind, const cga3::Versor<S>& m, const auto& x) {
    return sandwich_lean(m, x);
  }
};

}  // namespace

template <>
inline constexpr const char* name_in_lanes<ConformalGenerated> = "generated, packs";

Values values(const cga3::Versor<Quad>& m) {
  Values all;
  for (std::size_t k = 0; k < cga3::Vector<Quad>::size; ++k) {
    std::array<Quad, cga3::Vector<Quad>::size> unit{};
    unit[k] = Quad(1);
    for (const Quad x : values(sandwich(m, cga3::Vector<Quad>::from(unit)))) all.push_back(x);
  }
  return all;
}

template <class Op>
Values reference(const Exact<typename Op::A>& a, const Exact<typename Op::B>& b) {
  return values(Op::template run<ConformalGenerated<Quad>>(a, b));
}

using namespace operation::conformal;
template Values reference<EvenProduct>(const cga3::Even<Quad>&, const cga3::Even<Quad>&);
template Values reference<VersorProduct>(const cga3::Versor<Quad>&, const cga3::Versor<Quad>&);
template Values reference<MoveVector>(const cga3::Versor<Quad>&, const cga3::Vector<Quad>&);
template Values reference<TransformVector>(const cga3::Versor<Quad>&, const cga3::Vector<Quad>&);
template Values reference<MoveBivector>(const cga3::Versor<Quad>&, const cga3::Bivector<Quad>&);
template Values reference<BivectorTrivector>(const cga3::Bivector<Quad>&,
                                             const cga3::Trivector<Quad>&);
template Values reference<operation::conformal::Exp>(const kind::Nothing&,
                                                     const cga3::Bivector<Quad>&);

void enter_conformal_generated() {
  enter_conformal<ConformalGenerated>();
  enter_for<ConformalLean, MoveVector>();
  enter_for<ConformalLean, MoveBivector>();
}

}  // namespace bench
