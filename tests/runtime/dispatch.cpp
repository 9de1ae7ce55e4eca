// One binary for all instruction sets: it chooses what the processor has, or what is forced, and
// computes the same bits with each.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <string>

namespace {

/// What `dispatched` says in an environment, with its errors, and whether it succeeded.
struct Answer {
  std::string text;
  bool succeeded;
};

Answer answer(const std::string& environment) {
  Answer result{};
  const std::string command = environment + " '" HAMOTOR_DISPATCHED "' 2>&1";
  std::FILE* const pipe = popen(command.c_str(), "r");
  std::array<char, 256> line{};
  while (std::fgets(line.data(), line.size(), pipe) != nullptr) result.text += line.data();
  result.succeeded = pclose(pipe) == 0;
  return result;
}

std::string word(const std::string& text, bool first) {
  const auto space = text.find(' ');
  return first ? text.substr(0, space) : text.substr(space + 1);
}

TEST(Dispatch, every_instruction_set_computes_the_same_bits) {
  const Answer chosen = answer("HAMOTOR_ISA=");
  ASSERT_TRUE(chosen.succeeded) << chosen.text;
#ifdef __x86_64__
  bool is_there = false;  // those below the best are, too
  for (const char* set : {"avx512", "avx2", "sse2"}) {
    const Answer forced = answer(std::string("HAMOTOR_ISA=") + set);
    is_there = is_there || set == word(chosen.text, true);
    ASSERT_EQ(forced.succeeded, is_there) << forced.text;
    if (!is_there) continue;
    EXPECT_EQ(word(forced.text, true), set);
    EXPECT_EQ(word(forced.text, false), word(chosen.text, false));
  }
  EXPECT_TRUE(is_there);
#endif
}

#ifdef __x86_64__
TEST(Dispatch, an_unknown_instruction_set_is_refused) {
  const Answer refused = answer("HAMOTOR_ISA=avx3");
  EXPECT_FALSE(refused.succeeded);
  EXPECT_NE(refused.text.find("HAMOTOR_ISA is \"avx3\"; this processor has sse2"),
            std::string::npos)
      << refused.text;
}
#endif

}  // namespace
