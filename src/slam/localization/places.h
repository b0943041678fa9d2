// SPDX-License-Identifier: BSD-3-Clause
// Several places at which the chair might be, each followed until one is left.
#pragma once

#include <vector>

#include "slam/localization/motion.h"
#include "slam/localization/sensor.h"

namespace kurumaisu {

class Places {
 public:
  /// Keeps references to the sensor and the settings.
  Places(const Sensor& sensor, const RecoverySettings& settings) : sensor_(&sensor), settings_(&settings) {}

  /// Adds poses, each aligned to the readings first.
  void add(const std::vector<Pose2D>& poses, const Beams& beams);
  /// Adds the pose that was believed so far, with a head start.
  void addDoubted(const Pose2D& pose, const Beams& beams);

  /// Moves all places and weighs them by a scan; forgets those that are hopeless, or have met another, but not the
  /// one that was believed.
  void update(const Gaussian& motion, const Beams& beams);

  /// Takes in places found later: they compete with those there are from now on, at par.
  void merge(const Places& others);

  bool empty() const { return places_.empty(); }
  std::size_t size() const { return places_.size(); }
  /// The likeliest place and its fit.
  Gaussian best() const;
  double bestFit() const;
  /// The place that was believed; where none was, the likeliest.
  Gaussian shown() const;
  bool hasDoubted() const { return doubted() != places_.end(); }
  /// How much likelier it is than all others together.
  double odds() const;
  std::vector<Weighted> all() const;

 private:
  struct Place {
    Gaussian pose;
    double log_weight;
    double fit;    ///< mean share of readings explained
    bool doubted;  ///< it was believed before the search
  };

  std::vector<Place>::const_iterator doubted() const;
  Place placeAt(const Pose2D& pose, const Beams& beams) const;
  void align(Place& place, const Beams& beams, int rounds) const;
  void tidy();

  const Sensor* sensor_;
  const RecoverySettings* settings_;
  std::vector<Place> places_;  ///< the likeliest first
};

}  // namespace kurumaisu
