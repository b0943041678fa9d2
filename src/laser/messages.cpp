// SPDX-License-Identifier: BSD-3-Clause
#include "laser/messages.h"

#include <diagnostic_msgs/KeyValue.h>

namespace kurumaisu::laser {
namespace {

using diagnostic_msgs::DiagnosticStatus;

std::int8_t levelOf(Level level) {
  switch (level) {
    case Level::kOk:
      return DiagnosticStatus::OK;
    case Level::kWarn:
      return DiagnosticStatus::WARN;
    case Level::kError:
      return DiagnosticStatus::ERROR;
    default:
      return DiagnosticStatus::STALE;
  }
}

}  // namespace

sensor_msgs::LaserScan messageOf(const Scan& scan) {
  sensor_msgs::LaserScan message;
  message.angle_min = static_cast<float>(scan.angle_min);
  message.angle_max = static_cast<float>(scan.angle_max);
  message.angle_increment = static_cast<float>(scan.angle_increment);
  message.time_increment = static_cast<float>(scan.time_increment);
  message.scan_time = static_cast<float>(scan.scan_time);
  message.range_min = static_cast<float>(scan.range_min);
  message.range_max = static_cast<float>(scan.range_max);
  message.ranges = scan.ranges;
  message.intensities = scan.intensities;
  return message;
}

void fill(DiagnosticStatus& status, const Diagnosis& diagnosis) {
  status.level = levelOf(diagnosis.level);
  status.message = diagnosis.summary;
  for (const auto& [name, value] : diagnosis.values) {
    diagnostic_msgs::KeyValue item;
    item.key = name;
    item.value = value;
    status.values.push_back(item);
  }
}

LaserConfig configOf(const NodeSettings& settings) {
  LaserConfig config = LaserConfig::__getDefault__();
  const LiveSettings& live = settings.driver.live;
  config.frame_id = settings.frame_id;
  config.time_offset = settings.time_offset;
  config.angle_min = live.angle_min;
  config.angle_max = live.angle_max;
  config.cluster = live.cluster;
  config.skip = live.skip;
  config.publish_intensity = live.intensity;
  return config;
}

LiveSettings liveOf(const LaserConfig& config) {
  return {config.angle_min, config.angle_max, config.cluster, config.skip, config.publish_intensity};
}

}  // namespace kurumaisu::laser
