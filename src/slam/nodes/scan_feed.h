// SPDX-License-Identifier: BSD-3-Clause
// Scans with their transforms, one by one, for a node: in order, in time, and counted.
#pragma once

#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/buffer.h>

#include <cstdint>
#include <functional>
#include <string>

#include "plausible/transform_input.h"
#include "slam/nodes/messages.h"

namespace kurumaisu {

struct FeedSettings {
  ScanFrames frames;
  LaserError error;
  std::string prefix;  ///< of the codes of warnings
  int backlog;         ///< scans that may wait before the older ones are skipped
  int every;           ///< only every n-th scan is taken
};

/// Listens to scan and tf. Calls use() for every scan that has its transforms, and reset() when time has jumped back: the
/// clock, or all scans for a while. An old scan among others is dropped.
class ScanFeed {
 public:
  /// Throws std::invalid_argument for a scan that it cannot use.
  using Use = std::function<void(const ScanQueue::Ready&)>;
  using Reset = std::function<void(const char* why)>;

  ScanFeed(ros::NodeHandle& nh, FeedSettings settings, Use use, Reset reset);

  /// Uses what has its transforms by now; to be called often.
  void work();

  /// Scans that come are not used, and those that wait are forgotten.
  void pause(bool paused);
  bool paused() const { return paused_; }

  double silence() const {
    return (ros::SteadyTime::now() - came_).toSec();
  }  ///< since the last scan came [s]
  /// What scans wait for in vain since so many seconds, in words; empty if for nothing.
  std::string missing(double since) const;

  /// What is wrong with simulated time since so many seconds, in words; empty if nothing, or if nobody needs it.
  std::string clockProblem(double since) const;

  const ScanQueue& queue() const { return queue_; }
  std::uint64_t refusedTransforms() const { return transforms_.refused(); }
  std::uint64_t used() const { return used_; }
  std::uint64_t skipped() const { return skipped_ + queue_.dropped().too_slow; }
  double seconds() const { return seconds_; }  ///< of processor time, for all scans used

 private:
  void onScan(const sensor_msgs::LaserScan::ConstPtr& scan);
  bool isOld(const ros::Time& stamp);
  void lookAtClock();
  void take(const ScanQueue::Ready& ready);
  void begin(const char* why);

  FeedSettings settings_;
  Use use_;
  Reset reset_;
  bool paused_ = false;
  ros::Time last_scan_, last_clock_;  // scans may be ahead of the clock: it comes on a connection of its own
  ros::SteadyTime ticked_ = ros::SteadyTime::now();                ///< the clock changed last
  ros::SteadyTime came_ = ros::SteadyTime::now(), taken_ = came_;  ///< the last scan, and the last one used
  std::string frame_;                                              ///< of the last scan
  int old_ = 0;                                                    ///< scans in a row that are too old
  ros::SteadyTime old_since_;
  std::uint64_t came_in_all_ = 0, used_ = 0, skipped_ = 0;
  double seconds_ = 0;
  tf2_ros::Buffer buffer_;
  TransformInput transforms_;
  ScanQueue queue_;
  ros::Subscriber scan_;
};

}  // namespace kurumaisu
