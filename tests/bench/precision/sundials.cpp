// SUNDIALS on the reference problems: CVODE's Adams methods and ARKODE's explicit Runge-Kutta
// pairs.
//
// The equations are not stiff: Adams' corrector is iterated without a Jacobian (Anderson's
// acceleration off), and its order goes up to 12.  Of ARKODE those pairs that are its defaults of
// orders 5 and 8.  Tolerances are both absolute and relative; both stop at the end exactly, so that
// nothing is interpolated.
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_version.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string_view>

#include "timing.hpp"

namespace {

using bench::Count;
using bench::Solver;
using bench::State;

void check(int flag) {
  if (flag < 0) throw std::runtime_error("SUNDIALS gave up");
}

/// What is freed when it goes out of scope; SUNDIALS' functions take the address of a pointer.
template <class Pointer, auto free>
class Held {
 public:
  explicit Held(Pointer held) : held_(held) {
    if (held == nullptr) throw std::runtime_error("SUNDIALS made nothing");
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;
  ~Held() { free(held_); }
  operator Pointer() const { return held_; }

 private:
  Pointer held_;
};

SUNContext new_context() {
  SUNContext context = nullptr;
  check(SUNContext_Create(nullptr, &context));
  return context;
}

using Context = Held<SUNContext, [](SUNContext c) { SUNContext_Free(&c); }>;
using Vector = Held<N_Vector, [](N_Vector v) { N_VDestroy(v); }>;
using Iteration = Held<SUNNonlinearSolver, [](SUNNonlinearSolver s) { SUNNonlinSolFree(s); }>;
using Cvode = Held<void*, [](void* memory) { CVodeFree(&memory); }>;
using Erk = Held<void*, [](void* memory) { ERKStepFree(&memory); }>;

template <class Rates>
int evaluate(double t, N_Vector x, N_Vector rate, void* rates) {
  State<Rates::size> in, out;
  std::memcpy(in.data(), N_VGetArrayPointer(x), sizeof in);
  (*static_cast<const Rates*>(rates))(in, out, t);
  std::memcpy(N_VGetArrayPointer(rate), out.data(), sizeof out);
  return 0;
}

/// A hundred times what the longest runs take: steps that rounding swallows are never through.
constexpr long most_steps = 1'000'000;

template <class Rates>
void adams(const Rates& rates, State<Rates::size>& x, double end, double tolerance, Count* count) {
  const Context context(new_context());
  const Vector state(N_VMake_Serial(Rates::size, x.data(), context));
  const Iteration iteration(SUNNonlinSol_FixedPoint(state, 0, context));
  const Cvode memory(CVodeCreate(CV_ADAMS, context));
  check(CVodeInit(memory, evaluate<Rates>, 0.0, state));
  check(CVodeSetUserData(memory, const_cast<Rates*>(&rates)));
  check(CVodeSStolerances(memory, tolerance, tolerance));
  check(CVodeSetNonlinearSolver(memory, iteration));
  check(CVodeSetMaxNumSteps(memory, most_steps));
  check(CVodeSetMaxHnilWarns(memory, -1));
  check(CVodeSetErrFile(memory, nullptr));  // what fails is a row
  check(CVodeSetStopTime(memory, end));
  double reached = 0;
  check(CVode(memory, end, state, &reached, CV_NORMAL));
  if (count == nullptr) return;
  long steps = 0;
  long evaluations = 0;
  check(CVodeGetNumSteps(memory, &steps));
  check(CVodeGetNumRhsEvals(memory, &evaluations));
  *count = {steps, evaluations};
}

template <class Rates, int order>
void runge_kutta(const Rates& rates, State<Rates::size>& x, double end, double tolerance,
                 Count* count) {
  const Context context(new_context());
  const Vector state(N_VMake_Serial(Rates::size, x.data(), context));
  const Erk memory(ERKStepCreate(evaluate<Rates>, 0.0, state, context));
  check(ERKStepSetUserData(memory, const_cast<Rates*>(&rates)));
  check(ERKStepSStolerances(memory, tolerance, tolerance));
  check(ERKStepSetOrder(memory, order));
  check(ERKStepSetMaxNumSteps(memory, most_steps));
  check(ERKStepSetMaxHnilWarns(memory, -1));
  check(ERKStepSetErrFile(memory, nullptr));
  check(ERKStepSetStopTime(memory, end));
  double reached = 0;
  check(ERKStepEvolve(memory, end, state, &reached, ARK_NORMAL));
  if (count == nullptr) return;
  long steps = 0;
  long evaluations = 0;
  check(ERKStepGetNumSteps(memory, &steps));
  check(ERKStepGetNumRhsEvals(memory, &evaluations));
  *count = {steps, evaluations};
}

struct Solvers {
  template <class Rates>
  static Solver<Rates> find(std::string_view name) {
    if (name == "CVODE Adams") return adams<Rates>;
    if (name == "ARKODE ERK 5") return runge_kutta<Rates, 5>;
    if (name == "ARKODE ERK 8") return runge_kutta<Rates, 8>;
    return nullptr;
  }
};

}  // namespace

HAMOTOR_BENCH_SOLVERS(Solvers);

extern "C" __attribute__((visibility("default"))) const char* version() { return SUNDIALS_VERSION; }
