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

/// Range [m] on the line through two readings: along it 1 / range is linear for small angles. part: 0 at a, 1 at b.
double onLine(const Moved& a, const Moved& b, double part) {
  return 1.0 / ((1 - part) / a.range + part / b.range);
}

void setNearer(float& range, double value) {
  if (!(range <= value)) range = static_cast<float>(value);
}

/// Sets the ray nearest to a moved reading, unless a nearer surface has it. other: a reading of its surface, or null.
void setNearest(std::vector<float>& ranges, const Moved& reading, const Moved* other) {
  const double ray = std::nearbyint(reading.beam);
  if (ray < 0 || ray >= static_cast<double>(ranges.size())) return;
  const double apart = other != nullptr ? reading.beam - other->beam : 0;
  const bool slopes = std::abs(apart) > kRounding;
  setNearer(ranges[static_cast<std::size_t>(ray)],
            slopes ? onLine(*other, reading, (ray - other->beam) / apart) : reading.range);
}

/// Sets the rays between two moved readings of one surface.
void setBetween(std::vector<float>& ranges, const Moved& a, const Moved& b) {
  const Moved& first = a.beam < b.beam ? a : b;
  const Moved& last = a.beam < b.beam ? b : a;
  const int end =
      static_cast<int>(std::fmin(std::floor(last.beam + kRounding), static_cast<double>(ranges.size()) - 1));
  for (int ray = static_cast<int>(std::fmax(0.0, std::ceil(first.beam - kRounding))); ray <= end; ++ray) {
    const double part =
        last.beam > first.beam ? std::clamp((ray - first.beam) / (last.beam - first.beam), 0.0, 1.0) : 0.0;
    setNearer(ranges[ray], onLine(first, last, part));
  }
}

bool sameSurface(double a, double b) {
  return std::isfinite(a) && std::isfinite(b) && std::abs(a - b) <= kSameSurface * std::fmin(a, b);
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

Scan withoutDropouts(Scan scan, int most) {
  auto& ranges = scan.ranges;
  const auto nothing = [&scan](float range) { return std::isinf(range) || range > scan.fan.range_max; };
  for (auto at = ranges.begin(); at != ranges.end();) {
    const auto first = std::find_if(at, ranges.end(), nothing);
    at = std::find_if_not(first, ranges.end(), nothing);
    if (at - first <= most) std::fill(first, at, kNothing);
  }
  return scan;
}

Scan deskew(const Scan& scan, const Pose2D& motion) {
  const Fan& fan = scan.fan;
  const std::size_t n = scan.ranges.size();
  Scan out{scan.stamp, fan, std::vector<float>(n, kNothing)};
  Moved last{0, std::nan("")};  // that met something
  std::size_t last_beam = n;
  for (std::size_t i = 0; i < n; ++i) {
    double range = scan.ranges[i];
    if (range > fan.range_max) range = std::numeric_limits<double>::infinity();
    if (!(range > 0)) continue;
    const Pose2D moved_base = part(motion, static_cast<double>(i) / static_cast<double>(n - 1));
    const Pose2D laser_motion = between(fan.base_from_laser, compose(moved_base, fan.base_from_laser));
    const double bearing = fan.angle_min + fan.angle_increment * static_cast<double>(i);
    const Moved reading = move(fan, bearing, range, laser_motion);
    const bool same = sameSurface(last.range, reading.range);
    if (same && i == last_beam + 1) {
      setBetween(out.ranges, last, reading);
    } else {
      setNearest(out.ranges, reading, same ? &last : nullptr);
    }
    if (!std::isfinite(range)) continue;
    last = reading;
    last_beam = i;
  }
  out.fan.time_increment = 0;
  return out;
}

}  // namespace kurumaisu
