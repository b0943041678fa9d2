// SPDX-License-Identifier: BSD-3-Clause
// Odometry as messages: nav_msgs/Odometry on odom, and tf.
#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/node_handle.h>
#include <tf2_ros/transform_broadcaster.h>

#include "base/odometry/odometry.h"

namespace kurumaisu {

class OdometryOutput {
 public:
  OdometryOutput(ros::NodeHandle& nh, const OdometryNames& names);

  void publish(const Odometry& odometry, const ros::Time& stamp);

 private:
  void publishTransform(const nav_msgs::Odometry& message);

  OdometryNames names_;
  ros::Publisher publisher_;
  tf2_ros::TransformBroadcaster tf_;
};

/// Of the state after the last interval. Variances of what a planar base does not know are huge (REP-103).
nav_msgs::Odometry odometryMessage(const Odometry& odometry, const OdometryNames& names,
                                   const ros::Time& stamp);

}  // namespace kurumaisu
