// SPDX-License-Identifier: BSD-3-Clause
// The one clock of client and guard: it starts with the machine, and nobody can set it.
#pragma once

#include <cstdint>

namespace kurumaisu::guard {

/// Nanoseconds of CLOCK_MONOTONIC as seconds.
constexpr double seconds(std::int64_t nanoseconds) { return 1e-9 * static_cast<double>(nanoseconds); }

std::int64_t monotonicNanoseconds();
inline double monotonic() { return seconds(monotonicNanoseconds()); }

}  // namespace kurumaisu::guard
