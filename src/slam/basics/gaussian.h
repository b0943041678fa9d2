// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "model/unicycle.h"

namespace kurumaisu {

/// A pose and how certain it is: x, y [m], heading [rad].
struct Gaussian {
  Pose2D mean{0, 0, 0};
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

struct Weighted {
  Pose2D pose;
  double weight;  ///< they sum up to 1
};

}  // namespace kurumaisu
