// Coefficients of symmetric splittings: kick b₀h, free motion a₁h, kick b₁h, …, free motion a_s h,
// kick b_s h, with a and b the same from both ends.
//
// Tables hold one half in 40 digits, without the last distinct number, which follows from
// Σ a = Σ b = 1.  Published with 15 to 26 digits, they were continued by Newton's method on their
// order conditions.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <type_traits>

#include "hamotor/scalar.hpp"

namespace hamotor {

namespace detail {

/// The scalar in which coefficients for S are found: at least long double.
template <class S>
using CoefficientScalar =
    std::conditional_t<(scalar::Limits<S>::digits < scalar::Limits<long double>::digits),
                       long double, S>;

/// A number written as [-]0.digits, to the last place of S or better.
template <class S>
[[nodiscard]] constexpr S decimal(std::string_view text) noexcept {
  S value(0);
  while (text.back() != '.') {
    value = (value + S(text.back() - '0')) / S(10);
    text.remove_suffix(1);
  }
  return text.front() == '-' ? -value : value;
}

/// `count` numbers, the same from both ends, with sum 1.
template <class S, std::size_t count, std::size_t given>
[[nodiscard]] constexpr std::array<S, count> symmetric_weights(
    const std::array<std::string_view, given>& first) noexcept {
  static_assert(given == (count - 1) / 2);
  std::array<S, count> weights{};
  S rest = count % 2 == 1 ? S(1) : S(1) / S(2);
  for (std::size_t k = 0; k < given; ++k) {
    weights[k] = weights[count - 1 - k] = decimal<S>(first[k]);
    rest = rest - (count % 2 == 1 ? weights[k] + weights[k] : weights[k]);
  }
  weights[given] = weights[count - 1 - given] = rest;
  return weights;
}

}  // namespace detail

/// a and b of a splitting.
template <class S, std::size_t stages>
struct SplittingWeights {
  std::array<S, stages> drifts;
  std::array<S, stages + 1> kicks;
};

/// The composition of symmetric maps of order 2 with steps γ₁h, …, γ_s h: right for every free
/// motion that is itself symmetric, exact or not.
template <class Steps>
struct Composition : Steps {
  static constexpr std::size_t stages = 2 * Steps::steps.size() + 1;

  template <class S>
  [[nodiscard]] static constexpr SplittingWeights<S, stages> weights() noexcept {
    const auto steps = detail::symmetric_weights<S, stages>(Steps::steps);
    SplittingWeights<S, stages> result{steps, {}};
    for (std::size_t k = 0; k < stages; ++k) {
      result.kicks[k] = result.kicks[k] + steps[k] / S(2);
      result.kicks[k + 1] = result.kicks[k + 1] + steps[k] / S(2);
    }
    return result;
  }
};

/// Strang 1968.
struct Strang {
  static constexpr int order = 2;
  static constexpr std::array<std::string_view, 0> steps{};
};

/// Suzuki 1990: 1/(4 − ∛4).
struct Suzuki4 {
  static constexpr int order = 4;
  static constexpr std::array<std::string_view, 2> steps{
      "0.4144907717943757371423540628607614957118", "0.4144907717943757371423540628607614957118"};
};

/// Kahan & Li 1997, nine maps (s9odr6a).
struct KahanLi6 {
  static constexpr int order = 6;
  static constexpr std::array<std::string_view, 4> steps{
      "0.3921614440073141392792505574226714038049", "0.3325991367893594385997486375000496468816",
      "-0.7062461725576393598099648195492564593955", "0.08221359629355080023149044810205633110329"};
};

/// Kahan & Li 1997, seventeen maps (s17odr8a).
struct KahanLi8 {
  static constexpr int order = 8;
  static constexpr std::array<std::string_view, 8> steps{
      "0.1302024830888900808788176320967005223572",  "0.5611629817751083845619644077001505672662",
      "-0.3894749626448472864080785982352483888361", "0.1588419065551556008962107457071524814121",
      "-0.3959038941332375773362315393479389360268", "0.184539640978315707091832541533375462819",
      "0.2583743876863220472939791099949394718131",  "0.2950117236093102988709662402182281129765"};
};

/// Sofroniou & Spaletta 2005, thirty-five maps.
struct SofroniouSpaletta10 {
  static constexpr int order = 10;
  static constexpr std::array<std::string_view, 17> steps{
      "0.07879572252168641926390767933828960666553",
      "0.3130961034151085277648124719202568214618",
      "0.02791838323507806610952027326594944750871",
      "-0.2295928415939070941512133968011227048369",
      "0.1309620610771648631746568592921583635494",
      "-0.2697334056545107143446097322172866236481",
      "0.07497334315589143566613710563905871350376",
      "0.1119934239998102048895750807372699052773",
      "0.366133449546226751193148123537146946009",
      "-0.3991056301360358978786298105840155568961",
      "0.1030873985274710773158027699945038722844",
      "0.4114308739558902378207041189774777868979",
      "-0.004866360583135261762195659307742409124724",
      "-0.3920333537086399064480819364299801416297",
      "0.05194250296244964703718290483140424314726",
      "0.05066509075992449633587434250969487394104",
      "0.04967437063972987905456880066666479460188"};
};

/// Two flows in turn, whatever they are, order 4, six parts (Blanes & Moan 2002, S₆).
struct BlanesMoanFree4 {
  static constexpr int order = 4;
  static constexpr std::size_t stages = 6;

