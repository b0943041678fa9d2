// SPDX-License-Identifier: BSD-3-Clause
#include "slam/localization/beams.h"

#include <algorithm>
#include <cmath>

#include "slam/basics/pose.h"

namespace kurumaisu {

namespace {

/// Of `count` beams from the first on, the one nearest to their middle that has a reading up to a limit; n if none has.
std::size_t pickOne(const std::vector<float>& ranges, std::size_t first, std::size_t count, double limit) {
  const std::size_t middle = first + count / 2;
  const auto good = [&](std::size_t i) {
    return i >= first && i < std::min(first + count, ranges.size()) && ranges[i] > 0 && ranges[i] <= limit;
  };
  for (std::size_t off = 0; off <= count; ++off) {
    if (good(middle + off)) return middle + off;
    if (off <= middle && good(middle - off)) return middle - off;
  }
  return ranges.size();
}

}  // namespace

double deviationOf(int grade, const ReadingSettings& settings, const LaserError& error) {
  return std::hypot(settings.sigma_hit, error.deviation(settings.max_range * (grade + 1) / kGrades));
}

Beams pick(const Scan& scan, const Pose2D& motion, const ReadingSettings& settings) {
  const Fan& fan = scan.fan;
  const std::size_t n = scan.ranges.size();
  const std::size_t step = std::max<std::size_t>(1, (n + settings.max_beams - 1) / settings.max_beams);
  // Neighbours that correlate by c make a share of (1 - c) / (1 + c) of a long row independent.
  const double correlation = std::pow(settings.correlation, static_cast<double>(step));
  Beams out{fan.base_from_laser, {}, (1 - correlation) / (1 + correlation)};
  const double limit = std::fmin(settings.max_range, fan.range_max);
  for (std::size_t first = 0; first < n; first += step) {
    const std::size_t i = pickOne(scan.ranges, first, step, limit);
    if (i == n) continue;
    const double range = scan.ranges[i];
    const double bearing = fan.angle_min + fan.angle_increment * static_cast<double>(i);
    const Pose2D then = part(motion, static_cast<double>(i) / static_cast<double>(n - 1));
    const Pose2D end = compose(compose(then, fan.base_from_laser),
                               {range * std::cos(bearing), range * std::sin(bearing), 0});
    const int grade = std::min(kGrades - 1, static_cast<int>(kGrades * range / settings.max_range));
    out.beams.push_back({static_cast<float>(end.x), static_cast<float>(end.y), static_cast<float>(range),
                         static_cast<std::uint8_t>(grade)});
  }
  return out;
}

}  // namespace kurumaisu
