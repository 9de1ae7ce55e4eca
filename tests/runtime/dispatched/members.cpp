// Compiled once for each instruction set: some members, stepped, and what their bits are.
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <type_traits>
#include <vector>

#include "hamotor/angle_increment.hpp"
#include "hamotor/ensemble.hpp"
#include "hamotor/pack.hpp"
#include "hamotor/pga3/so3.hpp"
#include "hamotor/steppers.hpp"
#include "hamotor/systems.hpp"

namespace {

using hamotor::pga3::SO3;
using Lanes = hamotor::Pack<double, hamotor::widest<double>>;

/// FNV-1a.
class Hash {
 public:
  template <class Numbers>
  void add(const Numbers& numbers) {
    for (const double x : numbers) {
      value_ = (value_ ^ std::bit_cast<std::uint64_t>(x)) * 0x100000001b3U;
    }
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

}  // namespace

extern "C" const char* dispatched_set() { return hamotor::instruction_set.data(); }

extern "C" std::uint64_t dispatched_hash() {
  Hash hash;
  for (double x = -30; x < 30; x += 0.37) {
    const Lanes lanes(x);
    const auto turn = hamotor::AngleIncrement<Lanes>::of(lanes);
    hash.add(std::array{sin(lanes)[0], cos(lanes)[0], exp(lanes)[0], sqrt(exp(lanes))[0],
                        turn.sine[0], turn.cosine_less_one[0]});
  }
  const hamotor::RigidBodies system{
      std::tuple{hamotor::PivotedBody<SO3, Lanes>(1.5, {1, 2, 3}, {}, {})}};
  using System = std::remove_cvref_t<decltype(system)>;
  using Ensemble = hamotor::Ensemble<System, hamotor::Rk4<System>>;
  std::vector<Ensemble::Member> members(29);
  for (std::size_t k = 0; k < members.size(); ++k) {
    members[k].motors[0] = SO3::Element<double>::identity();
    members[k].momenta[0] = {0.1, 2 + 0.1 * static_cast<double>(k), 0.3};
  }
  Ensemble ensemble(system, hamotor::Rk4<System>{}, 0.0, 0.01, std::span(members), 1);
  ensemble.advance(200);
  for (std::size_t k = 0; k < ensemble.size(); ++k) {
    hash.add(ensemble.state(k).motors[0].components());
    hash.add(ensemble.state(k).momenta[0].components());
  }
  return hash.value();
}
