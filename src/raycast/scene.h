// SPDX-License-Identifier: BSD-3-Clause
// Exact ray casting against line segments.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "model/unicycle.h"
#include "raycast/grid.h"
#include "raycast/ray.h"
#include "raycast/witnesses.h"

namespace kurumaisu {

/// What a ray meets first.
struct Hit {
  double range;          ///< from the origin [m]; +inf: nothing within the maximum
  std::int32_t segment;  ///< index of the segment; -1: nothing
};

/// Immutable set of line segments that answers rays exactly, in double precision.
///
/// Segments that share an end point (the same two doubles) leave no gap between them. A ray along a segment
/// meets its nearer end; a ray that starts on a segment has range 0.
class Scene {
 public:
  /// Throws std::invalid_argument naming the first segment that is not finite.
  explicit Scene(std::vector<Segment> segments);

  /// First segment met by the ray from x, y [m] along angle [rad], at most max_range [m] away.
  ///
  /// max_range may be +inf. A ray that is not finite meets nothing.
  Hit cast(double x, double y, double angle, double max_range) const;

  Hit cast(const Ray& ray, double max_range) const;

  /// Ranges [m] of n beams: beam i leaves pose i (or pose 0 if there is only one) at its theta + bearings[i].
  ///
  /// Beams with poses of their own see the world as a laser does that moves during its scan.
  void cast(const Pose2D* poses, bool one_pose, const double* bearings, std::size_t n, double max_range,
            double* ranges) const;

  /// What n beams of a fan meet: beam i leaves the origin at its theta + first + i * increment [rad].
  void castFan(const Pose2D& origin, double first, double increment, std::size_t n, double max_range,
               Hit* hits) const;

  const Segment& segment(std::int32_t index) const { return segments_[static_cast<std::size_t>(index)]; }

  /// See findWitnesses; throws std::bad_optional_access if there are too many.
  const std::vector<Point>& witnesses() const { return witnesses_.value(); }

  std::size_t size() const { return segments_.size(); }

 private:
  std::vector<Segment> segments_;
  Grid grid_;
  std::optional<std::vector<Point>> witnesses_;
};

}  // namespace kurumaisu
