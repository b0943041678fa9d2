// SPDX-License-Identifier: BSD-3-Clause
// Distance field, sensor and motion model against values worked out by hand.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>
#include <stdexcept>

#include "slam/basics/pose.h"
#include "slam/localization/doubt.h"
#include "slam/localization/field.h"
#include "slam/localization/motion.h"
#include "slam/localization/sensor.h"

namespace test_localizer_parts {

namespace k = kurumaisu;

namespace {

k::OccupancyGrid empty(int width, int height, double edge) {
  return {edge, 0, 0, width, height, std::vector<std::int8_t>(static_cast<std::size_t>(width) * height)};
}

/// Distance [m] of the middle of a cell.
double at(const k::Field& field, int x, int y) {
  return field.distance(field.code(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F));
}

TEST(Field, IsTheDistanceToTheNearestWallByAllPairs) {
  std::mt19937 random(3);
  auto grid = empty(60, 45, 0.05);
  for (int i = 0; i < 25; ++i) grid.cells[random() % grid.cells.size()] = 100;  // single cells: thin
  const k::Field field(grid, {0, 0, 0}, 0.4);
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      double nearest = 0.4;
      for (int i = 0; i < static_cast<int>(grid.cells.size()); ++i) {
        if (grid.cells[i] != 100) continue;
        nearest = std::fmin(nearest, 0.05 * std::hypot(x - i % grid.width, y - i / grid.width));
      }
      ASSERT_NEAR(at(field, x, y), nearest, 0.0011) << x << " " << y;
    }
  }
}

TEST(Field, AThickWallEndsWhereItsCellsEnd) {
  auto grid = empty(40, 20, 0.05);
  for (int y = 0; y < 20; ++y) {
    for (int x = 20; x < 40; ++x) grid.cells[y * 40 + x] = 100;
  }
  const k::Field field(grid, {0, 0, 0}, 0.4);
  EXPECT_NEAR(at(field, 19, 10), 0.025, 0.0011);  // its edge is the cell's
  EXPECT_NEAR(at(field, 15, 10), 0.225, 0.0011);
  EXPECT_NEAR(at(field, 20, 10), -0.025, 0.0011);
  EXPECT_NEAR(at(field, 21, 10), -0.075, 0.0011);
  double distance = 0;
  double along_x = 0;
  double along_y = 0;
  ASSERT_TRUE(field.slope(19.0, 10.2, distance, along_x, along_y));
  EXPECT_NEAR(distance, 0.05, 0.002);
  EXPECT_NEAR(along_x, -1, 0.06);
  EXPECT_NEAR(along_y, 0, 1e-9);
  EXPECT_EQ(field.freeCells(), 400U);
  EXPECT_EQ(field.wallCells(), 400U);
}

TEST(Field, PlacesThatAreNoneAreFarFromAllWalls) {
  auto grid = empty(4, 4, 0.1);
  grid.cells.assign(16, 100);
  const k::Field field(grid, {0, 0, 0}, 0.4);
  const float nan = std::nanf("");
  for (const float bad : {-0.1F, 4.0F, 1e30F, -1e30F, nan, INFINITY}) {
    EXPECT_EQ(field.code(bad, 1), k::Field::kFar);
    EXPECT_EQ(field.code(1, bad), k::Field::kFar);
    EXPECT_FALSE(field.known(bad, 1));
  }
}

TEST(Field, SenselessMapsAreRefused) {
  EXPECT_THROW(k::Field(empty(0, 0, 0.05), {0, 0, 0}, 0.4), std::invalid_argument);
  EXPECT_THROW(k::Field(empty(4, 4, 0), {0, 0, 0}, 0.4), std::invalid_argument);
  EXPECT_THROW(k::Field(empty(4, 4, std::nan("")), {0, 0, 0}, 0.4), std::invalid_argument);
  EXPECT_THROW(k::Field(empty(4, 4, 0.5), {0, 0, 0}, 0.4), std::invalid_argument);
  auto torn = empty(4, 4, 0.05);
  torn.cells.resize(15);
  EXPECT_THROW(k::Field(torn, {0, 0, 0}, 0.4), std::invalid_argument);
}

const k::ReadingSettings kReading{60, 30, 0.52, 0.05, 0.95, 0.05, 0.4, 0.2};
const k::LaserError kUrg{1, 0, {0.002334, -0.000488, 0.000199}, 0.001, 0.06, 5.6};

