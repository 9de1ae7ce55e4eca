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
  static constexpr std::string_view name_on_components = "rk54";
  static constexpr int order = 5;
  /// Order of the embedded method.
  static constexpr int lower_order = 4;
  static constexpr std::size_t stages = 7;
  /// Of the continuous extension, the stages that it takes, and the one at the end of the step.
  static constexpr int dense_order = 4;
  static constexpr std::size_t dense_stages = stages;
  static constexpr std::size_t end_stage = 6;

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

  /// What `continuous_weights` adds, by power of the fraction.
  static constexpr std::array<std::array<detail::Ratio, dense_stages>, 2> bumps{{
      {{{-12793612615, 11282082432},
        {0, 1},
        {88272555100, 32700410799},
        {-11083301675, 1880347072},
        {759212249535, 199316789632},
        {-1648467425, 822651844},
        {74144470, 29380423}}},
      {{{157015080, 11282082432},
        {0, 1},
        {-1570150800, 32700410799},
        {785075400, 1880347072},
        {-114463993320, 199316789632},
        {389220480, 822651844},
        {-8293050, 29380423}}},
  }};
};

/// Prince & Dormand 1981, 8(7)13M.  Published with 18 digits, the coefficients were continued by
/// Newton's method on the order conditions, the nodes as published.
///
/// The continuous extension is ours, by Enright, Jackson, Nørsett & Thomsen's bootstrapping (1986):
/// the end of the step, one stage where weights of order 5 lead, and three of order 6.  Rows and
/// weights are the smallest that meet the order conditions, the nodes those of the least error
/// found.
struct PrinceDormand87 {
  static constexpr std::string_view name = "rkmk87";
  static constexpr std::string_view name_on_components = "rk87";
  static constexpr int order = 8;
  /// Order of the embedded method.
  static constexpr int lower_order = 7;
  static constexpr std::size_t stages = 13;
  /// Of the continuous extension, the stages that it takes, and the one at the end of the step.
  static constexpr int dense_order = 7;
  static constexpr std::size_t dense_stages = 18;
  static constexpr std::size_t end_stage = 13;

  static constexpr std::array<std::array<const char*, dense_stages>, dense_stages> rows{{
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
      {{"0.041747491141530246283835333316127666991572", nullptr, nullptr, nullptr, nullptr,
        "-0.055452328611239302375368954810016239357918",
        "0.239312807201180096613388961511290911292884",
        "0.703510669403443005090794020333087775957806",
        "-0.759759613814460906626307467005027490504885",
        "0.660563030922286328113223476549659084574814",
        "0.158187482510123335349213379984395006849873",
        "-0.238109538752862796119115961903466786368628",
        "0.249999999999999993670337212023950070564482"}},
      {{"0.041996746507657809180098736293555446565372", nullptr, nullptr, nullptr, nullptr,
        "0.157149419163191653387380881287116857120397",
        "0.230286146656775990258562919991415097828823",
        "0.092905175318928539634779219399865287493179",
        "0.031617738797123065781221260502789374324274",
        "-0.002821725826501110246594758079046041015667",
        "-0.0034337136207694105379636328912381099464",
        "0.000766737667864487514171791165180695876674",
        "0.000766737667864487514171791165180695876674",
        "0.000766737667864487514171791165180695876674"}},
      {{"0.045217036552167257333719623938536274820702", nullptr, nullptr, nullptr, nullptr,
        "0.16996901472762001990509424974292622609036",
        "0.219601325414825773795469649966494831640251",
        "0.130842090733494571511071336580850620045655",
        "0.097836655659864439398303046214419096402632",
        "0.079472939863500827195065773317772562420747",
        "-0.009094542108729804402470370923483391055079",
        "-0.02388829616634624638437593439545926558065",
        "-0.016173567036646088532868169767323269813269",
        "0.044241210162274048792820123878144355959917",
        "-0.088023867802024798611829328552878040931266"}},
      {{"0.050779777394443618548325508745985820554624", nullptr, nullptr, nullptr, nullptr,
        "0.000748240123701269038791147773760290400322",
        "0.178157802789015295346136315546835462382563",
        "-0.013101262132275624118917845110159369625401",
        "-0.019271305878416708508229105896532004487975",
        "-0.046052520240148453291889528018575765325783",
        "-0.008973211927736496028121536284015471766037",
        "0.031737295576925046595341788329430201066844",
        "-0.013737700507439942551142563330837760597296",
        "-0.013294493733667985453314653199512877926765",
        "0.014472066608025279692661162180583657617429",
        "0.063535311927574700730359309263037817707473"}},
      {{"0.055084476189132874508252278176795547821749", nullptr, nullptr, nullptr, nullptr,
        "0.078300620662354015305706115468284644723271",
        "0.120976436018347577375532395541309802786619",
        "0.057256347419198963342098141486387206792954",
        "0.041149317570311898878412374069604095587655",
        "0.032980067929448150150597005567015752046445",
        "-0.003779527463786579737940637456968735606353",
        "-0.009446021558684565873845288564636458299823",
        "-0.006430071775160544187319997853454119612224",
        "0.018369795250635165944720085040918389853354",
        "0.01040397103848460536296907288776427139805",
        "-0.051501730029581875055791171107302187459783",
        "0.156636318749300313986609626744281789968087"}},
  }};
  static constexpr std::array<const char*, stages> weights = [] {
    std::array<const char*, stages> last{};
    for (std::size_t k = 0; k < stages; ++k) last[k] = rows[end_stage][k];
    return last;
  }();
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
  /// What `continuous_weights` adds, by power of the fraction.
  static constexpr std::array<std::array<const char*, dense_stages>, 4> bumps{{
      {{"-7.277291317263333191761706665126492783471731", nullptr, nullptr, nullptr, nullptr,
        "16.010627454455682843367435361024984009006519",
        "33.330009779865701860620787994536082128136279",
        "7.577653844927888396332480843610898896453298",
        "4.560327397188785726909737092345329070624739",
        "5.630188622643779216025178407301775775579415",
        "-0.409633271710186338772810215775079003754058",
        "-0.162491985316076263115573524097353980414371",
        "-1.12908427358736444451974199409803605671929",
        "2.19884089492833074360829807060389699772701",
        "0.000000000000000000000000000000000000054761",
        "-6.545948467020693379591369166946233215766679",
        "-36.140386942135037882520828911484232371495693",
        "-17.642811736977477286581887291895539465960199"}},
      {{"24.446664254830079760746008805998329110522358", nullptr, nullptr, nullptr, nullptr,
        "-84.429050595647453626226794342382714589087626",
        "-163.155026360507140545335636299863522792334736",
        "-35.40550736705404238624652993762376457586238",
        "-18.972693002904568628226794945754565832945816",
        "-40.400184467823193947782687112283236665685016",
        "-5.804454532548727136486327870153693517323409",
        "14.98740780087826307889449638954253210439431",
        "-8.957866623218795184988219884913820186509702",
        "-2.517359915925787178087648765973849808684034",
        "-0.000000000000000000000000000000000000258445",
        "49.943162378009734673919335125589779349916252",
        "205.722202593691754100503179957679476576284275",
        "64.542705838219877019317618880139050827573969"}},
      {{"-35.434203139997674229460349898408752615949562", nullptr, nullptr, nullptr, nullptr,
        "151.3007052120964297764910865570874236243918",
        "276.105044060845748303442392573087683435455641",
        "57.544732141810040297712730554249898290285505",
        "27.4803734896374126248838653973189585209563",
        "86.191449380951262914295309055471401502955754",
        "20.671777456714139925110406609131917535403013",
        "-45.080267613225507584368244227651713429944308",
        "35.282867652841396451179938671438427168491574",
        "0.169820744096883863707808730174336995444605",
        "0.000000000000000000000000000000000000436653",
        "-137.22247527161897973513759068487288889357722",
        "-372.523988480468852019830082626068241368231935",
        "-64.485835633682300588027270710958450766117821"}},
      {{"18.493039588681026963891768205355620783818774", nullptr, nullptr, nullptr, nullptr,
        "-97.178797593544127094529503628455332790058319",
        "-157.347150542737700972643813471986365440686153",
        "-29.694462484808821862865614826806120531408682",
        "-9.663779895796450862448894929214976423177922",
        "-72.277465454851972591123212687190179262645048",
        "-25.882647987403627927740931576965091346558915",
        "51.321525086056434234371959547266184442018168",
        "-46.265951045831653038424623424391455548020858",
        "8.46338556243853775250645338106601708429268",
        "-0.000000000000000000000000000000000000182122",
        "116.372417191478993414957674079044146058216484",
        "222.402381182369463892435870224518353056068134",
        "21.257506393949898091612869107759199918323779"}},
  }};
};

