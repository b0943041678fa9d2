// SPDX-License-Identifier: BSD-3-Clause
// Where a sensor's beams point, what to ask it for, and its numbers in SI.
#pragma once

#include "laser/scan.h"
#include "scip/request.h"
#include "scip/scan.h"
#include "scip/sensor.h"

namespace kurumaisu::laser {

/// The part of a turn that a user wants, in urg_node's names.
struct Window {
  double angle_min =
      0;  ///< [rad] counter-clockwise from the front, within a turn; what the sensor lacks is cut off
  double angle_max = 0;    ///< [rad]
  int cluster = 1;         ///< steps joined into a beam, 1 to 99
  int skip = 0;            ///< scans left out between two, 0 to 9
  bool intensity = false;  ///< asks for it; what has none answers 0E
};

/// The beams of a window.
///
/// A beam of a cluster holds the least distance in it, so it is given the bearing and the time of the cluster's middle.
/// All clusters are whole: steps left over at the window's end are not asked for.
class Fan {
 public:
  /// Throws std::invalid_argument naming the parameter that is out of its range or leaves no beam.
  Fan(const scip::Parameters& sensor, const Window& window);

  const scip::Request& request() const { return request_; }

  /// [s] from the sensor's clock, which it reads at step 0, to the first beam.
  double firstBeam() const { return first_beam_; }

  /// [s] from the sensor's clock to the last step asked for: no byte of the scan can leave the sensor before.
  double leastDelay() const { return least_delay_; }

  /// The scan in SI, but for its latency. The time is the host's when the sensor read its clock [s].
  Scan convert(const scip::Rotation& rotation, double time) const;

 private:
  float range(int distance) const;  // [m] of the sensor's number

  scip::Request request_;
  Scan empty_;  // all but what changes from scan to scan
  double first_beam_ = 0;
  double least_delay_ = 0;
  std::vector<int> far_codes_;
  int distance_min_ = 0;  // [mm]
  int distance_max_ = 0;  // [mm]
};

}  // namespace kurumaisu::laser
