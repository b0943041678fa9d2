// SPDX-License-Identifier: BSD-3-Clause
// Uniform grid over line segments: which segments touch a cell, and how far the nearest occupied cell is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace kurumaisu {

/// Straight wall from a to b, in the map frame [m].
struct Segment {
  double ax, ay, bx, by;
};

/// Cells of equal size over the bounding box of all segments.
///
/// Every cell lists the segments that come within kMargin of it, so that a walk which errs by rounding at the
/// border of two cells still meets every segment on its way.
class Grid {
 public:
  explicit Grid(const std::vector<Segment>& segments);

  int width() const { return width_; }
  int height() const { return height_; }
  double left() const { return left_; }      ///< smallest x [m]
  double bottom() const { return bottom_; }  ///< smallest y [m]
  double cell() const { return cell_; }      ///< edge of a cell [m]

  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(column);
  }

  /// Cells to the nearest occupied cell, diagonal steps counting 1; 0: occupied. At most 255.
  int clearance(std::size_t index) const { return clearance_[index]; }

  /// Segments that touch a cell, as a range of indices.
  const std::int32_t* begin(std::size_t index) const { return items_.data() + offsets_[index]; }
  const std::int32_t* end(std::size_t index) const { return items_.data() + offsets_[index + 1]; }

 private:
  void measure(const std::vector<Segment>& segments);
  void fill(const std::vector<Segment>& segments);
  void computeClearance();

  double left_ = 0.0;
  double bottom_ = 0.0;
  double cell_ = 1.0;
  int width_ = 1;
  int height_ = 1;
  std::vector<std::uint32_t> offsets_;  ///< of each cell into items_, and the total
  std::vector<std::int32_t> items_;
  std::vector<std::uint8_t> clearance_;
};

}  // namespace kurumaisu
