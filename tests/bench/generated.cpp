// The generated kernels and the runtime's steppers.
#include "contest.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/systems.hpp"

namespace bench {

template <class S>
struct Generated {
  static constexpr const char* name = "generated";
  using Motion = pga3::Motor<S>;
  using Rate = pga3::se3::Rate<S>;
  using Momentum = pga3::se3::Momentum<S>;

  template <class Kind>
  [[nodiscard]] static auto make(Kind, const typename Kind::Exact& x) {
    return rounded<S>(x);
  }
  template <class Kind>
  [[nodiscard]] static auto make(kind::MatrixOn<Kind> kind, const pga3::Motor<Quad>& m) {
    return rounded<S>(matrix(kind, m));
  }
  [[nodiscard]] static Body<S> make(kind::Body, const Body<Quad>& x) {
    return {rounded<S>(x.motion), rounded<S>(x.momentum)};
  }
  template <class Kind>
  [[nodiscard]] static auto exact(Kind, const auto& x) {
    return x.template cast<Quad>();
  }
  [[nodiscard]] static Body<Quad> exact(kind::Body, const Body<S>& x) {
    return {x.motion.template cast<Quad>(), x.momentum.template cast<Quad>()};
  }

  [[nodiscard]] HAMOTOR_INLINE static Motion compose(const Motion& a, const Motion& b) {
    return gp(a, b);
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static auto move(Kind, const Motion& m, const auto& x) {
    return sandwich(m, x);
  }
  [[nodiscard]] HAMOTOR_INLINE static auto matrix(kind::MatrixOn<kind::Point>, const auto& m) {
    return point_matrix(m);
  }
  [[nodiscard]] HAMOTOR_INLINE static auto matrix(kind::MatrixOn<kind::Direction>, const auto& m) {
    return direction_matrix(m);
  }
  [[nodiscard]] HAMOTOR_INLINE static auto matrix(kind::MatrixOn<kind::Plane>, const auto& m) {
    return plane_matrix(m);
  }
  [[nodiscard]] HAMOTOR_INLINE static auto matrix(kind::MatrixOn<kind::Line>, const auto& m) {
    return bivector_matrix(m);
  }
  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static auto transform(Kind, const auto& a, const auto& x) {
    return pga3::transform(a, x);
  }
  template <class Kind>
  [[nodiscard]] static auto transform(Kind, const Motion& m, const auto& x) {
    return sandwich(m, x);
  }
  [[nodiscard]] HAMOTOR_INLINE static auto commutator(const pga3::Bivector<S>& a,
                                                      const pga3::Bivector<S>& b) {
    return pga3::commutator(a, b);
  }
  [[nodiscard]] HAMOTOR_INLINE static Momentum coadjoint(const Rate& w, const Momentum& mu) {
    return pga3::se3::coadjoint(w, mu);
  }
  [[nodiscard]] HAMOTOR_INLINE static Motion exp(const Rate& w) { return pga3::se3::exp(w); }
  [[nodiscard]] HAMOTOR_INLINE static Rate log(const Motion& m) { return pga3::se3::log(m); }
  [[nodiscard]] HAMOTOR_INLINE static Motion normalize(const Motion& m) {
    return pga3::normalize(m);
  }

  [[nodiscard]] HAMOTOR_INLINE static Body<S> slope(const Body<S>& x) {
    const Momentum& mu = x.momentum;
    const Rate w{mu.l23 * S(1 / moments[0]), mu.l31 * S(1 / moments[1]), mu.l12 * S(1 / moments[2]),
                 mu.p1 * S(1 / mass),        mu.p2 * S(1 / mass),        mu.p3 * S(1 / mass)};
    return {kinematics(x.motion, w), coadjoint(w, mu)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Body<S> add(const Body<S>& x, const S& h, const Body<S>& k) {
    return {mul_add(h, k.motion, x.motion), mul_add(h, k.momentum, x.momentum)};
  }
  [[nodiscard]] HAMOTOR_INLINE static Body<S> runge_kutta(const Body<S>& body) {
    return classical_runge_kutta<Generated, S>(body);
  }

  static constexpr auto split = hamotor::rotation_split(moments);
  using FreeBody = hamotor::FreeBody<pga3::SE3, S, split>;
  using System = hamotor::RigidBodies<std::tuple<FreeBody>>;
  static constexpr System system() {
    return System(std::tuple{FreeBody(S(mass), {S(moments[0]), S(moments[1]), S(moments[2])})});
  }
  template <class Stepper>
  [[nodiscard]] HAMOTOR_INLINE static Body<S> stepped(const Body<S>& body) {
    hamotor::StateOf<System> state{{body.motion}, {body.momentum}};
    Stepper stepper;
    stepper.do_step(system(), state, S(0), S(step_size));
    return {state.motors[0], state.momenta[0]};
  }
  [[nodiscard]] HAMOTOR_INLINE static Body<S> rkmk4(const Body<S>& body) {
    return stepped<hamotor::Rkmk4<System>>(body);
  }
  [[nodiscard]] HAMOTOR_INLINE static Body<S> splitting2(const Body<S>& body) {
    return stepped<hamotor::Splitting2<System>>(body);
  }
};

template <>
inline constexpr const char* name_in_lanes<Generated> = "generated, packs";

/// The matrix of a motor, made anew by each operation.
template <class S>
struct GeneratedConverted : Generated<S> {
  static constexpr const char* name = "generated, converted";

  template <class Kind>
  [[nodiscard]] HAMOTOR_INLINE static auto move(Kind, const pga3::Motor<S>& m, const auto& x) {
    return pga3::transform(Generated<S>::matrix(kind::MatrixOn<Kind>{}, m), x);
  }
};

/// The forms with the fewest operations, accurate where nothing is extreme.
template <class S>
struct GeneratedLean : Generated<S> {
  static constexpr const char* name = "generated, lean";
  using typename Generated<S>::Motion;
  using typename Generated<S>::Rate;

  [[nodiscard]] HAMOTOR_INLINE static Motion exp(const Rate& w) { return pga3::se3::exp_lean(w); }
  [[nodiscard]] HAMOTOR_INLINE static Rate log(const Motion& m) { return pga3::se3::log_lean(m); }
  [[nodiscard]] HAMOTOR_INLINE static Motion normalize(const Motion& m) {
    return pga3::normalize_lean(m);
  }
};

/// Runge–Kutta's method as the runtime's `Rk4` takes its steps, which holds a body in the world
/// from one to the next.
template <class S>
struct GeneratedStepper : Generated<S> {
  static constexpr const char* name = "generated, Rk4";
  using System = typename Generated<S>::System;
  using Stages = hamotor::detail::WorldStages<System>;
  using Carried = typename Stages::Carried;

  [[nodiscard]] static Carried make(kind::Body, const Body<Quad>& x) {
    return stages.carried({{x.motion.template cast<S>()}, {x.momentum.template cast<S>()}});
  }
  [[nodiscard]] static Body<Quad> exact(kind::Body, const Carried& x) {
    const auto state = stages.state(x);
    return {state.motors[0].template cast<Quad>(), state.momenta[0].template cast<Quad>()};
  }
  [[nodiscard]] HAMOTOR_INLINE static Carried runge_kutta(const Carried& body) {
    Carried stepped = body;
    static_cast<void>(stages.step(stepped));
    return stepped;
  }

 private:
  static inline const Stages stages{Generated<S>::system(), static_cast<S>(step_size)};
};

template <class Op>
Values reference(const Exact<typename Op::A>& a, const Exact<typename Op::B>& b) {
  return values(Op::template run<Generated<Quad>>(a, b));
}

template Values reference<operation::MotorProduct>(const pga3::Motor<Quad>&,
                                                   const pga3::Motor<Quad>&);
template Values reference<operation::MovePoint>(const pga3::Motor<Quad>&, const pga3::Point<Quad>&);
template Values reference<operation::MoveDirection>(const pga3::Motor<Quad>&,
                                                    const pga3::Direction<Quad>&);
template Values reference<operation::MovePlane>(const pga3::Motor<Quad>&, const pga3::Plane<Quad>&);
template Values reference<operation::MoveLine>(const pga3::Motor<Quad>&,
                                               const pga3::Bivector<Quad>&);
template Values reference<operation::TransformPoint>(const pga3::Motor<Quad>&,
                                                     const pga3::Point<Quad>&);
template Values reference<operation::TransformDirection>(const pga3::Motor<Quad>&,
                                                         const pga3::Direction<Quad>&);
template Values reference<operation::TransformPlane>(const pga3::Motor<Quad>&,
                                                     const pga3::Plane<Quad>&);
template Values reference<operation::TransformLine>(const pga3::Motor<Quad>&,
                                                    const pga3::Bivector<Quad>&);
template Values reference<operation::Commutator>(const pga3::Bivector<Quad>&,
                                                 const pga3::Bivector<Quad>&);
template Values reference<operation::Coadjoint>(const pga3::se3::Rate<Quad>&,
                                                const pga3::se3::Momentum<Quad>&);
template Values reference<operation::Exp>(const kind::Nothing&, const pga3::se3::Rate<Quad>&);
template Values reference<operation::Log>(const kind::Nothing&, const pga3::Motor<Quad>&);
template Values reference<operation::ExpLog>(const kind::Nothing&, const pga3::Motor<Quad>&);
template Values reference<operation::Normalize>(const kind::Nothing&, const pga3::Motor<Quad>&);
template Values reference<operation::RungeKutta>(const kind::Nothing&, const Body<Quad>&);
template Values reference<operation::Rkmk4>(const kind::Nothing&, const Body<Quad>&);
template Values reference<operation::Splitting2>(const kind::Nothing&, const Body<Quad>&);

void enter_generated() {
  enter<Generated>();
  enter_for<GeneratedConverted, operation::MovePoint>();
  enter_for<GeneratedConverted, operation::MoveDirection>();
  enter_for<GeneratedConverted, operation::MovePlane>();
  enter_for<GeneratedConverted, operation::MoveLine>();
  enter_for<GeneratedLean, operation::Exp>();
  enter_for<GeneratedLean, operation::Log>();
  enter_for<GeneratedLean, operation::ExpLog>();
  enter_for<GeneratedLean, operation::Normalize>();
  enter_for<GeneratedStepper, operation::RungeKutta>();
}

}  // namespace bench
