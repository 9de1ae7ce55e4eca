// The methods that a system can be stepped with.
#pragma once

#include <tuple>

#include "hamotor/adaptive.hpp"
#include "hamotor/free_body.hpp"
#include "hamotor/gauss.hpp"
#include "hamotor/moser_veselov.hpp"
#include "hamotor/rkmk.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/taylor.hpp"

namespace hamotor {

namespace detail {

template <class System>
struct Steppers {
  using type = std::tuple<Rkmk4<System>, Adaptive<System>, Adaptive<System, Rkmk87<System>>,
                          CommutatorFree4<System>, Rk4<System>, LieMidpoint<System>, Gauss4<System>,
                          Gauss6<System>, Gauss8<System>, Gauss12<System>, Gauss16<System>>;
};
template <SplitSystem System>
struct Steppers<System> {
  using type =
      std::tuple<Rkmk4<System>, Adaptive<System>, Adaptive<System, Rkmk87<System>>,
                 CommutatorFree4<System>, Rk4<System>, Splitting2<System>, Splitting4<System>,
                 Splitting6<System>, Splitting8<System>, Splitting10<System>, LieMidpoint<System>,
                 Gauss4<System>, Gauss6<System>, Gauss8<System>, Gauss12<System>, Gauss16<System>>;
};

template <class System>
struct RigidSteppers {
  using type = std::tuple<>;
};
template <RigidSystem System>
struct RigidSteppers<System> {
  using type = std::tuple<MoserVeselov<System, 2>>;
};
template <FreeSystem System>
struct RigidSteppers<System> {
  using type = std::tuple<MoserVeselov<System, 2>, MoserVeselov<System, 4>, MoserVeselov<System, 6>,
                          MoserVeselov<System, 8>, MoserVeselov<System, 10>, ClosedForm<System>>;
};

template <class System>
struct SeriesSteppers {
  using type = std::tuple<>;
};
template <AnalyticSystem System>
struct SeriesSteppers<System> {
  using type = std::tuple<Taylor<System>>;
};

}  // namespace detail

/// The steppers that a system can be stepped with.
template <class System>
using SteppersOf = decltype(std::tuple_cat(typename detail::Steppers<System>::type{},
                                           typename detail::RigidSteppers<System>::type{},
                                           typename detail::SeriesSteppers<System>::type{}));

}  // namespace hamotor
