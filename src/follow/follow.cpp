// SPDX-License-Identifier: BSD-3-Clause
#include "follow/follow.h"

#include <algorithm>
#include <cmath>

namespace kurumaisu {

double RateLimiter::step(double target, double dt) {
  const double gap = target - level_;
  const double needed = slowness_ * std::fabs(gap);
  if (needed <= dt) {
    level_ = target;
    return target - gap * needed / (2 * dt);
  }
  const double gained = std::copysign(dt / slowness_, gap);
  level_ += gained;
  return level_ - gained / 2;
}

Lag::Lag(double tau, double dt, double level)
    : decay_(std::exp(-dt / tau)), mean_(tau / dt * (1 - decay_)), level_(level) {}

double Play::step(double input) {
  level_ = std::min(std::max(level_, input - half_), input + half_);
  return level_;
}

}  // namespace kurumaisu
