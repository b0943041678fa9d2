// SPDX-License-Identifier: BSD-3-Clause
// The base without ROS: commands in, voltages and odometry out.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include "base/drive.h"
#include "base/odometry.h"
#include "base/report.h"

namespace k = kurumaisu;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPeriod = 0.02;

const k::AxisLaw kTranslation{{1.32402, 0.127906}, {2.07369, -0.108783}};
const k::AxisLaw kSteering{{-0.499211, 0.104181}, {-0.469278, -0.169476}};
const k::AxisLaw kSteeringCorrected{{-0.499211, -0.104181}, {-0.469278, 0.169476}};
const k::OdometryNoise kNoise{0.01, 0.0005, 0.001, 0.005, 0.02};
const k::DriveSettings kSettings{{kTranslation, kSteering}, 2.5, {1.5, 0.8, 1.2}, 0.25, kNoise};

class Recorder : public k::Dac {
 public:
  void put(const k::Output& output) override { outputs.push_back(output); }
  std::vector<k::Output> outputs;
};

class DriveTest : public testing::Test {
 protected:
  /// Ticks from now on for so many seconds; returns the time of the last tick.
  double run(double seconds) {
    for (const double end = t + seconds - 0.5 * kPeriod; t < end;) drive.tick(t += kPeriod);
    return t;
  }

  void expectNeutral() const {
    const k::Output& last = dac.outputs.back();
    EXPECT_EQ(last.translation, 0.0);
    EXPECT_EQ(last.steering, 0.0);
    EXPECT_EQ(last.reference, 2.5);
    EXPECT_EQ(last.v, 0.0);
    EXPECT_EQ(last.w, 0.0);
  }

  Recorder dac;
  k::Drive drive{kSettings, dac};
  double t = 100.0;
};

}  // namespace

TEST_F(DriveTest, NeutralIsPutOutBeforeAnyCommand) {
  ASSERT_EQ(dac.outputs.size(), 1U);
  expectNeutral();
  run(1.0);
  EXPECT_EQ(dac.outputs.size(), 51U);
  expectNeutral();
  EXPECT_EQ(drive.counts().timeouts, 0U);
}

TEST_F(DriveTest, ACommandBecomesTheVoltagesOfEquations1And2) {
  EXPECT_TRUE(drive.command(0.5, 0.3, t));
  run(kPeriod);
  const k::Output& output = dac.outputs.back();
  EXPECT_NEAR(output.translation, 0.789916, 1e-12);
  EXPECT_NEAR(output.steering, -0.0455823, 1e-12);
  EXPECT_EQ(output.reference, 2.5);
  EXPECT_EQ(output.v, 0.5);
  EXPECT_EQ(output.w, 0.3);
}

TEST_F(DriveTest, SilenceIsNeutralAfterTheTimeout) {
  drive.command(0.5, 0.0, t);
  run(0.24);
  EXPECT_EQ(dac.outputs.back().v, 0.5);
  run(0.04);
  expectNeutral();
  EXPECT_EQ(drive.counts().timeouts, 1U);
  run(1.0);
  EXPECT_EQ(drive.counts().timeouts, 1U);
}

TEST_F(DriveTest, ACommandToRestMayRunOutUnnoticed) {
  drive.command(0, 0, t);
  run(1.0);
  EXPECT_EQ(drive.counts().timeouts, 0U);
}

TEST_F(DriveTest, WhatIsNotFiniteIsRefusedAndKeepsNothingAlive) {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    EXPECT_FALSE(drive.command(bad, 0.0, t));
    EXPECT_FALSE(drive.command(0.0, bad, t));
  }
  EXPECT_EQ(drive.counts().refused, 6U);
  run(0.1);
  expectNeutral();

  drive.command(0.5, 0.0, t);
  for (int i = 0; i < 20; ++i) {
    drive.command(kNan, 0.0, t);
    run(kPeriod);
    EXPECT_TRUE(std::isfinite(dac.outputs.back().translation));
  }
  expectNeutral();
  EXPECT_EQ(drive.counts().refused, 26U);
  EXPECT_NEAR(drive.odometry().pose().x, 0.5 * 0.24, 0.5 * 1.01 * kPeriod);
}

TEST_F(DriveTest, EachRateIsClampedByItself) {
  const struct {
    double v, w, clamped_v, clamped_w;
  } cases[] = {
      {9.0, 0.1, 1.5, 0.1}, {-9.0, 0.1, -0.8, 0.1}, {0.1, 9.0, 0.1, 1.2}, {1e300, -1e300, 1.5, -1.2}};
  for (const auto& c : cases) {
    EXPECT_TRUE(drive.command(c.v, c.w, t));
    run(kPeriod);
    EXPECT_EQ(dac.outputs.back().v, c.clamped_v);
    EXPECT_EQ(dac.outputs.back().w, c.clamped_w);
    EXPECT_EQ(dac.outputs.back().translation, kTranslation.volts(c.clamped_v));
  }
  drive.command(1.5, -1.2, t);
  EXPECT_EQ(drive.counts().clamped, 4U);
}

