// SPDX-License-Identifier: BSD-3-Clause
// A trial of the sensor from the start.
#pragma once

#include <functional>
#include <string>

#include "laser/driver.h"

namespace kurumaisu::laser {

struct Verdict {
  bool passed;
  std::string words;
};

/// Begins anew, so that the sensor is asked how it is, and wants a few scans without any trouble. Takes a few
/// seconds at most; goes on waiting while wait() returns true, which sleeps for a moment.
Verdict selfTest(Driver& driver, const DriverSettings& settings, const std::function<bool()>& wait);

}  // namespace kurumaisu::laser
