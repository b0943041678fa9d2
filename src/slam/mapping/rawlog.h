// SPDX-License-Identifier: BSD-3-Clause
// Recordings of MRPT (.rawlog): scans and odometry as plain values.
#pragma once

#include <string>
#include <vector>

#include "slam/basics/scan.h"

namespace kurumaisu {

/// What a mapper needs of a recording. All of one length, in order of time.
struct LaserLog {
  Fan fan;  ///< of all scans; rawlogs do not say when a beam was taken: increment 0
  std::size_t beams;
  std::vector<double> times;               ///< of the scans [s], since 1970
  std::vector<Pose2D> odom;                ///< odom_from_base at the scans; the heading is not wrapped
  std::vector<std::vector<float>> ranges;  ///< as in Scan
};

/// Reads scans and odometry, in either form of rawlog: pairs of actions (odometry increments) and sensory
/// frames, or observations in order of time (CObservationOdometry). Of several lasers the first one is read.
/// Throws std::runtime_error that names the file and what is wrong with it.
LaserLog readRawlog(const std::string& path);

/// Writes pairs of actions and sensory frames, as MRPT's own programs read them. What beams moved during a scan should
/// have been taken out before: rawlogs cannot say it. Throws std::runtime_error naming the file.
void writeRawlog(const std::string& path, const LaserLog& log);

}  // namespace kurumaisu
