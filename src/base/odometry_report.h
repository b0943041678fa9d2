// SPDX-License-Identifier: BSD-3-Clause
// What diagnostics say of odometry, in words.
#pragma once

#include <string>
#include <vector>

#include "base/odometry/reckoning.h"
#include "base/report.h"

namespace kurumaisu {

/// unfollowed: ids of effects that the chair has and odometry has not; measured: whether its noise was.
/// before: the gyro's counts at the last report; what has happened since then is a warning.
Report reportOdometry(const Reckoning& reckoning, const std::vector<std::string>& unfollowed, bool measured,
                      const GyroCounts& before);

/// What to say at the start of effects that odometry does not follow; empty where there are none.
std::string unfollowedWarning(const std::vector<std::string>& unfollowed);

}  // namespace kurumaisu
