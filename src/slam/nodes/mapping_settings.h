// SPDX-License-Identifier: BSD-3-Clause
// What mapping_node reads from its parameters.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "model_file.h"
#include "plausible/quantity.h"
#include "slam/basics/gaussian.h"
#include "slam/mapping/settings.h"

namespace kurumaisu {

struct MappingNodeSettings {
  std::string map_frame;
  std::string odom_frame;
  std::string base_frame;
  double map_period;             ///< least time between two maps [s]
  double transform_period;       ///< between two map -> odom [s]; 0 = none
  double transform_tolerance;    ///< map -> odom is stamped so far ahead [s]
  double transform_deadline;     ///< a scan waits for its transforms so long at most [s]
  int backlog;                   ///< scans that may wait before the older ones are skipped
  int every;                     ///< only every n-th scan is taken
  double silence;                ///< without scans before diagnostics say so [s]
  double occ_thresh;             ///< share above which a cell is published as a wall [-]
  std::string save_on_shutdown;  ///< path without suffix; empty = not saved
  std::string start_map;         ///< simplemap to go on from, or kStaticMap; empty = none
  Gaussian start;                ///< where in it
  std::uint32_t seed;
  MapperSettings mapper;
  LaserError laser_error;  ///< of the model file: its mean is taken out of the readings
};

/// As start_map: the map is that of the service of this name.
constexpr const char* kStaticMap = "static_map";

/// Takes the keys of these names and makes settings of them; make: as makeSettings(). Throws std::invalid_argument
/// naming the section and the key.
template <typename Make>
auto readNamed(Section& section, const std::vector<std::string>& names, const Make& make) {
  std::map<std::string, double> values;
  for (const std::string& key : names) values[key] = section.number(key);
  try {
    return make([&values](const std::string& key) { return values.at(key); });
  } catch (const std::invalid_argument& error) {
    throw section.error("", error.what());
  }
}

inline double readWithin(Section& section, const std::string& key, const Quantity& quantity) {
  return section.within(key, quantity.least, quantity.most);
}

inline Gaussian readStartIn(Section start) {
  Gaussian out{{readWithin(start, "x", plausible::kPosition), readWithin(start, "y", plausible::kPosition),
                readWithin(start, "theta", plausible::kAngle)},
               Eigen::Matrix3d::Zero()};
  const double distance = start.within("deviation", 0.01, 1);
  const double angle = start.within("angle_deviation", 0.01, 0.5);
  start.end();
  out.covariance.diagonal() << distance * distance, distance * distance, angle * angle;
  return out;
}

/// Reads everything under an absolute name. Throws std::invalid_argument naming the key.
inline MappingNodeSettings readMappingNodeSettings(const std::string& name) {
  Section top = Section::load(name);
  Section node = top.section("node");
  Section mapper = top.section("mapper");
  MappingNodeSettings out{};
  out.laser_error = readLaserError(top.section("model"));
  top.end();
  out.map_frame = frameOf(node.text("map_frame"));
  out.odom_frame = frameOf(node.text("odom_frame"));
  out.base_frame = frameOf(node.text("base_frame"));
  out.map_period = node.above("map_period", 0);
  out.transform_period = node.atLeast("transform_period", 0);
  out.transform_tolerance = node.atLeast("transform_tolerance", 0);
  out.transform_deadline = node.above("transform_deadline", 0);
  out.backlog = node.integer("max_backlog", 1);
  out.every = node.integer("throttle_scans", 1);
  out.silence = node.above("laser_check_interval", 0);
  out.occ_thresh = node.within("occ_thresh", 0, 1);
  out.save_on_shutdown = node.textOrNone("save_on_shutdown");
  out.start_map = node.textOrNone("start_map");
  out.start = readStartIn(node.section("start"));
  out.seed = static_cast<std::uint32_t>(node.integer("seed", 0));
  node.end();
  out.mapper = readNamed(mapper, settingNames(), makeSettings);
  mapper.end();
  return out;
}

}  // namespace kurumaisu
