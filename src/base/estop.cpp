// SPDX-License-Identifier: BSD-3-Clause
#include "base/estop.h"

namespace kurumaisu {

void EStop::hear(const Speaker& by, bool stop, double t) {
  words_.hear(by, stop, t);
  if (stop) latched_ = true;
}

void EStop::tick(double t) {
  if (now_ && t < *now_) {
    words_.forgetTimes();
    since_.reset();
  }
  now_ = t;
  if (!since_) since_ = t;
  silent_ = timeout_ > 0 && t - words_.oldest().value_or(*since_) > timeout_;
  if (silent_) latched_ = true;
}

std::string EStop::reset(bool moving) {
  if (const std::string holders = words_.holders(); !holders.empty())
    return "the emergency stop is still pressed by " + holders;
  if (silent_ || waiting()) return "no message says that the emergency stop is not pressed";
  if (moving) return "motion is commanded: release the input first";
  words_.forgetGone();
  latched_ = false;
  return "";
}

}  // namespace kurumaisu
