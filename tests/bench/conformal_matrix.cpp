// cga3 with Eigen: the 5 × 5 matrices of what versors do to vectors, and the 4 × 4 complex matrices
// that the whole algebra is, R(4,1) = C(4).
#include <unsupported/Eigen/MatrixFunctions>

#include "conformal.hpp"
#include "eigen.hpp"

namespace bench {

namespace {

using Five = std::array<Quad, 5>;

/// exp by Taylor's series of x / 2⁸, squared, for a scalar that Eigen has no Padé form for.
template <class Matrix>
[[nodiscard]] Matrix exponential_series(const Matrix& x) {
  Matrix term = Matrix::Identity();
  Matrix sum = term;
  for (int n = 1; n < 24; ++n) {
    term = (term * x * Quad(1.0 / 256)).eval() * (Quad(1) / Quad(n));
    sum += term;
  }
  for (int i = 0; i < 8; ++i) sum = (sum * sum).eval();
  return sum;
}

}  // namespace

/// Versors are the matrices of what they do to vectors, bivectors Σ B_ij e_i ∧ e_j antisymmetric
/// ones; to be exponentiated, those of their commutators with vectors.
template <class S>
struct ConformalMatrix5 {
  static constexpr const char* name = "Eigen 5x5 matrix";
  using Matrix = Eigen::Matrix<S, 5, 5>;
  using Vector = Eigen::Matrix<S, 5, 1>;

  [[nodiscard]] static Vector make(kind::conformal::Vector, const cga3::Vector<Quad>& x) {
    Vector all;
    for (int i = 0; i < 5; ++i) all[i] = static_cast<S>(x.components()[static_cast<unsigned>(i)]);
    return all;
  }
  [[nodiscard]] static Matrix make(kind::conformal::Versor, const cga3::Versor<Quad>& m) {
    const Values images = values(m);
    Matrix all;
    for (int i = 0; i < 25; ++i)
      all(i % 5, i / 5) = static_cast<S>(images[static_cast<unsigned>(i)]);
    return all;
  }
  [[nodiscard]] static Matrix make(kind::conformal::MatrixOnVector, const cga3::Versor<Quad>& m) {
    return make(kind::conformal::Versor{}, m);
  }
  [[nodiscard]] static Matrix make(kind::conformal::Bivector, const cga3::Bivector<Quad>& b) {
    const Quad o(0);
    const std::array<Five, 5> all{{{o, b.e01, b.e02, b.e03, b.e0i},
                                   {-b.e01, o, b.e12, -b.e31, b.e1i},
                                   {-b.e02, -b.e12, o, b.e23, b.e2i},
                                   {-b.e03, b.e31, -b.e23, o, b.e3i},
                                   {-b.e0i, -b.e1i, -b.e2i, -b.e3i, o}}};
    Matrix antisymmetric;
    for (int i = 0; i < 25; ++i) {
      antisymmetric(i / 5, i % 5) =
          static_cast<S>(all[static_cast<unsigned>(i / 5)][static_cast<unsigned>(i % 5)]);
    }
    return antisymmetric;
  }
  [[nodiscard]] static Values exact(kind::conformal::Vector, const Vector& x) {
    return {Quad(x[0]), Quad(x[1]), Quad(x[2]), Quad(x[3]), Quad(x[4])};
  }
  [[nodiscard]] static Values exact(kind::conformal::Versor, const Matrix& m) {
    Values all;
    for (int i = 0; i < 25; ++i) all.push_back(Quad(m(i % 5, i / 5)));
    return all;
  }
  [[nodiscard]] static Values exact(kind::conformal::Bivector, const Matrix& b) {
    return {Quad(b(2, 3)), Quad(b(3, 1)), Quad(b(1, 2)), Quad(b(1, 4)), Quad(b(2, 4)),
            Quad(b(3, 4)), Quad(b(0, 4)), Quad(b(0, 1)), Quad(b(0, 2)), Quad(b(0, 3))};
  }