TEST_F(DriveTest, OdometryFollowsTheClampedRateOverTheTimeThatReallyPassed) {
  drive.tick(t);
  drive.command(9.0, 0.0, t);
  drive.tick(t + 0.01);
  drive.tick(t + 0.02);  // 1.5 m/s for 10 ms
  EXPECT_NEAR(drive.odometry().pose().x, 0.015, 1e-12);
  drive.tick(t + 0.22);  // a late tick: the converter has held the voltage all the while
  EXPECT_NEAR(drive.odometry().pose().x, 0.315, 1e-12);
  EXPECT_EQ(drive.odometry().v(), 1.5);
  EXPECT_EQ(drive.tick(t + 0.22), k::Drive::Tick::kRepeated);
  EXPECT_NEAR(drive.odometry().pose().x, 0.315, 1e-12);
}

TEST_F(DriveTest, WhenTheClockRunsBackwardsEverythingStartsAfresh) {
  drive.command(0.5, 0.2, t);
  run(0.2);
  EXPECT_GT(drive.odometry().pose().x, 0.05);
  drive.command(0.5, 0.2, t);
  EXPECT_EQ(drive.tick(3.0), k::Drive::Tick::kReset);
  expectNeutral();
  EXPECT_EQ(drive.odometry().pose().x, 0.0);
  EXPECT_EQ(drive.odometry().covariance(), Eigen::Matrix3d::Zero());
  EXPECT_EQ(drive.counts().time_resets, 1U);

  t = 3.0;
  run(1.0);
  expectNeutral();  // the command from the future is forgotten
  drive.command(0.5, 0.0, t);
  run(kPeriod);
  EXPECT_EQ(dac.outputs.back().v, 0.5);
}

TEST_F(DriveTest, StopIsNeutralAtOnceAndDropsTheCommand) {
  drive.command(0.5, 0.2, t);
  run(0.1);
  drive.stop(t += 0.005);
  expectNeutral();
  run(0.1);
  expectNeutral();
}

TEST_F(DriveTest, SamplesInTheAmbiguousBandAreCounted) {
  ASSERT_TRUE(drive.steeringBand());
  EXPECT_EQ(drive.steeringBand()->low, -0.169476);
  EXPECT_EQ(drive.steeringBand()->high, 0.104181);
  EXPECT_FALSE(drive.translationBand());
  run(0.1);
  EXPECT_EQ(drive.counts().ambiguous, 0U);  // 0 V is rest
  drive.command(0.0, 0.3, t);
  run(0.1);
  EXPECT_EQ(drive.counts().ambiguous, 5U);
  drive.command(0.0, 1.0, t);
  run(0.1);
  EXPECT_EQ(drive.counts().ambiguous, 5U);
}

TEST(Band, OnlyOverlappingBranchesMakeOne) {
  EXPECT_FALSE(k::ambiguousBand(kSteeringCorrected));
  EXPECT_FALSE(k::ambiguousBand({{1.0, 0.0}, {1.0, 0.0}}));
  const auto rising = k::ambiguousBand({{1.0, -0.2}, {1.0, 0.3}});
  ASSERT_TRUE(rising);
  EXPECT_EQ(rising->low, -0.2);
  EXPECT_EQ(rising->high, 0.3);
}

TEST(Band, AgreesWithTheLawItself) {
  const auto band = k::ambiguousBand(kSteering);
  ASSERT_TRUE(band);
  for (int i = -400; i <= 400; ++i) {
    if (i == 0) continue;  // 0 V is rest
    EXPECT_EQ(band->contains(i * 1e-3), kSteering.ambiguous(i * 1e-3)) << i;
  }
}

TEST(Report, TheLawWarnsOfItsBand) {
  Recorder dac;
  const k::Report published = k::reportLaw(k::Drive(kSettings, dac), "published");
  EXPECT_TRUE(published.warning);
  EXPECT_NE(published.summary.find("V_s in (-0.169476, 0.104181) V"), std::string::npos) << published.summary;
  k::DriveSettings settings = kSettings;
  settings.law.steering = kSteeringCorrected;
  EXPECT_FALSE(k::reportLaw(k::Drive(settings, dac), "corrected").warning);
}

TEST(Report, ARefusedCommandWarnsOnce) {
  Recorder dac;
  k::Drive drive(kSettings, dac);
  drive.command(kNan, 0, 0);
  const k::Report first = k::reportCommands(drive, {});
  EXPECT_TRUE(first.warning);
  EXPECT_EQ(first.summary, "command refused");
  EXPECT_FALSE(k::reportCommands(drive, drive.counts()).warning);
}

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

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
