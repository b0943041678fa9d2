// SPDX-License-Identifier: BSD-3-Clause
// /tf and /tf_static into a buffer, in a thread of their own. In place of tf2_ros::TransformListener, which ends its
// program at a stamp near the end of ros::Time, and lets one transform of the future keep all others out.
#pragma once

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/buffer.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <string>

namespace kurumaisu {

class TransformInput {
 public:
  /// prefix: of the codes of warnings. The buffer must outlive this object.
  TransformInput(tf2_ros::Buffer& buffer, std::string prefix);

  /// Transforms that were not taken.
  std::uint64_t refused() const { return refused_; }

 private:
  using Event = ros::MessageEvent<const tf2_msgs::TFMessage>;

  ros::Subscriber hear(const std::string& topic, bool is_static);
  void take(const Event& event, bool is_static);
  void requireNear(const geometry_msgs::TransformStamped& transform, const ros::Time& now);
  void refuse(const std::string& why);

  tf2_ros::Buffer* buffer_;
  std::string prefix_;
  std::atomic<std::uint64_t> refused_{0};
  ros::Time last_clock_;
  std::map<std::string, ros::Time> stamps_;  ///< of the last transform of each child
  ros::CallbackQueue queue_;
  ros::NodeHandle nh_;
  ros::Subscriber moving_, fixed_;
  ros::AsyncSpinner spinner_{1, &queue_};
};

}  // namespace kurumaisu
