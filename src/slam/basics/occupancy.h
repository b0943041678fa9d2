// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

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

/// Walls (100) are what is more likely occupied than a share [-], the rest of what was seen is free (0).
inline OccupancyGrid decided(OccupancyGrid grid, double share) {
  for (std::int8_t& cell : grid.cells) {
    if (cell >= 0) cell = cell > 100 * share ? 100 : 0;
  }
  return grid;
}

}  // namespace kurumaisu
