// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kurumaisu {
namespace {

constexpr double kMargin = 1e-6;  // of a cell's edge; rounding of a walk over the grid is below 1e-10 of it

// Cells per segment, and bounds on their number. Clearances make empty cells nearly free, so many small cells
// with few segments each win: of 16, 64 and 256, 16 was fastest for 4000 pixel edges, and for 130 walls all
// were alike.
constexpr double kCellsPerSegment = 16.0;
constexpr double kFewestCells = 1 << 12;
constexpr double kMostGridCells = 1 << 22;

int clampCell(double position, int count) {
  return static_cast<int>(std::clamp(std::floor(position), 0.0, count - 1.0));
}

/// Calls visit(column, row) for each cell within the margin of the segment, given in units of cells.
template <typename Visit>
void visitCells(const Segment& s, int width, int height, const Visit& visit) {
  const int first = clampCell(std::min(s.ay, s.by) - kMargin, height);
  const int last = clampCell(std::max(s.ay, s.by) + kMargin, height);
  const bool flat = std::abs(s.by - s.ay) < 10 * kMargin;  // its slope would mean nothing
  const double slope = flat ? 0.0 : (s.bx - s.ax) / (s.by - s.ay);
  for (int row = first; row <= last; ++row) {
    double x0 = s.ax;
    double x1 = s.bx;
    if (first != last && !flat) {  // the part of the segment in this row
      const double lo = std::clamp(row - kMargin, std::min(s.ay, s.by), std::max(s.ay, s.by));
      const double hi = std::clamp(row + 1 + kMargin, std::min(s.ay, s.by), std::max(s.ay, s.by));
      x0 = s.ax + (lo - s.ay) * slope;
      x1 = s.ax + (hi - s.ay) * slope;
    }
    const double from = std::max(std::min(x0, x1), std::min(s.ax, s.bx));
    const double to = std::min(std::max(x0, x1), std::max(s.ax, s.bx));
    for (int column = clampCell(from - kMargin, width); column <= clampCell(to + kMargin, width); ++column) {
      visit(column, row);
    }
  }
}

}  // namespace

Grid::Grid(const std::vector<Segment>& segments) {
  measure(segments);
  fill(segments);
  computeClearance();
}

void Grid::measure(const std::vector<Segment>& segments) {
  if (segments.empty()) return;
  double right = -std::numeric_limits<double>::infinity();
  double top = right;
  left_ = bottom_ = -right;
  for (const Segment& s : segments) {
    left_ = std::min({left_, s.ax, s.bx});
    right = std::max({right, s.ax, s.bx});
    bottom_ = std::min({bottom_, s.ay, s.by});
    top = std::max({top, s.ay, s.by});
  }
  const double span = std::max({right - left_, top - bottom_, 1e-3});  // a point still has a box [m]
  const double thin = 1e-3 * span;  // a single straight wall still has an area
  const double area = std::max(right - left_, thin) * std::max(top - bottom_, thin);
  const double cells =
      std::clamp(kCellsPerSegment * static_cast<double>(segments.size()), kFewestCells, kMostGridCells);
  cell_ = std::sqrt(area / cells);
  width_ = std::max(1, static_cast<int>(std::ceil((right - left_) / cell_)));
  height_ = std::max(1, static_cast<int>(std::ceil((top - bottom_) / cell_)));
}

void Grid::fill(const std::vector<Segment>& segments) {
  offsets_.assign(index(width_ - 1, height_ - 1) + 2, 0);
  const auto visitAll = [&](const auto& act) {
    for (std::size_t i = 0; i < segments.size(); ++i) {
      const Segment& s = segments[i];
      const Segment in_cells{(s.ax - left_) / cell_, (s.ay - bottom_) / cell_, (s.bx - left_) / cell_,
                             (s.by - bottom_) / cell_};
      visitCells(in_cells, width_, height_, [&](int column, int row) { act(index(column, row), i); });
    }
  };
  visitAll([&](std::size_t cell, std::size_t) { ++offsets_[cell + 1]; });
  for (std::size_t i = 1; i < offsets_.size(); ++i) offsets_[i] += offsets_[i - 1];
  items_.resize(offsets_.back());
  std::vector<std::uint32_t> next(offsets_.begin(), offsets_.end() - 1);
  visitAll([&](std::size_t cell, std::size_t i) { items_[next[cell]++] = static_cast<std::int32_t>(i); });
}

// Two sweeps over the eight neighbours give the exact chessboard distance.
void Grid::computeClearance() {
  constexpr int kFar = 255;
  clearance_.resize(offsets_.size() - 1);
  for (std::size_t i = 0; i < clearance_.size(); ++i)
    clearance_[i] = offsets_[i] == offsets_[i + 1] ? kFar : 0;
  const auto relax = [&](int column, int row, int other_column, int other_row) {
    if (other_column < 0 || other_column >= width_ || other_row < 0 || other_row >= height_) return;
    const int through = clearance_[index(other_column, other_row)] + 1;
    std::uint8_t& own = clearance_[index(column, row)];
    own = static_cast<std::uint8_t>(std::min<int>(own, through));
  };
  for (int row = 0; row < height_; ++row) {
    for (int column = 0; column < width_; ++column) {
      for (int side = -1; side <= 1; ++side) relax(column, row, column + side, row - 1);
      relax(column, row, column - 1, row);
    }
  }
  for (int row = height_ - 1; row >= 0; --row) {
    for (int column = width_ - 1; column >= 0; --column) {
      for (int side = -1; side <= 1; ++side) relax(column, row, column + side, row + 1);
      relax(column, row, column + 1, row);
    }
  }
}

}  // namespace kurumaisu
