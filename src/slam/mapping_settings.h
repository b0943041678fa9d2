// SPDX-License-Identifier: BSD-3-Clause
// What mapping_node reads from its parameters.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "model_file.h"
#include "slam/settings.h"

namespace kurumaisu {

struct MappingNodeSettings {
  std::string map_frame;
  std::string odom_frame;
  std::string base_frame;
  double map_period;           ///< least time between two maps [s]
  double transform_period;     ///< between two map -> odom [s]
  double transform_tolerance;  ///< map -> odom is stamped so far ahead [s]
  double transform_deadline;   ///< a scan waits for its transforms so long at most [s]
  std::uint32_t seed;
  MapperSettings mapper;
  LaserError laser_error;  ///< of the model file: its mean is taken out of the readings
};

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

/// Reads everything under an absolute name. Throws std::invalid_argument naming the key.
inline MappingNodeSettings readMappingNodeSettings(const std::string& name) {
  Section top = Section::load(name);
  Section node = top.section("node");
  Section mapper = top.section("mapper");
  const LaserError laser_error = readLaserError(top.section("model"));
  top.end();
  MappingNodeSettings settings{node.text("map_frame"),
                               node.text("odom_frame"),
                               node.text("base_frame"),
                               node.above("map_period", 0),
                               node.above("transform_period", 0),
                               node.atLeast("transform_tolerance", 0),
                               node.above("transform_deadline", 0),
                               static_cast<std::uint32_t>(node.integer("seed", 0)),
                               {},
                               laser_error};
  node.end();
  settings.mapper = readNamed(mapper, settingNames(), makeSettings);
  mapper.end();
  return settings;
}

}  // namespace kurumaisu
