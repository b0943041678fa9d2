// SPDX-License-Identifier: BSD-3-Clause
// Algebra of poses in the plane. Transforms read right to left: map_from_base = map_from_odom *
// odom_from_base.
#pragma once

#include <cmath>

#include "model/unicycle.h"

namespace kurumaisu {

/// a_from_c = a_from_b * b_from_c; the heading is not wrapped.
inline Pose2D compose(const Pose2D& a_from_b, const Pose2D& b_from_c) {
  const double c = std::cos(a_from_b.theta);
  const double s = std::sin(a_from_b.theta);
  return {a_from_b.x + c * b_from_c.x - s * b_from_c.y, a_from_b.y + s * b_from_c.x + c * b_from_c.y,
          a_from_b.theta + b_from_c.theta};
}

/// b_from_c for poses b, c in the same frame; the heading is not wrapped.
inline Pose2D between(const Pose2D& b, const Pose2D& c) {
  const double cosine = std::cos(b.theta);
  const double sine = std::sin(b.theta);
  const double dx = c.x - b.x;
  const double dy = c.y - b.y;
  return {cosine * dx + sine * dy, -sine * dx + cosine * dy, c.theta - b.theta};
}

/// The part (0 to 1) of a small motion. Straight where the truth is an arc: 0.3 mm at 1 m/s, 0.5 rad/s, 70
/// ms.
inline Pose2D part(const Pose2D& motion, double fraction) {
  return {motion.x * fraction, motion.y * fraction, motion.theta * fraction};
}

/// Angle [rad] in [-pi, pi].
inline double wrapAngle(double angle) { return std::remainder(angle, 2 * M_PI); }

}  // namespace kurumaisu
