// SPDX-License-Identifier: BSD-3-Clause
// What mapping_node publishes of a mapper.
#pragma once

#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>

#include <string>

#include "slam/mapping/mapper.h"
#include "slam/nodes/messages.h"

namespace kurumaisu {

class MappingOutput {
 public:
  /// occ_thresh: share [-] above which a cell is a wall.
  MappingOutput(ros::NodeHandle& nh, std::string map_frame, std::string odom_frame, double occ_thresh);

  nav_msgs::OccupancyGrid mapOf(const Mapper& mapper, const ros::Time& stamp) const;
  void map(const Mapper& mapper, const ros::Time& stamp);
  /// With the particles and their entropy.
  void estimate(const Mapper& mapper, const Mapper::Estimate& estimate, const ros::Time& stamp);
  void trajectory(const Mapper& mapper, const ros::Time& stamp);
  /// tf map -> odom, unless it is not later than the last one, which tf refuses.
  void transform(const Pose2D& map_from_odom, const ros::Time& stamp);
  /// Time may begin anew.
  void forget() { last_transform_ = ros::Time(); }

 private:
  std::string map_frame_, odom_frame_;
  double occ_thresh_;
  ros::Time last_transform_;
  tf2_ros::TransformBroadcaster broadcaster_;
  ros::Publisher map_, metadata_, cloud_, path_, entropy_, pose_, trajectory_;
};

}  // namespace kurumaisu
