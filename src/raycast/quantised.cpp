// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/quantised.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "raycast/walk.h"

namespace kurumaisu {
namespace {

constexpr double kMostCells = 1e9;
constexpr double kFarthest = 1e9;  // cells

}  // namespace

Quantised::Quantised(const std::vector<Segment>& walls, double resolution) : resolution_(resolution) {
  if (!(resolution > 0) || !std::isfinite(resolution)) {
    throw std::invalid_argument("resolution must be positive, not " + std::to_string(resolution));
  }
  if (walls.empty()) return;
  measure(walls);
  cells_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (const Segment& wall : walls) draw(wall);
}

std::int64_t Quantised::cellOf(double at) const {
  return static_cast<std::int64_t>(std::floor(at / resolution_));
}

void Quantised::measure(const std::vector<Segment>& walls) {
  double far = 0.0;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const Segment& w = walls[i];
    const double sum = std::abs(w.ax) + std::abs(w.ay) + std::abs(w.bx) + std::abs(w.by);
    if (!std::isfinite(sum)) throw std::invalid_argument("wall " + std::to_string(i) + " is not finite");
    far = std::max(far, sum / resolution_);
  }
  if (far > kFarthest) throw std::invalid_argument("walls are more than 1e9 cells away");
  std::int64_t right = left_ = cellOf(walls[0].ax);
  std::int64_t top = bottom_ = cellOf(walls[0].ay);
  for (const Segment& w : walls) {
    left_ = std::min({left_, cellOf(w.ax), cellOf(w.bx)});
    right = std::max({right, cellOf(w.ax), cellOf(w.bx)});
    bottom_ = std::min({bottom_, cellOf(w.ay), cellOf(w.by)});
    top = std::max({top, cellOf(w.ay), cellOf(w.by)});
  }
  width_ = right - left_ + 1;
  height_ = top - bottom_ + 1;
  const double count = static_cast<double>(width_) * static_cast<double>(height_);
  if (count > kMostCells)
    throw std::invalid_argument(std::to_string(count) + " cells are more than 1e9: resolution is too fine");
}

void Quantised::draw(const Segment& wall) {
  const std::int64_t x = cellOf(wall.ax);
  const std::int64_t y = cellOf(wall.ay);
  for (Walk walk(x, y, cellOf(wall.bx) - x, cellOf(wall.by) - y); walk.left > 0; walk.step()) {
    cells_[static_cast<std::size_t>((walk.y - bottom_) * width_ + walk.x - left_)] = true;
  }
}

bool Quantised::occupied(std::int64_t x, std::int64_t y) const {
  if (x < left_ || y < bottom_ || x >= left_ + width_ || y >= bottom_ + height_) return false;
  return cells_[static_cast<std::size_t>((y - bottom_) * width_ + x - left_)];
}

double Quantised::cast(double x, double y, double angle, double range_max) const {
  const double reach = range_max / resolution_;
  if (!(reach > 0 && reach <= kFarthest))
    throw std::invalid_argument("range_max must be positive and finite, not " + std::to_string(range_max));
  if (!(std::abs(x) + std::abs(y) <= kFarthest * resolution_) || !std::isfinite(angle))
    throw std::invalid_argument("a pose is not finite, or more than 1e9 cells away");
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const std::int64_t column = cellOf(x);
  const std::int64_t row = cellOf(y);
  const auto columns = static_cast<std::int64_t>(reach * c);  // truncated
  const auto rows = static_cast<std::int64_t>(reach * s);
  for (Walk walk(column, row, columns, rows); walk.left > 0; walk.step()) {
    if (!occupied(walk.x, walk.y)) continue;
    const double cells = walk.wide > walk.high ? static_cast<double>(walk.x - column) / c
                                               : static_cast<double>(walk.y - row) / s;
    return std::abs(cells) * resolution_;
  }
  return range_max;
}

}  // namespace kurumaisu
