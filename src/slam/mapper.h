// SPDX-License-Identifier: BSD-3-Clause
// Mapping: scan-matched motion feeds MRPT's Rao-Blackwellised particle filter. No ROS, and no MRPT in this
// header.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "slam/scan.h"
#include "slam/settings.h"

namespace kurumaisu {

/// Occupancy in rows from the lower left corner.
struct OccupancyGrid {
  double resolution;  ///< [m]
  double x;           ///< of the lower left corner [m]
  double y;
  int width;  ///< [cells]
  int height;
  std::vector<std::int8_t> cells;  ///< 0 (free) to 100 (occupied), -1 = never seen
};

struct StampedPose {
  double stamp;  ///< [s]
  Pose2D pose;
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
    std::array<double, 9> covariance;  ///< spread of the particles: x, y [m], heading [rad], row by row
    bool localised;                    ///< the filter weighed this scan
    bool map_updated;                  ///< this scan went into the map
  };

  /// Adds a scan. start, end: odom_from_base at the first and at the last beam.
  /// Throws std::invalid_argument for a scan that makes no sense or is not later than the last one.
  Estimate add(const Scan& scan, const Pose2D& start, const Pose2D& end);

  /// Pose of base at every scan so far, as the likeliest particle now sees its past.
  std::vector<StampedPose> trajectory() const;

  /// Map of the likeliest particle, cut to what has been seen; no cells before the first scan.
  OccupancyGrid grid() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace kurumaisu
