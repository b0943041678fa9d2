// SPDX-License-Identifier: BSD-3-Clause
#include "slam/nodes/mapping_output.h"

#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <kurumaisu/Trajectory.h>
#include <nav_msgs/Path.h>
#include <std_msgs/Float64.h>

namespace kurumaisu {
namespace {

using PoseMessage = geometry_msgs::PoseWithCovarianceStamped;

Gaussian gaussianOf(const Pose2D& pose, const std::array<double, 9>& covariance) {
  return {pose, Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(covariance.data())};
}

}  // namespace

MappingOutput::MappingOutput(ros::NodeHandle& nh, std::string map_frame, std::string odom_frame,
                             double occ_thresh)
    : map_frame_(std::move(map_frame)), odom_frame_(std::move(odom_frame)), occ_thresh_(occ_thresh) {
  map_ = nh.advertise<nav_msgs::OccupancyGrid>("map", 1, true);
  metadata_ = nh.advertise<nav_msgs::MapMetaData>("map_metadata", 1, true);
  cloud_ = nh.advertise<geometry_msgs::PoseArray>("particlecloud", 1, true);
  path_ = nh.advertise<nav_msgs::Path>("trajectory", 1, true);
  ros::NodeHandle own("~");
  entropy_ = own.advertise<std_msgs::Float64>("entropy", 1, true);
  pose_ = own.advertise<PoseMessage>("pose", 1, true);
  trajectory_ = own.advertise<Trajectory>("trajectory_with_covariance", 1, true);
}

nav_msgs::OccupancyGrid MappingOutput::mapOf(const Mapper& mapper, const ros::Time& stamp) const {
  return messageOf(decided(mapper.grid(), occ_thresh_), stamp, map_frame_);
}

void MappingOutput::map(const Mapper& mapper, const ros::Time& stamp) {
  const auto grid = mapOf(mapper, stamp);
  map_.publish(grid);
  metadata_.publish(grid.info);
}

void MappingOutput::estimate(const Mapper& mapper, const Mapper::Estimate& estimate, const ros::Time& stamp) {
  std_msgs::Float64 entropy;
  entropy.data = mapper.entropy();
  entropy_.publish(entropy);
  PoseMessage pose;
  pose.header.stamp = stamp;
  pose.header.frame_id = map_frame_;
  pose.pose = messageOf(gaussianOf(estimate.map_from_base, estimate.covariance));
  pose_.publish(pose);
  geometry_msgs::PoseArray cloud;
  cloud.header = pose.header;
  for (const auto& [each, weight] : mapper.particles()) cloud.poses.push_back(messageOf(each));
  cloud_.publish(cloud);
}

void MappingOutput::trajectory(const Mapper& mapper, const ros::Time& stamp) {
  Trajectory trajectory;
  nav_msgs::Path path;
  trajectory.header.stamp = stamp;
  trajectory.header.frame_id = map_frame_;
  path.header = trajectory.header;
  for (const UncertainPose& node : mapper.nodes()) {
    PoseMessage pose;
    pose.header.stamp.fromSec(node.stamp);
    pose.header.frame_id = map_frame_;
    pose.pose = messageOf(gaussianOf(node.pose, node.covariance));
    trajectory.poses.push_back(pose);
    geometry_msgs::PoseStamped point;
    point.header = pose.header;
    point.pose = pose.pose.pose;
    path.poses.push_back(point);
  }
  trajectory_.publish(trajectory);
  path_.publish(path);
}

void MappingOutput::transform(const Pose2D& map_from_odom, const ros::Time& stamp) {
  if (stamp <= last_transform_) return;
  last_transform_ = stamp;
  broadcaster_.sendTransform(stamped(map_from_odom, stamp, map_frame_, odom_frame_));
}

}  // namespace kurumaisu
