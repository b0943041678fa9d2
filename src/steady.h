// SPDX-License-Identifier: BSD-3-Clause
// The clock that nobody can set: it starts with this computer, and is the same for all its processes.
#pragma once

#include <cstdint>
#include <ctime>

namespace kurumaisu {

/// [ns] of CLOCK_MONOTONIC, which is Python's time.monotonic_ns().
inline std::int64_t steadyNanoseconds() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

/// [ns] that this computer has slept since its start: what CLOCK_BOOTTIME counts more. Both clocks are read again
/// where something came in between.
inline std::int64_t sleptNanoseconds() {
  for (;;) {
    const std::int64_t before = steadyNanoseconds();
    timespec with_sleep{};
    clock_gettime(CLOCK_BOOTTIME, &with_sleep);
    if (steadyNanoseconds() - before > 1'000'000) continue;
    return std::int64_t{1'000'000'000} * with_sleep.tv_sec + with_sleep.tv_nsec - before;
  }
}

/// Nanoseconds as seconds.
constexpr double seconds(std::int64_t nanoseconds) { return 1e-9 * static_cast<double>(nanoseconds); }

/// [s] for deadlines and latencies.
inline double steadyTime() { return seconds(steadyNanoseconds()); }

}  // namespace kurumaisu
