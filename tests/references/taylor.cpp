// Reference solutions of free bodies and tops by Taylor series in 60 digits.
//
//   g++ -std=c++20 -O2 tests/references/taylor.cpp -o taylor && ./taylor P2
//
// prints tests/references/P2.json.  A step is a polynomial of order 44; it is all done again with
// order 36 and half the step, and the largest difference of the two is printed with the result.
#include <array>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cstdio>
#include <iomanip>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

using Number = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<60>,
                                             boost::multiprecision::et_off>;
using State = std::array<Number, 7>;  // quaternion (w, x, y, z), body rates

struct Problem {
  int kind;  // 0 free, 1 top
  std::array<double, 3> J;
  std::array<double, 4> q0;
  std::array<double, 3> w0;
  double T, m, g, l;
  double step;
};

const std::map<std::string, Problem> problems = {
    {"P1", {0, {1, 2, 3}, {1, 0, 0, 0}, {0.002, 2, 0.002}, 100, 1, 9.81, 0.5, 0.05}},
    {"P2", {0, {1, 1.0001, 1.9}, {1, 0, 0, 0}, {0.3, 0.2, 60}, 100, 1, 9.81, 0.5, 0.02}},
    {"P3",
     {1,
      {0.3, 0.3, 0.05},
      {0.98877107793604224, 0.14943813247359922, 0, 0},
      {0, 0, 40},
      20,
      1,
      9.81,
      0.5,
      0.02}},
    {"P3b+",
     {1,
      {0.3, 0.3, 0.05},
      {0.9999875000260416, 0.004999979166692708, 0, 0},
      {0, 0, 49},
      20,
      1,
      9.81,
      0.5,
      0.02}},
    {"P3b-",
     {1,
      {0.3, 0.3, 0.05},
      {0.9999875000260416, 0.004999979166692708, 0, 0},
      {0, 0, 48},
      20,
      1,
      9.81,
      0.5,
      0.02}},
};

class Series {
 public:
  Series(const Problem& p, int order) : p_(p), order_(order), c_(7) {
    for (auto& c : c_) c.resize(static_cast<std::size_t>(order) + 1);
  }

  // Coefficient k + 1 of each variable from those up to k.
  State step(const State& start, const Number& h) {
    for (std::size_t v = 0; v < 7; ++v) c_[v][0] = start[v];
    const Number J1 = p_.J[0], J2 = p_.J[1], J3 = p_.J[2];
    const Number lever = p_.kind == 1 ? Number(p_.m) * p_.g * p_.l : Number(0);
    for (int k = 0; k < order_; ++k) {
      const auto x = [&](int a, int b) { return product(a, b, k); };
      const State rate = {
          (-x(1, 4) - x(2, 5) - x(3, 6)) / 2,
          (x(0, 4) + x(2, 6) - x(3, 5)) / 2,
          (x(0, 5) + x(3, 4) - x(1, 6)) / 2,
          (x(0, 6) + x(1, 5) - x(2, 4)) / 2,
          ((J2 - J3) * x(5, 6) + 2 * lever * (x(2, 3) + x(0, 1))) / J1,
          ((J3 - J1) * x(6, 4) - 2 * lever * (x(1, 3) - x(0, 2))) / J2,
          (J1 - J2) * x(4, 5) / J3,
      };
      for (std::size_t v = 0; v < 7; ++v)
        c_[v][static_cast<std::size_t>(k) + 1] = rate[v] / (k + 1);
    }
    State end;
    for (std::size_t v = 0; v < 7; ++v) {
      Number sum = 0;
      for (auto i = c_[v].size(); i-- > 0;) sum = sum * h + c_[v][i];
      end[v] = sum;
    }
    return end;
  }

 private:
  Number product(int a, int b, int k) const {
    const auto& one = c_[static_cast<std::size_t>(a)];
    const auto& other = c_[static_cast<std::size_t>(b)];
    Number sum = 0;
    for (int i = 0; i <= k; ++i) {
      sum += one[static_cast<std::size_t>(i)] * other[static_cast<std::size_t>(k - i)];
    }
    return sum;
  }

