// SPDX-License-Identifier: BSD-3-Clause
// What may be said to odometry: ~reset_odometry, ~set_odometry, and a gyro's rate on the topic imu.
#pragma once

#include <kurumaisu/SetOdometry.h>
#include <ros/node_handle.h>
#include <sensor_msgs/Imu.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/drive.h"
#include "base/node/odometry_settings.h"
#include "plausible/transform_input.h"

namespace kurumaisu {

class OdometryInput {
 public:
  using Clock = std::function<double(const ros::Time&)>;

  /// clock: the control loop's time [s] now. drive must outlive this object.
  OdometryInput(ros::NodeHandle& nh, Drive& drive, const OdometrySettings& settings, Clock clock);

  /// After a tick: warns where the gyro fell silent.
  void check();

 private:
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onSet(SetOdometry::Request& request, SetOdometry::Response& response);
  void onImu(const sensor_msgs::Imu& imu);
  std::optional<Eigen::Vector3d> axisOf(const std::string& frame);

  Drive& drive_;
  OdometrySettings settings_;
  Clock clock_;
  std::optional<Eigen::Vector3d> axis_;  // the base's z in the sensor's frame
  std::string axis_frame_;
  std::uint64_t fallbacks_ = 0;  // said so far
  std::unique_ptr<tf2_ros::Buffer> tf_;
  std::unique_ptr<TransformInput> transforms_;
  ros::ServiceServer reset_;
  ros::ServiceServer set_;
  ros::Subscriber imu_;
};

}  // namespace kurumaisu
