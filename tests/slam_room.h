// SPDX-License-Identifier: BSD-3-Clause
// A room whose scans are computed here, beam by beam, and its map.
#pragma once

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "slam/basics/pose.h"
#include "slam/mapping/mapper.h"

namespace room {

namespace k = kurumaisu;

struct Wall {
  double x0, y0, x1, y1;
};

/// 10 x 8 m around the origin, with a box and a screen that make no two corners alike.
inline const std::vector<Wall> kWalls{{-5, -4, 5, -4},  {5, -4, 5, 4},  {5, 4, -5, 4},
                                      {-5, 4, -5, -4},  {2, 1, 3, 1},   {3, 1, 3, 2.5},
                                      {3, 2.5, 2, 2.5}, {2, 2.5, 2, 1}, {-5, 1, -3, 1.5}};

inline double rangeAlong(const k::Pose2D& ray) {
  const double c = std::cos(ray.theta);
  const double s = std::sin(ray.theta);
  double nearest = std::numeric_limits<double>::infinity();
  for (const Wall& wall : kWalls) {
    const double ex = wall.x1 - wall.x0;
    const double ey = wall.y1 - wall.y0;
    const double across = c * ey - s * ex;
    if (across == 0) continue;
    const double dx = wall.x0 - ray.x;
    const double dy = wall.y0 - ray.y;
    const double along = (dx * ey - dy * ex) / across;
    const double part = (dx * s - dy * c) / across;
    if (along > 0 && part >= 0 && part <= 1) nearest = std::fmin(nearest, along);
  }
  return nearest;
}

/// A line of cells through each wall, free within, unknown without. Half a metre of margin; the walls lie in
/// the middle of their cells of edge [m].
inline k::OccupancyGrid mapOf(const std::vector<Wall>& walls, double edge) {
  const int width = static_cast<int>(std::lround(11 / edge));
  const int height = static_cast<int>(std::lround(9 / edge));
  k::OccupancyGrid grid{edge,  0,      0,
                        width, height, std::vector<std::int8_t>(static_cast<std::size_t>(width) * height)};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double cx = (x + 0.5) * edge - 5.525;
      const double cy = (y + 0.5) * edge - 4.525;
      grid.cells[static_cast<std::size_t>(y) * width + x] = std::abs(cx) < 5 && std::abs(cy) < 4 ? 0 : -1;
    }
  }
  for (const Wall& wall : walls) {
    const double length = std::hypot(wall.x1 - wall.x0, wall.y1 - wall.y0);
    for (double way = 0; way <= length; way += edge / 4) {
      const int x = static_cast<int>((wall.x0 + (wall.x1 - wall.x0) * way / length + 5.525) / edge);
      const int y = static_cast<int>((wall.y0 + (wall.y1 - wall.y0) * way / length + 4.525) / edge);
      grid.cells[static_cast<std::size_t>(y) * width + x] = 100;
    }
  }
  return grid;
}

constexpr k::Pose2D kMapFromGrid{-5.525, -4.525, 0};

/// An oval through the room, 40 s long; the chair also turns against it for a while.
inline k::Pose2D truth(double t) {
  const double a = 2 * M_PI * t / 40;
  return {-0.5 + 2 * std::cos(a), -1.5 + 1.2 * std::sin(a), a + 0.8 * std::sin(3 * a) + 1.6};
}

const k::Fan kUrg{-2.086214, 0.006135923, 9.765625e-5, 5.6, {0.3, 0.05, 0.1}};
constexpr int kBeams = 682;

/// Every beam from where the laser is at its time; noise: of 3 mm, or none.
inline k::Scan scanAt(double t, const k::Fan& fan, int beams, std::mt19937* noise) {
  k::Scan scan{t, fan, std::vector<float>(beams)};
  std::normal_distribution<double> sigma(0, 0.003);
  for (int i = 0; i < beams; ++i) {
    const k::Pose2D laser = k::compose(truth(t + i * fan.time_increment), fan.base_from_laser);
    const double range =
        rangeAlong({laser.x, laser.y, laser.theta + fan.angle_min + fan.angle_increment * i});
    scan.ranges[i] = range > fan.range_max
                         ? std::numeric_limits<float>::infinity()
                         : static_cast<float>(range + (noise != nullptr ? sigma(*noise) : 0));
  }
  return scan;
}

inline k::Scan scanAt(double t, std::mt19937& noise) { return scanAt(t, kUrg, kBeams, &noise); }

/// Odometry that drives 4 % too far, turns 5 % too little and drifts by -0.01 rad/s, in small steps.
class Wheels {
 public:
  k::Pose2D at(double t) {
    for (; time_ + kStep / 2 < t; time_ += kStep) {
      const k::Pose2D way = k::between(truth(time_), truth(time_ + kStep));
      pose_ = k::compose(pose_, {1.04 * way.x, 1.04 * way.y, 0.95 * way.theta - 0.01 * kStep});
    }
    return pose_;
  }

 private:
  static constexpr double kStep = 1e-3;
  double time_ = 0;
  k::Pose2D pose_{0.7, -0.3, 2.0};
};

}  // namespace room
