// SPDX-License-Identifier: BSD-3-Clause
// Covariances that are told while the place is not known, and what the map adds to all of them.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "slam/basics/gaussian.h"
#include "slam/localization/field.h"

namespace kurumaisu {

/// The whole map, any heading.
Eigen::Matrix3d anywhere(const Field& field);

/// Variance of a wall's place in its cell [m^2]. All readings of a wall share it, now and later, so that no
/// filter averages it out.
double ofMap(const Field& field);

/// Never narrower than a deviation [m], so that it does not look certain.
void blur(Eigen::Matrix3d& covariance, double least);

/// What weighted places add to a covariance: as wide as they are away from the middle.
Eigen::Matrix3d around(const Pose2D& middle, const std::vector<Weighted>& places);

}  // namespace kurumaisu
