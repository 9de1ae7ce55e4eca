// Prints the instruction set that was chosen, and the hash of what it computed.
#include <cinttypes>
#include <cstdint>
#include <cstdio>

extern "C" const char* dispatched_set();
extern "C" std::uint64_t dispatched_hash();

int main() {
  std::printf("%s %016" PRIx64 "\n", dispatched_set(), dispatched_hash());
  return 0;
}
