// SPDX-License-Identifier: BSD-3-Clause
// Messages that come in are read, or refused with what was expected and what came. No master.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "plausible/messages.h"

namespace test_messages {

namespace k = kurumaisu;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
const ros::Time kLast(4294967295, 999999999);

std::string refusal(const std::function<void()>& read) {
  try {
    read();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

void expectWords(const std::string& words, const std::function<void()>& read) {
  const std::string said = refusal(read);
  EXPECT_NE(said.find(words), std::string::npos) << words << " is not in: " << said;
}

sensor_msgs::LaserScan scan() {
  sensor_msgs::LaserScan out;
  out.header.stamp = ros::Time(100);
  out.angle_min = -1;
  out.angle_increment = 0.5;
  out.time_increment = 1e-4;
  out.range_min = 0.06;
  out.range_max = 5.6;
  out.ranges.assign(5, 2.0F);
  return out;
}

nav_msgs::OccupancyGrid map() {
  nav_msgs::OccupancyGrid out;
  out.info.resolution = 0.05;
  out.info.width = 3;
  out.info.height = 2;
  out.info.origin.orientation.w = 1;
  out.data.assign(6, 0);
  return out;
}

}  // namespace

TEST(Stamps, ArithmeticNeverThrows) {
  EXPECT_DOUBLE_EQ(k::secondsFrom(ros::Time(0), kLast), 4294967295.999999999);
  EXPECT_DOUBLE_EQ(k::secondsFrom(kLast, ros::Time(0)), -4294967295.999999999);
  EXPECT_DOUBLE_EQ(k::secondsFrom(ros::Time(1764000000, 1), ros::Time(1764000000, 3)), 2e-9);
  EXPECT_EQ(k::later(ros::Time(100, 900000000), 0.2), ros::Time(101, 100000000));
  EXPECT_EQ(k::later(ros::Time(100), -0.5), ros::Time(99, 500000000));
  EXPECT_EQ(k::later(ros::Time(1), -2), ros::Time(0));
  for (const double seconds : {1.0, 1e300, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(k::later(kLast, seconds), ros::Time(4294967295, 0));
  }
}

TEST(Stamps, OfAnotherTimeAreRefusedWithBoth) {
  k::requireStamp(ros::Time(0));
  expectWords("stamp: must be a number from 0 to 4e+09 s: 4.29497e+09", [] { k::requireStamp(kLast); });
  k::requireStamp(ros::Time(110), ros::Time(100), 10);
  k::requireStamp(ros::Time(1e9), ros::Time(0), 10);  // there is no time yet
  expectWords("at most 10 s ahead of this clock, 100 s: 111 s",
              [] { k::requireStamp(ros::Time(111), ros::Time(100), 10); });
  ros::Time::setNow(ros::Time(100));  // simulated
  expectWords("which is the wall's time, while this clock is /clock",
              [] { k::requireStamp(ros::Time(ros::WallTime::now().sec), ros::Time(100), 10); });
}

TEST(Scans, ThatMakeSenseAreTaken) {
  k::requireScan(scan(), ros::Time(90));
  auto limitless = scan();
  limitless.range_max = kInfinity;
  limitless.ranges[2] = kInfinity;
  k::requireScan(limitless, ros::Time(90));
}

TEST(Scans, ThatMakeNoSenseAreRefusedByTheirField) {
  const auto expect = [](const char* words, const std::function<void(sensor_msgs::LaserScan&)>& spoil) {
    auto bad = scan();
    spoil(bad);
    expectWords(words, [&] { k::requireScan(bad, ros::Time(90)); });
  };
  expect("stamp: ", [](auto& bad) { bad.header.stamp = kLast; });
  expect("stamp: must be above 0 s", [](auto& bad) { bad.header.stamp = ros::Time(0); });
  expect("stamp: must be at most 86400 s ahead", [](auto& bad) { bad.header.stamp = ros::Time(1e6); });
  expect("angle_min: ", [](auto& bad) { bad.angle_min = kInfinity; });
  expect("angle_increment: ", [](auto& bad) { bad.angle_increment = static_cast<float>(kNan); });
  expect("time_increment, ", [](auto& bad) { bad.time_increment = std::numeric_limits<float>::max(); });
  expect("range_min: ", [](auto& bad) { bad.range_min = static_cast<float>(kNan); });
  expect("range_min: ", [](auto& bad) { bad.range_min = -1; });
  expect("range_max: ", [](auto& bad) { bad.range_max = static_cast<float>(kNan); });
  expect("range_max: ", [](auto& bad) { bad.range_max = 0; });
}

TEST(Maps, ThatMakeNoSenseAreRefusedByTheirField) {
  k::requireMap(map());
  const auto expect = [](const char* words, const std::function<void(nav_msgs::OccupancyGrid&)>& spoil) {
    auto bad = map();
    spoil(bad);
    expectWords(words, [&] { k::requireMap(bad); });
  };
  expect("info.resolution: ", [](auto& bad) { bad.info.resolution = 0; });
  expect("info.resolution: ", [](auto& bad) { bad.info.resolution = kInfinity; });
  expect("info.origin.position.x: ", [](auto& bad) { bad.info.origin.position.x = kInfinity; });
  expect("info.origin.orientation: ", [](auto& bad) { bad.info.origin.orientation.w = kNan; });
  expect("a map of 3 x 2 cells with 5 values", [](auto& bad) { bad.data.resize(5); });
  expect("a map of 0 x 2 cells", [](auto& bad) { bad.info.width = 0; });
}

TEST(Poses, AreReadInThePlane) {
  geometry_msgs::Pose pose;
  pose.position.x = 1;
  pose.position.y = -2;
  pose.orientation.z = pose.orientation.w = 1;  // as a person types it
  const k::Pose2D read = k::planarOf(pose);
  EXPECT_EQ(read.x, 1);
  EXPECT_EQ(read.y, -2);
  EXPECT_NEAR(read.theta, M_PI / 2, 1e-15);
  pose.position.y = 1e300;
  expectWords("position.y: must be a number from -1e+07 to 1e+07 m: 1e+300", [&] { k::planarOf(pose); });
}

}  // namespace test_messages
