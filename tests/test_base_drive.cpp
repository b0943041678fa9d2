// SPDX-License-Identifier: BSD-3-Clause
// The base without ROS: commands in, voltages and odometry out, and what it does when something is wrong.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "base/report.h"
#include "base_drive.h"

namespace test_base_drive {

namespace k = kurumaisu;
using namespace kurumaisu::test;  // NOLINT(google-build-using-namespace)

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

TEST_F(DriveTest, NeutralIsPutOutBeforeAnyCommand) {
  Recorder dac;
  const k::Drive drive(driveSettings(kQuick), dac);
  ASSERT_EQ(dac.outputs.size(), 1U);
  EXPECT_EQ(dac.last().translation, 0.0);
  EXPECT_EQ(dac.last().reference, 2.5);
  EXPECT_EQ(chair.dac.outputs.size(), 16U);
  EXPECT_TRUE(chair.neutral());
}

TEST_F(DriveTest, ACommandBecomesTheVoltagesOfEquations1And2) {
  chair.say(0.5, 0.3);
  chair.run(kPeriod);
  const k::Output& output = chair.dac.last();
  EXPECT_NEAR(output.translation, 0.789916, 1e-12);
  EXPECT_NEAR(output.steering, -0.0455823, 1e-12);
  EXPECT_EQ(output.reference, 2.5);
  EXPECT_EQ(output.v, 0.5);
  EXPECT_EQ(output.w, 0.3);
}

// Fault 1
TEST_F(RideTest, SilenceIsNeutralWithinTimeoutAndSpeedOverDeceleration) {
  chair.say(1.5, 0.3);
  chair.run(4.0);
  ASSERT_EQ(chair.dac.last().v, 1.5);
  chair.silence();
  chair.run(0.24);
  EXPECT_EQ(chair.dac.last().v, 1.5);
  double last = 1.5;
  for (const double end = chair.t + 0.01 + 1.5 / 1.0 + 2 * kPeriod; chair.t < end;) {
    chair.run(kPeriod);
    ASSERT_LE(last - chair.dac.last().v, 1.0 * kPeriod + 1e-12);  // a ramp, not a jump
    last = chair.dac.last().v;
  }
  EXPECT_TRUE(chair.neutral());
  EXPECT_EQ(chair.drive.arbiter().counts().timeouts, 1U);
  chair.run(1.0);
  EXPECT_EQ(chair.drive.arbiter().counts().timeouts, 1U);
}

TEST_F(DriveTest, ACommandToRestMayRunOutUnnoticed) {
  chair.say(0, 0);
  chair.run(0.1);
  chair.silence();
  chair.run(1.0);
  EXPECT_EQ(chair.drive.arbiter().counts().timeouts, 0U);
}

// Fault 2
TEST_F(DriveTest, WhatIsNotFiniteOrAbsurdIsRefusedAndKeepsNothingAlive) {
  for (const double bad : {kNan, kInfinity, -kInfinity, 20.5, -1e300}) {
    EXPECT_FALSE(chair.drive.command(kNavigation, "/a", {bad, 0.0}, chair.t));
    EXPECT_FALSE(chair.drive.command(kNavigation, "/a", {0.0, bad}, chair.t));
  }
  EXPECT_EQ(chair.drive.arbiter().counts().refused, 10U);
  chair.run(0.1);
  EXPECT_TRUE(chair.neutral());

  chair.run(0.3);
  chair.say(0.5, 0.0);
  chair.run(kPeriod);
  EXPECT_EQ(chair.dac.last().v, 0.5);
  chair.say(kNan, 0.0);
  for (int i = 0; i < 20; ++i) {
    chair.run(kPeriod);
    EXPECT_TRUE(std::isfinite(chair.dac.last().translation));
  }
  EXPECT_TRUE(chair.neutral());
}

TEST_F(DriveTest, EachRateIsClampedByItself) {
  const struct {
    double v, w, clamped_v, clamped_w;
  } cases[] = {{9.0, 0.1, 1.5, 0.1}, {-9.0, 0.1, -0.8, 0.1}, {0.1, 19.0, 0.1, 1.2}, {9.9, -19.9, 1.5, -1.2}};
  for (const auto& c : cases) {
    chair.say(c.v, c.w);
    chair.run(2 * kPeriod);
    EXPECT_EQ(chair.dac.last().v, c.clamped_v);
    EXPECT_EQ(chair.dac.last().w, c.clamped_w);
    EXPECT_EQ(chair.dac.last().translation, kTranslation.volts(c.clamped_v));
  }
  EXPECT_EQ(chair.drive.counts().clamped, 8U);
}

TEST_F(DriveTest, OdometryFollowsTheClampedRateOverTheTimeThatReallyPassed) {
  chair.drive.command(kNavigation, "/a", {9.0, 0.0}, chair.t);
  chair.drive.tick(chair.t + 0.01);
  chair.drive.tick(chair.t + 0.02);  // 1.5 m/s for 10 ms
  EXPECT_NEAR(chair.drive.odometry().pose().x, 0.015, 1e-9);
  chair.drive.tick(chair.t + 0.22);  // a late tick: the converter has held the voltage all the while
  EXPECT_NEAR(chair.drive.odometry().pose().x, 0.315, 1e-9);
  EXPECT_EQ(chair.drive.odometry().v(), 1.5);
  EXPECT_EQ(chair.drive.tick(chair.t + 0.22), k::Drive::Tick::kRepeated);
  EXPECT_NEAR(chair.drive.odometry().pose().x, 0.315, 1e-9);
  EXPECT_EQ(chair.drive.counts().late_ticks, 1U);
}

// Fault 13
TEST_F(DriveTest, OdometryStopsWhenTheConverterLetsGoByItself) {
  chair.dac.held_for = 0.15;  // as behind a guard
  chair.drive.command(kNavigation, "/a", {1.0, 0.0}, chair.t);
  chair.drive.tick(chair.t + 0.01);
  chair.drive.tick(chair.t + 0.11);
  EXPECT_NEAR(chair.drive.odometry().pose().x, 0.1, 1e-9);
  chair.drive.tick(chair.t + 0.61);  // neutral since 0.26
  EXPECT_NEAR(chair.drive.odometry().pose().x, 0.25, 1e-9);
}

// Fault 8
TEST_F(RideTest, WhenTheClockRunsBackwardsEverythingStartsAfresh) {
  chair.say(0.5, 0.2);
  chair.run(1.5);
  EXPECT_GT(chair.drive.odometry().pose().x, 0.05);
  chair.drive.command(kNavigation, "/a", {0.5, 0.2}, chair.t);
  EXPECT_EQ(chair.drive.tick(3.0), k::Drive::Tick::kReset);
  EXPECT_TRUE(chair.neutral());
  EXPECT_EQ(chair.drive.odometry().pose().x, 0.0);
  EXPECT_EQ(chair.drive.odometry().covariance(), Eigen::Matrix3d::Zero());
  EXPECT_EQ(chair.drive.counts().time_resets, 1U);

  chair.t = 3.0;
  chair.run(1.0);  // who goes on as if nothing had happened is not obeyed
  EXPECT_TRUE(chair.neutral());
  chair.say(0.0, 0.0);
  chair.run(0.1);
  chair.say(0.5, 0.0);
  chair.run(2.0);
  EXPECT_EQ(chair.dac.last().v, 0.5);
}

// Faults 8, 13: the clock leaps, or the computer hangs
TEST_F(RideTest, ALateTickIsNoBurst) {
  chair.say(1.5, 0.0);
  chair.run(0.5);
  const double before = chair.dac.last().v;
  chair.drive.command(kNavigation, "/a", {1.5, 0.0}, chair.t + 60.0);
  chair.drive.tick(chair.t + 60.0);
  EXPECT_LE(chair.dac.last().v - before, 0.8 * 0.1 + 1e-9);
  EXPECT_EQ(chair.drive.counts().late_ticks, 1U);
}

// Fault 13
TEST(Drive, OdometryIntegratesWhatTheClampedVoltageStandsFor) {
  k::DriveSettings settings = driveSettings(kQuick);
  settings.outlet.translation.max = 1.0;
  Chair chair(settings);
  chair.run(0.3);
  chair.say(1.5, 0.0);
  chair.run(2.0 + kPeriod);
  const double speed = (1.0 - 0.127906) / 1.32402;
  EXPECT_EQ(chair.dac.last().translation, 1.0);
  EXPECT_NEAR(chair.dac.last().v, speed, 1e-12);
  EXPECT_NEAR(chair.drive.odometry().pose().x, 2.0 * speed, 1e-9);
  EXPECT_GT(chair.drive.outlet().counts().clamped, 99U);
}

TEST_F(DriveTest, SamplesInTheAmbiguousBandAreCounted) {
  const k::Outlet& outlet = chair.drive.outlet();
  ASSERT_TRUE(outlet.steeringBand());
  EXPECT_EQ(outlet.steeringBand()->low, -0.169476);
  EXPECT_EQ(outlet.steeringBand()->high, 0.104181);
  EXPECT_FALSE(outlet.translationBand());
  EXPECT_EQ(outlet.counts().ambiguous, 0U);  // 0 V is rest
  chair.say(0.0, 0.3);
  chair.run(0.1);
  EXPECT_EQ(outlet.counts().ambiguous, 5U);
  chair.say(0.0, 1.0);
  chair.run(0.1);
  EXPECT_EQ(outlet.counts().ambiguous, 5U);
}

TEST(Drive, WhateverIsHeardItKeepsTheLimitsAndTheBands) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<> uniform(-2, 2);
  const double odd[] = {kNan, kInfinity, -kInfinity, 0.0, 1e300, -5e-324, 9.9};
  const auto number = [&] { return random() % 4 ? uniform(random) : odd[random() % std::size(odd)]; };
  k::DriveSettings settings = driveSettings(kGentle);
  settings.outlet.translation = {-1.0, 1.2, 0.01};
  settings.arbiter.locks = {
      {"hold", 100, 0.0, true}, {"watcher", 200, 0.3, true}, {"dead man", 255, 0.3, false}};
  settings.estop_timeout = 0.4;
  Chair chair(settings);
  double t = 100;
  int moved = 0;
  for (int i = 0; i < 100000; ++i) {
    t += random() % 2000 == 0 ? uniform(random) : 0.02 * static_cast<double>(random() % 3);
    const bool rest = i % 1000 < 100;  // now and then everybody lets go, or nothing would ever be released
    const k::Rates rates = rest ? k::Rates{} : k::Rates{number(), number()};
    if (random() % 2) chair.drive.command(random() % 3, random() % 200 ? "/a" : "/b", rates, t);
    if (random() % 3 == 0)
      chair.drive.arbiter().lock(random() % 2, {random() % 9 ? "/a" : "/b"}, random() % 50 == 0, t);
    if (random() % 3 == 0) chair.drive.arbiter().lock(2, {"/a"}, random() % 50 == 0, t);
    if (random() % 3 == 0) chair.drive.eStop().hear({"/a"}, random() % 600 == 0, t);
    if (random() % 9 == 0) chair.drive.speedCap().hear("/a", number(), t);
    if (random() % 20 == 0) chair.drive.resetEStop(t);
    const k::Output before = chair.dac.last();
    chair.drive.tick(t);
    const k::Output& now = chair.dac.last();
    moved += now.v != 0;
    ASSERT_TRUE(now.translation >= -1.0 && now.translation <= 1.2) << now.translation;
    ASSERT_TRUE(std::abs(now.v) <= 1.5 && std::abs(now.w) <= 1.2);
    const double more = std::abs(now.v) - std::abs(before.v);
    ASSERT_LE(more, 0.8 * 0.1 + 0.01) << "a burst";  // longest_step, and a code of the converter
    if (chair.drive.eStop().stopped()) {
      ASSERT_EQ(now.translation, 0.0);
      ASSERT_EQ(now.steering, 0.0);
    }
  }
  EXPECT_GT(moved, 10000);
}

TEST(Report, TheLawWarnsOfItsBand) {
  k::OutletSettings settings = driveSettings(kQuick).outlet;
  const k::Report published = k::reportLaw(k::Outlet(settings), "published");
  EXPECT_TRUE(published.warning);
  EXPECT_NE(published.summary.find("V_s in (-0.169476, 0.104181) V"), std::string::npos) << published.summary;
  settings.law.steering = kSteeringCorrected;
  EXPECT_FALSE(k::reportLaw(k::Outlet(settings), "corrected").warning);
}

TEST_F(DriveTest, ARefusedCommandWarnsOnce) {
  chair.drive.command(kNavigation, "/a", {kNan, 0}, chair.t);
  const k::Report first = k::reportCommands(chair.drive, {});
  EXPECT_TRUE(first.warning);
  EXPECT_EQ(first.summary, "idle; command refused");
  EXPECT_FALSE(k::reportCommands(chair.drive, k::tally(chair.drive)).warning);
}

}  // namespace test_base_drive
