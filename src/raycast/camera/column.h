// SPDX-License-Identifier: BSD-3-Clause
// What a camera sees in one vertical half-plane through its eye: from top to bottom, without gaps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace kurumaisu {

/// Where the half-plane crosses a wall; heights above the eye [m].
struct Crossing {
  double distance;      ///< horizontal, from the eye [m]
  double low, high;     ///< of the wall
  std::uint32_t color;  ///< four bytes: red, green, blue, alpha
  std::int32_t prism;   ///< the closed outlines that the wall is part of; -1: of none, so that it has no lids
};

/// Part of the view of one surface. Slopes: rise per horizontal distance, up positive.
struct Span {
  float low;       ///< slope of its lower border; -inf for the lowest span
  float distance;  ///< horizontal, of a wall [m]
  float rise;      ///< of a level surface above the eye [m]; 0: a wall
  std::uint32_t color;

  /// Horizontal distance [m] of what is seen along a slope.
  float along(float slope) const { return rise == 0.0F ? distance : rise / slope; }
};

/// Colours of what lies behind all walls.
struct Background {
  std::uint32_t ground;
  std::uint32_t sky;
};

/// Builds columns; keeps its memory between them.
class ColumnPainter {
 public:
  /// Appends to `out` the spans of one half-plane, from the highest to the lowest.
  ///
  /// around: a wall of each prism that the eye is in, over or under; crossings: n of them, sorted by distance;
  /// eye_height: above the ground [m]. The lids (top and bottom faces) of prisms are seen from above or below.
  void paint(const std::vector<Crossing>& around, const Crossing* crossings, std::size_t n, double eye_height,
             const Background& background, std::vector<Span>& out);

 private:
  struct Seen {
    double low, high;
    Span span;
  };
  struct Open {
    Crossing wall;   ///< through which it was entered
    double reached;  ///< up to this distance its lid has been drawn [m]
  };

  void enter(const Crossing& wall);
  void lid(const Crossing& wall, double from, double to);
  void lidsUpTo(double distance);
  void passThrough(const Crossing& crossing);
  void show(double low, double high, const Span& span);

  std::vector<std::pair<double, double>> gaps_;  ///< slopes not yet covered, ascending
  std::vector<std::pair<double, double>> rest_;
  std::vector<Open> open_;  ///< the nearest in height first: its lid hides those of the others
  std::vector<Seen> seen_;
};

}  // namespace kurumaisu
