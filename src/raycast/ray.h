// SPDX-License-Identifier: BSD-3-Clause
// One ray against one segment.
#pragma once

#include <algorithm>
#include <cmath>

#include "raycast/grid.h"
#include "raycast/infinity.h"

namespace kurumaisu {

struct Ray {
  double x, y;    ///< origin [m]
  double dx, dy;  ///< unit direction
};

/// On which side of a ray the ends of a segment lie, and how far along it [m].
struct Ends {
  double side_a, side_b;
  double along_a, along_b;
};

inline Ends endsOf(const Ray& ray, const Segment& s) {
  const double ax = s.ax - ray.x;
  const double ay = s.ay - ray.y;
  const double bx = s.bx - ray.x;
  const double by = s.by - ray.y;
  return {ray.dx * ay - ray.dy * ax, ray.dx * by - ray.dy * bx, ray.dx * ax + ray.dy * ay,
          ray.dx * bx + ray.dy * by};
}

/// Distance along the ray [m] to the line of a segment that is not parallel to it.
///
/// The point at side_a / (side_a - side_b) of the way from a to b, projected on the ray.
inline double rangeToLine(const Ends& e) {
  return (e.along_b * e.side_a - e.along_a * e.side_b) / (e.side_a - e.side_b);
}

/// Distance along the ray [m] to a segment; +inf: the ray misses it.
///
/// The test is on which side of the ray each end lies. Neighbours compute the side of a shared end from the
/// same numbers, so a ray cannot slip between them.
inline double rangeTo(const Ray& ray, const Segment& s) {
  constexpr double kOnWall = 1e-12;  // [m] rounding may put a wall that the origin is on this far behind it
  const Ends e = endsOf(ray, s);
  if ((e.side_a > 0 && e.side_b > 0) || (e.side_a < 0 && e.side_b < 0)) return kInfinity;
  if (e.side_a == e.side_b) {  // on one line: the nearer end
    if (std::max(e.along_a, e.along_b) < 0) return kInfinity;
    return std::max(std::min(e.along_a, e.along_b), 0.0);
  }
  const double range = rangeToLine(e);
  return range < -kOnWall ? kInfinity : std::fmax(range, 0.0);
}

}  // namespace kurumaisu
