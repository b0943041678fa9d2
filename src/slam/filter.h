// SPDX-License-Identifier: BSD-3-Clause
// MRPT's Rao-Blackwellised particle filter, as the mapper uses it. No MRPT type in this header.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "slam/mapper.h"

namespace kurumaisu {

/// Particles, each a path and the map seen along it.
class Filter {
 public:
  /// All particles start at one pose, with empty maps.
  Filter(const MapperSettings& settings, std::uint32_t seed, const Pose2D& map_from_base);
  ~Filter();

  /// Moves the particles by a motion with the settings' noise and weighs them by a de-skewed scan.
  void localise(const Scan& scan, const Pose2D& motion);
  /// Adds a de-skewed scan to every particle's map, at its last pose.
  void insert(const Scan& scan);

  Pose2D bestPose() const;
  /// Poses of the likeliest particle: at the start and after every localise().
  std::vector<Pose2D> bestPath() const;
  std::array<double, 9> covariance() const;
  OccupancyGrid grid() const;

 private:
  struct Particles;
  void seedRandom();

  MapperSettings settings_;
  std::uint32_t seed_;
  std::uint32_t rounds_ = 0;
  std::unique_ptr<Particles> particles_;
};

}  // namespace kurumaisu
