// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/matcher.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_set>

#include "slam/basics/pose.h"

namespace kurumaisu {
namespace {

// A line is fitted to the readings within this distance of one [m], or within so many of their usual spacings
// at its range where that is more; so many to each side at most. Short enough for door frames, long enough
// that 3 mm of noise turn it by 2 degrees.
constexpr double kLineReach = 0.12;
constexpr double kLineSpacings = 4;
constexpr int kLineReadings = 12;
constexpr int kLinePoints = 4;
// Smaller spread over larger spread of a line's points [-]: above it they are no line.
constexpr double kLineThickness = 0.1;
// One line is kept for each square of this size [m]: readings of the same wall need not be searched twice.
constexpr double kThinning = 0.04;
// Fewer correspondences than this leave the odometry alone.
constexpr int kLeastCorrespondences = 20;
constexpr double kConverged = 1e-5;  // step [m, rad]
constexpr double kSettled = 2e-3;    // step [m, rad] after which nothing far off is left to be caught
constexpr double kShrink = 0.7;      // of the reach, from round to round

std::int64_t keyOf(std::int64_t x, std::int64_t y) { return x * (std::int64_t{1} << 32) + y; }

std::int64_t cellOf(const Eigen::Vector2d& point, double size) {
  const auto x = static_cast<std::int64_t>(std::floor(point.x() / size));
  const auto y = static_cast<std::int64_t>(std::floor(point.y() / size));
  return keyOf(x, y);
}

Eigen::Vector2d apply(const Pose2D& pose, const Eigen::Vector2d& point) {
  const Pose2D moved = compose(pose, {point.x(), point.y(), 0});
  return {moved.x, moved.y};
}

struct Reading {
  int beam;
  double range;
  Eigen::Vector2d point;  ///< in the base's frame
};

/// Those that met something.
std::vector<Reading> readingsOf(const Scan& scan) {
  std::vector<Reading> readings;
  readings.reserve(scan.ranges.size());
  for (int i = 0; i < static_cast<int>(scan.ranges.size()); ++i) {
    const double range = scan.ranges[i];
    if (!std::isfinite(range)) continue;
    const double bearing = scan.fan.angle_min + scan.fan.angle_increment * i;
    readings.push_back(
        {i, range, apply(scan.fan.base_from_laser, {range * std::cos(bearing), range * std::sin(bearing)})});
  }
  return readings;
}

/// The readings around one, itself among them: from the first to before the last.
struct Around {
  Around(const std::vector<Reading>& readings, int centre)
      : first(std::max(0, centre - kLineReadings)),
        last(std::min(static_cast<int>(readings.size()), centre + kLineReadings + 1)) {}
  int first, last;
};

/// From one reading to the next [beams]: the median, so that a doorway among them does not count.
double spacingAround(const std::vector<Reading>& readings, int centre) {
  const Around around(readings, centre);
  std::array<int, std::size_t{2} * kLineReadings> gaps{};
  const int count = around.last - around.first - 1;
  if (count < 1) return 1;
  for (int i = 0; i < count; ++i) {
    gaps[i] = readings[around.first + i + 1].beam - readings[around.first + i].beam;
  }
  std::nth_element(gaps.begin(), gaps.begin() + count / 2, gaps.begin() + count);
  return gaps[count / 2];
}

/// Normal of the line through the readings around one; false where there is none.
bool normalAt(const std::vector<Reading>& readings, int centre, double reach, Eigen::Vector2d& normal) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  int count = 0;
  const Around around(readings, centre);
  for (int i = around.first; i < around.last; ++i) {
    const Eigen::Vector2d offset = readings[i].point - readings[centre].point;
    if (!(offset.squaredNorm() < reach * reach)) continue;
    mean += offset;
    square += offset * offset.transpose();
    ++count;
  }
  if (count < kLinePoints) return false;
  mean /= count;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> spread(square / count - mean * mean.transpose());
  normal = spread.eigenvectors().col(0);
  const double thin = std::sqrt(std::fmax(0.0, spread.eigenvalues()(0)));
  return thin < kLineThickness * std::sqrt(spread.eigenvalues()(1));
}

}  // namespace

Matcher::Match Matcher::add(const Scan& scan, const Pose2D& motion) {
  const Pose2D start = compose(pose_, motion);
  base_from_laser_ = scan.fan.base_from_laser;
  if (!started_) {
    started_ = true;
    pose_ = key_pose_ = start;
    insert(scan);
    return {pose_, Eigen::Matrix3d::Zero(), true};
  }
  Points points;
  const auto readings = readingsOf(scan);
  for (std::size_t i = 0; i < readings.size(); i += settings_.every) points.push_back(readings[i].point);
  Match match = align(points, start, motion);
  pose_ = match.pose;
  const Pose2D since = between(key_pose_, pose_);
  if (std::hypot(since.x, since.y) > settings_.key_distance || std::abs(since.theta) > settings_.key_angle) {
    key_pose_ = pose_;
    insert(scan);
  }
  return match;
}

