// SPDX-License-Identifier: BSD-3-Clause
// Kalman filter that whitens the residuals of body increments between noisy reference poses.
#pragma once

#include <Eigen/Core>

namespace kurumaisu {

/// One Ornstein-Uhlenbeck process of the rates.
struct Colour {
  Eigen::Vector3d
      sd;      ///< stationary: v [m/s], lateral [m/s], w [rad/s]; of the second colour, 0 where there is none
  double tau;  ///< time constant [s]
};

/// Noise of the reference pose and of the motion itself, whose two colours add up.
struct MotionNoise {
  double position_sd;  ///< reference pose, each axis of the map frame [m]
  double heading_sd;   ///< reference pose [rad]
  Colour fast;
  Colour slow;
};

/// Whitened columns (rows: 3 per increment) and, per increment, the log variances of dx, of dy given dx, and of dtheta
/// given both, all given the increments before it; their sum is the log determinant of the joint covariance.
struct Whitened {
  Eigen::MatrixXd columns;
  Eigen::MatrixX3d log_determinants;
};

/// Whitens columns of residual increments: L^-1 X with L L' the joint covariance of all increments of a run.
///
/// poses: (n + 1, 3) reference x, y, theta; times: n + 1, increasing [s]; columns: (3 n, m), row 3k..3k+2 being
/// dx, dy [m] and dtheta [rad] of increment k in the body frame at pose k. The error of pose k is shared by the
/// increments k - 1 and k; it lives in the map frame, so its share rotates with the robot. Cost O(n m).
/// activity: (n,) factors on the noise of the rates during each increment, 0 for a robot that is held at rest.
/// Throws std::invalid_argument for shapes that do not fit, times that do not increase, or noise that is not positive.
Whitened whiten(const Eigen::MatrixXd& poses, const Eigen::VectorXd& times, const Eigen::MatrixXd& columns,
                const Eigen::VectorXd& activity, const MotionNoise& noise);

}  // namespace kurumaisu
