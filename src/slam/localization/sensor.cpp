// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/sensor.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "slam/basics/pose.h"

namespace kurumaisu {
namespace {

constexpr double kHit = 3;  // deviations up to which a reading belongs to a wall
// What counts against the fit, and how much. Whoever passes by hides walls; nobody makes one transparent, so that tells
// most of a place that only looks alike.
constexpr double kInTheWay = 0.5;
constexpr double kThroughWall = 2;
constexpr double kImpossible =
    0.1;                            // likelihood of a reading through a wall, as a share of one from anywhere
constexpr double kLastStep = 1e-4;  // [m, rad] a step this small is the last

/// Places of base's frame in the grid's cells.
struct Cells {
  Cells(const Field& field, const Pose2D& map_from_base) {
    const Pose2D pose = between(field.mapFromGrid(), map_from_base);
    const double scale = 1 / field.resolution();
    x0 = static_cast<float>(pose.x * scale);
    y0 = static_cast<float>(pose.y * scale);
    c = static_cast<float>(std::cos(pose.theta) * scale);
    s = static_cast<float>(std::sin(pose.theta) * scale);
  }
  float x(float bx, float by) const { return x0 + c * bx - s * by; }
  float y(float bx, float by) const { return y0 + s * bx + c * by; }

  float x0, y0, c, s;
};

}  // namespace

double Fit::share() const {
  const double against = kThroughWall * through + kInTheWay * shorts;
  return hits > 0 ? hits / (hits + against) : 0.0;
}

Sensor::Sensor(const Field& field, const ReadingSettings& settings, const LaserError& error)
    : field_(&field) {
  const double anywhere = settings.z_rand / settings.max_range;
  for (int grade = 0; grade < kGrades; ++grade) {
    const double deviation = deviationOf(grade, settings, error);
    const double peak = settings.z_hit / (std::sqrt(2 * M_PI) * deviation);
    tolerance_[grade] = static_cast<float>(kHit * deviation);
    precision_[grade] = 1 / (deviation * deviation);
    for (int code = 0; code < 256; ++code) {
      const double off = field.distance(static_cast<std::uint8_t>(code)) / deviation;
      const double hit = code == Field::kFar ? 0 : peak * std::exp(-0.5 * off * off);
      // Relative to a reading from anywhere, so that a reading off the map is worth 0.
      table_[grade][code] = static_cast<float>(std::log((hit + anywhere) / anywhere));
    }
  }
  in_the_way_ = 0;
  impossible_ = static_cast<float>(std::log(kImpossible));
}

double Sensor::weigh(const Beams& beams, const Pose2D& map_from_base) const {
  const Cells at(*field_, map_from_base);
  float sum = 0;
  for (const Beam& beam : beams.beams) {
    sum += table_[beam.grade][field_->code(at.x(beam.x, beam.y), at.y(beam.x, beam.y))];
  }
  return beams.independence * static_cast<double>(sum);
}

/// Steps as far as the field says that no wall is near.
Sensor::Ray Sensor::trace(float x0, float y0, float x1, float y1, float tolerance) const {
  const auto scale = static_cast<float>(field_->resolution());
  const float length = std::hypot(x1 - x0, y1 - y0);
  const float end = length - tolerance / scale;
  if (!(length > 0)) return Ray::kClear;
  const float ux = (x1 - x0) / length;
  const float uy = (y1 - y0) / length;
  for (float way = 0; way < end;) {
    const std::uint8_t code = field_->code(x0 + ux * way, y0 + uy * way);
    const auto clear = static_cast<float>(field_->distance(code)) / scale;
    if (field_->solid(x0 + ux * way, y0 + uy * way)) return Ray::kBlocked;
    way += std::fmax(0.5F, clear - 0.75F);
  }
  return field_->known(x1, y1) ? Ray::kClear : Ray::kUnknown;
}

Fit Sensor::look(const Beams& beams, const Pose2D& map_from_base) const {
  const Cells at(*field_, map_from_base);
  const auto& mount = beams.base_from_laser;
  const float x0 = at.x(static_cast<float>(mount.x), static_cast<float>(mount.y));
  const float y0 = at.y(static_cast<float>(mount.x), static_cast<float>(mount.y));
  Fit fit;
  float sum = 0;
  for (const Beam& beam : beams.beams) {
    const float x = at.x(beam.x, beam.y);
    const float y = at.y(beam.x, beam.y);
    const std::uint8_t code = field_->code(x, y);
    const bool near =
        code != Field::kFar && field_->distance(code) < static_cast<double>(tolerance_[beam.grade]);
    const Ray ray = trace(x0, y0, x, y, tolerance_[beam.grade]);
    if (ray == Ray::kBlocked || (!near && (ray == Ray::kUnknown || field_->solid(x, y)))) {
      ++fit.through;
      sum += impossible_;
    } else if (near) {
      ++fit.hits;
      sum += table_[beam.grade][code];
    } else {
      ++fit.shorts;
      sum += in_the_way_;
    }
  }
  fit.log_likelihood = beams.independence * static_cast<double>(sum);
  return fit;
}

Aligned Sensor::align(const Beams& beams, const Pose2D& start, const Eigen::Matrix3d& prior,
                      int rounds) const {
  const Pose2D first = between(field_->mapFromGrid(), start);
  // The prior is of the map's axes, the sums are of the grid's.
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  const double yaw = field_->mapFromGrid().theta;
  turn.topLeftCorner<2, 2>() << std::cos(yaw), -std::sin(yaw), std::sin(yaw), std::cos(yaw);
  const Eigen::Matrix3d known = turn.transpose() * prior * turn;
  Pose2D pose = first;
  Eigen::Matrix3d information = known;
  for (int round = 0; round < rounds; ++round) {
    information = known;
    Eigen::Vector3d gradient =
        known * Eigen::Vector3d(pose.x - first.x, pose.y - first.y, pose.theta - first.theta);
    const double c = std::cos(pose.theta);
    const double s = std::sin(pose.theta);
    const double cell = 1 / field_->resolution();
    for (const Beam& beam : beams.beams) {
      const double ax = c * beam.x - s * beam.y;
      const double ay = s * beam.x + c * beam.y;
      double off = 0;
      double gx = 0;
      double gy = 0;
      if (!field_->slope((pose.x + ax) * cell, (pose.y + ay) * cell, off, gx, gy)) continue;
      const Eigen::Vector3d row(gx, gy, gy * ax - gx * ay);
      // Cauchy's weight: what the map does not have shall not pull.
      const double precision = precision_[beam.grade];
      const double weight = beams.independence * precision / (1 + off * off * precision);
      information += weight * row * row.transpose();
      gradient += weight * off * row;
    }
    const Eigen::Vector3d step = -information.inverse() * gradient;
    if (!step.allFinite()) return {start, prior};
    pose = {pose.x + step(0), pose.y + step(1), pose.theta + step(2)};
    if (step.norm() < kLastStep) break;
  }
  return {compose(field_->mapFromGrid(), pose), turn * information * turn.transpose()};
}

}  // namespace kurumaisu