Matcher::Match Matcher::align(const Points& points, const Pose2D& start, const Pose2D& motion) const {
  const double distance_sd =
      settings_.prior_floor + settings_.prior_distance * std::hypot(motion.x, motion.y);
  const double angle_sd = settings_.prior_angle_floor + settings_.prior_angle * std::abs(motion.theta);
  const Eigen::Vector3d prior(1 / (distance_sd * distance_sd), 1 / (distance_sd * distance_sd),
                              1 / (angle_sd * angle_sd));
  Pose2D pose = start;
  Eigen::Matrix3d information = prior.asDiagonal();
  const double least = leastReach();
  double reach = farReach();
  for (int i = 0; i < settings_.iterations; ++i) {
    Eigen::Vector3d gradient;
    if (!linearise(points, pose, reach, information, gradient)) {
      return {start, prior.cwiseInverse().asDiagonal(), false};
    }
    information += prior.asDiagonal();
    gradient +=
        prior.cwiseProduct(Eigen::Vector3d(pose.x - start.x, pose.y - start.y, pose.theta - start.theta));
    const Eigen::Vector3d step = -information.inverse() * gradient;
    pose = {pose.x + step(0), pose.y + step(1), pose.theta + step(2)};
    if (reach == least && step.norm() < kConverged) break;
    // The first rounds catch an odometry that slipped, the last see true pairs only.
    reach = step.norm() < kSettled ? least : std::fmax(least, kShrink * reach);
  }
  return {pose, information.inverse(), true};
}

bool Matcher::linearise(const Points& points, const Pose2D& pose, double reach, Eigen::Matrix3d& information,
                        Eigen::Vector3d& gradient) const {
  information.setZero();
  gradient.setZero();
  const Pose2D laser = compose(pose, base_from_laser_);
  const Eigen::Vector2d eye(laser.x, laser.y);
  // While far pairs count, they must pull too, or chance pairs hold the scan where it is.
  const double deviation = reach / 3;
  int count = 0;
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d moved = apply(pose, point);
    const Line* line = nearest(moved, eye, reach);
    if (line == nullptr) continue;
    const double error = line->normal.dot(moved - line->point);
    const Eigen::Vector2d arm = moved - Eigen::Vector2d(pose.x, pose.y);
    const Eigen::Vector3d row(line->normal.x(), line->normal.y(),
                              line->normal.y() * arm.x() - line->normal.x() * arm.y());
    // Cauchy's weight: a chair leg or a passer-by shall not pull.
    const double weight = 1 / (deviation * deviation + error * error);
    information += weight * row * row.transpose();
    gradient += weight * error * row;
    ++count;
  }
  return count >= kLeastCorrespondences;
}

const Matcher::Line* Matcher::nearest(const Eigen::Vector2d& point, const Eigen::Vector2d& eye,
                                      double reach) const {
  const Line* near = nearestOf(near_, leastReach(), point, eye, std::fmin(reach, leastReach()));
  if (near != nullptr || reach <= leastReach()) return near;
  return nearestOf(far_, farReach(), point, eye, reach);
}

/// size: of the squares [m], at least reach. A square that begins beyond the best line so far is not looked into.
const Matcher::Line* Matcher::nearestOf(const Cells& cells, double size, const Eigen::Vector2d& point,
                                        const Eigen::Vector2d& eye, double reach) {
  const Line* best = nullptr;
  double best_square = reach * reach;
  const double x = std::floor(point.x() / size);
  const double y = std::floor(point.y() / size);
  const auto gap = [size](double at, double square, int step) {  // [m]
    return step < 0 ? at - square * size : step * ((square + step) * size - at);
  };
  for (const int dx : {0, -1, 1}) {
    const double across = gap(point.x(), x, dx);
    for (const int dy : {0, -1, 1}) {
      const double along = gap(point.y(), y, dy);
      if (across * across + along * along >= best_square) continue;
      const auto cell =
          cells.find(keyOf(static_cast<std::int64_t>(x) + dx, static_cast<std::int64_t>(y) + dy));
      if (cell == cells.end()) continue;
      for (const Line& line : cell->second) {
        const double square = (line.point - point).squaredNorm();
        // A wall has two faces: the one that looks away is not the one seen.
        if (square < best_square && line.normal.dot(eye - point) > 0) {
          best_square = square;
          best = &line;
        }
      }
    }
  }
  return best;
}

void Matcher::insert(const Scan& scan) {
  const auto readings = readingsOf(scan);
  std::vector<Line> lines;
  const Pose2D turn{0, 0, pose_.theta};
  const Eigen::Vector2d eye(base_from_laser_.x, base_from_laser_.y);
  for (int i = 0; i < static_cast<int>(readings.size()); ++i) {
    Eigen::Vector2d normal;
    const auto& [beam, range, point] = readings[i];
    const double spacing = std::abs(scan.fan.angle_increment) * spacingAround(readings, i) * range;
    if (!normalAt(readings, i, std::fmax(kLineReach, kLineSpacings * spacing), normal)) continue;
    if (normal.dot(eye - point) < 0) normal = -normal;
    lines.push_back({apply(pose_, point), apply(turn, normal)});
  }
  keys_.push_back(std::move(lines));
  if (static_cast<int>(keys_.size()) > settings_.key_scans) keys_.pop_front();
  rebuild();
}

void Matcher::rebuild() {
  far_.clear();
  near_.clear();
  std::unordered_set<std::int64_t> taken;
  // Oldest first: what was seen first holds the drift down.
  for (const auto& key : keys_) {
    for (const Line& line : key) {
      if (!taken.insert(cellOf(line.point, kThinning)).second) continue;
      far_[cellOf(line.point, farReach())].push_back(line);
      near_[cellOf(line.point, leastReach())].push_back(line);
    }
  }
}

}  // namespace kurumaisu
