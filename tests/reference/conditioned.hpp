// How far generated kernels are from the truth, in units of what their conditioning leaves.
//
// conditioned.py writes one program an algebra: its product as a table, its element types, and a
// call of `multilinear` or `closed_form` for each kernel.
//
//   PROGRAM measure SCALAR COUNT   one JSON object a kernel
//   PROGRAM sample SCALAR COUNT    inputs and truth of points, to check the truth
//
// The truth is the kernel itself in __float128 (for float: long double).  It costs fifty times the
// kernel, so that at most points it is the kernel in long double that decides whether an error may
// be the largest: only then, and at every sixteenth point, all is computed.  Where long double
// shows less than half of an error at one of these, it decides nothing for that kernel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "hamotor/scalar.hpp"
#include "random.hpp"

namespace conditioned {

using Quad = hamotor::scalar::Float128;
using Wide = long double;
using Numbers = std::vector<Wide>;

// a b = Σ coefficient c over basis blades.
struct Entry {
  int a, b, c;
  double coefficient;
};

// coefficient × a component, on a blade.
struct Part {
  int component;
  int blade;
  double coefficient;
};

struct Element {
  int size;
  bool unit;
  std::span<const Part> embedding;
  std::span<const Part> reading;
  std::span<const int> weights;  // of the components: how they scale with the unit of length
};

// One monomial of a component of the result: up to three numbers among all operands' components.
struct Term {
  int output;
  double coefficient;
  std::array<int, 3> factors;  // −1: none
};

struct Algebra {
  int blades;
  std::span<const Entry> product;
  std::span<const double> squares;  // of the blades
  std::span<const int> grades;
};

using reference::Random;

// ---------------------------------------------------------------- inputs

class Sampler {
 public:
  Sampler(const Algebra& algebra, std::uint64_t seed) : algebra_(algebra), random_{seed} {
    // the products are in the order of their factors
    const std::size_t n = static_cast<std::size_t>(algebra.blades);
    first_.resize(n * n + 1);
    for (const Entry& e : algebra.product) ++first_[index(e.a) * n + index(e.b) + 1];
    for (std::size_t i = 0; i < n * n; ++i) first_[i + 1] += first_[i];
  }

  Random& random() { return random_; }

  // Components of any size and sign: even ones, of all sizes, sparse, small integers.
  Numbers numbers(int size) {
    Numbers x(static_cast<std::size_t>(size));
    const std::size_t kind = random_.below(6);
    const double scale = random_.power_of_ten(-3, 3);
    for (Wide& c : x) {
      const double even = random_.symmetric();
      switch (kind) {
        case 0:
          c = random_.sign() * random_.power_of_ten(-4, 4);
          break;
        case 1:
          c = random_.below(2) ? scale * even : 0.0;
          break;
        case 2:
          c = static_cast<double>(random_.below(9)) - 4;
          break;
        case 3:
          c = scale * even;
          break;
        default:
          c = even;
      }
    }
    return x;
  }

  // A unit versor: a product of exponentials of blades, or such a product turned by another.
  Numbers versor(const Element& element) {
    const std::vector<int>& planes = bivector_blades(element);
    if (planes.empty()) return normalised(element);
    Numbers m(static_cast<std::size_t>(algebra_.blades));
    m[0] = 1;
    for (std::size_t k = random_.below(5); k > 0; --k) m = times(m, factor(planes));
    if (random_.below(2)) {
      Numbers turn = factor(planes);
      turn = times(turn, factor(planes));
      m = times(times(turn, m), reversed(turn));
    }
    return read(element, m);
  }

