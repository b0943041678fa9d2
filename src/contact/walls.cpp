// SPDX-License-Identifier: BSD-3-Clause
#include "contact/walls.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace kurumaisu::contact {

namespace {

constexpr double kCell = 0.25;       // [m] about a small robot's size: few cells to visit, few walls in each
constexpr double kMaxCells = 1.0e6;  // of a wide world, whose cells become larger instead

struct Box {
  Point low{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Point high{-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};

  void add(const Point& p) {
    if (!std::isfinite(p.x) || !std::isfinite(p.y)) throw std::invalid_argument("a wall is not finite");
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
};

int clampedIndex(double value, int count) {
  return static_cast<int>(std::clamp(std::floor(value), 0.0, static_cast<double>(count - 1)));
}

}  // namespace

Walls::Walls(std::vector<Wall> walls) : walls_(std::move(walls)) {
  if (walls_.empty()) return;
  Box box;
  for (const Wall& wall : walls_) {
    box.add(wall.edge.a);
    box.add(wall.edge.b);
  }
  const Point extent{box.high.x - box.low.x, box.high.y - box.low.y};
  origin_ = box.low;
  cell_ =
      std::max({kCell, std::sqrt(extent.x * extent.y / kMaxCells), std::max(extent.x, extent.y) / kMaxCells});
  columns_ = static_cast<int>(extent.x / cell_) + 1;
  rows_ = static_cast<int>(extent.y / cell_) + 1;
  starts_.assign(cell(0, rows_) + 1, 0);
  for (const Wall& wall : walls_) {
    visitCells(wall.edge, [&](std::size_t c) { ++starts_[c + 1]; });
  }
  for (std::size_t c = 1; c < starts_.size(); ++c) starts_[c] += starts_[c - 1];
  members_.resize(starts_.back());
  std::vector<std::size_t> next(starts_.begin(), starts_.end() - 1);
  for (std::size_t i = 0; i < walls_.size(); ++i) {
    visitCells(walls_[i].edge, [&](std::size_t c) { members_[next[c]++] = static_cast<int>(i); });
  }
}

std::vector<int> Walls::near(const Circle& circle) const {
  std::vector<int> found;
  if (walls_.empty()) return found;
  const auto [x, y] = circle.centre;
  const Range across = columns(x - circle.radius, x + circle.radius);
  const Range along = rows(y - circle.radius, y + circle.radius);
  for (int row = along.first; row <= along.last; ++row) {
    for (int column = across.first; column <= across.last; ++column) {
      const std::size_t c = cell(column, row);
      for (std::size_t i = starts_[c]; i < starts_[c + 1]; ++i) {
        const Edge& edge = (*this)[members_[i]].edge;
        const Point point = nearest(circle.centre, edge.a, edge.b);
        if (std::hypot(point.x - x, point.y - y) <= circle.radius) found.push_back(members_[i]);
      }
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

Walls::Range Walls::columns(double low, double high) const {
  return {clampedIndex((low - origin_.x) / cell_, columns_),
          clampedIndex((high - origin_.x) / cell_, columns_)};
}

Walls::Range Walls::rows(double low, double high) const {
  return {clampedIndex((low - origin_.y) / cell_, rows_), clampedIndex((high - origin_.y) / cell_, rows_)};
}

/// Row by row, the columns that the wall crosses between the row's borders, a thousandth of a cell wider.
template <class Visit>
void Walls::visitCells(const Edge& edge, Visit&& visit) const {
  const Point a = edge.a.y <= edge.b.y ? edge.a : edge.b;
  const Point b = edge.a.y <= edge.b.y ? edge.b : edge.a;
  const double margin = 1e-3 * cell_;
  const Range along = rows(a.y - margin, b.y + margin);
  for (int row = along.first; row <= along.last; ++row) {
    const double low = std::clamp(origin_.y + row * cell_ - margin, a.y, b.y);
    const double high = std::clamp(origin_.y + (row + 1) * cell_ + margin, a.y, b.y);
    const double rise = b.y - a.y;
    const double x0 = rise > 0 ? a.x + (low - a.y) / rise * (b.x - a.x) : a.x;
    const double x1 = rise > 0 ? a.x + (high - a.y) / rise * (b.x - a.x) : b.x;
    const Range across = columns(std::min(x0, x1) - margin, std::max(x0, x1) + margin);
    for (int column = across.first; column <= across.last; ++column) visit(cell(column, row));
  }
}

}  // namespace kurumaisu::contact
