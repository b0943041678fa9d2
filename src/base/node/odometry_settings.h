// SPDX-License-Identifier: BSD-3-Clause
// What odometry reads: its section of launch/base_node.yaml, and of the model file the effects.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/odometry/gyro.h"
#include "base/odometry/odometry.h"
#include "params.h"

namespace kurumaisu {

/// What the model file's list `effects` says of odometry's error.
struct KnownEffects {
  std::optional<RateNoise> noise;  ///< base.process_noise, as the critic measured it
  std::vector<std::string>
      unfollowed;  ///< ids of other effects of the base: the chair has them, odometry not
};

/// Takes the list `effects` of the model file. Throws as Section does.
KnownEffects readEffects(Section& model);

/// How a yaw rate is got from sensor_msgs/Imu.
struct ImuSettings {
  enum class Axis { kTf, kUp, kDown };

  GyroSettings gyro;
  Axis axis;  ///< where the sensor's z points to: tf knows its frame, or up, or down
};

struct OdometrySettings {
  OdometryNames names;
  OdometryNoise noise;
  std::optional<ImuSettings> imu;  ///< nothing: open loop
};

/// Reads the section `odometry`. The variances of its noise are assumed; what was measured replaces them. Where the
/// model also has effects that odometry does not follow, both count: the measured noise is what is left once those
/// are taken out.
OdometrySettings readOdometry(Section section, const KnownEffects& known);

}  // namespace kurumaisu