  // A bivector: any components, or two commuting planes, equal, nearly so or not at all, turned.
  Numbers bivector(const Element& element) {
    const std::vector<int>& planes = bivector_blades(element);
    Numbers b(static_cast<std::size_t>(algebra_.blades));
    const std::size_t kind = random_.below(9);
    const double scale = random_.power_of_ten(-9, 3);
    if (kind == 8 && !boosts_.empty()) {
      // two null blades that turn together, and a plane that commutes with both
      const Entry& pair = boosts_[random_.below(boosts_.size())];
      const Wide a = random_.below(2) ? Wide(angle()) : Wide(random_.symmetric() * scale);
      const double weight = random_.power_of_ten(-2, 2);
      b[index(pair.a)] = a * weight / std::sqrt(Wide(2));
      b[index(pair.b)] = -pair.coefficient * a / weight / std::sqrt(Wide(2));
      const double apart = random_.below(3) ? random_.power_of_ten(-17, 0) : 0.0;
      for (const int other : planes)
        if ((other & (pair.a | pair.b)) == 0) b[index(other)] = a * (Wide(1) + apart);
    } else if (kind < 3) {
      for (const int blade : planes) b[index(blade)] = some_size(blade, scale);
      return read(element, b);
    } else {
      const int first = planes[random_.below(planes.size())];
      const int second = planes[random_.below(planes.size())];
      const Wide a = kind < 6 ? some_size(first, scale) : Wide(angle());
      b[index(first)] += a;
      if ((first & second) == 0) {
        const double apart = random_.below(3) ? random_.power_of_ten(-17, 0) : 0.0;
        const Wide other = a * random_.sign() * (Wide(1) + apart);
        const bool boundless = algebra_.squares[index(second)] > 0 && std::fabs(a) > 20;
        b[index(second)] += random_.below(4) && !boundless ? other : some_size(second, scale);
      } else if (random_.below(2)) {
        b[index(second)] += random_.below(2) ? a * random_.sign() : some_size(second, scale);
      }
    }
    Numbers turn = factor(planes);
    turn = times(turn, factor(planes));
    return read(element, times(times(turn, b), reversed(turn)));
  }

  // A versor times anything, and not quite a versor any more.
  Numbers near_versor(const Element& element) {
    Numbers x = versor(element);
    const double scale = random_.power_of_ten(-6, 6);
    const double slip = random_.below(2) ? random_.power_of_ten(-16, -1) : 0.0;
    Wide size = 0;
    for (const Wide& c : x) size += c < 0 ? -c : c;
    for (Wide& c : x) c = scale * (c * (1 + slip * random_.symmetric()));
    return x;
  }

 private:
  static std::size_t index(int blade) { return static_cast<std::size_t>(blade); }

  // The blades of an element's bivectors, and which pairs of them have a number in their product.
  const std::vector<int>& bivector_blades(const Element& element) {
    if (&element == element_) return planes_;
    element_ = &element;
    planes_.clear();
    for (const Part& part : element.embedding)
      if (algebra_.grades[index(part.blade)] == 2) planes_.push_back(part.blade);
    boosts_.clear();
    for (const Entry& e : algebra_.product)
      if (e.a != e.b && e.c == 0 && holds(planes_, e.a) && holds(planes_, e.b))
        boosts_.push_back(e);
    return planes_;
  }

  static bool holds(const std::vector<int>& blades, int blade) {
    return std::count(blades.begin(), blades.end(), blade) > 0;
  }

  double angle() {
    constexpr double pi = 3.141592653589793;
    switch (random_.below(8)) {
      case 0:
        return 0;
      case 1:
        return random_.sign() * random_.power_of_ten(-17, 0);
      case 2:
        return random_.sign() * (pi - random_.power_of_ten(-17, 0));
      case 3:
        return random_.sign() * pi / 2 * (1 + 0x1p-50 * random_.symmetric());
      case 4:
        return random_.sign() * pi / 4;
      default:
        return pi * random_.symmetric();
    }
  }

  // Boosts stay below 3, and null blades that make boosts below 2: a result grows like exp of
  // them.  Translations reach 10⁴.
  double some_size(int blade, double scale) {
    const double square = algebra_.squares[index(blade)];
    if (square > 0) return random_.symmetric() * std::min(scale, 3.0);
    if (square < 0) return random_.symmetric() * scale;
    if (!boosts_.empty()) return random_.sign() * random_.power_of_ten(-4, 0.3);
    return random_.sign() * random_.power_of_ten(-4, random_.below(4) ? 1 : 4);
  }

  Numbers factor(const std::vector<int>& planes) {
    const int plane = planes[random_.below(planes.size())];
    Numbers m(static_cast<std::size_t>(algebra_.blades));
    const double square = algebra_.squares[index(plane)];
    if (square < 0) {
      const Wide t = angle();
      m[0] = std::cos(t);
      m[index(plane)] = std::sin(t);
    } else if (square > 0) {
      const Wide t = random_.sign() * random_.power_of_ten(-8, 0.3);
      m[0] = std::cosh(t);
      m[index(plane)] = std::sinh(t);
    } else {
      m[0] = 1;
      m[index(plane)] = random_.below(6) ? some_size(plane, 1) : 0;
    }
    return m;
  }

  Numbers times(const Numbers& a, const Numbers& b) const {
    Numbers c(a.size());
    const auto n = a.size();
    for (std::size_t i = 0; i < n; ++i) {
      if (a[i] == 0) continue;
      for (std::size_t j = 0; j < n; ++j) {
        if (b[j] == 0) continue;
        for (std::size_t k = first_[i * n + j]; k < first_[i * n + j + 1]; ++k) {
          const Entry& e = algebra_.product[k];
          c[index(e.c)] += e.coefficient * a[i] * b[j];
        }
      }
    }
    return c;
  }

