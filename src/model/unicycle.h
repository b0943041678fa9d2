// SPDX-License-Identifier: BSD-3-Clause
// Equation (3): the unicycle, integrated in closed form over an interval of constant v, w.
#pragma once

namespace kurumaisu {

/// Pose in the plane; theta is not wrapped, so that a turn can be told from none.
struct Pose2D {
  double x;      ///< [m]
  double y;      ///< [m]
  double theta;  ///< [rad]
};

/// Equation (3) over dt [s] at constant v [m/s], w [rad/s]: an arc, whose limit for w = 0 is the straight line.
Pose2D advance(const Pose2D& pose, double v, double w, double dt);

}  // namespace kurumaisu