  [[nodiscard]] HAMOTOR_INLINE static Matrix compose(const Matrix& a, const Matrix& b) {
    return a * b;
  }
  [[nodiscard]] HAMOTOR_INLINE static Vector transform(kind::conformal::Vector, const Matrix& m,
                                                       const Vector& x) {
    return m * x;
  }
  [[nodiscard]] HAMOTOR_INLINE static Matrix move(kind::conformal::Bivector, const Matrix& m,
                                                  const Matrix& x) {
    return m * x * m.transpose();
  }
  /// Of Σ B_ij e_i ∧ e_j, exp(2 B G) is what exp(B) does to vectors, G the Gram matrix: its product
  /// with a column changes columns 0 and 4 only.
  [[nodiscard]] HAMOTOR_INLINE static Matrix exp(const Matrix& b) {
    Matrix moving = S(2) * b;
    moving.col(0).swap(moving.col(4));
    moving.col(0) = -moving.col(0);
    moving.col(4) = -moving.col(4);
    if constexpr (std::is_same_v<S, Quad>) {
      return exponential_series(moving);
    } else {
      return moving.exp();
    }
  }
};

namespace {

using ComplexQuad = Eigen::Matrix<std::complex<Quad>, 4, 4>;

/// The matrices of e0, e1, e2, e3, ei.
[[nodiscard]] const std::array<ComplexQuad, 5>& basis_matrices() {
  static const std::array<ComplexQuad, 5> all = [] {
    using Pauli = Eigen::Matrix<std::complex<Quad>, 2, 2>;
    const std::complex<Quad> o(Quad(0));
    const std::complex<Quad> one(Quad(1));
    const std::complex<Quad> i(Quad(0), Quad(1));
    Pauli unit;
    unit << one, o, o, one;
    Pauli x;
    x << o, one, one, o;
    Pauli y;
    y << o, -i, i, o;
    Pauli z;
    z << one, o, o, -one;
    const auto both = [](const Pauli& a, const Pauli& b) {
      ComplexQuad product;
      for (int r = 0; r < 4; ++r) {
        for (int c = 0; c < 4; ++c) product(r, c) = a(r / 2, c / 2) * b(r % 2, c % 2);
      }
      return product;
    };
    const ComplexQuad plus = both(z, y);
    const ComplexQuad minus = both(z, z) * i;
    const std::complex<Quad> half(Quad(0.5));
    return std::array<ComplexQuad, 5>{(minus - plus) * half, both(x, unit), both(y, unit),
                                      both(z, x), minus + plus};
  }();
  return all;
}

/// The matrix of a blade by its name, an outer product of basis vectors.
[[nodiscard]] ComplexQuad blade_matrix(std::string_view blade) {
  ComplexQuad matrix = ComplexQuad::Identity();
  if (blade == "s") return matrix;
  blade.remove_prefix(1);
  const std::complex<Quad> half(Quad(0.5));
  for (std::size_t k = blade.size(); k-- > 0;) {
    const ComplexQuad& v =
        basis_matrices()[blade[k] == 'i' ? 4U : static_cast<unsigned>(blade[k] - '0')];
    const std::complex<Quad> sign(Quad((blade.size() - 1 - k) % 2 == 0 ? 1 : -1));
    matrix = ((v * matrix + matrix * v * sign) * half).eval();
  }
  return matrix;
}

/// The matrices of an element's blades, and the 32 × n matrix of their real numbers' least-squares
/// solution.
template <class Element>
struct Representation {
  static constexpr int size = static_cast<int>(Element::size);
  std::array<ComplexQuad, Element::size> blades;
  Eigen::Matrix<Quad, Eigen::Dynamic, Eigen::Dynamic> solution;

  [[nodiscard]] static const Representation& get() {
    static const Representation one;
    return one;
  }
  [[nodiscard]] static Eigen::Matrix<Quad, 32, 1> numbers(const ComplexQuad& m) {
    Eigen::Matrix<Quad, 32, 1> all;
    for (int i = 0; i < 16; ++i) {
      all[2 * i] = m(i / 4, i % 4).real();
      all[2 * i + 1] = m(i / 4, i % 4).imag();
    }
    return all;
  }

