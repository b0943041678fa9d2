// SPDX-License-Identifier: BSD-3-Clause
// Which turn odometry goes by: what was put out, or what a gyro measured.
#pragma once

#include <optional>

#include "base/odometry/gyro.h"
#include "base/odometry/odometry.h"

namespace kurumaisu {

class Reckoning {
 public:
  /// gyro: nothing where there is none.
  Reckoning(const OdometryNoise& noise, const std::optional<GyroSettings>& gyro);

  /// What was put out from one time to the next [s], later one: v [m/s], w [rad/s].
  void advance(double v, double w, double from, double to);

  /// Puts the chair elsewhere, as Odometry::reset does.
  void place(const Pose2D& pose, const Eigen::Matrix3d& covariance) { odometry_.reset(pose, covariance); }

  /// The clock was set: at the origin, and without what was measured before.
  void restart();

  const Odometry& odometry() const { return odometry_; }

  /// Null where there is none.
  Gyro* gyro() { return gyro_ ? &*gyro_ : nullptr; }
  const Gyro* gyro() const { return gyro_ ? &*gyro_ : nullptr; }

 private:
  Odometry odometry_;
  std::optional<Gyro> gyro_;
  std::uint64_t biases_ = 0;  // of the gyro's that odometry knows
};

}  // namespace kurumaisu
