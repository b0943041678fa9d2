// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/odometry_input.h"

#include <ros/console.h>
#include <tf2/exceptions.h>

#include <Eigen/Geometry>
#include <utility>

#include "base/odometry/yaw_rate.h"
#include "plausible/messages.h"

namespace kurumaisu {
namespace {

constexpr double kGyroWarningPeriod = 1.0;  // [s] of throttled warnings
constexpr std::uint32_t kGyroQueue = 100;   // samples of a gyro that is much quicker than the loop

std::optional<YawRate> yawRateOf(const sensor_msgs::Imu& imu, const Eigen::Vector3d& axis) {
  std::array<double, 9> covariance{};
  std::copy(imu.angular_velocity_covariance.begin(), imu.angular_velocity_covariance.end(),
            covariance.begin());
  const auto& rates = imu.angular_velocity;
  return yawRate(axis, {rates.x, rates.y, rates.z}, covariance);
}

/// Apart, because the macro counts as a handful of branches.
void warnRefused(std::uint64_t refused, const std::string& why) {
  ROS_WARN_THROTTLE(kGyroWarningPeriod, "BASE_GYRO_REFUSED: imu: a sample, %lu so far: %s", refused,
                    why.c_str());
}

}  // namespace

OdometryInput::OdometryInput(ros::NodeHandle& nh, Drive& drive, const OdometrySettings& settings, Clock clock)
    : drive_(drive), settings_(settings), clock_(std::move(clock)) {
  ros::NodeHandle own("~");
  reset_ = own.advertiseService("reset_odometry", &OdometryInput::onReset, this);
  set_ = own.advertiseService("set_odometry", &OdometryInput::onSet, this);
  if (!settings.imu) return;
  using Axis = ImuSettings::Axis;
  if (settings.imu->axis == Axis::kTf) {
    tf_ = std::make_unique<tf2_ros::Buffer>();
    transforms_ = std::make_unique<TransformInput>(*tf_, "BASE");
  } else {
    axis_ = Eigen::Vector3d(0, 0, settings.imu->axis == Axis::kUp ? 1 : -1);
  }
  imu_ = nh.subscribe("imu", kGyroQueue, &OdometryInput::onImu, this, ros::TransportHints().tcpNoDelay());
}

void OdometryInput::check() {
  const Gyro* gyro = drive_.reckoning().gyro();
  if (!gyro || gyro->counts().fallbacks == fallbacks_) return;
  fallbacks_ = gyro->counts().fallbacks;
  ROS_WARN_THROTTLE(kGyroWarningPeriod, "BASE_GYRO_LOST: imu: no sample for %g s: odometry is open loop",
                    gyro->settings().timeout);
}

bool OdometryInput::onReset(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response) {
  drive_.place({0, 0, 0}, Eigen::Matrix3d::Zero(), clock_(ros::Time::now()));
  response.success = true;
  return true;
}

bool OdometryInput::onSet(SetOdometry::Request& request, SetOdometry::Response& response) {
  try {
    const Pose2D pose = planarOf(request.pose.pose);
    drive_.place(pose, planarOf(request.pose.covariance), clock_(ros::Time::now()));
    response.success = 1U;
  } catch (const std::invalid_argument& error) {
    response.message = error.what();
    ROS_WARN("BASE_BAD_ODOMETRY: ~set_odometry: refused: %s", error.what());
  }
  return true;
}

std::optional<Eigen::Vector3d> OdometryInput::axisOf(const std::string& frame) {
  if (axis_ && (!tf_ || frame == axis_frame_)) return axis_;
  try {
    const geometry_msgs::Quaternion q =
        tf_->lookupTransform(frame, settings_.names.child_frame, ros::Time(0)).transform.rotation;
    axis_ = Eigen::Quaterniond(q.w, q.x, q.y, q.z) * Eigen::Vector3d::UnitZ();
    axis_frame_ = frame;
    return axis_;
  } catch (const tf2::TransformException& error) {
    ROS_WARN_THROTTLE(kGyroWarningPeriod, "BASE_GYRO_FRAME: imu: %s", error.what());
    return std::nullopt;
  }
}

void OdometryInput::onImu(const sensor_msgs::Imu& imu) {
  const std::optional<Eigen::Vector3d> axis = axisOf(frameOf(imu.header.frame_id));
  if (!axis) return;
  Gyro& gyro = *drive_.reckoning().gyro();
  const ros::Time now = ros::Time::now();
  const double age = secondsFrom(imu.header.stamp, now);
  std::string why = "no gyro: the first number of its covariance is -1";
  if (const std::optional<YawRate> yaw = yawRateOf(imu, *axis)) {
    const double t = clock_(now);
    why = gyro.add(yaw->rate, yaw->variance, t - age, t);
    if (why.empty()) return;
  } else {
    gyro.refuse();
  }
  warnRefused(gyro.counts().refused, why);
}

}  // namespace kurumaisu
