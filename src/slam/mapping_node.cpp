// SPDX-License-Identifier: BSD-3-Clause
// scan and tf in; map, map_metadata and tf map -> odom out. What it does with them is in mapper.h.
#include <nav_msgs/GetMap.h>
#include <nav_msgs/OccupancyGrid.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>
#include <optional>

#include "slam/mapper.h"
#include "slam/mapping_settings.h"
#include "slam/pose.h"

namespace k = kurumaisu;

namespace {

constexpr double kWarningPeriod = 5.0;  // [s] of throttled warnings
constexpr double kPollPeriod = 0.02;    // [s] between looks whether transforms have come
constexpr double kTimeJump =
    1.0;  // [s] a scan that much behind the last one, or a clock behind itself, is a new beginning
constexpr double kLevel = 0.99;      // cosine of the tilt beyond which a laser does not measure in the plane
constexpr std::size_t kQueue = 100;  // scans that may wait for their transforms

struct Planar {
  k::Pose2D pose;
  double up;  ///< z of the child's z axis: 1 = upright, -1 = upside down
};

Planar planar(const geometry_msgs::Transform& t) {
  const auto& q = t.rotation;
  const double yaw = std::atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z));
  return {{t.translation.x, t.translation.y, yaw}, 1 - 2 * (q.x * q.x + q.y * q.y)};
}

geometry_msgs::TransformStamped stamped(const k::Pose2D& pose, const ros::Time& stamp,
                                        const std::string& parent, const std::string& child) {
  geometry_msgs::TransformStamped out;
  out.header.stamp = stamp;
  out.header.frame_id = parent;
  out.child_frame_id = child;
  out.transform.translation.x = pose.x;
  out.transform.translation.y = pose.y;
  out.transform.rotation.z = std::sin(pose.theta / 2);
  out.transform.rotation.w = std::cos(pose.theta / 2);
  return out;
}

/// A scan without the mean error of its readings: left in, it would draw the map apart and pull the matcher along
/// corridors. Throws std::invalid_argument for a laser that does not look into the plane.
k::Scan scanOf(const sensor_msgs::LaserScan& message, const Planar& base_from_laser,
               const k::LaserError& error) {
  if (std::abs(base_from_laser.up) < kLevel) throw std::invalid_argument("the laser is tilted");
  const double turn = base_from_laser.up > 0 ? 1 : -1;
  k::Scan scan{message.header.stamp.toSec(),
               {turn * message.angle_min, turn * message.angle_increment, message.time_increment,
                message.range_max, base_from_laser.pose},
               message.ranges};
  for (float& range : scan.ranges) {
    const bool near = range < message.range_min;
    range = near ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(error.range(range));
  }
  return scan;
}

ros::Time lastBeam(const sensor_msgs::LaserScan& scan) {
  return scan.header.stamp +
         ros::Duration(scan.time_increment * (static_cast<double>(scan.ranges.size()) - 1));
}

class MappingNode {
 public:
  MappingNode(ros::NodeHandle& nh, k::MappingNodeSettings settings);

 private:
  struct Waiting {
    sensor_msgs::LaserScan::ConstPtr scan;
    ros::SteadyTime since;
  };

  void onScan(const sensor_msgs::LaserScan::ConstPtr& scan);
  void work();
  bool take(const Waiting& waiting);
  void add(const sensor_msgs::LaserScan& message);
  void drop(const char* code, const std::string& why);
  void reset(const char* why);
  void publishTransform();
  void publishMap();
  nav_msgs::OccupancyGrid message() const;

  k::MappingNodeSettings settings_;
  std::optional<k::Mapper> mapper_;
  std::deque<Waiting> waiting_;
  k::Pose2D map_from_odom_{0, 0, 0};
  bool localised_ = false;  ///< map_from_odom_ is known
  bool map_changed_ = false;
  std::uint64_t dropped_ = 0;
  ros::Time last_scan_;
  ros::Time last_clock_;  // scans may be ahead of the clock: it comes on a connection of its own
  ros::Time last_transform_;
  ros::SteadyTime last_map_;
  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_{buffer_};
  tf2_ros::TransformBroadcaster broadcaster_;
  ros::Publisher map_, metadata_;
  ros::Subscriber scan_;
  ros::ServiceServer service_;
  ros::SteadyTimer poll_, transforms_;
};

