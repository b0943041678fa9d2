// SPDX-License-Identifier: BSD-3-Clause
// A whole configuration of base_node, in small.
#pragma once

#include <string>

#include "parameter_values.h"

namespace parameters {

inline Value branch(double slope, double intercept) {
  Value v;
  v["slope"] = slope;
  v["intercept"] = intercept;
  return v;
}

/// sign: of the steering's intercepts; +1 as printed, -1 corrected.
inline Value law(double sign) {
  Value v;
  v["translation"]["positive"] = branch(1.32402, 0.127906);
  v["translation"]["negative"] = branch(2.07369, -0.108783);
  v["steering"]["positive"] = branch(-0.499211, sign * 0.104181);
  v["steering"]["negative"] = branch(-0.469278, sign * -0.169476);
  return v;
}

inline Value band(double min, double max) {
  Value v;
  v["min"] = min;
  v["max"] = max;
  return v;
}

inline Value input(const char* topic, int priority) {
  Value v;
  v["topic"] = std::string(topic);
  v["priority"] = priority;
  v["timeout"] = 0.25;
  v["allow_several"] = false;
  v["limits"] = std::string("ride");
  return v;
}

inline Value limits() {
  Value v;
  for (const char* key : {"v_forward", "v_reverse", "w", "v_acceleration", "v_deceleration", "v_jerk",
                          "w_acceleration", "w_deceleration", "w_jerk", "lateral_acceleration"}) {
    v[key] = 1.0;
  }
  v["keep_curvature"] = false;
  return v;
}

/// What base.launch loads, in small.
inline Value nodeValues() {
  Value v;
  v["rate"] = 50;
  v["longest_step"] = 0.1;
  v["diagnostic_period"] = 1.0;
  v["master_timeout"] = 5.0;
  v["allowed_hosts"].setSize(0);
  v["inputs"]["joystick"] = input("joy_vel", 200);
  v["inputs"]["navigation"] = input("cmd_vel", 50);
  v["absurd"]["v"] = v["absurd"]["w"] = 10.0;
  v["rest"]["v"] = v["rest"]["w"] = 0.001;
  v["locks"]["dead_man"]["topic"] = std::string("dead_man");
  v["locks"]["dead_man"]["blocks_on"] = false;
  v["locks"]["dead_man"]["priority"] = 255;
  v["locks"]["dead_man"]["timeout"] = 0.3;
  v["locks"]["dead_man"]["from_start"] = true;
  v["estop"]["topic"] = std::string("e_stop");
  v["estop"]["timeout"] = 0.0;
  v["speed_cap"]["topic"] = std::string("speed_cap");
  v["speed_cap"]["timeout"] = 0.5;
  v["speed_cap"]["fallback"] = 1.5;
  v["limits"]["gentle"] = limits();
  v["limits"]["ride"] = limits();
  v["odometry"]["frame"] = std::string("odom");
  v["odometry"]["child_frame"] = std::string("base_link");
  v["odometry"]["publish_tf"] = true;
  for (const char* key : {"forward_per_distance", "forward_per_turn", "lateral_per_distance",
                          "heading_per_distance", "heading_per_turn"}) {
    v["odometry"]["noise"][key] = 0.01;
  }
  v["dac"]["kind"] = std::string("topic");
  v["dac"]["reply_wait"] = 0.01;
  v["dac"]["retry_pause"] = 0.1;
  v["dac"]["priority"] = 20;
  v["dac"]["longest_run"] = 0.05;
  v["dac"]["nice"] = -20;
  v["guard"]["socket"] = std::string("/somewhere");
  v["guard"]["limits"]["silence"] = 0.15;
  v["guard"]["priority"] = 40;
  v["guard"]["what_is_the_guards_own"] = true;
  v["odometry"]["imu"]["use"] = false;
  v["odometry"]["imu"]["axis"] = std::string("tf");
  for (const char* key :
       {"timeout", "variance", "scale_sd", "bias_walk", "bias_limit", "settle", "window", "still"}) {
    v["odometry"]["imu"][key] = 0.01;
  }
  v["model"]["effects"].setSize(0);
  v["model"]["name"] = std::string("MD-100");
  v["model"]["chassis"]["length"] = 1.0;
  v["model"]["voltage_law"] = std::string("published");
  v["model"]["voltage_laws"]["published"] = law(1);
  v["model"]["voltage_laws"]["custom"] = law(-1);
  v["model"]["reference_voltage"] = 2.5;
  v["model"]["voltages"]["knob"] = 1.0;
  v["model"]["voltages"]["reference"] = band(0, 5);
  for (const char* axis : {"translation", "steering"}) {
    v["model"]["voltages"][axis] = band(-2, 2);
    v["model"]["voltages"][axis]["resolution"] = 0.005;
  }
  return v;
}

}  // namespace parameters
