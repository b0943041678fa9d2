// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/field.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace kurumaisu {
namespace {

// Occupancy [%] from which a cell is a wall, and below which it is free: map_server's.
constexpr int kWall = 65;
constexpr int kFree = 20;

using Bytes = std::vector<std::uint8_t>;

enum Kind : std::uint8_t { kOpen, kThin, kThick };

/// Walls of a grid: thick where all of a 3 x 3 block is wall, and what touches such a block.
class Walls {
 public:
  explicit Walls(const OccupancyGrid& grid)
      : width_(grid.width), height_(grid.height), kinds_(grid.cells.size()) {
    for (std::size_t i = 0; i < kinds_.size(); ++i) kinds_[i] = grid.cells[i] >= kWall ? kThin : kOpen;
    for (int y = 1; y + 1 < height_; ++y) {
      for (int x = 1; x + 1 < width_; ++x) {
        if (block(x, y)) thicken(x, y);
      }
    }
  }

  const Bytes& kinds() const { return kinds_; }

 private:
  std::uint8_t& at(int x, int y) { return kinds_[static_cast<std::size_t>(y) * width_ + x]; }

  bool block(int x, int y) {
    if (at(x, y) == kOpen) return false;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (at(x + dx, y + dy) == kOpen) return false;
      }
    }
    return true;
  }

  void thicken(int x, int y) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) at(x + dx, y + dy) = kThick;
    }
  }

  int width_, height_;
  Bytes kinds_;
};

/// Rows up or down to the nearest cell that a test likes, at most limit + 1.
template <typename Test>
Bytes verticalDistance(const Bytes& kinds, int width, int limit, Test&& likes) {
  const auto far = static_cast<std::uint8_t>(limit + 1);
  Bytes rows(kinds.size());
  const std::size_t w = width;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const std::uint8_t above = i < w ? far : rows[i - w];
    rows[i] = likes(kinds[i]) ? 0 : static_cast<std::uint8_t>(std::min<int>(above + 1, far));
  }
  for (std::size_t i = kinds.size() - w; i-- > 0;) {
    rows[i] = static_cast<std::uint8_t>(std::min<int>(rows[i], rows[i + w] + 1));
  }
  return rows;
}

/// Calls visit(cell, squared distance [cells^2]) for every cell within limit of a cell that a test likes.
template <typename Test, typename Visit>
void visitNear(const Bytes& kinds, int width, int limit, Test&& likes, Visit&& visit) {
  const Bytes rows = verticalDistance(kinds, width, limit, likes);
  const int far = (limit + 1) * (limit + 1);
  std::vector<int> squares(width, far);
  for (std::size_t row = 0; row < rows.size(); row += width) {
    bool any = false;
    for (int x = 0; x < width; ++x) {
      const int dy = rows[row + x];
      if (dy > limit) continue;
      if (!any) std::fill(squares.begin(), squares.end(), far);
      any = true;
      const int end = std::min(width - 1, x + limit);
      for (int i = std::max(0, x - limit); i <= end; ++i) {
        squares[i] = std::min(squares[i], (i - x) * (i - x) + dy * dy);
      }
    }
    for (int x = 0; any && x < width; ++x) {
      if (squares[x] < far) visit(row + x, squares[x]);
    }
  }
}

void check(const OccupancyGrid& grid, double reach) {
  const bool sized =
      grid.width > 0 && grid.height > 0 && std::isfinite(grid.resolution) && grid.resolution > 0;
  if (!sized || grid.cells.size() != static_cast<std::size_t>(grid.width) * grid.height) {
    throw std::invalid_argument("a map of " + std::to_string(grid.width) + " x " +
                                std::to_string(grid.height) + " cells of " + std::to_string(grid.resolution) +
                                " m with " + std::to_string(grid.cells.size()) + " values");
  }
  if (reach < grid.resolution || reach > 200 * grid.resolution) {
    throw std::invalid_argument("laser_likelihood_max_dist must be 1 to 200 cells of the map: " +
                                std::to_string(reach / grid.resolution));
  }
}

}  // namespace

Field::Field(const OccupancyGrid& grid, const Pose2D& map_from_grid, double reach)
    : map_from_grid_(map_from_grid),
      width_(grid.width),
      height_(grid.height),
      resolution_(grid.resolution),
      reach_(reach),
      quantum_(reach / (kFar - kSurface)) {
  check(grid, reach);
  solid_ = static_cast<std::uint8_t>(kSurface + std::lround(0.25 * resolution_ / quantum_));
  codes_.assign(grid.cells.size(), kFar);
  free_.resize(grid.cells.size());
  for (std::size_t i = 0; i < grid.cells.size(); ++i) {
    free_[i] = grid.cells[i] >= 0 && grid.cells[i] < kFree;
    free_cells_ += free_[i] ? 1 : 0;
  }
  const Walls walls(grid);
  const Bytes& kinds = walls.kinds();
  const int limit = static_cast<int>(std::ceil(reach / resolution_)) + 1;
  const auto coded = [this](double cells) {
    const long code = kSurface + std::lround(cells * resolution_ / quantum_);
    return static_cast<std::uint8_t>(std::clamp(code, 0L, static_cast<long>(kFar)));
  };
  const auto nearer = [this, &coded](std::size_t i, double cells) {
    codes_[i] = std::min(codes_[i], coded(cells));
  };
  visitNear(
      kinds, width_, limit, [](std::uint8_t k) { return k == kThin; },
      [&](std::size_t i, int square) { nearer(i, std::sqrt(square)); });
  visitNear(
      kinds, width_, limit, [](std::uint8_t k) { return k == kThick; },
      [&](std::size_t i, int square) { nearer(i, square == 0 ? 0 : std::sqrt(square) - 0.5); });
  // Inside of thick walls: the nearest place outside.
  const int depth = static_cast<int>(kSurface * quantum_ / resolution_) + 1;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    wall_cells_ += kinds[i] == kOpen ? 0 : 1;
    if (kinds[i] == kThick) codes_[i] = 0;
  }
  visitNear(
      kinds, width_, depth, [](std::uint8_t k) { return k != kThick; },
      [&](std::size_t i, int square) {
        if (square > 0) codes_[i] = coded(0.5 - std::sqrt(square));
      });
}

bool Field::slope(double x, double y, double& distance, double& along_x, double& along_y) const {
  const double left = x - 0.5;
  const double low = y - 0.5;
  if (!(left >= 0 && low >= 0 && left < width_ - 1 && low < height_ - 1)) return false;
  const auto column = static_cast<std::size_t>(left);
  const auto row = static_cast<std::size_t>(low);
  const double u = left - static_cast<double>(column);
  const double v = low - static_cast<double>(row);
  const std::uint8_t* corner = &codes_[row * width_ + column];
  const double a = corner[0];
  const double b = corner[1];
  const double c = corner[width_];
  const double d = corner[width_ + 1];
  if (a >= kFar && b >= kFar && c >= kFar && d >= kFar) return false;
  distance = quantum_ * ((1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d) - kSurface);
  along_x = quantum_ / resolution_ * ((1 - v) * (b - a) + v * (d - c));
  along_y = quantum_ / resolution_ * ((1 - u) * (c - a) + u * (d - b));
  return true;
}

bool Field::known(float x, float y) const {
  if (!(x >= 0 && y >= 0 && x < static_cast<float>(width_) && y < static_cast<float>(height_))) return false;
  return free_[static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x)] || solid(x, y);
}

}  // namespace kurumaisu
