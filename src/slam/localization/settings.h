// SPDX-License-Identifier: BSD-3-Clause
// Settings of the localiser. They have no defaults: the values are in launch/localization_node.yaml. Names
// that AMCL has mean what they mean there.
#pragma once

#include <string>
#include <vector>

#include "slam/basics/bounded.h"

namespace kurumaisu {

/// Of the readings and of what they say.
struct ReadingSettings {
  int max_beams;       ///< readings weighed of a scan, evenly spread
  double max_range;    ///< readings beyond are not weighed [m]
  double correlation;  ///< of neighbouring readings [-]
  double sigma_hit;  ///< of a reading from its wall, beside equation (4): the map's and the world's share [m]
  double z_hit;      ///< share of readings that belong to a wall
  double z_rand;     ///< share of readings that come from anywhere
  double max_distance;  ///< farthest wall that a reading may belong to [m]
  double power;         ///< exponent of a scan's likelihood [-]: its readings share the map's errors
};

/// Of odometry, where it brings no covariance of its own; squares of deviations, as in AMCL.
struct MotionSettings {
  double alpha1;      ///< turn by turn [rad^2/rad^2]
  double alpha2;      ///< turn by way [rad^2/m^2]
  double alpha3;      ///< way by way [m^2/m^2]
  double alpha4;      ///< way by turn [m^2/rad^2]
  double way_floor;   ///< deviation at least, per update [m]
  double turn_floor;  ///< deviation at least, per update [rad]
};

/// When nobody knows where the chair is.
struct RecoverySettings {
  double alpha_slow;       ///< share of a new scan in the slow mean of the fit
  double alpha_fast;       ///< share of a new scan in the fast mean of the fit
  double lost_fit;         ///< fit below which the pose is doubted [-]
  double lost_drop;        ///< share of the slow mean below which the fast one is doubted [-]
  double found_fit;        ///< fit that the place found must have [-]
  double found_odds;       ///< a place is taken when it is so much likelier than all others together [-]
  double found_way;        ///< way or turn driven before a place is taken, at least [m, and in half radians]
  double power;            ///< exponent of a scan's likelihood between places [-]
  double step;             ///< of the search [m]
  double angle_step;       ///< of the search [rad]
  int positions_per_scan;  ///< of the search, so that no scan waits long
  int places;              ///< kept of the search at most
};

struct LocalizerSettings {
  int min_particles;
  int max_particles;
  double kld_err;           ///< largest error between the true distribution and the particles'
  double kld_z;             ///< upper quantile of the standard normal for the chance that the error is less
  double update_min_d;      ///< the filter runs after so much way [m]
  double update_min_a;      ///< or so much turn [rad]
  double ambiguous_spread;  ///< deviation of the position from which it is called ambiguous [m]
  ReadingSettings reading;
  MotionSettings motion;
  RecoverySettings recovery;
};

/// Every setting by name: the one list for C++, ROS and Python.
std::vector<std::string> localizerSettingNames();

/// Settings from a function that gives the value for a name. Throws std::invalid_argument naming the key that
/// is out of its bounds; what the function throws passes through.
LocalizerSettings makeLocalizerSettings(const ValueOf& value_of);

}  // namespace kurumaisu
