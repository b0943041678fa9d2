// SPDX-License-Identifier: BSD-3-Clause
// Localisation in a known map. No ROS, and no MRPT in this header.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "model/laser_error.h"
#include "slam/basics/occupancy.h"
#include "slam/basics/scan.h"
#include "slam/localization/motion.h"

namespace kurumaisu {

/// What is known of where the chair is.
enum class Knowledge {
  kTracking,   ///< at one place
  kAmbiguous,  ///< at one of several, or anywhere in a wide area
  kLost,       ///< nothing is known; a search is under way
};

/// What the chair is and has: of the model file.
struct Chair {
  LaserError laser;
  RateNoise process;
};

/// Follows a chair in a map.
class Localizer {
 public:
  /// map_from_grid: pose of the grid's lower left corner, in place of its x and y. Equal arguments and scans
  /// give equal results, bit by bit. Throws std::invalid_argument.
  Localizer(const LocalizerSettings& settings, const Chair& chair, std::uint32_t seed,
            const OccupancyGrid& grid, const Pose2D& map_from_grid);
  ~Localizer();
  Localizer(Localizer&&) noexcept;
  Localizer& operator=(Localizer&&) noexcept;

  /// The chair is here: as of the last scan, or of the first one.
  void setPose(const Gaussian& map_from_base);
  /// The chair may be anywhere.
  void forget();
  /// Weighs the next scan though the chair does not move.
  void updateOnce();

  struct Estimate {
    Gaussian map_from_base;  ///< at the scan's stamp
    Knowledge knowledge;
    double fit;        ///< share of readings that the map explains, of the last second or so
    double fit_usual;  ///< of the last minute or so
    int particles;     ///< or places
    double searched;   ///< share of the map, while lost
    bool updated;      ///< this scan was weighed
    bool blind;        ///< this scan has too few readings to go by
  };

  /// Adds a scan, whose mean error has been taken out. start, end: odometry at the first and at the last beam.
  /// Throws std::invalid_argument for what makes no sense, or is not later than the last scan.
  Estimate add(const Scan& scan, const Odometry& start, const Pose2D& end);

  /// For display: particles, or places where it might be.
  std::vector<Weighted> particles() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace kurumaisu
