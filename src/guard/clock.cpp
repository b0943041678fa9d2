// SPDX-License-Identifier: BSD-3-Clause
#include "guard/clock.h"

#include <ctime>

namespace kurumaisu::guard {

std::int64_t monotonicNanoseconds() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

}  // namespace kurumaisu::guard
