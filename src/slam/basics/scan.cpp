// SPDX-License-Identifier: BSD-3-Clause
#include "slam/basics/scan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "slam/basics/pose.h"

namespace kurumaisu {
namespace {

constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

// Neighbouring readings this close to each other [share of the range] lie on one surface and may be
// interpolated. A wall seen at 80 degrees from its normal changes by 3.5 % from beam to beam of 0.35 degrees.
constexpr double kSameSurface = 0.05;
constexpr double kRounding = 1e-6;  // [beams] a reading so near to a ray is on it

/// A reading moved to the time of beam 0: bearing in beams from beam 0, range [m].
struct Moved {
  double beam;
  double range;
};

Moved move(const Fan& fan, double bearing, double range, const Pose2D& laser_motion) {
  const double length = std::isfinite(range) ? range : fan.range_max;
  const Pose2D point = compose(laser_motion, {length * std::cos(bearing), length * std::sin(bearing), 0});
  // Relative to the old bearing, so that a fan reaching past +-pi does not wrap.
  const double turned = wrapAngle(std::atan2(point.y, point.x) - bearing);
  return {(bearing + turned - fan.angle_min) / fan.angle_increment,
          std::isfinite(range) ? std::hypot(point.x, point.y) : range};
}

/// Sets the ray nearest to a moved reading, unless a nearer surface has it.
void setNearest(std::vector<float>& ranges, const Moved& reading) {
  const double ray = std::nearbyint(reading.beam);
  if (ray < 0 || ray >= static_cast<double>(ranges.size())) return;
  float& range = ranges[static_cast<std::size_t>(ray)];
  if (!(range <= reading.range)) range = static_cast<float>(reading.range);
}

/// Sets the rays between two moved readings of one surface: along a line 1 / range is linear for small
/// angles.
void setBetween(std::vector<float>& ranges, const Moved& a, const Moved& b) {
  const Moved& first = a.beam < b.beam ? a : b;
  const Moved& last = a.beam < b.beam ? b : a;
  const int end =
      static_cast<int>(std::fmin(std::floor(last.beam + kRounding), static_cast<double>(ranges.size()) - 1));
  for (int ray = static_cast<int>(std::fmax(0.0, std::ceil(first.beam - kRounding))); ray <= end; ++ray) {
    const double part =
        last.beam > first.beam ? std::clamp((ray - first.beam) / (last.beam - first.beam), 0.0, 1.0) : 0.0;
    const double range = 1.0 / ((1 - part) / first.range + part / last.range);
    if (!(ranges[ray] <= range)) ranges[ray] = static_cast<float>(range);
  }
}

bool sameSurface(const Moved& a, const Moved& b) {
  return std::isfinite(a.range) && std::isfinite(b.range) &&
         std::abs(a.range - b.range) <= kSameSurface * std::fmin(a.range, b.range);
}

}  // namespace

void validate(const Scan& scan) {
  const Fan& fan = scan.fan;
  if (scan.ranges.size() < 2) throw std::invalid_argument("a scan needs at least 2 beams");
  if (!std::isfinite(fan.angle_min) || !std::isfinite(fan.angle_increment) || fan.angle_increment == 0) {
    throw std::invalid_argument("angle_min and angle_increment must be finite and the increment not 0");
  }
  const double width = std::abs(fan.angle_increment) * static_cast<double>(scan.ranges.size() - 1);
  if (width > 2 * M_PI + 1e-3) {
    throw std::invalid_argument("the beams span more than a full turn: " + std::to_string(width) + " rad");
  }
  if (!std::isfinite(fan.time_increment)) throw std::invalid_argument("time_increment must be finite");
  if (!(fan.range_max > 0 && std::isfinite(fan.range_max))) {
    throw std::invalid_argument("range_max must be positive and finite: " + std::to_string(fan.range_max));
  }
}

Scan deskew(const Scan& scan, const Pose2D& motion) {
  const Fan& fan = scan.fan;
  const std::size_t n = scan.ranges.size();
  Scan out{scan.stamp, fan, std::vector<float>(n, kNothing)};
  Moved last{0, 0};
  bool has_last = false;
  for (std::size_t i = 0; i < n; ++i) {
    double range = scan.ranges[i];
    if (range > fan.range_max) range = std::numeric_limits<double>::infinity();
    const bool known = range > 0;
    if (known) {
      const Pose2D moved_base = part(motion, static_cast<double>(i) / static_cast<double>(n - 1));
      const Pose2D laser_motion = between(fan.base_from_laser, compose(moved_base, fan.base_from_laser));
      const double bearing = fan.angle_min + fan.angle_increment * static_cast<double>(i);
      const Moved reading = move(fan, bearing, range, laser_motion);
      if (has_last && sameSurface(last, reading)) {
        setBetween(out.ranges, last, reading);
      } else {
        setNearest(out.ranges, reading);
      }
      last = reading;
    }
    has_last = known;
  }
  out.fan.time_increment = 0;
  return out;
}

}  // namespace kurumaisu
