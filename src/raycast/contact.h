// SPDX-License-Identifier: BSD-3-Clause
// Whether outlines touch: Stage's collisions.
#pragma once

#include <vector>

#include "raycast/bodies.h"
#include "raycast/grid.h"
#include "raycast/layers.h"

namespace kurumaisu {

/// Finds solid faces of bodies that touch solid faces of walls or of other bodies.
///
/// Outlines are hollow, heights that only meet overlap, and things of one tree never touch.
class Contact {
 public:
  /// The walls must outlive it.
  explicit Contact(const std::vector<Wall>& walls);

  /// Whether a body touches anything. A solid face that begins below z = 0 is in the ground and always does.
  bool touches(const Bodies& bodies, int body) const;

 private:
  bool touchesWall(const Bodies& bodies, int body) const;
  bool touchesWall(const Segment& line, double low, double high, int tree) const;
  bool freeOfWalls(const Bodies::Cylinder& around) const;
  bool inCell(std::size_t cell, const Segment& line, double low, double high, int tree) const;

  std::vector<Wall> walls_;  ///< the solid ones
  Grid grid_;                ///< over their lines
};

}  // namespace kurumaisu
