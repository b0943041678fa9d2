// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

namespace kurumaisu {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

constexpr double kOnWall = 1e-12;  // [m] rounding may put a wall that the origin is on this far behind it

struct Ray {
  double x, y;    // origin [m]
  double dx, dy;  // unit direction
};

/// Distance along the ray to a segment that lies on the ray's line; +inf: behind the origin.
double rangeAlong(const Ray& ray, const Segment& s) {
  const double a = (s.ax - ray.x) * ray.dx + (s.ay - ray.y) * ray.dy;
  const double b = (s.bx - ray.x) * ray.dx + (s.by - ray.y) * ray.dy;
  if (std::max(a, b) < 0) return kInfinity;
  return std::max(std::min(a, b), 0.0);
}

/// Distance along the ray to a segment; +inf: the ray misses it.
///
/// The test is on which side of the ray each end lies. Neighbours compute the side of a shared end from the
/// same numbers, so a ray cannot slip between them.
double rangeTo(const Ray& ray, const Segment& s) {
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

std::vector<Segment> checked(std::vector<Segment> segments) {
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Segment& s = segments[i];
    if (!std::isfinite(s.ax) || !std::isfinite(s.ay) || !std::isfinite(s.bx) || !std::isfinite(s.by)) {
      throw std::invalid_argument("segment " + std::to_string(i) + " is not finite");
    }
  }
  return segments;
}

/// One axis of the walk over the cells.
struct Axis {
  double origin;   // of the ray, in cells
  double inverse;  // cells per cell along the ray; +-inf when the ray is parallel to the other axis
  int step;        // -1, 0 or +1
  int count;       // of cells
  int at;          // cell reached

  /// Distance [cells] at which the ray leaves the cells up to `reach` around the present one.
  double leaves(int reach) const {
    if (step == 0) return kInfinity;
    return (at + (step > 0 ? reach + 1 : -reach) - origin) * inverse;
  }

  /// Cell at a distance along the ray, kept within `reach` of the present one.
  int cellAt(double distance, double direction, int reach) const {
    const int cell =
        static_cast<int>(origin + distance * direction);  // truncates; never below -1 within the box
    return std::min(std::max(cell, at - reach), at + reach);
  }

  bool inside() const { return at >= 0 && at < count; }
};

Axis makeAxis(double origin, double direction, int count) {
  return {origin, 1.0 / direction, (direction > 0) - (direction < 0), count, 0};
}

/// Narrows [enter, leave] to where the ray is between 0 and the axis' end.
void clip(const Axis& axis, double& enter, double& leave) {
  if (axis.step == 0) {
    if (axis.origin < 0 || axis.origin > axis.count) leave = -kInfinity;
    return;
  }
  const double t0 = -axis.origin * axis.inverse;
  const double t1 = (axis.count - axis.origin) * axis.inverse;
  enter = std::max(enter, std::min(t0, t1));
  leave = std::min(leave, std::max(t0, t1));
}

}  // namespace

Scene::Scene(std::vector<Segment> segments) : segments_(checked(std::move(segments))), grid_(segments_) {}

Hit Scene::cast(double x, double y, double angle, double max_range) const {
  const Hit none{kInfinity, -1};
  if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(angle)) return none;
  const Ray ray{x, y, std::cos(angle), std::sin(angle)};
  const double cell = grid_.cell();
  Axis u = makeAxis((x - grid_.left()) / cell, ray.dx, grid_.width());
  Axis v = makeAxis((y - grid_.bottom()) / cell, ray.dy, grid_.height());
  double at = 0.0;  // distance walked [cells]
  double leave = max_range / cell;
  clip(u, at, leave);
  clip(v, at, leave);
  constexpr double kSlack = 1e-9;  // [cells] a ray along the border of the box still enters it
  if (!(at <= leave + kSlack)) return none;
  u.at = static_cast<int>(std::clamp(std::floor(u.origin + at * ray.dx), 0.0, u.count - 1.0));
  v.at = static_cast<int>(std::clamp(std::floor(v.origin + at * ray.dy), 0.0, v.count - 1.0));

  Hit best{max_range, -1};
  while (u.inside() && v.inside() && at * cell <= best.range + kSlack * cell) {
    const std::size_t index = grid_.index(u.at, v.at);
    for (const std::int32_t* i = grid_.begin(index); i != grid_.end(index); ++i) {
      const double range = rangeTo(ray, segments_[static_cast<std::size_t>(*i)]);
      if (range < best.range || (range == best.range && best.segment < 0)) best = {range, *i};
    }
    const int reach = std::max(0, grid_.clearance(index) - 1);  // all cells within reach are empty
    const double t_u = u.leaves(reach);
    const double t_v = v.leaves(reach);
    if (t_u < t_v) {
      v.at = v.cellAt(t_u, ray.dy, reach);
      u.at += u.step * (reach + 1);
      at = t_u;
    } else {
      u.at = u.cellAt(t_v, ray.dx, reach);
      v.at += v.step * (reach + 1);
      at = t_v;
    }
  }
  return best.segment < 0 ? none : best;
}

void Scene::cast(const Pose2D* poses, bool one_pose, const double* bearings, std::size_t n, double max_range,
                 double* ranges) const {
  for (std::size_t i = 0; i < n; ++i) {
    const Pose2D& pose = poses[one_pose ? 0 : i];
    ranges[i] = cast(pose.x, pose.y, pose.theta + bearings[i], max_range).range;
  }
}

void Scene::castFan(const Pose2D& origin, double first, double increment, std::size_t n, double max_range,
                    Hit* hits) const {
  for (std::size_t i = 0; i < n; ++i) {
    const double bearing = first + static_cast<double>(i) * increment;
    hits[i] = cast(origin.x, origin.y, origin.theta + bearing, max_range);
  }
}

}  // namespace kurumaisu
