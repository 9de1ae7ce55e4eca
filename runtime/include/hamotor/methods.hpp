// The methods that a system can be stepped with.
#pragma once

#include <tuple>

#include "hamotor/adaptive.hpp"
#include "hamotor/field_pair.hpp"
#include "hamotor/free_body.hpp"
#include "hamotor/gauss.hpp"
#include "hamotor/moser_veselov.hpp"
#include "hamotor/rkmk.hpp"
#include "hamotor/state.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/taylor.hpp"

namespace hamotor {

namespace detail {

// Of steppers whose sums over steps are plain or compensated as asked; nothing asked, as is each
// one's own way.

template <class System, class Pair, class Coordinates, Summation... asked>
using AdaptivePair = Adaptive<System, ExplicitPair<System, Pair, Coordinates, asked...>>;

template <class System, class Pair, Summation... asked>
struct PairOf {
  using type = ExplicitPair<System, Pair, Components, asked...>;
};
template <SystemWithField System, class Pair, Summation... asked>
struct PairOf<System, Pair, asked...> {
  using type = FieldPair<System, Pair, asked...>;
};

template <class System, Summation... asked>
struct Steppers {
  using type = std::tuple<
      Rkmk4<System, asked...>, AdaptivePair<System, DormandPrince54, ExponentialChart, asked...>,
      AdaptivePair<System, PrinceDormand87, ExponentialChart, asked...>,
      CommutatorFree4<System, asked...>, Rk4<System, asked...>,
      Adaptive<System, typename PairOf<System, DormandPrince54, asked...>::type>,
      Adaptive<System, typename PairOf<System, PrinceDormand87, asked...>::type>,
      Gauss<System, 1, asked...>, Gauss<System, 2, asked...>, Gauss<System, 3, asked...>,
      Gauss<System, 4, asked...>, Gauss<System, 6, asked...>, Gauss<System, 8, asked...>>;
};

template <class System, Summation... asked>
struct SplitSteppers {
  using type = std::tuple<>;
};
template <SplitSystem System, Summation... asked>
struct SplitSteppers<System, asked...> {
  using type = std::tuple<Splitting<System, 2, asked...>, Splitting<System, 4, asked...>,
                          Splitting<System, 6, asked...>, Splitting<System, 8, asked...>,
                          Splitting<System, 10, asked...>>;
};

template <class System, Summation... asked>
struct RigidSteppers {
  using type = std::tuple<>;
};
template <RigidSystem System, Summation... asked>
struct RigidSteppers<System, asked...> {
  using type = std::tuple<MoserVeselov<System, 2, asked...>>;
};
template <FreeSystem System, Summation... asked>
struct RigidSteppers<System, asked...> {
  using type = std::tuple<MoserVeselov<System, 2, asked...>, MoserVeselov<System, 4, asked...>,
                          MoserVeselov<System, 6, asked...>, MoserVeselov<System, 8, asked...>,
                          MoserVeselov<System, 10, asked...>, ClosedForm<System>>;
};

template <class System, Summation... asked>
struct SeriesSteppers {
  using type = std::tuple<>;
};
template <AnalyticSystem System, Summation... asked>
struct SeriesSteppers<System, asked...> {
  using type = std::tuple<Taylor<System, asked...>>;
};

}  // namespace detail

/// The steppers that a system can be stepped with; `asked` is at most one `Summation`, for all that
/// have sums over steps.
template <class System, Summation... asked>
using SteppersOf =
    decltype(std::tuple_cat(typename detail::Steppers<System, asked...>::type{},
                            typename detail::SplitSteppers<System, asked...>::type{},
                            typename detail::RigidSteppers<System, asked...>::type{},
                            typename detail::SeriesSteppers<System, asked...>::type{}));

}  // namespace hamotor
