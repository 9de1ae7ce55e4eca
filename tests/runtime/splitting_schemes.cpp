// The coefficients of the splittings meet their order conditions, in long double.
#include "hamotor/splitting_schemes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <vector>

namespace {

using Wide = long double;
using Word = std::vector<int>;

Wide power(Wide x, int n) {
  Wide result = 1;
  for (; n > 0; --n) result *= x;
  return result;
}

/// All words in the letters 1, 3, 5, … whose letters add up to at most `degree`.
std::vector<Word> odd_words(int degree) {
  std::vector<Word> words{{}};
  for (std::size_t k = 0; k < words.size(); ++k) {
    int sum = 0;
    for (const int letter : words[k]) sum += letter;
    for (int letter = 1; sum + letter <= degree; letter += 2) {
      Word longer = words[k];
      longer.push_back(letter);
      words.push_back(longer);
    }
  }
  return words;
}

/// Largest coefficient of Π exp(γ_k Y₁ + γ_k³ Y₃ + …) − exp(Y₁) up to degree `order`: a symmetric
/// map of order 2 is exp(h Y₁ + h³ Y₃ + …) with Y₁ the motion itself and unrelated Y₃, Y₅, ….
template <class Scheme>
Wide composition_defect() {
  constexpr int order = Scheme::order;
  const auto words = odd_words(order);
  std::vector<Wide> inverse_factorial{1};
  for (int k = 1; k <= order; ++k) inverse_factorial.push_back(inverse_factorial.back() / k);
  std::map<Word, Wide> product;
  product[{}] = 1;
  for (const Wide step : Scheme::template weights<Wide>().drifts) {
    std::map<Word, Wide> next;
    for (const Word& word : words) {
      Wide sum = 0;
      int degree = 0;
      for (std::size_t tail = 0; tail <= word.size(); ++tail) {
        const std::size_t split = word.size() - tail;
        if (tail > 0) degree += word[split];
        const Word head(word.begin(), word.begin() + static_cast<std::ptrdiff_t>(split));
        sum += product[head] * power(step, degree) * inverse_factorial[tail];
      }
      next[word] = sum;
    }
    product = next;
  }
  Wide worst = 0;
  for (const Word& word : words) {
    const bool only_ones = std::all_of(word.begin(), word.end(), [](int x) { return x == 1; });
    const Wide wanted = only_ones ? inverse_factorial[word.size()] : 0;
    worst = std::max(worst, std::abs(product[word] - wanted));
  }
  return worst;
}

TEST(Composition, meets_the_order_conditions) {
  EXPECT_LT(composition_defect<hamotor::Composition<hamotor::Strang>>(), 1e-18L);
  EXPECT_LT(composition_defect<hamotor::Composition<hamotor::Suzuki4>>(), 1e-17L);
  EXPECT_LT(composition_defect<hamotor::Composition<hamotor::KahanLi6>>(), 1e-17L);
  EXPECT_LT(composition_defect<hamotor::Composition<hamotor::KahanLi8>>(), 1e-17L);
  EXPECT_LT(composition_defect<hamotor::Composition<hamotor::SofroniouSpaletta10>>(), 1e-17L);
}

struct OneOrderMore : hamotor::KahanLi6 {
  static constexpr int order = 8;
};

TEST(Composition, conditions_of_a_higher_order_fail) {
  EXPECT_GT(composition_defect<hamotor::Composition<OneOrderMore>>(), 1e-4L);
}

/// A function of the stages, φ(c), and what it is on the exact solution: factor cᵈ.
struct Nystrom {
  std::vector<Wide> stages;
  Wide factor;
  int degree;
};

/// Every condition Σ b φ(c) = ∫ φ of a Runge–Kutta–Nyström method of this order, y'' = f(y):
/// φ is 1, a product of such functions with c, or Σ_j b_j (c_i − c_j) φ(c_j).
template <class Scheme>
Wide nystrom_defect(int order) {
  const auto [drifts, kicks] = Scheme::template weights<Wide>();
  std::vector<Wide> c{0};
  for (const Wide a : drifts) c.push_back(c.back() + a);
  std::vector<Nystrom> known{{std::vector<Wide>(c.size(), 1), 1, 0}};
  const auto add = [&](Nystrom next) {
    if (next.degree < order) known.push_back(std::move(next));
  };
  for (std::size_t k = 0; k < known.size(); ++k) {
    const Nystrom one = known[k];
    Nystrom times_c = one;
    times_c.degree += 1;
    Nystrom twice{std::vector<Wide>(c.size(), 0),
                  one.factor / static_cast<Wide>((one.degree + 1) * (one.degree + 2)),
                  one.degree + 2};
    for (std::size_t i = 0; i < c.size(); ++i) {
      times_c.stages[i] *= c[i];
      for (std::size_t j = 0; j < i; ++j) {
        twice.stages[i] += kicks[j] * (c[i] - c[j]) * one.stages[j];
      }
    }
    add(times_c);
    add(twice);
    for (std::size_t l = 0; l <= k; ++l) {
      Nystrom product{one.stages, one.factor * known[l].factor, one.degree + known[l].degree};
      for (std::size_t i = 0; i < c.size(); ++i) product.stages[i] *= known[l].stages[i];
      if (known[l].degree > 1 && one.degree > 1) add(product);
    }
  }
  Wide worst = 0;
  for (const Nystrom& phi : known) {
    Wide sum = -phi.factor / static_cast<Wide>(phi.degree + 1);
    for (std::size_t i = 0; i < c.size(); ++i) sum += kicks[i] * phi.stages[i];
    worst = std::max(worst, std::abs(sum));
  }
  return worst;
}

TEST(BlanesMoan, meets_the_conditions_of_runge_kutta_nystrom_methods) {
  EXPECT_LT(nystrom_defect<hamotor::BlanesMoan4>(4), 1e-17L);
  EXPECT_LT(nystrom_defect<hamotor::BlanesMoan6>(6), 1e-17L);
  EXPECT_GT(nystrom_defect<hamotor::BlanesMoan4>(6), 1e-6L);
  EXPECT_GT(nystrom_defect<hamotor::BlanesMoan6>(8), 1e-9L);
}

/// Largest coefficient of Π exp(a_k A) exp(b_k B) − exp(A + B) over the words in A and B that
/// `counts(As, Bs)`: A and B are unrelated.
template <class Scheme, class Counts>
Wide two_flow_defect(int degree, Counts counts) {
  const auto [inner, outer] = Scheme::template weights<Wide>();
  std::vector<Word> words{{}};
  for (std::size_t k = 0; k < words.size(); ++k) {
    for (const int letter : {0, 1}) {
      if (static_cast<int>(words[k].size()) == degree) break;
      Word longer = words[k];
      longer.push_back(letter);
      words.push_back(longer);
    }
  }
  std::map<Word, Wide> product;
  product[{}] = 1;
  const auto multiply = [&](int letter, Wide step) {
    std::map<Word, Wide> next;
    for (const Word& word : words) {
      Wide sum = product[word];
      Wide factor = 1;
      Word head = word;
      for (int power = 1; !head.empty() && head.back() == letter; ++power) {
        head.pop_back();
        factor *= step / static_cast<Wide>(power);
        sum += factor * product[head];
      }
      next[word] = sum;
    }
    product = next;
  };
  for (std::size_t k = 0; k < inner.size(); ++k) {
    multiply(0, outer[k]);
    multiply(1, inner[k]);
  }
  multiply(0, outer.back());
  Wide worst = 0;
  for (const Word& word : words) {
    const auto inners = std::count(word.begin(), word.end(), 1);
    const auto size = static_cast<int>(word.size());
    if (!counts(size - static_cast<int>(inners), static_cast<int>(inners))) continue;
    Wide exact = 1;
    for (int k = 2; k <= size; ++k) exact /= static_cast<Wide>(k);
    worst = std::max(worst, std::abs(product[word] - exact));
  }
  return worst;
}

TEST(BlanesMoan, meets_the_conditions_of_two_flows_in_turn) {
  const auto all = [](int, int) { return true; };
  EXPECT_LT(two_flow_defect<hamotor::BlanesMoanFree4>(4, all), 1e-17L);
  EXPECT_LT(two_flow_defect<hamotor::BlanesMoanFree6>(6, all), 1e-17L);
  EXPECT_GT(two_flow_defect<hamotor::BlanesMoanFree4>(5, all), 1e-7L);
  EXPECT_GT(two_flow_defect<hamotor::BlanesMoanFree6>(7, all), 1e-8L);
}

TEST(Blanes864, is_of_order_8_6_and_4_in_powers_of_the_inner_flow) {
  const auto counts = [](int outers, int inners) {
    return outers + inners <= (inners < 2 ? 8 : inners == 2 ? 6 : 4);
  };
  EXPECT_LT(two_flow_defect<hamotor::Blanes864>(8, counts), 1e-17L);
  EXPECT_GT(two_flow_defect<hamotor::Blanes864>(5, [](int, int) { return true; }), 1e-6L);
}

TEST(Decimal, is_read_to_the_last_place) {
  EXPECT_EQ(hamotor::detail::decimal<double>("0.25"), 0.25);
  EXPECT_EQ(hamotor::detail::decimal<Wide>("-0.3"), -0.3L);
  EXPECT_NEAR(static_cast<double>(
                  hamotor::detail::decimal<Wide>("0.3141592653589793238462643383279502884197") -
                  0.3141592653589793238462643383279502884197L),
              0, 3e-20);
}

}  // namespace