namespace detail {

/// The pair's numbers, rounded to S once.
template <class Pair, class S>
struct PairTable {
  static constexpr std::size_t all_stages = Pair::dense_stages;
  std::array<std::array<S, all_stages>, all_stages> rows{};
  std::array<S, all_stages> nodes{};
  std::array<S, Pair::stages> weights = numbers<S>(Pair::weights);
  std::array<S, Pair::stages> error = numbers<S>(Pair::error);

  constexpr PairTable() noexcept {
    using Wide = CoefficientScalar<S>;
    for (std::size_t s = 0; s < all_stages; ++s) {
      rows[s] = numbers<S>(Pair::rows[s]);
      Wide node(0);
      for (const auto& x : numbers<Wide>(Pair::rows[s])) node = node + x;
      nodes[s] = static_cast<S>(node);
    }
  }
};
template <class Pair, class S>
inline const PairTable<Pair, S> pair_table{};

/// What `continuous_weights` needs of a pair, rounded to S once.
template <class Pair, class S>
struct ContinuousExtension {
  std::array<S, Pair::stages> weights = numbers<S>(Pair::weights);
  std::array<std::array<S, Pair::dense_stages>, Pair::bumps.size()> bumps{};

  constexpr ContinuousExtension() noexcept {
    for (std::size_t k = 0; k < bumps.size(); ++k) bumps[k] = numbers<S>(Pair::bumps[k]);
  }
};
template <class Pair, class S>
inline const ContinuousExtension<Pair, S> continuous_extension{};

}  // namespace detail

/// The weights that give the motion at the fraction `at` of a step: Hermite's cubic polynomial
/// through the ends and their slopes, and at² (1 − at)² times a polynomial of `Pair::bumps`.
template <class Pair, class S>
[[nodiscard]] constexpr std::array<S, Pair::dense_stages> continuous_weights(const S& at) noexcept {
  const auto& table = detail::continuous_extension<Pair, S>;
  const S less = at - S(1);
  const S rise = at * at * (S(3) - (at + at));
  const S bump = at * at * less * less;
  std::array<S, Pair::dense_stages> result{};
  for (std::size_t r = 0; r < result.size(); ++r) {
    S sum = table.bumps.back()[r];
    for (std::size_t k = table.bumps.size() - 1; k > 0; --k) {
      sum = mul_add(sum, at, table.bumps[k - 1][r]);
    }
    result[r] = bump * sum;
    if (r < Pair::stages) result[r] = mul_add(rise, table.weights[r], result[r]);
  }
  result[0] = result[0] + at * less * less;
  result[Pair::end_stage] = result[Pair::end_stage] + at * at * less;
  return result;
}

}  // namespace hamotor
