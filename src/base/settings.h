// SPDX-License-Identifier: BSD-3-Clause
// What base_node reads: launch/base_node.yaml in its private namespace, the model file in ~model.
#pragma once

#include <string>

#include "base/drive.h"
#include "base/odometry_settings.h"
#include "params.h"

namespace kurumaisu {

struct BaseSettings {
  std::string law_name;
  DriveSettings drive;
  double rate;  ///< of voltages and odometry [Hz]
  OdometrySettings odometry;
  KnownEffects effects;      ///< the model file's, as far as they concern odometry
  double diagnostic_period;  ///< [s]
};

/// Throws std::invalid_argument naming parameter and value for anything missing, unknown, mistyped or
/// senseless.
BaseSettings readBaseSettings(Section node);

}  // namespace kurumaisu
