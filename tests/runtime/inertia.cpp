// Inertia: every constructor against the others, against exact formulas, and under a change of
// frame.
#include "hamotor/inertia.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace {

using hamotor::Inertia;
using hamotor::PointMass;
using Space3 = Inertia<3>;
using Plane = Inertia<2>;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class Matrix>
void expect_equal(const Matrix& a, const Matrix& b, double tolerance = 1e-14) {
  EXPECT_LE((a - b).cwiseAbs().maxCoeff(), tolerance * b.cwiseAbs().maxCoeff()) << a << "\n\n" << b;
}

template <class Make>
std::string refusal(Make&& make) {
  try {
    (void)make();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

hamotor::pga3::Motor<double> some_motor() {
  return exp(hamotor::pga3::se3::Rate<double>{0.7, -1.1, 0.4, 0.3, -0.8, 1.7});
}

/// Masses at the corners of a box have three times the moments of the uniform box.
std::vector<PointMass<3>> corners(double mass, const std::array<double, 3>& edges) {
  std::vector<PointMass<3>> points;
  for (int k = 0; k < 8; ++k) {
    points.push_back({mass / 8,
                      {(k & 1 ? 0.5 : -0.5) * edges[0], (k & 2 ? 0.5 : -0.5) * edges[1],
                       (k & 4 ? 0.5 : -0.5) * edges[2]}});
  }
  return points;
}

std::vector<PointMass<3>> cloud(unsigned seed, int count) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<PointMass<3>> points;
  for (int k = 0; k < count; ++k) {
    points.push_back({1.1 + uniform(generator),
                      {uniform(generator), uniform(generator), 2 + uniform(generator)}});
  }
  return points;
}

/// K Ω summed as a physicist writes it, V + Ω × x at every point.
Eigen::Matrix<double, 6, 1> momentum_of(const std::vector<PointMass<3>>& points,
                                        const Eigen::Vector3d& w, const Eigen::Vector3d& v) {
  Eigen::Matrix<double, 6, 1> sum = Eigen::Matrix<double, 6, 1>::Zero();
  for (const auto& point : points) {
    const Eigen::Vector3d x(point.at.data());
    const Eigen::Vector3d p = point.mass * (v + w.cross(x));
    sum.head<3>() += x.cross(p);
    sum.tail<3>() += p;
  }
  return sum;
}

TEST(Inertia, point_masses_carry_the_momentum_of_their_lines) {
  const auto points = cloud(1, 9);
  const auto k = Space3::of_points(points).kinetic_matrix();
  for (int b = 0; b < 6; ++b) {
    Eigen::Matrix<double, 6, 1> rate = Eigen::Matrix<double, 6, 1>::Unit(b);
    const Eigen::Matrix<double, 6, 1> got = k.col(b);
    expect_equal(got, momentum_of(points, rate.head<3>(), rate.tail<3>()));
  }
}

TEST(Inertia, eight_corners_have_three_times_the_moments_of_the_box) {
  const std::array<double, 3> edges{0.1, 0.2, 0.3};
  const auto box = Space3::of_box(1.5, edges);
  expect_equal(Space3::of_points(corners(1.5, edges)).tensor(), Eigen::Matrix3d(3 * box.tensor()));
  EXPECT_DOUBLE_EQ(box.tensor()(0, 0), 1.5 * (0.04 + 0.09) / 12);
  EXPECT_DOUBLE_EQ(box.tensor()(1, 1), 1.5 * (0.01 + 0.09) / 12);
  EXPECT_DOUBLE_EQ(box.tensor()(2, 2), 1.5 * (0.01 + 0.04) / 12);
}

TEST(Inertia, a_grid_of_points_converges_to_the_uniform_shapes) {
  constexpr int n = 40;
  std::vector<PointMass<3>> ball;
  std::vector<PointMass<3>> cylinder;
  const std::array<double, 3> semi{1, 2, 3};
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < n; ++k) {
        const double x = (2 * i + 1.0) / n - 1;
        const double y = (2 * j + 1.0) / n - 1;
        const double z = (2 * k + 1.0) / n - 1;
        if (x * x + y * y + z * z < 1) ball.push_back({1, {semi[0] * x, semi[1] * y, semi[2] * z}});
        if (x * x + y * y < 1) cylinder.push_back({1, {2 * x, 2 * y, 1.5 * z}});
      }
    }
  }
  const auto as_points = Space3::of_points(ball);
  expect_equal(as_points.tensor(), Space3::of_ellipsoid(as_points.mass(), semi).tensor(), 1e-2);
  const auto rod = Space3::of_points(cylinder);
  expect_equal(rod.tensor(), Space3::of_cylinder(rod.mass(), 2, 3).tensor(), 1e-2);
}