TEST(Beams, AreEvenlySpreadAndWithoutTheMotionDuringTheScan) {
  const k::Fan fan{-1.0, 0.01, 1e-3, 5, {0.2, 0, 0}};
  k::Scan scan{0, fan, std::vector<float>(200, 2.0F)};
  scan.ranges[1] = std::nanf("");
  const k::Beams still = k::pick(scan, {0, 0, 0}, kReading);
  EXPECT_EQ(still.beams.size(), 50U);
  const k::Beams moving = k::pick(scan, {0.1, 0, 0.2}, kReading);
  for (std::size_t i = 0; i < 50; ++i) {
    const double n = 2.0 + 4.0 * static_cast<double>(i);
    const double bearing = -1.0 + 0.01 * n;
    EXPECT_NEAR(still.beams[i].x, 0.2 + 2 * std::cos(bearing), 1e-5);
    const double turned = 0.2 * n / 199;
    const double x =
        0.1 * n / 199 + std::cos(turned) * still.beams[i].x - std::sin(turned) * still.beams[i].y;
    EXPECT_NEAR(moving.beams[i].x, x, 1e-5);
  }
  // Every fourth of an autoregressive row: (1 - 0.52^4) / (1 + 0.52^4).
  EXPECT_NEAR(still.independence, 0.8637, 1e-3);
}

TEST(Beams, WhatIsNoReadingIsLeftOut) {
  const k::Fan fan{-1.0, 0.1, 0, 5, {0, 0, 0}};
  const float inf = std::numeric_limits<float>::infinity();
  const k::Scan scan{0, fan, {std::nanf(""), inf, -inf, 0.0F, -1.0F, 5.1F, 4.9F}};
  const k::Beams beams = k::pick(scan, {0, 0, 0}, kReading);
  ASSERT_EQ(beams.beams.size(), 1U);
  EXPECT_FLOAT_EQ(beams.beams[0].range, 4.9F);
}

// Whichever beams a laser leaves out: as many are weighed as of one that has no others.
TEST(Beams, AreThoseThatAreThere) {
  const k::Fan fan{-1.0, 0.01, 0, 5, {0, 0, 0}};
  for (int every = 2; every <= 4; ++every) {
    for (int first = 0; first < every; ++first) {
      k::Scan scan{0, fan, std::vector<float>(200, std::nanf(""))};
      for (int i = first; i < 200; i += every) scan.ranges[i] = 2.0F;
      EXPECT_EQ(k::pick(scan, {0, 0, 0}, kReading).beams.size(), 50U) << first << " of " << every;
    }
  }
}

TEST(Sensor, DeviationIsThatOfEquationFour) {
  const double of_laser = 0.002334 - 0.000488 * 30 + 0.000199 * 900;
  EXPECT_NEAR(k::deviationOf(k::kGrades - 1, kReading, kUrg), std::hypot(0.05, of_laser), 1e-9);
}

/// A wall of one column of cells at x = 2 m, in 6 x 4 m.
k::Field wall() {
  auto grid = empty(120, 80, 0.05);
  for (int y = 0; y < 80; ++y) grid.cells[y * 120 + 40] = 100;
  return {grid, {0, 0, 0}, 0.4};
}

k::Beams oneBeam(float range) { return {{0, 0, 0}, {{range, 0, range, 0}}, 1}; }

TEST(Sensor, TellsHitsFromThingsInTheWayAndFromWallsThatWereCrossed) {
  const k::Field field = wall();
  const k::Sensor sensor(field, kReading, kUrg);
  const k::Pose2D pose{1, 2, 0};
  EXPECT_EQ(sensor.look(oneBeam(1.025F), pose).hits, 1);
  EXPECT_EQ(sensor.look(oneBeam(0.5F), pose).shorts, 1);
  EXPECT_EQ(sensor.look(oneBeam(1.5F), pose).through, 1);
  EXPECT_EQ(sensor.look(oneBeam(9.0F), pose).through, 1);          // out of the map, through the wall
  EXPECT_EQ(sensor.look(oneBeam(1.5F), {1, 2, M_PI}).through, 1);  // out of the map
  EXPECT_GT(sensor.weigh(oneBeam(1.025F), pose), sensor.weigh(oneBeam(1.1F), pose));
  EXPECT_GT(sensor.weigh(oneBeam(1.1F), pose), sensor.weigh(oneBeam(0.5F), pose));
  EXPECT_EQ(sensor.weigh(oneBeam(0.5F), pose), 0);
}

TEST(Sensor, WhatHidesAWallCountsHalfAgainstTheFitAndWhatCrossesItDouble) {
  k::Fit fit;
  EXPECT_EQ(fit.share(), 0);
  fit.hits = 6;
  EXPECT_EQ(fit.share(), 1);
  fit.shorts = 4;
  EXPECT_DOUBLE_EQ(fit.share(), 6.0 / 8);
  fit.through = 2;
  EXPECT_DOUBLE_EQ(fit.share(), 6.0 / 12);
}

