// SPDX-License-Identifier: BSD-3-Clause
// Bearings, times and ranges of beams, against hand-computed values of known sensors.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "laser/fan.h"

namespace test_laser_fan {

namespace l = kurumaisu::laser;
namespace s = kurumaisu::scip;

namespace {

constexpr double kDegree = M_PI / 180;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

const s::Parameters kUrg{"URG-04LX", 20, 5600, 1024, 44, 725, 384, 600};
const s::Parameters kUtm{"UTM-30LX", 23, 60000, 1440, 0, 1080, 540, 2400};
const l::Window kAll{-M_PI, M_PI, 1, 0, false};

s::Rotation of(const l::Fan& fan, int distance) {
  return {1234, std::vector<int>(static_cast<std::size_t>(s::beams(fan.request())), distance), {}};
}

void expectUniform(const l::Scan& scan) {
  EXPECT_NEAR(scan.angle_min + static_cast<double>(scan.ranges.size() - 1) * scan.angle_increment,
              scan.angle_max, 1e-9);
}

/// What the constructor says.
std::string refusal(const l::Window& window) {
  try {
    const l::Fan fan(kUrg, window);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "none";
}

}  // namespace

TEST(Fan, AllOfAnUrg04lxIsItsAsymmetricFan) {
  const l::Fan fan(kUrg, kAll);
  EXPECT_EQ(s::command(fan.request()), "MD0044072501000");
  const l::Scan scan = fan.convert(of(fan, 1000), 100);
  EXPECT_EQ(scan.ranges.size(), 682U);
  EXPECT_NEAR(scan.angle_min, -119.53125 * kDegree, 1e-9);
  EXPECT_NEAR(scan.angle_max, 119.8828125 * kDegree, 1e-9);
  EXPECT_NEAR(scan.angle_increment, 0.3515625 * kDegree, 1e-12);
  EXPECT_NEAR(scan.time_increment, 97.65625e-6, 1e-12);
  EXPECT_NEAR(scan.scan_time, 0.1, 1e-12);
  EXPECT_NEAR(scan.stamp, 100.004296875, 1e-9);
  EXPECT_NEAR(fan.leastDelay(), 0.07080078125, 1e-9);
  EXPECT_EQ(scan.range_min, 0.02);
  EXPECT_EQ(scan.range_max, 5.6);
  EXPECT_EQ(scan.clock, 1234U);
  expectUniform(scan);
}

TEST(Fan, AllOfAUtm30lx) {
  const l::Fan fan(kUtm, {-M_PI, M_PI, 1, 1, true});
  EXPECT_EQ(s::command(fan.request()), "ME0000108001100");
  s::Rotation rotation = of(fan, 60000);
  rotation.intensities.assign(1081, 4321);
  const l::Scan scan = fan.convert(rotation, 0);
  EXPECT_NEAR(scan.angle_min, -135 * kDegree, 1e-9);
  EXPECT_NEAR(scan.angle_max, 135 * kDegree, 1e-9);
  EXPECT_NEAR(scan.scan_time, 0.05, 1e-12) << "every second turn of 25 ms";
  EXPECT_NEAR(scan.time_increment, 0.025 / 1440, 1e-12);
  EXPECT_EQ(scan.ranges.back(), 60.0F);
  EXPECT_EQ(scan.intensities, std::vector<float>(1081, 4321.0F));
  EXPECT_EQ(scan.stamp, 0.0);
}

TEST(Fan, AWindowTakesTheStepsInIt) {
  const l::Fan fan(kUrg, {-90 * kDegree, 45 * kDegree, 1, 0, false});
  EXPECT_EQ(s::command(fan.request()), "MD0128051201000");  // both ends are steps
  const l::Scan scan = fan.convert(of(fan, 1000), 0);
  EXPECT_NEAR(scan.angle_min, -90 * kDegree, 1e-9);
  EXPECT_NEAR(scan.angle_max, 45 * kDegree, 1e-9);
  EXPECT_NEAR(fan.firstBeam(), 0.0125, 1e-9);
  EXPECT_NEAR(fan.leastDelay(), 0.05, 1e-9);
  const l::Fan inside(kUrg, {-89.9 * kDegree, 44.9 * kDegree, 1, 0, false});
  EXPECT_EQ(s::command(inside.request()), "MD0129051101000");
}

TEST(Fan, ASingleBeam) {
  const l::Fan fan(kUrg, {0, 0, 1, 9, false});
  EXPECT_EQ(s::command(fan.request()), "MD0384038401900");
  EXPECT_EQ(fan.convert(of(fan, 1000), 0).angle_min, 0.0);
}

TEST(Fan, ABeamOfAClusterPointsToItsMiddle) {
  for (const int cluster : {2, 3, 10, 99}) {
    const l::Fan fan(kUrg, {-M_PI, M_PI, cluster, 0, false});
    const s::Request& asked = fan.request();
    EXPECT_EQ((asked.last - asked.first + 1) % cluster, 0);
    EXPECT_GT(asked.last + cluster, 725);
    const l::Scan scan = fan.convert(of(fan, 1000), 0);
    const double middle = 0.5 * (kUrg.bearing(44) + kUrg.bearing(44 + cluster - 1));
    EXPECT_NEAR(scan.angle_min, middle, 1e-9);
    EXPECT_NEAR(scan.angle_increment, cluster * kUrg.increment(), 1e-12);
    EXPECT_NEAR(scan.time_increment, cluster * kUrg.stepTime(), 1e-12);
    // time and bearing agree: the mirror is there then
    EXPECT_NEAR(scan.stamp / kUrg.scanTime(), scan.angle_min / (2 * M_PI) + 384.0 / 1024, 1e-9);
    EXPECT_EQ(scan.ranges.size(), static_cast<std::size_t>(682 / cluster));
    expectUniform(scan);
  }
}

TEST(Fan, NoWindowAsksForStepsThatTheSensorLacks) {
  for (int from = -180; from <= 180; from += 7) {
    for (int to = from; to <= 180; to += 7) {
      for (const int cluster : {1, 2, 7}) {
        try {
          const l::Fan fan(kUrg, {from * kDegree, to * kDegree, cluster, 0, false});
          EXPECT_GE(fan.request().first, 44);
          EXPECT_LE(fan.request().last, 725);
          const l::Scan scan = fan.convert(of(fan, 1000), 0);
          EXPECT_GE(scan.angle_min, from * kDegree - 1e-6);
          EXPECT_LE(scan.angle_max, to * kDegree + 1e-6);
          expectUniform(scan);
        } catch (const std::invalid_argument&) {
          EXPECT_TRUE(to < -119 || from > 119 || to - from < cluster) << from << " " << to << " " << cluster;
        }
      }
    }
  }
}

TEST(Fan, RangesByRep117) {
  const l::Fan fan(kUrg, kAll);
  for (int number = 0; number < 64 * 64 * 4; ++number) {
    const float range = fan.convert(of(fan, number), 0).ranges[0];
    if (number == 0 || number == 6 || number > 5600) {
      ASSERT_EQ(range, kInfinity) << number;
    } else if (number < 20) {
      ASSERT_TRUE(std::isnan(range)) << number;
    } else {
      ASSERT_EQ(range, static_cast<float>(number) / 1000.0F) << number;
    }
  }
}

TEST(Fan, BelowTheLeastDistanceIsNoMeasurement) {
  const l::Fan fan(kUtm, kAll);
  EXPECT_TRUE(std::isnan(fan.convert(of(fan, 22), 0).ranges[0]));
  EXPECT_EQ(fan.convert(of(fan, 23), 0).ranges[0], 0.023F);
  EXPECT_EQ(fan.convert(of(fan, 60001), 0).ranges[0], kInfinity);
}

TEST(Fan, RefusesWhatCannotBeAndNamesIt) {
  const auto names = [](const l::Window& window, const std::string& parameter) {
    return refusal(window).rfind(parameter + " ", 0) == 0;
  };
  EXPECT_TRUE(names({-180, 180, 1, 0, false}, "angle_min")) << "degrees";
  EXPECT_TRUE(names({kNan, 1, 1, 0, false}, "angle_min"));
  EXPECT_TRUE(names({0, kInfinity, 1, 0, false}, "angle_max"));
  EXPECT_TRUE(names({0, 3.2, 1, 0, false}, "angle_max"));
  EXPECT_TRUE(names({1, 0.5, 1, 0, false}, "angle_min"));
  EXPECT_TRUE(names({2.5, 3, 1, 0, false}, "angle_min")) << "behind the sensor";
  EXPECT_TRUE(names({-3, -2.5, 1, 0, false}, "angle_max")) << "behind the sensor";
  EXPECT_TRUE(names({0.001, 0.002, 1, 0, false}, "angle_max")) << "between two steps";
  EXPECT_TRUE(names({0, 0.05, 10, 0, false}, "cluster")) << "9 steps";
  EXPECT_TRUE(names({-1, 1, 0, 0, false}, "cluster"));
  EXPECT_TRUE(names({-1, 1, 100, 0, false}, "cluster"));
  EXPECT_TRUE(names({-1, 1, 1, -1, false}, "skip"));
  EXPECT_TRUE(names({-1, 1, 1, 10, false}, "skip"));
  EXPECT_EQ(refusal({-3.1416, 3.1416, 99, 9, true}), "none");
}

TEST(Fan, AUtm30lxSaysOneWhereNothingIs) {
  const l::Fan fan(kUtm, kAll);
  for (int code = 0; code < 23; ++code) {
    const float range = fan.convert(of(fan, code), 0).ranges[0];
    EXPECT_TRUE(code == 1 ? range == kInfinity : std::isnan(range)) << code;
  }
  EXPECT_EQ(fan.convert(of(fan, 65533), 0).ranges[0], kInfinity);
}

}  // namespace test_laser_fan
