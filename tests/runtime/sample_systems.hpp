// Systems and states that several tests share: each group, free and forced, one body and two.
#pragma once

#include <array>
#include <cmath>
#include <tuple>

#include "hamotor/pga2/se2.hpp"
#include "hamotor/pga3/se3.hpp"
#include "hamotor/pga3/so3.hpp"
#include "hamotor/systems.hpp"

namespace sample {

using hamotor::FreeBody;
using hamotor::PivotedBody;
using hamotor::RestLength;
using hamotor::RigidBodies;
using hamotor::rotation_split;
using hamotor::SpringBetween;
using hamotor::SpringToWorld;
using hamotor::UniformGravity;
using hamotor::pga2::SE2;
using hamotor::pga3::SE3;
using hamotor::pga3::SO3;

inline constexpr std::array<double, 3> moments{0.4, 0.7, 0.9};
inline constexpr std::array<double, 3> other_moments{0.5, 0.3, 0.5};

template <class S>
constexpr std::array<S, 3> in(const std::array<double, 3>& x) {
  return {S(x[0]), S(x[1]), S(x[2])};
}

template <class S = double>
constexpr auto body() {
  return FreeBody<SE3, S, rotation_split(moments)>(S(1.5), in<S>(moments));
}

template <class S = double>
constexpr auto symmetric_body() {
  return FreeBody<SE3, S, rotation_split(other_moments)>(S(0.8), in<S>(other_moments));
}

template <class S = double>
constexpr auto plate() {
  return FreeBody<SE2, S>(S(1.2), {S(0.3)});
}

template <class S = double>
constexpr auto top() {
  return PivotedBody<SO3, S, rotation_split(moments)>(
      S(1.1), in<S>(moments), {S(0.2), S(-0.1), S(0.5)}, {S(0.3), S(-0.4), S(0.2)});
}

template <class S = double>
constexpr auto free_se3() {
  return RigidBodies{std::tuple{body<S>()}};
}

template <class S = double>
constexpr auto free_so3() {
  return RigidBodies{std::tuple{top<S>()}};
}

template <class S = double>
constexpr auto free_se2() {
  return RigidBodies{std::tuple{plate<S>()}};
}

template <class S = double>
constexpr auto forced_se3() {
  return RigidBodies{
      std::tuple{body<S>()},
      std::tuple{UniformGravity<SE3, S>{{S(0.3), S(0), S(-0.98)}},
                 SpringToWorld<0, SE3, S>{.at = {S(0.3), S(-0.2), S(0.5)},
                                          .anchor = {S(0.2), S(0.1), S(2)},
                                          .stiffness = S(6),
                                          .rest_length = S(0.8)},
                 SpringToWorld<0, SE3, S, RestLength::zero>{.at = {S(-0.1), S(0.4), S(0)},
                                                            .anchor = {S(1), S(-1), S(0)},
                                                            .stiffness = S(2),
                                                            .rest_length = S(0)}}};
}

template <class S = double>
constexpr auto forced_so3() {
  return RigidBodies{std::tuple{top<S>()},
                     std::tuple{UniformGravity<SO3, S>{{S(0), S(0.5), S(-2.5)}},
                                SpringToWorld<0, SO3, S>{.at = {S(0.1), S(0.3), S(0.4)},
                                                         .anchor = {S(1), S(0.2), S(0.7)},
                                                         .stiffness = S(3),
                                                         .rest_length = S(0.4)}}};
}

template <class S = double>
constexpr auto forced_se2() {
  return RigidBodies{std::tuple{plate<S>()},
                     std::tuple{UniformGravity<SE2, S>{{S(0.1), S(-0.98)}},
                                SpringToWorld<0, SE2, S>{.at = {S(-0.2), S(0.1)},
                                                         .anchor = {S(0.5), S(1.5)},
                                                         .stiffness = S(6),
                                                         .rest_length = S(0.3)}}};
}

template <class S = double>
constexpr auto two_bodies_se3() {
  return RigidBodies{
      std::tuple{body<S>(), symmetric_body<S>()},
      std::tuple{SpringBetween<0, 1, SE3, S>{.at_one = {S(0.3), S(0), S(0.1)},
                                             .at_two = {S(0), S(0.2), S(-0.1)},
                                             .stiffness = S(5),
                                             .rest_length = S(0.4)},
                 SpringBetween<1, 0, SE3, S, RestLength::zero>{.at_one = {S(0), S(0), S(0.3)},
                                                               .at_two = {S(0.1), S(0.2), S(0)},
                                                               .stiffness = S(1.5),
                                                               .rest_length = S(0)}}};
}

template <class S = double>
constexpr auto two_bodies_se2() {
  return RigidBodies{std::tuple{plate<S>(), FreeBody<SE2, S>(S(0.7), {S(0.1)})},
                     std::tuple{SpringBetween<0, 1, SE2, S>{.at_one = {S(0.3), S(0)},
                                                            .at_two = {S(0), S(0.2)},
                                                            .stiffness = S(5),
                                                            .rest_length = S(0.4)}}};
}

inline constexpr std::array<double, 3> top_moments{0.6, 0.6, 0.4};
inline constexpr std::array<std::array<double, 3>, 1> on_its_axis{{{0, 0, 0.5}}};

/// A top on its tip in a uniform field.
template <class S = double>
constexpr auto symmetric_top() {
  return RigidBodies{
      std::tuple{PivotedBody<SO3, S, rotation_split(top_moments, on_its_axis)>(
          S(1.1), in<S>(top_moments), in<S>(on_its_axis[0]), {S(0.3), S(-0.4), S(0.2)})},
      std::tuple{UniformGravity<SO3, S>{{S(0.4), S(0.5), S(-2.5)}}}};
}

/// The same without what makes it a top: its spin and Rᵀg are stepped with everything else.
template <class S = double>
constexpr auto symmetric_body_on_a_pivot() {
  return RigidBodies{
      std::tuple{PivotedBody<SO3, S, rotation_split(top_moments)>(
          S(1.1), in<S>(top_moments), in<S>(on_its_axis[0]), {S(0.3), S(-0.4), S(0.2)})},
      std::tuple{UniformGravity<SO3, S>{{S(0.4), S(0.5), S(-2.5)}}}};
}

/// A symmetric body that hangs by its axis from a spring.
template <class S = double>
constexpr auto spinning_pendulum() {
  return RigidBodies{
      std::tuple{
          FreeBody<SE3, S, rotation_split(top_moments, on_its_axis)>(S(1.1), in<S>(top_moments))},
      std::tuple{UniformGravity<SE3, S>{{S(0.3), S(0), S(-0.98)}},
                 SpringToWorld<0, SE3, S>{.at = hamotor::point<SE3>(in<S>(on_its_axis[0])),
                                          .anchor = {S(0.2), S(0.1), S(2)},
                                          .stiffness = S(6),
                                          .rest_length = S(0.8)}}};
}

/// A free body that a hundredth makes asymmetric.
template <class S = double>
constexpr auto nearly_symmetric_so3() {
  constexpr std::array<double, 3> moments_of_it{0.5, 0.505, 0.9};
  return RigidBodies{std::tuple{PivotedBody<SO3, S, rotation_split(moments_of_it)>(
      S(1), in<S>(moments_of_it), {S(0), S(0), S(0)}, {S(0), S(0), S(0)})}};
}

/// A state with nothing special about it.
template <class System>
hamotor::StateOf<System> generic_state(const System&) {
  using G = typename System::Group;
  using S = typename System::Scalar;
  hamotor::StateOf<System> state{};
  double value = 0.37;
  const auto next = [&] {
    value = std::fmod(value * 3.7 + 0.61, 2.0);
    return S(value - 1);
  };
  for (std::size_t i = 0; i < System::bodies; ++i) {
    std::array<S, static_cast<std::size_t>(G::dimension)> rate{};
    for (auto& x : rate) x = next();
    state.motors[i] = exp(G::template Rate<S>::from(rate));
    for (auto& x : rate) x = next();
    state.momenta[i] = G::template Momentum<S>::from(rate);
  }
  return state;
}

/// Largest difference between two values' components.
template <class T>
double distance(const T& a, const T& b) {
  double largest = 0;
  const auto x = a.components();
  const auto y = b.components();
  for (std::size_t k = 0; k < x.size(); ++k) {
    largest = std::max(largest, std::abs(static_cast<double>(x[k] - y[k])));
  }
  return largest;
}

/// Largest difference between two states' components.
template <class G, std::size_t N, class S>
double distance(const hamotor::State<G, N, S>& a, const hamotor::State<G, N, S>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < N; ++i) {
    largest = std::max(largest, distance(a.motors[i], b.motors[i]));
    largest = std::max(largest, distance(a.momenta[i], b.momenta[i]));
  }
  return largest;
}

/// Σ M μ M~ over the bodies.
template <class G, std::size_t N, class S>
typename G::template Momentum<S> spatial_momentum(const hamotor::State<G, N, S>& state) {
  auto sum = Ad_star_inverse(state.motors[0], state.momenta[0]);
  for (std::size_t i = 1; i < N; ++i) {
    sum = sum + Ad_star_inverse(state.motors[i], state.momenta[i]);
  }
  return sum;
}

}  // namespace sample
