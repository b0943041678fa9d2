// SPDX-License-Identifier: BSD-3-Clause
// How long bodies may move before they touch walls or each other.
#pragma once

#include <utility>
#include <vector>

#include "contact/mover.h"
#include "contact/walls.h"

namespace kurumaisu::contact {

/// Bodies by their outlines. Poses and twists are the caller's.
class Clearance {
 public:
  explicit Clearance(std::vector<Wall> walls) : walls_(std::move(walls)) {}

  /// Returns the body's number; numbers count from 0.
  int add(std::vector<Edge> edges, int tree);
  /// Gives a body other edges. Throws std::out_of_range for an unknown number.
  void replace(int body, std::vector<Edge> edges);

  /// A body at a pose on its way. Throws std::out_of_range for an unknown number.
  Mover mover(int body, const Pose& pose, const Twist& twist, Frame frame) const;

  struct Free {
    std::vector<double> times;               ///< [s] of each mover until it touches something, or limit
    std::vector<std::pair<int, int>> pairs;  ///< movers that could meet, smaller index first, sorted
  };
  /// All movers on their way at once, as if none of them was ever stopped.
  Free free(const std::vector<Mover>& movers, double limit, double distance) const;

  /// First time [s] at which anything new touches among these movers and the walls, or limit.
  double firstTouch(const std::vector<Mover>& movers, const Touch& touch, double limit) const;

  /// Walls within a distance [m] of the movers' circles, in rising order.
  std::vector<int> near(const std::vector<Mover>& movers, double reach) const;

 private:
  double wallTouch(const Mover& mover, const Touch& touch, double limit) const;

  Walls walls_;
  std::vector<Outline> outlines_;
};

}  // namespace kurumaisu::contact
