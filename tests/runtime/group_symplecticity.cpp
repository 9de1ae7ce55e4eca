// Gauss collocation and splittings are symplectic on groups that are no rigid motions.
#include <gtest/gtest.h>

#include "group_system.hpp"
#include "hamotor/cga3/sim3.hpp"
#include "hamotor/cga3/so41.hpp"
#include "hamotor/gauss.hpp"
#include "symplecticity.hpp"

namespace {

template <class G>
void expect_symplectic() {
  using System = sample::GroupSystem<G, sample::Dual>;
  EXPECT_LT((sample::symplectic_defect<hamotor::Gauss4<System>>(System{}, 0.15)), 1e-12);
  EXPECT_LT((sample::symplectic_defect<hamotor::Splitting4<System>>(System{}, 0.15)), 1e-12);
  EXPECT_GT((sample::symplectic_defect<hamotor::Rkmk4<System>>(System{}, 0.15)), 1e-8);
}

TEST(Symplecticity, of_similarities) { expect_symplectic<hamotor::cga3::Sim3>(); }
TEST(Symplecticity, of_conformal_motions) { expect_symplectic<hamotor::cga3::SO41>(); }

}  // namespace
