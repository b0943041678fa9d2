// SPDX-License-Identifier: BSD-3-Clause
#include "base/odometry.h"

#include <cmath>
#include <stdexcept>

namespace kurumaisu {

void Odometry::reset() {
  pose_ = {0, 0, 0};
  covariance_.setZero();
  v_ = w_ = 0;
  rate_variance_.setZero();
}

void Odometry::advance(double v, double w, double dt) {
  if (!(dt > 0)) throw std::invalid_argument("dt must be positive: " + std::to_string(dt));
  const Pose2D before = pose_;
  pose_ = kurumaisu::advance(before, v, w, dt);

  const double distance = std::abs(v) * dt;
  const double turn = std::abs(w) * dt;
  const Eigen::Vector3d added(noise_.forward_per_distance * distance + noise_.forward_per_turn * turn,
                              noise_.lateral_per_distance * distance,
                              noise_.heading_per_distance * distance + noise_.heading_per_turn * turn);
  const double dx = pose_.x - before.x;
  const double dy = pose_.y - before.y;
  Eigen::Matrix3d by_pose;  // d(pose) / d(pose before)
  by_pose << 1, 0, -dy, 0, 1, dx, 0, 0, 1;
  // d(pose) / d(forward, lateral, heading) added along the chord; heading grows evenly, so half of it bends
  // the chord.
  const double direction = 0.5 * (before.theta + pose_.theta);
  const double c = std::cos(direction);
  const double s = std::sin(direction);
  Eigen::Matrix3d by_noise;
  by_noise << c, -s, -0.5 * dy, s, c, 0.5 * dx, 0, 0, 1;
  covariance_ =
      by_pose * covariance_ * by_pose.transpose() + by_noise * added.asDiagonal() * by_noise.transpose();

  v_ = v;
  w_ = w;
  rate_variance_ = added / (dt * dt);
}

}  // namespace kurumaisu