  template <class S>
  [[nodiscard]] static constexpr SplittingWeights<S, stages> weights() noexcept {
    return {detail::symmetric_weights<S, 6>(
                std::array<std::string_view, 2>{"0.2095151066133620212740726400295010169021",
                                                "-0.1438517731798180082751150578565277256482"}),
            detail::symmetric_weights<S, 7>(
                std::array<std::string_view, 3>{"0.07920369643119566943366349588826887330802",
                                                "0.3531729060497739884810613115731210565304",
                                                "-0.04206508035771953536811029830251703872041"})};
  }
};

/// Two flows in turn, whatever they are, order 6, ten parts (Blanes & Moan 2002, S₁₀).
struct BlanesMoanFree6 {
  static constexpr int order = 6;
  static constexpr std::size_t stages = 10;

  template <class S>
  [[nodiscard]] static constexpr SplittingWeights<S, stages> weights() noexcept {
    return {detail::symmetric_weights<S, 10>(
                std::array<std::string_view, 4>{"0.1488164479010432319209010055355775888774",
                                                "-0.1323858657677836474488454265989399215745",
                                                "0.06730760469218445815025789659260104689936",
                                                "0.4326664025781735975276679708835452980582"}),
            detail::symmetric_weights<S, 11>(
                std::array<std::string_view, 5>{"0.05026276440039268602122165440207410940601",
                                                "0.4135143004283438150630637201338844389753",
                                                "0.04507988979439806296889705212451347116172",
                                                "-0.1880548538195689147991284889188705424878",
                                                "0.5419606784507801348314147409330724963482"})};
  }
};

/// Two flows in turn of which the inner is ε times the outer: error O(ε h⁸ + ε² h⁶ + ε³ h⁴), seven
/// parts (Blanes, Casas, Farrés, Laskar, Makazaga & Murua 2013, ABA864; the theory is McLachlan's
/// of 1995).
struct Blanes864 {
  static constexpr int order = 4;
  static constexpr std::size_t stages = 7;

  template <class S>
  [[nodiscard]] static constexpr SplittingWeights<S, stages> weights() noexcept {
    return {detail::symmetric_weights<S, 7>(
                std::array<std::string_view, 3>{"0.1830836874721972219617037571664302910726",
                                                "0.3107828598985748695075222910542627963752",
                                                "-0.02656461851195880069721213791649875926633"}),
            detail::symmetric_weights<S, 8>(
                std::array<std::string_view, 3>{"0.0711334264982231177779387300061549964174",
                                                "0.2411534279566400987364877953262896496178",
                                                "0.5214117617728147892121360780679942299914"})};
  }
};

/// Runge–Kutta–Nyström splitting of order 4 with six kicks: for an exact free motion with kinetic
/// energy quadratic in the momenta, where {U, {U, {U, T}}} = 0 (Blanes & Moan 2002, SRKN⁶ᵦ).
struct BlanesMoan4 {
  static constexpr int order = 4;
  static constexpr std::size_t stages = 6;

  template <class S>
  [[nodiscard]] static constexpr SplittingWeights<S, stages> weights() noexcept {
    return {detail::symmetric_weights<S, 6>(
                std::array<std::string_view, 2>{"0.2452989571842711626039324260014008804072",
                                                "0.604872665711079974960892697643076245221"}),
            detail::symmetric_weights<S, 7>(
                std::array<std::string_view, 3>{"0.08298440641740501883834747894225011249475",
                                                "0.3963098014983680770949115282636867393961",
                                                "-0.03905630492234843517086529076537924228761"})};
  }
};

/// The same of order 6, fourteen kicks between fifteen free motions (Blanes & Moan 2002, SRKN¹⁴ₐ).
struct BlanesMoan6 {
  static constexpr int order = 6;
  static constexpr std::size_t stages = 15;

  template <class S>
  [[nodiscard]] static constexpr SplittingWeights<S, stages> weights() noexcept {
    return {detail::symmetric_weights<S, 15>(
                std::array<std::string_view, 7>{"0.03785931984061094144702117903801110403198",
                                                "0.1026356331024365528470822509403380612759",
                                                "-0.02586788826655833316394696035936533855914",
                                                "0.3142414030714464341471425357032840110789",
                                                "-0.1301444595174151138496150785400285161721",
                                                "0.106417700369541368022280139285383456948",
                                                "-0.008794243128510204394069428427659903032335"}),
            detail::symmetric_weights<S, 16>(std::array<std::string_view, 7>{
                "0.0", "0.09171915262446201798118322826486834024983",
                "0.1839831700050048984914765646763433380067",
                "-0.05653436583288910439527704484808994928962",
                "0.004914688774711885640205616455015724404118",
                "0.1437611271683616823873745299867722104871",
                "0.3285676937468041402004812576270353400948"})};
  }
};

}  // namespace hamotor
