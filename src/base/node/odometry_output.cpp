// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/odometry_output.h"

#include <cmath>

namespace kurumaisu {
namespace {

constexpr double kUnmeasured = 1.0e6;  // variance of what a planar base does not know: z, roll, pitch

}  // namespace

nav_msgs::Odometry odometryMessage(const Odometry& odometry, const OdometryNames& names,
                                   const ros::Time& stamp) {
  nav_msgs::Odometry message;
  message.header.stamp = stamp;
  message.header.frame_id = names.frame;
  message.child_frame_id = names.child_frame;
  message.pose.pose.position.x = odometry.pose().x;
  message.pose.pose.position.y = odometry.pose().y;
  message.pose.pose.orientation.z = std::sin(0.5 * odometry.pose().theta);
  message.pose.pose.orientation.w = std::cos(0.5 * odometry.pose().theta);
  message.twist.twist.linear.x = odometry.v();
  message.twist.twist.angular.z = odometry.w();
  constexpr std::size_t kAxes[] = {0, 1, 5};  // x, y, yaw of x, y, z, roll, pitch, yaw
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      message.pose.covariance[6 * kAxes[row] + kAxes[column]] = odometry.covariance()(row, column);
    }
    message.twist.covariance[7 * kAxes[row]] = odometry.rateVariance()[row];
  }
  for (const std::size_t axis : {2, 3, 4}) {
    message.pose.covariance[7 * axis] = message.twist.covariance[7 * axis] = kUnmeasured;
  }
  return message;
}

OdometryOutput::OdometryOutput(ros::NodeHandle& nh, const OdometryNames& names)
    : names_(names), publisher_(nh.advertise<nav_msgs::Odometry>("odom", 10)) {}

void OdometryOutput::publish(const Odometry& odometry, const ros::Time& stamp) {
  const nav_msgs::Odometry message = odometryMessage(odometry, names_, stamp);
  publisher_.publish(message);
  if (names_.publish_tf) publishTransform(message);
}

void OdometryOutput::publishTransform(const nav_msgs::Odometry& message) {
  geometry_msgs::TransformStamped odom_from_base;
  odom_from_base.header = message.header;
  odom_from_base.child_frame_id = message.child_frame_id;
  odom_from_base.transform.translation.x = message.pose.pose.position.x;
  odom_from_base.transform.translation.y = message.pose.pose.position.y;
  odom_from_base.transform.rotation = message.pose.pose.orientation;
  tf_.sendTransform(odom_from_base);
}

}  // namespace kurumaisu
