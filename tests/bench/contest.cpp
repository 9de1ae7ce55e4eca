#include "contest.hpp"

#include <cmath>

namespace bench {

Values values(const pga3::Motor<Quad>& m) {
  Values all = values(sandwich(m, pga3::Origin<Quad>{}));
  for (std::size_t k = 0; k < 3; ++k) {
    std::array<Quad, 3> axis{Quad(0), Quad(0), Quad(0)};
    axis[k] = Quad(1);
    for (const Quad x : values(sandwich(m, pga3::Direction<Quad>::from(axis)))) all.push_back(x);
  }
  return all;
}

Values values(const Body<Quad>& body) {
  Values all = values(body.motion);
  for (const Quad x : values(body.momentum)) all.push_back(x);
  return all;
}

template <class Element>
Element Source::element() {
  std::array<Quad, Element::size> x{};
  for (auto& component : x) {
    component = Quad(uniform(-1.0, 1.0));
  }
  return Element::from(x);
}

pga3::Motor<Quad> Source::make(kind::Motion) { return exp(make(kind::Rate{})); }
pga3::Point<Quad> Source::make(kind::Point) { return element<pga3::Point<Quad>>(); }
pga3::Direction<Quad> Source::make(kind::Direction) { return element<pga3::Direction<Quad>>(); }
pga3::Plane<Quad> Source::make(kind::Plane) { return element<pga3::Plane<Quad>>(); }
pga3::Bivector<Quad> Source::make(kind::Line) {
  const auto point = make(kind::Point{});
  return regressive(point, make(kind::Direction{}));
}
pga3::se3::Rate<Quad> Source::make(kind::Rate) {
  auto w = element<pga3::se3::Rate<Quad>>();
  const double angle = M_PI * std::pow(uniform(0.0, 1.0), 0.8);
  const Quad factor = Quad(angle) / sqrt(w.w23 * w.w23 + w.w31 * w.w31 + w.w12 * w.w12);
  w.w23 *= factor;
  w.w31 *= factor;
  w.w12 *= factor;
  return w;
}
pga3::Bivector<Quad> Source::make(kind::Bivector) {
  return pga3::Bivector<Quad>::from(make(kind::Rate{}).components());
}
pga3::se3::Momentum<Quad> Source::make(kind::Momentum) {
  return element<pga3::se3::Momentum<Quad>>();
}
Body<Quad> Source::make(kind::Body) {
  const auto motion = make(kind::Motion{});
  return {motion, make(kind::Momentum{})};
}

double relative_difference(const Values& a, const Values& b) {
  Quad difference(0);
  Quad size(0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Quad d = abs(a[i] - b[i]);
    if (!(d <= difference)) difference = d;
    if (abs(b[i]) > size) size = abs(b[i]);
  }
  return static_cast<double>(difference / size);
}

}  // namespace bench
