// SPDX-License-Identifier: BSD-3-Clause
// Where bodies come to by Stage's rule of motion, and what is mounted on them.
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

/// In the map, what is at a pose in a frame; the heading is not wrapped.
inline Pose mounted(const Pose& frame, const Pose& pose) {
  const double c = std::cos(frame.heading);
  const double s = std::sin(frame.heading);
  return {frame.x + pose.x * c - pose.y * s, frame.y + pose.y * c + pose.x * s, frame.z + pose.z,
          frame.heading + pose.heading};
}

/// Where a body would be dt [s] later, by one Euler step along its old heading; the new one from -pi to pi.
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
