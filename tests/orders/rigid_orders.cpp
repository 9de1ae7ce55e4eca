// Observed orders of the methods for rigid bodies, where their free motion is known; 0 for what is
// exact.
#include "hamotor/moser_veselov.hpp"
#include "orders.hpp"

namespace {

constexpr double length = 1;

template <class System>
using MoserVeselov2 = hamotor::MoserVeselov<System, 2>;
template <class System>
using MoserVeselov4 = hamotor::MoserVeselov<System, 4>;
template <class System>
using MoserVeselov6 = hamotor::MoserVeselov<System, 6>;
template <class System>
using MoserVeselov8 = hamotor::MoserVeselov<System, 8>;
template <class System>
using MoserVeselov10 = hamotor::MoserVeselov<System, 10>;

template <class System>
void print_orders(const char* name, const System& system) {
  const auto reference = orders::after<hamotor::Gauss16<System>>(system, length, 160);
  orders::Splittings::print(name, system, length, reference);
  if constexpr (hamotor::FreeSystem<System>) {
    orders::List<MoserVeselov2, MoserVeselov4, MoserVeselov6, MoserVeselov8, MoserVeselov10>::print(
        name, system, length, reference);
  } else {
    orders::List<MoserVeselov2>::print(name, system, length, reference);
  }
}

}  // namespace

int main() {
  using orders::Wide;
  print_orders("free_SE(3)", sample::free_se3<Wide>());
  print_orders("nearly_symmetric_SO(3)", sample::nearly_symmetric_so3<Wide>());
  print_orders("forced_SE(3)", sample::forced_se3<Wide>());
  print_orders("forced_SO(3)", sample::forced_so3<Wide>());
  print_orders("forced_SE(2)", sample::forced_se2<Wide>());
  print_orders("symmetric_top", sample::symmetric_top<Wide>());
  print_orders("spinning_pendulum", sample::spinning_pendulum<Wide>());
  print_orders("two_bodies_SE(2)", sample::two_bodies_se2<Wide>());
}
