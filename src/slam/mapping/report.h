// SPDX-License-Identifier: BSD-3-Clause
// What diagnostics say of mapping.
#pragma once

#include <cstdint>
#include <string>

namespace kurumaisu {

/// What is known at the moment of diagnostics. Counts are of what came since the last diagnostics.
struct MappingState {
  std::string clock_problem;  ///< of simulated time, or empty
  bool paused = false;
  std::string start_problem;  ///< why a map cannot be gone on from, or empty
  double silence = 0;         ///< since the last scan came [s]
  double silence_limit = 0;   ///< [s]
  std::string missing;        ///< what scans wait for in vain, or empty
  bool begun = false;         ///< a scan has been mapped
  bool full = false;          ///< the last scan for the map did not go in: it would be too large
  bool blind = false;         ///< the last scan showed nothing to go by
  double deviation = 0;       ///< of the position [m]
  std::uint64_t jumps = 0;    ///< of odometry
  std::uint64_t skipped = 0;  ///< scans, for want of time
  std::uint64_t dropped = 0;  ///< scans
  std::string reason;         ///< of the last one dropped
};

struct MappingVerdict {
  int level;  ///< 0 good, 1 warning, 2 error
  std::string summary;
};

MappingVerdict judge(const MappingState& state);

}  // namespace kurumaisu
