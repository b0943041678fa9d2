// SPDX-License-Identifier: BSD-3-Clause
// Maps in files: MRPT's simplemap, which mapping can go on from, and map_server's pair. No MRPT in this header.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "slam/basics/occupancy.h"
#include "slam/basics/scan.h"
#include "slam/mapping/settings.h"

namespace kurumaisu {

/// A scan of which a map is made, moved to its first beam, and where it was taken.
struct KeyScan {
  Pose2D map_from_base;
  std::array<double, 9> covariance;  ///< x, y [m], heading [rad], row by row
  Scan scan;
};

/// What mapping goes on from.
struct SavedMap {
  OccupancyGrid grid;
  std::vector<KeyScan> keys;  ///< of which the grid is made; none where nobody knows
};

/// Writes MRPT's simplemap: whole, or not at all. Throws std::runtime_error naming the file.
void writeSimplemap(const std::string& path, const std::vector<KeyScan>& keys);

/// Reads a simplemap with at least one scan of a level laser. Throws std::runtime_error naming the file.
std::vector<KeyScan> readSimplemap(const std::string& path);

/// The map that the scans make. Throws std::invalid_argument where it is larger than most_cells.
SavedMap savedMapOf(std::vector<KeyScan> keys, const MapperSettings& settings);

/// Writes path.pgm and path.yaml for map_server: whole, or not at all. Throws std::runtime_error naming the file, or
/// for a map without cells.
void writeMapPair(const std::string& path, const OccupancyGrid& grid);

}  // namespace kurumaisu
