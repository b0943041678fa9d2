// SPDX-License-Identifier: BSD-3-Clause
// scan and tf in; map, map_metadata and tf map -> odom out. What it does with them is in mapper.h.
#include <nav_msgs/GetMap.h>
#include <nav_msgs/OccupancyGrid.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <cstdint>
#include <optional>

#include "slam/mapper.h"
#include "slam/mapping_settings.h"
#include "slam/messages.h"
#include "slam/pose.h"

namespace k = kurumaisu;

namespace {

constexpr double kPollPeriod = 0.02;  // [s] between looks whether transforms have come
constexpr std::size_t kQueue = 100;   // scans that may wait for their transforms

class MappingNode {
 public:
  MappingNode(ros::NodeHandle& nh, k::MappingNodeSettings settings);

 private:
  void onScan(const sensor_msgs::LaserScan::ConstPtr& scan);
  void work();
  void add(const k::ScanQueue::Ready& ready);
  void reset(const char* why);
  void publishTransform();
  void publishMap();
  nav_msgs::OccupancyGrid message() const;

  k::MappingNodeSettings settings_;
  std::optional<k::Mapper> mapper_;
  k::Pose2D map_from_odom_{0, 0, 0};
  bool localised_ = false;  ///< map_from_odom_ is known
  bool map_changed_ = false;
  ros::Time last_scan_;
  ros::Time last_clock_;  // scans may be ahead of the clock: it comes on a connection of its own
  ros::Time last_transform_;
  ros::SteadyTime last_map_;
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_{buffer_};
  k::ScanQueue queue_;
  tf2_ros::TransformBroadcaster broadcaster_;
  ros::Publisher map_, metadata_;
  ros::Subscriber scan_;
  ros::ServiceServer service_;
  ros::SteadyTimer poll_, transforms_;
};

MappingNode::MappingNode(ros::NodeHandle& nh, k::MappingNodeSettings settings)
    : settings_(std::move(settings)),
      queue_(buffer_, {settings_.odom_frame, settings_.base_frame, settings_.transform_deadline},
             settings_.laser_error, "MAPPING", kQueue) {
  mapper_.emplace(settings_.mapper, settings_.seed);
  map_ = nh.advertise<nav_msgs::OccupancyGrid>("map", 1, true);
  metadata_ = nh.advertise<nav_msgs::MapMetaData>("map_metadata", 1, true);
  using GetMap = nav_msgs::GetMap;
  service_ = nh.advertiseService<GetMap::Request, GetMap::Response>(
      "dynamic_map", [this](GetMap::Request&, GetMap::Response& response) {
        response.map = message();
        return response.map.info.width > 0;
      });
  scan_ = nh.subscribe("scan", kQueue, &MappingNode::onScan, this);
  // Steady timers: timers of simulated time stall when it is set back.
  poll_ =
      nh.createSteadyTimer(ros::WallDuration(kPollPeriod), [this](const ros::SteadyTimerEvent&) { work(); });
  transforms_ = nh.createSteadyTimer(ros::WallDuration(settings_.transform_period),
                                     [this](const ros::SteadyTimerEvent&) { publishTransform(); });
}

void MappingNode::onScan(const sensor_msgs::LaserScan::ConstPtr& scan) {
  if (scan->header.stamp + ros::Duration(k::kTimeJump) < last_scan_)
    reset("a scan is older than the last one");
  queue_.push(scan);
  work();
}

void MappingNode::work() {
  const ros::Time now = ros::Time::now();
  if (now + ros::Duration(k::kTimeJump) < last_clock_) reset("time ran backwards");
  last_clock_ = now;
  while (const auto ready = queue_.next()) add(*ready);
  const ros::SteadyTime steady = ros::SteadyTime::now();
  if (map_changed_ && (steady - last_map_).toSec() >= settings_.map_period) {
    last_map_ = steady;
    publishMap();
  }
}

void MappingNode::add(const k::ScanQueue::Ready& ready) try {
  const auto estimate = mapper_->add(ready.scan, ready.start, ready.end);
  map_from_odom_ = k::compose(estimate.map_from_base, k::between(ready.start, {0, 0, 0}));
  last_scan_ = ready.stamp;
  localised_ = true;
  map_changed_ = map_changed_ || estimate.map_updated;
} catch (const std::invalid_argument& error) {
  queue_.refuse(error.what());
}

void MappingNode::reset(const char* why) {
  ROS_WARN("MAPPING_TIME_RESET: %s: the map starts afresh", why);
  buffer_.clear();
  queue_.forgetAfter(ros::Time::now() + ros::Duration(k::kTimeJump));
  mapper_.emplace(settings_.mapper, settings_.seed);
  localised_ = map_changed_ = false;
  last_scan_ = last_transform_ = ros::Time();
  last_map_ = ros::SteadyTime();
}

void MappingNode::publishTransform() {
  const ros::Time stamp = ros::Time::now() + ros::Duration(settings_.transform_tolerance);
  if (!localised_ || stamp <= last_transform_) return;  // tf refuses the same time twice
  last_transform_ = stamp;
  broadcaster_.sendTransform(k::stamped(map_from_odom_, stamp, settings_.map_frame, settings_.odom_frame));
}

void MappingNode::publishMap() {
  map_changed_ = false;
  const auto grid = message();
  map_.publish(grid);
  metadata_.publish(grid.info);
}

nav_msgs::OccupancyGrid MappingNode::message() const {
  const k::OccupancyGrid grid = mapper_->grid();
  nav_msgs::OccupancyGrid out;
  out.header.stamp = out.info.map_load_time = last_scan_;
  out.header.frame_id = settings_.map_frame;
  out.info.resolution = static_cast<float>(grid.resolution);
  out.info.width = grid.width;
  out.info.height = grid.height;
  out.info.origin.position.x = grid.x;
  out.info.origin.position.y = grid.y;
  out.info.origin.orientation.w = 1;
  out.data = grid.cells;
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "mapping_node");
  ros::NodeHandle nh;  // here, because ROS_FATAL is mute once the last one is gone
  try {
    MappingNode node(nh, k::readMappingNodeSettings(ros::this_node::getName()));
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL("%s", error.what());
    return 1;
  }
  return 0;
}
