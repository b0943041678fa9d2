// SPDX-License-Identifier: BSD-3-Clause
#include "base/estop.h"

namespace kurumaisu {

void EStop::hear(bool stop, double t) {
  heard_ = t;
  cause_ = stop;
  if (stop) latched_ = true;
}

void EStop::tick(double t) {
  if (now_ && t < *now_) {
    heard_.reset();
    since_.reset();
  }
  now_ = t;
  if (!since_) since_ = t;
  silent_ = timeout_ > 0 && t - heard_.value_or(*since_) > timeout_;
  if (silent_) latched_ = true;
}

std::string EStop::reset(bool moving) {
  if (cause_) return "the emergency stop is still pressed";
  if (silent_ || waiting()) return "no message says that the emergency stop is not pressed";
  if (moving) return "motion is commanded: release the input first";
  latched_ = false;
  return "";
}

}  // namespace kurumaisu
