// SPDX-License-Identifier: BSD-3-Clause
// Odometry's covariance under coloured noise against closed forms; the gyro against motions that are known.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "base/drive.h"
#include "base/odometry/gyro.h"
#include "base/odometry/odometry.h"
#include "base/odometry/reckoning.h"
#include "base/odometry/yaw_rate.h"
#include "base/odometry_report.h"
#include "base_drive.h"

namespace test_odometry {

namespace k = kurumaisu;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kTick = 0.02;
const k::GyroSettings kGyro{0.1, 1e-5, 0.01, 1e-4, 0.1, 1.0, 1.0, 0.01};

k::OdometryNoise coloured(double sd_v, double sd_w, double tau, double growth = 0) {
  return {0, 0, 0, 0, 0, {sd_v, sd_w, tau, growth}};
}

/// Variance of the integral over T of a stationary Ornstein-Uhlenbeck process (Papoulis).
double integrated(double sd, double tau, double T) {
  return 2 * sd * sd * tau * tau * (T / tau - 1 + std::exp(-T / tau));
}

k::Odometry driven(const k::OdometryNoise& noise, double v, double w, double seconds, double tick) {
  k::Odometry odometry(noise);
  const int count = static_cast<int>(std::lround(seconds / tick));
  for (int i = 0; i < count; ++i) odometry.advance(v, w, tick);
  return odometry;
}

}  // namespace

TEST(RateNoise, GrowsAsAnOrnsteinUhlenbeckProcessIntegrated) {
  for (const double tau : {0.005, 0.3, 6.0, 1000.0}) {
    for (const double tick : {0.0005, 0.02, 0.5}) {
      const k::Odometry spun = driven(coloured(0.0, 0.02, tau), 0, 0.7, 4.0, tick);
      const double heading = integrated(0.02, tau, 4.0);
      EXPECT_NEAR(spun.covariance()(2, 2) / heading, 1, 1e-6) << tau << " " << tick;
      const k::Odometry drove = driven(coloured(0.03, 0.0, tau), 0.5, 0, 4.0, tick);
      EXPECT_NEAR(drove.covariance()(0, 0) / integrated(0.03, tau, 4.0), 1, 1e-6) << tau << " " << tick;
      EXPECT_EQ(drove.covariance()(1, 1), 0);
    }
  }
}

TEST(RateNoise, GrowsWithTheRates) {
  const k::Odometry odometry = driven(coloured(0.03, 0.02, 0.3, 2.0), 0.0, 0.4, 5.0, kTick);
  EXPECT_NEAR(odometry.covariance()(2, 2) / integrated(0.02 * (1 + 2.0 * 0.4 / 0.8), 0.3, 5.0), 1, 1e-9);
}

TEST(RateNoise, AChairThatStandsGainsNone) {
  k::Odometry odometry = driven(coloured(0.03, 0.02, 0.3), 0.5, 0.1, 2.0, kTick);
  const Eigen::Matrix3d before = odometry.covariance();
  odometry.advance(0, 0, 60.0);
  EXPECT_NEAR((odometry.covariance() - before).norm(), 0, 1e-15);
  EXPECT_EQ(odometry.rateVariance(), Eigen::Vector3d::Zero());
}

TEST(RateNoise, AResetForgetsThePoseNotTheNoise) {
  k::Odometry odometry = driven(coloured(0.03, 0.02, 0.3), 0.5, 0.1, 2.0, kTick);
  odometry.reset();
  EXPECT_EQ(odometry.covariance(), Eigen::Matrix3d::Zero());
  for (int i = 0; i < 50; ++i) odometry.advance(0, 0.7, kTick);
  EXPECT_NEAR(odometry.covariance()(2, 2) / integrated(0.02, 0.3, 1.0), 1, 1e-9);
}

TEST(RateNoise, AFilterThatTakesTicksForIndependentGetsThePosesGrowth) {
  const double seconds = 300;
  const k::Odometry odometry = driven(coloured(0.0, 0.02, 0.3), 0, 0.7, seconds, kTick);
  const double filtered = odometry.rateVariance()[2] * kTick * kTick * (seconds / kTick);
  EXPECT_NEAR(filtered / odometry.covariance()(2, 2), 1, 0.002);
}

class GyroTest : public testing::Test {
 protected:
  /// Samples at 100 Hz of a truth, with the gyro's bias and noise, that arrive `late` after their stamps; ticks at
  /// 50 Hz. Returns what turns there were.
  template <typename Rate>
  double run(double seconds, bool neutral, Rate truth, double late = 0) {
    double turned = 0;
    const double end = t + seconds - 1e-9;
    while (t < end) {
      const double from = t;
      t += kTick;
      for (; next + late <= t; next += 0.01)
        gyro.add(truth(next) + bias + scatter(random), 0, next, next + late);
      gyro.setNeutral(neutral, from);
      const auto turn = gyro.turn(from, t);
      if (turn) turned += turn->angle;
      if (!turn) ++without;
    }
    return turned;
  }

