// SPDX-License-Identifier: BSD-3-Clause
#include "model/unicycle.h"

#include <cmath>

namespace kurumaisu {
namespace {

/// sin(x) / x. Below the bound the series is exact to double precision and needs neither a sine nor a division by 0.
double sinc(double x) {
  const double square = x * x;
  if (square > 1e-3) return std::sin(x) / x;
  return 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0));
}

}  // namespace

Pose2D advance(const Pose2D& pose, double v, double w, double dt) {
  const double half_turn = 0.5 * w * dt;
  const double chord = v * dt * sinc(half_turn);
  const double direction = pose.theta + half_turn;
  return {pose.x + chord * std::cos(direction), pose.y + chord * std::sin(direction), pose.theta + w * dt};
}

}  // namespace kurumaisu
