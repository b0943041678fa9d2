// SPDX-License-Identifier: BSD-3-Clause
// Dead reckoning: equation (3) over what was put out, or what a gyro measured, and how wrong that may be.
#pragma once

#include <Eigen/Core>
#include <string>

#include "model/rate_noise.h"
#include "model/unicycle.h"

namespace kurumaisu {

/// Variances that a metre driven and a radian turned add, linear, so that the interval's length does not
/// matter; and the noise that was measured.
struct OdometryNoise {
  double forward_per_distance;  ///< [m^2/m]
  double forward_per_turn;      ///< [m^2/rad]
  double lateral_per_distance;  ///< [m^2/m]
  double heading_per_distance;  ///< [rad^2/m]
  double heading_per_turn;      ///< [rad^2/rad]
  RateNoise rates{};
};

/// Under which names odometry is published.
struct OdometryNames {
  std::string frame;        ///< in which the pose is
  std::string child_frame;  ///< whose pose it is
  bool publish_tf;          ///< false where a filter publishes frame -> child_frame
};

/// What a gyro measured of an interval.
struct Turn {
  double angle;     ///< [rad]
  double variance;  ///< of its white noise [rad^2]; bias and scale come on top of it
};

/// Pose in the odom frame, with its covariance, from rates held over intervals.
class Odometry {
 public:
  explicit Odometry(const OdometryNoise& noise);

  /// At the origin, which is known exactly; or at a pose with that covariance, of x, y, theta. What is known of
  /// noise, bias and scale stays known.
  void reset() { reset({0, 0, 0}, Eigen::Matrix3d::Zero()); }
  void reset(const Pose2D& pose, const Eigen::Matrix3d& covariance);

  /// Equation (3) over dt [s] at v [m/s], w [rad/s]. Throws std::invalid_argument unless dt is positive.
  void advance(double v, double w, double dt);

  /// The same with the turn that a gyro measured in place of w's.
  void advance(double v, const Turn& turn, double dt);

  /// The gyro's scale has that variance [1], and always the same error.
  void setGyroScale(double variance) { covariance_(6, 6) = variance; }

  /// The gyro's bias was estimated afresh, with that variance [rad^2/s^2]; it wanders [rad/s per root of s].
  void setGyroBias(double variance, double walk);

  const Pose2D& pose() const { return pose_; }

  /// Of x [m], y [m], theta [rad] in the odom frame.
  Eigen::Matrix3d covariance() const { return covariance_.topLeftCorner<3, 3>(); }

  /// Rates over the last interval, which have moved the pose to where it is.
  double v() const { return v_; }  ///< [m/s]
  double w() const { return w_; }  ///< [rad/s]

  /// Variances of their means over that interval: forward, lateral [m^2/s^2], yaw [rad^2/s^2]. Noise that lasts
  /// longer counts as the white noise of the same effect: integrated by a filter that takes intervals for
  /// independent they give the pose's covariance again, whatever the interval.
  const Eigen::Vector3d& rateVariance() const { return rate_variance_; }

 private:
  // Errors: x, y, theta; n_v, n_w of RateNoise; the gyro's bias [rad/s] and scale [1].
  using Matrix7d = Eigen::Matrix<double, 7, 7>;
  struct Step;

  void move(double v, double w, double dt, const Turn* turn);
  void spread(const Step& step);
  static void addRateNoise(const Step& step, Matrix7d& by_before, Matrix7d& added);

  OdometryNoise noise_;
  double bias_walk_ = 0;
  Pose2D pose_{};
  Matrix7d covariance_;
  double v_ = 0;
  double w_ = 0;
  Eigen::Vector3d rate_variance_;
};

}  // namespace kurumaisu
