#include "generated.hpp"

namespace bench {
void enter_generated() { enter<Generated>(); }
}  // namespace bench
