// SPDX-License-Identifier: BSD-3-Clause
// Says why nothing goes on where /use_sim_time is true, left so by a simulator that ended, and /clock is silent.
#pragma once

#include <ros/ros.h>

namespace kurumaisu {

class ClockWatch {
 public:
  explicit ClockWatch(const ros::NodeHandle& nh)
      : timer_(nh.createWallTimer(ros::WallDuration(kPeriod), [](const ros::WallTimerEvent&) { look(); })) {}

 private:
  static constexpr double kPeriod = 5.0;  // [s]

  static void look() {
    if (!ros::Time::isSimTime() || !ros::Time::now().isZero()) return;
    ROS_ERROR(
        "CLOCK_SILENT: /use_sim_time is true, but nothing comes on /clock: time stands at 0. Start a "
        "simulator; "
        "or rosparam set /use_sim_time false, and start this again");
  }

  ros::WallTimer timer_;
};

}  // namespace kurumaisu