/// Only what doubt depends on.
const k::RecoverySettings kRecovery = [] {
  k::RecoverySettings settings{};
  settings.alpha_slow = 0.002;
  settings.alpha_fast = 0.15;
  settings.lost_fit = 0.5;
  settings.lost_drop = 0.88;
  settings.found_fit = 0.93;
  settings.found_way = 1.5;
  return settings;
}();

/// Scans of one fit after minutes of another, until it is doubted; a hundred if never.
int scansUntilDoubt(double usual, double now) {
  k::Health health;
  k::Doubt doubt(kRecovery);
  for (int i = 0; i < 2000; ++i) {
    health.take(usual, kRecovery);
    if (doubt.judge(health, 0) != k::Doubt::Step::kNone) return 0;
  }
  for (int i = 1; i < 100; ++i) {
    health.take(now, kRecovery);
    if (doubt.judge(health, 0) == k::Doubt::Step::kWiden) return i;
  }
  return 100;
}

TEST(Doubt, BeginsWhenTheFitFallsBelowItsShareOfTheUsual) {
  EXPECT_EQ(scansUntilDoubt(1, 0.89), 100);
  EXPECT_EQ(scansUntilDoubt(0.8, 0.72), 100);  // of the usual, not of 1
  EXPECT_LE(scansUntilDoubt(1, 0.80), 10);     // a second
  EXPECT_LE(scansUntilDoubt(0.8, 0.6), 10);
  EXPECT_LE(scansUntilDoubt(1, 0.2), 2);      // plainly elsewhere
  EXPECT_EQ(scansUntilDoubt(0.45, 0.45), 0);  // bad as ever is bad, too
}

TEST(Doubt, ANewPoseHasAFewScansToSettle) {
  k::Health health;
  k::Doubt doubt(kRecovery);
  for (int i = 0; i < 8; ++i) {
    health.take(0.1, kRecovery);
    EXPECT_EQ(doubt.judge(health, 0), k::Doubt::Step::kNone) << i;
  }
  health.take(0.1, kRecovery);
  EXPECT_EQ(doubt.judge(health, 0), k::Doubt::Step::kWiden);
  EXPECT_TRUE(doubt.standing());
}

/// A pose that fitted perfectly and is doubted now.
struct Doubted {
  Doubted() {
    for (int i = 0; i < 2000; ++i) health.take(1, kRecovery);
    while (doubt.judge(health, 0) != k::Doubt::Step::kWiden) health.take(0.7, kRecovery);
  }
  k::Doubt::Step after(double fit, double travelled, int scans) {
    k::Doubt::Step step{};
    for (int i = 0; i < scans && step != k::Doubt::Step::kSearch; ++i) {
      health.take(fit, kRecovery);
      step = doubt.judge(health, travelled);
    }
    return step;
  }
  k::Health health;
  k::Doubt doubt{kRecovery};
};

TEST(Doubt, EndsWhenTheFitIsAsUsualAgainAndHasHeldForAWay) {
  Doubted at_rest;
  EXPECT_EQ(at_rest.after(1, 0, 100), k::Doubt::Step::kNone);
  EXPECT_TRUE(at_rest.doubt.standing());  // at rest it proves nothing
  Doubted driven;
  EXPECT_EQ(driven.after(1, 1.6, 40), k::Doubt::Step::kNone);
  EXPECT_FALSE(driven.doubt.standing());
}

TEST(Doubt, NineOfTenReadingsAreNotEnough) {
  Doubted nearly;  // as from a wrong corridor
  EXPECT_EQ(nearly.after(0.92, 1.6, 40), k::Doubt::Step::kNone);
  EXPECT_TRUE(nearly.doubt.standing());
  EXPECT_EQ(nearly.after(0.92, 4.6, 1), k::Doubt::Step::kSearch);
}

TEST(Doubt, LeadsToASearchWhenTheNeighbourhoodDoesNotFitEither) {
  Doubted elsewhere;
  EXPECT_EQ(elsewhere.after(0.7, 0, 7), k::Doubt::Step::kNone);
  EXPECT_EQ(elsewhere.after(0.7, 0, 1), k::Doubt::Step::kSearch);
}

