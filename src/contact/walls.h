// SPDX-License-Identifier: BSD-3-Clause
// Walls, and those of them that are near a circle.
#pragma once

#include <cstddef>
#include <vector>

#include "contact/mover.h"
#include "raycast/grid.h"

namespace kurumaisu::contact {

struct Wall {
  Edge edge;  ///< in the map
  int tree;
};

struct Circle {
  Point centre;
  double radius;
};

class Walls {
 public:
  /// Throws std::invalid_argument for a wall that is not finite.
  explicit Walls(std::vector<Wall> walls);

  /// Indices, in rising order, of the walls that a circle touches.
  std::vector<int> near(const Circle& circle) const;
  const Wall& operator[](int index) const { return walls_[static_cast<std::size_t>(index)]; }

 private:
  std::vector<Wall> walls_;
  Grid grid_;
};

}  // namespace kurumaisu::contact
