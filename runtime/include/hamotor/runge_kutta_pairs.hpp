// Coefficients of explicit Runge–Kutta pairs: the method, and the embedded one that estimates its
// error.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "hamotor/splitting_schemes.hpp"

namespace hamotor {

namespace detail {

/// A rational coefficient.
struct Ratio {
  long long over;
  long long under;
};

/// The number.
template <class S>
[[nodiscard]] constexpr S number(const Ratio& x) noexcept {
  return x.over == 0 ? S(0) : S(x.over) / S(x.under);
}

/// A number written in decimals, [-]digits[.digits]; none is 0.
template <class S>
[[nodiscard]] constexpr S number(const char* decimals) noexcept {
  if (decimals == nullptr) return S(0);
  std::string_view text = decimals;
  const bool negative = text.front() == '-';
  if (negative) text.remove_prefix(1);
  S whole(0);
  while (!text.empty() && text.front() != '.') {
    whole = S(10) * whole + S(text.front() - '0');
    text.remove_prefix(1);
  }
  if (!text.empty()) whole = whole + decimal<S>(text);
  return negative ? -whole : whole;
}

template <class S, class Text, std::size_t count>
[[nodiscard]] constexpr std::array<S, count> numbers(const std::array<Text, count>& text) noexcept {
  std::array<S, count> result{};
  for (std::size_t k = 0; k < count; ++k) {
    result[k] = static_cast<S>(number<CoefficientScalar<S>>(text[k]));
  }
  return result;
}

}  // namespace detail

/// Dormand & Prince 1980, 5(4), with the continuous extension of order 4 (Hairer, Nørsett & Wanner
/// 1993, II.6).  The last stage is taken at the end of the step.
struct DormandPrince54 {
  static constexpr std::string_view name = "rkmk54";
  static constexpr int order = 5;
  /// Order of the embedded method.
  static constexpr int lower_order = 4;
  static constexpr std::size_t stages = 7;

  static constexpr std::array<std::array<detail::Ratio, stages>, stages> rows{{
      {},
      {{{1, 5}}},
      {{{3, 40}, {9, 40}}},
      {{{44, 45}, {-56, 15}, {32, 9}}},
      {{{19372, 6561}, {-25360, 2187}, {64448, 6561}, {-212, 729}}},
      {{{9017, 3168}, {-355, 33}, {46732, 5247}, {49, 176}, {-5103, 18656}}},
      {{{35, 384}, {0, 1}, {500, 1113}, {125, 192}, {-2187, 6784}, {11, 84}}},
  }};
  static constexpr std::array<detail::Ratio, stages> weights = rows[stages - 1];
  /// Weights of order 5 less those of order 4.
  static constexpr std::array<detail::Ratio, stages> error{
      {{71, 57600}, {0, 1}, {-71, 16695}, {71, 1920}, {-17253, 339200}, {22, 525}, {-1, 40}}};

  /// The weights that give the motion at the fraction `at` of the step.
  template <class S>
  [[nodiscard]] static constexpr std::array<S, stages> weights_at(const S& at) noexcept {
    constexpr std::array<detail::Ratio, stages> constant{{{-12793612615, 11282082432},
                                                          {0, 1},
                                                          {88272555100, 32700410799},
                                                          {-11083301675, 1880347072},
                                                          {759212249535, 199316789632},
                                                          {-1648467425, 822651844},
                                                          {74144470, 29380423}}};
    constexpr std::array<detail::Ratio, stages> linear{{{157015080, 11282082432},
                                                        {0, 1},
                                                        {-1570150800, 32700410799},
                                                        {785075400, 1880347072},
                                                        {-114463993320, 199316789632},
                                                        {389220480, 822651844},
                                                        {-8293050, 29380423}}};
    const auto b = detail::numbers<S>(weights);
    const auto c = detail::numbers<S>(constant);
    const auto d = detail::numbers<S>(linear);
    const S less = at - S(1);
    const S rise = at * at * (S(3) - (at + at));
    const S bump = at * at * less * less;
    std::array<S, stages> result{};
    for (std::size_t k = 0; k < stages; ++k) {
      result[k] = mul_add(rise, b[k], bump * mul_add(d[k], at, c[k]));
    }
    result[0] = result[0] + at * less * less;
    result[stages - 1] = result[stages - 1] + at * at * less;
    return result;
  }
};

/// Prince & Dormand 1981, 8(7)13M.  Published with 18 digits, the coefficients were continued by
/// Newton's method on the order conditions, the nodes as published.
struct PrinceDormand87 {
  static constexpr std::string_view name = "rkmk87";
  static constexpr int order = 8;
  /// Order of the embedded method.
  static constexpr int lower_order = 7;
  static constexpr std::size_t stages = 13;

