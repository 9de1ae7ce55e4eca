// Observed orders on one group, free and forced.  HEADER and GROUP name the group, the program's
// argument is the time, s; QUICK leaves it at methods of low order.
#include <cstdlib>

#include "orders.hpp"

#include "../runtime/group_system.hpp"
#include HEADER
#ifndef QUICK
#include "hamotor/mpfr.hpp"
#endif

namespace {

template <bool forced>
void print_orders(const char* name, double length) {
  using System = sample::GroupSystem<GROUP, orders::Wide, forced>;
  const System system;
#ifdef QUICK
  const auto reference = orders::after<hamotor::Gauss8<System>>(system, length, 16);
  orders::List<orders::Rkmk4, orders::Splitting4, hamotor::Gauss4>::print(name, system, length,
                                                                          reference);
#else
  const auto reference = orders::after<hamotor::Gauss16<System>>(system, length, 40);
  orders::Explicit::print(name, system, length, reference);
  orders::Splittings::print(name, system, length, reference);
  orders::Implicit::print(name, system, length, reference);
  // Of order 16 there are not two errors between what is not small and 33 digits.
  using Wider = sample::GroupSystem<GROUP, hamotor::Mpfr<50>, forced>;
  orders::print_order<hamotor::Gauss16<Wider>>(
      name, Wider{}, length, orders::after<hamotor::Gauss16<Wider>>(Wider{}, length, 64));
#endif
}

}  // namespace

int main(int count, char** words) {
  if (count != 2) return 2;
  const double length = std::strtod(words[1], nullptr);
  print_orders<false>("free", length);
  print_orders<true>("forced", length);
}