  Numbers reversed(Numbers a) const {
    for (std::size_t i = 0; i < a.size(); ++i)
      if ((algebra_.grades[i] / 2) % 2) a[i] = -a[i];
    return a;
  }

  static Numbers read(const Element& element, const Numbers& value) {
    Numbers x(static_cast<std::size_t>(element.size));
    for (const Part& p : element.reading)
      x[index(p.component)] += p.coefficient * value[index(p.blade)];
    return x;
  }

  Numbers normalised(const Element& element) {
    for (;;) {
      Numbers x = numbers(element.size);
      Numbers value(static_cast<std::size_t>(algebra_.blades));
      for (const Part& p : element.embedding)
        value[index(p.blade)] += p.coefficient * x[index(p.component)];
      const Wide square = times(value, reversed(value))[0];
      if (!(square > 1e-12L)) continue;
      for (Wide& c : x) c /= std::sqrt(square);
      return x;
    }
  }

  Algebra algebra_;
  Random random_;
  std::vector<std::size_t> first_;  // where the products of two blades begin
  const Element* element_ = nullptr;
  std::vector<int> planes_;
  std::vector<Entry> boosts_;
};

// ---------------------------------------------------------------- judging

template <class S>
Wide ulp(Wide size) {
  int exponent = 0;
  std::frexp(size, &exponent);
  const Wide unit = std::ldexp(Wide(1), exponent - std::numeric_limits<S>::digits);
  return std::max<Wide>(unit, std::numeric_limits<S>::min());
}

// ε of a sum; of nothing, the smallest number that is not denormal.
template <class S>
Wide unit(Wide sum) {
  return std::max<Wide>(std::numeric_limits<S>::epsilon() * sum, std::numeric_limits<S>::min());
}

inline Wide norm(const std::vector<Wide>& x) {
  Wide sum = 0;
  for (const Wide c : x) sum += c * c;
  return std::sqrt(sum);
}

template <class R>
auto components(const R& result) {
  if constexpr (requires { result.components(); }) {
    return result.components();
  } else {
    return std::array<R, 1>{result};
  }
}

// f of operands of the given types, whose components stand one after another in `x`.
template <class S, template <class> class... Operand, class F>
auto evaluate(const F& f, const Numbers& x) {
  std::size_t next = 0;
  const auto take = [&]<class T>(std::type_identity<T>) {
    if constexpr (std::is_empty_v<T>) {
      return T{};
    } else {
      std::array<S, T::size> c{};
      for (S& number : c) number = static_cast<S>(x[next++]);
      return T::from(c);
    }
  };
  const std::tuple<Operand<S>...> operands{take(std::type_identity<Operand<S>>{})...};
  return components(std::apply(f, operands));
}

template <class S>
Numbers rounded(Numbers x) {
  for (Wide& c : x) c = static_cast<S>(c);
  return x;
}

inline std::string text(Quad x) {
  std::array<char, 64> buffer{};
  quadmath_snprintf(buffer.data(), buffer.size(), "%.40Qe", x);
  return buffer.data();
}

template <class T>
std::string list(const std::vector<T>& x) {
  std::string all;
  for (const T c : x) all += (all.empty() ? "\"" : ", \"") + text(c) + "\"";
  return "[" + all + "]";
}

// The largest errors, and some to take the median of.
struct Errors {
  std::vector<double> some;
  double largest = -1;  // in ulp of the condition
  double other = 0;     // in ulp of the other scale
  std::size_t judged = 0;
  std::size_t nan = 0;
  Numbers worst;
};

// An error in units of the condition, and in units of the other scale; negative: not judged.
struct Judged {
  double scaled;
  double other;
};

class Run {
 public:
  Run(const Algebra& algebra, bool sampling, bool wide, std::size_t count)
      : algebra_(algebra), sampling_(sampling), wide_(wide), count_(count) {}

