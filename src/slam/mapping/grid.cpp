// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kurumaisu {
namespace {

using mrpt::maps::COccupancyGridMap2D;

/// MRPT stores log-odds of being free; 0 = nothing is known, and no reading leaves a cell there for long.
bool seen(COccupancyGridMap2D::cellType cell) { return cell != 0; }

struct Box {
  int x0 = std::numeric_limits<int>::max();
  int y0 = std::numeric_limits<int>::max();
  int x1 = -1;
  int y1 = -1;
};

Box seenBox(const COccupancyGridMap2D& grid) {
  Box box;
  for (int y = 0; y < static_cast<int>(grid.getSizeY()); ++y) {
    const auto* row = grid.getRow(y);
    for (int x = 0; x < static_cast<int>(grid.getSizeX()); ++x) {
      if (!seen(row[x])) continue;
      box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x), std::max(box.y1, y)};
    }
  }
  return box;
}

}  // namespace

OccupancyGrid occupancyOf(const COccupancyGridMap2D& grid) {
  // The file says 0.05, MRPT's float 0.0500000007: over 1000 cells that is a hundredth of a cell, but maps
  // are compared by people and by their YAML.
  const double resolution = std::nearbyint(static_cast<double>(grid.getResolution()) * 1e6) / 1e6;
  const Box box = seenBox(grid);
  if (box.x1 < 0) return {resolution, 0, 0, 0, 0, {}};
  const double first_x = std::nearbyint(static_cast<double>(grid.getXMin()) / resolution);
  const double first_y = std::nearbyint(static_cast<double>(grid.getYMin()) / resolution);
  OccupancyGrid out{resolution,
                    (first_x + box.x0) * resolution,
                    (first_y + box.y0) * resolution,
                    box.x1 - box.x0 + 1,
                    box.y1 - box.y0 + 1,
                    {}};
  out.cells.reserve(static_cast<std::size_t>(out.width) * out.height);
  for (int y = box.y0; y <= box.y1; ++y) {
    const auto* row = grid.getRow(y);
    for (int x = box.x0; x <= box.x1; ++x) {
      const float occupied = 100 * (1 - COccupancyGridMap2D::l2p(row[x]));
      out.cells.push_back(seen(row[x]) ? static_cast<std::int8_t>(std::lround(occupied)) : std::int8_t{-1});
    }
  }
  return out;
}

}  // namespace kurumaisu
