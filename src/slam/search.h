// SPDX-License-Identifier: BSD-3-Clause
// Where in a map could this scan have been taken?
#pragma once

#include <Eigen/Core>
#include <vector>

#include "slam/sensor.h"

namespace kurumaisu {

/// A search over the free places of a map and all headings, in slices.
class Search {
 public:
  /// Keeps references to the sensor and the settings.
  Search(const Sensor& sensor, const RecoverySettings& settings, Beams beams);

  /// Goes on for a scan's time; true when done.
  bool step();
  /// Share of the map that has been searched.
  double progress() const;

  /// The most likely poses, no two of them neighbours, the best first.
  std::vector<Pose2D> poses() const;

 private:
  struct Candidate {
    int misfit;
    int x, y, heading;  ///< steps
  };
  struct Offset {
    float x, y;  ///< of a reading from base [cells]
  };

  void tryPosition(int x, int y);
  void keep(const Candidate& candidate);
  Pose2D poseOf(const Candidate& candidate) const;

  const Sensor* sensor_;
  const RecoverySettings* settings_;
  std::vector<std::vector<Offset>> rotated_;  ///< readings for every heading
  int stride_, columns_, rows_;
  int next_ = 0;
  std::vector<Candidate> kept_;  ///< a heap with the worst on top
};

}  // namespace kurumaisu