TEST(Inertia, moments_and_tensor_agree_about_any_centre_of_mass) {
  const Eigen::Vector3d center(0.3, -0.2, 0.5);
  const auto a = Space3::of_moments(2, {1, 2, 2.5}, center);
  const auto b = Space3::of_tensor(2, Eigen::Vector3d(1, 2, 2.5).asDiagonal(), center);
  EXPECT_EQ(a.kinetic_matrix(), b.kinetic_matrix());
  Eigen::Matrix3d hat;
  hat << 0, -0.5, -0.2, 0.5, 0, -0.3, 0.2, 0.3, 0;
  const Eigen::Matrix3d coupling = a.kinetic_matrix().topRightCorner<3, 3>();
  expect_equal(coupling, Eigen::Matrix3d(2 * hat));
}

TEST(Inertia, kinetic_energy_does_not_depend_on_the_frame) {
  const auto n = some_motor();
  const auto body = Space3::of_points(cloud(2, 5));
  const auto k = body.kinetic_matrix();
  const auto moved = body.moved(n).kinetic_matrix();
  for (int a = 0; a < 6; ++a) {
    // I_N(B) = N I(N~ B N) N~, column by column, by the group's own kernels.
    std::array<double, 6> unit{};
    unit[static_cast<std::size_t>(a)] = 1;
    const auto rate = Ad_inverse(n, hamotor::pga3::se3::Rate<double>::from(unit)).components();
    const Eigen::Matrix<double, 6, 1> inner =
        k * Eigen::Map<const Eigen::Matrix<double, 6, 1>>(rate.data());
    std::array<double, 6> momentum{};
    Eigen::Map<Eigen::Matrix<double, 6, 1>>(momentum.data()) = inner;
    const auto back =
        Ad_star_inverse(n, hamotor::pga3::se3::Momentum<double>::from(momentum)).components();
    const Eigen::Matrix<double, 6, 1> expected =
        Eigen::Map<const Eigen::Matrix<double, 6, 1>>(back.data());
    const Eigen::Matrix<double, 6, 1> got = moved.col(a);
    expect_equal(got, expected, 1e-13);
  }
}

TEST(Inertia, points_moved_are_the_body_moved) {
  const auto n = some_motor();
  auto points = cloud(3, 7);
  const auto before = Space3::of_points(points).moved(n).kinetic_matrix();
  for (auto& point : points) {
    point.at = sandwich(n, hamotor::pga3::Point<double>::from(point.at)).components();
  }
  expect_equal(before, Space3::of_points(points).kinetic_matrix(), 1e-13);
}

TEST(PrincipalFrame, makes_the_kinetic_matrix_diagonal) {
  for (unsigned seed = 1; seed < 20; ++seed) {
    const auto body = Space3::of_points(cloud(seed, 6));
    const auto frame = body.principal_frame();
    Eigen::Matrix<double, 6, 1> expected;
    expected << frame.moments[0], frame.moments[1], frame.moments[2], frame.mass, frame.mass,
        frame.mass;
    const Eigen::Matrix<double, 6, 6> diagonal = expected.asDiagonal();
    expect_equal(body.moved(reverse(frame.motor)).kinetic_matrix(), diagonal, 1e-13);
  }
}

TEST(PrincipalFrame, about_a_fixed_point_is_that_of_the_tensor_there) {
  const auto body = Space3::of_cylinder(0.2, 0.04, 0.01, {0, 0.03, 0.05});
  const auto frame = body.principal_frame<hamotor::pga3::SO3>();
  const hamotor::pga3::Motor<double> n{
      frame.motor.s, frame.motor.e23, frame.motor.e31, frame.motor.e12, 0, 0, 0, 0};
  const Eigen::Matrix3d there = body.moved(reverse(n)).tensor_about_origin();
  const Eigen::Matrix3d expected =
      Eigen::Vector3d(frame.moments[0], frame.moments[1], frame.moments[2]).asDiagonal();
  expect_equal(there, expected, 1e-13);
  const auto center = sandwich(n, hamotor::pga3::Point<double>::from(frame.center_of_mass));
  EXPECT_NEAR(center.e032, 0, 1e-16);
  EXPECT_NEAR(center.e013, 0.03, 1e-16);
  EXPECT_NEAR(center.e021, 0.05, 1e-16);
}

