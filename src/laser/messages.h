// SPDX-License-Identifier: BSD-3-Clause
// Between laser_node's messages and what they are about. Included by the node only: it knows ROS.
#pragma once

#include <diagnostic_msgs/DiagnosticStatus.h>
#include <kurumaisu/LaserConfig.h>
#include <sensor_msgs/LaserScan.h>

#include "laser/diagnosis.h"
#include "laser/scan.h"
#include "laser/settings.h"

namespace kurumaisu::laser {

/// The scan without its header.
sensor_msgs::LaserScan messageOf(const Scan& scan);

/// Puts a diagnosis into a status; its name and hardware_id stay.
void fill(diagnostic_msgs::DiagnosticStatus& status, const Diagnosis& diagnosis);

/// What dynamic_reconfigure shows of the settings, and the window in what it asks for.
LaserConfig configOf(const NodeSettings& settings);
LiveSettings liveOf(const LaserConfig& config);

}  // namespace kurumaisu::laser
