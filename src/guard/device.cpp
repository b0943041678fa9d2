// SPDX-License-Identifier: BSD-3-Clause
#include "guard/device.h"

#include <algorithm>
#include <utility>

namespace kurumaisu::guard {

Device::Device(Open open, dac::Volts neutral, BackOff back_off)
    : open_(std::move(open)),
      neutral_(neutral),
      back_off_(back_off),
      held_(neutral),
      pause_(back_off.first) {}

std::optional<dac::Volts> Device::put(const dac::Volts& volts, double now) {
  try {
    held_ = converter_->put(volts);
    return held_;
  } catch (const dac::Fault& fault) {
    problem_ = fault.what();
  }
  if (!tryNeutral()) {
    lost_ = true;
    pause_ = back_off_.first;
    retry_at_ = now;
  }
  return std::nullopt;
}

bool Device::recover(double now) {
  try {
    if (converter_) {
      converter_->reopen();
    } else {
      converter_ = open_();
    }
  } catch (const dac::Fault& fault) {
    problem_ = fault.what();
    retry_at_ = now + pause_;
    pause_ = std::min(2 * pause_, back_off_.longest);
    return false;
  }
  if (tryNeutral()) return true;
  retry_at_ = now + pause_;
  pause_ = std::min(2 * pause_, back_off_.longest);
  return false;
}

bool Device::tryNeutral() {
  try {
    held_ = converter_->put(neutral_);
    lost_ = false;
    pause_ = back_off_.first;
    return true;
  } catch (const dac::Fault& fault) {
    problem_ = fault.what();
    return false;
  }
}

}  // namespace kurumaisu::guard
