// SPDX-License-Identifier: BSD-3-Clause
// The chair's yaw rate in what an inertial sensor says (REP-145).
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

namespace kurumaisu {

struct YawRate {
  double rate;      ///< [rad/s]
  double variance;  ///< [rad^2/s^2]; 0: unknown
};

/// About an axis (unit vector in the sensor's frame) of angular velocities [rad/s] with their covariance by
/// rows. Nothing where the first element of the covariance is -1: the sensor has no gyro.
inline std::optional<YawRate> yawRate(const Eigen::Vector3d& axis, const Eigen::Vector3d& rates,
                                      const std::array<double, 9>& covariance) {
  if (covariance[0] == -1) return std::nullopt;
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> matrix(covariance.data());
  return YawRate{axis.dot(rates), axis.dot(matrix * axis)};
}

}  // namespace kurumaisu
