// SPDX-License-Identifier: BSD-3-Clause
// Where a ray meets a line segment, exactly.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "raycast/grid.h"

namespace kurumaisu {

struct Ray {
  double x, y;    ///< origin [m]
  double dx, dy;  ///< unit direction
};

constexpr double kOnWall = 1e-12;  // [m] rounding may put a wall that the origin is on this far behind it

/// Distance [m] along the ray to a segment that lies on the ray's line; +inf: behind the origin.
inline double rangeAlong(const Ray& ray, const Segment& s) {
  const double a = (s.ax - ray.x) * ray.dx + (s.ay - ray.y) * ray.dy;
  const double b = (s.bx - ray.x) * ray.dx + (s.by - ray.y) * ray.dy;
  if (std::max(a, b) < 0) return std::numeric_limits<double>::infinity();
  return std::max(std::min(a, b), 0.0);
}

/// Distance [m] along the ray to a segment; +inf: the ray misses it.
///
/// The test is on which side of the ray each end lies. Neighbours compute the side of a shared end from the
/// same numbers, so a ray cannot slip between them.
inline double rangeTo(const Ray& ray, const Segment& s) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double ax = s.ax - ray.x;
  const double ay = s.ay - ray.y;
  const double bx = s.bx - ray.x;
  const double by = s.by - ray.y;
  const double side_a = ray.dx * ay - ray.dy * ax;
  const double side_b = ray.dx * by - ray.dy * bx;
  if ((side_a > 0 && side_b > 0) || (side_a < 0 && side_b < 0)) return kInfinity;
  const double spread = side_a - side_b;
  if (spread == 0) return rangeAlong(ray, s);
  // The point at side_a / spread of the way from a to b, projected on the ray.
  const double along_a = ray.dx * ax + ray.dy * ay;
  const double along_b = ray.dx * bx + ray.dy * by;
  const double range = (along_b * side_a - along_a * side_b) / spread;
  return range < -kOnWall ? kInfinity : std::fmax(range, 0.0);
}

}  // namespace kurumaisu
