// SPDX-License-Identifier: BSD-3-Clause
// Mapping: scan-matched motion feeds MRPT's Rao-Blackwellised particle filter. No ROS, and no MRPT in this
// header.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <vector>

#include "slam/basics/gaussian.h"
#include "slam/basics/occupancy.h"
#include "slam/basics/scan.h"
#include "slam/mapping/saved_map.h"
#include "slam/mapping/settings.h"

namespace kurumaisu {

struct StampedPose {
  double stamp;  ///< [s]
  Pose2D pose;
};

struct UncertainPose {
  double stamp;  ///< [s]
  Pose2D pose;
  std::array<double, 9> covariance;  ///< x, y [m], heading [rad], row by row
};

/// The chair is not where it was said to be in the map to go on from.
struct StartError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// Builds a map from scans and odometry. The map's frame is the odometry's at the first scan.
class Mapper {
 public:
  /// Equal settings, seed and scans give equal results, bit by bit. Throws std::invalid_argument.
  Mapper(const MapperSettings& settings, std::uint32_t seed);
  ~Mapper();
  Mapper(Mapper&&) noexcept;
  Mapper& operator=(Mapper&&) noexcept;

  struct Estimate {
    Pose2D map_from_base;              ///< at the scan's stamp, of the likeliest particle
    std::array<double, 9> covariance;  ///< of the particles, and of what odometry alone says since: as above
    bool localised;                    ///< the filter weighed this scan
    bool map_updated;                  ///< this scan went into the map
    bool jumped;                       ///< odometry had jumped: its motion was not believed
    bool blind;                        ///< the scan showed nothing to go by: odometry alone says where it is
    bool full;                         ///< this scan did not go into the map, which would be too large
  };

  /// Goes on from a map, in its frame: the chair is about there (deviations of up to 1 m and 0.5 rad), which the first
  /// scan tells better. Before any scan. Throws std::invalid_argument for what makes no sense, or is too large.
  void resume(SavedMap map, const Gaussian& map_from_base);

  /// Adds a scan. start, end: odom_from_base at the first and at the last beam.
  /// Throws std::invalid_argument for a scan that makes no sense or is not later than the last one; StartError for
  /// the first one after resume() that does not fit there: the next one may.
  Estimate add(const Scan& scan, const Pose2D& start, const Pose2D& end);

  /// Pose of base at every scan so far, as the likeliest particle now sees its past.
  std::vector<StampedPose> trajectory() const;

  /// The likeliest particle's path where the filter ran, and how far the others are from it.
  std::vector<UncertainPose> nodes() const;

  /// For display; none before the first scan.
  std::vector<Weighted> particles() const;

  /// Of the particles' weights [nat]; 0 before the first scan.
  double entropy() const;

  /// The scans that made the map, with the poses of the likeliest particle; those gone on from come first.
  std::vector<KeyScan> keys() const;

  /// Map of the likeliest particle, cut to what has been seen; that gone on from before the first scan.
  OccupancyGrid grid() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace kurumaisu