  // A product, sandwich or the like: scaled by the sums of the absolute values of its terms.
  template <template <class> class... Operand, class F>
  void multilinear(int index, std::array<const Element*, sizeof...(Operand)> elements,
                   std::span<const Term> terms, F f) {
    const auto input = [&](Sampler& sampler) {
      Numbers x;
      for (const Element* e : elements) {
        const Numbers part = e->unit ? sampler.versor(*e) : sampler.numbers(e->size);
        x.insert(x.end(), part.begin(), part.end());
      }
      return x;
    };
    const auto measured = [&]<class S>(S) {
      // both scales are at least as large for the terms as for what is left of them
      const auto bound = [](const Numbers& truth, const Numbers& errors) {
        Judged most{norm_ratio<S>(errors, truth), 0};
        for (std::size_t i = 0; i < errors.size(); ++i)
          most.other = std::max(
              most.other, static_cast<double>(std::fabs(errors[i]) / unit<S>(std::fabs(truth[i]))));
        return most;
      };
      const auto judge = [terms](const Numbers& x, const Numbers& truth, const Numbers& errors) {
        std::vector<double> sizes;
        for (const Wide c : x) sizes.push_back(std::fabs(static_cast<double>(c)));
        Numbers sums(truth.size());
        for (const Term& t : terms) {
          double product = std::fabs(t.coefficient);
          for (const int i : t.factors)
            if (i >= 0) product *= sizes[static_cast<std::size_t>(i)];
          sums[static_cast<std::size_t>(t.output)] += product;
        }
        Judged found{norm_ratio<S>(errors, sums), 0};
        for (std::size_t i = 0; i < errors.size(); ++i)
          found.other =
              std::max(found.other, static_cast<double>(std::fabs(errors[i]) / unit<S>(sums[i])));
        return found;
      };
      go<S>(
          index, input, [&]<class T>(const Numbers& x, T) { return evaluate<T, Operand...>(f, x); },
          [&]<class T>(const Numbers& x, T) { return evaluate<T, Operand...>(f, x); }, bound,
          judge);
    };
    wide_ ? measured(double()) : measured(float());
  }

  // Anything else, of one operand: scaled by what an ε of the largest component of the same weight
  // does to the result, added up over the components, or by the result if that is larger.  `unit`
  // maps a rounded versor to the one it stands for.
  template <template <class> class Operand, class F, class Unit>
  void closed_form(int index, const Element& element, const std::function<Numbers(Sampler&)>& input,
                   F f, Unit unit) {
    const std::span<const int> weights = element.weights;
    const auto exact = [&]<class T>(const Numbers& x, T) {
      return evaluate<T, Operand>([&](const Operand<T>& a) { return f(unit(a)); }, x);
    };
    const auto measured = [&]<class S>(S) {
      const auto bound = [](const Numbers& truth, const Numbers& errors) {
        const double of_norm = static_cast<double>(norm(errors) / ulp<S>(norm(truth)));
        return Judged{of_norm, of_norm};
      };
      const auto judge = [&](const Numbers& x, const Numbers& truth, const Numbers& errors) {
        constexpr Wide step = std::numeric_limits<S>::epsilon();
        const auto here = exact(x, Wide());
        Numbers change(truth.size());
        for (std::size_t j = 0; j < x.size(); ++j) {
          Wide largest = 0;
          for (std::size_t k = 0; k < x.size(); ++k)
            if (weights[k] == weights[j]) largest = std::max(largest, std::fabs(x[k]));
          if (largest == 0) continue;
          // both ways: one of them may lead across a cut
          std::vector<Wide> most(change.size());
          for (const Wide way : {step, -step}) {
            Numbers moved = x;
            moved[j] += way * largest;
            const auto there = exact(moved, Wide());
            for (std::size_t i = 0; i < change.size(); ++i) {
              const Wide moves = std::fabs(there[i] - here[i]) / step;
              if (!(moves <= most[i])) most[i] = moves;  // also what is no number
            }
          }
          for (std::size_t i = 0; i < change.size(); ++i) change[i] += most[i];
        }
        const Wide size = norm(truth);
        const Wide condition = norm(change);
        const Wide error = norm(errors);
        // no digit is left to be right
        if (!std::isfinite(condition) || condition * step > size / 8) return Judged{-1, -1};
        return Judged{static_cast<double>(error / ulp<S>(std::max(size, condition))),
                      static_cast<double>(error / ulp<S>(size))};
      };
      go<S>(
          index, input, [&]<class T>(const Numbers& x, T) { return evaluate<T, Operand>(f, x); },
          exact, bound, judge);
    };
    wide_ ? measured(double()) : measured(float());
  }

  const Algebra& algebra() const { return algebra_; }

 private:
  template <class S>
  static double norm_ratio(const Numbers& errors, const Numbers& sizes) {
    return static_cast<double>(norm(errors) / unit<S>(norm(sizes)));
  }

