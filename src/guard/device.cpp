// SPDX-License-Identifier: BSD-3-Clause
#include "guard/device.h"

#include <algorithm>
#include <exception>
#include <utility>

namespace kurumaisu::guard {

Device::Device(Open open, dac::Volts neutral, BackOff back_off)
    : open_(std::move(open)),
      neutral_(neutral),
      back_off_(back_off),
      held_(neutral),
      pause_(back_off.first) {}

bool Device::put(const dac::Volts& volts, double now) {
  try {
    held_ = converter_->put(volts);
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
    if (is_open_) {
      held_ = converter_->put(neutral_);
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
