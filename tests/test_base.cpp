// SPDX-License-Identifier: BSD-3-Clause
// Dead reckoning of the base, and how wrong it says that it may be.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "base/odometry/odometry.h"

namespace test_base {

namespace k = kurumaisu;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
const k::OdometryNoise kNoise{0.01, 0.0005, 0.001, 0.005, 0.02};
}  // namespace

TEST(Odometry, ACircleCloses) {
  k::Odometry odometry(kNoise);
  const int steps = 1000;
  for (int i = 0; i < steps; ++i) odometry.advance(0.5, 0.25, 2 * M_PI / 0.25 / steps);
  EXPECT_NEAR(odometry.pose().x, 0.0, 1e-9);
  EXPECT_NEAR(odometry.pose().y, 0.0, 1e-9);
  EXPECT_NEAR(odometry.pose().theta, 2 * M_PI, 1e-9);
}

TEST(Odometry, UncertaintyGrowsWithDistanceAndTurnOnly) {
  for (const auto& [v, w] : {std::pair(0.5, 0.0), {-0.5, 0.0}, {0.0, 0.7}, {0.4, -0.9}}) {
    k::Odometry odometry(kNoise);
    double heading = 0, volume = -1e-15;  // a first turn in place is flat: 0 but for rounding
    for (int i = 0; i < 200; ++i) {
      odometry.advance(v, w, 0.05);
      const Eigen::Matrix3d& p = odometry.covariance();
      EXPECT_GT(p(2, 2), heading);
      EXPECT_GT(p.determinant(), volume);
      EXPECT_NEAR((p - p.transpose()).norm(), 0, 1e-12);
      heading = p(2, 2);
      volume = p.determinant();
    }
    const Eigen::Matrix3d before = odometry.covariance();
    odometry.advance(0, 0, 60.0);
    EXPECT_EQ(odometry.covariance(), before);
  }
}

TEST(Odometry, AStraightDriveByHand) {
  k::Odometry odometry(kNoise);
  for (int i = 0; i < 1000; ++i) odometry.advance(0.5, 0.0, 0.02);  // 10 m
  const Eigen::Matrix3d& p = odometry.covariance();
  EXPECT_NEAR(p(0, 0), 0.01 * 10, 1e-9);
  EXPECT_NEAR(p(2, 2), 0.005 * 10, 1e-9);
  EXPECT_NEAR(p(1, 2), 0.005 * 10 * 10 / 2, 1e-6);                              // q L^2 / 2
  EXPECT_NEAR(p(1, 1), 0.001 * 10 + 0.005 * 10 * 10 * 10 / 3, 1e-5);            // and q L^3 / 3
  EXPECT_NEAR(odometry.rateVariance()[0], 0.01 * 0.01 / (0.02 * 0.02), 1e-12);  // 0.01 m in 0.02 s
}

TEST(Odometry, TheLengthOfTheIntervalsDoesNotMatter) {
  k::Odometry fine(kNoise), coarse(kNoise);
  for (int i = 0; i < 10000; ++i) fine.advance(0.6, 0.4, 0.001);
  for (int i = 0; i < 100; ++i) coarse.advance(0.6, 0.4, 0.1);
  EXPECT_NEAR((fine.covariance() - coarse.covariance()).norm() / fine.covariance().norm(), 0, 1e-3);
}

TEST(Odometry, CovarianceIsThatOfManyNoisyDrives) {
  const k::OdometryNoise noise{0.0010, 0.0004, 0.0006, 0.0008, 0.0012};
  const int drives = 20000, steps = 40;
  const double dt = 0.2;
  const auto rates = [](int i) { return i < 20 ? std::pair(0.5, 0.3) : std::pair(-0.3, -0.5); };
  k::Odometry odometry(noise);
  for (int i = 0; i < steps; ++i) odometry.advance(rates(i).first, rates(i).second, dt);

  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  Eigen::MatrixX3d ends(drives, 3);
  for (int n = 0; n < drives; ++n) {
    double x = 0, y = 0, theta = 0;
    for (int i = 0; i < steps; ++i) {
      const auto [v, w] = rates(i);
      const double d = std::abs(v) * dt, a = std::abs(w) * dt;
      const double forward = v * dt + std::sqrt(0.0010 * d + 0.0004 * a) * normal(random);
      const double lateral = std::sqrt(0.0006 * d) * normal(random);
      const double turn = w * dt + std::sqrt(0.0008 * d + 0.0012 * a) * normal(random);
      const double middle = theta + turn / 2;
      x += forward * std::cos(middle) - lateral * std::sin(middle);
      y += forward * std::sin(middle) + lateral * std::cos(middle);
      theta += turn;
    }
    ends.row(n) << x, y, theta;
  }
  const Eigen::MatrixX3d centred = ends.rowwise() - ends.colwise().mean();
  const Eigen::Matrix3d sampled = centred.transpose() * centred / (drives - 1);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double scale = std::sqrt(sampled(i, i) * sampled(j, j));
      EXPECT_NEAR(odometry.covariance()(i, j) / scale, sampled(i, j) / scale, 0.04) << i << j;
    }
  }
}

TEST(Odometry, TimeMustGoForward) {
  k::Odometry odometry(kNoise);
  for (const double dt : {0.0, -0.1, kNan}) EXPECT_THROW(odometry.advance(0.1, 0, dt), std::invalid_argument);
}

}  // namespace test_base
