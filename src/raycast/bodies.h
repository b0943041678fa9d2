// SPDX-License-Identifier: BSD-3-Clause
// Rigid bodies that move, and which of them are near a place.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "raycast/grid.h"

namespace kurumaisu {

/// Where a body or a sensor is, in the map frame.
struct Pose {
  double x, y, z;  ///< [m]
  double heading;  ///< [rad]
};

/// One upright face of a body or a wall, seen from above.
struct Face {
  Segment line;
  double z_low, z_high;  ///< [m], both belong to it
  double ranger_return;  ///< of a laser's hit; below 0: no ray meets it
  bool solid;            ///< bodies of other trees collide with it
};

/// Things of one tree neither see nor hit each other; a negative number is of no tree.
inline bool related(int tree, int other) { return tree == other && tree >= 0; }

/// Bodies by number, with the cylinders that enclose them in a coarse grid that repeats itself.
class Bodies {
 public:
  struct Body {
    std::vector<Face> faces;      ///< in the body's frame
    std::vector<Segment> placed;  ///< the same lines in the map frame
    double middle_x, middle_y;    ///< of the cylinder, in the body's frame [m]
    double z_low, z_high;         ///< of the cylinder, above the body's frame [m]
    Pose pose;
    bool present;
  };

  /// Encloses a body's faces, in the map frame: all that a search looks at.
  struct Cylinder {
    double x, y, radius;   ///< [m]
    double z_low, z_high;  ///< [m], both belong to it
    int tree;
    int cell;  ///< kWide: not in the grid, kGone: removed
    int next;  ///< body in the same cell, -1: this is the last
  };

  Bodies() : first_(static_cast<std::size_t>(kSide) * kSide, -1) {}

  /// A body in the map's origin, at heading 0; returns its number.
  int add(std::vector<Face> faces, int tree);
  void remove(int body);
  void place(int body, const Pose& pose);

  std::size_t size() const { return bodies_.size(); }  ///< removed ones included
  const Body& operator[](int body) const { return bodies_[static_cast<std::size_t>(body)]; }
  const Cylinder& cylinder(int body) const { return cylinders_[static_cast<std::size_t>(body)]; }

  /// Calls visit(body) for each body whose cylinder comes within `reach` [m] of a place; reach may be +inf.
  template <typename Visit>
  void near(double x, double y, double reach, const Visit& visit) const {
    const double out = reach + widest_;
    const auto visitIfNear = [&](int body) {
      const Cylinder& c = cylinder(body);
      const double distance = reach + c.radius;
      if ((c.x - x) * (c.x - x) + (c.y - y) * (c.y - y) <= distance * distance) visit(body);
    };
    if (2 * out >= (kSide - 1) * kCell) {  // the window would meet itself
      for (std::size_t i = 0; i < cylinders_.size(); ++i)
        if (cylinders_[i].cell != kGone) visitIfNear(static_cast<int>(i));
      return;
    }
    for (const int body : wide_) visitIfNear(body);
    const int last_row = cellOf(y + out);
    const int last_column = cellOf(x + out);
    for (int row = cellOf(y - out); row <= last_row; ++row) {
      for (int column = cellOf(x - out); column <= last_column; ++column) {
        for (int i = first_[slot(column, row)]; i >= 0; i = cylinder(i).next) visitIfNear(i);
      }
    }
  }

 private:
  static constexpr double kCell = 2.0;  // [m] a few robots; a laser's reach is a few cells
  static constexpr int kSide = 64;      // cells, a power of 2; the table fits the first cache
  static constexpr double kWidest =
      4.0;  // [m] radius of bodies in the grid: every search reaches that farther
  static constexpr int kWide = -1;
  static constexpr int kGone = -2;

  static int cellOf(double at) { return static_cast<int>(std::floor(at / kCell)); }
  static std::size_t slot(int column, int row) {
    return static_cast<std::size_t>(row & (kSide - 1)) * kSide +
           static_cast<std::size_t>(column & (kSide - 1));
  }
  void leaveCell(int body);
  void enterCell(int body, int cell);

  std::vector<Body> bodies_;
  std::vector<Cylinder> cylinders_;
  std::vector<int> first_;  ///< body of each cell, -1: none
  std::vector<int> wide_;   ///< bodies too wide for the grid
  double widest_ = 0.0;     ///< radius of a body that was ever in the grid [m]
};

}  // namespace kurumaisu