  // Truth and error in long double; of a truth in T.
  template <class T, class Found>
  static bool compare(const T& truth, const Found& found, Wide limit, Numbers& sizes,
                      Numbers& errors) {
    sizes.clear();
    errors.clear();
    bool finite = true;
    for (std::size_t k = 0; k < truth.size(); ++k) {
      sizes.push_back(static_cast<Wide>(truth[k]));
      errors.push_back(static_cast<Wide>(truth[k] - found[k]));
      finite = finite && std::fabs(sizes[k]) < limit;
    }
    return finite;
  }

  // bound: no less than what `judge` says, and cheaper.  Nothing, if screening overlooks an error.
  template <class S, class Input, class Kernel, class Truth, class Bound, class Judge>
  std::optional<Errors> tried(int index, const Input& input, const Kernel& kernel,
                              const Truth& exact, const Bound& bound, const Judge& judge,
                              bool screening) {
    using Best = std::conditional_t<std::is_same_v<S, double>, Quad, Wide>;
    constexpr Wide limit = std::numeric_limits<S>::max() / 16;
    Sampler sampler(algebra_, 0x68616d6fu + static_cast<std::uint64_t>(index));
    Errors errors;
    Numbers sizes;
    Numbers off;
    for (std::size_t i = 0; i < count_; ++i) {
      const Numbers x = rounded<S>(input(sampler));
      if (sampling_) {
        const auto truth = exact(x, Best());
        std::printf("{\"index\": %d, \"input\": %s, \"truth\": %s}\n", index, list(x).c_str(),
                    list(std::vector<Best>(truth.begin(), truth.end())).c_str());
        continue;
      }
      const auto found = kernel(x, S());
      const bool nan =
          std::any_of(found.begin(), found.end(), [](S c) { return !std::isfinite(c); });
      const bool settled = !screening || nan || i % 16 == 0;
      const bool finite = compare(exact(x, Wide()), found, limit, sizes, off);
      const Judged most = finite ? bound(sizes, off) : Judged{0, 0};
      const auto small = [&](const Judged& error) {
        return 2 * error.scaled < errors.largest && 2 * error.other < errors.other;
      };
      if (!settled && finite && small(most)) {
        ++errors.judged;
        continue;
      }
      const Judged guess = finite ? judge(x, sizes, off) : Judged{-1, -1};
      if (!settled && finite && small(guess)) {
        errors.judged += guess.scaled >= 0;
        continue;
      }
      if (!compare(exact(x, Best()), found, limit, sizes, off)) continue;
      const Judged error = judge(x, sizes, off);
      if (!(error.scaled >= 0) && !nan) continue;
      if (nan) {
        if (judge(x, sizes, Numbers(sizes.size())).scaled < 0) continue;
        ++errors.nan;
        errors.worst = x;
        continue;
      }
      ++errors.judged;
      if (screening && guess.scaled >= 0 && error.scaled > 2 * guess.scaled + 0.1)
        return std::nullopt;
      if (i % 16 == 0) errors.some.push_back(error.scaled);
      errors.other = std::max(errors.other, error.other);
      if (error.scaled > errors.largest) {
        errors.largest = error.scaled;
        if (!errors.nan) errors.worst = x;
      }
    }
    return errors;
  }

  template <class S, class Input, class Kernel, class Truth, class Bound, class Judge>
  void go(int index, const Input& input, const Kernel& kernel, const Truth& exact,
          const Bound& bound, const Judge& judge) {
    std::optional<Errors> errors = tried<S>(index, input, kernel, exact, bound, judge, true);
    if (!errors) errors = tried<S>(index, input, kernel, exact, bound, judge, false);
    if (sampling_) return;
    std::vector<double>& some = errors->some;
    const std::size_t half = some.size() / 2;
    std::nth_element(some.begin(), some.begin() + static_cast<std::ptrdiff_t>(half), some.end());
    std::printf(
        "{\"index\": %d, \"points\": %zu, \"judged\": %zu, \"max_ulp\": %.4g, "
        "\"median_ulp\": %.4g, \"other\": %.4g, \"nan\": %zu, \"worst\": %s}\n",
        index, count_, errors->judged, std::max(errors->largest, 0.0),
        some.empty() ? 0.0 : some[half], errors->other, errors->nan, list(errors->worst).c_str());
    std::fflush(stdout);
  }

  Algebra algebra_;
  bool sampling_;
  bool wide_;
  std::size_t count_;
};

inline int main(int argc, char** argv, const Algebra& algebra, void (*kernels)(Run&)) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: measure|sample float|double COUNT\n");
    return 2;
  }
  Run run(algebra, std::strcmp(argv[1], "sample") == 0, std::strcmp(argv[2], "double") == 0,
          static_cast<std::size_t>(std::atoll(argv[3])));
  kernels(run);
  return 0;
}

}  // namespace conditioned
