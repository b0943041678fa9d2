// SPDX-License-Identifier: BSD-3-Clause
// Scans that wait for their transforms: no master, no clock but the wall's.
#include <gtest/gtest.h>
#include <ros/time.h>
#include <tf2_ros/buffer.h>

#include <boost/make_shared.hpp>
#include <cmath>
#include <limits>

#include "slam/nodes/messages.h"

namespace test_scan_queue {

namespace k = kurumaisu;

namespace {

const k::LaserError kTrueLaser{1, 0, {0.002334, -0.000488, 0.000199}, 0.001, 0.06, 5.6};
constexpr double kDeadline = 0.05;  // [s]

class ScanQueue : public testing::Test {
 protected:
  void place(double stamp) {
    buffer_.setTransform(k::stamped({stamp, 0, 0}, ros::Time(stamp), "odom", "base"), "test");
  }

  static sensor_msgs::LaserScan::Ptr scan(double stamp) {
    auto out = boost::make_shared<sensor_msgs::LaserScan>();
    out->header.stamp = ros::Time(stamp);
    out->header.frame_id = "laser";
    out->angle_min = -1;
    out->angle_increment = 0.5;
    out->range_max = 5.6;
    out->ranges.assign(5, 2.0F);
    return out;
  }

  void SetUp() override {
    ros::Time::init();
    buffer_.setUsingDedicatedThread(true);
    buffer_.setTransform(k::stamped({0.3, 0, 0}, ros::Time(1), "base", "laser"), "test", true);
    for (int i = 0; i < 100; ++i) place(100 + 0.1 * i);
  }

  tf2_ros::Buffer buffer_;
  k::ScanQueue queue_{buffer_, {"odom", "base", kDeadline}, kTrueLaser, "TEST", 4};
};

}  // namespace

TEST_F(ScanQueue, KeepsTheOrderAndWaitsForTheTransform) {
  queue_.push(scan(101));
  queue_.push(scan(110.5));  // odometry is not so far yet
  queue_.push(scan(102));
  const auto first = queue_.next();
  ASSERT_TRUE(first);
  EXPECT_NEAR(first->start.x, 101, 1e-9);
  EXPECT_FALSE(queue_.next());
  EXPECT_EQ(queue_.size(), 2U);
  for (int i = 0; i < 10; ++i) place(110 + 0.1 * i);
  const auto second = queue_.next();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->stamp, ros::Time(110.5));
  EXPECT_EQ(queue_.next()->stamp, ros::Time(102));
  EXPECT_EQ(queue_.dropped().all(), 0U);
}

TEST_F(ScanQueue, WhatWaitsInVainIsDroppedAndTheNextOneServed) {
  queue_.push(scan(500));
  queue_.push(scan(101));
  EXPECT_FALSE(queue_.next());
  ros::WallDuration(1.5 * kDeadline).sleep();
  EXPECT_EQ(queue_.next()->stamp, ros::Time(101));
  EXPECT_EQ(queue_.dropped().no_transform, 1U);
  EXPECT_NE(queue_.reason().find("TEST_NO_TRANSFORM"), std::string::npos);
}

// Whatever throws on the way, the scan is gone and the loop ends.
TEST_F(ScanQueue, WhatThrowsIsDroppedOnceAndTheNextOneServed) {
  const auto endless = scan(101);
  endless->time_increment = std::numeric_limits<float>::max();  // its last beam is out of ros::Time's range
  queue_.push(endless);
  const auto nameless = scan(101);
  nameless->header.frame_id = "";
  queue_.push(nameless);
  const auto tilted = scan(101);
  tilted->header.frame_id = "tilted";
  auto up = k::stamped({0, 0, 0}, ros::Time(1), "base", "tilted");
  up.transform.rotation.x = up.transform.rotation.w = std::sqrt(0.5);
  up.transform.rotation.z = 0;
  buffer_.setTransform(up, "test", true);
  queue_.push(tilted);
  queue_.push(scan(102));
  EXPECT_FALSE(queue_.next());  // the nameless one waits, as one whose frame is not known yet
  ros::WallDuration(1.5 * kDeadline).sleep();
  const auto good = queue_.next();
  ASSERT_TRUE(good);
  EXPECT_EQ(good->stamp, ros::Time(102));
  EXPECT_EQ(queue_.dropped().bad_scan, 2U);
  EXPECT_EQ(queue_.dropped().no_transform, 1U);
  EXPECT_EQ(queue_.size(), 0U);
}

TEST_F(ScanQueue, AFramesSlashIsTakenOff) {
  const auto old_style = scan(101);
  old_style->header.frame_id = "/laser";
  queue_.push(old_style);
  EXPECT_TRUE(queue_.next());
}

TEST_F(ScanQueue, ALaserWithoutALimitHasOneThatIsANumber) {
  const auto limitless = scan(101);
  limitless->range_max = std::numeric_limits<float>::infinity();
  queue_.push(limitless);
  EXPECT_EQ(queue_.next()->scan.fan.range_max, 1000);
}

TEST_F(ScanQueue, AFullQueueLosesItsOldest) {
  for (int i = 0; i < 6; ++i) queue_.push(scan(101 + i));
  EXPECT_EQ(queue_.size(), 4U);
  EXPECT_EQ(queue_.dropped().too_slow, 2U);
  EXPECT_EQ(queue_.next()->stamp, ros::Time(103));
}

}  // namespace test_scan_queue