  double still(double seconds) {
    return run(seconds, true, [](double) { return 0.0; });
  }

  k::Gyro gyro{kGyro};
  double bias = 0.013, t = 50, next = 50.003;
  int without = 0;
  std::mt19937_64 random{3};
  std::normal_distribution<double> scatter{0, 0.002};
};

TEST_F(GyroTest, TheBiasIsKnownAfterAStandstill) {
  EXPECT_EQ(still(1.9), 0);
  EXPECT_FALSE(gyro.bias());
  still(20);
  ASSERT_TRUE(gyro.bias());
  EXPECT_NEAR(gyro.bias()->rate, bias, 4 * std::sqrt(gyro.bias()->variance));
  EXPECT_LT(gyro.bias()->variance, 1e-7);
  EXPECT_TRUE(gyro.standing());
}

TEST_F(GyroTest, TheTurnIsTheIntegralOfTheRateAlsoWhenSamplesComeLate) {
  scatter = std::normal_distribution<double>(0, 1e-9);
  still(5);
  for (const double late : {0.0, 0.03}) {
    const double start = t;
    const double turned = run(
        10, false, [start](double s) { return 0.8 * std::sin(2 * (s - start)); }, late);
    EXPECT_NEAR(turned, 0.4 * (1 - std::cos(2 * 10.0)), late * 0.9 + 1e-3) << late;
    run(0.5, false, [](double) { return 0.0; });  // what came late is in now
  }
  EXPECT_EQ(gyro.counts().refused, 0U);
}

TEST_F(GyroTest, NothingOfALateSampleIsLost) {
  scatter = std::normal_distribution<double>(0, 1e-9);
  still(5);
  const double start = t;
  const auto pulse = [start](double s) { return s > start && s < start + 3 ? 0.5 : 0.0; };
  const double turned = run(4, false, pulse, 0.05);
  EXPECT_NEAR(turned, 1.5, 0.006);  // half a sample at either end
}

TEST_F(GyroTest, AParkedChairDoesNotTurnAndAPushedOneDoes) {
  still(5);
  EXPECT_EQ(still(600), 0);
  const double pushed = run(4, true, [](double) { return 0.2; });
  EXPECT_NEAR(pushed, 0.8, 0.02);
  EXPECT_NEAR(gyro.bias()->rate, bias, 0.001);
}

TEST_F(GyroTest, ASteadyTurnOfAChairThatIsPushedIsNoBias) {
  run(60, true, [](double) { return 0.25; });
  EXPECT_FALSE(gyro.bias());
  EXPECT_EQ(gyro.counts().biases, 0U);
}

TEST_F(GyroTest, AShakenChairGivesNoBias) {
  scatter = std::normal_distribution<double>(0, 0.05);
  still(30);
  EXPECT_FALSE(gyro.bias());
}

TEST_F(GyroTest, WithoutSamplesThereIsNoTurnUntilTheyAreBack) {
  still(5);
  without = 0;
  run(1, false, [](double) { return 0.3; });
  EXPECT_EQ(without, 0);
  const double gap_end = next + 2.0;
  while (t < gap_end) {
    gyro.setNeutral(false, t);
    if (!gyro.turn(t, t + kTick)) ++without;
    t += kTick;
  }
  EXPECT_NEAR(without, (2.0 - kGyro.timeout) / kTick, 2);
  EXPECT_EQ(gyro.counts().fallbacks, 1U);
  next = t;
  const double turned = run(1, false, [](double) { return 0.3; });
  EXPECT_NEAR(turned, 0.3, 0.01);  // not the gap again
}

TEST_F(GyroTest, WhatIsNoSampleIsRefusedAndCounted) {
  still(5);
  const double now = next;
  const std::uint64_t before = gyro.counts().samples;
  EXPECT_NE(gyro.add(kNan, 0, now, now), "");
  EXPECT_NE(gyro.add(kInfinity, 0, now, now), "");
  EXPECT_NE(gyro.add(0.1, -1, now, now), "");
  EXPECT_NE(gyro.add(0.1, kNan, now, now), "");
  EXPECT_NE(gyro.add(0.1, 0, kNan, now), "");
  EXPECT_NE(gyro.add(0.1, 0, now - 5, now), "");     // of the past
  EXPECT_NE(gyro.add(0.1, 0, now + 5, now), "");     // of the future
  EXPECT_NE(gyro.add(0.1, 0, now - 0.05, now), "");  // out of order
  EXPECT_EQ(gyro.counts().refused, 8U);
  EXPECT_EQ(gyro.counts().samples, before + 8);
  EXPECT_NEAR(gyro.turn(t, t + kTick)->angle, 0, 1e-12);  // and none of them has turned anything
}

