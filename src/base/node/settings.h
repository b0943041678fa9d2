// SPDX-License-Identifier: BSD-3-Clause
// What base_node reads: launch/base_node.yaml in its private namespace, the model file in ~model.
#pragma once

#include <string>
#include <vector>

#include "base/drive.h"
#include "base/node/allowed_hosts.h"
#include "base/node/dac_settings.h"
#include "base/node/odometry_settings.h"
#include "params.h"

namespace kurumaisu {

/// Topics as the settings have them, in the order of DriveSettings.
struct BaseTopics {
  std::vector<std::string> inputs;
  std::vector<std::string> locks;
  std::string estop;
  std::string speed_cap;
};

struct BaseSettings {
  std::string law_name;
  DriveSettings drive;
  DacSettings dac;
  BaseTopics topics;
  std::vector<std::string> limit_names;  ///< of DriveSettings::limits
  double rate;                           ///< of voltages and odometry [Hz]
  OdometrySettings odometry;
  KnownEffects effects;            ///< the model file's, as far as they concern odometry
  AllowedHosts allowed_hosts{{}};  ///< beside this computer and the master's
  double diagnostic_period;        ///< [s]
  double master_timeout;  ///< the chair brakes when the ROS master is silent for longer [s]; 0: never
};

/// Throws std::invalid_argument naming parameter and value for anything missing, unknown, mistyped or
/// senseless.
BaseSettings readBaseSettings(Section node);

/// Takes what the model file says of the voltages, with the law that is in use, and its name.
OutletSettings readOutlet(Section& model, std::string& law_name);

/// Takes one set of limits.
Limits readLimits(Section section);

}  // namespace kurumaisu
