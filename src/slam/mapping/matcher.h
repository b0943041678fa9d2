// SPDX-License-Identifier: BSD-3-Clause
// Motion from scan to scan: point-to-line matching against the scans of the last metres, odometry as the
// prior.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <deque>
#include <unordered_map>
#include <vector>

#include "slam/basics/scan.h"
#include "slam/mapping/settings.h"

namespace kurumaisu {

/// Follows a chair through its scans. Poses are in a frame of its own, which starts as the odometry's and
/// drifts.
class Matcher {
 public:
  explicit Matcher(const MatchSettings& settings) : settings_(settings) {}

  struct Match {
    Pose2D pose;                 ///< of base
    Eigen::Matrix3d covariance;  ///< of the pose given the last one: x, y [m], heading [rad], in this frame
    bool found;                  ///< in the scan; else odometry alone says where it is
  };

  /// Pose of base at a de-skewed scan; motion: what odometry says of the way since the last scan.
  Match add(const Scan& scan, const Pose2D& motion);

 private:
  using Points = std::vector<Eigen::Vector2d>;
  struct Line {
    Eigen::Vector2d point;
    Eigen::Vector2d normal;  ///< towards the laser that saw it
  };

  /// Lines by the squares they lie in: a search looks at nine of them.
  using Cells = std::unordered_map<std::int64_t, std::vector<Line>>;

  Match align(const Points& points, const Pose2D& start, const Pose2D& motion) const;
  bool linearise(const Points& points, const Pose2D& pose, double reach, Eigen::Matrix3d& information,
                 Eigen::Vector3d& gradient) const;
  const Line* nearest(const Eigen::Vector2d& point, const Eigen::Vector2d& eye, double reach) const;
  static const Line* nearestOf(const Cells& cells, double size, const Eigen::Vector2d& point,
                               const Eigen::Vector2d& eye, double reach);
  void insert(const Scan& scan);
  void rebuild();
  /// Reach of the last rounds, and of the first one [m].
  double leastReach() const { return 3 * settings_.deviation; }
  double farReach() const { return std::fmax(leastReach(), settings_.reach); }

  MatchSettings settings_;
  bool started_ = false;
  Pose2D pose_{0, 0, 0};
  Pose2D key_pose_{0, 0, 0};
  Pose2D base_from_laser_{0, 0, 0};
  std::deque<std::vector<Line>> keys_;
  Cells far_, near_;  ///< the same lines, in squares of the two reaches
};

}  // namespace kurumaisu
