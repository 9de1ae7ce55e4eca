// kernels [--errors=FILE] [Google Benchmark's options]: with --errors, writes the errors of every
// contestant there, a JSON object a line, and times nothing.
#include <string_view>

#include "contest.hpp"

namespace bench {

std::vector<ErrorReport>& error_reports() {
  static std::vector<ErrorReport> reports;
  return reports;
}

void enter_generated();
void enter_tables();
void enter_eigen_quaternion();
void enter_eigen_matrix();
void enter_conformal_generated();
void enter_conformal_tables();
void enter_conformal_matrices();
#ifdef HAMOTOR_BENCH_GLM
void enter_glm();
#endif
#ifdef HAMOTOR_BENCH_GANJA
void enter_ganja();
#endif

}  // namespace bench

int main(int argc, char** argv) {
  bench::enter_generated();
  bench::enter_eigen_quaternion();
#ifndef HAMOTOR_BENCH_BRIEF
  bench::enter_tables();
  bench::enter_eigen_matrix();
  bench::enter_conformal_generated();
  bench::enter_conformal_tables();
  bench::enter_conformal_matrices();
#endif
#ifdef HAMOTOR_BENCH_GLM
  bench::enter_glm();
#endif
#ifdef HAMOTOR_BENCH_GANJA
  bench::enter_ganja();
#endif
  constexpr std::string_view option = "--errors=";
  if (argc == 2 && std::string_view(argv[1]).starts_with(option)) {
    std::FILE* const file = std::fopen(argv[1] + option.size(), "w");
    if (file == nullptr) {
      std::fprintf(stderr, "cannot write %s\n", argv[1] + option.size());
      return 1;
    }
    for (const bench::ErrorReport report : bench::error_reports()) report(file);
    return std::fclose(file) == 0 ? 0 : 1;
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
