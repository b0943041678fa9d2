// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/report.h"

#include <sstream>

namespace kurumaisu {
namespace {

std::string deviation(const MappingState& state) {
  std::ostringstream out;
  out.precision(2);
  out << "deviation " << state.deviation << " m";
  return out.str();
}

/// What went wrong since the last time, if the map grows all the same.
MappingVerdict passing(const MappingState& state) {
  if (state.jumps > 0) {
    return {1, "MAPPING_ODOMETRY_JUMP: jumps rejected: " + std::to_string(state.jumps)};
  }
  if (state.skipped > 0) return {1, "MAPPING_TOO_SLOW: scans skipped: " + std::to_string(state.skipped)};
  if (state.dropped > 0) {
    return {1, "MAPPING_DROPPED: scans dropped: " + std::to_string(state.dropped) +
                   ", the last: " + state.reason};
  }
  return {0, "mapping; " + deviation(state)};
}

}  // namespace

MappingVerdict judge(const MappingState& state) {
  // A node that is behind its scans is behind the clock, too.
  if (!state.clock_problem.empty() && state.skipped == 0) {
    return {2, "MAPPING_NO_CLOCK: " + state.clock_problem};
  }
  if (!state.start_problem.empty()) return {2, "MAPPING_START: " + state.start_problem};
  if (state.silence > state.silence_limit) return {2, "MAPPING_NO_SCAN: no scan came lately"};
  if (state.paused) return {1, "MAPPING_PAUSED: scans are not used"};
  if (!state.missing.empty()) return {2, "MAPPING_NO_TRANSFORM: scans come, but " + state.missing};
  if (!state.begun && state.dropped == 0) return {1, "no scan yet"};
  if (state.full) return {2, "MAPPING_TOO_LARGE: the map does not grow any more: most_cells"};
  if (state.blind)
    return {1, "MAPPING_BLIND: the scans show nothing to match; odometry alone: " + deviation(state)};
  return passing(state);
}

}  // namespace kurumaisu
