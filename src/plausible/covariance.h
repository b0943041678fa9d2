// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace kurumaisu {

/// Throws std::invalid_argument with the reason unless this can be the covariance of x, y [m], heading [rad]:
/// variances in their range, symmetric, positive semi-definite.
void requireCovariance(const Eigen::Matrix3d& covariance);

}  // namespace kurumaisu
