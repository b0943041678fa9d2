// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>

#include "slam/mapping/settings.h"

namespace room {

namespace k = kurumaisu;

/// As shipped in launch/mapping_node.yaml; written down here, so that tuning that file cannot break a
/// test.
inline std::map<std::string, double> values() {
  return {{"match_iterations", 15},
          {"match_every", 2},
          {"match_reach", 1.0},
          {"match_deviation", 0.02},
          {"match_key_distance", 0.25},
          {"match_key_angle", 0.17},
          {"match_key_scans", 40},
          {"match_prior_distance", 0.2},
          {"match_prior_angle", 0.2},
          {"match_prior_floor", 0.005},
          {"match_prior_angle_floor", 0.005},
          {"jump_speed", 3},
          {"jump_turn", 6},
          {"slip_gain", 0.1},
          {"resolution", 0.05},
          {"range", 25},
          {"dropout_beams", 3},
          {"certainty", 0.6},
          {"most_cells", 1e7},
          {"particles", 10},
          {"localise_distance", 0.25},
          {"localise_angle", 0.1745},
          {"localise_time", 0},
          {"insert_distance", 0.5},
          {"insert_angle", 0.5},
          {"distance_per_distance", 0.002},
          {"distance_per_angle", 0.0004},
          {"angle_per_distance", 0.0008},
          {"angle_per_angle", 0.001},
          {"distance_floor", 0.0004},
          {"angle_floor", 0.0002},
          {"hit_deviation", 0.1},
          {"hit_reach", 0.3},
          {"hit_share", 0.95},
          {"hit_every", 3},
          {"likelihood_power", 0.1},
          {"resample_below", 0.5}};
}

inline k::MapperSettings settings() {
  const auto table = values();
  return k::makeSettings([&table](const std::string& name) { return table.at(name); });
}

}  // namespace room
