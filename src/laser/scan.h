// SPDX-License-Identifier: BSD-3-Clause
// A scan as it is published.
#pragma once

#include <cstdint>
#include <vector>

namespace kurumaisu::laser {

/// One rotation in SI, ranges by REP 117: +inf nothing in reach, NaN no measurement, never 0.
struct Scan {
  double stamp = 0;                ///< [s] host's time at which the first beam was measured
  double angle_min = 0;            ///< [rad] of the first beam, counter-clockwise from the front
  double angle_max = 0;            ///< [rad] of the last one
  double angle_increment = 0;      ///< [rad]
  double time_increment = 0;       ///< [s] from beam to beam
  double scan_time = 0;            ///< [s] from scan to scan, those left out included
  double range_min = 0;            ///< [m]
  double range_max = 0;            ///< [m]
  std::vector<float> ranges;       ///< (beams,) [m]
  std::vector<float> intensities;  ///< (beams,) sensor's unit, or none
  std::uint32_t clock = 0;         ///< [ms] of the sensor, 24 bits, at step 0
  double latency = 0;  ///< [s] from the last step measured to the first byte here, as DeviceClock has it
};

}  // namespace kurumaisu::laser