  static constexpr std::array<std::array<const char*, stages>, stages> rows{{
      {},
      {{"0.055555555555555555555555555555555555555556"}},
      {{"0.020833333333333333333333333333333333333333", "0.0625"}},
      {{"0.03125", nullptr, "0.09375"}},
      {{"0.3125", nullptr, "-1.171875", "1.171875"}},
      {{"0.0375", nullptr, nullptr, "0.1875", "0.15"}},
      {{"0.047910137111111111111111111111111111111111", nullptr, nullptr,
        "0.112248712777777777777777777777777777777778",
        "-0.025505673777777777777777777777777777777778",
        "0.012846823888888888888888888888888888888889"}},
      {{"0.016917989787292279206355824572110158648294", nullptr, nullptr,
        "0.387848278486043201895835097290416844375182",
        "0.035977369851500334959091293954272766045494",
        "0.196970214215666056955356968399848883523334",
        "-0.172713852340501873016639184216648652592304"}},
      {{"0.069095753359192299993220629926967710087793", nullptr, nullptr,
        "-0.634247976728854141142449201528066841008848",
        "-0.161197575224604078023525940685016024053034",
        "0.138650309458825254357633674737487831050698",
        "0.940928614035756258358107221842893477898421",
        "0.211636326481943981855372117131902104763536"}},
      {{"0.183556996839045389643313531369319473637202", nullptr, nullptr,
        "-2.468768084315592520815688805005749331682886",
        "-0.291286887816300471239938509901764752542753",
        "-0.026473020233117368956106201605673870016256",
        "2.84783876419280052120198613065351697819442",
        "0.281387331469849792539403641826711782098071",
        "0.123744899863314657627030212663639720312201"}},
      {{"-1.215424817395888043853010786778246319055859", nullptr, nullptr,
        "16.672608665945772353893689220839381876987038",
        "0.915741828416818062495847602338140072249495",
        "-6.05660580435747079484663433828184316669006",
        "-16.003573594156178087724975248886865565343382",
        "14.84930308629766204553916511983132105303872",
        "-13.371575735289848871235013159178042470530905",
        "5.134182648179637780144333825268231855120862"}},
      {{"0.258860916438264281407973999698766925333201", nullptr, nullptr,
        "-4.774485785489205089535656693832549041771003",
        "-0.435093013777032514514165768519809117698614",
        "-3.049483332072241511125945294019366251827378",
        "5.577920039936099098336240549599548433293001",
        "6.155831589861040097491956292609242612786613",
        "-5.062104586736938347289620804233697479717994",
        "2.193926173180679040272461895671639169943151",
        "0.134627998659334944956755823026224749659023"}},
      {{"0.822427599626507473803152265633441671663717", nullptr, nullptr,
        "-11.658673257277664264582042656090287371250124",
        "-0.757622116690936244650796971461994000041174",
        "0.713973588159581549777315812300014192209858",
        "12.075774986890056736095295711277044946810494",
        "-2.12765911392040262421450071108145865971712",
        "1.990166207048955414114152054360660803905184",
        "-0.234286471544040310050418119109237140730942",
        "0.175898577707942269707842614171815557150106", nullptr}},
  }};
  static constexpr std::array<const char*, stages> weights{
      "0.041747491141530246283835333316127666991572",
      nullptr,
      nullptr,
      nullptr,
      nullptr,
      "-0.055452328611239302375368954810016239357918",
      "0.239312807201180096613388961511290911292884",
      "0.703510669403443005090794020333087775957806",
      "-0.759759613814460906626307467005027490504885",
      "0.660563030922286328113223476549659084574814",
      "0.158187482510123335349213379984395006849873",
      "-0.238109538752862796119115961903466786368628",
      "0.249999999999999993670337212023950070564482"};
  /// Weights of order 8 less those of order 7.
  static constexpr std::array<const char*, stages> error{
      "0.012194277465176748908876216691104517691383",
      nullptr,
      nullptr,
      nullptr,
      nullptr,
      "0.773153947876557711133455763389591234899764",
      "-0.071928092849938228963738515538880283616561",
      "-1.76383452119644391549330206428399187993312",
      "1.787182038027447767771169951394517941655395",
      "-0.782985552754488882244054601880642726137556",
      "0.078771886628996045830092041436704920252236",
      "-0.282553983197307240612836003232353795376023",
      "0.249999999999999993670337212023950070564482"};
};

}  // namespace hamotor
