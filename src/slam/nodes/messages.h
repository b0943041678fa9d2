// SPDX-License-Identifier: BSD-3-Clause
// What the nodes make of ROS's scans and transforms. For them only.
#pragma once

#include <geometry_msgs/PoseWithCovariance.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/OccupancyGrid.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/buffer.h>

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "model/laser_error.h"
#include "plausible/messages.h"
#include "slam/basics/gaussian.h"
#include "slam/basics/occupancy.h"
#include "slam/basics/scan.h"

namespace kurumaisu {

/// A transform as seen from above.
struct Planar {
  Pose2D pose;
  double up;  ///< z of the child's z axis: 1 = upright, -1 = upside down
};
Planar planar(const geometry_msgs::Transform& transform);

geometry_msgs::TransformStamped stamped(const Pose2D& pose, const ros::Time& stamp, const std::string& parent,
                                        const std::string& child);

geometry_msgs::Pose messageOf(const Pose2D& pose);
geometry_msgs::PoseWithCovariance messageOf(const Gaussian& pose);

/// The cells, with the lower left corner at the origin: where that is the caller knows. Throws as requireMap() does.
OccupancyGrid gridOf(const nav_msgs::OccupancyGrid& map);
nav_msgs::OccupancyGrid messageOf(const OccupancyGrid& grid, const ros::Time& stamp,
                                  const std::string& frame);

/// A scan without the mean error of its readings. Throws std::invalid_argument for a laser that does not look into the
/// plane.
Scan scanOf(const sensor_msgs::LaserScan& message, const Planar& base_from_laser, const LaserError& error);

ros::Time lastBeam(const sensor_msgs::LaserScan& scan);

/// What a scan needs to know of transforms.
struct ScanFrames {
  std::string odom;
  std::string base;
  double deadline;  ///< a scan waits for its transforms so long at most [s]
};

/// Scans that wait until their transforms are there; those that wait in vain are dropped, counted and warned of.
class ScanQueue {
 public:
  struct Ready {
    Scan scan;
    Pose2D start;  ///< odom_from_base at the first beam; headings go on from scan to scan, beyond +-pi
    Pose2D end;    ///< and at the last one
    ros::Time stamp;
  };
  struct Dropped {
    std::uint64_t no_transform = 0, bad_scan = 0, too_old = 0, too_slow = 0;
    std::uint64_t lost() const { return no_transform + bad_scan + too_old; }
    std::uint64_t all() const { return lost() + too_slow; }
  };

  /// prefix: of the codes of warnings. capacity: scans that wait. Keeps a reference to the buffer.
  ScanQueue(const tf2_ros::Buffer& buffer, ScanFrames frames, LaserError error, std::string prefix,
            std::size_t capacity);

  /// Of scans that make sense: see requireScan().
  void push(const sensor_msgs::LaserScan::ConstPtr& scan);
  /// The next scan that has its transforms, in order of arrival; none while the first one waits for its own.
  std::optional<Ready> next();
  /// Forgets scans later than a time.
  void forgetAfter(const ros::Time& latest);
  /// Counts a scan that the caller could not use; or did not, because it is older than what was used.
  void refuse(const std::string& why);
  void refuseOld(const std::string& why);

  std::size_t size() const { return waiting_.size(); }
  const Dropped& dropped() const { return dropped_; }
  /// Of the last scan dropped.
  const std::string& reason() const { return reason_; }

 private:
  struct Waiting {
    sensor_msgs::LaserScan::ConstPtr scan;
    ros::SteadyTime since;
  };

  bool has(const sensor_msgs::LaserScan& scan, std::string* why) const;
  Ready ready(const sensor_msgs::LaserScan& message);
  void drop(std::uint64_t& count, const char* code, const std::string& why);

  const tf2_ros::Buffer* buffer_;
  ScanFrames frames_;
  LaserError error_;
  std::string prefix_;
  std::size_t capacity_;
  std::deque<Waiting> waiting_;
  double heading_ = 0;  ///< of the last scan, not wrapped
  Dropped dropped_;
  std::string reason_;
};

}  // namespace kurumaisu
