// SPDX-License-Identifier: BSD-3-Clause
// How large a map would be.
#pragma once

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "slam/basics/occupancy.h"
#include "slam/basics/pose.h"
#include "slam/basics/scan.h"
#include "slam/mapping/settings.h"

namespace kurumaisu {

/// A rectangle around all that scans have seen [m].
struct Extent {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  void add(double x, double y, double around) {
    const bool first = x0 == x1;
    x0 = first ? x - around : std::fmin(x0, x - around);
    y0 = first ? y - around : std::fmin(y0, y - around);
    x1 = first ? x + around : std::fmax(x1, x + around);
    y1 = first ? y + around : std::fmax(y1, y + around);
  }

  /// A circle around base that holds every reading; readings beyond range [m] end there.
  void add(const Pose2D& map_from_base, const Scan& scan, double range) {
    double farthest = 0;
    for (const float reading : scan.ranges) {
      if (reading > 0) farthest = std::fmax(farthest, std::isinf(reading) ? scan.fan.range_max : reading);
    }
    const auto& mount = scan.fan.base_from_laser;
    constexpr double kMargin = 0.5;  // [m]
    add(map_from_base.x, map_from_base.y,
        std::fmin(farthest, range) + std::hypot(mount.x, mount.y) + kMargin);
  }

  void add(const OccupancyGrid& grid) {
    add(grid.x, grid.y, 1e-3);
    add(grid.x + grid.width * grid.resolution, grid.y + grid.height * grid.resolution, 1e-3);
  }

  double cells(double resolution) const { return (x1 - x0) * (y1 - y0) / (resolution * resolution); }

  /// Throws std::invalid_argument when it has more than most_cells.
  void check(const MapperSettings& settings) const {
    if (cells(settings.resolution) <= settings.most_cells) return;
    std::ostringstream text;
    text << "a map of " << x1 - x0 << " x " << y1 - y0 << " m at " << settings.resolution
         << " m has more than most_cells " << settings.most_cells;
    throw std::invalid_argument(text.str());
  }
};

}  // namespace kurumaisu
