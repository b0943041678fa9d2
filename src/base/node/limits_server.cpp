// SPDX-License-Identifier: BSD-3-Clause
#include "base/node/limits_server.h"

#include <ros/console.h>
#include <ros/node_handle.h>

#include <algorithm>
#include <cmath>

namespace kurumaisu {
namespace {

BaseConfig configOf(const Limits& limits) {
  BaseConfig config = BaseConfig::__getDefault__();
  config.v_forward = limits.v_forward;
  config.v_reverse = limits.v_reverse;
  config.w = limits.w;
  config.v_acceleration = limits.v_ramp.acceleration;
  config.v_deceleration = limits.v_ramp.deceleration;
  config.v_jerk = limits.v_ramp.jerk;
  config.w_acceleration = limits.w_ramp.acceleration;
  config.w_deceleration = limits.w_ramp.deceleration;
  config.w_jerk = limits.w_ramp.jerk;
  config.lateral_acceleration = limits.lateral_acceleration;
  config.keep_curvature = limits.keep_curvature;
  return config;
}

Limits limitsOf(const BaseConfig& config) {
  return {config.v_forward,
          config.v_reverse,
          config.w,
          {config.v_acceleration, config.v_deceleration, config.v_jerk},
          {config.w_acceleration, config.w_deceleration, config.w_jerk},
          config.lateral_acceleration,
          config.keep_curvature};
}

/// What the server's bounds let pass: they do not know NaN.
bool finite(const BaseConfig& config) {
  const double numbers[] = {config.v_forward,           config.v_reverse,      config.w,
                            config.v_acceleration,      config.v_deceleration, config.v_jerk,
                            config.w_acceleration,      config.w_deceleration, config.w_jerk,
                            config.lateral_acceleration};
  return std::all_of(std::begin(numbers), std::end(numbers), [](double x) { return std::isfinite(x); });
}

}  // namespace

LimitsServer::LimitsServer(const std::vector<std::string>& names, Drive& drive) : drive_(drive) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    ros::NodeHandle nh("~limits/" + names[i]);
    auto set = std::make_unique<Set>();
    set->server = std::make_unique<dynamic_reconfigure::Server<BaseConfig>>(set->mutex, nh);
    set->server->setConfigDefault(configOf(drive.settings().limits[i]));
    set->server->setCallback(
        [this, i](BaseConfig& wanted, std::uint32_t /*level*/) { reconfigure(i, wanted); });
    sets_.push_back(std::move(set));
  }
}

/// The request's sender sees what holds.
void LimitsServer::reconfigure(std::size_t set, BaseConfig& wanted) {
  if (finite(wanted)) {
    drive_.configure(set, limitsOf(wanted));
  } else {
    ROS_WARN("BASE_BAD_LIMITS: refused: not a number");
    wanted = configOf(drive_.settings().limits[set]);
  }
}

}  // namespace kurumaisu
