// SPDX-License-Identifier: BSD-3-Clause
#include "guard/device.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

namespace kurumaisu::guard {

Device::Device(Open open, const Neutral& neutral, BackOff back_off)
    : open_(std::move(open)),
      neutral_(neutral),
      back_off_(back_off),
      held_{0, 0, neutral.reference},
      pause_(back_off.first) {}

/// Throws Fault, also for what is held instead.
void Device::hold(const dac::Volts& volts) {
  held_ = converter_->put(volts);
  if (std::abs(held_.reference - neutral_.reference) > neutral_.reference_tolerance) {
    throw dac::Fault("the reference is held at " + std::to_string(held_.reference) + " V, not at " +
                     std::to_string(neutral_.reference) + " V");
  }
  const double off = std::max(std::abs(held_.translation), std::abs(held_.steering));
  if (volts.translation == 0 && volts.steering == 0 && off > neutral_.tolerance) {
    throw dac::Fault("neutral is held with " + std::to_string(off) + " V");
  }
}

bool Device::put(const dac::Volts& volts, double now) {
  try {
    hold(volts);
    return true;
  } catch (const std::exception& fault) {
    problem_ = fault.what();
  }
  lost_ = true;
  retry_at_ = now;
  return false;
}

bool Device::recover(double now) {
  try {
    if (is_open_ && !is_ready_) {
      is_ready_ = converter_->prepare();
      return false;
    }
    if (is_open_) {
      hold({0, 0, neutral_.reference});
      lost_ = false;
      pause_ = back_off_.first;
      return true;
    }
    if (converter_) {
      converter_->reopen();
    } else {
      converter_ = open_();
    }
    is_open_ = true;
    is_ready_ = false;
    retry_at_ = now;
  } catch (const std::exception& fault) {
    problem_ = fault.what();
    is_open_ = false;
    retry_at_ = now + pause_;
    pause_ = std::min(2 * pause_, back_off_.longest);
  }
  return false;
}

}  // namespace kurumaisu::guard
