// SPDX-License-Identifier: BSD-3-Clause
// MRPT's Rao-Blackwellised particle filter, as the mapper uses it. No MRPT type in this header.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "slam/mapping/mapper.h"

namespace kurumaisu {

/// Particles, each a path and the map seen along it.
class Filter {
 public:
  /// All particles start at one pose, with empty maps.
  Filter(const MapperSettings& settings, std::uint32_t seed, const Pose2D& map_from_base);
  ~Filter();

  /// Goes on in a map, with particles spread around a pose. Before anything else.
  void resume(const OccupancyGrid& map, const Gaussian& map_from_base);

  /// Moves the particles by a motion with the settings' noise, and more of it (along base's axes at the start), and
  /// weighs them by a de-skewed scan.
  void localise(const Scan& scan, const Pose2D& motion, const Eigen::Matrix3d& more);
  /// Adds a de-skewed scan to every particle's map, at its last pose.
  void insert(const Scan& scan);

  Pose2D bestPose() const;
  /// Poses of the likeliest particle: at the start and after every localise().
  std::vector<Pose2D> bestPath() const;
  /// Spread of all particles around the likeliest at every node of its path. Where they have one ancestor it is 0.
  std::vector<std::array<double, 9>> pathCovariances() const;
  std::array<double, 9> covariance() const { return covarianceAt(nodes() - 1); }
  std::vector<Weighted> particles() const;
  /// Of the particles' weights [nat].
  double entropy() const;
  OccupancyGrid grid() const;

 private:
  struct Particles;
  void seedRandom();
  std::size_t nodes() const;
  std::array<double, 9> covarianceAt(std::size_t node) const;

  MapperSettings settings_;
  std::uint32_t seed_;
  std::uint32_t rounds_ = 0;
  std::unique_ptr<Particles> particles_;
};

}  // namespace kurumaisu