MappingNode::MappingNode(ros::NodeHandle& nh, k::MappingNodeSettings settings)
    : settings_(std::move(settings)) {
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
  if (scan->header.stamp + ros::Duration(kTimeJump) < last_scan_) reset("a scan is older than the last one");
  waiting_.push_back({scan, ros::SteadyTime::now()});
  if (waiting_.size() > kQueue) {
    drop("MAPPING_TOO_SLOW", "scans come faster than they can be mapped");
    waiting_.pop_front();
  }
  work();
}

void MappingNode::work() {
  const ros::Time now = ros::Time::now();
  if (now + ros::Duration(kTimeJump) < last_clock_) reset("time ran backwards");
  last_clock_ = now;
  while (!waiting_.empty() && take(waiting_.front())) waiting_.pop_front();
  const ros::SteadyTime steady = ros::SteadyTime::now();
  if (map_changed_ && (steady - last_map_).toSec() >= settings_.map_period) {
    last_map_ = steady;
    publishMap();
  }
}

/// True when done with the scan: mapped, or dropped.
bool MappingNode::take(const Waiting& waiting) {
  const auto& header = waiting.scan->header;
  const ros::Time end = lastBeam(*waiting.scan);
  std::string why;
  if (buffer_.canTransform(settings_.base_frame, header.frame_id, header.stamp, &why) &&
      buffer_.canTransform(settings_.odom_frame, settings_.base_frame, header.stamp, &why) &&
      buffer_.canTransform(settings_.odom_frame, settings_.base_frame, end, &why)) {
    add(*waiting.scan);
    return true;
  }
  if ((ros::SteadyTime::now() - waiting.since).toSec() < settings_.transform_deadline) return false;
  drop("MAPPING_NO_TRANSFORM", "none of " + header.frame_id + " and " + settings_.base_frame + " to " +
                                   settings_.odom_frame + " at " + std::to_string(header.stamp.toSec()) +
                                   " s within transform_deadline" + why);
  return true;
}

void MappingNode::add(const sensor_msgs::LaserScan& message) try {
  const auto at = [this](const std::string& parent, const std::string& child, const ros::Time& stamp) {
    return planar(buffer_.lookupTransform(parent, child, stamp).transform);
  };
  const ros::Time start = message.header.stamp;
  const ros::Time end = lastBeam(message);
  const k::Pose2D first = at(settings_.odom_frame, settings_.base_frame, start).pose;
  const k::Pose2D last = at(settings_.odom_frame, settings_.base_frame, end).pose;
  const k::Scan scan =
      scanOf(message, at(settings_.base_frame, message.header.frame_id, start), settings_.laser_error);
  const auto estimate = mapper_->add(scan, first, last);
  map_from_odom_ = k::compose(estimate.map_from_base, k::between(first, {0, 0, 0}));
  last_scan_ = start;
  localised_ = true;
  map_changed_ = map_changed_ || estimate.map_updated;
} catch (const tf2::TransformException& error) {
  drop("MAPPING_NO_TRANSFORM", error.what());
} catch (const std::invalid_argument& error) {
  drop("MAPPING_BAD_SCAN", error.what());
}

void MappingNode::drop(const char* code, const std::string& why) {
  ++dropped_;
  ROS_WARN_THROTTLE(kWarningPeriod, "%s: scan: dropped, %lu so far: %s", code, dropped_, why.c_str());
}

void MappingNode::reset(const char* why) {
  ROS_WARN("MAPPING_TIME_RESET: %s: the map starts afresh", why);
  buffer_.clear();
  const ros::Time latest = ros::Time::now() + ros::Duration(kTimeJump);
  const auto is_old = [&latest](const Waiting& waiting) { return waiting.scan->header.stamp > latest; };
  waiting_.erase(std::remove_if(waiting_.begin(), waiting_.end(), is_old), waiting_.end());
  mapper_.emplace(settings_.mapper, settings_.seed);
  localised_ = map_changed_ = false;
  last_scan_ = last_transform_ = ros::Time();
  last_map_ = ros::SteadyTime();
}

void MappingNode::publishTransform() {
  const ros::Time stamp = ros::Time::now() + ros::Duration(settings_.transform_tolerance);
  if (!localised_ || stamp <= last_transform_) return;  // tf refuses the same time twice
  last_transform_ = stamp;
  broadcaster_.sendTransform(stamped(map_from_odom_, stamp, settings_.map_frame, settings_.odom_frame));
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
