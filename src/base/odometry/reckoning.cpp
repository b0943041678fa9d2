// SPDX-License-Identifier: BSD-3-Clause
#include "base/odometry/reckoning.h"

namespace kurumaisu {

Reckoning::Reckoning(const OdometryNoise& noise, const std::optional<GyroSettings>& gyro) : odometry_(noise) {
  if (!gyro) return;
  gyro_.emplace(*gyro);
  odometry_.setGyroScale(gyro->scale_sd * gyro->scale_sd);
}

void Reckoning::advance(double v, double w, double from, double to) {
  if (!gyro_) return odometry_.advance(v, w, to - from);
  gyro_->setNeutral(v == 0 && w == 0, from);
  if (gyro_->counts().biases > biases_) {
    biases_ = gyro_->counts().biases;
    odometry_.setGyroBias(gyro_->bias()->variance, gyro_->settings().bias_walk);
  }
  const std::optional<Turn> turn = gyro_->turn(from, to);
  if (turn) {
    odometry_.advance(v, *turn, to - from);
  } else {
    odometry_.advance(v, w, to - from);
  }
}

void Reckoning::restart() {
  odometry_.reset();
  if (gyro_) gyro_->restart();
}

}  // namespace kurumaisu
