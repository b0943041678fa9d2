// SPDX-License-Identifier: BSD-3-Clause
#include "contact/walls.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace kurumaisu::contact {

namespace {

std::vector<Segment> segmentsOf(const std::vector<Wall>& walls) {
  std::vector<Segment> segments;
  for (const auto& [edge, tree] : walls) {
    if (!std::isfinite(edge.a.x + edge.a.y + edge.b.x + edge.b.y)) {
      throw std::invalid_argument("a wall is not finite");
    }
    segments.push_back({edge.a.x, edge.a.y, edge.b.x, edge.b.y});
  }
  return segments;
}

/// The row or column of a place, counted from the grid's first; the nearest one of a place outside.
int clampedIndex(double cells, int count) {
  return static_cast<int>(std::clamp(std::floor(cells), 0.0, static_cast<double>(count - 1)));
}

}  // namespace

Walls::Walls(std::vector<Wall> walls) : walls_(std::move(walls)), grid_(segmentsOf(walls_)) {}

std::vector<int> Walls::near(const Circle& circle) const {
  std::vector<int> found;
  const auto [x, y] = circle.centre;
  const auto column = [&](double at) {
    return clampedIndex((at - grid_.left()) / grid_.cell(), grid_.width());
  };
  const auto row = [&](double at) {
    return clampedIndex((at - grid_.bottom()) / grid_.cell(), grid_.height());
  };
  const int last_column = column(x + circle.radius);
  const int last_row = row(y + circle.radius);
  for (int j = row(y - circle.radius); j <= last_row; ++j) {
    for (int i = column(x - circle.radius); i <= last_column;) {
      const std::size_t cell = grid_.index(i, j);
      for (const std::int32_t* member = grid_.begin(cell); member != grid_.end(cell); ++member) {
        const Edge& edge = (*this)[*member].edge;
        const Point point = nearest(circle.centre, edge.a, edge.b);
        if (std::hypot(point.x - x, point.y - y) <= circle.radius) found.push_back(*member);
      }
      i += std::max(grid_.clearance(cell), 1);  // as far as the cells are empty
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

}  // namespace kurumaisu::contact