TEST(PrincipalFrame, of_a_diagonal_tensor_is_the_frame_itself) {
  const auto frame = Space3::of_moments(1, {3, 2, 4}).principal_frame();
  EXPECT_EQ(frame.motor, hamotor::pga3::Motor<double>::identity());
  EXPECT_EQ(frame.moments, (std::array<double, 3>{3, 2, 4}));
}

TEST(PrincipalFrame, keeps_the_moments_however_the_body_is_turned) {
  const auto turned = Space3::of_moments(1, {1, 2, 2.5}).moved(some_motor()).principal_frame();
  auto moments = turned.moments;
  std::sort(moments.begin(), moments.end());
  EXPECT_NEAR(moments[0], 1, 1e-14);
  EXPECT_NEAR(moments[1], 2, 1e-14);
  EXPECT_NEAR(moments[2], 2.5, 1e-14);
}

TEST(PlanarInertia, box_disk_and_points_agree_with_the_formulas) {
  EXPECT_DOUBLE_EQ(Plane::of_box(2, {0.4, 0.2}).tensor()(0, 0), 2 * (0.16 + 0.04) / 12);
  EXPECT_DOUBLE_EQ(Plane::of_disk(2, 0.5).tensor()(0, 0), 0.25);
  const std::vector<PointMass<2>> points{{1, {1, 0}}, {2, {0, 3}}, {0.5, {-2, -1}}};
  const auto body = Plane::of_points(points);
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  for (const auto& point : points) {
    const double x = point.at[0];
    const double y = point.at[1];
    Eigen::Matrix<double, 3, 3> one;
    one << x * x + y * y, -y, x, -y, 1, 0, x, 0, 1;
    expected += point.mass * one;
  }
  expect_equal(body.kinetic_matrix(), expected);
  const auto frame = body.principal_frame();
  const auto center = sandwich(frame.motor, hamotor::pga2::Origin<double>{}).components();
  EXPECT_NEAR(center[0], body.center_of_mass()[0], 1e-15);
  EXPECT_NEAR(center[1], body.center_of_mass()[1], 1e-15);
}

TEST(Inertia, refuses_what_no_body_has) {
  EXPECT_EQ(refusal([] { return Space3::of_moments(0, {1, 1, 1}); }),
            "inertia: a mass must be positive and finite, not 0");
  EXPECT_EQ(refusal([] { return Space3::of_moments(nan, {1, 1, 1}); }),
            "inertia: a mass must be positive and finite, not nan");
  EXPECT_EQ(refusal([] { return Space3::of_moments(1, {1, 2, 3.5}); }),
            "inertia: no body has the principal moments 1, 2, 3.5: the largest exceeds the sum of "
            "the other two");
  EXPECT_EQ(refusal([] { return Space3::of_moments(1, {1, 2, -1}); }),
            "inertia: the principal moment -1 is negative");
  EXPECT_EQ(refusal([] { return Space3::of_moments(1, {1, nan, 1}); }),
            "inertia: the inertia tensor is not finite");
  EXPECT_EQ(refusal([] {
              Eigen::Matrix3d tensor = Eigen::Matrix3d::Identity();
              tensor(0, 1) = 0.1;
              return Space3::of_tensor(1, tensor);
            }),
            "inertia: the tensor is not symmetric");
  EXPECT_EQ(refusal([] { return Space3::of_box(1, {1, -2, 1}); }),
            "inertia: edge must be finite and not negative, not -2");
  EXPECT_EQ(refusal([] { return Space3::of_points({}); }), "inertia: there are no point masses");
  const std::vector<PointMass<3>> rod{{1, {0, 0, 0}}, {1, {0, 0, 1}}};
  EXPECT_EQ(refusal([&] { return Space3::of_points(rod).principal_frame(); }),
            "inertia: the body has no inertia about one axis, so that its momentum does not "
            "determine its rate of turning");
}

}  // namespace
