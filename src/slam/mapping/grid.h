// SPDX-License-Identifier: BSD-3-Clause
// Internal to src/slam.
#pragma once

#include <mrpt/maps/COccupancyGridMap2D.h>

#include "slam/basics/occupancy.h"

namespace kurumaisu {

/// MRPT's grid as occupancy, cut to the rectangle of cells that have been seen.
OccupancyGrid occupancyOf(const mrpt::maps::COccupancyGridMap2D& grid);

}  // namespace kurumaisu
