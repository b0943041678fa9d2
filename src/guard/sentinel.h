// SPDX-License-Identifier: BSD-3-Clause
// The guard's parent: when the guard dies or hangs, it writes neutral itself and starts another.
#pragma once

#include "guard/device.h"
#include "guard/settings.h"

namespace kurumaisu::guard {

/// Runs guards until a signal says to end; isToEnd(). Returns the exit status: 0, or 1 if a guard could not even begin.
///
/// The guard ends, neutral, when this process dies, and is neutral while it is stopped. systemd hears of the guard's
/// signs of life from here, so that its watchdog sees either of them hang.
int runSentinel(const Settings& settings, const Device::Open& open);

/// Opens the device and puts neutral, for so long [s] at most. False if it could not; says so.
bool forceNeutral(const Settings& settings, const Device::Open& open, double patience);

}  // namespace kurumaisu::guard
