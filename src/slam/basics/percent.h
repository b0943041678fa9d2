// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <string>

namespace kurumaisu {

/// A share in words of a report.
inline std::string percent(double share) { return std::to_string(std::lround(100 * share)) + " %"; }

}  // namespace kurumaisu
