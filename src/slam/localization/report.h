// SPDX-License-Identifier: BSD-3-Clause
// What diagnostics say of localisation.
#pragma once

#include <string>

#include "slam/localization/localizer.h"

namespace kurumaisu {

/// What is known at the moment of diagnostics.
struct LocalizationState {
  std::string clock_problem;  ///< of simulated time, or empty
  bool has_map;
  std::string bad_map;                         ///< why the last map was refused, or empty
  double silence;                              ///< since the last scan came [s]
  double silence_limit;                        ///< [s]
  std::string missing;                         ///< what scans wait for in vain, or empty
  const Localizer::Estimate* estimate;         ///< of the last scan; null before the first
  std::uint64_t newly_dropped, newly_skipped;  ///< since the last diagnostics
};

struct LocalizationVerdict {
  int level;  ///< 0 good, 1 warning, 2 error
  std::string summary;
};

LocalizationVerdict judge(const LocalizationState& state);

const char* nameOf(Knowledge knowledge);

}  // namespace kurumaisu
