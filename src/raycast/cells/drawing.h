// SPDX-License-Identifier: BSD-3-Clause
// Outlines as cells, by Stage's arithmetic: the same cells, to the last bit of a coordinate.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "raycast/bodies.h"

namespace kurumaisu {

/// A model of a body, and where its outline is.
struct Part {
  int parent;   ///< an earlier part, -1: the body's frame
  Pose pose;    ///< in the parent's frame
  double lift;  ///< [m] from the parent's frame to where its children stand
  Pose origin;  ///< of the outline, in the model's frame
};

/// One edge of a closed outline, in the direction in which it is drawn.
struct Edge {
  Segment line;          ///< in the frame of its part's origin
  double z_low, z_high;  ///< [m], both belong to it
  int part;
};

/// Solid outlines that move as one.
struct Outline {
  std::vector<Part> parts;
  std::vector<Edge> edges;
};

struct Cell {
  std::int32_t x, y;
};

/// Squares of cells.
namespace tiles {

constexpr int kBits = 6;
constexpr int kSide = 1 << kBits;  // cells

inline std::uint64_t pair(std::int32_t x, std::int32_t y) {
  return (static_cast<std::uint64_t>(static_cast<std::uint32_t>(y)) << 32U) | static_cast<std::uint32_t>(x);
}
inline std::uint64_t of(const Cell& cell) { return pair(cell.x >> kBits, cell.y >> kBits); }

}  // namespace tiles

/// The cells of an outline that is somewhere.
struct Drawing {
  /// Cells of one part, in one range of heights.
  struct Stroke {
    double z_low, z_high;  ///< [m], both belong to it
    int part;
    std::size_t end;  ///< cells of this stroke end here, those of the next begin
  };

  std::vector<Cell> cells;  ///< some more than once
  std::vector<Stroke> strokes;
  Cell low, high;                    ///< corners of a box around all; low is above high: there are none
  std::vector<std::uint64_t> tiles;  ///< that they are in, sorted
  bool in_ground;                    ///< an edge, drawn or too short for it, begins below z = 0
};

/// An angle [rad] within half a turn, as in Stage: nothing happens to one that is in range.
double normalized(double angle);

/// Draws outlines into cells of one size. An edge within one cell leaves no trace, as in Stage.
class Pencil {
 public:
  /// resolution: edge of a cell [m]. Throws std::invalid_argument unless it is positive.
  explicit Pencil(double resolution);

  /// Makes sure that an outline can be drawn, and all before it; returns its reach [m] from its frame, at most.
  ///
  /// Throws std::invalid_argument, naming what is wrong, for one that is not finite or has too many cells.
  double admit(const Outline& outline);

  /// Makes room for others.
  void dismiss(const Outline& outline) { cells_ -= measure(outline).cells; }

  /// Whether an outline of such a reach [m] is among the cells that can be numbered; NaN is not.
  bool numbered(const Pose& at, double reach) const;

  void draw(const Outline& outline, const Pose& at, Drawing& drawing);

 private:
  struct Frame {
    double x, y, z, heading, cos, sin;
  };
  struct Extent {
    double reach;  ///< [m] from the outline's frame, at most
    double cells;  ///< nearly
  };
  Extent measure(const Outline& outline) const;
  static Frame attached(const Frame& frame, const Pose& pose);
  void draw(const Segment& line, const Frame& frame, Drawing& drawing) const;

  double cells_per_metre_;
  double cells_ = 0;                      ///< of all outlines, nearly
  std::vector<Frame> models_, outlines_;  ///< of the parts
};

}  // namespace kurumaisu
