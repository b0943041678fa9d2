// SPDX-License-Identifier: BSD-3-Clause
// Messages that come in: read, or refused. Everything here throws std::invalid_argument with what was expected and what
// came; nothing of it throws for a stamp, as ros::Time's own arithmetic does beyond its 32 bits.
#pragma once

#include <geometry_msgs/Pose.h>
#include <nav_msgs/OccupancyGrid.h>
#include <ros/time.h>
#include <sensor_msgs/LaserScan.h>

#include <Eigen/Core>

#include "model/unicycle.h"
#include "plausible/quantity.h"

namespace kurumaisu {

/// A clock that much behind itself [s] was set back: a new beginning.
constexpr double kTimeJump = 1.0;

/// What is stamped farther in the future [s] is of another clock: one such transform would keep all others out of tf.
constexpr double kOtherClock = 86400;

/// [s] from one time to another, exact to the nanosecond where it is short.
double secondsFrom(const ros::Time& from, const ros::Time& to);

/// A time so much [s] later, or the first or last that there is.
ros::Time later(const ros::Time& time, double seconds);

void requireStamp(const ros::Time& stamp);

/// A stamp that is not of the future by more than a while [s], as far as the clock is known: it is 0 before the first
/// of simulated time.
void requireStamp(const ros::Time& stamp, const ros::Time& now, double ahead = kOtherClock);

/// Whether a stamp is of the wall's clock, while time is simulated.
bool isWallTime(const ros::Time& stamp);

/// x, y, yaw of a pose.
Pose2D planarOf(const geometry_msgs::Pose& pose);

/// x, y, yaw of a covariance of x, y, z, roll, pitch, yaw.
Eigen::Matrix3d planarOf(const boost::array<double, 36>& values);

/// Whatever of a scan is not a reading.
void requireScan(const sensor_msgs::LaserScan& scan, const ros::Time& now);

/// Size, cells and origin of a map.
void requireMap(const nav_msgs::OccupancyGrid& map);

}  // namespace kurumaisu
