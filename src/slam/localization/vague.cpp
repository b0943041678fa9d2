// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/vague.h"

#include <cmath>

#include "slam/basics/pose.h"

namespace kurumaisu {

Eigen::Matrix3d anywhere(const Field& field) {
  Eigen::Matrix3d out = Eigen::Matrix3d::Zero();
  const double edge = field.resolution() * std::hypot(field.width(), field.height());
  out.diagonal() << edge * edge / 12, edge * edge / 12, M_PI * M_PI / 3;
  return out;
}

double ofMap(const Field& field) { return field.resolution() * field.resolution() / 12; }

void blur(Eigen::Matrix3d& covariance, double least) {
  for (int i = 0; i < 2; ++i) covariance(i, i) = std::fmax(covariance(i, i), least * least);
}

Eigen::Matrix3d around(const Pose2D& middle, const std::vector<Weighted>& places) {
  Eigen::Matrix3d out = Eigen::Matrix3d::Zero();
  for (const auto& [pose, weight] : places) {
    const Eigen::Vector3d off(pose.x - middle.x, pose.y - middle.y, wrapAngle(pose.theta - middle.theta));
    out += weight * off * off.transpose();
  }
  return out;
}

}  // namespace kurumaisu
