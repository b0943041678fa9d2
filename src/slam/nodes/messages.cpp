// SPDX-License-Identifier: BSD-3-Clause
#include "slam/nodes/messages.h"

#include <ros/console.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "slam/basics/pose.h"

namespace kurumaisu {
namespace {

constexpr double kWarningPeriod = 5.0;  // [s] of throttled warnings
constexpr double kLevel = 0.99;  // cosine of the tilt beyond which a laser does not measure in the plane
constexpr std::array<int, 3> kRows{0, 1, 5};  // x, y, yaw among six

}  // namespace

Planar planar(const geometry_msgs::Transform& t) {
  const auto& q = t.rotation;
  const double yaw = std::atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z));
  return {{t.translation.x, t.translation.y, yaw}, 1 - 2 * (q.x * q.x + q.y * q.y)};
}

geometry_msgs::TransformStamped stamped(const Pose2D& pose, const ros::Time& stamp, const std::string& parent,
                                        const std::string& child) {
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

geometry_msgs::Pose messageOf(const Pose2D& pose) {
  geometry_msgs::Pose out;
  out.position.x = pose.x;
  out.position.y = pose.y;
  out.orientation.z = std::sin(pose.theta / 2);
  out.orientation.w = std::cos(pose.theta / 2);
  return out;
}

geometry_msgs::PoseWithCovariance messageOf(const Gaussian& pose) {
  geometry_msgs::PoseWithCovariance out;
  out.pose = messageOf(pose.mean);
  for (int i = 0; i < 9; ++i) out.covariance[6 * kRows[i / 3] + kRows[i % 3]] = pose.covariance(i / 3, i % 3);
  return out;
}

OccupancyGrid gridOf(const nav_msgs::OccupancyGrid& map) {
  requireMap(map);
  // A float: 0.05 comes as 0.0500000007.
  const double resolution = std::nearbyint(static_cast<double>(map.info.resolution) * 1e6) / 1e6;
  return {resolution, 0, 0, static_cast<int>(map.info.width), static_cast<int>(map.info.height), map.data};
}

nav_msgs::OccupancyGrid messageOf(const OccupancyGrid& grid, const ros::Time& stamp,
                                  const std::string& frame) {
  nav_msgs::OccupancyGrid out;
  out.header.stamp = out.info.map_load_time = stamp;
  out.header.frame_id = frame;
  out.info.resolution = static_cast<float>(grid.resolution);
  out.info.width = grid.width;
  out.info.height = grid.height;
  out.info.origin.position.x = grid.x;
  out.info.origin.position.y = grid.y;
  out.info.origin.orientation.w = 1;
  out.data = grid.cells;
  return out;
}

Scan scanOf(const sensor_msgs::LaserScan& message, const Planar& base_from_laser, const LaserError& error) {
  if (std::abs(base_from_laser.up) < kLevel) throw std::invalid_argument("the laser is tilted");
  const double turn = base_from_laser.up > 0 ? 1 : -1;
  Scan scan{message.header.stamp.toSec(),
            {turn * message.angle_min, turn * message.angle_increment, message.time_increment,
             std::fmin(message.range_max, plausible::kRange.most), base_from_laser.pose},
            message.ranges};
  for (float& range : scan.ranges) {
    const bool near = range < message.range_min;
    range = near ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(error.range(range));
  }
  return scan;
}

ros::Time lastBeam(const sensor_msgs::LaserScan& scan) {
  return later(scan.header.stamp, scan.time_increment * (static_cast<double>(scan.ranges.size()) - 1));
}

ScanQueue::ScanQueue(const tf2_ros::Buffer& buffer, ScanFrames frames, LaserError error, std::string prefix,
                     std::size_t capacity)
    : buffer_(&buffer),
      frames_(std::move(frames)),
      error_(error),
      prefix_(std::move(prefix)),
      capacity_(capacity) {}

void ScanQueue::push(const sensor_msgs::LaserScan::ConstPtr& scan) {
  waiting_.push_back({scan, ros::SteadyTime::now()});
  if (waiting_.size() <= capacity_) return;
  waiting_.pop_front();
  drop(dropped_.too_slow, "TOO_SLOW", "scans come faster than they can be processed");
}

bool ScanQueue::has(const sensor_msgs::LaserScan& scan, std::string* why) const {
  const ros::Time stamp = scan.header.stamp;
  return buffer_->canTransform(frames_.base, frameOf(scan.header.frame_id), stamp, why) &&
         buffer_->canTransform(frames_.odom, frames_.base, stamp, why) &&
         buffer_->canTransform(frames_.odom, frames_.base, lastBeam(scan), why);
}

std::optional<ScanQueue::Ready> ScanQueue::next() {
  while (!waiting_.empty()) {
    // Out of the queue first: whatever is thrown, the next round is about the next scan.
    const Waiting front = waiting_.front();
    waiting_.pop_front();
    std::string why;
    try {
      if (has(*front.scan, &why)) return ready(*front.scan);
      if ((ros::SteadyTime::now() - front.since).toSec() < frames_.deadline) {
        waiting_.push_front(front);
        return std::nullopt;
      }
      drop(dropped_.no_transform, "NO_TRANSFORM",
           "none of " + front.scan->header.frame_id + " and " + frames_.base + " to " + frames_.odom +
               " at " + std::to_string(front.scan->header.stamp.toSec()) + " s within transform_deadline" +
               why);
    } catch (const tf2::TransformException& error) {
      drop(dropped_.no_transform, "NO_TRANSFORM", error.what());
    } catch (const std::exception& error) {
      refuse(error.what());
    }
  }
  return std::nullopt;
}

ScanQueue::Ready ScanQueue::ready(const sensor_msgs::LaserScan& message) {
  const auto at = [this](const std::string& parent, const std::string& child, const ros::Time& stamp) {
    return planar(buffer_->lookupTransform(parent, child, stamp).transform);
  };
  const auto onwards = [this](Pose2D pose) {
    pose.theta = heading_ += wrapAngle(pose.theta - heading_);
    return pose;
  };
  const ros::Time stamp = message.header.stamp;
  Scan scan = scanOf(message, at(frames_.base, frameOf(message.header.frame_id), stamp), error_);
  const Pose2D start = onwards(at(frames_.odom, frames_.base, stamp).pose);
  const Pose2D end = onwards(at(frames_.odom, frames_.base, lastBeam(message)).pose);
  return {std::move(scan), start, end, stamp};
}

void ScanQueue::forgetAfter(const ros::Time& latest) {
  const auto is_old = [&latest](const Waiting& waiting) { return waiting.scan->header.stamp > latest; };
  waiting_.erase(std::remove_if(waiting_.begin(), waiting_.end(), is_old), waiting_.end());
}

void ScanQueue::refuse(const std::string& why) { drop(dropped_.bad_scan, "BAD_SCAN", why); }

void ScanQueue::refuseOld(const std::string& why) { drop(dropped_.too_old, "OLD_SCAN", why); }

void ScanQueue::drop(std::uint64_t& count, const char* code, const std::string& why) {
  ++count;
  reason_ = prefix_ + "_" + code + ": " + why;
  ROS_WARN_THROTTLE(kWarningPeriod, "%s_%s: scan: dropped, %lu so far: %s", prefix_.c_str(), code,
                    dropped_.all(), why.c_str());
}

}  // namespace kurumaisu
