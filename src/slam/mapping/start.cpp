// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/start.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "slam/basics/pose.h"
#include "slam/localization/sensor.h"

namespace kurumaisu {
namespace {

constexpr int kStartBeams = 120;     // weighed
constexpr double kWidth = 2.5;       // deviations to each side that are tried
constexpr double kStep = 0.1;        // [m] between places tried
constexpr double kAngleStep = 0.05;  // [rad]
constexpr std::size_t kBest = 8;     // of them are aligned
constexpr int kStartRounds = 10;
constexpr double kFloor = 0.01;  // [m, rad] deviation that is left at least

ReadingSettings readings(const MapperSettings& s) {
  return {kStartBeams,
          s.range,
          0,
          s.resolution,
          s.hit_share,
          1 - s.hit_share,
          std::fmax(s.hit_reach, 2 * s.resolution),
          1};
}

std::vector<double> ticks(double deviation, double step) {
  std::vector<double> out{0};
  const int count = static_cast<int>(kWidth * deviation / step);
  for (int i = 1; i <= count; ++i) out.insert(out.end(), {i * step, -i * step});
  return out;
}

struct Tried {
  Pose2D pose;
  double score;
};

/// The likeliest of a lattice around a pose.
std::vector<Tried> tried(const Sensor& sensor, const Beams& beams, const Gaussian& believed) {
  const auto deviation = believed.covariance.diagonal().cwiseSqrt().eval();
  std::vector<Tried> all;
  for (const double theta : ticks(deviation(2), kAngleStep)) {
    for (const double x : ticks(deviation(0), kStep)) {
      for (const double y : ticks(deviation(1), kStep)) {
        const Pose2D pose{believed.mean.x + x, believed.mean.y + y, believed.mean.theta + theta};
        all.push_back({pose, sensor.weigh(beams, pose)});
      }
    }
  }
  const auto better = [](const Tried& a, const Tried& b) { return a.score > b.score; };
  const auto end = all.begin() + static_cast<std::ptrdiff_t>(std::min(kBest, all.size()));
  std::partial_sort(all.begin(), end, all.end(), better);
  all.erase(end, all.end());
  return all;
}

}  // namespace

Start findStart(const OccupancyGrid& map, const Scan& scan, const Gaussian& believed,
                const MapperSettings& settings) {
  const ReadingSettings reading = readings(settings);
  const Field field(map, {map.x, map.y, 0}, reading.max_distance);
  if (field.wallCells() == 0) throw std::invalid_argument("the map has no walls");
  const Sensor sensor(field, reading, {1, 0, {0, 0, 0}, 0, 0, scan.fan.range_max});
  const Beams beams = pick(scan, {0, 0, 0}, reading);
  const Eigen::Matrix3d prior = believed.covariance.inverse();
  Start best{believed, -1};
  for (const Tried& each : tried(sensor, beams, believed)) {
    const Aligned aligned = sensor.align(beams, each.pose, prior, kStartRounds);
    const double fit = sensor.look(beams, aligned.pose).share();
    if (fit > best.fit) best = {{aligned.pose, aligned.information.inverse()}, fit};
  }
  best.map_from_base.covariance.diagonal().array() += kFloor * kFloor;
  return best;
}

}  // namespace kurumaisu
