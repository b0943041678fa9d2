// SPDX-License-Identifier: BSD-3-Clause
// Where in a map a chair starts, when that is known about.
#pragma once

#include "slam/basics/gaussian.h"
#include "slam/basics/occupancy.h"
#include "slam/basics/scan.h"
#include "slam/mapping/settings.h"

namespace kurumaisu {

struct Start {
  Gaussian map_from_base;
  double fit;  ///< share of the readings that the map explains
};

/// The place near the believed one from which a de-skewed scan fits the map best. Throws std::invalid_argument for a
/// map without walls, or of senseless size.
Start findStart(const OccupancyGrid& map, const Scan& scan, const Gaussian& believed,
                const MapperSettings& settings);

}  // namespace kurumaisu
