// SPDX-License-Identifier: BSD-3-Clause
// How far every place of a map is from the nearest wall.
#pragma once

#include <cstdint>
#include <vector>

#include "model/unicycle.h"
#include "slam/basics/occupancy.h"

namespace kurumaisu {

/// Distances to the surfaces of a map's walls, a byte per cell. They are negative inside of thick walls, and
/// no larger than a reach.
///
/// Where the surface lies in a cell: a thick wall has been drawn, and ends where its cells end; a thin one
/// has been mapped from readings, which fell anywhere in its cells, so it lies in their middle.
class Field {
 public:
  /// map_from_grid: pose of the grid's lower left corner, in place of its x and y. reach: [m], at least a
  /// cell. Throws std::invalid_argument for a grid of senseless size, or cells that are not width * height.
  Field(const OccupancyGrid& grid, const Pose2D& map_from_grid, double reach);

  const Pose2D& mapFromGrid() const { return map_from_grid_; }
  int width() const { return width_; }
  int height() const { return height_; }
  double resolution() const { return resolution_; }
  double reach() const { return reach_; }
  /// Number of cells known to be free, and of walls.
  std::size_t freeCells() const { return free_cells_; }
  std::size_t wallCells() const { return wall_cells_; }

  /// Coded distance at a place of the grid [cells]: an index for tables; reach outside of the grid.
  std::uint8_t code(float x, float y) const {
    // Compared before the conversion, which is undefined for NaN and for what no int can hold.
    if (!(x >= 0 && y >= 0 && x < static_cast<float>(width_) && y < static_cast<float>(height_))) return kFar;
    return codes_[static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x)];
  }
  /// Codes of a row of cells.
  const std::uint8_t* row(int y) const { return &codes_[static_cast<std::size_t>(y) * width_]; }
  /// Distance [m] that a code stands for.
  double distance(std::uint8_t code) const { return (code - kSurface) * quantum_; }

  /// Interpolated distance [m] and its slope [m per m] along the grid's x and y; false where it is unknown.
  bool slope(double x, double y, double& distance, double& along_x, double& along_y) const;

  bool free(int x, int y) const { return free_[static_cast<std::size_t>(y) * width_ + x]; }
  /// Whether a wall covers the cell at a place of the grid [cells].
  bool solid(float x, float y) const { return code(x, y) < solid_; }
  /// Whether anything is known of it.
  bool known(float x, float y) const;

  static constexpr std::uint8_t kFar = 255;

 private:
  static constexpr int kSurface = 51;  // code of distance 0: a fifth of the codes are for the inside

  Pose2D map_from_grid_;
  int width_, height_;
  double resolution_, reach_, quantum_;
  std::uint8_t solid_;  ///< codes below are of walls
  std::size_t free_cells_ = 0, wall_cells_ = 0;
  std::vector<std::uint8_t> codes_;
  std::vector<bool> free_;
};

}  // namespace kurumaisu
