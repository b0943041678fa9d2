// SPDX-License-Identifier: BSD-3-Clause
#include "raycast/scene.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "raycast/fan.h"
#include "raycast/infinity.h"
#include "raycast/ray.h"

namespace kurumaisu {
namespace {

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

Scene::Scene(std::vector<Segment> segments)
    : segments_(checked(std::move(segments))),
      grid_(segments_),
      witnesses_(findWitnesses(segments_, grid_)) {}

Hit Scene::cast(double x, double y, double angle, double max_range) const {
  if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(angle)) return {kInfinity, -1};
  return cast(Ray{x, y, std::cos(angle), std::sin(angle)}, max_range);
}

Hit Scene::cast(const Ray& ray, double max_range) const {
  const Hit none{kInfinity, -1};
  const double cell = grid_.cell();
  Axis u = makeAxis((ray.x - grid_.left()) / cell, ray.dx, grid_.width());
  Axis v = makeAxis((ray.y - grid_.bottom()) / cell, ray.dy, grid_.height());
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
    const int clearance = grid_.clearance(index);
    if (clearance == 0) {
      for (const std::int32_t* i = grid_.begin(index); i != grid_.end(index); ++i) {
        const double range = rangeTo(ray, segments_[static_cast<std::size_t>(*i)]);
        if (range < best.range || (range == max_range && best.segment < 0 && range < kInfinity)) {
          best = {range, *i};
        }
      }
    }
    const int reach = std::max(0, clearance - 1);  // all cells within reach are empty
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
  // Beams that are few or far apart seldom meet the same wall, and a witness costs about a hundredth of a ray.
  constexpr double kFarApart = 0.1;     // [rad]
  constexpr double kTooClose = 1e-4;    // [rad] the witnesses' angles are rough
  constexpr double kAlmostATurn = 6.0;  // [rad]
  constexpr std::size_t kWitnessesPerBeam = 64;
  const double step = std::abs(increment);
  const bool finite =
      std::isfinite(origin.x) && std::isfinite(origin.y) && std::isfinite(origin.theta + first);
  if (!finite || !witnesses_ || witnesses_->size() > kWitnessesPerBeam * n ||
      !(step > kTooClose && step < kFarApart)) {
    for (std::size_t i = 0; i < n; ++i) {
      const double bearing = first + static_cast<double>(i) * increment;
      hits[i] = cast(origin.x, origin.y, origin.theta + bearing, max_range);
    }
    return;
  }
  const auto most = static_cast<std::size_t>(kAlmostATurn / step);
  for (std::size_t i = 0; i < n; i += most) {
    const Pose2D part{origin.x, origin.y, origin.theta + (first + static_cast<double>(i) * increment)};
    Fan(*this, part, increment, std::min(most, n - i)).cast(max_range, hits + i);
  }
}

}  // namespace kurumaisu
