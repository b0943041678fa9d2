// SPDX-License-Identifier: BSD-3-Clause
// One ray over cells, by Stage's arithmetic (4.3.0, World::Raytrace): the same cells, the same fractions.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "raycast/cells/drawing.h"

namespace kurumaisu {

/// Squares of cells that a ray jumps over while they are empty.
namespace regions {

constexpr int kBits = 5;
constexpr int kSide = 1 << kBits;  // cells
constexpr std::uint32_t kMask = kSide - 1;

inline std::uint64_t of(const Cell& cell) { return tiles::pair(cell.x >> kBits, cell.y >> kBits); }

}  // namespace regions

/// Steps from cell to cell, or from region to region; a jump leaves it at a fraction of a cell.
///
/// Cells are counted towards 0, unlike those of outlines: below 0 a ray is one cell off, as in Stage.
class CellRay {
 public:
  /// x, y: where it leaves; reach: how far it goes [cells]; direction [rad].
  CellRay(double x, double y, double direction, double reach)
      : x_(x), y_(y), start_x_(x), start_y_(y), sine_(0), cosine_(0), tangent_(0) {
    constexpr double kNearlyAlong = 1e-12;  // [rad] in place of 0, which has no crossings with rows
    if (direction == 0) direction = kNearlyAlong;
    sine_ = std::sin(direction);
    cosine_ = std::cos(direction);
    tangent_ = sine_ / cosine_;
    const double columns = reach * cosine_;
    const double rows = reach * sine_;
    right_ = columns < 0 ? -1 : 1;
    up_ = rows < 0 ? -1 : 1;
    wide_ = static_cast<std::int64_t>(std::abs(columns));
    high_ = static_cast<std::int64_t>(std::abs(rows));
    excess_ = high_ - wide_;
    left_ = wide_ + high_;
  }

  bool ended() const { return left_ <= 0; }

  /// The cell it is in; rounded anew, which steps do not do.
  Cell cell() const { return {static_cast<std::int32_t>(x_), static_cast<std::int32_t>(y_)}; }

  /// How far it is from its start along the axis it is nearer to, as a range [cells].
  double range() const {
    return wide_ > high_ ? std::abs((x_ - start_x_) / cosine_) : std::abs((y_ - start_y_) / sine_);
  }

  /// Goes to one of four neighbours, and moves a cell along.
  void step(Cell& cell) {
    if (excess_ < 0) {
      x_ += right_;
      cell.x += right_;
      excess_ += 2 * high_;
    } else {
      y_ += up_;
      cell.y += up_;
      excess_ -= 2 * wide_;
    }
    --left_;
    aimed_ = false;
  }

  /// Goes to the border of the region it is in.
  void jump() {
    if (!aimed_) aim();
    const bool sideways = side_.distance < level_.distance;
    Border& next = sideways ? side_ : level_;
    Border& other = sideways ? level_ : side_;
    x_ = next.x;
    y_ = next.y;
    left_ = static_cast<std::int64_t>(static_cast<double>(left_) - next.distance);
    other.distance -= next.distance;
    const double along = sideways ? right_ * regions::kSide : up_ * regions::kSide / tangent_;
    const double across = sideways ? right_ * regions::kSide * tangent_ : up_ * regions::kSide;
    next = {next.x + along, next.y + across, std::abs(along) + std::abs(across)};
  }

 private:
  /// Where the ray meets the next border of regions, and how many steps that is.
  struct Border {
    double x, y, distance;
  };

  void aim() {
    const Cell here = cell();
    const double column = (here.x >> regions::kBits) * regions::kSide;
    const double row = (here.y >> regions::kBits) * regions::kSide;
    const double right = right_ < 0 ? column - x_ - 1.0 : column + regions::kSide - x_;
    const double up = up_ < 0 ? row - y_ - 1.0 : row + regions::kSide - y_;
    const double rise = right * tangent_;
    const double shift = up / tangent_;
    side_ = {x_ + right, y_ + rise, std::abs(right) + std::abs(rise)};
    level_ = {x_ + shift, y_ + up, std::abs(shift) + std::abs(up)};
    aimed_ = true;
  }

  double x_, y_;
  double start_x_, start_y_;
  double sine_, cosine_, tangent_;
  std::int32_t right_, up_;   ///< +1 or -1
  std::int64_t wide_, high_;  ///< columns and rows it would cross
  std::int64_t excess_;       ///< negative: the next step is along a row; jumps leave it as it is
  std::int64_t left_;         ///< steps still to go
  bool aimed_ = false;        ///< the borders are those of this place
  Border side_{}, level_{};   ///< of columns, of rows
};

}  // namespace kurumaisu
