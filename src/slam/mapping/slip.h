// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "model/unicycle.h"

namespace kurumaisu {

/// How fast odometry goes wrong: its scale, drift and lag all show as a rate that changes slowly against the
/// scans. Uncorrected, the bend it leaves in every de-skewed scan adds up: 0.07 degrees a scan are 90 degrees
/// an hour.
class Slip {
 public:
  explicit Slip(double gain) : gain_(gain) {}

  /// What odometry says of a stretch of time [s], corrected.
  Pose2D corrected(const Pose2D& motion, double duration) const {
    return {motion.x + rate_.x * duration, motion.y + rate_.y * duration,
            motion.theta + rate_.theta * duration};
  }

  void learn(const Pose2D& matched, const Pose2D& odometry, double duration) {
    rate_.x += gain_ * ((matched.x - odometry.x) / duration - rate_.x);
    rate_.y += gain_ * ((matched.y - odometry.y) / duration - rate_.y);
    rate_.theta += gain_ * ((matched.theta - odometry.theta) / duration - rate_.theta);
  }

 private:
  double gain_;
  Pose2D rate_{0, 0, 0};  ///< [m/s, m/s, rad/s] in the base's frame
};

}  // namespace kurumaisu
