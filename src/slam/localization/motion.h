// SPDX-License-Identifier: BSD-3-Clause
// How uncertain odometry is over a stretch.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "model/rate_noise.h"
#include "slam/localization/particles.h"
#include "slam/localization/settings.h"

namespace kurumaisu {

/// Odometry at one time, with the covariance that it gives of itself, if it does.
struct Odometry {
  double stamp;                               ///< [s]
  Pose2D pose;                                ///< odom_from_base
  std::optional<Eigen::Matrix3d> covariance;  ///< of pose since its start, along odom's axes
};

/// Motion of base from one to the other, in base's frame at the first.
///
/// Its noise is the growth of odometry's covariance, or that of the settings where it has none or one that
/// does not grow; with the floors and the process noise added.
Gaussian motionBetween(const Odometry& first, const Odometry& second, const MotionSettings& settings,
                       const RateNoise& process);

/// Where a motion takes a pose, and how uncertain that is.
Gaussian moved(const Gaussian& pose, const Gaussian& motion);

}  // namespace kurumaisu
