// SPDX-License-Identifier: BSD-3-Clause
// What localization_node reads from its parameters: one level, as AMCL's, and the model file below it.
#pragma once

#include <cstdint>
#include <string>

#include "slam/localization/localizer.h"
#include "slam/nodes/mapping_settings.h"

namespace kurumaisu {

struct LocalizationNodeSettings {
  std::string map_frame;
  std::string odom_frame;
  std::string base_frame;
  bool broadcast;              ///< tf map -> odom
  double transform_tolerance;  ///< map -> odom is stamped so far ahead [s]
  double transform_deadline;   ///< a scan waits for its transforms so long at most [s]
  int backlog;                 ///< scans that may wait before the older ones are skipped
  bool map_topic;              ///< the map comes from a topic, not from static_map
  bool first_map_only;
  double cloud_period;  ///< least time between two particle clouds [s]; negative = none
  double save_period;   ///< between two savings of the pose [s]; negative = never
  double silence;       ///< without scans before diagnostics say so [s]
  bool known_start;     ///< the start is that of the parameters; else it may be anywhere
  Gaussian start;
  std::uint32_t seed;
  LocalizerSettings localizer;
  Chair chair;
};

/// base.process_noise among the effects of a model file; the others concern the simulator and the critic.
inline RateNoise readProcessNoise(Section model) {
  RateNoise noise;
  for (Section& effect : model.sections("effects")) {
    if (effect.text("id") == "base.process_noise") noise = readRateNoise(effect.section("parameters"));
  }
  return noise;
}

/// A period [s] of a rate [Hz] as AMCL has it: -1 = never.
inline double periodOf(Section& top, const std::string& key) {
  const double rate = top.number(key);
  if (rate == -1) return -1;
  if (rate > 0) return 1 / rate;
  throw top.error(key, "must be above 0, or -1 for never: " + std::to_string(rate));
}

inline double readVariance(Section& top, const std::string& key) {
  const double value = top.above(key, 0);
  if (value > plausible::kVariance.most)
    throw top.error(key, "must be at most 1e6: " + std::to_string(value));
  return value;
}

inline Gaussian readStart(Section& top) {
  const Pose2D pose{readWithin(top, "initial_pose_x", plausible::kPosition),
                    readWithin(top, "initial_pose_y", plausible::kPosition),
                    readWithin(top, "initial_pose_a", plausible::kAngle)};
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  covariance.diagonal() << readVariance(top, "initial_cov_xx"), readVariance(top, "initial_cov_yy"),
      readVariance(top, "initial_cov_aa");
  return {pose, covariance};
}

/// Reads everything under an absolute name. Throws std::invalid_argument naming the key.
inline LocalizationNodeSettings readLocalizationNodeSettings(const std::string& name) {
  Section top = Section::load(name);
  const Section model = top.section("model");
  LocalizationNodeSettings out{};
  out.map_frame = frameOf(top.text("global_frame_id"));
  out.odom_frame = frameOf(top.text("odom_frame_id"));
  out.base_frame = frameOf(top.text("base_frame_id"));
  out.broadcast = top.flag("tf_broadcast");
  out.transform_tolerance = top.atLeast("transform_tolerance", 0);
  out.transform_deadline = top.above("transform_deadline", 0);
  out.backlog = top.integer("max_backlog", 1);
  out.map_topic = top.flag("use_map_topic");
  out.first_map_only = top.flag("first_map_only");
  out.cloud_period = periodOf(top, "gui_publish_rate");
  out.save_period = periodOf(top, "save_pose_rate");
  out.silence = top.above("laser_check_interval", 0);
  out.known_start = top.flag("set_initial_pose");
  out.start = readStart(top);
  out.seed = static_cast<std::uint32_t>(top.integer("seed", 0));
  out.chair = {readLaserError(model), readProcessNoise(model)};
  out.localizer = readNamed(top, localizerSettingNames(), makeLocalizerSettings);
  top.end();
  return out;
}

}  // namespace kurumaisu
