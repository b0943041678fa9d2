// SPDX-License-Identifier: BSD-3-Clause
// The clock that nobody sets.
#pragma once

#include <ctime>

namespace kurumaisu::virtual_urg {

/// [s] since this computer was started.
inline double steady() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace kurumaisu::virtual_urg
