// SPDX-License-Identifier: BSD-3-Clause
// One sweep of a planar laser, and its correction for motion during the sweep.
#pragma once

#include <vector>

#include "model/unicycle.h"

namespace kurumaisu {

/// Where the beams point and when: the same for every scan of a laser.
struct Fan {
  double angle_min;        ///< bearing of beam 0 in the laser's frame [rad]
  double angle_increment;  ///< from beam to beam [rad]; negative where the laser turns clockwise
  double time_increment;   ///< from beam to beam [s]; 0 = all beams at once
  double range_max;        ///< readings above are none [m]
  Pose2D base_from_laser;  ///< mounting [m, rad]
};

/// A sweep. Readings [m] as REP-117 has them: +inf = no return, NaN = nothing is known of this beam.
struct Scan {
  double stamp;  ///< time of beam 0 [s]
  Fan fan;
  std::vector<float> ranges;
};

/// The scan as it would have been taken at once at the time of beam 0.
///
/// motion: pose of base at the last beam, seen from base at beam 0. The readings come back on the same fan:
/// each is interpolated between the moved readings around its bearing, rays that no reading covers are NaN.
/// Readings above range_max are taken as no return.
Scan deskew(const Scan& scan, const Pose2D& motion);

/// The scan without its dropouts: so many beams in a row without a return, or fewer, are NaN.
Scan withoutDropouts(Scan scan, int most);

/// Throws std::invalid_argument naming what makes no sense in a scan: fewer than 2 beams, a fan of 0 or too
/// wide.
void validate(const Scan& scan);

}  // namespace kurumaisu
