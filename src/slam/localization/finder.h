// SPDX-License-Identifier: BSD-3-Clause
// A search of the whole map that goes on over many scans, while the chair drives on.
#pragma once

#include <optional>

#include "slam/localization/motion.h"
#include "slam/localization/places.h"
#include "slam/localization/search.h"

namespace kurumaisu {

class Finder {
 public:
  /// Keeps references to the sensor and the settings.
  Finder(const Sensor& sensor, const LocalizerSettings& settings, const RateNoise& process)
      : sensor_(&sensor), settings_(&settings), process_(process) {}

  /// Goes on with the search for the places of one scan, or begins one with these beams if they are enough. When done,
  /// the places are moved to where they would be by now. doubted: where the chair was believed to be when the
  /// search begins, if it was anywhere; it competes, with a head start.
  std::optional<Places> step(const Beams& beams, const Odometry& now, const std::optional<Pose2D>& doubted);

  void reset() { search_.reset(); }
  bool busy() const { return search_.has_value(); }
  /// Share of the map that has been searched.
  double progress() const { return search_ ? search_->progress() : 1; }

 private:
  const Sensor* sensor_;
  const LocalizerSettings* settings_;
  RateNoise process_;
  std::optional<Search> search_;
  Beams beams_{};     ///< the search is for their place
  Odometry begun_{};  ///< at these beams
  std::optional<Pose2D> doubted_;
};

}  // namespace kurumaisu
