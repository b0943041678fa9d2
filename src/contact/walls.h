// SPDX-License-Identifier: BSD-3-Clause
// Walls in a grid of square cells, to find those near a circle.
#pragma once

#include <cstddef>
#include <vector>

#include "contact/mover.h"

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
  struct Range {
    int first;
    int last;
  };
  Range columns(double low, double high) const;
  Range rows(double low, double high) const;
  template <class Visit>
  void visitCells(const Edge& edge, Visit&& visit) const;
  std::size_t cell(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  std::vector<Wall> walls_;
  Point origin_{0, 0};
  double cell_ = 1;  // [m]
  int columns_ = 0;
  int rows_ = 0;
  std::vector<std::size_t> starts_;  // of each cell's walls in members_
  std::vector<int> members_;
};

}  // namespace kurumaisu::contact
