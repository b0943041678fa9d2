// SPDX-License-Identifier: BSD-3-Clause
// Statuses that several commands answer, C-42-03320B.
#pragma once

namespace kurumaisu::virtual_urg {

inline constexpr const char* kGood = "00";  // of a stream, that it begins
inline constexpr const char* kBroken = "50";

}  // namespace kurumaisu::virtual_urg
