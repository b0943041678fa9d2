// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/odometry_input.h"

#include <ros/console.h>
#include <tf2/exceptions.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <utility>

#include "base/odometry/yaw_rate.h"

namespace kurumaisu {
namespace {

constexpr double kGyroWarningPeriod = 1.0;  // [s] of throttled warnings
constexpr std::size_t kAxes[] = {0, 1, 5};  // x, y, yaw of x, y, z, roll, pitch, yaw
constexpr double kPlanar = 1.0e-3;          // of a quaternion's length that roll, pitch or scale may take
constexpr std::uint32_t kGyroQueue = 100;   // samples of a gyro that is much quicker than the loop

bool isPose(const geometry_msgs::Pose& pose) {
  const auto& q = pose.orientation;
  const double length = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
  return std::isfinite(pose.position.x) && std::isfinite(pose.position.y) && std::abs(length - 1) < kPlanar &&
         std::hypot(q.x, q.y) < kPlanar;
}

Eigen::Matrix3d planar(const geometry_msgs::PoseWithCovariance::_covariance_type& covariance) {
  Eigen::Matrix3d result;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      result(row, column) = covariance[6 * kAxes[row] + kAxes[column]];
  }
  return result;
}

bool isCovariance(const Eigen::Matrix3d& matrix) {
  if (!matrix.allFinite() || !matrix.isApprox(matrix.transpose(), 1e-9)) return false;
  return Eigen::LDLT<Eigen::Matrix3d>(matrix).isPositive();
}

/// Apart, because the macro counts as a handful of branches.
void warnRefused(double age, const std::optional<YawRate>& yaw) {
  ROS_WARN_THROTTLE(kGyroWarningPeriod,
                    "BASE_GYRO_REFUSED: imu: a sample %g s old with yaw rate %g rad/s, %s", age,
                    yaw ? yaw->rate : NAN, yaw ? "not finite, out of order or of another time" : "no gyro");
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
    listener_ = std::make_unique<tf2_ros::TransformListener>(*tf_);
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
  const geometry_msgs::Pose& pose = request.pose.pose;
  const Eigen::Matrix3d covariance = planar(request.pose.covariance);
  response.success = isPose(pose) && isCovariance(covariance);
  if (!response.success) {
    response.message = isPose(pose) ? "the covariance of x, y, yaw is invalid"
                                    : "the pose must be finite, its quaternion of length 1 and about z";
    return true;
  }
  const double theta = 2 * std::atan2(pose.orientation.z, pose.orientation.w);
  drive_.place({pose.position.x, pose.position.y, std::remainder(theta, 2 * M_PI)}, covariance,
               clock_(ros::Time::now()));
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
  const std::optional<Eigen::Vector3d> axis = axisOf(imu.header.frame_id);
  if (!axis) return;
  std::array<double, 9> covariance{};
  std::copy(imu.angular_velocity_covariance.begin(), imu.angular_velocity_covariance.end(),
            covariance.begin());
  const auto& rates = imu.angular_velocity;
  const std::optional<YawRate> yaw = yawRate(*axis, {rates.x, rates.y, rates.z}, covariance);
  const ros::Time now = ros::Time::now();
  const double t = clock_(now);
  const double age = (now - imu.header.stamp).toSec();
  if (!yaw || !drive_.reckoning().gyro()->add(yaw->rate, yaw->variance, t - age, t)) warnRefused(age, yaw);
}

}  // namespace kurumaisu
