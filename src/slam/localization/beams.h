// SPDX-License-Identifier: BSD-3-Clause
// The readings of a scan that a localiser weighs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "model/laser_error.h"
#include "slam/basics/scan.h"
#include "slam/localization/settings.h"

namespace kurumaisu {

/// A reading that met something, moved to the time of the scan's first beam.
struct Beam {
  float x, y;          ///< where, in base's frame [m]
  float range;         ///< of the laser [m]
  std::uint8_t grade;  ///< of its deviation: see deviationOf()
};

struct Beams {
  Pose2D base_from_laser;
  std::vector<Beam> beams;
  double independence = 1;  ///< share of them that count as independent of their neighbours
};

constexpr std::size_t kLeastReadings = 8;  ///< fewer say nothing of how well they fit

constexpr int kGrades = 8;

/// Deviation [m] of the readings of a grade: up to its share of max_range, by equation (4) and sigma_hit.
double deviationOf(int grade, const ReadingSettings& settings, const LaserError& error);

/// Picks readings, evenly spread, and takes out what base moved during the scan. Where a beam has none, the nearest that
/// has one stands for it.
///
/// motion: pose of base at the last beam, seen from base at beam 0. NaN, 0, negative and infinite readings,
/// and those beyond range_max or the settings' max_range, say nothing of a wall and are left out.
Beams pick(const Scan& scan, const Pose2D& motion, const ReadingSettings& settings);

}  // namespace kurumaisu
