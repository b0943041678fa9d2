// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/report.h"

#include <cmath>
#include <sstream>

#include "slam/basics/percent.h"

namespace kurumaisu {
namespace {

std::string lost(const Localizer::Estimate& estimate) {
  return "LOCALIZATION_LOST: the scan does not fit the map at the estimated pose; searched: " +
         percent(estimate.searched);
}

std::string ambiguous(const Localizer::Estimate& estimate) {
  const auto& covariance = estimate.map_from_base.covariance;
  std::ostringstream out;
  out.precision(2);
  out << "LOCALIZATION_AMBIGUOUS: several places, or a wide area, are possible: deviation "
      << std::sqrt(covariance(0, 0) + covariance(1, 1)) << " m; drive on";
  return out.str();
}

}  // namespace

const char* nameOf(Knowledge knowledge) {
  switch (knowledge) {
    case Knowledge::kTracking:
      return "tracking";
    case Knowledge::kAmbiguous:
      return "ambiguous";
    default:
      return "lost";
  }
}

LocalizationVerdict judge(const LocalizationState& state) {
  // A node that is behind its scans is behind the clock, too.
  if (!state.clock_problem.empty() && state.newly_skipped == 0) {
    return {2, "LOCALIZATION_NO_CLOCK: " + state.clock_problem};
  }
  if (!state.bad_map.empty()) return {2, "LOCALIZATION_BAD_MAP: " + state.bad_map};
  if (!state.has_map) return {2, "LOCALIZATION_NO_MAP: no map has come"};
  if (!state.missing.empty()) return {2, "LOCALIZATION_NO_TRANSFORM: scans come, but " + state.missing};
  if (state.silence > state.silence_limit) return {2, "LOCALIZATION_NO_SCAN: no scan came lately"};
  if (state.estimate == nullptr) return {1, "no scan yet"};
  if (state.estimate->knowledge == Knowledge::kLost) return {2, lost(*state.estimate)};
  if (state.estimate->knowledge == Knowledge::kAmbiguous) return {1, ambiguous(*state.estimate)};
  if (state.estimate->blind) {
    return {1, "LOCALIZATION_BLIND: the scans show nothing to go by; odometry alone"};
  }
  if (state.newly_skipped > 0) {
    return {1, "LOCALIZATION_TOO_SLOW: scans skipped since the last message: " +
                   std::to_string(state.newly_skipped)};
  }
  if (state.newly_dropped > 0) {
    return {1, "LOCALIZATION_DROPPED: scans dropped since the last message: " +
                   std::to_string(state.newly_dropped)};
  }
  return {0, "tracking; the map explains " + percent(state.estimate->fit) + " of the readings"};
}

}  // namespace kurumaisu
