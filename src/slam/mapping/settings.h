// SPDX-License-Identifier: BSD-3-Clause
// Settings of the mapper. They have no defaults: the values are in launch/mapping_node.yaml.
#pragma once

#include <string>
#include <vector>

#include "slam/basics/bounded.h"

namespace kurumaisu {

/// Of scan matching.
struct MatchSettings {
  int iterations;            ///< at most so many linearisations
  int every;                 ///< every n-th reading is matched
  double reach;              ///< farthest correspondence [m]
  double deviation;          ///< of a point from its line [m]; above it a point counts less
  double key_distance;       ///< a scan joins the local map after so much way [m]
  double key_angle;          ///< or so much turn [rad]
  int key_scans;             ///< scans in the local map
  double prior_distance;     ///< odometry's deviation per way driven [m/m]
  double prior_angle;        ///< odometry's deviation per angle turned [rad/rad]
  double prior_floor;        ///< odometry's deviation at least, per scan [m]
  double prior_angle_floor;  ///< odometry's deviation at least, per scan [rad]
};

struct MapperSettings {
  MatchSettings match;
  double jump_speed;  ///< odometry that goes faster has jumped [m/s]
  double jump_turn;   ///< or turns faster [rad/s]
  double slip_gain;   ///< share of odometry's rate of error, per scan, that is learnt for the next [-]

  double resolution;  ///< of the grid [m]
  double range;       ///< readings beyond are not mapped; beams without a return clear so far [m]
  int dropout_beams;  ///< so many in a row without a return, or fewer, clear nothing
  double certainty;   ///< of one reading for its cell [-], 0.5 to 1
  double most_cells;  ///< of a map; a scan that would make it larger does not go in

  int particles;
  double localise_distance;  ///< the filter runs after so much way [m]
  double localise_angle;     ///< or so much turn [rad]
  double localise_time;      ///< or so much time, at rest as well [s]; 0 = never for time alone
  double insert_distance;    ///< the map grows after so much way [m]
  double insert_angle;       ///< or so much turn [rad]

  double distance_per_distance;  ///< deviation of the matched motion [m/m]
  double distance_per_angle;     ///< [m/rad]
  double angle_per_distance;     ///< [rad/m]
  double angle_per_angle;        ///< [rad/rad]
  double distance_floor;         ///< deviation at least [m]
  double angle_floor;            ///< deviation at least [rad]

  double hit_deviation;     ///< of the likelihood field [m]
  double hit_reach;         ///< farthest wall that a reading may belong to [m]
  double hit_share;         ///< of readings that belong to a wall [-]; the rest is random
  int hit_every;            ///< every n-th reading is weighed
  double likelihood_power;  ///< exponent of the likelihood [-]: readings are not independent
  double resample_below;    ///< share of effective particles [-] below which they are drawn anew
};

/// Every setting by name, as the keys of the settings file have it: the one list for C++, ROS and Python.
std::vector<std::string> settingNames();

/// Settings from a function that gives the value for a name. Throws std::invalid_argument naming the key that
/// is out of its bounds (or is no whole number where one is needed); what the function throws passes through.
MapperSettings makeSettings(const ValueOf& value_of);

}  // namespace kurumaisu