  const Problem& p_;
  int order_;
  std::vector<std::vector<Number>> c_;
};

Number energy(const Problem& p, const State& x) {
  Number sum = 0;
  for (std::size_t i = 0; i < 3; ++i) sum += Number(p.J[i]) * x[4 + i] * x[4 + i] / 2;
  if (p.kind == 1) {
    const Number up = x[0] * x[0] - x[1] * x[1] - x[2] * x[2] + x[3] * x[3];
    sum += Number(p.m) * p.g * p.l * up;
  }
  return sum;
}

std::vector<State> solve(const Problem& p, int order, double step) {
  State x;
  Number norm = 0;
  for (const double q : p.q0) norm += Number(q) * q;
  for (std::size_t i = 0; i < 4; ++i) x[i] = Number(p.q0[i]) / sqrt(norm);
  for (std::size_t i = 0; i < 3; ++i) x[4 + i] = p.w0[i];
  Series series(p, order);
  std::vector<State> found = {x};
  const auto steps = static_cast<long>(p.T / 10 / step + 0.5);
  const Number h = Number(p.T) / 10 / steps;
  for (int checkpoint = 0; checkpoint < 10; ++checkpoint) {
    for (long i = 0; i < steps; ++i) x = series.step(x, h);
    found.push_back(x);
  }
  return found;
}

std::string text(const Number& x, int digits = 40) {
  std::ostringstream out;
  out << std::scientific << std::setprecision(digits) << x;
  return '"' + out.str() + '"';
}

std::string shown(double x) {
  std::ostringstream out;
  out << std::setprecision(17) << x;
  return out.str();
}

template <class Values>
std::string list(const Values& values) {
  std::string all;
  for (const double x : values) all += (all.empty() ? "" : ",") + shown(x);
  return '[' + all + ']';
}

int main(int count, char** words) {
  const auto found = problems.find(count > 1 ? words[1] : "");
  if (found == problems.end()) {
    std::cerr << "usage: taylor P1|P2|P3|P3b+|P3b-\n";
    return 2;
  }
  const Problem& p = found->second;
  const auto states = solve(p, 44, p.step);
  const auto again = solve(p, 36, p.step / 2);
  Number apart = 0;
  for (std::size_t i = 0; i < states.size(); ++i) {
    for (std::size_t v = 0; v < 7; ++v) {
      const Number distance = abs(states[i][v] - again[i][v]);
      if (distance > apart) apart = distance;
    }
  }
  const Number e0 = energy(p, states.front());
  std::cout << "{\n \"problem\":\"" << found->first << "\",\n"
            << " \"method\":\"Taylor order 44, cpp_bin_float 60 digits, h=" << p.step
            << "; cross-check order 36 at h/2\",\n"
            << " \"crosscheck_max_abs_diff\":" << text(apart, 3) << ",\n"
            << " \"energy0\":" << text(e0) << ",\n"
            << " \"energyT_minus_energy0\":" << text(energy(p, states.back()) - e0, 3) << ",\n"
            << " \"params\":{\"kind\":" << p.kind << ",\"J\":" << list(p.J)
            << ",\"q0\":" << list(p.q0) << ",\"w0\":" << list(p.w0) << ",\"T\":" << p.T
            << ",\"m\":" << p.m << ",\"g\":" << shown(p.g) << ",\"l\":" << p.l << "},\n"
            << " \"checkpoints\":[\n";
  for (std::size_t i = 1; i < states.size(); ++i) {
    const State& x = states[i];
    std::cout << "  {\"t\":" << p.T / 10 * static_cast<double>(i) << ",\"q\":[" << text(x[0]) << ','
              << text(x[1]) << ',' << text(x[2]) << ',' << text(x[3]) << "],\"w\":[" << text(x[4])
              << ',' << text(x[5]) << ',' << text(x[6]) << "]}"
              << (i + 1 < states.size() ? ",\n" : "\n");
  }
  std::cout << " ]\n}\n";
  return 0;
}
