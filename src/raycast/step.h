// SPDX-License-Identifier: BSD-3-Clause
// Stage's rule of motion: one Euler step along the old heading.
#pragma once

#include <cmath>

#include "raycast/beams.h"
#include "raycast/bodies.h"

namespace kurumaisu {

/// In a body's frame.
struct Velocity {
  double forward, leftward;  ///< [m/s]
  double turn;               ///< [rad/s]
};

/// Where a body would be dt [s] later, its heading from -pi to pi.
inline Pose stepped(const Pose& from, const Velocity& velocity, double dt) {
  const double c = std::cos(from.heading);
  const double s = std::sin(from.heading);
  const double forward = velocity.forward * dt;
  const double leftward = velocity.leftward * dt;
  const double heading = from.heading + velocity.turn * dt;
  return {from.x + (forward * c - leftward * s), from.y + (leftward * c + forward * s), from.z,
          heading - kTurn * std::rint(heading * (1 / kTurn))};
}

}  // namespace kurumaisu
