// SPDX-License-Identifier: BSD-3-Clause
// How the base without ROS stops, and what it takes before it goes on.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/report.h"
#include "base_drive.h"

namespace test_base_stops {

namespace k = kurumaisu;
using namespace kurumaisu::test;  // NOLINT(google-build-using-namespace)

TEST_F(DriveTest, StopIsNeutralAtOnceAndDropsTheCommand) {
  chair.say(0.5, 0.2);
  chair.run(0.1);
  chair.silence();
  chair.drive.stop(chair.t += 0.005);
  EXPECT_TRUE(chair.neutral());
  chair.run(0.1);
  EXPECT_TRUE(chair.neutral());
}

// Fault 11
TEST(Drive, WhoCommandsMotionFromTheStartIsNotObeyedUntilItSaysZero) {
  Chair chair(driveSettings(kQuick));
  chair.say(0.5, 0.0);
  chair.run(5.0);
  EXPECT_TRUE(chair.neutral());
  EXPECT_EQ(chair.drive.arbiter().counts().unreleased, 1U);
  EXPECT_EQ(k::stateOf(chair.drive), "not released: navigation");
  chair.say(0.0, 0.0);
  chair.run(kPeriod);
  chair.say(0.5, 0.0);
  chair.run(kPeriod);
  EXPECT_EQ(chair.dac.last().v, 0.5);
}

TEST(Drive, OrUntilItLetsGo) {
  Chair chair(driveSettings(kQuick));
  chair.say(0.5, 0.0);
  chair.run(1.0);
  chair.silence();
  chair.run(0.3);
  chair.say(0.5, 0.0);
  chair.run(kPeriod);
  EXPECT_EQ(chair.dac.last().v, 0.5);
}

// Fault 7
TEST_F(RideTest, ASecondPublisherBrakesUntilOnlyOneIsLeft) {
  chair.say(0.5, 0.0);
  chair.run(2.0);
  const double other = chair.t;
  while (chair.t < other + 1.0) {
    chair.drive.command(kNavigation, "/b", {0.4, 0.0}, chair.t);
    chair.run(kPeriod);
  }
  EXPECT_TRUE(chair.neutral());
  EXPECT_EQ(chair.drive.arbiter().counts().conflicts, 1U);
  const std::string warning = k::warningOf(chair.drive, k::tally(chair.drive), "driving: navigation");
  EXPECT_EQ(warning, "BASE_SEVERAL_PUBLISHERS: navigation: /a, /b: brakes until only one is left");
  chair.run(2.0);
  EXPECT_EQ(chair.dac.last().v, 0.5);
}

TEST_F(DriveTest, AnEmergencyStopIsNeutralAtOnceAndNeedsAReset) {
  chair.say(0.5, 0.2);
  chair.run(0.5);
  chair.drive.eStop().hear({"/button"}, true, chair.t);
  chair.run(kPeriod);
  EXPECT_TRUE(chair.neutral());
  EXPECT_TRUE(k::reportCommands(chair.drive, {}).error);
  EXPECT_NE(chair.drive.resetEStop(chair.t), "");  // pressed
  chair.drive.eStop().hear({"/button"}, false, chair.t);
  chair.run(0.5);
  EXPECT_TRUE(chair.neutral());
  EXPECT_NE(chair.drive.resetEStop(chair.t), "");  // commanded
  chair.say(0, 0);
  chair.run(0.1);
  EXPECT_EQ(chair.drive.resetEStop(chair.t), "");
  chair.say(0.5, 0.2);
  chair.run(2 * kPeriod);
  EXPECT_EQ(chair.dac.last().v, 0.0);  // the zero was said before the reset
  chair.say(0, 0);
  chair.run(kPeriod);
  chair.say(0.5, 0.2);
  chair.run(kPeriod);
  EXPECT_EQ(chair.dac.last().v, 0.5);
}

// Fault 9
TEST(Drive, AnEmergencyStopThatFallsSilentIsALatchedStop) {
  k::DriveSettings settings = driveSettings(kQuick);
  settings.estop_timeout = 0.3;
  Chair chair(settings);
  const auto watched = [&chair](double seconds) {
    for (const double end = chair.t + seconds; chair.t < end;) {
      chair.drive.eStop().hear({"/button"}, false, chair.t);
      chair.run(kPeriod);
    }
  };
  chair.run(0.28);
  chair.say(0.5, 0.0);
  chair.run(kPeriod);
  EXPECT_TRUE(chair.neutral());  // not one word yet
  EXPECT_EQ(k::stateOf(chair.drive), "waiting for the emergency stop's first message");
  chair.run(2 * kPeriod);
  EXPECT_TRUE(chair.neutral());
  EXPECT_EQ(k::stateOf(chair.drive), "emergency stop");
  chair.say(0.0, 0.0);
  watched(0.1);
  EXPECT_EQ(chair.drive.resetEStop(chair.t), "");
  watched(0.1);
  chair.say(0.5, 0.0);
  watched(0.5);
  EXPECT_EQ(chair.dac.last().v, 0.5);
  chair.run(0.34);  // silence
  EXPECT_TRUE(chair.neutral());
  EXPECT_TRUE(chair.drive.eStop().latched());
  watched(1.0);
  EXPECT_TRUE(chair.neutral());
}

// Fault 14
TEST_F(RideTest, CutOffItBrakesAndObeysOnlyWhoLetGoAfterwards) {
  chair.say(0.8, 0.0);
  chair.run(3.0);
  chair.drive.cutOff(true);
  const double before = chair.dac.last().v;
  chair.run(kPeriod);
  EXPECT_NEAR(before - chair.dac.last().v, 1.0 * kPeriod, 1e-12);
  chair.run(1.0);
  EXPECT_TRUE(chair.neutral());
  EXPECT_EQ(k::stateOf(chair.drive), "cut off: the ROS master is gone");
  chair.drive.cutOff(false);
  chair.run(1.0);
  EXPECT_TRUE(chair.neutral());
  chair.say(0.0, 0.0);
  chair.run(kPeriod);
  chair.say(0.8, 0.0);
  chair.run(3.0);
  EXPECT_EQ(chair.dac.last().v, 0.8);
}

TEST_F(RideTest, ACapSlowsDownByTheRampAndForgetsItself) {
  chair.say(1.0, 0.6);
  chair.run(3.0);
  for (int i = 0; i < 150; ++i) {
    chair.drive.speedCap().hear("/watcher", 0.3, chair.t);
    const double before = chair.dac.last().v;
    chair.run(kPeriod);
    ASSERT_LE(before - chair.dac.last().v, 1.0 * kPeriod + 1e-12);
  }
  EXPECT_EQ(chair.dac.last().v, 0.3);
  EXPECT_NEAR(chair.dac.last().w, 1.2 * 0.3 / 1.5, 1e-12);
  for (int i = 0; i < 40; ++i) {
    EXPECT_FALSE(chair.drive.speedCap().hear("/watcher", -1, chair.t));
    chair.run(kPeriod);
  }
  EXPECT_EQ(chair.dac.last().v, 0);
  chair.run(3.0);
  EXPECT_EQ(chair.dac.last().v, 1.0);
}

}  // namespace test_base_stops
