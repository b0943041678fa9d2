// SPDX-License-Identifier: BSD-3-Clause
// Drives of a mapper through the room.
#pragma once

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "slam/basics/pose.h"
#include "slam/mapping/mapper.h"
#include "slam_room.h"

namespace room::mapping {

constexpr double kStep = 0.1;  // [s] between scans

struct Moment {
  double t;
  k::Scan scan;
  k::Pose2D start, end;
};
using Mischief = std::function<void(Moment&)>;

/// Drives from a time of the truth on; what the mapper says of every scan.
inline std::vector<k::Mapper::Estimate> drive(k::Mapper& mapper, double from, double to,
                                              const Mischief& mischief = {}) {
  std::mt19937 noise(7);
  room::Wheels wheels;
  std::vector<k::Mapper::Estimate> out;
  for (double t = from; t < to - kStep / 2; t += kStep) {
    Moment moment{t, room::scanAt(t, noise), wheels.at(t), wheels.at(t + room::kUrg.time_increment * 681)};
    if (mischief) mischief(moment);
    out.push_back(mapper.add(moment.scan, moment.start, moment.end));
  }
  return out;
}

inline k::Pose2D mapFromRoom() {
  room::Wheels wheels;
  return k::compose(wheels.at(0), k::between(room::truth(0), {0, 0, 0}));
}

inline double errorAt(const k::Pose2D& map_from_base, double t) {
  const k::Pose2D error = k::between(k::compose(mapFromRoom(), room::truth(t)), map_from_base);
  return std::hypot(error.x, error.y);
}

}  // namespace room::mapping