TEST(Sensor, AlignsToAWallAcrossIt) {
  const k::Field field = wall();
  const k::Sensor sensor(field, kReading, kUrg);
  k::Beams beams{{0, 0, 0}, {}, 1};
  for (int i = -20; i <= 20; ++i) {  // from (1, 2), heading 0
    const double y = 0.05 * i;
    beams.beams.push_back({1.025F, static_cast<float>(y), static_cast<float>(std::hypot(1.025, y)), 0});
  }
  Eigen::Matrix3d prior = Eigen::Matrix3d::Zero();
  prior.diagonal() << 25, 25, 100;
  const auto found = sensor.align(beams, {0.9, 2.05, 0.06}, prior, 20);
  EXPECT_NEAR(found.pose.x, 1, 0.01);
  EXPECT_NEAR(found.pose.theta, 0, 0.01);
  EXPECT_NEAR(found.pose.y, 2.05, 0.01);  // nothing says otherwise
  const Eigen::Matrix3d covariance = found.information.inverse();
  EXPECT_LT(std::sqrt(covariance(0, 0)), 0.02);
  EXPECT_NEAR(std::sqrt(covariance(1, 1)), 0.2, 0.02);
}

const k::MotionSettings kMotion{0.1, 0.05, 0.1, 0.01, 0.003, 0.004};

TEST(Motion, NoiseOfTheSettings) {
  const auto moved = k::motionBetween({0, {1, 1, M_PI / 2}, std::nullopt},
                                      {1, {1, 3, M_PI / 2 + 0.5}, std::nullopt}, kMotion, {0, 0, 1, 0});
  EXPECT_NEAR(moved.mean.x, 2, 1e-12);
  EXPECT_NEAR(moved.mean.y, 0, 1e-12);
  EXPECT_NEAR(moved.covariance(0, 0), 0.1 * 4 + 0.01 * 0.25 + 9e-6, 1e-9);
  EXPECT_NEAR(moved.covariance(2, 2), 0.1 * 0.25 + 0.05 * 4 + 16e-6, 1e-9);
}

TEST(Motion, ATurnOverPiIsNone) {
  const auto moved = k::motionBetween({0, {0, 0, 3.1}, std::nullopt}, {1, {0, 0, -3.1}, std::nullopt},
                                      kMotion, {0, 0, 1, 0});
  EXPECT_NEAR(moved.mean.theta, 2 * M_PI - 6.2, 1e-9);
}

TEST(Motion, CovarianceThatOdometryGivesIsTakenAsItGrows) {
  // Two stretches in a row, their noises known: the growth between the sums is that of the second.
  k::Gaussian first{{1, 0.2, 0.3}, Eigen::Matrix3d::Zero()};
  first.covariance.diagonal() << 0.01, 0.02, 0.005;
  k::Gaussian second{{0.4, -0.1, 0.2}, Eigen::Matrix3d::Zero()};
  second.covariance.diagonal() << 0.003, 0.001, 0.002;
  const k::Gaussian sum = k::moved(first, second);
  const auto grown = k::motionBetween({0, first.mean, first.covariance}, {1, sum.mean, sum.covariance},
                                      kMotion, {0, 0, 1, 0});
  Eigen::Matrix3d expected = second.covariance;
  expected.diagonal() += Eigen::Vector3d(9e-6, 9e-6, 16e-6);
  EXPECT_TRUE(grown.covariance.isApprox(expected, 1e-6));
  // One that does not grow is no measure.
  const auto flat = k::motionBetween({0, first.mean, first.covariance}, {1, sum.mean, first.covariance},
                                     kMotion, {0, 0, 1, 0});
  EXPECT_GT(flat.covariance(0, 0), 0.1 * 0.16);
}

TEST(Motion, ProcessNoiseIsThatOfAnOrnsteinUhlenbeckProcess) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  constexpr double kTau = 0.3;
  constexpr double kDt = 0.01;
  double square = 0;
  constexpr int kRuns = 20000;
  for (int run = 0; run < kRuns; ++run) {
    double level = normal(random);
    double way = 0;
    for (int i = 0; i < 100; ++i) {
      way += 0.05 * level * kDt;
      const double decay = std::exp(-kDt / kTau);
      level = decay * level + std::sqrt(1 - decay * decay) * normal(random);
    }
    square += way * way / kRuns;
  }
  const k::MotionSettings none{0, 0, 0, 0, 1e-6, 1e-6};
  const auto moved = k::motionBetween({0, {0, 0, 0}, std::nullopt}, {1, {0.5, 0, 0}, std::nullopt}, none,
                                      {0.05, 0, kTau, 0});
  EXPECT_NEAR(moved.covariance(0, 0) / square, 1, 0.05);
}

}  // namespace

}  // namespace test_localizer_parts
