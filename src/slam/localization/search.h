// SPDX-License-Identifier: BSD-3-Clause
// Where in a map could this scan have been taken?
#pragma once

#include <cstdint>
#include <vector>

#include "slam/localization/combed.h"
#include "slam/localization/sensor.h"

namespace kurumaisu {

/// A search over the free places of a map and all headings, in slices.
class Search {
 public:
  /// Keeps references to the sensor and the settings.
  Search(const Sensor& sensor, const RecoverySettings& settings, const Beams& beams);

  /// Goes on for a scan's time; true when done.
  bool step();
  /// Share of the map that has been searched.
  double progress() const;

  /// The most likely poses, no two of them neighbours, the best first.
  std::vector<Pose2D> poses() const;

 private:
  struct Candidate {
    int misfit;
    int x, y;     ///< [cells]
    int heading;  ///< steps
  };
  struct Offset {
    int x, y;  ///< of a reading's cell from base's
  };

  int columnAt(int position) const { return left_ + position % columns_ * stride_; }
  int rowAt(int position) const { return low_ + position / columns_ * stride_; }
  /// Readings for every heading, some of them.
  static std::vector<std::vector<Offset>> rotated(const Beams& beams, double step, double resolution);
  static int farthest(const std::vector<std::vector<Offset>>& rotated);
  /// Tries neighbouring positions of a row, all headings.
  void tryRun(int position, int count);
  void keep(const Candidate& candidate);
  Pose2D poseOf(const Candidate& candidate) const;

  const Sensor* sensor_;
  const RecoverySettings* settings_;
  std::vector<std::vector<Offset>> rotated_;
  int stride_, left_, low_, columns_, rows_;  ///< of the positions [cells]
  int reach_;                                 ///< of the readings [cells]
  Combed codes_;
  int next_ = 0;
  std::vector<std::uint16_t> misfits_;  ///< of a run: for every heading a row
  std::vector<Candidate> kept_;         ///< a heap with the worst on top
};

}  // namespace kurumaisu
