// SPDX-License-Identifier: BSD-3-Clause
// Ray casting over cells, as Stage does it: an oracle to compare with, exact to a cell only.
#pragma once

#include <cstdint>
#include <vector>

#include "raycast/grid.h"

namespace kurumaisu {

/// Occupied cells of one size.
///
/// Like Stage's: outlines without the cell of their end, rays that step to one of four neighbours, and ranges
/// that count cells along the axis the ray is nearer to. Unlike it: the same everywhere (Stage truncates cells
/// of rays towards 0, a bias at negative coordinates), and no empty regions are jumped.
class Quantised {
 public:
  /// resolution: edge of a cell [m]. Throws std::invalid_argument for one that is not positive, for walls that
  /// are not finite, and for more than 10^9 cells.
  Quantised(const std::vector<Segment>& walls, double resolution);

  /// Range [m] from x, y [m] along angle [rad]; a miss is range_max [m] exactly.
  double cast(double x, double y, double angle, double range_max) const;

 private:
  std::int64_t cellOf(double at) const;
  bool occupied(std::int64_t x, std::int64_t y) const;
  void measure(const std::vector<Segment>& walls);
  void draw(const Segment& wall);

  double resolution_;
  std::int64_t left_ = 0, bottom_ = 0;   ///< first column and row
  std::int64_t width_ = 0, height_ = 0;  ///< cells
  std::vector<bool> cells_;
};

}  // namespace kurumaisu
