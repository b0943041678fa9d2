// SPDX-License-Identifier: BSD-3-Clause
// How well readings fit a map from a pose.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "slam/localization/beams.h"
#include "slam/localization/field.h"

namespace kurumaisu {

/// What became of a scan's readings at a pose.
struct Fit {
  int hits = 0;     ///< end at a wall that can be seen from there
  int shorts = 0;   ///< end before any wall: people, or things that the map does not have
  int through = 0;  ///< have gone through a wall, or end where nothing is known
  double log_likelihood = 0;

  int readings() const { return hits + shorts + through; }
  /// Share of readings that the map explains; one in the way counts half against it, one through a wall double. 0
  /// without readings.
  double share() const;
};

struct Aligned {
  Pose2D pose;
  Eigen::Matrix3d information;  ///< of x, y [1/m^2], heading [1/rad^2]
};

/// The sensor model: a likelihood field with the deviations of equation (4).
class Sensor {
 public:
  /// Keeps a reference to the field.
  Sensor(const Field& field, const ReadingSettings& settings, const LaserError& error);

  const Field& field() const { return *field_; }

  /// Log-likelihood of readings, correlations taken out, from map_from_base.
  double weigh(const Beams& beams, const Pose2D& map_from_base) const;

  /// Looks along every ray as well.
  Fit look(const Beams& beams, const Pose2D& map_from_base) const;

  /// The pose near start that explains the readings best; prior: information on start.
  Aligned align(const Beams& beams, const Pose2D& start, const Eigen::Matrix3d& prior, int rounds) const;

 private:
  enum class Ray { kClear, kBlocked, kUnknown };
  Ray trace(float x0, float y0, float x1, float y1, float tolerance) const;

  const Field* field_;
  std::array<std::array<float, 256>, kGrades> table_{};
  std::array<float, kGrades> tolerance_{};   ///< of a hit [m]
  std::array<double, kGrades> precision_{};  ///< 1 / variance [1/m^2]
  float in_the_way_, impossible_;            ///< log-likelihoods of readings that do not end at a wall
};

}  // namespace kurumaisu
