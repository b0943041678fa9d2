// SPDX-License-Identifier: BSD-3-Clause
// Open-loop dead reckoning: equation (3) over what was put out, and how wrong that may be.
#pragma once

#include <Eigen/Core>
#include <string>

#include "model/unicycle.h"

namespace kurumaisu {

/// Variances that a metre driven and a radian turned add. Linear, so that the interval's length does not
/// matter.
struct OdometryNoise {
  double forward_per_distance;  ///< [m^2/m]
  double forward_per_turn;      ///< [m^2/rad]
  double lateral_per_distance;  ///< [m^2/m]
  double heading_per_distance;  ///< [rad^2/m]
  double heading_per_turn;      ///< [rad^2/rad]
};

/// Under which names odometry is published.
struct OdometryNames {
  std::string frame;        ///< in which the pose is
  std::string child_frame;  ///< whose pose it is
  bool publish_tf;          ///< false where a filter publishes frame -> child_frame
};

/// Pose in the odom frame, with its covariance, from rates held over intervals.
class Odometry {
 public:
  explicit Odometry(const OdometryNoise& noise) : noise_(noise) { reset(); }

  /// Back to the origin, which is known exactly.
  void reset();

  /// Equation (3) over dt [s] at v [m/s], w [rad/s]. Throws std::invalid_argument unless dt is positive.
  void advance(double v, double w, double dt);

  const Pose2D& pose() const { return pose_; }

  /// Of x [m], y [m], theta [rad] in the odom frame.
  const Eigen::Matrix3d& covariance() const { return covariance_; }

  /// Rates over the last interval, which have moved the pose to where it is.
  double v() const { return v_; }  ///< [m/s]
  double w() const { return w_; }  ///< [rad/s]

  /// Variances of their means over that interval: forward, lateral [m^2/s^2], yaw [rad^2/s^2].
  /// Integrated by a filter they give the pose's covariance again, whatever the interval.
  const Eigen::Vector3d& rateVariance() const { return rate_variance_; }

 private:
  OdometryNoise noise_;
  Pose2D pose_{};
  Eigen::Matrix3d covariance_;
  double v_ = 0;
  double w_ = 0;
  Eigen::Vector3d rate_variance_;
};

}  // namespace kurumaisu