TEST(Reckoning, WithAGyroTheTurnIsTheGyros) {
  k::Reckoning reckoning({0.01, 0.0005, 0.001, 0.005, 0.02}, kGyro);
  double t = 10;
  const auto drive = [&](double seconds, double v, double w, double truth) {
    for (const double end = t + seconds - 1e-9; t < end; t += kTick) {
      for (const double at : {t + 0.01, t + kTick}) reckoning.gyro()->add(truth + 0.02, 0, at, at);
      reckoning.advance(v, w, t, t + kTick);
    }
  };
  drive(3, 0, 0, 0);
  drive(10, 0.0, 0.5, 0.4);  // a fifth less than commanded
  EXPECT_NEAR(reckoning.odometry().pose().theta, 4.0, 0.02);
  EXPECT_NEAR(reckoning.odometry().w(), 0.4, 1e-6);
  const double sd = std::sqrt(reckoning.odometry().covariance()(2, 2));
  EXPECT_LT(sd, 0.06);  // 1 % of scale and 1e-4 of bias; 0.32 by the growth of 0.02 per radian
  EXPECT_GT(sd, 0.03);
}

TEST(Reckoning, BiasScaleAndNoiseOfAGyroAddUpAsTheyMust) {
  const double T = 20, w = 0.5, bias = 1e-6, walk = 1e-4, scale = 1e-4, density = 1e-6;
  k::Odometry odometry(coloured(0, 0.5, 3.0));  // of the open loop: it must not count
  odometry.setGyroScale(scale);
  odometry.setGyroBias(bias, walk);
  for (int i = 0; i < 1000; ++i) odometry.advance(0, k::Turn{w * kTick, density * kTick}, kTick);
  const double expected = bias * T * T + walk * walk * T * T * T / 3 + scale * w * w * T * T + density * T;
  EXPECT_NEAR(odometry.covariance()(2, 2) / expected, 1, 0.001);
  EXPECT_EQ(odometry.covariance()(0, 0), 0);
}

TEST(YawRate, IsAboutTheBasesAxisWhereverTheSensorPointsTo) {
  std::array<double, 9> covariance{4, 0, 0, 0, 9, 0, 0, 0, 16};
  const Eigen::Vector3d rates(0.1, 0.2, 0.3);
  EXPECT_EQ(k::yawRate({0, 0, 1}, rates, covariance)->rate, 0.3);
  EXPECT_EQ(k::yawRate({0, 0, -1}, rates, covariance)->rate, -0.3);
  EXPECT_EQ(k::yawRate({0, 0, -1}, rates, covariance)->variance, 16);
  const auto tilted = k::yawRate({0.6, 0, 0.8}, rates, covariance);
  EXPECT_NEAR(tilted->rate, 0.06 + 0.24, 1e-12);
  EXPECT_NEAR(tilted->variance, 0.36 * 4 + 0.64 * 16, 1e-12);
  covariance[0] = -1;
  EXPECT_FALSE(k::yawRate({0, 0, 1}, rates, covariance));
}

TEST(OdometryReport, SaysWhatTheModelHasAndOdometryHasNot) {
  const k::Reckoning open({0.01, 0.0005, 0.001, 0.005, 0.02}, std::nullopt);
  EXPECT_EQ(k::unfollowedWarning({}), "");
  EXPECT_NE(k::unfollowedWarning({"base.lag_v", "base.veer"}).find("base.lag_v, base.veer"),
            std::string::npos);
  EXPECT_FALSE(k::reportOdometry(open, {}, true, {}).warning);
  EXPECT_TRUE(k::reportOdometry(open, {"base.lag_v"}, true, {}).warning);
  const k::Reckoning with({0, 0, 0, 0, 0}, kGyro);
  EXPECT_EQ(k::reportOdometry(with, {}, true, {}).summary, "open loop: the gyro's bias is not known yet");
}

namespace {

class NoDac : public k::Dac {
 public:
  k::Output put(const k::Output& output) override { return output; }
  double patience() const override { return std::numeric_limits<double>::infinity(); }
};

}  // namespace

TEST(Placing, WhileItMovesCountsTheWayUpToThen) {
  NoDac dac;
  k::DriveSettings settings = k::test::driveSettings(k::test::kQuick);
  settings.noise = {};
  settings.arbiter.inputs[0].timeout = 10;
  k::Drive drive(settings, dac);
  drive.tick(10.0);
  drive.command(0, "/a", {0.0, 0.0}, 10.0);  // released
  drive.command(0, "/a", {1.0, 0.0}, 10.0);
  for (int i = 1; i <= 50; ++i) drive.tick(10.0 + i * kTick);
  const double v = drive.output().v;
  ASSERT_GT(v, 0);
  drive.place({5, 6, M_PI / 2}, Eigen::Matrix3d::Identity(), 11.0 + 0.015);
  EXPECT_EQ(drive.odometry().pose().x, 5);
  EXPECT_EQ(drive.output().v, v);  // the chair notices nothing
  drive.tick(11.0 + kTick);
  EXPECT_NEAR(drive.odometry().pose().x, 5, 1e-12);
  EXPECT_NEAR(drive.odometry().pose().y, 6 + v * 0.005, 1e-9);
  EXPECT_NEAR(drive.odometry().covariance()(0, 0), 1 + v * v * 0.005 * 0.005,
              1e-9);  // heading's variance is 1
}

}  // namespace test_odometry