 private:
  Representation() {
    Eigen::Matrix<Quad, Eigen::Dynamic, Eigen::Dynamic> columns(32, size);
    for (int i = 0; i < size; ++i) {
      const auto k = static_cast<std::size_t>(i);
      blades[k] = blade_matrix(Element::names[k]);
      columns.col(i) = numbers(blades[k]);
    }
    // Products of two matrices of blades of a null basis are orthogonal in pairs at most.
    solution = (columns.transpose() * columns).partialPivLu().solve(columns.transpose());
  }
};

}  // namespace

template <class S>
struct ConformalComplex {
  static constexpr const char* name = "Eigen 4x4 complex";
  using Matrix = Eigen::Matrix<std::complex<S>, 4, 4>;
  /// A versor and its reverse, both given.
  struct Versor {
    Matrix matrix;
    Matrix reverse;
  };

  template <class Element>
  [[nodiscard]] static Matrix matrix(const Element& x) {
    const auto& blades = Representation<Element>::get().blades;
    ComplexQuad sum = ComplexQuad::Zero();
    const auto components = x.components();
    for (std::size_t i = 0; i < components.size(); ++i) {
      sum += blades[i] * std::complex<Quad>(components[i]);
    }
    Matrix all;
    for (int i = 0; i < 16; ++i) {
      const auto& from = sum(i / 4, i % 4);
      all(i / 4, i % 4) = {static_cast<S>(from.real()), static_cast<S>(from.imag())};
    }
    return all;
  }
  template <class Kind>
  [[nodiscard]] static auto make(Kind, const typename Kind::Exact& x)
      -> std::enable_if_t<(Kind::Exact::size > 0), Matrix> {
    return matrix(x);
  }
  [[nodiscard]] static Versor make(kind::conformal::Versor, const cga3::Versor<Quad>& m) {
    return {matrix(m), matrix(reverse(m))};
  }
  template <class Kind>
  [[nodiscard]] static auto exact(Kind, const Matrix& m) {
    using Element = typename Kind::Exact;
    ComplexQuad wide;
    for (int i = 0; i < 16; ++i) {
      const auto& from = m(i / 4, i % 4);
      wide(i / 4, i % 4) = {Quad(from.real()), Quad(from.imag())};
    }
    const auto& known = Representation<Element>::get();
    const auto found = (known.solution * known.numbers(wide)).eval();
    std::array<Quad, Element::size> all;
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = found(static_cast<int>(i), 0);
    return Element::from(all);
  }
  [[nodiscard]] static auto exact(kind::conformal::Versor kind, const Versor& m) {
    return exact(kind, m.matrix);
  }

  [[nodiscard]] HAMOTOR_INLINE static Matrix multiply(const Matrix& a, const Matrix& b) {
    return a * b;
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static Matrix move(Kind, const Versor& m, const Matrix& x) {
    return m.matrix * x * m.reverse;
  }
  [[nodiscard]] HAMOTOR_INLINE static Matrix bivector_trivector(const Matrix& a, const Matrix& b) {
    return a * b;
  }
  [[nodiscard]] HAMOTOR_INLINE static Matrix exp(const Matrix& b) {
    if constexpr (std::is_same_v<S, Quad>) {
      ComplexQuad term = ComplexQuad::Identity();
      ComplexQuad sum = term;
      for (int n = 1; n < 24; ++n) {
        term = (term * b).eval() * std::complex<Quad>(Quad(1.0 / 256) / Quad(n));
        sum += term;
      }
      for (int i = 0; i < 8; ++i) sum = (sum * sum).eval();
      return sum;
    } else {
      return b.exp();
    }
  }
};

void enter_conformal_matrices() {
  enter_conformal<ConformalMatrix5>();
  enter_conformal<ConformalComplex>();
}

}  // namespace bench
