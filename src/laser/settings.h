// SPDX-License-Identifier: BSD-3-Clause
// What laser_node reads: its private parameters over launch/laser_node.yaml.
#pragma once

#include <string>
#include <vector>

#include "laser/driver.h"
#include "params.h"

namespace kurumaisu::laser {

struct NodeSettings {
  DriverSettings driver;
  std::string frame_id;
  double time_offset;                 ///< [s] added to every stamp
  double diagnostic_period;           ///< [s]
  double diagnostics_tolerance;       ///< of the rate
  double diagnostics_window_time;     ///< [s]
  std::vector<std::string> warnings;  ///< of parameters that were understood but not obeyed; code first
};

/// Reads what is given over what is shipped; name: the node's, for messages. Throws std::invalid_argument
/// naming parameter and value for anything unknown, mistyped, out of range or contradictory.
NodeSettings readSettings(const XmlRpc::XmlRpcValue& shipped, const XmlRpc::XmlRpcValue& given,
                          const std::string& name);

/// Throws std::invalid_argument for a window that no sensor has; what this one has, only the driver knows.
void validate(const LiveSettings& live);

/// A frame's name without a leading slash, which tf2 would refuse. Throws std::invalid_argument for none.
std::string frame(const std::string& frame_id);

/// The number. Throws std::invalid_argument naming the key for one that is not finite.
double finite(const std::string& key, double value);

}  // namespace kurumaisu::laser
